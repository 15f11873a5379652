//! Two channels of which only what their reference was asked to do is known: the readout is told by the radius alone, and what repeats of the
//! angle against the command is the sensor's or the drive's. It is taken off on these data, and no calibration has it.

use super::circle;
use super::cross_validation::{Candidate, Folds, Tolerance, choose, losses_of_radius};
use super::ellipse;
use super::model::{Outcome, SensorModel};
use super::rails::Rails;
use super::readout::{Competing, Kind, Readout};
use super::readout_fit::{Weighting, fit};
use super::samples::{Reading, SensorRun};
use super::sensor::Sensor;
use super::table_fit::{Motion, Shape, TableFit};
use crate::error::Refusal;

/// What an ellipse may leave of the radius, rms, where nothing else tells the readout: engineering choice.
const LARGEST_RADIUS_ERROR: f64 = 0.25;

/// The readout from the radius alone, and beside it what repeats against the command, where a command's positions are `asked` for.
///
/// # Errors
/// Where the channels draw no ellipse, or the angle cannot be followed.
pub(super) fn identify(sensor: Sensor, runs: &[SensorRun], asked: &[f64]) -> Result<SensorModel, Refusal> {
    let sensor = Sensor { free_gain: false, ..sensor };
    let (readout, of_radius) = by_radius(sensor, runs)?;
    let repeats = repeats_against_the_command(sensor, runs, &readout, asked);
    let shape = repeats.unwrap_or_else(|| Shape::constant(false));
    let samples = sensor.samples(runs, Some(&readout));
    let table = TableFit::new(&shape, &samples, runs.len(), sensor.cycles)
        .ok_or_else(|| refuse("the angle cannot be followed".into()))?;
    Ok(SensorModel {
        sensor,
        outcome: Outcome::Answered,
        readout: Some((readout, Weighting::Radius)),
        table,
        predicted: of_radius,
        predicted_raw: None,
        by_radius: true,
        tells_motion: false,
    })
}

fn refuse(what: String) -> Refusal {
    Refusal::no_answer("campaign", what, "two channels that draw an ellipse")
}

/// The readout by which the radius is most constant, and what it leaves of that in rows that were not fitted, as a share of it, rms.
fn by_radius(sensor: Sensor, runs: &[SensorRun]) -> Result<(Readout, f64), Refusal> {
    let rails = Rails::of(runs.iter().filter_map(SensorRun::channels).flatten());
    let start = ellipse::algebraic(runs).ok_or_else(|| refuse("the channels draw no ellipse".into()))?;
    let start = Readout { rails, ..start };
    let folds = Folds::interleaved(runs);
    let candidates: Vec<Candidate<Kind>> = [Kind::Offset, Kind::Affine]
        .into_iter()
        .filter_map(|kind| {
            let without = |fold: usize| {
                let kept = folds.without(runs, fold);
                fit(kind, Weighting::Radius, &kept, sensor.gain, &start).map(|f| f.readout)
            };
            let losses = losses_of_radius(without, &folds, runs)?;
            Some(Candidate { size: kind.free().len(), texts: 0, model: kind, losses, of_radius: None })
        })
        .collect();
    let chosen = choose(&candidates, Tolerance::One).ok_or_else(|| refuse("no ellipse fits the channels".into()))?;
    if chosen.losses.rms() > LARGEST_RADIUS_ERROR {
        return Err(refuse(format!("the best ellipse leaves {:.2} of the radius", chosen.losses.rms())));
    }
    let fitted = fit(chosen.model, Weighting::Radius, runs, sensor.gain, &start);
    let readout = fitted.ok_or_else(|| refuse("no ellipse fits the channels".into()))?.readout;
    if let Some(what) = circle::said_of(&sensor, runs) {
        return Err(Refusal::no_answer("campaign", what, "the channels as they were converted"));
    }
    Ok((readout, chosen.losses.rms()))
}

/// The shape of what the angle that this readout makes repeats against the command, as of a sensor that reads its angle; none where
/// nothing does, or what does may be a memory of the noise.
fn repeats_against_the_command(sensor: Sensor, runs: &[SensorRun], readout: &Readout, asked: &[f64]) -> Option<Shape> {
    let angles = |run: &SensorRun| {
        let channels = run.channels()?;
        Some(SensorRun { reading: Reading::Angle(channels.iter().map(|z| readout.angle(*z)).collect()), ..run.clone() })
    };
    let read: Vec<SensorRun> = runs.iter().filter_map(angles).collect();
    let model = SensorModel::chosen(sensor, &read, Competing::with(&[]), asked).ok()?;
    // how the angle follows a command's motion is the drive's
    let told = model.outcome == Outcome::Answered && model.table.shape.motion == Motion::None;
    Some(model.table.shape).filter(|shape| told && shape.size() > 0)
}
