//! Files as they are named on the command line: patterns, standard input, campaigns and loose recordings.

use std::path::{Path, PathBuf};

use cvg_calibration::envelopes;
use cvg_calibration::recording::{
    Campaign, Channel, Instrument, Naming, ReadError, Recording, Role, RunKind, Said, mapped_name,
};

use crate::{Failure, report_keys};

/// What standard input is called in messages.
const STANDARD_INPUT: &str = "standard input";

/// Whether a name stands for standard input.
fn is_standard_input(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Reads a recording from a file, or from standard input for `-`.
pub(crate) fn recording(path: &Path, naming: &Naming) -> Result<Recording, Failure> {
    read(path, naming).map_err(explained)
}

/// [`recording`], with what is wrong as the reader says it.
pub(crate) fn read(path: &Path, naming: &Naming) -> Result<Recording, ReadError> {
    if is_standard_input(path) {
        Recording::read_from(std::io::stdin(), naming, Path::new(STANDARD_INPUT))
    } else {
        Recording::read_named(path, naming)
    }
}

/// The columns of a file that names none of ours, as far as they are numbers over a first column that grows: for people
/// to tell which is which.
pub(crate) fn foreign_columns(path: &Path, error: &ReadError) -> Option<Vec<(String, Vec<f64>)>> {
    let ReadError::MissingColumns { present, .. } = error else { return None };
    if is_standard_input(path) {
        return None;
    }
    let names: Vec<&str> = present.split('`').skip(1).step_by(2).collect();
    let [first, second, ..] = names.as_slice() else { return None };
    let mut naming = Naming::default();
    // the second stands in for an angle, so that the file is read at all
    // and a factor of one keeps both in the units of the file
    naming.add(&format!("t_s={first}*1")).ok()?;
    naming.add(&format!("theta_deg={second}*1")).ok()?;
    let read = Recording::read_named(path, &naming).ok()?;
    let number = |text: &str| text.trim().replace(',', ".").parse().unwrap_or(f64::NAN);
    let mut columns = vec![((*first).to_owned(), read.t_s.clone())];
    columns.extend(read.channel(Channel::Theta).map(|v| ((*second).to_owned(), v.to_vec())));
    let ours = Channel::ALL.into_iter().filter(|c| ![Channel::Time, Channel::Theta].contains(c));
    columns.extend(ours.filter_map(|c| Some((c.name().to_owned(), read.channel(c)?.to_vec()))));
    for unknown in &read.unknown {
        let values: Vec<f64> = (0..read.len()).map(|row| number(unknown.cells.get(row).unwrap_or_default())).collect();
        columns.push((unknown.name.clone(), values));
    }
    Some(columns)
}

/// The files that names and patterns stand for: a folder for the campaign in it. A name that exists is itself, whatever signs are in it.
pub(crate) fn files(names: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut out: Vec<PathBuf> = Vec::new();
    for name in names {
        let text = name.to_string_lossy();
        if name.exists() || !text.contains(['*', '?', '[']) {
            out.push(campaign_in(name));
            continue;
        }
        let bad = |what: String| Failure::input(format!("{text}: {what}"));
        let found: Vec<PathBuf> = glob::glob(&text)
            .map_err(|e| bad(format!("is no pattern: {e}")))?
            .collect::<Result<_, _>>()
            .map_err(|e| bad(e.to_string()))?;
        if found.is_empty() {
            return Err(bad("no file has a name like this".into()));
        }
        out.extend(found.iter().map(|path| campaign_in(path)));
    }
    if out.iter().filter(|p| is_standard_input(p)).count() > 1 {
        return Err(Failure::input("standard input can be read only once"));
    }
    if let Some(twice) = (1..out.len()).find(|&i| out[..i].contains(&out[i])) {
        return Err(Failure::input(format!("{}: is named twice", out[twice].display())));
    }
    Ok(out)
}

/// The campaign in a folder; anything else as it is.
fn campaign_in(path: &Path) -> PathBuf {
    let campaign = path.join("campaign.toml");
    if campaign.is_file() { campaign } else { path.to_owned() }
}

/// The calibration in the results of an identification, where a folder is named.
pub(crate) fn calibration(path: &Path) -> PathBuf {
    if path.is_dir() { path.join("calibration.toml") } else { path.to_owned() }
}

/// Whether a file is a campaign by its name.
pub(crate) fn is_campaign(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// The files that a campaign was read from.
pub(crate) fn sources(campaign: &Campaign) -> Vec<PathBuf> {
    let runs = campaign.runs.iter().map(|run| run.recording.source.clone());
    std::iter::once(campaign.source.clone()).chain(runs).filter(|path| !path.as_os_str().is_empty()).collect()
}

/// What the command line says of a campaign beside its files.
pub(crate) struct Wanted<'a> {
    pub(crate) naming: &'a Naming,
    /// recordings that nothing is fitted to
    pub(crate) holdout: &'a [PathBuf],
    /// time to drop at the start of each
    pub(crate) settle_s: Option<f64>,
    /// an angle sensor, whatever a campaign file says
    pub(crate) sensor: bool,
}

/// Opens a campaign file, or makes a campaign of recordings.
pub(crate) fn campaign(names: &[PathBuf], wanted: &Wanted<'_>) -> Result<Campaign, Failure> {
    Ok(as_wanted(opened(names, wanted)?, wanted.sensor))
}

/// The period that a sensor has where the campaign says none.
pub(crate) fn as_wanted(mut campaign: Campaign, sensor: bool) -> Campaign {
    if sensor {
        campaign.period_deg.get_or_insert(360.0);
    }
    campaign
}

fn opened(names: &[PathBuf], wanted: &Wanted<'_>) -> Result<Campaign, Failure> {
    let &Wanted { naming, holdout, settle_s, sensor } = wanted;
    let instrument = sensor.then_some(Instrument::Sensor);
    let (fitted, held) = (files(names)?, files(holdout)?);
    if let Some(file) = fitted.iter().chain(&held).find(|p| is_campaign(p)) {
        if fitted.len() > 1 || !held.is_empty() || settle_s.is_some() {
            return Err(Failure::input(format!(
                "{}: a campaign file stands alone and says itself what is held out and how long to settle",
                file.display()
            )));
        }
        return Campaign::open_made(file, naming, instrument, envelopes).map_err(explained);
    }
    if let Some(file) = held.iter().find(|p| fitted.contains(p)) {
        return Err(Failure::input(format!("{}: cannot be fitted to and held out at once", file.display())));
    }
    let settle_s = settle_s.unwrap_or(0.0);
    let made = |path: &PathBuf| {
        let file = path.file_name().map_or(path.as_path(), Path::new);
        let said = Said { file, kind: RunKind::Rotation, carrier_hz: None };
        Ok(envelopes(recording(path, naming)?, said))
    };
    let read: Vec<Recording> = fitted.iter().chain(&held).map(made).collect::<Result<_, Failure>>()?;
    of_recordings(read, fitted.len(), settle_s, instrument)
}

/// A campaign of recordings, the first of which are fitted to.
pub(crate) fn of_recordings(
    read: Vec<Recording>,
    fitted: usize,
    settle_s: f64,
    instrument: Option<Instrument>,
) -> Result<Campaign, Failure> {
    if !settle_s.is_finite() || settle_s < 0.0 {
        return Err(Failure::input(format!("--settle {settle_s}: wanted zero or more seconds")));
    }
    if let Some(still) = read.iter().find(|r| read.len() > 1 && stands_still(r)) {
        return Err(Failure::input(format!(
            "{}: the table does not turn, so it is no rotation; a ring-down has its place in a campaign.toml, with the \
             angle at which the pattern was held",
            still.source.display()
        )));
    }
    let mut campaign = Campaign::of_recordings_as(read, instrument.unwrap_or_default()).map_err(explained)?;
    for (number, run) in campaign.runs.iter_mut().enumerate() {
        run.settle_s = settle_s;
        if number >= fitted {
            run.role = Role::Holdout;
        }
        run.settled()?;
    }
    Ok(campaign)
}

/// Whether the input is recorded and never anything but the same.
pub(crate) fn stands_still(recording: &Recording) -> bool {
    let rates = recording.rate_dps.as_deref().is_some_and(|v| v.iter().all(|rate| *rate == 0.0 || rate.is_nan()));
    let table = recording.table_deg.as_deref();
    table.map_or(rates, |v| v.iter().all(|angle| Some(angle) == v.first() || angle.is_nan()))
}

/// The column that a misspelt one is nearest to.
fn near<'a>(misspelt: &str, columns: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let misspelt = misspelt.to_lowercase();
    let apart = columns.map(|column| (report_keys::apart(&misspelt, &column.to_lowercase()), column));
    let (apart, column) = apart.min_by_key(|(apart, _)| *apart)?;
    // a third of the letters and more are another name
    (3 * apart <= misspelt.chars().count()).then_some(column)
}

