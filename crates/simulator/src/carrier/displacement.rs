//! Runs whose displacements are recorded, `x_v` and `y_v` of every sample of the converters, as an oscilloscope at the
//! pick-offs saves them, and of which drives put something out that too: `fx_v` and `fy_v`, V, as an oscilloscope at the drives
//! sees them at the moment of the sample.
//!
//! A free decay is the resonator alone behind its plates and converters; rotations and ring-downs are driven by the production
//! electronics, and begin when these have started and settled. What cannot be built, or does not start, is refused before
//! anything is recorded.

use cvg_instrument::RequestedMode;
use cvg_model::Orbit;

use super::campaign::{NotAtCarrier, device_at, settings_at, started};
use super::{CarrierDevice, CarrierLoop};
use crate::campaign::Column;
use crate::closed_loop::samples;
use crate::scenario::{Profile, Run, Scenario, spring};

/// The run at `index` at t = 0, sampled `sample_hz` times a second.
///
/// # Errors
/// What the device or the electronics cannot do.
pub(crate) fn begin(
    scenario: &Scenario,
    index: usize,
    run: &Run,
    sample_hz: f64,
) -> Result<CarrierLoop<f64>, NotAtCarrier> {
    let device = device_at(scenario, sample_hz)?;
    let device = CarrierDevice { seed: device.seed.wrapping_mul(1000).wrapping_add(index as u64), ..device };
    let hold_deg = if let Run::Ringdown { angle_deg, .. } = run { Some(*angle_deg) } else { None };
    let settings = settings_at(scenario, run, hold_deg, sample_hz);
    match run {
        Run::Rotation { rate_dps, .. } => started(&device, &settings, run, *rate_dps, spring(scenario.settings())),
        Run::Ringdown { .. } => started(&device, &settings, run, 0.0, spring(scenario.settings())),
        Run::Decay { rate_dps, start_deg, quadrature, .. } => {
            let mut rings = CarrierLoop::new(&device, &settings).map_err(NotAtCarrier::Settings)?;
            let a = settings.amplitude_v;
            let orbit = Orbit { a, q: a * quadrature, theta: start_deg.to_radians(), delta: 0.0 };
            rings.plant.set_rate(rate_dps.to_radians());
            rings.plant.set_vibration(&orbit.envelope());
            Ok(rings)
        }
        Run::Virtual { .. } => {
            Err(NotAtCarrier::Scenario("displacements are recorded of rotations, ring-downs and free decays"))
        }
    }
}

/// Names of the columns of a run.
pub(crate) fn names(run: &Run) -> Vec<&'static str> {
    match run {
        Run::Rotation { profile: Profile::ThereAndBack, .. } => vec!["t_s", "rate_dps", "x_v", "y_v", "fx_v", "fy_v"],
        Run::Rotation { .. } | Run::Ringdown { .. } => vec!["t_s", "x_v", "y_v", "fx_v", "fy_v"],
        _ => vec!["t_s", "x_v", "y_v"],
    }
}

/// The columns of the run at `index`; none where it cannot be begun, which no scenario that exists has.
pub(crate) fn record(scenario: &Scenario, index: usize, run: &Run, sample_hz: f64) -> Vec<Column> {
    let Ok(mut closed) = begin(scenario, index, run, sample_hz) else { return Vec::new() };
    let count = samples(run.duration_s(), 1.0 / sample_hz);
    let (rate_dps, back_at) = match run {
        Run::Rotation { rate_dps, profile: Profile::ThereAndBack, .. } => (*rate_dps, Some(count / 2)),
        _ => (0.0, None),
    };
    let off_at = if let Run::Ringdown { energy_off_s, .. } = run { energy_off_s * sample_hz } else { f64::INFINITY };
    let spring = spring(scenario.settings());
    let names = names(run);
    let mut columns: Vec<Column> = names.iter().map(|&name| Column { name, values: Vec::new() }).collect();
    for k in 0..count {
        #[allow(clippy::cast_precision_loss, reason = "2^53 samples are not reached")]
        let at = k as f64;
        if back_at == Some(k) {
            closed.plant.set_rate(-rate_dps.to_radians());
        }
        if at >= off_at {
            closed.state.request(RequestedMode::RingDown);
        }
        let forces = closed.output_v();
        let mut volts = [0.0; 2];
        if matches!(run, Run::Decay { .. }) {
            volts = closed.step_without_electronics();
        } else {
            closed.step_through(|v| {
                volts = v;
                v
            });
        }
        if let Some(spring) = &spring {
            closed.plant.bend(spring);
        }
        for column in &mut columns {
            let value = match column.name {
                "t_s" => at / sample_hz,
                "rate_dps" if back_at.is_some_and(|at| k >= at) => -rate_dps,
                "rate_dps" => rate_dps,
                "x_v" => volts[0],
                "y_v" => volts[1],
                "fx_v" => forces[0],
                _ => forces[1],
            };
            column.values.push(value);
        }
    }
    columns
}
