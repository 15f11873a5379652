//! What misaligned and unequal forces do (Equations 8, 9 and 10), and what tells the gains apart (Equation 11).
//!
//! Signs are those of Equation 3: v_as > 0 takes energy out. With F = f_c − i f_s the envelope moves at F/(2iω), so
//! in the orbit frame, for q ≈ 0: ȧ ∋ −f_as/2ω, θ̇ ∋ −f_qs/(2ωa), q̇ ∋ +f_qc/2ω, δ̇ ∋ −f_ac/(2ωa).

use crate::{Envelope, Real};

/// Outputs of the energy and the quadrature controller (Equation 3), V.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ControlOutputs<T> {
    /// v_as: along the major axis, in quadrature with the reference (energy)
    pub v_as: T,
    /// v_qc: along the minor axis, in phase with the reference (quadrature)
    pub v_qc: T,
}

/// Voltage-to-force gains of the two drive channels, force (per unit mass) per volt.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ActuationGains<T> {
    /// G_Ax
    pub x: T,
    /// G_Ay
    pub y: T,
}

/// Forces along the semi-axes of the orbit, in phase (c) and in quadrature (s) with the reference.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct OrbitForces<T> {
    /// f_as: major axis, quadrature phase; changes the energy
    pub a_s: T,
    /// f_qs: minor axis, quadrature phase; precesses the pattern
    pub q_s: T,
    /// f_ac: major axis, in phase; shifts the oscillation's phase
    pub a_c: T,
    /// f_qc: minor axis, in phase; changes the quadrature
    pub q_c: T,
}

/// Forces along X and Y, in phase (c) and in quadrature (s) with the reference.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct AxisForces<T> {
    /// f_xc
    pub x_c: T,
    /// f_xs
    pub x_s: T,
    /// f_yc
    pub y_c: T,
    /// f_ys
    pub y_s: T,
}

//= specs/equation-11.md#ratio-of-the-gains
//# The ratio MUST be the gain of X over the gain of Y where each control output balances the damping along its axis.
//= specs/equation-11.md#independence-of-the-set-amplitude
//# A common factor on both control outputs MUST leave the ratio as it was.
//= specs/equation-11.md#independence-of-a-common-gain
//# A common factor on both actuation gains MUST leave the ratio as it was.
//= specs/equation-11.md#exchange-of-the-runs
//# Exchanging the two runs MUST invert the ratio.
/// **Equation 11**, the ratio of the actuation gains from time constants and energy control outputs:
///
/// $$\frac{G_{Ax}}{G_{Ay}} = \frac{\tau_{90}\,v_{as@90}}{\tau_0\,v_{as@0}}$$
///
/// `tau_*` in s, `v_as_*` in V, both outputs at the same true amplitude (or each divided by its own). Invariant to the
/// amplitude set point and to a common scale of both gains. Domain: `tau_0`, `v_as_0` ≠ 0. Source: the paper,
/// Equation 11.
#[inline]
pub fn actuation_gain_ratio<T: Real>(tau_0: T, v_as_0: T, tau_90: T, v_as_90: T) -> T {
    (tau_90 * v_as_90) / (tau_0 * v_as_0)
}

