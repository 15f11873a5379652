//! The joint fit of all decays: the terms of the model in common, an orbit of its own to begin with for each run, every
//! direction of (R, S, Q) weighed by what its noise remembers (Levenberg and Marquardt on whitened residuals).

use nalgebra::{DMatrix, DVector, Vector3};

use super::model::{Model, OFFSETS, Start, Term};
use super::noise::Autoregression;
use super::runs::DecayRun;
use super::start::energy;
use super::stokes::State;
use crate::numerics::linear::NormalEquations;

/// Along the orbit's amplitude, across it (the angle), and in quadrature.
const DIRECTIONS: usize = 3;
/// Steps of the fit at most, and a gain of the cost that is worth another.
const MOST_STEPS: usize = 40;
const WORTH: f64 = 1e-9;
/// Marquardt's parameter: at the beginning, after a step that helps or does not, and where it is given up.
const DAMPING: f64 = 1e-4;
const EASED: f64 = 0.2;
const TIGHTENED: f64 = 6.0;
const HOPELESS: f64 = 1e8;
/// Rounds of weighing and fitting.
const ROUNDS: usize = 3;
/// A stretch further out than this many deviations is set aside.
const SPIKE: f64 = 6.5;
/// Steps to the start of a run.
const STEPS_OF_A_START: usize = 6;
/// A change of the state, relative to itself, that derivatives are taken over.
const NUDGE: f64 = 1e-5;

/// A fitted model.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub(crate) model: Model,
    pub(crate) starts: Vec<Start>,
    /// of the model's terms, in their order
    pub(crate) covariance: DMatrix<f64>,
    /// −2 ln likelihood, but for a constant of the data
    pub(crate) minus_two_log: f64,
    /// values that it counts
    pub(crate) values: usize,
    /// stretches that are set aside, run by run
    pub(crate) set_aside: Vec<Vec<bool>>,
}

impl Fit {
    /// The same, with intervals so many times as wide.
    pub(crate) fn widened(mut self, times: f64) -> Self {
        self.covariance *= times * times;
        self
    }

    /// The same, with intervals that also hold a term that was not seen.
    pub(crate) fn beside(mut self, unseen: &Unseen) -> Self {
        self.covariance += &unseen.by * unseen.by.transpose() * (unseen.size * unseen.size);
        self
    }

    /// The same, with intervals that also hold terms that were not seen, together.
    pub(crate) fn beyond(mut self, beyond: &Beyond, bound: impl Fn(Term) -> f64) -> Self {
        if let Some(held) = beyond.held(bound) {
            self.covariance += held;
        }
        self
    }

    /// The same, with intervals that also hold what another explanation says of the terms that both have. A term that
    /// the other does not have is absent in it.
    pub(crate) fn or(mut self, other: &Model) -> Self {
        let off = self.model.terms.iter().zip(&self.model.values).map(|(t, v)| other.value(*t) - v);
        let off = DVector::from_iterator(self.model.terms.len(), off);
        self.covariance += &off * off.transpose();
        self
    }

    pub(crate) fn deviation(&self, term: Term) -> f64 {
        let at = self.model.terms.iter().position(|t| *t == term);
        at.map_or(0.0, |at| self.covariance[(at, at)].max(0.0).sqrt())
    }
}

/// What is fitted to: the runs, and how many stretches of each.
#[derive(Clone, Copy)]
pub(crate) struct Data<'a> {
    pub(crate) runs: &'a [DecayRun],
    pub(crate) counts: &'a [usize],
}

type Noise = [Autoregression; DIRECTIONS];
/// Residuals of one run in each direction.
type Columns = [Vec<f64>; DIRECTIONS];

/// Unit vectors along the state, across it and in quadrature, in (R, S, Q), with the size that makes them volts.
struct Frame {
    along: Vector3<f64>,
    across: Vector3<f64>,
    quadrature: Vector3<f64>,
    per_volt: f64,
}

impl Frame {
    fn of(u: &State) -> Self {
        let v: Vector3<f64> = u.fixed_rows::<3>(1).into();
        let size = v.norm().max(f64::MIN_POSITIVE);
        let along = v / size;
        let pole = Vector3::new(0.0, 0.0, 1.0);
        let upward = pole - along * along.z;
        // a circle has no orientation: any direction serves as across
        let quadrature = if upward.norm() > 1e-6 { upward.normalize() } else { along.cross(&Vector3::x()).normalize() };
        Self { along, across: quadrature.cross(&along), quadrature, per_volt: 0.5 / size.sqrt() }
    }

