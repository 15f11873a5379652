//! Whether the ring-downs are of the instrument that turns in the rotation runs.
//!
//! In every direction the drive replaces the damping, $$G(θ)\\,d(θ) = 1/τ(θ),\\quad d = -v_{as}/a,\\quad 1/τ(θ) = 1/τ +
//! ½Δ(1/τ)\\cos 2(θ-θ_τ)$$ A pattern that turns takes the mean of d over all directions; a ring-down takes d of one, which
//! differs from it by what the gains differ and by the anisodamping, that the angle tells. Another resonator takes another.

use std::collections::BTreeSet;

use cvg_model::effects::EffectId;

use crate::error::Refusal;
use crate::estimation::actuation::{RingDown, ring_down};
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::Dataset;
use crate::model::hypothesis::{Hypothesis, Unknown};
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{line, median, robust_deviation};
use crate::recording::{Role, Run};

/// A ring-down takes no drive that differs by a larger share than this from what the rotations take: gains of the axes that
/// differ by a fifth, and as much of the damping, make less.
const LARGEST_SHARE: f64 = 0.25;
/// Rotations that take less than this share of what every ring-down takes hold no amplitude by it.
const LEAST_DRIVE: f64 = 0.2;
/// Once the anisodamping is known, dampings of ring-downs agree within this share, or within so many deviations.
const SAME_DAMPING: f64 = 0.05;
const DEVIATIONS: f64 = 6.0;
/// An anisodamping of the ring-downs' own: its unknowns, how far off it each may be in deviations, of which one is no less than this share
/// of the decay time, and how much of the damping it may be. Engineering choices.
const OWN_UNKNOWNS: usize = 3;
const OWN_DEVIATIONS: f64 = 3.0;
const LEAST_TAU_ERROR: f64 = 1e-3;
const LARGEST_OWN: f64 = 0.15;
/// What is read of an amplitude that is held goes up and down by so many of its deviations.
const RANGE: f64 = 3.0;
/// The command that holds a pattern against what turns it is at most so many times the energy command.
const LARGEST_HOLD: f64 = 2.0;
/// Runs that differ in temperature by more than this differ in their damping.
const SAME_TEMPERATURE_K: f64 = 5.0;
/// Samples of a run that tell how strongly it was driven.
const LOOKED_AT: usize = 2000;

/// What the usual rotation takes to hold its amplitude.
#[derive(Debug, Clone, Copy)]
struct Drive {
    /// −v_as/a, 1/1
    mean: f64,
    /// by how much that may be off where the amplitude is not read as it is, or not held: what is left of ln a, had it gone with time
    allowance: f64,
}

/// What is left of `y` about its best line.
fn about_a_line<'a>(x: &'a [f64], y: &'a [f64]) -> impl Iterator<Item = f64> + use<'a> {
    let (slope, intercept) = line(x, y);
    x.iter().zip(y).map(move |(x, y)| y - intercept - slope * x)
}

impl Dataset {
    /// Says no where the rotations take no energy command that could replace the damping which the ring-downs show.
    ///
    /// # Errors
    /// Where a ring-down is not one, or what the rotations take replaces no damping at all.
    pub(crate) fn require_driven_rotations(&self, hypothesis: &Hypothesis) -> Result<(), Refusal> {
        let all = self.ring_downs(hypothesis)?;
        let undriven = |usual: &Drive| all.iter().all(|r| usual.mean + usual.allowance < LEAST_DRIVE * -r.drive);
        let (Some(first), Some(usual)) = (all.first(), self.usual_drive(hypothesis, &all).filter(undriven)) else {
            return Ok(());
        };
        Err(Refusal::no_answer(
            &first.name,
            format!(
                "the ring-downs take an energy command of {:.4} per amplitude, the rotations {:.4} in the mean: that does \
                 not replace one damping",
                first.drive, -usual.mean
            ),
            "vas_v and vqc_v in their places in the rotations, in one unit, and ring-downs of the same device",
        ))
    }