//= specs/equation-08.md#rotation-of-the-commands
//# The forces along the orbit MUST be the commanded forces turned by the angle error.
//= specs/equation-08.md#isometry
//# The size of the forces that one command makes along both axes of the orbit MUST be the gain times the command.
//= specs/equation-08.md#aligned-forces
//# Without an angle error each command MUST act on its own axis only.
//= specs/equation-08.md#leak-follows-the-sign-of-the-error
//# Reversing the angle error MUST reverse the forces on the wrong axes and leave those on the right axes as they were.
//= specs/equation-08.md#projection-at-the-measured-angle
//# The forces MUST be those of the projection at the measured angle with equal gains, seen along the true orbit.
//= specs/equation-08.md#precession-by-a-misaligned-energy-controller
//# An energy controller that balances the damping at a wrong orientation MUST precess the pattern at the tangent of the angle error over the decay time.
/// **Equation 8**, the forces along the true orbit when they are applied at an orientation wrong by `theta_error` (rad):
///
/// $$f_{as} = G_A v_{as}\cos\theta_{error},\quad f_{qs} = G_A v_{as}\sin\theta_{error},$$
/// $$f_{ac} = -G_A v_{qc}\sin\theta_{error},\quad f_{qc} = G_A v_{qc}\cos\theta_{error}.$$
///
/// A rotation by θ_error, so f_as² + f_qs² = (G_A v_as)². `gain` = G_A, equal on both axes. Source: the paper,
/// Equation 8.
#[inline]
pub fn misaligned_forces<T: Real>(gain: T, v: &ControlOutputs<T>, theta_error: T) -> OrbitForces<T> {
    let (sin, cos) = theta_error.sin_cos();
    OrbitForces {
        a_s: gain * v.v_as * cos,
        q_s: gain * v.v_as * sin,
        a_c: -gain * v.v_qc * sin,
        q_c: gain * v.v_qc * cos,
    }
}

impl<T: Real> ActuationGains<T> {
    /// **Equation 9**, the forces along X and Y when the commands are projected at `theta` (rad):
    ///
    /// $$f_{xc} = -G_{Ax} v_{qc}\sin\theta,\quad f_{xs} = G_{Ax} v_{as}\cos\theta,$$
    /// $$f_{yc} = G_{Ay} v_{qc}\cos\theta,\quad f_{ys} = G_{Ay} v_{as}\sin\theta.$$
    ///
    /// Domain: all reals. Source: the paper, Equation 9.
    #[inline]
    pub fn axis_forces(&self, v: &ControlOutputs<T>, theta: T) -> AxisForces<T> {
        let (sin, cos) = theta.sin_cos();
        self.axis_forces_along(v, cos, sin)
    }

    //= specs/equation-09.md#projection
    //# Each channel MUST make its gain times the projection of both commands onto its axis.
    //= specs/equation-09.md#half-a-turn-reverses-the-forces
    //# Turning the orientation by 180° MUST reverse every force.
    //= specs/equation-09.md#linear
    //# Doubling the commands MUST double every force exactly.
    //= specs/equation-09.md#energy-command
    //# With equal gains the energy command MUST change the energy only, and take it out where the command is positive.
    //= specs/equation-09.md#quadrature-command
    //# With equal gains the quadrature command MUST change the quadrature only, and add to it where the command is positive.
    /// [`ActuationGains::axis_forces`] where the cosine and the sine of θ are known.
    #[inline]
    pub fn axis_forces_along(&self, v: &ControlOutputs<T>, cos: T, sin: T) -> AxisForces<T> {
        AxisForces {
            x_c: -self.x * v.v_qc * sin,
            x_s: self.x * v.v_as * cos,
            y_c: self.y * v.v_qc * cos,
            y_s: self.y * v.v_as * sin,
        }
    }

