//! What was found of a rate gyroscope, in the form that all instruments share.

use cvg_model::effects::EffectId;

use super::identify::{take_apart, thinned};
use super::rate_alone::Alone;
use super::rate_deviations::T_PARTS;
use super::rate_gyroscope::{RateGyroscope, tell_scale};
use super::rate_nonlinearity::Nonlinearity;
use super::rate_regression::{Stretch, Term};
use super::rate_runs;
use super::rate_runs::require_a_scale_factor;
use super::rate_thermal::BiasOverTemperature;
use super::report::{ByItself, Finding};
use super::samples::SensorRun;
use crate::error::Refusal;
use crate::model::hypothesis::{Hypothesis, Member, Origin};
use crate::numerics::statistics::root_mean_square;
use crate::recording::Instrument;
use crate::report::{EffectReport, Estimate, ParameterReport};

/// A response that moves the angle by less than this, rms, is not worth a word, rad: 0.0006°, an engineering choice.
const LEAST_RESPONSE: f64 = 1e-5;

/// Rounds in which the bias and how the scale factor goes with the rate settle.
const MOST_ROUNDS: usize = 6;
/// Rows of a run beyond which steps of its rate are looked for in every so many.
const ENOUGH_ROWS_OF_A_RUN: usize = 10_000;

/// What a campaign says of its rate gyroscope.
#[derive(Clone, Copy)]
pub(super) struct Stated {
    /// the size of its scale factor
    pub(super) gain: Option<f64>,
    /// the sign of its angular gain
    pub(super) sense: Option<f64>,
    /// the temperature that parameters refer to, °C
    pub(super) reference_c: Option<f64>,
}

/// Runs with what goes with the temperature taken out, where that is told.
fn at_one_temperature(thermal: Option<&BiasOverTemperature>, runs: &[SensorRun]) -> Vec<SensorRun> {
    runs.iter().map(|run| thermal.map_or_else(|| run.clone(), |told| told.taken_out(run))).collect()
}

/// Identifies a rate gyroscope from the runs to fit, and says what has to be said of it.
///
/// # Errors
/// Where the runs are too short, or turn at one rate.
pub(super) fn rate_finding(
    campaign: Stated,
    period: f64,
    recorded: &[SensorRun],
    held: &[SensorRun],
) -> Result<Finding<'static>, Refusal> {
    let Stated { gain: stated, sense, reference_c } = campaign;
    let of = |runs: &[SensorRun]| {
        RateGyroscope::identify(stated, period, runs).ok_or_else(|| {
            Refusal::no_answer("campaign", "the runs are too short to leave parts of them out", "a longer recording")
        })
    };
    let thermal = BiasOverTemperature::told(stated, period, recorded, reference_c);
    let beside = of(&at_one_temperature(thermal.as_ref(), recorded))?;
    let thermal = thermal.filter(|_| beside.answered);
    // what serves best where nothing undoes how the scale factor goes with the rate
    let applied = if thermal.is_some() { beside } else { of(recorded)? };
    let runs = at_one_temperature(thermal.as_ref(), recorded);
    let held = at_one_temperature(thermal.as_ref(), held);
    let (runs, held) = (runs.as_slice(), held.as_slice());
    let thinned = thinned(recorded);
    let (model, by_nonlinearity) = beside_nonlinearity(&applied, stated, period, runs);
    let scale_factor = by_nonlinearity.as_ref().map(Nonlinearity::found);
    let (gain, deviation) = model.gain;
    if model.answered {
        require_a_scale_factor(gain, stated.unwrap_or(1.0))?;
    }
    let sign = if sense.unwrap_or(-gain).is_sign_negative() { -1.0 } else { 1.0 };
    let value = sign * gain.abs();
    let applied_gain = sign * applied.gain.0.abs();
    let half_width = deviation.map_or(value.abs(), |deviation| T_PARTS * deviation);
    let [neutral_hypothesis, hypothesis] = hypotheses(&model, &applied, thermal.as_ref(), sign, period);
    let samples = model.sensor.samples(&thinned, None);
    let mut warnings = said_of(&model, runs, held, by_nonlinearity.as_ref())?;
    if by_nonlinearity.as_ref().is_some_and(Nonlinearity::is_told) {
        warnings.push(format!(
            "the scale factor goes with the rate, which a calibration does not undo: bias and scale factor are those beside it, and the \
             calibration has what serves best without, a bias of {:.5} deg/s and a scale factor of {:.6}",
            applied.value(Term::Bias).to_degrees(),
            applied_gain.abs()
        ));
    }
    warnings.extend(thermal.as_ref().and_then(BiasOverTemperature::said));
    let sensor = model.sensor;
    let raw = move |run: &SensorRun| sensor.samples(std::slice::from_ref(run), None).iter().map(|s| s.error).collect();
    Ok(Finding {
        instrument: Instrument::Gyroscope,
        stated_gain: Some(stated.unwrap_or(1.0)),
        reason: (!model.answered).then(|| {
            "bias, scale factor and lag predict parts of the runs that were left out worse than nothing does".into()
        }),
        in_doubt: false,
        angular_gain: Estimate { value, ci95: [value - half_width, value + half_width] },
        detection_gain_ratio: None,
        effects: rate_effects(&model).into_iter().chain(thermal.as_ref().map(BiasOverTemperature::effect)).collect(),
        hypothesis,
        neutral_hypothesis,
        scale_factor,
        // runs at other temperatures have other biases, and do not contradict it
        bias: model.answered.then(|| model.of_all(Term::Bias)).filter(|_| !model.bias_varies && thermal.is_none()),
        decomposition: take_apart(&samples, &thinned, sensor.cycles, sensor.gain),
        warnings,
        raw: Some(Box::new(raw)),
        declared: Box::new(raw),
        alone: model.answered.then(|| by_itself(&model, by_nonlinearity, thermal.clone(), &thinned)),
        discovered: Box::new(move |run| match &thermal {
            Some(told) => applied.left(&told.taken_out(run)),
            None => applied.left(run),
        }),
        readout: None,
        direction: Box::new(move |run| {
            sensor.samples(std::slice::from_ref(run), None).iter().map(|s| s.theta).collect()
        }),
        period,
    })
}

