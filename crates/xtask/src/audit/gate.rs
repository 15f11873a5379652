//! What makes an audit fail.

use std::collections::BTreeSet;

use super::claims::{Chapter, Named};
use super::record::{Judged, Kind, Record, Results, Status, Twin};
use super::runners::ENGINES;

/// The equations that need every kind of proof: the paper's own.
const FULLY_PROVED: core::ops::RangeInclusive<u8> = 5..=11;
const EQUATIONS: core::ops::RangeInclusive<u8> = 1..=11;

/// Everything that is not as it is claimed to be, in words; empty where all of it is.
pub(crate) fn faults(record: &Record, named: &Named, results: &Results) -> Vec<String> {
    let mut found = results.notes.clone();
    for (judged, e) in record.evidence() {
        let id = &judged.requirement.id;
        if e.status != Status::Passed {
            found.push(format!("{id}: {}: {}", e.name, e.status));
        }
        if e.kind.is_proof() && e.twin != Twin::Rejected {
            found.push(format!("{id}: {}: its twin is {:?}", e.name, e.twin).to_lowercase());
        }
    }
    // what cites no requirement has to run all the same
    for test in named.tests.iter().filter(|t| t.function.citations.is_empty()) {
        for (name, status) in results.of(test) {
            if status != Status::Passed {
                found.push(format!("{}::{name}: {status}", test.file));
            }
        }
    }
    for name in ENGINES {
        let outcomes = results.tests.get(name);
        if outcomes.is_none_or(|o| o.is_empty() || o.values().any(|s| *s != Status::Passed)) {
            found.push(format!("the engine's own tests, {name}, did not all pass"));
        }
    }
    for harness in &named.harnesses {
        if !results.proofs.iter().any(|p| p.name == harness.name) {
            found.push(format!("{}: not-run", harness.name));
        }
    }
    for proof in &results.proofs {
        if proof.status != Status::Passed || !proof.twin_rejected {
            let twin = if proof.twin_rejected { "rejected" } else { "accepted" };
            found.push(format!("{}: {}, its twin {twin} {}", proof.name, proof.status, proof.details));
        }
    }
    found.extend(citations(named));
    found.extend(proved_of_what_nobody_calls(named));
    for (chapter, all) in &record.chapters {
        for judged in all {
            found.extend(requirement(judged));
        }
        found.extend(flown(chapter, all));
        found.extend(equation(chapter, all));
    }
    for n in EQUATIONS {
        if !record.chapters.iter().any(|(c, _)| c.number == Some(n)) {
            found.push(format!("Equation {n} has no requirements"));
        }
    }
    found.dedup();
    found
}

/// Citations of what is not there.
fn citations(named: &Named) -> Vec<String> {
    let known: Vec<&str> = named.chapters.iter().flat_map(|c| &c.requirements).map(|r| r.id.as_str()).collect();
    let of_tests = named.tests.iter().flat_map(|t| t.function.citations.iter().map(|c| c.target.as_str()));
    let of_harnesses = named.harnesses.iter().flat_map(|h| h.requirements.iter().map(String::as_str));
    let lost = of_tests.chain(of_harnesses).filter(|target| !known.contains(target));
    lost.map(|target| format!("{target} is cited and does not exist")).collect()
}

/// Harnesses that show a requirement of the instrument on a function that nobody calls there.
fn proved_of_what_nobody_calls(named: &Named) -> Vec<String> {
    let all: Vec<_> = named.chapters.iter().flat_map(|c| &c.requirements).collect();
    let excused = |id: &String, name: &String| {
        let of_it = all.iter().find(|r| r.id == *id).and_then(|r| r.not_flown.as_ref());
        of_it.is_some_and(|why| why.contains(&format!("`{name}`")))
    };
    let mut found = Vec::new();
    for h in &named.harnesses {
        for name in &h.uncalled {
            let whole = h.requirements.iter().filter(|id| !excused(id, name));
            found.extend(
                whole.map(|id| format!("{id}: {} is about {name}, which nobody calls in the instrument", h.name)),
            );
        }
    }
    found
}

