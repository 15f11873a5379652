//! The report of a sensor or a rate gyroscope: the held-out error at each stage, what is left, and the facts of what was
//! found, in the form that all instruments share.

use std::collections::BTreeSet;

use super::calibrated_rows::{covered_deg, radius_left};
use super::curve::Curve;
use super::evaluated::Evaluated;
use super::rate_alone::Alone;
use super::rate_runs::at_rest;
use super::readout::Readout;
use super::samples::SensorRun;
use crate::data::track::ONE_WAY;
use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::plots::{PlotData, plots_of};
use crate::diagnostics::residual::reported_harmonics;
use crate::diagnostics::temperature::{Seen, temperature};
use crate::error::Refusal;
use crate::facts::Follows;
use crate::identified::{BiasCurve, Figures, Identification};
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::root_mean_square;
use crate::recording::{Campaign, Instrument, RunKind};
use crate::report::calibration::{Calibration, Provenance};
use crate::report::gate::{self, Facts};
use crate::report::provenance;
use crate::report::recorded::{run_report, set_aside};
use crate::report::repeatability::of_the_gain;
use crate::report::stages::stages;
use crate::report::unexplained::{against_a_command, left_over, residual_report};
use crate::report::{
    EffectReport, Estimate, Input, Report, RunReport, SCHEMA, ScaleFactor, Share, Status, StepReport, Temperature,
    Tool, Unexplained,
};

/// Errors of a run at one stage, rad.
pub(crate) type Errors<'a> = Box<dyn Fn(&SensorRun) -> Vec<f64> + 'a>;

/// What a run of a rate gyroscope tells by itself.
pub(crate) type ByItself<'a> = Box<dyn Fn(&SensorRun) -> Option<Alone> + 'a>;

/// What an identification found, with the errors that it leaves of any run.
pub(crate) struct Finding<'a> {
    pub(crate) instrument: Instrument,
    /// the angular gain that the campaign states
    pub(crate) stated_gain: Option<f64>,
    /// why nothing is undone, where nothing is
    pub(crate) reason: Option<String>,
    /// a memory of the noise explains what was found as well in the rows that were fitted: another pass has to tell it
    pub(crate) in_doubt: bool,
    pub(crate) angular_gain: Estimate,
    pub(crate) detection_gain_ratio: Option<Estimate>,
    pub(crate) effects: Vec<EffectReport>,
    /// what a compensation undoes, and the same without anything to undo
    pub(crate) hypothesis: Hypothesis,
    pub(crate) neutral_hypothesis: Hypothesis,
    pub(crate) decomposition: Vec<Share>,
    pub(crate) warnings: Vec<String>,
    /// the error as recorded; none where the raw angle does not turn
    pub(crate) raw: Option<Errors<'a>>,
    pub(crate) declared: Errors<'a>,
    pub(crate) discovered: Errors<'a>,
    /// how the scale factor of a rate gyroscope goes with the rate
    pub(crate) scale_factor: Option<ScaleFactor>,
    /// the bias of all runs of a rate gyroscope, rad/s, where they share one
    pub(crate) bias: Option<Estimate>,
    /// what each run tells by itself, of what is answered
    pub(crate) alone: Option<ByItself<'a>>,
    /// the angle that the error is shown against
    pub(crate) direction: Errors<'a>,
    /// what is undone in the channels, where there are two
    pub(crate) readout: Option<Readout>,
    /// period of the angle, rad
    pub(crate) period: f64,
}

/// What the campaign says of itself, kept while its recordings are taken apart.
pub(crate) struct Head {
    device: String,
    runs: Vec<RunReport>,
    inputs: Vec<Input>,
    amplitude_v: Option<[f64; 2]>,
    readout_unit: Option<String>,
    warnings: Vec<String>,
}

impl Head {
    pub(crate) fn of(campaign: &Campaign) -> Self {
        Self {
            device: campaign.device.clone(),
            runs: campaign.runs.iter().map(run_report).collect(),
            inputs: provenance::sums(&provenance::files(campaign)),
            amplitude_v: provenance::amplitudes(campaign),
            readout_unit: provenance::readout_unit(campaign),
            warnings: campaign.runs.iter().flat_map(|r| r.recording.warnings.iter().cloned()).collect(),
        }
    }

