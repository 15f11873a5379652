//! Start-up, operation and faults: which loops run, and what is wrong when none does.
//!
//! From rest: listen whether anything vibrates (after a brown-out it does) → sweep the drive through the band, listen
//! again → lock the phase → spin up → whole angle, or hold. A fault switches the drives off and keeps its name; after a
//! rest the start is tried again, a few times.
//!
//! It refuses to measure and to compute forces: it takes one [`Observation`] a window and gives one [`Orders`]. Times are
//! counted in windows, in integers, so that a mode lasts equally long in every precision.

use cvg_model::{Float, Pendulum};

use crate::ConfigError;

/// What the instrument is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Mode {
    /// drives off; listens for a vibration and finds its frequency
    #[default]
    Listen,
    /// the drives sweep through the band
    Sweep,
    /// the phase-locked loop pulls in; drives off
    Lock,
    /// energy, quadrature and phase loops run towards their set points
    SpinUp,
    /// the pattern is free
    WholeAngle,
    /// the pattern is held at an angle by the rate loop
    Hold,
    /// the energy loop is off
    RingDown,
    /// drives off for a moment: the last window told nothing, or something impossible
    Coast,
    /// drives off; [`SupervisorState::fault`] says why
    Fault,
}

/// Why an instrument stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// samples that are no numbers
    InvalidSamples,
    /// a converter repeats itself
    StuckChannel,
    /// a converter stays at the end of its range
    Saturated,
    /// one channel carries nothing while the other vibrates
    DeadChannel,
    /// nothing vibrates after the sweeps
    NoResonance,
    /// the phase-locked loop does not hold
    NoLock,
    /// the amplitude or the quadrature does not reach its set point
    NoSpinUp,
    /// the amplitude is far above its set point and does not come down
    AmplitudeHigh,
    /// the amplitude has collapsed
    AmplitudeLow,
    /// the orbit is no line and does not become one
    QuadratureHigh,
}

/// What the user wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wish {
    /// a free pattern
    #[default]
    WholeAngle,
    /// a held pattern
    Hold,
    /// a held pattern without the energy loop
    RingDown,
    /// drives off; the start begins anew when the wish changes
    Off,
}

/// One window, as the estimator measured it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation<T> {
    /// pendulum variables; meaningful where `valid`
    pub pendulum: Pendulum<T>,
    /// the window has an envelope
    pub valid: bool,
    /// a sample was at the end of the range
    pub clipped: bool,
    /// a channel repeats the last window exactly
    pub repeats: bool,
    /// the pattern jumped
    pub jumped: bool,
}

/// What the loops are to do until the next window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Orders<T> {
    /// drives off, loops hold
    Rest,
    /// drives off; add the window to the beat
    Listen,
    /// drive both channels alike, at this correction of the reference frequency, rad/s; Y inverted if `opposed`
    Sweep {
        /// correction of the reference frequency, rad/s
        correction_rad_s: T,
        /// Y against X instead of along with it
        opposed: bool,
    },
    /// the beat is heard: set the reference to the vibration's frequency and phase
    Tune,
    /// the reference is set on the vibration's phase at once, drives off
    Snap,
    /// the phase loop runs, drives off
    Lock,
    /// energy, quadrature and phase loops run, and the rate loop if `hold`; the energy loop not if `ring_down`
    Run {
        /// the rate loop too
        hold: bool,
        /// without the energy loop
        ring_down: bool,
    },
}

/// Times and limits, in seconds, volts and ratios.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupervisorSettings {
    /// a window, s
    pub window_s: f64,
    /// set amplitude a₀, V
    pub amplitude_v: f64,
    /// amplitude above which something vibrates, V
    pub heard_v: f64,
    /// half the width of the swept band, rad/s
    pub band_rad_s: f64,
    /// time of the first sweep, s; each further one takes twice as long
    pub sweep_s: f64,
    /// sweeps before [`Fault::NoResonance`]
    pub sweeps: u8,
    /// time of listening, s
    pub listen_s: f64,
    /// longest time to lock, s
    pub lock_s: f64,
    /// longest time to spin up, s
    pub spin_up_s: f64,
    /// longest time without a measurement before a fault, s
    pub coast_s: f64,
    /// longest time with the amplitude, quadrature or phase out of bounds before a fault, s
    pub endure_s: f64,
    /// rest after a fault, s
    pub rest_s: f64,
    /// starts after a fault before it stays
    pub retries: u8,
    /// time in operation after which earlier faults are forgotten, s
    pub forget_s: f64,
}