fn requirement(judged: &Judged) -> Vec<String> {
    let id = &judged.requirement.id;
    let mut found = Vec::new();
    if judged.evidence.is_empty() {
        found.push(format!("{id}: no evidence"));
    }
    if judged.functions.is_empty() {
        found.push(format!("{id}: no function has to meet it"));
    }
    let excused = judged.requirement.not_flown.as_deref().unwrap_or_default();
    for f in judged.functions.iter().filter(|f| f.called.is_none()) {
        if !excused.contains(&format!("`{}`", f.name)) {
            found.push(format!("{id}: nobody calls {} ({}) in the instrument, and no word on why", f.name, f.place));
        }
    }
    if !judged.evidence.iter().any(|e| e.kind.is_proof()) && judged.requirement.not_proved.is_none() {
        found.push(format!("{id}: not proved, and no word on why"));
    }
    found
}

/// Functions that a chapter says are not called in the instrument, and are, or are not there.
fn flown(chapter: &Chapter, all: &[Judged]) -> Vec<String> {
    let reasons: BTreeSet<&str> = all.iter().filter_map(|j| j.requirement.not_flown.as_deref()).collect();
    let names = reasons.iter().flat_map(|r| r.split('`').skip(1).step_by(2));
    let flies = |name: &str| {
        let mut of_it = all.iter().flat_map(|j| &j.functions).filter(|f| f.name == name).peekable();
        of_it.peek().is_none() || of_it.any(|f| f.called.is_some())
    };
    names.filter(|n| flies(n)).map(|n| format!("{}: {n} is called, or does not exist", chapter.title)).collect()
}

/// What an equation has to have.
fn equation(chapter: &Chapter, all: &[Judged]) -> Vec<String> {
    let Some(n) = chapter.number else { return Vec::new() };
    let has = |kind, part: &str| all.iter().flat_map(|j| &j.evidence).any(|e| e.kind == kind && e.name.contains(part));
    let mut missing = Vec::new();
    let mut need = |there: bool, what: &str| {
        if !there {
            missing.push(format!("Equation {n} has no {what}"));
        }
    };
    need(has(Kind::Property, ""), "property");
    need(has(Kind::Snapshot, ""), "snapshot");
    need(Kind::ALL.iter().any(|k| k.is_proof() && has(*k, "")), "proof");
    if FULLY_PROVED.contains(&n) {
        need(has(Kind::Identity, ""), "identity for all reals");
        need(has(Kind::Interval, "in_f32::"), "interval bound in f32");
        need(has(Kind::Interval, "in_f64::"), "interval bound in f64");
        let bits = has(Kind::Bitprecise, "");
        need(bits || chapter.without_bits.is_some(), "bit-precise proof, and no word on why");
        need(!bits || chapter.without_bits.is_none(), "reason any more to say that it has no bit-precise proof");
    }
    missing
}

#[cfg(test)]
mod tests {
    use super::super::claims::{Chapter, Harness, Meets, Named, Names, Requirement, Test};
    use super::super::record::{Proof, Record, Results, Status};
    use super::super::runners::ENGINES;
    use super::{EQUATIONS, faults};
    use crate::source::{Citation, Function};

    const ENDS: [&str; 4] = ["prop_a", "snapshot_b", "identity_c", "identity_c_twin"];

    fn test(n: u8, name: &str, both: bool) -> Test {
        let target = format!("specs/equation-{n:02}.md#a");
        let cited = !name.ends_with("_twin");
        let citations = if cited { vec![Citation { target, quote: String::new() }] } else { Vec::new() };
        let names =
            if both { ["in_f64", "in_f32"].map(|p| format!("{p}::{name}")).to_vec() } else { vec![name.to_owned()] };
        Test {
            file: format!("equation_{n:02}"),
            names: Names::Exactly(names),
            function: Function { name: name.to_owned(), citations, ..Function::default() },
            assumptions: Vec::new(),
        }
    }

    fn meets(name: &str, called: bool) -> Meets {
        let chain = called.then(|| vec!["Instrument::step".to_owned(), name.to_owned()]);
        Meets { name: name.into(), place: "a.rs".into(), called: chain }
    }

