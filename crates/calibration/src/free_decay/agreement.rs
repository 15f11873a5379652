//! Whether decays are of one resonator: what the fit of all leaves of each, beside what parts of runs leave that are fitted
//! alone. A run that does not agree with the rest is left out where the rest agree without it; else nothing is told.

use super::fit::{Data, Fit, approach, fit, left, start_of};
use super::model::Model;
use super::runs::DecayRun;
use super::start::{begun, energy};
use crate::error::Refusal;
use crate::numerics::statistics::white_noise;

/// What is left contradicts a run beyond so many times what a part of a run leaves that is fitted alone,
const CONTRADICTS: f64 = 4.0;
/// and a run is left out for no less than this share of its amplitude, half a degree: below it, intervals cover it.
const LEFT_OUT: f64 = 0.01;
/// Nothing is relied on where more than this share is left.
const RELIED_ON: f64 = 0.02;
/// Share of the runs that may be left out.
const MOST_LEFT_OUT: f64 = 1.0 / 3.0;
/// Values that are largest, as a share, which spikes may be.
const SPIKES: f64 = 0.02;
/// Stretches of a run that is parted.
const FEWEST_OF_PARTS: usize = 80;

/// What is left of a run.
#[derive(Debug, Clone, Copy)]
struct Left {
    /// over the white noise of the run
    over_noise: f64,
    /// over its amplitude
    share: f64,
}

impl Left {
    fn of(run: &DecayRun, columns: &[Vec<f64>; 3]) -> Self {
        let mut squares: Vec<f64> = columns.iter().flatten().map(|v| v * v).collect();
        squares.sort_by(f64::total_cmp);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share of a length")]
        squares.truncate(squares.len() - (SPIKES * squares.len() as f64) as usize);
        let rms = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        let noise = (columns.iter().map(|c| white_noise(c).powi(2)).sum::<f64>() / columns.len() as f64).sqrt();
        let count = columns[0].len();
        let amplitude = (run.seen[..count].iter().map(energy).sum::<f64>() / count.max(1) as f64).sqrt();
        Self { over_noise: rms / noise.max(f64::MIN_POSITIVE), share: rms / amplitude.max(f64::MIN_POSITIVE) }
    }

    fn contradicts(&self, alone: f64) -> bool {
        self.over_noise > CONTRADICTS * alone
    }
}

/// What a fit leaves of each of its runs.
fn all_left(fit: &Fit, data: Data<'_>) -> Vec<Left> {
    let of = |((run, count), start): ((&DecayRun, &usize), _)| Left::of(run, &left(&fit.model, start, run, *count));
    data.runs.iter().zip(data.counts).zip(&fit.starts).map(of).collect()
}

/// What a part of a run leaves over its noise where it is fitted alone: a quarter of the parts leave less.
fn alone(model: &Model, data: Data<'_>) -> f64 {
    let mut over_noise = Vec::new();
    for (run, count) in data.runs.iter().zip(data.counts) {
        let middle = if *count < FEWEST_OF_PARTS { 0 } else { count / 2 };
        for part in [0..middle, middle..*count].into_iter().filter(|part| !part.is_empty()) {
            let part = run.part(part);
            let own = Data { runs: std::slice::from_ref(&part), counts: &[part.len()] };
            let fitted = fit(model, &[start_of(model, &part)], own);
            over_noise.extend(all_left(&fitted, own).into_iter().map(|l| l.over_noise).filter(|v| v.is_finite()));
        }
    }
    over_noise.sort_by(f64::total_cmp);
    over_noise.get(over_noise.len().saturating_sub(1) / 4).copied().unwrap_or(1.0).max(1.0)
}

/// A model fitted to the runs that are not `out`, from the beginning, with what it leaves of them.
fn without(model: &Model, data: Data<'_>, out: &[usize]) -> Vec<Left> {
    let kept = || (0..data.runs.len()).filter(|at| !out.contains(at));
    let runs: Vec<DecayRun> = kept().map(|at| data.runs[at].clone()).collect();
    let counts: Vec<usize> = kept().map(|at| data.counts[at]).collect();
    let rest = Data { runs: &runs, counts: &counts };
    let of = |run: &DecayRun| runs.iter().position(|r| r.number == run.number).map_or(0, |at| counts[at]);
    let (model, starts) = approach(&begun(model, &runs, of), rest);
    all_left(&fit(&model, &starts, rest), rest)
}

/// What the runs say of each other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Verdict {
    Agree,
    /// the rest agree without these
    Out(Vec<usize>),
    /// they do not agree, and intervals are to be so many times as wide; why
    Wide(f64, String),
}

/// Judges a fit.
///
/// # Errors
/// Where the decays contradict each other, and which is right is not known.
pub(crate) fn verdict(fitted: &Fit, data: Data<'_>, progress: &dyn Fn(&str)) -> Result<Verdict, Refusal> {
    let seen = all_left(fitted, data);
    if !seen.iter().any(|l| l.contradicts(1.0)) {
        return Ok(Verdict::Agree);
    }
    progress("comparing the decays");
    let alone = alone(&fitted.model, data);
    let Some((worst, left)) = seen
        .iter()
        .copied()
        .enumerate()
        .filter(|(_, l)| l.contradicts(alone))
        .max_by(|a, b| a.1.over_noise.total_cmp(&b.1.over_noise))
    else {
        return Ok(Verdict::Agree);
    };
    let times = left.over_noise / alone;
    let problem = format!(
        "the fit of all decays leaves {:.1} % of the amplitude of this one, {times:.0} times what parts of decays leave that are \
         fitted alone",
        100.0 * left.share
    );
    let shares = || seen.iter().map(|l| l.share);
    if shares().all(|share| share < LEFT_OUT) {
        return Ok(Verdict::Wide(times, format!("{}: {problem}", data.runs[worst].name)));
    }
    if let Some(out) = odd(&fitted.model, data, alone) {
        return Ok(Verdict::Out(out));
    }
    if shares().all(|share| share < RELIED_ON) {
        return Ok(Verdict::Wide(times, format!("{}: {problem}", data.runs[worst].name)));
    }
    Err(Refusal::no_answer(
        &data.runs[worst].name,
        problem,
        "decays of one resonator, each whole, with the signs and scales of the channels as in the others, and rate_dps of each that was turned",
    ))
}

/// The few runs without which the rest agree; none where there are none, or others might be left out as well.
fn odd(model: &Model, data: Data<'_>, alone: f64) -> Option<Vec<usize>> {
    let count = data.runs.len();
    let mut out: Vec<usize> = Vec::new();
    while (out.len() + 1) as f64 <= MOST_LEFT_OUT * count as f64 {
        let mut tried: Vec<(usize, f64, bool)> = (0..count)
            .filter(|at| !out.contains(at))
            .map(|at| {
                let left = without(model, data, &[&out[..], &[at]].concat());
                let size = left.iter().map(|l| l.over_noise.ln()).sum::<f64>();
                (at, size, left.iter().all(|l| !l.contradicts(alone)))
            })
            .collect();
        tried.sort_by(|a, b| a.1.total_cmp(&b.1));
        let (best, _, agree) = *tried.first()?;
        out.push(best);
        if agree {
            return (tried.iter().filter(|t| t.2).count() == 1).then_some(out);
        }
    }
    None
}
