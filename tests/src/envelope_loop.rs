//! A closed loop of its own at the level of the envelope: resonator, readout, loops and drives, with the calibrator in
//! it. Double precision, whatever the calibrator's; nothing here knows how the calibrator works.

pub mod lives;

use std::f64::consts::{PI, TAU};

use cvg_calibrator::{Calibrator, Commands, Health, Settings, State};
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{AxisForces, Envelope, Float};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Period of the control loops, s.
pub const CONTROL_S: f64 = 5e-4;

/// A device, drawn at random.
#[derive(Clone, Debug)]
pub struct Device {
    /// ring-down time, s
    pub tau_s: f64,
    /// angular gain
    pub k: f64,
    /// Δ(1/τ), 1/s, and its axis, rad
    pub anisodamping: (f64, f64),
    /// Δω, rad/s, and its axis, rad
    pub split: (f64, f64),
    /// a second split, by an electrode, from its time on
    pub tuned: (f64, f64),
    /// G_Dy/G_Dx
    pub ratio: f64,
    /// what the Y readout sees of X
    pub skew: f64,
    /// of the readouts, V
    pub offset: (f64, f64),
    /// κa²
    pub cubic: f64,
    /// of the X and the Y readout, rad
    pub phase: (f64, f64),
    /// gains of the X and the Y drive
    pub force: (f64, f64),
    /// push along Y of a command along X
    pub force_skew: f64,
    /// common phase of the forces, rad
    pub force_phase: f64,
    /// V per control step and channel
    pub noise: f64,
    /// of the ratio, relative, 1/s
    pub drift_per_s: f64,
    /// random walk of ratio and skew, 1/√s
    pub wander: f64,
}

impl Device {
    /// A device of the table in the book.
    pub fn random(seed: u64) -> Self {
        let mut r = ChaCha8Rng::seed_from_u64(seed);
        let mut u = |a: f64, b: f64| a + (b - a) * r.random::<f64>();
        let tau_s = u(5.0, 60.0);
        Self {
            tau_s,
            k: u(0.3, 0.9),
            anisodamping: (u(0.0, 0.02).min(0.9 / tau_s), u(0.0, PI)),
            split: (TAU * u(0.0, 0.5), u(0.0, PI)),
            tuned: (0.0, 0.0),
            ratio: 1.0 + u(-0.05, 0.05),
            skew: u(-0.01, 0.01),
            offset: (u(-1e-3, 1e-3), u(-1e-3, 1e-3)),
            cubic: u(0.0, 0.01),
            phase: (u(-5e-3, 5e-3), u(-5e-3, 5e-3)),
            force: (1.0 + u(-0.05, 0.05), 1.0 + u(-0.05, 0.05)),
            force_skew: u(-0.01, 0.01),
            force_phase: u(-5e-3, 5e-3),
            noise: 10f64.powf(u(-5.0, -4.0)),
            drift_per_s: 0.0,
            wander: 0.0,
        }
    }

    /// The device with its electrode on, as one split.
    pub fn with_split_tuned(&self) -> Self {
        let ((c, s), (tc, ts)) = (polar(self.split), polar(self.tuned));
        let (c, s) = (c + tc, s + ts);
        Self { split: (c.hypot(s), 0.5 * s.atan2(c)), tuned: (0.0, 0.0), ..self.clone() }
    }

    fn resonator(&self, tuned: bool) -> Resonator<f64> {
        let (mut c, mut s) = polar(self.split);
        if tuned {
            let (tc, ts) = polar(self.tuned);
            c += tc;
            s += ts;
        }
        let (dc, ds) = polar(self.anisodamping);
        Resonator {
            omega_rad_s: 1e5,
            angular_gain: self.k,
            centrifugal_gain: 0.0,
            damping_per_s: 1.0 / self.tau_s,
            anisodamping: Anisotropy { cos2: dc, sin2: ds },
            anisoelasticity: Anisotropy { cos2: c, sin2: s },
        }
    }

    /// What the readout makes of an envelope, without noise.
    pub fn read(&self, e: &Envelope<f64>) -> Envelope<f64> {
        self.read_by((self.ratio, self.skew), e)
    }

