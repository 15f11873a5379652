//! Faults at the carrier: whatever happens to the signals, no command is without bounds, and the instrument is back in
//! whole-angle mode or in a fault with a name within the time that the documentation states.

use core::f64::consts::TAU;

use cvg_instrument::{Fault, Mode, Settings};
use cvg_model::{Envelope, Float};
use cvg_tests::carrier::{SAMPLE_HZ, Watched, device, samples};

/// How a fault ends, within how many seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ends {
    Back(f64),
    In(Fault, f64),
    /// in one of these
    InOneOf(&'static [Fault], f64),
}
use Ends::{Back, In, InOneOf};

/// A row of the documentation's table.
struct Row {
    what: &'static str,
    ends: Ends,
}

/// A mirrored plane makes one of the two loops unstable at every angle: the amplitude or the quadrature runs away.
const MIRRORED: Ends = InOneOf(&[Fault::AmplitudeHigh, Fault::QuadratureHigh, Fault::Saturated], 4.0);

/// The rate at which the faults happen: slow enough for the pattern to be anywhere for a while.
const RATE_DPS: f64 = 30.0;

fn started<T: Float>() -> Watched<T> {
    Watched::started(&device(), &Settings::default(), RATE_DPS)
}

/// The loop ends as the row says while `channel` acts, and stays there for two seconds.
fn ends_as_said<T: Float>(mut l: Watched<T>, row: &Row, mut channel: impl FnMut([T; 2]) -> [T; 2]) {
    match row.ends {
        Back(within_s) => {
            let (mut astray_s, mut fault) = (0.0, None);
            for k in 0..samples(within_s + 2.0) {
                l.sample(&mut channel);
                if l.status.mode != Mode::WholeAngle {
                    (astray_s, fault) = ((k + 1) as f64 / SAMPLE_HZ, fault.or(l.status.fault));
                }
            }
            println!("{}: back after {astray_s:.3} s, on the way {fault:?}", row.what);
            assert!(astray_s <= within_s, "{}: {:?}", row.what, l.carrier.state.supervisor);
            let p = l.carrier.state.seen.compensated.pendulum();
            let (e, q) = (p.e.to_f64(), p.q.to_f64());
            assert!((e - 1.0).abs() < 0.05 && q.abs() < 0.05, "{}: energy {e}, quadrature {q}", row.what);
        }
        In(fault, within_s) => ends_in(l, row, &[fault], within_s, channel),
        InOneOf(faults, within_s) => ends_in(l, row, faults, within_s, channel),
    }
}

fn ends_in<T: Float>(
    mut l: Watched<T>,
    row: &Row,
    faults: &[Fault],
    within_s: f64,
    mut channel: impl FnMut([T; 2]) -> [T; 2],
) {
    let took = l.until_through(within_s, &mut channel, |s| s.mode == Mode::Fault);
    let took = took.unwrap_or_else(|| panic!("{}: {:?}", row.what, l.carrier.state.supervisor));
    println!("{}: {:?} after {took:.3} s", row.what, l.status.fault);
    let mut last = None;
    // the starts that follow end in a named fault too
    for _ in 0..samples(16.0) {
        l.sample(&mut channel);
        if let Some(fault) = l.status.fault
            && last != Some(fault)
        {
            println!("  {fault:?}");
            last = Some(fault);
            assert!(faults.contains(&fault), "{}: {fault:?}", row.what);
        }
    }
    assert_eq!(l.status.mode, Mode::Fault, "{}: it keeps trying: {:?}", row.what, l.carrier.state.supervisor);
}

/// One fault: its row, and what happens, as a test in both precisions.
macro_rules! fault {
    ($name:ident, $row:ident, $what:literal, $ends:expr, |$l:ident| $happens:block, $channel:expr) => {
        const $row: Row = Row { what: $what, ends: $ends };

        mod $name {
            use super::*;
            fn ends<T: Float>() {
                #[allow(unused_mut)]
                let mut $l = started::<T>();
                $happens
                ends_as_said($l, &$row, $channel);
            }
            //= specs/dsp.md#recovery
            //= type=test
            //# After a fault the instrument MUST be in whole-angle mode again or in a fault with a name within the stated time.
            #[test]
            fn in_f32() {
                ends::<f32>();
            }
            //= specs/dsp.md#recovery
            //= type=test
            //# After a fault the instrument MUST be in whole-angle mode again or in a fault with a name within the stated time.
            #[test]
            fn in_f64() {
                ends::<f64>();
            }
        }
    };
}

fn nan<T: Float>() -> T {
    T::from_f64(f64::NAN)
}

