//! Small recordings made of two channels and a table, and what can be wrong with them.
//!
//! [`Made`] is one run of a device with unequal gains, [`damages`] what is done to it, [`lies`] whether the program is
//! wrong about a campaign of such runs without a doubt.

pub mod damages;
pub mod lies;

use cvg_calibration::recording::{Campaign, Recording, Role, Run, RunKind};

use crate::bench::Draws;

/// Angular gain of the device.
pub const ANGULAR_GAIN: f64 = 0.78;
/// Ratio of its detection gains, G_Dy/G_Dx.
pub const RATIO: f64 = 1.0132;
/// Standard deviation of its readout, V, at an amplitude of 1 V.
pub const NOISE_V: f64 = 2e-5;

/// What one run of a device is made of.
#[derive(Debug, Clone)]
pub struct Made {
    /// rate of the table, deg/s
    pub rate_dps: f64,
    /// how long it lasts, s
    pub duration_s: f64,
    /// rows a second
    pub sample_hz: f64,
    /// angular gain of this run
    pub angular_gain: f64,
    /// standard deviation of each channel, V
    pub noise_v: f64,
    /// of its noise
    pub seed: u64,
    /// the table turns back and forth so many times, or one way throughout
    pub swings: f64,
    /// what the recording has of the table
    pub reference: Told,
    /// not a resonator, whose angle lags the table, but a sensor on its axis
    pub is_sensor: bool,
}

/// What a recording has of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Told {
    /// its rate
    Rate,
    /// its angle, of one turn
    Table,
    /// both
    Both,
}

impl Default for Made {
    fn default() -> Self {
        Self {
            rate_dps: 500.0,
            duration_s: 20.0,
            sample_hz: 100.0,
            angular_gain: ANGULAR_GAIN,
            noise_v: NOISE_V,
            seed: 1,
            swings: 0.0,
            reference: Told::Rate,
            is_sensor: false,
        }
    }
}

impl Made {
    /// A device with unequal gains, X and Y recorded and no commands.
    pub fn recording(&self) -> Recording {
        let mut draw = Draws::new(self.seed);
        // the sum of twelve even draws has a variance of one
        let mut noise = || self.noise_v * (0..12).map(|_| draw.between(-0.5, 0.5)).sum::<f64>();
        let gain = if self.is_sensor { 1.0 } else { -self.angular_gain };
        let theta: Vec<f64> = self.turned(&self.rates()).iter().map(|d| 0.3 + gain * d.to_radians()).collect();
        let xc_v = theta.iter().map(|a| a.cos() + noise()).collect();
        let yc_v = theta.iter().map(|a| RATIO * a.sin() + noise()).collect();
        let mut recording = Recording {
            source: format!("{}dps-{}.csv", self.rate_dps, self.seed).into(),
            xc_v: Some(xc_v),
            yc_v: Some(yc_v),
            t_s: self.times(),
            ..Recording::default()
        };
        self.tell(&mut recording, self.rates());
        recording
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive count")]
    pub(crate) fn times(&self) -> Vec<f64> {
        let rows = (self.duration_s * self.sample_hz) as usize;
        (0..rows).map(|i| i as f64 / self.sample_hz).collect()
    }

    /// The rates of the rows; between them the table's rate is a straight line.
    pub fn rates(&self) -> Vec<f64> {
        let swing = std::f64::consts::TAU * self.swings / self.duration_s;
        self.times().iter().map(|t| self.rate_dps * (swing * t).cos()).collect()
    }

    /// How far the table turned by each row at these rates, deg.
    pub fn turned(&self, rates: &[f64]) -> Vec<f64> {
        let step = 0.5 / self.sample_hz;
        let steps = rates.windows(2).map(|w| step * (w[0] + w[1]));
        std::iter::once(0.0)
            .chain(steps.scan(0.0, |sum, d| {
                *sum += d;
                Some(*sum)
            }))
            .collect()
    }

    /// Puts these rates into what a recording has of the table.
    pub(crate) fn tell(&self, recording: &mut Recording, rates: Vec<f64>) {
        if self.reference != Told::Rate {
            recording.table_deg = Some(self.turned(&rates).iter().map(|d| d.rem_euclid(360.0)).collect());
        }
        recording.rate_dps = (self.reference != Told::Table).then_some(rates);
    }
}

/// A campaign of these recordings, each a rotation.
pub fn campaign(recordings: Vec<Recording>) -> Campaign {
    let run = |recording: Recording| Run {
        kind: RunKind::Rotation,
        file: recording.source.clone(),
        settle_s: 0.0,
        role: Role::Fit,
        amplitude: None,
        recording,
    };
    Campaign { device: "made".into(), runs: recordings.into_iter().map(run).collect(), ..Campaign::default() }
}

/// Puts one value in the place of those of some rows.
pub fn hold(recording: &mut Recording, rows: std::ops::Range<usize>) {
    for v in [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten() {
        let value = v[rows.start];
        v[rows.clone()].fill(value);
    }
}
