//! What was read, what was kept, and what was not: counts with the place of the first.
//!
//! Counting only. The reasons to drop are in `admission.rs` and in the readers.

use super::channel::Channel;
use super::error::Place;

/// How often something happened, and where first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// How often.
    pub count: u64,
    /// Where first; `None` exactly when `count` is zero.
    pub first: Option<Place>,
}

impl Tally {
    /// Counts one more.
    pub(crate) fn add(&mut self, place: Place) {
        self.count += 1;
        self.first.get_or_insert(place);
    }

    /// Whether nothing was counted.
    #[must_use]
    pub const fn is_zero(&self) -> bool {
        self.count == 0
    }
}

/// What became of the rows of a file: `rows_read` is `rows_kept` plus the counts of the three reasons to drop a row.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Rows in the file, without header, comments and blank lines.
    pub rows_read: u64,
    /// Rows in the recording.
    pub rows_kept: u64,
    /// Rows dropped because the time, the reference or the angle is empty, NaN or infinite.
    pub empty_or_nan: Tally,
    /// Rows dropped because an earlier row has the same time.
    pub repeated_time: Tally,
    /// The last row, dropped because it is cut off.
    pub truncated_last_line: Tally,
    /// Lines with nothing in them, or a remark that begins with `#` or `%`; they are not rows.
    pub blank_lines: Tally,
    /// Rows kept with a NaN where a controller output or the temperature is empty, NaN or infinite, by column. Counted
    /// over all rows of the file.
    pub missing_values: Vec<(Channel, Tally)>,
}

impl Dropped {
    /// Rows in the file that are not in the recording.
    #[must_use]
    pub const fn rows_dropped(&self) -> u64 {
        self.empty_or_nan.count + self.repeated_time.count + self.truncated_last_line.count
    }
}
