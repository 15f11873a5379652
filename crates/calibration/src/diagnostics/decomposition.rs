//! What is an error a function of? One least-squares fit on everything that it could follow at once; the share of each
//! in the variance is the covariance of its part with the error over the variance of the error. Intervals are those of a
//! jackknife over contiguous blocks (Künsch 1989): what an error remembers within a block is counted.
//!
//! Within one pass time is a function of the angle, and harmonics enough make up any: neither has a share of its own then, and
//! parts of opposite sign that cancel each other have shares of −100 and +100. Influences that the rows do not tell apart have
//! one share together, of the first and `shared_with` the others. They are those that have a direction in common (Hotelling's canonical correlation
//! 1936) in which the error lies as well, and those whose parts cancel.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

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
/// Directions of two influences are one from this square of their canonical correlation on: what is left of one beside the other is known a
/// hundred times worse, in its variance, than it is alone …
const ONE_DIRECTION: f64 = 0.99;
/// … and what is shared matters from this share of the error's variance on, as does what lies outside of 0 to 1.
const NEGLIGIBLE: f64 = 0.01;
/// Directions of one influence below this share of its largest eigenvalue are rounding.
const RANK: f64 = 1e-9;

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
    let groups = told_apart(&all, influences);
    let whole = shares(&all, &groups);
    let without: Vec<Vec<f64>> = moments.iter().map(|block| shares(&(&all - block), &groups)).collect();
    let names = groups.iter().map(|group| group.of.as_slice()).chain([["rest"].as_slice()]);
    names
        .enumerate()
        .map(|(i, names)| {
            let mean = without.iter().map(|w| w[i]).sum::<f64>() / BLOCKS as f64;
            let spread: f64 = without.iter().map(|w| (w[i] - mean).powi(2)).sum();
            let half = STUDENT_19 * ((BLOCKS - 1) as f64 / BLOCKS as f64 * spread).sqrt();
            Share {
                of: names[0].into(),
                shared_with: names[1..].iter().map(ToString::to_string).collect(),
                share: whole[i],
                ci95: [whole[i] - half, whole[i] + half].map(|end| end.clamp(0.0, 1.0)),
            }
        })
        .collect()
}

/// Influences with one share, and their columns among all.
#[derive(Debug, Clone)]
struct Group {
    of: Vec<&'static str>,
    columns: Vec<usize>,
}

/// The influences, of which those that the rows do not tell apart are one.
fn told_apart(moments: &DMatrix<f64>, influences: &[Influence]) -> Vec<Group> {
    let mut next = 0;
    let own = influences.iter().map(|influence| {
        let first = next;
        next += influence.columns.len();
        Group { of: vec![influence.of], columns: (first..next).collect() }
    });
    let mut groups: Vec<Group> = own.filter(|group| !group.columns.is_empty()).collect();
    let Centred { normal, right, power } = Centred::of(moments);
    let are_one = |groups: &[Group], a: usize, b: usize| {
        in_common(&normal, &right, [&groups[a].columns, &groups[b].columns]) > NEGLIGIBLE * power
    };
    while let Some((a, b)) = pairs(groups.len()).find(|&(a, b)| are_one(&groups, a, b)) {
        join(&mut groups, a, b);
    }
    loop {
        let parts = parts(moments);
        let share = |group: &Group| group.columns.iter().map(|&c| parts[c] * right[c]).sum::<f64>() / power;
        let possible = -NEGLIGIBLE..=1.0 + NEGLIGIBLE;
        if groups.iter().all(|group| possible.contains(&share(group))) {
            return groups;
        }
        let covariance = |&(a, b): &(usize, usize)| -> f64 {
            let of = |c: usize| groups[b].columns.iter().map(|&d| parts[c] * normal[(c, d)] * parts[d]).sum::<f64>();
            groups[a].columns.iter().map(|&c| of(c)).sum()
        };
        let cancel = pairs(groups.len()).min_by(|one, other| covariance(one).total_cmp(&covariance(other)));
        let Some((a, b)) = cancel else { return groups };
        join(&mut groups, a, b);
    }
}

/// Numbers of two groups, each pair once.
fn pairs(groups: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..groups).flat_map(move |a| (a + 1..groups).map(move |b| (a, b)))
}

fn join(groups: &mut Vec<Group>, a: usize, b: usize) {
    let other = groups.remove(b);
    groups[a].of.extend(other.of);
    groups[a].columns.extend(other.columns);
}

/// The sum of squares of the error in the directions that two sets of columns have in common.
fn in_common(normal: &DMatrix<f64>, right: &DVector<f64>, [a, b]: [&[usize]; 2]) -> f64 {
    let [of_a, of_b] = [a, b].map(|columns| orthonormal(normal, columns));
    if of_a.is_empty() || of_b.is_empty() {
        return 0.0;
    }
    let between = DMatrix::from_fn(a.len(), b.len(), |i, j| normal[(a[i], b[j])]);
    let svd = (of_a.transpose() * between * of_b).svd(true, false);
    let Some(directions) = svd.u else { return 0.0 };
    let error = of_a.tr_mul(&DVector::from_fn(a.len(), |i, _| right[a[i]]));
    let shared = svd.singular_values.iter().enumerate().filter(|(_, s)| *s * *s > ONE_DIRECTION);
    shared.map(|(i, _)| directions.column(i).dot(&error).powi(2)).sum()
}

