//! What a recording can hold: the library of effects.
//!
//! An effect exists once, here, in a file of its own: its forward definition at signal level, its parameters with
//! units and bounds, its signature and its source. The simulator applies the definition, the identification predicts
//! from it, the compensation inverts it, and the documentation prints it.
//!
//! Where a parameter may follow the temperature, the effect says so in the same file, and [`over_temperature`] makes an effect of that.
//!
//! **To add an effect**: write `effects/my_effect.rs` with a type that implements [`Effect`], and add its line to the
//! list at the end of this file. Nothing else names effects one by one.
//!
//! A recording is made in four stages, and an effect acts in one of them: the [`Stage`].

use crate::{AxisForces, Envelope, Real};

pub mod actuation_gain_mismatch;
pub mod actuation_phase;
pub mod actuation_skew;
pub mod angle_latency;
pub mod anisodamping;
pub mod anisoelasticity;
pub mod detection_cubic;
pub mod detection_gain_mismatch;
pub mod detection_offset;
pub mod detection_phase;
pub mod detection_quintic;
pub mod detection_saturation;
pub mod detection_skew;
pub mod drive_feedthrough;
pub mod drive_quantisation;
pub mod drive_saturation;
pub mod gain_drift;
pub mod harmonic_n;
mod moment;
pub mod over_temperature;
pub mod rate_offset;
pub mod scale_drift;
pub mod scale_temperature;
pub mod spring_cubic;
pub mod table_harmonic;
#[cfg(test)]
mod tests;
pub mod time_periodic;
#[cfg(feature = "written")]
pub mod written;

pub use detection_cubic::Cubic;
pub use moment::Moment;

/// The most parameters one effect may have.
pub const MAX_PARAMETERS: usize = 4;

/// Values of an effect's parameters, in the order of its [`Description::parameters`]; unused places are 0.
pub type Values<T> = [T; MAX_PARAMETERS];

/// Where in the making of a recording an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// on the rotation that reaches the resonator
    Input,
    /// in the resonator: a rate of change of the envelope
    Mechanics,
    /// on the forces that the drive channels make of the commands
    Actuation,
    /// on the envelope that the readout makes of the vibration
    Readout,
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// the field's name for it
    pub name: &'static str,
    /// unit, in the notation of the report ("1/V^2")
    pub unit: &'static str,
    /// smallest admissible value
    pub lower: f64,
    /// largest admissible value
    pub upper: f64,
    /// value at which the effect is absent
    pub neutral: f64,
    /// a change that is small but plain to see (of the order of 1 mrad in angle)
    pub scale: f64,
    /// how a fit treats it
    pub role: Role,
    /// what is believed of it before the data
    pub belief: Belief,
}

impl Parameter {
    /// The same with a belief.
    const fn believed(self, belief: Belief) -> Self {
        Self { belief, ..self }
    }
}

/// What is believed of a parameter before the data: how far it may be from its neutral value, as a standard deviation. The
/// data have to say more than this for the parameter to be reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Belief {
    /// nothing
    Vague,
    /// so far, in the parameter's unit
    Within(f64),
    /// what it does is within this share of the amplitude: divided by the rms of the commands over the amplitude, V/V
    ShareOfAmplitude(f64),
}

/// How a fit treats a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// adjusted together with all others
    Fitted,
    /// held at its neutral value until the data asks for it
    Refined,
    /// chosen by a search and then held
    Searched(Search),
    /// found by a search, and from there adjusted together with all others
    Located(Search),
    /// one of these, each tried as an alternative of its own, and then held
    Chosen(&'static [f64]),
}

/// Over what a parameter is searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// harmonics of the pattern angle
    PatternHarmonic,
    /// orders of the table angle, whole or not
    TableOrder {
        /// whole orders up to this have a cause; what lies beyond or between is described and not explained
        explained_to: u32,
    },
    /// frequencies in time
    Frequency,
}

/// How parameters are shown to people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shown {
    /// the parameter as it is
    Plain(usize),
    /// two parameters (c, s) as magnitude √(c² + s²) and angle atan2(s, c)/`division`, in degrees
    Polar {
        /// index of the cosine part
        cos: usize,
        /// index of the sine part
        sin: usize,
        /// name of the magnitude
        magnitude: &'static str,
        /// unit of the magnitude
        unit: &'static str,
        /// name of the angle
        angle: &'static str,
        /// the angle is atan2(s, c) divided by this (2 for a principal axis)
        division: f64,
    },
}

/// How an effect's share in the angle scales, the property that tells effects of one harmonic apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scaling {
    /// exponent of the input rate |Ω|: 0 for readout effects, −1 for dynamic ones
    pub rate: i8,
    /// exponent of the amplitude a
    pub amplitude: i8,
    /// the sign of the effect follows the sign of Ω
    pub odd_in_rate: bool,
}

