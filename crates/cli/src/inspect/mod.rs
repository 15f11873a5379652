//! `cvg inspect`: what is in a file, and what is wrong with it.

mod doubts;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use cvg_calibration::recording::{Campaign, Channel, Instrument, Naming, ReadError, Recording, RunKind};
use serde_json::{Value, json};

use crate::figure::{BLUE, GREEN, PURPLE, Series, VERMILLION, panels, panels_png};
use crate::{Failure, input, output};

/// Characters of a column's small picture.
const SMALL: usize = 40;
/// Points of a plotted column.
const POINTS: usize = 2000;

/// Inspects files one after the other.
pub(crate) fn inspect(
    names: &[PathBuf],
    naming: &Naming,
    plotted: Option<&Path>,
    as_json: bool,
) -> Result<(), Failure> {
    let mut facts: Vec<Value> = Vec::new();
    let mut drawn = false;
    let files = input::files(names)?;
    for file in &files {
        let mut inputs = files.clone();
        let (instrument, recordings) = if input::is_campaign(file) {
            let campaign = Campaign::open_named(file, naming).map_err(input::explained)?;
            inputs.extend(input::sources(&campaign));
            if !as_json {
                let runs = output::counted(campaign.runs.len(), "run");
                output::answer(&format!("{}: {}, {runs}\n", file.display(), campaign.device))?;
                for w in &campaign.warnings {
                    output::answer(&format!("  warning: {w}\n"))?;
                }
            }
            let runs = campaign.runs.into_iter();
            (Some(campaign.instrument), runs.map(|run| (Some(run.kind), run.recording)).collect())
        } else {
            let read = input::read(file, naming);
            if let (false, Err(error)) = (as_json, &read) {
                output::answer(&unnamed(file, error))?;
            }
            (None, vec![(None, read.map_err(input::explained)?)])
        };
        for (kind, recording) in recordings {
            if let Some(path) = plotted.filter(|_| !drawn) {
                draw(&recording, path, &inputs)?;
                drawn = true;
            }
            if as_json {
                facts.push(as_value(&recording));
            } else {
                output::answer(&in_words(&recording, kind, instrument))?;
            }
        }
    }
    if as_json {
        output::answer(&format!("{}\n", serde_json::to_string_pretty(&facts).map_err(Failure::input)?))?;
    }
    Ok(())
}

/// A column in numbers.
struct Summary {
    name: String,
    missing: usize,
    low: f64,
    mean: f64,
    high: f64,
    small: String,
}

fn summaries(recording: &Recording) -> Vec<Summary> {
    let channels = Channel::ALL.into_iter().filter(|c| *c != Channel::Time);
    channels.filter_map(|c| recording.channel(c).map(|v| summary(c.name(), v))).collect()
}

/// What the columns of a foreign file hold; nothing where that cannot be told.
fn unnamed(file: &Path, error: &ReadError) -> String {
    let Some(columns) = input::foreign_columns(file, error) else { return String::new() };
    let rows = columns.first().map_or(0, |(_, values)| values.len());
    let mut s = format!("{}: {rows} rows whose columns have names of their own\n", file.display());
    table(&mut s, &columns.iter().map(|(name, values)| summary(name, values)).collect::<Vec<_>>());
    s
}

/// The columns, a line each.
fn table(s: &mut String, columns: &[Summary]) {
    let wide = columns.iter().map(|x| x.name.chars().count()).max().unwrap_or(0).clamp(10, 30);
    let _ = writeln!(
        s,
        "  {:<wide$} {:>14} {:>14} {:>14} {:>8}  over time",
        "column", "smallest", "mean", "largest", "missing"
    );
    for x in columns {
        let _ = writeln!(
            s,
            "  {:<wide$} {:>14} {:>14} {:>14} {:>8}  {}",
            x.name,
            short(x.low),
            short(x.mean),
            short(x.high),
            x.missing,
            x.small
        );
    }
}

/// A number in at most fourteen places.
fn short(value: f64) -> String {
    let digits = format!("{value:.6}");
    if digits.len() <= 14 { digits } else { format!("{value:.7e}") }
}

fn summary(name: &str, values: &[f64]) -> Summary {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let count = finite().count();
    const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let bar = |part: &[f64]| {
        let mean = part.iter().sum::<f64>() / part.len() as f64;
        let share = if high > low { (mean - low) / (high - low) } else { 0.5 };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of eight bars")]
        let at = (share * 7.99) as usize;
        BARS[at.min(7)]
    };
    let small = values.chunks(values.len().div_ceil(SMALL).max(1)).map(bar).collect();
    Summary {
        name: name.to_owned(),
        missing: values.len() - count,
        low,
        mean: finite().sum::<f64>() / count.max(1) as f64,
        high,
        small,
    }
}

/// Duration, median interval and largest interval, s.
fn timing(t: &[f64]) -> (f64, f64, f64) {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let middle = steps.get(steps.len() / 2).copied().unwrap_or(f64::NAN);
    let largest = steps.last().copied().unwrap_or(f64::NAN);
    (t.last().copied().unwrap_or(0.0) - t.first().copied().unwrap_or(0.0), middle, largest)
}

