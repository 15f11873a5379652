//! Nothing is learned from a disturbed instrument.

use cvg_model::{Float, Pendulum};
use kani::Arbitrary;

use crate::parameters::N;
use crate::window::{Push, Sums};

fn any_push<T: Float + Arbitrary>() -> Push<T> {
    Push { along: kani::any(), aside: kani::any(), quadrature: kani::any(), across: kani::any() }
}

fn a_spoilt_cycle_is_not_used<T: Float + Arbitrary>(spoilt: bool) {
    let mut sums = Sums::<T>::after((T::one(), T::zero()));
    if spoilt {
        sums.spoil();
    }
    let p = Pendulum { e: kani::any(), q: kani::any(), r: kani::any(), s: kani::any(), l: kani::any() };
    sums.add(&p, (kani::any(), kani::any()), (kani::any(), kani::any()), &any_push(), &[T::zero(); N]);
    kani::cover!(p.e == T::one() && p.q == T::zero(), "of a vibration at work");
    assert!(sums.close(T::half()).is_none());
}

//= specs/self-calibration.md#held
//# Nothing MUST be learned from a disturbed instrument.
/// [`Sums::close`] gives no sample of a cycle that was spoilt at one control step, whatever came after it in [`Sums::add`].
#[kani::proof]
pub fn proof_a_spoilt_cycle_is_not_used_f32() {
    a_spoilt_cycle_is_not_used::<f32>(true);
}

/// The cycle is whole.
#[kani::proof]
#[kani::should_panic]
pub fn twin_a_spoilt_cycle_is_not_used_f32() {
    a_spoilt_cycle_is_not_used::<f32>(false);
}
