//! An effect written down as text: expressions over the envelope, evaluated on the scalars that the library runs on.
//!
//! This file evaluates; who reads the text makes a [`Written`] of it. An evaluation takes one pass over a list of bounded
//! length with a stack of bounded depth: it ends, whatever the numbers, and what has no value (a division by zero, a root
//! of a negative number) is not finite.
//!
//! With the feature `written` an [`EffectId`](super::EffectId) can be one of these. Firmware leaves the feature out.

use core::cmp::Ordering;
use core::hash::{Hash, Hasher};

use super::{Description, Moment, Stage, Values};
use crate::resonator::envelope::precession;
use crate::{AxisForces, Envelope, Real};

/// The most numbers that an expression may hold at once.
pub const MAX_DEPTH: usize = 16;
/// The most steps of an expression.
pub const MAX_STEPS: usize = 2048;

/// What an expression may ask for by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variable {
    /// X = x_c − i x_s
    X,
    /// Y = y_c − i y_s
    Y,
    /// in-phase part of X
    Xc,
    /// quadrature part of X
    Xs,
    /// in-phase part of Y
    Yc,
    /// quadrature part of Y
    Ys,
    /// direction of the vibration over the full turn, atan2(y_c, x_c), rad
    Theta,
    /// E of Equation 2
    E,
    /// Q
    Q,
    /// R
    R,
    /// S
    S,
    /// rate of the table, rad/s
    Rate,
    /// time of the recording, s
    Time,
    /// angle of the table, rad
    Table,
    /// nominal precession rate −kΩ, rad/s
    Precession,
    /// temperature over the one that parameters refer to, K
    Warmer,
    /// F_x = f_xc − i f_xs, what the drive of X is commanded to, V
    DriveX,
    /// F_y
    DriveY,
    /// in-phase part of F_x
    DriveXc,
    /// quadrature part of F_x
    DriveXs,
    /// in-phase part of F_y
    DriveYc,
    /// quadrature part of F_y
    DriveYs,
}

impl Variable {
    /// It is one of the drives' commands.
    pub const fn is_of_the_drive(&self) -> bool {
        use Variable::{DriveX, DriveXc, DriveXs, DriveY, DriveYc, DriveYs};
        matches!(self, DriveX | DriveY | DriveXc | DriveXs | DriveYc | DriveYs)
    }
}

/// One step of an expression: it takes its operands from a stack and puts its value there. Numbers are complex; `real`
/// says that both operands have no imaginary part.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "each is the operation of its name")]
pub enum Step {
    Number(f64),
    ImaginaryUnit,
    Pi,
    Parameter(u8),
    Variable(Variable),
    Add,
    Subtract,
    Multiply {
        real: bool,
    },
    Divide {
        real: bool,
    },
    Negate,
    Power {
        exponent: i8,
        real: bool,
    },
    RealPart,
    ImaginaryPart,
    Conjugate,
    /// of a real number
    Absolute,
    /// of a complex number
    Magnitude,
    SquareRoot,
    Sine,
    Cosine,
    Arctangent2,
    Exponential,
    Smaller,
    Larger,
    /// the second of three where the first is above 0, the third where it is not
    IfPositive,
}

impl Step {
    /// How many operands it takes.
    pub const fn operands(&self) -> usize {
        match self {
            Self::Number(_) | Self::ImaginaryUnit | Self::Pi | Self::Parameter(_) | Self::Variable(_) => 0,
            Self::Add | Self::Subtract | Self::Multiply { .. } | Self::Divide { .. } => 2,
            Self::Arctangent2 | Self::Smaller | Self::Larger => 2,
            Self::IfPositive => 3,
            _ => 1,
        }
    }
}

