//! Equation 7, proved: for all reals on the shipping source, and with rounding for all inputs of a box.

use cvg_model::detection::{angle_error, angle_error_bound, measured_angle};
use cvg_model::{DetectionGains, Float, Orbit, Real};
use cvg_prover::{Exact, Formula, Proof, Refusal};
use cvg_tests::domain::{any_angle, any_ratio};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, TOO_TIGHT, WRONG, bounded, holds, rejects, rejects_rounding};
use cvg_tests::tolerances::{DETECTION_ANGLE, DETECTION_ERROR};

/// Any ratio of gains, any angle.
fn any() -> (Exact, Exact) {
    (Exact::positive("g"), Exact::angle("θ"))
}

/// cos²θ + w sin²θ > 0 for w > 0, as the directions below need it: (1 + w)(c² + w s²) = w + c² + (w s)².
fn weighted(proof: &mut Proof, w: Exact, theta: Exact) -> Result<Exact, Refusal> {
    let ((sin, cos), one) = (theta.sin_cos(), Exact::one());
    let value = cos * cos + w * sin * sin;
    proof.positive("cos²θ + w sin²θ", value, one + w, w, &[(one, cos), (one, w * sin)])?;
    Ok(value)
}

/// The arguments of the arctangent of the error: (g−1) sin 2θ and (g+1) − (g−1) cos 2θ, the second above 0.
fn error_point(proof: &mut Proof, g: Exact, theta: Exact) -> Result<(Exact, Exact), Refusal> {
    let (x, y) = angle_error(g, theta).ray();
    let (sin, cos) = theta.sin_cos();
    let (one, two) = (Exact::one(), Exact::two());
    // x = 2(c² + g s²)
    proof.positive("no branch cut", x, one + g, two * g, &[(two, cos), (two, g * sin)])?;
    Ok((x, y))
}

/// Twice the angles, since the orbit is the same after 180°.
fn the_measured_angle_is_equation_4_of_the_measured_line_orbit(
    proof: &mut Proof,
    planted: Exact,
) -> Result<(), Refusal> {
    let ((g, theta), a, x) = (any(), Exact::positive("a"), Exact::nonzero("G_Dx"));
    let line = Orbit { a, q: Exact::zero(), theta, delta: Exact::zero() }.envelope();
    let seen = DetectionGains { x, y: g * x }.measure(&line).pendulum().angle();
    let twice = Exact::two() * measured_angle(g * planted, theta);
    // both point along ((c² − g² s²), 2 g s c), whose length is (c² + g² s²)
    let length = weighted(proof, g * g, theta)?;
    let root = proof.product(length, length);
    let scale = proof.product(x * x * a * a, root);
    proof.same_angle("2 θ_d", twice, Exact::two() * seen, Exact::one(), scale, &[])
}

//= specs/equation-07.md#angle-of-the-measured-orbit
//= type=test
//# The measured angle MUST be the angle of the measured envelope up to a multiple of 180°.
#[test]
fn identity_the_measured_angle_is_equation_4_of_the_measured_line_orbit() {
    holds(the_measured_angle_is_equation_4_of_the_measured_line_orbit);
}

#[test]
fn identity_the_measured_angle_is_equation_4_of_the_measured_line_orbit_twin() {
    rejects(WRONG, the_measured_angle_is_equation_4_of_the_measured_line_orbit);
}

fn the_closed_form_is_the_measured_less_the_true_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, theta) = any();
    let (sin, cos) = theta.sin_cos();
    let difference = measured_angle(g * planted, theta) - theta;
    let one = Exact::one();
    // the dot product is 2(c² + g² s²)
    let squares = [(one + one, cos), (one + one, g * g * sin)];
    proof.same_angle("θ_d − θ", angle_error(g, theta), difference, one + g * g, (one + one) * g * g, &squares)
}

//= specs/equation-07.md#closed-form-of-the-error
//= type=test
//# The error MUST be the measured angle less the true angle up to a multiple of 360°.
#[test]
fn identity_the_closed_form_is_the_measured_less_the_true_angle() {
    holds(the_closed_form_is_the_measured_less_the_true_angle);
}

