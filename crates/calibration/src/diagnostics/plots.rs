//! What a person wants to see of an identification: the curves behind the figures of a report, thinned to what a screen
//! can show. Facts only; nothing is rendered, and nothing here feeds back into an answer.

use cvg_model::effects::{EffectId, Scaling};
use nalgebra::DMatrix;

use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::residual::{WHITENESS_LAGS, autocorrelation, inflation, reported_harmonics, white_band};
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::Dataset;
use crate::estimation::propagation::{Start, Stepping, propagate};
use crate::facts::{Follows, Harmonic};
use crate::model::hypothesis::{Hypothesis, Unknown};
use crate::model::prediction::{Predictor, Vibration};
use crate::model::unknowns::Unknowns;
use crate::numerics::angles::wrapped;
use crate::numerics::statistics::{circular_mean, line};
use crate::recording::{Instrument, Role};

/// Curves for the figures of a report.
#[derive(Debug, Clone, Default)]
pub struct PlotData {
    /// pattern angle over time, as recorded
    pub angles: Vec<AngleCurve>,
    /// energy control output over the pattern angle
    pub drives: Vec<DriveCurve>,
    /// harmonics of the held-out error at each stage: name of the stage, harmonics of the pattern
    pub stages: Vec<(String, Vec<Harmonic>)>,
    /// what is left over time
    pub residuals: Vec<ResidualCurve>,
    /// its autocorrelation
    pub memory: Memory,
    /// its distribution
    pub histogram: Histogram,
    /// size of each found effect in each run
    pub scaling: Vec<EffectSizes>,
    /// correlations of what was fitted
    pub correlations: Correlations,
}

/// The pattern angle of one run over some turns of the pattern.
#[derive(Debug, Clone, Default)]
pub struct AngleCurve {
    /// run
    pub name: String,
    /// time, s
    pub t_s: Vec<f64>,
    /// within its period, deg
    pub wrapped_deg: Vec<f64>,
    /// followed through its periods, deg
    pub unwrapped_deg: Vec<f64>,
}

/// The energy control output of one run over the pattern angle.
#[derive(Debug, Clone, Default)]
pub struct DriveCurve {
    /// run
    pub name: String,
    /// mean input rate, deg/s
    pub rate_dps: f64,
    /// middle of each bin of the pattern angle, deg
    pub pattern_deg: Vec<f64>,
    /// as recorded, V
    pub before_v: Vec<f64>,
    /// what would hold the true amplitude where the gains are equal, V: identified electronics undone
    pub after_v: Vec<f64>,
}

/// What is left of the angle in one run over time; of each stretch its smallest and its largest value.
#[derive(Debug, Clone, Default)]
pub struct ResidualCurve {
    /// run
    pub name: String,
    /// time, s
    pub t_s: Vec<f64>,
    /// error, deg
    pub error_deg: Vec<f64>,
}

/// Autocorrelation of what is left.
#[derive(Debug, Clone, Default)]
pub struct Memory {
    /// correlation at lags 0, 1, … samples
    pub correlation: Vec<f64>,
    /// white noise stays within ± this at 99 % of the lags
    pub band99: f64,
}

/// Distribution of what is left.
#[derive(Debug, Clone, Default)]
pub struct Histogram {
    /// middle of each bin, deg
    pub middle_deg: Vec<f64>,
    /// samples in it
    pub count: Vec<u64>,
    /// what a normal distribution of the same mean square would put there
    pub normal: Vec<f64>,
}

/// How large one effect is in each run.
#[derive(Debug, Clone)]
pub struct EffectSizes {
    /// the effect
    pub id: EffectId,
    /// how its definition says it scales
    pub scaling: Scaling,
    /// its runs
    pub runs: Vec<EffectSize>,
}

