//! The orbit in variables that its phase does not enter: (E, R, S, Q), which obey linear equations whatever the orbit's
//! shape. A pattern angle has no meaning where the orbit is a circle; these have one everywhere, and white noise of the
//! envelope leaves the means of R, S and Q where they are, however small the vibration has become.
//!
//! Every coefficient is asked of the model: nothing of the mechanics is written down here a second time.

use cvg_model::effects::{EffectId, Moment};
use cvg_model::resonator::{Anisotropy, Resonator};
use cvg_model::{Envelope, Pendulum};
use nalgebra::{Matrix4, Vector4};

/// (E, R, S, Q), V².
pub(crate) type State = Vector4<f64>;

/// What a decay's mechanics are at one input rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mechanics {
    /// 1/τ, 1/s
    pub(crate) damping_per_s: f64,
    /// Δ(1/τ) along X–Y, 1/s
    pub(crate) anisodamping: [f64; 2],
    /// Δω along X–Y, rad/s
    pub(crate) anisoelasticity: [f64; 2],
    /// θ̇ of the input rotation, rad/s
    pub(crate) precession_rad_s: f64,
    /// θ̇ = cQ of an isotropic nonlinear spring, rad/s/V²
    pub(crate) spring: f64,
    /// ȧ = −γa³ beside the linear damping, 1/s/V²
    pub(crate) damping_growth: f64,
    /// θ̇ = p sin(4θ + φ), as (p cos φ, p sin φ), rad/s
    pub(crate) spring_four: [f64; 2],
}

/// The variables of a pendulum as a vector.
fn state(p: &Pendulum<f64>) -> State {
    Vector4::new(p.e, p.r, p.s, p.q)
}

/// (E, R, S, Q) of an envelope.
pub(crate) fn of(e: &Envelope<f64>) -> State {
    state(&e.pendulum())
}

/// Four vibrations from whose (E, R, S, Q) every linear map of them is known: along x, along y, between them, a circle.
const PROBES: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [std::f64::consts::FRAC_1_SQRT_2, 0.0, std::f64::consts::FRAC_1_SQRT_2, 0.0],
    [std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2],
];

/// The matrix of a linear map from what it makes of the probes, whose states are (1, ±1, 0, 0), (1, 0, 1, 0), (1, 0, 0, 1).
fn matrix(map: impl Fn(&Envelope<f64>) -> State) -> Matrix4<f64> {
    let [x, y, between, circle] = PROBES.map(|[x_c, x_s, y_c, y_s]| map(&Envelope::new(x_c, x_s, y_c, y_s)));
    let e = (x + y) * 0.5;
    Matrix4::from_columns(&[e, (x - y) * 0.5, between - e, circle - e])
}

impl Mechanics {
    fn resonator(&self) -> Resonator<f64> {
        let along = |[cos2, sin2]: [f64; 2]| Anisotropy { cos2, sin2 };
        Resonator {
            omega_rad_s: 0.0,
            angular_gain: 1.0,
            centrifugal_gain: 0.0,
            damping_per_s: self.damping_per_s,
            anisodamping: along(self.anisodamping),
            anisoelasticity: along(self.anisoelasticity),
        }
    }

    /// d/dt (E, R, S, Q) of the linear mechanics, from the envelope's equation of motion.
    pub(crate) fn generator(&self) -> Matrix4<f64> {
        let resonator = self.resonator();
        matrix(|e| state(&e.pendulum_rate(&resonator.envelope_rate(e, -self.precession_rad_s, 0.0))))
    }

    /// d/dt (x_c, x_s, y_c, y_s), for the phase, which (E, R, S, Q) do not have.
    pub(crate) fn envelope_generator(&self) -> Matrix4<f64> {
        let resonator = self.resonator();
        let column = |unit: Vector4<f64>| {
            let e = Envelope::new(unit[0], unit[1], unit[2], unit[3]);
            let rate = resonator.envelope_rate(&e, -self.precession_rad_s, 0.0);
            Vector4::new(rate.x_c, rate.x_s, rate.y_c, rate.y_s)
        };
        let unit = |i: usize| column(Vector4::ith(i, 1.0));
        Matrix4::from_columns(&[unit(0), unit(1), unit(2), unit(3)])
    }

