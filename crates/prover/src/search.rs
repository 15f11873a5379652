//! Branch and bound over boxes of inputs: the machine's result is within a tolerance of the real one, everywhere.
//!
//! A box on which the bound is too coarse is cut in two. So that the answer is not about nothing, and so that a false
//! claim is refuted rather than left open, the machine itself evaluates the middle of each box.

use std::f64::consts::TAU;
use std::fmt;

use cvg_model::Float;

use crate::rounded::{Follows, on_every_path};
use crate::{Format, Interval, Rounded};

/// A formula whose rounding is to be bounded: the shipping function, as generic as that is.
pub trait Formula {
    /// What is computed from the inputs.
    fn outputs<T: Float>(&self, inputs: &[T]) -> Vec<T>;

    /// How far the machine's inputs may be from the real ones, by what came before; one for each, or none where it holds
    /// them exactly.
    fn input_errors(&self) -> &[f64] {
        &[]
    }

    /// What the tolerance is relative to; 1 where it is absolute.
    fn scale<T: Float>(&self, inputs: &[T]) -> T {
        let _ = inputs;
        T::one()
    }

    /// Results that are this many turns of 360° apart are the same result: ½ for the angle of a pattern, 0 where no two
    /// are. Without it a bound holds between the numbers themselves.
    fn period_turns(&self) -> f64 {
        0.0
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
    /// no box, or no result on this box: nothing is claimed
    Nothing {
        /// where
        at: Vec<Interval>,
    },
    /// too coarse on this box, too many boxes, or machine and real numbers may branch apart
    Undecided {
        /// where
        at: Vec<Interval>,
    },
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refuted { at, error, allowed } => write!(f, "{error:e} at {at:?}, where {allowed:e} is allowed"),
            Self::Nothing { at } => write!(f, "nothing is claimed on {at:?}"),
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
    if bounded.points == 0 { Err(Failure::Nothing { at: Vec::new() }) } else { Ok(bounded) }
}

/// The inputs of a box, and how far the machine's may be from them.
fn enclosed<F: Format>(formula: &impl Formula, at: &[Interval]) -> Vec<Rounded<F>> {
    let errors = formula.input_errors();
    assert!(errors.is_empty() || errors.len() == at.len(), "one error for each input, or none");
    let error = |k: usize| errors.get(k).copied().unwrap_or(0.0);
    at.iter().enumerate().map(|(k, side)| Rounded::input_within(*side, error(k))).collect()
}

/// The error bound on a box as a share of what is allowed there.
fn share<F: Format>(formula: &impl Formula, at: &[Interval], tolerance: f64, factor: f64) -> Option<f64> {
    let inputs = enclosed::<F>(formula, at);
    let period = formula.period_turns();
    let shares = on_every_path(Follows::Both, || {
        let allowed = (tolerance * formula.scale(&inputs).real.lo).next_down();
        let outputs = formula.outputs(&inputs);
        // no result is no bound
        let least = if outputs.is_empty() { f64::INFINITY } else { 0.0 };
        outputs.iter().fold(least, |most, output| {
            let same = period > 0.0 && (output.turns / period).fract() == 0.0;
            let apart = if same { output.error } else { output.settled().error };
            let planted = ((factor - 1.0).abs() * output.real.magnitude()).next_up();
            let error = if factor == 1.0 { apart } else { factor.abs().mul_add(apart, planted).next_up() };
            let share = if allowed > 0.0 { (error / allowed).next_up() } else { f64::INFINITY };
            // NaN counts as unbounded
            if share >= 0.0 { most.max(share) } else { f64::INFINITY }
        })
    })?;
    shares.into_iter().reduce(f64::max)
}

/// Runs the machine in the middle of a box, with its inputs off by as much as they may be: what it gives has to lie in what
/// the engine encloses, and is refuted where it is too far from the real value, whichever way each of the two branches.
fn check_point<F: Format>(formula: &impl Formula, at: &[Interval], tolerance: f64, factor: f64) -> Result<(), Failure> {
    let inputs: Vec<F> = at.iter().map(|i| F::from_f64(i.middle())).collect();
    let middle: Vec<f64> = inputs.iter().map(|v| v.to_f64()).collect();
    if at.iter().zip(&middle).any(|(side, value)| !side.contains(*value)) {
        return Ok(());
    }
    let points: Vec<_> = middle.iter().map(|v| Interval::point(*v)).collect();
    let exact = enclosed::<F>(formula, &points);
    let machine = formula.outputs(&moved::<F>(formula, &middle));
    if machine.is_empty() {
        return Err(Failure::Nothing { at: at.to_vec() });
    }
    let evaluate = || (formula.outputs(&exact), formula.scale(&exact));
    if let Some([(enclosed, _)]) = on_every_path(Follows::Both, evaluate).as_deref() {
        assert_eq!(machine.len(), enclosed.len(), "at {middle:?} the engine has other results than the machine");
        for (machine, enclosed) in machine.iter().zip(enclosed) {
            let value = machine.to_f64();
            let within = gap::<F>(value, enclosed.real, enclosed.turns) <= enclosed.error.next_up();
            assert!(within, "at {middle:?} the machine gives {value:e}, the engine encloses {enclosed:?}");
        }
    }
    let Some(real) = on_every_path(Follows::Reals, evaluate) else { return Ok(()) };
    let [(real, scale)] = &real[..] else { return Ok(()) };
    let period = formula.period_turns();
    for (machine, real) in machine.iter().zip(real) {
        let error = gap::<F>(factor * machine.to_f64(), real.real, period);
        let allowed = tolerance * scale.real.hi;
        if error > allowed {
            return Err(Failure::Refuted { at: middle, error, allowed });
        }
    }
    Ok(())
}

/// What the machine holds where it is off by as much as it may be, on either side by turns.
fn moved<F: Format>(formula: &impl Formula, at: &[f64]) -> Vec<F> {
    let errors = formula.input_errors();
    let one = |(k, value): (usize, &f64)| {
        let error = errors.get(k).copied().unwrap_or(0.0);
        let moved = F::from_f64(if k % 2 == 0 { value + error } else { value - error });
        if (moved.to_f64() - value).abs() <= error { moved } else { F::from_f64(*value) }
    };
    at.iter().enumerate().map(one).collect()
}

/// How far `value` is from `real` at least, up to `turns` forward or back; infinitely far where it is no number.
fn gap<F: Format>(value: f64, real: Interval, turns: f64) -> f64 {
    if value.is_nan() {
        return f64::INFINITY;
    }
    let to = |value: f64| (real.lo - value).max(value - real.hi).max(0.0);
    if turns == 0.0 {
        return to(value);
    }
    // 2π is not a number: a turn more or less is only known to this
    let further = [-1.0, 1.0].map(|n| (to(value + n * turns * TAU) - 4.0 * F::UNIT).max(0.0));
    to(value).min(further[0]).min(further[1])
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
