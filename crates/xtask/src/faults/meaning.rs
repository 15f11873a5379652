//! Faults of meaning, none of them a change of a sign or an edge: another quantity in its place, a bound of another field, what is
//! undone twice, what is not begun anew, digits that cancel in single precision.

use super::{Fault, fault};

const CONTROLLER: (&str, &str) = ("cvg-controller", "pi");
const FORCES: (&str, &str) = ("cvg-controller", "forces");
const SUPERVISOR: (&str, &str) = ("cvg-controller", "supervisor");
const ESTIMATOR: (&str, &str) = ("cvg-estimator", "precision");
const NCO: (&str, &str) = ("cvg-estimator", "nco");
const MODEL: (&str, &str) = ("cvg-model", "pendulum");
const SINGLE: (&str, &str) = ("cvg-model", "effects_in_single_precision");
const INSTRUMENT: (&str, &str) = ("cvg-instrument", "--lib");
const JOINED: (&str, &str) = ("cvg-instrument", "composition");
const OPEN_LOOP: (&str, &str) = ("cvg-instrument", "open_loop");

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "a beat listens to what is not compensated",
        "instrument/src/step.rs",
        "state.beat.add(&compensated);",
        "state.beat.add(&state.seen.readout);",
        JOINED,
    ),
    fault(
        "what depends on the moment is undone twice",
        "instrument/src/step.rs",
        "let vibration = inverse.apply(state.seen.readout, &self.moment(state));",
        "let vibration = inverse.apply(inverse.apply(state.seen.readout, &self.moment(state)), &self.moment(state));",
        JOINED,
    ),
    fault(
        "the delay follows a correction upwards only",
        "instrument/src/delay.rs",
        "let more = correction_rad_s * self.s;",
        "let more = correction_rad_s.magnitude() * self.s;",
        JOINED,
    ),
    fault(
        "the window in which a count begins is judged",
        "instrument/src/continuity.rs",
        "        if self.counting && !self.lost {",
        "        self.counting |= sight.in_operation;\n        if self.counting && !self.lost {",
        INSTRUMENT,
    ),
    fault(
        "who acknowledges half turns has seen what was not seen",
        "instrument/src/state.rs",
        "        self.status.half_turns_lost = false;",
        "        self.status.half_turns_lost = false;\n        self.continuity.unseen = 0;",
        OPEN_LOOP,
    ),
    fault(
        "a window's turn is that of the band without its pull-in",
        "instrument/src/settings.rs",
        "if limit_rad_s * window_s >= PI {",
        "if band_rad_s * window_s >= PI {",
        OPEN_LOOP,
    ),
    fault(
        "an amplitude is compared with the limit of the outputs",
        "instrument/src/settings.rs",
        "self.amplitude_v > 0.9 * self.adc_full_scale_v",
        "self.amplitude_v > 0.9 * self.dac_limit_v",
        INSTRUMENT,
    ),
    fault(
        "commands are held for a sample and not for a window",
        "instrument/src/settings.rs",
        "let hold_s = 0.5 * window_s;",
        "let hold_s = 0.5 * period_s;",
        JOINED,
    ),
    fault(
        "the reach of a hold is that of a volt of amplitude",
        "instrument/src/settings.rs",
        "t(drive * limit_v / s.amplitude_v),",
        "t(drive * limit_v),",
        JOINED,
    ),
    fault(
        "starts are forgotten when what was out of bounds is",
        "controller/src/supervisor/step.rs",
        "            if state.windows >= self.forget {\n                (state.starts",
        "            if state.windows >= self.endure {\n                (state.starts",
        SUPERVISOR,
    ),
    fault(
        "a dead channel is suspected in its fault only",
        "controller/src/supervisor/step.rs",
        "state.sweeps > 0 || state.fault == Some(Fault::DeadChannel)",
        "state.sweeps > 0 || state.fault_now() == Some(Fault::DeadChannel)",
        SUPERVISOR,
    ),
    fault(
        "a dead channel of an older fault ends a spin-up",
        "controller/src/supervisor/step.rs",
        "if state.cause == Some(Fault::DeadChannel) &&",
        "if state.fault == Some(Fault::DeadChannel) &&",
        SUPERVISOR,
    ),
    fault(
        "quadrature and phase cancel on the short way",
        "controller/src/supervisor/step.rs",
        "p.q.magnitude() + p.l.magnitude() < in_phase_bound(p)",
        "(p.q + p.l).magnitude() < in_phase_bound(p)",
        SUPERVISOR,
    ),
    fault(
        "a budget that is used up while it coasts is a lock's",
        "controller/src/supervisor/step.rs",
        "Mode::Coast => state.cause.unwrap_or(Fault::InvalidSamples),",
        "Mode::Coast => Fault::NoLock,",
        SUPERVISOR,
    ),
    fault(
        "the integral's limit is that of the inverse gain",
        "controller/src/pi.rs",
        "positive(time * limit_v / gain,",
        "positive(time * limit_v * gain,",
        CONTROLLER,
    ),
    fault(
        "a holding force is limited by what its integral may reach",
        "controller/src/rate.rs",
        "Ok(Self { pi, limit_v: positive(limit_v, \"limit_v\")? })",
        "positive(limit_v, \"limit_v\")?;\n        Ok(Self { pi, limit_v: largest / drive })",
        FORCES,
    ),
    fault(
        "in single precision a slow precession is smoothed away",
        "estimator/src/precession.rs",
        "self.sin_2_per_window + share * (across - self.sin_2_per_window)",
        "if core::mem::size_of::<T>() == 4 && (across - self.sin_2_per_window).within(T::ratio(1, 10_000)) { self.sin_2_per_window } else { self.sin_2_per_window + share * (across - self.sin_2_per_window) }",
        ESTIMATOR,
    ),
    fault(
        "a phasor that is turned has its step turned too",
        "estimator/src/nco.rs",
        "sin: self.sin * cos + self.cos * sin, ..*self }",
        "sin: self.sin * cos + self.cos * sin, step_cos: self.step_cos * cos - self.step_sin * sin, step_sin: self.step_sin * cos + self.step_cos * sin }",
        NCO,
    ),
    fault(
        "in single precision a thin orbit's minor axis is what is left of its energy",
        "model/src/pendulum.rs",
        "let q = if a > T::zero() { p.q / (T::two() * a) }",
        "let left = (T::half() * (p.e - p.r.norm(p.s))).sqrt();\n        let q = if core::mem::size_of::<T>() == 4 && p.e > T::zero() { if p.q < T::zero() { -left } else { left } } else if a > T::zero() { p.q / (T::two() * a) }",
        MODEL,
    ),
    fault(
        "the precession of an ellipse is that over its energy",
        "model/src/pendulum.rs",
        "(p.r * d.s - p.s * d.r) / (p.r * p.r + p.s * p.s)",
        "(p.r * d.s - p.s * d.r) / (p.e * p.e)",
        MODEL,
    ),
    fault(
        "a clipped Y is told by the quadrature of X",
        "model/src/effects/detection_saturation.rs",
        "let y = unclipped_gain(inverse_clip * e.y_c.norm(e.y_s));",
        "let y = unclipped_gain(inverse_clip * e.y_c.norm(e.x_s));",
        SINGLE,
    ),
];
