//! The actuation gains from ring-downs (Equation 11).
//!
//! With the pattern held at an angle the energy loop is on, then off. Off, the amplitude decays at the damping of that
//! direction; on, the command replaces just that loss. The two together give the drive's gain in that direction.

use cvg_estimator::direction::major_axis;
pub use cvg_model::actuation::actuation_gain_ratio;
use cvg_model::effects::{Moment, Stage};
use cvg_model::{AxisForces, ControlOutputs, Envelope};
use nalgebra::{Matrix3, Vector3};

use crate::data::track::commanded;
use crate::error::Refusal;
use crate::model::hypothesis::Hypothesis;
use crate::numerics::angles::wrapped;
use crate::numerics::statistics::robust_deviation;
use crate::recording::{Run, RunKind};

/// What one ring-down tells.
#[derive(Debug, Clone, PartialEq)]
pub struct RingDown {
    /// name of the run
    pub name: String,
    /// direction of the pattern, rad
    pub angle_rad: f64,
    /// … as it was read, along which the commands act
    pub read_rad: f64,
    /// decay time constant of the amplitude, s
    pub tau_s: f64,
    /// its standard error, s
    pub tau_error_s: f64,
    /// rms of what is left of ln a about an exponential decay, beyond noise
    pub uneven: f64,
    /// energy control output per unit of true amplitude, corrected for the amplitude's own trend, 1/1
    pub drive: f64,
    /// its standard error
    pub drive_error: f64,
    /// mean temperature over the one that parameters refer to, K; 0 where it was not recorded
    pub warmer_k: f64,
    /// amplitude over time, for the report
    pub decay: Vec<(f64, f64)>,
}

/// A pattern held further than this from the campaign's angle is another run's.
const LARGEST_ANGLE_ERROR_RAD: f64 = 0.35;
/// The last share of the time with the energy loop on is taken as steady.
const STEADY_SHARE: f64 = 0.6;
/// Fewest samples in either phase.
const FEWEST: usize = 20;
/// Commands per amplitude that differ by less than this share are the same, and one below this share of another is none.
const SAME_COMMAND: f64 = 0.1;
/// Rounds in which a decay's rate and the work of the quadrature command settle: each leaves a few hundredths of the last.
const WORK_ROUNDS: usize = 4;
/// Standard deviation of that work as a share of it: the ellipticity is read through whatever reaches the quadrature channels
/// besides, as a feed-through of the drives does.
const WORK_KNOWN_TO: f64 = 0.1;
/// Blocks of neighbouring samples whose means tell what the noise of a ring-down remembers.
const BLOCKS: usize = 12;
/// Points of the decay that are kept for the report.
const KEPT_POINTS: usize = 400;

/// Samples of one phase of a ring-down.
#[derive(Debug, Clone, Default)]
struct Phase {
    t_s: Vec<f64>,
    /// ln of the amplitude
    ln_a: Vec<f64>,
    /// on: v_as/a; off: ∫ v_qc q/a² dt since the energy loop is off, V s/V
    command: Vec<f64>,
}

impl Phase {
    fn push(&mut self, t_s: f64, ln_a: f64, command: f64) {
        self.t_s.push(t_s);
        self.ln_a.push(ln_a);
        self.command.push(command);
    }

    fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Drops the samples that are no amplitude near what is expected, and says whether there were any.
    fn drop_spikes(&mut self, expected: impl Fn(f64) -> f64) -> bool {
        let keep = without_spikes(&self.t_s, &self.ln_a, expected);
        for column in [&mut self.t_s, &mut self.ln_a, &mut self.command] {
            retain(column, &keep);
        }
        keep.contains(&false)
    }
}

/// A ring-down with the readout undone.
struct Phases {
    on: Phase,
    off: Phase,
    /// of the pattern from the campaign's angle, rad, and as it was read
    off_angle: Vec<f64>,
    read: Vec<f64>,
    /// sum of the temperatures over the one that parameters refer to, K
    warmth: f64,
    decay: Vec<(f64, f64)>,
}

