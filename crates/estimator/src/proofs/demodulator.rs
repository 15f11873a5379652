//! The demodulator's window.

use cvg_model::{Envelope, Float};
use kani::Arbitrary;

use crate::{Demodulator, Phasor, Window};

/// A demodulator for any number of samples, for converters of ±2.5 V, and its range.
pub(super) fn any_demodulator<T: Float>() -> (Demodulator<T>, T) {
    // precondition: a configuration that `new` accepts
    match Demodulator::new(kani::any(), 2.5) {
        Ok(demodulator) => (demodulator, T::ratio(5, 2)),
        Err(_) => {
            kani::assume(false);
            unreachable!()
        }
    }
}

pub(super) fn any_phasor<T: Float + Arbitrary>() -> Phasor<T> {
    Phasor { cos: kani::any(), sin: kani::any(), step_cos: kani::any(), step_sin: kani::any() }
}

fn samples_are_admitted_within_the_range<T: Float + Arbitrary>(share: T) {
    let (demodulator, range) = any_demodulator::<T>();
    let start = any_phasor::<T>();
    let mut window = Window { invalid: kani::any(), clipped: kani::any(), ..Window::begin(&start) };
    let before = window;
    let (x, y): (T, T) = (kani::any(), kani::any());
    if demodulator.takes(x, y) {
        kani::cover!(x > T::one() && y < -T::one(), "as it is");
        assert!(x.magnitude() <= share * range && y.magnitude() <= share * range);
    }
    let (admitted_x, admitted_y) = demodulator.admit(&mut window, x, y);
    kani::cover!(admitted_x == range, "at the end of the range");
    kani::cover!(window.invalid > before.invalid && window.clipped > before.clipped, "no number, and clipped");
    assert!(admitted_x.magnitude() <= share * range && admitted_y.magnitude() <= share * range);
    assert!(window.invalid >= before.invalid && window.clipped >= before.clipped);
    if !x.is_finite() {
        kani::cover!(true, "no sample");
        assert!(window.invalid > 0 && admitted_x == T::zero());
    }
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// A sample of any bits that [`Demodulator::takes`] is a number within the converter's range, and [`Demodulator::admit`] makes one of
/// any other; what is none is counted, and the counters do not overflow.
#[kani::proof]
pub fn proof_samples_are_admitted_within_the_range_f32() {
    samples_are_admitted_within_the_range(1.0_f32);
}

/// Half the range is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_samples_are_admitted_within_the_range_f32() {
    samples_are_admitted_within_the_range(0.5_f32);
}

fn an_envelope_is_within_eight_ranges<T: Float + Arbitrary>(share: T) {
    let (demodulator, range) = any_demodulator::<T>();
    let e = Envelope::new(kani::any(), kani::any(), kani::any(), kani::any());
    let plausible = demodulator.plausible(e);
    kani::cover!(plausible.is_none() && e.x_s.is_finite() && e.y_s.is_finite(), "no number, or far out of range");
    if let Some(e) = plausible {
        kani::cover!(e.y_c < T::zero() && e.x_s > T::one(), "a vibration");
        let most = share * T::ratio(8, 1) * range;
        assert!(e.x_c.magnitude() < most && e.x_s.magnitude() < most);
        assert!(e.y_c.magnitude() < most && e.y_s.magnitude() < most);
    }
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// Each part of an envelope that [`Demodulator::plausible`] lets out is a number below eight times the converter's range, for any
/// bits that the fit of a window makes: converters of ±2.5 V.
#[kani::proof]
pub fn proof_an_envelope_is_within_eight_ranges_f32() {
    an_envelope_is_within_eight_ranges(1.0_f32);
}

/// Half of that is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_an_envelope_is_within_eight_ranges_f32() {
    an_envelope_is_within_eight_ranges(0.5_f32);
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// Each part of an envelope that [`Demodulator::plausible`] lets out is a number below eight times the converter's range, for any
/// bits that the fit of a window makes: converters of ±2.5 V.
#[kani::proof]
pub fn proof_an_envelope_is_within_eight_ranges_f64() {
    an_envelope_is_within_eight_ranges(1.0_f64);
}

/// Half of that is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_an_envelope_is_within_eight_ranges_f64() {
    an_envelope_is_within_eight_ranges(0.5_f64);
}

