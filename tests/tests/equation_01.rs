//! Equation 1: the pattern turns against the input, and the angle-dependent bias is what the best line leaves of it.

use core::f64::consts::PI;

use cvg_calibration::bias::{angle_dependent_bias, pattern_angle};
use cvg_tests::prop_assert_near;
use cvg_tests::tolerances::BIAS;
use proptest::prelude::*;

/// Input angles of a run, rad: at least half a turn in either direction, evenly in time.
fn runs() -> impl Strategy<Value = Vec<f64>> {
    (PI..100.0 * PI, any::<bool>(), 8..400_usize, -10.0..10.0_f64).prop_map(|(turn, back, samples, start)| {
        let turn = if back { -turn } else { turn };
        (0..samples).map(|n| start + turn * n as f64 / (samples - 1) as f64).collect()
    })
}

/// What a line through this many radians is known to.
fn tolerance(input: &[f64], angle: &[f64]) -> f64 {
    let largest = input.iter().chain(angle).fold(1.0_f64, |a, b| a.max(b.abs()));
    BIAS.f64 * largest
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    //= specs/equation-01.md#the-pattern-turns-against-the-input
    //= type=test
    //# The pattern angle MUST be the bias less the effective angular gain times the integral of the input rate.
    #[test]
    fn prop_the_pattern_turns_against_the_input_by_the_angular_gain(
        gain in 0.01..1.0_f64, input in -1e3..1e3_f64, turn in -10.0..10.0_f64, bias in -PI..PI,
    ) {
        let (before, after) = (pattern_angle(gain, input, bias), pattern_angle(gain, input + turn, bias));
        prop_assert_near!(after - before, -gain * turn, BIAS.f64 * (1.0 + input.abs()));
        prop_assert_eq!(pattern_angle(gain, 0.0, bias), bias);
    }

    //= specs/equation-01.md#the-gain-keeps-its-sign
    //= type=test
    //# Reversing the input MUST reverse the change of the pattern angle and leave the effective angular gain as it was.
    /// The gain is read back from the turn of the pattern, in either direction: it is the device's own, with its sign.
    #[test]
    fn prop_reversing_the_input_reverses_the_pattern_and_keeps_the_gain(
        gain in prop_oneof![0.01..1.0_f64, -1.0..-0.01_f64], input in 1e-2..1e3_f64, bias in -PI..PI,
    ) {
        let turned = |input: f64| pattern_angle(gain, input, bias) - pattern_angle(gain, 0.0, bias);
        prop_assert_near!(turned(-input), -turned(input), 2.0 * BIAS.f64 * (1.0 + input));
        for input in [input, -input] {
            prop_assert_near!(-turned(input) / input, gain, 4.0 * f64::EPSILON * (PI / input.abs() + 1.0));
        }
    }

    //= specs/equation-01.md#the-bias-is-what-the-best-line-leaves
    //= type=test
    //# The angle-dependent bias MUST be the unwrapped pattern angle less the least-squares line of it over the input angle.
    #[test]
    fn prop_an_ideal_instrument_has_no_angle_dependent_bias(input in runs(), gain in -1.0..1.0_f64, bias in -PI..PI) {
        let angle: Vec<_> = input.iter().map(|&i| pattern_angle(gain, i, bias)).collect();
        for left in angle_dependent_bias(&input, &angle) {
            prop_assert_near!(left, 0.0, tolerance(&input, &angle));
        }
    }

    //= specs/equation-01.md#a-constant-angle-is-no-bias
    //= type=test
    //# Adding a constant to every pattern angle MUST NOT change the angle-dependent bias.
    #[test]
    fn prop_another_angular_gain_or_a_constant_is_no_angle_dependent_bias(
        input in runs(), gain in -1.0..1.0_f64, constant in -PI..PI, amplitude in 0.0..0.1_f64,
    ) {
        let rippled: Vec<_> = input.iter().map(|i| amplitude * (2.0 * i).sin()).collect();
        let tilted: Vec<_> = input.iter().zip(&rippled).map(|(&i, r)| r + pattern_angle(gain, i, constant)).collect();
        let (plain, same) = (angle_dependent_bias(&input, &rippled), angle_dependent_bias(&input, &tilted));
        for (a, b) in plain.into_iter().zip(same) {
            prop_assert_near!(b, a, tolerance(&input, &tilted));
        }
    }

    //= specs/equation-01.md#the-bias-is-what-the-best-line-leaves
    //= type=test
    //# The angle-dependent bias MUST be the unwrapped pattern angle less the least-squares line of it over the input angle.
    /// Least squares: what is left has no mean and no slope.
    #[test]
    fn prop_the_best_line_leaves_neither_a_mean_nor_a_slope(
        input in runs(), amplitude in 0.0..0.1_f64, harmonic in 1..9_i32, phase in -PI..PI,
    ) {
        let angle: Vec<_> = input.iter().map(|i| 0.78 * i + amplitude * (f64::from(harmonic) * i + phase).cos()).collect();
        let bias = angle_dependent_bias(&input, &angle);
        let n = bias.len() as f64;
        let middle = input.iter().sum::<f64>() / n;
        let reach = input.iter().map(|i| (i - middle).abs()).fold(0.0, f64::max);
        prop_assert_near!(bias.iter().sum::<f64>() / n, 0.0, tolerance(&input, &angle));
        let slope = bias.iter().zip(&input).map(|(b, i)| b * (i - middle) / reach).sum::<f64>() / n;
        prop_assert_near!(slope, 0.0, tolerance(&input, &angle));
    }
}

#[test]
fn a_harmonic_of_the_pattern_survives_the_line() {
    let input: Vec<f64> = (0..10_000).map(|n| f64::from(n) * 20.0 * PI / 10_000.0).collect();
    let angle: Vec<_> = input.iter().map(|&i| pattern_angle(0.78, i, 0.2) + 0.01 * (4.0 * i).cos()).collect();
    let bias = angle_dependent_bias(&input, &angle);
    for (b, i) in bias.iter().zip(&input) {
        approx::assert_abs_diff_eq!(*b, 0.01 * (4.0 * i).cos(), epsilon = 1e-5);
    }
}

//= specs/equation-01.md#the-pattern-turns-against-the-input
//= type=test
//# The pattern angle MUST be the bias less the effective angular gain times the integral of the input rate.
#[test]
fn snapshot_of_the_angle_over_the_input_rotation() {
    // k_e = 0.78 and a bias of 5°, as a whole-angle gyroscope shows them over a turn of its table
    let mut table = String::from("input_deg  theta_deg  theta_deg_turned_back\n");
    for input_deg in (0..=360_i32).step_by(45) {
        let input = f64::from(input_deg).to_radians();
        let there = pattern_angle(0.78, input, 5_f64.to_radians()).to_degrees();
        let back = pattern_angle(0.78, -input, 5_f64.to_radians()).to_degrees();
        // summed over a thousand steps of the table, in degrees
        let step = -0.78 * f64::from(input_deg) / 1000.0;
        let [forth, reverse] = [step, -step].map(|step| (0..1000).fold(5.0, |theta, _| theta + step));
        approx::assert_abs_diff_eq!(there, forth, epsilon = 1e-9);
        approx::assert_abs_diff_eq!(back, reverse, epsilon = 1e-9);
        table += &format!("{input_deg:9}{forth:11.3}{reverse:23.3}\n");
    }
    insta::assert_snapshot!(table);
}
