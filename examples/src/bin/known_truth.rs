//! For researchers: a device with an effect that is known, and what an identification says of it.
//!
//! `cargo run -p cvg-examples --bin known_truth`

use std::error::Error;

use cvg_calibration::recording::Campaign;
use cvg_calibration::{Options, identify};
use cvg_model::effects::EffectId;
use cvg_simulator::{Scenario, Settings, scenario::EffectSetting};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let paper = Scenario::paper().settings().clone();
    let mut settings = Settings { device: "known".to_owned(), seed: 5, ..paper };
    settings.effects.retain(|e| e.id != EffectId::DetectionCubic);
    settings.effects.push(EffectSetting::new(EffectId::DetectionCubic, [0.01, 0.0, 0.0, 0.0])?);
    Scenario::new(settings)?.simulate().write(folder.path())?;
    let report = identify(Campaign::open(&folder.path().join("campaign.toml"))?, &Options::default())?.report;
    for effect in &report.effects {
        for p in &effect.parameters {
            println!("{}.{} = {:.5} {}", effect.id, p.name, p.value, p.unit);
        }
    }
    Ok(())
}
