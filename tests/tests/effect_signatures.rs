//! The signature that each effect's description claims: in the angle and amplitude of a line orbit, in the commands, over
//! rate, amplitude and time.
//!
//! Signatures are for small effects: what a test allows beyond them is the square of the effect's size.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use cvg_model::effects::{EffectId, Moment, Values};
use cvg_model::resonator::envelope::coriolis;
use cvg_model::{ActuationGains, ControlOutputs, Envelope, OrbitForces};
use cvg_tests::domain::{angles, sizes, wrapped};
use cvg_tests::effects::{line, values};
use cvg_tests::prop_assert_near;
use proptest::prelude::*;

/// What the readout of a line orbit (`a`, `theta`) is off by: (angle in rad, relative amplitude).
fn readout_error(effect: EffectId, v: &Values<f64>, a: f64, theta: f64, at: &Moment<f64>) -> (f64, f64) {
    let p = effect.read(v, line(a, theta), at).pendulum();
    (wrapped(p.angle() - theta, PI), p.e.sqrt() / a - 1.0)
}

/// The angle that an effect of the mechanics adds to a free pattern which precesses at −kΩ, at `theta`: what is left
/// of half a turn after its best line, from the average precession rate to the deviation from it.
///
/// dθ_b/dθ · (−kΩ) = θ̇ + kΩ to first order in the effect.
fn precession_error_slope(effect: EffectId, v: &Values<f64>, a: f64, theta: f64, k_omega: f64) -> f64 {
    let e = line(a, theta);
    let rate = coriolis(k_omega, &e) + effect.mechanics(v, &e, &Moment::default());
    (e.precession(&rate) + k_omega) / -k_omega
}

/// dy/dx by a central difference.
fn slope(y: impl Fn(f64) -> f64, x: f64) -> f64 {
    const H: f64 = 1e-4;
    (y(x + H) - y(x - H)) / (2.0 * H)
}

/// Orbit forces that a commanded `v_as` becomes at `theta` when the drive has this effect and unit gains.
fn driven(effect: EffectId, v: &Values<f64>, v_as: f64, theta: f64) -> OrbitForces<f64> {
    let commanded = ActuationGains { x: 1.0, y: 1.0 }.axis_forces(&ControlOutputs { v_as, v_qc: 0.0 }, theta);
    effect.actuate(v, commanded, &Moment::default()).along_orbit(theta)
}

/// Small effect sizes of either sign.
fn small() -> impl Strategy<Value = f64> {
    -1e-3..1e-3_f64
}

/// Rates of precession kΩ of either direction, rad/s.
fn precessions() -> impl Strategy<Value = f64> {
    (0.1..10.0_f64, any::<bool>()).prop_map(|(rate, back)| if back { -rate } else { rate })
}

/// Output over input of a carrier of `n` steps through a converter that rounds, by its first harmonic.
fn rounded_gain(n: f64) -> f64 {
    let rows = (1..).map(|i| f64::from(i) - 0.5).take_while(|level| *level < n);
    4.0 / (PI * n) * rows.map(|level| (1.0 - (level / n).powi(2)).sqrt()).sum::<f64>()
}

