//! A gyroscope that calibrates itself: properties of the calibrator, and random devices that live ten minutes each.
//!
//! The full tables of the book are in `self_calibration/table.rs`, behind environment variables.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::f64::consts::TAU;

use cvg_calibrator::parameters::N;
use cvg_calibrator::record::Refused;
use cvg_calibrator::ud::{Growth, Ud, Update};
use cvg_calibrator::{Calibrator, Commands, Health, Mode, Parameter, Settings, State};
use cvg_model::{AxisForces, Envelope, Float, Pendulum};
use cvg_tests::envelope_loop::lives::{Life, Profile, lived, steps};
use cvg_tests::envelope_loop::{Device, Loop, Moment, bias_deg};
use proptest::prelude::*;

#[path = "self_calibration/table.rs"]
mod table;

/// Takes one measurement as the cycle does.
fn measure<T: Float>(ud: &mut Ud<T>, h: &[T; N], noise: T) -> [T; N] {
    let mut update = Update::idle();
    ud.measure(&mut update, h, noise);
    update.gain().map(|g| g * update.inverse())
}

fn dense(ud: &Ud<f64>) -> Vec<Vec<f64>> {
    (0..N).map(|i| (0..N).map(|j| ud.covariance(i, j)).collect()).collect()
}

fn row() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-3.0..3.0, N)
}

