//! What is left and has no explanation: classified, sized, and with a word on what could be done.

use cvg_model::effects::{EffectId, harmonic_n};

use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::residual::{
    Along, WHITENESS_LAGS, WHITENESS_LEVEL, autocorrelation, drift_power, inflation, ljung_box, reported_harmonics,
    resolved_harmonics, strongest_harmonics, strongest_line,
};
use crate::estimation::joint_fit::Dataset;
use crate::facts::Follows;
use crate::model::hypothesis::{Hypothesis, Member, Origin};
use crate::report::{Harmonic, Heldout, ResidualReport, Unexplained};
use crate::selection::step::Step;

/// A line's power over the mean square of the residual, from which it is no accident among those that were looked at:
/// exp(−power/2) times their number is below one in a thousand.
fn accidental(power: f64, mean_square: f64, looked_at: f64, cost: f64) -> bool {
    looked_at * (-0.5 * power / (mean_square * cost)).exp() > 1e-3
}

/// Lines smaller than this share of the noise floor are not worth a word.
const SMALLEST_SHARE: f64 = 0.2;
/// A slow change of every run is a drift where it is this share of all that exceeds the noise.
const DRIFTS: f64 = 0.4;
/// The residual may exceed its white part by this factor before "other" is said.
const LARGEST_EXCESS: f64 = 1.3;
/// Harmonics of an angle against a command that are listed at most.
const MOST_HARMONICS: usize = 4;

/// What is left after all: its harmonics on the held-out samples, and whether the fitted ones remember anything.
pub(crate) fn residual_report(on_fit: &Evaluation, held_out: &Evaluation) -> ResidualReport {
    let harmonics = |of| reported_harmonics(held_out, of, held_out);
    let memory = autocorrelation(on_fit, WHITENESS_LAGS);
    ResidualReport {
        harmonics: [Follows::Pattern, Follows::Table].into_iter().flat_map(harmonics).collect(),
        white: ljung_box(&memory, on_fit.errors().count()) >= WHITENESS_LEVEL,
    }
}

/// Harmonics of the pattern that are left of an angle against a reference that was commanded, and were not corrected: the largest first.
pub(crate) fn against_a_command(residual: &ResidualReport) -> Vec<Unexplained> {
    let is_seen = |h: &&Harmonic| h.of == Follows::Pattern && h.amplitude_deg > h.ci95_deg;
    let mut seen: Vec<&Harmonic> = residual.harmonics.iter().filter(is_seen).collect();
    seen.sort_by(|a, b| b.amplitude_deg.total_cmp(&a.amplitude_deg));
    let said = |h: &Harmonic| {
        Unexplained {
        class: "pattern-harmonic".into(),
        n: Some(h.n),
        frequency_hz: None,
        rms_deg: h.amplitude_deg / std::f64::consts::SQRT_2,
        suggestion: "the sensor's or the drive's, which a commanded reference does not tell apart, and not corrected; record table_deg, \
                     or state reference = \"measured\" in campaign.toml where the rate was kept"
            .into(),
    }
    };
    seen.into_iter().take(MOST_HARMONICS).map(said).collect()
}

/// What was corrected and not explained.
pub(crate) fn described(hypothesis: &Hypothesis, steps: &[Step]) -> Vec<Unexplained> {
    let mut steps: Vec<&Step> = steps.iter().filter(|s| s.origin == Origin::Empirical).collect();
    let empirical = hypothesis.members.iter().filter(|m| m.origin == Origin::Empirical);
    empirical
        .map(|m| {
            let step = steps.iter().position(|s| s.id == m.id).map(|at| steps.remove(at));
            let removed = step.map_or(0.0, |s| {
                let [before, after] = s.heldout_rms_deg;
                (before * before - after * after).max(0.0).sqrt()
            });
            let (class, n, frequency_hz) = class(m);
            let suggestion = match step.and_then(|s| s.inconsistency.as_ref()) {
                Some(inconsistency) => format!("corrected as {}, which is not its cause: {inconsistency}", m.id),
                None => format!("corrected as {}, without a known cause", m.id),
            };
            Unexplained { class: class.into(), n, frequency_hz, rms_deg: removed, suggestion }
        })
        .collect()
}

/// Class, harmonic and frequency of an empirical correction.
fn class(m: &Member) -> (&'static str, Option<u32>, Option<f64>) {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
    let whole = |v: f64| ((v - v.round()).abs() < 1e-6).then_some(v.round() as u32);
    let by_rate = |scaling: f64| scaling > harmonic_n::scaling::CONSTANT;
    match m.id {
        EffectId::HarmonicN if by_rate(m.values[3]) => ("rate-dependent", whole(m.values[0]), None),
        EffectId::HarmonicN => ("pattern-harmonic", whole(m.values[0]), None),
        EffectId::TableHarmonic => ("table-harmonic", whole(m.values[0]), None),
        EffectId::TimePeriodic => ("time-periodic", None, Some(m.values[0])),
        EffectId::RateOffset | EffectId::ScaleDrift | EffectId::GainDrift => ("drift", None, None),
        EffectId::SpringCubic | EffectId::DetectionCubic => ("pattern-harmonic", Some(4), None),
        EffectId::DetectionSkew => ("pattern-harmonic", Some(2), None),
        EffectId::DetectionOffset => ("pattern-harmonic", Some(1), None),
        _ => ("other", None, None),
    }
}

