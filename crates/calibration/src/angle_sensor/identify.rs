//! The main job for angle sensors and rate gyroscopes: runs made ready, a model selected and fitted, the held-out rows read
//! once at the end, and a report of it all.

use super::circle;
use super::cross_axis;
use super::deviations::{Deviations, deviations, own_gain_ratios};
use super::drift::Drifts;
use super::effects::{Described, LibraryReadout};
use super::jumps::without_jumps;
use super::model::{Outcome, SensorModel, positions};
use super::odd_runs::{held_out_as_fitted, without_odd_runs};
use super::pattern_or_rate::Rate;
use super::rate_finding::{Stated, rate_finding};
use super::rate_runs;
use super::readout::{Competing, Kind};
use super::report::{ByItself, Errors, Finding, Head, report};
use super::samples::{Reading, SensorRun, apart, prepare};
use super::screening::{LARGEST_STEP, believed};
use super::sensor::other_unit;
use super::sensor_alone::alone;
use super::table_fit::Sample;
use super::thermal::{Thermal, Told};
use super::units::{of_the_angle, of_the_reference, require_degrees};
use super::whole_periods::in_any_order;
use crate::data::held_reference::go_on_evenly;
use crate::data::plausibility::without_frozen_rows;
use crate::data::slips::slips;
use crate::diagnostics::decomposition::{Influence, decompose};
use crate::error::Refusal;
use crate::identified::{Identification, Options, not_taken, not_tried};
use crate::model::hypothesis::Hypothesis;
use crate::numerics::angles::followed;
use crate::numerics::statistics::{line, median, span};
use crate::recording::{Campaign, Instrument, Run, RunKind};
use crate::report::gate::least_held_out;
use crate::report::inference::{CONTRADICTS, covering};
use crate::report::{EffectReport, Estimate, Share};
use cvg_model::effects::{EffectId, Stage};

/// A campaign without a pattern: an angle sensor, or the integrated output of a rate gyroscope, whose angle goes round once
/// a turn.
pub(crate) fn serves(campaign: &Campaign) -> bool {
    campaign.instrument == Instrument::Sensor || is_rate_gyroscope(campaign)
}

/// A gyroscope whose only output is an angle that goes round once a turn, turned about its input axis and perhaps others; not one
/// whose angle is a pattern's.
pub(crate) fn is_rate_gyroscope(campaign: &Campaign) -> bool {
    rate(campaign) != Rate::No
}

/// What says that a campaign is of a rate gyroscope.
fn rate(campaign: &Campaign) -> Rate {
    let of_one = |run: &Run| {
        matches!(run.kind, RunKind::Rotation | RunKind::CrossAxis)
            && run.recording.theta_deg.is_some()
            && run.recording.xc_v.is_none()
    };
    let may_be = campaign.instrument == Instrument::Gyroscope
        && campaign.period_deg == Some(360.0)
        && campaign.runs.iter().all(of_one)
        && campaign.runs.iter().any(|run| run.kind == RunKind::Rotation);
    if may_be { Rate::of(campaign) } else { Rate::No }
}

/// Harmonics of the position in the decomposition; rows that each of its unknowns needs.
const POSITION_HARMONICS: usize = 12;
const ROWS_PER_HARMONIC: usize = 12;
/// Waves of the time in it at most; none faster than once a turn, because what is n per turn is position.
const TIME_WAVES: usize = 4;
/// Turns from which on a time is told from a position by more than a straight line.
const TURNS_FOR_WAVES: f64 = 1.5;
/// Rows beyond which the decomposition and the jackknife look at every so many.
const ENOUGH_ROWS: usize = 3000;
/// How far an angle may turn, of what its gain asks for, and be of its reference.
const FOLLOWING: std::ops::Range<f64> = 0.5..2.0;
/// A free gain changes by this share at most: what the readout and errors of the position take of a line.
const LARGEST_CHANGE_OF_GAIN: f64 = 0.5;
/// Half a turn, rad, as it is measured: rows stand a little short of both its ends.
const HALF_A_TURN: f64 = 0.99 * std::f64::consts::PI;

