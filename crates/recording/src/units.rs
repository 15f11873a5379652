//! Units as people write them beside their columns, and what takes them to the unit of a channel.
//!
//! A unit stands in a row below the header, or in brackets at the end of a mapped name: `Time (ms)`. Nothing that is
//! written is passed over: it is the channel's unit, becomes a conversion that is said, or is refused. A factor in the
//! mapping stands over all of it.

use super::channel::Channel;

/// What takes a value to the unit of its channel: value · factor + offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Conversion {
    pub(crate) factor: f64,
    pub(crate) offset: f64,
}

impl Conversion {
    /// The unit is the channel's.
    pub(crate) const NONE: Self = Self::by(1.0);

    /// A factor alone.
    pub(crate) const fn by(factor: f64) -> Self {
        Self { factor, offset: 0.0 }
    }

    pub(crate) fn of(self, value: f64) -> f64 {
        if self.offset == 0.0 { value * self.factor } else { value * self.factor + self.offset }
    }
}

/// 0 °C, K.
const ICE_K: f64 = 273.15;
const RADIAN_DEG: f64 = 180.0 / std::f64::consts::PI;

/// Parts of a second, and from how many of them on a time is counted in them since 1970: milliseconds are as many since March
/// 1973, seconds in the year 5138.
const SINCE_1970: [(&str, f64, f64); 3] = [("ns", 1e-9, 1e17), ("us", 1e-6, 1e14), ("ms", 1e-3, 1e11)];

/// The unit of a time that states none and is too large for seconds.
pub(crate) fn since_1970(time: f64) -> Option<(&'static str, Conversion)> {
    let (unit, factor, _) = SINCE_1970.into_iter().find(|(_, _, least)| time >= *least)?;
    Some((unit, Conversion::by(factor)))
}

/// Electronics work between −60 and 225 °C; as K these are 213 to 498.
const WARMEST_C: f64 = 230.0;
const WARMEST_K: f64 = 500.0;

/// The unit of temperatures that state none and are all too high for °C.
pub(crate) fn absolute(temperatures: &[f64]) -> Option<(&'static str, Conversion)> {
    let mut finite = temperatures.iter().filter(|t| t.is_finite()).peekable();
    finite.peek()?;
    let is_absolute = finite.all(|t| (WARMEST_C..=WARMEST_K).contains(t));
    is_absolute.then_some(("K", Conversion { factor: 1.0, offset: -ICE_K }))
}

/// The conversion of a unit to a channel's; `None` where it is not known to be one of this kind.
pub(crate) fn conversion(channel: Channel, unit: &str) -> Option<Conversion> {
    let unit = plain(unit);
    match channel {
        Channel::Time => time_s(&unit).map(Conversion::by),
        Channel::Table | Channel::Theta => angle_deg(&unit).map(Conversion::by),
        Channel::Rate | Channel::Virtual => rate_dps(&unit).map(Conversion::by),
        Channel::Temperature => match unit.as_str() {
            "°c" | "c" | "degc" | "celsius" => Some(Conversion::NONE),
            "k" | "kelvin" => Some(Conversion { factor: 1.0, offset: -ICE_K }),
            "°f" | "f" | "degf" | "fahrenheit" => Some(Conversion { factor: 5.0 / 9.0, offset: -32.0 * 5.0 / 9.0 }),
            _ => None,
        },
        // displacements are in any unit
        Channel::X | Channel::Y => Some(Conversion::NONE),
        _ => voltage_v(&unit).map(Conversion::by),
    }
}

/// The unit of a channel in words.
pub(crate) const fn of_channel(channel: Channel) -> &'static str {
    match channel {
        Channel::Time => "s",
        Channel::Table | Channel::Theta => "deg",
        Channel::Rate | Channel::Virtual => "deg/s",
        Channel::Temperature => "°C",
        Channel::X | Channel::Y => "any unit",
        _ => "V",
    }
}

/// What stands in brackets at the end of a name: `Time (ms)`, `Rate [rad/s]`.
pub(crate) fn in_brackets(name: &str) -> Option<&str> {
    let name = name.trim_end();
    let open = match name.chars().next_back()? {
        ')' => '(',
        ']' => '[',
        _ => return None,
    };
    let unit = name[..name.len() - 1].rsplit_once(open)?.1.trim();
    (!unit.is_empty()).then_some(unit)
}

