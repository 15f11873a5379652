//! Faults that nothing saw when they were planted first: what the tests did not say then. Each has its test since.

use super::{Fault, fault};

const ANGLE: (&str, &str) = ("cvg-estimator", "angle");
const OSCILLATOR: (&str, &str) = ("cvg-estimator", "oscillator");
const PRECESSION: (&str, &str) = ("cvg-estimator", "precession");
const FORCES: (&str, &str) = ("cvg-controller", "forces");
const SUPERVISOR: (&str, &str) = ("cvg-controller", "supervisor");
const OPEN_LOOP: (&str, &str) = ("cvg-instrument", "open_loop");
const INSTRUMENT: (&str, &str) = ("cvg-instrument", "--lib");
const JOINED: (&str, &str) = ("cvg-instrument", "composition");
const EFFECTS: (&str, &str) = ("cvg-model", "effects");
const C: (&str, &str) = ("cvg-capi", "same_as_rust");
const LEARNING: (&str, &str) = ("cvg-capi", "calibrator_same_as_rust");

pub(super) const FAULTS: &[Fault] = &[
    fault("a spin-up has a second more", "instrument/src/settings.rs", "spin_up_s: 5.0,", "spin_up_s: 6.0,", JOINED),
    fault("a device is given up a start earlier", "instrument/src/settings.rs", "retries: 3,", "retries: 2,", JOINED),
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
        "let interrupted = valid && directed && moved",
        "let interrupted = valid && moved",
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
        "if self.amplitude_v > 0.9 *",
        "if self.amplitude_v >= 0.9 *",
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
        "instrument/src/correction.rs",
        "kept + beat.radians_per_window() * per_window_s,",
        "return kept + beat.radians_per_window() * per_window_s,",
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
    fault(
        "a steady drift has the sense of the table",
        "model/src/effects/rate_offset.rs",
        "rate_rad_s + offset",
        "if rate_rad_s < T::zero() { rate_rad_s - offset } else { rate_rad_s + offset }",
        EFFECTS,
    ),
    fault(
        "the hold is at zero in C",
        "capi/src/lib.rs",
        "        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout",
        "        hold_rad: 0.0,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout",
        C,
    ),
    fault(
        "the rate loop has the phase loop's tuning in C",
        "capi/src/lib.rs",
        "        rate: tuning(s.rate),\n        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout",
        "        rate: tuning(s.phase),\n        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout",
        C,
    ),
    fault(
        "four effects are one too many in C",
        "capi/src/lib.rs",
        "if count > MOST_COMPENSATED {",
        "if count >= MOST_COMPENSATED {",
        C,
    ),
    fault(
        "nothing is lost without an instrument in C",
        "capi/src/lib.rs",
        "    valid: false,\n    half_turns_lost: true,",
        "    valid: false,\n    half_turns_lost: false,",
        C,
    ),
    fault(
        "what is followed is known in C",
        "capi/src/calibrator.rs",
        "detection_known: status.detection_known,",
        "detection_known: status.detection_followed,",
        LEARNING,
    ),
    fault(
        "what is known is followed in C",
        "capi/src/calibrator.rs",
        "detection_followed: status.detection_followed,",
        "detection_followed: status.detection_known,",
        LEARNING,
    ),
    fault(
        "the dither is the precession in C",
        "capi/src/calibrator.rs",
        "        precession_rad_s: s.precession_rad_s,\n        dither_rad_s: s.dither_rad_s,\n    });",
        "        precession_rad_s: s.dither_rad_s,\n        dither_rad_s: s.precession_rad_s,\n    });",
        LEARNING,
    ),
    fault(
        "taken back is never told in C",
        "capi/src/calibrator.rs",
        "taken_back: status.taken_back,",
        "taken_back: 0,",
        LEARNING,
    ),
    fault(
        "a record that is refused empties what was learned in C",
        "capi/src/calibrator.rs",
        "Err(Refused::Damaged) =>",
        "Err(Refused::Damaged) if { *s = c.start(); false } => cvg_record::CVG_RECORD_DAMAGED,\n        Err(Refused::Damaged) =>",
        LEARNING,
    ),
    fault(
        "a direction after garbage is never kept",
        "estimator/src/precession.rs",
        "        (state.cos_2, state.sin_2) = (cos_2, sin_2);\n",
        "        if along <= T::two() {\n            (state.cos_2, state.sin_2) = (cos_2, sin_2);\n        }\n",
        PRECESSION,
    ),
    fault(
        "a pattern on an axis has no direction",
        "estimator/src/precession.rs",
        "self.cos_2 != T::zero() || self.sin_2 != T::zero()",
        "self.cos_2 != T::zero() && self.sin_2 != T::zero()",
        PRECESSION,
    ),
    fault(
        "an effect without a name is one without effect in C",
        "capi/src/lib.rs",
        "        if effect.id.is_null() {\n            return Err(refused(\"named\"));\n        }",
        "        if effect.id.is_null() {\n            continue;\n        }",
        C,
    ),
    fault(
        "a count without effects is refused in C",
        "capi/src/lib.rs",
        "if effects.is_null() || count == 0 {",
        "if count == 0 {",
        C,
    ),
];
