//! What the tests of the command line share: running it, and campaigns to run it on.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use cvg_simulator::{Scenario, Settings};
use serde_json::Value;
use tempfile::TempDir;

/// What a run of the program came to.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) status: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

/// Runs `cvg` with these arguments.
pub(crate) fn cvg<A: AsRef<OsStr>>(arguments: &[A]) -> Outcome {
    let output = Command::new(env!("CARGO_BIN_EXE_cvg")).args(arguments).output().unwrap();
    Outcome {
        status: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// The same with arguments of different types.
pub(crate) fn run(arguments: &[&dyn AsRef<OsStr>]) -> Outcome {
    cvg(arguments)
}

/// A value of a report and the ends of its interval.
pub(crate) fn estimate(v: &Value) -> [f64; 3] {
    [&v["value"], &v["ci95"][0], &v["ci95"][1]].map(|v| v.as_f64().unwrap())
}

/// Runs `cvg`, which has to succeed, and gives what it printed.
pub(crate) fn cvg_ok<A: AsRef<OsStr> + std::fmt::Debug>(arguments: &[A]) -> String {
    let outcome = cvg(arguments);
    assert_eq!(outcome.status, 0, "cvg {arguments:?}: {}", outcome.stderr);
    outcome.stdout
}

/// The report of a campaign or a recording.
pub(crate) fn report(campaign: &Path) -> Value {
    serde_json::from_str(&cvg_ok(&[OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--json")])).unwrap()
}

/// A folder with a campaign in it.
pub(crate) struct Bench {
    pub(crate) folder: TempDir,
}

impl Bench {
    /// The campaign of these settings.
    pub(crate) fn simulated(settings: Settings) -> Self {
        let folder = TempDir::new().unwrap();
        Scenario::new(settings).unwrap().simulate().write(folder.path()).unwrap();
        Self { folder }
    }

    /// The paper's device under the paper's runs.
    pub(crate) fn paper() -> Self {
        Self::simulated(Scenario::paper().settings().clone())
    }

    /// A device with gain mismatches alone, in runs that are just long enough.
    pub(crate) fn small() -> Self {
        Self::simulated(Scenario::parse(SMALL).unwrap().settings().clone())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn campaign(&self) -> PathBuf {
        self.path("campaign.toml")
    }

    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    pub(crate) fn write(&self, name: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(name), text).unwrap();
    }

    /// Writes a file anew as `change` makes it.
    pub(crate) fn change(&self, name: &str, change: impl FnOnce(String) -> String) {
        self.write(name, change(self.read(name)));
    }

    /// Replaces what must be there in a file.
    pub(crate) fn replace(&self, name: &str, from: &str, to: &str) {
        self.change(name, |text| {
            assert!(text.contains(from), "{name} has no {from:?}");
            text.replace(from, to)
        });
    }

    /// Names of the recordings whose names begin with `prefix`, in order.
    pub(crate) fn recordings(&self, prefix: &str) -> Vec<String> {
        let names = fs::read_dir(self.folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.filter(|n| n.starts_with(prefix) && n.ends_with(".csv")).collect();
        names.sort();
        assert!(!names.is_empty(), "no {prefix}*.csv");
        names
    }
}

/// A CSV file as cells: its header and its rows.
pub(crate) struct Sheet {
    pub(crate) header: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Sheet {
    pub(crate) fn of(text: &str) -> Self {
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        Self { header: lines.next().unwrap(), rows: lines.collect() }
    }

    pub(crate) fn index(&self, column: &str) -> usize {
        self.header.iter().position(|name| name == column).unwrap_or_else(|| panic!("no column {column}"))
    }

    pub(crate) fn numbers(&self, column: &str) -> Vec<f64> {
        let at = self.index(column);
        self.rows.iter().map(|row| row[at].parse().unwrap()).collect()
    }

    /// Puts new numbers into a column.
    pub(crate) fn set(&mut self, column: &str, number: impl Fn(usize, f64) -> f64) {
        let at = self.index(column);
        for (i, row) in self.rows.iter_mut().enumerate() {
            row[at] = number(i, row[at].parse().unwrap()).to_string();
        }
    }

    /// The same without the columns that are not named.
    pub(crate) fn only(&self, columns: &[&str]) -> Self {
        let kept: Vec<usize> = columns.iter().map(|name| self.index(name)).collect();
        let pick = |row: &Vec<String>| kept.iter().map(|&at| row[at].clone()).collect::<Vec<_>>();
        Self { header: pick(&self.header), rows: self.rows.iter().map(pick).collect() }
    }

    pub(crate) fn text(&self) -> String {
        let lines = std::iter::once(&self.header).chain(&self.rows).map(|row| row.join(",") + "\n");
        lines.collect()
    }
}

/// Every file below a folder with its bytes.
pub(crate) fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(contents(&path));
            found.insert(path, b"a folder".to_vec());
        } else {
            let bytes = fs::read(&path).unwrap();
            found.insert(path, bytes);
        }
    }
    found
}

/// A device with gain mismatches alone, in runs that are just long enough.
pub(crate) const SMALL: &str = r#"
device = "small"
angular_gain = 0.78
noise_v = 2e-5
tau_s = 10.0
seed = 7
effects = [
  { id = "actuation-gain-mismatch", actuation_gain_ratio = 1.0113 },
  { id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 },
]

[[run]]
kind = "rotation"
file = "rot+500.csv"
rate_dps = 500.0
duration_s = 4.0
settle_s = 0.5

[[run]]
kind = "rotation"
file = "rot-300.csv"
rate_dps = -300.0
duration_s = 4.0
settle_s = 0.5

[[run]]
kind = "rotation"
file = "check.csv"
rate_dps = 400.0
duration_s = 4.0
settle_s = 0.5
use = "holdout"

[[run]]
kind = "ringdown"
file = "ringdown-0.csv"
angle_deg = 0.0
energy_off_s = 3.0
duration_s = 8.0

[[run]]
kind = "ringdown"
file = "ringdown-90.csv"
angle_deg = 90.0
energy_off_s = 3.0
duration_s = 8.0
"#;

/// The same recording as a foreign instrument would write it: names of its own, milliseconds, `;`, decimal commas.
pub(crate) fn foreign(bench: &Bench, name: &str) -> String {
    let sheet = Sheet::of(&bench.read(name));
    let names = ["t_s", "rate_dps", "xc_v", "xs_v", "yc_v", "ys_v", "vas_v", "vqc_v"];
    let columns: Vec<Vec<f64>> = names.iter().map(|n| sheet.numbers(n)).collect();
    let mut text = String::from("% LabTool export\n% demodulator 0\nTime (ms);Table;D1 X;D1 Y;D2 X;D2 Y;PID1;PID2\n");
    for row in 0..columns[0].len() {
        if row == 100 {
            text.push_str("% range changed\n");
        }
        let cells: Vec<String> = columns
            .iter()
            .enumerate()
            .map(|(c, v)| if c == 0 { 1e3 * v[row] } else { v[row] }.to_string().replace('.', ","))
            .collect();
        text.push_str(&(cells.join(";") + "\n"));
    }
    text
}
