//! The scalar of rounding errors: a real value that is enclosed, and how far the machine's value can be from it.
//!
//! The shipping functions run on it through [`Real`]. Each operation adds the error that one correct rounding can make
//! (a unit roundoff of the result, and half the smallest number where a product or quotient may underflow) to what the
//! errors of the operands become. Sine, cosine and arctangent are those of `libm`, taken to be within
//! [`Format::SIN_COS_ULPS`] and [`Format::ATAN2_ULPS`]:
//! an assumption, to which the real functions are held by a test.
//!
//! Where the machine's value can be a turn away from the real one, next to the cut of the arctangent, a value says so in
//! [`Rounded::turns`]. Sums, signs, halves and doubles keep it; everything else takes it for the error that it is.

use std::cell::RefCell;
use std::cmp::Ordering;
use std::f64::consts::TAU;
use std::marker::PhantomData;
use std::ops::{Add, Div, Mul, Neg, Sub};

use cvg_model::{Float, Real};

use crate::Interval;

/// A machine number whose roundings are accounted for.
pub trait Format: Float + 'static {
    /// the relative error of one rounding to nearest
    const UNIT: f64;
    /// half of the smallest positive number
    const TINY: f64;
    /// the largest number
    const LARGEST: f64;
    /// how far `libm`'s sine and cosine are taken to be from the real value, in units in the last place
    const SIN_COS_ULPS: f64 = 1.0;
    /// how far `libm`'s arctangent is taken to be from the real value, in units in the last place
    const ATAN2_ULPS: f64 = 2.0;
}

impl Format for f32 {
    const UNIT: f64 = 5.960_464_477_539_063e-8;
    const TINY: f64 = 7.1e-46;
    const LARGEST: f64 = f32::MAX as f64;
}

impl Format for f64 {
    const UNIT: f64 = 1.110_223_024_625_156_5e-16;
    const TINY: f64 = 5e-324;
    const LARGEST: f64 = f64::MAX;
}

/// What an evaluation in `F` and the real numbers make of the same inputs.
#[derive(Clone, Copy, Debug)]
pub struct Rounded<F> {
    /// holds the real value
    pub real: Interval,
    /// how far the machine's value can be from the real one; infinite where nothing is known
    pub error: f64,
    /// besides the error the two may be so many turns of 360° apart, forward or back; 0 where they are not
    pub turns: f64,
    format: PhantomData<F>,
}

/// The smallest number that is not below a + b, for a, b ≥ 0.
fn sum(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { a + b } else { (a + b).next_up() }
}

/// The smallest number that is not below a · b, for a, b ≥ 0; infinite where either is, since that stands for unknown.
fn product(a: f64, b: f64) -> f64 {
    if a.is_infinite() || b.is_infinite() {
        f64::INFINITY
    } else if a == 0.0 || b == 0.0 {
        0.0
    } else {
        (a * b).next_up()
    }
}

/// A number that is not below a / b, for a ≥ 0; infinite where b may be 0.
fn quotient(a: f64, b: f64) -> f64 {
    if a == 0.0 {
        0.0
    } else if b > 0.0 {
        (a / b).next_up()
    } else {
        f64::INFINITY
    }
}

impl<F: Format> Rounded<F> {
    /// An input that the machine holds exactly: any number in `real`.
    pub fn input(real: Interval) -> Self {
        Self::made(real, 0.0)
    }

    /// An input of which the machine holds a number that is off by up to `error`, from what came before.
    pub fn input_within(real: Interval, error: f64) -> Self {
        Self::made(real, error)
    }

    fn made(real: Interval, error: f64) -> Self {
        let size = sum(real.magnitude(), error);
        // an overflow, or a NaN of infinities: nothing is known
        let error = if size <= F::LARGEST { error } else { f64::INFINITY };
        Self { real, error, turns: 0.0, format: PhantomData }
    }

    /// The result of an operation that rounds once, after the operands' errors have become `carried`.
    fn once(real: Interval, carried: f64, least: f64) -> Self {
        let size = sum(real.magnitude(), carried);
        Self::made(real, sum(carried, sum(product(F::UNIT, size), least)))
    }

    /// The same, with turns between the two values.
    fn turned(self, turns: f64) -> Self {
        Self { turns, ..self }
    }

