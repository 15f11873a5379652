//! Whether the drives put out what they are commanded. The quadrature balance, q̇/a = G f_qc/a + ½(Δω sin 2θ_ω cos 2θ −
//! Δω cos 2θ_ω sin 2θ), has the force itself in it: drives that clip at a level break it wherever a command is beyond that, and
//! no share of the angle says as much, since the energy command that clips with it is small beside what holds a split.
//!
//! It refuses to look at the angle, and to be part of a fit of it.

use cvg_estimator::direction::{Direction, major_axis};
use cvg_model::AxisForces;
use cvg_model::effects::{EffectId, Stage, Values};

use crate::data::track::Track;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::Dataset;
use crate::estimation::linear::NormalEquations;
use crate::estimation::statistics::robust_deviation;
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::recording::Role;
use crate::report::{EffectReport, Estimate, ParameterReport};

/// Pairs of neighbouring samples that are looked at.
const LOOKED_AT: usize = 6000;
/// The pattern turns by less than this between neighbours, rad: the mean of two commands is then what acted.
const LARGEST_TURN_RAD: f64 = 0.15;
/// Quadratures further from the mean of their neighbours than so many robust deviations are spikes.
const SPIKE: f64 = 20.0;
/// The largest command over the level that is tried.
const LARGEST_OVERDRIVE: f64 = 6.0;
/// Levels that are tried before the best is refined, and how often that is.
const TRIED: usize = 20;
const REFINED: usize = 24;
/// Levels below one that leaves so many times the least leave more.
const MUCH_MORE: f64 = 2.0;
/// What a level has to gain in 2 ln likelihood after its price, and the share of the mean square that it may leave.
const LEAST_GAIN: f64 = 12.0;
const LARGEST_SHARE: f64 = 0.95;
/// Fewest pairs with a command beyond the level.
const FEWEST_BEYOND: usize = 20;

/// What a drive was commanded to and where the pattern lay, at one sample.
struct Instant {
    volts: AxisForces<f64>,
    axis: Direction<f64>,
    per_amplitude: f64,
}

/// Two neighbouring samples.
struct Pair {
    /// change of q/a, 1/s, and its mean
    widening: f64,
    q: f64,
    /// of the pattern, mean
    cos2: f64,
    sin2: f64,
    ends: [Instant; 2],
}

/// The pairs of a track whose commands tell what acted between them.
fn pairs(track: &Track, hypothesis: &Hypothesis, out: &mut Vec<Pair>, stride: usize) {
    let quadrature = |i: usize| {
        let seen = track.envelope(i);
        let z = hypothesis.unread(seen, &track.moment(i, 0.0));
        (z, 0.5 * z.pendulum().q / z.pendulum().e)
    };
    let bent = |i: usize| quadrature(i).1 - 0.5 * (quadrature(i - 1).1 + quadrature(i + 1).1);
    let fitted = || track.segments.iter().filter(|s| s.role == Role::Fit);
    let inner = || fitted().flat_map(|s| s.range.start + 1..s.range.end.saturating_sub(2)).step_by(stride);
    let limit = SPIKE * robust_deviation(inner().map(bent));
    for i in inner() {
        let dt = track.t_s[i + 1] - track.t_s[i];
        let turns_little = track.commands(i, 1).is_some_and(|v| (v.turn_rad_s * dt).abs() < LARGEST_TURN_RAD);
        if !turns_little || bent(i).abs() > limit || bent(i + 1).abs() > limit {
            continue;
        }
        let [(a, before), (b, after)] = [quadrature(i), quadrature(i + 1)];
        let instant = |z: &cvg_model::Envelope<f64>, i: usize| {
            let p = z.pendulum();
            Instant { volts: track.moment(i, 0.0).drive, axis: major_axis(z, &p), per_amplitude: 1.0 / p.e.sqrt() }
        };
        let ends = [instant(&a, i), instant(&b, i + 1)];
        let mean = |f: fn(&Direction<f64>) -> f64| 0.5 * (f(&ends[0].axis) + f(&ends[1].axis));
        out.push(Pair {
            widening: (after - before) / dt,
            q: 0.5 * (before + after),
            cos2: mean(|d| d.cos * d.cos - d.sin * d.sin),
            sin2: mean(|d| 2.0 * d.sin * d.cos),
            ends,
        });
    }
}

/// The quadrature balance of a campaign.
struct Balance {
    pairs: Vec<Pair>,
    /// what the drives do besides, in its order
    actuation: Vec<(EffectId, Values<f64>)>,
}

impl Balance {
    /// What a pair was pushed by, per unit of force scale and amplitude, where drives clip at 1/`inverse_level`.
    fn pushed(&self, pair: &Pair, inverse_level: f64) -> f64 {
        let of = |end: &Instant| {
            let clipped = EffectId::DriveSaturation.actuate(&[inverse_level, 0.0, 0.0, 0.0], end.volts);
            let f = self.actuation.iter().fold(clipped, |f, (id, values)| id.actuate(values, f));
            (end.axis.cos * f.y_c - end.axis.sin * f.x_c) * end.per_amplitude
        };
        0.5 * (of(&pair.ends[0]) + of(&pair.ends[1]))
    }

