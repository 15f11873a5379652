//! What decays told, in the words of the library of effects.

use cvg_model::effects::EffectId;

use super::fit::Fit;
use super::model::{OFFSETS, Term};
use super::report::{Finding, estimate, shown, whole, whole_raw};
use super::runs::DecayRun;
use super::selection::{Added, BELIEVED, is_declared, one_rate};
use crate::model::hypothesis::Origin;
use crate::numerics::angles::wrapped;
use crate::report::named::{DAMPING_NONLINEAR, SPRING_ISOTROPIC};
use crate::report::polar::polar;
use crate::report::{BeforeAfter, EffectReport, Estimate, ParameterReport, Rival};

/// What the offsets of x_c, x_s, y_c and y_s are called: those in phase as the library has them.
const OFFSET_NAMES: [&str; 4] = ["offset_x", "offset_x_quadrature", "offset_y", "offset_y_quadrature"];

/// The effect that a term stands for.
pub(crate) fn name(term: Term) -> &'static str {
    match term {
        Term::Damping => "damping",
        Term::DampingAlong | Term::DampingAcross => EffectId::Anisodamping.description().id,
        Term::SplitAlong | Term::SplitAcross => EffectId::Anisoelasticity.description().id,
        Term::AngularGain | Term::Precession => "precession",
        Term::Spring => SPRING_ISOTROPIC.id,
        Term::DampingGrowth => DAMPING_NONLINEAR.id,
        Term::GainRatio => EffectId::DetectionGainMismatch.description().id,
        Term::Skew => EffectId::DetectionSkew.description().id,
        Term::Phase => EffectId::DetectionPhase.description().id,
        Term::ReadoutCubic => EffectId::DetectionCubic.description().id,
        Term::OffsetXc | Term::OffsetXs | Term::OffsetYc | Term::OffsetYs => EffectId::DetectionOffset.description().id,
        Term::SpringFourCos | Term::SpringFourSin => EffectId::SpringCubic.description().id,
    }
}

/// Those that were tried beside a term, with what they gained less.
pub(crate) fn rivals(added: &Added) -> Vec<Rival> {
    added.rivals.iter().map(|r| Rival { id: name(r.term).into(), beaten_by: added.gain - r.gain }).collect()
}

/// All effects of a finding.
pub(crate) fn effects(finding: &Finding, runs: &[DecayRun]) -> Vec<EffectReport> {
    let (fit, model) = (&finding.fit, &finding.fit.model);
    let mut out = Vec::new();
    if model.has(Term::DampingAlong) {
        out.push(anisotropy(fit, EffectId::Anisodamping, [Term::DampingAlong, Term::DampingAcross]));
    }
    if model.has(Term::SplitAlong) {
        out.push(anisotropy(fit, EffectId::Anisoelasticity, [Term::SplitAlong, Term::SplitAcross]));
    } else {
        out.push(split_across(fit));
    }
    if model.has(Term::GainRatio) {
        let e = estimate(fit, Term::GainRatio);
        let ratio = Estimate { value: 1.0 + e.value, ci95: e.ci95.map(|end| 1.0 + end) };
        let parameter = &EffectId::DetectionGainMismatch.description().parameters[0];
        out.push(plain(finding, Term::GainRatio, vec![entry(parameter.name, parameter.unit, ratio)], runs));
    }
    let alone = [
        (Term::Skew, EffectId::DetectionSkew),
        (Term::Phase, EffectId::DetectionPhase),
        (Term::ReadoutCubic, EffectId::DetectionCubic),
    ];
    for (term, id) in alone {
        if model.has(term) {
            let parameter = &id.description().parameters[0];
            let value = entry(parameter.name, parameter.unit, estimate(fit, term));
            out.push(plain(finding, term, vec![value], runs));
        }
    }
    if model.has(OFFSETS[0]) {
        let named = OFFSETS.iter().zip(OFFSET_NAMES);
        let parameters = named.map(|(term, name)| entry(name, "V", estimate(fit, *term))).collect();
        out.push(plain(finding, OFFSETS[0], parameters, runs));
    }
    if model.has(Term::SpringFourCos) {
        let parameters = polar_entries(fit, EffectId::SpringCubic, [Term::SpringFourCos, Term::SpringFourSin], 0.0);
        out.push(plain(finding, Term::SpringFourCos, parameters, runs));
    }
    if model.has(Term::Spring) {
        let mut parameters = vec![entry("c", "rad/s/V^2", estimate(fit, Term::Spring))];
        if let Some(p) = finding.phase.as_ref().filter(|p| p.gain > BELIEVED) {
            parameters.push(entry("frequency_per_energy", "rad/s/V^2", Estimate::new(p.per_energy.0, p.per_energy.1)));
        }
        out.push(plain(finding, Term::Spring, parameters, runs));
    }
    if model.has(Term::DampingGrowth) {
        let value = entry("gamma", "1/s/V^2", estimate(fit, Term::DampingGrowth));
        out.push(plain(finding, Term::DampingGrowth, vec![value], runs));
    }
    out
}

