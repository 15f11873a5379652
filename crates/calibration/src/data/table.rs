//! The input angle of a run: the table's own as a continuous one, or the rate integrated.
//!
//! A table's angle that begins anew at each turn tells its steps but for whole turns. The rate tells those; a column that
//! counts beyond a turn has them itself; where there is neither, the shortest step is as good as any other that a table makes.

use std::f64::consts::TAU;

use crate::numerics::angles::wrapped;
use crate::numerics::interpolation::accumulated;
use crate::numerics::statistics::median;
use crate::recording::Recording;

/// A column that begins anew at each turn does not spread over more than this, degrees, by whichever end it begins,
const NO_TURN: f64 = 720.0;
/// nor over more than a turn, degrees, without beginning anew from one row to the next.
const A_TURN: f64 = 360.0;
/// A step that takes so many times the usual interval is a gap: what the column does there is not seen.
const GAP: f64 = 1.5;
/// Share of the rows at either end that may be further out: outliers.
const OUTLIERS: f64 = 0.02;
/// A step of a column that counts turns is none of the table's beyond this many times its usual one, and half a turn: the
/// counter began anew.
const BEGINS_ANEW: f64 = 4.0;
const HALF_A_TURN: f64 = 180.0;

/// The input angle, rad, and whether whole turns of the table from sample to sample would not show in it.
pub(crate) fn input_angle(recording: &mut Recording) -> (Vec<f64>, bool) {
    let table = recording.table_deg.take();
    let rate = recording.rate_dps.take();
    let t = &recording.t_s;
    match (table, rate) {
        (Some(table), Some(rate)) => (along_rate(&table, &rate, t), false),
        (Some(table), None) => {
            let counts = counts_turns(&table, t);
            (turned(&table, t), !counts)
        }
        (None, Some(rate)) => (integrated(t, &rate), false),
        (None, None) => (vec![0.0; t.len()], false),
    }
}

/// The angle, rad, that a rate in degrees goes by trapezoids.
pub(crate) fn integrated(t: &[f64], rate: &[f64]) -> Vec<f64> {
    accumulated(t, &rate.iter().map(|r| r.to_radians()).collect::<Vec<_>>())
}

/// The table's angle in degrees as a continuous one in rad: each step is the nearest to what the rate says.
fn along_rate(table: &[f64], rate: &[f64], t: &[f64]) -> Vec<f64> {
    let by_rate = |i: usize| 0.5 * (rate[i] + rate[i - 1]).to_radians() * (t[i] - t[i - 1]);
    followed(table, by_rate)
}

/// The same where there is no rate: each step is the column's own where it counts turns, and else the shortest.
pub(crate) fn turned(table_deg: &[f64], t_s: &[f64]) -> Vec<f64> {
    if !counts_turns(table_deg, t_s) {
        return followed(table_deg, |_| 0.0);
    }
    let own = |i: usize| table_deg[i] - table_deg[i - 1];
    let passed = |i: usize| t_s[i] - t_s[i - 1];
    let usual = median(&mut (1..table_deg.len()).map(|i| own(i).abs()).collect::<Vec<_>>());
    let usual_s = median(&mut (1..table_deg.len()).map(passed).collect::<Vec<_>>());
    let mut last_rate = 0.0;
    let steps = (1..table_deg.len()).map(|i| {
        // in a gap the table goes on as far as the gap is long
        let intervals = (passed(i) / usual_s).max(1.0);
        if own(i).abs() <= (BEGINS_ANEW * usual * intervals).max(HALF_A_TURN) {
            last_rate = own(i).to_radians() / passed(i);
        }
        last_rate * passed(i)
    });
    let steps: Vec<f64> = steps.collect();
    followed(table_deg, |i| steps[i - 1])
}

/// Each step is the nearest to what is expected, but for whole turns.
fn followed(table_deg: &[f64], expected: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::with_capacity(table_deg.len());
    for (i, d) in table_deg.iter().enumerate() {
        let raw = d.to_radians();
        let Some(last) = out.last() else {
            out.push(raw);
            continue;
        };
        let expected = expected(i);
        out.push(last + expected + wrapped(raw - last - expected, TAU));
    }
    out
}

