//! Columns whose meaning is not known: kept as text, so that they can be written back as they were.
//!
//! Nothing here is interpreted. The texts of a column lie one after the other in one string: millions of short cells cost
//! their letters and eight bytes each.

/// A column that is not a `Channel`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct UnknownColumn {
    /// The name as it stands in the header; may be empty.
    pub name: String,
    /// One text a row.
    pub cells: Cells,
}

/// Texts, one a row.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Cells {
    text: String,
    ends: Vec<usize>,
}

impl Cells {
    /// Number of cells.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The text of a row; `None` past the end.
    #[must_use]
    pub fn get(&self, row: usize) -> Option<&str> {
        let end = *self.ends.get(row)?;
        let start = row.checked_sub(1).map_or(0, |before| self.ends[before]);
        self.text.get(start..end)
    }

    /// Adds a cell for the next row.
    pub fn push(&mut self, cell: &str) {
        self.text.push_str(cell);
        self.ends.push(self.text.len());
    }

    /// All cells, row by row.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        (0..self.len()).map_while(|row| self.get(row))
    }

    pub(crate) fn clear(&mut self) {
        self.text.clear();
        self.ends.clear();
    }

    pub(crate) fn truncate(&mut self, rows: usize) {
        if rows < self.len() {
            self.ends.truncate(rows);
            self.text.truncate(self.ends.last().copied().unwrap_or(0));
        }
    }

    pub(crate) fn append(&mut self, other: &Self) {
        let shift = self.text.len();
        self.text.push_str(&other.text);
        self.ends.extend(other.ends.iter().map(|end| end + shift));
    }
}

impl<S: AsRef<str>> FromIterator<S> for Cells {
    fn from_iter<I: IntoIterator<Item = S>>(cells: I) -> Self {
        let mut all = Self::default();
        for cell in cells {
            all.push(cell.as_ref());
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_come_back_as_they_went_in() {
        let cells: Cells = ["a", "", "°C"].into_iter().collect();
        assert_eq!(cells.iter().collect::<Vec<_>>(), ["a", "", "°C"]);
        assert_eq!(cells.get(3), None);
    }

    #[test]
    fn appended_and_truncated_cells_keep_their_rows() {
        let mut cells: Cells = ["a", "b"].into_iter().collect();
        cells.append(&["cd", "e"].into_iter().collect());
        assert_eq!(cells.get(2), Some("cd"));
        cells.truncate(3);
        cells.push("f");
        assert_eq!(cells.iter().collect::<Vec<_>>(), ["a", "b", "cd", "f"]);
    }
}
