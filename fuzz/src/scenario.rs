//! Any text as a scenario: read or refused, never a panic; what is read and is not too long is simulated.

use cvg_simulator::Scenario;

/// Steps of a simulation that are waited for.
const MOST_STEPS: f64 = 20_000.0;

pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(scenario) = Scenario::parse(text) else { return };
    let settings = scenario.settings();
    let steps: f64 = settings.runs.iter().map(|run| scenario.control_samples(run) as f64).sum();
    let warm_up = settings.warm_up_s * settings.control_hz * settings.runs.len() as f64;
    if steps + warm_up > MOST_STEPS || settings.runs.len() > 4 {
        return;
    }
    let _ = scenario.simulate();
}
