//! The drive fed through to the pick-off: found where a split makes the commands go with the angle, and undone.
//!
//! `CVG_TRIALS` says how many devices are drawn.

use std::f64::consts::TAU;

use cvg_calibration::Origin;
use cvg_model::effects::EffectId;
use cvg_simulator::Settings;
use cvg_tests::bench::{Draws, all, effect, found, holds, identify, over_floor, plain_paper, polar, trials};

/// A random device with a split of 0.05 to 0.4 Hz, whose drives couple into the pick-offs by up to `size`, V/V.
fn device(seed: u64, size: f64) -> (Settings, f64, [f64; 4]) {
    let mut draw = Draws::new(9000 + seed);
    let mut settings = plain_paper();
    let (ratio, split) = (draw.between(0.97, 1.03), draw.scale(0.05, 0.4));
    let factors: [f64; 4] = std::array::from_fn(|_| draw.between(-size, size));
    settings.seed = seed;
    settings.effects = vec![
        polar(EffectId::Anisodamping, draw.between(0.0, 0.008), draw.angle_deg(), 2.0),
        polar(EffectId::Anisoelasticity, TAU * split, draw.angle_deg(), 2.0),
        effect(EffectId::ActuationGainMismatch, &[draw.between(0.97, 1.03)]),
        effect(EffectId::DetectionGainMismatch, &[ratio]),
        effect(EffectId::DriveFeedthrough, &factors),
    ];
    (settings, ratio, factors)
}

#[test]
fn what_the_drives_feed_through_is_found_and_undone() {
    let outcomes = all(trials(6), |seed| {
        let (settings, ratio, factors) = device(seed, 3e-3);
        let identified = identify(settings).unwrap();
        let report = &identified.report;
        let told = report.effects.iter().find(|e| e.id == "drive-feedthrough");
        let parameters: Vec<_> = told.iter().flat_map(|e| &e.parameters).map(|p| (p.value, p.ci95)).collect();
        println!(
            "{seed}: {:.2} floors, ratio {ratio:.5} {:?}, {factors:.5?} {parameters:.5?}, {:?}, {:?}",
            over_floor(&identified),
            report.detection_gain_ratio,
            found(&identified, Origin::Discovered),
            report.warnings
        );
        let others = found(&identified, Origin::Discovered).into_iter().filter(|id| *id != "drive-feedthrough").count();
        let held = holds(&report.detection_gain_ratio.unwrap(), ratio);
        let inside = |(value, ci): (f64, Option<[f64; 2]>)| ci.is_some_and(|[low, high]| (low..=high).contains(&value));
        let factors_held = factors.into_iter().zip(&parameters).filter(|(f, p)| inside((*f, p.1))).count();
        (told.is_some(), others, held, over_floor(&identified), factors_held)
    });
    let n = outcomes.len();
    let count = |is: fn(&(bool, usize, bool, f64, usize)) -> bool| outcomes.iter().filter(|o| is(o)).count();
    let factors: usize = outcomes.iter().map(|o| o.4).sum();
    println!(
        "{} named of {n}, {} ratios held, {factors} factors of {}, {} above 1.5 floors, {} others",
        count(|o| o.0),
        count(|o| o.2),
        4 * count(|o| o.0),
        count(|o| o.3 > 1.5),
        count(|o| o.1 > 0)
    );
    assert_eq!(count(|o| !o.0), 0, "not named");
    assert_eq!(count(|o| o.1 > 0), 0, "another is claimed");
    assert!(count(|o| !o.2) <= (n / 10).max(1), "{} ratios missed", count(|o| !o.2));
    assert!(count(|o| o.3 > 1.5) <= n / 20, "above 1.5 floors");
}
