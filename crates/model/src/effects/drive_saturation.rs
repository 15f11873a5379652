//! Drives whose amplifiers clip at a level: each axis' force is scaled by the describing function of saturation,
//! N = (2/π)(asin r + r√(1−r²)) with r = level/|F| < 1, in both phases alike.
//!
//! The parameter is 1/level, so that 0 is "never". The level is one of volts of command: what unequal gains, a skew and a
//! phase make of the forces comes after it. While the pattern is along an axis all of a command is that axis' to push, and
//! between the axes each has 1/√2 of it: a command that just reaches the level loses by N at multiples of 90° and nothing
//! elsewhere. The loops ask for more, so that the quadrature balance tells it; v_as, which comes out unequally on both axes
//! beside a large v_qc, pushes the pattern along, but hardly.

use super::detection_saturation::clipped_gain;
use super::{Belief, Description, Effect, Moment, Parameter, Role, Scaling, Shown, Stage, Values};
use crate::{AxisForces, Real};

/// clipping of the drives.
pub struct DriveSaturation;

impl Effect for DriveSaturation {
    const DESCRIPTION: Description = Description {
        id: "drive-saturation",
        title: "clipping of the drives",
        stage: Stage::Actuation,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[Parameter {
            name: "inverse_level",
            unit: "1/V",
            lower: 0.0,
            upper: 1e6,
            neutral: 0.0,
            scale: 1e-3,
            role: Role::Fitted,
            belief: Belief::Vague,
        }],
        onsets: &[1.02, 1.3, 2.0, 4.0],
        shown: &[Shown::Plain(0)],
        signature: "v_as and v_qc larger at multiples of 90°, from a threshold of the command; a precession of \
                    (N_y − N_x) v_as/2a sin 2θ, at 4θ, 8θ … ∝ 1/(τΩ)",
        scaling: Scaling { rate: -1, amplitude: 2, odd_in_rate: true },
        source: "describing function of saturation (Gelb and Vander Velde 1968)",
    };

    #[inline]
    fn actuate<T: Real>(&[inverse_level, ..]: &Values<T>, f: AxisForces<T>, _: &Moment<T>) -> AxisForces<T> {
        let x = clipped_gain(inverse_level * f.x_c.norm(f.x_s));
        let y = clipped_gain(inverse_level * f.y_c.norm(f.y_s));
        AxisForces { x_c: x * f.x_c, x_s: x * f.x_s, y_c: y * f.y_c, y_s: y * f.y_s }
    }
}
