//! Equation 9, proved: for all reals on the shipping source, and with rounding for all inputs of a box.

use cvg_controller::{ActuationCompensation, Allocation, OrbitCommands, Status};
use cvg_model::effects::{EffectId, Moment};
use cvg_model::{ActuationGains, AxisForces, ControlOutputs, Float, Orbit, Real};
use cvg_prover::{Exact, Formula, Interval, Proof, Refusal};
use cvg_tests::domain::{any_angle, any_vector, octave};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, WRONG, bounded, holds, holds_outside, larger, magnitude, rejects, rejects_rounding};
use cvg_tests::tolerances::AXIS_FORCES;

/// Any gains, any commands, any angle.
fn any() -> (ActuationGains<Exact>, ControlOutputs<Exact>, Exact) {
    let gains = ActuationGains { x: Exact::real("G_Ax"), y: Exact::real("G_Ay") };
    (gains, ControlOutputs { v_as: Exact::real("v_as"), v_qc: Exact::real("v_qc") }, Exact::angle("θ"))
}

/// All four forces of the one are `factor` times those of the other.
fn multiple(proof: &mut Proof, f: &AxisForces<Exact>, factor: Exact, of: &AxisForces<Exact>) -> Result<(), Refusal> {
    proof.equal("f_xc", f.x_c, factor * of.x_c)?;
    proof.equal("f_xs", f.x_s, factor * of.x_s)?;
    proof.equal("f_yc", f.y_c, factor * of.y_c)?;
    proof.equal("f_ys", f.y_s, factor * of.y_s)
}

/// v_as along (cos θ, sin θ), v_qc along (−sin θ, cos θ): the axes of an orbit, taken from the orbit itself.
fn each_channel_gets_its_share_of_both_commands(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, v, theta) = any();
    let (zero, one) = (Exact::zero(), Exact::one());
    let axes = Orbit { a: one, q: one, theta, delta: zero }.envelope();
    let shares = AxisForces {
        x_c: g.x * v.v_qc * axes.x_s,
        x_s: g.x * v.v_as * axes.x_c,
        y_c: g.y * v.v_qc * axes.y_s,
        y_s: g.y * v.v_as * axes.y_c,
    };
    multiple(proof, &g.axis_forces(&v, theta), planted, &shares)
}

//= specs/equation-09.md#projection
//= type=test
//# Each channel MUST make its gain times the projection of both commands onto its axis.
#[test]
fn identity_each_channel_gets_its_share_of_both_commands() {
    holds(each_channel_gets_its_share_of_both_commands);
}

#[test]
fn identity_each_channel_gets_its_share_of_both_commands_twin() {
    rejects(WRONG, each_channel_gets_its_share_of_both_commands);
}

fn half_a_turn_reverses_every_force(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, v, theta) = any();
    multiple(proof, &g.axis_forces(&v, theta + Exact::PI), -planted, &g.axis_forces(&v, theta))
}

//= specs/equation-09.md#half-a-turn-reverses-the-forces
//= type=test
//# Turning the orientation by 180° MUST reverse every force.
#[test]
fn identity_half_a_turn_reverses_every_force() {
    holds(half_a_turn_reverses_every_force);
}

#[test]
fn identity_half_a_turn_reverses_every_force_twin() {
    rejects(WRONG, half_a_turn_reverses_every_force);
}

/// In both commands and any factors, of which doubling is one.
fn the_forces_are_linear_in_the_commands(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, v, theta) = any();
    let (m, n) = (Exact::real("m"), Exact::real("n"));
    let w = ControlOutputs { v_as: Exact::real("w_as"), v_qc: Exact::real("w_qc") };
    let both = ControlOutputs { v_as: m * v.v_as + n * w.v_as, v_qc: m * v.v_qc + n * w.v_qc };
    let (of_v, of_w) = (g.axis_forces(&v, theta), g.axis_forces(&w, theta));
    let sum = AxisForces {
        x_c: m * of_v.x_c + n * of_w.x_c,
        x_s: m * of_v.x_s + n * of_w.x_s,
        y_c: m * of_v.y_c + n * of_w.y_c,
        y_s: m * of_v.y_s + n * of_w.y_s,
    };
    multiple(proof, &g.axis_forces(&both, theta), planted, &sum)
}

