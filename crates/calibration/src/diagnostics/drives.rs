//! Whether the drives put out what they are commanded. The quadrature balance, q̇/a = G (f_qc − f_0)/a + ½(Δω sin 2θ_ω cos 2θ −
//! Δω cos 2θ_ω sin 2θ), has the force itself in it: drives that clip at a level break it wherever a command is beyond that, and
//! no share of the angle says as much, since the energy command that clips with it is small beside what holds a split. The offset
//! f_0 of the command, its converter's or its logger's, is adjusted with it.
//!
//! It refuses to look at the angle. A fit of that takes the level from here, with its uncertainty.

use cvg_estimator::direction::{Direction, major_axis};
use cvg_model::effects::{EffectId, Moment, Stage, Values};
use cvg_model::{AxisForces, Envelope};
use nalgebra::{DMatrix, DVector, Matrix5, Vector5};

use crate::data::track::Track;
use crate::estimation::joint_fit::Dataset;
use crate::facts::{EffectReport, Estimate, ParameterReport};
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::robust_deviation;
use crate::recording::Role;

/// Pairs of neighbouring samples that are looked at.
const LOOKED_AT: usize = 20_000;
/// The pattern turns by less than this between neighbours, rad: what acted between them is then told by the commands around.
const LARGEST_TURN_RAD: f64 = 0.15;
/// The mean between the inner two of four even samples: that of the cubic through them. A mean of two would lose a share of what
/// goes with 2θ that grows with the rate, as drives that clip do.
const MEAN: [f64; 4] = [-1.0 / 24.0, 13.0 / 24.0, 13.0 / 24.0, -1.0 / 24.0];
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
/// A level that gains as much in 2 ln likelihood, after the price of those that were tried, is likely enough to be allowed for: one in 100 by
/// chance.
const LIKELY: f64 = 6.6;
/// Fewest pairs with a command beyond the level.
const FEWEST_BEYOND: usize = 20;

/// What the drives were commanded to and where the pattern lay, at one sample.
struct Instant {
    /// with what the drives were commanded to
    at: Moment<f64>,
    axis: Direction<f64>,
    per_amplitude: f64,
}

/// Two neighbouring samples, and those around them.
struct Pair {
    /// change of q/a, 1/s, and its mean
    widening: f64,
    q: f64,
    /// of the pattern, mean
    cos2: f64,
    sin2: f64,
    /// mean of 1/a, 1/V
    per_amplitude: f64,
    /// largest force around it, V
    largest: f64,
    around: [Instant; 4],
}

/// Half the quadrature over the energy, and the vibration that has it, at four even samples.
type Around = [(Envelope<f64>, f64); 4];

/// How far the quadrature of one of the inner two lies from the mean of its neighbours.
fn bent(around: &Around, inner: usize) -> f64 {
    around[inner].1 - 0.5 * (around[inner - 1].1 + around[inner + 1].1)
}

