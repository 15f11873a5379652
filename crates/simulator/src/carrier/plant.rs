//! The resonator at its carrier, propagated from one sample of the converters to the next.
//!
//! With z = (x, y) and p = ż + kΩ×z, the velocity as seen from a frame that precesses with the pattern, Lynch's equations
//! lose the Coriolis and the Euler force. What is left is a rotation of z and p at −kΩ, and the equations at Ω = 0:
//!
//! $$\dot z = p - k\Omega\times z,\qquad
//!   \dot p = -k\Omega\times p - \Lambda(p - k\Omega\times z) - (\mathsf K + (k^2-k')\Omega^2)z + f .$$
//!
//! The equations at Ω = 0, under held forces, are one constant matrix, exact to rounding. The rotation by the angle
//! k∫Ω dt, and with it the terms of Λ and Ω² that go with the rate, act in half steps on either side (Strang). The
//! splitting is exact but for the anisotropies, which turn by kΩT ≈ 10⁻⁴ in a sample: their error is (kΩT)²/12 of
//! them. So the rate may be another one in every sample and no matrix exponential is needed.
//!
//! The state is (x, y, p_x/ω, p_y/ω).

use cvg_model::resonator::Resonator;
use cvg_model::resonator::carrier::Motion;
use cvg_model::{Envelope, Real};
use nalgebra::{Matrix4, Matrix4x2, SMatrix};

use crate::plant::reference_ahead;
use crate::stages::Spring;

/// The resonator between two samples of the converters.
#[derive(Clone, Debug)]
pub struct CarrierPlant {
    resonator: Resonator<f64>,
    period_s: f64,
    still: Transition,
    at_rate: Transition,
    rate_rad_s: f64,
    vibration: [f64; 4],
}

/// One sample: columns of the matrices on the state, on the forces held before the output changes and after.
#[derive(Clone, Copy, Debug)]
struct Transition {
    free: [[f64; 4]; 4],
    before: [[f64; 4]; 2],
    after: [[f64; 4]; 2],
}

impl CarrierPlant {
    /// The plant of `resonator` at rest, sampled every `period_s`. Drives have the gains `drive_per_s_v` = G_A/2ω of x
    /// and y (1/s per V); their outputs change `delay_s` (0 to `period_s`) after a sample.
    pub fn new(resonator: &Resonator<f64>, drive_per_s_v: [f64; 2], period_s: f64, delay_s: f64) -> Self {
        let omega = resonator.omega_rad_s;
        let mut generator = SMatrix::<f64, 6, 6>::zeros();
        for (column, unit) in (0..4).map(|i| (i, std::array::from_fn::<f64, 4, _>(|j| f64::from(u8::from(i == j))))) {
            let [x, y, p_x, p_y] = unit;
            let m = Motion { x, y, x_dot: omega * p_x, y_dot: omega * p_y };
            let d = resonator.acceleration(&m, &cvg_model::resonator::carrier::Rotation::default(), 0.0, 0.0);
            for (row, rate) in [d.x, d.y, d.x_dot / omega, d.y_dot / omega].into_iter().enumerate() {
                generator[(row, column)] = rate;
            }
        }
        // f/ω = G_A v/ω = 2bv
        generator[(2, 4)] = 2.0 * drive_per_s_v[0];
        generator[(3, 5)] = 2.0 * drive_per_s_v[1];
        let over = |time_s: f64| {
            let exact = (generator * time_s).exp();
            (Matrix4::from(exact.fixed_view::<4, 4>(0, 0)), Matrix4x2::from(exact.fixed_view::<4, 2>(0, 4)))
        };
        let (free, _) = over(period_s);
        let (rest, after) = over(period_s - delay_s);
        let (_, first) = over(delay_s);
        let still = Transition::of(&free, &(rest * first), &after);
        Self { resonator: *resonator, period_s, still, at_rate: still, rate_rad_s: 0.0, vibration: [0.0; 4] }
    }

    /// From now on the input rate is this, until it is set again.
    pub fn set_rate(&mut self, rate_rad_s: f64) {
        if rate_rad_s != self.rate_rad_s {
            self.rate_rad_s = rate_rad_s;
            let half = Matrix4::from_columns(&[0, 1, 2, 3].map(|i| {
                let unit = std::array::from_fn(|j| f64::from(u8::from(i == j)));
                nalgebra::Vector4::from(self.half_turn(unit, rate_rad_s))
            }));
            let (free, before, after) = self.still.matrices();
            self.at_rate = Transition::of(&(half * free * half), &(half * before), &(half * after));
        }
    }

    /// The input rate, rad/s.
    pub fn rate_rad_s(&self) -> f64 {
        self.rate_rad_s
    }

    /// One sample at the rate that is set: the drives hold `before` until their output changes, then `after`, V.
    #[inline]
    pub fn step(&mut self, before: [f64; 2], after: [f64; 2]) {
        self.step_from(self.vibration, before.map(|v| [v; 2]), after);
    }

    /// The same from a copy of the state that was taken before: whoever read it has it in registers. Each of `before` is
    /// given twice.
    #[inline]
    pub(super) fn step_from(&mut self, vibration: [f64; 4], before: [[f64; 2]; 2], after: [f64; 2]) {
        self.vibration = self.at_rate.apply(&vibration, before, after);
    }

