//! Magnetic rings under Hall sensors, measured: `CVG_MEASURED` names the folder with one folder per ring.
//!
//! Nobody knows the truth of these; what is asserted is what any reading of them has to say. Their offsets exceed their
//! amplitudes, so that the raw angle does not turn.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::PathBuf;

use cvg_calibration::{Identification, Origin};
use cvg_tests::bench::{all, folder, identify_folder};

/// Rings of the set.
const RINGS: usize = 8;
/// Gains of two Hall sensors of one type, one beside the other.
const GAIN_RATIO: std::ops::Range<f64> = 0.7..1.3;

/// Every ring's folder name and what was identified; `None` where the rings are not there.
fn rings() -> Option<Vec<(String, Identification)>> {
    let is_ring = |path: &PathBuf| path.join("campaign.toml").is_file();
    let entries = fs::read_dir(folder("CVG_MEASURED")?).unwrap();
    let mut folders: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).filter(is_ring).collect();
    folders.sort();
    assert_eq!(folders.len(), RINGS, "{folders:?}");
    Some(all(folders.len() as u64, |ring| {
        let path = &folders[usize::try_from(ring).unwrap()];
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let identified = identify_folder(path).unwrap_or_else(|e| panic!("{name}: {e}"));
        (name, identified)
    }))
}

#[test]
fn measured_rings_are_centred_before_there_is_an_angle() {
    for (name, identified) in rings().unwrap_or_default() {
        let r = &identified.report;
        let ratio = r.detection_gain_ratio.unwrap_or_else(|| panic!("{name}: no detection gain ratio"));
        let ids: Vec<&str> = r.effects.iter().map(|e| e.id.as_str()).collect();
        println!(
            "{name}: gain ratio {:.4} ± {:.1e}; {ids:?}; declared {:.3}° discovered {:.3}° floor {:.3}°",
            ratio.value,
            ratio.half_width(),
            r.heldout.declared.rms_deg,
            r.heldout.discovered.rms_deg,
            r.heldout.noise_floor_deg
        );
        assert!(GAIN_RATIO.contains(&ratio.value), "{name}: gain ratio {}", ratio.value);
        assert!(r.actuation_gain_ratio.is_none(), "{name}: a sensor has no actuation");
        assert!(r.heldout.raw.is_none(), "{name}: the raw angle does not turn");
        assert!(r.warnings.iter().any(|w| w.contains("raw")), "{name}: no warning says so: {:?}", r.warnings);
        assert!(ids.contains(&"detection-offset"), "{name}: {ids:?}");
    }
}

/// Cycles of the field per turn of the ring: what the sensors see repeats with each, what drives the ring need not.
const CYCLES_PER_TURN: f64 = 25.0;
/// How far a line may be from a whole order of the ring's turn.
const ORDER: f64 = 0.03;

#[test]
fn measured_rings_show_what_turns_them_on_held_out_turns_too() {
    for (name, identified) in rings().unwrap_or_default() {
        let r = &identified.report;
        let lines = r.effects.iter().filter(|e| e.id == "time-periodic");
        let turn_hz = r.runs[0].rate_dps.unwrap() * r.angular_gain.value / 360.0 / CYCLES_PER_TURN;
        let orders: Vec<f64> = lines.clone().map(|e| e.parameters[0].value / turn_hz).collect();
        let [before, after] = [r.heldout.declared.rms_deg, r.heldout.discovered.rms_deg];
        println!("{name}: orders {orders:.3?} of the ring's turn; held-out {before:.2}° to {after:.2}°");
        // one speed: a line may be one of the ring's turn, and is not given a cause
        assert!(lines.clone().all(|e| e.origin == Origin::Empirical), "{name}");
        assert!(!orders.is_empty() && after < 0.9 * before, "{name}: {before}° to {after}°");
        for order in orders {
            assert!((order - order.round()).abs() < ORDER, "{name}: order {order}");
            assert!(order.round() % CYCLES_PER_TURN != 0.0, "{name}: order {order} is the sensors' own");
        }
    }
}
