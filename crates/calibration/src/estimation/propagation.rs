//! One pass of a hypothesis over a segment of a track: at each sample, what is left of the angle and of the amplitude
//! when the hypothesis has said all it can, and how that changes with the unknowns.
//!
//! The angle must obey Equation 1 and the mechanics, θ = θ_b ± kα + ∫θ̇ dt; ln of the amplitude must obey the energy
//! balance, ln a = c + ∫ȧ/a dt. The integrals are taken along the measured motion, so that a large pattern angle never
//! enters a linearisation. Nothing is stored: one hour at 1 kHz costs no more memory than one second.

use cvg_model::Envelope;
use cvg_model::effects::Moment;

use crate::data::track::{Segment, Track};
use crate::model::hypothesis::Hypothesis;
use crate::model::jet::Jet;
use crate::model::prediction::{Predictor, Vibration, quantity};
use crate::model::unknowns::Unknowns;
use crate::numerics::angles::wrapped;
use crate::recording::Instrument;

/// What a pass says of one sample.
#[derive(Debug)]
pub(crate) struct Row<'a> {
    /// sample of the track
    pub(crate) index: usize,
    /// input angle since the start of the segment, rad
    pub(crate) turned: f64,
    /// nominal precession rate, rad/s, the mean over the latency of the output
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
    /// Every sample but the spikes.
    pub(crate) fn without(spike: f64) -> Self {
        Self { stride: 1, spike }
    }

    /// Every `stride` samples, all believed.
    pub(crate) fn every(stride: usize) -> Self {
        Self { stride, spike: f64::INFINITY }
    }
}

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
    let n = unknowns.all.len();
    let predictor = Predictor::new(hypothesis, unknowns);
    let mut vibration = Vibration::new();
    let mut excess = Excess::before(track, segment, &predictor, unknowns, stepping.stride);
    let mut travelled = Travelled::new(n);
    let (mut angle_slopes, mut amplitude_slopes) = (vec![0.0; n], vec![0.0; n]);
    let sense = hypothesis.sense();
    let moment = if hypothesis.reads_commands() { Track::moment } else { Track::instant };
    let zero_input = track.input_rad[segment.range.start];
    let latency_s = hypothesis.latency_s();
    for i in segment.range.clone().step_by(stepping.stride) {
        // a late output turned meanwhile at the mean rate since, which is not that of the sample where the rate changes
        let at = moment(track, i, hypothesis.precession(track.mean_rate_before(i, latency_s)));
        predictor.predict(track.envelope(i), track.commands(i, stepping.stride), &at, &mut vibration);
        excess.extend_to(track, i);
        let turned = track.input_rad[i] - zero_input;
        let input = turned + excess.angle();
        let along = start.angle
            + start.drift * (track.t_s[i] - track.t_s[segment.range.start])
            + sense * hypothesis.angular_gain * input;
        if hypothesis.instrument == Instrument::Gyroscope {
            let precessed = travelled.integrals.reaching(track.t_s[i], vibration.theta_rate);
            let off = wrapped(vibration.theta - along - precessed, hypothesis.period_rad);
            travelled.extend_to(track, i, &vibration, off.abs() <= stepping.spike);
        }
        let [of_angle, of_amplitude] = travelled.sums();
        for (u, s) in vibration.slopes.iter().enumerate() {
            angle_slopes[u] = of_angle[1 + u] - s[quantity::THETA];
            amplitude_slopes[u] = of_amplitude[1 + u] - s[quantity::LN_AMPLITUDE];
        }
        if let Some(k) = unknowns.angular_gain {
            angle_slopes[k] = sense * input;
        }
        excess.slopes(sense * hypothesis.angular_gain, &mut angle_slopes);
        take(&Row {
            index: i,
            turned,
            precession: at.precession_rad_s,
            vibration: vibration.envelope,
            drift: of_angle[0],
            angle: wrapped(vibration.theta - (along + of_angle[0]), hypothesis.period_rad),
            ln_amplitude: vibration.ln_amplitude,
            growth: vibration.growth,
            amplitude: vibration.ln_amplitude - (start.amplitude + of_amplitude[0]),
            angle_slopes: &angle_slopes,
            amplitude_slopes: &amplitude_slopes,
        });
    }
}

/// So many samples in a row are no spikes: the prediction is off, and would be lost for good without its integrals.
const MOST_PASSED_OVER: usize = 3;

