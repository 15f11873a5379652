//! Rate gyroscopes whose bias goes with the temperature: told from one that differs from run to run, and undone in other runs.

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::{Campaign, Instrument, Recording, Role, Run};
use cvg_calibration::{Identification, compensate};
use cvg_tests::angle_sensor::{Noise, find, held_out, identified, run, sensor};

/// Bias at 25 °C, deg/s, and how much more it is for a kelvin.
const BIAS_DPS: f64 = 0.1;
const PER_K: f64 = 0.02;

/// A gyroscope on a body that moves for two minutes, `warmer` K above 25 °C at each share of them; its bias follows by `per_k`,
/// beside `of_its_own`, deg/s.
fn warmed(role: Role, warmer: impl Fn(f64) -> f64, per_k: f64, of_its_own: f64, seed: u64) -> Run {
    let mut noise = Noise::new(seed);
    let (dt, mut angle, mut theta, mut rate) = (0.02f64, 0.0, 0.0, 0.0);
    let (mut t_s, mut table, mut read, mut temp_c) = (vec![], vec![], vec![], vec![]);
    for i in 0..6000 {
        rate += -0.5 * rate * dt + 60.0 * dt.sqrt() * noise.sample();
        let warmer_k = warmer(f64::from(i) / 6000.0);
        angle += rate * dt;
        theta += (0.997 * rate + BIAS_DPS + of_its_own + per_k * warmer_k) * dt + 0.002 * noise.sample();
        t_s.push(f64::from(i) * dt);
        table.push(angle);
        read.push(theta + 0.01 * noise.sample());
        temp_c.push(25.0 + warmer_k);
    }
    let columns = Recording { t_s, ..Recording::default() };
    let recording = Recording { table_deg: Some(table), theta_deg: Some(read), temp_c: Some(temp_c), ..columns };
    run(&format!("{seed}.csv"), role, recording)
}

/// So many runs to fit and two that are held out, each 3 K warmer than the last, that go through these kelvins besides.
fn campaign(runs: u64, course: fn(f64) -> f64, per_k: f64, of_its_own: f64, seed: u64) -> Campaign {
    let roles = (0..runs).map(|_| Role::Fit).chain([Role::Holdout; 2]);
    let mut draw = Noise::new(9000 + seed);
    let made = (0..).zip(roles).map(|(i, role)| {
        let from = 3.0 * (i % runs) as f64 - 4.0;
        warmed(role, |share| from + course(share), per_k, of_its_own * draw.sample(), 100 * seed + i)
    });
    Campaign {
        instrument: Instrument::Gyroscope,
        angular_gain: None,
        temperature_c: Some(25.0),
        ..sensor(made.collect())
    }
}

/// The slope, deg/s/K, with its interval.
fn slope(i: &Identification) -> Option<[f64; 3]> {
    let parameter = &find(i, "rate-offset-temperature")?.parameters[0];
    let [low, high] = parameter.ci95.unwrap();
    Some([parameter.value, low, high].map(f64::to_degrees))
}

const RAMP: fn(f64) -> f64 = |share| 10.0 * share;
const THERE_AND_BACK: fn(f64) -> f64 = |share| 10.0 * (std::f64::consts::PI * share).sin();
const NONE: fn(f64) -> f64 = |_| 0.0;

#[test]
fn a_bias_that_goes_with_the_temperature_is_told_and_undone_in_runs_that_were_held_out() {
    for (name, runs, course) in [("ramp", 4, RAMP), ("there and back", 4, THERE_AND_BACK), ("one each", 6, NONE)] {
        let mut missed = 0;
        for seed in 0..2 {
            let i = identified(campaign(runs, course, PER_K, 0.0, seed));
            let [value, low, high] = slope(&i).unwrap_or_else(|| panic!("{name}, {seed}: {:#?}", i.report.effects));
            assert!((value / PER_K - 1.0).abs() < 0.02, "{name}, {seed}: {value}");
            missed += usize::from(!(low..=high).contains(&PER_K));
            let bias = find(&i, "rate-offset").unwrap().parameters[0].value.to_degrees();
            assert!((bias - BIAS_DPS).abs() < 0.01, "{name}, {seed}: a bias of {bias} at 25 °C");
            // the angle walks by 0.1° or so in two minutes; without the slope 0.8° and more are left
            assert!(held_out(&i) < 0.12, "{name}, {seed}: {}°", held_out(&i));
            let said = i.report.warnings.iter().any(|w| w.contains("went with the time in every run"));
            assert_eq!(said, name == "ramp", "{name}, {seed}: {:?}", i.report.warnings);
        }
        assert!(missed <= 1, "{name}: {missed} of 2 intervals miss");
    }
}

