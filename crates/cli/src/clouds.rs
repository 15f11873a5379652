//! The angle error over the pattern angle as a still picture: for the README, the book, and readers without scripts.

use cvg_calibration::{BiasCurve, Identification};

use crate::Failure;
use crate::figure::{BLUE, GREEN, Series, VERMILLION, plot};
use crate::report::name_of_angle;

/// Some `wanted` of `total` points. Every so many would beat with the turns of the pattern and draw stripes that are not
/// in the data; steps of the golden ratio are in step with nothing.
pub(crate) fn thinned<T>(all: impl Iterator<Item = T>, total: usize, wanted: usize) -> impl Iterator<Item = T> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let share = wanted as f64 / total.max(1) as f64;
    all.enumerate().filter(move |(i, _)| (*i as f64 * GOLDEN).fract() < share).map(|(_, point)| point)
}

/// Angle error over the pattern angle as SVG: all three stages, or without the raw one.
pub(crate) fn bias_svg(identified: &Identification, points: usize, with_raw: bool) -> Result<String, Failure> {
    let curves = &identified.figures.bias;
    let total: usize = curves.iter().map(|c| c.pattern_deg.len()).sum();
    let cloud = |name, colour, pick: fn(&BiasCurve) -> &Vec<f64>| {
        let all = curves.iter().flat_map(|c| c.pattern_deg.iter().copied().zip(pick(c).iter().copied()));
        Series { name, colour, points: thinned(all, total, points).collect(), joined: false }
    };
    let series = [
        cloud("raw", VERMILLION, |c| &c.raw_deg),
        cloud("declared", BLUE, |c| &c.declared_deg),
        cloud("discovered", GREEN, |c| &c.discovered_deg),
    ];
    plot(
        &format!("{} [deg]", name_of_angle(identified)),
        "angle error [deg]",
        if with_raw { &series } else { &series[1..] },
    )
}

#[cfg(test)]
mod tests {
    use super::thinned;

    #[test]
    fn a_thinned_turn_is_still_covered_evenly() {
        // 160 directions, one after the other, again and again
        let all = (0..8000).map(|i| i % 160);
        let mut seen = [0; 160];
        thinned(all, 8000, 1200).for_each(|direction: usize| seen[direction] += 1);
        let count: usize = seen.iter().sum();
        assert!(count.abs_diff(1200) < 5, "{count}");
        assert!(seen.iter().all(|n| (4..=11).contains(n)), "{seen:?}");
    }

    #[test]
    fn few_points_are_kept_all() {
        assert_eq!(thinned(0..10, 10, 1200).count(), 10);
    }
}
