//! What converters, amplifiers and plugs do to the channels.

use cvg_calibration::recording::Recording;

use super::super::Made;
use super::{both, either, every_column, readouts, share, stretch, turn};
use crate::bench::Draws;

pub(super) fn swapped(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    std::mem::swap(&mut recording.xc_v, &mut recording.yc_v);
    recording
}

pub(super) fn negated(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    either(&mut recording, draw).iter_mut().for_each(|v| *v = -*v);
    recording
}

pub(super) fn clipped(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let limit = draw.between(0.5, 1.0);
    either(&mut recording, draw).iter_mut().for_each(|v| *v = v.clamp(-limit, limit));
    recording
}

pub(super) fn spikes(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    both(&mut recording).for_each(|v| v.iter_mut().skip(17).step_by(50).for_each(|v| *v += 3.0));
    recording
}

pub(super) fn one_row_late(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    either(&mut recording, draw).rotate_right(1);
    let rows: Vec<usize> = (1..recording.len()).collect();
    every_column(&mut recording, &rows);
    recording
}

pub(super) fn own_clock(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let fast = 1.0 + share(draw, 1e-5, 1e-2);
    let column = either(&mut recording, draw);
    let sound = column.clone();
    for (i, v) in column.iter_mut().enumerate() {
        let at = (i as f64 * fast).min((sound.len() - 2) as f64);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a row")]
        let (row, part) = (at as usize, at.fract());
        *v = sound[row] + part * (sound[row + 1] - sound[row]);
    }
    recording
}

pub(super) fn other_gain(made: &Made, draw: &mut Draws) -> Recording {
    let other = Made { angular_gain: made.angular_gain * (1.0 + share(draw, 1e-4, 0.2)), ..made.clone() };
    other.recording()
}

pub(super) fn other_device(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = other_gain(made, draw);
    let ratio = 1.0 + share(draw, 1e-3, 0.1);
    recording.yc_v.iter_mut().flatten().for_each(|v| *v *= ratio);
    recording
}

pub(super) fn other_amplitude(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let size = draw.scale(0.3, 3.0);
    readouts(&mut recording, |v| size * v);
    recording
}

pub(super) fn wraps(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let end = draw.between(0.7, 1.0);
    let wrapped = |v: f64| (v + end).rem_euclid(2.0 * end) - end;
    either(&mut recording, draw).iter_mut().for_each(|v| *v = wrapped(*v));
    recording
}

/// A low pass of the first order on X or Y.
pub(super) fn filtered(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let share = draw.scale(0.1, 0.9);
    let column = either(&mut recording, draw);
    let mut kept = column[0];
    for v in column.iter_mut() {
        kept += share * (*v - kept);
        *v = kept;
    }
    recording
}

pub(super) fn range_switched(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (rows, gain) = (stretch(recording.len(), draw), 1.0 + share(draw, 1e-3, 0.3));
    either(&mut recording, draw)[rows.start..].iter_mut().for_each(|v| *v *= gain);
    recording
}

pub(super) fn one_for_other(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rows = stretch(recording.len(), draw);
    if let (Some(x), Some(y)) = (&recording.xc_v, &mut recording.yc_v) {
        y[rows.clone()].copy_from_slice(&x[rows]);
    }
    recording
}

pub(super) fn turned_plug(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rows = stretch(recording.len(), draw);
    either(&mut recording, draw)[rows.start..].iter_mut().for_each(|v| *v = -*v);
    recording
}

pub(super) fn burst(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (rows, size) = (stretch(recording.len(), draw), draw.scale(0.01, 1.0));
    both(&mut recording).for_each(|v| v[rows.clone()].iter_mut().for_each(|v| *v += draw.between(-size, size)));
    recording
}

pub(super) fn eight_bits(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    readouts(&mut recording, |v| (v * 100.0).round() / 100.0);
    recording
}

pub(super) fn offset(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let by = share(draw, 1e-3, 0.1);
    either(&mut recording, draw).iter_mut().for_each(|v| *v += by);
    recording
}

/// A converter of sixteen bits of which one of the upper ones is always set, or never.
pub(super) fn hanging_bit(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (range, bit, is_set) = (draw.between(1.05, 4.0), 15 - draw.below(6), draw.below(2) == 0);
    let level = 2.0 * range / 65_536.0;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a code of the converter")]
    let hung = |v: f64| {
        let code = ((v + range) / level).clamp(0.0, 65_535.0) as u32;
        let code = if is_set { code | 1 << bit } else { code & !(1 << bit) };
        (f64::from(code) + 0.5) * level - range
    };
    either(&mut recording, draw).iter_mut().for_each(|v| *v = hung(*v));
    recording
}