/// What the mechanics and the commands did since the start of a segment: the integrals of θ̇ and of ȧ/a, each of the hypothesis
/// itself and then per unknown.
struct Travelled {
    integrals: Integrals,
    integrands: Vec<f64>,
    held: Held,
    passed_over: usize,
}

impl Travelled {
    /// Nothing yet, for `n` unknowns.
    fn new(n: usize) -> Self {
        let size = 2 * (n + 1);
        Self { integrals: Integrals::new(size), integrands: vec![0.0; size], held: Held::default(), passed_over: 0 }
    }

    /// Adds the step to sample `i`, unless it is a spike.
    fn extend_to(&mut self, track: &Track, i: usize, vibration: &Vibration, is_near: bool) {
        let believed = is_near || self.integrals.known == 0 || self.passed_over == MOST_PASSED_OVER;
        self.passed_over = if believed { 0 } else { self.passed_over + 1 };
        if !believed {
            return;
        }
        let middle = self.integrands.len() / 2;
        let (of_angle, of_amplitude) = self.integrands.split_at_mut(middle);
        (of_angle[0], of_amplitude[0]) = (vibration.theta_rate, vibration.growth);
        for ((angle, amplitude), s) in of_angle[1..].iter_mut().zip(&mut of_amplitude[1..]).zip(&vibration.slopes) {
            (*angle, *amplitude) = (s[quantity::THETA_RATE], s[quantity::GROWTH]);
        }
        self.integrals.extend_to(track.t_s[i], &self.integrands);
        if !track.has_commands() {
            self.held.extend_to(vibration, &mut self.integrals.sum);
        }
    }

    /// The integrals of θ̇, rad, and of ȧ/a.
    fn sums(&self) -> [&[f64]; 2] {
        self.integrals.sum.split_at(self.integrals.sum.len() / 2).into()
    }
}

/// What the input effects add to the input angle along a segment.
struct Excess<'a> {
    predictor: &'a Predictor<'a>,
    unknowns: &'a Unknowns,
    /// harmonic of the table that they go by; 0 where there are none
    harmonic: f64,
    /// what they added before the segment, rad: the table's angle is 0 where the recording starts
    ahead: f64,
    /// since then, for each group of lanes; the value is that of all
    lanes: Vec<Jet>,
    last: Option<usize>,
}

impl<'a> Excess<'a> {
    /// Before the first sample of `segment`.
    fn before(
        track: &Track,
        segment: &Segment,
        predictor: &'a Predictor<'a>,
        unknowns: &'a Unknowns,
        stride: usize,
    ) -> Self {
        let harmonic = predictor.hypothesis.input_harmonic();
        let mut ahead = 0.0;
        if harmonic > 0.0 {
            let rows: Vec<usize> = (0..segment.range.start).step_by(stride).chain([segment.range.start]).collect();
            for step in rows.windows(2) {
                ahead += excess_angle(track, (step[0], ahead), step[1], (predictor, 0), harmonic).value;
            }
        }
        Self { predictor, unknowns, harmonic, ahead, lanes: vec![Jet::constant(0.0); unknowns.input.len()], last: None }
    }

    /// Adds the step to sample `i`.
    fn extend_to(&mut self, track: &Track, i: usize) {
        if let Some(from) = self.last.filter(|_| self.harmonic > 0.0) {
            for (lanes, excess) in self.lanes.iter_mut().enumerate() {
                let before = (from, self.ahead + excess.value);
                *excess = *excess + excess_angle(track, before, i, (self.predictor, lanes), self.harmonic);
            }
        }
        self.last = Some(i);
    }

    /// Input angle since the start of the segment, rad.
    fn angle(&self) -> f64 {
        self.lanes.first().map_or(0.0, |excess| excess.value)
    }

    /// Puts the slopes of the angle, `by` for a unit of the input's, where they belong.
    fn slopes(&self, by: f64, angle_slopes: &mut [f64]) {
        for (lanes, excess) in self.unknowns.input.iter().zip(&self.lanes) {
            for (lane, &u) in lanes.columns.iter().enumerate() {
                angle_slopes[u] = by * excess.slope[lane];
            }
        }
    }
}

/// Largest step of the table's harmonic within one quadrature interval, rad.
const LARGEST_PHASE_STEP: f64 = 0.5;

