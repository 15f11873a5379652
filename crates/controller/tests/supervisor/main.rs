//! The supervisor window by window: what each mode command, what ends it, after exactly how many windows, and on which
//! side of each bound the bound itself lies. Here are the instrument and the windows of which the tests speak.

mod endings;
mod interruptions;
mod operation;
mod settings;
mod start;
mod table;

use cvg_controller::supervisor::{Beat, LoopCommand, Observation};
use cvg_controller::{Fault, Mode, RequestedMode, Supervisor, SupervisorSettings, SupervisorState};
use cvg_model::Pendulum;

/// Set energy, V²: the amplitude of 5 V squared.
const SET_2: f64 = 25.0;
/// The least energy with which the drives may run: a quarter of the 0.5 V squared that is heard.
const LEAST: f64 = 0.0625;

/// Times of the settings, in windows.
const LISTEN: u32 = 5;
const SWEEP: u32 = 4;
const LOCK: u32 = 30;
const SPIN_UP: u32 = 45;
const COAST: u32 = 6;
const ENDURE: u32 = 7;
const REST: u32 = 9;
const FORGET: u32 = 11;
/// By so much a rest is longer after too many starts; the number that the book gives.
const LONG_REST: u32 = 64;
/// Windows in a row that make a lock or a spin-up, and that show a converter to be stuck.
const IN_A_ROW: u32 = 20;
const WINDOW_S: f64 = 0.25;

const RUN: LoopCommand<f64> = LoopCommand::Run { hold: false, ring_down: false };
const RUN_HELD: LoopCommand<f64> = LoopCommand::Run { hold: true, ring_down: false };
const RUN_DOWN: LoopCommand<f64> = LoopCommand::Run { hold: true, ring_down: true };

fn settings() -> SupervisorSettings {
    let windows = |n: u32| f64::from(n) * WINDOW_S;
    SupervisorSettings {
        window_s: WINDOW_S,
        amplitude_v: 5.0,
        detection_threshold_v: 0.5,
        band_rad_s: 100.0,
        sweep_s: windows(SWEEP),
        sweeps: 3,
        listen_s: windows(LISTEN),
        lock_s: windows(LOCK),
        spin_up_s: windows(SPIN_UP),
        coast_s: windows(COAST),
        fault_debounce_s: windows(ENDURE),
        rest_s: windows(REST),
        retries: 2,
        fault_memory_s: windows(FORGET),
    }
}

fn supervisor() -> Supervisor<f64> {
    Supervisor::new(&settings()).expect("valid")
}

/// The state in `mode` after so many windows of it.
fn in_mode(mode: Mode, windows: u32) -> SupervisorState {
    let requested = match mode {
        Mode::Hold => RequestedMode::Hold,
        Mode::RingDown => RequestedMode::RingDown,
        _ => RequestedMode::WholeAngle,
    };
    SupervisorState { mode, requested, windows, ..SupervisorState::default() }
}

/// A line at the set amplitude, off the axes and in phase.
fn well() -> Observation<f64> {
    energy(SET_2)
}

/// The same line with another energy.
fn energy(e: f64) -> Observation<f64> {
    let pendulum = Pendulum { e, q: 0.0, r: 0.6 * e, s: 0.8 * e, l: 0.0 };
    Observation { pendulum, valid: true, clipped: false, repeats: false, jumped: false }
}

fn with(change: impl Fn(&mut Pendulum<f64>)) -> Observation<f64> {
    let mut o = well();
    change(&mut o.pendulum);
    o
}

fn invalid() -> Observation<f64> {
    Observation { valid: false, ..well() }
}

/// The state and the command after one window.
fn step(mut state: SupervisorState, o: &Observation<f64>) -> (SupervisorState, LoopCommand<f64>) {
    let command = supervisor().step(&mut state, o, None);
    (state, command)
}

/// The same while listening, with what was heard.
fn hear(mut state: SupervisorState, x2: f64, y2: f64) -> (SupervisorState, LoopCommand<f64>) {
    let command = supervisor().step(&mut state, &well(), Some(Beat { x2, y2, windows: 8 }));
    (state, command)
}

/// What one window in a mode leads to.
fn becomes(before: SupervisorState, o: &Observation<f64>) -> (Mode, Option<Fault>, LoopCommand<f64>) {
    let (after, command) = step(before, o);
    (after.mode, after.fault_now(), command)
}

const fn fault(fault: Fault) -> (Mode, Option<Fault>, LoopCommand<f64>) {
    (Mode::Fault, Some(fault), LoopCommand::Rest)
}
