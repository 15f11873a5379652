//! The parts of the sensor's period that no row stands in: a table is free there, and is held to what harmonics usually are.

use std::f64::consts::TAU;

/// A part without rows is one that rows beside it do not bridge from [`Gap::LEAST`] on, where it is wider than those that are none by this
/// factor: the last quarter of a turn that is held out is a fourth, and stations are as far apart everywhere. Engineering choices.
const ALONE: f64 = 2.0;

/// A part of the period, in periods.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gap {
    from: f64,
    pub(super) width: f64,
}

/// The place of an angle in its period, 0 … 1.
pub(super) fn place(angle: f64, cycles: f64) -> f64 {
    (angle * cycles / TAU).rem_euclid(1.0)
}

impl Gap {
    /// Share of the period from which on a part without rows is a gap.
    pub(super) const LEAST: f64 = 0.15;

    /// Those that these angles leave, of a period 2π/`cycles`, the widest first.
    pub(super) fn all(angles: impl Iterator<Item = f64>, cycles: f64) -> Vec<Self> {
        let mut places: Vec<f64> = angles.map(|a| place(a, cycles)).collect();
        places.sort_by(f64::total_cmp);
        let (Some(first), Some(last)) = (places.first(), places.last()) else { return Vec::new() };
        let around = Self { from: *last, width: 1.0 + first - last };
        let between = places.windows(2).map(|pair| Self { from: pair[0], width: pair[1] - pair[0] });
        let mut parts: Vec<Self> = between.chain([around]).collect();
        parts.sort_by(|a, b| b.width.total_cmp(&a.width));
        let are_gaps = |count: &usize| {
            let next = parts.get(*count).map_or(f64::INFINITY, |part| ALONE * part.width);
            parts[count - 1].width >= Self::LEAST && parts[count - 1].width > next
        };
        let count = (1..=parts.len()).filter(are_gaps).max().unwrap_or(0);
        parts.truncate(count);
        parts
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
        let all = |degrees: &[f64], cycles| Gap::all(degrees.iter().map(|d| d.to_radians()), cycles);
        let of = |degrees: &[f64], cycles| all(degrees, cycles).first().copied();
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
        // two of them, neither twice as wide as the other
        let halves: Vec<f64> =
            (0..12).map(|i| 10.0 * f64::from(i)).chain((0..12).map(|i| 183.0 + 10.0 * f64::from(i))).collect();
        let two = all(&halves, 1.0);
        assert!(
            two.len() == 2
                && two
                    .iter()
                    .all(|gap| gap.holds(145f64.to_radians(), 1.0, 0.0) || gap.holds(330f64.to_radians(), 1.0, 0.0)),
            "{two:?}"
        );
    }
}
