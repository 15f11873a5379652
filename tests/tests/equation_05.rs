//! Equation 5: unequal detection gains scale the quadrature, so that nulling what is seen nulls what is there.

use cvg_model::{DetectionGains, Orbit};
use cvg_tests::domain::{detection_gains, envelopes, line_orbits, orbits};
use cvg_tests::scalar::{rounded, rounded_envelope};
use cvg_tests::tolerances::QUADRATURE;
use cvg_tests::{Scalar, for_each_scalar, prop_assert_near};
use proptest::prelude::*;

fn gains<T: Scalar>(g: &DetectionGains<f64>) -> DetectionGains<T> {
    DetectionGains { x: T::from_f64(g.x), y: T::from_f64(g.y) }
}

for_each_scalar! {
    //= specs/equation-05.md#product-of-the-gains
    //= type=test
    //# The measured quadrature MUST be the quadrature times both detection gains.
    #[test]
    fn prop_the_measured_quadrature_is_the_product_of_the_gains_times_the_quadrature(
        e in envelopes(), g in detection_gains(),
    ) {
        let ((e, e64), g) = (rounded_envelope::<T>(&e), gains::<T>(&g));
        let product = g.x.to_f64() * g.y.to_f64();
        let expected = product * 2.0 * (e64.x_c * e64.y_s - e64.y_c * e64.x_s);
        let tolerance = T::tolerance(&QUADRATURE) * product.abs() * e64.pendulum().e;
        prop_assert_near!(g.measure(&e).pendulum().q.to_f64(), expected, tolerance);
        prop_assert_near!(g.measured_quadrature(e.pendulum().q).to_f64(), expected, tolerance);
    }

    //= specs/equation-05.md#sign-is-kept
    //= type=test
    //# Detection gains of one sign MUST keep the sign of the quadrature.
    #[test]
    fn prop_gains_of_one_sign_keep_the_sign_of_the_quadrature(o in orbits(), g in detection_gains()) {
        let (q, q64) = rounded::<T>(o.q);
        let seen = gains::<T>(&g).measured_quadrature(q).to_f64();
        prop_assert_eq!(seen > 0.0, q64 > 0.0);
        prop_assert_eq!(seen < 0.0, q64 < 0.0);
    }

    //= specs/equation-05.md#reversed-channel
    //= type=test
    //# Reversing one channel MUST reverse the sign of the measured quadrature.
    #[test]
    fn prop_a_reversed_channel_reverses_the_sign_of_the_quadrature(o in orbits(), g in detection_gains()) {
        let (q, g) = (rounded::<T>(o.q).0, gains::<T>(&g));
        let reversed = DetectionGains { x: -g.x, y: g.y };
        prop_assert_eq!(reversed.measured_quadrature(q), -g.measured_quadrature(q));
    }

    //= specs/equation-05.md#zero-is-kept
    //= type=test
    //# The measured quadrature of an orbit without quadrature MUST be zero.
    #[test]
    fn prop_no_quadrature_is_seen_as_no_quadrature(o in line_orbits(), g in detection_gains()) {
        let (g, zero) = (gains::<T>(&g), T::from_f64(0.0));
        prop_assert_eq!(g.measured_quadrature(zero), 0.0);
        let (sin, cos) = o.theta.sin_cos();
        let line = rounded_envelope::<T>(&cvg_model::Envelope::new(o.a * cos, 0.0, o.a * sin, 0.0)).0;
        prop_assert_eq!(g.measure(&line).pendulum().q, 0.0);
    }
}

//= specs/equation-05.md#product-of-the-gains
//= type=test
//# The measured quadrature MUST be the quadrature times both detection gains.
/// Of a measured orbit, with which the equation agrees.
#[test]
fn snapshot_of_the_measured_over_the_true_quadrature() {
    let mut table = String::from("mismatch_percent  Qd_over_Q  (G_Dx = 1)\n");
    for percent in [-5.0, -1.32, 0.0, 0.5, 1.32, 5.0] {
        let g = DetectionGains { x: 1.0, y: 1.0 + percent / 100.0 };
        let e = Orbit { a: 1.0, q: 0.2, theta: 0.4, delta: 0.1 }.envelope();
        let ratio: f64 = g.measure(&e).pendulum().q / e.pendulum().q;
        approx::assert_relative_eq!(g.measured_quadrature(1.0), ratio, max_relative = 1e-13);
        table += &format!("{percent:16.2}{ratio:11.4}\n");
    }
    insta::assert_snapshot!(table);
}
