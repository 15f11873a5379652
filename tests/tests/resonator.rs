//! Three views of one mechanics: the equation of motion, its envelope and the orbit's averages tell the same story.

use core::f64::consts::{PI, TAU};

use cvg_model::resonator::averaged::Averages;
use cvg_model::resonator::carrier::{Motion, Rotation};
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{AxisForces, Envelope, Orbit};
use cvg_tests::domain::{angles, envelopes, orbits, sizes, wrapped};
use cvg_tests::scalar::{rounded, rounded_envelope, widened};
use cvg_tests::tolerances::ORBIT;
use cvg_tests::{for_each_scalar, prop_assert_near};
use proptest::prelude::*;

/// Resonators from a soft 1 kHz to a stiff 100 kHz, with losses and asymmetries far below the carrier.
fn resonators() -> impl Strategy<Value = Resonator<f64>> {
    (1e3..1e5_f64, 0.05..1.0_f64, 0.0..1.0_f64, 0.0..0.5_f64, angles(), 0.0..10.0_f64, angles()).prop_map(
        |(f0_hz, angular_gain, damping_per_s, anisodamping, theta_tau, anisoelasticity, theta_omega)| Resonator {
            omega_rad_s: TAU * f0_hz,
            angular_gain,
            centrifugal_gain: 0.0,
            damping_per_s,
            anisodamping: Anisotropy::new(anisodamping, theta_tau),
            anisoelasticity: Anisotropy::new(anisoelasticity, theta_omega),
        },
    )
}

/// Displacement and velocity of an envelope at reference phase `phase`: x = Re[X e^{iφ}], ẋ = Re[iωX e^{iφ}].
fn motion(e: &Envelope<f64>, omega: f64, phase: f64) -> Motion<f64> {
    let (sin, cos) = phase.sin_cos();
    Motion {
        x: e.x_c * cos + e.x_s * sin,
        y: e.y_c * cos + e.y_s * sin,
        x_dot: omega * (e.x_s * cos - e.x_c * sin),
        y_dot: omega * (e.y_s * cos - e.y_c * sin),
    }
}

/// Force along X and Y at reference phase `phase`.
fn force(f: &AxisForces<f64>, phase: f64) -> (f64, f64) {
    let (sin, cos) = phase.sin_cos();
    (f.x_c * cos + f.x_s * sin, f.y_c * cos + f.y_s * sin)
}

/// The envelope's rate from the equation of motion, averaged over one period of the carrier.
///
/// With the osculating envelope, r = ẍ + ω²x moves it at Ẋ = (r/iω) e^{−iφ}; sixteen phases average the second
/// harmonic out exactly.
fn averaged_over_a_period(
    resonator: &Resonator<f64>,
    e: &Envelope<f64>,
    input: &Rotation<f64>,
    f: &AxisForces<f64>,
) -> Envelope<f64> {
    const PHASES: i32 = 16;
    let omega = resonator.omega_rad_s;
    let mut sum = Envelope::zero();
    for n in 0..PHASES {
        let phase = TAU * f64::from(n) / f64::from(PHASES);
        let m = motion(e, omega, phase);
        let (f_x, f_y) = force(f, phase);
        let d = resonator.acceleration(&m, input, f_x, f_y);
        let (r_x, r_y) = (d.x_dot + omega * omega * m.x, d.y_dot + omega * omega * m.y);
        // (r/iω) e^{−iφ} = −(r/ω)(sin φ + i cos φ); Ẋ = ẋ_c − iẋ_s
        let (sin, cos) = phase.sin_cos();
        sum = sum + Envelope::new(-r_x * sin, r_x * cos, -r_y * sin, r_y * cos) * (1.0 / omega);
    }
    sum * (1.0 / f64::from(PHASES))
}

