//! Effects written down as text: they compete with the library at the same price, take their part in the compensation, and
//! no text makes the program fail.

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::Campaign;
use cvg_calibration::{EffectText, Identification, Options, Origin, compensate, identify};
use cvg_model::effects::{EffectId, Moment, Stage};
use cvg_model::{AxisForces, Envelope};
use cvg_simulator::{Scenario, Settings};
use cvg_tests::bench::{effect, found, over_floor, plain_paper};
use proptest::prelude::*;

const QUINTIC: &str = r#"
id = "my-quintic"
stage = "readout"

[[parameter]]
name = "kappa5"
unit = "1/V^4"
neutral = 0.0
scale = 1e-3

[map]
"x'" = "x * (1 + 5/8 * kappa5 * abs(x)^4)"
"y'" = "y * (1 + 5/8 * kappa5 * abs(y)^4)"
"#;

/// A spring that pulls at 6θ, which the library has not.
const SPRING: &str = r#"
id = "my-spring"
stage = "mechanics"

[[parameter]]
name = "spring_cos"
unit = "rad/s"
scale = 1e-2

[[parameter]]
name = "spring_sin"
unit = "rad/s"
scale = 1e-2

[map]
theta_rate = "spring_cos * sin(6 * theta) + spring_sin * cos(6 * theta)"
"#;

/// Unequal gains, which the library has.
const GAIN: &str = r#"
id = "my-gain"
stage = "readout"

[[parameter]]
name = "ratio"
unit = "1"
neutral = 1.0
scale = 1e-2

[map]
"y'" = "y * ratio"
"#;

fn admitted(text: &str) -> EffectId {
    EffectText::parse(text, "my-effect.toml").unwrap().effect("my-effect.toml").unwrap()
}

/// A campaign of the device, in a folder of its own.
fn campaign(settings: Settings) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    Scenario::new(settings).unwrap().simulate().write(folder.path()).unwrap();
    std::fs::remove_file(folder.path().join("truth.toml")).unwrap();
    folder
}

fn identified(folder: &tempfile::TempDir, effects: Vec<EffectId>) -> Identification {
    let campaign = Campaign::open(&folder.path().join("campaign.toml")).unwrap();
    identify(campaign, &Options { effects, ..Options::default() }).unwrap()
}

#[test]
fn a_quintic_readout_is_found_by_its_text_told_from_the_cubic_and_undone() {
    let quintic = admitted(QUINTIC);
    let mut settings = plain_paper();
    settings.effects.push(effect(quintic, &[8e-3]));
    let folder = campaign(settings);
    let with = identified(&folder, vec![quintic]);
    assert_eq!(found(&with, Origin::Discovered), ["my-quintic"], "{:#?}", with.steps);
    assert!(over_floor(&with) <= 1.3, "{} times the noise floor is left", over_floor(&with));
    let report = with.report.effects.iter().find(|e| e.id == "my-quintic").unwrap();
    let [low, high] = report.parameters[0].ci95.unwrap();
    assert!((low..=high).contains(&8e-3), "{report:#?}");
    assert!(report.evidence.starts_with("written by the user in my-effect.toml"), "{}", report.evidence);

    // the calibration carries the text, and undoes the effect without the file
    let text = with.calibration.to_text();
    let again = Calibration::from_text(&text, "calibration.toml").unwrap();
    let member = |c: &Calibration| c.hypothesis.member(quintic).map(|m| m.values);
    assert_eq!(member(&again), member(&with.calibration));
    let mut opened = Campaign::open(&folder.path().join("campaign.toml")).unwrap();
    let recording = opened.runs.remove(0).recording;
    let clean = compensate(&again, &recording).unwrap();
    assert_eq!(clean.len(), recording.len());
}

#[test]
fn a_spring_that_the_library_lacks_is_found_by_its_text() {
    let spring = admitted(SPRING);
    let mut settings = plain_paper();
    settings.effects.push(effect(spring, &[6e-3, -4e-3]));
    let with = identified(&campaign(settings), vec![spring]);
    assert_eq!(found(&with, Origin::Discovered), ["my-spring"], "{:#?}", with.steps);
    assert!(over_floor(&with) <= 1.3, "{} times the noise floor is left", over_floor(&with));
}

