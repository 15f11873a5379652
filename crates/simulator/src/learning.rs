//! The calibrator joined to the loop: what it undoes, what it adds to the commands, what it learns, one control sample at a
//! time.
//!
//! It refuses to know the device: it gets what the electronics measured and commanded.

use cvg_calibrator::{Calibrator, Commands, ConfigError, Forward, Health, Settings, State};
use cvg_controller::OrbitCommands;
use cvg_estimator::Direction;
use cvg_model::{AxisForces, Envelope, Pendulum};

/// A calibrator at work in a loop.
#[derive(Clone, Copy, Debug)]
pub struct Learner {
    calibrator: Calibrator<f64>,
    state: State<f64>,
    /// false: it compensates, but learns nothing more and asks for no precession
    pub learning: bool,
    direction: (f64, f64),
    control_s: f64,
    angle_rad: f64,
    explained_rad: f64,
}

impl Learner {
    /// Nothing learned; the settings are those of the electronics that it is joined to.
    ///
    /// # Errors
    /// A setting outside its domain.
    pub fn new(settings: &Settings) -> Result<Self, ConfigError> {
        let calibrator = Calibrator::new(settings)?;
        Ok(Self {
            calibrator,
            state: calibrator.start(),
            learning: true,
            direction: (1.0, 0.0),
            control_s: settings.control_s,
            angle_rad: 0.0,
            explained_rad: 0.0,
        })
    }

    /// The calibrator.
    pub fn calibrator(&self) -> &Calibrator<f64> {
        &self.calibrator
    }

    /// What it has learned.
    pub fn state(&self) -> &State<f64> {
        &self.state
    }

    /// What the pattern has turned, rad.
    pub fn angle_rad(&self) -> f64 {
        self.angle_rad
    }

    /// The same less what is known not to be rotation, rad.
    pub fn rotation_rad(&self) -> f64 {
        self.angle_rad - self.explained_rad
    }

    /// The readout, as far as it is known undone.
    pub(crate) fn readout(&self, e: &Envelope<f64>) -> Envelope<f64> {
        self.calibrator.readout(&self.state, e)
    }

    /// What is added to the commands of the loops, for a pattern of pendulum variables `p` along `major`, either way.
    pub(crate) fn forward(&mut self, p: &Pendulum<f64>, major: &Direction<f64>) -> Forward<f64> {
        let (cos, sin) = self.direction;
        let along = if cos * major.cos + sin * major.sin < 0.0 { -1.0 } else { 1.0 };
        let now = (along * major.cos, along * major.sin);
        self.angle_rad += (cos * now.1 - sin * now.0).atan2(cos * now.0 + sin * now.1);
        self.direction = now;
        let forward = self.calibrator.forward(&self.state, now.0, now.1, p.e.sqrt());
        if self.learning { forward } else { Forward { precession_v: 0.0, ..forward } }
    }

    /// The drives, as far as they are known undone.
    pub(crate) fn drives(&self, f: &AxisForces<f64>) -> AxisForces<f64> {
        self.calibrator.drives(&self.state, f)
    }

    /// A slice of the learning.
    pub(crate) fn step(&mut self, p: &Pendulum<f64>, commands: &OrbitCommands<f64>) {
        let commands = Commands { energy_v: commands.v_as, precession_v: commands.v_qs, quadrature_v: commands.v_qc };
        let rate = self.calibrator.not_rotation(&self.state, p, self.direction, &commands);
        self.explained_rad += rate * self.control_s;
        if self.learning {
            self.calibrator.step(&mut self.state, p, self.direction, &commands, Health::Operating);
        }
    }
}

/// Bins of a full turn, in which the error of a pattern's angle is averaged.
const BINS: usize = 72;

/// How the bias depends on the angle: rms over the angle of what the instrument's rotation is off at a constant rate of
/// `rate_rad_s`, rad, with what was learned so far and nothing more. Measured on a copy of `closed`, over `seconds` after one second
/// of settling; 0 without a calibrator in the loop.
pub fn angle_bias_rad(closed: &crate::ClosedLoop, rate_rad_s: f64, seconds: f64, control_s: f64) -> f64 {
    let mut run = closed.clone();
    run.set_learning(false);
    run.turn_at(rate_rad_s);
    for _ in 0..crate::closed_loop::samples(1.0, control_s) {
        run.step();
    }
    let mut rows = Vec::new();
    for k in 0..crate::closed_loop::samples(seconds, control_s) {
        run.step();
        if let Some(learner) = run.learner() {
            #[allow(clippy::cast_precision_loss, reason = "some thousand samples")]
            rows.push((k as f64 * control_s, learner.angle_rad(), learner.rotation_rad()));
        }
    }
    binned_rms(&rows)
}

/// Rms over the angle of what is left of (time, angle, rotation) without a line over time.
#[allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a bin's number is below BINS, and there are some thousand rows"
)]
fn binned_rms(rows: &[(f64, f64, f64)]) -> f64 {
    let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| rows.iter().map(of).sum::<f64>() / rows.len().max(1) as f64;
    let (t, y) = (mean(&|r| r.0), mean(&|r| r.2));
    let slope = mean(&|r| (r.0 - t) * (r.2 - y)) / mean(&|r| (r.0 - t) * (r.0 - t)).max(f64::MIN_POSITIVE);
    let mut bins = [(0.0, 0.0); BINS];
    for (time, angle, rotation) in rows {
        let at = (angle.rem_euclid(core::f64::consts::TAU) / core::f64::consts::TAU * BINS as f64) as usize;
        if let Some((sum, count)) = bins.get_mut(at) {
            *sum += rotation - y - slope * (time - t);
            *count += 1.0;
        }
    }
    let filled: Vec<f64> = bins.iter().filter(|(_, count)| *count > 0.0).map(|(sum, count)| sum / count).collect();
    let middle = filled.iter().sum::<f64>() / filled.len().max(1) as f64;
    (filled.iter().map(|v| (v - middle).powi(2)).sum::<f64>() / filled.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;

    /// The paper's device, never on a table.
    #[test]
    fn a_device_in_the_simulators_loop_calibrates_itself() {
        let scenario = Scenario::paper();
        let settings = Settings { damping_per_s: 0.05, ..Settings::default() };
        let learner = Learner::new(&settings).expect("settings");
        let mut closed = scenario.closed_loop(0).expect("a gyroscope").with(learner);
        let bias = |closed: &crate::ClosedLoop| angle_bias_rad(closed, 500_f64.to_radians(), 4.0, settings.control_s);
        let before = bias(&closed);
        for second in 0..150 {
            // at rest for 70 s, then turned by hand for ten, then at rest
            closed.turn_at(if (70..80).contains(&second) { 1.0 } else { 0.0 });
            for _ in 0..2000 {
                closed.step();
            }
        }
        let after = bias(&closed);
        assert!(before > 1e-3 && after < before / 10.0, "{before} {after}");
        let ratio = closed.learner().expect("joined").state().correction().detection_ratio();
        assert!((ratio - 0.0132).abs() < 1e-3, "{ratio}");
    }
}
