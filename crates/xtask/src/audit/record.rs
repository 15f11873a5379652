//! What was claimed set beside what came of it.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use serde_json::{Value, json};

use super::claims::{Chapter, Meets, Named, Names, Requirement, Test};

/// Status by file and by the name that the runner gives a test.
pub(crate) type Tests = BTreeMap<String, BTreeMap<String, Status>>;

/// What a runner said of a test or a proof.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Status {
    Passed,
    Failed,
    NotRun,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::NotRun => "not-run",
        })
    }
}

/// What evidence is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    Property,
    Snapshot,
    Identity,
    Interval,
    Bitprecise,
}

impl Kind {
    pub(crate) const ALL: [Self; 5] =
        [Self::Property, Self::Snapshot, Self::Identity, Self::Interval, Self::Bitprecise];

    /// The kind that the name of a test tells. What has no prefix tries chosen cases.
    fn of(test: &str) -> Self {
        match test.split('_').next() {
            Some("snapshot") => Self::Snapshot,
            Some("identity") => Self::Identity,
            Some("interval") => Self::Interval,
            _ => Self::Property,
        }
    }

    pub(crate) fn is_proof(self) -> bool {
        matches!(self, Self::Identity | Self::Interval | Self::Bitprecise)
    }

    fn engine(self) -> &'static str {
        match self {
            Self::Property => "random or chosen cases",
            Self::Snapshot => "a table kept (insta)",
            Self::Identity => "exact polynomials (crates/prover)",
            Self::Interval => "intervals with rounding (crates/prover)",
            Self::Bitprecise => "",
        }
    }
}

/// What came of a proof's twin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Twin {
    Rejected,
    Accepted,
    None,
}

/// A bit-precise proof as `prove` reports it.
#[derive(Clone, Debug)]
pub(crate) struct Proof {
    pub(crate) name: String,
    pub(crate) claim: String,
    pub(crate) functions: Vec<String>,
    pub(crate) engine: String,
    pub(crate) assumptions: Vec<String>,
    pub(crate) status: Status,
    pub(crate) twin_rejected: bool,
    pub(crate) details: String,
}

/// What the runners said.
#[derive(Clone, Debug, Default)]
pub(crate) struct Results {
    pub(crate) tests: Tests,
    pub(crate) proofs: Vec<Proof>,
    /// why something did not run
    pub(crate) notes: Vec<String>,
}

impl Results {
    /// What the runner said of `test`, name by name. A test of which it said nothing was not run.
    pub(crate) fn of(&self, test: &Test) -> Vec<(String, Status)> {
        let outcomes = self.tests.get(&test.file);
        let look = |name: &String| outcomes.and_then(|o| o.get(name)).copied().unwrap_or(Status::NotRun);
        match &test.names {
            Names::Exactly(names) => names.iter().map(|name| (name.clone(), look(name))).collect(),
            Names::Ending(last) => {
                let ending = format!("::{last}");
                let found = outcomes.into_iter().flatten().filter(|(name, _)| name.ends_with(&ending));
                let found: Vec<_> = found.map(|(name, status)| (name.clone(), *status)).collect();
                if found.is_empty() { vec![(last.clone(), Status::NotRun)] } else { found }
            }
        }
    }

    /// What came of the twin of the proof that `file` calls `name`.
    fn twin(&self, file: &str, name: &str) -> Twin {
        match self.tests.get(file).and_then(|o| o.get(&format!("{name}_twin"))) {
            Some(Status::Passed) => Twin::Rejected,
            Some(Status::Failed) => Twin::Accepted,
            Some(Status::NotRun) | None => Twin::None,
        }
    }
}

/// One piece of evidence for a requirement.
#[derive(Clone, Debug)]
pub(crate) struct Evidence {
    pub(crate) kind: Kind,
    /// `equation_05_proofs::in_f32::interval_…`, `proof_…`
    pub(crate) name: String,
    pub(crate) status: Status,
    pub(crate) twin: Twin,
    pub(crate) engine: String,
    pub(crate) claim: String,
    pub(crate) assumptions: Vec<String>,
    pub(crate) details: String,
}

/// A requirement with its evidence.
#[derive(Clone, Debug)]
pub(crate) struct Judged {
    pub(crate) requirement: Requirement,
    pub(crate) functions: Vec<Meets>,
    pub(crate) evidence: Vec<Evidence>,
}

/// Everything, chapter by chapter.
#[derive(Clone, Debug, Default)]
pub(crate) struct Record {
    pub(crate) chapters: Vec<(Chapter, Vec<Judged>)>,
}