    /// The state (x, y, p_x/ω, p_y/ω).
    #[inline]
    pub(super) fn state(&self) -> [f64; 4] {
        self.vibration
    }

    /// One sample in which the rate is `rate_rad_s` on average, whatever it was before.
    #[inline]
    pub fn step_at(&mut self, rate_rad_s: f64, before: [f64; 2], after: [f64; 2]) {
        let turned = self.half_turn(self.vibration, rate_rad_s);
        let moved = self.still.apply(&turned, before.map(|v| [v; 2]), after);
        self.vibration = self.half_turn(moved, rate_rad_s);
    }

    /// What an isotropic nonlinear spring does in a sample: the pattern turned by cQT, the phase by as much as goes with E.
    #[inline]
    pub fn bend(&mut self, spring: &Spring) {
        let e = self.vibration();
        let p = e.pendulum();
        let (sin, cos) = Real::sin_cos(spring.precession * p.q * self.period_s);
        self.set_vibration(&reference_ahead(&e.turned(sin, cos), -spring.frequency * p.e * self.period_s));
    }

    /// Half a sample of what goes with the rate.
    #[inline]
    fn half_turn(&self, [x, y, p_x, p_y]: [f64; 4], rate_rad_s: f64) -> [f64; 4] {
        let r = &self.resonator;
        let turn = r.angular_gain * rate_rad_s;
        let half = 0.5 * self.period_s;
        let (mut sin, mut cos) = (turn * half, 1.0 - 0.5 * (turn * half) * (turn * half));
        if sin.abs() < 1e-3 {
            // the first neglected terms are below 1e-17 and 5e-14
            sin -= sin * sin * sin * (1.0 / 6.0);
        } else {
            (sin, cos) = Real::sin_cos(turn * half);
        }
        // damping acts on the velocity in the body, p − kΩ×z with kΩ×z = kΩ(−y, x); Ω² stiffens the precessing frame
        let (dc, ds) = (r.anisodamping.cos2, r.anisodamping.sin2);
        let (v_x, v_y) = (-turn * y, turn * x);
        let stiff = (r.angular_gain * r.angular_gain - r.centrifugal_gain) * rate_rad_s * rate_rad_s;
        let share = half / r.omega_rad_s;
        let k_x = p_x + share * (2.0 * r.damping_per_s * v_x + dc * v_x + ds * v_y - stiff * x);
        let k_y = p_y + share * (2.0 * r.damping_per_s * v_y + ds * v_x - dc * v_y - stiff * y);
        [cos * x + sin * y, cos * y - sin * x, cos * k_x + sin * k_y, cos * k_y - sin * k_x]
    }

    /// The matrices of a sample at the rate that is set: on the state (x, y, p_x/ω, p_y/ω), on the voltages before the
    /// outputs change, and after.
    pub fn matrices(&self) -> (Matrix4<f64>, Matrix4x2<f64>, Matrix4x2<f64>) {
        self.at_rate.matrices()
    }

    /// Displacements of x and y.
    #[inline]
    pub fn displacement(&self) -> [f64; 2] {
        [self.vibration[0], self.vibration[1]]
    }

    /// The vibration as an envelope at the phase of this instant: its energy, quadrature and pattern angle are those of
    /// the orbit, whatever the phase.
    pub fn vibration(&self) -> Envelope<f64> {
        let [x, y, p_x, p_y] = self.vibration;
        Envelope::new(x, p_x, y, p_y)
    }

    /// Sets the vibration: an envelope at phase 0.
    pub fn set_vibration(&mut self, e: &Envelope<f64>) {
        self.vibration = [e.x_c, e.y_c, e.x_s, e.y_s];
    }

    /// Displacements and velocities in the body, as in the equation of motion.
    pub fn motion(&self) -> Motion<f64> {
        let [x, y, p_x, p_y] = self.vibration;
        let (omega, turn) = (self.resonator.omega_rad_s, self.resonator.angular_gain * self.rate_rad_s);
        Motion { x, y, x_dot: omega * p_x + turn * y, y_dot: omega * p_y - turn * x }
    }
}

impl Transition {
    fn of(free: &Matrix4<f64>, before: &Matrix4x2<f64>, after: &Matrix4x2<f64>) -> Self {
        Self { free: (*free).into(), before: (*before).into(), after: (*after).into() }
    }

    fn matrices(&self) -> (Matrix4<f64>, Matrix4x2<f64>, Matrix4x2<f64>) {
        (self.free.into(), self.before.into(), self.after.into())
    }

    #[inline]
    fn apply(&self, z: &[f64; 4], before: [[f64; 2]; 2], after: [f64; 2]) -> [f64; 4] {
        std::array::from_fn(|i| {
            let free =
                (self.free[0][i] * z[0] + self.free[1][i] * z[1]) + (self.free[2][i] * z[2] + self.free[3][i] * z[3]);
            let first = self.before[0][i] * before[0][i % 2] + self.before[1][i] * before[1][i % 2];
            let second = self.after[0][i] * after[0] + self.after[1][i] * after[1];
            free + (first + second)
        })
    }
}
