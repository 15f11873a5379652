//! The facts of an identification, as they are written to `report.json`. Nothing is rendered here.

use serde::{Deserialize, Serialize};

use crate::model::hypothesis::Origin;
use crate::model::written::EffectText;

/// Identifier of the report's format.
pub const SCHEMA: &str = "cvg.report/2";

/// Size of an angle error, deg.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ErrorSize {
    /// root mean square
    pub rms_deg: f64,
    /// largest magnitude
    pub peak_deg: f64,
    /// largest minus smallest, of the worst run
    pub peak_to_peak_deg: f64,
}

/// What a harmonic follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Follows {
    /// the pattern angle
    Pattern,
    /// the table angle
    Table,
}

/// One harmonic of a residual.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Harmonic {
    /// what it follows
    pub of: Follows,
    /// harmonic number
    pub n: u32,
    /// amplitude, deg
    pub amplitude_deg: f64,
    /// half width of the 95 % interval of either quadrature component, deg
    pub ci95_deg: f64,
    /// phase of A cos(nθ + phase), deg
    pub phase_deg: f64,
}

/// What came of an identification.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// the instrument was identified, and undoing what was found helps on held-out data
    Answered,
    /// what was found leaves more of the held-out error than nothing does, of a gyroscope beyond chance: compensating changes nothing
    Neutral,
    /// the campaign does not carry an answer
    Refused,
}

/// The largest ratio of the gains of two channels, of which each may be in a unit of its own, that leaves an angle: engineering choice.
pub(crate) const LARGEST_RATIO_OF_A_SENSOR: f64 = 30.0;

/// The share of what the declared model leaves that follows one thing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// pattern, table, time, rate, amplitude, direction, temperature or rest
    pub of: String,
    /// what the rows do not tell it apart from: one share for all of them
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shared_with: Vec<String>,
    /// share of the variance, 0 to 1
    pub share: f64,
    /// its 95 % interval
    pub ci95: [f64; 2],
}

impl Share {
    /// All that has the share, as "pattern or time".
    #[must_use]
    pub fn named(&self) -> String {
        [std::slice::from_ref(&self.of), &self.shared_with].concat().join(" or ")
    }
}

/// The program that wrote a report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tool {
    /// name
    pub name: String,
    /// version
    pub version: String,
}

impl Default for Tool {
    fn default() -> Self {
        Self { name: "cvg".into(), version: env!("CARGO_PKG_VERSION").into() }
    }
}

/// A file that was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// file
    pub file: String,
    /// CRC-32 (IEEE 802.3) of its bytes, as eight hexadecimal digits; null where they cannot be read twice
    #[serde(default)]
    pub crc32: Option<String>,
}

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// value
    pub value: f64,
    /// lower and upper end
    pub ci95: [f64; 2],
}

impl Estimate {
    /// A value and its standard deviation.
    pub fn new(value: f64, deviation: f64) -> Self {
        Self { value, ci95: [value - 1.96 * deviation, value + 1.96 * deviation] }
    }

    /// The same value, less sure by so much on either side.
    #[must_use]
    pub(crate) fn widened(self, by: f64) -> Self {
        Self { ci95: [self.ci95[0] - by, self.ci95[1] + by], ..self }
    }

    /// The same, counted from elsewhere.
    #[must_use]
    pub(crate) fn turned(self, by: f64) -> Self {
        Self { value: self.value + by, ci95: self.ci95.map(|end| end + by) }
    }

    /// Of what is not told: no number.
    pub fn unknown() -> Self {
        Self { value: f64::NAN, ci95: [f64::NAN; 2] }
    }

    /// There is a number.
    pub fn is_told(&self) -> bool {
        self.value.is_finite()
    }

    /// Half the width of the interval.
    pub fn half_width(&self) -> f64 {
        0.5 * (self.ci95[1] - self.ci95[0])
    }
}

/// A parameter of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterReport {
    /// name
    pub name: String,
    /// unit
    pub unit: String,
    /// value
    pub value: f64,
    /// 95 % interval; null for what a search set, and where none could be shown to hold
    pub ci95: Option<[f64; 2]>,
}

