//! What the tests of the simulator share: a plain gyroscope to put effects into, and a least-squares fit of the
//! recorded angle. Small on purpose: it is the yardstick, not an identification.

#![allow(dead_code, reason = "each test file uses its own part")]

use cvg_estimator::{AngleState, PatternAngle, Period};
use cvg_model::Envelope;
use cvg_simulator::{Scenario, SimulatedRun};
use nalgebra::{DMatrix, DVector};

/// k of the tests' device.
pub(crate) const ANGULAR_GAIN: f64 = 0.78;

/// A noiseless gyroscope with the given effects (TOML inside the list) in one rotation run.
pub(crate) fn rotation(effects: &str, rate_dps: f64, duration_s: f64) -> SimulatedRun {
    rotation_with("", effects, rate_dps, duration_s)
}

/// The same with further top-level keys.
pub(crate) fn rotation_with(keys: &str, effects: &str, rate_dps: f64, duration_s: f64) -> SimulatedRun {
    let warm_up = if keys.contains("warm_up_s") { "" } else { "warm_up_s = 3.0\n" };
    let text = format!(
        "device = \"test\"\nangular_gain = {ANGULAR_GAIN}\n{warm_up}{keys}\neffects = [{effects}]\n\
         [[run]]\nkind = \"rotation\"\nfile = \"a.csv\"\nreference = \"both\"\n\
         rate_dps = {rate_dps:?}\nduration_s = {duration_s:?}\nstart_deg = 10.0\n"
    );
    only_run(&text)
}

/// The only run of a scenario's text.
pub(crate) fn only_run(text: &str) -> SimulatedRun {
    let scenario = Scenario::parse(text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    scenario.simulate().runs.into_iter().next().expect("one run")
}

/// A column that has to be there.
pub(crate) fn column<'a>(run: &'a SimulatedRun, name: &str) -> &'a [f64] {
    run.column(name).unwrap_or_else(|| panic!("no column {name}"))
}

/// The envelope of each row; a sensor's has no quadrature.
pub(crate) fn envelopes(run: &SimulatedRun) -> Vec<Envelope<f64>> {
    let (x_c, y_c) = (column(run, "xc_v"), column(run, "yc_v"));
    let zeros = vec![0.0; x_c.len()];
    let (x_s, y_s) = (run.column("xs_v").unwrap_or(&zeros), run.column("ys_v").unwrap_or(&zeros));
    (0..x_c.len()).map(|i| Envelope::new(x_c[i], x_s[i], y_c[i], y_s[i])).collect()
}

/// The unwrapped measured angle, rad.
pub(crate) fn angles(run: &SimulatedRun, period: Period) -> Vec<f64> {
    let tracker = PatternAngle::new(period, 1e-9).expect("valid");
    let mut state = AngleState::default();
    envelopes(run).iter().map(|e| tracker.step(&mut state, e).degrees(period).to_radians()).collect()
}

/// A fitted harmonic.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Harmonic {
    pub(crate) cos: f64,
    pub(crate) sin: f64,
}

impl Harmonic {
    pub(crate) fn amplitude(&self) -> f64 {
        self.cos.hypot(self.sin)
    }
}

/// Fits `y` by a constant, `lines` of further regressors, and harmonics `ns` of `of`; gives the lines' coefficients
/// and the harmonics.
pub(crate) fn fit(y: &[f64], lines: &[&[f64]], of: &[f64], ns: &[f64]) -> (Vec<f64>, Vec<Harmonic>) {
    let columns = 1 + lines.len() + 2 * ns.len();
    let matrix = DMatrix::from_fn(y.len(), columns, |i, j| {
        if j == 0 {
            1.0
        } else if j <= lines.len() {
            lines[j - 1][i]
        } else {
            let h = j - 1 - lines.len();
            let angle = ns[h / 2] * of[i];
            if h.is_multiple_of(2) { angle.cos() } else { angle.sin() }
        }
    });
    let right = DVector::from_row_slice(y);
    let normal = matrix.transpose() * &matrix;
    let solution = normal.cholesky().expect("independent regressors").solve(&(matrix.transpose() * right));
    let harmonics = (0..ns.len())
        .map(|h| Harmonic { cos: solution[1 + lines.len() + 2 * h], sin: solution[2 + lines.len() + 2 * h] });
    (solution.rows(1, lines.len()).iter().copied().collect(), harmonics.collect())
}

/// Harmonics `ns` of the pattern in the measured angle of a rotation run, rad, beside the best line in time.
pub(crate) fn angle_harmonics(run: &SimulatedRun, ns: &[f64]) -> Vec<Harmonic> {
    let theta = angles(run, Period::Pattern);
    fit(&theta, &[column(run, "t_s")], &theta, ns).1
}

pub(crate) fn mdeg(rad: f64) -> f64 {
    1e3 * rad.to_degrees()
}
