//! Equation 1, proved: for all reals on the shipping source, and with rounding for all inputs of a box.
//!
//! The least-squares line that [`cvg_calibration::bias::angle_dependent_bias`] takes out runs on `f64` only: what is said
//! of it is tested, not proved.

use core::f64::consts::PI;

use cvg_calibration::bias::pattern_angle;
use cvg_model::Real;
use cvg_prover::{Exact, Formula, Interval, Proof, Refusal};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, WRONG, bounded, holds, rejects, rejects_rounding};
use cvg_tests::tolerances::PATTERN_ANGLE;

/// Any angular gain, input angle and bias.
fn any() -> [Exact; 3] {
    ["k_e", "∫Ω dt", "θ_b"].map(Exact::real)
}

fn the_pattern_turns_against_the_input(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ([gain, input, bias], turn) = (any(), Exact::real("turn"));
    let angle = pattern_angle(gain, input, bias);
    proof.equal("bias", pattern_angle(gain, Exact::zero(), bias), planted * bias)?;
    proof.equal("slope", pattern_angle(gain, input + turn, bias) - angle, -planted * gain * turn)?;
    proof.equal("by input", angle.derivative(input), -planted * gain)?;
    proof.equal("by bias", angle.derivative(bias), planted)
}

//= specs/equation-01.md#the-pattern-turns-against-the-input
//= type=test
//# The pattern angle MUST be the bias less the effective angular gain times the integral of the input rate.
#[test]
fn identity_the_pattern_turns_against_the_input() {
    holds(the_pattern_turns_against_the_input);
}

#[test]
fn identity_the_pattern_turns_against_the_input_twin() {
    rejects(WRONG, the_pattern_turns_against_the_input);
}

/// The gain that is read from a turn of the pattern, −(θ − θ_b)/∫Ω dt, is the device's in either direction.
fn reversing_the_input_reverses_the_pattern(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ([gain, _, bias], input) = (any(), Exact::nonzero("∫Ω dt, not 0"));
    let change = |input: Exact| pattern_angle(gain, input, bias) - bias;
    proof.equal("change", change(-input), -planted * change(input))?;
    for input in [input, -input] {
        proof.equal("gain", -change(input) / input, planted * gain)?;
    }
    Ok(())
}

//= specs/equation-01.md#the-gain-keeps-its-sign
//= type=test
//# Reversing the input MUST reverse the change of the pattern angle and leave the effective angular gain as it was.
#[test]
fn identity_reversing_the_input_reverses_the_pattern() {
    holds(reversing_the_input_reverses_the_pattern);
}

#[test]
fn identity_reversing_the_input_reverses_the_pattern_twin() {
    rejects(WRONG, reversing_the_input_reverses_the_pattern);
}

/// A constant is a part of θ_b alone: differences of angles, of which a fitted line and its rest are made, lack it.
fn a_constant_shifts_every_angle_alike(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ([gain, input, bias], constant) = (any(), Exact::real("constant"));
    let shifted = pattern_angle(gain, input, bias + constant);
    proof.equal("shift", shifted - pattern_angle(gain, input, bias), planted * constant)
}

//= specs/equation-01.md#a-constant-angle-is-no-bias
//= type=test
//# Adding a constant to every pattern angle MUST NOT change the angle-dependent bias.
#[test]
fn identity_a_constant_shifts_every_angle_alike() {
    holds(a_constant_shifts_every_angle_alike);
}

#[test]
fn identity_a_constant_shifts_every_angle_alike_twin() {
    rejects(WRONG, a_constant_shifts_every_angle_alike);
}

// Rounding: bounds for all inputs of a box.

/// Angular gains up to 2, a thousand radians of input, any bias.
fn runs() -> Vec<Inputs> {
    vec![vec![Interval::new(-2.0, 2.0), Interval::new(-1e3, 1e3), Interval::new(-PI, PI)]]
}

/// The angle, relative to the largest of the run.
struct PatternAngle;

impl Formula for PatternAngle {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![pattern_angle(x[0], x[1], x[2])]
    }

    fn scale<T: Real>(&self, _: &[T]) -> T {
        T::ratio(2000, 1)
    }
}

for_each_precision! {
    //= specs/equation-01.md#the-pattern-turns-against-the-input
    //= type=test
    //# The pattern angle MUST be the bias less the effective angular gain times the integral of the input rate.
    #[test]
    fn interval_the_pattern_angle() {
        bounded::<T>(&PatternAngle, &runs(), &PATTERN_ANGLE);
    }

    #[test]
    fn interval_the_pattern_angle_twin() {
        rejects_rounding::<T>(&PatternAngle, &runs(), &PATTERN_ANGLE);
    }
}
