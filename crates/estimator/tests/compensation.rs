//! The inverse of the readout: what `read` does, `unread` undoes, for every effect of the library.

use cvg_estimator::Compensation;
use cvg_model::Envelope;
use cvg_model::Orbit;
use cvg_model::effects::{EffectId, Moment, Stage, Values};
use proptest::prelude::*;

fn readout_effects() -> Vec<EffectId> {
    EffectId::ALL.iter().copied().filter(|id| id.description().stage == Stage::Readout).collect()
}

/// Values of a strong but reasonable effect at unit amplitude, from numbers in [−1, 1].
fn reasonable(id: EffectId, unit: [f64; 4]) -> Values<f64> {
    let [u, v, w, _] = unit;
    match id.description().id {
        "detection-cubic" => [0.08 * u, 0.04 * v, 0.0, 0.0],
        "detection-skew" => [1.5 * u, 0.0, 0.0, 0.0],
        "detection-gain-mismatch" => [1.0 + 0.4 * u, 0.0, 0.0, 0.0],
        "gain-drift" => [1e-3 * u, 0.0, 0.0, 0.0],
        "detection-offset" => [0.5 * u, 0.5 * v, 0.0, 0.0],
        // from no clipping to a carrier three times over the clip level
        "detection-saturation" => [1.5 * (1.0 + u), 0.0, 0.0, 0.0],
        "harmonic-n" => [(4.5 + 3.5 * u).round(), 0.01 * v, 0.01 * w, 0.0],
        "time-periodic" => [10.0 + 5.0 * u, 0.02 * v, 0.02 * w, 0.0],
        "angle-latency" => [0.01 * u, 0.0, 0.0, 0.0],
        other => panic!("{other}: a readout effect without a range here"),
    }
}

fn distance(a: &Envelope<f64>, b: &Envelope<f64>) -> f64 {
    (*a - *b).pendulum().e.sqrt()
}

prop_compose! {
    fn vibration()(theta in -3.1_f64..3.1, q in -0.01_f64..0.01, delta in -0.01_f64..0.01, a in 0.3_f64..1.0)
        -> Envelope<f64> {
        Orbit { a, q, theta, delta }.envelope()
    }
}

prop_compose! {
    fn moment()(t_s in 0.0_f64..100.0, table_rad in -50.0_f64..50.0, precession_rad_s in -10.0_f64..10.0)
        -> Moment<f64> {
        Moment { t_s, table_rad, precession_rad_s }
    }
}

proptest! {
    #[test]
    fn every_readout_effect_is_undone_by_its_inverse(
        z in vibration(), at in moment(), unit in prop::array::uniform4(-1.0_f64..1.0),
    ) {
        for id in readout_effects() {
            let values = reasonable(id, unit);
            let back = id.unread(&values, id.read(&values, z, &at), &at);
            prop_assert!(distance(&back, &z) < 1e-9, "{}: {:?} became {:?}", id, z, back);
        }
    }

    #[test]
    fn a_chain_of_effects_is_undone_in_reverse_order(
        z in vibration(), at in moment(), unit in prop::array::uniform4(-0.3_f64..0.3),
    ) {
        let mut chain: Vec<_> = readout_effects().into_iter().map(|id| (id, reasonable(id, unit))).collect();
        let read = chain.iter().fold(z, |e, (id, values)| id.read(values, e, &at));
        // the order in which they are given does not matter
        chain.reverse();
        let compensation = Compensation::<f64, 16>::new(&chain).expect("within bounds");
        prop_assert!(distance(&compensation.apply(read, &at), &z) < 1e-7);
    }
}

#[test]
fn what_is_not_of_the_readout_or_out_of_bounds_is_refused() {
    let new = |list: &[(EffectId, Values<f64>)]| Compensation::<f64, 2>::new(list).map_err(|e| e.parameter);
    let mismatch = EffectId::DetectionGainMismatch;
    assert_eq!(new(&[(EffectId::Anisodamping, [0.0; 4])]), Err("anisodamping"));
    assert_eq!(new(&[(mismatch, [9.0, 0.0, 0.0, 0.0])]), Err("detection_gain_ratio"));
    assert_eq!(new(&[(mismatch, [f64::NAN, 0.0, 0.0, 0.0])]), Err("detection_gain_ratio"));
    assert_eq!(new(&[(mismatch, [1.0, 1.0, 0.0, 0.0])]), Err("detection-gain-mismatch"));
    assert_eq!(new(&[(mismatch, [1.0, 0.0, 0.0, 0.0]); 3]), Err("effects"));
}

#[test]
fn effects_are_kept_in_the_order_in_which_the_signal_meets_them() {
    let given = [EffectId::DetectionOffset, EffectId::DetectionCubic].map(|id| (id, id.neutral()));
    let compensation = Compensation::<f64, 4>::new(&given).expect("valid");
    let kept: Vec<_> = compensation.effects().map(|(id, _)| *id).collect();
    assert_eq!(kept, [EffectId::DetectionCubic, EffectId::DetectionOffset]);
}
