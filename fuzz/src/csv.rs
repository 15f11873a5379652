//! Any bytes as a CSV file: read or refused with a reason, never a panic; what is read is as promised, and reads back as it is written.

use std::path::Path;

use cvg_recording::{Channel, ReadError, Recording, limit_memory};

/// What one recording may take, bytes: as much for a machine that fuzzes as a quarter of a small one.
pub const ALLOWED: u64 = 128 << 20;

pub fn run(bytes: &[u8]) {
    limit_memory(ALLOWED);
    let path = Path::new("fuzz.csv");
    let Some(recording) = admitted(Recording::parse_csv(bytes, path)) else { return };
    as_promised(&recording);

    let mut written = vec![];
    recording.write_csv(&mut written).expect("writing to memory does not fail");
    let again = Recording::parse_csv(&written, path).expect("what was written is read");
    let mut rewritten = vec![];
    again.write_csv(&mut rewritten).expect("writing to memory does not fail");
    assert_eq!(rewritten, written);
}

/// What was read; where it was refused, the reason and the place can be said.
pub fn admitted<T>(read: Result<T, ReadError>) -> Option<T> {
    let said = |error: &ReadError| (error.to_string(), error.path().to_owned(), error.place(), error.column());
    read.inspect_err(|error| assert!(!said(error).0.is_empty())).ok()
}

/// What every recording promises that was read: times that increase, columns of one length, numbers where they are needed,
/// every row counted.
pub fn as_promised(recording: &Recording) {
    assert!(recording.t_s.is_sorted_by(|before, after| before < after), "the time increases");
    for channel in Channel::ALL {
        if let Some(values) = recording.channel(channel) {
            assert_eq!(values.len(), recording.len());
            assert!(!channel.is_needed_in_every_row() || values.iter().all(|value| value.is_finite()));
        }
    }
    let dropped = &recording.dropped;
    assert_eq!(dropped.rows_read, dropped.rows_kept + dropped.rows_dropped());
}
