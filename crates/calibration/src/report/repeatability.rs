//! How what runs tell by themselves repeats from run to run.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::facts::{Estimate, RunReport};

/// Runs below which a spread is none.
const FEWEST_RUNS: usize = 3;

/// How numbers of several runs scatter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeatability {
    /// standard deviation, with what it may be of runs that scatter normally
    pub deviation: Estimate,
    /// how many runs told one
    pub runs: usize,
}

/// How a number of the runs that agree scatters; none with fewer than three of them.
pub fn repeatability(runs: &[RunReport], of: impl Fn(&RunReport) -> Option<f64>) -> Option<Repeatability> {
    let sound = runs.iter().filter(|run| run.agrees != Some(false));
    let told: Vec<f64> = sound.filter_map(of).filter(|v| v.is_finite()).collect();
    let (runs, n) = (told.len(), told.len() as f64);
    let law = ChiSquared::new(n - 1.0).ok().filter(|_| runs >= FEWEST_RUNS)?;
    let mean = told.iter().sum::<f64>() / n;
    let square = told.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    let end = |share: f64| (square / law.inverse_cdf(share)).sqrt();
    Some(Repeatability {
        deviation: Estimate { value: (square / (n - 1.0)).sqrt(), ci95: [end(0.975), end(0.025)] },
        runs,
    })
}

/// That of the scale factor, ppm of it.
pub fn of_the_gain(runs: &[RunReport], k: Estimate) -> Option<Repeatability> {
    repeatability(runs, |run| Some(1e6 * run.angular_gain?.value / k.value.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Recording, Role, Run, RunKind};
    use crate::report::recorded::run_report;

    fn runs(gains: &[f64]) -> Vec<RunReport> {
        let run = Run {
            kind: RunKind::Rotation,
            file: "run.csv".into(),
            settle_s: 0.0,
            role: Role::Fit,
            amplitude: None,
            recording: Recording::default(),
        };
        let told = |gain: &f64| RunReport { angular_gain: Some(Estimate::new(*gain, 1e-6)), ..run_report(&run) };
        gains.iter().map(told).collect()
    }

    #[test]
    fn the_deviation_of_gains_is_within_its_interval_as_often_as_that_says() {
        let mut seed = 1_u64;
        let mut even = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        for count in [3, 5, 12] {
            let held = (0..2000).filter(|_| {
                let normal = |_| 0.78 * (1.0 + 1e-4 * ((0..12).map(|_| even()).sum::<f64>() - 6.0));
                let gains: Vec<f64> = (0..count).map(normal).collect();
                let told = of_the_gain(&runs(&gains), Estimate::new(-0.78, 1e-6)).expect("three runs and more");
                let [low, high] = told.deviation.ci95;
                low < 100.0 && 100.0 < high
            });
            let share = held.count() as f64 / 2000.0;
            assert!((share - 0.95).abs() < 0.02, "{count} runs: {share}");
        }
    }

    #[test]
    fn two_runs_and_runs_that_do_not_agree_tell_none() {
        let k = Estimate::new(0.78, 1e-6);
        assert_eq!(of_the_gain(&runs(&[0.78, 0.781]), k), None);
        let mut three = runs(&[0.78, 0.781, 0.9]);
        assert!(of_the_gain(&three, k).is_some());
        three[2].agrees = Some(false);
        assert_eq!(of_the_gain(&three, k), None);
    }
}
