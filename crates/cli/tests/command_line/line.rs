//! What a test bench and a production line ask of the program: pass or fail, what moved, and files that can be corrected
//! without harm.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use cvg_calibration::calibration::Calibration;
use cvg_calibration::{Member, Origin};
use cvg_model::effects::EffectId;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Bench, Sheet, estimate, report, run};

/// Results of the small device in a folder of its own.
fn identified(bench: &Bench) -> PathBuf {
    let out = bench.path("results");
    assert_eq!(run(&[&"identify", &bench.campaign(), &"--out", &out]).status, 0);
    out
}

// Limits

#[test]
fn limits_are_judged_a_line_each_and_one_that_fails_is_told_by_the_exit_code() {
    let bench = Bench::small();
    let limits = bench.path("limits.toml");
    let judged = |text: &str| {
        bench.write("limits.toml", text);
        run(&[&"identify", &bench.campaign(), &"--limits", &limits])
    };
    let kept = judged(
        "\"heldout.discovered.rms_deg\" = { max = 0.01 }\n\"detection_gain_ratio.value\" = { min = 0.97, max = 1.03 }\n\
         heldout.noise_floor_deg = { max = 0.01 }\n\"effects.detection-gain-mismatch.parameters[0].value\" = { min = 1 }\n\
         \"runs.rot+500.csv.rows\" = { min = 100 }\n",
    );
    assert_eq!(kept.status, 0, "{}", kept.stderr);
    assert_eq!(kept.stderr.lines().filter(|l| l.starts_with("pass  small  ")).count(), 5, "{}", kept.stderr);
    let failed = judged("\"angular_gain.value\" = { max = 0.7 }\n\"detection_gain_ratio.value\" = { min = 0.97 }\n");
    assert_eq!(failed.status, 1);
    assert!(failed.stderr.contains("FAIL  small  angular_gain.value = 0.7"), "{}", failed.stderr);
    assert!(failed.stderr.contains("pass  small  detection_gain_ratio.value"), "{}", failed.stderr);
    let null = judged("\"allan.bias_instability_dph.value\" = { max = 1.0 }\n");
    assert_eq!(null.status, 1, "what the report lacks does not pass");
    assert!(null.stderr.contains("= not found"), "{}", null.stderr);
    let null = judged("\"allan.bias_instability_dph.value\" = { max = 1.0, not_found = \"pass\" }\n");
    assert_eq!(null.status, 0, "{}", null.stderr);
    // an effect that the device does not show
    let of_cubic =
        |more: &str| judged(&format!("\"effects.detection-cubic.parameters.kappa.value\" = {{ max = 0.01{more} }}\n"));
    for (more, status, word) in [("", 1, "FAIL"), (", not_found = \"pass\"", 0, "pass")] {
        let absent = of_cubic(more);
        assert_eq!(absent.status, status, "{}", absent.stderr);
        assert!(absent.stderr.contains(word) && absent.stderr.contains("= not found"), "{}", absent.stderr);
    }
    for nothing in ["\"heldout.discovered.rms\" = { max = 1 }\n", "\"device\" = { max = 1 }\n"] {
        let outcome = judged(nothing);
        assert_eq!(outcome.status, 2, "{nothing}: {}", outcome.stderr);
        assert!(outcome.stderr.contains("names no number of the report"), "{}", outcome.stderr);
    }
    let absent = judged("\"runs.rot+501.csv.spikes\" = { max = 3 }\n");
    assert_eq!(absent.status, 2, "a run that is not there: {}", absent.stderr);
}

#[test]
fn a_limit_that_is_misspelt_is_told_before_anything_is_read_with_the_name_that_was_meant() {
    let folder = TempDir::new().unwrap();
    let limits = folder.path().join("limits.toml");
    for (written, meant) in [
        ("\"heldout.discoverd.rms_deg\" = { max = 1 }\n", "`heldout.discovered.rms_deg` is near"),
        ("\"effects.detection-cubic.parameters.kapa.value\" = { max = 1 }\n", "parameters.kappa.value` is near"),
        ("\"scale_factor.nonlinearity_ppm.vale\" = { max = 1 }\n", "`scale_factor.nonlinearity_ppm.value` is near"),
    ] {
        fs::write(&limits, written).unwrap();
        // the campaign is not even there
        let outcome = run(&[&"identify", &folder.path().join("none.toml"), &"--limits", &limits]);
        assert_eq!(outcome.status, 2);
        assert!(outcome.stderr.contains(meant), "{}", outcome.stderr);
    }
}

