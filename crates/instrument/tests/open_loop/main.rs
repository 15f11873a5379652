//! The instrument before a vibration that is written down: a line of the set amplitude that turns as it is told, whatever
//! the drives do. What is read, commanded and said can be computed by hand.

/// What a test says of both precisions.
macro_rules! in_both_precisions {
    ($($name:ident $body:ident;)+) => { $(mod $name {
        #[test]
        fn in_f32() { super::$body::<f32>() }
        #[test]
        fn in_f64() { super::$body::<f64>() }
    })+ };
}

mod commands;
mod half_turns;
mod readers;
mod refusals;

use core::f64::consts::TAU;

use cvg_instrument::{Fault, Instrument, Mode, Settings, State, Status};
use cvg_model::Float;

/// The vibration, and the instrument before it.
struct Bench<T> {
    settings: Settings<'static>,
    instrument: Instrument<T>,
    state: State<T>,
    /// amplitude, V
    amplitude_v: f64,
    /// the pattern's angle at the first sample, rad, and how fast it turns, rad/s
    theta_rad: f64,
    rate_rad_s: f64,
    /// phase that the vibration lost or won, rad
    phase_rad: f64,
    sample: u64,
    status: Status,
    out: [f64; 2],
}

impl<T: Float> Bench<T> {
    fn with(settings: Settings<'static>) -> Self {
        let instrument = Instrument::new(&settings).expect("inside its domain");
        let state = instrument.start();
        Self {
            settings,
            instrument,
            state,
            amplitude_v: 1.0,
            theta_rad: 0.5,
            rate_rad_s: 0.0,
            phase_rad: 0.3,
            sample: 0,
            status: Status::default(),
            out: [0.0; 2],
        }
    }

    /// In whole-angle mode, with a pattern that turns at `rate_rad_s` through `theta_rad` now.
    fn running(theta_rad: f64, rate_rad_s: f64) -> Self {
        let mut bench = Self::with(Settings::default());
        bench.start(theta_rad, rate_rad_s);
        bench
    }

    fn start(&mut self, theta_rad: f64, rate_rad_s: f64) {
        let windows = 500;
        let took_s = f64::from(windows * u32::from(self.settings.window)) / self.settings.sample_hz;
        (self.theta_rad, self.rate_rad_s) = (theta_rad - rate_rad_s * took_s, rate_rad_s);
        self.windows(windows);
        assert!(matches!(self.status.mode, Mode::WholeAngle | Mode::Hold), "{:?}", self.state.supervisor);
    }

    fn time_s(&self) -> f64 {
        self.sample as f64 / self.settings.sample_hz
    }

    /// The pattern's angle at a time, rad, not wrapped.
    fn theta(&self, time_s: f64) -> f64 {
        self.theta_rad + self.rate_rad_s * time_s
    }

    /// The carrier's phase at a time, rad.
    fn phase(&self, time_s: f64) -> f64 {
        TAU * self.settings.carrier_hz * time_s + self.phase_rad
    }

    /// What the converters read now.
    fn vibration(&self) -> [f64; 2] {
        let t = self.time_s();
        let (sin, cos) = self.theta(t).sin_cos();
        let carrier = self.amplitude_v * self.phase(t).cos();
        [cos * carrier, sin * carrier]
    }

    fn sample_through(&mut self, channel: impl FnOnce([f64; 2]) -> [f64; 2]) {
        let [x, y] = channel(self.vibration());
        let (out_x, out_y, status) = self.instrument.step(&mut self.state, T::from_f64(x), T::from_f64(y));
        (self.out, self.status) = ([out_x.to_f64(), out_y.to_f64()], status);
        assert!(self.out.iter().all(|v| v.abs() <= self.settings.dac_limit_v), "{:?}", self.out);
        self.sample += 1;
    }

    /// So many windows through something between converters and electronics.
    fn windows_through(&mut self, count: u32, channel: impl Fn([f64; 2]) -> [f64; 2]) {
        for _ in 0..count * u32::from(self.settings.window) {
            self.sample_through(&channel);
        }
    }

    fn windows(&mut self, count: u32) {
        self.windows_through(count, |v| v);
    }

    /// Time passes, and nobody takes a sample.
    fn unseen(&mut self, samples: u64) {
        self.sample += samples;
    }

    /// How many windows until a fault, and which, through something between converters and electronics.
    fn fault(&mut self, most: u32, channel: impl Fn([f64; 2]) -> [f64; 2]) -> Option<(u32, Fault)> {
        (1..=most).find_map(|k| {
            self.windows_through(1, &channel);
            self.status.fault.map(|fault| (k, fault))
        })
    }

    /// The angle that is read beyond that of the window's middle, deg.
    fn error_deg(&self) -> f64 {
        let middle = self.time_s() - 0.5 * (f64::from(self.settings.window) + 1.0) / self.settings.sample_hz;
        self.state.angle_deg() - self.theta(middle).to_degrees()
    }
}

/// The angle that is read beyond the truth, as far as half turns do not matter, deg.
fn within_half_a_turn(error_deg: f64) -> f64 {
    error_deg - 180.0 * (error_deg / 180.0).round()
}

