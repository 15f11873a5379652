//! The rows of the whole step that rest on a root and on sums over a window: the tracker's unit vector, and what a window's samples
//! may add up to.

use cvg_estimator::precession::twice_the_angle;
use cvg_model::{AxisForces, Pendulum, Real};
use cvg_prover::{Exact, Formula, Proof, Refusal};
use cvg_tests::domain::any_vector;
use cvg_tests::for_each_precision;
use cvg_tests::proof::{WRONG, bounded, holds, rejects, rejects_rounding};
use cvg_tests::tolerances::UNIT_VECTOR;

/// Only R and S.
fn along<T: Real>(r: T, s: T) -> Pendulum<T> {
    Pendulum { e: T::zero(), q: T::zero(), r, s, l: T::zero() }
}

fn the_trackers_vector_has_length_one(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let p = along(Exact::nonzero("R"), Exact::real("S"));
    let (cos_2, sin_2) = twice_the_angle(&p, p.r.norm(p.s));
    proof.equal("cos² 2θ + sin² 2θ", cos_2 * cos_2 + sin_2 * sin_2, planted)
}

//= specs/dsp.md#whole-step
//= type=test
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
/// For all reals but R = 0, where the vector is (0, ±1).
#[test]
fn identity_the_trackers_vector_has_length_one() {
    holds(the_trackers_vector_has_length_one);
}

#[test]
fn identity_the_trackers_vector_has_length_one_twin() {
    rejects(WRONG, the_trackers_vector_has_length_one);
}

/// A phase of the drives that is put ahead by (c, s) makes them √(c² + s²) as large, channel by channel; of the delay, whose phase
/// is cos − sin·d and sin + cos·d, that is √(1 + d²).
fn a_phase_put_ahead_keeps_the_size_of_the_forces(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let [x_c, x_s, y_c, y_s] = ["f_xc", "f_xs", "f_yc", "f_ys"].map(Exact::real);
    let (sin, cos) = Exact::angle("ω₀ t").sin_cos();
    let d = Exact::real("d");
    let f = AxisForces { x_c, x_s, y_c, y_s }.ahead(cos - sin * d, sin + cos * d);
    let larger = planted * (Exact::one() + d * d);
    proof.equal("X", f.x_c * f.x_c + f.x_s * f.x_s, larger * (x_c * x_c + x_s * x_s))?;
    proof.equal("Y", f.y_c * f.y_c + f.y_s * f.y_s, larger * (y_c * y_c + y_s * y_s))
}

//= specs/dsp.md#whole-step
//= type=test
//# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
#[test]
fn identity_a_phase_put_ahead_keeps_the_size_of_the_forces() {
    holds(a_phase_put_ahead_keeps_the_size_of_the_forces);
}

#[test]
fn identity_a_phase_put_ahead_keeps_the_size_of_the_forces_twin() {
    rejects(WRONG, a_phase_put_ahead_keeps_the_size_of_the_forces);
}

fn what_was_put_ahead_is_taken_back(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let [x_c, x_s, y_c, y_s] = ["f_xc", "f_xs", "f_yc", "f_ys"].map(Exact::real);
    let (cos, sin) = (Exact::nonzero("c"), Exact::real("s"));
    let f = AxisForces { x_c, x_s, y_c, y_s }.ahead(cos, sin).behind(cos, sin);
    proof.equal("X in phase", f.x_c, planted * x_c)?;
    proof.equal("X in quadrature", f.x_s, planted * x_s)?;
    proof.equal("Y in phase", f.y_c, planted * y_c)?;
    proof.equal("Y in quadrature", f.y_s, planted * y_s)
}

//= specs/dsp.md#commands-behind-the-drives
//= type=test
//# The commands by which a readout is compensated MUST be those that the drives were made of whatever the oscillator is corrected by.
/// For all reals but c = 0, a quarter of a turn, which the test below is of.
#[test]
fn identity_what_was_put_ahead_is_taken_back() {
    holds(what_was_put_ahead_is_taken_back);
}

#[test]
fn identity_what_was_put_ahead_is_taken_back_twin() {
    rejects(WRONG, what_was_put_ahead_is_taken_back);
}

#[test]
fn what_was_put_ahead_by_a_quarter_of_a_turn_is_taken_back() {
    let f = AxisForces { x_c: 0.5, x_s: -2.0, y_c: 3.0, y_s: 0.25 };
    for sin in [1.0, -1.0, 0.5, -4.0] {
        assert_eq!(f.ahead(0.0, sin).behind(0.0, sin), f);
    }
}

/// The unit vector that the tracker keeps.
struct TrackersVector;

impl Formula for TrackersVector {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let p = along(x[0], x[1]);
        let (cos_2, sin_2) = twice_the_angle(&p, p.r.norm(p.s));
        vec![cos_2, sin_2]
    }
}

for_each_precision! {
    //= specs/dsp.md#whole-step
    //= type=test
    //# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
    /// Each part of it is rounded by so little that its length is within a millionth of one.
    #[test]
    fn interval_the_trackers_vector() {
        bounded::<T>(&TrackersVector, &any_vector(2), &UNIT_VECTOR);
    }

    #[test]
    fn interval_the_trackers_vector_twin() {
        rejects_rounding::<T>(&TrackersVector, &any_vector(2), &UNIT_VECTOR);
    }
}

/// The induction over a window: what `proof_a_sample_adds_no_more_than_its_own` claims of one sample, once a sample, is exactly the
/// product, in the machine's own numbers.
#[test]
fn what_the_samples_of_a_window_may_add_up_to_is_a_product() {
    let (mut single, mut double) = (0.0_f32, 0.0_f64);
    for samples in 1..=10_000_u16 {
        (single, double) = (single + 8.0, double + 8.0);
        assert_eq!(f64::from(single), f64::from(samples) * 8.0);
        assert_eq!(double, f64::from(samples) * 8.0);
    }
}