#[test]
fn the_steps_of_a_drives_converter_leave_its_carrier_as_it_is() {
    // the formula, beside a converter that rounds
    let (n, samples) = (9.3, 1 << 20);
    let first: f64 =
        (0..samples).map(|i| (TAU * f64::from(i) / f64::from(samples)).sin()).map(|s| (n * s).round() * s).sum();
    assert!((2.0 * first / (n * f64::from(samples)) - rounded_gain(n)).abs() < 1e-5);
    // an angle of (N_y - N_x)/(2 tau k Omega) at most, N - 1 of either sign
    let mdeg = |n: f64| (0.4 * n.powf(-1.5) / (2.0 * 22.0 * 0.78 * 60.0_f64.to_radians())).to_degrees() * 1e3;
    for least in [4.0, 16.0, 128.0, 512.0, 2047.0] {
        let off = (0..3000)
            .map(|i| least * (1.0 + f64::from(i) / 6000.0))
            .map(|n| (rounded_gain(n) - 1.0).abs() * n.powf(1.5));
        assert!(off.fold(0.0, f64::max) < 0.4, "{least}");
    }
    assert!((mdeg(128.0) - 0.44).abs() < 0.005 && (mdeg(512.0) - 0.055).abs() < 5e-4);
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    #[test]
    fn prop_unequal_detection_gains_show_at_2theta(mismatch in small(), a in sizes(), theta in angles()) {
        let v = values(&[1.0 + mismatch]);
        let (angle, amplitude) = readout_error(EffectId::DetectionGainMismatch, &v, a, theta, &Moment::default());
        prop_assert_near!(angle, 0.5 * mismatch * (2.0 * theta).sin(), mismatch.powi(2) + 1e-14);
        prop_assert_near!(amplitude, 0.5 * mismatch * (1.0 - (2.0 * theta).cos()), mismatch.powi(2) + 1e-14);
    }

    #[test]
    fn prop_skewed_readout_axes_show_as_a_constant_and_at_2theta(s in small(), a in sizes(), theta in angles()) {
        let (angle, amplitude) = readout_error(EffectId::DetectionSkew, &values(&[s]), a, theta, &Moment::default());
        prop_assert_near!(angle, 0.5 * s * (1.0 + (2.0 * theta).cos()), s.powi(2) + 1e-14);
        prop_assert_near!(amplitude, 0.5 * s * (2.0 * theta).sin(), s.powi(2) + 1e-14);
    }

    /// Q_d = E sin 2θ · sin φ; a quadrature of the opposite sign reads as none.
    #[test]
    fn prop_unequal_phase_lags_read_a_line_as_an_ellipse(lag in -0.5..0.5, a in sizes(), theta in angles()) {
        let (sin, cos) = theta.sin_cos();
        let line = Envelope::new(a * cos, 0.0, a * sin, 0.0);
        let read = EffectId::DetectionPhase.read(&values(&[lag]), line, &Moment::default()).pendulum();
        prop_assert_near!(read.e / (a * a), 1.0, 1e-14);
        prop_assert_near!(read.q / (a * a), (2.0 * theta).sin() * lag.sin(), 1e-14);
        let alike = EffectId::DetectionPhase.unread(&values(&[lag]), line, &Moment::default()).pendulum();
        prop_assert_near!(alike.q / (a * a), -(2.0 * theta).sin() * lag.sin(), 1e-14);
    }

    #[test]
    fn prop_offsets_show_at_1theta_and_fade_with_amplitude(
        o_x in small(), o_y in small(), a in sizes(), theta in -PI..PI,
    ) {
        let v = values(&[o_x * a, o_y * a]);
        let (angle, amplitude) = readout_error(EffectId::DetectionOffset, &v, a, theta, &Moment::default());
        let (sin, cos) = theta.sin_cos();
        let second_order = o_x.powi(2) + o_y.powi(2) + 1e-14;
        prop_assert_near!(angle, (v[1] * cos - v[0] * sin) / a, second_order);
        prop_assert_near!(amplitude, (v[0] * cos + v[1] * sin) / a, second_order);
    }

    #[test]
    fn prop_a_cubic_readout_shows_at_4theta_with_the_square_of_the_amplitude(
        size in small(), a in sizes(), theta in angles(),
    ) {
        let kappa = size / (a * a);
        let v = values(&[kappa, 0.0]);
        let (angle, amplitude) = readout_error(EffectId::DetectionCubic, &v, a, theta, &Moment::default());
        prop_assert_near!(angle, -3.0 / 16.0 * kappa * a * a * (4.0 * theta).sin(), size.powi(2) + 1e-14);
        let expected = 0.75 * kappa * a * a * (0.75 + 0.25 * (4.0 * theta).cos());
        prop_assert_near!(amplitude, expected, size.powi(2) + 1e-14);
    }

    /// A difference of κ between the axes looks like a gain mismatch at one amplitude: 2θ.
    #[test]
    fn prop_cubic_readouts_that_differ_show_at_2theta(size in small(), a in sizes(), theta in angles()) {
        let v = values(&[0.0, size / (a * a)]);
        let (angle, _) = readout_error(EffectId::DetectionCubic, &v, a, theta, &Moment::default());
        prop_assert_near!(angle, -3.0 / 8.0 * size * (2.0 * theta).sin(), size.powi(2) + 1e-14);
    }

    #[test]
    fn prop_the_cubic_readout_is_the_first_harmonic_of_the_distorted_carrier(
        kappa in -0.1..0.1_f64, c in -1.0..1.0_f64, s in -1.0..1.0_f64,
    ) {
        let e = Envelope::new(c, s, 0.0, 0.0);
        let read = EffectId::DetectionCubic.read(&values(&[kappa, 0.0]), e, &Moment::default());
        let (x_c, x_s) = first_harmonic(|phase| {
            let x = c * phase.cos() + s * phase.sin();
            x + kappa * x.powi(3)
        });
        prop_assert_near!(read.x_c, x_c, 1e-14);
        prop_assert_near!(read.x_s, x_s, 1e-14);
    }

    #[test]
    fn prop_clipping_is_the_first_harmonic_of_the_clipped_carrier(
        clip in 0.3..1.5_f64, c in -1.0..1.0_f64, s in -1.0..1.0_f64,
    ) {
        let e = Envelope::new(c, s, 0.0, 0.0);
        let read = EffectId::DetectionSaturation.read(&values(&[1.0 / clip]), e, &Moment::default());
        let (x_c, x_s) = first_harmonic(|phase| (c * phase.cos() + s * phase.sin()).clamp(-clip, clip));
        // The kinks of the clipped carrier limit what its samples tell.
        prop_assert_near!(read.x_c, x_c, 1e-6);
        prop_assert_near!(read.x_s, x_s, 1e-6);
    }

    #[test]
    fn prop_clipping_shows_nothing_below_its_threshold(a in sizes(), theta in angles(), drive in 0.0..1.0_f64) {
        let e = line(a, theta);
        prop_assert_eq!(EffectId::DetectionSaturation.read(&values(&[drive / a]), e, &Moment::default()), e);
    }

    /// Period 90° and odd: 4θ, 8θ, 12θ … and nothing else.
    #[test]
    fn prop_clipping_shows_only_at_multiples_of_4theta(theta in angles(), drive in 1.0..3.0_f64) {
        let error = |theta: f64| {
            readout_error(EffectId::DetectionSaturation, &values(&[drive]), 1.0, theta, &Moment::default()).0
        };
        prop_assert_near!(error(theta + FRAC_PI_2), error(theta), 1e-13);
        prop_assert_near!(error(-theta), -error(theta), 1e-13);
    }

    /// θ̇ = ½Δ(1/τ) sin 2(θ−θ_τ) integrates to Δ(1/τ)/(4kΩ) cos 2(θ−θ_τ), which changes sign with Ω.
    #[test]
    fn prop_anisodamping_shows_at_2theta_and_fades_with_rate(
        c in small(), s in small(), a in sizes(), theta in angles(), k_omega in precessions(),
    ) {
        let (delta, axis) = (c.hypot(s), 0.5 * s.atan2(c));
        let v = values(&[c, s]);
        let measured = precession_error_slope(EffectId::Anisodamping, &v, a, theta, k_omega);
        let expected = slope(|theta| delta / (4.0 * k_omega) * (2.0 * (theta - axis)).cos(), theta);
        prop_assert_near!(measured, expected, 1e-6 * delta / k_omega.abs() + 1e-13);
    }

    /// The energy loop makes up for −Δ(1/τ) cos 2(θ−θ_τ) beside −2/τ: v_as swings by ½Δ(1/τ)τ of its mean.
    #[test]
    fn prop_anisodamping_shows_in_the_energy_control_at_2theta(
        c in small(), s in small(), a in sizes(), theta in angles(), tau_s in 1.0..100.0_f64,
    ) {
        let (delta, axis) = (c.hypot(s), 0.5 * s.atan2(c));
        let e = line(a, theta);
        let extra = e.pendulum_rate(&EffectId::Anisodamping.mechanics(&values(&[c, s]), &e, &Moment::default())).e;
        let mean = -2.0 / tau_s * a * a;
        prop_assert_near!(extra / mean, 0.5 * delta * tau_s * (2.0 * (theta - axis)).cos(), 1e-13 * tau_s);
    }

    #[test]
    fn prop_anisoelasticity_shows_in_the_quadrature_control_at_2theta_and_not_in_the_angle_of_a_line_orbit(
        c in -1.0..1.0_f64, s in -1.0..1.0_f64, a in sizes(), theta in angles(),
    ) {
        let (delta, axis) = (c.hypot(s), 0.5 * s.atan2(c));
        let e = line(a, theta);
        let rate = EffectId::Anisoelasticity.mechanics(&values(&[c, s]), &e, &Moment::default());
        prop_assert_near!(e.pendulum_rate(&rate).q, -delta * a * a * (2.0 * (theta - axis)).sin(), 1e-13 * a * a);
        prop_assert_near!(e.precession(&rate), 0.0, 1e-14);
    }

    #[test]
    fn prop_anisoelasticity_precesses_an_orbit_with_quadrature(
        c in -1.0..1.0_f64, s in -1.0..1.0_f64, a in sizes(), q in -0.5..0.5_f64, theta in angles(),
    ) {
        let (delta, axis) = (c.hypot(s), 0.5 * s.atan2(c));
        let e = cvg_model::Orbit { a, q: a * q, theta, delta: 0.0 }.envelope();
        let p = e.pendulum();
        let expected = 0.5 * delta * p.q / p.r.hypot(p.s) * (2.0 * (theta - axis)).cos();
        prop_assert_near!(e.precession(&EffectId::Anisoelasticity.mechanics(&values(&[c, s]), &e, &Moment::default())), expected, 1e-13);
    }

    /// θ̇ = p sin(4θ + phase) integrates to p/(4kΩ) cos(4θ + phase).
    #[test]
    fn prop_a_nonlinear_spring_shows_at_4theta_and_fades_with_rate(
        c in small(), s in small(), a in sizes(), theta in angles(), k_omega in precessions(),
    ) {
        let (p, phase) = (c.hypot(s), s.atan2(c));
        let measured = precession_error_slope(EffectId::SpringCubic, &values(&[c, s]), a, theta, k_omega);
        let expected = slope(|theta| p / (4.0 * k_omega) * (4.0 * theta + phase).cos(), theta);
        prop_assert_near!(measured, expected, 1e-6 * p / k_omega.abs() + 1e-13);
    }

    /// To hold the energy, v_as must be the wanted f_as over (G_Ax cos²θ + G_Ay sin²θ).
    #[test]
    fn prop_unequal_drive_gains_show_in_the_energy_control(mismatch in -0.2..0.2_f64, theta in angles()) {
        let ratio = 1.0 + mismatch;
        let force = driven(EffectId::ActuationGainMismatch, &values(&[ratio]), 1.0, theta).a_s;
        let (x, y) = (ratio.sqrt(), 1.0 / ratio.sqrt());
        prop_assert_near!(force, x * theta.cos().powi(2) + y * theta.sin().powi(2), 1e-14);
    }

    /// With f_as = −2ωa/τ, what leaks precesses at θ̇ = −f_qs/(2ωa) = −½(G_Ax/G_Ay − 1) sin 2θ/τ: ∝ 1/τ, and so
    /// ∝ 1/(τΩ) in angle.
    #[test]
    fn prop_unequal_drive_gains_precess_the_pattern_a_little(
        mismatch in small(), theta in angles(), a in sizes(), tau_s in 1.0..100.0_f64,
    ) {
        let two_omega = TAU * 30_400.0;
        let v_as = -two_omega * a / tau_s;
        let leak = driven(EffectId::ActuationGainMismatch, &values(&[1.0 + mismatch]), v_as, theta).q_s;
        let expected = -0.5 * mismatch * (2.0 * theta).sin() / tau_s;
        prop_assert_near!(-leak / (two_omega * a), expected, (mismatch.powi(2) + 1e-14) / tau_s);
    }

    #[test]
    fn prop_skewed_drive_axes_show_in_the_energy_control_at_sin_2theta(s in small(), theta in angles()) {
        let f = driven(EffectId::ActuationSkew, &values(&[s]), 1.0, theta);
        prop_assert_near!(f.a_s - 1.0, 0.5 * s * (2.0 * theta).sin(), 1e-14);
        prop_assert_near!(f.q_s, 0.5 * s * (1.0 + (2.0 * theta).cos()), 1e-14);
    }

    /// What holds the quadrature pushes the pattern along by the sine of the phase, and the energy control has no part in it.
    #[test]
    fn prop_a_phase_of_the_drives_turns_what_holds_the_quadrature(phase in small(), v_qc in -1.0..1.0_f64, theta in angles()) {
        let commanded = ActuationGains { x: 1.0, y: 1.0 }.axis_forces(&ControlOutputs { v_as: 0.0, v_qc }, theta);
        let held = commanded.along_orbit(theta).q_c;
        let f = EffectId::ActuationPhase.actuate(&values(&[phase]), commanded, &Moment::default()).along_orbit(theta);
        prop_assert_near!(f.q_s, -phase * held, 1e-9);
        prop_assert_near!(f.a_s, 0.0, 1e-14);
    }

    /// Below the level nothing is lost; above it each axis by itself, the more the nearer the pattern lies to it.
    #[test]
    fn prop_a_drive_that_saturates_loses_at_multiples_of_90_degrees(
        level in 0.1..10.0_f64, over in 1.0..1.4_f64, theta in angles(),
    ) {
        let v = values(&[1.0 / level]);
        let gain = |share: f64| {
            let r = (1.0 / (over * share.abs())).min(1.0);
            2.0 / PI * (r.asin() + r * (1.0 - r * r).sqrt())
        };
        let (sin, cos) = theta.sin_cos();
        let (x, y) = (gain(cos), gain(sin));
        let f = driven(EffectId::DriveSaturation, &v, over * level, theta);
        prop_assert_near!(f.a_s / (over * level), x * cos * cos + y * sin * sin, 1e-12);
        prop_assert_near!(f.q_s / (over * level), 0.5 * (y - x) * (2.0 * theta).sin(), 1e-12);
        // a command of less than the level, and one that both axes share
        let whole = driven(EffectId::DriveSaturation, &v, 0.999 * level, theta);
        prop_assert_near!(whole.a_s, 0.999 * level, 1e-12 * level);
        let between = driven(EffectId::DriveSaturation, &v, over * level, core::f64::consts::FRAC_PI_4);
        prop_assert_near!(between.a_s, over * level, 1e-12 * level);
    }

    /// What holds the quadrature saturates with what holds the amplitude: both phases of one axis are one voltage.
    #[test]
    fn prop_both_phases_of_a_drive_saturate_together(over in 1.1..3.0_f64, phase in angles()) {
        let (sin, cos) = phase.sin_cos();
        let f = cvg_model::AxisForces { x_c: over * cos, x_s: over * sin, y_c: 0.0, y_s: 0.0 };
        let out = EffectId::DriveSaturation.actuate(&values(&[1.0]), f, &Moment::default());
        let r = 1.0 / over;
        prop_assert_near!(out.x_c.hypot(out.x_s), over * 2.0 / PI * (r.asin() + r * (1.0 - r * r).sqrt()), 1e-12);
        prop_assert_near!(out.x_c * f.x_s - out.x_s * f.x_c, 0.0, 1e-12);
    }

    /// Whole steps, and never further than half a step from what is commanded, whatever the other phase and the other axis do.
    #[test]
    fn prop_a_drive_of_few_steps_puts_out_whole_ones(
        step in 1e-3..1.0_f64, x_c in -9.0..9.0_f64, x_s in -9.0..9.0_f64, y_c in -9.0..9.0_f64, y_s in -9.0..9.0_f64,
    ) {
        let f = cvg_model::AxisForces { x_c, x_s, y_c, y_s };
        let out = EffectId::DriveQuantisation.actuate(&values(&[step]), f, &Moment::default());
        for (out, f) in [(out.x_c, x_c), (out.x_s, x_s), (out.y_c, y_c), (out.y_s, y_s)] {
            prop_assert_near!(out / step, (out / step).round(), 1e-8);
            prop_assert!((out - f).abs() <= 0.5 * step * (1.0 + 1e-8), "{out} of {f}");
        }
    }

    /// θ̇ = −kΩ0(1 + w cos(nα + phase)) with α̇ = Ω0 integrates to −(kw/n) sin(nα + phase).
    #[test]
    fn prop_table_ripple_follows_the_table_and_not_the_pattern(
        n in 1..64_i32, c in small(), s in small(), table in angles(), rate in precessions(), k in 0.1..1.0_f64,
    ) {
        let (n, w, phase) = (f64::from(n), c.hypot(s), s.atan2(c));
        let at = Moment { table_rad: table, ..Moment::default() };
        let through = EffectId::TableHarmonic.input_rate(&values(&[n, c, s]), rate, &at);
        let measured = -k * (through - rate) / rate;
        let expected = slope(|table| -(k * w / n) * (n * table + phase).sin(), table);
        prop_assert_near!(measured, expected, 1e-4 * w + 1e-12);
    }

    /// θ̇ = −kΩ(1 + k̇t) integrates to a parabola in time.
    #[test]
    fn prop_a_drifting_angular_gain_bends_the_angle_with_the_square_of_time(
        drift in -1e-5..1e-5_f64, t_s in 0.0..1e3_f64, rate in precessions(),
    ) {
        let at = Moment { t_s, ..Moment::default() };
        let extra = EffectId::ScaleDrift.input_rate(&values(&[drift]), rate, &at) - rate;
        prop_assert_near!(extra, slope(|t| 0.5 * rate * drift * t * t, t_s), 1e-9);
    }

    #[test]
    fn prop_a_drifting_gain_ratio_grows_at_2theta(
        drift in -1e-5..1e-5_f64, t_s in 0.0..100.0_f64, a in sizes(), theta in angles(),
    ) {
        let at = Moment { t_s, ..Moment::default() };
        let (angle, amplitude) = readout_error(EffectId::GainDrift, &values(&[drift]), a, theta, &at);
        let mismatch = drift * t_s;
        prop_assert_near!(angle, 0.5 * mismatch * (2.0 * theta).sin(), mismatch.powi(2) + 1e-14);
        prop_assert_near!(amplitude, 0.5 * mismatch * (1.0 - (2.0 * theta).cos()), mismatch.powi(2) + 1e-14);
    }

    #[test]
    fn prop_a_periodic_disturbance_is_a_line_in_time_at_every_angle(
        f in 0.1..100.0_f64, c in small(), s in small(), t_s in 0.0..10.0_f64, a in sizes(), theta in angles(),
    ) {
        let at = Moment { t_s, ..Moment::default() };
        let (angle, amplitude) = readout_error(EffectId::TimePeriodic, &values(&[f, c, s]), a, theta, &at);
        prop_assert_near!(angle, c.hypot(s) * (TAU * f * t_s + s.atan2(c)).cos(), 1e-14);
        prop_assert_near!(amplitude, 0.0, 1e-14);
    }

    /// Late by t_d, the angle is where it was: ahead by kΩt_d, since the pattern precesses at −kΩ.
    #[test]
    fn prop_latency_is_a_constant_per_rate_that_changes_sign_with_direction(
        latency in small(), k_omega in precessions(), a in sizes(), theta in angles(),
    ) {
        let at = Moment { precession_rad_s: -k_omega, ..Moment::default() };
        let (angle, amplitude) = readout_error(EffectId::AngleLatency, &values(&[latency]), a, theta, &at);
        prop_assert_near!(angle, k_omega * latency, 1e-14);
        prop_assert_near!(amplitude, 0.0, 1e-14);
    }

    #[test]
    fn prop_an_empirical_harmonic_scales_with_the_rate_as_its_kind_says(
        n in 0..32_i32, c in small(), a in sizes(), theta in -PI..PI, precession in 0.1..10.0_f64, back in proptest::bool::ANY,
    ) {
        use cvg_model::effects::harmonic_n::scaling::{CONSTANT, DIRECTION, INVERSE_RATE, RATE};
        let sign = if back { -1.0 } else { 1.0 };
        let at = Moment { precession_rad_s: sign * precession, ..Moment::default() };
        for (kind, size) in
            [(CONSTANT, 1.0), (DIRECTION, sign), (RATE, sign * precession), (INVERSE_RATE, sign / precession)]
        {
            let c = 0.1 * c;
            let (angle, _) = readout_error(EffectId::HarmonicN, &values(&[f64::from(n), c, 0.0, kind]), a, theta, &at);
            prop_assert_near!(angle, size * c * (f64::from(n) * theta).cos(), 1e-12);
        }
    }

    #[test]
    fn prop_an_empirical_harmonic_is_at_n_theta(
        n in 1..32_i32, c in small(), s in small(), a in sizes(), theta in -PI..PI,
    ) {
        let n = f64::from(n);
        let (angle, amplitude) = readout_error(EffectId::HarmonicN, &values(&[n, c, s]), a, theta, &Moment::default());
        prop_assert_near!(angle, c.hypot(s) * (n * theta + s.atan2(c)).cos(), 1e-13);
        prop_assert_near!(amplitude, 0.0, 1e-14);
    }
}

