//! The fit of a readout to what is known of it: the angle against the reference, and the radius, which a sensor holds.

use super::ellipse;
use super::readout::{Kind, Readout, Unknown};
use super::samples::SensorRun;
use crate::numerics::angles::wrapped;
use crate::numerics::linear::NormalEquations;

/// How much angle and radius count against each other. None is right for all devices: which one predicts the angle best
/// is found by cross-validation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Weighting {
    /// alike: noise of the channels is round
    Equal,
    /// by their own variances, estimated with the readout (restricted for the unknowns)
    VarianceComponents,
    /// the angle alone; the radius only where the angle is silent
    Angle,
    /// the radius alone: the reference is not to be believed
    Radius,
}

impl Weighting {
    pub(crate) const ALL: [Self; 4] = [Self::Equal, Self::VarianceComponents, Self::Angle, Self::Radius];

    fn weights(self) -> [f64; 2] {
        match self {
            Self::Equal | Self::VarianceComponents => [1.0, 1.0],
            Self::Angle => [1.0, 1e-3],
            Self::Radius => [0.0, 1.0],
        }
    }
}

impl Kind {
    /// Whether what is weighted so tells all parameters of this kind apart. To first order both angle and radius hold
    /// ½ ln g and (κ_x − κ_y)/8 in their harmonic 2, as a sum in the one and as a difference in the other: each alone leaves
    /// the gain and cubics of the channels confounded, and the radius any cubic.
    pub(crate) fn is_told_by(self, weighting: Weighting) -> bool {
        match weighting {
            Weighting::Equal | Weighting::VarianceComponents => true,
            Weighting::Angle => self < Self::CubicPerChannel,
            Weighting::Radius => self < Self::Cubic,
        }
    }
}

/// Rounds of reweighting of [`Weighting::VarianceComponents`].
const REWEIGHTINGS: usize = 4;
/// A weight does not go below this.
const LEAST_WEIGHT: f64 = 1e-3;
/// How far a parameter may move from where the fit begins.
const REACH: f64 = 3.0;
/// Steps, convergence and damping of the Levenberg–Marquardt iteration; the step of its difference quotients.
const STEPS: usize = 40;
const CONVERGED: f64 = 1e-10;
const DAMPING: f64 = 1e-4;
const DIFFERENCE: f64 = 1e-6;

/// A fitted readout.
#[derive(Debug, Clone)]
pub(crate) struct ReadoutFit {
    pub(crate) readout: Readout,
    /// weighted sum of squares of what is left, mean square per row
    pub(crate) cost: f64,
}

/// Residuals of angle and ln radius, means of each run taken out.
struct Residuals {
    angle: Vec<f64>,
    radius: Vec<f64>,
}

/// The readings of some runs with effects as text undone, kept as long as those do not change: their inverse is by iteration.
struct Undone<'a> {
    runs: &'a [SensorRun],
    /// the readout that it was done for last
    by: Option<Readout>,
    /// off the rails: readings and references of each run
    rows: Vec<Vec<([f64; 2], f64)>>,
}

impl<'a> Undone<'a> {
    fn new(runs: &'a [SensorRun]) -> Self {
        Self { runs, by: None, rows: Vec::new() }
    }

    fn rows(&mut self, readout: &Readout) -> &[Vec<([f64; 2], f64)>] {
        let kept = self.by.as_ref().is_some_and(|by| by.texts == readout.texts && by.rails == readout.rails);
        if !kept {
            let of_run = |run: &SensorRun| {
                let rows = run.channels().into_iter().flatten().zip(&run.reference_rad);
                let off_rails = rows.filter(|(z, _)| !readout.rails.clips(**z));
                off_rails.map(|(z, a)| (readout.without_texts(*z), *a)).collect()
            };
            self.rows = self.runs.iter().map(of_run).collect();
            self.by = Some(readout.clone());
        }
        &self.rows
    }
}

fn residuals(readout: &Readout, undone: &mut Undone<'_>, harmonic_gain: f64, with_angle: bool) -> Residuals {
    let mut out = Residuals { angle: Vec::new(), radius: Vec::new() };
    for rows in undone.rows(readout) {
        let (from_angle, from_radius) = (out.angle.len(), out.radius.len());
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (z, a) in rows {
            let [x, y] = readout.undo_own(*z);
            out.radius.push(0.5 * (x * x + y * y + 1e-18).ln());
            if with_angle {
                let d = y.atan2(x) - harmonic_gain * a;
                let (s, c) = d.sin_cos();
                (sine, cosine) = (sine + s, cosine + c);
                out.angle.push(d);
            }
        }
        let middle = sine.atan2(cosine);
        for d in &mut out.angle[from_angle..] {
            *d = wrapped(*d - middle, std::f64::consts::TAU);
        }
        centre(&mut out.angle[from_angle..]);
        centre(&mut out.radius[from_radius..]);
    }
    out
}

/// Takes the mean out.
pub(crate) fn centre(values: &mut [f64]) {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    for v in values {
        *v -= mean;
    }
}

