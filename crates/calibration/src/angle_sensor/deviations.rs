//! How far what was fitted to an angle sensor may be off: the jackknife over contiguous blocks, which counts what noise
//! remembers, and beyond it what the model leaves open: another noise, another weighting, what a table may hold.

use super::effects::LibraryReadout;
use super::model::SensorModel;
use super::readout::{Kind, Readout};
use super::readout_fit::{Weighting, fit};
use super::samples::SensorRun;
use super::table_fit::TableFit;
use crate::diagnostics::decomposition::{BLOCKS, STUDENT_19};

/// Deviations of all that was fitted, by the jackknife over contiguous blocks.
#[derive(Debug, Clone)]
pub(crate) struct Deviations {
    /// of [`LibraryReadout::values`]
    pub(crate) readout: [f64; 6],
    /// of [`TableFit::side`]
    pub(crate) side: Vec<f64>,
    /// of the table's cosines and sines
    pub(crate) cos: Vec<f64>,
    pub(crate) sin: Vec<f64>,
}

/// A fit without one block: the readout, where there is one, and the table.
type Refit = (Option<LibraryReadout>, TableFit);

/// Makes every fit anew without one block of each run after the other (Künsch 1989).
pub(crate) fn deviations(model: &SensorModel, runs: &[SensorRun]) -> Deviations {
    let fits: Vec<Refit> = (0..BLOCKS)
        .filter_map(|block| {
            let kept = without_block(runs, block);
            let readout = match &model.readout {
                Some((r, weighting)) if r.kind != Kind::Plain => {
                    Some(fit(r.kind, *weighting, &kept, model.sensor.gain, r)?.readout)
                }
                Some((r, _)) => Some(r.clone()),
                None => None,
            };
            let samples = model.sensor.samples(&kept, readout.as_ref());
            let table = TableFit::new(&model.table.shape, &samples, kept.len(), model.sensor.cycles)?;
            Some((readout.as_ref().map(LibraryReadout::from), table))
        })
        .collect();
    let of = |value: &dyn Fn(&Refit) -> f64| jackknife(&fits.iter().map(value).collect::<Vec<_>>());
    let readout = |i: usize| of(&|f| f.0.map_or(0.0, |r| r.values()[i]));
    let order = model.table.table.cos.len();
    let others = [noise_model_difference(model, runs), weighting_difference(model, runs), held_by_table(model)];
    let beyond = |i: usize| others.iter().fold(0.0, |sum: f64, other| sum.hypot(other[i])) / STUDENT_19;
    Deviations {
        readout: std::array::from_fn(|i| readout(i).hypot(beyond(i))),
        side: (0..model.table.side.len()).map(|i| of(&|f| f.1.side[i])).collect(),
        cos: (0..order).map(|i| of(&|f| f.1.table.cos[i])).collect(),
        sin: (0..order).map(|i| of(&|f| f.1.table.sin[i])).collect(),
    }
}

/// The gain ratio that each run alone tells by the readout of all, with its standard deviation, where there are several that
/// turn through a period and more.
pub(crate) fn own_gain_ratios<'a>(model: &SensorModel, runs: &'a [SensorRun]) -> Vec<(&'a str, Option<[f64; 2]>)> {
    let Some((readout, weighting)) = model.readout.as_ref().filter(|(r, _)| r.kind >= Kind::Affine && runs.len() > 1)
    else {
        return Vec::new();
    };
    let gain = model.sensor.gain;
    let ratio = |run: &[SensorRun]| {
        Some(LibraryReadout::from(&fit(readout.kind, *weighting, run, gain, readout)?.readout).gain_ratio)
    };
    let own = |run: &SensorRun| {
        let run = std::slice::from_ref(run);
        let turns = run[0].travel_rad() * gain.abs() >= model.sensor.period;
        let blocks: Vec<f64> = (0..BLOCKS).filter_map(|block| ratio(&without_block(run, block))).collect();
        Some([ratio(run)?, jackknife(&blocks)]).filter(|_| turns && blocks.len() == BLOCKS)
    };
    runs.iter().map(|r| (r.name.as_str(), own(r))).collect()
}

/// By what a readout known from its radius alone would differ if the noise of the radius were additive and not in
/// proportion to it: the algebraic ellipse instead of the one in the logarithm. Where an ellipse is not what the channels
/// draw the two differ by more than either scatters, and no block tells which is right (Hausman 1978).
fn noise_model_difference(model: &SensorModel, runs: &[SensorRun]) -> [f64; 6] {
    model.front().filter(|_| model.by_radius).map_or([0.0; 6], |readout| other_noise(readout, runs))
}

/// By what the readout would differ if angle and radius counted by their own variances, where another weighting was
/// selected. Both estimate the same where the model is right; where it is not, they differ by more than either scatters
/// (Hausman 1978).
fn weighting_difference(model: &SensorModel, runs: &[SensorRun]) -> [f64; 6] {
    let Some((ours, weighting)) = &model.readout else { return [0.0; 6] };
    if model.by_radius || ours.kind == Kind::Plain || *weighting == Weighting::VarianceComponents {
        return [0.0; 6];
    }
    let theirs = fit(ours.kind, Weighting::VarianceComponents, runs, model.sensor.gain, ours);
    let [ours, theirs] = [Some(ours), theirs.as_ref().map(|f| &f.readout)]
        .map(|r| r.map_or([f64::INFINITY; 6], |r| LibraryReadout::from(r).values()));
    std::array::from_fn(|i| ours[i] - theirs[i])
}

/// What a table beside the readout may hold of its parameters: offsets make a harmonic 1 of the angle, gain and skew a
/// harmonic 2, cubics a harmonic 4 (and, of the channels' difference, a 2).
fn held_by_table(model: &SensorModel) -> [f64; 6] {
    let Some(readout) = model.front().filter(|r| r.kind != Kind::Plain) else { return [0.0; 6] };
    let table = &model.table.table;
    let harmonic = |n: usize| {
        let [cos, sin] = [&table.cos, &table.sin].map(|v| v.get(n - 1).copied().unwrap_or(0.0));
        cos.hypot(sin)
    };
    let LibraryReadout { gain_ratio, amplitude, .. } = LibraryReadout::from(readout);
    let [first, second, fourth] = [1, 2, 4].map(harmonic);
    let cubic = |harmonic: f64| 16.0 / 3.0 * harmonic / amplitude.powi(2);
    [first * amplitude, first * amplitude, 2.0 * gain_ratio * second, 2.0 * second, cubic(fourth), cubic(second)]
}

/// [`noise_model_difference`] of a readout that is known from its radius alone.
pub(crate) fn other_noise(readout: &Readout, runs: &[SensorRun]) -> [f64; 6] {
    if readout.kind != Kind::Affine {
        return [0.0; 6];
    }
    let Some(algebraic) = super::ellipse::algebraic(runs) else { return [0.0; 6] };
    let [ours, theirs] = [readout, &algebraic].map(|r| LibraryReadout::from(r).values());
    std::array::from_fn(|i| ours[i] - theirs[i])
}

/// Standard deviation of a value by the jackknife, from its values without one block after the other.
pub(crate) fn jackknife(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    ((n - 1.0) / n * values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt()
}

/// Each run without one of [`BLOCKS`] contiguous blocks.
pub(crate) fn without_block(runs: &[SensorRun], block: usize) -> Vec<SensorRun> {
    let without = |r: &SensorRun| {
        let n = r.len();
        let rows: Vec<usize> = (0..n).filter(|i| i * BLOCKS / n != block).collect();
        r.subset(&rows)
    };
    runs.iter().map(without).collect()
}
