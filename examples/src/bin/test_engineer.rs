//! For test engineers: recordings in, report and calibration out, and what a script would decide by.
//!
//! `cargo run -p cvg-examples --bin test_engineer -- campaign.toml`; without a campaign, one is simulated.

use std::error::Error;
use std::path::PathBuf;

use cvg_calibration::recording::Campaign;
use cvg_calibration::{Options, compensate, identify};
use cvg_simulator::Scenario;

/// An angle error that the acceptance test allows, deg rms.
const ALLOWED_DEG: f64 = 0.005;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = if let Some(path) = std::env::args().nth(1) {
        PathBuf::from(path)
    } else {
        Scenario::paper().simulate().write(folder.path())?;
        folder.path().join("campaign.toml")
    };
    let campaign = Campaign::open(&path)?;
    for run in &campaign.runs {
        println!("{}: {} rows", run.file.display(), run.recording.len());
    }
    let recordings: Vec<_> = campaign.runs.iter().map(|run| run.recording.clone()).collect();
    let identified = identify(campaign, &Options::default())?;
    let (report, held) = (&identified.report, &identified.report.heldout);
    for effect in &report.effects {
        println!("{}: {}", effect.id, effect.evidence);
    }
    for warning in &report.warnings {
        println!("warning: {warning}");
    }
    println!("held-out error {:.4}° → {:.4}° rms", held.declared.rms_deg, held.discovered.rms_deg);
    println!("{}", if held.discovered.rms_deg <= ALLOWED_DEG { "accepted" } else { "rejected" });

    // the calibration outlives this program, and is applied to any recording of the same device
    let calibration = folder.path().join("calibration.toml");
    std::fs::write(&calibration, identified.calibration.to_text())?;
    let calibration = cvg_calibration::calibration::Calibration::read(&calibration)?;
    let clean = compensate(&calibration, &recordings[0])?;
    clean.write_csv(std::fs::File::create(folder.path().join("clean.csv"))?)?;
    println!("compensated {} rows", clean.len());
    Ok(())
}
