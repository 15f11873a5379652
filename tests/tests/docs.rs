//! What is written is what is there: the effects' page, the requirements and their citations, the links.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use cvg_calibration::report::named::BESIDE_THE_LIBRARY;
use cvg_model::effects::EffectId;
use cvg_prover::Format;
use cvg_tests::domain::{any_angle, any_ratio};
use cvg_tests::tolerances::TABLE;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the crate lies in the repository").to_owned()
}

fn read(path: impl AsRef<Path>) -> String {
    let path = repository().join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// What lies in `folder` with the extension `extension`, sorted; folders have none.
fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let mut found: Vec<_> = fs::read_dir(repository().join(folder))
        .unwrap_or_else(|e| panic!("{folder}: {e}"))
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().map_or(extension.is_empty(), |e| e == extension))
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
fn the_effects_page_has_no_effect_that_library_and_reports_lack() {
    let page = read("docs/src/effects.md");
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
    let documented: BTreeSet<_> = rows.collect();
    let library = EffectId::ALL.iter().map(|e| e.description().id);
    let known: BTreeSet<_> = library.chain(BESIDE_THE_LIBRARY.iter().map(|e| e.id)).collect();
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

/// Rust sources below a folder, sorted.
fn rust_sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.expect("a readable folder").path();
        if path.is_dir() {
            found.extend(rust_sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// (requirement, quoted sentence) of every citation in `sources`. A quote may run over several lines.
fn citations(sources: &[PathBuf]) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    for file in sources {
        let text = fs::read_to_string(file).expect("readable");
        for line in text.lines().map(str::trim) {
            if let Some(target) = line.strip_prefix("//= specs/") {
                found.push((format!("specs/{target}"), String::new()));
            } else if let Some(part) = line.strip_prefix("//# ") {
                let (_, quote) = found.last_mut().expect("a quote follows its target");
                *quote += if quote.is_empty() { "" } else { " " };
                *quote += part;
            }
        }
    }
    found
}

fn test_sources() -> Vec<PathBuf> {
    files("tests/tests", "rs")
}

/// The code that ships, and the harnesses beside it.
fn crate_sources() -> Vec<PathBuf> {
    files("crates", "")
        .into_iter()
        .map(|c| c.join("src"))
        .filter(|c| c.is_dir())
        .flat_map(|c| rust_sources(&c))
        .collect()
}

#[test]
fn every_citation_of_a_requirement_is_word_for_word() {
    let requirements = requirements();
    for (target, quote) in citations(&[test_sources(), crate_sources()].concat()) {
        let (_, sentence) = requirements
            .iter()
            .find(|(name, _)| *name == target)
            .unwrap_or_else(|| panic!("{target} is cited and does not exist"));
        assert_eq!(&quote, sentence, "{target}");
    }
}

/// Requirements that none of `sources` cites.
fn uncited(sources: &[PathBuf]) -> Vec<String> {
    let cited: BTreeSet<_> = citations(sources).into_iter().map(|(target, _)| target).collect();
    requirements().into_iter().map(|(name, _)| name).filter(|name| !cited.contains(name)).collect()
}

#[test]
fn every_requirement_is_cited_by_a_test() {
    let left = uncited(&test_sources());
    assert!(left.is_empty(), "no test cites {left:?}");
}

#[test]
fn every_requirement_is_cited_by_the_function_that_has_to_meet_it() {
    // within the repository, which may lie anywhere
    let within = |path: &Path| path.strip_prefix(repository()).expect("a file of the repository").to_owned();
    let is_evidence =
        |path: &PathBuf| within(path).components().any(|c| c.as_os_str().to_string_lossy().starts_with("proof"));
    let shipping: Vec<_> = crate_sources().into_iter().filter(|path| !is_evidence(path)).collect();
    let left = uncited(&shipping);
    assert!(left.is_empty(), "no function cites {left:?}");
}

/// Names of the test functions of a file, each with what follows it.
fn tests_of(file: &str) -> Vec<String> {
    let text = read(file);
    let functions = text.split("#[test]").skip(1).filter_map(|after| after.split_once("fn "));
    functions.filter_map(|(_, name)| name.split('(').next().map(str::to_owned)).collect()
}

#[test]
fn every_equation_has_properties_snapshots_and_proofs_with_their_twins() {
    for n in 1..=11 {
        let tests = tests_of(&format!("tests/tests/equation_{n:02}.rs"));
        for prefix in ["prop_", "snapshot_"] {
            assert!(tests.iter().any(|t| t.starts_with(prefix)), "Equation {n} has no {prefix}");
        }
        let file = format!("tests/tests/equation_{n:02}_proofs.rs");
        let proofs = tests_of(&file);
        for prefix in ["identity_", "interval_"] {
            assert!(proofs.iter().any(|t| t.starts_with(prefix)), "Equation {n} has no {prefix}");
        }
        assert!(read(&file).contains("for_each_precision!"), "Equation {n} has no bound in both precisions");
    }
}

#[test]
fn every_proof_has_its_twin_and_every_twin_its_proof() {
    for file in test_sources() {
        let name = format!("tests/tests/{}", file.file_name().expect("a file").to_string_lossy());
        let tests = tests_of(&name);
        for test in tests.iter().filter(|t| t.starts_with("identity_") || t.starts_with("interval_")) {
            let other = test.strip_suffix("_twin").map_or_else(|| format!("{test}_twin"), str::to_owned);
            assert!(tests.contains(&other), "{name}: {test} without {other}");
        }
    }
}

/// The words of the body of the test `name` in the source `text`, in order of the alphabet.
fn words_of<'a>(text: &'a str, name: &str) -> BTreeSet<&'a str> {
    let (_, after) = text.split_once(&format!("fn {name}() {{\n")).unwrap_or_else(|| panic!("no test {name}"));
    let body = after.lines().take_while(|line| line.trim() != "}");
    let words = body.flat_map(|line| line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')));
    words.filter(|word| word.starts_with(|c: char| c.is_ascii_alphabetic())).collect()
}

/// What is wrong with the twin of `proof` in `text`: it has to say of the same claim that it is refuted, and nothing else.
fn of_another_claim(text: &str, proof: &str) -> Option<String> {
    let (says, twin) = (words_of(text, proof), words_of(text, &format!("{proof}_twin")));
    let more: Vec<_> = twin.difference(&says).copied().collect();
    let less: Vec<_> = says.difference(&twin).copied().collect();
    let refuted = matches!(more[..], ["rejects"] | ["WRONG" | "TOO_TIGHT", "rejects"] | ["rejects_rounding"]);
    // holds outside of what constants say why
    let constant = |word: &&str| word.chars().all(|c| c.is_ascii_uppercase() || c == '_');
    let shown = match &less[..] {
        ["holds" | "bounded"] => true,
        [reasons @ .., "holds_outside"] => !reasons.is_empty() && reasons.iter().all(constant),
        _ => false,
    };
    (!refuted || !shown).then(|| format!("{proof}: {less:?} against {more:?}"))
}

#[test]
fn every_twin_plants_its_error_in_the_claim_of_its_proof() {
    let mut pairs = 0;
    for file in test_sources() {
        let name = format!("tests/tests/{}", file.file_name().expect("a file").to_string_lossy());
        let text = read(&name);
        for proof in tests_of(&name).iter().filter(|t| t.starts_with("identity_") || t.starts_with("interval_")) {
            if !proof.ends_with("_twin") {
                pairs += 1;
                assert_eq!(of_another_claim(&text, proof), None, "{name}");
            }
        }
    }
    assert!(pairs > 100, "{pairs} pairs");
}

#[test]
fn a_twin_of_another_claim_is_told() {
    let text = |proof: &str, twin: &str| {
        format!("fn identity_a() {{\n    {proof}\n}}\nfn identity_a_twin() {{\n    {twin}\n}}\n")
    };
    let found = |proof: &str, twin: &str| of_another_claim(&text(proof, twin), "identity_a").is_some();
    assert!(!found("holds(a);", "rejects(WRONG, a);"));
    assert!(!found("holds_outside(&[LIMITED], a);", "rejects(&[(7, 5)], a);"));
    assert!(found("holds(a);", "rejects(WRONG, b);"), "another claim");
    assert!(found("holds(a);", "rejects(WRONG, a); rejects(WRONG, b);"), "another beside it");
    assert!(found("holds(a);", "holds(a);"), "the same");
    assert!(found("holds(a);", "panic!();"), "none");
    assert!(found("holds(a); holds(b);", "rejects(WRONG, a);"), "one of two");
}

#[test]
fn the_audit_repeats_the_table_of_tolerances() {
    let audit = read("docs/src/audit.md");
    for row in TABLE {
        let number = |v: f64| format!("{v:e}");
        let [of, reason] = [row.of, row.reason].map(|text| text.replace('|', "&#124;"));
        let expected = format!("| {of} | {} | {} | {reason} |", number(row.f64), number(row.f32));
        assert!(audit.lines().any(|line| line == expected), "docs/src/audit.md lacks {expected}");
    }
    let rows =
        audit.lines().skip_while(|l| !l.starts_with("| of |")).skip(2).take_while(|l| l.starts_with('|')).count();
    assert_eq!(rows, TABLE.len(), "rows that the table does not have");
}

#[test]
fn the_audit_names_every_precondition() {
    let audit = read("docs/src/audit.md");
    for file in test_sources() {
        let name = file.file_name().expect("a file").to_string_lossy().into_owned();
        let assumes = fs::read_to_string(&file).expect("readable").contains(concat!("proof.assume_", "positive("));
        assert_eq!(audit.contains(&format!("| `{name}` |")), assumes, "{name} in the table of preconditions");
    }
}

#[test]
fn the_audit_states_the_boxes_and_the_assumptions_as_they_are() {
    let audit = read("docs/src/audit.md").split_whitespace().collect::<Vec<_>>().join(" ");
    let (angle, ratio) = (any_angle(), any_ratio());
    let degrees = |v: f64| v.to_degrees().round();
    let expected = [
        format!("angles from −{}° to {}°", -degrees(angle.lo), degrees(angle.hi)),
        format!("ratios of detection gains from {} to {}", ratio.lo, ratio.hi),
        format!("within {} unit in the last place (sine and cosine)", <f32 as Format>::SIN_COS_ULPS),
        format!("{} units (arctangent)", <f32 as Format>::ATAN2_ULPS),
        format!("up to {} points that obey", cvg_prover::SAMPLES),
        format!("the middle of up to {},000 boxes", cvg_prover::MOST_POINTS / 1000),
    ];
    for text in expected {
        assert!(audit.contains(&text), "docs/src/audit.md does not say: {text}");
    }
    assert_eq!(<f32 as Format>::SIN_COS_ULPS, <f64 as Format>::SIN_COS_ULPS);
    assert_eq!(<f32 as Format>::ATAN2_ULPS, <f64 as Format>::ATAN2_ULPS);
}

#[test]
fn duvet_reads_every_file_of_requirements() {
    let configuration = read(".duvet/config.toml");
    for file in files("specs", "md") {
        let name = file.file_name().expect("a file").to_string_lossy().into_owned();
        let listed = configuration.contains(&format!("source = \"specs/{name}\""));
        assert_eq!(listed, name != "README.md", "{name} in .duvet/config.toml");
    }
}

/// The prefix says that cases are drawn at random: then the test has something to draw.
#[test]
fn a_test_of_random_cases_draws_them() {
    for file in test_sources() {
        let text = fs::read_to_string(&file).expect("readable");
        let fixed = text.lines().find(|line| line.trim_start().starts_with("fn prop_") && line.ends_with("() {"));
        assert!(fixed.is_none(), "{}: {fixed:?}", file.display());
    }
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
fn every_table_has_a_line_below_its_head_with_as_many_columns() {
    let columns = |line: &str| line.replace("\\|", "").matches('|').count();
    for file in files("docs/src", "md") {
        let page = std::fs::read_to_string(&file).expect("a chapter");
        for (head, below) in page.lines().zip(page.lines().skip(1)).filter(|(_, below)| below.starts_with("| ---")) {
            assert_eq!(columns(head), columns(below), "{}: {head}", file.display());
        }
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
