//! The pattern angle of Equation 4, unwrapped.
//!
//! A pattern's angle comes back to itself after 180°, a full-turn sensor's after 360°. Whole periods are counted in an
//! integer, apart from the angle within the period, so that `f32` keeps its resolution after hours of rotation.
//!
//! It refuses to smooth: a reading is the angle of this envelope and of no other. What turns by more than half a
//! period between two steps is counted wrongly; no tracker can know.

use cvg_model::{Envelope, Float};

use crate::{ConfigError, Status};

/// After which rotation the measured angle is the same again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Period {
    /// 180°: a vibration pattern, θ = ½ atan2(S, R)
    Pattern,
    /// 360°: a sin/cos sensor, θ = atan2(y_c, x_c)
    FullTurn,
}

/// The tracker's configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatternAngle<T> {
    period: Period,
    least_v: T,
}

/// The tracker's state: plain data, any content is admissible.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngleState<T> {
    /// whole periods counted so far
    pub periods: i64,
    /// the last angle within its period, rad; not a number before the first valid reading
    pub within_rad: T,
}

/// One reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<T> {
    /// the angle is `periods` × the period + `within_rad`
    pub periods: i64,
    /// in (−½, ½] of the period, rad
    pub within_rad: T,
    /// whether this step measured it
    pub status: Status,
}

impl<T: Float> Default for AngleState<T> {
    fn default() -> Self {
        Self { periods: 0, within_rad: T::from_f64(f64::NAN) }
    }
}

impl Period {
    /// The period in degrees, for reports.
    pub const fn degrees(self) -> f64 {
        match self {
            Self::Pattern => 180.0,
            Self::FullTurn => 360.0,
        }
    }

    #[inline]
    fn half_rad<T: Float>(self) -> T {
        match self {
            Self::Pattern => T::PI * T::half(),
            Self::FullTurn => T::PI,
        }
    }
}

impl<T: Float> PatternAngle<T> {
    /// A tracker. `least_v` (V, ≥ 0): vibrations whose line amplitude √|a² − q²| is not above it have no direction.
    ///
    /// # Errors
    /// A `least_v` that is negative or not finite.
    ///
    /// ```
    /// use cvg_estimator::{AngleState, PatternAngle, Period};
    /// use cvg_model::Orbit;
    ///
    /// let tracker = PatternAngle::<f32>::new(Period::Pattern, 1e-3)?;
    /// let mut state = AngleState::default();
    /// // three turns of the pattern, 10° at a time
    /// for i in 0..=108 {
    ///     let theta = (10.0 * i as f32).to_radians();
    ///     let reading = tracker.step(&mut state, &Orbit { a: 1.0, q: 0.0, theta, delta: 0.0 }.envelope());
    ///     let unwrapped = reading.periods as f32 * 180.0 + reading.within_rad.to_degrees();
    ///     assert!((unwrapped - 10.0 * i as f32).abs() < 1e-2);
    /// }
    /// # Ok::<(), cvg_estimator::ConfigError>(())
    /// ```
    pub fn new(period: Period, least_v: T) -> Result<Self, ConfigError> {
        if least_v >= T::zero() && least_v.is_finite() {
            Ok(Self { period, least_v })
        } else {
            Err(ConfigError { parameter: "least_v", expected: "finite and not negative" })
        }
    }

    /// The period in use.
    pub fn period(&self) -> Period {
        self.period
    }

    //= specs/equation-04.md#unwrapping
    //# The unwrapped angle MUST follow the pattern over any number of turns as long as it turns less than 90° from one sample to the next.
    //= specs/electronics.md#reading-within-its-period
    //# The reading of the pattern angle MUST be finite and within half its period of zero for every input and every state.
    //= specs/electronics.md#reading-is-held
    //# An envelope without a direction MUST leave the reading as it was and say so.
    //= specs/electronics.md#reading-recovers
    //# The first envelope with a direction MUST give the angle of that envelope whatever was read before.
    /// Reads the angle of `e` and counts the periods passed.
    ///
    /// Total: an envelope without a direction, or not finite, holds the last reading and says so; a state of any
    /// content gives a reading with `within_rad` finite and inside its period.
    #[inline]
    pub fn step(&self, state: &mut AngleState<T>, e: &Envelope<T>) -> Reading<T> {
        let half = self.period.half_rad::<T>();
        let known = state.within_rad >= -half && state.within_rad <= half;
        let (angle, status) = self.measure(e);
        if matches!(status, Status::Valid) {
            if known {
                let moved = angle - state.within_rad;
                if moved > half {
                    state.periods = state.periods.saturating_sub(1);
                } else if moved < -half {
                    state.periods = state.periods.saturating_add(1);
                }
            }
            state.within_rad = angle;
            Reading { periods: state.periods, within_rad: angle, status }
        } else {
            let held = if known { state.within_rad } else { T::zero() };
            Reading { periods: state.periods, within_rad: held, status }
        }
    }

    /// The angle of this envelope alone, rad, within one period.
    #[inline]
    fn measure(&self, e: &Envelope<T>) -> (T, Status) {
        let least_2 = self.least_v * self.least_v;
        let (angle, line_2) = match self.period {
            Period::Pattern => {
                let p = e.pendulum();
                (p.angle(), p.r.norm(p.s))
            }
            Period::FullTurn => (e.y_c.atan2(e.x_c), e.x_c * e.x_c + e.y_c * e.y_c),
        };
        // the angle of what has a finite length is finite
        if !line_2.is_finite() {
            (T::zero(), Status::Invalid)
        } else if line_2 > least_2 {
            let half = self.period.half_rad::<T>();
            (angle.bounded(half), Status::Valid)
        } else {
            (T::zero(), Status::Undetermined)
        }
    }
}

impl<T: Float> Reading<T> {
    /// The unwrapped angle in degrees, in double precision.
    pub fn degrees(&self, period: Period) -> f64 {
        #[allow(clippy::cast_precision_loss, reason = "2^53 periods are not reached")]
        let periods = self.periods as f64;
        periods * period.degrees() + self.within_rad.to_f64().to_degrees()
    }
}
