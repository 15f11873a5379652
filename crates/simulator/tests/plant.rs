//! The exact propagation, against an independent integrator and against the averaged equations.

use approx::assert_abs_diff_eq;
use cvg_model::effects::{EffectId, Moment};
use cvg_model::resonator::averaged::Averages;
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{AxisForces, Envelope, Orbit};
use cvg_simulator::carrier::CarrierPlant;
use cvg_simulator::plant::{Plant, reference_ahead};
use cvg_simulator::scenario::IsotropicSpring;
use cvg_simulator::stages::{Setting, Spring, Stages};
use ode_solvers::{Dop853, System, Vector4};
use proptest::prelude::*;

const PERIOD_S: f64 = 5e-4;
const RATE_RAD_S: f64 = 8.7;
const AHEAD_RAD_S: f64 = 3.0;
const DRIVE_PER_S_V: f64 = 1.3;

fn resonator() -> Resonator<f64> {
    Resonator {
        omega_rad_s: core::f64::consts::TAU * 15_200.0,
        angular_gain: 0.78,
        centrifugal_gain: 0.0,
        damping_per_s: 1.0 / 22.0,
        anisodamping: Anisotropy::none(),
        anisoelasticity: Anisotropy::none(),
    }
}

fn linear_effects() -> Vec<Setting> {
    vec![
        (EffectId::Anisodamping, [0.3, -0.2, 0.0, 0.0]),
        (EffectId::Anisoelasticity, [2.0, 1.5, 0.0, 0.0]),
        (EffectId::ActuationGainMismatch, [1.05, 0.0, 0.0, 0.0]),
        (EffectId::ActuationSkew, [0.1, 0.0, 0.0, 0.0]),
        (EffectId::ActuationPhase, [0.05, 0.0, 0.0, 0.0]),
    ]
}

fn plant(effects: &[Setting]) -> Plant {
    Plant::new(&resonator(), &Stages::new(effects), RATE_RAD_S, AHEAD_RAD_S, DRIVE_PER_S_V, PERIOD_S)
}

/// The envelope's differential equation with every effect, forces held.
struct Equation {
    effects: Vec<Setting>,
    volts: AxisForces<f64>,
    rate_rad_s: f64,
}

impl System<f64, Vector4<f64>> for Equation {
    fn system(&self, _: f64, y: &Vector4<f64>, dy: &mut Vector4<f64>) {
        let z = Envelope::new(y[0], y[1], y[2], y[3]);
        let stages = Stages::new(&self.effects);
        let free = resonator().envelope_rate(&z, self.rate_rad_s, AHEAD_RAD_S);
        let forced = stages.actuate(self.volts).envelope_rate(1.0 / DRIVE_PER_S_V);
        let mechanics =
            self.effects.iter().fold(free + forced, |sum, (id, v)| sum + id.mechanics(v, &z, &Moment::origin()));
        *dy = Vector4::new(mechanics.x_c, mechanics.x_s, mechanics.y_c, mechanics.y_s);
    }
}

fn integrated(equation: Equation, z: &Envelope<f64>, duration_s: f64) -> Envelope<f64> {
    let start = Vector4::new(z.x_c, z.x_s, z.y_c, z.y_s);
    let mut solver = Dop853::new(equation, 0.0, duration_s, duration_s, start, 1e-13, 1e-14);
    solver.integrate().expect("integrates");
    let end = solver.y_out().last().expect("an end");
    Envelope::new(end[0], end[1], end[2], end[3])
}

fn distance(a: &Envelope<f64>, b: &Envelope<f64>) -> f64 {
    (*a - *b).pendulum().e.sqrt()
}

