//! All rows of a file as they were read, before any is dropped, with the place of each.
//!
//! A missing number is NaN here and counted; nothing else is judged.

use super::channel::Channel;
use super::dropped::Tally;
use super::error::Place;
use super::layout::Layout;
use super::unknown::UnknownColumn;

/// Missing numbers of a column.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Missing {
    pub(super) count: u64,
    /// Row of the first, from 0; of no meaning where `count` is zero.
    pub(super) first_row: usize,
}

impl Missing {
    pub(super) fn add(&mut self, row: usize) {
        if self.count == 0 {
            self.first_row = row;
        }
        self.count += 1;
    }

    /// Adds what was counted in later rows, the first of which is `shift`.
    pub(super) fn append(&mut self, later: Self, shift: usize) {
        if self.count == 0 && later.count > 0 {
            self.first_row = later.first_row + shift;
        }
        self.count += later.count;
    }
}

/// A channel and its values, one a row.
#[derive(Debug)]
pub(super) struct NumberColumn {
    pub(super) channel: Channel,
    pub(super) values: Vec<f64>,
    pub(super) missing: Missing,
}

/// The rows of a file.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) names: Vec<String>,
    pub(super) numbers: Vec<NumberColumn>,
    /// Channels of which the mapping names a column that is not there.
    pub(super) by_own_name: Vec<Channel>,
    pub(super) unknown: Vec<UnknownColumn>,
    pub(super) rows: usize,
    pub(super) places: Places,
    /// Place of the header.
    pub(super) header: Place,
    pub(super) blank_lines: Tally,
    /// The cut-off last row; it is not among the rows.
    pub(super) truncated: Option<Place>,
    /// The last row is there, but its line has no end.
    pub(super) unterminated: Option<Place>,
    /// Units that the file states for channels, as they are written.
    pub(super) units: Vec<(Channel, String)>,
    /// What the reader has to say besides.
    pub(super) warnings: Vec<String>,
}

impl Table {
    pub(super) fn new(layout: &Layout, header: Place, places: Places) -> Self {
        let number = |&channel: &Channel| NumberColumn { channel, values: vec![], missing: Missing::default() };
        let text = |name: &String| UnknownColumn { name: name.clone(), ..UnknownColumn::default() };
        Self {
            names: layout.names.clone(),
            numbers: layout.channels.iter().map(number).collect(),
            by_own_name: layout.by_own_name.clone(),
            unknown: layout.unknown.iter().map(text).collect(),
            rows: 0,
            places,
            header,
            blank_lines: Tally::default(),
            truncated: None,
            unterminated: None,
            units: vec![],
            warnings: vec![],
        }
    }
}

/// The place of each row: consecutive lines, but for the rows noted to be elsewhere.
#[derive(Debug)]
pub(super) enum Places {
    /// Row `n` is row `n` of the file.
    #[cfg_attr(not(any(feature = "hdf5", feature = "matlab", feature = "parquet")), expect(dead_code))]
    Rows,
    /// (row, its line), for each row that does not stand on the line after the row before it.
    Lines(Vec<(usize, u64)>),
}

impl Places {
    /// The place of a row, from 0.
    pub(super) fn of(&self, row: usize) -> Place {
        match self {
            Self::Rows => Place::Row(row as u64 + 1),
            Self::Lines(jumps) => {
                let after = jumps.partition_point(|&(first, _)| first <= row);
                let (first, line) = after.checked_sub(1).map_or((0, 1), |at| jumps[at]);
                Place::Line(line + (row - first) as u64)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_on_consecutive_lines_but_for_the_jumps() {
        let places = Places::Lines(vec![(0, 2), (3, 9)]);
        let lines: Vec<_> = (0..5).map(|row| places.of(row)).collect();
        assert_eq!(lines, [2, 3, 4, 9, 10].map(Place::Line));
    }
}
