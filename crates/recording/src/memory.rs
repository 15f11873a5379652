//! How much memory reading may take: asked before anything is allocated, so that no file of a few bytes fills a machine.
//!
//! Predictions are upper bounds of what is held at once, from the sizes that a file states; where it may lie, the reader
//! counts what really comes. The limit is the process's, as its memory is.
#![cfg_attr(
    not(all(feature = "hdf5", feature = "matlab", feature = "parquet")),
    allow(dead_code, reason = "each reader uses its own part")
)]

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use super::error::ReadError;

/// Not asked for: a quarter of the machine.
const UNSET: u64 = 0;
/// What a machine has that does not say, bytes.
const USUAL_MACHINE: u64 = 4 << 30;
/// Bytes that a number takes while a column is read: as stored, converted, and within its column.
pub(crate) const PER_NUMBER: u64 = 24;
/// … and once it is there.
pub(crate) const HELD: u64 = 8;
/// Bytes that a cell of an unknown column takes, which is kept as text.
pub(crate) const PER_TEXT: u64 = 48;

static LIMIT: AtomicU64 = AtomicU64::new(UNSET);

/// Sets how many bytes a recording may take while it is read; zero stands for a quarter of the machine, the default.
pub fn limit_memory(bytes: u64) {
    LIMIT.store(bytes, Ordering::Relaxed);
}

/// Bytes that a recording may take while it is read.
#[must_use]
pub fn memory_limit() -> u64 {
    match LIMIT.load(Ordering::Relaxed) {
        UNSET => {
            let quarter = machine().unwrap_or(USUAL_MACHINE) / 4;
            LIMIT.store(quarter, Ordering::Relaxed);
            quarter
        }
        set => set,
    }
}

/// Memory of the machine, or of the part of it that this process may use, bytes.
fn machine() -> Option<u64> {
    let all = std::fs::read_to_string("/proc/meminfo").ok()?;
    let total = all.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kib: u64 = total.trim().strip_suffix("kB")?.trim().parse().ok()?;
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
    Some(group.unwrap_or(u64::MAX).min(kib.saturating_mul(1024)))
}

/// Refuses what would take more than is allowed.
pub(crate) fn allow(needed: u64, what: &str, source: &Path) -> Result<(), ReadError> {
    let allowed = memory_limit();
    if needed <= allowed {
        return Ok(());
    }
    Err(ReadError::TooLarge { path: source.to_path_buf(), what: what.to_owned(), needed, allowed })
}

/// Refuses so many columns of numbers that would take more than is allowed once they are there.
pub(crate) fn allow_columns(columns: usize, rows: usize, what: &str, source: &Path) -> Result<(), ReadError> {
    allow((columns as u64).saturating_mul(rows as u64).saturating_mul(HELD), what, source)
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is within a decoder whose panic is an answer: the file is damaged. A program's panic hook that
/// asks this keeps silent then.
#[must_use]
pub fn panic_is_answer() -> bool {
    GUARDED.get()
}

/// What a decoder says; `None` where it panics, which decoders do on damaged files.
pub(crate) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    let before = GUARDED.replace(true);
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(before);
    decoded.ok()
}
