//! The devices of a fleet, each identified into a folder of its own: from campaigns on disk, and from lakes.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use cvg_calibration::Options;
use cvg_calibration::recording::{Campaign, Lake, Naming, stem};
use cvg_calibration::report::refused::About;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::lake::{self, Member};
use super::{PRIOR, SUMMARIES, kept};
use crate::commands::{RESULTS, Told};
use crate::input::{Wanted, campaign, explained, files};
use crate::limits::{Judgement, Limits};
use crate::population::Device;
use crate::{Failure, output};

/// Where devices are.
pub(super) enum Source {
    /// one, in a campaign or a recording
    File(PathBuf),
    /// many, in Parquet with a column `device`
    Lake(Lake),
}

impl Source {
    pub(super) fn path(&self) -> &Path {
        match self {
            Self::File(path) => path,
            Self::Lake(lake) => lake.path(),
        }
    }

    /// How many devices.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::File(_) => 1,
            Self::Lake(lake) => lake.devices().count(),
        }
    }
}

/// What is behind names, patterns and folders; of a folder without a campaign, those of the folders in it, or a lake.
pub(super) fn sources(names: &[PathBuf]) -> Result<Vec<Source>, Failure> {
    let mut out = Vec::new();
    for path in files(names)? {
        if !path.is_dir() {
            if !path.exists() {
                return Err(Failure::input(format!("{}: there is no such file or folder", path.display())));
            }
            let lake = if path.is_file() { Lake::open(&path).map_err(explained)? } else { None };
            out.push(lake.map_or_else(|| Source::File(path), Source::Lake));
            continue;
        }
        let entries = std::fs::read_dir(&path).map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
        let mut inner: Vec<PathBuf> =
            entries.flatten().map(|e| e.path().join("campaign.toml")).filter(|p| p.is_file()).collect();
        inner.sort();
        if !inner.is_empty() {
            out.extend(inner.into_iter().map(Source::File));
        } else if let Some(lake) = Lake::open(&path).map_err(explained)? {
            out.push(Source::Lake(lake));
        } else {
            let wanted = "and no Parquet file with a column `device`";
            let what = format!("{}: there is no campaign.toml in it or in its folders, {wanted}", path.display());
            return Err(Failure::input(what));
        }
    }
    Ok(out)
}

/// Identifies the devices, or takes the answers that are there.
pub(super) fn answered(sources: Vec<Source>, out: &Path, limits: Option<&Limits>) -> Result<Vec<Device>, Failure> {
    let mut folders = Folders::default();
    let (mut files, mut lakes) = (Vec::new(), Vec::new());
    for source in sources {
        match source {
            Source::File(path) => files.push((folders.of_file(&path), path)),
            Source::Lake(lake) => lakes.push(lake),
        }
    }
    let of_file = |(folder, path): (String, PathBuf)| {
        let naming = Naming::default();
        let wanted = Wanted { naming: &naming, holdout: &[], settle_s: None, sensor: false };
        let opened = campaign(std::slice::from_ref(&path), &wanted);
        device(opened, None, Place { folder: folder.clone(), name: folder, path, out }, limits)
    };
    let mut all = in_order(files.into_par_iter().map(of_file).collect::<Result<_, _>>()?);
    for lake in &lakes {
        lake::each(lake, |members| {
            let placed: Vec<(String, Member)> = members.into_iter().map(|m| (folders.of_name(&m.name), m)).collect();
            let of_member = |(folder, member): (String, Member)| {
                let (name, rows) = (member.name.clone(), member.rows(lake.path()));
                let place = Place { folder, name, path: lake.path().to_path_buf(), out };
                device(member.campaign(), Some(&rows), place, limits)
            };
            all.extend(in_order(placed.into_par_iter().map(of_member).collect::<Result<_, _>>()?));
            Ok(())
        })?;
    }
    Ok(all)
}

/// The devices, after their verdicts were said in their order and not in that of the threads.
fn in_order(judged: Vec<(Device, Judgement)>) -> Vec<Device> {
    judged.iter().for_each(|(_, judgement)| judgement.tell());
    judged.into_iter().map(|(device, _)| device).collect()
}

/// Bytes of a folder's name: systems take 255, of which what is unfinished has some before it.
const LONGEST: usize = 200;

/// Folders of results: no two alike, also where a system takes capitals for small letters, and none in the place of a summary.
#[derive(Default)]
struct Folders(BTreeSet<String>);

impl Folders {
    /// The name of the campaign's own folder, or of its file.
    fn of_file(&mut self, path: &Path) -> String {
        let named = stem(path).filter(|s| *s != "campaign").or_else(|| path.parent()?.file_name());
        self.free(named.map_or("device".into(), |n| n.to_string_lossy().into_owned()))
    }

