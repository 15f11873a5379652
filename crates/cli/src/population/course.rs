//! How a quantity goes from device to device, in the order in which they were made: trend, step, control chart.
//!
//! Ranks and medians decide: what is odd about a device is no trend.

use std::cmp::Ordering;

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::spread::median;

/// Median of |difference| of two draws of a normal distribution, over its standard deviation.
const MOVING_RANGE: f64 = 0.953_872_552_415_862_9;
/// Shewhart's limits, standard deviations from the centre.
const LIMITS: f64 = 3.0;
/// How probable a trend or step is to be claimed of one quantity that has none, before it is shared among the quantities.
const CLAIM: f64 = 0.01;

/// What changes along the order, and how probable as much is by chance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Change {
    /// evenly: by how much from the first to the last
    Trend { change: f64, chance: f64 },
    /// at once: from which place on, and the medians before and after
    Step { from: usize, before: f64, after: f64, chance: f64 },
}

/// Individuals chart: limits from what neighbours differ by, so that what changes slowly is seen against them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Chart {
    pub(crate) centre: f64,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    /// values outside the limits
    pub(crate) outside: usize,
    /// longest run of values on one side of the centre
    pub(crate) longest_run: usize,
}

impl Chart {
    /// The chart of values in their order; none where neighbours do not differ.
    pub(crate) fn of(values: &[f64]) -> Option<Self> {
        let ranges = values.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
        let deviation = median(ranges) / MOVING_RANGE;
        if deviation.is_nan() || deviation <= 0.0 {
            return None;
        }
        let centre = median(values.to_vec());
        let (lower, upper) = (centre - LIMITS * deviation, centre + LIMITS * deviation);
        let outside = values.iter().filter(|v| **v < lower || **v > upper).count();
        let sides = values.chunk_by(|a, b| (*a > centre) == (*b > centre));
        let longest_run = sides.map(<[f64]>::len).max().unwrap_or(0);
        Some(Self { centre, lower, upper, outside, longest_run })
    }
}

/// What changes along the order, if it is no accident among this many quantities.
pub(crate) fn change(values: &[f64], quantities: usize) -> Option<Change> {
    let (trend, step) = (trend(values)?, step(values)?);
    let (Change::Trend { change, chance: of_trend }, Change::Step { from, before, after, chance: of_step }) =
        (trend, step)
    else {
        return None;
    };
    let most = CLAIM / (2 * quantities.max(1)) as f64;
    match (of_trend < most, of_step < most) {
        (false, false) => None,
        (true, false) => Some(trend),
        (false, true) => Some(step),
        (true, true) => {
            let last = (values.len() - 1) as f64;
            let slope = |at: usize| change * at as f64 / last;
            let level = median(values.iter().enumerate().map(|(at, v)| v - slope(at)).collect());
            let off = |of: &dyn Fn(usize) -> f64| -> f64 {
                values.iter().enumerate().map(|(at, v)| (v - of(at)).abs()).sum()
            };
            let even = off(&|at| level + slope(at));
            let at_once = off(&|at| if at < from { before } else { after });
            Some(if even <= at_once { trend } else { step })
        }
    }
}

/// Spearman's rank correlation with the order; the size by the medians of the outer thirds, whose middles are two thirds of
/// the order apart.
fn trend(values: &[f64]) -> Option<Change> {
    let n = values.len();
    let ranks = ranks(values);
    let middle = 0.5 * (n as f64 - 1.0);
    let [mut products, mut squares, mut places] = [0.0; 3];
    for (at, rank) in ranks.iter().enumerate() {
        let (x, y) = (at as f64 - middle, rank - middle);
        products += x * y;
        squares += y * y;
        places += x * x;
    }
    let rho = products / (squares * places).sqrt();
    let freedom = n.checked_sub(2).filter(|f| *f > 0)? as f64;
    if !rho.is_finite() {
        return None;
    }
    let t = rho.abs() * (freedom / (1.0 - rho * rho).max(f64::MIN_POSITIVE)).sqrt();
    let chance = 2.0 * StudentsT::new(0.0, 1.0, freedom).ok()?.sf(t);
    let third = n.div_ceil(3);
    let change = 1.5 * (median(values[n - third..].to_vec()) - median(values[..third].to_vec()));
    Some(Change::Trend { change, chance })
}

/// Pettitt's test: the place where the ranks before and after differ most.
fn step(values: &[f64]) -> Option<Change> {
    let n = values.len() as f64;
    let (mut sum, mut best, mut from) = (0.0, 0.0_f64, 0);
    for (at, rank) in ranks(values).iter().enumerate() {
        sum += rank + 1.0;
        let lead = (2.0 * sum - (at as f64 + 1.0) * (n + 1.0)).abs();
        if lead > best {
            (best, from) = (lead, at + 1);
        }
    }
    let (before, after) = values.split_at_checked(from).filter(|(b, a)| !b.is_empty() && !a.is_empty())?;
    let chance = (2.0 * (-6.0 * best * best / (n.powi(3) + n.powi(2))).exp()).min(1.0);
    Some(Change::Step { from, before: median(before.to_vec()), after: median(after.to_vec()), chance })
}

/// Rank of each value from 0; equal ones share theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let mut out = vec![0.0; values.len()];
    let mut first = 0;
    for tied in order.chunk_by(|a, b| values[*a] == values[*b]) {
        let shared = first as f64 + 0.5 * (tied.len() as f64 - 1.0);
        tied.iter().for_each(|at| out[*at] = shared);
        first += tied.len();
    }
    out
}

/// Names by their letters, and by the numbers in them as numbers: `unit-9` before `unit-10`.
pub(crate) fn by_serial_number(a: &str, b: &str) -> Ordering {
    let parts = |text: &str| -> Vec<String> {
        let same = |x: &char, y: &char| x.is_ascii_digit() == y.is_ascii_digit();
        let letters: Vec<char> = text.chars().collect();
        letters.chunk_by(same).map(|part| part.iter().collect()).collect()
    };
    let (of_a, of_b) = (parts(a), parts(b));
    let part = |x: &String, y: &String| {
        let digits = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
        let number = |text: &str| text.trim_start_matches('0').to_owned();
        if digits(x) && digits(y) {
            let (x, y) = (number(x), number(y));
            x.len().cmp(&y.len()).then(x.cmp(&y))
        } else {
            x.cmp(y)
        }
    };
    let first = of_a.iter().zip(&of_b).map(|(x, y)| part(x, y)).find(|o| o.is_ne());
    first.unwrap_or_else(|| of_a.len().cmp(&of_b.len())).then_with(|| a.cmp(b))
}
