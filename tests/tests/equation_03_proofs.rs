//! Equation 3, proved: for all reals on the shipping source, and with rounding for all inputs of a box.
//!
//! [`Pi`] is walked along every path through its limits. What its floating numbers add (NaN, infinities, rounding) is
//! the matter of other evidence.

use cvg_controller::pi::{Pi, PiState, energy_control, quadrature_control};
use cvg_controller::{Command, Status};
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{ActuationGains, ControlOutputs, Envelope, Orbit, Real};
use cvg_prover::{Exact, Formula, Proof, Refusal, prove};
use cvg_tests::domain::{any_vector, octave};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, TOO_TIGHT, WRONG, bounded, holds, holds_outside, rejects, rejects_rounding};
use cvg_tests::tolerances::CONTROL;

/// Any controller that can be built: gain, integration time, period and limit.
fn controller() -> (Pi<Exact>, [Exact; 4]) {
    let [gain, time, period, limit] = ["K", "τ", "T", "limit"].map(Exact::positive);
    let pi = Pi::new(gain, time, period, limit).expect("all are positive");
    (pi, [gain, time, period, limit])
}

fn the_outputs_are_a_proportional_and_an_integral_part(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (gain, time) = (Exact::positive("K"), Exact::positive("τ"));
    let (error, integral, step) = (Exact::real("e"), Exact::real("∫e dt"), Exact::real("step"));
    let energy = energy_control(gain, time, error, integral);
    let quadrature = quadrature_control(gain, time, error, integral);
    let law = gain * (error + integral / (Exact::two() * time));
    proof.equal("v_as", energy, planted * law)?;
    proof.equal("v_qc", quadrature, -planted * law)?;
    proof.equal("a step of E_d", energy_control(gain, time, error + step, integral) - energy, planted * gain * step)?;
    let moved = quadrature_control(gain, time, error + step, integral) - quadrature;
    proof.equal("a step of Q_d", moved, -planted * gain * step)
}

//= specs/equation-03.md#proportional-part
//= type=test
//# A step of the error MUST change the output at once by the gain times the step.
#[test]
fn identity_the_outputs_are_a_proportional_and_an_integral_part() {
    holds(the_outputs_are_a_proportional_and_an_integral_part);
}

#[test]
fn identity_the_outputs_are_a_proportional_and_an_integral_part_twin() {
    rejects(WRONG, the_outputs_are_a_proportional_and_an_integral_part);
}

fn the_signs_brake_and_cancel(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (gain, time) = (Exact::positive("K"), Exact::positive("τ"));
    let (error, integral) = (Exact::positive("e"), Exact::positive("∫e dt"));
    proof.positive_by_factors("v_as > 0", energy_control(planted * gain, time, error, integral))?;
    proof.positive_by_factors("v_qc < 0", -quadrature_control(planted * gain, time, error, integral))
}

//= specs/equation-03.md#signs
//= type=test
//# The energy output MUST be positive where the measured energy stays above its set value, and the quadrature output MUST be negative where the measured quadrature stays positive.
#[test]
fn identity_the_signs_brake_and_cancel() {
    holds(the_signs_brake_and_cancel);
}

#[test]
fn identity_the_signs_brake_and_cancel_twin() {
    rejects(&[(-1, 1)], the_signs_brake_and_cancel);
}

/// The integral grows by the error times the period, and the command by K e T/2τ for it.
fn within_the_limits_a_step_is_the_law(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (pi, [gain, time, period, limit]) = controller();
    let (zero, two) = (Exact::zero(), Exact::two());
    let (before, error) = (Exact::real("∫e dt"), Exact::real("e"));
    let after = before + period * error;
    let law = |integral: Exact| gain * (error + integral / (two * time));
    let integral_limit = two * time * limit / gain;
    for room in [limit - law(after), limit + law(after), integral_limit - after, integral_limit + after] {
        proof.assume_positive(room)?;
    }
    let (mut energy, mut quadrature) = (PiState { integral: before }, PiState { integral: before });
    let v_as = pi.energy(&mut energy, error, zero);
    let v_qc = pi.quadrature(&mut quadrature, error);
    assert_eq!((v_as.status, v_qc.status), (Status::Within, Status::Within));
    proof.equal("the integral", energy.integral, before + planted * period * error)?;
    proof.equal("the integral", quadrature.integral, energy.integral)?;
    proof.equal("v_as", v_as.volts - law(before), planted * gain * error * period / (two * time))?;
    proof.equal("v_qc", v_qc.volts, -planted * v_as.volts)
}

