//! Intervals that hold a real number: outward by one step after each operation, which IEEE 754 rounds correctly.
//!
//! Sine and cosine are series with their remainder, after a reduction by an enclosed π/2. The arctangent is guessed and
//! then verified by the signs of cross products with an enclosed sine and cosine. No function of the platform or of
//! `libm` is trusted but + − × ÷ √, which have to be correctly rounded.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// All numbers from `lo` to `hi`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// lower end
    pub lo: f64,
    /// upper end
    pub hi: f64,
}

/// π/2 lies between this and the next number.
const QUARTER: Interval = Interval { lo: std::f64::consts::FRAC_PI_2, hi: std::f64::consts::FRAC_PI_2.next_up() };
/// Beyond this many quarter turns sine and cosine are taken as anything in [−1, 1].
const MOST_QUARTERS: f64 = 1e6;
/// Terms of the series: the remainder is below 0.8²¹/21!, far below the rounding of the terms.
const TERMS: u32 = 10;

impl Interval {
    /// All reals.
    pub const ALL: Self = Self { lo: f64::NEG_INFINITY, hi: f64::INFINITY };

    /// From `lo` to `hi`.
    pub fn new(lo: f64, hi: f64) -> Self {
        if lo <= hi { Self { lo, hi } } else { Self::ALL }
    }

    /// One number.
    pub fn point(value: f64) -> Self {
        Self::new(value, value)
    }

    fn outward(lo: f64, hi: f64) -> Self {
        Self::new(lo.next_down(), hi.next_up())
    }

    fn hull(values: impl IntoIterator<Item = Self>) -> Self {
        values.into_iter().reduce(|a, b| Self::new(a.lo.min(b.lo), a.hi.max(b.hi))).unwrap_or(Self::ALL)
    }

    /// The largest magnitude.
    pub fn magnitude(self) -> f64 {
        self.lo.abs().max(self.hi.abs())
    }

    /// The smallest magnitude.
    pub fn mignitude(self) -> f64 {
        if self.lo <= 0.0 && self.hi >= 0.0 { 0.0 } else { self.lo.abs().min(self.hi.abs()) }
    }

    /// hi − lo
    pub fn width(self) -> f64 {
        self.hi - self.lo
    }

    /// A number in the middle.
    pub fn middle(self) -> f64 {
        0.5 * self.lo + 0.5 * self.hi
    }

    /// Whether `value` is in it.
    pub fn contains(self, value: f64) -> bool {
        self.lo <= value && value <= self.hi
    }

    /// The square: not below 0.
    #[must_use]
    pub fn squared(self) -> Self {
        let (low, high) = (self.mignitude(), self.magnitude());
        Self::new((low * low).next_down().max(0.0), (high * high).next_up())
    }

    /// The root of what is not negative in it.
    #[must_use]
    pub fn sqrt(self) -> Self {
        if self.hi < 0.0 {
            return Self::ALL;
        }
        Self::new(self.lo.max(0.0).sqrt().next_down().max(0.0), self.hi.sqrt().next_up())
    }

    /// (sin, cos) of every angle in it.
    pub fn sin_cos(self) -> (Self, Self) {
        let unit = Self::new(-1.0, 1.0);
        let quarters = self / QUARTER;
        let (first, last) = (quarters.lo.ceil(), quarters.hi.floor());
        let near = quarters.magnitude() < MOST_QUARTERS;
        if !near || last - first >= 3.0 {
            return (unit, unit);
        }
        let ends = [sin_cos_of(self.lo), sin_cos_of(self.hi)];
        let (mut sin, mut cos) = (Self::hull(ends.map(|e| e.0)), Self::hull(ends.map(|e| e.1)));
        // multiples of 90° that may lie inside: there the extremes are
        let mut quarter = first;
        while quarter <= last {
            let (s, c) = quarter_turns(quarter);
            sin = Self::hull([sin, Self::point(s)]);
            cos = Self::hull([cos, Self::point(c)]);
            quarter += 1.0;
        }
        let within = |v: Self| Self::new(v.lo.max(-1.0), v.hi.min(1.0));
        (within(sin), within(cos))
    }

