//! Envelope, orbit and pendulum variables: three descriptions of one elliptical vibration (Equations 2 and 4).
//!
//! Reference phase φ_r: in-phase = cos, quadrature = sin, so x(t) = x_c cos φ_r + x_s sin φ_r and, as a phasor,
//! X = x_c − i x_s with x = Re[X e^{iφ_r}]. The orbit's angle θ has period 180°: θ and θ + 180° are one state.

use core::ops::{Add, Mul, Neg, Sub};

use crate::Real;

/// In-phase and quadrature components of the vibration along X and Y (displacement, or volts at the readout).
///
/// The same four numbers describe a rate of change of the envelope, and the electronics' view of it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Envelope<T> {
    /// in-phase, X
    pub x_c: T,
    /// quadrature, X
    pub x_s: T,
    /// in-phase, Y
    pub y_c: T,
    /// quadrature, Y
    pub y_s: T,
}

/// The pendulum variables of Equation 2, with Lynch's L that the phase-locked loop nulls.
///
/// E² = Q² + R² + S² for every envelope, exactly.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pendulum<T> {
    /// energy, a² + q²
    pub e: T,
    /// quadrature, 2aq
    pub q: T,
    /// (a² − q²) cos 2θ
    pub r: T,
    /// (a² − q²) sin 2θ
    pub s: T,
    /// phase error: −(a² − q²) sin 2δ
    pub l: T,
}

/// The ellipse itself.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Orbit<T> {
    /// semi-major axis a ≥ 0
    pub a: T,
    /// semi-minor axis q, signed by the sense of circulation, |q| ≤ a
    pub q: T,
    /// orientation θ, rad
    pub theta: T,
    /// phase of the vibration ahead of the reference, δ, rad
    pub delta: T,
}

impl<T: Real> Envelope<T> {
    /// The envelope (`x_c`, `x_s`, `y_c`, `y_s`).
    #[inline]
    pub fn new(x_c: T, x_s: T, y_c: T, y_s: T) -> Self {
        Self { x_c, x_s, y_c, y_s }
    }

    /// An envelope at rest.
    #[inline]
    pub fn zero() -> Self {
        Self::new(T::zero(), T::zero(), T::zero(), T::zero())
    }

    /// The envelope i·(X, Y): a quarter period ahead. i(x_c − i x_s) = x_s + i x_c.
    #[inline]
    pub fn quarter_ahead(self) -> Self {
        Self::new(self.x_s, -self.x_c, self.y_s, -self.y_c)
    }

    /// The pattern turned by an angle given by its sine and cosine, in the X–Y plane.
    #[inline]
    pub fn turned(self, sin: T, cos: T) -> Self {
        Self::new(
            cos * self.x_c - sin * self.y_c,
            cos * self.x_s - sin * self.y_s,
            sin * self.x_c + cos * self.y_c,
            sin * self.x_s + cos * self.y_s,
        )
    }

    //= specs/equation-02.md#axes-and-orientation
    //# The variables of an orbit MUST be E = a² + q², Q = 2aq, R = (a² − q²) cos 2θ, S = (a² − q²) sin 2θ and L = −(a² − q²) sin 2δ.
    //= specs/equation-02.md#energy-identity
    //# The square of E MUST equal the sum of the squares of Q, R and S.
    //= specs/equation-02.md#rotation-of-the-pattern
    //# Turning the pattern by an angle MUST turn the point (R, S) by twice that angle and leave E and Q as they were.
    //= specs/equation-02.md#phase-of-the-reference
    //# Shifting the phase of the reference MUST leave E, Q, R and S as they were.
    //= specs/equation-02.md#half-a-turn
    //# The variables of an orbit and of the same orbit turned by 180° MUST be identical bit for bit.
    //= specs/equation-02.md#sense-of-circulation
    //# The quadrature MUST be positive where Y follows X by a quarter of a period.
    //= specs/equation-02.md#energy-is-not-negative
    //# The energy MUST be zero or more, or NaN where a component of the envelope is NaN.
    //= specs/equation-02.md#energy-bounds-the-orientation
    //# The magnitude of R MUST NOT exceed E.
    //= specs/electronics.md#envelope-error
    //# The sine of half the angle between the points of two envelopes on the sphere of Equation 2 MUST NOT exceed the length of their difference over the length of either.
    /// **Equation 2**, the pendulum variables:
    ///
    /// $$E = x_c^2+x_s^2+y_c^2+y_s^2,\quad Q = 2(x_c y_s - y_c x_s),$$
    /// $$R = x_c^2+x_s^2-y_c^2-y_s^2,\quad S = 2(x_c y_c + y_s x_s),\quad L = 2(x_c x_s + y_c y_s).$$
    ///
    /// Units: the square of the envelope's. Domain: all reals. Source: the paper, Equation 2; L: Lynch 1995.
    #[inline]
    pub fn pendulum(&self) -> Pendulum<T> {
        let Self { x_c, x_s, y_c, y_s } = *self;
        let (x2, y2) = (x_c * x_c + x_s * x_s, y_c * y_c + y_s * y_s);
        Pendulum {
            e: x2 + y2,
            q: T::two() * (x_c * y_s - y_c * x_s),
            r: x2 - y2,
            s: T::two() * (x_c * y_c + y_s * x_s),
            l: T::two() * (x_c * x_s + y_c * y_s),
        }
    }