/// The pairs of a track whose commands tell what acted between them.
fn pairs(track: &Track, hypothesis: &Hypothesis, out: &mut Vec<Pair>, stride: usize) {
    let quadrature = |i: usize| {
        let z = hypothesis.unread(track.envelope(i), &track.moment(i, 0.0));
        let p = z.pendulum();
        (z, 0.5 * p.q / p.e)
    };
    let fitted = track.segments.iter().filter(|s| s.role == Role::Fit);
    let inner = fitted.flat_map(|s| s.range.start + 1..s.range.end.saturating_sub(2)).step_by(stride);
    let all: Vec<(usize, Around)> = inner.map(|i| (i, [i - 1, i, i + 1, i + 2].map(quadrature))).collect();
    let limit = SPIKE * robust_deviation(all.iter().map(|(_, around)| bent(around, 1)));
    for (i, seen) in all {
        let dt = track.t_s[i + 1] - track.t_s[i];
        let turns_little = track.commands(i, 1).is_some_and(|v| (v.turn_rad_s * dt).abs() < LARGEST_TURN_RAD);
        if !turns_little || bent(&seen, 1).abs() > limit || bent(&seen, 2).abs() > limit {
            continue;
        }
        let [_, (_, before), (_, after), _] = seen;
        let around: [Instant; 4] = std::array::from_fn(|j| {
            let z = seen[j].0;
            let p = z.pendulum();
            let at = track.moment(i + j - 1, 0.0);
            Instant { at, axis: major_axis(&z, &p), per_amplitude: 1.0 / p.e.sqrt() }
        });
        out.push(Pair {
            widening: (after - before) / dt,
            q: 0.5 * (before + after),
            cos2: mean(&around, |at| at.axis.cos * at.axis.cos - at.axis.sin * at.axis.sin),
            sin2: mean(&around, |at| 2.0 * at.axis.sin * at.axis.cos),
            per_amplitude: mean(&around, |at| at.per_amplitude),
            largest: around.iter().map(|at| size(&at.at.drive)).fold(0.0, f64::max),
            around,
        });
    }
}

/// The larger of the two forces, V.
fn size(f: &AxisForces<f64>) -> f64 {
    f.x_c.hypot(f.x_s).max(f.y_c.hypot(f.y_s))
}

/// The mean of `of` between the inner two of four samples.
fn mean(around: &[Instant; 4], of: impl Fn(&Instant) -> f64) -> f64 {
    around.iter().zip(MEAN).map(|(at, share)| share * of(at)).sum()
}

/// The quadrature balance of a campaign.
struct Balance {
    pairs: Vec<Pair>,
    /// what the drives do besides, in its order
    actuation: Vec<(EffectId, Values<f64>)>,
    /// what each pair was pushed by where nothing clips: most of them, at the levels that are tried
    unclipped: Vec<f64>,
}

impl Balance {
    fn new(pairs: Vec<Pair>, actuation: Vec<(EffectId, Values<f64>)>) -> Self {
        let mut balance = Self { pairs, actuation, unclipped: Vec::new() };
        balance.unclipped = balance.pairs.iter().map(|pair| balance.pushed(pair, 0.0)).collect();
        balance
    }

    /// What a pair was pushed by, per unit of force scale and amplitude, where drives clip at 1/`inverse_level`.
    fn pushed(&self, pair: &Pair, inverse_level: f64) -> f64 {
        mean(&pair.around, |at| {
            let clipped = EffectId::DriveSaturation.actuate(&[inverse_level, 0.0, 0.0, 0.0], at.at.drive, &at.at);
            let f = self.actuation.iter().fold(clipped, |f, (id, values)| id.actuate(values, f, &at.at));
            (at.axis.cos * f.y_c - at.axis.sin * f.x_c) * at.per_amplitude
        })
    }

    /// Mean square of what is left of q̇/a with the force scale, the split, the damping and the offset that leave least.
    fn left(&self, inverse_level: f64) -> f64 {
        let row = |(p, unclipped): (&Pair, &f64)| {
            let clips = p.largest * inverse_level > 1.0;
            Vector5::new(
                if clips { self.pushed(p, inverse_level) } else { *unclipped },
                p.sin2,
                p.cos2,
                p.q,
                p.per_amplitude,
            )
        };
        let rows: Vec<Vector5<f64>> = self.pairs.iter().zip(&self.unclipped).map(row).collect();
        let (mut normal, mut right) = (Matrix5::zeros(), Vector5::zeros());
        for (row, pair) in rows.iter().zip(&self.pairs) {
            normal += row * row.transpose();
            right += row * pair.widening;
        }
        let dynamic =
            (DMatrix::from_column_slice(5, 5, normal.as_slice()), DVector::from_column_slice(right.as_slice()));
        let found = Vector5::from_vec(NormalEquations::of(dynamic.0, dynamic.1).solve());
        let off = |(row, pair): (&Vector5<f64>, &Pair)| (pair.widening - row.dot(&found)).powi(2);
        rows.iter().zip(&self.pairs).map(off).sum::<f64>() / self.pairs.len() as f64
    }

