//! `cargo xtask audit`: every equation, every requirement, and what this run says of it.
//!
//! What there should be is read from the sources: requirements from `specs/`, and which test and which harness cites them.
//! What came of it is read from the runners alone: the lines that the test binaries print, and the results that `prove`
//! left. Nothing passes by being named.

mod claims;
mod coverage;
mod flight;
mod gate;
mod page;
mod record;
mod runners;

use std::fs;

use record::{Record, Results};

/// How an audit is asked for.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Request<'a> {
    /// take the results that `cargo xtask prove` left, if they are younger than the sources
    pub(crate) keep_proofs: bool,
    /// run only the test files whose name contains this; the rest is named and not run, and the audit fails
    pub(crate) only: Option<&'a str>,
    /// where the audit is written, `target/audit` where nothing is said
    pub(crate) folder: Option<&'a str>,
}

/// Runs everything that is named and writes `audit.json` and `audit.html`.
pub(crate) fn run(request: Request<'_>) -> crate::Outcome {
    let repository = crate::repository();
    let named = claims::read(&repository)?;
    let (proofs, left_out) = runners::proofs(&repository, request.keep_proofs)?;
    let tests = runners::tests(&repository, &named.files, request.only)?;
    let notes = [left_out, coverage::faults(&repository)?].concat();
    let results = Results { tests, proofs, notes };
    let record = Record::assemble(&named, &results);
    let faults = gate::faults(&record, &named, &results);

    let folder = repository.join(request.folder.unwrap_or("target/audit"));
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let json = serde_json::to_string_pretty(&record.json()).map_err(|e| e.to_string())?;
    for (name, text) in [("audit.json", json), ("audit.html", page::render(&record, &results, &faults))] {
        let file = folder.join(name);
        fs::write(&file, text).map_err(|e| format!("{}: {e}", file.display()))?;
        println!("{}", file.display());
    }
    for fault in &faults {
        println!("fault: {fault}");
    }
    println!("{}", record.summary());
    println!("{} faults", faults.len());
    Ok(faults.is_empty())
}