#[test]
fn identity_the_closed_form_is_the_measured_less_the_true_angle_twin() {
    rejects(WRONG, the_closed_form_is_the_measured_less_the_true_angle);
}

/// Both angles lie within 90° of zero, the bound is above 0° for g ≠ 1, and tan² of the one is below tan² of the other:
/// (g−1)² x² − 4g y² = ((g−1)((g−1) − (g+1) cos 2θ))².
fn the_error_never_exceeds_its_bound(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (root, theta) = (Exact::positive("√g"), Exact::angle("θ"));
    let g = root * root;
    let (x, y) = error_point(proof, g, theta)?;
    let (bound_x, bound_y) = angle_error_bound(g).ray();
    proof.positive_by_factors("the bound is below 90°", bound_x)?;
    let (one, bound_y) = (Exact::one(), planted * bound_y);
    if g != one {
        proof.positive_by_factors("the bound is above 0°", bound_y)?;
    }
    let (_, cos_2theta) = (Exact::two() * theta).sin_cos();
    let square = (g - one) * ((g - one) - (g + one) * cos_2theta);
    proof.not_negative(
        "tan² of the error ≤ tan² of the bound",
        bound_y * bound_y * x * x - y * y * bound_x * bound_x,
        one,
        &[(one, square)],
    )?;
    // the arcsine of |g−1|/(g+1): sine over cosine, and their length
    proof.equal("asin", bound_y * bound_y + bound_x * bound_x, (g + one) * (g + one))
}

//= specs/equation-07.md#bound
//= type=test
//# The magnitude of the error MUST NOT exceed the arcsine of |g − 1| over g + 1.
#[test]
fn identity_the_error_never_exceeds_its_bound() {
    holds(the_error_never_exceeds_its_bound);
}

#[test]
fn identity_the_error_never_exceeds_its_bound_twin() {
    rejects(TOO_TIGHT, the_error_never_exceeds_its_bound);
}

/// At cos 2θ = (g−1)/(g+1): with cos θ = √(g/(g+1)) and sin θ = √(1/(g+1)) the sum of the error and θ is 90°.
fn the_bound_is_attained(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let root = Exact::positive("√g");
    let worst = Exact::one().atan2(root);
    let g = root * root;
    let one = Exact::one();
    proof.positive_by_factors("g + 1", g + one)?;
    let (_, cos_2theta) = (Exact::two() * worst).sin_cos();
    proof.equal("cos 2θ", cos_2theta, (g - one) / (g + one))?;
    let ((x, y), (bound_x, bound_y)) = (angle_error(g, worst).ray(), angle_error_bound(g).ray());
    let sign = if g < one { -one } else { one };
    proof.positive_by_factors("within 90°", x * (g + one) / (g * (one + one)))?;
    proof.equal("tangent", y * bound_x, planted * sign * bound_y * x)
}

//= specs/equation-07.md#where-the-bound-is-attained
//= type=test
//# The magnitude of the error MUST equal its bound where the cosine of twice the angle is g − 1 over g + 1.
#[test]
fn identity_the_bound_is_attained() {
    holds(the_bound_is_attained);
}

#[test]
fn identity_the_bound_is_attained_twin() {
    rejects(WRONG, the_bound_is_attained);
}

fn the_error_is_zero_at_multiples_of_90_degrees(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let g = Exact::positive("g");
    for quarters in -4..=4_i32 {
        let theta = Exact::ratio(quarters, 1) * Exact::quarter_turn();
        let (x, y) = angle_error(g, theta).ray();
        proof.positive_by_factors("within 90°", x)?;
        proof.equal("sine of the error", y, (planted - Exact::one()) * g)?;
    }
    Ok(())
}

//= specs/equation-07.md#zeros
//= type=test
//# The error MUST be zero at every multiple of 90°.
#[test]
fn identity_the_error_is_zero_at_multiples_of_90_degrees() {
    holds(the_error_is_zero_at_multiples_of_90_degrees);
}

