//! Damaged rows: a bit that flipped, a sample that a spark hit. An angle that is off its reference for a row leaps, while those beside
//! it, in time and in position, do not. Of two channels the points of one sensor draw one closed curve, and
//! a damaged one lies beside it while those before and after, in time and in position, do not.
//!
//! The ellipse that tells is that of the median: of ellipses through a few points each, the one from which half of all rows are
//! the least apart (least median of squares, Rousseeuw 1984), then fitted once more to the rows near it. A fit to all rows
//! would be drawn towards the damage. A damaged point that lies on the ellipse all the same, mirrored, is off in its angle for a row.

use std::f64::consts::TAU;

use super::ellipse::through;
use super::rails::Rails;
use super::readout::Readout;
use super::samples::{Reading, SensorRun};
use crate::data::plausibility::{MOST_LOST, places, stretches};
use crate::numerics::angles::{followed, wrapped};
use crate::numerics::statistics::{line, median, robust_deviation, span};

/// A run of fewer rows has no usual distance from its ellipse.
const FEWEST_ROWS: usize = 40;
/// Ellipses that are tried, each through so many points: with one row in five damaged, one in six has sound points only.
const TRIED: usize = 100;
const POINTS: usize = 8;
/// Rows that judge them.
const ENOUGH_ROWS: usize = 1000;
/// Fits to the rows near the ellipse, and how near, in standard deviations.
const REFITS: usize = 3;
const NEAR: f64 = 4.0;
/// A damaged row is so many standard deviations off: the distances of a million sound ones in normal noise are below five.
const OFF: f64 = 10.0;
/// … and by this share of the amplitude: one row in a hundred that is off by less moves a gain by less than noise does.
const LEAST: f64 = 0.02;
/// An angle leaps by this at least, rad: what is mirrored at an axis is off by twice the spike, and an error that begins to last grows by
/// less from row to row.
const LEAST_LEAP: f64 = 0.05;
/// … and of a sensor that reads an angle by this: what is finer than a digit of it is no damage.
const LEAST_LEAP_OF_AN_ANGLE: f64 = 1e-3;
/// Rounds in which rows are left out.
const ROUNDS: usize = 4;
/// Rows on either side, in time and in position, that are compared with it.
const BESIDE: usize = 4;
/// … all but so many of which, damaged themselves, are off by less than this share of it. What lasts longer is no damage of a row.
const LIKE_IT: usize = BESIDE - 1;
const SOUND: f64 = 0.3;
/// Parts of the turn that are told apart, and the share of those in which rows stand that may have damaged rows alone: where a sensor rests
/// at a few positions and moves between them, the few rows that moved would be damaged beside all those that rested.
const DIRECTIONS: usize = 100;
const MOST_DIRECTIONS_LOST: f64 = 0.1;
/// A row further off than this many usual steps of the reference is not beside: between them the angle goes its own way.
const NEAR_STEPS: f64 = 3.0;
/// An angle leaps where the reference goes on in steps, of the angle, below this, rad.
const LARGEST_STEP: f64 = 0.125 * TAU;

/// The runs without damaged rows. Says of which.
pub(super) fn without_spikes(runs: Vec<SensorRun>, period: f64, warnings: &mut Vec<String>) -> Vec<SensorRun> {
    let rails = Rails::of(runs.iter().filter_map(SensorRun::channels).flatten());
    let sound = |run: SensorRun| {
        let damaged = in_rounds(&run, &rails, period);
        let count = damaged.iter().filter(|is| **is).count();
        if count == 0 || count as f64 > MOST_LOST * run.len() as f64 || empties_directions(&run, &damaged) {
            return run;
        }
        let what = match run.reading {
            Reading::Channels(_) => {
                "lie off the ellipse that the others draw, or on it where those beside them are not"
            }
            Reading::Angle(_) => "are off their reference where those beside them are not",
        };
        warnings.push(format!(
            "{}: {count} rows {what}, each by itself: {}; they are damaged and left out",
            run.name,
            places(&run.t_s, &stretches(run.len(), |i| damaged[i]))
        ));
        run.subset(&(0..run.len()).filter(|i| !damaged[*i]).collect::<Vec<_>>())
    };
    runs.into_iter().map(sound).collect()
}

