//! `cvg fleet`: many campaigns in one call, a row for each, and what they say together: how each parameter is distributed,
//! which devices are odd, which effects many share.
//!
//! A device without an answer is a row with its reason and no end. Answers that are there and rest on the same bytes are
//! kept, so that a run that was broken off goes on where it was.

mod devices;
mod facts;
mod kept;
mod lake;
mod table;

use std::path::{Path, PathBuf};

use cvg_calibration::recording::write_parquet;
use serde_json::{Value, json};

use crate::limits::Limits;
use crate::population::{Device, Population, prior};
use crate::progress::Progress;
use crate::{Failure, output, report};

/// What is said of all devices together.
const SUMMARIES: [&str; 4] = ["fleet.csv", "fleet.json", "fleet.html", "fleet.parquet"];
/// What they say of each beforehand, where it is asked for.
const PRIOR: &str = "fleet-prior.csv";

/// What is asked for beside the answers.
pub(crate) struct Asked<'a> {
    pub(crate) limits: Option<&'a Limits>,
    /// fleet.json on standard output
    pub(crate) json: bool,
    /// what the fleet says of each device beforehand
    pub(crate) prior: bool,
}

/// Identifies every campaign into a folder of its own below `out`, and writes what they say together beside
/// them.
pub(crate) fn fleet(names: &[PathBuf], out: &Path, asked: &Asked<'_>) -> Result<(), Failure> {
    output::check_folder(out)?;
    let sources = devices::sources(names)?;
    let inputs: Vec<PathBuf> = sources.iter().map(|source| source.path().to_path_buf()).collect();
    if let Some(lake) = inputs.iter().find(|input| input.is_dir() && is_same(input, out)) {
        let what = "is the lake, of which fleet.parquet would be a part; wanted another folder for the results";
        return Err(Failure::input(format!("{}: {what}", lake.display())));
    }
    let [table, facts, page, results] = SUMMARIES;
    output::check_folder_for(out, &[table, facts, page, results, PRIOR], &inputs)?;
    let progress = Progress::begin();
    let count = sources.iter().map(devices::Source::count).sum::<usize>();
    progress.say(&format!("identifying {}", output::counted(count, "device")));
    let rows = devices::answered(sources, out, asked.limits)?;
    drop(progress);
    let told = summarised(&rows, out, &inputs, asked.prior)?;
    output::answer(if asked.json { &told.json } else { &told.words })?;
    let outside = rows.iter().filter(|r| r.outside.is_some()).count();
    if !rows.iter().any(Device::has_answer) {
        return Err(Failure::no_answer("no device of the fleet has an answer"));
    }
    if outside > 0 {
        let are = if outside == 1 { "is outside its" } else { "are outside their" };
        let of = output::counted(rows.len(), "device");
        return Err(Failure::no_answer(format!("{outside} of {of} {are} limits")));
    }
    Ok(())
}

/// Whether two names are of one folder that is there.
fn is_same(one: &Path, other: &Path) -> bool {
    one.canonicalize().is_ok_and(|one| other.canonicalize().is_ok_and(|other| one == other))
}

/// The facts of a fleet, and the same in words.
struct Summary {
    json: String,
    words: String,
}

/// Writes what the devices say together.
fn summarised(rows: &[Device], out: &Path, inputs: &[PathBuf], prior: bool) -> Result<Summary, Failure> {
    let population = Population::of(rows);
    let mut facts = facts::facts(&population, rows);
    let mut words = facts::in_words(&population, rows);
    let posteriors = prior.then(|| prior::posteriors(&population, rows));
    if let Some(posteriors) = &posteriors {
        let applied = posteriors.iter().filter(|p| p.not_applied.is_none()).count();
        facts["prior"] =
            json!({"file": PRIOR, "statement": prior::STATEMENT, "values": posteriors.len(), "applied": applied});
        words.push_str(&format!("  {PRIOR}: {}\n", prior::STATEMENT));
    }
    let json = serde_json::to_string_pretty(&facts).map_err(Failure::input)?;
    let columns = table::columns(&population, rows);
    let mut results = Vec::new();
    write_parquet(&columns, &mut results).map_err(Failure::input)?;
    let page = report::fleet::page(&population, rows, &facts)?;
    let files = [table::csv(&columns).into_bytes(), json.clone().into_bytes(), page.into_bytes(), results];
    let mut set = output::Set::begin(out, inputs)?;
    for (name, bytes) in SUMMARIES.into_iter().zip(&files) {
        set.add(name, bytes)?;
    }
    match &posteriors {
        Some(posteriors) => set.add(PRIOR, table::prior(posteriors, rows).as_bytes())?,
        None => set.take_away(&[PRIOR]),
    }
    set.commit()?;
    output::tell(format_args!("wrote {}", out.join(SUMMARIES[2]).display()));
    Ok(Summary { json: json + "\n", words })
}

/// What devices say together, by their names, the reasons why they have no answer, and their reports, as fleet.json has it.
pub(crate) fn population(devices: Vec<(String, Option<String>, Option<String>)>) -> Result<Value, Failure> {
    let row = |(name, reason, report): (String, Option<String>, Option<String>)| {
        let unread = || Ok(json!({"device": name, "status": "refused", "reason": reason.unwrap_or_default()}));
        let report = report.map_or_else(unread, |text| serde_json::from_str(&text).map_err(Failure::input))?;
        Ok(Device::new(name, PathBuf::new(), report, None))
    };
    let rows: Vec<Device> = devices.into_iter().map(row).collect::<Result<_, Failure>>()?;
    Ok(facts::facts(&Population::of(&rows), &rows))
}