    /// Leaves out ring-downs that are of another instrument than the rotations, or of another than each other, by name;
    /// whether there were any. `fit` is what the campaign was found to be: before its anisodamping and the skew of
    /// its drives are known, sound ring-downs differ as much.
    ///
    /// # Errors
    /// Where a ring-down is not one.
    pub(crate) fn without_foreign_ring_downs(&mut self, fit: &Fit) -> Result<bool, Refusal> {
        let hypothesis = &fit.hypothesis;
        let all = self.ring_downs(hypothesis)?;
        let usual = self.usual_drive(hypothesis, &all);
        let through_skew = through_skew(hypothesis);
        let usual = usual.filter(|d| d.mean > 0.0);
        let share = |r: &RingDown| usual.map(|usual| -r.drive / usual.mean - 1.0);
        let force = RANGE * self.unknown_force().unwrap_or(0.0) / self.usual_amplitude();
        let unsure = usual.map_or(0.0, |usual| (usual.allowance + force) / usual.mean);
        let is_off = |share: &f64| share.abs() > LARGEST_SHARE + through_skew + unsure;
        let mut odd: Vec<(usize, String)> = Vec::new();
        // where no ring-down agrees with them, the rotations are what is odd: beside a large split they take more
        if all.iter().any(|r| share(r).is_some_and(|s| !is_off(&s))) {
            let off = all.iter().enumerate().filter_map(|(at, r)| Some((at, share(r).filter(is_off)?)));
            odd.extend(off.filter(|(at, _)| !self.differs_in_temperature(&self.ring_down_runs[*at])).map(
                |(at, share)| {
                    let direction = if share > 0.0 { "more" } else { "less" };
                    let percent = 100.0 * share.abs();
                    (at, format!("it takes {percent:.1} % {direction} energy command per amplitude than the rotations"))
                },
            ));
        }
        // beside forces that are open within a step the anisodamping is not known well enough for that
        if odd.is_empty() && self.quantisation.is_none() && self.tracks_differ() && !agree_by_themselves(&all) {
            odd = contradictions(&all, fit, usual.map(|usual| usual.mean));
        }
        for (at, why) in odd.iter().rev() {
            let name = crate::data::track::run_name(&self.ring_down_runs[*at]);
            self.warnings.push(format!("{name}: left out: {why}: a ring-down of another device?"));
            let run = self.ring_down_runs.remove(*at);
            self.ring_downs_left_out.push(run.file.display().to_string());
        }
        Ok(!odd.is_empty())
    }

    /// The ring-downs behind the readout of a hypothesis. One that is none there is taken as it was recorded: a readout that a fit tries may
    /// be absurd, and the file is judged by what is in it.
    ///
    /// # Errors
    /// Where a recording is no ring-down.
    pub(crate) fn ring_downs(&self, hypothesis: &Hypothesis) -> Result<Vec<RingDown>, Refusal> {
        let evaluated = |run| ring_down(run, hypothesis).or_else(|_| ring_down(run, &self.start));
        self.ring_down_runs.iter().map(|run| evaluated(run).map(|told| self.with_unknown_force(told))).collect()
    }

    /// The mean of −v_as/a over the directions, 1/1, of the usual rotation, less what v_qc does of it and less what it takes to let the
    /// amplitude grow, by the gain of the drives that the ring-downs show; `None` where it was not recorded.
    fn usual_drive(&self, hypothesis: &Hypothesis, ring_downs: &[RingDown]) -> Option<Drive> {
        let inverse_gain = median(&mut ring_downs.iter().map(|r| -r.tau_s * r.drive).collect::<Vec<_>>());
        let fitted = self.tracks.iter().map(|p| &p.track).filter(|t| t.samples(Role::Fit) > 0);
        let means = fitted.filter(|t| t.has_commands() && t.has_amplitude()).filter_map(|t| {
            let stride = (t.t_s.len() / LOOKED_AT).max(1);
            let rows = t.segments.iter().flat_map(|s| s.range.clone()).step_by(stride);
            let (mut t_s, mut ln_a, mut sum) = (Vec::new(), Vec::new(), 0.0);
            for i in rows {
                let p = hypothesis.unread(t.envelope(i), &t.moment(i, 0.0)).pendulum();
                let Some(v) = t.commands(i, stride).map(|v| v.now) else { continue };
                // what holds a split works on the ellipse that a quadrature loop of finite bandwidth leaves
                let taken = 0.5 * v.v_qc * p.q / p.e.powf(1.5) - v.v_as / p.e.sqrt();
                if taken.is_finite() {
                    t_s.push(t.t_s[i]);
                    ln_a.push(0.5 * p.e.ln());
                    sum += taken;
                }
            }
            let lasted = t_s.last()? - t_s.first()?;
            Some(Drive {
                mean: sum / t_s.len() as f64 - inverse_gain * line(&t_s, &ln_a).0,
                allowance: RANGE * inverse_gain.abs() * robust_deviation(about_a_line(&t_s, &ln_a))
                    / lasted.max(f64::MIN_POSITIVE),
            })
        });
        let (mut means, mut allowances): (Vec<f64>, Vec<f64>) =
            means.map(|drive| (drive.mean, drive.allowance)).unzip();
        (!means.is_empty()).then(|| Drive { mean: median(&mut means), allowance: median(&mut allowances) })
    }

