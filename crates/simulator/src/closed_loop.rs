//! The whole-angle loop at envelope level: plant, readout, estimator, controllers, drives, one control sample at a time.
//!
//! Order of a sample, as in real electronics: the readout of the envelope at t_k is measured, the commands computed
//! from it are applied from t_k on and held until t_{k+1}. The oscillator runs at its nominal frequency between
//! samples; the phase-locked loop's correction turns the reference evenly between them.
//!
//! It refuses to record: [`ClosedLoop::seen`] is what the electronics know at a sample; who wants a recording keeps it.

use cvg_controller::{Allocation, Heading, OrbitCommands, Pi, PiState, RateLoop};
use cvg_estimator::oscillator::{LockState, PhaseLock};
use cvg_estimator::{Compensation, direction};
use cvg_model::effects::Moment;
use cvg_model::resonator::Resonator;
use cvg_model::{AxisForces, Envelope, Orbit};

use crate::flicker::Wander;
use crate::learning::Learner;
use crate::noise::Noise;
use crate::plant::{Plant, reference_ahead};
use crate::stages::Stages;

/// The most readout effects that the loop compensates.
pub const MOST_COMPENSATED: usize = 8;

/// A device with its electronics: what all runs share.
#[derive(Clone, Debug)]
pub struct Design {
    /// the mechanics without effects
    pub resonator: Resonator<f64>,
    /// what is wrong with the device and its bench
    pub stages: Stages,
    /// ω − ω_r of the uncorrected reference, rad/s
    pub ahead_rad_s: f64,
    /// G_A/2ω, 1/s per V
    pub drive_per_s_v: f64,
    /// control period, s
    pub period_s: f64,
    /// energy controller
    pub energy: Pi<f64>,
    /// quadrature controller
    pub quadrature: Pi<f64>,
    /// phase-locked loop
    pub phase: PhaseLock<f64>,
    /// rate loop, in use in ring-downs
    pub rate: RateLoop<f64>,
    /// projection on the drives, with what the electronics undo of them
    pub allocation: Allocation<f64>,
    /// what the electronics undo of the readout
    pub readout_compensation: Option<Compensation<f64, MOST_COMPENSATED>>,
    /// noise of the readout, V rms per channel and control sample
    pub noise_v: f64,
    /// noise of the drives, V rms per channel and control sample
    pub force_noise_v: f64,
}

/// What is done with the device in one run.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    /// commanded rates: from which control sample on (the first from 0), rad/s
    pub legs: Vec<(u64, f64)>,
    /// set amplitude, V
    pub amplitude_v: f64,
    /// the pattern's angle at the start, rad
    pub start_rad: f64,
    /// the pattern is held at this angle by the rate loop, rad
    pub hold_rad: Option<f64>,
    /// the energy loop is off from this time on, s
    pub energy_off_s: Option<f64>,
    /// no loop is closed and no force applied: the vibration rings freely
    pub free: bool,
    /// minor over major axis of the orbit at the start; signed
    pub quadrature: f64,
    /// the loops run this many control samples before t = 0
    pub warm_up_samples: u64,
    /// temperature at t = 0 over the one that parameters refer to, K, and its drift, K/s
    pub warmer: [f64; 2],
}

/// What the electronics know at one control sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// time of the recording, s
    pub t_s: f64,
    /// the readout, as it came
    pub readout: Envelope<f64>,
    /// the readout after the electronics' compensation, if they have one
    pub compensated: Envelope<f64>,
    /// energy controller's command, applied from this sample on, V
    pub v_as: f64,
    /// quadrature controller's command, likewise, V
    pub v_qc: f64,
    /// rate loop's command, likewise, V; 0 where the pattern is free
    pub v_qs: f64,
    /// correction of the reference frequency, rad/s
    pub correction_rad_s: f64,
}

#[derive(Clone, Debug)]
struct Leg {
    from: u64,
    rate_rad_s: f64,
    plant: Plant,
}