/// Fits a readout of `kind` from `start`. `harmonic_gain` turns the reference into the angle that the channels see.
pub(crate) fn fit(
    kind: Kind,
    weighting: Weighting,
    runs: &[SensorRun],
    harmonic_gain: f64,
    start: &Readout,
) -> Option<ReadoutFit> {
    let begun = start.of_kind(kind);
    if kind == Kind::Plain {
        let radius = mean_radius(&begun, runs);
        return Some(ReadoutFit { readout: Readout { radius, ..begun }, cost: 0.0 });
    }
    let mut weights = weighting.weights();
    let mut fitted = ReadoutFit { readout: begun.clone(), cost: 0.0 };
    let mut undone = Undone::new(runs);
    let rounds = if weighting == Weighting::VarianceComponents { REWEIGHTINGS } else { 1 };
    for _ in 0..rounds {
        fitted = levenberg_marquardt(fitted.readout, &begun, |r| weighted(r, &mut undone, harmonic_gain, weights))?;
        if weighting == Weighting::VarianceComponents {
            weights = balanced(&residuals(&fitted.readout, &mut undone, harmonic_gain, true));
        }
    }
    fitted.readout.radius = mean_radius(&fitted.readout, runs);
    fitted.readout.is_sound().then_some(fitted)
}

/// Geometric mean of the radius over rows away from any rail.
fn mean_radius(readout: &Readout, runs: &[SensorRun]) -> f64 {
    let readings = runs.iter().filter_map(SensorRun::channels).flatten().filter(|z| !readout.rails.clips(**z));
    let (n, sum) = readings.fold((0.0, 0.0), |(n, sum), z| (n + 1.0, sum + readout.ln_radius(*z)));
    if n > 0.0 { (sum / n).exp() } else { 1.0 }
}

/// Weights that make angle and radius count by their own scatter; the larger is one.
fn balanced(r: &Residuals) -> [f64; 2] {
    let deviation = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len().max(1) as f64).sqrt().max(1e-9);
    let (angle, radius) = (deviation(&r.angle), deviation(&r.radius));
    [(radius / angle).clamp(LEAST_WEIGHT, 1.0), (angle / radius).clamp(LEAST_WEIGHT, 1.0)]
}

fn weighted(readout: &Readout, undone: &mut Undone<'_>, harmonic_gain: f64, weights: [f64; 2]) -> Vec<f64> {
    let mut r = residuals(readout, undone, harmonic_gain, weights[0] > 0.0);
    r.angle.iter_mut().for_each(|v| *v *= weights[0]);
    r.angle.extend(r.radius.iter().map(|v| v * weights[1]));
    r.angle
}

/// Levenberg–Marquardt over the unknowns of a readout, not far from `origin`.
fn levenberg_marquardt(
    start: Readout,
    origin: &Readout,
    mut residuals: impl FnMut(&Readout) -> Vec<f64>,
) -> Option<ReadoutFit> {
    let free = start.free();
    let within = |unknown: Unknown, value: f64| match unknown {
        Unknown::Own(i) => value.clamp(origin.p[i] - REACH, origin.p[i] + REACH),
        // an effect as text has bounds of its own
        Unknown::Text(..) => value,
    };
    let squares = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
    let (mut at, mut damping) = (start, DAMPING);
    let mut left = residuals(&at);
    let mut cost = squares(&left);
    for _ in 0..STEPS {
        let slopes: Vec<Vec<f64>> = free
            .iter()
            .map(|&i| {
                let (moved, by) = nudged(&at, i);
                residuals(&moved).iter().zip(&left).map(|(a, b)| (a - b) / by).collect()
            })
            .collect();
        let mut improved = false;
        while !improved && damping < 1e8 {
            let step = damped_step(&slopes, &left, damping);
            let mut moved = at.clone();
            for (&i, d) in free.iter().zip(&step) {
                moved.set(i, within(i, moved.value(i) - d));
            }
            let there = residuals(&moved);
            let next = squares(&there);
            if next.is_finite() && next < cost {
                let done = cost - next < CONVERGED * cost;
                (at, left, cost, improved) = (moved, there, next, true);
                damping *= 0.1;
                if done {
                    damping = f64::INFINITY;
                }
            } else {
                damping *= 10.0;
            }
        }
        if damping >= 1e8 {
            break;
        }
    }
    let rows = left.len().max(1) as f64;
    cost.is_finite().then_some(ReadoutFit { readout: at, cost: cost / rows })
}

/// A readout with one unknown moved by a little, inwards from a bound; and by how much.
fn nudged(readout: &Readout, unknown: Unknown) -> (Readout, f64) {
    let from = readout.value(unknown);
    let moved = |by: f64| {
        let mut moved = readout.clone();
        moved.set(unknown, from + by);
        moved
    };
    let up = moved(DIFFERENCE);
    if up.value(unknown) > from { (up, DIFFERENCE) } else { (moved(-DIFFERENCE), -DIFFERENCE) }
}

fn damped_step(slopes: &[Vec<f64>], left: &[f64], damping: f64) -> Vec<f64> {
    let n = slopes.len();
    let mut equations = NormalEquations::new(n);
    let mut row = vec![0.0; n];
    for (i, value) in left.iter().enumerate() {
        for (entry, column) in row.iter_mut().zip(slopes) {
            *entry = column[i];
        }
        equations.add(&row, *value);
    }
    equations.damped(damping).solve()
}
/// Where the fits of a readout begin.
pub(crate) fn starts(runs: &[SensorRun], gain: f64) -> Vec<Readout> {
    [ellipse::by_reference(runs, gain), ellipse::algebraic(runs)].into_iter().flatten().collect()
}