    fn volts(&self, difference: &State) -> [f64; DIRECTIONS] {
        let v: Vector3<f64> = difference.fixed_rows::<3>(1).into();
        [&self.along, &self.across, &self.quadrature].map(|d| d.dot(&v) * self.per_volt)
    }
}

fn columns(frames: &[Frame], of: impl Fn(usize) -> State, aside: &[bool]) -> Columns {
    let mut out = [(); DIRECTIONS].map(|()| Vec::with_capacity(frames.len()));
    for (i, frame) in frames.iter().enumerate() {
        let volts = if aside[i] { [0.0; DIRECTIONS] } else { frame.volts(&of(i)) };
        for (column, v) in out.iter_mut().zip(volts) {
            column.push(v);
        }
    }
    out
}

fn whitened(noise: &Noise, columns: &Columns) -> Columns {
    [0, 1, 2].map(|k| noise[k].whitened(&columns[k]))
}

fn square(columns: &Columns) -> f64 {
    columns.iter().flatten().map(|v| v * v).sum()
}

/// A fit under way.
struct Fitting<'a> {
    data: Data<'a>,
    noise: Noise,
    aside: Vec<Vec<bool>>,
}

impl Fitting<'_> {
    /// What a run leaves under a model, in V.
    fn residual(&self, model: &Model, start: &Start, at: usize) -> Columns {
        let (run, count) = (&self.data.runs[at], self.data.counts[at]);
        let predicted = model.predict(run, start, count);
        let frames: Vec<Frame> = predicted.iter().map(Frame::of).collect();
        columns(&frames, |i| run.seen[i] - predicted[i], &self.aside[at])
    }

    fn cost(&self, model: &Model, starts: &[Start]) -> f64 {
        let of = |at: usize| square(&whitened(&self.noise, &self.residual(model, &starts[at], at)));
        let cost: f64 = (0..starts.len()).map(of).sum();
        if cost.is_finite() { cost } else { f64::INFINITY }
    }

    /// Normal matrix and right side: the model's terms, then each run's start.
    fn equations(&self, model: &Model, starts: &[Start]) -> (DMatrix<f64>, DVector<f64>) {
        let shared = model.terms.len();
        let n = shared + 3 * starts.len();
        let (mut matrix, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for (at, start) in starts.iter().enumerate() {
            let (run, count) = (&self.data.runs[at], self.data.counts[at]);
            let base = model.predict(run, start, count);
            let frames: Vec<Frame> = base.iter().map(Frame::of).collect();
            let seen = whitened(&self.noise, &columns(&frames, |i| run.seen[i] - base[i], &self.aside[at]));
            let derivative = |step: f64, moved: [(Model, Start); 2]| {
                let [up, down] = moved.map(|(m, s)| m.predict(run, &s, count));
                let per = 0.5 / step;
                whitened(&self.noise, &columns(&frames, |i| (up[i] - down[i]) * per, &self.aside[at]))
            };
            let mut slopes: Vec<(usize, Columns)> = Vec::with_capacity(shared + 3);
            for k in 0..shared {
                let step = nudge(model.terms[k], run, start);
                let moved = [step, -step].map(|by| {
                    let mut m = model.clone();
                    m.values[k] += by;
                    (m, *start)
                });
                slopes.push((k, derivative(step, moved)));
            }
            let size = start.iter().map(|v| v * v).sum::<f64>().sqrt();
            for k in 0..3 {
                let step = NUDGE * size.max(f64::MIN_POSITIVE);
                let moved = [step, -step].map(|by| {
                    let mut s = *start;
                    s[k] += by;
                    (model.clone(), s)
                });
                slopes.push((shared + 3 * at + k, derivative(step, moved)));
            }
            let dot = |a: &Columns, b: &Columns| -> f64 {
                a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()).sum()
            };
            for (i, (row, one)) in slopes.iter().enumerate() {
                right[*row] += dot(one, &seen);
                for (column, other) in &slopes[..=i] {
                    let product = dot(one, other);
                    matrix[(*row, *column)] += product;
                    if row != column {
                        matrix[(*column, *row)] += product;
                    }
                }
            }
        }
        (matrix, right)
    }

    /// Levenberg and Marquardt's steps to the least cost.
    fn descend(&self, model: &mut Model, starts: &mut [Start], most: usize) -> f64 {
        let mut cost = self.cost(model, starts);
        let mut damping = DAMPING;
        for _ in 0..most {
            let (matrix, right) = self.equations(model, starts);
            let before = cost;
            while damping < HOPELESS {
                if let Some(step) = solved(&matrix, &right, damping) {
                    let (m, s) = moved(model, starts, &step);
                    let trial = self.cost(&m, &s);
                    if trial < cost {
                        (*model, cost) = (m, trial);
                        starts.copy_from_slice(&s);
                        damping *= EASED;
                        break;
                    }
                }
                damping *= TIGHTENED;
            }
            if before - cost <= WORTH * before {
                break;
            }
        }
        cost
    }

    /// Weighs the directions by what is left in them, and sets aside what is far out.
    fn weigh(&mut self, model: &Model, starts: &[Start], remembering: bool) {
        let left: Vec<Columns> = (0..starts.len()).map(|at| self.residual(model, &starts[at], at)).collect();
        for k in 0..DIRECTIONS {
            let of: Vec<Vec<f64>> = left.iter().map(|c| c[k].clone()).collect();
            let n: usize = of.iter().map(Vec::len).sum();
            let mean_square = of.iter().flatten().map(|v| v * v).sum::<f64>() / n.max(1) as f64;
            self.noise[k] =
                if remembering { Autoregression::of(&of) } else { Autoregression::white(mean_square.sqrt()) };
        }
        if !remembering {
            return;
        }
        for (at, columns) in left.iter().enumerate() {
            let white = whitened(&self.noise, columns);
            for (i, aside) in self.aside[at].iter_mut().enumerate() {
                *aside |= white.iter().any(|c| c[i].abs() > SPIKE);
            }
        }
    }
}