/// Undoes the readout effects of `hypothesis` and parts the samples into those of the steady end of the energy loop's
/// phase and those after it.
fn phases(run: &Run, hypothesis: &Hypothesis, angle_rad: f64, energy_off_s: f64) -> Result<Phases, Refusal> {
    let r = &run.recording;
    let (Some(x), Some(y), Some(v_as)) = (&r.xc_v, &r.yc_v, &r.vas_v) else {
        let name = crate::data::track::run_name(run);
        return Err(Refusal::new(&name, "columns xc_v, yc_v and vas_v are needed", "all three"));
    };
    let settled = run.settled()?;
    let quadrature = r.xs_v.as_ref().zip(r.ys_v.as_ref());
    let warmer_k = |i: usize| {
        let difference = r.temp_c.as_ref().zip(hypothesis.reference_c).map(|(t, reference)| t[i] - reference);
        difference.filter(|d| d.is_finite()).unwrap_or_default()
    };
    // commands that are missing in a row move nothing there
    let command = |v: Option<&Vec<f64>>, i: usize| v.map(|v| v[i]).filter(|v| v.is_finite()).unwrap_or_default();
    let steady = energy_off_s - STEADY_SHARE * (energy_off_s - r.t_s[settled.start]);
    let stride = (settled.len() / KEPT_POINTS).max(1);
    let mut found = Phases {
        on: Phase::default(),
        off: Phase::default(),
        off_angle: Vec::new(),
        read: Vec::new(),
        warmth: 0.0,
        decay: Vec::new(),
    };
    let (mut before, mut work) = (None, 0.0);
    for i in settled.clone() {
        let (xs, ys) = quadrature.map_or((0.0, 0.0), |(a, b)| (a[i], b[i]));
        let seen = Envelope::new(x[i], xs, y[i], ys);
        let commands = ControlOutputs { v_as: command(Some(v_as), i), v_qc: command(r.vqc_v.as_ref(), i) };
        let drive = commanded(&seen, &commands);
        let now = Moment { t_s: r.t_s[i], warmer_k: warmer_k(i), drive, ..Moment::default() };
        let p = hypothesis.unread(seen, &now).pendulum();
        found.warmth += now.warmer_k;
        found.off_angle.push(wrapped(p.angle() - angle_rad, std::f64::consts::PI));
        found.read.push(wrapped(seen.pendulum().angle() - angle_rad, std::f64::consts::PI));
        let ln_a = 0.5 * p.e.ln();
        if !ln_a.is_finite() {
            continue;
        }
        if (i - settled.start).is_multiple_of(stride) {
            found.decay.push((r.t_s[i], ln_a.exp()));
        }
        if r.t_s[i] >= steady && r.t_s[i] < energy_off_s && v_as[i].is_finite() {
            found.on.push(r.t_s[i], ln_a, followed(hypothesis, &seen, &now) * v_as[i] / ln_a.exp());
        } else if r.t_s[i] > energy_off_s {
            let step = before.map_or(0.0, |before| r.t_s[i] - before);
            work += step * 0.5 * commands.v_qc * p.q / p.e.powf(1.5);
            found.off.push(r.t_s[i], ln_a, work);
        }
        before = Some(r.t_s[i]);
    }
    Ok(found)
}

/// What a command along the pattern makes through drives that follow the temperature, as a share of what it makes at the one that parameters
/// refer to.
fn followed(hypothesis: &Hypothesis, seen: &Envelope<f64>, at: &Moment<f64>) -> f64 {
    let axis = major_axis(seen, &seen.pendulum());
    let along = AxisForces { x_c: 0.0, x_s: axis.cos, y_c: 0.0, y_s: axis.sin };
    let followed = hypothesis.acting(Stage::Actuation).filter(|(_, m)| m.id.by_temperature());
    let forces = followed.fold(along, |f, (_, m)| m.id.actuate(&m.values, f, at));
    forces.x_s * axis.cos + forces.y_s * axis.sin
}

/// The damping that a decay shows: ȧ/a = −1/τ + G v_qc q/a², for what holds a split works on the ellipse that the
/// quadrature loop leaves while the amplitude falls. `hold` is the v_as/a that balances this damping, so that G = −1/(τ·hold).
fn damping(off: &Phase, hold: impl Fn(f64) -> f64) -> Decay {
    let as_seen = Decay::of(&off.t_s, &off.ln_a);
    let mut decay = as_seen;
    for _ in 0..WORK_ROUNDS {
        let gain = -decay.rate / hold(decay.rate);
        // a loop that was never on tells no gain, and does no work that is known
        let gain = if gain.is_finite() { gain } else { 0.0 };
        let undriven: Vec<f64> = off.ln_a.iter().zip(&off.command).map(|(ln_a, work)| ln_a - gain * work).collect();
        decay = Decay::of(&off.t_s, &undriven);
    }
    Decay { error: decay.error.hypot(WORK_KNOWN_TO * (decay.rate - as_seen.rate)), ..decay }
}

