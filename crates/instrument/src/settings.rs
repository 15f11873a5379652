//! What an instrument is told of its device, its converters and its loops, and the check that it can be built so.

use core::f64::consts::{FRAC_PI_4, PI, SQRT_2, TAU};

use cvg_controller::{ActuationCompensation, Allocation, Heading, Mode, Pi, RateLoop, Supervisor, SupervisorSettings};
use cvg_estimator::{Compensation, Demodulator, Oscillator, PhaseLock, Precession};
use cvg_model::effects::{EffectId, MAX_PARAMETERS, Values};
use cvg_model::{Float, Real};

use crate::delay::Delay;
use crate::{Instrument, MOST_COMPENSATED};

/// Why settings were refused.
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

impl From<cvg_estimator::ConfigError> for ConfigError {
    fn from(e: cvg_estimator::ConfigError) -> Self {
        Self { parameter: e.parameter, expected: e.expected }
    }
}

impl From<cvg_controller::ConfigError> for ConfigError {
    fn from(e: cvg_controller::ConfigError) -> Self {
        Self { parameter: e.parameter, expected: e.expected }
    }
}

/// Tuning of one loop: its closed-loop natural frequency and damping ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// ω_n/2π, Hz
    pub bandwidth_hz: f64,
    /// ζ
    pub damping: f64,
}

/// What an instrument is told. The default is a dual-foucault-pendulum-like device at 15.2 kHz with converters at 100 kHz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings<'a> {
    /// nominal frequency of the resonator, Hz
    pub carrier_hz: f64,
    /// half the width of the band in which the resonator is searched, relative to the carrier
    pub band: f64,
    /// rate of the converters, Hz
    pub sample_hz: f64,
    /// samples a window, the time from one control step to the next
    pub window: u16,
    /// the analogue-to-digital converters' range is ±this, V
    pub adc_full_scale_v: f64,
    /// no command of a digital-to-analogue converter is beyond ±this, V
    pub dac_limit_v: f64,
    /// from the vibration to the sample that shows it, s
    pub readout_delay_s: f64,
    /// from a sample to the output that is computed from it, s
    pub drive_delay_s: f64,
    /// set amplitude, V
    pub amplitude_v: f64,
    /// b = G_A/2ω: the envelope's rate per volt of drive, both at the converters, 1/s per V
    pub drive_per_s_v: f64,
    /// energy loop
    pub energy: Tuning,
    /// quadrature loop
    pub quadrature: Tuning,
    /// phase-locked loop
    pub phase: Tuning,
    /// rate loop, which holds the pattern
    pub rate: Tuning,
    /// the angle at which the pattern is held, rad
    pub hold_rad: f64,
    /// the fastest precession that is no jump, rad/s
    pub fastest_rad_s: f64,
    /// amplitude above which something vibrates, V
    pub detection_threshold_v: f64,
    /// time of the first sweep, s
    pub sweep_s: f64,
    /// readout effects that are undone; not those that are told by the time of a recording: of its clock the electronics
    /// know nothing
    pub readout: &'a [(EffectId, Values<f64>)],
    /// actuation effects that are undone
    pub actuation: &'a [(EffectId, Values<f64>)],
}

impl Default for Settings<'_> {
    fn default() -> Self {
        let tuning = |bandwidth_hz, damping| Tuning { bandwidth_hz, damping };
        Self {
            carrier_hz: 15_200.0,
            band: 0.024,
            sample_hz: 100_000.0,
            window: 50,
            adc_full_scale_v: 2.5,
            dac_limit_v: 10.0,
            readout_delay_s: 0.0,
            drive_delay_s: 5e-6,
            amplitude_v: 1.0,
            drive_per_s_v: 1.0,
            energy: tuning(2.0, 0.7),
            quadrature: tuning(5.0, 0.7),
            phase: tuning(20.0, 1.0),
            rate: tuning(2.0, 1.0),
            hold_rad: 0.0,
            fastest_rad_s: 35.0,
            detection_threshold_v: 0.02,
            sweep_s: 0.4,
            readout: &[],
            actuation: &[],
        }
    }
}

