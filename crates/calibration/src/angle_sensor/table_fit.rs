//! The fit of a table, and beside it of how the angle follows motion and of isolated lines of the reference.

use super::gap::Gap;
use super::readout_fit::centre;
use crate::model::angle_table::{AngleTable, Form};
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::root_mean_square;

/// How the angle follows motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Motion {
    /// at once
    None,
    /// off by a constant whose sign is that of the rate
    Direction,
    /// late
    Rate,
    /// late, and with the acceleration error that a type-II tracking loop has by construction
    RateAndAcceleration,
}

impl Motion {
    /// Unknowns.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::None => 0,
            Self::Direction | Self::Rate => 1,
            Self::RateAndAcceleration => 2,
        }
    }
}

/// What is adjusted beside the constant of each run.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Shape {
    pub(crate) form: Form,
    /// harmonics 1 … order of the angle's period
    pub(crate) order: usize,
    pub(crate) motion: Motion,
    /// isolated harmonics of the reference's turn
    pub(crate) lines: Vec<u32>,
    /// the angular gain is adjusted, because nothing says that it is exact
    pub(crate) free_gain: bool,
}

impl Shape {
    /// Nothing but the constants.
    pub(crate) fn constant(free_gain: bool) -> Self {
        Self { form: Form::Own, order: 0, motion: Motion::None, lines: Vec::new(), free_gain }
    }

    /// Unknowns beside the constants.
    pub(crate) fn size(&self) -> usize {
        2 * self.order + self.side()
    }

    /// Unknowns that are neither of the series nor constants.
    pub(crate) fn side(&self) -> usize {
        self.motion.size() + usize::from(self.free_gain) + 2 * self.lines.len()
    }
}

/// A sample of a run as the table sees it: the readout undone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    /// the sensor's angle, rad
    pub(crate) theta: f64,
    /// θ less the gain times the reference, unwrapped, rad
    pub(crate) error: f64,
    pub(crate) reference: f64,
    pub(crate) rate: f64,
    pub(crate) acceleration: f64,
    /// run that it belongs to
    pub(crate) run: usize,
}

/// Gauss–Newton steps of the forward form, and the step below which they stop, rad.
const STEPS: usize = 6;
const CONVERGED: f64 = 1e-9;

/// A coefficient of a table above this many times the scatter of the errors is none of them: rows over a part of the period leave
/// harmonics that nearly cancel there as they like, and the angle would be off by as much in the rest.
const LARGEST_COEFFICIENT: f64 = 5.0;
/// Least share of that scatter that counts as noise where coefficients are held to it.
const LEAST_NOISE: f64 = 1e-3;

/// A fitted table with all that stands beside it.
#[derive(Debug, Clone)]
pub(crate) struct TableFit {
    pub(crate) shape: Shape,
    pub(crate) table: AngleTable,
    /// motion, gain, lines: in the order of [`side_columns`]
    pub(crate) side: Vec<f64>,
    /// constants by run; none where the run was not fitted
    pub(crate) constants: Vec<Option<f64>>,
    /// which lines the samples meet at one phase only
    pub(crate) at_one_phase: Vec<bool>,
    /// harmonics of an angle of period P are at n·`cycles`
    pub(crate) cycles: f64,
}

/// What multiplies the unknowns beside the series.
pub(crate) fn side_columns(shape: &Shape, s: &Sample, out: &mut Vec<f64>) {
    match shape.motion {
        Motion::None => {}
        Motion::Direction => out.push(if s.rate == 0.0 { 0.0 } else { s.rate.signum() }),
        Motion::Rate => out.push(s.rate),
        Motion::RateAndAcceleration => out.extend([s.rate, s.acceleration]),
    }
    if shape.free_gain {
        out.push(s.reference);
    }
    for &n in &shape.lines {
        let (sin, cos) = (f64::from(n) * s.reference).sin_cos();
        out.extend([cos, sin]);
    }
}

/// cos nx and sin nx for n = 1 … order, alternating.
fn push_harmonics(angle: f64, order: usize, out: &mut Vec<f64>) {
    let (sin_1, cos_1) = angle.sin_cos();
    let (mut sin, mut cos) = (0.0, 1.0);
    for _ in 0..order {
        (sin, cos) = (sin * cos_1 + cos * sin_1, cos * cos_1 - sin * sin_1);
        out.extend([cos, sin]);
    }
}

/// Share of a line's power below which its weaker phase is not seen: engineering choice.
const UNSEEN_PHASE: f64 = 0.01;

