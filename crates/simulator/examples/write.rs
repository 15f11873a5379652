//! Writes a scenario's campaign: `cargo run --release -p cvg-simulator --example write -- [SCENARIO.toml] DIR`.

use std::error::Error;

use cvg_simulator::Scenario;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (scenario, dir) = match arguments.as_slice() {
        [dir] => (Scenario::paper(), dir),
        [file, dir] => (Scenario::parse(&std::fs::read_to_string(file)?)?, dir),
        _ => return Err("expected [SCENARIO.toml] DIR".into()),
    };
    Ok(scenario.simulate().write(dir)?)
}
