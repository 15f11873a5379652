//! A rotation run made ready: the input angle it turned through, the envelope it read, the commands it gave.
//!
//! Everything here is taken from the recording without a model of the instrument; spikes are still in it.

use std::ops::Range;

use cvg_estimator::direction::{Direction, major_axis};
use cvg_model::effects::Moment;
use cvg_model::{ActuationGains, AxisForces, ControlOutputs, Envelope};
use rayon::prelude::*;

use crate::data::agreement::LARGEST_SPLIT_RAD_S;
use crate::data::interpolated::resolution;
use crate::data::table;
use crate::error::Refusal;
use crate::model::prediction::Commands;
use crate::numerics::angles::unwrapped;
use crate::numerics::interpolation;
use crate::numerics::statistics::{root_mean_square, span};
use crate::recording::{Role, Run};

mod put_out;

/// A rotation run, ready for a fit.
#[derive(Debug)]
pub(crate) struct Track {
    /// where the run was read from, for refusals
    pub(crate) name: String,
    /// the run as its campaign names it, for reports: the same wherever the campaign lies
    pub(crate) file: String,
    /// time of the recording, s
    pub(crate) t_s: Vec<f64>,
    /// input angle, rad, 0 where the table's own angle starts
    pub(crate) input_rad: Vec<f64>,
    /// only the table's angle within a turn was recorded: whole turns from sample to sample would not show
    pub(crate) whole_turns_are_open: bool,
    /// stretches without a gap, and what each is for
    pub(crate) segments: Vec<Segment>,
    /// every how many samples a first look takes: more than one only in runs of more than [`ENOUGH_SAMPLES`], until they are
    /// thinned
    pub(crate) stride: usize,
    /// of a thinned run, the beginnings of its segments with every sample
    dense: Option<Box<Track>>,
    /// the table's own angle was recorded
    pub(crate) has_table: bool,
    source: Source,
    commands: Option<[Vec<f64>; 2]>,
    /// what drives put out across the pattern in quadrature with it, V, where that is known: v_as has no part there
    across: Option<Vec<f64>>,
    /// temperature, °C, and over the one that parameters refer to, K
    temp_c: Option<Vec<f64>>,
    warmer_k: Vec<f64>,
    /// how fast the pattern turned as it was read, rad/s, where there are commands
    turn_rad_s: Vec<f64>,
}

/// A stretch of a track without a gap: it has one bias.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Segment {
    /// samples
    pub(crate) range: Range<usize>,
    /// fit or held out
    pub(crate) role: Role,
}

/// Where the envelope comes from.
#[derive(Debug)]
enum Source {
    /// demodulated channels x_c, y_c and, if recorded, x_s, y_s
    Channels { in_phase: [Vec<f64>; 2], quadrature: Option<[Vec<f64>; 2]> },
    /// the instrument's own angle, unwrapped, rad, at a nominal amplitude
    Angle { theta_rad: Vec<f64>, amplitude: f64 },
}

/// A gap longer than this many sampling intervals ends a segment.
const GAP_INTERVALS: f64 = 20.0;
/// Share of a run, in time, that is held out where no run is: the last quarter.
const FITTED_SHARE: f64 = 0.75;
/// Samples of one run beyond which more would not narrow an interval that still means something; longer runs are
/// evenly thinned, as far as the pattern turns little from sample to sample.
const ENOUGH_SAMPLES: usize = 100_000;
/// Samples at the beginning of each segment of a thinned run that are kept all: they tell its noise.
pub(crate) const DENSE_SAMPLES: usize = 1 << 16;
/// Largest turn of the table between the samples of a first look, rad.
const LARGEST_FIRST_TURN: f64 = 0.15;
/// Largest turn of the pattern between samples of a thinned track, rad: what a command that repeats with it does to the
/// pattern stays good to 1e-5 of it.
pub(crate) const LARGEST_TURN: f64 = 0.2;
/// A run whose mean rate is more than this share of its mean speed turns one way.
pub(crate) const ONE_WAY: f64 = 0.9;
/// A segment needs this many samples to carry a bias of its own.
const SHORTEST_SEGMENT: usize = 16;

