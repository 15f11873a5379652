//! Whether runs whose displacements are recorded can be: what is built at the carrier, and whether it starts.

use super::{Reference, Run, Scenario, ScenarioError};
use crate::carrier::displacement;

/// The most samples a second at which electronics are started, 1/s.
const FASTEST_ELECTRONICS_HZ: f64 = 2e6;

/// Refuses what a device at the carrier does not have, and runs that do not start.
pub(super) fn check(scenario: &Scenario) -> Result<(), ScenarioError> {
    let s = scenario.settings();
    for (index, run) in s.runs.iter().enumerate() {
        let Some(sample_hz) = run.carrier_sample_hz() else { continue };
        let field = |key: &str| format!("run {:?}: {key}", run.file());
        let there = [
            ("force_noise_v", s.force_noise_v > 0.0),
            ("gain_flicker", s.gain_flicker > 0.0),
            ("table_wander", s.table_wander > 0.0),
            ("temperature", s.temperature.is_some()),
            ("compensation", !s.compensation.is_empty()),
            ("theta_deg", s.theta_deg),
        ];
        if let Some((key, _)) = there.iter().find(|(_, is_there)| *is_there) {
            return Err(ScenarioError::invalid(*key, "is not built at the carrier, which a run asks for"));
        }
        let window = sample_hz / s.control_hz;
        if (window - window.round()).abs() > 1e-9 * window || window < 0.5 {
            return Err(ScenarioError::invalid(
                field("carrier_sample_hz"),
                format!("{sample_hz} is no multiple of control_hz = {}", s.control_hz),
            ));
        }
        if sample_hz > FASTEST_ELECTRONICS_HZ && !matches!(run, Run::Decay { .. }) {
            return Err(ScenarioError::invalid(
                field("carrier_sample_hz"),
                format!("{sample_hz} is more than the {FASTEST_ELECTRONICS_HZ} of the fastest electronics"),
            ));
        }
        if let Run::Rotation { start_deg, reference, .. } = run {
            if start_deg.is_some() {
                return Err(ScenarioError::invalid(
                    field("start_deg"),
                    "is up to the electronics, which start from rest",
                ));
            }
            if *reference != Reference::Rate {
                return Err(ScenarioError::invalid(field("reference"), "is \"rate\" at the carrier"));
            }
        }
        displacement::begin(scenario, index, run, sample_hz)
            .map_err(|e| ScenarioError::invalid(field("carrier_sample_hz"), e.to_string()))?;
    }
    Ok(())
}
