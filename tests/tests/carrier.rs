//! The instrument's signal processing and the plant it is tried on: requirements of `specs/dsp.md`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use core::f64::consts::{PI, TAU};

use cvg_estimator::{Demodulator, Oscillator, Precession, PrecessionState, Status, Window};
use cvg_instrument::{Instrument, Mode, RequestedMode, Settings, Tuning};
use cvg_model::resonator::carrier::{Motion, Rotation};
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{Envelope, Orbit};
use cvg_simulator::carrier::{CarrierDevice, CarrierPlant, Converter, Plates};
use cvg_tests::carrier::{Watched, samples};
use cvg_tests::domain::{angles, envelopes};
use cvg_tests::{for_each_scalar, prop_assert_near};
use proptest::prelude::*;

/// The envelope that a demodulator of `window` samples makes of a carrier of `per_sample` rad, which the reference follows
/// from the phase `phase`; `envelope` and `offset` at each sample.
fn demodulated<T: cvg_tests::Scalar>(
    window: u16,
    per_sample: f64,
    phase: f64,
    envelope: impl Fn(f64) -> Envelope<f64>,
    offset: [f64; 2],
) -> (Envelope<f64>, Status) {
    let oscillator = Oscillator::<T>::new(per_sample / TAU, 1.0, 1e-6).expect("a carrier within the domain");
    let demodulator = Demodulator::<T>::new(window, 10.0).expect("a window within the domain");
    let (sin, cos) = phase.sin_cos();
    let mut phasor = oscillator.tune(&oscillator.start().turned(T::from_f64(cos), T::from_f64(sin)), T::from_f64(0.0));
    let mut sums = Window::begin(&phasor);
    for k in 0..window {
        let e = envelope(f64::from(k));
        let (sin, cos) = (phase + per_sample * f64::from(k)).sin_cos();
        let [x, y] = [e.x_c * cos + e.x_s * sin + offset[0], e.y_c * cos + e.y_s * sin + offset[1]].map(T::from_f64);
        let full = demodulator.accumulate(&mut sums, x, y, &phasor);
        assert_eq!(full, k + 1 == window);
        phasor = phasor.advanced();
    }
    let m = demodulator.finish(&sums, &phasor);
    (cvg_tests::scalar::widened(&m.envelope), m.status)
}

/// What rounding may leave: the reference turns by one rounding a sample, and the fit divides by what is left of a
/// window when it holds little more than a period.
fn rounding<T: cvg_tests::Scalar>(window: u16) -> f64 {
    let epsilon = if core::mem::size_of::<T>() == 4 { f64::from(f32::EPSILON) } else { f64::EPSILON };
    8.0 * epsilon * f64::from(window)
}

