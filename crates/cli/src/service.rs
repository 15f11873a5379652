//! What the program does, without files and words of its own: for bindings to other languages.
//!
//! The functions are those of the commands, so that the same data has the same answer, to the byte, whoever asks.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::{Campaign, Instrument, Naming, Recording, Values};
use cvg_calibration::report::refused::About;
use cvg_calibration::{Answer, Options};
use cvg_model::effects::EffectId;
use cvg_simulator::Simulated;
use serde_json::Value;

use crate::commands::{self, Told};
pub use crate::compare::Parameter;
use crate::input::{self, Wanted};
pub use crate::limits::{Limits, Verdict};
use crate::{Failure, compare, fleet, inspect, library, report};

/// Columns of a recording by their names.
pub type Columns = Vec<(String, Values)>;

/// As much stack as the main thread of a program has.
pub const STACK_BYTES: usize = 8 << 20;

/// Does `work` in a process that is prepared the first time: no more threads than the machine has processors, and a damaged file
/// is an error, not a message of a decoder. RAYON_NUM_THREADS is read then.
///
/// A process that was forked from a prepared one has the memory of its threads and none of the threads, for which it would wait
/// for ever: it makes its own.
///
/// # Errors
/// Where the system gives a forked process no threads.
pub fn prepared<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, Failure> {
    static PREPARED: OnceLock<u32> = OnceLock::new();
    static FORKED: Mutex<Option<(u32, Arc<rayon::ThreadPool>)>> = Mutex::new(None);
    let this = std::process::id();
    let first = *PREPARED.get_or_init(|| {
        crate::keep_to_the_machine();
        this
    });
    if first == this {
        return Ok(work());
    }
    let mut forked = FORKED.lock().unwrap_or_else(PoisonError::into_inner);
    let own = match &*forked {
        Some((process, threads)) if *process == this => Arc::clone(threads),
        _ => {
            let threads = rayon::ThreadPoolBuilder::new().num_threads(crate::threads()).stack_size(STACK_BYTES).build();
            let threads = Arc::new(threads.map_err(|e| Failure::input(format!("no threads to work with: {e}")))?);
            if let Some((_, gone)) = forked.replace((this, Arc::clone(&threads))) {
                // those of the process before: to give them back is to wait for them
                std::mem::forget(gone);
            }
            threads
        }
    };
    drop(forked);
    Ok(own.install(work))
}

/// What is said of a campaign beside its recordings.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    /// what columns are called
    pub naming: Naming,
    /// s to leave out at the start of each recording
    pub settle_s: Option<f64>,
    /// two channels that read a sine and a cosine, and no gyroscope
    pub sensor: bool,
    /// name of the instrument
    pub device: Option<String>,
}

impl Settings {
    fn instrument(&self) -> Option<Instrument> {
        self.sensor.then_some(Instrument::Sensor)
    }

    fn named(&self, mut campaign: Campaign) -> Campaign {
        if let Some(device) = &self.device {
            campaign.device.clone_from(device);
        }
        input::as_wanted(campaign, self.sensor)
    }
}

/// The campaign of files, as `cvg identify` opens it.
///
/// # Errors
/// What cannot be read, or cannot be meant.
pub fn campaign_of_files(files: &[PathBuf], holdout: &[PathBuf], settings: &Settings) -> Result<Campaign, Failure> {
    let Settings { naming, settle_s, sensor, .. } = settings;
    let wanted = Wanted { naming, holdout, settle_s: *settle_s, sensor: *sensor };
    Ok(settings.named(input::campaign(files, &wanted)?))
}

/// A recording of columns in memory; `name` is what it is called.
///
/// # Errors
/// What is wrong with the columns, and what would mend it.
pub fn recording(columns: Columns, naming: &Naming, name: &str) -> Result<Recording, Failure> {
    Recording::of_columns(columns, naming, Path::new(name)).map_err(input::explained)
}

