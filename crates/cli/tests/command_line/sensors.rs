//! Sin/cos sensors as their users bring them: one file, no campaign, often nothing that says what they were turned by.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Bench, Sheet, cvg, cvg_ok};

/// Even noise of variance 1, from a counter.
fn noise(i: usize, seed: u64) -> f64 {
    let mut x = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed.wrapping_mul(0xd1b5_4a32_d192_ed03);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let even = (x ^ (x >> 31)) as f64 / u64::MAX as f64;
    (even - 0.5) * 12f64.sqrt()
}

const OFFSET: [f64; 2] = [0.12, -0.07];
const GAIN_RATIO: f64 = 1.04;
const SKEW: f64 = 0.015;
const CUBIC: f64 = 0.02;

/// A sensor in counts, turned at a speed that nobody wrote down: x = a (c + o_x), y = a (g (s + k c) + o_y), with a cubic.
fn turned_by_hand(unit: f64, cubic: f64, rail: f64, reference: bool) -> String {
    let mut text = String::from(if reference { "t_s,table_deg,xc_v,yc_v\n" } else { "t_s,xc_v,yc_v\n" });
    for i in 0..4000 {
        let t = i as f64 * 0.01;
        let table = 40.0 * t + 25.0 * (0.7 * t).sin();
        let (sin, cos) = table.to_radians().sin_cos();
        let c = |u: f64| u * (1.0 + 0.75 * cubic * u * u);
        let x = unit * (c(cos) + OFFSET[0] + 2e-4 * noise(i, 1));
        let y = unit * (GAIN_RATIO * c(sin + SKEW * cos) + OFFSET[1] + 2e-4 * noise(i, 2));
        let [x, y] = [x, y].map(|v| v.clamp(-rail, rail));
        let _ = if reference { writeln!(text, "{t},{table},{x},{y}") } else { writeln!(text, "{t},{x},{y}") };
    }
    text
}

fn written(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    path
}

fn sensor(file: &Path) -> Value {
    serde_json::from_str(&cvg_ok(&[OsStr::new("identify"), file.as_os_str(), "--sensor".as_ref(), "--json".as_ref()]))
        .unwrap()
}