/// Held-out rms of the angle error without and with an effect, deg.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BeforeAfter {
    /// without the effect
    pub before: f64,
    /// with it
    pub after: f64,
}

/// An effect that was identified.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectReport {
    /// identifier in the effect library
    pub id: String,
    /// how it came in
    pub origin: Origin,
    /// its parameters
    pub parameters: Vec<ParameterReport>,
    /// what it does for the held-out error
    pub heldout_rms_deg: Option<BeforeAfter>,
    /// why it is believed
    pub evidence: String,
    /// effects that this campaign cannot tell from it
    pub confounded_with: Vec<String>,
    /// the extra run that would
    pub separated_by: Option<String>,
}

/// Held-out angle errors at the three stages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Heldout {
    /// before any compensation; null where the raw angle does not turn
    pub raw: Option<ErrorSize>,
    /// after the paper's compensation
    pub declared: ErrorSize,
    /// after all
    pub discovered: ErrorSize,
    /// the white part of the error, deg rms
    pub noise_floor_deg: f64,
}

/// What is left after all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResidualReport {
    /// its harmonics
    pub harmonics: Vec<Harmonic>,
    /// Ljung–Box finds no memory in it at 1 %
    pub white: bool,
}

/// What is left in one channel of the fitted runs, at one stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelReport {
    /// declared, or discovered
    pub stage: String,
    /// angle, amplitude, vas, vqc or quadrature
    pub channel: String,
    /// unit of what is stated below
    pub unit: String,
    /// root mean square
    pub rms: f64,
    /// Ljung–Box finds no memory in it at 1 %
    pub white: bool,
    /// autocorrelation at lags 0, 1, … samples
    pub autocorrelation: Vec<f64>,
    /// white noise stays within ± this at 99 % of the lags
    pub band99: f64,
    /// harmonics of the pattern and of the table
    pub harmonics: Vec<ChannelHarmonic>,
    /// the strongest line in time that is none of these, if it is no accident
    pub line: Option<ChannelLine>,
    /// rms of a slow change of every run, if it is no accident
    pub drift_rms: Option<f64>,
}

/// One harmonic of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChannelHarmonic {
    /// what it follows
    pub of: Follows,
    /// harmonic number
    pub n: u32,
    /// amplitude
    pub amplitude: f64,
    /// half width of the 95 % interval of either quadrature component
    pub ci95: f64,
    /// phase of A cos(nθ + phase), deg
    pub phase_deg: f64,
    /// how it goes from run to run, where it is large enough to tell
    pub scaling: Option<HarmonicScaling>,
}

/// How a harmonic goes with what differs between runs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HarmonicScaling {
    /// exponent of the rate; null where the runs have one
    pub rate: Option<Exponent>,
    /// exponent of the amplitude; null where the runs have one
    pub amplitude: Option<Exponent>,
    /// it changes its sign with the direction; null where the runs have one
    pub turns_with_direction: Option<bool>,
}

/// An exponent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Exponent {
    /// value
    pub value: f64,
    /// half width of its 95 % interval
    pub ci95: f64,
}

/// A line in time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChannelLine {
    /// frequency, Hz
    pub frequency_hz: f64,
    /// root mean square
    pub rms: f64,
}

/// The held-out error after one step from the raw angle to the last effect, with what speaks for the step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// raw, declared, discovered or empirical
    pub stage: String,
    /// the effect that came in; null for raw and declared
    pub effect: Option<String>,
    /// size of the held-out error after it
    pub heldout: ErrorSize,
    /// harmonics of the pattern in the held-out error after it
    pub harmonics: Vec<Harmonic>,
    /// what the effect leaves in the channels, by its definition
    pub signature: Option<String>,
    /// gain in 2 ln likelihood after the price of its parameters and of the search
    pub gain: Option<f64>,
    /// those that it beat
    pub rivals: Vec<Rival>,
    /// rms of what the energy balance leaves of ln a, before and after
    pub energy_balance: Option<[f64; 2]>,
    /// why a cause is not claimed
    pub inconsistency: Option<String>,
}

