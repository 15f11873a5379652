//! Where the fit of a readout begins: the ellipse that two channels draw, found without a reference, or the regression of
//! the channels on the sine and cosine of the reference.

use nalgebra::{Matrix2, Vector2};

use super::readout::Readout;
use super::samples::SensorRun;
use crate::facts::LARGEST_RATIO_OF_A_SENSOR;
use crate::numerics::linear::NormalEquations;

/// The algebraic ellipse through the points of all runs: a x² + b xy + c y² + d x + e y = 1 by least squares.
pub(crate) fn algebraic(runs: &[SensorRun]) -> Option<Readout> {
    through(runs.iter().filter_map(SensorRun::channels).flatten())
}

/// … and through these points.
pub(super) fn through<'a>(points: impl Iterator<Item = &'a [f64; 2]> + Clone) -> Option<Readout> {
    let count = points.clone().count() as f64;
    if count < 6.0 {
        return None;
    }
    let mean = [0, 1].map(|c| points.clone().map(|z| z[c]).sum::<f64>() / count);
    let variance: f64 =
        points.clone().map(|z| (z[0] - mean[0]).powi(2) + (z[1] - mean[1]).powi(2)).sum::<f64>() / count;
    let size = variance.sqrt();
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    let mut equations = NormalEquations::new(5);
    for z in points {
        let (x, y) = ((z[0] - mean[0]) / size, (z[1] - mean[1]) / size);
        equations.add(&[x * x, x * y, y * y, x, y], 1.0);
    }
    let c = equations.solve();
    let form = Matrix2::new(c[0], 0.5 * c[1], 0.5 * c[1], c[2]);
    if form.symmetric_eigenvalues().min() <= 0.0 {
        return None;
    }
    let inverse = form.try_inverse()?;
    let centre = inverse * Vector2::new(c[3], c[4]) * -0.5;
    let second = inverse * (1.0 + centre.dot(&(form * centre)));
    from_second_moments([mean[0] + size * centre.x, mean[1] + size * centre.y], size, &second)
}

/// Gain of Y over X by the ellipse of one run.
pub(crate) fn gain_ratio(run: &SensorRun) -> Option<f64> {
    algebraic(std::slice::from_ref(run)).map(|readout| readout.p[2].exp())
}

/// The channels regressed on cosine and sine of the reference in the run that turns the furthest.
pub(crate) fn by_reference(runs: &[SensorRun], harmonic_gain: f64) -> Option<Readout> {
    let turned = |r: &SensorRun| r.travel_rad() * harmonic_gain.abs();
    let longest = runs.iter().filter(|r| r.channels().is_some()).max_by(|a, b| turned(a).total_cmp(&turned(b)))?;
    if turned(longest) < std::f64::consts::PI {
        return None;
    }
    let mut equations = [NormalEquations::new(3), NormalEquations::new(3)];
    for (z, a) in longest.channels()?.iter().zip(&longest.reference_rad) {
        let (sin, cos) = (harmonic_gain * a).sin_cos();
        for (e, value) in equations.iter_mut().zip(z) {
            e.add(&[1.0, cos, sin], *value);
        }
    }
    let [x, y] = equations.map(|e| e.solve());
    let axes = Matrix2::new(x[1], x[2], y[1], y[2]);
    from_second_moments([x[0], y[0]], 1.0, &(axes * axes.transpose()))
}

/// The readout whose ellipse has this centre and these second moments (of a unit circle seen through it, times two),
/// the moments in units of `size` squared.
fn from_second_moments(centre: [f64; 2], size: f64, second: &Matrix2<f64>) -> Option<Readout> {
    let (xx, xy, yy) = (second[(0, 0)], second[(0, 1)], second[(1, 1)]);
    let eigen = second.symmetric_eigenvalues();
    if !(eigen.min() > 0.0 && xx > 0.0) || (eigen.max() / eigen.min()).sqrt() > LARGEST_RATIO_OF_A_SENSOR {
        return None;
    }
    // y = g (sin + s cos): yy/xx = g²(1 + s²), xy/xx = g s
    let gain = ((yy / xx) - (xy / xx).powi(2)).max(0.0).sqrt();
    (gain > 0.0).then(|| Readout::affine(centre, size * xx.sqrt(), gain, (xy / xx) / gain))
}
