//! For a service that has its numbers in memory already: columns in, a verdict out, and no file in between.
//!
//! `cargo run -p cvg-examples --bin columns_in_memory`

use std::error::Error;
use std::path::Path;

use cvg_calibration::recording::{Campaign, Naming, Recording, Values};
use cvg_calibration::{Answer, Options, answer};
use cvg_simulator::Scenario;

fn main() -> Result<(), Box<dyn Error>> {
    // in the place of a data base; its time is in ms
    let simulated = Scenario::paper().simulate();
    let mut columns: Vec<(String, Values)> = Vec::new();
    for column in &simulated.runs[0].columns {
        let (name, by) = if column.name == "t_s" { ("ms", 1e3) } else { (column.name, 1.0) };
        columns.push((name.to_owned(), Values::Numbers(column.values.iter().map(|v| v * by).collect())));
    }
    let mut naming = Naming::default();
    naming.add("t_s=ms*0.001")?;
    let recording = Recording::of_columns(columns, &naming, Path::new("turn 1 of unit 7"))?;
    let campaign = Campaign::of_recordings(vec![recording])?;
    match answer(campaign, &Options::default())? {
        Answer::Identified(found) => println!("{:?}: {:?}", found.report.status, found.report.heldout.discovered),
        Answer::Surveyed(told) => println!("{:?}", told.report.status),
    }
    Ok(())
}
