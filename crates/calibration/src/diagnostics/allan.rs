//! Overlapping Allan deviation of a rate, from the angle that it sums up to (IEEE Std 952, annex C; NIST SP 1065,
//! sections 5.2.4 and 5.4): how far an instrument at rest wanders, over which time.
//!
//! $$σ^2(τ) = \frac{1}{2τ^2 M} \sum_k (θ_{k+2m} - 2θ_{k+m} + θ_k)^2, \quad τ = m τ_0$$
//!
//! A constant rate leaves nothing in it. A stretch ends at a gap, and no sum reaches across.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Averaging times a decade.
const TIMES_A_DECADE: f64 = 8.0;
/// Share of the longest stretch that the longest averaging time takes: beyond it, too few differences are independent.
const LONGEST_SHARE: f64 = 0.25;
/// Angles below which a stretch tells nothing.
const SHORTEST: usize = 9;
/// Probabilities between which a 95 % interval lies.
const INTERVAL: [f64; 2] = [0.975, 0.025];
/// σ of flicker noise is flat at this many times the bias instability B: √(2 ln 2/π).
pub const FLICKER: f64 = 0.664_283_115_0;

/// σ at one averaging time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// averaging time, s
    pub tau_s: f64,
    /// σ, in the unit of the angle per s
    pub deviation: f64,
    /// its 95 % interval
    pub ci95: [f64; 2],
    /// equivalent degrees of freedom
    pub freedom: f64,
}

/// Overlapping Allan deviation of stretches of an angle, each sampled every `interval_s`, at these averaging times in
/// samples. Domain: `interval_s` > 0, `multiples` ≥ 1; a time that no stretch is twice as long as has no point.
#[must_use]
pub fn overlapping(stretches: &[Vec<f64>], interval_s: f64, multiples: &[usize]) -> Vec<Point> {
    let at = |&m: &usize| {
        let tau_s = m as f64 * interval_s;
        let (mut sum, mut count, mut freedom) = (0.0, 0usize, 0.0);
        for theta in stretches.iter().filter(|s| s.len() > 2 * m) {
            sum +=
                (2 * m..theta.len()).map(|k| (theta[k] - 2.0 * theta[k - m] + theta[k - 2 * m]).powi(2)).sum::<f64>();
            count += theta.len() - 2 * m;
            freedom += degrees_of_freedom(theta.len() as f64, m as f64);
        }
        let variance = sum / (2.0 * tau_s * tau_s * count as f64);
        let deviation = variance.sqrt();
        (count > 0).then(|| Point { tau_s, deviation, ci95: interval(variance, freedom), freedom })
    };
    multiples.iter().filter_map(at).collect()
}

/// Averaging times for these stretches, in samples: eight a decade up to a quarter of the longest.
#[must_use]
pub fn multiples(stretches: &[Vec<f64>]) -> Vec<usize> {
    let longest = stretches.iter().map(Vec::len).max().unwrap_or(0);
    if longest < SHORTEST {
        return Vec::new();
    }
    let most = (longest - 1) as f64 * LONGEST_SHARE;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of samples")]
    let mut out: Vec<usize> = (0..)
        .map(|i| 10f64.powf(f64::from(i) / TIMES_A_DECADE))
        .take_while(|m| *m <= most)
        .map(|m| m.round() as usize)
        .collect();
    out.dedup();
    out
}

/// The least of the equivalent degrees of freedom for white, flicker and random-walk noise of the rate (NIST SP 1065,
/// table 5): which of them rules at a time is what is asked for, so that none is presumed.
fn degrees_of_freedom(n: f64, m: f64) -> f64 {
    let white = (1.5 * (n - 1.0) / m - 2.0 * (n - 2.0) / n) * 4.0 * m * m / (4.0 * m * m + 5.0);
    let flicker =
        if m < 2.0 { 2.0 * (n - 2.0) / (2.3 * n - 4.9) * (n - 2.0) } else { 5.0 * n * n / (4.0 * m * (n + 3.0 * m)) };
    let walk = (n - 2.0) / m * ((n - 1.0).powi(2) - 3.0 * m * (n - 1.0) + 4.0 * m * m) / (n - 3.0).powi(2);
    white.min(flicker).min(walk).max(1.0)
}

fn interval(variance: f64, freedom: f64) -> [f64; 2] {
    let Ok(chi) = ChiSquared::new(freedom) else { return [f64::NAN; 2] };
    INTERVAL.map(|p| (variance * freedom / chi.inverse_cdf(p)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The 1000 numbers of NIST SP 1065, section 12.4, summed to a phase.
    fn nist() -> Vec<f64> {
        let mut n: u64 = 1_234_567_890;
        let mut phase = vec![0.0];
        for _ in 0..1000 {
            phase.push(phase[phase.len() - 1] + n as f64 / 2_147_483_647.0);
            n = 16_807 * n % 2_147_483_647;
        }
        phase
    }

    #[test]
    fn the_test_suite_of_nist_has_its_published_deviations() {
        let points = overlapping(&[nist()], 1.0, &[1, 10, 100]);
        for (p, published) in points.iter().zip([2.922_319e-1, 9.159_953e-2, 3.241_343e-2]) {
            assert!((p.deviation / published - 1.0).abs() < 2e-7, "{} s: {}", p.tau_s, p.deviation);
            assert!(p.ci95[0] < p.deviation && p.deviation < p.ci95[1], "{p:?}");
        }
    }

    #[test]
    fn a_constant_rate_leaves_nothing_and_a_ramp_its_closed_form() {
        let t: Vec<f64> = (0..2000).map(|i| f64::from(i) * 0.25).collect();
        let (steady, ramp): (Vec<f64>, Vec<f64>) = t.iter().map(|t| (3.0 + 7.0 * t, 0.5 * 0.01 * t * t)).unzip();
        for p in overlapping(&[steady], 0.25, &[1, 7, 200]) {
            assert!(p.deviation < 1e-11, "{p:?}");
        }
        // σ = R τ/√2 for a rate that grows by R a second
        for p in overlapping(&[ramp], 0.25, &[1, 7, 200]) {
            let wanted = 0.01 * p.tau_s / std::f64::consts::SQRT_2;
            assert!((p.deviation / wanted - 1.0).abs() < 1e-8, "{p:?} {wanted}");
        }
    }

    #[test]
    fn no_difference_reaches_across_a_gap() {
        let stretch = nist();
        let moved: Vec<f64> = stretch.iter().map(|a| a + 1e6).collect();
        let one = overlapping(std::slice::from_ref(&stretch), 1.0, &[1, 10]);
        let two = overlapping(&[stretch, moved], 1.0, &[1, 10]);
        for (a, b) in one.iter().zip(&two) {
            assert!((a.deviation / b.deviation - 1.0).abs() < 1e-6 && b.freedom > 1.9 * a.freedom);
        }
    }

    #[test]
    fn averaging_times_grow_to_a_quarter_of_the_stretch() {
        let of = |n: usize| multiples(&[vec![0.0; n]]);
        assert!(of(8).is_empty());
        let m = of(1001);
        assert_eq!((m[0], m[1]), (1, 2));
        assert!(m.windows(2).all(|w| w[0] < w[1]) && *m.last().unwrap_or(&0) <= 250);
    }
}