/// Every number of a report, keys joined by dots.
fn numbers(value: &Value, place: &str, found: &mut Vec<String>) {
    let below = |key: &str| if place.is_empty() { key.to_owned() } else { format!("{place}.{key}") };
    match value {
        Value::Object(map) => map.iter().for_each(|(key, v)| numbers(v, &below(key), found)),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| numbers(v, &below(&i.to_string()), found)),
        Value::Number(_) => found.push(place.to_owned()),
        _ => {}
    }
}

#[test]
fn every_number_of_a_report_can_have_a_limit() {
    let bench = over_temperature(|_, rate| rate);
    let mut found = Vec::new();
    numbers(&report(&bench.campaign()), "", &mut found);
    assert!(found.len() > 100, "{}", found.len());
    let text: String = found.iter().map(|place| format!("\"{place}\" = {{ min = -1e300 }}\n")).collect();
    bench.write("limits.toml", text);
    let outcome = run(&[&"identify", &bench.campaign(), &"--limits", &bench.path("limits.toml")]);
    assert_eq!(outcome.status, 0, "{}", outcome.stderr);
}

#[test]
fn limits_that_cannot_be_meant_are_refused_before_anything_is_identified() {
    let bench = Bench::small();
    for (text, part) in [
        ("\"angular_gain.value\" = { min = 1, max = 0 }\n", "min is above max"),
        ("\"angular_gain.value\" = 0.78\n", "is no table"),
        ("\"angular_gain.value\" = { max = \"1\" }\n", "`max` is no number"),
        ("\"angular_gain.value\" = {}\n", "neither min nor max"),
        ("\"angular_gain.value\" = { max = 1, not_found = \"pass\" }\n", "is in every report"),
        ("\"effects.detection-cubic.parameters.kappa.value\" = { max = 1, not_found = 1 }\n", "is not \"pass\""),
        ("\"angular_gain.value\" = { mni = 1 }\n", "there is no `mni`"),
        ("", "there is no limit"),
        ("=\n", "limits.toml"),
    ] {
        bench.write("limits.toml", text);
        let outcome = run(&[&"identify", &bench.campaign(), &"--limits", &bench.path("limits.toml")]);
        assert_eq!((outcome.status, outcome.stdout.as_str()), (2, ""), "{text}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(part), "{part}: {}", outcome.stderr);
    }
}

// Compare

#[test]
fn what_moved_between_two_answers_is_told_and_what_did_not_is_not() {
    let bench = Bench::small();
    let out = identified(&bench);
    let (before, after) = (out.join("report.json"), bench.path("after.json"));
    let mut moved: Value = serde_json::from_slice(&fs::read(&before).unwrap()).unwrap();
    for at in ["value", "ci95"] {
        let shifted = |v: &Value| Value::from(v.as_f64().unwrap() * 1.002);
        let ratio = &mut moved["detection_gain_ratio"][at];
        *ratio = ratio.as_array().map_or_else(|| shifted(ratio), |ends| ends.iter().map(shifted).collect());
    }
    fs::write(&after, moved.to_string()).unwrap();
    let same = run(&[&"compare", &out, &before]);
    assert_eq!(same.status, 0, "{}", same.stderr);
    assert!(same.stdout.contains("nothing moved") && same.stdout.contains("angular_gain"), "{}", same.stdout);
    let other = run(&[&"compare", &out, &after]);
    assert_eq!(other.status, 0);
    let last = other.stdout.lines().last().unwrap();
    assert_eq!(last, "moved beyond the combined 95 % intervals: detection_gain_ratio");
    let facts: Value = serde_json::from_str(&run(&[&"compare", &out, &after, &"--json"]).stdout).unwrap();
    assert_eq!(facts["moved"], 1);
    let ratio = facts["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "detection_gain_ratio").unwrap();
    let [a, b, d, c] = [&ratio["a"]["value"], &ratio["b"]["value"], &ratio["difference"], &ratio["combined95"]]
        .map(|v| v.as_f64().unwrap());
    assert!((b - a - d).abs() < 1e-12 && d > c, "{ratio}");
}

#[test]
fn an_effect_that_came_has_moved_and_a_declared_one_that_was_not_told_has_not() {
    let bench = Bench::small();
    let (before, after) = (identified(&bench).join("report.json"), bench.path("after.json"));
    let mut more: Value = serde_json::from_slice(&fs::read(&before).unwrap()).unwrap();
    let effect = |id: &str, origin: &str, name: &str, [value, low, high]: [f64; 3]| {
        let parameter = serde_json::json!({"name": name, "unit": "1", "value": value, "ci95": [low, high]});
        serde_json::json!({"id": id, "origin": origin, "parameters": [parameter]})
    };
    let found = [
        effect("detection-cubic", "discovered", "kappa", [4e-3, 3e-3, 5e-3]),
        effect("detection-skew", "discovered", "skew", [1e-3, -1e-3, 3e-3]),
        effect("anisoelasticity", "declared", "anisoelasticity", [0.2, 0.1, 0.3]),
    ];
    let effects = more["effects"].as_array_mut().unwrap();
    effects.retain(|e| !found.iter().any(|f| f["id"] == e["id"]));
    let mut fewer = more.clone();
    more["effects"].as_array_mut().unwrap().extend(found);
    fewer["runs"] = Value::Array(Vec::new());
    fs::write(&after, more.to_string()).unwrap();
    let without = bench.path("without.json");
    fs::write(&without, fewer.to_string()).unwrap();
    for (pair, word) in [([&without, &after], "came"), ([&after, &without], "went")] {
        let said = run(&[&"compare", pair[0], pair[1]]);
        let last = said.stdout.lines().last().unwrap();
        assert_eq!(last, "moved beyond the combined 95 % intervals: detection-cubic.kappa", "{}", said.stdout);
        let line = said.stdout.lines().find(|line| line.starts_with("detection-cubic.kappa")).unwrap();
        assert!(line.contains(word), "{line}");
    }
    let facts: Value = serde_json::from_str(&run(&[&"compare", &without, &after, &"--json"]).stdout).unwrap();
    assert_eq!(facts["moved"], 1);
}

#[test]
fn a_calibration_is_compared_with_its_report_by_the_names_of_reports() {
    let mut settings = cvg_simulator::Scenario::paper().settings().clone();
    settings.runs.retain(|r| !matches!(r, cvg_simulator::scenario::Run::Rotation { file, .. } if file.contains("low")));
    let bench = Bench::simulated(settings);
    let out = identified(&bench);
    let said = run(&[&"compare", &out, &out.join("calibration.toml")]);
    assert!(said.stdout.contains("anisodamping.theta_tau"), "{}", said.stdout);
    assert!(!said.stdout.contains("only in") && !said.stdout.contains("differs"), "{}", said.stdout);
}

#[test]
fn two_calibrations_are_compared_by_value() {
    let bench = Bench::small();
    let calibration = identified(&bench).join("calibration.toml");
    let said = run(&[&"compare", &calibration, &calibration]);
    assert_eq!(said.status, 0, "{}", said.stderr);
    assert!(said.stdout.contains("detection-gain-mismatch.detection_gain_ratio"), "{}", said.stdout);
}

#[test]
fn what_is_no_answer_cannot_be_compared() {
    let bench = Bench::small();
    for name in ["check.csv", "nothing.json"] {
        let outcome = run(&[&"compare", &bench.path(name), &bench.path(name)]);
        assert_eq!(outcome.status, 2, "{}", outcome.stderr);
        assert!(outcome.stderr.contains(name) && outcome.stderr.contains("wanted"), "{}", outcome.stderr);
    }
}

/// Their parameters bear the same names and are other quantities.
#[test]
fn a_gyroscope_and_a_sensor_are_not_compared_and_another_device_is_named() {
    let bench = Bench::small();
    let before = identified(&bench).join("report.json");
    let changed = |key: &str, value: &str| {
        let mut other: Value = serde_json::from_slice(&fs::read(&before).unwrap()).unwrap();
        other[key] = value.into();
        let path = bench.path(&format!("{key}.json"));
        fs::write(&path, other.to_string()).unwrap();
        run(&[&"compare", &before, &path])
    };
    let kinds = changed("instrument", "sensor");
    assert_eq!(kinds.status, 2, "{}", kinds.stdout);
    assert!(kinds.stderr.contains("of a gyroscope") && kinds.stderr.contains("of a sensor"), "{}", kinds.stderr);
    let devices = changed("device", "another");
    assert_eq!(devices.status, 0, "{}", devices.stderr);
    assert!(devices.stderr.contains("B of another"), "{}", devices.stderr);
}

// Scale factor

#[test]
fn a_planted_nonlinearity_of_200_ppm_is_found_within_a_tenth() {
    let mut scenario = String::from(
        "device = \"six\"\nangular_gain = 0.78\nnoise_v = 2e-5\ntau_s = 10.0\nseed = 3\n\
         effects = [{ id = \"detection-gain-mismatch\", detection_gain_ratio = 1.0132 }]\n",
    );
    let rates = [500.0, -500.0, 300.0, -300.0, 100.0, -100.0];
    for rate in rates {
        let _ = write!(
            scenario,
            "\n[[run]]\nkind = \"rotation\"\nfile = \"rot{rate:+}.csv\"\nrate_dps = {rate:.1}\nduration_s = 12.0\nsettle_s = 0.5\n"
        );
    }
    let settings = cvg_simulator::Scenario::parse(&scenario).unwrap().settings().clone();
    let bench = Bench::simulated(settings);
    let clean = report(&bench.campaign());
    let [value, low, high] = estimate(&clean["scale_factor"]["nonlinearity_ppm"]);
    assert!(low < 0.0 && high > 0.0 && value.abs() < 5.0, "nothing planted: {value} {low} {high}");
    for rate in rates {
        // the table turns by less than it says: the instrument's gain seems larger by as much
        let ppm = 200.0 * (f64::abs(rate) - 100.0) / 400.0;
        bench.change(&format!("rot{rate:+}.csv"), |text| {
            let mut sheet = Sheet::of(&text);
            sheet.set("rate_dps", |_, v| v * (1.0 - 1e-6 * ppm));
            sheet.text()
        });
    }
    let planted = report(&bench.campaign());
    let [value, low, high] = estimate(&planted["scale_factor"]["nonlinearity_ppm"]);
    println!("planted 200 ppm, found {value} ({low} to {high}); clean {}", clean["scale_factor"]);
    assert!((value / 200.0 - 1.0).abs() < 0.1, "{value} ({low} to {high})");
    let [value, low, high] = estimate(&planted["scale_factor"]["asymmetry_ppm"]);
    assert!(low < 0.0 && high > 0.0 && value.abs() < 5.0, "no asymmetry was planted: {value} ({low} to {high})");
}

// Temperature

/// Two rates both ways at three temperatures; each run's rows have its temperature.
fn over_temperature(change: impl Fn(f64, f64) -> f64) -> Bench {
    let mut scenario = String::from(
        "device = \"oven\"\nangular_gain = 0.78\nnoise_v = 2e-5\ntau_s = 10.0\nseed = 5\n\
         effects = [{ id = \"detection-gain-mismatch\", detection_gain_ratio = 1.0132 }]\n",
    );
    let points: Vec<(f64, f64)> =
        [-20.0, 20.0, 60.0].into_iter().flat_map(|t| [400.0, -400.0, 200.0].map(|rate| (t, rate))).collect();
    for (t, rate) in &points {
        let _ = write!(
            scenario,
            "\n[[run]]\nkind = \"rotation\"\nfile = \"{t:+}{rate:+}.csv\"\nrate_dps = {rate:.1}\nduration_s = 4.0\nsettle_s = 0.5\n"
        );
    }
    let bench = Bench::simulated(cvg_simulator::Scenario::parse(&scenario).unwrap().settings().clone());
    for (t, rate) in points {
        bench.change(&format!("{t:+}{rate:+}.csv"), |text| {
            let mut sheet = Sheet::of(&text);
            sheet.set("rate_dps", |_, v| change(t, v));
            sheet.header.push("temp_c".into());
            sheet.rows.iter_mut().for_each(|row| row.push(t.to_string()));
            sheet.text()
        });
    }
    bench
}

#[test]
fn gain_and_bias_are_told_over_the_temperature_of_the_runs() {
    // the instrument turns by k (1 + 2e-5 τ) Ω and drifts by 1e-4 τ deg/s more: as if the table turned otherwise than it says
    let bench = over_temperature(|t, v| (v - 1e-4 * t / 0.78) / (1.0 + 2e-5 * t));
    let out = identified(&bench);
    let r: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    let t = &r["temperature"];
    println!("{t:#}");
    assert_eq!(
        (t["runs"].as_u64(), t["range_c"][0].as_f64(), t["range_c"][1].as_f64()),
        (Some(9), Some(-20.0), Some(60.0))
    );
    let [gain, low, high] = estimate(&t["angular_gain_per_k"]);
    assert!((gain / (0.78 * 2e-5) - 1.0).abs() < 0.05 && low < gain && gain < high, "{t}");
    // θ̇ = −k Ω: what the table turns more, the pattern goes back
    let [bias, ..] = estimate(&t["bias_dps_per_k"]);
    assert!((bias.abs() / 1e-4 - 1.0).abs() < 0.1, "{t}");
    let [ratio, low, high] = estimate(&t["detection_gain_ratio_per_k"]);
    assert!(low < 0.0 && high > 0.0 && ratio.abs() < 1e-6, "no slope of the ratio was planted: {t}");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("Slopes over the temperature") && page.contains("plot-temperature"));
    let (effects, figures) = (page.find("id=\"effects\"").unwrap(), page.find("id=\"look\"").unwrap());
    assert!(effects < page.find("id=\"parameters\"").unwrap() && page.find("id=\"parameters\"").unwrap() < figures);
}

// Compensation

#[test]
fn a_recording_in_millivolts_is_not_compensated_with_a_calibration_in_volts() {
    let bench = Bench::small();
    let calibration = identified(&bench).join("calibration.toml");
    let mut sheet = Sheet::of(&bench.read("check.csv"));
    for column in ["xc_v", "xs_v", "yc_v", "ys_v"] {
        sheet.set(column, |_, v| 1e3 * v);
    }
    bench.write("milli.csv", sheet.text());
    let out = bench.path("clean.csv");
    let refused = run(&[&"compensate", &calibration, &bench.path("milli.csv"), &"--out", &out]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("millivolts") && refused.stderr.contains("--map"), "{}", refused.stderr);
    assert!(!out.exists());
}

#[test]
fn the_angle_is_written_where_only_the_readout_was_recorded() {
    let bench = Bench::small();
    let (calibration, out) = (identified(&bench).join("calibration.toml"), bench.path("clean.csv"));
    assert_eq!(run(&[&"compensate", &calibration, &bench.path("check.csv"), &"--out", &out]).status, 0);
    let sheet = Sheet::of(&fs::read_to_string(&out).unwrap());
    let (theta, t) = (sheet.numbers("theta_deg"), sheet.numbers("t_s"));
    let rate = (theta[theta.len() - 1] - theta[0]) / (t[t.len() - 1] - t[0]);
    assert!((rate + 0.78 * 400.0).abs() < 1.0, "{rate} deg/s, unwrapped");
}

#[test]
fn several_recordings_go_into_a_folder_and_never_onto_themselves() {
    let bench = Bench::small();
    let (calibration, out) = (identified(&bench).join("calibration.toml"), bench.path("clean"));
    let said = run(&[&"compensate", &calibration, &bench.path("rot*.csv"), &"--out", &out, &"--device", &"small"]);
    assert_eq!(said.status, 0, "{}", said.stderr);
    assert!(out.join("rot+500.csv").exists() && out.join("rot-300.csv").exists());
    let one = run(&[&"compensate", &calibration, &bench.path("rot*.csv"), &"--out", &bench.path("one.csv")]);
    assert!(one.status == 2 && one.stderr.contains("2 recordings do not go into one file"), "{}", one.stderr);
    let before = bench.read("rot+500.csv");
    let onto = run(&[&"compensate", &calibration, &bench.path("rot*.csv"), &"--out", &bench.path(".")]);
    assert_eq!(onto.status, 2, "{}", onto.stderr);
    assert_eq!(bench.read("rot+500.csv"), before);
    let other = run(&[
        &"compensate",
        &calibration,
        &bench.path("check.csv"),
        &"--out",
        &out.join("x.csv"),
        &"--device",
        &"dfp-8",
    ]);
    assert_eq!(other.status, 2);
    assert!(other.stderr.contains("calibration of small"), "{}", other.stderr);
}

#[test]
fn a_calibration_carries_the_program_and_the_checksums_of_what_it_was_made_of() {
    let bench = Bench::small();
    let text = fs::read_to_string(identified(&bench).join("calibration.toml")).unwrap();
    let file: toml::Table = text.parse().unwrap();
    assert_eq!(file["tool"]["version"].as_str(), Some(env!("CARGO_PKG_VERSION")));
    let inputs = file["input"].as_array().unwrap();
    assert!(
        inputs.iter().any(|i| i["file"].as_str() == Some("rot+500.csv") && i["crc32"].as_str().unwrap().len() == 8)
    );
    let [low, high] = [0, 1].map(|i| file["amplitude_v"][i].as_float().unwrap());
    assert!(low <= high && low > 0.0);
}

#[test]
fn a_reference_is_kept_as_it_was_recorded() {
    let bench = Bench::small();
    let (calibration, out) = (identified(&bench).join("calibration.toml"), bench.path("clean.csv"));
    assert_eq!(run(&[&"compensate", &calibration, &bench.path("check.csv"), &"--out", &out]).status, 0);
    let of = |text: String| Sheet::of(&text).numbers("rate_dps");
    assert_eq!(of(bench.read("check.csv")), of(fs::read_to_string(out).unwrap()));
}

#[test]
fn what_belongs_to_the_table_or_to_the_hours_of_a_recording_is_not_replayed() {
    let bench = Bench::small();
    let path = identified(&bench).join("calibration.toml");
    let mut calibration = Calibration::read(&path).unwrap();
    let compensated = |calibration: &Calibration, name: &str| {
        let (file, out) = (bench.path(&format!("{name}.toml")), bench.path(&format!("{name}.csv")));
        fs::write(&file, calibration.to_text()).unwrap();
        let outcome = run(&[&"compensate", &file, &bench.path("check.csv"), &"--out", &out]);
        assert_eq!(outcome.status, 0, "{}", outcome.stderr);
        (fs::read_to_string(out).unwrap(), outcome.stderr)
    };
    let (without, _) = compensated(&calibration, "without");
    for (id, value) in [(EffectId::TableHarmonic, 3.0), (EffectId::TimePeriodic, 7.0), (EffectId::GainDrift, 1e-3)] {
        let mut values = id.neutral();
        (values[0], values[1]) = (value, 2e-3);
        calibration.hypothesis.members.push(Member { id, values, origin: Origin::Empirical, refined: true });
    }
    let (with, said) = compensated(&calibration, "with");
    assert_eq!(with, without);
    for id in ["table-harmonic", "time-periodic", "gain-drift"] {
        assert!(said.contains("not undone") && said.contains(id), "{said}");
    }
}
