//! Harnesses run on edge cases and random bit patterns.
//!
//! `CVG_KANI_CASES` says how many cases a harness has to accept (4096); `CVG_KANI_SEED` replays one case.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::panic::{catch_unwind, resume_unwind};

/// Accepted cases without `CVG_KANI_CASES`.
const CASES: u64 = 4096;
/// A twin's error is looked for in this many times as many cases.
const PATIENCE: u64 = 64;
/// Of so many cases, one has to satisfy the assumptions.
const LARGEST_REJECTION: u64 = 4096;

/// What sampling has to find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    /// no case fails
    Holds,
    /// some case fails: the harness is a twin with a planted error
    Refuted,
}

struct Source {
    state: u64,
    covers: BTreeMap<&'static str, bool>,
}

thread_local! {
    static SOURCE: RefCell<Source> = const { RefCell::new(Source { state: 1, covers: BTreeMap::new() }) };
}

/// SplitMix64.
fn next() -> u64 {
    SOURCE.with_borrow_mut(|source| {
        source.state = source.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = source.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    })
}

/// One of `n`.
fn pick(n: usize) -> usize {
    (next() % n as u64) as usize
}

/// Small numbers, extremes and random bits.
pub fn any_u64() -> u64 {
    const EDGES: [u64; 8] = [0, 1, u64::MAX, i64::MAX as u64, i64::MIN as u64, 0xffff_ffff, 0x7fff_ffff, 0x8000_0000];
    match pick(4) {
        0 => EDGES[pick(EDGES.len())],
        1 => next() % 17,
        _ => next(),
    }
}

macro_rules! floats {
    ($name:ident, $t:ident, $bits:ident) => {
        /// Edge cases, small, ordinary and random bit patterns.
        #[allow(clippy::cast_possible_truncation, reason = "the lower bits are as random as the upper")]
        pub fn $name() -> $t {
            const EDGES: [$t; 16] = [
                0.0,
                -0.0,
                1.0,
                -1.0,
                0.5,
                2.0,
                $t::MIN_POSITIVE,
                -$t::MIN_POSITIVE,
                $t::MAX,
                $t::MIN,
                $t::INFINITY,
                $t::NEG_INFINITY,
                $t::NAN,
                1.0 + $t::EPSILON,
                1.0 - $t::EPSILON / 2.0,
                core::$t::consts::PI,
            ];
            match pick(8) {
                0 => EDGES[pick(EDGES.len())],
                // subnormal and small
                1 => $t::from_bits((next() as $bits) >> pick($bits::BITS as usize / 2)),
                2 | 3 => $t::from_bits(next() as $bits),
                _ => {
                    let unit = (next() >> 11) as f64 / (1_u64 << 53) as f64;
                    ((2.0 * unit - 1.0) * [1.0, 2.0, 1e-3, 10.0][pick(4)]) as $t
                }
            }
        }
    };
}
floats!(any_f32, f32, u32);
floats!(any_f64, f64, u64);

/// Leaves a case that the assumptions exclude.
struct Rejected;

/// Only what satisfies the condition goes on from here.
pub fn assume(condition: bool) {
    if !condition {
        // no hook, no message: this is no failure
        resume_unwind(Box::new(Rejected));
    }
}

/// What [`cover!`](crate::cover) calls.
pub fn cover_hit(_fingerprint: u32, text: &'static str, condition: bool) {
    SOURCE.with_borrow_mut(|source| *source.covers.entry(text).or_insert(false) |= condition);
}

fn setting(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|value| value.parse().ok())
}

/// Runs a harness on samples until enough were accepted.
///
/// # Panics
/// Where a case fails that must not, a twin's error is not found, or the assumptions exclude nearly everything.
pub fn drive(name: &str, expected: Expected, harness: fn()) {
    let base = name
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3));
    let case = |k: u64| {
        SOURCE.with_borrow_mut(|source| source.state = base ^ k.wrapping_mul(0xD6E8_FEB8_6659_FD93));
        catch_unwind(harness)
    };
    if let Some(k) = setting("CVG_KANI_SEED") {
        if let Err(failure) = case(k) {
            assert!(!failure.is::<Rejected>(), "{name}: case {k} does not satisfy the assumptions");
            resume_unwind(failure);
        }
        return;
    }
    let cases = setting("CVG_KANI_CASES").unwrap_or(CASES);
    let wanted = if expected == Expected::Refuted { cases * PATIENCE } else { cases };
    let (mut accepted, mut rejected, mut refuted) = (0, 0, None);
    for k in 0.. {
        match case(k) {
            Ok(()) => accepted += 1,
            Err(failure) if failure.is::<Rejected>() => {
                rejected += 1;
                if rejected > LARGEST_REJECTION * (accepted + 1) {
                    break;
                }
            }
            Err(failure) => {
                refuted = Some((k, failure));
                break;
            }
        }
        if accepted == wanted {
            break;
        }
    }
    match (expected, refuted) {
        (Expected::Holds, Some((k, failure))) => {
            eprintln!("{name}: fails; replay with CVG_KANI_SEED={k}");
            resume_unwind(failure);
        }
        (Expected::Refuted, None) => panic!("{name}: the planted error was not found in {accepted} cases"),
        _ => {}
    }
    assert!(
        expected == Expected::Refuted || accepted == wanted,
        "{name}: the assumptions exclude nearly everything: {accepted} of {} cases accepted",
        accepted + rejected
    );
    let missed: Vec<_> =
        SOURCE.with_borrow(|source| source.covers.iter().filter(|(_, hit)| !**hit).map(|(text, _)| *text).collect());
    println!("{name}: {accepted} cases sampled, {rejected} excluded, covers not met: {missed:?}");
}

#[cfg(test)]
mod tests {
    use super::{Expected, drive};
    use crate as kani;

    fn below_ten() {
        let x: u32 = kani::any_where(|x| *x < 10);
        kani::cover!(x == 9, "nine");
        assert!(x < 10);
    }

    fn below_nine() {
        let x: u32 = kani::any_where(|x| *x < 10);
        assert!(x < 9);
    }

    fn nothing() {
        kani::assume(kani::any::<f32>() > f32::INFINITY);
    }

    #[test]
    fn what_holds_is_accepted() {
        drive("below_ten", Expected::Holds, below_ten);
    }

    #[test]
    fn a_planted_error_is_found() {
        drive("below_nine", Expected::Refuted, below_nine);
    }

    #[test]
    #[should_panic(expected = "assertion failed: x < 9")]
    fn what_does_not_hold_is_refused() {
        drive("below_nine", Expected::Holds, below_nine);
    }

    #[test]
    #[should_panic(expected = "the planted error was not found")]
    fn a_twin_that_holds_is_refused() {
        drive("below_ten", Expected::Refuted, below_ten);
    }

    #[test]
    #[should_panic(expected = "the assumptions exclude nearly everything")]
    fn assumptions_that_exclude_everything_are_refused() {
        drive("nothing", Expected::Holds, nothing);
    }

    #[test]
    fn every_class_of_number_is_drawn() {
        let drawn: Vec<f32> = (0..4096).map(|_| kani::any()).collect();
        assert!(drawn.iter().any(|x| x.is_nan()) && drawn.iter().any(|x| x.is_infinite()));
        assert!(drawn.iter().any(|x| x.is_subnormal()) && drawn.contains(&f32::MAX));
        assert!(drawn.iter().any(|x| x.to_bits() == (-0.0_f32).to_bits()));
    }
}