/// Whether directions in which rows stand would have none left.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below DIRECTIONS")]
fn empties_directions(run: &SensorRun, damaged: &[bool]) -> bool {
    let (mut met, mut sound) = ([false; DIRECTIONS], [false; DIRECTIONS]);
    for (a, damaged) in run.reference_rad.iter().zip(damaged) {
        let direction = (a.rem_euclid(TAU) / TAU * DIRECTIONS as f64) as usize % DIRECTIONS;
        met[direction] = true;
        sound[direction] |= !damaged;
    }
    let count = |of: &[bool]| of.iter().filter(|is| **is).count() as f64;
    count(&met) - count(&sound) > MOST_DIRECTIONS_LOST * count(&met)
}

/// The damaged rows; some are alone only where others are out of the way.
fn in_rounds(run: &SensorRun, rails: &Rails, period: f64) -> Vec<bool> {
    let mut out = vec![false; run.len()];
    for _ in 0..ROUNDS {
        let kept: Vec<usize> = (0..run.len()).filter(|i| !out[*i]).collect();
        let left = run.subset(&kept);
        let found = match &left.reading {
            Reading::Channels(channels) => damaged_points(&left, channels, rails),
            Reading::Angle(theta) => damaged_angles(&left, theta, period),
        };
        if !found.contains(&true) {
            break;
        }
        kept.iter().zip(found).for_each(|(row, damaged)| out[*row] = damaged);
    }
    out
}

fn damaged_points(run: &SensorRun, channels: &[[f64; 2]], rails: &Rails) -> Vec<bool> {
    let rows = run.len();
    let ellipse = if rows >= FEWEST_ROWS { usual_ellipse(channels) } else { None };
    let Some(ellipse) = ellipse else { return vec![false; rows] };
    let off: Vec<f64> = channels.iter().map(|z| distance(&ellipse, *z)).collect();
    let is_whole = |i: &usize| !rails.clips(channels[*i]);
    let far: Vec<usize> = beyond_usual(&off).into_iter().filter(is_whole).collect();
    let mut damaged = vec![false; rows];
    for row in alone(&off, &run.reference_rad, &far) {
        damaged[row] = true;
    }
    for row in leaps(run, channels, &ellipse, &damaged) {
        damaged[row] = true;
    }
    damaged
}

fn damaged_angles(run: &SensorRun, theta: &[f64], period: f64) -> Vec<bool> {
    let mut damaged = vec![false; run.len()];
    let off = if run.len() >= FEWEST_ROWS { leap_of_each(theta, &run.reference_rad, period) } else { None };
    let Some((off, error)) = off else { return damaged };
    let noise = robust_deviation(error.windows(2).map(|w| w[1] - w[0])) / std::f64::consts::SQRT_2;
    let least = (OFF * noise.max(robust_deviation(off.iter().copied()))).max(LEAST_LEAP_OF_AN_ANGLE);
    let far: Vec<usize> = (0..off.len()).filter(|i| off[*i] > least).collect();
    alone(&off, &run.reference_rad, &far).into_iter().for_each(|row| damaged[row] = true);
    damaged
}

/// Rows that are off by far more than the usual one.
fn beyond_usual(off: &[f64]) -> Vec<usize> {
    let least = f64::max(OFF * robust_deviation(off.iter().copied()), LEAST);
    (0..off.len()).filter(|i| off[*i] > least).collect()
}

