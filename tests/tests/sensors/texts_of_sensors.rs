//! Effects as text on angle sensors: they compete with the library's readout and tables under the same cross-validation, bring
//! intervals that hold, are undone by the calibration, and stay out where the data do not speak for them.

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::{Campaign, Recording, Role, Run};
use cvg_calibration::{Answer, EffectText, Identification, Options, Origin, answer, compensate, identify};
use cvg_model::effects::EffectId;
use cvg_tests::angle_sensor::{Noise, find, held_out, run, sensor};
use cvg_tests::bench::trials;

/// A Hall element whose output bends with the square of the field: an even function, which the library has not.
const SQUARE: &str = r#"
id = "my-square"
stage = "readout"

[[parameter]]
name = "bend_x"
unit = "1/V"
scale = 1e-3

[[parameter]]
name = "bend_y"
unit = "1/V"
scale = 1e-3

[map]
"x'" = "x + bend_x * x^2"
"y'" = "y + bend_y * y^2"
"#;

/// A channel into the other in proportion to both.
const PRODUCT: &str = r#"
id = "my-product"
stage = "readout"

[[parameter]]
name = "cross"
unit = "1/V^2"
scale = 1e-3

[map]
"x'" = "x + cross * y^3"
"#;

/// The library's cubic under another name.
const CUBIC: &str = r#"
id = "my-cubic"
stage = "readout"

[[parameter]]
name = "kappa"
unit = "1/V^2"
scale = 1e-3

[map]
"x'" = "x * (1 + 3/4 * kappa * abs(x)^2)"
"y'" = "y * (1 + 3/4 * kappa * abs(y)^2)"
"#;

fn admitted(text: &str) -> EffectId {
    EffectText::parse(text, "my-effect.toml").unwrap().effect("my-effect.toml").unwrap()
}

/// Noise of a channel, as a share of its amplitude.
const NOISE: f64 = 3e-4;
/// Rows a run.
const ROWS: usize = 750;
/// Offsets, gain ratio, skew and amplitude in V of the sensors here.
const OFFSET: [f64; 2] = [0.02, -0.03];
const GAIN: f64 = 1.03;
const SKEW: f64 = 0.01;
const AMPLITUDE: f64 = 0.8;

/// A run of two turns and a half; `after` is what the signal meets last, in V, and `unit` what a volt is written as.
fn turning(seed: u64, role: Role, unit: f64, after: impl Fn([f64; 2]) -> [f64; 2]) -> Run {
    let mut noise = Noise::new(seed);
    let angles: Vec<f64> = (0..ROWS).map(|i| i as f64 * 900.0 / ROWS as f64).collect();
    let (x, y) = angles
        .iter()
        .map(|a| {
            let (sin, cos) = a.to_radians().sin_cos();
            let x = AMPLITUDE * (OFFSET[0] + cos);
            let y = AMPLITUDE * (OFFSET[1] + GAIN * (sin + SKEW * cos));
            let [x, y] = after([x, y]);
            let mut noisy = |v: f64| unit * (v + AMPLITUDE * NOISE * noise.sample());
            (noisy(x), noisy(y))
        })
        .unzip();
    let recording = Recording {
        t_s: (0..ROWS).map(|i| i as f64 * 0.01).collect(),
        table_deg: Some(angles),
        xc_v: Some(x),
        yc_v: Some(y),
        ..Recording::default()
    };
    run("turns.csv", role, recording)
}

fn campaign(seed: u64, unit: f64, after: impl Fn([f64; 2]) -> [f64; 2]) -> Campaign {
    sensor(vec![turning(seed, Role::Fit, unit, &after), turning(seed + 1000, Role::Holdout, unit, &after)])
}

fn identified(campaign: Campaign, effects: Vec<EffectId>) -> Identification {
    identify(campaign, &Options { effects, ..Options::default() }).unwrap_or_else(|refusal| panic!("{refusal}"))
}

/// The angle's noise, deg.
fn floor_deg() -> f64 {
    NOISE.to_degrees()
}

