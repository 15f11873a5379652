//! The library of effects: what its descriptions promise, and that each effect can be undone. Their signatures are in
//! `effect_signatures.rs`.

use cvg_model::effects::{EffectId, MAX_PARAMETERS, Moment, Role, Shown, Stage};
use cvg_model::{AxisForces, Envelope};
use cvg_tests::domain::{angles, envelopes, sizes};
use cvg_tests::effects::{line, values};
use cvg_tests::for_each_scalar;
use cvg_tests::scalar::{rounded, rounded_envelope, widened};
use cvg_tests::tolerances::{CUBIC_INVERSE, INVERSE};
use proptest::prelude::*;

/// Every identifier that campaigns, calibrations and reports may name.
const IDS: [&str; 32] = [
    "detection-gain-mismatch",
    "detection-phase",
    "detection-skew",
    "detection-offset",
    "detection-cubic",
    "detection-quintic",
    "detection-saturation",
    "drive-feedthrough",
    "drive-quantisation",
    "drive-saturation",
    "temperature",
    "skew-temperature",
    "scale-temperature",
    "cubic-temperature",
    "detection-offset-temperature",
    "anisodamping-temperature",
    "anisoelasticity-temperature",
    "actuation-gain-temperature",
    "actuation-skew-temperature",
    "actuation-gain-mismatch",
    "actuation-skew",
    "actuation-phase",
    "anisodamping",
    "anisoelasticity",
    "spring-cubic",
    "table-harmonic",
    "gain-drift",
    "scale-drift",
    "time-periodic",
    "angle-latency",
    "harmonic-n",
    "rate-offset",
];

#[test]
fn the_library_has_exactly_the_documented_effects() {
    let mut ids: Vec<_> = EffectId::ALL.iter().map(|e| e.description().id).collect();
    let mut documented = IDS.to_vec();
    ids.sort_unstable();
    documented.sort_unstable();
    assert_eq!(ids, documented);
}

#[test]
fn every_effect_is_found_by_its_identifier() {
    for &effect in EffectId::ALL {
        assert_eq!(EffectId::from_id(effect.description().id), Some(effect));
        assert_eq!(effect.to_string(), effect.description().id);
    }
    assert_eq!(EffectId::from_id("detection-gain"), None);
}

#[test]
fn every_parameter_has_its_own_name_a_unit_and_bounds_around_its_neutral_value() {
    let mut names = Vec::new();
    for effect in EffectId::ALL {
        let parameters = effect.description().parameters;
        assert!((1..=MAX_PARAMETERS).contains(&parameters.len()), "{effect}");
        for (n, p) in parameters.iter().enumerate() {
            assert!(!p.name.is_empty() && !p.unit.is_empty(), "{effect}");
            assert!(p.lower < p.upper, "{effect} {}", p.name);
            assert!((p.lower..=p.upper).contains(&p.neutral), "{effect} {}", p.name);
            assert!(p.scale > 0.0 && p.scale.is_finite(), "{effect} {}", p.name);
            assert!(parameters[..n].iter().all(|other| other.name != p.name), "{effect} {} twice", p.name);
            if !matches!(p.role, Role::Searched(_)) {
                assert!(!names.contains(&p.name), "{} is a parameter of two effects", p.name);
                names.push(p.name);
            }
        }
    }
}

#[test]
fn every_parameter_is_shown_once() {
    for effect in EffectId::ALL {
        let description = effect.description();
        let mut shown: Vec<usize> = Vec::new();
        for &s in description.shown {
            match s {
                Shown::Plain(n) => shown.push(n),
                Shown::Polar { cos, sin, magnitude, unit, angle, division } => {
                    shown.extend([cos, sin]);
                    assert!(!magnitude.is_empty() && !angle.is_empty() && division > 0.0, "{effect}");
                    assert_eq!(unit, description.parameters[cos].unit, "{effect}");
                    assert_eq!(unit, description.parameters[sin].unit, "{effect}");
                }
            }
        }
        shown.sort_unstable();
        assert_eq!(shown, (0..description.parameters.len()).collect::<Vec<_>>(), "{effect}");
    }
}

