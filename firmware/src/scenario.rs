//! What host and target agree on: the settings of each recording, and how a status is one word.

use cvg_instrument::{Settings, Status};
use cvg_model::effects::{EffectId, Values};

/// Recordings: without compensation, and with the effects of [`READOUT`] and [`ACTUATION`] undone.
pub const RECORDINGS: [&str; 2] = ["plain", "compensated"];

/// Readout effects of the second recording's device: unequal gains and the plates' nonlinearity.
pub const READOUT: [(EffectId, Values<f64>); 2] =
    [(EffectId::DetectionGainMismatch, [1.0132, 0.0, 0.0, 0.0]), (EffectId::DetectionCubic, [0.004, 0.0, 0.0, 0.0])];

/// Actuation effects of the second recording's device.
pub const ACTUATION: [(EffectId, Values<f64>); 1] = [(EffectId::ActuationGainMismatch, [1.0113, 0.0, 0.0, 0.0])];

/// The settings of a recording.
pub fn settings(recording: usize) -> Settings<'static> {
    if recording == 0 {
        Settings::default()
    } else {
        Settings { readout: &READOUT, actuation: &ACTUATION, ..Settings::default() }
    }
}

/// Everything that a status says.
pub fn word(s: &Status) -> u32 {
    let fault = s.fault.map_or(0, |f| f as u32 + 1);
    s.mode as u32 | fault << 8 | u32::from(s.fresh) << 16 | u32::from(s.clipped) << 17 | u32::from(s.valid) << 18
}
