//! The way of someone who has the README, and recordings from an instrument that knows nothing of this program: names
//! of its own, milliseconds, `;`, decimal commas, remarks. Every stumble has an answer that says the next step.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::support::{Bench, cvg, cvg_ok, foreign, report};

/// The table that the README shows.
const COLUMNS: &str = "[columns]\nt_s = \"Time (ms)*0.001\"\nrate_dps = \"Table\"\nxc_v = \"D1 X\"\nxs_v = \"D1 Y\"\n\
                       yc_v = \"D2 X\"\nys_v = \"D2 Y\"\nvas_v = \"PID1\"\nvqc_v = \"PID2\"\n";

/// A campaign whose recordings have foreign names and columns; `columns` stands in its campaign file.
fn foreign_bench(columns: &str) -> Bench {
    let bench = Bench::small();
    let mut campaign = bench.read("campaign.toml");
    let mut names = bench.recordings("");
    // the longest first, since one name may begin another
    names.sort_by_key(|name| std::cmp::Reverse(name.len()));
    for (number, name) in names.iter().enumerate() {
        let export = format!("export {number}.csv");
        bench.write(&export, foreign(&bench, name));
        fs::remove_file(bench.path(name)).unwrap();
        campaign = campaign.replace(&format!("\"{name}\""), &format!("\"{export}\""));
    }
    let at = campaign.find("[[run]]").unwrap();
    campaign.insert_str(at, columns);
    bench.write("campaign.toml", campaign);
    bench
}

fn run(arguments: &[&dyn AsRef<OsStr>]) -> String {
    let arguments: Vec<&OsStr> = arguments.iter().map(|a| (*a).as_ref()).collect();
    cvg_ok(&arguments)
}

#[test]
fn a_first_look_says_what_the_columns_are_and_how_to_name_them() {
    let bench = foreign_bench("");
    let file = bench.path("export 0.csv");
    for command in ["inspect", "identify"] {
        let refused = cvg(&[OsStr::new(command), file.as_os_str()]);
        assert_eq!(refused.status, 2);
        let table = refused.stdout.lines().find(|l| l.trim_start().starts_with("D1 X "));
        assert_eq!(table.is_some(), command == "inspect", "{command} shows what the columns hold: {}", refused.stdout);
        for part in ["`D1 X`", "--map 't_s=Time (ms)'", "[columns] of a campaign.toml"] {
            assert!(refused.stderr.contains(part), "{command}: {part}: {}", refused.stderr);
        }
    }
}

#[test]
fn a_campaign_of_foreign_files_is_identified_and_compensated_as_one_of_ours() {
    let (own, bench) = (Bench::small(), foreign_bench(COLUMNS));
    let (campaign, results) = (bench.campaign(), bench.path("results"));
    assert!(run(&[&"inspect", &campaign]).contains("serves as a rotation"));
    run(&[&"identify", &campaign, &"--out", &results]);
    let found: Value = serde_json::from_slice(&fs::read(results.join("report.json")).unwrap()).unwrap();
    let wanted = report(&own.campaign());
    for key in ["detection_gain_ratio", "angular_gain"] {
        let [a, b] = [&found, &wanted].map(|r| r[key]["value"].as_f64().unwrap());
        assert!((a - b).abs() < 1e-9, "{key}: {a} {b}");
    }
    let (calibration, export, clean) = (results.join("calibration.toml"), bench.path("export 0.csv"), "clean.csv");
    let clean = bench.path(clean);
    run(&[&"compensate", &calibration, &export, &"--map", &campaign, &"--out", &clean]);
    assert!(fs::read_to_string(clean).unwrap().starts_with("t_s,rate_dps,xc_v"));
}