/// A campaign of rotations in memory: names and columns, the last `held_out` of which nothing is fitted to.
///
/// # Errors
/// As [`recording`], and where one is no rotation.
pub fn campaign_of_columns(
    runs: Vec<(String, Columns)>,
    held_out: usize,
    settings: &Settings,
) -> Result<Campaign, Failure> {
    let (fitted, several) = (runs.len().saturating_sub(held_out), runs.len() > 1);
    let read = runs.into_iter().map(|(name, columns)| recording(columns, &settings.naming, &name));
    let read: Vec<Recording> = read.collect::<Result<_, _>>()?;
    let settle_s = settings.settle_s.unwrap_or(0.0);
    let mut campaign = input::of_recordings(read, fitted, settle_s, settings.instrument())?;
    if several {
        // of files it is their folder, and these have none
        campaign.device = "recordings".to_owned();
    }
    Ok(settings.named(campaign))
}

/// The campaign of a campaign file's text whose recordings are in memory, each under the name that the text gives its file.
///
/// # Errors
/// As [`campaign_of_columns`], with line and column of the text, and where it names a recording that is not there.
pub fn campaign_of_text(
    text: &str,
    mut runs: BTreeMap<String, Columns>,
    settings: &Settings,
) -> Result<Campaign, Failure> {
    let opened =
        Campaign::of_text(text, Path::new("campaign"), &settings.naming, settings.instrument(), |file, naming| {
            let columns = runs.remove(&file.display().to_string()).unwrap_or_default();
            Recording::of_columns(columns, naming, file)
        });
    let mut campaign = opened.map_err(input::explained)?;
    // the text is no file that could be read again
    campaign.source = PathBuf::new();
    Ok(settings.named(campaign))
}

/// Effects as text, from their files.
///
/// # Errors
/// What is wrong with a file, or that two have one name.
pub fn written_effects(files: &[PathBuf]) -> Result<Vec<EffectId>, Failure> {
    Ok(commands::written(files)?.effects)
}

/// Limits of a report, from their file.
///
/// # Errors
/// What is wrong with the file.
pub fn limits_of_file(file: &Path) -> Result<Limits, Failure> {
    Limits::read(file)
}

/// Limits of a report, from the text of such a file.
///
/// # Errors
/// What is wrong with the text.
pub fn limits_of_text(text: &str) -> Result<Limits, Failure> {
    Limits::of_text(text, "limits")
}

/// A campaign, answered.
#[derive(Debug, Clone)]
pub struct Answered {
    answer: Answer,
    json: String,
    /// what the campaign calls each recording
    names: BTreeMap<String, String>,
}

/// A campaign without an answer.
#[derive(Debug, Clone)]
pub struct Unanswered {
    /// why
    pub failure: Failure,
    /// the report that says so, where the data was sound
    pub json: Option<String>,
}

impl From<Failure> for Unanswered {
    fn from(failure: Failure) -> Self {
        Self { failure, json: None }
    }
}

/// Answers a campaign, as `cvg identify` does.
///
/// # Errors
/// Why there is no answer.
pub fn answer(campaign: Campaign, effects: Vec<EffectId>, progress: &dyn Fn(&str)) -> Result<Answered, Unanswered> {
    let about = About::campaign(&campaign);
    let said = |path: &Path| path.display().to_string();
    let names = campaign.runs.iter().map(|run| (said(&run.recording.source), said(&run.file))).collect();
    let options = Options { effects, progress, ..Options::default() };
    match cvg_calibration::answer(campaign, &options) {
        Ok(answer) => {
            let (json, _) = Told::facts(&answer)?;
            Ok(Answered { answer, json, names })
        }
        Err(refusal) => {
            let json = serde_json::to_string_pretty(&about.refused(&refusal)).map_err(Failure::input)?;
            let failure = Failure::from(refusal);
            let json = failure.is_no_answer().then_some(json);
            Err(Unanswered { failure, json })
        }
    }
}

impl Answered {
    /// report.json
    #[must_use]
    pub fn json(&self) -> &str {
        &self.json
    }