/// What a model leaves of the first `count` stretches of a run: along the orbit's amplitude, across it, in quadrature; V.
pub(crate) fn left(model: &Model, start: &Start, run: &DecayRun, count: usize) -> [Vec<f64>; DIRECTIONS] {
    let predicted = model.predict(run, start, count);
    let frames: Vec<Frame> = predicted.iter().map(Frame::of).collect();
    columns(&frames, |i| run.seen[i] - predicted[i], &vec![false; count])
}

/// A change of a term that changes the state by about [`NUDGE`] of itself over a run.
fn nudge(term: Term, run: &DecayRun, start: &Start) -> f64 {
    let energy = start.iter().map(|v| v * v).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    let duration = run.duration_s().max(f64::MIN_POSITIVE);
    match term {
        Term::Spring | Term::DampingGrowth => NUDGE / (duration * energy),
        Term::ReadoutCubic => NUDGE / energy,
        t if OFFSETS.contains(&t) => NUDGE * energy.sqrt(),
        t if t.is_readout() => NUDGE,
        Term::AngularGain => NUDGE / (duration * run.usual_rate().max(1e-9)),
        _ => NUDGE / duration,
    }
}

pub(crate) fn solved(matrix: &DMatrix<f64>, right: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let n = right.len();
    let scale = DVector::from_fn(n, |i, _| 1.0 / matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt());
    let scaled =
        DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j] * if i == j { 1.0 + damping } else { 1.0 });
    let step = scaled.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale);
    step.iter().all(|v| v.is_finite()).then_some(step)
}

fn moved(model: &Model, starts: &[Start], step: &DVector<f64>) -> (Model, Vec<Start>) {
    let mut m = model.clone();
    let shared = m.values.len();
    for (value, by) in m.values.iter_mut().zip(step.iter()) {
        *value += by;
    }
    let s = starts.iter().enumerate().map(|(at, s)| [0, 1, 2].map(|k| s[k] + step[shared + 3 * at + k])).collect();
    (m, s)
}

