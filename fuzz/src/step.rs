//! Any bytes as samples of the converters: after each the commands are finite and within their limit, in both precisions.
//!
//! The first byte chooses the instrument and how the others are read: as counts of sixteen bits, or as the bits of a float.

use cvg_instrument::{Instrument, Settings};
use cvg_model::Float;
use cvg_model::effects::{EffectId, Values};

const READOUT: &[(EffectId, Values<f64>)] = &[
    (EffectId::DetectionCubic, [0.05, 0.01, 0.0, 0.0]),
    (EffectId::DetectionGainMismatch, [1.0132, 0.0, 0.0, 0.0]),
    (EffectId::DetectionOffset, [0.01, -0.02, 0.0, 0.0]),
];
const DRIVES: &[(EffectId, Values<f64>)] = &[(EffectId::ActuationGainMismatch, [1.0113, 0.0, 0.0, 0.0])];
/// Samples are given again and again, so that a short input passes many windows.
const ROUNDS: usize = 8;

pub fn run(bytes: &[u8]) {
    let Some((&first, samples)) = bytes.split_first() else { return };
    let plain = Settings { sweep_s: 0.05, ..Settings::default() };
    let settings = match first & 3 {
        0 => plain,
        1 => Settings { window: 8, readout: READOUT, actuation: DRIVES, ..plain },
        2 => Settings { window: 37, dac_limit_v: 0.3, ..plain },
        _ => Settings { window: 24, hold_rad: -0.2, adc_full_scale_v: 5.0, ..plain },
    };
    let volts: Vec<[f64; 2]> = if first & 4 == 0 {
        let count = |pair: [u8; 2]| f64::from(i16::from_le_bytes(pair)) / 32768.0 * settings.adc_full_scale_v;
        samples.chunks_exact(4).map(|s| [count([s[0], s[1]]), count([s[2], s[3]])]).collect()
    } else {
        let bits = |word: [u8; 4]| f64::from(f32::from_le_bytes(word));
        let pair = |s: &[u8]| [bits([s[0], s[1], s[2], s[3]]), bits([s[4], s[5], s[6], s[7]])];
        samples.chunks_exact(8).map(pair).collect()
    };
    steps::<f32>(&settings, &volts);
    steps::<f64>(&settings, &volts);
}

fn steps<T: Float>(settings: &Settings<'_>, volts: &[[f64; 2]]) {
    let instrument = Instrument::<T>::new(settings).expect("settings that are right");
    let mut state = instrument.start();
    let limit = T::from_f64(settings.dac_limit_v);
    for [x, y] in (0..ROUNDS).flat_map(|_| volts) {
        let (dac_x, dac_y, _) = instrument.step(&mut state, T::from_f64(*x), T::from_f64(*y));
        let is_within = [dac_x, dac_y].into_iter().all(|v| -limit <= v && v <= limit);
        assert!(is_within, "the drives are within their limit");
    }
}