/// Identifies a campaign that [`serves`].
///
/// # Errors
/// [`Refusal`] where the campaign is not what it says it is, or does not carry an answer.
pub(crate) fn identify(
    mut campaign: Campaign,
    options: &Options<'_>,
    with_plots: bool,
) -> Result<Identification, Refusal> {
    let rate = rate(&campaign);
    let rate_gyroscope = rate != Rate::No;
    require_an_angle(&campaign)?;
    let instrument = campaign.instrument;
    // a number of periods has no sense: the sign of angular_gain states it, and the data where there is none
    let sense = campaign.angular_gain.map(f64::signum);
    let stated = campaign.pole_pairs.or(campaign.angular_gain);
    let period = campaign.period_deg.unwrap_or(360.0).to_radians();
    let scattered = if stated.is_none() && !rate_gyroscope { in_any_order(&campaign.runs, period) } else { None };
    let stated = stated.or(scattered);
    let reference_c = campaign.temperature_c;
    let rates_alone = campaign.runs.iter().all(|run| run.recording.table_deg.is_none());
    // runs are known by their number among those about the input axis
    campaign.runs.sort_by_key(|run| run.kind == RunKind::CrossAxis);
    let head = Head::of(&campaign);
    let across = cross_axis::take(&mut campaign);
    (options.progress)("preparing the runs");
    let mut left_out: Vec<String> = rate.said().into_iter().collect();
    left_out.extend(mended(&mut campaign, rate_gyroscope, scattered, period)?);
    let mut runs = prepare(campaign, &mut left_out)?;
    runs = if rate_gyroscope {
        rate_runs::believed(runs, stated.unwrap_or(1.0), period, &mut left_out)?
    } else {
        believed(runs, stated, period, &mut left_out)?
    };
    let (mut fitted, mut held) = apart(runs)?;
    let asked = Asked { stated, sense, period, rates_alone };
    let thermal = if rate_gyroscope {
        None
    } else {
        require_a_turn([&fitted, &held], stated.unwrap_or(1.0), period)?;
        without_drifts([&mut fitted, &mut held], asked, reference_c, &mut left_out)
    };
    let (left, needed) = (held.iter().map(SensorRun::len).sum::<usize>(), least_held_out(instrument));
    if left < needed {
        return Err(Refusal::no_answer(
            "campaign",
            format!("{left} held-out rows are left to test an answer on, and {needed} are needed"),
            "a longer recording, or a longer run with use = \"holdout\"",
        ));
    }
    (options.progress)("choosing a model of the sensor");
    let (texts, why_not) = competing(&options.effects, &fitted);
    let mut finding = if rate_gyroscope {
        rate_finding(Stated { gain: stated, sense, reference_c }, period, &fitted, &held)?
    } else {
        let all: Vec<usize> = fitted.iter().map(|run| run.number).collect();
        let asked_for = positions(&held);
        let competing = Competing::with(&texts);
        let identify = |runs: &[SensorRun]| SensorModel::identify(stated, period, runs, competing, &asked_for);
        let model;
        (fitted, model) = without_odd_runs(fitted, identify, &mut left_out)?;
        held.retain(|run| !all.contains(&run.number) || fitted.iter().any(|f| f.number == run.number));
        held = held_out_as_fitted(held, &fitted, &model, period, &mut left_out)?;
        sensor_finding(asked, model, thermal.as_ref(), [&fitted, &held], &texts)?
    };
    finding.warnings.extend(left_out);
    finding.warnings.extend(why_not);
    (options.progress)("measuring the held-out error");
    let unit = other_unit(&fitted, period).filter(|_| stated.is_none() && !rate_gyroscope);
    let mut identified = report(head, finding, &fitted, &held, with_plots).map_err(|refusal| match unit {
        Some(unit) => Refusal { wanted: format!("{}; {unit}", refusal.wanted), ..refusal },
        None => refusal,
    })?;
    cross_axis::add(&mut identified.report, across)?;
    Ok(identified)
}

