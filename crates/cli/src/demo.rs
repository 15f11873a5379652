//! `cvg demo`: the paper's device, simulated, identified from the files, compensated, and set beside the paper.

use std::path::Path;

use cvg_calibration::Identification;
use cvg_calibration::recording::Campaign;
use cvg_simulator::Scenario;

use crate::{Failure, clouds, commands, output, report};

/// Points of the figure that the README shows.
const README_POINTS: usize = 900;

/// Runs the demonstration into `out`.
pub(crate) fn demo(out: &Path, json: bool) -> Result<(), Failure> {
    output::check_folder(out)?;
    output::tell(format_args!("simulating the paper's device into {}", out.join("campaign").display()));
    let set = output::Set::begin(out, &[])?;
    let campaign = set.folder().join("campaign");
    Scenario::paper().simulate().write(&campaign).map_err(Failure::input)?;
    output::tell(format_args!("identifying it from its recordings"));
    let identified = commands::run(|| Ok(Campaign::open(&campaign.join("campaign.toml"))?))?;
    for (name, text) in commands::RESULTS.into_iter().zip(commands::results(&identified)?) {
        set.add(name, text.as_bytes())?;
    }
    set.add("bias.svg", clouds::bias_svg(&identified, README_POINTS, true)?.as_bytes())?;
    set.commit()?;
    if json {
        output::answer(&format!("{}\n", report::json(&identified)?))?;
        return Ok(());
    }
    output::answer(&report::summary::summary(&identified))?;
    output::answer(&beside_the_paper(&identified))?;
    output::tell(format_args!("wrote {}", out.join("report.html").display()));
    Ok(())
}

/// The paper's numbers beside those of this run.
fn beside_the_paper(identified: &Identification) -> String {
    use std::fmt::Write as _;
    let r = &identified.report;
    let mut s = String::new();
    let percent = |e: &Option<cvg_calibration::report::Estimate>| {
        e.as_ref().map_or("—".to_owned(), |e| format!("{:.3} %", (e.value - 1.0) * 100.0))
    };
    let rows = [
        ("detection gain mismatch", "1.32 %".to_owned(), percent(&r.detection_gain_ratio)),
        ("actuation gain mismatch", "1.13 %".to_owned(), percent(&r.actuation_gain_ratio)),
        ("reduction of the bias, declared", "10 ×".to_owned(), ratio(r.heldout.raw, r.heldout.declared.rms_deg)),
        ("bias after it, peak", "0.06°".to_owned(), format!("{:.4}°", r.heldout.declared.peak_deg)),
        ("what is left", "4θ, a guess".to_owned(), found(identified)),
        ("bias after that, peak", "—".to_owned(), format!("{:.4}°", r.heldout.discovered.peak_deg)),
        ("reduction of the bias, in all", "—".to_owned(), ratio(r.heldout.raw, r.heldout.discovered.rms_deg)),
    ];
    let _ = writeln!(s, "\n  {:<34}{:<16}this run", "", "the paper");
    for (what, paper, ours) in rows {
        let _ = writeln!(s, "  {what:<34}{paper:<16}{ours}");
    }
    s
}

fn ratio(raw: Option<cvg_calibration::ErrorSize>, after_rms_deg: f64) -> String {
    raw.map_or("—".into(), |raw| format!("{:.0} ×", raw.rms_deg / after_rms_deg))
}

fn found(identified: &Identification) -> String {
    let names: Vec<&str> = identified
        .report
        .effects
        .iter()
        .filter(|e| e.origin != cvg_calibration::Origin::Declared)
        .map(|e| e.id.as_str())
        .collect();
    if names.is_empty() { "nothing".into() } else { names.join(", ") }
}
