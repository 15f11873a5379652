//! What each command does.

use std::path::{Path, PathBuf};

use clap::CommandFactory;
use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::{Campaign, read_text};
use cvg_calibration::report::refused::{About, Refused};
use cvg_calibration::{Answer, Cause, EffectText, Identification, Options};
use cvg_model::effects::EffectId;
use cvg_simulator::{Scenario, ScenarioError};

use crate::arguments::Arguments;
use crate::failure::line_and_column;
use crate::limits::Limits;
use crate::progress::Progress;
use crate::report::summary::summary;
use crate::{Failure, input, output, report};

/// `cvg simulate`
pub(crate) fn simulate(scenario: &Path, out: &Path) -> Result<(), Failure> {
    let text =
        read_text(scenario).map_err(|e| Failure::input(format!("{}: cannot be read: {e}", scenario.display())))?;
    let parsed = scenario_of(&text, &scenario.display().to_string())?;
    output::check_folder(out)?;
    let progress = Progress::begin();
    progress.say("simulating");
    let set = output::Set::begin(out, &[scenario.to_owned()])?;
    parsed.write(set.folder()).map_err(Failure::input)?;
    set.commit()?;
    drop(progress);
    output::tell(format_args!("wrote {}", out.join("campaign.toml").display()));
    Ok(())
}

/// A scenario's text; `name` is what it is called where something is wrong with it.
pub(crate) fn scenario_of(text: &str, name: &str) -> Result<Scenario, Failure> {
    Scenario::parse(text).map_err(|e| {
        let at = if let ScenarioError::Unreadable(e) = &e { e.span().map(|span| span.start) } else { None };
        Failure::within(format!("{name}: {}", scenario_problem(&e, text)), name).at(text, at)
    })
}

/// What is wrong with a scenario and where, in one line.
fn scenario_problem(error: &ScenarioError, text: &str) -> String {
    let ScenarioError::Unreadable(unreadable) = error else { return error.to_string() };
    let (line, column) = unreadable.span().and_then(|span| line_and_column(text, span.start)).unwrap_or((1, 1));
    let message = unreadable.message().split_whitespace().collect::<Vec<_>>().join(" ");
    format!("line {line}, column {column}: {message}")
}

/// Effects as text, and the files that they were read from.
pub(crate) struct Written {
    pub(crate) effects: Vec<EffectId>,
    files: Vec<PathBuf>,
}

/// The files that proposals may be in: more than an identification has effects.
fn proposal_names() -> Vec<String> {
    (1..=16).map(|number| format!("proposal-{number}.toml")).collect()
}

/// Effects as text, each by a name of its own.
pub(crate) fn written(files: &[PathBuf]) -> Result<Written, Failure> {
    let mut effects: Vec<EffectId> = Vec::new();
    for file in files {
        let effect = EffectText::read(file)?.effect(&file.display().to_string())?;
        let id = effect.description().id;
        if effects.iter().any(|e| e.description().id == id) {
            return Err(Failure::input(format!("{}: there are two effects `{id}`", file.display())));
        }
        effects.push(effect);
    }
    Ok(Written { effects, files: files.to_vec() })
}

/// `cvg identify`: files where a folder is given, a summary or the report on standard output.
pub(crate) fn identify(
    open: impl FnOnce() -> Result<Campaign, Failure>,
    effects: Written,
    out: Option<&Path>,
    json: bool,
    limits: Option<&Limits>,
) -> Result<(), Failure> {
    out.map_or(Ok(()), output::check_folder)?;
    let progress = Progress::begin();
    progress.say("reading");
    let opened = open()?;
    let mut inputs = input::sources(&opened);
    inputs.extend(effects.files);
    let effects = effects.effects;
    let proposals = proposal_names();
    let names: Vec<&str> = RESULTS.into_iter().chain(proposals.iter().map(String::as_str)).collect();
    out.map_or(Ok(()), |out| output::check_folder_for(out, &names, &inputs))?;
    let about = About::campaign(&opened);
    let options = Options { effects, progress: &|what| progress.say(what), ..Options::default() };
    let told = match cvg_calibration::answer(opened, &options) {
        Ok(answer) => Told::of(&answer)?,
        Err(refusal) => {
            drop(progress);
            if refusal.cause == Cause::NoAnswer {
                refuse(&about.refused(&refusal), out, &inputs, json)?;
            }
            return Err(refusal.into());
        }
    };
    drop(progress);
    if let Some(out) = out {
        let [report, page, calibration] = RESULTS;
        let mut set = output::Set::begin(out, &inputs)?;
        set.add(report, told.json.as_bytes())?;
        set.add(page, told.page.as_bytes())?;
        match &told.calibration {
            Some(text) => set.add(calibration, text.as_bytes())?,
            None => set.take_away(&[calibration]),
        }
        for (name, text) in &told.proposals {
            set.add(name, text.as_bytes())?;
        }
        let stale = proposals.iter().filter(|name| !told.proposals.iter().any(|(n, _)| n == *name));
        set.take_away(&stale.map(String::as_str).collect::<Vec<_>>());
        set.commit()?;
        output::tell(format_args!("wrote {}", out.join("report.html").display()));
    }
    if json {
        output::answer(&format!("{}\n", told.json))?;
    } else {
        output::answer(&told.summary)?;
    }
    let facts = serde_json::from_str(&told.json).map_err(Failure::input)?;
    let judgement = limits.map(|limits| limits.judge(&told.device, &facts)).transpose()?.unwrap_or_default();
    judgement.tell();
    told.reason.or(judgement.outside).map_or(Ok(()), |reason| Err(Failure::no_answer(reason)))
}

