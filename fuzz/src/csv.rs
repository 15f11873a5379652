//! Any bytes as a CSV file: read or refused, never a panic; what is read is as promised, and reads back as it is written.

use std::path::Path;

use cvg_calibration::recording::{Channel, Recording};

pub fn run(bytes: &[u8]) {
    let path = Path::new("fuzz.csv");
    let Ok(recording) = Recording::parse_csv(bytes, path) else { return };
    as_promised(&recording);

    let mut written = vec![];
    recording.write_csv(&mut written).expect("writing to memory does not fail");
    let again = Recording::parse_csv(&written, path).expect("what was written is read");
    let mut rewritten = vec![];
    again.write_csv(&mut rewritten).expect("writing to memory does not fail");
    assert_eq!(rewritten, written);
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