    fn differs_in_temperature(&self, run: &Run) -> bool {
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, n) = values.filter(|v| v.is_finite()).fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
            (n > 0.0).then(|| sum / n)
        };
        let here = run.recording.temp_c.as_ref().and_then(|t| mean(&mut t.iter().copied()));
        let there = mean(&mut self.tracks.iter().flat_map(|p| p.track.temperatures_c()));
        here.zip(there).is_some_and(|(a, b)| (a - b).abs() > SAME_TEMPERATURE_K)
    }
}

/// What a skew of the drives lets through of the command that holds the pattern, as a share of the damping: it works on
/// the amplitude of a pattern on Y, with the energy loop on as with it off, so that it changes what looks like damping and
/// not the drive's gain. It is not recorded.
fn through_skew(hypothesis: &Hypothesis) -> f64 {
    hypothesis.member(EffectId::ActuationSkew).map_or(0.0, |skew| LARGEST_HOLD * skew.values[0].abs())
}

/// What the anisodamping adds to the damping that a ring-down shows, 1/s.
fn anisodamping(r: &RingDown, hypothesis: &Hypothesis) -> f64 {
    let of = |id| hypothesis.member(id).map_or([0.0; 2], |m| [m.values[0], m.values[1]]);
    let (mean, slope) = (of(EffectId::Anisodamping), of(EffectId::AnisodampingTemperature));
    let [cos, sin] = [0, 1].map(|p| mean[p] + slope[p] * r.warmer_k);
    0.5 * (cos * (2.0 * r.angle_rad).cos() + sin * (2.0 * r.angle_rad).sin())
}

/// Standard deviation of a fitted anisodamping, 1/s; 0 where there is none.
fn anisodamping_deviation(fit: &Fit) -> f64 {
    let member = fit.hypothesis.position(EffectId::Anisodamping);
    let of = |u: &Unknown| matches!(u, Unknown::Effect(at, _) if Some(*at) == member);
    let variances = (0..fit.unknowns.len()).filter(|i| of(&fit.unknowns[*i])).map(|i| fit.covariance[(i, i)].max(0.0));
    variances.sum::<f64>().sqrt()
}

/// By which share the dampings of ring-downs, less the anisodamping, differ at most.
pub(crate) fn spread_of_dampings(all: &[RingDown], hypothesis: &Hypothesis) -> f64 {
    let of = |pick: fn(f64, f64) -> f64, from: f64| {
        all.iter().map(|r| 1.0 / r.tau_s - anisodamping(r, hypothesis)).fold(from, pick)
    };
    let (low, high) = (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY));
    if low > 0.0 { high / low - 1.0 } else { 0.0 }
}

/// Whether ring-downs in four directions or more, told to ten degrees, are of one resonator by an anisodamping of their own, 1/τ = c + A cos 2θ + B sin 2θ: then it is the
/// rotations' that is off, for want of an effect that they lack.
fn agree_by_themselves(all: &[RingDown]) -> bool {
    #[allow(clippy::cast_possible_truncation, reason = "below 18")]
    let direction = |r: &RingDown| (r.angle_rad.to_degrees().rem_euclid(180.0) * 0.1).round() as i64 % 18;
    // one that repeats a direction bears out nothing of the others
    if all.iter().map(direction).collect::<BTreeSet<_>>().len() <= OWN_UNKNOWNS {
        return false;
    }
    let row = |r: &RingDown| {
        let (sin, cos) = (2.0 * r.angle_rad).sin_cos();
        let weight = r.tau_s * r.tau_s / r.tau_error_s.max(LEAST_TAU_ERROR * r.tau_s);
        ([weight, weight * cos, weight * sin], weight / r.tau_s)
    };
    let mut equations = NormalEquations::new(OWN_UNKNOWNS);
    all.iter().map(row).for_each(|(row, value)| equations.add(&row, value));
    let found = equations.solve();
    let off = |r: &RingDown| {
        let (row, value) = row(r);
        (value - row.iter().zip(&found).map(|(a, x)| a * x).sum::<f64>()).abs()
    };
    found[1].hypot(found[2]) < LARGEST_OWN * found[0] && all.iter().all(|r| off(r) < OWN_DEVIATIONS)
}