#[test]
fn every_description_says_what_where_and_from_whom() {
    for effect in EffectId::ALL {
        let d = effect.description();
        assert!(!d.title.is_empty() && !d.signature.is_empty() && !d.source.is_empty(), "{effect}");
        assert!(
            !(d.in_sensors && matches!(d.stage, Stage::Mechanics | Stage::Actuation)),
            "{effect}: a sensor has no loops"
        );
    }
}

#[test]
fn the_papers_model_is_the_two_mismatches_and_the_two_anisotropies() {
    let mut declared: Vec<_> =
        EffectId::ALL.iter().filter(|e| e.description().declared).map(|e| e.description().id).collect();
    declared.sort_unstable();
    assert_eq!(declared, ["actuation-gain-mismatch", "anisodamping", "anisoelasticity", "detection-gain-mismatch"]);
}

#[test]
fn what_has_no_known_cause_is_empirical() {
    let empirical: Vec<_> =
        EffectId::ALL.iter().filter(|e| e.description().empirical).map(|e| e.description().id).collect();
    assert_eq!(empirical, ["rate-offset", "harmonic-n"]);
}

#[test]
fn a_table_is_explained_in_its_low_whole_orders_only() {
    let explains = |n: f64| EffectId::TableHarmonic.description().explains(&values(&[n, 1e-3]));
    assert!((1..=8).all(|n| explains(f64::from(n))));
    assert!(![9.0, 16.0, 3.57, 0.5].into_iter().any(explains));
    assert!(!EffectId::HarmonicN.description().explains(&values(&[2.0])));
    assert!(EffectId::DetectionCubic.description().explains(&values(&[1e-3])));
}

