//! What is not compensated, and what comes of a compensation without an answer.

use core::f64::consts::TAU;

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
    assert_eq!(
        refused,
        [
            EffectId::CubicTemperature,
            EffectId::DetectionOffsetTemperature,
            EffectId::GainDrift,
            EffectId::SkewTemperature,
            EffectId::Temperature,
            EffectId::TimePeriodic
        ]
    );
}

/// A setting, and what is changed there.
type Change = fn(&mut Settings<'static>, f64);

#[test]
fn settings_are_taken_up_to_their_edges_and_refused_beyond_by_name() {
    let new = |change: Change, value: f64| {
        let mut s = Settings::default();
        change(&mut s, value);
        (Instrument::<f32>::new(&s).err().map(|e| e.parameter), Instrument::<f64>::new(&s).err().map(|e| e.parameter))
    };
    // a value that is taken, and the next one that is not
    let ten_samples = 10.0 / Settings::default().sample_hz;
    let edges: [(&str, Change, f64, f64); 6] = [
        ("amplitude_v", |s, v| s.amplitude_v = v, 0.9 * 2.5, (0.9_f64 * 2.5).next_up()),
        ("readout_delay_s", |s, v| s.readout_delay_s = v, ten_samples, ten_samples.next_up()),
        ("drive_delay_s", |s, v| s.drive_delay_s = v, ten_samples, ten_samples.next_up()),
        ("readout_delay_s", |s, v| s.readout_delay_s = v, 0.0, -1e-12),
        ("drive_delay_s", |s, v| s.drive_delay_s = v, 0.0, -1e-12),
        // 1.1 times the band turns by less than half a turn in a window, 400 Hz at 0.5 ms
        ("window", |s, v| s.window = v as u16, 124.0, 125.0),
    ];
    for (name, change, taken, refused) in edges {
        assert_eq!(new(change, taken), (None, None), "{name} = {taken}");
        assert_eq!(new(change, refused), (Some(name), Some(name)), "{name} = {refused}");
    }
    // a line of a fifth of it, to the fourth power, is no number of full precision in f32
    let heard: Change = |s, v| s.detection_threshold_v = v;
    assert_eq!(new(heard, 1.7e-9), (None, None));
    assert_eq!(new(heard, 1e-9), (Some("least_v"), None));
    assert_eq!(new(heard, 1e-80), (Some("least_v"), Some("least_v")));
    // half a sample of the hold, and delays in which 1.1 times the band turns by a radian
    for of_readout in [0.0, 1e-5] {
        let wide = |beyond: f64| {
            let band = 0.12;
            let whole = 1.0 / (1.1 * TAU * Settings::default().carrier_hz * band);
            let drive_delay_s = whole * (1.0 + beyond) - 0.5 / Settings::default().sample_hz - of_readout;
            let s = Settings { band, window: 10, readout_delay_s: of_readout, drive_delay_s, ..Settings::default() };
            Instrument::<f32>::new(&s).err().map(|e| e.parameter)
        };
        assert_eq!((wide(-1e-12), wide(1e-12)), (None, Some("drive_delay_s")), "{of_readout}");
    }
    let positive: [(&str, Change); 6] = [
        ("carrier_hz", |s, v| s.carrier_hz = v),
        ("sample_hz", |s, v| s.sample_hz = v),
        ("adc_full_scale_v", |s, v| s.adc_full_scale_v = v),
        ("dac_limit_v", |s, v| s.dac_limit_v = v),
        ("amplitude_v", |s, v| s.amplitude_v = v),
        ("drive_per_s_v", |s, v| s.drive_per_s_v = v),
    ];
    for (name, change) in positive {
        for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY, 0.0, -1.0, 1e-9, 1e9] {
            assert_eq!(new(change, bad), (Some(name), Some(name)), "{name} = {bad}");
        }
    }
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