for_each_scalar! {
    //= specs/dsp.md#carrier-rejection
    //= type=test
    //# A stationary carrier MUST be demodulated to its envelope whatever the number of samples in a window and whatever the offset of the converter.
    #[test]
    fn prop_a_stationary_carrier_is_demodulated_exactly(
        e in envelopes(), window in 8_u16..2000, cycles in 1.0..900.0_f64, phase in angles(),
        offset_x in -1.0..1.0_f64, offset_y in -1.0..1.0_f64,
    ) {
        let per_sample = TAU * cycles / f64::from(window);
        prop_assume!(per_sample > 0.101 && per_sample < 2.8);
        let size = e.pendulum().e.sqrt();
        prop_assume!(size > 1e-3 && size < 5.0);
        let (found, status) = demodulated::<T>(window, per_sample, phase, |_| e, [offset_x, offset_y]);
        prop_assert_eq!(status, Status::Valid);
        let off = (found - e).pendulum().e.sqrt();
        prop_assert!(off <= rounding::<T>(window) * (size + 2.0), "off by {off:e} of {size}");
    }

    //= specs/dsp.md#group-delay
    //= type=test
    //# An envelope that changes evenly MUST be measured as it is at the middle of its window.
    #[test]
    fn prop_an_envelope_is_that_of_the_middle_of_its_window(
        e in envelopes(), change in envelopes(), window in 40_u16..400, cycles in 6.0..100.0_f64, phase in angles(),
    ) {
        let per_sample = TAU * cycles / f64::from(window);
        prop_assume!(per_sample > 0.101 && per_sample < 2.8);
        let unit = |e: Envelope<f64>| e * (1.0 / e.pendulum().e.sqrt());
        let (e, change) = (unit(e), unit(change) * 1e-3);
        let middle = 0.5 * (f64::from(window) - 1.0);
        let (found, _) = demodulated::<T>(window, per_sample, phase, |k| e + change * (k - middle), [0.0; 2]);
        // A change is a carrier with sidebands: twice the carrier times the change does not average out, but for a
        // part in twice the window's phase. Half a window of delay more would be 1e-3 times half the window.
        let left_over = 1e-3 / (2.0 * per_sample.sin().abs()) + rounding::<T>(window) * 3.0;
        let off = (found - e).pendulum().e.sqrt();
        prop_assert!(off <= 4.0 * left_over, "off by {off:e}, {left_over:e} left over");
    }

    //= specs/dsp.md#unwrapping
    //= type=test
    //# The unwrapped angle MUST follow a turning pattern through any number of half turns without a jump.
    #[test]
    fn prop_the_angle_is_unwrapped_through_any_number_of_turns(
        start in angles(), per_window in -0.7..0.7_f64, windows in 2_usize..400, a in 0.1..2.0_f64,
    ) {
        let tracker = Precession::<T>::new(5e-4, 5e-3, 1e3, 0.2, 5e-4, 1e-3).unwrap();
        let mut state = PrecessionState::default();
        let mut first = None;
        for k in 0..windows {
            let theta = start + per_window * k as f64;
            let e = Orbit { a, q: 0.02 * a, theta, delta: 0.3 }.envelope();
            let (e, _) = cvg_tests::scalar::rounded_envelope::<T>(&e);
            tracker.step(&mut state, &e.pendulum());
            let from = *first.get_or_insert_with(|| state.degrees());
            prop_assert_near!(state.degrees() - from, (per_window * k as f64).to_degrees(), 2e-3);
        }
    }

    //= specs/dsp.md#bounded-commands
    //= type=test
    //# Every output of the instrument MUST be finite and within the converter's limit for every input and every state.
    #[test]
    fn prop_no_input_and_no_state_makes_a_command_without_bounds(
        patterns in prop::collection::vec(any::<u64>(), 40), inputs in prop::collection::vec((any::<u64>(), any::<u64>()), 120),
        started in any::<bool>(), requested in 0_usize..4,
    ) {
        let settings = Settings { window: 8, sample_hz: 100_000.0, ..Settings::default() };
        let instrument = Instrument::<T>::new(&settings).unwrap();
        let mut state = instrument.start();
        if started {
            state.supervisor.mode = Mode::WholeAngle;
        }
        state.request([RequestedMode::WholeAngle, RequestedMode::Hold, RequestedMode::RingDown, RequestedMode::Off][requested]);
        let mut next = patterns.iter().cycle().map(|p| T::from_pattern(*p));
        let mut number = || next.next().expect("a cycle");
        for place in [
            &mut state.phasor.cos, &mut state.phasor.sin, &mut state.phasor.step_cos, &mut state.phasor.step_sin,
            &mut state.window.mixed.x_c, &mut state.window.mixed.x_s, &mut state.window.mixed.y_c,
            &mut state.window.mixed.y_s, &mut state.window.x, &mut state.window.y, &mut state.window.start.0,
            &mut state.window.start.1, &mut state.drive.x_c, &mut state.drive.x_s, &mut state.drive.y_c,
            &mut state.drive.y_s, &mut state.energy.integral, &mut state.quadrature.integral, &mut state.rate.integral,
            &mut state.lock.detuning_rad_s, &mut state.precession.cos_2, &mut state.precession.sin_2,
            &mut state.precession.sin_2_per_window, &mut state.seen.correction_rad_s,
        ] {
            *place = number();
        }
        for (x, y) in inputs {
            let (x, y) = (T::from_pattern(x), T::from_pattern(y));
            let (dac_x, dac_y, _) = instrument.step(&mut state, x, y);
            for v in [dac_x, dac_y] {
                prop_assert!(v.to_f64().abs() <= settings.dac_limit_v, "{v} V");
            }
        }
    }
}

