//! Which effect of the library explains what the declared model leaves.
//!
//! Candidates compete by refitting the whole model with each of them, on all runs at once; what a candidate gains in
//! likelihood is set against its parameters and against how many candidates were tried. The winner must also lower the
//! error on data that was not fitted. Effects come in one at a time; weak ones are dropped again. Where two causes of
//! the library explain a residual equally well, neither is claimed: an empirical harmonic stands in for both.

use cvg_model::effects::{EffectId, Role as ParameterRole, Search, Stage, Values};
use rayon::prelude::*;

use crate::error::Refusal;
use crate::evaluate::{Evaluation, evaluate};
use crate::fit::{Effort, Fit, Window, fit};
use crate::hypothesis::{Hypothesis, Origin, Unknown};
use crate::identify::{Bench, Fitted, SAME_RATE, fit_with_ring_downs};
use crate::recording::{Instrument, Role};
use crate::residual::{
    Follows, WHITENESS_LAGS, autocorrelation, inflation, resolved_harmonics, strongest_frequency, strongest_harmonics,
};
use crate::start::Ellipse;

/// Gain in log-likelihood (×2, after the price of parameters and of the search) that a new effect must bring.
pub const LEAST_GAIN: f64 = 12.0;
/// By how much it must beat a rival of the library to be told apart from it.
pub const LEAST_LEAD: f64 = 8.0;
/// The share of the held-out mean square that it must remove.
pub const LEAST_HELDOUT_GAIN: f64 = 0.05;
/// A residual within this factor of its white part, of which no candidate promises to take anything, is left alone.
const NOTHING_LEFT: f64 = 1.2;
/// Most effects that are added.
const MOST_EFFECTS: usize = 8;
/// Candidates that are refitted in full after a quick round.
const FINALISTS: usize = 4;
/// Harmonics of the pattern and of the table that are looked at.
const PATTERN_HARMONICS: u32 = 24;
const TABLE_HARMONICS: u32 = 64;
/// Strongest harmonics that become candidates.
const PROPOSALS: usize = 2;

/// A way to extend a hypothesis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) id: EffectId,
    /// starting values
    values: Values<f64>,
    /// refine this member instead of adding one
    refine: Option<usize>,
    /// how many alternatives the search behind it went through
    tried: f64,
}

/// A candidate after its refit.
#[derive(Debug, Clone)]
struct Trial {
    candidate: Candidate,
    fit: Fit,
    /// gain in likelihood, price paid
    gain: f64,
}

/// One accepted step.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// the effect
    pub id: EffectId,
    /// how it came in
    pub origin: Origin,
    /// gain in log-likelihood ×2 after the price of its parameters and of the search
    pub gain: f64,
    /// best rivals and their gains
    pub rivals: Vec<(EffectId, f64)>,
    /// held-out rms before and after, deg
    pub heldout_rms_deg: [f64; 2],
    /// effects of the library that explain the residual as well
    pub confounded_with: Vec<EffectId>,
}

/// One step from the fitted hypothesis: what it promises ranks the candidates.
const QUICK: Effort = Effort { steps: 1, thinned: 400, polish: false };
const CAREFUL: Effort = Effort { steps: 6, thinned: 6_000, polish: false };

/// Adds effects to a fitted hypothesis until the residual asks for no more.
///
/// # Errors
/// As for the fit.
pub(crate) fn discover(
    bench: &mut Bench,
    mut fitted: Fitted,
    progress: &dyn Fn(&str),
) -> Result<(Fitted, Vec<Step>), Refusal> {
    let mut steps: Vec<Step> = Vec::new();
    if let Some(ellipse) = bench.ellipse.filter(|_| bench.raw_angle_turns) {
        (fitted, steps) = centre(bench, &fitted, &ellipse)?;
    }
    while steps.len() < MOST_EFFECTS {
        progress(&format!("step {}: candidates compete", steps.len() + 1));
        let Some((next, step)) = best_step(bench, &fitted)? else {
            // trials leave the runs as their own fits had them
            if bench.disturbed(&fitted.fit) {
                fitted = fit_with_ring_downs(bench, &fitted.fit.hypothesis)?;
            }
            break;
        };
        fitted = next;
        steps.push(step);
    }
    drop_weak(bench, &mut fitted, &mut steps)?;
    Ok((fitted, steps))
}