/// The supervisor's configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supervisor<T> {
    pub(crate) set_2: T,
    /// a quarter and nine quarters of it: half and one and a half times the amplitude
    pub(crate) low_2: T,
    pub(crate) high_2: T,
    pub(crate) heard_2: T,
    pub(crate) band_rad_s: T,
    pub(crate) sweep: u32,
    pub(crate) sweeps: u8,
    pub(crate) listen: u32,
    pub(crate) lock: u32,
    pub(crate) spin_up: u32,
    pub(crate) coast: u32,
    pub(crate) endure: u32,
    pub(crate) rest: u32,
    pub(crate) retries: u8,
    pub(crate) forget: u32,
}

/// The supervisor's state: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct SupervisorState {
    /// what it is doing
    pub mode: Mode,
    /// the fault it is in, or was in last before it came back
    pub fault: Option<Fault>,
    /// what the user wants
    pub wish: Wish,
    /// windows in this mode
    pub windows: u32,
    /// windows in a row in which the thing waited for was seen
    pub good: u32,
    /// windows in which something was out of bounds, less those in which all was well
    pub bad: u32,
    /// windows in which a converter repeated itself, in a row
    pub repeats: u32,
    /// windows with a clipped sample, less those without
    pub clipped: u32,
    /// sweeps made in this start
    pub sweeps: u8,
    /// starts made since all was well
    pub starts: u8,
    /// why it coasts, or did last in this start
    pub cause: Option<Fault>,
    /// how often it coasted since all was well
    pub coasts: u8,
}

/// Windows in a row that make a lock or a spin-up.
const ENOUGH: u32 = 20;
/// Windows in a row in which a converter repeats itself to the last bit.
const STUCK: u32 = 20;
/// Short interruptions before they are a fault.
const MOST_COASTS: u8 = 50;

