//! A scenario recorded at the carrier: the same runs as [`Simulated::new`] makes from envelopes, by the production
//! electronics on a device that is built, not described.
//!
//! What an effect of the scenario says, the device has: gains in its plates and drives, κ as a gap, anisotropies in its
//! springs and dampers. An effect for which there is no such thing is refused.
//!
//! A row is one control step: the envelope of a window, stamped with the window's middle, and the commands computed from
//! it. Each run starts from rest and settles before t = 0.

use cvg_instrument::{Mode, Settings, Tuning, Wish};
use cvg_model::effects::EffectId;
use cvg_model::resonator::Anisotropy;

use super::{CarrierDevice, CarrierLoop};
use crate::campaign::{Column, Simulated, SimulatedRun};
use crate::scenario::Tuning as ScenarioTuning;
use crate::scenario::{Run, Scenario};

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
    let window = SAMPLE_HZ / s.control_hz;
    device.noise_v = s.noise_v * (0.5 * window).sqrt();
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
    let s = scenario.settings();
    let tuning = |t: &ScenarioTuning| Tuning { bandwidth_hz: t.bandwidth_hz, damping: t.damping };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some tens of samples")]
    let window = (SAMPLE_HZ / s.control_hz).round() as u16;
    let (rate_dps, hold_deg, off_s) = match run {
        Run::Rotation { rate_dps, profile: crate::scenario::Profile::Constant, .. } => (*rate_dps, None, f64::INFINITY),
        Run::Rotation { .. } => return Err(NotAtCarrier::Scenario("only constant rates are recorded at the carrier")),
        Run::Virtual { .. } => return Err(NotAtCarrier::Scenario("virtual precession is not recorded at the carrier")),
        Run::Ringdown { angle_deg, energy_off_s, .. } => (0.0, Some(*angle_deg), *energy_off_s),
    };
    let settings = Settings {
        carrier_hz: s.carrier_hz.unwrap_or_default(),
        sample_hz: SAMPLE_HZ,
        window,
        amplitude_v: s.amplitude_v * run.amplitude(),
        drive_per_s_v: s.drive_per_s_v,
        energy: tuning(&s.loops.energy),
        quadrature: tuning(&s.loops.quadrature),
        phase: tuning(&s.loops.phase),
        rate: tuning(&s.loops.rate),
        hold_rad: hold_deg.unwrap_or(0.0).to_radians(),
        ..Settings::default()
    };
    let mut closed = CarrierLoop::<f64>::new(device, &settings).map_err(NotAtCarrier::Settings)?;
    let wish = if hold_deg.is_some() { Wish::Hold } else { Wish::WholeAngle };
    closed.state.wish(wish);
    closed.plant.set_rate(rate_dps.to_radians());
    let steps = |time_s: f64| crate::closed_loop::samples(time_s, settings.window_s());
    for _ in 0..steps(START_S + SETTLE_S) {
        control_step(&mut closed);
    }
    let operating = if hold_deg.is_some() { Mode::Hold } else { Mode::WholeAngle };
    let mode = closed.state.supervisor.mode;
    if mode != operating {
        return Err(NotAtCarrier::NoStart { file: run.file().to_owned(), mode });
    }
    let names = ["t_s", "rate_dps", "xc_v", "xs_v", "yc_v", "ys_v", "vas_v", "vqc_v"];
    let mut columns = names.map(|name| Column { name, values: Vec::new() });
    let (every, off_at) = (scenario.control_samples_per_row(), off_s / settings.window_s());
    for k in 0..scenario.control_samples(run) {
        #[allow(clippy::cast_precision_loss, reason = "2^53 samples are not reached")]
        let at = k as f64;
        if at >= off_at {
            closed.state.wish(Wish::RingDown);
        }
        control_step(&mut closed);
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

/// Samples up to and including the one with which a control step is made.
fn control_step(closed: &mut CarrierLoop<f64>) {
    while !closed.step().fresh {}
}