fn follows<T: Float>() {
    for rate in [0.0, 6.0, -6.0, 30.0, -30.0] {
        let mut bench = Bench::<T>::running(-1.5, rate);
        let offset = 180.0 * (bench.error_deg() / 180.0).round();
        let (mut mean, count) = (0.0, 1500);
        for _ in 0..count {
            bench.windows(1);
            let error = bench.error_deg() - offset;
            mean += error / f64::from(count);
            // a pattern that turns within the window is no line: a part of a sample
            assert!(error.abs() < 2e-4 + 4e-4 * rate.abs(), "{rate} rad/s: {error} deg");
            assert!(!bench.status.half_turns_lost && bench.status.mode == Mode::WholeAngle);
        }
        // a tenth of a sample at 6 rad/s
        assert!(mean.abs() < 1e-4 + 6e-5 * rate.abs(), "{rate} rad/s: {mean} deg in the mean");
    }
}

fn reads_everywhere<T: Float>() {
    // also exactly on the axes and between them
    for eighth in -8..=8 {
        for off in [-1e-3, 0.0, 1e-3] {
            let theta = f64::from(eighth) * TAU / 16.0 + off;
            let bench = Bench::<T>::running(theta, 0.0);
            let error = within_half_a_turn(bench.error_deg());
            assert!(error.abs() < 2e-4, "{} deg: {error} deg", theta.to_degrees());
        }
    }
}

in_both_precisions! {
    the_angle_follows_a_pattern_that_turns_in_both_senses follows;
    the_angle_is_read_at_every_angle reads_everywhere;
}

#[test]
fn a_second_of_windows_is_counted() {
    let mut bench = Bench::<f64>::running(0.3, 1.0);
    let before = bench.state.windows;
    bench.windows(2000);
    assert_eq!(bench.state.windows - before, 2000);
}

#[test]
fn a_window_is_fresh_once_and_tells_its_envelope() {
    let mut bench = Bench::<f64>::running(0.3, 0.0);
    let mut fresh = 0;
    for _ in 0..500 {
        bench.sample_through(|v| v);
        fresh += u32::from(bench.status.fresh);
        assert!(bench.status.valid && !bench.status.clipped);
    }
    assert_eq!(fresh, 10);
    let e = bench.state.seen.compensated;
    assert!((e.x_c - 0.3_f64.cos()).abs() < 1e-3 && (e.y_c - 0.3_f64.sin()).abs() < 1e-3, "{e:?}");
    assert!(e.x_s.abs() < 1e-3 && e.y_s.abs() < 1e-3, "the phase is locked: {e:?}");
}

fn stuck<T: Float>() {
    for requested in [cvg_instrument::RequestedMode::WholeAngle, cvg_instrument::RequestedMode::Hold] {
        for channel in [0, 1] {
            let mut bench = Bench::<T>::with(Settings::default());
            bench.state.request(requested);
            // the pattern at its heading, where a hold finds nothing to do
            bench.start(if channel == 0 { 0.02 } else { -0.02 }, 0.0);
            let constant = bench.vibration()[channel];
            let (windows, fault) = bench
                .fault(40, |mut v| {
                    v[channel] = constant + 0.01;
                    v
                })
                .unwrap_or_else(|| panic!("{requested:?} {channel}: {:?}", bench.state.supervisor));
            assert_eq!(fault, Fault::StuckChannel, "{requested:?} {channel} after {windows}");
        }
    }
}

fn railed<T: Float>() {
    for channel in [0, 1] {
        for end in [2.5, -2.5, 2.4999, -2.4999, 1e9, -1e9] {
            let mut bench = Bench::<T>::running(0.7, 0.0);
            let rail = move |mut v: [f64; 2]| {
                v[channel] = end;
                v
            };
            bench.windows_through(1, rail);
            assert!(bench.status.clipped, "{channel} at {end}");
            let (_, fault) = bench.fault(1000, rail).expect("a fault");
            assert_eq!(fault, Fault::Saturated, "{channel} at {end}");
        }
    }
}

fn no_number<T: Float>() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for channel in [0, 1] {
            let mut bench = Bench::<T>::running(0.7, 3.0);
            let broken = move |mut v: [f64; 2]| {
                v[channel] = value;
                v
            };
            // one sample of a window is enough
            bench.sample_through(broken);
            bench.windows(1);
            assert!(bench.state.supervisor.coasts == 1, "{value} {channel}: {:?}", bench.state.supervisor);
            bench.windows(100);
            assert_eq!((bench.status.mode, bench.status.valid), (Mode::WholeAngle, true));
            assert!(!bench.status.half_turns_lost, "a window is too short for that");
            let (_, fault) = bench.fault(250, broken).expect("a fault");
            assert_eq!((fault, bench.status.valid), (Fault::InvalidSamples, false));
        }
    }
}

in_both_precisions! {
    a_converter_that_repeats_itself_is_stuck_in_whole_angle_and_in_hold stuck;
    a_converter_at_either_end_of_its_range_is_named_so railed;
    a_sample_that_is_no_number_makes_its_window_none no_number;
}