/// Offsets and skew of a sensor come in together, from the ellipse that its readout draws: one without the other leads
/// the fit of a large one astray. Each stays only if the data asks for it.
fn centre(bench: &mut Bench, plain: &Fitted, ellipse: &Ellipse) -> Result<(Fitted, Vec<Step>), Refusal> {
    let before = heldout(bench, &plain.fit);
    let mut centred = plain.fit.hypothesis.clone();
    centred.members.retain(|m| m.id != EffectId::DetectionGainMismatch);
    ellipse.install(&mut centred);
    bench.restart(&centred)?;
    let mut fitted = fit_with_ring_downs(bench, &centred)?;
    let mut steps = Vec::new();
    for id in [EffectId::DetectionOffset, EffectId::DetectionSkew] {
        let with = refit(bench, &fitted, &fitted.fit.hypothesis, CAREFUL);
        let mut reduced = fitted.fit.hypothesis.clone();
        reduced.members.retain(|m| m.id != id);
        let without = refit(bench, &fitted, &reduced, CAREFUL);
        let n = count(&with)
            / sample_cost(&evaluate(
                &bench.tracks,
                &fitted.fit.hypothesis,
                &fitted.fit.starts,
                Role::Fit,
                Window::Whole,
                None,
            ));
        let plain = Candidate { id, values: id.neutral(), refine: None, tried: 1.0 };
        let gain = n * (mean_square(&without) / mean_square(&with)).ln() - price(&plain, n);
        if gain < LEAST_GAIN {
            fitted = fit_with_ring_downs(bench, &reduced)?;
        } else {
            steps.push(Step {
                id,
                origin: Origin::Discovered,
                gain,
                rivals: Vec::new(),
                heldout_rms_deg: [heldout(bench, &without), heldout(bench, &with)]
                    .map(|square| square.sqrt().to_degrees()),
                confounded_with: Vec::new(),
            });
        }
    }
    if steps.is_empty() || heldout(bench, &fitted.fit) > before {
        bench.restart(&plain.fit.hypothesis)?;
        let plain = fit_with_ring_downs(bench, &plain.fit.hypothesis)?;
        return Ok((plain, Vec::new()));
    }
    Ok((fitted, steps))
}

