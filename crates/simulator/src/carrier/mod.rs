//! The loop closed at the carrier: resonator, plates and converters around the production electronics, sample by sample.
//!
//! What `closed_loop` does with envelopes, this does with the signals themselves: the readout is a nonlinear function of
//! the displacement at an instant, the electronics see converter codes and nothing else, and they are
//! [`cvg_instrument::Instrument`], the code that runs in firmware. No effect of the library acts here: what it
//! describes has to come out.

pub mod campaign;
pub mod converter;
pub(crate) mod displacement;
pub mod plant;

use cvg_instrument::{Instrument, Settings, State, Status};
use cvg_model::Float;
use cvg_model::resonator::{Anisotropy, Resonator};

pub use converter::{ChannelNoise, Converter, Plates};
pub use plant::CarrierPlant;

use crate::noise::Noise;

/// A device with its converters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarrierDevice {
    /// the mechanics
    pub resonator: Resonator<f64>,
    /// G_A/2ω of x and y, 1/s per V
    pub drive_per_s_v: [f64; 2],
    /// G_D of x and y, V per unit of displacement
    pub readout_gain: [f64; 2],
    /// gap of the readout's plates, in units of displacement
    pub gap: f64,
    /// offset of the readout of x and y, V
    pub offset_v: [f64; 2],
    /// from the vibration to the sample, s
    pub readout_delay_s: f64,
    /// from the sample to the output computed from it, s; at most a sample
    pub drive_delay_s: f64,
    /// noise of the readout, V rms per sample
    pub noise_v: f64,
    /// the analogue-to-digital converter's range and bits (0: no steps)
    pub adc: (f64, u8),
    /// the digital-to-analogue converter's range and bits (0: no steps)
    pub dac: (f64, u8),
    /// seed of the noise
    pub seed: u64,
}

impl Default for CarrierDevice {
    /// A perfect resonator of 15.2 kHz and τ = 22 s behind converters of 18 and 16 bits: what
    /// [`Settings::default`] is made for.
    fn default() -> Self {
        Self {
            resonator: Resonator {
                omega_rad_s: core::f64::consts::TAU * 15_200.0,
                angular_gain: 0.78,
                centrifugal_gain: 0.6,
                damping_per_s: 1.0 / 22.0,
                anisodamping: Anisotropy::none(),
                anisoelasticity: Anisotropy::none(),
            },
            drive_per_s_v: [1.0; 2],
            readout_gain: [1.0; 2],
            gap: f64::INFINITY,
            offset_v: [0.0; 2],
            readout_delay_s: 0.0,
            drive_delay_s: 5e-6,
            noise_v: 1e-4,
            adc: (2.5, 18),
            dac: (10.0, 16),
            seed: 1,
        }
    }
}

/// The loop at the carrier.
#[derive(Clone, Debug)]
pub struct CarrierLoop<T> {
    instrument: Instrument<T>,
    /// the electronics' state
    pub state: State<T>,
    /// the resonator
    pub plant: CarrierPlant,
    plates: [Plates; 2],
    offset_v: [f64; 2],
    late_cos: f64,
    late_sin: f64,
    noise: ChannelNoise,
    adc: Converter,
    dac: Converter,
    /// the outputs, each twice as a product with pairs wants it: written and read in the same pieces
    output_v: [[f64; 2]; 2],
}

impl<T: Float> CarrierLoop<T> {
    /// `device` at rest with the electronics of `settings` switched on.
    ///
    /// # Errors
    /// Settings that the electronics refuse.
    pub fn new(device: &CarrierDevice, settings: &Settings<'_>) -> Result<Self, cvg_instrument::ConfigError> {
        let instrument = Instrument::new(settings)?;
        let late = device.resonator.omega_rad_s * device.readout_delay_s;
        Ok(Self {
            state: instrument.start(),
            instrument,
            plant: CarrierPlant::new(
                &device.resonator,
                device.drive_per_s_v,
                1.0 / settings.sample_hz,
                device.drive_delay_s,
            ),
            plates: device.readout_gain.map(|gain| Plates::new(gain, device.gap)),
            offset_v: device.offset_v,
            late_cos: late.cos(),
            late_sin: late.sin(),
            noise: ChannelNoise::new(device.noise_v, Noise::new(device.seed, 0)),
            adc: Converter::new(device.adc.0, device.adc.1),
            dac: Converter::new(device.dac.0, device.dac.1),
            output_v: [[0.0; 2]; 2],
        })
    }

    /// The electronics.
    pub fn instrument(&self) -> &Instrument<T> {
        &self.instrument
    }

    /// The drives' outputs now, V.
    pub fn output_v(&self) -> [f64; 2] {
        self.output_v.map(|[v, _]| v)
    }

    /// What the converters read in the state `vibration`, V.
    #[inline]
    fn readout(&mut self, [x, y, p_x, p_y]: [f64; 4]) -> [f64; 2] {
        // late: the displacement as it was a part of a period ago, but for what losses, splits and rates do in it
        let x = self.late_cos * x - self.late_sin * p_x;
        let y = self.late_cos * y - self.late_sin * p_y;
        let [v_x, v_y] = Plates::volts(&self.plates, [x, y]);
        let volts = [v_x + self.offset_v[0], v_y + self.offset_v[1]];
        self.noise.add(volts).map(|v| self.adc.convert(v))
    }

    /// One sample at the rate that is set in the plant.
    #[inline]
    pub fn step(&mut self) -> Status {
        self.step_through(|v| v)
    }

    /// One sample with something between the converters and the electronics: what `channel` makes of the two readings,
    /// V, the electronics see.
    #[inline]
    pub fn step_through(&mut self, channel: impl FnOnce([T; 2]) -> [T; 2]) -> Status {
        // copies: the call of the electronics then does not force them to memory and back
        let (vibration, before) = (self.plant.state(), self.output_v);
        let readings = self.readout(vibration).map(T::from_f64);
        let [x, y] = channel(readings);
        let (dac_x, dac_y, status) = self.instrument.step(&mut self.state, x, y);
        let next = [self.dac.convert(dac_x.to_f64()), self.dac.convert(dac_y.to_f64())];
        self.plant.step_from(vibration, before, next);
        self.output_v = next.map(|v| [v; 2]);
        status
    }

    /// One sample in which the electronics stand still and the drives hold their output; what the converters read, V.
    pub fn step_without_electronics(&mut self) -> [f64; 2] {
        let readings = self.readout(self.plant.state());
        self.plant.step(self.output_v(), self.output_v());
        readings
    }
}