impl Track {
    /// Prepares a rotation run. `period_rad` is the period of the instrument's angle; `split` holds out the last quarter.
    ///
    /// # Errors
    /// Where the run does not turn, or nothing is left of it.
    pub(crate) fn new(run: Run, period_rad: f64, split: bool) -> Result<Self, Refusal> {
        let name = run_name(&run);
        let (settled, role) = (run.settled()?, run.role);
        let mut track = Self::whole(run, period_rad)?;
        if span(&track.input_rad) < 1e-9 {
            return Err(Refusal::new(
                &name,
                "column rate_dps or table_deg: the table does not turn in a rotation run",
                "a rate other than zero",
            ));
        }
        track.segments = segments(&track.t_s, settled, role);
        if split {
            track.hold_out_the_end();
        }
        if track.segments.is_empty() {
            return Err(Refusal::no_answer(&name, "too few samples are left after settling", "a longer run"));
        }
        let resolved = track.resolved(LARGEST_FIRST_TURN, track.mean_speed());
        track.stride = (track.t_s.len() / ENOUGH_SAMPLES).min(resolved).max(1);
        Ok(track)
    }

    /// Holds out the last quarter.
    pub(crate) fn hold_out_the_end(&mut self) {
        let Some((first, last)) = self.segments.first().zip(self.segments.last()) else { return };
        let [from, to] = [first.range.start, last.range.end - 1].map(|i| self.t_s[i]);
        let cut = from + FITTED_SHARE * (to - from);
        let parts = |segment: &Segment| {
            let Range { start, end } = segment.range;
            let middle = start + self.t_s[start..end].partition_point(|t| *t < cut);
            let fitted = Segment { range: start..middle, role: segment.role };
            [fitted, Segment { range: middle..end, role: Role::Holdout }]
        };
        let parts = self.segments.iter().flat_map(parts);
        self.segments = parts.filter(|part| part.range.len() >= SHORTEST_SEGMENT).collect();
    }

    /// The number of sampling intervals in which what turns at `speed_rad_s` turns by `turn_rad`, at least one.
    pub(crate) fn resolved(&self, turn_rad: f64, speed_rad_s: f64) -> usize {
        let interval = (self.t_s[self.t_s.len() - 1] - self.t_s[0]) / (self.t_s.len().max(2) - 1) as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive count, saturating")]
        let count = (turn_rad / (speed_rad_s * interval).abs().max(1e-12)) as usize;
        count.max(1)
    }

    /// Thins a run of more samples than are needed, while its pattern precesses at `speed_rad_s`: each command becomes what
    /// stands for the samples around it. Of the beginnings of its segments every sample is kept besides.
    pub(crate) fn thin(&mut self, speed_rad_s: f64) {
        let width = (self.t_s.len() / ENOUGH_SAMPLES).min(self.resolved(LARGEST_TURN, speed_rad_s));
        self.stride = 1;
        if width > 1 {
            let thinned = self.kept(usize::MAX, width, width);
            *self = Self { dense: Some(Box::new(self.kept(DENSE_SAMPLES, 1, width))), ..thinned };
        }
    }

