//! Passes of the filter over the recordings: coarse ones first, then as many as it takes until nothing moves.

use cvg_calibrator::Settings;
use cvg_calibrator::replay::{Innovations, Learning, Replay};

use super::runs::Part;
use crate::error::Refusal;

/// What was not predicted, cycle by cycle: amplitude, angle, ellipticity.
pub(crate) type Left = Vec<Innovations<f64>>;

/// Stages before the last, each linearised anew.
const STAGES: [u8; 4] = [0, 1, 2, 3];
const LAST: u8 = 4;
/// The most passes of the last stage.
const MOST: usize = 16;
/// Nothing moves by more than this, standard deviations.
const STILL: f64 = 0.1;
/// Cycles over which noise may remember.
const MEMORY: usize = 100;
/// Cycles that tell a variance.
const ENOUGH: usize = 2 * MEMORY;
/// Channels of the filter.
pub(crate) const CHANNELS: [&str; 3] = ["amplitude", "angle", "ellipticity"];

/// What recordings that cannot be followed lack, most often.
pub(crate) const WANTED: &str = "loops that have settled (settle_s), readout and commands in volts with the signs documented, \
                                 drive_per_s_v in [campaign]";

/// Walks parts of runs once.
pub(crate) fn walk(replay: &mut Replay<f64>, parts: &[Part<'_>], stage: u8, learning: Learning) -> Left {
    replay.begin(stage, learning);
    let mut left = Vec::new();
    for part in parts {
        replay.interrupt();
        for row in &part.run.rows[part.rows.clone()] {
            if !row.follows {
                replay.interrupt();
            }
            left.extend(replay.row(&row.seen, &row.forces));
        }
    }
    left
}

/// Learns from parts of runs until nothing moves any more.
///
/// # Errors
/// Recordings that no instrument made.
pub(crate) fn learn(settings: &Settings, hold_s: f64, parts: &[Part<'_>]) -> Result<Replay<f64>, Refusal> {
    let refuse = |problem: &str| Refusal::no_answer("campaign", problem, WANTED);
    let mut replay = Replay::new(settings, hold_s).map_err(|e| refuse(&e.to_string()))?;
    let pass = |replay: &mut Replay<f64>, stage| {
        walk(replay, parts, stage, Learning::On);
        replay.relinearise().map_err(|_| refuse("what these recordings tell is no instrument"))
    };
    for stage in STAGES {
        pass(&mut replay, stage)?;
    }
    for _ in 0..MOST {
        let left = walk(&mut replay, parts, LAST, Learning::Off);
        replay.expect([0, 1, 2].map(|channel| level(&left, channel)));
        if pass(&mut replay, LAST)? < STILL {
            return Ok(replay);
        }
    }
    Err(refuse("passes over these recordings do not come to rest"))
}

/// The density of what was not predicted at low frequencies, as the variance of white noise: at rest or turning, the larger.
fn level(left: &Left, channel: usize) -> f64 {
    [false, true].into_iter().filter_map(|turning| density(left, channel, turning)).fold(f64::NAN, f64::max)
}

fn density(left: &Left, channel: usize, turning: bool) -> Option<f64> {
    let series: Vec<Option<f64>> = left.iter().map(|i| i.of[channel].filter(|_| i.turning == turning)).collect();
    let product = |lag: usize| {
        let pairs = series.iter().zip(&series[lag..]).filter_map(|(a, b)| Some((*a)? * (*b)?));
        let (sum, count) = pairs.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
        (count >= ENOUGH).then(|| sum / count as f64)
    };
    let variance = product(0)?;
    let weight = |lag: usize| 2.0 * (1.0 - lag as f64 / (MEMORY + 1) as f64);
    let memory: f64 = (1..=MEMORY).filter_map(|lag| Some(weight(lag) * product(lag)?)).sum();
    Some((variance + memory).max(variance))
}

/// Root mean square of a channel, and how many cycles count.
pub(crate) fn rms(left: &Left, channel: usize) -> (f64, usize) {
    let of = left.iter().filter_map(|i| i.of[channel]);
    let (sum, count) = of.fold((0.0, 0usize), |(s, n), v| (s + v * v, n + 1));
    ((sum / count.max(1) as f64).sqrt(), count)
}

/// The white part of a channel: half the mean square of its differences, rms.
pub(crate) fn white(left: &Left, channel: usize) -> f64 {
    let pairs = left.windows(2).filter_map(|w| Some(w[1].of[channel]? - w[0].of[channel]?));
    let (sum, count) = pairs.fold((0.0, 0usize), |(s, n), v| (s + v * v, n + 1));
    (0.5 * sum / count.max(1) as f64).sqrt()
}
