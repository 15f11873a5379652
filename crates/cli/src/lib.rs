//! The library behind the command `cvg`: files in, reports out.
//!
//! [`run`] is the whole program. [`service`] is what it does without files and words of its own, for bindings to other
//! languages: what they answer is what the program answers.
#![forbid(unsafe_code)]

mod arguments;
mod clouds;
mod commands;
mod compare;
mod compensate;
mod demo;
mod failure;
mod figure;
mod firmware;
mod fleet;
mod input;
mod inspect;
mod library;
mod limits;
mod output;
mod paper;
mod population;
mod progress;
mod report;
mod report_keys;
mod self_calibration;
pub mod service;
mod standard;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};

use crate::arguments::{Arguments, Command};
pub use crate::failure::Failure;

/// The program: the arguments of the process in, an exit status out.
#[must_use]
pub fn run() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) if error.use_stderr() => {
            say(&bad_use(&error));
            return ExitCode::from(2);
        }
        // help and version were asked for
        Err(error) => error.exit(),
    };
    cvg_calibration::recording::limit_memory(arguments.max_memory.unwrap_or_default());
    keep_to_the_machine();
    match done(arguments.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            say(&format!("error: {}", failure.message));
            ExitCode::from(failure.status)
        }
    }
}

/// Works with no more threads than the machine has processors, whatever the environment says, and does not repeat what a
/// decoder says of a file that it panics at: the answer says it.
pub(crate) fn keep_to_the_machine() {
    // where the system gives no threads, the library says so when it wants the first
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads()).build_global();
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !cvg_calibration::recording::panic_is_answer() {
            usual(panic);
        }
    }));
}

/// How many threads to work with.
pub(crate) fn threads() -> usize {
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let asked = std::env::var("RAYON_NUM_THREADS").ok().and_then(|text| text.parse().ok()).filter(|n| *n > 0);
    asked.map_or(processors, |n: usize| n.min(processors))
}

fn done(command: Command) -> Result<(), Failure> {
    match command {
        Command::Demo { out, self_calibration: true, .. } => self_calibration::demo(&out),
        Command::Demo { out, json, .. } => demo::demo(&out, json),
        Command::Simulate { scenario, out } => commands::simulate(&scenario, &out),
        Command::Inspect { files, mapping, plot, json } => {
            inspect::inspect(&files, &mapping.naming()?, plot.as_deref(), json)
        }
        Command::Identify { campaign, out, json, mapping, holdout, settle, sensor, effect, limits } => {
            let naming = mapping.naming()?;
            let limits = limits.as_deref().map(limits::Limits::read).transpose()?;
            let wanted = input::Wanted { naming: &naming, holdout: &holdout, settle_s: settle, sensor };
            let effects = commands::written(&effect)?;
            limits.as_ref().map_or(Ok(()), |limits| limits.require_known(&effects.effects))?;
            commands::identify(|| input::campaign(&campaign, &wanted), effects, out.as_deref(), json, limits.as_ref())
        }
        Command::Fleet { campaigns, out, limits, prior, json } => {
            let limits = limits.as_deref().map(limits::Limits::read).transpose()?;
            limits.as_ref().map_or(Ok(()), |limits| limits.require_known(&[]))?;
            fleet::fleet(&campaigns, &out, &fleet::Asked { limits: limits.as_ref(), json, prior })
        }
        Command::Compare { a, b, json } => compare::compare(&a, &b, json),
        Command::Compensate { calibration, recordings, out, device, mapping } => {
            compensate::compensate(&calibration, &recordings, &out, device.as_deref(), &mapping.naming()?)
        }
        Command::Firmware { calibration, out, points } => firmware::firmware(&calibration, &out, points),
        Command::Effects { export: Some(id), .. } => library::export(&id),
        Command::Effects { effect, json, markdown, .. } => library::effects(effect.as_deref(), json, markdown),
        Command::Paper { out } => paper::paper(&out),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "cvg", &mut script);
            output::answer(&String::from_utf8_lossy(&script))
        }
        Command::Man { out } => commands::manual(&out),
    }
}

/// Says why on standard error; in colour where a person reads it and has not asked for none (NO_COLOR).
fn say(text: &str) {
    let plain = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty()) || !std::io::stderr().is_terminal();
    match text.strip_prefix("error:").filter(|_| !plain) {
        Some(rest) => output::tell_in_red("error:", rest),
        None => output::tell(format_args!("{text}")),
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
