//! What the machine's rounding makes of a window, from the phasor's first turn to the fit: each link proved on the code for all
//! inputs of its box, and the links joined by induction over the samples.
//!
//! With e^{iφ} the phase of a sample and ẑ the machine's phasor there, one turn by a step Ŵ takes ẑ − e^{iφ} to at most
//! |Ŵ| |ẑ − e^{iφ}| + |Ŵ − e^{iw}| + what the turn rounds: turned errors only add, they do not grow. One sample's product and sum
//! round once each. [`Window::after`] is that induction; what the fit then makes of the phasors at both ends and of the sums is
//! bounded at once.

use core::f64::consts::TAU;

use cvg_estimator::{Demodulator, Oscillator, Phasor, Window};
use cvg_instrument::Settings;
use cvg_model::{Float, Real};
use cvg_prover::{Exact, Format, Formula, Interval, Proof, Refusal};
use cvg_tests::domain::{octave, unit};
use cvg_tests::proof::{Inputs, WRONG, bounded, holds, holds_outside, magnitude, rejects, rejects_rounding};
use cvg_tests::tolerances::{NEXT_PHASOR, SAMPLE_SUM, TUNED_PHASOR, TUNED_STEP, WINDOW_FIT};
use cvg_tests::{Scalar, for_each_precision};

/// Windows whose fit is bounded.
const WINDOWS: core::ops::RangeInclusive<u16> = 16..=90;

/// The oscillator of the default settings, its nominal step and the most that it is corrected by, rad a sample.
fn oscillator<T: Float>() -> (Oscillator<T>, f64, f64) {
    let s = Settings::default();
    let period_s = 1.0 / s.sample_hz;
    let limit_rad_s = 1.1 * TAU * s.carrier_hz * s.band;
    let oscillator = Oscillator::new(s.carrier_hz, period_s, limit_rad_s).expect("inside its domain");
    (oscillator, TAU * s.carrier_hz * period_s, limit_rad_s * period_s)
}

/// Cosine and sine of the angles of `arc`, their length within a thousandth of 1.
fn phasors(arc: Interval) -> [Interval; 2] {
    let (sin, cos) = arc.sin_cos();
    let length = Interval::new(0.999, 1.001);
    [cos * length, sin * length]
}

/// The angles from `from` to `to` in `parts`.
fn parts(from: f64, to: f64, parts: u32) -> impl Iterator<Item = Interval> + Clone {
    let at = move |k: u32| from + (to - from) * f64::from(k) / f64::from(parts);
    (0..parts).map(move |k| Interval::new(at(k), at(k + 1)))
}

/// The phasor of the next sample.
struct NextPhasor;

impl Formula for NextPhasor {
    fn outputs<T: Float>(&self, x: &[T]) -> Vec<T> {
        let next = Phasor { cos: x[0], sin: x[1], step_cos: x[2], step_sin: x[3] }.advanced();
        vec![next.cos, next.sin]
    }
}

/// All phases by all steps.
fn turns() -> Vec<Inputs> {
    let all = parts(0.0, TAU, 160);
    all.clone().flat_map(|a| all.clone().map(move |b| [phasors(a), phasors(b)].concat())).collect()
}

/// A phasor of the length that a window may leave, set to length 1.
struct TunedPhasor;

impl Formula for TunedPhasor {
    fn outputs<T: Float>(&self, x: &[T]) -> Vec<T> {
        let (oscillator, ..) = oscillator::<T>();
        let tuned = oscillator.tune(&Phasor { cos: x[0], sin: x[1], ..oscillator.start() }, T::zero());
        vec![tuned.cos, tuned.sin]
    }
}

/// All phases.
fn any_phasor() -> Vec<Inputs> {
    parts(0.0, TAU, 96).map(|a| phasors(a).to_vec()).collect()
}

/// The step at a correction.
struct TunedStep;

impl Formula for TunedStep {
    fn outputs<T: Float>(&self, x: &[T]) -> Vec<T> {
        let (oscillator, ..) = oscillator::<T>();
        let tuned = oscillator.tune(&oscillator.start(), x[0]);
        vec![tuned.step_cos, tuned.step_sin]
    }
}

/// Corrections up to a thousandth short of their limit.
fn corrections() -> Vec<Inputs> {
    let most = 0.999 * 1.1 * TAU * Settings::default().carrier_hz * Settings::default().band;
    vec![vec![Interval::new(-most, most)]]
}

/// A window's sums after one sample more, relative to half of the sum before and the sample.
struct SampleSum;

impl Formula for SampleSum {
    fn outputs<T: Float>(&self, x: &[T]) -> Vec<T> {
        let (sum, sample, cos) = (x[0], x[1], x[2]);
        let phasor = Phasor { cos, sin: cos, step_cos: T::one(), step_sin: T::zero() };
        let demodulator = Demodulator::new(*WINDOWS.start(), 2.5).expect("inside its domain");
        let mut window = Window::begin(&phasor);
        (window.mixed.x_c, window.mixed.x_s, window.x) = (sum, sum, sum);
        demodulator.add(&mut window, sample, T::zero(), &phasor);
        vec![window.mixed.x_c, window.mixed.x_s, window.x]
    }

