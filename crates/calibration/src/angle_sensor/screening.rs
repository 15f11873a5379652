//! Which runs of a sensor can be believed: each by itself, before all are fitted at once, is read by two channels, follows its
//! reference, and turns as far as the others do and the same way. What is odd in a few is left out, and named.

use super::agreement::of_one_sensor;
use super::ellipse;
use super::readout::Readout;
use super::samples::{Reading, SensorRun};
use super::spikes::without_spikes;
use crate::data::copies::{copied_rows, said};
use crate::data::interpolated::{self, interpolated_rows};
use crate::data::plausibility::MOST_LOST;
use crate::error::Refusal;
use crate::numerics::angles::followed;
use crate::numerics::statistics::{line, median, robust_deviation};

/// Share of the runs that may be left out.
const MOST_LEFT_OUT: f64 = 1.0 / 3.0;
/// A run tells how its angle goes with the reference over this many periods, in steps below this share of one.
const FEWEST_PERIODS: f64 = 2.0;
pub(super) const LARGEST_STEP: f64 = 0.125;
/// An angle that scatters by more than this share of its period about its line does not follow the reference: the usual
/// error of an angle sensor is a tenth of that.
const LOST: f64 = 0.1;
/// Angular gains of one sensor are within this share of each other, and of what is stated: a rate that was commanded and not
/// measured is off by less, and a turn of the poles more or less is beyond it up to twenty of them.
const SHARE: f64 = 0.05;

/// What an angle does while its reference turns.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Follows {
    /// the run is too short, or its rows too far apart, to tell
    Untold,
    /// nothing that goes with it
    Not,
    /// it turns so many times as far, with its sign
    Turns(f64),
}

/// The runs that can be believed, of a sensor whose angle has this period, rad, and this angular gain, where one is stated.
///
/// # Errors
/// Where too few are left, the runs contradict each other, or all of them what is stated.
pub(crate) fn believed(
    runs: Vec<SensorRun>,
    stated: Option<f64>,
    period: f64,
    warnings: &mut Vec<String>,
) -> Result<Vec<SensorRun>, Refusal> {
    let runs = without_interpolated_rows(without_copied_rows(runs, warnings)?, warnings);
    let runs = without_spikes(runs, period, warnings);
    let runs = of_one_sensor(runs, warnings)?;
    let follows: Vec<Follows> = runs.iter().map(|r| follows(r, stated, period)).collect();
    let mut told: Vec<f64> =
        follows.iter().filter_map(|f| if let Follows::Turns(g) = f { Some(*g) } else { None }).collect();
    if told.is_empty() {
        return Ok(runs);
    }
    let common = median(&mut told);
    let odd = |f: &Follows| match f {
        Follows::Untold => None,
        Follows::Not => Some("its angle does not follow the reference".to_owned()),
        Follows::Turns(g) if (g / common - 1.0).abs() > SHARE => Some(format!(
            "its angle turns {g:.4} times as far as the reference, that of the other runs {common:.4} times"
        )),
        Follows::Turns(_) => None,
    };
    let why: Vec<Option<String>> = follows.iter().map(odd).collect();
    if let Some(at) = why.iter().position(Option::is_some) {
        let count = why.iter().flatten().count();
        if count as f64 > MOST_LEFT_OUT * runs.len() as f64 {
            let what = why[at].clone().unwrap_or_default();
            return Err(Refusal::no_answer(&runs[at].name, what, "runs of one sensor, each with its own reference"));
        }
    }
    if let Some(stated) = stated.filter(|s| ((common / s).abs() - 1.0).abs() > SHARE) {
        return Err(Refusal::no_answer(
            "campaign",
            format!("the angle turns {common:.4} times as far as the reference, and the campaign states {stated}"),
            "angular_gain or pole_pairs of this sensor, and the reference in its unit",
        ));
    }
    warnings
        .extend(runs.iter().zip(&why).filter_map(|(r, why)| Some(format!("{}: left out: {}", r.name, why.as_ref()?))));
    Ok(runs.into_iter().zip(why).filter(|(_, why)| why.is_none()).map(|(r, _)| r).collect())
}