/// Evaluates a ring-down after undoing the readout effects of `hypothesis`.
///
/// # Errors
/// Where the pattern turns, lies at another angle, does not decay, or too little was recorded.
pub fn ring_down(run: &Run, hypothesis: &Hypothesis) -> Result<RingDown, Refusal> {
    let name = crate::data::track::run_name(run);
    let RunKind::Ringdown { angle_deg, energy_off_s } = run.kind else {
        return Err(Refusal::new(&name, "is not a ring-down", "kind = \"ringdown\""));
    };
    let refuse = |problem: String, wanted: &str| Err(Refusal::new(&name, problem, wanted));
    let angle_rad = angle_deg.to_radians();
    let Phases { mut on, mut off, off_angle, mut read, warmth, decay } =
        phases(run, hypothesis, angle_rad, energy_off_s)?;
    let warmer_k = warmth / off_angle.len().max(1) as f64;
    let middle = crate::numerics::statistics::median(&mut off_angle.clone());
    let spread = robust_deviation(off_angle.iter().map(|a| a - middle));
    if middle.abs() > LARGEST_ANGLE_ERROR_RAD || spread > LARGEST_ANGLE_ERROR_RAD {
        return refuse(
            format!(
                "the pattern lies at {:.1}° (± {:.1}°), not at angle_deg = {angle_deg}: a rotation run, or files swapped?",
                (angle_rad + middle).to_degrees(),
                spread.to_degrees()
            ),
            "a recording with the pattern held at angle_deg",
        );
    }
    if on.len() < FEWEST || off.len() < FEWEST {
        return refuse(
            format!("{} steady samples with the energy loop on and {} with it off", on.len(), off.len()),
            "at least 20 of each around energy_off_s",
        );
    }
    if let Some(why) = command_that_goes_on(run, run.settled()?, energy_off_s) {
        return refuse(
            why,
            "vas_v = the energy control output, which vanishes at energy_off_s, and vqc_v = quadrature's",
        );
    }
    loop {
        let Decay { rate, intercept, .. } = Decay::of(&off.t_s, &off.ln_a);
        if !off.drop_spikes(|t| intercept - rate * t) || off.len() < FEWEST {
            break;
        }
    }
    let level = crate::numerics::statistics::median(&mut on.ln_a.clone());
    on.drop_spikes(|_| level);
    // On: ȧ/a = −1/τ − G v_as/a, so the command that would hold the amplitude still is v − v·(ȧ/a)/(1/τ + ȧ/a).
    let held = Decay::of(&on.t_s, &on.ln_a);
    let (trend, trend_error) = (-held.rate, held.error.hypot(held.uneven_error));
    let mean = on.command.iter().sum::<f64>() / on.len() as f64;
    let hold = |rate: f64| mean * rate / (rate + trend);
    let decayed = damping(&off, hold);
    let rate = decayed.rate;
    if rate <= 3.0 * decayed.error {
        return refuse(
            format!(
                "the amplitude does not decay after energy_off_s: it grows by {:.3e} ± {:.0e} 1/s",
                -rate, decayed.error
            ),
            "a ring-down with the energy loop off",
        );
    }
    Ok(RingDown {
        name,
        angle_rad: angle_rad + middle,
        read_rad: angle_rad + crate::numerics::statistics::median(&mut read),
        tau_s: 1.0 / rate,
        tau_error_s: decayed.error.hypot(decayed.uneven_error) / (rate * rate),
        uneven: decayed.uneven,
        drive: hold(rate),
        drive_error: (STUDENT_11 * mean_error(&on.command, mean)).hypot(hold(rate) * trend_error / (rate + trend)),
        warmer_k,
        decay,
    })
}

