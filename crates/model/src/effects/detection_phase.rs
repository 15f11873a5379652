//! Readout channels of unequal phase lag: X_d = X e^{+iφ/2}, Y_d = Y e^{−iφ/2}, φ = φ_y − φ_x.
//!
//! The lag that both have in common is the phase-locked loop's to follow: it changes none of E, Q, R and S. The difference
//! makes of a line orbit an ellipse, Q_d = E sin 2θ · sin φ, and the quadrature loop nulls that by a true quadrature of the
//! opposite sign. With a split, that turns the pattern: θ̇ ∋ −¼Δω sin φ [sin(4θ − 2θ_ω) + sin 2θ_ω]. Where the phase lock is fast
//! enough to follow 2θ, its phase goes by −½φ cos 2θ, and the force that holds the split turns half of the 4θ back.

use super::{Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// unequal phase lag of the readout channels.
pub struct DetectionPhase;

impl Effect for DetectionPhase {
    const SEEN_BY_LOOPS: bool = true;
    const DESCRIPTION: Description = Description {
        id: "detection-phase",
        title: "unequal phase lag of the readout channels",
        stage: Stage::Readout,
        declared: false,
        empirical: false,
        in_sensors: false,
        parameters: &[fitted("phase_difference", "rad", 0.5, 1e-2)],
        onsets: &[],
        shown: &[Shown::Plain(0)],
        signature: "angle −Δω sin φ/(32kΩ) cos(4θ−2θ_ω), twice that where the phase lock is too slow for 2θ, through a true \
                    Q = −E sin 2θ sin φ; v_qc at 2θ",
        scaling: Scaling { rate: -1, amplitude: 0, odd_in_rate: true },
        source: "phasors of two channels with unequal delay",
    };

    #[inline]
    fn read<T: Real>(&[phase, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let (sin, cos) = (T::ratio(1, 2) * phase).sin_cos();
        lagged(e, sin, cos)
    }

    #[inline]
    fn unread<T: Real>(&[phase, ..]: &Values<T>, e: Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        let (sin, cos) = (T::ratio(1, 2) * phase).sin_cos();
        lagged(e, -sin, cos)
    }
}

/// X = x_c − i x_s turned forward by an angle, and Y backward by the same.
#[inline]
fn lagged<T: Real>(e: Envelope<T>, sin: T, cos: T) -> Envelope<T> {
    Envelope::new(
        e.x_c * cos + e.x_s * sin,
        e.x_s * cos - e.x_c * sin,
        e.y_c * cos - e.y_s * sin,
        e.y_s * cos + e.y_c * sin,
    )
}
