//! Rows and columns that cannot be what they say: values that stood still while the table turned.
//!
//! A value is *held* where it stays the same to the last bit while the input turns, and then makes up for it in one jump.
//! A coarse converter stays the same as well, but jumps by its own step only; a table at rest does so with the input.

use std::ops::Range;

use crate::data::copies;
use crate::data::held_reference;
use crate::data::interpolated;
use crate::data::rail::rows_at_rails;
use crate::data::references::references;
use crate::data::{leaping_rows, rate_spikes};
use crate::numerics::statistics::median;
use crate::recording::{Channel, Recording, Run};

/// A held value makes up for it by more than this many of its usual smallest steps.
pub(super) const JUMP: f64 = 3.0;
/// The smallest steps of a column: this share of all that are not zero are smaller.
const SMALLEST: f64 = 0.05;
/// So many rows in a row are held in one channel alone, or alike in both, before it counts.
pub(super) const HELD_ALONE: usize = 5;
/// More than this share of the rows of a recording cannot be lost from it, unless all of it is held alike.
pub(crate) const MOST_LOST: f64 = 0.3;
/// A recording is held throughout where this share of its values is of one age.
const THROUGHOUT: f64 = 0.8;
/// … of at least so many ages: one value that stands to the end was not read at all.
const FEWEST_AGES: usize = 16;
/// A value that is clipped stands still for more than this many times as long as a step of its converter makes it.
const CLIPPED: f64 = 2.0;

/// What was found wrong with a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Findings {
    /// what was mended by leaving rows out; each names the recording and the rows
    pub(crate) warnings: Vec<String>,
    /// why the recording serves for nothing
    pub(crate) broken: Option<Broken>,
    /// by which share table and rate differ, where they do
    pub(crate) references_apart: f64,
    /// rows in which a channel leapt
    pub(crate) spikes: usize,
}

/// Why a recording serves for nothing.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Broken {
    /// what is wrong
    pub(crate) problem: String,
    /// what would be right
    pub(crate) wanted: String,
}

/// Rows from which on a command that never changes is none.
const FEWEST_COMMANDS: usize = 50;

/// Leaves out of a recording the rows that were not recorded anew, and says what cannot be mended.
pub(crate) fn mend(recording: &mut Recording) -> Findings {
    let mut findings = Findings::default();
    let name = recording.source.display().to_string();
    findings.warnings.extend(held_reference::go_on_evenly(recording));
    rate_spikes::leave_out(recording, &name, &mut findings.warnings);
    match references(recording, &name, &mut findings.warnings) {
        Ok(apart) => findings.references_apart = apart,
        Err(broken) => {
            findings.broken = Some(broken);
            return findings;
        }
    }
    let at_rails = rows_at_rails(recording);
    let clipped = at_rails.iter().filter(|at| **at).count();
    if clipped as f64 > MOST_LOST * recording.len() as f64 {
        findings.broken = Some(Broken {
            problem: format!("{clipped} of {} rows stand at the rail of a channel: it is clipped", recording.len()),
            wanted: "a range of the converter that the amplitude does not exceed".into(),
        });
        return findings;
    }
    if clipped > 0 {
        findings
            .warnings
            .push(format!("{name}: {clipped} rows stand at the rail of a channel and are left out: it is clipped"));
        leave_out(recording, &at_rails);
    }
    copies::leave_out(recording, &name, &mut findings);
    if findings.broken.is_some() {
        return findings;
    }
    interpolated::leave_out(recording, &name, &mut findings);
    // after what puts whole rows in the place of others, and before values that stand still up to a leap
    if let Some((rows, said)) = leaping_rows::mend(recording) {
        findings.spikes = rows;
        findings.warnings.push(said);
    }
    let rows = recording.len();
    let held = held_rows(recording);
    let lost: usize = held.iter().map(Range::len).sum();
    if lost == 0 {
        return findings;
    }
    let places = places(&recording.t_s, &held);
    let usual = median(&mut held.iter().map(|r| r.len() as f64).collect::<Vec<_>>());
    let alike = held.iter().filter(|r| (r.len() as f64 - usual).abs() < 0.5).map(Range::len).sum::<usize>();
    let throughout = held.len() >= FEWEST_AGES
        && alike as f64 > THROUGHOUT * lost as f64
        && held.len() as f64 * (usual + 1.0) > THROUGHOUT * rows as f64;
    if throughout {
        findings.warnings.push(format!(
            "{name}: every value is held for {:.0} rows: the instrument was read more slowly than it was written; {lost} \
             repeated rows are left out",
            usual + 1.0
        ));
    } else if lost as f64 > MOST_LOST * rows as f64 {
        findings.broken = Some(Broken {
            problem: format!("{lost} of {rows} rows repeat the one before while the table turns: {places}"),
            wanted: "a recording whose values are read anew for every row".into(),
        });
        return findings;
    } else {
        findings.warnings.push(format!(
            "{name}: values stand still while the table turns: {places}; these {lost} rows are left out"
        ));
    }
    let mut repeated = vec![false; rows];
    held.into_iter().for_each(|r| repeated[r].fill(true));
    leave_out(recording, &repeated);
    findings
}

