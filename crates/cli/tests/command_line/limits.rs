//! `--limits` takes every number that a report holds, of instruments of all kinds.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;

use cvg_simulator::scenario::{Purpose, Run};
use cvg_simulator::{Scenario, Settings};
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Bench, SMALL, Sheet, report, run};

/// The numbers below a value, by their places: elements by the name that they have, or by number.
fn numbers(value: &Value, above: &str, out: &mut BTreeSet<String>) {
    let below = |key: &str| if above.is_empty() { key.to_owned() } else { format!("{above}.{key}") };
    match value {
        Value::Number(_) => drop(out.insert(above.to_owned())),
        Value::Object(map) => map.iter().for_each(|(key, value)| numbers(value, &below(key), out)),
        Value::Array(list) => {
            for (at, value) in list.iter().enumerate() {
                let name = ["id", "name", "file", "of", "channel"].iter().find_map(|name| value[name].as_str());
                name.iter().for_each(|name| numbers(value, &below(name), out));
                numbers(value, &below(&at.to_string()), out);
            }
        }
        _ => {}
    }
}

/// The effects of a report, after each of its numbers was held against a limit.
fn all_known(report: &Value) -> Vec<String> {
    let folder = TempDir::new().unwrap();
    let mut places = BTreeSet::new();
    numbers(report, "", &mut places);
    // what a run is called and what its campaign is called are not the campaign's affair here
    let none = folder.path().join("none.toml");
    let refused = |places: &[&String]| {
        let text = places.iter().fold(String::new(), |mut text, place| {
            let _ = writeln!(text, "\"{place}\" = {{ min = -1e300 }}");
            text
        });
        fs::write(folder.path().join("limits.toml"), text).unwrap();
        run(&[&"identify", &none, &"--limits", &folder.path().join("limits.toml")]).stderr
    };
    let places: Vec<&String> = places.iter().collect();
    let said = refused(&places);
    assert!(places.len() > 20 && said.contains("none.toml"), "{} places: {said}", places.len());
    report["effects"].as_array().unwrap().iter().map(|e| e["id"].as_str().unwrap().to_owned()).collect()
}

fn simulated(settings: Settings) -> Value {
    report(&Bench::simulated(settings).campaign())
}

#[test]
fn of_a_gyroscope_on_a_rippling_table() {
    let more = "  { id = \"anisodamping\", anisodamping = 0.002, theta_tau = 20.0 },\n  { id = \"table-harmonic\", n = 2, w = 0.002, phase = 30.0 },\n]\n\n[[run]]";
    let text = SMALL.replacen("]\n\n[[run]]", more, 1);
    let effects = all_known(&simulated(Scenario::parse(&text).unwrap().settings().clone()));
    assert!(["anisodamping", "table-harmonic"].iter().all(|id| effects.iter().any(|e| e == id)), "{effects:?}");
}

#[test]
fn of_a_sensor_with_a_table_and_without() {
    let text = include_str!("../../../simulator/scenarios/sensor.toml");
    let bench = Bench::simulated(Scenario::parse(text).unwrap().settings().clone());
    let effects = all_known(&report(&bench.campaign()));
    assert!(effects.iter().any(|e| e == "angle-table"), "{effects:?}");
    let sheet = Sheet::of(&bench.read("turns.csv"));
    bench.write("alone.csv", sheet.only(&["t_s", "xc_v", "yc_v"]).text());
    let alone = run(&[&"identify", &bench.path("alone.csv"), &"--sensor", &"--json"]);
    assert_eq!(alone.status, 0, "{}", alone.stderr);
    all_known(&serde_json::from_str(&alone.stdout).unwrap());
}

#[test]
fn of_free_decays() {
    let decay = |at: usize| {
        let (start, rate) = (22.5 * at as f64, if at.is_multiple_of(2) { 10.0 } else { -10.0 });
        format!(
            "[[run]]\nkind = \"decay\"\nfile = \"decay-{at}.csv\"\nstart_deg = {start:?}\nquadrature = 0.01\nrate_dps = {rate:?}\n\
             duration_s = 20.0\n"
        )
    };
    let head = SMALL.split("[[run]]").next().unwrap();
    let text: String = std::iter::once(head.to_owned()).chain((0..8).map(decay)).collect();
    let settings = Settings { sample_hz: 50.0, ..Scenario::parse(&text).unwrap().settings().clone() };
    let effects = all_known(&simulated(settings));
    assert!(effects.iter().any(|e| e == "anisoelasticity"), "{effects:?}");
}

#[test]
fn of_precession_without_a_table() {
    let run = Run::Virtual {
        file: "bench.csv".into(),
        virtual_dps: 40.0,
        reversal_s: 9.0,
        duration_s: 150.0,
        turned: vec![[60.0, 60.0], [65.0, -40.0], [70.0, 0.0]],
        amplitude: 1.0,
        purpose: Purpose::Fit,
        settle_s: 2.0,
    };
    let paper = Scenario::paper().settings().clone();
    let effects = all_known(&simulated(Settings { sample_hz: 1000.0, runs: vec![run], ..paper }));
    assert!(effects.iter().any(|e| e == "anisodamping"), "{effects:?}");
}

#[test]
fn of_a_rate_gyroscope() {
    let folder = TempDir::new().unwrap();
    let mut text = String::from("t_s,rate_dps,theta_deg,temp_c\n");
    let mut angles = [0.0f64; 2];
    for i in 0..6000 {
        let (t, warmer) = (0.02 * f64::from(i), 10.0 * (f64::from(i) / 1500.0).sin());
        let rate = if (i / 1000) % 2 == 0 { 60.0 } else { -60.0 };
        let read = 1.01 * rate - 0.2 + 0.01 * warmer + 0.02 * (1e4 * f64::from(i).sin()).sin();
        angles = [angles[0] + 0.02 * rate, angles[1] + 0.02 * read];
        let _ = writeln!(text, "{t:.3},{rate},{:.6},{:.3}", angles[1], 25.0 + warmer);
    }
    fs::write(folder.path().join("rate.csv"), text).unwrap();
    let campaign =
        "[campaign]\ndevice = \"gyro\"\nperiod_deg = 360.0\n[[run]]\nkind = \"rotation\"\nfile = \"rate.csv\"\n";
    fs::write(folder.path().join("campaign.toml"), campaign).unwrap();
    let effects = all_known(&report(&folder.path().join("campaign.toml")));
    assert!(effects.iter().any(|e| e == "rate-offset-temperature"), "{effects:?}");
}