/// What is known of an effect besides its definition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// identifier in campaigns, calibrations and reports
    pub id: &'static str,
    /// one line for people
    pub title: &'static str,
    /// where it acts
    pub stage: Stage,
    /// part of the paper's model
    pub declared: bool,
    /// a description without a cause: what is left to say when no physical effect explains a residual
    pub empirical: bool,
    /// a two-channel angle sensor without mechanics can have it too
    pub in_sensors: bool,
    /// its parameters
    pub parameters: &'static [Parameter],
    /// where a fit begins when the effect has no slope at its neutral values: values of the first parameter, in units
    /// of one over the largest amplitude of what it acts on, a readout channel or a drive
    pub onsets: &'static [f64],
    /// how they are shown
    pub shown: &'static [Shown],
    /// small-signal signature, for people
    pub signature: &'static str,
    /// scaling of its share in the angle
    pub scaling: Scaling,
    /// where the definition comes from
    pub source: &'static str,
}

impl Description {
    /// The effect at `values` has a known cause. What has none is empirical: described, corrected, not explained.
    pub fn explains(&self, values: &Values<f64>) -> bool {
        !self.empirical
            && self.parameters.iter().zip(values).all(|(p, v)| match p.role {
                Role::Searched(Search::TableOrder { explained_to }) => {
                    *v <= f64::from(explained_to) && (*v - libm::round(*v)).abs() < WHOLE
                }
                _ => true,
            })
    }
}

/// An order this close to a whole number is one.
const WHOLE: f64 = 1e-6;

/// What form the inverse of a readout effect has, for whoever undoes it often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Inverse<T> {
    /// nothing simpler than [`Effect::unread`]
    Unread,
    /// affine, the same at every moment: one real matrix on (x, y) for both phases, and an offset in phase
    Affine,
    /// each channel by itself, the same at every moment: the root of a cubic
    Cubic(Cubic<T>),
}

/// An effect: its description and its forward definition in the stage where it acts.
///
/// Only what stands in the list at the end of this file is one, so that the trait can grow; an effect outside the library is
/// written down as text.
///
/// ```compile_fail,E0277
/// use cvg_model::effects::detection_skew::DetectionSkew;
/// use cvg_model::effects::{Description, Effect};
///
/// struct OfSomebodyElse;
///
/// impl Effect for OfSomebodyElse {
///     const DESCRIPTION: Description = DetectionSkew::DESCRIPTION;
/// }
/// ```
pub trait Effect: listed::Listed {
    /// What is known of it.
    const DESCRIPTION: Description;

    /// It is told by the time of a recording's clock, which says nothing of another day.
    const IN_TIME: bool = false;

    /// It is seen in what the loops answer to it: nothing tells it without the quadrature and the commands.
    const SEEN_BY_LOOPS: bool = false;

    /// It is told by the temperature: [`Moment::warmer_k`].
    const BY_TEMPERATURE: bool = false;

    /// It is made of the drives' commands: [`Moment::drive`].
    const ON_COMMANDS: bool = false;

    /// Input rate that reaches the resonator, rad/s, when the table turns at `rate_rad_s`.
    #[inline]
    fn input_rate<T: Real>(_: &Values<T>, rate_rad_s: T, _: &Moment<T>) -> T {
        rate_rad_s
    }

    /// What the effect adds to the envelope's rate of change, per second.
    #[inline]
    fn mechanics<T: Real>(_: &Values<T>, _: &Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        Envelope::zero()
    }

    /// The forces that result when `f` is commanded, in volts of command.
    #[inline]
    fn actuate<T: Real>(_: &Values<T>, f: AxisForces<T>, _: &Moment<T>) -> AxisForces<T> {
        f
    }

    /// The envelope that the readout gives for the vibration `e`.
    #[inline]
    fn read<T: Real>(_: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        e
    }

    /// The vibration behind the readout `e`: the inverse of [`Effect::read`].
    ///
    /// By default the fixed point of z ← z + (e − read(z)), which contracts for an effect well below one; an effect
    /// with a closed inverse gives that instead.
    #[inline]
    fn unread<T: Real>(p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let mut z = e;
        for _ in 0..FIXED_POINT_STEPS {
            z = z + (e - Self::read(p, z, at));
        }
        z
    }

    /// The form of [`Effect::unread`].
    #[inline]
    fn inverse<T: Real>(_: &Values<T>) -> Inverse<T> {
        Inverse::Unread
    }
}

/// Steps of the default inverse: an effect of 5 % is undone to 0.05^8 < 1e-10 of itself.
const FIXED_POINT_STEPS: usize = 8;

