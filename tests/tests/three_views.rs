//! Three views of one mechanics, run side by side: the carrier sampled at 100 kHz, its envelope, and the orbit's averages.
//!
//! The carrier is exact; the envelope is its average over the carrier to first order, and the averages are the envelope in
//! other variables. So carrier and envelope may differ by the order of averaging, the slow rates over ω, and envelope and
//! averages by integration alone. Each scenario states and asserts what differs.

use core::f64::consts::TAU;

use cvg_instrument::{Settings, Tuning};
use cvg_model::Orbit;
use cvg_model::resonator::averaged::Averages;
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_simulator::carrier::{CarrierDevice, CarrierPlant};
use cvg_simulator::closed_loop::samples as whole;
use cvg_simulator::plant::Plant;
use cvg_simulator::stages::Stages;
use cvg_simulator::{Scenario, SimulatedRun};
use cvg_tests::carrier::Watched;
use cvg_tests::domain::wrapped;
use nalgebra::{DMatrix, DVector};

const OMEGA: f64 = TAU * 15_200.0;
const K: f64 = 0.78;

fn resonator() -> Resonator<f64> {
    Resonator { damping_per_s: 1.0 / 22.0, ..CarrierDevice::default().resonator }
}

/// E, Q and θ at the end of a free run in each view.
#[derive(Clone, Copy, Debug)]
struct Seen {
    e: f64,
    q: f64,
    theta: f64,
}

/// The largest differences between two views over a run: of E and Q relative to E, of θ in rad.
#[derive(Clone, Copy, Debug, Default)]
struct Apart {
    e: f64,
    q: f64,
    theta: f64,
}

impl Apart {
    fn and(self, a: &Seen, b: &Seen) -> Self {
        Self {
            e: self.e.max((a.e - b.e).abs() / b.e),
            q: self.q.max((a.q - b.q).abs() / b.e),
            theta: self.theta.max(wrapped(a.theta - b.theta, core::f64::consts::PI).abs()),
        }
    }
}

/// The free resonator from `start` at a rate, in the three views; what differs, and where it ended.
fn free(resonator: &Resonator<f64>, start: &Orbit<f64>, rate_rad_s: f64, time_s: f64) -> (Apart, Apart, Vec<Seen>) {
    let (period, per_window) = (1e-5, 100);
    let mut carrier = CarrierPlant::new(resonator, [0.0; 2], period, 0.0);
    carrier.set_rate(rate_rad_s);
    carrier.set_vibration(&start.envelope());
    let window = period * f64::from(per_window);
    let envelope_plant = Plant::new(resonator, &Stages::default(), rate_rad_s, 0.0, 1.0, window);
    let mut envelope = start.envelope();
    let p = envelope.pendulum();
    let mut averages = Averages { e: p.e, q: p.q, theta: p.angle() };
    let (mut first, mut second, mut seen) = (Apart::default(), Apart::default(), Vec::new());
    for _ in 0..whole(time_s, window) {
        for _ in 0..per_window {
            carrier.step([0.0; 2], [0.0; 2]);
        }
        envelope = envelope_plant.step(
            &envelope,
            &cvg_model::AxisForces { x_c: 0.0, x_s: 0.0, y_c: 0.0, y_s: 0.0 },
            0.0,
            &cvg_model::effects::Moment::origin(),
        );
        averages = advanced(resonator, &averages, rate_rad_s, window);
        let of = |p: cvg_model::Pendulum<f64>| Seen { e: p.e, q: p.q, theta: p.angle() };
        let (a, b) = (of(carrier.vibration().pendulum()), of(envelope.pendulum()));
        let c = Seen { e: averages.e, q: averages.q, theta: averages.theta };
        (first, second) = (first.and(&a, &b), second.and(&c, &b));
        seen.push(Seen { theta: averages.theta, ..a });
    }
    (first, second, seen)
}

/// The averages a time `h` later, by the classical Runge–Kutta method.
fn advanced(resonator: &Resonator<f64>, s: &Averages<f64>, rate: f64, h: f64) -> Averages<f64> {
    let add = |s: &Averages<f64>, d: &Averages<f64>, h: f64| Averages {
        e: s.e + h * d.e,
        q: s.q + h * d.q,
        theta: s.theta + h * d.theta,
    };
    let f = |s: &Averages<f64>| resonator.averaged_rate(s, rate);
    let k1 = f(s);
    let k2 = f(&add(s, &k1, 0.5 * h));
    let k3 = f(&add(s, &k2, 0.5 * h));
    let k4 = f(&add(s, &k3, h));
    [(k1, 1.0), (k2, 2.0), (k3, 2.0), (k4, 1.0)].iter().fold(*s, |s, (k, w)| add(&s, k, w * h / 6.0))
}