    /// A device's name, as far as it is no way through folders.
    fn of_name(&mut self, name: &str) -> String {
        let kept = |c: char| if c.is_alphanumeric() || "-_+. ".contains(c) { c } else { '_' };
        let text: String = name.chars().map(kept).collect();
        let text = text.trim_start_matches('.').trim();
        self.free(if text.is_empty() { "device".to_owned() } else { text.to_owned() })
    }

    /// The name, shortened where it is long and numbered where another has it.
    fn free(&mut self, mut name: String) -> String {
        while name.len() > LONGEST {
            name.pop();
        }
        let numbered = (2..).map(|again| format!("{name}-{again}"));
        let is_free = |name: &String| {
            let alike = name.to_lowercase();
            !SUMMARIES.contains(&alike.as_str()) && alike != PRIOR && self.0.insert(alike)
        };
        std::iter::once(name.clone()).chain(numbered).find(is_free).unwrap_or(name)
    }
}

/// Where a device comes from and where its results go.
struct Place<'a> {
    folder: String,
    name: String,
    path: PathBuf,
    out: &'a Path,
}

/// Identifies one device, or takes the answer that is there; `rows` says which rows of a lake it is.
fn device(
    opened: Result<Campaign, Failure>,
    rows: Option<&Value>,
    place: Place<'_>,
    limits: Option<&Limits>,
) -> Result<(Device, Judgement), Failure> {
    let own = place.out.join(&place.folder);
    let report = match opened {
        Ok(opened) => match kept::answer(&own, &opened, rows) {
            Some(report) => report,
            None => identified(opened, &own, rows)?,
        },
        // a device that cannot be read is a row as well, and has no answer of an earlier day
        Err(failure) => {
            take_away(&own, std::slice::from_ref(&place.path))?;
            json!({"device": place.name, "status": "refused", "reason": failure.message})
        }
    };
    let name = report["device"].as_str().unwrap_or_default().to_owned();
    let judgement = match limits {
        Some(_) if report["schema"].is_null() => Judgement::failed("it cannot be read"),
        Some(limits) => limits.judge(&name, &report)?,
        None => Judgement::default(),
    };
    Ok((Device::new(place.folder, place.path, report, judgement.outside.clone()), judgement))
}

/// Identifies a campaign, and writes what `cvg identify` writes of it but for the page.
fn identified(opened: Campaign, own: &Path, rows: Option<&Value>) -> Result<Value, Failure> {
    let inputs = crate::input::sources(&opened);
    let [report, _, calibration] = RESULTS;
    let about = About::campaign(&opened);
    let (text, undone) = match cvg_calibration::answer(opened, &Options::default()) {
        Ok(answer) => Told::facts(&answer)?,
        Err(refusal) => (serde_json::to_string_pretty(&about.refused(&refusal)).map_err(Failure::input)?, None),
    };
    let mut set = output::Set::begin(own, &inputs)?;
    set.add(report, text.as_bytes())?;
    set.add(kept::SOURCE, kept::source(rows, &text, undone.as_deref()).as_bytes())?;
    match &undone {
        Some(undone) => set.add(calibration, undone.as_bytes())?,
        None => set.take_away(&[calibration]),
    }
    set.commit()?;
    serde_json::from_str(&text).map_err(Failure::input)
}

/// Removes an answer that is there.
fn take_away(own: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    let [report, _, calibration] = RESULTS;
    let files = [report, calibration, kept::SOURCE];
    // what `cvg fleet` has not written is not its to remove
    if !own.join(kept::SOURCE).is_file() {
        return Ok(());
    }
    let mut set = output::Set::begin(own, inputs)?;
    set.take_away(&files);
    set.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_campaigns_share_a_folder_of_results() {
        let paths = [
            "a/unit/campaign.toml",
            "b/unit/campaign.toml",
            "c/unit-2/campaign.toml",
            "unit.toml",
            "unit-2.toml",
            "ring.csv.gz",
        ];
        let mut folders = Folders::default();
        let names = paths.map(|path| folders.of_file(Path::new(path)));
        assert_eq!(names, ["unit", "unit-2", "unit-2-2", "unit-3", "unit-2-3", "ring"]);
    }

    #[test]
    fn no_folder_is_another_to_any_system_nor_a_summary_nor_too_long() {
        let mut folders = Folders::default();
        let names = ["A", "a", "Fleet.CSV", "fleet-prior.csv"].map(|name| folders.of_name(name));
        assert_eq!(names, ["A", "a-2", "Fleet.CSV-2", "fleet-prior.csv-2"]);
        let long = "é".repeat(300);
        let [one, two] = [folders.of_name(&long), folders.of_name(&format!("{long}x"))];
        assert!(one.len() <= 200 && two == format!("{one}-2"), "{two}");
    }

    #[test]
    fn a_device_of_a_lake_has_a_folder_within_the_results_whatever_its_name() {
        let mut folders = Folders::default();
        let names = ["../../etc", "..", "a/b", "SN 07.1", ""].map(|name| folders.of_name(name));
        assert_eq!(names, ["_.._etc", "device", "a_b", "SN 07.1", "device-2"]);
    }
}
