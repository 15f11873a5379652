//! Equation 4, proved: for all reals on the shipping source, and with rounding for all inputs of a box.
//!
//! Angles have a period of 180°, so what is compared is twice the angle. In floating point an angle at ±90° may come out
//! at either end: the bound of the angle all around is one up to half a turn, and says so by its period. Where R is
//! positive it is a bound between the numbers themselves.

use cvg_estimator::precession::{half_the_angle, twice_the_angle};
use cvg_model::{Envelope, Float, Orbit, Pendulum, Real};
use cvg_prover::{Exact, Formula, Interval, Proof, Refusal};
use cvg_tests::domain::{any_vector, octave, unit};
use cvg_tests::for_each_precision;
use cvg_tests::proof::{Inputs, WRONG, bounded, holds, rejects, rejects_rounding};
use cvg_tests::tolerances::ANGLE;

/// Any envelope but one of a circle: R² + S² > 0.
fn any(proof: &mut Proof) -> Result<Envelope<Exact>, Refusal> {
    let [x_c, x_s, y_c, y_s] = ["x_c", "x_s", "y_c", "y_s"].map(Exact::real);
    let e = Envelope::new(x_c, x_s, y_c, y_s);
    proof.assume_positive(eccentricity(&e.pendulum()))?;
    Ok(e)
}

/// R² + S²
fn eccentricity(p: &Pendulum<Exact>) -> Exact {
    p.r.squared() + p.s.squared()
}

/// Twice the angle of an envelope.
fn twice(e: &Envelope<Exact>) -> Exact {
    Exact::two() * e.pendulum().angle()
}

fn the_angle_is_the_orientation_of_the_orbit(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (minor, more, theta) = (Exact::real("q"), Exact::positive("a² − q²"), Exact::angle("θ"));
    // a from its square, which is above that of q
    let square = minor * minor + more;
    proof.positive("a²", square, Exact::one(), more, &[(Exact::one(), minor)])?;
    let orbit = Orbit { a: square.sqrt(), q: minor, theta, delta: Exact::angle("δ") };
    let turned = Exact::two() * planted * theta;
    proof.same_angle("2 θ_d = 2θ", twice(&orbit.envelope()), turned, Exact::one(), more, &[])
}

//= specs/equation-04.md#orientation-of-the-orbit
//= type=test
//# The angle of an orbit MUST be its orientation up to a multiple of 180°.
#[test]
fn identity_the_angle_is_the_orientation_of_the_orbit() {
    holds(the_angle_is_the_orientation_of_the_orbit);
}

#[test]
fn identity_the_angle_is_the_orientation_of_the_orbit_twin() {
    rejects(&[(-1, 1)], the_angle_is_the_orientation_of_the_orbit);
}

/// For R > 0 the direction is that of (1, S/R): the angle of a tangent, without a choice of quadrant.
fn it_is_the_papers_arctangent(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (r, s, zero, one) = (Exact::positive("R"), Exact::real("S"), Exact::zero(), Exact::one());
    let angle = Pendulum { e: zero, q: zero, r, s, l: zero }.angle();
    let arctangent = (planted * s / r).atan2(one);
    proof.same_angle("2 θ_d", Exact::two() * angle, arctangent, one, r * r * r, &[(r, s)])
}

//= specs/equation-04.md#arctangent-of-the-paper
//= type=test
//# The angle MUST equal half the arctangent of S over R where R is positive.
#[test]
fn identity_it_is_the_papers_arctangent() {
    holds(it_is_the_papers_arctangent);
}

#[test]
fn identity_it_is_the_papers_arctangent_twin() {
    rejects(WRONG, it_is_the_papers_arctangent);
}

fn turning_the_pattern_turns_the_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, turn) = (any(proof)?, Exact::angle("turn"));
    let (sin, cos) = turn.sin_cos();
    let length = eccentricity(&e.pendulum());
    let expected = twice(&e) + Exact::two() * planted * turn;
    proof.same_angle("2 θ_d", twice(&e.turned(sin, cos)), expected, Exact::one(), length, &[])
}

