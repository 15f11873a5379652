//! Carrier to envelopes. Evenly sampled carriers go through the demodulator of the electronics; others, and those of more
//! points a period than it takes, or of too few of its windows, are fitted by x = o + x_c cos φ + x_s sin φ at the times of their rows. Either way the
//! rest point is part of the fit. The demodulator's reference follows the carrier; a window of two periods needs none that
//! follows.

use std::ops::Range;

use cvg_estimator::demodulator::{Demodulator, Window as Growing};
use cvg_estimator::nco::Oscillator;
use cvg_model::Envelope;
use nalgebra::{Matrix3, Vector3};

use super::{Carrier, MOST_WINDOWS};

/// One window.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Window {
    /// its middle, s
    pub(crate) t_s: f64,
    /// relative to a reference of constant frequency
    pub(crate) envelope: Envelope<f64>,
    /// of the forces, relative to the same reference; none where a force is missing
    pub(crate) forces: Option<Envelope<f64>>,
    pub(crate) rows: Range<usize>,
}

/// Z e^{iφ}
pub(crate) fn phased(e: &Envelope<f64>, phase: f64) -> Envelope<f64> {
    let (sin, cos) = phase.sin_cos();
    *e * cos + e.quarter_ahead() * sin
}

/// A row that is off its even place by more than this share of a period is not sampled evenly.
const EVEN: f64 = 0.002;
/// Periods and rows of a window at least.
const FEWEST_PERIODS: f64 = 8.0;
const FEWEST_ROWS: usize = 16;
const MOST_ROWS: usize = 10_000;
/// Periods of a window that is fitted at the times of its rows: whole ones, so that the rest point stays out of them.
const FITTED_PERIODS: f64 = 2.0;
/// Windows of the demodulator that are enough, and fitted ones of two periods, of which a quarter is held out; where there are
/// fewer, they are shorter. Engineering choice.
const ENOUGH_MIXED: usize = 256;
const ENOUGH_FITTED: f64 = 128.0;
/// Share of a phase's change from window to window that the reference's frequency follows.
const FOLLOWED: f64 = 0.1;
/// The furthest that the reference goes from where the carrier was found.
const FURTHEST: f64 = 0.05;
/// The smallest range of forces that the demodulator takes, V: of those that are nothing.
const SMALLEST_RANGE: f64 = 1e-8;

/// The envelopes of a carrier found at `frequency_hz`.
pub(crate) fn demodulate(carrier: Carrier<'_>, frequency_hz: f64) -> Vec<Window> {
    let step_s = carrier.step_s();
    let is_even = |(i, t): (usize, &f64)| (t - carrier.t_s[0] - i as f64 * step_s).abs() * frequency_hz < EVEN;
    if carrier.t_s.iter().enumerate().all(is_even)
        && let Some(windows) = mixed(&carrier, frequency_hz, step_s)
    {
        return windows;
    }
    fitted(&carrier, frequency_hz, step_s)
}

/// By how much the reference is to run faster, rad/s: a share of how the phase moved from one envelope to the next.
#[derive(Default)]
struct Follower {
    last: Option<Envelope<f64>>,
    ahead_rad_s: f64,
    limit_rad_s: f64,
}

impl Follower {
    fn follow(&mut self, now: Envelope<f64>, over_s: f64) {
        if let Some(last) = self.last {
            let cos = last.x_c * now.x_c + last.x_s * now.x_s + last.y_c * now.y_c + last.y_s * now.y_s;
            let sin = last.x_s * now.x_c - last.x_c * now.x_s + last.y_s * now.y_c - last.y_c * now.y_s;
            let moved = sin.atan2(cos) / over_s;
            if moved.is_finite() {
                self.ahead_rad_s = (self.ahead_rad_s + FOLLOWED * moved).clamp(-self.limit_rad_s, self.limit_rad_s);
            }
        }
        self.last = Some(now);
    }
}

