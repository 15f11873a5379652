//! What the pages for programs say is what programs get: keys of a scenario, a Python program, limits.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::Command;

use cvg_simulator::Scenario;

use crate::support::{Bench, cvg, cvg_ok};

fn repository(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)).unwrap()
}

/// The first part of a page in a language.
fn part(page: &str, language: &str) -> String {
    let page = repository(page);
    let (_, rest) = page.split_once(&format!("```{language}\n")).unwrap();
    rest.split("```").next().unwrap().to_owned()
}

#[test]
fn the_page_of_scenarios_lists_every_key_there_is() {
    let (page, source) = (repository("docs/src/scenario.md"), repository("crates/simulator/src/scenario/settings.rs"));
    let fields = source.lines().filter_map(|line| line.trim().strip_prefix("pub ")?.split_once(": "));
    let of_runs = source.lines().skip_while(|line| !line.contains("pub enum Run")).take_while(|line| *line != "}");
    let of_runs =
        of_runs.filter_map(|line| line.trim().split_once(": ").filter(|(name, _)| !name.contains(['/', '#', '('])));
    let mut keys: Vec<&str> = fields.chain(of_runs).map(|(name, _)| name).collect();
    // as the file has them
    keys.iter_mut().for_each(|key| match *key {
        "runs" => *key = "[[run]]",
        "purpose" => *key = "use",
        _ => {}
    });
    assert!(keys.len() > 35, "{keys:?}");
    for key in keys.into_iter().filter(|key| !key.starts_with("fn ")) {
        let listed = page.contains(&format!("`{key}`")) || page.contains(&format!("{key} = "));
        assert!(listed, "docs/src/scenario.md lacks {key}");
    }
}

#[test]
fn the_smallest_scenario_of_the_page_is_one() {
    Scenario::parse(&part("docs/src/scenario.md", "toml")).unwrap();
}

#[test]
fn the_python_of_the_page_reads_a_report_and_a_refusal() {
    let bench = Bench::small();
    bench.write("read.py", part("docs/src/report-json.md", "python"));
    let read = |report: &str| Command::new("python3").arg(bench.path("read.py")).arg(bench.path(report)).output();
    let results = bench.path("results");
    cvg_ok(&[OsStr::new("identify"), bench.campaign().as_os_str(), "--out".as_ref(), results.as_os_str()]);
    let Ok(answered) = read("results/report.json") else {
        println!("skipped: there is no python3");
        return;
    };
    let said = String::from_utf8(answered.stdout).unwrap();
    assert!(answered.status.success(), "{}", String::from_utf8_lossy(&answered.stderr));
    assert!(
        said.contains(" deg -> ") && said.contains("gain ratio 1.") && said.contains("detection-gain-mismatch"),
        "{said}"
    );
    // a sensor without a reference has no error to tell
    let rows = (0..2000).map(|i| f64::from(i) * 0.01).map(|t| {
        let (sin, cos) = (1.3 * t).sin_cos();
        format!("{t:.2},{:.4},{:.4}\n", cos + 0.05, 1.02 * sin)
    });
    bench.write("hall.csv", format!("t_s,xc_v,yc_v\n{}", rows.collect::<String>()));
    let (hall, alone) = (bench.path("hall.csv"), bench.path("alone"));
    cvg_ok(&[OsStr::new("identify"), hall.as_os_str(), "--sensor".as_ref(), "--out".as_ref(), alone.as_os_str()]);
    let surveyed = read("alone/report.json").unwrap();
    let said = String::from_utf8(surveyed.stdout).unwrap();
    assert!(surveyed.status.success() && said.contains("nan deg -> nan deg"), "{said}");
    bench.write("refused.json", r#"{"status": "refused", "reason": "too short", "device": "d"}"#);
    let refused = read("refused.json").unwrap();
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8(refused.stderr).unwrap().contains("d: refused: too short"));
}

#[test]
fn the_limits_of_the_page_pass_a_good_device_and_fail_a_bad_one() {
    let bench = Bench::small();
    let limits = part("docs/src/ci.md", "toml");
    bench.write("limits.toml", &limits);
    bench.write("narrow.toml", limits.replace("1.03", "0.98"));
    for (file, status, verdict) in [("limits.toml", 0, "pass"), ("narrow.toml", 1, "FAIL")] {
        let (campaign, file) = (bench.campaign(), bench.path(file));
        let gated = cvg(&[OsStr::new("identify"), campaign.as_os_str(), "--limits".as_ref(), file.as_os_str()]);
        assert_eq!(gated.status, status, "{}", gated.stderr);
        assert!(gated.stderr.contains(verdict), "{}", gated.stderr);
    }
}
