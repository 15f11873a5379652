//! Nonlinearity and asymmetry of a scale factor, from the gains at several rates.
//!
//! $$k_i = k + c\\,u(|Ω_i|) + a\\,\mathrm{sgn}\\,Ω_i + \frac{b}{Ω_i}, \quad u(Ω_{min}) = 0,\\; u(Ω_{max}) = 1$$
//!
//! c over the mean gain is the nonlinearity, whatever u is in between: straight in the speed, straight in its square, or through a gain of
//! its own at every speed that was measured. The last holds for any course and is the least sure; one of the others stands in its place
//! where the gains do not reject it beside that (5 %), the one that leaves less, with an interval that holds those of all that are not rejected.
//! A bias b that all runs share looks like a gain at a steady rate; nothing is known of it but that it is of the order of
//! the Earth's rate.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::facts::Estimate;

/// What a bias common to all runs is believed to be without data, standard deviation, deg/s: the Earth's rate.
const BIAS_DPS: f64 = 0.004_2;
/// What the other unknowns are believed to be, as shares of the gain: nothing.
const VAGUE: f64 = 10.0;
/// Rates that differ by less than this share of the largest are one rate.
const SAME_RATE: f64 = 0.02;
/// Rates that have to be there: with as many as there are unknowns a run that is off by itself shows.
const FEWEST_RATES: usize = 4;
/// Probability with which gains that follow a law reject it.
const BY_CHANCE: f64 = 0.05;

/// How the gain goes with the speed.
#[derive(Debug, Clone, PartialEq)]
enum Law {
    /// straight in it
    Linear,
    /// straight in its square
    Square,
    /// straight between these speeds, deg/s, with a gain of its own at each
    Between(Vec<f64>),
}

impl Law {
    /// u at a speed, of the ends of the speeds; of a gain at every speed but the slowest the share of each.
    fn terms(&self, speed: f64, [slowest, fastest]: [f64; 2]) -> Vec<f64> {
        match self {
            Self::Linear => vec![(speed - slowest) / (fastest - slowest)],
            Self::Square => vec![(speed.powi(2) - slowest.powi(2)) / (fastest.powi(2) - slowest.powi(2))],
            Self::Between(speeds) => {
                let share = |at: usize| {
                    let here = speeds[at];
                    let below = ((speed - speeds[at - 1]) / (here - speeds[at - 1])).clamp(0.0, 1.0);
                    let above = speeds.get(at + 1).map_or(0.0, |next| ((speed - here) / (next - here)).clamp(0.0, 1.0));
                    below - above
                };
                (1..speeds.len()).map(share).collect()
            }
        }
    }
}

/// How a gain goes with the rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AlongTheRate {
    /// at the fastest less that at the slowest rate, either sense alike, over their mean, ppm
    pub(crate) nonlinearity_ppm: Estimate,
    /// at positive less that at negative rates, over their mean, ppm
    pub(crate) asymmetry_ppm: Estimate,
}

/// Gains at several rates with a law through them.
#[derive(Debug, Clone)]
pub(crate) struct GainOverRate {
    pub(crate) found: AlongTheRate,
    law: Law,
    /// slowest and fastest speed, deg/s
    ends: [f64; 2],
    /// of the law, ppm of the mean gain
    coefficients_ppm: Vec<f64>,
}

impl GainOverRate {
    /// From rates, deg/s, and gains, where four rates or more and both senses are there.
    /// `bias_dps` is what a bias common to all runs is believed to be, standard deviation; no less than the Earth's rate.
    pub(crate) fn told(gains: &[(f64, Estimate)], bias_dps: f64) -> Option<Self> {
        let gains = Gains::new(gains, bias_dps)?;
        let any = gains.fitted(Law::Between(gains.speeds()))?;
        let laws = [Law::Linear, Law::Square].into_iter().filter_map(|law| gains.fitted(law));
        let mut kept: Vec<Fitted> = laws.filter(|fitted| !fitted.is_rejected_beside(&any)).collect();
        kept.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
        if kept.is_empty() {
            kept.push(any);
        }
        let mut told = gains.in_ppm(&kept[0]);
        for other in &kept[1..] {
            let other = gains.in_ppm(other).found;
            told.found.nonlinearity_ppm = both(told.found.nonlinearity_ppm, other.nonlinearity_ppm);
            told.found.asymmetry_ppm = both(told.found.asymmetry_ppm, other.asymmetry_ppm);
        }
        Some(told)
    }