/// The gain of Y settles while it is recorded; over the run it is on average what it is.
pub(super) fn warming(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (by, settles) = (share(draw, 1e-4, 0.05), draw.between(0.05, 1.0));
    let rows = recording.len() as f64;
    let mean = settles * (1.0 - (-1.0 / settles).exp());
    let gain = |i: usize| 1.0 + by * ((-(i as f64) / rows / settles).exp() - mean);
    recording.yc_v.iter_mut().flatten().enumerate().for_each(|(i, v)| *v *= gain(i));
    recording
}

/// Fifty hertz, more of it on one channel.
pub(super) fn hum(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (hz, phase) = (50.0 * draw.between(0.999, 1.001), draw.between(0.0, 6.0));
    let sizes = [draw.scale(1e-4, 0.1), draw.scale(1e-4, 0.1)];
    let times = recording.t_s.clone();
    for (v, size) in both(&mut recording).zip(sizes) {
        v.iter_mut().zip(&times).for_each(|(v, t)| *v += size * (std::f64::consts::TAU * hz * t + phase).sin());
    }
    recording
}

/// A channel that reads nothing now and then.
pub(super) fn loose(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (noise_v, n) = (made.noise_v, recording.len());
    let column = either(&mut recording, draw);
    for _ in 0..n.div_ceil(200) {
        let at = draw.below(n - 8);
        for v in &mut column[at..=at + draw.below(8)] {
            *v = draw.between(-noise_v, noise_v);
        }
    }
    recording
}

/// Something hits the bench and the pattern is elsewhere.
pub(super) fn knocked(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (at, by) = (stretch(recording.len(), draw).start, share(draw, 1e-3, 1.5));
    turn(&mut recording, |i| if i < at { 0.0 } else { by });
    recording
}

pub(super) fn exchanged(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let at = stretch(recording.len(), draw).start;
    if let (Some(x), Some(y)) = (&mut recording.xc_v, &mut recording.yc_v) {
        x[at..].swap_with_slice(&mut y[at..]);
    }
    recording
}

/// A shield that comes off.
pub(super) fn crosstalk(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (at, share) = (stretch(recording.len(), draw).start, share(draw, 1e-3, 0.1));
    if let (Some(x), Some(y)) = (&recording.xc_v, &mut recording.yc_v) {
        y.iter_mut().zip(x).skip(at).for_each(|(y, x)| *y += share * x);
    }
    recording
}

/// A cast to an integer instead of the nearest one.
pub(super) fn cut(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let levels = f64::from(1 << (6 + draw.below(7)));
    readouts(&mut recording, |v| (v * levels).trunc() / levels);
    recording
}

/// An amplifier that is near the end of what it can.
pub(super) fn soft(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rail = draw.scale(1.2, 10.0);
    either(&mut recording, draw).iter_mut().for_each(|v| *v = rail * (*v / rail).tanh());
    recording
}

/// Both channels rid of outliers by a median over some rows.
pub(super) fn median(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let half = 1 + draw.below(10);
    for v in both(&mut recording) {
        let middle = |rows: &[f64]| {
            let mut rows = rows.to_vec();
            rows.sort_by(f64::total_cmp);
            rows[rows.len() / 2]
        };
        let smooth: Vec<f64> = v.windows(2 * half + 1).map(middle).collect();
        v[half..half + smooth.len()].copy_from_slice(&smooth);
    }
    recording
}

/// A lock-in whose time constant is longer than a row.
pub(super) fn both_filtered(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let share = draw.scale(0.05, 0.9);
    for v in both(&mut recording) {
        let mut kept = v[0];
        for v in v.iter_mut() {
            kept += share * (*v - kept);
            *v = kept;
        }
    }
    recording
}

/// What a spreadsheet takes out of a column, of turns that are not whole.
pub(super) fn coupled(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    for v in both(&mut recording) {
        let mean = v.iter().sum::<f64>() / v.len() as f64;
        v.iter_mut().for_each(|v| *v -= mean);
    }
    recording
}

/// Each row is divided by its own length.
pub(super) fn normalised(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    if let (Some(x), Some(y)) = (&mut recording.xc_v, &mut recording.yc_v) {
        for (x, y) in x.iter_mut().zip(y) {
            let length = x.hypot(*y);
            (*x, *y) = (*x / length, *y / length);
        }
    }
    recording
}