    //= specs/equation-10.md#equation-9-turned
    //# The forces along the orbit MUST be those of Equation 9 turned back by the angle of the orbit.
    //= specs/equation-10.md#mean-gain
    //# The force of a command along its own axis MUST be the command times the gains weighted by the squared direction cosines of that axis.
    //= specs/equation-10.md#equal-gains-leave-equation-8
    //# Equal gains MUST give the forces of Equation 8 without an angle error, exactly.
    //= specs/equation-10.md#sum-and-product
    //# The sum and the product of the principal values of the map from commands to forces MUST be those of the two gains.
    //= specs/equation-10.md#between-the-gains
    //# The magnitude of the energy force MUST lie between the command times the smaller and the command times the larger gain.
    //= specs/equation-10.md#exchange-of-the-axes
    //# Exchanging the gains and taking the angle from 90° MUST reverse the forces on the wrong axes and leave those on the right axes as they were.
    //= specs/equation-10.md#where-the-leak-is
    //# The force on the wrong axis MUST be largest at 45°, where it is half the difference of the gains times the command, and zero at every multiple of 90°.
    /// **Equation 10**, the same forces along the orbit at `theta` (rad):
    ///
    /// $$f_{as} = \tfrac12(G_{Ay}-G_{Ax})v_{as}(1-\cos 2\theta) + G_{Ax}v_{as},\quad
    ///   f_{qs} = \tfrac12(G_{Ay}-G_{Ax})v_{as}\sin 2\theta,$$
    /// $$f_{ac} = \tfrac12(G_{Ay}-G_{Ax})v_{qc}\sin 2\theta,\quad
    ///   f_{qc} = \tfrac12(G_{Ay}-G_{Ax})v_{qc}(1+\cos 2\theta) + G_{Ax}v_{qc}.$$
    ///
    /// Equation 9 rotated by −θ; at G_Ax = G_Ay it is Equation 8 with θ_error = 0. Source: the paper, Equation 10.
    #[inline]
    pub fn orbit_forces(&self, v: &ControlOutputs<T>, theta: T) -> OrbitForces<T> {
        let (sin_2theta, cos_2theta) = (T::two() * theta).sin_cos();
        let half_difference = T::half() * (self.y - self.x);
        OrbitForces {
            a_s: half_difference * v.v_as * (T::one() - cos_2theta) + self.x * v.v_as,
            q_s: half_difference * v.v_as * sin_2theta,
            a_c: half_difference * v.v_qc * sin_2theta,
            q_c: half_difference * v.v_qc * (T::one() + cos_2theta) + self.x * v.v_qc,
        }
    }
}

impl<T: Real> AxisForces<T> {
    /// These forces seen along an orbit at `theta` (rad): the rotation by −θ that leads from Equation 9 to 10.
    #[inline]
    pub fn along_orbit(&self, theta: T) -> OrbitForces<T> {
        let (sin, cos) = theta.sin_cos();
        OrbitForces {
            a_s: cos * self.x_s + sin * self.y_s,
            q_s: -sin * self.x_s + cos * self.y_s,
            a_c: cos * self.x_c + sin * self.y_c,
            q_c: -sin * self.x_c + cos * self.y_c,
        }
    }

    /// These forces with their phase put ahead by that of (`cos`, `sin`): (F_s + iF_c) e^{iφ} on each axis.
    #[inline(always)]
    pub fn ahead(&self, cos: T, sin: T) -> Self {
        Self {
            x_c: self.x_c * cos + self.x_s * sin,
            x_s: self.x_s * cos - self.x_c * sin,
            y_c: self.y_c * cos + self.y_s * sin,
            y_s: self.y_s * cos - self.y_c * sin,
        }
    }

    //= specs/dsp.md#commands-behind-the-drives
    //# The commands by which a readout is compensated MUST be those that the drives were made of whatever the oscillator is corrected by.
    /// The forces of which [`AxisForces::ahead`] by the same `cos` and `sin` made these, also where the two have not the length
    /// 1: F e^{−iφ}/|e^{iφ}|² on each axis. Not finite where both are 0.
    pub fn behind(&self, cos: T, sin: T) -> Self {
        let size_2 = cos * cos + sin * sin;
        let turned = self.ahead(cos, -sin);
        Self { x_c: turned.x_c / size_2, x_s: turned.x_s / size_2, y_c: turned.y_c / size_2, y_s: turned.y_s / size_2 }
    }

    //= specs/equation-08.md#what-each-force-moves
    //# Each force along the orbit MUST move the property of the orbit that is its own: f_as the amplitude, f_qs the orientation, f_qc the quadrature and f_ac the phase, with the signs −, −, + and −.
    /// The rate at which these forces move the envelope: F/(2iω) with F = f_c − i f_s, so that the in-phase part
    /// moves at −f_s/2ω and the quadrature part at +f_c/2ω. `two_omega` = 2ω in rad/s, ≠ 0.
    #[inline]
    pub fn envelope_rate(&self, two_omega: T) -> Envelope<T> {
        Envelope::new(-self.x_s / two_omega, self.x_c / two_omega, -self.y_s / two_omega, self.y_c / two_omega)
    }
}