/// How large one effect is in one run: the run's own say, beside what the joint fit says of it.
#[derive(Debug, Clone, Default)]
pub struct EffectSize {
    /// run
    pub name: String,
    /// mean input rate, deg/s
    pub rate_dps: f64,
    /// mean amplitude of the readout, V
    pub amplitude_v: f64,
    /// rms of its share in the angle as this run alone tells it, deg, and half its 95 % interval
    pub measured_deg: [f64; 2],
    /// the same by the joint fit
    pub fitted_deg: f64,
}

/// Correlations of the fitted unknowns.
#[derive(Debug, Clone, Default)]
pub struct Correlations {
    /// names
    pub names: Vec<String>,
    /// rows of the matrix
    pub rows: Vec<Vec<f64>>,
}

/// What a plots is taken of.
pub(crate) struct PlotContext<'a> {
    pub(crate) dataset: &'a Dataset,
    pub(crate) fit: &'a Fit,
    pub(crate) covariance: &'a DMatrix<f64>,
    pub(crate) raw: Option<&'a Evaluation>,
    pub(crate) declared: &'a Evaluation,
    pub(crate) discovered: &'a Evaluation,
    pub(crate) on_fit: &'a Evaluation,
    /// members that are reported
    pub(crate) members: &'a [usize],
}

/// Points of a curve over time.
const CURVE_POINTS: usize = 1500;
/// Turns of the pattern in the figure of the angle.
const SHOWN_TURNS: f64 = 6.0;
/// Bins of the pattern angle.
const BINS: usize = 72;
/// Samples of one segment that go into the bins.
const BINNED_SAMPLES: usize = 40_000;
/// Harmonics of the period in the amplitude that the energy balance allows for.
const AMPLITUDE_HARMONICS: usize = 4;
/// Lags of the autocorrelation.
const LAGS: usize = 60;
/// A sample further off than this is a spike whatever a hypothesis lacks.
const FAR_OFF_RAD: f64 = 0.05;
/// Bins and half width, in deviations, of the histogram.
const HISTOGRAM_BINS: usize = 61;
const HISTOGRAM_DEVIATIONS: f64 = 5.0;

/// A plots of errors alone: what instruments without mechanics have.
pub(crate) fn plots_of(
    names: &[String],
    raw: Option<&Evaluation>,
    declared: &Evaluation,
    discovered: &Evaluation,
    hypothesis: &Hypothesis,
) -> PlotData {
    // segments stand in the order of the names
    let name = |track: usize| {
        let at = discovered.segments.iter().position(|s| s.track == track);
        at.and_then(|at| names.get(at)).cloned().unwrap_or_default()
    };
    PlotData {
        angles: angles(raw.unwrap_or(discovered), hypothesis, name),
        stages: harmonics_of_stages(raw, declared, discovered),
        residuals: residuals(discovered, name),
        memory: memory(discovered),
        histogram: histogram(discovered),
        ..PlotData::default()
    }
}

/// The first held-out stretch of each run, as recorded.
fn angles(seen: &Evaluation, h: &Hypothesis, name: impl Fn(usize) -> String) -> Vec<AngleCurve> {
    let slope = h.sense() * h.angular_gain;
    let mut out: Vec<AngleCurve> = Vec::new();
    for s in &seen.segments {
        let name = name(s.track);
        if out.iter().any(|c| c.name == name) {
            continue;
        }
        let turned = |i: &usize| (slope * (s.turned[*i] - s.turned[0])).abs();
        let shown: Vec<usize> = (0..s.angle.len()).take_while(|i| turned(i) < SHOWN_TURNS * h.period_rad).collect();
        let stride = (shown.len() / CURVE_POINTS).max(1);
        let kept = shown.into_iter().step_by(stride);
        let mut curve = AngleCurve { name, ..AngleCurve::default() };
        for i in kept {
            curve.t_s.push(s.t_s[i]);
            curve.wrapped_deg.push(s.direction[i].rem_euclid(h.period_rad).to_degrees());
            curve.unwrapped_deg.push((slope * s.turned[i] + s.angle[i]).to_degrees());
        }
        out.push(curve);
    }
    out
}

