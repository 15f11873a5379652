//! The angle random walk N, read where the Allan deviation falls as 1/√τ.
//!
//! Whatever makes the noise of a rate remember, over a time short against τ, takes a constant from the variance of the
//! angle's changes, N²τ - C: a low-pass filter, the trapezoidal rule, digits and noise of the angle (C < 0) alike. The Allan
//! variance of such noise, of flicker and of a random walk of the rate is, at averaging times beyond that memory,
//! $$σ^2(τ) = \frac{3Q}{τ^2} + \frac{N^2}{τ} + B^2 + \frac{K^2 τ}{3}, \quad Q = -C/2,$$
//! with Q of either sign (NIST SP 1065, sections 5.2.4 and 5.13). It is fitted at averaging times a factor of two apart by
//! generalised least squares, with the covariance that normal noise of this model gives their overlapping estimates. The shortest time is the
//! first from which a chi-squared test does not reject the model, well beyond the last that it rejected, beyond the memory
//! that Q tells, and beyond the time in which the angle goes through its last digit. The interval is a profile of N² with
//! Student's point of what is left, wider where the model leaves more than noise does.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

use super::allan::overlapping;
use crate::facts::Estimate;
use crate::numerics::linear::NormalEquations;

/// Terms of the model, in the order of their slopes; only the first may be negative.
const TERMS: usize = 4;
/// The place of N² among them.
const WALK: usize = 1;
/// Second differences of the angle.
const DIFFERENCE: [f64; 3] = [1.0, -2.0, 1.0];
/// Probability with which noise of the model leaves more: beyond it the model is rejected.
const BY_CHANCE: f64 = 0.01;
/// The shortest time is longer than the last that was rejected by this factor …
const BEYOND_REJECTED: usize = 4;
/// … and than the memory C/N² by this: of a first-order filter's 2 % are left.
const BEYOND_MEMORY: f64 = 4.0;
/// Averaging times that have to be there beside as many as there are terms.
const SPARE: f64 = 2.0;
/// Rounds in which the covariance and the values settle.
const ROUNDS: usize = 8;
/// Lags of a covariance are this many in the shorter averaging time, and reach to this many of both.
const FINENESS: usize = 8;
const REACH: usize = 4;
/// Averaging times further apart than this factor are taken as independent: white noise correlates them by less than 0.002.
const APART: usize = 64;
/// Halvings of the profile.
const HALVINGS: usize = 60;
/// Share of the largest step below which a step is rounding.
const ROUNDING: f64 = 1e-9;

/// An angle random walk that was read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AngleRandomWalk {
    /// N, in the unit of the angle per √s
    pub(crate) value: Estimate,
    /// the shortest averaging time that it was read at, s
    pub(crate) from_s: f64,
}

/// Why none was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unread {
    /// N² may as well be nothing
    NoneOfIt,
    /// from no averaging time on does the model hold, or too few are left where it does
    NoModel,
}

/// The angle random walk of stretches of an angle, each sampled every `interval_s` > 0.
///
/// # Errors
/// Where the stretches do not tell one.
pub(crate) fn angle_random_walk(stretches: &[Vec<f64>], interval_s: f64) -> Result<AngleRandomWalk, Unread> {
    let longest = stretches.iter().map(Vec::len).max().unwrap_or(0);
    let octaves: Vec<usize> =
        std::iter::successors(Some(1usize), |m| Some(2 * m)).take_while(|m| 4 * m < longest).collect();
    let first = octaves.iter().position(|m| leaves_its_digit(stretches, *m)).ok_or(Unread::NoModel)?;
    let octaves = &octaves[first..];
    let variances: Vec<f64> =
        overlapping(stretches, 1.0, octaves).iter().map(|point| point.deviation.powi(2)).collect();
    let moments = moments(stretches, octaves);
    let mut last_rejected = None;
    for (from, &m) in octaves.iter().enumerate() {
        if last_rejected.is_some_and(|rejected| m < BEYOND_REJECTED * rejected) {
            continue;
        }
        let points = Points { octaves: &octaves[from..], variances: &variances[from..], moments: &moments, from };
        let Some(fit) = points.fitted().filter(|fit| !fit.is_rejected()) else {
            last_rejected = Some(m);
            continue;
        };
        if fit.spare < SPARE {
            continue;
        }
        // C/N² of N²τ - C, in samples
        let memory = -2.0 * fit.values[0] / fit.values[WALK];
        if fit.values[WALK] > 0.0 && (m as f64) < BEYOND_MEMORY * memory {
            continue;
        }
        let [low, value, high] = fit.profile().ok_or(Unread::NoneOfIt)?.map(|square| (square / interval_s).sqrt());
        return Ok(AngleRandomWalk { value: Estimate { value, ci95: [low, high] }, from_s: m as f64 * interval_s });
    }
    Err(Unread::NoModel)
}

