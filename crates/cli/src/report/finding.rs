//! The finding in one sentence, and numbers as a person says them.

use cvg_calibration::Origin;
use cvg_calibration::report::{EffectReport, Heldout, Report, Status};
use cvg_model::effects::EffectId;

use crate::report::significant;

/// A residual within this factor of the noise is the noise.
const AT_THE_NOISE: f64 = 1.2;
/// An angle error below this is none, deg: no recording of an angle has as many digits, and no figure shows less.
pub(super) const LEAST_DEG: f64 = 1e-6;
/// What is unexplained and yet taken out begins its suggestion so.
const CORRECTED: &str = "corrected as";
/// Effects that a sentence can name.
const NAMED: usize = 3;

/// An angle with three significant digits, in the unit of its size.
pub(super) fn degrees(value: f64) -> String {
    if !value.is_finite() {
        return "—".into();
    }
    let size = value.abs();
    if size < 0.5 * LEAST_DEG {
        return "below 0.000001°".into();
    }
    let digits = if size >= 10.0 {
        1
    } else if size >= 1.0 {
        2
    } else if size >= 0.1 {
        3
    } else if size >= 0.01 {
        4
    } else if size >= 0.001 {
        5
    } else {
        6
    };
    format!("{value:.digits$}°")
}

/// Digits after the point that a value has when its deviation `half_width` keeps two digits; none for what needs an
/// exponent.
fn decimals(value: f64, half_width: f64) -> Option<usize> {
    let sound = value.is_finite() && half_width.is_finite() && half_width > 0.0 && value.abs() >= 1e-3;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "of the order of ten")]
    sound.then(|| (1.0 - half_width.log10().floor()).clamp(0.0, 12.0) as usize)
}

/// A value as sharp as it is known, with the half width of its interval.
pub(super) fn measured(value: f64, ci95: Option<[f64; 2]>) -> String {
    let half_width = ci95.map(|c| 0.5 * (c[1] - c[0]));
    match half_width.and_then(|h| Some((h, decimals(value, h)?))) {
        Some((h, digits)) => format!("{value:.digits$} ± {h:.digits$}"),
        None => significant(value),
    }
}

/// A value and the ends of its interval, as sharp as they are known.
pub(super) fn interval(value: f64, ci95: [f64; 2]) -> [String; 3] {
    let all = [value, ci95[0], ci95[1]];
    match decimals(value, 0.5 * (ci95[1] - ci95[0])) {
        Some(digits) => all.map(|v| format!("{v:.digits$}")),
        None => all.map(significant),
    }
}

/// By how much an error became less.
pub(super) fn times(before: f64, after: f64) -> String {
    let factor = before / after;
    if !factor.is_finite() {
        "no factor".into()
    } else if factor >= 10.0 {
        format!("{factor:.0} times less")
    } else {
        format!("{factor:.1} times less")
    }
}

/// What stands in the place of before and after where nothing is undone; none where something is.
pub(super) fn of_nothing(status: Status, heldout: &Heldout) -> Option<String> {
    let raw = heldout.raw.unwrap_or(heldout.declared).rms_deg;
    let noise = AT_THE_NOISE * heldout.noise_floor_deg.max(LEAST_DEG);
    (status == Status::Neutral).then(|| {
        if raw <= noise {
            format!("nothing to correct: below {} rms angle error", degrees(noise))
        } else {
            format!("{} rms angle error, which nothing that was found makes less", degrees(raw))
        }
    })
}

/// The part of the raw error that belongs to the reference and not to the device, rms, deg: it was taken out, and that makes no
/// instrument better. A line slower than the period of many pole pairs may be the eccentricity of the sensor, and is not counted.
pub(super) fn of_the_table(r: &Report) -> f64 {
    let of = |e: &EffectReport| {
        let amplitude = e.parameters.iter().find(|p| p.name == "amplitude");
        let line = amplitude.map(|p| (p.value / std::f64::consts::SQRT_2).to_degrees().powi(2));
        line.or(e.heldout_rms_deg.map(|b| (b.before * b.before - b.after * b.after).max(0.0))).unwrap_or(0.0)
    };
    let order = |e: &EffectReport| e.parameters.iter().find(|p| p.name == "n").map_or(f64::INFINITY, |p| p.value);
    let sensor = r.instrument == "sensor";
    let table = r.effects.iter().filter(|e| e.id == EffectId::TableHarmonic.description().id);
    table.filter(|e| !sensor || order(e) >= r.angular_gain.value.abs()).map(of).sum::<f64>().sqrt()
}

/// The raw error without what belongs to the table.
pub(super) fn of_the_device(r: &Report) -> f64 {
    let raw = r.heldout.raw.unwrap_or(r.heldout.declared).rms_deg;
    (raw * raw - of_the_table(r).powi(2)).max(0.0).sqrt().max(r.heldout.discovered.rms_deg)
}