    /// The same with another ratio and skew.
    fn read_by(&self, (ratio, skew): (f64, f64), e: &Envelope<f64>) -> Envelope<f64> {
        let mx = 1.0 + 0.75 * self.cubic * (e.x_c * e.x_c + e.x_s * e.x_s);
        let my = 1.0 + 0.75 * self.cubic * (e.y_c * e.y_c + e.y_s * e.y_s);
        let (xc, xs, yc, ys) = (e.x_c * mx, e.x_s * mx, e.y_c * my, e.y_s * my);
        let (yc, ys) = (ratio * (yc + skew * xc), ratio * (ys + skew * xs));
        // X e^{−iφ}, X = x_c − i x_s
        let turn = |c: f64, s: f64, phi: f64| {
            let (sin, cos) = phi.sin_cos();
            (c * cos - s * sin, s * cos + c * sin)
        };
        let (xc, xs) = turn(xc, xs, self.phase.0);
        let (yc, ys) = turn(yc, ys, self.phase.1);
        Envelope::new(xc + self.offset.0, xs, yc + self.offset.1, ys)
    }

    /// The push of commands: what the forces add to the envelope per second.
    fn push(&self, f: &AxisForces<f64>) -> Envelope<f64> {
        // (F_c − iF_s)/(2iω) at unit drive: X' = −F_s − iF_c
        let (gx, gy) = self.force;
        let turn = |c: f64, s: f64| {
            let (sin, cos) = self.force_phase.sin_cos();
            // (re, im) e^{iφ}
            (c * cos - s * sin, s * cos + c * sin)
        };
        let (xr, xi) = turn(-f.x_s * gx, -f.x_c * gx);
        let (yr, yi) = turn(-f.y_s * gy - self.force_skew * f.x_s * gx, -f.y_c * gy - self.force_skew * f.x_c * gx);
        Envelope::new(xr, -xi, yr, -yi)
    }
}

fn polar((size, axis): (f64, f64)) -> (f64, f64) {
    (size * (2.0 * axis).cos(), size * (2.0 * axis).sin())
}

/// What the instrument goes through at a time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Moment {
    /// input rate
    pub rate_rad_s: f64,
    /// the electrode is on
    pub tuned: bool,
    /// the instrument says that it is disturbed
    pub disturbed: bool,
}

/// A loop under way.
pub struct Loop<'a, T> {
    /// what is simulated
    pub device: &'a Device,
    /// its calibrator
    pub calibrator: Calibrator<T>,
    /// what that has learned
    pub state: State<T>,
    noise: ChaCha8Rng,
    plant: Envelope<f64>,
    energy: f64,
    quadrature: f64,
    phase: f64,
    /// s since the start
    pub t: f64,
    /// unwrapped angle of the pattern as the loops see it, and the same less what is known not to be rotation
    pub angle: f64,
    /// the angle less what is known not to be rotation, rad
    pub rotation: f64,
    explained: f64,
    still: (Resonator<f64>, Resonator<f64>),
    /// what ratio and skew have wandered
    wandered: (f64, f64),
    /// virtual precession that a bench asks for, rad/s, besides the calibrator's own
    pub asked_rad_s: f64,
    /// what a recording has of the last control step
    pub row: Row,
}

/// What a recording has of a control step: the readout as it came, and the commands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Row {
    /// the readout
    pub readout: Envelope<f64>,
    /// v_as
    pub energy_v: f64,
    /// v_qc
    pub quadrature_v: f64,
}

impl<'a, T: Float> Loop<'a, T> {
    /// A vibration at its set amplitude, nothing learned.
    pub fn new(device: &'a Device, seed: u64, settings: &Settings) -> Self {
        let calibrator = Calibrator::new(settings).expect("settings of a calibrator");
        let state = calibrator.start();
        let theta = 0.3_f64;
        Self {
            device,
            calibrator,
            state,
            noise: ChaCha8Rng::seed_from_u64(seed ^ 0x5eed_0000),
            plant: Envelope::new(theta.cos(), 0.0, theta.sin(), 0.0),
            energy: -1.0 / device.tau_s / 8.0 * 0.5,
            quadrature: 0.0,
            phase: 0.0,
            t: 0.0,
            angle: theta,
            rotation: theta,
            explained: 0.0,
            still: (device.resonator(false), device.resonator(true)),
            wandered: (0.0, 0.0),
            asked_rad_s: 0.0,
            row: Row::default(),
        }
    }