/// Value and interval of a parameter.
fn parameter(report: &Value, effect: &str, name: &str) -> [f64; 3] {
    let effects = report["effects"].as_array().unwrap();
    let effect = effects.iter().find(|e| e["id"] == effect).unwrap_or_else(|| panic!("no {effect}: {effects:#?}"));
    let p = effect["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap().clone();
    [&p["value"], &p["ci95"][0], &p["ci95"][1]].map(|v| v.as_f64().unwrap())
}

/// Within the interval, widened by half: the check is one draw.
fn holds([value, low, high]: [f64; 3], set: f64) -> bool {
    (value - set).abs() <= 0.75 * (high - low)
}

#[test]
fn two_channels_without_a_reference_tell_offsets_gain_skew_and_cubic() {
    let folder = TempDir::new().unwrap();
    let unit = 900.0;
    let r = sensor(&written(&folder, "hall.csv", &turned_by_hand(unit, CUBIC, f64::INFINITY, false)));
    assert_eq!(r["status"], "answered");
    let ratio = &r["detection_gain_ratio"];
    let ratio = [&ratio["value"], &ratio["ci95"][0], &ratio["ci95"][1]].map(|v| v.as_f64().unwrap());
    assert!(holds(ratio, GAIN_RATIO) && (ratio[0] - GAIN_RATIO).abs() < 2e-3, "{ratio:?}");
    for (name, set) in [("offset_x", OFFSET[0]), ("offset_y", OFFSET[1])] {
        let p = parameter(&r, "detection-offset", name);
        assert!((p[0] / unit - set).abs() < 5e-4, "{name} {p:?}");
    }
    let skew = parameter(&r, "detection-skew", "skew");
    assert!((skew[0] - SKEW).abs() < 1e-3, "{skew:?}");
    let kappa = parameter(&r, "detection-cubic", "kappa");
    assert!((kappa[0] * unit * unit / CUBIC - 1.0).abs() < 0.15, "{kappa:?}");
    let (before, after) = (&r["radius"]["before"]["rms"], &r["radius"]["after"]["rms"]);
    assert!(after.as_f64().unwrap() < 3e-4 && before.as_f64().unwrap() > 0.05, "{before} {after}");
}

#[test]
fn what_cannot_be_seen_without_a_reference_is_null_and_said() {
    let folder = TempDir::new().unwrap();
    let file = written(&folder, "hall.csv", &turned_by_hand(1.0, 0.0, f64::INFINITY, false));
    let out = folder.path().join("out");
    let arguments: [&OsStr; 5] =
        ["identify".as_ref(), file.as_ref(), "--sensor".as_ref(), "--out".as_ref(), out.as_ref()];
    let said = cvg_ok(&arguments);
    assert!(said.contains("held-out radius") && said.contains("there is no reference"), "{said}");
    let r: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
    for path in
        ["/angular_gain", "/heldout/raw", "/heldout/declared", "/heldout/discovered", "/heldout/noise_floor_deg"]
    {
        assert!(r.pointer(path).unwrap().is_null(), "{path}");
    }
    let unseen = r["warnings"].to_string();
    for part in ["eccentric", "angular gain", "look alike"] {
        assert!(unseen.contains(part), "{part}: {unseen}");
    }
    assert!(r["effects"].as_array().unwrap().iter().all(|e| e["id"] != "detection-cubic"), "no cubic was put in");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("X and Y") && page.contains("of the radius"));
    // 0.015 of one channel in the other
    let skew = page.split_once("detection-skew: axes off a right angle by</td>").unwrap().1;
    let skew = skew.split_once("class=\"n\">").unwrap().1;
    let skew: f64 = skew.split_once('<').unwrap().0.parse().unwrap();
    assert!((skew - SKEW.atan().to_degrees()).abs() < 0.05, "{skew}°");
    assert!(fs::read_to_string(out.join("calibration.toml")).unwrap().contains("detection-offset"));
}

#[test]
fn a_channel_at_its_rail_is_seen_without_a_reference() {
    let folder = TempDir::new().unwrap();
    let r = sensor(&written(&folder, "hall.csv", &turned_by_hand(1.0, 0.0, 1.0, false)));
    let rail = r["effects"].as_array().unwrap().iter().find(|e| e["id"] == "detection-clip").cloned();
    assert!(rail.is_some_and(|e| e["parameters"].to_string().contains("1.0")), "{:#}", r["effects"]);
    assert!((r["detection_gain_ratio"]["value"].as_f64().unwrap() - GAIN_RATIO).abs() < 5e-3);
}

#[test]
fn less_than_half_a_turn_without_a_reference_is_no_answer() {
    let folder = TempDir::new().unwrap();
    let whole = turned_by_hand(1.0, 0.0, f64::INFINITY, false);
    let file = written(&folder, "arc.csv", &whole.lines().take(200).map(|l| format!("{l}\n")).collect::<String>());
    let outcome = cvg(&[OsStr::new("identify"), file.as_ref(), "--sensor".as_ref()]);
    assert_eq!(outcome.status, 1, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("rows all around the turn"), "{}", outcome.stderr);
}

#[test]
fn an_angle_alone_says_nothing_of_itself() {
    let folder = TempDir::new().unwrap();
    let text: String = (0..500).map(|i| format!("{},{}\n", i, 3 * i % 360)).collect();
    let file = written(&folder, "angle.csv", &format!("t_s,theta_deg\n{text}"));
    let campaign = written(
        &folder,
        "campaign.toml",
        "[campaign]\ndevice = \"e\"\ninstrument = \"sensor\"\nreference = \"none\"\n[[run]]\nkind = \"rotation\"\nfile = \"angle.csv\"\n",
    );
    for path in [file, campaign] {
        let outcome = cvg(&[OsStr::new("identify"), path.as_ref(), "--sensor".as_ref()]);
        assert_eq!(outcome.status, 2, "{}", outcome.stderr);
        assert!(outcome.stderr.contains("xc_v"), "{}", outcome.stderr);
    }
}

