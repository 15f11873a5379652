//! Where the angle of a rate gyroscope and its reference part from one row to the next and stay apart: a table that was
//! zeroed, an encoder that lost counts, an integral that was begun anew. No rate is behind it, no scale factor, and no bias either, which
//! makes of a gap in the recording as much as the gap is long.
//!
//! A table that turns back from one row to the next parts from an angle that is late by a part of a row as well, or from one
//! that was summed by another rule. That goes with the change of the rate, row by row, and is a lag's.

use crate::data::slips::slips;
use crate::data::table::{integrated, turned};
use crate::numerics::angles::unwrapped_beside;
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{median, span};
use crate::recording::Run;

/// Parts of a run whose increments tell how far the angle goes with the reference.
const PARTS: usize = 50;
/// Jumps into rows so close to each other are one.
const TOGETHER: usize = 2;
/// What being late makes of a row is no more than the change of the step there, and the noise of a row.
const LATE: f64 = 1.05;
/// Rounds of least squares after which weights by one over the size leave the least absolute sum, and the share of what is usually left
/// below which none is weighed more.
const ROUNDS: usize = 20;
const LEAST_LEFT: f64 = 0.1;
/// A bias leaves this share at most of what is left without one: engineering choice.
const CLEARLY_LESS: f64 = 0.8;
/// A step that takes so many times the usual interval is a gap, in which an angle may drift twice as fast as in nine of ten parts of a run.
const GAP: f64 = 1.5;
const MOST_PARTS: f64 = 0.9;
const FASTER: f64 = 2.0;
/// Rows on either side of a jump that tell how far a step usually goes.
const BESIDE: usize = 12;

/// Takes the jumps out of a run, from the column that jumps, and says so.
pub(super) fn without_jumps(run: &mut Run, period: f64) -> Vec<String> {
    let Ok(settled) = run.settled() else { return Vec::new() };
    let r = &mut run.recording;
    let reference = match (&r.table_deg, &r.rate_dps) {
        (Some(table), _) => turned(&table[settled.clone()], &r.t_s[settled.clone()]),
        (None, Some(rate)) => integrated(&r.t_s[settled.clone()], &rate[settled.clone()]),
        (None, None) => return Vec::new(),
    };
    let Some(theta) = r.theta_deg.as_ref() else { return Vec::new() };
    let theta: Vec<f64> = theta[settled.clone()].iter().map(|d| d.to_radians()).collect();
    let theta = unwrapped_beside(&theta, &reference, period);
    let t_s = r.t_s[settled.clone()].to_vec();
    let Some([gain, bias]) = gain_and_bias(&theta, &reference, &t_s) else { return Vec::new() };
    let expected: Vec<f64> = reference.iter().zip(&t_s).map(|(a, t)| gain * a + bias * (t - t_s[0])).collect();
    let drifts = drifts_in_gaps(&theta, &expected, &t_s);
    let mut jumps: Vec<Jump> = Vec::new();
    for slip in slips(&theta, &expected, period) {
        if slip.by.abs() <= (LATE * change_of_step(&expected, slip.at)).max(drifts(slip.at)) {
            continue;
        }
        let row = settled.start + slip.at;
        let is_table = r.table_deg.is_some() && unusual(&expected, slip.at) > unusual(&theta, slip.at);
        let (column, name, by) = match (&mut r.table_deg, &mut r.theta_deg) {
            (Some(table), _) if is_table => (table, "table_deg", -slip.by / gain),
            (_, Some(theta)) => (theta, "theta_deg", slip.by),
            _ => continue,
        };
        column[row..].iter_mut().for_each(|v| *v -= by.to_degrees());
        match jumps.last_mut() {
            Some(last) if last.name == name && row - last.rows[1] <= TOGETHER => {
                last.rows[1] = row;
                last.by += by;
            }
            _ => jumps.push(Jump { name, rows: [row; 2], by }),
        }
    }
    let said = |Jump { name, rows: [first, last], by }: &Jump| {
        format!(
            "{}: {name} jumps by {:.3}° from row {first} to row {}, at {:.3} s, and nothing turned by that; the jump is left out",
            run.file.display(),
            by.to_degrees(),
            last + 1,
            run.recording.t_s[*first]
        )
    };
    jumps.iter().map(said).collect()
}

/// A jump of a column: into the first of these rows to the last.
struct Jump {
    name: &'static str,
    rows: [usize; 2],
    by: f64,
}

