//! How values of many devices scatter, each with an error of its own, and how unlikely a value is beside the others.
//!
//! The bulk says it: neither the centre nor the spread nor the tails are drawn by what is far out, so that one odd device
//! does not hide another.

use statrs::distribution::{Continuous, ContinuousCDF, StudentsT};

/// Median of |z| of a normal distribution.
const NORMAL_MEDIAN: f64 = 0.674_489_750_196_081_7;
/// Scores beyond this, in robust deviations, say nothing of the bulk.
const BULK: f64 = 5.0;
/// Values on a side from which on it has tails of its own.
const OWN_TAIL: usize = 50;
/// Degrees of freedom of the tails that are held possible; infinity is the normal distribution.
const TAILS: [f64; 8] = [2.0, 2.5, 3.0, 4.0, 6.0, 10.0, 25.0, f64::INFINITY];
/// Scales that are held possible, times the robust deviation, evenly in the logarithm.
const SCALES: usize = 17;
const WIDEST: f64 = 2.0;
/// What is less probable is left out.
const NEGLIGIBLE: f64 = 1e-12;
/// Standard deviation of a normal sample's robust deviation, relative, and of its median, in standard deviations, times √n.
const OF_SPREAD: f64 = 1.17;
const OF_MEDIAN: f64 = 1.2533;
/// Rounds in which centre and spread settle, and halvings that find the spread.
const ROUNDS: usize = 8;
const HALVINGS: usize = 60;

/// A value and its standard error; zero where it has none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Measured {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

/// How values scatter.
#[derive(Debug, Clone)]
pub(crate) struct Spread {
    /// median, weighted by what each value is sure of
    pub(crate) centre: f64,
    /// robust standard deviation between the devices, what their errors account for taken off
    pub(crate) between: f64,
    /// the same, as large as it may be: two standard deviations of its own above it
    pub(crate) between_at_most: f64,
    /// standard deviation of the centre
    pub(crate) centre_error: f64,
    /// tails below and above the centre
    tails: [Tail; 2],
}

/// Distributions whose tails the bulk leaves possible, and how probable each is.
#[derive(Debug, Clone)]
struct Tail(Vec<(StudentsT, f64)>);

impl Spread {
    /// How values scatter; none where more than half of them are one number without an error.
    pub(crate) fn of(values: &[Measured]) -> Option<Self> {
        let all = || values.iter().copied();
        let mut centre = median(all().map(|m| m.value).collect());
        let mut between = 0.0;
        for _ in 0..ROUNDS {
            between = spread_about(values, centre, NORMAL_MEDIAN);
            let weighted = all().map(|m| (m.value, m.error.hypot(between).recip())).collect();
            let next = weighted_median(weighted)?;
            if next == centre {
                break;
            }
            centre = next;
        }
        let mut scores: Vec<f64> = all().map(|m| score(m, centre, between)).collect();
        scores.sort_by(f64::total_cmp);
        if scores.iter().filter(|z| z.is_finite()).count() * 2 <= scores.len() {
            return None;
        }
        let below: Vec<f64> = scores.iter().filter(|z| **z <= 0.0).map(|z| -z).collect();
        let above: Vec<f64> = scores.iter().filter(|z| **z >= 0.0).copied().collect();
        let tails = if below.len().min(above.len()) >= OWN_TAIL {
            [Tail::of(&below), Tail::of(&above)]
        } else {
            let both = Tail::of(&scores.iter().map(|z| z.abs()).collect::<Vec<_>>());
            [both.clone(), both]
        };
        let root = (values.len() as f64).sqrt();
        let between_at_most = spread_about(values, centre, NORMAL_MEDIAN / (1.0 + 2.0 * OF_SPREAD / root));
        let typical = median(all().map(|m| m.error.hypot(between)).collect());
        Some(Self { centre, between, between_at_most, centre_error: OF_MEDIAN * typical / root, tails })
    }

    /// Distance from the centre, in standard deviations of devices and error together.
    pub(crate) fn score(&self, m: Measured) -> f64 {
        score(m, self.centre, self.between)
    }

    /// How probable a value at least as far out on either side is, for a device like the others.
    pub(crate) fn chance(&self, m: Measured) -> f64 {
        let z = self.score(m);
        if z.is_nan() { 1.0 } else { self.tails[usize::from(z > 0.0)].beyond(z.abs()) }
    }
}

/// (x − centre)/√(between² + error²); NaN of what has neither.
fn score(m: Measured, centre: f64, between: f64) -> f64 {
    (m.value - centre) / m.error.hypot(between)
}

/// The deviation between devices at which the scores have this median size.
fn spread_about(values: &[Measured], centre: f64, wanted: f64) -> f64 {
    let typical = |between: f64| {
        let size = |m: &Measured| if m.value == centre { 0.0 } else { score(*m, centre, between).abs() };
        median(values.iter().map(size).collect())
    };
    if typical(0.0) <= wanted {
        return 0.0;
    }
    let far = values.iter().map(|m| (m.value - centre).abs()).fold(0.0, f64::max) / wanted;
    let (mut low, mut high) = (0.0, far);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        *(if typical(middle) > wanted { &mut low } else { &mut high }) = middle;
    }
    high
}

impl Tail {
    /// Student's distributions of every tail and scale held possible, by their likelihood for the bulk of the sizes: of
    /// what is beyond [`BULK`], not even the number is used.
    fn of(sizes: &[f64]) -> Self {
        let bulk: Vec<f64> = sizes.iter().copied().filter(|z| *z <= BULK).collect();
        let mut found = Vec::with_capacity(TAILS.len() * SCALES);
        for tail in TAILS {
            for step in 0..SCALES {
                let scale = WIDEST.powf(2.0 * step as f64 / (SCALES - 1) as f64 - 1.0);
                let Ok(t) = StudentsT::new(0.0, scale, tail) else { continue };
                let within = (1.0 - 2.0 * t.sf(BULK)).ln();
                found.push((t, bulk.iter().map(|z| t.ln_pdf(*z) - within).sum()));
            }
        }
        let best = found.iter().map(|f: &(_, f64)| f.1).fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = found.iter().map(|f| (f.1 - best).exp()).sum();
        let weighed = found.into_iter().map(|(t, likelihood)| (t, (likelihood - best).exp() / total));
        Self(weighed.filter(|(_, weight)| *weight > NEGLIGIBLE).collect())
    }

    /// P(|z'| > z)
    fn beyond(&self, z: f64) -> f64 {
        if z.is_infinite() { 0.0 } else { self.0.iter().map(|(t, weight)| weight * 2.0 * t.sf(z)).sum() }
    }
}

pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

/// The value on either side of which lies half of the weight; none without a finite one. What weighs infinitely decides alone.
fn weighted_median(mut values: Vec<(f64, f64)>) -> Option<f64> {
    if values.iter().any(|(_, w)| w.is_infinite()) {
        return Some(median(values.into_iter().filter(|(_, w)| w.is_infinite()).map(|(v, _)| v).collect()));
    }
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|(_, w)| w).sum::<f64>();
    let mut before = 0.0;
    for (at, (value, weight)) in values.iter().enumerate() {
        before += weight;
        if before > half {
            return Some(*value);
        }
        if before == half {
            let next = values.get(at + 1).map_or(*value, |(v, _)| *v);
            return Some(0.5 * (value + next));
        }
    }
    values.last().map(|(v, _)| *v)
}