/// e(t)/e₀ of a loop of natural frequency `omega` and damping ratio `zeta` < 1 after a disturbance e₀.
fn decay(omega: f64, zeta: f64, t_s: f64) -> f64 {
    let omega_d = omega * (1.0 - zeta * zeta).sqrt();
    let (sin, cos) = (omega_d * t_s).sin_cos();
    (-zeta * omega * t_s).exp() * (cos - zeta * omega / omega_d * sin)
}

/// The largest difference between a loop's measured error after a disturbance and the law, relative to the disturbance.
fn off_the_law(
    tuning: Tuning,
    settings: &Settings<'_>,
    requested: RequestedMode,
    disturb: impl Fn(&mut Watched<f64>),
    error: impl Fn(&Watched<f64>) -> f64,
) -> f64 {
    // a perfect device without noise: what is left is the loop
    let device = CarrierDevice { noise_v: 1e-6, adc: (2.5, 0), dac: (10.0, 0), ..CarrierDevice::default() };
    let mut l = Watched::<f64>::new(&device, settings);
    l.state().request(requested);
    l.run(6.0);
    assert!(matches!(l.status.mode, Mode::WholeAngle | Mode::Hold), "{:?}", l.status);
    while !l.status.fresh {
        l.sample(|v| v);
    }
    disturb(&mut l);
    let (omega, periods) = (TAU * tuning.bandwidth_hz, 1.5);
    let (mut first, mut worst) = (None, 0.0_f64);
    // the dead time: half a window until it is measured, and as much until it acts on average
    let late_s = 0.5 * settings.window_s();
    for k in 0..samples(periods / tuning.bandwidth_hz) {
        l.sample(|v| v);
        if l.status.fresh {
            let t_s = (k + 1) as f64 / settings.sample_hz - late_s;
            let e = error(&l);
            let first = *first.get_or_insert(e / decay(omega, tuning.damping, t_s));
            worst = worst.max((e / first - decay(omega, tuning.damping, t_s)).abs());
        }
    }
    worst
}

const TUNED: Tuning = Tuning { bandwidth_hz: 4.0, damping: 0.6 };
/// The dead time of a window and a half beside 1/ω_n, twice over, and a/a₀ within the disturbance.
const OFF_THE_LAW: f64 = 0.05;

//= specs/dsp.md#tuning
//= type=test
//# A disturbance of a loop MUST decay with the natural frequency and the damping ratio that the loop was tuned to.
#[test]
fn each_loop_answers_a_disturbance_as_it_was_tuned() {
    let turned = |l: &mut Watched<f64>, by: f64| {
        let (sin, cos) = by.sin_cos();
        let v = l.carrier.plant.vibration();
        l.carrier.plant.set_vibration(&v.turned(sin, cos));
    };
    let energy = off_the_law(
        TUNED,
        &Settings { energy: TUNED, ..Settings::default() },
        RequestedMode::WholeAngle,
        |l| {
            let v = l.carrier.plant.vibration();
            l.carrier.plant.set_vibration(&(v * 1.01));
        },
        |l| l.carrier.state.seen.compensated.pendulum().e - 1.0,
    );
    let quadrature = off_the_law(
        TUNED,
        &Settings { quadrature: TUNED, ..Settings::default() },
        RequestedMode::WholeAngle,
        |l| {
            let v = l.carrier.plant.vibration();
            let across = v.turned(1.0, 0.0).quarter_ahead();
            l.carrier.plant.set_vibration(&(v + across * 0.01));
        },
        |l| l.carrier.state.seen.compensated.pendulum().q,
    );
    let rate = off_the_law(
        TUNED,
        &Settings { rate: TUNED, ..Settings::default() },
        RequestedMode::Hold,
        |l| turned(l, 0.01),
        |l| l.carrier.state.seen.compensated.pendulum().angle(),
    );
    let phase = off_the_law(
        TUNED,
        &Settings { phase: TUNED, ..Settings::default() },
        RequestedMode::WholeAngle,
        |l| l.state().phasor = l.state().phasor.turned(0.01_f64.cos(), 0.01_f64.sin()),
        |l| {
            let p = l.carrier.state.seen.compensated.pendulum();
            -0.5 * p.l / p.e
        },
    );
    println!("off the law by {energy:.3} (energy), {quadrature:.3} (quadrature), {rate:.3} (rate), {phase:.3} (phase)");
    for (off, name) in [(energy, "energy"), (quadrature, "quadrature"), (rate, "rate"), (phase, "phase")] {
        assert!(off <= OFF_THE_LAW, "{name}: {off}");
    }
}