fn harmonics_of_stages(
    raw: Option<&Evaluation>,
    declared: &Evaluation,
    discovered: &Evaluation,
) -> Vec<(String, Vec<Harmonic>)> {
    // the noise is that of the last stage: what the others have besides is no noise
    [("raw", raw), ("declared", Some(declared)), ("discovered", Some(discovered))]
        .into_iter()
        .filter_map(|(name, e)| e.map(|e| (name, e)))
        .map(|(name, e)| (name.to_owned(), reported_harmonics(e, Follows::Pattern, discovered)))
        .collect()
}

fn residuals(e: &Evaluation, name: impl Fn(usize) -> String) -> Vec<ResidualCurve> {
    let mut out: Vec<ResidualCurve> = Vec::new();
    for (s, kept) in e.segments.iter().zip(&e.kept) {
        let samples: Vec<usize> = (0..s.angle.len()).filter(|&i| kept[i]).collect();
        let mut curve = ResidualCurve { name: name(s.track), ..ResidualCurve::default() };
        for part in samples.chunks((samples.len() / (CURVE_POINTS / 2)).max(1)) {
            let by = |a: &&usize, b: &&usize| s.angle[**a].total_cmp(&s.angle[**b]);
            let ends = [part.iter().min_by(by), part.iter().max_by(by)];
            let mut ends: Vec<usize> = ends.into_iter().flatten().copied().collect();
            ends.sort_unstable();
            ends.dedup();
            for i in ends {
                curve.t_s.push(s.t_s[i]);
                curve.error_deg.push(s.angle[i].to_degrees());
            }
        }
        out.push(curve);
    }
    out
}

fn memory(e: &Evaluation) -> Memory {
    let count = e.errors().count();
    Memory { correlation: autocorrelation(e, LAGS), band99: white_band(count) }
}

fn histogram(e: &Evaluation) -> Histogram {
    let deviation = e.mean_square().sqrt().to_degrees();
    let width = 2.0 * HISTOGRAM_DEVIATIONS * deviation / HISTOGRAM_BINS as f64;
    if width.is_nan() || width <= 0.0 {
        return Histogram::default();
    }
    let low = -HISTOGRAM_DEVIATIONS * deviation;
    let mut count = vec![0u64; HISTOGRAM_BINS];
    let mut total = 0.0;
    for error in e.errors() {
        #[allow(clippy::cast_possible_truncation, reason = "saturates, and is then none of the bins")]
        let at = ((error.to_degrees() - low) / width).floor() as i64;
        if let Some(c) = usize::try_from(at).ok().and_then(|at| count.get_mut(at)) {
            *c += 1;
        }
        total += 1.0;
    }
    let middle_deg: Vec<f64> = (0..HISTOGRAM_BINS).map(|b| low + (b as f64 + 0.5) * width).collect();
    let density = |x: f64| (-0.5 * (x / deviation).powi(2)).exp() / (deviation * std::f64::consts::TAU.sqrt());
    let normal = middle_deg.iter().map(|&x| total * width * density(x)).collect();
    Histogram { middle_deg, count, normal }
}

