//! The short way of nearly every window against the way of all: the same to the last bit, part by part.
//!
//! What the step calls on its short way is compared with what it calls otherwise.

use cvg_model::Float;
use kani::Arbitrary;

use super::any_pendulum;
use super::demodulator::{any_demodulator, any_phasor};
use super::oscillator::any_lock;
use super::precession::any_precession;
use crate::{LockState, Movement, PrecessionState, Status, Window};

/// The same to the last bit, or both no number. The conversion is exact.
fn same<T: Float>(a: T, b: T) -> bool {
    a.to_f64().to_bits() == b.to_f64().to_bits() || a.partial_cmp(&a).is_none() && b.partial_cmp(&b).is_none()
}

fn same_motion<T: Float>(a: &PrecessionState<T>, b: &PrecessionState<T>) -> bool {
    let directions = same(a.cos_2, b.cos_2) && same(a.sin_2, b.sin_2);
    directions && same(a.sin_2_per_window, b.sin_2_per_window) && a.half_turns == b.half_turns
}

/// `kept(before, after)`: the detuning that the short way is claimed to leave.
fn locks_are_the_same<T: Float + Arbitrary>(kept: impl Fn(T, T) -> T) {
    let (lock, limit) = any_lock::<T>();
    let before = LockState { detuning_rad_s: kani::any() };
    let (mut short, mut long) = (before, before);
    let p = any_pendulum();
    let (within, all) = (lock.step_within(&mut short, &p), lock.step(&mut long, &p));
    match within {
        Some(rad_s) => {
            kani::cover!(rad_s < T::zero() && long.detuning_rad_s < before.detuning_rad_s, "the short way");
            assert!(all.status == Status::Valid && same(rad_s, all.rad_s));
            assert!(same(short.detuning_rad_s, kept(before.detuning_rad_s, long.detuning_rad_s)));
        }
        None => {
            kani::cover!(all.rad_s == limit, "the long way");
            assert!(same(short.detuning_rad_s, before.detuning_rad_s));
        }
    }
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// Where [`PhaseLock::step_within`] answers, it gives the correction and leaves the detuning of [`PhaseLock::step`], to the
/// last bit; where it doesn't, the detuning is as it was: for any loop and any bits of pendulum variables and detuning.
#[kani::proof]
pub fn proof_locks_are_the_same_f32() {
    locks_are_the_same(|_: f32, after| after);
}

/// The detuning is claimed to stay.
#[kani::proof]
#[kani::should_panic]
pub fn twin_locks_are_the_same_f32() {
    locks_are_the_same(|before: f32, _| before);
}

/// `half_turns`: what the short way is claimed to count.
fn motion_is_the_same<T: Float + Arbitrary>(half_turns: i32) {
    let precession = any_precession::<T>();
    let before = PrecessionState {
        cos_2: kani::any(),
        sin_2: kani::any(),
        sin_2_per_window: kani::any(),
        half_turns: kani::any(),
    };
    let (mut short, mut long) = (before, before);
    let (cos_2, sin_2) = (kani::any(), kani::any());
    let steady = precession.turn_steadily(&mut short, cos_2, sin_2);
    let moved = precession.turn_anyhow(&mut long, cos_2, sin_2);
    if steady {
        kani::cover!(before.cos_2 < T::zero() && cos_2 != before.cos_2, "the short way");
        assert!(moved == Movement::Steady && same_motion(&short, &long));
        assert!(short.half_turns.wrapping_sub(before.half_turns) == half_turns);
    }
    if !steady {
        kani::cover!(moved == Movement::Steady && long.half_turns > before.half_turns, "the long way");
        assert!(same_motion(&short, &before));
    }
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// Where [`Precession::turn_steadily`] follows a direction, it leaves what [`Precession::turn_anyhow`] leaves, to the last bit, and
/// neither counts a half turn; where it doesn't, the state is as it was: for any tracker, any direction and any bits of state.
#[kani::proof]
pub fn proof_motion_is_the_same_f32() {
    motion_is_the_same::<f32>(0);
}

/// A half turn is claimed to be counted.
#[kani::proof]
#[kani::should_panic]
pub fn twin_motion_is_the_same_f32() {
    motion_is_the_same::<f32>(1);
}

fn samples_are_the_same<T: Float + Arbitrary>(clipped: u16) {
    let (demodulator, _) = any_demodulator::<T>();
    let before = Window { invalid: kani::any(), clipped: kani::any(), ..Window::begin(&any_phasor::<T>()) };
    let mut window = before;
    let (x, y): (T, T) = (kani::any(), kani::any());
    let taken = demodulator.takes(x, y);
    let (of_x, of_y) = demodulator.admit(&mut window, x, y);
    kani::cover!(!taken && window.clipped > before.clipped, "the long way");
    if taken {
        kani::cover!(x < T::zero() && y > T::one(), "the short way");
        assert!(same(x, of_x) && same(y, of_y));
        assert!(window.invalid == before.invalid && window.clipped.wrapping_sub(before.clipped) == clipped);
    }
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// What [`Demodulator::takes`], [`Demodulator::admit`] leaves as it is, to the last bit, and counts as nothing: for windows of any
/// length, any counts and any bits of samples.
#[kani::proof]
pub fn proof_samples_are_the_same_f32() {
    samples_are_the_same::<f32>(0);
}

/// It is claimed to be counted as clipped.
#[kani::proof]
#[kani::should_panic]
pub fn twin_samples_are_the_same_f32() {
    samples_are_the_same::<f32>(1);
}
