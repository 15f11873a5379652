//! Plates and converters: from displacement to volts to numbers, and back to volts.

use crate::noise::Noise;

/// The readout of one axis by differential parallel plates.
///
/// The difference of the two capacitances is proportional to 1/(d − x) − 1/(d + x) = 2x/(d² − x²), so that the voltage is
/// v = G x/(1 − (x/d)²) = G(x + x³/d² + …): κ = 1/d² of the cubic readout follows from the gap d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plates {
    /// G_D, V per unit of displacement
    pub gain: f64,
    /// (1/d)², 0 for a linear readout
    pub inverse_gap_2: f64,
}

impl Plates {
    /// Plates of the gain G_D at a gap of `gap` (same unit as the displacement; infinite for a linear readout).
    pub fn new(gain: f64, gap: f64) -> Self {
        Self { gain, inverse_gap_2: 1.0 / (gap * gap) }
    }

    /// Volts of both axes at their displacements. Stops keep the plates from touching: the motion they see ends at 0.95 of
    /// the gap. Away from them the two divisions are one.
    #[inline]
    pub fn volts([of_x, of_y]: &[Self; 2], [x, y]: [f64; 2]) -> [f64; 2] {
        let closed = [x * x * of_x.inverse_gap_2, y * y * of_y.inverse_gap_2];
        if closed[0] < 0.9025 && closed[1] < 0.9025 {
            [of_x.gain * x / (1.0 - closed[0]), of_y.gain * y / (1.0 - closed[1])]
        } else {
            [of_x.at_most(x), of_y.at_most(y)]
        }
    }

    #[cold]
    #[inline(never)]
    fn at_most(&self, x: f64) -> f64 {
        let end = 0.95 / self.inverse_gap_2.sqrt();
        let x = if x.abs() < end { x } else { end.copysign(x) };
        self.gain * x / (1.0 - x * x * self.inverse_gap_2)
    }
}

/// Quantisation and range of a converter, either way.
///
/// The order of its numbers is kept: the one that is wanted twice in a register is loaded together with what follows it,
/// and must not be followed by something that was just written.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Converter {
    per_step: f64,
    /// 0 for a converter without steps
    step_v: f64,
    range_v: f64,
}

/// Adding and taking away 1.5 · 2⁵² rounds to the nearest integer, ties to even, without a call.
const ROUND: f64 = 6_755_399_441_055_744.0;

impl Converter {
    /// A converter of range ±`range_v` and `bits` (0: no steps).
    pub fn new(range_v: f64, bits: u8) -> Self {
        let step_v = if bits == 0 { 0.0 } else { 2.0 * range_v / 2_f64.powi(i32::from(bits)) };
        Self { range_v, step_v, per_step: if bits == 0 { 0.0 } else { 1.0 / step_v } }
    }

    /// The nearest value the converter has.
    #[inline]
    pub fn convert(&self, volts: f64) -> f64 {
        // two comparisons; `max` and `min` would ask for NaN as well
        let above = if volts < -self.range_v { -self.range_v } else { volts };
        let within = if above > self.range_v { self.range_v } else { above };
        if self.step_v > 0.0 { ((within * self.per_step + ROUND) - ROUND) * self.step_v } else { within }
    }
}

/// White noise on both channels of the readout, or none.
#[derive(Clone, Debug)]
pub struct ChannelNoise {
    rms_v: f64,
    noise: Noise,
}

impl ChannelNoise {
    /// Noise of `rms_v` per sample and channel.
    pub fn new(rms_v: f64, noise: Noise) -> Self {
        Self { rms_v, noise }
    }

    /// The voltages with their noise.
    #[inline]
    pub fn add(&mut self, [x, y]: [f64; 2]) -> [f64; 2] {
        if self.rms_v > 0.0 { [x + self.noise.normal(self.rms_v), y + self.noise.normal(self.rms_v)] } else { [x, y] }
    }
}