/// Those of the rows `far` that are off while those beside them, in time and in position, are not.
fn alone(off: &[f64], reference_rad: &[f64], far: &[usize]) -> Vec<usize> {
    let rows = off.len();
    if far.is_empty() {
        return Vec::new();
    }
    let mut by_position: Vec<usize> = (0..rows).collect();
    let position = |i: usize| reference_rad[i].rem_euclid(TAU);
    by_position.sort_by(|a, b| position(*a).total_cmp(&position(*b)));
    let mut place = vec![0; rows];
    by_position.iter().enumerate().for_each(|(at, row)| place[*row] = at);
    let is_alone = |row: usize, around: &dyn Fn(usize) -> f64, at: usize| {
        beside(at, rows).filter(|j| around(*j) > SOUND * off[row]).count() <= LIKE_IT
    };
    let in_both =
        |row: &usize| is_alone(*row, &|j| off[j], *row) && is_alone(*row, &|j| off[by_position[j]], place[*row]);
    far.iter().copied().filter(in_both).collect()
}

/// Rows, of those that are not damaged, whose angle is off for them alone while the reference goes on in small steps.
fn leaps(run: &SensorRun, channels: &[[f64; 2]], ellipse: &Readout, damaged: &[bool]) -> Vec<usize> {
    let rows: Vec<usize> = (0..run.len()).filter(|i| !damaged[*i]).collect();
    let reference: Vec<f64> = rows.iter().map(|i| run.reference_rad[*i]).collect();
    let theta: Vec<f64> = rows.iter().map(|i| ellipse.angle(channels[*i])).collect();
    let Some((off, _)) = leap_of_each(&theta, &reference, TAU) else { return Vec::new() };
    let far: Vec<usize> = beyond_usual(&off).into_iter().filter(|i| off[*i] > LEAST_LEAP).collect();
    alone(&off, &reference, &far).into_iter().map(|i| rows[i]).collect()
}

/// By how much the angle of each row is off that row beside it whose angle goes best with its own, 0 where none is near, and what it is off its reference;
/// `None` where the reference stands still, or goes on in steps so large that it does not tell where an angle is.
fn leap_of_each(theta: &[f64], reference: &[f64], period: f64) -> Option<(Vec<f64>, Vec<f64>)> {
    if span(reference) <= 0.0 {
        return None;
    }
    let theta = followed(theta, reference, period);
    let (gain, _) = line(reference, &theta);
    let mut steps: Vec<f64> = reference.windows(2).map(|w| (gain * (w[1] - w[0])).abs()).collect();
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    let usual = median(&mut steps);
    if usual > LARGEST_STEP * period / TAU {
        return None;
    }
    let error: Vec<f64> = theta.iter().zip(reference).map(|(t, a)| t - gain * a).collect();
    let apart = |i: usize, j: usize| wrapped(error[i] - error[j], period).abs();
    let is_near = |i: usize, j: usize| (gain * (reference[i] - reference[j])).abs() <= NEAR_STEPS * usual.max(mean);
    let leap = |i: usize| {
        let near = beside(i, error.len()).filter(|j| is_near(i, *j));
        near.map(|j| apart(i, j)).min_by(f64::total_cmp).unwrap_or(0.0)
    };
    Some(((0..error.len()).map(leap).collect(), error))
}

/// The rows on either side of one.
fn beside(at: usize, rows: usize) -> impl Iterator<Item = usize> {
    (at.saturating_sub(BESIDE)..(at + BESIDE + 1).min(rows)).filter(move |j| *j != at)
}

/// The ellipse that most points lie near.
fn usual_ellipse(channels: &[[f64; 2]]) -> Option<Readout> {
    let some: Vec<[f64; 2]> = channels.iter().step_by((channels.len() / ENOUGH_ROWS).max(1)).copied().collect();
    let mut best: Option<(f64, Readout)> = None;
    for first in 0..TRIED {
        // the multiples of the golden ratio are spread as evenly as any
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the rows")]
        let row = |j: usize| ((((first * POINTS + j) as f64 * 0.618_033_988_75) % 1.0) * some.len() as f64) as usize;
        let Some(ellipse) = through((0..POINTS).map(|j| &some[row(j)])) else { continue };
        let typical = robust_deviation(some.iter().map(|z| distance(&ellipse, *z)));
        if best.as_ref().is_none_or(|(least, _)| typical < *least) {
            best = Some((typical, ellipse));
        }
    }
    let (_, mut ellipse) = best?;
    for _ in 0..REFITS {
        let usual = robust_deviation(some.iter().map(|z| distance(&ellipse, *z)));
        let near: Vec<[f64; 2]> = some.iter().filter(|z| distance(&ellipse, **z) <= NEAR * usual).copied().collect();
        ellipse = through(near.iter())?;
    }
    Some(ellipse)
}

