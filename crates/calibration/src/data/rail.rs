//! The rail of a converter: the extreme value occurs far more often than the level beside it.

use crate::recording::{Channel, Recording};

/// The extreme value has to occur this often, and in this share of the rows, to be a rail.
const FEWEST_TIES: usize = 4;
const LEAST_SHARE: f64 = 0.002;
/// … and this many times as often as the next level. A sine dwells at its peak: its last two levels of equal width are
/// occupied as √2 : 2 − √2, 2.4 times at most.
const TIES_OVER_NEXT: usize = 4;

/// The rails that a channel reaches, lower and upper; infinite where it reaches none.
pub(crate) fn rails(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let lower = if is_rail(sorted.iter().copied()) { sorted[0] } else { f64::NEG_INFINITY };
    let upper = if is_rail(sorted.iter().rev().copied()) { sorted[sorted.len() - 1] } else { f64::INFINITY };
    [lower, upper]
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

/// Whether each row of a recording has a channel of the vibration in phase at a rail, by the channel's own values.
pub(crate) fn rows_at_rails(recording: &Recording) -> Vec<bool> {
    let mut out = vec![false; recording.len()];
    for values in [Channel::Xc, Channel::Yc].into_iter().filter_map(|c| recording.channel(c)) {
        let [lower, upper] = rails(values.iter().copied());
        out.iter_mut().zip(values).for_each(|(out, v)| *out |= *v <= lower || *v >= upper);
    }
    out
}
