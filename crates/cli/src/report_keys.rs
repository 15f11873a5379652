//! The places of the numbers of report.json, as `--limits` names them: what is misspelt is told before anything is identified.

use cvg_calibration::report::named::{self, BESIDE_THE_LIBRARY};
use cvg_model::effects::{EffectId, Shown};

/// Every number of a report. `*` is an element of a list, by number or name; `**` whatever stands below; `~` an estimate with
/// its interval; `^` the size of an error. A name that ends in `#` has a number there.
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
    "repeatability_ppm~",
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

/// The place that a misspelt one is nearest to; of an effect that there is, one of its own.
pub(crate) fn nearest(path: &str, written: &[EffectId]) -> Option<String> {
    let whole = format!("{path}.value");
    if is_known(&whole, written) {
        return Some(whole);
    }
    let keys: Vec<&str> = path.split('.').collect();
    let of_effects = of_effects(written);
    if let ["effects", id, rest @ ..] = keys.as_slice()
        && id.parse::<usize>().is_err()
    {
        let ids = of_effects.iter().filter_map(|place| place.split('.').nth(1)).map(|known| (apart(id, known), known));
        let known =
            ids.min_by_key(|(apart, _)| *apart).filter(|(apart, _)| is_near(*apart, id)).map(|(_, known)| known);
        let own = known.map_or(String::new(), |known| format!("effects.{known}."));
        let magnitude = known.zip(rest.get(1)).and_then(|(known, name)| magnitude(known, name));
        let rest: Vec<&str> =
            rest.iter().enumerate().map(|(at, key)| magnitude.filter(|_| at == 1).unwrap_or(key)).collect();
        let rest = rest.join(".");
        let by_name = |of: &&str| of.split('.').nth(1).is_none_or(|name| name != "#" && name.parse::<usize>().is_err());
        let of_it = of_effects.iter().filter_map(|place| {
            let of = place.strip_prefix(&own).filter(by_name)?;
            Some((apart(&rest, of), place))
        });
        return of_it.min_by_key(|own| own.0).filter(|_| known.is_some()).map(|(_, place)| as_named(place, &keys));
    }
    let all = places().into_iter().filter(|place| !place.starts_with("effects.*")).chain(of_effects);
    let named = all.map(|place| as_named(&place, &keys));
    let (place, apart) =
        named.map(|place| (apart(path, &place), place)).map(|(n, place)| (place, n)).min_by_key(|p| p.1)?;
    is_near(apart, path).then_some(place)
}

/// By which name reports have a parameter that the library counts as one of a pair.
fn magnitude(effect: &str, parameter: &str) -> Option<&'static str> {
    let d = EffectId::from_id(effect)?.description();
    let at = d.parameters.iter().position(|p| p.name == parameter)?;
    d.shown.iter().find_map(|shown| match *shown {
        Shown::Polar { cos, sin, magnitude, .. } if [cos, sin].contains(&at) => Some(magnitude),
        _ => None,
    })
}

/// Whether a name is another with so many letters wrong.
fn is_near(apart: usize, name: &str) -> bool {
    (apart as f64) < NEAR * name.len() as f64
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

/// The numbers of every effect there is, by its name and those of its parameters as reports have them.
fn of_effects(written: &[EffectId]) -> Vec<String> {
    let of = |(id, names): (&str, Vec<&str>)| {
        let parameters = names.iter().flat_map(|name| ESTIMATE.map(|end| format!("parameters.{name}{end}")));
        let is_endless = names.iter().any(|name| name.ends_with('#'));
        let numbers = if is_endless { vec!["#".into()] } else { (0..names.len()).map(|at| at.to_string()).collect() };
        let by_number = numbers.iter().flat_map(|number| ESTIMATE.map(|end| format!("parameters.{number}{end}")));
        let error = ["heldout_rms_deg.before", "heldout_rms_deg.after"].map(str::to_owned);
        parameters.chain(by_number).chain(error).map(|rest| format!("effects.{id}.{rest}")).collect::<Vec<_>>()
    };
    let names = |of: &[(&'static str, &'static str)]| of.iter().map(|(name, _)| *name).collect::<Vec<_>>();
    let library = EffectId::ALL.iter().chain(written).map(|effect| effect.description());
    let library = library.map(|d| (d.id, names(&named::of_effect(d))));
    library.chain(BESIDE_THE_LIBRARY.iter().map(|e| (e.id, names(e.parameters)))).flat_map(of).collect()
}

/// Whether keys stand at a place. The name of an element may have dots in it, as a file's has.
fn fits(place: &[&str], keys: &[&str]) -> bool {
    match (place, keys) {
        ([], []) => true,
        (["**"], [_, ..]) => true,
        (["*", rest @ ..], [_, ..]) => (1..=keys.len()).any(|n| fits(rest, &keys[n..])),
        ([key, rest @ ..], [first, others @ ..]) => is_named(key, first) && fits(rest, others),
        _ => false,
    }
}

/// Whether a key is the name, or the name with a number for its `#`.
fn is_named(name: &str, key: &str) -> bool {
    let number = name.strip_suffix('#').and_then(|start| key.strip_prefix(start));
    name == key || number.is_some_and(|number| number.parse::<u32>().is_ok())
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
        match own {
            Some(own) if part.starts_with('*') || is_named(part, &own) => own,
            _ => part.replace('*', "0").replace('#', "1"),
        }
    });
    named.collect::<Vec<_>>().join(".")
}

/// How many letters have to be changed, added or taken away between two names.
pub(crate) fn apart(a: &str, b: &str) -> usize {
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
            // the name of the library, which shows the pair as a magnitude and an angle
            (
                "effects.anisodamping.parameters.anisodamping_cos2.value",
                "effects.anisodamping.parameters.anisodamping.value",
            ),
            ("effects.table-harmonic.parameters.ripple_cos.value", "effects.table-harmonic.parameters.w.value"),
            // the effect first, and then what it has
            ("effects.detection-cubik.parameters.kapa.value", "effects.detection-cubic.parameters.kappa.value"),
            ("effects.detection-cubic.value", "effects.detection-cubic.parameters.kappa.value"),
            ("effects.angle-table.parameters.cos2.value", "effects.angle-table.parameters.cos_1.value"),
        ] {
            assert!(!is_known(path, &[]), "{path}");
            assert_eq!(nearest(path, &[]).as_deref(), Some(meant));
            assert!(is_known(meant, &[]), "{meant}");
        }
        assert_eq!(nearest("the colour of the box", &[]), None);
    }

    #[test]
    fn an_element_is_named_by_its_number_or_by_a_name_with_dots() {
        for path in [
            "effects.0.parameters.0.value",
            "runs.a.b.csv.rows",
            "runs.0.tau_s.ci95.1",
            "channels.angle.rms",
            "effects.angle-table.parameters.cos_12.ci95.0",
            "effects.angle-table.parameters.23.value",
        ] {
            assert!(is_known(path, &[]), "{path}");
        }
        assert!(!is_known("effects.angle-table.parameters.cos_twelve.value", &[]));
    }
}