/// Stations at twice a line's frequency meet it at one phase (and its opposite) only: the direction of that phase among
/// cosine and sine. `None` where both are seen.
pub(crate) fn only_phase(n: f64, samples: &[Sample]) -> Option<[f64; 2]> {
    // cos and sin of twice the phase: their length is the share of the stronger phase less that of the weaker
    let (c, s) = samples.iter().fold((0.0, 0.0), |(c, s), sample| {
        let (sin, cos) = (2.0 * n * sample.reference).sin_cos();
        (c + cos, s + sin)
    });
    let weaker = 0.5 * (1.0 - c.hypot(s) / samples.len().max(1) as f64);
    let (sin, cos) = (0.5 * s.atan2(c)).sin_cos();
    (weaker < UNSEEN_PHASE).then_some([cos, sin])
}

impl TableFit {
    /// Fits the shape to samples of `runs` runs; `None` where the forward form has no inverse. Where a part of the period has no row, or
    /// coefficients come out larger than errors of this scatter can have, they are fitted anew, those of harmonic n each believed to be no
    /// larger than a share 1/n of the scatter (ridge regression, Hoerl and Kennard 1970, with the ratio of the variances of noise and
    /// errors): harmonics that all but cancel where rows are would be anything elsewhere.
    pub(crate) fn new(shape: &Shape, samples: &[Sample], runs: usize, cycles: f64) -> Option<Self> {
        let free = Self::believing(shape, samples, runs, cycles, 0.0)?;
        let scatter = root_mean_square(&by_run(samples, runs, |s| s.error).concat());
        let largest = free.table.cos.iter().chain(&free.table.sin).fold(0.0, |m: f64, c| m.max(c.abs()));
        let lacks_a_part = shape.order > 1 && !Gap::all(samples.iter().map(|s| s.theta), cycles).is_empty();
        if !lacks_a_part && largest <= LARGEST_COEFFICIENT * scatter {
            return Some(free);
        }
        let left: f64 = samples.iter().filter_map(|s| Some((free.left(s) - free.constants[s.run]?).powi(2))).sum();
        let degrees_of_freedom = samples.len().saturating_sub(shape.size() + runs).max(1) as f64;
        let share = (left / degrees_of_freedom).sqrt().max(LEAST_NOISE * scatter) / scatter;
        Self::believing(shape, samples, runs, cycles, share)
    }

    /// The fit where each coefficient of harmonic n is believed to be nothing, as much as one row is believed n times `noise`.
    fn believing(shape: &Shape, samples: &[Sample], runs: usize, cycles: f64, noise: f64) -> Option<Self> {
        let mut column = vec![None; runs];
        let mut present = 0;
        for s in samples {
            column[s.run].get_or_insert_with(|| {
                present += 1;
                present - 1
            });
        }
        let (order, side) = (shape.order, shape.side());
        let forward = shape.form == Form::Forward && order > 0;
        let mut x = vec![0.0; present + side + 2 * order];
        let mut row = Vec::with_capacity(x.len());
        let mut sides = Vec::with_capacity(side);
        let phases: Vec<Option<[f64; 2]>> = shape.lines.iter().map(|n| only_phase(f64::from(*n), samples)).collect();
        let first_line = side - 2 * shape.lines.len();
        for _ in 0..if forward { STEPS } else { 1 } {
            let table = series(shape.form, &x[present + side..]);
            let mut equations = NormalEquations::new(x.len());
            for s in samples {
                let own = column[s.run]?;
                sides.clear();
                side_columns(shape, s, &mut sides);
                for (pair, phase) in sides[first_line..].chunks_exact_mut(2).zip(&phases) {
                    if let Some([u, v]) = phase {
                        pair.copy_from_slice(&[u * pair[0] + v * pair[1], 0.0]);
                    }
                }
                let moved = x[own] + sides.iter().zip(&x[present..]).map(|(a, b)| a * b).sum::<f64>();
                let at = if forward { s.theta - s.error + moved } else { s.theta };
                let (value, slope) = if forward { table.at(at, cycles) } else { (0.0, 0.0) };
                row.clear();
                row.resize(present, 0.0);
                row[own] = 1.0 + slope;
                row.extend(sides.iter().map(|v| v * (1.0 + slope)));
                push_harmonics(cycles * at, order, &mut row);
                equations.add(&row, s.error - moved - value);
            }
            for (of_series, at) in (present + side..x.len()).enumerate().filter(|_| noise > 0.0) {
                let belief = noise * (of_series / 2 + 1) as f64;
                row.clear();
                row.resize(x.len(), 0.0);
                row[at] = belief;
                equations.add(&row, -belief * x[at]);
            }
            let step = equations.solve();
            for (a, b) in x.iter_mut().zip(&step) {
                *a += b;
            }
            if step.iter().all(|d| d.abs() < CONVERGED) {
                break;
            }
        }
        for (pair, phase) in x[present + first_line..present + side].chunks_exact_mut(2).zip(&phases) {
            if let Some([u, v]) = phase {
                pair.copy_from_slice(&[u * pair[0], v * pair[0]]);
            }
        }
        let fitted = Self {
            shape: shape.clone(),
            table: series(shape.form, &x[present + side..]),
            side: x[present..present + side].to_vec(),
            constants: column.iter().map(|c| c.map(|c| x[c])).collect(),
            at_one_phase: phases.iter().map(Option::is_some).collect(),
            cycles,
        };
        let sound = x.iter().all(|v| v.is_finite()) && (!forward || fitted.table.is_invertible(cycles));
        sound.then_some(fitted)
    }

