//! The oscillator's correction where no loop runs.

use cvg_controller::supervisor::LoopCommand;
use cvg_estimator::{Beat, LockState};
use cvg_model::{Envelope, Float};
use kani::Arbitrary;

use crate::correction::ordered;

fn any_loop_command<T: Float + Arbitrary>() -> LoopCommand<T> {
    match kani::any::<u8>() % 7 {
        0 => LoopCommand::Rest,
        1 => LoopCommand::Listen,
        2 => LoopCommand::Sweep { correction_rad_s: kani::any(), opposed: kani::any() },
        3 => LoopCommand::Tune,
        4 => LoopCommand::Snap,
        5 => LoopCommand::Lock,
        _ => LoopCommand::Run { hold: kani::any(), ring_down: kani::any() },
    }
}

fn what_is_ordered_is_within_the_limit<T: Float + Arbitrary>(share: T) {
    // precondition: a limit that the settings accept
    let limit: T = kani::any_where(|l: &T| *l > T::zero() && l.is_finite());
    let command = any_loop_command::<T>();
    let lock = LockState { detuning_rad_s: kani::any::<T>() };
    let mut beat = Beat::default();
    for _ in 0..2 {
        beat.add(&Envelope::new(kani::any(), kani::any(), kani::any(), kani::any()));
    }
    let correction = ordered(&command, &lock, &beat, kani::any(), limit);
    kani::cover!(command == LoopCommand::Tune && correction == limit, "a beat beyond the limit");
    kani::cover!(matches!(command, LoopCommand::Sweep { .. }) && correction == -limit, "a sweep beyond the limit");
    kani::cover!(command == LoopCommand::Listen && correction == limit, "a detuning that cannot be");
    assert!(correction.magnitude() <= share * limit);
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// The correction that [`ordered`] gives where no loop runs is within its limit, for any order, any bits of what the loop
/// remembers and of what was heard.
#[kani::proof]
pub fn proof_what_is_ordered_is_within_the_limit_f32() {
    what_is_ordered_is_within_the_limit(1.0_f32);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_what_is_ordered_is_within_the_limit_f32() {
    what_is_ordered_is_within_the_limit(0.5_f32);
}

//= specs/dsp.md#whole-step
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// The correction that [`ordered`] gives where no loop runs is within its limit, for any order, any bits of what the loop
/// remembers and of what was heard.
#[kani::proof]
pub fn proof_what_is_ordered_is_within_the_limit_f64() {
    what_is_ordered_is_within_the_limit(1.0_f64);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_what_is_ordered_is_within_the_limit_f64() {
    what_is_ordered_is_within_the_limit(0.5_f64);
}