/// What would mend it, where the command line can.
pub(crate) fn explained(error: ReadError) -> Failure {
    if let ReadError::MappedColumn { channel, column, present, .. } = &error {
        let near = near(column, present.split('`').skip(1).step_by(2));
        let meant = near.map_or(String::new(), |near| format!("; --map '{channel}={}' is near", mapped_name(near)));
        return Failure::of_file(format!("{error}{meant}"), &error);
    }
    let ReadError::MissingColumns { present, .. } = &error else { return error.into() };
    let there = |name: &str| present.split('`').any(|p| p == name);
    let of_a_resonator = ["xs_v", "ys_v", "vas_v", "vqc_v"].iter().any(|name| there(name));
    if there("xc_v") && there("yc_v") && there("t_s") && !of_a_resonator {
        let message = format!(
            "{error}; a sin/cos sensor needs no reference: --sensor, or instrument = \"sensor\" in a campaign.toml"
        );
        return Failure::of_file(message, &error);
    }
    let known = |name: &str| Channel::ALL.iter().any(|c| c.name().eq_ignore_ascii_case(name));
    let foreign: Vec<&str> = present.split('`').skip(1).step_by(2).filter(|name| !known(name)).collect();
    let is_time = |name: &&&str| {
        let name = name.to_lowercase();
        name == "t" || ["t_", "t ", "time", "tick", "clock", "date"].iter().any(|start| name.starts_with(start))
    };
    // the first column is the time of nearly every file
    let time = foreign.iter().find(is_time).or(foreign.first()).copied().unwrap_or("Time");
    // of two channels, the one that is not there
    let pairs = [("xc_v", "yc_v"), ("yc_v", "xc_v"), ("x_v", "y_v"), ("y_v", "x_v")];
    let partner = pairs.iter().find(|(one, other)| there(one) && !there(other)).map(|(_, other)| *other);
    let (channel, column) = if there("t_s") {
        (partner.unwrap_or("theta_deg"), foreign.first().copied().unwrap_or("Ch3"))
    } else {
        ("t_s", time)
    };
    let column = mapped_name(column);
    let message = format!(
        "{error}; say which column is which, as in --map '{channel}={column}', or once for all in the [columns] of a \
         campaign.toml: t_s, the two channels xc_v and yc_v or an angle theta_deg, and the reference, table_deg or \
         rate_dps, where there is one"
    );
    Failure::of_file(message, &error)
}