/// Over so many samples the angle goes through its last digit, as a rule: what is rounded is then independent noise.
fn leaves_its_digit(stretches: &[Vec<f64>], samples: usize) -> bool {
    let steps = || stretches.iter().flat_map(|s| s.windows(2).map(|w| (w[1] - w[0]).abs()));
    let largest = steps().fold(0.0, f64::max);
    let digit = steps().filter(|step| *step > ROUNDING * largest).fold(largest, f64::min);
    let over = || stretches.iter().flat_map(|s| s.iter().zip(s.iter().skip(samples)).map(|(a, b)| b - a));
    let count = over().count().max(1) as f64;
    let mean = over().sum::<f64>() / count;
    over().map(|step| (step - mean).powi(2)).sum::<f64>() / count >= digit * digit
}

/// Allan variance of a unit of each term at an averaging time, in samples.
fn basis(m: usize) -> [f64; TERMS] {
    let tau = m as f64;
    [3.0 / (tau * tau), 1.0 / tau, 1.0, tau / 3.0]
}

/// What Σ over lags of products of the terms' covariances of second differences over `m` and `n` samples gives the
/// covariance of the two Allan variances.
type Moments = [[f64; TERMS]; TERMS];

/// Of each pair of averaging times.
fn moments(stretches: &[Vec<f64>], octaves: &[usize]) -> Vec<Vec<Moments>> {
    let mut lengths: Vec<usize> = stretches.iter().map(Vec::len).collect();
    lengths.sort_unstable_by(|a, b| b.cmp(a));
    let lengths = Lengths::new(lengths);
    let of = |a: usize, b: usize| {
        let (m, n) = (octaves[a.min(b)], octaves[a.max(b)]);
        if n > APART * m { [[0.0; TERMS]; TERMS] } else { moments_of(&lengths, m, n) }
    };
    let upper: Vec<Vec<Moments>> = (0..octaves.len()).map(|a| (a..octaves.len()).map(|b| of(a, b)).collect()).collect();
    (0..octaves.len()).map(|a| (0..octaves.len()).map(|b| upper[a.min(b)][a.max(b) - a.min(b)]).collect()).collect()
}

/// How many rows the stretches have beyond any number of them each.
struct Lengths {
    longest_first: Vec<usize>,
    sums: Vec<f64>,
}

impl Lengths {
    fn new(longest_first: Vec<usize>) -> Self {
        let sums = longest_first.iter().scan(0.0, |sum, length| {
            *sum += *length as f64;
            Some(*sum)
        });
        Self { sums: sums.collect(), longest_first }
    }

    fn beyond(&self, rows: i64) -> f64 {
        let longer = self.longest_first.partition_point(|length| i64::try_from(*length).unwrap_or(i64::MAX) > rows);
        if longer == 0 { 0.0 } else { self.sums[longer - 1] - longer as f64 * rows as f64 }
    }
}