fn distance(ellipse: &Readout, z: [f64; 2]) -> f64 {
    let [x, y] = ellipse.undo(z);
    (x.hypot(y) - 1.0).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::statistics::remembered;
    use crate::recording::Role;

    /// Ten turns of channels of unlike gain, with noise of a thousandth, in this order of their rows.
    fn run(rows: usize, of: impl Fn(usize, f64) -> [f64; 2]) -> SensorRun {
        let reference_rad: Vec<f64> = (0..rows).map(|i| 10.0 * TAU * i as f64 / rows as f64).collect();
        let noise = remembered(0.0, 2 * rows, 11);
        let reading = reference_rad.iter().enumerate().map(|(i, a)| {
            let [x, y] = of(i, *a);
            [x + 0.001 * noise[2 * i], y + 0.001 * noise[2 * i + 1]]
        });
        SensorRun {
            name: "sensor.csv".into(),
            number: 0,
            role: Role::Fit,
            commanded: false,
            t_s: (0..rows).map(|i| 0.01 * i as f64).collect(),
            rate_rad_s: vec![1.0; rows],
            acceleration_rad_s2: vec![0.0; rows],
            temp_c: None,
            recorded: None,
            reading: Reading::Channels(reading.collect()),
            reference_rad,
        }
    }

    fn ellipse(a: f64) -> [f64; 2] {
        [0.02 + a.cos(), 1.03 * a.sin() + 0.01 * a.cos()]
    }

    fn left(run: &SensorRun) -> (usize, Vec<String>) {
        let mut warnings = Vec::new();
        let left = without_spikes(vec![run.clone()], TAU, &mut warnings);
        (run.len() - left[0].len(), warnings)
    }

    #[test]
    fn rows_that_a_spark_hit_are_named_and_left_out() {
        for (every, size) in [(101, 1.0), (11, 0.3), (7, -2.0)] {
            let spiked = run(2000, |i, a| {
                let [x, y] = ellipse(a);
                [x, y + if i % every == 3 { size } else { 0.0 }]
            });
            let planted = (0..2000).filter(|i| i % every == 3).count();
            let (lost, warnings) = left(&spiked);
            // some are mirrored and lie on the ellipse
            assert!(lost >= planted - 1 && lost <= planted, "{lost} of {planted} of {size}");
            assert!(warnings[0].contains("off the ellipse that the others draw"), "{warnings:?}");
        }
    }

    #[test]
    fn damaged_rows_that_stand_side_by_side_are_found_one_after_the_other() {
        let is_hit = |i: usize| remembered(0.0, 1, i as u64)[0] > 1.28;
        let spiked = run(2000, |i, a| {
            let [x, y] = ellipse(a);
            [x, y + if is_hit(i) { 2.0 } else { 0.0 }]
        });
        let planted = (0..2000).filter(|i| is_hit(*i)).count();
        let (lost, _) = left(&spiked);
        assert!((150..250).contains(&planted) && lost.abs_diff(planted) <= 2, "{lost} of {planted}");
    }

    /// An encoder at the stations of one turn, with harmonics, a line of the motor at half their number, and noise.
    #[test]
    fn an_angle_that_is_off_for_a_row_is_left_out_and_its_errors_are_not() {
        let noise = remembered(0.0, 201, 5);
        let at = |i: usize| TAU * i as f64 / 200.0;
        let error = |i: usize| 0.02 * at(i).sin() + 4e-3 * (4.0 * at(i)).cos() + 4e-4 * (100.0 * at(i)).cos();
        let of = |hit: &[usize]| {
            let mut encoder = run(201, |_, a| ellipse(a));
            encoder.reference_rad = (0..201).map(at).collect();
            let spike = |i: usize| if hit.contains(&i) { 0.05 } else { 0.0 };
            let theta = (0..201).map(|i| (at(i) + error(i) + spike(i) + 3e-4 * noise[i]).rem_euclid(TAU));
            encoder.reading = Reading::Angle(theta.collect());
            encoder
        };
        assert_eq!(left(&of(&[])), (0, vec![]));
        let (lost, warnings) = left(&of(&[17, 90, 160]));
        assert!(lost == 3 && warnings[0].contains("off their reference"), "{lost}: {warnings:?}");
    }

    #[test]
    fn a_row_behind_a_gap_is_no_damage() {
        let mut encoder = run(61, |_, a| ellipse(a));
        // every third of 200 stations, and one at the end of the turn
        let station = |i: usize| if i == 60 { 199.0 } else { 3.0 * i as f64 };
        encoder.reference_rad = (0..61).map(|i| TAU * station(i) / 200.0).collect();
        let error = |a: f64| 0.01 * a.cos() + 2e-5 * (40.0 * a).sin();
        encoder.reading = Reading::Angle(encoder.reference_rad.iter().map(|a| a + error(*a)).collect());
        assert_eq!(left(&encoder), (0, vec![]));
    }

    #[test]
    fn the_order_of_the_rows_does_not_matter() {
        let spiked = run(2000, |i, a| if i == 703 { [0.0, 0.0] } else { ellipse(a) });
        let shuffled = spiked.subset(&(0..2000).map(|i| (i * 7919) % 2000).collect::<Vec<_>>());
        assert_eq!((left(&spiked).0, left(&shuffled).0), (1, 1));
    }

    #[test]
    fn what_a_sensor_does_at_a_position_or_for_a_time_is_no_damage() {
        let bent = run(2000, |_, a| ellipse(a + 0.05 * (3.0 * a).sin()).map(|v| v - 0.2 * v.powi(3)));
        let notched = run(2000, |_, a| ellipse(a).map(|v| if a % TAU < 0.05 { 0.8 * v } else { v }));
        let flawed = run(2000, |_, a| ellipse(if a % TAU < 0.05 { a + 0.2 } else { a }));
        let warmed = run(2000, |i, a| ellipse(a).map(|v| v * (1.0 + 1e-4 * i as f64)));
        let clipped = run(2000, |_, a| ellipse(a).map(|v| v.min(0.9)));
        for (name, run) in
            [("bent", bent), ("notched", notched), ("flawed", flawed), ("warmed", warmed), ("clipped", clipped)]
        {
            for run in [&run, &run.subset(&(0..2000).map(|i| (i * 7919) % 2000).collect::<Vec<_>>())] {
                assert_eq!(left(run), (0, vec![]), "{name}");
            }
        }
        // a sensor that rests at four positions, and between them bends by what the rests do not tell
        let mut rested = run(400, |i, _| {
            let a = 0.25 * TAU * ((i / 100) as f64 + (i % 100).saturating_sub(90) as f64 / 10.0);
            ellipse(a).map(|v| v + 0.3 * (2.0 * a).sin().powi(2))
        });
        rested.reference_rad = (0..400)
            .map(|i| 0.25 * TAU * ((i / 100) as f64 + (i % 100_usize).saturating_sub(90) as f64 / 10.0))
            .collect();
        assert_eq!(left(&rested), (0, vec![]), "rested");
        let knocked = run(2000, |i, a| ellipse(a).map(|v| if (900..920).contains(&i) { v + 0.3 } else { v }));
        assert_eq!(left(&knocked), (0, vec![]));
    }
}