/// The best extension of a fitted hypothesis that earns its place.
fn best_step(bench: &mut Bench, fitted: &Fitted) -> Result<Option<(Fitted, Step)>, Refusal> {
    let before = evaluate(&bench.tracks, &fitted.fit.hypothesis, &fitted.fit.starts, Role::Fit, Window::Whole, None);
    let dense = evaluate(&bench.tracks, &fitted.fit.hypothesis, &fitted.fit.starts, Role::Fit, Window::Dense, None);
    let candidates = candidates(bench, &fitted.fit.hypothesis, &before, &dense);
    let base_quick = mean_square(&refit(bench, fitted, &fitted.fit.hypothesis, QUICK));
    let mut ranked: Vec<Trial> = candidates
        .into_par_iter()
        .filter_map(|candidate| {
            let fit = refit(bench, fitted, &extend(&fitted.fit.hypothesis, &candidate, Origin::Discovered), QUICK);
            let n = count(&fit);
            let gain = n * (base_quick / mean_square(&fit)).ln() - price(&candidate, n);
            gain.is_finite().then_some(Trial { candidate, fit, gain })
        })
        .collect();
    ranked.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    if bench.excess() < NOTHING_LEFT && ranked.first().is_none_or(|best| best.gain < 0.0) {
        return Ok(None);
    }
    let base = refit(bench, fitted, &fitted.fit.hypothesis, CAREFUL);
    ranked.truncate(FINALISTS);
    let mut trials: Vec<Trial> = ranked
        .into_par_iter()
        .map(|quick| Trial { fit: refit(bench, fitted, &quick.fit.hypothesis, CAREFUL), ..quick })
        .collect();
    let Some(best) = trials.iter().min_by(|a, b| mean_square(&a.fit).total_cmp(&mean_square(&b.fit))) else {
        return Ok(None);
    };
    // Autocorrelation that even the best candidate leaves makes samples worth less.
    let after = evaluate(&bench.tracks, &best.fit.hypothesis, &best.fit.starts, Role::Fit, Window::Whole, None);
    let worth = 1.0 / sample_cost(&after);
    for t in &mut trials {
        let n = worth * count(&t.fit);
        t.gain = n * (mean_square(&base) / mean_square(&t.fit)).ln() - price(&t.candidate, n);
    }
    trials.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let heldout_before = heldout(bench, &fitted.fit);
    while let Some((chosen, origin, confounded_with)) = choose(&trials, bench.tracks_differ()) {
        let chosen = chosen.clone();
        let next = fit_with_ring_downs(bench, &extend_from(&chosen, origin))?;
        let heldout_after = heldout(bench, &next.fit);
        trials.retain(|t| t.candidate != chosen.candidate);
        if heldout_after > (1.0 - LEAST_HELDOUT_GAIN) * heldout_before {
            // gained on the fitted data only: the next one's turn
            continue;
        }
        let step = Step {
            id: chosen.candidate.id,
            origin,
            gain: chosen.gain,
            rivals: trials.iter().map(|t| (t.candidate.id, t.gain)).take(3).collect(),
            heldout_rms_deg: [heldout_before, heldout_after].map(|square| square.sqrt().to_degrees()),
            confounded_with,
        };
        return Ok(Some((next, step)));
    }
    Ok(None)
}

/// The winner among refitted candidates, and in what capacity it comes in.
fn choose(trials: &[Trial], rates_differ: bool) -> Option<(&Trial, Origin, Vec<EffectId>)> {
    let best = trials.first().filter(|t| t.gain >= LEAST_GAIN)?;
    let empirical = |t: &&Trial| t.candidate.id.description().empirical;
    let library = trials.iter().find(|t| !empirical(t));
    let described = trials.iter().find(empirical);
    let Some(library) = library.filter(|l| l.gain >= best.gain - LEAST_LEAD && l.gain >= LEAST_GAIN) else {
        return Some((best, Origin::Empirical, Vec::new()));
    };
    let rivals: Vec<EffectId> = trials
        .iter()
        .filter(|t| !empirical(t) && t.candidate.id != library.candidate.id && t.gain > library.gain - LEAST_LEAD)
        .map(|t| t.candidate.id)
        .collect();
    // At one rate nothing tells a slow push on the pattern from a fault of the readout.
    let told = rates_differ || library.candidate.id.description().stage != Stage::Mechanics;
    if rivals.is_empty() && told {
        return Some((library, Origin::Discovered, rivals));
    }
    // Two causes explain it: claim neither, unless nothing empirical describes it.
    match described.filter(|d| d.gain >= LEAST_GAIN) {
        Some(described) => {
            let causes = trials
                .iter()
                .filter(|t| !empirical(t) && t.gain > described.gain.min(library.gain) - LEAST_LEAD)
                .map(|t| t.candidate.id)
                .collect();
            Some((described, Origin::Empirical, causes))
        }
        None => Some((library, Origin::Discovered, rivals)),
    }
}

