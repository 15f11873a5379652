//! Recordings that are not what they seem: each gets a right answer with the fault named, or none with its reason.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use cvg_calibration::recording::{Campaign, Instrument, Recording};
use cvg_calibration::report::Status;
use cvg_calibration::{Cause, Identification, Options, Refusal, identify};
use cvg_tests::bench::Draws;
use cvg_tests::broken::{ANGULAR_GAIN, Made, RATIO, Told, campaign, hold};

#[path = "broken/amplitude.rs"]
mod amplitude;
#[path = "broken/lies.rs"]
mod lies;

fn identified(recordings: Vec<Recording>) -> Result<Identification, Refusal> {
    identify(campaign(recordings), &Options::default())
}

/// There is no answer, and why has all of these in it.
fn is_refused(outcome: Result<Identification, Refusal>, parts: &[&str]) {
    let refusal = outcome.map(|i| i.report.angular_gain).unwrap_err();
    assert_eq!(refusal.cause, Cause::NoAnswer, "{refusal}");
    for part in parts {
        assert!(refusal.to_string().contains(part), "{part:?} is not in {refusal}");
    }
}

/// The answer is right, and one of its warnings has all of these in it.
fn is_right(outcome: Result<Identification, Refusal>, warning: &[&str]) -> Identification {
    let identified = outcome.unwrap_or_else(|e| panic!("{e}"));
    let r = &identified.report;
    assert_eq!(r.status, Status::Answered, "{:?}", r.reason);
    assert!((r.angular_gain.value - ANGULAR_GAIN).abs() < 1e-4, "{:?}", r.angular_gain);
    assert!(r.angular_gain.half_width() < 3e-3, "{:?}", r.angular_gain);
    let [low, high] = r.angular_gain.ci95;
    assert!(low <= ANGULAR_GAIN && ANGULAR_GAIN <= high, "{:?}", r.angular_gain);
    assert!(r.heldout.discovered.rms_deg < 2.0 * r.heldout.noise_floor_deg, "{:?}", r.heldout);
    let says = |w: &String| warning.iter().all(|part| w.contains(part));
    assert!(r.warnings.iter().any(says), "{warning:?} is not in {:#?}", r.warnings);
    identified
}

/// The interval of the angular gain holds it, and one of the warnings has all of these in it.
fn is_covered(outcome: Result<Identification, Refusal>, warning: &[&str]) -> Identification {
    let identified = outcome.unwrap_or_else(|e| panic!("{e}"));
    let r = &identified.report;
    let [low, high] = r.angular_gain.ci95;
    assert!(low <= ANGULAR_GAIN && ANGULAR_GAIN <= high && high - low < 0.02, "{:?}", r.angular_gain);
    assert!(r.warnings.iter().any(|w| warning.iter().all(|part| w.contains(part))), "{warning:?}: {:#?}", r.warnings);
    identified
}

// Sampling

#[test]
fn two_samples_a_second_at_500_dps_are_no_answer() {
    let slow = Made { sample_hz: 2.0, duration_s: 600.0, ..Made::default() }.recording();
    is_refused(identified(vec![slow.clone()]), &["250.0° from sample to sample", "0.7800, 0.0600, -0.6600", "0.154 s"]);
    let other = Made { rate_dps: -500.0, sample_hz: 2.0, duration_s: 600.0, seed: 2, ..Made::default() }.recording();
    is_refused(identified(vec![slow, other]), &["0.7800"]);
}

#[test]
fn a_stated_gain_or_another_rate_tells_the_aliases_apart() {
    let slow = Made { sample_hz: 2.0, duration_s: 600.0, ..Made::default() };
    let mut stated = campaign(vec![slow.recording()]);
    stated.angular_gain = Some(0.8);
    is_right(identify(stated, &Options::default()), &[]);
    let other = Made { rate_dps: 370.0, seed: 2, ..slow.clone() };
    is_right(identified(vec![slow.recording(), other.recording()]), &[]);
}

