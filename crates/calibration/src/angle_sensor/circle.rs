//! Channels that draw a circle as recorded. A readout with an error leaves an ellipse, or a bent one, unless its parts cancel
//! in the radius and in nothing else. Where the radius varies far less than a part of a readout by itself would have it vary,
//! the channels were divided by their own amplitude or computed from an angle, or the error of the angle is none of the
//! readout: the radius tells nothing of the readout then, and a fit to it would invent parts that cancel.

use std::f64::consts::FRAC_1_SQRT_2;

use super::readout::{Readout, UNKNOWNS};
use super::readout_fit::centre;
use super::samples::SensorRun;
use super::sensor::Sensor;
use super::table_fit::{Shape, TableFit, by_run};
use crate::numerics::statistics::root_mean_square;

/// A part of a readout shows where the radius varies by this share at least of what the part by itself does to it: engineering
/// choice. Unlike causes cancel to a tenth by chance only, and causes of unlike harmonics not at all.
const SHOWN: f64 = 0.1;
/// With a readout undone the radius may vary by so many times what it does as recorded: engineering choice. One that is right makes it
/// rounder, and one that a few stations' angles ask for is none where the channels say otherwise.
const LESS_ROUND: f64 = 1.5;
/// What a part does to ln radius below this is nothing that matters.
const LEAST: f64 = 1e-7;
/// Harmonics of a readout are most of an error where they leave less than this share of it.
const MOSTLY: f64 = 0.5;
/// An angle that is off by more than this share of its period does not follow the reference.
const LARGEST: f64 = 0.25;
/// Harmonics of the angle that a readout makes: of offsets, of gain and skew, of cubics.
pub(super) const OF_A_READOUT: [usize; 3] = [1, 2, 4];

/// Whether every part of a readout shows in the radius of every run, which all of it leaves no less round.
pub(super) fn shows(readout: &Readout, runs: &[SensorRun]) -> bool {
    let plain = Readout { rails: readout.rails, ..Readout::plain() };
    let parts = parts(readout);
    runs.iter().all(|run| {
        let recorded = ln_radius(run, &plain);
        let varies = root_mean_square(&recorded);
        let left = root_mean_square(&ln_radius(run, readout));
        // in the channels' unit: where offsets exceed the amplitude, what varies is a small share of a large radius
        let [as_recorded, undone] = [&plain, readout].map(|readout| size(run, readout));
        (left <= LEAST || left * undone <= LESS_ROUND * varies * as_recorded)
            && parts.iter().all(|part| {
                let (with_it, own) = (ln_radius(run, part), size(run, part));
                let does: Vec<f64> = with_it.iter().zip(&recorded).map(|(a, b)| a * own - b * as_recorded).collect();
                let does = root_mean_square(&does);
                does <= LEAST * own || SHOWN * does <= varies * as_recorded
            })
    })
}

/// Radius of what is behind a run's readings, geometric mean, in their unit.
fn size(run: &SensorRun, readout: &Readout) -> f64 {
    let all = run.channels().unwrap_or_default();
    let mean = all.iter().map(|z| readout.ln_radius(*z)).sum::<f64>() / all.len().max(1) as f64;
    readout.amplitude * mean.exp()
}

/// The causes in a readout, each by itself: offsets, gain, skew, cubics, every effect as text.
fn parts(readout: &Readout) -> Vec<Readout> {
    let alone = |own: &[usize]| Readout {
        centre: if own.contains(&0) { readout.centre } else { [0.0; 2] },
        p: std::array::from_fn::<_, UNKNOWNS, _>(|i| if own.contains(&i) { readout.p[i] } else { 0.0 }),
        texts: Vec::new(),
        ..readout.clone()
    };
    let own = [&[0, 1][..], &[2], &[3], &[4, 5]].map(alone);
    let texts = readout.texts.iter().map(|text| Readout { texts: vec![*text], ..alone(&[]) });
    own.into_iter().chain(texts).collect()
}

