//! Which runs can be believed: each is looked at by itself, then all beside each other, before anything is fitted.
//!
//! What is broken in a run is left out, rows or all of it, and named; what cannot be told from being right is refused.

use std::f64::consts::PI;

use crate::data::agreement::{Gain, RunGain, Verdict, verdict};
use crate::data::plausibility::mend;
use crate::data::sampling::{LARGEST_GAIN, Plausible, Sampling, Steps, other_turns, sampling, spread_over};
use crate::data::slips::{either_way, slips};
use crate::data::track::{Track, run_name};
use crate::error::Refusal;
use crate::estimation::initial_guess::{Guess, Motion, bearing, bearings, motion};
use crate::facts::RunReport;
use crate::model::hypothesis::Hypothesis;
use crate::numerics::angles::wrapped;
use crate::numerics::statistics::median;
use crate::recording::{Instrument, Role, Run};

/// Angular gains that can be stated at all.
const STATABLE: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// Share of the runs that may be left out because they are broken in themselves.
const MOST_BROKEN: f64 = 0.5;
/// Runs to fit that have to be left where nothing can be made of one: of two, which is as it was meant is not known.
const FEWEST_LEFT: usize = 2;
/// A run cannot be followed if more than this share of its steps may go either way: engineering choice, spikes are fewer.
const MOST_EITHER_WAY: f64 = 0.05;
/// A run with more slips than this has no clock,
const MOST_SLIPS: usize = 8;
/// and neither has one with several that together go this share of its way: they are no slips of a clock beside which a
/// gain is told, but a bit that hangs, or rows of something else.
const SEVERAL_SLIPS: usize = 3;
const SHARE_OF_THE_WAY: f64 = 0.1;
/// Amplitudes in one unit, each over its relative set amplitude, are within this factor: a thousand is the next unit.
const SAME_AMPLITUDE: f64 = 30.0;
/// Samples of a run that tell its amplitude.
const LOOKED_AT: usize = 1000;
/// An angle that scatters by more than this share of its period about its line does not follow the input.
const LOST: f64 = 0.2;

/// Which runs are in, and which were left out and why.
#[derive(Debug, Default)]
pub(crate) struct Screen {
    stated: Option<f64>,
    /// numbers of the rotation runs that are in
    pub(crate) kept: Vec<usize>,
    /// numbers of those that are not
    pub(crate) left_out: Vec<usize>,
    rotations: usize,
    /// rows of each rotation run in which a channel leapt
    spikes: Vec<usize>,
    /// by which share the references of every fitted run differ, that of the run where they differ least
    pub(crate) references_apart: f64,
}

/// The angular gain that a campaign states, if it is one.
///
/// # Errors
/// Where no instrument has it.
pub(crate) fn stated(gain: &Option<f64>) -> Result<Option<f64>, Refusal> {
    match gain {
        Some(k) if !STATABLE.contains(&k.abs()) => {
            Err(Refusal::new("campaign", format!("angular_gain = {k:e}"), "a gain between 0.001 and 1000"))
        }
        other => Ok(*other),
    }
}

/// Says no where a run is read in another unit than the others: in volts of one, a thousandth of another is no amplitude.
///
/// # Errors
/// Where one is.
fn require_one_unit(runs: &[Run]) -> Result<(), Refusal> {
    let sizes: Vec<Option<f64>> = runs.iter().map(|r| Some(amplitude(r)? / r.amplitude.unwrap_or(1.0))).collect();
    let mut told: Vec<f64> = sizes.iter().flatten().copied().filter(|size| *size > 0.0).collect();
    if told.len() < 2 {
        return Ok(());
    }
    let usual = median(&mut told);
    let odd = |size: &Option<f64>| size.filter(|size| *size > 0.0 && (size / usual).ln().abs() > SAME_AMPLITUDE.ln());
    let Some((run, size)) = runs.iter().zip(&sizes).find_map(|(run, size)| Some((run, odd(size)?))) else {
        return Ok(());
    };
    Err(Refusal::no_answer(
        &run_name(run),
        format!("its readout's amplitude is {size:.3e}, that of the other runs {usual:.3e}"),
        "every run in one unit, as xc_v = \"…*0.001\" in [columns] takes mV to V; or `amplitude` of a run that was set to another",
    ))
}

