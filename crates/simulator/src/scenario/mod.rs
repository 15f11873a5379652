//! A scenario: settings that were checked, and the device and the runs that they make.
//!
//! [`Settings`] is the file; a [`Scenario`] exists only if its settings make sense, so simulating it cannot fail.

mod carrier;
mod check;
mod effect;
mod settings;

use cvg_controller::{ActuationCompensation, Allocation, Pi, RateLoop};
use cvg_estimator::{Compensation, PhaseLock};
use cvg_model::effects::Stage;
use cvg_model::resonator::{Anisotropy, Resonator};

use crate::closed_loop::{ClosedLoop, Course, Design, samples};
use crate::flicker::{Flicker, Wander};
use crate::noise::Noise;
use crate::sensor::Sensor;
use crate::stages::{Setting, Spring, Stages};

pub use effect::EffectSetting;
pub use settings::{
    Instrument, IsotropicSpring, Loops, Profile, Purpose, Reference, Run, Settings, Temperature, Tuning,
};

use core::f64::consts::TAU;

/// Fastest precession that the rate loop holds still, rad/s.
const LARGEST_HELD_RATE_RAD_S: f64 = 50.0;

/// The stream of the first source of what wanders: beyond those of a scenario's white noises.
const FIRST_WANDER: u64 = 1 << 32;

/// Largest correction of the reference frequency that the phase-locked loop makes, rad/s.
const LARGEST_CORRECTION_RAD_S: f64 = 600.0;

/// Settings that make sense, with the device they describe.
#[derive(Clone, Debug)]
pub struct Scenario {
    settings: Settings,
    design: Design,
}

/// Why there is no scenario.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// not TOML, an unknown key, a missing one, or a value of the wrong kind
    #[error("the scenario cannot be read: {0}")]
    Unreadable(#[from] toml::de::Error),
    /// a value that makes no sense
    #[error("{field}: {problem}")]
    Invalid {
        /// which key, with the run's file name where it belongs to a run
        field: String,
        /// what is wrong and what would be right
        problem: String,
    },
}

impl ScenarioError {
    fn invalid(field: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Invalid { field: field.into(), problem: problem.into() }
    }
}

impl Scenario {
    /// The scenario of a TOML text.
    ///
    /// # Errors
    /// Text that cannot be read, or settings that make no sense; the error names the key and says what would be right.
    pub fn parse(text: &str) -> Result<Self, ScenarioError> {
        Self::new(toml::from_str(text)?)
    }

    /// The scenario of these settings.
    ///
    /// # Errors
    /// Settings that make no sense; the error names the key and says what would be right.
    pub fn new(settings: Settings) -> Result<Self, ScenarioError> {
        check::settings(&settings)?;
        let design = design(&settings)?;
        let scenario = Self { settings, design };
        carrier::check(&scenario)?;
        Ok(scenario)
    }