/// By the electronics' own demodulator; `None` where it does not take this carrier.
fn mixed(carrier: &Carrier<'_>, frequency_hz: f64, step_s: f64) -> Option<Vec<Window>> {
    let rows = carrier.x.len();
    let enough = (FEWEST_PERIODS / (frequency_hz * step_s)).ceil();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive count, saturating")]
    let each = (enough as usize).max(FEWEST_ROWS).max(rows.div_ceil(MOST_WINDOWS)).min(MOST_ROWS);
    if rows / each < ENOUGH_MIXED {
        return None;
    }
    let range = |[x, y]: [&[f64]; 2]| 2.0 * x.iter().chain(y).fold(0.0, |m: f64, v| m.max(v.abs()));
    let samples = u16::try_from(each).ok()?;
    let demodulator = Demodulator::<f64>::new(samples, range([carrier.x, carrier.y])).ok()?;
    let of_forces = |f| Demodulator::<f64>::new(samples, range(f).max(SMALLEST_RANGE)).ok().map(|d| (d, f));
    let forces = carrier.forces.and_then(of_forces);
    let limit_rad_s = (FURTHEST * std::f64::consts::TAU * frequency_hz).min(0.1 / step_s);
    let oscillator = Oscillator::<f64>::new(frequency_hz, step_s, limit_rad_s).ok()?;
    let mut follower = Follower { limit_rad_s, ..Follower::default() };
    let mut phasor = oscillator.start();
    // how far the reference is ahead of one of constant frequency
    let mut ahead = 0.0;
    let mut out = Vec::with_capacity(rows / each);
    for first in (0..rows - rows % each).step_by(each) {
        phasor = oscillator.tune(&phasor, follower.ahead_rad_s);
        let begin = phasor;
        let mut grown = |demodulator: &Demodulator<f64>, [x, y]: [&[f64]; 2]| {
            phasor = begin;
            let mut window = Growing::begin(&phasor);
            for (x, y) in x[first..first + each].iter().zip(&y[first..first + each]) {
                demodulator.accumulate(&mut window, *x, *y, &phasor);
                phasor.advance();
            }
            demodulator.envelope(&window, &phasor)
        };
        let pushed = forces.as_ref().and_then(|(demodulator, f)| grown(demodulator, *f));
        let envelope = grown(&demodulator, [carrier.x, carrier.y])?;
        let middle_s = 0.5 * (each - 1) as f64 * step_s;
        let whole_s = each as f64 * step_s;
        let turn = ahead + follower.ahead_rad_s * middle_s;
        out.push(Window {
            t_s: carrier.t_s[0] + first as f64 * step_s + middle_s,
            envelope: phased(&envelope, turn),
            forces: pushed.map(|f| phased(&f, turn)),
            rows: first..first + each,
        });
        ahead += follower.ahead_rad_s * whole_s;
        let now = out[out.len() - 1].envelope;
        follower.follow(phased(&now, -ahead), whole_s);
    }
    Some(out)
}

/// By least squares at the times of the rows.
fn fitted(carrier: &Carrier<'_>, frequency_hz: f64, step_s: f64) -> Vec<Window> {
    let t = carrier.t_s;
    let duration_s = t[t.len() - 1] - t[0];
    let rows_of = |periods: f64| periods / (frequency_hz * step_s);
    let needed = (FEWEST_ROWS as f64 / rows_of(1.0)).max(duration_s * frequency_hz / MOST_WINDOWS as f64);
    let windows_of = |periods: f64| duration_s * frequency_hz / needed.max(periods).ceil();
    let periods = if windows_of(FITTED_PERIODS) < ENOUGH_FITTED { 1.0 } else { FITTED_PERIODS };
    let length_s = needed.max(periods).ceil() / frequency_hz;
    // of a short film, windows that overlap by half: what they have in common is noise that remembers
    let step_s = if windows_of(periods) < ENOUGH_FITTED { 0.5 * length_s } else { length_s };
    let mut out = Vec::new();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive count, saturating")]
    let count = ((duration_s - length_s) / step_s).floor() as usize + 1;
    for k in 0..count {
        let from_s = t[0] + k as f64 * step_s;
        let place = |at_s: f64| t.partition_point(|t| *t < at_s);
        let rows = place(from_s)..place(from_s + length_s);
        if let Some(envelope) = least_squares(t, [carrier.x, carrier.y], &rows, frequency_hz) {
            let forces = carrier.forces.and_then(|f| least_squares(t, f, &rows, frequency_hz));
            out.push(Window { t_s: from_s + 0.5 * length_s, envelope, forces, rows });
        }
    }
    out
}

/// Phase of the constant reference at the time `t_s` after the first row, rad.
fn reference(frequency_hz: f64, t_s: f64) -> f64 {
    std::f64::consts::TAU * (frequency_hz * t_s).fract()
}

