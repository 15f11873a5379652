//! The angle that decays show, less what a model says of it, on stretches that it was or was not fitted to.

use super::fit::start_of;
use super::model::{Model, Start};
use super::runs::DecayRun;
use super::stokes::State;
use crate::diagnostics::evaluate::Evaluation;
use crate::estimation::residuals::Residual;
use crate::numerics::angles::wrapped;

/// The least √(R² + S²)/E of an orbit that lies somewhere: a circle has no angle.
const LEAST_LINE: f64 = 0.3;

/// Part of a run, from one stretch to another, with the start of its orbit under a model; none where it is to be found.
#[derive(Clone, Copy)]
pub(crate) struct Part<'a> {
    pub(crate) run: &'a DecayRun,
    pub(crate) from: usize,
    pub(crate) start: Option<&'a Start>,
}

fn angle(u: &State) -> f64 {
    0.5 * u[2].atan2(u[1])
}

/// The stretches of a part whose orbit has an angle.
fn told(part: &Part<'_>) -> Vec<usize> {
    let line = |u: &State| u[1].hypot(u[2]) > LEAST_LINE * u.fixed_rows::<3>(1).norm();
    (part.from..part.run.len()).filter(|&i| line(&part.run.seen[i])).collect()
}

fn residual(part: &Part<'_>, at: &[usize], angle_of: impl Fn(usize) -> f64) -> Residual {
    let run = part.run;
    let pi = std::f64::consts::PI;
    let (t0, turned) = (run.t_s[0], run.turned_rad());
    let mut errors: Vec<f64> = at.iter().map(|&i| angle_of(i)).collect();
    for i in 1..errors.len() {
        errors[i] = errors[i - 1] + wrapped(errors[i] - errors[i - 1], pi);
    }
    let mut directions: Vec<f64> = at.iter().map(|&i| angle(&run.seen[i])).collect();
    for i in 1..directions.len() {
        directions[i] = directions[i - 1] + wrapped(directions[i] - directions[i - 1], pi);
    }
    Residual {
        track: run.number,
        samples: at.len(),
        t_s: at.iter().map(|&i| run.t_s[i]).collect(),
        // a line over time: the input turns evenly, or not at all
        turned: at.iter().map(|&i| run.t_s[i] - t0).collect(),
        table: at.iter().map(|&i| turned[i]).collect(),
        precession: vec![directions.last().zip(directions.first()).map_or(0.0, |(b, a)| b - a); at.len()],
        direction: directions,
        angle: errors,
        // what makes an error of the angle one in V, in which the noise is the same all along
        amplitude: at.iter().map(|&i| run.seen[i][1].hypot(run.seen[i][2]) / run.seen[i][0].sqrt()).collect(),
    }
}

/// Errors across the orbit, V.
pub(crate) fn in_volts(errors: &Evaluation) -> Evaluation {
    let mut out = errors.clone();
    for s in &mut out.segments {
        for (angle, a) in s.angle.iter_mut().zip(&s.amplitude) {
            *angle *= a;
        }
    }
    out
}

/// The angle as recorded, less its best line over time.
pub(crate) fn raw(parts: &[Part<'_>], like: &Evaluation) -> Evaluation {
    let segments = parts.iter().map(|p| residual(p, &told(p), |i| angle(&p.run.seen[i]))).collect();
    Evaluation::of_segments(segments, Some(like))
}

/// The angle less what a model says of it, less the best line of that.
pub(crate) fn after(parts: &[Part<'_>], model: &Model, like: Option<&Evaluation>) -> Evaluation {
    let segments = parts
        .iter()
        .map(|p| {
            let start = p.start.copied().unwrap_or_else(|| start_of(model, p.run));
            let predicted = model.predict(p.run, &start, p.run.len());
            residual(p, &told(p), |i| angle(&p.run.seen[i]) - angle(&predicted[i]))
        })
        .collect();
    Evaluation::of_segments(segments, like)
}
