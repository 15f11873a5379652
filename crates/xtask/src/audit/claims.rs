//! What there should be: the requirements of `specs/`, the functions, tests and harnesses that cite them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::flight;
use crate::prove;
use crate::source::{self, Function};

/// A file of `specs/`.
#[derive(Clone, Debug)]
pub(crate) struct Chapter {
    /// of the equation; `None` for what runs beside the equations
    pub(crate) number: Option<u8>,
    pub(crate) title: String,
    pub(crate) requirements: Vec<Requirement>,
    /// why there is no bit-precise proof
    pub(crate) without_bits: Option<String>,
}

/// A heading of `specs/`.
#[derive(Clone, Debug)]
pub(crate) struct Requirement {
    /// `specs/equation-05.md#zero-is-kept`
    pub(crate) id: String,
    pub(crate) text: String,
    pub(crate) domain: String,
    /// what is not proved, and why
    pub(crate) not_proved: Option<String>,
    /// functions that have to meet it and that nobody calls in the instrument, in backticks, and why
    pub(crate) not_flown: Option<String>,
}

/// A function that has to meet a requirement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Meets {
    pub(crate) name: String,
    pub(crate) place: String,
    /// who calls it, from what the firmware calls; none where nobody does
    pub(crate) called: Option<Vec<String>>,
}

/// How the runner calls a test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Names {
    /// by these names
    Exactly(Vec<String>),
    /// by any path that ends so: it stands in a macro of its file
    Ending(String),
}

/// A test as its file names it.
#[derive(Clone, Debug)]
pub(crate) struct Test {
    /// `equation_05_proofs`
    pub(crate) file: String,
    pub(crate) names: Names,
    pub(crate) function: Function,
    /// what it and the functions that it calls in its file assume beyond the domain
    pub(crate) assumptions: Vec<String>,
}

/// A bit-precise harness as its file names it.
#[derive(Clone, Debug)]
pub(crate) struct Harness {
    pub(crate) name: String,
    pub(crate) requirements: Vec<String>,
    /// functions that it is about and that nobody calls in the instrument
    pub(crate) uncalled: Vec<String>,
}

/// Everything that is named.
#[derive(Clone, Debug, Default)]
pub(crate) struct Named {
    pub(crate) chapters: Vec<Chapter>,
    pub(crate) tests: Vec<Test>,
    pub(crate) harnesses: Vec<Harness>,
    /// the functions that have to meet each requirement
    pub(crate) functions: BTreeMap<String, Vec<Meets>>,
    /// the test files in which some test cites a requirement
    pub(crate) files: Vec<String>,
}

/// Reads the repository.
pub(crate) fn read(repository: &Path) -> Result<Named, String> {
    let mut named = Named::default();
    for file in listed(&repository.join("specs"), "md")? {
        let name = stem(&file);
        if name != "README" {
            named.chapters.push(chapter(&name, &text(&file)?)?);
        }
    }
    for file in listed(&repository.join("tests/tests"), "rs")? {
        let tests = tests(&stem(&file), &text(&file)?);
        if tests.iter().any(|t| !t.function.citations.is_empty()) {
            named.files.push(stem(&file));
            named.tests.extend(tests);
        }
    }
    let (calls, known) = (flight::calls(repository)?, flight::known(repository)?);
    let called = |name: &str| calls.keys().any(|(n, _)| n == name);
    for harness in prove::harnesses(repository)? {
        if harness.function.name.starts_with("proof_") && !harness.function.name.starts_with("proof_guard_") {
            let requirements = harness.function.citations.iter().map(|c| c.target.clone()).collect();
            let uncalled = source::subjects(&harness.function.doc);
            let uncalled = uncalled.into_iter().filter(|name| known.contains(name) && !called(name)).collect();
            named.harnesses.push(Harness { name: harness.function.name.clone(), requirements, uncalled });
        }
    }
    let evidence = |path: &Path| path.components().any(|c| c.as_os_str().to_string_lossy().starts_with("proof"));
    for file in source::rust_files(&repository.join("crates")) {
        // within the repository, which may lie anywhere
        let within = file.strip_prefix(repository).unwrap_or(&file);
        if evidence(within) || within.starts_with("crates/xtask") {
            continue;
        }
        let place = within.display().to_string();
        let text = text(&file)?;
        for function in source::functions(Path::new(&place), &text) {
            let name = flight::in_full(&text, &function);
            for citation in &function.citations {
                let functions = named.functions.entry(citation.target.clone()).or_default();
                let called = calls.get(&(name.clone(), place.clone())).cloned();
                functions.push(Meets { name: name.clone(), place: place.clone(), called });
            }
        }
    }
    Ok(named)
}