    /// The same law through other gains.
    pub(crate) fn again(&self, gains: &[(f64, Estimate)], bias_dps: f64) -> Option<AlongTheRate> {
        let gains = Gains::new(gains, bias_dps)?;
        Some(gains.in_ppm(&gains.fitted(self.law.clone())?).found)
    }

    /// What the gain is more than its mean of the slowest and the fastest speed at a rate, deg/s, as a share of it.
    pub(crate) fn share(&self, rate_dps: f64) -> f64 {
        let by_speed: f64 =
            self.law.terms(rate_dps.abs(), self.ends).iter().zip(&self.coefficients_ppm).map(|(u, c)| u * c).sum();
        let middle = 0.5 * self.found.nonlinearity_ppm.value;
        1e-6 * (by_speed - middle + 0.5 * self.found.asymmetry_ppm.value * rate_dps.signum())
    }
}

/// An estimate whose interval holds that of the other as well.
fn both(a: Estimate, b: Estimate) -> Estimate {
    Estimate { ci95: [a.ci95[0].min(b.ci95[0]), a.ci95[1].max(b.ci95[1])], ..a }
}

/// Gains that tell, each at its rate, deg/s.
struct Gains {
    told: Vec<(f64, Estimate)>,
    ends: [f64; 2],
    mean: f64,
    bias_dps: f64,
}

/// Gains with a law through them, by least squares: of the slowest speed, of the law, of the sense, of a bias.
struct Fitted {
    law: Law,
    values: DVector<f64>,
    covariance: DMatrix<f64>,
    /// sum of squares of what is left, in deviations of the gains
    misfit: f64,
    /// gains beyond the unknowns
    spare: usize,
}

impl Gains {
    fn new(gains: &[(f64, Estimate)], bias_dps: f64) -> Option<Self> {
        let told: Vec<(f64, Estimate)> =
            gains.iter().copied().filter(|(rate, gain)| rate.abs() > 0.0 && gain.half_width() > 0.0).collect();
        let ends = range_of_rates(told.iter().map(|t| t.0))?;
        let mean = told.iter().map(|t| t.1.value).sum::<f64>() / told.len() as f64;
        Some(Self { told, ends, mean, bias_dps: bias_dps.max(BIAS_DPS) })
    }

