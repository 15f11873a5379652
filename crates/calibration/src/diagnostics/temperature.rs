//! How gain, bias and readout go with the temperature of the runs: straight lines through what each run tells by itself, with
//! intervals from how the runs scatter about them.
//!
//! $$Δω_i = b + b_T τ_i + (c + k_T τ_i) Ω_i, \\quad τ_i = T_i - \\bar T$$
//!
//! where Δω is the precession of a run at a steady rate Ω beyond what the gain of all runs says. Such a run cannot tell its
//! gain from its bias; runs at two rates or more, at several temperatures each, do. Of runs that turn both ways each tells
//! the two apart, and each has a line of its own. Nothing is said where the temperatures hardly differ, or where they went
//! with the rate: a line would be there whatever the instrument is.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::facts::{Estimate, RunReport, Temperature};

/// Temperatures within a span of this tell nothing, K: engineering choice, ten times the accuracy of a usual sensor of them.
pub(crate) const LEAST_SPAN_K: f64 = 2.0;
/// Where temperature and rate are correlated so closely, what one does is not told from what the other does.
const TOGETHER: f64 = 0.9;
/// The share of the other columns in a column below which it is one of its own.
const LEAST_OWN: f64 = 1e-3;

/// What one run tells.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Seen {
    /// mean temperature, °C
    pub(crate) temp_c: f64,
    /// mean rate, where the run turns one way only, deg/s
    pub(crate) steady_dps: Option<f64>,
    /// angular gain
    pub(crate) gain: Option<f64>,
    /// bias, deg/s
    pub(crate) bias_dps: Option<f64>,
    /// gain of Y over X
    pub(crate) ratio: Option<f64>,
}

impl Seen {
    /// What a run's report tells beside its temperature.
    pub(crate) fn of(run: &RunReport, steady_dps: Option<f64>, temp_c: f64) -> Self {
        let [gain, bias_dps] = [run.angular_gain, run.bias_dps].map(|e| e.map(|e| e.value));
        Self { temp_c, steady_dps, gain, bias_dps, ratio: run.detection_gain_ratio }
    }
}

/// The lines through what runs tell; `sense` is +1 where the angle counts with the input. `None` without two temperatures.
pub(crate) fn temperature(seen: &[Seen], sense: f64) -> Option<Temperature> {
    let told: Vec<Seen> = seen.iter().copied().filter(|s| s.temp_c.is_finite()).collect();
    let of = |pick: fn(f64, f64) -> f64, from: f64| told.iter().map(|s| s.temp_c).fold(from, pick);
    let range_c = [of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY)];
    let mut out = Temperature {
        runs: told.len(),
        range_c,
        angular_gain_per_k: None,
        bias_dps_per_k: None,
        detection_gain_ratio_per_k: None,
        reason: None,
    };
    if told.len() < 2 {
        return None;
    }
    if range_c[1] - range_c[0] < LEAST_SPAN_K {
        out.reason = Some(format!(
            "the runs' temperatures lie within {:.2} K; {LEAST_SPAN_K:.0} K and more tell a slope",
            range_c[1] - range_c[0]
        ));
        return Some(out);
    }
    let mean = told.iter().map(|s| s.temp_c).sum::<f64>() / told.len() as f64;
    let line = |value: fn(&Seen) -> Option<f64>, of: &dyn Fn(&Seen) -> bool| {
        let rows = told.iter().filter(|s| of(s)).filter_map(|s| Some((vec![1.0, s.temp_c - mean], value(s)?)));
        slopes(&rows.collect::<Vec<_>>()).map(|s| s[1])
    };
    out.detection_gain_ratio_per_k = line(|s| s.ratio, &|_| true);
    let steady: Vec<(f64, f64, f64)> =
        told.iter().filter_map(|s| Some((s.steady_dps?, s.temp_c, s.bias_dps.filter(|_| s.gain.is_some())?))).collect();
    if steady.is_empty() {
        out.angular_gain_per_k = line(|s| s.gain, &|_| true);
        out.bias_dps_per_k = line(|s| s.bias_dps, &|_| true);
        if out.angular_gain_per_k.is_none() && out.bias_dps_per_k.is_none() && out.detection_gain_ratio_per_k.is_none()
        {
            out.reason = Some("fewer than three runs with a temperature tell a line and its interval".into());
        }
        return Some(out);
    }
    if let Some(with) = together(&steady) {
        out.reason = Some(format!(
            "temperature and {with} went together from run to run; runs at one rate at several temperatures tell them apart"
        ));
        return Some(out);
    }
    let rows: Vec<(Vec<f64>, f64)> = steady
        .iter()
        .map(|(rate, temp_c, drift)| (vec![1.0, *rate, temp_c - mean, rate * (temp_c - mean)], *drift))
        .collect();
    match slopes(&rows) {
        Some(found) => {
            out.bias_dps_per_k = Some(found[2]);
            let [a, b] = found[3].ci95.map(|v| sense * v);
            out.angular_gain_per_k = Some(Estimate { value: sense * found[3].value, ci95: [a.min(b), a.max(b)] });
        }
        None => {
            out.reason = Some(
                "gain and bias cannot be separated: that takes five runs, at two rates or in both directions, at several \
                 temperatures each"
                    .into(),
            );
        }
    }
    Some(out)
}

