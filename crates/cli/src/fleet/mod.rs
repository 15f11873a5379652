//! `cvg fleet`: many campaigns in one call, a row for each, and what they say together: how each parameter is distributed,
//! which devices are odd, which effects many share.
//!
//! A device without an answer is a row with its reason and no end. Answers that are there and rest on the same bytes are
//! kept, so that a run that was broken off goes on where it was.

mod facts;
mod table;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use cvg_calibration::Options;
use cvg_calibration::recording::{Campaign, Naming};
use cvg_calibration::report::refused::About;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::commands::{RESULTS, Told};
use crate::input::{Wanted, campaign, files};
use crate::limits::Limits;
use crate::population::{Device, Population, prior};
use crate::progress::Progress;
use crate::{Failure, output, report};

/// What is said of all devices together.
const SUMMARIES: [&str; 3] = ["fleet.csv", "fleet.json", "fleet.html"];
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

/// Identifies every campaign into a folder of its own below `out`, and writes fleet.csv, fleet.json and fleet.html
/// beside them.
pub(crate) fn fleet(names: &[PathBuf], out: &Path, asked: &Asked<'_>) -> Result<(), Failure> {
    output::check_folder(out)?;
    let campaigns = campaigns(names)?;
    let [table, facts, page] = SUMMARIES;
    output::check_folder_for(out, &[table, facts, page, PRIOR], &campaigns)?;
    let folders = folders(&campaigns);
    let progress = Progress::begin();
    progress.say(&format!("identifying {} campaigns", campaigns.len()));
    let rows: Vec<Device> = campaigns
        .par_iter()
        .zip(folders)
        .map(|(campaign, folder)| device(campaign.clone(), folder, out, asked.limits))
        .collect::<Result<_, _>>()?;
    drop(progress);
    let told = summarised(&rows, out, &campaigns, asked.prior)?;
    output::answer(if asked.json { &told.json } else { &told.words })?;
    let outside = rows.iter().filter(|r| r.outside.is_some()).count();
    if !rows.iter().any(Device::has_answer) {
        return Err(Failure::no_answer("no device of the fleet has an answer"));
    }
    if outside > 0 {
        return Err(Failure::no_answer(format!("{outside} of {} devices are outside their limits", rows.len())));
    }
    Ok(())
}

/// The facts of a fleet, and the same in words.
struct Summary {
    json: String,
    words: String,
}

/// Writes what the devices say together.
fn summarised(rows: &[Device], out: &Path, campaigns: &[PathBuf], prior: bool) -> Result<Summary, Failure> {
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
    let texts = [table::table(&population, rows), json, report::fleet::page(&population, rows, &facts)?];
    let mut set = output::Set::begin(out, campaigns)?;
    for (name, text) in SUMMARIES.into_iter().zip(&texts) {
        set.add(name, text.as_bytes())?;
    }
    match &posteriors {
        Some(posteriors) => set.add(PRIOR, table::prior(posteriors, rows).as_bytes())?,
        None => set.take_away(&[PRIOR]),
    }
    set.commit()?;
    output::tell(format_args!("wrote {}", out.join(SUMMARIES[2]).display()));
    let [_, json, _] = texts;
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

/// The campaigns behind names, patterns and folders; of a folder without one, those of the folders in it.
fn campaigns(names: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut out = Vec::new();
    for path in files(names)? {
        if !path.is_dir() {
            out.push(path);
            continue;
        }
        let entries = std::fs::read_dir(&path).map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
        let mut inner: Vec<PathBuf> =
            entries.flatten().map(|e| e.path().join("campaign.toml")).filter(|p| p.is_file()).collect();
        if inner.is_empty() {
            return Err(Failure::input(format!(
                "{}: there is no campaign.toml in it or in its folders",
                path.display()
            )));
        }
        inner.sort();
        out.extend(inner);
    }
    Ok(out)
}

/// A folder for each campaign: the name of the campaign's own, or of its file, numbered where another has it.
fn folders(campaigns: &[PathBuf]) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let name = |path: &PathBuf| {
        let named = path.file_stem().filter(|s| *s != "campaign").or_else(|| path.parent()?.file_name());
        let text = named.map_or("device".into(), |n| n.to_string_lossy().into_owned());
        let numbered = (2..).map(|again| format!("{text}-{again}"));
        let free = std::iter::once(text.clone()).chain(numbered).find(|name| taken.insert(name.clone()));
        free.unwrap_or(text)
    };
    campaigns.iter().map(name).collect()
}

/// Identifies one device, or takes the answer that is there.
fn device(path: PathBuf, folder: String, out: &Path, limits: Option<&Limits>) -> Result<Device, Failure> {
    let own = out.join(&folder);
    let naming = Naming::default();
    let wanted = Wanted { naming: &naming, holdout: &[], settle_s: None, sensor: false };
    let report = match campaign(std::slice::from_ref(&path), &wanted) {
        Ok(opened) => match kept(&own, &opened) {
            Some(report) => report,
            None => identified(opened, &own)?,
        },
        // a device that cannot be read is a row as well
        Err(failure) => json!({"device": folder, "status": "refused", "reason": failure.message}),
    };
    let name = report["device"].as_str().unwrap_or_default().to_owned();
    let outside = match limits {
        Some(_) if report["schema"].is_null() => Some("it cannot be read".into()),
        Some(limits) => limits.judge(&name, &report)?,
        None => None,
    };
    Ok(Device::new(folder, path, report, outside))
}

/// The report that is there, where it rests on the same bytes and this very program.
fn kept(own: &Path, campaign: &Campaign) -> Option<Value> {
    let [file, ..] = RESULTS;
    let text = std::fs::read_to_string(own.join(file)).ok()?;
    let report: Value = serde_json::from_str(&text).ok()?;
    let inputs = serde_json::to_value(cvg_calibration::report::inputs(campaign)).ok()?;
    let tool = serde_json::to_value(cvg_calibration::report::Tool::default()).ok()?;
    (report["inputs"] == inputs && report["tool"] == tool).then_some(report)
}

/// Identifies a campaign, and writes what `cvg identify` writes of it but for the page.
fn identified(opened: Campaign, own: &Path) -> Result<Value, Failure> {
    let inputs = crate::input::sources(&opened);
    let [report, _, calibration] = RESULTS;
    let about = About::campaign(&opened);
    let (text, undone) = match cvg_calibration::answer(opened, &Options::default()) {
        Ok(answer) => Told::facts(&answer)?,
        Err(refusal) => (serde_json::to_string_pretty(&about.refused(&refusal)).map_err(Failure::input)?, None),
    };
    let mut set = output::Set::begin(own, &inputs)?;
    set.add(report, text.as_bytes())?;
    match undone {
        Some(undone) => set.add(calibration, undone.as_bytes())?,
        None => set.take_away(&[calibration]),
    }
    set.commit()?;
    serde_json::from_str(&text).map_err(Failure::input)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_campaigns_share_a_folder_of_results() {
        let paths =
            ["a/unit/campaign.toml", "b/unit/campaign.toml", "c/unit-2/campaign.toml", "unit.toml", "unit-2.toml"];
        let folders = folders(&paths.map(PathBuf::from));
        assert_eq!(folders, ["unit", "unit-2", "unit-2-2", "unit-3", "unit-2-3"]);
    }
}