    fn largest_command(&self) -> f64 {
        let mut all: Vec<f64> = self.pairs.iter().map(|p| size(&p.around[1].at.drive)).collect();
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

    /// How far from 1/level that leaves `least` the noise may move it: to where 1/n more is left, on the farther side. Near the
    /// largest command what is left is no parabola.
    fn deviation(&self, best: f64, least: f64) -> f64 {
        let more = least * (1.0 + 1.0 / self.pairs.len() as f64);
        let reached = |far: f64| {
            let (mut near, mut far) = (best, far);
            for _ in 0..REFINED {
                let middle = 0.5 * (near + far);
                if self.left(middle) < more { near = middle } else { far = middle }
            }
            (far - best).abs()
        };
        reached(0.0).max(reached(2.0 * best))
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

/// What the quadrature balance of a campaign tells of a level at which its drives clip.
#[derive(Debug, Clone)]
pub(crate) struct Clipping {
    pub(crate) inverse_level: Estimate,
    /// rms of what is left of q̇/a without it and with it, 1/s
    left: [f64; 2],
    /// in 2 ln likelihood after its price
    gain: f64,
    /// of samples with a command beyond the level
    share: f64,
    /// it is told, and not only possible
    is_told: bool,
}

/// The level at which the drives of a campaign clip, where their commands tell it or make it likely.
pub(crate) fn clipping(dataset: &Dataset, hypothesis: &Hypothesis) -> Option<Clipping> {
    let recorded = dataset.tracks.iter().all(|p| p.track.records_the_loops());
    if !recorded || hypothesis.force_scale == 0.0 {
        return None;
    }
    let rows: usize = dataset.tracks.iter().map(|p| p.track.dense().samples(Role::Fit)).sum();
    let mut all = Vec::new();
    dataset.tracks.iter().for_each(|p| pairs(p.track.dense(), hypothesis, &mut all, rows.div_ceil(LOOKED_AT).max(1)));
    let others = hypothesis.acting(Stage::Actuation).filter(|(_, m)| m.id != EffectId::DriveSaturation);
    let actuation = others.map(|(_, m)| (m.id, m.values)).collect();
    let balance = Balance::new(all, actuation);
    let (n, largest) = (balance.pairs.len() as f64, balance.largest_command());
    if n < 10.0 * FEWEST_BEYOND as f64 || largest <= 0.0 {
        return None;
    }
    let (x, before) = balance.best(largest)?;
    let after = balance.left(x);
    let by_chance = n * (before / after).ln();
    let tried = 2.0 * ((TRIED + REFINED) as f64).ln();
    let gain = by_chance - n.ln() - tried;
    let count = balance.pairs.iter().filter(|p| size(&p.around[1].at.drive) * x > 1.0).count();
    if by_chance - tried < LIKELY {
        return None;
    }
    let is_told = gain > LEAST_GAIN && after < LARGEST_SHARE * before && count >= FEWEST_BEYOND;
    // the mean of the commands is what acted between two samples but for this share
    let deviation = balance.deviation(x, after).hypot(LARGEST_TURN_RAD.powi(2) / 12.0 * x);
    Some(Clipping {
        inverse_level: Estimate::new(x, deviation),
        left: [before.sqrt(), after.sqrt()],
        gain,
        share: count as f64 / n,
        is_told,
    })
}

impl Clipping {
    /// What is reported of it, where it is told.
    pub(crate) fn report(&self) -> Option<EffectReport> {
        self.is_told.then(|| told(self.inverse_level, self.left, self.gain, self.share))
    }
}

fn told(inverse_level: Estimate, left: [f64; 2], gain: f64, share: f64) -> EffectReport {
    let d = EffectId::DriveSaturation.description();
    let [before, after] = left;
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