/// What can be done about rows that were not recorded as they stand, and what is said of it; a sensor's angles are in degrees, where its rows
/// can be followed.
fn mended(
    campaign: &mut Campaign,
    rate_gyroscope: bool,
    scattered: Option<f64>,
    period: f64,
) -> Result<Vec<String>, Refusal> {
    let mut said = Vec::new();
    for run in campaign.runs.iter_mut().filter(|run| run.kind == RunKind::Rotation) {
        said.extend(go_on_evenly(&mut run.recording));
        if !rate_gyroscope {
            said.extend(without_frozen_rows(&mut run.recording));
        }
    }
    if rate_gyroscope {
        campaign.runs.iter_mut().for_each(|run| said.extend(without_jumps(run, period)));
    } else if scattered.is_none() {
        campaign.runs.iter().try_for_each(|run| require_degrees(run, period))?;
    }
    if let Some(periods) = scattered.filter(|periods| *periods > 1.0) {
        said.push(format!(
            "the rows stand in no order: of whole numbers of periods a turn {periods:.0} alone fits, and was taken; pole_pairs in campaign.toml states it"
        ));
    }
    Ok(said)
}

/// Takes out of the runs what is none of the sensor's at one temperature: what follows the temperature, which is returned, and what goes with
/// the time.
fn without_drifts(
    [fitted, held]: [&mut Vec<SensorRun>; 2],
    Asked { stated, period, .. }: Asked,
    reference_c: Option<f64>,
    said: &mut Vec<String>,
) -> Option<Thermal> {
    let thermal = match Thermal::told(fitted, stated, period, reference_c) {
        Told::Nothing => None,
        Told::Open(why) => {
            said.push(why);
            None
        }
        Told::Slopes(told) => {
            fitted.iter_mut().chain(held.iter_mut()).for_each(|run| *run = told.undone(run));
            Some(told)
        }
    };
    let drifts = Drifts::told(fitted, stated, period);
    fitted.iter_mut().chain(held.iter_mut()).for_each(|run| *run = drifts.undone(run));
    said.extend(drifts.said());
    thermal
}

/// A rate that was summed drifts, which an angle sensor does not: it is a rate gyroscope's.
fn require_an_angle(campaign: &Campaign) -> Result<(), Refusal> {
    let summed = |run: &&Run| run.recording.theta_is_integral && run.recording.xc_v.is_none();
    match campaign.runs.iter().find(summed).filter(|_| campaign.instrument == Instrument::Sensor) {
        None => Ok(()),
        Some(run) => Err(Refusal::no_answer(
            &run.file.display().to_string(),
            "theta_deg is the integral of a rate, and an angle sensor measures an angle",
            "of a rate gyroscope a campaign.toml with period_deg = 360 in [campaign], and neither --sensor nor instrument = \"sensor\"",
        )),
    }
}

/// How far the reference turns in the whole of a run, of which a part may be held out, rad.
fn travel_of_the_whole([fitted, held]: [&[SensorRun]; 2], run: &SensorRun) -> f64 {
    let parts = [fitted, held].into_iter().flatten().filter(|part| part.number == run.number);
    span(&parts.flat_map(|part| part.reference_rad.iter().copied()).collect::<Vec<_>>())
}

/// A sensor turns through half a turn in one run at least.
fn require_a_turn(parts: [&[SensorRun]; 2], gain: f64, period: f64) -> Result<(), Refusal> {
    let [runs, _] = parts;
    let furthest = runs.iter().map(|run| travel_of_the_whole(parts, run) * gain.abs()).fold(0.0, f64::max);
    if furthest < HALF_A_TURN {
        let name = runs.first().map_or("campaign", |r| r.name.as_str());
        return Err(Refusal::no_answer(
            name,
            format!("the angle turns through {:.1}° only", furthest.to_degrees()),
            match other_unit(runs, period).or_else(|| runs.iter().find_map(of_the_reference)) {
                Some(unit) => format!("at least half a turn (180°); {unit}"),
                None => "at least half a turn (180°)".into(),
            },
        ));
    }
    Ok(())
}