/// Leaves out of a sensor's recording the few stretches in which its values stand still while the table turns, and says so. Many of
/// them are the digits of a coarse sensor.
pub(crate) fn without_frozen_rows(recording: &mut Recording) -> Option<String> {
    let rows = recording.len();
    let held = held_at_once(recording, &columns_of_the_angle(recording)).into_iter();
    let held: Vec<Range<usize>> = held.filter(|r| r.len() >= HELD_ALONE).collect();
    let lost: usize = held.iter().map(Range::len).sum();
    if lost == 0 || held.len() >= FEWEST_AGES || lost as f64 > MOST_LOST * rows as f64 {
        return None;
    }
    let said = format!(
        "{}: values stand still while the table turns: {}; these {lost} rows are left out",
        recording.source.display(),
        places(&recording.t_s, &held)
    );
    let mut frozen = vec![false; rows];
    held.into_iter().for_each(|r| frozen[r].fill(true));
    leave_out(recording, &frozen);
    Some(said)
}

/// Where these rows are, by number and time: the longest stretches, and how many more there are.
pub(crate) fn places(t: &[f64], rows: &[Range<usize>]) -> String {
    let place =
        |r: &Range<usize>| format!("rows {} to {} ({:.3} s to {:.3} s)", r.start + 1, r.end, t[r.start], t[r.end - 1]);
    let mut longest: Vec<&Range<usize>> = rows.iter().collect();
    longest.sort_by_key(|r| (std::cmp::Reverse(r.len()), r.start));
    let list: Vec<String> = longest.iter().take(3).map(|r| place(r)).collect();
    let more = if rows.len() > 3 { format!(" and {} more stretches", rows.len() - 3) } else { String::new() };
    format!("{}{more}", list.join(", "))
}

/// Rows that say what the row before says although the table turned: in all channels of the angle at once, in one of them,
/// or in the table's own.
pub(crate) fn held_rows(recording: &Recording) -> Vec<Range<usize>> {
    let rows = recording.len();
    let angle = columns_of_the_angle(recording);
    let table = recording.table_deg.as_deref().and_then(|v| Column::new(v, Some(360.0)));
    let mut held = vec![false; rows];
    let mut mark = |ranges: Vec<Range<usize>>| ranges.into_iter().for_each(|r| held[r].fill(true));
    mark(held_at_once(recording, &angle));
    let main: Vec<&Column<'_>> = angle.iter().filter(|c| c.is_main).collect();
    for (at, column) in main.iter().enumerate() {
        let moves = |r: &Range<usize>| {
            main.iter().enumerate().any(|(other, c)| other != at && c.moved(r.start - 1, r.end - 1) > JUMP)
        };
        let alone = repeats(rows, |i| column.repeats(i)).into_iter().filter(|r| r.len() + 1 >= HELD_ALONE);
        let stuck = |r: &Range<usize>| {
            let others = || main.iter().enumerate().filter(|(other, _)| *other != at).map(|(_, c)| *c);
            caught_up(std::iter::once(*column), r, rows) || column.clips(r, others())
        };
        mark(alone.filter(|r| moves(r) && stuck(r)).collect());
    }
    if let Some(table) = table.filter(|_| !main.is_empty()) {
        let moves = |r: &Range<usize>| main.iter().any(|c| c.moved(r.start - 1, r.end - 1) > JUMP);
        let stuck = repeats(rows, |i| table.repeats(i)).into_iter();
        mark(stuck.filter(|r| moves(r) && caught_up(std::iter::once(&table), r, rows)).collect());
    }
    repeats(rows, |i| held[i])
}

