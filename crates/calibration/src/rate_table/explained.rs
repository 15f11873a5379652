//! A campaign explained, from its declared model on, and begun anew where what came of that says that something else is wrong with it.

use cvg_model::effects::EffectId;

use crate::diagnostics::drives::{Clipping, clipping};
use crate::diagnostics::evaluate::evaluate;
use crate::error::Refusal;
use crate::estimation::fit::{Fit, Prior};
use crate::estimation::joint_fit::{Dataset, Fitted, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::identified::Options;
use crate::model::hypothesis::{Hypothesis, Origin, Unknown};
use crate::rate_table::foreign::left_of_each;
use crate::recording::Role;
use crate::selection::discovery::discover;
use crate::selection::step::Accepted;

/// A fit with drives that clip, or with what was discovered, may leave this many times the mean square of the fitted runs that the one
/// without leaves: engineering choice.
const WORSE: f64 = 1.1;
/// One with every run counted leaves this share at most, half the rms: engineering choice.
const FAR_LESS: f64 = 0.25;

/// What explains a campaign.
pub(super) struct Explained {
    /// the declared model alone
    pub(super) declared_fit: Fit,
    /// with what was discovered
    pub(super) fitted: Fitted,
    pub(super) steps: Vec<Accepted>,
}

/// Explains a campaign from `paper`, the declared model, on.
///
/// # Errors
/// As for the fit.
pub(super) fn explained(
    dataset: &mut Dataset,
    paper: &Hypothesis,
    options: &Options<'_>,
) -> Result<Explained, Refusal> {
    let mut found = Explained::from(dataset, paper, options)?;
    if dataset.gives_a_run_up() {
        found = found.with_every_run_counted(dataset, paper, options)?;
    }
    let left = left_of_each(dataset, &found.fitted.fit);
    found = found.without_a_foreign_rotation(&left, dataset, paper, options)?;
    if dataset.without_foreign_ring_downs(&found.fitted.fit)? {
        (options.progress)("beginning anew without the ring-downs of another device");
        found = Explained::from(dataset, paper, options)?;
    }
    if dataset.without_divided_runs(&found.fitted.fit.hypothesis)? {
        (options.progress)("beginning anew without the runs whose amplitude is not theirs");
        found = Explained::from(dataset, paper, options)?;
    }
    match options.discover.then(|| clipping(dataset, &found.fitted.fit.hypothesis)).flatten() {
        Some(level) => found.with_drives_that_clip(dataset, &level, options),
        None => Ok(found),
    }
}

impl Explained {
    /// With what is discovered, unless fits on the way to it ended where more is left than without.
    pub(super) fn from(dataset: &mut Dataset, declared: &Hypothesis, options: &Options<'_>) -> Result<Self, Refusal> {
        let fitted = fit_with_ring_downs(dataset, declared)?;
        let declared = Self { declared_fit: fitted.fit.clone(), fitted, steps: Vec::new() };
        if !options.discover {
            return Ok(declared);
        }
        let (fitted, steps) = discover(dataset, declared.fitted.clone(), options.progress)?;
        let found = Self { declared_fit: declared.declared_fit.clone(), fitted, steps };
        if found.left(dataset) <= WORSE * declared.left(dataset) {
            return Ok(found);
        }
        dataset.restore(&declared.fitted);
        Ok(declared)
    }

    /// Begun anew where a run was given up for the sake of the others; this, where that leaves more.
    fn with_every_run_counted(
        self,
        dataset: &mut Dataset,
        paper: &Hypothesis,
        options: &Options<'_>,
    ) -> Result<Self, Refusal> {
        (options.progress)("beginning anew with every run counted");
        dataset.counts_every_run = true;
        let anew = Self::from(dataset, paper, options)?;
        if anew.left(dataset) < FAR_LESS * self.left(dataset) {
            return Ok(anew);
        }
        dataset.counts_every_run = false;
        dataset.restore(&self.fitted);
        Ok(self)
    }

    /// Begun anew with the level at which the drives clip; this, where the runs refute it: they leave more with it, or move it to where
    /// nobody believes it.
    fn with_drives_that_clip(
        self,
        dataset: &mut Dataset,
        level: &Clipping,
        options: &Options<'_>,
    ) -> Result<Self, Refusal> {
        (options.progress)("beginning anew with drives that clip");
        dataset.clipping = Some((level.inverse_level.value, level.inverse_level.half_width() / 1.96));
        // from where the fit without it ended: what drives can't put out moves it little
        let mut clipped = self.declared_fit.hypothesis.clone();
        let member = clipped.admit(EffectId::DriveSaturation, Origin::Declared);
        clipped.members[member].values[0] = level.inverse_level.value;
        let anew = Self::from(dataset, &clipped, options)?;
        let hypothesis = &anew.fitted.fit.hypothesis;
        let is_the_level = |p: &Prior| matches!(p.unknown, Unknown::Effect(at, _) if hypothesis.members[at].id == EffectId::DriveSaturation);
        let priors = dataset.priors(hypothesis, anew.fitted.drive.as_ref());
        let moved_away = priors.iter().any(|p| is_the_level(p) && p.is_exceeded(hypothesis));
        if !moved_away && anew.left(dataset) <= WORSE * self.left(dataset) {
            return Ok(anew);
        }
        dataset.clipping = None;
        dataset.restore(&self.fitted);
        Ok(self)
    }

    /// Mean square of what is left of the fitted runs, rad².
    fn left(&self, dataset: &Dataset) -> f64 {
        let Fit { hypothesis, starts, .. } = &self.fitted.fit;
        evaluate(&dataset.tracks, hypothesis, starts, Role::Fit, Window::Whole, None).mean_square()
    }
}
