//! What is known of a sensor before any fit: the period of its angle, its angular gain and its sense.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

use super::readout::Readout;
use super::samples::{Reading, SensorRun};
use super::table_fit::Sample;
use super::units::{COUNTS, UNITS, Unit, by_gain, or_smaller};
use crate::error::Refusal;
use crate::numerics::angles::{followed, wrapped};
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{circular_mean, line, median, root_mean_square, span};

/// A sensor that is bolted to its reference has a whole number of periods a turn: an estimate this close to one is one, and one
/// up to so far from it where errors of the position could have made the difference: where the slope beside them is told as well as is close,
/// and is this close; or where it is not, and that beside errors once and twice a turn could be whole, or the line leaves so many times as
/// much as the whole number would be off by: an eccentricity makes a third of that on three quarters of a turn, at worst.
const WHOLE: f64 = 0.02;
const WHOLE_BESIDE_ERRORS: f64 = 0.05;
const FARTHEST_FROM_WHOLE: f64 = 0.3;
const WHOLE_SLOPE: f64 = 0.01;
const FARTHEST_WHERE_NOT_TOLD: f64 = 0.1;
const LEAST_LEFT_BY_A_LINE: f64 = 1.5;
/// Standard errors within which a slope is what it could be (95 %).
const BY_CHANCE: f64 = 2.0;
/// Harmonics of the position beside a slope, and rows for each where there are more.
const FEWEST_HARMONICS: usize = 2;
const MOST_HARMONICS: usize = 12;
const ROWS_PER_HARMONIC: usize = 8;
/// Rows beyond which every so many tell a slope.
const ENOUGH_ROWS: usize = 4000;
/// Samples whose circular mean begins the unwrapping of an error.
const BEGINNING: usize = 50;