fault!(
    one_sample_not_a_number,
    NAN_SAMPLE,
    "one sample is NaN",
    Back(0.05),
    |l| { l.sample(|[_, y]| [nan(), y]) },
    |v| v
);
fault!(
    channel_not_a_number_for_a_while,
    NAN_BURST,
    "X is NaN for 20 ms",
    Back(0.05),
    |l| { l.run_through(0.02, |_, [_, y]| [nan(), y]) },
    |v| v
);
fault!(channel_not_a_number, NAN_FOREVER, "X stays NaN", In(Fault::InvalidSamples, 0.15), |l| {}, |[_, y]| [nan(), y]);
fault!(channel_infinite, INFINITE, "Y stays infinite", In(Fault::InvalidSamples, 0.15), |l| {}, |[x, _]| [
    x,
    T::from_f64(f64::INFINITY)
]);
fault!(channel_stuck, STUCK, "X repeats one value", In(Fault::StuckChannel, 0.05), |l| {}, |[_, y]| [
    T::from_f64(0.3),
    y
]);
fault!(channel_dropped, DROPPED, "X reads zero", In(Fault::DeadChannel, 0.5), |l| {}, |[_, y]| [T::zero(), y]);
fault!(channel_of_noise, NOISE, "X carries noise alone", In(Fault::DeadChannel, 0.5), |l| {}, {
    let mut draws = cvg_tests::bench::Draws::new(1);
    move |[_, y]| [T::from_f64(draws.between(-3e-4, 3e-4)), y]
});
fault!(channels_swapped, SWAPPED, "X and Y are swapped", MIRRORED, |l| {}, |[x, y]| [y, x]);
fault!(channel_inverted, INVERTED, "X is inverted", MIRRORED, |l| {}, |[x, y]| [-x, y]);
fault!(
    converter_saturated,
    SATURATED,
    "both readouts are four times as large, beyond the converters' range",
    Back(0.8),
    |l| {},
    |[x, y]| [x, y].map(|v| (v * T::ratio(4, 1)).bounded(T::from_f64(2.5)))
);
fault!(
    amplitude_kicked,
    KICK,
    "a shock: the amplitude doubles, the pattern turns by 40°",
    Back(0.8),
    |l| {
        let v = l.carrier.plant.vibration();
        let (sin, cos) = 40_f64.to_radians().sin_cos();
        l.carrier.plant.set_vibration(&(v.turned(sin, cos) * 2.0));
    },
    |v| v
);
fault!(
    phase_lost,
    PHASE,
    "the reference's phase jumps by 90°",
    Back(0.2),
    |l| { l.state().phasor = l.state().phasor.turned(T::zero(), T::one()) },
    |v| v
);
fault!(
    frequency_lost,
    FREQUENCY,
    "the reference's frequency is wrong by 30 Hz",
    Back(0.5),
    |l| { l.state().lock.detuning_rad_s = T::from_f64(TAU * 30.0) },
    |v| v
);
fault!(gain_step, GAIN, "Y's gain rises by 20 %", Back(0.05), |l| {}, |[x, y]| [x, y * T::ratio(6, 5)]);
fault!(
    no_samples,
    SILENCE,
    "20 ms without samples, the drives hold",
    Back(0.3),
    |l| {
        // no whole number of the carrier's periods
        for _ in 0..2003 {
            l.carrier.step_without_electronics();
        }
    },
    |v| v
);
fault!(
    brown_out,
    BROWN_OUT,
    "the electronics restart while the resonator vibrates",
    Back(0.3),
    |l| {
        let fresh = l.instrument().start();
        *l.state() = fresh;
    },
    |v| v
);
fault!(
    state_overwritten,
    OVERWRITTEN,
    "every number of the loops' state is NaN",
    Back(1.5),
    |l| {
        let s = l.state();
        let wrong = Envelope::new(nan(), nan(), nan(), nan());
        s.window.mixed = wrong;
        (s.window.x, s.window.y) = (nan(), nan());
        (s.phasor.cos, s.phasor.sin, s.phasor.step_cos, s.phasor.step_sin) = (nan(), nan(), nan(), nan());
        (s.drive.x_c, s.drive.x_s, s.drive.y_c, s.drive.y_s) = (nan(), nan(), nan(), nan());
        (s.energy.integral, s.quadrature.integral, s.rate.integral) = (nan(), nan(), nan());
        s.lock.detuning_rad_s = nan();
        (s.precession.cos_2, s.precession.sin_2, s.precession.sin_2_per_window) = (nan(), nan(), nan());
    },
    |v| v
);

/// Every fault that is tested.
const ROWS: &[&Row] = &[
    &NAN_SAMPLE,
    &NAN_BURST,
    &NAN_FOREVER,
    &INFINITE,
    &STUCK,
    &DROPPED,
    &NOISE,
    &SWAPPED,
    &INVERTED,
    &SATURATED,
    &KICK,
    &PHASE,
    &FREQUENCY,
    &GAIN,
    &SILENCE,
    &BROWN_OUT,
    &OVERWRITTEN,
];

#[test]
fn the_documentation_has_a_row_for_every_fault_with_its_ending_and_its_time() {
    let page =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/src/instrument.md")).expect("the page");
    for row in ROWS {
        let (ending, within_s) = match row.ends {
            Back(within_s) => ("whole angle".to_owned(), within_s),
            In(fault, within_s) => (format!("`{fault:?}`"), within_s),
            InOneOf(faults, within_s) => {
                (faults.iter().map(|f| format!("`{f:?}`")).collect::<Vec<_>>().join(" or "), within_s)
            }
        };
        let line = format!("| {} | {ending} | {within_s} s |", row.what);
        assert!(page.contains(&line), "docs/src/instrument.md lacks the row\n{line}");
    }
}
