//! What the energy loop had to put in, direction by direction: the anisodamping without the angle, a second witness of it.

use std::f64::consts::PI;

use cvg_model::effects::EffectId;
use nalgebra::{DMatrix, DVector};

use crate::data::track::Track;
use crate::estimation::amplitude_equation::stretches;
use crate::estimation::fit::{BEYOND_BELIEF, Fit, Prepared, Prior, scaled_inverse};
use crate::estimation::joint_fit::{Dataset, Fitted};
use crate::model::hypothesis::{Hypothesis, Origin, Unknown};
use crate::model::unknowns::Unknowns;
use crate::recording::Instrument;

/// An anisodamping that the energy loop cannot rule out, as a share of the damping that it replaces: gains and axes of the drives
/// that are off by as much.
const LEAST_SHARE: f64 = 1e-3;
/// The readout at 2θ.
const READOUT: [EffectId; 2] = [EffectId::DetectionGainMismatch, EffectId::DetectionSkew];
/// Anisodampings that differ by this share of the larger one are two: what the balance lacks of a readout at one amplitude makes a tenth.
const ANOTHER: f64 = 0.5;
/// An interval that covers what another witness says goes so many times as far as that: engineering choice.
const COVERED: f64 = 1.2;
/// Stretches that tell by their scatter how far the balance is off.
const FEWEST_STRETCHES: usize = 8;

impl Dataset {
    /// Δ(1/τ) from the energy balance, d ln a/dt = −G v_as/a − 1/τ − ½Δ(1/τ) cos 2(θ − θ_τ), along both axes, behind the readout of a
    /// fit; its uncertainty from what half turns of the pattern tell one by one (jackknife). `None` where the energy command or the
    /// amplitude was not recorded.
    pub(crate) fn balance_damping(&mut self, fitted: &Hypothesis) {
        self.damping_balance = None;
        let told = |p: &Prepared| p.track.has_commands() && p.track.has_amplitude();
        if self.instrument == Instrument::Sensor || !self.tracks.iter().all(told) {
            return;
        }
        // what is left of the readout at 2θ is another share of the balance at every rate, and is not the angle's to say
        let mut seen = fitted.clone();
        for id in READOUT {
            if seen.position(id).is_none() {
                seen.admit(id, Origin::Declared);
            }
        }
        let [Some(ratio), Some(skew)] = READOUT.map(|id| seen.position(id).map(|m| Unknown::Effect(m, 0))) else {
            return;
        };
        let Some(member) = seen.position(EffectId::Anisodamping) else { return };
        let own = [0, 1].map(|p| Unknown::Effect(member, p));
        let all = vec![Unknown::Damping, own[0], own[1], ratio, skew];
        let unknowns = Unknowns::new(&seen, all);
        let starts: Vec<_> = self.tracks.iter().map(|p| p.starts.clone()).collect();
        let half_turn_s = |track: &Track| PI / fitted.precession(track.mean_speed()).abs();
        let all = stretches(&self.tracks, &seen, &unknowns, &starts, half_turn_s, |_| ());
        let whole = all.iter().map(|s| &s.squares).sum::<DMatrix<f64>>();
        let without = |left_out: &DMatrix<f64>| closing(&(&whole - left_out)).map(|x| [x[1], x[2]]);
        let n = all.len();
        let (Some(step), true) = (closing(&whole), n >= FEWEST_STRETCHES) else { return };
        let Some(others) = all.iter().map(|s| without(&s.squares)).collect::<Option<Vec<_>>>() else { return };
        let apart = |p: usize| others.iter().map(|o| (o[p] - step[1 + p]).powi(2)).sum::<f64>();
        let variance = (n - 1) as f64 / n as f64 * apart(0).max(apart(1));
        let deviation = variance.sqrt().hypot(LEAST_SHARE * fitted.damping_per_s.abs());
        let values = &seen.members[member].values;
        self.damping_balance = Some(([values[0] + step[1], values[1] + step[2]], deviation));
    }

    /// Whether a fit took the anisodamping further from what the energy loop had to put in than is believed of either: to the
    /// angle it is what any precession at 2θ is that goes against the rate.
    pub(crate) fn contradicts_the_damping(&self, fitted: &Hypothesis) -> bool {
        let (Some((told, deviation)), Some(member)) = (self.damping_balance, fitted.position(EffectId::Anisodamping))
        else {
            return false;
        };
        let values = &fitted.members[member].values;
        told.iter().zip(values).any(|(told, value)| (value - told).abs() > BEYOND_BELIEF * deviation)
    }

