//! Runs whose displacements are recorded, `x_v` and `y_v` of every sample of the converters, as an oscilloscope at the
//! pick-offs saves them.
//!
//! A free decay is the resonator alone behind its plates and converters; a rotation is driven by the production electronics,
//! and begins when these have started and settled. What cannot be built, or does not start, is refused before anything is
//! recorded.

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
    let settings = settings_at(scenario, run, None, sample_hz);
    match run {
        Run::Rotation { rate_dps, .. } => started(&device, &settings, run, *rate_dps, spring(scenario.settings())),
        Run::Decay { rate_dps, start_deg, quadrature, .. } => {
            let mut rings = CarrierLoop::new(&device, &settings).map_err(NotAtCarrier::Settings)?;
            let a = settings.amplitude_v;
            let orbit = Orbit { a, q: a * quadrature, theta: start_deg.to_radians(), delta: 0.0 };
            rings.plant.set_rate(rate_dps.to_radians());
            rings.plant.set_vibration(&orbit.envelope());
            Ok(rings)
        }
        Run::Ringdown { .. } | Run::Virtual { .. } => {
            Err(NotAtCarrier::Scenario("displacements are recorded of rotations and of free decays"))
        }
    }
}

/// Names of the columns of a run.
pub(crate) fn names(run: &Run) -> Vec<&'static str> {
    match run {
        Run::Rotation { profile: Profile::ThereAndBack, .. } => vec!["t_s", "rate_dps", "x_v", "y_v", "vas_v", "vqc_v"],
        Run::Rotation { .. } => vec!["t_s", "x_v", "y_v", "vas_v", "vqc_v"],
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
    let spring = spring(scenario.settings());
    let names = names(run);
    let mut columns: Vec<Column> = names.iter().map(|&name| Column { name, values: Vec::new() }).collect();
    for k in 0..count {
        if back_at == Some(k) {
            closed.plant.set_rate(-rate_dps.to_radians());
        }
        let mut volts = [0.0; 2];
        if matches!(run, Run::Rotation { .. }) {
            closed.step_through(|v| {
                volts = v;
                v
            });
        } else {
            volts = closed.step_without_electronics();
        }
        if let Some(spring) = &spring {
            closed.plant.bend(spring);
        }
        let seen = &closed.state.seen;
        for column in &mut columns {
            #[allow(clippy::cast_precision_loss, reason = "2^53 samples are not reached")]
            let value = match column.name {
                "t_s" => k as f64 / sample_hz,
                "rate_dps" if back_at.is_some_and(|at| k >= at) => -rate_dps,
                "rate_dps" => rate_dps,
                "x_v" => volts[0],
                "y_v" => volts[1],
                "vas_v" => seen.v_as,
                _ => seen.v_qc,
            };
            column.values.push(value);
        }
    }
    columns
}