/// Leaves out rows in which one channel stands in the other's place, and runs in which it mostly does.
fn without_copied_rows(runs: Vec<SensorRun>, warnings: &mut Vec<String>) -> Result<Vec<SensorRun>, Refusal> {
    let count = runs.len();
    let mut kept = Vec::with_capacity(count);
    for run in runs {
        let (x, y) = channels(&run);
        let copied = copied_rows(&x, &y);
        if copied.is_empty() {
            kept.push(run);
            continue;
        }
        let what = format!("{}: {}: one stands in the other's place", run.name, said(&copied, &run.t_s));
        let rows: Vec<usize> = (0..run.len()).filter(|i| !copied.iter().any(|r| r.contains(i))).collect();
        if (run.len() - rows.len()) as f64 <= MOST_LOST * run.len() as f64 {
            warnings.push(format!("{what}; these rows are left out"));
            kept.push(run.subset(&rows));
        } else if count == 1 {
            return Err(Refusal::no_answer("", what, "xc_v and yc_v of two channels"));
        } else {
            warnings.push(format!("{what}; the run is left out"));
        }
    }
    if kept.is_empty() {
        let wanted = "xc_v and yc_v of two channels";
        return Err(Refusal::no_answer("campaign", "X and Y are the same to the last digit in every run", wanted));
    }
    Ok(kept)
}

/// The runs without rows that were drawn between others.
fn without_interpolated_rows(runs: Vec<SensorRun>, warnings: &mut Vec<String>) -> Vec<SensorRun> {
    let recorded = |run: SensorRun| {
        let (x, y) = channels(&run);
        let drawn = interpolated_rows(&run.t_s[..x.len()], &x, &y);
        let Some(what) = interpolated::said(&drawn, &run.t_s) else { return run };
        warnings.push(format!("{}: {what}", run.name));
        let rows: Vec<usize> = (0..run.len()).filter(|i| !drawn[*i]).collect();
        run.subset(&rows)
    };
    runs.into_iter().map(recorded).collect()
}

/// Both channels of a run; empty where it tells an angle alone.
fn channels(run: &SensorRun) -> (Vec<f64>, Vec<f64>) {
    run.channels().into_iter().flatten().map(|z| (z[0], z[1])).unzip()
}

