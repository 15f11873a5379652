//! The command line: commands, options, help with examples.

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;
use cvg_calibration::recording::{Campaign, Naming};

use crate::{input, output};

/// Find, explain and remove the angle errors of whole-angle gyroscopes and sin/cos sensors.
#[derive(Parser)]
#[command(name = "cvg", version, about, after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Memory that a recording may take while it is read, as in 512M, 4G or 4GiB; a quarter of the machine's where nothing is said
    #[arg(long, global = true, value_name = "BYTES", value_parser = bytes)]
    pub(crate) max_memory: Option<u64>,
    #[command(subcommand)]
    pub(crate) command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cvg demo                                          the paper's device, simulated, identified, compensated
  cvg inspect rot+500.csv                           what is in a file, and what is wrong with it
  cvg identify campaign.toml --out results          the main job: report.html, report.json, calibration.toml
  cvg identify rot+500.csv --out results            one recording is a campaign of one run
  cvg compensate results/calibration.toml rot.csv --out rot-compensated.csv
  cvg simulate scenario.toml --out bench            a campaign, and what it was set to

Exit status: 0 done, 1 the data does not allow an answer or a limit failed, 2 bad use or bad input.";

const IDENTIFY: &str = "\
Examples:
  cvg identify campaign.toml --out results
  cvg identify 'rot*.csv' --out results             several recordings are a campaign of rotations
  cvg identify rot+500.csv rot-500.csv --holdout rot+350.csv --settle 1
  cvg identify encoder.csv --sensor --out results  a sin/cos sensor, with a reference or without
  cvg identify export.csv --map t_s=Time --map theta_deg=Ch3 --map rate_dps=Table
  cvg identify export.csv --map 't_s=Time (ms)*0.001' --map xc_v=Ch1 --map yc_v=Ch2 --map table_deg=Pos
  cvg identify campaign.toml --limits limits.toml  pass or fail on numbers of the report
  cvg identify campaign.toml --effect my-effect.toml  an effect of your own competes with the library's
  cvg identify rot.csv.gz --json";

const INSPECT: &str = "\
Examples:
  cvg inspect rot+500.csv
  cvg inspect export.mat --map t_s=time --map 'xc_v=iq(:,1)' --map 'yc_v=iq(:,2)'
  cvg inspect rot.csv --plot rot.svg
  cvg inspect *.csv --json";

const COMPENSATE: &str = "\
Examples:
  cvg compensate results/calibration.toml rot.csv --out clean.csv
  cvg compensate results/calibration.toml rot.parquet --out clean.parquet
  cvg compensate results/calibration.toml 'rot*.csv' --out clean --device dfp-7
  cvg compensate results/calibration.toml - --out clean.csv < rot.csv
  cvg compensate results/calibration.toml export.csv --map campaign.toml --out clean.csv";

const COMPARE: &str = "\
Examples:
  cvg compare before after                          two folders of results
  cvg compare monday/report.json friday/report.json --json
  cvg compare a/calibration.toml b/calibration.toml values alone: a calibration has no intervals";

const FIRMWARE: &str = "\
Examples:
  cvg firmware results/calibration.toml --out cvg_correction.h      float cvg_compensate(float x, float y)
  cvg firmware results/calibration.toml --out correction.rs         of an angle: pub fn cvg_compensate(theta_deg: f32, …) -> f32
  cvg firmware results/calibration.toml --out table.csv --points 64
  cvg firmware gyroscope/calibration.toml --out cvg_device.h        void cvg_device_undo(cvg_settings *)";

const EFFECTS: &str = "\
Examples:
  cvg effects                                       one line for each
  cvg effects detection-cubic                       one in full
  cvg effects --export detection-cubic > my-effect.toml";

const COMPLETIONS: &str = "\
Examples:
  cvg completions bash > ~/.local/share/bash-completion/completions/cvg
  cvg completions zsh > ~/.zfunc/_cvg
  cvg completions fish > ~/.config/fish/completions/cvg.fish";

