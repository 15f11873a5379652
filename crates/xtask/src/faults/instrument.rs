//! Faults of what joins them: the step, the short way of nearly every window, half turns, settings.

use super::{Fault, fault};

const OPEN_LOOP: (&str, &str) = ("cvg-instrument", "open_loop");
const JOINED: (&str, &str) = ("cvg-instrument", "composition");
const SHORT_WAY: (&str, &str) = ("cvg-instrument", "--lib");

const STEP: &str = "instrument/src/step.rs";

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "a converter that is stuck is not seen in a hold",
        STEP,
        "let usual = window.clipped == 0 && now[0]",
        "let usual = state.supervisor.mode == Mode::Hold || window.clipped == 0 && now[0]",
        OPEN_LOOP,
    ),
    fault(
        "a converter that is stuck is seen only with the other",
        STEP,
        "now[0] != state.fingerprint[0] && now[1] != state.fingerprint[1]",
        "(now[0] != state.fingerprint[0] || now[1] != state.fingerprint[1])",
        OPEN_LOOP,
    ),
    fault("windows are compared with the first of all", STEP, "        state.fingerprint = now;\n", "", SHORT_WAY),
    fault(
        "a hold does not integrate",
        STEP,
        "        if HOLD {\n            state.rate = rate;\n        }\n",
        "",
        OPEN_LOOP,
    ),
    fault(
        "the detuning that was found is not kept",
        STEP,
        "(state.energy, state.quadrature, state.lock, state.precession) = (energy, quadrature, lock, precession);",
        "(state.energy, state.quadrature, state.precession) = (energy, quadrature, precession);\n        let _ = lock;",
        JOINED,
    ),
    fault(
        "the delay is undone backwards in one drive",
        STEP,
        "y_s: f.y_s * cos - f.y_c * sin,",
        "y_s: f.y_s * cos + f.y_c * sin,",
        OPEN_LOOP,
    ),
    fault(
        "the delay is undone without the detuning",
        STEP,
        "let more = correction_rad_s * self.delay_s;",
        "let more = T::zero() * correction_rad_s * self.delay_s;",
        JOINED,
    ),
    fault(
        "the second output has no limit",
        STEP,
        "if x.within(self.dac_limit_v) && y.within(self.dac_limit_v)",
        "if x.within(self.dac_limit_v)",
        OPEN_LOOP,
    ),
    fault(
        "the last window's drives are put out",
        STEP,
        "let (x, y) = self.put_out(&drive, cos, sin);",
        "let (x, y) = self.put_out(&state.drive.clone(), sin, cos);\n        let _ = drive;",
        SHORT_WAY,
    ),
    fault(
        "windows of the short way are not counted",
        STEP,
        "        state.windows = state.windows.wrapping_add(1);\n        state.phasor = phasor;",
        "        state.phasor = phasor;",
        OPEN_LOOP,
    ),
    fault("a pattern that jumps has moved", STEP, "jumped: moved == Movement::Jumped }", "jumped: false }", JOINED),
    fault(
        "the short way takes back that half turns may be lost",
        STEP,
        "half_turns_lost: state.status.half_turns_lost,",
        "half_turns_lost: false,",
        SHORT_WAY,
    ),
    fault(
        "the short way forgets to count a window of its mode",
        STEP,
        "        state.supervisor.count();\n",
        "",
        SHORT_WAY,
    ),
    fault(
        "the direction is not led ahead",
        STEP,
        "let then = self.precession.ahead(&precession, &now);",
        "let then = now;",
        JOINED,
    ),
    fault(
        "a hold takes the free pattern's way",
        STEP,
        "match self.steadily::<true>(state, &e",
        "match self.steadily::<false>(state, &e",
        OPEN_LOOP,
    ),
    fault(
        "half turns are doubted until the next window only",
        "instrument/src/continuity.rs",
        "if self.counting && !self.lost {",
        "if self.counting {",
        OPEN_LOOP,
    ),
    fault(
        "half turns are doubted a window late",
        "instrument/src/continuity.rs",
        "self.unseen > most_unseen",
        "self.unseen > most_unseen + 1",
        OPEN_LOOP,
    ),
    fault(
        "windows that show nothing are not counted as unseen",
        "instrument/src/continuity.rs",
        "self.unseen = if sight.valid && sight.clear { 0 }",
        "self.unseen = if sight.clear { 0 }",
        OPEN_LOOP,
    ),
    fault(
        "a phase that jumped is no gap",
        "instrument/src/continuity.rs",
        "                || !in_phase();",
        "                ; let _ = in_phase;",
        OPEN_LOOP,
    ),
    fault(
        "a fault keeps the half turns",
        "instrument/src/continuity.rs",
        "            || sight.in_fault\n",
        "",
        OPEN_LOOP,
    ),
    fault(
        "the output's hold has no middle",
        "instrument/src/settings.rs",
        "let delay_s = s.readout_delay_s + s.drive_delay_s + 0.5 * period_s;",
        "let delay_s = s.readout_delay_s + s.drive_delay_s;",
        OPEN_LOOP,
    ),
    fault(
        "the lead of the direction is that of half a window less",
        "instrument/src/settings.rs",
        "let hold_s = 0.5 * window_s;",
        "let hold_s = 0.0 * window_s;",
        JOINED,
    ),
    fault(
        "what a recording's clock told is compensated",
        "instrument/src/settings.rs",
        "readout.iter().any(|(id, _)| id.in_time())",
        "readout.iter().take(1).any(|(id, _)| id.in_time())",
        OPEN_LOOP,
    ),
    fault(
        "a periodic disturbance is told by no clock",
        "model/src/effects/time_periodic.rs",
        "const IN_TIME: bool = true;",
        "const IN_TIME: bool = false;",
        OPEN_LOOP,
    ),
];
