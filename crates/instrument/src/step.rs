//! The step: a sample, and every N samples the control step.

use cvg_controller::supervisor::{self, Observation, Orders};
use cvg_controller::{Mode, OrbitCommands, PiState, SupervisorState};
use cvg_estimator::beat::phase_ahead;
use cvg_estimator::direction::major_axis;
use cvg_estimator::{Beat, Direction, LockState, Measurement, Movement, PrecessionState, Window};
use cvg_model::effects::Moment;
use cvg_model::{AxisForces, Envelope, Float, Pendulum};

use crate::{Instrument, Seen, State, Status};

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
            windows: 0,
            status: Status::default(),
        }
    }

    //= specs/dsp.md#bounded-commands
    //# Every output of the instrument MUST be finite and within the converter's limit for every input and every state.
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
        if full { self.last(state, x, y, now.cos, now.sin) } else { self.put_out(state, now.cos, now.sin) }
    }

    /// A sample at the end of the converters' range, or one that is no number.
    #[cold]
    #[inline(never)]
    fn sample_beyond(&self, state: &mut State<T>, x: T, y: T) -> (T, T, Status) {
        let (x, y) = self.demodulator.admit(&mut state.window, x, y);
        self.sample(state, x, y)
    }

    /// The last sample of a window, taken at the phase of (`cos`, `sin`).
    #[inline(never)]
    fn last(&self, state: &mut State<T>, x: T, y: T, cos: T, sin: T) -> (T, T, Status) {
        state.window.last = (x, y);
        state.status = self.control(state);
        let (x, y, status) = self.put_out(state, cos, sin);
        (x, y, Status { fresh: true, ..status })
    }

    /// The drives at the phase of (`cos`, `sin`).
    #[inline(always)]
    fn put_out(&self, state: &State<T>, cos: T, sin: T) -> (T, T, Status) {
        let d = &state.drive;
        let (x, y) = (d.x_c * cos + d.x_s * sin, d.y_c * cos + d.y_s * sin);
        // false for NaN
        if x.magnitude() <= self.dac_limit_v && y.magnitude() <= self.dac_limit_v {
            (x, y, state.status)
        } else {
            self.limited(state, x, y)
        }
    }

    #[cold]
    #[inline(never)]
    fn limited(&self, state: &State<T>, x: T, y: T) -> (T, T, Status) {
        (x.bounded(self.dac_limit_v), y.bounded(self.dac_limit_v), state.status)
    }

    /// The control step, after the last sample of a window.
    #[inline(always)]
    fn control(&self, state: &mut State<T>) -> Status {
        let measured = self.demodulator.finish(&state.window, &state.phasor);
        let valid = matches!(measured.status, cvg_estimator::Status::Valid);
        let compensated = match &self.readout {
            Some(compensation) if valid => compensation.apply(measured.envelope, &self.moment(state)),
            _ => measured.envelope,
        };
        let pendulum = compensated.pendulum();
        // false where the compensation found no vibration behind the readout
        let valid = valid && pendulum.e.is_finite();
        let moved = if valid { self.precession.step(&mut state.precession, &pendulum) } else { Movement::Unknown };
        let observation = Observation {
            pendulum,
            valid,
            clipped: measured.clipped > 0,
            repeats: repeats(&measured, &state.fingerprint),
            jumped: moved == Movement::Jumped,
        };
        state.fingerprint = measured.fingerprint;
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
        let orders = self.supervisor.step(&mut state.supervisor, &observation, beat);
        state.seen.readout = measured.envelope;
        state.seen.compensated = compensated;
        self.obey(state, orders, &compensated, &pendulum);
        state.windows = state.windows.wrapping_add(1);
        state.phasor = self.oscillator.tune(&state.phasor, state.seen.correction_rad_s);
        state.window = Window::begin(&state.phasor);
        Status {
            mode: state.supervisor.mode,
            fault: state.supervisor.fault_now(),
            fresh: false,
            clipped: measured.clipped > 0,
            valid,
        }
    }

    /// Runs the loops that `orders` ask for, and sets the drives and the oscillator.
    #[inline]
    fn obey(&self, state: &mut State<T>, orders: Orders<T>, e: &Envelope<T>, p: &Pendulum<T>) {
        if let Orders::Run { hold, ring_down } = orders {
            let v_as = if ring_down {
                T::zero()
            } else {
                self.energy.energy(&mut state.energy, p.e, self.energy_set_v2).volts
            };
            let v_qc = self.quadrature.quadrature(&mut state.quadrature, p.q).volts;
            let v_qs = if hold { self.rate.step(&mut state.rate, p, &self.hold).volts } else { T::zero() };
            let correction_rad_s = self.phase.step(&mut state.lock, p).rad_s;
            let now: Direction<T> = major_axis(e, p);
            let then = self.precession.ahead(&state.precession, &now);
            let commands = OrbitCommands { v_as, v_qs, v_qc, v_ac: T::zero() };
            let forces = self.allocation.step(&commands, then.cos, then.sin).volts;
            state.drive = self.delayed(&forces, correction_rad_s);
            state.seen = Seen { v_as, v_qc, v_qs, correction_rad_s, ..state.seen };
        } else {
            self.obey_otherwise(state, orders, *e, *p);
        }
    }

    /// What is seldom, by value: what nobody else wants in memory is put there by this call alone.
    #[cold]
    #[inline(never)]
    fn obey_otherwise(&self, state: &mut State<T>, orders: Orders<T>, e: Envelope<T>, p: Pendulum<T>) {
        let (e, p) = (&e, &p);
        let zero = T::zero();
        state.drive = AxisForces { x_c: zero, x_s: zero, y_c: zero, y_s: zero };
        let mut correction_rad_s = state.lock.detuning_rad_s.bounded(self.oscillator.limit_rad_s());
        match orders {
            Orders::Rest | Orders::Run { .. } => {}
            Orders::Listen => correction_rad_s = self.listening(state),
            Orders::Sweep { correction_rad_s: swept, opposed } => {
                let v = self.sweep_v;
                let forces = AxisForces { x_c: zero, x_s: v, y_c: zero, y_s: if opposed { -v } else { v } };
                state.drive = self.delayed(&forces, swept);
                correction_rad_s = swept;
            }
            Orders::Tune => {
                let off = state.beat.radians_per_window() * self.per_window_s;
                correction_rad_s = (correction_rad_s + off).bounded(self.oscillator.limit_rad_s());
                self.forget(state);
                state.lock = LockState { detuning_rad_s: correction_rad_s };
            }
            Orders::Snap => {
                let (cos, sin) = phase_ahead(e);
                state.phasor = state.phasor.turned(cos, sin);
            }
            Orders::Lock => correction_rad_s = self.phase.step(&mut state.lock, p).rad_s,
        }
        if !matches!(state.supervisor.mode, Mode::Listen) {
            state.beat = Beat::default();
        }
        if matches!(state.supervisor.mode, Mode::Sweep | Mode::Fault) {
            self.forget(state);
        }
        state.seen = Seen { v_as: zero, v_qc: zero, v_qs: zero, correction_rad_s, ..state.seen };
    }

    /// The correction while listening: the loop's, if it has one from before a fault.
    fn listening(&self, state: &State<T>) -> T {
        state.lock.detuning_rad_s.bounded(self.oscillator.limit_rad_s())
    }

    /// Loops start anew.
    fn forget(&self, state: &mut State<T>) {
        state.energy = PiState::default();
        state.quadrature = PiState::default();
        state.rate = PiState::default();
        state.lock = LockState::default();
    }

    /// The commands with the delay of the whole loop undone: f(t) is to have the phase of the vibration at the middle of
    /// the output's hold, which is ahead of the oscillator's phase at the sample by ω times the delay.
    #[inline]
    fn delayed(&self, f: &AxisForces<T>, correction_rad_s: T) -> AxisForces<T> {
        // the correction's own share is small: first order
        let more = correction_rad_s * self.delay_s;
        let (cos, sin) = (self.delay_cos - self.delay_sin * more, self.delay_sin + self.delay_cos * more);
        AxisForces {
            x_c: f.x_c * cos + f.x_s * sin,
            x_s: f.x_s * cos - f.x_c * sin,
            y_c: f.y_c * cos + f.y_s * sin,
            y_s: f.y_s * cos - f.y_c * sin,
        }
    }

    /// The moment of the window, for readout effects that depend on it.
    #[inline]
    fn moment(&self, state: &State<T>) -> Moment<T> {
        let windows = T::ratio(i32::try_from(state.windows).unwrap_or(i32::MAX), 1);
        Moment {
            t_s: windows * self.window_s,
            table_rad: T::zero(),
            precession_rad_s: self.precession.rate_rad_s(&state.precession),
        }
    }
}

/// A channel's samples are those of the last window, to the last bit, and not all nothing.
#[inline]
fn repeats<T: Float>(m: &Measurement<T>, [x, y, last_x, last_y]: &[T; 4]) -> bool {
    let [sum_x, sum_y, now_x, now_y] = m.fingerprint;
    // the sums of two windows are seldom the same
    if sum_x != *x && sum_y != *y {
        return false;
    }
    (sum_x == *x && now_x == *last_x && now_x != T::zero()) || (sum_y == *y && now_y == *last_y && now_y != T::zero())
}
