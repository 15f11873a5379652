//! A campaign of rotations and ring-downs walked through the rooms, in this order: data, estimation, selection, the last step,
//! and what is left.

use crate::diagnostics::drives::clipping;
use crate::diagnostics::evaluate::evaluate;
use crate::diagnostics::scale_factor::scale_factor_of;
use crate::error::Refusal;
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::{Dataset, Fitted, declared_hypothesis, fit_with_ring_downs};
use crate::estimation::residuals::Window;
use crate::identified::{Identification, Options};
use crate::model::hypothesis::{Hypothesis, Origin};
use crate::rate_table::errors::Errors;
use crate::rate_table::report::{Found, Head};
use crate::recording::{Campaign, Role};
use crate::report::provenance;
use crate::report::recorded::run_report;
use crate::selection::discovery::discover;
use crate::selection::last_step::last_step;
use crate::selection::not_found::with_what_was_not_found;
use crate::selection::refuted::take_back_the_refuted;
use cvg_model::effects::EffectId;

/// Identifies the instrument.
///
/// # Errors
/// [`Refusal`] where the campaign is not what it says it is, or does not carry an answer.
pub(crate) fn identify(campaign: Campaign, options: &Options<'_>, with_plots: bool) -> Result<Identification, Refusal> {
    let head = Head {
        device: campaign.device.clone(),
        runs: campaign.runs.iter().map(run_report).collect(),
        inputs: provenance::sums(&provenance::files(&campaign)),
        amplitude_v: provenance::amplitudes(&campaign),
    };
    (options.progress)("preparing the runs");
    let mut dataset = Dataset::new(campaign)?;
    dataset.written.clone_from(&options.effects);
    (options.progress)("fitting the declared model");
    let paper = declared_hypothesis(&dataset.start);
    dataset.require_driven_rotations(&paper)?;
    let explained = |dataset: &mut Dataset, declared: &Hypothesis| {
        let declared = fit_with_ring_downs(dataset, declared)?;
        let declared_fit = declared.fit.clone();
        let (fitted, steps) =
            if options.discover { discover(dataset, declared, options.progress)? } else { (declared, Vec::new()) };
        Ok::<_, Refusal>((declared_fit, fitted, steps))
    };
    let (mut declared_fit, mut fitted, mut steps) = explained(&mut dataset, &paper)?;
    if dataset.gives_a_run_up() {
        (options.progress)("beginning anew with every run counted");
        dataset.counts_every_run = true;
        let anew = explained(&mut dataset, &paper)?;
        if left(&dataset, &anew.1) < left(&dataset, &fitted) {
            (declared_fit, fitted, steps) = anew;
        } else {
            dataset.counts_every_run = false;
            dataset.restore(&fitted);
        }
    }
    if dataset.without_foreign_ring_downs(&fitted.fit.hypothesis)? {
        (options.progress)("beginning anew without the ring-downs of another device");
        (declared_fit, fitted, steps) = explained(&mut dataset, &paper)?;
    }
    if dataset.without_divided_runs(&fitted.fit.hypothesis)? {
        (options.progress)("beginning anew without the runs whose amplitude is not theirs");
        (declared_fit, fitted, steps) = explained(&mut dataset, &paper)?;
    }
    if let Some(found) = options.discover.then(|| clipping(&dataset, &fitted.fit.hypothesis)).flatten() {
        (options.progress)("beginning anew with drives that clip");
        dataset.clipping = Some((found.inverse_level.value, found.inverse_level.half_width() / 1.96));
        // from where the fit without it ended: what drives can't put out moves it little
        let mut clipped = declared_fit.hypothesis.clone();
        let member = clipped.admit(EffectId::DriveSaturation, Origin::Declared);
        clipped.members[member].values[0] = found.inverse_level.value;
        let anew = explained(&mut dataset, &clipped)?;
        if left(&dataset, &anew.1) <= WORSE * left(&dataset, &fitted) {
            (declared_fit, fitted, steps) = anew;
        } else {
            // a level that the angle refutes is none
            dataset.clipping = None;
            dataset.restore(&fitted);
        }
    }
    (options.progress)("weighing by what the noise remembers");
    let mut covariance = last_step(&mut dataset, &mut fitted, &mut steps)?;
    if take_back_the_refuted(&mut dataset, &mut fitted, &mut steps)? {
        (options.progress)("beginning anew without what the held-out run refutes");
        covariance = last_step(&mut dataset, &mut fitted, &mut steps)?;
    }
    let with_hidden = with_what_was_not_found(&mut dataset, &fitted, &covariance);
    let scale_factor = scale_factor_of(&mut dataset, &fitted);
    (options.progress)("measuring the held-out error");
    let errors = Errors::of(&dataset, &declared_fit, &fitted.fit);
    let steps = steps.into_iter().map(|step| step.read(&dataset)).collect();
    let warnings = std::mem::take(&mut dataset.warnings);
    let drives = dataset.clipping.and_then(|_| clipping(&dataset, &fitted.fit.hypothesis)?.report());
    let found = Found { dataset, declared_fit, fitted, covariance, with_hidden, steps, scale_factor, errors, drives };
    found.report(head, warnings, with_plots)
}

/// A fit with drives that clip may leave this many times the mean square of the fitted runs that the one without leaves: engineering choice.
const WORSE: f64 = 1.1;

/// Mean square of what a fit leaves of the fitted runs.
fn left(dataset: &Dataset, fitted: &Fitted) -> f64 {
    let Fit { hypothesis, starts, .. } = &fitted.fit;
    evaluate(&dataset.tracks, hypothesis, starts, Role::Fit, Window::Whole, None).mean_square()
}