/// Envelope and averages: the averages' own integration, fourth order at a millisecond.
fn same_to_integration(name: &str, apart: &Apart) {
    println!("{name}: averages and envelope apart by {apart:?}");
    assert!(apart.e < 1e-9 && apart.q < 1e-9 && apart.theta < 1e-9, "{name}: {apart:?}");
}

/// Carrier and envelope: in energy and quadrature a ripple at 2ω of the order 1/τω and Δω/ω, in angle the same and what
/// grows with time, the second order of averaging.
fn same_to_averaging(name: &str, apart: &Apart, e: f64, q: f64, theta: f64) {
    println!("{name}: carrier and envelope apart by {apart:?}");
    assert!(apart.e < e && apart.q < q && apart.theta < theta, "{name}: {apart:?}");
}

#[test]
fn free_decay() {
    let resonator = resonator();
    let (first, second, seen) = free(&resonator, &Orbit { a: 1.0, q: 0.05, theta: 0.3, delta: 0.0 }, 0.0, 5.0);
    // damping shows the energy of the instant: a ripple of 1/τω = 4.8e-7
    same_to_averaging("free decay", &first, 1e-6, 1e-9, 1e-6);
    same_to_integration("free decay", &second);
    let last = seen.last().expect("a run");
    approx::assert_relative_eq!(last.e, (1.0 + 0.0025) * (-2.0 * 5.0 / 22.0_f64).exp(), max_relative = 2e-6);
}

#[test]
fn precession() {
    let resonator = resonator();
    let rate = 500_f64.to_radians();
    let start = Orbit { a: 1.0, q: 0.05, theta: 0.3, delta: 0.0 };
    let (first, second, seen) = free(&resonator, &start, rate, 5.0);
    // Ω² stiffens both modes alike and moves the frequency, not the pattern. The dampers turn with the body: on a pattern
    // that precesses in it they act as a force across, which the envelope leaves out, and Q grows at 2kΩE/τω
    let dragged = 2.0 * K * rate / (22.0 * OMEGA) * 5.0;
    same_to_averaging("precession", &first, 2.0 * 0.06 * dragged, 1.05 * dragged, 1e-6);
    assert!(first.q > 0.95 * dragged, "{} is not {dragged}", first.q);
    same_to_integration("precession", &second);
    let last = seen.last().expect("a run");
    approx::assert_abs_diff_eq!(last.theta, 0.3 - K * rate * 5.0, epsilon = 1e-6);
}

#[test]
fn anisodamping_drift() {
    let resonator = Resonator { anisodamping: Anisotropy::new(4.7e-3, 27_f64.to_radians()), ..resonator() };
    let start = Orbit { a: 1.0, q: 0.0, theta: 1.2, delta: 0.0 };
    let (first, second, seen) = free(&resonator, &start, 0.0, 20.0);
    same_to_averaging("anisodamping", &first, 1e-6, 1e-6, 1e-6);
    same_to_integration("anisodamping", &second);
    // tan(θ − θ_τ) grows as e^{Δ(1/τ)t}: from −rest towards the axis of least damping
    let off = |theta: f64| (theta - 27_f64.to_radians()).tan();
    approx::assert_relative_eq!(
        off(seen.last().expect("a run").theta) / off(1.2),
        (4.7e-3 * 20.0_f64).exp(),
        max_relative = 1e-5
    );
}

#[test]
fn quadrature_growth() {
    let split = TAU * 0.04;
    let resonator = Resonator { anisoelasticity: Anisotropy::new(split, 55_f64.to_radians()), ..resonator() };
    let start = Orbit { a: 1.0, q: 0.0, theta: 0.1, delta: 0.0 };
    let (first, second, seen) = free(&resonator, &start, 0.0, 3.0);
    // second order of averaging: the split's own square over 8ω, 8e-8 1/s; the ripple Δω/ω
    same_to_averaging("quadrature", &first, 3e-6, 3e-6, 3e-6);
    same_to_integration("quadrature", &second);
    let early = &seen[49];
    let expected = -split * (2.0 * (0.1 - 55_f64.to_radians())).sin() * 0.05;
    approx::assert_relative_eq!(early.q / early.e, expected, max_relative = 1e-3);
}

