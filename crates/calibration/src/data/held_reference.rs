//! A table angle that is read more slowly than the instrument: it stands for several rows at a time while the instrument turns on.
//! Between its readings it is taken to go on evenly.
//!
//! That is no table that steps from station to station, where the instrument stands too: within the rows that a reading stands for,
//! without the first of them, the instrument turns as far as their share of its way to the next reading. Nor is it the last digit of an
//! encoder, which stands for as long as the table takes through it.

use crate::data::plausibility::leave_out;
use crate::numerics::angles::unwrapped;
use crate::numerics::interpolation;
use crate::numerics::statistics::{median, span};
use crate::recording::Recording;

/// Readings that tell how long one stands, and the rows that it stands for at least.
const FEWEST_READINGS: usize = 16;
const FEWEST_ROWS: usize = 3;
/// Share of the readings that stand for the usual number of rows, or one more or less.
const ALIKE: f64 = 0.9;
/// Share, of what an even turn would be, that the instrument turns by within a reading.
const TURNS_ON: f64 = 0.5;
/// A digit of an encoder is below this, deg, and of one size: steps that differ by this share of the usual are none. A table at one rate
/// that is recorded as it was commanded may look like one, and is left as it is.
const LARGEST_DIGIT_DEG: f64 = 2.0;
const UNLIKE: f64 = 0.01;
/// A step above this, deg, may be one the other way round.
const LARGEST_STEP_DEG: f64 = 120.0;

/// Lets a table angle that was read more slowly than the rest go on evenly between its readings, and says so.
pub(crate) fn go_on_evenly(recording: &mut Recording) -> Option<String> {
    let table = recording.table_deg.as_ref()?;
    let readings = readings(table);
    if readings.len() <= FEWEST_READINGS {
        return None;
    }
    let stands: Vec<usize> = readings.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = median(&mut stands.iter().map(|n| *n as f64).collect::<Vec<_>>());
    let alike = stands.iter().filter(|n| (**n as f64 - usual).abs() <= 1.0).count();
    if usual < FEWEST_ROWS as f64 || (alike as f64) < ALIKE * stands.len() as f64 {
        return None;
    }
    let values = unwrapped(readings.iter().map(|i| table[*i].to_radians()), std::f64::consts::TAU);
    let mut steps: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs().to_degrees()).collect();
    steps.sort_by(f64::total_cmp);
    let step = steps[steps.len() / 2];
    let spread = span(&steps[steps.len() / 10..steps.len() - steps.len() / 10]);
    if step > LARGEST_STEP_DEG || (step < LARGEST_DIGIT_DEG && spread < UNLIKE * step) {
        return None;
    }
    let theta = turned(recording)?;
    let (mut within, mut to_the_next) = (0.0, 0.0);
    for reading in readings.windows(2).filter(|r| r[1] - r[0] >= FEWEST_ROWS) {
        let way = theta[reading[1]] - theta[reading[0]];
        within += (theta[reading[1] - 1] - theta[reading[0] + 1]) * way;
        to_the_next += way * way;
    }
    if within < TURNS_ON * (usual - 2.0) / usual * to_the_next {
        return None;
    }
    let name = recording.source.display().to_string();
    let read_s: Vec<f64> = readings.iter().map(|i| recording.t_s[*i]).collect();
    let evenly = recording.t_s.iter().map(|t| interpolation::at(&read_s, *t, |i| values[i]).to_degrees());
    recording.table_deg = Some(evenly.collect());
    // what comes after the last reading is not known
    let last = readings[readings.len() - 1];
    let unknown: Vec<bool> = (0..recording.len()).map(|row| row > last).collect();
    leave_out(recording, &unknown);
    Some(format!(
        "{name}: table_deg stands for {usual:.0} rows at a time while the instrument turns: it was read more slowly, and is taken to go on \
         evenly between its readings"
    ))
}

/// Rows at which a table angle was read anew.
#[allow(clippy::float_cmp, reason = "a value that stands still is the same to the last bit")]
fn readings(table: &[f64]) -> Vec<usize> {
    (0..table.len()).filter(|&i| i == 0 || table[i] != table[i - 1]).collect()
}

