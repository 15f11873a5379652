//! What a campaign cannot tell apart is said, with the run that would: that run is simulated, and tells it.

use cvg_calibration::{Identification, Origin};
use cvg_model::effects::EffectId;
use cvg_simulator::Settings;
use cvg_simulator::scenario::{EffectSetting, Run};
use cvg_tests::bench::{effect, found, identify, plain_paper};

const CHECK: &str = "rot+500-low.csv";
const BACK: &str = "rot-500.csv";
const SLOWER: &str = "rot+200.csv";

/// The paper's bench with only some of its runs.
fn bench(undeclared: &[EffectSetting], files: &[&str], ring_downs: bool) -> Settings {
    let mut settings = plain_paper();
    settings.effects.extend(undeclared);
    settings.runs.retain(|run| match run {
        Run::Rotation { file, .. } => files.contains(&file.as_str()),
        _ => ring_downs,
    });
    settings
}

/// Pairs that are confounded, and the advice on the first.
fn confounded(identified: &Identification) -> (Vec<String>, Option<String>) {
    let effects = identified.report.effects.iter().filter(|e| !e.confounded_with.is_empty());
    let pairs = effects.clone().map(|e| format!("{} with {}", e.id, e.confounded_with.join(", ")));
    (pairs.collect(), effects.filter_map(|e| e.separated_by.clone()).next())
}

/// Follows the advice from campaign to campaign until nothing is confounded; says what was advised.
fn followed(undeclared: &[EffectSetting], files: &[&str], ring_downs: bool) -> (Vec<String>, Identification) {
    let (mut files, mut ring_downs) = (files.to_vec(), ring_downs);
    let mut advised = Vec::new();
    loop {
        let identified = identify(bench(undeclared, &files, ring_downs)).unwrap();
        let (pairs, advice) = confounded(&identified);
        println!("{files:?}, ring-downs {ring_downs}: {pairs:?}; {advice:?}");
        let Some(advice) = advice else { return (advised, identified) };
        let before = (files.len(), ring_downs);
        for (words, file) in [("opposite direction", BACK), ("another rate", SLOWER), ("another amplitude", CHECK)] {
            if advice.contains(words) && !files.contains(&file) {
                files.push(file);
            }
        }
        ring_downs |= advice.contains("ring-downs");
        assert!((files.len(), ring_downs) != before, "{advice} is there already, and {pairs:?} still");
        advised.push(advice);
    }
}

#[test]
fn one_rate_does_not_tell_anisodamping_from_the_mismatch_and_the_advised_runs_do() {
    let (advised, _) = followed(&[], &["rot+500.csv"], true);
    assert_eq!(advised, ["rotation runs at another rate and in the opposite direction"]);
}

/// One run at one rate, of so many seconds and samples per second.
fn one_run(duration: f64, samples_per_s: f64) -> Identification {
    let mut settings = bench(&[], &["rot+500.csv"], true);
    settings.sample_hz = samples_per_s;
    for run in &mut settings.runs {
        if let Run::Rotation { duration_s, .. } = run {
            *duration_s = duration;
        }
    }
    identify(settings).expect("one run is a campaign")
}

#[test]
fn one_rate_gives_a_ratio_within_what_anisodamping_could_make_of_it() {
    // at most 0.02 1/s along the axes turns the pattern by 0.02/(4 kΩ) sin 2θ, half of the ratio's own share
    let most = 1.96 * 2.0 * 0.02 / (4.0 * 0.78 * 500f64.to_radians());
    // a run that is looked at whole, and one that is thinned
    for identified in [one_run(20.0, 100.0), one_run(250.0, 1000.0)] {
        let ratio = identified.report.detection_gain_ratio.expect("it is told, if not well");
        let width = 0.5 * (ratio.ci95[1] - ratio.ci95[0]);
        assert!(width > 0.5 * most && width < 1.1 * most, "{ratio:?} of at most ±{most}");
        assert!(ratio.ci95[0] < 1.0132 && ratio.ci95[1] > 1.0132, "{ratio:?}");
        // forces that are late by up to some 2 ms turn the pattern at 1/τ of that, which looks like k
        let k = identified.report.angular_gain;
        let late = 1.96 * 2e-3 * 0.78 / 22.0;
        let width = 0.5 * (k.ci95[1] - k.ci95[0]);
        assert!(width > 0.9 * late && width < 1.1 * late, "{k:?} of ±{late}");
        assert!(k.ci95[0] < 0.78 && k.ci95[1] > 0.78, "{k:?}");
    }
}

#[test]
fn both_directions_at_one_rate_lack_another_rate() {
    let (advised, _) = followed(&[], &["rot+500.csv", BACK], true);
    assert_eq!(advised, ["a rotation run at another rate"]);
}

#[test]
fn two_rates_in_one_direction_lack_the_other() {
    let (advised, _) = followed(&[], &["rot+500.csv", SLOWER], true);
    assert_eq!(advised, ["a rotation run in the opposite direction"]);
}

#[test]
fn a_drive_that_rotation_alone_cannot_tell_is_told_by_ring_downs() {
    let offset = effect(EffectId::DetectionOffset, &[9e-4, 5e-4]);
    let (advised, identified) = followed(&[offset], &["rot+500.csv", SLOWER], false);
    assert!(advised.contains(&"ring-downs at 0° and 90°".to_owned()), "{advised:?}");
    assert_eq!(found(&identified, Origin::Discovered), ["detection-offset"]);
}

#[test]
fn a_cubic_at_one_amplitude_may_be_a_quintic_and_a_second_amplitude_tells() {
    let cubic = [effect(EffectId::DetectionCubic, &[0.004])];
    let told = |files: &[&str]| {
        let identified = identify(bench(&cubic, files, true)).unwrap();
        assert_eq!(found(&identified, Origin::Discovered), ["detection-cubic"]);
        confounded(&identified)
    };
    let (pairs, advice) = told(&["rot+500.csv", BACK, SLOWER]);
    assert_eq!(pairs, ["detection-cubic with detection-quintic"]);
    assert_eq!(advice.as_deref(), Some("a rotation run at another amplitude"));
    assert_eq!(told(&["rot+500.csv", BACK, SLOWER, CHECK]), (vec![], None));
}

#[test]
fn a_fourth_harmonic_of_unknown_cause_is_named_by_the_advised_runs() {
    let cubic = effect(EffectId::DetectionCubic, &[0.004]);
    let (advised, identified) = followed(&[cubic], &["rot+500.csv"], false);
    assert!(!advised.is_empty());
    assert_eq!(found(&identified, Origin::Discovered), ["detection-cubic"]);
    assert_eq!(found(&identified, Origin::Empirical), [""; 0]);
}
