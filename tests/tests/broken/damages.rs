//! What can be wrong with a recording although it is read: each is done to one run, or to all runs of a campaign.

use std::path::Path;

use cvg_calibration::recording::{Channel, Recording};
use cvg_tests::bench::Draws;

use super::{Made, hold};

/// Where a damage can be told from a sound recording at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shows {
    /// in the run itself
    Alone,
    /// beside sound runs only: by itself it is a sound run of another instrument, or at another rate
    Beside,
}

/// One way for a recording to be wrong.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Damage {
    pub(crate) name: &'static str,
    pub(crate) shows: Shows,
    /// does it to the recording of a run that was made so
    pub(crate) of: fn(&Made, &mut Draws) -> Recording,
}

/// All of them.
pub(crate) const DAMAGES: &[Damage] = &[
    alone("held rows", held),
    alone("a clock that slips", slipped),
    beside("rates by a factor", factor),
    alone("rates in rad/s", radians),
    alone("times in ms", milliseconds),
    alone("swapped channels", swapped),
    alone("a channel without its sign", negated),
    alone("references that disagree", contradicted),
    alone("clipping", clipped),
    alone("spikes", spikes),
    alone("lost rows", lost),
    // at one rate a channel that is late is one that is not square to the other
    beside("a channel one row late", one_row_late),
    alone("a channel with a clock of its own", own_clock),
    alone("rows that are there twice", doubled),
    beside("another gain", other_gain),
    beside("another device", other_device),
    alone("another amplitude", other_amplitude),
    alone("a converter that wraps", wraps),
    alone("three digits", three_digits),
    beside("a table that saturates", saturated),
    alone("a table that follows late", late),
    alone("rates without their sign", unsigned),
    alone("minutes that are missing", missing),
    beside("a filter on one channel", filtered),
    alone("rows from last to first", reversed),
    alone("means at the wrap of the table", mean_at_wrap),
    alone("a table with jitter", jitter),
    alone("outliers in the rate", outliers),
    alone("rows filled in by lines", filled_in),
    beside("a rate with an offset", biased_rate),
    alone("a channel whose range is switched", range_switched),
    beside("a clock that runs fast", fast_clock),
    alone("one channel in the other's place for a while", one_for_other),
    alone("a plug that is turned halfway", turned_plug),
    alone("a burst of noise", burst),
    alone("eight bits", eight_bits),
    beside("an offset of a channel", offset),
    alone("rates of another moment", delayed_rate),
    alone("a bit that hangs", hanging_bit),
];

const fn alone(name: &'static str, of: fn(&Made, &mut Draws) -> Recording) -> Damage {
    Damage { name, shows: Shows::Alone, of }
}

const fn beside(name: &'static str, of: fn(&Made, &mut Draws) -> Recording) -> Damage {
    Damage { name, shows: Shows::Beside, of }
}

// Pieces

/// A stretch of rows in the middle of a recording.
fn stretch(rows: usize, draw: &mut Draws) -> std::ops::Range<usize> {
    let at = rows / 8 + draw.below(rows / 2);
    at..at + 2 + draw.below(rows / 16)
}

fn both(recording: &mut Recording) -> impl Iterator<Item = &mut Vec<f64>> {
    [&mut recording.xc_v, &mut recording.yc_v].into_iter().flatten()
}

/// X, or Y, as it is drawn.
fn either<'a>(recording: &'a mut Recording, draw: &mut Draws) -> &'a mut Vec<f64> {
    let channel = if draw.below(2) == 0 { &mut recording.xc_v } else { &mut recording.yc_v };
    channel.as_mut().unwrap()
}

fn readouts(recording: &mut Recording, change: impl Fn(f64) -> f64) {
    both(recording).flatten().for_each(|v| *v = change(*v));
}

/// A share that is now small and now large, of either sign.
fn share(draw: &mut Draws, low: f64, high: f64) -> f64 {
    let sign = if draw.below(2) == 0 { 1.0 } else { -1.0 };
    sign * draw.scale(low, high)
}

/// The recording of a run, of whose table something else is told.
fn retold(made: &Made, told: impl Fn(usize, f64) -> f64) -> Recording {
    let mut recording = made.recording();
    made.tell(&mut recording, made.rates().iter().enumerate().map(|(i, rate)| told(i, *rate)).collect());
    recording
}

/// Columns made anew, the value of a row from a column and the row.
fn every_column(recording: &mut Recording, rows: &[usize]) {
    for channel in Channel::ALL.into_iter().filter(|c| *c != Channel::Time) {
        if let Some(values) = recording.channel(channel) {
            let anew = rows.iter().map(|i| values[*i]).collect();
            recording.set_channel(channel, anew);
        }
    }
    recording.t_s.truncate(rows.len());
}

// The recording

fn held(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rows = stretch(recording.len(), draw);
    hold(&mut recording, rows);
    recording
}