/// An effect that was beaten.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rival {
    /// identifier in the effect library
    pub id: String,
    /// by how much, in 2 ln likelihood
    pub beaten_by: f64,
}

/// A feature of the residual that nothing explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unexplained {
    /// pattern-harmonic, table-harmonic, rate-dependent, drift, time-periodic or other
    pub class: String,
    /// harmonic number
    pub n: Option<u32>,
    /// frequency, Hz
    pub frequency_hz: Option<f64>,
    /// size, deg rms
    pub rms_deg: f64,
    /// what could be done about it
    pub suggestion: String,
}

/// A run of the campaign as it was used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// file
    pub file: String,
    /// rotation, ringdown, static, decay, virtual or cross-axis
    pub kind: String,
    /// fit; fit, last quarter held out; holdout; at rest; misalignment; or left out
    pub r#use: String,
    /// rows read
    pub rows: usize,
    /// rows dropped on reading, by reason
    pub dropped: Vec<String>,
    /// mean input rate, deg/s
    pub rate_dps: Option<f64>,
    /// positive, negative or both: which ways the input turned; null of other kinds than a rotation
    #[serde(default)]
    pub way: Option<String>,
    /// samples set aside as spikes
    pub spikes: usize,
    /// decay time constant, s
    pub tau_s: Option<Estimate>,
    /// k as this run alone tells it at its own temperature, everything else as all runs have it; null where it does not
    pub angular_gain: Option<Estimate>,
    /// bias of this run at its own temperature: precession at rest, as k of all runs leaves it, deg/s
    pub bias_dps: Option<Estimate>,
    /// angle error of this run less its best line, deg rms
    pub rms_deg: Option<f64>,
    /// mean temperature, °C; null where none was recorded
    #[serde(default)]
    pub temp_c: Option<f64>,
    /// G_Dy/G_Dx as this run alone tells it; only beside a temperature, and null where it does not
    #[serde(default)]
    pub detection_gain_ratio: Option<f64>,
    /// it agrees with the other runs; false where it was left out because it does not, null where it was not judged
    pub agrees: Option<bool>,
}

/// How far the angle of an instrument at rest wanders, over which time: the overlapping Allan deviation of its rate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Allan {
    /// angle random walk, deg/√h; null where the deviation has no stretch of it
    pub angle_random_walk_deg_sqrt_h: Option<Estimate>,
    /// shortest averaging time at which it was read, s: beyond what filters and digits do to the noise; null where it is null
    #[serde(default)]
    pub angle_random_walk_tau_s: Option<f64>,
    /// bias instability, deg/h: the lowest deviation over √(2 ln 2/π)
    pub bias_instability_dph: Estimate,
    /// averaging time at which the deviation is lowest, s
    pub bias_instability_tau_s: f64,
    /// sampling interval, s
    pub interval_s: f64,
    /// the deviation
    pub points: Vec<AllanPoint>,
}

/// The Allan deviation at one averaging time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AllanPoint {
    /// averaging time, s
    pub tau_s: f64,
    /// deviation, deg/h
    pub deviation_dph: f64,
    /// its 95 % interval
    pub ci95: [f64; 2],
}

/// How far the input axis of a rate gyroscope is off the plane across an axis that it was turned about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Misalignment {
    /// the run about that axis
    pub file: String,
    /// the angle, deg; positive where the output goes with the rotation as it does about the input axis. Null where the run
    /// does not identify it
    pub angle_deg: Option<Estimate>,
    /// why it is null
    pub reason: Option<String>,
}

/// How the scale factor goes with the input rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScaleFactor {
    /// angular gain at the fastest less that at the slowest rate, either sense alike, over their mean, ppm
    pub nonlinearity_ppm: Estimate,
    /// angular gain at positive less that at negative rates, over their mean, ppm
    pub asymmetry_ppm: Estimate,
}