/// θ̇ += m |cos θ|, whose 4θ is a cubic spring's and whose 2θ is an anisodamping's to the angle: the energy command has none of it to replace.
#[test]
fn a_bilinear_spring_in_the_mechanics_is_no_cubic_one_and_no_anisodamping() {
    let spring = admitted(
        "id = \"bilinear\"\nstage = \"mechanics\"\n[[parameter]]\nname = \"m\"\nunit = \"rad/s\"\nscale = 1e-2\n\
         [map]\ntheta_rate = \"m * abs(cos(theta))\"\n",
    );
    let mut settings = plain_paper();
    settings.effects.push(effect(spring, &[5e-3]));
    let told = identified(&campaign(settings), vec![]);
    assert!(found(&told, Origin::Discovered).is_empty(), "{:?}", told.report.effects);
    let said = |what: &str| told.report.warnings.iter().any(|w| w.contains(what));
    assert!(said("the energy command has to replace one of"), "{:?}", told.report.warnings);
    let anisodamping = told.report.effects.iter().find(|e| e.id == "anisodamping");
    // the paper's device: 0.0047 1/s
    let [low, high] = anisodamping.map_or([0.0, 1.0], |e| e.parameters[0].ci95.unwrap());
    assert!((low..=high).contains(&0.0047), "{anisodamping:?}");
}

/// X(1 + k|X|⁶) between the amplitudes of a campaign is a cubic and a quintic of opposite signs.
#[test]
fn a_septic_readout_is_not_claimed_as_a_cubic_and_a_quintic_and_a_true_pair_is() {
    let septic = admitted(
        "id = \"septic\"\nstage = \"readout\"\n[[parameter]]\nname = \"k\"\nunit = \"1/V^6\"\nscale = 1e-3\n\
         [map]\n\"x'\" = \"x * (1 + k * abs(x)^6)\"\n\"y'\" = \"y * (1 + k * abs(y)^6)\"\n",
    );
    let with = |planted: &[(EffectId, f64)]| {
        let mut settings = plain_paper();
        settings.effects.extend(planted.iter().map(|(id, size)| effect(*id, &[*size])));
        settings.effects.sort_by_key(|e| e.id);
        identified(&campaign(settings), vec![])
    };
    let told = with(&[(septic, 4e-3)]);
    assert!(found(&told, Origin::Discovered).is_empty(), "{:?}", told.report.effects);
    assert!(over_floor(&told) < 1.5, "{}", over_floor(&told));
    let pair = with(&[(EffectId::DetectionCubic, 5e-3), (EffectId::DetectionQuintic, 4e-3)]);
    assert_eq!(found(&pair, Origin::Discovered), ["detection-cubic", "detection-quintic"]);
}

#[test]
fn an_effect_as_text_that_is_not_there_changes_nothing() {
    let folder = campaign(Scenario::paper().settings().clone());
    let (without, with) = (identified(&folder, vec![]), identified(&folder, vec![admitted(QUINTIC), admitted(SPRING)]));
    assert_eq!(found(&with, Origin::Discovered), ["detection-cubic"], "{:#?}", with.steps);
    assert_eq!(with.calibration.to_text(), without.calibration.to_text());
    assert_eq!(with.report.heldout, without.report.heldout);
    let lost = with.report.warnings.iter().find(|w| w.contains("competed and is not in the answer")).unwrap();
    assert!([QUINTIC, SPRING].iter().all(|text| lost.contains(admitted(text).description().id)), "{lost}");
    // one that says what a declared effect says made its interval four hundred times as wide
    let again = identified(&folder, vec![admitted(GAIN)]);
    for with in [with, again] {
        assert_eq!(with.report.angular_gain, without.report.angular_gain);
        assert_eq!(with.report.detection_gain_ratio, without.report.detection_gain_ratio);
        assert_eq!(with.report.actuation_gain_ratio, without.report.actuation_gain_ratio);
    }
}

#[test]
fn the_electronics_refuse_an_effect_that_the_library_lacks() {
    let quintic = (admitted(QUINTIC), [1e-3, 0.0, 0.0, 0.0]);
    assert!(cvg_estimator::Compensation::<f64, 4>::new(&[quintic]).is_err());
    let drive = QUINTIC.replace("readout", "actuation").replace("my-quintic", "my-drive");
    let drive = (admitted(&drive), [1e-3, 0.0, 0.0, 0.0]);
    assert!(cvg_controller::ActuationCompensation::<f64>::new(&[drive]).is_err());
}

/// An effect file around expressions.
fn file(stage: &str, map: &[(String, String)]) -> String {
    let text = EffectText {
        id: "my-effect".into(),
        summary: String::new(),
        stage: stage.into(),
        first: false,
        onsets: Vec::new(),
        parameter: ["k", "m"]
            .map(|name| cvg_calibration::ParameterText {
                name: name.into(),
                unit: "1".into(),
                neutral: 0.0,
                scale: 1.0,
                lower: None,
                upper: None,
                held: false,
            })
            .to_vec(),
        map: map.iter().cloned().collect(),
        law: None,
    };
    text.to_text()
}

