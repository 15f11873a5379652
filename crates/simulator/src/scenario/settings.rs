//! What a scenario file says, as it says it: plain fields with units in their names, and their defaults.
//!
//! Unknown keys are refused by the reader; whether the values make sense is the next file's question.

use serde::{Deserialize, Serialize};

use super::effect::EffectSetting;

/// A scenario file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// name of the device in the campaign
    pub device: String,
    /// what kind of instrument it is
    #[serde(default)]
    pub instrument: Instrument,
    /// carrier frequency, Hz; passed on to the campaign, and what runs with a `carrier_sample_hz` vibrate at
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub carrier_hz: Option<f64>,
    /// decay time of the amplitude, s (gyroscope)
    #[serde(default = "defaults::tau_s")]
    pub tau_s: f64,
    /// k of Equation 1, θ = −k∫Ω dt
    pub angular_gain: f64,
    /// the start value of k that the campaign states
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angular_gain_stated: Option<f64>,
    /// amplitude of the vibration, or of a sensor's channels, V
    #[serde(default = "defaults::amplitude_v")]
    pub amplitude_v: f64,
    /// ω − ω_r before the phase-locked loop corrects it, Hz (gyroscope)
    #[serde(default)]
    pub detuning_hz: f64,
    /// G_A/2ω: how fast a volt moves the amplitude, 1/s per V (gyroscope)
    #[serde(default = "defaults::drive_per_s_v")]
    pub drive_per_s_v: f64,
    /// limit of a drive channel, V (gyroscope)
    #[serde(default = "defaults::limit_v")]
    pub limit_v: f64,
    /// white noise of the readout, V rms per channel and control sample (sensor: per recorded sample)
    #[serde(default)]
    pub noise_v: f64,
    /// white noise of the drives, V rms per channel and control sample: angle random walk (gyroscope)
    #[serde(default)]
    pub force_noise_v: f64,
    /// relative 1/f noise of the gain of either readout channel, density `gain_flicker`²/f (gyroscope)
    #[serde(default)]
    pub gain_flicker: f64,
    /// relative 1/f noise of the table's rate, which `rate_dps` does not show, density `table_wander`²/f (gyroscope)
    #[serde(default)]
    pub table_wander: f64,
    /// control samples per second
    #[serde(default = "defaults::control_hz")]
    pub control_hz: f64,
    /// rows per second in the recordings; divides `control_hz`
    #[serde(default = "defaults::sample_hz")]
    pub sample_hz: f64,
    /// the loops run this long before t = 0, s
    #[serde(default)]
    pub warm_up_s: f64,
    /// seed of all that is random
    #[serde(default)]
    pub seed: u64,
    /// the recordings have the instrument's own angle, `theta_deg`
    #[serde(default)]
    pub theta_deg: bool,
    /// the recordings have a temperature that drifts like this
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Temperature>,
    /// an isotropic nonlinear spring (gyroscope)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spring_isotropic: Option<IsotropicSpring>,
    /// tuning of the loops (gyroscope)
    #[serde(default)]
    pub loops: Loops,
    /// what is wrong with the device and its bench
    #[serde(default)]
    pub effects: Vec<EffectSetting>,
    /// what the electronics undo of it: effects of the readout and of the actuation (gyroscope)
    #[serde(default)]
    pub compensation: Vec<EffectSetting>,
    /// the runs
    #[serde(rename = "run")]
    pub runs: Vec<Run>,
}

/// The kind of instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Instrument {
    /// a whole-angle gyroscope in its loops
    #[default]
    Gyroscope,
    /// a two-channel angle sensor
    Sensor,
}

/// A temperature that drifts evenly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature {
    /// at t = 0, °C
    pub start_c: f64,
    /// K/s
    #[serde(default)]
    pub drift_k_per_s: f64,
    /// by how much each run starts warmer than the one before it, K
    #[serde(default)]
    pub step_k: f64,
    /// that parameters refer to, °C
    #[serde(default = "defaults::reference_c")]
    pub reference_c: f64,
}