/// Coefficients of orthonormal combinations of columns, one a column.
fn orthonormal(normal: &DMatrix<f64>, columns: &[usize]) -> DMatrix<f64> {
    let n = columns.len();
    let scale: Vec<f64> = columns.iter().map(|&c| normal[(c, c)].max(f64::MIN_POSITIVE).sqrt().recip()).collect();
    let scaled = DMatrix::from_fn(n, n, |i, j| normal[(columns[i], columns[j])] * scale[i] * scale[j]);
    let eigen = scaled.symmetric_eigen();
    let least = RANK * eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    let kept: Vec<usize> = (0..n).filter(|&i| eigen.eigenvalues[i] > least).collect();
    DMatrix::from_fn(n, kept.len(), |i, j| {
        scale[i] * eigen.eigenvectors[(i, kept[j])] / eigen.eigenvalues[kept[j]].sqrt()
    })
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

/// Sums of products about the means.
struct Centred {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    /// that of the error
    power: f64,
}

impl Centred {
    fn of(moments: &DMatrix<f64>) -> Self {
        let unknowns = moments.nrows() - 2;
        let sums = moments.view((1, 0), (unknowns + 1, 1));
        let centred = moments.view((1, 1), (unknowns + 1, unknowns + 1)) - sums * sums.transpose() / moments[(0, 0)];
        Self {
            right: centred.view((0, unknowns), (unknowns, 1)).column(0).into_owned(),
            power: centred[(unknowns, unknowns)].max(f64::MIN_POSITIVE),
            normal: centred.view((0, 0), (unknowns, unknowns)).into_owned(),
        }
    }
}

/// What the error follows of each column.
fn parts(moments: &DMatrix<f64>) -> Vec<f64> {
    let Centred { normal, right, .. } = Centred::of(moments);
    NormalEquations::of(normal, right).damped(RIDGE).solve()
}

/// Shares of the groups and of the rest: what is negligible outside of 0 to 1 is none.
fn shares(moments: &DMatrix<f64>, groups: &[Group]) -> Vec<f64> {
    let Centred { right, power, .. } = Centred::of(moments);
    let parts = parts(moments);
    let share = |group: &Group| group.columns.iter().map(|&c| parts[c] * right[c]).sum::<f64>() / power;
    let mut out: Vec<f64> = groups.iter().map(|group| share(group).max(0.0)).collect();
    let sum: f64 = out.iter().sum();
    out.iter_mut().for_each(|share| *share /= sum.max(1.0));
    out.push((1.0 - sum).max(0.0));
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

    /// An error that goes with the angle alone, turned through once and through five times, in one pass at an even speed: harmonics that
    /// make up any course of a part of a turn have nothing to themselves beside the time.
    #[test]
    fn in_one_pass_of_a_part_of_a_turn_angle_and_time_have_one_share() {
        let told = |turns: f64| {
            let n = 900_u32;
            let noise = crate::numerics::statistics::remembered(0.0, 900, 5);
            let time: Vec<f64> = (0..n).map(|i| f64::from(i) / f64::from(n)).collect();
            let angle: Vec<f64> = time.iter().map(|t| turns * std::f64::consts::TAU * t).collect();
            let error: Vec<f64> =
                angle.iter().zip(&noise).map(|(a, e)| a.sin() + 0.5 * (3.0 * a).cos() + 0.1 * e).collect();
            let harmonics = (1..=12).flat_map(|k| {
                let of = |f: fn(f64) -> f64| angle.iter().map(|a| f(f64::from(k) * a)).collect::<Vec<f64>>();
                [of(f64::cos), of(f64::sin)]
            });
            let influences = [
                Influence { of: "pattern", columns: harmonics.collect() },
                Influence { of: "time", columns: vec![time] },
            ];
            decompose(&error, &influences)
        };
        let shares = told(0.75);
        assert_eq!(shares.iter().map(Share::named).collect::<Vec<_>>(), ["pattern or time", "rest"], "{shares:?}");
        assert!(shares[0].share > 0.95 && shares[0].ci95[0] > 0.9 && shares[0].ci95[1] <= 1.0, "{shares:?}");
        let shares = told(5.0);
        assert_eq!(shares[0].of, "pattern");
        assert!(shares[0].share > 0.95 && shares[1].share < 0.01, "{shares:?}");
    }

    /// Two columns that go together and whose parts cancel: the error is far smaller than either.
    #[test]
    fn parts_that_cancel_have_one_share_within_what_is_possible() {
        let noise = |seed| crate::numerics::statistics::remembered(0.0, 2000, seed);
        let (a, b) = (noise(1), noise(2));
        let other: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a + 0.3 * b).collect();
        let error: Vec<f64> = a.iter().zip(&other).map(|(a, o)| 10.0 * (a - o)).collect();
        let shares = decompose(
            &error,
            &[Influence { of: "rate", columns: vec![a] }, Influence { of: "time", columns: vec![other] }],
        );
        assert_eq!(shares[0].named(), "rate or time");
        for share in &shares {
            assert!(
                (0.0..=1.0).contains(&share.share) && share.ci95.iter().all(|c| (0.0..=1.0).contains(c)),
                "{shares:?}"
            );
        }
    }
}