/// The inverse of the normal matrix, of the shared unknowns; what is not determined has an infinite variance.
pub(crate) fn covariance(matrix: &DMatrix<f64>, shared: usize) -> DMatrix<f64> {
    let n = matrix.nrows();
    let scale = DVector::from_fn(n, |i, _| 1.0 / matrix[(i, i)].max(f64::MIN_POSITIVE).sqrt());
    let scaled = DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let Some(inverse) = scaled.cholesky().map(|c| c.inverse()) else {
        return DMatrix::from_diagonal_element(shared, shared, f64::INFINITY);
    };
    DMatrix::from_fn(shared, shared, |i, j| inverse[(i, j)] * scale[i] * scale[j])
}

/// Fits a model, from its values on, to the data.
pub(crate) fn fit(model: &Model, starts: &[Start], data: Data<'_>) -> Fit {
    let white = || Autoregression::white(1.0);
    let aside = data.counts.iter().map(|n| vec![false; *n]).collect();
    let mut fitting = Fitting { data, noise: [white(), white(), white()], aside };
    let (mut model, mut starts) = (model.clone(), starts.to_vec());
    fitting.descend(&mut model, &mut starts, MOST_STEPS);
    for round in 0..ROUNDS {
        fitting.weigh(&model, &starts, round > 0);
        fitting.descend(&mut model, &mut starts, MOST_STEPS);
    }
    let cost = fitting.cost(&model, &starts);
    let values: usize = DIRECTIONS * data.counts.iter().sum::<usize>();
    let volume: f64 = fitting.noise.iter().map(|a| data.counts.iter().map(|n| a.log_volume(*n)).sum::<f64>()).sum();
    let (matrix, _) = fitting.equations(&model, &starts);
    let shared = model.terms.len();
    // the noise was measured on what the fit left: it is that much larger
    let unknowns = shared + 3 * starts.len();
    let larger = values as f64 / values.saturating_sub(unknowns).max(1) as f64;
    Fit {
        covariance: covariance(&matrix, shared) * larger,
        minus_two_log: cost + 2.0 * volume,
        values,
        set_aside: fitting.aside,
        model,
        starts,
    }
}

/// What a term that a fit does not have may be, as far as the data allow it, and what it would do to the values.
#[derive(Debug, Clone)]
pub(crate) struct Unseen {
    /// root mean square of what it may be
    pub(crate) size: f64,
    /// change of the values of the model's terms by a unit of it
    pub(crate) by: DVector<f64>,
}

/// A term that was not added, by one linearisation: its likelihood, and all values within `bound` as likely before.
pub(crate) fn unseen(fitted: &Fit, term: Term, bound: f64, data: Data<'_>) -> Option<Unseen> {
    let beyond = Beyond::of(fitted, &[term], data)?;
    // even between the bounds
    let precision = beyond.information[(0, 0)].max(0.0) + 3.0 / (bound * bound);
    let size = (beyond.left[0] / precision).hypot(precision.sqrt().recip());
    Some(Unseen { size, by: beyond.by.column(0).into_owned() })
}

/// What data say of terms that a fit does not have, all of them at once, after the fit took up what it can; linearised where
/// they are absent.
#[derive(Debug, Clone)]
pub(crate) struct Beyond {
    terms: Vec<Term>,
    /// inverse covariance of the terms
    information: DMatrix<f64>,
    /// half the slope of 2 ln likelihood along each of them
    left: DVector<f64>,
    /// change of the values of the model's terms by a unit of each
    by: DMatrix<f64>,
}

impl Beyond {
    /// `None` where the fit itself is not determined.
    pub(crate) fn of(fitted: &Fit, causes: &[Term], data: Data<'_>) -> Option<Self> {
        let white = || Autoregression::white(1.0);
        let mut fitting = Fitting { data, noise: [white(), white(), white()], aside: fitted.set_aside.clone() };
        fitting.weigh(&fitted.model, &fitted.starts, true);
        let shared = fitted.model.terms.len();
        let model = causes.iter().fold(fitted.model.clone(), |m, cause| m.with(*cause));
        let more = model.terms.len() - shared;
        let (matrix, right) = fitting.equations(&model, &fitted.starts);
        let rest = |i: usize| if i < shared { i } else { i + more };
        let n = matrix.nrows() - more;
        let of_rest = DMatrix::from_fn(n, n, |i, j| matrix[(rest(i), rest(j))]);
        let right_of_rest = DVector::from_fn(n, |i, _| right[rest(i)]);
        let (mut taken, mut along) = (DMatrix::zeros(n, more), DMatrix::zeros(n, more));
        for k in 0..more {
            let column = DVector::from_fn(n, |i, _| matrix[(rest(i), shared + k)]);
            // the values take up what of the term they can
            taken.set_column(k, &solved(&of_rest, &column, 0.0)?);
            along.set_column(k, &column);
        }
        let own = matrix.view((shared, shared), (more, more)) - along.transpose() * &taken;
        Some(Self {
            terms: model.terms[shared..].to_vec(),
            information: 0.5 * (&own + own.transpose()),
            left: right.rows(shared, more) - taken.transpose() * right_of_rest,
            by: taken.rows(0, shared).into_owned(),
        })
    }

