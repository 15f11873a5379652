//! The page of the first hour is run as it stands: its files are written, its commands run, and what it says they print is
//! what they print.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

/// Numbers on the page and printed: alike to this share, what stands before ± within what is printed behind it, and that to that share.
const SAME: f64 = 0.01;
const SAME_WIDTH: f64 = 0.2;

fn page() -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/first-hour.md")).unwrap()
}

/// A fenced part of a page.
struct Part {
    language: String,
    /// The line of text above it.
    above: String,
    text: String,
}

fn parts(page: &str) -> Vec<Part> {
    let mut parts = vec![];
    let mut above = String::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```") {
            let text = lines.by_ref().take_while(|line| *line != "```").map(|line| format!("{line}\n")).collect();
            parts.push(Part { language: language.to_owned(), above: std::mem::take(&mut above), text });
        } else if !line.is_empty() {
            above = line.to_owned();
        }
    }
    parts
}

/// Runs commands in a folder, with this program's `cvg` first on the path, and gives all that they print.
fn run(commands: &str, folder: &Path) -> String {
    let programs = Path::new(env!("CARGO_BIN_EXE_cvg")).parent().unwrap();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    let all = format!("{{\n{commands}}} 2>&1");
    let output = Command::new("sh").args(["-c", &all]).current_dir(folder).env("PATH", path).output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

fn number(word: &str) -> Option<f64> {
    word.trim_matches(|c: char| !c.is_ascii_digit() && !"+-.e".contains(c)).parse().ok()
}

/// What one in the last place of a number is worth.
fn last_place(word: &str) -> f64 {
    let decimals = word.split_once('.').map_or(0, |(_, d)| d.chars().take_while(char::is_ascii_digit).count());
    0.1f64.powi(i32::try_from(decimals).unwrap())
}

/// Whether a printed line says what the page says, whose line may end in `…`.
fn says(printed: &str, written: &str) -> bool {
    let (words, mut wanted): (Vec<_>, Vec<_>) =
        (printed.split_whitespace().collect(), written.split_whitespace().collect());
    let is_part = wanted.last() == Some(&"…");
    if is_part {
        wanted.pop();
    } else if words.len() != wanted.len() {
        return false;
    }
    let mut width = SAME;
    words.len() >= wanted.len()
        && words.iter().zip(&wanted).enumerate().all(|(i, (a, b))| {
            let same = std::mem::replace(&mut width, if *b == "±" { SAME_WIDTH } else { SAME });
            let half_width = words.get(i + 2).filter(|_| words.get(i + 1) == Some(&"±")).and_then(|w| number(w));
            match (number(a), number(b)) {
                (Some(x), Some(y)) => {
                    let off = (x - y).abs();
                    off <= same * y.abs() && half_width.is_none_or(|half| off <= half.max(0.5 * last_place(b)))
                }
                _ => a == b,
            }
        })
}

#[test]
fn the_page_of_the_first_hour_is_what_happens() {
    if ["awk", "iconv"].iter().any(|tool| Command::new(tool).arg("--version").output().is_err()) {
        println!("skipped: there is no awk or no iconv");
        return;
    }
    let folder = TempDir::new().unwrap();
    let mut printed = String::new();
    let mut checked = 0;
    for part in parts(&page()) {
        match part.language.as_str() {
            "toml" => {
                let name = part.above.split('`').nth(1).unwrap_or_else(|| panic!("no name above {}", part.text));
                fs::write(folder.path().join(name), part.text).unwrap();
            }
            "sh" => printed = run(&part.text, folder.path()),
            "text" => {
                for line in part.text.lines() {
                    assert!(printed.lines().any(|said| says(said, line)), "the page says\n{line}\nand cvg\n{printed}");
                    checked += 1;
                }
            }
            other => panic!("a part in {other:?}"),
        }
    }
    assert!(checked > 40, "{checked} lines");
    let first = ["gyroscope", "encoder", "resolver", "rate-gyroscope", "magnetometer"];
    let second = ["hall", "word", "imu", "fringes", "lockin"];
    let reports: Vec<PathBuf> =
        first.into_iter().chain(second).map(|name| folder.path().join(name).join("report.html")).collect();
    assert!(reports.iter().all(|report| report.exists()), "every recording ends with a report");
}

#[test]
fn another_number_or_another_word_is_not_what_the_page_says() {
    assert!(says("  k 0.7801 ± 2.8e-4", "k 0.7800 ± 2.5e-4"));
    assert!(!says("k 0.80 ± 2.8e-4", "k 0.78 ± 2.8e-4") && !says("k 0.78 ± 2.8e-4", "q 0.78 ± 2.8e-4"));
    assert!(says("error: a b c", "error: a …") && !says("error: a b c", "error: a"));
}
