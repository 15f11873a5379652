#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use cvg_model::effects::{EffectId, MAX_PARAMETERS, Moment, Role, Search, Stage, Values};
use cvg_model::{AxisForces, Envelope};

use super::export::export;
use super::{EffectText, probes};
use crate::model::jet::{Jet, LANES};

/// An effect of the library, and the same as the text that it wrote of itself.
fn twins(id: EffectId) -> (EffectId, EffectId) {
    let mut text = export(id).unwrap();
    text.id = format!("my-{}", text.id);
    let again = EffectText::parse(&text.to_text(), "export").unwrap();
    assert_eq!(again, text);
    let source = "export";
    (id, EffectId::Written(super::admitted(&text, text.compiled().unwrap(), source)))
}

/// What an effect makes of a sample, all numbers of its stage, with slopes against its parameters and, in the last lane, time.
fn outputs(id: EffectId, p: &Values<f64>, e: &Envelope<f64>) -> Vec<Jet> {
    let count = id.description().parameters.len();
    let p: Values<Jet> = std::array::from_fn(|i| if i < count { Jet::unknown(p[i], i) } else { Jet::constant(p[i]) });
    let fixed = Jet::constant;
    let drive = AxisForces { x_c: 0.2, x_s: 0.1, y_c: -0.3, y_s: 0.05 };
    let at = Moment { t_s: 3.0, table_rad: 1.2, precession_rad_s: -6.8, warmer_k: 4.0, drive }.map(fixed);
    let e = Envelope::new(fixed(e.x_c), fixed(e.x_s), fixed(e.y_c), fixed(e.y_s));
    let four = |e: Envelope<Jet>| vec![e.x_c, e.x_s, e.y_c, e.y_s];
    match id.description().stage {
        Stage::Input => vec![id.input_rate(&p, fixed(4.0), &at)],
        Stage::Mechanics => four(id.mechanics(&p, &e, &at)),
        Stage::Actuation => {
            let f = id.actuate(&p, AxisForces { x_c: e.x_c, x_s: e.x_s, y_c: e.y_c, y_s: e.y_s }, &at);
            vec![f.x_c, f.x_s, f.y_c, f.y_s]
        }
        Stage::Readout => [four(id.read(&p, e, &at)), four(id.unread(&p, e, &at))].concat(),
    }
}

/// Values of an effect at which it shows: searched ones and each choice in turn.
fn shown(id: EffectId) -> Vec<Values<f64>> {
    let parameters = id.description().parameters;
    let choices = parameters.iter().find_map(|p| match p.role {
        Role::Chosen(choices) => Some(choices.to_vec()),
        _ => None,
    });
    choices
        .unwrap_or_else(|| vec![0.0])
        .into_iter()
        .map(|choice| {
            std::array::from_fn(|i| {
                parameters.get(i).map_or(0.0, |p| match p.role {
                    Role::Chosen(_) => choice,
                    Role::Searched(Search::PatternHarmonic) => 4.0,
                    Role::Searched(_) | Role::Located(_) => 3.0,
                    _ if ["inverse_clip", "inverse_level"].contains(&p.name) => 1.12,
                    _ => p.neutral + p.scale * (2.0 - 0.7 * i as f64),
                })
            })
        })
        .collect()
}

#[test]
fn every_effect_of_the_library_gives_the_answers_of_its_rust_as_text_too() {
    for &id in EffectId::ALL {
        let (library, text) = twins(id);
        for values in shown(id) {
            for e in probes() {
                let (a, b) = (outputs(library, &values, &e), outputs(text, &values, &e));
                for (a, b) in a.iter().zip(&b) {
                    let near = |a: f64, b: f64, size: f64| (a - b).abs() <= 1e-11 * (size + a.abs());
                    // slopes are compared in the size of what a parameter of that scale does
                    assert!(near(a.value, b.value, 1e-3), "{id} at {values:?}: {a:?} against {b:?}");
                    let slopes = (0..LANES).all(|i| near(a.slope[i], b.slope[i], 10.0));
                    assert!(slopes, "{id} at {values:?}: {a:?} against {b:?}");
                }
            }
        }
    }
}

#[test]
fn an_exported_effect_needs_a_name_of_its_own() {
    for &id in EffectId::ALL {
        let refusal = export(id).unwrap().effect("my-effect.toml").unwrap_err();
        assert!(refusal.to_string().contains("an id of its own"), "{refusal}");
    }
}

