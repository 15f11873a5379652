//! Recordings and campaigns: files in, columns of numbers out, and what is wrong with a file and where.
//!
//! A recording is read from CSV (RFC 4180 and its usual dialects), Parquet, MATLAB's `.mat` or HDF5, the last three by
//! features of their names, all on by default; all but Parquet as gzip has compressed them, too. Dirt that has one meaning is handled: rows without a time, a reference or
//! an angle, repeated time stamps and a cut-off last line are dropped, counted ([`Dropped`]) and said in
//! [`Recording::warnings`]. Dirt that could mean two things is refused with file, line and column ([`ReadError`]). No
//! value is ever changed or made up, and nothing here judges the instrument: spikes, rates and angles are the
//! identification's.
#![forbid(unsafe_code)]

mod admission;
mod arrays;
mod campaign;
mod channel;
mod columns;
mod csv;
mod dropped;
mod error;
mod gzip;
mod layout;
mod memory;
mod naming;
mod open;
mod parquet;
mod raw;
mod requirement;
mod stamp;
mod stated;
mod table;
mod text;
mod units;
mod unknown;
mod utf_16;

use std::path::PathBuf;

pub use campaign::{Campaign, Instrument, Reference, Role, Run, RunKind, Said, stem};
pub use channel::Channel;
pub use columns::Values;
pub use dropped::{Dropped, Tally};
pub use error::{Place, ReadError};
pub use memory::{limit_memory, memory_limit, panic_is_answer};
pub use naming::{Naming, mapped_name};
#[cfg(feature = "parquet")]
pub use parquet::{Lake, write_parquet, write_parquet_numbers};
pub use text::{LARGEST_TEXT, read_text};
pub use unknown::{Cells, UnknownColumn};

/// One recording: columns of equal length, one value a row.
///
/// As read, `t_s` is strictly increasing, and `t_s`, `rate_dps`, `table_deg`, `xc_v`, `xs_v`, `yc_v`, `ys_v`,
/// `theta_deg`, `x_v` and `y_v` are finite wherever they are there; `vas_v`, `vqc_v`, `virtual_dps`, `temp_c`, `fx_v` and `fy_v` are NaN
/// where the file has no number.
/// Angles are wrapped as in the file.
#[derive(Debug, Clone, Default)]
pub struct Recording {
    /// The file.
    pub source: PathBuf,
    /// Whether [`Recording::source`] is a name alone, as of standard input or of columns in memory, whatever file has it.
    pub in_memory: bool,
    /// Time, s.
    pub t_s: Vec<f64>,
    /// Input rate, commanded or measured, deg/s.
    pub rate_dps: Option<Vec<f64>>,
    /// Reference angle of the table, deg, any wrapping.
    pub table_deg: Option<Vec<f64>>,
    /// Readout of X, in phase, V.
    pub xc_v: Option<Vec<f64>>,
    /// Readout of X, in quadrature, V.
    pub xs_v: Option<Vec<f64>>,
    /// Readout of Y, in phase, V.
    pub yc_v: Option<Vec<f64>>,
    /// Readout of Y, in quadrature, V.
    pub ys_v: Option<Vec<f64>>,
    /// The instrument's own angle, deg, any wrapping.
    pub theta_deg: Option<Vec<f64>>,
    /// [`Recording::theta_deg`] is the integral over time of rates that were recorded, by the trapezoidal rule.
    pub theta_is_integral: bool,
    /// Output of the energy controller, V.
    pub vas_v: Option<Vec<f64>>,
    /// Output of the quadrature controller, V.
    pub vqc_v: Option<Vec<f64>>,
    /// Precession that the instrument's own forces were commanded to make, deg/s of the pattern.
    pub virtual_dps: Option<Vec<f64>>,
    /// Temperature, °C.
    pub temp_c: Option<Vec<f64>>,
    /// Displacement of X itself, at several points a period of the carrier, in any unit.
    pub x_v: Option<Vec<f64>>,
    /// Displacement of Y itself.
    pub y_v: Option<Vec<f64>>,
    /// Force on X itself, V.
    pub fx_v: Option<Vec<f64>>,
    /// Force on Y itself, V.
    pub fy_v: Option<Vec<f64>>,
    /// Frequency that the envelope refers to, Hz, where it was demodulated from `x_v` and `y_v`.
    pub reference_hz: Option<f64>,
    /// The unit of the readout, where the file states one that is not of volts: counts, a field.
    pub readout_unit: Option<String>,
    /// Columns of unknown meaning, in the order of the file.
    pub unknown: Vec<UnknownColumn>,
    /// Names of all columns in the order in which they are written: first those named here, then the others that are
    /// there, in the order of [`Channel::ALL`]. A name without a column is passed over.
    pub columns: Vec<String>,
    /// What a reader of the result should know of the file; each names the file.
    pub warnings: Vec<String>,
    /// What became of the rows of the file.
    pub dropped: Dropped,
}

