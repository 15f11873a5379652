//! The supervisor's step: a window in, command out.

use cvg_model::{Float, Pendulum};

use super::{
    Beat, ENOUGH, Fault, LONG_REST, LoopCommand, MOST_COASTS, Mode, Observation, RequestedMode, STUCK, Supervisor,
    SupervisorState,
};

impl<T: Float> Supervisor<T> {
    //= specs/dsp.md#start
    //# An instrument at rest MUST reach whole-angle mode or end in a fault with a name.
    //= specs/dsp.md#recovery
    //# After a fault the instrument MUST be in whole-angle mode again or in a fault with a name within the stated time.
    /// The command for the window to come, after the window `o`. Total.
    pub fn step(&self, state: &mut SupervisorState, o: &Observation<T>, beat: Option<Beat<T>>) -> LoopCommand<T> {
        state.count();
        let running =
            matches!(state.mode, Mode::WholeAngle | Mode::Hold) && state.requested == RequestedMode::of(state.mode);
        let well = o.valid && !(o.clipped || o.repeats || o.jumped);
        if running && well && self.within_bounds(&o.pendulum) {
            state.repeats = 0;
            if state.windows >= self.endure {
                (state.bad, state.clipped) = (0, 0);
            }
            if state.windows >= self.forget {
                (state.starts, state.coasts, state.cause, state.trying) = (0, 0, None, 0);
            }
            return LoopCommand::Run { hold: state.mode == Mode::Hold, ring_down: false };
        }
        if state.requested == RequestedMode::Off {
            *state =
                SupervisorState { requested: RequestedMode::Off, fault: state.fault, ..SupervisorState::default() };
            return LoopCommand::Rest;
        }
        state.repeats = if o.repeats { state.repeats.saturating_add(1) } else { 0 };
        if state.mode == Mode::Fault {
            return self.rest(state, o);
        }
        state.clipped = state.clipped.saturating_add(u32::from(o.clipped));
        if state.repeats >= STUCK {
            return fail(state, named(o, Fault::StuckChannel));
        }
        if state.clipped >= self.endure {
            return fail(state, Fault::Saturated);
        }
        if let Some(fault) = self.given_up(state) {
            return fail(state, fault);
        }
        if !o.valid && state.mode != Mode::Coast {
            return interrupted(state, Fault::InvalidSamples);
        }
        match state.mode {
            Mode::Listen => self.listen(state, beat),
            Mode::Sweep => self.sweep(state),
            Mode::Lock => self.lock(state, o),
            Mode::SpinUp => self.spin_up(state, o),
            Mode::WholeAngle | Mode::Hold | Mode::RingDown => self.operate(state, o),
            Mode::Coast => self.coast(state, o),
            Mode::Fault => LoopCommand::Rest,
        }
    }

    //= specs/dsp.md#start-budget
    //# A start MUST end in operation or in a fault with a name within its budget of windows whatever is observed.
    /// Counts a window of a start; the fault that ends it where its budget is used up.
    fn given_up(&self, state: &mut SupervisorState) -> Option<Fault> {
        let fault = match state.mode {
            Mode::Listen | Mode::Sweep => Fault::NoResonance,
            Mode::Lock => Fault::NoLock,
            Mode::SpinUp => Fault::NoSpinUp,
            Mode::Coast => state.cause.unwrap_or(Fault::InvalidSamples),
            Mode::WholeAngle | Mode::Hold | Mode::RingDown | Mode::Fault => return None,
        };
        state.trying = state.trying.saturating_add(1);
        if state.trying >= self.budget { Some(fault) } else { None }
    }

    //= specs/dsp.md#short-way
    //# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
    /// Whether all that [`Supervisor::step`] does after a window with the pendulum variables `p`, of which nothing else is
    /// amiss, is to [count](SupervisorState::count) it: whole angle or hold goes on as it is.
    #[inline(always)]
    pub fn runs_unchanged(&self, state: &SupervisorState, p: &Pendulum<T>) -> bool {
        let as_requested = match state.mode {
            Mode::WholeAngle => state.requested == RequestedMode::WholeAngle,
            Mode::Hold => state.requested == RequestedMode::Hold,
            _ => false,
        };
        let next = state.windows.saturating_add(1);
        // one branch for all three; what was out of bounds stays counted, untouched, until it is forgotten
        let counted = state.bad | state.repeats | state.clipped;
        as_requested
            && (counted == 0 || (state.repeats == 0 && next < self.endure))
            && (next < self.forget || state.forgotten())
            && p.e > self.low_2
            && p.e < self.high_2
            // together below the bound of the phase, which is below that of the quadrature
            && p.q.magnitude() + p.l.magnitude() < in_phase_bound(p)
    }

    /// The phase is as near as loops in operation leave it; elsewhere there were windows that nobody saw, perhaps.
    pub fn in_phase(p: &Pendulum<T>) -> bool {
        p.l.magnitude() < in_phase_bound(p)
    }

