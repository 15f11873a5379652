//! The energy and the quadrature controller of Equation 3, and the discrete PI that runs both.
//!
//! Tuning rule. Let b = G_A/2ω (1/s per V, displacement in the readout's volts). Then ȧ = −b v_as and q̇ = +b v_qc
//! (Equation 9's frame, thin orbit), so that E = a² + q² and Q = 2aq move as
//!
//! $$\dot E = -2ab\,v_{as} - \tfrac{2}{\tau}E,\qquad \dot Q = +2ab\,v_{qc} - \tfrac2\tau Q .$$
//!
//! With Equation 3 each loop closes, damping of the resonator neglected, as
//!
//! $$s^2 + 2abK\,s + \frac{abK}{\tau_I} = 0 \quad\Rightarrow\quad K = \frac{\zeta\omega_n}{ab},\qquad \tau_I = \frac{\zeta}{\omega_n}.$$
//!
//! The file refuses to know which loop it runs: the signs of Equation 3 are in its two functions.

use cvg_model::{Float, Real};

use crate::{Command, ConfigError, Status, positive};

//= specs/equation-03.md#stable-loop
//# The averaged loop of energy and controller MUST be stable for every positive gain and every positive integration time.
/// The law that both controllers of Equation 3 share, K[e + (1/2τ)∫e dt].
#[inline]
fn law<T: Real>(gain: T, integration_time_s: T, error: T, integral: T) -> T {
    gain * (error + integral / (T::two() * integration_time_s))
}

//= specs/equation-03.md#signs
//# The energy output MUST be positive where the measured energy stays above its set value, and the quadrature output MUST be negative where the measured quadrature stays positive.
//= specs/equation-03.md#proportional-part
//# A step of the error MUST change the output at once by the gain times the step.
/// **Equation 3**, the energy controller:
///
/// $$v_{as} = +K_E\left[E_d - E_0 + \frac{1}{2\tau_E}\int (E_d-E_0)\,dt\right]$$
///
/// `gain` = K_E in V/V², `integration_time_s` = τ_E ≠ 0, `excess` = E_d − E_0 in V², `integral` = ∫(E_d − E_0)dt in
/// V² s. Positive while there is too much energy: with Equation 9 it then brakes. Source: the paper, Equation 3.
#[inline]
pub fn energy_control<T: Real>(gain: T, integration_time_s: T, excess: T, integral: T) -> T {
    law(gain, integration_time_s, excess, integral)
}

/// **Equation 3**, the quadrature controller:
///
/// $$v_{qc} = -K_Q\left[Q_d + \frac{1}{2\tau_Q}\int Q_d\,dt\right]$$
///
/// `gain` = K_Q in V/V², `integration_time_s` = τ_Q ≠ 0, `quadrature` = Q_d in V², `integral` = ∫Q_d dt in V² s.
/// Source: the paper, Equation 3.
#[inline]
pub fn quadrature_control<T: Real>(gain: T, integration_time_s: T, quadrature: T, integral: T) -> T {
    -law(gain, integration_time_s, quadrature, integral)
}

/// How a controller's output goes with its integral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sense {
    With,
    Against,
}

/// A discrete PI, K[e + (1/2τ)∫e dt], with a limit and without wind-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pi<T> {
    pub(crate) gain: T,
    pub(crate) integration_time_s: T,
    pub(crate) period_s: T,
    pub(crate) limit_v: T,
    /// 2τ·limit/K: the integral that alone commands the limit
    pub(crate) integral_limit: T,
}

/// The controller's state: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PiState<T> {
    /// ∫e dt, in the error's unit times s
    pub integral: T,
}

impl<T: Float> Default for PiState<T> {
    fn default() -> Self {
        Self { integral: T::zero() }
    }
}

impl<T: Float> Pi<T> {
    /// A controller of gain K (`gain`, > 0), integration time τ (`integration_time_s`, > 0), stepped every `period_s`
    /// (> 0), whose command stays within ±`limit_v` (> 0).
    ///
    /// # Errors
    /// A parameter outside its domain, or such extremes of them that 2τ·limit/K is not a finite positive number.
    pub fn new(gain: T, integration_time_s: T, period_s: T, limit_v: T) -> Result<Self, ConfigError> {
        let gain = positive(gain, "gain")?;
        let integration_time_s = positive(integration_time_s, "integration_time_s")?;
        let period_s = positive(period_s, "period_s")?;
        let limit_v = positive(limit_v, "limit_v")?;
        let time = positive(T::two() * integration_time_s, "integration_time_s")?;
        let integral_limit = positive(time * limit_v / gain, "2 integration_time_s limit_v/gain")?;
        Ok(Self { gain, integration_time_s, period_s, limit_v, integral_limit })
    }

    //= specs/dsp.md#tuning
    //# A disturbance of a loop MUST decay with the natural frequency and the damping ratio that the loop was tuned to.
    /// A controller for the energy or the quadrature of a vibration of amplitude `amplitude_v` under drive gain
    /// `drive_per_s_v` = b (1/s per V), by natural frequency (rad/s) and damping ratio: the tuning rule above.
    ///
    /// # Errors
    /// A parameter outside its domain (all > 0), or 2ζω_n T ≥ 1: a loop the period cannot realise.
    pub fn tuned(
        bandwidth_rad_s: T,
        damping: T,
        amplitude_v: T,
        drive_per_s_v: T,
        period_s: T,
        limit_v: T,
    ) -> Result<Self, ConfigError> {
        let bandwidth = positive(bandwidth_rad_s, "bandwidth_rad_s")?;
        let damping = positive(damping, "damping")?;
        let drive = positive(amplitude_v, "amplitude_v")? * positive(drive_per_s_v, "drive_per_s_v")?;
        realisable(bandwidth, damping, period_s)?;
        Self::new(damping * bandwidth / drive, damping / bandwidth, period_s, limit_v)
    }