#[test]
fn a_reference_that_is_not_to_be_used_is_not_used() {
    let folder = TempDir::new().unwrap();
    written(&folder, "hall.csv", &turned_by_hand(1.0, 0.0, f64::INFINITY, true));
    let head = "[campaign]\ndevice = \"hall\"\ninstrument = \"sensor\"\n";
    let run = "[[run]]\nkind = \"rotation\"\nfile = \"hall.csv\"\n";
    let told = |more: &str| {
        let campaign = written(&folder, "campaign.toml", &format!("{head}{more}{run}"));
        crate::support::report(&campaign)
    };
    assert!(told("reference = \"none\"\n")["angular_gain"].is_null());
    assert!(told("")["angular_gain"]["value"].is_number());
}

/// By Equation 1 k = −1 counts with the turn. A campaign that states 1 keeps its sign, and the sense is said as it was seen.
#[test]
fn the_sense_is_said_as_it_was_seen_whatever_sign_is_stated() {
    let folder = TempDir::new().unwrap();
    written(&folder, "hall.csv", &turned_by_hand(1.0, 0.0, f64::INFINITY, true));
    for gain in ["1.0", "-1.0"] {
        let head = format!("[campaign]\ndevice = \"hall\"\ninstrument = \"sensor\"\nangular_gain = {gain}\n");
        let text = format!("{head}[[run]]\nkind = \"rotation\"\nfile = \"hall.csv\"\n");
        let campaign = written(&folder, "campaign.toml", &text);
        let said = cvg(&[OsStr::new("identify"), campaign.as_ref()]);
        let line = said.stdout.lines().find(|l| l.contains("periods a turn")).unwrap_or_default().to_owned();
        assert!(line.ends_with("1 period a turn, counting with the reference"), "{gain}: {line} {}", said.stderr);
    }
}

#[test]
fn a_sensor_given_as_a_gyroscope_is_told_what_it_looks_like() {
    let folder = TempDir::new().unwrap();
    let with = written(&folder, "resolver.csv", &turned_by_hand(1.0, 0.0, f64::INFINITY, true));
    let given = cvg(&[OsStr::new("identify"), with.as_ref()]);
    assert!(format!("{}{}", given.stdout, given.stderr).contains("--sensor"), "{}{}", given.stdout, given.stderr);
    let r = sensor(&with);
    assert_eq!((r["instrument"].as_str(), r["angular_gain"]["value"].as_f64()), (Some("sensor"), Some(-1.0)));
    let without = written(&folder, "hall.csv", &turned_by_hand(1.0, 0.0, f64::INFINITY, false));
    let given = cvg(&[OsStr::new("identify"), without.as_ref()]);
    assert_eq!(given.status, 2);
    assert!(given.stderr.contains("--sensor"), "{}", given.stderr);
}

#[test]
fn a_gyroscope_given_as_a_sensor_is_told_what_it_looks_like() {
    let bench = Bench::small();
    let file = bench.path("rot+500.csv");
    let given = cvg(&[OsStr::new("identify"), file.as_ref(), "--sensor".as_ref()]);
    assert!(format!("{}{}", given.stdout, given.stderr).contains("look like a gyroscope"), "{given:?}");
}

#[test]
fn a_folder_is_the_campaign_in_it() {
    let bench = Bench::small();
    let folder = bench.campaign().parent().unwrap().to_owned();
    assert_eq!(crate::support::report(&folder), crate::support::report(&bench.campaign()));
}

