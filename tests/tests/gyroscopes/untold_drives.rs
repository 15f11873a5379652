//! What a drive does where the angle, or the directions of the ring-downs, tell little of it; and single rows that were damaged.

use cvg_calibration::{Identification, Origin, Refusal};
use cvg_model::Envelope;
use cvg_model::effects::EffectId;
use cvg_simulator::scenario::Run;
use cvg_simulator::{Column, Settings, SimulatedRun};
use cvg_tests::bench::{
    all, deviations, effect, found, holds, identify, identify_folder, identify_without, over_floor, plain_paper,
    scenario,
};

/// A device without errors in rotations at these rates, deg/s, and ring-downs in these directions, deg.
fn device(rates: &[f64], directions: &[f64], seed: u64) -> Settings {
    let mut settings = plain_paper();
    (settings.seed, settings.noise_v) = (seed, 2e-5);
    let of = |settings: &Settings, is: fn(&Run) -> bool| settings.runs.iter().find(|r| is(r)).cloned().unwrap();
    let rotation = of(&settings, |r| matches!(r, Run::Rotation { .. }));
    let ring_down = of(&settings, |r| matches!(r, Run::Ringdown { .. }));
    settings.runs.clear();
    for rate in rates {
        let mut run = rotation.clone();
        if let Run::Rotation { file, rate_dps, duration_s, .. } = &mut run {
            (*file, *rate_dps, *duration_s) = (format!("rot{rate:+}.csv"), *rate, 20.0);
        }
        settings.runs.push(run);
    }
    for direction in directions {
        let mut run = ring_down.clone();
        if let Run::Ringdown { file, angle_deg, .. } = &mut run {
            (*file, *angle_deg) = (format!("ringdown{direction}.csv"), *direction);
        }
        settings.runs.push(run);
    }
    settings.effects =
        vec![effect(EffectId::ActuationGainMismatch, &[1.0]), effect(EffectId::DetectionGainMismatch, &[1.0])];
    settings
}

/// Equal gains and no ring-downs: the fit ended at a force scale of nothing, where no drive has a slope, and k was stated to 2e-8 and was
/// 1.7e-5 off.
#[test]
fn a_trimmed_device_without_ring_downs_states_what_its_drives_may_do() {
    let told = all(12, |seed| {
        let ratio = if seed % 2 == 0 { 1.0 } else { 1.0113 };
        let mut settings = device(if seed < 6 { &[466.0, -300.0] } else { &[200.0, -100.0] }, &[], seed);
        settings.effects[0] = effect(EffectId::ActuationGainMismatch, &[ratio]);
        let i = identify(settings.clone()).unwrap();
        assert!(i.calibration.hypothesis.force_scale > 0.0, "seed {seed}");
        assert!(found(&i, Origin::Discovered).is_empty(), "seed {seed}: {:?}", i.report.effects);
        let anisodamping = i.report.effects.iter().find(|e| e.id == "anisodamping");
        let size = anisodamping.map_or(0.0, |e| {
            let [low, high] = e.parameters[0].ci95.unwrap();
            e.parameters[0].value / (0.5 * (high - low))
        });
        [
            deviations(&i.report.angular_gain, settings.angular_gain),
            deviations(&i.report.detection_gain_ratio.unwrap(), 1.0),
            2.0 * size,
        ]
    });
    assert!(told.iter().flatten().all(|d| d.abs() < 4.0), "{told:?}");
    assert!(told.iter().flatten().filter(|d| d.abs() > 2.0).count() <= 4, "{told:?}");
}

/// Ring-downs at 0° and 120°, and at 60° and 135° beside a skew of the drives: the loop that holds the pattern works on it too.
#[test]
fn ring_downs_in_any_direction_tell_the_drives_or_say_how_little() {
    let cases: [(&[f64], f64, f64, f64, f64); 4] = [
        (&[0.0, 120.0], 0.8, 1.0, 0.0, 0.005),
        (&[0.0, 90.0], 0.8, 1.0, 0.0, 0.001),
        (&[60.0, 135.0], 1.0, 1.0, -0.033, 0.05),
        // the commands act along the direction that is read
        (&[90.0, 60.0, 120.0], 0.9257, 1.0636, 0.0, 0.0005),
    ];
    for (directions, ratio, detection, skew, within) in cases {
        let mut settings = device(&[200.0, -90.0], directions, 3);
        settings.effects[0] = effect(EffectId::ActuationGainMismatch, &[ratio]);
        settings.effects[1] = effect(EffectId::DetectionGainMismatch, &[detection]);
        if skew != 0.0 {
            settings.effects.push(effect(EffectId::ActuationSkew, &[skew]));
            settings.effects.sort_by_key(|e| e.id);
        }
        let i = identify(settings).unwrap();
        assert!(i.report.actuation_gain_ratio.is_some() || skew != 0.0, "{directions:?}: {:?}", i.report.warnings);
        if let Some(told) = &i.report.actuation_gain_ratio {
            let off = deviations(told, ratio);
            assert!(off.abs() < 3.0 && (told.value / ratio - 1.0).abs() < within, "{directions:?}: {told:?}");
        }
        let is_there = |id: &&str| *id == "actuation-skew" && skew != 0.0;
        assert!(found(&i, Origin::Discovered).iter().all(is_there), "{directions:?}: {:?}", i.report.effects);
        assert!(over_floor(&i) < 1.3, "{directions:?}: {} × floor", over_floor(&i));
    }
}

