//! The factors of the covariance.

use cvg_model::Float;
use kani::Arbitrary;

use crate::parameters::N;
use crate::ud::{Growth, Ud, Update};

/// Factors with any bits in the first two columns, which is where they are looked at.
fn any_factors<T: Float + Arbitrary>() -> Ud<T> {
    let mut ud = Ud::diagonal(kani::any());
    // budget: the other columns have the same D and nothing above it; a column is changed by its own loop alone
    ud.above[0] = kani::any();
    ud.d[1] = kani::any();
    ud
}

fn a_measurement_keeps_it_positive<T: Float + Arbitrary>(least: f64) {
    let mut ud = any_factors::<T>();
    let mut update = Update::idle();
    update.f[0] = kani::any();
    update.f[1] = kani::any();
    update.gain[0] = kani::any();
    ud.open(&mut update, kani::any());
    // budget: the first two columns
    let second: bool = kani::any();
    let j = usize::from(second);
    if second {
        ud.absorb::<1>(&mut update);
    } else {
        ud.absorb::<0>(&mut update);
    }
    kani::cover!(second && ud.d(1) < T::one(), "the second column, better known");
    kani::cover!(!second && ud.d(0) == T::from_f64(1e-18), "the first column, at the floor");
    assert!(ud.d(j) >= T::from_f64(least));
}

//= specs/self-calibration.md#positive
//# The covariance MUST stay positive through every measurement and every step of its growth.
/// After [`Ud::absorb`] the D of its column is at least 1e-18, whatever the bits of the factors, of the row, of the noise and
/// of what was absorbed before.
#[kani::proof]
#[kani::unwind(20)]
pub fn proof_a_measurement_keeps_it_positive_f32() {
    a_measurement_keeps_it_positive::<f32>(1e-18);
}

/// Twice the floor is claimed.
#[kani::proof]
#[kani::unwind(20)]
#[kani::should_panic]
pub fn twin_a_measurement_keeps_it_positive_f32() {
    a_measurement_keeps_it_positive::<f32>(2e-18);
}

fn growth_keeps_it_positive<T: Float + Arbitrary>(still: impl Fn(T, T) -> bool) {
    let before: T = kani::any();
    // precondition: factors of a covariance
    kani::assume(before > T::zero() && before.is_finite());
    let mut ud = Ud::diagonal(before);
    let mut growth = Growth::idle();
    // the first column, which is the last to be spread; the D of another is computed alike
    growth.a[0] = kani::any();
    growth.q = kani::any();
    growth.next = 1;
    ud.grow(&mut growth);
    let after = ud.d(0);
    kani::cover!(after > before, "less is known");
    kani::cover!(after == before, "what cannot be spread is not");
    assert!(still(after, before) && after.is_finite() && growth.next < N);
}

//= specs/self-calibration.md#positive
//# The covariance MUST stay positive through every measurement and every step of its growth.
/// A step of [`Ud::grow`] leaves the D of its column positive and finite, whatever the bits of what is spread and of how much.
#[kani::proof]
#[kani::unwind(20)]
pub fn proof_growth_keeps_it_positive_f32() {
    growth_keeps_it_positive(|d: f32, _| d > 0.0);
}

/// It is claimed that what is known is not less after it.
#[kani::proof]
#[kani::unwind(20)]
#[kani::should_panic]
pub fn twin_growth_keeps_it_positive_f32() {
    growth_keeps_it_positive(|d: f32, before: f32| d <= before);
}