    /// report.html
    ///
    /// # Errors
    /// Where a figure cannot be drawn.
    pub fn page(&self) -> Result<String, Failure> {
        match &self.answer {
            Answer::Identified(identified) => report::page(identified),
            Answer::Surveyed(surveyed) => report::survey::page(surveyed),
        }
    }

    /// What a person wants to read first.
    #[must_use]
    pub fn summary(&self) -> String {
        match &self.answer {
            Answer::Identified(identified) => report::summary::summary(identified),
            Answer::Surveyed(surveyed) => report::survey::summary(&surveyed.report),
        }
    }

    /// What undoes the errors, where something does.
    #[must_use]
    pub fn calibration(&self) -> Option<&Calibration> {
        match &self.answer {
            Answer::Identified(identified) => Some(&identified.calibration),
            Answer::Surveyed(surveyed) => surveyed.calibration.as_ref(),
        }
    }

    /// The parameters, as `cvg compare` and `cvg fleet` read them from the report.
    ///
    /// # Errors
    /// Where the report cannot be made.
    pub fn parameters(&self) -> Result<Vec<Parameter>, Failure> {
        // not by the text: who reads that is off in the last digit
        let report = match &self.answer {
            Answer::Identified(identified) => serde_json::to_value(&identified.report),
            Answer::Surveyed(surveyed) => serde_json::to_value(&surveyed.report),
        };
        Ok(compare::of_report(&report.map_err(Failure::input)?))
    }

    /// The report held against limits, as `cvg identify --limits` does.
    ///
    /// # Errors
    /// Where a limit names no number of the report.
    pub fn judged(&self, limits: &Limits) -> Result<Vec<Verdict>, Failure> {
        limits.verdicts(&serde_json::from_str(&self.json).map_err(Failure::input)?)
    }

    /// The instrument.
    #[must_use]
    pub fn device(&self) -> &str {
        match &self.answer {
            Answer::Identified(identified) => &identified.report.device,
            Answer::Surveyed(surveyed) => &surveyed.report.device,
        }
    }

    /// What the report calls the recording that a curve calls by its path.
    #[must_use]
    pub fn run<'a>(&'a self, curve: &'a str) -> &'a str {
        self.names.get(curve).map_or(curve, String::as_str)
    }

    /// The answer itself.
    #[must_use]
    pub fn answer(&self) -> &Answer {
        &self.answer
    }
}

/// What devices say together, as `cvg fleet --json` says it: of each its name, why it has no answer, and its report.
///
/// # Errors
/// Where a report is none.
pub fn population(devices: Vec<(String, Option<String>, Option<String>)>) -> Result<String, Failure> {
    serde_json::to_string_pretty(&fleet::population(devices)?).map_err(Failure::input)
}

/// What is in recordings, as `cvg inspect --json` says it.
///
/// # Errors
/// Where the text cannot be made.
pub fn inspected(recordings: &[Recording]) -> Result<String, Failure> {
    let facts: Vec<Value> = recordings.iter().map(inspect::as_value).collect();
    serde_json::to_string_pretty(&facts).map_err(Failure::input)
}

/// The recordings of files, those of a campaign in its order.
///
/// # Errors
/// What cannot be read.
pub fn recordings_of_files(files: &[PathBuf], naming: &Naming) -> Result<Vec<Recording>, Failure> {
    let mut out = Vec::new();
    for file in input::files(files)? {
        if input::is_campaign(&file) {
            let campaign = Campaign::open_named(&file, naming).map_err(input::explained)?;
            out.extend(campaign.runs.into_iter().map(|run| run.recording));
        } else {
            out.push(input::recording(&file, naming)?);
        }
    }
    Ok(out)
}

/// The library of effects, as `cvg effects --json` says it.
///
/// # Errors
/// Where the text cannot be made.
pub fn effects() -> Result<String, Failure> {
    library::all_as_json()
}

/// Simulates a scenario's text; `name` is what it is called where something is wrong with it.
///
/// # Errors
/// What is wrong with the scenario, with line and column.
pub fn simulate(text: &str, name: &str) -> Result<Simulated, Failure> {
    Ok(commands::scenario_of(text, name)?.simulate())
}
