//! How the angle of a run swings about a steady precession, and what that says before anything is fitted.
//!
//! A pattern that anisodamping or unequal drives pull, θ̇ = −kΩ + p sin 2(θ − θ₀), does not turn steadily: θ = u + q cos 2(u − θ₀) + …
//! about an angle u that does, where r = p/(kΩ) and q = (1 − √(1 − r²))/r, and the mean precession is √(1 − r²) = (1 − q²)/(1 + q²) of
//! kΩ (Adler's equation). An error of the readout swings the angle as well and slows nothing; only what goes with one over the
//! precession pulls.

use crate::numerics::linear::NormalEquations;

/// A swing beyond this is none of a pattern that turns.
const LARGEST: f64 = 0.7;
/// Rounds in which a swing and what pulls agree.
const ROUNDS: usize = 8;

/// δθ = `cos` cos 2θ + `sin` sin 2θ, rad.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Swing {
    pub(crate) cos: f64,
    pub(crate) sin: f64,
}

impl Swing {
    /// Of angles that would be steady, each with by how much it is off, both rad.
    pub(crate) fn of(angles: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut equations = NormalEquations::new(3);
        for (u, off) in angles {
            let (sin, cos) = (2.0 * u).sin_cos();
            equations.add(&[1.0, cos, sin], off);
        }
        let solved = equations.solve();
        Self { cos: solved[1], sin: solved[2] }
    }

    /// q
    pub(crate) fn size(&self) -> f64 {
        self.cos.hypot(self.sin).min(LARGEST)
    }

    /// By which share of itself kΩ exceeds the mean precession of a pattern that swings as far, if all of it pulls.
    pub(crate) fn slowing(&self) -> f64 {
        let square = self.size().powi(2);
        2.0 * square / (1.0 - square)
    }
}

/// What pulls the pattern, as an anisodamping [Δ(1/τ) cos 2θ_τ, Δ(1/τ) sin 2θ_τ], 1/s, of runs each with its mean precession, rad/s, and
/// its swing. `None` where the runs do not turn at two speeds: the swing of all may be an error of the readout.
pub(crate) fn pull(runs: &[(f64, Swing)]) -> Option<[f64; 2]> {
    let (fastest, slowest) = runs.iter().fold((f64::MIN, f64::MAX), |(high, low), (precession, _)| {
        let inverse = 1.0 / precession;
        (high.max(inverse), low.min(inverse))
    });
    let apart = fastest - slowest;
    let largest = fastest.abs().max(slowest.abs());
    if !(apart.is_finite() && apart > 0.5 * largest) {
        return None;
    }
    let (mut readout, mut pulls) = ([0.0; 2], [0.0; 2]);
    for _ in 0..ROUNDS {
        let mut equations = [NormalEquations::new(2), NormalEquations::new(2)];
        for (precession, swing) in runs {
            let own = Swing { cos: swing.cos - readout[0], sin: swing.sin - readout[1] };
            let by_pull = -(1.0 - own.size().powi(2)) / (4.0 * precession);
            equations[0].add(&[1.0, by_pull], swing.cos);
            equations[1].add(&[1.0, by_pull], swing.sin);
        }
        for (part, equations) in equations.iter().enumerate() {
            let solved = equations.solve();
            (readout[part], pulls[part]) = (solved[0], solved[1]);
        }
    }
    pulls.iter().all(|p| p.is_finite()).then_some(pulls)
}

/// The swing of a run whose mean precession is `precession`, rad/s, that `pulls` make.
pub(crate) fn swing_of(pulls: [f64; 2], precession: f64) -> Swing {
    let per_q = 4.0 * precession.abs() / pulls[0].hypot(pulls[1]).max(f64::MIN_POSITIVE);
    // 4 q u̇/(1 − q²) = Δ(1/τ)
    let q = (0.5 * (per_q.hypot(2.0) - per_q)).min(LARGEST);
    let along = -q * precession.signum() / pulls[0].hypot(pulls[1]).max(f64::MIN_POSITIVE);
    Swing { cos: along * pulls[0], sin: along * pulls[1] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run of θ̇ = −kΩ + ½ Δ(1/τ) sin 2(θ − θ_τ) read with unequal gains: its mean precession and its swing.
    fn run(nominal: f64, [cos, sin]: [f64; 2], unequal: f64) -> (f64, Swing) {
        let rate = |theta: f64| {
            let (s, c) = (2.0 * theta).sin_cos();
            nominal + 0.5 * (cos * s - sin * c)
        };
        let (step, steps) = (2e-4 / nominal.abs(), 400_000);
        let mut theta: Vec<f64> = vec![0.3];
        for _ in 0..steps {
            let now = theta[theta.len() - 1];
            theta.push(now + step * rate(now + 0.5 * step * rate(now)));
        }
        // over whole turns of the pattern
        let end = theta.iter().rposition(|t| (t - 0.3).abs() % std::f64::consts::PI < 1e-3).unwrap_or(steps);
        let mean = (theta[end] - theta[0]) / (end as f64 * step);
        let offset = theta[..end].iter().enumerate().map(|(i, t)| t - mean * i as f64 * step).sum::<f64>() / end as f64;
        let angles = theta[..end].iter().enumerate().map(|(i, t)| {
            let steady = offset + mean * i as f64 * step;
            (steady, t + unequal * (2.0 * t).sin() - steady)
        });
        (mean, Swing::of(angles))
    }

    #[test]
    fn a_pattern_that_swings_is_slowed_by_what_its_swing_says() {
        for [nominal, pulls] in [[-1.0, 0.4], [-1.0, 1.2], [0.5, 0.6]] {
            let (mean, swing) = run(nominal, [pulls, 0.0], 0.0);
            assert!(
                (mean * (1.0 + swing.slowing()) / nominal - 1.0).abs() < 2e-3,
                "{nominal} {pulls}: {mean} {swing:?}"
            );
            let expected = swing_of([pulls, 0.0], mean);
            assert!((swing.cos - expected.cos).abs() < 5e-3 && swing.sin.abs() < 5e-3, "{swing:?} {expected:?}");
        }
    }

    #[test]
    fn runs_at_two_speeds_tell_what_pulls_from_the_readout() {
        let pulls = [0.3, -0.5];
        let runs: Vec<_> = [-2.0, 0.8, -0.7].iter().map(|n| run(*n, pulls, 0.02)).collect();
        let told = pull(&runs).expect("three speeds");
        assert!((told[0] - pulls[0]).abs() < 0.03 && (told[1] - pulls[1]).abs() < 0.03, "{told:?}");
        assert_eq!(pull(&runs[..1]), None);
        assert_eq!(pull(&[runs[0], runs[0]]), None);
    }
}
