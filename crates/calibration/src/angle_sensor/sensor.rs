//! What is known of a sensor before any fit: the period of its angle, its angular gain and its sense.

use std::f64::consts::TAU;

use super::readout::Readout;
use super::samples::{Reading, SensorRun};
use super::table_fit::Sample;
use super::units::{UNITS, Unit, by_gain};
use crate::error::Refusal;
use crate::numerics::angles::wrapped;
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{circular_mean, median};

/// A sensor that is bolted to its reference has a whole number of periods a turn: an estimate this close to one is one.
const WHOLE: f64 = 0.02;
/// Samples whose circular mean begins the unwrapping of an error.
const BEGINNING: usize = 50;

/// Rows so many periods apart may have gone the other way between them; other gains are tried up to so many periods between
/// rows, and fit alike where they leave up to so many times as much.
const COARSE: f64 = 0.25;
const ALIASES: i32 = 3;
const ALIKE: f64 = 1.5;
/// The unit of a rate that makes a whole number of whole periods.
const RATES: [Unit; 1] = [("turns per minute", 6.0)];

/// A sensor as it is taken before its errors are known: θ = gain · reference + constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sensor {
    /// signed angular gain
    pub(crate) gain: f64,
    /// nothing says that the gain is exact: it is adjusted
    pub(crate) free_gain: bool,
    /// period of the angle, rad
    pub(crate) period: f64,
    /// 2π over the period
    pub(crate) cycles: f64,
}

impl Sensor {
    /// The sensor of a campaign: its gain as stated, or as the data has it; the sense always as the data has it.
    ///
    /// # Errors
    /// Where no gain is stated and the rows stand half a period or more apart: any gain that differs by a period between two
    /// rows would do as well.
    pub(crate) fn new(stated_gain: Option<f64>, period: f64, runs: &[SensorRun]) -> Result<Self, Refusal> {
        let step = coarsest_step(runs);
        if stated_gain.is_none() && step >= 0.5 * period {
            return Err(Refusal::no_answer(
                "campaign",
                format!(
                    "the reference turns by {:.0}° from row to row and the angle repeats every {:.0}°, so that many angular \
                     gains fit alike",
                    step.to_degrees(),
                    period.to_degrees()
                ),
                format!(
                    "angular_gain or pole_pairs in campaign.toml, or rows less than {:.0}° apart",
                    0.5 * period.to_degrees()
                ),
            ));
        }
        let size = stated_gain.unwrap_or_else(|| magnitude(runs, period)).abs();
        let whole = (size - size.round()).abs() < if stated_gain.is_some() { 1e-9 } else { WHOLE } && size > 0.5;
        let size = if whole { size.round() } else { size };
        let sensor = Self { gain: size, free_gain: !whole, period, cycles: TAU / period };
        let opposite = sensor.misfit(runs, -size) < sensor.misfit(runs, size);
        Ok(if opposite { Self { gain: -size, ..sensor } } else { sensor })
    }

    /// The angular gains, by periods between two rows, that fit about as well as this one: where the rows stand evenly, and so
    /// far apart that they do not show which way the angle went between them.
    fn aliases(&self, runs: &[SensorRun]) -> Vec<f64> {
        let step = coarsest_step(runs);
        if step * self.gain.abs() < COARSE * self.period {
            return Vec::new();
        }
        let most = ALIKE * self.misfit(runs, self.gain);
        let others = (-ALIASES..=ALIASES).filter(|n| *n != 0).map(|n| self.gain + f64::from(n) * self.period / step);
        others.filter(|gain| self.misfit(runs, *gain) <= most).collect()
    }

    /// What has to be said of a gain that the data alone say: a sensor that is bolted to its reference has a whole number of
    /// periods a turn.
    ///
    /// # Errors
    /// Where it has none, and a whole number fits as well.
    pub(crate) fn doubts(&self, rates_alone: bool, runs: &[SensorRun]) -> Result<Option<String>, Refusal> {
        let (gain, aliases) = (self.gain.abs(), self.aliases(runs));
        let nearest = |gains: &mut dyn Iterator<Item = f64>| gains.min_by(|a, b| a.abs().total_cmp(&b.abs()));
        let is_whole = |gain: &f64| (gain - gain.round()).abs() < WHOLE && gain.abs() > 0.5;
        if self.free_gain
            && let Some(whole) = nearest(&mut aliases.iter().copied().filter(is_whole))
        {
            return Err(Refusal::no_answer(
                "campaign",
                format!(
                    "the angle turns by {:.0}° from row to row at an even speed: {gain:.4} periods a turn fit, and {:.0} as well",
                    (coarsest_step(runs) * gain).to_degrees(),
                    whole.abs()
                ),
                format!("pole_pairs in campaign.toml, or rows less than {:.0}° of the angle apart", 90.0),
            ));
        }
        if self.free_gain {
            let angle = runs.iter().any(|run| run.channels().is_none());
            let unit =
                by_gain(gain, &UNITS, angle).map_or_else(|| "the reference is in another unit".into(), |u| u.said());
            return Ok(Some(format!(
                "{gain:.4} periods a turn is no whole number: {unit}, or there is a gear between them, which angular_gain in \
                 campaign.toml states"
            )));
        }
        if let Some(other) = nearest(&mut aliases.iter().copied()) {
            return Ok(Some(format!(
                "the angle turns by {:.0}° from row to row at an even speed, so that {gain:.0} periods a turn and {:.2} look alike: \
                 the smaller was taken, and its sense; pole_pairs and angular_gain in campaign.toml state them",
                (coarsest_step(runs) * gain).to_degrees(),
                other.abs()
            )));
        }
        Ok(by_gain(gain, &RATES, false).filter(|_| rates_alone).map(|unit| {
            let unit = unit.said();
            format!("{gain:.0} periods a turn were taken from rate_dps alone; or {unit}: table_deg, or pole_pairs, would tell")
        }))
    }