/// An angle that hardly turns while its reference does is none of it: as a rule it is a rate, or in another unit.
fn require_following(parts: [&[SensorRun]; 2], gain: f64, period: f64) -> Result<(), Refusal> {
    let [runs, _] = parts;
    let travel = |run: &SensorRun| travel_of_the_whole(parts, run) * gain.abs();
    let furthest = runs.iter().filter(|r| r.channels().is_none()).max_by(|a, b| travel(a).total_cmp(&travel(b)));
    let Some((run, Reading::Angle(theta))) = furthest.map(|run| (run, &run.reading)) else { return Ok(()) };
    let slope = line(&run.reference_rad, &followed(theta, &run.reference_rad, period)).0 / gain;
    // rows in any order are not followed from one to the next
    let mut steps: Vec<f64> = run.reference_rad.windows(2).map(|w| (gain * (w[1] - w[0])).abs()).collect();
    let is_followed = median(&mut steps) < LARGEST_STEP * period;
    if travel(run) > HALF_A_TURN && (!is_followed || FOLLOWING.contains(&slope.abs())) {
        return Ok(());
    }
    let turns = if travel(run) > HALF_A_TURN {
        format!(": it turns {:.4} times as far as it should", slope.abs())
    } else {
        String::new()
    };
    Err(Refusal::no_answer(
        &run.name,
        format!(
            "theta_deg does not follow the reference, which turns through {:.0}°{turns}",
            travel_of_the_whole(parts, run).to_degrees()
        ),
        of_the_angle(run).unwrap_or_else(|| {
            "the sensor's angle as theta_deg; of a rate gyroscope theta_deg = \"integral(COLUMN)\" in [columns] and period_deg = 360 in [campaign] of campaign.toml, without --sensor".into()
        }),
    ))
}

/// A gain that ends far from what a line says of the angle was taken away with the error.
fn require_a_gain(model: &SensorModel) -> Result<(), Refusal> {
    let (gain, moved) = (model.sensor.gain.abs(), model.table.moved_gain().abs());
    if model.outcome == Outcome::Neutral || moved < LARGEST_CHANGE_OF_GAIN * gain {
        return Ok(());
    }
    Err(Refusal::no_answer(
        "campaign",
        format!("a line through the angle says {gain:.4} periods a turn, and the fit is {moved:.4} off that"),
        "angular_gain or pole_pairs in campaign.toml, or a reference that turns further",
    ))
}

/// The raw angle turns, because the origin lies within what the channels draw.
fn raw_turns(model: &SensorModel) -> bool {
    model.front().is_none_or(|r| r.kind == Kind::Plain || r.is_about_the_origin())
}

/// What has to be said of a model before its numbers.
fn said_of(
    model: &SensorModel,
    stated: Option<f64>,
    period: f64,
    runs: &[SensorRun],
    held: &[SensorRun],
    rates_alone: bool,
) -> Result<Vec<String>, Refusal> {
    let mut warnings = Vec::new();
    if stated.is_none() {
        warnings.extend(model.sensor.doubts(rates_alone, runs)?);
    }
    warnings.extend(runs.iter().chain(held).filter_map(|run| jumps(run, &model.left(run), period)));
    if !raw_turns(model) {
        warnings.push(
            "the readout's offsets exceed its amplitude, so that the raw angle does not turn: the ellipse was centred \
             first, and heldout.raw is null"
                .into(),
        );
    }
    if model.by_radius {
        warnings.push(
            "the reference was commanded and not measured: the readout is known from the radius of its ellipse alone, and \
             the angle errors stated are those against what was commanded; of a reference that was kept, reference = \"measured\" in \
             campaign.toml lets the angle tell as well"
                .into(),
        );
        if !model.table.table.cos.is_empty() {
            warnings.push(
                "what repeats against the command is taken off in the errors stated and is no part of the calibration: it may be the drive's".into(),
            );
        }
    }
    Ok(warnings)
}

