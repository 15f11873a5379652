//! Whether what was found helps on held-out data.

use crate::report::Heldout;

/// What leaves this share of the error, and so many times the noise, explains little: another instrument was recorded than the one that
/// was modelled. Engineering choices: an effect that no library has leaves a tenth of the error, or a hundred times its noise.
const LEAVES_MOST: f64 = 0.5;
const FAR_ABOVE_NOISE: f64 = 1000.0;

/// Why what was found is of no use, where it is not: on `samples` held-out samples the error is larger with it than without,
/// by more than the standard error of a root mean square; or it is not much smaller, and far above all noise.
pub(crate) fn no_better(heldout: &Heldout, samples: usize) -> Option<String> {
    let raw = heldout.raw?.rms_deg;
    let rms = heldout.discovered.rms_deg;
    let by_chance = 1.0 / (2.0 * samples.max(1) as f64).sqrt();
    if rms > raw * (1.0 + by_chance) {
        return Some(no_help(heldout));
    }
    let times = rms / heldout.noise_floor_deg;
    (rms > LEAVES_MOST * raw && times > FAR_ABOVE_NOISE).then(|| {
        format!(
            "what was found explains little: {rms:.3e}° of {raw:.3e}° are left on held-out data, {times:.0} times the noise floor; wanted: \
             recordings of what campaign.toml says (instrument, period_deg, units, what each column is); the calibration leaves the angle as \
             it is"
        )
    })
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

#[cfg(test)]
mod tests {
    use super::no_better;
    use crate::report::{ErrorSize, Heldout};

    fn heldout(raw: f64, discovered: f64, noise_floor_deg: f64) -> Heldout {
        let of = |rms_deg: f64| ErrorSize { rms_deg, peak_deg: 2.0 * rms_deg, peak_to_peak_deg: 4.0 * rms_deg };
        Heldout { raw: Some(of(raw)), declared: of(discovered), discovered: of(discovered), noise_floor_deg }
    }

    #[test]
    fn what_leaves_more_or_most_far_above_the_noise_is_of_no_use() {
        let said = |raw, discovered, floor| no_better(&heldout(raw, discovered, floor), 5000);
        assert!(said(0.3, 0.4, 0.1).is_some_and(|why| why.starts_with("nothing that was found helps")));
        assert!(said(6.1, 4.2, 2e-5).is_some_and(|why| why.starts_with("what was found explains little")));
        // an effect that no library has, and noise that hides most
        assert_eq!(said(0.27, 0.2, 1e-3), None);
        assert_eq!(said(6.1, 0.6, 2e-5), None);
    }
}