    /// Eleven equations with all that is asked of them, everything passed.
    fn sound() -> (Named, Results) {
        let (mut named, mut results) = (Named::default(), Results::default());
        for n in EQUATIONS {
            let id = format!("specs/equation-{n:02}.md#a");
            let requirement = Requirement {
                id: id.clone(),
                text: "It MUST be.".into(),
                domain: "all".into(),
                not_proved: None,
                not_flown: None,
            };
            named.chapters.push(Chapter {
                number: Some(n),
                title: format!("Equation {n}"),
                requirements: vec![requirement],
                without_bits: None,
            });
            let tests = ENDS.map(|name| test(n, name, false)).into_iter();
            named.tests.extend(tests.chain(["interval_d", "interval_d_twin"].map(|name| test(n, name, true))));
            let name = format!("proof_{n}");
            let requirements = vec![id.clone()];
            named.harnesses.push(Harness { name: name.clone(), requirements, uncalled: Vec::new() });
            named.functions.insert(id, vec![meets("f", true)]);
            results.proofs.push(Proof {
                name,
                claim: String::new(),
                functions: Vec::new(),
                engine: String::new(),
                assumptions: Vec::new(),
                status: Status::Passed,
                twin_rejected: true,
                details: String::new(),
            });
        }
        for t in &named.tests {
            let Names::Exactly(names) = &t.names else { continue };
            let outcomes = results.tests.entry(t.file.clone()).or_default();
            outcomes.extend(names.iter().map(|name| (name.clone(), Status::Passed)));
        }
        for engine in ENGINES {
            results.tests.insert(engine.into(), [("x".to_owned(), Status::Passed)].into());
        }
        (named, results)
    }

    fn found(named: &Named, results: &Results) -> Vec<String> {
        faults(&Record::assemble(named, results), named, results)
    }

    /// The faults after `plant` has spoilt what was sound.
    fn planted(plant: impl Fn(&mut Named, &mut Results)) -> String {
        let (mut named, mut results) = sound();
        plant(&mut named, &mut results);
        found(&named, &results).join("\n")
    }

    #[test]
    fn what_is_sound_has_no_faults_and_every_name_in_the_json() {
        let (named, results) = sound();
        assert_eq!(found(&named, &results), Vec::<String>::new());
        let json = Record::assemble(&named, &results).json();
        let requirement = &json["equations"][4]["requirements"][0];
        assert_eq!((&json["equations"][4]["n"], &requirement["id"]), (&5.into(), &"specs/equation-05.md#a".into()));
        let expected = serde_json::json!([
            {"kind": "property", "name": "equation_05::prop_a", "status": "passed", "twin": "none"},
            {"kind": "snapshot", "name": "equation_05::snapshot_b", "status": "passed", "twin": "none"},
            {"kind": "identity", "name": "equation_05::identity_c", "status": "passed", "twin": "rejected"},
            {"kind": "interval", "name": "equation_05::in_f32::interval_d", "status": "passed", "twin": "rejected"},
            {"kind": "interval", "name": "equation_05::in_f64::interval_d", "status": "passed", "twin": "rejected"},
            {"kind": "bitprecise", "name": "proof_5", "status": "passed", "twin": "rejected"},
        ]);
        assert_eq!(requirement["evidence"], expected);
    }

    #[test]
    fn what_is_named_and_not_run_fails_it() {
        let (named, results) = sound();
        for (file, outcomes) in &results.tests {
            for name in outcomes.keys() {
                let mut without = results.clone();
                without.tests.get_mut(file).expect("a file").remove(name);
                assert!(!found(&named, &without).is_empty(), "{file}::{name} was not run and nobody noticed");
            }
            let mut without = results.clone();
            without.tests.remove(file);
            assert!(!found(&named, &without).is_empty(), "{file} was not run and nobody noticed");
        }
        for proof in &results.proofs {
            let mut without = results.clone();
            without.proofs.retain(|p| p.name != proof.name);
            assert!(!found(&named, &without).is_empty(), "{} was not run and nobody noticed", proof.name);
        }
        let ignored =
            planted(|_, r| *r.tests.get_mut("equation_05").expect("5").get_mut("prop_a").expect("a") = Status::NotRun);
        assert!(ignored.contains("specs/equation-05.md#a: equation_05::prop_a: not-run"), "{ignored}");
    }