#[test]
fn a_readout_that_the_library_lacks_is_named_by_its_text_with_intervals_that_hold_and_undone() {
    let bent = |[x, y]: [f64; 2]| [x + 0.012 * x * x, y - 0.02 * y * y];
    let square = admitted(SQUARE);
    let (mut held, mut told, mut tables) = (0_u32, 0_u32, 0);
    for seed in 0..trials(4) {
        let without = identified(campaign(seed, 1.0, bent), vec![]);
        assert!(find(&without, "angle-table").is_some(), "seed {seed}: {:#?}", without.report.effects);
        let with = identified(campaign(seed, 1.0, bent), vec![square]);
        let found = find(&with, "my-square").unwrap_or_else(|| panic!("seed {seed}: {:#?}", with.report.effects));
        assert_eq!(found.origin, Origin::Discovered);
        assert!(found.evidence.starts_with("written by the user in my-effect.toml"), "{}", found.evidence);
        tables += u32::from(find(&with, "angle-table").is_some());
        assert!(held_out(&with) < 1.1 * floor_deg(), "seed {seed}: {}° of {}°", held_out(&with), floor_deg());
        for (p, truth) in found.parameters.iter().zip([0.012_f64, -0.02]) {
            let [low, high] = p.ci95.unwrap();
            assert!(high - low < 0.2 * truth.abs(), "seed {seed}: {p:?}");
            told += 1;
            held += u32::from((low..=high).contains(&truth));
        }
        let [low, high] = with.report.detection_gain_ratio.unwrap().ci95;
        told += 1;
        held += u32::from((low..=high).contains(&GAIN));

        let again = Calibration::from_text(&with.calibration.to_text(), "calibration.toml").unwrap();
        let mut recording = turning(seed + 2000, Role::Fit, 1.0, bent).recording;
        let reference = recording.table_deg.take().unwrap();
        let clean = compensate(&again, &recording).unwrap();
        let theta = clean.theta_deg.unwrap();
        let errors: Vec<f64> =
            theta.iter().zip(&reference).map(|(t, a)| (t - a + 180.0).rem_euclid(360.0) - 180.0).collect();
        let mean = errors.iter().sum::<f64>() / ROWS as f64;
        let rms = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / ROWS as f64).sqrt();
        assert!(rms < 1.1 * floor_deg(), "seed {seed}: {rms}° of {}°", floor_deg());
    }
    println!("{held} of {told} intervals hold; a table beside the text in {tables}");
    // noise passes for a table now and then, without a text too
    assert!(u64::from(4 * tables) <= trials(4), "a table in {tables} of {}", trials(4));
    // three binomial deviations at 95 %
    let expected = 0.95 * f64::from(told);
    assert!(f64::from(held) >= expected - 3.0 * (0.05 * expected).sqrt(), "{held} of {told}");
}

#[test]
fn channels_in_counts_have_an_effect_in_counts() {
    let unit = 4000.0;
    let with = identified(campaign(7, unit, |[x, y]| [x + 0.012 * x * x, y - 0.02 * y * y]), vec![admitted(SQUARE)]);
    let found = find(&with, "my-square").unwrap_or_else(|| panic!("{:#?}", with.report.effects));
    for (p, truth) in found.parameters.iter().zip([0.012 / unit, -0.02 / unit]) {
        assert!((p.value / truth - 1.0).abs() < 0.1, "{p:?}, set {truth}");
    }
}

#[test]
fn of_two_texts_the_one_that_is_there_is_named() {
    let with =
        identified(campaign(3, 1.0, |[x, y]| [x + 0.01 * y.powi(3), y]), vec![admitted(SQUARE), admitted(PRODUCT)]);
    assert!(find(&with, "my-square").is_none(), "{:#?}", with.report.effects);
    let found = find(&with, "my-product").unwrap_or_else(|| panic!("{:#?}", with.report.effects));
    let [low, high] = found.parameters[0].ci95.unwrap();
    assert!((low..=high).contains(&0.01), "{found:?}");
    let both = |[x, y]: [f64; 2]| [x + 0.012 * x * x + 0.01 * y.powi(3), y - 0.02 * y * y];
    let with = identified(campaign(4, 1.0, both), vec![admitted(SQUARE), admitted(PRODUCT)]);
    assert!(find(&with, "my-square").is_some() && find(&with, "my-product").is_some(), "{:#?}", with.report.effects);
    assert!(held_out(&with) < 1.2 * floor_deg(), "{}° of {}°", held_out(&with), floor_deg());
}