/// What of the rate the temperature followed, where it did.
fn together(steady: &[(f64, f64, f64)]) -> Option<&'static str> {
    let with = |of: fn(f64) -> f64| {
        let n = steady.len() as f64;
        let rates: Vec<f64> = steady.iter().map(|s| of(s.0)).collect();
        let (x, t) = (rates.iter().sum::<f64>() / n, steady.iter().map(|s| s.1).sum::<f64>() / n);
        let (mut xx, mut tt, mut xt) = (0.0, 0.0, 0.0);
        for (rate, run) in rates.iter().zip(steady) {
            let (a, b) = (rate - x, run.1 - t);
            (xx, tt, xt) = (xx + a * a / n, tt + b * b / n, xt + a * b / n);
        }
        let varies = xx.sqrt() > 0.02 * rates.iter().map(|r| r.abs()).sum::<f64>() / n;
        varies && xt.abs() > TOGETHER * (xx * tt).sqrt()
    };
    if with(f64::abs) {
        Some("the size of the rate")
    } else if with(f64::signum) || with(|r| r) {
        Some("the direction")
    } else {
        None
    }
}

/// Least squares, each value with Student's 95 % interval from the scatter about the fit; `None` where the rows are too few
/// or do not tell the columns apart.
pub(crate) fn slopes(rows: &[(Vec<f64>, f64)]) -> Option<Vec<Estimate>> {
    let (n, columns) = (rows.len(), rows.first()?.0.len());
    let spare = n.checked_sub(columns).filter(|s| *s > 0)?;
    let x = DMatrix::from_fn(n, columns, |i, j| rows[i].0[j]);
    let y = DVector::from_fn(n, |i, _| rows[i].1);
    let size: Vec<f64> = x.column_iter().map(|c| c.norm()).collect();
    if size.iter().any(|s| *s <= 0.0 || s.is_nan()) {
        return None;
    }
    let scaled = DMatrix::from_fn(n, columns, |i, j| x[(i, j)] / size[j]);
    let gram = scaled.tr_mul(&scaled);
    if gram.symmetric_eigenvalues().min() < LEAST_OWN * LEAST_OWN {
        return None;
    }
    let inverse = gram.try_inverse()?;
    let found = &inverse * scaled.tr_mul(&y);
    let left = (&y - &scaled * &found).norm_squared() / spare as f64;
    let student = StudentsT::new(0.0, 1.0, spare as f64).ok()?.inverse_cdf(0.975);
    let estimate = |j: usize| {
        let (value, half) = (found[j] / size[j], student * (left * inverse[(j, j)]).sqrt() / size[j]);
        Estimate { value, ci95: [value - half, value + half] }
    };
    Some((0..columns).map(estimate).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// Even noise from a counter, of variance one.
    fn noise(i: usize) -> f64 {
        let x = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let x = (x ^ (x >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((x >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 12f64.sqrt()
    }

    /// A run at a steady rate of an instrument whose gain and bias go with the temperature.
    fn run(rate: f64, temp_c: f64, [gain_per_k, bias_per_k]: [f64; 2], noise_dps: f64) -> Seen {
        let drift = 0.02 + bias_per_k * (temp_c - 25.0) - gain_per_k * (temp_c - 25.0) * rate + noise_dps;
        Seen { temp_c, steady_dps: Some(rate), gain: Some(0.78 - drift / rate), bias_dps: Some(drift), ratio: None }
    }

    fn campaign(slopes: [f64; 2], noise_dps: f64, seed: usize) -> Vec<Seen> {
        let points = [-10.0, 25.0, 60.0].into_iter().flat_map(|t| [-200.0, 200.0, 400.0].map(|r| (r, t)));
        points.enumerate().map(|(i, (r, t))| run(r, t, slopes, noise_dps * noise(9 * seed + i))).collect()
    }

    #[test]
    fn slopes_of_gain_and_bias_are_told_apart_by_runs_at_several_rates() {
        let found = temperature(&campaign([2e-5, 1e-4], 1e-6, 0), -1.0).unwrap();
        let (gain, bias) = (found.angular_gain_per_k.unwrap(), found.bias_dps_per_k.unwrap());
        assert!((gain.value / 2e-5 - 1.0).abs() < 1e-3 && (bias.value / 1e-4 - 1.0).abs() < 1e-2, "{found:?}");
    }

    #[test]
    fn intervals_hold_as_often_as_they_say() {
        let held = |which: fn(&Temperature) -> Estimate, planted: f64| {
            let of = |seed: &usize| {
                let e = which(&temperature(&campaign([2e-5, 1e-4], 1e-3, *seed), -1.0).unwrap());
                e.ci95[0] <= planted && planted <= e.ci95[1]
            };
            (0..400).filter(of).count()
        };
        // 380 expected, standard deviation 4.4
        let gain = held(|t| t.angular_gain_per_k.unwrap(), 2e-5);
        let bias = held(|t| t.bias_dps_per_k.unwrap(), 1e-4);
        assert!((365..=394).contains(&gain) && (365..=394).contains(&bias), "{gain} {bias}");
    }

    #[test]
    fn temperatures_that_hardly_differ_tell_no_slope() {
        let mut runs = campaign([2e-5, 1e-4], 1e-6, 0);
        runs.iter_mut().enumerate().for_each(|(i, r)| r.temp_c = 25.0 + 0.1 * i as f64);
        let found = temperature(&runs, -1.0).unwrap();
        assert!(found.angular_gain_per_k.is_none() && found.bias_dps_per_k.is_none(), "{found:?}");
        assert!(found.reason.unwrap().contains("within 0.80 K"));
        assert_eq!(temperature(&runs[..1], -1.0), None);
    }

    #[test]
    fn a_temperature_that_went_with_the_rate_or_the_direction_is_not_blamed() {
        let pairs = |of: fn(f64) -> f64| {
            let rates = [-400.0, -200.0, -100.0, 100.0, 200.0, 400.0];
            rates.iter().map(|r| run(*r, of(*r), [0.0, 0.0], 1e-4)).collect::<Vec<_>>()
        };
        for (of, word) in
            [((|r: f64| 20.0 + r.abs() / 20.0) as fn(f64) -> f64, "size"), (|r| 25.0 + r.signum() * 5.0, "direction")]
        {
            let found = temperature(&pairs(of), -1.0).unwrap();
            assert!(found.angular_gain_per_k.is_none() && found.reason.clone().unwrap().contains(word), "{found:?}");
        }
    }

    #[test]
    fn runs_at_one_rate_do_not_tell_gain_from_bias_and_say_what_would() {
        let runs: Vec<Seen> = [-10.0, 0.0, 10.0, 20.0, 30.0, 40.0].map(|t| run(200.0, t, [2e-5, 0.0], 1e-5)).into();
        let found = temperature(&runs, -1.0).unwrap();
        assert!(
            found.angular_gain_per_k.is_none() && found.reason.clone().unwrap().contains("both directions"),
            "{found:?}"
        );
    }

    #[test]
    fn runs_there_and_back_have_a_line_each() {
        let seen = |t: f64| Seen {
            temp_c: t,
            steady_dps: None,
            gain: Some(-1.0 - 1e-5 * t),
            bias_dps: Some(0.3 + 2e-3 * t),
            ratio: Some(1.04 + 3e-5 * t),
        };
        let found = temperature(&[seen(0.0), seen(20.0), seen(55.0), seen(70.0)], 1.0).unwrap();
        for (e, planted) in
            [(found.angular_gain_per_k, -1e-5), (found.bias_dps_per_k, 2e-3), (found.detection_gain_ratio_per_k, 3e-5)]
        {
            assert!((e.unwrap().value / planted - 1.0).abs() < 1e-6, "{found:?}");
        }
        assert!(temperature(&[seen(0.0), seen(20.0)], 1.0).unwrap().reason.unwrap().contains("three runs"));
    }
}
