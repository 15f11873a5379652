//! What is written is what is there: the effects' page, the requirements and their citations, the links.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use cvg_model::effects::EffectId;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the repository").to_owned()
}

fn read(path: impl AsRef<Path>) -> String {
    let path = repository().join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Files in `folder` whose names end in `extension`, sorted.
fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let mut found: Vec<_> = fs::read_dir(repository().join(folder))
        .unwrap_or_else(|e| panic!("{folder}: {e}"))
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    found.sort();
    found
}

#[test]
fn the_effects_page_has_every_effect_with_its_parameters_and_units() {
    let page = read("docs/src/effects.md");
    for effect in EffectId::ALL {
        let d = effect.description();
        let row = page
            .lines()
            .find(|line| line.starts_with(&format!("| `{}` |", d.id)))
            .unwrap_or_else(|| panic!("docs/src/effects.md has no row for {}", d.id));
        let parameters: Vec<_> = d.parameters.iter().map(|p| format!("`{}` [{}]", p.name, p.unit)).collect();
        assert!(row.contains(&format!("| {} |", parameters.join(", "))), "{}: expected {parameters:?} in {row}", d.id);
        assert!(row.contains(&format!("| {} |", format!("{:?}", d.stage).to_lowercase())), "{}: stage", d.id);
    }
}

#[test]
fn the_effects_page_has_no_effect_that_the_library_lacks() {
    let page = read("docs/src/effects.md");
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
    let documented: BTreeSet<_> = rows.collect();
    let known: BTreeSet<_> = EffectId::ALL.iter().map(|e| e.description().id).collect();
    assert_eq!(documented, known);
}

/// (`specs/equation-05.md#zero-is-kept`, its sentence) of every requirement.
fn requirements() -> Vec<(String, String)> {
    let mut found = Vec::new();
    for file in files("specs", "md") {
        let name = file.file_name().expect("a file").to_string_lossy().into_owned();
        if name == "README.md" {
            continue;
        }
        let text = fs::read_to_string(&file).expect("readable");
        for section in text.split("\n## ").skip(1) {
            let (heading, body) = section.split_once('\n').expect("a heading and a body");
            let sentences: Vec<_> = body.lines().filter(|line| line.contains(" MUST ")).collect();
            assert_eq!(sentences.len(), 1, "{name}: {heading}: one sentence per requirement");
            assert!(body.contains("Domain: "), "{name}: {heading}: no domain");
            let anchor: String = heading
                .to_lowercase()
                .chars()
                .filter_map(|c| match c {
                    ' ' => Some('-'),
                    c if c.is_ascii_alphanumeric() || c == '-' => Some(c),
                    _ => None,
                })
                .collect();
            found.push((format!("specs/{name}#{anchor}"), sentences[0].to_owned()));
        }
    }
    found
}

/// (requirement, quoted sentence) of every citation in the tests.
fn citations() -> Vec<(String, String)> {
    let mut found = Vec::new();
    for file in files("tests/tests", "rs") {
        let text = fs::read_to_string(&file).expect("readable");
        let mut target = None;
        for line in text.lines().map(str::trim) {
            if let Some(t) = line.strip_prefix("//= specs/") {
                target = Some(format!("specs/{t}"));
            } else if let Some(quote) = line.strip_prefix("//# ") {
                found.push((target.take().expect("a quote follows its target"), quote.to_owned()));
            }
        }
    }
    found
}

#[test]
fn every_citation_of_a_requirement_is_word_for_word() {
    let requirements = requirements();
    for (target, quote) in citations() {
        let (_, sentence) = requirements
            .iter()
            .find(|(name, _)| *name == target)
            .unwrap_or_else(|| panic!("{target} is cited and does not exist"));
        assert_eq!(&quote, sentence, "{target}");
    }
}

#[test]
fn every_requirement_is_cited_by_a_test() {
    let cited: BTreeSet<_> = citations().into_iter().map(|(target, _)| target).collect();
    let left: Vec<_> = requirements().into_iter().map(|(name, _)| name).filter(|name| !cited.contains(name)).collect();
    assert!(left.is_empty(), "no test cites {left:?}");
}

#[test]
fn every_chapter_is_in_the_summary() {
    let summary = read("docs/src/SUMMARY.md");
    for file in files("docs/src", "md") {
        let name = file.file_name().expect("a file").to_string_lossy().into_owned();
        assert!(name == "SUMMARY.md" || summary.contains(&format!("({name})")), "{name} is not in SUMMARY.md");
    }
}

#[test]
fn every_equation_has_its_requirements_its_row_and_its_tests() {
    let table = read("specs/README.md");
    for n in 1..=11 {
        assert!(table.contains(&format!("(equation-{n:02}.md)")), "Equation {n} has no row");
        assert!(repository().join(format!("specs/equation-{n:02}.md")).exists());
        assert!(repository().join(format!("tests/tests/equation_{n:02}.rs")).exists());
    }
}
