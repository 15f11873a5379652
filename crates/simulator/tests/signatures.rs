//! Every effect of the library, put alone into a perfect gyroscope, changes its recording as its signature says.

mod support;

use approx::assert_relative_eq;
use cvg_estimator::Period;
use cvg_model::effects::EffectId;
use support::{ANGULAR_GAIN, Harmonic, angle_harmonics, angles, column, envelopes, fit, rotation, rotation_with};

/// Precession rate kΩ in rad/s at a rate in deg/s.
fn k_omega(rate_dps: f64) -> f64 {
    ANGULAR_GAIN * rate_dps.to_radians()
}

/// Harmonics `ns` of the pattern in a command, relative to −a/τ.
fn relative_energy_command(effect: &str, ns: &[f64]) -> Vec<Harmonic> {
    let run = rotation(effect, 20.0, 60.0);
    let theta = angles(&run, Period::Pattern);
    let relative: Vec<f64> = column(&run, "vas_v").iter().map(|v| -22.0 * v).collect();
    fit(&relative, &[], &theta, ns).1
}

fn close(got: f64, expected: f64) {
    assert_relative_eq!(got, expected, max_relative = 0.1);
}

#[test]
fn detection_gain_mismatch_is_a_sine_of_2_theta_at_any_rate() {
    for rate in [500.0, 50.0, -200.0] {
        let run = rotation(r#"{ id = "detection-gain-mismatch", detection_gain_ratio = 1.002 }"#, rate, 20.0);
        close(angle_harmonics(&run, &[2.0])[0].sin, 1e-3);
    }
}

#[test]
fn detection_skew_is_a_cosine_of_2_theta() {
    let run = rotation(r#"{ id = "detection-skew", skew = 2e-3 }"#, 500.0, 10.0);
    close(angle_harmonics(&run, &[2.0])[0].cos, 1e-3);
}

#[test]
fn detection_offset_is_a_first_harmonic_that_shrinks_with_the_amplitude() {
    for amplitude in [1.0, 0.5] {
        let keys = format!("amplitude_v = {amplitude:?}");
        let run =
            rotation_with(&keys, r#"{ id = "detection-offset", offset_x = 1e-3, offset_y = -5e-4 }"#, 500.0, 10.0);
        let first = angle_harmonics(&run, &[1.0, 2.0])[0];
        // the pattern's angle leaves the sense open: both signs of the first harmonic are the same pattern
        let sense = if first.sin < 0.0 { 1.0 } else { -1.0 };
        close(sense * first.cos, -5e-4 / amplitude);
        close(sense * first.sin, -1e-3 / amplitude);
    }
}

#[test]
fn detection_quintic_is_a_sine_of_4_theta_that_grows_with_the_fourth_power_of_the_amplitude() {
    for amplitude in [1.0, 0.6] {
        let keys = format!("amplitude_v = {amplitude:?}");
        let run = rotation_with(&keys, r#"{ id = "detection-quintic", kappa_5 = 0.004 }"#, 500.0, 10.0);
        close(angle_harmonics(&run, &[4.0])[0].sin, -5.0 / 32.0 * 0.004 * f64::powi(amplitude, 4));
    }
}

#[test]
fn detection_cubic_is_a_sine_of_4_theta_that_grows_with_the_square_of_the_amplitude() {
    for amplitude in [1.0, 0.6] {
        let keys = format!("amplitude_v = {amplitude:?}");
        let run = rotation_with(&keys, r#"{ id = "detection-cubic", kappa = 0.004 }"#, 500.0, 10.0);
        close(angle_harmonics(&run, &[4.0])[0].sin, -3.0 / 16.0 * 0.004 * amplitude * amplitude);
    }
}

#[test]
fn detection_saturation_sets_in_at_its_threshold_with_4_and_8_theta_in_a_fixed_ratio() {
    let run = |inverse_clip: f64| {
        let effect = format!(r#"{{ id = "detection-saturation", inverse_clip = {inverse_clip:?} }}"#);
        // slow, so that the energy loop follows
        angle_harmonics(&rotation(&effect, 20.0, 60.0), &[4.0, 8.0])
    };
    assert!(run(0.99)[0].amplitude() < 1e-6);
    // the describing function on a line orbit whose measured energy is held at 1
    let gain = |d: f64| {
        if d > 1.0 {
            ((1.0 / d).asin() + (1.0 / d) * (1.0 - 1.0 / (d * d)).sqrt()) / core::f64::consts::FRAC_PI_2
        } else {
            1.0
        }
    };
    let inverse_clip = 1.1;
    let (mut theta, mut error) = (Vec::new(), Vec::new());
    for i in 0..720 {
        let (sin, cos) = f64::from(i).to_radians().sin_cos();
        let mut a = 1.0;
        let mut read = (cos, sin);
        for _ in 0..50 {
            read = (a * cos * gain(inverse_clip * a * cos.abs()), a * sin * gain(inverse_clip * a * sin.abs()));
            a /= read.0.hypot(read.1);
        }
        let off = (read.1 * cos - read.0 * sin).atan2(read.0 * cos + read.1 * sin);
        theta.push(f64::from(i).to_radians() + off);
        error.push(off);
    }
    let expected = fit(&error, &[], &theta, &[4.0, 8.0]).1;
    for (got, expected) in run(inverse_clip).iter().zip(expected) {
        close(got.sin, expected.sin);
    }
}

#[test]
fn actuation_gain_mismatch_is_a_cosine_of_2_theta_in_the_energy_command() {
    let effect = r#"{ id = "actuation-gain-mismatch", actuation_gain_ratio = 1.02 }"#;
    close(relative_energy_command(effect, &[2.0])[0].cos, -0.01);
}

#[test]
fn actuation_skew_is_a_sine_of_2_theta_in_the_energy_command() {
    let effect = r#"{ id = "actuation-skew", actuation_skew = 0.02 }"#;
    close(relative_energy_command(effect, &[2.0])[0].sin, -0.01);
}

#[test]
fn anisodamping_is_in_the_angle_inversely_to_the_rate_and_in_the_energy_command() {
    let effect = r#"{ id = "anisodamping", anisodamping = 4e-3, theta_tau = 22.5 }"#;
    for rate in [500.0, 100.0, -100.0] {
        let second = angle_harmonics(&rotation(effect, rate, 20.0), &[2.0])[0];
        close(second.cos, 4e-3 / (4.0 * k_omega(rate)) * 0.5_f64.sqrt());
        close(second.sin, 4e-3 / (4.0 * k_omega(rate)) * 0.5_f64.sqrt());
    }
    let command = relative_energy_command(effect, &[2.0])[0];
    close(command.cos, 0.5 * 4e-3 * 22.0 * 0.5_f64.sqrt());
    close(command.sin, 0.5 * 4e-3 * 22.0 * 0.5_f64.sqrt());
}

#[test]
fn anisoelasticity_is_a_sine_of_2_theta_in_the_quadrature_command() {
    let run = rotation(r#"{ id = "anisoelasticity", anisoelasticity = 0.25, theta_omega = 22.5 }"#, 20.0, 60.0);
    let second = fit(column(&run, "vqc_v"), &[], &angles(&run, Period::Pattern), &[2.0]).1[0];
    close(second.sin, 0.5 * 0.25 * 0.5_f64.sqrt());
    close(second.cos, -0.5 * 0.25 * 0.5_f64.sqrt());
}

#[test]
fn actuation_phase_turns_the_pattern_by_what_holds_the_split() {
    let axis = 20_f64.to_radians();
    let split = r#"{ id = "anisoelasticity", anisoelasticity = 0.25, theta_omega = 20.0 }"#;
    for rate in [20.0, -20.0, 10.0] {
        let second = |effects: &str| angle_harmonics(&rotation(effects, rate, 120.0), &[2.0, 4.0])[0];
        let late = second(&format!(r#"{split}, {{ id = "actuation-phase", actuation_phase = 0.02 }}"#));
        let plain = second(split);
        let expected = 0.02 * 0.25 / (4.0 * k_omega(rate));
        close(late.cos - plain.cos, expected * (2.0 * axis).cos());
        close(late.sin - plain.sin, expected * (2.0 * axis).sin());
    }
}

#[test]
fn drive_saturation_asks_for_more_energy_command_at_multiples_of_90_degrees() {
    // the describing function, of a command over the level
    let gain = |d: f64| {
        if d > 1.0 {
            ((1.0 / d).asin() + (1.0 / d) * (1.0 - 1.0 / (d * d)).sqrt()) / core::f64::consts::FRAC_PI_2
        } else {
            1.0
        }
    };
    let run = |level: f64| {
        let effect = format!(r#"{{ id = "drive-saturation", inverse_level = {:?} }}"#, 22.0 / level);
        relative_energy_command(&effect, &[4.0, 8.0])[0]
    };
    assert!(run(1.02).amplitude() < 1e-5);
    for level in [0.96, 0.93] {
        let (mut theta, mut command) = (Vec::new(), Vec::new());
        for i in 0..720 {
            let (sin, cos) = (0.5 * f64::from(i)).to_radians().sin_cos();
            let mut v = 1.0;
            for _ in 0..200 {
                let along = gain(v * cos.abs() / level) * cos * cos + gain(v * sin.abs() / level) * sin * sin;
                v += 0.5 * (1.0 / along - v);
            }
            theta.push((0.5 * f64::from(i)).to_radians());
            command.push(v);
        }
        close(run(level).cos, fit(&command, &[], &theta, &[4.0, 8.0]).1[0].cos);
    }
}

#[test]
fn detection_phase_turns_the_pattern_through_a_split_at_4_theta() {
    let axis = 20_f64.to_radians();
    let split = r#"{ id = "anisoelasticity", anisoelasticity = 0.25, theta_omega = 20.0 }"#;
    // slow enough for the loops to follow: a true quadrature alone gave twice as much, but the lock's phase goes with the
    // pattern too, and turns half of it back through the force that holds the split
    for rate in [10.0, -10.0, 5.0] {
        let fourth = |effects: &str| angle_harmonics(&rotation(effects, rate, 120.0), &[2.0, 4.0])[1];
        let lagging = fourth(&format!(r#"{split}, {{ id = "detection-phase", phase_difference = 0.02 }}"#));
        let alone = fourth(split);
        let expected = -0.25 * 0.02_f64.sin() / (32.0 * k_omega(rate));
        close(lagging.cos - alone.cos, expected * (2.0 * axis).cos());
        close(lagging.sin - alone.sin, expected * (2.0 * axis).sin());
    }
}

#[test]
fn drive_feedthrough_is_a_share_of_the_commands() {
    let split = r#"{ id = "anisoelasticity", anisoelasticity = 0.25, theta_omega = 22.5 }"#;
    for rate in [100.0, -50.0] {
        let second = |effects: &str| angle_harmonics(&rotation(effects, rate, 40.0), &[2.0, 4.0])[0];
        // across the pattern in phase: the quadrature command, at 2θ through the split
        let alike = r#"{ id = "drive-feedthrough", x_in_phase = 5e-3, y_in_phase = 5e-3 }"#;
        let both = format!("{split}, {alike}");
        let (fed, alone, run) = (second(&both), second(split), rotation(&both, rate, 40.0));
        let command = fit(column(&run, "vqc_v"), &[], &angles(&run, Period::Pattern), &[2.0]).1[0];
        close(fed.sin - alone.sin, 5e-3 * command.sin);
        close(fed.cos - alone.cos, 5e-3 * command.cos);
        // along the pattern in phase: the energy command, which holds against the damping, as a mismatch of the gains
        let unlike = r#"{ id = "drive-feedthrough", x_quadrature = 0.01, y_quadrature = -0.03 }"#;
        close(second(unlike).sin, 0.5 / 22.0 * (0.01 + 0.03));
    }
}

#[test]
fn spring_cubic_is_a_fourth_harmonic_that_shrinks_with_the_rate() {
    for rate in [500.0, 100.0, -100.0] {
        let run = rotation(r#"{ id = "spring-cubic", p = 0.02, phase = 30.0 }"#, rate, 20.0);
        let fourth = angle_harmonics(&run, &[4.0])[0];
        let expected = 0.02 / (4.0 * k_omega(rate));
        close(fourth.cos, expected * 30_f64.to_radians().cos());
        close(fourth.sin, -expected * 30_f64.to_radians().sin());
    }
}

#[test]
fn table_harmonic_follows_the_table_and_not_the_pattern() {
    let (rate, n, w) = (100.0, 3.0, 2e-3);
    let effect = r#"{ id = "table-harmonic", n = 3, w = 2e-3, phase = 40.0 }"#;
    let run = rotation(effect, rate, 40.0);
    let t = column(&run, "t_s");
    let nominal: Vec<f64> = t.iter().map(|t| rate.to_radians() * t).collect();
    let phase = 40_f64.to_radians();
    let third = fit(&angles(&run, Period::Pattern), &[t], &nominal, &[n]).1[0];
    close(third.sin, -ANGULAR_GAIN * w / n * phase.cos());
    close(third.cos, -ANGULAR_GAIN * w / n * phase.sin());
    // the table's own angle shows it, the commanded rate does not
    let table: Vec<f64> = column(&run, "table_deg").iter().map(|d| d.to_radians()).collect();
    close(fit(&table, &[t], &nominal, &[n]).1[0].sin, w / n * phase.cos());
    assert!(column(&run, "rate_dps").iter().all(|r| *r == rate));
    // and against the table's angle nothing is left
    let rest = fit(&angles(&run, Period::Pattern), &[&table], &nominal, &[n]).1[0];
    assert!(rest.amplitude() < 1e-3 * w);
}

#[test]
fn rate_offset_is_a_ramp_that_the_table_does_not_turn() {
    let ramp = |offset: f64| {
        let run = rotation(&format!(r#"{{ id = "rate-offset", rate_offset = {offset:?} }}"#), 200.0, 40.0);
        let table = column(&run, "table_deg").iter().map(|d| ANGULAR_GAIN * d.to_radians());
        let beside: Vec<f64> = angles(&run, Period::Pattern).iter().zip(table).map(|(theta, t)| theta + t).collect();
        fit(&beside, &[column(&run, "t_s")], &[], &[]).0[0]
    };
    close(ramp(1e-4) - ramp(0.0), -1e-4 * ANGULAR_GAIN);
}

#[test]
fn scale_drift_is_quadratic_in_time() {
    let run = rotation(r#"{ id = "scale-drift", scale_drift = 1e-5 }"#, 200.0, 40.0);
    let t = column(&run, "t_s");
    let squared: Vec<f64> = t.iter().map(|t| t * t).collect();
    let (lines, _) = fit(&angles(&run, Period::Pattern), &[t, &squared], &[], &[]);
    close(lines[1], -0.5 * 1e-5 * k_omega(200.0));
    // it is the instrument's, not the table's
    let table = column(&run, "table_deg");
    assert_relative_eq!(table[3999], 200.0 * t[3999], max_relative = 1e-9);
}

#[test]
fn gain_drift_is_a_sine_of_2_theta_that_grows_in_time() {
    let run = rotation(r#"{ id = "gain-drift", gain_drift = 1e-4 }"#, 500.0, 40.0);
    let (t, theta) = (column(&run, "t_s"), angles(&run, Period::Pattern));
    let growing: Vec<f64> = t.iter().zip(&theta).map(|(t, theta)| t * (2.0 * theta).sin()).collect();
    let (lines, _) = fit(&theta, &[t, &growing], &theta, &[2.0]);
    close(lines[1], 0.5 * 1e-4);
}

#[test]
fn temperature_is_a_sine_of_2_theta_in_proportion_to_it() {
    let effect = r#"{ id = "temperature", gain_per_k = 1e-4 }"#;
    for start_c in [45.0, 5.0] {
        let keys = format!("temperature = {{ start_c = {start_c:?} }}");
        let second = angle_harmonics(&rotation_with(&keys, effect, 500.0, 10.0), &[2.0])[0];
        close(second.sin, 0.5e-4 * (start_c - 25.0));
    }
}

#[test]
fn skew_temperature_is_half_of_one_plus_a_cosine_of_2_theta_in_proportion_to_it() {
    let effect = r#"{ id = "skew-temperature", skew_per_k = 1e-4 }"#;
    for start_c in [45.0, 5.0] {
        let keys = format!("temperature = {{ start_c = {start_c:?} }}");
        let second = angle_harmonics(&rotation_with(&keys, effect, 500.0, 10.0), &[2.0])[0];
        close(second.cos, 0.5e-4 * (start_c - 25.0));
    }
}

/// At one temperature what follows it is the effect at the value that it has there.
#[test]
fn what_follows_the_temperature_is_at_each_what_it_follows() {
    let pairs = [
        (r#"id = "temperature", gain_per_k = 1e-3"#, r#"id = "detection-gain-mismatch", detection_gain_ratio = 1.02"#),
        (r#"id = "skew-temperature", skew_per_k = 1e-3"#, r#"id = "detection-skew", skew = 0.02"#),
        (r#"id = "cubic-temperature", kappa_per_k = 2e-4"#, r#"id = "detection-cubic", kappa = 4e-3"#),
        (
            r#"id = "detection-offset-temperature", offset_x_per_k = 1e-4, offset_y_per_k = -2e-4"#,
            r#"id = "detection-offset", offset_x = 2e-3, offset_y = -4e-3"#,
        ),
        (
            r#"id = "anisodamping-temperature", anisodamping_per_k = 2e-4, theta_slope = 27.0"#,
            r#"id = "anisodamping", anisodamping = 4e-3, theta_tau = 27.0"#,
        ),
        (
            r#"id = "anisoelasticity-temperature", anisoelasticity_per_k = 1e-2, theta_slope = 55.0"#,
            r#"id = "anisoelasticity", anisoelasticity = 0.2, theta_omega = 55.0"#,
        ),
        (
            r#"id = "actuation-gain-temperature", actuation_gain_per_k = 1e-3"#,
            r#"id = "actuation-gain-mismatch", actuation_gain_ratio = 1.02"#,
        ),
        (
            r#"id = "actuation-skew-temperature", actuation_skew_per_k = 1e-3"#,
            r#"id = "actuation-skew", actuation_skew = 0.02"#,
        ),
    ];
    for (followed, at_its_value) in pairs {
        let run = |effect| rotation_with("temperature = { start_c = 45.0 }", &format!("{{ {effect} }}"), 200.0, 4.0);
        let (run, expected) = (run(followed), run(at_its_value));
        for name in ["xc_v", "ys_v", "vas_v", "vqc_v"] {
            let off = column(&run, name).iter().zip(column(&expected, name)).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0, f64::max);
            // mechanics that change act in half steps on either side of a step: an error of third order in it
            assert!(off < 1e-6, "{followed}: {name} is off by {off}");
        }
    }
}

#[test]
fn scale_temperature_turns_the_pattern_further_in_proportion_to_it() {
    let effect = r#"{ id = "scale-temperature", scale_per_k = 1e-4 }"#;
    for start_c in [45.0, 5.0] {
        let keys = format!("temperature = {{ start_c = {start_c:?} }}");
        let run = rotation_with(&keys, effect, 200.0, 10.0);
        let (lines, _) = fit(&angles(&run, Period::Pattern), &[column(&run, "t_s")], &[], &[]);
        close(lines[0] + k_omega(200.0), -1e-4 * (start_c - 25.0) * k_omega(200.0));
    }
}

#[test]
fn time_periodic_is_a_line_in_time_at_any_rate() {
    for rate in [500.0, 200.0] {
        let run = rotation(r#"{ id = "time-periodic", frequency = 7.3, amplitude = 1e-3, phase = 50.0 }"#, rate, 10.0);
        let t = column(&run, "t_s");
        let phase: Vec<f64> = t.iter().map(|t| core::f64::consts::TAU * 7.3 * t).collect();
        let line = fit(&angles(&run, Period::Pattern), &[t], &phase, &[1.0]).1[0];
        close(line.cos, 1e-3 * 50_f64.to_radians().cos());
        close(line.sin, -1e-3 * 50_f64.to_radians().sin());
    }
}

#[test]
fn harmonic_n_is_that_harmonic_of_the_pattern() {
    let run = rotation(r#"{ id = "harmonic-n", n = 6, amplitude = 1e-3, phase = 70.0 }"#, 300.0, 10.0);
    let sixth = angle_harmonics(&run, &[2.0, 4.0, 6.0])[2];
    close(sixth.cos, 1e-3 * 70_f64.to_radians().cos());
    close(sixth.sin, -1e-3 * 70_f64.to_radians().sin());
}

#[test]
fn angle_latency_is_a_constant_that_changes_sign_with_the_rate() {
    let intercept = |rate: f64, latency: f64| {
        let effect = format!(r#"{{ id = "angle-latency", latency = {latency:?} }}"#);
        // from the start, before forces at the late angle precess the pattern
        let run = rotation_with("warm_up_s = 0.0", &effect, rate, 1.0);
        angles(&run, Period::Pattern)[0]
    };
    for rate in [500.0, -500.0, 100.0] {
        close(intercept(rate, 1e-3) - intercept(rate, 0.0), k_omega(rate) * 1e-3);
    }
}

#[test]
fn drive_quantisation_makes_the_loops_ask_for_half_a_step_where_less_would_do() {
    // of the largest command of an axis, over what replaces the damping
    let asked = |effect: &str| {
        let run = rotation(effect, 20.0, 60.0);
        let theta = angles(&run, Period::Pattern);
        let all = theta.iter().zip(column(&run, "vas_v")).map(|(theta, v)| {
            let (sin, cos) = theta.sin_cos();
            22.0 * v.abs() * sin.abs().max(cos.abs())
        });
        let mut all: Vec<f64> = all.collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    close(asked(""), 0.9);
    for steps in [4.0, 8.0] {
        let effect = format!(r#"{{ id = "drive-quantisation", step = {:?} }}"#, steps / 22.0);
        close(asked(&effect), 0.5 * steps);
    }
}

#[test]
fn the_readout_of_the_amplitude_is_held_by_the_energy_loop() {
    // the amplitude signature of a readout effect is in the true energy: what is read stays at the set point
    let run = rotation(r#"{ id = "detection-gain-mismatch", detection_gain_ratio = 1.02 }"#, 10.0, 20.0);
    for e in envelopes(&run) {
        assert_relative_eq!(e.pendulum().e, 1.0, epsilon = 1e-3);
    }
}

#[test]
fn no_effect_of_the_library_is_left_out_here() {
    let source = include_str!("signatures.rs");
    for id in EffectId::ALL {
        assert!(source.contains(&format!("id = \"{id}\"")), "no test has {id}");
    }
}
