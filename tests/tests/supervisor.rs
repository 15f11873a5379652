//! The supervisor under any sequence of observations: it ends in operation or in a fault with a name, counts what it saw,
//! and finds back once all is as it should be.

use cvg_controller::supervisor::{Beat, Observation};
use cvg_controller::{Mode, Supervisor, SupervisorSettings, SupervisorState};
use cvg_model::Pendulum;
use proptest::prelude::*;

const WINDOW_S: f64 = 0.25;
/// Windows of the settings.
const LISTEN: u32 = 5;
const SWEEP: u32 = 4;
const LOCK: u32 = 30;
const SPIN_UP: u32 = 45;
const COAST: u32 = 6;
const ENDURE: u32 = 7;
const REST: u32 = 9;
const FORGET: u32 = 60;
/// By so much a rest is longer after too many starts; the number that the book gives.
const LONG_REST: u32 = 64;
const SWEEPS: u8 = 3;
/// Windows of a start: twice each mode's longest time, with each sweep twice as long as the last.
const BUDGET: u32 = 2 * ((1 + SWEEPS as u32) * LISTEN + (1 + 2 + 4) * SWEEP + LOCK + SPIN_UP + COAST);

fn supervisor() -> Supervisor<f64> {
    let windows = |n: u32| f64::from(n) * WINDOW_S;
    Supervisor::new(&SupervisorSettings {
        window_s: WINDOW_S,
        amplitude_v: 1.0,
        detection_threshold_v: 0.05,
        band_rad_s: 100.0,
        sweep_s: windows(SWEEP),
        sweeps: SWEEPS,
        listen_s: windows(LISTEN),
        lock_s: windows(LOCK),
        spin_up_s: windows(SPIN_UP),
        coast_s: windows(COAST),
        fault_debounce_s: windows(ENDURE),
        rest_s: windows(REST),
        retries: 2,
        fault_memory_s: windows(FORGET),
    })
    .expect("inside its domain")
}

fn starting(mode: Mode) -> bool {
    matches!(mode, Mode::Listen | Mode::Sweep | Mode::Lock | Mode::SpinUp | Mode::Coast)
}

fn well() -> Observation<f64> {
    let pendulum = Pendulum { e: 1.0, q: 0.0, r: 0.6, s: 0.8, l: 0.0 };
    Observation { pendulum, valid: true, clipped: false, repeats: false, jumped: false }
}

const HEARD: Beat<f64> = Beat { x2: 4.0, y2: 4.0, windows: 1 };
const SILENCE: Beat<f64> = Beat { x2: 0.0, y2: 0.0, windows: 1 };

prop_compose! {
    /// What a window may show: amplitudes, phases and orbits near each bound, and now and then a blemish.
    fn seen()(
        e in prop::sample::select(vec![0.0, 1e-4, 6e-4, 0.01, 0.2, 0.26, 0.9, 1.0, 1.1, 2.3, 100.0, f64::NAN]),
        l in prop::sample::select(vec![0.0, 0.0, 0.0, 0.19, 0.4, 0.6, -0.9]),
        q in prop::sample::select(vec![0.0, 0.0, 0.0, 0.09, 0.3, -0.6]),
        on_axis in prop::bool::weighted(0.1),
        blemish in prop::array::uniform4(prop::bool::weighted(0.03)),
    ) -> Observation<f64> {
        let (r, s) = if on_axis { (e, 0.0) } else { (0.6 * e, 0.8 * e) };
        let [spoilt, clipped, repeats, jumped] = blemish;
        Observation { pendulum: Pendulum { e, q: q * e, r, s, l: l * e }, valid: !spoilt, clipped, repeats, jumped }
    }
}

/// What each mode is shown: the sequence that keeps a start going is not the same in all of them.
fn script() -> impl Strategy<Value = Vec<Vec<(Observation<f64>, bool)>>> {
    let of_mode = prop::collection::vec((prop_oneof![seen(), Just(well())], any::<bool>()), 1..8);
    prop::collection::vec(of_mode, 6)
}

/// The next observation of the script, which repeats itself.
fn shown(script: &[Vec<(Observation<f64>, bool)>], state: &SupervisorState, k: usize) -> (Observation<f64>, bool) {
    let mode = match state.mode {
        Mode::Listen => 0,
        Mode::Sweep => 1,
        Mode::Lock => 2,
        Mode::SpinUp => 3,
        Mode::Coast => 4,
        _ => 5,
    };
    script[mode][k % script[mode].len()]
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    //= specs/dsp.md#start-budget
    //= type=test
    //# A start MUST end in operation or in a fault with a name within its budget of windows whatever is observed.
    #[test]
    fn prop_a_start_ends_within_its_budget_whatever_is_shown(script in script(), trying: u32) {
        let supervisor = supervisor();
        let mut state = SupervisorState { trying: trying % (2 * BUDGET), ..SupervisorState::default() };
        let mut of_start = 0;
        for k in 0..6 * BUDGET as usize {
            let (o, heard) = shown(&script, &state, k);
            supervisor.step(&mut state, &o, Some(if heard { HEARD } else { SILENCE }));
            of_start = if starting(state.mode) { of_start + 1 } else { 0 };
            prop_assert!(of_start <= BUDGET, "{state:?}");
            prop_assert!(state.mode != Mode::Fault || state.fault.is_some());
        }
    }

    //= specs/dsp.md#faults-cannot-be-walked-around
    //= type=test
    //# A window out of bounds MUST be counted until a fault is named, rest is requested, or all was well for the time that is endured.
    #[test]
    fn prop_what_is_out_of_bounds_more_often_than_is_endured_is_a_fault(
        e in 2.3..1e3_f64, gaps in prop::collection::vec(0..ENDURE, 1..9), clipped: bool,
    ) {
        let supervisor = supervisor();
        let mut bad = well();
        if clipped { bad.clipped = true } else { bad.pendulum.e = e }
        let mut state = SupervisorState { mode: Mode::WholeAngle, ..SupervisorState::default() };
        for count in 1..=ENDURE {
            prop_assert_eq!(state.mode, Mode::WholeAngle);
            supervisor.step(&mut state, &bad, None);
            prop_assert!(clipped || state.bad == count || state.mode == Mode::Fault);
            // as many well ones in a row as are not enough to forget
            for _ in 1..gaps[count as usize % gaps.len()] {
                supervisor.step(&mut state, &well(), None);
            }
        }
        prop_assert!(state.fault_now().is_some(), "{state:?}");
    }

    //= specs/dsp.md#way-back
    //= type=test
    //# From every fault the instrument MUST be in operation within its longest rest and its shortest start once all that it observes is as it should be.
    #[test]
    fn prop_from_every_fault_the_way_back_has_a_longest_time(script in script(), windows in 0..3 * BUDGET as usize) {
        let supervisor = supervisor();
        let mut state = SupervisorState::default();
        for k in 0..windows {
            let (o, heard) = shown(&script, &state, k);
            supervisor.step(&mut state, &o, Some(if heard { HEARD } else { SILENCE }));
        }
        // then nothing but windows of an instrument that is well, at most till the budget and on to the longest rest
        let most = BUDGET + LONG_REST * REST + LISTEN + 45;
        let back = (0..most).any(|_| {
            supervisor.step(&mut state, &well(), Some(HEARD));
            state.mode == Mode::WholeAngle
        });
        prop_assert!(back, "{state:?}");
    }
}
