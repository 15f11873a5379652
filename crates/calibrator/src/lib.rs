//! A gyroscope that calibrates itself: no table, while it is used, in firmware.
#![no_std]
#![forbid(unsafe_code)]

mod commit;
pub mod complex;
pub mod correction;
mod cycle;
pub mod parameters;
#[cfg(any(kani, test, cvg_prove))]
pub mod proofs;
pub mod record;
mod regressors;
pub mod replay;
mod schedule;
mod state;
pub mod status;
#[cfg(test)]
mod tests;
pub mod ud;
mod window;

pub use correction::Correction;
pub use parameters::Parameter;
pub use state::State;
pub use status::{Mode, Status};

use cvg_model::{AxisForces, Envelope, Float, Pendulum};
use state::{Before, Filter, Schedule};
use window::{Push, Sums};

/// Why a configuration was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConfigError {
    /// which parameter
    pub parameter: &'static str,
    /// what it has to be
    pub expected: &'static str,
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.parameter)?;
        f.write_str(" has to be ")?;
        f.write_str(self.expected)
    }
}

impl core::error::Error for ConfigError {}

/// What the calibrator has to be told of its instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// control period, s
    pub control_s: f64,
    /// set amplitude, V
    pub amplitude_v: f64,
    /// rate of the envelope that a volt of command makes, V/s
    pub drive_per_s: f64,
    /// 1/τ as designed, 1/s
    pub damping_per_s: f64,
    /// control steps to a cycle of the filter: with fewer than 160, each has twice the work
    pub steps: u16,
    /// fastest precession that may be commanded at rest, rad/s
    pub precession_rad_s: f64,
    /// precession that may be commanded, to and fro, while the instrument turns, rad/s
    pub dither_rad_s: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            control_s: 5e-4,
            amplitude_v: 1.0,
            drive_per_s: 1.0,
            damping_per_s: 0.05,
            steps: 160,
            precession_rad_s: 0.698_131_7,
            dither_rad_s: 0.05,
        }
    }
}

/// Whether what is handed over may be learned from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// loops closed, nothing at its limit
    Operating,
    /// start-up, a fault, saturation
    Disturbed,
}

/// What the loops command along the orbit, V, as Equation 9 takes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Commands<T> {
    /// v_as
    pub energy_v: T,
    /// v_qs
    pub precession_v: T,
    /// v_qc
    pub quadrature_v: T,
}

/// Precession that is no rotation, and what would be lost by the loops finding it themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forward<T> {
    /// v_qs for the virtual precession, V
    pub precession_v: T,
    /// to add to v_qc: holds the split, V
    pub quadrature_v: T,
    /// to add to ω_r, rad/s
    pub detuning_rad_s: T,
}

/// The calibrator's configuration: immutable, checked when built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrator<T> {
    control_s: T,
    cycle_s: T,
    amplitude_v: T,
    per_amplitude: T,
    per_energy: T,
    drive_per_s: T,
    damping_per_s: T,
    forget: T,
    precession: T,
    dither: T,
    /// share of the rate that a cycle leaves unexplained in what is believed of it
    smoothing: T,
    steps: u16,
    cycles_per_s: T,
    cycles_per_65536_s: u32,
}

impl<T: Float> Calibrator<T> {
    /// # Errors
    /// A setting outside its domain.
    pub fn new(s: &Settings) -> Result<Self, ConfigError> {
        if s.steps < cycle::SLICES / 2 {
            return Err(ConfigError { parameter: "steps", expected: "at least 80" });
        }
        Self::of_cycles(s)
    }

    /// A calibrator whose cycles are of any length in control steps: whoever uses it does a cycle's work at once.
    fn of_cycles(s: &Settings) -> Result<Self, ConfigError> {
        let positive = |value: f64, parameter| {
            if value > 0.0 && value.is_finite() {
                Ok(T::from_f64(value))
            } else {
                Err(ConfigError { parameter, expected: "finite and positive" })
            }
        };
        let cycle = s.control_s * f64::from(s.steps);
        if !(0.01..=0.1).contains(&cycle) {
            return Err(ConfigError { parameter: "steps", expected: "a cycle of 10 to 100 ms" });
        }
        let amplitude_v = positive(s.amplitude_v, "amplitude_v")?;
        Ok(Self {
            control_s: positive(s.control_s, "control_s")?,
            cycle_s: T::from_f64(cycle),
            amplitude_v,
            per_amplitude: T::one() / amplitude_v,
            per_energy: T::one() / (amplitude_v * amplitude_v),
            drive_per_s: positive(s.drive_per_s, "drive_per_s")?,
            damping_per_s: positive(s.damping_per_s, "damping_per_s")?,
            forget: T::from_f64(1.0 - 0.2 * cycle),
            smoothing: T::from_f64(5.0 * cycle),
            precession: positive(s.precession_rad_s, "precession_rad_s")?,
            dither: positive(s.dither_rad_s, "dither_rad_s")?,
            steps: s.steps,
            cycles_per_s: T::from_f64(1.0 / cycle),
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 100 a second")]
            cycles_per_65536_s: (65_536.0 / cycle) as u32,
        })
    }

