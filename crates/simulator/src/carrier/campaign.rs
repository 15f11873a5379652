//! A scenario recorded at the carrier: the same runs as [`Simulated::new`] makes from envelopes, by the production
//! electronics on a device that is built, not described.
//!
//! What an effect of the scenario says, the device has: gains in its plates and drives, κ as a gap, anisotropies in its
//! springs and dampers. An effect for which there is no such thing is refused.
//!
//! A row is one control step: the envelope of a window, stamped with the window's middle, and the commands computed from
//! it. Each run starts from rest and settles before t = 0.

use cvg_instrument::{Mode, RequestedMode, Settings, Tuning};
use cvg_model::effects::EffectId;
use cvg_model::resonator::Anisotropy;

use super::{CarrierDevice, CarrierLoop};
use crate::campaign::{Column, Simulated, SimulatedRun};
use crate::scenario::Tuning as ScenarioTuning;
use crate::scenario::{Run, Scenario, spring};
use crate::stages::Spring;

/// Why a scenario cannot be recorded at the carrier.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotAtCarrier {
    /// there is no such thing in the device
    #[error("the effect {0} is not built at the carrier")]
    Effect(EffectId),
    /// the electronics refuse
    #[error("{0}")]
    Settings(cvg_instrument::ConfigError),
    /// a run's device did not start
    #[error("{file}: the device did not start but ended in {mode:?}")]
    NoStart {
        /// the run
        file: String,
        /// where it ended
        mode: Mode,
    },
    /// only gyroscopes at a stated carrier, with constant rates, have one
    #[error("{0}")]
    Scenario(&'static str),
}

/// The rate of the converters, Hz.
const SAMPLE_HZ: f64 = 100_000.0;
/// Time to start, and time to settle before t = 0, s.
const START_S: f64 = 4.0;
const SETTLE_S: f64 = 5.0;

/// The device that `scenario` describes.
///
/// # Errors
/// An effect that is not built at the carrier, a scenario without a carrier.
pub fn device(scenario: &Scenario) -> Result<CarrierDevice, NotAtCarrier> {
    device_at(scenario, SAMPLE_HZ)
}

/// The same behind converters of the rate `sample_hz`.
pub(super) fn device_at(scenario: &Scenario, sample_hz: f64) -> Result<CarrierDevice, NotAtCarrier> {
    let s = scenario.settings();
    let carrier_hz = s.carrier_hz.ok_or(NotAtCarrier::Scenario("the scenario has no carrier_hz"))?;
    let mut device = CarrierDevice { seed: s.seed, ..CarrierDevice::default() };
    device.resonator.omega_rad_s = core::f64::consts::TAU * (carrier_hz + s.detuning_hz);
    device.resonator.angular_gain = s.angular_gain;
    device.resonator.damping_per_s = 1.0 / s.tau_s;
    device.drive_per_s_v = [s.drive_per_s_v; 2];
    for effect in &s.effects {
        let [first, second, ..] = effect.values;
        match effect.id {
            EffectId::Anisodamping => device.resonator.anisodamping = Anisotropy { cos2: first, sin2: second },
            EffectId::Anisoelasticity => device.resonator.anisoelasticity = Anisotropy { cos2: first, sin2: second },
            EffectId::ActuationGainMismatch => {
                let x = first.sqrt();
                device.drive_per_s_v = [s.drive_per_s_v * x, s.drive_per_s_v / x];
            }
            EffectId::DetectionGainMismatch => device.readout_gain = [1.0, first],
            EffectId::DetectionOffset => device.offset_v = [first, second],
            // κ = 1/d², the unit of displacement being what a volt of the x channel shows
            EffectId::DetectionCubic if first > 0.0 && second == 0.0 => device.gap = 1.0 / first.sqrt(),
            other => return Err(NotAtCarrier::Effect(other)),
        }
    }
    // white noise of a control sample is that of N samples, averaged by the mixers
    let window = sample_hz / s.control_hz;
    device.noise_v = s.noise_v * (0.5 * window).sqrt();
    device.drive_delay_s = device.drive_delay_s.min(1.0 / sample_hz);
    Ok(device)
}

/// Records every run of `scenario`.
///
/// # Errors
/// What the device or the electronics cannot do.
pub fn record(scenario: &Scenario) -> Result<Simulated, NotAtCarrier> {
    let device = device(scenario)?;
    let runs = scenario.settings().runs.iter().enumerate();
    let recorded = runs.map(|(index, run)| {
        let device = CarrierDevice { seed: device.seed.wrapping_mul(1000).wrapping_add(index as u64), ..device };
        Ok(SimulatedRun { run: run.clone(), columns: record_run(scenario, &device, run)? })
    });
    Ok(Simulated { runs: recorded.collect::<Result<_, _>>()?, settings: scenario.settings().clone() })
}