#[test]
fn milliseconds_for_seconds_are_suggested() {
    let mut recording = Made::default().recording();
    recording.t_s.iter_mut().for_each(|t| *t *= 1000.0);
    is_refused(identified(vec![recording]), &["milliseconds"]);
}

/// 242.5° from row to row are −117.5° of a table's angle within a turn.
#[test]
fn a_table_that_may_turn_further_from_row_to_row_is_no_answer() {
    let slow = Made {
        rate_dps: 485.0,
        sample_hz: 2.0,
        duration_s: 400.0,
        angular_gain: 0.55,
        reference: Told::Table,
        ..Made::default()
    };
    is_refused(
        identified(vec![slow.recording()]),
        &[
            "but for whole turns, by -117.5° or by 242.5°",
            "0.5500",
            "rate_dps, or a table_deg that counts turns",
            "0.18 s",
        ],
    );
}

/// What tells its turns: a column that counts them, a stated gain, or another rate.
#[test]
fn a_table_whose_turns_are_told_from_row_to_row_is_answered() {
    let made = Made { rate_dps: 185.0, sample_hz: 2.0, duration_s: 400.0, reference: Told::Table, ..Made::default() };
    let mut counts = Made { rate_dps: 400.0, ..made.clone() }.recording();
    counts.table_deg = Some(counts.t_s.iter().map(|t| 400.0 * t).collect());
    let mut stated = campaign(vec![counts]);
    stated.angular_gain = Some(0.8);
    is_right(identify(stated, &Options::default()), &[]);
    let rates = [185.0, -130.0, 71.0].into_iter().enumerate();
    let runs = rates.map(|(i, rate_dps)| Made { rate_dps, seed: i as u64 + 1, ..made.clone() }.recording());
    is_right(identified(runs.collect()), &[]);
}

// Numbers

/// Clean samples outweigh what is believed of a drift by more than a double resolves.
#[test]
fn fifty_thousand_clean_rows_are_answered_right() {
    let clean = Made { rate_dps: 50.0, duration_s: 50.0, sample_hz: 1000.0, noise_v: 1e-6, ..Made::default() };
    let identified = is_right(identified(vec![clean.recording()]), &[]);
    let ratio = identified.report.detection_gain_ratio.unwrap();
    assert!((ratio.value - RATIO).abs() < 1e-5, "{ratio:?}");
}

#[test]
fn less_noise_does_not_widen_the_interval_of_the_angular_gain() {
    let width = |noise_v: f64| {
        let runs = [500.0, -200.0].map(|rate_dps| Made { rate_dps, noise_v, ..Made::default() }.recording());
        is_right(identified(runs.to_vec()), &[]).report.angular_gain.half_width()
    };
    let [noisy, clean, cleaner] = [1e-3, 2e-5, 1e-6].map(width);
    assert!(clean < 1.2 * noisy && cleaner < 1.2 * clean, "{noisy:e} {clean:e} {cleaner:e}");
}

#[test]
fn an_error_is_not_counted_on_nothing() {
    let short = Made { rate_dps: 2000.0, duration_s: 0.6, ..Made::default() };
    is_refused(identified(vec![short.recording()]), &["0 samples are left"]);
}

#[test]
fn a_gain_that_no_gyroscope_has_is_no_answer_and_its_unit_is_suggested() {
    let radians = [500.0, -200.0].map(|rate_dps| {
        let mut recording = Made { rate_dps, ..Made::default() }.recording();
        recording.rate_dps.iter_mut().flatten().for_each(|r| *r = r.to_radians());
        recording
    });
    is_refused(identified(radians.to_vec()), &["44.69", "rad/s", "57.29578"]);
    let mut absurd = campaign(vec![Made::default().recording()]);
    absurd.angular_gain = Some(1e300);
    assert_eq!(identify(absurd, &Options::default()).unwrap_err().cause, Cause::BadInput);
}

// Rows and runs

#[test]
fn rows_that_stand_still_are_named_and_left_out() {
    for rows in [700..730, 700..740, 1700..1725] {
        let mut recording = Made::default().recording();
        hold(&mut recording, rows.clone());
        is_right(identified(vec![recording]), &[&format!("rows {} to {} ", rows.start + 2, rows.end), "left out"]);
    }
}