/// Rows so many periods apart may have gone the other way between them; of a sensor with several periods a turn, of which others have
/// ten times as many, rows so many apart may have turned by one more (at even steps the next gain is 1/step − 1 times this one).
/// Other gains are tried up to so many periods between rows, and fit alike where they leave up to so many times as much.
const COARSE: f64 = 0.25;
const COARSE_OF_SEVERAL: f64 = 1.0 / 11.0;
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
                    "a reference in degrees; angular_gain or pole_pairs in campaign.toml, or rows less than {:.0}° apart",
                    0.5 * period.to_degrees()
                ),
            ));
        }
        let size = stated_gain.unwrap_or_else(|| magnitude(runs, period)).abs();
        let near = |reach: f64| (size - size.round()).abs() < reach && size > 0.5;
        let whole = match stated_gain {
            Some(_) => near(1e-9),
            None => near(WHOLE) || is_whole_beside_errors(size, runs, period),
        };
        let size = if whole { size.round() } else { size };
        let sensor = Self { gain: size, free_gain: !whole, period, cycles: TAU / period };
        let opposite = sensor.misfit(runs, -size) < sensor.misfit(runs, size);
        Ok(if opposite { Self { gain: -size, ..sensor } } else { sensor })
    }

    /// The angular gains, by periods between two rows, that fit about as well as this one: where the rows stand evenly, and so
    /// far apart that they do not show which way the angle went between them.
    fn aliases(&self, runs: &[SensorRun]) -> Vec<f64> {
        let step = coarsest_step(runs);
        let coarse = if self.gain.abs() < 1.5 { COARSE } else { COARSE_OF_SEVERAL };
        if step * self.gain.abs() < coarse * self.period {
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
        if let Some(other) = or_smaller(gain, runs) {
            return Ok(Some(other));
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

    /// A sensor of this gain, taken as exact.
    pub(super) fn of_gain(gain: f64, period: f64) -> Self {
        Self { gain, free_gain: false, period, cycles: TAU / period }
    }

    /// How badly a signed gain fits, for telling the sense.
    pub(super) fn misfit(&self, runs: &[SensorRun], gain: f64) -> f64 {
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
    let units = [&UNITS[..], &RATES[..], &COUNTS[..]].concat();
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
    longest(runs, period).map_or(1.0, |(reference, followed)| line(reference, &followed).0.abs())
}

/// Reference and followed angle of the run that turns the furthest.
fn longest(runs: &[SensorRun], period: f64) -> Option<(&[f64], Vec<f64>)> {
    let longest = runs.iter().max_by(|a, b| a.travel_rad().total_cmp(&b.travel_rad()))?;
    let theta: Vec<f64> = match &longest.reading {
        Reading::Angle(theta) => theta.clone(),
        Reading::Channels(v) => {
            let start = super::ellipse::algebraic(std::slice::from_ref(longest)).unwrap_or_else(Readout::plain);
            v.iter().map(|z| start.angle(*z)).collect()
        }
    };
    Some((&longest.reference_rad, followed(&theta, &longest.reference_rad, period)))
}

/// Whether |gain|, which a line alone says is `size`, could be the whole number next to it: by the slope of the followed angle beside errors
/// of the position, which a line takes a share of where the reference turns little more than once.
fn is_whole_beside_errors(size: f64, runs: &[SensorRun], period: f64) -> bool {
    let whole = size.round();
    let off = (size - whole).abs();
    let Some((reference, followed)) = longest(runs, period).filter(|_| size > 0.5 && off < FARTHEST_FROM_WHOLE) else {
        return false;
    };
    let beside = |harmonics: usize| slope_beside_errors(reference, &followed, harmonics);
    let Some((slope, deviation)) = beside(MOST_HARMONICS) else { return false };
    if BY_CHANCE * deviation < WHOLE {
        return (slope - whole).abs() < WHOLE_SLOPE.max(BY_CHANCE * deviation);
    }
    let is_by_chance = |(slope, deviation): (f64, f64)| (slope - whole).abs() <= BY_CHANCE * deviation;
    let could_be = || beside(FEWEST_HARMONICS).is_some_and(is_by_chance);
    let tilt = off * span(reference) / 12f64.sqrt();
    (off < WHOLE_BESIDE_ERRORS && could_be())
        || (off < FARTHEST_WHERE_NOT_TOLD && left_by_a_line(reference, &followed) > LEAST_LEFT_BY_A_LINE * tilt)
}

/// What a line leaves of the followed angle, rad rms.
fn left_by_a_line(reference: &[f64], followed: &[f64]) -> f64 {
    let (slope, start) = line(reference, followed);
    root_mean_square(&reference.iter().zip(followed).map(|(a, f)| f - start - slope * a).collect::<Vec<_>>())
}

/// The slope of the followed angle beside so many harmonics of the position, or as many as the rows carry, and its deviation.
fn slope_beside_errors(reference: &[f64], followed: &[f64], most: usize) -> Option<(f64, f64)> {
    let begin = reference.first().copied()?;
    let stride = reference.len().div_ceil(ENOUGH_ROWS);
    let harmonics = (reference.len() / stride / ROWS_PER_HARMONIC).min(most).max(FEWEST_HARMONICS);
    let unknowns = 2 + 2 * harmonics;
    let row = |a: f64| {
        let of = |n: usize| <[f64; 2]>::from((n as f64 * a).sin_cos());
        DVector::from_iterator(unknowns, [a - begin, 1.0].into_iter().chain((1..=harmonics).flat_map(of)))
    };
    let rows: Vec<DVector<f64>> = reference.iter().step_by(stride).map(|a| row(*a)).collect();
    let followed: Vec<f64> = followed.iter().copied().step_by(stride).collect();
    let mut normal = DMatrix::zeros(unknowns, unknowns);
    rows.iter().for_each(|r| normal.ger(1.0, r, r, 1.0));
    let right: DVector<f64> = rows.iter().zip(&followed).map(|(r, f)| r * *f).sum();
    let inverse = normal.try_inverse().filter(|_| rows.len() > unknowns)?;
    let x = &inverse * right;
    let left: f64 = rows.iter().zip(&followed).map(|(r, f)| (f - r.dot(&x)).powi(2)).sum();
    let deviation = (left / (rows.len() - unknowns) as f64 * inverse[(0, 0)]).max(0.0).sqrt();
    Some((x[0].abs(), deviation))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::recording::Role;

    /// Stations over one turn, with an error of 4.6° once a turn and noise of 0.5°.
    fn stations(gain: f64) -> Vec<SensorRun> {
        let reference_rad: Vec<f64> = (0..40).map(|i| f64::from(i) * 9.0_f64.to_radians()).collect();
        let noise = crate::numerics::statistics::remembered(0.0, reference_rad.len(), 7);
        let of = |(a, noise): (&f64, &f64)| gain * a + 0.08 * a.sin() + 0.009 * noise;
        let theta = reference_rad.iter().zip(&noise).map(of).collect();
        let (none, t_s) = (vec![0.0; reference_rad.len()], (0..40).map(f64::from).collect());
        vec![SensorRun {
            name: "dial.csv".into(),
            number: 0,
            role: Role::Fit,
            commanded: false,
            t_s,
            reference_rad,
            rate_rad_s: none.clone(),
            acceleration_rad_s2: none,
            temp_c: None,
            recorded: None,
            reading: Reading::Angle(theta),
        }]
    }

    #[test]
    fn four_periods_at_even_steps_may_be_sixty_four_and_one_is_one() {
        let said = |gain: f64, step_deg: f64| {
            let mut runs = stations(gain);
            let run = &mut runs[0];
            run.reference_rad = (0..40).map(|i| (f64::from(i) * step_deg).to_radians()).collect();
            run.reading = Reading::Angle(run.reference_rad.iter().map(|a| gain * a).collect());
            Sensor::new(None, TAU, &runs).and_then(|s| s.doubts(false, &runs)).expect("a whole number")
        };
        // 64 periods at 18° a row: 72° of the angle from row to row, and so are 4 the other way
        let aliased = said(64.0, 18.0).expect("a doubt");
        assert!(aliased.contains("4 periods a turn and 16.00 look alike"), "{aliased}");
        assert_eq!(said(4.0, 2.0), None);
        assert_eq!(said(1.0, 18.0), None);
    }

    #[test]
    fn an_error_once_a_turn_does_not_make_a_gear_of_a_sensor() {
        let runs = stations(-1.0);
        assert!((magnitude(&runs, TAU) - 1.0).abs() > WHOLE, "the line takes its share of the error");
        let sensor = Sensor::new(None, TAU, &runs).expect("a sensor");
        assert_eq!((sensor.gain, sensor.free_gain), (-1.0, false));
    }

    #[test]
    fn a_gear_that_is_nearly_whole_stays_a_gear() {
        let runs = stations(0.98);
        assert!((magnitude(&runs, TAU) - 1.0).abs() < WHOLE_BESIDE_ERRORS, "near enough to be asked about");
        let sensor = Sensor::new(None, TAU, &runs).expect("a sensor");
        assert!(sensor.free_gain, "{sensor:?}");
    }
}