/// An answer as it is handed out.
pub(crate) struct Told {
    device: String,
    json: String,
    page: String,
    calibration: Option<String>,
    /// names and texts of effect files
    proposals: Vec<(String, String)>,
    summary: String,
    /// why nothing is undone, where nothing is
    reason: Option<String>,
}

impl Told {
    /// report.json and, where something is undone, calibration.toml.
    pub(crate) fn facts(answer: &Answer) -> Result<(String, Option<String>), Failure> {
        match answer {
            Answer::Identified(identified) => Ok((report::json(identified)?, Some(identified.calibration.to_text()))),
            Answer::Surveyed(surveyed) => {
                let json = serde_json::to_string_pretty(&surveyed.report).map_err(Failure::input)?;
                Ok((json, surveyed.calibration.as_ref().map(Calibration::to_text)))
            }
        }
    }

    fn of(answer: &Answer) -> Result<Self, Failure> {
        let (json, calibration) = Self::facts(answer)?;
        match answer {
            Answer::Identified(identified) => {
                let page = report::page(identified)?;
                let reason = identified.report.reason.clone();
                let device = identified.report.device.clone();
                let file = |p: &EffectText| (format!("{}.toml", p.id), p.to_text());
                let proposals = identified.report.proposals.iter().map(file).collect();
                Ok(Self { device, json, page, calibration, proposals, summary: summary(identified), reason })
            }
            Answer::Surveyed(surveyed) => Ok(Self {
                device: surveyed.report.device.clone(),
                page: report::survey::page(surveyed)?,
                json,
                calibration,
                proposals: Vec::new(),
                summary: report::survey::summary(&surveyed.report),
                reason: surveyed.report.reason.clone(),
            }),
        }
    }
}

/// Says in report.json that there is no answer. What an earlier identification left beside it is not of this campaign, and
/// goes.
fn refuse(refused: &Refused, out: Option<&Path>, inputs: &[PathBuf], json: bool) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(refused).map_err(Failure::input)?;
    if let Some(out) = out {
        let [report, stale @ ..] = RESULTS;
        let mut set = output::Set::begin(out, inputs)?;
        set.add(report, text.as_bytes())?;
        set.take_away(&stale);
        set.take_away(&proposal_names().iter().map(String::as_str).collect::<Vec<_>>());
        set.commit()?;
        output::tell(format_args!("wrote {}", out.join("report.json").display()));
    }
    if json { output::answer(&format!("{text}\n")) } else { Ok(()) }
}

/// Identifies a campaign, and says what is being done where a person is waiting.
pub(crate) fn run(open: impl FnOnce() -> Result<Campaign, Failure>) -> Result<Identification, Failure> {
    let progress = Progress::begin();
    progress.say("reading");
    let options = Options { progress: &|what| progress.say(what), ..Options::default() };
    Ok(cvg_calibration::identify_with_plots(open()?, &options)?)
}

/// Names of the results.
pub(crate) const RESULTS: [&str; 3] = ["report.json", "report.html", "calibration.toml"];

/// The texts of [`RESULTS`].
pub(crate) fn results(identified: &Identification) -> Result<[String; 3], Failure> {
    Ok([report::json(identified)?, report::page(identified)?, identified.calibration.to_text()])
}

/// `cvg man`: a manual page for the program and for each of its commands.
pub(crate) fn manual(out: &Path) -> Result<(), Failure> {
    output::check_folder(out)?;
    let program = Arguments::command();
    let mut pages = vec![("cvg.1".to_owned(), program.clone())];
    for command in program.get_subcommands() {
        let name = format!("cvg-{}", command.get_name());
        pages.push((format!("{name}.1"), command.clone().name(name)));
    }
    let mut written = Vec::new();
    for (file, command) in pages {
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page).map_err(Failure::input)?;
        written.push((file, page));
    }
    let files: Vec<_> = written.iter().map(|(file, page)| (file.as_str(), page.as_slice())).collect();
    output::write_all(out, &files, &[])?;
    output::tell(format_args!("wrote {} pages into {}", files.len(), out.display()));
    Ok(())
}