/// A channel that died after the first of a hundred thousand rows is not read slowly.
#[test]
fn a_channel_that_stands_still_to_the_end_is_said_to() {
    for (rows, stands) in [(5_000, 3_999), (100_000, 98_999)] {
        let mut recording = Made { rate_dps: 90.0, duration_s: f64::from(rows) / 100.0, ..Made::default() }.recording();
        let x = recording.xc_v.as_mut().unwrap();
        let value = x[1000];
        x[1000..].fill(value);
        is_refused(identified(vec![recording]), &[&format!("{stands} of {rows} rows repeat the one before")]);
    }
}

#[test]
fn a_recording_that_is_written_faster_than_it_is_read_is_answered() {
    let mut recording = Made { rate_dps: 60.0, duration_s: 40.0, ..Made::default() }.recording();
    (0..1000).for_each(|i| hold(&mut recording, 4 * i..4 * i + 4));
    is_right(identified(vec![recording]), &["held for 4 rows"]);
}

#[test]
fn a_clock_that_slips_is_named_and_does_not_bend_the_answer() {
    let mut recording = Made::default().recording();
    recording.t_s[1001..].iter_mut().for_each(|t| *t += 0.05);
    is_right(identified(vec![recording]), &["row 1002", "the clock slips", "500dps-1.csv"]);
}

/// Five jumps of 44° on a way of 1150° are a converter's bit that hangs, or rows of something else.
#[test]
fn jumps_that_go_a_tenth_of_the_way_are_no_slips_of_a_clock() {
    let jumped = |count: usize| {
        let mut recording = Made { rate_dps: -86.0, duration_s: 17.2, ..Made::default() }.recording();
        let rows = recording.len();
        let (Some(x), Some(y)) = (&mut recording.xc_v, &mut recording.yc_v) else { unreachable!() };
        for at in (1..=count).map(|n| n * rows / (count + 1)) {
            let (sin, cos) = 44.0f64.to_radians().sin_cos();
            for (x, y) in x[at..].iter_mut().zip(&mut y[at..]) {
                let [a, b] = [*x, *y / RATIO];
                (*x, *y) = (a * cos - b * sin, RATIO * (a * sin + b * cos));
            }
        }
        identified(vec![recording])
    };
    is_right(jumped(1), &["the clock slips there"]);
    is_refused(jumped(5), &["jumps against the input 5 times"]);
}

#[test]
fn of_two_runs_with_two_gains_neither_is_believed() {
    let other = Made { rate_dps: -300.0, angular_gain: 0.70, seed: 2, ..Made::default() };
    is_refused(identified(vec![Made::default().recording(), other.recording()]), &["0.78000", "0.70000"]);
}

#[test]
fn one_odd_run_among_many_is_named_and_left_out() {
    let rates = (0..12).map(|i| 100.0 + 40.0 * f64::from(i)).enumerate();
    let mut runs: Vec<Recording> = rates
        .map(|(i, rate_dps)| Made { rate_dps, duration_s: 10.0, seed: i as u64 + 1, ..Made::default() }.recording())
        .collect();
    runs[5].rate_dps.iter_mut().flatten().for_each(|r| *r *= 1.02);
    let identified = is_right(identified(runs), &["300dps-6.csv: left out", "0.7647"]);
    let told: Vec<Option<bool>> = identified.report.runs.iter().map(|r| r.agrees).collect();
    assert_eq!(told.iter().filter(|a| **a == Some(true)).count(), 11, "{told:?}");
    assert_eq!(told[5], Some(false));
    for run in identified.report.runs.iter().filter(|r| r.agrees == Some(true)) {
        assert!((run.angular_gain.unwrap().value - ANGULAR_GAIN).abs() < 1e-4, "{run:?}");
        assert!(run.bias_dps.unwrap().value.abs() < 0.02 && run.rms_deg.unwrap() < 0.01, "{run:?}");
    }
}

