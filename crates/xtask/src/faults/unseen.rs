//! Faults that nothing saw when they were planted first: what the tests did not say then. Each has its test since.

use super::{Fault, fault};

const ANGLE: (&str, &str) = ("cvg-estimator", "angle");
const OSCILLATOR: (&str, &str) = ("cvg-estimator", "oscillator");
const FORCES: (&str, &str) = ("cvg-controller", "forces");
const SUPERVISOR: (&str, &str) = ("cvg-controller", "supervisor");
const OPEN_LOOP: (&str, &str) = ("cvg-instrument", "open_loop");
const INSTRUMENT: (&str, &str) = ("cvg-instrument", "--lib");
const JOINED: (&str, &str) = ("cvg-instrument", "composition");

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "an angle exactly at the negative end of its period is not known",
        "estimator/src/angle.rs",
        "let known = state.within_rad >= -half &&",
        "let known = state.within_rad > -half &&",
        ANGLE,
    ),
    fault(
        "periods are told in single precision",
        "estimator/src/angle.rs",
        "let periods = self.periods as f64;",
        "let periods = f64::from(self.periods as f32);",
        ANGLE,
    ),
    fault(
        "the count of periods wraps",
        "estimator/src/angle.rs",
        "state.periods.saturating_add(1)",
        "state.periods.wrapping_add(1)",
        ANGLE,
    ),
    fault(
        "half a radian is no phase at the limit",
        "estimator/src/oscillator.rs",
        "        if error.within(T::one()) {\n",
        "        if error.within(T::half()) {\n",
        OSCILLATOR,
    ),
    fault(
        "a heading below minus one has the other sense in single precision",
        "controller/src/rate.rs",
        "(T::two() * theta_rad).sin_cos();",
        "(T::two() * theta_rad * if core::mem::size_of::<T>() == 4 && theta_rad < -T::one() { -T::one() } else { T::one() })\n                .sin_cos();",
        FORCES,
    ),
    fault(
        "the budget of a start wraps",
        "controller/src/supervisor.rs",
        "u32::try_from(2 * once).unwrap_or(u32::MAX)",
        "(2 * once) as u32",
        SUPERVISOR,
    ),
    fault(
        "a first direction is an interruption",
        "instrument/src/step.rs",
        "(moved, directed && moved == Movement::Unknown)",
        "(moved, moved == Movement::Unknown)",
        OPEN_LOOP,
    ),
    fault(
        "a ring-down is no operation",
        "instrument/src/step.rs",
        "matches!(mode, Mode::WholeAngle | Mode::Hold | Mode::RingDown)",
        "matches!(mode, Mode::WholeAngle | Mode::Hold)",
        OPEN_LOOP,
    ),
    fault(
        "a sum that is the same is a stuck converter",
        "instrument/src/step.rs",
        "(sum_x == x && now_x == last_x && *now_x != zero)",
        "(sum_x == x && *now_x != zero)",
        INSTRUMENT,
    ),
    fault(
        "the last sample of Y tells nothing",
        "instrument/src/step.rs",
        "(sum_y == y && now_y == last_y && *now_y != zero)",
        "(sum_y == y && *now_y != zero)",
        INSTRUMENT,
    ),
    fault(
        "nine tenths exactly are refused",
        "instrument/src/settings.rs",
        "if s.amplitude_v > 0.9 *",
        "if s.amplitude_v >= 0.9 *",
        OPEN_LOOP,
    ),
    fault(
        "ten samples of delay exactly are refused",
        "instrument/src/settings.rs",
        "value <= 10.0 * period_s",
        "value < 10.0 * period_s",
        OPEN_LOOP,
    ),
    fault(
        "a setting of no number is taken",
        "instrument/src/settings.rs",
        "if !(value > 1e-9 && value < 1e9) {",
        "if value <= 1e-9 || value >= 1e9 {",
        OPEN_LOOP,
    ),
    fault(
        "the drives' effects are undone only where the readout's are",
        "instrument/src/settings.rs",
        "let actuation = if actuation.is_empty() { None }",
        "let actuation = if actuation.is_empty() || readout.is_none() { None }",
        JOINED,
    ),
    fault(
        "what was heard sets any frequency",
        "instrument/src/step.rs",
        "correction_rad_s = (correction_rad_s + off).bounded(self.oscillator.limit_rad_s());",
        "correction_rad_s = correction_rad_s + off;",
        JOINED,
    ),
    fault(
        "the unseen wrap",
        "instrument/src/continuity.rs",
        "self.unseen.saturating_add(1)",
        "self.unseen.wrapping_add(1)",
        OPEN_LOOP,
    ),
    fault(
        "half a turn of the band exactly is taken",
        "instrument/src/settings.rs",
        "if limit_rad_s * window_s >= PI {",
        "if limit_rad_s * window_s > 2.0 * PI {",
        OPEN_LOOP,
    ),
];
