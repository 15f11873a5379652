//! What the sources name: functions with their citations of requirements, their attributes and their covers.
//!
//! It reads lines, not syntax: rustfmt puts a function's closing brace at the indentation of its first line.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A requirement as a function cites it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Citation {
    /// `specs/equation-03.md#signs`
    pub(crate) target: String,
    /// the sentence
    pub(crate) quote: String,
}

/// A function as it stands in a file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Function {
    /// relative to the repository
    pub(crate) file: PathBuf,
    pub(crate) line: usize,
    pub(crate) name: String,
    pub(crate) doc: String,
    pub(crate) citations: Vec<Citation>,
    /// `kani::unwind(3)`
    pub(crate) attributes: Vec<String>,
    pub(crate) body: String,
}

impl Function {
    /// The argument of the attribute `name`.
    pub(crate) fn argument(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find_map(|a| a.strip_prefix(name)?.strip_prefix('(')?.strip_suffix(')'))
    }

    pub(crate) fn has(&self, attribute: &str) -> bool {
        self.attributes.iter().any(|a| a == attribute)
    }
}

/// The name of the function that `line` begins.
fn function_name(line: &str) -> Option<&str> {
    let mut rest = line.trim_start();
    if let Some(after) = rest.strip_prefix("pub") {
        rest = after.strip_prefix('(').map_or(after, |scope| scope.split_once(')').map_or(after, |(_, r)| r));
        rest = rest.trim_start();
    }
    rest = rest.strip_prefix("const ").unwrap_or(rest);
    let name = rest.strip_prefix("fn ")?;
    let end = name.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'))?;
    (end > 0).then(|| &name[..end])
}

fn indentation(line: &str) -> usize {
    line.len() - line.trim_start().len()
}

/// The functions of a source text.
pub(crate) fn functions(file: &Path, text: &str) -> Vec<Function> {
    let lines: Vec<&str> = text.lines().collect();
    let mut found = Vec::new();
    let mut pending = Function::default();
    for (i, line) in lines.iter().enumerate() {
        let trimmed = line.trim();
        if let Some(target) = trimmed.strip_prefix("//= ") {
            if target.starts_with("specs/") {
                pending.citations.push(Citation { target: target.to_owned(), quote: String::new() });
            }
        } else if let Some(quote) = trimmed.strip_prefix("//# ") {
            if let Some(last) = pending.citations.last_mut() {
                let space = if last.quote.is_empty() { "" } else { " " };
                last.quote += &format!("{space}{quote}");
            }
        } else if let Some(doc) = trimmed.strip_prefix("///") {
            let space = if pending.doc.is_empty() { "" } else { " " };
            pending.doc += &format!("{space}{}", doc.trim());
        } else if let Some(attribute) = trimmed.strip_prefix("#[") {
            pending.attributes.push(attribute.trim_end_matches(']').to_owned());
        } else if let Some(name) = function_name(line) {
            let indent = indentation(line);
            let end = (i..lines.len())
                .find(|&k| (k > i || line.ends_with('}')) && lines[k].ends_with('}') && indentation(lines[k]) == indent)
                .unwrap_or(i);
            let body = lines[i..=end].join("\n");
            found.push(Function {
                file: file.to_owned(),
                line: i + 1,
                name: name.to_owned(),
                body,
                ..std::mem::take(&mut pending)
            });
        } else {
            pending = Function::default();
        }
    }
    found
}

/// `function` and what it calls, as far as it is among `known`.
pub(crate) fn reached<'a>(function: &'a Function, known: &'a [Function]) -> Vec<&'a Function> {
    let mut seen = BTreeSet::from([function.name.as_str()]);
    let mut found = vec![function];
    let mut next = 0;
    while let Some(f) = found.get(next).copied() {
        next += 1;
        let words = f.body.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        for word in words.collect::<BTreeSet<_>>() {
            found.extend(known.iter().find(|g| g.name == word).filter(|_| seen.insert(word)));
        }
    }
    found
}

/// The texts of the covers in `function` and in what it calls among `known`.
pub(crate) fn covers(function: &Function, known: &[Function]) -> BTreeSet<String> {
    let calls = reached(function, known).into_iter().flat_map(|f| f.body.split("cover!(").skip(1));
    // the text is the macro's last argument and holds no quote
    calls
        .filter_map(|call| call.split_once(");").and_then(|(arguments, _)| arguments.rsplit('"').nth(1)))
        .map(str::to_owned)
        .collect()
}

/// What `function` and what it calls among `known` assume: "precondition" or "budget", and the words after it.
///
/// # Errors
/// Something is assumed where no comment says which of the two it is.
pub(crate) fn assumptions(function: &Function, known: &[Function]) -> Result<Vec<(&'static str, String)>, String> {
    let mut found = Vec::new();
    for f in reached(function, known) {
        let before = found.len();
        let mut lines = f.body.lines().map(str::trim).peekable();
        while let Some(line) = lines.next() {
            let Some((kind, text)) = ["precondition", "budget"]
                .into_iter()
                .find_map(|kind| Some((kind, line.strip_prefix("// ")?.strip_prefix(kind)?.strip_prefix(": ")?)))
            else {
                continue;
            };
            let mut text = text.to_owned();
            while let Some(more) = lines.next_if(|next| next.starts_with("// ")) {
                text += &more[2..];
            }
            if !found.contains(&(kind, text.clone())) {
                found.push((kind, text));
            }
        }
        // of `sized`, a range of magnitudes, the caller says why
        let assumes = ["kani::assume(", "any_where(", "sized(", "sized::<"].iter().any(|call| f.body.contains(call));
        let assumes = assumes && f.name != "sized";
        if assumes && found.len() == before && !f.body.contains("// precondition: ") && !f.body.contains("// budget: ")
        {
            return Err(format!("{}:{}: {} assumes without saying why", f.file.display(), f.line, f.name));
        }
    }
    Ok(found)
}