fn size(e: &Envelope<f64>) -> f64 {
    e.pendulum().e.sqrt()
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    #[test]
    fn prop_the_envelope_is_the_average_of_the_equation_of_motion_over_a_period(
        resonator in resonators(), e in envelopes(), rate in -10.0..10.0_f64, f in envelopes(),
    ) {
        let f = AxisForces { x_c: f.x_c, x_s: f.x_s, y_c: f.y_c, y_s: f.y_s };
        let input = Rotation { rate_rad_s: rate, acceleration_rad_s2: 0.0 };
        let carrier = averaged_over_a_period(&resonator, &e, &input, &f);
        let envelope = resonator.envelope_rate(&e, rate, 0.0) + f.envelope_rate(2.0 * resonator.omega_rad_s);
        // The stiffness ω²x, which the two views share, cancels in the average: what is left of it is its rounding.
        prop_assert!(
            size(&(carrier - envelope)) <= 1e-14 * resonator.omega_rad_s * size(&e) + 1e-12 * size(&envelope),
            "carrier {carrier:?}, envelope {envelope:?}"
        );
    }

    /// What first-order averaging leaves out: the Euler and centrifugal forces, smaller by Ω̇/2ωΩ and k'Ω/2kω.
    #[test]
    fn prop_euler_and_centrifugal_forces_are_of_second_order(
        resonator in resonators(), e in envelopes(), rate in -10.0..10.0_f64, acceleration in -100.0..100.0_f64,
    ) {
        let resonator = Resonator { centrifugal_gain: 1.0, ..resonator };
        let input = Rotation { rate_rad_s: rate, acceleration_rad_s2: acceleration };
        let none = AxisForces { x_c: 0.0, x_s: 0.0, y_c: 0.0, y_s: 0.0 };
        let carrier = averaged_over_a_period(&resonator, &e, &input, &none);
        let left_out = size(&(carrier - resonator.envelope_rate(&e, rate, 0.0)));
        let second_order = (resonator.angular_gain * acceleration.abs() + rate * rate) / (2.0 * resonator.omega_rad_s);
        prop_assert!(left_out <= (1.01 * second_order + 1e-14 * resonator.omega_rad_s) * size(&e));
    }

    #[test]
    fn prop_the_averages_are_the_envelope_in_the_orbits_own_variables(
        resonator in resonators(), o in orbits(), rate in -10.0..10.0_f64,
    ) {
        let e = o.envelope();
        let (p, d) = (e.pendulum(), resonator.envelope_rate(&e, rate, 0.0));
        let averages = resonator.averaged_rate(&Averages { e: p.e, q: p.q, theta: p.angle() }, rate);
        let (exact, line) = (e.pendulum_rate(&d), p.r.hypot(p.s));
        let fastest = resonator.damping_per_s + resonator.anisodamping.magnitude()
            + resonator.anisoelasticity.magnitude() + rate.abs();
        let tolerance = 1e-12 * fastest * p.e / line;
        prop_assert_near!(averages.e, exact.e, tolerance * p.e);
        prop_assert_near!(averages.q, exact.q, tolerance * p.e);
        prop_assert_near!(averages.theta, e.precession(&d), tolerance * p.e / line);
    }

    #[test]
    fn prop_a_detuned_reference_turns_only_the_phase(e in envelopes(), ahead in -10.0..10.0_f64) {
        let rate = e.pendulum_rate(&cvg_model::resonator::envelope::detuning(ahead, &e));
        let tolerance = 1e-14 * ahead.abs() * e.pendulum().e;
        for unmoved in [rate.e, rate.q, rate.r, rate.s] {
            prop_assert_near!(unmoved, 0.0, tolerance);
        }
    }

    #[test]
    fn prop_anisotropy_keeps_its_size_and_axis(delta in sizes(), axis in -1.5..1.5_f64) {
        let a = Anisotropy::new(delta, axis);
        prop_assert_near!(a.magnitude(), delta, 1e-15 * delta);
        prop_assert_near!(a.axis_rad(), axis, 1e-15);
    }
}