/// Values that a telemetry line damaged: what the split made of the quadrature, and of the amplitude, stayed in the angle to the end, and the
/// answer was that nothing helps; so it was in what `compensate` wrote.
#[test]
fn rows_whose_channels_leap_leave_nothing_behind() {
    let all_channels = ["xc_v", "yc_v", "xs_v", "ys_v"];
    let sound = identify(plain_paper()).unwrap().report.angular_gain.value;
    let of_rotations: [(&[&str], usize); 7] = [
        (&["xs_v"], 4000),
        (&["ys_v"], 4000),
        (&["xc_v"], 4000),
        (&all_channels, 350),
        (&["vas_v"], 350),
        (&["vqc_v"], 350),
        (&["rate_dps"], 350),
    ];
    let of_ring_downs: [(&[&str], usize); 2] = [(&all_channels, 350), (&["vas_v"], 350)];
    let cases = of_rotations.iter().map(|c| (true, c)).chain(of_ring_downs.iter().map(|c| (false, c)));
    for (in_rotations, (columns, every)) in cases {
        let mut simulated = scenario(plain_paper()).simulate();
        let is_damaged = |r: &&mut SimulatedRun| matches!(r.run, Run::Rotation { .. }) == in_rotations;
        for run in simulated.runs.iter_mut().filter(is_damaged) {
            for (number, name) in columns.iter().enumerate() {
                let values = &mut run.columns.iter_mut().find(|c| c.name == *name).unwrap().values;
                let unit = values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                for at in (700 + 37 * number..values.len()).step_by(*every) {
                    values[at] += if at % 2 == 0 { 0.7 * unit } else { -0.6 * unit };
                }
            }
        }
        let folder = tempfile::tempdir().unwrap();
        simulated.write(folder.path()).unwrap();
        let i = identify_folder(folder.path()).unwrap();
        assert!(over_floor(&i) < 1.3, "{columns:?}: {} × floor", over_floor(&i));
        let said = i.report.warnings.iter().filter(|w| w.contains("for single rows, which no")).count();
        assert!(said >= 1, "{columns:?}: {:?}", i.report.warnings);
        let gain = &i.report.angular_gain;
        assert!((gain.value - sound).abs() < gain.half_width(), "{columns:?}: {gain:?}");
    }
}