    /// What the energy loop tells of the anisodamping of a hypothesis.
    pub(crate) fn by_the_energy_loop(&self, hypothesis: &Hypothesis) -> Vec<Prior> {
        let told = self.damping_balance.zip(hypothesis.position(EffectId::Anisodamping));
        let prior = |((told, deviation), member): (([f64; 2], f64), usize), p: usize| Prior {
            unknown: Unknown::Effect(member, p),
            mean: told[p],
            deviation,
            considered: false,
        };
        told.map_or_else(Vec::new, |told| vec![prior(told, 0), prior(told, 1)])
    }

    /// Whether the two contradict each other by so much that nothing which the balance lacks makes it.
    pub(crate) fn is_another_damping(&self, fitted: &Hypothesis) -> bool {
        let (Some((told, _)), Some(member)) = (self.damping_balance, fitted.member(EffectId::Anisodamping)) else {
            return false;
        };
        let [cos, sin] = [member.values[0], member.values[1]];
        let apart = (cos - told[0]).hypot(sin - told[1]);
        self.contradicts_the_damping(fitted) && apart > ANOTHER * cos.hypot(sin).max(told[0].hypot(told[1]))
    }

    /// The covariance of a fit whose anisodamping is also what the energy loop had to put in, where the two contradict each other: something
    /// that goes against the rate turns the pattern at 2θ, as a spring or a drive that no effect describes.
    pub(crate) fn with_the_other_damping(&self, fit: &Fit, mut covariance: DMatrix<f64>) -> DMatrix<f64> {
        let told = self.by_the_energy_loop(&fit.hypothesis);
        if !self.is_another_damping(&fit.hypothesis) {
            return covariance;
        }
        let off =
            |unknown: Unknown| told.iter().find(|p| p.unknown == unknown).map(|p| p.mean - fit.hypothesis.get(unknown));
        let off: Vec<f64> = fit.unknowns.iter().map(|u| off(*u).unwrap_or(0.0)).collect();
        let off = DVector::from_vec(off) * (COVERED / 1.96);
        covariance += &off * off.transpose();
        covariance
    }

    /// What has to be said of an anisodamping that the energy loop contradicts.
    pub(crate) fn said_of_the_other_damping(&self, hypothesis: &Hypothesis) -> Option<String> {
        let (told, _) = self.damping_balance.filter(|_| self.is_another_damping(hypothesis))?;
        let values = hypothesis.member(EffectId::Anisodamping)?.values;
        Some(format!(
            "the angle takes an anisodamping of {:.2e} 1/s, and the energy command has to replace one of {:.2e} 1/s: something else at 2θ turns the \
             pattern against the rate, a spring or a drive that no effect describes; its interval covers both, and what is of the same law as it \
             is not claimed",
            values[0].hypot(values[1]),
            told[0].hypot(told[1])
        ))
    }

    /// A fit done again with the anisodamping where the energy loop has it; `None` where that does not contradict the fit.
    pub(crate) fn with_the_anisodamping_held(&mut self, fitted: &Fitted) -> Option<Fitted> {
        let mut hypothesis = fitted.fit.hypothesis.clone();
        self.balance_damping(&hypothesis);
        if !self.contradicts_the_damping(&hypothesis) {
            return None;
        }
        let ((told, _), member) = (self.damping_balance?, hypothesis.position(EffectId::Anisodamping)?);
        hypothesis.members[member].values[..2].copy_from_slice(&told);
        self.held.push(EffectId::Anisodamping);
        let fit = self.fitted_anew(&hypothesis, fitted.drive.as_ref());
        Some(Fitted { fit, ring_downs: fitted.ring_downs.clone(), drive: fitted.drive, weighting: self.weighting() })
    }
}

/// The step of the unknowns that leaves least of ln a, from squares of which the last column is that.
fn closing(squares: &DMatrix<f64>) -> Option<DVector<f64>> {
    let n = squares.nrows() - 1;
    let inverse = scaled_inverse(&squares.view((0, 0), (n, n)).into_owned(), 0.0)?;
    Some(inverse * squares.column(n).rows(0, n))
}
