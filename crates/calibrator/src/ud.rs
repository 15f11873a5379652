//! A covariance that can't lose its sign: P = U D Uᵀ, U unit upper triangular, D diagonal and positive (Bierman 1977).
//!
//! A measurement is taken in three parts, so that no control step does more than a few columns: [`Ud::project`] column
//! by column, then [`Ud::open`], then [`Ud::absorb`] column by column ([`Ud::measure`] does all at once). It refuses to know what the parameters mean.

use cvg_model::Float;

use crate::parameters::N;

/// The same for every column, which is a constant called `J` there.
macro_rules! each_column {
    ($column:ident => $body:block) => {
        each_column!($column => $body; 0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18)
    };
    ($column:ident => $body:block; $($j:literal)+) => {
        $({
            const $column: usize = $j;
            $body
        })+
    };
}

/// Columns of U above its diagonal, one after the other.
pub const ABOVE: usize = N * (N - 1) / 2;

/// The factors of a covariance of [`N`] parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ud<T> {
    pub(crate) above: [T; ABOVE],
    pub(crate) d: [T; N],
}

/// A measurement that is being taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update<T> {
    /// Uᵀh
    pub(crate) f: [T; N],
    /// the gain so far
    pub(crate) gain: [T; N],
    /// variance of the innovation so far
    alpha: T,
    inverse: T,
    /// of the column that is being absorbed: −f/α, and D f
    lambda: T,
    v: T,
}

impl<T: Float> Update<T> {
    /// Nothing taken yet.
    pub fn idle() -> Self {
        let zeros = [T::zero(); N];
        let zero = T::zero();
        Self { f: zeros, gain: zeros, alpha: zero, inverse: zero, lambda: zero, v: zero }
    }

    /// What the innovation is to be divided by for the gain; 0 before the last column.
    pub fn inverse(&self) -> T {
        self.inverse
    }

    /// The gain times the innovation's variance, once every column is absorbed.
    pub fn gain(&self) -> &[T; N] {
        &self.gain
    }
}

impl<T: Float> Ud<T> {
    /// Independent parameters of variance `d`.
    pub fn diagonal(d: T) -> Self {
        Self { above: [T::zero(); ABOVE], d: [d; N] }
    }

    /// U_0j … U_(j−1)j; empty for a column there isn't.
    #[inline]
    pub fn column(&self, j: usize) -> &[T] {
        let (start, end) = bounds(j);
        self.above.get(start..end).unwrap_or(&[])
    }

    #[inline]
    fn column_mut(&mut self, j: usize) -> &mut [T] {
        let (start, end) = bounds(j);
        self.above.get_mut(start..end).unwrap_or(&mut [])
    }

    /// D_jj; 0 for a column there isn't.
    #[inline]
    pub fn d(&self, j: usize) -> T {
        self.d.get(j).copied().unwrap_or(T::zero())
    }

    /// U_ij for i < j.
    #[inline]
    pub fn u(&self, i: usize, j: usize) -> T {
        self.column(j).get(i).copied().unwrap_or(T::zero())
    }

    /// P_ij.
    pub fn covariance(&self, i: usize, j: usize) -> T {
        let unit = |row: usize, k: usize| if row == k { T::one() } else { self.u(row, k) };
        let first = if i > j { i } else { j };
        (first..N).fold(T::zero(), |sum, k| sum + unit(i, k) * unit(j, k) * self.d(k))
    }

    /// P_jj.
    pub fn variance(&self, j: usize) -> T {
        self.variance_by(j, j, N)
    }

    /// The share of columns `first` to `end` − 1 in P_jj: their sum is all of it.
    pub fn variance_by(&self, j: usize, first: usize, end: usize) -> T {
        let mut sum = if first <= j && j < end { self.d(j) } else { T::zero() };
        let first = if first > j { first } else { j + 1 };
        let mut at = bounds(first).0 + j;
        for (k, d) in (first..).zip(self.d.get(first..end).unwrap_or(&[])) {
            let u = self.above.get(at).copied().unwrap_or(T::zero());
            sum = sum + u * u * *d;
            at += k;
        }
        sum
    }

    /// hᵀPh.
    pub fn variance_along(&self, h: &[T; N]) -> T {
        (0..N).fold(T::zero(), |sum, j| sum + self.d(j) * self.projected(h, j).squared())
    }

    #[inline]
    fn projected(&self, h: &[T; N], j: usize) -> T {
        let along = h.get(j).copied().unwrap_or(T::zero());
        self.column(j).iter().zip(h).fold(along, |sum, (u, h)| sum + *u * *h)
    }

    /// A whole measurement of `h` with a noise of variance `noise`.
    pub fn measure(&mut self, update: &mut Update<T>, h: &[T; N], noise: T) {
        each_column!(J => { self.project::<J>(update, h); });
        self.open(update, noise);
        each_column!(J => { self.absorb::<J>(update); });
    }

    /// Column `J` of the first pass: f_J = (Uᵀh)_J. Returns what it adds to the innovation's variance.
    ///
    /// The column is known when it is compiled, here and below: half of what firmware does would else be the loop's own.
    #[inline(always)]
    pub fn project<const J: usize>(&self, update: &mut Update<T>, h: &[T; N]) -> T {
        let f = self.projected(h, J);
        if let Some(slot) = update.f.get_mut(J) {
            *slot = f;
        }
        self.d(J) * f * f
    }

    /// Between the passes: the measurement's variance is `noise` > 0.
    #[inline]
    pub fn open(&self, update: &mut Update<T>, noise: T) {
        update.alpha = noise;
        update.inverse = T::one() / noise;
    }