/// A number of bytes, with K, M or G for thousands, millions or billions of them, Ki, Mi or Gi for powers of 1024.
fn bytes(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let digits = text.find(|sign: char| !sign.is_ascii_digit()).unwrap_or(text.len());
    let unit = match text[digits..].trim().to_ascii_uppercase().trim_end_matches('B') {
        "" => Some(1),
        "K" => Some(1_000),
        "M" => Some(1_000_000),
        "G" => Some(1_000_000_000),
        "KI" => Some(1 << 10),
        "MI" => Some(1 << 20),
        "GI" => Some(1 << 30),
        _ => None,
    };
    let number: Option<u64> = text[..digits].parse().ok();
    number
        .zip(unit)
        .and_then(|(number, unit)| number.checked_mul(unit))
        .filter(|bytes| *bytes > 0)
        .ok_or_else(|| "wanted bytes, as in 512M, 4G or 4GiB".into())
}

/// What the columns of foreign files mean.
#[derive(Args, Clone, Default)]
pub(crate) struct Mapping {
    /// Which column is which channel, for files with names of their own; a factor takes its unit to the channel's. Or a
    /// campaign.toml, whose table `columns` says it
    #[arg(long = "map", value_name = "CHANNEL=COLUMN[*FACTOR]")]
    entries: Vec<String>,
}

