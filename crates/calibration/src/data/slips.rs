//! Where the clock of a recording slips, or samples are lost that the time stamps do not show: the angle jumps against the
//! input from one sample to the next, by a sample's turn or more, and stays there.
//!
//! Such a jump is no error of the instrument. A segment that ends there and another that begins there have a bias each, and
//! nothing of it is left.

use crate::numerics::angles::wrapped;
use crate::numerics::statistics::{median, robust_deviation};

/// A jump is this many deviations of the usual steps.
const JUMP: f64 = 10.0;
/// It is at least this share of the angle's usual step, and of its period.
const LEAST_STEP: f64 = 0.8;
const LEAST_SHARE: f64 = 1e-3;
/// Samples on either side that have to bear it out.
const BESIDE: usize = 12;
/// What is left of the jump between the medians of these.
const STAYS: f64 = 0.5;

/// A step of the angle against the input that is longer than this share of the period may be one of a period less, the other way.
const EITHER_WAY: f64 = 0.25;

/// A jump of the angle against the input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slip {
    /// first sample after it
    pub(crate) at: usize,
    /// rad
    pub(crate) by: f64,
}

/// Steps of the bearing, rad, against those that are expected, each the shorter way round the period.
fn steps_off(bearing: &[f64], expected: &[f64], period: f64) -> Vec<f64> {
    let steps = bearing.windows(2).zip(expected.windows(2));
    steps.map(|(b, e)| wrapped((b[1] - b[0]) - (e[1] - e[0]), period)).collect()
}

/// Share of the steps that may be one of a period less, the other way: where they are many, the angle cannot be followed.
pub(crate) fn either_way(bearing: &[f64], expected: &[f64], period: f64) -> f64 {
    let off = steps_off(bearing, expected, period);
    off.iter().filter(|d| d.abs() > EITHER_WAY * period).count() as f64 / off.len().max(1) as f64
}

/// The slips in a series of bearings, rad, of this period, that should go as `expected`, rad.
pub(crate) fn slips(bearing: &[f64], expected: &[f64], period: f64) -> Vec<Slip> {
    let n = bearing.len().min(expected.len());
    if n < 2 * BESIDE + 1 {
        return Vec::new();
    }
    let step = |v: &[f64], i: usize| v[i] - v[i - 1];
    let off = steps_off(&bearing[..n], &expected[..n], period);
    let usual = median(&mut (1..n).map(|i| step(expected, i).abs()).collect::<Vec<_>>());
    let limit = (JUMP * robust_deviation(off.iter().copied())).max(LEAST_STEP * usual).max(LEAST_SHARE * period);
    let mut along = vec![0.0; n];
    for i in 1..n {
        along[i] = along[i - 1] + off[i - 1];
    }
    let mut out: Vec<Slip> = Vec::new();
    for at in BESIDE..n - BESIDE {
        let by = off[at - 1];
        if by.abs() <= limit {
            continue;
        }
        let (mut before, mut after) = (along[at - BESIDE..at].to_vec(), along[at..at + BESIDE].to_vec());
        let (low, high) = (median(&mut before), median(&mut after));
        let noise =
            robust_deviation(before.iter().map(|v| v - low)).max(robust_deviation(after.iter().map(|v| v - high)));
        let stays = (high - low) * by.signum();
        if stays > STAYS * by.abs() && stays > JUMP * noise {
            out.push(Slip { at, by });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A pattern at 390 deg/s and 100 Hz with a readout error of a quarter of a degree.
    fn followed(spike: Option<usize>, slip: Option<usize>) -> (Vec<f64>, Vec<f64>) {
        let expected: Vec<f64> = (0..2000).map(|i| 0.068 * f64::from(i)).collect();
        let mut bearing: Vec<f64> = expected.iter().map(|e| e + 0.0045 * (2.0 * e).sin()).collect();
        if let Some(i) = slip {
            bearing[i..].iter_mut().for_each(|b| *b += 0.34);
        }
        if let Some(i) = spike {
            bearing[i] += 0.5;
        }
        (bearing.iter().map(|b| b.rem_euclid(PI)).collect(), expected)
    }

    #[test]
    fn a_clock_that_slips_by_fifty_milliseconds_is_found_where_it_does() {
        let (bearing, expected) = followed(None, Some(1001));
        let found = slips(&bearing, &expected, PI);
        assert_eq!(found.iter().map(|s| s.at).collect::<Vec<_>>(), [1001]);
        assert!((found[0].by - 0.34).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn a_spike_and_a_readout_error_are_no_slips() {
        let (bearing, expected) = followed(Some(500), None);
        assert_eq!(slips(&bearing, &expected, PI), []);
    }

    #[test]
    fn steps_that_may_go_either_way_are_counted() {
        let (bearing, expected) = followed(None, None);
        assert_eq!(either_way(&bearing, &expected, PI), 0.0);
        // every tenth is turned by 60°, so that a step out and one back may be 120° the other way
        let turned = |(i, b): (usize, &f64)| if i % 10 == 5 { (b + PI / 3.0).rem_euclid(PI) } else { *b };
        let turned: Vec<f64> = bearing.iter().enumerate().map(turned).collect();
        assert!((either_way(&turned, &expected, PI) - 0.2).abs() < 1e-3);
    }
}