//= specs/equation-04.md#rotation-turns-the-angle
//= type=test
//# Turning the pattern by an angle MUST change the angle by as much, up to a multiple of 180°.
#[test]
fn identity_turning_the_pattern_turns_the_angle() {
    holds(turning_the_pattern_turns_the_angle);
}

#[test]
fn identity_turning_the_pattern_turns_the_angle_twin() {
    rejects(&[(-1, 1)], turning_the_pattern_turns_the_angle);
}

/// For every factor, of which powers of two are some; the planted error mirrors the envelope.
fn the_angle_does_not_depend_on_the_amplitude(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, factor) = (any(proof)?, Exact::nonzero("factor"));
    let scaled = Envelope::new(factor * e.x_c, factor * e.x_s, factor * planted * e.y_c, factor * planted * e.y_s);
    let length = proof.product(factor * factor, eccentricity(&e.pendulum()));
    proof.same_angle("2 θ_d", twice(&scaled), twice(&e), Exact::one(), length, &[])
}

//= specs/equation-04.md#independence-of-amplitude
//= type=test
//# Scaling the envelope by a power of two MUST leave the angle as it was, bit for bit.
#[test]
fn identity_the_angle_does_not_depend_on_the_amplitude() {
    holds(the_angle_does_not_depend_on_the_amplitude);
}

#[test]
fn identity_the_angle_does_not_depend_on_the_amplitude_twin() {
    rejects(&[(-1, 1)], the_angle_does_not_depend_on_the_amplitude);
}

/// The planted error shifts the phase of Y against that of X.
fn the_angle_does_not_depend_on_the_phase(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, phase) = (any(proof)?, Exact::angle("phase"));
    let (sin, cos) = phase.sin_cos();
    let shifted = e * cos + e.quarter_ahead() * sin;
    let shifted = Envelope { y_c: planted * shifted.y_c, ..shifted };
    let length = eccentricity(&e.pendulum());
    proof.same_angle("2 θ_d", twice(&shifted), twice(&e), Exact::one(), length, &[])
}

//= specs/equation-04.md#independence-of-phase
//= type=test
//# Shifting the phase of the reference MUST leave the angle as it was.
#[test]
fn identity_the_angle_does_not_depend_on_the_phase() {
    holds(the_angle_does_not_depend_on_the_phase);
}

#[test]
fn identity_the_angle_does_not_depend_on_the_phase_twin() {
    rejects(&[(-1, 1)], the_angle_does_not_depend_on_the_phase);
}

/// The planted error turns X only.
fn half_a_turn_is_the_same_angle(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let e = any(proof)?;
    let opposite = Envelope::new(-e.x_c, -e.x_s, -planted * e.y_c, -planted * e.y_s);
    let length = eccentricity(&e.pendulum());
    proof.same_angle("2 θ_d", twice(&opposite), twice(&e), Exact::one(), length, &[])
}

//= specs/equation-04.md#half-a-turn-is-the-same-angle
//= type=test
//# The angle of an orbit and of the same orbit turned by 180° MUST be identical bit for bit.
#[test]
fn identity_half_a_turn_is_the_same_angle() {
    holds(half_a_turn_is_the_same_angle);
}

#[test]
fn identity_half_a_turn_is_the_same_angle_twin() {
    rejects(&[(-1, 1)], half_a_turn_is_the_same_angle);
}

/// Both arguments of the arctangent are zero for every circle, in either sense, and for no other orbit. That the
/// arctangent of the origin is 0 is tested.
fn a_circle_has_no_direction(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (a, one) = (Exact::positive("a"), Exact::one());
    for sense in [one, -one] {
        let circle = Orbit { a, q: planted * sense * a, theta: Exact::angle("θ"), delta: Exact::angle("δ") };
        let p = circle.envelope().pendulum();
        proof.equal("R", p.r, Exact::zero())?;
        proof.equal("S", p.s, Exact::zero())?;
    }
    Ok(())
}

//= specs/equation-04.md#circle
//= type=test
//# The angle of a circular orbit MUST be zero.
#[test]
fn identity_a_circle_has_no_direction() {
    holds(a_circle_has_no_direction);
}

#[test]
fn identity_a_circle_has_no_direction_twin() {
    rejects(&[(2, 1)], a_circle_has_no_direction);
}

// Rounding: bounds for all inputs of a box.

