//! Complex numbers and 2×2 matrices of them: what electronics with phases do to two axes.

use core::ops::{Add, Mul, Neg, Sub};

use cvg_model::Float;

/// re + i im.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Complex<T> {
    /// real part
    pub re: T,
    /// imaginary part
    pub im: T,
}

impl<T: Float> Complex<T> {
    /// re + i im.
    #[inline]
    pub fn new(re: T, im: T) -> Self {
        Self { re, im }
    }

    /// A real number.
    #[inline]
    pub fn real(re: T) -> Self {
        Self::new(re, T::zero())
    }

    /// |z|².
    #[inline]
    pub fn squared_norm(self) -> T {
        self.re * self.re + self.im * self.im
    }

    /// k z.
    #[inline]
    pub fn times(self, k: T) -> Self {
        Self::new(self.re * k, self.im * k)
    }

    /// 1/z. Domain: z ≠ 0.
    #[inline]
    pub fn inverse(self) -> Self {
        let n = T::one() / self.squared_norm();
        Self::new(self.re * n, -(self.im * n))
    }
}

impl<T: Float> Add for Complex<T> {
    type Output = Self;
    #[inline]
    fn add(self, o: Self) -> Self {
        Self::new(self.re + o.re, self.im + o.im)
    }
}
impl<T: Float> Sub for Complex<T> {
    type Output = Self;
    #[inline]
    fn sub(self, o: Self) -> Self {
        Self::new(self.re - o.re, self.im - o.im)
    }
}
impl<T: Float> Mul for Complex<T> {
    type Output = Self;
    #[inline]
    fn mul(self, o: Self) -> Self {
        Self::new(self.re * o.re - self.im * o.im, self.re * o.im + self.im * o.re)
    }
}
impl<T: Float> Neg for Complex<T> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.re, -self.im)
    }
}

/// [[xx, xy], [yx, yy]].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix<T> {
    /// from X to X
    pub xx: Complex<T>,
    /// from Y to X
    pub xy: Complex<T>,
    /// from X to Y
    pub yx: Complex<T>,
    /// from Y to Y
    pub yy: Complex<T>,
}

impl<T: Float> Matrix<T> {
    /// Changes nothing.
    pub fn identity() -> Self {
        let (zero, one) = (Complex::real(T::zero()), Complex::real(T::one()));
        Self { xx: one, xy: zero, yx: zero, yy: one }
    }

    /// self · (x, y).
    #[inline]
    pub fn apply(&self, x: Complex<T>, y: Complex<T>) -> (Complex<T>, Complex<T>) {
        (self.xx * x + self.xy * y, self.yx * x + self.yy * y)
    }

    /// self · other.
    pub fn times(&self, o: &Self) -> Self {
        let (xx, yx) = self.apply(o.xx, o.yx);
        let (xy, yy) = self.apply(o.xy, o.yy);
        Self { xx, xy, yx, yy }
    }

    /// The inverse; none where the determinant is below a thousandth or not a number.
    pub fn inverse(&self) -> Option<Self> {
        let determinant = self.xx * self.yy - self.xy * self.yx;
        let n = determinant.squared_norm();
        if !(n > T::from_f64(1e-6) && n.is_finite()) {
            return None;
        }
        let k = determinant.inverse();
        Some(Self { xx: self.yy * k, xy: -(self.xy * k), yx: -(self.yx * k), yy: self.xx * k })
    }

    /// Every number of it.
    pub fn numbers(&self) -> [T; 8] {
        let m = self;
        [m.xx.re, m.xx.im, m.xy.re, m.xy.im, m.yx.re, m.yx.im, m.yy.re, m.yy.im]
    }

    /// From every number of it.
    pub fn from_numbers(n: &[T; 8]) -> Self {
        let [a, b, c, d, e, f, g, h] = *n;
        Self { xx: Complex::new(a, b), xy: Complex::new(c, d), yx: Complex::new(e, f), yy: Complex::new(g, h) }
    }
}
