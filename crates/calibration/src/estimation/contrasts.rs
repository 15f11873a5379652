//! In what the fitted runs of a campaign differ: rate, direction, speed, amplitude, temperature. What they have in common
//! is what they can't tell apart.

use crate::data::track::{Segment, Track};
use crate::estimation::identifiability::Alike;
use crate::estimation::joint_fit::Dataset;
use crate::recording::Role;

/// Rates that differ by less than this share count as one.
const SAME_RATE: f64 = 0.05;
/// Amplitudes that differ by less than this share count as one.
const SAME_AMPLITUDE: f64 = 0.05;
/// Runs bear out what one tells of the mechanics where their inverse rates without it are this share as far apart.
const BORNE_OUT: f64 = 0.1;
/// A rate that changes by more than this share within a run varies.
const VARYING_RATE: f64 = 0.2;
/// Stretches of a segment over which its rate is taken, and the share of all that are left out at either end.
const STRETCHES: usize = 50;
const EDGE: usize = 30;
/// Temperatures that differ by less than this are one, K: what a thermometer beside the resonator tells apart. Whether a
/// temperature or the time explains what changed is for the likelihood to say.
const SAME_TEMPERATURE_K: f64 = 0.25;

/// Rates of the table over short stretches of one segment after the other, rad/s; stops left out.
fn stretches<'a>(of: impl Iterator<Item = (&'a Track, Vec<Segment>)>) -> Vec<Vec<f64>> {
    let mut rates: Vec<Vec<f64>> = of
        .flat_map(|(t, segments)| segments.into_iter().map(move |s| (t, s.range)))
        .map(|(t, range)| {
            let step = (range.len() / STRETCHES).max(1);
            let ends = range.clone().step_by(step).zip(range.clone().skip(step).step_by(step));
            ends.map(|(i, j)| (t.input_rad[j] - t.input_rad[i]) / (t.t_s[j] - t.t_s[i])).collect()
        })
        .collect();
    let fastest = rates.iter().flatten().fold(0.0, |m: f64, r| m.max(r.abs()));
    for r in &mut rates {
        r.retain(|r| r.abs() > SAME_RATE * fastest);
    }
    rates
}

/// Some of these rates are of either direction.
fn both_directions(rates: &[Vec<f64>]) -> bool {
    let any = |sign: f64| rates.iter().flatten().any(|r| r * sign > 0.0);
    any(1.0) && any(-1.0)
}

/// The fastest of these rates and the slowest are not one speed.
fn speeds_differ(rates: &[Vec<f64>]) -> bool {
    let mut speeds: Vec<f64> = rates.iter().flatten().map(|r| r.abs()).collect();
    speeds.sort_by(f64::total_cmp);
    let edge = speeds.len() / EDGE;
    !speeds.is_empty() && speeds[speeds.len() - 1 - edge] > (1.0 + SAME_RATE) * speeds[edge]
}

/// How far apart the inverse rates are, s/rad: what mechanics do to the angle goes with that, and what a readout does stays.
fn lever(rates: &[Vec<f64>]) -> f64 {
    let mut inverse: Vec<f64> = rates.iter().flatten().map(|r| 1.0 / r).collect();
    inverse.sort_by(f64::total_cmp);
    let edge = inverse.len() / EDGE;
    if inverse.is_empty() { 0.0 } else { inverse[inverse.len() - 1 - edge] - inverse[edge] }
}

impl Dataset {
    /// Rates of the table over short stretches of one fitted segment after the other, rad/s; stops left out.
    fn stretches(&self) -> Vec<Vec<f64>> {
        let fitted = |t: &'_ Track| t.segments.iter().filter(|s| s.role == Role::Fit).cloned().collect();
        stretches(self.tracks.iter().map(|p| (&p.track, fitted(&p.track))))
    }

    /// Causes that differ in how they go with the rate are told apart by how the runs differ, and without one of them the
    /// others would not: no other run bears out what it says, and were it of another instrument, nothing would contradict.
    /// A run whose own rate varies tells them by itself; one that is held out bears out what was fitted.
    pub(crate) fn rests_on_one_run(&self) -> bool {
        let rates = |of: &dyn Fn(usize) -> bool| {
            let these = self.tracks.iter().enumerate().filter(|(at, _)| of(*at));
            stretches(these.map(|(_, p)| (&p.track, p.track.segments.clone())))
        };
        let differ = |of: &dyn Fn(usize) -> bool| {
            let rates = rates(of);
            both_directions(&rates) || speeds_differ(&rates)
        };
        let lever = |of: &dyn Fn(usize) -> bool| lever(&rates(of));
        let all = || 0..self.tracks.len();
        let least = BORNE_OUT * lever(&|_| true);
        all().any(|one| lever(&|at| at != one) < least)
            && !all().any(|one| differ(&|at| at == one))
            && differ(&|_| true)
    }

    /// The rate changes within a fitted run, as in a turn there and back.
    pub(crate) fn rate_varies(&self) -> bool {
        self.stretches().into_iter().any(|mut rates| {
            rates.sort_by(f64::total_cmp);
            let tenth = rates.len() / 10;
            !rates.is_empty() && {
                let (low, high) = (rates[tenth], rates[rates.len() - 1 - tenth]);
                high - low > VARYING_RATE * low.abs().max(high.abs())
            }
        })
    }

    /// The table turns both ways in what is fitted.
    pub(crate) fn both_directions(&self) -> bool {
        both_directions(&self.stretches())
    }

    /// The table turns at two or more speeds in what is fitted.
    pub(crate) fn speeds_differ(&self) -> bool {
        speeds_differ(&self.stretches())
    }

    /// The table's own angle was recorded in all runs.
    pub(crate) fn has_table(&self) -> bool {
        self.tracks.iter().all(|p| p.track.has_table)
    }

    /// The temperature was recorded in all runs.
    pub(crate) fn has_temperature(&self) -> bool {
        self.tracks.iter().all(|p| p.track.has_temperature())
    }

    /// What the fitted runs have in common.
    pub(crate) fn alike(&self) -> Alike {
        let fitted = self.tracks.iter().filter(|p| p.track.samples(Role::Fit) > 0);
        let ends = fitted
            .map(|p| p.track.mean_amplitude())
            .fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), a| (low.min(a), high.max(a)));
        Alike {
            direction: !self.both_directions(),
            speed: !self.speeds_differ(),
            amplitude: ends.1 < (1.0 + SAME_AMPLITUDE) * ends.0,
            no_ring_downs: self.ring_down_runs.is_empty(),
            no_table: !self.has_table(),
        }
    }

    /// Fitted runs were made at two or more rates, or in both directions.
    pub(crate) fn tracks_differ(&self) -> bool {
        self.both_directions() || self.speeds_differ()
    }

    /// Runs that differ tell what the drive does, where the quadrature tells the split of the frequencies from it.
    pub(crate) fn tells_the_drive(&self) -> bool {
        self.tracks_differ() && self.tracks.iter().any(|p| p.track.has_quadrature())
    }

    /// Every run has a temperature, and what is fitted was made at different ones.
    pub(crate) fn temperature_varies(&self) -> bool {
        let fitted = || self.tracks.iter().map(|p| &p.track).filter(|t| t.samples(Role::Fit) > 0);
        let (low, high) = fitted()
            .flat_map(Track::temperatures_c)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high): (f64, f64), t| (low.min(t), high.max(t)));
        self.tracks.iter().all(|p| p.track.temperatures_c().next().is_some()) && high - low > SAME_TEMPERATURE_K
    }
}