impl PlotContext<'_> {
    pub(crate) fn plots(&self) -> PlotData {
        PlotData {
            angles: angles(self.raw.unwrap_or(self.discovered), self.hypothesis(), |track| self.name(track)),
            drives: self.drives(),
            stages: harmonics_of_stages(self.raw, self.declared, self.discovered),
            residuals: residuals(self.discovered, |track| self.name(track)),
            memory: memory(self.discovered),
            histogram: histogram(self.discovered),
            scaling: self.members.iter().map(|&at| self.sizes(at)).collect(),
            correlations: self.correlations(),
        }
    }

    fn hypothesis(&self) -> &Hypothesis {
        &self.fit.hypothesis
    }

    fn name(&self, track: usize) -> String {
        self.dataset.tracks[track].track.name.clone()
    }

    /// Runs with commands that fill every bin of the pattern angle.
    fn drives(&self) -> Vec<DriveCurve> {
        if self.dataset.instrument != Instrument::Gyroscope {
            return Vec::new();
        }
        (0..self.dataset.tracks.len()).filter_map(|track| self.drive(track)).collect()
    }

    fn drive(&self, number: usize) -> Option<DriveCurve> {
        let track = &self.dataset.tracks[number].track;
        if !track.has_commands() {
            return None;
        }
        let h = self.hypothesis();
        let none = Unknowns::new(h, Vec::new());
        let predictor = Predictor::new(h, &none);
        let ideal = Hypothesis { members: Vec::new(), ..h.clone() };
        let samples: usize = track.segments.iter().map(|s| s.range.len()).sum();
        let stride = (samples / BINNED_SAMPLES).max(1);
        let bin = |angle: f64| {
            let share = angle.rem_euclid(h.period_rad) / h.period_rad;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the bins")]
            let at = (share * BINS as f64) as usize;
            at.min(BINS - 1)
        };
        let (mut before, mut held, mut ln_a) = (Bins::new(), Bins::new(), Bins::new());
        let (mut pushed, mut commanded) = (0.0, 0.0);
        let (mut with, mut without) = (Vibration::new(), Vibration::new());
        for i in track.segments.iter().flat_map(|s| s.range.clone()).step_by(stride) {
            let seen = track.envelope(i);
            let commands = track.commands(i, stride)?;
            let rate = track.rate(i);
            let at = track.moment(i, h.precession(rate));
            predictor.predict(seen, Some(commands), &at, &mut with);
            predictor.predict(seen, None, &at, &mut without);
            let push = with.growth - without.growth;
            if !push.is_finite() || !with.ln_amplitude.is_finite() {
                continue;
            }
            before.add(bin(ideal.bearing(&seen)), commands.now.v_as);
            held.add(bin(with.theta), push);
            ln_a.add(bin(with.theta), with.ln_amplitude);
            pushed += push * with.ln_amplitude.exp();
            commanded += commands.now.v_as;
        }
        let (before, held, ln_a) = (before.means()?, held.means()?, ln_a.means()?);
        let amplitude = ln_a.iter().map(|l| l.exp()).sum::<f64>() / BINS as f64;
        // the amplitude's own motion is not the command's doing
        let turning = h.precession(track.mean_rate());
        let growth: Vec<f64> = slope_of(&ln_a, h.period_rad).into_iter().map(|s| s * turning).collect();
        let volts_per_push = amplitude * commanded / pushed;
        let after: Vec<f64> = held.iter().zip(&growth).map(|(push, own)| (push - own) * volts_per_push).collect();
        after.iter().all(|v| v.is_finite()).then(|| DriveCurve {
            name: track.name.clone(),
            rate_dps: track.mean_rate().to_degrees(),
            pattern_deg: (0..BINS).map(|b| (b as f64 + 0.5) / BINS as f64 * h.period_rad.to_degrees()).collect(),
            before_v: before,
            after_v: after,
        })
    }

    /// The ratio of the detection gains as each track alone tells it, where it is a member: what the run says of the member's
    /// share in the angle, which grows as the ratio less one. With its standard deviation.
    pub(crate) fn own_detection_ratios(&self) -> Vec<Option<[f64; 2]>> {
        let members = &self.hypothesis().members;
        let Some(at) = members.iter().position(|m| m.id == EffectId::DetectionGainMismatch) else {
            return vec![None; self.dataset.tracks.len()];
        };
        let inflated = inflation(&autocorrelation(self.discovered, WHITENESS_LAGS), self.discovered.errors().count());
        let told = |s: &Share| {
            let less_one = members[at].values[0] - 1.0;
            let own =
                [1.0 + less_one * (1.0 + s.ed / s.dd), less_one.abs() * (s.ee / s.count * inflated / s.dd).sqrt()];
            (s.count > 0.0 && s.dd > 0.0 && own.iter().all(|v| v.is_finite())).then_some(own)
        };
        self.shares(at).iter().map(told).collect()
    }

    /// What each track says of a member: the errors without it, set against the share that the joint fit gives it.
    fn shares(&self, at: usize) -> Vec<Share> {
        let mut without = self.hypothesis().clone();
        without.members.remove(at);
        let mut shares = vec![Share::default(); self.dataset.tracks.len()];
        for (role, with) in [(Role::Fit, self.on_fit), (Role::Holdout, self.discovered)] {
            for ((s, bare), kept) in with.segments.iter().zip(self.errors_of(&without, role, with)).zip(&with.kept) {
                for i in (0..s.angle.len().min(bare.len())).filter(|&i| kept[i]) {
                    shares[s.track].add(s.angle[i], bare[i] - s.angle[i]);
                }
            }
        }
        shares
    }

    /// How large a member is in each run.
    fn sizes(&self, at: usize) -> EffectSizes {
        let id = self.hypothesis().members[at].id;
        let shares = self.shares(at);
        let inflated = inflation(&autocorrelation(self.discovered, WHITENESS_LAGS), self.discovered.errors().count());
        let runs = shares.iter().enumerate().filter(|(_, s)| s.count > 0.0 && s.dd > 0.0).map(|(number, s)| {
            let track = &self.dataset.tracks[number].track;
            let fitted = (s.dd / s.count).sqrt();
            let deviation = (s.ee / s.count * inflated / s.dd).sqrt();
            EffectSize {
                name: track.name.clone(),
                rate_dps: track.mean_rate().to_degrees(),
                amplitude_v: track.mean_amplitude(),
                measured_deg: [(1.0 + s.ed / s.dd) * fitted, 1.96 * deviation * fitted].map(f64::to_degrees),
                fitted_deg: fitted.to_degrees(),
            }
        });
        EffectSizes { id, scaling: id.description().scaling, runs: runs.collect() }
    }

    /// Errors of a hypothesis that lacks something, per segment of `role`, lines taken out as in `like`. What it lacks is
    /// no spike: only what is far off is passed over.
    fn errors_of(&self, hypothesis: &Hypothesis, role: Role, like: &Evaluation) -> Vec<Vec<f64>> {
        let none = Unknowns::new(hypothesis, Vec::new());
        let mut out = Vec::new();
        for (prepared, starts) in self.dataset.tracks.iter().zip(&self.fit.starts) {
            let track = &prepared.track;
            for (segment, start) in track.segments.iter().zip(starts).filter(|(s, _)| s.role == role) {
                let Some(kept) = like.kept.get(out.len()) else { return out };
                let propagated = |start: Start, stepping: Stepping| {
                    let (mut turned, mut angle) = (Vec::new(), Vec::new());
                    propagate(track, segment, hypothesis, &none, start, stepping, |row| {
                        turned.push(row.turned);
                        angle.push(row.angle);
                    });
                    (turned, angle)
                };
                let coarse = Stepping::every((segment.range.len() / 500).max(1));
                let middle = |angle: Vec<f64>| circular_mean(angle.into_iter(), hypothesis.period_rad);
                let mut start = *start;
                start.angle += middle(propagated(start, coarse).1);
                let (turned, mut angle) = propagated(start, Stepping::without(FAR_OFF_RAD));
                let centre = middle(angle.clone());
                for a in &mut angle {
                    *a = wrapped(*a - centre, hypothesis.period_rad);
                }
                let of_kept = |v: &[f64]| v.iter().zip(kept).filter(|(_, k)| **k).map(|(v, _)| *v).collect::<Vec<_>>();
                let (slope, intercept) = line(&of_kept(&turned), &of_kept(&angle));
                out.push(angle.iter().zip(&turned).map(|(a, t)| a - slope * t - intercept).collect());
            }
        }
        out
    }

    fn correlations(&self) -> Correlations {
        let n = self.fit.unknowns.len();
        let name = |u: &Unknown| match *u {
            Unknown::AngularGain => "angular gain k".into(),
            Unknown::ForceScale => "force scale".into(),
            Unknown::ControlLatency => "control latency".into(),
            Unknown::Damping => "damping 1/τ".into(),
            Unknown::Effect(member, p) => {
                let id = self.hypothesis().members[member].id;
                let d = id.description();
                if d.parameters.len() == 1 { d.id.into() } else { format!("{} {}", d.id, d.parameters[p].name) }
            }
        };
        let c = self.covariance;
        let correlation = |i: usize, j: usize| {
            let size = (c[(i, i)] * c[(j, j)]).sqrt();
            if size > 0.0 { (c[(i, j)] / size).clamp(-1.0, 1.0) } else { 0.0 }
        };
        Correlations {
            names: self.fit.unknowns.iter().map(name).collect(),
            rows: (0..n).map(|i| (0..n).map(|j| correlation(i, j)).collect()).collect(),
        }
    }
}

