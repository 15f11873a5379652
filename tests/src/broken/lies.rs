//! No confident lie: small random campaigns with known values, damaged at random. An answer whose 99.9 % interval misses by
//! more than its width is a lie.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use cvg_calibration::recording::{Campaign, Instrument, Recording};
use cvg_calibration::report::{EffectReport, Estimate};
use cvg_calibration::{Options, identify};

use super::damages::{DAMAGES, Damage, Shows};
use super::{Made, RATIO, Told, campaign};
use crate::bench::Draws;

/// An interval that is narrower than this is none of a measurement.
const NARROWEST: f64 = 1e-9;

/// What a report says of a sound campaign as well: of what it has no runs for, and not of what is wrong with those it has.
const ROUTINE: &[&str] = &[
    "the campaign cannot tell the",
    "is confounded with",
    "the reference was commanded and not measured",
    "are separated by a run that no other bears out",
    "samples were set aside as spikes",
    "sample was set aside as a spike",
];

/// Rows of a run: more of them take longer and show no more.
const MOST_ROWS: f64 = 4000.0;

/// Which runs of a campaign are damaged.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Whose {
    None,
    One(usize),
    All,
}

/// A campaign as it was drawn.
struct Drawn {
    campaign: Campaign,
    angular_gain: f64,
    damage: Option<&'static Damage>,
    what: String,
}

/// What became of a campaign.
#[derive(Debug)]
pub struct Outcome {
    /// what was done to it
    pub damage: &'static str,
    /// an answer came out
    pub is_answered: bool,
    /// an interval of the answer misses by more than its width
    pub is_lie: bool,
    /// the report warns of nothing that a sound campaign's does not
    pub is_silent: bool,
    /// the campaign and its answer, in words
    pub what: String,
}

/// Draws a campaign: `seed` is that of its noise.
fn drawn(mut draw: Draws, seed: u64) -> Drawn {
    let hz = [2.0, 5.0, 20.0, 100.0, 100.0, 100.0, 250.0][draw.below(7)];
    let is_sensor = draw.below(4) == 0;
    let angular_gain = if is_sensor { 1.0 } else { draw.between(0.3, 0.95) };
    let runs = 1 + draw.below(4);
    let noise_v = draw.scale(1e-6, 1e-3);
    let reference = [Told::Rate, Told::Rate, Told::Table, Told::Both][draw.below(4)];
    let wanted = std::env::var("CVG_DAMAGE").ok();
    let whose = match draw.below(5) {
        0 if wanted.is_none() => Whose::None,
        1 => Whose::All,
        _ => Whose::One(draw.below(runs)),
    };
    // what shows beside sound runs only is done to one of several
    let shows = |d: &Damage| d.shows == Shows::Alone || (runs > 1 && whose != Whose::All);
    let damages: Vec<&Damage> = DAMAGES.iter().filter(|d| wanted.as_ref().is_none_or(|w| d.name.contains(w))).collect();
    let damage = if damages.iter().any(|d| shows(d)) {
        std::iter::repeat_with(|| damages[draw.below(damages.len())]).find(|d| shows(d))
    } else {
        None
    };
    let damage = damage.filter(|_| whose != Whose::None);
    let name = damage.map_or("nothing", |d| d.name);
    let kind = if is_sensor { "sensor" } else { "gyroscope" };
    let mut what = format!(
        "#{seed}: {kind}, k = {angular_gain:.5}, {hz} Hz, {reference:?}, noise {noise_v:.1e}, {name} of {whose:?}"
    );
    let recording = |i: usize| -> Recording {
        let sign = if draw.below(2) == 0 { 1.0 } else { -1.0 };
        let rate_dps = sign * draw.scale(30.0, 600.0);
        let swings = if draw.below(4) == 0 { 1.0 } else { 0.0 };
        let turns_s = if swings > 0.0 { 3000.0 } else { 2000.0 } / rate_dps.abs();
        let duration_s = f64::max(800.0 / hz, turns_s);
        let made = Made {
            rate_dps,
            duration_s,
            sample_hz: hz.min(MOST_ROWS / duration_s),
            angular_gain,
            noise_v,
            seed: seed.wrapping_mul(10).wrapping_add(i as u64),
            swings,
            reference,
            is_sensor,
        };
        what.push_str(&format!("; {rate_dps:.0} dps × {swings}"));
        match damage {
            Some(damage) if whose == Whose::All || whose == Whose::One(i) => (damage.of)(&made, &mut draw),
            _ => made.recording(),
        }
    };
    let mut campaign = campaign((0..runs).map(recording).collect());
    if is_sensor {
        (campaign.instrument, campaign.angular_gain, campaign.period_deg) =
            (Instrument::Sensor, Some(1.0), Some(360.0));
    }
    Drawn { campaign, angular_gain, damage, what }
}

/// The 99.9 % interval is 1.68 times that of 95 %; a lie misses it by more than its width.
fn off(e: Estimate, by: f64) -> bool {
    (e.value - by).abs() > 3.0 * 1.68 * e.half_width() + NARROWEST
}

/// What becomes of campaign `number`.
pub fn of_number(number: u64) -> Outcome {
    outcome(drawn(Draws::new(1_000_000 + number), number))
}

/// What becomes of the campaign of which each of the first draws is what two bytes say.
pub fn of_bytes(bytes: &[u8]) -> Outcome {
    let mut seed = DefaultHasher::new();
    bytes.hash(&mut seed);
    let seed = seed.finish();
    outcome(drawn(Draws::scripted(bytes, seed), seed))
}

fn outcome(drawn: Drawn) -> Outcome {
    let Drawn { campaign, angular_gain, damage, what } = drawn;
    let damage = damage.map_or("nothing", |d| d.name);
    match identify(campaign, &Options::default()) {
        Err(refusal) => {
            Outcome { damage, is_answered: false, is_lie: false, is_silent: false, what: format!("{what}: {refusal}") }
        }
        Ok(identified) => {
            let r = &identified.report;
            let ratio = r.detection_gain_ratio;
            let is_lie = off(r.angular_gain, angular_gain) || ratio.is_some_and(|e| off(e, RATIO));
            let is_silent = r.warnings.iter().all(|w| ROUTINE.iter().any(|said| w.contains(said)));
            let parameters = |e: &EffectReport| e.parameters.iter().map(|p| p.value).collect::<Vec<_>>();
            let effects: Vec<String> =
                r.effects.iter().map(|e| format!("{} {:?} {:?}", e.id, e.origin, parameters(e))).collect();
            let what = format!(
                "{what}: k {:?}, ratio {ratio:?}, {effects:?}, {:?}, {:#?}",
                r.angular_gain, r.heldout.discovered, r.warnings
            );
            Outcome { damage, is_answered: true, is_lie, is_silent, what }
        }
    }
}