/// The hypothesis that leaves the angle as it is, and the one that undoes what serves best without a nonlinearity, `applied`; `sign` is that
/// of the angular gain.
fn hypotheses(
    model: &RateGyroscope,
    applied: &RateGyroscope,
    thermal: Option<&BiasOverTemperature>,
    sign: f64,
    period: f64,
) -> [Hypothesis; 2] {
    let mut neutral = Hypothesis::ideal(Instrument::Gyroscope, period, sign * model.sensor.gain.abs());
    neutral.follows_input = neutral.angular_gain * model.sensor.gain > 0.0;
    let mut hypothesis = Hypothesis {
        angular_gain: sign * applied.gain.0.abs(),
        rate_bias_rad_s: applied.value(Term::Bias),
        rate_bias_per_k_rad_s: thermal.map_or(0.0, BiasOverTemperature::slope_rad_s_k),
        reference_c: thermal.map(BiasOverTemperature::reference_c),
        ..neutral.clone()
    };
    let latency = applied.latency_s();
    if latency != 0.0 {
        let values = [latency, 0.0, 0.0, 0.0];
        let lag = Member { id: EffectId::AngleLatency, values, origin: Origin::Discovered, refined: true };
        hypothesis.members.push(lag);
    }
    [neutral, hypothesis]
}

/// What a run tells by itself, beside what goes with the rate and with the temperature.
fn by_itself(
    model: &RateGyroscope,
    nonlinearity: Option<Nonlinearity>,
    thermal: Option<BiasOverTemperature>,
    thinned: &[SensorRun],
) -> ByItself<'static> {
    let (model, told) = (model.clone(), nonlinearity.filter(Nonlinearity::is_told));
    let sensor = model.sensor;
    // at one rate what goes with the rate is part of what the run tells
    let turns_at_several = move |run: &SensorRun| Stretch::new(run, 0, &sensor, 0.0).is_some_and(|s| tell_scale(&[s]));
    let linear = move |run: &SensorRun| match told.as_ref().filter(|_| turns_at_several(run)) {
        Some(told) => told.taken_out(run),
        None => run.clone(),
    };
    let runs: Vec<SensorRun> = at_one_temperature(thermal.as_ref(), thinned).iter().map(&linear).collect();
    Box::new(move |run| {
        let Some(told) = &thermal else { return model.alone(&linear(run), &runs) };
        let alone = model.alone(&linear(&told.taken_out(run)), &runs)?;
        // a run has the bias of its own temperature
        Some(Alone { bias: alone.bias.turned(told.mean_of(run)), ..alone })
    })
}

/// The gyroscope with what its scale factor does with the rate, where the runs tell that: bias and lag are then those of runs
/// from which it was taken out. Steps of the rate would show it as a lag.
fn beside_nonlinearity(
    model: &RateGyroscope,
    stated: Option<f64>,
    period: f64,
    runs: &[SensorRun],
) -> (RateGyroscope, Option<Nonlinearity>) {
    // steps of the rate are found in each run by itself
    let enough: Vec<SensorRun> = runs.iter().map(|run| run.thinned(run.len() / ENOUGH_ROWS_OF_A_RUN)).collect();
    let mut found = (model.clone(), Nonlinearity::of_the_gains(model, &enough));
    for _ in 0..MOST_ROUNDS {
        let (_, Some(last)) = &found else { break };
        if !last.is_told() {
            break;
        }
        let last = last.clone();
        let linear: Vec<SensorRun> = runs.iter().map(|run| last.taken_out(run)).collect();
        let Some(mut beside) = RateGyroscope::identify(stated, period, &linear) else { break };
        let Some(again) = Nonlinearity::of_the_gains(&beside, &enough).filter(Nonlinearity::is_told) else {
            // beside what it was taken for there is none
            return (model.clone(), None);
        };
        let settled = again.is(&last);
        beside.allow_for(model, last.uncertainty());
        found = (beside, Some(again));
        if settled {
            break;
        }
    }
    found
}

