//! What a memory of the noise explains as well in the rows that were fitted, told by a pass in which no memory reaches: a run of its own
//! that was held out. A table of that run costs nothing there, for nothing of it was fitted.

use super::autoregression;
use super::model::{Outcome, SensorModel};
use super::samples::SensorRun;
use super::table_fit::by_run;
use crate::numerics::statistics::root_mean_square;

/// Gain in ln likelihood, beside a memory, from which on another pass tells: engineering choice. Tables of noise alone, with any memory,
/// gain more in another pass of it once in 200 cases.
const TELLS: f64 = 6.0;

impl SensorModel {
    /// A model that is in doubt is kept where another pass tells what was found, and is the sensor as it is elsewhere.
    pub(super) fn told_by_another_pass(self, fitted: &[SensorRun], held: &[SensorRun]) -> Self {
        if self.outcome != Outcome::Doubted || self.is_told_by(held.iter().filter(|run| is_another_pass(run, fitted))) {
            return self;
        }
        self.neutral(fitted)
    }

    fn is_told_by<'a>(&self, passes: impl Iterator<Item = &'a SensorRun>) -> bool {
        let about_mean = |run: &SensorRun, readout, left: bool| {
            let samples = self.sensor.samples(std::slice::from_ref(run), readout);
            by_run(&samples, 1, |s| if left { self.table.left(s) } else { s.error }).concat()
        };
        let errors = |run| (about_mean(run, None, false), about_mean(run, self.front(), true));
        let (before, after): (Vec<Vec<f64>>, Vec<Vec<f64>>) = passes.map(errors).unzip();
        root_mean_square(&after.concat()) < root_mean_square(&before.concat())
            && autoregression::gain(&before, &after, 0) > TELLS
    }
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