    /// The loop of another device goes on with this one's instrument and state.
    pub fn resumed(device: &'a Device, seed: u64, other: &Loop<'_, T>) -> Self {
        Self {
            device,
            calibrator: other.calibrator,
            state: other.state,
            noise: ChaCha8Rng::seed_from_u64(seed ^ 0x5eed_0001),
            still: (device.resonator(false), device.resonator(true)),
            ..*other
        }
    }

    fn normal(&mut self) -> f64 {
        let z: f64 = StandardNormal.sample(&mut self.noise);
        z * self.device.noise
    }

    /// Ratio and skew of the readout by now.
    pub fn detection(&self) -> (f64, f64) {
        let d = self.device;
        let ratio = d.ratio * (1.0 + d.drift_per_s * self.t) + self.wandered.0;
        (ratio, d.skew + self.wandered.1)
    }

    fn wander(&mut self) {
        let by = self.device.wander * CONTROL_S.sqrt() / self.device.noise;
        self.wandered.0 += by * self.normal();
        self.wandered.1 += by * self.normal();
    }

    /// One control step. Learns only where `learning`.
    pub fn step(&mut self, now: Moment, learning: bool) {
        let dt = CONTROL_S;
        if self.device.wander > 0.0 {
            self.wander();
        }
        let raw = self.device.read_by(self.detection(), &self.plant);
        let raw = Envelope::new(
            raw.x_c + self.normal(),
            raw.x_s + self.normal(),
            raw.y_c + self.normal(),
            raw.y_s + self.normal(),
        );
        let own = |v: f64| T::from_f64(v);
        let e = self
            .calibrator
            .readout(&self.state, &Envelope::new(own(raw.x_c), own(raw.x_s), own(raw.y_c), own(raw.y_s)));
        let e = Envelope::new(e.x_c.to_f64(), e.x_s.to_f64(), e.y_c.to_f64(), e.y_s.to_f64());
        let p = e.pendulum();
        let mut theta = p.angle();
        theta += PI * ((self.angle - theta) / PI).round();
        self.angle = theta;
        let (sin, cos) = theta.sin_cos();
        // loops
        self.energy += (p.e - 1.0) * dt;
        let v_as = 8.0 * ((p.e - 1.0) + self.energy / 0.5);
        self.quadrature += p.q * dt;
        let forward = self.calibrator.forward(&self.state, own(cos), own(sin), own(1.0));
        let v_qc = -8.0 * (p.q + self.quadrature / 0.5) + forward.quadrature_v.to_f64();
        // what doesn't learn doesn't precess for it either
        let v_qs = if learning { forward.precession_v.to_f64() } else { 0.0 } - self.asked_rad_s;
        self.phase += p.l * 200.0 * dt;
        let ahead = 40.0 * p.l + self.phase - forward.detuning_rad_s.to_f64();
        let wanted = AxisForces {
            x_c: -v_qc * sin,
            x_s: v_as * cos - v_qs * sin,
            y_c: v_qc * cos,
            y_s: v_as * sin + v_qs * cos,
        };
        let f = self.calibrator.drives(
            &self.state,
            &AxisForces { x_c: own(wanted.x_c), x_s: own(wanted.x_s), y_c: own(wanted.y_c), y_s: own(wanted.y_s) },
        );
        let f = AxisForces { x_c: f.x_c.to_f64(), x_s: f.x_s.to_f64(), y_c: f.y_c.to_f64(), y_s: f.y_s.to_f64() };
        self.row = Row { readout: raw, energy_v: v_as, quadrature_v: v_qc };
        let pendulum = cvg_model::Pendulum { e: own(p.e), q: own(p.q), r: own(p.r), s: own(p.s), l: own(p.l) };
        let commands = Commands { energy_v: own(v_as), precession_v: own(v_qs), quadrature_v: own(v_qc) };
        let direction = (own(cos), own(sin));
        let rate = self.calibrator.not_rotation(&self.state, &pendulum, direction, &commands);
        self.explained += rate.to_f64() * dt;
        if learning {
            let health = if now.disturbed { Health::Disturbed } else { Health::Operating };
            self.calibrator.step(&mut self.state, &pendulum, direction, &commands, health);
        }
        self.rotation = self.angle - self.explained;
        self.turn(now, &f, ahead);
        self.t += dt;
    }