impl Recording {
    /// The values of a channel, one a row; `None` where the recording has no such column.
    #[must_use]
    pub fn channel(&self, channel: Channel) -> Option<&[f64]> {
        let column = match channel {
            Channel::Time => return Some(&self.t_s),
            Channel::Rate => &self.rate_dps,
            Channel::Table => &self.table_deg,
            Channel::Xc => &self.xc_v,
            Channel::Xs => &self.xs_v,
            Channel::Yc => &self.yc_v,
            Channel::Ys => &self.ys_v,
            Channel::Theta => &self.theta_deg,
            Channel::Vas => &self.vas_v,
            Channel::Vqc => &self.vqc_v,
            Channel::Virtual => &self.virtual_dps,
            Channel::Temperature => &self.temp_c,
            Channel::X => &self.x_v,
            Channel::Y => &self.y_v,
            Channel::Fx => &self.fx_v,
            Channel::Fy => &self.fy_v,
        };
        column.as_deref()
    }

    /// Puts values in the place of a channel's, in its unit. The caller sees to equal lengths.
    pub fn set_channel(&mut self, channel: Channel, values: Vec<f64>) {
        let column = match channel {
            Channel::Time => {
                self.t_s = values;
                return;
            }
            Channel::Rate => &mut self.rate_dps,
            Channel::Table => &mut self.table_deg,
            Channel::Xc => &mut self.xc_v,
            Channel::Xs => &mut self.xs_v,
            Channel::Yc => &mut self.yc_v,
            Channel::Ys => &mut self.ys_v,
            Channel::Theta => &mut self.theta_deg,
            Channel::Vas => &mut self.vas_v,
            Channel::Vqc => &mut self.vqc_v,
            Channel::Virtual => &mut self.virtual_dps,
            Channel::Temperature => &mut self.temp_c,
            Channel::X => &mut self.x_v,
            Channel::Y => &mut self.y_v,
            Channel::Fx => &mut self.fx_v,
            Channel::Fy => &mut self.fy_v,
        };
        *column = Some(values);
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there are no rows; never so for a recording that was read.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }

    /// Names of the columns that are there, in the order in which they are written.
    pub fn column_names(&self) -> impl Iterator<Item = &str> {
        self.outlets().into_iter().map(|(name, _)| name)
    }

    /// The columns to write, in order.
    fn outlets(&self) -> Vec<(&str, Outlet<'_>)> {
        let mut outlets: Vec<(&str, Outlet<'_>)> = vec![];
        let mut channels: Vec<Channel> = vec![];
        let mut unknown: Vec<usize> = vec![];
        let numbers = |channel: Channel| self.channel(channel).map(|values| (channel.name(), Outlet::Numbers(values)));
        for name in &self.columns {
            if let Some(channel) = Channel::of(name) {
                if !channels.contains(&channel) {
                    channels.push(channel);
                    outlets.extend(numbers(channel));
                }
            } else if let Some(at) =
                (0..self.unknown.len()).find(|at| !unknown.contains(at) && self.unknown[*at].name == *name)
            {
                unknown.push(at);
                outlets.push((&self.unknown[at].name, Outlet::Texts(&self.unknown[at].cells)));
            }
        }
        outlets.extend(Channel::ALL.into_iter().filter(|channel| !channels.contains(channel)).filter_map(numbers));
        let others = self.unknown.iter().enumerate().filter(|(at, _)| !unknown.contains(at));
        outlets.extend(others.map(|(_, column)| (column.name.as_str(), Outlet::Texts(&column.cells))));
        outlets
    }

    /// The columns to write, after a check that all have one value a row.
    fn even_outlets(&self) -> std::io::Result<Vec<(&str, Outlet<'_>)>> {
        let outlets = self.outlets();
        for (name, outlet) in &outlets {
            let (found, rows) = (outlet.len(), self.len());
            if found != rows {
                let what = format!("column `{name}` has {found} values, `t_s` has {rows}; wanted one a row");
                return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, what));
            }
        }
        Ok(outlets)
    }
}

/// A column to be written.
#[derive(Debug, Clone, Copy)]
enum Outlet<'a> {
    Numbers(&'a [f64]),
    Texts(&'a Cells),
}

impl Outlet<'_> {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Texts(cells) => cells.len(),
        }
    }
}
