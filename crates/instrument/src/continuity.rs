//! Whether the count of half turns is still that of the pattern.
//!
//! A pattern's direction has a period of 180 degrees: the count is right as long as no window was missed in which the
//! pattern may have turned by 45 degrees, and no window showed another direction than that of a pattern that turns.

use cvg_estimator::Movement;

/// What is known of the count: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Continuity {
    /// windows in a row that did not show the pattern
    pub unseen: u32,
    /// the pattern was in operation: the count means something
    pub counting: bool,
    /// half turns may be lost, since it was acknowledged last
    pub lost: bool,
}

/// What a window was to whoever counts half turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Sight {
    /// it has an envelope
    pub(crate) valid: bool,
    /// of converters within their range that do not repeat themselves
    pub(crate) clear: bool,
    /// how the direction moved
    pub(crate) movement: Movement,
    /// there was a direction before, and there is none to compare it with
    pub(crate) interrupted: bool,
    /// the instrument is in operation after this window
    pub(crate) in_operation: bool,
    /// it is in a fault
    pub(crate) in_fault: bool,
}

impl Continuity {
    //= specs/dsp.md#half-turns
    //# Half turns that may be lost MUST be said to be until it is acknowledged.
    /// Takes note of a window; `most_unseen` windows are too few for 45 degrees. Where the phase is near in operation is
    /// asked of `in_phase` only where it matters.
    #[inline(always)]
    pub(crate) fn see(&mut self, sight: Sight, most_unseen: u32, in_phase: impl FnOnce() -> bool) {
        self.unseen = if sight.valid && sight.clear { 0 } else { self.unseen.saturating_add(1) };
        if self.counting && !self.lost {
            self.lost = sight.movement == Movement::Jumped
                || sight.interrupted
                || sight.in_fault
                || self.unseen > most_unseen
                || !in_phase();
        }
        self.counting |= sight.in_operation;
    }
}

#[cfg(test)]
mod tests {
    use super::{Continuity, Movement, Sight};

    const SEEN: Sight = Sight {
        valid: true,
        clear: true,
        movement: Movement::Steady,
        interrupted: false,
        in_operation: true,
        in_fault: false,
    };

    #[test]
    fn windows_of_converters_that_clip_or_repeat_themselves_do_not_show_the_pattern() {
        for unseen in [Sight { clear: false, ..SEEN }, Sight { valid: false, ..SEEN }] {
            let mut count = Continuity { counting: true, ..Continuity::default() };
            for n in 1..=6 {
                count.see(unseen, 4, || true);
                assert_eq!((count.unseen, count.lost), (n, n > 4), "{unseen:?}");
            }
            count.see(SEEN, 4, || true);
            assert_eq!((count.unseen, count.lost), (0, true), "until it is acknowledged");
        }
    }

    #[test]
    fn nothing_is_lost_of_a_count_in_the_window_in_which_it_begins() {
        // a pattern may jump while it is spun up: what was counted until then is nobody's angle
        for begins in [Sight { movement: Movement::Jumped, ..SEEN }, Sight { interrupted: true, ..SEEN }] {
            let mut count = Continuity::default();
            count.see(begins, 4, || false);
            assert_eq!((count.counting, count.lost), (true, false), "{begins:?}");
            count.see(begins, 4, || true);
            assert!(count.lost, "{begins:?}");
        }
    }
}
