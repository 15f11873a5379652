//! Numbers that only some campaigns identify: how the scale factor goes with the rate, how far an angle at rest wanders, how a
//! vibration decays.

use std::borrow::Cow;

use cvg_calibration::report::{Estimate, Report};

/// A number with its unit.
pub(crate) struct Number<'a> {
    pub(crate) name: Cow<'a, str>,
    pub(crate) value: Estimate,
    pub(crate) unit: &'static str,
}

/// Those of a report, in the order in which they are read.
pub(crate) fn further(r: &Report) -> Vec<Number<'_>> {
    let scale = r.scale_factor.iter().flat_map(|s| {
        let told = [("scale factor, nonlinearity", s.nonlinearity_ppm), ("scale factor, asymmetry", s.asymmetry_ppm)];
        told.into_iter().map(|(name, value)| (name, value, "ppm"))
    });
    let scale = scale.chain(r.repeatability_ppm.map(|value| ("scale factor, repeatability", value, "ppm")));
    let rest = r.allan.iter().flat_map(|a| {
        let walk = a.angle_random_walk_deg_sqrt_h.map(|e| ("angle random walk", e, "deg/√h"));
        walk.into_iter().chain([("bias instability", a.bias_instability_dph, "deg/h")])
    });
    let decay = r.decay.iter().flat_map(|d| {
        let bend = d.frequency_per_energy.map(|e| ("frequency over energy dω/dE", e, "rad/s/V²"));
        let precession = Some(("precession", d.precession_dph, "deg/h")).filter(|(_, e, _)| e.is_told());
        [("decay time constant τ", d.tau_s, "s")].into_iter().chain(precession).chain(bend)
    });
    let across = r.misalignment.iter().filter_map(|m| {
        let name = Cow::Owned(format!("misalignment, {}", m.file));
        Some(Number { name, value: m.angle_deg?, unit: "deg" })
    });
    let named = scale.chain(rest).chain(decay).map(|(name, value, unit)| Number { name: name.into(), value, unit });
    named.chain(across).collect()
}
