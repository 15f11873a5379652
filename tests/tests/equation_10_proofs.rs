//! Equation 10, proved: for all reals on the shipping source, and with rounding for all inputs of a box.

use cvg_model::actuation::misaligned_forces;
use cvg_model::{ActuationGains, ControlOutputs, Real};
use cvg_prover::{Exact, Formula, Interval, Proof, Refusal};
use cvg_tests::domain::{any_angle, any_vector, octave};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, TOO_TIGHT, WRONG, bounded, holds, larger, magnitude, rejects, rejects_rounding};
use cvg_tests::tolerances::ORBIT_FORCES;

/// Any gains, any commands, any angle.
fn any() -> (ActuationGains<Exact>, ControlOutputs<Exact>, Exact) {
    let gains = ActuationGains { x: Exact::real("G_Ax"), y: Exact::real("G_Ay") };
    (gains, ControlOutputs { v_as: Exact::real("v_as"), v_qc: Exact::real("v_qc") }, Exact::angle("θ"))
}

fn it_is_equation_9_seen_along_the_orbit(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, v, theta) = any();
    let (f, turned) = (g.orbit_forces(&v, theta), g.axis_forces(&v, theta).along_orbit(theta));
    proof.equal("f_as", f.a_s, planted * turned.a_s)?;
    proof.equal("f_qs", f.q_s, planted * turned.q_s)?;
    proof.equal("f_ac", f.a_c, planted * turned.a_c)?;
    proof.equal("f_qc", f.q_c, planted * turned.q_c)
}

//= specs/equation-10.md#equation-9-turned
//= type=test
//# The forces along the orbit MUST be those of Equation 9 turned back by the angle of the orbit.
#[test]
fn identity_it_is_equation_9_seen_along_the_orbit() {
    holds(it_is_equation_9_seen_along_the_orbit);
}

#[test]
fn identity_it_is_equation_9_seen_along_the_orbit_twin() {
    rejects(WRONG, it_is_equation_9_seen_along_the_orbit);
}

fn the_force_is_the_mean_gain_along_its_axis(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, v, theta) = any();
    let (f, (sin, cos)) = (g.orbit_forces(&v, theta), theta.sin_cos());
    proof.equal("f_as", f.a_s, planted * v.v_as * (g.x * cos * cos + g.y * sin * sin))?;
    proof.equal("f_qc", f.q_c, planted * v.v_qc * (g.x * sin * sin + g.y * cos * cos))
}

//= specs/equation-10.md#mean-gain
//= type=test
//# The force of a command along its own axis MUST be the command times the gains weighted by the squared direction cosines of that axis.
#[test]
fn identity_the_force_is_the_mean_gain_along_its_axis() {
    holds(the_force_is_the_mean_gain_along_its_axis);
}

#[test]
fn identity_the_force_is_the_mean_gain_along_its_axis_twin() {
    rejects(WRONG, the_force_is_the_mean_gain_along_its_axis);
}

fn equal_gains_leave_equation_8_without_an_error(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, v, theta) = any();
    let f = ActuationGains { x: g.x, y: g.x * planted }.orbit_forces(&v, theta);
    let aligned = misaligned_forces(g.x * planted, &v, Exact::zero());
    proof.equal("f_as", f.a_s, aligned.a_s)?;
    proof.equal("f_qs", f.q_s, aligned.q_s)?;
    proof.equal("f_ac", f.a_c, aligned.a_c)?;
    proof.equal("f_qc", f.q_c, aligned.q_c)
}

//= specs/equation-10.md#equal-gains-leave-equation-8
//= type=test
//# Equal gains MUST give the forces of Equation 8 without an angle error, exactly.
#[test]
fn identity_equal_gains_leave_equation_8_without_an_error() {
    holds(equal_gains_leave_equation_8_without_an_error);
}

#[test]
fn identity_equal_gains_leave_equation_8_without_an_error_twin() {
    rejects(WRONG, equal_gains_leave_equation_8_without_an_error);
}

/// Trace and determinant of the map from (v_as, v_qc) to the forces, which is symmetric.
fn sum_and_product_of_the_gains_do_not_depend_on_the_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, _, theta) = any();
    let f = g.orbit_forces(&ControlOutputs { v_as: Exact::one(), v_qc: Exact::one() }, theta);
    proof.equal("sum", f.a_s + f.q_c, planted * (g.x + g.y))?;
    proof.equal("product", f.a_s * f.q_c - f.q_s * f.a_c, planted * g.x * g.y)?;
    proof.equal("symmetry", f.q_s, f.a_c)
}

//= specs/equation-10.md#sum-and-product
//= type=test
//# The sum and the product of the principal values of the map from commands to forces MUST be those of the two gains.
#[test]
fn identity_sum_and_product_of_the_gains_do_not_depend_on_the_angle() {
    holds(sum_and_product_of_the_gains_do_not_depend_on_the_angle);
}

#[test]
fn identity_sum_and_product_of_the_gains_do_not_depend_on_the_angle_twin() {
    rejects(WRONG, sum_and_product_of_the_gains_do_not_depend_on_the_angle);
}

