//! Devices that lie together in Parquet: each becomes a campaign in memory.
//!
//! A column `run` tells the recordings of a device apart. What a campaign file says stands in columns of the same names, each
//! with one value in all rows of the device, or of the run.

use std::path::Path;

use cvg_calibration::recording::{Campaign, Cells, Lake, Values};
use serde_json::{Value, json};

use crate::Failure;
use crate::service::{self, Columns, Settings};

const RUN: &str = "run";
/// What a campaign file says of a device, and of a run.
const OF_DEVICE: [&str; 7] =
    ["instrument", "carrier_hz", "angular_gain", "period_deg", "pole_pairs", "reference", "temperature_c"];
const OF_RUN: [&str; 6] = ["kind", "settle_s", "use", "amplitude", "angle_deg", "energy_off_s"];
/// Devices that wait for one another, times the threads.
const WAITING: usize = 4;

/// A device of a lake.
pub(super) struct Member {
    pub(super) name: String,
    columns: Columns,
}

/// Gives the devices of a lake, some at once.
pub(super) fn each(lake: &Lake, mut take: impl FnMut(Vec<Member>) -> Result<(), Failure>) -> Result<(), Failure> {
    let most = WAITING * rayon::current_num_threads();
    let mut waiting = Vec::new();
    lake.each(|name, columns| -> Result<(), Failure> {
        waiting.push(Member { name, columns });
        if waiting.len() >= most { take(std::mem::take(&mut waiting)) } else { Ok(()) }
    })?;
    take(waiting)
}

impl Member {
    /// Which rows an answer rests on: a checksum (CRC-32) of names, types and values.
    pub(super) fn rows(&self, lake: &Path) -> Value {
        let mut sum = crc32fast::Hasher::new();
        for (name, values) in &self.columns {
            add(&mut sum, name);
            sum.update(&(values.len() as u64).to_le_bytes());
            match values {
                Values::Numbers(numbers) => numbers.iter().for_each(|v| sum.update(&v.to_bits().to_le_bytes())),
                Values::Texts(cells) => cells.iter().for_each(|cell| add(&mut sum, cell)),
                Values::Unreadable { why, .. } => add(&mut sum, why),
            }
        }
        json!({"lake": lake.display().to_string(), "device": self.name, "crc32": format!("{:08x}", sum.finalize())})
    }

    /// The campaign of the device.
    pub(super) fn campaign(mut self) -> Result<Campaign, Failure> {
        if self.name.is_empty() {
            let rows = self.columns.first().map_or(0, |(_, values)| values.len());
            return Err(Failure::input(format!("{rows} rows have no `device`; wanted a name in each")));
        }
        let (mut text, mut runs) = (format!("[campaign]\ndevice = {}\n", quoted(&self.name)), Vec::new());
        for word in OF_DEVICE {
            text.push_str(&said(&self.columns, word, &self.name)?);
        }
        let names = self.columns.iter().position(|(name, _)| name == RUN).map(|at| self.columns.remove(at).1);
        let rows = self.columns.first().map_or(0, |(_, values)| values.len());
        // a column that says nothing is none
        let unnamed = |names: &Values| (0..rows).filter(|row| cell(names, *row).is_empty()).count();
        let names = names.filter(|names| unnamed(names) < rows);
        if let Some(some) = names.as_ref().map(unnamed).filter(|some| *some > 0) {
            let what = format!("{}: `run` says nothing in {some} of {rows} rows; wanted a name in each", self.name);
            return Err(Failure::input(what));
        }
        let name_of = |row: usize| names.as_ref().map_or("recording".to_owned(), |names| cell(names, row));
        let mut of_runs: Vec<(String, Vec<usize>)> = Vec::new();
        for row in 0..rows {
            let name = name_of(row);
            match of_runs.iter_mut().rev().find(|(run, _)| *run == name) {
                Some((_, rows)) => rows.push(row),
                None => of_runs.push((name, vec![row])),
            }
        }
        for (run, rows) in of_runs {
            let mut own: Columns = self.columns.iter().map(|(name, v)| (name.clone(), picked(v, &rows))).collect();
            let place = format!("{}, {run}", self.name);
            text.push_str(&format!("\n[[run]]\nfile = {}\n", quoted(&run)));
            let words = OF_RUN.map(|word| said(&own, word, &place));
            let [kind, ..] = &words;
            if kind.as_ref().is_ok_and(String::is_empty) {
                text.push_str("kind = \"rotation\"\n");
            }
            for word in words {
                text.push_str(&word?);
            }
            // a column that another run or device has alone says nothing here
            let is_word = |name: &str| OF_DEVICE.contains(&name) || OF_RUN.contains(&name);
            own.retain(|(name, values)| !is_word(name) && (0..values.len()).any(|row| !cell(values, row).is_empty()));
            runs.push((run, own));
        }
        service::campaign_of_text(&text, runs.into_iter().collect(), &Settings::default())
    }
}

/// Adds a text to a checksum, with its length: where it ends counts as well.
fn add(sum: &mut crc32fast::Hasher, text: &str) {
    sum.update(&(text.len() as u64).to_le_bytes());
    sum.update(text.as_bytes());
}

/// A line of a campaign file for a column that says something.
fn said(columns: &Columns, word: &str, of: &str) -> Result<String, Failure> {
    let Some((_, values)) = columns.iter().find(|(name, _)| name == word) else { return Ok(String::new()) };
    let first = cell(values, 0);
    if let Some(row) = (1..values.len()).find(|row| cell(values, *row) != first) {
        let other = cell(values, row);
        return Err(Failure::input(format!("{of}: `{word}` is {first} and {other}; wanted one value in all its rows")));
    }
    Ok(match values {
        _ if first.is_empty() => String::new(),
        Values::Numbers(_) => format!("{word} = {first}\n"),
        Values::Texts(_) => format!("{word} = {}\n", quoted(&first)),
        Values::Unreadable { why, .. } => {
            return Err(Failure::input(format!("{of}: `{word}` {why}; wanted numbers or texts")));
        }
    })
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A value as text; empty where there is none.
fn cell(values: &Values, row: usize) -> String {
    match values {
        Values::Numbers(numbers) => numbers.get(row).filter(|v| v.is_finite()).map_or(String::new(), f64::to_string),
        Values::Texts(cells) => cells.get(row).unwrap_or_default().to_owned(),
        // it is there, whatever it is
        Values::Unreadable { why, .. } => why.clone(),
    }
}

fn picked(values: &Values, rows: &[usize]) -> Values {
    match values {
        Values::Numbers(numbers) => Values::Numbers(rows.iter().map(|row| numbers[*row]).collect()),
        Values::Texts(cells) => {
            let mut out = Cells::default();
            rows.iter().for_each(|row| out.push(cells.get(*row).unwrap_or_default()));
            Values::Texts(out)
        }
        Values::Unreadable { why, .. } => Values::Unreadable { rows: rows.len(), why: why.clone() },
    }
}
