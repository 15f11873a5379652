//! Reads a recording and says how long that took: `cargo run --release -p cvg-recording --example read_recording -- FILE`.
//!
//! Used by `benches/reading.py`. It identifies nothing.

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use cvg_recording::Recording;

fn main() -> ExitCode {
    let Some(path) = std::env::args().nth(1) else {
        eprintln!("usage: read_recording FILE");
        return ExitCode::from(2);
    };
    let start = Instant::now();
    match Recording::read(Path::new(&path)) {
        Ok(recording) => {
            let seconds = start.elapsed().as_secs_f64();
            let columns = recording.column_names().count();
            println!("{seconds:.4} s for {} rows of {columns} columns", recording.len());
            for warning in &recording.warnings {
                eprintln!("{warning}");
            }
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
