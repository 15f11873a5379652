//! The step: a sample, and every N samples the control step.

use cvg_controller::supervisor::{self, LoopCommand, Observation};
use cvg_controller::{Mode, OrbitCommands, PiState, Supervisor, SupervisorState};
use cvg_estimator::beat::phase_ahead;
use cvg_estimator::direction::major_axis_of;
use cvg_estimator::{Beat, Compensation, LockState, Movement, PrecessionState, Status as Measured, Window};
use cvg_model::effects::Moment;
use cvg_model::{AxisForces, ControlOutputs, Envelope, Float, Pendulum};

use crate::continuity::{Continuity, Sight};
use crate::correction::ordered;
use crate::drives::put_out;
use crate::{Instrument, MOST_COMPENSATED, Seen, State, Status};

#[cfg(test)]
mod tests;

impl<T: Float> Instrument<T> {
    /// The state at power-on: at rest, or after a brown-out with the resonator still vibrating; it finds out.
    pub fn start(&self) -> State<T> {
        let phasor = self.oscillator.start();
        State {
            phasor,
            window: Window::begin(&phasor),
            drive: AxisForces { x_c: T::zero(), x_s: T::zero(), y_c: T::zero(), y_s: T::zero() },
            seen: Seen::default(),
            energy: PiState::default(),
            quadrature: PiState::default(),
            rate: PiState::default(),
            lock: LockState::default(),
            precession: PrecessionState::default(),
            beat: Beat::default(),
            fingerprint: [T::zero(); 4],
            supervisor: SupervisorState::default(),
            continuity: Continuity::default(),
            windows: 0,
            status: Status::default(),
        }
    }

    //= specs/dsp.md#bounded-commands
    //# Every output of the instrument MUST be finite and within the converter's limit for every input and every state.
    //= specs/dsp.md#whole-step
    //# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
    /// One sample: what the converters read, V, against what they are to put out next, V, and a status.
    ///
    /// Total: any bit pattern in; out come finite values within ±`dac_limit_v`.
    #[inline]
    pub fn step(&self, state: &mut State<T>, adc_x: T, adc_y: T) -> (T, T, Status) {
        if self.demodulator.takes(adc_x, adc_y) {
            self.sample(state, adc_x, adc_y)
        } else {
            self.sample_beyond(state, adc_x, adc_y)
        }
    }

    /// A sample within the converters' range. What is rare is a call at its end, so that nothing has to be kept over it.
    #[inline(always)]
    fn sample(&self, state: &mut State<T>, x: T, y: T) -> (T, T, Status) {
        let now = state.phasor;
        let full = self.demodulator.add(&mut state.window, x, y, &now);
        state.phasor.advance();
        if full {
            self.last(state, x, y, now.cos, now.sin)
        } else {
            let (x, y) = put_out(self.dac_limit_v, &state.drive, now.cos, now.sin);
            (x, y, state.status)
        }
    }

    /// A sample at the end of the converters' range, or one that is no number.
    #[cold]
    #[inline(never)]
    fn sample_beyond(&self, state: &mut State<T>, x: T, y: T) -> (T, T, Status) {
        let (x, y) = self.demodulator.admit(&mut state.window, x, y);
        self.sample(state, x, y)
    }

    /// The last sample of a window, taken at the phase of (`cos`, `sin`). What is rare is a call at its end, here and
    /// below, so that nothing has to be kept over it.
    #[inline(never)]
    fn last(&self, state: &mut State<T>, x: T, y: T, cos: T, sin: T) -> (T, T, Status) {
        let window = Window { last: (x, y), ..state.window };
        let now = window.fingerprint();
        // the sums of two windows are seldom the same
        let usual = window.clipped == 0 && unlike(&now, &state.fingerprint);
        let readout = match self.demodulator.envelope(&window, &state.phasor) {
            Some(readout) if usual => readout,
            _ => return self.end_window_suspect(state, x, y, cos, sin),
        };
        state.fingerprint = now;
        state.seen.readout = readout;
        let vibration = match &self.readout {
            None => readout,
            Some(inverse) => match inverse.apply_at_any_moment(readout) {
                Some(vibration) => vibration,
                None => return self.last_at_its_moment(state, inverse, cos, sin),
            },
        };
        self.control_fast(state, vibration, cos, sin)
    }