/// The input angle that the input effects add between two samples, rad, with slopes against a group of lanes: two-point Gauss quadrature on
/// pieces over which the table's harmonic turns little. Between samples the table turns evenly but for what the effects
/// add, `excess` up to the first of them: a ripple of the rate goes by the angle that it made itself, an error of the table's own angle
/// by what was read of it.
fn excess_angle(
    track: &Track,
    (from, excess): (usize, f64),
    to: usize,
    (predictor, lanes): (&Predictor<'_>, usize),
    harmonic: f64,
) -> Jet {
    let (t0, t1) = (track.t_s[from], track.t_s[to]);
    let (a0, a1) = (track.input_rad[from], track.input_rad[to]);
    let rate = (a1 - a0) / (t1 - t0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive count, saturating")]
    let pieces = ((harmonic * (a1 - a0).abs() / LARGEST_PHASE_STEP).ceil() as usize).clamp(1, 10_000);
    let h = 1.0 / pieces as f64;
    let made = |so_far: f64| if track.has_table { 0.0 } else { excess + 0.5 * h * (t1 - t0) * so_far };
    let mut sum = Jet::constant(0.0);
    for piece in 0..pieces {
        for node in [-0.5 / 3f64.sqrt(), 0.5 / 3f64.sqrt()] {
            let s = h * (piece as f64 + 0.5 + node);
            let at = Moment {
                t_s: t0 + s * (t1 - t0),
                table_rad: a0 + s * (a1 - a0) + made(sum.value),
                precession_rad_s: predictor.hypothesis.precession(rate),
                warmer_k: (1.0 - s) * track.warmer_k(from) + s * track.warmer_k(to),
                ..Moment::default()
            };
            sum = sum + predictor.excess_rate(rate, &at, lanes);
        }
    }
    sum * Jet::constant(0.5 * h * (t1 - t0))
}

/// How far the pattern precesses while loops that nobody recorded follow the amplitude and the quadrature that are read,
/// ∫ s_a d ln a + ∫ s_Q dQ with the steering s, by the trapezium: it needs no rate of what is noisy.
#[derive(Default)]
struct Held {
    /// steering, ln a and Q of the last sample, and slopes of the first and the third
    last: Option<([f64; 4], Vec<[f64; 2]>)>,
}

impl Held {
    /// Adds the step to `vibration` to the integral of θ̇ and its slopes, which stand first in `sum`. How the small part by
    /// the quadrature changes with the unknowns is left out.
    fn extend_to(&mut self, vibration: &Vibration, sum: &mut [f64]) {
        use quantity::{LN_AMPLITUDE, STEERING};
        let [by_growth, by_quadrature] = vibration.steering;
        let now = [by_growth, by_quadrature, vibration.ln_amplitude, vibration.envelope.pendulum().q];
        let slopes_now = vibration.slopes.iter().map(|s| [s[STEERING], s[LN_AMPLITUDE]]);
        let Some((before, slopes)) = &mut self.last else {
            self.last = Some((now, slopes_now.collect()));
            return;
        };
        let (mean, change) = (0.5 * (now[0] + before[0]), now[2] - before[2]);
        sum[0] += mean * change + 0.5 * (now[1] + before[1]) * (now[3] - before[3]);
        for ((total, was), is) in sum[1..].iter_mut().zip(slopes.iter_mut()).zip(slopes_now) {
            *total += 0.5 * (is[0] + was[0]) * change + mean * (is[1] - was[1]);
            *was = is;
        }
        *before = now;
    }
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

/// A step of an integral, with its interval over the rule's denominator.
#[derive(Clone, Copy)]
enum Rule {
    AdamsMoulton(f64),
    Trapezium(f64),
}

impl Rule {
    /// What the step adds, from the integrand at its end and at the last three samples, newest first.
    #[inline]
    fn step(self, f: f64, [p1, p2, p3]: [f64; 3]) -> f64 {
        match self {
            Self::AdamsMoulton(k) => k * (9.0 * f + 19.0 * p1 - 5.0 * p2 + p3),
            Self::Trapezium(k) => k * (f + p1),
        }
    }
}

impl Integrals {
    fn new(n: usize) -> Self {
        Self { sum: vec![0.0; n], past: [vec![0.0; n], vec![0.0; n], vec![0.0; n]], times: [0.0; 3], known: 0 }
    }

    /// The first of them at a later time, with the integrand `f` of then: as precise as the integral itself, so that what a
    /// split does to a fast pattern between samples is not taken for a spike.
    fn reaching(&self, t: f64, f: f64) -> f64 {
        if self.known == 0 {
            return self.sum[0];
        }
        let first = |past: &[f64]| past.first().copied().unwrap_or(0.0);
        self.sum[0] + self.rule(t).step(f, self.past.each_ref().map(|past| first(past)))
    }

    /// How a step to `t` is made.
    fn rule(&self, t: f64) -> Rule {
        let h = t - self.times[0];
        let even = self.known == 3
            && ((self.times[0] - self.times[1]) - h).abs() < 0.01 * h
            && ((self.times[1] - self.times[2]) - h).abs() < 0.01 * h;
        if even { Rule::AdamsMoulton(h / 24.0) } else { Rule::Trapezium(0.5 * h) }
    }

    fn extend_to(&mut self, t: f64, f: &[f64]) {
        if self.known > 0 {
            let rule = self.rule(t);
            let [p1, p2, p3] = &self.past;
            for (i, s) in self.sum.iter_mut().enumerate() {
                *s += rule.step(f[i], [p1[i], p2[i], p3[i]]);
            }
        }
        self.past.rotate_right(1);
        self.past[0].copy_from_slice(f);
        self.times.rotate_right(1);
        self.times[0] = t;
        self.known = (self.known + 1).min(3);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::hypothesis::{Origin, Unknown};
    use crate::recording::{Recording, Role, Run, RunKind};
    use cvg_model::effects::EffectId;

    /// A pattern that turns at 5 rad/s with an amplitude and a quadrature that follow it; no commands.
    fn track() -> Track {
        track_with([None, None])
    }

    /// The same with commands of 50 mV, and of 200 mV at 2θ.
    fn commanded_track() -> Track {
        let t_s = (0..400).map(|i| 0.01 * f64::from(i));
        track_with([Some(vec![-0.05; 400]), Some(t_s.map(|t| 0.2 * (-10.0 * t).sin()).collect())])
    }

    fn track_with([vas_v, vqc_v]: [Option<Vec<f64>>; 2]) -> Track {
        let t_s: Vec<f64> = (0..400).map(|i| 0.01 * f64::from(i)).collect();
        let of = |f: fn(f64, f64) -> f64| {
            Some(t_s.iter().map(|t| f(-5.0 * t, 1.0 + 0.01 * (10.0 * t).sin())).collect::<Vec<_>>())
        };
        let recording = Recording {
            xc_v: of(|theta, a| a * theta.cos()),
            xs_v: of(|theta, _| -2e-3 * theta.sin() * (2.0 * theta).cos()),
            yc_v: of(|theta, a| a * theta.sin()),
            ys_v: of(|theta, _| 2e-3 * theta.cos() * (2.0 * theta).cos() + 1e-3),
            rate_dps: Some(vec![(5.0_f64 / 0.8).to_degrees(); t_s.len()]),
            t_s,
            vas_v,
            vqc_v,
            ..Recording::default()
        };
        let run = Run {
            kind: RunKind::Rotation,
            file: "spin.csv".into(),
            settle_s: 0.0,
            role: Role::Fit,
            amplitude: None,
            recording,
        };
        Track::whole(run, std::f64::consts::PI).expect("a track")
    }

    /// What is left of the angle at the end of the track, and its slopes.
    fn left_at_the_end(track: &Track, hypothesis: &Hypothesis, unknowns: &Unknowns) -> (f64, Vec<f64>) {
        let (mut angle, mut slopes) = (0.0, Vec::new());
        propagate(track, &track.segments[0], hypothesis, unknowns, Start::default(), Stepping::every(1), |row| {
            angle = row.angle;
            slopes = row.angle_slopes.to_vec();
        });
        (angle, slopes)
    }

    #[test]
    fn what_loops_do_that_nobody_recorded_changes_with_the_unknowns_as_finite_differences_say() {
        let track = track();
        let mut hypothesis = Hypothesis::ideal(crate::recording::Instrument::Gyroscope, std::f64::consts::PI, 0.8);
        (hypothesis.damping_per_s, hypothesis.control_latency_s) = (0.06, 1e-3);
        let values = [
            (EffectId::DetectionGainMismatch, 0, 1.05),
            (EffectId::ActuationGainMismatch, 0, 0.96),
            (EffectId::Anisodamping, 0, 0.01),
            (EffectId::Anisoelasticity, 1, 0.2),
        ];
        let mut all = vec![Unknown::Damping, Unknown::ControlLatency];
        for (id, ..) in values {
            hypothesis.admit(id, Origin::Declared);
        }
        for (id, p, value) in values {
            let unknown = Unknown::Effect(hypothesis.position(id).expect("a member"), p);
            hypothesis.set(unknown, value);
            all.push(unknown);
        }
        assert_slopes_are_finite_differences(&track, &hypothesis, all);
    }

    /// More unknowns of the drive than an evaluation has lanes.
    #[test]
    fn every_unknown_of_the_drive_has_its_slope() {
        let mut hypothesis = Hypothesis::ideal(crate::recording::Instrument::Gyroscope, std::f64::consts::PI, 0.8);
        (hypothesis.force_scale, hypothesis.control_latency_s) = (1.1, 1e-3);
        let values = [
            (EffectId::ActuationGainMismatch, 0.96),
            (EffectId::ActuationSkew, 0.02),
            (EffectId::ActuationPhase, 0.03),
        ];
        let mut all = vec![Unknown::ForceScale, Unknown::ControlLatency];
        for (id, value) in values {
            let unknown = Unknown::Effect(hypothesis.admit(id, Origin::Declared), 0);
            hypothesis.set(unknown, value);
        }
        all.extend(values.map(|(id, _)| Unknown::Effect(hypothesis.position(id).expect("a member"), 0)));
        assert!(all.len() > crate::model::jet::LANES);
        assert_slopes_are_finite_differences(&commanded_track(), &hypothesis, all);
    }

    #[track_caller]
    fn assert_slopes_are_finite_differences(track: &Track, hypothesis: &Hypothesis, all: Vec<Unknown>) {
        let unknowns = Unknowns::new(hypothesis, all.clone());
        let (_, slopes) = left_at_the_end(track, hypothesis, &unknowns);
        for (unknown, slope) in all.into_iter().zip(slopes) {
            let moved = |by: f64| {
                let mut h = hypothesis.clone();
                h.set(unknown, h.get(unknown) + by);
                left_at_the_end(track, &h, &unknowns).0
            };
            let by = 1e-5;
            // a slope is that of the prediction less the observation
            let numeric = (moved(-by) - moved(by)) / (2.0 * by);
            assert!((slope - numeric).abs() < 0.02 * numeric.abs() + 1e-5, "{unknown:?}: {slope} against {numeric}");
        }
    }

    /// A split of 0.4 Hz whose quadrature a fast pattern swings at 4.3 Hz, in rows 10 ms apart: where the pattern will be is
    /// known to within a sample's noise, from the second row on.
    #[test]
    fn what_a_split_does_between_samples_is_foreseen() {
        let (size, turning) = (0.054, 27.0);
        let mut integrals = Integrals::new(1);
        for i in 0..200 {
            let t = 0.01 * f64::from(i);
            let f = size * (turning * t).sin();
            let off = integrals.reaching(t, f) - size / turning * (1.0 - (turning * t).cos());
            assert!(off.abs() < 5e-6, "{i}: {off}");
            integrals.extend_to(t, &[f]);
            assert!((integrals.sum[0] - off - size / turning * (1.0 - (turning * t).cos())).abs() < 1e-15, "{i}");
        }
    }

    #[test]
    fn a_loop_that_holds_the_amplitude_turns_the_pattern_where_it_is_read_wrong() {
        let track = track();
        let steady = Hypothesis::ideal(crate::recording::Instrument::Gyroscope, std::f64::consts::PI, 0.8);
        let mut mismatched = steady.clone();
        let member = mismatched.admit(EffectId::ActuationGainMismatch, Origin::Declared);
        mismatched.set(Unknown::Effect(member, 0), 1.04);
        let left = |h: &Hypothesis| left_at_the_end(&track, h, &Unknowns::new(h, Vec::new())).0;
        let [ideal, held] = [0.0, 0.1].map(|d| left(&damped_by(&steady, d)));
        assert!((ideal - held).abs() < 1e-6, "forces along the pattern don't turn it: {ideal}, {held}");
        let forced = |damping_per_s| left(&damped_by(&mismatched, damping_per_s));
        // forces of 0.1/s off by ½(g − 1) sin 2θ: 0.02·0.1·sin 2θ rad/s, integrated over θ = −5 t from 0 to 3.99 s
        let expected = 0.02 * 0.1 * ((2.0 * 5.0 * 3.99_f64).cos() - 1.0) / 10.0;
        assert!((forced(0.1) - forced(0.0) - expected).abs() < 0.05 * expected.abs(), "{}", forced(0.1) - forced(0.0));
    }

    fn damped_by(hypothesis: &Hypothesis, damping_per_s: f64) -> Hypothesis {
        Hypothesis { damping_per_s, ..hypothesis.clone() }
    }
}
