//! Faults of a third reading, by somebody who had built none of it: what no test compared with a number of its own.

use super::{Fault, fault};

const INSTRUMENT: (&str, &str) = ("cvg-instrument", "--lib");
const OPEN_LOOP: (&str, &str) = ("cvg-instrument", "open_loop");
const SUPERVISOR: (&str, &str) = ("cvg-controller", "supervisor");
const EFFECTS: (&str, &str) = ("cvg-model", "effects");

const STEP: &str = "instrument/src/step.rs";
const CORRECTION: &str = "instrument/src/correction.rs";
const LIST: &str = "model/src/effects/mod.rs";

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "the commands behind the drives are those of the nominal carrier",
        STEP,
        "self.delay.done(&state.drive, state.seen.correction_rad_s)",
        "self.delay.done(&state.drive, T::zero())",
        OPEN_LOOP,
    ),
    fault(
        "the commands behind the drives are longer by what the detuning lengthens",
        "model/src/actuation.rs",
        "let size_2 = cos * cos + sin * sin;",
        "let size_2 = T::one();",
        OPEN_LOOP,
    ),
    fault(
        "the count of control steps ends on the short way",
        STEP,
        "        state.windows = state.windows.wrapping_add(1);\n        state.phasor = phasor;",
        "        state.windows = state.windows.saturating_add(1);\n        state.phasor = phasor;",
        INSTRUMENT,
    ),
    fault(
        "the correction of a rest is whatever is remembered",
        CORRECTION,
        "let kept = lock.detuning_rad_s.bounded(limit_rad_s);",
        "let kept = lock.detuning_rad_s;",
        INSTRUMENT,
    ),
    fault(
        "a long rest is sixty short ones",
        "controller/src/supervisor.rs",
        "pub const LONG_REST: u32 = 64;",
        "pub const LONG_REST: u32 = 60;",
        SUPERVISOR,
    ),
    fault(
        "the gain warms up behind the lag between the channels",
        LIST,
        "    Temperature => over_temperature::OverTemperature<detection_gain_mismatch::DetectionGainMismatch>,\n    \
         DetectionPhase => detection_phase::DetectionPhase,",
        "    DetectionPhase => detection_phase::DetectionPhase,\n    \
         Temperature => over_temperature::OverTemperature<detection_gain_mismatch::DetectionGainMismatch>,",
        EFFECTS,
    ),
    fault(
        "the drives' amplifiers are behind their axes",
        LIST,
        "    DriveSaturation => drive_saturation::DriveSaturation,\n    ActuationGainMismatch => \
         actuation_gain_mismatch::ActuationGainMismatch,",
        "    ActuationGainMismatch => actuation_gain_mismatch::ActuationGainMismatch,\n    DriveSaturation => \
         drive_saturation::DriveSaturation,",
        EFFECTS,
    ),
    fault(
        "a strong harmonic is undone by a step less",
        "model/src/effects/harmonic_n.rs",
        "const NEWTON_STEPS: usize = 4;",
        "const NEWTON_STEPS: usize = 3;",
        EFFECTS,
    ),
];
