//! Clipping of a channel at the rail of its converter: the extreme value occurs far more often than the level beside it.

/// The extreme value has to occur this often, and in this share of the rows, to be a rail.
const FEWEST_TIES: usize = 4;
const LEAST_SHARE: f64 = 0.002;
/// … and this many times as often as the next level. A sine dwells at its peak: its last two levels of equal width are
/// occupied as √2 : 2 − √2, 2.4 times at most.
const TIES_OVER_NEXT: usize = 4;

/// The rails of both channels, in their unit; infinite where none is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rails {
    /// lower and upper rail of x and of y
    pub(crate) limits: [[f64; 2]; 2],
}

impl Rails {
    /// No rail is reached.
    pub(crate) fn none() -> Self {
        Self { limits: [[f64::NEG_INFINITY, f64::INFINITY]; 2] }
    }

    /// The rails that the readings of all runs show.
    pub(crate) fn of<'a>(readings: impl Iterator<Item = &'a [f64; 2]>) -> Self {
        let readings: Vec<[f64; 2]> = readings.copied().collect();
        let mut rails = Self::none();
        for (channel, limits) in rails.limits.iter_mut().enumerate() {
            let mut values: Vec<f64> = readings.iter().map(|z| z[channel]).collect();
            values.sort_by(f64::total_cmp);
            if is_rail(values.iter().copied()) {
                limits[0] = values[0];
            }
            if is_rail(values.iter().rev().copied()) {
                limits[1] = values[values.len() - 1];
            }
        }
        rails
    }

    /// Which channels are at a rail.
    #[inline]
    pub(crate) fn reached(&self, z: [f64; 2]) -> [bool; 2] {
        std::array::from_fn(|i| z[i] <= self.limits[i][0] || z[i] >= self.limits[i][1])
    }

    /// Any channel is at a rail.
    #[inline]
    pub(crate) fn clips(&self, z: [f64; 2]) -> bool {
        self.reached(z).contains(&true)
    }

    /// A rail was found.
    pub(crate) fn any(&self) -> bool {
        self.limits.iter().flatten().any(|l| l.is_finite())
    }
}

/// Whether the first of `sorted`, from the outermost inwards, is a rail.
fn is_rail(sorted: impl ExactSizeIterator<Item = f64> + Clone) -> bool {
    let count = sorted.len();
    let Some(extreme) = sorted.clone().next() else { return false };
    let ties = sorted.clone().take_while(|v| *v == extreme).count();
    let mut inner = sorted.skip(ties);
    let next = inner.next();
    let beside = next.map_or(0, |next| 1 + inner.take_while(|v| *v == next).count());
    #[allow(clippy::cast_precision_loss, reason = "a count of rows")]
    let enough = ties >= FEWEST_TIES && ties as f64 >= LEAST_SHARE * count as f64;
    // half of all rows at one value is a channel that does not move
    enough && ties > TIES_OVER_NEXT * beside.max(1) && 2 * ties < count
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(limit: f64) -> Vec<[f64; 2]> {
        (0..2000)
            .map(|i| f64::from(i) * 0.031_7)
            .map(|t| [(600.0 * t.cos()).round().min(limit), (500.0 * t.sin()).round()])
            .collect()
    }

    #[test]
    fn a_channel_cut_at_its_rail_is_seen_and_a_whole_one_is_not() {
        assert_eq!(
            Rails::of(circle(511.0).iter()).limits,
            [[f64::NEG_INFINITY, 511.0], [f64::NEG_INFINITY, f64::INFINITY]]
        );
        assert!(!Rails::of(circle(1e9).iter()).any());
    }

    #[test]
    fn a_sine_in_a_few_coarse_steps_has_no_rail() {
        let coarse: Vec<[f64; 2]> = (0..4000)
            .map(|i| f64::from(i) * 0.017)
            .map(|t| [(20.0 * t.cos()).round(), (20.0 * t.sin()).round()])
            .collect();
        assert!(!Rails::of(coarse.iter()).any());
    }
}
