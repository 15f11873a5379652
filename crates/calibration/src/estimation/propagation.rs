//! One pass of a hypothesis over a segment of a track: at each sample, what is left of the angle and of the amplitude
//! when the hypothesis has said all it can, and how that changes with the unknowns.
//!
//! The angle must obey Equation 1 and the mechanics, θ = θ_b ± kα + ∫θ̇ dt; ln of the amplitude must obey the energy
//! balance, ln a = c + ∫ȧ/a dt. The integrals are taken along the measured motion, so that a large pattern angle never
//! enters a linearisation. Nothing is stored: one hour at 1 kHz costs no more memory than one second.

use cvg_model::Envelope;
use cvg_model::effects::Moment;

use crate::data::track::{Segment, Track, wrapped};
use crate::model::hypothesis::Hypothesis;
use crate::model::jet::Jet;
use crate::model::prediction::{Predictor, Vibration, quantity};
use crate::model::unknowns::Unknowns;
use crate::recording::Instrument;

/// What a pass says of one sample.
#[derive(Debug)]
pub(crate) struct Row<'a> {
    /// sample of the track
    pub(crate) index: usize,
    /// input angle since the start of the segment, rad
    pub(crate) turned: f64,
    /// nominal precession rate, rad/s
    pub(crate) precession: f64,
    /// the vibration
    pub(crate) vibration: Envelope<f64>,
    /// precession by the mechanics and the commands since the start of the segment, rad
    pub(crate) drift: f64,
    /// angle observed minus predicted, rad, within ± half a period
    pub(crate) angle: f64,
    /// ln of the amplitude
    pub(crate) ln_amplitude: f64,
    /// ȧ/a by the mechanics and the commands, 1/s
    pub(crate) growth: f64,
    /// ln of the amplitude, observed minus predicted
    pub(crate) amplitude: f64,
    /// change of the predicted angle (less the observed) per unknown
    pub(crate) angle_slopes: &'a [f64],
    /// change of the predicted ln amplitude (less the observed) per unknown
    pub(crate) amplitude_slopes: &'a [f64],
}

/// Where a segment starts: what the integrals do not know.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Start {
    /// pattern angle at zero input angle of the segment, rad: the bias θ_b
    pub(crate) angle: f64,
    /// ln of the amplitude
    pub(crate) amplitude: f64,
    /// drift of the pattern that no record explains, rad/s
    pub(crate) drift: f64,
}

/// How a segment is propagated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stepping {
    /// every how many samples
    pub(crate) stride: usize,
    /// a residual of the angle beyond this, rad, is a spike: the integrals pass over its sample
    pub(crate) spike: f64,
}

impl Stepping {
    /// Every `stride` samples, all believed.
    pub(crate) fn every(stride: usize) -> Self {
        Self { stride, spike: f64::INFINITY }
    }
}

/// So many samples in a row are no spikes: the prediction is off, and would be lost for good without its integrals.
const MOST_PASSED_OVER: usize = 3;