/// The loop of one run.
#[derive(Clone, Debug)]
pub struct ClosedLoop {
    design: Design,
    leg: Leg,
    later_legs: Vec<Leg>,
    next_leg_at: u64,
    hold: Option<Heading<f64>>,
    free: bool,
    energy_set_v2: f64,
    energy_off_at: u64,
    warm_up_samples: u64,
    warmer: [f64; 2],
    rate_is_nominal: bool,
    reads_plainly: bool,
    noise: Option<Noise>,
    force_noise: Option<Noise>,
    wander: Wander,
    learner: Option<Learner>,
    /// command that precesses the pattern, V
    precessing_v: f64,
    // state
    sample: u64,
    /// samples since t = 0
    tick: i64,
    table_rad: f64,
    vibration: Envelope<f64>,
    /// what the drives were commanded to with the last sample, V
    drive: AxisForces<f64>,
    energy_state: PiState<f64>,
    quadrature_state: PiState<f64>,
    rate_state: PiState<f64>,
    lock_state: LockState<f64>,
    seen: Seen,
}

impl ClosedLoop {
    /// The loop at the start of `course`, with its own `noise` and `force_noise`, and with what wanders in it.
    ///
    /// The vibration starts at its set amplitude, the energy controller with the command that holds it there in a
    /// perfect device, v_as = −a/(τb); everything else settles by itself.
    pub fn new(design: &Design, course: &Course, noise: Noise, force_noise: Noise, wander: Wander) -> Self {
        let mut legs: Vec<Leg> = course
            .legs
            .iter()
            .rev()
            .map(|&(from, rate_rad_s)| Leg {
                from: if from == 0 { 0 } else { from + course.warm_up_samples },
                rate_rad_s,
                plant: Plant::new(
                    &design.resonator,
                    &design.stages,
                    rate_rad_s,
                    design.ahead_rad_s,
                    design.drive_per_s_v,
                    design.period_s,
                ),
            })
            .collect();
        let still = || Leg {
            from: 0,
            rate_rad_s: 0.0,
            plant: Plant::new(
                &design.resonator,
                &design.stages,
                0.0,
                design.ahead_rad_s,
                design.drive_per_s_v,
                design.period_s,
            ),
        };
        let leg = legs.pop().unwrap_or_else(still);
        let a = course.amplitude_v;
        let vibration = Orbit { a, q: a * course.quadrature, theta: course.start_rad, delta: 0.0 }.envelope();
        let hold_command = -a * design.resonator.damping_per_s / design.drive_per_s_v;
        let rest = Seen {
            t_s: 0.0,
            readout: vibration,
            compensated: vibration,
            v_as: 0.0,
            v_qc: 0.0,
            v_qs: 0.0,
            correction_rad_s: 0.0,
        };
        Self {
            next_leg_at: legs.last().map_or(u64::MAX, |l| l.from),
            leg,
            later_legs: legs,
            hold: course.hold_rad.and_then(|angle| Heading::new(angle).ok()),
            free: course.free,
            energy_set_v2: a * a,
            energy_off_at: course
                .energy_off_s
                .map_or(u64::MAX, |off| samples(off, design.period_s).saturating_add(course.warm_up_samples)),
            warm_up_samples: course.warm_up_samples,
            warmer: course.warmer,
            rate_is_nominal: design.stages.rate_is_nominal(),
            reads_plainly: design.stages.readout.is_empty()
                && design.readout_compensation.is_none()
                && design.noise_v == 0.0
                && wander.gains.is_none(),
            noise: (design.noise_v > 0.0).then_some(noise),
            force_noise: (design.force_noise_v > 0.0 && !course.free).then_some(force_noise),
            wander,
            learner: None,
            precessing_v: 0.0,
            sample: 0,
            tick: 0_i64.saturating_sub_unsigned(course.warm_up_samples),
            table_rad: 0.0,
            vibration,
            drive: AxisForces::default(),
            energy_state: design.energy.primed(hold_command),
            quadrature_state: PiState::default(),
            rate_state: PiState::default(),
            lock_state: LockState::default(),
            seen: rest,
            design: design.clone(),
        }
    }

    /// The same loop with a calibrator in it.
    #[must_use]
    pub fn with(self, learner: Learner) -> Self {
        Self { learner: Some(learner), ..self }
    }

    /// The calibrator in it, if there is one.
    pub fn learner(&self) -> Option<&Learner> {
        self.learner.as_ref()
    }

    /// The calibrator learns on, or holds what it has.
    pub fn set_learning(&mut self, learning: bool) {
        if let Some(learner) = &mut self.learner {
            learner.learning = learning;
        }
    }

    /// The electronics precess the pattern by a force of this size from the next sample on, rad/s at the set amplitude.
    pub fn precess_at(&mut self, rate_rad_s: f64) {
        self.precessing_v = -rate_rad_s * self.energy_set_v2.sqrt() / self.design.drive_per_s_v;
    }