    fn scale<T: Float>(&self, x: &[T]) -> T {
        T::half() * magnitude(x[0]) + x[1]
    }
}

/// Sums of up to 2¹⁴ samples, at every scale; a sample of the other sign mirrors all of them.
fn sums() -> Vec<Inputs> {
    let of = |sum| vec![sum, octave(), unit()];
    let octaves = (0..14).map(|k| Interval::new(2.0_f64.powi(k), 2.0_f64.powi(k + 1)));
    [of(unit())].into_iter().chain(octaves.flat_map(|o| [of(o), of(-o)])).collect()
}

/// How far the machine's numbers are from those of a carrier that turns by the oscillator's step and has its phase at the window's
/// start.
#[derive(Clone, Copy, Debug)]
struct Off {
    /// the phasor at the window's start, as a length
    start: f64,
    /// the step, as a length
    step: f64,
    /// the phasor one sample after the window, as a length
    end: f64,
    /// each of the sums, of samples within ±1
    sum: f64,
}

impl Off {
    /// After `samples`, by induction: what one tune, one turn and one sample add is what the proofs below bound.
    fn after<T: Scalar + Format>(samples: u16) -> Self {
        let length = |tolerance| core::f64::consts::SQRT_2 * T::tolerance(tolerance);
        // what the window before has left of the length, by Newton's step
        let drift = 1000.0 * T::UNIT;
        let start = length(&TUNED_PHASOR) + 1.6 * drift * drift;
        // and what the step's series lack of length 1
        let step = length(&TUNED_STEP) + oscillator::<f64>().2.powi(8) / 2520.0;
        let (mut phasor, mut sum) = (start, 0.0);
        for k in 0..samples {
            // the sample itself is rounded when it is made of a code; the sum so far is at most k, and what it is off by
            let rounded = 2.0 * T::UNIT + T::tolerance(&SAMPLE_SUM) * (0.5 * (f64::from(k) + sum) + 1.0);
            sum += phasor + rounded;
            phasor = (1.0 + step) * phasor + step + length(&NEXT_PHASOR);
        }
        // the sums of this loop are rounded too
        let room = 1.0 + 1e-9;
        assert!(phasor * room <= drift, "{phasor:e} is more than what the next window is tuned from");
        Self { start, step, end: phasor * room, sum: sum * room }
    }
}

/// The envelope of a full window, from its ends and sums of samples within ±1. In samples all is linear and every rounding
/// relative, so that the bound is one of their largest.
struct WindowFit {
    samples: u16,
    errors: [f64; 9],
}

impl Formula for WindowFit {
    fn outputs<T: Float>(&self, x: &[T]) -> Vec<T> {
        let at = |cos, sin| Phasor { cos, sin, step_cos: x[4], step_sin: x[5] };
        let demodulator = Demodulator::new(self.samples, 2.5).expect("inside its domain");
        let mut window = Window::begin(&at(x[0], x[1]));
        (window.mixed.x_c, window.mixed.x_s, window.x) = (x[6], x[7], x[8]);
        let envelope = demodulator.envelope(&window, &at(x[2], x[3]));
        envelope.map_or_else(Vec::new, |e| vec![e.x_c, e.x_s])
    }

    fn input_errors(&self) -> &[f64] {
        &self.errors
    }

    fn scale<T: Float>(&self, _: &[T]) -> T {
        T::from_f64(f64::from(5 * self.samples + 240))
    }
}

fn window_fit<T: Scalar + Format>(samples: u16) -> (WindowFit, Vec<Inputs>) {
    let off = Off::after::<T>(samples);
    let errors = [off.start, off.start, off.end, off.end, off.step, off.step, off.sum, off.sum, off.sum];
    let (_, nominal, limit) = oscillator::<T>();
    let n = f64::from(samples);
    let most = Interval::new(-n, n);
    let steps = parts(nominal - limit, nominal + limit, 2 + u32::from(samples) / 2);
    let boxes = steps.flat_map(|w| {
        parts(0.0, TAU, 128).map(move |start| {
            let end = start + w * Interval::point(n);
            let on_circle = |arc: Interval| {
                let (sin, cos) = arc.sin_cos();
                [cos, sin]
            };
            [&on_circle(start)[..], &on_circle(end), &on_circle(w), &[most; 3]].concat()
        })
    });
    (WindowFit { samples, errors }, boxes.collect())
}

