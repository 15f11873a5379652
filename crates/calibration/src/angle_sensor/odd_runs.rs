//! A run of an angle sensor that does not fit what the others say: what the others show, undone, leaves it far worse than them. It is
//! left out and named, with what is odd about it. Of two runs nothing tells which is the odd one: that they contradict each other is said.

use super::ellipse;
use super::model::SensorModel;
use super::samples::SensorRun;
use crate::error::Refusal;
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{median, root_mean_square, white_noise};

/// Runs from which on one can be odd, and the share of them that may be left out.
const FEWEST_RUNS: usize = 3;
const MOST_LEFT_OUT: f64 = 1.0 / 3.0;
/// A run that leaves so many times what the others do is looked at …
const SUSPECT: f64 = 1.5;
/// … and each of no more runs than this, where they read an angle …
const FEW: usize = 5;
/// … and is odd where the model of the others leaves this many times as much of it as of the worst of them: engineering choice.
const ODD: f64 = 5.0;
/// A held-out run turns by another gain where that is off by more than this share, and by more than this share of a period in its length.
const ANOTHER_GAIN: f64 = 0.05;
/// A cause is named where it is most of what is left: without it less than this share remains, rms.
const MOSTLY: f64 = 0.5;
/// Gain ratios that differ by less are one.
const SAME_RATIO: f64 = 2e-3;

/// The runs that fit one sensor, and its model.
///
/// # Errors
/// Where no model can be identified.
pub(super) fn without_odd_runs(
    mut runs: Vec<SensorRun>,
    identify: impl Fn(&[SensorRun]) -> Result<SensorModel, Refusal>,
    warnings: &mut Vec<String>,
) -> Result<(Vec<SensorRun>, SensorModel), Refusal> {
    let mut model = identify(&runs)?;
    let most = (MOST_LEFT_OUT * runs.len() as f64).floor();
    let mut left_out = 0.0;
    while runs.len() >= FEWEST_RUNS && left_out < most && !model.by_radius {
        let suspects = suspects(&runs, &model);
        let tried = suspects.into_iter().filter_map(|at| without(&runs, at, &identify));
        let Some(found) = tried.max_by(|a, b| a.apart().total_cmp(&b.apart())).filter(|found| found.apart() > ODD)
        else {
            break;
        };
        warnings.push(format!(
            "{}: left out: with what the other runs show undone its angle is off by {:.4}°, theirs by {:.4}° at most{}",
            runs[found.odd].name,
            found.own.to_degrees(),
            found.theirs.to_degrees(),
            cause(&found.model, &runs[found.odd], &found.rest).map_or(String::new(), |cause| format!("; {cause}"))
        ));
        (runs, model) = (found.rest, found.model);
        left_out += 1.0;
    }
    if !model.by_radius
        && let [one, other] = runs.as_slice()
    {
        warnings.extend(contradiction([one, other], &model, &identify));
    }
    Ok((runs, model))
}

/// The held-out runs whose angle goes with their reference as that of the fitted ones does: each is judged after the best line through it,
/// which makes nothing of a sensor that stands still or turns half as far.
///
/// # Errors
/// Where none does.
pub(super) fn held_out_as_fitted(
    held: Vec<SensorRun>,
    fitted: &[SensorRun],
    model: &SensorModel,
    period: f64,
    warnings: &mut Vec<String>,
) -> Result<Vec<SensorRun>, Refusal> {
    let usual = fitted.iter().map(|run| scatter(&model.left(run))).fold(0.0, f64::max);
    let gain = model.sensor.gain;
    let odd = |run: &SensorRun| {
        let left = model.left(run);
        let (_, [_, slope]) = regressed(run, &left, |a| [1.0, a]);
        let is_another =
            slope.abs() > ANOTHER_GAIN * gain.abs() && slope.abs() * run.travel_rad() > ANOTHER_GAIN * period;
        (is_another && scatter(&left) > ODD * usual).then(|| {
            let turns = (gain + slope) / gain * gain.abs();
            format!(
                "its angle turns {turns:.4} times as far as its reference, that of the fitted runs {:.4} times",
                gain.abs()
            )
        })
    };
    let why: Vec<Option<String>> = held.iter().map(odd).collect();
    if let Some((run, Some(what))) = held.iter().zip(&why).next().filter(|_| why.iter().all(Option::is_some)) {
        let wanted = "a held-out run, or a last quarter, in which the angle follows its reference";
        return Err(Refusal::no_answer(&run.name, format!("held out, {what}"), wanted));
    }
    warnings.extend(
        held.iter().zip(&why).filter_map(|(run, why)| Some(format!("{}: left out: {}", run.name, why.as_ref()?))),
    );
    Ok(held.into_iter().zip(why).filter(|(_, why)| why.is_none()).map(|(run, _)| run).collect())
}

