//! The gate that every number passes before it leaves the program: finite, possible, counted on enough samples. What does
//! not pass is no answer, and its reason is said.

use cvg_model::effects::{EffectId, Role as ParameterRole};

use crate::data::sampling::LARGEST_GAIN;
use crate::error::Refusal;
use crate::model::hypothesis::{Member, Origin};
use crate::recording::Instrument;
use crate::report::calibration::Calibration;
use crate::report::{EffectReport, Estimate, Report};

/// A held-out error is counted on at least this many samples: the stations of a sensor are measurements of their own.
pub(crate) fn least_held_out(instrument: Instrument) -> usize {
    match instrument {
        Instrument::Gyroscope => 16,
        Instrument::Sensor => 4,
    }
}

/// An error beyond this share of the angle's period is no error of an angle that is followed.
const LARGEST_ERROR: f64 = 0.1;
/// The smallest angular gain of a resonator: modes of high order are carried along least.
const SMALLEST_GAIN: f64 = 0.01;
/// An angular gain that is known no better than to this share of itself is not told.
const WIDEST_GAIN: f64 = 0.2;
/// Gains of gyroscopes that are built: what a unit would have to bring the gain to.
const USUAL_GAIN: std::ops::RangeInclusive<f64> = 0.2..=LARGEST_GAIN;

/// What the gate is told beside the report.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facts {
    pub(crate) instrument: Instrument,
    pub(crate) period_deg: f64,
    /// the runs can tell the angular gain; where none turns, there is nothing to judge
    pub(crate) tells_gain: bool,
    /// the angular gain that the campaign states
    pub(crate) stated: Option<f64>,
    /// held-out samples that errors were counted on
    pub(crate) held_out: usize,
    /// error of the fitted samples, deg rms
    pub(crate) fitted_rms_deg: f64,
}

/// Whether an identification may leave the program.
///
/// # Errors
/// [`Refusal`] without an answer, with what is wrong and what would help.
pub(crate) fn pass(report: &Report, calibration: &Calibration, facts: Facts) -> Result<(), Refusal> {
    let refuse = |problem: String, wanted: &str| Err(Refusal::no_answer(&report.device, problem, wanted));
    if facts.held_out < least_held_out(facts.instrument) {
        return refuse(
            format!("only {} samples are left to measure an error on that nothing was fitted to", facts.held_out),
            "a longer run, or one with use = \"holdout\"",
        );
    }
    finite(report, facts)?;
    if facts.tells_gain {
        angular_gain(report, facts)?;
    }
    let errors = [report.heldout.discovered.rms_deg, facts.fitted_rms_deg];
    if let Some(rms) = errors.into_iter().find(|rms| *rms > LARGEST_ERROR * facts.period_deg) {
        return refuse(
            format!("the angle is not followed: the model is off by {rms:.0}°"),
            "rate_dps or table_deg, and the signs and scales of the channels, as the campaign says",
        );
    }
    if let Some(what) = report.effects.iter().find_map(undetermined) {
        return refuse(
            format!("{what}, and nothing that is possible is left out: the runs do not tell it"),
            "runs at other rates and in both directions, or longer ones",
        );
    }
    if let Some(what) = calibration.hypothesis.members.iter().find_map(at_its_limit) {
        return refuse(
            format!("{what} is at its limit: what is fitted is not what was recorded"),
            "channels in volts, X and Y in their places, an angle that follows the input",
        );
    }
    let text = calibration.to_text();
    if let Err(why) = Calibration::from_text(&text, "the calibration") {
        return refuse(format!("what was found is no calibration: {why}"), "other runs");
    }
    Ok(())
}

/// Whether every number of a report is one, whether something is undone or nothing.
///
/// # Errors
/// [`Refusal`] without an answer, with what is none.
pub(crate) fn finite(report: &Report, facts: Facts) -> Result<(), Refusal> {
    unreal(report, facts).map_or(Ok(()), |what| {
        let problem = format!("the fit of {what} did not converge to a number");
        Err(Refusal::no_answer(&report.device, problem, "other runs, or fewer of them at once"))
    })
}

