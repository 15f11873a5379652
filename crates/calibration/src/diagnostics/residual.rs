//! What is in a residual: harmonics of the pattern and of the table, lines in time, memory from sample to sample.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};
use realfft::RealFftPlanner;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::diagnostics::evaluate::Evaluation;
use crate::estimation::residuals::Residual;
use crate::facts::{Follows, Harmonic};
use crate::numerics::angles::phase;
use crate::numerics::statistics::median;

impl Residual {
    /// The angle that a harmonic follows, per sample.
    pub(crate) fn base(&self, of: Follows) -> &[f64] {
        match of {
            Follows::Pattern => &self.direction,
            Follows::Table => &self.table,
        }
    }
}

/// Cross products of a residual with the two phases of one line.
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    cc: f64,
    cs: f64,
    ss: f64,
    rc: f64,
    rs: f64,
}

impl Line {
    #[inline]
    fn add(&mut self, residual: f64, sin: f64, cos: f64) {
        self.cc += cos * cos;
        self.cs += cos * sin;
        self.ss += sin * sin;
        self.rc += residual * cos;
        self.rs += residual * sin;
    }

    /// What the line takes out of the sum of squares.
    fn power(&self) -> f64 {
        let determinant = self.cc * self.ss - self.cs * self.cs;
        if determinant <= 1e-9 * (self.cc + self.ss).powi(2) {
            return 0.0;
        }
        (self.rc * self.rc * self.ss - 2.0 * self.rc * self.rs * self.cs + self.rs * self.rs * self.cc) / determinant
    }
}

/// Powers of the harmonics 1 to `most` of the pattern or the table, strongest first, as (n, power), where the harmonic
/// grows with the precession rate as `scaling` says.
pub(crate) fn strongest_harmonics(
    evaluation: &Evaluation,
    of: Follows,
    most: u32,
    scaling: impl Fn(f64) -> f64,
) -> Vec<(u32, f64)> {
    let mut lines = vec![Line::default(); most as usize];
    for (s, kept) in evaluation.segments.iter().zip(&evaluation.kept) {
        for i in (0..s.angle.len()).filter(|&i| kept[i]) {
            // each harmonic from the one before, by the addition theorem
            let (sin, cos) = s.base(of)[i].sin_cos();
            let size = scaling(s.precession[i]);
            let (mut sin_n, mut cos_n) = (size * sin, size * cos);
            for line in &mut lines {
                line.add(s.angle[i], sin_n, cos_n);
                (sin_n, cos_n) = (sin_n * cos + cos_n * sin, cos_n * cos - sin_n * sin);
            }
        }
    }
    let mut powers: Vec<(u32, f64)> = (1..).zip(lines.iter().map(Line::power)).collect();
    powers.sort_by(|a, b| b.1.total_cmp(&a.1));
    powers
}

/// The highest harmonic of the table or pattern that the sampling resolves.
pub(crate) fn resolved_harmonics(evaluation: &Evaluation, of: Follows, limit: u32) -> u32 {
    let mut steps: Vec<f64> = evaluation
        .segments
        .iter()
        .flat_map(|s| {
            s.base(of)
                .windows(2)
                .take(2000)
                .map(|w| crate::numerics::angles::wrapped(w[1] - w[0], std::f64::consts::TAU).abs())
        })
        .filter(|d| *d > 1e-9)
        .collect();
    let step = median(&mut steps);
    if step <= 0.0 {
        return 0;
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive and bounded by the limit")]
    let resolved = (0.8 * std::f64::consts::PI / step).min(f64::from(limit)) as u32;
    resolved
}

/// Samples of a segment that refine a frequency.
const REFINED_SAMPLES: usize = 2_000;
/// Parabolas through the top of a line, one within the other, and how much narrower the next is: the last is a fiftieth of the
/// line's width, which is as near as a fit's prior has it.
const PARABOLAS: usize = 3;
const NARROWER: f64 = 0.2;
/// A line between two points of the periodogram has at most this many times the power that it has there: at a quarter of
/// its width off the top sinc² is 0.81.
const TOP_OVER_SIDE: f64 = 1.5;

/// Along what a line is periodic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Along {
    /// time; lines in Hz
    Time,
    /// the table angle; lines in cycles per turn
    Table,
}

