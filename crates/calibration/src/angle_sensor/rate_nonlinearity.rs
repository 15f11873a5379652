//! How the scale factor of a rate gyroscope goes with the rate, from runs at one rate each and from the steps of runs that turn at
//! several.

use super::rate_alone::{SAME_SPEED, found};
use super::rate_gyroscope::{RateGyroscope, tell_scale};
use super::rate_regression::{Stretch, Term};
use super::samples::{Reading, SensorRun};
use crate::diagnostics::gain_over_rate::{AlongTheRate, GainOverRate};
use crate::report::Estimate;

/// Blocks of a run that steps of the rate are looked for in, and rows of one.
const MOST_BLOCKS: usize = 500;
const FEWEST_ROWS_OF_A_BLOCK: usize = 10;
/// A step holds so many blocks at least, from one to the next of which the rate differs by less than this share of the fastest.
const FEWEST_BLOCKS: usize = 10;
const SAME_RATE: f64 = 2e-3;

/// A scale factor that goes with the rate.
#[derive(Debug, Clone)]
pub(super) struct Nonlinearity {
    over_rate: GainOverRate,
    /// mean scale factor
    gain: f64,
}

impl Nonlinearity {
    /// From what runs at one rate, and steps of others, tell beside what was fitted to all; none where they do not.
    pub(super) fn of_the_gains(model: &RateGyroscope, runs: &[SensorRun]) -> Option<Self> {
        let gains = if model.answered { model.gains(runs) } else { Vec::new() };
        let over_rate = GainOverRate::told(&gains, model.deviation(Term::Bias).to_degrees())?;
        Some(Self { over_rate, gain: model.gain.0 })
    }

    pub(super) fn found(&self) -> AlongTheRate {
        self.over_rate.found
    }

    /// Either part is told from nothing.
    pub(super) fn is_told(&self) -> bool {
        [self.found().nonlinearity_ppm, self.found().asymmetry_ppm].iter().any(|e| e.value.abs() > e.half_width())
    }

    /// Whether it is this one, to a tenth of its intervals.
    pub(super) fn is(&self, other: &Self) -> bool {
        let alike = |a: Estimate, b: Estimate| (a.value - b.value).abs() < 0.1 * a.half_width();
        alike(self.found().nonlinearity_ppm, other.found().nonlinearity_ppm)
            && alike(self.found().asymmetry_ppm, other.found().asymmetry_ppm)
    }

    /// By what share of itself it is uncertain, as a half width: that of the part that is told better.
    pub(super) fn uncertainty(&self) -> f64 {
        let share = |e: Estimate| e.half_width() / e.value.abs().max(f64::MIN_POSITIVE);
        share(self.found().nonlinearity_ppm).min(share(self.found().asymmetry_ppm))
    }

    /// What it adds to the angle in the course of a run, rad.
    pub(super) fn of(&self, run: &SensorRun) -> Vec<f64> {
        let turns = run.reference_rad.windows(2).zip(run.t_s.windows(2));
        let steps = turns.map(|(a, t)| {
            let turned = a[1] - a[0];
            let rate = turned / (t[1] - t[0]).max(f64::MIN_POSITIVE);
            self.gain * self.over_rate.share(rate.to_degrees()) * turned
        });
        let sums = steps.scan(0.0, |sum, step| {
            *sum += step;
            Some(*sum)
        });
        std::iter::once(0.0).chain(sums).collect()
    }

    /// The run without it.
    pub(super) fn taken_out(&self, run: &SensorRun) -> SensorRun {
        let mut linear = run.clone();
        if let Reading::Angle(theta) = &mut linear.reading {
            theta.iter_mut().zip(self.of(run)).for_each(|(theta, by)| *theta -= by);
        }
        linear
    }
}

impl RateGyroscope {
    /// Rate, deg/s, and gain of every run at one rate and of every part at one rate of the others, the bias of all runs taken
    /// out.
    fn gains(&self, fitted: &[SensorRun]) -> Vec<(f64, Estimate)> {
        let bias = self.value(Term::Bias);
        let gain = |run: SensorRun| {
            let stretch = Stretch::new(&run, 0, &self.sensor, self.latency_s())?;
            let [scale] = found(&[stretch.without(&[Term::Bias], &[bias])], &[Term::Scale])?;
            let last = run.len() - 1;
            let rate = (run.reference_rad[last] - run.reference_rad[0]) / (run.t_s[last] - run.t_s[0]);
            Some((rate.to_degrees(), scale.turned(self.sensor.gain)))
        };
        let parts = fitted.iter().flat_map(|run| {
            let turns_at_one_rate = Stretch::new(run, 0, &self.sensor, 0.0).is_some_and(|s| !tell_scale(&[s]));
            if turns_at_one_rate { vec![run.clone()] } else { steady_parts(run) }
        });
        parts.filter_map(gain).collect()
    }
}

/// The parts of a run in which it turns at one rate, without the blocks in which that is reached and left: the steps of a
/// staircase of rates that is recorded as one run.
fn steady_parts(run: &SensorRun) -> Vec<SensorRun> {
    let last = run.len() - 1;
    let blocks = (last / FEWEST_ROWS_OF_A_BLOCK).min(MOST_BLOCKS);
    let edges: Vec<usize> = (0..=blocks).map(|b| b * last / blocks.max(1)).collect();
    let rate = |w: &[usize]| {
        (run.reference_rad[w[1]] - run.reference_rad[w[0]]) / (run.t_s[w[1]] - run.t_s[w[0]]).max(f64::MIN_POSITIVE)
    };
    let rates: Vec<f64> = edges.windows(2).map(rate).collect();
    let fastest = rates.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    let is_one_rate = |a: &f64, b: &f64| (a - b).abs() < SAME_RATE * fastest;
    let mut from = 0;
    let parts = rates.chunk_by(is_one_rate).filter_map(|part| {
        let (first, behind) = (from, from + part.len());
        from = behind;
        let turns = part.len() >= FEWEST_BLOCKS && part[part.len() / 2].abs() > SAME_SPEED * fastest;
        turns.then(|| run.subset(&(edges[first + 1]..edges[behind - 1]).collect::<Vec<_>>()))
    });
    parts.collect()
}