/// The usual size of what both channels read.
fn amplitude(run: &Run) -> Option<f64> {
    let r = &run.recording;
    let (x, y) = (r.xc_v.as_ref()?, r.yc_v.as_ref()?);
    let part = |v: &Option<Vec<f64>>, i: usize| v.as_ref().map_or(0.0, |v| v[i]);
    let stride = (x.len() / LOOKED_AT).max(1);
    let size = |i: usize| x[i].hypot(y[i]).hypot(part(&r.xs_v, i).hypot(part(&r.ys_v, i)));
    let mut sizes: Vec<f64> = (0..x.len()).step_by(stride).map(size).filter(|size| size.is_finite()).collect();
    (!sizes.is_empty()).then(|| median(&mut sizes))
}

impl Screen {
    /// The screen of a campaign with so many rotation runs.
    pub(crate) fn new(stated: Option<f64>, rotations: usize) -> Self {
        Self { stated, kept: (0..rotations).collect(), rotations, ..Self::default() }
    }

    /// Rows in which a channel leapt, of the runs that are in.
    pub(crate) fn spikes(&self) -> impl Iterator<Item = usize> {
        self.kept.iter().map(|number| self.spikes.get(*number).copied().unwrap_or(0))
    }

    /// The angular gain that the campaign states.
    pub(crate) fn stated(&self) -> Option<f64> {
        self.stated
    }