    /// What a cause would gain in 2 ln likelihood if it alone were added; as much as one can where nothing tells.
    pub(crate) fn gain(&self, cause: Term) -> f64 {
        let at: Vec<usize> = (0..self.terms.len()).filter(|&i| cause.cause().contains(&self.terms[i])).collect();
        let own = DMatrix::from_fn(at.len(), at.len(), |i, j| self.information[(at[i], at[j])]);
        let left = DVector::from_fn(at.len(), |i, _| self.left[at[i]]);
        solved(&own, &left, 0.0).map_or(f64::INFINITY, |by| left.dot(&by))
    }

    /// Covariance that the terms give to the values of the fit, each as far as the data leave room for it, and all values
    /// within its bound as likely before.
    fn held(&self, bound: impl Fn(Term) -> f64) -> Option<DMatrix<f64>> {
        let n = self.terms.len();
        let prior = DMatrix::from_fn(n, n, |i, j| if i == j { 3.0 / bound(self.terms[i]).powi(2) } else { 0.0 });
        let covariance = covariance(&(&self.information + prior), n);
        let most_likely = &covariance * &self.left;
        let square = covariance + &most_likely * most_likely.transpose();
        Some(&self.by * square * self.by.transpose()).filter(|held| held.iter().all(|v| v.is_finite()))
    }
}

/// Follows a model from the beginning of each run further and further on, so that what beats is never off by a cycle.
pub(crate) fn approach(model: &Model, data: Data<'_>) -> (Model, Vec<Start>) {
    let mut model = model.clone();
    let mut starts: Vec<Start> = data.runs.iter().map(|r| [r.seen[0][1], r.seen[0][2], r.seen[0][3]]).collect();
    for share in [16, 8, 4, 2] {
        let counts: Vec<usize> = data.counts.iter().map(|n| (n / share).max(16).min(*n)).collect();
        let white = || Autoregression::white(1.0);
        let aside = counts.iter().map(|n| vec![false; *n]).collect();
        let near = Fitting { data: Data { counts: &counts, ..data }, noise: [white(), white(), white()], aside };
        near.descend(&mut model, &mut starts, 6);
    }
    (model, starts)
}

/// The start of a run that nothing else is fitted to: least squares over (R, S, Q) at its first instant alone.
pub(crate) fn start_of(model: &Model, run: &DecayRun) -> Start {
    let u = &run.seen[0];
    let (mut start, n) = ([u[1], u[2], u[3]], run.len());
    let step = NUDGE * energy(u).max(f64::MIN_POSITIVE);
    for _ in 0..STEPS_OF_A_START {
        let base = model.predict(run, &start, n);
        let slopes: Vec<Vec<State>> = (0..3)
            .map(|k| {
                let mut s = start;
                s[k] += step;
                let up = model.predict(run, &s, n);
                up.iter().zip(&base).map(|(a, b)| (a - b) / step).collect()
            })
            .collect();
        let mut equations = NormalEquations::new(3);
        for i in 0..n {
            let weight = 1.0 / energy(&base[i]).max(f64::MIN_POSITIVE).sqrt();
            for c in 1..4 {
                let row = [0, 1, 2].map(|k: usize| weight * slopes[k][i][c]);
                equations.add(&row, weight * (run.seen[i][c] - base[i][c]));
            }
        }
        for (s, by) in start.iter_mut().zip(equations.solve()) {
            *s += by;
        }
    }
    start
}