impl<T: Float> Supervisor<T> {
    /// A supervisor.
    ///
    /// # Errors
    /// A setting that is not finite and positive, or a time of more than 2³¹ windows or of less than one;
    /// `heard_v` not below a third of `amplitude_v`.
    pub fn new(s: &SupervisorSettings) -> Result<Self, ConfigError> {
        let positive = [
            (s.window_s, "window_s"),
            (s.amplitude_v, "amplitude_v"),
            (s.heard_v, "heard_v"),
            (s.band_rad_s, "band_rad_s"),
        ];
        for (value, parameter) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ConfigError { parameter, expected: "finite and positive" });
            }
        }
        if s.heard_v * 3.0 >= s.amplitude_v {
            return Err(ConfigError { parameter: "heard_v", expected: "below a third of amplitude_v" });
        }
        let windows = |time_s: f64, parameter| {
            let count = time_s / s.window_s;
            if count >= 1.0 && count < f64::from(1_u32 << 31) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked the line before")]
                let whole = count as u32;
                Ok(whole)
            } else {
                Err(ConfigError { parameter, expected: "at least a window and at most 2^31" })
            }
        };
        Ok(Self {
            set_2: T::from_f64(s.amplitude_v * s.amplitude_v),
            low_2: T::from_f64(0.25 * s.amplitude_v * s.amplitude_v),
            high_2: T::from_f64(2.25 * s.amplitude_v * s.amplitude_v),
            heard_2: T::from_f64(s.heard_v * s.heard_v),
            band_rad_s: T::from_f64(s.band_rad_s),
            sweep: windows(s.sweep_s, "sweep_s")?,
            sweeps: s.sweeps,
            listen: windows(s.listen_s, "listen_s")?,
            lock: windows(s.lock_s, "lock_s")?,
            spin_up: windows(s.spin_up_s, "spin_up_s")?,
            coast: windows(s.coast_s, "coast_s")?,
            endure: windows(s.endure_s, "endure_s")?,
            rest: windows(s.rest_s, "rest_s")?,
            retries: s.retries,
            forget: windows(s.forget_s, "forget_s")?,
        })
    }

    //= specs/dsp.md#start
    //# An instrument at rest MUST reach whole-angle mode or end in a fault with a name.
    //= specs/dsp.md#recovery
    //# After a fault the instrument MUST be in whole-angle mode again or in a fault with a name within the stated time.
    /// The orders for the window to come, after the window `o`. Total.
    pub fn step(&self, state: &mut SupervisorState, o: &Observation<T>, beat: Option<Beat<T>>) -> Orders<T> {
        state.count();
        let running = matches!(state.mode, Mode::WholeAngle | Mode::Hold) && state.wish == Wish::of(state.mode);
        let well = o.valid && !(o.clipped || o.repeats || o.jumped);
        if running && well && self.within_bounds(&o.pendulum) {
            state.bad = state.bad.saturating_sub(1);
            state.repeats = 0;
            state.clipped = state.clipped.saturating_sub(1);
            if state.windows >= self.forget {
                (state.starts, state.coasts, state.cause) = (0, 0, None);
            }
            return Orders::Run { hold: state.mode == Mode::Hold, ring_down: false };
        }
        if state.wish == Wish::Off {
            *state = SupervisorState { wish: Wish::Off, fault: state.fault, ..SupervisorState::default() };
            return Orders::Rest;
        }
        state.repeats = if o.repeats { state.repeats.saturating_add(1) } else { 0 };
        state.clipped = if o.clipped { state.clipped.saturating_add(1) } else { state.clipped.saturating_sub(1) };
        if state.mode == Mode::Fault {
            return self.rest(state, o);
        }
        if state.repeats >= STUCK {
            return fail(state, Fault::StuckChannel);
        }
        if state.clipped >= self.endure {
            return fail(state, Fault::Saturated);
        }
        if !o.valid && state.mode != Mode::Coast {
            return coast(state, Fault::InvalidSamples);
        }
        match state.mode {
            Mode::Listen => self.listen(state, beat),
            Mode::Sweep => self.sweep(state),
            Mode::Lock => self.lock(state, o),
            Mode::SpinUp => self.spin_up(state, o),
            Mode::WholeAngle | Mode::Hold | Mode::RingDown => self.operate(state, o),
            Mode::Coast => self.coast(state, o),
            Mode::Fault => Orders::Rest,
        }
    }

    /// Whether all that [`Supervisor::step`] does after a window with the pendulum variables `p`, of which nothing else is
    /// amiss, is to [count](SupervisorState::count) it: whole angle or hold goes on as it is.
    #[inline(always)]
    pub fn goes_on(&self, state: &SupervisorState, p: &Pendulum<T>) -> bool {
        let as_wished = match state.mode {
            Mode::WholeAngle => state.wish == Wish::WholeAngle,
            Mode::Hold => state.wish == Wish::Hold,
            _ => false,
        };
        // one branch for all three
        let counted = state.bad | state.repeats | state.clipped;
        as_wished
            && counted == 0
            && (state.windows.saturating_add(1) < self.forget || state.forgotten())
            && p.e > self.low_2
            && p.e < self.high_2
            // together below the bound that each has
            && p.q.magnitude() + p.l.magnitude() < T::half() * p.e
    }

    /// Amplitude, quadrature and phase are those of an instrument in operation.
    fn within_bounds(&self, p: &Pendulum<T>) -> bool {
        let bound = T::half() * p.e;
        p.e > self.low_2 && p.e < self.high_2 && p.q.magnitude() < bound && p.l.magnitude() < bound
    }

    fn listen(&self, state: &mut SupervisorState, beat: Option<Beat<T>>) -> Orders<T> {
        if state.windows < self.listen {
            return Orders::Listen;
        }
        let Some(beat) = beat else { return Orders::Listen };
        let sum = beat.x2 + beat.y2;
        let heard = sum > T::ratio(beat.windows, 1) * self.heard_2;
        if heard {
            let faint = sum * T::ratio(1, 400);
            // a line along an axis looks like a dead channel, but not after a sweep that drives both
            let suspicious = state.sweeps > 0 || state.fault == Some(Fault::DeadChannel);
            if suspicious && (beat.x2 < faint || beat.y2 < faint) {
                if state.sweeps >= self.sweeps {
                    return fail(state, Fault::DeadChannel);
                }
                return enter(state, Mode::Sweep, Orders::Rest);
            }
            return enter(state, Mode::Lock, Orders::Tune);
        }
        if state.sweeps >= self.sweeps {
            return fail(state, Fault::NoResonance);
        }
        enter(state, Mode::Sweep, Orders::Rest)
    }

    fn sweep(&self, state: &mut SupervisorState) -> Orders<T> {
        let length = self.sweep.saturating_mul(1 << state.sweeps.min(8)).max(1);
        if state.windows >= length {
            state.sweeps = state.sweeps.saturating_add(1);
            return enter(state, Mode::Listen, Orders::Rest);
        }
        let share = count::<T>(state.windows) / count::<T>(length);
        Orders::Sweep {
            correction_rad_s: self.band_rad_s * (T::two() * share - T::one()),
            opposed: state.sweeps % 2 == 1,
        }
    }

    fn lock(&self, state: &mut SupervisorState, o: &Observation<T>) -> Orders<T> {
        let p = &o.pendulum;
        if p.e * T::ratio(4, 1) < self.heard_2 {
            return enter(state, Mode::Listen, Orders::Rest);
        }
        if state.windows == 1 {
            return Orders::Snap;
        }
        if p.l.magnitude() < T::ratio(1, 5) * p.e {
            state.good = state.good.saturating_add(1);
        } else {
            state.good = 0;
        }
        if state.good >= ENOUGH {
            return enter(state, Mode::SpinUp, Orders::Run { hold: false, ring_down: false });
        }
        if state.windows >= self.lock {
            return fail(state, Fault::NoLock);
        }
        Orders::Lock
    }

    fn spin_up(&self, state: &mut SupervisorState, o: &Observation<T>) -> Orders<T> {
        let p = &o.pendulum;
        if p.e * T::ratio(4, 1) < self.heard_2 {
            return fail(state, Fault::AmplitudeLow);
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
            let mode = match state.wish {
                Wish::Hold => Mode::Hold,
                Wish::RingDown => Mode::RingDown,
                Wish::WholeAngle | Wish::Off => Mode::WholeAngle,
            };
            return enter(state, mode, orders(mode));
        }
        // on its way up an amplitude may be low
        if let Some(orders) = self.out_of_bounds(state, p, false) {
            return orders;
        }
        if state.windows >= self.spin_up {
            return fail(state, Fault::NoSpinUp);
        }
        Orders::Run { hold: state.wish != Wish::WholeAngle, ring_down: false }
    }

    fn operate(&self, state: &mut SupervisorState, o: &Observation<T>) -> Orders<T> {
        let p = &o.pendulum;
        if o.jumped {
            return coast(state, Fault::DeadChannel);
        }
        if p.e * T::ratio(4, 1) < self.heard_2 {
            return fail(state, Fault::AmplitudeLow);
        }
        let wished = match state.wish {
            Wish::Hold => Mode::Hold,
            Wish::RingDown => Mode::RingDown,
            Wish::WholeAngle | Wish::Off => Mode::WholeAngle,
        };
        let low = p.e < self.low_2;
        if wished != state.mode {
            // after a ring-down the amplitude has to come back first
            let next = if low { Mode::SpinUp } else { wished };
            return enter(state, next, orders(next));
        }
        if let Some(orders) = self.out_of_bounds(state, p, low && state.mode != Mode::RingDown) {
            return orders;
        }
        orders(state.mode)
    }

    /// What is to be done about a phase, an amplitude or a quadrature out of bounds.
    fn out_of_bounds(&self, state: &mut SupervisorState, p: &Pendulum<T>, low: bool) -> Option<Orders<T>> {
        let bound = T::half() * p.e;
        if p.l.magnitude() >= bound {
            return Some(enter(state, Mode::Lock, Orders::Snap));
        }
        let high = p.e > self.high_2;
        let round = p.q.magnitude() >= bound;
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
        } else {
            state.bad = state.bad.saturating_sub(1);
        }
        None
    }

    fn coast(&self, state: &mut SupervisorState, o: &Observation<T>) -> Orders<T> {
        if !o.valid {
            state.good = 0;
            if state.windows >= self.coast {
                let cause = state.cause.unwrap_or(Fault::InvalidSamples);
                return fail(state, cause);
            }
            return Orders::Rest;
        }
        // two windows of a kind: what was in the middle of a window when it happened is past
        state.good = state.good.saturating_add(1);
        if state.good < 2 {
            return Orders::Rest;
        }
        if o.pendulum.e * T::ratio(4, 1) < self.heard_2 {
            return enter(state, Mode::Listen, Orders::Rest);
        }
        enter(state, Mode::Lock, Orders::Snap)
    }

    /// The rest after a fault.
    fn rest(&self, state: &mut SupervisorState, o: &Observation<T>) -> Orders<T> {
        let cured = o.valid && state.repeats < STUCK;
        if cured && state.windows >= self.rest && state.starts < self.retries {
            state.starts = state.starts.saturating_add(1);
            state.sweeps = 0;
            return enter(state, Mode::Listen, Orders::Rest);
        }
        Orders::Rest
    }
}