/// A description's default for a fitted parameter.
const fn fitted(name: &'static str, unit: &'static str, bound: f64, scale: f64) -> Parameter {
    Parameter {
        name,
        unit,
        lower: -bound,
        upper: bound,
        neutral: 0.0,
        scale,
        role: Role::Fitted,
        belief: Belief::Vague,
    }
}

/// A parameter that is held until the data asks for it.
const fn refined(name: &'static str, unit: &'static str, bound: f64, scale: f64) -> Parameter {
    Parameter { role: Role::Refined, ..fitted(name, unit, bound, scale) }
}

/// A parameter that a search sets.
const fn searched(name: &'static str, unit: &'static str, lower: f64, upper: f64, over: Search) -> Parameter {
    Parameter {
        name,
        unit,
        lower,
        upper,
        neutral: lower,
        scale: 1.0,
        role: Role::Searched(over),
        belief: Belief::Vague,
    }
}

/// A parameter that a search starts.
const fn located(name: &'static str, unit: &'static str, lower: f64, upper: f64, over: Search) -> Parameter {
    Parameter { role: Role::Located(over), ..searched(name, unit, lower, upper, over) }
}

/// Nobody else can name it.
mod listed {
    /// Stands in the list.
    pub trait Listed {}
}

macro_rules! library {
    ($($name:ident => $effect:path),+ $(,)?) => {
        /// An effect of the library, which grows.
        #[non_exhaustive]
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[allow(missing_docs, reason = "each variant is the effect of its name, documented in its own file")]
        pub enum EffectId {
            /// an effect outside the library, written down as text, that acts before all of the library's
            #[cfg(feature = "written")]
            WrittenFirst(&'static written::Written),
            $($name,)+
            /// an effect outside the library, written down as text; a readout effect acts after all of the library's
            #[cfg(feature = "written")]
            Written(&'static written::Written),
        }

        $(impl listed::Listed for $effect {})+

        impl EffectId {
            /// Every effect; readout effects in the order in which a signal meets them.
            pub const ALL: &'static [Self] = &[$(Self::$name),+];

            /// What is known of it.
            pub const fn description(self) -> &'static Description {
                match self {
                    $(Self::$name => const { &<$effect as Effect>::DESCRIPTION },)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => &text.description,
                }
            }

            /// [`Effect::IN_TIME`]
            pub const fn in_time(self) -> bool {
                match self {
                    $(Self::$name => const { <$effect as Effect>::IN_TIME },)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => text.in_time,
                }
            }

            /// [`Effect::SEEN_BY_LOOPS`]
            pub const fn seen_by_loops(self) -> bool {
                match self {
                    $(Self::$name => const { <$effect as Effect>::SEEN_BY_LOOPS },)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(_) | Self::Written(_) => false,
                }
            }

            /// [`Effect::BY_TEMPERATURE`]
            pub const fn by_temperature(self) -> bool {
                match self {
                    $(Self::$name => const { <$effect as Effect>::BY_TEMPERATURE },)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => text.by_temperature,
                }
            }

            /// [`Effect::ON_COMMANDS`]
            pub const fn on_commands(self) -> bool {
                match self {
                    $(Self::$name => const { <$effect as Effect>::ON_COMMANDS },)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => text.on_commands,
                }
            }

            /// [`Effect::input_rate`]
            #[inline]
            pub fn input_rate<T: Real>(self, p: &Values<T>, rate_rad_s: T, at: &Moment<T>) -> T {
                match self {
                    $(Self::$name => <$effect as Effect>::input_rate(p, rate_rad_s, at),)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => text.input_rate(p, rate_rad_s, at),
                }
            }

            /// [`Effect::mechanics`]
            #[inline]
            pub fn mechanics<T: Real>(self, p: &Values<T>, e: &Envelope<T>, at: &Moment<T>) -> Envelope<T> {
                match self {
                    $(Self::$name => <$effect as Effect>::mechanics(p, e, at),)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => text.mechanics(p, e, at),
                }
            }

            /// [`Effect::actuate`]
            #[inline]
            pub fn actuate<T: Real>(self, p: &Values<T>, f: AxisForces<T>, at: &Moment<T>) -> AxisForces<T> {
                match self {
                    $(Self::$name => <$effect as Effect>::actuate(p, f, at),)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => text.actuate(p, f, at),
                }
            }

            /// [`Effect::read`]
            #[inline]
            pub fn read<T: Real>(self, p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
                match self {
                    $(Self::$name => <$effect as Effect>::read(p, e, at),)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => text.read(p, e, at),
                }
            }

            /// [`Effect::unread`]
            #[inline]
            pub fn unread<T: Real>(self, p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
                match self {
                    $(Self::$name => <$effect as Effect>::unread(p, e, at),)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(text) | Self::Written(text) => text.unread(p, e, at),
                }
            }

            /// [`Effect::inverse`]
            pub fn inverse<T: Real>(self, p: &Values<T>) -> Inverse<T> {
                match self {
                    $(Self::$name => <$effect as Effect>::inverse(p),)+
                    #[cfg(feature = "written")]
                    Self::WrittenFirst(_) | Self::Written(_) => Inverse::Unread,
                }
            }
        }
    };
}

impl EffectId {
    /// The effect called `id`, if the library has it.
    pub fn from_id(id: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|e| e.description().id == id)
    }

    /// Whether the library has it. One that was written down as text is none for the electronics to undo.
    #[inline]
    pub const fn in_library(self) -> bool {
        #[cfg(feature = "written")]
        if let Self::WrittenFirst(_) | Self::Written(_) = self {
            return false;
        }
        true
    }

    /// Whether it is a text that acts after all of the library's on the two channels and asks for nothing but these.
    pub fn is_of_the_channels(self) -> bool {
        #[cfg(feature = "written")]
        if let Self::Written(text) = self {
            return text.is_of_the_channels();
        }
        false
    }

    /// Whether it limits or rounds what the drives put out, so that forces are not in proportion to the commands.
    pub fn limits_drives(self) -> bool {
        let d = self.description();
        d.stage == Stage::Actuation && (!d.onsets.is_empty() || self == Self::DriveQuantisation)
    }

    /// Whether a readout effect is added to the angle of the vibration itself, before plates, axes, amplifier and converter.
    pub fn acts_on_angle(self) -> bool {
        self.description().stage == Stage::Readout && self < Self::DetectionCubic
    }

    /// Parameter values at which the effect is absent.
    pub fn neutral<T: Real + crate::Float>(self) -> Values<T> {
        let mut values = [T::zero(); MAX_PARAMETERS];
        for (v, p) in values.iter_mut().zip(self.description().parameters) {
            *v = T::from_f64(p.neutral);
        }
        values
    }
}