    /// The speeds that were measured.
    fn speeds(&self) -> Vec<f64> {
        let mut speeds: Vec<f64> = self.told.iter().map(|(rate, _)| rate.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        let apart = SAME_RATE * self.ends[1];
        let alike = speeds.chunk_by(|a, b| b - a < apart);
        alike.map(|speeds| speeds.iter().sum::<f64>() / speeds.len() as f64).collect()
    }

    fn fitted(&self, law: Law) -> Option<Fitted> {
        let row = |rate: f64| {
            let by_speed = law.terms(rate.abs(), self.ends);
            let row = std::iter::once(1.0).chain(by_speed).chain([rate.signum(), 1.0 / rate]);
            DVector::from_iterator(row.clone().count(), row)
        };
        let unknowns = row(self.ends[1]).len();
        let believed = |at: usize| if at + 1 == unknowns { self.bias_dps } else { VAGUE };
        let mut information =
            DMatrix::from_diagonal(&DVector::from_fn(unknowns, |at, _| (believed(at) * self.mean).powi(-2)));
        let mut right = DVector::zeros(unknowns);
        for (rate, gain) in &self.told {
            let (row, weight) = (row(*rate), (1.96 / gain.half_width()).powi(2));
            information += weight * &row * row.transpose();
            right += weight * (gain.value - self.mean) * row;
        }
        let covariance = information.try_inverse()?;
        let values = &covariance * right;
        let left = |(rate, gain): &(f64, Estimate)| {
            ((gain.value - self.mean - row(*rate).dot(&values)) * 1.96 / gain.half_width()).powi(2)
        };
        let misfit = self.told.iter().map(left).sum();
        Some(Fitted { values, covariance, misfit, spare: self.told.len().saturating_sub(unknowns), law })
    }

    fn in_ppm(&self, fitted: &Fitted) -> GainOverRate {
        // behind the law stand sense and bias
        let (last, sense) = (fitted.values.len() - 3, fitted.values.len() - 2);
        let ppm = 1e6 / (self.mean + fitted.values[0] + 0.5 * fitted.values[last]);
        let deviation = |i: usize| fitted.wider() * fitted.covariance[(i, i)].max(0.0).sqrt();
        let estimate =
            |i: usize, scale: f64| Estimate::new(ppm * scale * fitted.values[i], (ppm * scale * deviation(i)).abs());
        GainOverRate {
            found: AlongTheRate { nonlinearity_ppm: estimate(last, 1.0), asymmetry_ppm: estimate(sense, 2.0) },
            law: fitted.law.clone(),
            ends: self.ends,
            coefficients_ppm: fitted.values.iter().skip(1).take(last).map(|c| ppm * c).collect(),
        }
    }
}

impl Fitted {
    /// Runs that scatter by more than they say widen all intervals.
    fn wider(&self) -> f64 {
        if self.spare > 0 { (self.misfit / self.spare as f64).max(1.0).sqrt() } else { 1.0 }
    }