fn a_window_ends<T: Float + Arbitrary>(fewer: u32) {
    let (demodulator, _) = any_demodulator::<T>();
    let left = |window: &Window<T>| {
        let n = demodulator.samples();
        if window.count < n { n - window.count } else { 1 }
    };
    let start = any_phasor::<T>();
    let mut window = Window { count: kani::any(), ..Window::begin(&start) };
    // precondition: not the last count of all, which the next sample makes the first
    kani::assume(window.count < u32::MAX);
    let before = left(&window);
    let full = demodulator.add(&mut window, kani::any(), kani::any(), &start);
    kani::cover!(full, "full");
    kani::cover!(!full && before > 9000, "far from it");
    assert!(before >= 1 && before <= demodulator.samples());
    if full {
        kani::cover!(before == 1, "with the last");
        assert!(before == 1 && window.count >= demodulator.samples());
    } else {
        kani::cover!(before == 2, "with the last but one");
        assert!(left(&window) + fewer == before);
    }
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// [`Demodulator::add`], whatever a window has counted, is one sample nearer to a full one: within as many samples as a
/// window has there is a control step.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_a_window_ends_f32() {
    a_window_ends::<f32>(1);
}

/// Two samples are claimed to be taken.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_a_window_ends_f32() {
    a_window_ends::<f32>(2);
}

/// The sums are claimed to grow by `added` a sample at most, V.
fn a_sample_adds_no_more_than_its_own<T: Float + Arbitrary>(added: T) {
    let (demodulator, range) = any_demodulator::<T>();
    // what the samples before may have added up to
    // precondition: a window's worth of them
    let before: T = kani::any_where(|v: &T| *v >= T::zero() && *v <= T::ratio(80_000, 1));
    // precondition: sums that the samples before may have added up to
    let sum = || kani::any_where(|v: &T| v.magnitude() <= before);
    // precondition: an oscillator within a window, whose length is within 5 % of one
    let component = || kani::any_where(|v: &T| v.magnitude() <= T::ratio(17, 16));
    let phasor = Phasor { cos: component(), sin: component(), ..any_phasor() };
    let mixed = Envelope::new(sum(), sum(), sum(), sum());
    let mut window = Window { mixed, x: sum(), y: sum(), ..Window::begin(&phasor) };
    // precondition: samples within the range, as they are admitted, which is proved beside
    let sample = || kani::any_where(|v: &T| v.magnitude() <= range);
    demodulator.add(&mut window, sample(), sample(), &phasor);
    let e = window.mixed;
    kani::cover!(e.x_s > before && e.y_c < -before, "more than before");
    let most = before + added;
    for sum in [e.x_c, e.x_s, e.y_c, e.y_s, window.x, window.y] {
        assert!(sum.magnitude() <= most);
    }
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// One call of [`Demodulator::add`] takes each of a window's sums no farther than 8 V beyond what the samples before may have
/// added up to, rounding included: samples within ±2.5 V, an oscillator's phasor within a window. (By 85/32 V, which is the product
/// of the two bounds, it was proved as well, in three times the time.)
#[kani::proof]
pub fn proof_a_sample_adds_no_more_than_its_own_f32() {
    a_sample_adds_no_more_than_its_own(8.0_f32);
}

/// A quarter of that is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_a_sample_adds_no_more_than_its_own_f32() {
    a_sample_adds_no_more_than_its_own(2.0_f32);
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// One call of [`Demodulator::add`] takes each of a window's sums no farther than 8 V beyond what the samples before may have
/// added up to, rounding included: samples within ±2.5 V, an oscillator's phasor within a window. (By 85/32 V, which is the product
/// of the two bounds, it was proved as well, in three times the time.)
#[kani::proof]
pub fn proof_a_sample_adds_no_more_than_its_own_f64() {
    a_sample_adds_no_more_than_its_own(8.0_f64);
}

/// A quarter of that is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_a_sample_adds_no_more_than_its_own_f64() {
    a_sample_adds_no_more_than_its_own(2.0_f64);
}