    /// As much as the turns between the two values are.
    fn reach(self) -> f64 {
        product(self.turns, TAU.next_up())
    }

    /// The value with the turns between the two taken for an error.
    pub(crate) fn settled(self) -> Self {
        if self.turns == 0.0 { self } else { Self::made(self.real, sum(self.error, self.reach())) }
    }

    /// The result of one of `libm`'s functions.
    fn by_library(real: Interval, carried: f64, ulps: f64) -> Self {
        let size = sum(real.magnitude(), carried);
        Self::made(real, sum(carried, sum(product(2.0 * F::UNIT * ulps, size), 2.0 * F::TINY)))
    }

    /// The number that this is exactly, in the machine too.
    fn exact(self) -> Option<f64> {
        (self.error == 0.0 && self.real.lo == self.real.hi && self.turns == 0.0).then_some(self.real.lo)
    }

    fn is_power_of_two(self) -> bool {
        self.exact().is_some_and(|v| v != 0.0 && v.is_normal() && v.to_bits() & ((1 << 52) - 1) == 0)
    }

    fn inexact(self) -> bool {
        self.error > 0.0 || self.turns > 0.0
    }
}

impl<F: Format> Add for Rounded<F> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        if let (Some(a), Some(b)) = (self.exact(), o.exact()) {
            return constant(a + b, a, b, self.real + o.real);
        }
        if o.exact() == Some(0.0) {
            return self;
        }
        if self.exact() == Some(0.0) {
            return o;
        }
        // of two that may be turns away, the turns of one stay turns
        let o = if self.turns > 0.0 { o.settled() } else { o };
        let turns = self.turns.max(o.turns);
        // what is rounded may be as much larger
        let rounding = product(F::UNIT, product(turns, TAU.next_up()));
        Self::once(self.real + o.real, sum(self.error, o.error), rounding).turned(turns)
    }
}

/// A sum of constants is exact where its rounding error, by Knuth's two-sum, is zero and the machine can hold it.
fn constant<F: Format>(sum: f64, a: f64, b: f64, enclosed: Interval) -> Rounded<F> {
    let back = sum - a;
    let lost = (a - (sum - back)) + (b - back);
    if lost == 0.0 && F::from_f64(sum).to_f64() == sum {
        Rounded::input(Interval::point(sum))
    } else {
        Rounded::once(enclosed, 0.0, 0.0)
    }
}

impl<F: Format> Sub for Rounded<F> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self + -o
    }
}

impl<F: Format> Mul for Rounded<F> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        for (a, b) in [(self, o), (o, self)] {
            if a.exact() == Some(1.0) {
                return b;
            }
            if a.exact() == Some(0.0) && b.error.is_finite() {
                return a;
            }
        }
        if let Some((factor, turned)) = [(self, o), (o, self)].into_iter().find(|(f, t)| f.scales(*t)) {
            // rounds only where it underflows
            let size = factor.real.magnitude();
            let carried = sum(product(size, turned.error), F::TINY);
            return Self::made(self.real * o.real, carried).turned(size * turned.turns);
        }
        let (a, b) = (self.settled(), o.settled());
        Self::multiplied(a, b)
    }
}

impl<F: Format> Rounded<F> {
    /// A power of two, which keeps the turns of `other` as turns.
    fn scales(self, other: Self) -> bool {
        self.is_power_of_two() && other.turns > 0.0
    }

    fn multiplied(self, o: Self) -> Self {
        let real = self.real * o.real;
        let carried = sum(
            sum(product(self.real.magnitude(), o.error), product(o.real.magnitude(), self.error)),
            product(self.error, o.error),
        );
        if self.is_power_of_two() || o.is_power_of_two() {
            // rounds only where it underflows
            return Self::made(real, sum(carried, F::TINY));
        }
        Self::once(real, carried, F::TINY)
    }
}

impl<F: Format> Div for Rounded<F> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        if o.exact() == Some(1.0) {
            return self;
        }
        if o.scales(self) {
            let size = o.real.magnitude();
            let carried = sum(quotient(self.error, size), F::TINY);
            return Self::made(self.real / o.real, carried).turned(self.turns / size);
        }
        self.settled().divided(o.settled())
    }
}