/// What the doc comment of a function names in backticks and brackets: the functions that it is about.
pub(crate) fn subjects(doc: &str) -> Vec<String> {
    doc.split("[`").skip(1).filter_map(|rest| rest.split_once("`]")).map(|(name, _)| name.to_owned()).collect()
}

/// Every Rust source below `folder`, sorted.
pub(crate) fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let Ok(entries) = fs::read_dir(folder) else { return found };
    for path in entries.flatten().map(|entry| entry.path()) {
        if path.is_dir() {
            if path.file_name().is_none_or(|name| name != "target") {
                found.extend(rust_files(&path));
            }
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The functions of a file of the repository.
pub(crate) fn read(repository: &Path, file: &Path) -> Result<Vec<Function>, String> {
    let text = fs::read_to_string(file).map_err(|e| format!("{}: {e}", file.display()))?;
    Ok(functions(file.strip_prefix(repository).unwrap_or(file), &text))
}

/// What git says.
pub(crate) fn git(arguments: &[&str]) -> Result<String, String> {
    let output =
        Command::new("git").args(arguments).current_dir(crate::repository()).output().map_err(|e| e.to_string())?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(format!("git {}: {}", arguments.join(" "), String::from_utf8_lossy(&output.stderr)))
    }
}

/// A number that a commit draws for a text: another for each.
pub(crate) fn drawn(commit: &str, text: &str) -> u64 {
    // FNV-1a, and a last mixing: names that differ in their end are to be far apart
    let sum = commit
        .bytes()
        .chain(text.bytes())
        .fold(0xcbf2_9ce4_8422_2325_u64, |sum, byte| (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    (sum ^ (sum >> 31)).wrapping_mul(0x9e37_79b9_7f4a_7c15)
}

#[cfg(test)]
mod tests {
    use super::{assumptions, covers, functions, subjects};
    use std::path::Path;

    const TEXT: &str = r#"
fn body<T>(share: T) {
    kani::cover!(share > 0, "positive");
    kani::cover!(
        share == 0 && true,
        "none at all"
    );
    helper();
}

fn helper() { kani::cover!(true, "helped"); }

fn unrelated() {
    kani::cover!(true, "never asked");
}

//= specs/equation-03.md#no-windup
//= type=test
//# The integral MUST NOT grow in the direction
//# in which the output is at its limit.
/// What it says.
#[kani::proof]
#[kani::unwind(3)]
pub fn proof_it() {
    body(1);
}

// nothing
fn plain() {}
"#;

    #[test]
    fn a_function_has_its_citation_attributes_and_text() {
        let all = functions(Path::new("a.rs"), TEXT);
        let names: Vec<_> = all.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["body", "helper", "unrelated", "proof_it", "plain"]);
        let proof = &all[3];
        assert_eq!(proof.citations[0].target, "specs/equation-03.md#no-windup");
        assert_eq!(
            proof.citations[0].quote,
            "The integral MUST NOT grow in the direction in which the output is at its limit."
        );
        assert_eq!(proof.doc, "What it says.");
        assert_eq!(proof.argument("kani::unwind"), Some("3"));
        assert!(proof.has("kani::proof") && !proof.has("kani::should_panic"));
        assert!(all[4].citations.is_empty() && all[4].attributes.is_empty());
    }

    #[test]
    fn covers_are_those_of_the_body_and_of_what_it_calls() {
        let all = functions(Path::new("a.rs"), TEXT);
        let found: Vec<_> = covers(&all[3], &all).into_iter().collect();
        assert_eq!(found, ["helped", "none at all", "positive"]);
    }

    #[test]
    fn an_assumption_says_which_kind_it_is_and_why() {
        let text = "fn body() {\n    // precondition: below ten,\n    // or not\n    kani::assume(x < 10);\n    inner();\n}\n\
            fn inner() {\n    // budget: small\n    let y = kani::any_where(|y| *y < 3);\n}\n";
        let all = functions(Path::new("a.rs"), text);
        let expected = vec![("precondition", "below ten, or not".to_owned()), ("budget", "small".to_owned())];
        assert_eq!(assumptions(&all[0], &all), Ok(expected));
        let silent = functions(Path::new("a.rs"), &text.replace("budget", "because"));
        let refused = assumptions(&silent[0], &silent).expect_err("not labelled");
        assert!(refused.contains("a.rs:7: inner"), "{refused}");
    }

    #[test]
    fn subjects_are_what_the_doc_links_to() {
        assert_eq!(subjects("Of [`Pi::step`] and [`f`], not `g`."), ["Pi::step", "f"]);
    }
}