    /// Amplitude, quadrature and phase are those of an instrument in operation.
    fn within_bounds(&self, p: &Pendulum<T>) -> bool {
        let bound = T::half() * p.e;
        p.e > self.low_2 && p.e < self.high_2 && p.q.magnitude() < bound && p.l.magnitude() < bound
    }

    fn listen(&self, state: &mut SupervisorState, beat: Option<Beat<T>>) -> LoopCommand<T> {
        if state.windows < self.listen {
            return LoopCommand::Listen;
        }
        let Some(beat) = beat else { return LoopCommand::Listen };
        let sum = beat.x2 + beat.y2;
        let heard = sum > T::ratio(beat.windows, 1) * self.detection_threshold_2;
        if heard {
            let faint = sum * T::ratio(1, 400);
            // a line along an axis looks like a dead channel, but not after a sweep that drives both
            let suspicious = state.sweeps > 0 || state.fault == Some(Fault::DeadChannel);
            if suspicious && (beat.x2 < faint || beat.y2 < faint) {
                if state.sweeps >= self.sweeps {
                    return fail(state, Fault::DeadChannel);
                }
                return enter(state, Mode::Sweep, LoopCommand::Rest);
            }
            return enter(state, Mode::Lock, LoopCommand::Tune);
        }
        if state.sweeps >= self.sweeps {
            return fail(state, Fault::NoResonance);
        }
        enter(state, Mode::Sweep, LoopCommand::Rest)
    }

    fn sweep(&self, state: &mut SupervisorState) -> LoopCommand<T> {
        let length = self.sweep_length(state.sweeps);
        if state.windows >= length {
            state.sweeps = state.sweeps.saturating_add(1);
            return enter(state, Mode::Listen, LoopCommand::Rest);
        }
        let share = count::<T>(state.windows) / count::<T>(length);
        LoopCommand::Sweep {
            correction_rad_s: self.band_rad_s * (T::two() * share - T::one()),
            opposed: state.sweeps % 2 == 1,
        }
    }

    fn lock(&self, state: &mut SupervisorState, o: &Observation<T>) -> LoopCommand<T> {
        let p = &o.pendulum;
        if p.e * T::ratio(4, 1) < self.detection_threshold_2 {
            return enter(state, Mode::Listen, LoopCommand::Rest);
        }
        if state.windows == 1 {
            return LoopCommand::Snap;
        }
        if p.l.magnitude() < T::ratio(1, 5) * p.e {
            state.good = state.good.saturating_add(1);
        } else {
            state.good = 0;
        }
        if state.good >= ENOUGH {
            return enter(state, Mode::SpinUp, LoopCommand::Run { hold: false, ring_down: false });
        }
        if state.windows >= self.lock {
            return fail(state, Fault::NoLock);
        }
        LoopCommand::Lock
    }

    fn spin_up(&self, state: &mut SupervisorState, o: &Observation<T>) -> LoopCommand<T> {
        let p = &o.pendulum;
        if p.e * T::ratio(4, 1) < self.detection_threshold_2 {
            return fail(state, named(o, Fault::AmplitudeLow));
        }
        let off = (p.e - self.set_2).magnitude();
        if off < T::ratio(1, 5) * self.set_2 && p.q.magnitude() < T::ratio(1, 10) * p.e {
            state.good = state.good.saturating_add(1);
        } else {
            state.good = 0;
        }
        if state.good >= ENOUGH {
            state.sweeps = 0;
            // a pattern that jumped onto an axis may be one channel that is left
            if state.cause == Some(Fault::DeadChannel) && p.s.magnitude() < T::ratio(1, 30) * p.r.magnitude() {
                return fail(state, Fault::DeadChannel);
            }
            let mode = match state.requested {
                RequestedMode::Hold => Mode::Hold,
                RequestedMode::RingDown => Mode::RingDown,
                RequestedMode::WholeAngle | RequestedMode::Off => Mode::WholeAngle,
            };
            return enter(state, mode, command(mode));
        }
        // on its way up an amplitude may be low
        if let Some(command) = self.out_of_bounds(state, p, false) {
            return command;
        }
        if state.windows >= self.spin_up {
            return fail(state, Fault::NoSpinUp);
        }
        LoopCommand::Run { hold: state.requested != RequestedMode::WholeAngle, ring_down: false }
    }

    fn operate(&self, state: &mut SupervisorState, o: &Observation<T>) -> LoopCommand<T> {
        let p = &o.pendulum;
        if o.jumped {
            return interrupted(state, named(o, Fault::DeadChannel));
        }
        if p.e * T::ratio(4, 1) < self.detection_threshold_2 {
            return fail(state, named(o, Fault::AmplitudeLow));
        }
        let requested = match state.requested {
            RequestedMode::Hold => Mode::Hold,
            RequestedMode::RingDown => Mode::RingDown,
            RequestedMode::WholeAngle | RequestedMode::Off => Mode::WholeAngle,
        };
        let low = p.e < self.low_2;
        if requested != state.mode {
            // after a ring-down the amplitude has to come back first: a start of its own
            let next = if low { Mode::SpinUp } else { requested };
            state.trying = 0;
            return enter(state, next, command(next));
        }
        if let Some(command) = self.out_of_bounds(state, p, low && state.mode != Mode::RingDown) {
            return command;
        }
        if state.mode != Mode::RingDown {
            // not all was well in this window
            state.windows = 0;
        }
        command(state.mode)
    }