/// How what runs tell goes with their temperatures: slopes of straight lines, with intervals from the scatter of the runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Temperature {
    /// runs with a temperature
    pub runs: usize,
    /// lowest and highest mean temperature of a run, °C
    pub range_c: [f64; 2],
    /// of the angular gain, 1/K
    pub angular_gain_per_k: Option<Estimate>,
    /// of the bias, deg/s/K
    pub bias_dps_per_k: Option<Estimate>,
    /// of G_Dy/G_Dx, 1/K
    pub detection_gain_ratio_per_k: Option<Estimate>,
    /// why a slope that is null is not told
    pub reason: Option<String>,
}

/// What decays without any loop tell of a resonator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DecayReport {
    /// 1/τ, 1/s
    pub damping_per_s: Estimate,
    /// τ, s
    pub tau_s: Estimate,
    /// precession of the pattern by the input rotation, θ̇ = −kΩ, at the rate of the runs, deg/h; null, and not a number here, where that is not one
    #[serde(with = "told")]
    pub precession_dph: Estimate,
    /// the same under the paper's model alone
    #[serde(with = "told")]
    pub precession_dph_declared: Estimate,
    /// frequency of the vibration, Hz, mean over the runs; null where the recordings are envelopes
    pub carrier_hz: Option<f64>,
    /// dω/dE, rad/s/V²; null where frequency does not follow energy
    pub frequency_per_energy: Option<Estimate>,
    /// the pattern was seen at angles that tell anisotropies from what does not depend on direction
    pub many_angles: bool,
    /// angle error of whole decays, deg rms: by a constant rate, by the paper's model, after all
    pub rms_deg: [f64; 3],
}

/// An estimate that may be none, written as null.
mod told {
    use super::Estimate;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(e: &Estimate, to: S) -> Result<S::Ok, S::Error> {
        e.is_told().then_some(e).serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Estimate, D::Error> {
        Ok(Option::deserialize(from)?.unwrap_or_else(Estimate::unknown))
    }
}

/// The report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`SCHEMA`]
    pub schema: String,
    /// what came of it
    pub status: Status,
    /// why it is not answered; null where it is
    pub reason: Option<String>,
    /// the program
    pub tool: Tool,
    /// the files that were read
    pub inputs: Vec<Input>,
    /// name of the instrument
    pub device: String,
    /// gyroscope or sensor
    pub instrument: String,
    /// k; null, and not a number here, where the campaign cannot tell
    #[serde(with = "told")]
    pub angular_gain: Estimate,
    /// G_Dy/G_Dx; null where the campaign cannot tell
    pub detection_gain_ratio: Option<Estimate>,
    /// G_Ax/G_Ay; null where the campaign cannot tell
    pub actuation_gain_ratio: Option<Estimate>,
    /// identified effects
    pub effects: Vec<EffectReport>,
    /// held-out errors
    pub heldout: Heldout,
    /// from the raw angle to the last effect, on the held-out data
    pub steps: Vec<StepReport>,
    /// what is left
    pub residual: ResidualReport,
    /// what is left in each channel of the fitted runs, under the declared model and after all
    pub channels: Vec<ChannelReport>,
    /// what is left and has no explanation
    pub unexplained: Vec<Unexplained>,
    /// the campaign's runs
    pub runs: Vec<RunReport>,
    /// what the declared residual follows, by shares of its variance; empty where it was not taken apart
    pub decomposition: Vec<Share>,
    /// effects that are proposed for the library, each in the form of an effect file
    pub proposals: Vec<EffectText>,
    /// how the scale factor goes with the rate; null where fewer than four rates of both senses are there
    pub scale_factor: Option<ScaleFactor>,
    /// standard deviation of what each run says of the angular gain by itself, ppm of it; null with fewer than three runs that do
    #[serde(default)]
    pub repeatability_ppm: Option<Estimate>,
    /// how far the input axis is off the plane across other axes; absent without a run about one
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub misalignment: Vec<Misalignment>,
    /// how far the angle wanders at rest; null without a run at rest
    pub allan: Option<Allan>,
    /// how gain, bias and readout go with the temperature; null without two runs with one
    #[serde(default)]
    pub temperature: Option<Temperature>,
    /// what free decays tell; absent without them
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decay: Option<DecayReport>,
    /// what a reader must know
    pub warnings: Vec<String>,
}
