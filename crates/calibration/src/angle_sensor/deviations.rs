//! How far what was fitted to an angle sensor may be off: the jackknife over contiguous blocks, which counts what noise
//! remembers, and beyond it what the model leaves open: another noise, another weighting, what a table may hold.

use cvg_model::effects::{EffectId, MAX_PARAMETERS, Parameter, Values};

use super::circle::{OF_A_READOUT, ln_radius};
use super::effects::{LIBRARY_VALUES, LibraryReadout};
use super::model::SensorModel;
use super::readout::{Kind, Readout, Unknown};
use super::readout_fit::{Weighting, fit};
use super::samples::SensorRun;
use super::table_fit::{TableFit, by_run};
use crate::diagnostics::decomposition::{BLOCKS, STUDENT_19};
use crate::numerics::linear::NormalEquations;

/// Deviations from which on a parameter of an effect as text, or a cubic, is no chance: by Student's t of 19 degrees of freedom 1 in 2,000.
const NO_CHANCE: f64 = 4.2;
/// A change of a parameter, in its scale, that shows what it does.
const NUDGE: f64 = 1e-3;

/// Deviations of all that was fitted, by the jackknife over contiguous blocks.
#[derive(Debug, Clone)]
pub(crate) struct Deviations {
    /// of [`values`]
    pub(crate) readout: Vec<f64>,
    /// … by the jackknife alone: what of them another recording would tell otherwise
    repeated: Vec<f64>,
    /// of [`TableFit::side`]
    pub(crate) side: Vec<f64>,
    /// of the table's cosines and sines
    pub(crate) cos: Vec<f64>,
    pub(crate) sin: Vec<f64>,
}

impl Deviations {
    /// The largest kind of readout of which something that a smaller lacks is told from nothing, whatever else may have made it; any without
    /// cubics.
    pub(crate) fn told(&self, readout: &Readout) -> Kind {
        let v = values(readout);
        let is_told = |i: usize| v[i].abs() > NO_CHANCE * self.repeated[i];
        let holds_cubics = readout.kind >= Kind::Cubic;
        if holds_cubics && !is_told(4) && !is_told(5) { Kind::Affine } else { Kind::CubicPerChannel }
    }

    /// The effects as text of a readout of which no parameter is far enough from its absence to be more than a chance.
    pub(crate) fn texts_not_told(&self, readout: &Readout) -> Vec<EffectId> {
        let absent = |(at, (id, values)): (usize, &(EffectId, Values<f64>))| {
            let own = &self.readout[LIBRARY_VALUES + at * MAX_PARAMETERS..];
            let parameters = id.description().parameters.iter().zip(values).zip(own);
            let told =
                |((p, value), deviation): ((&Parameter, &f64), &f64)| (value - p.neutral).abs() > NO_CHANCE * deviation;
            (!parameters.into_iter().any(told)).then_some(*id)
        };
        readout.texts.iter().enumerate().filter_map(absent).collect()
    }
}

/// A fit without one block: the readout, where there is one, and the table.
type Refit = (Option<Readout>, TableFit);

