//! Words that come from files, for a terminal.

use std::borrow::Cow;
use std::fmt::Write as _;

/// A text in which no name out of a file can steer the terminal: signs that are not shown are written as their number.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    if !text.contains(steers) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for sign in text.chars() {
        if steers(sign) {
            // four digits are enough for each of them, and JSON reads them back
            let _ = write!(out, "\\u{:04x}", u32::from(sign));
        } else {
            out.push(sign);
        }
    }
    Cow::Owned(out)
}

/// A number of things by the name of one: `1 run`, `2 runs`.
pub(crate) fn counted(count: usize, one: &str) -> String {
    format!("{count} {one}{}", if count == 1 { "" } else { "s" })
}

/// Whether a sign is an instruction rather than one to be shown: controls but for the end of a line and the tab, and
/// what turns the direction of writing.
fn steers(sign: char) -> bool {
    let turns = matches!(sign, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (sign.is_control() && sign != '\n' && sign != '\t') || turns
}

#[cfg(test)]
mod tests {
    use super::{counted, plain};

    #[test]
    fn one_is_no_many() {
        assert_eq!([0, 1, 2].map(|n| counted(n, "run")), ["0 runs", "1 run", "2 runs"]);
    }

    #[test]
    fn what_steers_a_terminal_is_written_as_its_number() {
        assert_eq!(plain("a\u{1b}[2Jb\u{9b}c\u{202e}gnp.exe\r"), "a\\u001b[2Jb\\u009bc\\u202egnp.exe\\u000d");
        assert_eq!(plain("± 0.1°\n\tθ"), "± 0.1°\n\tθ");
    }
}
