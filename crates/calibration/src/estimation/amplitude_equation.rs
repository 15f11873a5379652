//! The energy balance: what the commands put in and the damping takes out must be what the amplitude does.
//!
//! ln a behind the undone readout has to follow ∫(G v_as … − 1/τ …)dt. A readout effect that is believed wrongly bends
//! the amplitude as much as the angle, so this is a second witness for what the angle asks for, and the only one at a
//! single rate. It refuses to be part of the fit: the amplitude's noise wanders, and v_as is recorded more coarsely than
//! it acts.

use cvg_model::effects::EffectId;
use nalgebra::{DMatrix, DVector};

use crate::data::track::Track;
use crate::estimation::fit::{Prepared, scaled_inverse};
use crate::estimation::propagation::{Start, Stepping, propagate};
use crate::model::hypothesis::{Hypothesis, Unknown};
use crate::model::unknowns::Unknowns;
use crate::numerics::statistics::median;
use crate::recording::{Instrument, Role};

/// The energy balance of a hypothesis, with the force scale, the damping and the anisodamping that close it best.
#[derive(Debug, Clone)]
pub(crate) struct EnergyBalance {
    /// of what is left of ln a
    pub(crate) mean_square: f64,
    /// the hypothesis with the force scale, the damping and the anisodamping that close it
    pub(crate) closed: Hypothesis,
    information: f64,
}

impl EnergyBalance {
    /// Standard deviation of the force scale where what is left of ln a has deviation `noise`.
    pub(crate) fn deviation(&self, noise: f64) -> f64 {
        noise / self.information.max(f64::MIN_POSITIVE).sqrt()
    }
}

/// Samples of a run that tell how strongly it was driven.
const LOOKED_AT: usize = 500;

/// The balance over all fitted runs; `None` where amplitude or commands were not recorded.
pub(crate) fn energy_balance(
    tracks: &[Prepared],
    hypothesis: &Hypothesis,
    starts: &[Vec<Start>],
) -> Option<EnergyBalance> {
    let usable = |p: &Prepared| p.track.has_commands() && p.track.has_amplitude();
    if hypothesis.instrument == Instrument::Sensor || !tracks.iter().all(usable) {
        return None;
    }
    let mut free = vec![Unknown::ForceScale, Unknown::Damping];
    if let Some(member) = hypothesis.position(EffectId::Anisodamping) {
        free.extend([Unknown::Effect(member, 0), Unknown::Effect(member, 1)]);
    }
    let unknowns = Unknowns::new(hypothesis, free);
    // the drive replaces the damping and hardly differs from it: counted from that, what is left of it shows
    let replaced = usual_growth(tracks);
    let counted = |columns: &mut DVector<f64>| columns[0] += replaced * columns[1];
    let sums = stretches(tracks, hypothesis, &unknowns, starts, |_| f64::INFINITY, counted);
    let (n, count) = (unknowns.all.len(), sums.iter().map(|s| s.samples).sum::<f64>());
    let squares = sums.iter().map(|s| &s.squares).sum::<DMatrix<f64>>();
    let inverse = scaled_inverse(&squares.view((0, 0), (n, n)).into_owned(), 0.0)?;
    let step: DVector<f64> = &inverse * squares.column(n).rows(0, n);
    let left = DVector::from_fn(n + 1, |i, _| if i < n { -step[i] } else { 1.0 });
    let mut closed = hypothesis.clone();
    for (unknown, step) in unknowns.all.iter().zip(&step) {
        closed.set(*unknown, closed.get(*unknown) + step);
    }
    // by as much as the force scale could move: it has a bound
    closed.damping_per_s += replaced * (closed.force_scale - hypothesis.force_scale);
    Some(EnergyBalance {
        mean_square: left.dot(&(squares * &left)).max(0.0) / f64::max(count, 1.0),
        closed,
        information: 1.0 / inverse[(0, 0)].max(f64::MIN_POSITIVE),
    })
}

/// What a stretch of a run says of the balance: squares of the slopes and, last, of what is left of ln a, about their means, since
/// every stretch starts at an amplitude of its own.
pub(super) struct Stretch {
    pub(super) squares: DMatrix<f64>,
    samples: f64,
}

/// The fitted segments in stretches of a length of each run's own, s; `counted` changes what the slopes, and what is left, are counted
/// from.
pub(super) fn stretches(
    tracks: &[Prepared],
    hypothesis: &Hypothesis,
    unknowns: &Unknowns,
    starts: &[Vec<Start>],
    length_s: impl Fn(&Track) -> f64,
    counted: impl Fn(&mut DVector<f64>),
) -> Vec<Stretch> {
    let n = unknowns.all.len();
    let mut all = Vec::new();
    for (p, starts) in tracks.iter().zip(starts) {
        let length_s = length_s(&p.track);
        for (segment, start) in p.track.segments.iter().zip(starts).filter(|(s, _)| s.role == Role::Fit) {
            let nothing = || (DMatrix::zeros(n + 1, n + 1), DVector::zeros(n + 1), 0.0);
            let (mut squares, mut sum, mut samples): (DMatrix<f64>, DVector<f64>, f64) = nothing();
            let mut end = |squares: &mut DMatrix<f64>, sum: &DVector<f64>, samples: f64| {
                squares.syger(-1.0 / f64::max(samples, 1.0), sum, sum, 1.0);
                squares.fill_upper_triangle_with_lower_triangle();
                all.push(Stretch { squares: squares.clone(), samples });
            };
            let mut origin: Option<(f64, DVector<f64>)> = None;
            let stepping = Stepping::without(p.limit.angle);
            propagate(&p.track, segment, hypothesis, unknowns, *start, stepping, |row| {
                if row.angle.abs() > stepping.spike {
                    return;
                }
                let columns = row.amplitude_slopes.iter().copied().chain([row.amplitude]);
                let mut columns = DVector::from_iterator(n + 1, columns);
                counted(&mut columns);
                let t_s = p.track.t_s[row.index];
                if origin.as_ref().is_some_and(|(began_s, _)| t_s - began_s >= length_s) {
                    end(&mut squares, &sum, samples);
                    (squares, sum, samples) = nothing();
                    origin = None;
                }
                columns -= &origin.get_or_insert_with(|| (t_s, columns.clone())).1;
                squares.syger(1.0, &columns, &columns, 1.0);
                sum += columns;
                samples += 1.0;
            });
            end(&mut squares, &sum, samples);
        }
    }
    all
}

/// The median of ȧ/a by the energy command at a force scale of 1, 1/s.
fn usual_growth(tracks: &[Prepared]) -> f64 {
    let mut all: Vec<f64> = tracks
        .iter()
        .map(|p| &p.track)
        .flat_map(|t| (0..t.t_s.len()).step_by((t.t_s.len() / LOOKED_AT).max(1)).map(move |i| (t, i)))
        .filter_map(|(t, i)| t.commands(i, 1).map(|v| -v.now.v_as / t.envelope(i).pendulum().e.sqrt()))
        .filter(|growth| growth.is_finite())
        .collect();
    if all.is_empty() { 0.0 } else { median(&mut all) }
}