/// How far the angle goes with the reference, and its bias, rad/s: with a bias where that leaves clearly less of nine in ten increments over
/// parts of the run. A jump is in few of them, of the angle or of the reference, which a bias in a gap is not.
fn gain_and_bias(theta: &[f64], reference: &[f64], t_s: &[f64]) -> Option<[f64; 2]> {
    let width = (theta.len() / PARTS).max(1);
    let increments = |v: &[f64]| (width..v.len()).map(|i| v[i] - v[i - width]).collect::<Vec<f64>>();
    let all = [theta, reference, t_s].map(increments);
    let left = |told: &[f64; 2]| {
        let mut off = left_of(&all, told);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the parts")]
        let most = (MOST_PARTS * off.len() as f64) as usize;
        *off.select_nth_unstable_by(most, f64::total_cmp).1
    };
    let usable = |told: &[f64; 2]| told.iter().all(|v| v.is_finite()) && told[0] != 0.0;
    // at an even rate a bias is a part of the gain
    let without = of_the_median(&all).filter(usable);
    let with = by_least_absolute_sum(&all).filter(usable);
    with.filter(|w| without.is_none_or(|other| left(w) < CLEARLY_LESS * left(&other))).or(without)
}

/// By how much each increment of the angle is off that of the reference and of the time.
fn left_of([theta, reference, t_s]: &[Vec<f64>; 3], [gain, bias]: &[f64; 2]) -> Vec<f64> {
    theta.iter().zip(reference).zip(t_s).map(|((t, a), dt)| (t - gain * a - bias * dt).abs()).collect()
}

/// The median of how far the angle goes with the reference where that moves.
fn of_the_median([theta, reference, _]: &[Vec<f64>; 3]) -> Option<[f64; 2]> {
    let usual = median(&mut reference.iter().map(|d| d.abs()).collect::<Vec<_>>());
    let moves = theta.iter().zip(reference).filter(|(_, d)| d.abs() >= usual && **d != 0.0);
    let mut ratios: Vec<f64> = moves.map(|(t, d)| t / d).collect();
    (!ratios.is_empty()).then(|| [median(&mut ratios), 0.0])
}

/// What leaves the least absolute sum of the increments.
fn by_least_absolute_sum(all: &[Vec<f64>; 3]) -> Option<[f64; 2]> {
    let [theta, reference, t_s] = all;
    let mut told = [0.0; 2];
    let mut weights = vec![1.0; theta.len()];
    for _ in 0..ROUNDS {
        let mut equations = NormalEquations::new(2);
        for (((t, a), dt), weight) in theta.iter().zip(reference).zip(t_s).zip(&weights) {
            equations.add(&[weight * a, weight * dt], weight * t);
        }
        told = equations.solve().try_into().ok()?;
        let left = left_of(all, &told);
        let least = LEAST_LEFT * median(&mut left.clone());
        weights = left.iter().map(|l| l.max(least).max(f64::MIN_POSITIVE).sqrt().recip()).collect();
    }
    Some(told)
}

/// How far the angle may have drifted from what is expected in the step into a row, where that is a gap: as fast as it does in a part of the
/// run.
fn drifts_in_gaps(theta: &[f64], expected: &[f64], t_s: &[f64]) -> impl Fn(usize) -> f64 {
    let steps: Vec<f64> = t_s.windows(2).map(|t| t[1] - t[0]).collect();
    let usual = median(&mut steps.clone());
    let width = (theta.len() / PARTS).max(1);
    let rate = |at: usize| {
        let passed = t_s[at + width] - t_s[at];
        let has_no_gap = passed < GAP * width as f64 * usual;
        let off = (theta[at + width] - theta[at]) - (expected[at + width] - expected[at]);
        (has_no_gap && passed > 0.0).then(|| (off / passed).abs())
    };
    let mut rates: Vec<f64> = (0..theta.len().saturating_sub(width)).step_by(width).filter_map(rate).collect();
    rates.sort_by(f64::total_cmp);
    // a jump is in few
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the parts")]
    let fast = rates.get((MOST_PARTS * rates.len() as f64) as usize).copied().unwrap_or(0.0);
    move |at| if steps[at - 1] > GAP * usual { FASTER * fast * steps[at - 1] } else { 0.0 }
}

/// By how much the steps about row `at` differ from each other, apart from the one into it.
fn change_of_step(angle: &[f64], at: usize) -> f64 {
    let beside = at.saturating_sub(BESIDE).max(1)..(at + BESIDE).min(angle.len());
    span(&beside.filter(|i| *i != at).map(|i| angle[i] - angle[i - 1]).collect::<Vec<_>>())
}

/// By how much the step into row `at` differs from those beside it.
fn unusual(angle: &[f64], at: usize) -> f64 {
    let beside = at.saturating_sub(BESIDE).max(1)..(at + BESIDE).min(angle.len());
    let step = |i: usize| angle[i] - angle[i - 1];
    (step(at) - median(&mut beside.map(step).collect::<Vec<_>>())).abs()
}