    fn turn(&mut self, now: Moment, f: &AxisForces<f64>, ahead: f64) {
        let dt = CONTROL_S;
        let resonator = if now.tuned { &self.still.1 } else { &self.still.0 };
        let push = self.device.push(f);
        let rate = |e: &Envelope<f64>| resonator.envelope_rate(e, now.rate_rad_s, ahead) + push;
        let x = self.plant;
        let k1 = rate(&x);
        let k2 = rate(&(x + k1 * (0.5 * dt)));
        let k3 = rate(&(x + k2 * (0.5 * dt)));
        let k4 = rate(&(x + k3 * dt));
        self.plant = x + (k1 + k2 * 2.0 + k3 * 2.0 + k4) * (dt / 6.0);
    }
}

/// Rms of harmonics 1 to 8 of the pattern's angle in the error of the rotation, deg, at a constant rate, with what is in force and
/// no precession of its own.
pub fn bias_deg<T: Float>(device: &Device, state: &State<T>, corrected: bool, rate_deg_s: f64, seconds: f64) -> f64 {
    let mut run = Loop::<T>::new(device, 77, &Settings::default());
    run.state = *state;
    let moment = Moment { rate_rad_s: rate_deg_s.to_radians(), ..Moment::default() };
    let steps = (seconds / CONTROL_S) as usize;
    let mut series = Vec::new();
    for i in 0..steps {
        run.step(moment, false);
        if i % 8 == 0 && run.t > 1.0 {
            let (raw, out) = (run.angle, if corrected { run.rotation } else { run.angle });
            series.push((run.t, raw, out));
        }
    }
    harmonics_rms(&series)
}

/// Of (time, angle of the pattern, rotation).
fn harmonics_rms(series: &[(f64, f64, f64)]) -> f64 {
    const H: usize = 8;
    const M: usize = 2 + 2 * H;
    let line = |rows: &dyn Fn(usize) -> Vec<f64>, n: usize, m: usize| -> Vec<f64> {
        let mut a = vec![vec![0.0; m + 1]; m];
        for i in 0..n {
            let row = rows(i);
            for r in 0..m {
                for c in 0..=m {
                    a[r][c] += row[r] * row[c];
                }
            }
        }
        for i in 0..m {
            let p = (i..m).max_by(|x, y| a[*x][i].abs().total_cmp(&a[*y][i].abs())).expect("a row is left");
            a.swap(i, p);
            let pivot = a[i].clone();
            for (r, row) in a.iter_mut().enumerate() {
                if r != i {
                    let f = row[i] / pivot[i];
                    for (to, from) in row.iter_mut().zip(&pivot).skip(i) {
                        *to -= f * from;
                    }
                }
            }
        }
        (0..m).map(|i| a[i][m] / a[i][i]).collect()
    };
    let (t0, pattern0, rotation0) = series[series.len() / 2];
    let first = line(&|i| vec![series[i].0 - t0, 1.0, series[i].1 - pattern0], series.len(), 2);
    // harmonics of the pattern's angle, as far as it turns evenly
    let fit = line(
        &|i| {
            let t = series[i].0 - t0;
            let theta = first[0] * t + first[1] + pattern0;
            let mut row = vec![t, 1.0];
            for k in 1..=H {
                let (s, c) = (k as f64 * theta).sin_cos();
                row.push(c);
                row.push(s);
            }
            row.push(series[i].2 - rotation0);
            row
        },
        series.len(),
        M,
    );
    (0.5 * fit[2..].iter().map(|v| v * v).sum::<f64>()).sqrt().to_degrees()
}
