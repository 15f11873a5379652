//! The short way of nearly every window against the way of all: the same to the last bit, part by part.
//!
//! What the step calls on its short way is compared with what it calls otherwise.

use cvg_model::{AxisForces, ControlOutputs, Float};
use kani::Arbitrary;

use super::allocation::any_allocation;
use super::pi::any_controller;
use super::supervisor::{any_state, any_supervisor};
use crate::supervisor::{LoopCommand, Mode, Observation, SupervisorState};
use crate::{Allocation, OrbitCommands, PiState, Status};

/// The same to the last bit, or both no number. The conversion is exact.
fn same<T: Float>(a: T, b: T) -> bool {
    a.to_f64().to_bits() == b.to_f64().to_bits() || a.partial_cmp(&a).is_none() && b.partial_cmp(&b).is_none()
}

/// `kept(before, after)`: the integral that the short way is claimed to leave.
fn loops_are_the_same<T: Float + Arbitrary>(kept: impl Fn(T, T) -> T) {
    let (pi, _) = any_controller::<T>();
    let before = PiState { integral: kani::any() };
    let (mut short, mut long) = (before, before);
    let (measured, set): (T, T) = (kani::any(), kani::any());
    let (within, all) = if kani::any() {
        (pi.energy_within(&mut short, measured, set), pi.energy(&mut long, measured, set))
    } else {
        (pi.quadrature_within(&mut short, measured), pi.quadrature(&mut long, measured))
    };
    match within {
        Some(volts) => {
            kani::cover!(volts < T::zero() && long.integral > before.integral, "the short way");
            assert!(all.status == Status::Within && same(volts, all.volts));
            assert!(same(short.integral, kept(before.integral, long.integral)));
        }
        None => {
            kani::cover!(all.status == Status::Limited, "the long way");
            assert!(same(short.integral, before.integral));
        }
    }
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// Where [`Pi::energy_within`] and [`Pi::quadrature_within`] answer, they give the volts and leave the integral of
/// [`Pi::energy`] and [`Pi::quadrature`] to the last bit; where they don't, the integral is as it was: for any
/// controller, any errors and any bits of the integral.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_loops_are_the_same_f32() {
    loops_are_the_same(|_: f32, after| after);
}

/// The integral is claimed to stay.
#[kani::proof]
#[kani::should_panic]
#[kani::solver(minisat)]
pub fn twin_loops_are_the_same_f32() {
    loops_are_the_same(|before: f32, _| before);
}

fn supervision_is_the_same<T: Float + Arbitrary>(windows: impl Fn(&SupervisorState) -> u32) {
    let supervisor = any_supervisor::<T>();
    let before = any_state();
    let pendulum =
        cvg_model::Pendulum { e: kani::any(), q: kani::any(), r: kani::any(), s: kani::any(), l: kani::any() };
    let runs_unchanged = supervisor.runs_unchanged(&before, &pendulum);
    let (mut short, mut long) = (before, before);
    short.count();
    let well = Observation { pendulum, valid: true, clipped: false, repeats: false, jumped: false };
    let command = supervisor.step(&mut long, &well, None);
    kani::cover!(runs_unchanged && before.mode == Mode::Hold, "a hold goes on");
    kani::cover!(runs_unchanged && before.bad > 0, "what was counted stays so");
    kani::cover!(!runs_unchanged && before.mode == Mode::WholeAngle, "the long way");
    if runs_unchanged {
        kani::cover!(before.windows == u32::MAX, "at the end of what can be counted");
        assert!(long == short && long.windows == windows(&short));
        assert!(command == LoopCommand::Run { hold: before.mode == Mode::Hold, ring_down: false });
        assert!(crate::Supervisor::in_phase(&pendulum));
    }
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// Where [`Supervisor::runs_unchanged`] says so, [`Supervisor::step`] after a window of which nothing is amiss gives the command of
/// the mode, counts the window and changes nothing else, and the phase is near: for any supervisor, state and vibration.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_supervision_is_the_same_f32() {
    supervision_is_the_same::<f32>(|state| state.windows);
}

