//! The coverage that the page for a certifier tells, against the crates and files that there are: that it is of this code at all.
//! `.ci/coverage --check` counts anew; what takes minutes is not part of every audit.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const PAGE: &str = "docs/src/certifier.md";

/// What of the page is not about the crates for firmware as they are, in words.
///
/// # Errors
/// What cannot be read.
pub(crate) fn faults(repository: &Path) -> Result<Vec<String>, String> {
    let text = |path: &Path| std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()));
    let crates = repository.join("crates");
    let mut firmware = BTreeSet::new();
    for entry in std::fs::read_dir(&crates).map_err(|e| e.to_string())?.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let root = entry.path().join("src/lib.rs");
        // the interface for C is nothing but calls of these
        if root.is_file() && text(&root)?.lines().any(|line| line == "#![no_std]") {
            firmware.insert(name);
        }
    }
    Ok(untrue(&text(&repository.join(PAGE))?, &firmware, |file| {
        file.split_once('/').is_some_and(|(name, inside)| crates.join(name).join("src").join(inside).is_file())
    }))
}

/// The rows of the table whose head begins with `head`: what stands in the cells.
fn rows<'a>(page: &'a str, head: &str) -> Vec<Vec<&'a str>> {
    let table = page.lines().skip_while(|line| !line.starts_with(head)).skip(2);
    let cells = |line: &'a str| line.trim_matches('|').split('|').map(|cell| cell.trim().trim_matches('`')).collect();
    table.take_while(|line| line.starts_with('|')).map(cells).collect()
}

/// `611 of 629, 97.1 %`: how many are left; nothing where the numbers contradict each other.
fn left(cell: &str) -> Option<u32> {
    let (counts, share) = cell.split_once(", ")?;
    let (covered, all) = counts.split_once(" of ")?;
    let (covered, all): (u32, u32) = (covered.parse().ok()?, all.parse().ok()?);
    let said = format!("{:.1} %", 100.0 * f64::from(covered) / f64::from(all));
    (covered <= all && said == share).then(|| all - covered)
}

fn untrue(page: &str, firmware: &BTreeSet<String>, is_there: impl Fn(&str) -> bool) -> Vec<String> {
    let mut found = Vec::new();
    let crates = rows(page, "| crate | lines |");
    let named: BTreeSet<String> = crates.iter().filter_map(|row| row.first()).map(|name| (*name).to_owned()).collect();
    if named != *firmware {
        found.push(format!("{PAGE}: the coverage is of {named:?}, firmware is {firmware:?}"));
    }
    // of lines, regions and branches, by crate
    let mut by_file: BTreeMap<&str, [u32; 3]> = BTreeMap::new();
    for row in rows(page, "| not reached in |") {
        let counts: Vec<u32> = row.iter().skip(1).filter_map(|cell| cell.parse().ok()).collect();
        let (Some(file), &[lines, regions, branches]) = (row.first(), counts.as_slice()) else {
            found.push(format!("{PAGE}: not a row of what is not reached: {row:?}"));
            continue;
        };
        if !is_there(file) {
            found.push(format!("{PAGE}: {file} is not there"));
        }
        let sums = by_file.entry(file.split('/').next().unwrap_or_default()).or_default();
        for (sum, count) in sums.iter_mut().zip([lines, regions, branches]) {
            *sum += count;
        }
    }
    for row in &crates {
        let told: Vec<Option<u32>> = row.iter().skip(1).map(|cell| left(cell)).collect();
        let name = row.first().copied().unwrap_or_default();
        let sums = by_file.get(name).copied().unwrap_or_default();
        if told != sums.map(Some) {
            found.push(format!("{PAGE}: {name}: its files leave {sums:?}, and the crate {told:?}"));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLD: &str = "# Page\n\n| crate | lines | regions | branches |\n| --- | --- | --- | --- |\n\
        | `model` | 9 of 10, 90.0 % | 6 of 9, 66.7 % | 4 of 4, 100.0 % |\n\n\
        | not reached in | lines | regions | branches |\n| --- | --- | --- | --- |\n\
        | `model/a.rs` | 1 | 1 | 0 |\n| `model/effects/b.rs` | 0 | 2 | 0 |\n\nWhat is left\n";

    fn untrue_of(page: &str) -> Vec<String> {
        untrue(page, &BTreeSet::from(["model".to_owned()]), |file| ["model/a.rs", "model/effects/b.rs"].contains(&file))
    }

    #[test]
    fn a_page_about_the_crates_and_files_that_are_there_is_taken() {
        assert_eq!(untrue_of(TOLD), [""; 0]);
    }

    #[test]
    fn what_is_not_there_and_what_does_not_add_up_is_told() {
        let planted = [
            ("`model` |", "`estimator` |"),
            ("model/a.rs", "model/gone.rs"),
            ("9 of 10, 90.0 %", "9 of 10, 91.0 %"),
            ("9 of 10, 90.0 %", "8 of 10, 80.0 %"),
            ("9 of 10, 90.0 %", "11 of 10, 110.0 %"),
            ("| 0 | 2 | 0 |", "| 0 | 1 | 0 |"),
            ("| 0 | 2 | 0 |", "| 0 | 2 |"),
            ("| crate | lines |", "| crates | lines |"),
        ];
        for (from, to) in planted {
            assert!(!untrue_of(&TOLD.replace(from, to)).is_empty(), "{from} as {to}");
        }
    }

    #[test]
    fn the_page_is_about_the_crates_for_firmware() {
        assert_eq!(faults(&crate::repository()), Ok(Vec::new()));
    }
}
