//! Decays that are not of one resonator: each campaign gets a right answer with the run named, wide intervals, or none.

use cvg_calibration::recording::{Campaign, Recording};
use cvg_calibration::{Cause, Identification, Options, Refusal, identify};
use cvg_model::resonator::Anisotropy;

use crate::ring::Ring;
use crate::{ANGLES, SPLIT, is_within, parameter, set_values};

/// Loses the sign of some channels.
fn lost(channels: &'static str) -> impl Fn(&mut Recording) {
    move |r| {
        for (name, column) in [("xc", &mut r.xc_v), ("xs", &mut r.xs_v), ("yc", &mut r.yc_v), ("ys", &mut r.ys_v)] {
            if channels.contains(name) {
                column.iter_mut().flatten().for_each(|v| *v = -*v);
            }
        }
    }
}

fn opened(ring: &Ring, angles: &[f64], seed: u64) -> Campaign {
    let folder = tempfile::tempdir().unwrap();
    Campaign::open(&ring.campaign(folder.path(), angles, "rate_dps = 10.0", seed)).unwrap()
}

fn told(campaign: Campaign) -> Result<Identification, Refusal> {
    identify(campaign, &Options::default())
}

/// The same campaign with these runs damaged.
fn damaged(angles: &[f64], runs: &[usize], damage: impl Fn(&mut Recording)) -> Result<Identification, Refusal> {
    let mut campaign = opened(&Ring { noise_v: 3e-4, ..Ring::usual() }, angles, 1);
    runs.iter().for_each(|at| damage(&mut campaign.runs[*at].recording));
    told(campaign)
}

/// The answer is right, and these runs, by their numbers, are named and left out.
fn assert_right_without(odd: &[usize], told: Result<Identification, Refusal>) {
    let report = told.unwrap().report;
    for (set, e) in set_values(&report) {
        assert!(is_within(set, &e), "{set}: {e:?}");
    }
    for (at, run) in report.runs.iter().enumerate() {
        let is_odd = odd.contains(&at);
        let said = report.warnings.iter().any(|w| w.starts_with(&format!("decay-{at}.csv: left out")));
        assert!(said == is_odd && (run.r#use == "left out") == is_odd, "{at}: {:?}", report.warnings);
    }
}

/// There is no answer, and a run is named.
fn assert_refused(told: Result<Identification, Refusal>) {
    let refusal = told.map(|i| i.report.angular_gain).unwrap_err();
    assert_eq!(refusal.cause, Cause::NoAnswer);
    assert!(refusal.place.starts_with("decay-") && refusal.problem.contains("of all decays leaves"), "{refusal}");
}

/// A ring that is not the usual one.
fn another() -> Ring {
    let mut ring = Ring { noise_v: 3e-4, ..Ring::usual() };
    ring.resonator.anisoelasticity = Anisotropy::new(std::f64::consts::TAU * 0.03, 0.2);
    ring.resonator.damping_per_s = 1.0 / 18.0;
    ring
}

/// The usual ring's decays, and another's in the place of these.
fn mixed(angles: &[f64], runs: &[usize], other: &Ring) -> Result<Identification, Refusal> {
    let mut campaign = opened(&Ring { noise_v: 3e-4, ..Ring::usual() }, angles, 1);
    let others = opened(other, angles, 2);
    for at in runs {
        campaign.runs[*at].recording = others.runs[*at].recording.clone();
    }
    told(campaign)
}

#[test]
fn a_decay_with_a_channel_that_lost_its_sign_is_named_and_left_out() {
    assert_right_without(&[], damaged(&ANGLES, &[], lost("")));
    for channels in ["xc", "xs ys"] {
        assert_right_without(&[4], damaged(&ANGLES, &[4], lost(channels)));
    }
    assert_refused(damaged(&[0.0, 60.0], &[1], lost("xc xs")));
}

#[test]
fn decays_of_another_resonator_are_named_and_left_out_or_there_is_no_answer() {
    assert_right_without(&[0, 1], mixed(&ANGLES, &[0, 1], &another()));
    assert_refused(mixed(&ANGLES, &[0, 1, 2, 3], &another()));
    assert_refused(mixed(&[0.0, 60.0], &[1], &another()));
}

#[test]
fn a_decay_that_changes_on_its_way_is_named_and_left_out_or_there_is_no_answer() {
    let from_a_third_on = |factor: f64| {
        move |r: &mut Recording| {
            let rows = r.t_s.len();
            r.yc_v.iter_mut().chain(&mut r.ys_v).for_each(|y| y[rows / 3..].iter_mut().for_each(|v| *v *= factor));
        }
    };
    assert_right_without(&[0], damaged(&ANGLES, &[0], from_a_third_on(0.8)));
    assert_refused(damaged(&[22.5], &[0], from_a_third_on(0.8)));
}

#[test]
fn decays_that_hardly_differ_widen_the_intervals_and_say_so() {
    // 2 % of the split: less than half a degree of what is left
    let mut other = Ring { noise_v: 3e-4, ..Ring::usual() };
    other.resonator.anisoelasticity = Anisotropy::new(1.02 * SPLIT, -0.7);
    let report = mixed(&ANGLES, &[0, 1, 2, 3], &other).unwrap().report;
    let said = |w: &String| w.contains("the decays do not agree");
    assert!(report.warnings.iter().any(said), "{:?}", report.warnings);
    let split = parameter(&report, "anisoelasticity", "anisoelasticity");
    assert!(is_within(SPLIT, &split), "{split:?}");
}
