//! The finding in one sentence, and numbers as a person says them.

use cvg_calibration::Origin;
use cvg_calibration::report::{EffectReport, Report};
use cvg_model::effects::EffectId;

/// A residual within this factor of the noise is the noise.
const AT_THE_NOISE: f64 = 1.2;
/// Effects that a sentence can name.
const NAMED: usize = 3;

/// An angle with three significant digits, in the unit of its size.
pub(super) fn degrees(value: f64) -> String {
    if !value.is_finite() {
        return "—".into();
    }
    let size = value.abs();
    let digits = if size >= 0.1 {
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

/// What the campaign says of the instrument, in one sentence.
pub(super) fn finding(r: &Report) -> String {
    let mut sentence = format!("The angle error of {} ", r.device);
    let gain = |e: &EffectReport| e.heldout_rms_deg.map_or(0.0, |b| b.before - b.after);
    let mut declared: Vec<&EffectReport> = r.effects.iter().filter(|e| e.origin == Origin::Declared).collect();
    declared.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    let main = declared.first().filter(|e| gain(e) > r.heldout.noise_floor_deg).map(|e| name(e));
    let found: Vec<String> = r.effects.iter().filter(|e| e.origin == Origin::Discovered).map(name).collect();
    let empirical = r.effects.iter().filter(|e| e.origin == Origin::Empirical).count();
    match (main, found.is_empty()) {
        (Some(main), true) => sentence += &format!("comes from {main}; nothing undeclared was found"),
        (Some(main), false) => {
            sentence += &format!("comes from {main} and, beyond the declared model, {}", list(&found));
        }
        (None, true) => sentence += "shows no cause of the library above the noise",
        (None, false) => sentence += &format!("comes, beyond the declared model, from {}", list(&found)),
    }
    if empirical > 0 {
        sentence += &format!("; {empirical} harmonic{} without a known cause", if empirical == 1 { "" } else { "s" });
        sentence += if empirical == 1 { " is described" } else { " are described" };
    }
    let rest = r.heldout.discovered.rms_deg;
    if r.unexplained.is_empty() && rest <= AT_THE_NOISE * r.heldout.noise_floor_deg {
        sentence + "; what is left is the noise of the recording."
    } else if let Some(u) = r.unexplained.first() {
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
    let value = value.map(|p| format!("{} = {}{}", p.name, super::commands::significant(p.value), unit(&p.unit)));
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
    use super::*;

    #[test]
    fn angles_keep_three_significant_digits() {
        assert_eq!(degrees(0.26789), "0.268°");
        assert_eq!(degrees(0.0011), "0.00110°");
        assert_eq!(degrees(f64::NAN), "—");
    }

    #[test]
    fn factors_are_as_sharp_as_they_are_known() {
        assert_eq!(times(0.27, 0.0011), "245 times less");
        assert_eq!(times(0.3, 0.1), "3.0 times less");
        assert_eq!(times(0.3, 0.0), "no factor");
    }

    #[test]
    fn a_long_list_is_cut() {
        let names: Vec<String> = ["a", "b", "c", "d"].map(str::to_owned).to_vec();
        assert_eq!(list(&names[..1]), "a");
        assert_eq!(list(&names[..3]), "a, b and c");
        assert_eq!(list(&names), "a, b, c and 1 more");
    }
}