fn slipped(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (rows, slip) = (stretch(recording.len(), draw), draw.scale(0.02, 2.0));
    recording.t_s[rows.start..].iter_mut().for_each(|t| *t += slip);
    recording
}

fn milliseconds(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    recording.t_s.iter_mut().for_each(|t| *t *= 1000.0);
    recording
}

fn fast_clock(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let factor = 1.0 + share(draw, 1e-4, 0.1);
    recording.t_s.iter_mut().for_each(|t| *t *= factor);
    recording
}

/// Rows lost without a gap in the time stamps.
fn lost(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let out = stretch(recording.len(), draw);
    let rows: Vec<usize> = (0..recording.len()).filter(|i| !out.contains(i)).collect();
    every_column(&mut recording, &rows);
    recording
}

/// A block that was written twice, with time stamps that go on.
fn doubled(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (twice, n) = (stretch(recording.len(), draw), recording.len());
    let rows: Vec<usize> = (0..twice.end).chain(twice.start..n).take(n).collect();
    every_column(&mut recording, &rows);
    recording
}

fn reversed(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rows: Vec<usize> = (0..recording.len()).rev().collect();
    every_column(&mut recording, &rows);
    recording
}

/// A gap that the time stamps show.
fn missing(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let at = recording.len() / 6 + draw.below(recording.len() / 3);
    let out = at..at + recording.len() / 5 + draw.below(recording.len() / 5);
    let times = recording.t_s.clone();
    let rows: Vec<usize> = (0..recording.len()).filter(|i| !out.contains(i)).collect();
    every_column(&mut recording, &rows);
    recording.t_s = rows.iter().map(|i| times[*i]).collect();
    recording
}

/// Values with three digits, times with two to four places, as a spreadsheet shows them, read from a file.
fn three_digits(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let places = 10f64.powi(2 + i32::try_from(draw.below(3)).unwrap());
    recording.t_s.iter_mut().for_each(|t| *t = (*t * places).round() / places);
    let round = |v: f64| format!("{v:.2e}").parse::<f64>().unwrap();
    let columns = [&mut recording.rate_dps, &mut recording.table_deg, &mut recording.xc_v, &mut recording.yc_v];
    columns.into_iter().flatten().flatten().for_each(|v| *v = round(*v));
    let mut file = Vec::new();
    recording.write_csv(&mut file).unwrap();
    let source = recording.source.clone();
    Recording::parse_csv(&file, Path::new(&source)).unwrap_or(recording)
}

/// A logger that fills what it missed with straight lines.
fn filled_in(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let out = stretch(recording.len(), draw);
    for v in both(&mut recording) {
        let (from, to) = (v[out.start - 1], v[out.end]);
        let steps = (out.len() + 1) as f64;
        for (n, i) in out.clone().enumerate() {
            v[i] = from + (to - from) * (n + 1) as f64 / steps;
        }
    }
    recording
}

// The table

fn factor(made: &Made, draw: &mut Draws) -> Recording {
    let factor = 1.0 + share(draw, 1e-4, 0.1);
    retold(made, |_, rate| factor * rate)
}

fn biased_rate(made: &Made, draw: &mut Draws) -> Recording {
    let offset = share(draw, 1e-3, 5.0);
    retold(made, |_, rate| rate + offset)
}

fn radians(made: &Made, _: &mut Draws) -> Recording {
    retold(made, |_, rate| rate.to_radians())
}

/// What was commanded is recorded; the table can't turn as fast.
fn saturated(made: &Made, draw: &mut Draws) -> Recording {
    let short = 1.0 - draw.scale(1e-3, 0.5);
    retold(made, |_, rate| rate / short)
}

/// What was commanded is recorded; the table takes its time to get there.
fn late(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rise_s = draw.scale(0.01, 0.1) * made.duration_s;
    // the table was behind by rise_s (1 − e^{−t/rise}) of its rate, so that it turned less than is told
    let behind = |t: f64| made.rate_dps * rise_s * (1.0 - (-t / rise_s).exp());
    let gain = if made.is_sensor { 1.0 } else { -made.angular_gain };
    let back: Vec<f64> = made.times().iter().map(|t| -gain * behind(*t).to_radians()).collect();
    let (Some(x), Some(y)) = (&mut recording.xc_v, &mut recording.yc_v) else { unreachable!() };
    for ((x, y), by) in x.iter_mut().zip(y).zip(back) {
        let ([cos, sin], [a, b]) = ([by.cos(), by.sin()], [*x, *y / super::RATIO]);
        (*x, *y) = (a * cos - b * sin, super::RATIO * (a * sin + b * cos));
    }
    recording
}

fn unsigned(made: &Made, _: &mut Draws) -> Recording {
    retold(made, |_, rate| rate.abs())
}

fn delayed_rate(made: &Made, draw: &mut Draws) -> Recording {
    let (rates, by) = (made.rates(), 1 + draw.below(made.times().len() / 20));
    retold(made, |i, _| rates[i.saturating_sub(by)])
}