impl SupervisorState {
    /// Counts a window.
    #[inline(always)]
    pub fn count(&mut self) {
        self.windows = self.windows.saturating_add(1);
    }

    /// Nothing is left of earlier starts.
    #[inline(always)]
    fn forgotten(&self) -> bool {
        self.starts | self.coasts == 0 && self.cause.is_none()
    }

    /// The fault it is in.
    #[inline]
    pub fn fault_now(&self) -> Option<Fault> {
        if self.mode == Mode::Fault { self.fault } else { None }
    }
}

impl Wish {
    /// The wish that a mode of operation fulfils.
    #[inline]
    fn of(mode: Mode) -> Self {
        match mode {
            Mode::Hold => Self::Hold,
            Mode::RingDown => Self::RingDown,
            _ => Self::WholeAngle,
        }
    }
}

/// What listening heard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beat<T> {
    /// sum of X's squared envelope
    pub x2: T,
    /// sum of Y's squared envelope
    pub y2: T,
    /// over how many windows
    pub windows: i32,
}

fn count<T: Float>(windows: u32) -> T {
    T::ratio(i32::try_from(windows).unwrap_or(i32::MAX), 1)
}

fn orders<T>(mode: Mode) -> Orders<T> {
    Orders::Run { hold: matches!(mode, Mode::Hold | Mode::RingDown), ring_down: mode == Mode::RingDown }
}

fn enter<T>(state: &mut SupervisorState, mode: Mode, orders: Orders<T>) -> Orders<T> {
    (state.mode, state.windows, state.good, state.bad) = (mode, 0, 0, 0);
    orders
}

fn coast<T>(state: &mut SupervisorState, cause: Fault) -> Orders<T> {
    state.cause = Some(cause);
    state.coasts = state.coasts.saturating_add(1);
    if state.coasts > MOST_COASTS {
        state.coasts = 0;
        return fail(state, cause);
    }
    enter(state, Mode::Coast, Orders::Rest)
}

#[cold]
fn fail<T>(state: &mut SupervisorState, fault: Fault) -> Orders<T> {
    state.fault = Some(fault);
    enter(state, Mode::Fault, Orders::Rest)
}