fn fixed<T: Float>(v: &[f64]) -> [T; N] {
    let mut out = [T::zero(); N];
    for (slot, v) in out.iter_mut().zip(v) {
        *slot = T::from_f64(*v);
    }
    out
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    #[test]
    fn prop_a_factored_measurement_is_the_dense_one(
        rows in prop::collection::vec((row(), 1e-3..10.0), 1..6), grown in 0..N, q in 1e-6..1.0
    ) {
        let mut ud = Ud::<f64>::diagonal(1.0);
        let mut p = dense(&ud);
        for (h, noise) in rows {
            let ph: Vec<f64> = p.iter().map(|r| r.iter().zip(&h).map(|(a, b)| a * b).sum()).collect();
            let s = noise + h.iter().zip(&ph).map(|(a, b)| a * b).sum::<f64>();
            let gain = measure(&mut ud, &fixed(&h), noise);
            for i in 0..N {
                prop_assert!((gain[i] - ph[i] / s).abs() < 1e-9);
                for j in 0..N {
                    p[i][j] -= ph[i] * ph[j] / s;
                }
            }
        }
        let mut growth = Growth::idle();
        Ud::grow_begin(&mut growth, grown, q);
        for _ in 0..N {
            ud.grow(&mut growth);
        }
        p[grown][grown] += q;
        for (i, line) in dense(&ud).iter().enumerate() {
            for (j, value) in line.iter().enumerate() {
                prop_assert!((value - p[i][j]).abs() < 1e-9, "{i} {j}: {value} {}", p[i][j]);
            }
        }
    }

    //= specs/self-calibration.md#positive
    //= type=test
    //# The covariance MUST stay positive through every measurement and every step of its growth.
    #[test]
    fn prop_the_covariance_stays_positive_in_single_precision(
        rows in prop::collection::vec((row(), -14.0..2.0_f64, -3.0..6.0_f64, 0..N), 1..200)
    ) {
        let mut ud = Ud::<f32>::diagonal(1.0);
        for (h, noise, size, grown) in rows {
            let h: Vec<f64> = h.iter().map(|v| v * 10_f64.powf(size)).collect();
            measure(&mut ud, &fixed(&h), 10_f64.powf(noise) as f32);
            let mut growth = Growth::idle();
            Ud::grow_begin(&mut growth, grown, 1e-9);
            for _ in 0..N {
                ud.grow(&mut growth);
            }
            prop_assert!(ud.is_sound());
            for j in 0..N {
                prop_assert!(ud.variance(j) > 0.0);
            }
        }
    }

    //= specs/self-calibration.md#undone
    //= type=test
    //# A correction MUST undo a readout of its own ratio, skew, phase and offsets.
    #[test]
    fn prop_a_correction_undoes_a_readout_of_its_own_values(
        ratio in -0.1..0.1, skew in -0.03..0.03, phase in -0.03..0.03, ox in -0.01..0.01, oy in -0.01..0.01,
        theta in 0.0..TAU, q in -0.1..0.1_f64
    ) {
        let calibrator = Calibrator::<f64>::new(&Settings::default()).unwrap();
        let mut delta = [0.0; N];
        for (p, v) in [
            (Parameter::DetectionRatio, ratio), (Parameter::DetectionSkew, skew), (Parameter::DetectionPhase, phase),
            (Parameter::OffsetX, ox), (Parameter::OffsetY, oy),
        ] {
            delta[p as usize] = v;
        }
        let state = calibrator.start_from(&delta).unwrap();
        let device = Device {
            ratio: 1.0 + ratio,
            // the skew is seen before the phase: the readout's own, without one
            skew: 0.0,
            offset: (ox, oy),
            cubic: 0.0,
            phase: (0.0, phase),
            ..Device::random(1)
        };
        let (sin, cos) = theta.sin_cos();
        let e = Envelope::new(cos, -q * sin, sin, q * cos);
        let read = device.read(&e);
        let read = Envelope::new(read.x_c, read.x_s, read.y_c + skew * e.x_c, read.y_s + skew * e.x_s);
        let undone = calibrator.readout(&state, &read);
        for (a, b) in [(undone.x_c, e.x_c), (undone.x_s, e.x_s), (undone.y_c, e.y_c), (undone.y_s, e.y_s)] {
            prop_assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }

    //= specs/self-calibration.md#bounded
    //= type=test
    //# Every value in force MUST be finite and one that a device can have for every input.
    #[test]
    fn prop_any_bits_leave_the_compensation_that_of_a_device(
        bits in prop::collection::vec(prop::array::uniform10(any::<u32>()), 1..400), some in any::<u32>()
    ) {
        let calibrator = Calibrator::<f32>::new(&Settings::default()).unwrap();
        let mut state = calibrator.start();
        for i in 0..4000_usize {
            // bits at random times, a vibration of a strange kind between them
            let v = |k: usize| if i % 37 == some as usize % 37 {
                f32::from_bits(bits[i % bits.len()][k])
            } else {
                ((i * (k + 3)) as f32 * 0.01).sin()
            };
            let p = Pendulum { e: 1.0 + 0.1 * v(0), q: 0.1 * v(1), r: v(2), s: v(3), l: 0.1 * v(4) };
            let commands = Commands { energy_v: v(5), precession_v: v(6), quadrature_v: v(7) };
            calibrator.step(&mut state, &p, (v(8), v(9)), &commands, Health::Operating);
        }
        let f = calibrator.drives(&state, &AxisForces { x_c: 1.0, x_s: 1.0, y_c: 1.0, y_s: 1.0 });
        prop_assert!([f.x_c, f.x_s, f.y_c, f.y_s].iter().all(|v| v.abs() < 10.0));
        let e = calibrator.readout(&state, &Envelope::new(1.0, 0.0, 1.0, 0.0));
        prop_assert!([e.x_c, e.x_s, e.y_c, e.y_s].iter().all(|v| v.abs() < 10.0));
        let forward = calibrator.forward(&state, 0.6, 0.8, 1.0);
        prop_assert!(forward.quadrature_v.abs() < 100.0 && forward.precession_v.abs() < 1.0);
    }
}

/// A vibration at work, whatever its loops do.
fn steady(i: usize) -> (Pendulum<f32>, (f32, f32), Commands<f32>) {
    let theta = i as f32 * 1e-3;
    let (sin, cos) = theta.sin_cos();
    let p = Pendulum { e: 1.0, q: 1e-4, r: (2.0 * theta).cos(), s: (2.0 * theta).sin(), l: 0.0 };
    (p, (cos, sin), Commands { energy_v: -0.05, precession_v: 0.1, quadrature_v: 0.2 * (2.0 * theta).sin() })
}

//= specs/self-calibration.md#held
//= type=test
//# Nothing MUST be learned from a disturbed instrument.
#[test]
fn a_disturbed_instrument_teaches_nothing_and_is_not_turned() {
    let calibrator = Calibrator::<f32>::new(&Settings::default()).unwrap();
    let mut state = calibrator.start();
    for i in 0..30_000 {
        let (p, direction, commands) = steady(i);
        calibrator.step(&mut state, &p, direction, &commands, Health::Operating);
    }
    // the cycle that was under way when it began was whole
    for i in 0..160 {
        let (p, direction, commands) = steady(30_000 + i);
        calibrator.step(&mut state, &p, direction, &commands, Health::Disturbed);
    }
    let before = (*state.correction(), state.estimate(Parameter::DetectionRatio), calibrator.save(&state));
    for i in 0..100_000 {
        let (p, direction, commands) = steady(i);
        calibrator.step(&mut state, &p, direction, &commands, Health::Disturbed);
    }
    assert_eq!(before, (*state.correction(), state.estimate(Parameter::DetectionRatio), calibrator.save(&state)));
    assert_eq!(state.precession_rad_s(), 0.0);
    assert_eq!(calibrator.status(&state).mode, Mode::Settling);
}

//= specs/self-calibration.md#excitation
//= type=test
//# What was not excited MUST NOT be moved.
#[test]
fn a_device_that_never_rests_keeps_the_scale_of_its_forces() {
    let device = Device { force: (1.05, 1.05), force_skew: 0.0, ..Device::random(4) };
    let run = lived::<f32>(&device, 4, Life::Turning, 120.0);
    let f = run.calibrator.drives(&run.state, &AxisForces { x_c: 0.0, x_s: 1.0, y_c: 0.0, y_s: 0.0 });
    assert!((f.x_s - 1.0).abs() < 0.01, "nothing told the scale: {f:?}");
    let (before, after) = (calibrated(&run.calibrator.start(), &device), calibrated(&run.state, &device));
    assert!(after < 0.1 * before, "and rotation told the ratio: {before} {after}");
}

/// How far ratio and skew in force are from the device's.
fn calibrated<T: Float>(state: &State<T>, device: &Device) -> f64 {
    let c = state.correction();
    let ratio = c.detection_ratio().to_f64() - (device.ratio - 1.0);
    ratio.hypot(c.detection_skew().to_f64() - device.ratio * device.skew)
}

//= specs/self-calibration.md#not-guessed
//= type=test
//# A detection that nothing has told MUST be said to be unknown.
#[test]
fn a_device_at_rest_says_that_it_does_not_know_its_detection() {
    let device = Device { split: (0.0, 0.0), ..Device::random(5) };
    let run = lived::<f32>(&device, 5, Life::Rest, 110.0);
    let status = run.calibrator.status(&run.state);
    assert!(status.learned && status.mode != Mode::Turning && !status.detection_known, "{status:?}");
    assert_eq!(run.state.correction().detection_ratio(), 0.0);
    // ten seconds of turning by hand later it does
    let mut run = run;
    let turn = Moment { rate_rad_s: 1.0, ..Moment::default() };
    for i in 0..steps(70.0) {
        run.step(if i < steps(10.0) { turn } else { Moment::default() }, true);
    }
    assert!(run.calibrator.status(&run.state).detection_known);
    let (before, after) = (calibrated(&run.calibrator.start(), &device), calibrated(&run.state, &device));
    assert!(after < 0.1 * before, "{before} {after}");
}

/// Loops that settle, and drives of which nothing is known, look like a turn in the first seconds of this device. It was
/// taken for a ratio of 0.085, five standard deviations from the truth, and made the bias five times larger.
#[test]
fn what_looks_like_a_turn_before_anything_is_known_tells_no_detection() {
    let device = Device::random(900_267);
    let run = lived::<f32>(&device, 900_267, Life::Rest, 70.0);
    let bias = |state: &State<f32>, corrected| bias_deg(&device, state, corrected, 500.0, 6.0);
    let (before, after) = (bias(&run.calibrator.start(), false), bias(&run.state, true));
    assert!(after < before, "{before} degrees and {after}");
    let ratio = run.state.estimate(Parameter::DetectionRatio).unwrap();
    let off = f64::from(ratio.value) - (device.ratio - 1.0);
    assert!(off.abs() < 3.0 * f64::from(ratio.sigma), "{ratio:?}");
}

//= specs/self-calibration.md#taken-back
//= type=test
//# A commit that predicts what follows worse than the values before it MUST be taken back.
#[test]
fn a_commit_of_what_was_only_passing_is_taken_back() {
    let mut device = Device { noise: 1e-5, ..Device::random(6) };
    let first = device.clone();
    let learned = lived::<f64>(&first, 6, Life::Turning, 150.0);
    let state = learned.state;
    let before = state.correction().detection_ratio();
    device.ratio *= 1.0 + 1e-3;
    let passing = device.clone();
    let mut run = Loop::<f64>::resumed(&passing, 6, &learned);
    let profile = Profile::new(Life::Turning, 6);
    let mut until = steps(100.0);
    while (run.state.correction().detection_ratio() - before).abs() < 2e-4 && until > 0 {
        run.step(profile.moment(run.t), true);
        until -= 1;
    }
    assert!(until > 0, "what lasts is committed");
    device.ratio /= 1.0 + 1e-3;
    let mut run = Loop::<f64>::resumed(&device, 6, &run);
    for _ in 0..steps(30.0) {
        run.step(profile.moment(run.t), true);
    }
    assert!(run.calibrator.status(&run.state).taken_back > state_taken_back(&learned), "what has passed is not");
}

fn state_taken_back<T: Float>(run: &Loop<'_, T>) -> u16 {
    run.calibrator.status(&run.state).taken_back
}

//= specs/self-calibration.md#restored
//= type=test
//# A record MUST be restored to what was saved or refused.
#[test]
fn a_record_is_restored_as_it_was_or_refused() {
    let device = Device::random(8);
    let run = lived::<f32>(&device, 8, Life::Turning, 60.0);
    let record = run.calibrator.save(&run.state);
    let restored = run.calibrator.restore(&record).unwrap();
    assert_eq!(restored.correction(), run.state.correction());
    let sigma = |s: &State<f32>| s.estimate(Parameter::DetectionRatio).unwrap().sigma;
    assert!((sigma(&restored) / sigma(&run.state) - 1.0).abs() < 1e-3);
    for at in 0..record.len() {
        for bit in 0..8 {
            let mut damaged = record;
            damaged[at] ^= 1 << bit;
            assert_eq!(run.calibrator.restore(&damaged).map(|_| ()), Err(Refused::Damaged), "byte {at}");
        }
    }
}

#[test]
fn settings_outside_their_domain_are_refused_by_name() {
    let wrong = |s: Settings| Calibrator::<f32>::new(&s).unwrap_err().parameter;
    assert_eq!(wrong(Settings { steps: 40, ..Settings::default() }), "steps");
    assert_eq!(wrong(Settings { amplitude_v: 0.0, ..Settings::default() }), "amplitude_v");
    assert_eq!(wrong(Settings { drive_per_s: f64::NAN, ..Settings::default() }), "drive_per_s");
}

#[test]
fn the_state_fits_into_two_kibibytes_in_single_precision() {
    assert!(size_of::<State<f32>>() <= 2048, "{}", size_of::<State<f32>>());
}

/// The first, coarse linearisation of this device leads to a ratio 0.69 and a phase of 0.1 rad: what was believed then made its
/// bias 13 times larger.
#[test]
fn what_no_device_can_be_is_learned_anew() {
    let device = Device::random(50_001);
    let run = lived::<f32>(&device, 50_001, Life::RestThenHand, 360.0);
    let none = run.calibrator.start();
    let bias = |state, corrected| bias_deg(&device, state, corrected, 500.0, 6.0);
    let (before, after) = (bias(&none, false), bias(&run.state, true));
    assert!(after < 0.02 * before, "{before} degrees and {after}");
}

//= specs/self-calibration.md#followed
//= type=test
//# A gain that moves by 100 ppm a minute MUST be followed while the instrument turns, and at rest the status MUST say that it is not.
#[test]
fn a_gain_that_moves_is_followed_while_the_instrument_turns() {
    let turning = table::follow::<f32>(Life::Turning, 2000, 240.0);
    assert!(turning.believed_rms < 50e-6 && turning.in_force_rms < 50e-6 && turning.said, "{turning:?}");
    // a device that comes to rest for a second or two again and again goes on where it was
    let halting = table::follow::<f32>(Life::Turning, 30005, 360.0);
    assert!(halting.believed_rms < 50e-6 && halting.in_force_rms < 50e-6 && halting.said, "{halting:?}");
    let slow = table::follow::<f32>(Life::RestThenSlow, 30000, 600.0);
    assert!(slow.believed_rms < 150e-6 && slow.in_force_rms < 150e-6 && slow.said, "{slow:?}");
    let rest = table::follow::<f32>(Life::Rest, 2000, 120.0);
    assert!(!rest.said, "{rest:?}");
}
