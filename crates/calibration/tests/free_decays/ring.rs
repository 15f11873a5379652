//! A resonator that rings, by its own integration of the envelope's equation of motion, and the folder it is recorded to.

use std::fmt::Write as _;
use std::path::Path;

use cvg_model::Envelope;
use cvg_model::effects::{EffectId, Moment};
use cvg_model::resonator::envelope::{detuning, precession};
use cvg_model::resonator::{Anisotropy, Resonator};

/// Noise from a generator of Lehmer's.
pub(crate) struct Noise(u64);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        let mut noise = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        for _ in 0..8 {
            noise.even();
        }
        noise
    }

    pub(crate) fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.even()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.even()).cos()
    }
}

/// What rings, and how it is recorded.
#[derive(Clone)]
pub(crate) struct Ring {
    pub(crate) resonator: Resonator<f64>,
    pub(crate) rate_dps: f64,
    /// θ̇ += cQ
    pub(crate) spring: f64,
    /// ω_r − ω is less by this times E
    pub(crate) frequency_per_energy: f64,
    pub(crate) ahead_rad_s: f64,
    /// θ̇ += p sin(4θ + φ), as (p cos φ, p sin φ)
    pub(crate) spring_four: [f64; 2],
    /// the rate grows evenly from nothing, and is reached at the end
    pub(crate) speeds_up: bool,
    /// G_Dy/G_Dx
    pub(crate) gain_ratio: f64,
    /// phase that Y lags X by, rad: of a channel that is sampled late
    pub(crate) phase_rad: f64,
    pub(crate) noise_v: f64,
    /// share of the last row's noise in the next one's
    pub(crate) memory: f64,
    pub(crate) row_s: f64,
    pub(crate) rows: usize,
}

impl Ring {
    /// τ = 22 s, a split of 40 mHz, anisodamping of 4.7 mHz at some angles, at 10 deg/s.
    pub(crate) fn usual() -> Self {
        Self {
            resonator: Resonator {
                omega_rad_s: 0.0,
                angular_gain: 0.78,
                centrifugal_gain: 0.0,
                damping_per_s: 1.0 / 22.0,
                anisodamping: Anisotropy::new(4.7e-3, 0.4),
                anisoelasticity: Anisotropy::new(std::f64::consts::TAU * 0.04, -0.7),
            },
            rate_dps: 10.0,
            spring: 0.0,
            frequency_per_energy: 0.0,
            ahead_rad_s: 0.3,
            spring_four: [0.0; 2],
            speeds_up: false,
            gain_ratio: 1.0,
            phase_rad: 0.0,
            noise_v: 1e-3,
            memory: 0.0,
            row_s: 0.05,
            rows: 1000,
        }
    }

    /// The time of the end, s.
    pub(crate) fn end_s(&self) -> f64 {
        self.rows as f64 * self.row_s
    }

    fn rate_of_change(&self, t: f64, e: &Envelope<f64>) -> Envelope<f64> {
        let p = e.pendulum();
        let share = if self.speeds_up { t / self.end_s() } else { 1.0 };
        let [cos, sin] = self.spring_four;
        self.resonator.envelope_rate(e, share * self.rate_dps.to_radians(), self.ahead_rad_s)
            + EffectId::SpringCubic.mechanics(&[cos, sin, 0.0, 0.0], e, &Moment::origin())
            + precession(self.spring * p.q, e)
            + detuning(self.frequency_per_energy * p.e, e)
    }

    /// The rows of a decay of amplitude `a` that begins at `angle_deg`: (t, envelope).
    pub(crate) fn decay(&self, a: f64, angle_deg: f64, noise: &mut Noise) -> Vec<(f64, Envelope<f64>)> {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        let mut e = Envelope::new(a * cos, 0.0, a * sin, 0.0);
        let mut last = [0.0; 4];
        (0..self.rows)
            .map(|i| {
                if i > 0 {
                    for quarter in 0..4 {
                        let t = ((i - 1) as f64 + 0.25 * f64::from(quarter)) * self.row_s;
                        e = self.stepped(t, &e, 0.25 * self.row_s);
                    }
                }
                let own = (1.0 - self.memory * self.memory).sqrt() * self.noise_v;
                last = last.map(|l| self.memory * l + own * noise.normal());
                // Y = y_c − i y_s, turned back by the phase
                let (sin, cos) = self.phase_rad.sin_cos();
                let y = [e.y_c * cos - e.y_s * sin, e.y_s * cos + e.y_c * sin].map(|v| self.gain_ratio * v);
                let seen = Envelope::new(e.x_c + last[0], e.x_s + last[1], y[0] + last[2], y[1] + last[3]);
                (i as f64 * self.row_s, seen)
            })
            .collect()
    }

    /// Runge and Kutta's fourth order.
    fn stepped(&self, t: f64, e: &Envelope<f64>, h: f64) -> Envelope<f64> {
        let k1 = self.rate_of_change(t, e);
        let k2 = self.rate_of_change(t + 0.5 * h, &(*e + k1 * (0.5 * h)));
        let k3 = self.rate_of_change(t + 0.5 * h, &(*e + k2 * (0.5 * h)));
        let k4 = self.rate_of_change(t + h, &(*e + k3 * h));
        *e + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (h / 6.0)
    }

    /// Writes decays at these angles, and the campaign of them, with `of_each` in each run's table.
    pub(crate) fn campaign(&self, folder: &Path, angles_deg: &[f64], of_each: &str, seed: u64) -> std::path::PathBuf {
        self.written(folder, angles_deg, |_| (self.rate_dps, of_each.to_owned()), seed)
    }

    /// The same, of which one decay after the other turns at one of these rates, which are stated.
    pub(crate) fn campaign_at(
        &self,
        folder: &Path,
        angles_deg: &[f64],
        rates_dps: &[f64],
        seed: u64,
    ) -> std::path::PathBuf {
        let of = |at: usize| rates_dps[at % rates_dps.len()];
        self.written(folder, angles_deg, |at| (of(at), format!("rate_dps = {:?}", of(at))), seed)
    }

    /// Decays, each at a rate and with what the campaign says of it.
    fn written(
        &self,
        folder: &Path,
        angles_deg: &[f64],
        of_each: impl Fn(usize) -> (f64, String),
        seed: u64,
    ) -> std::path::PathBuf {
        let mut noise = Noise::new(seed);
        let mut campaign = "[campaign]\ndevice = \"ring\"\n".to_owned();
        for (at, angle) in angles_deg.iter().enumerate() {
            let mut text = "t_s,xc_v,xs_v,yc_v,ys_v\n".to_owned();
            let (rate_dps, of_each) = of_each(at);
            for (t, e) in (Self { rate_dps, ..self.clone() }).decay(1.0, *angle, &mut noise) {
                let _ = writeln!(text, "{t:.4},{:.9},{:.9},{:.9},{:.9}", e.x_c, e.x_s, e.y_c, e.y_s);
            }
            std::fs::write(folder.join(format!("decay-{at}.csv")), text).expect("a folder of the test's own");
            let _ = write!(campaign, "\n[[run]]\nkind = \"decay\"\nfile = \"decay-{at}.csv\"\n{of_each}\n");
        }
        let path = folder.join("campaign.toml");
        std::fs::write(&path, campaign).expect("a folder of the test's own");
        path
    }
}