/// One row of a thousand and at least one, with a rate that is none.
fn outliers(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let size = [10.0, 1e3, -1.0, 0.0, 1e6][draw.below(5)];
    let column = recording.rate_dps.as_mut().or(recording.table_deg.as_mut()).unwrap();
    for _ in 0..column.len().div_ceil(1000) {
        let at = draw.below(column.len());
        column[at] *= size;
    }
    recording
}

fn contradicted(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rate = made.rate_dps * draw.between(0.3, 1.8);
    recording.rate_dps = Some(made.rates());
    recording.table_deg = Some(recording.t_s.iter().map(|t| (rate * t).rem_euclid(360.0)).collect());
    recording
}

fn jitter(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let size = draw.scale(1e-3, 1.0);
    let column = recording
        .table_deg
        .get_or_insert_with(|| made.turned(&made.rates()).iter().map(|d| d.rem_euclid(360.0)).collect());
    column.iter_mut().for_each(|d| *d = (*d + draw.between(-size, size)).rem_euclid(360.0));
    recording
}

/// Rows that are the mean of what was before and after the wrap of the table's angle.
fn mean_at_wrap(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let turned = made.turned(&made.rates());
    let column = turned.iter().map(|d| d.rem_euclid(360.0)).collect::<Vec<f64>>();
    let wraps = |i: usize| i > 0 && (column[i] - column[i - 1]).abs() > 180.0;
    let mean = |i: usize| if wraps(i) { 0.5 * (column[i] + column[i - 1]) } else { column[i] };
    recording.table_deg = Some((0..column.len()).map(mean).collect());
    recording
}

// The channels

fn swapped(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    std::mem::swap(&mut recording.xc_v, &mut recording.yc_v);
    recording
}

fn negated(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    either(&mut recording, draw).iter_mut().for_each(|v| *v = -*v);
    recording
}

fn clipped(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let limit = draw.between(0.5, 1.0);
    either(&mut recording, draw).iter_mut().for_each(|v| *v = v.clamp(-limit, limit));
    recording
}

fn spikes(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    both(&mut recording).for_each(|v| v.iter_mut().skip(17).step_by(50).for_each(|v| *v += 3.0));
    recording
}

fn one_row_late(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    either(&mut recording, draw).rotate_right(1);
    let rows: Vec<usize> = (1..recording.len()).collect();
    every_column(&mut recording, &rows);
    recording
}

fn own_clock(made: &Made, draw: &mut Draws) -> Recording {
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

fn other_gain(made: &Made, draw: &mut Draws) -> Recording {
    let other = Made { angular_gain: made.angular_gain * (1.0 + share(draw, 1e-4, 0.2)), ..made.clone() };
    other.recording()
}

fn other_device(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = other_gain(made, draw);
    let ratio = 1.0 + share(draw, 1e-3, 0.1);
    recording.yc_v.iter_mut().flatten().for_each(|v| *v *= ratio);
    recording
}

fn other_amplitude(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let size = draw.scale(0.3, 3.0);
    readouts(&mut recording, |v| size * v);
    recording
}

fn wraps(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let end = draw.between(0.7, 1.0);
    let wrapped = |v: f64| (v + end).rem_euclid(2.0 * end) - end;
    either(&mut recording, draw).iter_mut().for_each(|v| *v = wrapped(*v));
    recording
}

/// A low pass of the first order on X or Y.
fn filtered(made: &Made, draw: &mut Draws) -> Recording {
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

fn range_switched(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (rows, gain) = (stretch(recording.len(), draw), 1.0 + share(draw, 1e-3, 0.3));
    either(&mut recording, draw)[rows.start..].iter_mut().for_each(|v| *v *= gain);
    recording
}

fn one_for_other(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rows = stretch(recording.len(), draw);
    if let (Some(x), Some(y)) = (&recording.xc_v, &mut recording.yc_v) {
        y[rows.clone()].copy_from_slice(&x[rows]);
    }
    recording
}

fn turned_plug(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rows = stretch(recording.len(), draw);
    either(&mut recording, draw)[rows.start..].iter_mut().for_each(|v| *v = -*v);
    recording
}

fn burst(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (rows, size) = (stretch(recording.len(), draw), draw.scale(0.01, 1.0));
    both(&mut recording).for_each(|v| v[rows.clone()].iter_mut().for_each(|v| *v += draw.between(-size, size)));
    recording
}

fn eight_bits(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    readouts(&mut recording, |v| (v * 100.0).round() / 100.0);
    recording
}

fn offset(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let by = share(draw, 1e-3, 0.1);
    either(&mut recording, draw).iter_mut().for_each(|v| *v += by);
    recording
}

/// A converter of sixteen bits of which one of the upper ones is always set, or never.
fn hanging_bit(made: &Made, draw: &mut Draws) -> Recording {
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