/// Whether the column goes on beyond a turn.
fn counts_turns(table_deg: &[f64], t_s: &[f64]) -> bool {
    let mut sorted = table_deg.to_vec();
    sorted.sort_by(f64::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
    let out = (OUTLIERS * sorted.len() as f64).ceil() as usize;
    let inner = sorted.get(out..sorted.len().saturating_sub(out)).unwrap_or_default();
    let Some(spread) = inner.first().zip(inner.last()).map(|(low, high)| high - low) else { return false };
    let usual_s = median(&mut t_s.windows(2).map(|t| t[1] - t[0]).collect::<Vec<_>>());
    let begins_anew = |(v, t): (&[f64], &[f64])| t[1] - t[0] <= GAP * usual_s && (v[1] - v[0]).abs() > HALF_A_TURN;
    spread > NO_TURN || spread > A_TURN && !table_deg.windows(2).zip(t_s.windows(2)).any(begins_anew)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turning(step_deg: f64) -> Vec<f64> {
        (0..400).map(|i| 30.0 + step_deg * f64::from(i)).collect()
    }

    fn seconds(rows: usize) -> Vec<f64> {
        (0..rows).map(|i| 0.5 * i as f64).collect()
    }

    fn steps_deg(angle: &[f64]) -> Vec<f64> {
        angle.windows(2).map(|w| (w[1] - w[0]).to_degrees()).collect()
    }

    #[test]
    fn a_column_that_counts_turns_is_followed_by_its_own_steps() {
        for step in [3.0, 242.0, -242.0, 500.0] {
            assert!(
                steps_deg(&turned(&turning(step), &seconds(400))).iter().all(|d| (d - step).abs() < 1e-9),
                "{step}"
            );
        }
    }

    /// Blocks of a recording that are held out leave gaps in the rest: a table that turned by 280° in one had gone 80° back.
    #[test]
    fn a_table_goes_on_in_a_gap() {
        let keeps = |i: &usize| i % 60 < 40;
        let there_and_back: Vec<f64> = (0..400).map(|i| 250.0 * (0.09 * f64::from(i)).sin()).collect();
        for column in [turning(14.0), there_and_back] {
            let kept: Vec<usize> = (0..400).filter(keeps).collect();
            let of = |v: &[f64]| kept.iter().map(|i| v[*i]).collect::<Vec<f64>>();
            let angle = turned(&of(&column), &of(&seconds(400)));
            assert!(angle.iter().zip(of(&column)).all(|(is, was)| (is.to_degrees() - was).abs() < 1e-9));
        }
    }

    #[test]
    fn a_counter_that_begins_anew_and_an_outlier_are_no_turns() {
        let mut column = turning(242.0);
        column[200..].iter_mut().for_each(|d| *d -= 360.0 * 130.0);
        assert!(steps_deg(&turned(&column, &seconds(400))).iter().all(|d| (d - 242.0).abs() < 1e-9));
        let mut within = turning(10.0).iter().map(|d| d.rem_euclid(360.0)).collect::<Vec<_>>();
        within[100] *= 1e3;
        assert!(!counts_turns(&within, &seconds(400)));
        let steps = steps_deg(&turned(&within, &seconds(400)));
        assert!(steps.iter().filter(|d| (*d - 10.0).abs() > 1e-9).count() <= 2);
    }

    #[test]
    fn a_column_within_a_turn_leaves_whole_turns_open_unless_there_is_a_rate() {
        let column: Vec<f64> = turning(242.0).iter().map(|d| d.rem_euclid(360.0)).collect();
        let t_s = seconds(column.len());
        let with = |rate_dps: Option<Vec<f64>>| {
            let table_deg = Some(column.clone());
            input_angle(&mut Recording { t_s: t_s.clone(), table_deg, rate_dps, ..Recording::default() })
        };
        let (angle, is_open) = with(None);
        assert!(is_open && steps_deg(&angle).iter().all(|d| (d + 118.0).abs() < 1e-9));
        let (angle, is_open) = with(Some(vec![484.0; column.len()]));
        assert!(!is_open && steps_deg(&angle).iter().all(|d| (d - 242.0).abs() < 1e-9));
    }
}
