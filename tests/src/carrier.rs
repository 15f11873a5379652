//! The carrier-level bench: a device with its electronics, run sample by sample, every command checked.

use cvg_instrument::{Fault, Instrument, Mode, Settings, State, Status};
use cvg_model::Float;
use cvg_simulator::carrier::{CarrierDevice, CarrierLoop};

use crate::bench::Draws;

/// Samples a second.
pub const SAMPLE_HZ: f64 = 100_000.0;

/// The paper's kind of device: a split of 40 mHz, anisodamping, 15.2 kHz, τ = 22 s; converters of 18 and 16 bits. That of
/// the drives reaches beyond the electronics' limit: a command over it would be seen.
pub fn device() -> CarrierDevice {
    let mut device = CarrierDevice { dac: (12.0, 16), ..CarrierDevice::default() };
    device.resonator.anisodamping = cvg_model::resonator::Anisotropy::new(4.7e-3, 27_f64.to_radians());
    device.resonator.anisoelasticity =
        cvg_model::resonator::Anisotropy::new(core::f64::consts::TAU * 0.04, 55_f64.to_radians());
    device
}

/// A loop whose every command is checked to be finite and within the limit.
#[derive(Clone, Debug)]
pub struct Watched<T> {
    /// the loop
    pub carrier: CarrierLoop<T>,
    /// the last status
    pub status: Status,
    /// samples made
    pub samples: u64,
    limit_v: f64,
}

impl<T: Float> Watched<T> {
    /// `device` at rest with the electronics of `settings` switched on.
    ///
    /// # Panics
    /// Where the settings are refused.
    pub fn new(device: &CarrierDevice, settings: &Settings<'_>) -> Self {
        let carrier = CarrierLoop::new(device, settings).unwrap_or_else(|e| panic!("{e}"));
        Self { carrier, status: Status::default(), samples: 0, limit_v: settings.dac_limit_v }
    }

    /// The device started and settled in whole-angle mode at `rate_dps`.
    ///
    /// # Panics
    /// Where it does not start within three seconds.
    pub fn started(device: &CarrierDevice, settings: &Settings<'_>, rate_dps: f64) -> Self {
        let mut watched = Self::new(device, settings);
        watched.carrier.plant.set_rate(rate_dps.to_radians());
        let reached = watched.until(3.0, |s| s.mode == Mode::WholeAngle);
        assert!(reached.is_some(), "the device did not start: {:?}", watched.status);
        watched.run(1.5);
        assert_eq!(watched.status.mode, Mode::WholeAngle, "{:?}", watched.carrier.state.supervisor);
        watched
    }

    /// One sample, with something between the converters and the electronics.
    ///
    /// # Panics
    /// Where a command is not finite or beyond the limit.
    #[inline]
    pub fn sample(&mut self, channel: impl FnOnce([T; 2]) -> [T; 2]) {
        self.status = self.carrier.step_through(channel);
        self.samples += 1;
        let [x, y] = self.carrier.output_v();
        let within = x.abs() <= self.limit_v && y.abs() <= self.limit_v;
        assert!(within, "sample {}: commands {x} and {y} V in {:?}", self.samples, self.status);
    }

    /// Runs for `time_s`.
    pub fn run(&mut self, time_s: f64) {
        self.run_through(time_s, |_, v| v);
    }

    /// Runs for `time_s` with something between the converters and the electronics, told the time since it began, s.
    pub fn run_through(&mut self, time_s: f64, mut channel: impl FnMut(f64, [T; 2]) -> [T; 2]) {
        for k in 0..samples(time_s) {
            self.sample(|v| channel(k as f64 / SAMPLE_HZ, v));
        }
    }

    /// Runs until `reached` or for `time_s`; the time it took, s.
    pub fn until(&mut self, time_s: f64, reached: impl FnMut(&Status) -> bool) -> Option<f64> {
        self.until_through(time_s, |v| v, reached)
    }

    /// Likewise, with something between the converters and the electronics.
    pub fn until_through(
        &mut self,
        time_s: f64,
        mut channel: impl FnMut([T; 2]) -> [T; 2],
        mut reached: impl FnMut(&Status) -> bool,
    ) -> Option<f64> {
        for k in 0..samples(time_s) {
            self.sample(&mut channel);
            if reached(&self.status) {
                return Some(k as f64 / SAMPLE_HZ);
            }
        }
        None
    }

    /// The electronics' state.
    pub fn state(&mut self) -> &mut State<T> {
        &mut self.carrier.state
    }

    /// The electronics.
    pub fn instrument(&self) -> &Instrument<T> {
        self.carrier.instrument()
    }
}

/// Samples in `time_s`.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "seconds, not days")]
pub fn samples(time_s: f64) -> u64 {
    (time_s * SAMPLE_HZ).round() as u64
}

/// How a start from rest ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// in whole-angle mode after so many seconds, with the amplitude and the quadrature it should have
    WholeAngle(f64),
    /// in a named fault
    Fault(Fault),
    /// in neither, or in whole-angle mode without being a line of the set amplitude
    Astray(Mode),
}

/// A random device: f0 ± 2 %, Q from 10⁴ to 2·10⁶, a split of 0 to 1 Hz along any axes, anisodamping of up to 5 % of the
/// damping, gains of every channel ± 20 %, any rate up to 300 deg/s; started from rest for `time_s` seconds.
pub fn random_start<T: Float>(seed: u64, time_s: f64) -> Ending {
    use core::f64::consts::{PI, TAU};
    let mut draws = Draws::new(seed);
    let mut device = CarrierDevice { seed, ..CarrierDevice::default() };
    let omega = TAU * 15_200.0 * draws.between(0.98, 1.02);
    let quality = draws.scale(1e4, 2e6);
    let r = &mut device.resonator;
    r.omega_rad_s = omega;
    r.damping_per_s = omega / (2.0 * quality);
    let anisodamping = draws.between(0.0, 0.1) * r.damping_per_s;
    r.anisodamping = cvg_model::resonator::Anisotropy::new(anisodamping, draws.between(0.0, PI));
    let split = TAU * draws.between(0.0, 1.0);
    r.anisoelasticity = cvg_model::resonator::Anisotropy::new(split, draws.between(0.0, PI));
    device.drive_per_s_v = [draws.between(0.8, 1.2), draws.between(0.8, 1.2)];
    device.readout_gain = [draws.between(0.8, 1.2), draws.between(0.8, 1.2)];
    device.offset_v = [draws.between(-0.02, 0.02), draws.between(-0.02, 0.02)];
    let rate = draws.between(-300.0, 300.0).to_radians();
    let mut watched = Watched::<T>::new(&device, &Settings::default());
    watched.carrier.plant.set_rate(rate);
    let reached = watched.until(time_s, |s| s.mode == Mode::WholeAngle);
    watched.run((time_s - reached.unwrap_or(time_s)).max(1.0));
    match (watched.status.mode, reached) {
        (Mode::WholeAngle, Some(after)) => {
            let p = watched.carrier.state.seen.compensated.pendulum();
            let (e, q) = (p.e.to_f64(), p.q.to_f64());
            if (e - 1.0).abs() < 0.2 && q.abs() < 0.2 * e {
                Ending::WholeAngle(after)
            } else {
                Ending::Astray(Mode::WholeAngle)
            }
        }
        (Mode::Fault, _) => watched.carrier.state.last_fault().map_or(Ending::Astray(Mode::Fault), Ending::Fault),
        (mode, _) => Ending::Astray(mode),
    }
}
