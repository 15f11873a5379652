//! Whether a recording is of the instrument that a calibration was made of. A calibration names its device, a recording does
//! not: what tells is that the angle turns as far as the calibrated one and the same way, and that undoing the calibration
//! does not make the angle, or the radius of a sensor without a reference, worse.

use cvg_model::effects::EffectId;

use crate::error::Refusal;
use crate::model::hypothesis::Hypothesis;
use crate::numerics::angles::{unwrapped, wrapped};
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{line, median, robust_deviation, span};
use crate::recording::{Instrument, Recording};
use crate::report::calibration::Calibration;
use crate::report::gate::unit;

/// A row of a recording as it was read and with the calibration undone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) t_s: f64,
    /// what the reference turned through, rad
    pub(crate) input_rad: f64,
    /// before and after, rad
    pub(crate) angle_rad: [f64; 2],
    /// before and after, in the unit of the readout
    pub(crate) radius: [f64; 2],
}

/// Rows below which nothing is told.
const FEWEST_ROWS: usize = 64;
/// A reference that turns by less is at rest.
const LEAST_TURN_RAD: f64 = 0.1;
/// Share of the calibrated angular gain by which a recording of the same instrument may be off …
const SHARE: f64 = 0.1;
/// … or what a drift may add to the angle, rad/s: 5 deg/s, as much as a rate gyroscope's bias may be.
const LARGEST_DRIFT_RAD_S: f64 = 0.087;
/// Offset and unequal gains of the calibrated sensor leave less than this share of its radius.
const LARGEST_LEFT_IN_THE_RADIUS: f64 = 0.02;
/// A calibration that leaves less than this share with the sign of the angle turned is of an angle that counts the other way:
/// engineering choice.
const MIRRORED: f64 = 0.5;
/// An angle that turns by less than this share of what its reference asks for, or by as much more, does not turn with it.
const STANDS_STILL: f64 = 0.5;
/// An error that grows by more than this factor grows by the calibration and not by chance.
const WORSE: f64 = 1.05;
/// An error below this, deg, is rounding of the columns: engineering choice.
const FINEST_DEG: f64 = 1e-3;
/// … where what of the radius goes with the angle is not within this factor of what the calibration left where it was made.
const AS_CALIBRATED: f64 = 2.0;

/// Refuses a recording of another instrument.
///
/// # Errors
/// Where the recording shows that it is none of the calibrated instrument, or not read as that was.
pub(crate) fn require_of_the_calibrated(
    calibration: &Calibration,
    recording: &Recording,
    rows: &[Row],
) -> Result<(), Refusal> {
    let h = &calibration.hypothesis;
    let refuse = |problem: String, unit: Option<&str>| {
        let same = format!(
            "a recording of {}, the calibrated instrument, with its channels in their places and its reference in the unit of \
             its column",
            calibration.device
        );
        Err(Refusal::new(&recording.source.display().to_string(), problem, unit.map_or(same, str::to_owned)))
    };
    let [turns, goes_round] = [turns(rows, h), goes_round(rows, h.period_rad, 1)];
    if turns {
        let (gain, is_another) =
            if calibration.provenance.gain_unknown { (own_gain(rows, h.period_rad), false) } else { turned(rows, h) };
        if is_another {
            let (own, calibrated) = (gain * h.sense(), h.angular_gain);
            let problem = format!(
                "its angle turns {own:.4} times as far as its reference, that of the calibration {calibrated:.4} times"
            );
            return refuse(problem, unit(own, Some(calibrated)).filter(|_| own * calibrated > 0.0));
        }
        let [before, after] = [0, 1].map(|i| angle_error(rows, gain, h.period_rad, i).to_degrees());
        if let Some(rows) = counted_the_other_way(h, recording, rows) {
            let other = angle_error(&rows, gain, h.period_rad, 1).to_degrees();
            if other < MIRRORED * after {
                let problem = format!(
                    "its angle counts the other way than the calibrated one: with the calibration undone it is off by {after:.4}°, and \
                     with its sign turned before that by {other:.4}°"
                );
                return refuse(problem, Some("--map 'theta_deg=-theta_deg'"));
            }
        }
        if after > WORSE * before.max(FINEST_DEG) {
            let problem =
                format!("with the calibration undone its angle is off by {after:.4}°, as recorded by {before:.4}°");
            return refuse(problem, None);
        }
    }
    let channels = recording.xc_v.is_some() && recording.yc_v.is_some();
    if h.instrument == Instrument::Sensor && channels && goes_round {
        let [before, after] = [0, 1].map(|i| 100.0 * radius_error(rows, h.period_rad, i));
        let is_as_calibrated = || with_the_angle(&angles_and_radii(rows)) < as_calibrated(calibration);
        if after > WORSE * before && !is_as_calibrated() {
            let problem =
                format!("with the calibration undone its radius is off by {after:.2} %, as recorded by {before:.2} %");
            return refuse(problem, None);
        }
    }
    Ok(())
}

