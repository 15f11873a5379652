//! Drives behind a converter of few bits: its step is found without the angle, and what is not told of the forces within it is not
//! claimed.
//!
//! `CVG_TRIALS` says how many devices are drawn.

use std::f64::consts::TAU;

use cvg_calibration::{Identification, Origin};
use cvg_model::effects::EffectId;
use cvg_simulator::Settings;
use cvg_tests::bench::{Draws, all, effect, found, holds, identify, over_floor, plain_paper, polar, trials};
use cvg_tests::blind::largest_drive;

/// A random device with a split of 0.1 to 0.4 Hz, and its largest command, V.
fn device(seed: u64) -> (Settings, f64) {
    let mut draw = Draws::new(12_000 + seed);
    let mut settings = plain_paper();
    let split = draw.scale(0.1, 0.4);
    settings.seed = seed;
    settings.effects = vec![
        polar(EffectId::Anisodamping, draw.between(0.0, 0.008), draw.angle_deg(), 2.0),
        polar(EffectId::Anisoelasticity, TAU * split, draw.angle_deg(), 2.0),
        effect(EffectId::ActuationGainMismatch, &[draw.between(0.97, 1.03)]),
        effect(EffectId::DetectionGainMismatch, &[draw.between(0.97, 1.03)]),
    ];
    let largest = largest_drive(&settings);
    (settings, largest)
}

/// The same with drives of `steps` steps to the largest command; and the step, V.
fn quantised(seed: u64, steps: f64) -> (Settings, f64) {
    let (mut settings, largest) = device(seed);
    let step = largest / steps;
    settings.effects.push(effect(EffectId::DriveQuantisation, &[step]));
    (settings, step)
}

fn others(identified: &Identification) -> Vec<String> {
    let all = found(identified, Origin::Discovered).into_iter().filter(|id| *id != "drive-quantisation");
    all.map(str::to_owned).collect()
}

#[test]
fn the_step_of_quantised_drives_is_found_and_nothing_else_is_claimed() {
    let cases: Vec<(u64, f64)> =
        (0..trials(1)).flat_map(|seed| [128.0, 32.0, 12.0].map(|steps| (seed, steps))).collect();
    let outcomes = all(cases.len() as u64, |case| {
        let (seed, steps) = cases[usize::try_from(case).unwrap()];
        let (settings, step) = quantised(seed, steps);
        let value = |id| settings.effects.iter().find(|e| e.id == id).map_or(1.0, |e| e.values[0]);
        let (k, ratio) = (settings.angular_gain, value(EffectId::DetectionGainMismatch));
        let drives = value(EffectId::ActuationGainMismatch);
        let identified = identify(settings.clone()).unwrap();
        let report = &identified.report;
        let told = report.effects.iter().find(|e| e.id == "drive-quantisation").map(|e| e.parameters[0].clone());
        println!(
            "{seed}, {steps} steps of {step:.5} V: {told:?}, {:.2} floors, k {k} {:?}, {ratio:.5} {:?}, {drives:.5} {:?}, {:?}, {:?}",
            over_floor(&identified),
            report.angular_gain,
            report.detection_gain_ratio,
            report.actuation_gain_ratio,
            others(&identified),
            report.warnings
        );
        let inside = told.and_then(|p| p.ci95).is_some_and(|[low, high]| (low..=high).contains(&step));
        let held = holds(&report.angular_gain, k)
            && holds(&report.detection_gain_ratio.unwrap(), ratio)
            && report.actuation_gain_ratio.is_none_or(|told| holds(&told, drives));
        let said = report.warnings.iter().any(|w| w.contains("whole steps"));
        (inside, others(&identified), held, said)
    });
    assert!(outcomes.iter().all(|o| o.0), "a step is missed: {outcomes:?}");
    assert!(outcomes.iter().all(|o| o.1.is_empty()), "another effect is claimed: {outcomes:?}");
    let missed = outcomes.iter().filter(|o| !o.2).count();
    assert!(missed <= (outcomes.len() / 10).max(1), "{missed} campaigns with an interval that is missed: {outcomes:?}");
    assert!(outcomes.iter().all(|o| o.3), "nothing is said: {outcomes:?}");
}

#[test]
fn drives_that_put_out_what_they_are_asked_for_have_no_steps() {
    let found = all(trials(2), |seed| {
        let identified = identify(device(seed).0).unwrap();
        found(&identified, Origin::Discovered).into_iter().map(str::to_owned).collect::<Vec<_>>()
    });
    assert!(found.iter().all(Vec::is_empty), "{found:?}");
}
