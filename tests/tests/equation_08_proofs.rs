//! Equation 8, proved: for all reals on the shipping source, and with rounding for all inputs of a box.

use cvg_model::actuation::misaligned_forces;
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{ActuationGains, ControlOutputs, Orbit, Real};
use cvg_prover::{Exact, Formula, Proof, Refusal};
use cvg_tests::domain::{any_angle, any_vector, octave};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, WRONG, bounded, holds, magnitude, rejects, rejects_rounding};
use cvg_tests::tolerances::MISALIGNED_FORCES;

/// Any gain, any commands.
fn any() -> (Exact, ControlOutputs<Exact>) {
    (Exact::real("G_A"), ControlOutputs { v_as: Exact::real("v_as"), v_qc: Exact::real("v_qc") })
}

fn each_command_is_turned_by_the_angle_error(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ((gain, v), error) = (any(), Exact::angle("θ_error"));
    let f = misaligned_forces(gain, &v, error);
    let (sin, cos) = error.sin_cos();
    // (G_A v_as, 0) and (0, G_A v_qc), each turned by the error
    proof.equal("f_as", f.a_s, planted * gain * v.v_as * cos)?;
    proof.equal("f_qs", f.q_s, planted * gain * v.v_as * sin)?;
    proof.equal("f_ac", f.a_c, -planted * gain * v.v_qc * sin)?;
    proof.equal("f_qc", f.q_c, planted * gain * v.v_qc * cos)
}

//= specs/equation-08.md#rotation-of-the-commands
//= type=test
//# The forces along the orbit MUST be the commanded forces turned by the angle error.
#[test]
fn identity_each_command_is_turned_by_the_angle_error() {
    holds(each_command_is_turned_by_the_angle_error);
}

#[test]
fn identity_each_command_is_turned_by_the_angle_error_twin() {
    rejects(WRONG, each_command_is_turned_by_the_angle_error);
}

/// The squares of the sizes.
fn misalignment_keeps_the_size_of_a_force(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ((gain, v), error) = (any(), Exact::angle("θ_error"));
    let f = misaligned_forces(gain, &v, error);
    proof.equal("energy", f.a_s.squared() + f.q_s.squared(), (planted * gain * v.v_as).squared())?;
    proof.equal("quadrature", f.a_c.squared() + f.q_c.squared(), (planted * gain * v.v_qc).squared())?;
    // and what the two commands make stays perpendicular
    proof.equal("angle between", f.a_s * f.a_c + f.q_s * f.q_c, Exact::zero())
}

//= specs/equation-08.md#isometry
//= type=test
//# The size of the forces that one command makes along both axes of the orbit MUST be the gain times the command.
#[test]
fn identity_misalignment_keeps_the_size_of_a_force() {
    holds(misalignment_keeps_the_size_of_a_force);
}

#[test]
fn identity_misalignment_keeps_the_size_of_a_force_twin() {
    rejects(&[(101, 100), (99, 100)], misalignment_keeps_the_size_of_a_force);
}

fn aligned_forces_stay_on_their_axes(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (gain, v) = any();
    let f = misaligned_forces(gain, &v, Exact::zero());
    proof.equal("f_as", f.a_s, planted * gain * v.v_as)?;
    proof.equal("f_qc", f.q_c, planted * gain * v.v_qc)?;
    proof.equal("f_qs", f.q_s, Exact::zero())?;
    proof.equal("f_ac", f.a_c, Exact::zero())
}

//= specs/equation-08.md#aligned-forces
//= type=test
//# Without an angle error each command MUST act on its own axis only.
#[test]
fn identity_aligned_forces_stay_on_their_axes() {
    holds(aligned_forces_stay_on_their_axes);
}

#[test]
fn identity_aligned_forces_stay_on_their_axes_twin() {
    rejects(WRONG, aligned_forces_stay_on_their_axes);
}

fn what_leaks_follows_the_sign_of_the_angle_error(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ((gain, v), error) = (any(), Exact::angle("θ_error"));
    let (plus, minus) = (misaligned_forces(gain, &v, error), misaligned_forces(gain, &v, -error));
    proof.equal("f_as", minus.a_s, plus.a_s)?;
    proof.equal("f_qc", minus.q_c, plus.q_c)?;
    proof.equal("f_qs", minus.q_s, -planted * plus.q_s)?;
    proof.equal("f_ac", minus.a_c, -planted * plus.a_c)
}

//= specs/equation-08.md#leak-follows-the-sign-of-the-error
//= type=test
//# Reversing the angle error MUST reverse the forces on the wrong axes and leave those on the right axes as they were.
#[test]
fn identity_what_leaks_follows_the_sign_of_the_angle_error() {
    holds(what_leaks_follows_the_sign_of_the_angle_error);
}

#[test]
fn identity_what_leaks_follows_the_sign_of_the_angle_error_twin() {
    rejects(WRONG, what_leaks_follows_the_sign_of_the_angle_error);
}

fn it_is_equation_9_at_the_measured_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ((gain, v), theta, error) = (any(), Exact::angle("θ"), Exact::angle("θ_error"));
    let seen = ActuationGains { x: gain, y: gain }.axis_forces(&v, theta + error).along_orbit(theta);
    let f = misaligned_forces(gain, &v, error);
    proof.equal("f_as", seen.a_s, planted * f.a_s)?;
    proof.equal("f_qs", seen.q_s, planted * f.q_s)?;
    proof.equal("f_ac", seen.a_c, planted * f.a_c)?;
    proof.equal("f_qc", seen.q_c, planted * f.q_c)
}