#[test]
fn identity_the_error_is_zero_at_multiples_of_90_degrees_twin() {
    rejects(WRONG, the_error_is_zero_at_multiples_of_90_degrees);
}

/// Between 0° and 90°, and between 90° and 180°, for a mismatch of either sign.
fn the_error_has_the_sign_of_the_mismatch(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, acute, one) = (Exact::positive("g"), Exact::acute("θ"), Exact::one());
    let mismatch = planted * (g - one);
    let (x, y) = error_point(proof, g, acute)?;
    let (x_beyond, y_beyond) = error_point(proof, g, acute + Exact::quarter_turn())?;
    proof.positive_by_factors("within 90°", x)?;
    proof.positive_by_factors("within 90°", x_beyond)?;
    let (sin, cos) = acute.sin_cos();
    if g == one {
        // then there is none: of neither sign
        for (sense, mismatch) in [(one, g - one), (-one, one - g)] {
            let weight = proof.product(mismatch, sin * cos);
            let squares = [(Exact::two() * weight, one)];
            proof.not_negative("no error before 90°", sense * y, one, &squares)?;
            proof.not_negative("no error after 90°", -sense * y_beyond, one, &squares)?;
        }
        return Ok(());
    }
    // (g − 1)² > 0 where g ≠ 1
    let (size, sign) = if g < one { (one - g, -one) } else { (g - one, one) };
    let square = proof.product(size, size);
    let gained = proof.product(square, sin * cos);
    proof.positive("before 90°", y * mismatch, one, (one + one) * gained, &[])?;
    proof.positive("after 90°", -y_beyond * mismatch, one, (one + one) * gained, &[])?;
    proof.equal("sign", size * sign, g - one)
}

//= specs/equation-07.md#no-other-zeros
//= type=test
//# The error MUST have the sign of g − 1 between 0° and 90° and the opposite sign between 90° and 180°.
#[test]
fn identity_the_error_has_the_sign_of_the_mismatch() {
    holds(the_error_has_the_sign_of_the_mismatch);
}

#[test]
fn identity_the_error_has_the_sign_of_the_mismatch_twin() {
    rejects(&[(-1, 1)], the_error_has_the_sign_of_the_mismatch);
}

fn the_error_is_odd(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, theta) = any();
    for (ahead, back) in [
        (angle_error(g, theta).ray(), angle_error(g, -theta).ray()),
        (measured_angle(g, theta).ray(), measured_angle(g, -theta).ray()),
    ] {
        proof.equal("cosine", back.0, ahead.0)?;
        proof.equal("sine", back.1, -planted * ahead.1)?;
    }
    Ok(())
}

//= specs/equation-07.md#odd
//= type=test
//# The error MUST change its sign with the angle.
#[test]
fn identity_the_error_is_odd() {
    holds(the_error_is_odd);
}

#[test]
fn identity_the_error_is_odd_twin() {
    rejects(WRONG, the_error_is_odd);
}

fn the_error_repeats_after_half_a_turn(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, theta) = any();
    let (here, later) = (angle_error(g, theta).ray(), angle_error(g, theta + Exact::PI).ray());
    proof.equal("cosine", later.0, here.0)?;
    proof.equal("sine", later.1, planted * here.1)
}

//= specs/equation-07.md#period
//= type=test
//# The error MUST repeat after 180°.
#[test]
fn identity_the_error_repeats_after_half_a_turn() {
    holds(the_error_repeats_after_half_a_turn);
}

#[test]
fn identity_the_error_repeats_after_half_a_turn_twin() {
    rejects(WRONG, the_error_repeats_after_half_a_turn);
}

/// The arguments of the arctangent are those of the error, mirrored, times the same positive number.
fn exchanging_the_axes_flips_the_sign(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, theta) = any();
    let (x, y) = angle_error(g, theta).ray();
    let (exchanged_x, exchanged_y) = angle_error(Exact::one() / g, Exact::quarter_turn() - theta).ray();
    error_point(proof, g, theta)?;
    proof.equal("cosine", exchanged_x, g * x)?;
    proof.equal("sine", exchanged_y, -planted * g * y)
}

