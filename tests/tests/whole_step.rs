//! The instrument's step as one piece: what holds of the state before holds of it afterwards, and of the outputs it holds
//! whatever the state. The bounds are those of the book's page on the whole step, which says what each rests on.

use core::f64::consts::{FRAC_1_SQRT_2, TAU};

use cvg_controller::{ActuationCompensation, Allocation, Fault, OrbitCommands, Pi, PiState};
use cvg_estimator::{LockState, PhaseLock, Precession, PrecessionState};
use cvg_instrument::{Instrument, Mode, RequestedMode, Settings, State};
use cvg_model::effects::{EffectId, Values};
use cvg_model::{ControlOutputs, Envelope, Pendulum};
use cvg_tests::domain::patterns;
use cvg_tests::{Scalar, for_each_scalar};
use proptest::prelude::*;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const UNEVEN: &[(EffectId, Values<f64>)] = &[
    (EffectId::DetectionCubic, [0.05, 0.01, 0.0, 0.0]),
    (EffectId::DetectionGainMismatch, [1.0132, 0.0, 0.0, 0.0]),
    (EffectId::DetectionOffset, [0.01, -0.02, 0.0, 0.0]),
];
const LATE: &[(EffectId, Values<f64>)] =
    &[(EffectId::AngleLatency, [2e-3, 0.0, 0.0, 0.0]), (EffectId::DetectionSkew, [0.03, 0.0, 0.0, 0.0])];
const DRIVES: &[(EffectId, Values<f64>)] =
    &[(EffectId::ActuationGainMismatch, [1.0113, 0.0, 0.0, 0.0]), (EffectId::ActuationPhase, [0.2, 0.0, 0.0, 0.0])];

/// Windows long and short, a limit of the drives below the range of the readout and above it, with and without compensation.
fn settings(which: usize) -> Settings<'static> {
    let plain = Settings { sweep_s: 0.05, ..Settings::default() };
    match which {
        0 => plain,
        1 => Settings { window: 8, readout: UNEVEN, actuation: DRIVES, ..plain },
        2 => Settings { window: 37, dac_limit_v: 0.3, readout: LATE, ..plain },
        _ => Settings { window: 24, hold_rad: -0.2, adc_full_scale_v: 5.0, ..plain },
    }
}

/// The largest correction of the oscillator, rad/s: by 1.1 beyond the band.
fn most_rad_s(s: &Settings<'_>) -> f64 {
    1.1 * TAU * s.carrier_hz * s.band
}

