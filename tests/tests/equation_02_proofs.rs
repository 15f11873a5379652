//! Equation 2, proved: for all reals on the shipping source, and with rounding for all inputs of a box.

use cvg_model::{Envelope, Orbit, Pendulum, Real};
use cvg_prover::{Exact, Formula, Proof, Refusal};
use cvg_tests::domain::any_vector;
use cvg_tests::for_each_precision;
use cvg_tests::proof::{TOO_TIGHT, WRONG, bounded, holds, rejects, rejects_rounding};
use cvg_tests::tolerances::PENDULUM;

/// Any envelope.
fn any(name: &str) -> Envelope<Exact> {
    let [x_c, x_s, y_c, y_s] = ["x_c", "x_s", "y_c", "y_s"].map(|part| Exact::real(&format!("{name}{part}")));
    Envelope::new(x_c, x_s, y_c, y_s)
}

/// All five variables of the one are `factor` times those of the other.
fn multiple(proof: &mut Proof, p: &Pendulum<Exact>, factor: Exact, of: &Pendulum<Exact>) -> Result<(), Refusal> {
    proof.equal("E", p.e, factor * of.e)?;
    proof.equal("Q", p.q, factor * of.q)?;
    proof.equal("R", p.r, factor * of.r)?;
    proof.equal("S", p.s, factor * of.s)?;
    proof.equal("L", p.l, factor * of.l)
}

fn the_variables_are_the_axes_and_the_orientation(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (a, q, theta, delta) = (Exact::real("a"), Exact::real("q"), Exact::angle("θ"), Exact::angle("δ"));
    let p = Orbit { a, q, theta, delta }.envelope().pendulum();
    let (sin_2theta, cos_2theta) = (Exact::two() * theta).sin_cos();
    let (sin_2delta, _) = (Exact::two() * delta).sin_cos();
    let difference = a * a - q * q;
    let expected = Pendulum {
        e: a * a + q * q,
        q: Exact::two() * a * q,
        r: difference * cos_2theta,
        s: difference * sin_2theta,
        l: -difference * sin_2delta,
    };
    multiple(proof, &p, planted, &expected)
}

//= specs/equation-02.md#axes-and-orientation
//= type=test
//# The variables of an orbit MUST be E = a² + q², Q = 2aq, R = (a² − q²) cos 2θ, S = (a² − q²) sin 2θ and L = −(a² − q²) sin 2δ.
#[test]
fn identity_the_variables_are_the_axes_and_the_orientation() {
    holds(the_variables_are_the_axes_and_the_orientation);
}

#[test]
fn identity_the_variables_are_the_axes_and_the_orientation_twin() {
    rejects(WRONG, the_variables_are_the_axes_and_the_orientation);
}

fn energy_squared_is_the_sum_of_the_other_squares(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let p = any("").pendulum();
    proof.equal("E²", p.e.squared(), p.q.squared() + (planted * p.r).squared() + p.s.squared())
}

//= specs/equation-02.md#energy-identity
//= type=test
//# The square of E MUST equal the sum of the squares of Q, R and S.
#[test]
fn identity_energy_squared_is_the_sum_of_the_other_squares() {
    holds(energy_squared_is_the_sum_of_the_other_squares);
}

#[test]
fn identity_energy_squared_is_the_sum_of_the_other_squares_twin() {
    rejects(&[(101, 100), (99, 100)], energy_squared_is_the_sum_of_the_other_squares);
}

fn turning_the_pattern_turns_r_and_s_twice(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, turn) = (any(""), Exact::angle("turn"));
    let (sin, cos) = turn.sin_cos();
    let (before, after) = (e.pendulum(), e.turned(sin, cos).pendulum());
    let (s2, c2) = (Exact::two() * turn).sin_cos();
    let expected = Pendulum { r: c2 * before.r - s2 * before.s, s: s2 * before.r + c2 * before.s, ..before };
    multiple(proof, &after, planted, &expected)
}

//= specs/equation-02.md#rotation-of-the-pattern
//= type=test
//# Turning the pattern by an angle MUST turn the point (R, S) by twice that angle and leave E and Q as they were.
#[test]
fn identity_turning_the_pattern_turns_r_and_s_twice() {
    holds(turning_the_pattern_turns_r_and_s_twice);
}