fn columns_of_the_angle(recording: &Recording) -> Vec<Column<'_>> {
    let columns = [Channel::Xc, Channel::Xs, Channel::Yc, Channel::Ys, Channel::Theta].into_iter();
    columns.filter_map(|c| Column::new(recording.channel(c)?, (c == Channel::Theta).then_some(180.0))).collect()
}

/// Rows that say what the row before says, in all of these columns, although the table turned.
fn held_at_once(recording: &Recording, angle: &[Column<'_>]) -> Vec<Range<usize>> {
    if angle.is_empty() {
        return Vec::new();
    }
    let (rows, input) = (recording.len(), Input::of(recording));
    let all = repeats(rows, |i| angle.iter().all(|c| c.repeats(i)));
    all.into_iter().filter(|r| input.turns(r) && caught_up(angle.iter(), r, rows)).collect()
}

/// One column and the size of its small steps.
#[derive(Debug)]
pub(super) struct Column<'a> {
    values: &'a [f64],
    period: Option<f64>,
    /// a small step, the smallest one, and a usual one
    small: f64,
    smallest: f64,
    usual: f64,
    /// smallest and largest value
    span: [f64; 2],
    is_main: bool,
}

impl<'a> Column<'a> {
    /// `None` of a column that never changes.
    pub(super) fn new(values: &'a [f64], period: Option<f64>) -> Option<Self> {
        let span = values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(*v), h.max(*v)]);
        let mut column = Self { values, period, small: 0.0, smallest: 0.0, usual: 0.0, span, is_main: false };
        let mut steps: Vec<f64> = (1..values.len()).map(|i| column.step(i - 1, i)).filter(|d| *d > 0.0).collect();
        if steps.is_empty() {
            return None;
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a count")]
        let small = (SMALLEST * steps.len() as f64) as usize;
        column.small = *steps.select_nth_unstable_by(small, f64::total_cmp).1;
        column.smallest = steps[..=small].iter().copied().fold(f64::INFINITY, f64::min);
        column.usual = median(&mut steps);
        // what hardly moves in all is noise around a constant, and no part of the angle
        column.is_main = span[1] - span[0] > 30.0 * column.small;
        Some(column)
    }

    fn step(&self, from: usize, to: usize) -> f64 {
        let d = self.values[to] - self.values[from];
        self.period.map_or(d, |p| d - p * (d / p).round()).abs()
    }

    fn repeats(&self, i: usize) -> bool {
        #[allow(clippy::float_cmp, reason = "the same to the last bit is the point")]
        let same = self.values[i] == self.values[i - 1];
        same
    }

    /// Whether it stands at its largest or smallest value while another moves by more than it would around the top of a
    /// circle that is read in steps: cos φ stays within a step q of 1 for |φ| < √(2q).
    #[allow(clippy::float_cmp, reason = "the same to the last bit is the point")]
    fn clips<'b>(&self, rows: &Range<usize>, mut others: impl Iterator<Item = &'b Column<'b>>) -> bool {
        let at_end = self.span.contains(&self.values[rows.start]);
        let amplitude = 0.5 * (self.span[1] - self.span[0]);
        let flat = 2.0 * (2.0 * self.smallest / amplitude).sqrt();
        at_end && others.any(|c| c.step(rows.start - 1, rows.end - 1) > CLIPPED * flat * 0.5 * (c.span[1] - c.span[0]))
    }

    /// How far it moved, in its small steps.
    pub(super) fn moved(&self, from: usize, to: usize) -> f64 {
        self.step(from, to) / self.small
    }
}

