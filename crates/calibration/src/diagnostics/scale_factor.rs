//! How the scale factor of a whole-angle gyroscope goes with the input rate: the slope of each run's angle over its input, over its rate.

use nalgebra::{DMatrix, DVector};

use crate::diagnostics::covariance::of_blocks;
use crate::diagnostics::gain_over_rate::{AlongTheRate, GainOverRate, range_of_rates};
use crate::estimation::fit::{Effort, Fit, fit};
use crate::estimation::joint_fit::{Dataset, Fitted};
use crate::estimation::propagation::Start;
use crate::estimation::residuals::{Residual, Window, residuals};
use crate::facts::Estimate;
use crate::model::hypothesis::{Hypothesis, Unknown};
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::robust_deviation;
use crate::recording::Role;

/// Blocks of the jackknife, and Student's 97.5 % point for one fewer degrees of freedom.
const BLOCKS: usize = 10;
const STUDENT_9: f64 = 2.262;
/// What the drive leaves in the gain of a run, as a share of it, standard deviation: simulated devices without any
/// nonlinearity show 0.6 and 1.6 ppm of it.
const DRIVE: f64 = 2e-6;
/// Samples further out than this many robust deviations are spikes.
const SPIKE: f64 = 6.0;
/// Unknowns of a run: the gain's deviation, second and fourth harmonic of the angle, which a run leaves off in the middle.
const UNKNOWNS: usize = 5;

/// Nonlinearity and asymmetry of the scale factor, where the runs' rates are such as tell them. What the fit leaves open of the
/// mechanics and the readout moves the gains of slow runs by more than those of fast ones: the intervals allow for it, by the covariance of
/// the unknowns.
pub(crate) fn scale_factor_of(dataset: &mut Dataset, fitted: &Fitted) -> Option<AlongTheRate> {
    range_of_rates(dataset.tracks.iter().map(|t| t.track.mean_rate().to_degrees()))?;
    let (free, covariance) = with_drifts(dataset, fitted);
    let told = GainOverRate::told(&gains(dataset, &free.hypothesis, &free.starts), 0.0)?;
    let nominal = told.found;
    let deviations: DVector<f64> = covariance.diagonal().map(|v| v.max(0.0).sqrt());
    let correlation = DMatrix::from_fn(deviations.len(), deviations.len(), |i, j| {
        let scale = deviations[i] * deviations[j];
        if scale > 0.0 { covariance[(i, j)] / scale } else { 0.0 }
    });
    let axes = correlation.symmetric_eigen();
    let mut squares = [0.0; 2];
    for (value, axis) in axes.eigenvalues.iter().zip(axes.eigenvectors.column_iter()) {
        let mut moved = free.hypothesis.clone();
        for (i, unknown) in free.unknowns.iter().enumerate().filter(|(_, u)| **u != Unknown::AngularGain) {
            moved.set(*unknown, moved.get(*unknown) + value.max(0.0).sqrt() * deviations[i] * axis[i]);
        }
        let Some(other) = told.again(&gains(dataset, &moved, &free.starts), 0.0) else { continue };
        squares[0] += (other.nonlinearity_ppm.value - nominal.nonlinearity_ppm.value).powi(2);
        squares[1] += (other.asymmetry_ppm.value - nominal.asymmetry_ppm.value).powi(2);
    }
    let wider = |e: Estimate, square: f64| e.widened(e.half_width().hypot(1.96 * square.sqrt()) - e.half_width());
    Some(AlongTheRate {
        nonlinearity_ppm: wider(nominal.nonlinearity_ppm, squares[0]),
        asymmetry_ppm: wider(nominal.asymmetry_ppm, squares[1]),
    })
}

