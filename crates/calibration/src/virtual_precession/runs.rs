//! Runs made ready: rows of what was read and what was put out, evenly spaced, and where they are not.

use std::f64::consts::PI;
use std::ops::Range;

use cvg_estimator::direction::major_axis;
use cvg_model::{AxisForces, Envelope};

use super::lost_rows::bridged;
use crate::error::Refusal;
use crate::numerics::angles::wrapped;
use crate::numerics::statistics::{line, median};
use crate::recording::{Role, Run};

/// A row: what was read, and what was put out to the drives, V.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) seen: Envelope<f64>,
    pub(crate) forces: AxisForces<f64>,
    /// the row before it stands one interval earlier
    pub(crate) follows: bool,
}

/// A run of virtual precession or of unknown rotation.
#[derive(Debug, Clone)]
pub(crate) struct VirtualRun {
    pub(crate) held: bool,
    pub(crate) rows: Vec<Row>,
    pub(crate) interval_s: f64,
    /// median amplitude of the vibration, V
    pub(crate) amplitude_v: f64,
    /// the fastest that was commanded, rad/s
    pub(crate) fastest_rad_s: f64,
    /// what was commanded at each row, rad/s
    asked_rad_s: Vec<f64>,
}

/// The longest interval, s: a cycle of the filter has two rows at least, and no more than 0.1 s.
const LONGEST_INTERVAL_S: f64 = 0.05;
/// Standard error of a share of the command that tells something.
const CLEAR: f64 = 0.1;
/// A recording of less than this tells nothing, s.
const SHORTEST_S: f64 = 10.0;

impl VirtualRun {
    /// Makes a run ready; `drive_per_s_v` is what a volt of command makes of the envelope, V/s.
    ///
    /// # Errors
    /// A run that is too short, too slowly sampled, or has no vibration.
    pub(crate) fn new(run: &Run, drive_per_s_v: f64) -> Result<Self, Refusal> {
        let name = run.file.display().to_string();
        let settled = run.settled()?;
        let r = &run.recording;
        let columns = (&r.xc_v, &r.xs_v, &r.yc_v, &r.ys_v, &r.vas_v, &r.vqc_v);
        let (Some(xc), Some(xs), Some(yc), Some(ys), Some(vas), Some(vqc)) = columns else {
            r.require_virtual()?;
            return Err(Refusal::new(&name, "a run without its channels", "readout and commands"));
        };
        let mut steps: Vec<f64> = r.t_s[settled.clone()].windows(2).map(|w| w[1] - w[0]).collect();
        if steps.is_empty() {
            return Err(Refusal::no_answer(&name, "a single row", format!("{SHORTEST_S} s and more")));
        }
        let interval_s = median(&mut steps);
        let seconds = steps.len() as f64 * interval_s;
        if interval_s > LONGEST_INTERVAL_S {
            let problem = format!("a row every {interval_s:.3} s is too seldom for what forces do");
            return Err(Refusal::no_answer(&name, problem, "20 rows a second and more, best each control step"));
        }
        if seconds < SHORTEST_S {
            let problem = format!("{seconds:.1} s are too short");
            return Err(Refusal::no_answer(&name, problem, format!("{SHORTEST_S} s and more")));
        }
        let asked = |i: usize| r.virtual_dps.as_ref().map_or(0.0, |v| v[i].to_radians());
        let envelope = |i: usize| Envelope::new(xc[i], xs[i], yc[i], ys[i]);
        let amplitude_v = median(&mut settled.clone().map(|i| envelope(i).pendulum().e.sqrt()).collect::<Vec<_>>());
        if !(amplitude_v > 0.0 && amplitude_v.is_finite()) {
            return Err(Refusal::no_answer(&name, "there is no vibration", "an instrument in its loops"));
        }
        let row = |i: usize| {
            let seen = envelope(i);
            let major = major_axis(&seen, &seen.pendulum());
            // Equation 9 with the command that precesses, of the size that the set amplitude asks for; one that was not recorded
            // spoils its row
            let v_qs = -asked(i) * amplitude_v / drive_per_s_v;
            let (cos, sin) = (major.cos, major.sin);
            let forces = AxisForces {
                x_c: -vqc[i] * sin,
                x_s: vas[i] * cos - v_qs * sin,
                y_c: vqc[i] * cos,
                y_s: vas[i] * sin + v_qs * cos,
            };
            (Row { seen, forces, follows: false }, asked(i))
        };
        let (rows, asked_rad_s) = bridged(&r.t_s[settled.clone()], interval_s, settled.map(row).collect());
        let fastest = |f: f64, v: &f64| if v.is_finite() { f.max(v.abs()) } else { f };
        let fastest_rad_s = asked_rad_s.iter().fold(0.0, fastest);
        Ok(Self { held: run.role == Role::Holdout, rows, interval_s, amplitude_v, fastest_rad_s, asked_rad_s })
    }

    /// By which share of the command the pattern precesses, from second to second; none where rotation drowns it, or nothing
    /// was commanded.
    pub(crate) fn share_of_the_command(&self) -> Option<f64> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rows of a second")]
        let second = (1.0 / self.interval_s).round().max(1.0) as usize;
        let angle = |r: &Row| r.seen.pendulum().angle();
        let turned: Vec<f64> = self.rows.windows(2).map(|w| wrapped(angle(&w[1]) - angle(&w[0]), PI)).collect();
        let sums = turned.chunks_exact(second).zip(self.asked_rad_s.chunks_exact(second));
        let (asked, turned): (Vec<f64>, Vec<f64>) = sums
            .map(|(turned, asked)| (asked.iter().sum::<f64>() * self.interval_s, turned.iter().sum()))
            .filter(|(asked, turned): &(f64, f64)| asked.is_finite() && turned.is_finite())
            .unzip();
        let (share, offset) = line(&asked, &turned);
        let mean = asked.iter().sum::<f64>() / asked.len().max(1) as f64;
        let spread: f64 = asked.iter().map(|a| (a - mean).powi(2)).sum();
        let left: f64 = asked.iter().zip(&turned).map(|(a, t)| (t - share * a - offset).powi(2)).sum();
        let error = (left / spread / asked.len().max(1) as f64).sqrt();
        (error < CLEAR).then_some(share)
    }
}

/// Part of a run.
#[derive(Debug, Clone)]
pub(crate) struct Part<'a> {
    pub(crate) run: &'a VirtualRun,
    pub(crate) rows: Range<usize>,
}

/// What is fitted, and what is held out: whole runs where one is, and the last quarter of each where none is.
pub(crate) fn parts(runs: &[VirtualRun]) -> (Vec<Part<'_>>, Vec<Part<'_>>) {
    if runs.iter().any(|r| r.held) {
        let held = runs.iter().filter(|r| r.held).map(|run| Part { run, rows: 0..run.rows.len() }).collect();
        return (all(runs), held);
    }
    let at = |r: &VirtualRun| r.rows.len() * 3 / 4;
    let fitted = runs.iter().map(|run| Part { run, rows: 0..at(run) }).collect();
    (fitted, runs.iter().map(|run| Part { run, rows: at(run)..run.rows.len() }).collect())
}

/// All that may be fitted.
pub(crate) fn all(runs: &[VirtualRun]) -> Vec<Part<'_>> {
    runs.iter().filter(|r| !r.held).map(|run| Part { run, rows: 0..run.rows.len() }).collect()
}