#[allow(clippy::cast_possible_wrap, reason = "counts of samples")]
fn moments_of(lengths: &Lengths, m: usize, n: usize) -> Moments {
    let (m, n) = (m as i64, n as i64);
    let step = (m / FINENESS as i64).max(1);
    let reach = REACH as i64 * (m + n) / step;
    let mut sums = [[0.0; TERMS]; TERMS];
    let mut add = |covariances: [f64; TERMS], weight: f64| {
        for (row, a) in sums.iter_mut().zip(covariances) {
            row.iter_mut().zip(covariances).for_each(|(sum, b)| *sum += weight * a * b);
        }
    };
    // pairs of second differences that are so far apart
    let pairs = |lag: i64| lengths.beyond((2 * m).max(2 * n - lag) + lag.max(0));
    for lag in (-reach..=reach).map(|i| i * step) {
        add(covariances(m, n, lag, 0.0), step as f64 * pairs(lag));
    }
    // noise of the angle by itself correlates single lags
    let mut shared: Vec<i64> = (0..3).flat_map(|p| (0..3).map(move |q| q * n - p * m)).collect();
    shared.sort_unstable();
    shared.dedup();
    for lag in shared {
        add(covariances(m, n, lag, 0.0), -pairs(lag));
        add(covariances(m, n, lag, 1.0), pairs(lag));
    }
    let count = |m: i64| lengths.beyond(2 * m) * (m * m) as f64;
    let scale = 0.5 / (count(m) * count(n));
    sums.map(|row| row.map(|sum| scale * sum))
}

/// Covariance of a second difference over m samples with one over n samples that ends `lag` later, of a unit of each term, by
/// their generalised covariances: δ, -|h|/2, h² ln|h|/(4 ln 2) and |h|³/12.
fn covariances(m: i64, n: i64, lag: i64, of_the_angle: f64) -> [f64; TERMS] {
    let mut sums = [0.0; TERMS];
    for (p, a) in (0i64..).zip(DIFFERENCE) {
        for (q, b) in (0i64..).zip(DIFFERENCE) {
            let apart = lag - q * n + p * m;
            let h = apart.abs() as f64;
            let alike = if apart == 0 { of_the_angle } else { 0.0 };
            let flicker = if apart == 0 { 0.0 } else { h * h * h.ln() / (4.0 * std::f64::consts::LN_2) };
            let terms = [alike, -0.5 * h, flicker, h * h * h / 12.0];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += a * b * term);
        }
    }
    sums
}

/// Allan variances from an averaging time on.
struct Points<'a> {
    octaves: &'a [usize],
    variances: &'a [f64],
    moments: &'a [Vec<Moments>],
    /// how many averaging times were left out
    from: usize,
}

/// The model at averaging times, whitened by the covariance of their estimates.
struct Fit {
    columns: DMatrix<f64>,
    right: DVector<f64>,
    values: [f64; TERMS],
    cost: f64,
    /// averaging times less terms that are not nothing
    spare: f64,
}

impl Points<'_> {
    fn fitted(&self) -> Option<Fit> {
        let columns = DMatrix::from_fn(self.octaves.len(), TERMS, |i, j| basis(self.octaves[i])[j]);
        // white noise, as large as it is at each time
        let size = |i: usize| self.variances[i] / columns[(i, WALK)];
        let mut fit = self.whitened(&columns, |i, j, moments| size(i) * size(j) * moments[WALK][WALK])?;
        for _ in 0..ROUNDS {
            let values = fit.values;
            if (&columns * DVector::from_column_slice(&values)).iter().any(|variance| *variance <= 0.0) {
                return None;
            }
            fit = self.whitened(&columns, |_, _, moments| {
                moments
                    .iter()
                    .zip(values)
                    .map(|(row, a)| a * row.iter().zip(values).map(|(m, b)| m * b).sum::<f64>())
                    .sum()
            })?;
        }
        Some(fit)
    }

    fn whitened(&self, columns: &DMatrix<f64>, covariance: impl Fn(usize, usize, &Moments) -> f64) -> Option<Fit> {
        let n = self.octaves.len();
        let entry = |i: usize, j: usize| covariance(i, j, &self.moments[self.from + i][self.from + j]);
        let factor = DMatrix::from_fn(n, n, entry).cholesky()?;
        let columns = factor.l_dirty().solve_lower_triangular(columns)?;
        let right = factor.l_dirty().solve_lower_triangular(&DVector::from_column_slice(self.variances))?;
        let (values, cost) = least(&columns, &right, None)?;
        let spare = n as f64 - values.iter().filter(|v| **v != 0.0).count() as f64;
        Some(Fit { columns, right, values, cost, spare })
    }
}