/// What is out of its bounds, if anything is.
fn beyond<T: Scalar>(s: &Settings<'_>, state: &State<T>) -> Option<&'static str> {
    let near_one = |cos: T, sin: T| {
        let length_2 = cos.to_f64() * cos.to_f64() + sin.to_f64() * sin.to_f64();
        (0.9..=1.1).contains(&length_2)
    };
    let within = |values: &[T], most: f64| values.iter().all(|v| v.to_f64().abs() <= most);
    let (p, w, d, seen) = (&state.phasor, &state.window, &state.drive, &state.seen);
    // half a per mille for what rounds
    let volts = FRAC_1_SQRT_2 * s.dac_limit_v * 1.0005;
    let sums = f64::from(w.count) * s.adc_full_scale_v * 1.06;
    let t = &state.precession;
    let bounds = [
        ("the oscillator's length", near_one(p.cos, p.sin)),
        ("the length of its step", near_one(p.step_cos, p.step_sin)),
        ("samples in a window", w.count < u32::from(s.window)),
        ("sums of a window", within(&[w.x, w.y, w.mixed.x_c, w.mixed.x_s, w.mixed.y_c, w.mixed.y_s], sums)),
        // two phases turned into each other by a delay, of which the first order of the detuning is kept
        ("drives", within(&[d.x_c, d.x_s, d.y_c, d.y_s], 2.2 * volts)),
        ("commands", within(&[seen.v_as, seen.v_qc, seen.v_qs], volts)),
        ("integrators", within(&[state.energy.integral, state.quadrature.integral, state.rate.integral], f64::MAX)),
        ("the detuning", within(&[state.lock.detuning_rad_s, seen.correction_rad_s], most_rad_s(s) * 1.0005)),
        ("the precession", within(&[t.sin_2_per_window], 2.0)),
        ("the last direction", !t.is_directed() || near_one(t.cos_2, t.sin_2)),
        ("a fault without a name", state.supervisor.mode != Mode::Fault || state.supervisor.fault.is_some()),
    ];
    bounds.iter().find(|(_, holds)| !holds).map(|(name, _)| *name)
}

/// Whether what was commanded, and the oscillator's correction, are within their limits.
fn commands_are_bounded<T: Scalar>(s: &Settings<'_>, state: &State<T>) -> bool {
    let (seen, volts) = (&state.seen, FRAC_1_SQRT_2 * s.dac_limit_v * 1.0005);
    [seen.v_as, seen.v_qc, seen.v_qs].iter().all(|v| v.to_f64().abs() <= volts)
        && seen.correction_rad_s.to_f64().abs() <= most_rad_s(s) * 1.0005
}

/// Anything within the bounds; what has none is any bits.
fn anywhere_within<T: Scalar>(s: &Settings<'_>, dice: &mut ChaCha8Rng) -> State<T> {
    let mut state = Instrument::<T>::new(s).expect("inside its domain").start();
    let to = |dice: &mut ChaCha8Rng, most: f64| T::from_f64(dice.random_range(-most..=most));
    let turned = |dice: &mut ChaCha8Rng, angle: f64| {
        let length = dice.random_range(0.95..1.045);
        (T::from_f64(length * angle.cos()), T::from_f64(length * angle.sin()))
    };
    let any_angle = |dice: &mut ChaCha8Rng| dice.random_range(-4.0..4.0);
    let phase = any_angle(dice);
    (state.phasor.cos, state.phasor.sin) = turned(dice, phase);
    let step = (TAU * s.carrier_hz + dice.random_range(-1.0..=1.0) * most_rad_s(s)) / s.sample_hz;
    (state.phasor.step_cos, state.phasor.step_sin) = (T::from_f64(step.cos()), T::from_f64(step.sin()));

    state.window.count = dice.random_range(0..u32::from(s.window));
    let (sums, volts) = (f64::from(state.window.count) * s.adc_full_scale_v, FRAC_1_SQRT_2 * s.dac_limit_v);
    let (w, d, seen) = (&mut state.window, &mut state.drive, &mut state.seen);
    for sum in [&mut w.x, &mut w.y, &mut w.mixed.x_c, &mut w.mixed.x_s, &mut w.mixed.y_c, &mut w.mixed.y_s] {
        *sum = to(dice, sums);
    }
    let phase = any_angle(dice);
    w.start = turned(dice, phase);
    (w.invalid, w.clipped) = if dice.random() { (0, 0) } else { (dice.random(), dice.random()) };
    for drive in [&mut d.x_c, &mut d.x_s, &mut d.y_c, &mut d.y_s] {
        *drive = to(dice, 2.0 * volts);
    }
    for command in [&mut seen.v_as, &mut seen.v_qc, &mut seen.v_qs] {
        *command = to(dice, volts);
    }
    seen.correction_rad_s = to(dice, most_rad_s(s));
    state.lock.detuning_rad_s = to(dice, most_rad_s(s));
    let integral = |dice: &mut ChaCha8Rng| {
        let any = T::from_pattern(dice.next_u64());
        PiState { integral: if any.is_finite() { any } else { T::zero() } }
    };
    (state.energy, state.quadrature, state.rate) = (integral(dice), integral(dice), integral(dice));
    let theta = any_angle(dice);
    (state.precession.cos_2, state.precession.sin_2) = turned(dice, theta);
    state.precession.sin_2_per_window = to(dice, 2.0);
    state.precession.half_turns = dice.random();
    state.fingerprint = [(); 4].map(|()| T::from_pattern(dice.next_u64()));
    history(&mut state, dice);
    state
}

/// Modes and counts: any.
fn history<T: Scalar>(state: &mut State<T>, dice: &mut ChaCha8Rng) {
    let v = &mut state.supervisor;
    v.mode = Mode::ALL[dice.random_range(0..Mode::ALL.len())];
    v.fault = Some([Fault::InvalidSamples, Fault::NoLock, Fault::AmplitudeHigh][dice.random_range(0..3)]);
    v.requested = [RequestedMode::WholeAngle, RequestedMode::Hold, RequestedMode::RingDown, RequestedMode::Off]
        [dice.random_range(0..4)];
    let few = |dice: &mut ChaCha8Rng| dice.next_u32() >> dice.random_range(0..32_u32);
    (v.windows, v.good, v.bad) = (few(dice), few(dice), few(dice));
    (v.repeats, v.clipped, v.trying) = (few(dice), few(dice), few(dice));
    (v.sweeps, v.starts, v.coasts) = (dice.random(), dice.random(), dice.random());
    let c = &mut state.continuity;
    (c.unseen, c.counting, c.lost) = (few(dice), dice.random(), dice.random());
    state.windows = dice.random();
}

/// A vibration behind a converter of 16 bits, or its codes at random, or a channel that is stuck, or any bits.
fn sample<T: Scalar>(s: &Settings<'_>, kind: u8, k: usize, dice: &mut ChaCha8Rng) -> [T; 2] {
    let least = s.adc_full_scale_v / 32_768.0;
    let code = |dice: &mut ChaCha8Rng| T::from_f64(f64::from(dice.random::<i16>()) * least);
    let carrier = (TAU * s.carrier_hz / s.sample_hz * k as f64).cos() * s.amplitude_v;
    let read = |share: f64| T::from_f64((carrier * share / least).round() * least);
    match kind {
        0 => [read(0.8), read(-0.6)],
        1 => [code(dice), code(dice)],
        2 => [read(1.0), T::from_f64(s.adc_full_scale_v)],
        3 => [T::from_pattern(dice.next_u64()), T::from_pattern(dice.next_u64())],
        _ => [read(0.6), code(dice)],
    }
}

for_each_scalar! {
    //= specs/dsp.md#whole-step
    //= type=test
    //# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
    #[test]
    fn prop_a_step_keeps_the_state_within_its_bounds(which in 0_usize..4, kind in 0_u8..5, seed in any::<u64>()) {
        let (settings, mut dice) = (settings(which), ChaCha8Rng::seed_from_u64(seed));
        let instrument = Instrument::<T>::new(&settings).expect("inside its domain");
        let start = instrument.start();
        prop_assert_eq!(beyond(&settings, &start), None);
        let mut state: State<T> = anywhere_within(&settings, &mut dice);
        prop_assert_eq!(beyond(&settings, &state), None, "{:?}", state);
        for k in 0..3 * usize::from(settings.window) {
            let before = state;
            let [x, y] = sample(&settings, kind, k, &mut dice);
            instrument.step(&mut state, x, y);
            prop_assert_eq!(beyond(&settings, &state), None, "by {:?}, {:?} from {:?}", x, y, before);
            let passed = i64::from(state.precession.half_turns) - i64::from(before.precession.half_turns);
            prop_assert!(passed.abs() <= 1, "{passed} half turns from {before:?}");
            prop_assert!(state.continuity.lost || !before.continuity.lost, "forgotten: {before:?}");
        }
    }

    //= specs/dsp.md#whole-step
    //= type=test
    //# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
    /// What runs in every window comes back whatever it was: the oscillator, the window, the drives.
    #[test]
    fn prop_whatever_the_bits_the_carrier_is_back_after_two_windows(which in 0_usize..4, kind in 0_u8..5, seed in any::<u64>()) {
        let (settings, mut dice) = (settings(which), ChaCha8Rng::seed_from_u64(seed));
        let instrument = Instrument::<T>::new(&settings).expect("inside its domain");
        let mut state: State<T> = anywhere_within(&settings, &mut dice);
        let mut bits = || T::from_pattern(dice.next_u64());
        state.phasor = cvg_estimator::Phasor { cos: bits(), sin: bits(), step_cos: bits(), step_sin: bits() };
        (state.window.x, state.window.mixed.y_s, state.window.start) = (bits(), bits(), (bits(), bits()));
        (state.drive.x_c, state.drive.y_s) = (bits(), bits());
        state.window.count = dice.next_u32();
        let mut steps = 0;
        for k in 0..2 * usize::from(settings.window) {
            let [x, y] = sample(&settings, kind, k, &mut dice);
            let (dac_x, dac_y, status) = instrument.step(&mut state, x, y);
            let most = settings.dac_limit_v * (1.0 + 1e-7);
            prop_assert!(dac_x.to_f64().abs() <= most && dac_y.to_f64().abs() <= most, "{dac_x} V, {dac_y} V");
            steps += u32::from(status.fresh);
        }
        prop_assert!(steps >= 1, "no control step");
        prop_assert_eq!(beyond(&settings, &state), None, "{:?}", state);
    }

    //= specs/dsp.md#whole-step
    //= type=test
    //# The state at power-on MUST be within its bounds, and a step from a state within them MUST leave one within them.
    /// What loops and trackers remember may be anything: each control step, whatever it orders, commands no more than the limit
    /// and corrects the oscillator by no more than the band.
    #[test]
    fn prop_whatever_is_remembered_what_is_commanded_is_bounded(which in 0_usize..4, kind in 0_u8..5, seed in any::<u64>()) {
        let (settings, mut dice) = (settings(which), ChaCha8Rng::seed_from_u64(seed));
        let instrument = Instrument::<T>::new(&settings).expect("inside its domain");
        let mut state: State<T> = anywhere_within(&settings, &mut dice);
        let mut bits = || T::from_pattern(dice.next_u64());
        (state.energy.integral, state.quadrature.integral, state.rate.integral) = (bits(), bits(), bits());
        (state.lock.detuning_rad_s, state.seen.correction_rad_s) = (bits(), bits());
        (state.precession.cos_2, state.precession.sin_2, state.precession.sin_2_per_window) = (bits(), bits(), bits());
        for _ in 0..3 {
            state.beat.add(&Envelope::new(bits(), bits(), bits(), bits()));
        }
        for k in 0..3 * usize::from(settings.window) {
            let [x, y] = sample(&settings, kind, k, &mut dice);
            let (_, _, status) = instrument.step(&mut state, x, y);
            prop_assert!(!status.fresh || commands_are_bounded(&settings, &state), "{:?}", state);
        }
    }

    //= specs/dsp.md#short-way
    //= type=test
    //# The short way of nearly every control step MUST leave the state and the outputs that the way of all control steps leaves but for the sign of zero.
    /// The parts that have one, for any bits; `crates/instrument` compares the step itself.
    #[test]
    fn prop_the_short_way_of_a_part_leaves_what_its_step_leaves(
        v in prop::array::uniform8(patterns::<T>()), near in prop::array::uniform8(-1.0..1.0_f64), far in prop::array::uniform8(any::<bool>()),
    ) {
        // half of them any bits, half of them of a size that occurs
        let [a, b, c, d, e, q, r, l] = core::array::from_fn(|i| if far[i] { v[i] } else { T::from_f64(near[i]) });
        let t = T::from_f64;
        let pi = Pi::new(t(3.0), t(0.02), t(5e-4), t(1.5)).expect("inside its domain");
        let (mut short, mut long) = (PiState { integral: a }, PiState { integral: a });
        match pi.energy_within(&mut short, e, b) {
            Some(volts) => prop_assert_eq!((volts, short), (pi.energy(&mut long, e, b).volts, long)),
            None => prop_assert_eq!(word(&short), word(&long)),
        }
        let lock = PhaseLock::new(t(20.0), t(0.7), t(1e-3), t(5.0)).expect("inside its domain");
        let p = Pendulum { e, q, r, s: c, l };
        let (mut short, mut long) = (LockState { detuning_rad_s: b }, LockState { detuning_rad_s: b });
        match lock.step_within(&mut short, &p) {
            Some(rad_s) => prop_assert_eq!((rad_s, short), (lock.step(&mut long, &p).rad_s, long)),
            None => prop_assert_eq!(word(&short), word(&long)),
        }
        let tracker = Precession::new(5e-4, 8e-3, 35.0, 0.1, 3e-4, 1e-9).expect("inside its domain");
        let before = PrecessionState { cos_2: a, sin_2: b, sin_2_per_window: d, half_turns: 3 };
        let mut short = before;
        if !tracker.step_steadily(&mut short, &p) {
            prop_assert_eq!(word(&short), word(&before));
        }
        let drives = ActuationCompensation::new(&[(EffectId::ActuationGainMismatch, [t(1.02), t(0.0), t(0.0), t(0.0)])]);
        for inverse in [None, drives.ok()] {
            let allocation = Allocation::new(inverse, t(1.2)).expect("a limit");
            let (cos, sin) = (t(near[6]), t(near[7]));
            let short = allocation.axes_within(&ControlOutputs { v_as: a, v_qc: b }, cos, sin);
            let long = allocation.step(&OrbitCommands { v_as: a, v_qs: t(0.0), v_qc: b, v_ac: t(0.0) }, cos, sin);
            prop_assert_eq!(short, if long.status == cvg_controller::Status::Within { Some(long.volts) } else { None });
        }
    }
}

/// As text, in which what is no number equals itself.
fn word(state: &impl core::fmt::Debug) -> String {
    format!("{state:?}")
}

#[test]
fn bounds_that_are_too_tight_are_seen() {
    // the limits are those of what can happen: half of each is left by some state
    let (settings, mut dice) = (settings(0), ChaCha8Rng::seed_from_u64(1));
    let halved = Settings { dac_limit_v: 0.5 * settings.dac_limit_v, band: 0.5 * settings.band, ..settings };
    let instrument = Instrument::<f32>::new(&settings).expect("inside its domain");
    let mut seen = std::collections::BTreeSet::new();
    for kind in (0..5).cycle().take(2000) {
        let mut state: State<f32> = anywhere_within(&settings, &mut dice);
        for k in 0..usize::from(settings.window) {
            let [x, y] = sample(&settings, kind, k, &mut dice);
            instrument.step(&mut state, x, y);
        }
        seen.extend(beyond(&halved, &state));
    }
    for name in ["drives", "commands", "the detuning"] {
        assert!(seen.contains(name), "{name} never beyond half its bound: {seen:?}");
    }
}
