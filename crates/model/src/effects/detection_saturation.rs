//! A readout carrier clipped at a level: each channel's envelope is scaled by the describing function of saturation,
//! N = (2/π)(asin r + r√(1−r²)) with r = clip/|X| < 1.
//!
//! The parameter is 1/clip, so that 0 is "never".

use super::{Belief, Description, Effect, Moment, Parameter, Role, Scaling, Shown, Stage, Values};
use crate::{Envelope, Real};

/// clipping of the readout carrier.
pub struct DetectionSaturation;

impl Effect for DetectionSaturation {
    const DESCRIPTION: Description = Description {
        id: "detection-saturation",
        title: "clipping of the readout carrier",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: true,
        parameters: &[Parameter {
            name: "inverse_clip",
            unit: "1/V",
            lower: 0.0,
            upper: 1e6,
            neutral: 0.0,
            scale: 1e-3,
            role: Role::Fitted,
            belief: Belief::Vague,
        }],
        onsets: &[1.01, 1.05, 1.2],
        shown: &[Shown::Plain(0)],
        signature: "angle at 4θ, 8θ, 12θ … in a fixed ratio, from a threshold of amplitude",
        scaling: Scaling { rate: 0, amplitude: 2, odd_in_rate: false },
        source: "describing function of saturation (Gelb and Vander Velde 1968)",
    };

    #[inline]
    fn read<T: Real>(&[inverse_clip, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let x = clipped_gain(inverse_clip * e.x_c.norm(e.x_s));
        let y = clipped_gain(inverse_clip * e.y_c.norm(e.y_s));
        Envelope::new(x * e.x_c, x * e.x_s, y * e.y_c, y * e.y_s)
    }

    #[inline]
    fn unread<T: Real>(&[inverse_clip, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let x = unclipped_gain(inverse_clip * e.x_c.norm(e.x_s));
        let y = unclipped_gain(inverse_clip * e.y_c.norm(e.y_s));
        Envelope::new(x * e.x_c, x * e.x_s, y * e.y_c, y * e.y_s)
    }
}

/// Output over input amplitude of a carrier that reaches `drive` times the clip level.
#[inline]
pub(super) fn clipped_gain<T: Real>(drive: T) -> T {
    if drive > T::one() {
        let r = T::one() / drive;
        let rest = (T::one() - r * r).sqrt();
        two_over_pi::<T>() * (r.atan2(rest) + r * rest)
    } else {
        T::one()
    }
}

/// Input over output amplitude for an output that is `seen` times the clip level.
///
/// The output amplitude D·N(D) grows with the drive D towards 4/π, with slope (2/π)(asin r − r√(1−r²)); Newton from
/// below, on the concave curve, never overshoots. What lies beyond 4/π cannot come from a clipped carrier and is
/// taken as the largest drive considered.
#[inline]
fn unclipped_gain<T: Real>(seen: T) -> T {
    if seen <= T::one() {
        return T::one();
    }
    let mut drive = seen;
    for _ in 0..NEWTON_STEPS {
        let r = T::one() / drive;
        let rest = (T::one() - r * r).sqrt();
        let slope = two_over_pi::<T>() * (r.atan2(rest) - r * rest);
        let next = drive + (seen - drive * clipped_gain(drive)) / slope;
        drive = if next < T::ratio(LARGEST_DRIVE, 1) { next } else { T::ratio(LARGEST_DRIVE, 1) };
        if drive <= T::one() {
            drive = seen;
        }
    }
    drive / seen
}

/// 2/π
#[inline]
fn two_over_pi<T: Real>() -> T {
    T::two() / T::zero().atan2(-T::one())
}

/// Newton steps of the inverse.
const NEWTON_STEPS: usize = 8;

/// A carrier driven this many times over the clip level has lost its amplitude.
const LARGEST_DRIVE: i32 = 10;
