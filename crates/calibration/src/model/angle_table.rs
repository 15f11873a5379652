//! A table of angle errors: a Fourier series in one of two forms.
//!
//! Physics generates few harmonics in the true angle but many in the sensor's own; the table of an encoder's error is
//! commonly written in its own angle. Which form predicts better is the data's to say:
//!
//! - own: $φ = θ - h(θ)$;
//! - forward: $θ = φ + h(φ)$ with φ the true angle, inverted by Newton's iteration. It is a table as long as
//!   $1 + h' > 0$.

use serde::{Deserialize, Serialize};

/// In which angle the series is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// in the angle that the sensor gives
    Own,
    /// in the true angle
    Forward,
}

/// Least 1 + h' of a table that can be inverted.
const LEAST_SLOPE: f64 = 0.2;
/// Points of the period at which that is looked at.
const LOOKED_AT: usize = 720;
/// Newton steps of the inverse of the forward form, and the step below which they stop, rad.
const NEWTON_STEPS: usize = 8;
const CONVERGED: f64 = 1e-9;

/// A Fourier series of an angle: harmonic n has the coefficients n − 1 of cosine and sine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AngleTable {
    /// in which angle it is written
    pub form: Form,
    /// cosine coefficients of harmonics 1, 2, …, rad
    pub cos: Vec<f64>,
    /// sine coefficients, rad
    pub sin: Vec<f64>,
}

impl AngleTable {
    /// h and h' at an angle, of the period 2π/`cycles`.
    pub fn at(&self, angle: f64, cycles: f64) -> (f64, f64) {
        let (sin_1, cos_1) = (cycles * angle).sin_cos();
        let (mut sin, mut cos) = (0.0, 1.0);
        let (mut value, mut slope) = (0.0, 0.0);
        for (n, (c, s)) in self.cos.iter().zip(&self.sin).enumerate() {
            (sin, cos) = (sin * cos_1 + cos * sin_1, cos * cos_1 - sin * sin_1);
            value += c * cos + s * sin;
            slope += (n as f64 + 1.0) * cycles * (s * cos - c * sin);
        }
        (value, slope)
    }

    /// The true angle where the sensor gives `theta`.
    pub fn undo(&self, theta: f64, cycles: f64) -> f64 {
        let mut angle = theta - self.at(theta, cycles).0;
        if self.form == Form::Own || self.cos.is_empty() {
            return angle;
        }
        for _ in 0..NEWTON_STEPS {
            let (value, slope) = self.at(angle, cycles);
            let step = (angle + value - theta) / (1.0 + slope).max(LEAST_SLOPE);
            angle -= step;
            if step.abs() < CONVERGED {
                break;
            }
        }
        angle
    }

    /// It has an inverse.
    pub fn is_invertible(&self, cycles: f64) -> bool {
        let sound = self.cos.iter().chain(&self.sin).all(|v| v.is_finite());
        let step = std::f64::consts::TAU / cycles / LOOKED_AT as f64;
        sound
            && (self.form == Form::Own
                || (0..LOOKED_AT).all(|i| 1.0 + self.at(step * i as f64, cycles).1 > LEAST_SLOPE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_turns_back_is_refused() {
        let table = AngleTable { form: Form::Forward, cos: vec![0.0; 4], sin: vec![0.0, 0.0, 0.0, 0.25] };
        assert!(!table.is_invertible(1.0));
        assert!(AngleTable { sin: vec![0.0, 0.0, 0.0, 0.19], ..table }.is_invertible(1.0));
    }
}