#[test]
fn a_constant_rate_of_the_campaign_stands_in_for_the_column() {
    let bench = Bench::small();
    let wanted = crate::support::report(&bench.campaign());
    for (name, rate) in [("rot+500.csv", 500), ("rot-300.csv", -300), ("check.csv", 400)] {
        let sheet = Sheet::of(&bench.read(name));
        let kept: Vec<&str> = sheet.header.iter().map(String::as_str).filter(|c| *c != "rate_dps").collect();
        bench.write(name, sheet.only(&kept).text());
        bench.replace(
            "campaign.toml",
            &format!("file = \"{name}\"\n"),
            &format!("file = \"{name}\"\nrate_dps = {rate}\n"),
        );
    }
    let found = crate::support::report(&bench.campaign());
    for key in ["angular_gain", "detection_gain_ratio", "heldout"] {
        assert_eq!(found[key], wanted[key], "{key}");
    }
}

#[test]
fn what_is_recorded_in_counts_is_said_in_counts() {
    let folder = TempDir::new().unwrap();
    let whole = |text: String| -> String {
        let cell = |(at, cell): (usize, &str)| match (at, cell.parse::<f64>()) {
            (0, _) | (_, Err(_)) => cell.to_owned(),
            (_, Ok(v)) => format!("{v:.0}"),
        };
        text.lines().map(|line| line.split(',').enumerate().map(cell).collect::<Vec<_>>().join(",") + "\n").collect()
    };
    let counted = whole(turned_by_hand(20_000.0, 0.0, f64::INFINITY, false));
    let stated = turned_by_hand(1.0, 0.0, f64::INFINITY, false).replacen('\n', "\ns,uT,uT\n", 1);
    let volts = turned_by_hand(1.0, 0.0, f64::INFINITY, false);
    for (text, unit) in [(counted, "counts"), (stated, "uT"), (volts, "V")] {
        let (file, out) = (written(&folder, "encoder.csv", &text), folder.path().join(unit));
        let arguments: [&OsStr; 5] =
            ["identify".as_ref(), file.as_ref(), "--sensor".as_ref(), "--out".as_ref(), out.as_ref()];
        let said = cvg_ok(&arguments);
        let r: Value = serde_json::from_slice(&fs::read(out.join("report.json")).unwrap()).unwrap();
        let units: Vec<&str> = r["effects"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|e| e["parameters"].as_array().unwrap())
            .map(|p| p["unit"].as_str().unwrap())
            .collect();
        assert!(units.contains(&unit) && (unit == "V" || !units.iter().any(|u| u.contains('V'))), "{units:?}");
        assert!(said.contains(&format!(" {unit}, offset_y")), "{said}");
        let calibration = fs::read_to_string(out.join("calibration.toml")).unwrap();
        assert_eq!(calibration.contains(&format!("readout_unit = \"{unit}\"")), unit != "V", "{calibration}");
    }
}

/// The page of a sensor's identification.
fn page(folder: &TempDir, file: &Path) -> String {
    let out = folder.path().join("results");
    let arguments: [&OsStr; 5] =
        ["identify".as_ref(), file.as_ref(), "--sensor".as_ref(), "--out".as_ref(), out.as_ref()];
    cvg_ok(&arguments);
    fs::read_to_string(out.join("report.html")).unwrap()
}

#[test]
fn the_first_figure_of_two_channels_is_what_they_draw_with_a_reference_as_well() {
    let folder = TempDir::new().unwrap();
    let page = page(&folder, &written(&folder, "hall.csv", &turned_by_hand(1.0, 0.0, f64::INFINITY, true)));
    let at = |id: &str| page.find(&format!("id=\"plot-{id}\"")).unwrap_or_else(|| panic!("no figure {id}"));
    // no word of gyroscopes is a sensor's, but in the facts for programs
    let for_people = page.split_once("<summary>report.json").unwrap().0.to_lowercase();
    let body = for_people.split_once("<body>").unwrap().1;
    assert!(!body.contains("pattern") && !body.contains("ieee") && !body.contains("gyroscope"), "{body}");
    assert!(at("circle") < at("radius") && at("radius") < at("bias"));
    let json = page.split_once("id=\"figures\">").unwrap().1.split_once("</script>").unwrap().0;
    let figures: Value = serde_json::from_str(json).unwrap();
    let circle = figures.as_array().unwrap().iter().find(|f| f["id"] == "circle").unwrap();
    let off = |name: &str| -> f64 {
        let trace = circle["traces"].as_array().unwrap().iter().find(|t| t["name"] == name).unwrap();
        let [x, y] = ["x", "y"].map(|k| trace[k].as_array().unwrap());
        let radii = x.iter().zip(y).map(|(x, y)| x.as_f64().unwrap().hypot(y.as_f64().unwrap()));
        radii.fold(0.0, |m: f64, r| m.max((r - 1.0).abs()))
    };
    assert!(off("raw") > 0.1 && off("discovered") < 2e-3, "{} {}", off("raw"), off("discovered"));
}

