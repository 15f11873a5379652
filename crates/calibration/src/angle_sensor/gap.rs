//! The part of the sensor's period that no row stands in: a table is free there, and is held to what harmonics usually are.

use std::f64::consts::TAU;

/// Share of the period from which on a part without rows is one that rows beside it do not bridge, where it is wider than any other by
/// this factor: the last quarter of a turn that is held out is a fourth, and stations are as far apart everywhere. Engineering choices.
const LEAST: f64 = 0.15;
const ALONE: f64 = 2.0;

/// A part of the period, in periods.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gap {
    from: f64,
    pub(super) width: f64,
}

/// The place of an angle in its period, 0 … 1.
fn place(angle: f64, cycles: f64) -> f64 {
    (angle * cycles / TAU).rem_euclid(1.0)
}

impl Gap {
    /// The one that these angles leave, of a period 2π/`cycles`; `None` where they leave none.
    pub(super) fn of(angles: impl Iterator<Item = f64>, cycles: f64) -> Option<Self> {
        let mut places: Vec<f64> = angles.map(|a| place(a, cycles)).collect();
        places.sort_by(f64::total_cmp);
        let (first, last) = (*places.first()?, *places.last()?);
        let mut widest = Self { from: last, width: 1.0 + first - last };
        let mut next = 0.0;
        for pair in places.windows(2) {
            let width = pair[1] - pair[0];
            if width > widest.width {
                next = widest.width;
                widest = Self { from: pair[0], width };
            } else {
                next = width.max(next);
            }
        }
        (widest.width >= LEAST && widest.width > ALONE * next).then_some(widest)
    }

    /// The rest of the period, from and to.
    pub(super) fn covered(&self) -> [f64; 2] {
        let from = (self.from + self.width).rem_euclid(1.0);
        [from, from + 1.0 - self.width]
    }

    /// Whether an angle lies in it, further from its ends than `edge` periods.
    pub(super) fn holds(&self, angle: f64, cycles: f64, edge: f64) -> bool {
        (edge..self.width - edge).contains(&(place(angle, cycles) - self.from).rem_euclid(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_of_a_turn_that_was_not_met_is_a_gap_and_even_stations_leave_none() {
        let of = |degrees: &[f64], cycles| Gap::of(degrees.iter().map(|d| d.to_radians()), cycles);
        let quarters: Vec<f64> = (0..28).map(|i| 300.0 + 10.0 * f64::from(i)).collect();
        let gap = of(&quarters, 1.0).expect("a quarter is missing");
        assert!((gap.width - 0.25).abs() < 1e-9);
        let [from, to] = gap.covered().map(|share| 360.0 * share);
        assert!((from - 300.0).abs() < 1e-6 && (to - 570.0).abs() < 1e-6, "{from} to {to}");
        let holds = |deg: f64| gap.holds(deg.to_radians(), 1.0, 0.02);
        assert!(holds(250.0) && holds(610.0) && !holds(205.0) && !holds(310.0) && !holds(20.0));
        // four periods a turn meet all of each
        assert!(of(&quarters, 4.0).is_none());
        assert!(of(&[0.0, 60.0, 120.0, 180.0, 240.0, 300.0], 1.0).is_none());
        assert!(of(&[], 1.0).is_none());
    }
}