    /// Of reports of all runs, those of the rotations that are in, in the order of the tracks.
    pub(crate) fn of<'a>(&self, runs: &'a mut [RunReport]) -> Vec<&'a mut RunReport> {
        Self::chosen(&self.kept, runs)
    }

    /// Of reports of all runs, those of the rotations that were left out.
    pub(crate) fn left_out_of<'a>(&self, runs: &'a mut [RunReport]) -> Vec<&'a mut RunReport> {
        Self::chosen(&self.left_out, runs)
    }

    fn chosen<'a>(numbers: &[usize], runs: &'a mut [RunReport]) -> Vec<&'a mut RunReport> {
        let rotations = runs.iter_mut().filter(|r| r.kind == "rotation").enumerate();
        rotations.filter(|(number, _)| numbers.contains(number)).map(|(_, run)| run).collect()
    }

    /// Leaves out run `number` of all.
    pub(crate) fn leave_out(&mut self, number: usize, run: &str, why: &str, warnings: &mut Vec<String>) {
        warnings.push(format!("{run}: left out: {why}"));
        self.kept.retain(|n| *n != number);
        self.left_out.push(number);
    }

    /// Rows that were not recorded anew left out of the runs, and runs that serve for nothing.
    ///
    /// # Errors
    /// Where too few are left.
    pub(crate) fn mended(&mut self, runs: Vec<Run>, warnings: &mut Vec<String>) -> Result<Vec<Run>, Refusal> {
        let mut broken = Vec::new();
        let (mut sound, mut apart) = (Vec::new(), f64::INFINITY);
        for (number, mut run) in runs.into_iter().enumerate() {
            let findings = mend(&mut run.recording);
            warnings.extend(findings.warnings);
            self.spikes.push(findings.spikes);
            match findings.broken {
                Some(what) => broken.push((number, run_name(&run), what)),
                None => {
                    if run.role == Role::Fit {
                        apart = apart.min(findings.references_apart);
                    }
                    sound.push(run);
                }
            }
        }
        self.references_apart = if apart.is_finite() { apart } else { 0.0 };
        require_one_unit(&sound)?;
        let fitted = sound.iter().filter(|r| r.role == Role::Fit).count();
        let too_many = fitted == 0 || broken.len() as f64 > MOST_BROKEN * self.rotations as f64;
        if let Some((_, name, what)) = broken.first().filter(|_| too_many) {
            return Err(Refusal::no_answer(name, &what.problem, &what.wanted));
        }
        for (number, name, what) in broken {
            self.leave_out(number, &name, &what.problem, warnings);
        }
        Ok(sound)
    }

    /// The runs made ready, and those that cannot be left out; of what they tell nothing is asked yet.
    ///
    /// # Errors
    /// Where too few are left.
    pub(crate) fn tracks(
        &mut self,
        runs: Vec<Run>,
        period_rad: f64,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<Track>, Refusal> {
        let split = runs.iter().all(|r| r.role == Role::Fit);
        let tracks = runs.into_iter().map(|r| Track::new(r, period_rad, split)).collect();
        self.ready(tracks, |track| track, warnings)
    }

    /// What could be made of the runs that are in; those of which it could not are left out.
    ///
    /// # Errors
    /// The first of why not, where too few are left.
    fn ready<T>(
        &mut self,
        made: Vec<Result<T, Refusal>>,
        track: impl Fn(&T) -> &Track,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<T>, Refusal> {
        let (count, numbers) = (made.len(), self.kept.clone());
        let (mut ready, mut failed) = (Vec::with_capacity(count), Vec::new());
        for (number, made) in numbers.into_iter().zip(made) {
            match made {
                Ok(made) => ready.push(made),
                Err(why) => failed.push((number, why)),
            }
        }
        let fitted = ready.iter().filter(|made| track(made).samples(Role::Fit) > 0).count();
        if failed.len() as f64 > MOST_BROKEN * count as f64 || fitted < FEWEST_LEFT {
            return failed.into_iter().next().map_or(Ok(ready), |(_, why)| Err(why));
        }
        for (number, why) in failed {
            let place = if why.place.is_empty() { "a run" } else { &why.place };
            self.leave_out(number, place, &why.problem, warnings);
        }
        Ok(ready)
    }

    /// How each run moves, of those that can be believed.
    ///
    /// # Errors
    /// Where the samples are too far apart to tell, where the angle does not follow the input, or where the runs contradict
    /// each other.
    pub(crate) fn motions(
        &mut self,
        tracks: Vec<Track>,
        start: &Hypothesis,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<(Track, Motion)>, Refusal> {
        let open = Guess::Open(self.stated);
        let moving = tracks.into_iter().map(|t| motion(&t, start, open).map(|m| (t, m))).collect();
        let (tracks, first): (Vec<Track>, Vec<Motion>) =
            self.ready(moving, |(track, _)| track, warnings)?.into_iter().unzip();
        let guess = self.settle(&tracks, &first, start)?;
        let mut moving: Vec<(Track, Motion)> = Vec::with_capacity(tracks.len());
        let mut odd: Vec<(usize, String)> = Vec::new();
        for (at, (mut track, mut moves)) in tracks.into_iter().zip(first).enumerate() {
            if guess != open {
                moves = motion(&track, start, guess)?;
            }
            match cut_at_slips(&mut track, start, &moves, warnings) {
                Ok(true) => moves = motion(&track, start, guess)?,
                Ok(false) => {}
                Err(why) => odd.push((at, why)),
            }
            if start.instrument == Instrument::Gyroscope && moves.deviation > LOST * start.period_rad {
                odd.retain(|o| o.0 != at);
                odd.push((at, "its angle does not follow the input at all".into()));
            }
            moving.push((track, moves));
        }
        if odd.len() as f64 > MOST_BROKEN * moving.len() as f64 {
            let (at, why) = &odd[0];
            return Err(Refusal::no_answer(
                &moving[*at].0.name,
                why,
                "rate_dps or table_deg of this very rotation, one clock, and xc_v, yc_v or theta_deg of the instrument that \
                 was turned",
            ));
        }
        let mut moving = self.without(moving, &odd, warnings);
        if start.instrument == Instrument::Gyroscope {
            let gains: Vec<RunGain> = moving.iter().map(|(t, m)| run_gain(t, m, start.period_rad)).collect();
            match verdict(&gains) {
                Verdict::Out(odd) => moving = self.without(moving, &odd, warnings),
                Verdict::Open { run, problem } => {
                    return Err(Refusal::no_answer(
                        &run,
                        problem,
                        "runs of one instrument, each with its own rate_dps or table_deg; a third run tells which of two \
                         is right",
                    ));
                }
            }
            self.counts_as_stated(&moving)?;
        }
        let only = |m: &Motion| format!("the pattern turns through {:.1}° only", m.travel.to_degrees());
        let is_far = |m: &Motion| m.travel >= PI;
        let one_is_fitted = moving.iter().any(|(track, m)| track.samples(Role::Fit) > 0 && is_far(m));
        let is_short = |(_, m): &(Track, Motion)| one_is_fitted && !is_far(m);
        let of = |(at, run): (usize, &(Track, Motion))| is_short(run).then(|| (at, only(&run.1)));
        let short: Vec<(usize, String)> = moving.iter().enumerate().filter_map(of).collect();
        let moving = self.without(moving, &short, warnings);
        let far_enough = |(track, motion): (Track, Motion)| {
            if is_far(&motion) {
                return Ok((track, motion));
            }
            Err(Refusal::no_answer(&track.name, only(&motion), "at least half a turn (180°)"))
        };
        let mut ready = self.ready(moving.into_iter().map(far_enough).collect(), |(track, _)| track, warnings)?;
        warnings.extend(hold_out_something(&mut ready, start, guess)?);
        Ok(ready)
    }

    /// The runs without those at these places.
    fn without(
        &mut self,
        moving: Vec<(Track, Motion)>,
        odd: &[(usize, String)],
        warnings: &mut Vec<String>,
    ) -> Vec<(Track, Motion)> {
        let numbers = self.kept.clone();
        for (at, why) in odd {
            self.leave_out(numbers[*at], &moving[*at].0.name.clone(), why, warnings);
        }
        let out = |at: usize| odd.iter().any(|o| o.0 == at);
        moving.into_iter().enumerate().filter(|(at, _)| !out(*at)).map(|(_, run)| run).collect()
    }

    /// Settles the angular gain where samples are so far apart that neighbours do not tell it.
    fn settle(&self, tracks: &[Track], first: &[Motion], start: &Hypothesis) -> Result<Guess, Refusal> {
        let plausible = match (self.stated, start.instrument) {
            (Some(k), _) => Plausible::Stated(k),
            (None, Instrument::Gyroscope) => Plausible::Resonator,
            (None, Instrument::Sensor) => Plausible::Encoder,
        };
        let steps: Vec<Steps> = tracks.iter().map(|t| steps(t, start)).collect();
        let followed = |i: usize| first.get(i).map(|m| m.angular_gain);
        let modulo = (start.sense(), start.period_rad);
        let (guess, settled) = match sampling(&steps, followed, modulo, plausible) {
            Sampling::Close => (Guess::Open(self.stated), None),
            Sampling::Resolved(k) => (Guess::Settled(k), Some(k)),
            Sampling::Ambiguous(a) => return Err(Refusal::no_answer(&a.run, a.problem(), a.wanted())),
        };
        match other_turns(&steps, |i| settled.or_else(|| followed(i)), modulo, plausible) {
            Some(a) => Err(Refusal::no_answer(&a.run, a.problem(), a.wanted())),
            None => Ok(guess),
        }
    }

    /// The angle counts the way that the campaign says, or that Equation 1 says.
    fn counts_as_stated(&self, moving: &[(Track, Motion)]) -> Result<(), Refusal> {
        let expected = self.stated.unwrap_or(LARGEST_GAIN);
        let against = |(t, m): &&(Track, Motion)| t.has_amplitude() && m.angular_gain * expected < 0.0;
        let Some((track, motion)) = moving.iter().find(against) else { return Ok(()) };
        Err(Refusal::no_answer(
            &track.name,
            format!("the angle counts with the rotation and not against it: k = {:.4}", motion.angular_gain),
            format!(
                "X and Y in their places (xc_v and yc_v may be swapped, or one may have lost its sign), rate_dps or \
                 table_deg with its sign, or angular_gain = {:.2} in the [campaign] if this is how it counts",
                motion.angular_gain
            ),
        ))
    }
}

/// Steps between neighbouring samples of a track, evenly from all of it.
fn steps(track: &Track, hypothesis: &Hypothesis) -> Steps {
    let bearing = |i: usize| bearing(track, hypothesis, i);
    let mut out =
        Steps { name: track.name.clone(), whole_turns_are_open: track.whole_turns_are_open, ..Steps::default() };
    let mut intervals = Vec::new();
    let count: usize = track.segments.iter().map(|s| s.range.len()).sum();
    let every = spread_over(count).nth(1).unwrap_or(1);
    for segment in &track.segments {
        for at in segment.range.clone().skip(1).step_by(every) {
            let input = track.input_rad[at] - track.input_rad[at - 1];
            if input.abs() > 1e-9 {
                out.input.push(input);
                out.angle.push(bearing(at) - bearing(at - 1));
                intervals.push(track.t_s[at] - track.t_s[at - 1]);
            }
        }
    }
    out.interval_s = crate::numerics::statistics::median(&mut intervals);
    out
}

/// What a run tells of the angular gain.
fn run_gain(track: &Track, motion: &Motion, period: f64) -> RunGain {
    let (low, high) = track
        .segments
        .iter()
        .flat_map(|s| [s.range.start, s.range.end - 1])
        .map(|i| track.input_rad[i])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let all = Gain::new(motion.angular_gain, motion.deviation, period, high - low, track.speed_and_drift());
    let all = all.slowed_by(motion.swing.slowing());
    RunGain { run: track.name.clone(), all, parts: motion.halves.clone() }
}

/// Ends a segment where the angle jumps against the input, and begins another; says where, and whether there was any.
///
/// # Errors
/// Why the run has no clock.
fn cut_at_slips(
    track: &mut Track,
    hypothesis: &Hypothesis,
    motion: &Motion,
    warnings: &mut Vec<String>,
) -> Result<bool, String> {
    let along = hypothesis.sense() * motion.angular_gain;
    let mut found = Vec::new();
    for (segment, bearing) in track.segments.iter().zip(bearings(track, hypothesis, 1)) {
        let expected: Vec<f64> = segment.range.clone().map(|i| along * track.input_rad[i]).collect();
        let open = either_way(&bearing, &expected, hypothesis.period_rad);
        if open > MOST_EITHER_WAY {
            return Err(format!(
                "its angle cannot be followed: {:.1} % of its steps from row to row are off by more than a quarter of the \
                 period, and may be a period less the other way",
                100.0 * open
            ));
        }
        let here = slips(&bearing, &expected, hypothesis.period_rad);
        found.extend(here.into_iter().map(|s| (segment.range.start + s.at, s.by)));
    }
    let Some(&(first, by)) = found.first() else { return Ok(false) };
    let place = |row: usize| format!("row {} ({:.3} s)", row + 1, track.t_s[row]);
    let together: f64 = found.iter().map(|(_, by)| by.abs()).sum();
    if found.len() > MOST_SLIPS || (found.len() >= SEVERAL_SLIPS && together > SHARE_OF_THE_WAY * motion.travel) {
        return Err(format!(
            "its angle jumps against the input {} times, first by {:.2}° at {}: the clock slips, or samples are lost",
            found.len(),
            wrapped(by, hypothesis.period_rad).to_degrees(),
            place(first)
        ));
    }
    let places: Vec<String> =
        found.iter().map(|(row, by)| format!("by {:.2}° at {}", by.to_degrees(), place(*row))).collect();
    warnings.push(format!(
        "{}: the angle jumps against the input {}: the clock slips there, or samples are lost; what comes before and after \
         is followed apart",
        track.name,
        places.join(", ")
    ));
    track.cut(&found.iter().map(|f| f.0).collect::<Vec<_>>());
    Ok(true)
}

/// Holds out the last quarter of each run where nothing is held out, and says so.
fn hold_out_something(
    runs: &mut [(Track, Motion)],
    start: &Hypothesis,
    guess: Guess,
) -> Result<Option<String>, Refusal> {
    let holds_out = |(track, _): &(Track, Motion)| track.samples(Role::Holdout) > 0;
    if runs.iter().any(holds_out) {
        return Ok(None);
    }
    for (track, moves) in runs.iter_mut() {
        track.hold_out_the_end();
        *moves = motion(track, start, guess)?;
    }
    // of a few rows the last quarter was held out before, and is none
    let said = "no run that was to be held out is left: the last quarter of each of the others is held out";
    Ok(runs.iter().any(holds_out).then(|| said.to_owned()))
}
