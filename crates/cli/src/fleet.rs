//! `cvg fleet`: many campaigns in one call, a row for each, and what they say together: how each parameter is distributed,
//! which devices are odd, which effects many share.
//!
//! A device without an answer is a row with its reason and no end. Answers that are there and rest on the same bytes are
//! kept, so that a run that was broken off goes on where it was.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use cvg_calibration::Options;
use cvg_calibration::recording::{Campaign, Naming};
use cvg_calibration::report::refused::About;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::commands::{RESULTS, Told};
use crate::compare::{Parameter, of_report};
use crate::input::{Wanted, campaign, files};
use crate::limits::Limits;
use crate::progress::Progress;
use crate::report::significant;
use crate::{Failure, output};

/// What is said of all devices together.
const SUMMARIES: [&str; 2] = ["fleet.csv", "fleet.json"];
/// Robust deviations from the median beyond which a parameter is odd, beside its own interval.
const ODD: f64 = 5.0;
/// Devices from which on a distribution tells what is odd.
const FEWEST_DEVICES: usize = 8;
/// An effect that fewer than this share of the devices have is odd in those that have it; one that more than
/// [`SHARED`] have is of the design or the board.
const RARE: f64 = 0.1;
const SHARED: f64 = 0.5;
/// Median absolute deviation of a normal distribution times this is its standard deviation.
const NORMAL: f64 = 1.4826;

/// A device of the fleet.
struct Row {
    /// its folder in the results
    folder: String,
    campaign: PathBuf,
    report: Value,
    /// which limit it fails
    outside: Option<String>,
}

impl Row {
    fn text(&self, of: &str) -> &str {
        self.report[of].as_str().unwrap_or_default()
    }

    fn has_answer(&self) -> bool {
        self.text("status") == "answered"
    }

    /// Effects beyond the declared model.
    fn effects(&self) -> BTreeSet<&str> {
        let all = self.report["effects"].as_array().map(Vec::as_slice).unwrap_or_default();
        all.iter().filter(|e| e["origin"] != "declared").filter_map(|e| e["id"].as_str()).collect()
    }
}

/// Identifies every campaign into a folder of its own below `out`, and writes fleet.csv and fleet.json beside them.
pub(crate) fn fleet(names: &[PathBuf], out: &Path, limits: Option<&Limits>, json: bool) -> Result<(), Failure> {
    output::check_folder(out)?;
    let campaigns = campaigns(names)?;
    output::check_folder_for(out, &SUMMARIES, &campaigns)?;
    let folders = folders(&campaigns);
    let progress = Progress::begin();
    progress.say(&format!("identifying {} campaigns", campaigns.len()));
    let rows: Vec<Row> = campaigns
        .par_iter()
        .zip(folders)
        .map(|(campaign, folder)| device(campaign.clone(), folder, out, limits))
        .collect::<Result<_, _>>()?;
    drop(progress);
    let population = Population::of(&rows);
    let facts = serde_json::to_string_pretty(&population.facts(&rows)).map_err(Failure::input)?;
    let [table, json_file] = SUMMARIES;
    output::write_all(out, &[(table, population.table(&rows).as_bytes()), (json_file, facts.as_bytes())], &campaigns)?;
    output::tell(format_args!("wrote {}", out.join("fleet.csv").display()));
    output::answer(&if json { format!("{facts}\n") } else { population.in_words(&rows) })?;
    let outside = rows.iter().filter(|r| r.outside.is_some()).count();
    if !rows.iter().any(Row::has_answer) {
        return Err(Failure::no_answer("no device of the fleet has an answer"));
    }
    if outside > 0 {
        return Err(Failure::no_answer(format!("{outside} of {} devices are outside their limits", rows.len())));
    }
    Ok(())
}

