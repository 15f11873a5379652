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

/// The columns of the run at `index`; none where it cannot be begun, which no scenario that exists has.
pub(crate) fn record(scenario: &Scenario, index: usize, run: &Run, sample_hz: f64) -> Vec<Column> {
    let Ok(mut closed) = begin(scenario, index, run, sample_hz) else { return Vec::new() };
    let count = samples(run.duration_s(), 1.0 / sample_hz);
    let (rate_dps, back_at) = match run {
        Run::Rotation { rate_dps, profile: Profile::ThereAndBack, .. } => (*rate_dps, Some(count / 2)),
        _ => (0.0, None),
    };
    let is_driven = matches!(run, Run::Rotation { .. });
    let spring = spring(scenario.settings());
    let (mut t_s, mut x, mut y, mut rates) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut commands = [Vec::new(), Vec::new()];
    for k in 0..count {
        let is_back = back_at.is_some_and(|at| k >= at);
        if back_at == Some(k) {
            closed.plant.set_rate(-rate_dps.to_radians());
        }
        let mut volts = [0.0; 2];
        if is_driven {
            closed.step_through(|v| {
                volts = v;
                v
            });
            commands[0].push(closed.state.seen.v_as);
            commands[1].push(closed.state.seen.v_qc);
        } else {
            volts = closed.step_without_electronics();
        }
        if let Some(spring) = &spring {
            closed.plant.bend(spring);
        }
        #[allow(clippy::cast_precision_loss, reason = "2^53 samples are not reached")]
        t_s.push(k as f64 / sample_hz);
        x.push(volts[0]);
        y.push(volts[1]);
        if back_at.is_some() {
            rates.push(if is_back { -rate_dps } else { rate_dps });
        }
    }
    let [v_as, v_qc] = commands;
    let columns = [("t_s", t_s), ("rate_dps", rates), ("x_v", x), ("y_v", y), ("vas_v", v_as), ("vqc_v", v_qc)];
    columns.into_iter().filter(|(_, v)| !v.is_empty()).map(|(name, values)| Column { name, values }).collect()
}
