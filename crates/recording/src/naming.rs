//! What the columns of a foreign file are called here: `theta_deg=Ch3`, `t_s=Time*0.001`.
//!
//! A name that is not mapped keeps its own meaning. Values are scaled only where the mapping says so.

use std::path::Path;

use super::Recording;
use super::channel::Channel;
use super::error::ReadError;
use super::requirement::in_words;

/// Which columns of a file are which channels, besides those that have a channel's own name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Naming {
    entries: Vec<Entry>,
}

#[derive(Debug, Clone, PartialEq)]
struct Entry {
    channel: Channel,
    column: String,
    scale: f64,
}

impl Naming {
    /// No mapping: columns mean what their names say.
    pub const NONE: &'static Self = &Self { entries: Vec::new() };

    /// Adds `CHANNEL=COLUMN` or `CHANNEL=COLUMN*FACTOR`, the factor taking the column's unit to the channel's.
    ///
    /// # Errors
    /// What is wrong with it, and what would be right.
    pub fn add(&mut self, text: &str) -> Result<(), String> {
        let Some((channel, column)) = text.split_once('=') else {
            return Err(format!("`{text}` has no `=`; wanted CHANNEL=COLUMN, as in theta_deg=Ch3"));
        };
        let Some(channel) = Channel::of(channel) else {
            let names = in_words(Channel::ALL.into_iter().map(Channel::name));
            return Err(format!("`{}` is no channel; wanted one of {names}", channel.trim()));
        };
        let factored = column.rsplit_once('*').and_then(|(c, f)| Some((c, f.trim().parse::<f64>().ok()?)));
        let (column, scale) = factored.unwrap_or((column, 1.0));
        let column = column.trim().to_owned();
        if column.is_empty() {
            return Err(format!("`{text}` names no column; wanted CHANNEL=COLUMN, as in theta_deg=Ch3"));
        }
        if !scale.is_finite() || scale == 0.0 || (channel == Channel::Time && scale < 0.0) {
            return Err(format!("`{text}`: the factor {scale} is none; wanted one like 0.001"));
        }
        if self.entries.iter().any(|e| e.channel == channel) {
            return Err(format!("`{channel}` is mapped twice"));
        }
        if self.entries.iter().any(|e| e.column.eq_ignore_ascii_case(&column)) {
            return Err(format!("`{column}` is mapped twice"));
        }
        self.entries.push(Entry { channel, column, scale });
        Ok(())
    }

    /// This mapping, and that of `other` where this one says nothing.
    #[must_use]
    pub fn over(&self, other: &Self) -> Self {
        let mut both = self.clone();
        let free = |e: &&Entry| {
            !self.entries.iter().any(|own| own.channel == e.channel || own.column.eq_ignore_ascii_case(&e.column))
        };
        both.entries.extend(other.entries.iter().filter(free).cloned());
        both
    }

    /// The channel of a column.
    pub(super) fn channel(&self, name: &str) -> Option<Channel> {
        let name = name.trim();
        let mapped = self.entries.iter().find(|e| e.column.eq_ignore_ascii_case(name));
        mapped.map(|e| e.channel).or_else(|| Channel::of(name))
    }

    /// Refuses a file that lacks a mapped column and has nothing of the channel's own name in its place.
    pub(super) fn require<'a>(
        &self,
        channels: &[Channel],
        present: impl IntoIterator<Item = &'a str>,
        source: &Path,
    ) -> Result<(), ReadError> {
        let Some(lacking) = self.entries.iter().find(|e| !channels.contains(&e.channel)) else { return Ok(()) };
        Err(ReadError::MappedColumn {
            path: source.to_path_buf(),
            channel: lacking.channel,
            column: lacking.column.clone(),
            present: in_words(present),
        })
    }

    /// Takes the units of mapped columns to those of their channels.
    pub(super) fn scale(&self, recording: &mut Recording) {
        for e in self.entries.iter().filter(|e| e.scale != 1.0) {
            let scaled = recording.channel(e.channel).map(|values| values.iter().map(|v| v * e.scale).collect());
            if let Some(values) = scaled {
                recording.set_channel(e.channel, values);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mapping_that_cannot_be_meant_is_refused_with_what_would_be_right() {
        let mut naming = Naming::default();
        assert_eq!(naming.add("theta_deg=Ch3"), Ok(()));
        for (text, of) in [
            ("theta_deg", "no `=`"),
            ("angle=Ch4", "no channel"),
            ("xc_v=", "no column"),
            ("theta_deg=Ch5", "mapped twice"),
            ("xc_v=ch3", "mapped twice"),
            ("t_s=Time*-1", "factor"),
            ("xc_v=Ch1*0", "factor"),
        ] {
            assert!(naming.add(text).is_err_and(|e| e.contains(of)), "{text}: {:?}", naming.add(text));
        }
    }

    #[test]
    fn a_mapped_name_stands_before_a_channels_own() {
        let mut naming = Naming::default();
        naming.add("table_deg=rate_dps").expect("a mapping");
        assert_eq!(naming.channel("Rate_dps "), Some(Channel::Table));
        assert_eq!(naming.channel("xc_v"), Some(Channel::Xc));
        assert_eq!(naming.channel("Ch1"), None);
    }

    #[test]
    fn what_is_said_last_stands_over_what_was_said_before() {
        let [mut file, mut line] = [Naming::default(), Naming::default()];
        for entry in ["t_s=Time*0.001", "xc_v=A", "yc_v=B"] {
            file.add(entry).expect("a mapping");
        }
        line.add("xc_v=B").expect("a mapping");
        let both = line.over(&file);
        assert_eq!(both.channel("B"), Some(Channel::Xc), "B is no longer Y");
        assert_eq!((both.channel("A"), both.channel("Time")), (None, Some(Channel::Time)));
    }
}