/// The fit in which every run drifts by itself: a gain that goes with the rate would else be taken for what the drive does. The drifts
/// are then forgotten, so that they are in the gains. With the covariance of its unknowns.
fn with_drifts(dataset: &mut Dataset, fitted: &Fitted) -> (Fit, DMatrix<f64>) {
    let priors = dataset.priors(&fitted.fit.hypothesis, fitted.drive.as_ref());
    let balance = dataset.energy_balance;
    let drifted: Vec<bool> = dataset.tracks.iter().map(|t| t.drifts).collect();
    dataset.tracks.iter_mut().for_each(|t| t.drifts = true);
    // what the drive does is taken as it is believed to be: a gain that goes with the rate bends what is fitted of it
    let mut hypothesis = Hypothesis { control_latency_s: 0.0, ..fitted.fit.hypothesis.clone() };
    match &fitted.drive {
        Some(drive) => hypothesis.force_scale = drive.mean(),
        None => dataset.balance_energy(&mut hypothesis),
    }
    let of_the_drive = |u: &Unknown| matches!(u, Unknown::ForceScale | Unknown::ControlLatency);
    let unknowns: Vec<Unknown> = fitted.fit.unknowns.iter().copied().filter(|u| !of_the_drive(u)).collect();
    let mut free = fit(&dataset.tracks, &hypothesis, &unknowns, &priors, Role::Fit, Effort::FULL);
    let covariance = of_blocks(dataset, &free);
    free.starts.iter_mut().flatten().for_each(|start| start.drift = 0.0);
    dataset.tracks.iter_mut().zip(drifted).for_each(|(t, drifts)| t.drifts = drifts);
    dataset.energy_balance = balance;
    (free, covariance)
}

/// Rate, deg/s, and angular gain of each run.
fn gains(dataset: &Dataset, hypothesis: &Hypothesis, starts: &[Vec<Start>]) -> Vec<(f64, Estimate)> {
    let segments = residuals(&dataset.tracks, hypothesis, starts, Role::Fit, Window::Whole);
    let (k, sense) = (hypothesis.angular_gain, hypothesis.sense());
    let told = dataset.tracks.iter().zip(segments).filter_map(|(track, segments)| {
        let (slope, deviation) = slope(&segments)?;
        let (value, half) = (k + sense * slope, (STUDENT_9 * deviation).hypot(1.96 * DRIVE * k));
        Some((track.track.mean_rate().to_degrees(), Estimate { value, ci95: [value - half, value + half] }))
    });
    told.collect()
}

/// Slope of the angle over the input, a constant for each segment, and its standard deviation by the jackknife over
/// contiguous blocks.
fn slope(segments: &[Residual]) -> Option<(f64, f64)> {
    let mut rows: Vec<([f64; UNKNOWNS], f64)> = Vec::new();
    for s in segments {
        let row = |i: usize| {
            let (s2, c2) = (2.0 * s.direction[i]).sin_cos();
            let (s4, c4) = (4.0 * s.direction[i]).sin_cos();
            ([s.turned[i], c2, s2, c4, s4], s.angle[i])
        };
        let all: Vec<_> = (0..s.angle.len()).map(row).collect();
        let n = all.len().max(1) as f64;
        let mean: [f64; UNKNOWNS] = std::array::from_fn(|c| all.iter().map(|r| r.0[c]).sum::<f64>() / n);
        let middle = all.iter().map(|r| r.1).sum::<f64>() / n;
        rows.extend(all.iter().map(|(r, v)| (std::array::from_fn(|c| r[c] - mean[c]), v - middle)));
    }
    if rows.len() < BLOCKS * UNKNOWNS {
        return None;
    }
    let solve = |rows: &mut dyn Iterator<Item = &([f64; UNKNOWNS], f64)>| {
        let mut equations = NormalEquations::new(UNKNOWNS);
        rows.for_each(|(row, value)| equations.add(row, *value));
        equations.solve()
    };
    let first = solve(&mut rows.iter());
    let left = |(row, value): &([f64; UNKNOWNS], f64)| value - row.iter().zip(&first).map(|(a, b)| a * b).sum::<f64>();
    let limit = SPIKE * robust_deviation(rows.iter().map(left));
    rows.retain(|r| left(r).abs() <= limit);
    let n = rows.len();
    let value = solve(&mut rows.iter())[0];
    let without: Vec<f64> = (0..BLOCKS)
        .map(|b| solve(&mut rows.iter().enumerate().filter(|(i, _)| i * BLOCKS / n != b).map(|(_, r)| r))[0])
        .collect();
    let mean = without.iter().sum::<f64>() / BLOCKS as f64;
    let spread: f64 = without.iter().map(|w| (w - mean).powi(2)).sum();
    let deviation = ((BLOCKS - 1) as f64 / BLOCKS as f64 * spread).sqrt();
    (value.is_finite() && deviation.is_finite()).then_some((value, deviation))
}