/// How the angle of a run goes with its reference, by the ellipse of the run alone.
fn follows(run: &SensorRun, stated: Option<f64>, period: f64) -> Follows {
    let theta: Vec<f64> = match &run.reading {
        Reading::Angle(theta) => theta.clone(),
        Reading::Channels(v) => {
            let readout = ellipse::algebraic(std::slice::from_ref(run)).unwrap_or_else(Readout::plain);
            v.iter().map(|z| readout.angle(*z)).collect()
        }
    };
    let followed = followed(&theta, &run.reference_rad, period);
    let (slope, intercept) = line(&run.reference_rad, &followed);
    let size = stated.map_or(slope.abs(), f64::abs).max(1.0);
    let mut steps: Vec<f64> = run.reference_rad.windows(2).map(|w| size * (w[1] - w[0]).abs()).collect();
    if median(&mut steps) > LARGEST_STEP * period || size * run.travel_rad() < FEWEST_PERIODS * period {
        return Follows::Untold;
    }
    let left = run.reference_rad.iter().zip(&followed).map(|(a, t)| t - slope * a - intercept);
    if robust_deviation(left) > LOST * period { Follows::Not } else { Follows::Turns(slope) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Role;
    use std::f64::consts::TAU;

    /// 2000 rows over ten turns of the reference, read by channels at this angular gain.
    fn run(name: &str, gain: f64) -> SensorRun {
        let reference_rad: Vec<f64> = (0..2000).map(|i| 0.01 * TAU * 0.5 * f64::from(i)).collect();
        SensorRun {
            name: name.into(),
            number: 0,
            role: Role::Fit,
            commanded: true,
            t_s: (0..2000).map(f64::from).collect(),
            rate_rad_s: vec![0.01; 2000],
            acceleration_rad_s2: vec![0.0; 2000],
            temp_c: None,
            recorded: None,
            reading: Reading::Channels(
                reference_rad.iter().map(|a| [0.2 + (gain * a + 0.3).cos(), 1.0132 * (gain * a + 0.3).sin()]).collect(),
            ),
            reference_rad,
        }
    }

    fn told(runs: &[SensorRun], stated: Option<f64>) -> Result<(Vec<String>, Vec<String>), Refusal> {
        let mut warnings = Vec::new();
        let kept = believed(runs.to_vec(), stated, TAU, &mut warnings)?;
        Ok((kept.into_iter().map(|r| r.name).collect(), warnings))
    }

    #[test]
    fn a_run_with_its_channels_exchanged_is_left_out_beside_two_sound_ones() {
        let runs = [run("a.csv", 1.0), run("b.csv", -1.0), run("c.csv", 1.0)];
        let (kept, warnings) = told(&runs, Some(1.0)).expect("sound runs");
        assert_eq!(kept, ["a.csv", "c.csv"]);
        assert!(warnings[0].contains("b.csv: left out: its angle turns -1.0000 times"), "{warnings:?}");
        // of two neither is right, and one alone counts as it counts
        assert!(told(&runs[..2], None).is_err());
        assert_eq!(told(&runs[1..2], Some(1.0)).expect("a run"), (vec!["b.csv".into()], vec![]));
    }

    #[test]
    fn a_channel_that_stands_still_and_one_that_copies_the_other_are_left_out_beside_sound_runs() {
        let change = |name: &str, change: fn(&mut [f64; 2])| {
            let mut run = run(name, 1.0);
            if let Reading::Channels(v) = &mut run.reading {
                v.iter_mut().for_each(change);
            }
            run
        };
        let still = change("still.csv", |z| z[1] = 0.7);
        let copy = change("copy.csv", |z| z[1] = z[0]);
        for odd in [still, copy] {
            let (kept, warnings) =
                told(&[run("a.csv", 1.0), odd.clone(), run("c.csv", 1.0)], None).expect("sound runs");
            assert!(kept == ["a.csv", "c.csv"] && warnings.len() == 1, "{}: {kept:?} {warnings:?}", odd.name);
            assert!(warnings[0].starts_with(&odd.name), "{warnings:?}");
        }
    }

    #[test]
    fn poles_that_the_channels_do_not_show_are_no_answer() {
        let runs = [run("a.csv", 4.0), run("b.csv", 4.0)];
        assert!(told(&runs, Some(4.0)).is_ok() && told(&runs, Some(-4.0)).is_ok() && told(&runs, None).is_ok());
        for stated in [1.0, 5.0, 8.0] {
            let refusal = told(&runs, Some(stated)).expect_err("other poles");
            assert!(refusal.to_string().contains("turns 4.0000 times as far"), "{refusal}");
        }
    }

    #[test]
    fn a_gap_of_whole_turns_and_a_half_loses_no_turn() {
        for missing in [450, 475, 500, 525, 550] {
            let rows: Vec<usize> = (0..2000).filter(|i| !(700..700 + missing).contains(i)).collect();
            let Follows::Turns(gain) = follows(&run("gap.csv", 1.0).subset(&rows), None, TAU) else {
                panic!("{missing}")
            };
            assert!((gain - 1.0).abs() < 0.01, "{missing}: {gain}");
        }
    }

    #[test]
    fn stations_too_far_apart_to_follow_say_nothing_against_a_run() {
        let stations = run("stations.csv", 1.0).subset(&(0..2000).step_by(60).collect::<Vec<_>>());
        assert_eq!(follows(&stations, Some(1.0), TAU), Follows::Untold);
    }
}
