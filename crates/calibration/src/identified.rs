//! What an identification is asked, and what it gives.

use cvg_model::effects::EffectId;

use crate::angle_sensor::curve::Curve;
use crate::diagnostics::plots::PlotData;
use crate::estimation::actuation::RingDown;
use crate::model::hypothesis::Hypothesis;
use crate::report::Report;
use crate::report::calibration::Calibration;
use crate::selection::step::Step;

/// How an identification is run.
pub struct Options<'a> {
    /// look for undeclared effects
    pub discover: bool,
    /// effects written down as text ([`crate::EffectText::effect`]), which compete with the library's
    pub effects: Vec<EffectId>,
    /// told what is going on
    pub progress: &'a dyn Fn(&str),
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self { discover: true, effects: Vec::new(), progress: &|_| {} }
    }
}

/// An identified instrument.
#[derive(Debug, Clone)]
pub struct Identification {
    /// the facts
    pub report: Report,
    /// what to compensate with
    pub calibration: Calibration,
    /// curves to look at
    pub figures: Figures,
    /// the steps of discovery
    pub steps: Vec<Step>,
    /// what a person wants to see besides, where it was asked for
    pub plots: Option<PlotData>,
}

/// Curves for a report, thinned to what a figure can show.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    /// held-out angle error against the pattern angle
    pub bias: Vec<BiasCurve>,
    /// ring-downs: name, angle in deg, amplitude over time
    pub ring_downs: Vec<RingDown>,
    /// of an angle sensor, what its two channels draw
    pub channels: Option<Curve>,
}

/// Angle error of one held-out stretch.
#[derive(Debug, Clone, Default)]
pub struct BiasCurve {
    /// run
    pub name: String,
    /// pattern angle within its period, deg
    pub pattern_deg: Vec<f64>,
    /// raw error, deg; empty where the raw angle does not turn
    pub raw_deg: Vec<f64>,
    /// after the declared model, deg
    pub declared_deg: Vec<f64>,
    /// after all, deg
    pub discovered_deg: Vec<f64>,
}

/// Says that effects as text had no part in an answer, and why.
pub(crate) fn not_tried(effects: &[EffectId], why: &str) -> Option<String> {
    let ids: Vec<&str> = effects.iter().map(|e| e.description().id).collect();
    (!ids.is_empty()).then(|| format!("{} had no part in this: {why}", ids.join(", ")))
}

/// What to say of effects as text that competed and are not in the answer.
pub(crate) fn not_taken(competing: &[EffectId], hypothesis: &Hypothesis) -> Option<String> {
    let lost = competing.iter().filter(|id| hypothesis.member(**id).is_none());
    let ids: Vec<&str> = lost.map(|e| e.description().id).collect();
    (!ids.is_empty()).then(|| {
        format!(
            "{} competed and is not in the answer: these recordings do not ask for it, or another effect explains them as well",
            ids.join(", ")
        )
    })
}
