//! The resonator's envelope, propagated exactly from one control sample to the next.
//!
//! Between samples the forces are held, so the linear envelope moves by one matrix, ż = Az + Bv:
//!
//! $$z(t+T) = \Phi z(t) + \Gamma v,\qquad
//!   \begin{pmatrix}\Phi&\Gamma\\0&1\end{pmatrix} = \exp\left[\begin{pmatrix}A&B\\0&0\end{pmatrix}T\right],$$
//!
//! computed once for a rate and a period: a step is 4×8 multiplications and additions, and its only error is rounding.
//! What the matrix cannot hold (a rate that deviates from the nominal one, mechanics that are nonlinear or follow the
//! temperature) acts in half steps on either side of it (Strang splitting, error of third order in the step).
//!
//! It refuses to keep time: whoever steps it says what the rate deviation is, and at what moment.

use cvg_model::effects::Moment;
use cvg_model::resonator::Resonator;
use cvg_model::{AxisForces, Envelope, Real};
use nalgebra::SMatrix;

use crate::stages::{Setting, Spring, Stages, unit_envelopes};

/// One period of the linear envelope under held forces: columns of Φ and Γ.
#[derive(Clone, Debug, PartialEq)]
pub struct ExactStep {
    free: [[f64; 4]; 4],
    forced: [[f64; 4]; 4],
}

impl ExactStep {
    /// The step over `period_s` of an envelope that changes at `rate(z)` + `drive(v)` per second; both are linear.
    pub fn new(
        rate: impl Fn(&Envelope<f64>) -> Envelope<f64>,
        drive: impl Fn(&AxisForces<f64>) -> Envelope<f64>,
        period_s: f64,
    ) -> Self {
        let mut generator = SMatrix::<f64, 8, 8>::zeros();
        for (j, unit) in unit_envelopes().iter().enumerate() {
            let Envelope { x_c, x_s, y_c, y_s } = *unit;
            let moved = components(&rate(unit));
            let driven = components(&drive(&AxisForces { x_c, x_s, y_c, y_s }));
            for i in 0..4 {
                generator[(i, j)] = moved[i] * period_s;
                generator[(i, j + 4)] = driven[i] * period_s;
            }
        }
        let exact = generator.exp();
        let column = |j: usize| [exact[(0, j)], exact[(1, j)], exact[(2, j)], exact[(3, j)]];
        Self { free: [0, 1, 2, 3].map(column), forced: [4, 5, 6, 7].map(column) }
    }

    /// The envelope one period after `z`, with the drives held at `v`.
    #[inline]
    pub fn step(&self, z: &Envelope<f64>, v: &AxisForces<f64>) -> Envelope<f64> {
        let z = components(z);
        let v = [v.x_c, v.x_s, v.y_c, v.y_s];
        let next: [f64; 4] = core::array::from_fn(|i| {
            let free =
                (self.free[0][i] * z[0] + self.free[1][i] * z[1]) + (self.free[2][i] * z[2] + self.free[3][i] * z[3]);
            let forced = (self.forced[0][i] * v[0] + self.forced[1][i] * v[1])
                + (self.forced[2][i] * v[2] + self.forced[3][i] * v[3]);
            free + forced
        });
        Envelope::new(next[0], next[1], next[2], next[3])
    }
}

/// The mechanics of one run at one nominal rate.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    exact: ExactStep,
    nonlinear: Vec<Setting>,
    spring: Option<Spring>,
    angular_gain: f64,
    half_period_s: f64,
}

impl Plant {
    /// The plant of `resonator` with the mechanics and drives of `stages` at the nominal rate `rate_rad_s`.
    ///
    /// `ahead_rad_s` = ω − ω_r, the detuning of the uncorrected reference; `drive_per_s_v` = G_A/2ω, 1/s per V.
    pub fn new(
        resonator: &Resonator<f64>,
        stages: &Stages,
        rate_rad_s: f64,
        ahead_rad_s: f64,
        drive_per_s_v: f64,
        period_s: f64,
    ) -> Self {
        let linear = |e: &Envelope<f64>| {
            let free = resonator.envelope_rate(e, rate_rad_s, ahead_rad_s);
            stages.linear.iter().fold(free, |sum, (id, v)| sum + id.mechanics(v, e, &Moment::origin()))
        };
        let drive = |v: &AxisForces<f64>| stages.actuate(*v).envelope_rate(1.0 / drive_per_s_v);
        Self {
            exact: ExactStep::new(linear, drive, period_s),
            nonlinear: stages.nonlinear.clone(),
            spring: stages.spring,
            angular_gain: resonator.angular_gain,
            half_period_s: 0.5 * period_s,
        }
    }

