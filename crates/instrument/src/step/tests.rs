//! The way of nearly every window is a short cut: it has to leave what the way of all windows leaves, to the last bit.

extern crate std;

use cvg_controller::RequestedMode;
use cvg_estimator::Phasor;
use cvg_model::Orbit;
use cvg_model::effects::{EffectId, Values};
use proptest::prelude::*;

use super::*;
use crate::Settings;

/// Readout effects in forms, in none, and in both.
const READOUTS: [&[(EffectId, Values<f64>)]; 4] = [
    &[],
    &[(EffectId::DetectionGainMismatch, [1.0132, 0.0, 0.0, 0.0]), (EffectId::DetectionCubic, [0.004, 0.0, 0.0, 0.0])],
    &[(EffectId::DetectionCubic, [0.08, 0.01, 0.0, 0.0]), (EffectId::DetectionOffset, [0.01, -0.02, 0.0, 0.0])],
    &[(EffectId::AngleLatency, [1e-3, 0.0, 0.0, 0.0]), (EffectId::DetectionSkew, [0.02, 0.0, 0.0, 0.0])],
];
const ACTUATIONS: [&[(EffectId, Values<f64>)]; 3] = [
    &[],
    &[(EffectId::ActuationGainMismatch, [1.0113, 0.0, 0.0, 0.0])],
    &[(EffectId::ActuationSkew, [0.02, 0.0, 0.0, 0.0]), (EffectId::ActuationPhase, [0.1, 0.0, 0.0, 0.0])],
];

/// What a window may find.
#[derive(Clone, Copy, Debug)]
struct Case {
    settings: (usize, usize),
    mode: (Mode, RequestedMode),
    orbit: Orbit<f64>,
    /// the phase at which the window begins, rad
    phase: f64,
    /// how far the pattern has turned since the last window, rad, and its low-passed sin 2Δθ
    turned: (f64, f64),
    /// integral parts: energy, quadrature, rate, detuning
    integrals: [f64; 4],
    /// windows in this mode; what was out of bounds, repeated, clipped; starts
    counts: [u32; 5],
    /// a converter repeats itself
    repeats: bool,
    /// half turns may be lost
    lost: bool,
}

fn instrument<T: Float>(case: &Case) -> Instrument<T> {
    let settings =
        Settings { readout: READOUTS[case.settings.0], actuation: ACTUATIONS[case.settings.1], ..Settings::default() };
    Instrument::new(&settings).expect("settings within their domain")
}

/// The state before the last sample of a window is finished, and that sample with its phase.
fn prepared<T: Float>(i: &Instrument<T>, case: &Case) -> (State<T>, [T; 4]) {
    let t = T::from_f64;
    let mut state = i.start();
    // the count of control steps comes round
    state.windows = u32::MAX;
    (state.supervisor.mode, state.supervisor.requested) = case.mode;
    let [windows, bad, repeats, clipped, starts] = case.counts;
    (state.supervisor.windows, state.supervisor.bad) = (windows, bad);
    (state.supervisor.repeats, state.supervisor.clipped) = (repeats, clipped);
    state.supervisor.starts = u8::try_from(starts).expect("few");
    state.continuity = Continuity { unseen: clipped, counting: true, lost: case.lost };
    state.status.half_turns_lost = case.lost;
    let [energy, quadrature, rate, detuning] = case.integrals.map(t);
    (state.energy.integral, state.quadrature.integral, state.rate.integral) = (energy, quadrature, rate);
    state.lock.detuning_rad_s = detuning;
    let before = 2.0 * (case.orbit.theta - case.turned.0);
    (state.precession.cos_2, state.precession.sin_2) = (t(before.cos()), t(before.sin()));
    state.precession.sin_2_per_window = t(case.turned.1);
    state.phasor = Phasor { cos: t(case.phase.cos()), sin: t(case.phase.sin()), ..state.phasor };
    state.window = Window::begin(&state.phasor);
    let e = case.orbit.envelope();
    let (x_c, x_s, y_c, y_s) = (t(e.x_c), t(e.x_s), t(e.y_c), t(e.y_s));
    loop {
        let now = state.phasor;
        let (mut x, mut y) = (x_c * now.cos + x_s * now.sin, y_c * now.cos + y_s * now.sin);
        if !i.demodulator.takes(x, y) {
            (x, y) = i.demodulator.admit(&mut state.window, x, y);
        }
        let full = i.demodulator.add(&mut state.window, x, y, &now);
        state.phasor.advance();
        if full {
            if case.repeats {
                state.fingerprint = [state.window.x, t(0.1), x, t(0.2)];
            }
            return (state, [x, y, now.cos, now.sin]);
        }
    }
}