/// Takes an energy command that never changes before `off_s`, when its loop is switched off, for one that was not recorded, and
/// says so: noise alone moves what holds an amplitude.
pub(crate) fn without_dead_command(recording: &mut Recording, off_s: f64, warnings: &mut Vec<String>) -> bool {
    let on = recording.t_s.partition_point(|t| *t < off_s);
    let never_changes = |v: &[f64]| v.windows(2).all(|v| v[0] == v[1]);
    let v_as = recording.vas_v.as_deref().and_then(|v| v.get(..on));
    let is_dead = v_as.is_some_and(|v| v.len() >= FEWEST_COMMANDS && never_changes(v));
    if is_dead {
        let v_as = recording.vas_v.take().and_then(|v| v.first().copied()).unwrap_or_default();
        warnings.push(format!(
            "{}: vas_v is {v_as} in every row with the loop on: no loop gives that, and it counts as not recorded",
            recording.source.display()
        ));
    }
    is_dead
}

/// The same for commands that are written anew every few rows only, while the readout is in every row: what they did to the
/// pattern in between is not known.
pub(crate) fn without_held_commands(recording: &mut Recording, warnings: &mut Vec<String>) {
    let columns = [("vas_v", &recording.vas_v), ("vqc_v", &recording.vqc_v)];
    let held = columns.into_iter().find_map(|(name, v)| v.as_deref().and_then(rows_held).map(|rows| (name, rows)));
    if let Some((name, rows)) = held {
        (recording.vas_v, recording.vqc_v) = (None, None);
        warnings.push(format!(
            "{}: {name} is written anew every {rows} rows only: the commands count as not recorded; wanted: commands in \
             every row, as the readout",
            recording.source.display()
        ));
    }
}

/// An energy command that holds the amplitude of one run with this many times as much as those of the others is in another unit.
const OTHER_UNIT: f64 = 30.0;
/// … where those hold theirs alike, within this factor.
const ALIKE: f64 = 3.0;
/// Runs that have to be there for one to be the odd one.
const FEWEST_RUNS: usize = 3;

/// The same for the commands of a run whose energy command is in another unit than those of most runs, or has the other sign: per volt of
/// amplitude all runs of an instrument need as much of it.
pub(crate) fn without_commands_in_another_unit(runs: &mut [Run], warnings: &mut Vec<String>) {
    let levels: Vec<Option<f64>> = runs.iter().map(|run| command_per_amplitude(&run.recording)).collect();
    let mut told: Vec<f64> = levels.iter().copied().flatten().collect();
    if told.len() < FEWEST_RUNS {
        return;
    }
    let common = median(&mut told);
    let apart = |level: f64, factor: f64| level / common > factor || level / common * factor < 1.0;
    if told.iter().filter(|level| apart(**level, ALIKE)).count() * 3 > told.len() {
        return;
    }
    for (run, level) in runs.iter_mut().zip(levels) {
        let Some(level) = level.filter(|level| apart(*level, OTHER_UNIT)) else { continue };
        let share = level / common;
        if share < 0.0 && share.abs() < ALIKE.recip() {
            continue;
        }
        let why = if share < 0.0 { "have lost their sign" } else { "are in another unit, or of another drive" };
        (run.recording.vas_v, run.recording.vqc_v) = (None, None);
        warnings.push(format!(
            "{}: vas_v holds its amplitude with {share:.3} times as much as in the other runs: its commands {why}, and count as not recorded; \
             wanted: vas_v and vqc_v in V, with the sign of all runs",
            run.recording.source.display(),
        ));
    }
}

/// The usual energy command over the amplitude that is read; `None` where either is not recorded or nothing.
fn command_per_amplitude(recording: &Recording) -> Option<f64> {
    let (x, y) = (recording.xc_v.as_deref()?, recording.yc_v.as_deref()?);
    let amplitude = median(&mut x.iter().zip(y).map(|(x, y)| x.hypot(*y)).collect::<Vec<_>>());
    let level = median(&mut recording.vas_v.as_deref()?.to_vec()) / amplitude;
    (level.is_finite() && level != 0.0).then_some(level)
}

