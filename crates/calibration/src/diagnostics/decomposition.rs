//! What is an error a function of? One least-squares fit on everything that it could follow at once; the share of each
//! in the variance is the covariance of its part with the error over the variance of the error. Intervals are those of a
//! jackknife over contiguous blocks (Künsch 1989): what an error remembers within a block is counted.

use crate::estimation::linear::NormalEquations;
use crate::report::Share;

/// What an error may follow: a name, and a column of values for each of its unknowns.
#[derive(Debug, Clone)]
pub(crate) struct Influence {
    pub(crate) of: &'static str,
    pub(crate) columns: Vec<Vec<f64>>,
}

/// Blocks of the jackknife, and Student's 97.5 % point for one fewer degrees of freedom.
pub(crate) const BLOCKS: usize = 20;
pub(crate) const STUDENT_19: f64 = 2.093;
/// Marquardt's share: columns that are alike share what they explain.
const RIDGE: f64 = 1e-6;

/// Takes an error apart. What no influence carries is the `rest`; shares sum to one.
pub(crate) fn decompose(error: &[f64], influences: &[Influence]) -> Vec<Share> {
    let n = error.len();
    if n < 2 * BLOCKS {
        return Vec::new();
    }
    let whole = shares(error, influences, n..n);
    let without: Vec<Vec<f64>> =
        (0..BLOCKS).map(|b| shares(error, influences, b * n / BLOCKS..(b + 1) * n / BLOCKS)).collect();
    let names = influences.iter().map(|i| i.of).chain(["rest"]);
    names
        .enumerate()
        .map(|(i, of)| {
            let mean = without.iter().map(|w| w[i]).sum::<f64>() / BLOCKS as f64;
            let spread: f64 = without.iter().map(|w| (w[i] - mean).powi(2)).sum();
            let half = STUDENT_19 * ((BLOCKS - 1) as f64 / BLOCKS as f64 * spread).sqrt();
            Share { of: of.into(), share: whole[i], ci95: [whole[i] - half, whole[i] + half] }
        })
        .collect()
}

fn shares(error: &[f64], influences: &[Influence], left_out: std::ops::Range<usize>) -> Vec<f64> {
    let rows: Vec<usize> = (0..error.len()).filter(|i| !left_out.contains(i)).collect();
    let centred = |values: &[f64]| {
        let mean = rows.iter().map(|&i| values[i]).sum::<f64>() / rows.len() as f64;
        rows.iter().map(|&i| values[i] - mean).collect::<Vec<f64>>()
    };
    let e = centred(error);
    let columns: Vec<Vec<f64>> = influences.iter().flat_map(|i| &i.columns).map(|c| centred(c)).collect();
    let mut equations = NormalEquations::new(columns.len());
    let mut row = vec![0.0; columns.len()];
    for (i, value) in e.iter().enumerate() {
        for (entry, column) in row.iter_mut().zip(&columns) {
            *entry = column[i];
        }
        equations.add(&row, *value);
    }
    let x = equations.damped(RIDGE).solve();
    let power = e.iter().map(|v| v * v).sum::<f64>().max(f64::MIN_POSITIVE);
    let mut at = 0;
    let mut out: Vec<f64> = influences
        .iter()
        .map(|influence| {
            let range = at..at + influence.columns.len();
            at = range.end;
            let product: f64 = range.map(|c| x[c] * columns[c].iter().zip(&e).map(|(a, b)| a * b).sum::<f64>()).sum();
            product / power
        })
        .collect();
    out.push(1.0 - out.iter().sum::<f64>());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn position_and_time_are_told_apart_and_noise_is_the_rest() {
        let n = 2000;
        let angle: Vec<f64> = (0..n).map(|i| f64::from(i) * 0.037).collect();
        let time: Vec<f64> = (0..n).map(|i| f64::from(i) / f64::from(n) - 0.5).collect();
        let noise = |i: usize| ((i * 7919 % 1009) as f64 / 1009.0 - 0.5) * 3.46;
        // variances 2, 1 and 1
        let error: Vec<f64> =
            (0..n as usize).map(|i| 2.0 * (2.0 * angle[i]).sin() + time[i] * 12f64.sqrt() + noise(i)).collect();
        let harmonics = (1..=4).flat_map(|k| {
            let of = |f: fn(f64) -> f64| angle.iter().map(|a| f(f64::from(k) * a)).collect::<Vec<f64>>();
            [of(f64::cos), of(f64::sin)]
        });
        let influences = [
            Influence { of: "pattern", columns: harmonics.collect() },
            Influence { of: "time", columns: vec![time.clone()] },
        ];
        let shares = decompose(&error, &influences);
        for (share, expected) in shares.iter().zip([0.5, 0.25, 0.25]) {
            assert!((share.share - expected).abs() < 0.03, "{shares:?}");
            assert!(share.ci95[0] < expected && expected < share.ci95[1], "{shares:?}");
        }
        let sum: f64 = shares.iter().map(|s| s.share).sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }
}