/// The rows as they would be if an angle that is recorded as such counted the other way than the calibrated one, whose table then
/// stands the other way round.
fn counted_the_other_way(h: &Hypothesis, recording: &Recording, rows: &[Row]) -> Option<Vec<Row>> {
    let table = h.angle_table.as_ref().filter(|_| recording.xc_v.is_none() && h.instrument == Instrument::Sensor)?;
    let cycles = std::f64::consts::TAU / h.period_rad;
    let turned = |r: &Row| Row { angle_rad: [r.angle_rad[0], -table.undo(-r.angle_rad[0], cycles)], ..*r };
    Some(rows.iter().map(turned).collect())
}

/// What is said of a recording without a reference whose angle counts the other way than the calibrated one: a table that stands
/// the other way round leaves it less smooth than with its sign turned.
pub(crate) fn counts_the_other_way(h: &Hypothesis, recording: &Recording, rows: &[Row]) -> Option<String> {
    if recording.table_deg.is_some() || recording.rate_dps.is_some() || !goes_round(rows, h.period_rad, 1) {
        return None;
    }
    let turned = counted_the_other_way(h, recording, rows)?;
    let [as_it_is, other] = [rows, &turned].map(|rows| roughness(rows, h.period_rad));
    (other < MIRRORED * as_it_is).then(|| {
        "its angle seems to count the other way than the calibrated one: with its sign turned the calibration leaves it far smoother; \
         --map 'theta_deg=-theta_deg' turns it"
            .into()
    })
}

/// How much the compensated angle is off what stands a radian of it before and behind, in the mean of the two, robust.
fn roughness(rows: &[Row], period: f64) -> f64 {
    let angle = unwrapped(rows.iter().map(|r| r.angle_rad[1]), period);
    let step = median(&mut angle.windows(2).map(|w| (w[1] - w[0]).abs()).collect::<Vec<_>>());
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive count, saturating")]
    let apart = ((1.0 / step.max(1e-9)) as usize).clamp(1, (angle.len() - 1) / 2);
    robust_deviation((apart..angle.len() - apart).map(|i| angle[i] - 0.5 * (angle[i - apart] + angle[i + apart])))
}

/// What a sensor's radius still does with its angle although its readout is undone, in words; none where that is little.
pub(crate) fn left_in_the_radius(calibration: &Calibration, rows: &[Row]) -> Option<String> {
    let h = &calibration.hypothesis;
    let reads = |id: EffectId| matches!(id, EffectId::DetectionOffset | EffectId::DetectionGainMismatch);
    let corrected = h.members.iter().any(|m| reads(m.id));
    if h.instrument != Instrument::Sensor || !corrected || !goes_round(rows, h.period_rad, 1) {
        return None;
    }
    let share = with_the_angle(&angles_and_radii(rows));
    (share > LARGEST_LEFT_IN_THE_RADIUS.max(as_calibrated(calibration))).then(|| {
        format!(
            "with the calibration undone its radius still goes with its angle by {:.1} %: a recording of another sensor than \
             the calibrated one, or that one has changed",
            100.0 * share
        )
    })
}

/// How much of a radius goes with the angle, once and twice a turn, as a share of it.
pub(crate) fn with_the_angle(angles_and_radii: &[[f64; 2]]) -> f64 {
    let usual = median(&mut angles_and_radii.iter().map(|[_, radius]| *radius).collect::<Vec<_>>());
    let mut equations = NormalEquations::new(5);
    for [angle, radius] in angles_and_radii {
        let ((s1, c1), (s2, c2)) = (angle.sin_cos(), (2.0 * angle).sin_cos());
        equations.add(&[1.0, c1, s1, c2, s2], radius / usual);
    }
    equations.solve()[1..].iter().fold(0.0, |sum: f64, a| sum.hypot(*a))
}

fn angles_and_radii(rows: &[Row]) -> Vec<[f64; 2]> {
    rows.iter().map(|r| [r.angle_rad[1], r.radius[1]]).collect()
}

