//! Branch and bound over boxes of inputs: the machine's result is within a tolerance of the real one, everywhere.
//!
//! A box on which the bound is too coarse is cut in two. So that the answer is not about nothing, and so that a false
//! claim is refuted rather than left open, the machine itself evaluates the middle of each box.

use std::f64::consts::TAU;
use std::fmt;

use cvg_model::Real;

use crate::rounded::on_every_path;
use crate::{Format, Interval, Rounded};

/// A formula whose rounding is to be bounded: the shipping function, as generic as that is.
pub trait Formula {
    /// What is computed from the inputs.
    fn outputs<T: Real>(&self, inputs: &[T]) -> Vec<T>;

    /// What the tolerance is relative to; 1 where it is absolute.
    fn scale<T: Real>(&self, inputs: &[T]) -> T {
        let _ = inputs;
        T::one()
    }
}

/// What was shown for all inputs of the boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded {
    /// boxes that were looked at
    pub boxes: usize,
    /// inputs at which the machine was run
    pub points: usize,
    /// the largest error bound, as a share of what is allowed
    pub share: f64,
}

/// Why a bound does not hold.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// false: the machine's result is further from the real one than allowed
    Refuted {
        /// the inputs
        at: Vec<f64>,
        /// at least this far
        error: f64,
        /// as far as this is allowed
        allowed: f64,
    },
    /// too coarse on this box, or too many boxes
    Undecided {
        /// where
        at: Vec<Interval>,
    },
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refuted { at, error, allowed } => write!(f, "{error:e} at {at:?}, where {allowed:e} is allowed"),
            Self::Undecided { at } => write!(f, "not shown on {at:?}"),
        }
    }
}

/// More boxes than this are not looked at.
const MOST_BOXES: usize = 400_000;
/// The machine is run in the middle of as many boxes.
pub const MOST_POINTS: usize = 20_000;

/// Shows that `factor` times what `F` computes is within `tolerance` · scale of the real value, for all inputs in each
/// of the `boxes`. The factor is 1 but where an error is planted.
///
/// # Errors
/// Where it is not so, or not shown.
///
/// # Panics
/// Where the machine's result lies outside of what the engine encloses: the engine or an assumption is then wrong.
pub fn bound_rounding<F: Format>(
    formula: &impl Formula,
    boxes: &[Vec<Interval>],
    tolerance: f64,
    factor: f64,
) -> Result<Bounded, Failure> {
    let mut bounded = Bounded { boxes: 0, points: 0, share: 0.0 };
    for whole in boxes {
        let mut open = vec![whole.clone()];
        while let Some(at) = open.pop() {
            bounded.boxes += 1;
            if bounded.points < MOST_POINTS {
                bounded.points += 1;
                check_point::<F>(formula, &at, tolerance, factor)?;
            }
            match share::<F>(formula, &at, tolerance, factor) {
                Some(share) if share <= 1.0 => bounded.share = bounded.share.max(share),
                _ if bounded.boxes >= MOST_BOXES => return Err(Failure::Undecided { at }),
                _ => open.extend(halves(&at, whole).ok_or(Failure::Undecided { at })?),
            }
        }
    }
    assert!(bounded.points > 0, "refused: no box, no claim");
    Ok(bounded)
}

/// The error bound on a box as a share of what is allowed there.
fn share<F: Format>(formula: &impl Formula, at: &[Interval], tolerance: f64, factor: f64) -> Option<f64> {
    let inputs: Vec<_> = at.iter().map(|i| Rounded::<F>::input(*i)).collect();
    let shares = on_every_path(|| {
        let allowed = tolerance * formula.scale(&inputs).real.lo;
        formula.outputs(&inputs).iter().fold(0.0_f64, |most, output| {
            let planted = (factor - 1.0).abs() * output.real.magnitude();
            let error = factor.abs().mul_add(output.error, planted);
            let share = if allowed > 0.0 { error / allowed } else { f64::INFINITY };
            // NaN counts as unbounded
            if share >= 0.0 { most.max(share) } else { f64::INFINITY }
        })
    })?;
    shares.into_iter().reduce(f64::max)
}

/// Runs the machine in the middle of a box.
fn check_point<F: Format>(formula: &impl Formula, at: &[Interval], tolerance: f64, factor: f64) -> Result<(), Failure> {
    let inputs: Vec<F> = at.iter().map(|i| F::from_f64(i.middle())).collect();
    let at: Vec<f64> = inputs.iter().map(|v| v.to_f64()).collect();
    let exact: Vec<_> = at.iter().map(|v| Rounded::<F>::input(Interval::point(*v))).collect();
    let machine = formula.outputs(&inputs);
    let Some(enclosed) = on_every_path(|| (formula.outputs(&exact), formula.scale(&exact))) else { return Ok(()) };
    let [(enclosed, scale)] = &enclosed[..] else { return Ok(()) };
    for (machine, enclosed) in machine.iter().zip(enclosed) {
        let value = machine.to_f64();
        let gap = |value: f64| (enclosed.real.lo - value).max(value - enclosed.real.hi).max(0.0);
        let turns = if enclosed.wraps { vec![value - TAU, value, value + TAU] } else { vec![value] };
        let near = turns.iter().map(|v| gap(*v)).fold(f64::INFINITY, f64::min);
        // 2π is not a number: a turn more or less is only known to this
        let slack = if enclosed.wraps { 4.0 * F::UNIT } else { 0.0 };
        let within = near <= enclosed.error.next_up() + slack;
        assert!(within, "at {at:?} the machine gives {value:e}, the engine encloses {enclosed:?}");
        let planted = turns.iter().map(|v| gap(factor * v)).fold(f64::INFINITY, f64::min);
        let allowed = tolerance * scale.real.hi;
        if planted > allowed + slack {
            return Err(Failure::Refuted { at, error: planted, allowed });
        }
    }
    Ok(())
}

/// A box cut across the side that is widest for what it was at first; none where no number lies between the ends.
fn halves(at: &[Interval], whole: &[Interval]) -> Option<[Vec<Interval>; 2]> {
    let relative = |n: usize| {
        let first = whole[n].width();
        if first > 0.0 { at[n].width() / first } else { 0.0 }
    };
    let side = (0..at.len()).max_by(|a, b| relative(*a).total_cmp(&relative(*b)))?;
    let middle = at[side].middle();
    if !(at[side].lo < middle && middle < at[side].hi) {
        return None;
    }
    let (mut low, mut high) = (at.to_vec(), at.to_vec());
    (low[side].hi, high[side].lo) = (middle, middle);
    Some([low, high])
}
