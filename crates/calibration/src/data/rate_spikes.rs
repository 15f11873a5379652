//! Rows whose rate leaps: no table goes at another rate for one row and back in the next, but numbers are damaged so.
//!
//! The rate counts the whole turns of the input from row to row. One row in which it is a million times too large makes a
//! lever of hundreds of thousands of degrees, along which any angular gain closes to the next half turn.

use crate::data::plausibility::{leave_out as leave_out_rows, places, stretches};
use crate::recording::Recording;

/// A leap is this many times the steps that the rate usually makes, of which [`USUAL`] are smaller.
const LEAP: f64 = 30.0;
const USUAL: f64 = 0.9;
/// … and more than this share of the rate before and after.
const LEAST: f64 = 0.02;
/// Before and after it the rates are the same within this share of the leap.
const BACK: f64 = 0.2;

/// Leaves out rows whose rate is a leap, and says so.
pub(super) fn leave_out(recording: &mut Recording, name: &str, warnings: &mut Vec<String>) {
    let Some(rate) = recording.rate_dps.as_deref() else { return };
    let leaps = leaps(rate);
    let count = leaps.iter().filter(|is| **is).count();
    if count == 0 {
        return;
    }
    let rows = stretches(leaps.len(), |i| leaps[i]);
    warnings.push(format!(
        "{name}: rate_dps leaps for single rows, which no table does: {}; {count} rows are left out",
        places(&recording.t_s, &rows)
    ));
    leave_out_rows(recording, &leaps);
}

/// Which rows have a rate unlike that before and after, which are alike.
fn leaps(rate: &[f64]) -> Vec<bool> {
    let n = rate.len();
    let mut out = vec![false; n];
    if n < 4 {
        return out;
    }
    let mut steps: Vec<f64> = rate.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the steps")]
    let at = (USUAL * (steps.len() - 1) as f64) as usize;
    let usual = *steps.select_nth_unstable_by(at, f64::total_cmp).1;
    for (i, out) in out.iter_mut().enumerate() {
        let others = match i {
            0 => [1, 2],
            _ if i + 1 == n => [n - 2, n - 3],
            _ => [i - 1, i + 1],
        }
        .map(|j| rate[j]);
        let leap = others.iter().map(|r| (rate[i] - r).abs()).fold(f64::INFINITY, f64::min);
        let size = others.iter().map(|r| r.abs()).fold(0.0, f64::max);
        let back = (others[1] - others[0]).abs();
        *out = leap > LEAP * usual && leap > LEAST * size && back < BACK * leap;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::plausibility::mend;
    use crate::data::plausibility::tests::recorded;

    #[test]
    fn a_rate_that_leaps_for_a_row_is_named_and_left_out() {
        for (size, at) in [(1e6, 700), (-1.0, 0), (0.0, 1999), (10.0, 3)] {
            let mut recording = recorded();
            recording.rate_dps.iter_mut().for_each(|rate| rate[at] *= size);
            let findings = mend(&mut recording);
            assert!(findings.broken.is_none() && findings.warnings[0].contains("rate_dps leaps"), "{findings:?}");
            let said = format!("rows {0} to {0} ", at + 1);
            assert!(findings.warnings[0].contains(&said) && recording.len() == 1999, "{findings:?}");
        }
    }

    #[test]
    fn starts_stops_swings_and_noise_are_no_leaps() {
        let rate = |of: fn(f64) -> f64| (0..2000).map(|i| of(f64::from(i))).collect::<Vec<_>>();
        for (name, of) in [
            ("a step", (|i| if i < 900.0 { 100.0 } else { -100.0 }) as fn(f64) -> f64),
            ("a pause of two rows", |i| if (900.0..902.0).contains(&i) { 0.0 } else { 100.0 }),
            ("a swing", |i| 50.0 * (0.7 * i).sin()),
            ("whole deg/s", |i| (100.6 + 0.1 * (i * i).sin()).round()),
            ("noise about rest", |i| (i * i).sin().powi(9)),
        ] {
            assert!(!leaps(&rate(of)).contains(&true), "{name}");
        }
    }
}
