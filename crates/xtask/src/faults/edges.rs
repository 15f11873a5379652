//! Faults at edges: one unit in the last place, one window, one sense, what was before, what is no number; and what an
//! interface exchanges.

use super::{Fault, fault};

const BEAT: (&str, &str) = ("cvg-estimator", "beat");
const NCO: (&str, &str) = ("cvg-estimator", "nco");
const PRECESSION: (&str, &str) = ("cvg-estimator", "precession");
const OSCILLATOR: (&str, &str) = ("cvg-estimator", "oscillator");
const PI: (&str, &str) = ("cvg-controller", "pi");
const FORCES: (&str, &str) = ("cvg-controller", "forces");
const SUPERVISOR: (&str, &str) = ("cvg-controller", "supervisor");
const JOINED: (&str, &str) = ("cvg-instrument", "composition");
const MODEL: (&str, &str) = ("cvg-model", "pendulum");
const C: (&str, &str) = ("cvg-capi", "same_as_rust");
const DIRECTION: (&str, &str) = ("cvg-estimator", "direction");
const INSTRUMENT: (&str, &str) = ("cvg-instrument", "--lib");
const CALIBRATOR: (&str, &str) = ("cvg-calibrator", "--lib");
const SCALAR: (&str, &str) = ("cvg-model", "scalar");
const LEARNING: (&str, &str) = ("cvg-capi", "calibrator_same_as_rust");