impl Settings<'_> {
    /// A window, s: the period of the control step.
    pub fn window_s(&self) -> f64 {
        f64::from(self.window) / self.sample_hz
    }

    /// How old an envelope is when the last sample of its window is taken, s.
    pub fn group_delay_s(&self) -> f64 {
        0.5 * (f64::from(self.window) - 1.0) / self.sample_hz + self.readout_delay_s
    }

    /// The drive gain with the converter's hold: b sin(x)/x, x = half the carrier's phase step.
    fn held_drive_per_s_v(&self) -> f64 {
        let x = PI * self.carrier_hz / self.sample_hz;
        self.drive_per_s_v * Real::sin_cos(x).0 / x
    }

    /// Each value by itself is one that there can be.
    fn require_domain(&self) -> Result<(), ConfigError> {
        let positive = [
            (self.carrier_hz, "carrier_hz"),
            (self.sample_hz, "sample_hz"),
            (self.adc_full_scale_v, "adc_full_scale_v"),
            (self.dac_limit_v, "dac_limit_v"),
            (self.amplitude_v, "amplitude_v"),
            (self.drive_per_s_v, "drive_per_s_v"),
        ];
        for (value, parameter) in positive {
            if !(value > 1e-9 && value < 1e9) {
                return Err(ConfigError { parameter, expected: "between 1e-9 and 1e9" });
            }
        }
        if self.amplitude_v > 0.9 * self.adc_full_scale_v {
            return Err(ConfigError { parameter: "amplitude_v", expected: "at most 0.9 of adc_full_scale_v" });
        }
        let period_s = 1.0 / self.sample_hz;
        for (value, parameter) in [(self.readout_delay_s, "readout_delay_s"), (self.drive_delay_s, "drive_delay_s")] {
            if !(value >= 0.0 && value <= 10.0 * period_s) {
                return Err(ConfigError { parameter, expected: "not negative and at most ten samples" });
            }
        }
        Ok(())
    }

    fn supervisor(&self) -> SupervisorSettings {
        SupervisorSettings {
            window_s: self.window_s(),
            amplitude_v: self.amplitude_v,
            detection_threshold_v: self.detection_threshold_v,
            band_rad_s: TAU * self.carrier_hz * self.band,
            sweep_s: self.sweep_s,
            sweeps: 3,
            listen_s: 32.0 * self.window_s(),
            lock_s: 1.0,
            spin_up_s: 5.0,
            coast_s: 0.1,
            fault_debounce_s: 0.3,
            rest_s: 0.5,
            retries: 3,
            fault_memory_s: 10.0,
        }
    }
}

