//! What LabVIEW's measurement files (`.lvm`) say above their header that matters to the rows.
//!
//! A line is a tag and what it says, separated as the rows are. Of all tags the units of the columns are taken, and that
//! there is one: then the last column, `Comment`, is filled in some of the rows alone.

use super::head::Head;
use crate::layout::Field;

/// What the last line of LabVIEW's begins with.
pub(super) const END_OF_PREAMBLE: &[u8] = b"***End_of_Header***";

/// Tags of the lines above a header.
#[derive(Debug, Default)]
pub(super) struct Preamble {
    is_labview: bool,
    /// Units of the columns after that of time.
    units: Vec<String>,
}

impl Preamble {
    /// Takes in a line.
    pub(super) fn read(&mut self, line: &[u8]) {
        self.is_labview |= line.starts_with(END_OF_PREAMBLE);
        let text = String::from_utf8_lossy(line);
        let mut fields = text.trim_end_matches(['\r', '\n']).split(['\t', ';', ',']).map(str::trim);
        if fields.next() == Some("Y_Unit_Label") {
            self.units = fields.map(str::to_owned).collect();
        }
    }

    /// Tells a head what it says.
    pub(super) fn tell(self, head: &mut Head) {
        if !self.is_labview {
            return;
        }
        let layout = &mut head.layout;
        layout.is_last_optional = layout.names.last().is_some_and(|name| name.eq_ignore_ascii_case("comment"));
        // the first column is the time, in seconds
        for (field, unit) in layout.fields.iter().skip(1).zip(self.units) {
            if let (Field::Number(at), false) = (field, unit.is_empty()) {
                head.units.push((layout.channels[*at], unit));
            }
        }
    }
}