impl Temperature {
    /// Temperature at t = 0 of the run at `index`, °C.
    #[allow(clippy::cast_precision_loss, reason = "no scenario has 2^53 runs")]
    pub fn start_of(&self, index: usize) -> f64 {
        self.start_c + self.step_k * index as f64
    }
}

/// A spring whose force is not in proportion to the displacement, the same in all directions: the pattern precesses with its
/// quadrature, and the frequency follows the energy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct IsotropicSpring {
    /// θ̇ += cQ, rad/s/V²
    pub c: f64,
    /// ω += this times E, rad/s/V²; not given, it is −3c, that of a force with a cubic part
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_per_energy: Option<f64>,
}

impl IsotropicSpring {
    /// How ω goes with E, rad/s/V².
    ///
    /// A force −βr²(x, y) beside the linear one has the mean energy β(3E² − Q²)/32, whose slopes over the actions ½ωE and ½ωQ are
    /// 3βE/8ω of the phase and −βQ/8ω of the pattern.
    pub fn frequency_per_energy(&self) -> f64 {
        self.frequency_per_energy.unwrap_or(-3.0 * self.c)
    }
}

/// Tuning of the loops.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Loops {
    /// energy controller
    pub energy: Tuning,
    /// quadrature controller
    pub quadrature: Tuning,
    /// phase-locked loop
    pub phase: Tuning,
    /// rate loop of the ring-downs
    pub rate: Tuning,
}

/// Tuning of one loop: its closed-loop natural frequency and damping ratio.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tuning {
    /// ω_n/2π, Hz
    pub bandwidth_hz: f64,
    /// ζ
    pub damping: f64,
}

impl Default for Loops {
    /// Energy and quadrature at 1 Hz, critically flat; phase and rate faster, without overshoot.
    ///
    /// The quadrature loop's bandwidth decides how much quadrature a frequency split leaves: at 40 mHz, k = 0.78, this
    /// one leaves a fourth harmonic of 2.3 mdeg in the angle at 500 deg/s and 11.2 mdeg at 60 deg/s.
    fn default() -> Self {
        let tuning = |bandwidth_hz, damping| Tuning { bandwidth_hz, damping };
        Self { energy: tuning(1.0, 0.7), quadrature: tuning(1.0, 0.7), phase: tuning(5.0, 1.0), rate: tuning(2.0, 1.0) }
    }
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Run {
    /// the table turns and the pattern is free
    Rotation {
        /// name of the recording in the campaign's folder
        file: String,
        /// commanded rate, deg/s
        rate_dps: f64,
        /// length, s
        duration_s: f64,
        /// set amplitude relative to `amplitude_v`
        #[serde(default = "defaults::one")]
        amplitude: f64,
        /// what the run is for
        #[serde(default, rename = "use")]
        purpose: Purpose,
        /// what the campaign says is to be dropped at the start, s
        #[serde(default)]
        settle_s: f64,
        /// how the rate goes over time
        #[serde(default)]
        profile: Profile,
        /// which reference is recorded
        #[serde(default)]
        reference: Reference,
        /// angle of the pattern at the start, deg; random if not given
        #[serde(default, skip_serializing_if = "Option::is_none")]
        start_deg: Option<f64>,
        /// displacements and forces themselves are recorded, `x_v`, `y_v`, `fx_v` and `fy_v`, at so many samples a second
        #[serde(default, skip_serializing_if = "Option::is_none")]
        carrier_sample_hz: Option<f64>,
    },
    /// the table stands, the rate loop holds the pattern, the energy loop is switched off
    Ringdown {
        /// name of the recording in the campaign's folder
        file: String,
        /// angle at which the pattern is held, deg
        angle_deg: f64,
        /// when the energy loop is switched off, s
        energy_off_s: f64,
        /// length, s
        duration_s: f64,
        /// set amplitude relative to `amplitude_v`
        #[serde(default = "defaults::one")]
        amplitude: f64,
        /// displacements and forces themselves are recorded, `x_v`, `y_v`, `fx_v` and `fy_v`, at so many samples a second
        #[serde(default, skip_serializing_if = "Option::is_none")]
        carrier_sample_hz: Option<f64>,
    },
    /// no loops and no forces: the vibration rings freely
    Decay {
        /// name of the recording in the campaign's folder
        file: String,
        /// angle of the pattern at the start, deg
        start_deg: f64,
        /// minor over major axis of the orbit at the start; signed
        #[serde(default)]
        quadrature: f64,
        /// input rate, deg/s
        #[serde(default)]
        rate_dps: f64,
        /// length, s
        duration_s: f64,
        /// amplitude at the start relative to `amplitude_v`
        #[serde(default = "defaults::one")]
        amplitude: f64,
        /// what the run is for
        #[serde(default, rename = "use")]
        purpose: Purpose,
        /// the displacements themselves are recorded, `x_v` and `y_v`, at so many samples a second
        #[serde(default, skip_serializing_if = "Option::is_none")]
        carrier_sample_hz: Option<f64>,
    },
    /// no table: the pattern is precessed to and fro by the instrument's own forces, and turned by whoever turns it, which is
    /// not recorded
    Virtual {
        /// name of the recording in the campaign's folder
        file: String,
        /// commanded precession of the pattern, deg/s
        virtual_dps: f64,
        /// time between two reversals of it, s; every other pair is at half the speed
        #[serde(default = "defaults::reversal_s")]
        reversal_s: f64,
        /// length, s
        duration_s: f64,
        /// input rates: from when on, s, and how fast, deg/s; at rest before the first
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        turned: Vec<[f64; 2]>,
        /// set amplitude relative to `amplitude_v`
        #[serde(default = "defaults::one")]
        amplitude: f64,
        /// what the run is for
        #[serde(default, rename = "use")]
        purpose: Purpose,
        /// what the campaign says is to be dropped at the start, s
        #[serde(default)]
        settle_s: f64,
    },
}

/// What a run is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Purpose {
    /// to identify from
    #[default]
    Fit,
    /// to prove on
    Holdout,
}

