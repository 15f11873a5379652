//! When to precess, and when to commit.

use cvg_model::Float;

use crate::Calibrator;
use crate::state::{Commit, State};

/// Seconds of use in each of the stages that linearise, before what was learned is committed.
const STAGE_S: [u16; 4] = [10, 10, 20, 20];
/// And from one commit to the next after them, at rest: as long as the precession takes to go to and fro at both speeds.
const REST_S: u16 = 40;
/// While it turns, where the rotation has swept half a turn of the pattern since, and where it has not.
const SWEPT_S: u16 = 10;
const TURNING_S: u16 = 20;
/// How much less likely the held-out innovations have to be for a commit to be taken back, as a logarithm.
const WORSE: i32 = 20;

impl<T: Float> Calibrator<T> {
    #[inline(never)]
    pub(crate) fn plan(&self, s: &mut State<T>) {
        let sc = &mut s.schedule;
        sc.profile = sc.profile.wrapping_add(1);
        sc.untold = sc.untold.saturating_add(1);
        if !sc.live {
            // disturbed: nothing is asked of the drives
            s.precession = T::zero();
            return;
        }
        s.precession = self.profile(sc.moving > 0, sc.settle > 0 && sc.stage == 0, sc.stage, sc.profile);
        if sc.fresh == 0 {
            return;
        }
        sc.used = sc.used.saturating_add(1);
        if sc.refused > self.cycles(20).saturating_mul(2) {
            // for long nothing is as it was learned: the mechanics are others now
            self.split_changed(s);
            return;
        }
        if s.score < -T::ratio(WORSE, 1) {
            sc.commit = Commit::Back;
            return;
        }
        let due = match STAGE_S.get(usize::from(sc.stage)) {
            Some(stage_s) => *stage_s,
            None if sc.moving > 0 && sc.swept > T::PI => SWEPT_S,
            None if sc.moving > 0 => TURNING_S,
            None => REST_S,
        };
        if sc.used >= u32::from(self.cycles(due)) {
            sc.commit = Commit::Forth;
        }
    }

    /// The virtual precession: to and fro, so that the scale of the forces and a constant rate are two things.
    pub(crate) fn profile(&self, moving: bool, idle: bool, stage: u8, cycle: u32) -> T {
        let second = u32::from(self.cycles(1)).max(1);
        let flip = |hold_s: u32| (cycle / (hold_s * second)) % 2 == 1;
        let signed = |v: T, minus: bool| if minus { -v } else { v };
        if idle {
            T::zero()
        } else if moving {
            signed(self.dither, flip(1))
        } else if stage < 2 {
            signed(self.precession, flip(5))
        } else {
            let slow = (cycle / (18 * second)) % 2 == 1;
            let v = if slow { T::half() * self.precession } else { self.precession };
            signed(v, flip(9))
        }
    }
}
