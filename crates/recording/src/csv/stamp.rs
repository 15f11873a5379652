//! Dates with a time of day, as ISO 8601 writes them, in the place of seconds: told by the first, counted from it.
//!
//! Days are those of the Gregorian calendar, with 86,400 s each: a leap second is not one of them. All are with an offset
//! from UTC, or none is. Digits of a second count to the twelfth.

/// Picoseconds of a second.
const SECOND_PS: i128 = 1_000_000_000_000;
/// Digits of a second that are kept.
const DIGITS: usize = 12;

/// An instant, since the beginning of the year 0, of UTC where it says its offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stamp {
    picoseconds: i128,
    has_offset: bool,
}

impl Stamp {
    /// `2026-03-01T12:00:00.25+01:00`, the `T` a blank and the point a comma if so, the offset `Z` or absent.
    pub(super) fn of(cell: &[u8]) -> Option<Self> {
        let text = std::str::from_utf8(cell).ok()?.trim();
        let (day, time) = (text.get(..10)?, text.get(11..)?);
        if !matches!(text.as_bytes()[10], b'T' | b't' | b' ') {
            return None;
        }
        let mut parts = day.splitn(3, '-');
        let [year, month, day] = [4, 2, 2].map(|digits| whole(parts.next()?, digits));
        let days = days(year?, month?, day?)?;
        let (clock, offset_s) = without_offset(time)?;
        let mut parts = clock.splitn(3, ':');
        let (hour, minute) = (whole(parts.next()?, 2)?, whole(parts.next()?, 2)?);
        let (second, fraction) = match parts.next()?.split_once(['.', ',']) {
            Some((second, digits)) => (second, fraction_ps(digits)?),
            None => (clock.rsplit(':').next()?, 0),
        };
        let second = whole(second, 2)?;
        if hour > 23 || minute > 59 || second > 59 {
            return None;
        }
        let seconds = days * 86_400 + hour * 3600 + minute * 60 + second - offset_s.unwrap_or(0);
        Some(Self { picoseconds: i128::from(seconds) * SECOND_PS + fraction, has_offset: offset_s.is_some() })
    }

    /// Seconds from this one to that in a cell; `None` where the cell has none of the same kind.
    pub(super) fn seconds_to(self, cell: &[u8]) -> Option<f64> {
        let other = Self::of(cell).filter(|other| other.has_offset == self.has_offset)?;
        Some((other.picoseconds - self.picoseconds) as f64 / SECOND_PS as f64)
    }
}

/// So many digits as a number.
fn whole(text: &str, digits: usize) -> Option<i64> {
    let are_digits = text.len() == digits && text.bytes().all(|byte| byte.is_ascii_digit());
    are_digits.then(|| text.parse().ok()).flatten()
}

fn fraction_ps(digits: &str) -> Option<i128> {
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let kept = &digits[..digits.len().min(DIGITS)];
    Some(kept.parse::<i128>().ok()? * 10_i128.pow((DIGITS - kept.len()) as u32))
}

/// The time of day without the offset behind it, and the offset, s.
fn without_offset(time: &str) -> Option<(&str, Option<i64>)> {
    if let Some(clock) = time.strip_suffix(['Z', 'z']) {
        return Some((clock, Some(0)));
    }
    let Some(at) = time.rfind(['+', '-']) else { return Some((time, None)) };
    let (clock, offset) = time.split_at(at);
    let sign = if offset.starts_with('-') { -1 } else { 1 };
    let (hours, minutes) = match offset[1..].split_once(':') {
        Some((hours, minutes)) => (whole(hours, 2)?, whole(minutes, 2)?),
        None if offset.len() == 5 => (whole(&offset[1..3], 2)?, whole(&offset[3..], 2)?),
        None => (whole(&offset[1..], 2)?, 0),
    };
    (hours <= 23 && minutes <= 59).then_some((clock, Some(sign * (hours * 3600 + minutes * 60))))
}

/// Days since the beginning of the year 0.
fn days(year: i64, month: i64, day: i64) -> Option<i64> {
    let is_leap = |year: i64| year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let lengths = [31, if is_leap(year) { 29 } else { 28 }, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let month = usize::try_from(month - 1).ok().filter(|&month| month < 12)?;
    if !(1..=lengths[month]).contains(&day) {
        return None;
    }
    let before: i64 = lengths[..month].iter().sum();
    // leap years before this one, the year 0 among them
    let leaps = (year + 3) / 4 - (year + 99) / 100 + (year + 399) / 400;
    Some(year * 365 + leaps + before + day - 1)
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
