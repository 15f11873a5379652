//! Magnetic rings under Hall sensors, measured: `CVG_MEASURED` names the folder with one folder per ring.
//!
//! Nobody knows the truth of these; what is asserted is what any reading of them has to say. Their offsets exceed their
//! amplitudes, so that the raw angle does not turn.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::PathBuf;

use cvg_calibration::Identification;
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

/// The plain ellipse a x² + b xy + c y² + d x + e y = 1 by least squares, and its gain ratio y = g (sin + s cos).
fn ellipse_ratio(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n as f64;
    let (mx, my) = (mean(x), mean(y));
    let rows = nalgebra::DMatrix::from_fn(n, 5, |i, j| {
        let (x, y) = (x[i] - mx, y[i] - my);
        [x * x, x * y, y * y, x, y][j]
    });
    let c = rows.svd(true, true).solve(&nalgebra::DVector::from_element(n, 1.0), 1e-12).unwrap();
    let inverse = nalgebra::Matrix2::new(c[0], 0.5 * c[1], 0.5 * c[1], c[2]).try_inverse().unwrap();
    let [xx, xy, yy] = [inverse[(0, 0)], inverse[(0, 1)], inverse[(1, 1)]];
    (yy / xx - (xy / xx).powi(2)).sqrt()
}

#[test]
fn measured_rings_have_the_gain_ratio_of_a_plain_ellipse() {
    let Some(folder) = folder("CVG_MEASURED") else { return };
    for (name, identified) in rings().unwrap_or_default() {
        let recording = cvg_calibration::recording::Recording::read(&folder.join(&name).join("spin.csv")).unwrap();
        let (x, y) = (recording.xc_v.unwrap(), recording.yc_v.unwrap());
        let fitted = x.len() * 3 / 4;
        let plain = ellipse_ratio(&x[..fitted], &y[..fitted]);
        let ratio = identified.report.detection_gain_ratio.unwrap();
        println!("{name}: {:.4} ± {:.4}, plain ellipse {plain:.4}", ratio.value, ratio.half_width());
        assert!(ratio.ci95[0] < plain && plain < ratio.ci95[1], "{name}: {ratio:?} {plain}");
        assert!(ratio.half_width() < 0.06, "{name}: {ratio:?}");
    }
}

#[test]
fn measured_rings_are_not_corrected_for_what_their_drive_does() {
    for (name, identified) in rings().unwrap_or_default() {
        let r = &identified.report;
        assert!(r.effects.iter().all(|e| e.id.starts_with("detection-")), "{name}: {:#?}", r.effects);
        assert!(r.warnings.iter().any(|w| w.contains("commanded")), "{name}: {:?}", r.warnings);
    }
}