//= specs/equation-08.md#projection-at-the-measured-angle
//= type=test
//# The forces MUST be those of the projection at the measured angle with equal gains, seen along the true orbit.
#[test]
fn identity_it_is_equation_9_at_the_measured_angle() {
    holds(it_is_equation_9_at_the_measured_angle);
}

#[test]
fn identity_it_is_equation_9_at_the_measured_angle_twin() {
    rejects(WRONG, it_is_equation_9_at_the_measured_angle);
}

/// With f_as = −2ωa/τ the energy stays, and the pattern turns at tan(θ_error)/τ.
fn a_misaligned_energy_controller_precesses_the_pattern(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let [omega, tau, a] = ["ω", "τ", "a"].map(Exact::positive);
    let (theta, error, zero) = (Exact::angle("θ"), Exact::acute("θ_error"), Exact::zero());
    let resonator = Resonator {
        omega_rad_s: omega,
        angular_gain: Exact::real("k"),
        centrifugal_gain: zero,
        damping_per_s: Exact::one() / tau,
        anisodamping: Anisotropy::none(),
        anisoelasticity: Anisotropy::none(),
    };
    let (sin, cos) = error.sin_cos();
    for (error, sin) in [(error, sin), (-error, -sin)] {
        let e = Orbit { a, q: zero, theta, delta: zero }.envelope();
        let v = ControlOutputs { v_as: -Exact::two() * omega * a / (tau * cos), v_qc: zero };
        let forces = ActuationGains { x: Exact::one(), y: Exact::one() }.axis_forces(&v, theta + error);
        let rate = resonator.envelope_rate(&e, zero, zero) + forces.envelope_rate(Exact::two() * omega);
        let p = e.pendulum();
        proof.equal("E² = R² + S²", p.r * p.r + p.s * p.s, a * a * a * a)?;
        proof.equal("energy", e.pendulum_rate(&rate).e, zero)?;
        proof.equal("precession", e.precession(&rate), planted * sin / (cos * tau))?;
    }
    Ok(())
}

//= specs/equation-08.md#precession-by-a-misaligned-energy-controller
//= type=test
//# An energy controller that balances the damping at a wrong orientation MUST precess the pattern at the tangent of the angle error over the decay time.
#[test]
fn identity_a_misaligned_energy_controller_precesses_the_pattern() {
    holds(a_misaligned_energy_controller_precesses_the_pattern);
}

#[test]
fn identity_a_misaligned_energy_controller_precesses_the_pattern_twin() {
    rejects(WRONG, a_misaligned_energy_controller_precesses_the_pattern);
}

/// On a line orbit, by the derivatives of E = a², R and S (θ), Q = 2aq and L = −a² sin 2δ.
fn each_force_moves_its_own_property(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ((gain, v), theta, error) = (any(), Exact::angle("θ"), Exact::angle("θ_error"));
    let (a, two_omega, zero, two) = (Exact::positive("a"), Exact::positive("2ω"), Exact::zero(), Exact::two());
    let e = Orbit { a, q: zero, theta, delta: zero }.envelope();
    let forces = ActuationGains { x: gain, y: gain }.axis_forces(&v, theta + error);
    let (f, rate) = (misaligned_forces(gain, &v, error), forces.envelope_rate(two_omega));
    let moved = e.pendulum_rate(&rate);
    let p = e.pendulum();
    proof.equal("R² + S²", p.r * p.r + p.s * p.s, a * a * a * a)?;
    proof.equal("ȧ = −f_as/2ω", moved.e / (two * a), -planted * f.a_s / two_omega)?;
    proof.equal("θ̇ = −f_qs/(2ωa)", e.precession(&rate), -planted * f.q_s / (two_omega * a))?;
    proof.equal("q̇ = +f_qc/2ω", moved.q / (two * a), planted * f.q_c / two_omega)?;
    proof.equal("δ̇ = −f_ac/(2ωa)", -moved.l / (two * a * a), -planted * f.a_c / (two_omega * a))
}

//= specs/equation-08.md#what-each-force-moves
//= type=test
//# Each force along the orbit MUST move the property of the orbit that is its own: f_as the amplitude, f_qs the orientation, f_qc the quadrature and f_ac the phase, with the signs −, −, + and −.
#[test]
fn identity_each_force_moves_its_own_property() {
    holds(each_force_moves_its_own_property);
}

#[test]
fn identity_each_force_moves_its_own_property_twin() {
    rejects(WRONG, each_force_moves_its_own_property);
}

// Rounding: bounds for all inputs of a box.

/// Gain and both commands at every scale, either command the larger one, every angle.
fn gains_commands_and_angles() -> Vec<Inputs> {
    any_vector(2).into_iter().map(|v| [vec![octave()], v, vec![any_angle()]].concat()).collect()
}

/// The four forces relative to G_A times both commands.
struct MisalignedForces;

impl Formula for MisalignedForces {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let f = misaligned_forces(x[0], &ControlOutputs { v_as: x[1], v_qc: x[2] }, x[3]);
        vec![f.a_s, f.q_s, f.a_c, f.q_c]
    }

    fn scale<T: Real>(&self, x: &[T]) -> T {
        x[0] * (magnitude(x[1]) + magnitude(x[2]))
    }
}

for_each_precision! {
    //= specs/equation-08.md#rotation-of-the-commands
    //= type=test
    //# The forces along the orbit MUST be the commanded forces turned by the angle error.
    #[test]
    fn interval_the_misaligned_forces() {
        bounded::<T>(&MisalignedForces, &gains_commands_and_angles(), &MISALIGNED_FORCES);
    }

    #[test]
    fn interval_the_misaligned_forces_twin() {
        rejects_rounding::<T>(&MisalignedForces, &gains_commands_and_angles(), &MISALIGNED_FORCES);
    }
}