#[test]
fn what_a_recording_lacks_is_said_where_it_does_not_serve() {
    let bench = Bench::small();
    bench.write("two.csv", "t_s,xc_v,yc_v\n0,1,0\n1,0,1\n2,-1,0\n");
    let said = run(&[&"inspect", &bench.path("two.csv")]);
    for part in [
        "does not serve as a rotation: it needs `t_s`, one of (`rate_dps`, `table_deg`)",
        "serves as a sensor without a reference (--sensor)",
        "does not serve as a ring-down: it needs `t_s`, `xc_v`, `yc_v` and `vas_v`",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

#[test]
fn a_name_taken_from_the_message_is_read_in_the_unit_it_names() {
    let bench = foreign_bench(&COLUMNS.replace("*0.001", ""));
    let campaign = bench.campaign();
    let said = run(&[&"inspect", &campaign]);
    assert!(said.contains("`t_s` is in ms and taken to s") && said.contains("one every 0.010000 s"), "{said}");
}

#[test]
fn the_mapping_that_is_suggested_for_a_name_that_ends_like_a_factor_is_read() {
    let bench = Bench::small();
    bench.write("loose.csv", "Time/1000,rate_dps,theta_deg\n0,10,0\n0.1,10,1\n0.2,10,2\n");
    let outcome = cvg(&[OsStr::new("inspect"), bench.path("loose.csv").as_os_str()]);
    assert!(outcome.stderr.contains("--map 't_s=Time/1000*1'"), "{}", outcome.stderr);
    let said = run(&[&"inspect", &bench.path("loose.csv"), &"--map", &"t_s=Time/1000*1"]);
    assert!(said.contains("one every 0.100000 s"), "{said}");
}

/// `numpy.savetxt` and others write their header as a remark.
#[test]
fn a_header_in_a_remark_above_numbers_is_a_header_whatever_its_names() {
    let bench = Bench::small();
    let numbers = "0|310.5|120.25|1.5\n50|311.0|121.5|1.75\n100|312.5|122.0|2.0\n";
    for mark in ["%", "#"] {
        bench.write(
            "fringes.dat",
            format!("{mark} HeNe double pass\n{mark} t [us]|PD1 [nA]|PD2 [nA]|stage [nm]\n{numbers}"),
        );
        let refused = cvg(&[OsStr::new("inspect"), bench.path("fringes.dat").as_os_str()]);
        assert!(refused.stdout.contains("3 rows") && refused.stdout.contains("PD1 [nA]"), "{mark}: {}", refused.stdout);
        assert!(refused.stderr.contains("--map 't_s=t [us]'"), "{mark}: {}", refused.stderr);
    }
    // a remark that is none stays one
    bench.write("fringes.dat", format!("# HeNe double pass\n{numbers}"));
    let refused = cvg(&[OsStr::new("inspect"), bench.path("fringes.dat").as_os_str()]);
    assert!(refused.stderr.contains("wanted a header line"), "{}", refused.stderr);
}

#[test]
fn two_factors_in_a_mapping_are_told_that_it_takes_one() {
    let bench = Bench::small();
    let name = bench.recordings("rot").remove(0);
    let file = bench.path(&name);
    let map = OsStr::new("table_deg=rate_dps*360/8192");
    let refused = cvg(&[OsStr::new("identify"), file.as_os_str(), OsStr::new("--map"), map]);
    assert!(refused.stderr.contains("takes one factor or one divisor, as in `rate_dps*0.5`"), "{}", refused.stderr);
}

#[test]
fn a_compressed_recording_is_compensated_under_the_name_of_its_text() {
    let bench = Bench::small();
    let (campaign, results, clean) = (bench.campaign(), bench.path("results"), bench.path("clean"));
    run(&[&"identify", &campaign, &"--out", &results]);
    let names = bench.recordings("rot");
    let [first, second] = [&names[0], &names[1]].map(|name| {
        let packed = std::process::Command::new("gzip").arg(bench.path(name)).status();
        packed.map_or_else(|_| bench.path(name), |_| bench.path(&format!("{name}.gz")))
    });
    run(&[&"compensate", &results.join("calibration.toml"), &first, &second, &"--out", &clean]);
    assert!(fs::read_to_string(clean.join(&names[0])).unwrap().starts_with("t_s,rate_dps,xc_v"));
}

#[test]
fn what_is_said_on_the_line_stands_over_the_campaign_file() {
    let bench = foreign_bench(COLUMNS);
    let campaign = bench.campaign();
    let refused = cvg(&[OsStr::new("identify"), campaign.as_os_str(), "--map".as_ref(), "xc_v=D9".as_ref()]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("`D9`"), "{}", refused.stderr);
}

#[test]
fn a_ring_down_among_loose_recordings_is_told_where_it_belongs() {
    let bench = Bench::paper();
    let (rotation, ringdown) = (bench.path(&bench.recordings("rot")[0]), bench.path(&bench.recordings("ring")[0]));
    let refused = cvg(&[OsStr::new("identify"), rotation.as_os_str(), ringdown.as_os_str()]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("ring-down") && refused.stderr.contains("campaign.toml"), "{}", refused.stderr);
}

#[test]
fn the_readme_shows_the_table_that_this_test_uses() {
    let readme = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../README.md")).unwrap();
    for line in COLUMNS.lines() {
        assert!(readme.lines().any(|l| l.split('#').next().unwrap().trim() == line), "README.md lacks {line}");
    }
}

#[test]
fn what_looks_like_a_sensor_is_said_to_and_asked_for_no_commands_of_a_gyroscope() {
    let bench = Bench::small();
    let rows = |rate: f64, step_s: f64| -> String {
        let row = |i: u32| {
            let t = step_s * f64::from(i);
            let (sin, cos) = (rate * t).to_radians().sin_cos();
            format!("{t},{rate},{:.0},{:.0}\n", 900.0 * cos + 100.0, 930.0 * sin - 50.0)
        };
        format!("t_s,rate_dps,xc_v,yc_v\n{}", (0..3000).map(row).collect::<String>())
    };
    bench.write("hall.csv", rows(40.0, 0.01));
    let said = run(&[&"inspect", &bench.path("hall.csv")]);
    assert!(said.contains("look like a sin/cos sensor: --sensor") && !said.contains("vas_v"), "{said}");
    assert!(said.contains("nothing is wrong with it"), "{said}");
    // seconds that are milliseconds
    bench.write("slow.csv", rows(403.0, 10.0));
    let said = run(&[&"inspect", &bench.path("slow.csv")]);
    assert!(said.contains("turns by 4030° from row to row") && !said.contains("nothing is wrong"), "{said}");
    // a campaign says what it is of
    bench
        .write("hall.toml", "[campaign]\ninstrument = \"sensor\"\n[[run]]\nkind = \"rotation\"\nfile = \"hall.csv\"\n");
    let said = run(&[&"inspect", &bench.path("hall.toml")]);
    assert!(!said.contains("vas_v") && !said.contains("--sensor"), "{said}");
}