/// Two runs that contradict each other: by itself each is described far better than by what both say, and neither describes the other.
fn contradiction(
    runs: [&SensorRun; 2],
    model: &SensorModel,
    identify: &impl Fn(&[SensorRun]) -> Result<SensorModel, Refusal>,
) -> Option<String> {
    let off = |model: &SensorModel, run: &SensorRun| scatter(&model.left(run));
    let together = runs.map(|run| off(model, run));
    if (0..2).any(|at| together[at] < ODD * white_noise(&model.left(runs[at]))) {
        return None;
    }
    let [first, second] = runs.map(|run| identify(std::slice::from_ref(run)).ok());
    let (first, second) = (first?, second?);
    let own = [off(&first, runs[0]), off(&second, runs[1])];
    let across = [off(&second, runs[0]), off(&first, runs[1])];
    let contradicts = (0..2).all(|at| ODD * own[at] < together[at].min(across[at]));
    contradicts.then(|| {
        format!(
            "{} and {} contradict each other: by itself the one is described to {:.4}° and the other to {:.4}°, by what both say to {:.4}° and \
             {:.4}°: they are of two sensors, or it was mounted anew; a third run would tell which is right, and each by itself is a campaign",
            runs[0].name,
            runs[1].name,
            own[0].to_degrees(),
            own[1].to_degrees(),
            together[0].to_degrees(),
            together[1].to_degrees()
        )
    })
}

/// The runs without one of them.
struct Without {
    odd: usize,
    rest: Vec<SensorRun>,
    model: SensorModel,
    /// what the model of the rest leaves of the one, and of the worst of the rest, rad rms
    own: f64,
    theirs: f64,
}

impl Without {
    fn apart(&self) -> f64 {
        self.own / self.theirs
    }
}

fn without(
    runs: &[SensorRun],
    odd: usize,
    identify: &impl Fn(&[SensorRun]) -> Result<SensorModel, Refusal>,
) -> Option<Without> {
    let others = runs.iter().enumerate().filter(|(at, _)| *at != odd);
    let rest: Vec<SensorRun> = others.map(|(_, run)| run.clone()).collect();
    let model = identify(&rest).ok()?;
    let own = scatter(&model.left(&runs[odd]));
    let theirs = rest.iter().map(|r| scatter(&model.left(r))).fold(0.0, f64::max);
    Some(Without { odd, rest, model, own, theirs })
}

/// The run of which far more is left than of the others. Of few runs that read an angle each may be the odd one: a model of all of them is
/// as far off one as the other.
fn suspects(runs: &[SensorRun], model: &SensorModel) -> Vec<usize> {
    let left: Vec<f64> = runs.iter().map(|r| scatter(&model.left(r))).collect();
    let Some(worst) = (0..runs.len()).max_by(|a, b| left[*a].total_cmp(&left[*b])) else { return Vec::new() };
    let mut others: Vec<f64> = (0..runs.len()).filter(|at| *at != worst).map(|at| left[at]).collect();
    if left[worst] > SUSPECT * median(&mut others) {
        return vec![worst];
    }
    let few = runs.len() <= FEW && runs.iter().all(|r| r.channels().is_none());
    if few { (0..runs.len()).collect() } else { Vec::new() }
}

/// Root of the mean square about the mean.
fn scatter(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    root_mean_square(&values.iter().map(|v| v - mean).collect::<Vec<_>>())
}

/// What is odd about a run, where that is one thing.
fn cause(model: &SensorModel, run: &SensorRun, others: &[SensorRun]) -> Option<String> {
    let left = model.left(run);
    let most = |beside: f64| beside < MOSTLY * root_mean_square(&left);
    let gain = model.sensor.gain;
    let (beside, [_, slope]) = regressed(run, &left, |a| [1.0, a]);
    if most(beside) {
        return Some(format!(
            "it turns {:.4} times as far as its reference, the others {:.4} times",
            (gain + slope).abs(),
            gain.abs()
        ));
    }
    let own = ellipse::gain_ratio(run)?;
    let mut ratios: Vec<f64> = others.iter().filter_map(ellipse::gain_ratio).collect();
    let ratio = median(&mut ratios);
    if (own / ratio - 1.0).abs() > SAME_RATIO {
        return Some(format!("its gain of Y over X is {own:.4} by itself, that of the others {ratio:.4}"));
    }
    let (beside, [_, _, cosine, sine]) = regressed(run, &left, |a| [1.0, a, a.cos(), a.sin()]);
    most(beside).then(|| {
        format!(
            "most of it is {:.3}° of the shaft, once a turn, as of an eccentric mounting",
            (cosine.hypot(sine) / gain.abs()).to_degrees()
        )
    })
}

/// What is left of an error, rms, beside these functions of the reference, and their coefficients.
fn regressed<const N: usize>(run: &SensorRun, left: &[f64], row: impl Fn(f64) -> [f64; N]) -> (f64, [f64; N]) {
    let first = run.reference_rad.first().copied().unwrap_or(0.0);
    let rows = || run.reference_rad.iter().map(|a| row(a - first)).zip(left);
    let mut equations = NormalEquations::new(N);
    rows().for_each(|(row, e)| equations.add(&row, *e));
    let x = equations.solve();
    let rest: Vec<f64> = rows().map(|(row, e)| e - row.iter().zip(&x).map(|(r, x)| r * x).sum::<f64>()).collect();
    (root_mean_square(&rest), std::array::from_fn(|i| x[i]))
}
