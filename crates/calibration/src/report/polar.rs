//! Two parameters (c, s) of an effect as people read them: a magnitude and an angle, each with its interval.

use std::f64::consts::PI;

use crate::numerics::angles::phase;
use crate::report::Estimate;

/// The 97.5 % point of the normal distribution.
const NORMAL: f64 = 1.96;
/// The square root of the 95 % point of χ² with two degrees of freedom.
const BOTH: f64 = 2.448;
/// Points of an ellipse at which its distance from the origin is looked at.
const POINTS: u32 = 720;

/// Magnitude √(c² + s²), and angle atan2(s, c)/`division` in degrees, of parameters with variances and covariance
/// (c, s, both).
///
/// The magnitude's interval is what the profile likelihood allows, the magnitudes within 1.96 deviations in any one direction, and reaches
/// to nothing where both parameters may be nothing. That of the angle is by propagation, at least as far as Fieller's
/// (1954), which has all directions along which the data may lie, and at most all around, as where the magnitude may be nothing.
pub(crate) fn polar([c, s]: [f64; 2], (vc, vs, vcs): (f64, f64, f64), division: f64) -> (Estimate, Estimate) {
    let size = c.hypot(s).max(f64::MIN_POSITIVE);
    let (cos, sin) = (c / size, s / size);
    let along = (cos * cos * vc + sin * sin * vs + 2.0 * cos * sin * vcs).max(0.0);
    let across = (sin * sin * vc + cos * cos * vs - 2.0 * cos * sin * vcs).max(0.0);
    let between = cos * sin * (vs - vc) + (cos * cos - sin * sin) * vcs;
    let turn = across.sqrt() / size;
    // (size tan δ)² ≤ 1.96² (along tan² δ − 2 between tan δ + across) at δ from the angle
    let (bend, slant) = (size * size - NORMAL * NORMAL * along, (NORMAL * NORMAL * between).abs());
    let square = slant * slant + bend * NORMAL * NORMAL * across;
    let farthest = if square >= 0.0 { (slant + square.sqrt()).atan2(bend) } else { PI };
    let reach = farthest.max(NORMAL * turn).min(PI);
    let degrees = |turned: f64| (turned / division).to_degrees();
    let angle =
        Estimate { value: degrees(phase(c, s)), ci95: [degrees(phase(c, s) - reach), degrees(phase(c, s) + reach)] };
    (Estimate { value: c.hypot(s), ci95: magnitudes([c, s], [vc, vs, vcs]) }, angle)
}

/// The least and the largest magnitude that parameters with variances and covariance may have.
fn magnitudes([c, s]: [f64; 2], [vc, vs, vcs]: [f64; 3]) -> [f64; 2] {
    // Cholesky's factor of the covariance
    let first = vc.max(0.0).sqrt();
    let slant = if first > 0.0 { vcs / first } else { 0.0 };
    let rest = (vs - slant * slant).max(0.0).sqrt();
    let nothing_is_likely = {
        let along = c / first.max(f64::MIN_POSITIVE);
        along.hypot((s - slant * along) / rest.max(f64::MIN_POSITIVE)) <= BOTH
    };
    let at = |i: u32| {
        let (sin, cos) = (2.0 * PI * f64::from(i) / f64::from(POINTS)).sin_cos();
        (c + NORMAL * first * cos).hypot(s + NORMAL * (slant * cos + rest * sin))
    };
    let (least, largest) = (0..POINTS).map(at).fold((f64::INFINITY, 0.0_f64), |(l, h), r| (l.min(r), h.max(r)));
    [if nothing_is_likely { 0.0 } else { least }, largest]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_angle_is_less_certain_than_all_around() {
        for deviation in [1e-4, 1e-3, 1.0, 1e3] {
            let (_, angle) = polar([1e-4, -2e-4], (deviation * deviation, 0.3, 0.0), 2.0);
            assert!((angle.ci95[1] - angle.ci95[0] - 180.0).abs() < 1e-9, "{:?}", angle.ci95);
        }
    }

    #[test]
    fn magnitude_and_angle_are_within_their_intervals_where_both_may_be_nothing() {
        // pairs of standard normal numbers, each as likely as the next
        let share = |i: i32| (f64::from(i) + 0.5) / 60.0;
        let pair = |i: i32, j: i32| {
            let ((sin, cos), r) = ((2.0 * PI * share(j)).sin_cos(), (-2.0 * share(i).ln()).sqrt());
            [r * cos, r * sin]
        };
        // known well across one direction and poorly along it, as anisodamping beside a gain ratio at one rate
        let (poor, well, turned) = (3e-4, 1e-5, 0.4f64);
        let (sin, cos) = turned.sin_cos();
        let [vc, vs, vcs] = [
            (poor * cos).powi(2) + (well * sin).powi(2),
            (poor * sin).powi(2) + (well * cos).powi(2),
            (poor * poor - well * well) * sin * cos,
        ];
        for (size, bearing) in [(1e-4, 0.4), (1e-4, 1.2), (1e-4, -2.0), (3e-5, 0.9), (1e-3, 0.4), (5e-3, 2.5)] {
            let planted = [size * f64::cos(bearing), size * f64::sin(bearing)];
            let (mut held, mut sized) = (0_u32, 0_u32);
            for [a, b] in (0..60).flat_map(|i| (0..60).map(move |j| (i, j))).map(|(i, j)| pair(i, j)) {
                let own = [planted[0] + poor * a * cos - well * b * sin, planted[1] + poor * a * sin + well * b * cos];
                let (magnitude, angle) = polar(own, (vc, vs, vcs), 2.0);
                let off = (0.5 * bearing.to_degrees() - angle.value + 90.0).rem_euclid(180.0) - 90.0;
                held += u32::from((angle.ci95[0]..=angle.ci95[1]).contains(&(angle.value + off)));
                sized += u32::from((magnitude.ci95[0]..=magnitude.ci95[1]).contains(&size));
            }
            for share in [held, sized].map(|held| f64::from(held) / 3600.0) {
                assert!(share >= 0.94, "{size} at {bearing}: {share}");
            }
        }
    }
}