/// ln of the radius behind the readings of a run, off the rails, about its mean.
pub(super) fn ln_radius(run: &SensorRun, readout: &Readout) -> Vec<f64> {
    let kept = run.channels().into_iter().flatten().filter(|z| !readout.rails.clips(**z));
    let mut out: Vec<f64> = kept.map(|z| readout.ln_radius(*z)).collect();
    centre(&mut out);
    out
}

/// What is to be said of channels on a circle whose angle is off as a readout would have it; nothing where it is not, or
/// where the radius varies as well.
pub(super) fn said_of(sensor: &Sensor, runs: &[SensorRun]) -> Option<String> {
    if runs.iter().any(|run| run.channels().is_none()) {
        return None;
    }
    let varies = runs.iter().map(|run| root_mean_square(&ln_radius(run, &Readout::plain()))).fold(0.0, f64::max);
    let (n, largest) = largest_harmonic(sensor, runs)?;
    (SHOWN * largest * FRAC_1_SQRT_2 > varies).then(|| {
        format!(
            "the channels as recorded lie on a circle to {varies:.1e} of its radius, while the angle is off by {:.4}° {n} times a \
             period, and a readout shows in both: either they were divided by their own amplitude or computed from an angle, \
             so that offset, gain and skew are lost, or the error is one of the reference or the mounting",
            largest.to_degrees()
        )
    })
}

/// The largest harmonic of the angle's error among those of a readout, and its amplitude, rad, where these are most of the error
/// beside a straight line: else the reference is not followed, and its own errors are.
fn largest_harmonic(sensor: &Sensor, runs: &[SensorRun]) -> Option<(usize, f64)> {
    let periods = |run: &SensorRun| run.travel_rad() * sensor.gain.abs() / sensor.period;
    if !runs.iter().any(|run| periods(run) >= 1.0) {
        return None;
    }
    let samples = sensor.samples(runs, None);
    let fitted = |order: usize| {
        let shape = Shape { order, ..Shape::constant(true) };
        let table = TableFit::new(&shape, &samples, runs.len(), sensor.cycles)?;
        let left = root_mean_square(&by_run(&samples, runs.len(), |s| table.left(s)).concat());
        Some((table.table, left))
    };
    let ((_, with_a_line), (table, left)) = (fitted(0)?, fitted(OF_A_READOUT[2])?);
    let amplitude = |n: usize| (n, table.cos[n - 1].hypot(table.sin[n - 1]));
    let largest = OF_A_READOUT.map(amplitude).into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    largest.filter(|(_, size)| left < MOSTLY * with_a_line && *size < LARGEST * sensor.period)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle_sensor::samples::Reading;
    use crate::numerics::statistics::remembered;
    use crate::recording::Role;

    /// Channels of this gain ratio, with noise of 3e-4.
    fn channels(gain_ratio: f64) -> SensorRun {
        let rows = 500_u32;
        let noise = remembered(0.0, 2 * rows as usize, 7);
        let at = |i: u32| std::f64::consts::TAU * f64::from(i) / 100.0;
        let reading = |i: u32| {
            let (sin, cos) = at(i).sin_cos();
            [cos + 3e-4 * noise[2 * i as usize], gain_ratio * sin + 3e-4 * noise[2 * i as usize + 1]]
        };
        let t_s: Vec<f64> = (0..rows).map(f64::from).collect();
        SensorRun {
            name: "channels".into(),
            number: 0,
            role: Role::Fit,
            commanded: false,
            reference_rad: (0..rows).map(at).collect(),
            rate_rad_s: vec![0.06; t_s.len()],
            acceleration_rad_s2: vec![0.0; t_s.len()],
            temp_c: None,
            recorded: None,
            reading: Reading::Channels((0..rows).map(reading).collect()),
            t_s,
        }
    }

    #[test]
    fn a_readout_shows_where_the_radius_has_it_and_not_where_it_leaves_it_less_round() {
        let mut readout = Readout { kind: super::super::readout::Kind::Affine, ..Readout::plain() };
        readout.p[2] = 5e-3;
        assert!(shows(&readout, &[channels(1.005)]));
        assert!(!shows(&readout, &[channels(1.0)]));
    }
}