    fn calibration(self, hypothesis: Hypothesis, fitted: &[SensorRun]) -> Calibration {
        let provenance = Provenance {
            tool: Some(Tool::default()),
            inputs: self.inputs,
            amplitude_v: self.amplitude_v,
            readout_unit: self.readout_unit,
            covered_deg: covered_deg(&hypothesis, fitted),
            radius_left: radius_left(&hypothesis, fitted),
            gain_unknown: false,
        };
        Calibration { device: self.device, hypothesis, provenance }
    }
}

/// A gain or a bias of a run's own that moves its angle by so many times what is left of it is not that of all runs.
const ODD: f64 = 3.0;
/// What is said where another pass tells what is undone.
const TOLD_BY_ANOTHER_PASS: &str = "in the rows that were fitted a memory of the noise would explain what was found as well: a held-out \
                                    run, another pass, tells that it is the sensor's";
/// Points of one curve.
const CURVE_POINTS: usize = 2000;
/// Reads the held-out rows, which nothing has met before, and reports.
///
/// # Errors
/// Where what was found does not pass the gate.
pub(crate) fn report(
    head: Head,
    finding: Finding<'_>,
    fitted: &[SensorRun],
    held: &[SensorRun],
    with_plots: bool,
) -> Result<Identification, Refusal> {
    let errors = Evaluated::of(&finding, fitted, held);
    let Evaluated { raw, declared, discovered, .. } = &errors;
    let neutral = errors.reason.is_some();
    let mut effects = if neutral { Vec::new() } else { finding.effects.clone() };
    provenance::in_unit(&mut effects, head.readout_unit.as_deref());
    for e in effects.iter_mut().filter(|e| e.origin != Origin::Declared) {
        e.heldout_rms_deg =
            Some(crate::report::BeforeAfter { before: declared.size().rms_deg, after: discovered.size().rms_deg });
    }
    let mut warnings = head.warnings.clone();
    warnings.extend(finding.warnings.iter().cloned());
    warnings.extend((finding.in_doubt && !neutral).then(|| TOLD_BY_ANOTHER_PASS.to_owned()));
    let spikes = errors.spikes(fitted.iter().chain(held).map(|r| r.number));
    warnings.extend(set_aside(spikes, "sample"));
    let heldout = errors.heldout(held);
    if finding.instrument == Instrument::Sensor {
        warnings.extend(left_over(&heldout));
    }
    let mut steps = stages(raw.as_ref(), declared, discovered, &[]);
    steps.extend(effects.iter().filter(|e| e.origin != Origin::Declared).map(|e| step(e, discovered)));
    let names: Vec<String> = held.iter().map(|r| r.name.clone()).collect();
    let plots = with_plots.then(|| plots(&names, raw.as_ref(), declared, discovered, &finding));
    let (mut reported, odd, temperature) =
        runs(&head, &finding, [fitted, held], [&errors.on_fit, discovered], &mut warnings);
    let angular_gain = covering_all(&finding, &odd, &mut reported, &mut warnings);
    let residual = residual_report(&errors.on_fit, discovered);
    let mut unexplained = described(&effects, &finding, fitted);
    if finding.readout.is_some() && is_commanded(fitted) {
        unexplained.extend(against_a_command(&residual));
    }
    let report = Report {
        schema: SCHEMA.into(),
        status: if neutral { Status::Neutral } else { Status::Answered },
        reason: errors.reason.clone(),
        tool: Tool::default(),
        inputs: head.inputs.clone(),
        device: head.device.clone(),
        instrument: finding.instrument.name().into(),
        angular_gain,
        detection_gain_ratio: finding.detection_gain_ratio.filter(|_| !neutral),
        actuation_gain_ratio: None,
        unexplained,
        effects,
        heldout,
        steps,
        residual,
        channels: Vec::new(),
        decomposition: finding.decomposition.clone(),
        proposals: Vec::new(),
        scale_factor: finding.scale_factor,
        repeatability_ppm: of_the_gain(&reported, angular_gain).map(|told| told.deviation),
        runs: reported,
        misalignment: Vec::new(),
        allan: None,
        temperature,
        decay: None,
        warnings,
    };
    let facts = facts(&finding, &report, &errors, fitted);
    let figures = Figures {
        bias: curves(held, raw.as_ref(), declared, discovered, finding.period),
        ring_downs: Vec::new(),
        channels: finding.readout.filter(|_| with_plots).map(|readout| Curve::new(&readout, held)),
    };
    let hypothesis = if neutral { finding.neutral_hypothesis } else { finding.hypothesis };
    let calibration = head.calibration(hypothesis, fitted);
    if neutral {
        gate::finite(&report, facts)?;
    } else {
        gate::pass(&report, &calibration, facts)?;
    }
    Ok(Identification { report, calibration, figures, steps: Vec::new(), plots })
}

