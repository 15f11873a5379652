//! The columns that a recording can have: their names, units and meaning.
//!
//! This is the one place that knows the names. It does not say which of them a run needs (`requirement.rs`) and holds no data.

use std::fmt;

/// A column of a recording whose meaning is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Channel {
    /// `t_s`: time, s.
    Time,
    /// `rate_dps`: input rate, commanded or measured, deg/s.
    Rate,
    /// `table_deg`: reference angle of the table, deg, any wrapping.
    Table,
    /// `xc_v`: demodulated readout of X, in phase, V.
    Xc,
    /// `xs_v`: demodulated readout of X, in quadrature, V.
    Xs,
    /// `yc_v`: demodulated readout of Y, in phase, V.
    Yc,
    /// `ys_v`: demodulated readout of Y, in quadrature, V.
    Ys,
    /// `theta_deg`: the instrument's own angle, deg, any wrapping.
    Theta,
    /// `vas_v`: output of the energy controller, V.
    Vas,
    /// `vqc_v`: output of the quadrature controller, V.
    Vqc,
    /// `virtual_dps`: precession that the instrument's own forces are commanded to make, deg/s of the pattern.
    Virtual,
    /// `temp_c`: temperature, °C.
    Temperature,
    /// `x_v`: displacement of X itself, carrier and all, in any unit.
    X,
    /// `y_v`: displacement of Y itself, carrier and all, in the unit of X.
    Y,
    /// `fx_v`: force on X itself, V.
    Fx,
    /// `fy_v`: force on Y itself, V.
    Fy,
}

impl Channel {
    /// All channels, in the order in which a recording is written that was not read from a file.
    pub const ALL: [Self; 16] = [
        Self::Time,
        Self::Rate,
        Self::Table,
        Self::Xc,
        Self::Xs,
        Self::Yc,
        Self::Ys,
        Self::Theta,
        Self::Vas,
        Self::Vqc,
        Self::Virtual,
        Self::Temperature,
        Self::X,
        Self::Y,
        Self::Fx,
        Self::Fy,
    ];

    /// The column name, unit included.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Time => "t_s",
            Self::Rate => "rate_dps",
            Self::Table => "table_deg",
            Self::Xc => "xc_v",
            Self::Xs => "xs_v",
            Self::Yc => "yc_v",
            Self::Ys => "ys_v",
            Self::Theta => "theta_deg",
            Self::Vas => "vas_v",
            Self::Vqc => "vqc_v",
            Self::Virtual => "virtual_dps",
            Self::Temperature => "temp_c",
            Self::X => "x_v",
            Self::Y => "y_v",
            Self::Fx => "fx_v",
            Self::Fy => "fy_v",
        }
    }

    /// The channel of a column name; case and surrounding blanks do not matter.
    #[must_use]
    pub fn of(name: &str) -> Option<Self> {
        let name = name.trim();
        Self::ALL.into_iter().find(|channel| channel.name().eq_ignore_ascii_case(name))
    }

    /// Whether a row without this value is of no use.
    ///
    /// True for the time, the reference (`rate_dps`, `table_deg`) and the angle (`xc_v`, `xs_v`, `yc_v`, `ys_v`,
    /// `theta_deg`, `x_v`, `y_v`): a row with a missing cell in one of these is dropped. False for controller outputs,
    /// forces and temperature: there a missing cell is NaN.
    #[must_use]
    pub const fn is_needed_in_every_row(self) -> bool {
        !matches!(self, Self::Vas | Self::Vqc | Self::Virtual | Self::Temperature | Self::Fx | Self::Fy)
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_found_whatever_its_case_and_blanks() {
        assert_eq!(Channel::of(" XC_V "), Some(Channel::Xc));
        assert_eq!(Channel::of("xc"), None);
    }

    #[test]
    fn every_channel_is_found_by_its_own_name() {
        for channel in Channel::ALL {
            assert_eq!(Channel::of(channel.name()), Some(channel));
        }
    }
}
