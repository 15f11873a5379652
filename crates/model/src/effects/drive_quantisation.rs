//! Drives behind a converter of few steps: each axis' force is rounded to a whole number of steps, both phases apart,
//! F → round(F/step)·step.
//!
//! The step is one of volts of command, and 0 is "none": what amplifiers, unequal gains, a skew and a phase make of the forces comes
//! after it. While the pattern turns, the command of an axis sweeps across the steps and what is put out is off by a sawtooth of half a
//! step; a command that its loop holds at the edge of a step goes to and fro between two of them. What pushes along the pattern by that
//! is taken up by the energy loop, what pushes across it turns the pattern.

use super::{Belief, Description, Effect, Moment, Parameter, Role, Scaling, Shown, Stage, Values};
use crate::{AxisForces, Real};

/// coarse steps of the drives.
pub struct DriveQuantisation;

impl Effect for DriveQuantisation {
    const DESCRIPTION: Description = Description {
        id: "drive-quantisation",
        title: "coarse steps of the drives",
        stage: Stage::Actuation,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[Parameter {
            name: "step",
            unit: "V",
            lower: 0.0,
            upper: 1e6,
            neutral: 0.0,
            scale: 1e-2,
            role: Role::Fitted,
            belief: Belief::Vague,
        }],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "ȧ/a and q̇/a off by a sawtooth of half a step over the command of each axis; a precession of as much over a, \
                    at every even harmonic of θ, where the energy command is a few steps",
        scaling: Scaling { rate: -1, amplitude: -1, odd_in_rate: true },
        source: "rounding quantiser (Widrow and Kollár 2008)",
    };

    #[inline]
    fn actuate<T: Real>(&[step, ..]: &Values<T>, f: AxisForces<T>, _: &Moment<T>) -> AxisForces<T> {
        if step > T::zero() {
            let [x_c, x_s, y_c, y_s] = [f.x_c, f.x_s, f.y_c, f.y_s].map(|force| rounded(force, step));
            AxisForces { x_c, x_s, y_c, y_s }
        } else {
            f
        }
    }
}

/// The multiple of `step` that is nearest to `force`: the force less what it has beyond that, which is arg e^{2πi F/step} of a turn.
///
/// Beyond [`MOST_STEPS`] the step is finer than any converter's, and nothing is rounded.
#[inline]
fn rounded<T: Real>(force: T, step: T) -> T {
    let steps = force / step;
    if steps.squared() < T::ratio(MOST_STEPS, 1).squared() {
        let turn = T::two() * T::zero().atan2(-T::one());
        let (sin, cos) = (turn * steps).sin_cos();
        force - step * (sin.atan2(cos) / turn)
    } else {
        force
    }
}

/// Steps of a converter of 17 bits to either side of zero: engineering choice.
const MOST_STEPS: i32 = 65_536;