/// Ring-downs whose damping, less the anisodamping, is not that of the others. Of two, the one that takes another drive than
/// the rotations is odd; where nothing tells, both are.
fn contradictions(all: &[RingDown], fit: &Fit, usual: Option<f64>) -> Vec<(usize, String)> {
    let hypothesis = &fit.hypothesis;
    let own = |r: &RingDown| anisodamping(r, hypothesis);
    // of two dampings at right angles, by what is not known of the anisodamping
    let unknown = anisodamping_deviation(fit);
    let damping: Vec<f64> = all.iter().map(|r| 1.0 / r.tau_s - own(r)).collect();
    let deviation = |r: &RingDown| r.tau_error_s / (r.tau_s * r.tau_s);
    let agree = |a: usize, b: usize| {
        let within = DEVIATIONS * deviation(&all[a]).hypot(deviation(&all[b])).hypot(unknown);
        let same = (SAME_DAMPING + through_skew(hypothesis)) * 0.5 * (damping[a] + damping[b]);
        (damping[a] - damping[b]).abs() <= within.max(same)
    };
    let friends = |a: usize| (0..all.len()).filter(|b| agree(a, *b)).count();
    let most = (0..all.len()).map(friends).max().unwrap_or(0);
    let mut odd: Vec<usize> = (0..all.len()).filter(|a| friends(*a) < most).collect();
    let off = |a: usize| usual.map(|usual| (-all[a].drive * (1.0 - own(&all[a]) * all[a].tau_s) / usual).ln().abs());
    if odd.is_empty() && most < all.len() {
        odd = (0..all.len()).collect();
        let nearest = odd.iter().copied().filter_map(|a| off(a).map(|o| (a, o))).min_by(|a, b| a.1.total_cmp(&b.1));
        // by less than this it is not told from the gains
        if let Some((nearest, _)) = nearest.filter(|(_, off)| *off < SAME_DAMPING) {
            odd.retain(|a| *a != nearest && !agree(*a, nearest));
        }
    }
    let told = |a: &usize| {
        let of: Vec<String> =
            all.iter().map(|r| format!("{:.3} s at {:.0}°", r.tau_s, r.angle_rad.to_degrees())).collect();
        (
            *a,
            format!(
                "the ring-downs decay in {}, which is not what the anisodamping makes of one damping",
                of.join(" and ")
            ),
        )
    };
    odd.iter().map(told).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ring-downs in these directions, deg, of 1/τ = 0.045 + 0.002 cos 2(θ − 27°), the damping of the last times `last`.
    fn ring_downs(directions: &[f64], last: f64) -> Vec<RingDown> {
        let damping = |deg: f64| 0.045 + 0.002 * (2.0 * (deg - 27.0).to_radians()).cos();
        let of = |(at, deg): (usize, &f64)| {
            let tau_s = (damping(*deg) * if at + 1 == directions.len() { last } else { 1.0 }).recip();
            RingDown {
                name: format!("{deg}"),
                angle_rad: deg.to_radians(),
                read_rad: deg.to_radians(),
                tau_s,
                tau_error_s: 1e-3 * tau_s,
                uneven: 0.0,
                drive: -0.045,
                drive_error: 1e-5,
                warmer_k: 0.0,
                decay: Vec::new(),
            }
        };
        directions.iter().enumerate().map(of).collect()
    }

    #[test]
    fn four_directions_of_one_resonator_agree_and_a_foreign_one_or_a_repeated_one_bears_nothing_out() {
        assert!(agree_by_themselves(&ring_downs(&[0.0, 45.0, 90.0, 135.0], 1.0)));
        assert!(!agree_by_themselves(&ring_downs(&[0.0, 45.0, 90.0, 135.0], 1.04)));
        assert!(!agree_by_themselves(&ring_downs(&[0.0, 45.0, 90.0], 1.0)));
        // any two dampings are those of some anisodamping
        assert!(!agree_by_themselves(&ring_downs(&[0.0, 180.0, 90.0, 90.0], 1.0)));
    }
}
