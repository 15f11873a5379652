//! The phase of a decay, which (E, R, S, Q) do not have: how far the vibration runs ahead of its reference, and whether it
//! runs faster or slower while it is large.
//!
//! Each run has a phase, a frequency and a steady drift of its own, so that a clock that drifts is no nonlinear spring.

use nalgebra::{DMatrix, DVector};

use super::fit::{covariance, solved};
use super::model::{Model, Start};
use super::noise::Autoregression;
use super::runs::{DecayRun, overlap};
use super::start::energy;
use super::stokes::State;
use cvg_model::Envelope;

/// What the phases tell.
#[derive(Debug, Clone)]
pub(crate) struct Phase {
    /// mean ω − ω_r of each run, rad/s
    pub(crate) ahead_rad_s: Vec<f64>,
    /// dω/dE, rad/s/V², and its deviation
    pub(crate) per_energy: (f64, f64),
    /// gain in 2 ln likelihood by it, less its price
    pub(crate) gain: f64,
}

/// Unknowns of a run: phase, frequency, drift.
const OWN: usize = 3;
const ROUNDS: usize = 3;

/// Columns of one run, in V: what was seen, then 1, t, t², ∫E.
fn columns(model: &Model, start: &Start, run: &DecayRun) -> [Vec<f64>; 5] {
    let predicted = model.envelopes(run, start);
    let middle = 0.5 * (run.t_s[0] + run.t_s[run.len() - 1]);
    let mut out = [(); 5].map(|()| Vec::with_capacity(run.len()));
    let (mut phase, mut last, mut grown) = (0.0, 0.0, 0.0);
    // the energy of the vibration itself, as c has it: not as unequal gains read it
    let energies: Vec<f64> = predicted.iter().map(State::norm_squared).collect();
    for (i, p) in predicted.iter().enumerate() {
        let (seen, rate) = &run.envelopes[i];
        // an offset stays while the rest of the stretch is brought to its middle
        let half = 0.5 * rate * run.span_s;
        let of_offset = if half == 0.0 { 1.0 } else { half.sin() / half };
        let (cos, sin) = overlap(&Envelope::new(p[0], p[1], p[2], p[3]), &model.unread(seen, of_offset));
        let now = sin.atan2(cos);
        if i == 0 {
            phase = now;
        } else {
            let dt = run.t_s[i] - run.t_s[i - 1];
            let expected = 0.5 * (rate + run.envelopes[i - 1].1) * dt;
            phase += expected + crate::numerics::angles::wrapped(now - last - expected, std::f64::consts::TAU);
            grown += 0.5 * (energies[i] + energies[i - 1]) * dt;
        }
        last = now;
        let (a, t) = (energy(&run.seen[i]).sqrt(), (run.t_s[i] - middle) / run.duration_s());
        for (column, v) in out.iter_mut().zip([phase, 1.0, t, t * t, grown]) {
            column.push(a * v);
        }
    }
    out
}

/// Least squares of all runs under a noise: the unknowns, their covariance, and −2 ln likelihood.
fn solve(
    columns: &[[Vec<f64>; 5]],
    noise: &Autoregression,
    with_energy: bool,
) -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
    let n = OWN * columns.len() + usize::from(with_energy);
    let (mut matrix, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    let mut square = 0.0;
    let mut volume = 0.0;
    for (at, run) in columns.iter().enumerate() {
        let white: Vec<Vec<f64>> = run.iter().map(|c| noise.whitened(c)).collect();
        let unknowns: Vec<(usize, &Vec<f64>)> = (0..OWN + usize::from(with_energy))
            .map(|k| (if k < OWN { OWN * at + k } else { n - 1 }, &white[k + 1]))
            .collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (row, one) in &unknowns {
            right[*row] += dot(one, &white[0]);
            for (column, other) in &unknowns {
                matrix[(*row, *column)] += dot(one, other);
            }
        }
        square += dot(&white[0], &white[0]);
        volume += noise.log_volume(run[0].len());
    }
    let x = solved(&matrix, &right, 0.0)?;
    let left = (square - right.dot(&x)).max(0.0);
    let covariance = covariance(&matrix, n);
    Some((x, covariance, left + 2.0 * volume))
}

/// What the unknowns leave of each run, V.
fn left(columns: &[[Vec<f64>; 5]], x: &DVector<f64>) -> Vec<Vec<f64>> {
    let with_energy = x.len() > OWN * columns.len();
    let of = |(at, run): (usize, &[Vec<f64>; 5])| {
        (0..run[0].len())
            .map(|i| {
                let own: f64 = (0..OWN).map(|k| run[k + 1][i] * x[OWN * at + k]).sum();
                run[0][i] - own - if with_energy { run[4][i] * x[x.len() - 1] } else { 0.0 }
            })
            .collect()
    };
    columns.iter().enumerate().map(of).collect()
}

/// What the phases of these runs tell under a model; `None` where they cannot be followed.
pub(crate) fn phase(model: &Model, starts: &[Start], runs: &[DecayRun]) -> Option<Phase> {
    let columns: Vec<[Vec<f64>; 5]> = runs.iter().zip(starts).map(|(r, s)| columns(model, s, r)).collect();
    let fitted = |with_energy: bool| {
        let mut noise = Autoregression::white(1.0);
        for _ in 0..ROUNDS {
            let (x, _, _) = solve(&columns, &noise, with_energy)?;
            noise = Autoregression::of(&left(&columns, &x));
        }
        solve(&columns, &noise, with_energy)
    };
    let (plain, _, before) = fitted(false)?;
    let (x, covariance, after) = fitted(true)?;
    let last = x.len() - 1;
    let values: usize = runs.iter().map(DecayRun::len).sum();
    Some(Phase {
        ahead_rad_s: runs.iter().enumerate().map(|(at, r)| plain[OWN * at + 1] / r.duration_s()).collect(),
        per_energy: (x[last], covariance[(last, last)].max(0.0).sqrt()),
        gain: before - after - (values as f64).ln(),
    })
}