    /// The last sample of a window without an envelope, or with one that is to be suspected.
    #[cold]
    #[inline(never)]
    fn end_window_suspect(&self, state: &mut State<T>, x: T, y: T, cos: T, sin: T) -> (T, T, Status) {
        let window = Window { last: (x, y), ..state.window };
        let measured = self.demodulator.finish(&window, &state.phasor);
        let valid = measured.status == Measured::Valid;
        let repeats = repeats(&measured.fingerprint, &state.fingerprint);
        state.fingerprint = measured.fingerprint;
        state.seen.readout = measured.envelope;
        state.seen.compensated = match &self.readout {
            Some(inverse) if valid => inverse.apply_at(measured.envelope, || self.moment(state)),
            _ => measured.envelope,
        };
        self.control_checked(state, Suspicion { spoilt: !valid, clipped: measured.clipped > 0, repeats }, cos, sin)
    }

    /// The last sample of a window whose readout is compensated by effects that depend on the moment.
    #[inline(never)]
    fn last_at_its_moment(
        &self,
        state: &mut State<T>,
        inverse: &Compensation<T, MOST_COMPENSATED>,
        cos: T,
        sin: T,
    ) -> (T, T, Status) {
        let vibration = inverse.apply(state.seen.readout, &self.moment(state));
        self.control_fast(state, vibration, cos, sin)
    }

    /// The control step after a window with nothing to be suspected, and what is put out.
    #[inline(always)]
    fn control_fast(&self, state: &mut State<T>, vibration: Envelope<T>, cos: T, sin: T) -> (T, T, Status) {
        state.seen.compensated = vibration;
        let p = vibration.pendulum();
        if self.supervisor.runs_unchanged(&state.supervisor, &p) {
            if state.supervisor.mode != self.shortest {
                return self.go_on_in_full(state, cos, sin);
            }
            if let Some(out) = self.steadily::<false>(state, &vibration, &p, cos, sin) {
                return out;
            }
        }
        self.control_checked(state, Suspicion::default(), cos, sin)
    }

    /// Where the rate loop runs as well, or a phase of the drives is undone.
    #[inline(never)]
    fn go_on_in_full(&self, state: &mut State<T>, cos: T, sin: T) -> (T, T, Status) {
        let e = state.seen.compensated;
        match self.steadily::<true>(state, &e, &e.pendulum(), cos, sin) {
            Some(out) => out,
            None => self.control_checked(state, Suspicion::default(), cos, sin),
        }
    }

    //= specs/dsp.md#short-way
    //# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
    /// The control step of nearly every window, in whole-angle mode or hold: nothing is amiss, nothing at a limit. None, and
    /// nothing changed, elsewhere; [`Instrument::control`] does the same at every window.
    #[inline(always)]
    fn steadily<const FULL: bool>(
        &self,
        state: &mut State<T>,
        e: &Envelope<T>,
        p: &Pendulum<T>,
        cos: T,
        sin: T,
    ) -> Option<(T, T, Status)> {
        let (mut energy, mut quadrature, mut rate, mut lock) = (state.energy, state.quadrature, state.rate, state.lock);
        let mut precession = state.precession;
        if !self.precession.step_steadily(&mut precession, p) {
            return None;
        }
        let v_as = self.energy.energy_within(&mut energy, p.e, self.energy_set_v2)?;
        let v_qc = self.quadrature.quadrature_within(&mut quadrature, p.q)?;
        let hold = FULL && state.supervisor.mode == Mode::Hold;
        let v_qs = if hold { self.rate.step(&mut rate, p, &self.hold).volts } else { T::zero() };
        let correction_rad_s = self.phase.step_within(&mut lock, p)?;
        let now = major_axis_of(e, precession.cos_2, precession.sin_2);
        if now.status != Measured::Valid {
            return None;
        }
        let then = self.precession.ahead(&precession, &now);
        let forces = if FULL {
            let commands = OrbitCommands { v_as, v_qs, v_qc, v_ac: T::zero() };
            self.allocation.step_within(&commands, then.cos, then.sin)?
        } else {
            self.allocation.axes_within(&ControlOutputs { v_as, v_qc }, then.cos, then.sin)?
        };
        let phasor = self.oscillator.tune_within(&state.phasor, correction_rad_s)?;

        let drive = self.delay.undone(&forces, correction_rad_s);
        let status = Status {
            mode: state.supervisor.mode,
            fault: None,
            fresh: false,
            clipped: false,
            valid: true,
            half_turns_lost: state.status.half_turns_lost,
        };
        state.supervisor.count();
        // all that there is to see in such a window
        state.continuity.unseen = 0;
        (state.energy, state.quadrature, state.lock, state.precession) = (energy, quadrature, lock, precession);
        if FULL {
            state.rate = rate;
        }
        state.drive = drive;
        let seen = &mut state.seen;
        (seen.v_as, seen.v_qc, seen.v_qs, seen.correction_rad_s) = (v_as, v_qc, v_qs, correction_rad_s);
        state.windows = state.windows.wrapping_add(1);
        state.phasor = phasor;
        state.window = Window::begin(&phasor);
        state.status = status;
        let (x, y) = put_out(self.dac_limit_v, &drive, cos, sin);
        Some((x, y, Status { fresh: true, ..status }))
    }

