//! The one table of tolerances: how far each equation may be from its reference, in each scalar, and why.
//!
//! ε is the spacing of numbers at 1: 2.2e-16 for `f64`, 1.2e-7 for `f32`. A tolerance counts the roundings of the
//! formula and of the reference it is compared with; a wrong sign or factor is ten orders of magnitude above it.

/// How far an equation may be from its reference.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// what is compared
    pub of: &'static str,
    /// allowed in double precision
    pub f64: f64,
    /// allowed in single precision
    pub f32: f64,
    /// relative to what, and why this much
    pub reason: &'static str,
}

macro_rules! table {
    ($($(#[$doc:meta])* $name:ident: $of:literal, $f64:literal, $f32:literal, $reason:literal;)+) => {
        $(
            $(#[$doc])*
            pub const $name: Tolerance = Tolerance { of: $of, f64: $f64, f32: $f32, reason: $reason };
        )+
        /// Every row.
        pub const TABLE: &[Tolerance] = &[$($name),+];
    };
}

table! {
    /// Equation 1, the angle-dependent bias
    BIAS: "Equation 1, its line taken out", 2e-13, 1e-4,
        "of the largest angle of the run: a mean over some hundred samples and a line over some hundred radians";
    /// Equation 1, the angle itself
    PATTERN_ANGLE: "Equation 1, θ", 4e-16, 2e-7,
        "of the largest angle of the run: a product and a sum";
    /// Equation 2
    PENDULUM: "Equation 2", 4e-15, 2e-6,
        "of E: three products and two sums, after an orbit's sine, cosine and phase rotation: below 16 ε";
    /// Equation 3
    CONTROL: "Equation 3", 2e-15, 1e-6,
        "of K(|e| + |∫e|/τ) or of the limit, per sample: three products and a sum, and one sum a step in the integral";
    /// Equation 4
    ANGLE: "Equation 4", 4e-15, 2e-6,
        "rad, times E/√(R²+S²): Equation 2's error seen from the circle that R and S lie on, and half an arctangent";
    /// Equation 5
    QUADRATURE: "Equation 5", 2e-15, 1e-6,
        "of |G_Dx G_Dy| E: four products a side; the difference x_c y_s − y_c x_s may cancel, so relative to E, not to Q";
    /// Equation 6
    ENERGY: "Equation 6", 3e-15, 1.5e-6,
        "of max(G_Dx², G_Dy²) E: 1 − cos 2θ and g² − 1 are rounded once each, their product is added to 1";
    /// Equation 7
    DETECTION_ANGLE: "Equation 7", 3e-15, 1e-6,
        "rad: a sine, a product and an arctangent at angles up to π, and π itself is rounded by up to ε";
    /// Equation 7, closed form of the error
    DETECTION_ERROR: "Equation 7, θ_error", 1.2e-15, 6e-7,
        "rad: up to g = 5 the roundings of both arguments and an arctangent within 2 units stay below 5.5 ε, as proved";
    /// Equation 8
    MISALIGNED_FORCES: "Equation 8", 1e-15, 5e-7,
        "of G_A (|v_as| + |v_qc|): one sine or cosine and two products";
    /// Equation 9
    AXIS_FORCES: "Equation 9", 1e-15, 5e-7,
        "of max(G_Ax, G_Ay)(|v_as| + |v_qc|): one sine or cosine and two products";
    /// Equation 9, inverted
    ALLOCATION: "Equation 9, inverted", 8e-15, 4e-6,
        "of 1 V, times the larger of ratio and 1/ratio: a rotation, an inverse of two by two, the drives, a rotation back";
    /// Equation 10
    ORBIT_FORCES: "Equation 10", 2e-15, 1e-6,
        "of max(G_Ax, G_Ay)(|v_as| + |v_qc|): a double angle a side against two single angles on the other";
    /// Equation 11
    ACTUATION_RATIO: "Equation 11", 2e-15, 1e-6,
        "relative: two products and a quotient a side, and as many for the common factor";
    /// Length of the direction of the major axis
    DIRECTION: "direction of the major axis", 2e-15, 1e-6,
        "of 1: two roots, a quotient and the products and sums under them";
    /// Orbit → envelope → orbit
    ORBIT: "orbit and envelope", 2e-14, 1e-5,
        "of a, times E/√(R²+S²): Equation 4's error turns the orbit before its axes are read";
    /// Effects undone
    INVERSE: "unread ∘ read", 1e-9, 1e-4,
        "of a: an iterated inverse stops at 0.12⁸ of an effect of 0.013 with slope 0.12, closed ones at rounding";
    /// Cubic readout undone
    CUBIC_INVERSE: "unread ∘ read, cubic readout", 2e-15, 1e-6,
        "of a: Newton's iteration ends at the rounding of two cubics and two products";
    /// the tracker's unit vector
    UNIT_VECTOR: "the tracker's unit vector", 1e-15, 5e-7,
        "of 1: two squares, a sum, a root, a quotient and a product: below 4 ε";
    /// the oscillator's phasor one sample later
    NEXT_PHASOR: "the phasor of the next sample", 2.4e-16, 1.29e-7,
        "of a phasor and a step of length 1: two products and their sum, each rounded once: ε, and the room of a box";
    /// the oscillator's phasor at the beginning of a window
    TUNED_PHASOR: "a tuned phasor", 4.2e-16, 2.1e-7,
        "of length 1: its squared length, the scale and the product: below 2 ε";
    /// the oscillator's step at the beginning of a window
    TUNED_STEP: "a tuned step", 4.2e-16, 2.1e-7,
        "of length 1: the rounded nominal step turned by two series: below 2 ε";
    /// a window's sums after one sample more
    SAMPLE_SUM: "a window's sums after one sample more", 2.5e-16, 1.34e-7,
        "of half the sum before and the sample: ε of each, and the room of a box";
    /// the envelope that a window is fitted by
    WINDOW_FIT: "the fit of a window", 2.220446049250313e-16, 1.1920928955078125e-7,
        "of the largest sample: ε times five a sample and 240 for the normal equations, after what the window's phasors and sums are off by";
}

#[cfg(test)]
mod tests {
    use super::TABLE;

    #[test]
    fn every_tolerance_is_some_roundings_of_its_scalar_and_says_why() {
        for row in TABLE {
            assert!(row.f64 >= f64::EPSILON && row.f32 >= f64::from(f32::EPSILON), "{row:?} is below one rounding");
            assert!(row.f32 <= 1e-3, "{row:?} would let a wrong factor pass");
            assert!(row.reason.len() > 20, "{row:?} gives no reason");
        }
    }
}
