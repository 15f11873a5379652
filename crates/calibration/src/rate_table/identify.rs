//! A campaign of rotations and ring-downs walked through the rooms, in this order: data, estimation, selection, the last step,
//! and what is left.

use crate::data::clock::from_the_first_row;
use crate::diagnostics::drives::clipping;
use crate::diagnostics::scale_factor::scale_factor_of;
use crate::error::Refusal;
use crate::estimation::joint_fit::{Dataset, declared_hypothesis};
use crate::estimation::quantised_drives::with_quantised_drives;
use crate::estimation::unknown_drives::with_unknown_drives;
use crate::identified::{Identification, Options};
use crate::rate_table::errors::Errors;
use crate::rate_table::explained::{Explained, explained};
use crate::rate_table::foreign::left_of_each;
use crate::rate_table::report::{Found, Head};
use crate::recording::Campaign;
use crate::report::provenance;
use crate::report::recorded::run_report;
use crate::selection::last_step::last_step;
use crate::selection::not_found::with_what_was_not_found;
use crate::selection::one_law::one_law;
use crate::selection::refuted::{not_claimed_beside_another_damping, take_back_the_refuted};

/// Identifies the instrument.
///
/// # Errors
/// [`Refusal`] where the campaign is not what it says it is, or does not carry an answer.
pub(crate) fn identify(
    mut campaign: Campaign,
    options: &Options<'_>,
    with_plots: bool,
) -> Result<Identification, Refusal> {
    from_the_first_row(&mut campaign);
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
    let Explained { mut declared_fit, mut fitted, mut steps } = explained(&mut dataset, &paper, options)?;
    (options.progress)("weighing by what the noise remembers");
    let mut covariance = last_step(&mut dataset, &mut fitted, &mut steps)?;
    let left = left_of_each(&dataset, &fitted.fit);
    if take_back_the_refuted(&mut dataset, &mut fitted, &mut steps)? {
        (options.progress)("beginning anew without what the held-out run refutes");
        covariance = last_step(&mut dataset, &mut fitted, &mut steps)?;
        let rotations = dataset.tracks.len();
        let found = Explained { declared_fit, fitted, steps };
        // what the held-out run refutes may be what one rotation alone asked for
        Explained { declared_fit, fitted, steps } =
            found.without_a_foreign_rotation(&left, &mut dataset, &paper, options)?;
        if dataset.tracks.len() < rotations {
            covariance = last_step(&mut dataset, &mut fitted, &mut steps)?;
            if take_back_the_refuted(&mut dataset, &mut fitted, &mut steps)? {
                covariance = last_step(&mut dataset, &mut fitted, &mut steps)?;
            }
        }
    }
    let with_hidden = with_what_was_not_found(&mut dataset, &fitted, &covariance);
    let with_hidden = with_unknown_drives(&dataset, &fitted, with_hidden);
    let with_hidden = with_quantised_drives(&dataset, &fitted, with_hidden);
    let with_hidden = dataset.with_the_other_damping(&fitted.fit, with_hidden);
    not_claimed_beside_another_damping(&dataset, &mut fitted, &mut steps);
    let scale_factor = scale_factor_of(&mut dataset, &fitted);
    (options.progress)("looking for a law in what has no cause");
    let law = options.discover.then(|| one_law(&mut dataset, &fitted)).transpose()?.flatten();
    (options.progress)("measuring the held-out error");
    let errors = Errors::of(&dataset, &declared_fit, &fitted.fit);
    let steps = steps.into_iter().map(|step| step.read(&dataset)).collect();
    let warnings = std::mem::take(&mut dataset.warnings);
    let drives = dataset.clipping.and_then(|_| clipping(&dataset, &fitted.fit.hypothesis)?.report());
    let found =
        Found { dataset, declared_fit, fitted, covariance, with_hidden, steps, law, scale_factor, errors, drives };
    found.report(head, warnings, with_plots)
}
