//! Dates with a time of day, as ISO 8601 writes them, in the place of seconds: told by the first, counted from it.
//!
//! A leap second is none. All are with an offset from UTC, or none is. Digits of a second count to the ninth.

use chrono::{DateTime, NaiveDateTime, TimeDelta, Timelike};

/// Days with a time, and the same with an offset behind it: `Z`, `+01:00`, `+0100` or `+01`.
const LOCAL: &str = "%Y-%m-%dT%H:%M:%S%.f";
const WITH_OFFSET: &str = "%Y-%m-%dT%H:%M:%S%.f%#z";
/// Bytes of the day.
const DAY: usize = 10;

/// What a reader says that found dates in the place of times.
pub(crate) const COUNTED: &str = "times are written as dates: `t_s` is counted from the first, in s";

/// An instant, of UTC where it says its offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stamp {
    at: NaiveDateTime,
    has_offset: bool,
}

impl Stamp {
    /// `2026-03-01T12:00:00.25+01:00`, the `T` a blank and the point a comma if so, the offset `Z` or absent.
    pub(crate) fn of(cell: &[u8]) -> Option<Self> {
        let text = std::str::from_utf8(cell).ok().map(str::trim).filter(|text| text.is_ascii())?;
        let (day, time) = text.split_at_checked(DAY)?;
        let time = time.strip_prefix(['T', 't', ' '])?;
        let text = format!("{day}T{}", time.replace(',', "."));
        let stamp = match NaiveDateTime::parse_from_str(&text, LOCAL) {
            Ok(at) => Self { at, has_offset: false },
            Err(_) => Self { at: DateTime::parse_from_str(&text, WITH_OFFSET).ok()?.naive_utc(), has_offset: true },
        };
        let is_leap = stamp.at.nanosecond() >= 1_000_000_000;
        (!is_leap).then_some(stamp)
    }

    /// Seconds from this one to that in a cell; `None` where the cell has none of the same kind.
    pub(crate) fn seconds_to(self, cell: &[u8]) -> Option<f64> {
        let other = Self::of(cell).filter(|other| other.has_offset == self.has_offset)?;
        let since: TimeDelta = other.at - self.at;
        Some(since.num_seconds() as f64 + f64::from(since.subsec_nanos()) * 1e-9)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn between(from: &str, to: &str) -> Option<f64> {
        Stamp::of(from.as_bytes()).unwrap().seconds_to(to.as_bytes())
    }

    #[test]
    fn instants_are_counted_over_days_months_and_leap_years() {
        assert_eq!(between("2026-03-01T12:00:00Z", "2026-03-01T12:00:00.000000001Z"), Some(1e-9));
        assert_eq!(between("2023-12-31 23:59:59,5", "2024-01-01 00:00:00"), Some(0.5));
        assert_eq!(between("2024-02-28T00:00:00Z", "2024-03-01T00:00:00Z"), Some(2.0 * 86_400.0));
        assert_eq!(between("1900-02-28T00:00:00Z", "1900-03-01T00:00:00Z"), Some(86_400.0));
        assert_eq!(between("1970-01-01T00:00:00Z", "2026-03-01T12:00:00Z"), Some(1_772_366_400.0));
        assert_eq!(between("2026-03-01T12:00:00+01:00", "2026-03-01T11:00:00Z"), Some(0.0));
        assert_eq!(between("2026-03-01T12:00:00-0530", "2026-03-01T17:30:01Z"), Some(1.0));
    }

    #[test]
    fn what_is_no_date_is_none() {
        for text in [
            "",
            "12",
            "2026-03-01",
            "2026-03-01T12:00",
            "2026-02-30T12:00:00",
            "2026-13-01T12:00:00",
            "2026-03-01T24:00:00",
            "2026-03-01T12:00:60Z",
            "2026-03-01T12:00:00.",
            "01.03.2026 12:00:00",
            "2026-03-01T12:00:00+1",
            "2026-3-01T12:00:00",
            "2026-03-01T12:00:00.5x",
            "٢٠٢٦-٠٣-٠١T12:00:00",
        ] {
            assert_eq!(Stamp::of(text.as_bytes()), None, "{text:?}");
        }
        assert_eq!(
            between("2026-03-01T12:00:00", "2026-03-01T12:00:01Z"),
            None,
            "one says its offset, the other does not"
        );
    }
}