    /// By how much the angular gain was adjusted.
    pub(crate) fn moved_gain(&self) -> f64 {
        if self.shape.free_gain { self.side[self.shape.motion.size()] } else { 0.0 }
    }

    /// Takes a line for nothing.
    pub(crate) fn without_line(&mut self, at: usize) {
        let first = self.shape.side() - 2 * (self.shape.lines.len() - at);
        self.side[first..first + 2].fill(0.0);
    }

    /// Error of the compensated angle; the run's constant is not taken out.
    pub(crate) fn left(&self, s: &Sample) -> f64 {
        let mut sides = Vec::with_capacity(self.side.len());
        side_columns(&self.shape, s, &mut sides);
        let moved: f64 = sides.iter().zip(&self.side).map(|(a, b)| a * b).sum();
        s.error + (self.table.undo(s.theta, self.cycles) - s.theta) - moved
    }
}

/// A value of the samples of each run, about its mean.
pub(crate) fn by_run(samples: &[Sample], runs: usize, value: impl Fn(&Sample) -> f64) -> Vec<Vec<f64>> {
    let mut out = vec![Vec::new(); runs];
    for s in samples {
        out[s.run].push(value(s));
    }
    out.iter_mut().for_each(|v| centre(v));
    out
}

fn series(form: Form, coefficients: &[f64]) -> AngleTable {
    AngleTable {
        form,
        cos: coefficients.iter().step_by(2).copied().collect(),
        sin: coefficients.iter().skip(1).step_by(2).copied().collect(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// 4 per turn of 8° with overtones, over one turn there and back: what a wiring fault makes.
    fn faulty(theta_of: impl Fn(f64) -> f64) -> Vec<Sample> {
        (0..600)
            .map(|i| {
                let phase = f64::from(i) / 300.0;
                let (reference, rate) = if phase < 1.0 { (phase * 6.4, 2.0) } else { ((2.0 - phase) * 6.4, -2.0) };
                let theta = theta_of(reference - 0.003 * rate + 0.4);
                Sample { theta, error: theta - reference, reference, rate, acceleration: 0.0, run: 0 }
            })
            .collect()
    }

    #[test]
    fn a_line_at_half_the_spacing_of_stations_is_fitted_at_the_one_phase_that_they_see() {
        for start in [0.0, 0.03] {
            let samples: Vec<Sample> = (0..36)
                .map(|i| {
                    let reference = f64::from(i).mul_add(10f64.to_radians(), start);
                    let error = 1e-3 * (18.0 * (reference - start)).cos();
                    Sample { theta: reference + error, error, reference, rate: 1.0, acceleration: 0.0, run: 0 }
                })
                .collect();
            let shape = Shape { form: Form::Own, order: 0, motion: Motion::None, lines: vec![18], free_gain: false };
            let fitted = TableFit::new(&shape, &samples, 1, 1.0).unwrap();
            assert!(samples.iter().all(|s| fitted.left(s).abs() < 1e-9));
            assert!((fitted.side[0].hypot(fitted.side[1]) - 1e-3).abs() < 1e-9, "{:?}", fitted.side);
        }
    }

    #[test]
    fn a_large_error_with_overtones_is_fitted_in_one_go_and_survives_reversal() {
        let planted = AngleTable {
            form: Form::Forward,
            cos: vec![0.0, 0.0, 0.0, 0.12, 0.0, 0.0, 0.0, 0.01],
            sin: vec![0.0, 0.0, 0.0, 0.06, 0.0, 0.0, 0.0, 0.002],
        };
        let samples = faulty(|phi| phi + planted.at(phi, 1.0).0);
        let shape = Shape { form: Form::Forward, order: 8, motion: Motion::Rate, lines: vec![], free_gain: false };
        let fitted = TableFit::new(&shape, &samples, 1, 1.0).unwrap();
        assert!((fitted.side[0] + 0.003).abs() < 1e-6, "{:?}", fitted.side);
        for (a, b) in fitted.table.cos.iter().zip(&planted.cos) {
            assert!((a - b).abs() < 1e-6, "{:?}", fitted.table);
        }
        let constant = fitted.constants[0].unwrap();
        assert!(samples.iter().all(|s| (fitted.left(s) - constant).abs() < 1e-6));
    }
}
