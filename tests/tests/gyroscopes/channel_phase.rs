//! Readout channels of unequal phase lag: found beside a split, told from nothing, and no reason to leave runs out.
//!
//! `CVG_TRIALS` says how many devices are drawn.

use std::f64::consts::TAU;

use cvg_calibration::Origin;
use cvg_model::effects::EffectId;
use cvg_simulator::Settings;
use cvg_tests::bench::{Draws, all, effect, found, holds, identify, over_floor, plain_paper, polar, trials};

/// A random device with a split of 0.05 to 0.4 Hz, and a phase between its channels where `lags`.
fn device(seed: u64, lags: bool) -> (Settings, f64, f64) {
    let mut draw = Draws::new(7000 + seed);
    let mut settings = plain_paper();
    let (ratio, split) = (draw.between(0.97, 1.03), draw.scale(0.05, 0.4));
    let phase = if draw.below(2) == 0 { 1.0 } else { -1.0 } * draw.scale(5e-3, 1e-2) * (0.2 / split).max(1.0);
    settings.seed = seed;
    settings.effects = vec![
        polar(EffectId::Anisodamping, draw.between(0.0, 0.008), draw.angle_deg(), 2.0),
        polar(EffectId::Anisoelasticity, TAU * split, draw.angle_deg(), 2.0),
        effect(EffectId::ActuationGainMismatch, &[draw.between(0.97, 1.03)]),
        effect(EffectId::DetectionGainMismatch, &[ratio]),
    ];
    if lags {
        settings.effects.push(effect(EffectId::DetectionPhase, &[phase]));
    }
    (settings, ratio, phase)
}

#[test]
fn a_phase_between_the_channels_is_found_and_undone() {
    let outcomes = all(trials(6), |seed| {
        let (settings, ratio, phase) = device(seed, true);
        let identified = identify(settings).unwrap();
        let report = &identified.report;
        let told = report.effects.iter().find(|e| e.id == "detection-phase").map(|e| e.parameters[0].clone());
        println!(
            "{seed}: {:.2} floors, ratio {ratio:.5} {:?}, phase {phase:.6} {told:?}, {:?}, {:?}",
            over_floor(&identified),
            report.detection_gain_ratio,
            found(&identified, Origin::Discovered),
            report.warnings
        );
        let others = found(&identified, Origin::Discovered).into_iter().filter(|id| *id != "detection-phase").count();
        let ratio_holds = holds(&report.detection_gain_ratio.unwrap(), ratio);
        let near = told.is_some_and(|p| (p.value / phase - 1.0).abs() < 0.02);
        (near, others, ratio_holds, over_floor(&identified), report.warnings.iter().any(|w| w.contains("left out")))
    });
    let n = outcomes.len();
    let count = |is: fn(&(bool, usize, bool, f64, bool)) -> bool| outcomes.iter().filter(|o| is(o)).count();
    println!("{} named of {n}, {} ratios held", count(|o| o.0), count(|o| o.2));
    assert_eq!(count(|o| !o.0), 0, "not named");
    assert_eq!(count(|o| o.1 > 0), 0, "another is claimed");
    assert_eq!(count(|o| o.4), 0, "a run is left out");
    assert!(count(|o| !o.2) <= (n / 10).max(1), "{} ratios missed", count(|o| !o.2));
    assert!(count(|o| o.3 > 1.5) <= n / 20, "above 1.5 floors");
}

#[test]
fn a_large_split_alone_is_no_phase_and_no_reason_to_leave_a_run_out() {
    let outcomes = all(trials(6), |seed| {
        let (settings, ratio, _) = device(seed, false);
        let identified = identify(settings).unwrap();
        let report = &identified.report;
        println!(
            "{seed}: {:.2} floors, ratio {ratio:.5} {:?}, {:?}, {:?}",
            over_floor(&identified),
            report.detection_gain_ratio,
            found(&identified, Origin::Discovered),
            report.warnings
        );
        let claimed = found(&identified, Origin::Discovered).len();
        let held = holds(&report.detection_gain_ratio.unwrap(), ratio);
        (claimed, held, report.warnings.iter().any(|w| w.contains("left out")))
    });
    assert!(outcomes.iter().all(|o| o.0 == 0), "claimed on nothing");
    assert!(outcomes.iter().all(|o| !o.2), "a run is left out");
    assert!(outcomes.iter().filter(|o| !o.1).count() <= (outcomes.len() / 10).max(1), "ratios missed");
}