fn text(file: &Path) -> Result<String, String> {
    fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))
}

fn stem(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn listed(folder: &Path, extension: &str) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut found: Vec<_> =
        entries.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e == extension)).collect();
    found.sort();
    Ok(found)
}

/// The anchor that a heading has.
fn anchor(heading: &str) -> String {
    let kept = heading.to_lowercase();
    kept.chars().map(|c| if c == ' ' { '-' } else { c }).filter(|c| c.is_ascii_alphanumeric() || *c == '-').collect()
}

/// A file of `specs/` with the name `name`, without its extension.
fn chapter(name: &str, text: &str) -> Result<Chapter, String> {
    let mut sections = text.split("\n## ");
    let head = sections.next().unwrap_or_default();
    let line = |body: &str, label: &str| body.lines().find_map(|l| l.strip_prefix(label).map(str::to_owned));
    // of the whole chapter, unless a requirement says more
    let of_all = line(head, "Not in the instrument: ");
    let mut requirements = Vec::new();
    for section in sections {
        let (heading, body) = section.split_once('\n').ok_or_else(|| format!("{name}: {section} is empty"))?;
        let sentence = body.lines().find(|l| l.contains(" MUST "));
        requirements.push(Requirement {
            id: format!("specs/{name}.md#{}", anchor(heading)),
            text: sentence.ok_or_else(|| format!("{name}: {heading} requires nothing"))?.to_owned(),
            domain: line(body, "Domain: ").ok_or_else(|| format!("{name}: {heading} has no domain"))?,
            not_proved: line(body, "Not proved: "),
            not_flown: line(body, "Not in the instrument: ").or_else(|| of_all.clone()),
        });
    }
    Ok(Chapter {
        number: name.strip_prefix("equation-").and_then(|n| n.parse().ok()),
        title: line(head, "# ").ok_or_else(|| format!("{name} has no title"))?,
        requirements,
        without_bits: line(head, "No bit-precise proof: "),
    })
}

/// The tests of a file, each with the names by which the runner will call it.
fn tests(file: &str, text: &str) -> Vec<Test> {
    let functions = source::functions(Path::new(file), text);
    let found = functions.iter().filter(|f| f.has("test"));
    found
        .map(|f| {
            let name = &f.name;
            let names = match surrounding(text, f.line) {
                Some("for_each_scalar! {" | "for_each_precision! {") => {
                    Names::Exactly(vec![format!("in_f64::{name}"), format!("in_f32::{name}")])
                }
                None | Some("proptest! {") => Names::Exactly(vec![name.clone()]),
                Some(_) => Names::Ending(name.clone()),
            };
            Test { file: file.to_owned(), names, function: f.clone(), assumptions: assumed(f, &functions, text) }
        })
        .collect()
}

/// The line at the margin that opens the block in which line `line` (from 1) stands.
fn surrounding(text: &str, line: usize) -> Option<&str> {
    let before: Vec<&str> = text.lines().take(line).collect();
    let inner = before.last()?.starts_with(' ');
    let opens = |l: &&&str| l.ends_with('{') && !l.starts_with([' ', '/', '}']);
    before.iter().rev().skip(1).find(opens).copied().filter(|_| inner)
}

