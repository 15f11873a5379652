//! Commands along the orbit's axes → commands of the X and Y drives: Equation 9, with the actuation's imperfections
//! inverted beforehand, within the drives' limit.
//!
//! It refuses to find the direction: it takes its cosine and sine.

use cvg_model::effects::{EffectId, MAX_PARAMETERS, Moment, Stage, Values};
use cvg_model::{ActuationGains, AxisForces, ControlOutputs, Float};

use crate::{ConfigError, Status, positive};

/// What the loops ask along the orbit, V: major (a) and minor (q) axis, in phase (c) and in quadrature (s).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct OrbitCommands<T> {
    /// energy
    pub v_as: T,
    /// precession
    pub v_qs: T,
    /// quadrature
    pub v_qc: T,
    /// phase
    pub v_ac: T,
}

/// The inverse of what the drives do to the commands: A − iQ from (x, y) to (x, y), with each channel's phases as c + is.
///
/// A keeps the phase of a command; Q puts out, in phase, of what was commanded in quadrature, which undoes a phase of the drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuationCompensation<T> {
    pub(crate) same: Channels<T>,
    /// none where the drives have no phase: most
    pub(crate) quarter: Option<Channels<T>>,
}

/// A 2×2 matrix from (x, y) to (x, y).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Channels<T> {
    pub(crate) xx: T,
    pub(crate) xy: T,
    pub(crate) yx: T,
    pub(crate) yy: T,
}

impl<T: Float> Channels<T> {
    #[inline(always)]
    fn apply(&self, f: &AxisForces<T>) -> AxisForces<T> {
        AxisForces {
            x_c: self.xx * f.x_c + self.xy * f.y_c,
            x_s: self.xx * f.x_s + self.xy * f.y_s,
            y_c: self.yx * f.x_c + self.yy * f.y_c,
            y_s: self.yx * f.x_s + self.yy * f.y_s,
        }
    }
}

impl<T: Float> ActuationCompensation<T> {
    /// The inverse of the actuation `effects` of the library, which act in the order of [`EffectId::ALL`].
    ///
    /// # Errors
    /// An effect that does not act on the forces, one that limits them (`limit_v` below its level is what answers it), a
    /// parameter that is not finite or outside its bounds, or drives that cannot push in every direction (determinant
    /// below a thousandth).
    pub fn new(effects: &[(EffectId, Values<T>)]) -> Result<Self, ConfigError> {
        for (id, values) in effects {
            check(*id, values)?;
        }
        let at = Moment::origin();
        let through = |unit: AxisForces<T>| {
            EffectId::ALL.iter().fold(unit, |f, id| {
                effects.iter().filter(|(e, _)| e == id).fold(f, |f, (e, values)| e.actuate(values, f, &at))
            })
        };
        let (zero, one) = (T::zero(), T::one());
        // drives act on one phase as on the other, a quarter of a period later: what they make of a command in phase says all
        let of_x = through(AxisForces { x_c: one, x_s: zero, y_c: zero, y_s: zero });
        let of_y = through(AxisForces { x_c: zero, x_s: zero, y_c: one, y_s: zero });
        let times = |(a, b): (T, T), (c, d): (T, T)| (a * c - b * d, a * d + b * c);
        let (x_of_x, y_of_x) = ((of_x.x_c, of_x.x_s), (of_x.y_c, of_x.y_s));
        let (x_of_y, y_of_y) = ((of_y.x_c, of_y.x_s), (of_y.y_c, of_y.y_s));
        let (straight, crossed) = (times(x_of_x, y_of_y), times(x_of_y, y_of_x));
        let (re, im) = (straight.0 - crossed.0, straight.1 - crossed.1);
        let size_2 = re * re + im * im;
        if !(size_2 > T::ratio(1, 1_000_000) && size_2.is_finite()) {
            return Err(ConfigError { parameter: "effects", expected: "drives that push in every direction" });
        }
        let over = |z: (T, T)| times(z, (re / size_2, -im / size_2));
        let (xx, yy, xy, yx) = (over(y_of_y), over(x_of_x), over(x_of_y), over(y_of_x));
        let quarter = Channels { xx: -xx.1, xy: xy.1, yx: yx.1, yy: -yy.1 };
        let is_none = [quarter.xx, quarter.xy, quarter.yx, quarter.yy].iter().all(|v| *v == zero);
        Ok(Self {
            same: Channels { xx: xx.0, xy: -xy.0, yx: -yx.0, yy: yy.0 },
            quarter: if is_none { None } else { Some(quarter) },
        })
    }

