//! The finding in one sentence.

use cvg_calibration::Origin;
use cvg_calibration::report::{EffectReport, Heldout, Report, Status};
use cvg_model::effects::EffectId;

use super::numbers::{LEAST_DEG, Shown, degrees};

/// A residual within this factor of the noise is the noise.
const AT_THE_NOISE: f64 = 1.2;
/// What is unexplained and yet taken out begins its suggestion so.
const CORRECTED: &str = "corrected as";
/// Effects that a sentence can name.
const NAMED: usize = 3;

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
    let value = value.map(|p| Shown::of(e, p).in_words());
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