/// Why vas_v is not what held the amplitude: it goes on, in proportion to the amplitude that decays without it, as the
/// quadrature command does; or vqc_v vanishes in its stead. An output that stands still, or that goes on alone because the
/// drive was disconnected behind it, does neither.
fn command_that_goes_on(run: &Run, settled: std::ops::Range<usize>, energy_off_s: f64) -> Option<String> {
    let r = &run.recording;
    let rows: Vec<(f64, f64)> = settled
        .clone()
        .map(|i| {
            let squares = [&r.xc_v, &r.xs_v, &r.yc_v, &r.ys_v].into_iter().flatten().map(|v| v[i] * v[i]);
            (r.t_s[i], squares.sum::<f64>().sqrt())
        })
        .collect();
    let begin = rows.first()?.0;
    let steady = energy_off_s - STEADY_SHARE * (energy_off_s - begin);
    let middle = 0.5 * (energy_off_s + rows.last()?.0);
    let usual =
        |values: Vec<f64>| (!values.is_empty()).then(|| crate::numerics::statistics::median(&mut values.clone()));
    let within = |from: f64, to: f64| rows.iter().enumerate().filter(move |(_, (t, _))| *t > from && *t < to);
    let per_amplitude = |command: &[f64], from: f64, to: f64| {
        let all = within(from, to).map(|(i, (_, a))| command[settled.start + i] / a);
        usual(all.filter(|v| v.is_finite()).collect())
    };
    let amplitude =
        |from: f64, to: f64| usual(within(from, to).map(|(_, (_, a))| *a).filter(|a| a.is_finite()).collect());
    let v_as = r.vas_v.as_deref()?;
    let on = per_amplitude(v_as, steady, energy_off_s)?;
    let halves = [(energy_off_s, middle), (middle, f64::INFINITY)];
    let [first, last] = halves.map(|(from, to)| per_amplitude(v_as, from, to));
    let (first, last) = (first?, last?);
    let fell = 1.0 - amplitude(halves[1].0, halves[1].1)? / amplitude(steady, energy_off_s)?;
    let same = [first, last].iter().all(|v| (v / on - 1.0).abs() < SAME_COMMAND);
    if same && fell > 2.0 * SAME_COMMAND {
        return Some(format!(
            "vas_v per amplitude is {last:.4} while the amplitude decays, and was {on:.4} before: it is not what held the \
             amplitude; vas_v and vqc_v exchanged?"
        ));
    }
    let v_qc = r.vqc_v.as_deref()?;
    let held = per_amplitude(v_qc, steady, energy_off_s)?;
    let vanished = [per_amplitude(v_qc, halves[0].0, halves[0].1)?, per_amplitude(v_qc, halves[1].0, halves[1].1)?];
    let instead = vanished.iter().all(|v| v.abs() < SAME_COMMAND * held.abs()) && last.abs() > 0.5 * on.abs();
    instead.then(|| "vqc_v vanishes at energy_off_s, and vas_v does not: the two are exchanged".into())
}

/// An exponential decay, fitted to the logarithm of an amplitude.
#[derive(Debug, Clone, Copy)]
struct Decay {
    /// 1/s
    rate: f64,
    /// its standard error by white noise, 1/s
    error: f64,
    /// ln a at time zero
    intercept: f64,
    /// rms of what is left in the means of [`BLOCKS`] blocks, beyond what white noise leaves there
    uneven: f64,
    /// the rate that such a rms would make if it went with time, 1/s: nothing tells how much of it did
    uneven_error: f64,
}

impl Decay {
    /// Weighted by the squared amplitude, since the readout's noise is constant.
    fn of(t: &[f64], ln_a: &[f64]) -> Self {
        let weight: Vec<f64> = ln_a.iter().map(|l| (2.0 * (l - ln_a[0])).exp()).collect();
        let sum: f64 = weight.iter().sum();
        let mean = |v: &[f64]| v.iter().zip(&weight).map(|(v, w)| v * w).sum::<f64>() / sum;
        let (mt, ml) = (mean(t), mean(ln_a));
        let (mut stt, mut stl) = (0.0, 0.0);
        for ((t, l), w) in t.iter().zip(ln_a).zip(&weight) {
            stt += w * (t - mt) * (t - mt);
            stl += w * (t - mt) * (l - ml);
        }
        let slope = stl / stt;
        let left: Vec<f64> = t.iter().zip(ln_a).map(|(t, l)| l - ml - slope * (t - mt)).collect();
        let rest: f64 = left.iter().zip(&weight).map(|(r, w)| w * r * r).sum();
        // of one sample at full weight
        let noise = rest / (t.len() as f64 - 2.0);
        let uneven = unevenness(&left, &weight, noise);
        Self {
            rate: -slope,
            error: (noise / stt).sqrt(),
            intercept: ml - slope * mt,
            uneven,
            uneven_error: uneven * (sum / stt).sqrt(),
        }
    }
}

/// rms of the weighted means of blocks of `left`, beyond what residuals of variance `noise`/weight leave there if they are white.
fn unevenness(left: &[f64], weight: &[f64], noise: f64) -> f64 {
    let size = left.len().div_ceil(BLOCKS);
    let (mut squares, mut by_noise, mut sum) = (0.0, 0.0, 0.0);
    for (left, weight) in left.chunks(size).zip(weight.chunks(size)) {
        let total: f64 = weight.iter().sum();
        squares += left.iter().zip(weight).map(|(r, w)| r * w).sum::<f64>().powi(2) / total;
        by_noise += noise;
        sum += total;
    }
    // white noise leaves 11 ± 5 of its own variance in twelve blocks: beyond 2.33 deviations of that it is none
    let by_chance = by_noise * (1.0 + 2.33 * (2.0 / BLOCKS as f64).sqrt());
    if squares > by_chance { ((squares - by_noise) / sum).sqrt() } else { 0.0 }
}