/// The phasor at the next sample of any, turned by any step: of two phasors by two steps the difference is that of the phasors,
/// turned, and that of the steps; and a turn multiplies the lengths.
fn errors_of_a_turning_phasor_add(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let any = |name: &str| (Exact::real(&format!("Re {name}")), Exact::real(&format!("Im {name}")));
    let next = |(cos, sin), (step_cos, step_sin)| {
        let next = Phasor { cos, sin, step_cos, step_sin }.advanced();
        (next.cos, next.sin)
    };
    let (z, off, step, step_off) = (any("z"), any("z off"), any("w"), any("w off"));
    let sum = |a: (Exact, Exact), b: (Exact, Exact)| (a.0 + b.0, a.1 + b.1);
    let machine = next(sum(z, off), sum(step, step_off));
    let (phasors, steps) = (next(off, sum(step, step_off)), next(z, step_off));
    let real = next(z, step);
    proof.equal("the cosine", machine.0 - real.0, planted * (phasors.0 + steps.0))?;
    proof.equal("the sine", machine.1 - real.1, planted * (phasors.1 + steps.1))?;
    let length_2 = |a: (Exact, Exact)| a.0 * a.0 + a.1 * a.1;
    proof.equal("lengths", length_2(real), planted * length_2(z) * length_2(step))
}

//= specs/electronics.md#certified-angle
//= type=test
//# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
#[test]
fn identity_errors_of_a_turning_phasor_add() {
    holds(errors_of_a_turning_phasor_add);
}

#[test]
fn identity_errors_of_a_turning_phasor_add_twin() {
    rejects(WRONG, errors_of_a_turning_phasor_add);
}

/// A phasor of squared length L is tuned to 1 − (1 − L)² (4 − L)/4.
fn what_tuning_leaves_of_the_length(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (oscillator, ..) = oscillator::<Exact>();
    let before = Phasor { cos: Exact::real("c"), sin: Exact::real("s"), ..oscillator.start() };
    let Some(tuned) = oscillator.tune_within(&before, Exact::zero()) else {
        proof.outside(FAR_FROM_ONE);
        return Ok(());
    };
    let (one, four) = (Exact::one(), Exact::ratio(4, 1));
    let length_2 = |p: &Phasor<Exact>| p.cos * p.cos + p.sin * p.sin;
    let (before, after) = (length_2(&before), length_2(&tuned));
    proof.equal("what is left", four * (one - after), planted * (one - before).squared() * (four - before))
}

const FAR_FROM_ONE: &str = "a phasor of another length starts anew";

//= specs/electronics.md#certified-angle
//= type=test
//# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
#[test]
fn identity_what_tuning_leaves_of_the_length() {
    holds_outside(&[FAR_FROM_ONE], what_tuning_leaves_of_the_length);
}

#[test]
fn identity_what_tuning_leaves_of_the_length_twin() {
    rejects(WRONG, what_tuning_leaves_of_the_length);
}

for_each_precision! {
    //= specs/electronics.md#certified-angle
    //= type=test
    //# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
    #[test]
    fn interval_the_next_phasor() {
        bounded::<T>(&NextPhasor, &turns(), &NEXT_PHASOR);
    }

    #[test]
    fn interval_the_next_phasor_twin() {
        rejects_rounding::<T>(&NextPhasor, &turns(), &NEXT_PHASOR);
    }

    //= specs/electronics.md#certified-angle
    //= type=test
    //# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
    #[test]
    fn interval_a_tuned_phasor() {
        bounded::<T>(&TunedPhasor, &any_phasor(), &TUNED_PHASOR);
    }

    #[test]
    fn interval_a_tuned_phasor_twin() {
        rejects_rounding::<T>(&TunedPhasor, &any_phasor(), &TUNED_PHASOR);
    }

    //= specs/electronics.md#certified-angle
    //= type=test
    //# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
    #[test]
    fn interval_a_tuned_step() {
        bounded::<T>(&TunedStep, &corrections(), &TUNED_STEP);
    }

    #[test]
    fn interval_a_tuned_step_twin() {
        rejects_rounding::<T>(&TunedStep, &corrections(), &TUNED_STEP);
    }

    //= specs/electronics.md#certified-angle
    //= type=test
    //# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
    #[test]
    fn interval_a_sample_is_added() {
        bounded::<T>(&SampleSum, &sums(), &SAMPLE_SUM);
    }

    #[test]
    fn interval_a_sample_is_added_twin() {
        rejects_rounding::<T>(&SampleSum, &sums(), &SAMPLE_SUM);
    }

    //= specs/electronics.md#certified-angle
    //= type=test
    //# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
    #[test]
    fn interval_the_fit_of_a_window() {
        for samples in WINDOWS {
            let (fit, boxes) = window_fit::<T>(samples);
            bounded::<T>(&fit, &boxes, &WINDOW_FIT);
        }
    }

    #[test]
    fn interval_the_fit_of_a_window_twin() {
        for samples in WINDOWS {
            let (fit, boxes) = window_fit::<T>(samples);
            rejects_rounding::<T>(&fit, &boxes, &WINDOW_FIT);
        }
    }
}
