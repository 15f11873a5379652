//! What LabVIEW's measurement files (`.lvm`) say above their header that matters to the rows.
//!
//! A line is a tag and what it says, separated as the rows are. Of all tags the units of the columns are taken, and that
//! there is one: then the last column, `Comment`, is filled in some of the rows alone. `X_Columns` says whether the times are
//! written: `No` leaves their column empty, and they follow from `X0` and `Delta_X`; `Multi` writes them beside each column.

use super::head::Head;
use crate::channel::Channel;
use crate::layout::Field;

/// What the last line of LabVIEW's begins with.
pub(super) const END_OF_PREAMBLE: &[u8] = b"***End_of_Header***";

/// Tags of the lines above a header.
#[derive(Debug, Default)]
pub(super) struct Preamble {
    is_labview: bool,
    /// Units of the columns after that of time.
    units: Vec<String>,
    /// What `X_Columns` says, and `X0` and `Delta_X` of each column.
    times: String,
    first: Vec<f64>,
    step: Vec<f64>,
}

/// The name that LabVIEW gives its times.
pub(super) const TIMES: &str = "X_Value";

impl Preamble {
    /// Takes in a line.
    pub(super) fn read(&mut self, line: &[u8]) {
        self.is_labview |= line.starts_with(END_OF_PREAMBLE);
        let text = String::from_utf8_lossy(line);
        // a comma may be that of a number
        let separators: &[char] = match text.contains('\t') {
            true => &['\t'],
            false => &[';', ','],
        };
        let mut fields = text.trim_end_matches(['\r', '\n']).split(separators).map(str::trim);
        let numbers = |fields: &mut dyn Iterator<Item = &str>| -> Vec<f64> {
            fields.filter_map(|field| field.replace(',', ".").parse().ok()).collect()
        };
        match fields.next() {
            Some("Y_Unit_Label") => self.units = fields.map(str::to_owned).collect(),
            Some("X_Columns") => self.times = fields.next().unwrap_or_default().to_owned(),
            Some("X0") => self.first = numbers(&mut fields),
            Some("Delta_X") => self.step = numbers(&mut fields),
            _ => {}
        }
    }

    /// Tells a head what it says, or why the rows are no recording.
    pub(super) fn tell(self, head: &mut Head) -> Result<(), String> {
        if !self.is_labview {
            return Ok(());
        }
        let is = |word: &str| self.times.eq_ignore_ascii_case(word);
        let is_one = |values: &[f64]| values.windows(2).all(|pair| pair[0] == pair[1]);
        if (is("No") || is("Multi")) && !(is_one(&self.first) && is_one(&self.step)) {
            return Err(format!("X_Columns is {}, and X0 or Delta_X differ from column to column", self.times));
        }
        if is("No") && head.layout.channels.contains(&Channel::Time) {
            match (self.first.first(), self.step.first()) {
                (Some(first), Some(step)) if *step > 0.0 => head.even_times = Some((*first, *step)),
                _ => return Err("X_Columns is No, and there is no X0 with a Delta_X above zero".to_owned()),
            }
        }
        let layout = &mut head.layout;
        layout.is_last_optional = layout.names.last().is_some_and(|name| name.eq_ignore_ascii_case("comment"));
        // the first column is the time, in seconds
        for (field, unit) in layout.fields.iter().skip(1).zip(self.units) {
            if let (Field::Number(at), false) = (field, unit.is_empty()) {
                head.units.push((layout.channels[*at], unit));
            }
        }
        Ok(())
    }
}