for_each_scalar! {
    #[test]
    fn prop_a_neutral_effect_changes_nothing(
        e in envelopes(), f in envelopes(), rate in -10.0..10.0_f64, t_s in 0.0..1e3_f64, turn in angles(),
        precession in -10.0..10.0_f64, warmer in -50.0..50.0_f64,
    ) {
        let ((e, e64), (f, _)) = (rounded_envelope::<T>(&e), rounded_envelope::<T>(&f));
        let f = AxisForces { x_c: f.x_c, x_s: f.x_s, y_c: f.y_c, y_s: f.y_s };
        let precession_rad_s = rounded(precession).0;
        let at = Moment { t_s: rounded(t_s).0, table_rad: rounded(turn).0, precession_rad_s, warmer_k: rounded(warmer).0, drive: f };
        let rate = rounded::<T>(rate).0;
        for effect in EffectId::ALL {
            let neutral = effect.neutral::<T>();
            prop_assert_eq!(widened(&effect.read(&neutral, e, &at)), e64, "{}", effect);
            prop_assert_eq!(widened(&effect.unread(&neutral, e, &at)), e64, "{}", effect);
            prop_assert_eq!(effect.mechanics(&neutral, &e, &at).pendulum().e, 0.0, "{}", effect);
            prop_assert_eq!(effect.actuate(&neutral, f, &at), f, "{}", effect);
            prop_assert_eq!(effect.input_rate(&neutral, rate, &at), rate, "{}", effect);
        }
    }

    /// Before the loops have built up a vibration there is nothing to divide by, and still every effect is a number.
    #[test]
    fn prop_an_effect_of_a_resonator_at_rest_is_finite(sizes in proptest::array::uniform4(-1.0..1.0_f64)) {
        let rest = Envelope::<T>::zero();
        for effect in EffectId::ALL {
            let mut v = effect.neutral::<T>();
            for ((v, p), size) in v.iter_mut().zip(effect.description().parameters).zip(sizes) {
                *v = T::from_f64((p.neutral + p.scale * size).clamp(p.lower, p.upper));
            }
            for e in [
                effect.mechanics(&v, &rest, &Moment::default()),
                effect.read(&v, rest, &Moment::default()),
                effect.unread(&v, rest, &Moment::default()),
            ] {
                prop_assert!(widened(&e).pendulum().e.is_finite(), "{effect}: {e:?}");
            }
        }
    }

    /// Readout effects of up to ten times "small but plain to see" are undone, whatever the orbit. Harmonic numbers are
    /// whole: a broken one would tear the pattern angle at ±180°.
    #[test]
    fn prop_what_was_read_can_be_unread(
        a in 0.5..2.0_f64, theta in angles(), q in -0.2..0.2_f64, delta in -0.3..0.3_f64,
        sizes in proptest::array::uniform4(-1.0..1.0_f64), t_s in 0.0..100.0_f64, precession in -10.0..10.0_f64,
    ) {
        let orbit = cvg_model::Orbit { a, q: a * q, theta, delta };
        let (e, e64) = rounded_envelope::<T>(&orbit.envelope());
        let precession_rad_s = rounded(precession).0;
        let at = Moment { t_s: rounded(t_s).0, precession_rad_s, ..Moment::default() };
        for effect in EffectId::ALL.iter().filter(|e| e.description().stage == Stage::Readout) {
            let mut v = effect.neutral::<T>();
            for ((v, p), size) in v.iter_mut().zip(effect.description().parameters).zip(sizes) {
                let value = match p.role {
                    Role::Searched(_) => (p.neutral + (size + 1.0) * 4.0).round().max(p.lower),
                    Role::Chosen(_) => p.neutral,
                    _ => (p.neutral + 10.0 * p.scale * size).clamp(p.lower, p.upper),
                };
                *v = T::from_f64(value);
            }
            let back = widened(&effect.unread(&v, effect.read(&v, e, &at), &at));
            let off = (back - e64).pendulum().e.sqrt();
            prop_assert!(off <= T::tolerance(&INVERSE) * a, "{effect} with {v:?}: off by {off:e}");
        }
    }

    /// Up to a drive of three times the level, where the output still grows by 1.6 % of what the input does.
    #[test]
    fn prop_a_clipped_carrier_can_be_unread(a in sizes(), theta in angles(), drive in 0.0..3.0_f64) {
        let (e, e64) = rounded_envelope::<T>(&line(a, theta));
        let v = values(&[drive / a]).map(T::from_f64);
        let (at, clipped) = (Moment::default(), EffectId::DetectionSaturation);
        let back = widened(&clipped.unread(&v, clipped.read(&v, e, &at), &at));
        let off = (back - e64).pendulum().e.sqrt();
        prop_assert!(off <= 60.0 * T::tolerance(&INVERSE) * a, "off by {off:e} at a drive of {drive}");
    }

    /// Up to a cubic part of 8 % of the vibration, to rounding.
    #[test]
    fn prop_a_cubic_readout_can_be_unread(a in sizes(), theta in angles(), size in -0.08..0.08_f64) {
        let (e, e64) = rounded_envelope::<T>(&line(a, theta));
        let v = values(&[size / (0.75 * a * a), 0.0]).map(T::from_f64);
        let (at, cubic) = (Moment::default(), EffectId::DetectionCubic);
        let back = widened(&cubic.unread(&v, cubic.read(&v, e, &at), &at));
        let off = (back - e64).pendulum().e.sqrt();
        prop_assert!(off <= T::tolerance(&CUBIC_INVERSE) * a, "off by {off:e}");
    }
}

#[test]
fn snapshot_of_the_library() {
    let mut table = String::new();
    for effect in EffectId::ALL {
        let d = effect.description();
        let parameters: Vec<_> = d.parameters.iter().map(|p| format!("{} [{}]", p.name, p.unit)).collect();
        table += &format!(
            "{:24} {:9} rate^{:+} amplitude^{:+}{}  {}\n",
            d.id,
            format!("{:?}", d.stage),
            d.scaling.rate,
            d.scaling.amplitude,
            if d.scaling.odd_in_rate { " odd" } else { "    " },
            parameters.join(", ")
        );
    }
    insta::assert_snapshot!(table);
}
