//! A two-channel angle sensor (resolver, Hall pair, sin/cos encoder): no loops, no mechanics, only a vector that turns
//! with its input and a readout.
//!
//! Its angle follows Equation 1, θ = −k∫Ω dt + θ_start, as a gyroscope's does: a sensor that turns with the table has
//! k = −1, one of 25 pole pairs k = ∓25.

use cvg_model::Envelope;
use cvg_model::effects::Moment;

use crate::noise::Noise;
use crate::stages::Stages;

/// The sensor in one run.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// what is wrong with it and its bench
    pub stages: Stages,
    /// k of Equation 1
    pub angular_gain: f64,
    /// amplitude of both channels, V
    pub amplitude_v: f64,
    /// angle at the start, rad
    pub start_rad: f64,
    /// integration period, s
    pub period_s: f64,
    /// noise of the readout, V rms per channel and recorded sample
    pub noise_v: f64,
    /// from which sample on which commanded rate, rad/s
    pub legs: Vec<(u64, f64)>,
}

/// The sensor at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorReading {
    /// time of the recording, s
    pub t_s: f64,
    /// commanded rate, rad/s
    pub rate_rad_s: f64,
    /// true angle of the table, rad
    pub table_rad: f64,
    /// the readout; its quadrature parts are 0
    pub readout: Envelope<f64>,
}

impl Sensor {
    /// Readings at every `every`-th of `count` integration steps.
    pub fn readings(&self, count: u64, every: u64, noise: &mut Noise) -> Vec<SensorReading> {
        let mut out = Vec::new();
        let (mut table_rad, mut turned_rad) = (0.0, 0.0);
        for k in 0..count {
            let rate_rad_s = self.legs.iter().rev().find(|(from, _)| *from <= k).map_or(0.0, |(_, rate)| *rate);
            #[allow(clippy::cast_precision_loss, reason = "2^53 samples are not reached")]
            let t_s = k as f64 * self.period_s;
            let at = Moment { t_s, table_rad, precession_rad_s: -self.angular_gain * rate_rad_s, ..Moment::default() };
            if k % every == 0 {
                let (sin, cos) = (self.start_rad - self.angular_gain * turned_rad).sin_cos();
                let a = self.amplitude_v;
                let read = self.stages.read(Envelope::new(a * cos, 0.0, a * sin, 0.0), &at);
                let noisy = Envelope::new(
                    read.x_c + noise.normal(self.noise_v),
                    0.0,
                    read.y_c + noise.normal(self.noise_v),
                    0.0,
                );
                out.push(SensorReading { t_s, rate_rad_s, table_rad, readout: noisy });
            }
            let middle = Moment {
                t_s: t_s + 0.5 * self.period_s,
                table_rad: table_rad + 0.5 * self.period_s * rate_rad_s,
                ..at
            };
            let (table, input) = self.stages.rates(rate_rad_s, &middle);
            table_rad += table * self.period_s;
            turned_rad += input * self.period_s;
        }
        out
    }
}