/// Compares 40 steps with forces that change at each.
fn against_integrator(effects: &[Setting], deviation_rad_s: f64) -> f64 {
    let plant = plant(effects);
    let mut exact = Orbit { a: 1.0, q: 0.05, theta: 0.4, delta: 0.1 }.envelope();
    let mut reference = exact;
    for k in 0..40 {
        let s = f64::from(k);
        let volts = AxisForces { x_c: 0.3 * s.sin(), x_s: -0.2, y_c: 0.1 * s.cos(), y_s: 0.4 * (2.0 * s).sin() };
        exact = plant.step(&exact, &volts, deviation_rad_s, &Moment::origin());
        let equation = Equation { effects: effects.to_vec(), volts, rate_rad_s: RATE_RAD_S + deviation_rad_s };
        reference = integrated(equation, &reference, PERIOD_S);
    }
    distance(&exact, &reference)
}

#[test]
fn a_step_with_held_forces_is_exact() {
    assert!(against_integrator(&linear_effects(), 0.0) < 1e-12);
}

#[test]
fn a_rate_deviation_is_split_off_without_visible_error() {
    assert!(against_integrator(&linear_effects(), 0.05) < 1e-9);
}

#[test]
fn nonlinear_mechanics_are_split_off_with_an_error_far_below_the_effect() {
    // splitting costs (4kΩT)²/24 ≈ 1e-5 of an effect that is 4e-4 after 40 steps
    let mut effects = linear_effects();
    effects.push((EffectId::SpringCubic, [0.02, 0.01, 0.0, 0.0]));
    assert!(against_integrator(&effects, 0.0) < 1e-8);
}

#[test]
fn effects_are_sorted_by_what_they_do() {
    let mut effects = linear_effects();
    effects.push((EffectId::SpringCubic, [0.02, 0.0, 0.0, 0.0]));
    effects.push((EffectId::ScaleDrift, [1e-4, 0.0, 0.0, 0.0]));
    effects.push((EffectId::TableHarmonic, [8.0, 1e-3, 0.0, 0.0]));
    let stages = Stages::new(&effects);
    let ids = |list: &[Setting]| list.iter().map(|(id, _)| *id).collect::<Vec<_>>();
    assert_eq!(ids(&stages.linear), [EffectId::Anisodamping, EffectId::Anisoelasticity]);
    assert_eq!(ids(&stages.nonlinear), [EffectId::SpringCubic]);
    assert_eq!(ids(&stages.table), [EffectId::TableHarmonic]);
    assert_eq!(ids(&stages.input), [EffectId::ScaleDrift]);
    assert_eq!(
        ids(&stages.actuation),
        [EffectId::ActuationGainMismatch, EffectId::ActuationSkew, EffectId::ActuationPhase]
    );
}

#[test]
fn without_forces_the_envelope_follows_the_averaged_equations() {
    let (damping, elasticity) = (Anisotropy { cos2: 0.05, sin2: -0.03 }, Anisotropy { cos2: 0.2, sin2: 0.1 });
    let resonator = Resonator { anisodamping: damping, anisoelasticity: elasticity, ..resonator() };
    let plant = Plant::new(&resonator, &Stages::default(), 0.4, 0.0, 1.0, PERIOD_S);
    let mut z = Orbit { a: 1.0, q: 0.02, theta: 0.3, delta: 0.0 }.envelope();
    let p = z.pendulum();
    let mut averages = Averages { e: p.e, q: p.q, theta: p.angle() };
    let add = |s: &Averages<f64>, d: &Averages<f64>, h: f64| Averages {
        e: s.e + h * d.e,
        q: s.q + h * d.q,
        theta: s.theta + h * d.theta,
    };
    for _ in 0..4000 {
        z = plant.step(&z, &AxisForces::default(), 0.0, &Moment::origin());
        // Runge–Kutta of fourth order
        let rate = |s: &Averages<f64>| resonator.averaged_rate(s, 0.4);
        let k1 = rate(&averages);
        let k2 = rate(&add(&averages, &k1, 0.5 * PERIOD_S));
        let k3 = rate(&add(&averages, &k2, 0.5 * PERIOD_S));
        let k4 = rate(&add(&averages, &k3, PERIOD_S));
        for (k, weight) in [(&k1, 1.0), (&k2, 2.0), (&k3, 2.0), (&k4, 1.0)] {
            averages = add(&averages, k, weight * PERIOD_S / 6.0);
        }
    }
    // the averaged equations hold whatever the phase: the split moves it too
    let p = z.pendulum();
    assert_abs_diff_eq!(p.e, averages.e, epsilon = 1e-9);
    assert_abs_diff_eq!(p.q, averages.q, epsilon = 1e-9);
    assert_abs_diff_eq!(p.angle(), averages.theta, epsilon = 1e-9);
}