/// For how many rows each value stands, where that is the same for nearly all: changes at regular rows, and of any size. A
/// coarse converter changes by its own step, and when the value is due.
fn rows_held(values: &[f64]) -> Option<usize> {
    let changes: Vec<usize> = (1..values.len()).filter(|&i| values[i] != values[i - 1]).collect();
    if changes.len() < FEWEST_COMMANDS {
        return None;
    }
    let gaps: Vec<usize> = changes.windows(2).map(|c| c[1] - c[0]).collect();
    let mut sorted = gaps.clone();
    sorted.sort_unstable();
    let usual = sorted[sorted.len() / 2];
    let regular = gaps.iter().filter(|gap| gap.is_multiple_of(usual)).count();
    let jumps = || changes.iter().map(|&i| (values[i] - values[i - 1]).abs());
    let [least, largest] = [jumps().fold(f64::INFINITY, f64::min), jumps().fold(0.0, f64::max)];
    (usual > 1 && regular * 10 >= gaps.len() * 9 && largest > 4.0 * least).then_some(usual)
}

/// Whether values that stood still over a range of rows made up for it afterwards in one jump; at the end of a recording,
/// whether they usually step by more than their smallest step.
fn caught_up<'a>(mut columns: impl Iterator<Item = &'a Column<'a>>, held: &Range<usize>, rows: usize) -> bool {
    columns.any(|c| if held.end < rows { c.moved(held.end - 1, held.end) > JUMP } else { c.usual > JUMP * c.small })
}

/// Ranges of rows for which `is` holds.
pub(crate) fn stretches(rows: usize, is: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for i in (0..rows).filter(|i| is(*i)) {
        match out.last_mut() {
            Some(last) if last.end == i => last.end = i + 1,
            _ => out.push(i..i + 1),
        }
    }
    out
}

/// … of which the first row of a recording, that repeats nothing, is none.
pub(super) fn repeats(rows: usize, is: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    stretches(rows, |i| i > 0 && is(i))
}

/// Whether the table turns, by whatever was recorded of it.
struct Input<'a> {
    rate: Option<&'a [f64]>,
    table: Option<&'a [f64]>,
}

impl<'a> Input<'a> {
    fn of(recording: &'a Recording) -> Self {
        Self { rate: recording.rate_dps.as_deref(), table: recording.table_deg.as_deref() }
    }

    #[allow(clippy::float_cmp, reason = "a table at rest is recorded as such")]
    fn turns(&self, rows: &Range<usize>) -> bool {
        let by_rate = self.rate.is_some_and(|v| v[rows.clone()].iter().any(|r| *r != 0.0));
        let by_table = self.table.is_some_and(|v| v[rows.start - 1] != v[rows.end - 1]);
        if self.table.is_some() { by_table } else { by_rate }
    }
}

