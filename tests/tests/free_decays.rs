//! Free decays and recordings at the carrier, simulated by scenarios, written, and identified from the files.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fmt::Write as _;

use cvg_calibration::report::{Estimate, Report};
use cvg_calibration::{Identification, Origin};
use cvg_simulator::Scenario;
use cvg_tests::bench::{all, found, identify_folder, trials};

const SPLIT: f64 = core::f64::consts::TAU * 0.04;
const SPRING: f64 = 0.01;

/// A ring with a split, anisodamping and an isotropic spring, decaying from eight angles.
fn ring(seed: u64, keys: &str, of_each: &str) -> String {
    let mut text = format!(
        "device = \"ring\"\nangular_gain = 0.78\ntau_s = 22.0\ndetuning_hz = 0.05\nnoise_v = 1e-3\nseed = {seed}\n{keys}\n\
         spring_isotropic = {{ c = {SPRING} }}\n\
         effects = [\n  {{ id = \"anisodamping\", anisodamping = 4.7e-3, theta_tau = 23.0 }},\n\
         {{ id = \"anisoelasticity\", anisoelasticity = {SPLIT}, theta_omega = -40.0 }},\n]\n"
    );
    for at in 0..8 {
        let start = 22.5 * f64::from(at);
        // this way and that: at one rate nothing tells what the readout does to the orbit from mechanics
        let rate = if at % 2 == 0 { 10.0 } else { -10.0 };
        let _ = write!(text, "[[run]]\nkind = \"decay\"\nstart_deg = {start}\nrate_dps = {rate:?}\n");
        let _ = writeln!(text, "{}", of_each.replace('#', &at.to_string()));
    }
    text
}

/// Simulated, written, identified from the files; the truth is not among them.
fn identified(scenario: &str) -> Identification {
    let folder = tempfile::tempdir().unwrap();
    Scenario::parse(scenario).unwrap_or_else(|e| panic!("{e}")).write(folder.path()).unwrap();
    std::fs::remove_file(folder.path().join("truth.toml")).unwrap();
    identify_folder(folder.path()).unwrap_or_else(|e| panic!("{e}"))
}

fn parameter(report: &Report, effect: &str, name: &str) -> Estimate {
    let effect = report.effects.iter().find(|e| e.id == effect).unwrap_or_else(|| panic!("{effect} is there"));
    let p = effect.parameters.iter().find(|p| p.name == name).unwrap_or_else(|| panic!("{name} is there"));
    Estimate { value: p.value, ci95: p.ci95.unwrap_or_else(|| panic!("{name} has an interval")) }
}

/// What the ring was set to, with what was found of it.
fn set_values(report: &Report) -> [(&'static str, f64, Estimate); 8] {
    let of = |effect, name| parameter(report, effect, name);
    [
        ("1/τ", 1.0 / 22.0, report.decay.as_ref().unwrap().damping_per_s),
        ("k", 0.78, report.angular_gain),
        ("Δ(1/τ)", 4.7e-3, of("anisodamping", "anisodamping")),
        ("θ_τ", 23.0, of("anisodamping", "theta_tau")),
        ("Δω", SPLIT, of("anisoelasticity", "anisoelasticity")),
        ("θ_ω", -40.0, of("anisoelasticity", "theta_omega")),
        ("c", SPRING, of("spring-isotropic", "c")),
        ("dω/dE", -3.0 * SPRING, of("spring-isotropic", "frequency_per_energy")),
    ]
}

fn is_within(set: f64, e: &Estimate) -> bool {
    (e.ci95[0]..=e.ci95[1]).contains(&set)
}

#[test]
fn every_parameter_of_simulated_decays_stands_in_its_interval() {
    let campaigns = trials(24);
    let of_each = "file = \"decay-#.csv\"\nduration_s = 40.0";
    let keys = "control_hz = 40.0\nsample_hz = 10.0\nloops = { energy = { bandwidth_hz = 0.5, damping = 0.7 }, \
                quadrature = { bandwidth_hz = 0.5, damping = 0.7 }, phase = { bandwidth_hz = 1.0, damping = 1.0 }, \
                rate = { bandwidth_hz = 0.5, damping = 1.0 } }";
    let reports = all(campaigns, |seed| identified(&ring(100 + seed, keys, of_each)).report);
    let mut counts = [0; 8];
    for report in &reports {
        for (count, (name, set, e)) in counts.iter_mut().zip(set_values(report)) {
            *count += u64::from(is_within(set, &e));
            if name == "Δω" {
                assert!((e.value / set - 1.0).abs() < 1e-3, "{e:?}");
            }
        }
        let discovered: Vec<&str> =
            report.effects.iter().filter(|e| e.origin != Origin::Declared).map(|e| e.id.as_str()).collect();
        assert_eq!(discovered, ["spring-isotropic"]);
    }
    println!("{counts:?} of {campaigns} each");
    // three binomial deviations at 95 %, of the campaigns and of eight times as many
    let fewest = |n: u64| 0.95 * n as f64 - 3.0 * (0.95 * 0.05 * n as f64).sqrt();
    assert!(counts.iter().all(|c| *c as f64 >= fewest(campaigns)), "{counts:?}");
    let (sum, all) = (counts.iter().sum::<u64>() as f64, 8 * campaigns);
    assert!((fewest(all)..=0.95 * 2.0 * all as f64 - fewest(all)).contains(&sum), "{sum} of {all}");
}

#[test]
fn decays_at_the_carrier_tell_the_same_ring() {
    let of_each = "file = \"decay-#.parquet\"\nduration_s = 5.0\ncarrier_sample_hz = 50000.0";
    let identified = identified(&ring(3, "carrier_hz = 15200.0", of_each));
    let report = &identified.report;
    assert_eq!(found(&identified, Origin::Discovered), ["spring-isotropic"]);
    for (name, set, e) in set_values(report) {
        println!("{name}: {set} {e:?}");
        assert!((e.value - set).abs() < 2.0 * e.half_width(), "{name} = {set}: {e:?}");
    }
    let carrier = report.decay.as_ref().unwrap().carrier_hz.unwrap();
    assert!((carrier - 15_200.05).abs() < 0.1, "{carrier}");
}

#[test]
fn rotations_at_the_carrier_tell_the_mismatch() {
    let mut text = "device = \"ring\"\nangular_gain = 0.78\ncarrier_hz = 15213.7\nnoise_v = 1e-4\neffects = [\n\
                    { id = \"detection-gain-mismatch\", detection_gain_ratio = 1.0132 },\n\
                    { id = \"anisodamping\", anisodamping = 4.7e-3, theta_tau = 27.0 },\n]\n"
        .to_owned();
    for (rate, duration, kind) in [(500, 4.0, "parquet"), (-500, 4.0, "f32"), (120, 8.0, "f32")] {
        let _ = writeln!(
            text,
            "[[run]]\nkind = \"rotation\"\nfile = \"rot{rate:+}.{kind}\"\nrate_dps = {rate}.0\nduration_s = {duration:?}\n\
             carrier_sample_hz = 50000.0"
        );
    }
    let report = identified(&text).report;
    let ratio = report.detection_gain_ratio.as_ref().unwrap();
    let damping = parameter(&report, "anisodamping", "anisodamping");
    for (set, e) in [(1.0132, ratio), (0.78, &report.angular_gain), (4.7e-3, &damping)] {
        assert!((e.value - set).abs() < 2.0 * e.half_width(), "{set}: {e:?}");
    }
    assert!(ratio.half_width() < 1e-4, "{ratio:?}");
}
