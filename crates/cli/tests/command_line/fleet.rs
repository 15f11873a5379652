//! A fleet: a row for each device, what is odd and what is shared, and an answer that is there is kept.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use cvg_calibration::recording::{Campaign, Cells, Channel, Lake, RunKind, Values, write_parquet};
use cvg_model::effects::EffectId;
use cvg_simulator::scenario::EffectSetting;
use cvg_simulator::{Scenario, Settings};
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{Outcome, SMALL, Sheet, cvg};

/// Devices of the fleet; the last has a cubic readout that the others lack.
const DEVICES: usize = 12;

fn devices(folder: &Path) {
    for number in 0..DEVICES {
        let plain = Scenario::parse(SMALL).unwrap().settings().clone();
        let mut settings = Settings { device: format!("unit-{number:02}"), seed: 100 + number as u64, ..plain };
        if number + 1 == DEVICES {
            settings.effects.push(EffectSetting::new(EffectId::DetectionCubic, [0.01, 0.0, 0.0, 0.0]).unwrap());
        }
        let own = folder.join(format!("unit-{number:02}"));
        Scenario::new(settings).unwrap().simulate().write(&own).unwrap();
    }
}

fn fleet(devices: &Path, out: &Path) -> Outcome {
    cvg(&[OsStr::new("fleet"), devices.as_os_str(), OsStr::new("--out"), out.as_os_str()])
}

fn facts(out: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(out.join("fleet.json")).unwrap()).unwrap()
}

fn rows(out: &Path) -> Sheet {
    Sheet::of(&fs::read_to_string(out.join("fleet.csv")).unwrap())
}

fn results_of(out: &Path, number: usize) -> PathBuf {
    out.join(format!("unit-{number:02}")).join("report.json")
}