for_each_scalar! {
    #[test]
    fn prop_an_orbit_survives_becoming_an_envelope(o in orbits()) {
        let ((a, a64), (q, q64)) = (rounded::<T>(o.a), rounded::<T>(o.q));
        let ((theta, theta64), (delta, delta64)) = (rounded::<T>(o.theta), rounded::<T>(o.delta));
        let e = Orbit { a, q, theta, delta }.envelope();
        let (back, p) = (e.orbit(), e.pendulum());
        // Near ±90° of phase the axis that carries the in-phase part is decided by little: within 1.5 rad it is not.
        let tolerance = T::tolerance(&ORBIT) * p.e.to_f64() / p.r.to_f64().hypot(p.s.to_f64()) / (o.delta.cos()).abs();
        prop_assert_near!(back.a.to_f64(), a64, tolerance * a64);
        prop_assert_near!(back.q.to_f64(), q64, tolerance * a64);
        prop_assert_near!(wrapped(back.theta.to_f64() - theta64, TAU), 0.0, tolerance);
        prop_assert_near!(back.delta.to_f64(), delta64, tolerance);
    }

    #[test]
    fn prop_an_envelope_survives_becoming_an_orbit(e in envelopes()) {
        let (e, e64) = rounded_envelope::<T>(&e);
        let p = e.pendulum();
        let back = widened(&e.orbit().envelope());
        let condition = p.e.to_f64() / p.r.to_f64().hypot(p.s.to_f64());
        prop_assert!(
            size(&(back - e64)) <= T::tolerance(&ORBIT) * condition * size(&e64),
            "{e64:?} came back as {back:?}"
        );
    }

    #[test]
    fn prop_the_axes_of_an_orbit_are_ordered_and_its_angles_in_range(e in envelopes()) {
        let (e, _) = rounded_envelope::<T>(&e);
        let (o, p) = (e.orbit(), e.pendulum());
        let condition = p.e.to_f64() / p.r.to_f64().hypot(p.s.to_f64());
        prop_assume!(condition < 1e3);
        prop_assert!(o.a >= 0.0);
        prop_assert!(o.q.to_f64().abs() <= o.a.to_f64() * (1.0 + T::tolerance(&ORBIT)));
        prop_assert!(o.theta.magnitude() <= T::PI);
        prop_assert!(o.delta.to_f64().abs() <= PI / 2.0 + 1e-6);
    }
}

/// The carrier, integrated over a twentieth of a second and demodulated, is where the envelope says.
#[test]
fn the_demodulated_carrier_follows_the_envelope() {
    let resonator = Resonator {
        omega_rad_s: TAU * 15_200.0,
        angular_gain: 0.78,
        centrifugal_gain: 0.6,
        damping_per_s: 1.0 / 22.0,
        anisodamping: Anisotropy::new(0.02, 0.5),
        anisoelasticity: Anisotropy::new(TAU * 0.5, -0.3),
    };
    let (rate, duration_s, per_period) = (8.0, 0.05, 200.0);
    let start = Orbit { a: 1.0, q: 0.05, theta: 0.4, delta: 0.0 }.envelope();

    let input = Rotation { rate_rad_s: rate, acceleration_rad_s2: 0.0 };
    let steps = (duration_s * 15_200.0 * per_period) as i32;
    let dt = duration_s / f64::from(steps);
    let add = |m: &Motion<f64>, d: &Motion<f64>, h: f64| Motion {
        x: m.x + h * d.x,
        y: m.y + h * d.y,
        x_dot: m.x_dot + h * d.x_dot,
        y_dot: m.y_dot + h * d.y_dot,
    };
    let mut m = motion(&start, resonator.omega_rad_s, 0.0);
    for _ in 0..steps {
        let f = |m: &Motion<f64>| resonator.acceleration(m, &input, 0.0, 0.0);
        let k1 = f(&m);
        let k2 = f(&add(&m, &k1, 0.5 * dt));
        let k3 = f(&add(&m, &k2, 0.5 * dt));
        let k4 = f(&add(&m, &k3, dt));
        for (k, weight) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
            m = add(&m, &k, weight * dt / 6.0);
        }
    }
    // 760 whole periods: the phase is 0 again, so x = x_c and ẋ = ωx_s
    let carrier = Envelope::new(m.x, m.x_dot / resonator.omega_rad_s, m.y, m.y_dot / resonator.omega_rad_s);

    let mut e = start;
    let h = duration_s / 1000.0;
    for _ in 0..1000 {
        let f = |e: &Envelope<f64>| resonator.envelope_rate(e, rate, 0.0);
        let k1 = f(&e);
        let k2 = f(&(e + k1 * (0.5 * h)));
        let k3 = f(&(e + k2 * (0.5 * h)));
        let k4 = f(&(e + k3 * h));
        e = e + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0);
    }
    // First-order averaging is right to (slowest rate)/ω = 8/95000.
    assert!(size(&(carrier - e)) < 3e-4, "carrier {carrier:?}, envelope {e:?}");
    let turned_deg = (carrier.pendulum().angle() - 0.4).to_degrees();
    approx::assert_abs_diff_eq!(turned_deg, (-0.78 * rate * duration_s).to_degrees(), epsilon = 1.5);
    approx::assert_abs_diff_eq!(carrier.pendulum().angle(), e.pendulum().angle(), epsilon = 2e-4);
}