    //= specs/equation-09.md#inverse
    //# The compensated allocation MUST make the forces along the orbit that were commanded.
    #[inline]
    fn apply(&self, f: AxisForces<T>) -> AxisForces<T> {
        let same = self.same.apply(&f);
        match &self.quarter {
            None => same,
            Some(quarter) => {
                let other = quarter.apply(&f);
                AxisForces {
                    x_c: same.x_c + other.x_s,
                    x_s: same.x_s - other.x_c,
                    y_c: same.y_c + other.y_s,
                    y_s: same.y_s - other.y_c,
                }
            }
        }
    }
}

/// The allocation's configuration; it has no state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allocation<T> {
    pub(crate) compensation: Option<ActuationCompensation<T>>,
    pub(crate) limit_v: T,
    /// the limit where no phase of the drives is to be undone; below zero, and nothing within it, where one is
    straight_limit_v: T,
}

/// Commands of the drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive<T> {
    /// V per channel and phase; finite and within the limit, always
    pub volts: AxisForces<T>,
    /// what became of it
    pub status: Status,
}

impl<T: Float> Allocation<T> {
    /// An allocation within ±`limit_v` (> 0) per channel and phase.
    ///
    /// # Errors
    /// A limit outside its domain.
    ///
    /// ```
    /// use cvg_controller::{ActuationCompensation, Allocation, OrbitCommands};
    /// use cvg_model::effects::EffectId;
    ///
    /// let uneven = (EffectId::ActuationGainMismatch, [1.02_f32, 0.0, 0.0, 0.0]);
    /// let drives = Allocation::new(Some(ActuationCompensation::new(&[uneven])?), 10.0)?;
    /// // an energy command along a pattern at 45°: the stronger channel gets less
    /// let command = OrbitCommands { v_as: -1.0, v_qc: 0.0, v_qs: 0.0, v_ac: 0.0 };
    /// let (sin, cos) = core::f32::consts::FRAC_PI_4.sin_cos();
    /// let even = Allocation::new(None, 10.0_f32)?.step(&command, cos, sin).volts;
    /// let volts = drives.step(&command, cos, sin).volts;
    /// assert!(volts.x_s.abs() < even.x_s.abs() && volts.y_s.abs() > even.y_s.abs());
    /// # Ok::<(), cvg_controller::ConfigError>(())
    /// ```
    pub fn new(compensation: Option<ActuationCompensation<T>>, limit_v: T) -> Result<Self, ConfigError> {
        let limit_v = positive(limit_v, "limit_v")?;
        let straight_limit_v = if turns(compensation.as_ref()) { -limit_v } else { limit_v };
        Ok(Self { compensation, limit_v, straight_limit_v })
    }

    //= specs/electronics.md#drives-within-their-limit
    //# Each drive MUST get a finite voltage within its limit for every command and every direction.
    /// The drives' commands for an orbit along (`cos`, `sin`): Equation 9 at unit gains, completed by the forces it
    /// does not use (v_qs along the minor axis, v_ac along the major one):
    ///
    /// $$x_c = -v_{qc}\sin\theta + v_{ac}\cos\theta,\quad x_s = v_{as}\cos\theta - v_{qs}\sin\theta,$$
    /// $$y_c = v_{qc}\cos\theta + v_{ac}\sin\theta,\quad y_s = v_{as}\sin\theta + v_{qs}\cos\theta.$$
    ///
    /// Total: a channel that is asked for more than the limit gets the limit, for no number gets 0.
    #[inline]
    pub fn step(&self, v: &OrbitCommands<T>, cos: T, sin: T) -> Drive<T> {
        let asked = self.asked(v, cos, sin);
        if self.fits(&asked) { Drive { volts: asked, status: Status::Within } } else { self.limited(asked) }
    }

