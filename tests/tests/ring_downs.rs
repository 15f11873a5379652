//! Ring-downs that are not what the campaign takes them for, among rotations that are sound.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use cvg_calibration::recording::{Campaign, Run as Recorded, RunKind};
use cvg_calibration::{Identification, Options, Refusal};
use cvg_simulator::Settings;
use cvg_simulator::scenario::Run;
use cvg_tests::bench::{holds, plain_paper, scenario};

const RATIO: f64 = 1.0113;

/// The paper's bench, without the runs that repeat.
fn settings() -> Settings {
    let mut settings = plain_paper();
    settings.runs.retain(|run| match run {
        Run::Rotation { file, .. } => ["rot+500.csv", "rot-500.csv", "rot+60.csv"].contains(&file.as_str()),
        _ => true,
    });
    settings
}

fn recorded(settings: Settings) -> Campaign {
    let folder = tempfile::tempdir().unwrap();
    scenario(settings).simulate().write(folder.path()).unwrap();
    Campaign::open(&folder.path().join("campaign.toml")).unwrap()
}

fn ring_downs(campaign: &mut Campaign) -> Vec<&mut Recorded> {
    campaign.runs.iter_mut().filter(|r| matches!(r.kind, RunKind::Ringdown { .. })).collect()
}

fn identified(campaign: Campaign) -> Result<Identification, Refusal> {
    cvg_calibration::identify(campaign, &Options::default())
}

/// The quadrature command is proportional to the amplitude, so that it looks like a drive of another strength.
#[test]
fn energy_and_quadrature_command_exchanged_in_the_ring_downs_are_named() {
    for which in [0..2, 0..1] {
        let mut campaign = recorded(settings());
        for run in &mut ring_downs(&mut campaign)[which] {
            std::mem::swap(&mut run.recording.vas_v, &mut run.recording.vqc_v);
        }
        let refused = identified(campaign).unwrap_err().to_string();
        assert!(refused.contains("ringdown-0.csv") && refused.contains("exchanged"), "{refused}");
    }
    // without the other command the proportion alone tells
    let mut campaign = recorded(settings());
    for run in ring_downs(&mut campaign) {
        run.recording.vas_v = run.recording.vqc_v.take();
    }
    let refused = identified(campaign).unwrap_err().to_string();
    assert!(refused.contains("not what held the amplitude"), "{refused}");
}

/// A logger that keeps the last value, or a controller that goes on behind a switch that is open.
#[test]
fn an_energy_command_that_is_recorded_but_does_not_act_is_no_fault() {
    for gain in [0.0, 3.0] {
        let mut campaign = recorded(settings());
        for run in ring_downs(&mut campaign) {
            let RunKind::Ringdown { energy_off_s, .. } = run.kind else { unreachable!() };
            let (r, off) = (&mut run.recording, |t: f64| (t - energy_off_s).max(0.0));
            let v_as = r.vas_v.as_mut().unwrap();
            let last = r.t_s.iter().rposition(|t| *t < energy_off_s).unwrap();
            let (held, t_s) = (v_as[last], &r.t_s);
            for i in last..v_as.len() {
                v_as[i] = held * (1.0 + gain * (1.0 - (-off(t_s[i]) / 22.0).exp()));
            }
        }
        let ratio = identified(campaign).unwrap().report.actuation_gain_ratio.unwrap();
        assert!(holds(&ratio, RATIO), "{ratio:?}");
    }
}

/// Another instrument's damping, or another's drives: the ratio of its gain and this one's is nobody's.
#[test]
fn a_ring_down_of_another_device_is_named_and_left_out() {
    for (tau_s, file) in [(30.0, "ringdown-90.csv"), (19.0, "ringdown-90.csv"), (12.0, "ringdown-0.csv")] {
        let mut campaign = recorded(settings());
        let mut other = recorded(Settings { tau_s, seed: 77, ..settings() });
        let is_it = |r: &&mut Recorded| r.file.ends_with(file);
        *ring_downs(&mut campaign).into_iter().find(is_it).unwrap() =
            ring_downs(&mut other).into_iter().find(is_it).unwrap().clone();
        let report = identified(campaign).unwrap().report;
        let told = |w: &String| w.contains(file) && w.contains("another device");
        assert!(report.warnings.iter().any(told), "{tau_s} s: {:?}", report.warnings);
        let run = |name: &str| report.runs.iter().find(|r| r.file.ends_with(name)).unwrap();
        assert_eq!(run(file).agrees, Some(false));
        assert!(report.actuation_gain_ratio.is_none_or(|e| holds(&e, RATIO)), "{:?}", report.actuation_gain_ratio);
        assert!((report.detection_gain_ratio.unwrap().value - 1.0132).abs() < 1e-4);
    }
}

#[test]
fn sound_ring_downs_are_kept_whatever_the_anisodamping() {
    let report = identified(recorded(settings())).unwrap().report;
    assert!(report.runs.iter().all(|r| r.r#use != "left out"), "{:?}", report.warnings);
    assert!(holds(&report.actuation_gain_ratio.unwrap(), RATIO));
}