    /// The envelope one period after `z`, drives held at `v`, the rate `deviation_rad_s` off the nominal one (its mean
    /// over the period), `at` the moment of what changes.
    #[inline]
    pub fn step(
        &self,
        z: &Envelope<f64>,
        v: &AxisForces<f64>,
        deviation_rad_s: f64,
        at: &Moment<f64>,
    ) -> Envelope<f64> {
        if self.is_linear() && deviation_rad_s == 0.0 {
            return self.exact.step(z, v);
        }
        // numbers in, numbers out: what the plain step works on then stays in registers
        let [x_c, x_s, y_c, y_s] =
            self.split_step([z.x_c, z.x_s, z.y_c, z.y_s], [v.x_c, v.x_s, v.y_c, v.y_s], deviation_rad_s, at);
        Envelope::new(x_c, x_s, y_c, y_s)
    }

    /// The step with half steps of what the matrix cannot hold on either side.
    #[inline(never)]
    fn split_step(
        &self,
        z: [f64; 4],
        [x_c, x_s, y_c, y_s]: [f64; 4],
        deviation_rad_s: f64,
        at: &Moment<f64>,
    ) -> [f64; 4] {
        let v = AxisForces { x_c, x_s, y_c, y_s };
        let z = Envelope::new(z[0], z[1], z[2], z[3]);
        let (sin, cos) = Real::sin_cos(-self.angular_gain * deviation_rad_s * self.half_period_s);
        let before = self.half_nonlinear(z, at).turned(sin, cos);
        let after = self.exact.step(&before, &v).turned(sin, cos);
        components(&self.half_nonlinear(after, at))
    }

    #[inline]
    fn is_linear(&self) -> bool {
        self.nonlinear.is_empty() && self.spring.is_none()
    }

    /// What the matrix cannot hold of the mechanics alone over half a period: one Runge–Kutta step of fourth order.
    fn half_nonlinear(&self, z: Envelope<f64>, at: &Moment<f64>) -> Envelope<f64> {
        if self.is_linear() {
            return z;
        }
        let h = self.half_period_s;
        let rate = |e: &Envelope<f64>| {
            let spring = self.spring.map_or(Envelope::zero(), |spring| spring.envelope_rate(e));
            self.nonlinear.iter().fold(spring, |sum, (id, v)| sum + id.mechanics(v, e, at))
        };
        let k1 = rate(&z);
        let k2 = rate(&(z + k1 * (0.5 * h)));
        let k3 = rate(&(z + k2 * (0.5 * h)));
        let k4 = rate(&(z + k3 * h));
        z + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0)
    }
}

/// The envelope as seen when the reference phase has moved ahead by `psi_rad`: (X, Y)·e^{−iψ}.
///
/// In lock ψ is small, and three terms of the series are exact to rounding; beyond, the functions themselves are used.
#[inline]
pub fn reference_ahead(z: &Envelope<f64>, psi_rad: f64) -> Envelope<f64> {
    let (sin, cos) = if psi_rad.abs() < SMALL_TURN_RAD {
        let p2 = psi_rad * psi_rad;
        // reciprocals as constants: a division takes as long as four multiplications
        let sin = psi_rad - psi_rad * p2 * (1.0 / 6.0 - p2 * (1.0 / 120.0));
        (sin, 1.0 - p2 * (0.5 - p2 * (1.0 / 24.0)))
    } else {
        Real::sin_cos(psi_rad)
    };
    *z * cos - z.quarter_ahead() * sin
}

/// Up to here the first neglected terms, ψ⁷/5040 and ψ⁶/720, are below 2e-16.
const SMALL_TURN_RAD: f64 = 7e-3;

#[inline]
fn components(e: &Envelope<f64>) -> [f64; 4] {
    [e.x_c, e.x_s, e.y_c, e.y_s]
}
