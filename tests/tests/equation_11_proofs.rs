//! Equation 11, proved: for all reals on the shipping source, and with rounding for all inputs of a box.

use cvg_calibration::actuation::actuation_gain_ratio;
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{ActuationGains, ControlOutputs, Orbit, Real};
use cvg_prover::{Exact, Formula, Proof, Refusal};
use cvg_tests::domain::octave;
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, WRONG, bounded, holds, rejects, rejects_rounding};
use cvg_tests::tolerances::ACTUATION_RATIO;

/// Decay time and the output that makes up for the decay, with the pattern at `theta`.
fn held_at(
    theta: Exact,
    resonator: &Resonator<Exact>,
    drive: &ActuationGains<Exact>,
    amplitude: Exact,
) -> (Exact, Exact) {
    let zero = Exact::zero();
    let e = Orbit { a: amplitude, q: zero, theta, delta: zero }.envelope();
    let free = e.pendulum_rate(&resonator.envelope_rate(&e, zero, zero)).e;
    let force = drive.axis_forces(&ControlOutputs { v_as: Exact::one(), v_qc: zero }, theta);
    let per_volt = e.pendulum_rate(&force.envelope_rate(Exact::two() * resonator.omega_rad_s)).e;
    (-Exact::two() * e.pendulum().e / free, -free / per_volt)
}

/// Ring-downs that a campaign can hold: decay times above 0, outputs other than 0.
fn ring_downs() -> [Exact; 4] {
    [Exact::positive("τ_0"), Exact::nonzero("v_as@0"), Exact::positive("τ_90"), Exact::nonzero("v_as@90")]
}

/// Whatever the damping along each axis, as long as both axes lose energy, and whatever the splitting of frequencies.
fn the_ratio_is_that_of_the_drive_of_any_resonator(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (drive, a) = (ActuationGains { x: Exact::positive("G_Ax"), y: Exact::positive("G_Ay") }, Exact::positive("a"));
    let (resonator, [along_x, along_y]) = any_resonator();
    let (tau_0, v_0) = held_at(Exact::zero(), &resonator, &drive, a);
    let (tau_90, v_90) = held_at(Exact::quarter_turn(), &resonator, &drive, a);
    proof.equal("τ_0", tau_0, Exact::one() / along_x)?;
    proof.equal("τ_90", tau_90, Exact::one() / along_y)?;
    proof.equal("ratio", actuation_gain_ratio(tau_0, v_0, tau_90, v_90), planted * drive.x / drive.y)
}

//= specs/equation-11.md#ratio-of-the-gains
//= type=test
//# The ratio MUST be the gain of X over the gain of Y where each control output balances the damping along its axis.
#[test]
fn identity_the_ratio_is_that_of_the_drive_of_any_resonator() {
    holds(the_ratio_is_that_of_the_drive_of_any_resonator);
}

#[test]
fn identity_the_ratio_is_that_of_the_drive_of_any_resonator_twin() {
    rejects(WRONG, the_ratio_is_that_of_the_drive_of_any_resonator);
}

/// A resonator that loses energy along both axes, whatever else it does.
fn any_resonator() -> (Resonator<Exact>, [Exact; 2]) {
    let (along_x, along_y) = (Exact::positive("1/τ_x"), Exact::positive("1/τ_y"));
    let resonator = Resonator {
        omega_rad_s: Exact::positive("ω"),
        angular_gain: Exact::real("k"),
        centrifugal_gain: Exact::zero(),
        damping_per_s: Exact::half() * (along_x + along_y),
        anisodamping: Anisotropy { cos2: along_x - along_y, sin2: Exact::real("skew damping") },
        anisoelasticity: Anisotropy { cos2: Exact::real("Δω cos"), sin2: Exact::real("Δω sin") },
    };
    (resonator, [along_x, along_y])
}