/// Takes rows out of every channel. Columns of unknown meaning go: nothing here asks for them.
pub(super) fn leave_out(recording: &mut Recording, rows: &[bool]) {
    for channel in Channel::ALL {
        if let Some(values) = recording.channel(channel) {
            let kept = values.iter().zip(rows).filter(|(_, out)| !**out).map(|(v, _)| *v).collect();
            recording.set_channel(channel, kept);
        }
    }
    recording.unknown.clear();
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// 20 s at 500 deg/s and 100 Hz, k = 0.78, with the noise of a good readout.
    pub(in crate::data) fn recorded() -> Recording {
        let mut state = 1u64;
        let mut noise = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            2e-5 * ((state >> 11) as f64 / (1u64 << 53) as f64 - 0.5)
        };
        let t_s: Vec<f64> = (0..2000).map(|i| 0.01 * f64::from(i)).collect();
        let theta = |t: f64| 0.3 - 0.78 * (500.0 * t).to_radians();
        Recording {
            source: "run.csv".into(),
            rate_dps: Some(vec![500.0; 2000]),
            xc_v: Some(t_s.iter().map(|t| theta(*t).cos() + noise()).collect()),
            yc_v: Some(t_s.iter().map(|t| 1.0132 * theta(*t).sin() + noise()).collect()),
            t_s,
            ..Recording::default()
        }
    }

    fn hold(recording: &mut Recording, rows: Range<usize>) {
        for v in [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten() {
            let value = v[rows.start];
            v[rows.clone()].fill(value);
        }
    }

    #[test]
    fn commands_of_one_run_in_millivolts_are_named_and_not_taken() {
        let run = |number: usize, unit: f64| {
            let wobble = |i: usize| 1.0 + 0.1 * (0.3 * i as f64).sin();
            let recording = Recording {
                t_s: (0..50).map(f64::from).collect(),
                xc_v: Some(vec![0.6; 50]),
                yc_v: Some(vec![-0.8; 50]),
                vas_v: Some((0..50).map(|i| -0.05 * unit * wobble(i)).collect()),
                vqc_v: Some(vec![1e-3; 50]),
                ..Recording::default()
            };
            Run {
                kind: crate::recording::RunKind::Rotation,
                file: format!("{number}.csv").into(),
                role: crate::recording::Role::Fit,
                settle_s: 0.0,
                amplitude: None,
                recording,
            }
        };
        let commands = |units: &[f64]| {
            let mut runs: Vec<Run> = units.iter().enumerate().map(|(i, unit)| run(i, *unit)).collect();
            let mut warnings = Vec::new();
            without_commands_in_another_unit(&mut runs, &mut warnings);
            (runs.iter().map(|r| r.recording.vas_v.is_some()).collect::<Vec<_>>(), warnings)
        };
        let (kept, warnings) = commands(&[1.0, 1000.0, 1.2, 0.9]);
        assert_eq!(kept, [true, false, true, true]);
        assert!(warnings.len() == 1 && warnings[0].contains("times as much as in the other runs"), "{warnings:?}");
        assert_eq!(commands(&[1.0, 2.0, 0.7]), (vec![true; 3], vec![]));
        // nobody knows which of two is right
        assert_eq!(commands(&[1.0, 1000.0]), (vec![true; 2], vec![]));
    }

    #[test]
    fn an_energy_command_that_never_changes_is_none() {
        for v_as in [0.0, -0.047] {
            let (mut r, mut warnings) = (recorded(), Vec::new());
            let rows = r.t_s.len();
            r.vas_v = Some(vec![v_as; rows]);
            assert!(without_dead_command(&mut r, f64::INFINITY, &mut warnings) && r.vas_v.is_none());
            assert!(warnings[0].contains("vas_v is") && warnings[0].contains("not recorded"), "{warnings:?}");
            let mut moving = vec![v_as; rows];
            moving[rows / 2] += 1e-9;
            r.vas_v = Some(moving);
            assert!(!without_dead_command(&mut r, f64::INFINITY, &mut warnings) && r.vas_v.is_some());
        }
    }

    #[test]
    fn commands_that_are_written_every_few_rows_are_none() {
        let swing = |i: usize| 0.05 * (0.013 * i as f64).sin() - 0.047;
        let commands = |of: &dyn Fn(usize) -> f64| (0..2000).map(of).collect::<Vec<_>>();
        assert_eq!(rows_held(&commands(&|i| swing(i / 10 * 10))), Some(10));
        assert_eq!(rows_held(&commands(&swing)), None);
        // a converter of 12 bits
        assert_eq!(rows_held(&commands(&|i| (swing(i) * 4096.0).round() / 4096.0)), None);
        let (mut r, mut warnings) = (recorded(), Vec::new());
        let rows = r.t_s.len();
        r.vas_v = Some((0..rows).map(|i| swing(i / 4 * 4)).collect());
        r.vqc_v = Some((0..rows).map(swing).collect());
        without_held_commands(&mut r, &mut warnings);
        assert!(r.vas_v.is_none() && r.vqc_v.is_none() && warnings[0].contains("vas_v is written anew every 4 rows"));
    }

    #[test]
    fn a_sound_recording_is_left_alone() {
        let mut recording = recorded();
        assert_eq!(mend(&mut recording), Findings::default());
        assert_eq!(recording.len(), 2000);
    }

    #[test]
    fn rows_that_repeat_while_the_table_turns_are_named_and_left_out() {
        for rows in [700..705, 700..730, 1990..2000] {
            let mut recording = recorded();
            hold(&mut recording, rows.clone());
            let findings = mend(&mut recording);
            assert_eq!(findings.broken, None);
            assert_eq!(recording.len(), 2000 - rows.len() + 1, "the first of them was recorded");
            let said = format!("rows {} to {} ", rows.start + 2, rows.end);
            assert!(findings.warnings[0].contains(&said), "{:?}", findings.warnings);
        }
    }

    #[test]
    fn a_table_at_rest_is_not_a_recording_that_stands_still() {
        let mut recording = recorded();
        hold(&mut recording, 700..730);
        if let Some(rate) = &mut recording.rate_dps {
            rate[700..730].fill(0.0);
        }
        assert!(held_rows(&recording).is_empty());
    }

    #[test]
    fn a_coarse_converter_is_not_a_recording_that_stands_still() {
        for rate in [20.0, 500.0] {
            for step in [2.5 / 128.0, 2.5 / 2048.0] {
                let mut recording = recorded();
                let theta = |t: f64| 0.3 - 0.78 * (rate * t).to_radians();
                let counted = |v: f64| (v / step).round() * step;
                recording.rate_dps = Some(vec![rate; 2000]);
                recording.xc_v = Some(recording.t_s.iter().map(|t| counted(theta(*t).cos())).collect());
                recording.yc_v = Some(recording.t_s.iter().map(|t| counted(theta(*t).sin())).collect());
                assert!(held_rows(&recording).is_empty(), "{rate} {step}: {:?}", held_rows(&recording));
                let degrees = recording.t_s.iter().map(|t| (theta(*t).to_degrees() / 5.0).floor() * 5.0);
                recording.theta_deg = Some(degrees.map(|d| d.rem_euclid(180.0)).collect());
                (recording.xc_v, recording.yc_v) = (None, None);
                assert!(held_rows(&recording).is_empty(), "{rate}: {:?}", held_rows(&recording));
            }
        }
    }

    #[test]
    fn values_held_throughout_are_a_slower_recording() {
        let mut recording = recorded();
        (0..500).for_each(|i| hold(&mut recording, 4 * i..4 * i + 4));
        let findings = mend(&mut recording);
        assert!(findings.warnings[0].contains("held for 4 rows"), "{findings:?}");
        assert_eq!(recording.len(), 500);
    }

    #[test]
    fn half_a_recording_that_stands_still_serves_for_nothing() {
        let mut recording = recorded();
        for (i, length) in [(0, 300), (500, 400), (1100, 250)] {
            hold(&mut recording, i..i + length);
        }
        assert!(mend(&mut recording).broken.is_some_and(|b| b.problem.contains("947 of 2000 rows")));
    }

    #[test]
    fn a_channel_that_is_clipped_for_much_of_the_time_serves_for_nothing() {
        let mut recording = recorded();
        recording.xc_v.iter_mut().flatten().for_each(|v| *v = v.clamp(-0.8, 0.8));
        let findings = mend(&mut recording);
        assert!(findings.broken.is_some_and(|b| b.problem.contains("it is clipped")));
    }

    #[test]
    fn a_channel_whose_crests_are_clipped_loses_those_rows_wherever_they_are() {
        let mut recording = recorded();
        let values = recording.xc_v.as_mut().expect("a channel");
        let top = 0.99 * values.iter().copied().fold(0.0, f64::max);
        let above = values.iter().filter(|v| **v >= top).count();
        values.iter_mut().for_each(|v| *v = v.min(top));
        let findings = mend(&mut recording);
        let said = format!("{above} rows stand at the rail");
        assert!(findings.broken.is_none() && findings.warnings[0].contains(&said), "{said}: {findings:?}");
        assert!(recording.len() == 2000 - above && recording.xc_v.iter().flatten().all(|v| *v < top));
    }
}