impl Along {
    fn of(self, s: &Residual, i: usize) -> f64 {
        match self {
            Self::Time => s.t_s[i],
            Self::Table => s.table[i] / std::f64::consts::TAU,
        }
    }

    /// The usual step between two samples of a segment.
    fn step(self, s: &Residual) -> f64 {
        let mut steps: Vec<f64> =
            (1..s.t_s.len().min(2000)).map(|i| (self.of(s, i) - self.of(s, i - 1)).abs()).collect();
        median(&mut steps)
    }
}

/// How far the longest segment goes.
pub(crate) fn longest(evaluation: &Evaluation, along: Along) -> f64 {
    evaluation.segments.iter().map(|s| along.step(s) * s.angle.len() as f64).fold(0.0, f64::max)
}

/// Steps that differ by less than this share count as one.
const SAME_STEP: f64 = 0.01;

/// The strongest line and its power, if that exceeds `least`: from the periodogram of the segments that are sampled as the
/// longest is, refined over all.
pub(crate) fn strongest_line(evaluation: &Evaluation, along: Along, least: f64) -> Option<(f64, f64)> {
    const LARGEST: usize = 1 << 17;
    let steps: Vec<f64> = evaluation.segments.iter().map(|s| along.step(s)).collect();
    let range = |number: usize| steps[number] * evaluation.segments[number].angle.len() as f64;
    let longest = (0..steps.len()).max_by(|a, b| range(*a).total_cmp(&range(*b)))?;
    let interval = steps[longest];
    let alike = |number: usize| (steps[number] - interval).abs() < SAME_STEP * interval;
    let samples = (0..steps.len())
        .filter(|n| alike(*n))
        .map(|n| evaluation.segments[n].angle.len().min(LARGEST))
        .max()
        .filter(|samples| *samples >= 32 && interval > 0.0)?;
    let size = (2 * samples).next_power_of_two();
    let mut planner = RealFftPlanner::<f64>::new();
    let transform = planner.plan_fft_forward(size);
    let mut power = vec![0.0; size / 2 + 1];
    let mut spectrum = transform.make_output_vec();
    for (_, (s, kept)) in
        evaluation.segments.iter().zip(&evaluation.kept).enumerate().filter(|(number, _)| alike(*number))
    {
        let mut buffer = transform.make_input_vec();
        for ((b, a), k) in buffer.iter_mut().zip(&s.angle).zip(kept) {
            *b = if *k { *a } else { 0.0 };
        }
        transform.process(&mut buffer, &mut spectrum).ok()?;
        let n = s.angle.len().max(1) as f64;
        for (p, c) in power.iter_mut().zip(&spectrum) {
            *p += c.norm_sqr() / n;
        }
    }
    let df = 1.0 / (size as f64 * interval);
    let lowest = (2.0 / (samples as f64 * interval) / df).ceil().max(1.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive index")]
    let from = lowest as usize;
    let peak = (from..power.len().saturating_sub(1)).max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
    // refine on the whole set with a common phase
    let at = |f: f64| {
        let mut line = Line::default();
        for (s, kept) in evaluation.segments.iter().zip(&evaluation.kept) {
            let stride = (s.angle.len() / REFINED_SAMPLES).max(1);
            for i in (0..s.angle.len()).step_by(stride).filter(|&i| kept[i]) {
                let (sin, cos) = (std::f64::consts::TAU * f * along.of(s, i)).sin_cos();
                line.add(s.angle[i] * (stride as f64).sqrt(), sin, cos);
            }
        }
        line.power()
    };
    let mut best = (peak as f64 * df, at(peak as f64 * df));
    if TOP_OVER_SIDE * best.1 < least {
        return None;
    }
    let mut step = 0.5 * df;
    for _ in 0..PARABOLAS {
        let [below, above] = [best.0 - step, best.0 + step].map(|f| (f, if f > 0.0 { at(f) } else { 0.0 }));
        let curvature = below.1 - 2.0 * best.1 + above.1;
        let higher = [below, above].into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|side| side.1 > best.1);
        if let Some(higher) = higher {
            // the top lies further out
            best = higher;
            continue;
        }
        if curvature < 0.0 {
            let top = best.0 + 0.5 * step * (below.1 - above.1) / curvature;
            best = [best, (top, at(top))].into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        }
        step *= NARROWER;
    }
    Some(best).filter(|line| line.1 > least)
}