/// What the campaign says of the instrument, in one sentence.
pub(super) fn finding(r: &Report) -> String {
    let mut sentence = format!("The angle error of {} ", r.device);
    let gain = |e: &EffectReport| e.heldout_rms_deg.map_or(0.0, |b| b.before - b.after);
    let mut declared: Vec<&EffectReport> = r.effects.iter().filter(|e| e.origin == Origin::Declared).collect();
    declared.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let main = declared.first().filter(|e| gain(e) > r.heldout.noise_floor_deg);
    let mut discovered: Vec<&EffectReport> = r.effects.iter().filter(|e| e.origin == Origin::Discovered).collect();
    discovered.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let is_least = |main: &EffectReport| discovered.first().is_some_and(|d| gain(d) > gain(main));
    let found: Vec<String> = discovered.iter().map(|e| name(e)).collect();
    let empirical = r.effects.iter().filter(|e| e.origin == Origin::Empirical).count();
    match (main, found.is_empty()) {
        (Some(main), true) => sentence += &format!("comes from {}; nothing undeclared was found", name(main)),
        (Some(main), false) if is_least(main) => {
            sentence += &format!("comes, beyond the declared model, from {}, and from {}", list(&found), name(main));
        }
        (Some(main), false) => {
            sentence += &format!("comes from {} and, beyond the declared model, {}", name(main), list(&found));
        }
        (None, true) => sentence += "shows no cause of the library above the noise",
        (None, false) => sentence += &format!("comes, beyond the declared model, from {}", list(&found)),
    }
    if empirical > 0 {
        let (is, of) = if empirical == 1 { ("is", "part") } else { ("are", "parts") };
        sentence += &format!("; {empirical} {of} of it {is} corrected without a known cause");
    }
    let table = of_the_table(r);
    if table > 0.0 {
        sentence += &format!("; {} rms of it are the table's, and no error of the device", degrees(table));
    }
    let rest = r.heldout.discovered.rms_deg;
    if rest <= AT_THE_NOISE * r.heldout.noise_floor_deg {
        sentence + "; what is left is the noise of the recording."
    } else if let Some(u) = r.unexplained.iter().find(|u| !u.suggestion.starts_with(CORRECTED)) {
        let n = u.n.map(|n| format!(", n = {n}")).unwrap_or_default();
        sentence + &format!("; {} rms ({}{n}) stay unexplained.", degrees(u.rms_deg), u.class)
    } else {
        sentence + "."
    }
}

fn name(e: &EffectReport) -> String {
    let title = EffectId::from_id(&e.id).map_or(e.id.as_str(), |id| id.description().title);
    let value = e.parameters.first().filter(|p| p.ci95.is_some());
    let unit = |unit: &str| if unit == "1" { String::new() } else { format!(" {unit}") };
    let value = value.map(|p| format!("{} = {}{}", p.name, measured(p.value, p.ci95), unit(&p.unit)));
    value.map_or(title.to_owned(), |v| format!("{title} ({v})"))
}

fn name_of(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

fn list(names: &[String]) -> String {
    if names.len() <= NAMED {
        return name_of(names);
    }
    format!("{} and {} more", names[..NAMED].join(", "), names.len() - NAMED)
}

#[cfg(test)]
mod tests {
    use cvg_calibration::ErrorSize;

    use super::*;

    #[test]
    fn angles_keep_three_significant_digits() {
        assert_eq!(degrees(29.63), "29.6°");
        assert_eq!(degrees(0.26789), "0.268°");
        assert_eq!(degrees(0.0011), "0.00110°");
        assert_eq!([degrees(f64::NAN), degrees(0.0), degrees(1e-6)], ["—", "below 0.000001°", "0.000001°"]);
    }

    #[test]
    fn a_value_is_as_sharp_as_it_is_known() {
        assert_eq!(measured(1.0131963, Some([1.0131924, 1.0132002])), "1.0131963 ± 0.0000039");
        assert_eq!(measured(27.01908, Some([26.982494, 27.055666])), "27.019 ± 0.037");
        assert_eq!(measured(180.0, Some([100.0, 260.0])), "180 ± 80");
        assert_eq!(measured(3.0, None), "3");
        assert_eq!(interval(27.01908, [26.982494, 27.055666]), ["27.019", "26.982", "27.056"]);
        assert_eq!(interval(2.5e-6, [2.4e-6, 2.6e-6])[0], "2.50000e-6");
    }

    #[test]
    fn factors_are_as_sharp_as_they_are_known() {
        assert_eq!(times(0.27, 0.0011), "245 times less");
        assert_eq!(times(0.3, 0.1), "3.0 times less");
        assert_eq!(times(0.3, 0.0), "no factor");
    }

    #[test]
    fn where_nothing_is_undone_the_headline_has_no_before_and_after() {
        let of = |raw: f64, noise_floor_deg: f64| {
            let size = |rms_deg| ErrorSize { rms_deg, peak_deg: rms_deg, peak_to_peak_deg: rms_deg };
            Heldout { raw: Some(size(raw)), declared: size(raw), discovered: size(raw), noise_floor_deg }
        };
        let said = |raw, floor| of_nothing(Status::Neutral, &of(raw, floor)).unwrap_or_default();
        assert_eq!(said(1e-15, 1e-15), "nothing to correct: below 0.000001° rms angle error");
        assert_eq!(said(0.011, 0.01), "nothing to correct: below 0.0120° rms angle error");
        assert_eq!(said(3.0, 0.01), "3.00° rms angle error, which nothing that was found makes less");
        assert_eq!(of_nothing(Status::Answered, &of(3.0, 0.01)), None);
    }

    #[test]
    fn a_long_list_is_cut() {
        let names: Vec<String> = ["a", "b", "c", "d"].map(str::to_owned).to_vec();
        assert_eq!(list(&names[..1]), "a");
        assert_eq!(list(&names[..3]), "a, b and c");
        assert_eq!(list(&names), "a, b, c and 1 more");
    }
}