/// The values without a negative variance that leave least, and what they leave; N² where it is not given.
fn least(columns: &DMatrix<f64>, right: &DVector<f64>, walk: Option<f64>) -> Option<([f64; TERMS], f64)> {
    let given = walk.unwrap_or(0.0);
    let right = right - columns.column(WALK) * given;
    let choices = (0..1usize << (TERMS - 1)).filter(|bits| walk.is_none() || bits & 1 == 0);
    let subsets = choices
        .map(|bits| (0..TERMS).filter(|term| *term == 0 || bits >> (term - 1) & 1 == 1).collect::<Vec<usize>>())
        .filter(|terms| terms.len() <= right.len());
    let solutions = subsets.filter_map(|terms| {
        let chosen = columns.select_columns(&terms);
        let found = NormalEquations::of(chosen.tr_mul(&chosen), chosen.tr_mul(&right)).solve();
        let cost = (&right - chosen * DVector::from_column_slice(&found)).norm_squared();
        let mut values = [0.0; TERMS];
        values[WALK] = given;
        terms.iter().zip(&found).for_each(|(term, value)| values[*term] = *value);
        (values[WALK..].iter().all(|v| *v >= 0.0) && cost.is_finite()).then_some((values, cost))
    });
    solutions.min_by(|a, b| a.1.total_cmp(&b.1))
}

impl Fit {
    /// It leaves more than noise of the model does; where as many terms as times are there, nothing tells.
    fn is_rejected(&self) -> bool {
        ChiSquared::new(self.spare).is_ok_and(|chi| self.cost > chi.inverse_cdf(1.0 - BY_CHANCE))
    }

