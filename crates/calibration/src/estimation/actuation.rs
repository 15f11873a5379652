//! The actuation gains from ring-downs (Equation 11).
//!
//! With the pattern held at an angle the energy loop is on, then off. Off, the amplitude decays at the damping of that
//! direction; on, the command replaces just that loss. The two together give the drive's gain in that direction.

use cvg_model::ControlOutputs;
pub use cvg_model::actuation::actuation_gain_ratio;
use cvg_model::effects::Moment;
use nalgebra::{Matrix2, Vector2};

use crate::data::track::{commanded, wrapped};
use crate::error::Refusal;
use crate::estimation::statistics::{line, robust_deviation};
use crate::model::hypothesis::Hypothesis;
use crate::recording::{Run, RunKind};

/// What one ring-down tells.
#[derive(Debug, Clone, PartialEq)]
pub struct RingDown {
    /// name of the run
    pub name: String,
    /// direction of the pattern, rad
    pub angle_rad: f64,
    /// decay time constant of the amplitude, s
    pub tau_s: f64,
    /// its standard error, s
    pub tau_error_s: f64,
    /// energy control output per unit of true amplitude, corrected for the amplitude's own trend, 1/1
    pub drive: f64,
    /// its standard error
    pub drive_error: f64,
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
/// Points of the decay that are kept for the report.
const KEPT_POINTS: usize = 400;

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
    let settled = run.settled()?;
    let r = &run.recording;
    let (Some(x), Some(y), Some(v_as)) = (&r.xc_v, &r.yc_v, &r.vas_v) else {
        return refuse("columns xc_v, yc_v and vas_v are needed".into(), "all three");
    };
    let quadrature = r.xs_v.as_ref().zip(r.ys_v.as_ref());
    let angle_rad = angle_deg.to_radians();
    let warmer_k = |i: usize| {
        let difference = r.temp_c.as_ref().zip(hypothesis.reference_c).map(|(t, reference)| t[i] - reference);
        difference.filter(|d| d.is_finite()).unwrap_or_default()
    };
    let sample = |i: usize| {
        let (xs, ys) = quadrature.map_or((0.0, 0.0), |(a, b)| (a[i], b[i]));
        let seen = cvg_model::Envelope::new(x[i], xs, y[i], ys);
        // commands that are missing in a row move nothing there
        let command = |v: Option<&Vec<f64>>| v.map(|v| v[i]).filter(|v| v.is_finite()).unwrap_or_default();
        let commands = ControlOutputs { v_as: command(Some(v_as)), v_qc: command(r.vqc_v.as_ref()) };
        let warmer_k = warmer_k(i);
        hypothesis
            .unread(seen, &Moment { t_s: r.t_s[i], warmer_k, drive: commanded(&seen, &commands), ..Moment::default() })
    };
    let mut off_angle = Vec::new();
    let (mut on, mut off) = ((Vec::new(), Vec::new(), Vec::new()), (Vec::new(), Vec::new(), Vec::new()));
    // ∫ v_qc q/a² dt since the energy loop is off
    let mut by_quadrature = 0.0;
    let first = r.t_s[settled.start];
    let steady = energy_off_s - STEADY_SHARE * (energy_off_s - first);
    let mut decay = Vec::new();
    let stride = (settled.len() / KEPT_POINTS).max(1);
    for i in settled.clone() {
        let z = sample(i);
        let p = z.pendulum();
        off_angle.push(wrapped(p.angle() - angle_rad, std::f64::consts::PI));
        let ln_a = 0.5 * p.e.ln();
        if !ln_a.is_finite() {
            continue;
        }
        if (i - settled.start).is_multiple_of(stride) {
            decay.push((r.t_s[i], ln_a.exp()));
        }
        if r.t_s[i] >= steady && r.t_s[i] < energy_off_s && v_as[i].is_finite() {
            on.0.push(r.t_s[i]);
            on.1.push(ln_a);
            on.2.push(v_as[i] / ln_a.exp());
        } else if r.t_s[i] > energy_off_s {
            let v_qc = r.vqc_v.as_ref().map(|v| v[i]).filter(|v| v.is_finite()).unwrap_or_default();
            by_quadrature += (r.t_s[i] - r.t_s[i - 1]) * 0.5 * v_qc * p.q / p.e.powf(1.5);
            off.0.push(r.t_s[i]);
            off.1.push(ln_a);
            off.2.push(by_quadrature);
        }
    }
    let mut sorted = off_angle.clone();
    let middle = crate::estimation::statistics::median(&mut sorted);
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
    if on.0.len() < FEWEST || off.0.len() < FEWEST {
        return refuse(
            format!("{} steady samples with the energy loop on and {} with it off", on.0.len(), off.0.len()),
            "at least 20 of each around energy_off_s",
        );
    }
    if let Some(why) = command_that_goes_on(run, settled, energy_off_s) {
        return refuse(
            why,
            "vas_v = the energy control output, which vanishes at energy_off_s, and vqc_v = quadrature's",
        );
    }
    loop {
        let (rate, _, intercept) = decay_rate(&off.0, &off.1);
        let keep = without_spikes(&off.0, &off.1, |t| intercept - rate * t);
        let before = off.0.len();
        for column in [&mut off.0, &mut off.1, &mut off.2] {
            retain(column, &keep);
        }
        if off.0.len() == before || off.0.len() < FEWEST {
            break;
        }
    }
    let level = crate::estimation::statistics::median(&mut on.1.clone());
    let keep = without_spikes(&on.0, &on.1, |_| level);
    for column in [&mut on.0, &mut on.1, &mut on.2] {
        retain(column, &keep);
    }
    // On: ȧ/a = −1/τ − G v_as/a, so the command that would hold the amplitude still is v − v·(ȧ/a)/(1/τ + ȧ/a).
    let (trend, _) = line(&on.0, &on.1);
    let n = on.2.len() as f64;
    let mean = on.2.iter().sum::<f64>() / n;
    // Off: ȧ/a = −1/τ + G v_qc q/a², for what holds the split works on the ellipse that its loop leaves while the amplitude falls
    let (mut rate, mut rate_error, _) = decay_rate(&off.0, &off.1);
    for _ in 0..WORK_ROUNDS {
        let gain = -(rate + trend) / mean;
        let undriven: Vec<f64> = off.1.iter().zip(&off.2).map(|(ln_a, work)| ln_a - gain * work).collect();
        (rate, rate_error, _) = decay_rate(&off.0, &undriven);
    }
    if rate.is_nan() || rate <= 3.0 * rate_error {
        return refuse(
            format!("the amplitude does not decay after energy_off_s (rate {:.3e} 1/s)", -rate),
            "a ring-down with the energy loop off",
        );
    }
    let drive = mean * rate / (rate + trend);
    Ok(RingDown {
        name,
        angle_rad: angle_rad + middle,
        tau_s: 1.0 / rate,
        tau_error_s: rate_error / (rate * rate),
        drive,
        drive_error: STUDENT_11 * mean_error(&on.2, mean),
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
        |values: Vec<f64>| (!values.is_empty()).then(|| crate::estimation::statistics::median(&mut values.clone()));
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

/// Decay rate of an amplitude from its logarithm, 1/s, its standard error, and the intercept: weighted by the squared amplitude, since
/// the readout's noise is constant.
fn decay_rate(t: &[f64], ln_a: &[f64]) -> (f64, f64, f64) {
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
    let rest: f64 =
        t.iter().zip(ln_a).zip(&weight).map(|((t, l), w)| w * (l - ml - slope * (t - mt)).powi(2)).sum::<f64>();
    (-slope, (rest / (t.len() as f64 - 2.0) / stt).sqrt(), ml - slope * mt)
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
    const BLOCKS: usize = 12;
    let size = (values.len() / BLOCKS).max(1);
    let blocks: Vec<f64> = values.chunks_exact(size).map(|b| b.iter().sum::<f64>() / b.len() as f64).collect();
    let n = blocks.len() as f64;
    (blocks.iter().map(|b| (b - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt()
}

/// The two actuation gains (per 2ω, 1/s and V per V) and their covariance, from ring-downs at two or more directions:
/// the drive's gain in direction θ is G_Ax cos²θ + G_Ay sin²θ = 1/(τ·(−v_as/a)).
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
    /// From ring-downs; `None` where their directions do not tell the axes apart.
    pub fn from_ring_downs(ring_downs: &[RingDown]) -> Option<Self> {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for r in ring_downs {
            let gain = -1.0 / (r.tau_s * r.drive);
            let relative = (r.tau_error_s / r.tau_s).hypot(r.drive_error / r.drive).max(1e-9);
            let c2 = r.angle_rad.cos().powi(2);
            let row = Vector2::new(c2, 1.0 - c2);
            let weight = 1.0 / (relative * gain).powi(2);
            normal += row * row.transpose() * weight;
            right += row * gain * weight;
        }
        let covariance = normal.try_inverse()?;
        let g = covariance * right;
        let (dx, dy) = (covariance[(0, 0)].sqrt() / g[0], covariance[(1, 1)].sqrt() / g[1]);
        let cross = covariance[(0, 1)] / (g[0] * g[1]);
        let sound = g[0] > 0.0 && g[1] > 0.0 && dx < 0.3 && dy < 0.3;
        sound.then(|| Self {
            gains: [g[0], g[1]],
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
