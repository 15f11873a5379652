//! The compensation in force: the inverse of the electronics as far as they are known, and the mechanics beside it.
//!
//! It refuses to learn: it is moved by what the filter found, as a whole or not at all.

use cvg_model::{AxisForces, Envelope, Float};

use crate::complex::{Complex, Matrix};
use crate::parameters::{DETECTION, OTHERS, Parameter, Vector, get, set};
use crate::window::turn_of;

/// How far a value in force may be from a perfect instrument, in units of what is expected of devices.
pub(crate) const FARTHEST: f64 = 12.0;

/// What is undone, and what the mechanics are known to do. Readout: x, y in amplitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction<T> {
    /// offsets, cubic and mechanics; what stands in the matrices instead is 0 here
    pub(crate) known: Vector<T>,
    /// what the Y readout makes of Y: (1 + γ) e^(−iψ)
    pub(crate) y_of_y: Complex<T>,
    /// what the Y readout makes of X
    pub(crate) y_of_x: Complex<T>,
    /// what the drives make of commands, seen through the compensated readout
    pub(crate) drives: Matrix<T>,
    y_inverse: Complex<T>,
    pub(crate) drives_inverse: Matrix<T>,
}

impl<T: Float> Correction<T> {
    /// Nothing is undone; `damping_per_s` is what the mechanics are designed to have.
    pub fn none(damping_per_s: T) -> Self {
        let mut known = [T::zero(); _];
        set(&mut known, Parameter::Damping, damping_per_s);
        let (zero, one) = (Complex::real(T::zero()), Complex::real(T::one()));
        let identity = Matrix::identity();
        Self { known, y_of_y: one, y_of_x: zero, drives: identity, y_inverse: one, drives_inverse: identity }
    }

    /// The same, field by field: what copies more than 64 bytes at once costs firmware a call, and half as much again.
    #[inline(always)]
    fn copy(&self) -> Self {
        let Self { known, y_of_y, y_of_x, drives, y_inverse, drives_inverse } = *self;
        Self { known, y_of_y, y_of_x, drives, y_inverse, drives_inverse }
    }

    //= specs/self-calibration.md#bounded
    //# Every value in force MUST be finite and one that a device can have for every input.
    /// A correction of these parts; none where they can't be inverted or no device is like that.
    pub(crate) fn of(known: Vector<T>, y_of_y: Complex<T>, y_of_x: Complex<T>, drives: Matrix<T>) -> Option<Self> {
        let zero = Complex::real(T::zero());
        let mut made = Self { known, y_of_y, y_of_x, drives, y_inverse: zero, drives_inverse: Matrix::identity() };
        let sound = made.values_are_of_a_device() && made.electronics_are_of_a_device() && made.invert();
        sound.then_some(made)
    }

    pub(crate) fn values_are_of_a_device(&self) -> bool {
        let far = |p: &Parameter| p.expected::<T>() * T::from_f64(FARTHEST);
        self.known.iter().zip(&Parameter::ALL).all(|(value, p)| value.within(far(p)))
    }

    pub(crate) fn electronics_are_of_a_device(&self) -> bool {
        let Self { y_of_y, y_of_x, drives, .. } = self;
        let near = |z: &Complex<T>, target: T, reach: f64| {
            (z.re - target).within(T::from_f64(reach)) && z.im.within(T::from_f64(reach))
        };
        let (zero, one) = (T::zero(), T::one());
        near(y_of_y, one, 0.36)
            && near(y_of_x, zero, 0.12)
            && near(&drives.xx, one, 0.5)
            && near(&drives.yy, one, 0.5)
            && near(&drives.xy, zero, 0.2)
            && near(&drives.yx, zero, 0.2)
    }

    /// Its own inverses; false where there are none.
    fn invert(&mut self) -> bool {
        let Some(drives_inverse) = self.drives.inverse() else { return false };
        self.drives_inverse = drives_inverse;
        self.y_inverse = self.y_of_y.inverse();
        true
    }

    //= specs/self-calibration.md#undone
    //# A correction MUST undo a readout of its own ratio, skew, phase and offsets.
    /// The readout undone: volts in, volts out, at a set amplitude of `amplitude_v`.
    #[inline]
    pub(crate) fn readout(&self, e: &Envelope<T>, amplitude_v: T, per_amplitude: T) -> Envelope<T> {
        let offset = |p| get(&self.known, p) * amplitude_v;
        let x = Complex::new(e.x_c - offset(Parameter::OffsetX), -e.x_s);
        let y = Complex::new(e.y_c - offset(Parameter::OffsetY), -e.y_s);
        let y = (y - self.y_of_x * x) * self.y_inverse;
        let cubic = get(&self.known, Parameter::Cubic) * per_amplitude.squared();
        let straight = |z: Complex<T>| {
            let m = cubic * z.squared_norm();
            let once = T::one() + m;
            let by = T::one() / (T::one() + m / once.squared());
            Complex::new(z.re * by, z.im * by)
        };
        let (x, y) = (straight(x), straight(y));
        Envelope::new(x.re, -x.im, y.re, -y.im)
    }

