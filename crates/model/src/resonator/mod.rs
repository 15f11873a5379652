//! One mechanics at three levels of detail: the carrier, its envelope, and the orbit's averages (Lynch 1995).
//!
//! [`carrier`] is the equation of motion; [`envelope`] is its first-order average, linear in (X, Y) and free of the
//! carrier; [`averaged`] is the envelope written in the orbit's own variables. The envelope is what the simulator
//! integrates and the identification inverts; the other two are what it is checked against.

pub mod averaged;
pub mod carrier;
pub mod envelope;

use crate::Real;

/// Lynch's generic Coriolis vibratory gyroscope.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Resonator<T> {
    /// ω = √(½(ω1² + ω2²)), rad/s
    pub omega_rad_s: T,
    /// angular gain k
    pub angular_gain: T,
    /// centrifugal gain k′
    pub centrifugal_gain: T,
    /// 1/τ = ½(1/τ1 + 1/τ2), 1/s; the amplitude decays as e^{−t/τ}
    pub damping_per_s: T,
    /// Δ(1/τ) resolved along X–Y, 1/s
    pub anisodamping: Anisotropy<T>,
    /// Δω with ωΔω = ½|ω1² − ω2²|, resolved along X–Y, rad/s
    pub anisoelasticity: Anisotropy<T>,
}

/// A difference between two principal axes, resolved: (Δ cos 2θ_Δ, Δ sin 2θ_Δ).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Anisotropy<T> {
    /// Δ cos 2θ_Δ
    pub cos2: T,
    /// Δ sin 2θ_Δ
    pub sin2: T,
}

impl<T: Real> Anisotropy<T> {
    /// No difference between the axes.
    pub fn none() -> Self {
        Self { cos2: T::zero(), sin2: T::zero() }
    }

    /// The difference `delta` with its larger axis at `axis_rad`.
    pub fn new(delta: T, axis_rad: T) -> Self {
        let (sin, cos) = (T::two() * axis_rad).sin_cos();
        Self { cos2: delta * cos, sin2: delta * sin }
    }

    /// Δ ≥ 0
    pub fn magnitude(&self) -> T {
        self.cos2.norm(self.sin2)
    }

    /// θ_Δ in (−90°, 90°], rad
    pub fn axis_rad(&self) -> T {
        T::half() * self.sin2.atan2(self.cos2)
    }
}
