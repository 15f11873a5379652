//! Parameters that follow the temperature: p(T) = p + s(T − T₀), T₀ the temperature that parameters refer to; of a ratio, p(1 + s(T − T₀)).
//!
//! What follows acts as the effect itself does, in its stage, with slopes in the place of its parameters: beside it, or by itself where its
//! parameters are neutral at T₀. So one definition is that of all, and an effect that may have slopes only names them.

use core::marker::PhantomData;

use super::{Description, Effect, Moment, Values, listed};
use crate::{AxisForces, Envelope, Real};

/// An effect whose parameters may follow the temperature.
pub trait Followed: Effect {
    /// What is known of the effect that its slopes are: a slope per kelvin for each parameter, in their order; those that are left out
    /// follow nothing.
    const SLOPES: Description;

    /// Its parameters are ratios, neutral at 1, and their slopes relative.
    const IS_RATIO: bool = false;

    /// [`Effect::SEEN_BY_LOOPS`] of the slopes.
    const SLOPES_SEEN_BY_LOOPS: bool = Self::SEEN_BY_LOOPS;
}

/// What of the effect `E` follows the temperature.
pub struct OverTemperature<E>(PhantomData<E>);

/// The values of `E` at a moment: its slopes times the temperature over that which parameters refer to, beside the neutral values.
#[inline]
fn at_once<E: Followed, T: Real>(slopes: &Values<T>, at: &Moment<T>) -> Values<T> {
    let by = |slope: T| slope * at.warmer_k;
    if E::IS_RATIO { slopes.map(|slope| T::one() + by(slope)) } else { slopes.map(by) }
}

impl<E: Followed> Effect for OverTemperature<E>
where
    Self: listed::Listed,
{
    const DESCRIPTION: Description = E::SLOPES;

    const SEEN_BY_LOOPS: bool = E::SLOPES_SEEN_BY_LOOPS;

    const BY_TEMPERATURE: bool = true;

    #[inline]
    fn mechanics<T: Real>(p: &Values<T>, e: &Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        E::mechanics(&at_once::<E, T>(p, at), e, at)
    }

    #[inline]
    fn actuate<T: Real>(p: &Values<T>, f: AxisForces<T>, at: &Moment<T>) -> AxisForces<T> {
        E::actuate(&at_once::<E, T>(p, at), f, at)
    }

    #[inline]
    fn read<T: Real>(p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        E::read(&at_once::<E, T>(p, at), e, at)
    }

    #[inline]
    fn unread<T: Real>(p: &Values<T>, e: Envelope<T>, at: &Moment<T>) -> Envelope<T> {
        E::unread(&at_once::<E, T>(p, at), e, at)
    }
}