/// o, x_c, x_s of two channels over some rows; the envelope changes evenly within a window, so that it is that of its middle.
fn least_squares(
    t_s: &[f64],
    [of_x, of_y]: [&[f64]; 2],
    rows: &Range<usize>,
    frequency_hz: f64,
) -> Option<Envelope<f64>> {
    if rows.len() < FEWEST_ROWS / 2 {
        return None;
    }
    let (mut matrix, mut x, mut y) = (Matrix3::zeros(), Vector3::zeros(), Vector3::zeros());
    for i in rows.clone() {
        let (sin, cos) = reference(frequency_hz, t_s[i] - t_s[0]).sin_cos();
        let row = Vector3::new(1.0, cos, sin);
        matrix += row * row.transpose();
        x += row * of_x[i];
        y += row * of_y[i];
    }
    let factors = matrix.cholesky()?;
    // a window whose rows do not cover the phases tells nothing
    let least = factors.l_dirty().diagonal().iter().fold(f64::INFINITY, |m: f64, d| m.min(*d));
    if least * least < 0.1 * rows.len() as f64 {
        return None;
    }
    let (x, y) = (factors.solve(&x), factors.solve(&y));
    let envelope = Envelope::new(x[1], x[2], y[1], y[2]);
    envelope.pendulum().e.is_finite().then_some(envelope)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A carrier of an orbit at rest, its offset, and its times.
    fn carrier(times: impl Iterator<Item = f64>, hz: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>, Envelope<f64>) {
        let orbit = cvg_model::Orbit { a: 100.0, q: 3.0, theta: 0.6, delta: 0.2 }.envelope();
        let t: Vec<f64> = times.collect();
        let at = |c: f64, s: f64, o: f64| {
            t.iter()
                .map(|t| o + c * (std::f64::consts::TAU * hz * t).cos() + s * (std::f64::consts::TAU * hz * t).sin())
                .collect()
        };
        let (x, y) = (at(orbit.x_c, orbit.x_s, 320.0), at(orbit.y_c, orbit.y_s, 240.0));
        (t, x, y, orbit)
    }

    fn same_orbit(windows: &[Window], orbit: &Envelope<f64>, within: f64) {
        assert!(windows.len() > 10, "{}", windows.len());
        let expected = orbit.pendulum();
        for w in windows {
            let p = w.envelope.pendulum();
            for (seen, wanted) in [(p.e, expected.e), (p.r, expected.r), (p.s, expected.s), (p.q, expected.q)] {
                assert!((seen - wanted).abs() < within * expected.e, "{seen} {wanted}");
            }
        }
    }

    #[test]
    fn an_even_carrier_has_the_envelope_of_its_orbit() {
        let (t, x, y, orbit) = carrier((0..40_000).map(|i| f64::from(i) * 5e-6), 15_213.7);
        same_orbit(&demodulate(Carrier { t_s: &t, x: &x, y: &y, forces: None }, 15_213.0), &orbit, 1e-3);
    }

    #[test]
    fn a_camera_that_stumbles_sees_the_same_orbit() {
        let jitter = |i: i32| 0.04 * f64::from(i) + 0.012 * (f64::from(i) * 12.9898).sin();
        let (t, x, y, orbit) = carrier((0..3000).map(jitter), 0.36);
        same_orbit(&demodulate(Carrier { t_s: &t, x: &x, y: &y, forces: None }, 0.36), &orbit, 1e-9);
    }

    #[test]
    fn a_short_film_of_few_frames_has_windows_enough() {
        let (t, x, y, orbit) = carrier((0..4500).map(|i| f64::from(i) * 0.04), 0.36);
        let windows = demodulate(Carrier { t_s: &t, x: &x, y: &y, forces: None }, 0.36);
        assert!(windows.len() > 100, "{}", windows.len());
        same_orbit(&windows, &orbit, 1e-9);
        let (t, x, y, orbit) = carrier((0..7200).map(|i| f64::from(i) * 0.2), 0.36);
        let windows = demodulate(Carrier { t_s: &t, x: &x, y: &y, forces: None }, 0.36);
        assert!(windows.len() > 200, "{}", windows.len());
        same_orbit(&windows, &orbit, 1e-9);
    }

    #[test]
    fn a_reference_that_is_a_little_off_follows_the_carrier() {
        let (t, x, y, _) = carrier((0..400_000).map(|i| f64::from(i) * 5e-6), 15_220.0);
        let windows = demodulate(Carrier { t_s: &t, x: &x, y: &y, forces: None }, 15_200.0);
        // relative to the constant reference the envelope turns at the whole difference
        let (one, other) = (&windows[windows.len() - 2], &windows[windows.len() - 1]);
        let (z, w) = (one.envelope, other.envelope);
        let (cos, sin) = (
            z.x_c * w.x_c + z.x_s * w.x_s + z.y_c * w.y_c + z.y_s * w.y_s,
            z.x_s * w.x_c - z.x_c * w.x_s + z.y_s * w.y_c - z.y_c * w.y_s,
        );
        let hz = sin.atan2(cos) / (other.t_s - one.t_s) / std::f64::consts::TAU;
        assert!((hz - 20.0).abs() < 0.01, "{hz}");
    }
}
