//! Recordings of rate gyroscopes as their users bring them: a column of rates beside a table that steps.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{cvg, estimate};

/// Even noise of variance 1, from a counter.
fn noise(i: usize, seed: u64) -> f64 {
    let mut x = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xd1b5_4a32_d192_ed03);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) as f64 / u64::MAX as f64 - 0.5) * 12f64.sqrt()
}

/// A table at these rates, deg/s, 10 s each at 200 Hz, and a gyroscope in mdps.
fn stepped(rates: &[f64], ripple: f64, [scale, bias]: [f64; 2], seed: u64) -> String {
    let mut text = String::from("t_s,table_deg,Gyro Z (mdps)\n");
    let mut angle = 0.0f64;
    for i in 0..2000 * rates.len() {
        let rate = rates[i / 2000] * (1.0 + ripple * (7.0 * angle).to_radians().sin());
        let read = 1e3 * (scale * rate + bias + 0.02 * noise(i, seed));
        let _ = writeln!(text, "{:.3},{:.5},{read:.1}", 0.005 * i as f64, angle.rem_euclid(360.0));
        angle += 0.005 * rate;
    }
    text
}

/// Identifies these runs as a campaign of a rate gyroscope; its report, and the page.
fn identified(runs: &[String]) -> (Value, String) {
    let folder = TempDir::new().unwrap();
    let mut campaign = String::from(
        "[campaign]\ndevice = \"gyro\"\ninstrument = \"gyroscope\"\nperiod_deg = 360.0\n[columns]\ntheta_deg = \"integral(Gyro Z (mdps))\"\n",
    );
    for (number, text) in runs.iter().enumerate() {
        fs::write(folder.path().join(format!("{number}.csv")), text).unwrap();
        let _ = writeln!(campaign, "[[run]]\nkind = \"rotation\"\nfile = \"{number}.csv\"");
    }
    let (file, out) = (folder.path().join("campaign.toml"), folder.path().join("out"));
    fs::write(&file, campaign).unwrap();
    let outcome = cvg(&[OsStr::new("identify"), file.as_os_str(), OsStr::new("--out"), out.as_os_str()]);
    assert_eq!(outcome.status, 0, "{}{}", outcome.stdout, outcome.stderr);
    let report = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    (report, fs::read_to_string(out.join("report.html")).unwrap())
}

/// One reversal tells no lag: none stands in the answer, with whatever interval.
#[test]
fn a_table_that_turns_back_once_tells_the_bias_and_no_lag() {
    for ripple in [0.0, 0.002] {
        let (report, _) = identified(&[stepped(&[60.0, -60.0], ripple, [1.0, -0.2], 1)]);
        let effects: Vec<&Value> = report["effects"].as_array().unwrap().iter().collect();
        assert_eq!(effects.iter().map(|e| e["id"].as_str().unwrap()).collect::<Vec<_>>(), ["rate-offset"], "{ripple}");
        let [bias, low, high] = estimate(&report["runs"][0]["bias_dps"]);
        assert!(low < -0.2 && -0.2 < high && (bias + 0.2).abs() < 0.005, "{ripple}: {bias} in {low} … {high}");
    }
}

#[test]
fn scale_factor_and_bias_repeat_from_run_to_run_as_planted() {
    let rates = [90.0, -90.0, 60.0, -60.0];
    let runs = [(-500.0, 0.1), (0.0, 0.3), (500.0, -0.2)];
    let runs: Vec<String> = runs
        .iter()
        .enumerate()
        .map(|(i, (ppm, bias))| stepped(&rates, 0.0, [0.98 * (1.0 + 1e-6 * ppm), *bias], i as u64))
        .collect();
    let (report, page) = identified(&runs);
    let [value, low, high] = estimate(&report["repeatability_ppm"]);
    assert!((value / 500.0 - 1.0).abs() < 0.1 && low < value && value < high, "{value} in {low} … {high}");
    assert!(report["runs"].as_array().unwrap().iter().all(|run| run["way"] == "both"), "{}", report["runs"]);
    let units =
        report["warnings"].as_array().unwrap().iter().filter(|w| w.as_str().unwrap().contains("is the integral of"));
    let units: Vec<&Value> = units.collect();
    assert!(units.len() == 1 && units[0].as_str().unwrap().starts_with("0.csv and 2 other files: "), "{units:?}");
    for (term, planted, unit) in
        [("scale factor, repeatability", 500.0, "ppm"), ("bias, repeatability", 906.0, "deg/h")]
    {
        let standard = page.split_once("id=\"standard\"").unwrap().1;
        let row = standard.split_once(term).unwrap_or_else(|| panic!("{term} is not there")).1;
        let row = row.split_once("</tr>").unwrap().0;
        let value = row.split(['>', '<']).find_map(|cell| cell.strip_suffix(&format!(" {unit} over 3 runs"))).unwrap();
        let value: f64 = value.parse().unwrap();
        assert!((value / planted - 1.0).abs() < 0.1, "{term}: {value} {unit}");
    }
}
