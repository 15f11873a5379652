//! The parts of an instrument, made of its settings, and its step without short ways.

use core::f64::consts::{FRAC_PI_4, PI, SQRT_2, TAU};

use cvg_controller::supervisor::{Beat as Heard, LoopCommand, Observation};
use cvg_controller::{
    ActuationCompensation, Allocation, Heading, Mode, OrbitCommands, Pi, PiState, RateLoop, Supervisor,
    SupervisorSettings,
};
use cvg_estimator::beat::phase_ahead;
use cvg_estimator::direction::major_axis_of;
use cvg_estimator::{
    Beat, Compensation, Demodulator, LockState, Movement, Oscillator, PhaseLock, Precession, Status as Measured, Window,
};
use cvg_instrument::{MOST_COMPENSATED, Seen, Settings, State, Status, Tuning};
use cvg_model::effects::{EffectId, Moment, Values};
use cvg_model::{AxisForces, Envelope, Float, Pendulum, Real};

pub(super) struct Parts<T> {
    oscillator: Oscillator<T>,
    demodulator: Demodulator<T>,
    phase: PhaseLock<T>,
    precession: Precession<T>,
    readout: Option<Compensation<T, MOST_COMPENSATED>>,
    energy: Pi<T>,
    quadrature: Pi<T>,
    rate: RateLoop<T>,
    allocation: Allocation<T>,
    supervisor: Supervisor<T>,
    heading: Heading<T>,
    most_unseen: u32,
    set_v2: T,
    drive_v: T,
    output_v: T,
    /// cosine and sine of the carrier's phase in the delay
    delay: (T, T),
    delay_s: T,
    window_s: f64,
}

fn told<T: Float>(effects: &[(EffectId, Values<f64>)]) -> Vec<(EffectId, Values<T>)> {
    effects.iter().map(|(id, values)| (*id, values.map(T::from_f64))).collect()
}

impl<T: Float> Parts<T> {
    pub(super) fn of(s: &Settings<'_>) -> Self {
        let t = T::from_f64;
        let window_s = f64::from(s.window) / s.sample_hz;
        let sample_s = 1.0 / s.sample_hz;
        let omega = TAU * s.carrier_hz;
        let (band, reach) = (omega * s.band, 1.1 * (omega * s.band));
        // the converter's hold takes sin x/x of the drive
        let x = PI * s.carrier_hz / s.sample_hz;
        let drive = s.drive_per_s_v * Real::sin_cos(x).0 / x;
        let limit = s.dac_limit_v / SQRT_2;
        let speed = |tuning: Tuning| t(TAU * tuning.bandwidth_hz);
        let pi = |w: Tuning| {
            Pi::tuned(speed(w), t(w.damping), t(s.amplitude_v), t(drive), t(window_s), t(limit)).expect("a loop")
        };
        let age_s = 0.5 * (f64::from(s.window) - 1.0) / s.sample_hz + s.readout_delay_s;
        let late_s = s.readout_delay_s + s.drive_delay_s + 0.5 * sample_s;
        let (late_sin, late_cos) = Real::sin_cos(omega * late_s);
        let supervisor = SupervisorSettings {
            window_s,
            amplitude_v: s.amplitude_v,
            detection_threshold_v: s.detection_threshold_v,
            band_rad_s: band,
            sweep_s: s.sweep_s,
            sweeps: 3,
            listen_s: 32.0 * window_s,
            lock_s: 1.0,
            spin_up_s: 5.0,
            coast_s: 0.1,
            fault_debounce_s: 0.3,
            rest_s: 0.5,
            retries: 3,
            fault_memory_s: 10.0,
        };
        let rate = s.rate;
        Self {
            oscillator: Oscillator::new(s.carrier_hz, sample_s, reach).expect("an oscillator"),
            demodulator: Demodulator::new(s.window, s.adc_full_scale_v).expect("a demodulator"),
            phase: PhaseLock::new(speed(s.phase), t(s.phase.damping), t(window_s), t(reach)).expect("a loop"),
            precession: Precession::new(
                window_s,
                16.0 * window_s,
                s.fastest_rad_s,
                0.1,
                age_s + s.drive_delay_s + 0.5 * window_s,
                0.2 * s.detection_threshold_v,
            )
            .expect("a tracker"),
            readout: (!s.readout.is_empty()).then(|| Compensation::new(&told(s.readout)).expect("an inverse")),
            energy: pi(s.energy),
            quadrature: pi(s.quadrature),
            rate: RateLoop::tuned(
                speed(rate),
                t(rate.damping),
                t(drive),
                t(drive * limit / s.amplitude_v),
                t(window_s),
                t(limit),
            )
            .expect("a loop"),
            allocation: Allocation::new(
                (!s.actuation.is_empty()).then(|| ActuationCompensation::new(&told(s.actuation)).expect("regular")),
                t(limit),
            )
            .expect("a limit"),
            supervisor: Supervisor::new(&supervisor).expect("times"),
            heading: Heading::new(t(s.hold_rad)).expect("finite"),
            most_unseen: (FRAC_PI_4 / (s.fastest_rad_s * window_s)).floor() as u32,
            set_v2: t(s.amplitude_v * s.amplitude_v),
            drive_v: t(limit),
            output_v: t(s.dac_limit_v),
            delay: (t(late_cos), t(late_sin)),
            delay_s: t(late_s),
            window_s,
        }
    }