//= specs/equation-09.md#linear
//= type=test
//# Doubling the commands MUST double every force exactly.
#[test]
fn identity_the_forces_are_linear_in_the_commands() {
    holds(the_forces_are_linear_in_the_commands);
}

#[test]
fn identity_the_forces_are_linear_in_the_commands_twin() {
    rejects(WRONG, the_forces_are_linear_in_the_commands);
}

fn the_energy_command_moves_only_the_energy(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (gain, v_as, theta) = (Exact::positive("G_A"), Exact::real("v_as"), Exact::angle("θ"));
    let (a, two_omega, zero) = (Exact::positive("a"), Exact::positive("2ω"), Exact::zero());
    let e = Orbit { a, q: zero, theta, delta: zero }.envelope();
    let rate = ActuationGains { x: gain, y: gain }.axis_forces(&ControlOutputs { v_as, v_qc: zero }, theta);
    let rate = rate.envelope_rate(two_omega);
    let (p, moved) = (e.pendulum(), e.pendulum_rate(&rate));
    proof.equal("R² + S²", p.r * p.r + p.s * p.s, a * a * a * a)?;
    proof.equal("Ė = −2a G_A v_as/2ω", moved.e, -planted * Exact::two() * a * gain * v_as / two_omega)?;
    proof.equal("Q̇", moved.q, zero)?;
    proof.equal("L̇", moved.l, zero)?;
    proof.equal("θ̇", e.precession(&rate), zero)
}

//= specs/equation-09.md#energy-command
//= type=test
//# With equal gains the energy command MUST change the energy only, and take it out where the command is positive.
#[test]
fn identity_the_energy_command_moves_only_the_energy() {
    holds(the_energy_command_moves_only_the_energy);
}

#[test]
fn identity_the_energy_command_moves_only_the_energy_twin() {
    rejects(WRONG, the_energy_command_moves_only_the_energy);
}

fn the_quadrature_command_moves_only_the_quadrature(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (gain, v_qc, theta) = (Exact::positive("G_A"), Exact::real("v_qc"), Exact::angle("θ"));
    let (a, two_omega, zero) = (Exact::positive("a"), Exact::positive("2ω"), Exact::zero());
    let e = Orbit { a, q: zero, theta, delta: zero }.envelope();
    let rate = ActuationGains { x: gain, y: gain }.axis_forces(&ControlOutputs { v_as: zero, v_qc }, theta);
    let rate = rate.envelope_rate(two_omega);
    let (p, moved) = (e.pendulum(), e.pendulum_rate(&rate));
    proof.equal("R² + S²", p.r * p.r + p.s * p.s, a * a * a * a)?;
    proof.equal("Q̇ = +2a G_A v_qc/2ω", moved.q, planted * Exact::two() * a * gain * v_qc / two_omega)?;
    proof.equal("Ė", moved.e, zero)?;
    proof.equal("L̇", moved.l, zero)?;
    proof.equal("θ̇", e.precession(&rate), zero)
}

//= specs/equation-09.md#quadrature-command
//= type=test
//# With equal gains the quadrature command MUST change the quadrature only, and add to it where the command is positive.
#[test]
fn identity_the_quadrature_command_moves_only_the_quadrature() {
    holds(the_quadrature_command_moves_only_the_quadrature);
}

#[test]
fn identity_the_quadrature_command_moves_only_the_quadrature_twin() {
    rejects(WRONG, the_quadrature_command_moves_only_the_quadrature);
}

/// Why [`the_compensated_allocation_makes_what_was_commanded`] claims nothing on some paths.
const LIMITED: &str = "a drive is at its limit";