/// One run is read by a preamplifier whose gain is a quarter of a percent larger: one of four is left out by name, and of three,
/// of which nothing tells the odd one, the interval covers all.
#[test]
fn a_run_with_another_ratio_of_the_gains_is_left_out_or_covered() {
    let made = |rates: &[f64], times: f64| {
        let made = |(i, rate_dps): (usize, &f64)| Made { rate_dps: *rate_dps, seed: i as u64 + 1, ..Made::default() };
        let mut runs: Vec<Recording> = rates.iter().enumerate().map(|run| made(run).recording()).collect();
        runs[2].yc_v.iter_mut().flatten().for_each(|v| *v *= times);
        identified(runs).unwrap().report
    };
    let three = made(&[500.0, -400.0, 300.0], 1.0025);
    let [low, high] = three.detection_gain_ratio.unwrap().ci95;
    assert!(low < RATIO && RATIO < high && high - low < 0.01, "{low} {high}: {:?}", three.warnings);

    let four = made(&[500.0, -400.0, 300.0, -200.0], 1.0025);
    let [low, high] = four.detection_gain_ratio.unwrap().ci95;
    assert!(low < RATIO && RATIO < high && high - low < 0.01, "{low} {high}: {:?}", four.warnings);
    let is_left_out = |w: &String| w.starts_with("300dps-3.csv: left out") && w.contains("of another device");
    assert!(four.warnings.iter().any(is_left_out), "{:?}", four.warnings);

    // too little to leave it out for
    let near = made(&[500.0, -400.0, 300.0, -200.0], 1.0003);
    let [low, high] = near.detection_gain_ratio.unwrap().ci95;
    assert!(low < RATIO && RATIO < high && high - low < 0.01, "{low} {high}: {:?}", near.warnings);
    let is_said =
        |w: &String| w.contains("do not agree on the detection gain ratio") && w.contains("300dps-3.csv 1.01");
    assert!(near.warnings.iter().any(is_said), "{:?}", near.warnings);
}

/// What the runs differ in is a damping that differs by axis, or they are of two instruments: nothing tells which.
#[test]
fn of_two_runs_with_two_ratios_of_the_gains_the_interval_covers_both() {
    let mut runs: Vec<Recording> = [[500.0, 1.0], [40.0, 1.017]]
        .map(|[rate_dps, times]| {
            let mut run = Made { rate_dps, duration_s: 50.0, seed: rate_dps as u64, ..Made::default() }.recording();
            run.yc_v.iter_mut().flatten().for_each(|v| *v *= times);
            run
        })
        .to_vec();
    let told = |runs: &[Recording]| {
        let report = identified(runs.to_vec()).unwrap().report;
        let is_said = report.warnings.iter().any(|w| w.contains("separated by a run that no other bears out"));
        (report.detection_gain_ratio.unwrap(), is_said)
    };
    let (ratio, is_said) = told(&runs);
    let [low, high] = ratio.ci95;
    // to the second order in what they differ by
    assert!(is_said && low < RATIO + 5e-4 && high > 1.017 * RATIO - 5e-4, "{ratio:?}");
    // a third run at yet another rate bears the first out
    runs[1].yc_v.iter_mut().flatten().for_each(|v| *v /= 1.017);
    runs.push(Made { rate_dps: -150.0, seed: 3, ..Made::default() }.recording());
    let (ratio, is_said) = told(&runs);
    assert!(!is_said && (ratio.value - RATIO).abs() < 1e-5 && ratio.half_width() < 1e-4, "{ratio:?}");
}

/// Beside a run that swings, a slow one with another gain would have to drift by more than is believed.
#[test]
fn a_drift_that_is_not_believed_widens_the_interval_of_the_angular_gain() {
    let swings = Made { rate_dps: -265.0, swings: 1.0, angular_gain: 0.782, ..Made::default() };
    let steady = Made { rate_dps: 89.0, duration_s: 30.0, seed: 2, ..Made::default() };
    let report = identified(vec![swings.recording(), steady.recording()]).unwrap().report;
    let [low, high] = report.angular_gain.ci95;
    assert!(low < ANGULAR_GAIN + 1e-5 && 0.782 < high + 1e-5, "{:?}", report.angular_gain);
    let is_said = |w: &String| w.contains("do not agree on the angular gain") && w.contains("89dps-2.csv 0.78");
    assert!(report.warnings.iter().any(is_said), "{:?}", report.warnings);
}

