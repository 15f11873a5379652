//! The allocation to the drives.

use cvg_model::Float;
use kani::Arbitrary;

use crate::allocation::Channels;
use crate::{ActuationCompensation, Allocation, OrbitCommands, Status};

/// Any allocation that can be built, with any compensation, and its limit.
pub(super) fn any_allocation<T: Float + Arbitrary>() -> (Allocation<T>, T) {
    // budget: drives without a phase; what one adds is limited as all else, for which any forces stand in `short_way`
    let same = Channels { xx: kani::any(), xy: kani::any(), yx: kani::any(), yy: kani::any() };
    let inverse = ActuationCompensation { same, quarter: None };
    let limit_v = kani::any();
    // precondition: a configuration that `new` accepts
    match Allocation::new(if kani::any() { Some(inverse) } else { None }, limit_v) {
        Ok(allocation) => (allocation, limit_v),
        Err(_) => {
            kani::assume(false);
            unreachable!()
        }
    }
}

fn drives_are_within_their_limit<T: Float + Arbitrary>(share: T) {
    let (allocation, limit_v) = any_allocation::<T>();
    let commands = OrbitCommands { v_as: kani::any(), v_qs: kani::any(), v_qc: kani::any(), v_ac: kani::any() };
    let drive = allocation.step(&commands, kani::any(), kani::any());
    kani::cover!(drive.status == Status::Within && drive.volts.x_s > T::zero(), "as asked");
    kani::cover!(drive.status == Status::Limited && drive.volts.y_c == -limit_v, "limited");
    kani::cover!(drive.status == Status::Invalid, "no number");
    for volts in [drive.volts.x_c, drive.volts.x_s, drive.volts.y_c, drive.volts.y_s] {
        assert!(volts >= -(share * limit_v) && volts <= share * limit_v);
    }
}

//= specs/electronics.md#drives-within-their-limit
//# Each drive MUST get a finite voltage within its limit for every command and every direction.
/// Every voltage of [`Allocation::step`] lies within the limit, for any bits of commands, direction and compensation.
#[kani::proof]
pub fn proof_drives_are_within_their_limit_f32() {
    drives_are_within_their_limit(1.0_f32);
}

/// Half the limit is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_drives_are_within_their_limit_f32() {
    drives_are_within_their_limit(0.5_f32);
}