impl Record {
    pub(crate) fn assemble(named: &Named, results: &Results) -> Self {
        let judged = |requirement: &Requirement| {
            let id = &requirement.id;
            let cites = |t: &&Test| t.function.citations.iter().any(|c| c.target == *id);
            let mut evidence: Vec<_> =
                named.tests.iter().filter(cites).flat_map(|test| of_test(test, results)).collect();
            for harness in named.harnesses.iter().filter(|h| h.requirements.contains(id)) {
                evidence.push(of_harness(&harness.name, results));
            }
            evidence.sort_by(|a, b| (a.kind, &a.name).cmp(&(b.kind, &b.name)));
            let functions = named.functions.get(id).cloned().unwrap_or_default();
            Judged { requirement: requirement.clone(), functions, evidence }
        };
        let chapter = |c: &Chapter| (c.clone(), c.requirements.iter().map(judged).collect());
        Self { chapters: named.chapters.iter().map(chapter).collect() }
    }

    /// All evidence.
    pub(crate) fn evidence(&self) -> impl Iterator<Item = (&Judged, &Evidence)> {
        self.chapters.iter().flat_map(|(_, all)| all).flat_map(|j| j.evidence.iter().map(move |e| (j, e)))
    }

    /// `audit.json`: the equations.
    pub(crate) fn json(&self) -> Value {
        let evidence = |e: &Evidence| json!({"kind": e.kind, "name": e.name, "status": e.status, "twin": e.twin});
        let function = |f: &Meets| json!({"name": f.name, "file": f.place, "called": f.called});
        let requirement = |j: &Judged| {
            let all: Vec<_> = j.evidence.iter().map(evidence).collect();
            let functions: Vec<_> = j.functions.iter().map(function).collect();
            json!({"id": j.requirement.id, "text": j.requirement.text, "functions": functions, "evidence": all})
        };
        let equations: Vec<_> = self
            .chapters
            .iter()
            .filter_map(|(c, all)| Some((c.number?, all)))
            .map(|(n, all)| json!({"n": n, "requirements": all.iter().map(requirement).collect::<Vec<_>>()}))
            .collect();
        json!({ "equations": equations })
    }

    pub(crate) fn summary(&self) -> String {
        let count = |kind| self.evidence().filter(|(_, e)| e.kind == kind).count();
        let requirements = self.chapters.iter().map(|(_, all)| all.len()).sum::<usize>();
        let kinds: Vec<_> = Kind::ALL.iter().map(|k| format!("{} {k:?}", count(*k)).to_lowercase()).collect();
        let passed = self.evidence().filter(|(_, e)| e.status == Status::Passed).count();
        let (proofs, rejected) = self
            .evidence()
            .filter(|(_, e)| e.kind.is_proof())
            .fold((0, 0), |(n, r), (_, e)| (n + 1, r + usize::from(e.twin == Twin::Rejected)));
        format!(
            "{requirements} requirements; evidence: {}; {passed} passed of {}; {rejected} of {proofs} twins rejected",
            kinds.join(", "),
            self.evidence().count()
        )
    }
}

fn of_test(test: &Test, results: &Results) -> Vec<Evidence> {
    let kind = Kind::of(&test.function.name);
    let evidence = |(name, status): (String, Status)| Evidence {
        kind,
        status,
        twin: if kind.is_proof() { results.twin(&test.file, &name) } else { Twin::None },
        engine: kind.engine().to_owned(),
        claim: test.function.doc.clone(),
        assumptions: test.assumptions.clone(),
        details: String::new(),
        name: format!("{}::{name}", test.file),
    };
    results.of(test).into_iter().map(evidence).collect()
}

fn of_harness(name: &str, results: &Results) -> Evidence {
    let proof = results.proofs.iter().find(|p| p.name == name);
    let mut claim = proof.map(|p| p.claim.clone()).unwrap_or_default();
    if let Some(functions) = proof.map(|p| p.functions.join(", ")).filter(|f| !f.is_empty()) {
        claim += &format!(" (of {functions})");
    }
    Evidence {
        kind: Kind::Bitprecise,
        name: name.to_owned(),
        status: proof.map_or(Status::NotRun, |p| p.status),
        twin: proof.map_or(Twin::None, |p| if p.twin_rejected { Twin::Rejected } else { Twin::Accepted }),
        engine: proof.map(|p| p.engine.clone()).unwrap_or_default(),
        claim,
        assumptions: proof.map(|p| p.assumptions.clone()).unwrap_or_default(),
        details: proof.map(|p| p.details.clone()).unwrap_or_default(),
    }
}
