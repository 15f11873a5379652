//! Who calls a function in the instrument: what nobody calls there does not fly, whatever is proved of it.
//!
//! It reads names, as `source` does: a function is called by another if its name stands in the other's body and the type
//! that it belongs to in the other's file (in the instrument and in the calibrator: in the crate). What is called on `self`, on one
//! of its fields or by its type's name is of that type alone: `self.precession.step_steadily(…)` is no call of `step`, and
//! `self.supervisor.step(…)` none of the tracker's.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::Path;

use crate::source::{self, Function};

/// What runs in firmware, and where the calls of those who use it begin.
const CRATES: [(&str, bool); 5] =
    [("model", false), ("estimator", false), ("controller", false), ("instrument", true), ("calibrator", true)];

/// What lies in these crates for a bench: no firmware calls it.
const BENCH: [&str; 1] = ["replay.rs"];

/// Function, file: who calls it, from the one that the firmware calls.
pub(crate) type Calls = BTreeMap<(String, String), Vec<String>>;

#[derive(Debug)]
struct Node {
    function: Function,
    /// the type or trait in whose block it stands
    owner: Option<String>,
    /// all that its calls may mean
    scope: usize,
    begins: bool,
}

/// What the public functions of the instrument and of the calibrator call, directly or not.
pub(crate) fn calls(repository: &Path) -> Result<Calls, String> {
    let (nodes, scopes) = firmware(repository)?;
    Ok(reached(&nodes, &scopes))
}

/// Every function of the crates for firmware, as `Type::name`.
pub(crate) fn known(repository: &Path) -> Result<BTreeSet<String>, String> {
    Ok(firmware(repository)?.0.iter().map(called).collect())
}

/// The functions of the crates for firmware, and the texts that say what their calls may mean.
fn firmware(repository: &Path) -> Result<(Vec<Node>, Vec<String>), String> {
    let (mut nodes, mut scopes) = (Vec::new(), Vec::<String>::new());
    for (name, begins) in CRATES {
        let folder = repository.join("crates").join(name).join("src");
        let first = scopes.len();
        for file in source::rust_files(&folder) {
            let relative = file.strip_prefix(&folder).unwrap_or(&file).display().to_string();
            if relative.contains("tests") || relative.starts_with("proofs") || BENCH.contains(&relative.as_str()) {
                continue;
            }
            let text = fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
            if begins && scopes.len() > first {
                scopes[first].push_str(&code(&text));
            } else {
                scopes.push(code(&text));
            }
            let place = file.strip_prefix(repository).unwrap_or(&file);
            nodes.extend(functions(place, &text, scopes.len() - 1, begins));
        }
    }
    Ok((nodes, scopes))
}

/// The text without its comments.
fn code(text: &str) -> String {
    text.lines().filter(|l| !l.trim_start().starts_with("//")).map(|l| format!("{l}\n")).collect()
}

fn functions(place: &Path, text: &str, scope: usize, begins: bool) -> Vec<Node> {
    let lines: Vec<&str> = text.lines().collect();
    let public = |f: &Function| lines.get(f.line - 1).is_some_and(|l| l.trim_start().starts_with("pub fn "));
    let all = source::functions(place, text).into_iter();
    all.map(|function| Node {
        owner: owner(&lines, function.line),
        scope,
        begins: begins && public(&function),
        function: Function { body: code(&function.body), ..function },
    })
    .collect()
}

/// The type of the `impl`, or the `trait`, in which line `line` (from 1) stands.
fn owner(lines: &[&str], line: usize) -> Option<String> {
    let inner = lines.get(line - 1)?.starts_with(' ');
    let opens = |l: &&&str| !l.starts_with([' ', '/', '#', '}']) && l.ends_with('{');
    let head = lines.iter().take(line - 1).rev().find(opens).filter(|_| inner)?;
    let head = head.strip_prefix("pub ").unwrap_or(head);
    let named = if let Some(rest) = head.strip_prefix("trait ") {
        rest
    } else {
        let rest = head.strip_prefix("impl")?;
        let rest = rest.rsplit_once(" for ").map_or(rest, |(_, after)| after);
        // what follows the parameters
        let rest = if rest.starts_with('<') { rest.split_once("> ").map_or(rest, |(_, after)| after) } else { rest };
        rest.trim_start()
    };
    words(named).next().map(str::to_owned)
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).filter(|w| !w.is_empty())
}