/// What a map gives a value to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// X, or its rate of change
    X,
    /// Y
    Y,
    /// in-phase part of X
    Xc,
    /// quadrature part of X
    Xs,
    /// in-phase part of Y
    Yc,
    /// quadrature part of Y
    Ys,
    /// angle of the vibration, rad; in the mechanics, its rate, rad/s
    Theta,
    /// what the mechanics add to the damping, 1/s
    Damping,
    /// the rate that reaches the resonator, rad/s
    Rate,
}

/// An effect as its text says it.
#[derive(Debug)]
pub struct Written {
    /// what is known of it
    pub description: Description,
    /// what it gives a value to, and how
    pub maps: &'static [(Target, &'static [Step])],
    /// an expression asks for the time of the recording
    pub in_time: bool,
    /// an expression asks for the temperature
    pub by_temperature: bool,
    /// an expression asks for the drives' commands
    pub on_commands: bool,
    /// the text itself: two effects with one text are one
    pub text: &'static str,
}

impl PartialEq for Written {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl Eq for Written {}

impl Hash for Written {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.text.hash(state);
    }
}

impl PartialOrd for Written {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Written {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.description.id, self.text).cmp(&(other.description.id, other.text))
    }
}

impl Written {
    /// Its expressions ask for nothing but the envelope.
    pub fn is_of_the_channels(&self) -> bool {
        use Variable::{Precession, Rate, Table, Time, Warmer};
        let is_other = |v: &Variable| v.is_of_the_drive() || matches!(v, Precession | Rate | Table | Time | Warmer);
        let mut steps = self.maps.iter().flat_map(|(_, steps)| *steps);
        !steps.any(|step| matches!(step, Step::Variable(v) if is_other(v)))
    }

    /// [`Effect::input_rate`](super::Effect::input_rate)
    pub fn input_rate<T: Real>(&self, p: &Values<T>, rate_rad_s: T, at: &Moment<T>) -> T {
        let scope = Scope { p, e: Envelope::zero(), at: *at, rate: rate_rad_s };
        match self.maps.first() {
            Some((Target::Rate, steps)) if self.description.stage == Stage::Input => scope.value(steps).re,
            _ => rate_rad_s,
        }
    }

    /// [`Effect::mechanics`](super::Effect::mechanics)
    pub fn mechanics<T: Real>(&self, p: &Values<T>, e: &Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        let mut rate = Envelope::zero();
        if self.description.stage != Stage::Mechanics {
            return rate;
        }
        let scope = Scope { p, e: *e, at: *at, rate: T::zero() };
        for (target, steps) in self.maps {
            let value = scope.value(steps);
            match target {
                Target::Theta => rate = rate + precession(value.re, e),
                Target::Damping => rate = rate + *e * -value.re,
                component => {
                    let mut own = Envelope::zero();
                    put(&mut own, *component, value);
                    rate = rate + own;
                }
            }
        }
        rate
    }

    /// [`Effect::actuate`](super::Effect::actuate)
    pub fn actuate<T: Real>(&self, p: &Values<T>, f: AxisForces<T>, at: &Moment<T>) -> AxisForces<T> {
        if self.description.stage != Stage::Actuation {
            return f;
        }
        let e = Envelope::new(f.x_c, f.x_s, f.y_c, f.y_s);
        let e = self.mapped(&Scope { p, e, at: *at, rate: T::zero() });
        AxisForces { x_c: e.x_c, x_s: e.x_s, y_c: e.y_c, y_s: e.y_s }
    }

    /// [`Effect::read`](super::Effect::read)
    pub fn read<T: Real>(&self, p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        if self.description.stage != Stage::Readout {
            return e;
        }
        self.mapped(&Scope { p, e, at: *at, rate: T::zero() })
    }