#[test]
fn a_bias_that_differs_from_run_to_run_is_not_taken_for_one_that_goes_with_the_temperature() {
    let (mut claimed, mut told) = (0, 0);
    for seed in 20..23 {
        for (runs, course) in [(4, THERE_AND_BACK), (6, NONE)] {
            claimed += usize::from(slope(&identified(campaign(runs, course, 0.0, 0.1, seed))).is_some());
        }
        // beside it the slope is told all the same, where the temperature changes within the runs, unless nothing is answered
        if let Some([value, low, high]) = slope(&identified(campaign(4, THERE_AND_BACK, PER_K, 0.1, seed))) {
            assert!(
                low < PER_K && PER_K < high && (value / PER_K - 1.0).abs() < 0.05,
                "{seed}: {value} [{low}, {high}]"
            );
            told += 1;
        }
    }
    assert!(claimed == 0 && told >= 1, "{claimed} of 6 claimed, {told} of 3 told");
}

/// A table that goes to and fro with rests between, while it warms up a little: a scale factor that goes with the temperature was taken for a
/// bias that does, of 2.8e-4 deg/s/K.
#[test]
fn a_scale_factor_that_goes_with_the_temperature_is_no_bias_that_does() {
    const SCALE_PER_K: f64 = 5e-5;
    let made = (0..10u64).map(|i| {
        let mut noise = Noise::new(700 + i);
        let from_k = [-45.0, -25.0, 0.0, 25.0, 45.0][usize::try_from(i / 2).unwrap()];
        let (dt, mut theta, mut angle) = (0.01, 0.0, 0.0);
        let (mut t_s, mut table, mut read, mut temp_c) = (vec![], vec![], vec![], vec![]);
        for n in 0..4000 {
            let t = f64::from(n) * dt;
            let warmer_k = from_k + 0.5 * t / 40.0;
            let rate = if t % 10.0 < 0.5 {
                0.0
            } else if t % 20.0 < 10.0 {
                100.0
            } else {
                -100.0
            };
            angle += rate * dt;
            theta += ((1.0 + SCALE_PER_K * warmer_k) * rate + BIAS_DPS + 0.01 * noise.sample()) * dt;
            t_s.push(t);
            table.push(angle);
            read.push(theta);
            temp_c.push(25.0 + warmer_k);
        }
        let columns = Recording { t_s, ..Recording::default() };
        let recording = Recording { table_deg: Some(table), theta_deg: Some(read), temp_c: Some(temp_c), ..columns };
        run(&format!("{i}.csv"), Role::Fit, recording)
    });
    let i = identified(Campaign {
        instrument: Instrument::Gyroscope,
        angular_gain: None,
        temperature_c: Some(25.0),
        ..sensor(made.collect())
    });
    // deg/s/K, of which 1e-4 is a drift of 0.2° in 40 s at 50 K
    assert!(slope(&i).is_none_or(|[value, ..]| value.abs() < 1e-5), "{:?}", slope(&i));
}

#[test]
fn compensate_undoes_it_by_the_calibration_and_asks_for_the_temperature() {
    let i = identified(campaign(4, THERE_AND_BACK, PER_K, 0.0, 3));
    let calibration = Calibration::from_text(&i.calibration.to_text(), "calibration.toml").unwrap();
    assert_eq!(calibration, i.calibration);
    let other = warmed(Role::Fit, |share| 12.0 * share - 5.0, PER_K, 0.0, 77).recording;
    let clean = compensate(&calibration, &other).unwrap();
    let left: Vec<f64> =
        clean.theta_deg.unwrap().iter().zip(other.table_deg.as_ref().unwrap()).map(|(t, a)| t - 0.997 * a).collect();
    let largest = left.iter().fold(0.0f64, |m, e| m.max((e - left[0]).abs()));
    assert!(largest < 1.0, "{largest}° of 0.1 deg/s and 0.24 deg/s over two minutes");
    let cold = Recording { temp_c: None, ..other };
    let refusal = compensate(&calibration, &cold).map(|r| r.len()).unwrap_err().to_string();
    assert!(refusal.contains("the bias follows the temperature"), "{refusal}");
}
