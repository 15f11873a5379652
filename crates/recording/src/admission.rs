//! Which rows of a table become the recording: those with a time, a reference and an angle, each time once.
//!
//! What is left out is counted with its place and said in a warning. Values are changed by the conversion of their
//! unit alone, where one is written: spikes and implausible motion are not seen here. A time that goes back is refused, except for a row that an earlier row says word for word.

use std::path::Path;

use super::Recording;
use super::channel::Channel;
use super::dropped::{Dropped, Tally};
use super::error::{Place, ReadError};
use super::memory;
use super::naming::Naming;
use super::requirement;
use super::table::{NumberColumn, Table};
use super::units::{self, Conversion};
use super::unknown::{Cells, UnknownColumn};

/// Makes the recording of a table.
pub(super) fn admit(mut table: Table, naming: &Naming, source: &Path) -> Result<Recording, ReadError> {
    let mut warnings = std::mem::take(&mut table.warnings);
    for &channel in &table.by_own_name {
        let column = naming.column(channel).unwrap_or_default();
        warnings.push(format!("there is no column `{column}`: `{channel}` is taken as it is"));
    }
    let naming = &naming.without(&table.by_own_name);
    let readout_unit = convert(&mut table, naming, source, &mut warnings)?;
    if table.rows == 0 && table.truncated.is_none() {
        return Err(ReadError::NoRows { path: source.to_path_buf(), place: table.header });
    }
    set_aside_empty_columns(&mut table, source, &mut warnings)?;

    let mut dropped = Dropped { blank_lines: table.blank_lines, ..Dropped::default() };
    if let Some(place) = table.truncated {
        dropped.truncated_last_line.add(place);
    }
    dropped.rows_read = table.rows as u64 + dropped.truncated_last_line.count;
    for column in table.numbers.iter().filter(|column| !column.channel.is_needed_in_every_row()) {
        if column.missing.count > 0 {
            let first = Some(table.places.of(column.missing.first_row));
            dropped.missing_values.push((column.channel, Tally { count: column.missing.count, first }));
        }
    }
    if let Some(kept) = rows_to_keep(&table, source, &mut dropped)? {
        keep(&mut table, &kept);
    }
    dropped.rows_kept = table.rows as u64;
    if table.rows == 0 {
        return Err(nothing_usable(source, &dropped));
    }
    integrate(&mut table, naming, &mut warnings);
    // Rows that were dropped may have held all that a column had.
    let without = |column: &NumberColumn| column.missing.count > 0 && column.values.iter().all(|value| value.is_nan());
    let bare = table.numbers.iter().filter(|column| without(column)).map(|column| column.channel).collect();
    set_aside(&mut table, bare, &mut warnings);
    dropped.missing_values.retain(|(channel, _)| table.numbers.iter().any(|column| column.channel == *channel));
    say(&table, &dropped, &mut warnings);
    let theta_is_integral = naming.is_integral(Channel::Theta);
    Ok(Recording { readout_unit, theta_is_integral, ..assemble(table, source, dropped, warnings) })
}