#[test]
fn the_pattern_locks_below_the_threshold_rate() {
    let difference = 0.2;
    let resonator = Resonator { anisodamping: Anisotropy::new(difference, 0.5), ..resonator() };
    let threshold = difference / (2.0 * K);
    let start = Orbit { a: 1.0, q: 0.0, theta: 0.5, delta: 0.0 };
    let (first, second, below) = free(&resonator, &start, 0.95 * threshold, 150.0);
    same_to_averaging("lock", &first, 4e-6, 4e-6, 1e-5);
    same_to_integration("lock", &second);
    let (_, _, above) = free(&resonator, &start, 1.05 * threshold, 120.0);
    let turned = |seen: &[Seen]| (seen.last().expect("a run").theta - 0.5).abs();
    assert!(turned(&below) < core::f64::consts::PI, "below it turned by {}", turned(&below));
    let (before, end) = (&below[below.len() - 2000], &below[below.len() - 1]);
    assert!((before.theta - end.theta).abs() < 1e-3, "it still moves");
    assert!(turned(&above) > core::f64::consts::PI, "above it turned by {}", turned(&above));
}

/// Mean and harmonics 2 and 4 of the angle of the pattern: (cos, sin) each.
struct Harmonics {
    mean: f64,
    second: [f64; 2],
    fourth: [f64; 2],
}

/// y by a constant, `line` and harmonics 2 and 4 of `theta`.
fn harmonics(y: &[f64], line: &[f64], theta: &[f64]) -> Harmonics {
    let matrix = DMatrix::from_fn(y.len(), 6, |i, j| match j {
        0 => 1.0,
        1 => line[i],
        2 => (2.0 * theta[i]).cos(),
        3 => (2.0 * theta[i]).sin(),
        4 => (4.0 * theta[i]).cos(),
        _ => (4.0 * theta[i]).sin(),
    });
    let normal = matrix.transpose() * &matrix;
    let s = normal.cholesky().expect("independent").solve(&(matrix.transpose() * DVector::from_row_slice(y)));
    Harmonics { mean: s[0], second: [s[2], s[3]], fourth: [s[4], s[5]] }
}

/// The mismatches of the paper, anisodamping and a split, at 500 deg/s; the loops as the scenario has them.
const CLOSED: &str = r#"
device = "three views"
carrier_hz = 15213.7
angular_gain = 0.78
warm_up_s = 5.0
control_hz = 2000.0
sample_hz = 100.0
effects = [
  { id = "anisodamping", anisodamping = 4.7e-3, theta_tau = 27.0 },
  { id = "anisoelasticity", anisoelasticity = 0.25132741, theta_omega = 55.0 },
  { id = "actuation-gain-mismatch", actuation_gain_ratio = 1.0113 },
  { id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 },
]
[[run]]
kind = "rotation"
file = "a.csv"
rate_dps = 500.0
duration_s = 12.0
start_deg = 10.0
"#;

/// Angle-dependent bias in the angle, mdeg, and v_as, V, of a recording.
fn bias_and_drive(run: &SimulatedRun) -> (Harmonics, Harmonics) {
    let column = |name| run.column(name).unwrap_or_else(|| panic!("no column {name}"));
    let (x_c, x_s, y_c, y_s) = (column("xc_v"), column("xs_v"), column("yc_v"), column("ys_v"));
    let (mut theta, mut last) = (Vec::new(), 0.0);
    for i in 0..x_c.len() {
        let angle = cvg_model::Envelope::new(x_c[i], x_s[i], y_c[i], y_s[i]).pendulum().angle();
        last += wrapped(angle - last, core::f64::consts::PI);
        theta.push(last);
    }
    let (time, v_as) = (column("t_s"), column("vas_v"));
    let flat: Vec<f64> = time.iter().map(|t| t - 6.0).collect();
    let mdeg: Vec<f64> = theta.iter().map(|t| 1e3 * t.to_degrees()).collect();
    (harmonics(&mdeg, &flat, &theta), harmonics(v_as, &flat, &theta))
}

