//! The phase-locked loop and the oscillator.

use cvg_model::Float;
use kani::Arbitrary;

use super::any_pendulum;
use crate::{LockState, Oscillator, PhaseLock, Phasor, Status};

/// Any loop that could be built, and its limit.
pub(super) fn any_lock<T: Float + Arbitrary>() -> (PhaseLock<T>, T) {
    // precondition: gains and a limit that `new` accepts
    let positive = || kani::any_where(|v: &T| *v > T::zero() && v.is_finite());
    let lock = PhaseLock { gain_per_s: positive(), integral_gain_per_s: positive(), limit_rad_s: positive() };
    (lock, lock.limit_rad_s)
}

fn correction_is_within_its_limit<T: Float + Arbitrary>(share: T) {
    let (lock, limit) = any_lock::<T>();
    let before: T = kani::any();
    let mut state = LockState { detuning_rad_s: before };
    let p = any_pendulum();
    let correction = lock.step(&mut state, &p);
    kani::cover!(correction.status == Status::Valid && correction.rad_s > T::one(), "a correction");
    kani::cover!(correction.rad_s == limit, "at the limit");
    kani::cover!(correction.status == Status::Invalid, "no number");
    assert!(correction.rad_s.magnitude() <= share * limit);
    assert!(state.detuning_rad_s.magnitude() <= share * limit);
    if correction.status != Status::Valid && before.magnitude() <= limit {
        kani::cover!(before > T::zero(), "held");
        assert!(state.detuning_rad_s == before);
    }
}

//= specs/electronics.md#correction-within-its-limit
//# The frequency correction MUST be finite and within its limit for every input and every state.
//= specs/electronics.md#correction-is-held
//# Pendulum variables that hold no phase MUST leave the integral part of the correction as it was.
/// The correction of [`PhaseLock::step`] and the state it leaves lie within the limit, and without a phase the state stays,
/// for any bits of pendulum variables and state.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_correction_is_within_its_limit_f32() {
    correction_is_within_its_limit(1.0_f32);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_correction_is_within_its_limit_f32() {
    correction_is_within_its_limit(0.5_f32);
}

/// The longest and the shortest period between samples that the proofs are about, as powers of two: 1 ms and 1 ns.
pub(super) const PERIODS: core::ops::RangeInclusive<i32> = -30..=-10;

/// What the proofs assume of an oscillator whose period is at most `two_to` the power of two; a test holds what `new` accepts
/// against it. Of the product of period and limit, which `new` keeps below a fifth, it is said by powers of two: a product
/// of two unknowns would be one more for the solver.
pub(super) fn assumed<T: Float>(o: &Oscillator<T>, two_to: i32) -> bool {
    let power = |n: i32| T::from_f64(f64::from_bits(((1023 + i64::from(n)) as u64) << 52));
    let positive = |v: T, most: T| v > T::zero() && v <= most;
    PERIODS.contains(&two_to)
        && o.centre_cos.magnitude() <= T::one()
        && o.centre_sin.magnitude() <= T::one()
        && positive(o.period_s, power(two_to))
        && positive(o.limit_rad_s, power(-1 - two_to))
}

fn phasor_is_bounded<T: Float + Arbitrary>(longest: T) {
    let oscillator = Oscillator {
        centre_cos: kani::any::<T>(),
        centre_sin: kani::any(),
        period_s: kani::any(),
        limit_rad_s: kani::any(),
    };
    // precondition: what `new` accepts, for converters of 1 kHz to 1 GHz
    kani::assume(assumed(&oscillator, PERIODS.end() - i32::from(kani::any::<u8>() % 21)));
    let before = Phasor { cos: kani::any(), sin: kani::any(), step_cos: kani::any(), step_sin: kani::any() };
    let tuned = oscillator.tune(&before, kani::any());
    kani::cover!(tuned.cos == T::one() && tuned.sin == T::zero() && before.cos != T::one(), "anew");
    kani::cover!(tuned.sin < -T::half() && tuned.sin != before.sin, "made one long");
    assert!(tuned.cos.magnitude() <= longest && tuned.sin.magnitude() <= longest);
    assert!(tuned.step_cos.magnitude() <= T::two() && tuned.step_sin.magnitude() <= T::two());
    let next = tuned.advanced();
    assert!(next.cos.magnitude() <= T::ratio(8, 1) && next.sin.magnitude() <= T::ratio(8, 1));
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// The phasor of [`Oscillator::tune`] is below two and its step below two, for any bits of phasor and correction, and the
/// phasor of [`Phasor::advanced`] after it is finite.
#[kani::proof]
pub fn proof_phasor_is_bounded_f32() {
    phasor_is_bounded(2.0_f32);
}

/// Half of that is claimed for the phasor.
#[kani::proof]
#[kani::should_panic]
pub fn twin_phasor_is_bounded_f32() {
    phasor_is_bounded(0.5_f32);
}