    /// The gain K, V per unit of error.
    pub fn gain(&self) -> T {
        self.gain
    }

    /// The integration time τ, s.
    pub fn integration_time_s(&self) -> T {
        self.integration_time_s
    }

    /// The state whose integral alone commands `volts` (in the sense of v_as; −`volts` of v_qc).
    pub fn primed(&self, volts: T) -> PiState<T> {
        PiState { integral: (self.integral_limit * (volts / self.limit_v)).bounded(self.integral_limit) }
    }

    /// [`Pi::energy`] where nothing is at a limit: the volts. None, and nothing changed, elsewhere.
    #[inline(always)]
    pub fn energy_within(&self, state: &mut PiState<T>, e_d: T, e_0: T) -> Option<T> {
        self.step_within(state, e_d - e_0, energy_control)
    }

    /// [`Pi::quadrature`] where nothing is at a limit: the volts. None, and nothing changed, elsewhere.
    #[inline(always)]
    pub fn quadrature_within(&self, state: &mut PiState<T>, q_d: T) -> Option<T> {
        self.step_within(state, q_d, quadrature_control)
    }

    /// The energy controller's command v_as for measured energy `e_d` and set point `e_0`, V².
    #[inline]
    pub fn energy(&self, state: &mut PiState<T>, e_d: T, e_0: T) -> Command<T> {
        self.step(state, e_d - e_0, energy_control, Sense::With)
    }

    /// The quadrature controller's command v_qc for measured quadrature `q_d`, V².
    #[inline]
    pub fn quadrature(&self, state: &mut PiState<T>, q_d: T) -> Command<T> {
        self.step(state, q_d, quadrature_control, Sense::Against)
    }

    /// The command +K[e + (1/2τ)∫e dt] of a loop on any error `e`.
    #[inline]
    pub fn control(&self, state: &mut PiState<T>, e: T) -> Command<T> {
        self.step(state, e, law, Sense::With)
    }

    //= specs/equation-03.md#integral-part
    //# A constant error MUST change the output by the gain times the error times the time over twice the integration time.
    //= specs/equation-03.md#bounded-output
    //# The output MUST be finite and within its limit for every input.
    //= specs/equation-03.md#no-windup
    //# The integral MUST NOT grow in the direction in which the output is at its limit.
    //= specs/equation-03.md#recovery
    //# A finite error MUST be answered by the law or by the limit whatever the state was before.
    /// One sample of `controller` on the error `e`: proportional part of this sample, integral up to and including it.
    ///
    /// Where the command is limited the integral moves back only, in the sense in which the command goes with it
    /// (conditional integration), and alone never commands more than the limit. Total: an error that is not a number leaves the
    /// integral part alone.
    #[inline]
    fn step(&self, state: &mut PiState<T>, e: T, controller: impl Fn(T, T, T, T) -> T, sense: Sense) -> Command<T> {
        match self.step_within(state, e, &controller) {
            Some(volts) => Command { volts, status: Status::Within },
            None => self.beyond(state, e, controller, sense),
        }
    }

    /// The step where command and integral stay within their limits.
    #[inline(always)]
    fn step_within(&self, state: &mut PiState<T>, e: T, controller: impl Fn(T, T, T, T) -> T) -> Option<T> {
        let integral = state.integral + self.period_s * e;
        let asked = controller(self.gain, self.integration_time_s, e, integral);
        // false for any NaN
        if asked.within(self.limit_v) && integral.within(self.integral_limit) {
            state.integral = integral;
            return Some(asked);
        }
        None
    }

    /// The step where the command or the integral does not stay within its limit, or something is not a number.
    #[cold]
    #[inline(never)]
    fn beyond(&self, state: &mut PiState<T>, e: T, controller: impl Fn(T, T, T, T) -> T, sense: Sense) -> Command<T> {
        let command = |e: T, integral: T| controller(self.gain, self.integration_time_s, e, integral);
        let held = state.integral.bounded(self.integral_limit);
        let integral = (held + self.period_s * e).bounded(self.integral_limit);
        let asked = command(e, integral);
        if asked.within(self.limit_v) {
            state.integral = integral;
            Command { volts: asked, status: Status::Within }
        } else if asked.magnitude() > self.limit_v {
            let outward_is_up = (asked > T::zero()) == (sense == Sense::With);
            let is_inward = if outward_is_up { integral < held } else { integral > held };
            state.integral = if is_inward { integral } else { held };
            Command { volts: asked.bounded(self.limit_v), status: Status::Limited }
        } else {
            state.integral = held;
            Command { volts: command(T::zero(), held).bounded(self.limit_v), status: Status::Invalid }
        }
    }
}

/// 2ζω_n T < 1: below it the sampled loop follows the continuous one.
pub(crate) fn realisable<T: Float>(bandwidth_rad_s: T, damping: T, period_s: T) -> Result<(), ConfigError> {
    if T::two() * damping * bandwidth_rad_s * period_s < T::one() {
        Ok(())
    } else {
        Err(ConfigError { parameter: "bandwidth_rad_s", expected: "below 1/(2 damping period_s)" })
    }
}