#[test]
fn free_decay_and_precession_are_exact() {
    let plant = Plant::new(&resonator(), &Stages::default(), 0.4, 0.0, 1.0, PERIOD_S);
    let mut z = Orbit { a: 1.0, q: 0.0, theta: 0.3, delta: 0.0 }.envelope();
    for _ in 0..20_000 {
        z = plant.step(&z, &AxisForces::default(), 0.0, &Moment::origin());
    }
    let expected = Orbit { a: (-10.0_f64 / 22.0).exp(), q: 0.0, theta: 0.3 - 0.78 * 0.4 * 10.0, delta: 0.0 };
    assert!(distance(&z, &expected.envelope()) < 1e-11);
}

#[test]
fn every_actuation_effect_that_limits_nothing_is_linear_as_the_propagation_takes_it() {
    for id in EffectId::ALL.iter().filter(|id| !id.limits_drives()) {
        let values = [1.1, 0.05, 0.02, 0.0];
        let f =
            |x: f64| id.actuate(&values, AxisForces { x_c: x, x_s: -2.0 * x, y_c: 0.3 * x, y_s: x }, &Moment::origin());
        assert_abs_diff_eq!(f(1.0).y_s * 3.0, f(3.0).y_s, epsilon = 1e-12);
        assert_abs_diff_eq!(f(1.0).x_c * 3.0, f(3.0).x_c, epsilon = 1e-12);
    }
}

#[test]
fn what_limits_the_drives_stands_before_what_is_in_proportion() {
    let stages = Stages::new(&[
        (EffectId::ActuationGainMismatch, [4.0, 0.0, 0.0, 0.0]),
        (EffectId::DriveSaturation, [0.5, 0.0, 0.0, 0.0]),
    ]);
    let of = |list: &[Setting]| list.iter().map(|(id, _)| *id).collect::<Vec<_>>();
    assert_eq!(of(&stages.limiting), [EffectId::DriveSaturation]);
    assert_eq!(of(&stages.actuation), [EffectId::ActuationGainMismatch]);
    // 3 V of both are clipped at 2 V and then doubled and halved
    let f = stages.actuate(stages.limited(AxisForces { x_c: 3.0, x_s: 0.0, y_c: 0.0, y_s: 3.0 }, &Moment::origin()));
    let n = 2.0 / core::f64::consts::PI * ((2.0_f64 / 3.0).asin() + 2.0 / 3.0 * (1.0 - 4.0_f64 / 9.0).sqrt());
    assert_abs_diff_eq!(f.x_c, 2.0 * 3.0 * n, epsilon = 1e-12);
    assert_abs_diff_eq!(f.y_s, 0.5 * 3.0 * n, epsilon = 1e-12);
}

proptest! {
    #[test]
    fn a_step_of_the_reference_phase_is_a_pure_turn(psi in -0.5_f64..0.5, delta in -1.0_f64..1.0) {
        let orbit = Orbit { a: 0.8, q: 0.1, theta: 1.1, delta };
        let seen = reference_ahead(&orbit.envelope(), psi);
        let expected = Orbit { delta: delta - psi, ..orbit }.envelope();
        prop_assert!(distance(&seen, &expected) < 1e-13);
    }
}

/// x¨ = −x − βr²x, and likewise y, from an orbit that is an ellipse: (x, y, ẋ, ẏ).
struct CubicForce {
    beta: f64,
}

