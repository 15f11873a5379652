//! The angle-dependent bias (Equation 1): what is left of the angle when the best line is taken out.

use cvg_model::Real;

use crate::numerics::statistics::line;

//= specs/equation-01.md#the-pattern-turns-against-the-input
//# The pattern angle MUST be the bias less the effective angular gain times the integral of the input rate.
//= specs/equation-01.md#the-gain-keeps-its-sign
//# Reversing the input MUST reverse the change of the pattern angle and leave the effective angular gain as it was.
/// **Equation 1**, the pattern angle of a whole-angle gyroscope, rad:
///
/// $$\theta(t) = -k_e \int \Omega\,dt + \theta_b$$
///
/// `angular_gain` = k_e; `input_rad` = ∫Ω dt, rad; `bias_rad` = θ_b, rad. Source: the paper, Equation 1.
#[inline]
pub fn pattern_angle<T: Real>(angular_gain: T, input_rad: T, bias_rad: T) -> T {
    -angular_gain * input_rad + bias_rad
}

//= specs/equation-01.md#the-bias-is-what-the-best-line-leaves
//# The angle-dependent bias MUST be the unwrapped pattern angle less the least-squares line of it over the input angle.
//= specs/equation-01.md#a-constant-angle-is-no-bias
//# Adding a constant to every pattern angle MUST NOT change the angle-dependent bias.
/// Removes the best line in the input angle: angular gain and bias refitted on the same samples.
///
/// `input_rad` and `angle_rad` in rad, of one length; what is left is the angle-dependent bias, rad.
pub fn angle_dependent_bias(input_rad: &[f64], angle_rad: &[f64]) -> Vec<f64> {
    let (slope, intercept) = line(input_rad, angle_rad);
    input_rad.iter().zip(angle_rad).map(|(a, r)| r - slope * a - intercept).collect()
}
