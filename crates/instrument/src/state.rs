//! What an instrument remembers between samples, and what it tells.

use cvg_controller::{Fault, Mode, PiState, RequestedMode, SupervisorState};
use cvg_estimator::{Beat, LockState, Phasor, PrecessionState, Window};
use cvg_model::{AxisForces, Envelope, Float};

use crate::Continuity;

/// The instrument's state: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State<T> {
    /// the oscillator
    pub phasor: Phasor<T>,
    /// the window that is being filled
    pub window: Window<T>,
    /// the drives' carrier: V in phase with the oscillator and in quadrature to it, the loop's delay undone
    pub drive: AxisForces<T>,
    /// what was measured and commanded in the last control step
    pub seen: Seen<T>,
    /// energy loop
    pub energy: PiState<T>,
    /// quadrature loop
    pub quadrature: PiState<T>,
    /// rate loop
    pub rate: PiState<T>,
    /// phase-locked loop
    pub lock: LockState<T>,
    /// precession
    pub precession: PrecessionState<T>,
    /// beat with the oscillator, while listening
    pub beat: Beat<T>,
    /// fingerprint of the last window
    pub fingerprint: [T; 4],
    /// start-up, operation, faults
    pub supervisor: SupervisorState,
    /// whether the count of half turns is still the pattern's
    pub continuity: Continuity,
    /// control steps made
    pub windows: u32,
    /// what the last control step said; never `fresh` here
    pub status: Status,
}

/// What was measured and commanded in one control step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen<T> {
    /// the readout's envelope at the window's middle
    pub readout: Envelope<T>,
    /// the same with the readout effects undone
    pub compensated: Envelope<T>,
    /// energy loop's command, V
    pub v_as: T,
    /// quadrature loop's command, V
    pub v_qc: T,
    /// rate loop's command, V
    pub v_qs: T,
    /// correction of the oscillator's frequency, rad/s
    pub correction_rad_s: T,
}

/// What the instrument says with every sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Status {
    /// what it is doing
    pub mode: Mode,
    /// the fault it is in
    pub fault: Option<Fault>,
    /// a control step was made with this sample: [`State::seen`] is new
    pub fresh: bool,
    /// a sample of the last window was at the end of the converter's range
    pub clipped: bool,
    /// the last window had an envelope
    pub valid: bool,
    /// half turns may be lost: the angle is right up to a multiple of 180 degrees; until
    /// [`State::acknowledge_half_turns`]
    pub half_turns_lost: bool,
}

impl<T: Float> Default for Seen<T> {
    fn default() -> Self {
        let zero = T::zero();
        Self {
            readout: Envelope::zero(),
            compensated: Envelope::zero(),
            v_as: zero,
            v_qc: zero,
            v_qs: zero,
            correction_rad_s: zero,
        }
    }
}

impl<T: Float> State<T> {
    /// What is wanted from the next control step on.
    pub fn request(&mut self, requested: RequestedMode) {
        self.supervisor.requested = requested;
    }

    /// The last fault, also after the instrument came back from it.
    pub fn last_fault(&self) -> Option<Fault> {
        self.supervisor.fault
    }

    /// Takes back that half turns may be lost: whoever reads the angle has set it right, or does not need it.
    pub fn acknowledge_half_turns(&mut self) {
        self.continuity.lost = false;
        self.status.half_turns_lost = false;
    }

    /// The unwrapped pattern angle at the middle of the last window, in degrees.
    pub fn angle_deg(&self) -> f64 {
        self.precession.degrees()
    }
}
