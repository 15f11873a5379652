//! The examples run, and the book's tables are what they print.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::Command;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn printed(program: &str) -> Result<String> {
    let output = Command::new(program).output()?;
    assert!(output.status.success(), "{program}: {}", String::from_utf8_lossy(&output.stderr));
    Ok(String::from_utf8(output.stdout)?)
}

#[test]
fn a_test_engineer_gets_a_verdict_and_a_compensated_recording() -> Result<()> {
    let said = printed(env!("CARGO_BIN_EXE_test_engineer"))?;
    assert!(said.contains("\naccepted\n") && said.contains("detection-cubic: "), "{said}");
    Ok(())
}

#[test]
fn three_users_say_what_they_want_in_under_forty_lines() -> Result<()> {
    for (name, program, expected) in [
        ("columns_in_memory", env!("CARGO_BIN_EXE_columns_in_memory"), "Answered: "),
        ("converter_loop", env!("CARGO_BIN_EXE_converter_loop"), " deg, at most "),
        ("known_truth", env!("CARGO_BIN_EXE_known_truth"), "detection-cubic.kappa = 0.0100"),
    ] {
        let said = printed(program)?;
        assert!(said.contains(expected), "{name}: {said}");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("src/bin/{name}.rs"));
        assert!(fs::read_to_string(source)?.lines().count() < 40, "{name}");
    }
    Ok(())
}

/// What the readout's compensation cannot undo at 350 deg/s: anisodamping bends the angle by 14 mdeg there, the lag of the
/// quadrature loop by 3 mdeg; noise has peaks of 4 mdeg.
const OF_THE_MECHANICS_DEG: f64 = 0.022;

#[test]
fn firmware_undoes_the_readout_in_f32_and_leaves_the_mechanics() -> Result<()> {
    let said = printed(env!("CARGO_BIN_EXE_firmware_engineer"))?;
    let degrees = |part: &str| part.rsplit(' ').next().and_then(|v| v.trim_end_matches('°').parse::<f64>().ok());
    let mut lines = 0;
    for line in said.lines() {
        let (before, after) = line.split_once(" → ").ok_or(line)?;
        let (before, after) = (degrees(before), degrees(after.trim_end_matches(" in f32")));
        assert!(before > Some(0.3) && after.is_some_and(|a| a < OF_THE_MECHANICS_DEG), "{line}");
        lines += 1;
    }
    assert_eq!(lines, 2, "{said}");
    Ok(())
}

/// The rows of the tables in a text, cell by cell.
fn rows(text: &str) -> Vec<Vec<String>> {
    let tables = text.lines().filter(|line| line.starts_with('|') && !line.starts_with("| ---"));
    tables.map(|line| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
}

/// The page with the tables of the rows `printed` made anew.
fn rewritten(page: &str, printed: &str) -> String {
    let line = |old: &str| {
        let name = old.split('|').nth(1).filter(|_| old.starts_with("| ") && !old.starts_with("| ---"));
        let new = name.and_then(|name| printed.lines().find(|new| new.starts_with(&format!("|{name}|"))));
        format!("{}\n", new.unwrap_or(old))
    };
    page.lines().map(line).collect()
}

/// The tables' intervals are measured; another machine's last bits may move them a little. After a change of the
/// identification `CVG_BOOK=write cargo test -p cvg-examples --test examples` makes them anew; the text around them says
/// what follows, and is to be read again.
const SAME: f64 = 0.2;

#[test]
fn the_book_says_what_each_run_tells_as_the_study_prints_it() -> Result<()> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/campaigns.md");
    let (page, study) = (fs::read_to_string(&path)?, printed(env!("CARGO_BIN_EXE_which_runs"))?);
    if std::env::var_os("CVG_BOOK").is_some_and(|v| v == "write") {
        fs::write(&path, rewritten(&page, &study))?;
        return Ok(());
    }
    let (written, printed) = (rows(&page), rows(&study));
    assert_eq!(printed.len(), 12);
    for row in &printed {
        let same = written.iter().find(|w| w[0] == row[0]).ok_or_else(|| format!("the book lacks {row:?}"))?;
        for (ours, theirs) in row.iter().zip(same) {
            let number = |cell: &str| cell.strip_prefix("± ").and_then(|v| v.parse::<f64>().ok());
            match (number(ours), number(theirs)) {
                (Some(a), Some(b)) => assert!((a / b - 1.0).abs() < SAME, "{row:?}, in the book {same:?}"),
                _ => assert_eq!(ours, theirs, "{row:?}, in the book {same:?}"),
            }
        }
    }
    Ok(())
}