impl System<f64, Vector4<f64>> for CubicForce {
    fn system(&self, _: f64, s: &Vector4<f64>, rate: &mut Vector4<f64>) {
        let pull = 1.0 + self.beta * (s[0] * s[0] + s[1] * s[1]);
        *rate = Vector4::new(s[2], s[3], -pull * s[0], -pull * s[1]);
    }
}

#[test]
fn the_spring_is_a_force_with_a_cubic_part_averaged() {
    let (beta, periods) = (2e-4, 100);
    let orbit = Orbit { a: 1.0, q: 0.3, theta: 0.4, delta: 0.0 }.envelope();
    let mut s = Vector4::new(orbit.x_c, orbit.y_c, orbit.x_s, orbit.y_s);
    // a piece at a time: the solver's own steps end where a piece does
    let piece = core::f64::consts::TAU / 64.0;
    for _ in 0..64 * periods {
        let mut solver = Dop853::new(CubicForce { beta }, 0.0, piece, piece, s, 1e-13, 1e-14);
        solver.integrate().expect("integrates");
        s = *solver.y_out().last().expect("an end");
    }
    let end = core::f64::consts::TAU * f64::from(periods);
    // whole periods of the linear oscillation later, the phase that is ahead is the spring's
    let forced = Envelope::new(s[0], s[2], s[1], s[3]);
    let spring = Spring { precession: -beta / 8.0, frequency: 3.0 * beta / 8.0 };
    let set = IsotropicSpring { c: spring.precession, frequency_per_energy: None };
    assert_abs_diff_eq!(set.frequency_per_energy(), spring.frequency, epsilon = 1e-18);
    let free = Resonator { damping_per_s: 0.0, angular_gain: 0.0, ..resonator() };
    let stages = Stages { spring: Some(spring), ..Stages::default() };
    let (steps, mut averaged) = (200, orbit);
    let plant = Plant::new(&free, &stages, 0.0, 0.0, 1.0, end / f64::from(steps));
    for _ in 0..steps {
        averaged = plant.step(&averaged, &AxisForces::default(), 0.0, &Moment::origin());
    }
    let [forced_p, averaged_p, before] = [forced, averaged, orbit].map(|e| e.pendulum());
    let turned = averaged_p.angle() - before.angle();
    assert!(turned.abs() > 5e-3, "{turned}");
    // the average is of first order: what it leaves is β of it
    assert_abs_diff_eq!(forced_p.angle(), averaged_p.angle(), epsilon = 5e-4 * turned.abs() + 5e-4 * beta);
    assert!(distance(&forced, &averaged) < 5.0 * beta, "{}", distance(&forced, &averaged));
    assert!(distance(&orbit, &averaged) > 0.04);
}

#[test]
fn a_spring_at_the_carrier_turns_and_speeds_up_as_its_envelope_does() {
    let spring = Spring { precession: 0.8, frequency: -2.4 };
    let ring = Resonator { damping_per_s: 0.0, angular_gain: 0.0, centrifugal_gain: 0.0, ..resonator() };
    let orbit = Orbit { a: 1.0, q: 0.3, theta: 0.4, delta: 0.0 }.envelope();
    let samples = 20_000_u32;
    // the sample rate is ten times the carrier: after whole periods the linear phase is where it was
    let period_s = 1.0 / 152_000.0;
    let mut carrier = CarrierPlant::new(&ring, [1.0; 2], period_s, 0.0);
    carrier.set_vibration(&orbit);
    for _ in 0..samples {
        carrier.step([0.0; 2], [0.0; 2]);
        carrier.bend(&spring);
    }
    let stages = Stages { spring: Some(spring), ..Stages::default() };
    let plant = Plant::new(&ring, &stages, 0.0, 0.0, 1.0, period_s * f64::from(samples) / 100.0);
    let averaged = (0..100).fold(orbit, |e, _| plant.step(&e, &AxisForces::default(), 0.0, &Moment::origin()));
    assert!(distance(&orbit, &averaged) > 0.2);
    assert!(distance(&carrier.vibration(), &averaged) < 1e-8, "{}", distance(&carrier.vibration(), &averaged));
}
