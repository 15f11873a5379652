//! What is left and has no explanation: classified, sized, and with a word on what could be done.

use crate::discovery::several_rates;
use crate::evaluate::Evaluation;
use crate::identify::Bench;
use crate::report::Unexplained;
use crate::residual::{
    Follows, WHITENESS_LAGS, autocorrelation, inflation, resolved_harmonics, strongest_frequency, strongest_harmonics,
};

/// A line's power over the mean square of the residual, from which it is no accident among those that were looked at:
/// exp(−power/2) times their number is below one in a thousand.
fn accidental(power: f64, mean_square: f64, looked_at: f64, cost: f64) -> bool {
    looked_at * (-0.5 * power / (mean_square * cost)).exp() > 1e-3
}

/// Lines smaller than this share of the noise floor are not worth a word.
const SMALLEST_SHARE: f64 = 0.2;
/// The residual may exceed its white part by this factor before "other" is said.
const LARGEST_EXCESS: f64 = 1.3;

/// Lists what the residual still holds.
pub(crate) fn unexplained(
    bench: &Bench,
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
        (Follows::Table, "table-harmonic", "record the table angle (table_deg), or turn the instrument on the table"),
    ] {
        let most = resolved_harmonics(on_fit, of, 64);
        for (n, power) in strongest_harmonics(on_fit, of, most).into_iter().take(3) {
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
    let worth_saying = several_rates(bench) || out.is_empty();
    if let Some((frequency, power)) =
        strongest_frequency(dense).filter(|(_, power)| worth_saying && remarkable(*power, count))
    {
        out.push(Unexplained {
            class: "time-periodic".into(),
            n: None,
            frequency_hz: Some(frequency),
            rms_deg: rms(power).to_degrees(),
            suggestion: "a run at another rate would show whether it keeps its frequency".into(),
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