    /// The parts with all that they were made of, as an instrument shows its own.
    pub(super) fn shown(&self) -> [String; 12] {
        [
            format!("oscillator: {:?}", self.oscillator),
            format!("demodulator: {:?}", self.demodulator),
            format!("phase: {:?}", self.phase),
            format!("precession: {:?}", self.precession),
            format!("readout: {:?}", self.readout),
            format!("energy: {:?}", self.energy),
            format!("quadrature: {:?}", self.quadrature),
            format!("rate: {:?}", self.rate),
            format!("allocation: {:?}", self.allocation),
            format!("supervisor: {:?}", self.supervisor),
            format!("hold: {:?}", self.heading),
            format!("most_unseen: {}", self.most_unseen),
        ]
    }

    /// A sample: what is measured until now acts from the next window on.
    pub(super) fn step(&self, s: &mut State<T>, x: T, y: T) -> (T, T, Status) {
        let now = s.phasor;
        let full = self.demodulator.accumulate(&mut s.window, x, y, &now);
        s.phasor = now.advanced();
        if full {
            self.control(s);
        }
        let put_out = |c: T, q: T| (c * now.cos + q * now.sin).bounded(self.output_v);
        let d = s.drive;
        (put_out(d.x_c, d.x_s), put_out(d.y_c, d.y_s), Status { fresh: full, ..s.status })
    }

    fn control(&self, s: &mut State<T>) {
        let measured = self.demodulator.finish(&s.window, &s.phasor);
        let (now, last) = (measured.fingerprint, s.fingerprint);
        // a channel's sum and last sample, again
        let repeats = [0, 1].iter().any(|&k| now[k] == last[k] && now[k + 2] == last[k + 2] && now[k + 2] != T::zero());
        let clipped = measured.clipped > 0;
        let mut valid = measured.status == Measured::Valid;
        let rate = self.precession.rate_rad_s(&s.precession);
        let zero = T::zero();
        // what the drives were made of, at the correction of then
        let drive = self.delayed(&s.drive, s.seen.correction_rad_s);
        let at = Moment { t_s: zero, table_rad: zero, precession_rad_s: rate, warmer_k: zero, drive };
        s.fingerprint = now;
        s.seen.readout = measured.envelope;
        s.seen.compensated = match &self.readout {
            Some(inverse) if valid => inverse.apply(measured.envelope, &at),
            _ => measured.envelope,
        };
        let (e, p) = (s.seen.compensated, s.seen.compensated.pendulum());
        valid = valid && p.e.is_finite();
        let (was_directed, was) = (s.precession.is_directed(), s.supervisor.mode);
        let moved = if valid { self.precession.step(&mut s.precession, &p) } else { Movement::Unknown };
        let jumped = moved == Movement::Jumped;
        if was == Mode::Listen && valid {
            s.beat.add(&e);
        }
        let (x2, y2) = s.beat.powers();
        let heard = Heard { x2, y2, windows: s.beat.windows() as i32 };
        let observation = Observation { pendulum: p, valid, clipped, repeats, jumped };
        let command = self.supervisor.step(&mut s.supervisor, &observation, (was == Mode::Listen).then_some(heard));
        self.apply(s, command, &e, &p);
        s.windows = s.windows.wrapping_add(1);
        s.phasor = self.oscillator.tune(&s.phasor, s.seen.correction_rad_s);
        s.window = Window::begin(&s.phasor);

        let operates = |mode| matches!(mode, Mode::WholeAngle | Mode::Hold | Mode::RingDown);
        let mode = s.supervisor.mode;
        let c = &mut s.continuity;
        c.unseen = if valid && !clipped && !repeats { 0 } else { c.unseen.saturating_add(1) };
        let interrupted = valid && was_directed && moved == Movement::Unknown;
        let off = valid && operates(was) && !Supervisor::in_phase(&p);
        let doubtful = jumped || interrupted || off || mode == Mode::Fault || c.unseen > self.most_unseen;
        c.lost |= c.counting && doubtful;
        c.counting |= operates(mode);
        let fault = if mode == Mode::Fault { s.supervisor.fault } else { None };
        s.status = Status { mode, fault, fresh: false, clipped, valid, half_turns_lost: c.lost };
    }

