//! What one run of an angle sensor tells by itself, once what all runs share is undone: how many times as far as its reference it
//! turns, and how it drifts beside it.

use super::deviations::{jackknife, without_block};
use super::model::SensorModel;
use super::rate_alone::Alone;
use super::samples::SensorRun;
use crate::diagnostics::decomposition::{BLOCKS, STUDENT_19};
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::correlation;
use crate::report::Estimate;

/// Rows that a block needs.
const FEWEST_ROWS: usize = 4;
/// A reference that goes with the time so closely does not tell a gain from a drift: each is told as it is without the other.
const TOGETHER: f64 = 0.99;

/// Gain and drift of a run of a sensor with this gain; `None` where its reference is not believed, or its rows are too few.
pub(super) fn alone(model: &SensorModel, gain: f64, run: &SensorRun) -> Option<Alone> {
    if model.by_radius || run.len() < FEWEST_ROWS * BLOCKS {
        return None;
    }
    let run = super::identify::thinned(std::slice::from_ref(run));
    let together = correlation(&run[0].t_s, &run[0].reference_rad).abs() > TOGETHER;
    let [of_reference, of_time] = if together {
        [slopes(model, &run, [true, false])?[0], slopes(model, &run, [false, true])?[1]]
    } else {
        slopes(model, &run, [true, true])?
    };
    Some(Alone { bias: of_time, gain: of_reference.turned(gain) })
}

/// Slopes of what is left over the reference and over the time, where they are asked for.
fn slopes(model: &SensorModel, run: &[SensorRun], asked: [bool; 2]) -> Option<[Estimate; 2]> {
    let fit = |run: &SensorRun| {
        let mut equations = NormalEquations::new(3);
        for (i, left) in model.left(run).into_iter().enumerate() {
            let beside = [run.reference_rad[i] - run.reference_rad[0], run.t_s[i] - run.t_s[0]];
            let of = |at: usize| if asked[at] { beside[at] } else { 0.0 };
            equations.add(&[1.0, of(0), of(1)], left);
        }
        let x = equations.solve();
        [x[1], x[2]]
    };
    let without: Vec<[f64; 2]> = (0..BLOCKS).map(|block| fit(&without_block(run, block)[0])).collect();
    let all = fit(&run[0]);
    let estimate = |at: usize| {
        let half = STUDENT_19 * jackknife(&without.iter().map(|w| w[at]).collect::<Vec<_>>());
        Estimate { value: all[at], ci95: [all[at] - half, all[at] + half] }
    };
    all.iter().all(|v| v.is_finite()).then(|| [estimate(0), estimate(1)])
}
