//! What a logger, its clock or a spreadsheet does to a recording.

use std::path::Path;

use cvg_calibration::recording::Recording;

use super::super::{Made, hold};
use super::{both, every_column, share, stretch};
use crate::bench::Draws;

pub(super) fn held(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rows = stretch(recording.len(), draw);
    hold(&mut recording, rows);
    recording
}

pub(super) fn slipped(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (rows, slip) = (stretch(recording.len(), draw), draw.scale(0.02, 2.0));
    recording.t_s[rows.start..].iter_mut().for_each(|t| *t += slip);
    recording
}

pub(super) fn milliseconds(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    recording.t_s.iter_mut().for_each(|t| *t *= 1000.0);
    recording
}

pub(super) fn fast_clock(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let factor = 1.0 + share(draw, 1e-4, 0.1);
    recording.t_s.iter_mut().for_each(|t| *t *= factor);
    recording
}

/// Rows lost without a gap in the time stamps.
pub(super) fn lost(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let out = stretch(recording.len(), draw);
    let rows: Vec<usize> = (0..recording.len()).filter(|i| !out.contains(i)).collect();
    every_column(&mut recording, &rows);
    recording
}

/// A block that was written twice, with time stamps that go on.
pub(super) fn doubled(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (twice, n) = (stretch(recording.len(), draw), recording.len());
    let rows: Vec<usize> = (0..twice.end).chain(twice.start..n).take(n).collect();
    every_column(&mut recording, &rows);
    recording
}

pub(super) fn reversed(made: &Made, _: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let rows: Vec<usize> = (0..recording.len()).rev().collect();
    every_column(&mut recording, &rows);
    recording
}

/// A gap that the time stamps show.
pub(super) fn missing(made: &Made, draw: &mut Draws) -> Recording {
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
pub(super) fn three_digits(made: &Made, draw: &mut Draws) -> Recording {
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
pub(super) fn filled_in(made: &Made, draw: &mut Draws) -> Recording {
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

/// A file to which the rows of another run were appended, with times that go on and the table of the first.
pub(super) fn two_in_one(made: &Made, draw: &mut Draws) -> Recording {
    let other = Made { rate_dps: made.rate_dps * (1.0 + share(draw, 1e-3, 1.0)), seed: made.seed + 5, ..made.clone() };
    let (mut recording, mut other) = (made.recording(), other.recording());
    let from = recording.len() / 4 + draw.below(recording.len() / 2);
    for (v, other) in both(&mut recording).zip(both(&mut other)) {
        v[from..].copy_from_slice(&other[from..]);
    }
    recording
}

/// Blocks of a network of which one overtook the other.
pub(super) fn out_of_order(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let n = recording.len();
    let (at, block) = (n / 8 + draw.below(n / 2), 1 + draw.below(n / 16));
    let mut rows: Vec<usize> = (0..n).collect();
    rows[at..at + 2 * block].rotate_left(block);
    every_column(&mut recording, &rows);
    recording
}

/// 9.3e-02 in a column that is too narrow for it.
pub(super) fn without_exponents(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let least = [1e-4, 1e-3, 1e-2, 0.1][draw.below(4)];
    let cut = |v: f64| if v.abs() < least && v != 0.0 { v / 10f64.powf(v.abs().log10().floor()) } else { v };
    both(&mut recording).flatten().for_each(|v| *v = cut(*v));
    recording
}

/// Channels that were read more slowly than the table and brought to its times by straight lines.
pub(super) fn resampled(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let step = 2 + draw.below(9);
    for v in both(&mut recording) {
        for i in 0..v.len() {
            let (from, to) = (i - i % step, (i - i % step + step).min(v.len() - 1));
            if i > from && to > from {
                v[i] = v[from] + (v[to] - v[from]) * (i - from) as f64 / (to - from) as f64;
            }
        }
    }
    recording
}

/// Rows that come in blocks and are stamped when they arrive, one right after the other.
pub(super) fn bursts(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let (block, apart_s) = (2 + draw.below(63), draw.scale(1e-6, 1e-3));
    let times = recording.t_s.clone();
    for (i, t) in recording.t_s.iter_mut().enumerate() {
        let last = (i - i % block + block - 1).min(times.len() - 1);
        *t = times[last] - f64::min(apart_s, 0.5 / made.sample_hz) * (last - i) as f64;
    }
    recording
}

fn quadratic(made: &Made, fast: f64) -> impl Fn(f64) -> f64 {
    let duration_s = made.duration_s;
    move |t| t * (1.0 + fast * (1.0 - t / duration_s))
}

/// Stamps of a clock that is off by less and less.
pub(super) fn warming_clock(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let stamp = quadratic(made, share(draw, 1e-5, 1e-2));
    recording.t_s.iter_mut().for_each(|t| *t = stamp(*t));
    recording
}

/// A buffer that overflows by a row whenever it is full, and stamps that are counted.
pub(super) fn lost_of_every_block(made: &Made, draw: &mut Draws) -> Recording {
    let mut recording = made.recording();
    let block = 16 << draw.below(6);
    let rows: Vec<usize> = (0..recording.len()).filter(|i| i % block != block - 1).collect();
    every_column(&mut recording, &rows);
    recording
}