/// The first number of a report that is none.
fn unreal(report: &Report, facts: Facts) -> Option<String> {
    let whole = |e: &Estimate| e.value.is_finite() && e.ci95.iter().all(|v| v.is_finite()) && e.ci95[0] <= e.ci95[1];
    let named = [
        ("angular_gain", facts.tells_gain.then_some(report.angular_gain)),
        ("detection_gain_ratio", report.detection_gain_ratio),
        ("actuation_gain_ratio", report.actuation_gain_ratio),
    ];
    if let Some((name, _)) = named.into_iter().find(|(_, e)| e.is_some_and(|e| !whole(&e))) {
        return Some(name.into());
    }
    let h = &report.heldout;
    let errors = [h.raw.unwrap_or_default(), h.declared, h.discovered];
    if !errors.iter().all(|e| e.rms_deg.is_finite() && e.peak_deg.is_finite()) || !h.noise_floor_deg.is_finite() {
        return Some("heldout".into());
    }
    report.effects.iter().find_map(|e| {
        let sound = |v: &f64| v.is_finite();
        let of = e.parameters.iter().find(|p| !sound(&p.value) || p.ci95.is_some_and(|c| !c.iter().all(sound)))?;
        Some(format!("{} of {}", of.name, e.id))
    })
}

/// An angular gain is known well enough to be one.
pub(crate) fn gain_is_told(k: &Estimate) -> bool {
    k.half_width() <= WIDEST_GAIN * k.value.abs()
}

/// An angular gain is told, and one that the instrument can have.
fn angular_gain(report: &Report, facts: Facts) -> Result<(), Refusal> {
    let k = report.angular_gain;
    if !gain_is_told(&k) {
        return Err(Refusal::no_answer(
            &report.device,
            format!("the angular gain is not identifiable: {:.4} ± {:.1e}", k.value, k.half_width()),
            "runs at other rates and in both directions, or faster ones",
        ));
    }
    let possible = match facts.stated {
        Some(stated) => (0.5..2.0).contains(&(k.value / stated).abs()),
        None => facts.instrument == Instrument::Sensor || (SMALLEST_GAIN..=LARGEST_GAIN).contains(&k.value.abs()),
    };
    if possible {
        return Ok(());
    }
    let suggestion = unit(k.value, facts.stated).unwrap_or("rates in deg/s, angles in deg and times in s").to_owned();
    let problem = facts.stated.map_or_else(
        || format!("an angular gain of {} is none that a gyroscope can have", plain(k.value)),
        |stated| format!("the angular gain is {}, and the campaign states {stated}", plain(k.value)),
    );
    Err(Refusal::no_answer(&report.device, problem, suggestion))
}

/// What to say of an angular gain that is possible and not usual, where none is stated.
pub(crate) fn unusual_gain(k: f64, stated: Option<f64>, instrument: Instrument) -> Option<String> {
    let usual = stated.is_some() || instrument == Instrument::Sensor || USUAL_GAIN.contains(&k.abs());
    (!usual).then(|| {
        let unit = unit(k, None).map_or(String::new(), |unit| format!("; if it is not this device's, {unit}"));
        format!(
            "an angular gain of {} is unusual: angular_gain in [campaign] would say that it is meant{unit}",
            plain(k)
        )
    })
}

/// A number with five digits, without a power of ten where it is near one.
fn plain(value: f64) -> String {
    if (1e-3..1e5).contains(&value.abs()) { format!("{value:.4}") } else { format!("{value:.4e}") }
}