const STEP: &str = "controller/src/supervisor/step.rs";
const BUILT: &str = "instrument/src/step.rs";

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "a direction that is one unit too long is none",
        "estimator/src/direction.rs",
        "if length_2 <= T::ratio(8, 1) && in_phase * in_phase > T::zero()",
        "if length_2 <= T::ratio(4, 1) && in_phase * in_phase > T::zero()",
        DIRECTION,
    ),
    fault(
        "the lead stretches the direction",
        "estimator/src/precession.rs",
        "let length = T::one() - T::half() * psi * psi;",
        "let length = T::one();",
        PRECESSION,
    ),
    fault(
        "a direction whose turn is half a step is known on the short way alone",
        "estimator/src/precession.rs",
        "let steady = (along - T::one()).within(T::ratio(3, 8))",
        "let steady = (along - T::one()).within(T::half())",
        PRECESSION,
    ),
    fault(
        "the motion that is told is beyond a jump",
        "estimator/src/precession.rs",
        "T::half() * state.sin_2_per_window.bounded(self.jump_sin_2) / self.window_s",
        "T::half() * state.sin_2_per_window / self.window_s",
        PRECESSION,
    ),
    fault(
        "a detuning beyond its limit stays where no phase is",
        "estimator/src/oscillator.rs",
        "            state.detuning_rad_s = held;\n            let status",
        "            let status",
        OSCILLATOR,
    ),
    fault(
        "a phase error far to the negative is measured",
        "estimator/src/oscillator.rs",
        "if error.within(T::one()) && detuning.within(self.limit_rad_s)",
        "if error <= T::one() && detuning.within(self.limit_rad_s)",
        OSCILLATOR,
    ),
    fault(
        "a beat of no number is no number",
        "estimator/src/beat.rs",
        "self.across.atan2(self.along).bounded(T::PI)",
        "self.across.atan2(self.along)",
        BEAT,
    ),
    fault(
        "the windows of a beat wrap",
        "estimator/src/beat.rs",
        "self.windows = self.windows.saturating_add(1);",
        "self.windows = self.windows.wrapping_add(1);",
        ("cvg-estimator", "--lib"),
    ),
    fault(
        "a phasor that is too short keeps its length",
        "estimator/src/nco.rs",
        "if correction_rad_s.within(self.limit_rad_s) && (length_2 - T::one()).within(T::ratio(1, 4))",
        "if correction_rad_s.within(self.limit_rad_s) && length_2 <= T::ratio(5, 4)",
        NCO,
    ),
    fault(
        "a primed integral is beyond its limit",
        "controller/src/pi.rs",
        "PiState { integral: (self.integral_limit * (volts / self.limit_v)).bounded(self.integral_limit) }",
        "PiState { integral: self.integral_limit * (volts / self.limit_v) }",
        PI,
    ),
    fault(
        "a holding force of no number is a limit",
        "controller/src/rate.rs",
        "let status = if !asked.is_finite() {\n            Status::Invalid",
        "let status = if !asked.is_finite() {\n            Status::Limited",
        FORCES,
    ),
    fault(
        "the short way goes on exactly at the lower bound",
        STEP,
        "            && p.e > self.low_2\n            && p.e < self.high_2",
        "            && p.e >= self.low_2\n            && p.e < self.high_2",
        SUPERVISOR,
    ),
    fault(
        "the short way goes on exactly at the upper bound",
        STEP,
        "            && p.e > self.low_2\n            && p.e < self.high_2",
        "            && p.e > self.low_2\n            && p.e <= self.high_2",
        SUPERVISOR,
    ),
    fault(
        "an interruption too few is a fault",
        STEP,
        "    state.coasts > MOST_COASTS\n",
        "    state.coasts >= MOST_COASTS\n",
        SUPERVISOR,
    ),
    fault("a coast ends with one window", STEP, "if state.good < 2 {", "if state.good < 1 {", SUPERVISOR),
    fault(
        "a pattern in the second quadrant is one channel",
        STEP,
        "p.s.magnitude() < T::ratio(1, 30) * p.r.magnitude()",
        "p.s < T::ratio(1, 30) * p.r.magnitude()",
        SUPERVISOR,
    ),
    fault(
        "a sweep comes from above",
        STEP,
        "self.band_rad_s * (T::two() * share - T::one())",
        "self.band_rad_s * (T::one() - T::two() * share)",
        SUPERVISOR,
    ),
    fault(
        "a rest is ended while a converter is stuck",
        STEP,
        "let cured = o.valid && !o.clipped && state.repeats < STUCK;",
        "let cured = o.valid && !o.clipped && state.repeats <= STUCK;",
        SUPERVISOR,
    ),
    fault(
        "a phase is asked for before there was operation",
        BUILT,
        "let was_in_operation = in_operation(state.supervisor.mode);",
        "let was_in_operation = true;",
        JOINED,
    ),
    fault(
        "a fault makes the count mean nothing",
        "instrument/src/continuity.rs",
        "self.counting |= sight.in_operation;",
        "self.counting = sight.in_operation;",
        INSTRUMENT,
    ),
    fault(
        "a beat from before the sweep is heard after it",
        BUILT,
        "        if !matches!(state.supervisor.mode, Mode::Listen) {\n            state.beat = Beat::default();\n        }\n",
        "",
        JOINED,
    ),
    fault(
        "an ellipticity of one sense is at work",
        "calibrator/src/window.rs",
        "if !q.within(T::from_f64(0.3))",
        "if !(q <= T::from_f64(0.3))",
        CALIBRATOR,
    ),
    fault(
        "the mechanics are seen half a step too far",
        "calibrator/src/window.rs",
        "let (cos_2, sin_2) = (cos_2 - x * sin_2, sin_2 + x * cos_2);",
        "let (cos_2, sin_2) = (cos_2 + x * sin_2, sin_2 - x * cos_2);",
        CALIBRATOR,
    ),
    fault(
        "a phase may be far from every other",
        "calibrator/src/correction.rs",
        "(z.re - target).within(T::from_f64(reach)) && z.im.within(T::from_f64(reach))",
        "(z.re - target).within(T::from_f64(reach))",
        CALIBRATOR,
    ),
    fault(
        "a cubic goes with the amplitude and not with its square",
        "calibrator/src/correction.rs",
        "let cubic = get(&self.known, Parameter::Cubic) * per_amplitude.squared();",
        "let cubic = get(&self.known, Parameter::Cubic) * per_amplitude;",
        CALIBRATOR,
    ),
    fault(
        "the phase of a skew stays in the drives",
        "calibrator/src/correction.rs",
        "xy: Complex::real((xx * m.xy - m.yy.times(turn)).re),",
        "xy: xx * m.xy - m.yy.times(turn),",
        CALIBRATOR,
    ),
    fault(
        "the fast precession lasts a stage longer",
        "calibrator/src/schedule.rs",
        "} else if stage < 2 {",
        "} else if stage <= 2 {",
        CALIBRATOR,
    ),
    fault(
        "a logarithm has a wrong term",
        "calibrator/src/window.rs",
        "(r(1, 3) + z2 * (r(1, 5)",
        "(r(1, 3) + z2 * (r(1, 6)",
        CALIBRATOR,
    ),
    fault(
        "the opposite of nothing is at the other end",
        "model/src/pendulum.rs",
        "if theta > T::zero() { theta - pi } else { theta + pi }",
        "if theta >= T::zero() { theta - pi } else { theta + pi }",
        MODEL,
    ),
    fault(
        "an end of infinity is nothing",
        "model/src/scalar.rs",
        "if limit >= T::zero() && value > limit {",
        "if limit >= T::zero() && value > limit && value.is_finite() {",
        SCALAR,
    ),
    fault(
        "a lock that was not found is a spin-up in C",
        "capi/src/lib.rs",
        "Fault::NoLock => cvg_fault::CVG_NO_LOCK,",
        "Fault::NoLock => cvg_fault::CVG_NO_SPIN_UP,",
        C,
    ),
    fault(
        "a hold is a ring-down in C",
        "capi/src/lib.rs",
        "Mode::Hold => cvg_mode::CVG_HOLD,",
        "Mode::Hold => cvg_mode::CVG_RING_DOWN,",
        C,
    ),
    fault(
        "what is heard and how long is swept are exchanged in C",
        "capi/src/lib.rs",
        "detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout.get",
        "detection_threshold_v: s.sweep_s,\n        sweep_s: s.detection_threshold_v,\n        readout: readout.get",
        C,
    ),
    fault(
        "as many readout effects as of the drives are undone in C",
        "capi/src/lib.rs",
        "readout: readout.get(..read)",
        "readout: readout.get(..actuated)",
        C,
    ),
    fault(
        "requests of a hold and a ring-down are exchanged in C",
        "capi/src/lib.rs",
        "[RequestedMode::WholeAngle, RequestedMode::Hold, RequestedMode::RingDown, RequestedMode::Off]",
        "[RequestedMode::WholeAngle, RequestedMode::RingDown, RequestedMode::Hold, RequestedMode::Off]",
        C,
    ),
    fault(
        "the energy in C is that of the readout",
        "capi/src/lib.rs",
        "state.seen.compensated.pendulum()",
        "state.seen.readout.pendulum()",
        C,
    ),
    fault(
        "an instrument without a state is an instrument in C",
        "capi/src/lib.rs",
        "Ok(_) if instrument.is_null() || state.is_null() => {",
        "Ok(_) if instrument.is_null() && state.is_null() => {",
        C,
    ),
    fault(
        "a disturbed step is learned from in C",
        "capi/src/calibrator.rs",
        "if control.disturbed { Health::Disturbed }",
        "if !control.disturbed { Health::Disturbed }",
        LEARNING,
    ),
    fault(
        "the commands of the learning are exchanged in C",
        "capi/src/calibrator.rs",
        "precession_v: k.v_qs, quadrature_v: k.v_qc",
        "precession_v: k.v_qc, quadrature_v: k.v_qs",
        LEARNING,
    ),
    fault(
        "what is fed forward is exchanged in C",
        "capi/src/calibrator.rs",
        "Added { v_qs: f.precession_v, v_qc: f.quadrature_v,",
        "Added { v_qs: f.quadrature_v, v_qc: f.precession_v,",
        LEARNING,
    ),
    fault(
        "the delays of readout and drive are exchanged in C",
        "capi/src/lib.rs",
        "readout_delay_s: s.readout_delay_s,\n        drive_delay_s: s.drive_delay_s,\n        amplitude_v: s.amplitude_v,\n        drive_per_s_v: s.drive_per_s_v,\n        energy: tuning(s.energy),\n        quadrature: tuning(s.quadrature),\n        phase: tuning(s.phase),\n        rate: tuning(s.rate),\n        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout.get",
        "readout_delay_s: s.drive_delay_s,\n        drive_delay_s: s.readout_delay_s,\n        amplitude_v: s.amplitude_v,\n        drive_per_s_v: s.drive_per_s_v,\n        energy: tuning(s.energy),\n        quadrature: tuning(s.quadrature),\n        phase: tuning(s.phase),\n        rate: tuning(s.rate),\n        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout.get",
        C,
    ),
    fault(
        "an angle in C is in single precision",
        "capi/src/lib.rs",
        "map_or(0.0, SingleState::angle_deg)",
        "map_or(0.0, |s| f64::from(s.angle_deg() as f32))",
        C,
    ),
    fault(
        "the sample's channels are exchanged in C",
        "capi/src/lib.rs",
        "instrument.step(state, adc_x, adc_y)",
        "instrument.step(state, adc_y, adc_x)",
        C,
    ),
    fault("the quadrature in C is that of R", "capi/src/lib.rs", "quadrature: p.q,", "quadrature: p.r,", C),
    fault(
        "no state is an angle of no number in C",
        "capi/src/lib.rs",
        "map_or(0.0, SingleState::angle_deg)",
        "map_or(f64::NAN, SingleState::angle_deg)",
        C,
    ),
];