/// For a positive command; either gain may be the larger one. What is left to a bound is |G_Ay − G_Ax| sin²θ or cos²θ.
fn the_energy_force_lies_between_the_gains(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (low, theta) = (Exact::positive("smaller gain"), Exact::angle("θ"));
    let (more, v_as, one) = (Exact::positive("excess of the larger"), Exact::positive("v_as"), Exact::one());
    let (high, (sin, cos)) = (low + more, theta.sin_cos());
    let command = ControlOutputs { v_as, v_qc: Exact::zero() };
    for (g, at_low, at_high) in
        [(ActuationGains { x: low, y: high }, cos, sin), (ActuationGains { x: high, y: low }, sin, cos)]
    {
        let force = g.orbit_forces(&command, theta).a_s;
        proof.not_negative("above the smaller", force * planted - low * v_as, one, &[(more * v_as, at_high)])?;
        proof.not_negative("below the larger", high * v_as * planted - force, one, &[(more * v_as, at_low)])?;
        // and a command of the other sign makes the same force with the other sign
        let back = g.orbit_forces(&ControlOutputs { v_as: -v_as, v_qc: Exact::zero() }, theta).a_s;
        proof.equal("odd", back, -force)?;
    }
    Ok(())
}

//= specs/equation-10.md#between-the-gains
//= type=test
//# The magnitude of the energy force MUST lie between the command times the smaller and the command times the larger gain.
#[test]
fn identity_the_energy_force_lies_between_the_gains() {
    holds(the_energy_force_lies_between_the_gains);
}

#[test]
fn identity_the_energy_force_lies_between_the_gains_twin() {
    rejects(TOO_TIGHT, the_energy_force_lies_between_the_gains);
}

fn exchanging_the_axes_mirrors_the_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (g, v, theta) = any();
    let f = g.orbit_forces(&v, theta);
    let m = ActuationGains { x: g.y, y: g.x }.orbit_forces(&v, Exact::quarter_turn() - theta);
    proof.equal("f_as", m.a_s, f.a_s)?;
    proof.equal("f_qc", m.q_c, f.q_c)?;
    proof.equal("f_qs", m.q_s, -planted * f.q_s)?;
    proof.equal("f_ac", m.a_c, -planted * f.a_c)
}

//= specs/equation-10.md#exchange-of-the-axes
//= type=test
//# Exchanging the gains and taking the angle from 90° MUST reverse the forces on the wrong axes and leave those on the right axes as they were.
#[test]
fn identity_exchanging_the_axes_mirrors_the_angle() {
    holds(exchanging_the_axes_mirrors_the_angle);
}

#[test]
fn identity_exchanging_the_axes_mirrors_the_angle_twin() {
    rejects(WRONG, exchanging_the_axes_mirrors_the_angle);
}

/// (½(G_Ay − G_Ax) v_as)² − f_qs² is the square of ½(G_Ay − G_Ax) v_as cos 2θ.
fn the_leak_is_largest_at_45_degrees(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ((g, v, theta), one) = (any(), Exact::one());
    let most = planted * Exact::half() * (g.y - g.x) * v.v_as;
    let (_, cos_2theta) = (Exact::two() * theta).sin_cos();
    let square = Exact::half() * (g.y - g.x) * v.v_as * cos_2theta;
    let leak = |theta: Exact| g.orbit_forces(&v, theta).q_s;
    proof.not_negative("below its largest", most.squared() - leak(theta).squared(), one, &[(one, square)])?;
    proof.equal("at 45°", leak(Exact::half() * Exact::quarter_turn()), most)?;
    for quarters in -4..=4_i32 {
        proof.equal("at 90°", leak(Exact::ratio(quarters, 1) * Exact::quarter_turn()), Exact::zero())?;
    }
    Ok(())
}

//= specs/equation-10.md#where-the-leak-is
//= type=test
//# The force on the wrong axis MUST be largest at 45°, where it is half the difference of the gains times the command, and zero at every multiple of 90°.
#[test]
fn identity_the_leak_is_largest_at_45_degrees() {
    holds(the_leak_is_largest_at_45_degrees);
}

#[test]
fn identity_the_leak_is_largest_at_45_degrees_twin() {
    rejects(&[(99, 100)], the_leak_is_largest_at_45_degrees);
}

// Rounding: bounds for all inputs of a box.

/// G_Ay and both commands at every scale, G_Ax from a tenth to five, either command the larger one, every angle.
fn gains_commands_and_angles() -> Vec<Inputs> {
    let gains = vec![Interval::new(0.1, 5.0), octave()];
    any_vector(2).into_iter().map(|v| [gains.clone(), v, vec![any_angle()]].concat()).collect()
}

/// The four forces relative to the larger gain times both commands.
struct OrbitForcesOf;

impl Formula for OrbitForcesOf {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let v = ControlOutputs { v_as: x[2], v_qc: x[3] };
        let f = ActuationGains { x: x[0], y: x[1] }.orbit_forces(&v, x[4]);
        vec![f.a_s, f.q_s, f.a_c, f.q_c]
    }

    fn scale<T: Real>(&self, x: &[T]) -> T {
        larger(x[0], x[1]) * (magnitude(x[2]) + magnitude(x[3]))
    }
}

for_each_precision! {
    //= specs/equation-10.md#equation-9-turned
    //= type=test
    //# The forces along the orbit MUST be those of Equation 9 turned back by the angle of the orbit.
    #[test]
    fn interval_the_orbit_forces() {
        bounded::<T>(&OrbitForcesOf, &gains_commands_and_angles(), &ORBIT_FORCES);
    }

    #[test]
    fn interval_the_orbit_forces_twin() {
        rejects_rounding::<T>(&OrbitForcesOf, &gains_commands_and_angles(), &ORBIT_FORCES);
    }
}