#[test]
fn the_cubic_readout_exports_as_a_person_would_write_it() {
    let text = export(EffectId::DetectionCubic).unwrap();
    assert_eq!(text.map["x_c'"], "x_c * (1 + 3/4 * (kappa + kappa_difference) * (x_c^2 + x_s^2))");
    assert_eq!(export(EffectId::DetectionSkew).unwrap().map["y_c'"], "y_c + skew * x_c");
    assert_eq!(export(EffectId::RateOffset).unwrap().map["rate'"], "rate + rate_offset");
}

fn file(stage: &str, map: &str) -> String {
    format!(
        "id = \"mine\"\nstage = \"{stage}\"\n[[parameter]]\nname = \"k\"\nunit = \"1\"\nneutral = 0.0\nscale = 1e-3\n[map]\n{map}\n"
    )
}

fn admit(stage: &str, map: &str) -> Result<EffectId, String> {
    EffectText::parse(&file(stage, map), "my-effect.toml")
        .and_then(|text| text.effect("my-effect.toml"))
        .map_err(|e| e.to_string())
}

/// (x', y') of a map of both at k = 0.1 and a vibration.
fn read(map: &str) -> Envelope<f64> {
    let e = Envelope::new(0.8, 0.03, 0.6, -0.02);
    let drive = AxisForces { x_c: 0.2, x_s: 0.1, y_c: -0.3, y_s: 0.05 };
    let at = Moment { t_s: 2.0, table_rad: 0.5, precession_rad_s: -3.0, warmer_k: 4.0, drive };
    admit("readout", map).unwrap().read(&[0.1, 0.0, 0.0, 0.0], e, &at)
}

#[test]
fn complex_envelopes_obey_the_rules_of_complex_numbers() {
    let (c, s) = (0.8_f64, 0.03_f64);
    let size = c.hypot(s);
    for (map, x_c, x_s) in [
        ("x * (1 + k * abs(x)^4)", c * (1.0 + 0.1 * size.powi(4)), s * (1.0 + 0.1 * size.powi(4))),
        // a phase lag: X e^{−ik} = (x_c − i x_s)(cos k − i sin k)
        ("x * (cos(k) - i * sin(k))", c * 0.1_f64.cos() - s * 0.1_f64.sin(), s * 0.1_f64.cos() + c * 0.1_f64.sin()),
        ("x / (1 + i * k)", (c - s * 0.1) / 1.01, (s + c * 0.1) / 1.01),
        ("conj(conj(x)) + k * re(x) - i * k * im(conj(x))", c + 0.1 * c, s + 0.1 * s),
        ("x + k * x^2 * x^-1", 1.1 * c, 1.1 * s),
        ("if_positive(re(x), x + k, x)", c + 0.1, s),
    ] {
        let e = read(&format!("\"x'\" = \"{map}\""));
        assert!((e.x_c - x_c).abs() < 1e-15 && (e.x_s - x_s).abs() < 1e-15, "{map}: {e:?}, not {x_c}, {x_s}");
        assert_eq!((e.y_c, e.y_s), (0.6, -0.02));
    }
}