/// The window is claimed not to be counted.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_supervision_is_the_same_f32() {
    supervision_is_the_same::<f32>(|state| state.windows.saturating_sub(1));
}

/// `same(a, b)`: what is claimed of a force that the short way gives and the one of the long way.
fn forces_are_the_same<T: Float + Arbitrary>(same: impl Fn(T, T) -> bool) {
    // budget: no compensation, which multiplies and adds what is the same; with a phase the short way gives no answer
    // precondition: a configuration that `new` accepts
    let Ok(allocation) = Allocation::new(None, kani::any()) else {
        kani::assume(false);
        unreachable!()
    };
    // precondition: a direction of finite components, as the one ahead is, which is proved beside
    let finite = || kani::any_where(|v: &T| v.is_finite());
    let (cos, sin): (T, T) = (finite(), finite());
    let v = ControlOutputs { v_as: kani::any(), v_qc: kani::any() };
    let short = allocation.axes_within(&v, cos, sin);
    let asked = OrbitCommands { v_as: v.v_as, v_qs: T::zero(), v_qc: v.v_qc, v_ac: T::zero() };
    let long = allocation.step(&asked, cos, sin);
    kani::cover!(short.is_none() && long.status == Status::Limited, "the long way");
    assert!(short.is_some() == (long.status == Status::Within));
    if let Some(f) = short {
        kani::cover!(f.y_c > T::zero() && f.x_s < T::zero(), "the short way");
        assert!(same(f.x_c, long.volts.x_c) && same(f.x_s, long.volts.x_s));
        assert!(same(f.y_c, long.volts.y_c) && same(f.y_s, long.volts.y_s));
    }
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// [`Allocation::axes_within`] answers where [`Allocation::step`] is within its limits and nowhere else, with the same forces but
/// for the sign of zero: without a compensation, for any commands, any limit and any direction of finite components.
#[kani::proof]
pub fn proof_forces_are_the_same_f32() {
    forces_are_the_same(|a: f32, b| a == b);
}

/// The sign of zero is claimed to be the same.
#[kani::proof]
#[kani::should_panic]
pub fn twin_forces_are_the_same_f32() {
    forces_are_the_same(|a: f32, b| same(a, b));
}

/// `answers(a, b)`: what is claimed of a force that the short way gives and of the one that the limits leave.
fn limits_leave_what_is_within<T: Float + Arbitrary>(answers: impl Fn(T, T) -> bool) {
    let (allocation, limit_v) = any_allocation::<T>();
    let f = AxisForces { x_c: kani::any(), x_s: kani::any(), y_c: kani::any(), y_s: kani::any() };
    let long = allocation.limited(f);
    let v = &long.volts;
    assert!(v.x_c.within(limit_v) && v.x_s.within(limit_v) && v.y_c.within(limit_v) && v.y_s.within(limit_v));
    kani::cover!(!allocation.fits(&f) && long.volts.x_c == T::zero(), "the long way");
    if allocation.fits(&f) {
        kani::cover!(f.y_c > T::zero() && f.x_s < T::zero(), "the short way");
        assert!(answers(f.x_c, long.volts.x_c) && answers(f.x_s, long.volts.x_s));
        assert!(answers(f.y_c, long.volts.y_c) && answers(f.y_s, long.volts.y_s));
    }
}

//= specs/dsp.md#short-way
//# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
/// Forces that [`Allocation::fits`] lets [`Allocation::step_within`] give, [`Allocation::limited`] leaves as they are, to the last
/// bit, and any others it leaves within the limit: for any bits of forces and any limit.
#[kani::proof]
pub fn proof_limits_leave_what_is_within_f32() {
    limits_leave_what_is_within(|a: f32, b| same(a, b));
}

/// A force is claimed to be below the other.
#[kani::proof]
#[kani::should_panic]
pub fn twin_limits_leave_what_is_within_f32() {
    limits_leave_what_is_within(|a: f32, b| a < b);
}
