//! The places of the numbers of report.json, as `--limits` names them: what is misspelt is told before anything is identified.

use cvg_model::effects::EffectId;

/// Every number of a report. `*` is an element of a list, by number or name; `**` whatever stands below; `~` an estimate with
/// its interval; `^` the size of an error.
const NUMBERS: &[&str] = &[
    "angular_gain~",
    "detection_gain_ratio~",
    "actuation_gain_ratio~",
    "heldout.raw^",
    "heldout.declared^",
    "heldout.discovered^",
    "heldout.noise_floor_deg",
    "radius.before.rms",
    "radius.before.peak",
    "radius.after.rms",
    "radius.after.peak",
    "radius.correction_rms_deg",
    "radius.largest_gap_deg",
    "effects.*.parameters.*~",
    "effects.angle-table.parameters.*~",
    "effects.detection-clip.parameters.*~",
    "effects.*.heldout_rms_deg.before",
    "effects.*.heldout_rms_deg.after",
    "steps.*.heldout^",
    "steps.*.gain",
    "steps.*.energy_balance.*",
    "steps.*.rivals.*.beaten_by",
    "steps.*.harmonics.**",
    "residual.harmonics.**",
    "channels.*.rms",
    "channels.*.band99",
    "channels.*.drift_rms",
    "channels.*.line.frequency_hz",
    "channels.*.line.rms",
    "channels.*.autocorrelation.*",
    "channels.*.harmonics.**",
    "unexplained.*.n",
    "unexplained.*.frequency_hz",
    "unexplained.*.rms_deg",
    "runs.*.rows",
    "runs.*.rate_dps",
    "runs.*.spikes",
    "runs.*.tau_s~",
    "runs.*.angular_gain~",
    "runs.*.bias_dps~",
    "runs.*.rms_deg",
    "runs.*.temp_c",
    "runs.*.detection_gain_ratio",
    "decomposition.*.share",
    "decomposition.*.ci95.*",
    "proposals.**",
    "scale_factor.nonlinearity_ppm~",
    "scale_factor.asymmetry_ppm~",
    "misalignment.*.angle_deg~",
    "allan.angle_random_walk_deg_sqrt_h~",
    "allan.angle_random_walk_tau_s",
    "allan.bias_instability_dph~",
    "allan.bias_instability_tau_s",
    "allan.interval_s",
    "allan.points.*.tau_s",
    "allan.points.*.deviation_dph",
    "allan.points.*.ci95.*",
    "temperature.runs",
    "temperature.range_c.*",
    "temperature.angular_gain_per_k~",
    "temperature.bias_dps_per_k~",
    "temperature.detection_gain_ratio_per_k~",
    "decay.damping_per_s~",
    "decay.tau_s~",
    "decay.precession_dph~",
    "decay.precession_dph_declared~",
    "decay.carrier_hz",
    "decay.frequency_per_energy~",
    "decay.rms_deg.*",
    "virtual_precession.seconds.*",
    "virtual_precession.bias_deg",
    "virtual_precession.parameters.*~",
    "virtual_precession.heldout.*.rms_rad",
    "virtual_precession.heldout.*.noise_rad",
    "virtual_precession.heldout.*.cycles",
];
const ESTIMATE: [&str; 2] = [".value", ".ci95.*"];
const SIZE: [&str; 3] = [".rms_deg", ".peak_deg", ".peak_to_peak_deg"];
/// A name this share of whose letters differ is another one.
const NEAR: f64 = 0.34;

/// Whether a report may have a number at this place, keys joined by dots; `written` are effects beside those of the library.
pub(crate) fn is_known(path: &str, written: &[EffectId]) -> bool {
    let keys: Vec<&str> = path.split('.').collect();
    let fits = |place: &String| fits(&place.split('.').collect::<Vec<_>>(), &keys);
    let by_number = keys.get(1).is_some_and(|element| element.parse::<usize>().is_ok());
    let all = places().into_iter().filter(|place| by_number || !place.starts_with("effects.*"));
    all.chain(of_effects(written)).any(|place| fits(&place))
}

/// The place that a misspelt one is nearest to.
pub(crate) fn nearest(path: &str, written: &[EffectId]) -> Option<String> {
    let whole = format!("{path}.value");
    if is_known(&whole, written) {
        return Some(whole);
    }
    let keys: Vec<&str> = path.split('.').collect();
    let all = places().into_iter().filter(|place| !place.starts_with("effects.*")).chain(of_effects(written));
    let named = all.map(|place| as_named(&place, &keys));
    let (place, apart) =
        named.map(|place| (apart(path, &place), place)).map(|(n, place)| (place, n)).min_by_key(|p| p.1)?;
    ((apart as f64) < NEAR * path.len() as f64).then_some(place)
}

