//! What two channels draw against each other.

use super::readout::Readout;
use super::samples::SensorRun;

/// Points of a curve in a figure.
const POINTS: usize = 1500;

/// Held-out points of two channels, as a figure shows them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Curve {
    /// x and y as recorded, over their mean radius
    pub before: Vec<[f64; 2]>,
    /// x and y with what was found undone, over their mean radius
    pub after: Vec<[f64; 2]>,
}

impl Curve {
    pub(crate) fn new(readout: &Readout, runs: &[SensorRun]) -> Self {
        let plain = Readout { rails: readout.rails, ..Readout::plain() };
        Self { before: points(&plain, runs), after: points(readout, runs) }
    }
}

fn points(readout: &Readout, runs: &[SensorRun]) -> Vec<[f64; 2]> {
    let mean = mean_radius(readout, runs);
    let all: Vec<[f64; 2]> = undone(readout, runs).collect();
    all.iter().step_by((all.len() / POINTS).max(1)).map(|[x, y]| [x / mean, y / mean]).collect()
}

/// Points of all runs behind the readout; rows at a rail are left out.
pub(crate) fn undone<'a>(readout: &'a Readout, runs: &'a [SensorRun]) -> impl Iterator<Item = [f64; 2]> + 'a {
    let rows = runs.iter().filter_map(SensorRun::channels).flatten();
    rows.filter(|z| !readout.rails.clips(**z)).map(|z| readout.undo(*z))
}

pub(crate) fn mean_radius(readout: &Readout, runs: &[SensorRun]) -> f64 {
    let (n, sum) = undone(readout, runs).fold((0.0, 0.0), |(n, sum), [x, y]| (n + 1.0, sum + x.hypot(y)));
    sum / f64::max(n, 1.0)
}