#[test]
fn what_belongs_to_the_table_is_no_error_of_the_device() {
    let folder = TempDir::new().unwrap();
    let mut text = String::from("t_s,table_deg,theta_deg\n");
    for i in 0..4000 {
        let table = 0.36 * i as f64;
        let of_device = 0.1 * (2.0 * table.to_radians()).sin();
        let of_table = 0.2 * (50.0 * table.to_radians()).sin();
        let theta = table + of_device + of_table + 0.01 * noise(i, 5);
        let _ = writeln!(text, "{},{table},{theta}", i as f64 * 0.01);
    }
    let page = page(&folder, &written(&folder, "encoder.csv", &text));
    let headline = page.split_once("<p class=\"headline\">").unwrap().1.split_once("<div").unwrap().0;
    // 0.1° and 0.2° of amplitude over one turn: 0.156° rms about the best line, of which the device has 0.066°
    assert!(headline.contains("0.156°") && headline.contains("6.6 times less"), "{headline}");
    assert!(headline.contains("0.141° rms of it are the table's"), "{headline}");
}

/// What is drawn by a sensor of this amplitude, offset and gain ratio, turned by hand through `periods` periods a turn; with
/// the angle of the shaft, deg.
struct Drawn {
    amplitude: f64,
    offset: f64,
    gain: f64,
    periods: f64,
    seed: u64,
}

const DRAWN: Drawn = Drawn { amplitude: 1.0, offset: 0.05, gain: 1.04, periods: 1.0, seed: 0 };

impl Drawn {
    /// The rows, each as `cells` makes it of time, angle of the shaft and both readings.
    fn text(&self, header: &str, cells: impl Fn(f64, f64, f64, f64) -> Vec<f64>) -> String {
        let mut text = format!("{header}\n");
        for i in 0..3000 {
            let t = f64::from(i) * 0.01;
            let shaft = 40.0 * t + 25.0 * (0.7 * t).sin();
            let (sin, cos) = (self.periods * shaft).to_radians().sin_cos();
            let x = self.amplitude * (cos + self.offset + 2e-4 * noise(i as usize, 11 + self.seed));
            let y = self.amplitude * (self.gain * sin - self.offset + 2e-4 * noise(i as usize, 101 + self.seed));
            let row: Vec<String> = cells(t, shaft, x, y).iter().map(f64::to_string).collect();
            let _ = writeln!(text, "{}", row.join(","));
        }
        text
    }

    fn blind(&self) -> String {
        self.text("t_s,xc_v,yc_v", |t, _, x, y| vec![t, x, y])
    }

    fn with_shaft(&self) -> String {
        self.text("t_s,table_deg,xc_v,yc_v", |t, shaft, x, y| vec![t, shaft, x, y])
    }
}

fn given(files: &[&Path]) -> crate::support::Outcome {
    let mut arguments: Vec<&OsStr> = vec!["identify".as_ref()];
    arguments.extend(files.iter().map(|f| f.as_os_str()));
    arguments.push("--sensor".as_ref());
    let mut outcome = cvg(&arguments);
    // what is said beside an answer stands in its summary
    outcome.stderr = format!("{}{}", outcome.stdout, outcome.stderr);
    outcome
}

