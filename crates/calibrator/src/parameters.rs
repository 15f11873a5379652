//! What is learned: nineteen numbers, in units of what an instrument is expected to have of them.
//!
//! Detection comes last: what is known of the others given the detection can then be read off the factors.

use cvg_model::Float;

/// How many parameters.
pub const N: usize = 19;
/// Those that forces on a pattern at rest don't tell: the last three.
pub const DETECTION: usize = 3;
/// All before them.
pub const OTHERS: usize = N - DETECTION;

/// Indices into the parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(usize)]
pub enum Parameter {
    /// offset of the X readout, in phase, in amplitudes
    OffsetX,
    /// offset of the Y readout
    OffsetY,
    /// κ' = ¾κa²: what the cubic readout adds at full deflection
    Cubic,
    /// common scale of the forces
    ForceScale,
    /// Y force over X force, less one
    ForceRatio,
    /// push along Y of a command along X
    ForceSkew,
    /// the forces' frame against the readout's, rad
    ForceRotation,
    /// common phase of the forces, rad
    ForcePhase,
    /// phase of the Y force against that of X, rad
    ForcePhaseDifference,
    /// 1/τ, 1/s
    Damping,
    /// ½Δ(1/τ) cos 2θ_τ, 1/s
    AnisodampingCos,
    /// ½Δ(1/τ) sin 2θ_τ, 1/s
    AnisodampingSin,
    /// Δω cos 2θ_ω, rad/s
    SplitCos,
    /// Δω sin 2θ_ω, rad/s
    SplitSin,
    /// constant rate of quadrature, rad/s
    QuadratureRate,
    /// constant rate of the pattern, rad/s
    Rate,
    /// phase of the Y readout behind that of X, rad
    DetectionPhase,
    /// γ: Y readout over X readout, less one
    DetectionRatio,
    /// s: what the Y readout sees of X
    DetectionSkew,
}

use Parameter as P;

impl Parameter {
    /// Every parameter, in order.
    pub const ALL: [Self; N] = [
        P::OffsetX,
        P::OffsetY,
        P::Cubic,
        P::ForceScale,
        P::ForceRatio,
        P::ForceSkew,
        P::ForceRotation,
        P::ForcePhase,
        P::ForcePhaseDifference,
        P::Damping,
        P::AnisodampingCos,
        P::AnisodampingSin,
        P::SplitCos,
        P::SplitSin,
        P::QuadratureRate,
        P::Rate,
        P::DetectionPhase,
        P::DetectionRatio,
        P::DetectionSkew,
    ];

    /// Whether it can't be told from others before a known precession has been seen in the angle.
    pub fn needs_known_precession(self) -> bool {
        matches!(self, P::ForceScale | P::ForceRotation | P::Rate)
    }

    /// Standard deviation that is expected of devices: the unit of the filter. Its square is the ceiling of forgetting.
    #[inline]
    pub fn expected<T: Float>(self) -> T {
        // number by number: firmware converts none at run time
        let c = T::from_f64;
        match self {
            P::OffsetX | P::OffsetY => c(1e-3),
            P::Cubic => c(7.5e-3),
            P::ForceScale | P::Damping | P::QuadratureRate => c(0.1),
            P::ForceRatio => c(0.04),
            P::ForceSkew | P::ForceRotation => c(8e-3),
            P::ForcePhase => c(0.02),
            P::ForcePhaseDifference | P::DetectionPhase | P::AnisodampingCos | P::AnisodampingSin => c(0.01),
            P::SplitCos | P::SplitSin => c(2.0),
            P::Rate => c(0.02),
            P::DetectionRatio => c(0.03),
            P::DetectionSkew => c(6e-3),
        }
    }

    /// What it may wander, per √s: the floor of forgetting.
    #[inline]
    pub fn wander<T: Float>(self) -> T {
        let c = T::from_f64;
        match self {
            P::OffsetX | P::OffsetY => c(2e-7),
            P::Cubic | P::AnisodampingCos | P::AnisodampingSin | P::QuadratureRate => c(1e-6),
            P::ForceScale => c(1e-5),
            P::ForceRatio | P::ForceSkew | P::DetectionRatio | P::DetectionSkew => c(1.2e-5),
            P::ForceRotation => c(2e-6),
            P::ForcePhase | P::ForcePhaseDifference | P::DetectionPhase => c(1e-6),
            P::Damping | P::Rate => c(3e-6),
            P::SplitCos | P::SplitSin => c(3e-5),
        }
    }
}

/// A number for each parameter.
pub type Vector<T> = [T; N];

/// The number of a parameter.
#[inline]
pub fn get<T: Float>(v: &Vector<T>, p: Parameter) -> T {
    v.get(p as usize).copied().unwrap_or(T::zero())
}

/// Sets the number of a parameter.
#[inline]
pub fn set<T: Float>(v: &mut Vector<T>, p: Parameter, value: T) {
    if let Some(slot) = v.get_mut(p as usize) {
        *slot = value;
    }
}

/// a · b.
#[inline]
pub fn dot<T: Float>(a: &Vector<T>, b: &Vector<T>) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
}