    /// Harmonics of the angle per turn of the reference.
    pub(crate) fn cycles_per_turn(&self) -> f64 {
        self.cycles * self.gain.abs()
    }

    /// How badly a signed gain fits, for telling the sense.
    fn misfit(&self, runs: &[SensorRun], gain: f64) -> f64 {
        runs.iter()
            .map(|r| match &r.reading {
                Reading::Angle(theta) => {
                    let (c, s) = theta.iter().zip(&r.reference_rad).fold((0.0, 0.0), |(c, s), (t, a)| {
                        let (sin, cos) = (self.cycles * (t - gain * a)).sin_cos();
                        (c + cos, s + sin)
                    });
                    r.len() as f64 - c.hypot(s)
                }
                Reading::Channels(v) => turning_left(v, &r.reference_rad, gain),
            })
            .sum()
    }

    /// Samples of all runs, one after the other, with the readout undone.
    pub(crate) fn samples(&self, runs: &[SensorRun], readout: Option<&Readout>) -> Vec<Sample> {
        let plain = Readout::plain();
        let readout = readout.unwrap_or(&plain);
        let mut out = Vec::with_capacity(runs.iter().map(SensorRun::len).sum());
        for (run, r) in runs.iter().enumerate() {
            let theta: Vec<f64> = match &r.reading {
                Reading::Angle(theta) => theta.clone(),
                Reading::Channels(v) => v.iter().map(|z| readout.angle(*z)).collect(),
            };
            let raw: Vec<f64> = theta.iter().zip(&r.reference_rad).map(|(t, a)| t - self.gain * a).collect();
            let error = centred(&raw, self.period);
            out.extend((0..r.len()).map(|i| Sample {
                theta: theta[i],
                error: error[i],
                reference: r.reference_rad[i],
                rate: r.rate_rad_s[i],
                acceleration: r.acceleration_rad_s2[i],
                run,
            }));
        }
        out
    }
}

/// What a reference that hardly turns looks like, while the angle goes round: a unit in which it would.
pub(crate) fn other_unit(runs: &[SensorRun], period: f64) -> Option<String> {
    let turns = |run: &SensorRun| magnitude(std::slice::from_ref(run), period) * run.travel_rad() / period;
    let gain = magnitude(runs, period);
    let units = [&UNITS[..], &RATES[..]].concat();
    by_gain(gain, &units, false).filter(|_| runs.iter().any(|run| turns(run) > 1.0)).map(|unit| unit.said())
}

/// An error followed through its period from the circular mean of its first samples on, about its median.
pub(crate) fn centred(raw: &[f64], period: f64) -> Vec<f64> {
    let begin = circular_mean(raw.iter().take(BEGINNING).copied(), period);
    let mut last = 0.0;
    let mut out: Vec<f64> = raw
        .iter()
        .map(|e| {
            last += wrapped(e - begin - last, period);
            last
        })
        .collect();
    let middle = median(&mut out.clone());
    out.iter_mut().for_each(|e| *e -= middle);
    out
}

/// The median step of the reference from row to row in the run where it is the largest, rad.
fn coarsest_step(runs: &[SensorRun]) -> f64 {
    let median_step =
        |r: &SensorRun| median(&mut r.reference_rad.windows(2).map(|w| (w[1] - w[0]).abs()).collect::<Vec<_>>());
    runs.iter().map(median_step).fold(0.0, f64::max)
}

/// What a circle that turns with the reference leaves of both channels.
fn turning_left(channels: &[[f64; 2]], reference: &[f64], gain: f64) -> f64 {
    // x + iy = o + A e^{i g a}: two complex unknowns, as four real ones
    let mut equations = NormalEquations::new(4);
    let rows = |z: &[f64; 2], a: &f64| {
        let (sin, cos) = (gain * a).sin_cos();
        [([1.0, 0.0, cos, -sin], z[0]), ([0.0, 1.0, sin, cos], z[1])]
    };
    for (z, a) in channels.iter().zip(reference) {
        for (row, value) in rows(z, a) {
            equations.add(&row, value);
        }
    }
    let x = equations.solve();
    let left = |(row, value): ([f64; 4], f64)| (value - row.iter().zip(&x).map(|(a, b)| a * b).sum::<f64>()).powi(2);
    channels.iter().zip(reference).flat_map(|(z, a)| rows(z, a)).map(left).sum()
}

/// |gain| where none is stated: the slope of the followed angle over the reference, in the run that turns the furthest.
pub(super) fn magnitude(runs: &[SensorRun], period: f64) -> f64 {
    let Some(longest) = runs.iter().max_by(|a, b| a.travel_rad().total_cmp(&b.travel_rad())) else { return 1.0 };
    let theta: Vec<f64> = match &longest.reading {
        Reading::Angle(theta) => theta.clone(),
        Reading::Channels(v) => {
            let start = super::ellipse::algebraic(std::slice::from_ref(longest)).unwrap_or_else(Readout::plain);
            v.iter().map(|z| start.angle(*z)).collect()
        }
    };
    let followed = crate::numerics::angles::unwrapped(theta.into_iter(), period);
    crate::numerics::statistics::line(&longest.reference_rad, &followed).0.abs()
}
