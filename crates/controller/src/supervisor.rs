//! Start-up, operation and faults: which loops run, and what is wrong when none does.
//!
//! From rest: listen whether anything vibrates (after a brown-out it does) → sweep the drive through the band, listen
//! again → lock the phase → spin up → whole angle, or hold. A fault switches the drives off and keeps its name; after a
//! rest the start is tried again, a few times soon and then seldom.
//!
//! Nothing goes on for ever: a start has a budget of windows that only a fault or a time in operation renews, and what was
//! out of bounds is forgotten only after a time in which nothing was.
//!
//! It refuses to measure and to compute forces: it takes one [`Observation`] a window and gives one [`LoopCommand`]. Times are
//! counted in windows, in integers, so that a mode lasts equally long in every precision.

use cvg_model::{Float, Pendulum};

use crate::ConfigError;

mod step;

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

impl Mode {
    /// Every mode, in the order in which an instrument meets them.
    pub const ALL: [Self; 9] = [
        Self::Listen,
        Self::Sweep,
        Self::Lock,
        Self::SpinUp,
        Self::WholeAngle,
        Self::Hold,
        Self::RingDown,
        Self::Coast,
        Self::Fault,
    ];
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
pub enum RequestedMode {
    /// a free pattern
    #[default]
    WholeAngle,
    /// a held pattern
    Hold,
    /// a held pattern without the energy loop
    RingDown,
    /// drives off; the start begins anew when the requested mode changes
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
pub enum LoopCommand<T> {
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
    pub detection_threshold_v: f64,
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
    pub fault_debounce_s: f64,
    /// rest after a fault, s
    pub rest_s: f64,
    /// starts after a fault before the rests become [`LONG_REST`] times as long
    pub retries: u8,
    /// time in operation after which earlier faults are forgotten, s
    pub fault_memory_s: f64,
}

/// The supervisor's configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supervisor<T> {
    pub(crate) set_2: T,
    /// a quarter and nine quarters of it: half and one and a half times the amplitude
    pub(crate) low_2: T,
    pub(crate) high_2: T,
    pub(crate) detection_threshold_2: T,
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
    /// windows of a start, all its modes together
    pub(crate) budget: u32,
}

/// The supervisor's state: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct SupervisorState {
    /// what it is doing
    pub mode: Mode,
    /// the fault it is in, or was in last before it came back
    pub fault: Option<Fault>,
    /// what the user wants
    pub requested: RequestedMode,
    /// windows in this mode; in whole angle and hold, windows in a row in which all was well
    pub windows: u32,
    /// windows in a row in which the thing waited for was seen
    pub good: u32,
    /// windows in which amplitude or quadrature was out of bounds, since all was well for a time
    pub bad: u32,
    /// windows in which a converter repeated itself, in a row
    pub repeats: u32,
    /// windows with a clipped sample, since all was well for a time
    pub clipped: u32,
    /// windows of this start that were neither operation nor fault: what is left of its budget shrinks with each
    pub trying: u32,
    /// sweeps made in this start
    pub sweeps: u8,
    /// starts made since all was well for long
    pub starts: u8,
    /// why it coasts, or did last in this start
    pub cause: Option<Fault>,
    /// how often it was interrupted, by a coast or a lost phase, since all was well for long
    pub coasts: u8,
}

/// Windows in a row that make a lock or a spin-up.
pub(crate) const ENOUGH: u32 = 20;
/// Windows in a row in which a converter repeats itself to the last bit.
const STUCK: u32 = 20;
/// Short interruptions before they are a fault.
pub(crate) const MOST_COASTS: u8 = 50;
/// By so much the rest grows when the starts of [`SupervisorSettings::retries`] are used up.
pub const LONG_REST: u32 = 64;

impl<T: Float> Supervisor<T> {
    /// A supervisor.
    ///
    /// # Errors
    /// A setting that is not finite and positive, or a time of more than 2³¹ windows or of less than one; a lock or a spin-up
    /// too short for what makes it; `detection_threshold_v` not below a third of `amplitude_v`.
    pub fn new(s: &SupervisorSettings) -> Result<Self, ConfigError> {
        let positive = [
            (s.window_s, "window_s"),
            (s.amplitude_v, "amplitude_v"),
            (s.detection_threshold_v, "detection_threshold_v"),
            (s.band_rad_s, "band_rad_s"),
        ];
        for (value, parameter) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ConfigError { parameter, expected: "finite and positive" });
            }
        }
        if s.detection_threshold_v * 3.0 >= s.amplitude_v {
            return Err(ConfigError { parameter: "detection_threshold_v", expected: "below a third of amplitude_v" });
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
        for (time_s, parameter) in [(s.lock_s, "lock_s"), (s.spin_up_s, "spin_up_s")] {
            if windows(time_s, parameter)? < ENOUGH + 2 {
                return Err(ConfigError { parameter, expected: "at least 22 windows" });
            }
        }
        let mut supervisor = Self {
            set_2: T::from_f64(s.amplitude_v * s.amplitude_v),
            low_2: T::from_f64(0.25 * s.amplitude_v * s.amplitude_v),
            high_2: T::from_f64(2.25 * s.amplitude_v * s.amplitude_v),
            detection_threshold_2: T::from_f64(s.detection_threshold_v * s.detection_threshold_v),
            band_rad_s: T::from_f64(s.band_rad_s),
            sweep: windows(s.sweep_s, "sweep_s")?,
            sweeps: s.sweeps,
            listen: windows(s.listen_s, "listen_s")?,
            lock: windows(s.lock_s, "lock_s")?,
            spin_up: windows(s.spin_up_s, "spin_up_s")?,
            coast: windows(s.coast_s, "coast_s")?,
            endure: windows(s.fault_debounce_s, "fault_debounce_s")?,
            rest: windows(s.rest_s, "rest_s")?,
            retries: s.retries,
            forget: windows(s.fault_memory_s, "fault_memory_s")?,
            budget: 0,
        };
        supervisor.budget = supervisor.longest_start();
        Ok(supervisor)
    }

    /// Twice the windows of a start in which every mode takes its longest time once.
    fn longest_start(&self) -> u32 {
        let listening = u64::from(self.listen) * (u64::from(self.sweeps) + 1);
        let sweeping: u64 = (0..self.sweeps).map(|n| u64::from(self.sweep_length(n))).sum();
        let once = listening + sweeping + u64::from(self.lock) + u64::from(self.spin_up) + u64::from(self.coast);
        u32::try_from(2 * once).unwrap_or(u32::MAX)
    }

    /// Windows of the sweep after `made` others: each takes twice as long as the last.
    fn sweep_length(&self, made: u8) -> u32 {
        self.sweep.saturating_mul(1 << made.min(8)).max(1)
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
        u32::from(self.starts | self.coasts) | self.trying == 0 && self.cause.is_none()
    }

    /// The fault it is in.
    #[inline]
    pub fn fault_now(&self) -> Option<Fault> {
        if self.mode == Mode::Fault { self.fault } else { None }
    }
}

impl RequestedMode {
    /// The request that whole angle or hold fulfils.
    #[inline]
    fn of(mode: Mode) -> Self {
        match mode {
            Mode::Hold => Self::Hold,
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