//= specs/equation-03.md#integral-part
//= type=test
//# A constant error MUST change the output by the gain times the error times the time over twice the integration time.
#[test]
fn identity_within_the_limits_a_step_is_the_law() {
    holds(within_the_limits_a_step_is_the_law);
}

#[test]
fn identity_within_the_limits_a_step_is_the_law_twin() {
    rejects(WRONG, within_the_limits_a_step_is_the_law);
}

/// Why on some paths no point need be found.
const EXCLUDED: &str = "an integral and an output whose limits exclude each other: what is claimed is shown there too";

/// On every path through the limits: any state, any measurement. A command that is limited is at its limit, and one
/// that is not is the law's.
fn the_output_is_within_its_limit(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (pi, [gain, time, _, limit]) = controller();
    let (state, error) = (Exact::real("∫e dt"), Exact::real("e"));
    let mut state = PiState { integral: state };
    let Command { volts, status } = pi.control(&mut state, error);
    proof.may_be_empty(EXCLUDED);
    match status {
        Status::Within => {
            proof.not_negative_by_path("below the limit", limit - volts)?;
            proof.not_negative_by_path("above the limit", limit + volts)?;
            proof.equal("the law", volts, planted * gain * (error + state.integral / (Exact::two() * time)))
        }
        Status::Limited => proof.equal("at the limit", volts * volts, planted * limit * limit),
        Status::Invalid => {
            proof.not_negative_by_path("below the limit", limit - volts)?;
            proof.not_negative_by_path("above the limit", limit + volts)
        }
    }
}

//= specs/equation-03.md#bounded-output
//= type=test
//# The output MUST be finite and within its limit for every input.
#[test]
fn identity_the_output_is_within_its_limit() {
    holds_outside(&[EXCLUDED], the_output_is_within_its_limit);
}

#[test]
fn the_audit_counts_the_paths_as_they_are() {
    let proved = prove(|proof| the_output_is_within_its_limit(proof, Exact::one())).expect("it holds");
    let unvisited: usize = proved.unvisited.values().sum();
    let impossible = proved.paths - proved.covered - unvisited;
    let expected = format!(
        "has {} paths through its limits. Points are found on {}, for {impossible} it is shown that none lies there, and on the other \
         {unvisited} the claims are shown",
        proved.paths, proved.covered
    );
    let audit =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/src/audit.md")).expect("readable");
    let audit = audit.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(audit.contains(&expected), "docs/src/audit.md does not say: {expected}");
}

#[test]
fn identity_the_output_is_within_its_limit_twin() {
    rejects(TOO_TIGHT, the_output_is_within_its_limit);
}