    //= specs/equation-02.md#rates
    //# The rates of the variables MUST be the derivatives of the variables along the rate of the envelope.
    /// The rates of the pendulum variables when the envelope changes at `rate`: the derivative of Equation 2.
    #[inline]
    pub fn pendulum_rate(&self, rate: &Self) -> Pendulum<T> {
        let (z, d) = (self, rate);
        let x = T::two() * (z.x_c * d.x_c + z.x_s * d.x_s);
        let y = T::two() * (z.y_c * d.y_c + z.y_s * d.y_s);
        let two = T::two();
        Pendulum {
            e: x + y,
            q: two * (d.x_c * z.y_s + z.x_c * d.y_s - d.y_c * z.x_s - z.y_c * d.x_s),
            r: x - y,
            s: two * (d.x_c * z.y_c + z.x_c * d.y_c + d.y_s * z.x_s + z.y_s * d.x_s),
            l: two * (d.x_c * z.x_s + z.x_c * d.x_s + d.y_c * z.y_s + z.y_c * d.y_s),
        }
    }

    /// The precession rate θ̇ in rad/s when the envelope changes at `rate` per second, exactly:
    ///
    /// $$\dot\theta = \tfrac12\,\frac{R\dot S - S\dot R}{R^2+S^2}$$
    ///
    /// Domain: not a circular orbit (R² + S² > 0).
    #[inline]
    pub fn precession(&self, rate: &Self) -> T {
        let (p, d) = (self.pendulum(), self.pendulum_rate(rate));
        T::half() * (p.r * d.s - p.s * d.r) / (p.r * p.r + p.s * p.s)
    }

    /// The ellipse of this envelope. Phase δ is in [−90°, 90°], θ in (−180°, 180°] such that the major axis carries
    /// the in-phase vibration; a circular orbit (R = S = 0) gives θ = 0.
    ///
    /// Inverse of [`Orbit::envelope`].
    pub fn orbit(&self) -> Orbit<T> {
        let p = self.pendulum();
        let theta = p.angle();
        let (sin, cos) = theta.sin_cos();
        let along = self.turned(-sin, cos);
        // Along the major axis U = a e^{iδ}; θ + 180° is the same ellipse with U → −U: choose Re U ≥ 0.
        let turn_back = along.x_c < T::zero();
        let (u_c, u_s) = if turn_back { (-along.x_c, -along.x_s) } else { (along.x_c, along.x_s) };
        let a = u_c.norm(u_s);
        let theta = if turn_back { opposite(theta) } else { theta };
        let q = if a > T::zero() { p.q / (T::two() * a) } else { T::zero() };
        Orbit { a, q, theta, delta: (-u_s).atan2(u_c) }
    }
}

/// The same direction half a turn away, kept in (−π, π].
#[inline]
fn opposite<T: Real>(theta: T) -> T {
    let pi = T::zero().atan2(-T::one());
    if theta > T::zero() { theta - pi } else { theta + pi }
}

impl<T: Real> Orbit<T> {
    /// The envelope of this ellipse: X = e^{iδ}(a cos θ + i q sin θ), Y = e^{iδ}(a sin θ − i q cos θ).
    ///
    /// At δ = 0: x_c = a cos θ, x_s = −q sin θ, y_c = a sin θ, y_s = q cos θ.
    pub fn envelope(&self) -> Envelope<T> {
        let (sin, cos) = self.theta.sin_cos();
        let (sin_d, cos_d) = self.delta.sin_cos();
        let still = Envelope::new(self.a * cos, -self.q * sin, self.a * sin, self.q * cos);
        still * cos_d + still.quarter_ahead() * sin_d
    }
}

impl<T: Real> Pendulum<T> {
    //= specs/equation-04.md#orientation-of-the-orbit
    //# The angle of an orbit MUST be its orientation up to a multiple of 180°.
    //= specs/equation-04.md#arctangent-of-the-paper
    //# The angle MUST equal half the arctangent of S over R where R is positive.
    //= specs/equation-04.md#rotation-turns-the-angle
    //# Turning the pattern by an angle MUST change the angle by as much, up to a multiple of 180°.
    //= specs/equation-04.md#independence-of-amplitude
    //# Scaling the envelope by a power of two MUST leave the angle as it was, bit for bit.
    //= specs/equation-04.md#independence-of-phase
    //# Shifting the phase of the reference MUST leave the angle as it was.
    //= specs/equation-04.md#half-a-turn-is-the-same-angle
    //# The angle of an orbit and of the same orbit turned by 180° MUST be identical bit for bit.
    //= specs/equation-04.md#range
    //# The angle MUST lie within 90° of zero, or be NaN where R or S is NaN.
    //= specs/equation-04.md#circle
    //# The angle of a circular orbit MUST be zero.
    /// **Equation 4**, the pattern angle, within [−90°, 90°] as radians (the two ends are one state):
    ///
    /// $$\theta = \tfrac12 \operatorname{atan2}(S, R)$$
    ///
    /// Domain: R² + S² > 0; a circular orbit has no orientation and gives 0. Source: the paper, Equation 4.
    #[inline]
    pub fn angle(&self) -> T {
        T::half() * self.s.atan2(self.r)
    }
}

impl<T: Real> Add for Envelope<T> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self::new(self.x_c + o.x_c, self.x_s + o.x_s, self.y_c + o.y_c, self.y_s + o.y_s)
    }
}

impl<T: Real> Sub for Envelope<T> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x_c - o.x_c, self.x_s - o.x_s, self.y_c - o.y_c, self.y_s - o.y_s)
    }
}

impl<T: Real> Mul<T> for Envelope<T> {
    type Output = Self;
    #[inline]
    fn mul(self, k: T) -> Self {
        Self::new(self.x_c * k, self.x_s * k, self.y_c * k, self.y_s * k)
    }
}

impl<T: Real> Neg for Envelope<T> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.x_c, -self.x_s, -self.y_c, -self.y_s)
    }
}
