//! Channels that lie flat at an end of their range: an amplifier or a converter that the vibration exceeds. A sine is at its
//! highest value for a moment; one that is cut off is there for many rows.

use super::Carrier;
use super::windows::Window;

/// Rows at the same extreme value that are no chance,
const FEWEST_ROWS: usize = 20;
/// and how many times as many as at any of the values next to it: of a sine in coarse steps the highest holds up to
/// 1/(√2 − 1) = 2.4 times as many as the next.
const OVER_THE_NEXT: usize = 5;
/// Values next to an extreme one that are counted; engineering choice.
const NEXT: usize = 8;

/// The rail at one end of a channel's range, V, and rows at it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Rail {
    level: f64,
    rows: usize,
}

impl Rail {
    /// At the upper end of these values.
    fn above(values: impl Iterator<Item = f64>) -> Option<Self> {
        // the largest values, largest first, and how often each was seen
        let mut largest: Vec<(f64, usize)> = Vec::with_capacity(NEXT + 2);
        for v in values.filter(|v| v.is_finite()) {
            let at = largest.partition_point(|(level, _)| *level > v);
            match largest.get_mut(at) {
                Some((level, rows)) if level.total_cmp(&v).is_eq() => *rows += 1,
                _ if at <= NEXT => {
                    largest.insert(at, (v, 1));
                    largest.truncate(NEXT + 1);
                }
                _ => {}
            }
        }
        let (&(level, rows), next) = largest.split_first()?;
        let most = next.iter().map(|(_, rows)| *rows).max()?;
        (rows >= FEWEST_ROWS && rows > OVER_THE_NEXT * most).then_some(Self { level, rows })
    }

    fn of(values: &[f64]) -> [Option<Self>; 2] {
        let below = Self::above(values.iter().map(|v| -v)).map(|r| Self { level: -r.level, ..r });
        [Self::above(values.iter().copied()), below]
    }
}

/// The rails that the channels of a recording lie at.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rails {
    x: [Option<Rail>; 2],
    y: [Option<Rail>; 2],
}

impl Rails {
    pub(super) fn of(carrier: Carrier<'_>) -> Self {
        Self { x: Rail::of(carrier.x), y: Rail::of(carrier.y) }
    }

    pub(super) fn are_reached(&self) -> bool {
        self.x.iter().chain(&self.y).any(Option::is_some)
    }

    /// Leaves out windows with rows at a rail, and says how many.
    pub(super) fn leave_out(&self, carrier: Carrier<'_>, windows: &mut Vec<Window>) -> usize {
        if !self.are_reached() {
            return 0;
        }
        #[allow(clippy::float_cmp, reason = "what is cut off is at exactly one value")]
        let at = |rails: &[Option<Rail>; 2], v: f64| rails.iter().flatten().any(|r| r.level == v);
        let before = windows.len();
        windows.retain(|w| w.rows.clone().all(|i| !at(&self.x, carrier.x[i]) && !at(&self.y, carrier.y[i])));
        before - windows.len()
    }

    /// What lies flat where.
    pub(super) fn said(&self) -> String {
        let channel = |name: &str, rails: &[Option<Rail>; 2]| {
            let said = |r: &Rail| format!("{name} lies flat at {:.4} in {} rows", r.level, r.rows);
            rails.iter().flatten().map(said).collect::<Vec<_>>()
        };
        let all = [channel("x_v", &self.x), channel("y_v", &self.y)].concat();
        format!("{}, as of a range that the vibration exceeds", all.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decay(step: f64, limit: f64) -> Vec<f64> {
        let wave = |i: i32| (-5e-5 * f64::from(i)).exp() * (1.911 * f64::from(i)).cos();
        (0..20_000).map(wave).map(|v| ((v / step).round() * step).clamp(-limit, limit)).collect()
    }

    #[test]
    fn a_channel_that_is_cut_off_is_named_and_one_in_coarse_steps_is_not() {
        for step in [1e-9, 3e-5, 1.0 / 128.0, 1.0 / 32.0] {
            assert_eq!(Rail::of(&decay(step, 2.0)), [None, None], "{step}");
        }
        for step in [1e-9, 3e-5] {
            let [above, below] = Rail::of(&decay(step, 0.97)).map(Option::unwrap);
            assert!((above.level - 0.97).abs() < 1e-12 && (below.level + 0.97).abs() < 1e-12, "{above:?} {below:?}");
        }
    }

    #[test]
    fn windows_with_rows_at_a_rail_are_left_out() {
        let (x, y) = (decay(1e-9, 0.97), decay(1e-9, 2.0));
        let t: Vec<f64> = (0..x.len()).map(|i| 2e-5 * i as f64).collect();
        let carrier = Carrier { t_s: &t, x: &x, y: &y, forces: None };
        let rails = Rails::of(carrier);
        let window =
            |i: usize| Window { t_s: t[i], envelope: cvg_model::Envelope::zero(), forces: None, rows: i..i + 100 };
        let mut windows: Vec<Window> = (0..x.len()).step_by(100).map(window).collect();
        // 1 falls to 0.97 in ln(1/0.97)/5e-5 = 609 rows
        assert!((6..=7).contains(&rails.leave_out(carrier, &mut windows)));
        assert!(rails.said().starts_with("x_v lies flat at 0.9700 in "), "{}", rails.said());
    }
}