/// What would tell where an error that follows the table comes from.
fn of_the_table(is_recorded: bool) -> &'static str {
    if is_recorded {
        "turn the instrument on the table: what is the table's stays where it is"
    } else {
        "record the table angle (table_deg), or turn the instrument on the table"
    }
}

/// What would tell where a drift comes from.
fn of_a_drift(temperature_is_recorded: bool) -> &'static str {
    if temperature_is_recorded {
        "a longer settling time, or runs at other temperatures"
    } else {
        "a longer settling time, and the temperature recorded"
    }
}

/// Lists what the residual still holds.
pub(crate) fn unexplained(
    dataset: &Dataset,
    on_fit: &Evaluation,
    dense: &Evaluation,
    heldout: &Evaluation,
    floor: f64,
) -> Vec<Unexplained> {
    let mut out = Vec::new();
    let mean_square = on_fit.mean_square();
    let count = on_fit.errors().count().max(1) as f64;
    let cost = inflation(&autocorrelation(on_fit, WHITENESS_LAGS), on_fit.errors().count());
    let rms = |power: f64| (power / count).sqrt();
    let remarkable = |power: f64, looked_at: f64| {
        !accidental(power, mean_square, looked_at, cost) && rms(power) > SMALLEST_SHARE * floor
    };
    for (of, class, suggestion) in [
        (Follows::Pattern, "pattern-harmonic", "runs at other rates and amplitudes would show how it scales"),
        (Follows::Table, "table-harmonic", of_the_table(dataset.has_table())),
    ] {
        let most = resolved_harmonics(on_fit, of, 64);
        for (n, power) in strongest_harmonics(on_fit, of, most, |_| 1.0).into_iter().take(3) {
            if remarkable(power, f64::from(most)) {
                out.push(Unexplained {
                    class: class.into(),
                    n: Some(n),
                    frequency_hz: None,
                    rms_deg: rms(power).to_degrees(),
                    suggestion: suggestion.into(),
                });
            }
        }
    }
    let worth_saying = dataset.speeds_differ() || out.is_empty();
    let least = count * (SMALLEST_SHARE * floor).powi(2);
    let line = worth_saying.then(|| strongest_line(dense, Along::Time, least)).flatten();
    if let Some((frequency, power)) = line.filter(|(_, power)| remarkable(*power, count)) {
        out.push(Unexplained {
            class: "time-periodic".into(),
            n: None,
            frequency_hz: Some(frequency),
            rms_deg: rms(power).to_degrees(),
            suggestion: "a run at another rate would show whether it keeps its frequency".into(),
        });
    }
    let drift = drift_power(on_fit);
    let excess = (mean_square - floor * floor).max(0.0) * count;
    if drift > DRIFTS * excess && rms(drift) > SMALLEST_SHARE * floor && remarkable(drift, 1.0) {
        out.retain(|u| u.class != "time-periodic");
        out.push(Unexplained {
            class: "drift".into(),
            n: None,
            frequency_hz: None,
            rms_deg: rms(drift).to_degrees(),
            suggestion: of_a_drift(dataset.has_temperature()).into(),
        });
    }
    let left = heldout.mean_square().sqrt();
    if out.is_empty() && left > LARGEST_EXCESS * floor {
        out.push(Unexplained {
            class: "other".into(),
            n: None,
            frequency_hz: None,
            rms_deg: (left * left - floor * floor).sqrt().to_degrees(),
            suggestion: "longer runs, and a steadier reference".into(),
        });
    }
    out
}

/// Held-out errors of more than this many noise floors have a cause that was not found; the blind trial's largest is 1.1.
pub(crate) const LEFT_OVER: f64 = 3.0;

/// Says that more than noise is left.
pub(crate) fn left_over(heldout: &Heldout) -> Option<String> {
    let floors = heldout.discovered.rms_deg / heldout.noise_floor_deg;
    (floors.is_finite() && floors > LEFT_OVER).then(|| {
        format!(
            "what is left on held-out data is {floors:.1} times the noise floor: an effect that nothing here explains, a \
             recording that changed on its way, or noise that wanders; what is left may be in every value as well"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_recorded_already_is_not_asked_for() {
        assert!(of_the_table(false).contains("table_deg") && !of_the_table(true).contains("record"));
        assert!(of_a_drift(false).contains("recorded") && !of_a_drift(true).contains("record"));
    }
}