/// The drift of the run that turns one way takes up what the other's rate is wrong by.
#[test]
fn where_one_run_turns_back_and_no_other_bears_it_out_the_interval_covers_what_the_others_tell() {
    let back = Made { rate_dps: 60.0, duration_s: 40.0, swings: 1.0, ..Made::default() };
    let mut wrong = back.recording();
    wrong.rate_dps.iter_mut().flatten().for_each(|rate| *rate *= 1.0005);
    let steady = Made { rate_dps: 60.0, duration_s: 40.0, seed: 2, ..Made::default() };
    is_covered(identified(vec![wrong, steady.recording()]), &["one run that turns back", "60dps-2.csv"]);
    // another that turns back bears it out, and nothing is widened
    let other = Made { rate_dps: 90.0, seed: 3, ..back.clone() };
    let identified = identified(vec![back.recording(), steady.recording(), other.recording()]).unwrap();
    assert!(identified.report.warnings.iter().all(|w| !w.contains("turns back")), "{:?}", identified.report.warnings);
}

#[test]
fn references_that_differ_by_a_little_are_said_to_and_the_interval_covers_both() {
    let apart = |by: f64, seed| {
        let made = Made { reference: Told::Both, seed, ..Made::default() };
        let mut recording = made.recording();
        let turned = made.turned(&made.rates());
        recording.table_deg = Some(turned.iter().map(|d| ((1.0 + by) * d).rem_euclid(360.0)).collect());
        recording
    };
    is_covered(identified(vec![apart(-9e-3, 1)]), &["500dps-1.csv", "turns 0.9910 times as fast", "covers both"]);
    // what a command differs by from what the table does is nothing to speak of
    let report = identified(vec![apart(5e-4, 1)]).unwrap().report;
    assert!(report.warnings.iter().all(|w| !w.contains("covers both")), "{:?}", report.warnings);
}

