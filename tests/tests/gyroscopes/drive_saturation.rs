//! Drives that clip what a split asks of them: found with their level, and told from a spring by the commands.
//!
//! `CVG_TRIALS` says how many devices are drawn.

use std::f64::consts::TAU;

use cvg_calibration::Origin;
use cvg_model::effects::EffectId;
use cvg_simulator::Settings;
use cvg_tests::bench::{Draws, all, effect, found, holds, identify, over_floor, plain_paper, polar, trials};
use cvg_tests::blind::largest_drive;

/// A random device with a split of 0.1 to 0.4 Hz, whose largest command is 5 to 20 % over the level of its drives; and that level, V.
fn device(seed: u64) -> (Settings, f64, f64) {
    let mut draw = Draws::new(11_000 + seed);
    let mut settings = plain_paper();
    let (ratio, split) = (draw.between(0.97, 1.03), draw.scale(0.1, 0.4));
    settings.seed = seed;
    settings.effects = vec![
        polar(EffectId::Anisodamping, draw.between(0.0, 0.008), draw.angle_deg(), 2.0),
        polar(EffectId::Anisoelasticity, TAU * split, draw.angle_deg(), 2.0),
        effect(EffectId::ActuationGainMismatch, &[draw.between(0.97, 1.03)]),
        effect(EffectId::DetectionGainMismatch, &[ratio]),
    ];
    let level = largest_drive(&settings) / draw.between(1.05, 1.2);
    settings.effects.push(effect(EffectId::DriveSaturation, &[1.0 / level]));
    (settings, ratio, level)
}

#[test]
fn the_level_of_drives_that_saturate_is_found() {
    let outcomes = all(trials(4), |seed| {
        let (settings, ratio, level) = device(seed);
        let identified = identify(settings).unwrap();
        let report = &identified.report;
        let told = report.effects.iter().find(|e| e.id == "drive-saturation").map(|e| e.parameters[0].clone());
        println!(
            "{seed}: {:.2} floors, ratio {ratio:.5} {:?}, 1/level {:.5} {told:?}, {:?}, {:?}",
            over_floor(&identified),
            report.detection_gain_ratio,
            1.0 / level,
            found(&identified, Origin::Discovered),
            report.warnings
        );
        let others = found(&identified, Origin::Discovered).into_iter().filter(|id| *id != "drive-saturation").count();
        let inside =
            told.as_ref().and_then(|p| p.ci95).is_some_and(|[low, high]| (low..=high).contains(&(1.0 / level)));
        let near = told.is_some_and(|p| (p.value * level - 1.0).abs() < 0.02);
        let held = holds(&report.detection_gain_ratio.unwrap(), ratio);
        (near, others, inside, held, over_floor(&identified))
    });
    let n = outcomes.len();
    let count = |is: fn(&(bool, usize, bool, bool, f64)) -> bool| outcomes.iter().filter(|o| is(o)).count();
    println!("{} named of {n}, {} levels and {} ratios held", count(|o| o.0), count(|o| o.2), count(|o| o.3));
    assert_eq!(count(|o| !o.0), 0, "not named");
    assert_eq!(count(|o| o.1 > 0), 0, "another is claimed");
    assert!(count(|o| !o.2) <= (n / 10).max(1), "{} levels missed", count(|o| !o.2));
    assert!(count(|o| !o.3) <= (n / 10).max(1), "{} ratios missed", count(|o| !o.3));
    assert!(count(|o| o.4 > 1.5) <= n / 20, "above 1.5 floors");
}

/// What clipped drives don't put out is not left to the force scale, the latency and with them to the angular gain: that is told as
/// well as with drives that put out everything, whether the level is named or only likely.
#[test]
fn the_angular_gain_is_told_as_well_beside_drives_that_clip() {
    let told = all(trials(6), |seed| {
        let (clipped, ..) = device(seed);
        let mut whole = clipped.clone();
        whole.effects.retain(|e| e.id != EffectId::DriveSaturation);
        let k = clipped.angular_gain;
        let [clipped, whole] = [clipped, whole].map(|settings| identify(settings).unwrap().report.angular_gain);
        println!("{seed}: {clipped:?}, {whole:?} without, {k}");
        let apart = (clipped.value - whole.value).abs() / clipped.half_width();
        (holds(&clipped, k), apart, clipped.half_width() / whole.half_width())
    });
    let missed = told.iter().filter(|t| !t.0).count();
    assert!(missed <= (told.len() / 10).max(1), "{missed} of {} intervals missed", told.len());
    assert!(told.iter().all(|(_, apart, _)| *apart < 1.0), "{told:?}");
    // seven times as wide at 5 % over the level, and two hundred times at 10 %
    let wide = told.iter().filter(|(_, _, wider)| *wider > 2.0).count();
    assert!(wide <= told.len() / 6, "{told:?}");
}

#[test]
fn drives_that_put_out_what_they_are_asked_for_are_not_named() {
    let found = all(trials(4), |seed| {
        let (mut settings, ..) = device(seed);
        settings.effects.retain(|e| e.id != EffectId::DriveSaturation);
        let identified = identify(settings).unwrap();
        found(&identified, Origin::Discovered).into_iter().map(str::to_owned).collect::<Vec<_>>()
    });
    assert!(found.iter().all(Vec::is_empty), "{found:?}");
}
