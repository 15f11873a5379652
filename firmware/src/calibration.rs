//! The calibrator joined to loops, for host and target alike: a resonator at the envelope, its electronics, its loops.
//!
//! Everything is in the scalar of the calibrator, so that both sides compute the same bits, and every number that the
//! calibrator hands out enters a checksum. This is also how it is joined to loops of one's own: `step`.

use cvg_calibrator::{Calibrator, Commands, ConfigError, Health, Parameter, Settings, State};
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{AxisForces, Envelope, Float, Pendulum};

/// Control steps a second.
pub const PER_S: u32 = 2000;
/// Seconds of a life.
pub const SECONDS: u32 = 190;

/// Runs what is to be counted; on the host it only runs.
pub trait Meter {
    /// `f`, counted as `what`.
    fn count<R>(&mut self, what: Part, f: impl FnOnce() -> R) -> R;
}

/// What is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// the readout undone
    Readout,
    /// what is added to the commands
    Forward,
    /// the drives undone
    Drives,
    /// a slice of the learning
    Step,
}

/// A device with a calibrator under way.
pub struct Life<T> {
    calibrator: Calibrator<T>,
    state: State<T>,
    resonator: Resonator<T>,
    vibration: Envelope<T>,
    direction: (T, T),
    energy: T,
    quadrature: T,
    phase: T,
    random: u32,
    step: u32,
    /// of every number handed out
    pub checksum: u32,
}

impl<T: Float> Life<T> {
    /// A vibration at its set amplitude, nothing learned.
    pub fn new(settings: &Settings) -> Result<Self, ConfigError> {
        let calibrator = Calibrator::new(settings)?;
        let (c, zero) = (T::from_f64, T::zero());
        Ok(Self {
            calibrator,
            state: calibrator.start(),
            resonator: Resonator {
                omega_rad_s: c(1e5),
                angular_gain: c(0.78),
                centrifugal_gain: zero,
                damping_per_s: c(0.045),
                anisodamping: Anisotropy { cos2: c(4e-3), sin2: c(-2e-3) },
                anisoelasticity: Anisotropy { cos2: c(0.9), sin2: c(1.3) },
            },
            vibration: Envelope::new(T::one(), zero, zero, zero),
            direction: (T::one(), zero),
            energy: c(-0.003),
            quadrature: zero,
            phase: zero,
            random: 1,
            step: 0,
            checksum: 0,
        })
    }

    /// Uniform within ±3e-5 V.
    fn noise(&mut self) -> T {
        self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        T::from_f64(6e-5) * (T::ratio((self.random >> 16) as i32, 65_536) - T::half())
    }

    /// Unequal gains, a skew, offsets: what the readout makes of the vibration.
    fn read(&mut self) -> Envelope<T> {
        let (e, c) = (self.vibration, T::from_f64);
        let y = |x, y| c(1.03) * y + c(-6e-3) * x;
        let noise = [self.noise(), self.noise(), self.noise(), self.noise()];
        Envelope::new(
            e.x_c + c(5e-4) + noise[0],
            e.x_s + noise[1],
            y(e.x_c, e.y_c) - c(3e-4) + noise[2],
            y(e.x_s, e.y_s) + noise[3],
        )
    }

    /// Input rate and health: at rest, turned by hand, at rest, turning; a disturbance at one second and at 170.
    fn moment(&self) -> (T, Health) {
        let second = self.step / PER_S;
        let turned = match second {
            85..95 => T::one(),
            110.. => T::ratio(1 + (second / 3 % 5) as i32, if (second / 3).is_multiple_of(2) { 1 } else { -1 }),
            _ => T::zero(),
        };
        let health = if matches!(second, 1 | 170) { Health::Disturbed } else { Health::Operating };
        (turned, health)
    }