/// How the rate goes over time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// the same all the time
    #[default]
    Constant,
    /// the first half there, the second half back
    ThereAndBack,
}

/// Which reference a rotation run records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reference {
    /// the commanded rate, `rate_dps`
    #[default]
    Rate,
    /// the table's true angle, `table_deg`
    Table,
    /// both
    Both,
}

impl Run {
    /// Name of the recording.
    pub fn file(&self) -> &str {
        match self {
            Self::Rotation { file, .. }
            | Self::Ringdown { file, .. }
            | Self::Decay { file, .. }
            | Self::Virtual { file, .. } => file,
        }
    }

    /// Length, s.
    pub fn duration_s(&self) -> f64 {
        match self {
            Self::Rotation { duration_s, .. }
            | Self::Ringdown { duration_s, .. }
            | Self::Decay { duration_s, .. }
            | Self::Virtual { duration_s, .. } => *duration_s,
        }
    }

    /// Set amplitude relative to the device's.
    pub fn amplitude(&self) -> f64 {
        match self {
            Self::Rotation { amplitude, .. }
            | Self::Ringdown { amplitude, .. }
            | Self::Decay { amplitude, .. }
            | Self::Virtual { amplitude, .. } => *amplitude,
        }
    }

    /// Samples of the displacements a second, where these are recorded in the place of envelopes.
    pub fn carrier_sample_hz(&self) -> Option<f64> {
        match self {
            Self::Rotation { carrier_sample_hz, .. }
            | Self::Ringdown { carrier_sample_hz, .. }
            | Self::Decay { carrier_sample_hz, .. } => *carrier_sample_hz,
            Self::Virtual { .. } => None,
        }
    }
}

mod defaults {
    pub(super) fn reference_c() -> f64 {
        25.0
    }
    pub(super) fn tau_s() -> f64 {
        22.0
    }
    pub(super) fn amplitude_v() -> f64 {
        1.0
    }
    pub(super) fn drive_per_s_v() -> f64 {
        1.0
    }
    pub(super) fn limit_v() -> f64 {
        10.0
    }
    pub(super) fn control_hz() -> f64 {
        2000.0
    }
    pub(super) fn reversal_s() -> f64 {
        9.0
    }
    pub(super) fn sample_hz() -> f64 {
        100.0
    }
    pub(super) fn one() -> f64 {
        1.0
    }
}
