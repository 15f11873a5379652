//! What the noise of a channel remembers: an autoregression, and the residual that is left of it white.

/// Orders that are tried.
const MOST_ORDERS: usize = 6;

/// An autoregression with those of lower order, which serve at the beginning of a run.
#[derive(Debug, Clone)]
pub(crate) struct Autoregression {
    /// coefficients of orders 0, 1, …, and the deviation of what each leaves
    orders: Vec<(Vec<f64>, f64)>,
}

impl Autoregression {
    /// White noise of this deviation.
    pub(crate) fn white(deviation: f64) -> Self {
        Self { orders: vec![(Vec::new(), deviation.max(f64::MIN_POSITIVE))] }
    }

    /// The autoregression of these runs, of the order that Schwarz's criterion prefers.
    pub(crate) fn of(runs: &[Vec<f64>]) -> Self {
        let n: usize = runs.iter().map(Vec::len).sum();
        let products = |lag: usize| -> f64 {
            runs.iter().map(|r| r.iter().zip(r.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>()).sum()
        };
        let r: Vec<f64> = (0..=MOST_ORDERS).map(|lag| products(lag) / n.max(1) as f64).collect();
        if r[0].is_nan() || r[0] <= 0.0 {
            return Self::white(f64::MIN_POSITIVE);
        }
        // Levinson and Durbin
        let mut orders = vec![(Vec::new(), r[0].sqrt())];
        let (mut coefficients, mut variance): (Vec<f64>, f64) = (Vec::new(), r[0]);
        let (mut best, mut order) = (n as f64 * variance.ln(), 0);
        for p in 1..=MOST_ORDERS.min(n / 20) {
            let known: f64 = coefficients.iter().enumerate().map(|(k, a)| a * r[p - 1 - k]).sum();
            let reflection = (r[p] - known) / variance;
            let before = coefficients.clone();
            for (a, b) in coefficients.iter_mut().zip(before.iter().rev()) {
                *a -= reflection * b;
            }
            coefficients.push(reflection);
            variance *= 1.0 - reflection * reflection;
            if variance.is_nan() || variance <= 1e-12 * r[0] {
                break;
            }
            orders.push((coefficients.clone(), variance.sqrt()));
            let price = n as f64 * variance.ln() + p as f64 * (n as f64).ln();
            if price < best {
                (best, order) = (price, p);
            }
        }
        orders.truncate(order + 1);
        Self { orders }
    }

    /// What cannot be foreseen of each value, in units of its deviation.
    pub(crate) fn whitened(&self, values: &[f64]) -> Vec<f64> {
        (0..values.len())
            .map(|i| {
                let (coefficients, deviation) = &self.orders[i.min(self.orders.len() - 1)];
                let foreseen: f64 = coefficients.iter().zip(values[..i].iter().rev()).map(|(a, v)| a * v).sum();
                (values[i] - foreseen) / deviation
            })
            .collect()
    }

    /// Σ ln of the deviations of a run of `n` values.
    pub(crate) fn log_volume(&self, n: usize) -> f64 {
        (0..n).map(|i| self.orders[i.min(self.orders.len() - 1)].1.ln()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::statistics::remembered;

    #[test]
    fn what_is_left_of_remembered_noise_is_white_and_of_size_one() {
        for memory in [0.0, 0.6, 0.95] {
            let noise = remembered(memory, 4000, 7);
            let ar = Autoregression::of(std::slice::from_ref(&noise));
            let white = ar.whitened(&noise);
            let square = white.iter().map(|w| w * w).sum::<f64>() / white.len() as f64;
            let product: f64 = white.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / white.len() as f64;
            assert!((square - 1.0).abs() < 0.05, "{memory}: {square}");
            assert!(product.abs() < 0.05, "{memory}: {product}");
            assert!(ar.log_volume(4000).abs() < 0.02 * 4000.0, "{memory}: {}", ar.log_volume(4000));
        }
    }
}
