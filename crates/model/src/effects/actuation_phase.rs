//! Drives whose forces are late against the readout: F_s + iF_c ← (F_s + iF_c) e^{iφ}.
//!
//! A lag that both channels of the readout have in common is the same thing: the phase-locked loop follows it, and the forces
//! are off by it. In phase with the vibration, a share φ of what holds the split pushes the pattern along: θ̇ ∋ ½Δω φ sin 2(θ − θ_ω).

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{AxisForces, Real};

/// phase of the drives against the readout.
pub struct ActuationPhase;

impl Effect for ActuationPhase {
    const DESCRIPTION: Description = Description {
        id: "actuation-phase",
        title: "phase of the drives against the readout",
        stage: Stage::Actuation,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[fitted("actuation_phase", "rad", 0.5, 1e-2)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "a precession ∝ v_qc, with a split ½Δω φ sin(2θ−2θ_ω), that v_as has no part in",
        scaling: Scaling { rate: -1, amplitude: 0, odd_in_rate: true },
        source: "phasors of a drive with a delay",
    };

    #[inline]
    fn actuate<T: Real>(&[phase, ..]: &Values<T>, f: AxisForces<T>, _: &Moment<T>) -> AxisForces<T> {
        let (sin, cos) = phase.sin_cos();
        f.ahead(cos, sin)
    }
}
