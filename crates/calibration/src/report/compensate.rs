//! A recording with the identified errors taken out: readouts are undone, precession that the mechanics and the
//! commands add is turned back, and a reference that the table did not keep is corrected.

use cvg_model::effects::{EffectId, Stage};

use crate::data::leaping_rows;
use crate::data::track::Track;
use crate::error::Refusal;
use crate::estimation::propagation::{Start, Stepping, propagate};
use crate::model::hypothesis::{Hypothesis, Member};
use crate::model::unknowns::Unknowns;
use crate::numerics::angles::{unwrapped, wrapped};
use crate::numerics::interpolation::accumulated;
use crate::recording::{Instrument, Recording, Role, Run, RunKind};
use crate::report::belonging::{Row, counts_the_other_way, left_in_the_radius, require_of_the_calibrated};
use crate::report::calibration::Calibration;
use crate::report::provenance::amplitude;

/// An amplitude beyond the calibration's by this factor is another unit, or another instrument.
const ANOTHER_UNIT: f64 = 3.0;
/// … and by this factor, outside what was calibrated.
const OUTSIDE: f64 = 1.2;
/// The rate of a sensor's own angle is that over so many times what it is late by: noise of the angle then adds a tenth of itself.
const LATENCIES: f64 = 14.0;
/// A row is beyond the part of the period that was covered from so much of the period on.
const EDGE: f64 = 0.02;
/// Units that are taken for volts, and what they are called.
const UNITS: [(f64, &str); 3] = [(1e3, "millivolts"), (1e6, "microvolts"), (1e-3, "kilovolts")];

/// Compensates a recording.
///
/// Changed are `xc_v`, `xs_v`, `yc_v`, `ys_v` and `theta_deg`, as far as they are there; `theta_deg` is added where only
/// the readout is there. All else is kept, the reference too. Effects that follow the table or the clock of a recording
/// ([`left_out`]) are not undone. Where the calibration of a sensor follows the rate and the recording has no reference, the rate is
/// that of the sensor's own angle.
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
/// Where the recording has no angle, no reference though the calibration needs one, or another unit than the calibration, and
/// where it is none of the calibrated instrument: its angle turns otherwise, or undoing the calibration makes it worse. What
/// speaks for another sensor and does not prove it is a warning of the recording that is returned.
pub fn compensate(calibration: &Calibration, recording: &Recording) -> Result<Recording, Refusal> {
    let h = &portable(&calibration.hypothesis);
    same_unit(calibration, recording)?;
    let rated = with_its_own_rate(calibration, recording)?;
    let is_by_its_own_rate = rated.is_some();
    needs_no_reference(h, rated.as_ref().unwrap_or(recording))?;
    needs_no_temperature(h, recording)?;
    let mut read = rated.unwrap_or_else(|| recording.clone());
    // what a sensor reads in a row stays in that row
    let leaps = if h.instrument == Instrument::Gyroscope { leaping_rows::mend(&mut read) } else { None };
    let run = Run {
        kind: RunKind::Rotation,
        file: recording.source.clone(),
        settle_s: 0.0,
        role: Role::Fit,
        amplitude: None,
        recording: read,
    };
    let mut track = Track::whole(run, h.period_rad)?;
    if let Some(reference_c) = h.reference_c {
        track.refer_to(reference_c);
    }
    let mut out = recording.clone();
    out.warnings.extend(leaps.map(|(_, said)| said));
    let mut angle_rad: Vec<f64> = Vec::new();
    let mut rows = Vec::with_capacity(recording.len());
    let first_s = recording.t_s.first().copied().unwrap_or(0.0);
    // kelvin seconds beyond the temperature that the bias refers to
    let warmer: Vec<f64> = (0..recording.len()).map(|i| track.warmer_k(i)).collect();
    let warmth = accumulated(&recording.t_s, &warmer);
    let none = Unknowns::new(h, Vec::new());
    let channels = recording.xc_v.is_some() && recording.yc_v.is_some();
    for segment in &track.segments {
        propagate(&track, segment, h, &none, Start::default(), Stepping::every(1), |row| {
            let i = row.index;
            // a late output turned meanwhile at the mean rate since
            let at = track.moment(i, h.precession(track.mean_rate_before(i, h.latency_s())));
            let seen = track.envelope(i);
            let (sin, cos) = (-row.drift).sin_cos();
            let z = h.unread(seen, &at).turned(sin, cos);
            let drift_rad = h.rate_bias_rad_s * (track.t_s[i] - first_s) + h.rate_bias_per_k_rad_s * warmth[i];
            rows.push(Row {
                t_s: track.t_s[i],
                // its own rate says nothing of whose it is
                input_rad: if is_by_its_own_rate { 0.0 } else { track.input_rad[i] },
                angle_rad: [h.bearing(&seen), h.bearing(&z) - drift_rad],
                radius: [seen.x_c.hypot(seen.y_c), z.x_c.hypot(z.y_c)],
            });
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
                theta[i] += (wrapped(h.bearing(&z) - h.bearing(&seen), h.period_rad) - drift_rad).to_degrees();
            }
            if channels && recording.theta_deg.is_none() {
                angle_rad.push(h.bearing(&z));
            }
        });
    }
    require_of_the_calibrated(calibration, recording, &rows)?;
    let said = [
        left_in_the_radius(calibration, &rows).filter(|_| channels),
        counts_the_other_way(h, recording, &rows),
        beyond_the_covered(calibration, &rows),
    ];
    out.warnings.extend(said.into_iter().flatten().map(|said| format!("{}: {said}", recording.source.display())));
    if channels && recording.theta_deg.is_none() {
        let followed = unwrapped(angle_rad.into_iter(), h.period_rad);
        out.theta_deg = Some(followed.into_iter().map(f64::to_degrees).collect());
    }
    Ok(out)
}