    /// Whether a nonlinear spring precesses the orbit.
    pub(crate) fn precesses(&self) -> bool {
        self.spring != 0.0 || self.spring_four != [0.0, 0.0]
    }

    /// θ̇ of the nonlinear springs, rad/s. A circle has no orientation that the fourth harmonic could follow.
    pub(crate) fn precession_of_springs(&self, u: &State) -> f64 {
        let ([cos, sin], line) = (self.spring_four, u[1] * u[1] + u[2] * u[2]);
        // sin 4θ = 2RS/(R² + S²), cos 4θ = (R² − S²)/(R² + S²)
        let four = if line > 0.0 { (2.0 * cos * u[1] * u[2] + sin * (u[1] * u[1] - u[2] * u[2])) / line } else { 0.0 };
        self.spring * u[3] + four
    }

    /// What the nonlinear springs turn the orbit in `dt_s`, rad: by the rate half way, which errs by (p·dt)³.
    pub(crate) fn turned(&self, u: &State, dt_s: f64) -> f64 {
        let first = self.precession_of_springs(u) * dt_s;
        if self.spring_four == [0.0, 0.0] { first } else { self.precession_of_springs(&rotated(u, 0.5 * first)) * dt_s }
    }

    /// The nonlinear part alone over `dt_s`: precession holds E and Q, damping by γE holds the orbit's shape.
    pub(crate) fn nonlinear(&self, u: &State, dt_s: f64) -> State {
        let mut out = if self.precesses() { rotated(u, self.turned(u, dt_s)) } else { *u };
        if self.damping_growth != 0.0 {
            out /= (1.0 + 2.0 * self.damping_growth * u[0] * dt_s).max(f64::MIN_POSITIVE);
        }
        out
    }
}

/// The state of an orbit whose pattern is turned by an angle, rad.
fn rotated(u: &State, angle: f64) -> State {
    let (sin, cos) = (2.0 * angle).sin_cos();
    State::new(u[0], u[1] * cos - u[2] * sin, u[2] * cos + u[1] * sin, u[3])
}

/// What a cubic readout X(1 + ¾κ|X|²) of both channels makes of a state: |X|² = (E + R)/2, |Y|² = (E − R)/2, and S and Q go
/// with the product of both channels.
pub(crate) fn cubed(kappa: f64, u: &State) -> State {
    let [x2, y2] = [0.5 * (u[0] + u[1]), 0.5 * (u[0] - u[1])];
    let [gain_x, gain_y] = [x2, y2].map(|square| 1.0 + 0.75 * kappa * square);
    let [x2, y2] = [x2 * gain_x * gain_x, y2 * gain_y * gain_y];
    State::new(x2 + y2, x2 - y2, u[2] * gain_x * gain_y, u[3] * gain_x * gain_y)
}

/// What unequal gains, an oblique axis and a phase between the channels make of (E, R, S, Q).
pub(crate) fn readout(gain_ratio: f64, skew: f64, phase_rad: f64) -> Matrix4<f64> {
    let now = Moment::default();
    matrix(|e| {
        let skewed = EffectId::DetectionSkew.read(&[skew, 0.0, 0.0, 0.0], *e, &now);
        let scaled = EffectId::DetectionGainMismatch.read(&[gain_ratio, 0.0, 0.0, 0.0], skewed, &now);
        of(&EffectId::DetectionPhase.read(&[phase_rad, 0.0, 0.0, 0.0], scaled, &now))
    })
}

/// Terms of the series of a mean; the first that is left out is 1/3.6e6 of (‖B‖T)¹⁰/2¹⁰.
const MEAN_TERMS: u32 = 5;

