//! The energy balance: what the commands put in and the damping takes out must be what the amplitude does.
//!
//! ln a behind the undone readout has to follow ∫(G v_as … − 1/τ …)dt. A readout effect that is believed wrongly bends
//! the amplitude as much as the angle, so this is a second witness for what the angle asks for, and the only one at a
//! single rate. It refuses to be part of the fit: the amplitude's noise wanders, and v_as is recorded more coarsely than
//! it acts.

use cvg_model::effects::EffectId;
use nalgebra::{DMatrix, DVector};

use crate::fit::{Prepared, scaled_inverse};
use crate::hypothesis::{Hypothesis, Unknown};
use crate::pass::{Pace, Start, walk};
use crate::recording::{Instrument, Role};
use crate::unknowns::Unknowns;

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
    let n = free.len();
    let unknowns = Unknowns::new(hypothesis, free);
    let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    let (mut squares, mut count) = (0.0, 0usize);
    for (p, starts) in tracks.iter().zip(starts) {
        for (segment, start) in p.track.segments.iter().zip(starts).filter(|(s, _)| s.role == Role::Fit) {
            let (mut s, mut sr, mut rr, mut rows) = (DVector::zeros(n), 0.0, 0.0, 0usize);
            let pace = Pace { stride: p.track.stride, spike: p.limit.angle };
            walk(&p.track, segment, hypothesis, &unknowns, *start, pace, |row| {
                if row.angle.abs() > pace.spike {
                    return;
                }
                let slopes = DVector::from_column_slice(row.amplitude_slopes);
                normal.syger(1.0, &slopes, &slopes, 1.0);
                right.axpy(row.amplitude, &slopes, 1.0);
                s += &slopes;
                sr += row.amplitude;
                rr += row.amplitude * row.amplitude;
                rows += 1;
            });
            // each segment starts at an amplitude of its own
            let m = rows.max(1) as f64;
            normal.syger(-1.0 / m, &s, &s, 1.0);
            right.axpy(-sr / m, &s, 1.0);
            squares += rr - sr * sr / m;
            count += rows;
        }
    }
    normal.fill_upper_triangle_with_lower_triangle();
    let inverse = scaled_inverse(&normal, 0.0)?;
    let step = &inverse * &right;
    let mut closed = hypothesis.clone();
    for (unknown, step) in unknowns.all.iter().zip(&step) {
        closed.set(*unknown, closed.get(*unknown) + step);
    }
    Some(EnergyBalance {
        mean_square: (squares - step.dot(&right)).max(0.0) / count.max(1) as f64,
        closed,
        information: 1.0 / inverse[(0, 0)].max(f64::MIN_POSITIVE),
    })
}
