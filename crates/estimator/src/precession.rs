//! How the pattern moves from window to window, without an angle: its precession, jumps, and half turns.
//!
//! The unit vector (cos 2θ, sin 2θ) = (R, S)/√(R² + S²) of one window against that of the last gives sin 2Δθ. Its
//! low-pass is the precession rate, by which a direction that is known late is turned ahead to when it is used. The
//! count of half turns is that of Equation 4's branch cut being crossed, so that the unwrapped angle is an arctangent
//! only for whoever reads it.

use cvg_model::{Float, Pendulum, Real};

use crate::{ConfigError, Direction};

/// The tracker's configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precession<T> {
    pub(crate) share: T,
    pub(crate) jump_sin_2: T,
    /// half the lead, in windows
    pub(crate) half_lead: T,
    pub(crate) window_s: T,
    pub(crate) least_2: T,
}

/// The tracker's state: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrecessionState<T> {
    /// cos 2θ of the last window, 0 before the first
    pub cos_2: T,
    /// sin 2θ of the last window
    pub sin_2: T,
    /// low-passed sin 2Δθ from window to window
    pub sin_2_per_window: T,
    /// how often θ has passed 90°, with sign: whole periods of 180°
    pub half_turns: i32,
}

impl<T: Float> Default for PrecessionState<T> {
    fn default() -> Self {
        Self { cos_2: T::zero(), sin_2: T::zero(), sin_2_per_window: T::zero(), half_turns: 0 }
    }
}

/// What moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Movement {
    /// as far as a pattern may move in a window
    Steady,
    /// farther
    Jumped,
    /// no direction in this window or the last
    Unknown,
}

impl<T: Float> Precession<T> {
    /// A tracker of windows of `window_s` (> 0). The rate's low-pass has the time constant `smoothing_s` (≥ window_s);
    /// a pattern that moves faster than `fastest_rad_s` and by more than `least_jump_rad` in a window has jumped (a
    /// jump has to be below 45°); directions are turned ahead by `lead_s` (≥ 0); a line amplitude √(a² − q²) below
    /// `least_v` has no direction, which is above 4e-10 V in `f32`.
    ///
    /// # Errors
    /// A parameter outside its domain.
    pub fn new(
        window_s: f64,
        smoothing_s: f64,
        fastest_rad_s: f64,
        least_jump_rad: f64,
        lead_s: f64,
        least_v: f64,
    ) -> Result<Self, ConfigError> {
        let refused = |parameter, expected| Err(ConfigError { parameter, expected });
        if !(window_s > 0.0 && window_s.is_finite()) {
            return refused("window_s", "finite and positive");
        }
        if !(smoothing_s >= window_s && smoothing_s.is_finite()) {
            return refused("smoothing_s", "finite and not below window_s");
        }
        let jump = fastest_rad_s * window_s + least_jump_rad;
        if !(fastest_rad_s > 0.0 && least_jump_rad > 0.0 && jump < core::f64::consts::FRAC_PI_4) {
            return refused("fastest_rad_s", "positive, and with least_jump_rad below 45 degrees a window");
        }
        if !(lead_s >= 0.0 && lead_s < 10.0 * window_s) {
            return refused("lead_s", "not negative and below ten windows");
        }
        let least_2 = T::from_f64(least_v * least_v);
        // the square that a root is taken of has all its digits: it is less than its next neighbour, and finite
        let square = least_2 * least_2;
        if !(least_v > 0.0 && square * (T::one() + T::epsilon()) > square) {
            return refused(
                "least_v",
                "positive, its fourth power neither below nor beyond the numbers of full precision",
            );
        }
        Ok(Self {
            share: T::from_f64(window_s / smoothing_s),
            jump_sin_2: T::from_f64(Real::sin_cos(2.0 * jump).0),
            half_lead: T::from_f64(0.5 * lead_s / window_s),
            window_s: T::from_f64(window_s),
            least_2,
        })
    }

    //= specs/equation-04.md#unwrapping
    //# The unwrapped angle MUST follow the pattern over any number of turns as long as it turns less than 90° from one sample to the next.
    //= specs/dsp.md#unwrapping
    //# The unwrapped angle MUST follow a turning pattern through any number of half turns without a jump.
    /// Follows the pattern to the window of the pendulum variables `p`. Total.
    #[inline]
    pub fn step(&self, state: &mut PrecessionState<T>, p: &Pendulum<T>) -> Movement {
        if self.step_steadily(state, p) { Movement::Steady } else { self.step_otherwise(state, p) }
    }

    /// [`Precession::step`] of a pattern that moves steadily and on one side of the R axis. False, and nothing changed,
    /// elsewhere.
    #[inline(always)]
    pub fn step_steadily(&self, state: &mut PrecessionState<T>, p: &Pendulum<T>) -> bool {
        let line = p.r.norm(p.s);
        // false for NaN
        let directed = line > self.least_2;
        if !directed {
            return false;
        }
        let (cos_2, sin_2) = twice_the_angle(p, line);
        self.turn_steadily(state, cos_2, sin_2)
    }

