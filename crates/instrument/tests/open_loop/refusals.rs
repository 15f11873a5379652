//! What is not compensated, and what comes of a compensation without an answer.

use cvg_instrument::{Instrument, Mode, Settings};
use cvg_model::effects::{EffectId, Stage, Values};

use super::Bench;

#[test]
fn an_effect_of_a_recordings_clock_or_thermometer_is_refused_and_every_other_of_the_readout_is_not() {
    let mut refused = Vec::new();
    for &id in EffectId::ALL.iter().filter(|id| id.description().stage == Stage::Readout) {
        let mut values: Values<f64> = id.neutral();
        if id == EffectId::TimePeriodic {
            values = [50.0, 1e-3, 0.0, 0.0];
        }
        // also behind one that is taken
        let effects = [(EffectId::DetectionSkew, [0.01, 0.0, 0.0, 0.0]), (id, values)];
        match Instrument::<f32>::new(&Settings { readout: &effects, ..Settings::default() }) {
            Ok(_) => assert!(!id.in_time() && !id.by_temperature(), "{id:?}"),
            Err(e) => {
                assert_eq!(e.parameter, "readout", "{id:?}: {e}");
                refused.push(id);
            }
        }
    }
    refused.sort_by_key(|id| id.description().id);
    assert_eq!(refused, [EffectId::GainDrift, EffectId::Temperature, EffectId::TimePeriodic]);
}

/// A readout that saturates at 0.9 V: none of 1 V has a vibration behind it.
const SATURATION: &[(EffectId, Values<f64>)] = &[(EffectId::DetectionSaturation, [0.9, 0.0, 0.0, 0.0])];

#[test]
fn a_readout_without_a_vibration_behind_it_is_no_measurement() {
    let mut bench = Bench::<f64>::with(Settings { readout: SATURATION, ..Settings::default() });
    bench.theta_rad = 0.0;
    bench.windows(400);
    let seen = bench.state.seen;
    let finite = seen.compensated.pendulum().e.is_finite();
    // either it says so, or what it gives is not taken for rest
    assert_eq!(bench.status.valid, finite, "{seen:?}");
    assert!(!finite || seen.compensated.x_c.abs() > 0.5, "{seen:?}");
    assert!(finite || bench.status.mode != Mode::WholeAngle);
}