/// What stands before the name of a function where it is called.
#[derive(Debug, PartialEq)]
enum Receiver {
    /// one of these types
    Of(BTreeSet<String>),
    /// anything
    Unknown,
}

/// Types, and what a name in a text may be of.
struct Types {
    /// struct, field: the words of its type
    fields: BTreeMap<(String, String), BTreeSet<String>>,
    owners: BTreeSet<String>,
    traits: BTreeSet<String>,
}

impl Types {
    fn of(nodes: &[Node], scopes: &[String]) -> Self {
        let owners = nodes.iter().filter_map(|n| n.owner.clone()).collect();
        let (mut fields, mut traits) = (BTreeMap::new(), BTreeSet::new());
        for text in scopes {
            let mut open: Option<String> = None;
            for line in text.lines() {
                let line = line.trim_end();
                let named =
                    |word: &str| line.split_once(word).and_then(|(_, rest)| words(rest).next()).map(str::to_owned);
                if !line.starts_with(' ') {
                    open = if line.contains("struct ") && line.ends_with('{') { named("struct ") } else { None };
                    traits.extend(if line.contains("trait ") { named("trait ") } else { None });
                } else if let (Some(owner), Some((name, kind))) = (&open, line.split_once(": ")) {
                    let field = words(name).last().unwrap_or_default().to_owned();
                    fields.insert((owner.clone(), field), words(kind).map(str::to_owned).collect());
                }
            }
        }
        Self { fields, owners, traits }
    }

    /// The words of `body` that `caller` says, each with what it is said of.
    fn said(&self, caller: &Node, body: &str) -> Vec<(String, Receiver)> {
        // a chain of calls may be broken over lines
        let flat: String = body.split('.').map(str::trim_end).collect::<Vec<_>>().join(".");
        let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let mut found = Vec::new();
        let mut rest = flat.as_str();
        let mut at = 0;
        while let Some(begin) = rest.find(word) {
            let length = rest[begin..].find(|c| !word(c)).unwrap_or(rest.len() - begin);
            let name = &rest[begin..begin + length];
            found.push((name.to_owned(), self.receiver(caller, &flat[..at + begin])));
            at += begin + length;
            rest = &flat[at..];
        }
        found
    }

    fn receiver(&self, caller: &Node, before: &str) -> Receiver {
        let own = |owner: &Option<String>| match owner {
            Some(owner) => Receiver::Of(self.traits.iter().cloned().chain([owner.clone()]).collect()),
            None => Receiver::Unknown,
        };
        if let Some(path) = before.strip_suffix("::") {
            return match words(path).last() {
                Some("Self") => own(&caller.owner),
                Some(name) if self.owners.contains(name) => Receiver::Of([name.to_owned()].into()),
                _ => Receiver::Unknown,
            };
        }
        let Some(chain) = before.strip_suffix('.') else { return Receiver::Unknown };
        let begin = chain.rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.')).map_or(0, |k| k + 1);
        match chain[begin..].split('.').collect::<Vec<_>>()[..] {
            ["self"] => own(&caller.owner),
            ["self", field] => {
                let key = (caller.owner.clone().unwrap_or_default(), field.to_owned());
                let kinds = self.fields.get(&key).into_iter().flatten().filter(|k| self.owners.contains(*k));
                let kinds: BTreeSet<String> = kinds.cloned().collect();
                if kinds.is_empty() { Receiver::Unknown } else { Receiver::Of(kinds) }
            }
            _ => Receiver::Unknown,
        }
    }
}