    /// Follows a direction that has moved steadily. False, and nothing changed, elsewhere.
    #[inline(always)]
    pub(crate) fn turn_steadily(&self, state: &mut PrecessionState<T>, cos_2: T, sin_2: T) -> bool {
        let (along, across) = state.turn(cos_2, sin_2);
        let sin_2_per_window = state.smoothed(self.share, across);
        // false for any NaN; the state may hold anything
        let steady = (along - T::one()).within(T::ratio(3, 8))
            && across.within(self.jump_sin_2)
            && sin_2 * state.sin_2 > T::zero()
            && sin_2_per_window.within(self.jump_sin_2);
        if steady {
            *state = PrecessionState { cos_2, sin_2, sin_2_per_window, ..*state };
        }
        steady
    }

    /// [`Precession::step`] where [`Precession::step_steadily`] was false.
    #[cold]
    #[inline(never)]
    pub fn step_otherwise(&self, state: &mut PrecessionState<T>, p: &Pendulum<T>) -> Movement {
        let line = p.r.norm(p.s);
        // false for NaN
        if !(line > self.least_2 && line.is_finite()) {
            *state = PrecessionState { half_turns: state.half_turns, ..PrecessionState::default() };
            return Movement::Unknown;
        }
        let (cos_2, sin_2) = twice_the_angle(p, line);
        self.turn_anyhow(state, cos_2, sin_2)
    }

    /// Follows a direction, however it has moved.
    #[inline(always)]
    pub(crate) fn turn_anyhow(&self, state: &mut PrecessionState<T>, cos_2: T, sin_2: T) -> Movement {
        let (before_cos, before_sin) = (state.cos_2, state.sin_2);
        let (along, across) = state.turn(cos_2, sin_2);
        (state.cos_2, state.sin_2) = (cos_2, sin_2);
        // the state may hold anything: a pair that is no unit vector is no last direction
        if !(along <= T::two() && (along.magnitude() + across.magnitude()) > T::half()) {
            state.sin_2_per_window = T::zero();
            return Movement::Unknown;
        }
        // Equation 4 jumps by 180° where the negative R axis is crossed
        if cos_2 + before_cos < T::zero() {
            if before_sin >= T::zero() && sin_2 < T::zero() {
                state.half_turns = state.half_turns.saturating_add(1);
            } else if before_sin < T::zero() && sin_2 >= T::zero() {
                state.half_turns = state.half_turns.saturating_sub(1);
            }
        }
        if along > T::zero() && across.within(self.jump_sin_2) {
            state.sin_2_per_window = state.smoothed(self.share, across).bounded(self.jump_sin_2);
            Movement::Steady
        } else {
            Movement::Jumped
        }
    }

    /// The direction where the pattern will be when it is used. For the small angles of the lead, to second order.
    #[inline(always)]
    pub fn ahead(&self, state: &PrecessionState<T>, d: &Direction<T>) -> Direction<T> {
        let psi = state.sin_2_per_window.bounded(self.jump_sin_2) * self.half_lead;
        let length = T::one() - T::half() * psi * psi;
        Direction { cos: d.cos * length - d.sin * psi, sin: d.sin * length + d.cos * psi, status: d.status }
    }

    /// The precession rate θ̇, low-passed, rad/s.
    pub fn rate_rad_s(&self, state: &PrecessionState<T>) -> T {
        T::half() * state.sin_2_per_window.bounded(self.jump_sin_2) / self.window_s
    }
}

/// The unit vector (cos 2θ, sin 2θ) = (R, S)/`line` of an orbit whose √(R² + S²) is `line` > 0.
#[inline(always)]
pub fn twice_the_angle<T: Real>(p: &Pendulum<T>, line: T) -> (T, T) {
    let scale = T::one() / line;
    (p.r * scale, p.s * scale)
}

/// The angle in [−90°, 90°], rad, of (cos 2θ, sin 2θ): **Equation 4** of a unit vector.
#[inline]
pub fn half_the_angle<T: Real>(cos_2: T, sin_2: T) -> T {
    let zero = T::zero();
    // −0 + 0 = 0: Equation 4 puts the cut's own points on its positive side
    Pendulum { e: T::one(), q: zero, r: cos_2, s: sin_2 + zero, l: zero }.angle()
}

impl<T: Float> PrecessionState<T> {
    /// Cosine and sine of twice the angle from the last direction to the one of (`cos_2`, `sin_2`).
    #[inline(always)]
    fn turn(&self, cos_2: T, sin_2: T) -> (T, T) {
        (cos_2 * self.cos_2 + sin_2 * self.sin_2, sin_2 * self.cos_2 - cos_2 * self.sin_2)
    }

    /// The low-passed motion after one of `across`.
    #[inline(always)]
    fn smoothed(&self, share: T, across: T) -> T {
        self.sin_2_per_window + share * (across - self.sin_2_per_window)
    }

    /// A direction is known: of the last window.
    pub fn is_directed(&self) -> bool {
        self.cos_2 != T::zero() || self.sin_2 != T::zero()
    }

    /// The unwrapped angle as half turns and the angle within (−90°, 90°], rad: **Equation 4** with its jumps counted.
    /// 0 where there is no direction.
    pub fn angle(&self) -> (i32, T) {
        (self.half_turns, half_the_angle(self.cos_2, self.sin_2).bounded(T::half() * T::PI))
    }

    //= specs/electronics.md#certified-angle
    //# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
    /// The unwrapped angle in degrees, in double precision.
    pub fn degrees(&self) -> f64 {
        let (half_turns, within) = self.angle();
        180.0 * f64::from(half_turns) + within.to_f64().to_degrees()
    }
}
