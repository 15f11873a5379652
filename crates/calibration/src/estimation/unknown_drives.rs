//! What drives that nothing tells may have moved, where nobody recorded their commands, or nothing shows how unequal they are.
//!
//! The drives that hold the amplitude push as hard as the damping pulls. Unequal by (r − 1), they turn the pattern by
//! ½ (r − 1)/τ · sin 2θ, which is an anisodamping of (r − 1)/τ to the last digit; late by t, by kΩ t/τ, which is a share t/τ of the
//! angular gain. Both grow with 1/τ, and an anisodamping says how large that is at least: it is a share of the damping.

use cvg_model::effects::EffectId;
use nalgebra::DMatrix;

use crate::estimation::fit::{Fit, Prepared};
use crate::estimation::joint_fit::{Dataset, Fitted, belief, fitted_tracks};
use crate::model::hypothesis::Unknown;

/// Δ(1/τ) as a share of 1/τ, as in the paper's device (4.7e-3 1/s at 22 s),
const ANISODAMPING_SHARE: f64 = 0.1;
/// and drives that are unequal by this much, one standard deviation: three times those of the paper's device.
const UNEQUAL_DRIVES: f64 = 0.03;

/// How the drives are held in a fit, and what is left open so.
struct Open {
    /// by how much the damping may exceed the one that the fit considers, if nothing tells it, 1/s
    beyond: f64,
    /// the damping that drives replace of which the fit takes both to be equal, 1/s
    equal: f64,
}

impl Open {
    fn of(dataset: &Dataset, fitted: &Fitted) -> Option<Self> {
        let Fit { hypothesis, unknowns, .. } = &fitted.fit;
        let values = &hypothesis.member(EffectId::Anisodamping)?.values;
        let ratio = hypothesis.position(EffectId::ActuationGainMismatch)?;
        let untold = unknowns.contains(&Unknown::Damping);
        let beyond = values[0].hypot(values[1]) / ANISODAMPING_SHARE - belief::DAMPING_PER_S;
        let beyond = if untold { beyond.max(0.0) } else { 0.0 };
        let is_told = fitted.drive.is_some() || unknowns.contains(&Unknown::Effect(ratio, 0));
        let considered = if untold { belief::DAMPING_PER_S } else { hypothesis.force_scale * dataset.command_rms[0] };
        Some(Self { beyond, equal: if is_told { beyond } else { beyond + considered } })
    }
}

/// The covariance of a fit with what drives that nothing tells may have moved.
pub(crate) fn with_unknown_drives(dataset: &Dataset, fitted: &Fitted, mut covariance: DMatrix<f64>) -> DMatrix<f64> {
    let hypothesis = &fitted.fit.hypothesis;
    let Some((open, anisodamping)) = Open::of(dataset, fitted).zip(hypothesis.position(EffectId::Anisodamping)) else {
        return covariance;
    };
    let mut widen = |unknown, by: f64| {
        if let Some(i) = fitted.fit.unknowns.iter().position(|u| *u == unknown) {
            covariance[(i, i)] += by * by;
        }
    };
    widen(Unknown::Effect(anisodamping, 0), UNEQUAL_DRIVES * open.equal);
    // askew they do the same to the other axis
    widen(Unknown::Effect(anisodamping, 1), UNEQUAL_DRIVES * open.beyond);
    widen(Unknown::AngularGain, hypothesis.angular_gain * belief::CONTROL_LATENCY_S * open.beyond);
    covariance
}

/// What has to be said of an anisodamping beside a damping that nothing tells.
pub(crate) fn said_of_the_damping(dataset: &Dataset, fitted: &Fitted) -> Option<String> {
    Open::of(dataset, fitted).filter(|open| open.beyond > 0.0).map(|_| {
        "the commands were not recorded: unequal drives of a device that is damped as much turn the pattern as its anisodamping does, and \
         neither is told from the other; vas_v would tell them apart, with ring-downs at 0° and 90°"
            .to_owned()
    })
}

/// rms of the energy and the quadrature command per unit of amplitude over the runs that are fitted, V/V.
pub(super) fn command_rms(tracks: &[Prepared]) -> [f64; 2] {
    let (mut n, mut squares) = (0.0, [0.0; 2]);
    for track in fitted_tracks(tracks) {
        for i in (0..track.t_s.len()).step_by((track.t_s.len() / 2000).max(1)) {
            let e = track.envelope(i).pendulum().e;
            if let Some(v) = track.commands(i, 1).filter(|_| e > 0.0) {
                n += 1.0;
                squares[0] += v.now.v_as * v.now.v_as / e;
                squares[1] += v.now.v_qc * v.now.v_qc / e;
            }
        }
    }
    squares.map(|s: f64| if n > 0.0 { (s / n).sqrt() } else { 0.0 })
}