fn reached(nodes: &[Node], scopes: &[String]) -> Calls {
    let types = Types::of(nodes, scopes);
    let mut found = Calls::new();
    let mut chains: Vec<Option<Vec<String>>> = vec![None; nodes.len()];
    let mut waiting: VecDeque<usize> = (0..nodes.len()).filter(|k| nodes[*k].begins).collect();
    for k in &waiting {
        chains[*k] = Some(vec![called(&nodes[*k])]);
    }
    let known: Vec<BTreeSet<&str>> = scopes.iter().map(|s| words(s).collect()).collect();
    while let Some(k) = waiting.pop_front() {
        let chain = chains[k].clone().unwrap_or_default();
        let caller = &nodes[k];
        // beyond its first line, which has its own name
        let body = caller.function.body.split_once('{').map_or("", |(_, body)| body);
        let said = types.said(caller, body);
        for (j, node) in nodes.iter().enumerate() {
            let of_its_type = node.owner.as_ref().is_none_or(|o| {
                caller.owner.as_ref() == Some(o) && caller.scope == node.scope
                    || known[caller.scope].contains(o.as_str())
            });
            let named = || {
                let of_it = |receiver: &Receiver| match receiver {
                    Receiver::Of(kinds) => node.owner.as_ref().is_some_and(|o| kinds.contains(o)),
                    Receiver::Unknown => true,
                };
                said.iter().any(|(word, receiver)| *word == node.function.name && of_it(receiver))
            };
            if chains[j].is_none() && of_its_type && named() {
                let mut longer = chain.clone();
                longer.push(called(node));
                chains[j] = Some(longer);
                waiting.push_back(j);
            }
        }
    }
    for (node, chain) in nodes.iter().zip(chains) {
        if let Some(chain) = chain {
            let key = (called(node), node.function.file.display().to_string());
            found.entry(key).or_insert(chain);
        }
    }
    found
}

fn called(node: &Node) -> String {
    qualified(node.owner.as_deref(), &node.function.name)
}

/// As people write it.
fn qualified(owner: Option<&str>, name: &str) -> String {
    owner.map_or(name.to_owned(), |o| format!("{o}::{name}"))
}

/// The function that `text` has, with its type.
pub(crate) fn in_full(text: &str, function: &Function) -> String {
    let lines: Vec<&str> = text.lines().collect();
    qualified(owner(&lines, function.line).as_deref(), &function.name)
}

#[cfg(test)]
mod tests {
    use super::{calls, code, functions, owner, reached};
    use std::path::Path;

    #[test]
    fn a_method_belongs_to_the_type_of_its_block() {
        let text = "impl<T: Float> Fast<T> {\n    pub fn step(&self) {\n    }\n}\n\nimpl core::fmt::Display for Odd {\n    \
            fn fmt(&self) {\n    }\n}\n\npub trait Rare: Real {\n    fn rate(&self) {\n    }\n}\n\nfn free() {\n}\n";
        let lines: Vec<&str> = text.lines().collect();
        let of = |line| owner(&lines, line);
        assert_eq!((of(2).as_deref(), of(7).as_deref()), (Some("Fast"), Some("Odd")));
        assert_eq!((of(12).as_deref(), of(16)), (Some("Rare"), None));
    }

    #[test]
    fn what_is_called_is_reached_and_what_has_the_name_of_it_alone_is_not() {
        let text = "impl<T> Whole<T> {\n    pub fn step(&self) {\n        self.part.step_part();\n        // lost();\n    }\n}\n\n\
            impl<T> Part<T> {\n    fn step_part(&self) {\n        inner();\n    }\n}\n\nfn inner() {\n}\n\nfn lost() {\n}\n";
        let other = "impl<T> Other<T> {\n    fn step_part(&self) {\n    }\n}\n";
        let mut nodes = functions(Path::new("a.rs"), text, 0, true);
        nodes.extend(functions(Path::new("b.rs"), other, 1, false));
        let found = reached(&nodes, &[code(text), code(other)]);
        let chain = |name: &str, file: &str| found.get(&(name.to_owned(), file.to_owned())).cloned();
        assert_eq!(chain("inner", "a.rs"), Some(vec!["Whole::step".into(), "Part::step_part".into(), "inner".into()]));
        assert_eq!(chain("lost", "a.rs"), None);
        assert_eq!(chain("Other::step_part", "b.rs"), None);
    }