/// What a recording serves for, or what it lacks; the instrument is what a campaign says.
fn uses(recording: &Recording, kind: Option<RunKind>, instrument: Option<Instrument>) -> Vec<String> {
    let say = |kind: &str, asked: Result<(), ReadError>| match asked {
        Ok(()) => format!("serves as {kind}"),
        Err(ReadError::MissingColumns { needed, .. }) => format!("does not serve as {kind}: it needs {needed}"),
        Err(error) => format!("does not serve as {kind}: {error}"),
    };
    let rotation = if recording.require_rotation().is_ok() && input::stands_still(recording) {
        "does not serve as a rotation: the table does not turn".to_owned()
    } else {
        say("a rotation", recording.require_rotation())
    };
    let mut out = vec![rotation];
    if kind == Some(RunKind::Static) {
        return vec!["serves at rest".to_owned()];
    }
    if recording.require_rotation().is_err() {
        if recording.xc_v.is_some() && recording.yc_v.is_some() {
            out.push("serves as a sensor without a reference (--sensor)".to_owned());
        }
        out.push(say("a free decay", recording.require_decay()));
    }
    let turns = recording.require_rotation().is_ok() && !input::stands_still(recording);
    if !turns {
        out.push(say("a ring-down", recording.require_ringdown()));
    }
    let hint = instrument.is_none().then(|| doubts::looks_like_a_sensor(recording)).flatten();
    let is_sensor = hint.is_some() || instrument == Some(Instrument::Sensor);
    out.extend(hint);
    if !is_sensor && (recording.vas_v.is_none() || recording.vqc_v.is_none()) {
        out.push("without vas_v and vqc_v the commands' share in the angle is not known".into());
    }
    out
}

fn in_words(recording: &Recording, kind: Option<RunKind>, instrument: Option<Instrument>) -> String {
    let mut s = String::new();
    let mut line = |text: String| {
        let _ = writeln!(s, "{text}");
    };
    let d = &recording.dropped;
    let (duration, interval, largest) = timing(&recording.t_s);
    let stated = kind.map_or("", |k| match k {
        RunKind::Rotation => ", a rotation",
        RunKind::Ringdown { .. } => ", a ring-down",
        RunKind::CrossAxis => ", turned across the input axis",
        RunKind::Static => ", at rest",
        RunKind::Decay => ", a free decay",
        RunKind::Virtual => ", virtual precession",
    });
    line(format!("{}{stated}", recording.source.display()));
    let dropped =
        format!("{} dropped", output::counted(usize::try_from(d.rows_dropped()).unwrap_or(usize::MAX), "row"));
    line(match recording.len() {
        rows @ 0..2 => format!("  {}, of which nothing can be told; {dropped}", output::counted(rows, "row")),
        rows => format!(
            "  {rows} rows over {duration:.3} s, one every {interval:.6} s ({:.2} Hz), largest gap {largest:.6} s; \
             {dropped}",
            1.0 / interval
        ),
    });
    table(&mut s, &summaries(recording));
    let mut line = |text: String| {
        let _ = writeln!(s, "{text}");
    };
    for u in uses(recording, kind, instrument) {
        line(format!("  {u}"));
    }
    let warnings = warnings(recording);
    if warnings.is_empty() && recording.len() > 1 {
        line("  nothing is wrong with it".into());
    }
    for w in warnings {
        line(format!("  warning: {w}"));
    }
    s
}

/// What is wrong with a recording: what was seen on reading it, and what no instrument could follow.
fn warnings(recording: &Recording) -> Vec<String> {
    recording.warnings.iter().cloned().chain(doubts::turns_too_far(recording)).collect()
}

pub(crate) fn as_value(recording: &Recording) -> Value {
    let (duration_s, interval_s, largest_interval_s) = timing(&recording.t_s);
    let columns: Vec<Value> = summaries(recording)
        .iter()
        .map(|x| json!({"name": x.name, "smallest": x.low, "mean": x.mean, "largest": x.high, "missing": x.missing}))
        .collect();
    json!({
        "file": recording.source.display().to_string(), "rows": recording.len(),
        "rows_dropped": recording.dropped.rows_dropped(), "duration_s": duration_s, "interval_s": interval_s,
        "largest_interval_s": largest_interval_s, "columns": columns,
        "unknown_columns": recording.unknown.iter().map(|u| u.name.as_str()).collect::<Vec<_>>(),
        "rotation": recording.require_rotation().is_ok() && !input::stands_still(recording), "ringdown": recording.require_ringdown().is_ok(),
        "warnings": warnings(recording),
    })
}

/// The columns over time, a panel each, over one axis of time. A column that never changes has a panel too.
fn draw(recording: &Recording, path: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    let is = |name: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(name));
    if !(is("svg") || is("png")) {
        return Err(Failure::input(format!("--plot {}: wanted a name that ends in .svg or .png", path.display())));
    }
    let shown: Vec<Summary> = summaries(recording).into_iter().filter(|x| x.high >= x.low).collect();
    let stride = recording.len().div_ceil(POINTS).max(1);
    let names: Vec<String> = shown.iter().map(named).collect();
    let series: Vec<Series<'_>> = shown
        .iter()
        .zip(&names)
        .zip([BLUE, VERMILLION, GREEN, PURPLE].into_iter().cycle())
        .map(|((x, name), colour)| {
            let values = Channel::of(&x.name).and_then(|c| recording.channel(c)).unwrap_or_default();
            let points = recording.t_s.iter().copied().zip(values.iter().copied()).step_by(stride);
            Series { name, colour, points: points.filter(|(_, v)| v.is_finite()).collect(), joined: true }
        })
        .collect();
    if is("png") {
        output::write_with(path, inputs, |part| panels_png(part, "time [s]", &series))?;
    } else {
        output::write(path, panels("time [s]", &series)?.as_bytes(), inputs)?;
    }
    output::tell(format_args!("wrote {}", path.display()));
    Ok(())
}

/// A column's name as its panel has it, with what is missing of it.
fn named(x: &Summary) -> String {
    if x.missing == 0 { x.name.clone() } else { format!("{}, {} missing", x.name, output::counted(x.missing, "value")) }
}
