//! Stiffness that differs between two principal axes: Δω at θ_ω, resolved into (Δω cos 2θ_ω, Δω sin 2θ_ω).

use super::over_temperature::Followed;
use super::{Belief, Description, Effect, Moment, Scaling, Shown, Stage, Values, fitted};
use crate::{Envelope, Real};

/// A split of 1 Hz, in rad/s.
const ONE_HERTZ: Belief = Belief::Within(6.3);

/// stiffness that depends on direction.
pub struct Anisoelasticity;

impl Effect for Anisoelasticity {
    const DESCRIPTION: Description = Description {
        id: "anisoelasticity",
        title: "stiffness that depends on direction",
        stage: Stage::Mechanics,
        declared: true,
        empirical: false,
        in_sensors: false,
        parameters: &[
            fitted("anisoelasticity_cos2", "rad/s", 1e3, 1e-2).believed(ONE_HERTZ),
            fitted("anisoelasticity_sin2", "rad/s", 1e3, 1e-2).believed(ONE_HERTZ),
        ],
        onsets: &[],
        shown: &[Shown::Polar {
            cos: 0,
            sin: 1,
            magnitude: "anisoelasticity",
            unit: "rad/s",
            angle: "theta_omega",
            division: 2.0,
        }],
        signature: "v_qc at 2θ, sin 2(θ−θ_ω); in the angle only through the quadrature that is left",
        scaling: Scaling { rate: -1, amplitude: 0, odd_in_rate: true },
        source: "Lynch 1995",
    };

    #[inline]
    fn mechanics<T: Real>(&[cos2, sin2, ..]: &Values<T>, e: &Envelope<T>, _: &Moment<T>) -> Envelope<T> {
        envelope_rate(cos2, sin2, e)
    }
}

impl Followed for Anisoelasticity {
    const SLOPES: Description = Description {
        id: "anisoelasticity-temperature",
        title: "anisoelasticity that follows the temperature",
        declared: false,
        parameters: &[
            fitted("anisoelasticity_cos2_per_k", "rad/s/K", 1e2, 1e-3),
            fitted("anisoelasticity_sin2_per_k", "rad/s/K", 1e2, 1e-3),
        ],
        shown: &[Shown::Polar {
            cos: 0,
            sin: 1,
            magnitude: "anisoelasticity_per_k",
            unit: "rad/s/K",
            angle: "theta_slope",
            division: 2.0,
        }],
        signature: "v_qc at 2θ, (T − T₀) sin 2(θ−θ_s); in the angle only through the quadrature that is left",
        source: "temperature coefficients of stiffness that differ between the axes",
        ..Self::DESCRIPTION
    };

    const SLOPES_SEEN_BY_LOOPS: bool = true;
}

/// Ẋ ∋ −(i/2)(X Δωcos2θ_ω + Y Δωsin2θ_ω), Ẏ ∋ −(i/2)(X Δωsin2θ_ω − Y Δωcos2θ_ω); `cos2`, `sin2` in rad/s.
///
/// The same shape as anisodamping, a quarter period ahead.
#[inline]
pub fn envelope_rate<T: Real>(cos2: T, sin2: T, e: &Envelope<T>) -> Envelope<T> {
    super::anisodamping::envelope_rate(cos2, sin2, e).quarter_ahead()
}