/// The instrument's angle, or that of its channels about their middle, followed from row to row, rad.
fn turned(recording: &Recording) -> Option<Vec<f64>> {
    if let Some(theta) = &recording.theta_deg {
        let half_turn = span(theta) <= 181.0;
        let period = if half_turn { std::f64::consts::PI } else { std::f64::consts::TAU };
        return Some(unwrapped(theta.iter().map(|d| d.to_radians()), period));
    }
    let (x, y) = (recording.xc_v.as_ref()?, recording.yc_v.as_ref()?);
    let middle = |v: &[f64]| {
        let ends = v.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(*v), h.max(*v)]);
        0.5 * (ends[0] + ends[1])
    };
    let (x0, y0) = (middle(x), middle(y));
    Some(unwrapped(x.iter().zip(y).map(|(x, y)| (y - y0).atan2(x - x0)), std::f64::consts::TAU))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An encoder on a table that speeds up and slows down, whose angle is read every so many rows.
    fn read_every(rows: usize) -> Recording {
        let t_s: Vec<f64> = (0..600).map(|i| 0.01 * f64::from(i)).collect();
        let angle = |t: f64| 60.0 * t + 20.0 * (0.5 * t).sin();
        Recording {
            theta_deg: Some(t_s.iter().map(|t| (angle(*t) + 0.01 * (70.0 * t).sin()).rem_euclid(360.0)).collect()),
            table_deg: Some((0..600).map(|i| angle(t_s[i / rows * rows]).rem_euclid(360.0)).collect()),
            t_s,
            ..Recording::default()
        }
    }

    #[test]
    fn a_table_that_was_read_every_tenth_row_goes_on_evenly() {
        let exact = read_every(1).table_deg.unwrap_or_default();
        for rows in [3, 10] {
            let mut recording = read_every(rows);
            assert!(go_on_evenly(&mut recording).is_some_and(|said| said.contains(&format!("for {rows} rows"))));
            assert_eq!(recording.len(), (600 - 1) / rows * rows + 1);
            let off = recording
                .table_deg
                .iter()
                .flatten()
                .zip(&exact)
                .map(|(a, b)| (a - b + 180.0).rem_euclid(360.0) - 180.0);
            let worst = off.fold(0.0, |m: f64, e| m.max(e.abs()));
            assert!(worst < 0.01, "{rows}: {worst}°");
        }
    }

    #[test]
    fn what_is_read_with_every_row_stations_and_digits_are_left_as_they_are() {
        let mut digits = read_every(1);
        digits.table_deg.iter_mut().flatten().for_each(|a| *a = (*a / 0.35).round() * 0.35);
        let mut coarse = read_every(1);
        coarse.table_deg.iter_mut().flatten().for_each(|a| *a = (*a / 8.0).round() * 8.0);
        // at one rate a digit stands for the same number of rows
        let mut even = read_every(1);
        even.theta_deg = Some(even.t_s.iter().map(|t| (20.0 * t).rem_euclid(360.0)).collect());
        even.table_deg = Some(even.t_s.iter().map(|t| (20.0 * t).round()).collect());
        let mut stations = read_every(10);
        let there = stations.table_deg.clone();
        stations.theta_deg =
            there.map(|v| v.iter().enumerate().map(|(i, a)| a + 0.3 * (7.3 * i as f64).sin()).collect());
        let mut resting = read_every(1);
        resting.table_deg.iter_mut().flatten().for_each(|a| *a = 30.0);
        for (name, mut recording) in [
            ("each row", read_every(1)),
            ("digits", digits),
            ("coarse", coarse),
            ("even", even),
            ("stations", stations),
            ("resting", resting),
        ] {
            let before = recording.clone();
            assert_eq!(go_on_evenly(&mut recording), None, "{name}");
            assert_eq!(recording.table_deg, before.table_deg, "{name}");
        }
    }
}