    #[test]
    fn what_is_called_on_a_field_is_of_its_type_and_of_no_other() {
        let text = "pub struct Whole<T> {\n    part: Part<T>,\n    pub(crate) other: Option<Other<T>>,\n    sum: T,\n}\n\n\
            impl<T> Whole<T> {\n    pub fn run(&self) {\n        self.part\n            .step();\n        self.helper();\n        \
            Third::make();\n    }\n\n    fn helper(&self) {\n    }\n}\n\n\
            impl<T> Part<T> {\n    fn step(&self) {\n    }\n\n    fn make(&self) {\n    }\n}\n\n\
            impl<T> Other<T> {\n    fn step(&self) {\n    }\n\n    fn helper(&self) {\n    }\n}\n\n\
            impl<T> Third<T> {\n    fn make() {\n    }\n}\n";
        let nodes = functions(Path::new("a.rs"), text, 0, true);
        let found = reached(&nodes, &[code(text)]);
        let names: Vec<&str> = found.keys().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["Part::step", "Third::make", "Whole::helper", "Whole::run"]);
    }

    #[test]
    fn every_requirement_is_on_what_flies_or_says_why_not() {
        let repository = crate::repository();
        let named = super::super::claims::read(&repository).expect("readable");
        let record = super::super::record::Record::assemble(&named, &super::super::record::Results::default());
        let found = super::super::gate::faults(&record, &named, &super::super::record::Results::default());
        let flight: Vec<_> =
            found.iter().filter(|f| f.contains("in the instrument") || f.contains("is called, or does")).collect();
        assert!(flight.is_empty(), "{flight:#?}");
    }

    /// The repository as it is, but for one citation more, on a function that nobody calls there.
    #[test]
    fn a_requirement_that_is_put_on_what_nobody_calls_is_a_fault() {
        use super::super::{claims, gate, record};
        let repository = crate::repository();
        let calls = calls(&repository).expect("readable");
        let found = |name: &str, place: &str| {
            let mut named = claims::read(&repository).expect("readable");
            let (name, place) = (name.to_owned(), place.to_owned());
            let called = calls.get(&(name.clone(), place.clone())).cloned();
            let functions = named.functions.get_mut("specs/dsp.md#short-way").expect("cited");
            functions.push(claims::Meets { name, place, called });
            let results = record::Results::default();
            let record = record::Record::assemble(&named, &results);
            let all = gate::faults(&record, &named, &results);
            all.into_iter().filter(|f| f.contains("in the instrument")).collect::<Vec<_>>().join("\n")
        };
        let uncalled = found("major_axis", "crates/estimator/src/direction.rs");
        assert!(uncalled.contains("short-way: nobody calls major_axis"), "{uncalled}");
        assert_eq!(found("major_axis_of", "crates/estimator/src/direction.rs"), "");
    }

    #[test]
    fn the_instrument_tracks_its_pattern_by_precession_and_not_by_the_angle() {
        let found = calls(&crate::repository()).expect("readable");
        let flies = |name: &str, file: &str| found.contains_key(&(name.to_owned(), format!("crates/{file}")));
        assert!(flies("major_axis_of", "estimator/src/direction.rs"));
        assert!(flies("Precession::step", "estimator/src/precession.rs"));
        // the instrument takes, admits and adds its samples itself
        assert!(!flies("Demodulator::accumulate", "estimator/src/demodulator.rs"));
        assert!(flies("DetectionCubic::unread", "model/src/effects/detection_cubic.rs"));
        assert!(
            !flies("PatternAngle::step", "estimator/src/angle.rs")
                && !flies("major_axis", "estimator/src/direction.rs")
        );
        assert!(!flies("measured_angle", "model/src/detection.rs"));
        // what a recording is walked through on a bench does not fly either
        assert!(
            flies("known_rates", "calibrator/src/regressors.rs")
                && flies("Correction::readout", "calibrator/src/correction.rs")
        );
        assert!(
            !flies("exact_rates", "calibrator/src/regressors.rs") && !flies("Replay::row", "calibrator/src/replay.rs")
        );
    }
}