impl<F: Format> Rounded<F> {
    fn divided(self, o: Self) -> Self {
        let real = self.real / o.real;
        // x̃/ỹ − x/y = ((x̃ − x) − (x/y)(ỹ − y))/ỹ
        let least = (o.real.mignitude() - o.error).next_down();
        let carried = quotient(sum(self.error, product(real.magnitude(), o.error)), least);
        if least <= 0.0 {
            return Self::made(real, f64::INFINITY);
        }
        if o.is_power_of_two() {
            return Self::made(real, sum(carried, F::TINY));
        }
        Self::once(real, carried, F::TINY)
    }
}

impl<F: Format> Neg for Rounded<F> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { real: -self.real, ..self }
    }
}

impl<F: Format> Real for Rounded<F> {
    fn ratio(numerator: i32, denominator: i32) -> Self {
        let (n, d) = (f64::from(numerator), f64::from(denominator));
        let (nearest, machine) = (n / d, F::ratio(numerator, denominator).to_f64());
        if nearest * d == n && machine == nearest && (machine * d).to_bits() == n.to_bits() && d.log2().fract() == 0.0 {
            return Self::input(Interval::point(machine));
        }
        // numerator, denominator and quotient are rounded
        let real = Interval::point(n) / Interval::point(d);
        Self::made(real, product(3.1 * F::UNIT, real.magnitude()))
    }

    /// Real numbers have none, the machine has its own: where a branch asks for it, the two may part.
    fn epsilon() -> Self {
        Self::made(Interval::point(0.0), F::epsilon().to_f64())
    }

    fn sqrt(self) -> Self {
        if self.turns > 0.0 {
            return self.settled().sqrt();
        }
        let lowest = (self.real.lo - self.error).next_down();
        if self.real.lo < 0.0 || (self.inexact() && lowest < 0.0) {
            return Self::made(self.real.sqrt(), f64::INFINITY);
        }
        let below = (self.real.lo.sqrt().next_down() + lowest.max(0.0).sqrt().next_down()).next_down();
        let carried = quotient(self.error, below).min(self.error.sqrt().next_up());
        let carried = if self.error == 0.0 { 0.0 } else { carried };
        Self::once(self.real.sqrt(), carried, 0.0)
    }

    fn sin_cos(self) -> (Self, Self) {
        if self.exact() == Some(0.0) {
            return (Self::input(Interval::point(0.0)), Self::input(Interval::point(1.0)));
        }
        // neither moves faster than the angle; a whole turn changes nothing, a part of one does
        let error = if self.turns.fract() == 0.0 { self.error } else { self.settled().error };
        // both values lie between −1 and 1
        let carried = if error.is_finite() { error.min(2.0) } else { error };
        let (sin, cos) = self.real.sin_cos();
        (Self::by_library(sin, carried, F::SIN_COS_ULPS), Self::by_library(cos, carried, F::SIN_COS_ULPS))
    }

    fn atan2(self, x: Self) -> Self {
        let (y, x) = (self.settled(), x.settled());
        let (real, cut) = y.real.atan2(x.real);
        let distance = (x.real.squared() + y.real.squared()).sqrt().lo;
        let reach = (Interval::point(x.error).squared() + Interval::point(y.error).squared()).sqrt().hi;
        let reach = if x.error == 0.0 && y.error == 0.0 { 0.0 } else { reach };
        let moved = (distance - reach).next_down();
        if moved <= 0.0 {
            return Self::made(real, f64::INFINITY);
        }
        // the sine of the angle between the two points is their cross product over both distances
        let cross = sum(product(x.real.magnitude(), y.error), product(y.real.magnitude(), x.error));
        let sine = quotient(cross, (distance * moved).next_down());
        if sine >= 0.5 {
            return Self::made(real, f64::INFINITY);
        }
        // asin t ≤ t/√(1 − t²)
        let carried = quotient(sine, (1.0 - sine * sine).next_down().sqrt().next_down());
        // close to 180° the two may lie on either side of the cut
        let near = x.real.lo <= x.error && y.real.lo <= y.error && y.real.hi >= -y.error && y.inexact();
        let turns = if cut || near { 1.0 } else { 0.0 };
        Self::by_library(real, carried, F::ATAN2_ULPS).turned(turns)
    }
}