/// The unit in which rates, angles or times would have to be for a gain to be possible.
pub(crate) fn unit(k: f64, stated: Option<f64>) -> Option<&'static str> {
    const UNITS: [(f64, &str); 9] = [
        (
            1.0 / 57.295_78,
            "theta_deg in deg: it looks as if in rad (theta_deg = \"…*57.29578\" in [columns], or by --map)",
        ),
        (
            57.295_78,
            "rate_dps in deg/s: it looks as if in rad/s (rate_dps = \"…*57.29578\" in [columns], or by --map), or table_deg in rad",
        ),
        (
            6.0,
            "rate_dps in deg/s: it looks as if in revolutions per minute (rate_dps = \"…*6\" in [columns], or by --map)",
        ),
        (360.0, "rate_dps in deg/s: it looks as if in revolutions per second (rate_dps = \"…*360\")"),
        (1e-3, "t_s in s: it looks as if in ms (t_s = \"…*0.001\" in [columns], or by --map), or rate_dps in mdeg/s"),
        (1e-6, "t_s in s: it looks as if in µs (t_s = \"…*0.000001\" in [columns], or by --map)"),
        (1.0 / 3600.0, "rate_dps in deg/s: it looks as if in deg/h"),
        (0.1, "rate_dps in deg/s: it looks as if ten times as large (rate_dps = \"…/10\" in [columns], or by --map)"),
        (10.0, "rate_dps in deg/s: it looks as if a tenth of it (rate_dps = \"…*10\" in [columns], or by --map)"),
    ];
    let usual = |k: f64| stated.map_or(USUAL_GAIN.contains(&k.abs()), |s| ((k / s).abs() - 1.0).abs() < 0.2);
    UNITS.iter().find(|(factor, _)| usual(k / factor)).map(|(_, what)| *what)
}

/// A parameter of an effect that the data brought in, with an interval wider than all that the parameter can be. What is in
/// volts goes with the amplitude, and may be in counts.
fn undetermined(effect: &EffectReport) -> Option<String> {
    let description = EffectId::from_id(&effect.id).filter(|_| effect.origin != Origin::Declared)?.description();
    effect.parameters.iter().find_map(|found| {
        let parameter = description.parameters.iter().find(|p| p.name == found.name && p.unit == found.unit)?;
        if parameter.unit.contains('V') {
            return None;
        }
        let [low, high] = found.ci95?;
        (high - low > 2.0 * (parameter.upper - parameter.lower)).then(|| {
            format!("{} of {} is {:.4} ± {:.1e} {}", found.name, effect.id, found.value, 0.5 * (high - low), found.unit)
        })
    })
}

/// A fitted parameter at a bound that is not its neutral value.
fn at_its_limit(member: &Member) -> Option<String> {
    let neutral = member.id.neutral::<f64>();
    let parameters = member.id.description().parameters.iter().zip(member.values).zip(neutral);
    #[allow(clippy::float_cmp, reason = "a bound is reached exactly")]
    parameters
        // what was chosen from a list is where the list has it
        .filter(|((p, _), _)| matches!(p.role, ParameterRole::Fitted | ParameterRole::Refined))
        .find(|((p, value), neutral)| value != neutral && (*value == p.lower || *value == p.upper))
        .map(|((p, _), _)| format!("{} of {}", p.name, member.id))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::report::ParameterReport;

    #[test]
    fn a_gain_of_a_tenth_that_nobody_stated_is_said_with_the_unit_that_would_make_it_usual() {
        let said = |k, stated, instrument| unusual_gain(k, stated, instrument);
        assert!(said(0.078, None, Instrument::Gyroscope).is_some_and(|w| w.contains("ten times as large")));
        assert_eq!(said(0.078, Some(0.08), Instrument::Gyroscope), None);
        assert_eq!(said(0.78, None, Instrument::Gyroscope), None);
        assert_eq!(said(0.078, None, Instrument::Sensor), None);
    }

    #[test]
    fn an_effect_of_which_nothing_possible_is_left_out_is_not_told() {
        let late = |origin, half: f64| EffectReport {
            id: "angle-latency".into(),
            origin,
            parameters: vec![ParameterReport {
                name: "latency".into(),
                unit: "s".into(),
                value: -0.0025,
                ci95: Some([-0.0025 - half, -0.0025 + half]),
            }],
            heldout_rms_deg: None,
            evidence: String::new(),
            confounded_with: Vec::new(),
            separated_by: None,
        };
        let said = undetermined(&late(Origin::Discovered, 209_217.0)).unwrap();
        assert!(said.starts_with("latency of angle-latency is -0.0025 ± 2.1e5 s"), "{said}");
        assert_eq!(undetermined(&late(Origin::Discovered, 1e-4)), None);
    }
}
