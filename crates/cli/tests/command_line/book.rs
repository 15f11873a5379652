//! The book and the README say what the program does: its library, its numbers, its commands.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use cvg_model::effects::EffectId;
use tempfile::TempDir;

use crate::support::{Bench, cvg_ok};

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page(name: &str) -> String {
    fs::read_to_string(repository().join(name)).unwrap().replace("\r\n", "\n")
}

#[test]
fn the_effects_page_is_what_the_library_prints() {
    assert!(
        page("docs/src/effects.md") == cvg_ok(&["effects", "--markdown"]),
        "cvg effects --markdown > docs/src/effects.md"
    );
}

#[test]
fn the_theory_defines_every_effect_and_no_other() {
    let theory = page("docs/src/theory.md");
    let (_, section) = theory.split_once("## The effects at signal level").unwrap();
    let section = section.split("\n## ").next().unwrap();
    let mut defined: Vec<&str> =
        section.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next()).collect();
    let mut known: Vec<&str> = EffectId::ALL.iter().map(|e| e.description().id).collect();
    defined.sort_unstable();
    known.sort_unstable();
    assert_eq!(defined, known);
}

/// Cells of the rows of a table.
fn cells(text: &str) -> Vec<Vec<String>> {
    let rows = text.lines().filter(|line| line.starts_with('|') && !line.starts_with("| ---"));
    rows.map(|line| line.trim_matches('|').split('|').map(|c| c.trim().to_owned()).collect()).collect()
}

#[test]
fn the_page_of_the_papers_figures_has_the_table_that_is_printed() {
    let folder = TempDir::new().unwrap();
    let said = cvg_ok(&[OsStr::new("paper"), OsStr::new("--out"), folder.path().as_os_str()]);
    let (written, printed) = (cells(&page("docs/src/paper.md")), cells(&said));
    assert!(printed.len() > 8, "{said}");
    for row in &printed {
        let same = written.iter().find(|w| w[0] == row[0]).unwrap_or_else(|| panic!("the book lacks {row:?}"));
        assert_eq!(same[..3], row[..3]);
        if let (Ok(a), Ok(b)) = (same[3].parse::<f64>(), row[3].parse::<f64>()) {
            assert!((a / b - 1.0).abs() < 0.01, "{row:?}, in the book {same:?}");
        }
    }
}

/// Lines of shell blocks that call the program, with the name of their page.
fn calls() -> Vec<(String, String)> {
    let chapters = fs::read_dir(repository().join("docs/src")).unwrap().map(|e| e.unwrap().path());
    let mut pages: Vec<PathBuf> = chapters.filter(|p| p.extension().is_some_and(|e| e == "md")).collect();
    pages.push(repository().join("README.md"));
    let mut found = Vec::new();
    for path in pages {
        let text = fs::read_to_string(&path).unwrap().replace("\r\n", "\n");
        for block in text.split("```sh\n").skip(1) {
            for line in block.split("```").next().unwrap().lines() {
                let line = line.split("  #").next().unwrap();
                let call = line.strip_prefix("cvg ").or_else(|| Some(line.split_once("| cvg ")?.1));
                found.extend(call.map(|call| (path.display().to_string(), call.to_owned())));
            }
        }
    }
    found
}

#[test]
fn every_command_that_is_shown_exists_with_its_options() {
    let mut helps: BTreeMap<String, String> = BTreeMap::new();
    let calls = calls();
    assert!(calls.len() > 8, "{calls:?}");
    for (page, call) in calls {
        let mut words = call.split_whitespace();
        let command = words.next().unwrap().to_owned();
        let help = helps.entry(command.clone()).or_insert_with(|| cvg_ok(&[command.as_str(), "--help"]));
        for option in words.filter(|w| w.starts_with("--")) {
            assert!(help.contains(&format!("{option} ")) || help.contains(&format!("{option}\n")), "{page}: {call}");
        }
    }
}

#[test]
fn the_commands_page_lists_every_command() {
    let listed = page("docs/src/cli.md");
    let help = cvg_ok(&["--help"]);
    let commands = help.lines().skip_while(|l| *l != "Commands:").skip(1).take_while(|l| !l.is_empty());
    for command in commands.filter_map(|l| l.split_whitespace().next()).filter(|c| *c != "help") {
        assert!(listed.contains(&format!("`cvg {command}")), "docs/src/cli.md lacks {command}");
    }
}

/// Texts between a tag that begins with `tag` and its end.
fn texts(html: &str, tag: &str) -> Vec<String> {
    let opening = format!("<{tag} ");
    let parts = html.split(&opening).skip(1);
    parts.filter_map(|p| Some(p.split_once('>')?.1.split_once('<')?.0.to_owned())).collect()
}

#[test]
fn the_page_on_the_report_explains_each_of_its_sections_and_figures() {
    let bench = Bench::paper();
    let (campaign, out) = (bench.campaign(), bench.path("out"));
    cvg_ok(&[OsStr::new("identify"), campaign.as_os_str(), OsStr::new("--out"), out.as_os_str()]);
    let html = fs::read_to_string(out.join("report.html")).unwrap();
    let explained = page("docs/src/report.md");
    let (sections, figures) = (texts(&html, "h2"), texts(&html, "h3"));
    assert!(sections.len() >= 6 && figures.len() >= 10, "{sections:?} {figures:?}");
    for section in sections {
        assert!(explained.contains(&format!("## {section}\n")), "docs/src/report.md lacks {section}");
    }
    for figure in figures {
        let row = if figure.starts_with("Scaling of ") { "Scaling of each effect".to_owned() } else { figure };
        assert!(explained.contains(&format!("| {row} |")), "docs/src/report.md lacks {row}");
    }
}

#[test]
fn the_commands_page_lists_every_field_of_the_report() {
    let report = crate::support::report(&Bench::small().campaign());
    let listed = page("docs/src/cli.md");
    let effect = report["effects"][0].as_object().unwrap();
    for key in report.as_object().unwrap().keys().chain(effect.keys()) {
        assert!(listed.contains(&format!("| `{key}` |")), "docs/src/cli.md lacks {key}");
    }
}
