//! Any text as a scenario: read or refused, never a panic; what is read and is not too long is simulated.

use cvg_simulator::Scenario;
use cvg_simulator::scenario::Run;

/// Steps of a simulation that are waited for.
const MOST_STEPS: f64 = 20_000.0;

pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(scenario) = Scenario::parse(text) else { return };
    let settings = scenario.settings();
    let samples = |run: &Run| run.carrier_sample_hz().map_or(0.0, |hz| hz * run.duration_s());
    let steps: f64 = settings.runs.iter().map(|run| samples(run) + scenario.control_samples(run) as f64).sum();
    let warm_up = settings.warm_up_s * settings.control_hz * settings.runs.len() as f64;
    if steps + warm_up > MOST_STEPS || settings.runs.len() > 4 {
        return;
    }
    let _ = scenario.simulate();
}
