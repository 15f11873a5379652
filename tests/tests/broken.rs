//! Recordings that are not what they seem: each gets a right answer with the fault named, or none with its reason.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use cvg_calibration::recording::{Campaign, Recording, Role, Run, RunKind};
use cvg_calibration::report::Status;
use cvg_calibration::{Cause, Identification, Options, Refusal, identify};
use cvg_tests::bench::{Draws, all, trials};

const ANGULAR_GAIN: f64 = 0.78;
const RATIO: f64 = 1.0132;
const NOISE_V: f64 = 2e-5;

/// What one run of a device is made of.
#[derive(Debug, Clone)]
struct Made {
    rate_dps: f64,
    duration_s: f64,
    sample_hz: f64,
    angular_gain: f64,
    noise_v: f64,
    seed: u64,
}

impl Default for Made {
    fn default() -> Self {
        Self {
            rate_dps: 500.0,
            duration_s: 20.0,
            sample_hz: 100.0,
            angular_gain: ANGULAR_GAIN,
            noise_v: NOISE_V,
            seed: 1,
        }
    }
}

impl Made {
    /// A device with unequal gains, X and Y recorded and no commands.
    fn recording(&self) -> Recording {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive count")]
        let rows = (self.duration_s * self.sample_hz) as usize;
        let mut draw = Draws::new(self.seed);
        // the sum of twelve even draws has a variance of one
        let mut noise = || self.noise_v * (0..12).map(|_| draw.between(-0.5, 0.5)).sum::<f64>();
        let t_s: Vec<f64> = (0..rows).map(|i| i as f64 / self.sample_hz).collect();
        let theta: Vec<f64> = t_s.iter().map(|t| 0.3 - self.angular_gain * (self.rate_dps * t).to_radians()).collect();
        let xc_v = theta.iter().map(|a| a.cos() + noise()).collect();
        let yc_v = theta.iter().map(|a| RATIO * a.sin() + noise()).collect();
        Recording {
            source: format!("{}dps-{}.csv", self.rate_dps, self.seed).into(),
            rate_dps: Some(vec![self.rate_dps; rows]),
            xc_v: Some(xc_v),
            yc_v: Some(yc_v),
            t_s,
            ..Recording::default()
        }
    }
}

fn campaign(recordings: Vec<Recording>) -> Campaign {
    let run = |recording: Recording| Run {
        kind: RunKind::Rotation,
        file: recording.source.clone(),
        settle_s: 0.0,
        role: Role::Fit,
        amplitude: None,
        recording,
    };
    Campaign { device: "made".into(), runs: recordings.into_iter().map(run).collect(), ..Campaign::default() }
}

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