fn record_run(scenario: &Scenario, device: &CarrierDevice, run: &Run) -> Result<Vec<Column>, NotAtCarrier> {
    let (rate_dps, hold_deg, off_s) = match run {
        Run::Rotation { rate_dps, profile: crate::scenario::Profile::Constant, .. } => (*rate_dps, None, f64::INFINITY),
        Run::Rotation { .. } => return Err(NotAtCarrier::Scenario("only constant rates are recorded at the carrier")),
        Run::Virtual { .. } => return Err(NotAtCarrier::Scenario("virtual precession is not recorded at the carrier")),
        Run::Decay { .. } => return Err(NotAtCarrier::Scenario("a free decay has no electronics that record it")),
        Run::Ringdown { angle_deg, energy_off_s, .. } => (0.0, Some(*angle_deg), *energy_off_s),
    };
    let settings = settings_at(scenario, run, hold_deg, SAMPLE_HZ);
    let spring = spring(scenario.settings());
    let mut closed = started(device, &settings, run, rate_dps, spring)?;
    let names = ["t_s", "rate_dps", "xc_v", "xs_v", "yc_v", "ys_v", "vas_v", "vqc_v"];
    let mut columns = names.map(|name| Column { name, values: Vec::new() });
    let (every, off_at) = (scenario.control_samples_per_row(), off_s / settings.window_s());
    for k in 0..scenario.control_samples(run) {
        #[allow(clippy::cast_precision_loss, reason = "2^53 samples are not reached")]
        let at = k as f64;
        if at >= off_at {
            closed.state.request(RequestedMode::RingDown);
        }
        control_step(&mut closed, spring);
        if k % every == 0 {
            let (seen, z) = (&closed.state.seen, &closed.state.seen.readout);
            let row = [at * settings.window_s(), rate_dps, z.x_c, z.x_s, z.y_c, z.y_s, seen.v_as, seen.v_qc];
            for (column, value) in columns.iter_mut().zip(row) {
                column.values.push(value);
            }
        }
    }
    Ok(columns.into())
}

/// The electronics of a run, with converters of the rate `sample_hz`.
pub(super) fn settings_at(scenario: &Scenario, run: &Run, hold_deg: Option<f64>, sample_hz: f64) -> Settings<'static> {
    let s = scenario.settings();
    let tuning = |t: &ScenarioTuning| Tuning { bandwidth_hz: t.bandwidth_hz, damping: t.damping };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some tens of samples; saturating")]
    let window = (sample_hz / s.control_hz).round() as u16;
    let usual = Settings::default();
    Settings {
        carrier_hz: s.carrier_hz.unwrap_or_default(),
        sample_hz,
        window,
        drive_delay_s: usual.drive_delay_s.min(1.0 / sample_hz),
        amplitude_v: s.amplitude_v * run.amplitude(),
        drive_per_s_v: s.drive_per_s_v,
        energy: tuning(&s.loops.energy),
        quadrature: tuning(&s.loops.quadrature),
        phase: tuning(&s.loops.phase),
        rate: tuning(&s.loops.rate),
        hold_rad: hold_deg.unwrap_or(0.0).to_radians(),
        ..usual
    }
}

/// The electronics of `settings` on `device`, started from rest and settled: held where they are to hold.
///
/// # Errors
/// Settings that are refused, a device that does not start.
pub(super) fn started(
    device: &CarrierDevice,
    settings: &Settings<'_>,
    run: &Run,
    rate_dps: f64,
    spring: Option<Spring>,
) -> Result<CarrierLoop<f64>, NotAtCarrier> {
    let mut closed = CarrierLoop::<f64>::new(device, settings).map_err(NotAtCarrier::Settings)?;
    let (requested, operating) = match run {
        Run::Ringdown { .. } => (RequestedMode::Hold, Mode::Hold),
        _ => (RequestedMode::WholeAngle, Mode::WholeAngle),
    };
    closed.state.request(requested);
    closed.plant.set_rate(rate_dps.to_radians());
    for _ in 0..crate::closed_loop::samples(START_S + SETTLE_S, settings.window_s()) {
        control_step(&mut closed, spring);
    }
    let mode = closed.state.supervisor.mode;
    if mode == operating { Ok(closed) } else { Err(NotAtCarrier::NoStart { file: run.file().to_owned(), mode }) }
}

/// Samples up to and including the one with which a control step is made.
fn control_step(closed: &mut CarrierLoop<f64>, spring: Option<Spring>) {
    loop {
        let status = closed.step();
        if let Some(spring) = &spring {
            closed.plant.bend(spring);
        }
        if status.fresh {
            return;
        }
    }
}