    /// Every `step`th of the `first` samples of each segment, which are its segment then, and every `width`th of what lies
    /// between.
    fn kept(&self, first: usize, step: usize, width: usize) -> Self {
        let (mut rows, mut segments, mut at) = (Vec::new(), Vec::new(), 0);
        for Segment { range, role } in &self.segments {
            rows.extend((at..range.start).step_by(width));
            let start = rows.len();
            at = range.end.min(range.start.saturating_add(first));
            rows.extend((range.start..at).step_by(step));
            segments.push(Segment { range: start..rows.len(), role: *role });
        }
        rows.extend((at..self.t_s.len()).step_by(width));
        let of =
            |v: &[f64]| -> Vec<f64> { if v.is_empty() { Vec::new() } else { rows.iter().map(|&i| v[i]).collect() } };
        let both = |v: &[Vec<f64>; 2]| [of(&v[0]), of(&v[1])];
        let command = |v: &[f64]| -> Vec<f64> { rows.iter().map(|&i| thinned(v, i, step)).collect() };
        Self {
            name: self.name.clone(),
            file: self.file.clone(),
            t_s: of(&self.t_s),
            input_rad: of(&self.input_rad),
            whole_turns_are_open: self.whole_turns_are_open,
            segments,
            stride: 1,
            dense: None,
            has_table: self.has_table,
            source: match &self.source {
                Source::Channels { in_phase, quadrature } => {
                    Source::Channels { in_phase: both(in_phase), quadrature: quadrature.as_ref().map(both) }
                }
                Source::Angle { theta_rad, amplitude } => {
                    Source::Angle { theta_rad: of(theta_rad), amplitude: *amplitude }
                }
            },
            commands: self.commands.as_ref().map(|[a, q]| [command(a), command(q)]),
            across: self.across.as_deref().map(command),
            temp_c: self.temp_c.as_deref().map(of),
            warmer_k: of(&self.warmer_k),
            turn_rad_s: of(&self.turn_rad_s),
        }
    }

    /// The temperature was recorded.
    pub(crate) fn has_temperature(&self) -> bool {
        self.temp_c.is_some()
    }

    /// The run with every sample of the beginnings of its segments, as many segments as it has itself.
    pub(crate) fn dense(&self) -> &Self {
        self.dense.as_deref().unwrap_or(self)
    }

    /// The run was thinned.
    pub(crate) fn is_thinned(&self) -> bool {
        self.dense.is_some()
    }

    /// A rotation run as one segment from its first sample to its last.
    ///
    /// # Errors
    /// Where there is no angle.
    pub(crate) fn whole(run: Run, period_rad: f64) -> Result<Self, Refusal> {
        let name = run_name(&run);
        let file = run.file.display().to_string();
        let role = run.role;
        let amplitude = run.amplitude;
        let mut recording = run.recording;
        let has_table = recording.table_deg.is_some();
        let (input_rad, whole_turns_are_open) = table::input_angle(&mut recording);
        let source = match (recording.xc_v.take(), recording.yc_v.take(), recording.theta_deg.take()) {
            (Some(x), Some(y), _) => Source::Channels {
                in_phase: [x, y],
                quadrature: recording.xs_v.take().zip(recording.ys_v.take()).map(|(x, y)| [x, y]),
            },
            (_, _, Some(theta)) => Source::Angle {
                theta_rad: unwrapped(theta.iter().map(|d| d.to_radians()), period_rad),
                amplitude: amplitude.unwrap_or(1.0),
            },
            _ => return Err(Refusal::new(&name, "there is neither xc_v and yc_v nor theta_deg", "one of the two")),
        };
        let commands = recording.vas_v.take().zip(recording.vqc_v.take()).map(|(a, q)| [held(a), held(q)]);
        let temp_c = recording.temp_c.take().filter(|t| t.iter().any(|v| v.is_finite())).map(held);
        let segments = vec![Segment { range: 0..recording.t_s.len(), role }];
        let (t_s, turn_rad_s) = (recording.t_s, Vec::new());
        let warmer_k = Vec::new();
        let mut track = Self {
            name,
            file,
            t_s,
            input_rad,
            whole_turns_are_open,
            segments,
            stride: 1,
            dense: None,
            has_table,
            source,
            commands,
            across: None,
            temp_c,
            warmer_k,
            turn_rad_s,
        };
        if track.has_commands() {
            track.turn_rad_s = (0..track.t_s.len()).into_par_iter().map(|i| track.turn(i)).collect();
        }
        Ok(track)
    }

    /// The envelope as the electronics saw it, V (or at nominal amplitude, where only an angle was recorded).
    #[inline]
    pub(crate) fn envelope(&self, i: usize) -> Envelope<f64> {
        match &self.source {
            Source::Channels { in_phase: [x, y], quadrature: Some([xs, ys]) } => {
                Envelope::new(x[i], xs[i], y[i], ys[i])
            }
            Source::Channels { in_phase: [x, y], quadrature: None } => Envelope::new(x[i], 0.0, y[i], 0.0),
            Source::Angle { theta_rad, amplitude } => {
                let (sin, cos) = theta_rad[i].sin_cos();
                Envelope::new(amplitude * cos, 0.0, amplitude * sin, 0.0)
            }
        }
    }

