//! For researchers, and for who prepares a campaign: what each further run tells, by simulating it and looking.
//!
//! `cargo run --release -p cvg-examples --bin which_runs` prints the tables of "Prepare a campaign" in the book. The device
//! is the paper's, with a cubic readout; its runs are added one after the other, then all of them made shorter and longer.

use std::error::Error;

use cvg_calibration::recording::Campaign;
use cvg_calibration::report::Report;
use cvg_calibration::{Options, Origin, identify};
use cvg_simulator::scenario::{Purpose, Run};
use cvg_simulator::{Scenario, Settings};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// What a campaign of these settings tells.
fn told(settings: Settings) -> Result<Report> {
    let folder = tempfile::tempdir()?;
    Scenario::new(settings)?.simulate().write(folder.path())?;
    let campaign = Campaign::open(&folder.path().join("campaign.toml"))?;
    Ok(identify(campaign, &Options::default())?.report)
}

/// The paper's device under the runs that are fitted, in the order in which they are worth making.
fn device() -> Settings {
    let mut settings = Scenario::paper().settings().clone();
    settings.runs.retain(|run| !matches!(run, Run::Rotation { purpose: Purpose::Holdout, .. }));
    settings
}

/// The half width of the interval of an effect's first parameter.
fn half_width(report: &Report, id: &str) -> Option<f64> {
    let [low, high] = report.effects.iter().find(|e| e.id == id)?.parameters.first()?.ci95?;
    Some(0.5 * (high - low))
}

fn cell(value: Option<f64>) -> String {
    value.map_or("—".to_owned(), |v| format!("± {v:.1e}"))
}

fn row(name: &str, report: &Report) -> String {
    let found: Vec<String> = report
        .effects
        .iter()
        .filter(|e| e.origin != Origin::Declared)
        .map(|e| format!("`{}`{}", e.id, if e.origin == Origin::Empirical { ", no cause claimed" } else { "" }))
        .collect();
    let found = if found.is_empty() { "nothing".to_owned() } else { found.join("; ") };
    format!(
        "| {name} | {} | {} | {} | {found} |",
        cell(report.detection_gain_ratio.map(|e| e.half_width())),
        cell(half_width(report, "anisodamping")),
        cell(report.actuation_gain_ratio.map(|e| e.half_width())),
    )
}

/// The same run in another length; a ring-down keeps the time before the energy loop goes off.
fn stretched(run: &Run, by: f64) -> Run {
    let mut run = run.clone();
    match &mut run {
        Run::Rotation { duration_s, .. } | Run::Decay { duration_s, .. } | Run::Virtual { duration_s, .. } => {
            *duration_s *= by;
        }
        Run::Ringdown { duration_s, energy_off_s, .. } => {
            *duration_s = *energy_off_s + (*duration_s - *energy_off_s) * by;
        }
    }
    run
}

fn main() -> Result<()> {
    let device = device();
    println!("| runs | detection ratio | anisodamping [1/s] | actuation ratio | found besides |");
    println!("| --- | --- | --- | --- | --- |");
    let with = |count: usize| Settings { runs: device.runs[..count].to_vec(), ..device.clone() };
    let all = device.runs.len();
    for (name, count) in [
        ("500 deg/s", 1),
        ("… and −500 deg/s", 2),
        ("… and 200 deg/s", 3),
        ("… and 60 deg/s", 4),
        ("… and 500 deg/s at 0.6 of the amplitude", 5),
        ("… and ring-downs at 0° and 90°", all),
    ] {
        println!("{}", row(name, &told(with(count))?));
    }
    println!("\n| length of each run | detection ratio | anisodamping [1/s] | actuation ratio | found besides |");
    println!("| --- | --- | --- | --- | --- |");
    for by in [0.25, 0.5, 1.0, 2.0] {
        let settings = Settings { runs: device.runs.iter().map(|r| stretched(r, by)).collect(), ..device.clone() };
        let minutes = settings.runs.iter().map(Run::duration_s).sum::<f64>() / 60.0;
        println!("{}", row(&format!("× {by}, {minutes:.1} min in all"), &told(settings)?));
    }
    Ok(())
}
