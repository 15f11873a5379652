//! Rows whose quadrature channels leap: the angle hardly shows it, but what a split of the frequencies makes of that row's quadrature
//! would stay in the angle to the end of the recording.

use crate::data::plausibility::{places, stretches};
use crate::numerics::statistics::median;
use crate::recording::Recording;

/// A leap is this many times the steps that the channel usually makes, of which [`USUAL`] are smaller.
const LEAP: f64 = 12.0;
const USUAL: f64 = 0.98;
/// Of so many values before and after it all but one are the same within this share of the leap.
const BESIDE: usize = 2;
const BACK: f64 = 0.2;

/// Puts the quadrature of the row before into rows in which `xs_v` or `ys_v` leaps; says of which. The row stays: its rate belongs to the
/// angle of the reference.
pub(crate) fn mend(recording: &mut Recording) -> Option<String> {
    let leaps = rows_that_leap(recording);
    let count = leaps.iter().filter(|is| **is).count();
    for column in [&mut recording.xs_v, &mut recording.ys_v].into_iter().flatten() {
        let mut last = leaps.iter().position(|is| !is).map_or(0.0, |sound| column[sound]);
        for (value, leaps) in column.iter_mut().zip(&leaps) {
            if *leaps {
                *value = last;
            }
            last = *value;
        }
    }
    (count > 0).then(|| {
        format!(
            "{}: xs_v or ys_v leaps for single rows, which no vibration does: {}; {count} rows take the quadrature of the row before",
            recording.source.display(),
            places(&recording.t_s, &stretches(leaps.len(), |i| leaps[i]))
        )
    })
}

fn rows_that_leap(recording: &Recording) -> Vec<bool> {
    let mut out = vec![false; recording.len()];
    for column in [&recording.xs_v, &recording.ys_v].into_iter().flatten() {
        out.iter_mut().zip(leaps(column)).for_each(|(is, leaps)| *is |= leaps);
    }
    out
}

/// Which values are unlike those about them, which are alike.
fn leaps(values: &[f64]) -> Vec<bool> {
    let n = values.len();
    let mut out = vec![false; n];
    let mut steps: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    // a digit more or less is none
    let digit = steps.iter().copied().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
    if n <= 2 * BESIDE || digit.is_infinite() {
        return out;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the steps")]
    let at = (USUAL * (steps.len() - 1) as f64) as usize;
    let usual = steps.select_nth_unstable_by(at, f64::total_cmp).1.max(digit);
    for (i, out) in out.iter_mut().enumerate() {
        let from = i.saturating_sub(BESIDE).min(n - 2 * BESIDE - 1);
        let mut beside: Vec<f64> = (from..=from + 2 * BESIDE).filter(|j| *j != i).map(|j| values[j]).collect();
        let middle = median(&mut beside);
        let leap = (values[i] - middle).abs();
        let alike = beside.iter().filter(|v| (*v - middle).abs() < BACK * leap).count();
        *out = leap > LEAP * usual && alike + 1 >= beside.len();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quadrature that turns with the pattern, with noise, in whole digits.
    fn quadrature(digit: f64) -> Vec<f64> {
        let of = |i: f64| 1e-3 * (0.13 * i).sin() + 2e-5 * (i * i).sin();
        (0..3000).map(|i| (of(f64::from(i)) / digit).round() * digit).collect()
    }

    #[test]
    fn a_leap_is_found_in_noise_and_in_digits_and_a_step_is_none() {
        for digit in [1e-9, 5e-5, 1e-3] {
            let mut channel = quadrature(digit);
            assert!(!leaps(&channel).contains(&true), "{digit}");
            for at in [0, 700, 701, 2999] {
                channel[at] += 0.4;
            }
            let found: Vec<usize> = leaps(&channel).iter().enumerate().filter_map(|(i, is)| is.then_some(i)).collect();
            assert_eq!(found, [0, 700, 701, 2999], "{digit}");
        }
        let step: Vec<f64> = (0..3000).map(|i| if i < 1000 { 0.1 } else { -0.1 } + 1e-6 * f64::from(i % 7)).collect();
        assert!(!leaps(&step).contains(&true));
        assert!(!leaps(&[0.0; 100]).contains(&true));
    }

    #[test]
    fn a_row_that_leaps_takes_the_quadrature_of_the_one_before() {
        let mut recording = Recording {
            t_s: (0..3000).map(f64::from).collect(),
            xs_v: Some(quadrature(1e-9)),
            ys_v: Some(quadrature(1e-9)),
            ..Recording::default()
        };
        assert_eq!(mend(&mut recording), None);
        recording.xs_v.as_mut().into_iter().for_each(|xs| xs[0] = 0.5);
        recording.ys_v.as_mut().into_iter().for_each(|ys| ys[1700] = -0.5);
        assert!(mend(&mut recording).is_some_and(|said| said.contains("2 rows take the quadrature")));
        let (xs, ys) = (recording.xs_v.unwrap_or_default(), recording.ys_v.unwrap_or_default());
        assert!(xs[0].abs() < 2e-3 && (ys[1700] - ys[1699]).abs() < 1e-12 && xs[1700].abs() < 2e-3);
    }
}