    /// Nothing learned.
    pub fn start(&self) -> State<T> {
        State {
            correction: Correction::none(self.damping_per_s),
            filter: Filter::new(),
            before: Before::none(),
            schedule: Schedule::new(self.cycles(2)),
            sums: Sums::after((T::one(), T::zero())),
            closed: Sums::after((T::one(), T::zero())),
            sample: window::Sample::blank(),
            trial: [T::zero(); parameters::N],
            score: T::zero(),
            taken_back: 0,
            step: 0,
            direction: (T::one(), T::zero()),
            precession: T::zero(),
        }
    }

    /// Values in force from the start, in the parameters' units about a perfect instrument of the damping as designed;
    /// none where no device is like that.
    pub fn start_from(&self, values: &parameters::Vector<T>) -> Option<State<T>> {
        let mut state = self.start();
        state.correction = state.correction.moved(values)?;
        Some(state)
    }

    /// The readout undone, as far as it is known.
    #[inline]
    pub fn readout(&self, state: &State<T>, e: &Envelope<T>) -> Envelope<T> {
        state.correction.readout(e, self.amplitude_v, self.per_amplitude)
    }

    /// The drives undone, as far as they are known.
    #[inline]
    pub fn drives(&self, state: &State<T>, f: &AxisForces<T>) -> AxisForces<T> {
        state.correction.drive(f)
    }

    /// What to add to the commands of the loops, for a pattern along (`cos`, `sin`) of amplitude `a_v`.
    #[inline]
    pub fn forward(&self, state: &State<T>, cos: T, sin: T, a_v: T) -> Forward<T> {
        let (cos_2, sin_2) = (cos * cos - sin * sin, T::two() * cos * sin);
        let k = |p| parameters::get(&state.correction.known, p);
        let (kc, ks) = (k(Parameter::SplitCos), k(Parameter::SplitSin));
        let volts = a_v / self.drive_per_s;
        Forward {
            precession_v: -(state.precession * volts),
            quadrature_v: T::half() * (kc * sin_2 - ks * cos_2) * volts,
            detuning_rad_s: -(T::half() * (kc * cos_2 + ks * sin_2)),
        }
    }

    /// One control step: what was measured behind [`Calibrator::readout`], the direction (its sign continuous), and
    /// what is commanded before [`Calibrator::drives`].
    pub fn step(
        &self,
        state: &mut State<T>,
        p: &Pendulum<T>,
        direction: (T, T),
        commands: &Commands<T>,
        health: Health,
    ) {
        let e = self.normal(p);
        let before = state.direction;
        let push = self.push(&e, commands);
        state.sums.add(&e, direction, before, &push, &state.correction.known);
        state.direction = direction;
        if health != Health::Operating {
            state.sums.spoil();
        }
        self.work(state);
        state.step = state.step.saturating_add(1);
        if state.step >= self.steps {
            state.step = 0;
            state.sums.hand_over(&mut state.closed, direction);
        }
    }

    /// The split was changed on purpose, by a tuning electrode: mechanics and drives are learned anew, and the new split
    /// says of the detection what the old one couldn't. Neither its size nor its axis need be known.
    pub fn split_changed(&self, state: &mut State<T>) {
        let sc = &mut state.schedule;
        sc.forget(parameters::OTHERS, T::one());
        sc.stage = 0;
        sc.before_rest = 0;
        sc.used = 0;
        sc.uses_of_symmetry = 0;
        sc.refused = 0;
        sc.angle_used = 0;
        sc.settle = self.cycles(3) / 2;
        sc.fresh = 0;
        state.trial = [T::zero(); parameters::N];
        state.score = T::zero();
        state.before.whole = false;
    }

    /// The rate of the pattern that is not rotation, rad/s, as far as it is known: forces, damping, quadrature.
    pub fn not_rotation(&self, state: &State<T>, p: &Pendulum<T>, (cos, sin): (T, T), commands: &Commands<T>) -> T {
        let e = self.normal(p);
        let push = self.push(&e, commands);
        let k = |p| parameters::get(&state.correction.known, p);
        let (cos_2, sin_2) = (cos * cos - sin * sin, T::two() * cos * sin);
        let r = T::half() * e.q / e.e;
        push.aside / e.e.sqrt() + k(Parameter::AnisodampingCos) * sin_2 - k(Parameter::AnisodampingSin) * cos_2
            + (k(Parameter::SplitCos) * cos_2 + k(Parameter::SplitSin) * sin_2) * r
    }

    /// Pendulum variables over the set energy.
    #[inline]
    fn normal(&self, p: &Pendulum<T>) -> Pendulum<T> {
        let k = self.per_energy;
        Pendulum { e: p.e * k, q: p.q * k, r: p.r * k, s: p.s * k, l: p.l * k }
    }

    /// What commands push, in amplitudes per second, in the frame of the vibration as it is: the phase-locked loop's
    /// error turns one phase into the other.
    #[inline]
    fn push(&self, e: &Pendulum<T>, commands: &Commands<T>) -> Push<T> {
        let per_v = self.drive_per_s * self.per_amplitude;
        let lead = -(T::half() * e.l / e.e);
        let (along, aside, quadrature) =
            (-(commands.energy_v * per_v), -(commands.precession_v * per_v), commands.quadrature_v * per_v);
        Push { along, aside: aside - lead * quadrature, quadrature: quadrature + lead * aside, across: lead * along }
    }

    fn cycles(&self, seconds: u16) -> u16 {
        #[allow(clippy::cast_possible_truncation, reason = "at most 100 a second, for seconds")]
        let cycles = ((u32::from(seconds) * self.cycles_per_65536_s) >> 16) as u16;
        cycles
    }
}