/// The effects as text that compete in a sensor: of the readout and of nothing but its two channels; and what to say of the
/// others.
fn competing(effects: &[EffectId], runs: &[SensorRun]) -> (Vec<EffectId>, Option<String>) {
    let channels = runs.iter().all(|r| r.channels().is_some()) && !runs.iter().all(|r| r.commanded);
    let (texts, others): (Vec<_>, Vec<_>) =
        effects.iter().partition(|id| channels && id.description().stage == Stage::Readout && id.is_of_the_channels());
    let why = "of an angle sensor compete effects of the stage readout, without first, that ask for x, y and what these make up, \
               where two channels stand beside a measured reference";
    (texts, not_tried(&others, why))
}

/// The model of a sensor, with the deviations of its values. An effect as text, or cubics, that the intervals do not tell from their
/// absence are none: the model is identified without them.
fn identified(
    asked: Asked,
    mut model: SensorModel,
    [runs, held]: [&[SensorRun]; 2],
    mut texts: Vec<EffectId>,
) -> Result<(SensorModel, Deviations), Refusal> {
    let mut largest = Kind::CubicPerChannel;
    loop {
        let mut deviations = deviations(&model, &thinned(runs));
        let unsure = model.front().map(|readout| deviations.texts_not_told(readout)).unwrap_or_default();
        let told = model.front().map_or(largest, |readout| deviations.told(readout)).min(largest);
        if unsure.is_empty() && told == largest {
            model.without_motion_by_chance(&mut deviations);
            return Ok((model, deviations));
        }
        texts.retain(|id| !unsure.contains(id));
        largest = told;
        let competing = Competing { largest, texts: &texts };
        model = SensorModel::identify(asked.stated, asked.period, runs, competing, &positions(held))?;
    }
}

/// What a campaign says of its sensor.
#[derive(Clone, Copy)]
struct Asked {
    /// the size of its angular gain
    stated: Option<f64>,
    /// the sign of its angular gain
    sense: Option<f64>,
    /// period of its angle, rad
    period: f64,
    /// no run has an angle of the reference
    rates_alone: bool,
}

/// Why the sensor stays as it is.
fn nothing_predicts(runs: &[SensorRun]) -> String {
    let unit = runs.iter().find_map(of_the_angle).map_or(String::new(), |unit| format!("; wanted: {unit}"));
    format!("nothing that was found predicts rows that were not fitted better than the sensor as it is{unit}")
}

/// Adds what goes with the temperature.
fn add(hypothesis: &mut Hypothesis, thermal: &Thermal) {
    hypothesis.reference_c = Some(thermal.reference_c());
    hypothesis.members.extend(thermal.members());
    hypothesis.members.sort_by_key(|m| m.id);
}

