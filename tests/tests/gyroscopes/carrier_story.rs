//! The paper's story at the carrier: the device with 1.32 % and 1.13 % mismatch and parallel plates, recorded by the
//! production electronics, identified from its files.

use cvg_calibration::{Identification, Origin};
use cvg_model::effects::EffectId;
use cvg_simulator::{Scenario, carrier};
use cvg_tests::bench::{found, identify_folder, over_floor};

/// The scenario of the paper's device. The carrier is no simple ratio of the converters' rate, as no real one is: the
/// plates' third harmonic, of which a window leaves some 10⁻⁵, would otherwise be the same in every row.
fn scenario(kappa: f64) -> Scenario {
    let mut settings = Scenario::paper().settings().clone();
    settings.carrier_hz = Some(15_213.7);
    for effect in settings.effects.iter_mut().filter(|e| e.id == EffectId::DetectionCubic) {
        effect.values[0] = kappa;
    }
    Scenario::new(settings).unwrap_or_else(|e| panic!("{e}"))
}

/// Recorded at the carrier, written, identified from the files; the truth is not among them.
fn identified(scenario: &Scenario) -> Identification {
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = carrier::campaign::record(scenario).unwrap_or_else(|e| panic!("{e}"));
    recorded.write(folder.path()).unwrap_or_else(|e| panic!("{e}"));
    std::fs::remove_file(folder.path().join("truth.toml")).expect("written");
    let identified = identify_folder(folder.path()).unwrap_or_else(|e| panic!("{e}"));
    let report = &identified.report;
    for effect in &report.effects {
        for p in &effect.parameters {
            println!("{} ({:?}): {} = {} {:?}", effect.id, effect.origin, p.name, p.value, p.ci95);
        }
    }
    let h = &report.heldout;
    println!(
        "held-out rms {}° declared, {}° after all, floor {}°",
        h.declared.rms_deg, h.discovered.rms_deg, h.noise_floor_deg
    );
    identified
}

fn kappa(identified: &Identification) -> [f64; 2] {
    let cubic = identified.report.effects.iter().find(|e| e.id == "detection-cubic").expect("found");
    let kappa = cubic.parameters.iter().find(|p| p.name == "kappa").expect("its parameter");
    kappa.ci95.expect("an interval")
}

fn the_story_is_told(identified: &Identification) {
    let report = &identified.report;
    let detection = report.detection_gain_ratio.as_ref().expect("a detection ratio");
    let actuation = report.actuation_gain_ratio.as_ref().expect("an actuation ratio");
    assert!((detection.value - 1.0132).abs() <= 1e-4, "{detection:?}");
    assert!((actuation.value - 1.0113).abs() <= 3e-4, "{actuation:?}");
    assert_eq!(found(identified, Origin::Discovered), ["detection-cubic"]);
    assert_eq!(found(identified, Origin::Empirical), [""; 0]);
    assert!(over_floor(identified) <= 1.3, "{} times the floor", over_floor(identified));
}

/// The gap of the paper's κ. The plates are no cubic: v = x + κx³ + κ²x⁵ + …, whose first harmonic is that of a cubic
/// with κ(1 + ⅚κa²) in the place of κ. The runs are at the amplitudes 1 V and 0.6 V.
#[test]
fn paper_the_carriers_recording_tells_the_mismatches_and_the_plates() {
    let scenario = scenario(0.004);
    let identified = identified(&scenario);
    the_story_is_told(&identified);
    let gap = carrier::campaign::device(&scenario).unwrap_or_else(|e| panic!("{e}")).gap;
    let of_the_gap = |amplitude: f64| (1.0 + 5.0 / 6.0 * (amplitude / gap).powi(2)) / (gap * gap);
    let [low, high] = kappa(&identified);
    assert!(
        low <= of_the_gap(1.0) && of_the_gap(0.6) <= high,
        "{} to {}: [{low}, {high}]",
        of_the_gap(0.6),
        of_the_gap(1.0)
    );
}

/// At twice the gap, what the plates are besides a cubic is below the precision of the recording: κ = 1/gap².
#[test]
fn the_carriers_recording_tells_the_gap() {
    let scenario = scenario(0.001);
    let identified = identified(&scenario);
    the_story_is_told(&identified);
    let gap = carrier::campaign::device(&scenario).unwrap_or_else(|e| panic!("{e}")).gap;
    let [low, high] = kappa(&identified);
    assert!(low <= 1.0 / (gap * gap) && 1.0 / (gap * gap) <= high, "1/gap² = {}: [{low}, {high}]", 1.0 / (gap * gap));
}
