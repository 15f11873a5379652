//! Recordings at the carrier: displacements at several points a period, as an oscilloscope or a camera saves them. The
//! carrier is found, followed and demodulated, window by window, and what comes out is a recording of envelopes as any
//! other, with the outputs of the controllers where the forces were recorded. Nothing is held beside the columns that were read but
//! the envelopes.

mod forces;
mod found;
mod rails;
mod windows;

use std::ops::Range;

use cvg_model::Envelope;

use crate::error::Refusal;
use crate::numerics::angles::wrapped;
use crate::recording::{Campaign, Channel, Recording, RunKind, Said};
use windows::Window;
pub(crate) use windows::phased;

/// Windows that a recording is divided into at most.
pub(crate) const MOST_WINDOWS: usize = 12_000;

/// What is identified of a recording at the carrier: its envelopes. Any other is given back as it is, and so is one without a carrier,
/// which [`crate::answer()`] refuses then.
#[must_use]
pub fn envelopes(recording: Recording, said: Said<'_>) -> Recording {
    let name = said.file.display().to_string();
    match seen(&recording, &name, said.carrier_hz, said.kind) {
        Ok(Some(envelopes)) => envelopes,
        _ => recording,
    }
}

/// A campaign whose carrier-level recordings are demodulated.
///
/// # Errors
/// A recording in which there is no carrier, or too few points of one.
pub(crate) fn demodulated(mut campaign: Campaign) -> Result<Campaign, Refusal> {
    for run in &mut campaign.runs {
        let name = run.file.display().to_string();
        if let Some(envelopes) = seen(&run.recording, &name, campaign.carrier_hz, run.kind)? {
            run.recording = envelopes;
        }
    }
    Ok(campaign)
}

/// The columns of a carrier.
#[derive(Clone, Copy)]
pub(crate) struct Carrier<'a> {
    pub(crate) t_s: &'a [f64],
    pub(crate) x: &'a [f64],
    pub(crate) y: &'a [f64],
    pub(crate) forces: Option<[&'a [f64]; 2]>,
}

impl Carrier<'_> {
    /// Mean time from row to row, s.
    pub(crate) fn step_s(&self) -> f64 {
        let n = self.t_s.len();
        (self.t_s[n - 1] - self.t_s[0]) / (n.max(2) - 1) as f64
    }
}

/// The envelopes of a recording; none where it is not at the carrier.
fn seen(r: &Recording, name: &str, stated_hz: Option<f64>, kind: RunKind) -> Result<Option<Recording>, Refusal> {
    let (Some(x), Some(y), None, None) = (&r.x_v, &r.y_v, &r.xc_v, &r.theta_deg) else { return Ok(None) };
    let envelopes = recording(r, [x, y], name, stated_hz, kind)?;
    Ok(Some(if kind == RunKind::Decay { envelopes } else { in_phase(envelopes) }))
}

fn recording(
    r: &Recording,
    [x, y]: [&[f64]; 2],
    name: &str,
    stated_hz: Option<f64>,
    kind: RunKind,
) -> Result<Recording, Refusal> {
    let forces = forces_of(r);
    let carrier = Carrier { t_s: &r.t_s, x, y, forces };
    let frequency_hz = found::frequency(carrier, name, stated_hz)?;
    let mut seen = windows::demodulate(carrier, frequency_hz);
    let rails = rails::Rails::of(carrier);
    // a decay goes on below its rails; a rotation that is held at them has nothing else
    let is_decay = kind == RunKind::Decay;
    let flat = if is_decay { rails.leave_out(carrier, &mut seen) } else { 0 };
    if seen.len() < 2 && flat > 0 {
        return Err(Refusal::no_answer(name, rails.said(), "channels whose range is wider than the vibration"));
    }
    if seen.len() < 2 {
        return Err(Refusal::no_answer(
            name,
            format!("the carrier of {frequency_hz:.6} Hz is not resolved by {} rows", r.len()),
            "more periods, or more points a period",
        ));
    }
    let mut out = Recording {
        source: r.source.clone(),
        in_memory: r.in_memory,
        warnings: r.warnings.clone(),
        dropped: r.dropped.clone(),
        reference_hz: Some(frequency_hz),
        t_s: seen.iter().map(|w| w.t_s).collect(),
        xc_v: Some(seen.iter().map(|w| w.envelope.x_c).collect()),
        xs_v: Some(seen.iter().map(|w| w.envelope.x_s).collect()),
        yc_v: Some(seen.iter().map(|w| w.envelope.y_c).collect()),
        ys_v: Some(seen.iter().map(|w| w.envelope.y_s).collect()),
        ..Recording::default()
    };
    for channel in [Channel::Rate, Channel::Table, Channel::Vas, Channel::Vqc, Channel::Temperature] {
        if let Some(values) = r.channel(channel) {
            let angle = channel == Channel::Table;
            out.set_channel(channel, seen.iter().map(|w| mean(values, &w.rows, angle)).collect());
        }
    }
    out.warnings.push(remark(r, name, frequency_hz, &seen));
    let said = if forces.is_none() {
        forces_not_used(r, name).into_iter().collect()
    } else if is_decay {
        forces::of_a_decay(&seen, name).into_iter().collect()
    } else {
        forces::put_into(&mut out, &seen, name, kind)
    };
    out.warnings.extend(said);
    if rails.are_reached() {
        let left_out =
            if is_decay { format!("{flat} windows with such rows are left out") } else { "they are used".into() };
        out.warnings.push(format!("{name}: {}: {left_out}", rails.said()));
    }
    Ok(out)
}

