//! A recording with the identified errors taken out: readouts are undone, precession that the mechanics and the
//! commands add is turned back, and a reference that the table did not keep is corrected.

use cvg_model::effects::Moment;

use crate::data::track::{Track, wrapped};
use crate::error::Refusal;
use crate::estimation::propagation::{Pace, Start, walk};
use crate::model::prediction::Predictor;
use crate::model::unknowns::Unknowns;
use crate::recording::{Recording, Role, Run, RunKind};
use crate::report::calibration::Calibration;

/// Compensates a recording.
///
/// Changed are `xc_v`, `xs_v`, `yc_v`, `ys_v` and `theta_deg`, as far as they are there; `rate_dps` or `table_deg` only
/// where an input effect was identified. All else is kept.
///
/// ```no_run
/// use cvg_calibration::{calibration::Calibration, compensate, recording::Recording};
///
/// let calibration = Calibration::read("results/calibration.toml".as_ref())?;
/// let clean = compensate(&calibration, &Recording::read("rot.csv".as_ref()).expect("a recording"))?;
/// println!("{} rows", clean.len());
/// # Ok::<(), cvg_calibration::Refusal>(())
/// ```
///
/// # Errors
/// Where the recording has no angle or no reference.
pub fn compensate(calibration: &Calibration, recording: &Recording) -> Result<Recording, Refusal> {
    let h = &calibration.hypothesis;
    let run = Run {
        kind: RunKind::Rotation,
        file: recording.source.clone(),
        settle_s: 0.0,
        role: Role::Fit,
        amplitude: None,
        recording: recording.clone(),
    };
    let track = Track::whole(run, h.period_rad)?;
    let mut out = recording.clone();
    let first_s = recording.t_s.first().copied().unwrap_or(0.0);
    let none = Unknowns::new(h, Vec::new());
    let predictor = Predictor::new(h, &none);
    let channels = recording.xc_v.is_some() && recording.yc_v.is_some();
    for segment in &track.segments {
        walk(&track, segment, h, &none, Start::default(), Pace::every(1), |row| {
            let i = row.index;
            let at = Moment {
                t_s: track.t_s[i],
                table_rad: track.input_rad[i],
                precession_rad_s: h.precession(track.rate(i)),
            };
            let seen = track.envelope(i);
            let (sin, cos) = (-row.drift).sin_cos();
            let z = h.unread(seen, &at).turned(sin, cos);
            if channels {
                for (column, value) in
                    [(&mut out.xc_v, z.x_c), (&mut out.xs_v, z.x_s), (&mut out.yc_v, z.y_c), (&mut out.ys_v, z.y_s)]
                {
                    if let Some(column) = column {
                        column[i] = value;
                    }
                }
            }
            if let Some(theta) = &mut out.theta_deg {
                let drift_rad = h.rate_bias_rad_s * (track.t_s[i] - first_s);
                theta[i] += (wrapped(h.bearing(&z) - h.bearing(&seen), h.period_rad) - drift_rad).to_degrees();
            }
            if let Some(table) = &mut out.table_deg {
                table[i] += row.excess.to_degrees();
            } else if let Some(rate) = &mut out.rate_dps {
                rate[i] += predictor.excess_rate(rate[i].to_radians(), &at).value.to_degrees();
            }
        });
    }
    Ok(out)
}
