//! By how much the oscillator is corrected where no loop runs.

use cvg_controller::supervisor::LoopCommand;
use cvg_estimator::{Beat, LockState};
use cvg_model::Float;

/// The oscillator's correction, rad/s, that goes with `command` where the phase loop has no part in it: what is swept; the beat's
/// frequency beside what the loop had found, with `per_window_s` windows a second; otherwise what the loop has, also from before
/// a fault.
///
/// Within ±`limit_rad_s` whatever is ordered, heard or remembered; 0 where it is no number.
pub(crate) fn ordered<T: Float>(
    command: &LoopCommand<T>,
    lock: &LockState<T>,
    beat: &Beat<T>,
    per_window_s: T,
    limit_rad_s: T,
) -> T {
    let kept = lock.detuning_rad_s.bounded(limit_rad_s);
    let asked = match command {
        LoopCommand::Sweep { correction_rad_s, .. } => *correction_rad_s,
        LoopCommand::Tune => kept + beat.radians_per_window() * per_window_s,
        LoopCommand::Rest | LoopCommand::Listen | LoopCommand::Snap | LoopCommand::Lock | LoopCommand::Run { .. } => {
            return kept;
        }
    };
    asked.bounded(limit_rad_s)
}