fn entry(name: &str, unit: &str, e: Estimate) -> ParameterReport {
    ParameterReport { name: name.into(), unit: unit.into(), value: e.value, ci95: Some(e.ci95) }
}

/// Both components of an effect, as magnitude and angle, for components along an axis at `axis_rad`.
fn polar_entries(fit: &Fit, id: EffectId, [along, across]: [Term; 2], axis_rad: f64) -> Vec<ParameterReport> {
    let at = |term: Term| fit.model.terms.iter().position(|t| *t == term);
    let (a, b) = (fit.model.value(along), fit.model.value(across));
    let (va, vb, vab) = match (at(along), at(across)) {
        (Some(i), Some(j)) => (fit.covariance[(i, i)], fit.covariance[(j, j)], fit.covariance[(i, j)]),
        _ => (0.0, 0.0, 0.0),
    };
    let (magnitude, unit, angle, division) = shown(id).unwrap_or(("magnitude", "1/s", "axis", 2.0));
    let (size, axis) = polar([a, b], (va, vb, vab), division);
    let turned = wrapped(axis.value + axis_rad.to_degrees(), 360.0 / division) - axis.value;
    vec![entry(magnitude, unit, size), entry(angle, "deg", axis.turned(turned))]
}

/// Both components of an anisotropy, as magnitude and axis.
fn anisotropy(fit: &Fit, id: EffectId, terms: [Term; 2]) -> EffectReport {
    EffectReport {
        id: id.description().id.into(),
        origin: Origin::Declared,
        parameters: polar_entries(fit, id, terms, fit.model.axis_rad),
        heldout_rms_deg: None,
        evidence: "declared; from the equation of motion, fitted to E, Q and θ of all decays at once".into(),
        confounded_with: Vec::new(),
        separated_by: None,
    }
}

/// The one component of a split that a pattern near one angle shows.
fn split_across(fit: &Fit) -> EffectReport {
    EffectReport {
        id: EffectId::Anisoelasticity.description().id.into(),
        origin: Origin::Declared,
        parameters: vec![entry("anisoelasticity_across", "rad/s", estimate(fit, Term::SplitAcross))],
        heldout_rms_deg: None,
        evidence: format!(
            "declared; Δω sin 2(θ_ω − θ) at the pattern's mean angle of {:.2}°, from the growth of quadrature: the other \
             component does not show there",
            fit.model.axis_rad.to_degrees()
        ),
        confounded_with: Vec::new(),
        separated_by: Some("decays at several starting angles".into()),
    }
}

/// An effect that was added because the likelihood pays for it.
fn plain(finding: &Finding, term: Term, parameters: Vec<ParameterReport>, runs: &[DecayRun]) -> EffectReport {
    let added = finding.chosen.added.iter().find(|a| a.term == term);
    let errors = &finding.errors;
    let rms = |e: f64| format!("{e:.4}°");
    let beaten: Vec<String> =
        added.map(rivals).unwrap_or_default().iter().map(|r| format!("{} by {:.0}", r.id, r.beaten_by)).collect();
    let scaling = match term {
        Term::Spring => "precession in proportion to quadrature as the decays go down",
        Term::DampingGrowth => "damping in proportion to energy as the decays go down",
        Term::SpringFourCos => "precession that follows four times the pattern's angle, of any amplitude",
        Term::ReadoutCubic => "(E, R, S, Q) of all angles as this readout maps them while the decays go down",
        Term::OffsetXc => "what stays in the channels while the phase and the pattern turn and the decays go down",
        _ => "(E, R, S, Q) of all angles as this readout maps them",
    };
    let evidence = format!(
        "{scaling}: gains {:.0} in 2 ln likelihood after its price{}{}; of the angle of whole decays {} are left with it, {} \
         with the paper's model, {} by a constant rate",
        added.map_or(0.0, |a| a.gain),
        if beaten.is_empty() { "" } else { ", beats " },
        beaten.join(", "),
        rms(whole(runs, &finding.fit).size().rms_deg),
        rms(whole(runs, &finding.declared).size().rms_deg),
        rms(whole_raw(runs, &finding.fit).size().rms_deg),
    );
    let confounded: Vec<String> =
        finding.instead.iter().filter(|other| other.of == term).map(|other| name(other.by).to_owned()).collect();
    let separated_by = if term.is_readout() && one_rate(runs) {
        "decays at another rate"
    } else {
        "decays at several starting angles, and of several amplitudes"
    };
    EffectReport {
        id: name(term).into(),
        origin: match term {
            Term::DampingGrowth => Origin::Empirical,
            t if is_declared(t) => Origin::Declared,
            _ => Origin::Discovered,
        },
        parameters,
        heldout_rms_deg: (!is_declared(term))
            .then(|| BeforeAfter { before: errors.declared.size().rms_deg, after: errors.after.size().rms_deg }),
        evidence,
        separated_by: (!confounded.is_empty()).then(|| separated_by.to_owned()),
        confounded_with: confounded,
    }
}