    /// The table turns at another rate from the next sample on, rad/s.
    pub fn turn_at(&mut self, rate_rad_s: f64) {
        let d = &self.design;
        let plant = Plant::new(&d.resonator, &d.stages, rate_rad_s, d.ahead_rad_s, d.drive_per_s_v, d.period_s);
        self.leg = Leg { from: self.sample, rate_rad_s, plant };
    }

    /// What the electronics knew at the sample of the last [`step`](Self::step).
    pub fn seen(&self) -> &Seen {
        &self.seen
    }

    /// The true envelope, now: after the last step, before the next.
    pub fn vibration(&self) -> &Envelope<f64> {
        &self.vibration
    }

    /// The true table angle, now, rad; 0 at t = 0.
    pub fn table_rad(&self) -> f64 {
        self.table_rad
    }

    /// The commanded rate of the last step, rad/s.
    pub fn rate_rad_s(&self) -> f64 {
        self.leg.rate_rad_s
    }

    /// One control sample: readout, estimator, controllers, drives, and the envelope to the next sample.
    #[inline]
    pub fn step(&mut self) {
        if self.sample >= self.next_leg_at {
            self.turn_to_next_leg();
        }
        let at = self.moment();
        let drive = self.electronics(&at);
        self.advance(&at, &drive);
        self.drive = drive;
        self.sample += 1;
        self.tick += 1;
    }

    /// Measures, controls and allocates: the drives' commands from this sample on.
    #[inline]
    fn electronics(&mut self, at: &Moment<f64>) -> AxisForces<f64> {
        let (readout, compensated) = if self.reads_plainly {
            (self.vibration, self.vibration)
        } else {
            // taken apart and put together again: the plain readout then stays in registers
            let [r, c] = self.imperfect_readout(at);
            (Envelope::new(r.x_c, r.x_s, r.y_c, r.y_s), Envelope::new(c.x_c, c.x_s, c.y_c, c.y_s))
        };
        if self.free {
            self.seen =
                Seen { t_s: at.t_s, readout, compensated, v_as: 0.0, v_qc: 0.0, v_qs: 0.0, correction_rad_s: 0.0 };
            return AxisForces::default();
        }
        let compensated = self.learner.as_ref().map_or(compensated, |l| l.readout(&compensated));
        let pendulum = compensated.pendulum();
        let major = direction::major_axis(&compensated, &pendulum);
        let v_as = if self.sample < self.energy_off_at {
            self.design.energy.energy(&mut self.energy_state, pendulum.e, self.energy_set_v2).volts
        } else {
            0.0
        };
        let v_qc = self.design.quadrature.quadrature(&mut self.quadrature_state, pendulum.q).volts;
        let v_qs = match &self.hold {
            Some(target) => self.design.rate.step(&mut self.rate_state, &pendulum, target).volts,
            None => self.precessing_v,
        };
        let correction_rad_s = self.design.phase.step(&mut self.lock_state, &pendulum).rad_s;
        let mut commands = OrbitCommands { v_as, v_qs, v_qc, v_ac: 0.0 };
        let mut correction_rad_s = correction_rad_s;
        if let Some(learner) = &mut self.learner {
            let forward = learner.forward(&pendulum, &major);
            commands.v_qs += forward.precession_v;
            commands.v_qc += forward.quadrature_v;
            correction_rad_s += forward.detuning_rad_s;
            learner.step(&pendulum, &commands);
        }
        let OrbitCommands { v_qs, v_qc, .. } = commands;
        self.seen = Seen { t_s: at.t_s, readout, compensated, v_as, v_qc, v_qs, correction_rad_s };
        let volts = self.design.allocation.step(&commands, major.cos, major.sin).volts;
        self.learner.as_ref().map_or(volts, |l| l.drives(&volts))
    }

    /// The readout with its effects and its noise, and what the electronics' compensation makes of it.
    #[inline(never)]
    fn imperfect_readout(&mut self, at: &Moment<f64>) -> [Envelope<f64>; 2] {
        let mut readout = self.design.stages.read(self.vibration, at);
        if let Some([x, y]) = &mut self.wander.gains {
            let (x, y) = (1.0 + x.step(), 1.0 + y.step());
            readout = Envelope::new(x * readout.x_c, x * readout.x_s, y * readout.y_c, y * readout.y_s);
        }
        if let Some(noise) = &mut self.noise {
            readout = readout + noise.envelope(self.design.noise_v);
        }
        let compensated = match &self.design.readout_compensation {
            Some(compensation) => compensation.apply(readout, at),
            None => readout,
        };
        [readout, compensated]
    }

