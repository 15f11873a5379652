//! What one pass does not tell and another does: errors that a memory of the noise would make as well.

use cvg_calibration::Identification;
use cvg_calibration::recording::{Recording, Role, Run};
use cvg_tests::angle_sensor::{Noise, a_row_a_second, held_out, identified, run, sensor};

const HEADINGS: usize = 36;

/// A wind vane on a mast: what its boom and the mast's wake make of it, deg. None of it is a harmonic or two.
fn wakes(degrees: f64) -> f64 {
    let wake = |at: f64, width: f64| (-(((degrees - at + 180.0).rem_euclid(360.0) - 180.0) / width).powi(2)).exp();
    0.7 * (degrees.to_radians() - 1.2).cos() - 2.3 * wake(2.0, 12.0) - 1.6 * wake(52.0, 14.0) - 1.4 * wake(157.0, 16.0)
}

/// A heading of every 10°, off by these.
fn card(errors: &[f64], role: Role) -> Run {
    let headings = (0..HEADINGS).map(|i| 10.0 * i as f64).collect();
    let mut errors = errors.iter();
    a_row_a_second(headings, |degrees| degrees + errors.next().unwrap(), role)
}

/// Noise that remembers this share of itself from one heading to the next, of 1°.
fn remembered(memory: f64, count: usize, seed: u64) -> Vec<f64> {
    let mut noise = Noise::new(seed);
    let mut last = noise.sample();
    let mut next = || {
        last = memory * last + (1.0 - memory * memory).sqrt() * noise.sample();
        last
    };
    (0..count).map(|_| next()).collect()
}

/// What is said where another pass told.
fn told_by_another_pass(i: &Identification) -> bool {
    i.report.warnings.iter().any(|w| w.contains("a held-out run, another pass, tells"))
}

#[test]
fn an_error_card_that_repeats_is_an_answer_where_a_memory_would_explain_it_as_well() {
    let mut told = 0;
    for seed in 0..8 {
        let mut noise = Noise::new(seed);
        // no table has the rest of it, which is the vane's all the same
        let rest: Vec<f64> = (0..HEADINGS).map(|_| 0.3 * noise.sample()).collect();
        let mut read = || (0..HEADINGS).map(|i| wakes(10.0 * i as f64) + rest[i] + 0.1 * noise.sample()).collect();
        let [fit, held]: [Vec<f64>; 2] = [read(), read()];
        let i = identified(sensor(vec![card(&fit, Role::Fit), card(&held, Role::Holdout)]));
        let raw = i.report.heldout.raw.unwrap().rms_deg;
        println!("seed {seed}: {raw:.3}° to {:.3}°", held_out(&i));
        if told_by_another_pass(&i) {
            told += 1;
            assert!(held_out(&i) < 0.8 * raw, "seed {seed}: {}° left of {raw}°", held_out(&i));
        }
    }
    assert!(told >= 4, "{told} of 8");
}

/// One turn of noise, a row a second, of which every third row is held out.
fn thirds(noise: &[f64]) -> Vec<Run> {
    let of = |held: bool, role| {
        let rows: Vec<usize> = (0..noise.len()).filter(|row| (row % 3 == 2) == held).collect();
        let angle = |row: usize| 360.0 * row as f64 / noise.len() as f64;
        let recording = Recording {
            t_s: rows.iter().map(|row| *row as f64).collect(),
            table_deg: Some(rows.iter().map(|row| angle(*row)).collect()),
            theta_deg: Some(rows.iter().map(|row| angle(*row) + noise[*row]).collect()),
            ..Recording::default()
        };
        run("thirds.csv", role, recording)
    };
    vec![of(false, Role::Fit), of(true, Role::Holdout)]
}

#[test]
fn noise_with_a_memory_is_none_in_another_pass_nor_in_rows_taken_out_of_one() {
    for seed in 0..12 {
        for memory in [0.6, 0.9, 0.98] {
            let of = |seed, role| card(&remembered(memory, HEADINGS, seed), role);
            let i = identified(sensor(vec![of(seed, Role::Fit), of(seed + 1000, Role::Holdout)]));
            assert!(!told_by_another_pass(&i), "seed {seed}, {memory}: {:#?}", i.report.effects);
        }
    }
    for seed in 0..4 {
        let i = identified(sensor(thirds(&remembered(0.98, 600, seed))));
        assert!(!told_by_another_pass(&i), "seed {seed}: {:#?}", i.report.effects);
    }
}