/// The reference turns so far that there is an angular gain to tell: a turn.
fn turns(run: &SensorRun) -> bool {
    run.travel_rad() > std::f64::consts::TAU
}

fn step(e: &EffectReport, after: &Evaluation) -> StepReport {
    StepReport {
        stage: if e.origin == Origin::Discovered { "discovered".into() } else { "empirical".into() },
        effect: Some(e.id.clone()),
        heldout: after.size(),
        harmonics: reported_harmonics(after, Follows::Pattern, after),
        signature: None,
        gain: None,
        rivals: Vec::new(),
        energy_balance: None,
        inconsistency: None,
    }
}

/// What is said of a harmonic of the angle table of a sensor with so many periods a turn; once a turn of the shaft its eccentricity
/// shows, in the angle and not in the radius.
fn of_a_table(finding: &Finding<'_>, n: Option<u32>, periods: f64, commanded: bool) -> &'static str {
    if commanded {
        return AGAINST_A_COMMAND;
    }
    let once_a_turn = n == Some(1) && (periods - 1.0).abs() < 1e-9;
    match (finding.readout.is_some(), once_a_turn) {
        (true, true) => {
            "once a turn in the angle and not in the radius, where an offset of the channels would show: the eccentricity of a shaft or a \
             mounting; corrected as part of the angle table, for as long as nothing is mounted anew"
        }
        (true, false) => {
            "corrected as part of the angle table: what the two channels were found to have does not make it"
        }
        (false, true) => {
            "corrected as part of the angle table; record the two channels, which tell their offsets from an eccentric shaft or mounting"
        }
        (false, false) => {
            "corrected as part of the angle table; record the two channels, which tell offset, gain and skew from the rest"
        }
    }
}

/// What is said of a harmonic against a reference that was commanded.
const AGAINST_A_COMMAND: &str = "corrected on these data: the sensor's or the drive's, which a commanded reference does not tell apart; it is \
                                 not carried into the calibration; record table_deg, or state reference = \"measured\" in campaign.toml \
                                 where the rate was kept";

/// Of no fitted run more is known than what its reference was asked to do.
fn is_commanded(fitted: &[SensorRun]) -> bool {
    fitted.iter().all(|run| run.commanded)
}

/// What is said of an error that a recording without a reference does not tell.
const BY_ACCELERATION: &str = "corrected as an error in proportion to the acceleration on these data, as a tracking loop makes; it is not \
                               carried into the calibration, and a compensated recording keeps it";

/// What was corrected without a known cause on these runs.
fn described(effects: &[EffectReport], finding: &Finding<'_>, fitted: &[SensorRun]) -> Vec<Unexplained> {
    let periods = finding.hypothesis.angular_gain.abs();
    let commanded = finding.readout.is_some() && is_commanded(fitted);
    let mut out = Vec::new();
    let value = |e: &EffectReport, name: &str| e.parameters.iter().find(|p| p.name == name).map_or(0.0, |p| p.value);
    let mut add = |class: &str, n: Option<u32>, amplitude: f64, suggestion: &str| {
        out.push(Unexplained {
            class: class.into(),
            n,
            frequency_hz: None,
            rms_deg: (amplitude / std::f64::consts::SQRT_2).to_degrees(),
            suggestion: suggestion.into(),
        });
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small harmonic number")]
    for e in effects.iter().filter(|e| e.origin == Origin::Empirical) {
        match e.id.as_str() {
            "angle-table" => {
                for pair in e.parameters.chunks(2) {
                    let [c, s] = pair else { continue };
                    let seen = |p: &crate::report::ParameterReport| p.ci95.is_some_and(|i| i[0] > 0.0 || i[1] < 0.0);
                    if seen(c) || seen(s) {
                        let n = c.name.trim_start_matches("cos_").parse().ok();
                        add("pattern-harmonic", n, c.value.hypot(s.value), of_a_table(finding, n, periods, commanded));
                    }
                }
            }
            "table-harmonic" => {
                let n = value(e, "n");
                let whose = if n < periods {
                    "corrected as a line of the shaft's turn on these data, as an eccentric sensor makes; it is not carried into the \
                     calibration, because the poles do not tell where in its turn the shaft is"
                } else {
                    "corrected as a line of the reference's turn on these data; it is not carried into the calibration"
                };
                add("table-harmonic", Some(n as u32), value(e, "amplitude"), whose);
            }
            "harmonic-n" => add(
                "rate-dependent",
                Some(0),
                std::f64::consts::SQRT_2 * value(e, "amplitude").abs(),
                "corrected as a constant that changes sign with the direction; runs at two speeds tell a lag from play",
            ),
            "acceleration-lag" => {
                let all: Vec<f64> = fitted.iter().flat_map(|run| run.acceleration_rad_s2.iter().copied()).collect();
                let rms = periods * value(e, "acceleration_lag").abs() * root_mean_square(&all);
                add("rate-dependent", None, std::f64::consts::SQRT_2 * rms, BY_ACCELERATION);
            }
            // a bias or a lag that may as well be nothing has a name
            _ => {}
        }
    }
    out
}

/// What the gate holds a report against.
fn facts(finding: &Finding<'_>, report: &Report, errors: &Evaluated, fitted: &[SensorRun]) -> Facts {
    Facts {
        instrument: finding.instrument,
        period_deg: finding.period.to_degrees(),
        // what hardly turns has a bias, and a gain that nobody can judge
        tells_gain: gate::gain_is_told(&report.angular_gain) || fitted.iter().any(turns),
        stated: finding.stated_gain,
        held_out: errors.discovered.errors().count(),
        fitted_rms_deg: errors.on_fit.size().rms_deg,
    }
}

/// What each run tells, the angular gains among that which contradict that of all, and how it goes with the temperature.
fn runs(
    head: &Head,
    finding: &Finding<'_>,
    [fitted, held]: [&[SensorRun]; 2],
    [on_fit, after]: [&Evaluation; 2],
    warnings: &mut Vec<String>,
) -> (Vec<RunReport>, Vec<f64>, Option<Temperature>) {
    let mut out = head.runs.clone();
    let mut odd = Vec::new();
    let mut steady = vec![None; out.len()];
    // a run that rests has a bias, and nothing of a scale factor
    let all: Vec<&SensorRun> = fitted.iter().chain(held).collect();
    let rests =
        all.iter().zip(at_rest(&all)).filter(|(_, rests)| *rests && finding.instrument == Instrument::Gyroscope);
    let rests: BTreeSet<usize> = rests.map(|(run, _)| run.number).collect();
    let both = fitted.iter().zip(&on_fit.segments).zip(&on_fit.kept).map(|x| (x, true));
    for (((run, s), kept), is_fit) in both.chain(held.iter().zip(&after.segments).zip(&after.kept).map(|x| (x, false)))
    {
        let Some(r) = out.get_mut(run.number) else { continue };
        let n = run.len() - 1;
        let rate = ((run.reference_rad[n] - run.reference_rad[0]) / (run.t_s[n] - run.t_s[0])).to_degrees();
        r.rate_dps = Some(rate);
        r.spikes += kept.iter().filter(|k| !**k).count();
        let own = Evaluation { segments: vec![s.clone()], kept: vec![kept.clone()] };
        r.rms_deg = Some(own.size().rms_deg);
        let shared = fitted.iter().any(|f| f.number == run.number) && held.iter().any(|h| h.number == run.number);
        if is_fit || !shared {
            warnings.extend(tell(r, run, finding, kept, (!rests.contains(&run.number)).then_some(&mut odd)));
            let speed = run.rate_rad_s.iter().map(|w| w.abs()).sum::<f64>() / run.len() as f64;
            steady[run.number] = Some(rate).filter(|r| r.abs() > ONE_WAY * speed.to_degrees());
        }
        r.r#use = match (shared, is_fit) {
            (true, _) => "fit, last quarter held out".into(),
            (false, true) => "fit".into(),
            (false, false) => "holdout".into(),
        };
    }
    let used = |number: usize| fitted.iter().chain(held).any(|r| r.number == number);
    let turned = |r: &RunReport| r.kind == RunKind::Rotation.name();
    for (_, r) in out.iter_mut().enumerate().filter(|(number, r)| turned(r) && !used(*number)) {
        (r.r#use, r.agrees) = ("left out".into(), Some(false));
    }
    // a sensor has neither a scale factor nor a bias that could go with the temperature
    let of_rates = finding.instrument == Instrument::Gyroscope;
    let see = |(r, steady): (&RunReport, Option<f64>)| {
        let seen = Seen::of(r, steady.filter(|_| of_rates), r.temp_c?);
        Some(if of_rates { seen } else { Seen { gain: None, bias_dps: None, ..seen } })
    };
    let seen: Vec<Seen> = out.iter().zip(steady).filter_map(see).collect();
    let temperature = temperature(&seen, finding.hypothesis.sense());
    (out, odd, temperature)
}

/// Gain and bias as one run alone tells them, and the gain ratio of channels beside a temperature; says where they are not those of all
/// runs, and adds the gain to `odd_gains` then; a run that rests has none.
fn tell(
    r: &mut RunReport,
    run: &SensorRun,
    finding: &Finding<'_>,
    kept: &[bool],
    odd_gains: Option<&mut Vec<f64>>,
) -> Vec<String> {
    if r.temp_c.is_some() && run.channels().is_some() {
        r.detection_gain_ratio = super::ellipse::gain_ratio(&run.as_recorded());
    }
    let rows: Vec<usize> = (0..run.len()).filter(|&i| kept[i]).collect();
    let Some(alone) = finding.alone.as_ref().and_then(|alone| alone(&run.subset(&rows))) else { return Vec::new() };
    let Estimate { value, ci95: [low, high] } = alone.gain;
    // the sign by which the campaign counts
    let counts_alike = value * finding.hypothesis.angular_gain >= 0.0;
    let gain = if counts_alike { alone.gain } else { Estimate { value: -value, ci95: [-high, -low] } };
    r.angular_gain = odd_gains.is_some().then_some(gain);
    let in_degrees = |e: Estimate| Estimate { value: e.value.to_degrees(), ci95: e.ci95.map(f64::to_degrees) };
    let bias = in_degrees(alone.bias);
    r.bias_dps = Some(bias);
    let (turned, seconds) = (run.travel_rad().to_degrees(), run.t_s[run.len() - 1] - run.t_s[0]);
    let is_gyroscope = finding.instrument == Instrument::Gyroscope;
    // what a gain of its own makes is part of what all runs leave of a run
    let usual = if is_gyroscope {
        beside_its_own(run, &(finding.discovered)(run), &rows).to_degrees()
    } else {
        r.rms_deg.unwrap_or(0.0)
    };
    let odd = |own: &Estimate, all: &Estimate, over: f64| {
        let off = (own.value - all.value).abs();
        off > own.half_width() + all.half_width() && off * over > ODD * usual
    };
    // a scale factor that goes with the rate is said to, and runs at other rates do not contradict it
    let is_odd = odd_gains.is_some() && finding.scale_factor.is_none() && odd(&gain, &finding.angular_gain, turned);
    // a sensor's is a whole number, or stated
    if let Some(odd_gains) = odd_gains {
        odd_gains.extend((is_odd && is_gyroscope).then_some(gain.value));
    }
    let covered = if is_gyroscope { ", whose interval covers both" } else { "" };
    let of_gain = is_odd.then(|| {
        format!(
            "{}: its angular gain is {:.5}, that of all runs {:.5}{covered}",
            run.name, gain.value, finding.angular_gain.value
        )
    });
    let of_bias = finding.bias.map(in_degrees).filter(|all| odd(&bias, all, seconds)).map(|all| {
        format!("{}: its bias is {:.5} deg/s, that of all runs {:.5} deg/s", run.name, bias.value, all.value)
    });
    r.agrees = Some(of_gain.is_none() && of_bias.is_none());
    of_gain.into_iter().chain(of_bias).collect()
}

/// What is left of a run beside a gain and a bias of its own, rms, rad: what these move the angle by is held against it.
fn beside_its_own(run: &SensorRun, left: &[f64], rows: &[usize]) -> f64 {
    let middle = |v: &dyn Fn(usize) -> f64| rows.iter().map(|&i| v(i)).sum::<f64>() / rows.len().max(1) as f64;
    let (t, a, e) = (|i: usize| run.t_s[i], |i: usize| run.reference_rad[i], |i: usize| left[i]);
    let middles = [middle(&t), middle(&a), middle(&e)];
    let own = |i: usize| [t(i) - middles[0], a(i) - middles[1]];
    let mut equations = NormalEquations::new(2);
    rows.iter().for_each(|&i| equations.add(&own(i), e(i) - middles[2]));
    let values = equations.solve();
    let beside = |&i: &usize| e(i) - middles[2] - own(i).iter().zip(&values).map(|(x, v)| x * v).sum::<f64>();
    root_mean_square(&rows.iter().map(beside).collect::<Vec<_>>())
}

/// The angular gain with an interval that covers those of runs that contradict it, `odd` among them. Of two runs that of all lies
/// between: there it is enough that they exclude each other, which they are said to.
fn covering_all(finding: &Finding<'_>, odd: &[f64], runs: &mut [RunReport], warnings: &mut Vec<String>) -> Estimate {
    let all = finding.angular_gain;
    let mut apart = odd.to_vec();
    let told: Vec<(usize, Estimate)> =
        runs.iter().enumerate().filter_map(|(i, r)| Some((i, r.angular_gain?))).collect();
    if let [(a, of_a), (b, of_b)] = told[..]
        && odd.is_empty()
        && finding.instrument == Instrument::Gyroscope
        && finding.scale_factor.is_none()
        && (of_a.value - of_b.value).abs() > of_a.half_width() + of_b.half_width()
    {
        warnings.push(format!(
            "the angular gain of {} is {:.5} and that of {} {:.5}, which exclude each other: that of both covers them",
            runs[a].file, of_a.value, runs[b].file, of_b.value
        ));
        [a, b].into_iter().for_each(|i| runs[i].agrees = Some(false));
        apart.extend([of_a.value, of_b.value]);
    }
    let farthest = apart.iter().map(|own| (own - all.value).abs()).fold(0.0, f64::max);
    all.widened((farthest - all.half_width()).max(0.0))
}

fn curves(
    held: &[SensorRun],
    raw: Option<&Evaluation>,
    declared: &Evaluation,
    after: &Evaluation,
    period: f64,
) -> Vec<BiasCurve> {
    held.iter()
        .enumerate()
        .map(|(i, run)| {
            let s = &after.segments[i];
            let stride = (s.angle.len() / CURVE_POINTS).max(1);
            let shown: Vec<usize> = (0..s.angle.len()).step_by(stride).filter(|&k| after.kept[i][k]).collect();
            let of = |e: &Evaluation| shown.iter().map(|&k| e.segments[i].angle[k].to_degrees()).collect();
            BiasCurve {
                name: run.name.clone(),
                pattern_deg: shown.iter().map(|&k| s.direction[k].rem_euclid(period).to_degrees()).collect(),
                raw_deg: raw.map(of).unwrap_or_default(),
                declared_deg: of(declared),
                discovered_deg: of(after),
            }
        })
        .collect()
}

fn plots(
    names: &[String],
    raw: Option<&Evaluation>,
    declared: &Evaluation,
    after: &Evaluation,
    finding: &Finding<'_>,
) -> PlotData {
    plots_of(names, raw, declared, after, &finding.hypothesis)
}