    /// [`Effect::unread`](super::Effect::unread): the fixed point of z ← z + (e − read(z)), which contracts for an effect
    /// well below one. Not a number where it does not settle.
    pub fn unread<T: Real>(&self, p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        if self.description.stage != Stage::Readout {
            return e;
        }
        let small = T::ratio(1, 1 << 22);
        let tolerance = small.squared() + T::ratio(16, 1) * T::epsilon();
        let size = energy(&e);
        let mut z = e;
        let mut polish = 0;
        for _ in 0..INVERSE_STEPS {
            let rest = e - self.read(p, z, at);
            z = z + rest;
            if energy(&rest) <= tolerance.squared() * size {
                // slopes settle after the values
                polish += 1;
                if polish == POLISH {
                    return z;
                }
            }
        }
        if polish > 0 {
            return z;
        }
        let nothing = T::zero() / T::zero();
        Envelope::new(nothing, nothing, nothing, nothing)
    }

    /// The envelope with what the maps say put into it; all of them see the envelope as it came.
    fn mapped<T: Real>(&self, scope: &Scope<'_, T>) -> Envelope<T> {
        let mut out = scope.e;
        for (target, steps) in self.maps {
            let value = scope.value(steps);
            if *target == Target::Theta {
                let (sin, cos) = (value.re - scope.e.y_c.atan2(scope.e.x_c)).sin_cos();
                out = out.turned(sin, cos);
            } else {
                put(&mut out, *target, value);
            }
        }
        out
    }
}

/// Steps of the inverse: what moves the vibration by less than 45 % of a change of it is undone to 1e-13.
const INVERSE_STEPS: usize = 40;
/// Steps after the one that leaves nothing.
const POLISH: usize = 3;

fn energy<T: Real>(e: &Envelope<T>) -> T {
    e.x_c * e.x_c + e.x_s * e.x_s + e.y_c * e.y_c + e.y_s * e.y_s
}

fn put<T: Real>(e: &mut Envelope<T>, target: Target, value: Complex<T>) {
    match target {
        Target::X => (e.x_c, e.x_s) = (value.re, -value.im),
        Target::Y => (e.y_c, e.y_s) = (value.re, -value.im),
        Target::Xc => e.x_c = value.re,
        Target::Xs => e.x_s = value.re,
        Target::Yc => e.y_c = value.re,
        Target::Ys => e.y_s = value.re,
        Target::Theta | Target::Damping | Target::Rate => {}
    }
}

/// Whether the steps find their operands, stay within [`MAX_DEPTH`] and [`MAX_STEPS`], and leave one value.
pub fn is_sound(steps: &[Step], parameters: usize) -> bool {
    let mut depth = 0;
    for step in steps {
        let unknown = matches!(step, Step::Parameter(p) if usize::from(*p) >= parameters);
        if unknown || depth < step.operands() {
            return false;
        }
        depth = depth - step.operands() + 1;
        if depth > MAX_DEPTH {
            return false;
        }
    }
    depth == 1 && steps.len() <= MAX_STEPS
}

#[derive(Clone, Copy)]
struct Complex<T> {
    re: T,
    im: T,
}

impl<T: Real> Complex<T> {
    fn real(re: T) -> Self {
        Self { re, im: T::zero() }
    }

    fn times(self, o: Self) -> Self {
        Self { re: self.re * o.re - self.im * o.im, im: self.re * o.im + self.im * o.re }
    }

    fn over(self, o: Self) -> Self {
        let size = o.re * o.re + o.im * o.im;
        let product = self.times(Self { re: o.re, im: -o.im });
        Self { re: product.re / size, im: product.im / size }
    }

    fn product(self, o: Self, real: bool) -> Self {
        if real { Self::real(self.re * o.re) } else { self.times(o) }
    }

    fn quotient(self, o: Self, real: bool) -> Self {
        if real { Self::real(self.re / o.re) } else { self.over(o) }
    }

    fn power(self, exponent: i8, real: bool) -> Self {
        let mut value = Self::real(T::one());
        for step in 0..exponent.unsigned_abs() {
            value = if step == 0 { self } else { value.product(self, real) };
        }
        if exponent < 0 { Self::real(T::one()).quotient(value, real) } else { value }
    }
}