    /// Mean square of what is left of q̇/a with the force scale, the split and the damping that leave least.
    fn left(&self, inverse_level: f64) -> f64 {
        let rows: Vec<[f64; 4]> =
            self.pairs.iter().map(|p| [self.pushed(p, inverse_level), p.sin2, p.cos2, p.q]).collect();
        let mut equations = NormalEquations::new(4);
        for (row, pair) in rows.iter().zip(&self.pairs) {
            equations.add(row, pair.widening);
        }
        let found = equations.solve();
        let off = |(row, pair): (&[f64; 4], &Pair)| {
            (pair.widening - row.iter().zip(&found).map(|(a, b)| a * b).sum::<f64>()).powi(2)
        };
        rows.iter().zip(&self.pairs).map(off).sum::<f64>() / self.pairs.len() as f64
    }

    fn largest_command(&self) -> f64 {
        let size = |f: &AxisForces<f64>| f.x_c.hypot(f.x_s).max(f.y_c.hypot(f.y_s));
        let mut all: Vec<f64> = self.pairs.iter().map(|p| size(&p.ends[0].volts)).collect();
        all.sort_by(f64::total_cmp);
        // a few may be spikes
        all.get(all.len().saturating_sub(1 + FEWEST_BEYOND / 2)).copied().unwrap_or_default()
    }

    /// 1/level that leaves least, and what is left without one; none where every level leaves more.
    fn best(&self, largest: f64) -> Option<(f64, f64)> {
        let without = self.left(0.0);
        let level = |i: usize| (1.0 + (LARGEST_OVERDRIVE - 1.0) * (i as f64 / TRIED as f64).powi(2)) / largest;
        let (mut best, mut least) = (0, without);
        for i in 1..=TRIED {
            let left = self.left(level(i));
            if left < least {
                (best, least) = (i, left);
            } else if left > MUCH_MORE * least {
                break;
            }
        }
        (best > 0).then(|| (self.refined(level(best - 1), level((best + 1).min(TRIED))), without))
    }

    /// 1/level that leaves least between two, by the golden section.
    fn refined(&self, mut low: f64, mut high: f64) -> f64 {
        let share = 0.5 * (5.0_f64.sqrt() - 1.0);
        let inner = |low: f64, high: f64| [high - share * (high - low), low + share * (high - low)];
        for _ in 0..REFINED {
            let [a, b] = inner(low, high);
            if self.left(a) < self.left(b) { high = b } else { low = a }
        }
        0.5 * (low + high)
    }
}

/// The level at which the drives of a campaign clip, where their commands tell it.
pub(crate) fn drives_that_saturate(dataset: &Dataset, fit: &Fit) -> Option<EffectReport> {
    let hypothesis = &fit.hypothesis;
    let recorded = dataset.tracks.iter().all(|p| p.track.records_the_loops());
    if !recorded || hypothesis.force_scale == 0.0 {
        return None;
    }
    let rows: usize = dataset.tracks.iter().map(|p| p.track.dense().samples(Role::Fit)).sum();
    let mut all = Vec::new();
    dataset.tracks.iter().for_each(|p| pairs(p.track.dense(), hypothesis, &mut all, rows.div_ceil(LOOKED_AT).max(1)));
    let actuation = hypothesis.acting(Stage::Actuation).map(|(_, m)| (m.id, m.values)).collect();
    let balance = Balance { pairs: all, actuation };
    let (n, largest) = (balance.pairs.len() as f64, balance.largest_command());
    if n < 10.0 * FEWEST_BEYOND as f64 || largest <= 0.0 {
        return None;
    }
    let (x, before) = balance.best(largest)?;
    let after = balance.left(x);
    let gain = n * (before / after).ln() - n.ln() - 2.0 * ((TRIED + REFINED) as f64).ln();
    let beyond = |end: &Instant| {
        let v = &end.volts;
        v.x_c.hypot(v.x_s).max(v.y_c.hypot(v.y_s)) * x > 1.0
    };
    let count = balance.pairs.iter().filter(|p| beyond(&p.ends[0])).count();
    let is_told = gain > LEAST_GAIN && after < LARGEST_SHARE * before && count >= FEWEST_BEYOND;
    if !is_told {
        return None;
    }
    // what is left grows with the square of the distance, and by 1/n of itself within a standard deviation
    let step = 2e-3 * x;
    let curvature = (balance.left(x + step) + balance.left(x - step) - 2.0 * after) / (step * step);
    let by_noise = (2.0 * after / (n * curvature.max(f64::MIN_POSITIVE))).sqrt();
    // the mean of two commands is what acted between them but for this share
    let deviation = by_noise.hypot(LARGEST_TURN_RAD.powi(2) / 12.0 * x);
    Some(told(Estimate::new(x, deviation), [before, after], gain, count as f64 / n))
}

fn told(inverse_level: Estimate, left: [f64; 2], gain: f64, share: f64) -> EffectReport {
    let d = EffectId::DriveSaturation.description();
    let [before, after] = left.map(f64::sqrt);
    EffectReport {
        id: d.id.into(),
        origin: Origin::Discovered,
        parameters: vec![ParameterReport {
            name: d.parameters[0].name.into(),
            unit: d.parameters[0].unit.into(),
            value: inverse_level.value,
            ci95: Some(inverse_level.ci95),
        }],
        heldout_rms_deg: None,
        evidence: format!(
            "{}; told by the quadrature balance: {before:.2e}/s of q̇/a are left without it and {after:.2e}/s with it, a gain of {gain:.0} in \
             2 ln likelihood after its price; {:.1} % of the samples have a command beyond the level of {:.4} V. The angle hardly shows \
             it, and nothing is undone",
            d.signature,
            100.0 * share,
            1.0 / inverse_level.value
        ),
        confounded_with: Vec::new(),
        separated_by: None,
    }
}
