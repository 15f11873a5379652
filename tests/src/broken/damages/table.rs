//! What is told of the table and is not so.

use cvg_calibration::recording::Recording;

use super::super::Made;
use super::{share, turn};
use crate::bench::Draws;

/// The recording of a run, of whose table something else is told.
fn retold(made: &Made, told: impl Fn(usize, f64) -> f64) -> Recording {
    let mut recording = made.recording();
    made.tell(&mut recording, made.rates().iter().enumerate().map(|(i, rate)| told(i, *rate)).collect());
    recording
}

pub(super) fn factor(made: &Made, draw: &mut Draws) -> Recording {
    let factor = 1.0 + share(draw, 1e-4, 0.1);
    retold(made, |_, rate| factor * rate)
}

pub(super) fn biased_rate(made: &Made, draw: &mut Draws) -> Recording {
    let offset = share(draw, 1e-3, 5.0);
    retold(made, |_, rate| rate + offset)
}

pub(super) fn radians(made: &Made, _: &mut Draws) -> Recording {
    retold(made, |_, rate| rate.to_radians())
}

/// What was commanded is recorded; the table can't turn as fast.
pub(super) fn saturated(made: &Made, draw: &mut Draws) -> Recording {
    let short = 1.0 - draw.scale(1e-3, 0.5);
    retold(made, |_, rate| rate / short)
}

/// What was commanded is recorded; the table takes its time to get there.
pub(super) fn late(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rise_s = draw.scale(0.01, 0.1) * made.duration_s;
    // the table was behind by rise_s (1 − e^{−t/rise}) of its rate, so that it turned less than is told
    let behind = |t: f64| made.rate_dps * rise_s * (1.0 - (-t / rise_s).exp());
    let gain = if made.is_sensor { 1.0 } else { -made.angular_gain };
    let times = made.times();
    turn(&mut recording, |i| -gain * behind(times[i]).to_radians());
    recording
}

pub(super) fn unsigned(made: &Made, _: &mut Draws) -> Recording {
    retold(made, |_, rate| rate.abs())
}

pub(super) fn delayed_rate(made: &Made, draw: &mut Draws) -> Recording {
    let (rates, by) = (made.rates(), 1 + draw.below(made.times().len() / 20));
    retold(made, |i, _| rates[i.saturating_sub(by)])
}

/// One row of a thousand and at least one, with a rate that is none.
pub(super) fn outliers(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let size = [10.0, 1e3, -1.0, 0.0, 1e6][draw.below(5)];
    let column = recording.rate_dps.as_mut().or(recording.table_deg.as_mut()).unwrap();
    for _ in 0..column.len().div_ceil(1000) {
        let at = draw.below(column.len());
        column[at] *= size;
    }
    recording
}

pub(super) fn contradicted(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rate = made.rate_dps * draw.between(0.3, 1.8);
    recording.rate_dps = Some(made.rates());
    recording.table_deg = Some(recording.t_s.iter().map(|t| (rate * t).rem_euclid(360.0)).collect());
    recording
}

pub(super) fn jitter(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let size = draw.scale(1e-3, 1.0);
    let column = recording
        .table_deg
        .get_or_insert_with(|| made.turned(&made.rates()).iter().map(|d| d.rem_euclid(360.0)).collect());
    column.iter_mut().for_each(|d| *d = (*d + draw.between(-size, size)).rem_euclid(360.0));
    recording
}

/// Rows that are the mean of what was before and after the wrap of the table's angle.
pub(super) fn mean_at_wrap(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let turned = made.turned(&made.rates());
    let column = turned.iter().map(|d| d.rem_euclid(360.0)).collect::<Vec<f64>>();
    let wraps = |i: usize| i > 0 && (column[i] - column[i - 1]).abs() > 180.0;
    let mean = |i: usize| if wraps(i) { 0.5 * (column[i] + column[i - 1]) } else { column[i] };
    recording.table_deg = Some((0..column.len()).map(mean).collect());
    recording
}

pub(super) fn whole(made: &Made, _: &mut Draws) -> Recording {
    retold(made, |_, rate| rate.round())
}

/// What was commanded is recorded; the motor's poles are in what the table does.
pub(super) fn rippled(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (size_rad, poles) = (draw.scale(1e-3, 1.0).to_radians(), (1 + draw.below(12)) as f64);
    let gain = if made.is_sensor { 1.0 } else { -made.angular_gain };
    let turned = made.turned(&made.rates());
    turn(&mut recording, |i| gain * size_rad * (poles * turned[i].to_radians()).sin());
    recording
}