#[test]
fn every_device_is_a_row_and_the_odd_one_is_named() {
    let (folder, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    devices(folder.path());
    // one that cannot be read, and one whose angle follows nothing
    fs::write(folder.path().join("unit-03/campaign.toml"), "[campaign]\ndevice = 3\n").unwrap();
    let outcome = fleet(folder.path(), out.path());
    assert_eq!(outcome.status, 0, "{}", outcome.stderr);

    let facts = facts(out.path());
    assert_eq!((facts["devices"].as_u64(), facts["answered"].as_u64()), (Some(12), Some(11)));
    assert_eq!(facts["refused"], 1);
    let odd = facts["odd"].as_array().unwrap();
    let cubic = odd.iter().find(|o| o["device"] == "unit-11").expect("the device with a cubic readout");
    assert!(cubic["by"].as_array().unwrap().contains(&"detection-cubic".into()), "{cubic}");
    assert_eq!(odd.len(), 1, "{odd:?}");
    assert!(facts["effects"].as_array().unwrap().iter().all(|e| e["shared"] == false), "{}", facts["effects"]);
    let ratio = &facts["parameters"]["detection_gain_ratio"];
    assert_eq!(ratio["devices"], 11);

    let sheet = rows(out.path());
    assert_eq!(sheet.rows.len(), DEVICES);
    let status = sheet.index("status");
    assert_eq!(sheet.rows.iter().filter(|r| r[status] == "answered").count(), 11);
    let low = sheet.index("detection_gain_ratio.low");
    assert!(sheet.rows[0][low].parse::<f64>().unwrap() < sheet.rows[0][low + 1].parse().unwrap());
    assert!(outcome.stdout.contains("odd: unit-11"), "{}", outcome.stdout);
    assert!(outcome.stdout.contains("refused: "), "{}", outcome.stdout);

    let page = fs::read_to_string(out.path().join("fleet.html")).unwrap();
    for wanted in [
        "11 of 12 answered, 1 odd",
        "detection-cubic: gains",
        "an exception",
        "by serial number",
        "unit-03",
        "<summary>fleet.json<",
    ] {
        assert!(page.contains(wanted), "{wanted}");
    }
    let line = &facts["quantities"]["detection_gain_ratio"];
    assert!(line["control"]["upper"].as_f64() > line["centre"].as_f64(), "{line}");
    assert_eq!(line["change"], Value::Null, "drawn alike from the first to the last");
}

#[test]
fn an_answer_is_the_same_as_by_identify_and_is_kept_while_its_files_are() {
    let (folder, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    devices(folder.path());
    assert_eq!(fleet(folder.path(), out.path()).status, 0);
    let alone =
        cvg(&[OsStr::new("identify"), folder.path().join("unit-02/campaign.toml").as_os_str(), OsStr::new("--json")]);
    assert_eq!(alone.stdout.trim_end(), fs::read_to_string(results_of(out.path(), 2)).unwrap());

    // what the fleet says beforehand is asked for, states itself, and is in no report
    let prior = out.path().join("fleet-prior.csv");
    assert!(!prior.exists());
    let before = fs::read(results_of(out.path(), 2)).unwrap();
    let arguments = [folder.path().as_os_str(), OsStr::new("--out"), out.path().as_os_str(), OsStr::new("--prior")];
    let asked = cvg(&[&[OsStr::new("fleet")], &arguments[..]].concat());
    assert!(prior.exists() && asked.stdout.contains("fleet-prior.csv: a prior from the fleet"), "{}", asked.stdout);
    assert!(facts(out.path())["prior"]["statement"].as_str().unwrap().contains("without it"));
    assert_eq!(fs::read(results_of(out.path(), 2)).unwrap(), before);

    let written = |number: usize| fs::metadata(results_of(out.path(), number)).unwrap().modified().unwrap();
    let before = [written(1), written(2)];
    let first = fs::read_to_string(out.path().join("fleet.csv")).unwrap();
    // a device is measured again
    let recording = folder.path().join("unit-01/campaign.toml");
    let text = fs::read_to_string(&recording).unwrap();
    fs::write(&recording, format!("{text}\n# measured again\n")).unwrap();
    assert_eq!(fleet(folder.path(), out.path()).status, 0);
    assert!(written(1) > before[0], "what changed is identified anew");
    assert_eq!(written(2), before[1], "what did not is kept");
    assert_eq!(fs::read_to_string(out.path().join("fleet.csv")).unwrap(), first);
    assert!(!prior.exists(), "it is of the answers before");
}

/// What somebody does to a file.
type Harm<'a> = &'a dyn Fn(&Path);

#[test]
fn an_answer_that_is_not_whole_or_is_another_is_made_anew_and_one_of_an_earlier_day_is_no_answer() {
    let (folder, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    devices(folder.path());
    for number in 2..DEVICES {
        fs::remove_dir_all(folder.path().join(format!("unit-{number:02}"))).unwrap();
    }
    assert_eq!(fleet(folder.path(), out.path()).status, 0);
    let own = |number: usize, name: &str| out.path().join(format!("unit-{number:02}")).join(name);
    let all = || ["report.json", "calibration.toml", "source.json"].map(|name| fs::read(own(0, name)).ok());
    let whole = all();
    assert!(whole.iter().all(Option::is_some));
    let harm: [(&str, Harm<'_>); 5] = [
        ("calibration.toml", &|file| fs::remove_file(file).unwrap()),
        ("calibration.toml", &|file| fs::write(file, "device = \"another\"\n").unwrap()),
        ("report.json", &|file| fs::write(file, fs::read_to_string(file).unwrap() + " ").unwrap()),
        ("source.json", &|file| fs::remove_file(file).unwrap()),
        // by another build of the same version
        ("source.json", &|file| {
            let mut said: Value = serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap();
            said["program"] = "00000000".into();
            fs::write(file, format!("{said:#}\n")).unwrap();
        }),
    ];
    for (name, harm) in harm {
        harm(&own(0, name));
        assert_eq!(fleet(folder.path(), out.path()).status, 0);
        assert!(all() == whole, "{name}");
    }
    // a device that can no longer be read
    fs::write(folder.path().join("unit-00/campaign.toml"), "[campaign]\ndevice = 3\n").unwrap();
    assert_eq!(fleet(folder.path(), out.path()).status, 0);
    assert_eq!(facts(out.path())["refused"], 1);
    assert!(all().iter().all(Option::is_none), "what was answered is of another day");
    assert!(own(1, "report.json").is_file());
}

#[test]
fn a_fleet_without_an_answer_and_a_folder_without_a_campaign_say_so() {
    let (folder, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let empty = fleet(folder.path(), out.path());
    assert_eq!(empty.status, 2, "{}", empty.stderr);
    assert!(empty.stderr.contains("no campaign.toml"), "{}", empty.stderr);
    fs::create_dir(folder.path().join("one")).unwrap();
    fs::write(folder.path().join("one/campaign.toml"), "[campaign]\n").unwrap();
    let none = fleet(folder.path(), out.path());
    assert_eq!(none.status, 1, "{}", none.stderr);
    assert_eq!(rows(out.path()).rows.len(), 1);
}

/// As many devices as `CVG_TRIALS` says, 40 without it, one in twenty odd by an effect or a gain of its own, all with the skew of a common
/// board: the odd ones are found, hardly another is named, and the skew is the board's.
#[test]
fn of_many_devices_the_odd_ones_are_found_and_what_all_have_is_shared() {
    let trials = std::env::var("CVG_TRIALS").ok().and_then(|text| text.parse::<usize>().ok());
    let count = trials.unwrap_or(40);
    let effect = |id, values| EffectSetting::new(id, values).unwrap();
    let kinds = [
        effect(EffectId::DetectionCubic, [0.01, 0.0, 0.0, 0.0]),
        effect(EffectId::DetectionOffset, [5e-4, -3e-4, 0.0, 0.0]),
        effect(EffectId::DetectionGainMismatch, [1.05, 0.0, 0.0, 0.0]),
    ];
    let is_odd = |number: usize| number % 20 == 11;
    let (folder, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    for number in 0..count {
        let mut settings = Scenario::parse(SMALL).unwrap().settings().clone();
        settings.device = format!("unit-{number}");
        settings.seed = 500 + number as u64;
        // no two boards are alike
        settings.angular_gain += 1e-4 * ((7 * number) % 11) as f64;
        let skew = 2e-3 + 2e-5 * ((5 * number) % 13) as f64;
        settings.effects.push(effect(EffectId::DetectionSkew, [skew, 0.0, 0.0, 0.0]));
        if is_odd(number) {
            let own = kinds[number / 20 % kinds.len()];
            settings.effects.retain(|e| e.id != own.id);
            settings.effects.push(own);
        }
        Scenario::new(settings).unwrap().simulate().write(folder.path().join(format!("unit-{number}"))).unwrap();
    }
    assert_eq!(fleet(folder.path(), out.path()).status, 0);
    let facts = facts(out.path());
    let named: Vec<&str> = facts["odd"].as_array().unwrap().iter().map(|o| o["device"].as_str().unwrap()).collect();
    let planted: Vec<String> = (0..count).filter(|n| is_odd(*n)).map(|n| format!("unit-{n}")).collect();
    let missed: Vec<&String> = planted.iter().filter(|p| !named.contains(&p.as_str())).collect();
    let others: Vec<&&str> = named.iter().filter(|n| !planted.iter().any(|p| p == **n)).collect();
    println!("{count} devices, {} odd: missed {missed:?}, named falsely {others:?}", planted.len());
    assert!(20 * missed.len() <= planted.len(), "{missed:?}");
    assert!(100 * others.len() <= count, "{others:?}");
    let skew = facts["effects"].as_array().unwrap().iter().find(|e| e["id"] == "detection-skew").unwrap();
    assert_eq!(skew["shared"], true);
}

/// Rows of some devices as one table, and what a campaign file says of them in columns.
fn rows_of(folder: &Path, numbers: &[usize]) -> Vec<(String, Values)> {
    let channels = ["t_s", "rate_dps", "xc_v", "xs_v", "yc_v", "ys_v", "vas_v", "vqc_v"];
    let settings = ["settle_s", "angle_deg", "energy_off_s"];
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); channels.len() + settings.len()];
    let mut words: [Cells; 4] = Default::default();
    for number in numbers {
        let campaign = Campaign::open(&folder.join(format!("unit-{number:02}/campaign.toml"))).unwrap();
        for run in &campaign.runs {
            let rows = run.recording.len();
            let (kind, said) = match run.kind {
                RunKind::Ringdown { angle_deg, energy_off_s, .. } => ("ringdown", [angle_deg, energy_off_s]),
                _ => ("rotation", [f64::NAN; 2]),
            };
            let held = if run.role == cvg_calibration::recording::Role::Holdout { "holdout" } else { "" };
            for row in 0..rows {
                for (to, name) in values.iter_mut().zip(channels) {
                    let channel = Channel::of(name).unwrap();
                    to.push(run.recording.channel(channel).map_or(f64::NAN, |v| v[row]));
                }
                let settle_s = if kind == "rotation" { run.settle_s } else { f64::NAN };
                values[channels.len()..].iter_mut().zip([settle_s, said[0], said[1]]).for_each(|(to, v)| to.push(v));
                let file = run.file.display().to_string();
                words.iter_mut().zip([campaign.device.as_str(), &file, kind, held]).for_each(|(to, v)| to.push(v));
            }
        }
    }
    let numbers = channels.into_iter().chain(settings).zip(values).map(|(n, v)| (n.to_owned(), Values::Numbers(v)));
    let texts = ["device", "run", "kind", "use"].into_iter().zip(words).map(|(n, v)| (n.to_owned(), Values::Texts(v)));
    texts.chain(numbers).collect()
}

fn part(columns: &[(String, Values)], rows: std::ops::Range<usize>) -> Vec<u8> {
    let cut = |values: &Values| match values {
        Values::Numbers(v) => Values::Numbers(v[rows.clone()].to_vec()),
        Values::Texts(cells) => Values::Texts(rows.clone().map(|row| cells.get(row).unwrap().to_owned()).collect()),
        Values::Unreadable { why, .. } => panic!("{why}"),
    };
    let columns: Vec<(String, Values)> = columns.iter().map(|(name, v)| (name.clone(), cut(v))).collect();
    let mut out = Vec::new();
    write_parquet(&columns, &mut out).unwrap();
    out
}

#[test]
fn a_lake_is_answered_as_the_campaigns_in_it_are_and_goes_on_where_it_was_broken_off() {
    let [folder, lake, of_files, of_lake] = [(); 4].map(|()| TempDir::new().unwrap());
    devices(folder.path());
    let columns = rows_of(folder.path(), &[0, 1, 2]);
    let Values::Numbers(times) = &columns[4].1 else { panic!("no times") };
    // the second device goes on in the second file
    let (all, middle) = (times.len(), times.len() / 2);
    fs::write(lake.path().join("a.parquet"), part(&columns, 0..middle)).unwrap();
    fs::write(lake.path().join("b.parquet"), part(&columns, middle..all)).unwrap();
    let outcome = fleet(lake.path(), of_lake.path());
    assert_eq!(outcome.status, 0, "{}", outcome.stderr);
    for number in 3..DEVICES {
        fs::remove_dir_all(folder.path().join(format!("unit-{number:02}"))).unwrap();
    }
    assert_eq!(fleet(folder.path(), of_files.path()).status, 0);
    let (expected, found) = (rows(of_files.path()), rows(of_lake.path()));
    assert_eq!(found.header, expected.header);
    for (found, expected) in found.rows.iter().zip(&expected.rows) {
        // but for where it is from
        assert_eq!((&found[0], &found[2..]), (&expected[0], &expected[2..]));
    }
    let results = Lake::open(&of_lake.path().join("fleet.parquet")).unwrap().unwrap();
    assert_eq!(results.devices().collect::<Vec<_>>(), ["unit-00", "unit-01", "unit-02"]);

    // results among the rows would be rows
    let within = fleet(lake.path(), lake.path());
    assert!(within.status == 2 && within.stderr.contains("is the lake"), "{}", within.stderr);

    // a row of the first device changes
    let written = |number: usize| fs::metadata(results_of(of_lake.path(), number)).unwrap().modified().unwrap();
    let before = [written(0), written(2)];
    let mut changed = columns;
    let Values::Numbers(vas) = &mut changed[10].1 else { panic!("no numbers") };
    vas[7] += 1e-9;
    fs::write(lake.path().join("a.parquet"), part(&changed, 0..middle)).unwrap();
    assert_eq!(fleet(lake.path(), of_lake.path()).status, 0);
    assert!(written(0) > before[0], "what changed is identified anew");
    assert_eq!(written(2), before[1], "what did not is kept");
}

#[test]
fn no_name_of_a_device_ends_a_fleet_and_rows_without_one_are_no_device() {
    let (folder, lake, out) = (TempDir::new().unwrap(), TempDir::new().unwrap(), TempDir::new().unwrap());
    devices(folder.path());
    let mut columns = rows_of(folder.path(), &[0, 1, 2]);
    let long = "x".repeat(300);
    let names = |name: &str| match name {
        "unit-00" => "fleet.csv".to_owned(),
        "unit-01" => long.clone(),
        _ => String::new(),
    };
    let Values::Texts(cells) = &columns[0].1 else { panic!("no names") };
    columns[0].1 = Values::Texts(cells.iter().map(names).collect());
    let rows = length(&columns);
    fs::write(lake.path().join("lake.parquet"), part(&columns, 0..rows)).unwrap();
    let outcome = fleet(lake.path(), out.path());
    assert_eq!(outcome.status, 0, "{}", outcome.stderr);
    let facts = facts(out.path());
    assert_eq!((&facts["answered"], &facts["refused"]), (&2.into(), &1.into()));
    assert!(outcome.stdout.contains("rows have no `device`"), "{}", outcome.stdout);
    assert!(out.path().join("fleet.csv").is_file() && out.path().join("fleet.csv-2/report.json").is_file());
}

fn length(columns: &[(String, Values)]) -> usize {
    columns.first().map_or(0, |(_, values)| values.len())
}

#[test]
fn fleets_at_once_into_one_folder_leave_what_one_alone_does() {
    let (folder, alone) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    devices(folder.path());
    for number in 3..DEVICES {
        fs::remove_dir_all(folder.path().join(format!("unit-{number:02}"))).unwrap();
    }
    assert_eq!(fleet(folder.path(), alone.path()).status, 0);
    let names = |folder: &Path| {
        let mut all: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
        all.sort();
        all
    };
    for _ in 0..8 {
        let beside = TempDir::new().unwrap();
        let out = beside.path().join("out");
        let at_once = || fleet(folder.path(), &out);
        std::thread::scope(|scope| {
            for program in [(); 3].map(|()| scope.spawn(at_once)) {
                let outcome = program.join().unwrap();
                assert_eq!(outcome.status, 0, "{}", outcome.stderr);
            }
        });
        assert_eq!(names(&out), names(alone.path()));
        for name in ["fleet.csv", "fleet.json", "unit-00/report.json", "unit-02/calibration.toml"] {
            assert!(fs::read(out.join(name)).unwrap() == fs::read(alone.path().join(name)).unwrap(), "{name}");
        }
        assert_eq!(names(beside.path()), ["out"]);
    }
}

#[test]
fn a_lake_that_cannot_be_meant_says_why() {
    let (lake, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let file = lake.path().join("lake.parquet");
    fs::write(&file, b"PAR1 and no more").unwrap();
    let damaged = fleet(&file, out.path());
    assert!(damaged.status == 2 && damaged.stderr.contains("lake.parquet"), "{}", damaged.stderr);
    // two values of what a device has one of: a row that says so
    let cells = |texts: [&str; 2]| Values::Texts(texts.into_iter().map(str::to_owned).collect());
    let columns = [
        ("device".to_owned(), cells(["a", "a"])),
        ("t_s".to_owned(), Values::Numbers(vec![0.0, 1.0])),
        ("instrument".to_owned(), cells(["gyroscope", "sensor"])),
    ];
    let mut bytes = Vec::new();
    write_parquet(&columns, &mut bytes).unwrap();
    fs::write(&file, bytes).unwrap();
    let outcome = fleet(lake.path(), out.path());
    assert_eq!(outcome.status, 1, "{}", outcome.stderr);
    assert!(outcome.stdout.contains("`instrument` is gyroscope and sensor"), "{}", outcome.stdout);
}
