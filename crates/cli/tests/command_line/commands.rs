//! What each command does with good input, and with the dirt of real files.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use cvg_calibration::recording::Recording;
use cvg_simulator::Scenario;
use cvg_simulator::scenario::{Reference, Run};
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Bench, Sheet, cvg, cvg_ok, report};

/// What the paper's device is set to.
const DETECTION_RATIO: f64 = 1.0132;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// Value and ends of the interval of an estimate.
fn estimate(value: &Value) -> [f64; 3] {
    [number(&value["value"]), number(&value["ci95"][0]), number(&value["ci95"][1])]
}

/// Identifiers of the effects that are not declared, sorted.
fn undeclared(report: &Value) -> Vec<String> {
    let effects = report["effects"].as_array().unwrap().iter().filter(|e| e["origin"] != "declared");
    let mut ids: Vec<String> = effects.map(|e| e["id"].as_str().unwrap().to_owned()).collect();
    ids.sort();
    ids
}

fn warnings(report: &Value) -> Vec<&str> {
    report["warnings"].as_array().unwrap().iter().map(|w| w.as_str().unwrap()).collect()
}

// Commands

#[test]
fn demo_writes_report_and_calibration() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("demo");
    let said = cvg_ok(&[OsStr::new("demo"), OsStr::new("--out"), out.as_os_str()]);
    assert!(said.contains("detection-cubic") && said.contains("the paper"), "{said}");
    let report: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(undeclared(&report), ["detection-cubic"]);
    let html = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(html.contains("<svg") && html.contains("detection-cubic"), "a page with a figure");
    assert!(
        html.len() < 2_000_000,
        "a report that goes into a mail, with all that its figures need: {} bytes",
        html.len()
    );
    assert!(fs::read_to_string(out.join("calibration.toml")).unwrap().contains("detection-cubic"));
    let unfinished = crate::support::contents(&out).into_keys().filter(|p| p.extension().is_some_and(|e| e == "part"));
    assert_eq!(unfinished.count(), 0);
}