/// Walks `segment` and hands each row to `take`.
pub(crate) fn propagate(
    track: &Track,
    segment: &Segment,
    hypothesis: &Hypothesis,
    unknowns: &Unknowns,
    start: Start,
    stepping: Stepping,
    mut take: impl FnMut(&Row<'_>),
) {
    let stride = stepping.stride;
    let n = unknowns.all.len();
    let predictor = Predictor::new(hypothesis, unknowns);
    let mut vibration = Vibration::new();
    // integrals of θ̇ and ȧ/a: [the hypothesis itself, then per unknown]
    let mut integrals = Integrals::new(2 * (n + 1));
    let mut excess = Jet::constant(0.0);
    // what the input effects added before the segment: the table's angle is 0 where the recording starts
    let mut ahead = 0.0;
    let mut integrands = vec![0.0; 2 * (n + 1)];
    let (mut angle_slopes, mut amplitude_slopes) = (vec![0.0; n], vec![0.0; n]);
    let sense = hypothesis.sense();
    let harmonic = hypothesis.input_harmonic();
    let zero_input = track.input_rad[segment.range.start];
    if harmonic > 0.0 {
        let before: Vec<usize> = (0..segment.range.start).step_by(stride).chain([segment.range.start]).collect();
        for step in before.windows(2) {
            ahead += excess_angle(track, (step[0], ahead), step[1], &predictor, harmonic).value;
        }
    }
    let mut last: Option<usize> = None;
    let mut passed_over = 0;
    for i in segment.range.clone().step_by(stride) {
        let rate = track.rate(i);
        let at =
            Moment { t_s: track.t_s[i], table_rad: track.input_rad[i], precession_rad_s: hypothesis.precession(rate) };
        predictor.predict(track.envelope(i), track.commands(i, stride), &at, &mut vibration);
        if hypothesis.instrument == Instrument::Gyroscope {
            integrands[0] = vibration.theta_rate;
            integrands[n + 1] = vibration.growth;
            for (u, s) in vibration.slopes.iter().enumerate() {
                integrands[1 + u] = s[quantity::THETA_RATE];
                integrands[n + 2 + u] = s[quantity::GROWTH];
            }
        }
        if let Some(from) = last.filter(|_| harmonic > 0.0) {
            excess = excess + excess_angle(track, (from, ahead + excess.value), i, &predictor, harmonic);
        }
        last = Some(i);
        let turned = track.input_rad[i] - zero_input;
        let input = turned + excess.value;
        let along = start.angle
            + start.drift * (track.t_s[i] - track.t_s[segment.range.start])
            + sense * hypothesis.angular_gain * input;
        let off = wrapped(vibration.theta - along - integrals.ahead(track.t_s[i]), hypothesis.period_rad);
        if hypothesis.instrument == Instrument::Gyroscope {
            let believed = off.abs() <= stepping.spike || integrals.known == 0 || passed_over == MOST_PASSED_OVER;
            passed_over = if believed { 0 } else { passed_over + 1 };
            if believed {
                integrals.extend_to(track.t_s[i], &integrands);
            }
        }
        let predicted = along + integrals.sum[0];
        let ln_a = start.amplitude + integrals.sum[n + 1];
        for (u, s) in vibration.slopes.iter().enumerate() {
            angle_slopes[u] = integrals.sum[1 + u] - s[quantity::THETA];
            amplitude_slopes[u] = integrals.sum[n + 2 + u] - s[quantity::LN_AMPLITUDE];
        }
        if let Some(k) = unknowns.angular_gain {
            angle_slopes[k] = sense * input;
        }
        for (lane, &u) in unknowns.input.columns.iter().enumerate() {
            angle_slopes[u] = sense * hypothesis.angular_gain * excess.slope[lane];
        }
        take(&Row {
            index: i,
            turned,
            precession: at.precession_rad_s,
            vibration: vibration.envelope,
            drift: integrals.sum[0],
            angle: wrapped(vibration.theta - predicted, hypothesis.period_rad),
            ln_amplitude: vibration.ln_amplitude,
            growth: vibration.growth,
            amplitude: vibration.ln_amplitude - ln_a,
            angle_slopes: &angle_slopes,
            amplitude_slopes: &amplitude_slopes,
        });
    }
}

/// Largest step of the table's harmonic within one quadrature interval, rad.
const LARGEST_PHASE_STEP: f64 = 0.5;

/// The input angle that the input effects add between two samples, rad, with slopes: two-point Gauss quadrature on
/// pieces over which the table's harmonic turns little. Between samples the table turns evenly but for what the effects
/// add, `excess` up to the first of them: a ripple of the rate goes by the angle that it made itself.
fn excess_angle(
    track: &Track,
    (from, excess): (usize, f64),
    to: usize,
    predictor: &Predictor<'_>,
    harmonic: f64,
) -> Jet {
    let (t0, t1) = (track.t_s[from], track.t_s[to]);
    let (a0, a1) = (track.input_rad[from], track.input_rad[to]);
    let rate = (a1 - a0) / (t1 - t0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive count, saturating")]
    let pieces = ((harmonic * (a1 - a0).abs() / LARGEST_PHASE_STEP).ceil() as usize).clamp(1, 10_000);
    let h = 1.0 / pieces as f64;
    let mut sum = Jet::constant(0.0);
    for piece in 0..pieces {
        for node in [-0.5 / 3f64.sqrt(), 0.5 / 3f64.sqrt()] {
            let s = h * (piece as f64 + 0.5 + node);
            let at = Moment {
                t_s: t0 + s * (t1 - t0),
                table_rad: a0 + s * (a1 - a0) + excess + 0.5 * h * (t1 - t0) * sum.value,
                precession_rad_s: predictor.hypothesis.precession(rate),
            };
            sum = sum + predictor.excess_rate(rate, &at);
        }
    }
    sum * Jet::constant(0.5 * h * (t1 - t0))
}

/// Running integrals of sampled quantities: the Adams–Moulton rule of fourth order on even samples, the trapezium
/// where the spacing changes.
struct Integrals {
    sum: Vec<f64>,
    /// the last three integrands, newest first, and their times
    past: [Vec<f64>; 3],
    times: [f64; 3],
    known: usize,
}

impl Integrals {
    fn new(n: usize) -> Self {
        Self { sum: vec![0.0; n], past: [vec![0.0; n], vec![0.0; n], vec![0.0; n]], times: [0.0; 3], known: 0 }
    }

    /// The first of them at a time not far ahead, from what is known so far.
    fn ahead(&self, t: f64) -> f64 {
        let since = if self.known > 0 { t - self.times[0] } else { 0.0 };
        self.sum[0] + self.past[0][0] * since
    }

    fn extend_to(&mut self, t: f64, f: &[f64]) {
        if self.known > 0 {
            let h = t - self.times[0];
            let even = self.known == 3
                && ((self.times[0] - self.times[1]) - h).abs() < 0.01 * h
                && ((self.times[1] - self.times[2]) - h).abs() < 0.01 * h;
            let [p1, p2, p3] = &self.past;
            if even {
                let k = h / 24.0;
                for (i, s) in self.sum.iter_mut().enumerate() {
                    *s += k * (9.0 * f[i] + 19.0 * p1[i] - 5.0 * p2[i] + p3[i]);
                }
            } else {
                for (i, s) in self.sum.iter_mut().enumerate() {
                    *s += 0.5 * h * (f[i] + p1[i]);
                }
            }
        }
        self.past.rotate_right(1);
        self.past[0].copy_from_slice(f);
        self.times.rotate_right(1);
        self.times[0] = t;
        self.known = (self.known + 1).min(3);
    }
}
