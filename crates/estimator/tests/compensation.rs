//! The inverse of the readout: what `read` does, `unread` undoes, for every effect of the library.

use cvg_estimator::Compensation;
use cvg_model::effects::{EffectId, Inverse, Moment, Stage, Values};
use cvg_model::{AxisForces, Envelope, Orbit};
use proptest::prelude::*;

fn readout_effects() -> Vec<EffectId> {
    EffectId::ALL.iter().copied().filter(|id| id.description().stage == Stage::Readout).collect()
}

/// Values of a strong but reasonable effect at unit amplitude, from numbers in [−1, 1].
fn reasonable(id: EffectId, unit: [f64; 4]) -> Values<f64> {
    let [u, v, w, _] = unit;
    match id.description().id {
        "detection-cubic" => [0.08 * u, 0.04 * v, 0.0, 0.0],
        "detection-quintic" => [0.04 * u, 0.0, 0.0, 0.0],
        "detection-skew" => [1.5 * u, 0.0, 0.0, 0.0],
        "detection-phase" => [0.4 * u, 0.0, 0.0, 0.0],
        "drive-feedthrough" => unit.map(|u| 0.1 * u),
        "detection-gain-mismatch" => [1.0 + 0.4 * u, 0.0, 0.0, 0.0],
        "temperature" | "skew-temperature" => [1e-3 * u, 0.0, 0.0, 0.0],
        "cubic-temperature" => [2e-3 * u, 0.0, 0.0, 0.0],
        "detection-offset-temperature" => [1e-3 * u, 1e-3 * v, 0.0, 0.0],
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
    fn moment()(t_s in 0.0_f64..100.0, table_rad in -50.0_f64..50.0, precession_rad_s in -10.0_f64..10.0,
        warmer_k in -40.0_f64..40.0,
        [x_c, x_s, y_c, y_s] in prop::array::uniform4(-1.0_f64..1.0))
        -> Moment<f64> {
        Moment { t_s, table_rad, precession_rad_s, warmer_k, drive: AxisForces { x_c, x_s, y_c, y_s } }
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

    #[test]
    fn the_chain_at_once_is_the_chain_one_by_one(
        seen in vibration(), at in moment(), unit in prop::array::uniform4(-0.3_f64..0.3), chosen in any::<u16>(),
        twice: bool,
    ) {
        let all = readout_effects();
        let mut chain: Vec<_> = (0..all.len())
            .filter(|i| chosen >> i & 1 == 1)
            .map(|i| (all[i], reasonable(all[i], unit)))
            .collect();
        if twice {
            chain.extend(chain.clone());
        }
        chain.sort_by_key(|(id, _)| *id);
        let compensation = Compensation::<f64, 32>::new(&chain).expect("within bounds");
        let one_by_one = chain.iter().rev().fold(seen, |e, (id, values)| id.unread(values, e, &at));
        let at_once = compensation.apply(seen, &at);
        let size = one_by_one.pendulum().e.sqrt().max(1.0);
        prop_assert!(distance(&at_once, &one_by_one) <= 1e-13 * size, "{:?}: {:?}, {:?}", chain, at_once, one_by_one);
        prop_assert_eq!(compensation.apply_at(seen, || at), at_once);
        let single: Vec<_> = chain.iter().map(|(id, values)| (*id, values.map(|v| v as f32))).collect();
        let narrow = |e: Envelope<f64>| Envelope::new(e.x_c as f32, e.x_s as f32, e.y_c as f32, e.y_s as f32);
        let forms = single.iter().all(|(id, values)| id.inverse(values) != Inverse::Unread);
        if forms && !twice {
            let least = Compensation::<f32, 32>::new(&single).expect("within bounds").apply(narrow(seen), &Moment::default());
            let wide = Envelope::new(least.x_c.into(), least.x_s.into(), least.y_c.into(), least.y_s.into());
            prop_assert!(distance(&wide, &one_by_one) < 3e-6, "{:?}: {:?}, {:?}", chain, wide, one_by_one);
        }
    }

    #[test]
    fn an_inverse_has_the_form_that_its_effect_says(
        seen in vibration(), other in vibration(), at in moment(), unit in prop::array::uniform4(-1.0_f64..1.0),
        share in -1.0_f64..2.0,
    ) {
        let never = Moment::default();
        for id in readout_effects() {
            let values = reasonable(id, unit);
            let of = |e| id.unread(&values, e, &at);
            match id.inverse(&values) {
                Inverse::Unread => {}
                Inverse::Affine => {
                    // straight lines stay straight, and a quarter turn of the phase turns what is not the offset
                    let between = of(seen * share + other * (1.0 - share));
                    prop_assert!(distance(&between, &(of(seen) * share + of(other) * (1.0 - share))) < 1e-12, "{}", id);
                    let linear = |e| of(e) - of(Envelope::zero());
                    prop_assert!(distance(&linear(seen.quarter_ahead()), &linear(seen).quarter_ahead()) < 1e-12, "{}", id);
                    let offset = of(Envelope::zero());
                    prop_assert!(offset.x_s == 0.0 && offset.y_s == 0.0, "{}", id);
                }
                Inverse::Cubic(cubic) => prop_assert_eq!(cubic.undo(seen), of(seen), "{}", id),
            }
            if id.inverse(&values) != Inverse::Unread {
                prop_assert_eq!(of(seen), id.unread(&values, seen, &never), "{}", id);
            }
        }
    }

    #[test]
    fn a_weak_cubic_is_undone_to_rounding_in_single_precision(m in 0.01_f32..1.0, k in -0.0185_f32..0.0185, turn in 0.0_f32..6.2) {
        let (cubic, values) = (EffectId::DetectionCubic, [k / (0.75 * m * m), 0.0, 0.0, 0.0]);
        let (s, c) = turn.sin_cos();
        let seen = Envelope::new(m * c, m * s, 0.0, 0.0);
        let back = cubic.unread(&values, seen, &Moment::default());
        let wide = Envelope::new(f64::from(seen.x_c), f64::from(seen.x_s), 0.0, 0.0);
        let exact = cubic.unread(&values.map(f64::from), wide, &Moment::default());
        // half a unit of the difference's rounding, a sixth of the series, the rest of the products
        for (v, e) in [(back.x_c, exact.x_c), (back.x_s, exact.x_s)] {
            prop_assert!((f64::from(v) - e).abs() <= f64::from(f32::EPSILON) * f64::from(m), "{v} {e}");
        }
    }
}

#[test]
fn a_cubic_is_undone_alike_on_both_sides_of_the_bound_of_its_series() {
    let cubic = EffectId::DetectionCubic;
    // ¾κ at amplitude 1: below and above ε^¼ in double precision
    for k in [1.2e-4_f64, 1.22e-4, -1.2e-4, -1.22e-4] {
        let values = [k / 0.75, 0.0, 0.0, 0.0];
        let z = cubic.unread(&values, Envelope::new(1.0, 0.0, 0.0, 0.0), &Moment::default());
        assert!((z.x_c * (1.0 + k * z.x_c * z.x_c) - 1.0).abs() < 3e-16, "{k}: {z:?}");
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
fn a_chain_that_is_a_cubic_before_matrices_and_offsets_is_undone_without_the_moment() {
    let e = Envelope::new(0.6, -0.2, 0.5, 0.3);
    let (cubic, skew) =
        ((EffectId::DetectionCubic, [0.05, 0.01, 0.0, 0.0]), (EffectId::DetectionSkew, [0.5, 0.0, 0.0, 0.0]));
    let (gain, offset) =
        ((EffectId::DetectionGainMismatch, [1.25, 0.0, 0.0, 0.0]), (EffectId::DetectionOffset, [0.1, -0.3, 0.0, 0.0]));
    let drift = (EffectId::GainDrift, [0.1, 0.0, 0.0, 0.0]);
    let late = (EffectId::AngleLatency, [0.01, 0.0, 0.0, 0.0]);
    let clip = (EffectId::DetectionSaturation, [1.2, 0.0, 0.0, 0.0]);
    let at = Moment { t_s: 2.5, table_rad: 0.7, precession_rad_s: -0.4, ..Moment::default() };
    let chains: [(&[_], bool); 11] = [
        (&[], true),
        (&[offset], true),
        (&[cubic], true),
        (&[skew, gain, offset], true),
        (&[cubic, skew, gain, offset], true),
        (&[cubic, cubic], false),
        (&[late, skew, gain], false),
        (&[late, cubic, gain], false),
        (&[cubic, skew, drift, offset], false),
        (&[cubic, skew, clip], false),
        (&[drift], false),
    ];
    for (chain, without) in chains {
        let compensation = Compensation::<f64, 4>::new(chain).expect("valid");
        let one_by_one = chain.iter().rev().fold(e, |e, (id, values)| id.unread(values, e, &at));
        let at_any_moment = compensation.apply_at_any_moment(e);
        assert_eq!(at_any_moment.is_some(), without, "{chain:?}");
        let asked = core::cell::Cell::new(false);
        let moment = || {
            asked.set(true);
            at
        };
        let applied = compensation.apply_at(e, moment);
        assert_eq!(asked.get(), !without, "{chain:?}");
        assert!(distance(&applied, &one_by_one) < 1e-14, "{chain:?}");
        assert!(at_any_moment.is_none_or(|z| z == applied));
        assert_eq!(compensation.apply(e, &at), applied);
    }
    assert_eq!(Compensation::<f64, 2>::none().apply_at_any_moment(e), Some(e));
}

#[test]
fn a_vibration_along_one_axis_is_undone_too() {
    let skew = Compensation::<f64, 2>::new(&[(EffectId::DetectionSkew, [0.5, 0.0, 0.0, 0.0])]).expect("valid");
    let along_x = skew.apply(Envelope::new(0.6, -0.2, 0.0, 0.0), &Moment::default());
    assert_eq!(along_x, Envelope::new(0.6, -0.2, -0.3, 0.1));
    let along_y = skew.apply(Envelope::new(0.0, 0.0, 0.6, -0.2), &Moment::default());
    assert_eq!(along_y, Envelope::new(0.0, 0.0, 0.6, -0.2));
}

#[test]
fn effects_are_kept_in_the_order_in_which_the_signal_meets_them() {
    let given = [EffectId::DetectionOffset, EffectId::DetectionCubic].map(|id| (id, id.neutral()));
    let compensation = Compensation::<f64, 4>::new(&given).expect("valid");
    let kept: Vec<_> = compensation.effects().map(|(id, _)| *id).collect();
    assert_eq!(kept, [EffectId::DetectionCubic, EffectId::DetectionOffset]);
}

#[test]
fn a_readout_that_is_no_number_is_none_afterwards() {
    let chains: [&[(EffectId, Values<f64>)]; 4] = [
        &[],
        &[(EffectId::DetectionGainMismatch, [1.25, 0.0, 0.0, 0.0]), (EffectId::DetectionOffset, [0.1, -0.3, 0.0, 0.0])],
        &[(EffectId::DetectionCubic, [0.05, 0.01, 0.0, 0.0]), (EffectId::DetectionSkew, [0.5, 0.0, 0.0, 0.0])],
        &[(EffectId::AngleLatency, [0.01, 0.0, 0.0, 0.0])],
    ];
    for chain in chains {
        let compensation = Compensation::<f64, 4>::new(chain).expect("valid");
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for k in 0..4 {
                let mut parts = [0.6, -0.2, 0.5, 0.3];
                parts[k] = value;
                let [x_c, x_s, y_c, y_s] = parts;
                let z = compensation.apply(Envelope::new(x_c, x_s, y_c, y_s), &Moment::default());
                assert!(!z.pendulum().e.is_finite(), "{chain:?} {k} {value}: {z:?}");
            }
        }
    }
}

#[test]
fn a_value_in_a_place_that_no_parameter_uses_is_refused_whatever_its_sign() {
    for id in readout_effects() {
        let used = id.description().parameters.len();
        for place in used..4 {
            for value in [0.5, -0.5, 1e-300, -1e-300, f64::NAN] {
                let mut values: Values<f64> = id.neutral();
                values[place] = value;
                let refused = Compensation::<f64, 4>::new(&[(id, values)]).map(|_| ()).map_err(|e| e.parameter);
                assert_eq!(refused, Err(id.description().id), "{place}: {value}");
            }
        }
    }
}

#[test]
fn a_value_on_its_bound_is_taken_and_one_beyond_either_is_refused_by_name() {
    for id in readout_effects() {
        let parameters = id.description().parameters;
        for (place, parameter) in parameters.iter().enumerate() {
            let with = |value: f64| {
                let mut values = [0.0; 4];
                for (slot, p) in values.iter_mut().zip(parameters) {
                    *slot = p.neutral.clamp(p.lower, p.upper);
                }
                values[place] = value;
                Compensation::<f64, 1>::new(&[(id, values)]).map(|_| ()).map_err(|e| e.parameter)
            };
            for (bound, outward) in [(parameter.lower, -1.0), (parameter.upper, 1.0)] {
                assert_eq!(with(bound), Ok(()), "{id:?} {bound}");
                let beyond = bound + outward * 1e-9 * bound.abs().max(1.0);
                assert_eq!(with(beyond), Err(parameter.name), "{id:?} {beyond}");
            }
        }
    }
}