/// Effects of a calibration that are not undone in another recording: those of the table, and those of one recording's clock.
#[must_use]
pub fn left_out(calibration: &Calibration) -> Vec<EffectId> {
    calibration.hypothesis.members.iter().map(|m| m.id).filter(|id| !is_portable(*id)).collect()
}

fn is_portable(id: EffectId) -> bool {
    id.description().stage != Stage::Input && !id.in_time()
}

fn portable(hypothesis: &Hypothesis) -> Hypothesis {
    let mut h = hypothesis.clone();
    h.members.retain(|m| is_portable(m.id));
    h
}

/// What a recording at another amplitude than the calibration's is worth, in words; none where it is the same.
#[must_use]
pub fn outside(calibration: &Calibration, recording: &Recording) -> Option<String> {
    let ([low, high], here) = (calibration.provenance.amplitude_v?, amplitude(recording)?);
    let within = (low / OUTSIDE..=high * OUTSIDE).contains(&here);
    (!within).then(|| {
        format!("its amplitude is {here:.4e}, the calibration was made from {low:.4e} to {high:.4e}: what goes with the amplitude is extrapolated")
    })
}

/// What rows are worth that stand where no row stood that the table was made of, in words; none where there are none.
fn beyond_the_covered(calibration: &Calibration, rows: &[Row]) -> Option<String> {
    let [from, to] = calibration.provenance.covered_deg?;
    let period = calibration.hypothesis.period_rad.to_degrees();
    let edge = EDGE * period;
    let is_beyond = |row: &&Row| {
        let place = (row.angle_rad[1].to_degrees() - from).rem_euclid(period);
        (to - from + edge..period - edge).contains(&place)
    };
    let beyond = rows.iter().filter(is_beyond).count();
    (beyond > 0).then(|| {
        format!(
            "{beyond} of {} rows stand beyond the part of its turn from {from:.0}° to {:.0}° that the calibration was made of: its table \
             is extrapolated there",
            rows.len(),
            to % period
        )
    })
}

