//! What a person at a terminal wants to read first.

use std::fmt::Write as _;

use cvg_calibration::Identification;
use cvg_calibration::report::{Estimate, Report};

use super::further::{Number, further};
use super::numbers::{NOT_IDENTIFIABLE, Shown, estimated};
use super::tables::{has_pattern, is_rate_gyroscope};

/// The held-out error, what was found with its intervals, what is left, and the warnings.
pub(crate) fn summary(identified: &Identification) -> String {
    let r = &identified.report;
    let mut s = String::new();
    let mut line = |text: String| {
        let _ = writeln!(s, "{text}");
    };
    line(format!("{} ({})", r.device, r.instrument));
    let raw = r.heldout.raw.map_or("raw angle does not turn".to_owned(), |e| format!("raw {:.5}°", e.rms_deg));
    line(format!(
        "  held-out angle error, rms   {raw} → declared {:.5}° → discovered {:.5}°   (noise floor {:.5}°)",
        r.heldout.declared.rms_deg, r.heldout.discovered.rms_deg, r.heldout.noise_floor_deg
    ));
    for (name, said) in gains(identified) {
        line(format!("  {name:<27} {said}"));
    }
    for e in &r.effects {
        let parameters: Vec<String> = e.parameters.iter().map(|p| Shown::of(e, p).in_words()).collect();
        let origin = format!("{:?}", e.origin).to_lowercase();
        line(format!("  {:<11} {:<26} {}", origin, e.id, parameters.join(", ")));
    }
    for u in &r.unexplained {
        let n = u.n.map(|n| format!(" n = {n}")).unwrap_or_default();
        let f = u.frequency_hz.map(|f| format!(" {f:.4} Hz")).unwrap_or_default();
        line(format!("  unexplained {}{n}{f}: {:.5}° rms; {}", u.class, u.rms_deg, u.suggestion));
    }
    for Number { name, value, unit } in further(r) {
        line(format!("  {name:<27} {} {unit}", estimated(&value)));
    }
    for (name, said) in over_temperature(identified) {
        line(format!("  {name:<27} {said}"));
    }
    for w in &r.warnings {
        line(format!("  warning: {w}"));
    }
    s
}

/// How what runs tell goes with their temperatures, and why that is not told.
fn over_temperature(identified: &Identification) -> Vec<(&'static str, String)> {
    let r: &Report = &identified.report;
    let Some(t) = &r.temperature else { return Vec::new() };
    // beside |k|, how that goes
    let falls = is_rate_gyroscope(identified) && r.angular_gain.value < 0.0;
    let of_the_gain = t.angular_gain_per_k.map(|e| if falls { turned(&e) } else { e });
    let slopes = [
        ("gain over temperature", of_the_gain, "1/K"),
        ("bias over temperature", t.bias_dps_per_k, "deg/s/K"),
        ("gain of Y over X, over temp.", t.detection_gain_ratio_per_k, "1/K"),
    ];
    let told =
        slopes.into_iter().filter_map(|(name, slope, unit)| Some((name, format!("{} {unit}", estimated(&slope?)))));
    told.chain(t.reason.iter().map(|why| ("over temperature", why.clone()))).collect()
}

/// With the other sign.
fn turned(e: &Estimate) -> Estimate {
    Estimate { value: -e.value, ci95: [-e.ci95[1], -e.ci95[0]] }
}

/// The gains that an instrument of this kind has, by the names that they have there.
fn gains(identified: &Identification) -> Vec<(&'static str, String)> {
    let r: &Report = &identified.report;
    let or_not =
        |e: Option<Estimate>| e.filter(Estimate::is_told).map_or(NOT_IDENTIFIABLE.to_owned(), |e| estimated(&e));
    let k = r.angular_gain;
    let sense = identified.calibration.hypothesis.sense();
    if is_rate_gyroscope(identified) {
        let size = if k.value < 0.0 { turned(&k) } else { k };
        let scale = or_not(Some(k).filter(Estimate::is_told).map(|_| size));
        return vec![("scale factor |k|", format!("{scale}, counting {}", with_or_against(sense * k.value)))];
    }
    if has_pattern(identified) {
        return vec![
            ("angular gain k", or_not(Some(k))),
            ("detection gain G_Dy/G_Dx", or_not(r.detection_gain_ratio)),
            ("actuation gain G_Ax/G_Ay", or_not(r.actuation_gain_ratio)),
        ];
    }
    let periods = if k.value == k.value.trunc() { pole_pairs(k.value, sense) } else { or_not(Some(k)) };
    vec![("periods a turn", periods), ("gain of Y over X", or_not(r.detection_gain_ratio))]
}

fn with_or_against(gain: f64) -> &'static str {
    if gain > 0.0 { "with the reference" } else { "against the reference" }
}

/// A whole number of periods a turn, as who built the sensor calls it. By Equation 1 a positive k counts against the turn; k has
/// the sign that the campaign states, and `sense` is what was seen: −1 as in Equation 1.
fn pole_pairs(k: f64, sense: f64) -> String {
    let reversed = if sense * k > 0.0 { "" } else { "reversed: " };
    let pairs = if k.abs() == 1.0 { "1 period a turn".to_owned() } else { format!("{} pole pairs", k.abs()) };
    format!("{k}: {pairs}, counting {reversed}{}", with_or_against(sense * k))
}
