//! What the columns of a foreign file are called here: `theta_deg=Ch3`, `t_s=Time*0.001`, `t_s=Time/1000`.
//!
//! A name that is not mapped keeps its own meaning. Values are scaled where the mapping says so; where it says nothing, by
//! the unit that stands in brackets at the end of a mapped name.

use std::path::Path;

use super::channel::Channel;
use super::error::ReadError;
use super::requirement::in_words;
use super::units::{self, Conversion};

/// Which columns of a file are which channels, besides those that have a channel's own name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Naming {
    entries: Vec<Entry>,
}

#[derive(Debug, Clone, PartialEq)]
struct Entry {
    channel: Channel,
    column: String,
    /// The factor that the mapping states, be it 1.
    scale: Option<f64>,
    /// The column is a rate, and its integral over time the channel.
    is_rate: bool,
}

impl Naming {
    /// No mapping: columns mean what their names say.
    pub const NONE: &'static Self = &Self { entries: Vec::new() };

    /// Adds `CHANNEL=COLUMN`, `CHANNEL=COLUMN*FACTOR` or `CHANNEL=COLUMN/DIVISOR`, which takes the column's unit to the
    /// channel's. A column whose own name ends like this is meant by `CHANNEL=COLUMN*1`. An angle may be the integral over
    /// time of a rate in deg/s: `theta_deg=integral(COLUMN)`.
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
        let (column, mut scale) = factored(column);
        let rate = column.strip_prefix("integral(").and_then(|rate| rate.strip_suffix(')')).map(str::trim);
        if rate.is_some() && !matches!(channel, Channel::Theta | Channel::Table) {
            return Err(format!(
                "`{text}`: an integral over time is an angle; wanted theta_deg or table_deg before the `=`"
            ));
        }
        let (column, within) = rate.map_or((column, None), factored);
        if within.is_some() {
            scale = Some(scale.unwrap_or(1.0) * within.unwrap_or(1.0));
        }
        let column = column.to_owned();
        if column.is_empty() {
            return Err(format!("`{text}` names no column; wanted CHANNEL=COLUMN, as in theta_deg=Ch3"));
        }
        if let Some(none) = scale.filter(|&s| !s.is_finite() || s == 0.0 || (channel == Channel::Time && s < 0.0)) {
            return Err(format!("`{text}`: the factor {none} is none; wanted one like 0.001"));
        }
        if self.entries.iter().any(|e| e.channel == channel) {
            return Err(format!("`{channel}` is mapped twice"));
        }
        if self.entries.iter().any(|e| e.column.eq_ignore_ascii_case(&column)) {
            return Err(format!("`{column}` is mapped twice"));
        }
        self.entries.push(Entry { channel, column, scale, is_rate: rate.is_some() });
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