/// How much of the radius may go with the angle, where the calibration left some where it was made.
fn as_calibrated(calibration: &Calibration) -> f64 {
    AS_CALIBRATED * calibration.provenance.radius_left.unwrap_or(0.0)
}

/// Whether the reference turns, and the angle goes round once and more, or would.
fn turns(rows: &[Row], h: &Hypothesis) -> bool {
    let input = span(&rows.iter().map(|r| r.input_rad).collect::<Vec<_>>());
    let angle = span(&unwrapped(rows.iter().map(|r| r.angle_rad[1]), h.period_rad));
    rows.len() >= FEWEST_ROWS && input > LEAST_TURN_RAD && angle.max(input * h.angular_gain.abs()) > h.period_rad
}

/// How many times as far as the reference the compensated angle turns, with its sign, and whether that is another
/// instrument's. A sensor on a table that counts the other way reads as it did.
fn turned(rows: &[Row], h: &Hypothesis) -> (f64, bool) {
    let input: Vec<f64> = rows.iter().map(|r| r.input_rad).collect();
    let seconds = rows[rows.len() - 1].t_s - rows[0].t_s;
    let travel: f64 = input.windows(2).map(|w| (w[1] - w[0]).abs()).sum();
    let speed = travel / seconds.max(f64::MIN_POSITIVE);
    let beside = |gain: f64| (gain, line(&input, &followed(rows, gain, h.period_rad, 1)).0);
    let (as_it_was, reversed) = (beside(h.precession(1.0)), beside(-h.precession(1.0)));
    let is_reversed = h.instrument == Instrument::Sensor && reversed.1.abs() < as_it_was.1.abs();
    let (gain, off) = if is_reversed { reversed } else { as_it_was };
    (gain + off, off.abs() > SHARE * gain.abs() && off.abs() * speed > LARGEST_DRIFT_RAD_S)
}

/// How many times as far as the reference the compensated angle turns, with its sign, where nothing is known of that.
fn own_gain(rows: &[Row], period: f64) -> f64 {
    let input: Vec<f64> = rows.iter().map(|r| r.input_rad).collect();
    line(&input, &unwrapped(rows.iter().map(|r| r.angle_rad[1]), period)).0
}

/// What the angle has beside that of an instrument of this gain, followed through its period.
fn followed(rows: &[Row], gain: f64, period: f64, after: usize) -> Vec<f64> {
    unwrapped(rows.iter().map(|r| wrapped(r.angle_rad[after] - gain * r.input_rad, period)), period)
}

/// Robust deviation of the angle from the best line over reference and time, rad; anything where it does not turn with the reference, as
/// that of channels about an origin that they do not go round.
fn angle_error(rows: &[Row], gain: f64, period: f64, after: usize) -> f64 {
    let error = followed(rows, gain, period, after);
    let mut equations = NormalEquations::new(3);
    let first_s = rows[0].t_s;
    let row = |r: &Row| [1.0, r.input_rad, r.t_s - first_s];
    rows.iter().zip(&error).for_each(|(r, e)| equations.add(&row(r), *e));
    let x = equations.solve();
    let input: Vec<f64> = rows.iter().map(|r| r.input_rad).collect();
    if line(&input, &error).0.abs() > STANDS_STILL * gain.abs() {
        return f64::INFINITY;
    }
    let left = |(r, e): (&Row, &f64)| e - row(r).iter().zip(&x).map(|(a, b)| a * b).sum::<f64>();
    robust_deviation(rows.iter().zip(&error).map(left))
}

/// Whether the angle as recorded, or compensated, goes round, so that the radius is seen all around.
fn goes_round(rows: &[Row], period: f64, after: usize) -> bool {
    const PARTS: usize = 12;
    let mut seen = [false; PARTS];
    for r in rows {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of a turn")]
        let part = (r.angle_rad[after].rem_euclid(period) / period * PARTS as f64) as usize;
        seen[part.min(PARTS - 1)] = true;
    }
    rows.len() >= FEWEST_ROWS && seen.iter().all(|s| *s)
}

/// Robust deviation of the radius, as a share of it; anything where the angle does not go round, for about an origin far off every radius is
/// constant.
fn radius_error(rows: &[Row], period: f64, after: usize) -> f64 {
    if !goes_round(rows, period, after) {
        return f64::INFINITY;
    }
    let usual = median(&mut rows.iter().map(|r| r.radius[after]).collect::<Vec<_>>());
    robust_deviation(rows.iter().map(|r| r.radius[after] / usual - 1.0))
}
