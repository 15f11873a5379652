//! The held-out runs are read when all is decided: another held-out run changes the error that is reported, and nothing else, but
//! for what it plainly refutes.

use cvg_calibration::recording::{Campaign, Channel, Role};
use cvg_calibration::report::{EffectReport, Report};
use cvg_calibration::{Options, Origin, identify};
use cvg_simulator::Scenario;

/// What the held-out runs read on X that no other does, V: an error twice as large as that of the cubic readout, which is not
/// borne out there, then.
const OFFSET_V: f64 = 3e-3;

fn report(change: impl Fn(&mut Campaign)) -> Report {
    let folder = tempfile::tempdir().unwrap();
    Scenario::paper().simulate().write(folder.path()).unwrap();
    let mut campaign = Campaign::open(&folder.path().join("campaign.toml")).unwrap();
    change(&mut campaign);
    identify(campaign, &Options::default()).unwrap().report
}

#[test]
fn what_is_held_out_changes_the_reported_error_and_no_answer() {
    let as_it_was = report(|_| {});
    let with_another = report(|campaign| {
        let held_out: Vec<_> = campaign.runs.iter_mut().filter(|r| r.role == Role::Holdout).collect();
        assert!(!held_out.is_empty());
        for run in held_out {
            run.recording.xc_v.iter_mut().flatten().for_each(|x| *x += OFFSET_V);
        }
    });
    let answers = |r: &Report| {
        let effects: Vec<_> = r.effects.iter().map(|e| (e.id.clone(), e.origin, e.parameters.clone())).collect();
        let steps: Vec<_> = r.steps.iter().map(|s| (s.effect.clone(), s.gain)).collect();
        (r.angular_gain, r.detection_gain_ratio, r.actuation_gain_ratio, effects, steps)
    };
    assert_eq!(answers(&as_it_was), answers(&with_another));
    let discovered = |e: &&EffectReport| e.origin == Origin::Discovered;
    let found: Vec<_> = with_another.effects.iter().filter(discovered).map(|e| e.id.as_str()).collect();
    assert_eq!(found, ["detection-cubic"]);
    let [before, after] = [&as_it_was, &with_another].map(|r| r.heldout.discovered.rms_deg);
    assert!(after > 3.0 * before, "{before} and {after}");
    assert!(with_another.runs.iter().all(|r| r.r#use != "left out"), "{:?}", with_another.runs);
}

/// What the fitted runs have and the held-out ones have not is taken back, in what is stated and in the calibration.
#[test]
fn what_the_held_out_runs_refute_is_taken_back() {
    let of = |role: Role| {
        report(|campaign| {
            for run in campaign.runs.iter_mut().filter(|r| r.role == role) {
                run.recording.xc_v.iter_mut().flatten().for_each(|x| *x += 3.0 * OFFSET_V);
            }
        })
    };
    let refuted = of(Role::Fit);
    let left = refuted.heldout;
    assert!(left.discovered.rms_deg < 1.01 * left.declared.rms_deg, "{left:?}");
    let said = refuted.warnings.iter().find(|w| w.contains("taken back")).unwrap();
    assert!(said.contains("detection-offset"), "{said}");
    assert!(refuted.effects.iter().all(|e| e.id != "detection-offset"), "{:?}", refuted.effects);
    assert!(refuted.runs.iter().all(|r| r.r#use != "left out"), "{:?}", refuted.warnings);
    // while an error of the held-out runs alone refutes nothing: it is there without the effects as well
    assert!(of(Role::Holdout).warnings.iter().all(|w| !w.contains("taken back")));
}

/// A run that was to be held out and that turns the pattern by a third of a turn is left out, and the answer was "only 0 samples are left".
#[test]
fn where_no_run_is_left_to_hold_out_the_last_quarters_are() {
    let told = report(|campaign| {
        for run in campaign.runs.iter_mut().filter(|r| r.role == Role::Holdout) {
            let rate_dps = run.recording.rate_dps.as_ref().unwrap()[0].abs();
            let lasts_s = run.recording.t_s[0] + run.settle_s + 120.0 / (0.78 * rate_dps);
            let rows = run.recording.t_s.partition_point(|t| *t < lasts_s);
            for channel in Channel::ALL {
                if let Some(values) = run.recording.channel(channel).map(|values| values[..rows].to_vec()) {
                    run.recording.set_channel(channel, values);
                }
            }
        }
    });
    assert!(told.warnings.iter().any(|w| w.contains("the last quarter of each of the others is held out")));
    assert_eq!(told.runs.iter().filter(|r| r.r#use == "left out").count(), 2, "{:?}", told.runs);
    assert!(told.heldout.discovered.rms_deg < 1.3 * told.heldout.noise_floor_deg, "{:?}", told.heldout);
}