    fn apply(&self, s: &mut State<T>, command: LoopCommand<T>, e: &Envelope<T>, p: &Pendulum<T>) {
        let zero = T::zero();
        let [mut v_as, mut v_qc, mut v_qs] = [zero; 3];
        let mut forces = AxisForces { x_c: zero, x_s: zero, y_c: zero, y_s: zero };
        let limit = self.oscillator.limit_rad_s();
        let mut rad_s = s.lock.detuning_rad_s.bounded(limit);
        match command {
            LoopCommand::Rest | LoopCommand::Listen => {}
            LoopCommand::Sweep { correction_rad_s, opposed } => {
                rad_s = correction_rad_s;
                (forces.x_s, forces.y_s) = (self.drive_v, if opposed { -self.drive_v } else { self.drive_v });
            }
            LoopCommand::Tune => {
                let per_s = s.beat.radians_per_window() * T::from_f64(1.0 / self.window_s);
                rad_s = (rad_s + per_s).bounded(limit);
                forget(s);
                s.lock.detuning_rad_s = rad_s;
            }
            LoopCommand::Snap => {
                let (cos, sin) = phase_ahead(e);
                s.phasor = s.phasor.turned(cos, sin);
            }
            LoopCommand::Lock => rad_s = self.phase.step(&mut s.lock, p).rad_s,
            LoopCommand::Run { hold, ring_down } => {
                if !ring_down {
                    v_as = self.energy.energy(&mut s.energy, p.e, self.set_v2).volts;
                }
                v_qc = self.quadrature.quadrature(&mut s.quadrature, p.q).volts;
                if hold {
                    v_qs = self.rate.step(&mut s.rate, p, &self.heading).volts;
                }
                rad_s = self.phase.step(&mut s.lock, p).rad_s;
                let now = major_axis_of(e, s.precession.cos_2, s.precession.sin_2);
                let then = self.precession.ahead(&s.precession, &now);
                let commands = OrbitCommands { v_as, v_qs, v_qc, v_ac: zero };
                forces = self.allocation.step(&commands, then.cos, then.sin).volts;
            }
        }
        if !matches!(command, LoopCommand::Run { .. }) {
            if s.supervisor.mode != Mode::Listen {
                s.beat = Beat::default();
            }
            if matches!(s.supervisor.mode, Mode::Sweep | Mode::Fault) {
                forget(s);
            }
        }
        s.drive = self.undelayed(&forces, rad_s);
        s.seen = Seen { v_as, v_qc, v_qs, correction_rad_s: rad_s, ..s.seen };
    }

    /// Cosine and sine of the phase that passes until the output acts.
    fn passes(&self, rad_s: T) -> (T, T) {
        let more = rad_s * self.delay_s;
        let (cos_0, sin_0) = self.delay;
        (cos_0 - sin_0 * more, sin_0 + cos_0 * more)
    }

    /// Turned back by the phase that passes until the output acts, and divided by what that lengthens.
    fn delayed(&self, f: &AxisForces<T>, rad_s: T) -> AxisForces<T> {
        let (cos, sin) = self.passes(rad_s);
        let by = cos * cos + sin * sin;
        let back = |c: T, s: T| ((c * cos - s * sin) / by, (s * cos + c * sin) / by);
        let ((x_c, x_s), (y_c, y_s)) = (back(f.x_c, f.x_s), back(f.y_c, f.y_s));
        AxisForces { x_c, x_s, y_c, y_s }
    }

    /// Turned ahead by the phase that passes until the output acts.
    fn undelayed(&self, f: &AxisForces<T>, rad_s: T) -> AxisForces<T> {
        let (cos, sin) = self.passes(rad_s);
        let ahead = |c: T, s: T| (c * cos + s * sin, s * cos - c * sin);
        let ((x_c, x_s), (y_c, y_s)) = (ahead(f.x_c, f.x_s), ahead(f.y_c, f.y_s));
        AxisForces { x_c, x_s, y_c, y_s }
    }
}

/// Loops begin anew.
fn forget<T: Float>(s: &mut State<T>) {
    (s.energy, s.quadrature, s.rate) = (PiState::default(), PiState::default(), PiState::default());
    s.lock = LockState::default();
}