/// Values of a readout: those of the library ([`LibraryReadout::values`]), and after them those of its effects as text.
pub(crate) fn values(readout: &Readout) -> Vec<f64> {
    let texts = readout.texts.iter().flat_map(|(_, values)| values);
    LibraryReadout::from(readout).values().iter().chain(texts).copied().collect()
}

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
            Some((readout, table))
        })
        .collect();
    let of = |value: &dyn Fn(&Refit) -> f64| jackknife(&fits.iter().map(value).collect::<Vec<_>>());
    let count = model.front().map_or(0, |r| values(r).len());
    let readout = |i: usize| of(&|f| f.0.as_ref().map_or(0.0, |r| values(r)[i]));
    let order = model.table.table.cos.len();
    let mut held = held_by_table(model).to_vec();
    held.extend(of_texts_held_by_table(model, runs));
    let in_radius = held_by_radius(model, runs).to_vec();
    let others = [noise_model_difference(model, runs).to_vec(), weighting_difference(model, runs), held, in_radius];
    let beyond = |i: usize| {
        others.iter().fold(0.0, |sum: f64, other| sum.hypot(other.get(i).copied().unwrap_or(0.0))) / STUDENT_19
    };
    Deviations {
        readout: (0..count).map(|i| readout(i).hypot(beyond(i))).collect(),
        repeated: (0..count).map(readout).collect(),
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
fn weighting_difference(model: &SensorModel, runs: &[SensorRun]) -> Vec<f64> {
    let Some((ours, weighting)) = &model.readout else { return Vec::new() };
    if model.by_radius || ours.kind == Kind::Plain || *weighting == Weighting::VarianceComponents {
        return Vec::new();
    }
    let theirs = fit(ours.kind, Weighting::VarianceComponents, runs, model.sensor.gain, ours);
    let ours = values(ours);
    theirs.map_or_else(
        || vec![f64::INFINITY; ours.len()],
        |theirs| ours.iter().zip(values(&theirs.readout)).map(|(ours, theirs)| ours - theirs).collect(),
    )
}

/// What a table beside effects as text may hold of their parameters: its projection on what a unit of a parameter does to
/// the angle.
fn of_texts_held_by_table(model: &SensorModel, runs: &[SensorRun]) -> Vec<f64> {
    let Some(readout) = model.front() else { return Vec::new() };
    let (table, cycles) = (&model.table.table, model.sensor.cycles);
    let errors = |r: &Readout| {
        let samples = model.sensor.samples(runs, Some(r));
        by_run(&samples, runs.len(), |s| s.error).concat()
    };
    let samples = model.sensor.samples(runs, Some(readout));
    let held = by_run(&samples, runs.len(), |s| table.undo(s.theta, cycles) - s.theta).concat();
    let base = errors(readout);
    let of_parameter = |at: usize, i: usize| {
        let mut moved = readout.clone();
        let unknown = Unknown::Text(at, i);
        moved.set(unknown, readout.value(unknown) + NUDGE);
        let by = moved.texts[at].1[i] - readout.texts[at].1[i];
        let does: Vec<f64> = errors(&moved).iter().zip(&base).map(|(moved, base)| (moved - base) / by).collect();
        let square: f64 = does.iter().map(|d| d * d).sum();
        let along: f64 = does.iter().zip(&held).map(|(d, h)| d * h).sum();
        if square > 0.0 { along / square } else { 0.0 }
    };
    let of_text = |(at, (id, _)): (usize, &(EffectId, Values<f64>))| -> [f64; MAX_PARAMETERS] {
        let parameters = id.description().parameters.len();
        std::array::from_fn(|i| if i < parameters { of_parameter(at, i) } else { 0.0 })
    };
    readout.texts.iter().enumerate().flat_map(of_text).collect()
}

/// What a table beside the readout may hold of its parameters: nothing where the radius alone told them.
fn held_by_table(model: &SensorModel) -> [f64; 6] {
    if model.by_radius {
        return [0.0; 6];
    }
    let table = &model.table.table;
    let harmonic = |n: usize| {
        let [cos, sin] = [&table.cos, &table.sin].map(|v| v.get(n - 1).copied().unwrap_or(0.0));
        cos.hypot(sin)
    };
    held_by(model, OF_A_READOUT.map(harmonic))
}

/// What the radius still holds of the parameters of a readout that the angle told: an eccentric shaft is in the angle as an offset
/// is and not in the radius, and the difference is what the offset may be off by.
fn held_by_radius(model: &SensorModel, runs: &[SensorRun]) -> [f64; 6] {
    let Some(readout) = model.front() else { return [0.0; 6] };
    let mut equations = NormalEquations::new(2 * OF_A_READOUT.len());
    for run in runs {
        let readings = run.channels().into_iter().flatten().filter(|z| !readout.rails.clips(**z));
        for (z, left) in readings.zip(ln_radius(run, readout)) {
            let theta = readout.angle(*z);
            let row: Vec<f64> =
                OF_A_READOUT.iter().flat_map(|n| <[f64; 2]>::from((*n as f64 * theta).sin_cos())).collect();
            equations.add(&row, left);
        }
    }
    let x = equations.solve();
    held_by(model, std::array::from_fn(|i| x[2 * i].hypot(x[2 * i + 1])))
}

/// The parameters of a readout that make harmonics 1, 2 and 4 of this size, of the angle or of the logarithm of the radius: offsets
/// make a harmonic 1, gain and skew a harmonic 2, cubics a harmonic 4 (and, of the channels' difference, a 2).
fn held_by(model: &SensorModel, [first, second, fourth]: [f64; 3]) -> [f64; 6] {
    let Some(readout) = model.front().filter(|r| r.kind != Kind::Plain) else { return [0.0; 6] };
    let LibraryReadout { gain_ratio, amplitude, .. } = LibraryReadout::from(readout);
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
