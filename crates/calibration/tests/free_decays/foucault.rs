//! A pendulum on a rotating Earth, by the exact equations of a mass on a sphere, filmed by a camera that stumbles.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::ring::Noise;

pub(crate) const HZ: f64 = 0.36;
pub(crate) const GRAVITY: f64 = 9.81;
pub(crate) const PIXELS_PER_M: f64 = 2000.0;
/// Earth's rate about the vertical at 44°, deg/h.
pub(crate) const RATE_DPH: f64 = 10.4;

/// A camera that looks down on the pendulum: a pinhole at a height, with pixels that need not be square.
#[derive(Clone, Copy)]
pub(crate) struct Camera {
    /// of the optical axis from the vertical, towards x and towards y, rad
    pub(crate) tilt_rad: [f64; 2],
    /// of the pinhole from the point over which the pendulum rests, m
    pub(crate) aside_m: [f64; 2],
    /// scale of y over that of x; negative where y points down
    pub(crate) aspect: f64,
    /// of the pinhole over the plane of rest, m; from far away it sees no perspective
    pub(crate) height_m: f64,
}

impl Camera {
    pub(crate) const FAR: Self = Self { tilt_rad: [0.0; 2], aside_m: [0.0; 2], aspect: 1.0, height_m: f64::INFINITY };
    pub(crate) const NEAR: Self = Self { height_m: 1.2, ..Self::FAR };

    /// Where a mass at (x, y), on a sphere of the pendulum's length, is seen, pixels.
    fn sees(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let pixels = |x: f64, y: f64| [640.3 + PIXELS_PER_M * x, 361.8 + self.aspect * PIXELS_PER_M * y];
        if self.height_m.is_infinite() {
            return pixels(x, y);
        }
        let l = Pendulum::length_m();
        let risen = l - (l * l - x * x - y * y).sqrt();
        let (x, y, depth) = (x - self.aside_m[0], y - self.aside_m[1], self.height_m - risen);
        let (sin, cos) = self.tilt_rad[0].sin_cos();
        let (x, depth) = (x * cos - depth * sin, depth * cos + x * sin);
        let (sin, cos) = self.tilt_rad[1].sin_cos();
        let (y, depth) = (y * cos - depth * sin, depth * cos + y * sin);
        pixels(self.height_m * x / depth, self.height_m * y / depth)
    }
}

pub(crate) struct Pendulum {
    /// on a sphere, or in a bowl whose restoring force is in proportion
    pub(crate) spherical: bool,
    /// Δω at 45° to the swing, rad/s: makes quadrature grow
    pub(crate) split_rad_s: f64,
    /// Δ(1/τ) over 1/τ, at 45° to the swing, where it turns the pattern
    pub(crate) uneven: f64,
    pub(crate) noise_px: f64,
    pub(crate) camera: Camera,
}

type State = [f64; 4];

impl Pendulum {
    pub(crate) fn length_m() -> f64 {
        GRAVITY / (std::f64::consts::TAU * HZ).powi(2)
    }

    /// d/dt (x, y, ẋ, ẏ)
    fn rate(&self, [x, y, u, v]: State) -> State {
        let omega_2 = (std::f64::consts::TAU * HZ).powi(2);
        let earth = (RATE_DPH / 3600.0).to_radians();
        let damping = 2.0 / 2500.0;
        let uneven = 0.5 * self.uneven * damping;
        let pull = if self.spherical {
            let l = Self::length_m();
            let z = -(l * l - x * x - y * y).sqrt();
            let w = -(x * u + y * v) / z;
            // the thread's pull, per length: what holds the mass on the sphere
            (u * u + v * v + w * w - GRAVITY * z) / (l * l)
        } else {
            omega_2
        };
        let split = omega_2.sqrt() * self.split_rad_s;
        // the axis of least stiffness stands at 45° to the swing along x
        [
            u,
            v,
            -pull * x + 2.0 * earth * v - damping * u - uneven * v + split * y,
            -pull * y - 2.0 * earth * u - damping * v - uneven * u + split * x,
        ]
    }

    fn stepped(&self, s: State, h: f64) -> State {
        let add = |a: State, b: State, by: f64| [0, 1, 2, 3].map(|i| a[i] + by * b[i]);
        let k1 = self.rate(s);
        let k2 = self.rate(add(s, k1, 0.5 * h));
        let k3 = self.rate(add(s, k2, 0.5 * h));
        let k4 = self.rate(add(s, k3, h));
        [0, 1, 2, 3].map(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
    }

    /// 24 minutes at some 25 pictures a second, in pixels, as a campaign of one decay.
    pub(crate) fn filmed(&self, folder: &Path, seed: u64) -> PathBuf {
        let mut noise = Noise::new(seed);
        let mut text = "t_s,x_v,y_v\n".to_owned();
        let (mut t, mut s) = (0.0, [0.15, 0.0, 0.0, 0.0]);
        while t < 1440.0 {
            let [x, y] = self.camera.sees([s[0], s[1]]).map(|v| v + self.noise_px * noise.normal());
            let _ = writeln!(text, "{t:.6},{x:.3},{y:.3}");
            // a picture every 40 ms, some of them late, some lost
            let next = 0.04 * (1.0 + 0.2 * noise.even()) * if noise.even() < 0.01 { 2.0 } else { 1.0 };
            let next = (next * 1e6).round() * 1e-6;
            for _ in 0..2 {
                s = self.stepped(s, 0.5 * next);
            }
            t += next;
        }
        std::fs::write(folder.join("film.csv"), text).expect("a folder of the test's own");
        let campaign = format!(
            "[campaign]\ndevice = \"pendulum\"\ncarrier_hz = 0.35\n\n[[run]]\nkind = \"decay\"\nfile = \"film.csv\"\n\
             rate_dps = {}\n",
            RATE_DPH / 3600.0
        );
        let path = folder.join("campaign.toml");
        std::fs::write(&path, campaign).expect("a folder of the test's own");
        path
    }
}