impl core::fmt::Display for EffectId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.description().id)
    }
}

// The list. Actuation and readout effects stand in the order in which the signal meets them: the drives' converters, their amplifiers, their
// axes; what is added to the angle of the vibration itself, then plates, axes, amplifier and converter.
library! {
    TableHarmonic => table_harmonic::TableHarmonic,
    RateOffset => rate_offset::RateOffset,
    ScaleDrift => scale_drift::ScaleDrift,
    ScaleTemperature => scale_temperature::ScaleTemperature,
    Anisodamping => anisodamping::Anisodamping,
    AnisodampingTemperature => over_temperature::OverTemperature<anisodamping::Anisodamping>,
    Anisoelasticity => anisoelasticity::Anisoelasticity,
    AnisoelasticityTemperature => over_temperature::OverTemperature<anisoelasticity::Anisoelasticity>,
    SpringCubic => spring_cubic::SpringCubic,
    DriveQuantisation => drive_quantisation::DriveQuantisation,
    DriveSaturation => drive_saturation::DriveSaturation,
    ActuationGainMismatch => actuation_gain_mismatch::ActuationGainMismatch,
    ActuationGainTemperature => over_temperature::OverTemperature<actuation_gain_mismatch::ActuationGainMismatch>,
    ActuationSkew => actuation_skew::ActuationSkew,
    ActuationSkewTemperature => over_temperature::OverTemperature<actuation_skew::ActuationSkew>,
    ActuationPhase => actuation_phase::ActuationPhase,
    HarmonicN => harmonic_n::HarmonicN,
    TimePeriodic => time_periodic::TimePeriodic,
    AngleLatency => angle_latency::AngleLatency,
    DetectionCubic => detection_cubic::DetectionCubic,
    CubicTemperature => over_temperature::OverTemperature<detection_cubic::DetectionCubic>,
    DetectionQuintic => detection_quintic::DetectionQuintic,
    DetectionSkew => detection_skew::DetectionSkew,
    SkewTemperature => over_temperature::OverTemperature<detection_skew::DetectionSkew>,
    DetectionGainMismatch => detection_gain_mismatch::DetectionGainMismatch,
    GainDrift => gain_drift::GainDrift,
    Temperature => over_temperature::OverTemperature<detection_gain_mismatch::DetectionGainMismatch>,
    DetectionPhase => detection_phase::DetectionPhase,
    DriveFeedthrough => drive_feedthrough::DriveFeedthrough,
    DetectionOffset => detection_offset::DetectionOffset,
    DetectionOffsetTemperature => over_temperature::OverTemperature<detection_offset::DetectionOffset>,
    DetectionSaturation => detection_saturation::DetectionSaturation,
}
