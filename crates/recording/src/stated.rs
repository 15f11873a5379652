//! Units that a recording states where it is written, so that what reads it takes none for another: of temperatures above
//! 230 °C, which would be taken for K, of times that count from 1970, and of a readout that is not in volts.

use crate::{Channel, Outlet, Recording, units};

/// In Parquet a unit stands in the metadata of the file under this and the name of its column.
const PREFIX: &str = "unit:";

/// The name under which the metadata of a Parquet file has the unit of a column.
pub(crate) fn key(column: &str) -> String {
    format!("{PREFIX}{column}")
}

/// The column whose unit stands under a name in the metadata of a Parquet file.
pub(crate) fn column(key: &str) -> Option<&str> {
    key.strip_prefix(PREFIX)
}

impl Recording {
    /// The unit of each of these columns, `-` where none is known, if one of them has to be stated.
    pub(crate) fn stated_units(&self, outlets: &[(&str, Outlet<'_>)]) -> Option<Vec<&str>> {
        let has_to_be = |(name, outlet): &(&str, Outlet<'_>)| is_taken_for_another(name, outlet);
        let readout = self.readout_unit.is_some() && outlets.iter().any(|(name, _)| is_of_the_readout(name));
        let is_stated = readout || outlets.iter().any(has_to_be);
        is_stated.then(|| outlets.iter().map(|(name, _)| self.unit(name)).collect())
    }

    fn unit(&self, name: &str) -> &str {
        match channel(name) {
            None | Some(Channel::X | Channel::Y) => "-",
            Some(_) if is_of_the_readout(name) => self.readout_unit.as_deref().unwrap_or("V"),
            Some(channel) => units::of_channel(channel),
        }
    }
}

/// A column that would be read in another unit if it stated none.
fn is_taken_for_another(name: &str, outlet: &Outlet<'_>) -> bool {
    let Outlet::Numbers(values) = outlet else { return false };
    match channel(name) {
        Some(Channel::Time) => {
            values.iter().copied().find(|t| t.is_finite()).is_some_and(|t| units::since_1970(t).is_some())
        }
        Some(Channel::Temperature) => units::absolute(values).is_some(),
        _ => false,
    }
}

fn is_of_the_readout(name: &str) -> bool {
    matches!(channel(name), Some(Channel::Xc | Channel::Xs | Channel::Yc | Channel::Ys))
}

fn channel(name: &str) -> Option<Channel> {
    Channel::ALL.into_iter().find(|c| c.name() == name)
}