/// What has to be said of a rate gyroscope beside its numbers, a scale factor that goes with the rate among them.
fn said_of(
    model: &RateGyroscope,
    runs: &[SensorRun],
    held: &[SensorRun],
    by_nonlinearity: Option<&Nonlinearity>,
) -> Result<Vec<String>, Refusal> {
    let mut warnings = Vec::new();
    if model.gain.1.is_none() {
        // of what hardly turns the bias is one all the same
        let what = "the runs turn at one rate, at which a scale factor cannot be separated from a bias";
        let wanted = "a run at another rate, or there and back";
        if runs.iter().any(|run| run.travel_rad() > std::f64::consts::TAU) {
            return Err(Refusal::no_answer("campaign", what, wanted));
        }
        warnings.push(format!("{what}: what is wrong stands as a bias, and the angular gain's interval says nothing; {wanted} separates them"));
    }
    let furthest = runs.iter().map(SensorRun::travel_rad).fold(0.0, f64::max);
    if furthest < std::f64::consts::TAU && model.gain.1.is_some() {
        warnings.push(format!(
            "the reference turns through {:.1}° only: were both rates in rad/s, their ratio would be right all the same and the bias \
             in rad/s; deg/s is what their columns say",
            furthest.to_degrees()
        ));
    }
    if let Some(lag) = model.lag_of_one_place {
        warnings.push(format!(
            "the angle and its reference part at one place only, where the rate changes, as a lag of {:.3} ms makes them: one place \
             does not tell a lag from a slip, and it is left as it is; runs that turn back several times tell",
            1e3 * lag
        ));
    }
    if model.bias_varies {
        warnings
            .push("the bias differs from run to run as much as it is large: it is taken to be zero elsewhere".into());
    }
    let moves = |response: f64| {
        let of_run = |run: &SensorRun| response.abs() * root_mean_square(&run.acceleration_rad_s2);
        runs.iter().map(of_run).fold(0.0, f64::max)
    };
    let shows = model.response.is_some_and(|response| moves(response) > LEAST_RESPONSE);
    if let Some(time_constant_s) = model.time_constant_s().filter(|_| shows) {
        warnings.push(rate_runs::of_the_response(time_constant_s));
    }
    // a bias and a scale factor of the run's own change nothing in its course
    let unexplained = |run| {
        let mut left = model.without_a_name(run);
        if let Some(nonlinearity) = by_nonlinearity {
            left.iter_mut().zip(nonlinearity.of(run)).for_each(|(left, named)| *left -= named);
        }
        rate_runs::parting(run, &model.beside_its_own(run, left))
    };
    warnings.extend(runs.iter().chain(held).filter_map(unexplained));
    Ok(warnings)
}

fn rate_effects(model: &RateGyroscope) -> Vec<EffectReport> {
    if !model.answered {
        return Vec::new();
    }
    let evidence = format!(
        "left-out fifths of the runs scatter by {:.4}° with it and {:.4}° without (geometric mean); interval by jackknife and as of a random walk",
        model.predicted.to_degrees(),
        model.predicted_raw.to_degrees()
    );
    let gain = model.gain.0;
    let effect = |id: EffectId, name: &str, unit: &str, value: f64, deviation: f64| EffectReport {
        id: id.description().id.into(),
        // what may as well be nothing is undone for what it brings, and is no discovery
        origin: if value.abs() > T_PARTS * deviation { Origin::Discovered } else { Origin::Empirical },
        parameters: vec![ParameterReport {
            name: name.into(),
            unit: unit.into(),
            value,
            ci95: Some([value - T_PARTS * deviation, value + T_PARTS * deviation]),
        }],
        heldout_rms_deg: None,
        evidence: format!("{}; {evidence}", id.description().signature),
        confounded_with: Vec::new(),
        separated_by: None,
    };
    let terms = model.terms.iter().filter(|t| t.1 != 0.0);
    terms
        .filter_map(|&(term, value, deviation)| match term {
            Term::Bias => Some(effect(EffectId::RateOffset, "rate_offset", "rad/s", value, deviation)),
            Term::Lag => {
                let (value, deviation) = (-value / gain, deviation / gain.abs());
                Some(effect(EffectId::AngleLatency, "latency", "s", value, deviation))
            }
            // the scale factor is k, a run's own bias is no effect of the instrument, and one that goes with the temperature is told by itself
            Term::Scale | Term::BiasOf(_) | Term::BiasPerKelvin | Term::ScalePerKelvin | Term::Response => None,
        })
        .collect()
}
