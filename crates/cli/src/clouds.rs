//! The angle error over the pattern angle as a still picture: for the README, the book, and readers without scripts.

use cvg_calibration::{BiasCurve, Identification};

use crate::Failure;
use crate::figure::{BLUE, GREEN, Series, VERMILLION, plot};

/// Angle error over the pattern angle as SVG: all three stages, or without the raw one.
pub(crate) fn bias_svg(identified: &Identification, points: usize, with_raw: bool) -> Result<String, Failure> {
    let curves = &identified.figures.bias;
    let total: usize = curves.iter().map(|c| c.pattern_deg.len()).sum();
    let stride = (total / points).max(1);
    let cloud = |name, colour, pick: fn(&BiasCurve) -> &Vec<f64>| {
        let all = curves.iter().flat_map(|c| c.pattern_deg.iter().copied().zip(pick(c).iter().copied()));
        Series { name, colour, points: all.step_by(stride).collect(), joined: false }
    };
    let series = [
        cloud("raw", VERMILLION, |c| &c.raw_deg),
        cloud("declared", BLUE, |c| &c.declared_deg),
        cloud("discovered", GREEN, |c| &c.discovered_deg),
    ];
    plot("pattern angle [deg]", "angle error [deg]", if with_raw { &series } else { &series[1..] })
}