    /// The drives undone: what to command for the forces that are wanted. A force in sine phase pushes against the
    /// cosine of the vibration, one in cosine phase along its sine: F_s + iF_c turns as the vibration does.
    #[inline]
    pub(crate) fn drive(&self, f: &AxisForces<T>) -> AxisForces<T> {
        let (x, y) = self.drives_inverse.apply(Complex::new(f.x_s, f.x_c), Complex::new(f.y_s, f.y_c));
        AxisForces { x_c: x.im, x_s: x.re, y_c: y.im, y_s: y.re }
    }

    /// Moved by `delta`, exactly: the mechanics and the drives seen through the new readout, then their own changes.
    /// None where the outcome is no instrument.
    pub(crate) fn moved(&self, delta: &Vector<T>) -> Option<Self> {
        let mut way = Move::begin(self);
        for part in 0..Move::<T>::PARTS {
            way.advance(delta, part);
        }
        way.end()
    }

    /// The same with skews in phase with what they are skews of, which no parameter says: the Y readout delays what it sees
    /// of X as it delays Y, and the drives what they push across as what they push along. None where that is no instrument.
    pub(crate) fn skews_in_phase(&self) -> Option<Self> {
        let slope = |z: Complex<T>| z.im / z.re;
        let at = |re: T, slope: T| Complex::new(re, re * slope);
        let y_of_x = at(self.y_of_x.re, slope(self.y_of_y));
        let common = T::half() * (slope(self.drives.xx) + slope(self.drives.yy));
        let across = |z: Complex<T>| at(z.re, common);
        let drives = Matrix { xy: across(self.drives.xy), yx: across(self.drives.yx), ..self.drives };
        Self::of(self.known, self.y_of_y, y_of_x, drives)
    }

    /// An offset, the cubic, or a number of the mechanics in force, in the parameter's unit; 0 of one that stands in the
    /// matrices.
    pub fn known(&self, p: Parameter) -> T {
        get(&self.known, p)
    }

    /// What the drives make of commands, seen through the compensated readout.
    pub fn drives(&self) -> &Matrix<T> {
        &self.drives
    }

    /// γ in force.
    pub fn detection_ratio(&self) -> T {
        self.y_of_y.squared_norm().sqrt() - T::one()
    }

    /// ψ in force, rad: how far the Y readout is behind that of X.
    pub fn detection_phase(&self) -> T {
        (-self.y_of_y.im).atan2(self.y_of_y.re)
    }

    /// Tangent of ψ in force.
    pub(crate) fn detection_lag(&self) -> T {
        -(self.y_of_y.im / self.y_of_y.re)
    }

    /// s in force.
    pub fn detection_skew(&self) -> T {
        self.y_of_x.re
    }
}

/// [`Correction::moved`], part by part: no control step has to do all of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Move<T> {
    to: Correction<T>,
    /// what the new Y readout makes of X and of Y behind the one in force, and one over the latter
    yx: T,
    yy: Complex<T>,
    per_yy: Complex<T>,
    /// the detection moves
    sees: bool,
    sound: bool,
}

impl<T: Float> Move<T> {
    pub(crate) const PARTS: u16 = 8;

    pub(crate) fn begin(from: &Correction<T>) -> Self {
        let one = Complex::real(T::one());
        Self { to: from.copy(), yx: T::zero(), yy: one, per_yy: one, sees: false, sound: true }
    }

    /// Part `n` of the way, one after the other, always with the same `delta`.
    pub(crate) fn advance(&mut self, delta: &Vector<T>, n: u16) {
        match n {
            0 => self.turn_readout(delta),
            1 if self.sees => {
                let seen = self.between(&mechanics(&self.to.known));
                set_mechanics(&mut self.to.known, &seen);
            }
            2 if self.sees => {
                self.to.drives = self.seen(&self.to.drives);
                self.to.y_of_x = self.to.y_of_x + self.to.y_of_y.times(self.yx);
                self.to.y_of_y = self.to.y_of_y * self.yy;
            }
            3 => add_mechanics(&mut self.to.known, delta),
            4 => self.turn_drives(delta),
            5 => self.sound = self.sound && self.to.values_are_of_a_device(),
            6 => self.sound = self.sound && self.to.electronics_are_of_a_device(),
            7 => self.sound = self.sound && self.to.invert(),
            _ => {}
        }
    }

    /// Where it leads to; none where that is no instrument.
    #[inline(always)]
    pub(crate) fn end(&self) -> Option<Correction<T>> {
        self.sound.then(|| self.to.copy())
    }