/// Routh's criterion on the loop of the resonator, Equation 9 and Equation 3 at the set energy, for either loop: both
/// coefficients of s² + c1 s + c0 are positive, and c1 is above what the controller alone gives.
///
/// The rates are the shipping envelope's; the derivatives by the amplitudes are taken of them.
fn the_loops_are_stable(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let [gain, time, tau, omega, drive] = ["K", "τ_I", "τ", "ω", "G_A"].map(Exact::positive);
    let (a, q, v) = (Exact::positive("a"), Exact::real("q"), Exact::real("v"));
    let (zero, one, two) = (Exact::zero(), Exact::one(), Exact::two());
    let resonator = Resonator {
        omega_rad_s: omega,
        angular_gain: Exact::real("k"),
        centrifugal_gain: zero,
        damping_per_s: one / tau,
        anisodamping: Anisotropy::none(),
        anisoelasticity: Anisotropy::none(),
    };
    // at θ = 0, which stands for every angle: gains are equal and the resonator is isotropic
    let e = Orbit { a, q, theta: zero, delta: zero }.envelope();
    let rates = |v: ControlOutputs<Exact>| {
        let force = ActuationGains { x: drive, y: drive }.axis_forces(&v, zero).envelope_rate(two * omega);
        let rate: Envelope<Exact> = resonator.envelope_rate(&e, zero, zero) + force;
        e.pendulum_rate(&rate)
    };
    let at_rest = |value: Exact, by: Exact| value.derivative(by);
    // Ė and Q̇ by v, by a (2a of which is by E) and by q (2a of which is by Q), then at q = 0
    let energy = rates(ControlOutputs { v_as: v, v_qc: zero }).e;
    let quadrature = rates(ControlOutputs { v_as: zero, v_qc: v }).q;
    let push = [at_rest(energy, v), at_rest(quadrature, v)];
    proof.equal("Ė by v_as", push[0], -two * a * drive / (two * omega))?;
    proof.equal("Q̇ by v_qc", push[1], two * a * drive / (two * omega))?;
    // the output that holds the energy at a: Ė = 0
    let held = -two * omega * a / (tau * drive);
    let at_hold = rates(ControlOutputs { v_as: held, v_qc: zero }).e;
    proof.equal("Ė at rest", at_hold, -two * q * q / tau)?;
    let free_energy = at_rest(rates(ControlOutputs { v_as: v, v_qc: zero }).e, a) / (two * a);
    proof.equal("Ė by E at a free v", free_energy, -two / tau - drive * v / (two * omega * a))?;
    let own_energy = -two / tau - drive * held / (two * omega * a);
    let own_quadrature = at_rest(quadrature, q) / (two * a);
    proof.equal("Q̇ by Q", own_quadrature, -two / tau)?;
    for (own, push, law) in [
        (own_energy, push[0], energy_control::<Exact> as fn(Exact, Exact, Exact, Exact) -> Exact),
        (own_quadrature, push[1], quadrature_control::<Exact>),
    ] {
        // the law is linear: its two slopes are its values at unit error and unit integral
        let (of_error, of_integral) = (law(gain, time, one, zero), planted * law(gain, time, zero, one));
        let damping = -(own + push * planted * of_error);
        let stiffness = -push * of_integral;
        proof.positive_by_factors("c1", damping)?;
        proof.positive_by_factors("c0", stiffness)?;
        proof.equal("c0 = abK/τ", stiffness, a * drive * gain / (two * omega * time))?;
    }
    Ok(())
}

//= specs/equation-03.md#stable-loop
//= type=test
//# The averaged loop of energy and controller MUST be stable for every positive gain and every positive integration time.
#[test]
fn identity_the_loops_are_stable() {
    holds(the_loops_are_stable);
}

#[test]
fn identity_the_loops_are_stable_twin() {
    rejects(&[(-1, 1)], the_loops_are_stable);
}

// Rounding: bounds for all inputs of a box.

/// Gain and integration time at every scale; error and integral such that one is the largest.
fn controllers() -> Vec<Inputs> {
    any_vector(2).into_iter().map(|v| [vec![octave(), octave()], v].concat()).collect()
}

/// Both outputs relative to half of K, which is below K(|e| + |∫e|/τ) there.
struct Outputs;

impl Formula for Outputs {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![energy_control(x[0], x[1], x[2], x[3]), quadrature_control(x[0], x[1], x[2], x[3])]
    }

    fn scale<T: Real>(&self, x: &[T]) -> T {
        T::half() * x[0]
    }
}

for_each_precision! {
    //= specs/equation-03.md#proportional-part
    //= type=test
    //# A step of the error MUST change the output at once by the gain times the step.
    //= specs/equation-03.md#integral-part
    //= type=test
    //# A constant error MUST change the output by the gain times the error times the time over twice the integration time.
    #[test]
    fn interval_the_outputs() {
        bounded::<T>(&Outputs, &controllers(), &CONTROL);
    }

    #[test]
    fn interval_the_outputs_twin() {
        rejects_rounding::<T>(&Outputs, &controllers(), &CONTROL);
    }
}