/// A factor on both outputs; and one on both gains of the drive that holds a resonator.
fn the_ratio_does_not_depend_on_common_factors(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let ([t0, v0, t90, v90], k) = (ring_downs(), Exact::nonzero("factor"));
    let ratio = actuation_gain_ratio(t0, v0, t90, v90);
    proof.equal("amplitude", actuation_gain_ratio(t0, k * v0, t90, planted * k * v90), ratio)?;
    let (resonator, _) = any_resonator();
    let (gain_x, gain_y, a) = (Exact::positive("G_Ax"), Exact::positive("G_Ay"), Exact::positive("a"));
    let held_by = |drive: ActuationGains<Exact>| {
        let (tau_0, v_0) = held_at(Exact::zero(), &resonator, &drive, a);
        let (tau_90, v_90) = held_at(Exact::quarter_turn(), &resonator, &drive, a);
        (actuation_gain_ratio(tau_0, v_0, tau_90, v_90), v_0)
    };
    let (before, v) = held_by(ActuationGains { x: gain_x, y: gain_y });
    let (after, w) = held_by(ActuationGains { x: k * gain_x, y: k * planted * gain_y });
    proof.equal("gain", after, before)?;
    proof.equal("output", w * k, v)?;
    // and it does not depend on the unit of time
    proof.equal("time", actuation_gain_ratio(k * t0, v0, planted * k * t90, v90), ratio)
}

//= specs/equation-11.md#independence-of-the-set-amplitude
//= type=test
//# A common factor on both control outputs MUST leave the ratio as it was.
//= specs/equation-11.md#independence-of-a-common-gain
//= type=test
//# A common factor on both actuation gains MUST leave the ratio as it was.
#[test]
fn identity_the_ratio_does_not_depend_on_common_factors() {
    holds(the_ratio_does_not_depend_on_common_factors);
}

#[test]
fn identity_the_ratio_does_not_depend_on_common_factors_twin() {
    rejects(WRONG, the_ratio_does_not_depend_on_common_factors);
}

fn exchanging_the_ring_downs_inverts_the_ratio(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let [t0, v0, t90, v90] = ring_downs();
    let (ratio, exchanged) = (actuation_gain_ratio(t0, v0, t90, v90), actuation_gain_ratio(t90, v90, t0, v0));
    proof.equal("product", ratio * exchanged, planted)
}

//= specs/equation-11.md#exchange-of-the-runs
//= type=test
//# Exchanging the two runs MUST invert the ratio.
#[test]
fn identity_exchanging_the_ring_downs_inverts_the_ratio() {
    holds(exchanging_the_ring_downs_inverts_the_ratio);
}

#[test]
fn identity_exchanging_the_ring_downs_inverts_the_ratio_twin() {
    rejects(WRONG, exchanging_the_ring_downs_inverts_the_ratio);
}

// Rounding: bounds for all inputs of a box.

/// Decay times and outputs at every scale; the sign of the ratio is that of the outputs' quotient.
fn ring_downs_at_every_scale() -> Vec<Inputs> {
    vec![vec![octave(); 4]]
}

/// The ratio of the gains, relative to itself.
struct Ratio;

impl Formula for Ratio {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![actuation_gain_ratio(x[0], x[1], x[2], x[3])]
    }

    fn scale<T: Real>(&self, x: &[T]) -> T {
        actuation_gain_ratio(x[0], x[1], x[2], x[3])
    }
}

for_each_precision! {
    //= specs/equation-11.md#ratio-of-the-gains
    //= type=test
    //# The ratio MUST be the gain of X over the gain of Y where each control output balances the damping along its axis.
    #[test]
    fn interval_the_ratio() {
        bounded::<T>(&Ratio, &ring_downs_at_every_scale(), &ACTUATION_RATIO);
    }

    #[test]
    fn interval_the_ratio_twin() {
        rejects_rounding::<T>(&Ratio, &ring_downs_at_every_scale(), &ACTUATION_RATIO);
    }
}