    /// The control step at every window, with the envelopes that `state.seen` has, and what is put out.
    #[cold]
    #[inline(never)]
    fn control_checked(&self, state: &mut State<T>, suspicion: Suspicion, cos: T, sin: T) -> (T, T, Status) {
        state.status = self.control(state, suspicion);
        let (x, y) = put_out(self.dac_limit_v, &state.drive, cos, sin);
        (x, y, Status { fresh: true, ..state.status })
    }

    /// The control step with the envelopes that `state.seen` has.
    #[inline(always)]
    fn control(&self, state: &mut State<T>, Suspicion { spoilt, clipped, repeats }: Suspicion) -> Status {
        let compensated = state.seen.compensated;
        let pendulum = compensated.pendulum();
        // false where the compensation found no vibration behind the readout
        let valid = !spoilt && pendulum.e.is_finite();
        let was_in_operation = in_operation(state.supervisor.mode);
        let directed = state.precession.is_directed();
        let moved = if valid { self.precession.step(&mut state.precession, &pendulum) } else { Movement::Unknown };
        // a direction from nowhere, or none any more
        let interrupted = valid && directed && moved == Movement::Unknown;
        let observation = Observation { pendulum, valid, clipped, repeats, jumped: moved == Movement::Jumped };
        let beat = match state.supervisor.mode {
            Mode::Listen => {
                if valid {
                    state.beat.add(&compensated);
                }
                let (x2, y2) = state.beat.powers();
                Some(supervisor::Beat { x2, y2, windows: i32::try_from(state.beat.windows()).unwrap_or(i32::MAX) })
            }
            _ => None,
        };
        let command = self.supervisor.step(&mut state.supervisor, &observation, beat);
        self.apply(state, command, &compensated, &pendulum);
        state.windows = state.windows.wrapping_add(1);
        state.phasor = self.oscillator.tune(&state.phasor, state.seen.correction_rad_s);
        state.window = Window::begin(&state.phasor);
        let (mode, fault) = (state.supervisor.mode, state.supervisor.fault_now());
        let sight = Sight {
            valid,
            clear: !(clipped || repeats),
            movement: moved,
            interrupted,
            in_operation: in_operation(mode),
            in_fault: mode == Mode::Fault,
        };
        let in_phase = || !(valid && was_in_operation) || Supervisor::in_phase(&pendulum);
        state.continuity.see(sight, self.most_unseen, in_phase);
        Status { mode, fault, fresh: false, clipped, valid, half_turns_lost: state.continuity.lost }
    }

    /// Runs the loops that `command` ask for, and sets the drives and the oscillator.
    #[inline]
    fn apply(&self, state: &mut State<T>, command: LoopCommand<T>, e: &Envelope<T>, p: &Pendulum<T>) {
        if let LoopCommand::Run { hold, ring_down } = command {
            let v_as = if ring_down {
                T::zero()
            } else {
                self.energy.energy(&mut state.energy, p.e, self.energy_set_v2).volts
            };
            let v_qc = self.quadrature.quadrature(&mut state.quadrature, p.q).volts;
            let v_qs = if hold { self.rate.step(&mut state.rate, p, &self.hold).volts } else { T::zero() };
            let correction_rad_s = self.phase.step(&mut state.lock, p).rad_s;
            let now = major_axis_of(e, state.precession.cos_2, state.precession.sin_2);
            let then = self.precession.ahead(&state.precession, &now);
            let commands = OrbitCommands { v_as, v_qs, v_qc, v_ac: T::zero() };
            let forces = self.allocation.step(&commands, then.cos, then.sin).volts;
            state.drive = self.delay.undone(&forces, correction_rad_s);
            let seen = &mut state.seen;
            (seen.v_as, seen.v_qc, seen.v_qs, seen.correction_rad_s) = (v_as, v_qc, v_qs, correction_rad_s);
        } else {
            self.apply_startup_command(state, command, *e, *p);
        }
    }