/// Puts one value in the place of those of some rows.
fn hold(recording: &mut Recording, rows: std::ops::Range<usize>) {
    for v in [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten() {
        let value = v[rows.start];
        v[rows.clone()].fill(value);
    }
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
    is_refused(identified(radians.to_vec()), &["4.469", "rad/s", "57.29578"]);
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

// No confident lie

/// What is done to a run.
const DAMAGES: usize = 11;
const RATE_FACTOR: usize = 2;

fn damaged(mut recording: Recording, kind: usize, draw: &mut Draws) -> Recording {
    let rows = recording.len();
    let (at, length) = (rows / 8 + draw.below(rows / 2), 2 + draw.below(rows / 16));
    match kind {
        0 => hold(&mut recording, at..at + length),
        1 => {
            let slip = draw.scale(0.02, 2.0);
            recording.t_s[at..].iter_mut().for_each(|t| *t += slip);
        }
        RATE_FACTOR => {
            let factor = draw.between(0.9, 1.1);
            recording.rate_dps.iter_mut().flatten().for_each(|r| *r *= factor);
        }
        3 => recording.rate_dps.iter_mut().flatten().for_each(|r| *r = r.to_radians()),
        4 => recording.t_s.iter_mut().for_each(|t| *t *= 1000.0),
        5 => std::mem::swap(&mut recording.xc_v, &mut recording.yc_v),
        6 => recording.yc_v.iter_mut().flatten().for_each(|v| *v = -*v),
        7 => {
            let rate = recording.rate_dps.as_ref().unwrap()[0] * draw.between(0.3, 1.8);
            recording.table_deg = Some(recording.t_s.iter().map(|t| (rate * t).rem_euclid(360.0)).collect());
        }
        8 => {
            let limit = draw.between(0.5, 1.0);
            recording.xc_v.iter_mut().flatten().for_each(|v| *v = v.clamp(-limit, limit));
        }
        9 => {
            for v in [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten() {
                for i in 0..rows / 50 {
                    v[(i * 50 + 17) % rows] += 3.0;
                }
            }
        }
        _ => {
            // rows lost without a gap in the time stamps
            let count = length.min(rows - at - 1);
            for v in [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten() {
                v.drain(at..at + count);
            }
            let left = rows - count;
            recording.t_s.truncate(left);
            recording.rate_dps.iter_mut().for_each(|v| v.truncate(left));
        }
    }
    recording
}

/// A random small campaign, some of its runs damaged; whether the answer is a lie, with what it was.
fn lie(number: u64) -> (bool, bool, String) {
    let mut draw = Draws::new(1_000_000 + number);
    let hz = [2.0, 5.0, 20.0, 100.0, 100.0, 100.0, 250.0][draw.below(7)];
    let truth = draw.between(0.3, 0.95);
    let runs = 1 + draw.below(4);
    let noise_v = draw.scale(1e-6, 1e-3);
    let mut what = format!("#{number}: k = {truth:.5}, {hz} Hz, noise {noise_v:.1e}");
    let bad = if draw.below(4) == 0 { usize::MAX } else { draw.below(runs) };
    let recordings = (0..runs).map(|i| {
        let sign = if draw.below(2) == 0 { 1.0 } else { -1.0 };
        let rate_dps = sign * draw.scale(30.0, 600.0);
        let duration_s = f64::max(800.0 / hz, 2000.0 / rate_dps.abs());
        let made =
            Made { rate_dps, duration_s, sample_hz: hz, angular_gain: truth, noise_v, seed: 10 * number + i as u64 };
        what.push_str(&format!("; {rate_dps:.0} dps"));
        if i == bad {
            // that the rates of an only run are all wrong by one factor can't be seen: the gain is that of the rate given
            let kind = (0..).map(|_| draw.below(DAMAGES)).find(|kind| runs > 1 || *kind != RATE_FACTOR).unwrap();
            what.push_str(&format!(" damaged ({kind})"));
            damaged(made.recording(), kind, &mut draw)
        } else {
            made.recording()
        }
    });
    let recordings: Vec<Recording> = recordings.collect();
    match identified(recordings) {
        Err(refusal) => (false, false, format!("{what}: {refusal}")),
        Ok(identified) => {
            let off = |e: cvg_calibration::report::Estimate, truth: f64| {
                // the 99.9 % interval is 1.68 times the 95 % one; a lie misses it by more than its width
                (e.value - truth).abs() > 3.0 * 1.68 * e.half_width() + 1e-9
            };
            let r = &identified.report;
            let ratio = r.detection_gain_ratio;
            let lies = off(r.angular_gain, truth) || ratio.is_some_and(|e| off(e, RATIO));
            (lies, true, format!("{what}: k {:?}, ratio {ratio:?}, {:?}", r.angular_gain, r.warnings))
        }
    }
}

/// Share of the campaigns that may be answered with a lie.
const LIES: f64 = 0.01;

#[test]
fn damaged_campaigns_are_not_lied_about() {
    let outcomes = all(trials(200), lie);
    let count = |is: fn(&(bool, bool, String)) -> bool| outcomes.iter().filter(|o| is(o)).count();
    let (lies, answers) = (count(|o| o.0), count(|o| o.1));
    println!("{} campaigns, {answers} answered, {lies} lies", outcomes.len());
    for (_, _, what) in outcomes.iter().filter(|o| o.0) {
        println!("{what}");
    }
    assert!(lies as f64 <= LIES * outcomes.len() as f64, "{lies} lies");
    assert!(answers as f64 > 0.3 * outcomes.len() as f64, "{answers} answers");
}