/// Both ways; whether the short one was taken.
fn compare<T: Float>(case: &Case) -> Result<bool, TestCaseError> {
    let i = instrument::<T>(case);
    let (state, [x, y, cos, sin]) = prepared(&i, case);
    let (mut short, mut long) = (state, state);
    let said = (i.last(&mut short, x, y, cos, sin), i.end_window_suspect(&mut long, x, y, cos, sin));
    prop_assert_eq!(said.0, said.1);
    prop_assert_eq!(short, long);
    prop_assert_eq!(short.windows, 0);
    prop_assert_eq!(short.window, Window::begin(&short.phasor));
    // the bits, but for the sign of zero
    let words = |s: &State<T>| std::format!("{s:?}").replace("-0.0,", "0.0,");
    prop_assert_eq!(words(&short), words(&long));
    let mut again = state;
    let (e, p) = (short.seen.compensated, short.seen.compensated.pendulum());
    let undisturbed = short.status.valid && !short.status.clipped && !case.repeats;
    Ok(undisturbed
        && i.supervisor.runs_unchanged(&state.supervisor, &p)
        && match case.mode.0 {
            mode if mode == i.shortest => i.steadily::<false>(&mut again, &e, &p, cos, sin).is_some(),
            _ => i.steadily::<true>(&mut again, &e, &p, cos, sin).is_some(),
        })
}

fn both_precisions(case: &Case) -> Result<(), TestCaseError> {
    compare::<f32>(case)?;
    compare::<f64>(case)?;
    Ok(())
}

/// A case in operation, and shares in [−1, 1] that make it another.
fn calm(theta: f64) -> Case {
    Case {
        settings: (0, 0),
        mode: (Mode::WholeAngle, RequestedMode::WholeAngle),
        orbit: Orbit { a: 1.0, q: 1e-3, theta, delta: 1e-3 },
        phase: 0.4,
        turned: (2e-3, 3e-3),
        integrals: [-0.01, 0.001, 0.0, 3.0],
        counts: [1000, 0, 0, 0, 0],
        repeats: false,
        lost: false,
    }
}

