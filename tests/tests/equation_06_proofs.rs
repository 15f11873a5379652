//! Equation 6, proved: for all reals on the shipping source, and with rounding for all inputs of a box.

use cvg_model::{DetectionGains, Orbit, Real};
use cvg_prover::{Exact, Formula, Interval, Proof, Refusal};
use cvg_tests::domain::{any_angle, octave};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, TOO_TIGHT, WRONG, bounded, holds, rejects, rejects_rounding};
use cvg_tests::tolerances::ENERGY;

/// Gains as the equation allows them: G_Dx other than zero, G_Dy any.
fn any_gains() -> DetectionGains<Exact> {
    DetectionGains { x: Exact::nonzero("G_Dx"), y: Exact::real("G_Dy") }
}

fn the_measured_energy_is_that_of_the_measured_line_orbit(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, a, theta) = (any_gains(), Exact::real("a"), Exact::angle("θ"));
    let line = Orbit { a, q: Exact::zero(), theta, delta: Exact::zero() }.envelope();
    let energy = line.pendulum().e;
    proof.equal("E_d", g.measure(&line).pendulum().e, planted * g.measured_energy(energy, theta))
}

//= specs/equation-06.md#energy-of-the-measured-orbit
//= type=test
//# The measured energy MUST be the energy of the measured envelope.
#[test]
fn identity_the_measured_energy_is_that_of_the_measured_line_orbit() {
    holds(the_measured_energy_is_that_of_the_measured_line_orbit);
}

#[test]
fn identity_the_measured_energy_is_that_of_the_measured_line_orbit_twin() {
    rejects(WRONG, the_measured_energy_is_that_of_the_measured_line_orbit);
}

/// Either gain may be the larger one. What is left to a bound is E |G_Dy² − G_Dx²| sin²θ or cos²θ.
fn the_squared_gains_are_the_extremes(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, theta) = (Exact::positive("E"), Exact::angle("θ"));
    let (sin, cos) = theta.sin_cos();
    for y_is_larger in [true, false] {
        let g = any_gains();
        let (x2, y2) = (g.x * g.x, g.y * g.y);
        let (low, high) = if y_is_larger { (x2, y2) } else { (y2, x2) };
        proof.assume_positive(high - low)?;
        let seen = g.measured_energy(e, theta);
        let span = proof.product(e, high - low);
        let (at_low, at_high) = if y_is_larger { (cos, sin) } else { (sin, cos) };
        proof.not_negative("E_d ≥ E min G²", seen * planted - e * low, Exact::one(), &[(span, at_high)])?;
        proof.not_negative("E_d ≤ E max G²", e * high * planted - seen, Exact::one(), &[(span, at_low)])?;
    }
    Ok(())
}

//= specs/equation-06.md#extremes
//= type=test
//# The measured energy MUST lie between the energy times the smaller and the energy times the larger squared gain.
#[test]
fn identity_the_squared_gains_are_the_extremes() {
    holds(the_squared_gains_are_the_extremes);
}

#[test]
fn identity_the_squared_gains_are_the_extremes_twin() {
    rejects(TOO_TIGHT, the_squared_gains_are_the_extremes);
}

fn the_extremes_are_at_0_and_90_degrees(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, e) = (any_gains(), Exact::real("E"));
    for quarters in -4..=4_i32 {
        let theta = Exact::ratio(quarters, 1) * Exact::quarter_turn();
        let along = if quarters % 2 == 0 { g.x } else { g.y };
        proof.equal("E_d at a multiple of 90°", g.measured_energy(e, theta), planted * along * along * e)?;
    }
    Ok(())
}

//= specs/equation-06.md#where-the-extremes-are
//= type=test
//# The measured energy MUST be the energy times the squared gain of X at 0° and of Y at 90°.
#[test]
fn identity_the_extremes_are_at_0_and_90_degrees() {
    holds(the_extremes_are_at_0_and_90_degrees);
}

#[test]
fn identity_the_extremes_are_at_0_and_90_degrees_twin() {
    rejects(WRONG, the_extremes_are_at_0_and_90_degrees);
}

fn equal_gains_see_the_same_energy_at_every_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (gain, e) = (Exact::nonzero("G"), Exact::real("E"));
    let g = DetectionGains { x: gain, y: gain * planted };
    proof.equal("E_d", g.measured_energy(e, Exact::angle("θ")), gain * gain * planted * e)
}

//= specs/equation-06.md#equal-gains
//= type=test
//# Equal gains MUST make the measured energy independent of the angle.
#[test]
fn identity_equal_gains_see_the_same_energy_at_every_angle() {
    holds(equal_gains_see_the_same_energy_at_every_angle);
}

#[test]
fn identity_equal_gains_see_the_same_energy_at_every_angle_twin() {
    rejects(WRONG, equal_gains_see_the_same_energy_at_every_angle);
}

fn the_measured_energy_is_even_in_the_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, e, theta) = (any_gains(), Exact::real("E"), Exact::angle("θ"));
    proof.equal("E_d at −θ", g.measured_energy(e, -theta), planted * g.measured_energy(e, theta))
}