    /// The channels that `other` maps and that go without in [`Naming::over`], since this one gives their columns to others; with
    /// their columns.
    pub fn taken_from<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = (Channel, &'a str)> {
        let is_taken = |e: &&Entry| {
            !self.entries.iter().any(|own| own.channel == e.channel)
                && self.entries.iter().any(|own| own.column.eq_ignore_ascii_case(&e.column))
        };
        other.entries.iter().filter(is_taken).map(|e| (e.channel, e.column.as_str()))
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

    /// Whether a channel is mapped to another column than this one.
    pub(super) fn is_of_another(&self, channel: Channel, name: &str) -> bool {
        self.column(channel).is_some_and(|column| !column.eq_ignore_ascii_case(name.trim()))
    }

    /// This mapping without what it says of these channels: factors and units are of columns that are not there.
    pub(super) fn without(&self, channels: &[Channel]) -> Self {
        Self { entries: self.entries.iter().filter(|e| !channels.contains(&e.channel)).cloned().collect() }
    }

    /// The factor that the mapping states for a channel.
    pub(super) fn factor(&self, channel: Channel) -> Option<f64> {
        self.entries.iter().find(|e| e.channel == channel)?.scale
    }

    /// What a mapped column is called.
    pub(super) fn column(&self, channel: Channel) -> Option<&str> {
        self.entries.iter().find(|e| e.channel == channel).map(|e| e.column.as_str())
    }

    /// Whether a channel is the integral over time of what its column holds.
    pub(super) fn is_integral(&self, channel: Channel) -> bool {
        self.entries.iter().any(|e| e.channel == channel && e.is_rate)
    }

    /// The channel in whose unit a column has to be.
    pub(super) fn wanted(&self, channel: Channel) -> Channel {
        if self.is_integral(channel) { Channel::Rate } else { channel }
    }

    /// What stands in brackets at the end of a mapped name and is no unit that is known.
    pub(super) fn unknown_unit(&self, channel: Channel) -> Option<&str> {
        let unit = units::in_brackets(self.column(channel)?)?;
        units::conversion(self.wanted(channel), unit).is_none().then_some(unit)
    }

    /// The unit that a mapped name ends with, and what takes it to the channel's; `None` where there is none that is known.
    pub(super) fn unit(&self, channel: Channel) -> Option<(&str, Conversion)> {
        let unit = units::in_brackets(self.column(channel)?)?;
        Some((unit, units::conversion(self.wanted(channel), unit)?))
    }
}

/// What maps a column, as it is written in a mapping: a name that ends like a factor wants one of its own behind it.
#[must_use]
pub fn mapped_name(column: &str) -> String {
    if factored(column).1.is_some() { format!("{column}*1") } else { column.to_owned() }
}

/// What to say of a column that is not there and looks like one with a factor: there was another behind it.
pub(crate) fn one_factor(column: &str) -> String {
    let (name, factor) = factored(column);
    factor.map_or(String::new(), |_| format!(" (a mapping takes one factor or one divisor, as in `{name}*0.5`)"))
}

/// A column, and the number that it is multiplied by or, as a reciprocal, divided by.
fn factored(text: &str) -> (&str, Option<f64>) {
    let number = text.rfind(['*', '/']).and_then(|at| {
        let number = text[at + 1..].trim().parse::<f64>().ok()?;
        Some((text[..at].trim(), if text[at..].starts_with('*') { number } else { number.recip() }))
    });
    number.map_or((text.trim(), None), |(column, scale)| (column, Some(scale)))
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
            ("xc_v=Ch1/0", "factor"),
            ("xc_v=integral(Ch1)", "an integral over time is an angle"),
        ] {
            assert!(naming.add(text).is_err_and(|e| e.contains(of)), "{text}: {:?}", naming.add(text));
        }
    }

    #[test]
    fn a_channel_whose_column_goes_to_another_is_told() {
        let naming = |entries: &[&str]| {
            let mut naming = Naming::default();
            entries.iter().for_each(|entry| assert_eq!(naming.add(entry), Ok(())));
            naming
        };
        let filed = naming(&["t_s=Time", "vas_v=PID1", "vqc_v=PID2"]);
        let taken = |entries: &[&str]| naming(entries).taken_from(&filed).map(|(c, _)| c.name()).collect::<Vec<_>>();
        assert_eq!(taken(&["vas_v=PID2"]), ["vqc_v"]);
        assert_eq!(taken(&["vas_v=PID2", "vqc_v=PID1"]), [""; 0]);
        assert_eq!(taken(&["vas_v=PID3"]), [""; 0]);
    }

    #[test]
    fn a_column_may_be_multiplied_or_divided() {
        let mut naming = Naming::default();
        for entry in ["t_s=Time/1000", "xc_v=a*b * 2", "yc_v=rad/s", "temp_c=x/2*1"] {
            assert_eq!(naming.add(entry), Ok(()), "{entry}");
        }
        let of = |channel| (naming.column(channel).expect("mapped"), naming.factor(channel));
        assert_eq!(of(Channel::Time), ("Time", Some(0.001)));
        assert_eq!(of(Channel::Xc), ("a*b", Some(2.0)));
        assert_eq!(of(Channel::Yc), ("rad/s", None), "what is no number is part of the name");
        assert_eq!(of(Channel::Temperature), ("x/2", Some(1.0)));
    }

    #[test]
    fn a_name_that_ends_like_a_factor_is_mapped_with_one_of_its_own() {
        for column in ["Time/1000", "x*2", "Time (ms)", "rad/s"] {
            let mut naming = Naming::default();
            naming.add(&format!("t_s={}", mapped_name(column))).expect("a mapping");
            assert_eq!(naming.channel(column), Some(Channel::Time), "{column}");
        }
        assert_eq!(mapped_name("Time (ms)"), "Time (ms)");
    }

    #[test]
    fn a_rate_may_have_its_factor_within_the_integral_or_behind_it() {
        for entry in ["theta_deg=integral(gz*0.25)", "theta_deg = integral( gz / 4 )", "theta_deg=integral(gz)*0.25"] {
            let mut naming = Naming::default();
            assert_eq!(naming.add(entry), Ok(()), "{entry}");
            assert_eq!(
                (naming.column(Channel::Theta), naming.factor(Channel::Theta)),
                (Some("gz"), Some(0.25)),
                "{entry}"
            );
            assert!(naming.is_integral(Channel::Theta));
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