/// Samples of ln a that lie within six robust deviations of what is expected, in volts rather than in ln a.
fn without_spikes(t: &[f64], ln_a: &[f64], expected: impl Fn(f64) -> f64) -> Vec<bool> {
    let off: Vec<f64> = t.iter().zip(ln_a).map(|(t, l)| l.exp() - expected(*t).exp()).collect();
    let limit = 6.0 * robust_deviation(off.iter().copied()) + f64::MIN_POSITIVE;
    off.iter().map(|o| o.abs() <= limit).collect()
}

fn retain(values: &mut Vec<f64>, keep: &[bool]) {
    let mut kept = keep.iter();
    values.retain(|_| kept.next().copied().unwrap_or(true));
}

/// How much further than a normal quantile Student's of 11 degrees of freedom lies at 95 %: what twelve blocks tell of
/// their own deviation.
const STUDENT_11: f64 = 2.201 / 1.960;

/// Standard error of a mean from means of blocks: neighbouring samples of a loop's output are not independent.
fn mean_error(values: &[f64], mean: f64) -> f64 {
    let size = (values.len() / BLOCKS).max(1);
    let blocks: Vec<f64> = values.chunks_exact(size).map(|b| b.iter().sum::<f64>() / b.len() as f64).collect();
    let n = blocks.len() as f64;
    (blocks.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt()
}

/// A skew of the drives before ring-downs tell it, as a standard deviation.
const BELIEVED_SKEW: f64 = 1e-2;

/// The two actuation gains (per 2ω, 1/s and V per V) and their covariance, from ring-downs at two or more directions:
/// the drive's gain in direction θ is 1/(τ·(−v_as/a)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveGains {
    /// G_Ax/2ω and G_Ay/2ω
    pub gains: [f64; 2],
    /// standard error of ln(G_Ax/G_Ay)
    pub ratio_error: f64,
    /// standard error of ln of the mean
    pub mean_error: f64,
}

impl DriveGains {
    /// From ring-downs; `None` where their directions do not tell the axes apart. The rate loop holds the pattern against what unequal
    /// and skewed drives make of the energy command, and its force has a part along the pattern too: together they act with
    /// 1/G(θ) = cos θ_r cos θ/G_Ax + sin θ_r sin θ/G_Ay − s_a sin θ_r cos θ/G_Ay, with the direction θ_r that was read, of which the skew
    /// s_a is told by three directions, or believed.
    pub fn from_ring_downs(ring_downs: &[RingDown]) -> Option<Self> {
        let inverse_gain = |r: &RingDown| -r.tau_s * r.drive;
        let usual = ring_downs.iter().map(inverse_gain).sum::<f64>() / ring_downs.len().max(1) as f64;
        let believed = Vector3::new(0.0, 0.0, (BELIEVED_SKEW * usual).powi(-2));
        let (mut normal, mut right) = (Matrix3::from_diagonal(&believed), Vector3::zeros());
        for r in ring_downs {
            let relative = (r.tau_error_s / r.tau_s).hypot(r.drive_error / r.drive).max(1e-9);
            let ((sin, cos), (sin_read, cos_read)) = (r.angle_rad.sin_cos(), r.read_rad.sin_cos());
            let row = Vector3::new(cos_read * cos, sin_read * sin, -sin_read * cos);
            let weight = 1.0 / (relative * inverse_gain(r)).powi(2);
            normal += row * row.transpose() * weight;
            right += row * inverse_gain(r) * weight;
        }
        let covariance = normal.try_inverse()?;
        let inverse = covariance * right;
        let (dx, dy) = (covariance[(0, 0)].sqrt() / inverse[0], covariance[(1, 1)].sqrt() / inverse[1]);
        let cross = covariance[(0, 1)] / (inverse[0] * inverse[1]);
        let sound = inverse[0] > 0.0 && inverse[1] > 0.0 && dx < 0.3 && dy < 0.3;
        sound.then(|| Self {
            gains: [1.0 / inverse[0], 1.0 / inverse[1]],
            ratio_error: (dx * dx + dy * dy - 2.0 * cross).max(0.0).sqrt(),
            mean_error: 0.5 * (dx * dx + dy * dy + 2.0 * cross).max(0.0).sqrt(),
        })
    }

    /// G_Ax/G_Ay
    pub fn ratio(&self) -> f64 {
        self.gains[0] / self.gains[1]
    }

    /// √(G_Ax G_Ay)/2ω
    pub fn mean(&self) -> f64 {
        (self.gains[0] * self.gains[1]).sqrt()
    }
}
