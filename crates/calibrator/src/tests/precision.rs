//! Single precision against double: the same walk through the same calibrator, number by number.

use std::vec::Vec;

use cvg_model::{AxisForces, Float, Pendulum};

use super::commits::correlated;
use super::*;
use crate::parameters::OTHERS;
use crate::state::{Commit, State};
use crate::ud::Ud;
use crate::{Commands, Health};

fn of<T: Float>(s: &Settings) -> Calibrator<T> {
    Calibrator::new(s).expect("inside its domain")
}

/// Every parameter in force, by two fifths of what is expected, in both senses.
fn in_force<T: Float>(c: &Calibrator<T>) -> State<T> {
    let value = |p: Parameter| {
        let sign = if (p as usize).is_multiple_of(3) { -0.4 } else { 0.4 };
        T::from_f64(sign) * p.expected::<T>()
    };
    c.start_from(&Parameter::ALL.map(value)).expect("of a device")
}

/// What is measured and commanded in a control step: at virtual precession for a time, and then the base turns too.
fn step<T: Float>(i: usize) -> (Pendulum<T>, (T, T), Commands<T>) {
    let t = T::from_f64;
    let (n, k) = (i as f64, 2.56);
    // half a turn is passed once the loops have settled
    let theta = 3.74 - 1.2e-4 * n + if i > 6000 { 3e-4 * (n - 6000.0) } else { 0.0 };
    let wave = (1e-3 * n).sin();
    let (e, q, l) = (1.0 + 0.02 * wave, 3e-3 * (2e-3 * n).cos(), 2e-3 * wave);
    let pendulum = Pendulum {
        e: t(e * k),
        q: t(q * k),
        r: t((2.0 * theta).cos() * k),
        s: t((2.0 * theta).sin() * k),
        l: t(l * k),
    };
    let commands = Commands {
        energy_v: t(-0.02 - 0.01 * wave),
        precession_v: t(0.15),
        quadrature_v: t(0.1 * (2.0 * theta).sin()),
    };
    (pendulum, (t(theta.cos()), t(theta.sin())), commands)
}