/// What devices say together, by their names, the reasons why they have no answer, and their reports, as fleet.json has it.
pub(crate) fn population(devices: Vec<(String, Option<String>, Option<String>)>) -> Result<Value, Failure> {
    let row = |(name, reason, report): (String, Option<String>, Option<String>)| {
        let unread = || Ok(json!({"device": name, "status": "refused", "reason": reason.unwrap_or_default()}));
        let report = report.map_or_else(unread, |text| serde_json::from_str(&text).map_err(Failure::input))?;
        Ok(Row { folder: name, campaign: PathBuf::new(), report, outside: None })
    };
    let rows: Vec<Row> = devices.into_iter().map(row).collect::<Result<_, Failure>>()?;
    Ok(Population::of(&rows).facts(&rows))
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
fn device(path: PathBuf, folder: String, out: &Path, limits: Option<&Limits>) -> Result<Row, Failure> {
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
    Ok(Row { folder, campaign: path, report, outside })
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

/// How one parameter is distributed over the devices.
struct Distribution {
    unit: String,
    median: f64,
    /// robust standard deviation
    deviation: f64,
    count: usize,
}

/// What the devices say together.
struct Population {
    parameters: Vec<Vec<Parameter>>,
    distributions: BTreeMap<String, Distribution>,
    /// share of the answered devices that have an effect
    shares: BTreeMap<String, f64>,
    /// why each device is odd
    odd: Vec<Vec<String>>,
}

impl Population {
    fn of(rows: &[Row]) -> Self {
        let parameters: Vec<Vec<Parameter>> =
            rows.iter().map(|r| if r.has_answer() { of_report(&r.report) } else { Vec::new() }).collect();
        let mut values: BTreeMap<String, (String, Vec<f64>)> = BTreeMap::new();
        for p in parameters.iter().flatten() {
            values.entry(p.name.clone()).or_insert_with(|| (p.unit.clone(), Vec::new())).1.push(p.value);
        }
        let distributions: BTreeMap<String, Distribution> = values
            .into_iter()
            .map(|(name, (unit, values))| {
                let middle = median(values.clone());
                let deviation = NORMAL * median(values.iter().map(|v| (v - middle).abs()).collect());
                (name, Distribution { unit, median: middle, deviation, count: values.len() })
            })
            .collect();
        let answered = rows.iter().filter(|r| r.has_answer()).count();
        let mut shares: BTreeMap<String, f64> = BTreeMap::new();
        for id in rows.iter().filter(|r| r.has_answer()).flat_map(Row::effects) {
            *shares.entry(id.to_owned()).or_default() += 1.0 / answered as f64;
        }
        let mut population = Self { parameters, distributions, shares, odd: Vec::new() };
        if answered >= FEWEST_DEVICES {
            population.odd = rows.iter().zip(&population.parameters).map(|(r, p)| population.oddities(r, p)).collect();
        } else {
            population.odd = vec![Vec::new(); rows.len()];
        }
        population
    }

    /// Why a device is odd: an effect that few have, a parameter far from those of the others and from its own interval.
    fn oddities(&self, row: &Row, parameters: &[Parameter]) -> Vec<String> {
        let rare = row.effects().into_iter().filter(|id| self.shares.get(*id).is_some_and(|s| *s < RARE));
        let mut out: Vec<String> = rare.map(str::to_owned).collect();
        for p in parameters {
            let Some(d) = self.distributions.get(&p.name).filter(|d| d.count >= FEWEST_DEVICES) else { continue };
            let own = p.ci95.map_or(0.0, |[low, high]| (high - low) / (2.0 * 1.96));
            let off = p.value - d.median;
            let off = if p.unit == "deg" { off - 360.0 * (off / 360.0).round() } else { off };
            // the axis of what is hardly there points anywhere
            if p.unit != "deg" && off.abs() > ODD * d.deviation.hypot(own) {
                out.push(p.name.clone());
            }
        }
        out
    }

    /// fleet.csv: a row for each device.
    fn table(&self, rows: &[Row]) -> String {
        let names: Vec<&String> = self.distributions.keys().collect();
        let mut out = String::from(
            "device,campaign,folder,status,reason,raw_rms_deg,declared_rms_deg,discovered_rms_deg,noise_floor_deg,effects,odd,\
             outside_limits",
        );
        for name in &names {
            let _ = write!(out, ",{0},{0}.low,{0}.high", quoted(name));
        }
        out.push('\n');
        for ((row, parameters), odd) in rows.iter().zip(&self.parameters).zip(&self.odd) {
            let rms = |stage: &str| row.report.pointer(&format!("/heldout/{stage}")).and_then(Value::as_f64);
            let effects: Vec<&str> = row.effects().into_iter().collect();
            let mut cells = vec![
                quoted(row.text("device")),
                quoted(&row.campaign.display().to_string()),
                quoted(&row.folder),
                row.text("status").to_owned(),
                quoted(row.text("reason")),
            ];
            let errors = ["raw/rms_deg", "declared/rms_deg", "discovered/rms_deg", "noise_floor_deg"];
            cells.extend(errors.map(|stage| number(rms(stage))));
            cells.extend([quoted(&effects.join(" ")), quoted(&odd.join(" "))]);
            cells.push(quoted(row.outside.as_deref().unwrap_or_default()));
            for name in &names {
                let p = parameters.iter().find(|p| p.name == **name);
                let ends = p.and_then(|p| p.ci95);
                cells.extend([p.map(|p| p.value), ends.map(|e| e[0]), ends.map(|e| e[1])].map(number));
            }
            let _ = writeln!(out, "{}", cells.join(","));
        }
        out
    }

    /// fleet.json
    fn facts(&self, rows: &[Row]) -> Value {
        let of = |status: &str| rows.iter().filter(|r| r.text("status") == status).count();
        let parameters: serde_json::Map<String, Value> = self
            .distributions
            .iter()
            .map(|(name, d)| {
                let facts =
                    json!({"unit": d.unit, "devices": d.count, "median": d.median, "robust_deviation": d.deviation});
                (name.clone(), facts)
            })
            .collect();
        let odd = rows.iter().zip(&self.odd).filter(|(_, odd)| !odd.is_empty());
        json!({
            "schema": "cvg.fleet/1",
            "devices": rows.len(),
            "answered": of("answered"),
            "neutral": of("neutral"),
            "refused": of("refused"),
            "outside_limits": rows.iter().filter(|r| r.outside.is_some()).count(),
            "parameters": parameters,
            "effects": self.shares.iter().map(|(id, share)| {
                json!({"id": id, "share": share, "shared": *share >= SHARED, "rare": *share < RARE})
            }).collect::<Vec<_>>(),
            "odd": odd.map(|(r, why)| json!({"device": r.text("device"), "folder": r.folder, "by": why})).collect::<Vec<_>>(),
        })
    }

    fn in_words(&self, rows: &[Row]) -> String {
        let mut out = String::new();
        let answered = rows.iter().filter(|r| r.has_answer()).count();
        let _ = writeln!(out, "{} devices, {answered} answered", rows.len());
        for (name, d) in self.distributions.iter().filter(|(_, d)| 2 * d.count > answered) {
            let unit = if d.unit == "1" { "" } else { &d.unit };
            let (middle, deviation) = (significant(d.median), significant(d.deviation));
            let _ = writeln!(out, "  {name:<40} median {middle} {unit}, robust deviation {deviation} {unit}");
        }
        for (id, share) in &self.shares {
            let what = if *share >= SHARED { "shared: of the design or the board" } else { "" };
            let _ = writeln!(out, "  {id:<40} in {:.1} % of the devices  {what}", 100.0 * share);
        }
        for (row, odd) in rows.iter().zip(&self.odd).filter(|(_, odd)| !odd.is_empty()) {
            let _ = writeln!(out, "  odd: {} ({}): {}", row.text("device"), row.folder, odd.join(", "));
        }
        for row in rows.iter().filter(|r| !r.has_answer()) {
            let _ = writeln!(
                out,
                "  {}: {} ({}): {}",
                row.text("status"),
                row.text("device"),
                row.folder,
                row.text("reason")
            );
        }
        out
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

/// A number as a cell: empty where there is none.
fn number(value: Option<f64>) -> String {
    value.filter(|v| v.is_finite()).map_or(String::new(), |v| v.to_string())
}

/// A text as a cell (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
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
