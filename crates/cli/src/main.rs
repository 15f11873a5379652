//! `cvg`: files in, reports out.
//!
//! Exit status: 0 done, 1 the data does not allow an answer, 2 bad use or bad input. Messages and progress go to
//! standard error; standard output carries results only.
#![forbid(unsafe_code)]

mod clouds;
mod commands;
mod demo;
mod figure;
mod output;
mod paper;
mod report;
mod standard;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};

/// Find, explain and remove the angle errors of whole-angle gyroscopes and sin/cos sensors.
#[derive(Parser)]
#[command(name = "cvg", version, about, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cvg demo                                          the paper's device, simulated, identified, compensated
  cvg identify campaign.toml --out results          the main job: report.html, report.json, calibration.toml
  cvg identify rot+500.csv --out results            one recording is a campaign of one run
  cvg compensate results/calibration.toml rot.csv --out rot-compensated.csv
  cvg simulate scenario.toml --out bench            a campaign, and what it was set to

Exit status: 0 done, 1 the data does not allow an answer, 2 bad use or bad input.";

#[derive(Subcommand)]
enum Command {
    /// The paper's device end to end: simulate, identify, compensate, report
    Demo {
        /// Folder for campaign and results
        #[arg(long, default_value = "cvg-demo")]
        out: PathBuf,
        /// Print report.json and nothing else to standard output
        #[arg(long)]
        json: bool,
    },
    /// Simulate a scenario: a campaign of recordings, and what it was set to
    Simulate {
        /// Scenario file (TOML)
        scenario: PathBuf,
        /// Folder for the campaign
        #[arg(long)]
        out: PathBuf,
    },
    /// Identify the instrument of a campaign: what is wrong with it, and the error before and after
    Identify {
        /// campaign.toml, or a single recording (CSV or Parquet)
        campaign: PathBuf,
        /// Folder for report.json, report.html and calibration.toml; without it only the summary is printed
        #[arg(long)]
        out: Option<PathBuf>,
        /// Print report.json and nothing else to standard output
        #[arg(long)]
        json: bool,
    },
    /// Figures 2, 3 and 4 of the paper from our models, as SVG, PNG and CSV, and its numbers beside ours
    Paper {
        /// Folder for figures, data and table
        #[arg(long)]
        out: PathBuf,
    },
    /// Take the identified errors out of a recording
    Compensate {
        /// calibration.toml from `cvg identify`
        calibration: PathBuf,
        /// Recording (CSV or Parquet)
        recording: PathBuf,
        /// File for the compensated recording (CSV, or Parquet where the name ends in .parquet)
        #[arg(long)]
        out: PathBuf,
    },
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) if error.use_stderr() => {
            eprintln!("{}", bad_use(&error));
            return ExitCode::from(2);
        }
        // help and version were asked for
        Err(error) => error.exit(),
    };
    let outcome = match arguments.command {
        Command::Demo { out, json } => demo::demo(&out, json),
        Command::Simulate { scenario, out } => commands::simulate(&scenario, &out),
        Command::Identify { campaign, out, json } => commands::identify(&campaign, out.as_deref(), json),
        Command::Paper { out } => paper::paper(&out),
        Command::Compensate { calibration, recording, out } => commands::compensate(&calibration, &recording, &out),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {}", failure.message);
            ExitCode::from(failure.status)
        }
    }
}

/// What is wrong with the arguments, and what would be right, in two lines.
fn bad_use(error: &clap::Error) -> String {
    let text = error.to_string();
    let mut what = if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        let root = Arguments::command();
        let commands: Vec<&str> = root.get_subcommands().map(clap::Command::get_name).collect();
        format!("error: a command is missing: {}", commands.join(", "))
    } else {
        text.lines().take_while(|line| !line.trim().is_empty()).map(str::trim).collect::<Vec<_>>().join(" ")
    };
    if let Some(similar) = text.lines().find_map(|line| line.trim().strip_prefix("tip: a similar ")) {
        what = format!("{what}; a similar {similar}");
    }
    let usage = text.lines().find_map(|line| line.strip_prefix("Usage: ")).unwrap_or("cvg <COMMAND>");
    format!("{what}\nusage: {usage} (more with --help)")
}

/// Why a command did not do its work.
struct Failure {
    message: String,
    status: u8,
}

impl Failure {
    /// Bad use or bad input.
    fn input(message: impl std::fmt::Display) -> Self {
        Self { message: message.to_string(), status: 2 }
    }
}

impl From<cvg_calibration::Refusal> for Failure {
    fn from(refusal: cvg_calibration::Refusal) -> Self {
        let status = match refusal.cause {
            cvg_calibration::Cause::BadInput => 2,
            cvg_calibration::Cause::NoAnswer => 1,
        };
        Self { message: refusal.to_string(), status }
    }
}

impl From<cvg_calibration::recording::ReadError> for Failure {
    fn from(error: cvg_calibration::recording::ReadError) -> Self {
        Self::input(error)
    }
}