    /// The controllers' outputs at sample `i`; of samples thinned by `width`, what a sum over them has to count.
    #[inline]
    pub(crate) fn commands(&self, i: usize, width: usize) -> Option<Commands> {
        let [v_as, v_qc] = self.commands.as_ref()?;
        let (from, to) = (i.saturating_sub(width), (i + width).min(self.t_s.len() - 1));
        let interval = self.t_s[to] - self.t_s[from];
        let change = |v: &[f64]| if interval > 0.0 { (v[to] - v[from]) / interval } else { 0.0 };
        Some(Commands {
            now: ControlOutputs { v_as: thinned(v_as, i, width), v_qc: thinned(v_qc, i, width) },
            across: self.across.as_ref().map_or(0.0, |v| thinned(v, i, width)),
            change_per_s: ControlOutputs { v_as: change(v_as), v_qc: change(v_qc) },
            turn_rad_s: self.turn_rad_s[i],
        })
    }

    /// The instant of sample `i` while the pattern precesses nominally at `precession_rad_s`, for effects that are not made
    /// of commands.
    #[inline]
    pub(crate) fn instant(&self, i: usize, precession_rad_s: f64) -> Moment<f64> {
        Moment {
            t_s: self.t_s[i],
            table_rad: self.input_rad[i],
            precession_rad_s,
            warmer_k: self.warmer_k(i),
            ..Moment::default()
        }
    }

    /// The same with what the electronics commanded the drives to, where that was recorded.
    pub(crate) fn moment(&self, i: usize, precession_rad_s: f64) -> Moment<f64> {
        let at = self.instant(i, precession_rad_s);
        let Some([v_as, v_qc]) = &self.commands else { return at };
        Moment { drive: commanded(&self.envelope(i), &ControlOutputs { v_as: v_as[i], v_qc: v_qc[i] }), ..at }
    }

    /// Temperature of sample `i` over the one that parameters refer to, K; 0 where it was not recorded.
    #[inline]
    pub(crate) fn warmer_k(&self, i: usize) -> f64 {
        self.warmer_k.get(i).copied().unwrap_or(0.0)
    }

    /// The recorded temperature, °C, of what is used of the run.
    pub(crate) fn temperatures_c(&self) -> impl Iterator<Item = f64> {
        let used = self.segments.iter().flat_map(|s| s.range.clone());
        self.temp_c.iter().flat_map(move |t| used.clone().map(|i| t[i]))
    }

    /// Sets the temperature that parameters refer to, °C.
    pub(crate) fn refer_to(&mut self, reference_c: f64) {
        self.warmer_k = self.temp_c.iter().flatten().map(|t| t - reference_c).collect();
        if let Some(dense) = &mut self.dense {
            dense.refer_to(reference_c);
        }
    }

    /// How fast the pattern turned around sample `i`, as it was read, rad/s: less than a quarter turn between samples.
    fn turn(&self, i: usize) -> f64 {
        let (from, to) = (i.saturating_sub(1), (i + 1).min(self.t_s.len() - 1));
        let [before, after] = [from, to].map(|i| self.envelope(i).pendulum());
        let (sin, cos) = (before.r * after.s - before.s * after.r, before.r * after.r + before.s * after.s);
        0.5 * sin.atan2(cos) / (self.t_s[to] - self.t_s[from]).max(f64::MIN_POSITIVE)
    }

    /// Commands were recorded.
    pub(crate) fn has_commands(&self) -> bool {
        self.commands.is_some()
    }

    /// Quadrature channels were recorded.
    pub(crate) fn has_quadrature(&self) -> bool {
        matches!(self.source, Source::Channels { quadrature: Some(_), .. })
    }