/// The plant against the equation of motion, integrated by the classical Runge–Kutta method in 200 steps a sample, with a
/// rate that is another one in every sample and drives that change within the sample.
#[test]
fn the_plant_is_the_equation_of_motion() {
    let resonator = Resonator {
        omega_rad_s: TAU * 15_200.0,
        angular_gain: 0.78,
        centrifugal_gain: 0.6,
        damping_per_s: 5.0,
        anisodamping: Anisotropy::new(1.0, 0.5),
        anisoelasticity: Anisotropy::new(TAU * 20.0, -0.3),
    };
    let (period, delay) = (1e-5, 3e-6);
    let b = [1.3, 0.8];
    let mut plant = CarrierPlant::new(&resonator, b, period, delay);
    let start = Orbit { a: 1.0, q: 0.1, theta: 0.4, delta: 0.0 }.envelope();
    plant.set_vibration(&start);
    let mut m = plant.motion();
    let rate_at = |t: f64| 20.0 * (TAU * 70.0 * t).sin();
    let force = |v: [f64; 2]| [0, 1].map(|i| 2.0 * resonator.omega_rad_s * b[i] * v[i]);
    let add = |m: &Motion<f64>, d: &Motion<f64>, h: f64| Motion {
        x: m.x + h * d.x,
        y: m.y + h * d.y,
        x_dot: m.x_dot + h * d.x_dot,
        y_dot: m.y_dot + h * d.y_dot,
    };
    let (mut before, mut worst) = ([0.0; 2], 0.0_f64);
    let mut rate_before = 0.0;
    for k in 0..3000_u32 {
        let t = f64::from(k) * period;
        let after = [3.0 * (0.9 * f64::from(k)).cos(), -2.0 * (1.1 * f64::from(k)).sin()];
        let rate = rate_at(t + 0.5 * period);
        // the rate steps from sample to sample: the Euler force is a jump of the velocity by −k(Ω − Ω′)(−y, x)
        let jump = resonator.angular_gain * (rate - rate_before);
        (m.x_dot, m.y_dot) = (m.x_dot + jump * m.y, m.y_dot - jump * m.x);
        rate_before = rate;
        for (time, v) in [(delay, before), (period - delay, after)] {
            let [f_x, f_y] = force(v);
            let input = Rotation { rate_rad_s: rate, acceleration_rad_s2: 0.0 };
            let h = time / 100.0;
            for _ in 0..100 {
                let f = |m: &Motion<f64>| resonator.acceleration(m, &input, f_x, f_y);
                let k1 = f(&m);
                let k2 = f(&add(&m, &k1, 0.5 * h));
                let k3 = f(&add(&m, &k2, 0.5 * h));
                let k4 = f(&add(&m, &k3, h));
                for (slope, weight) in [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)] {
                    m = add(&m, &slope, weight * h / 6.0);
                }
            }
        }
        plant.step_at(rate, before, after);
        before = after;
        let [x, y] = plant.displacement();
        worst = worst.max((x - m.x).abs()).max((y - m.y).abs());
    }
    println!("apart by {worst:.1e} after 30 ms");
    // 456 periods: the reference is off by (ωh)⁴/120 of its phase, 6e-8; the splitting by (kΩT)²/12 of a split of 20 Hz
    assert!(worst < 2e-7, "{worst:e}");
}