/// Drops effects whose place the final data does not support.
fn drop_weak(bench: &mut Bench, fitted: &mut Fitted, steps: &mut Vec<Step>) -> Result<(), Refusal> {
    if steps.len() < 2 {
        return Ok(());
    }
    loop {
        let with = refit(bench, fitted, &fitted.fit.hypothesis, CAREFUL);
        let worth = 1.0
            / sample_cost(&evaluate(
                &bench.tracks,
                &fitted.fit.hypothesis,
                &fitted.fit.starts,
                Role::Fit,
                Window::Whole,
                None,
            ));
        let n = worth * count(&with);
        let weakest = (0..fitted.fit.hypothesis.members.len())
            .filter(|&i| steps.iter().any(|s| s.id == fitted.fit.hypothesis.members[i].id))
            .map(|i| {
                let mut reduced = fitted.fit.hypothesis.clone();
                let member = reduced.members.remove(i);
                let without = refit(bench, fitted, &reduced, CAREFUL);
                let parameters = member.id.description().parameters.len() as f64;
                (n * (mean_square(&without) / mean_square(&with)).ln() - parameters * n.ln(), i)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match weakest {
            Some((gain, i)) if gain < LEAST_GAIN => {
                let mut reduced = fitted.fit.hypothesis.clone();
                let member = reduced.members.remove(i);
                *fitted = fit_with_ring_downs(bench, &reduced)?;
                steps.retain(|s| s.id != member.id);
            }
            _ => return Ok(()),
        }
    }
}

/// Every way to extend a hypothesis on this bench.
fn candidates(bench: &Bench, hypothesis: &Hypothesis, residual: &Evaluation, dense: &Evaluation) -> Vec<Candidate> {
    let sensor = bench.instrument == Instrument::Sensor;
    let commands = bench.tracks.iter().any(|t| t.track.has_commands());
    let mut out = Vec::new();
    for &id in EffectId::ALL {
        let d = id.description();
        if d.declared || (sensor && !d.in_sensors) || (d.stage == Stage::Actuation && !commands) {
            continue;
        }
        if d.scaling.rate > 0 && !bench.rate_varies() {
            // a constant per rate hides in the bias of each run
            continue;
        }
        let searched = d.parameters.iter().enumerate().find_map(|(p, parameter)| match parameter.role {
            ParameterRole::Searched(over) => Some((p, over)),
            _ => None,
        });
        let plain = Candidate { id, values: id.neutral(), refine: None, tried: 1.0 };
        if let Some((p, over)) = searched {
            let taken = |v: f64| {
                hypothesis.members.iter().any(|m| m.id == id && (m.values[p] - v).abs() < 1e-3 * v.abs().max(1e-3))
            };
            let (found, tried) = proposals(bench, residual, dense, over);
            for value in found.into_iter().filter(|v| !taken(*v)).take(PROPOSALS) {
                let mut values = id.neutral();
                values[p] = value;
                out.push(Candidate { values, tried, ..plain.clone() });
            }
            continue;
        }
        match hypothesis.position(id) {
            None if d.onsets.is_empty() => out.push(plain),
            None => {
                let amplitude = largest_component(bench);
                for onset in d.onsets {
                    let mut values = id.neutral();
                    values[0] = onset / amplitude;
                    out.push(Candidate { values, tried: d.onsets.len() as f64, ..plain.clone() });
                }
            }
            Some(member)
                if !hypothesis.members[member].refined
                    && d.parameters.iter().any(|p| p.role == ParameterRole::Refined) =>
            {
                out.push(Candidate { refine: Some(member), ..plain });
            }
            Some(_) => {}
        }
    }
    out
}

/// Values that a searched parameter could take, strongest first, and how many were looked at.
fn proposals(bench: &Bench, residual: &Evaluation, dense: &Evaluation, over: Search) -> (Vec<f64>, f64) {
    let harmonics = |of, limit| {
        let most = resolved_harmonics(residual, of, limit);
        let found = strongest_harmonics(residual, of, most).into_iter().map(|(n, _)| f64::from(n)).collect();
        (found, f64::from(most.max(1)))
    };
    match over {
        Search::PatternHarmonic => harmonics(Follows::Pattern, PATTERN_HARMONICS),
        Search::TableHarmonic => harmonics(Follows::Table, TABLE_HARMONICS),
        Search::Frequency => {
            // At one rate a line in time is also one in angle: nothing tells which.
            if !several_rates(bench) {
                return (Vec::new(), 1.0);
            }
            let samples: usize = dense.segments.iter().map(|s| s.samples).max().unwrap_or(1);
            (strongest_frequency(dense).map(|f| f.0).into_iter().collect(), samples as f64)
        }
    }
}

/// The fitted runs were made at more than one speed.
pub(crate) fn several_rates(bench: &Bench) -> bool {
    let rates: Vec<f64> =
        bench.tracks.iter().filter(|t| t.track.samples(Role::Fit) > 0).map(|t| t.track.mean_rate().abs()).collect();
    rates.iter().any(|r| (r - rates[0]).abs() > SAME_RATE * rates[0])
}

/// The largest in-phase readout of any channel, V, spikes aside.
fn largest_component(bench: &Bench) -> f64 {
    let mut sizes: Vec<f64> = bench
        .tracks
        .iter()
        .flat_map(|t| {
            let stride = (t.track.t_s.len() / 2000).max(1);
            (0..t.track.t_s.len()).step_by(stride).map(|i| {
                let e = t.track.envelope(i);
                e.x_c.abs().max(e.y_c.abs())
            })
        })
        .collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() * 99 / 100).copied().unwrap_or(1.0).max(1e-12)
}

/// The hypothesis with a candidate in it.
fn extend(hypothesis: &Hypothesis, candidate: &Candidate, origin: Origin) -> Hypothesis {
    let mut extended = hypothesis.clone();
    match candidate.refine {
        Some(member) => extended.members[member].refined = true,
        None => {
            let at = extended.admit(candidate.id, origin);
            extended.members[at].values = candidate.values;
        }
    }
    extended
}

/// The refitted hypothesis of a trial with the final origin of its new member.
fn extend_from(trial: &Trial, origin: Origin) -> Hypothesis {
    let mut extended = trial.fit.hypothesis.clone();
    if trial.candidate.refine.is_none() {
        // the newest of equal members stands last among them
        if let Some(m) = extended.members.iter_mut().rev().find(|m| m.id == trial.candidate.id) {
            m.origin = origin;
        }
    }
    extended
}

fn refit(bench: &Bench, fitted: &Fitted, hypothesis: &Hypothesis, effort: Effort) -> Fit {
    let unknowns: Vec<Unknown> = bench.unknowns(hypothesis);
    let priors = bench.priors(hypothesis, fitted.drive.as_ref());
    fit(&bench.tracks, hypothesis, &unknowns, &priors, Role::Fit, effort)
}

fn count(fit: &Fit) -> f64 {
    (fit.counted[0] + fit.counted[1]) as f64
}

/// Mean square after the last step; infinite where most of the data had to be set aside.
fn mean_square(fit: &Fit) -> f64 {
    if fit.counted[0] <= fit.set_aside {
        return f64::INFINITY;
    }
    (fit.chi2[0] + fit.chi2[1] + fit.prior_chi2 - fit.step_gain).max(0.0) / count(fit).max(1.0)
}

/// ln n per parameter, and 2 ln of the alternatives tried.
fn price(candidate: &Candidate, n: f64) -> f64 {
    let parameters = candidate.id.description().parameters;
    let adjusted = match candidate.refine {
        Some(_) => parameters.iter().filter(|p| p.role == ParameterRole::Refined).count(),
        None => parameters.iter().filter(|p| p.role != ParameterRole::Refined).count(),
    };
    adjusted as f64 * n.max(2.0).ln() + 2.0 * candidate.tried.ln()
}

fn sample_cost(evaluation: &Evaluation) -> f64 {
    let correlation = autocorrelation(evaluation, WHITENESS_LAGS);
    inflation(&correlation, evaluation.errors().count())
}

/// Held-out mean square of a fit, rad².
fn heldout(bench: &Bench, fit: &Fit) -> f64 {
    evaluate(&bench.tracks, &fit.hypothesis, &fit.starts, Role::Holdout, Window::Whole, None).mean_square()
}