    /// [`Allocation::step`] where every channel is within its limit: the volts. None elsewhere.
    #[inline(always)]
    pub fn step_within(&self, v: &OrbitCommands<T>, cos: T, sin: T) -> Option<AxisForces<T>> {
        let asked = self.asked(v, cos, sin);
        if self.fits(&asked) { Some(asked) } else { None }
    }

    //= specs/dsp.md#short-way
    //# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
    /// The same for the energy and the quadrature loop alone, which is **Equation 9**. None where drives have a phase.
    #[inline(always)]
    pub fn axes_within(&self, v: &ControlOutputs<T>, cos: T, sin: T) -> Option<AxisForces<T>> {
        let unit = ActuationGains { x: T::one(), y: T::one() };
        let forces = unit.axis_forces_along(v, cos, sin);
        let asked = match &self.compensation {
            Some(inverse) => inverse.same.apply(&forces),
            None => forces,
        };
        if each_is_within(&asked, self.straight_limit_v) { Some(asked) } else { None }
    }

    /// A phase of the drives is undone.
    pub fn turns(&self) -> bool {
        turns(self.compensation.as_ref())
    }

    /// Each is within the limit. False for any NaN.
    #[inline(always)]
    pub(crate) fn fits(&self, f: &AxisForces<T>) -> bool {
        each_is_within(f, self.limit_v)
    }

    /// What is asked of the drives.
    #[inline(always)]
    fn asked(&self, v: &OrbitCommands<T>, cos: T, sin: T) -> AxisForces<T> {
        let projected = AxisForces {
            x_c: v.v_ac * cos - v.v_qc * sin,
            x_s: v.v_as * cos - v.v_qs * sin,
            y_c: v.v_qc * cos + v.v_ac * sin,
            y_s: v.v_as * sin + v.v_qs * cos,
        };
        self.compensated(projected)
    }

    #[inline(always)]
    fn compensated(&self, forces: AxisForces<T>) -> AxisForces<T> {
        match &self.compensation {
            Some(inverse) => inverse.apply(forces),
            None => forces,
        }
    }

    /// The drives' commands where a channel is asked for more than the limit, or for no number.
    #[cold]
    #[inline(never)]
    pub(crate) fn limited(&self, asked: AxisForces<T>) -> Drive<T> {
        let finite = asked.x_c.is_finite() && asked.x_s.is_finite() && asked.y_c.is_finite() && asked.y_s.is_finite();
        Drive {
            volts: AxisForces {
                x_c: asked.x_c.bounded(self.limit_v),
                x_s: asked.x_s.bounded(self.limit_v),
                y_c: asked.y_c.bounded(self.limit_v),
                y_s: asked.y_s.bounded(self.limit_v),
            },
            status: if finite { Status::Limited } else { Status::Invalid },
        }
    }
}

fn turns<T>(compensation: Option<&ActuationCompensation<T>>) -> bool {
    compensation.is_some_and(|inverse| inverse.quarter.is_some())
}

#[inline(always)]
fn each_is_within<T: Float>(f: &AxisForces<T>, limit_v: T) -> bool {
    f.x_c.within(limit_v) && f.x_s.within(limit_v) && f.y_c.within(limit_v) && f.y_s.within(limit_v)
}

fn check<T: Float>(id: EffectId, values: &Values<T>) -> Result<(), ConfigError> {
    let description = id.description();
    if description.stage != Stage::Actuation || !id.in_library() {
        return Err(ConfigError { parameter: description.id, expected: "an effect of the actuation" });
    }
    if id.by_temperature() {
        return Err(ConfigError { parameter: description.id, expected: "free of what is told by a thermometer" });
    }
    if id.limits_drives() && *values != id.neutral() {
        return Err(ConfigError {
            parameter: description.id,
            expected: "in proportion: `limit_v` below its level instead",
        });
    }
    for (value, parameter) in values.iter().zip(description.parameters) {
        let v = value.to_f64();
        if !(v >= parameter.lower && v <= parameter.upper) {
            return Err(ConfigError { parameter: parameter.name, expected: "finite and within its bounds" });
        }
    }
    let unused = MAX_PARAMETERS.saturating_sub(description.parameters.len());
    if values.iter().rev().take(unused).any(|v| *v != T::zero()) {
        return Err(ConfigError { parameter: description.id, expected: "given no more values than it has parameters" });
    }
    Ok(())
}