/// Takes every column to the unit of its channel: by the factor of the mapping, else by the unit that the file states below
/// the name, else by that in the name. Gives the unit that a readout is kept in, where that is not of volts.
fn convert(
    table: &mut Table,
    naming: &Naming,
    source: &Path,
    warnings: &mut Vec<String>,
) -> Result<Option<String>, ReadError> {
    let (mut kept, mut taken) = (None, Taken::default());
    let is_readout = |channel| matches!(channel, Channel::Xc | Channel::Xs | Channel::Yc | Channel::Ys);
    let of_readout: Vec<&str> = table.units.iter().filter(|(c, _)| is_readout(*c)).map(|(_, u)| u.as_str()).collect();
    let is_one = of_readout.windows(2).all(|pair| pair[0] == pair[1]);
    let readouts = table.numbers.iter().map(|column| column.channel).filter(|channel| is_readout(*channel));
    let in_brackets: Vec<Option<&str>> = readouts.map(|channel| naming.unknown_unit(channel)).collect();
    for column in &mut table.numbers {
        let channel = column.channel;
        let own = table.units.iter().find(|(other, _)| *other == channel).map(|(_, unit)| unit.as_str());
        let by = if let Some(factor) = naming.factor(channel) {
            if let Some(unit) =
                own.filter(|unit| units::conversion(naming.wanted(channel), unit) != Some(Conversion::by(factor)))
            {
                warnings
                    .push(format!("`{channel}` is said to be in {unit}; the factor {factor} of the mapping is taken"));
            }
            Conversion::by(factor)
        } else if let Some(unit) = own {
            match units::conversion(naming.wanted(channel), unit) {
                Some(by) => by,
                // a sensor's channels may be in any unit that both have
                None if is_readout(channel) && is_one => {
                    taken.say(channel, format!("in {unit} and kept in it"));
                    kept = Some(units::bare(unit).to_owned());
                    continue;
                }
                None => {
                    let column = naming.column(channel).unwrap_or(channel.name()).to_owned();
                    let (path, unit, wanted) =
                        (source.to_path_buf(), unit.to_owned(), units::of_channel(naming.wanted(channel)));
                    return Err(ReadError::Unit { path, channel, unit, wanted, column });
                }
            }
        } else if let Some(unit) = naming.unknown_unit(channel) {
            if !is_readout(channel) {
                let taken = units::of_channel(naming.wanted(channel));
                warnings.push(format!("`{channel}`: {unit} is no unit that is known; it is taken for {taken}"));
            } else if in_brackets.windows(2).all(|pair| pair[0] == pair[1]) {
                taken.say(channel, format!("in {unit} and kept in it"));
                kept = Some(if units::is_count(unit) { "counts" } else { unit }.to_owned());
            }
            Conversion::NONE
        } else {
            naming.unit(channel).map_or(Conversion::NONE, |(_, by)| by)
        };
        let is_stated = naming.factor(channel).is_some() || own.is_some() || naming.unit(channel).is_some();
        let counted = column.values.iter().copied().find(|value| value.is_finite());
        if let (Channel::Time, false, Some((unit, by))) = (channel, is_stated, counted.and_then(units::since_1970)) {
            warnings.push(format!("`{channel}` counts {unit} since 1970, and is taken to s"));
            column.values.iter_mut().for_each(|value| *value = by.of(*value));
            continue;
        }
        let temperature = (channel == Channel::Temperature && !is_stated).then(|| units::absolute(&column.values));
        if let Some((unit, by)) = temperature.flatten() {
            warnings.push(format!("`{channel}` is above 230 throughout: it is taken for {unit}, and to °C"));
            column.values.iter_mut().for_each(|value| *value = by.of(*value));
            continue;
        }
        if by == Conversion::NONE {
            continue;
        }
        if let (None, Some(unit)) = (naming.factor(channel), own.or(naming.unit(channel).map(|(unit, _)| unit))) {
            taken.say(channel, format!("in {unit} and taken to {}", units::of_channel(naming.wanted(channel))));
        }
        column.values.iter_mut().for_each(|value| *value = by.of(*value));
    }
    warnings.extend(taken.in_words());
    Ok(kept)
}

/// In which unit channels are and what becomes of it, the channels of one unit together.
#[derive(Default)]
struct Taken(Vec<(String, Vec<Channel>)>);

impl Taken {
    fn say(&mut self, channel: Channel, what: String) {
        match self.0.iter_mut().find(|(other, _)| *other == what) {
            Some((_, channels)) => channels.push(channel),
            None => self.0.push((what, vec![channel])),
        }
    }

    fn in_words(self) -> impl Iterator<Item = String> {
        self.0.into_iter().map(|(what, channels)| {
            let are = if channels.len() > 1 { "are" } else { "is" };
            format!("{} {are} {what}", requirement::in_words(channels.iter().map(|channel| channel.name())))
        })
    }
}