//= specs/equation-06.md#even-in-the-angle
//= type=test
//# The measured energy MUST be the same at opposite angles.
#[test]
fn identity_the_measured_energy_is_even_in_the_angle() {
    holds(the_measured_energy_is_even_in_the_angle);
}

#[test]
fn identity_the_measured_energy_is_even_in_the_angle_twin() {
    rejects(WRONG, the_measured_energy_is_even_in_the_angle);
}

fn the_sign_of_a_channel_does_not_matter_to_the_energy(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, e, theta) = (any_gains(), Exact::real("E"), Exact::angle("θ"));
    let seen = planted * g.measured_energy(e, theta);
    for reversed in [DetectionGains { x: -g.x, y: g.y }, DetectionGains { x: g.x, y: -g.y }] {
        proof.equal("E_d", reversed.measured_energy(e, theta), seen)?;
    }
    Ok(())
}

//= specs/equation-06.md#sign-of-a-channel
//= type=test
//# Reversing one channel MUST leave the measured energy as it was.
#[test]
fn identity_the_sign_of_a_channel_does_not_matter_to_the_energy() {
    holds(the_sign_of_a_channel_does_not_matter_to_the_energy);
}

#[test]
fn identity_the_sign_of_a_channel_does_not_matter_to_the_energy_twin() {
    rejects(WRONG, the_sign_of_a_channel_does_not_matter_to_the_energy);
}

/// Two angles 90° apart already have the mean of the turn, wherever they are.
fn the_mean_over_a_turn_is_the_mean_of_the_squared_gains(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, e, theta) = (any_gains(), Exact::real("E"), Exact::angle("θ"));
    let pair = g.measured_energy(e, theta) + g.measured_energy(e, theta + Exact::quarter_turn());
    proof.equal("mean", Exact::half() * pair, planted * Exact::half() * (g.x * g.x + g.y * g.y) * e)
}

//= specs/equation-06.md#mean-over-a-turn
//= type=test
//# The mean of the measured energy over a turn MUST be the energy times the mean of the squared gains.
#[test]
fn identity_the_mean_over_a_turn_is_the_mean_of_the_squared_gains() {
    holds(the_mean_over_a_turn_is_the_mean_of_the_squared_gains);
}

#[test]
fn identity_the_mean_over_a_turn_is_the_mean_of_the_squared_gains_twin() {
    rejects(WRONG, the_mean_over_a_turn_is_the_mean_of_the_squared_gains);
}

/// It is q² (G_Dy² − G_Dx²) cos 2θ, exactly.
fn what_is_neglected_is_of_second_order(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, theta) = (any_gains(), Exact::angle("θ"));
    let orbit = Orbit { a: Exact::real("a"), q: Exact::real("q"), theta, delta: Exact::angle("δ") };
    let e = orbit.envelope();
    let neglected = g.measure(&e).pendulum().e - g.measured_energy(e.pendulum().e, theta);
    let (_, cos_2theta) = (Exact::two() * theta).sin_cos();
    proof.equal("neglected", neglected, planted * orbit.q * orbit.q * (g.y * g.y - g.x * g.x) * cos_2theta)
}

//= specs/equation-06.md#neglected-quadrature
//= type=test
//# The part of the measured energy that the equation neglects MUST be of second order in the semi-minor axis.
#[test]
fn identity_what_is_neglected_is_of_second_order() {
    holds(what_is_neglected_is_of_second_order);
}

#[test]
fn identity_what_is_neglected_is_of_second_order_twin() {
    rejects(WRONG, what_is_neglected_is_of_second_order);
}

// Rounding: bounds for all inputs of a box.

/// G_Dx and E at every scale, G_Dy from a fifth to five times G_Dx, every angle.
fn gains_energies_and_angles() -> Vec<Inputs> {
    let ratios = [0.2, 0.45, 1.0, 2.2, 5.0];
    ratios.windows(2).map(|r| vec![octave(), Interval::new(0.5 * r[0], r[1]), octave(), any_angle()]).collect()
}

/// E_d relative to max(G_Dx², G_Dy²) E.
struct MeasuredEnergy;

impl Formula for MeasuredEnergy {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![DetectionGains { x: x[0], y: x[1] }.measured_energy(x[2], x[3])]
    }

    fn scale<T: Real>(&self, x: &[T]) -> T {
        let largest = if x[0] < x[1] { x[1] } else { x[0] };
        largest * largest * x[2]
    }
}

for_each_precision! {
    //= specs/equation-06.md#energy-of-the-measured-orbit
    //= type=test
    //# The measured energy MUST be the energy of the measured envelope.
    #[test]
    fn interval_the_measured_energy() {
        bounded::<T>(&MeasuredEnergy, &gains_energies_and_angles(), &ENERGY);
    }

    #[test]
    fn interval_the_measured_energy_twin() {
        rejects_rounding::<T>(&MeasuredEnergy, &gains_energies_and_angles(), &ENERGY);
    }
}