/// The mean of a column over some rows; an angle is taken relative to its first row, which may be wrapped.
fn mean(values: &[f64], rows: &Range<usize>, angle: bool) -> f64 {
    let of = &values[rows.clone()];
    let first = of.first().copied().unwrap_or(f64::NAN);
    let relative = |v: &f64| if angle { wrapped(v - first, 360.0) } else { v - first };
    first + of.iter().map(relative).sum::<f64>() / of.len().max(1) as f64
}

/// The forces of both axes. Outputs of the controllers that are recorded themselves stand over them.
fn forces_of(r: &Recording) -> Option<[&[f64]; 2]> {
    let outputs = r.vas_v.is_some() || r.vqc_v.is_some();
    Some([r.fx_v.as_deref()?, r.fy_v.as_deref()?]).filter(|_| !outputs)
}

/// Why forces that are there are not used.
fn forces_not_used(r: &Recording, name: &str) -> Option<String> {
    match (&r.fx_v, &r.fy_v) {
        (None, None) => None,
        (Some(_), Some(_)) => Some(format!("{name}: fx_v and fy_v are not used: vas_v or vqc_v is recorded itself")),
        _ => Some(format!("{name}: one of fx_v and fy_v is there without the other and is not used")),
    }
}

fn remark(r: &Recording, name: &str, frequency_hz: f64, seen: &[Window]) -> String {
    let rows: usize = seen.iter().map(|w| w.rows.len()).sum();
    let each = rows / seen.len().max(1);
    let length_s = (r.t_s[r.len() - 1] - r.t_s[0]) / seen.len() as f64;
    format!(
        "{name}: demodulated at {frequency_hz:.6} Hz, {} envelopes of {each} rows each; what changes faster than {:.4} Hz \
         is not resolved",
        seen.len(),
        0.5 / length_s
    )
}

/// Envelopes whose phase a loop would have nulled: each turned by the phase of its own orbit.
fn in_phase(mut r: Recording) -> Recording {
    let (Some(xc), Some(xs), Some(yc), Some(ys)) = (&mut r.xc_v, &mut r.xs_v, &mut r.yc_v, &mut r.ys_v) else {
        return r;
    };
    let mut last = 0.0;
    for i in 0..xc.len() {
        let e = Envelope::new(xc[i], xs[i], yc[i], ys[i]);
        // half a period later the orbit is the same one, seen from its other end
        last += wrapped(e.orbit().delta - last, std::f64::consts::PI);
        let z = windows::phased(&e, -last);
        (xc[i], xs[i], yc[i], ys[i]) = (z.x_c, z.x_s, z.y_c, z.y_s);
    }
    r
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_is_seen_with_its_phase_nulled() {
        let orbit = cvg_model::Orbit { a: 1.0, q: 0.05, theta: 0.4, delta: 0.0 }.envelope();
        let column = |of: fn(&Envelope<f64>) -> f64| {
            Some((0..200).map(|i| of(&windows::phased(&orbit, 0.05 * f64::from(i)))).collect::<Vec<_>>())
        };
        let r = in_phase(Recording {
            t_s: (0..200).map(f64::from).collect(),
            xc_v: column(|e| e.x_c),
            xs_v: column(|e| e.x_s),
            yc_v: column(|e| e.y_c),
            ys_v: column(|e| e.y_s),
            ..Recording::default()
        });
        for (of, expected) in [(&r.xc_v, orbit.x_c), (&r.xs_v, orbit.x_s), (&r.yc_v, orbit.y_c), (&r.ys_v, orbit.y_s)] {
            assert!(of.iter().flatten().all(|v| (v - expected).abs() < 1e-9));
        }
    }
}