    /// What is seldom, by value: what nobody else wants in memory is put there by this call alone.
    #[cold]
    #[inline(never)]
    fn apply_startup_command(&self, state: &mut State<T>, command: LoopCommand<T>, e: Envelope<T>, p: Pendulum<T>) {
        let (e, p) = (&e, &p);
        let zero = T::zero();
        state.drive = AxisForces { x_c: zero, x_s: zero, y_c: zero, y_s: zero };
        let limit_rad_s = self.oscillator.limit_rad_s();
        let mut correction_rad_s = ordered(&command, &state.lock, &state.beat, self.per_window_s, limit_rad_s);
        match command {
            LoopCommand::Rest | LoopCommand::Listen | LoopCommand::Run { .. } => {}
            LoopCommand::Sweep { opposed, .. } => {
                let v = self.sweep_v;
                let forces = AxisForces { x_c: zero, x_s: v, y_c: zero, y_s: if opposed { -v } else { v } };
                state.drive = self.delay.undone(&forces, correction_rad_s);
            }
            LoopCommand::Tune => {
                self.forget(state);
                state.lock = LockState { detuning_rad_s: correction_rad_s };
            }
            LoopCommand::Snap => {
                let (cos, sin) = phase_ahead(e);
                state.phasor = state.phasor.turned(cos, sin);
            }
            LoopCommand::Lock => correction_rad_s = self.phase.step(&mut state.lock, p).rad_s,
        }
        if !matches!(state.supervisor.mode, Mode::Listen) {
            state.beat = Beat::default();
        }
        if matches!(state.supervisor.mode, Mode::Sweep | Mode::Fault) {
            self.forget(state);
        }
        state.seen = Seen { v_as: zero, v_qc: zero, v_qs: zero, correction_rad_s, ..state.seen };
    }

    /// Loops start anew.
    fn forget(&self, state: &mut State<T>) {
        state.energy = PiState::default();
        state.quadrature = PiState::default();
        state.rate = PiState::default();
        state.lock = LockState::default();
    }

    //= specs/dsp.md#commands-behind-the-drives
    //# The commands by which a readout is compensated MUST be those that the drives were made of whatever the oscillator is corrected by.
    /// The moment of the window, for readout effects that depend on it.
    #[cold]
    #[inline(never)]
    fn moment(&self, state: &State<T>) -> Moment<T> {
        Moment {
            // effects that are told by it, or by the temperature, are refused
            t_s: T::zero(),
            table_rad: T::zero(),
            precession_rad_s: self.precession.rate_rad_s(&state.precession),
            warmer_k: T::zero(),
            drive: self.delay.done(&state.drive, state.seen.correction_rad_s),
        }
    }
}

/// What is wrong with a window.
#[derive(Clone, Copy, Default)]
struct Suspicion {
    /// it has no envelope
    spoilt: bool,
    /// a sample was at the end of the range
    clipped: bool,
    /// a channel repeats the last window
    repeats: bool,
}

fn in_operation(mode: Mode) -> bool {
    matches!(mode, Mode::WholeAngle | Mode::Hold | Mode::RingDown)
}

/// A channel's samples are those of the last window, to the last bit, and not all nothing.
#[inline]
pub(crate) fn repeats<T: Float>([sum_x, sum_y, now_x, now_y]: &[T; 4], [x, y, last_x, last_y]: &[T; 4]) -> bool {
    let zero = T::zero();
    (sum_x == x && now_x == last_x && *now_x != zero) || (sum_y == y && now_y == last_y && *now_y != zero)
}

/// Neither channel's sum is that of the last window: no channel repeats it.
#[inline(always)]
pub(crate) fn unlike<T: Float>(now: &[T; 4], before: &[T; 4]) -> bool {
    now[0] != before[0] && now[1] != before[1]
}
