//! What is an error a function of? One least-squares fit on everything that it could follow at once; the share of each
//! in the variance is the covariance of its part with the error over the variance of the error. Intervals are those of a
//! jackknife over contiguous blocks (Künsch 1989): what an error remembers within a block is counted.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::facts::Share;
use crate::numerics::linear::NormalEquations;

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
    let columns: Vec<&[f64]> = influences.iter().flat_map(|i| &i.columns).map(Vec::as_slice).chain([error]).collect();
    let mean = |column: &&[f64]| column.iter().sum::<f64>() / n as f64;
    let means: Vec<f64> = columns.iter().map(mean).collect();
    let moments: Vec<DMatrix<f64>> =
        (0..BLOCKS).map(|b| moments_of(&columns, &means, b * n / BLOCKS..(b + 1) * n / BLOCKS)).collect();
    let all: DMatrix<f64> = moments.iter().sum();
    let whole = shares(&all, influences);
    let without: Vec<Vec<f64>> = moments.iter().map(|block| shares(&(&all - block), influences)).collect();
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

/// Sums of products over a block of rows of one and every column: of all and of each block, they tell what is left when that
/// is left out. Columns count from their means, lest a large one swallow what varies.
fn moments_of(columns: &[&[f64]], means: &[f64], block: Range<usize>) -> DMatrix<f64> {
    let mut rows: Vec<f64> = vec![1.0; block.len()];
    for (column, mean) in columns.iter().zip(means) {
        rows.extend(column[block.clone()].iter().map(|v| v - mean));
    }
    let rows = DMatrix::from_vec(block.len(), 1 + columns.len(), rows);
    rows.tr_mul(&rows)
}

fn shares(moments: &DMatrix<f64>, influences: &[Influence]) -> Vec<f64> {
    let unknowns = moments.nrows() - 2;
    let sums = moments.view((1, 0), (unknowns + 1, 1));
    let centred = moments.view((1, 1), (unknowns + 1, unknowns + 1)) - sums * sums.transpose() / moments[(0, 0)];
    let right = centred.view((0, unknowns), (unknowns, 1)).column(0).into_owned();
    let power = centred[(unknowns, unknowns)].max(f64::MIN_POSITIVE);
    let normal = centred.view((0, 0), (unknowns, unknowns)).into_owned();
    let x = NormalEquations::of(normal, right.clone()).damped(RIDGE).solve();
    let mut at = 0;
    let mut out: Vec<f64> = influences
        .iter()
        .map(|influence| {
            let range = at..at + influence.columns.len();
            at = range.end;
            range.map(|c| x[c] * right[c]).sum::<f64>() / power
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