    //= specs/dsp.md#faults-cannot-be-walked-around
    //# A window out of bounds MUST be counted until a fault is named, rest is requested, or all was well for the time that is endured.
    /// What is to be done about a phase, an amplitude or a quadrature out of bounds.
    fn out_of_bounds(&self, state: &mut SupervisorState, p: &Pendulum<T>, low: bool) -> Option<LoopCommand<T>> {
        let bound = T::half() * p.e;
        // each false for NaN
        let (locked, bounded, flat) = (p.l.magnitude() < bound, p.e <= self.high_2, p.q.magnitude() < bound);
        if !locked {
            return Some(relocked(state));
        }
        let (high, round) = (!bounded, !flat);
        if high || low || round {
            state.bad = state.bad.saturating_add(1);
            if state.bad >= self.endure {
                let fault = match (high, low) {
                    (true, _) => Fault::AmplitudeHigh,
                    (_, true) => Fault::AmplitudeLow,
                    _ => Fault::QuadratureHigh,
                };
                return Some(fail(state, fault));
            }
        }
        None
    }

    fn coast(&self, state: &mut SupervisorState, o: &Observation<T>) -> LoopCommand<T> {
        if !o.valid {
            state.good = 0;
            if state.windows >= self.coast {
                let cause = state.cause.unwrap_or(Fault::InvalidSamples);
                return fail(state, cause);
            }
            return LoopCommand::Rest;
        }
        // two windows of a kind: what was in the middle of a window when it happened is past
        state.good = state.good.saturating_add(1);
        if state.good < 2 {
            return LoopCommand::Rest;
        }
        if o.pendulum.e * T::ratio(4, 1) < self.detection_threshold_2 {
            return enter(state, Mode::Listen, LoopCommand::Rest);
        }
        enter(state, Mode::Lock, LoopCommand::Snap)
    }

    //= specs/dsp.md#way-back
    //# From every fault the instrument MUST be in operation within its longest rest and its shortest start once all that it observes is as it should be.
    /// The rest after a fault.
    fn rest(&self, state: &mut SupervisorState, o: &Observation<T>) -> LoopCommand<T> {
        let cured = o.valid && !o.clipped && state.repeats < STUCK;
        let rest = if state.starts < self.retries { self.rest } else { self.rest.saturating_mul(LONG_REST) };
        if cured && state.windows >= rest {
            if state.starts < self.retries {
                state.starts = state.starts.saturating_add(1);
            }
            // why it coasted in the last start says nothing of this one: a pattern may lie on an axis by chance
            (state.sweeps, state.clipped, state.trying, state.cause) = (0, 0, 0, None);
            return enter(state, Mode::Listen, LoopCommand::Rest);
        }
        LoopCommand::Rest
    }
}

/// |L| below a sixteenth of E: the phase is within 1.8 degrees.
#[inline(always)]
fn in_phase_bound<T: Float>(p: &Pendulum<T>) -> T {
    T::ratio(1, 16) * p.e
}

fn count<T: Float>(windows: u32) -> T {
    T::ratio(i32::try_from(windows).unwrap_or(i32::MAX), 1)
}

fn command<T>(mode: Mode) -> LoopCommand<T> {
    LoopCommand::Run { hold: matches!(mode, Mode::Hold | Mode::RingDown), ring_down: mode == Mode::RingDown }
}

fn enter<T>(state: &mut SupervisorState, mode: Mode, command: LoopCommand<T>) -> LoopCommand<T> {
    (state.mode, state.windows, state.good) = (mode, 0, 0);
    command
}

/// The fault by its name: a converter at the end of its range, or one that repeats itself, looks like much else.
fn named<T>(o: &Observation<T>, fault: Fault) -> Fault {
    if o.clipped {
        Fault::Saturated
    } else if o.repeats {
        Fault::StuckChannel
    } else {
        fault
    }
}

/// An interruption that is waited out, unless there were too many.
fn interrupted<T>(state: &mut SupervisorState, cause: Fault) -> LoopCommand<T> {
    state.cause = Some(cause);
    if too_many(state) { fail(state, cause) } else { enter(state, Mode::Coast, LoopCommand::Rest) }
}

/// The phase is set anew, unless it was too often.
fn relocked<T>(state: &mut SupervisorState) -> LoopCommand<T> {
    if too_many(state) { fail(state, Fault::NoLock) } else { enter(state, Mode::Lock, LoopCommand::Snap) }
}

/// Counts an interruption.
fn too_many(state: &mut SupervisorState) -> bool {
    state.coasts = state.coasts.saturating_add(1);
    state.coasts > MOST_COASTS
}

#[cold]
fn fail<T>(state: &mut SupervisorState, fault: Fault) -> LoopCommand<T> {
    state.fault = Some(fault);
    (state.bad, state.coasts, state.trying) = (0, 0, 0);
    enter(state, Mode::Fault, LoopCommand::Rest)
}
