//! The header of a recording, understood: which column is which channel, and which is none.
//!
//! Refuses double names and headers without a time and an angle. Knows nothing of how a file is written.

use std::path::Path;

use super::channel::Channel;
use super::error::ReadError;
use super::naming::Naming;
use super::requirement;

/// What a column of the file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    /// Numbers of a channel, by their place in [`Layout::channels`].
    Number(usize),
    /// Texts that are kept as they are, by their place in [`Layout::unknown`].
    Text(usize),
}

/// The columns of a file in their order.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    /// Names in the order of the file: a channel's own name, others as they are written.
    pub(super) names: Vec<String>,
    /// What each of these columns holds.
    pub(super) fields: Vec<Field>,
    /// The channels, in the order of the file.
    pub(super) channels: Vec<Channel>,
    /// Channels whose mapped column is not there: the one of the channel's own name stands for it, in the channel's unit.
    pub(super) by_own_name: Vec<Channel>,
    /// The names of the other columns, in the order of the file.
    pub(super) unknown: Vec<String>,
    /// Whether rows may end before the last column.
    pub(super) is_last_optional: bool,
}

impl Layout {
    /// Understands the names in a header. Nameless columns are unknown columns, and may be many.
    pub(super) fn new<S: AsRef<str>>(header: &[S], naming: &Naming, source: &Path) -> Result<Self, ReadError> {
        let mut layout = Self {
            names: vec![],
            fields: vec![],
            channels: vec![],
            by_own_name: vec![],
            unknown: vec![],
            is_last_optional: false,
        };
        for name in header {
            let name = name.as_ref().trim();
            if let Some(channel) = naming.channel(name) {
                layout.fields.push(Field::Number(layout.channels.len()));
                layout.channels.push(channel);
                layout.names.push(channel.name().to_owned());
                if naming.is_of_another(channel, name) {
                    layout.by_own_name.push(channel);
                }
            } else {
                layout.fields.push(Field::Text(layout.unknown.len()));
                layout.unknown.push(name.to_owned());
                layout.names.push(name.to_owned());
            }
        }
        layout.refuse_duplicates(source)?;
        naming.require(&layout.channels, layout.names.iter().map(String::as_str), source)?;
        if requirement::holds_an_angle(|channel| layout.channels.contains(&channel)) {
            return Ok(layout);
        }
        Err(ReadError::MissingColumns {
            path: source.to_path_buf(),
            needed_for: "a recording",
            needed: requirement::angle_in_words(),
            present: requirement::in_words(layout.names.iter().map(String::as_str)),
        })
    }

    fn refuse_duplicates(&self, source: &Path) -> Result<(), ReadError> {
        let mut seen = std::collections::HashMap::new();
        for (number, name) in (1..).zip(&self.names) {
            if name.is_empty() {
                continue;
            }
            if let Some(first) = seen.insert(name.to_lowercase(), number) {
                return Err(ReadError::DuplicateColumn {
                    path: source.to_path_buf(),
                    name: name.clone(),
                    first,
                    second: number,
                });
            }
        }
        Ok(())
    }
}
