//! One run of another device among those of one, and commands of one run that are not what the others' are.

use cvg_calibration::{Identification, Origin};
use cvg_model::effects::EffectId;
use cvg_simulator::scenario::{Purpose, Run};
use cvg_simulator::{Scenario, Settings, Simulated, SimulatedRun};
use cvg_tests::bench::{deviations, effect, found, holds, identify_folder, over_floor, scenario};

/// The paper's device, or another of its kind.
fn device(detection: f64) -> Settings {
    let mut settings = Scenario::paper().settings().clone();
    let gains = settings.effects.iter_mut().find(|e| e.id == EffectId::DetectionGainMismatch).unwrap();
    *gains = effect(EffectId::DetectionGainMismatch, &[detection]);
    settings
}

fn identified(simulated: &Simulated) -> Identification {
    let folder = tempfile::tempdir().unwrap();
    simulated.write(folder.path()).unwrap();
    identify_folder(folder.path()).unwrap()
}

fn named<'a>(runs: &'a mut [SimulatedRun], file: &str) -> &'a mut SimulatedRun {
    runs.iter_mut().find(|r| r.run.file() == file).unwrap()
}

/// The names of the rotations that are fitted.
fn rotations(settings: &Settings) -> Vec<String> {
    let of = |run: &Run| matches!(run, Run::Rotation { purpose: Purpose::Fit, .. }).then(|| run.file().to_owned());
    settings.runs.iter().filter_map(of).collect()
}

/// The common fit spread the stranger's error over all: an innocent ring-down was accused, and the cubic was lost.
#[test]
fn a_rotation_of_another_device_is_left_out_by_name_and_the_rest_is_as_without_it() {
    let settings = device(1.0132);
    let (own, other) = (scenario(settings.clone()).simulate(), scenario(device(0.99)).simulate());
    for file in &rotations(&settings)[..2] {
        let mut mixed = own.clone();
        let theirs = other.runs.iter().find(|r| r.run.file() == file).unwrap();
        named(&mut mixed.runs, file).columns.clone_from(&theirs.columns);
        let told = identified(&mixed);
        let run = told.report.runs.iter().find(|r| r.file == *file).unwrap();
        assert_eq!((run.r#use.as_str(), run.agrees), ("left out", Some(false)), "{file}: {:?}", told.report.warnings);
        assert!(told.report.warnings.iter().any(|w| w.contains(file) && w.contains("of another device")));
        assert_eq!(found(&told, Origin::Discovered), ["detection-cubic"]);
        assert!(deviations(&told.report.detection_gain_ratio.unwrap(), 1.0132).abs() < 3.5 && over_floor(&told) < 1.3);
    }
}

#[test]
fn commands_that_lost_their_sign_in_one_run_count_as_not_recorded() {
    let settings = device(1.0132);
    let mut simulated = scenario(settings.clone()).simulate();
    let file = &rotations(&settings)[1];
    let run = named(&mut simulated.runs, file);
    run.columns.iter_mut().filter(|c| c.name == "vas_v").flat_map(|c| &mut c.values).for_each(|v| *v = -*v);
    let told = identified(&simulated);
    assert!(told.report.warnings.iter().any(|w| w.contains(file) && w.contains("lost their sign")));
    assert!(holds(&told.report.actuation_gain_ratio.unwrap(), 1.0113), "{:?}", told.report.actuation_gain_ratio);
}

/// Two witnesses that exclude each other: the interval covers both, and the files are named.
#[test]
fn a_ring_down_whose_command_is_another_than_the_rotations_is_said_and_covered() {
    let mut simulated = scenario(device(1.0132)).simulate();
    let run = simulated.runs.iter_mut().rfind(|r| matches!(r.run, Run::Ringdown { .. })).unwrap();
    let file = run.run.file().to_owned();
    run.columns.iter_mut().filter(|c| c.name == "vas_v").flat_map(|c| &mut c.values).for_each(|v| *v *= 1.03);
    let told = identified(&simulated);
    assert!(holds(&told.report.actuation_gain_ratio.unwrap(), 1.0113), "{:?}", told.report.actuation_gain_ratio);
    assert!(
        told.report.warnings.iter().any(|w| w.contains(&file)),
        "{:?} {:?}",
        told.report.actuation_gain_ratio,
        told.report.warnings
    );
}