/// Damped in 0.3 s, and pulled so hard that the slow run precesses at nine tenths of kΩ: it was left out, or all were refused as runs of
/// different instruments.
#[test]
fn a_run_that_is_nearly_locked_is_of_the_same_instrument() {
    let told = all(4, |seed| {
        let mut settings = device(&[200.0, -120.0, 40.0, -40.0], &[], seed);
        settings.tau_s = 0.3;
        let (sin, cos) = (0.7 * seed as f64).sin_cos();
        settings.effects.insert(0, effect(EffectId::Anisodamping, &[0.45 * cos, 0.45 * sin]));
        settings.effects.sort_by_key(|e| e.id);
        let i = identify(settings.clone()).unwrap();
        assert!(i.report.runs.iter().all(|r| r.r#use != "left out"), "seed {seed}: {:?}", i.report.warnings);
        assert!(over_floor(&i) < 1.3, "seed {seed}: {} × floor", over_floor(&i));
        deviations(&i.report.angular_gain, settings.angular_gain)
    });
    assert!(told.iter().all(|d| d.abs() < 3.0), "{told:?}");
}

/// Damped in half a second, with drives that are unequal by 3 % and commands that nobody recorded: an anisodamping of 0.0373 ± 0.0018 1/s where
/// 0.05 was planted.
#[test]
fn anisodamping_is_not_told_from_unequal_drives_of_a_damping_that_nobody_told() {
    let told = all(4, |seed| {
        let mut settings = device(&[200.0, -120.0, 60.0, -60.0], &[], seed);
        settings.tau_s = 0.5;
        settings.effects[0] = effect(EffectId::ActuationGainMismatch, &[1.03]);
        settings.effects.insert(0, effect(EffectId::Anisodamping, &[0.03, -0.04]));
        settings.effects.sort_by_key(|e| e.id);
        let i = identify_without(settings.clone(), &["vas_v", "vqc_v"]).unwrap();
        let stated = i.report.effects.iter().find(|e| e.id == "anisodamping");
        let holds = stated.is_none_or(|e| e.parameters[0].ci95.is_some_and(|[low, high]| (low..=high).contains(&0.05)));
        assert!(holds, "seed {seed}: {stated:?}");
        assert!(i.report.warnings.iter().any(|w| w.contains("vas_v would tell them apart")), "{:?}", i.report.warnings);
        assert!(over_floor(&i) < 1.3, "seed {seed}: {} × floor", over_floor(&i));
        deviations(&i.report.angular_gain, settings.angular_gain)
    });
    assert!(told.iter().all(|d| d.abs() < 3.0), "{told:?}");
}

/// A split beside a quadrature that was not recorded, or that eight bits read as nothing: k was up to ten half widths low, and nothing said so.
#[test]
fn the_angular_gain_holds_what_a_split_makes_of_a_quadrature_that_was_not_read() {
    let mut settings = device(&[60.0, -30.0], &[], 5);
    settings.effects.push(effect(EffectId::Anisoelasticity, &[0.15, 0.15]));
    settings.effects.sort_by_key(|e| e.id);
    let truth = settings.angular_gain;
    let told = identify_without(settings.clone(), &["xs_v", "ys_v"]).unwrap().report.angular_gain;
    assert!(holds(&told, truth) && told.half_width() > 1.95e-3 * truth, "{told:?}");
    let mut simulated = scenario(settings.clone()).simulate();
    let is_read = |name: &str| ["xc_v", "xs_v", "yc_v", "ys_v"].contains(&name);
    for column in simulated.runs.iter_mut().flat_map(|run| &mut run.columns).filter(|c| is_read(c.name)) {
        column.values.iter_mut().for_each(|v| *v = (*v / 0.01).round() * 0.01);
    }
    let folder = tempfile::tempdir().unwrap();
    simulated.write(folder.path()).unwrap();
    let read = identify_folder(folder.path()).unwrap().report;
    assert!(holds(&read.angular_gain, truth), "{:?}", read.angular_gain);
    assert!(read.warnings.iter().any(|w| w.contains("stays below a step of its converter")), "{:?}", read.warnings);
    // finer readings tell it
    let finer = identify(settings).unwrap().report.angular_gain;
    assert!(
        holds(&finer, truth) && finer.half_width() < 0.1 * read.angular_gain.half_width(),
        "{finer:?} {:?}",
        read.angular_gain
    );
}

/// [`identify`] of recordings of the angle, and of these commands.
fn identify_angles(settings: Settings, commands: &[&str]) -> Result<Identification, Refusal> {
    let mut simulated = scenario(settings).simulate();
    for run in &mut simulated.runs {
        let [x_c, x_s, y_c, y_s] = ["xc_v", "xs_v", "yc_v", "ys_v"].map(|name| run.column(name).unwrap().to_vec());
        let angle = |i: usize| Envelope::new(x_c[i], x_s[i], y_c[i], y_s[i]).pendulum().angle().to_degrees();
        let theta = (0..x_c.len()).map(angle).collect();
        run.columns.retain(|c| ["t_s", "rate_dps", "table_deg"].contains(&c.name) || commands.contains(&c.name));
        run.columns.push(Column { name: "theta_deg", values: theta });
    }
    let folder = tempfile::tempdir().unwrap();
    simulated.write(folder.path()).unwrap();
    identify_folder(folder.path())
}

/// A larger split, of which the angle alone says nothing and the command that holds the quadrature down does.
#[test]
fn a_large_split_that_only_its_command_shows_widens_the_angular_gain_and_is_said() {
    let mut settings = device(&[60.0, -30.0], &[], 5);
    settings.effects.push(effect(EffectId::Anisoelasticity, &[0.85, 0.85]));
    settings.effects.sort_by_key(|e| e.id);
    let truth = settings.angular_gain;
    let said = |warnings: &[String], what: &str| warnings.iter().any(|w| w.contains(what));
    let commanded = identify_angles(settings.clone(), &["vas_v", "vqc_v"]).unwrap().report;
    let k = commanded.angular_gain;
    assert!(holds(&k, truth) && k.value < 0.99 * truth, "{k:?}");
    assert!(said(&commanded.warnings, "vqc_v shows frequencies that differ by"), "{:?}", commanded.warnings);
    let alone = identify_angles(settings, &[]).unwrap().report;
    assert!(said(&alone.warnings, "neither the quadrature nor its command was recorded"), "{:?}", alone.warnings);
}