/// Puts the integral over time, from zero on, in the place of rates that are mapped to an angle.
fn integrate(table: &mut Table, naming: &Naming, warnings: &mut Vec<String>) {
    if !table.numbers.iter().any(|column| naming.is_integral(column.channel)) {
        return;
    }
    let time = table.numbers.iter().find(|column| column.channel == Channel::Time).map(|column| column.values.clone());
    for column in table.numbers.iter_mut().filter(|column| naming.is_integral(column.channel)) {
        let mut angle = 0.0;
        let mut before: Option<(f64, f64)> = None;
        for (&t_s, value) in time.iter().flatten().zip(&mut column.values) {
            let rate = *value;
            angle += before.map_or(0.0, |(at, last)| 0.5 * (last + rate) * (t_s - at));
            before = Some((t_s, rate));
            *value = angle;
        }
        let name = naming.column(column.channel).unwrap_or_default();
        warnings.push(format!("`{}` is the integral of `{name}` over time, from 0 on", column.channel));
    }
}

/// A column without a single value is as good as absent; what is left must still be a recording.
fn set_aside_empty_columns(table: &mut Table, source: &Path, warnings: &mut Vec<String>) -> Result<(), ReadError> {
    let is_empty = |column: &NumberColumn| table.rows > 0 && column.missing.count == table.rows as u64;
    let empty: Vec<Channel> =
        table.numbers.iter().filter(|column| is_empty(column)).map(|column| column.channel).collect();
    if empty.is_empty() {
        return Ok(());
    }
    let left = |channel| !empty.contains(&channel) && table.numbers.iter().any(|column| column.channel == channel);
    if !requirement::holds_an_angle(left) {
        let names = requirement::in_words(empty.iter().map(|channel| channel.name()));
        return Err(ReadError::NothingUsable {
            path: source.to_path_buf(),
            rows: table.rows as u64,
            why: format!("{names} without a single number; wanted {}", requirement::angle_in_words()),
        });
    }
    set_aside(table, empty, warnings);
    Ok(())
}

fn set_aside(table: &mut Table, channels: Vec<Channel>, warnings: &mut Vec<String>) {
    for channel in channels {
        warnings.push(format!("column `{channel}` has no number in any row and is taken as absent"));
        table.numbers.retain(|column| column.channel != channel);
        table.names.retain(|name| name != channel.name());
    }
}

/// The rows to keep; `None` where all are.
fn rows_to_keep(table: &Table, source: &Path, dropped: &mut Dropped) -> Result<Option<Vec<usize>>, ReadError> {
    let needed: Vec<&[f64]> = table
        .numbers
        .iter()
        .filter(|column| column.channel.is_needed_in_every_row() && column.missing.count > 0)
        .map(|column| column.values.as_slice())
        .collect();
    let Some(time) = table.numbers.iter().find(|column| column.channel == Channel::Time) else {
        return Ok(None);
    };
    let time = time.values.as_slice();
    if needed.is_empty() && time.is_sorted_by(|before, after| before < after) {
        return Ok(None);
    }
    // a number beside every row
    memory::allow_columns(table.numbers.len() + 1, table.rows, "the recording with its dirt", source)?;
    let mut kept: Vec<usize> = Vec::with_capacity(table.rows);
    for (row, &t_s) in time.iter().enumerate() {
        if needed.iter().any(|values| values[row].is_nan()) {
            dropped.empty_or_nan.add(table.places.of(row));
            continue;
        }
        match kept.last().map(|&last| time[last]) {
            Some(before_s) if t_s == before_s => dropped.repeated_time.add(table.places.of(row)),
            Some(before_s) if t_s < before_s => {
                if !says_again(table, time, &kept, row) {
                    let (path, place) = (source.to_path_buf(), table.places.of(row));
                    return Err(ReadError::TimeBackwards { path, place, before_s, t_s });
                }
                dropped.repeated_time.add(table.places.of(row));
            }
            _ => kept.push(row),
        }
    }
    Ok(Some(kept))
}

