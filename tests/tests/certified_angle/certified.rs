//! From the converters to the angle: what each link may add, and their sum.
//!
//! The book's page on the certified angle derives each link and says what it rests on.

use core::f64::consts::{PI, SQRT_2};

use cvg_tests::tolerances::{ANGLE, PENDULUM, Tolerance};

/// What the bound depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Chain {
    /// range of the converters, ±V
    pub(crate) full_scale_v: f64,
    /// what a code may be off by is half a step of 2^bits in that range
    pub(crate) bits: u32,
    /// samples a window
    pub(crate) samples: u32,
    /// turn of the carrier from sample to sample, rad
    pub(crate) step_rad: f64,
    /// machine epsilon of the scalar: 2⁻²³ or 2⁻⁵²
    pub(crate) epsilon: f64,
    /// the semi-major axis at the converters, V
    pub(crate) amplitude_v: f64,
    /// the largest offset of a converter, V
    pub(crate) offset_v: f64,
    /// semi-minor over semi-major axis, at most
    pub(crate) roundness: f64,
    /// the ratio of the readout's gains, Y over X, that is undone; 1 where nothing is
    pub(crate) undone: f64,
    /// what is left of the ratio: the readout's over the one that is undone
    pub(crate) left: f64,
}

impl Chain {
    /// Half a step of the converter through the fit of a window, V: the noise's length is at most √N times half a step a channel,
    /// and the fit divides by the root of the smallest eigenvalue of its normal matrix, which is at least
    /// N/2 − 1/(2 |sin w|) − 1/(N sin²(w/2)).
    pub(crate) fn quantisation_v(&self) -> f64 {
        let (n, w) = (f64::from(self.samples), self.step_rad);
        let least = 0.5 * n - 0.5 / w.sin().abs() - 1.0 / (n * (0.5 * w).sin().powi(2));
        let half_step = self.full_scale_v / 2.0_f64.powi(self.bits.cast_signed());
        if least > 0.0 { half_step * (2.0 * n / least).sqrt() } else { f64::INFINITY }
    }

    /// What the machine's arithmetic leaves of a window, V: ε times 5 a sample and 240 for the fit, which `window_rounding.rs` proves
    /// of each component, are at most twice that for the length of four; and two of the compensation.
    pub(crate) fn window_rounding_v(&self) -> f64 {
        let most = self.amplitude_v * (self.undone * self.left).max(1.0) + self.offset_v;
        2.0 * self.epsilon * (5.0 * f64::from(self.samples) + 241.0) * most
    }

    /// By how much an error of the readout is larger behind the compensation, at most.
    pub(crate) fn stretch(&self) -> f64 {
        (1.0 / self.undone).max(1.0)
    }

    /// What a wrong ratio turns, degrees: of a line by the bound of Equation 7, of another orbit as any error of Y.
    pub(crate) fn left_deg(&self) -> f64 {
        let apart = (self.left - 1.0).abs();
        if self.roundness == 0.0 {
            (apart / (self.left + 1.0)).asin().to_degrees()
        } else {
            self.turned_deg(apart * self.amplitude_v * (1.0 + self.roundness * self.roundness).sqrt())
        }
    }

    /// Semi-minor over semi-major axis, at most, of what the compensation leaves of the orbit.
    fn seen_roundness(&self) -> f64 {
        self.roundness * self.left.max(1.0 / self.left)
    }

    /// The angle, in degrees, by which an envelope that is off by `error_v` (V, the length of the four errors) is off.
    pub(crate) fn turned_deg(&self, error_v: f64) -> f64 {
        let length = self.amplitude_v * self.left.min(1.0) - error_v;
        let sine = error_v / length;
        if !(length > 0.0 && sine < 0.5) {
            return 90.0;
        }
        // on the sphere of (R, S, Q)/E; its latitudes are those of Q/E
        let beta = 2.0 * sine.asin();
        let q = self.seen_roundness();
        let latitude = (2.0 * q / (1.0 + q * q)).asin();
        if latitude + 2.0 * beta >= 0.5 * PI {
            return 90.0;
        }
        let along = beta.sin() / (latitude.cos() * (latitude + beta).cos());
        if along < 1.0 { (0.5 * along.asin()).to_degrees() } else { 90.0 }
    }

    /// Equations 2 and 4 in the machine, degrees: R and S are each off by what intervals prove of E, of any four components, which turns
    /// the circle that they lie on; and what intervals prove of the angle of any R and S by the unit vector that the tracker keeps.
    pub(crate) fn angle_rounding_deg(&self) -> f64 {
        let q2 = self.seen_roundness() * self.seen_roundness();
        let single = self.epsilon > 1e-10;
        let proved = |of: &Tolerance| if single { of.f32 } else { of.f64 };
        let of_r_and_s = 0.5 * (SQRT_2 * proved(&PENDULUM) * (1.0 + q2) / (1.0 - q2)).asin();
        // and the angle in degrees once more
        (of_r_and_s + proved(&ANGLE)).to_degrees() + 180.0 * f64::EPSILON
    }

    /// All links: their names and degrees.
    pub(crate) fn links(&self) -> [(&'static str, f64); 4] {
        let quantisation = self.quantisation_v() * self.stretch();
        let all = self.turned_deg(quantisation + self.window_rounding_v() * self.stretch());
        let first = self.turned_deg(quantisation).min(all);
        [
            ("quantisation, through the window", first),
            ("rounding in the window", all - first),
            ("what the compensation leaves", self.left_deg()),
            ("rounding of the angle", self.angle_rounding_deg()),
        ]
    }

    /// The bound, degrees.
    pub(crate) fn degrees(&self) -> f64 {
        self.links().iter().map(|(_, degrees)| degrees).sum()
    }
}