/// (R, S) at every scale, all around.
fn directions() -> Vec<Inputs> {
    let mirrored = |v: Inputs| v.into_iter().map(|i| -i).collect();
    any_vector(2).into_iter().flat_map(|v: Inputs| [v.clone(), mirrored(v)]).collect()
}

/// θ of R and S themselves.
struct AngleOf;

impl Formula for AngleOf {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let zero = T::zero();
        vec![Pendulum { e: zero, q: zero, r: x[0], s: x[1], l: zero }.angle()]
    }

    fn period_turns(&self) -> f64 {
        0.5
    }
}

/// (R, S) with R > 0, at every scale: one is the largest, and R no less than 2⁻²⁰ of S.
fn directions_ahead() -> Vec<Inputs> {
    let small = Interval::new(2.0_f64.powi(-20), 1.0);
    let sides = [octave(), -octave()].map(|s| vec![small, s]);
    [vec![octave(), unit()]].into_iter().chain(sides).collect()
}

/// θ of R > 0 and S, as a number.
struct AngleAhead;

impl Formula for AngleAhead {
    fn outputs<T: Float>(&self, x: &[T]) -> Vec<T> {
        AngleOf.outputs(x)
    }
}

/// θ of an envelope in phase with the reference: Equation 4 of Equation 2.
struct AngleOfEnvelope;

impl Formula for AngleOfEnvelope {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![Envelope::new(x[0], T::zero(), x[1], T::zero()).pendulum().angle()]
    }

    fn period_turns(&self) -> f64 {
        0.5
    }
}

/// θ of R and S as the instrument tells it: by the unit vector that it keeps.
struct AngleThatIsTold;

impl Formula for AngleThatIsTold {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let zero = T::zero();
        let p = Pendulum { e: zero, q: zero, r: x[0], s: x[1], l: zero };
        let (cos_2, sin_2) = twice_the_angle(&p, p.r.norm(p.s));
        vec![half_the_angle(cos_2, sin_2)]
    }

    fn period_turns(&self) -> f64 {
        0.5
    }
}

for_each_precision! {
    //= specs/equation-04.md#arctangent-of-the-paper
    //= type=test
    //# The angle MUST equal half the arctangent of S over R where R is positive.
    #[test]
    fn interval_the_angle_where_r_is_positive() {
        bounded::<T>(&AngleAhead, &directions_ahead(), &ANGLE);
    }

    #[test]
    fn interval_the_angle_where_r_is_positive_twin() {
        rejects_rounding::<T>(&AngleAhead, &directions_ahead(), &ANGLE);
    }

    //= specs/equation-04.md#orientation-of-the-orbit
    //= type=test
    //# The angle of an orbit MUST be its orientation up to a multiple of 180°.
    /// All around, up to half a turn.
    #[test]
    fn interval_the_angle() {
        bounded::<T>(&AngleOf, &directions(), &ANGLE);
    }

    #[test]
    fn interval_the_angle_twin() {
        rejects_rounding::<T>(&AngleOf, &directions(), &ANGLE);
    }

    //= specs/equation-04.md#orientation-of-the-orbit
    //= type=test
    //# The angle of an orbit MUST be its orientation up to a multiple of 180°.
    #[test]
    fn interval_the_angle_of_an_envelope() {
        bounded::<T>(&AngleOfEnvelope, &any_vector(2), &ANGLE);
    }

    #[test]
    fn interval_the_angle_of_an_envelope_twin() {
        rejects_rounding::<T>(&AngleOfEnvelope, &any_vector(2), &ANGLE);
    }

    //= specs/equation-04.md#orientation-of-the-orbit
    //= type=test
    //# The angle of an orbit MUST be its orientation up to a multiple of 180°.
    /// As the instrument tells it, of any R and S: what the unit vector rounds is in it. What R and S themselves are off by is bounded
    /// with Equation 2.
    #[test]
    fn interval_the_angle_that_is_told() {
        bounded::<T>(&AngleThatIsTold, &directions(), &ANGLE);
    }

    #[test]
    fn interval_the_angle_that_is_told_twin() {
        rejects_rounding::<T>(&AngleThatIsTold, &directions(), &ANGLE);
    }
}