    /// The angle of every point (x, self), and whether the half line of 180° is among them.
    pub fn atan2(self, x: Self) -> (Self, bool) {
        let y = self;
        let whole = Self::new(-QUARTER.hi * 2.0, QUARTER.hi * 2.0);
        let cut = x.lo <= 0.0 && y.lo <= 0.0 && y.hi >= 0.0;
        if cut || !(x.magnitude() + y.magnitude()).is_finite() {
            return (whole, cut);
        }
        // without the cut and the origin the extremes are at corners
        let corners = [(x.lo, y.lo), (x.lo, y.hi), (x.hi, y.lo), (x.hi, y.hi)];
        (Self::hull(corners.map(|(x, y)| angle_of(x, y).unwrap_or(whole))), false)
    }
}

/// (sin, cos) of a whole number of quarter turns.
fn quarter_turns(count: f64) -> (f64, f64) {
    match count.rem_euclid(4.0) {
        0.0 => (0.0, 1.0),
        1.0 => (1.0, 0.0),
        2.0 => (0.0, -1.0),
        _ => (-1.0, 0.0),
    }
}

/// Encloses (sin, cos) of one number.
fn sin_cos_of(x: f64) -> (Interval, Interval) {
    let count = (x / QUARTER.lo).round();
    let rest = Interval::point(x) - Interval::point(count) * QUARTER;
    debug_assert!(rest.magnitude() < 0.8, "{x} is reduced to an eighth of a turn");
    let square = rest.squared();
    let (mut sin, mut cos) = (Interval::point(0.0), Interval::point(0.0));
    for n in (0..TERMS).rev() {
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        sin = sin * square + Interval::point(sign) / Interval::point(factorial(2 * n + 1));
        cos = cos * square + Interval::point(sign) / Interval::point(factorial(2 * n));
    }
    // alternating with falling terms: what is left out is below the first term left out, here with room to spare
    let left = 1e-18;
    let (sin, cos) = (rest * sin + Interval::new(-left, left), cos + Interval::new(-left, left));
    match count.rem_euclid(4.0) {
        0.0 => (sin, cos),
        1.0 => (cos, -sin),
        2.0 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// n!, exact as a number up to 22!.
fn factorial(n: u32) -> f64 {
    (1..=n).map(f64::from).product()
}

/// Encloses the angle of a point that is neither the origin nor on the half line of 180°: a guess, verified.
fn angle_of(x: f64, y: f64) -> Option<Interval> {
    let guess = y.atan2(x);
    let (x, y) = (Interval::point(x), Interval::point(y));
    let mut reach = 4e-16_f64.max(guess.abs() * 4e-16);
    for _ in 0..12 {
        let (low, high) = (guess - reach, guess + reach);
        let ((sin_low, cos_low), (sin_high, cos_high)) = (sin_cos_of(low), sin_cos_of(high));
        // the point is to the left of the lower direction, to the right of the upper one, and not behind
        let left = y * cos_low - x * sin_low;
        let right = y * cos_high - x * sin_high;
        let ahead = x * cos_low + y * sin_low;
        if left.lo >= 0.0 && right.hi <= 0.0 && ahead.lo > 0.0 {
            return Some(Interval::new(low, high));
        }
        reach *= 2.0;
    }
    None
}

impl Add for Interval {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::outward(self.lo + o.lo, self.hi + o.hi)
    }
}

impl Sub for Interval {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self::outward(self.lo - o.hi, self.hi - o.lo)
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        let products = [self.lo * o.lo, self.lo * o.hi, self.hi * o.lo, self.hi * o.hi];
        if products.iter().any(|p| p.is_nan()) {
            return Self::ALL;
        }
        let (lo, hi) = products.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        Self::outward(lo, hi)
    }
}

impl Div for Interval {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        if o.lo <= 0.0 && o.hi >= 0.0 {
            return Self::ALL;
        }
        let quotients = [self.lo / o.lo, self.lo / o.hi, self.hi / o.lo, self.hi / o.hi];
        if quotients.iter().any(|q| q.is_nan()) {
            return Self::ALL;
        }
        let (lo, hi) = quotients.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), q| (l.min(*q), h.max(*q)));
        Self::outward(lo, hi)
    }
}

impl Neg for Interval {
    type Output = Self;
    fn neg(self) -> Self {
        Self { lo: -self.hi, hi: -self.lo }
    }
}