#[test]
fn identity_turning_the_pattern_turns_r_and_s_twice_twin() {
    rejects(WRONG, turning_the_pattern_turns_r_and_s_twice);
}

fn only_l_sees_the_phase_of_the_reference(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, phase) = (any(""), Exact::angle("phase"));
    let (sin, cos) = phase.sin_cos();
    let (before, after) = (e.pendulum(), (e * cos + e.quarter_ahead() * sin).pendulum());
    multiple(proof, &Pendulum { l: Exact::zero(), ..after }, planted, &Pendulum { l: Exact::zero(), ..before })
}

//= specs/equation-02.md#phase-of-the-reference
//= type=test
//# Shifting the phase of the reference MUST leave E, Q, R and S as they were.
#[test]
fn identity_only_l_sees_the_phase_of_the_reference() {
    holds(only_l_sees_the_phase_of_the_reference);
}

#[test]
fn identity_only_l_sees_the_phase_of_the_reference_twin() {
    rejects(WRONG, only_l_sees_the_phase_of_the_reference);
}

fn half_a_turn_is_the_same_state(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let e = any("");
    multiple(proof, &(-e).pendulum(), planted, &e.pendulum())
}

//= specs/equation-02.md#half-a-turn
//= type=test
//# The variables of an orbit and of the same orbit turned by 180° MUST be identical bit for bit.
#[test]
fn identity_half_a_turn_is_the_same_state() {
    holds(half_a_turn_is_the_same_state);
}

#[test]
fn identity_half_a_turn_is_the_same_state_twin() {
    rejects(WRONG, half_a_turn_is_the_same_state);
}

/// y follows x by a quarter of a period where y(φ) = b x(φ − 90°) with b > 0: y_c = −b x_s, y_s = b x_c.
fn the_quadrature_has_the_sign_of_the_circulation(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (x_c, x_s, share) = (Exact::positive("x_c"), Exact::real("x_s"), planted * Exact::positive("b"));
    let behind = Envelope::new(x_c, x_s, -share * x_s, share * x_c);
    let (share, two) = (Exact::positive("b again"), Exact::two());
    let ahead = Envelope::new(x_c, x_s, planted * share * x_s, -planted * share * x_c);
    let q = behind.pendulum().q;
    let b = behind.y_s / x_c;
    proof.positive_by_factors("b", b)?;
    proof.positive("Q of the one that follows", q, Exact::one(), two * b * x_c * x_c, &[(two * b, x_s)])?;
    let squares = [(two * share, x_s)];
    proof.positive("Q of the one that leads", -ahead.pendulum().q, Exact::one(), two * share * x_c * x_c, &squares)
}

//= specs/equation-02.md#sense-of-circulation
//= type=test
//# The quadrature MUST be positive where Y follows X by a quarter of a period.
#[test]
fn identity_the_quadrature_has_the_sign_of_the_circulation() {
    holds(the_quadrature_has_the_sign_of_the_circulation);
}

#[test]
fn identity_the_quadrature_has_the_sign_of_the_circulation_twin() {
    rejects(&[(-1, 1)], the_quadrature_has_the_sign_of_the_circulation);
}

fn energy_is_a_sum_of_squares(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, one) = (any(""), Exact::one());
    let squares = [e.x_c, e.x_s, e.y_c, e.y_s].map(|part| (one, part));
    proof.not_negative("E", planted * e.pendulum().e, one, &squares)
}

//= specs/equation-02.md#energy-is-not-negative
//= type=test
//# The energy MUST be zero or more, or NaN where a component of the envelope is NaN.
#[test]
fn identity_energy_is_a_sum_of_squares() {
    holds(energy_is_a_sum_of_squares);
}

#[test]
fn identity_energy_is_a_sum_of_squares_twin() {
    rejects(&[(-1, 1)], energy_is_a_sum_of_squares);
}