#[test]
fn the_demo_of_self_calibration_ends_with_a_small_error_and_says_what_rest_cannot_tell() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("demo");
    let said = cvg_ok(&[OsStr::new("demo"), OsStr::new("--self-calibration"), OsStr::new("--out"), out.as_os_str()]);
    assert!(said.contains("not known") && said.contains("times smaller"), "{said}");
    let table = fs::read_to_string(out.join("self-calibration.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let bias = |row: &[&str]| row[2].parse::<f64>().unwrap();
    let (first, last) = (rows.first().unwrap(), rows.last().unwrap());
    assert!(bias(last) < bias(first) / 100.0, "{first:?} {last:?}");
    assert!((last[3].parse::<f64>().unwrap() - DETECTION_RATIO).abs() < 1e-4, "{last:?}");
    assert!(fs::read_to_string(out.join("self-calibration.svg")).unwrap().contains("<svg"));
    // the page has the table that is printed, some of its rows and a digit less
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/self-calibration.md"));
    let of_page = page.unwrap();
    let of_page =
        of_page.lines().skip_while(|line| !line.starts_with("| until |")).skip(3).take_while(|l| l.starts_with('|'));
    let of_page: Vec<Vec<&str>> = of_page.map(|line| line.split('|').map(str::trim).collect()).collect();
    assert!(of_page.len() >= 5, "{of_page:?}");
    assert!(said.contains("uncompensated     271.98 mdeg"), "as the page has it before: {said}");
    for row in of_page {
        let [_, until, doing, bias_mdeg, ratio, _] = row.as_slice() else { panic!("{row:?}") };
        let second = until.strip_suffix(" s").unwrap();
        let printed = rows.iter().find(|r| r[0] == second).unwrap_or_else(|| panic!("no row {second}"));
        let told = bias_mdeg.strip_suffix(" mdeg").unwrap().parse::<f64>().unwrap();
        assert!((1e3 * bias(printed) - told).abs() < 0.06 && printed[1] == *doing, "{row:?}: {printed:?}");
        let known = printed[5] == "true";
        let number = |at: usize| printed[at].parse::<f64>().unwrap();
        let estimate = ratio.split_once(" ± ").map(|both| [both.0, both.1].map(|text| text.parse::<f64>().unwrap()));
        assert_eq!((estimate.is_some(), *ratio == "not known"), (known, !known), "{row:?}: {printed:?}");
        if let Some([value, half]) = estimate {
            assert!((value - number(3)).abs() < 1e-5 && (half - 1.96 * number(4)).abs() < 1e-5, "{row:?}: {printed:?}");
        }
    }
}

#[test]
fn demo_with_json_prints_the_report_and_nothing_else() {
    let folder = TempDir::new().unwrap();
    let said = cvg_ok(&[OsStr::new("demo"), OsStr::new("--json"), OsStr::new("--out"), folder.path().as_os_str()]);
    let written = fs::read_to_string(folder.path().join("report.json")).unwrap();
    assert_eq!(said.trim_end(), written.trim_end());
}

#[test]
fn identify_with_json_prints_the_report_and_nothing_else() {
    let bench = Bench::small();
    let (campaign, out) = (bench.campaign(), bench.path("out"));
    let said = cvg_ok(&[
        OsStr::new("identify"),
        campaign.as_os_str(),
        OsStr::new("--json"),
        OsStr::new("--out"),
        out.as_os_str(),
    ]);
    let written = fs::read_to_string(out.join("report.json")).unwrap();
    assert_eq!(said.trim_end(), written.trim_end());
    let alone = cvg_ok(&[OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--json")]);
    assert_eq!(alone, said, "the same campaign gives the same report");
}

/// No clock, no order of threads and no folder goes into an answer.
#[test]
fn the_same_campaign_gives_the_same_files_byte_for_byte() {
    let bench = Bench::small();
    let campaign = bench.campaign();
    let written = ["one", "two"].map(|name| {
        let out = bench.path(name);
        cvg_ok(&[OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--out"), out.as_os_str()]);
        let files = fs::read_dir(out).unwrap().map(|entry| entry.unwrap().path());
        files.map(|f| (f.file_name().unwrap().to_owned(), fs::read(f).unwrap())).collect::<BTreeMap<_, _>>()
    });
    let names = ["calibration.toml", "report.html", "report.json"];
    assert!(names.iter().all(|name| written[0].contains_key(OsStr::new(name))), "{:?}", written[0].keys());
    assert!(written[0] == written[1], "{:?}", written.map(|w| w.into_keys().collect::<Vec<_>>()));
}

#[test]
fn help_and_version_are_answers() {
    for arguments in [["--help"], ["--version"], ["help"]] {
        let outcome = cvg(&arguments);
        assert_eq!((outcome.status, outcome.stderr.as_str()), (0, ""), "{arguments:?}");
        assert!(outcome.stdout.contains("cvg"), "{arguments:?}: {}", outcome.stdout);
    }
}

/// rms of angle minus best line over the turn of the table, deg, of the rows from `settle_s` on: an evaluation of its
/// own, from the columns alone.
fn rms_error_deg(recording: &Path, settle_s: f64) -> f64 {
    let sheet = Sheet::of(&fs::read_to_string(recording).unwrap());
    let [t, rate, xc, xs, yc, ys] = ["t_s", "rate_dps", "xc_v", "xs_v", "yc_v", "ys_v"].map(|c| sheet.numbers(c));
    let (mut table, mut turned): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for i in 0..t.len() {
        let alpha = if i == 0 { 0.0 } else { table[i - 1] + 0.5 * (rate[i] + rate[i - 1]) * (t[i] - t[i - 1]) };
        table.push(alpha);
        let r = xc[i].powi(2) + xs[i].powi(2) - yc[i].powi(2) - ys[i].powi(2);
        let s = 2.0 * (xc[i] * yc[i] + xs[i] * ys[i]);
        let theta = 0.5 * s.atan2(r).to_degrees();
        let last = turned.last().copied().unwrap_or(theta);
        turned.push(theta + 180.0 * ((last - theta) / 180.0).round());
    }
    let rows: Vec<usize> = (0..t.len()).filter(|&i| t[i] >= settle_s).collect();
    let n = rows.len() as f64;
    let mean = |v: &[f64]| rows.iter().map(|&i| v[i]).sum::<f64>() / n;
    let (ma, mt) = (mean(&table), mean(&turned));
    let (saa, sat) = rows
        .iter()
        .fold((0.0, 0.0), |(saa, sat), &i| (saa + (table[i] - ma).powi(2), sat + (table[i] - ma) * (turned[i] - mt)));
    let error = |i: usize| turned[i] - mt - sat / saa * (table[i] - ma);
    (rows.iter().map(|&i| error(i).powi(2)).sum::<f64>() / n).sqrt()
}

#[test]
fn what_is_simulated_identified_and_compensated_is_as_good_as_its_noise() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("scenario.toml"), cvg_simulator::scenario::PAPER).unwrap();
    let (scenario, bench, results) = (path("scenario.toml"), path("bench"), path("results"));
    cvg_ok(&[OsStr::new("simulate"), scenario.as_os_str(), OsStr::new("--out"), bench.as_os_str()]);
    let campaign = bench.join("campaign.toml");
    cvg_ok(&[OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--out"), results.as_os_str()]);
    let report: Value = serde_json::from_slice(&fs::read(results.join("report.json")).unwrap()).unwrap();
    let floor = number(&report["heldout"]["noise_floor_deg"]);
    for name in ["rot+350-check.csv", "rot-500-check.csv"] {
        let (calibration, before, after) = (results.join("calibration.toml"), bench.join(name), path(name));
        let said = cvg_ok(&[
            OsStr::new("compensate"),
            calibration.as_os_str(),
            before.as_os_str(),
            OsStr::new("--out"),
            after.as_os_str(),
        ]);
        assert_eq!(said, "", "messages go to standard error");
        let [raw, compensated] = [&before, &after].map(|recording| rms_error_deg(recording, 1.0));
        println!("{name}: {raw:.5}° → {compensated:.5}°, floor {floor:.5}°");
        assert!(raw > 50.0 * floor, "{name}: there was nothing to compensate: {raw}°");
        assert!(compensated <= 1.3 * floor, "{name}: {compensated}° is {} times the floor", compensated / floor);
        let rows = |path: &Path| fs::read_to_string(path).unwrap().lines().count();
        assert_eq!(rows(&before), rows(&after), "{name}");
    }
}

#[test]
fn a_recording_is_compensated_into_parquet_by_its_name() {
    let bench = Bench::small();
    let (campaign, out, check) = (bench.campaign(), bench.path("out"), bench.path("check.csv"));
    cvg_ok(&[OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--out"), out.as_os_str()]);
    let calibration = out.join("calibration.toml");
    let [csv, parquet] = ["a.csv", "a.parquet"].map(|name| {
        let to = bench.path(name);
        let arguments =
            ["compensate".as_ref(), calibration.as_os_str(), check.as_os_str(), "--out".as_ref(), to.as_ref()];
        cvg_ok::<&OsStr>(&arguments);
        Recording::read(&to).unwrap()
    });
    assert!(fs::read(bench.path("a.parquet")).unwrap().starts_with(b"PAR1"));
    assert_eq!((csv.t_s, csv.xc_v, csv.yc_v), (parquet.t_s, parquet.xc_v, parquet.yc_v));
}

// The report's contract

fn assert_keys(value: &Value, keys: &[&str], place: &str) {
    let object = value.as_object().unwrap_or_else(|| panic!("{place} is not an object: {value}"));
    for key in keys {
        assert!(object.contains_key(*key), "{place} has no {key}: {value}");
    }
}

fn assert_estimate(value: &Value, place: &str) {
    assert_keys(value, &["value", "ci95"], place);
    let [value, low, high] = estimate(value);
    assert!(low <= value && value <= high, "{place}: {value} in [{low}, {high}]");
}

fn assert_number_or_null(value: &Value, place: &str) {
    assert!(value.is_number() || value.is_null(), "{place}: {value}");
}

fn assert_string_in(value: &Value, allowed: &[&str], place: &str) {
    assert!(value.as_str().is_some_and(|s| allowed.contains(&s)), "{place}: {value}");
}

/// The report has the keys and the types that its readers rely on.
fn assert_report(r: &Value) {
    assert_eq!(r["schema"], "cvg.report/2");
    assert_string_in(&r["status"], &["answered", "neutral"], "status");
    assert_eq!(r["status"] == "answered", r["reason"].is_null(), "{}", r["reason"]);
    assert_eq!(r["tool"]["name"], "cvg");
    assert!(r["tool"]["version"].is_string() && r["decomposition"].is_array() && r["proposals"].is_array());
    for input in r["inputs"].as_array().unwrap() {
        assert!(input["file"].is_string() && input["crc32"].as_str().is_some_and(|sum| sum.len() == 8), "{input}");
    }
    assert!(r["device"].is_string());
    assert_estimate(&r["angular_gain"], "angular_gain");
    for key in ["detection_gain_ratio", "actuation_gain_ratio"] {
        assert_keys(r, &[key], "report");
        if !r[key].is_null() {
            assert_estimate(&r[key], key);
        }
    }
    for effect in r["effects"].as_array().unwrap() {
        let place = effect["id"].as_str().unwrap();
        assert_string_in(&effect["origin"], &["declared", "discovered", "empirical"], place);
        for parameter in effect["parameters"].as_array().unwrap() {
            assert!(parameter["name"].is_string() && parameter["unit"].is_string(), "{place}: {parameter}");
            number(&parameter["value"]);
            assert_keys(parameter, &["ci95"], place);
            let ci95 = &parameter["ci95"];
            let is_interval = ci95.as_array().is_some_and(|ends| ends.len() == 2 && ends.iter().all(Value::is_number));
            assert!(ci95.is_null() || is_interval, "{place}: {ci95}");
        }
        assert_keys(effect, &["heldout_rms_deg", "separated_by"], place);
        if !effect["heldout_rms_deg"].is_null() {
            number(&effect["heldout_rms_deg"]["before"]);
            number(&effect["heldout_rms_deg"]["after"]);
        }
        assert!(effect["evidence"].as_str().is_some_and(|s| s.len() > 20), "{place}: {}", effect["evidence"]);
        assert!(effect["confounded_with"].as_array().unwrap().iter().all(Value::is_string), "{place}");
        assert!(effect["separated_by"].is_string() || effect["separated_by"].is_null(), "{place}");
    }
    let heldout = &r["heldout"];
    assert_keys(heldout, &["raw", "declared", "discovered", "noise_floor_deg"], "heldout");
    for stage in ["raw", "declared", "discovered"].map(|key| &heldout[key]) {
        if !stage.is_null() {
            let [rms, peak, span] = ["rms_deg", "peak_deg", "peak_to_peak_deg"].map(|key| number(&stage[key]));
            assert!(0.0 < rms && rms <= peak && peak <= span, "{stage}");
        }
    }
    assert!(!heldout["declared"].is_null() && !heldout["discovered"].is_null());
    assert!(number(&heldout["noise_floor_deg"]) > 0.0);
    for harmonic in r["residual"]["harmonics"].as_array().unwrap() {
        assert_string_in(&harmonic["of"], &["pattern", "table"], "residual.harmonics");
        assert!(harmonic["n"].is_u64(), "{harmonic}");
        for key in ["amplitude_deg", "ci95_deg", "phase_deg"] {
            number(&harmonic[key]);
        }
    }
    assert!(r["residual"]["white"].is_boolean());
    for left in r["unexplained"].as_array().unwrap() {
        let classes = ["pattern-harmonic", "table-harmonic", "rate-dependent", "drift", "time-periodic", "other"];
        assert_string_in(&left["class"], &classes, "unexplained");
        assert_keys(left, &["n", "frequency_hz"], "unexplained");
        assert_number_or_null(&left["n"], "unexplained.n");
        assert_number_or_null(&left["frequency_hz"], "unexplained.frequency_hz");
        number(&left["rms_deg"]);
        assert!(left["suggestion"].is_string());
    }
    assert!(r["warnings"].as_array().unwrap().iter().all(Value::is_string));
}

#[test]
fn a_report_has_the_keys_and_types_of_its_format() {
    assert_report(clean());
    assert_report(&report(&Bench::small().campaign()));
    let sensor = Bench::simulated(Scenario::parse(cvg_simulator::scenario::SENSOR).unwrap().settings().clone());
    assert_report(&report(&sensor.campaign()));
}

// Dirt: the same instrument, recorded less cleanly

/// The report of the paper's campaign as it was simulated.
fn clean() -> &'static Value {
    static CLEAN: OnceLock<Value> = OnceLock::new();
    CLEAN.get_or_init(|| report(&Bench::paper().campaign()))
}

/// The detection ratio of the clean campaign lies in the interval of this one, and the same effects were found.
fn assert_same_answer(dirty: &Value) {
    let [clean_ratio, ..] = estimate(&clean()["detection_gain_ratio"]);
    let [ratio, low, high] = estimate(&dirty["detection_gain_ratio"]);
    println!("detection ratio {ratio:.6} in [{low:.6}, {high:.6}], clean {clean_ratio:.6}; {:?}", undeclared(dirty));
    assert_eq!(undeclared(dirty), undeclared(clean()), "{:#?}", dirty["effects"]);
    assert!((low..=high).contains(&clean_ratio), "{ratio} in [{low}, {high}], clean {clean_ratio}");
}

/// The paper's campaign with every recording whose name begins with `prefix` changed.
fn changed(prefix: &str, change: impl Fn(String) -> Vec<u8>) -> Value {
    let bench = Bench::paper();
    for name in bench.recordings(prefix) {
        bench.write(&name, change(bench.read(&name)));
    }
    report(&bench.campaign())
}

#[test]
fn semicolons_and_decimal_commas_change_nothing() {
    assert_same_answer(&changed("r", |text| text.replace(',', ";").replace('.', ",").into_bytes()));
}

#[test]
fn windows_line_ends_change_nothing() {
    assert_same_answer(&changed("r", |text| text.replace('\n', "\r\n").into_bytes()));
}

#[test]
fn a_byte_order_mark_changes_nothing() {
    assert_same_answer(&changed("r", |text| format!("\u{feff}{text}").into_bytes()));
}

#[test]
fn empty_cells_cost_their_rows_and_no_more() {
    let dirty = changed("r", |text| {
        let mut sheet = Sheet::of(&text);
        let columns = sheet.header.len();
        for i in (37..sheet.rows.len()).step_by(53) {
            let cell = match i % 3 {
                0 => "",
                1 => "NaN",
                _ => " ",
            };
            // any column but the time, or else every column after it
            sheet.rows[i][1 + i % (columns - 1)] = cell.into();
            if i % 7 == 0 {
                sheet.rows[i][1..].fill(String::new());
            }
        }
        sheet.text().into_bytes()
    });
    assert_same_answer(&dirty);
    let dropped = dirty["runs"][0]["dropped"].to_string();
    assert!(dropped.contains("empty or not a number"), "{dropped}");
}

#[test]
fn repeated_time_stamps_are_dropped_and_counted() {
    let dirty = changed("r", |text| {
        let mut sheet = Sheet::of(&text);
        for i in (40..sheet.rows.len()).step_by(97).collect::<Vec<_>>().into_iter().rev() {
            let again = sheet.rows[i].clone();
            sheet.rows.insert(i, again);
        }
        sheet.text().into_bytes()
    });
    assert_same_answer(&dirty);
    let dropped = dirty["runs"][0]["dropped"].to_string();
    assert!(dropped.contains("repeated time stamp"), "{dropped}");
}

#[test]
fn a_cut_off_last_line_is_dropped_and_counted() {
    let dirty = changed("r", |mut text| {
        let last = text.trim_end().rfind('\n').unwrap();
        text.truncate(last + 20);
        text.into_bytes()
    });
    assert_same_answer(&dirty);
    let dropped = dirty["runs"][0]["dropped"].to_string();
    assert!(dropped.contains("cut-off last line"), "{dropped}");
}

#[test]
fn spikes_in_one_row_of_a_hundred_are_set_aside() {
    let dirty = changed("rot", |text| {
        let mut sheet = Sheet::of(&text);
        sheet.set("xc_v", |i, v| match i % 100 {
            // not evenly spaced: 1 % of the rows
            place if place == (i / 100 * 37) % 100 => v + if i % 2 == 0 { 0.5 } else { -0.5 },
            _ => v,
        });
        sheet.text().into_bytes()
    });
    assert_same_answer(&dirty);
    assert!(warnings(&dirty).iter().any(|w| w.contains("spikes")), "{:?}", warnings(&dirty));
}

#[test]
fn spikes_in_a_ring_down_are_set_aside() {
    let dirty = changed("ringdown", |text| {
        let mut sheet = Sheet::of(&text);
        sheet.set("xc_v", |i, v| match i % 100 {
            place if place == (i / 100 * 37) % 100 => v + if i % 2 == 0 { 0.5 } else { -0.5 },
            _ => v,
        });
        sheet.text().into_bytes()
    });
    assert_same_answer(&dirty);
    let [clean_ratio, ..] = estimate(&clean()["actuation_gain_ratio"]);
    let [ratio, low, high] = estimate(&dirty["actuation_gain_ratio"]);
    assert!((low..=high).contains(&clean_ratio), "actuation ratio {ratio} in [{low}, {high}], clean {clean_ratio}");
}

#[test]
fn a_gap_of_half_a_second_breaks_nothing() {
    let dirty = changed("r", |text| {
        let mut sheet = Sheet::of(&text);
        let t = sheet.numbers("t_s");
        let middle = 0.4 * t[t.len() - 1];
        let mut row = 0;
        sheet.rows.retain(|_| {
            row += 1;
            !(middle..middle + 0.5).contains(&t[row - 1])
        });
        sheet.text().into_bytes()
    });
    assert_same_answer(&dirty);
}

#[test]
fn a_campaign_in_parquet_gives_the_same_answer() {
    let bench = Bench::paper();
    for name in bench.recordings("r") {
        let recording = Recording::read(&bench.path(&name)).unwrap();
        let mut bytes = Vec::new();
        recording.write_parquet(&mut bytes).unwrap();
        bench.write(&name.replace(".csv", ".parquet"), bytes);
        fs::remove_file(bench.path(&name)).unwrap();
    }
    bench.replace("campaign.toml", ".csv\"", ".parquet\"");
    let again = report(&bench.campaign());
    assert_same_answer(&again);
    for key in ["detection_gain_ratio", "actuation_gain_ratio", "angular_gain", "heldout", "effects"] {
        assert_eq!(again[key], clean()[key], "{key}");
    }
}

#[test]
fn the_table_angle_does_as_well_as_the_rate() {
    let mut settings = Scenario::paper().settings().clone();
    for run in &mut settings.runs {
        if let Run::Rotation { reference, .. } = run {
            *reference = Reference::Table;
        }
    }
    let bench = Bench::simulated(settings);
    let sheet = Sheet::of(&bench.read("rot+500.csv"));
    assert!(!sheet.header.iter().any(|name| name == "rate_dps"));
    assert_same_answer(&report(&bench.campaign()));
    // wrapped to a turn, as an encoder gives it
    for name in bench.recordings("rot") {
        bench.change(&name, |text| {
            let mut sheet = Sheet::of(&text);
            sheet.set("table_deg", |_, v| v.rem_euclid(360.0));
            sheet.text()
        });
    }
    assert_same_answer(&report(&bench.campaign()));
}

#[test]
fn the_instrument_s_own_angle_is_enough_for_the_detection_gains() {
    let mut settings = Scenario::paper().settings().clone();
    settings.theta_deg = true;
    settings.runs.retain(|run| matches!(run, Run::Rotation { .. }));
    let bench = Bench::simulated(settings);
    for name in bench.recordings("rot") {
        bench.change(&name, |text| Sheet::of(&text).only(&["t_s", "rate_dps", "theta_deg"]).text());
    }
    let alone = report(&bench.campaign());
    assert_report(&alone);
    let [ratio, low, high] = estimate(&alone["detection_gain_ratio"]);
    println!("detection ratio {ratio:.6} in [{low:.6}, {high:.6}]; {:?}", undeclared(&alone));
    assert!((low..=high).contains(&DETECTION_RATIO), "{ratio} in [{low}, {high}]");
    assert!(alone["actuation_gain_ratio"].is_null(), "no command was recorded");
    assert!(warnings(&alone).iter().any(|w| w.contains("actuation gain ratio")), "{:?}", warnings(&alone));
    let [raw, discovered] = ["raw", "discovered"].map(|stage| number(&alone["heldout"][stage]["rms_deg"]));
    assert!(discovered < raw / 10.0, "{raw}° to {discovered}°");
    assert!(!undeclared(&alone).is_empty(), "a fourth harmonic of 40 mdeg is left unsaid");
}

#[test]
fn a_single_recording_is_a_campaign_of_one_run() {
    let bench = Bench::paper();
    let (recording, out) = (bench.path("rot+500.csv"), bench.path("out"));
    cvg_ok(&[OsStr::new("identify"), recording.as_os_str(), OsStr::new("--out"), out.as_os_str()]);
    let alone: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_report(&alone);
    assert_eq!(alone["device"], "rot+500");
    let [ratio, low, high] = estimate(&alone["detection_gain_ratio"]);
    println!("detection ratio {ratio:.6} in [{low:.6}, {high:.6}]; {:?}", undeclared(&alone));
    assert!((low..=high).contains(&DETECTION_RATIO), "{ratio} in [{low}, {high}]");
    assert!(high - low < 0.02, "[{low}, {high}]");
    // one rate and one amplitude do not tell a cubic readout from a cubic spring
    let left = alone["effects"].as_array().unwrap().iter().find(|e| e["origin"] != "declared").unwrap();
    assert_eq!(left["origin"], "empirical", "{left}");
    assert!(left["confounded_with"].as_array().unwrap().contains(&"detection-cubic".into()), "{left}");
    assert!(left["separated_by"].as_str().is_some_and(|s| s.contains("rotation run")), "{left}");
    assert!(warnings(&alone).iter().any(|w| w.contains("actuation gain ratio")), "{:?}", warnings(&alone));
    let [raw, discovered] = ["raw", "discovered"].map(|stage| number(&alone["heldout"][stage]["rms_deg"]));
    assert!(discovered < raw / 10.0, "{raw}° to {discovered}°");
}