//= specs/equation-07.md#exchange-of-the-axes
//= type=test
//# The error for the inverse ratio at 90° less the angle MUST be the error with its sign reversed.
#[test]
fn identity_exchanging_the_axes_flips_the_sign() {
    holds(exchanging_the_axes_flips_the_sign);
}

#[test]
fn identity_exchanging_the_axes_flips_the_sign_twin() {
    rejects(WRONG, exchanging_the_axes_flips_the_sign);
}

fn two_mismatches_in_a_row_are_their_product(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g1, g2, theta) = (Exact::positive("g1"), Exact::positive("g2"), Exact::angle("θ"));
    let (first, one) = (measured_angle(g1, theta), Exact::one());
    let (sin, cos) = theta.sin_cos();
    // the first angle is one: its point is not the origin
    weighted(proof, g1 * g1, theta)?;
    let (twice, product) = (measured_angle(g2, first), g1 * g2);
    let once = measured_angle(product * planted, theta);
    let p2 = product * product;
    proof.same_angle("g2 ∘ g1", twice, once, (one + p2) / first.radius(), p2, &[(one, cos), (one, p2 * sin)])
}

//= specs/equation-07.md#group
//= type=test
//# Two mismatches one after the other MUST give the angle of the single mismatch with the product of their ratios.
#[test]
fn identity_two_mismatches_in_a_row_are_their_product() {
    holds(two_mismatches_in_a_row_are_their_product);
}

#[test]
fn identity_two_mismatches_in_a_row_are_their_product_twin() {
    rejects(WRONG, two_mismatches_in_a_row_are_their_product);
}

fn the_inverse_ratio_undoes_the_mismatch(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ((g, theta), one) = (any(), Exact::one());
    let seen = measured_angle(g, theta);
    weighted(proof, g * g, theta)?;
    let undone = measured_angle(planted / g, seen);
    proof.same_angle("1/g ∘ g", undone, theta, one / seen.radius(), one, &[])
}

//= specs/equation-07.md#inverse
//= type=test
//# The inverse ratio MUST undo the mismatch up to a multiple of 360°.
#[test]
fn identity_the_inverse_ratio_undoes_the_mismatch() {
    holds(the_inverse_ratio_undoes_the_mismatch);
}

#[test]
fn identity_the_inverse_ratio_undoes_the_mismatch_twin() {
    rejects(WRONG, the_inverse_ratio_undoes_the_mismatch);
}

fn equal_gains_make_no_error(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let theta = Exact::angle("θ");
    let (x, y) = angle_error(planted, theta).ray();
    proof.equal("sine", y, Exact::zero())?;
    proof.positive_by_factors("within 90°", x)
}

//= specs/equation-07.md#no-mismatch
//= type=test
//# Equal gains MUST give an error of exactly zero.
#[test]
fn identity_equal_gains_make_no_error() {
    holds(equal_gains_make_no_error);
}

#[test]
fn identity_equal_gains_make_no_error_twin() {
    rejects(WRONG, equal_gains_make_no_error);
}

/// Sine and cosine of the measured angle are positive multiples of those of the true angle.
fn the_measured_angle_stays_in_the_quadrant(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, acute) = (Exact::positive("g"), Exact::acute("θ"));
    let (mut sin_sign, mut cos_sign) = (Exact::one(), Exact::one());
    for quarters in 0..4_i32 {
        let theta = acute + Exact::ratio(quarters, 1) * Exact::quarter_turn();
        let (x, y) = measured_angle(g * planted, theta).ray();
        proof.positive_by_factors("sign of the cosine", cos_sign * x)?;
        proof.positive_by_factors("sign of the sine", sin_sign * y)?;
        (sin_sign, cos_sign) = (cos_sign, -sin_sign);
    }
    Ok(())
}

