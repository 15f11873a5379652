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
            found.extend(early(called));
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

/// The lines of a body without what is only said.
fn code(f: &Function) -> Vec<&str> {
    let spoken = |line: &&str| line.trim_start().starts_with("//");
    f.body.lines().map(|line| if spoken(&line) { "" } else { line.split(" // ").next().unwrap_or(line) }).collect()
}

fn claims(f: &Function) -> bool {
    asserts(&code(f).join("\n"))
}

/// What is claimed and assumed stands in a body that the twin has too.
fn own_claims(f: &Function) -> Option<String> {
    let own = claims(f) || ["kani::any", "kani::assume", "kani::cover"].iter().any(|call| f.body.contains(call));
    own.then(|| at(f, "claims or assumes something itself: the body belongs to it and its twin alike"))
}

/// A proof and its twin call one body that asserts something, the same, on the same scalar.
fn unrelated(f: &Function, functions: &[Function], known: &[Function]) -> Option<String> {
    let claim = f.name.strip_prefix("proof_")?;
    let twin = functions.iter().find(|t| t.name == format!("twin_{claim}"))?;
    // each with the scalar that it is called on: body::<f32>
    let bodies = |f: &Function| -> BTreeSet<String> {
        let lines = code(f);
        let calls =
            lines.iter().flat_map(|line| line.split([' ', '(', ')', ';', '{', '}', '&'])).filter(|w| *w != f.name);
        let name = |call: &str| call.split("::<").next().unwrap_or(call).rsplit("::").next().map(str::to_owned);
        let asserting = calls.filter(|call| {
            let g = name(call).and_then(|name| known.iter().find(|g| g.name == name));
            g.is_some_and(|g| source::reached(g, known).iter().any(|h| claims(h)))
        });
        asserting.map(str::to_owned).collect()
    };
    let (of_proof, of_twin) = (bodies(f), bodies(twin));
    if of_proof != of_twin {
        Some(at(f, "has a twin that is not about the same body"))
    } else if of_proof.len() > 1 {
        Some(at(f, "claims more than one body, of which the twin plants an error in any"))
    } else {
        None
    }
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

/// An assertion in a block comes with a cover in the same block; in a loop over what is written out it always comes.
fn unseen(f: &Function) -> Option<String> {
    let lines = code(f);
    for (n, line) in lines.iter().enumerate().skip(1) {
        let text = line.trim();
        if asserts(text) && !["assert!(", "assert_eq!(", "assert_ne!("].iter().any(|call| text.starts_with(call)) {
            return Some(at(
                f,
                &format!("asserts in the middle of a line, where no cover shows that it comes: {text}"),
            ));
        }
        let written_out = text.starts_with("for ") && text.contains(" in [") && !text.contains(" in []");
        if !text.ends_with('{') || written_out {
            continue;
        }
        let end = (n + 1..lines.len())
            .find(|&k| indentation(lines[k]) == indentation(line) && lines[k].trim().starts_with('}'));
        let block = &lines[n + 1..end.unwrap_or(lines.len())];
        if block.iter().any(|l| asserts(l)) && !block.iter().any(|l| l.contains("cover!(")) {
            return Some(at(f, &format!("asserts where no cover shows that it comes: {text}")));
        }
    }
    None
}

/// What returns before its claims assumes that it does not, and says so as an assumption does.
fn early(f: &Function) -> Option<String> {
    let leaves = |line: &str| {
        let mut words = line.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        words.any(|word| ["return", "continue", "break"].contains(&word)) || line.contains("?;") || line.contains("?.")
    };
    let found = code(f).into_iter().skip(1).find(|line| leaves(line)).filter(|_| claims(f));
    found.map(|line| at(f, &format!("may return before its claims: {}", line.trim())))
}

/// An assertion of debug builds is not in the release build that is proved.
fn not_compiled(f: &Function) -> Option<String> {
    let debug = code(f).into_iter().any(|line| calls(line, "debug_assert"));
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
        kani::cover!(true, "more than half, in its block");
        assert!(y <= claimed);
    }
    for share in [x, y] {
        assert!(share >= 0.0);
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
        let refused = |block: &str| {
            let found = changed("    if y < 0.1 {\n", &format!("{block}    if y < 0.1 {{\n"));
            assert!(found.contains("no cover shows that it comes"), "{block}{found}");
        };
        refused("    if y > 2.0 {\n        assert!(y == 42.0);\n    }\n");
        refused("    if y > 2.0 {\n        // kani::cover!(true, \"only said\")\n        assert!(y == 42.0);\n    }\n");
        refused("    if y > 2.0 {\n        assert!(y == 42.0); // cover!(\n    }\n");
        // the name is another value by then
        refused("    let y = 0.0;\n    if y > 0.5 {\n        assert!(y == 42.0);\n    }\n");
        refused("    for _ in 0..0 {\n        assert!(y == 42.0);\n    }\n");
        refused("    for _ in [] {\n        assert!(y == 42.0);\n    }\n");
        refused("    while y > 2.0 {\n        assert!(y == 42.0);\n    }\n");
        refused("    let never = |y: f32| {\n        assert!(y == 42.0);\n    };\n");
        refused("    let never = |y: f32| assert!(y == 42.0);\n");
        refused("    None::<f32>.map(|y| assert!(y == 42.0));\n");
        refused("    match y > 2.0 {\n        true => assert!(y == 42.0),\n        false => {}\n    }\n");
        let other = changed(
            "    }\n    if y < 0.1 {\n",
            "    }\n    if y > 0.9 {\n        kani::cover!(true, \"nearly all\");\n    } else {\n        assert!(y == 42.0);\n    }\n    if y < 0.1 {\n",
        );
        assert!(other.contains("no cover shows that it comes: } else {"), "{other}");
    }

    #[test]
    fn a_return_before_the_claims_is_an_assumption_without_a_name() {
        for leaves in [
            "    if x != 1.0 {\n        return;\n    }\n",
            "    let Some(x) = Some(x).filter(|x| *x == 1.0) else { return };\n",
            "    let x = Some(x).filter(|x| *x == 1.0)?;\n",
        ] {
            let found = changed("    let y = x * x;\n", &format!("{leaves}    let y = x * x;\n"));
            assert!(found.contains("may return before its claims"), "{leaves}{found}");
        }
        let passed = changed(
            "    for share in [x, y] {\n",
            "    for share in [x, y] {\n        if share > 0.0 {\n            continue;\n        }\n",
        );
        assert!(passed.contains("may return before its claims: continue;"), "{passed}");
    }

    #[test]
    fn a_twin_of_another_claim_is_none() {
        let other = "\nfn other() {\n    assert!(kani::any::<u32>() != 7);\n}\n";
        let of = |twin: &str| found(&(SOUND.replacen("    square_is_small(0.6);", twin, 1) + other));
        let none = "proof_square_is_small has a twin that is not about the same body";
        assert!(of("    other();").contains(none));
        // true of the body, and an error planted beside it
        assert!(of("    square_is_small(1.0);\n    other();").contains(none));
        assert!(of("    square_is_small(1.0); // other()").is_empty());
        // another scalar, of which nothing is proved
        assert!(of("    square_is_small::<f64>(0.6);").contains(none));
        let both = found(&(SOUND.replace("    square_is_small(", "    other();\n    square_is_small(") + other));
        assert!(both.contains("claims more than one body"), "{both}");
        let inline = changed("    square_is_small(0.6);", "    assert!(kani::any::<u32>() != 7);");
        assert!(inline.contains("twin_square_is_small claims or assumes something itself"), "{inline}");
    }

    #[test]
    fn an_assertion_of_debug_builds_is_refused() {
        let debug = changed("    let y = x * x;\n", "    let y = x * x;\n    debug_assert!(x < 0.5, \"false\");\n");
        assert!(debug.contains("square_is_small has a debug_assert"), "{debug}");
    }
}