#[test]
fn a_run_of_another_sensor_or_in_another_unit_is_named_with_and_without_a_reference() {
    let folder = TempDir::new().unwrap();
    let other = Drawn { offset: -0.04, gain: 0.97, ..DRAWN };
    let millivolts = Drawn { amplitude: 1e3, ..DRAWN };
    for (of, text) in [(Drawn::blind as fn(&Drawn) -> String, "blind"), (Drawn::with_shaft, "shaft")] {
        let [a, b, c] = [("a", 1), ("b", 2), ("c", 3)]
            .map(|(n, seed)| written(&folder, &format!("{text}-{n}.csv"), &of(&Drawn { seed, ..DRAWN })));
        let odd = written(&folder, &format!("{text}-odd.csv"), &of(&other));
        let scaled = written(&folder, &format!("{text}-scaled.csv"), &of(&millivolts));
        let two = given(&[&a, &odd]);
        assert_eq!(two.status, 1, "{}", two.stdout);
        assert!(two.stderr.contains("odd.csv: its channels do not draw what those of"), "{}", two.stderr);
        let two = given(&[&a, &scaled]);
        assert!(two.status == 1 && two.stderr.contains("scaled.csv: its amplitude is 9.99"), "{}", two.stderr);
        let many = given(&[&a, &b, &c, &odd]);
        assert_eq!(many.status, 0, "{}", many.stderr);
        let is_the_ratio = |word: &str| word.parse::<f64>().is_ok_and(|ratio| (ratio - 1.04).abs() < 5e-5);
        assert!(many.stderr.contains("odd.csv: left out"), "{many:?}");
        assert!(many.stdout.split_whitespace().any(is_the_ratio), "{many:?}");
    }
}

#[test]
fn a_channel_that_stands_still_is_named() {
    let folder = TempDir::new().unwrap();
    let text = DRAWN.text("t_s,table_deg,xc_v,yc_v", |t, shaft, x, _| vec![t, shaft, x, 0.3]);
    let told = given(&[&written(&folder, "dead.csv", &text)]);
    assert!(told.status == 1 && told.stderr.contains("dead.csv: yc_v stands still, at 0.3"), "{}", told.stderr);
}

#[test]
fn periods_that_are_no_whole_number_are_doubted_with_the_unit_that_would_make_them_one() {
    let folder = TempDir::new().unwrap();
    let scaled =
        |factor: f64| DRAWN.text("t_s,table_deg,xc_v,yc_v", move |t, shaft, x, y| vec![t, factor * shaft, x, y]);
    let gon = given(&[&written(&folder, "gon.csv", &scaled(1.0 / 0.9))]);
    assert!(gon.status == 0 && gon.stderr.contains("0.9000 periods a turn is no whole number"), "{}", gon.stderr);
    assert!(gon.stderr.contains("the reference were in gon"), "{}", gon.stderr);
    let geared = given(&[&written(&folder, "geared.csv", &scaled(1.0 / 2.5))]);
    assert!(geared.stderr.contains("2.5000 periods a turn is no whole number"), "{}", geared.stderr);
    let rad = given(&[&written(&folder, "rad.csv", &scaled(1f64.to_radians()))]);
    assert!(rad.status == 1 && rad.stderr.contains("the reference were in rad"), "{}", rad.stderr);
    let whole = given(&[&written(&folder, "whole.csv", &scaled(1.0))]);
    assert!(!whole.stderr.contains("whole number"), "{}", whole.stderr);
}

/// 100 periods a turn, 190° of them from row to row at an even speed, look like 89.47 the other way.
#[test]
fn rows_between_which_the_angle_may_have_gone_either_way_are_no_answer() {
    let folder = TempDir::new().unwrap();
    let mut text = String::from("t_s,table_deg,xc_v,yc_v\n");
    for i in 0..2000 {
        let shaft = 1.9 * f64::from(i);
        let (sin, cos) = (100.0 * shaft).to_radians().sin_cos();
        let _ = writeln!(text, "{},{shaft},{},{}", f64::from(i) * 0.01, cos + 2e-4 * noise(i as usize, 3), 1.04 * sin);
    }
    let told = given(&[&written(&folder, "fine.csv", &text)]);
    assert!(told.status == 1 && told.stderr.contains("periods a turn fit, and 100 as well"), "{}", told.stderr);
}