//= specs/equation-07.md#quadrant
//= type=test
//# The measured angle MUST lie in the quadrant of the true angle.
#[test]
fn identity_the_measured_angle_stays_in_the_quadrant() {
    holds(the_measured_angle_stays_in_the_quadrant);
}

#[test]
fn identity_the_measured_angle_stays_in_the_quadrant_twin() {
    rejects(&[(-1, 1)], the_measured_angle_stays_in_the_quadrant);
}

/// tan θ_error is ½(g−1) sin 2θ, and the rest is (g−1)² times a quotient without a pole: −½ sin 2θ (1 − cos 2θ)/x.
fn a_small_mismatch_makes_half_of_it_times_sin_2theta(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, theta) = any();
    let (x, y) = error_point(proof, g, theta)?;
    let (sin_2theta, cos_2theta) = (Exact::two() * theta).sin_cos();
    let m = g - Exact::one();
    let small = planted * Exact::half() * m * sin_2theta;
    let rest = -m * m * Exact::half() * sin_2theta * (Exact::one() - cos_2theta) / x;
    proof.equal("tan θ_error", y / x, small + rest)
}

//= specs/equation-07.md#small-mismatch
//= type=test
//# The error MUST be half the mismatch times the sine of twice the angle up to the square of the mismatch.
#[test]
fn identity_a_small_mismatch_makes_half_of_it_times_sin_2theta() {
    holds(a_small_mismatch_makes_half_of_it_times_sin_2theta);
}

#[test]
fn identity_a_small_mismatch_makes_half_of_it_times_sin_2theta_twin() {
    rejects(WRONG, a_small_mismatch_makes_half_of_it_times_sin_2theta);
}

// Rounding: bounds for all inputs of a box.

/// Every angle, ratios from a fifth to five.
fn ratios_and_angles() -> Vec<Inputs> {
    vec![vec![any_ratio(), any_angle()]]
}

/// θ_d, up to a whole turn: next to 180° it may come out next to −180°
struct MeasuredAngle;

impl Formula for MeasuredAngle {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![measured_angle(x[0], x[1])]
    }

    fn period_turns(&self) -> f64 {
        1.0
    }
}

/// θ_error
struct AngleError;

impl Formula for AngleError {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![angle_error(x[0], x[1])]
    }
}

/// The largest |θ_error|
struct AngleErrorBound;

impl Formula for AngleErrorBound {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![angle_error_bound(x[0])]
    }
}

for_each_precision! {
    //= specs/equation-07.md#angle-of-the-measured-orbit
    //= type=test
    //# The measured angle MUST be the angle of the measured envelope up to a multiple of 180°.
    #[test]
    fn interval_the_measured_angle() {
        bounded::<T>(&MeasuredAngle, &ratios_and_angles(), &DETECTION_ANGLE);
    }

    #[test]
    fn interval_the_measured_angle_twin() {
        rejects_rounding::<T>(&MeasuredAngle, &ratios_and_angles(), &DETECTION_ANGLE);
    }

    //= specs/equation-07.md#closed-form-of-the-error
    //= type=test
    //# The error MUST be the measured angle less the true angle up to a multiple of 360°.
    #[test]
    fn interval_the_angle_error() {
        bounded::<T>(&AngleError, &ratios_and_angles(), &DETECTION_ERROR);
    }

    #[test]
    fn interval_the_angle_error_twin() {
        rejects_rounding::<T>(&AngleError, &ratios_and_angles(), &DETECTION_ERROR);
    }

    //= specs/equation-07.md#bound
    //= type=test
    //# The magnitude of the error MUST NOT exceed the arcsine of |g − 1| over g + 1.
    #[test]
    fn interval_the_bound_of_the_angle_error() {
        bounded::<T>(&AngleErrorBound, &[vec![any_ratio()]], &DETECTION_ERROR);
    }

    #[test]
    fn interval_the_bound_of_the_angle_error_twin() {
        rejects_rounding::<T>(&AngleErrorBound, &[vec![any_ratio()]], &DETECTION_ERROR);
    }
}
