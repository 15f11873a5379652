//! Equation 5, proved: for all reals on the shipping source, and with rounding for all inputs of a box.

use cvg_model::{DetectionGains, Envelope, Orbit, Real};
use cvg_prover::{Exact, Formula, Proof, Refusal};
use cvg_tests::domain::{any_vector, octave};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, WRONG, bounded, holds, rejects, rejects_rounding};
use cvg_tests::tolerances::QUADRATURE;

/// Any real gains.
fn any_gains() -> DetectionGains<Exact> {
    DetectionGains { x: Exact::real("G_Dx"), y: Exact::real("G_Dy") }
}

/// Any envelope.
fn any_envelope() -> Envelope<Exact> {
    let [x_c, x_s, y_c, y_s] = ["x_c", "x_s", "y_c", "y_s"].map(Exact::real);
    Envelope::new(x_c, x_s, y_c, y_s)
}

fn measured_is_the_product(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, e) = (any_gains(), any_envelope());
    let measured = g.measure(&e).pendulum().q;
    proof.equal("Q of what is measured", measured, planted * g.measured_quadrature(e.pendulum().q))?;
    proof.equal("the product", measured, planted * g.x * g.y * e.pendulum().q)
}

//= specs/equation-05.md#product-of-the-gains
//= type=test
//# The measured quadrature MUST be the quadrature times both detection gains.
#[test]
fn identity_the_measured_quadrature_is_the_product_of_the_gains_times_the_quadrature() {
    holds(measured_is_the_product);
}

#[test]
fn identity_the_measured_quadrature_is_the_product_of_the_gains_times_the_quadrature_twin() {
    rejects(WRONG, measured_is_the_product);
}

fn zero_is_kept(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, a, theta) = (any_gains(), Exact::real("a"), Exact::angle("θ"));
    let line = Orbit { a, q: (planted - Exact::one()) * a, theta, delta: Exact::angle("δ") }.envelope();
    proof.equal("Q_d of a line", g.measure(&line).pendulum().q, Exact::zero())?;
    proof.equal("Q_d of Q = 0", g.measured_quadrature(Exact::zero()), Exact::zero())
}

//= specs/equation-05.md#zero-is-kept
//= type=test
//# The measured quadrature of an orbit without quadrature MUST be zero.
#[test]
fn identity_zero_is_kept() {
    holds(zero_is_kept);
}

#[test]
fn identity_zero_is_kept_twin() {
    rejects(WRONG, zero_is_kept);
}

/// Both gains positive or both negative: the magnitudes are any positive numbers.
fn sign_is_kept(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (x, y, q) = (Exact::positive("|G_Dx|"), Exact::positive("|G_Dy|"), Exact::positive("|Q|"));
    for sign in [Exact::one(), -Exact::one()] {
        let g = DetectionGains { x: sign * x, y: sign * planted * y };
        proof.positive_by_factors("Q > 0 gives Q_d > 0", g.measured_quadrature(q))?;
        proof.positive_by_factors("Q < 0 gives Q_d < 0", -g.measured_quadrature(-q))?;
    }
    Ok(())
}

//= specs/equation-05.md#sign-is-kept
//= type=test
//# Detection gains of one sign MUST keep the sign of the quadrature.
#[test]
fn identity_sign_is_kept() {
    holds(sign_is_kept);
}

#[test]
fn identity_sign_is_kept_twin() {
    rejects(&[(-1, 1)], sign_is_kept);
}

fn a_reversed_channel_reverses(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, q) = (any_gains(), Exact::real("Q"));
    let seen = g.measured_quadrature(q);
    for reversed in [DetectionGains { x: -g.x, y: g.y }, DetectionGains { x: g.x, y: -g.y }] {
        proof.equal("Q_d is reversed", reversed.measured_quadrature(q), -planted * seen)?;
    }
    Ok(())
}

//= specs/equation-05.md#reversed-channel
//= type=test
//# Reversing one channel MUST reverse the sign of the measured quadrature.
#[test]
fn identity_a_reversed_channel_reverses_the_sign() {
    holds(a_reversed_channel_reverses);
}

#[test]
fn identity_a_reversed_channel_reverses_the_sign_twin() {
    rejects(WRONG, a_reversed_channel_reverses);
}

// Rounding: bounds for all inputs of a box.

/// Gains of either sign are gains of one sign up to the sign of the result: it is enough to take both in [½, 1].
fn gains_and_envelopes() -> Vec<Inputs> {
    any_vector(4).into_iter().map(|e| [vec![octave(), octave()], e].concat()).collect()
}

/// Q_d as the product and as the quadrature of what is measured, relative to G_Dx G_Dy E.
struct MeasuredQuadrature;

impl Formula for MeasuredQuadrature {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let (g, e) = (DetectionGains { x: x[0], y: x[1] }, Envelope::new(x[2], x[3], x[4], x[5]));
        vec![g.measured_quadrature(e.pendulum().q), g.measure(&e).pendulum().q]
    }

    fn scale<T: Real>(&self, x: &[T]) -> T {
        x[0] * x[1] * Envelope::new(x[2], x[3], x[4], x[5]).pendulum().e
    }
}

for_each_precision! {
    //= specs/equation-05.md#product-of-the-gains
    //= type=test
    //# The measured quadrature MUST be the quadrature times both detection gains.
    #[test]
    fn interval_the_measured_quadrature() {
        bounded::<T>(&MeasuredQuadrature, &gains_and_envelopes(), &QUADRATURE);
    }

    #[test]
    fn interval_the_measured_quadrature_twin() {
        rejects_rounding::<T>(&MeasuredQuadrature, &gains_and_envelopes(), &QUADRATURE);
    }
}