/// Whether a unit is the counts of a converter, by any name.
pub(crate) fn is_count(unit: &str) -> bool {
    ["adu", "count", "counts", "cts", "dn", "lsb", "raw"].iter().any(|name| unit.eq_ignore_ascii_case(name))
}

/// A unit without the brackets around it.
pub(crate) fn bare(unit: &str) -> &str {
    unit.trim().trim_matches(['(', ')', '[', ']', '<', '>']).trim()
}

/// A unit in small letters without brackets, blanks and the signs that have two forms.
fn plain(unit: &str) -> String {
    let one = |c: char| match c {
        'µ' | 'μ' => 'u',
        'º' => '°',
        c => c,
    };
    bare(unit).chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).map(one).collect()
}

fn time_s(unit: &str) -> Option<f64> {
    Some(match unit {
        "s" | "sec" | "secs" | "second" | "seconds" => 1.0,
        "ms" | "msec" | "millisecond" | "milliseconds" => 1e-3,
        "us" | "usec" | "microsecond" | "microseconds" => 1e-6,
        "ns" | "nanosecond" | "nanoseconds" => 1e-9,
        "min" | "minute" | "minutes" => 60.0,
        "h" | "hr" | "hour" | "hours" => 3600.0,
        _ => return None,
    })
}

fn angle_deg(unit: &str) -> Option<f64> {
    Some(match unit {
        "deg" | "degree" | "degrees" | "°" => 1.0,
        "mdeg" => 1e-3,
        "rad" | "radian" | "radians" => RADIAN_DEG,
        "mrad" => 1e-3 * RADIAN_DEG,
        "urad" => 1e-6 * RADIAN_DEG,
        "arcmin" | "′" => 1.0 / 60.0,
        "arcsec" | "″" => 1.0 / 3600.0,
        "rev" | "revs" | "revolution" | "revolutions" | "turn" | "turns" => 360.0,
        "gon" | "grad" => 0.9,
        _ => return None,
    })
}

/// An angle over a time, and the rates that have a name of their own.
fn rate_dps(unit: &str) -> Option<f64> {
    if let Some((angle, time)) = unit.split_once('/')
        && let Some(angle) = angle_deg(angle)
    {
        return Some(angle / time_s(time)?);
    }
    Some(match unit {
        "dps" => 1.0,
        "mdps" => 1e-3,
        "dph" => 1.0 / 3600.0,
        "rpm" | "r/min" | "u/min" | "tr/min" | "1/min" => 6.0,
        "rps" => 360.0,
        _ => return None,
    })
}

fn voltage_v(unit: &str) -> Option<f64> {
    Some(match unit {
        "v" | "volt" | "volts" => 1.0,
        "mv" | "millivolt" | "millivolts" => 1e-3,
        "uv" | "microvolt" | "microvolts" => 1e-6,
        "nv" => 1e-9,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_taken_to_those_of_their_channels() {
        for (channel, unit, one) in [
            (Channel::Time, "[ms]", 1e-3),
            (Channel::Time, "µs", 1e-6),
            (Channel::Time, "Seconds", 1.0),
            (Channel::Table, "rad", 180.0 / std::f64::consts::PI),
            (Channel::Theta, "°", 1.0),
            (Channel::Rate, "(rad / s)", 180.0 / std::f64::consts::PI),
            (Channel::Rate, "RPM", 6.0),
            (Channel::Rate, "rev/min", 6.0),
            (Channel::Rate, "°/h", 1.0 / 3600.0),
            (Channel::Xc, "mV", 1e-3),
            (Channel::Temperature, "K", 1.0 - 273.15),
            (Channel::X, "furlongs", 1.0),
        ] {
            let found = conversion(channel, unit).map(|c| c.of(1.0));
            assert_eq!(found, Some(one), "{channel} in {unit}");
        }
        for (channel, unit) in
            [(Channel::Time, "V"), (Channel::Rate, "rad"), (Channel::Xc, "counts"), (Channel::Table, "m")]
        {
            assert_eq!(conversion(channel, unit), None, "{channel} in {unit}");
        }
    }

    #[test]
    fn a_unit_in_brackets_ends_a_name() {
        assert_eq!(in_brackets("Time (ms)"), Some("ms"));
        assert_eq!(in_brackets("Rate [rad/s] "), Some("rad/s"));
        for name in ["Time", "(ms) Time", "Time ()", "ms)"] {
            assert_eq!(in_brackets(name), None, "{name}");
        }
    }
}