/// The mean over `span_s` about an instant, of what is known at the instant: sinh(BT/2)/(BT/2).
pub(crate) fn mean(generator: &Matrix4<f64>, span_s: f64) -> Matrix4<f64> {
    let half = generator * (0.5 * span_s);
    let square = half * half;
    let (mut sum, mut term) = (Matrix4::identity(), Matrix4::identity());
    for k in 1..MEAN_TERMS {
        let k = f64::from(k);
        term = term * square / (2.0 * k * (2.0 * k + 1.0));
        sum += term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use cvg_model::resonator::averaged::Averages;

    const M: Mechanics = Mechanics {
        damping_per_s: 0.05,
        anisodamping: [0.011, -0.007],
        anisoelasticity: [0.31, 0.17],
        precession_rad_s: 0.4,
        spring: 0.03,
        damping_growth: 0.02,
        spring_four: [0.0; 2],
    };

    #[test]
    fn the_linear_equations_are_lynchs_averages() {
        let resonator = M.resonator();
        for (e, q, theta) in [(1.0, 0.1, 0.3), (2.0, -1.1, 1.2), (0.4, 0.0, -0.7)] {
            let averages = Averages { e, q, theta };
            let rate = resonator.averaged_rate(&averages, -M.precession_rad_s);
            let line = f64::sqrt(e * e - q * q);
            let u = State::new(e, line * (2.0 * theta).cos(), line * (2.0 * theta).sin(), q);
            let d = M.generator() * u;
            let turn = (u[1] * d[2] - u[2] * d[1]) / (2.0 * line * line);
            assert!((d[0] - rate.e).abs() < 1e-12 && (d[3] - rate.q).abs() < 1e-12, "{d} {rate:?}");
            assert!((turn - rate.theta).abs() < 1e-12, "{turn} {}", rate.theta);
        }
    }

    #[test]
    fn the_nonlinear_part_precesses_with_quadrature_and_decays_with_energy() {
        let u = State::new(2.0, 1.2, 0.5, (4.0 - 1.44 - 0.25f64).sqrt());
        let dt = 1e-6;
        let d = (M.nonlinear(&u, dt) - u) / dt;
        let theta_dot = (u[1] * d[2] - u[2] * d[1]) / (2.0 * (u[1] * u[1] + u[2] * u[2]));
        assert!((theta_dot - M.spring * u[3]).abs() < 1e-6, "{theta_dot}");
        assert!((d[0] + 2.0 * M.damping_growth * u[0] * u[0]).abs() < 1e-5, "{}", d[0]);
    }

    #[test]
    fn a_spring_that_goes_with_four_times_the_angle_precesses_as_the_librarys() {
        let (e, p) = (Envelope::new(0.8, 0.1, -0.3, 0.2), [0.03, -0.02, 0.0, 0.0]);
        let m = Mechanics { spring: 0.0, spring_four: [p[0], p[1]], ..M };
        let rate = e.pendulum_rate(&EffectId::SpringCubic.mechanics(&p, &e, &Moment::origin()));
        let u = of(&e);
        let theta_dot = (u[1] * rate.s - u[2] * rate.r) / (2.0 * (u[1] * u[1] + u[2] * u[2]));
        assert!((m.precession_of_springs(&u) - theta_dot).abs() < 1e-12);
        // one long step, as a hundred short ones
        let mut slow = u;
        for _ in 0..100 {
            slow = rotated(&slow, m.turned(&slow, 0.01));
        }
        assert!((rotated(&u, m.turned(&u, 1.0)) - slow).norm() < 2e-5);
    }

    #[test]
    fn a_cubic_readout_acts_on_states_as_on_envelopes() {
        let e = Envelope::new(0.3, -0.2, 0.7, 0.4);
        let read = EffectId::DetectionCubic.read(&[0.05, 0.0, 0.0, 0.0], e, &Moment::default());
        assert!((cubed(0.05, &of(&e)) - of(&read)).norm() < 1e-12);
    }

    #[test]
    fn a_mean_over_a_span_is_that_of_many_instants() {
        let (b, u) = (M.generator(), State::new(1.0, 0.6, 0.0, 0.8));
        let span = 2.0;
        let n = 2000;
        let at = |i: i32| (b * (span * (f64::from(i) + 0.5) / f64::from(n) - 0.5 * span)).exp() * u;
        let slow = (0..n).map(at).sum::<State>() / f64::from(n);
        assert!((mean(&b, span) * u - slow).norm() < 1e-6);
    }

    #[test]
    fn a_readout_acts_on_states_as_on_envelopes() {
        let e = Envelope::new(0.3, -0.2, 0.7, 0.4);
        let (y_c, y_s) = (1.02 * (0.7 + 0.05 * 0.3), 1.02 * (0.4 - 0.05 * 0.2));
        let (sin, cos) = 0.24f64.sin_cos();
        let late = Envelope::new(0.3, -0.2, y_c * cos - y_s * sin, y_s * cos + y_c * sin);
        assert!((readout(1.02, 0.05, 0.24) * of(&e) - of(&late)).norm() < 1e-12);
    }
}
