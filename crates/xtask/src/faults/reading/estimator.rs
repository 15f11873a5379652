//! … of the estimator.

use super::{Fault, fault};

const LIB: (&str, &str) = ("cvg-estimator", "--lib");
const ANGLE: (&str, &str) = ("cvg-estimator", "angle");
const BEAT: (&str, &str) = ("cvg-estimator", "beat");
const COMPENSATION: (&str, &str) = ("cvg-estimator", "compensation");
const DEMODULATOR: (&str, &str) = ("cvg-estimator", "demodulator");
const DIRECTION: (&str, &str) = ("cvg-estimator", "direction");
const NCO: (&str, &str) = ("cvg-estimator", "nco");
const OSCILLATOR: (&str, &str) = ("cvg-estimator", "oscillator");
const PRECESSION: (&str, &str) = ("cvg-estimator", "precession");

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "an angle exactly at the positive end of its period is not known",
        "estimator/src/angle.rs",
        "state.within_rad <= half;",
        "state.within_rad < half;",
        LIB,
    ),
    fault(
        "a line exactly at the least amplitude has an angle",
        "estimator/src/angle.rs",
        "} else if line_2 > least_2 {",
        "} else if line_2 >= least_2 {",
        ANGLE,
    ),
    fault("a circle has an angle", "estimator/src/angle.rs", "(p.angle(), p.r.norm(p.s))", "(p.angle(), p.e)", ANGLE),
    fault(
        "an infinite envelope is one that is at rest",
        "estimator/src/angle.rs",
        "(T::zero(), Status::Invalid)",
        "(T::zero(), Status::Undetermined)",
        ANGLE,
    ),
    fault(
        "the power of X lacks its quadrature",
        "estimator/src/beat.rs",
        "self.x2 = self.x2 + e.x_c * e.x_c + e.x_s * e.x_s;",
        "self.x2 = self.x2 + e.x_c * e.x_c;",
        BEAT,
    ),
    fault(
        "the first window of a beat is compared with nothing",
        "estimator/src/beat.rs",
        "        self.last = *e;\n",
        "        if self.windows > 0 {\n            self.last = *e;\n        }\n",
        BEAT,
    ),
    fault(
        "a beat begins with its third window",
        "estimator/src/beat.rs",
        "if self.windows > 0 {",
        "if self.windows > 1 {",
        BEAT,
    ),
    fault(
        "a cubic is undone before what comes after it",
        "estimator/src/compensation.rs",
        "        let z = self.affine.apply(e);\n        match &self.cubic {\n            Some(cubic) => cubic.undo(z),\n            None => z,\n        }",
        "        match &self.cubic {\n            Some(cubic) => self.affine.apply(cubic.undo(e)),\n            None => self.affine.apply(e),\n        }",
        COMPENSATION,
    ),
    fault(
        "what depends on the moment is undone without the rest",
        "estimator/src/compensation.rs",
        "None => self.undo_left(self.undo_forms(e), at()),",
        "None => self.undo_left(e, at()),",
        COMPENSATION,
    ),
    fault(
        "an offset is in the matrix of Y",
        "estimator/src/compensation.rs",
        "(of(1.0, 0.0) - offset, of(0.0, 1.0) - offset)",
        "(of(1.0, 0.0) - offset, of(0.0, 1.0))",
        COMPENSATION,
    ),
    fault(
        "of the affine effects one is left out",
        "estimator/src/compensation.rs",
        "sorted.effects().rev().take(affine));",
        "sorted.effects().rev().take(affine.max(1) - 1));",
        COMPENSATION,
    ),
    fault(
        "a range of no number is taken",
        "estimator/src/demodulator.rs",
        "if !(full_scale_v > 1e-9 && full_scale_v < 1e9) {",
        "if full_scale_v <= 1e-9 || full_scale_v >= 1e9 {",
        DEMODULATOR,
    ),
    fault(
        "the quadrature of X may be far out of range",
        "estimator/src/demodulator.rs",
        "e.x_c.magnitude() + e.x_s.magnitude() + e.y_c.magnitude()",
        "e.x_c.magnitude() + e.y_c.magnitude()",
        DEMODULATOR,
    ),
    fault(
        "clipped samples of a window are counted to one",
        "estimator/src/demodulator.rs",
        "window.clipped = window.clipped.saturating_add(1);",
        "window.clipped = 1;",
        LIB,
    ),
    fault(
        "the phase of a direction is that of an axis",
        "estimator/src/direction.rs",
        "self.sin.atan2(self.cos)",
        "(self.sin / self.cos).atan2(T::one())",
        DIRECTION,
    ),
    fault(
        "the axis of an envelope is as long as its line below X",
        "estimator/src/direction.rs",
        "T::two() * line * (line + p.r.magnitude())",
        "T::two() * line * (line + p.r)",
        ANGLE,
    ),
    fault(
        "an oscillator starts a quarter late",
        "estimator/src/nco.rs",
        "Phasor { cos: T::one(), sin: T::zero(), step_cos: self.centre_cos",
        "Phasor { cos: T::zero(), sin: T::one(), step_cos: self.centre_cos",
        NCO,
    ),
    fault(
        "the slowest correction may be as slow as it likes",
        "estimator/src/nco.rs",
        "step - reach > core::f64::consts::TAU / 64.0",
        "step > core::f64::consts::TAU / 64.0",
        NCO,
    ),
    fault(
        "a phasor half again as long is set right in one step",
        "estimator/src/nco.rs",
        "(length_2 - T::one()).within(T::ratio(1, 4))",
        "(length_2 - T::one()).within(T::ratio(1, 2))",
        NCO,
    ),
    fault(
        "a phase of no number is undetermined",
        "estimator/src/oscillator.rs",
        "if p.e.is_finite() && p.l.is_finite() {",
        "if p.e.is_finite() || p.l.is_finite() {",
        OSCILLATOR,
    ),
    fault(
        "the motion from window to window is that of the window before",
        "estimator/src/precession.rs",
        "*state = PrecessionState { cos_2, sin_2, sin_2_per_window, ..*state };",
        "*state = PrecessionState { cos_2, sin_2, ..*state };",
        LIB,
    ),
    fault(
        "a jump by more than a right angle is steady where it comes back",
        "estimator/src/precession.rs",
        "if along > T::zero() && across.within(self.jump_sin_2) {",
        "if across.within(self.jump_sin_2) {",
        PRECESSION,
    ),
    fault(
        "the least jump is half as far",
        "estimator/src/precession.rs",
        "let jump = fastest_rad_s * window_s + least_jump_rad;",
        "let jump = fastest_rad_s * window_s + 0.5 * least_jump_rad;",
        PRECESSION,
    ),
    fault(
        "a smoothed motion is beyond what it may be",
        "estimator/src/precession.rs",
        "state.smoothed(self.share, across).bounded(self.jump_sin_2);",
        "state.smoothed(self.share, across);",
        LIB,
    ),
    fault(
        "samples beyond the range are exchanged",
        "estimator/src/demodulator.rs",
        "        (one(x), one(y))",
        "        (one(y), one(x))",
        LIB,
    ),
    fault(
        "a window begins at the phase of its sine",
        "estimator/src/demodulator.rs",
        "start: (phasor.cos, phasor.sin),",
        "start: (phasor.sin, phasor.cos),",
        DEMODULATOR,
    ),
    fault(
        "a window without an envelope is undetermined",
        "estimator/src/demodulator.rs",
        "None => (Envelope::zero(), Status::Invalid),",
        "None => (Envelope::zero(), Status::Undetermined),",
        DEMODULATOR,
    ),
    fault(
        "a window of an older start has its fingerprint",
        "estimator/src/demodulator.rs",
        "[self.x, self.y, self.last.0, self.last.1]",
        "[self.x, self.y, self.last.0, self.last.0]",
        DEMODULATOR,
    ),
    fault(
        "the share of a window in the motion is upside down",
        "estimator/src/precession.rs",
        "share: T::from_f64(window_s / smoothing_s),",
        "share: T::from_f64((window_s / smoothing_s).sqrt()),",
        PRECESSION,
    ),
    fault(
        "a line of no number has a direction",
        "estimator/src/precession.rs",
        "        if !(line > self.least_2 && line.is_finite()) {",
        "        if line <= self.least_2 {",
        PRECESSION,
    ),
    fault(
        "a lock may have any damping",
        "estimator/src/oscillator.rs",
        "let damping = positive(damping, \"damping\")?;",
        "let damping = damping;",
        OSCILLATOR,
    ),
    fault(
        "squares that are nearly rounded away are none",
        "estimator/src/direction.rs",
        "let lost = T::epsilon() > T::zero() && length_2 * T::epsilon() <= T::zero();",
        "let lost = length_2 * T::epsilon() * T::epsilon() <= T::zero() && T::epsilon() > T::zero();",
        ANGLE,
    ),
];