#[test]
fn a_rate_that_is_set_and_a_rate_that_is_given_move_the_plant_alike() {
    let mut resonator = CarrierDevice::default().resonator;
    resonator.anisoelasticity = Anisotropy::new(TAU, 0.3);
    resonator.anisodamping = Anisotropy::new(0.02, 1.1);
    let mut set = CarrierPlant::new(&resonator, [1.0, 1.1], 1e-5, 4e-6);
    set.set_vibration(&Orbit { a: 1.0, q: 0.1, theta: 0.4, delta: 0.0 }.envelope());
    let mut given = set.clone();
    set.set_rate(8.0);
    for k in 0..20_000_u32 {
        let v = [(0.95 * f64::from(k)).sin(), 0.3];
        set.step(v, v);
        given.step_at(8.0, v, v);
    }
    for (a, b) in set.displacement().iter().zip(given.displacement()) {
        approx::assert_abs_diff_eq!(*a, b, epsilon = 1e-10);
    }
}

#[test]
fn the_plates_cubic_part_is_one_over_the_gap_squared() {
    let gap = 15.0;
    let plates = Plates::new(2.0, gap);
    // third harmonic of a displacement of 1: κ/4 of G, and of the fifth-order part 5κ²/16
    let n = 64;
    let third: f64 = (0..n)
        .map(|i| {
            let phase = TAU * f64::from(i) / f64::from(n);
            Plates::volts(&[plates; 2], [phase.cos(), 0.0])[0] * (3.0 * phase).cos()
        })
        .sum::<f64>()
        * 2.0
        / f64::from(n);
    let kappa = 1.0 / (gap * gap);
    approx::assert_relative_eq!(third, 2.0 * (kappa / 4.0 + 5.0 * kappa * kappa / 16.0), max_relative = 1e-4);
    let [up, down] = Plates::volts(&[plates; 2], [20.0, -20.0]);
    assert!(up.is_finite() && down == -up);
}

proptest! {
    #![proptest_config(cvg_tests::config())]

    #[test]
    fn prop_a_converter_is_off_by_half_a_step_and_ends_at_its_range(v in -5.0..5.0_f64, bits in 6_u8..24) {
        let step = 5.0 / 2_f64.powi(i32::from(bits));
        let converted = Converter::new(2.5, bits).convert(v);
        prop_assert!(converted.abs() <= 2.5);
        prop_assert!((converted - v.clamp(-2.5, 2.5)).abs() <= 0.5 * step * (1.0 + 1e-9));
        prop_assert_near!((converted / step).fract(), 0.0, 1e-6);
    }
}

#[test]
fn settings_outside_their_domain_are_refused_by_name() {
    let refused = |s: Settings<'_>| Instrument::<f32>::new(&s).err().map(|e| e.parameter);
    let base = Settings::default();
    assert_eq!(refused(Settings { carrier_hz: f64::NAN, ..base }), Some("carrier_hz"));
    assert_eq!(refused(Settings { sample_hz: 30_000.0, window: 20, ..base }), Some("frequency_hz"));
    assert_eq!(refused(Settings { amplitude_v: 2.4, ..base }), Some("amplitude_v"));
    assert_eq!(refused(Settings { window: 4, ..base }), Some("samples"));
    assert_eq!(refused(Settings { window: 400, ..base }), Some("window"));
    assert_eq!(refused(Settings { drive_delay_s: -1.0, ..base }), Some("drive_delay_s"));
    assert_eq!(refused(Settings { detection_threshold_v: 0.5, ..base }), Some("detection_threshold_v"));
    assert_eq!(refused(Settings { hold_rad: f64::INFINITY, ..base }), Some("theta_rad"));
    let fast = Tuning { bandwidth_hz: 1000.0, damping: 1.0 };
    assert_eq!(refused(Settings { energy: fast, ..base }), Some("bandwidth_rad_s"));
    assert_eq!(refused(Settings { fastest_rad_s: PI * 1e4, ..base }), Some("fastest_rad_s"));
    assert_eq!(refused(base), None);
}
