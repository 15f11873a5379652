//! Campaigns at the carrier whose forces are recorded beside the displacements: they tell what the same campaign tells as envelopes with
//! the outputs of the controllers, and without the forces do not.

use std::fmt::Write as _;

use cvg_calibration::recording::{Campaign, Run, RunKind};
use cvg_calibration::report::{Estimate, Report};
use cvg_calibration::{Options, Refusal};
use cvg_simulator::Scenario;

const DETECTION: f64 = 1.0132;
const ACTUATION: f64 = 1.0113;
const ANISODAMPING: f64 = 4.7e-3;

/// A device with both mismatches and an anisodamping, turned both ways at two rates, and rung down where `rung_down`; at so many samples of
/// the carrier a second, or as envelopes.
fn scenario(carrier_sample_hz: Option<f64>, rung_down: bool) -> Scenario {
    let mut text = format!(
        "device = \"ring\"\nangular_gain = 0.78\ncarrier_hz = 15213.7\nnoise_v = 3e-4\neffects = [\n\
         {{ id = \"detection-gain-mismatch\", detection_gain_ratio = {DETECTION} }},\n\
         {{ id = \"actuation-gain-mismatch\", actuation_gain_ratio = {ACTUATION} }},\n\
         {{ id = \"anisodamping\", anisodamping = {ANISODAMPING}, theta_tau = 27.0 }},\n\
         {{ id = \"anisoelasticity\", anisoelasticity = 0.1, theta_omega = -40.0 }},\n]\n"
    );
    let (kind, sampled) = match carrier_sample_hz {
        Some(hz) => ("parquet", format!("carrier_sample_hz = {hz:?}\n")),
        None => ("csv", String::new()),
    };
    for (rate, duration) in [(500, 6.0), (-500, 6.0), (120, 12.0), (-120, 12.0)] {
        let run = format!(
            "kind = \"rotation\"\nfile = \"rot{rate:+}.{kind}\"\nrate_dps = {rate}.0\nduration_s = {duration:?}"
        );
        let _ = writeln!(text, "[[run]]\n{run}\n{sampled}");
    }
    for angle in [0, 90].into_iter().filter(|_| rung_down) {
        let run =
            format!("kind = \"ringdown\"\nfile = \"ring-{angle}.{kind}\"\nangle_deg = {angle}.0\nenergy_off_s = 4.0");
        let _ = writeln!(text, "[[run]]\n{run}\nduration_s = 14.0\n{sampled}");
    }
    Scenario::parse(&text).unwrap_or_else(|e| panic!("{e}"))
}

/// Simulated, written, and identified from the files after `changed`; the truth is not among them.
fn identified(scenario: &Scenario, changed: impl FnOnce(&mut Campaign)) -> Result<Report, Refusal> {
    let folder = tempfile::tempdir().unwrap();
    scenario.write(folder.path()).unwrap();
    std::fs::remove_file(folder.path().join("truth.toml")).unwrap();
    let mut campaign = Campaign::open(&folder.path().join("campaign.toml"))?;
    changed(&mut campaign);
    Ok(cvg_calibration::identify(campaign, &Options::default())?.report)
}

fn ratios(report: &Report) -> [(f64, Estimate); 3] {
    let effect = report.effects.iter().find(|e| e.id == "anisodamping").unwrap();
    let p = effect.parameters.iter().find(|p| p.name == "anisodamping").unwrap();
    [
        (DETECTION, report.detection_gain_ratio.unwrap()),
        (ACTUATION, report.actuation_gain_ratio.unwrap()),
        (ANISODAMPING, Estimate { value: p.value, ci95: p.ci95.unwrap() }),
    ]
}

/// Both have what was set, and each other, and what is told at the carrier is no less precise.
fn is_told_as_by_envelopes(carrier: &Report, envelopes: &Report) {
    for ((set, one), (_, other)) in ratios(carrier).into_iter().zip(ratios(envelopes)) {
        println!("{set}: {one:?} at the carrier, {other:?} as envelopes");
        let apart = one.half_width().hypot(other.half_width());
        assert!((one.value - other.value).abs() < 1.5 * apart, "{set}: {one:?} {other:?}");
        assert!((one.value - set).abs() < 1.5 * one.half_width(), "{set}: {one:?}");
        assert!(one.half_width() < 2.0 * other.half_width(), "{set}: {one:?} {other:?}");
    }
}

#[test]
fn rotations_at_the_carrier_are_told_by_their_forces_as_envelopes_are_by_outputs() {
    let with = identified(&scenario(Some(50_000.0), false), |_| {}).unwrap();
    is_told_as_by_envelopes(&with, &identified(&scenario(None, false), |_| {}).unwrap());
    // held for 20 µs from 5 µs after a sample on: the middle of a hold is 5 µs before the sample that sees it
    let late = "fx_v and fy_v are 27.4° of the carrier behind what keeps the vibration up";
    assert_eq!(with.warnings.iter().filter(|w| w.contains(late)).count(), 4, "{:#?}", with.warnings);
    assert!(with.warnings.iter().all(|w| !w.contains("not used")), "{:#?}", with.warnings);
}

#[test]
fn ring_downs_at_the_carrier_tell_the_drives_by_their_forces_and_are_none_without() {
    let at_carrier = scenario(Some(50_000.0), true);
    let with = identified(&at_carrier, |_| {}).unwrap();
    is_told_as_by_envelopes(&with, &identified(&scenario(None, true), |_| {}).unwrap());
    let mut ring_downs = Vec::new();
    let without = identified(&at_carrier, |campaign| {
        for run in &mut campaign.runs {
            (run.recording.fx_v, run.recording.fy_v) = (None, None);
        }
        let is_ring_down = |run: &Run| matches!(run.kind, RunKind::Ringdown { .. });
        ring_downs = campaign.runs.extract_if(.., |run| is_ring_down(run)).collect();
    });
    assert!(ring_downs.iter().all(|run| run.recording.require_ringdown().is_err()));
    let widths = [&with, &without.unwrap()].map(|r| r.actuation_gain_ratio.map_or(f64::INFINITY, |e| e.half_width()));
    println!("{widths:?}");
    assert!(widths[1] > 2.0 * widths[0], "{widths:?}");
}