/// What a cubic in time, one per segment, takes out of the sum of squares: a drift that is no line.
pub(crate) fn drift_power(evaluation: &Evaluation) -> f64 {
    let of_segment = |s: &Residual, kept: &[bool]| {
        let (Some(first), Some(last)) = (s.t_s.first(), s.t_s.last()) else { return 0.0 };
        let (middle, half) = (0.5 * (first + last), (0.5 * (last - first)).max(f64::MIN_POSITIVE));
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for i in (0..s.angle.len()).filter(|&i| kept[i]) {
            let x = (s.t_s[i] - middle) / half;
            let row = Vector4::new(1.0, x, x * x, x * x * x);
            normal += row * row.transpose();
            right += row * s.angle[i];
        }
        normal.cholesky().map_or(0.0, |c| right.dot(&c.solve(&right)))
    };
    evaluation.segments.iter().zip(&evaluation.kept).map(|(s, kept)| of_segment(s, kept)).sum()
}

/// Variance inflation of a harmonic by the others beyond which they are not told apart, as where the angle hardly turned
/// (Marquardt 1970: ten).
const LARGEST_VARIANCE_INFLATION: f64 = 10.0;

/// Amplitudes of harmonics 1 to `most`, or as many as the angles tell apart, fitted together, with 95 % intervals that
/// allow for `inflation` of the variance by autocorrelation.
pub(crate) fn harmonics(evaluation: &Evaluation, of: Follows, most: u32, inflation: f64) -> Vec<Harmonic> {
    let n = 2 * most as usize;
    if n == 0 {
        return Vec::new();
    }
    let mut right = DVector::<f64>::zeros(n);
    let (mut count, mut squares) = (0usize, 0.0);
    // Σ cos kθ and Σ sin kθ up to twice the highest harmonic: products of two harmonics are sums of these
    let mut sums = vec![(0.0, 0.0); n + 1];
    for (s, kept) in evaluation.segments.iter().zip(&evaluation.kept) {
        for i in (0..s.angle.len()).filter(|&i| kept[i]) {
            let (sin, cos) = s.base(of)[i].sin_cos();
            let (mut sin_n, mut cos_n) = (0.0, 1.0);
            for (k, (sum_cos, sum_sin)) in sums.iter_mut().enumerate() {
                *sum_cos += cos_n;
                *sum_sin += sin_n;
                if (1..=most as usize).contains(&k) {
                    right[2 * k - 2] += cos_n * s.angle[i];
                    right[2 * k - 1] += sin_n * s.angle[i];
                }
                (sin_n, cos_n) = (sin_n * cos + cos_n * sin, cos_n * cos - sin_n * sin);
            }
            count += 1;
            squares += s.angle[i] * s.angle[i];
        }
    }
    let normal = DMatrix::from_fn(n, n, |row, column| {
        let (a, b) = (row / 2 + 1, column / 2 + 1);
        let ((cos_less, sin_less), (cos_more, sin_more)) = (sums[a.abs_diff(b)], sums[a + b]);
        let sin_less = if a < b { -sin_less } else { sin_less };
        0.5 * match (row % 2, column % 2) {
            (0, 0) => cos_less + cos_more,
            (1, 1) => cos_less - cos_more,
            // cos aθ sin bθ, sin aθ cos bθ
            (0, _) => sin_more - sin_less,
            _ => sin_more + sin_less,
        }
    });
    let Some(inverse) = told_apart(&normal) else { return Vec::new() };
    let n = inverse.nrows();
    let right = right.rows(0, n);
    let solution = &inverse * right;
    let rest = (squares - solution.dot(&right)).max(0.0) / (count.saturating_sub(n)).max(1) as f64;
    (0..n / 2)
        .map(|k| {
            let (c, s) = (solution[2 * k], solution[2 * k + 1]);
            let variance = inverse[(2 * k, 2 * k)].max(inverse[(2 * k + 1, 2 * k + 1)]);
            #[allow(clippy::cast_possible_truncation, reason = "no more than were asked for")]
            let n = k as u32 + 1;
            Harmonic {
                of,
                n,
                amplitude_deg: c.hypot(s).to_degrees(),
                ci95_deg: 1.96 * (variance * rest * inflation).sqrt().to_degrees(),
                // c cos nθ + s sin nθ = A cos(nθ + phase) with c = A cos phase, s = −A sin phase
                phase_deg: phase(c, -s).to_degrees(),
            }
        })
        .collect()
}