fn same_unit(calibration: &Calibration, recording: &Recording) -> Result<(), Refusal> {
    let Some(([low, high], here)) = calibration.provenance.amplitude_v.zip(amplitude(recording)) else { return Ok(()) };
    if (low / ANOTHER_UNIT..=high * ANOTHER_UNIT).contains(&here) {
        return Ok(());
    }
    let usual = (low * high).sqrt();
    let unit = UNITS.iter().find(|(factor, _)| (here / usual / factor).log10().abs() < 0.5);
    let looks = unit.map_or(String::new(), |(factor, name)| {
        format!(", {factor:.0e} times as much, as of {name}: --map 'xc_v=xc_v*{:.0e}' and so on", 1.0 / factor)
    });
    Err(Refusal::new(
        &recording.source.display().to_string(),
        format!("its amplitude is {here:.4e}, the calibration was made at {usual:.4e}{looks}"),
        "a recording of the calibrated instrument in the unit of its calibration",
    ))
}

/// A recording without a temperature can be compensated where nothing follows it.
fn needs_no_temperature(h: &Hypothesis, recording: &Recording) -> Result<(), Refusal> {
    let member = h.members.iter().find(|m| m.id.by_temperature()).map(|m| m.id.to_string());
    let follows = member.or((h.rate_bias_per_k_rad_s != 0.0).then(|| "the bias".into()));
    let Some(what) = follows.filter(|_| !recording.temp_c.iter().flatten().any(|t| t.is_finite())) else {
        return Ok(());
    };
    Err(Refusal::new(
        &recording.source.display().to_string(),
        format!("{what} follows the temperature, and there is no column temp_c"),
        "a recording with its temperature",
    ))
}

/// Whether a member of a sensor's calibration is undone by what one row holds.
fn is_of_the_row(m: &Member) -> bool {
    m.id.description().stage == Stage::Readout && !m.id.acts_on_angle()
}

/// A sensor's recording without a reference, with the rate of its own angle as that of its input where the calibration follows the
/// rate: a sensor that is bolted to what turns it turns as fast.
fn with_its_own_rate(calibration: &Calibration, recording: &Recording) -> Result<Option<Recording>, Refusal> {
    let h = portable(&calibration.hypothesis);
    let has_reference = recording.rate_dps.is_some() || recording.table_deg.is_some();
    if h.instrument != Instrument::Sensor || has_reference || h.members.iter().all(is_of_the_row) {
        return Ok(None);
    }
    let still = Hypothesis { members: h.members.iter().copied().filter(is_of_the_row).collect(), ..h.clone() };
    let still = compensate(&Calibration { hypothesis: still, ..calibration.clone() }, recording)?;
    let Some(theta) = still.theta_deg else { return Ok(None) };
    let angle: Vec<f64> = unwrapped(theta.iter().map(|v| v.to_radians()), h.period_rad);
    let rate = rate(&recording.t_s, &angle, LATENCIES * h.latency_s().abs());
    let per_input = h.precession(1.0);
    let rate_dps = rate.iter().map(|r| (r / per_input).to_degrees()).collect();
    Ok(Some(Recording { rate_dps: Some(rate_dps), ..recording.clone() }))
}

/// Rate of an angle over so much time about each row, and over two rows at least.
fn rate(t_s: &[f64], angle: &[f64], over_s: f64) -> Vec<f64> {
    let last = t_s.len().saturating_sub(1);
    let slope = |i: usize| {
        let (mut from, mut to) = (i.saturating_sub(1), (i + 1).min(last));
        while t_s[to] - t_s[from] < over_s && (from > 0 || to < last) {
            (from, to) = (from.saturating_sub(1), (to + 1).min(last));
        }
        (angle[to] - angle[from]) / (t_s[to] - t_s[from]).max(f64::MIN_POSITIVE)
    };
    (0..t_s.len()).map(slope).collect()
}

/// A recording without a reference can be compensated where nothing follows the rate.
fn needs_no_reference(h: &Hypothesis, recording: &Recording) -> Result<(), Refusal> {
    if recording.rate_dps.is_some() || recording.table_deg.is_some() {
        return Ok(());
    }
    if h.instrument == Instrument::Sensor && h.members.iter().all(is_of_the_row) {
        return Ok(());
    }
    recording.require_rotation()?;
    Ok(())
}