    /// The paper's device under the runs that its method needs: [`PAPER`], the file shipped with this crate.
    #[allow(clippy::missing_panics_doc, reason = "the shipped file is read in a test")]
    pub fn paper() -> Self {
        Self::parse(PAPER).unwrap_or_else(|e| unreachable!("the shipped scenario is valid: {e}"))
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The loop of the run at `index`, warmed up, at t = 0; `None` for a sensor or where there is no such run.
    pub fn closed_loop(&self, index: usize) -> Option<ClosedLoop> {
        let run = self.settings.runs.get(index)?;
        if self.settings.instrument == Instrument::Sensor {
            return None;
        }
        let [mut start, noise, force_noise] = self.noises(index);
        let course = self.course(index, run, start.angle_rad());
        let mut closed = ClosedLoop::new(&self.design, &course, noise, force_noise, self.wander(index));
        closed.warm_up();
        Some(closed)
    }

    /// The sensor of the run at `index`, and its noise; `None` for a gyroscope or where there is no such run.
    pub(crate) fn sensor(&self, index: usize) -> Option<(Sensor, Noise)> {
        let run = self.settings.runs.get(index)?;
        if self.settings.instrument == Instrument::Gyroscope {
            return None;
        }
        let [mut start, noise, _] = self.noises(index);
        let course = self.course(index, run, start.angle_rad());
        let sensor = Sensor {
            stages: self.design.stages.clone(),
            angular_gain: self.settings.angular_gain,
            amplitude_v: course.amplitude_v,
            start_rad: course.start_rad,
            period_s: self.design.period_s,
            noise_v: self.settings.noise_v,
            legs: course.legs,
        };
        Some((sensor, noise))
    }

    /// Control samples between two rows of a recording.
    pub fn control_samples_per_row(&self) -> u64 {
        samples(1.0 / self.settings.sample_hz, self.design.period_s).max(1)
    }

    /// Control samples in a run.
    pub fn control_samples(&self, run: &Run) -> u64 {
        samples(run.duration_s(), self.design.period_s)
    }

    /// What the effects do, stage by stage.
    pub fn stages(&self) -> &Stages {
        &self.design.stages
    }

    /// The start angle's, the readout's and the drives' sources of one run.
    fn noises(&self, index: usize) -> [Noise; 3] {
        let first = 3 * index as u64;
        [first, first + 1, first + 2].map(|stream| Noise::new(self.settings.seed, stream))
    }

    /// What wanders in one run, from sources that no other noise uses.
    fn wander(&self, index: usize) -> Wander {
        let source = |which: u64| Noise::new(self.settings.seed, FIRST_WANDER + 3 * index as u64 + which);
        let flicker = |coefficient, which| Flicker::new(coefficient, source(which), self.design.period_s);
        let gain = |which| flicker(self.settings.gain_flicker, which);
        Wander { gains: gain(0).zip(gain(1)).map(|(x, y)| [x, y]), table: flicker(self.settings.table_wander, 2) }
    }

    fn course(&self, index: usize, run: &Run, random_rad: f64) -> Course {
        let amplitude_v = self.settings.amplitude_v * run.amplitude();
        let warm_up_samples = samples(self.settings.warm_up_s, self.design.period_s);
        let warmer = self.settings.temperature.map(|t| [t.start_of(index) - t.reference_c, t.drift_k_per_s]);
        let warmer = warmer.unwrap_or_default();
        let still = Course {
            legs: vec![(0, 0.0)],
            amplitude_v,
            start_rad: random_rad,
            hold_rad: None,
            energy_off_s: None,
            free: false,
            quadrature: 0.0,
            warm_up_samples,
            warmer,
        };
        match run {
            Run::Rotation { rate_dps, profile, start_deg, .. } => {
                let rate = rate_dps.to_radians();
                let legs = match profile {
                    Profile::Constant => vec![(0, rate)],
                    Profile::ThereAndBack => vec![(0, rate), (self.control_samples(run) / 2, -rate)],
                };
                Course { legs, start_rad: start_deg.map_or(random_rad, f64::to_radians), ..still }
            }
            Run::Decay { rate_dps, start_deg, quadrature, .. } => Course {
                legs: vec![(0, rate_dps.to_radians())],
                start_rad: start_deg.to_radians(),
                free: true,
                quadrature: *quadrature,
                // nothing settles in what is not driven
                warm_up_samples: 0,
                ..still
            },
            Run::Virtual { .. } => still,
            Run::Ringdown { angle_deg, energy_off_s, .. } => Course {
                start_rad: angle_deg.to_radians(),
                hold_rad: Some(angle_deg.to_radians()),
                energy_off_s: Some(*energy_off_s),
                ..still
            },
        }
    }
}

/// The shipped scenario of the paper's device.
pub const PAPER: &str = include_str!("../../scenarios/paper.toml");

/// The shipped scenario of a Hall sensor pair on a ring of 25 pole pairs.
pub const SENSOR: &str = include_str!("../../scenarios/sensor.toml");

/// The isotropic nonlinear spring, if there is one.
pub(crate) fn spring(s: &Settings) -> Option<Spring> {
    s.spring_isotropic.map(|spring| Spring { precession: spring.c, frequency: spring.frequency_per_energy() })
}

/// The device and its electronics, by the tuning rules of the controllers.
fn design(s: &Settings) -> Result<Design, ScenarioError> {
    let period_s = 1.0 / s.control_hz;
    let pairs = |list: &[EffectSetting]| list.iter().map(|e| (e.id, e.values)).collect::<Vec<Setting>>();
    let on = |stage: Stage| {
        let all = pairs(&s.compensation);
        all.into_iter().filter(|(id, _)| id.description().stage == stage).collect::<Vec<_>>()
    };
    let (readout, actuation) = (on(Stage::Readout), on(Stage::Actuation));
    let controller = |tuning: &Tuning, name: &str| {
        Pi::tuned(TAU * tuning.bandwidth_hz, tuning.damping, s.amplitude_v, s.drive_per_s_v, period_s, s.limit_v)
            .map_err(|e| ScenarioError::invalid(format!("loops.{name}"), e.to_string()))
    };
    let loop_error = |name: &'static str| move |e: String| ScenarioError::invalid(format!("loops.{name}"), e);
    Ok(Design {
        resonator: Resonator {
            omega_rad_s: TAU * s.carrier_hz.unwrap_or(0.0),
            angular_gain: s.angular_gain,
            centrifugal_gain: 0.0,
            damping_per_s: 1.0 / s.tau_s,
            anisodamping: Anisotropy::none(),
            anisoelasticity: Anisotropy::none(),
        },
        stages: Stages { spring: spring(s), ..Stages::new(&pairs(&s.effects)) },
        ahead_rad_s: TAU * s.detuning_hz,
        drive_per_s_v: s.drive_per_s_v,
        period_s,
        energy: controller(&s.loops.energy, "energy")?,
        quadrature: controller(&s.loops.quadrature, "quadrature")?,
        phase: PhaseLock::new(
            TAU * s.loops.phase.bandwidth_hz,
            s.loops.phase.damping,
            period_s,
            LARGEST_CORRECTION_RAD_S.min(0.5 / period_s),
        )
        .map_err(|e| e.to_string())
        .map_err(loop_error("phase"))?,
        rate: RateLoop::tuned(
            TAU * s.loops.rate.bandwidth_hz,
            s.loops.rate.damping,
            s.drive_per_s_v,
            LARGEST_HELD_RATE_RAD_S,
            period_s,
            s.limit_v,
        )
        .map_err(|e| e.to_string())
        .map_err(loop_error("rate"))?,
        allocation: (if actuation.is_empty() { Ok(None) } else { ActuationCompensation::new(&actuation).map(Some) })
            .and_then(|inverse| Allocation::new(inverse, s.limit_v))
            .map_err(|e| ScenarioError::invalid("compensation", e.to_string()))?,
        readout_compensation: if readout.is_empty() {
            None
        } else {
            let inverse = Compensation::new(&readout);
            Some(inverse.map_err(|e| ScenarioError::invalid("compensation", e.to_string()))?)
        },
        noise_v: s.noise_v,
        force_noise_v: s.force_noise_v,
    })
}
