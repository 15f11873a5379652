//! Where the angle of a rate gyroscope and its reference part from one row to the next and stay apart: a table that was
//! zeroed, an encoder that lost counts, an integral that was begun anew. No rate is behind it, and no scale factor either.
//!
//! A table that turns back from one row to the next parts from an angle that is late by a part of a row as well, or from one
//! that was summed by another rule. That goes with the change of the rate, row by row, and is a lag's.

use crate::data::slips::slips;
use crate::data::table::{integrated, turned};
use crate::numerics::angles::unwrapped;
use crate::numerics::statistics::{median, span};
use crate::recording::Run;

/// Parts of a run whose increments tell how far the angle goes with the reference.
const PARTS: usize = 50;
/// Jumps into rows so close to each other are one.
const TOGETHER: usize = 2;
/// What being late makes of a row is no more than the change of the step there, and the noise of a row.
const LATE: f64 = 1.05;
/// Rows on either side of a jump that tell how far a step usually goes.
const BESIDE: usize = 12;

/// Takes the jumps out of a run, from the column that jumps, and says so.
pub(super) fn without_jumps(run: &mut Run, period: f64) -> Vec<String> {
    let Ok(settled) = run.settled() else { return Vec::new() };
    let r = &mut run.recording;
    let Some(theta) = r.theta_deg.as_ref().map(|v| radians(&v[settled.clone()], period)) else { return Vec::new() };
    let reference = match (&r.table_deg, &r.rate_dps) {
        (Some(table), _) => turned(&table[settled.clone()]),
        (None, Some(rate)) => integrated(&r.t_s[settled.clone()], &rate[settled.clone()]),
        (None, None) => return Vec::new(),
    };
    let Some(gain) = gain(&theta, &reference) else { return Vec::new() };
    let expected: Vec<f64> = reference.iter().map(|a| gain * a).collect();
    let mut jumps: Vec<Jump> = Vec::new();
    for slip in slips(&theta, &expected, period) {
        if slip.by.abs() <= LATE * change_of_step(&expected, slip.at) {
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

fn radians(degrees: &[f64], period: f64) -> Vec<f64> {
    unwrapped(degrees.iter().map(|d| d.to_radians()), period)
}

/// How far the angle goes with the reference: the median over parts of the run, of which a jump is in few.
fn gain(theta: &[f64], reference: &[f64]) -> Option<f64> {
    let width = (theta.len() / PARTS).max(1);
    let increments = |v: &[f64]| (width..v.len()).map(|i| v[i] - v[i - width]).collect::<Vec<f64>>();
    let (theta, reference) = (increments(theta), increments(reference));
    let usual = median(&mut reference.iter().map(|d| d.abs()).collect::<Vec<_>>());
    let mut ratios: Vec<f64> =
        theta.iter().zip(&reference).filter(|(_, d)| d.abs() >= usual && **d != 0.0).map(|(t, d)| t / d).collect();
    (!ratios.is_empty()).then(|| median(&mut ratios)).filter(|g| g.is_finite() && *g != 0.0)
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