#[test]
fn a_recording_that_is_there_twice_counts_once() {
    let recordings = || [500.0, -200.0].map(|rate_dps| Made { rate_dps, ..Made::default() }.recording()).to_vec();
    let alone = identified(recordings()).unwrap().report;
    let twice = identified(recordings().into_iter().chain(recordings()).collect()).unwrap().report;
    assert_eq!(twice.angular_gain, alone.angular_gain);
    assert_eq!(twice.runs.iter().filter(|r| r.r#use == "left out").count(), 2, "{:?}", twice.runs);
    assert!(twice.warnings.iter().any(|w| w.contains("it is the same recording as")), "{:?}", twice.warnings);
}

#[test]
fn one_run_of_which_nothing_can_be_made_does_not_refuse_the_others() {
    let still = |r: &mut Recording| r.rate_dps.iter_mut().flatten().for_each(|v| *v = 0.0);
    let coarse = |r: &mut Recording| {
        [&mut r.xc_v, &mut r.yc_v].into_iter().flatten().flatten().for_each(|v| *v = (*v * 2.0).round() / 2.0);
    };
    let short = |r: &mut Recording| r.rate_dps.iter_mut().flatten().for_each(|v| *v *= 1e-3);
    for damage in [still as fn(&mut Recording), coarse, short] {
        let mut runs: Vec<Recording> = [500.0, -400.0, 200.0]
            .into_iter()
            .map(|rate_dps| Made { rate_dps, ..Made::default() }.recording())
            .collect();
        damage(&mut runs[1]);
        is_right(identified(runs), &["-400dps-1.csv: left out"]);
    }
}

fn sensors(recordings: Vec<Recording>) -> Result<Identification, Refusal> {
    let of = Campaign {
        instrument: Instrument::Sensor,
        angular_gain: Some(1.0),
        period_deg: Some(360.0),
        ..campaign(recordings)
    };
    identify(of, &Options::default())
}

fn exchanged(mut recording: Recording) -> Recording {
    std::mem::swap(&mut recording.xc_v, &mut recording.yc_v);
    recording
}

#[test]
fn a_sensor_that_counts_against_what_is_stated_may_have_its_channels_exchanged() {
    let sensor = Made { rate_dps: 90.0, is_sensor: true, ..Made::default() };
    let report = sensors(vec![exchanged(sensor.recording())]).unwrap().report;
    let [low, high] = report.detection_gain_ratio.unwrap().ci95;
    assert!(low < 1.0 / RATIO + 1e-4 && high > RATIO - 1e-4, "{low} {high}");
    assert!(report.warnings.iter().any(|w| w.contains("or the channels are exchanged")), "{:?}", report.warnings);
    // beside sound runs it is the odd one
    let sound = |rate_dps: f64| Made { rate_dps, ..sensor.clone() }.recording();
    let report = sensors(vec![sound(60.0), exchanged(sensor.recording()), sound(-45.0)]).unwrap().report;
    assert!((report.detection_gain_ratio.unwrap().value - RATIO).abs() < 1e-4, "{:?}", report.detection_gain_ratio);
    assert!(report.warnings.iter().any(|w| w.starts_with("90dps-1.csv: left out")), "{:?}", report.warnings);
}

#[test]
fn sensor_runs_that_do_not_agree_on_the_ratio_of_the_gains_are_named_and_the_interval_covers_them() {
    let sensor = |rate_dps: f64| Made { rate_dps, is_sensor: true, ..Made::default() }.recording();
    let mut other = sensor(60.0);
    other.yc_v.iter_mut().flatten().for_each(|v| *v *= 0.99);
    let report = sensors(vec![sensor(90.0), other]).unwrap().report;
    let [low, high] = report.detection_gain_ratio.unwrap().ci95;
    assert!(low < 0.99 * RATIO + 1e-4 && high > RATIO - 1e-4, "{low} {high}: {:?}", report.warnings);
    assert!(report.warnings.iter().any(|w| w.contains("do not agree on the detection gain ratio")));
}

#[test]
fn a_table_that_contradicts_the_rate_is_no_reference() {
    let mut recording = Made::default().recording();
    recording.table_deg = Some(recording.t_s.iter().map(|t| (250.0 * t).rem_euclid(360.0)).collect());
    is_refused(identified(vec![recording]), &["table_deg turns 0.5000 times as fast as rate_dps says"]);
}

#[test]
fn swapped_channels_are_no_answer_unless_the_campaign_says_how_the_angle_counts() {
    let mut recording = Made::default().recording();
    std::mem::swap(&mut recording.xc_v, &mut recording.yc_v);
    is_refused(identified(vec![recording.clone()]), &["counts with the rotation", "swapped", "angular_gain = -0.78"]);
    let mut meant = campaign(vec![recording]);
    meant.angular_gain = Some(-0.8);
    assert!((identify(meant, &Options::default()).unwrap().report.angular_gain.value + ANGULAR_GAIN).abs() < 1e-4);
}

#[test]
fn noise_and_another_rotation_are_no_answer() {
    let noise = |seed: u64| {
        let mut draw = Draws::new(seed);
        let mut recording = Made { rate_dps: 100.0 + seed as f64, ..Made::default() }.recording();
        for v in [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten() {
            v.iter_mut().for_each(|v| *v = draw.between(-1.0, 1.0));
        }
        recording
    };
    is_refused(identified(vec![noise(1)]), &["does not follow"]);
    is_refused(identified(vec![noise(2), noise(3), noise(4)]), &["does not follow"]);
    let unrelated = [500.0, -200.0].map(|rate| {
        let mut recording = Made { rate_dps: 333.3, ..Made::default() }.recording();
        recording.rate_dps = Some(vec![rate; recording.len()]);
        recording
    });
    is_refused(identified(unrelated.to_vec()), &["do not agree"]);
}