/// Sums over one run: errors with an effect (e), the effect's share (d).
#[derive(Debug, Clone, Copy, Default)]
struct Share {
    count: f64,
    ee: f64,
    ed: f64,
    dd: f64,
}

impl Share {
    fn add(&mut self, e: f64, d: f64) {
        self.count += 1.0;
        self.ee += e * e;
        self.ed += e * d;
        self.dd += d * d;
    }
}

/// Means over bins of the pattern angle.
struct Bins {
    sum: Vec<f64>,
    count: Vec<f64>,
}

impl Bins {
    fn new() -> Self {
        Self { sum: vec![0.0; BINS], count: vec![0.0; BINS] }
    }

    fn add(&mut self, at: usize, value: f64) {
        if value.is_finite() {
            self.sum[at] += value;
            self.count[at] += 1.0;
        }
    }

    /// `None` where a bin is empty.
    fn means(&self) -> Option<Vec<f64>> {
        let full = self.count.iter().all(|c| *c > 0.0);
        full.then(|| self.sum.iter().zip(&self.count).map(|(s, c)| s / c).collect())
    }
}

/// Slope of a periodic curve given at evenly spaced bins, from its first harmonics.
fn slope_of(values: &[f64], period: f64) -> Vec<f64> {
    let n = values.len() as f64;
    let base = std::f64::consts::TAU / period;
    let x = |b: usize| (b as f64 + 0.5) / n * period;
    let mut out = vec![0.0; values.len()];
    for k in 1..=AMPLITUDE_HARMONICS {
        let w = base * k as f64;
        let (mut c, mut s) = (0.0, 0.0);
        for (b, v) in values.iter().enumerate() {
            let (sin, cos) = (w * x(b)).sin_cos();
            c += 2.0 / n * v * cos;
            s += 2.0 / n * v * sin;
        }
        for (b, o) in out.iter_mut().enumerate() {
            let (sin, cos) = (w * x(b)).sin_cos();
            *o += w * (s * cos - c * sin);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_harmonic_is_its_derivative() {
        let period = std::f64::consts::PI;
        let x = |b: usize| (b as f64 + 0.5) / BINS as f64 * period;
        let values: Vec<f64> = (0..BINS).map(|b| 1.0 + 0.3 * (2.0 * x(b)).sin() - 0.1 * (4.0 * x(b)).cos()).collect();
        for (b, slope) in slope_of(&values, period).into_iter().enumerate() {
            let wanted = 0.6 * (2.0 * x(b)).cos() + 0.4 * (4.0 * x(b)).sin();
            assert!((slope - wanted).abs() < 1e-12, "{slope} {wanted}");
        }
    }
}
