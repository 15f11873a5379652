//! Robust statistics of residuals that are mostly noise and partly spikes.

/// Ratio of standard deviation to median absolute deviation of a normal distribution.
const SIGMA_PER_MAD: f64 = 1.482_602_218_505_602;

/// Median; 0 of nothing. Reorders its argument.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Standard deviation about zero, from the median absolute value: spikes do not count.
pub(crate) fn robust_deviation(values: impl Iterator<Item = f64>) -> f64 {
    let mut magnitudes: Vec<f64> = values.map(f64::abs).filter(|v| v.is_finite()).collect();
    SIGMA_PER_MAD * median(&mut magnitudes)
}

/// Root of the mean square.
pub(crate) fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Standard deviation of the white part of a smooth series, from third differences: what varies over many samples
/// does not count, spikes do not either.
pub(crate) fn white_noise(series: &[f64]) -> f64 {
    // the third difference (1, −3, 3, −1) of white noise has 20 times its variance
    robust_deviation(series.windows(4).map(|w| w[0] - 3.0 * w[1] + 3.0 * w[2] - w[3])) / 20f64.sqrt()
}

/// Slope and intercept of the least-squares line.
pub(crate) fn line(x: &[f64], y: &[f64]) -> (f64, f64) {
    let n = x.len().min(y.len()) as f64;
    if n < 1.0 {
        return (0.0, 0.0);
    }
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (mut sxx, mut sxy) = (0.0, 0.0);
    for (a, b) in x.iter().zip(y) {
        sxx += (a - mx) * (a - mx);
        sxy += (a - mx) * (b - my);
    }
    let slope = if sxx > 0.0 { sxy / sxx } else { 0.0 };
    (slope, my - slope * mx)
}

/// Correlation of two series; 0 where one stands still.
pub(crate) fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len().min(y.len()).max(1) as f64;
    let (mx, my) = x.iter().zip(y).fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let moments = x.iter().zip(y).map(|(x, y)| (x - mx, y - my));
    let (xx, yy, xy) = moments.fold((0.0, 0.0, 0.0), |(xx, yy, xy), (x, y)| (xx + x * x, yy + y * y, xy + x * y));
    if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
}

/// Mean direction of angles of a period.
pub(crate) fn circular_mean(angles: impl Iterator<Item = f64>, period: f64) -> f64 {
    let k = std::f64::consts::TAU / period;
    let (mut s, mut c) = (0.0, 0.0);
    for a in angles {
        let (sin, cos) = (k * a).sin_cos();
        s += sin;
        c += cos;
    }
    s.atan2(c) / k
}

/// Largest less smallest.
pub(crate) fn span(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
    if high > low { high - low } else { 0.0 }
}

/// Share of the values on either side that [`inner_range`] leaves out: spikes stand there.
const OUTERMOST: f64 = 0.005;

/// Smallest and largest value without the outermost; none of no values.
pub(crate) fn inner_range(values: &[f64]) -> Option<[f64; 2]> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of the values")]
    let out = (OUTERMOST * values.len() as f64) as usize;
    let last = values.len().checked_sub(1)?;
    Some([sorted[out], sorted[last - out]])
}

/// Noise for tests: a first-order autoregression of normal values with a deviation of one, from a generator of Lehmer's.
#[cfg(test)]
pub(crate) fn remembered(memory: f64, count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.max(1);
    let mut last = 0.0;
    (0..count)
        .map(|_| {
            let sum: f64 = (0..12)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 33) as f64 / (1u64 << 31) as f64
                })
                .sum();
            last = memory * last + sum - 6.0;
            last
        })
        .collect()
}
