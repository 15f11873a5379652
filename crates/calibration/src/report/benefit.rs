//! Whether what was found helps on held-out data.

use crate::report::Heldout;

/// Why what was found is of no use, where it is not: on `samples` held-out samples the error is larger with it than without,
/// by more than the standard error of a root mean square.
pub(crate) fn no_better(heldout: &Heldout, samples: usize) -> Option<String> {
    let raw = heldout.raw?.rms_deg;
    let rms = heldout.discovered.rms_deg;
    let by_chance = 1.0 / (2.0 * samples.max(1) as f64).sqrt();
    (rms > raw * (1.0 + by_chance)).then(|| no_help(heldout))
}

/// Why a calibration leaves the angle as it is.
pub(crate) fn no_help(heldout: &Heldout) -> String {
    let without = heldout.raw.map_or(String::new(), |raw| format!(", {:.3e}° without", raw.rms_deg));
    format!(
        "nothing that was found helps on held-out data: {:.3e}° rms with it{without}; the calibration leaves the angle as \
         it is",
        heldout.discovered.rms_deg
    )
}