impl Mapping {
    /// The names, or what is wrong with them.
    pub(crate) fn naming(&self) -> Result<Naming, crate::Failure> {
        let (mut naming, mut filed) = (Naming::default(), Naming::default());
        for entry in &self.entries {
            let path = Path::new(entry);
            if !entry.contains('=') && input::is_campaign(path) {
                filed = Campaign::columns(path)?.over(&filed);
            } else {
                naming.add(entry).map_err(|e| crate::Failure::input(format!("--map: {e}")))?;
            }
        }
        for (channel, column) in naming.taken_from(&filed) {
            let what = "another channel has by --map: it is not read";
            output::tell(format_args!("warning: {channel} is `{column}` in the campaign.toml, which {what}"));
        }
        Ok(naming.over(&filed))
    }
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// The paper's device end to end: simulate, identify, compensate, report
    Demo {
        /// Folder for campaign and results
        #[arg(long, default_value = "cvg-demo")]
        out: PathBuf,
        /// Print report.json and nothing else to standard output
        #[arg(long)]
        json: bool,
        /// The device calibrates itself instead, without a table; the error over time
        #[arg(long, conflicts_with = "json")]
        self_calibration: bool,
    },
    /// Simulate a scenario: a campaign of recordings, and what it was set to
    Simulate {
        /// Scenario file (TOML)
        scenario: PathBuf,
        /// Folder for the campaign
        #[arg(long)]
        out: PathBuf,
    },
    /// Say what is in recordings or a campaign, and what is wrong with it
    #[command(after_help = INSPECT)]
    Inspect {
        /// campaign.toml or recordings (CSV, Parquet, .mat, HDF5); patterns like 'rot*.csv'; - for standard input
        #[arg(required = true)]
        files: Vec<PathBuf>,
        #[command(flatten)]
        mapping: Mapping,
        /// Draw the columns of the first recording over time into this file (.svg or .png)
        #[arg(long)]
        plot: Option<PathBuf>,
        /// Print the facts as JSON and nothing else to standard output
        #[arg(long)]
        json: bool,
    },
    /// Identify the instrument of a campaign: what is wrong with it, and the error before and after
    #[command(after_help = IDENTIFY)]
    Identify {
        /// campaign.toml, or recordings of rotations (CSV, Parquet, .mat, HDF5); patterns like 'rot*.csv'; - for standard
        /// input
        #[arg(required = true, value_name = "CAMPAIGN")]
        campaign: Vec<PathBuf>,
        /// Folder for report.json, report.html, calibration.toml and proposals; without it only the summary is printed
        #[arg(long)]
        out: Option<PathBuf>,
        /// Print report.json and nothing else to standard output
        #[arg(long)]
        json: bool,
        #[command(flatten)]
        mapping: Mapping,
        /// A further recording that nothing is fitted to; without one the last quarter of each is held out
        #[arg(long, value_name = "RECORDING")]
        holdout: Vec<PathBuf>,
        /// Seconds to drop at the start of each recording; a campaign.toml says that itself
        #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
        settle: Option<f64>,
        /// Two channels that read a sine and a cosine, and no gyroscope: instrument = "sensor", with a period of 360°
        #[arg(long)]
        sensor: bool,
        /// An effect written down as text (TOML), which competes with the library's; once for each
        #[arg(long, value_name = "EFFECT")]
        effect: Vec<PathBuf>,
        /// Limits of numbers of the report (TOML); a line each, and exit status 1 where one fails
        #[arg(long, value_name = "LIMITS")]
        limits: Option<PathBuf>,
    },
    /// Identify many devices in one call: a row for each, and what is odd or shared among them
    Fleet {
        /// Campaigns, folders with one or of such folders, patterns like 'devices/*/campaign.toml'; or Parquet with a column
        /// `device`, one file or a folder of them
        #[arg(required = true, value_name = "CAMPAIGN")]
        campaigns: Vec<PathBuf>,
        /// Folder for fleet.html, fleet.csv, fleet.parquet, fleet.json and a folder of results for each device; answers there that rest on
        /// the same files are kept
        #[arg(long)]
        out: PathBuf,
        /// Limits of numbers of each report (TOML); exit status 1 where a device fails one
        #[arg(long, value_name = "LIMITS")]
        limits: Option<PathBuf>,
        /// Write fleet-prior.csv as well: each device's values with what the others say of them beforehand (empirical
        /// Bayes); no report or calibration has it in it
        #[arg(long)]
        prior: bool,
        /// Print fleet.json and nothing else to standard output
        #[arg(long)]
        json: bool,
    },
    /// Say which parameters of two answers moved beyond their combined 95 % intervals
    #[command(after_help = COMPARE)]
    Compare {
        /// report.json, a folder of results, or calibration.toml
        a: PathBuf,
        /// The same of another day or device
        b: PathBuf,
        /// Print the comparison as JSON
        #[arg(long)]
        json: bool,
    },
    /// Take the identified errors out of recordings
    #[command(after_help = COMPENSATE)]
    Compensate {
        /// calibration.toml from `cvg identify`
        calibration: PathBuf,
        /// Recordings (CSV, Parquet, .mat, HDF5); patterns like 'rot*.csv'; - for standard input
        #[arg(required = true, value_name = "RECORDING")]
        recordings: Vec<PathBuf>,
        /// File for the compensated recording (.csv or .parquet); a folder for several, which keep their names
        #[arg(long)]
        out: PathBuf,
        /// Name of the instrument of the recordings; refused where the calibration is of another
        #[arg(long)]
        device: Option<String>,
        #[command(flatten)]
        mapping: Mapping,
    },
    /// Write the correction of an angle sensor for a controller: cvg_compensate(x, y) or cvg_compensate(theta), or a table
    #[command(after_help = FIRMWARE)]
    Firmware {
        /// calibration.toml from `cvg identify`
        calibration: PathBuf,
        /// C header (.h), of an angle a Rust module too (.rs), or a table of the angle alone (.csv)
        #[arg(long)]
        out: PathBuf,
        /// Points of a table over a period: 256; of an angle, whose header is a series without, a table in its place
        #[arg(long)]
        points: Option<usize>,
    },
    /// The library of effects: what a recording can hold
    #[command(after_help = EFFECTS)]
    Effects {
        /// Show this one in full
        effect: Option<String>,
        /// Print this one as an effect file, to begin one of your own with
        #[arg(long, value_name = "ID", conflicts_with_all = ["effect", "json", "markdown"])]
        export: Option<String>,
        /// Print the library as JSON
        #[arg(long, conflicts_with = "markdown")]
        json: bool,
        /// Print the library as the page of the book
        #[arg(long)]
        markdown: bool,
    },
    /// Figures 2, 3 and 4 of the paper from our models, as SVG, PNG and CSV, and its numbers beside ours
    Paper {
        /// Folder for figures, data and table
        #[arg(long)]
        out: PathBuf,
    },
    /// Print a completion script for a shell
    #[command(after_help = COMPLETIONS)]
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Write the manual pages, cvg.1 and one for each command
    Man {
        /// Folder for them
        #[arg(long)]
        out: PathBuf,
    },
}

#[cfg(test)]
mod tests {
    use super::bytes;

    #[test]
    fn memory_is_in_bytes_in_thousands_of_them_or_in_powers_of_1024() {
        let of = ["512", "4K", "512M", "4G", "4GB", "4GiB", "3 KiB", "2mib", "1gi"].map(|text| bytes(text).ok());
        let wanted = [512, 4_000, 512_000_000, 4_000_000_000, 4_000_000_000, 4 << 30, 3 << 10, 2 << 20, 1 << 30];
        assert_eq!(of, wanted.map(Some));
        for text in ["", "0", "G", "4T", "4iB", "4GiBi", "-1", "1.5G", "99999999999G"] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }
}