    /// The gains leave more by this law than their scatter about a gain of its own at every speed does.
    fn is_rejected_beside(&self, any: &Self) -> bool {
        let more = any.values.len().saturating_sub(self.values.len());
        if more == 0 {
            return false;
        }
        let left = (self.misfit - any.misfit) / any.wider().powi(2);
        let likely = 1.0 - BY_CHANCE;
        let most = if any.wider() > 1.0 {
            FisherSnedecor::new(more as f64, any.spare as f64).ok().map(|f| more as f64 * f.inverse_cdf(likely))
        } else {
            ChiSquared::new(more as f64).ok().map(|chi| chi.inverse_cdf(likely))
        };
        most.is_some_and(|most| left > most)
    }
}

/// The slowest and the fastest rate, where there are four or more, in both senses, that are not one.
pub(crate) fn range_of_rates(rates: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let mut rates: Vec<f64> = rates.filter(|rate| rate.abs() > 0.0).collect();
    rates.sort_by(f64::total_cmp);
    let both = rates.first()? * rates.last()? < 0.0;
    let fastest = rates.iter().map(|r| r.abs()).fold(0.0, f64::max);
    let slowest = rates.iter().map(|r| r.abs()).fold(f64::INFINITY, f64::min);
    rates.dedup_by(|a, b| (*a - *b).abs() < SAME_RATE * fastest);
    (rates.len() >= FEWEST_RATES && both && 1.0 - slowest / fastest >= SAME_RATE).then_some([slowest, fastest])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::statistics::remembered;

    fn run(rate: f64, gain: f64, half_width: f64) -> (f64, Estimate) {
        (rate, Estimate { value: gain, ci95: [gain - half_width, gain + half_width] })
    }

    fn scale_factor(gains: &[(f64, Estimate)]) -> Option<AlongTheRate> {
        Some(GainOverRate::told(gains, 0.0)?.found)
    }

    #[test]
    fn nonlinearity_asymmetry_and_bias_are_told_apart() {
        let (k, bias) = (0.78, 0.003);
        let runs: Vec<(f64, Estimate)> = [-500.0, -300.0, -100.0, 100.0, 300.0, 500.0]
            .map(|rate: f64| {
                let ppm = 200.0 * (rate.abs() - 100.0) / 400.0 + 25.0 * rate.signum();
                run(rate, k * (1.0 + 1e-6 * ppm) + bias / rate, 1e-6)
            })
            .into();
        let s = scale_factor(&runs).expect("six rates");
        assert!((s.nonlinearity_ppm.value - 200.0).abs() < 4.0, "{s:?}");
        assert!((s.asymmetry_ppm.value - 50.0).abs() < 4.0, "{s:?}");
        assert!(s.nonlinearity_ppm.half_width() < 10.0, "{s:?}");
    }

    /// Whatever the course over the rate: at noise that hides it, that shows it, and in between.
    #[test]
    fn the_interval_holds_the_nonlinearity_whatever_its_course_over_the_rate() {
        type Course = (&'static str, fn(f64) -> f64);
        let courses: [Course; 5] = [
            ("straight", |u| u),
            ("square", |u| u * u),
            ("cubic", |u| u.powi(3)),
            ("root", f64::sqrt),
            ("at the fastest only", |u| f64::from(u8::from(u > 0.9))),
        ];
        let rates = [20.0, 60.0, 100.0, 150.0, 200.0, 300.0];
        let (mut missed, mut trials) = (Vec::new(), 0);
        for (name, course) in courses {
            for noise_ppm in [1.0, 30.0, 100.0, 300.0] {
                let held = (0..40).filter(|seed| {
                    let noise = remembered(0.0, 12, u64::wrapping_mul(seed + 1, 0x9E37_79B9_7F4A_7C15));
                    let gain = |rate: f64, noise: f64| {
                        let ppm = 1800.0 * course(rate.abs() / 300.0) + noise_ppm * noise;
                        run(rate, 1.0 + 1e-6 * ppm, 1.96e-6 * noise_ppm)
                    };
                    let both_ways = rates.iter().flat_map(|rate| [*rate, -rate]);
                    let runs: Vec<_> = both_ways.zip(noise).map(|(rate, noise)| gain(rate, noise)).collect();
                    let [slowest, fastest] = [20.0, 300.0].map(|speed| 1.0 + 1800e-6 * course(speed / 300.0));
                    let planted = 1e6 * (fastest - slowest) / (0.5 * (fastest + slowest));
                    let [low, high] = scale_factor(&runs).expect("twelve rates").nonlinearity_ppm.ci95;
                    low <= planted && planted <= high
                });
                let held = held.count();
                println!("{name}, noise of {noise_ppm} ppm: {held} of 40");
                trials += 40;
                if held < 36 {
                    missed.push((name, noise_ppm, held));
                }
            }
        }
        assert!(missed.is_empty(), "of {trials}: {missed:?}");
    }

    #[test]
    fn a_square_law_is_undone_as_one() {
        let rates = [20.0, 60.0, 100.0, 150.0, 200.0, 300.0];
        let square = |rate: f64| 2e-8 * rate * rate;
        let gains: Vec<_> =
            rates.iter().flat_map(|r| [*r, -r]).map(|rate| run(rate, 1.0 + square(rate), 1e-5)).collect();
        let told = GainOverRate::told(&gains, 0.0).expect("twelve rates");
        let middle = 0.5 * (square(20.0) + square(300.0));
        for rate in [10.0, -80.0, 250.0] {
            assert!((told.share(rate) - square(rate) + middle).abs() < 2e-6, "{rate}: {}", told.share(rate));
        }
    }

    #[test]
    fn a_bias_of_the_earths_rate_stays_open_and_three_rates_tell_nothing() {
        let runs: Vec<(f64, Estimate)> = [-300.0, -100.0, 100.0, 500.0].map(|rate| run(rate, 0.78, 1e-6)).into();
        let s = scale_factor(&runs).expect("four rates");
        assert!(
            s.nonlinearity_ppm.value.abs() < 1e-6 && s.nonlinearity_ppm.half_width() > 1.28,
            "wider than noise makes it: {s:?}"
        );
        assert_eq!(scale_factor(&runs[1..]), None);
        let one_way: Vec<(f64, Estimate)> = [100.0, 300.0, 500.0].map(|rate| run(rate, 0.78, 1e-6)).into();
        assert_eq!(scale_factor(&one_way), None);
    }
}
