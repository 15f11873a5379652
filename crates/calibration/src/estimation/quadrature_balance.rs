//! What the quadrature loop had to cancel: the split of the frequencies without the angle, a second witness of it.

use cvg_model::effects::EffectId;
use nalgebra::{Matrix2, Vector2};

use crate::estimation::actuation::DriveGains;
use crate::estimation::fit::{BEYOND_BELIEF, Effort, Fit};
use crate::estimation::joint_fit::{BALANCE_SHARE, Dataset, fitted_tracks};
use crate::estimation::propagation::{Stepping, propagate};
use crate::model::hypothesis::Hypothesis;
use crate::model::unknowns::Unknowns;
use crate::recording::Role;

/// How far the quadrature balance is trusted where ring-downs tell the force scale, at rest and from a precession of 1 rad/s on: what the
/// model still lacks was seen to move it by 1 to 3 %, and at speed the angle tells a split by itself.
const QUADRATURE_SHARE: [f64; 2] = [0.02, 0.05];
/// A split that the balance cannot rule out, rad/s: at rest, per rad/s of precession, which a phase of the channels makes a quadrature of,
/// and at the most.
const LEAST_ANISOELASTICITY: f64 = 3e-3;
const PER_PRECESSION: f64 = 3e-3;
const MOST_ANISOELASTICITY: f64 = 0.02;

impl Dataset {
    /// Δω from the quadrature balance, q̇ = G v_qc + ½a(Δω sin2θ_ω cos2θ − Δω cos2θ_ω sin2θ), at the hypothesis' force
    /// scale: what the loop had to cancel. A belief for the fit of the angle, where Δω shows only through the
    /// quadrature that is left.
    pub(super) fn balance_quadrature(&mut self, hypothesis: &Hypothesis, drive: Option<&DriveGains>) {
        self.quadrature_balance = None;
        if hypothesis.force_scale == 0.0 || !self.tracks.iter().all(|p| p.track.records_the_loops()) {
            return;
        }
        let slope =
            hypothesis.member(EffectId::AnisoelasticityTemperature).map_or([0.0; 2], |m| [m.values[0], m.values[1]]);
        let none = Unknowns::new(hypothesis, Vec::new());
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for p in &self.tracks {
            for (segment, start) in p.track.segments.iter().zip(&p.starts).filter(|(s, _)| s.role == Role::Fit) {
                let mut last: Option<(f64, [f64; 3])> = None;
                let (mut sums, mut rows) = ([0.0; 3], Vec::new());
                let stepping = Stepping::without(p.limit.angle);
                propagate(&p.track, segment, hypothesis, &none, *start, stepping, |row| {
                    if row.angle.abs() > stepping.spike {
                        return;
                    }
                    let pendulum = row.vibration.pendulum();
                    let line = pendulum.r.hypot(pendulum.s);
                    let Some(v) = p.track.commands(row.index, 1).filter(|_| line > 0.0) else { return };
                    let (sin, cos) = (pendulum.s / line, pendulum.r / line);
                    let command = hypothesis.force_scale * v.now.v_qc / pendulum.e.sqrt();
                    let warmer_k = p.track.warmer_k(row.index);
                    let followed = 0.5 * warmer_k * (slope[1] * cos - slope[0] * sin);
                    let rates = [command + followed, -0.5 * sin, 0.5 * cos];
                    let t = p.track.t_s[row.index];
                    if let Some((t0, before)) = last {
                        for ((sum, a), b) in sums.iter_mut().zip(before).zip(rates) {
                            *sum += 0.5 * (t - t0) * (a + b);
                        }
                    }
                    last = Some((t, rates));
                    rows.push([0.5 * pendulum.q / pendulum.e - sums[0], sums[1], sums[2]]);
                });
                let n = rows.len().max(1) as f64;
                let mean = rows.iter().fold([0.0; 3], |m, r| std::array::from_fn(|i| m[i] + r[i] / n));
                for r in &rows {
                    let x = Vector2::new(r[1] - mean[1], r[2] - mean[2]);
                    normal += x * x.transpose();
                    right += x * (r[0] - mean[0]);
                }
            }
        }
        if let Some(w) = normal.try_inverse().map(|i| i * right) {
            let fastest = fitted_tracks(&self.tracks).map(|t| hypothesis.precession(t.mean_speed()).abs());
            let fastest = fastest.fold(0.0, f64::max);
            let [at_rest, at_speed] = QUADRATURE_SHARE;
            let trusted = at_rest + (at_speed - at_rest) * fastest.min(1.0);
            let by_the_step = self.told_with_the_step().map(|(scale, deviation)| trusted.hypot(deviation / scale));
            let share = drive.map(|d| trusted.hypot(d.mean_error)).or(by_the_step).unwrap_or(BALANCE_SHARE);
            let unseen = (LEAST_ANISOELASTICITY + PER_PRECESSION * fastest).min(MOST_ANISOELASTICITY);
            let deviation = share * w.norm() + unseen;
            self.quadrature_balance = Some(([w[0], w[1]], deviation));
        }
    }

    /// A split that is not yet fitted begins where the quadrature balance sees it: from zero, a large one under a fast
    /// rotation lies beyond other minima.
    pub(super) fn begin_with_the_balance(&self, hypothesis: &mut Hypothesis) {
        let (Some((split, _)), Some(member)) =
            (self.quadrature_balance, hypothesis.position(EffectId::Anisoelasticity))
        else {
            return;
        };
        if self.holds(EffectId::Anisoelasticity)
            || hypothesis.members[member].values == EffectId::Anisoelasticity.neutral()
        {
            hypothesis.members[member].values[..2].copy_from_slice(&split);
        }
    }

    /// Whether a fit took Δω further from what the quadrature loop had to cancel than is believed of either. With little
    /// quadrature left, as at low rates, the angle shows Δω by its square alone, in 4θ and in k, where readout that is not
    /// linear shows too.
    pub(super) fn contradicts_the_balance(&self, fitted: &Hypothesis) -> bool {
        let (Some((split, deviation)), Some(member)) =
            (self.quadrature_balance, fitted.position(EffectId::Anisoelasticity))
        else {
            return false;
        };
        let values = &fitted.members[member].values;
        split.iter().zip(values).any(|(told, value)| (value - told).abs() > BEYOND_BELIEF * deviation)
    }

    /// Fits with Δω held where the quadrature balance has it, and then free from there, which is kept where the fit stays with it.
    pub(super) fn with_the_split_held(&mut self, hypothesis: &Hypothesis, drive: Option<&DriveGains>) -> Fit {
        let mut hypothesis = hypothesis.clone();
        self.held.push(EffectId::Anisoelasticity);
        self.begin_with_the_balance(&mut hypothesis);
        let held = self.fitted_anew(&hypothesis, drive);
        let weighting = self.weighting();
        self.held.clear();
        let (freed, _) = self.fitted(&held.hypothesis, drive, Effort::FULL);
        if self.contradicts_the_balance(&freed.hypothesis) {
            self.weigh_by(&weighting);
            return held;
        }
        freed
    }
}