/// The inverse of the normal equations of as many harmonics as the angles tell apart; `None` where not even the first is.
fn told_apart(normal: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    (1..=normal.nrows() / 2).rev().find_map(|most| {
        let normal = normal.view((0, 0), (2 * most, 2 * most));
        let inverse = normal.clone_owned().cholesky()?.inverse();
        let inflated = |i: usize| normal[(i, i)] * inverse[(i, i)];
        (0..2 * most).all(|i| inflated(i) <= LARGEST_VARIANCE_INFLATION).then_some(inverse)
    })
}

/// Harmonics that are reported.
const REPORTED_HARMONICS: u32 = 8;

/// The first harmonics of the pattern, with intervals that allow for memory.
pub(crate) fn pattern_harmonics(evaluation: &Evaluation) -> Vec<Harmonic> {
    reported_harmonics(evaluation, Follows::Pattern, evaluation)
}

/// The first harmonics of the pattern or the table, with intervals that allow for the memory of `noise`.
pub(crate) fn reported_harmonics(evaluation: &Evaluation, of: Follows, noise: &Evaluation) -> Vec<Harmonic> {
    let inflated = inflation(&autocorrelation(noise, WHITENESS_LAGS), noise.errors().count());
    harmonics(evaluation, of, resolved_harmonics(evaluation, of, REPORTED_HARMONICS), inflated)
}

/// Autocorrelation of the errors at lags 0 to `most`, pooled over segments.
pub(crate) fn autocorrelation(evaluation: &Evaluation, most: usize) -> Vec<f64> {
    let mut sums = vec![0.0; most + 1];
    for (s, kept) in evaluation.segments.iter().zip(&evaluation.kept) {
        // spikes count for nothing
        let left: Vec<f64> = s.angle.iter().zip(kept).map(|(a, keep)| if *keep { *a } else { 0.0 }).collect();
        for (lag, sum) in sums.iter_mut().enumerate().take(left.len()) {
            *sum += left[lag..].iter().zip(&left).map(|(a, b)| a * b).sum::<f64>();
        }
    }
    let zero = sums[0].max(f64::MIN_POSITIVE);
    sums.into_iter().map(|s| s / zero).collect()
}

/// Lags of the whiteness test, and its significance.
pub(crate) const WHITENESS_LAGS: usize = 20;
pub(crate) const WHITENESS_LEVEL: f64 = 0.01;

/// The autocorrelation of `count` samples of white noise stays within ± this at 99 % of the lags.
pub(crate) fn white_band(count: usize) -> f64 {
    2.576 / (count.max(1) as f64).sqrt()
}