prop_compose! {
    fn case()(
        settings in (0..READOUTS.len(), 0..ACTUATIONS.len()),
        mode in prop::sample::select(std::vec![
            (Mode::WholeAngle, RequestedMode::WholeAngle), (Mode::WholeAngle, RequestedMode::WholeAngle), (Mode::Hold, RequestedMode::Hold),
            (Mode::WholeAngle, RequestedMode::Hold), (Mode::SpinUp, RequestedMode::WholeAngle), (Mode::Lock, RequestedMode::WholeAngle),
            (Mode::Listen, RequestedMode::WholeAngle), (Mode::RingDown, RequestedMode::RingDown), (Mode::Fault, RequestedMode::Off),
        ]),
        theta in -3.1_f64..3.1,
        // now and then far from a line of the set amplitude, now and then far from the last window
        a in prop_oneof![4 => 0.8_f64..1.2, 1 => 0.0_f64..3.0],
        round in prop_oneof![4 => -0.01_f64..0.01, 1 => -1.0_f64..1.0],
        delta in prop_oneof![4 => -0.01_f64..0.01, 1 => -1.5_f64..1.5],
        phase in -3.1_f64..3.1,
        turned in (
            prop_oneof![4 => -0.01_f64..0.01, 1 => -1.6_f64..1.6],
            prop_oneof![4 => -0.02_f64..0.02, 1 => -1.0_f64..1.0],
        ),
        integrals in prop_oneof![4 => prop::array::uniform4(-0.01_f64..0.01), 1 => prop::array::uniform4(-1e4_f64..1e4)],
        counts in prop_oneof![
            4 => Just([1000, 0, 0, 0, 0]),
            1 => prop::array::uniform5(0_u32..2),
            1 => prop::array::uniform5(0_u32..255).prop_map(|c| [19_900 + c[0], c[1] / 200, c[2] / 200, c[3] / 200, c[4] % 3]),
        ],
        repeats in prop::bool::weighted(0.05),
        lost: bool,
    ) -> Case {
        let orbit = Orbit { a, q: round * a, theta, delta };
        Case { settings, mode, orbit, phase, turned, integrals, counts, repeats, lost }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn the_short_way_leaves_what_the_long_way_leaves(case in case()) {
        both_precisions(&case)?;
    }
}

#[test]
fn the_short_way_is_that_of_nearly_every_window() -> Result<(), TestCaseError> {
    let mut short = 0;
    for k in 0..360 {
        let theta = (0.5 + f64::from(k)).to_radians();
        for settings in [(0, 0), (1, 1), (2, 1), (3, 0), (1, 2)] {
            let case = Case { settings, ..calm(theta) };
            short += usize::from(compare::<f32>(&case)?) + usize::from(compare::<f64>(&case)?);
        }
        // at the angle at which it is held
        let held = Case { mode: (Mode::Hold, RequestedMode::Hold), ..calm(0.01 * theta) };
        short += usize::from(compare::<f32>(&held)?) + usize::from(compare::<f64>(&held)?);
    }
    // but where the pattern crosses the R axis
    assert!(short > 4320 * 95 / 100, "{short} of 4320");
    Ok(())
}

#[test]
fn what_is_amiss_takes_the_long_way() -> Result<(), TestCaseError> {
    let well = calm(0.3);
    assert!(compare::<f32>(&well)?);
    let amiss = [
        Case { repeats: true, ..well },
        Case { orbit: Orbit { a: 0.4, ..well.orbit }, ..well },
        Case { orbit: Orbit { a: 1.6, ..well.orbit }, ..well },
        Case { orbit: Orbit { a: 2.6, ..well.orbit }, ..well },
        Case { orbit: Orbit { q: 0.6, ..well.orbit }, ..well },
        Case { orbit: Orbit { delta: 0.6, ..well.orbit }, ..well },
        Case { turned: (0.4, 0.0), ..well },
        Case { turned: (0.0, 0.9), ..well },
        Case { integrals: [1e3, 0.0, 0.0, 0.0], ..well },
        Case { integrals: [0.0, 1e3, 0.0, 0.0], ..well },
        Case { integrals: [0.0, 0.0, 0.0, 1e5], ..well },
        Case { counts: [1000, 1, 0, 0, 0], ..well },
        Case { counts: [30_000, 0, 0, 0, 1], ..well },
        Case { mode: (Mode::WholeAngle, RequestedMode::Hold), ..well },
        Case { mode: (Mode::SpinUp, RequestedMode::WholeAngle), ..well },
    ];
    for case in amiss {
        assert!(!compare::<f32>(&case)? && !compare::<f64>(&case)?, "{case:?}");
    }
    Ok(())
}

#[test]
fn a_channel_repeats_itself_where_its_sum_and_its_last_sample_are_those_of_the_last_window_and_not_nothing() {
    // sums of X and Y, last samples of X and Y
    let before = [1.5, -2.5, 0.5, -0.25];
    for (now, is) in [
        ([1.5, -3.0, 0.5, -0.5], true),
        ([2.0, -2.5, 1.0, -0.25], true),
        (before, true),
        // another last sample, or another sum
        ([1.5, -3.0, 0.75, -0.5], false),
        ([2.0, -2.5, 1.0, -0.5], false),
        ([2.0, -3.0, 0.5, -0.25], false),
        // of the other channel
        ([-2.5, 1.5, -0.25, 0.5], false),
    ] {
        assert_eq!(repeats(&now, &before), is, "{now:?}");
    }
    // nothing may be what is there; a sum of nothing is no silence
    assert!(!repeats(&[0.0; 4], &[0.0; 4]) && !repeats(&[0.0, 1.0, -0.0, 2.0], &[0.0, 3.0, 0.0, 4.0]));
    assert!(repeats(&[0.0, 1.0, 0.5, 2.0], &[0.0, 3.0, 0.5, 4.0]));
    assert!(!repeats(&[f64::NAN; 4], &[f64::NAN; 4]));
}