/// E ± R, E ± S, E ± Q and E ± L are sums of two squares each.
fn energy_bounds_every_other_variable(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, one, two) = (any(""), Exact::one(), Exact::two());
    let p = e.pendulum();
    let bound = planted * p.e;
    let Envelope { x_c, x_s, y_c, y_s } = e;
    proof.not_negative("E − R", bound - p.r, one, &[(two, y_c), (two, y_s)])?;
    proof.not_negative("E + R", bound + p.r, one, &[(two, x_c), (two, x_s)])?;
    proof.not_negative("E − S", bound - p.s, one, &[(one, x_c - y_c), (one, x_s - y_s)])?;
    proof.not_negative("E + S", bound + p.s, one, &[(one, x_c + y_c), (one, x_s + y_s)])?;
    proof.not_negative("E − Q", bound - p.q, one, &[(one, x_c - y_s), (one, x_s + y_c)])?;
    proof.not_negative("E + Q", bound + p.q, one, &[(one, x_c + y_s), (one, x_s - y_c)])?;
    proof.not_negative("E − L", bound - p.l, one, &[(one, x_c - x_s), (one, y_c - y_s)])?;
    proof.not_negative("E + L", bound + p.l, one, &[(one, x_c + x_s), (one, y_c + y_s)])
}

//= specs/equation-02.md#energy-bounds-the-orientation
//= type=test
//# The magnitude of R MUST NOT exceed E.
#[test]
fn identity_energy_bounds_every_other_variable() {
    holds(energy_bounds_every_other_variable);
}

#[test]
fn identity_energy_bounds_every_other_variable_twin() {
    rejects(TOO_TIGHT, energy_bounds_every_other_variable);
}

/// Along e + t ė at t = 0.
fn the_rates_are_the_derivatives(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (e, rate, t) = (any(""), any("d"), Exact::real("t"));
    let p = (e + rate * t).pendulum();
    let (rates, later) = (e.pendulum_rate(&rate), (e + rate).pendulum_rate(&rate));
    let (now, then) = (e.pendulum(), (e + rate).pendulum());
    // a quadratic form moves by its mean rate
    let mean = |a: Exact, b: Exact| Exact::half() * (a + b);
    let moved =
        Pendulum { e: then.e - now.e, q: then.q - now.q, r: then.r - now.r, s: then.s - now.s, l: then.l - now.l };
    let means = Pendulum {
        e: mean(rates.e, later.e),
        q: mean(rates.q, later.q),
        r: mean(rates.r, later.r),
        s: mean(rates.s, later.s),
        l: mean(rates.l, later.l),
    };
    multiple(proof, &moved, planted, &means)?;
    let curvature = |v: Exact| v.derivative(t).derivative(t);
    proof.equal("E", p.e.derivative(t) - t * curvature(p.e), planted * rates.e)?;
    proof.equal("Q", p.q.derivative(t) - t * curvature(p.q), planted * rates.q)
}

//= specs/equation-02.md#rates
//= type=test
//# The rates of the variables MUST be the derivatives of the variables along the rate of the envelope.
#[test]
fn identity_the_rates_are_the_derivatives() {
    holds(the_rates_are_the_derivatives);
}

#[test]
fn identity_the_rates_are_the_derivatives_twin() {
    rejects(WRONG, the_rates_are_the_derivatives);
}

// Rounding: bounds for all inputs of a box.

/// The five variables relative to E, and to E again where they bound their own.
struct PendulumOf;

impl Formula for PendulumOf {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let p = Envelope::new(x[0], x[1], x[2], x[3]).pendulum();
        vec![p.e, p.q, p.r, p.s, p.l]
    }

    fn scale<T: Real>(&self, x: &[T]) -> T {
        Envelope::new(x[0], x[1], x[2], x[3]).pendulum().e
    }
}

for_each_precision! {
    //= specs/equation-02.md#axes-and-orientation
    //= type=test
    //# The variables of an orbit MUST be E = a² + q², Q = 2aq, R = (a² − q²) cos 2θ, S = (a² − q²) sin 2θ and L = −(a² − q²) sin 2δ.
    #[test]
    fn interval_the_pendulum_variables() {
        bounded::<T>(&PendulumOf, &any_vector(4), &PENDULUM);
    }

    #[test]
    fn interval_the_pendulum_variables_twin() {
        rejects_rounding::<T>(&PendulumOf, &any_vector(4), &PENDULUM);
    }
}