/// What an expression is evaluated on.
struct Scope<'a, T> {
    p: &'a Values<T>,
    e: Envelope<T>,
    at: Moment<T>,
    rate: T,
}

impl<T: Real> Scope<'_, T> {
    /// The value of an expression; 0 of one that is not sound.
    fn value(&self, steps: &[Step]) -> Complex<T> {
        let mut stack = [Complex::real(T::zero()); MAX_DEPTH];
        let mut top = 0_usize;
        for step in steps {
            let taken = step.operands();
            let Some(base) = top.checked_sub(taken).filter(|base| *base < MAX_DEPTH) else { break };
            let at = |i: usize| stack.get(base + i).copied().unwrap_or(Complex::real(T::zero()));
            stack[base] = self.step(step, at(0), at(1), at(2));
            top = base + 1;
        }
        stack[0]
    }

    fn step(&self, step: &Step, a: Complex<T>, b: Complex<T>, c: Complex<T>) -> Complex<T> {
        let real = Complex::real;
        match *step {
            Step::Number(value) => real(number(value)),
            Step::ImaginaryUnit => Complex { re: T::zero(), im: T::one() },
            Step::Pi => real(T::zero().atan2(-T::one())),
            Step::Parameter(p) => real(self.p.get(usize::from(p)).copied().unwrap_or(T::zero())),
            Step::Variable(variable) => self.variable(variable),
            Step::Add => Complex { re: a.re + b.re, im: a.im + b.im },
            Step::Subtract => Complex { re: a.re - b.re, im: a.im - b.im },
            Step::Multiply { real } => a.product(b, real),
            Step::Divide { real } => a.quotient(b, real),
            Step::Negate => Complex { re: -a.re, im: -a.im },
            Step::Power { exponent, real } => a.power(exponent, real),
            Step::RealPart => real(a.re),
            Step::ImaginaryPart => real(a.im),
            Step::Conjugate => Complex { re: a.re, im: -a.im },
            Step::Absolute => real(if a.re < T::zero() { -a.re } else { a.re }),
            Step::Magnitude => real(a.re.norm(a.im)),
            Step::SquareRoot => real(a.re.sqrt()),
            Step::Sine => real(a.re.sin_cos().0),
            Step::Cosine => real(a.re.sin_cos().1),
            Step::Arctangent2 => real(a.re.atan2(b.re)),
            Step::Exponential => real(exponential(a.re)),
            Step::Smaller => real(if b.re < a.re { b.re } else { a.re }),
            Step::Larger => real(if b.re > a.re { b.re } else { a.re }),
            Step::IfPositive => {
                if a.re > T::zero() {
                    b
                } else {
                    c
                }
            }
        }
    }

    fn variable(&self, variable: Variable) -> Complex<T> {
        let (e, f) = (&self.e, &self.at.drive);
        Complex::real(match variable {
            Variable::X => return Complex { re: e.x_c, im: -e.x_s },
            Variable::Y => return Complex { re: e.y_c, im: -e.y_s },
            Variable::Xc => e.x_c,
            Variable::Xs => e.x_s,
            Variable::Yc => e.y_c,
            Variable::Ys => e.y_s,
            Variable::Theta => e.y_c.atan2(e.x_c),
            Variable::E => e.pendulum().e,
            Variable::Q => e.pendulum().q,
            Variable::R => e.pendulum().r,
            Variable::S => e.pendulum().s,
            Variable::Rate => self.rate,
            Variable::Time => self.at.t_s,
            Variable::Table => self.at.table_rad,
            Variable::Precession => self.at.precession_rad_s,
            Variable::Warmer => self.at.warmer_k,
            Variable::DriveX => return Complex { re: f.x_c, im: -f.x_s },
            Variable::DriveY => return Complex { re: f.y_c, im: -f.y_s },
            Variable::DriveXc => f.x_c,
            Variable::DriveXs => f.x_s,
            Variable::DriveYc => f.y_c,
            Variable::DriveYs => f.y_s,
        })
    }
}

