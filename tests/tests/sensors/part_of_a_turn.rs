//! Angle sensors that were calibrated over a part of their turn: what is found there, and what is made of the rest.

use cvg_calibration::compensate;
use cvg_calibration::recording::{Role, Run};
use cvg_tests::angle_sensor::{Noise, angle_at, held_out, identified, lines, sensor};

/// Error of a magnetic encoder off its axis, deg.
fn encoder_error(degrees: f64) -> f64 {
    let a = degrees.to_radians();
    0.3 * (a + 0.4).cos() + 0.42 * (2.0 * a - 1.0).sin() + 0.05 * (3.0 * a).cos() + 0.02 * (5.0 * a + 2.0).sin()
}

/// 200 stations a turn, those of the arc that begins at `from`, of which every third is held out.
fn arc(from: u32, stations: u32, error: impl Fn(f64) -> f64, seed: u64) -> Vec<Run> {
    let mut noise = Noise::new(seed);
    let mut of = |held: bool, role| {
        let met = (0..stations).filter(|i| (i % 3 == 1) == held).map(|i| 1.8 * f64::from(from + i)).collect();
        angle_at(met, |degrees| degrees + error(degrees) + 0.005 * noise.sample(), role)
    };
    vec![of(false, Role::Fit), of(true, Role::Holdout)]
}

fn root_mean_square_about_mean(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// Harmonics that all but cancel on the arc made 50° of error elsewhere. Beyond it the table is smooth, and `compensate` says that it is
/// extrapolated: of half a turn it may still be twice the error.
#[test]
fn a_table_of_an_arc_is_no_worse_elsewhere_than_none_and_compensate_says_so() {
    let (mut worst, mut sum) = (0.0f64, 0.0);
    let arcs = [(125, 0), (125, 60), (145, 120), (145, 10)];
    for (seed, (stations, from)) in (0..).zip(arcs) {
        let i = identified(sensor(arc(from, stations, encoder_error, seed)));
        assert!(held_out(&i) < 0.015, "{stations} from {from}: {}° left of 0.005° noise", held_out(&i));
        let beyond: Vec<f64> = (stations..200).map(|i| 1.8 * f64::from(from + i)).collect();
        let raw: Vec<f64> = beyond.iter().map(|d| encoder_error(*d)).collect();
        let elsewhere = angle_at(beyond.clone(), |degrees| degrees + encoder_error(degrees), Role::Fit).recording;
        let clean = compensate(&i.calibration, &elsewhere).unwrap();
        let said: Vec<_> = clean.warnings.iter().filter(|w| w.contains("its table is extrapolated there")).collect();
        assert_eq!(said.len(), 1, "{:?}", clean.warnings);
        let left: Vec<f64> = clean.theta_deg.unwrap().iter().zip(&beyond).map(|(t, d)| t - d).collect();
        let share = root_mean_square_about_mean(&left) / root_mean_square_about_mean(&raw);
        println!("{stations} stations from {from}: {share:.2} of the error elsewhere");
        (worst, sum) = (worst.max(share), sum + share);
        // where it was calibrated there is nothing to say
        let within = arc(from, stations, encoder_error, seed + 10).remove(1).recording;
        assert!(compensate(&i.calibration, &within).unwrap().warnings.is_empty());
    }
    assert!(worst < 1.2 && sum < 0.8 * arcs.len() as f64, "{worst} at most, {sum} in all");
}

/// Cogging of the motor that turns the encoder, on five eighths of a turn of 128 stations.
#[test]
fn lines_of_a_motor_are_found_on_an_arc() {
    let cogging = |degrees: f64| {
        let a = degrees.to_radians();
        0.1 * a.cos() + 0.4 * (12.0 * a + 0.3).cos() + 0.3 * (14.0 * a).sin()
    };
    for seed in 0..3 {
        let i = identified(sensor(arc(40, 125, cogging, seed)));
        // 12 may be in the table; what the sensor reads is off by them, which makes their sums
        let found = lines(&i);
        assert!(held_out(&i) < 0.02 && found.contains(&14.0), "seed {seed}: {}°, {found:?}", held_out(&i));
        assert!(found.iter().all(|n| [12.0, 14.0, 24.0, 26.0, 28.0].contains(n)), "seed {seed}: {found:?}");
    }
}

/// Two harmonics on 18 stations over seven tenths of a turn, two of nine held-out ones a little beyond them.
#[test]
fn a_few_stations_beyond_the_fitted_ones_do_not_keep_a_table_from_the_rest() {
    let error = |degrees: f64| {
        let a = degrees.to_radians();
        0.15 * (a + 0.5).sin() + 0.25 * (2.0 * a).cos()
    };
    let held = [6, 7, 14, 16, 18, 22, 23, 25, 26];
    for seed in 0..4 {
        let mut noise = Noise::new(seed);
        let mut of = |is_held: bool, role| {
            let met = (0..27).filter(|i| held.contains(i) == is_held && ![11, 12].contains(i));
            angle_at(met.map(|i| 7.0 + 10.6 * f64::from(i)).collect(), |d| d + error(d) + 0.03 * noise.sample(), role)
        };
        let i = identified(sensor(vec![of(false, Role::Fit), of(true, Role::Holdout)]));
        assert!(held_out(&i) < 0.06, "seed {seed}: {}° left of 0.03° noise", held_out(&i));
    }
}

/// Stations on two arcs with 62° and 56° between them: a table that is free there left five times the error that it was to undo.
#[test]
fn a_table_between_two_arcs_is_no_worse_than_none() {
    let error = |degrees: f64| {
        let a = degrees.to_radians();
        9.0 * (a + 0.3).cos() + 4.0 * (2.0 * a).sin() + 1.5 * (3.0 * a - 0.5).cos()
    };
    for seed in 0..6 {
        let mut noise = Noise::new(seed);
        let met = (0..12).map(|i| 10.0 * f64::from(i)).chain((0..14).map(|i| 172.0 + 9.5 * f64::from(i)));
        let mut read = |degrees: f64| degrees + error(degrees) + 1.5 * noise.sample();
        let fitted = angle_at(met.collect(), &mut read, Role::Fit);
        let between: Vec<f64> =
            (0..10).map(|i| 115.0 + 5.0 * f64::from(i)).chain((0..9).map(|i| 300.0 + 5.5 * f64::from(i))).collect();
        let between = angle_at(between, &mut read, Role::Holdout);
        let raw = root_mean_square_about_mean(
            &between
                .recording
                .theta_deg
                .iter()
                .flatten()
                .zip(between.recording.table_deg.iter().flatten())
                .map(|(a, b)| a - b)
                .collect::<Vec<_>>(),
        );
        let i = identified(sensor(vec![fitted, between]));
        assert!(held_out(&i) < 0.8 * raw, "seed {seed}: {}° of {raw}°", held_out(&i));
    }
}