#[test]
fn operators_bind_as_in_every_other_language() {
    for (expression, value) in [
        ("2 + 3 * 4 ^ 2", 50.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("8 / 4 / 2", 1.0),
        ("1 - 2 - 3", -4.0),
        ("--3 + +1", 4.0),
        ("(1 + 2) * 3e-1", 0.9),
        ("min(2, 3) + max(2, 3) * abs(-1)", 5.0),
        ("if_positive(0, 1, 2)", 2.0),
        ("atan2(1, 0) - pi / 2", 0.0),
        ("exp(1)", std::f64::consts::E),
        ("sqrt(.25) + sin(0) + cos(0)", 1.5),
        ("t * table + precession", -2.0),
    ] {
        let got = read(&format!("\"x_c'\" = \"x_c + k * ({expression})\"")).x_c;
        assert!((got - 0.8 - 0.1 * value).abs() < 1e-15, "{expression} is {value}, not {}", (got - 0.8) / 0.1);
    }
}

#[test]
fn an_angle_is_added_to_the_angle() {
    let e = read("\"theta'\" = \"theta + k * cos(4 * theta)\"");
    let theta = 0.6_f64.atan2(0.8);
    let turn = 0.1 * (4.0 * theta).cos();
    assert!((e.y_c.atan2(e.x_c) - theta - turn).abs() < 1e-15);
}

#[test]
fn what_was_read_is_unread_up_to_effects_of_two_tenths() {
    let at = Moment::default();
    for map in [
        "\"x'\" = \"x * (1 + k * abs(x)^2)\"",
        "\"y'\" = \"y * (1 + k) + k * x\"",
        "\"theta'\" = \"theta + k * sin(theta)\"",
    ] {
        let effect = admit("readout", map).unwrap();
        for k in [-0.1, 0.01, 0.2] {
            for e in probes() {
                let p = [k, 0.0, 0.0, 0.0];
                let back = effect.unread(&p, effect.read(&p, e, &at), &at);
                assert!((back - e).pendulum().e.sqrt() < 1e-12, "{map} with {k}: {back:?}, not {e:?}");
            }
        }
    }
}

#[test]
fn what_cannot_be_unread_is_not_a_number() {
    let effect = admit("readout", "\"x'\" = \"x * (1 - 3 * k * abs(x))\"").unwrap();
    let z: Envelope<f64> = effect.unread(&[1.0, 0.0, 0.0, 0.0], Envelope::new(1.0, 0.0, 0.5, 0.0), &Moment::default());
    assert!(z.x_c.is_nan());
}

#[test]
fn a_file_that_is_none_is_refused_with_its_place() {
    for (stage, map, said) in [
        ("readout", "\"x'\" = \"x * (1 + q * k)\"", "unknown name `q`"),
        ("readout", "\"x'\" = \"x * (1 + k\"", "`)` is missing"),
        ("readout", "\"x'\" = \"x ^ k\"", "an exponent is a whole number"),
        ("readout", "\"x'\" = \"x ^ 99\"", "an exponent is a whole number"),
        ("readout", "\"x'\" = \"sin(x)\"", "sin takes a real number"),
        ("readout", "\"x_c'\" = \"x + k\"", "a real number is wanted"),
        ("readout", "\"z'\" = \"x + k\"", "the map of a readout has no `z'`"),
        ("readout", "\"x'\" = \"x + k\"\n\"x_c'\" = \"x_c\"", "twice"),
        ("readout", "\"x'\" = \"x 3\"", "character 3: `3` is not expected here"),
        ("readout", "", "the map is empty"),
        ("oven", "\"x'\" = \"x\"", "stage `oven`"),
        ("input", "\"rate'\" = \"rate + k * x_c\"", "unknown name `x_c`"),
        ("readout", "\"x'\" = \"x + 1e-3 + k\"", "not absent at the neutral values"),
        ("mechanics", "theta_rate = \"k^2\"", "not linear"),
        ("readout", "\"x'\" = \"1e999 * k\"", "is not a number"),
    ] {
        let refusal = admit(stage, map).unwrap_err();
        assert!(refusal.contains(said) && refusal.starts_with("my-effect.toml"), "{map}: {refusal}");
    }
    for (from, to, said) in [
        ("mine", "Mine", "small letters"),
        ("mine", "detection-cubic", "an effect of the library"),
        ("\"k\"", "\"theta\"", "the language uses this name"),
        ("1e-3", "0.0", "scale > 0"),
        ("scale", "size", "unknown field"),
    ] {
        let text = file("readout", "\"x'\" = \"x + k\"").replace(from, to);
        let refusal = EffectText::parse(&text, "my-effect.toml").and_then(|t| t.effect("my-effect.toml")).unwrap_err();
        assert!(refusal.to_string().contains(said), "{refusal}");
    }
}

#[test]
fn nesting_and_length_have_limits() {
    let nested = |n: usize| format!("\"x'\" = \"x + k * {}1{}\"", "(".repeat(n), ")".repeat(n));
    assert!(admit("readout", &nested(40)).is_ok());
    assert!(admit("readout", &nested(5_000)).unwrap_err().contains("nested deeper"));
    let long = format!("\"x'\" = \"x + k{}\"", " + 0".repeat(1500));
    assert!(admit("readout", &long).unwrap_err().contains("steps"));
    let right = format!("\"x'\" = \"x + k * {}1{}\"", "(1 + ".repeat(20), ")".repeat(20));
    assert!(admit("readout", &right).unwrap_err().contains("numbers at once"));
}

#[test]
fn one_text_is_one_effect_however_often_it_is_read() {
    let (a, b) = (admit("readout", "\"x'\" = \"x + k\"").unwrap(), admit("readout", "\"x'\" = \"x + k\"").unwrap());
    assert_eq!(a, b);
    assert!(!a.in_library() && EffectId::DetectionCubic.in_library());
    assert_ne!(a, admit("readout", "\"x'\" = \"x + 2 * k\"").unwrap());
    assert!(EffectId::ALL.iter().all(|library| *library < a), "an effect as text acts after all of the library's");
    let first = file("readout", "\"x'\" = \"x + k\"").replacen('\n', "\nfirst = true\n", 1);
    let first = EffectText::parse(&first, "first").unwrap().effect("first").unwrap();
    assert!(EffectId::ALL.iter().all(|library| first < *library) && first.acts_on_angle());
    assert!(!first.in_library() && !a.acts_on_angle());
    assert_eq!(a.description().parameters.len().min(MAX_PARAMETERS), 1);
}