impl<T: Float> Instrument<T> {
    /// The instrument of these settings.
    ///
    /// # Errors
    /// The first parameter that is outside its domain, or that the others make impossible.
    pub fn new(s: &Settings<'_>) -> Result<Self, ConfigError> {
        s.require_domain()?;
        let period_s = 1.0 / s.sample_hz;
        let demodulator = Demodulator::new(s.window, s.adc_full_scale_v)?;
        let window_s = s.window_s();
        let omega = TAU * s.carrier_hz;
        let band_rad_s = omega * s.band;
        // the pull-in of the phase loop may go beyond the band in which the resonator is searched
        let limit_rad_s = 1.1 * band_rad_s;
        if limit_rad_s * window_s >= PI {
            return Err(ConfigError {
                parameter: "window",
                expected: "so short that the band turns less than half a turn in it",
            });
        }
        let oscillator = Oscillator::new(s.carrier_hz, period_s, limit_rad_s)?;
        let t = T::from_f64;
        let drive = s.held_drive_per_s_v();
        // two phases of one channel at this limit are the converter's limit together
        let limit_v = s.dac_limit_v / SQRT_2;
        let pi = |tuning: Tuning| {
            Pi::tuned(
                t(TAU * tuning.bandwidth_hz),
                t(tuning.damping),
                t(s.amplitude_v),
                t(drive),
                t(window_s),
                t(limit_v),
            )
        };
        let rate = RateLoop::tuned(
            t(TAU * s.rate.bandwidth_hz),
            t(s.rate.damping),
            t(drive),
            t(drive * limit_v / s.amplitude_v),
            t(window_s),
            t(limit_v),
        )?;
        let phase = PhaseLock::new(t(TAU * s.phase.bandwidth_hz), t(s.phase.damping), t(window_s), t(limit_rad_s))?;
        let hold_s = 0.5 * window_s;
        let lead_s = s.group_delay_s() + s.drive_delay_s + hold_s;
        let precession =
            Precession::new(window_s, 16.0 * window_s, s.fastest_rad_s, 0.1, lead_s, 0.2 * s.detection_threshold_v)?;
        refuse_another_days_clock(s.readout)?;
        let mut effects = [(EffectId::DetectionGainMismatch, [T::zero(); MAX_PARAMETERS]); MOST_COMPENSATED];
        let readout = converted(s.readout, &mut effects)?;
        let readout = if readout.is_empty() { None } else { Some(Compensation::new(readout)?) };
        let actuation = converted(s.actuation, &mut effects)?;
        let actuation = if actuation.is_empty() { None } else { Some(ActuationCompensation::new(actuation)?) };
        // the hold's middle is half a sample after its beginning
        let delay_s = s.readout_delay_s + s.drive_delay_s + 0.5 * period_s;
        let allocation = Allocation::new(actuation, t(limit_v))?;
        Ok(Self {
            oscillator,
            demodulator,
            phase,
            precession,
            readout,
            energy: pi(s.energy)?,
            quadrature: pi(s.quadrature)?,
            rate,
            shortest: if allocation.turns() { Mode::Fault } else { Mode::WholeAngle },
            allocation,
            supervisor: Supervisor::new(&s.supervisor())?,
            most_unseen: most_unseen(s.fastest_rad_s * window_s),
            energy_set_v2: t(s.amplitude_v * s.amplitude_v),
            sweep_v: t(limit_v),
            dac_limit_v: t(s.dac_limit_v),
            delay: Delay::new(delay_s, omega, limit_rad_s)?,
            per_window_s: t(1.0 / window_s),
            hold: Heading::new(t(s.hold_rad))?,
        })
    }

    /// How old an envelope is when the last sample of its window is taken, in samples, the readout's delay aside.
    pub fn group_delay_samples(&self) -> f64 {
        self.demodulator.group_delay_samples()
    }
}

/// Windows in which a pattern that turns by `fastest_rad` in one does not turn by 45 degrees.
fn most_unseen(fastest_rad: f64) -> u32 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, and NaN is 0")]
    let windows = (FRAC_PI_4 / fastest_rad) as u32;
    windows
}

//= specs/dsp.md#clock-of-another-day
//# An effect that is told by the time of a recording MUST be refused where the electronics compensate.
/// What is told by the clock of a recording says nothing of another day.
fn refuse_another_days_clock(readout: &[(EffectId, [f64; MAX_PARAMETERS])]) -> Result<(), ConfigError> {
    if readout.iter().any(|(id, _)| id.in_time() || id.by_temperature()) {
        let expected = "free of what is told by a recording's clock or its thermometer";
        return Err(ConfigError { parameter: "readout", expected });
    }
    Ok(())
}

/// The effects with values in this scalar.
fn converted<'b, T: Float>(
    effects: &[(EffectId, Values<f64>)],
    room: &'b mut [(EffectId, Values<T>); MOST_COMPENSATED],
) -> Result<&'b [(EffectId, Values<T>)], ConfigError> {
    let Some(used) = room.get_mut(..effects.len()) else {
        return Err(ConfigError { parameter: "readout", expected: "no more effects than MOST_COMPENSATED" });
    };
    for (place, (id, values)) in used.iter_mut().zip(effects) {
        *place = (*id, values.map(T::from_f64));
    }
    Ok(used)
}