    #[test]
    fn what_fails_and_a_twin_that_is_accepted_fail_it() {
        let fail = |name: &'static str| {
            planted(|_, r| *r.tests.get_mut("equation_07").expect("7").get_mut(name).expect("a test") = Status::Failed)
        };
        assert!(fail("snapshot_b").contains("equation_07::snapshot_b: failed"));
        assert!(fail("identity_c_twin").contains("equation_07::identity_c: its twin is accepted"));
        assert!(fail("in_f32::interval_d_twin").contains("equation_07::in_f32::interval_d: its twin is accepted"));
        assert!(planted(|_, r| r.proofs[4].twin_rejected = false).contains("proof_5: its twin is accepted"));
        assert!(planted(|_, r| r.proofs[4].status = Status::Failed).contains("proof_5: failed"));
    }

    #[test]
    fn what_is_claimed_without_evidence_fails_it() {
        let without = |kind: &'static str| {
            planted(|n, _| n.tests.retain(|t| t.file != "equation_06" || !t.function.name.starts_with(kind)))
        };
        for (kind, what) in [("prop", "property"), ("snapshot", "snapshot"), ("identity", "identity")] {
            assert!(without(kind).contains(&format!("Equation 6 has no {what}")), "{kind}");
        }
        assert!(without("interval").contains("Equation 6 has no interval bound in f32"));
        let no_harness = |n: &mut Named| n.harnesses.retain(|h| h.name != "proof_6");
        assert!(planted(|n, _| no_harness(n)).contains("Equation 6 has no bit-precise proof"));
        let explained = planted(|n, _| {
            no_harness(n);
            n.chapters[5].without_bits = Some("a reason".into());
        });
        assert_eq!(explained, "");
        let outdated = planted(|n, _| n.chapters[5].without_bits = Some("a reason".into()));
        assert!(outdated.contains("Equation 6 has no reason any more"), "{outdated}");
        let unproved = |n: &mut Named, why: Option<&str>| {
            let id = "specs/equation-02.md#b";
            let (text, domain, not_proved) = ("It MUST be.".into(), "all".into(), why.map(str::to_owned));
            n.chapters[1].requirements.push(Requirement { id: id.into(), text, domain, not_proved, not_flown: None });
            n.functions.insert(id.into(), vec![meets("f", true)]);
            let a = n.tests.iter_mut().find(|t| t.file == "equation_02").expect("a test");
            a.function.citations.push(Citation { target: id.into(), quote: String::new() });
        };
        assert!(planted(|n, _| unproved(n, None)).contains("equation-02.md#b: not proved, and no word on why"));
        assert_eq!(planted(|n, _| unproved(n, Some("a reason"))), "");
        assert!(planted(|n, _| n.tests.retain(|t| t.file != "equation_01")).contains("Equation 1 has no property"));
        assert!(planted(|n, _| n.functions.clear()).contains("no function has to meet it"));
        assert!(planted(|n, _| n.harnesses[0].requirements.push("specs/x.md#y".into())).contains("does not exist"));
        assert!(planted(|n, _| drop(n.chapters.remove(10))).contains("Equation 11 has no requirements"));
    }
    #[test]
    fn what_nobody_calls_in_the_instrument_fails_it_unless_the_chapter_says_why() {
        let of = |called: bool, why: Option<&'static str>| {
            planted(|n, _| {
                let all = n.functions.get_mut("specs/equation-03.md#a").expect("3");
                all.push(meets("g", called));
                n.chapters[2].requirements[0].not_flown = why.map(str::to_owned);
            })
        };
        assert_eq!((of(true, None), of(false, Some("`g`: the device does it."))), (String::new(), String::new()));
        let uncalled = "equation-03.md#a: nobody calls g (a.rs) in the instrument, and no word on why";
        assert!(of(false, None).contains(uncalled) && of(false, Some("`h`: so.")).contains(uncalled));
        assert!(of(true, Some("`g`: so.")).contains("Equation 3: g is called, or does not exist"));
        assert!(of(true, Some("`h`: so.")).contains("Equation 3: h is called, or does not exist"));
    }
}
