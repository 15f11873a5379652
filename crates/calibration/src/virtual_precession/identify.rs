//! The main job for virtual precession and unknown rotation: runs made ready, the filter walked over the fitted part until
//! nothing moves, the held-out part read once, and the values that leave the program from all that may be fitted.

use cvg_calibrator::Settings;
use cvg_calibrator::replay::Learning;

use super::passes::{CHANNELS, Left, WANTED, learn, rms, walk, white};
use super::report::report;
use super::runs::{VirtualRun, all, parts};
use crate::error::Refusal;
use crate::identified::Options;
use crate::recording::{Campaign, RunKind};
use crate::report::survey::Innovation;
use crate::survey::Surveyed;

/// Length of a cycle of the filter, s.
const CYCLE_S: f64 = 0.04;
/// Runs whose amplitude or interval differ by more than this share are not walked together.
const ALIKE: f64 = 0.05;
/// What is left of held-out rows, rad, where the equation of motion follows them.
const FOLLOWED_RAD: f64 = 2e-3;
/// The pattern follows the commanded precession by about this much: drives are not worse than that.
const DRIVEN: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// Rows as often as this are control steps, where the campaign does not say, s.
pub(crate) const PACE_S: f64 = 1.001e-3;
/// 1/τ before anything is known, 1/s: within what is expected of devices.
const DAMPING_PER_S: f64 = 0.05;

/// A campaign of virtual precession and unknown rotation.
pub(crate) fn serves(campaign: &Campaign) -> bool {
    !campaign.runs.is_empty() && campaign.runs.iter().all(|r| r.kind == RunKind::Virtual)
}

/// Identifies a campaign that [`serves`].
///
/// # Errors
/// [`Refusal`] where the campaign is not what it says it is, or does not carry an answer.
pub(crate) fn identify(campaign: &Campaign, options: &Options<'_>) -> Result<Surveyed, Refusal> {
    let drive_per_s_v = campaign.drive_per_s_v.unwrap_or(1.0);
    (options.progress)("preparing the runs");
    let runs: Vec<VirtualRun> =
        campaign.runs.iter().map(|r| VirtualRun::new(r, drive_per_s_v)).collect::<Result<_, _>>()?;
    let settings = settings(&runs, drive_per_s_v)?;
    for (run, of) in runs.iter().zip(&campaign.runs) {
        if let Some(share) = run.share_of_the_command().filter(|share| !DRIVEN.contains(share)) {
            return Err(Refusal::no_answer(
                &of.file.display().to_string(),
                format!("the pattern precesses by {share:.2} of what virtual_dps says"),
                "X and Y in their places, and virtual_dps in deg/s of the pattern, positive from X to Y",
            ));
        }
    }
    let hold_s = hold_s(campaign.control_hz, settings.control_s);
    let (fitted, held) = parts(&runs);
    (options.progress)("learning from the fitted part");
    let mut learned = learn(&settings, hold_s, &fitted)?;
    (options.progress)("predicting the held-out part");
    let heldout = innovations(&walk(&mut learned, &held, 4, Learning::Off));
    if let Some(i) = heldout.iter().find(|i| i.rms_rad.is_nan() || i.rms_rad > FOLLOWED_RAD) {
        return Err(Refusal::no_answer(
            &campaign.device,
            format!(
                "the equation of motion does not follow these runs: {:.1e} of the {} are left",
                i.rms_rad, i.channel
            ),
            WANTED,
        ));
    }
    (options.progress)("learning from all of it");
    let learned = learn(&settings, hold_s, &all(&runs))?;
    report(campaign, &settings, &learned, heldout)
}

/// How long forces are held on their axes while the pattern turns on, s. Rows at the pace of a control loop are its steps.
fn hold_s(control_hz: Option<f64>, interval_s: f64) -> f64 {
    let own = if interval_s <= PACE_S { interval_s } else { 0.0 };
    control_hz.map_or(own, |hz| (1.0 / hz).min(interval_s))
}

/// What the filter is told of the instrument.
fn settings(runs: &[VirtualRun], drive_per_s_v: f64) -> Result<Settings, Refusal> {
    let fitted = || runs.iter().filter(|r| !r.held);
    let Some(first) = fitted().next() else {
        return Err(Refusal::new("campaign", "every run is held out", "a run with use = \"fit\""));
    };
    let alike = |a: f64, b: f64| (a / b - 1.0).abs() < ALIKE;
    if !runs.iter().all(|r| alike(r.interval_s, first.interval_s) && alike(r.amplitude_v, first.amplitude_v)) {
        let wanted = "runs of one interval and one amplitude";
        return Err(Refusal::no_answer("campaign", "the runs differ in their interval or their amplitude", wanted));
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 2 and some thousands")]
    let steps = (CYCLE_S / first.interval_s).round().clamp(2.0, 1e4) as u16;
    Ok(Settings {
        control_s: first.interval_s,
        amplitude_v: first.amplitude_v,
        drive_per_s: drive_per_s_v,
        damping_per_s: DAMPING_PER_S,
        steps,
        precession_rad_s: fitted().map(|r| r.fastest_rad_s).fold(DAMPING_PER_S, f64::max),
        ..Settings::default()
    })
}

/// What was left, channel by channel.
fn innovations(left: &Left) -> Vec<Innovation> {
    let of = |(at, channel): (usize, &&str)| {
        let (rms_rad, cycles) = rms(left, at);
        Innovation { channel: (*channel).into(), rms_rad, noise_rad: white(left, at), cycles }
    };
    CHANNELS.iter().enumerate().map(of).filter(|i| i.cycles > 0).collect()
}