    /// The step of what the quadrature was read with, V, where all of it stays within one.
    pub(crate) fn unresolved_quadrature(&self) -> Option<f64> {
        let Source::Channels { quadrature: Some(read), .. } = &self.dense().source else { return None };
        let step = read.iter().map(|v| resolution(v)).fold(f64::INFINITY, f64::min);
        let scatter = |v: &Vec<f64>| {
            let mean = v.iter().sum::<f64>() / v.len() as f64;
            root_mean_square(&v.iter().map(|v| v - mean).collect::<Vec<_>>())
        };
        read.iter().all(|v| scatter(v) < step).then_some(step).filter(|step| step.is_finite())
    }

    /// The loops' commands and the quadrature that they leave were recorded: all that precesses the pattern.
    pub(crate) fn records_the_loops(&self) -> bool {
        self.has_commands() && self.has_quadrature()
    }

    /// Mean amplitude of the readout over what is used of the run, V.
    pub(crate) fn mean_amplitude(&self) -> f64 {
        let stride = (self.t_s.len() / 500).max(1);
        let sizes = self.segments.iter().flat_map(|s| s.range.clone()).step_by(stride);
        let (n, sum) = sizes.fold((0.0, 0.0), |(n, sum), i| (n + 1.0, sum + self.envelope(i).pendulum().e.sqrt()));
        sum / f64::max(n, 1.0)
    }

    /// The readout's amplitude was recorded, not only an angle.
    pub(crate) fn has_amplitude(&self) -> bool {
        matches!(self.source, Source::Channels { .. })
    }

    /// Input rate around sample `i`, rad/s.
    #[inline]
    pub(crate) fn rate(&self, i: usize) -> f64 {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(self.t_s.len() - 1));
        (self.input_rad[b] - self.input_rad[a]) / (self.t_s[b] - self.t_s[a])
    }

    /// Mean input rate over so long before sample `i`, s, rad/s; that of the sample itself where the time is none.
    pub(crate) fn mean_rate_before(&self, i: usize, since_s: f64) -> f64 {
        let (angle, rate) = (|row: usize| self.input_rad[row], |row| self.rate(row));
        interpolation::mean_rate_before(&self.t_s, angle, rate, i, since_s)
    }

    /// Ends segments before these samples and begins others there; what is too short to carry a bias goes.
    pub(crate) fn cut(&mut self, at: &[usize]) {
        for &row in at {
            let Some(i) = self.segments.iter().position(|s| s.range.start < row && row < s.range.end) else { continue };
            let rest = Segment { range: row..self.segments[i].range.end, role: self.segments[i].role };
            self.segments[i].range.end = row;
            self.segments.insert(i + 1, rest);
        }
        self.segments.retain(|s| s.range.len() >= SHORTEST_SEGMENT);
    }

    /// Samples of all segments of a role.
    pub(crate) fn samples(&self, role: Role) -> usize {
        self.segments.iter().filter(|s| s.role == role).map(|s| s.range.len()).sum()
    }

    /// Mean speed of the input, rad/s: its turns there and back both count.
    pub(crate) fn mean_speed(&self) -> f64 {
        let n = self.t_s.len();
        let step = (n / 1000).max(1);
        let turned: f64 = (step..n).step_by(step).map(|i| (self.input_rad[i] - self.input_rad[i - step]).abs()).sum();
        turned / (self.t_s[n - 1] - self.t_s[0])
    }

    /// How fast the input turns, and how fast the pattern may precess besides before a split is fitted, rad/s.
    pub(crate) fn speed_and_drift(&self) -> [f64; 2] {
        [self.mean_speed(), self.elastic_precession(LARGEST_SPLIT_RAD_S)]
    }

    /// How fast the quadrature that was read can precess the pattern at most, with a split of `split_rad_s`: the mean of
    /// ½Δω|Q|/√(E² − Q²), rad/s.
    fn elastic_precession(&self, split_rad_s: f64) -> f64 {
        let step = (self.t_s.len() / 1000).max(1);
        let ellipticity = |i: usize| {
            let p = self.envelope(i).pendulum();
            p.q.abs() / (p.e * p.e - p.q * p.q).max(f64::MIN_POSITIVE).sqrt()
        };
        let (sum, count) =
            (0..self.t_s.len()).step_by(step).fold((0.0, 0.0), |(sum, n), i| (sum + ellipticity(i).min(1.0), n + 1.0));
        0.5 * split_rad_s * sum / count
    }

    /// Mean input rate of a run that turns one way, rad/s.
    pub(crate) fn one_way_rate(&self) -> Option<f64> {
        Some(self.mean_rate()).filter(|rate| rate.abs() > ONE_WAY * self.mean_speed())
    }

    /// Mean input rate over the settled run, rad/s.
    pub(crate) fn mean_rate(&self) -> f64 {
        match (self.segments.first(), self.segments.last()) {
            (Some(a), Some(b)) => {
                let (a, b) = (a.range.start, b.range.end - 1);
                (self.input_rad[b] - self.input_rad[a]) / (self.t_s[b] - self.t_s[a])
            }
            _ => 0.0,
        }
    }
}