/// A machine number as any scalar, through ratios of integers: a scalar that does not round has it exactly.
fn number<T: Real>(value: f64) -> T {
    const FRACTION: u64 = (1 << 52) - 1;
    let bits = value.to_bits();
    let biased = (bits >> 52) & 0x7ff;
    if biased == 0x7ff {
        return T::zero() / T::zero();
    }
    let (mut mantissa, mut exponent) = match biased {
        0 => (bits & FRACTION, -1074_i32),
        _ => ((bits & FRACTION) | (1 << 52), i32::try_from(biased).unwrap_or(0) - 1075),
    };
    while mantissa != 0 && mantissa & 1 == 0 {
        (mantissa, exponent) = (mantissa >> 1, exponent + 1);
    }
    let part = |bits: u64| i32::try_from(bits).unwrap_or(0);
    let size = if mantissa < 1 << 31 && (-30..=0).contains(&exponent) {
        T::ratio(part(mantissa), 1 << -exponent)
    } else {
        let half = T::ratio(1 << 26, 1);
        let mut size = T::ratio(part(mantissa >> 26), 1) * half + T::ratio(part(mantissa & ((1 << 26) - 1)), 1);
        while exponent != 0 {
            let shift = exponent.clamp(-30, 30);
            let factor = if shift < 0 { T::ratio(1, 1 << -shift) } else { T::ratio(1 << shift, 1) };
            (size, exponent) = (size * factor, exponent - shift);
        }
        size
    };
    if bits >> 63 == 1 { -size } else { size }
}

/// e to the power of `v`: a series for v/2ⁿ below ¼, squared n times.
fn exponential<T: Real>(v: T) -> T {
    let negative = v < T::zero();
    let mut rest = if negative { -v } else { v };
    let mut halvings = 0;
    while rest > T::ratio(1, 4) && halvings < MOST_HALVINGS {
        rest = rest * T::half();
        halvings += 1;
    }
    let mut sum = T::one();
    for k in (1..=SERIES_TERMS).rev() {
        sum = T::one() + sum * rest * T::ratio(1, k);
    }
    for _ in 0..halvings {
        sum = sum.squared();
    }
    if negative { T::one() / sum } else { sum }
}

/// e^2⁴⁰ is beyond every machine number.
const MOST_HALVINGS: usize = 42;
/// ¼¹⁵/15! < 1e-21
const SERIES_TERMS: i32 = 14;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_what_was_written() {
        for v in [0.0, 1.0, -0.1, 0.625, 1e-3, 6.02e23, -4.9e-300, 1.0 / 3.0, f64::MIN_POSITIVE, f64::MAX, 123_456.789]
        {
            assert_eq!(number::<f64>(v), v);
        }
        assert!(number::<f64>(f64::INFINITY).is_nan());
    }

    #[test]
    fn the_exponential_is_that_of_the_platform() {
        for v in [0.0, 0.1, -0.3, 1.0, -2.0, 10.0, 64.0, -64.0, 700.0] {
            let expected = libm::exp(v);
            assert!((exponential::<f64>(v) / expected - 1.0).abs() < 2e-13, "{v}");
        }
        assert_eq!(exponential::<f64>(f64::INFINITY), f64::INFINITY);
        assert_eq!(exponential::<f64>(-1e300), 0.0);
        assert!(exponential::<f64>(f64::NAN).is_nan());
    }

    #[test]
    fn an_expression_that_lacks_operands_is_not_sound() {
        assert!(is_sound(&[Step::Pi, Step::Negate], 0));
        assert!(!is_sound(&[Step::Pi, Step::Add], 0));
        assert!(!is_sound(&[Step::Pi, Step::Pi], 0));
        assert!(!is_sound(&[Step::Parameter(0)], 0));
        assert!(!is_sound(&[Step::Pi; MAX_DEPTH + 1], 0));
        assert!(!is_sound(&[], 0));
    }
}