/// Ljung–Box: the probability of so much autocorrelation in `count` samples of white noise.
pub(crate) fn ljung_box(correlation: &[f64], count: usize) -> f64 {
    let n = count as f64;
    let q: f64 = n
        * (n + 2.0)
        * correlation.iter().enumerate().skip(1).map(|(lag, r)| r * r / (n - lag as f64).max(1.0)).sum::<f64>();
    ChiSquared::new((correlation.len() - 1).max(1) as f64).map_or(0.0, |d| d.sf(q))
}

/// By how much autocorrelation inflates the variance of a slowly varying estimate: 1 + 2Σρ over the leading positive
/// lags, at least 1.
pub(crate) fn inflation(correlation: &[f64], count: usize) -> f64 {
    let band = 1.96 / (count.max(1) as f64).sqrt();
    1.0 + 2.0 * correlation.iter().skip(1).take_while(|r| **r > band).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An evaluation of `error` at pattern angles that are spread unevenly over a turn and a half.
    fn evaluation(error: impl Fn(f64) -> f64) -> Evaluation {
        let direction: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.023 + 0.4 * (f64::from(i) * 0.7).sin()).collect();
        let angle: Vec<f64> = direction.iter().map(|d| error(*d)).collect();
        let n = angle.len();
        let t_s = (0..400).map(|i| f64::from(i) * 0.01).collect();
        let s = Residual { samples: n, t_s, direction, angle, ..Residual::default() };
        Evaluation { segments: vec![s], kept: vec![vec![true; n]] }
    }

    #[test]
    fn harmonics_fitted_together_are_told_apart_where_angles_are_uneven() {
        let e = evaluation(|d| 3e-3 * (2.0 * d + 0.5).cos() + 1e-3 * (3.0 * d - 1.2).cos() + 2e-4 * (8.0 * d).sin());
        let found = harmonics(&e, Follows::Pattern, 8, 1.0);
        for (n, amplitude, phase) in [(2, 3e-3, 0.5), (3, 1e-3, -1.2), (8, 2e-4, -std::f64::consts::FRAC_PI_2)] {
            let h = &found[n - 1];
            assert!((h.amplitude_deg.to_radians() - amplitude).abs() < 1e-12, "{h:?}");
            assert!((h.phase_deg.to_radians() - phase).abs() < 1e-9, "{h:?}");
        }
        assert!([0, 3, 4, 5, 6].into_iter().all(|at| found[at].amplitude_deg < 1e-9), "{found:?}");
    }

    #[test]
    fn a_harmonic_that_angles_do_not_tell_from_the_others_is_none() {
        let mut e = evaluation(|d| 3e-3 * (2.0 * d + 0.5).cos());
        assert_eq!(harmonics(&e, Follows::Pattern, 8, 1.0).len(), 8);
        // a sixth of a turn
        e.segments[0].direction.iter_mut().for_each(|d| *d /= 6.0);
        assert!(harmonics(&e, Follows::Pattern, 8, 1.0).len() < 8);
        assert!(harmonics(&e, Follows::Pattern, 8, 1.0).iter().all(|h| h.amplitude_deg < 1.0));
        e.segments[0].direction.fill(0.3);
        assert!(harmonics(&e, Follows::Pattern, 8, 1.0).is_empty());
    }

    #[test]
    fn a_line_between_two_points_of_the_periodogram_is_placed_to_a_thousandth_of_its_width() {
        for frequency in [3.137, 7.012, 12.3456] {
            let mut e = evaluation(|_| 0.0);
            let s = &mut e.segments[0];
            s.angle = s.t_s.iter().map(|t| 1e-3 * (std::f64::consts::TAU * frequency * t + 0.3).cos()).collect();
            let (found, power) = strongest_line(&e, Along::Time, 0.0).expect("there is a line");
            assert!((found - frequency).abs() < 1e-3 / 4.0, "{found} for {frequency}");
            assert!((power / (0.5 * 1e-6 * 400.0) - 1.0).abs() < 1e-2, "{power}");
            assert!(strongest_line(&e, Along::Time, 2.0 * power).is_none());
        }
    }
}
