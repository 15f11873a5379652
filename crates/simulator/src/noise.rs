//! White Gaussian noise from a seed: ChaCha8, one stream per run and purpose, so that a run's noise does not depend on
//! the runs before it.

use cvg_model::{AxisForces, Envelope};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

/// A seeded source of noise.
#[derive(Clone, Debug)]
pub struct Noise {
    generator: ChaCha8Rng,
}

impl Noise {
    /// The source of `seed` for the numbered `stream`.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(stream);
        Self { generator }
    }

    /// A normal deviate of standard deviation `rms`.
    pub fn normal(&mut self, rms: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.generator);
        rms * unit
    }

    /// An angle, uniform in [−π, π), rad.
    pub fn angle_rad(&mut self) -> f64 {
        use core::f64::consts::PI;
        Uniform::new(-PI, PI).map_or(0.0, |all| all.sample(&mut self.generator))
    }

    /// Independent deviates on the four channels of a readout.
    pub fn envelope(&mut self, rms: f64) -> Envelope<f64> {
        Envelope::new(self.normal(rms), self.normal(rms), self.normal(rms), self.normal(rms))
    }

    /// Independent deviates on the four channels of the drives.
    pub fn forces(&mut self, rms: f64) -> AxisForces<f64> {
        AxisForces { x_c: self.normal(rms), x_s: self.normal(rms), y_c: self.normal(rms), y_s: self.normal(rms) }
    }
}