/// Mismatches whose root is rational, so that the library's drive has no root in it.
const RATIOS: [(i32, i32); 3] = [(36, 25), (25, 36), (1, 1)];

/// The allocation for any command, any direction and any limit, wherever it is not at its limit: drives that are so
/// mismatched make the forces along the orbit that were commanded.
fn the_compensated_allocation_makes_what_was_commanded(
    (numerator, denominator): (i32, i32),
) -> impl Fn(&mut Proof, Exact) -> Result<(), Refusal> {
    move |proof, planted| {
        let [v_as, v_qs, v_qc, v_ac] = ["v_as", "v_qs", "v_qc", "v_ac"].map(Exact::real);
        let (theta, limit, zero) = (Exact::angle("θ"), Exact::positive("limit"), Exact::zero());
        let (sin, cos) = theta.sin_cos();
        let values = [Exact::ratio(numerator, denominator), zero, zero, zero];
        let inverse = ActuationCompensation::new(&[(EffectId::ActuationGainMismatch, values)]).expect("within bounds");
        let allocation = Allocation::new(Some(inverse), limit).expect("a limit");
        let drive = allocation.step(&OrbitCommands { v_as, v_qs, v_qc, v_ac }, cos, sin);
        if drive.status == Status::Limited {
            proof.outside(LIMITED);
            return Ok(());
        }
        let f = EffectId::ActuationGainMismatch.actuate(&values, drive.volts, &Moment::origin()).along_orbit(theta);
        proof.equal("f_as", f.a_s, planted * v_as)?;
        proof.equal("f_qs", f.q_s, planted * v_qs)?;
        proof.equal("f_qc", f.q_c, planted * v_qc)?;
        proof.equal("f_ac", f.a_c, planted * v_ac)
    }
}

//= specs/equation-09.md#inverse
//= type=test
//# The compensated allocation MUST make the forces along the orbit that were commanded.
#[test]
fn identity_the_compensated_allocation_makes_what_was_commanded() {
    for ratio in RATIOS {
        holds_outside(&[LIMITED], the_compensated_allocation_makes_what_was_commanded(ratio));
    }
}

#[test]
fn identity_the_compensated_allocation_makes_what_was_commanded_twin() {
    for ratio in RATIOS {
        rejects(WRONG, the_compensated_allocation_makes_what_was_commanded(ratio));
    }
}

// Rounding: bounds for all inputs of a box.

/// Both gains and both commands at every scale, each apart from the other: either gain up to ten times the other one,
/// either command the larger one, every angle.
fn gains_commands_and_angles() -> Vec<Inputs> {
    let gains = [vec![octave(), Interval::new(0.05, 1.0)], vec![Interval::new(0.05, 1.0), octave()]];
    let with = |g: &Inputs| any_vector(2).into_iter().map(|v| [g.clone(), v, vec![any_angle()]].concat()).collect();
    gains.iter().flat_map(|g| -> Vec<Inputs> { with(g) }).collect()
}

/// The four forces relative to the larger gain times both commands.
struct AxisForcesOf;

impl Formula for AxisForcesOf {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let v = ControlOutputs { v_as: x[2], v_qc: x[3] };
        let f = ActuationGains { x: x[0], y: x[1] }.axis_forces(&v, x[4]);
        vec![f.x_c, f.x_s, f.y_c, f.y_s]
    }

    fn scale<T: Real>(&self, x: &[T]) -> T {
        larger(x[0], x[1]) * (magnitude(x[2]) + magnitude(x[3]))
    }
}

for_each_precision! {
    //= specs/equation-09.md#projection
    //= type=test
    //# Each channel MUST make its gain times the projection of both commands onto its axis.
    #[test]
    fn interval_the_axis_forces() {
        bounded::<T>(&AxisForcesOf, &gains_commands_and_angles(), &AXIS_FORCES);
    }

    #[test]
    fn interval_the_axis_forces_twin() {
        rejects_rounding::<T>(&AxisForcesOf, &gains_commands_and_angles(), &AXIS_FORCES);
    }
}
