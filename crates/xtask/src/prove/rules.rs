//! What a harness has to keep to be believed, as far as its source shows it.
//!
//! The solver says whether an assertion can fail. It does not say that the assertion is reached, that the inputs are what
//! the text says, or that the twin is about the same claim. Each rule here refuses one way in which a harness that proves
//! nothing would pass.

use std::collections::BTreeSet;
use std::path::Path;

use crate::source::{self, Function};

/// Everything that is wrong with the harnesses among `functions`, which call each other and `known`.
pub(super) fn faults(functions: &[Function], known: &[Function]) -> Vec<String> {
    let mut found = Vec::new();
    for f in functions.iter().filter(|f| f.has("kani::proof")) {
        found.extend(own_claims(f));
        found.extend(unrelated(f, functions, known));
        for called in source::reached(f, known) {
            found.extend(unlabelled(called));
            found.extend(unseen(called));
            found.extend(not_compiled(called));
        }
    }
    found.sort();
    found.dedup();
    found
}

/// Sources of the crates for firmware that hold an assertion that is not compiled into what is proved.
pub(super) fn uncompiled(repository: &Path, file: &Path) -> Result<Option<String>, String> {
    Ok(source::read(repository, file)?.iter().find_map(not_compiled))
}

fn at(f: &Function, what: &str) -> String {
    format!("{}:{}: {} {what}", f.file.display(), f.line, f.name)
}

/// Calls to the function `name` or the macro `name!` in `text`, as words.
fn calls(text: &str, name: &str) -> bool {
    let before = |at: usize| text[..at].chars().next_back().is_none_or(|c| !(c.is_ascii_alphanumeric() || c == '_'));
    text.match_indices(name).any(|(at, _)| before(at))
}

fn asserts(text: &str) -> bool {
    ["assert!(", "assert_eq!(", "assert_ne!("].iter().any(|call| calls(text, call))
}

/// What is claimed and assumed stands in a body that the twin has too.
fn own_claims(f: &Function) -> Option<String> {
    let own = asserts(&f.body) || ["kani::any", "kani::assume", "kani::cover"].iter().any(|call| f.body.contains(call));
    own.then(|| at(f, "claims or assumes something itself: the body belongs to it and its twin alike"))
}

/// A proof and its twin call one body that asserts something.
fn unrelated(f: &Function, functions: &[Function], known: &[Function]) -> Option<String> {
    let claim = f.name.strip_prefix("proof_")?;
    let twin = functions.iter().find(|t| t.name == format!("twin_{claim}"))?;
    let bodies = |f: &Function| -> BTreeSet<String> {
        let words = f.body.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).filter(|w| *w != f.name);
        let named = words.filter_map(|word| known.iter().find(|g| g.name == word));
        let asserting = named.filter(|g| source::reached(g, known).iter().any(|h| asserts(&h.body)));
        asserting.map(|g| g.name.clone()).collect()
    };
    bodies(f).is_disjoint(&bodies(twin)).then(|| at(f, "has a twin that is not about the same body"))
}

/// A statement at the margin of a function's body, with the comment right above it.
struct Statement<'a> {
    comment: Vec<&'a str>,
    lines: Vec<&'a str>,
}

fn indentation(line: &str) -> usize {
    line.len() - line.trim_start().len()
}

fn statements(f: &Function) -> Vec<Statement<'_>> {
    let lines: Vec<&str> = f.body.lines().collect();
    let Some((first, inner)) = lines.split_first() else { return Vec::new() };
    if inner.is_empty() {
        return vec![Statement { comment: Vec::new(), lines }];
    }
    let margin = indentation(first) + 4;
    let (mut found, mut comment): (Vec<Statement<'_>>, Vec<&str>) = (Vec::new(), Vec::new());
    for &line in &inner[..inner.len() - 1] {
        let text = line.trim();
        let begins = indentation(line) == margin && !text.starts_with(['}', ')', ']']);
        if begins && text.starts_with("//") {
            comment.push(text);
        } else if begins {
            found.push(Statement { comment: std::mem::take(&mut comment), lines: vec![line] });
        } else if let Some(last) = found.last_mut() {
            last.lines.push(line);
        }
    }
    found
}

/// Every statement that assumes something says of what kind and why, for itself.
fn unlabelled(f: &Function) -> Option<String> {
    if f.name == "sized" {
        // a range of magnitudes, of which the caller says why
        return None;
    }
    let label = |line: &&str| ["// precondition: ", "// budget: "].iter().any(|label| line.trim().starts_with(label));
    let silent = statements(f).into_iter().find(|s| {
        let text = s.lines.join("\n");
        let assumes = ["assume(", "any_where(", "sized(", "sized::<"].iter().any(|call| calls(&text, call));
        assumes && !s.comment.iter().chain(&s.lines).any(label)
    });
    silent.map(|s| at(f, &format!("assumes without saying why: {}", s.lines[0].trim())))
}

