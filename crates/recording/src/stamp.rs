//! Dates with a time of day in the place of seconds, as ISO 8601 writes them or with the day first and dots between; or the
//! time of day alone. Told by the first, counted from it.
//!
//! A leap second is none. All are with an offset from UTC, or none is. Digits of a second count to the ninth. Days with `/`
//! between are none: which of the numbers is the month, nothing says.

use chrono::{DateTime, NaiveDate, NaiveDateTime, NaiveTime, TimeDelta, Timelike};

/// Days with a time, and the same with an offset behind it: `Z`, `+01:00`, `+0100` or `+01`.
const LOCAL: &str = "%Y-%m-%dT%H:%M:%S%.f";
const WITH_OFFSET: &str = "%Y-%m-%dT%H:%M:%S%.f%#z";
const OF_DAY: &str = "%H:%M:%S%.f";
/// Bytes of the day.
const DAY: usize = 10;
/// Seconds of a day; what is counted from one midnight goes back by most of it at the next.
const DAY_S: f64 = 86_400.0;

/// What a time that is neither a number nor a date should have been.
pub(crate) const WANTED: &str = "a number of seconds, a date such as 2026-03-01T12:00:00.25Z or 01.03.2026 12:00:00, or a time of day \
                                 such as 12:00:00.25";

/// What stands in the place of a number of seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Date,
    DateWithOffset,
    TimeOfDay,
}

/// An instant, of UTC where it says its offset, of any day where it says none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stamp {
    at: NaiveDateTime,
    kind: Kind,
}

impl Stamp {
    /// `2026-03-01T12:00:00.25+01:00`, the `T` a blank and the point a comma if so, the offset `Z` or absent; the same with
    /// `01.03.2026` as its day; `12:00:00.25`.
    pub(crate) fn of(cell: &[u8]) -> Option<Self> {
        let text = std::str::from_utf8(cell).ok().map(str::trim).filter(|text| text.is_ascii())?;
        let stamp = Self::of_day(text).or_else(|| Self::of_date(text))?;
        let is_leap = stamp.at.nanosecond() >= 1_000_000_000;
        (!is_leap).then_some(stamp)
    }

    fn of_day(text: &str) -> Option<Self> {
        let time = NaiveTime::parse_from_str(&text.replace(',', "."), OF_DAY).ok()?;
        Some(Self { at: NaiveDate::default().and_time(time), kind: Kind::TimeOfDay })
    }

    fn of_date(text: &str) -> Option<Self> {
        let (day, time) = text.split_at_checked(DAY)?;
        let time = time.strip_prefix(['T', 't', ' '])?;
        let text = format!("{}T{}", year_first(day), time.replace(',', "."));
        Some(match NaiveDateTime::parse_from_str(&text, LOCAL) {
            Ok(at) => Self { at, kind: Kind::Date },
            Err(_) => {
                let at = DateTime::parse_from_str(&text, WITH_OFFSET).ok()?.naive_utc();
                Self { at, kind: Kind::DateWithOffset }
            }
        })
    }

    /// Seconds from this one to that in a cell; `None` where the cell has none of the same kind.
    pub(crate) fn seconds_to(self, cell: &[u8]) -> Option<f64> {
        let other = Self::of(cell).filter(|other| other.kind == self.kind)?;
        let since: TimeDelta = other.at - self.at;
        Some(since.num_seconds() as f64 + f64::from(since.subsec_nanos()) * 1e-9)
    }

    /// Puts times that were counted from this one in the order of days, where a time of day says none: each goes on from the
    /// one before, past midnight if it has to. Gives what a reader has to say.
    pub(crate) fn over_midnights(self, seconds: &mut [f64]) -> String {
        if self.kind != Kind::TimeOfDay {
            return COUNTED.to_owned();
        }
        let (mut days, mut last) = (0_u32, 0.0);
        for t in seconds.iter_mut().filter(|t| t.is_finite()) {
            if *t - last < -0.5 * DAY_S {
                days += 1;
            }
            last = *t;
            *t += f64::from(days) * DAY_S;
        }
        match days {
            0 => COUNTED_OF_DAY.to_owned(),
            1 => format!("{COUNTED_OF_DAY}, past one midnight"),
            _ => format!("{COUNTED_OF_DAY}, past {days} midnights"),
        }
    }

    /// What a time that follows this one should be, where it is none of its kind.
    pub(crate) const fn wanted(self) -> &'static str {
        match self.kind {
            Kind::TimeOfDay => "a time of day as the first",
            _ => "a date with a time of day as the first, all with an offset from UTC or none",
        }
    }
}

/// What a reader says that found dates, or times of day, in the place of times.
const COUNTED: &str = "times are written as dates: `t_s` is counted from the first, in s";
const COUNTED_OF_DAY: &str = "times are written as times of day: `t_s` is counted from the first, in s";

/// `01.03.2026` as `2026-03-01`; anything else as it is.
fn year_first(day: &str) -> String {
    match day.split('.').collect::<Vec<_>>()[..] {
        [d, m, y] if [d.len(), m.len(), y.len()] == [2, 2, 4] => format!("{y}-{m}-{d}"),
        _ => day.to_owned(),
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
    fn a_day_that_comes_first_with_dots_is_one() {
        assert_eq!(between("01.03.2026 12:00:00,000", "01.03.2026 12:00:00,010"), Some(0.01));
        assert_eq!(between("28.02.2026 23:59:59", "01.03.2026 00:00:00"), Some(1.0));
        assert_eq!(between("01.03.2026T12:00:00Z", "2026-03-01 12:00:01Z"), Some(1.0));
    }

    #[test]
    fn times_of_day_go_on_past_midnight() {
        let first = Stamp::of(b"23:59:59.990").unwrap();
        let cells = ["23:59:59.990", "00:00:00.000", "12:00:00,5", "00:00:00", "00:00:00.01", "00:00:00"];
        let mut seconds: Vec<f64> = cells.iter().map(|cell| first.seconds_to(cell.as_bytes()).unwrap()).collect();
        let said = first.over_midnights(&mut seconds);
        let expected = [0.0, 0.01, 43_200.51, 86_400.01, 86_400.02, 86_400.01];
        for (found, expected) in seconds.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{seconds:?}");
        }
        assert!(said.contains("past 2 midnights"), "{said}");
        assert_eq!(between("12:00:00", "2026-03-01T12:00:00"), None, "one says its day, the other does not");
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
            "01/03/2026 12:00:00",
            "31.02.2026 12:00:00",
            "1.3.2026 12:00:00",
            "12:00",
            "24:00:00",
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
