//! Bytes from outside break nothing: every fuzz target on its seeds and on what a few changes make of them.
//!
//! What libFuzzer does at length (fuzz/README.md) this does in seconds, with a stable compiler. `CVG_TRIALS` tries more.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::time::{Duration, Instant};

use cvg_tests::bench::{Draws, trials};

#[allow(unreachable_pub, reason = "a library of its own beside libFuzzer")]
#[path = "../../fuzz/src/lib.rs"]
mod targets;

/// Words on which readers of text and of numbers have failed.
const WORDS: [&[u8]; 14] = [
    b"nan",
    b"-inf",
    b"1e308",
    b"-1e-308",
    b"0",
    b"-",
    b"\"",
    b"\n",
    b",",
    b"[[",
    b"\0",
    b"\xff\xff\xff\x7f",
    b"\x80",
    b"\xe2\x80\xae",
];
/// Longer inputs show nothing that shorter ones do not.
const LONGEST: usize = 1 << 16;
/// Changes of the seeds of a target, where no more are asked for.
const LEAST: u64 = 1000;

/// The seeds of a target.
fn seeds(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds").join(name);
    let mut paths: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

/// A place in some bytes, or their end.
fn place(bytes: &[u8], draw: &mut Draws) -> usize {
    draw.below(bytes.len() + 1)
}

/// A few bytes of them.
fn piece(bytes: &[u8], draw: &mut Draws) -> std::ops::Range<usize> {
    let from = place(bytes, draw);
    from..(from + draw.below(40)).min(bytes.len())
}

/// One change, as transport, an editor or another program makes it.
fn change(bytes: &mut Vec<u8>, others: &[Vec<u8>], draw: &mut Draws) {
    let at = place(bytes, draw);
    match draw.below(7) {
        0 if at < bytes.len() => bytes[at] ^= 1 << draw.below(8),
        1 if at < bytes.len() => bytes[at] = [0, 0xff, b'0', b'9', 0x80, 0x7f][draw.below(6)],
        2 => drop(bytes.drain(piece(bytes, draw))),
        3 => {
            let twice = bytes[piece(bytes, draw)].to_vec();
            bytes.splice(at..at, twice).for_each(drop);
        }
        4 => bytes.truncate(at),
        5 => {
            let other = &others[draw.below(others.len())];
            let piece = other[piece(other, draw)].to_vec();
            bytes.splice(at..at, piece).for_each(drop);
        }
        _ => bytes.splice(at..at, WORDS[draw.below(WORDS.len())].iter().copied()).for_each(drop),
    }
    bytes.truncate(LONGEST);
}

#[test]
fn every_target_has_seeds_and_holds_on_them_and_near_them() {
    let count = trials(LEAST);
    for (number, (name, _)) in targets::TARGETS.iter().enumerate() {
        let (begun, seeds, run) = (Instant::now(), seeds(name), targets::target(name));
        assert!(!seeds.is_empty(), "{name} has no seeds");
        seeds.iter().for_each(|seed| run(seed));
        let mut draw = Draws::new(7_000_000 + number as u64);
        let mut tried = 0;
        // a slow target is tried less often, where it is not asked for
        while tried < count && (count > LEAST || begun.elapsed() < Duration::from_secs(4)) {
            let mut bytes = seeds[draw.below(seeds.len())].clone();
            (0..=draw.below(4)).for_each(|_| change(&mut bytes, &seeds, &mut draw));
            let outcome = std::panic::catch_unwind(|| run(&bytes));
            assert!(outcome.is_ok(), "{name} breaks on {}", bytes.escape_ascii());
            tried += 1;
        }
        println!("{name}: {} seeds, {tried} changes of them, {:?}", seeds.len(), begun.elapsed());
    }
}