/// Groups of numbers, each compared by its largest.
type Shown = Vec<(&'static str, Vec<f64>)>;

fn show<T: Float>(shown: &mut Shown, name: &'static str, numbers: impl IntoIterator<Item = T>) {
    shown.push((name, numbers.into_iter().map(T::to_f64).collect()));
}

fn walked<T: Float>() -> Shown {
    let c = of::<T>(&settings());
    let mut shown = Vec::new();
    let mut s = in_force(&c);
    let t = T::from_f64;
    for (x_c, x_s, y_c, y_s) in [(1.2, 0.1, -0.9, 0.3), (-0.4, 0.2, 1.5, -0.1), (0.7, -1.1, 0.2, 0.6)] {
        let e = c.readout(&s, &Envelope::new(t(x_c), t(x_s), t(y_c), t(y_s)));
        show(&mut shown, "readout", [e.x_c, e.x_s, e.y_c, e.y_s]);
        let f = c.drives(&s, &AxisForces { x_c: t(x_c), x_s: t(x_s), y_c: t(y_c), y_s: t(y_s) });
        show(&mut shown, "drives", [f.x_c, f.x_s, f.y_c, f.y_s]);
    }
    for i in 0..12_000 {
        let (p, direction, commands) = step(i);
        c.step(&mut s, &p, direction, &commands, Health::Operating);
        if i % 80 != 70 {
            continue;
        }
        let sample = &s.sample;
        show(&mut shown, "y", sample.y);
        show(&mut shown, "direction", [sample.cos, sample.sin, sample.cos_2, sample.sin_2]);
        let p = &sample.push;
        show(&mut shown, "push", [p.along, p.aside, p.quadrature, p.across, sample.r, sample.per_amplitude]);
        show(&mut shown, "what acted", sample.early.into_iter().chain(sample.late));
        show(&mut shown, "seen", s.filter.seen);
        for of_channel in s.filter.shown {
            show(&mut shown, "shown", of_channel);
        }
        show(&mut shown, "learned", s.filter.mean);
        show(&mut shown, "known to", (0..N).map(|j| s.filter.ud.variance(j)));
        let correlated = (0..N).map(|j| s.filter.ud.covariance(j, OTHERS + 1));
        show(&mut shown, "correlated", correlated);
        let f = c.forward(&s, direction.0, direction.1, T::one());
        show(&mut shown, "forward", [f.precession_v, f.quadrature_v, f.detuning_rad_s]);
    }
    let told = c.status(&s);
    show(&mut shown, "bias", [told.bias_rad]);
    let estimates = Parameter::ALL.into_iter().filter_map(|p| s.estimate(p)).flat_map(|e| [e.value, e.sigma]);
    show(&mut shown, "estimates", estimates);
    shown
}

#[track_caller]
fn alike(single: &Shown, double: &Shown, share: impl Fn(&str) -> f64) {
    assert_eq!(single.len(), double.len());
    for (n, ((name, single), (_, double))) in single.iter().zip(double).enumerate() {
        let largest = double.iter().fold(1e-6, |most: f64, v| most.max(v.abs()));
        for (a, b) in single.iter().zip(double) {
            assert!((a - b).abs() <= share(name) * largest, "{n}: {name}: {single:?} and not {double:?}");
        }
    }
}

#[test]
fn a_calibrator_in_single_precision_is_that_in_double() {
    // what is put out at once is rounded a few times, what is learned by all that was seen
    alike(&walked::<f32>(), &walked::<f64>(), |name| match name {
        "readout" | "drives" | "forward" | "y" | "direction" | "push" => 1e-5,
        _ => 3e-3,
    });
}

fn converted<T: Float>(from: &Ud<f64>) -> Ud<T> {
    Ud { above: from.above.map(T::from_f64), d: from.d.map(T::from_f64) }
}

/// A commit of what a filter believes that took some measurements, and where it is `back` the way back from it.
fn committed<T: Float>(stage: u8, moving: u16, back: bool) -> Shown {
    let c = of::<T>(&settings());
    let mut s = in_force(&c);
    s.filter.ud = converted(&correlated(0.01));
    s.filter.mean = core::array::from_fn(|j| T::from_f64(0.9 * (((j * 37 + 11) % 23) as f64 / 23.0 - 0.4)));
    let schedule = &mut s.schedule;
    (schedule.live, schedule.stage, schedule.moving, schedule.angle_used) = (true, stage, moving, 250);
    let ways = if back { &[Commit::Forth, Commit::Back][..] } else { &[Commit::Forth] };
    for way in ways {
        s.schedule.commit = *way;
        for k in 0..80 {
            s.step = k;
            c.work(&mut s);
        }
    }
    let mut shown = Vec::new();
    show(&mut shown, "known", Parameter::ALL.map(|p| s.correction.known(p) / p.expected()));
    show(&mut shown, "drives", s.correction.drives.numbers());
    let (y, x) = (s.correction.y_of_y, s.correction.y_of_x);
    show(&mut shown, "detection", [y.re, y.im, x.re, x.im]);
    show(&mut shown, "learned", s.filter.mean);
    show(&mut shown, "on trial", s.trial);
    show(&mut shown, "known to", (0..N).map(|j| s.filter.ud.variance(j)));
    show(&mut shown, "correlated", (0..N).map(|j| s.filter.ud.covariance(j, OTHERS + 2)));
    let counts = [s.schedule.stage.into(), s.schedule.settle, s.schedule.uses_of_symmetry, s.taken_back];
    show(&mut shown, "counts", counts.map(f64::from));
    shown
}

#[test]
fn a_commit_in_single_precision_is_that_in_double() {
    for stage in 0..=4 {
        for (moving, back) in [(0, false), (9, false), (9, true)] {
            alike(&committed::<f32>(stage, moving, back), &committed::<f64>(stage, moving, back), |_| 1e-5);
        }
    }
}

fn a_record_is_restored<T: Float + core::fmt::Debug>() {
    let c = of::<T>(&settings());
    let mut s = in_force(&c);
    s.filter.ud = converted(&correlated(0.5));
    let back = c.restore(&c.save(&s)).expect("whole");
    assert_eq!(back.correction, s.correction);
    for i in OTHERS..N {
        for j in OTHERS..N {
            let (restored, saved) = (back.filter.ud.covariance(i, j).to_f64(), s.filter.ud.covariance(i, j).to_f64());
            near(restored, saved, 1e-6 * saved.abs());
        }
    }
    assert_eq!(c.save(&back)[8..], c.save(&s)[8..]);
}

#[test]
fn a_record_is_restored_to_the_bit_in_either_precision() {
    a_record_is_restored::<f32>();
    a_record_is_restored::<f64>();
}