#[test]
fn a_text_that_is_not_there_changes_nothing() {
    for seed in 0..trials(4) {
        let effects = vec![admitted(SQUARE), admitted(PRODUCT)];
        let [without, with] = [vec![], effects].map(|effects| identified(campaign(seed, 1.0, |z| z), effects));
        assert_eq!(with.calibration.to_text(), without.calibration.to_text(), "seed {seed}");
        assert_eq!(with.report.effects.len(), without.report.effects.len(), "seed {seed}");
        assert!(!with.report.warnings.iter().any(|w| w.contains("had no part")), "{:?}", with.report.warnings);
    }
}

#[test]
fn of_a_text_and_the_library_that_say_the_same_the_library_is_named() {
    for seed in 0..trials(2) {
        // of the two channels before offsets, gain and skew, as the library has it
        let cubic = |[x, y]: [f64; 2]| {
            let bent = |v: f64| v + 0.02 * v.powi(3);
            let u = x - AMPLITUDE * OFFSET[0];
            let v = (y - AMPLITUDE * OFFSET[1]) / GAIN - SKEW * u;
            [AMPLITUDE * OFFSET[0] + bent(u), AMPLITUDE * OFFSET[1] + GAIN * (bent(v) + SKEW * bent(u))]
        };
        let with = identified(campaign(seed, 1.0, cubic), vec![admitted(CUBIC)]);
        assert!(find(&with, "my-cubic").is_none(), "seed {seed}: {:#?}", with.report.effects);
        assert!(find(&with, "detection-cubic").is_some(), "seed {seed}: {:#?}", with.report.effects);
    }
}

#[test]
fn a_text_that_asks_for_more_than_the_channels_has_no_part_and_a_warning_says_why() {
    let late = SQUARE.replace("bend_x * x^2", "bend_x * t").replace("my-square", "my-late");
    let first = SQUARE.replace("stage =", "first = true\nstage =").replace("my-square", "my-first");
    for text in [late, first] {
        let with = identified(campaign(1, 1.0, |z| z), vec![admitted(&text)]);
        let said = with.report.warnings.iter().find(|w| w.contains("had no part in this"));
        assert!(said.is_some_and(|w| w.contains("ask for x, y")), "{:?}", with.report.warnings);
    }
}

#[test]
fn without_a_reference_a_warning_says_that_a_text_had_no_part() {
    let mut campaign = campaign(1, 1.0, |z| z);
    campaign.runs.iter_mut().for_each(|run| run.recording.table_deg = None);
    let options = Options { effects: vec![admitted(SQUARE)], ..Options::default() };
    let Ok(Answer::Surveyed(told)) = answer(campaign, &options) else { panic!("two channels alone are surveyed") };
    let said: Vec<&String> = told.report.warnings.iter().filter(|w| w.contains("had no part in this")).collect();
    assert!(said.len() == 1 && said[0].contains("my-square"), "{:?}", told.report.warnings);
}

#[test]
fn a_text_without_an_inverse_where_rows_are_is_none() {
    // beyond 0.7 V the map turns back: no reading there has one vibration behind it
    let folded = SQUARE.replace("bend_x * x^2", "if_positive(x_c - 0.7, -1.9 * bend_x * 1000 * (x_c - 0.7), 0)");
    let folded = admitted(&folded.replace("my-square", "my-fold"));
    let with = identified(campaign(5, 1.0, |[x, y]| [x - 1.9 * (x - 0.7).max(0.0), y]), vec![folded]);
    assert!(with.report.heldout.discovered.rms_deg.is_finite());
}
