//! What is known, what isn't, and what is going on.

use cvg_model::Float;

use crate::Calibrator;
use crate::correction::Correction;
use crate::parameters::{Parameter, get};
use crate::state::State;

/// What the calibrator is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// waiting: for loops to settle after a start, a disturbance or a commit
    Settling,
    /// at rest: the pattern is turned by forces
    AtRest,
    /// turned: the input rotation turns the pattern, its energy tells the detection
    Turning,
}

/// What is known of the instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status<T> {
    /// what goes on
    pub mode: Mode,
    /// the coarse stages are over; what is in force is followed from here on
    pub learned: bool,
    /// the ratio and the skew of the detection have been told, by rotation or by the split
    pub detection_known: bool,
    /// rotation tells the detection as it is now: what drifts is followed; at rest it can't be
    pub detection_followed: bool,
    /// standard deviation of the angle-dependent bias that ratio and skew may still make, rad
    pub bias_rad: T,
    /// commits that were taken back
    pub taken_back: u16,
}

/// A value and its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate<T> {
    /// what is believed, in the parameter's unit
    pub value: T,
    /// its standard deviation
    pub sigma: T,
}

/// Seconds for which what rotation told counts as told now.
const FOLLOWED_S: u16 = 20;
/// Below this the ratio and the skew count as known, rad of bias.
const KNOWN_RAD: f64 = 2e-3;

impl<T: Float> Calibrator<T> {
    //= specs/self-calibration.md#not-guessed
    //# A detection that nothing has told MUST be said to be unknown.
    //= specs/self-calibration.md#followed
    //# A gain that moves by 100 ppm a minute MUST be followed while the instrument turns, and at rest the status MUST say that it is not.
    /// What is known, and what goes on.
    pub fn status(&self, state: &State<T>) -> Status<T> {
        let sc = &state.schedule;
        let mode = if sc.settle > 0 {
            Mode::Settling
        } else if sc.moving > 0 {
            Mode::Turning
        } else {
            Mode::AtRest
        };
        let variance = |p: Parameter| state.filter.ud.variance(p as usize) * p.expected::<T>().squared();
        let bias_rad = T::half() * (variance(Parameter::DetectionRatio) + variance(Parameter::DetectionSkew)).sqrt();
        let detection_known = bias_rad < T::from_f64(KNOWN_RAD);
        Status {
            mode,
            learned: sc.stage >= 4,
            detection_known,
            detection_followed: detection_known && sc.untold < self.cycles(FOLLOWED_S),
            bias_rad,
            taken_back: state.taken_back,
        }
    }
}

impl<T: Float> State<T> {
    /// The compensation in force.
    pub fn correction(&self) -> &Correction<T> {
        &self.correction
    }

    /// The virtual precession that is asked for, rad/s.
    pub fn precession_rad_s(&self) -> T {
        self.precession
    }

    /// Ratio, skew or phase of the detection, in force and believed to be left; none of another parameter, whose
    /// intervals would be too narrow: they are in units of the force and in the coordinates of a detection that is
    /// still uncertain.
    pub fn estimate(&self, p: Parameter) -> Option<Estimate<T>> {
        let c = &self.correction;
        let in_force = match p {
            Parameter::DetectionRatio => c.detection_ratio(),
            Parameter::DetectionSkew => c.detection_skew(),
            Parameter::DetectionPhase => c.detection_phase(),
            _ => return None,
        };
        let unit = p.expected::<T>();
        let sigma = self.filter.ud.variance(p as usize).sqrt() * unit;
        Some(Estimate { value: in_force + get(&self.filter.mean, p) * unit, sigma })
    }
}