    /// N² and the ends of its 95 % interval; none where that reaches to nothing.
    fn profile(&self) -> Option<[f64; 3]> {
        let student = StudentsT::new(0.0, 1.0, self.spare).ok()?.inverse_cdf(0.975);
        let most = self.cost + student.powi(2) * (self.cost / self.spare).max(1.0);
        let holds = |square: f64| least(&self.columns, &self.right, Some(square)).is_some_and(|(_, cost)| cost <= most);
        let value = self.values[WALK];
        if value <= 0.0 || holds(0.0) {
            return None;
        }
        let between = |mut inside: f64, mut outside: f64| {
            for _ in 0..HALVINGS {
                let middle = 0.5 * (inside + outside);
                *(if holds(middle) { &mut inside } else { &mut outside }) = middle;
            }
            inside
        };
        let beyond =
            std::iter::successors(Some(2.0 * value), |square| Some(2.0 * square)).find(|square| !holds(*square))?;
        Some([between(value, 0.0), value, between(value, beyond)])
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::numerics::statistics::remembered;

    /// What the noise of a rate passes through before it is an angle; times in samples, a unit of white noise each.
    #[derive(Debug, Clone, Copy)]
    enum Passes {
        Nothing,
        /// a low-pass of first order of this time constant
        LowPass(f64),
        /// four of them
        FourthOrder(f64),
        /// the trapezoidal rule
        Trapezoids,
    }

    /// What else is in the angle.
    #[derive(Debug, Clone, Copy, Default)]
    struct Besides {
        /// Allan deviation of flicker of the rate
        flicker: f64,
        /// steps of a random walk of the rate
        walk: f64,
        /// last digit of the angle
        digit: f64,
    }

    fn low_passed(values: Vec<f64>, memory: f64) -> Vec<f64> {
        let share = 1.0 - (-1.0 / memory).exp();
        let mut state = 0.0;
        values
            .into_iter()
            .map(|v| {
                state += share * (v - state);
                state
            })
            .collect()
    }

    /// Flicker of an Allan deviation of about 1, as a sum of first-order processes an octave apart.
    fn flicker(rows: usize, seed: u64) -> Vec<f64> {
        let mut sum = vec![0.0; rows];
        for octave in 0..24u64 {
            let memory = 2f64.powf(octave as f64 - 1.0);
            let stays = (-1.0 / memory).exp();
            let noise = remembered(0.0, rows, seed ^ (octave + 77).wrapping_mul(0xA24B_AED4_963E_E407));
            let mut state = noise[0];
            for (sum, u) in sum.iter_mut().zip(noise) {
                *sum += state;
                state = stays * state + (1.0 - stays * stays).sqrt() * u;
            }
        }
        sum
    }

    fn angle(rows: usize, passes: Passes, besides: Besides, seed: u64) -> Vec<f64> {
        let seed = (seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let settles = 4000;
        let white = remembered(0.0, rows + settles, seed);
        let mut rate = match passes {
            Passes::Nothing => white,
            Passes::LowPass(memory) => low_passed(white, memory),
            Passes::FourthOrder(memory) => (0..4).fold(white, |v, _| low_passed(v, memory)),
            Passes::Trapezoids => white.iter().zip(&white[1..]).map(|(a, b)| 0.5 * (a + b)).collect(),
        };
        rate.drain(..rate.len() - rows);
        if besides.flicker > 0.0 {
            rate.iter_mut().zip(flicker(rows, seed ^ 1)).for_each(|(r, f)| *r += besides.flicker * f);
        }
        let mut wander = 0.0;
        for (r, u) in rate.iter_mut().zip(remembered(0.0, rows, seed ^ 2)) {
            wander += besides.walk * u;
            *r += wander;
        }
        let mut sum = 0.0;
        let angle = rate.into_iter().map(|r| {
            sum += r;
            sum
        });
        angle.map(|a| if besides.digit > 0.0 { (a / besides.digit).round() * besides.digit } else { a }).collect()
    }

    /// Of twenty recordings how many intervals hold a walk of 1, how many do not, and the mean value.
    fn of_twenty(rows: usize, passes: Passes, besides: Besides) -> (usize, usize, f64) {
        let (mut held, mut missed, mut sum) = (0, 0, 0.0);
        for seed in 0..20 {
            let Ok(read) = angle_random_walk(&[angle(rows, passes, besides, seed)], 1.0) else { continue };
            let [low, high] = read.value.ci95;
            *(if low <= 1.0 && 1.0 <= high { &mut held } else { &mut missed }) += 1;
            sum += read.value.value;
        }
        println!(
            "{rows} rows, {passes:?}, {besides:?}: {held} held, {missed} missed, mean {:.4}",
            sum / (held + missed) as f64
        );
        (held, missed, sum / (held + missed) as f64)
    }

    const ALONE: Besides = Besides { flicker: 0.0, walk: 0.0, digit: 0.0 };

    /// 60 s at 100 Hz and 2 h at 20 Hz.
    #[test]
    fn intervals_hold_the_walk_however_its_noise_was_filtered_and_whatever_is_beside_it() {
        let beside = [
            ALONE,
            Besides { flicker: 0.03, ..ALONE },
            Besides { walk: 6e-4, ..ALONE },
            Besides { flicker: 0.03, walk: 3e-4, ..ALONE },
            Besides { digit: 3.0, ..ALONE },
        ];
        // corners of 20, 5 and 1 Hz at 100 Hz
        let filters = [
            Passes::Nothing,
            Passes::Trapezoids,
            Passes::LowPass(0.8),
            Passes::LowPass(3.2),
            Passes::LowPass(16.0),
            Passes::FourthOrder(2.0),
        ];
        let mut wrong = Vec::new();
        for (passes, besides) in filters.iter().flat_map(|f| beside.iter().map(move |b| (*f, *b))) {
            // two hours tell apart what a minute does
            let rows: &[usize] = if besides.walk > 0.0 && besides.flicker > 0.0 { &[6000, 144_000] } else { &[6000] };
            for &rows in rows {
                let (held, missed, mean) = of_twenty(rows, passes, besides);
                // of a memory of 16 samples 6000 are too few
                let tells = rows > 6000 || !matches!(passes, Passes::LowPass(16.0));
                if missed > 2 || (tells && (held + missed < 14 || (mean - 1.0).abs() > 0.1)) {
                    wrong.push((rows, passes, besides, held, missed, mean));
                }
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }
}