#[test]
fn closed_loop_at_500_deg_per_s() {
    let scenario = Scenario::parse(CLOSED).expect("a scenario");
    let envelope = scenario.simulate();
    let carrier = cvg_simulator::carrier::campaign::record(&scenario).unwrap_or_else(|e| panic!("{e}"));
    let (bias_e, drive_e) = bias_and_drive(&envelope.runs[0]);
    let (bias_c, drive_c) = bias_and_drive(&carrier.runs[0]);
    let size = |[c, s]: [f64; 2]| c.hypot(s);
    let apart = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).hypot(b - d);
    println!(
        "bias 2θ {:.3?} and {:.3?}, 4θ {:.3?} and {:.3?} mdeg",
        bias_c.second, bias_e.second, bias_c.fourth, bias_e.fourth
    );
    println!(
        "v_as mean {:.6} and {:.6} V, 2θ {:.6?} and {:.6?}",
        drive_c.mean, drive_e.mean, drive_c.second, drive_e.second
    );
    // the averages: Equation 7 to first order, and the anisodamping's Δ(1/τ)/(4kΩ) cos 2(θ − θ_τ)
    let (g, k_omega) = (1.0132, K * 500_f64.to_radians());
    let to_mdeg = |rad: f64| 1e3 * rad.to_degrees();
    let (sin, cos) = (2.0 * 27_f64.to_radians()).sin_cos();
    let damped = to_mdeg(4.7e-3 / (4.0 * k_omega));
    let averaged = [damped * cos, damped * sin + to_mdeg((g - 1.0) / (g + 1.0))];
    println!("bias 2θ by averages {averaged:.3?} mdeg");
    assert!(size(bias_c.second) > 300.0, "there is a bias to compare");
    // the loops' dead time differs, the converters' noise is in the carrier alone
    assert!(apart(bias_c.second, bias_e.second) < 1.0, "{:?} and {:?}", bias_c.second, bias_e.second);
    assert!(apart(bias_c.fourth, bias_e.fourth) < 1.0, "{:?} and {:?}", bias_c.fourth, bias_e.fourth);
    assert!(apart(bias_e.second, averaged) < 8.0, "{:?} and {averaged:?}", bias_e.second);
    // the converter's hold takes sin x/x of the drive, and the loop gives that much more
    let x = core::f64::consts::PI * 15_213.7 / 1e5;
    approx::assert_relative_eq!(drive_c.mean * x.sin() / x, drive_e.mean, max_relative = 2e-3);
    let held = drive_c.second.map(|v| v * x.sin() / x);
    assert!(apart(held, drive_e.second) < 0.05 * size(drive_e.second), "{held:?} and {:?}", drive_e.second);
}

/// The carrier-level loop measures the energy, the quadrature and the angle that the resonator has.
#[test]
fn the_electronics_see_what_the_resonator_does() {
    let tuning = |bandwidth_hz| Tuning { bandwidth_hz, damping: 0.7 };
    let settings = Settings { energy: tuning(1.0), quadrature: tuning(1.0), ..Settings::default() };
    let device = CarrierDevice { noise_v: 0.0, adc: (2.5, 0), dac: (10.0, 0), ..cvg_tests::carrier::device() };
    let mut l = Watched::<f64>::started(&device, &settings, 500.0);
    l.run(3.0);
    let (delay_s, mut worst) = (settings.group_delay_s(), [0.0_f64; 3]);
    for _ in 0..50_000 {
        l.sample(|v| v);
        if l.status.fresh {
            // the sample has moved the resonator on by one period already
            let truth = l.carrier.plant.vibration().pendulum();
            let seen = l.carrier.state.seen.compensated.pendulum();
            let moved = -K * 500_f64.to_radians() * (delay_s + 1.0 / settings.sample_hz);
            worst[0] = worst[0].max((seen.e - truth.e).abs());
            worst[1] = worst[1].max((seen.q - truth.q).abs());
            worst[2] = worst[2].max(wrapped(seen.angle() - (truth.angle() - moved), core::f64::consts::PI).abs());
        }
    }
    println!(
        "E, Q apart by {:.1e}, {:.1e}; θ by {:.4} mdeg; 1/ω is {:.1e}",
        worst[0],
        worst[1],
        1e3 * worst[2].to_degrees(),
        1.0 / OMEGA
    );
    assert!(worst[0] < 2e-5 && worst[1] < 2e-4, "{worst:?}");
    assert!(worst[2].to_degrees() < 2e-3, "{} deg", worst[2].to_degrees());
}