/// Whether a kept row of the same time has the same value in every channel: a block that was sent twice.
fn says_again(table: &Table, time: &[f64], kept: &[usize], row: usize) -> bool {
    let Ok(at) = kept.binary_search_by(|&other| time[other].total_cmp(&time[row])) else {
        return false;
    };
    let other = kept[at];
    let same = |column: &NumberColumn| column.values[other].to_bits() == column.values[row].to_bits();
    table.numbers.iter().all(same)
}

fn keep(table: &mut Table, kept: &[usize]) {
    for column in &mut table.numbers {
        for (to, &from) in kept.iter().enumerate() {
            column.values[to] = column.values[from];
        }
        column.values.truncate(kept.len());
    }
    for UnknownColumn { cells, .. } in &mut table.unknown {
        *cells = kept.iter().map(|&row| cells.get(row).unwrap_or_default()).collect::<Cells>();
    }
    table.rows = kept.len();
}

fn nothing_usable(source: &Path, dropped: &Dropped) -> ReadError {
    let reasons = [
        (dropped.empty_or_nan, "lack the time, the reference or the angle"),
        (dropped.truncated_last_line, "is cut off"),
    ];
    let why: Vec<String> = reasons
        .iter()
        .filter(|(tally, _)| !tally.is_zero())
        .map(|(tally, reason)| format!("{} {reason}", tally.count))
        .collect();
    ReadError::NothingUsable { path: source.to_path_buf(), rows: dropped.rows_read, why: why.join(", ") }
}

fn say(table: &Table, dropped: &Dropped, warnings: &mut Vec<String>) {
    let first = |tally: &Tally| tally.first.map_or_else(String::new, |place: Place| format!(", first {place}"));
    let mut rows = |tally: &Tally, what: &str| {
        if !tally.is_zero() {
            let (count, of) = (tally.count, dropped.rows_read);
            warnings.push(format!("{count} of {of} rows dropped: {what}{}", first(tally)));
        }
    };
    rows(&dropped.empty_or_nan, "the time, the reference or the angle is empty or not finite");
    rows(&dropped.repeated_time, "the time stamp is an earlier row's");
    rows(&dropped.truncated_last_line, "the last line is cut off");
    for (channel, tally) in &dropped.missing_values {
        let count = tally.count;
        warnings.push(format!("`{channel}` is empty or not finite in {count} rows, kept as NaN{}", first(tally)));
    }
    if let Some(place) = table.unterminated {
        warnings
            .push(format!("{place}, the last, has no line end: if the file was cut off, its last number may be too"));
    }
    let has = |channel| table.numbers.iter().any(|column| column.channel == channel);
    for (one, other) in [(Channel::Xs, Channel::Ys), (Channel::Xc, Channel::Yc)] {
        for (there, absent) in [(one, other), (other, one)] {
            if has(there) && !has(absent) {
                warnings.push(format!("column `{there}` is there without `{absent}`"));
            }
        }
    }
    if !table.unknown.is_empty() {
        let names = requirement::in_words(table.unknown.iter().map(|column| column.name.as_str()));
        warnings.push(format!("unknown columns, kept and not used: {names}"));
    }
}

fn assemble(table: Table, source: &Path, dropped: Dropped, warnings: Vec<String>) -> Recording {
    let file =
        source.file_name().map_or_else(|| source.display().to_string(), |name| name.to_string_lossy().into_owned());
    let mut recording = Recording {
        source: source.to_path_buf(),
        columns: table.names,
        unknown: table.unknown,
        warnings: warnings.into_iter().map(|warning| format!("{file}: {warning}")).collect(),
        dropped,
        ..Recording::default()
    };
    for mut column in table.numbers {
        column.values.shrink_to_fit();
        recording.set_channel(column.channel, column.values);
    }
    recording
}