fn sensor_finding(
    asked: Asked,
    model: SensorModel,
    thermal: Option<&Thermal>,
    [runs, held]: [&[SensorRun]; 2],
    texts: &[EffectId],
) -> Result<Finding<'static>, Refusal> {
    let Asked { stated, sense, period, rates_alone } = asked;
    let (model, mut deviations) = identified(asked, model, [runs, held], texts.to_vec())?;
    if let (Some(thermal), Some(readout)) = (thermal, model.front()) {
        thermal.widen(&mut deviations, LibraryReadout::from(readout).gain_ratio, runs);
    }
    require_following([runs, held], model.sensor.gain, period)?;
    let thinned = thinned(runs);
    let described = Described { model: &model, deviations: &deviations };
    let raw_turns = raw_turns(&model);
    let declared = model.front().map(|r| r.declared(raw_turns));
    let neutral = model.outcome == Outcome::Neutral;
    let mut warnings = said_of(&model, stated, period, runs, held, rates_alone)?;
    require_a_gain(&model)?;
    let own = own_gain_ratios(&model, &thinned).into_iter();
    let all = described.gain_ratio();
    let all = all.map(|all| covering(all, "detection gain ratio", own, CONTRADICTS, &mut warnings));
    let (there, not_told) = model.where_asked(runs, held);
    warnings.extend(not_told.into_iter().map(of_two_lines));
    // a negative one that counts with the reference is k as Equation 1 has it
    let against = sense.is_some_and(|s| s > 0.0 && model.sensor.gain < 0.0);
    let gain_ratio = all.map(|ratio| if against { or_exchanged(ratio) } else { ratio });
    warnings.extend(against.then(|| counts_against(gain_ratio)));
    let on_a_circle =
        model.front().filter(|r| r.kind == Kind::Plain).and_then(|_| circle::said_of(&model.sensor, runs));
    let without_ratio = gain_ratio.is_none() && !neutral && on_a_circle.is_none();
    warnings.extend(without_ratio.then(|| NO_GAIN_RATIO.to_owned()));
    warnings.extend(on_a_circle);
    warnings.extend(described.said_without_effects());
    let thermal = thermal.filter(|_| !neutral);
    warnings.extend(thermal.and_then(Thermal::said));
    let recorded: Vec<SensorRun> = thinned.iter().map(SensorRun::as_recorded).collect();
    let samples = model.sensor.samples(&recorded, declared.as_ref());
    let mut hypothesis = described.hypothesis(sense);
    let neutral_hypothesis = Hypothesis { members: Vec::new(), angle_table: None, clip: None, ..hypothesis.clone() };
    if let Some(thermal) = thermal {
        add(&mut hypothesis, thermal);
    }
    warnings.extend(not_taken(texts, &hypothesis));
    Ok(Finding {
        instrument: Instrument::Sensor,
        stated_gain: stated,
        reason: neutral.then(|| nothing_predicts(runs)),
        in_doubt: model.outcome == Outcome::Doubted,
        angular_gain: described.angular_gain(sense),
        detection_gain_ratio: gain_ratio,
        effects: with_the_interval(described.effects(), all)
            .into_iter()
            .chain(thermal.into_iter().flat_map(Thermal::effects))
            .collect(),
        hypothesis,
        neutral_hypothesis,
        decomposition: take_apart(&samples, &recorded, model.sensor.cycles, model.sensor.gain),
        warnings,
        raw: raw_turns.then(|| -> Errors<'_> {
            let sensor = model.sensor;
            Box::new(move |run| sensor.samples(&[run.as_recorded()], None).iter().map(|s| s.error).collect())
        }),
        declared: {
            let sensor = model.sensor;
            Box::new(move |run| {
                sensor.samples(&[run.as_recorded()], declared.as_ref()).iter().map(|s| s.error).collect()
            })
        },
        discovered: Box::new(move |run| there.left(run)),
        scale_factor: None,
        bias: None,
        alone: (!neutral).then(|| -> ByItself<'_> {
            let (model, gain) = (model.clone(), described.signed_gain().0);
            Box::new(move |run| alone(&model, gain, run))
        }),
        readout: model.front().cloned(),
        direction: Box::new(move |run| {
            model.sensor.samples(std::slice::from_ref(run), model.front()).iter().map(|s| s.theta).collect()
        }),
        period,
    })
}

/// Says that the angle and its reference part from one row to the next and stay apart, where they do: each side then has a
/// constant of its own.
fn jumps(run: &SensorRun, left: &[f64], period: f64) -> Option<String> {
    let found = slips(left, &vec![0.0; left.len()], period);
    let first = found.first()?;
    let more = if found.len() > 1 { format!(", the first of {} such jumps", found.len()) } else { String::new() };
    Some(format!(
        "{}: the angle and its reference part by {:.3}° at {:.3} s and stay apart{more}: a coupling that slipped, counts that were \
         lost, or a table that was zeroed",
        run.name,
        first.by.to_degrees(),
        run.t_s[first.at]
    ))
}

/// A gain ratio with an interval that also covers its inverse: what it would be with the channels in each other's place.
fn or_exchanged(ratio: Estimate) -> Estimate {
    let [low, high] = ratio.ci95;
    if low <= 0.0 {
        return ratio;
    }
    Estimate { ci95: [low.min(high.recip()), high.max(low.recip())], ..ratio }
}

