//! What the documentation says of a Cortex-M4F is what `firmware/run` measured and gates.

use std::collections::BTreeMap;

fn read(path: &str) -> String {
    std::fs::read_to_string(format!("{}/../{path}", env!("CARGO_MANIFEST_DIR"))).expect(path)
}

/// The counts of `firmware/baseline`: recording and what was counted, instructions.
fn baseline() -> BTreeMap<String, String> {
    read("firmware/baseline")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .filter_map(|line| line.rsplit_once(' '))
        .map(|(key, count)| (key.to_owned(), count.to_owned()))
        .collect()
}

#[test]
fn the_documented_instruction_counts_are_those_of_the_baseline() {
    let (page, baseline) = (read("docs/src/firmware.md"), baseline());
    let rows = [
        ("a pair of samples, mean", "sample"),
        ("a pair of samples, most (a reading beyond the range)", "sample-most"),
        ("a control step, mean", "control"),
        ("a control step, most", "control-most"),
    ];
    for (what, key) in rows {
        let count = |recording: &str| &baseline[&format!("{recording} {key}")];
        let row = format!("| {what} | {} | {} |", count("plain"), count("compensated"));
        assert!(page.contains(&row), "docs/src/firmware.md lacks the row\n{row}");
    }
}

#[test]
fn a_control_step_with_compensation_takes_at_most_five_hundred_instructions() {
    let count: f64 = baseline()["compensated control"].parse().expect("a number");
    assert!(count <= 500.0, "{count}");
}

#[test]
fn a_pair_of_samples_takes_at_most_eighty_instructions() {
    for recording in ["plain", "compensated"] {
        let count: f64 = baseline()[&format!("{recording} sample")].parse().expect("a number");
        assert!(count <= 80.0, "{recording}: {count}");
    }
}

#[test]
fn what_the_book_says_of_the_calibrators_instructions_is_the_baseline() {
    let (page, baseline) = (read("docs/src/self-calibration.md"), baseline());
    let count = |key: &str| &baseline[&format!("calibrator {key}")];
    let rows = [("a slice of the learning", "slice"), ("a control step in all", "control")];
    for (what, key) in rows {
        let row = format!("| {what} | {} | {} |", count(key), count(&format!("{key}-most")));
        assert!(page.contains(&row), "docs/src/self-calibration.md lacks the row\n{row}");
    }
}