/// What `function` and those that it calls in its file tell a proof to assume.
fn assumed(function: &Function, in_file: &[Function], text: &str) -> Vec<String> {
    let (mut reached, mut next, mut found) = (vec![function], 0, Vec::new());
    while let Some(f) = reached.get(next).copied() {
        next += 1;
        for call in f.body.split(concat!("proof.", "assume_")).skip(1) {
            let call = call.lines().next().unwrap_or_default().trim_end_matches([';', '?']);
            found.push(format!("{}: {call}", f.name));
        }
        for reason in f.body.split(concat!("proof.may_be", "_empty(\"")).skip(1) {
            let reason = reason.split_once('"').map_or("", |(told, _)| told);
            found.push(format!("paths without a point are not shown to be empty: {reason}"));
        }
        for reason in f.body.split(concat!("holds_", "outside(")).skip(1) {
            let reasons = reason.split_once(']').map_or("", |(list, _)| list).trim_start_matches(['&', '[', '\n', ' ']);
            // a constant of the file stands for its text
            let named = text.split_once(&format!("const {}: &str = \"", reasons.trim()));
            let told = named.and_then(|(_, rest)| rest.split_once('"')).map_or(reasons.trim(), |(told, _)| told);
            found.push(format!("nothing is claimed where {told}"));
        }
        let words = f.body.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        for called in words.filter_map(|w| in_file.iter().find(|g| g.name == w)) {
            if !reached.iter().any(|r| r.line == called.line) {
                reached.push(called);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{Names, chapter, tests};

    #[test]
    fn a_chapter_has_its_requirements_with_their_domains_and_reasons() {
        let text = "# Equation 5: a product\n\nNo bit-precise proof: none is needed.\n\n## Zero is kept\n\nIt MUST be zero.\n\n\
            Domain: all of it.\n\nNot proved: it is obvious.\n\n## Sign\n\nIt MUST stay.\n\nDomain: half.\n\nNot in the instrument: `f`: so.\n";
        let found = chapter("equation-05", text).expect("well-formed");
        assert_eq!((found.number, found.title.as_str()), (Some(5), "Equation 5: a product"));
        assert_eq!(found.without_bits.as_deref(), Some("none is needed."));
        let [zero, sign] = &found.requirements[..] else { panic!("two requirements") };
        assert_eq!((zero.id.as_str(), zero.text.as_str()), ("specs/equation-05.md#zero-is-kept", "It MUST be zero."));
        assert_eq!((zero.domain.as_str(), zero.not_proved.as_deref()), ("all of it.", Some("it is obvious.")));
        assert_eq!((sign.domain.as_str(), sign.not_proved.as_deref()), ("half.", None));
        assert_eq!((zero.not_flown.as_deref(), sign.not_flown.as_deref()), (None, Some("`f`: so.")));
        let whole =
            format!("# A\n\nNot in the instrument: `g`.\n\n## B{}", text.split_once("## Sign").expect("there").1);
        let of_all = chapter("dsp", &whole.replace("Not in the instrument: `f`: so.\n", "")).expect("well-formed");
        assert_eq!(of_all.requirements[0].not_flown.as_deref(), Some("`g`."));
        assert!(chapter("dsp", "# A\n\n## B\n\nIt MUST be.\n").is_err(), "no domain");
        assert!(chapter("dsp", "# A\n\n## B\n\nDomain: all.\n").is_err(), "no requirement");
    }

    #[test]
    fn a_test_is_called_as_its_surroundings_make_the_runner_call_it() {
        let text = "fn claim(proof: &mut Proof) {\n    proof.assume_positive(room)?;\n}\n\n#[test]\nfn identity_x() {\n    \
            holds(claim);\n}\n\nfor_each_precision! {\n    #[test]\n    fn interval_y() {\n        bounded();\n    }\n}\n\n\
            macro_rules! fault {\n    () => {\n        #[test]\n        fn in_f32() {\n            ends();\n        }\n    };\n}\n\n\
            proptest! {\n    #[test]\n    fn prop_z(x in 0..9) {\n        f(x);\n    }\n}\n";
        let found = tests("a", text);
        let names: Vec<_> = found.iter().map(|t| t.names.clone()).collect();
        let exactly = |names: &[&str]| Names::Exactly(names.iter().map(|n| (*n).to_owned()).collect());
        let expected = [
            exactly(&["identity_x"]),
            exactly(&["in_f64::interval_y", "in_f32::interval_y"]),
            Names::Ending("in_f32".to_owned()),
            exactly(&["prop_z"]),
        ];
        assert_eq!(names, expected);
        assert_eq!(found[0].assumptions, ["claim: positive(room)"]);
        assert!(found[1].assumptions.is_empty());
        let unvisited =
            "fn claim() {\n    proof.may_be_empty(\"rare\");\n}\n\n#[test]\nfn identity_x() {\n    holds(claim);\n}\n";
        assert_eq!(tests("a", unvisited)[0].assumptions, ["paths without a point are not shown to be empty: rare"]);
        let left_out = "const LIMITED: &str = \"a drive is at its limit\";\n\n#[test]\nfn identity_x() {\n    \
            holds_outside(&[LIMITED], claim);\n}\n";
        assert_eq!(tests("a", left_out)[0].assumptions, ["nothing is claimed where a drive is at its limit"]);
    }
}