/// What the drives of X and Y are commanded to where the electronics read `seen`, V.
pub(crate) fn commanded(seen: &Envelope<f64>, v: &ControlOutputs<f64>) -> AxisForces<f64> {
    let Direction { cos, sin, .. } = major_axis(seen, &seen.pendulum());
    ActuationGains { x: 1.0, y: 1.0 }.axis_forces_along(v, cos, sin)
}

/// Missing commands take the value that was last given, as a held output does.
pub(crate) fn held(mut values: Vec<f64>) -> Vec<f64> {
    let mut last = values.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
    for v in &mut values {
        if v.is_finite() {
            last = *v;
        } else {
            *v = last;
        }
    }
    values
}

/// What stands for sample `i` among samples thinned by `width`: the mean around it, so that none is lost, less what a mean
/// adds to a smooth command, α δ² − (α/12 + α² − β) δ⁴ in the differences δ of neighbouring means, with the second and the
/// fourth moment of the samples over `width`, 2α and 24β: 1/24 and 3/640 of very many.
fn thinned(v: &[f64], i: usize, width: usize) -> f64 {
    let half = width / 2;
    let reach = 2 * width + half;
    if width == 1 || i < reach || i + reach >= v.len() {
        return v[i];
    }
    let (is_even, w2) = (width.is_multiple_of(2), (width * width) as f64);
    let mean = |i: usize| {
        let sum: f64 = v[i - half..=i + half].iter().sum();
        // of an even number the outermost two count half
        let shared = if is_even { 0.5 * (v[i - half] + v[i + half]) } else { 0.0 };
        (sum - shared) / width as f64
    };
    let (second, fourth) = if is_even {
        ((w2 + 2.0) / 12.0, w2 * w2 / 80.0 + w2 / 12.0 - 1.0 / 30.0)
    } else {
        ((w2 - 1.0) / 12.0, (w2 - 1.0) * (3.0 * w2 - 7.0) / 240.0)
    };
    let (alpha, beta) = (0.5 * second / w2, fourth / (24.0 * w2 * w2));
    let around = |steps: usize| mean(i - steps * width) + mean(i + steps * width);
    let (centre, near, far) = (mean(i), around(1), around(2));
    centre - alpha * (near - 2.0 * centre) + (alpha / 12.0 + alpha * alpha - beta) * (far - 4.0 * near + 6.0 * centre)
}

/// Cuts a run at its gaps.
fn segments(t: &[f64], settled: Range<usize>, role: Role) -> Vec<Segment> {
    let mut steps: Vec<f64> = settled.clone().skip(1).map(|i| t[i] - t[i - 1]).collect();
    if steps.is_empty() {
        return Vec::new();
    }
    let middle = steps.len() / 2;
    let (_, &mut interval, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    let mut out = Vec::new();
    let mut start = settled.start;
    for i in settled.clone().skip(1).chain([settled.end]) {
        if i == settled.end || t[i] - t[i - 1] > GAP_INTERVALS * interval {
            if i - start >= SHORTEST_SEGMENT {
                out.push(Segment { range: start..i, role });
            }
            start = i;
        }
    }
    out
}

/// A run's file, for messages.
pub(crate) fn run_name(run: &Run) -> String {
    run.recording.source.display().to_string()
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test fails by panicking")]
mod tests;
