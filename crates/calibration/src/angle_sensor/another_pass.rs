//! What a memory of the noise explains as well in the rows that were fitted, told by a pass in which no memory reaches: a run of its own
//! that was held out. A table of that run costs nothing there, for nothing of it was fitted. It is a condition of the gate, beside that
//! what was found helps on held-out rows at all.

use super::autoregression;
use super::readout_fit::centre;
use super::samples::SensorRun;
use crate::diagnostics::evaluate::Evaluation;
use crate::numerics::statistics::root_mean_square;

/// Gain in ln likelihood, beside a memory, from which on another pass tells: engineering choice. Tables of noise alone, with any memory,
/// gain more in another pass of it once in 200 cases.
const TELLS: f64 = 6.0;

/// Whether held-out runs that are passes of their own tell what was found: by the errors of all held-out runs as recorded, and by what is
/// left of them.
pub(super) fn tells(fitted: &[SensorRun], held: &[SensorRun], raw: &Evaluation, left: &Evaluation) -> bool {
    let passes: Vec<usize> = (0..held.len()).filter(|&run| is_another_pass(&held[run], fitted)).collect();
    let about_mean = |errors: &Evaluation| -> Vec<Vec<f64>> {
        let of = |&run: &usize| {
            let mut angle = errors.segments[run].angle.clone();
            centre(&mut angle);
            angle
        };
        passes.iter().map(of).collect()
    };
    let [before, after] = [raw, left].map(about_mean);
    root_mean_square(&after.concat()) < root_mean_square(&before.concat())
        && autoregression::gain(&before, &after, 0) > TELLS
}

/// Whether a held-out run is none of those that were fitted, nor rows that were taken out of one.
fn is_another_pass(run: &SensorRun, fitted: &[SensorRun]) -> bool {
    fitted.iter().all(|of| of.number != run.number && !is_taken_out_of(run, of))
}

/// Most rows stand between two of the other run, in time and in place.
fn is_taken_out_of(run: &SensorRun, other: &SensorRun) -> bool {
    let stands_between = |(t, a): (&f64, &f64)| {
        let next = other.t_s.partition_point(|time| time < t);
        let Some(before) = next.checked_sub(1).filter(|_| next < other.len() && other.t_s[next] > *t) else {
            return false;
        };
        let [from, to] = [before, next].map(|i| other.reference_rad[i]);
        (from.min(to)..=from.max(to)).contains(a)
    };
    2 * run.t_s.iter().zip(&run.reference_rad).filter(|row| stands_between(*row)).count() > run.len()
}