/// Cosine and sine parts of a carrier's first harmonic.
fn first_harmonic(carrier: impl Fn(f64) -> f64) -> (f64, f64) {
    const SAMPLES: i32 = 4096;
    let mut sums = (0.0, 0.0);
    for n in 0..SAMPLES {
        let phase = TAU * f64::from(n) / f64::from(SAMPLES);
        let value = carrier(phase) * 2.0 / f64::from(SAMPLES);
        sums = (sums.0 + value * phase.cos(), sums.1 + value * phase.sin());
    }
    sums
}

/// "The angle error due to anisodamping for an input angular rate of 500 dps was calculated to be on the order of 10
/// mdegrees": the envelope integrated over two turns of the pattern, less its mean line.
#[test]
fn paper_anisodamping_of_4_7_mhz_bends_the_angle_by_10_mdeg_at_500_dps_and_100_mdeg_at_50_dps() {
    for (rate_dps, expected_mdeg) in [(500.0_f64, 9.9), (50.0, 98.9)] {
        let k_omega = 0.78 * rate_dps.to_radians();
        let v = values(&[4.7e-3, 0.0]);
        // Four half turns of the pattern: the best line of a whole number of periods leaves the harmonic alone.
        let steps = 40_000;
        let dt = 4.0 * PI / k_omega / f64::from(steps);
        let mut e = line(1.0, 0.0);
        let mut turned = 0.0;
        let mut bias = Vec::new();
        for _ in 0..=steps {
            bias.push(turned);
            let f =
                |e: &Envelope<f64>| coriolis(k_omega, e) + EffectId::Anisodamping.mechanics(&v, e, &Moment::default());
            let before = e.pendulum().angle();
            let half = e + f(&e) * (0.5 * dt);
            e = e + f(&half) * dt;
            turned += wrapped(e.pendulum().angle() - before, PI);
        }
        let per_step = bias[bias.len() - 1] / f64::from(steps);
        for (n, b) in (0..).zip(&mut bias) {
            *b -= per_step * f64::from(n);
        }
        let peak_to_peak = bias.iter().fold(f64::MIN, |a, &b| a.max(b)) - bias.iter().fold(f64::MAX, |a, &b| a.min(b));
        approx::assert_abs_diff_eq!(0.5e3 * peak_to_peak.to_degrees(), expected_mdeg, epsilon = 0.1);
    }
}

/// κ = 0.004 /µm² at 1 µm: −(3/16)κa² sin 4θ = 43 mdeg.
#[test]
fn a_cubic_readout_of_0_004_per_square_micron_bends_the_angle_by_43_mdeg() {
    let v = values(&[0.004, 0.0]);
    let worst = (0..360)
        .map(|n| {
            readout_error(EffectId::DetectionCubic, &v, 1.0, f64::from(n).to_radians(), &Moment::default()).0.abs()
        })
        .fold(0.0, f64::max);
    approx::assert_abs_diff_eq!(1e3 * worst.to_degrees(), 43.0, epsilon = 0.3);
}
