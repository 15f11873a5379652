//! Closed-loop numbers that an independent simulation of the paper's device gave (f0 = 15.2 kHz, τ = 22 s, k = 0.78).

mod support;

use approx::assert_relative_eq;
use core::f64::consts::TAU;
use support::{angle_harmonics, column, mdeg, only_run, rotation};

#[test]
fn a_detection_mismatch_of_1_32_percent_is_a_second_harmonic_of_0_38_degrees() {
    // Equation 7's second harmonic is (g − 1)/(g + 1) exactly, (g − 1)/2 = 0.378° for a small mismatch
    let mismatch = r#"{ id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 }"#;
    let sine = angle_harmonics(&rotation(mismatch, 500.0, 10.0), &[2.0, 4.0])[0].sin;
    assert_relative_eq!(sine, 0.0132 / 2.0132, max_relative = 2e-3);
    // with anisodamping whose sine part adds 7 mdeg
    let both = format!(r#"{mismatch}, {{ id = "anisodamping", anisodamping = 4.7e-3, theta_tau = 22.5 }}"#);
    let sine = mdeg(angle_harmonics(&rotation(&both, 500.0, 10.0), &[2.0, 4.0])[0].sin);
    assert_relative_eq!(sine, 382.6, max_relative = 3e-3);
}

#[test]
fn anisodamping_is_10_millidegrees_at_500_and_99_at_50_degrees_per_second() {
    let effect = r#"{ id = "anisodamping", anisodamping = 4.7e-3, theta_tau = 30.0 }"#;
    for (rate, duration, expected) in [(500.0, 10.0, 9.9), (50.0, 60.0, 98.9), (-500.0, 10.0, 9.9)] {
        let second = angle_harmonics(&rotation(effect, rate, duration), &[2.0])[0];
        assert_relative_eq!(mdeg(second.amplitude()), expected, max_relative = 0.1);
    }
}

#[test]
fn a_cubic_readout_is_a_fourth_harmonic_of_41_to_43_millidegrees() {
    let run = rotation(r#"{ id = "detection-cubic", kappa = 0.004 }"#, 500.0, 10.0);
    let fourth = angle_harmonics(&run, &[2.0, 4.0])[1];
    assert!((-44.0..-40.0).contains(&mdeg(fourth.sin)), "{fourth:?}");
}

#[test]
fn below_the_threshold_rate_the_pattern_locks() {
    // Ω_th = Δ(1/τ)/(2k): at 0.8 of it the pattern comes to rest, at 1.5 it turns on
    let effect = r#"{ id = "anisodamping", anisodamping = 0.5, theta_tau = 30.0 }"#;
    let threshold = (0.5 / (2.0 * support::ANGULAR_GAIN)).to_degrees();
    let moved = |rate: f64| {
        let theta = support::angles(&rotation(effect, rate, 60.0), cvg_estimator::Period::Pattern);
        (theta[theta.len() - 1] - theta[theta.len() / 2]).abs()
    };
    assert!(moved(0.8 * threshold) < 1e-3);
    assert!(moved(1.5 * threshold) > 1.0);
}

#[test]
fn a_split_of_40_millihertz_leaves_the_quadrature_loops_fourth_harmonic() {
    let effect = format!(r#"{{ id = "anisoelasticity", anisoelasticity = {}, theta_omega = 20.0 }}"#, TAU * 0.04);
    for (rate, duration, expected) in [(500.0, 10.0, 2.4), (60.0, 40.0, 12.0)] {
        let fourth = angle_harmonics(&rotation(&effect, rate, duration), &[2.0, 4.0])[1];
        assert_relative_eq!(mdeg(fourth.amplitude()), expected, max_relative = 0.15);
    }
}

#[test]
fn the_energy_command_replaces_what_damping_takes() {
    for amplitude in [1.0, 0.6] {
        let run = support::rotation_with(&format!("amplitude_v = {amplitude:?}"), "", 200.0, 4.0);
        for v_as in column(&run, "vas_v") {
            assert_relative_eq!(*v_as, -amplitude / 22.0, max_relative = 1e-3);
        }
    }
}

#[test]
fn a_ring_down_decays_with_tau_at_the_angle_at_which_it_is_held() {
    for angle in [0.0, 35.0, 90.0] {
        let run = only_run(&format!(
            "device = \"t\"\nangular_gain = 0.78\nwarm_up_s = 2.0\n\
             effects = [{{ id = \"anisodamping\", anisodamping = 4.7e-3, theta_tau = 10.0 }}]\n\
             [[run]]\nkind = \"ringdown\"\nfile = \"a.csv\"\nangle_deg = {angle:?}\nenergy_off_s = 2.0\nduration_s = 22.0\n"
        ));
        let energy = |row: usize| support::envelopes(&run)[row].pendulum().e;
        // 1/τ(θ) = 1/τ + ½Δ(1/τ) cos 2(θ − θ_τ), over 15 s
        let decay = 0.5 * (energy(500) / energy(2000)).ln() / 15.0;
        let expected = 1.0 / 22.0 + 0.5 * 4.7e-3 * (2.0 * (angle - 10.0_f64).to_radians()).cos();
        assert_relative_eq!(decay, expected, max_relative = 1e-4);
        let held = support::envelopes(&run)[2199].pendulum().angle().to_degrees() - angle;
        assert!((held / 180.0 - (held / 180.0).round()).abs() < 1e-6, "{held} deg");
        assert!(column(&run, "vas_v")[199] < 0.0 && column(&run, "vas_v")[200] == 0.0);
    }
}