    fn turn_readout(&mut self, delta: &Vector<T>) {
        self.sees = delta.iter().skip(OTHERS).take(DETECTION).any(|d| *d != T::zero());
        let (sin, cos) = turn_of(get(delta, Parameter::DetectionPhase));
        let ratio = T::one() + get(delta, Parameter::DetectionRatio);
        self.yx = get(delta, Parameter::DetectionSkew);
        self.yy = Complex::new(ratio * cos, -(ratio * sin));
        let n = self.yy.squared_norm();
        // false for NaN
        self.sound = n > T::from_f64(1e-6) && n.is_finite();
        self.per_yy = self.yy.inverse();
    }

    /// What a matrix that ends in the readout becomes behind the new one.
    fn seen(&self, m: &Matrix<T>) -> Matrix<T> {
        let y = |x: Complex<T>, y: Complex<T>| (y - x.times(self.yx)) * self.per_yy;
        Matrix { xx: m.xx, xy: m.xy, yx: y(m.xx, m.yx), yy: y(m.xy, m.yy) }
    }

    /// What one that begins in it, too, becomes.
    fn between(&self, m: &Matrix<T>) -> Matrix<T> {
        self.seen(&Matrix {
            xx: m.xx + m.xy.times(self.yx),
            xy: m.xy * self.yy,
            yx: m.yx + m.yy.times(self.yx),
            yy: m.yy * self.yy,
        })
    }

    fn turn_drives(&mut self, delta: &Vector<T>) {
        let d = |p| get(delta, p);
        let (turn, phase) = (d(Parameter::ForceRotation), d(Parameter::ForcePhase));
        let scale = T::one() + d(Parameter::ForceScale);
        // [[xx, −turn], [yx, yy]] on the left; no parameter is the phase of a skew: what can't be learned isn't kept either
        let xx = Complex::new(scale, phase);
        let yx = turn + d(Parameter::ForceSkew);
        let yy = Complex::new(scale + d(Parameter::ForceRatio), phase + d(Parameter::ForcePhaseDifference));
        let drives = &mut self.to.drives;
        let m = *drives;
        *drives = Matrix {
            xx: xx * m.xx - m.yx.times(turn),
            xy: Complex::real((xx * m.xy - m.yy.times(turn)).re),
            yx: Complex::real((m.xx.times(yx) + yy * m.yx).re),
            yy: m.xy.times(yx) + yy * m.yy,
        };
    }
}

fn add_mechanics<T: Float>(known: &mut Vector<T>, delta: &Vector<T>) {
    for ((value, change), p) in known.iter_mut().zip(delta).zip(Parameter::ALL) {
        if is_mechanical(p) {
            *value = *value + *change;
        }
    }
}

/// What is added up, rather than composed.
fn is_mechanical(p: Parameter) -> bool {
    matches!(
        p,
        Parameter::OffsetX
            | Parameter::OffsetY
            | Parameter::Cubic
            | Parameter::Damping
            | Parameter::AnisodampingCos
            | Parameter::AnisodampingSin
            | Parameter::SplitCos
            | Parameter::SplitSin
            | Parameter::QuadratureRate
            | Parameter::Rate
    )
}

/// The equation of motion at rest as a matrix: Ẋ = M X.
fn mechanics<T: Float>(v: &Vector<T>) -> Matrix<T> {
    let k = |p| get(v, p);
    let half = T::half();
    let (damping, dc, ds) = (k(Parameter::Damping), k(Parameter::AnisodampingCos), k(Parameter::AnisodampingSin));
    let (kc, ks) = (half * k(Parameter::SplitCos), half * k(Parameter::SplitSin));
    let (q, b) = (k(Parameter::QuadratureRate), k(Parameter::Rate));
    Matrix {
        xx: Complex::new(-damping - dc, -kc),
        xy: Complex::new(-ds - b, q - ks),
        yx: Complex::new(b - ds, -ks - q),
        yy: Complex::new(dc - damping, kc),
    }
}

fn set_mechanics<T: Float>(v: &mut Vector<T>, m: &Matrix<T>) {
    let half = T::half();
    set(v, Parameter::Damping, -(half * (m.xx.re + m.yy.re)));
    set(v, Parameter::AnisodampingCos, half * (m.yy.re - m.xx.re));
    set(v, Parameter::AnisodampingSin, -(half * (m.xy.re + m.yx.re)));
    set(v, Parameter::SplitCos, m.yy.im - m.xx.im);
    set(v, Parameter::SplitSin, -(m.xy.im + m.yx.im));
    set(v, Parameter::QuadratureRate, half * (m.xy.im - m.yx.im));
    set(v, Parameter::Rate, half * (m.yx.re - m.xy.re));
}
