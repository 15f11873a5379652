//! Where a fit begins: the equations of (E, R, S, Q) are linear in what is sought, and their integrals over a stretch of
//! the recording need no derivatives of it. Least squares then give values near enough to fit from.

use super::model::Model;
use super::runs::DecayRun;
use super::stokes::{Mechanics, State};
use crate::numerics::linear::NormalEquations;

/// Share of a run that one integral covers.
const COVERED: usize = 12;

/// The values of a model's terms from the first `count` samples of each run; readout terms are left as they are.
pub(crate) fn begun(model: &Model, runs: &[DecayRun], count: impl Fn(&DecayRun) -> usize) -> Model {
    let sought: Vec<usize> = (0..model.terms.len()).filter(|&at| !model.terms[at].is_readout()).collect();
    let mut equations = NormalEquations::new(sought.len());
    for run in runs {
        let n = count(run).min(run.len());
        let lag = (n / COVERED).max(2);
        // what a unit of each term adds to the rate of change, integrated from the first sample on
        let slopes: Vec<Vec<State>> = sought.iter().map(|&at| integral(run, n, |i| slope(model, at, run, i))).collect();
        for i in (0..n.saturating_sub(lag)).step_by((lag / 4).max(1)) {
            let weight = 1.0 / energy(&run.seen[i]).max(f64::MIN_POSITIVE).sqrt();
            let change = run.seen[i + lag] - run.seen[i];
            for k in 1..4 {
                let row: Vec<f64> = slopes.iter().map(|s| weight * (s[i + lag][k] - s[i][k])).collect();
                equations.add(&row, weight * change[k]);
            }
        }
    }
    let mut out = model.clone();
    for (&at, value) in sought.iter().zip(equations.solve()) {
        out.values[at] = value;
    }
    out
}

/// √(R² + S² + Q²), which noise raises less than E.
pub(crate) fn energy(u: &State) -> f64 {
    u.fixed_rows::<3>(1).norm()
}

/// d/dt (E, R, S, Q) that a unit of one term makes at one sample.
fn slope(model: &Model, at: usize, run: &DecayRun, i: usize) -> State {
    let mut unit = Model { values: vec![0.0; model.values.len()], ..model.clone() };
    unit.values[at] = 1.0;
    let m = unit.mechanics(run.rate_rad_s[i]);
    let mut u = run.seen[i];
    u[0] = energy(&u);
    let turning = Mechanics { precession_rad_s: m.precession_rad_s + m.precession_of_springs(&u), ..m };
    turning.generator() * u - u * (2.0 * m.damping_growth * u[0])
}

fn integral(run: &DecayRun, n: usize, of: impl Fn(usize) -> State) -> Vec<State> {
    let mut out = Vec::with_capacity(n);
    let (mut sum, mut last) = (State::zeros(), State::zeros());
    for i in 0..n {
        let now = of(i);
        if i > 0 {
            sum += (now + last) * (0.5 * (run.t_s[i] - run.t_s[i - 1]));
        }
        out.push(sum);
        last = now;
    }
    out
}