    /// One control step: how the calibrator is joined to loops.
    pub fn step(&mut self, meter: &mut impl Meter) {
        let (c, one) = (T::from_f64, T::one());
        let dt = c(1.0 / f64::from(PER_S));
        let (rate, health) = self.moment();
        let raw = self.read();
        // behind the demodulator: the readout undone
        let e = meter.count(Part::Readout, || self.calibrator.readout(&self.state, &raw));
        let p = e.pendulum();
        self.direction = along(&p, self.direction);
        let (cos, sin) = self.direction;
        // the loops, with what is known beforehand added to their commands
        let forward = meter.count(Part::Forward, || self.calibrator.forward(&self.state, cos, sin, one));
        self.energy = self.energy + (p.e - one) * dt;
        self.quadrature = self.quadrature + p.q * dt;
        self.phase = self.phase + p.l * c(200.0) * dt;
        let commands = Commands {
            energy_v: c(8.0) * (p.e - one + c(2.0) * self.energy),
            precession_v: forward.precession_v,
            quadrature_v: -(c(8.0) * (p.q + c(2.0) * self.quadrature)) + forward.quadrature_v,
        };
        let ahead = c(40.0) * p.l + self.phase - forward.detuning_rad_s;
        // Equation 9, and the drives undone
        let wanted = AxisForces {
            x_c: -(commands.quadrature_v * sin),
            x_s: commands.energy_v * cos - commands.precession_v * sin,
            y_c: commands.quadrature_v * cos,
            y_s: commands.energy_v * sin + commands.precession_v * cos,
        };
        let drives = meter.count(Part::Drives, || self.calibrator.drives(&self.state, &wanted));
        // and a slice of the learning, from what was measured and commanded
        meter.count(Part::Step, || {
            self.calibrator.step(&mut self.state, &p, self.direction, &commands, health);
        });
        for v in [e.x_c, e.x_s, e.y_c, e.y_s, drives.x_c, drives.x_s, drives.y_c, drives.y_s, forward.precession_v] {
            self.check(v);
        }
        self.turn(&drives, rate, ahead, dt);
        self.step += 1;
        if self.step.is_multiple_of(PER_S) {
            self.check_status();
        }
    }

    /// The resonator for a control period: the force that the drives make of their commands, and the mechanics.
    fn turn(&mut self, f: &AxisForces<T>, rate: T, ahead: T, dt: T) {
        let (x, y, c) = (T::from_f64(0.98), T::from_f64(1.02), T::from_f64);
        let push = Envelope::new(-(x * f.x_s), x * f.x_c, -(y * f.y_s + c(4e-3) * f.x_s), y * f.y_c + c(4e-3) * f.x_c);
        let moved = |e: &Envelope<T>| self.resonator.envelope_rate(e, rate, ahead) + push;
        let first = moved(&self.vibration);
        let middle = self.vibration + first * (T::half() * dt);
        self.vibration = self.vibration + moved(&middle) * dt;
    }

    fn check(&mut self, value: T) {
        // the value of a single-precision number has all its bits
        let bits = (value.to_f64() as f32).to_bits();
        self.checksum = (self.checksum.rotate_left(5) ^ bits).wrapping_mul(0x9E37_79B1);
    }

    fn check_status(&mut self) {
        let status = self.calibrator.status(&self.state);
        self.check(status.bias_rad);
        for p in [Parameter::DetectionRatio, Parameter::DetectionSkew, Parameter::DetectionPhase] {
            if let Some(e) = self.state.estimate(p) {
                self.check(e.value);
                self.check(e.sigma);
            }
        }
    }

    /// γ in force: at the end it has to be that of [`Life::read`].
    pub fn ratio(&self) -> f64 {
        self.state.correction().detection_ratio().to_f64()
    }

    /// Which slice comes next.
    pub fn slice(&self, settings: &Settings) -> u32 {
        self.step % u32::from(settings.steps)
    }
}

/// The direction of the major axis, its sign that of `before`.
fn along<T: Float>(p: &Pendulum<T>, before: (T, T)) -> (T, T) {
    let n = p.r.norm(p.s);
    let (cos, sin) = if p.r > T::zero() {
        let cos = (T::half() * (T::one() + p.r / n)).sqrt();
        (cos, T::half() * p.s / (n * cos))
    } else {
        let sin = (T::half() * (T::one() - p.r / n)).sqrt();
        (T::half() * p.s / (n * sin), sin)
    };
    if cos * before.0 + sin * before.1 < T::zero() { (-cos, -sin) } else { (cos, sin) }
}