/// An assertion under a condition comes with a cover under the same one: in its block, or of all that the condition says.
fn unseen(f: &Function) -> Option<String> {
    let lines: Vec<&str> = f.body.lines().collect();
    let covered: Vec<BTreeSet<String>> = f
        .body
        .split("cover!(")
        .skip(1)
        .filter_map(|call| call.split_once(");").and_then(|(arguments, _)| arguments.rsplit_once(", \"")))
        .map(|(condition, _)| conjuncts(condition))
        .collect();
    for (n, line) in lines.iter().enumerate() {
        let text = line.trim();
        let opens =
            text.ends_with('{') && (text.starts_with("if ") || text.starts_with("} else") || text.contains("=> {"));
        if !opens {
            continue;
        }
        let end = (n + 1..lines.len())
            .find(|&k| indentation(lines[k]) == indentation(line) && lines[k].trim().starts_with('}'));
        let block = &lines[n + 1..end.unwrap_or(lines.len())];
        let condition = conjuncts(text.trim_start_matches("if ").trim_end_matches('{'));
        let seen = block.iter().any(|l| l.contains("cover!("))
            || (text.starts_with("if ") && covered.iter().any(|c| c.is_superset(&condition)));
        if block.iter().any(|l| asserts(l)) && !seen {
            return Some(at(f, &format!("asserts where no cover shows that it comes: {text}")));
        }
    }
    None
}

/// a && b && c, each for itself and without its line breaks.
fn conjuncts(condition: &str) -> BTreeSet<String> {
    let words = condition.split_whitespace().collect::<Vec<_>>().join(" ");
    words.split(" && ").map(|part| part.trim().to_owned()).collect()
}

/// An assertion of debug builds is not in the release build that is proved.
fn not_compiled(f: &Function) -> Option<String> {
    let code = f.body.lines().filter(|line| !line.trim().starts_with("//"));
    let debug = code.into_iter().any(|line| calls(line, "debug_assert"));
    debug.then(|| at(f, "has a debug_assert, which is not compiled into what is proved"))
}

#[cfg(test)]
mod tests {
    use super::faults;
    use crate::source::functions;
    use std::path::Path;

    const SOUND: &str = r#"
fn square_is_small<T>(claimed: f32) {
    // precondition: a share
    let x: f32 = kani::any_where(|x| *x >= 0.0 && *x <= 1.0);
    // budget: not too small
    kani::assume(
        x > 0.001,
    );
    let y = x * x;
    kani::cover!(y > 0.5, "more than half");
    if y > 0.5 {
        assert!(y <= claimed);
    }
    if y < 0.1 {
        kani::cover!(true, "less than a tenth");
        assert!(x < 0.5);
    }
}

/// About [`black_box`].
#[kani::proof]
pub fn proof_square_is_small() {
    square_is_small(1.0);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_square_is_small() {
    square_is_small(0.6);
}
"#;

    fn found(text: &str) -> String {
        let all = functions(Path::new("a.rs"), text);
        faults(&all, &all).join("\n")
    }

    /// The sound harness with `old` changed to `new`.
    fn changed(old: &str, new: &str) -> String {
        assert!(SOUND.contains(old), "{old}");
        found(&SOUND.replacen(old, new, 1))
    }

    #[test]
    fn a_harness_that_keeps_the_rules_is_taken() {
        assert_eq!(found(SOUND), "");
    }

    #[test]
    fn a_second_assumption_needs_a_label_of_its_own() {
        let second = changed("    // budget: not too small\n", "");
        assert!(second.contains("square_is_small assumes without saying why: kani::assume("), "{second}");
        let later = changed("    let y = x * x;\n", "    let y = x * x;\n    kani::assume(y == 1.0);\n");
        assert!(later.contains("kani::assume(y == 1.0);"), "{later}");
        let by_name =
            changed("    let y = x * x;\n", "    use kani::assume;\n    assume(x == 1.0);\n    let y = x * x;\n");
        assert!(by_name.contains("assume(x == 1.0);"), "{by_name}");
    }

    #[test]
    fn an_assertion_that_is_never_reached_needs_a_cover() {
        let dead =
            changed("    if y < 0.1 {\n", "    if y > 2.0 {\n        assert!(y == 42.0);\n    }\n    if y < 0.1 {\n");
        assert!(dead.contains("no cover shows that it comes: if y > 2.0 {"), "{dead}");
        let other = changed(
            "    }\n    if y < 0.1 {\n",
            "    } else {\n        assert!(y == 42.0);\n    }\n    if y < 0.1 {\n",
        );
        assert!(other.contains("no cover shows that it comes: } else {"), "{other}");
        let narrower = changed("    if y > 0.5 {\n", "    if y > 0.5 && x > 2.0 {\n");
        assert!(narrower.contains("if y > 0.5 && x > 2.0 {"), "{narrower}");
    }

    #[test]
    fn a_twin_of_another_claim_is_none() {
        let other = "\nfn other() {\n    assert!(kani::any::<u32>() != 7);\n}\n";
        let text = SOUND.replacen("    square_is_small(0.6);", "    other();", 1) + other;
        assert!(found(&text).contains("proof_square_is_small has a twin that is not about the same body"));
        let inline = changed("    square_is_small(0.6);", "    assert!(kani::any::<u32>() != 7);");
        assert!(inline.contains("twin_square_is_small claims or assumes something itself"), "{inline}");
    }

    #[test]
    fn an_assertion_of_debug_builds_is_refused() {
        let debug = changed("    let y = x * x;\n", "    let y = x * x;\n    debug_assert!(x < 0.5, \"false\");\n");
        assert!(debug.contains("square_is_small has a debug_assert"), "{debug}");
    }
}
