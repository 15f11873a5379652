//! The inverse of the readout effects that an identification found, applied at run time.
//!
//! A readout effect acts in the order of [`EffectId::ALL`], the order in which the signal meets it; so it is undone in
//! the reverse order. Nothing here names an effect: what can be inverted is what the library defines, and what form an
//! inverse has the library says too. What most instruments need, gains, skew and offsets and then a cubic, is one matrix
//! and two quotients.

use cvg_model::effects::{Cubic, EffectId, Inverse, MAX_PARAMETERS, Moment, Stage, Values};
use cvg_model::{Envelope, Float};

use crate::ConfigError;

/// Up to `N` readout effects with their parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compensation<T, const N: usize> {
    /// in the order of [`EffectId::ALL`], then as given; the unused places are at the end
    effects: [Option<(EffectId, Values<T>)>; N],
    /// undoes the last effects, as far as they are affine
    affine: Affine<T>,
    /// undoes the effect before those, if it is a cubic
    cubic: Option<Cubic<T>>,
    /// how many effects before those are left
    left: usize,
}

/// x' = xx·x + xy·y, y' = yx·x + yy·y in both phases, and an offset in phase.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Affine<T> {
    xx: T,
    xy: T,
    yx: T,
    yy: T,
    x: T,
    y: T,
}

impl<T: Float, const N: usize> Compensation<T, N> {
    /// No effect: the readout as it is.
    pub fn none() -> Self {
        let (zero, one) = (T::zero(), T::one());
        let affine = Affine { xx: one, xy: zero, yx: zero, yy: one, x: zero, y: zero };
        Self { effects: [None; N], affine, cubic: None, left: 0 }
    }

    /// The inverse of `effects`.
    ///
    /// # Errors
    /// More than `N` effects; an effect that does not act on the readout; a parameter that is not finite or outside
    /// its bounds in the library; a value other than 0 in a place that no parameter uses.
    pub fn new(effects: &[(EffectId, Values<T>)]) -> Result<Self, ConfigError> {
        for (id, values) in effects {
            check(*id, values)?;
        }
        let mut sorted = Self::none();
        let mut free = sorted.effects.iter_mut();
        for &id in EffectId::ALL {
            for entry in effects.iter().filter(|(e, _)| *e == id) {
                let place = free.next().ok_or(ConfigError {
                    parameter: "effects",
                    expected: "no more than the compensation has room for",
                })?;
                *place = Some(*entry);
            }
        }
        let form = |(id, values): &(EffectId, Values<T>)| id.inverse(values);
        let used = effects.len();
        let affine = sorted.effects().rev().take_while(|e| form(e) == Inverse::Affine).count();
        let undoing = Affine::undoing(&sorted.effects().rev().take(affine));
        sorted.affine = undoing;
        sorted.left = used.saturating_sub(affine);
        let before = sorted.effects().rev().nth(affine).map(form);
        if let Some(Inverse::Cubic(cubic)) = before {
            sorted.cubic = Some(cubic);
            sorted.left = sorted.left.saturating_sub(1);
        }
        Ok(sorted)
    }

    /// The effects undone, in the order in which the signal meets them.
    pub fn effects(&self) -> impl DoubleEndedIterator<Item = &(EffectId, Values<T>)> + Clone {
        self.effects.iter().flatten()
    }

    /// The vibration behind the readout `e` at the moment `at`.
    ///
    /// Where an effect has no inverse (a readout that no vibration can give) the result is the library's nearest, or
    /// not finite; the trackers downstream report that as invalid.
    #[inline]
    pub fn apply(&self, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        self.apply_at(e, || *at)
    }

    /// [`Compensation::apply`] for a moment that is asked for only where an effect may depend on it.
    #[inline]
    pub fn apply_at(&self, e: Envelope<T>, at: impl FnOnce() -> Moment<T>) -> Envelope<T> {
        match self.apply_at_any_moment(e) {
            Some(z) => z,
            None => self.undo_left(self.undo_forms(e), at()),
        }
    }

    /// [`Compensation::apply`] where no effect depends on the moment; None where one may.
    #[inline(always)]
    pub fn apply_at_any_moment(&self, e: Envelope<T>) -> Option<Envelope<T>> {
        if self.left == 0 { Some(self.undo_forms(e)) } else { None }
    }

    #[inline(always)]
    fn undo_forms(&self, e: Envelope<T>) -> Envelope<T> {
        let z = self.affine.apply(e);
        match &self.cubic {
            Some(cubic) => cubic.undo(z),
            None => z,
        }
    }

    #[inline(never)]
    fn undo_left(&self, e: Envelope<T>, at: Moment<T>) -> Envelope<T> {
        let left = self.effects.iter().take(self.left).rev().flatten();
        left.fold(e, |z, (id, values)| id.unread(values, z, &at))
    }
}

impl<T: Float> Affine<T> {
    /// What undoes `effects`, in this order. Found in double precision, so that an offset does not round the matrix.
    fn undoing<'a>(effects: &(impl Iterator<Item = &'a (EffectId, Values<T>)> + Clone)) -> Self
    where
        T: 'a,
    {
        let of = |x_c: f64, y_c: f64| {
            effects.clone().fold(Envelope::new(x_c, 0.0, y_c, 0.0), |z, (id, values)| {
                id.unread(&values.map(T::to_f64), z, &Moment::default())
            })
        };
        let offset = of(0.0, 0.0);
        let (of_x, of_y) = (of(1.0, 0.0) - offset, of(0.0, 1.0) - offset);
        let t = T::from_f64;
        Self { xx: t(of_x.x_c), xy: t(of_y.x_c), yx: t(of_x.y_c), yy: t(of_y.y_c), x: t(offset.x_c), y: t(offset.y_c) }
    }

    #[inline(always)]
    fn apply(&self, e: Envelope<T>) -> Envelope<T> {
        let Self { xx, xy, yx, yy, x, y } = *self;
        Envelope::new(
            x + xx * e.x_c + xy * e.y_c,
            xx * e.x_s + xy * e.y_s,
            y + yx * e.x_c + yy * e.y_c,
            yx * e.x_s + yy * e.y_s,
        )
    }
}

fn check<T: Float>(id: EffectId, values: &Values<T>) -> Result<(), ConfigError> {
    let description = id.description();
    if description.stage != Stage::Readout || !id.in_library() {
        return Err(ConfigError { parameter: description.id, expected: "an effect of the readout" });
    }
    for (value, parameter) in values.iter().zip(description.parameters) {
        let v = value.to_f64();
        if !(v >= parameter.lower && v <= parameter.upper) {
            return Err(ConfigError { parameter: parameter.name, expected: "finite and within its bounds" });
        }
    }
    let unused = MAX_PARAMETERS.saturating_sub(description.parameters.len());
    if values.iter().rev().take(unused).any(|v| *v != T::zero()) {
        return Err(ConfigError { parameter: description.id, expected: "given no more values than it has parameters" });
    }
    Ok(())
}
