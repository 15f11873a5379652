//! Whether recordings look like another kind of instrument than the campaign says: a sensor given as a gyroscope, or the
//! reverse.

use super::reference_free::full_turn_gain;
use crate::recording::{Campaign, Instrument, RunKind};

/// A sensor that is bolted to its table turns a whole number of times a turn: within this share of one.
const WHOLE: f64 = 0.01;

/// What to try where the recordings look like another kind of instrument.
pub fn hint(campaign: &Campaign) -> Option<&'static str> {
    match campaign.instrument {
        Instrument::Gyroscope => looks_like_a_sensor(campaign).then_some(
            "two channels without a quadrature part, which go round a whole number of times a turn, look like a sin/cos \
             sensor: --sensor, or instrument = \"sensor\" in campaign.toml",
        ),
        Instrument::Sensor => looks_like_a_gyroscope(campaign).then_some(
            "xs_v and ys_v that are not zero, or outputs of controllers, look like a gyroscope: without --sensor, or \
             instrument = \"gyroscope\" in campaign.toml",
        ),
    }
}

fn looks_like_a_gyroscope(campaign: &Campaign) -> bool {
    let moves = |v: &Option<Vec<f64>>| v.as_ref().is_some_and(|v| v.iter().any(|x| x.is_finite() && *x != 0.0));
    campaign.runs.iter().any(|r| {
        let r = &r.recording;
        (moves(&r.xs_v) && moves(&r.ys_v)) || (moves(&r.vas_v) && moves(&r.vqc_v))
    })
}

/// Two channels and no more in every run, whose direction goes round a whole number of times a turn of the reference.
fn looks_like_a_sensor(campaign: &Campaign) -> bool {
    let turning: Vec<_> = campaign.runs.iter().filter(|r| r.kind == RunKind::Rotation).collect();
    !turning.is_empty()
        && campaign.runs.len() == turning.len()
        && !looks_like_a_gyroscope(campaign)
        && turning.iter().all(|r| {
            full_turn_gain(r).is_some_and(|gain| {
                let whole = gain.abs().round();
                whole >= 1.0 && (gain.abs() - whole).abs() < WHOLE * whole
            })
        })
}
