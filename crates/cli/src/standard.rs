//! Where a report's facts stand among the terms of IEEE Std 1431, the test procedures for Coriolis vibratory gyroscopes.
//!
//! A mapping of terms only: no clause of the standard is quoted, and none is claimed to be fulfilled.

use cvg_calibration::report::Report;
use cvg_calibration::report::repeatability::{Repeatability, of_the_gain, repeatability};

use crate::report::numbers::{NOT_IDENTIFIABLE, estimated};

/// One term and its value.
pub(crate) struct Entry {
    /// term
    pub(crate) term: &'static str,
    /// what stands for it in the report
    pub(crate) here: &'static str,
    /// value, with its unit
    pub(crate) value: String,
}

/// The facts of a report under the standard's terms; what the campaign does not hold is said to be missing. Without a pattern
/// nothing of it is asked for.
pub(crate) fn entries(r: &Report, has_pattern: bool) -> Vec<Entry> {
    let entry = |term, here, value: String| Entry { term, here, value };
    let k = r.angular_gain;
    let mut out = vec![
        entry(
            "scale factor",
            "angular gain k: pattern angle per input angle",
            if k.is_told() { estimated(&k) } else { NOT_IDENTIFIABLE.into() },
        ),
        entry(
            "scale factor",
            "drift of it: effect scale-drift",
            effect(r, "scale-drift").unwrap_or("none found".into()),
        ),
        entry(
            "angle error (angle-dependent bias)",
            "held-out error as recorded, peak to peak",
            r.heldout.raw.map_or("the raw angle does not turn".into(), |e| format!("{:.5}°", e.peak_to_peak_deg)),
        ),
        entry(
            "angle error (angle-dependent bias)",
            "held-out error after all, peak to peak",
            format!("{:.5}°", r.heldout.discovered.peak_to_peak_deg),
        ),
    ];
    if has_pattern {
        out.push(entry(
            "drift, dependent on angle",
            "effect anisodamping: largest drift of the pattern, ½Δ(1/τ)",
            anisodamping_drift(r).unwrap_or(NOT_IDENTIFIABLE.into()),
        ));
        out.push(entry(
            "angle storage",
            "rate below which the pattern locks, Δ(1/τ)/(2k)",
            threshold(r).unwrap_or(NOT_IDENTIFIABLE.into()),
        ));
        let mut downs = r.runs.iter().filter_map(|x| x.tau_s.map(|t| (x, t))).peekable();
        if downs.peek().is_none() {
            out.push(entry("run-down time constant", "ring-down", "no ring-down in this campaign".into()));
        }
        for (run, tau) in downs {
            let name = std::path::Path::new(&run.file).file_name().unwrap_or_default().to_string_lossy();
            let value = format!("{} s ({name})", estimated(&tau));
            out.push(entry("run-down time constant", "decay time constant of the amplitude, τ", value));
        }
    }
    if r.instrument == "gyroscope" && !has_pattern {
        out.extend(misalignment(r));
    }
    let said = |r: Repeatability, unit: &str| format!("{:.1} {unit} over {} runs", r.deviation.value, r.runs);
    if let Some(repeated) = of_the_gain(&r.runs, k) {
        out.push(entry(
            "scale factor, repeatability",
            "standard deviation of what each run says of k by itself",
            said(repeated, "ppm"),
        ));
    }
    if let Some(repeated) = repeatability(&r.runs, |run| Some(3600.0 * run.bias_dps?.value)) {
        out.push(entry(
            "bias, repeatability",
            "standard deviation of what each run says of its bias by itself",
            said(repeated, "deg/h"),
        ));
    }
    out.push(entry("output noise", "white part of the angle error, rms", format!("{:.6}°", r.heldout.noise_floor_deg)));
    out
}

/// The misalignment of a rate gyroscope towards each axis that it was turned about.
fn misalignment(r: &Report) -> Vec<Entry> {
    let here = "angle of the input axis off the plane across the axis of a cross-axis run";
    let entry = |value: String| Entry { term: "input axis misalignment", here, value };
    if r.misalignment.is_empty() {
        let wanted = "a run there and back about an axis across the input axis, kind = \"cross-axis\"";
        return vec![entry(format!("{NOT_IDENTIFIABLE}: {wanted}"))];
    }
    let said = r.misalignment.iter().map(|m| match (&m.angle_deg, &m.reason) {
        (Some(angle), _) => format!("{} deg ({})", estimated(angle), m.file),
        (None, reason) => format!("{}: {}", m.file, reason.as_deref().unwrap_or(NOT_IDENTIFIABLE)),
    });
    said.map(entry).collect()
}

/// The first parameter of an effect that was found.
fn effect(r: &Report, id: &str) -> Option<String> {
    let p = r.effects.iter().find(|e| e.id == id)?.parameters.first()?;
    Some(format!("{:.4e} {}", p.value, p.unit))
}

/// Δ(1/τ), 1/s
fn anisodamping(r: &Report) -> Option<f64> {
    let e = r.effects.iter().find(|e| e.id == "anisodamping")?;
    e.parameters.first().map(|p| p.value)
}

fn anisodamping_drift(r: &Report) -> Option<String> {
    anisodamping(r).map(|a| format!("{:.5} deg/s", 0.5 * a.to_degrees()))
}

fn threshold(r: &Report) -> Option<String> {
    let told = anisodamping(r).filter(|_| r.angular_gain.is_told());
    told.map(|a| format!("{:.5} deg/s", (a / (2.0 * r.angular_gain.value)).to_degrees()))
}
