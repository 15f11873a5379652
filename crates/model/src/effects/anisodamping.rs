//! Damping that differs between two principal axes: Δ(1/τ) at θ_τ, resolved into (Δ cos 2θ_τ, Δ sin 2θ_τ).

use super::over_temperature::Followed;
use super::{Belief, Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// Four times the difference that the paper's device has, 1/s.
const FOUR_TIMES_THE_PAPERS: Belief = Belief::Within(0.02);

/// damping that depends on direction.
pub struct Anisodamping;

impl Effect for Anisodamping {
    const DESCRIPTION: Description = Description {
        id: "anisodamping",
        title: "damping that depends on direction",
        stage: Stage::Mechanics,
        declared: true,
        empirical: false,
        in_sensors: false,
        parameters: &[
            fitted("anisodamping_cos2", "1/s", 10.0, 1e-3).believed(FOUR_TIMES_THE_PAPERS),
            fitted("anisodamping_sin2", "1/s", 10.0, 1e-3).believed(FOUR_TIMES_THE_PAPERS),
        ],
        onsets: &[],
        shown: &[Shown::Polar {
            cos: 0,
            sin: 1,
            magnitude: "anisodamping",
            unit: "1/s",
            angle: "theta_tau",
            division: 2.0,
        }],
        signature: "angle Δ(1/τ)/(4kΩ) cos 2(θ−θ_τ); v_as at 2θ, ½Δ(1/τ)τ relative",
        scaling: Scaling { rate: -1, amplitude: 0, odd_in_rate: true },
        source: "Lynch 1995",
    };

    #[inline]
    fn mechanics<T: Real>(&[cos2, sin2, ..]: &Values<T>, e: &Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        envelope_rate(cos2, sin2, e)
    }
}

impl Followed for Anisodamping {
    const SLOPES: Description = Description {
        id: "anisodamping-temperature",
        title: "anisodamping that follows the temperature",
        declared: false,
        parameters: &[
            fitted("anisodamping_cos2_per_k", "1/s/K", 1.0, 1e-4),
            fitted("anisodamping_sin2_per_k", "1/s/K", 1.0, 1e-4),
        ],
        shown: &[Shown::Polar {
            cos: 0,
            sin: 1,
            magnitude: "anisodamping_per_k",
            unit: "1/s/K",
            angle: "theta_slope",
            division: 2.0,
        }],
        signature: "angle s(T − T₀)/(4kΩ) cos 2(θ−θ_s); v_as at 2θ, ½s(T − T₀)τ relative",
        source: "thermoelastic damping and anchor losses over the temperature",
        ..Self::DESCRIPTION
    };
}

/// Ẋ ∋ −½(X Δcos2θ_τ + Y Δsin2θ_τ), Ẏ ∋ −½(X Δsin2θ_τ − Y Δcos2θ_τ); `cos2`, `sin2` in 1/s.
#[inline]
pub fn envelope_rate<T: Real>(cos2: T, sin2: T, e: &Envelope<T>) -> Envelope<T> {
    let k = -T::half();
    Envelope::new(
        k * (cos2 * e.x_c + sin2 * e.y_c),
        k * (cos2 * e.x_s + sin2 * e.y_s),
        k * (sin2 * e.x_c - cos2 * e.y_c),
        k * (sin2 * e.x_s - cos2 * e.y_s),
    )
}