fn places() -> Vec<String> {
    let with = |place: &str, ends: &[&str]| ends.iter().map(|end| format!("{place}{end}")).collect::<Vec<_>>();
    NUMBERS
        .iter()
        .flat_map(|place| match (place.strip_suffix('~'), place.strip_suffix('^')) {
            (Some(place), _) => with(place, &ESTIMATE),
            (_, Some(place)) => with(place, &SIZE),
            _ => vec![(*place).to_owned()],
        })
        .collect()
}

/// The numbers of every effect there is, by its name and those of its parameters.
fn of_effects(written: &[EffectId]) -> Vec<String> {
    let of = |effect: &EffectId| {
        let d = effect.description();
        let parameters = d.parameters.iter().flat_map(|p| ESTIMATE.map(|end| format!("parameters.{}{end}", p.name)));
        let by_number =
            ESTIMATE.iter().flat_map(|end| (0..d.parameters.len()).map(move |i| format!("parameters.{i}{end}")));
        let error = ["heldout_rms_deg.before", "heldout_rms_deg.after"].map(str::to_owned);
        parameters.chain(by_number).chain(error).map(|rest| format!("effects.{}.{rest}", d.id)).collect::<Vec<_>>()
    };
    EffectId::ALL.iter().chain(written).flat_map(of).collect()
}

/// Whether keys stand at a place. The name of an element may have dots in it, as a file's has.
fn fits(place: &[&str], keys: &[&str]) -> bool {
    match (place, keys) {
        ([], []) => true,
        (["**"], [_, ..]) => true,
        (["*", rest @ ..], [_, ..]) => (1..=keys.len()).any(|n| fits(rest, &keys[n..])),
        ([key, rest @ ..], [first, others @ ..]) => key == first && fits(rest, others),
        _ => false,
    }
}

/// A place with the elements that the keys name.
fn as_named(place: &str, keys: &[&str]) -> String {
    let parts: Vec<&str> = place.split('.').collect();
    let more = keys.len().saturating_sub(parts.len());
    let mut at = 0;
    let named = parts.iter().map(|part| {
        let taken = if *part == "*" && at == 1 { 1 + more } else { 1 };
        let own = keys.get(at..(at + taken).min(keys.len())).filter(|own| !own.is_empty()).map(|own| own.join("."));
        at += taken;
        if part.starts_with('*') { own.unwrap_or_else(|| "0".into()) } else { (*part).to_owned() }
    });
    named.collect::<Vec<_>>().join(".")
}

/// How many letters have to be changed, added or taken away between two names.
fn apart(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut next = vec![i + 1];
        for (j, other) in b.iter().enumerate() {
            next.push((last[j] + usize::from(letter != *other)).min(last[j + 1] + 1).min(next[j] + 1));
        }
        last = next;
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_misspelt_is_told_with_the_name_that_was_meant() {
        for (path, meant) in [
            ("heldout.discoverd.rms_deg", "heldout.discovered.rms_deg"),
            ("detection_gain_ratio.valu", "detection_gain_ratio.value"),
            ("effects.detection-ofset.parameters.offset_x.value", "effects.detection-offset.parameters.offset_x.value"),
            ("effects.detection-cubic.parameters.kapa.value", "effects.detection-cubic.parameters.kappa.value"),
            ("scale_factor.nonlinearity_ppm.vale", "scale_factor.nonlinearity_ppm.value"),
            ("runs.rot+500.csv.spike", "runs.rot+500.csv.spikes"),
            ("runs.hall-0.0003_0.csv.angular_gain", "runs.hall-0.0003_0.csv.angular_gain.value"),
            ("allan.bias_instability.value", "allan.bias_instability_dph.value"),
        ] {
            assert!(!is_known(path, &[]), "{path}");
            assert_eq!(nearest(path, &[]).as_deref(), Some(meant));
            assert!(is_known(meant, &[]), "{meant}");
        }
        assert_eq!(nearest("the colour of the box", &[]), None);
    }

    #[test]
    fn an_element_is_named_by_its_number_or_by_a_name_with_dots() {
        for path in ["effects.0.parameters.0.value", "runs.a.b.csv.rows", "runs.0.tau_s.ci95.1", "channels.angle.rms"] {
            assert!(is_known(path, &[]), "{path}");
        }
    }
}