    /// The drives' commands with their noise.
    #[inline(never)]
    fn noisy(&mut self, [x_c, x_s, y_c, y_s]: [f64; 4]) -> [f64; 4] {
        let n = match &mut self.force_noise {
            Some(noise) => noise.forces(self.design.force_noise_v),
            None => AxisForces::default(),
        };
        [x_c + n.x_c, x_s + n.x_s, y_c + n.y_c, y_s + n.y_s]
    }

    /// What drives that saturate or follow the temperature put out.
    #[inline(never)]
    fn limited(&self, drive: AxisForces<f64>, at: &Moment<f64>) -> AxisForces<f64> {
        self.design.stages.limited(drive, at)
    }

    /// The mechanics to the next sample, and the reference phase with it.
    #[inline]
    fn advance(&mut self, at: &Moment<f64>, drive: &AxisForces<f64>) {
        let period = self.design.period_s;
        let nominal = self.leg.rate_rad_s;
        let drive = if self.force_noise.is_some() {
            let [x_c, x_s, y_c, y_s] = self.noisy([drive.x_c, drive.x_s, drive.y_c, drive.y_s]);
            AxisForces { x_c, x_s, y_c, y_s }
        } else {
            *drive
        };
        let drive = if self.design.stages.limiting.is_empty() { drive } else { self.limited(drive, at) };
        let (table, input) = if self.rate_is_nominal {
            (nominal, nominal)
        } else {
            let middle = Moment { t_s: at.t_s + 0.5 * period, table_rad: at.table_rad + 0.5 * period * nominal, ..*at };
            self.design.stages.rates(nominal, &middle)
        };
        let wandered = match &mut self.wander.table {
            Some(table_rate) => nominal * table_rate.step(),
            None => 0.0,
        };
        let (table, input) = (table + wandered, input + wandered);
        // The reference runs ahead evenly over the period: e^{−iψ/2} before and after the mechanics, which is e^{−iψ} after
        // them with the drives turned by e^{iψ/2}.
        let psi = self.seen.correction_rad_s * period;
        let turned = reference_ahead(&Envelope::new(drive.x_c, drive.x_s, drive.y_c, drive.y_s), -0.5 * psi);
        let drive = AxisForces { x_c: turned.x_c, x_s: turned.x_s, y_c: turned.y_c, y_s: turned.y_s };
        let moved = self.leg.plant.step(&self.vibration, &drive, input - nominal, at);
        self.vibration = reference_ahead(&moved, psi);
        self.table_rad += table * period;
    }

    /// The instant of the current sample.
    #[inline]
    fn moment(&self) -> Moment<f64> {
        #[allow(clippy::cast_precision_loss, reason = "2^53 samples are not reached")]
        let t_s = self.tick as f64 * self.design.period_s;
        Moment {
            t_s,
            table_rad: self.table_rad,
            precession_rad_s: -self.design.resonator.angular_gain * self.leg.rate_rad_s,
            warmer_k: self.warmer[0] + self.warmer[1] * t_s,
            drive: self.drive,
        }
    }

    #[cold]
    fn turn_to_next_leg(&mut self) {
        if let Some(leg) = self.later_legs.pop() {
            self.leg = leg;
        }
        self.next_leg_at = self.later_legs.last().map_or(u64::MAX, |l| l.from);
    }

    /// Runs the warm-up before t = 0, if there is one, and sets the table to 0 at its end.
    pub fn warm_up(&mut self) {
        // the angle at which the table has to start in order to be at 0 at t = 0, its ripple aside
        #[allow(clippy::cast_precision_loss, reason = "2^53 samples are not reached")]
        let turned = self.leg.rate_rad_s * self.warm_up_samples as f64 * self.design.period_s;
        self.table_rad = -turned;
        while self.sample < self.warm_up_samples {
            self.step();
        }
        self.table_rad = 0.0;
    }
}

/// Control samples in `duration_s`, to the nearest.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "durations are validated to be finite, not negative and of fewer than 2^53 samples"
)]
pub fn samples(duration_s: f64, period_s: f64) -> u64 {
    (duration_s / period_s).round() as u64
}