/// Effects with the interval that the gain ratio of all runs has: that of the fit does not know where the runs disagree.
fn with_the_interval(mut effects: Vec<EffectReport>, ratio: Option<Estimate>) -> Vec<EffectReport> {
    let id = EffectId::DetectionGainMismatch.description().id;
    let parameters = effects.iter_mut().filter(|e| e.id == id).flat_map(|e| &mut e.parameters);
    parameters.for_each(|p| p.ci95 = ratio.map(|r| r.ci95).or(p.ci95));
    effects
}

/// Where a readout without gain and skew predicts as well.
const NO_GAIN_RATIO: &str = "detection_gain_ratio is null: no gain and skew were needed to predict the angle";

/// Says that a line of the position is not told from another one.
fn of_two_lines([n, other]: [u32; 2]) -> String {
    format!(
        "the line of {n} per turn may as well be one of {other}, which looks the same at the stations that were fitted, and is \
         another at those held out: it is not taken off there"
    )
}

/// Says that a sensor counts the other way than the campaign states.
fn counts_against(ratio: Option<Estimate>) -> String {
    let exchanged = ratio.map_or(String::new(), |ratio| {
        format!(
            "; if xc_v and yc_v stand in each other's place, the detection gain ratio is {:.5} and not {:.5}, and its \
             interval covers both",
            ratio.value.recip(),
            ratio.value
        )
    });
    format!(
        "the angle counts the other way than the campaign states with the sign of angular_gain: that sign is wrong, or that \
         of the reference, or the channels are exchanged{exchanged}"
    )
}

/// Runs thinned together to what a jackknife is made on.
pub(super) fn thinned(runs: &[SensorRun]) -> Vec<SensorRun> {
    let rows: usize = runs.iter().map(SensorRun::len).sum();
    let stride = (rows / ENOUGH_ROWS).max(1);
    runs.iter().map(|r| r.thinned(stride)).collect()
}

/// What the declared residual is a function of.
pub(super) fn take_apart(samples: &[Sample], runs: &[SensorRun], cycles: f64, gain: f64) -> Vec<Share> {
    let n = samples.len();
    let period = std::f64::consts::TAU / cycles;
    let turns = runs.iter().map(|r| r.travel_rad() * gain.abs() / period).fold(0.0, f64::max);
    let orders = POSITION_HARMONICS.min(n / ROWS_PER_HARMONIC).max(1);
    let column = |f: &dyn Fn(&Sample) -> f64| samples.iter().map(f).collect::<Vec<f64>>();
    let position = (1..=orders).flat_map(|k| {
        let k = k as f64 * cycles;
        [column(&|s| (k * s.theta).cos()), column(&|s| (k * s.theta).sin())]
    });
    let within: Vec<f64> = runs
        .iter()
        .flat_map(|r| {
            let (first, length) = (r.t_s[0], (r.t_s[r.len() - 1] - r.t_s[0]).max(f64::MIN_POSITIVE));
            r.t_s.iter().map(move |t| (t - first) / length)
        })
        .collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive count, saturating")]
    let waves = if turns > TURNS_FOR_WAVES { (turns as usize).clamp(1, TIME_WAVES) } else { 0 };
    let time = if waves == 0 {
        vec![within.clone()]
    } else {
        (1..=waves).map(|k| within.iter().map(|t| (std::f64::consts::PI * k as f64 * t).cos()).collect()).collect()
    };
    let mut influences =
        vec![Influence { of: "pattern", columns: position.collect() }, Influence { of: "time", columns: time }];
    let rates = column(&|s| s.rate);
    let fastest = median(&mut rates.iter().map(|r| r.abs()).collect::<Vec<_>>());
    let spread = span(&rates);
    if spread > 0.1 * fastest && fastest > 0.0 {
        influences.push(Influence { of: "rate", columns: vec![rates.clone()] });
    }
    if rates.iter().any(|r| *r > 0.0) && rates.iter().any(|r| *r < 0.0) {
        influences.push(Influence { of: "direction", columns: vec![column(&|s| s.rate.signum())] });
    }
    // each run has a constant of its own
    let errors = super::table_fit::by_run(samples, runs.len(), |s| s.error).concat();
    decompose(&errors, &influences)
}