/// Pieces of expressions, in any order: some of them make sense.
fn pieces() -> impl Strategy<Value = String> {
    let piece = prop::sample::select(vec![
        "x",
        "y",
        "x_c",
        "y_s",
        "theta",
        "E",
        "Q",
        "R",
        "S",
        "t",
        "table",
        "precession",
        "rate",
        "k",
        "m",
        "pi",
        "i",
        "1",
        "0",
        "-3.5e2",
        "1e308",
        "+",
        "-",
        "*",
        "/",
        "^",
        "^2",
        "^-3",
        "(",
        ")",
        ",",
        "sqrt(",
        "sin(",
        "exp(",
        "abs(",
        "atan2(",
        "min(",
        "if_positive(",
        "re(",
        " ",
        "κ",
        "\0",
    ]);
    prop::collection::vec(piece, 1..60).prop_map(|pieces| pieces.concat())
}

/// Expressions that are right.
fn expressions() -> impl Strategy<Value = String> {
    let leaf =
        prop::sample::select(vec!["x_c", "y_c", "y_s", "theta", "E", "R", "k", "m", "0", "2.5", "1e200", "re(x*y)"]);
    leaf.prop_map(str::to_owned).prop_recursive(6, 64, 3, |inner| {
        let (a, b, c) = (inner.clone(), inner.clone(), inner.clone());
        let two = (inner.clone(), prop::sample::select(vec!["+", "-", "*", "/"]), inner.clone());
        prop_oneof![
            two.prop_map(|(a, sign, b)| format!("({a}) {sign} ({b})")),
            (inner.clone(), -5..6_i32).prop_map(|(a, n)| format!("({a})^{n}")),
            (prop::sample::select(vec!["sqrt", "sin", "cos", "exp", "abs"]), inner)
                .prop_map(|(f, a)| format!("{f}({a})")),
            (a, b, c).prop_map(|(a, b, c)| format!("if_positive({a}, {b}, atan2({c}, 1))")),
        ]
    })
}

/// Runs an effect at odd numbers; it comes back.
fn evaluated(effect: EffectId) {
    let numbers = [0.0, 1.0, -1e300, f64::MIN_POSITIVE, f64::INFINITY, f64::NAN, 0.7];
    for (i, a) in numbers.into_iter().enumerate() {
        let b = numbers[(3 * i + 1) % numbers.len()];
        let e = Envelope::new(a, b, 0.5, -a);
        let (p, at) = (
            [b, a, 1.0, 0.0],
            Moment {
                t_s: a,
                table_rad: b,
                precession_rad_s: a,
                warmer_k: b,
                drive: AxisForces { x_c: b, x_s: a, y_c: 0.5, y_s: b },
            },
        );
        let outputs = [effect.read(&p, e, &at), effect.unread(&p, e, &at), effect.mechanics(&p, &e, &at)];
        let forces = effect.actuate(&p, AxisForces { x_c: a, x_s: b, y_c: a, y_s: b }, &at);
        let rate = effect.input_rate(&p, a, &at);
        std::hint::black_box((outputs, forces, rate));
    }
}

proptest! {
    #[test]
    fn prop_any_bytes_are_an_effect_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let text = String::from_utf8_lossy(&bytes);
        if let Ok(effect) = EffectText::parse(&text, "my-effect.toml") {
            prop_assert_eq!(EffectText::parse(&effect.to_text(), "again").unwrap(), effect);
        }
    }

    #[test]
    fn prop_any_pieces_are_an_expression_or_refused(
        stage in prop::sample::select(vec![("readout", "x'"), ("input", "rate'"), ("mechanics", "damping")]),
        pieces in pieces(),
    ) {
        let text = file(stage.0, &[(stage.1.into(), pieces)]);
        if let Ok(effect) = EffectText::parse(&text, "my-effect.toml").and_then(|e| e.effect("my-effect.toml")) {
            evaluated(effect);
        }
    }

    #[test]
    fn prop_every_expression_has_a_value_and_ends(
        stage in prop::sample::select(vec![Stage::Readout, Stage::Actuation, Stage::Mechanics]),
        expression in expressions(),
    ) {
        // absent at k = 0, and linear in it
        let (stage, key, map) = match stage {
            Stage::Mechanics => ("mechanics", "theta_rate", format!("k * sin({expression})")),
            Stage::Actuation => ("actuation", "x_c'", format!("x_c + k * cos({expression})")),
            _ => ("readout", "theta'", format!("theta + k * sin({expression})")),
        };
        let text = file(stage, &[(key.into(), map)]);
        let Ok(effect) = EffectText::parse(&text, "my-effect.toml") else { return Ok(()) };
        if let Ok(effect) = effect.effect("my-effect.toml") {
            evaluated(effect);
        }
    }
}