/// What running code asks of its numbers beyond the equations. Whole parts and conversions back are refused: the machine's and
/// the real ones may lie far apart.
impl<F: Format> Float for Rounded<F> {
    const PI: Self = Self {
        real: Interval { lo: std::f64::consts::PI, hi: std::f64::consts::PI.next_up() },
        error: 4.0 * F::UNIT,
        turns: 0.0,
        format: PhantomData,
    };

    /// A constant of the configuration: a whole number is meant as it stands, any other is what f64 rounded it to.
    fn from_f64(value: f64) -> Self {
        assert!(value.is_finite(), "refused: {value} is not a real number");
        let machine = F::from_f64(value).to_f64();
        if value.fract() == 0.0 && machine == value {
            return Self::input(Interval::point(value));
        }
        let real = Interval::new(value.next_down(), value.next_up());
        Self::made(real, (machine - real.lo).max(real.hi - machine).next_up())
    }

    fn to_f64(self) -> f64 {
        let Some(value) = self.exact() else { panic!("refused: {self:?} has no one value") };
        value
    }

    /// Where nothing is known of the machine's value, the two may differ in the answer.
    fn is_finite(self) -> bool {
        let known = self.settled().error.is_finite() && self.real.magnitude().is_finite();
        PATH.with(|path| path.borrow_mut().undecided |= !known);
        true
    }

    fn floor(self) -> Self {
        panic!("refused: the whole part of {self:?}")
    }

    /// |self|, which is no further from the real one than self is.
    fn magnitude(self) -> Self {
        let v = self.settled();
        Self::made(Interval::new(v.real.mignitude(), v.real.magnitude()), v.error)
    }
}

/// Whose comparisons an evaluation follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Follows {
    /// the machine's and the real numbers' at once: where they may differ, nothing is known
    #[default]
    Both,
    /// the real numbers' alone: only the real values of the results mean something
    Reals,
}

/// The path through comparisons of this thread's evaluation.
#[derive(Default)]
struct Path {
    follows: Follows,
    script: Vec<Ordering>,
    taken: Vec<Ordering>,
    undecided: bool,
}

thread_local! {
    static PATH: RefCell<Path> = RefCell::new(Path::default());
}

/// Runs `evaluate` once for each outcome of the comparisons that its box leaves open. `None` where rounding leaves a
/// comparison open, so that machine and real numbers might part there.
pub(crate) fn on_every_path<R>(follows: Follows, mut evaluate: impl FnMut() -> R) -> Option<Vec<R>> {
    let mut scripts = vec![Vec::new()];
    let mut found = Vec::new();
    while let Some(script) = scripts.pop() {
        let given = script.len();
        PATH.with(|path| *path.borrow_mut() = Path { follows, script, ..Path::default() });
        found.push(evaluate());
        let path = PATH.with(|path| std::mem::take(&mut *path.borrow_mut()));
        if path.undecided {
            return None;
        }
        for turn in given..path.taken.len() {
            for other in [Ordering::Equal, Ordering::Greater] {
                scripts.push(path.taken[..turn].iter().copied().chain([other]).collect());
            }
        }
    }
    Some(found)
}

impl<F: Format> PartialEq for Rounded<F> {
    fn eq(&self, other: &Self) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}

impl<F: Format> PartialOrd for Rounded<F> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        PATH.with(|path| {
            let mut path = path.borrow_mut();
            let compared = |v: &Self| match path.follows {
                Follows::Both => v.settled(),
                Follows::Reals => Self { error: 0.0, turns: 0.0, ..*v },
            };
            let (a, b) = (compared(self), compared(other));
            let lower = |v: &Self| if v.error == 0.0 { v.real.lo } else { (v.real.lo - v.error).next_down() };
            let upper = |v: &Self| if v.error == 0.0 { v.real.hi } else { (v.real.hi + v.error).next_up() };
            if upper(&a) < lower(&b) {
                return Some(Ordering::Less);
            }
            if lower(&a) > upper(&b) {
                return Some(Ordering::Greater);
            }
            if let (Some(a), Some(b)) = (a.exact(), b.exact()) {
                return a.partial_cmp(&b);
            }
            path.undecided |= a.inexact() || b.inexact();
            let order = path.script.get(path.taken.len()).copied().unwrap_or(Ordering::Less);
            path.taken.push(order);
            Some(order)
        })
    }
}