#[test]
fn a_reference_that_slips_is_named_with_its_time() {
    let folder = TempDir::new().unwrap();
    let slips = DRAWN
        .text("t_s,table_deg,xc_v,yc_v", |t, shaft, x, y| vec![t, shaft + f64::from(u8::from(t > 15.0)) * 2.0, x, y]);
    let told = given(&[&written(&folder, "slips.csv", &slips)]);
    assert!(
        told.stderr.contains("slips.csv: the angle and its reference part by") && told.stderr.contains("at 15.010 s"),
        "{}",
        told.stderr
    );
    let sound = given(&[&written(&folder, "sound.csv", &DRAWN.with_shaft())]);
    assert!(!sound.stderr.contains("part by"), "{}", sound.stderr);
}

#[test]
fn an_amplitude_that_changes_in_the_course_of_a_run_is_named() {
    let folder = TempDir::new().unwrap();
    let fades =
        DRAWN.text("t_s,xc_v,yc_v", |t, _, x, y| vec![t, x * (1.0 - 0.05 * t / 30.0), y * (1.0 - 0.05 * t / 30.0)]);
    let told = given(&[&written(&folder, "fades.csv", &fades)]);
    assert!(told.stderr.contains("fades.csv: the amplitude changes by 2.9 %"), "{}", told.stderr);
    assert!(!given(&[&written(&folder, "even.csv", &DRAWN.blind())]).stderr.contains("amplitude changes"));
}

#[test]
fn an_angle_in_counts_or_in_radians_is_told_what_it_looks_like() {
    let folder = TempDir::new().unwrap();
    let word = |turn: f64, whole: bool| {
        DRAWN.text("t_s,table_deg,theta_deg", move |t, shaft, _, _| {
            let value = (shaft + 0.4 * (shaft.to_radians() + 1.0).sin()).rem_euclid(360.0) / 360.0 * turn;
            vec![t, shaft, if whole { value.floor() } else { value }]
        })
    };
    let counts = given(&[&written(&folder, "word.csv", &word(16384.0, true))]);
    assert!(
        counts.status == 1 && counts.stderr.contains("counts of 14 bits; wanted: degrees: theta_deg = \"…/45.511111\""),
        "{}",
        counts.stderr
    );
    let rad = given(&[&written(&folder, "rad.csv", &word(std::f64::consts::TAU, false))]);
    assert!(rad.status == 1 && rad.stderr.contains("as if in rad (theta_deg = \"…*57.29578\""), "{}", rad.stderr);
}

/// What the page on signs says: three mistakes that look alike, and the ratio of the third.
#[test]
fn what_a_sign_means_and_what_cannot_be_told_is_as_the_page_on_signs_says() {
    let folder = TempDir::new().unwrap();
    let mut page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/signs.md")).unwrap();
    page.retain(|c| c != '`');
    let drawn = Drawn { periods: 4.0, ..DRAWN };
    let header = "t_s,table_deg,xc_v,yc_v";
    for (what, text, k, ratio) in [
        ("as it is", drawn.with_shaft(), -4.0, 1.04),
        ("the reference the other way", drawn.text(header, |t, a, x, y| vec![t, -a, x, y]), 4.0, 1.04),
        ("Y the other way", drawn.text(header, |t, a, x, y| vec![t, a, x, -y]), 4.0, 1.04),
        ("X and Y exchanged", drawn.text(header, |t, a, x, y| vec![t, a, y, x]), 4.0, 1.0 / 1.04),
    ] {
        let r = sensor(&written(&folder, "signs.csv", &text));
        let found = r["detection_gain_ratio"]["value"].as_f64().unwrap();
        assert_eq!(r["angular_gain"]["value"].as_f64(), Some(k), "{what}");
        assert!((found / ratio - 1.0).abs() < 1e-4, "{what}: {found}");
        assert!(page.contains(&format!("| {what} | {k} | {found:.4} |")), "{what}: {k} {found:.4}");
    }
}