    /// Column `J` of the second pass, from 0 to N − 1.
    #[inline(always)]
    pub fn absorb<const J: usize>(&mut self, update: &mut Update<T>) {
        self.absorb_diagonal::<J>(update);
        self.absorb_rows::<J, 0, J>(update);
    }

    //= specs/self-calibration.md#positive
    //# The covariance MUST stay positive through every measurement and every step of its growth.
    /// What [`Ud::absorb`] begins with; every row above the diagonal follows.
    #[inline(always)]
    pub fn absorb_diagonal<const J: usize>(&mut self, update: &mut Update<T>) {
        let Some(f) = update.f.get(J).copied() else { return };
        let d = self.d(J);
        let v = d * f;
        let before = update.alpha;
        let alpha = before + v * f;
        update.lambda = -(f * update.inverse);
        let inverse = T::one() / alpha;
        update.alpha = alpha;
        update.inverse = inverse;
        update.v = v;
        if let Some(slot) = self.d.get_mut(J) {
            // the ratio is in (0, 1]: a product of positive numbers can't change its sign, and not vanish either
            *slot = at_least(d * (before * inverse));
        }
        if let Some(slot) = update.gain.get_mut(J) {
            *slot = v;
        }
    }

    /// Rows `FIRST` to `END` − 1 of column `J`.
    #[inline(always)]
    pub fn absorb_rows<const J: usize, const FIRST: usize, const END: usize>(&mut self, update: &mut Update<T>) {
        let (lambda, v) = (update.lambda, update.v);
        let (Some(column), Some(gain)) = (self.column_mut(J).get_mut(FIRST..END), update.gain.get_mut(FIRST..END))
        else {
            return;
        };
        for (u, k) in column.iter_mut().zip(gain) {
            let old = *u;
            *u = old + *k * lambda;
            *k = *k + v * old;
        }
    }

    /// P ← P + q e_j e_jᵀ begins (Agee and Turner); `a` holds what is still to be spread.
    pub fn grow_begin(growth: &mut Growth<T>, j: usize, q: T) {
        growth.a = [T::zero(); N];
        if let Some(slot) = growth.a.get_mut(j) {
            *slot = T::one();
        }
        growth.q = q;
        growth.next = j + 1;
    }

    /// One column more; nothing when all is spread.
    pub fn grow(&mut self, growth: &mut Growth<T>) {
        let next = growth.next;
        each_column!(J => {
            if next == J + 1 {
                self.grow_column::<J>(growth);
            }
        });
    }

    #[inline(always)]
    fn grow_column<const J: usize>(&mut self, growth: &mut Growth<T>) {
        growth.next = J;
        let Some(s) = growth.a.get(J).copied() else { return };
        let d = self.d(J);
        let sum = d + growth.q * s * s;
        if !(sum > T::zero() && sum.is_finite()) {
            growth.next = 0;
            return;
        }
        let b = growth.q * s / sum;
        growth.q = growth.q * (d / sum);
        if let Some(slot) = self.d.get_mut(J) {
            *slot = at_least(sum);
        }
        for (u, a) in self.column_mut(J).iter_mut().zip(growth.a.iter_mut()) {
            *a = *a - s * *u;
            *u = *u + b * *a;
        }
    }

    /// Column `j` where the first `count` parameters become independent of all and of variance `d`; the others keep their own
    /// covariance. Forgets what it says once every column is done.
    pub fn forget(&mut self, j: usize, count: usize, d: T) {
        if j < count
            && let Some(slot) = self.d.get_mut(j)
        {
            *slot = d;
        }
        for u in self.column_mut(j).iter_mut().take(count) {
            *u = T::zero();
        }
    }

    /// The last three as `factors` say (D, then U above their diagonal), the others independent and of variance `d`.
    /// None where that is no covariance.
    pub fn with_last(d: T, factors: &[T; 6]) -> Option<Self> {
        let mut made = Self::diagonal(d);
        let [d0, d1, d2, u01, u02, u12] = *factors;
        let sound = |d: T| d > T::zero() && d <= T::two();
        if !(sound(d0) && sound(d1) && sound(d2) && [u01, u02, u12].iter().all(|u| u.within(T::from_f64(1e6)))) {
            return None;
        }
        for (slot, d) in made.d.iter_mut().skip(N - 3).zip([d0, d1, d2]) {
            *slot = d;
        }
        for (i, j, u) in [(N - 3, N - 2, u01), (N - 3, N - 1, u02), (N - 2, N - 1, u12)] {
            if let Some(slot) = made.column_mut(j).get_mut(i) {
                *slot = u;
            }
        }
        Some(made)
    }

    /// Whether every number is finite and D positive.
    pub fn is_sound(&self) -> bool {
        self.d.iter().all(|d| *d > T::zero() && d.is_finite()) && self.above.iter().all(|u| u.is_finite())
    }
}

/// A growth of the covariance under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth<T> {
    pub(crate) a: [T; N],
    pub(crate) q: T,
    pub(crate) next: usize,
}

impl<T: Float> Growth<T> {
    /// Nothing to spread.
    pub fn idle() -> Self {
        Self { a: [T::zero(); N], q: T::zero(), next: 0 }
    }
}

/// Variances are of parameters in units of what they are expected to be: below 10⁻¹⁸ nothing is known better.
fn at_least<T: Float>(d: T) -> T {
    let least = T::from_f64(1e-18);
    if d > least { d } else { least }
}

#[inline]
fn bounds(j: usize) -> (usize, usize) {
    let j = if j < N { j } else { 0 };
    let start = (j * j.saturating_sub(1)) / 2;
    (start, start + j)
}
