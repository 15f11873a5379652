//! Every effect in single precision is that in double precision, rounded: in every quadrant, at every strength, read,
//! undone and moved.

use core::f64::consts::PI;

use cvg_model::effects::{EffectId, Moment, Stage, Values};
use cvg_model::{AxisForces, Envelope, Orbit};

/// Strong but reasonable, of both signs, and none.
fn values(id: EffectId) -> Vec<Values<f64>> {
    let all: &[[f64; 4]] = match id {
        EffectId::TableHarmonic => &[[1.0, 0.1, 0.2, 0.0], [2.5, -0.1, 0.05, 0.0]],
        EffectId::ActuationGainMismatch | EffectId::DetectionGainMismatch => {
            &[[0.2, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [5.0, 0.0, 0.0, 0.0]]
        }
        EffectId::HarmonicN => &[
            [1.0, 0.01, -0.02, 0.0],
            [2.0, -0.01, 0.02, 1.0],
            [4.0, 0.01, 0.02, 2.0],
            [8.0, 1e-3, -2e-3, 3.0],
            [0.0, 0.1, 0.0, 1.0],
        ],
        EffectId::TimePeriodic => &[[0.37, 0.2, 0.1, 0.0], [1.5, -0.1, 0.3, 0.0]],
        EffectId::DetectionCubic => &[
            [0.0; 4],
            [1e-3, 5e-4, 0.0, 0.0],
            [0.08, 0.02, 0.0, 0.0],
            [-0.08, 0.03, 0.0, 0.0],
            [0.02, -0.06, 0.0, 0.0],
        ],
        EffectId::CubicTemperature => &[[0.0; 4], [1e-3, 0.0, 0.0, 0.0], [-0.01, 0.0, 0.0, 0.0]],
        EffectId::DriveFeedthrough => &[[0.3, -0.2, -0.1, 0.4], [0.0, 0.0, 0.2, -0.3]],
        EffectId::DetectionSaturation | EffectId::DriveSaturation => {
            &[[0.0; 4], [0.5, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [1.3, 0.0, 0.0, 0.0]]
        }
        _ => &[[0.0; 4], [0.3, -0.2, 0.0, 0.0], [-0.1, 0.4, 0.0, 0.0]],
    };
    all.to_vec()
}

fn vibrations() -> impl Iterator<Item = Envelope<f64>> {
    (-24..24).flat_map(|k| {
        let theta = f64::from(k) * PI / 24.0;
        [(1.0, 0.0, 0.0), (0.6, 0.1, 0.3), (0.9, -0.2, -0.2)]
            .map(|(a, q, delta)| Orbit { a, q, theta, delta }.envelope())
    })
}

fn single(e: &Envelope<f64>) -> Envelope<f32> {
    Envelope::new(e.x_c as f32, e.x_s as f32, e.y_c as f32, e.y_s as f32)
}

fn double(e: &Envelope<f32>) -> Envelope<f64> {
    Envelope::new(e.x_c.into(), e.x_s.into(), e.y_c.into(), e.y_s.into())
}

#[track_caller]
fn near(got: &Envelope<f32>, expected: &Envelope<f64>, what: &str) {
    let gap = (double(got) - *expected).pendulum().e.sqrt();
    // sixteen places of single precision
    assert!(gap < 2e-6 * (1.0 + expected.pendulum().e.sqrt()), "{what}: {got:?} and not {expected:?}");
}

fn moments() -> [Moment<f64>; 3] {
    [(2.5, 0.5, -0.5), (0.0, -1.5, 0.25), (8.0, 3.0, 0.0)].map(|(t_s, table_rad, precession_rad_s)| Moment {
        t_s,
        table_rad,
        precession_rad_s,
        warmer_k: t_s,
        drive: AxisForces { x_c: 0.25, x_s: -0.5, y_c: 0.125, y_s: 0.75 },
    })
}

#[test]
fn what_is_read_and_undone_is_that_of_double_precision() {
    for &id in EffectId::ALL.iter().filter(|id| id.description().stage == Stage::Readout) {
        for values in values(id) {
            let in_single = values.map(|v| v as f32);
            let values = in_single.map(f64::from);
            for at in moments() {
                let now = at.map(|v| v as f32);
                for e in vibrations() {
                    let e = double(&single(&e));
                    let read = id.read(&values, e, &at);
                    let what = format!("{id} {values:?} {at:?} of {e:?}");
                    near(&id.read(&in_single, single(&e), &now), &read, &what);
                    let seen = double(&single(&read));
                    let back = id.unread(&values, seen, &at);
                    // a carrier that is clipped hard tells little of its amplitude
                    let clipped = id == EffectId::DetectionSaturation && values[0] >= 1.3;
                    if !clipped {
                        near(&id.unread(&in_single, single(&read), &now), &back, &what);
                        assert!((back - e).pendulum().e.sqrt() < 1e-5, "{what}: {back:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn what_is_moved_pushed_and_turned_is_that_of_double_precision() {
    for &id in EffectId::ALL {
        for values in values(id) {
            let in_single = values.map(|v| v as f32);
            let values = in_single.map(f64::from);
            for e in vibrations() {
                let e = double(&single(&e));
                let at = moments()[0];
                let now = at.map(|v| v as f32);
                near(
                    &id.mechanics(&in_single, &single(&e), &now),
                    &id.mechanics(&values, &e, &at),
                    id.description().id,
                );
                let f = |e: &Envelope<f64>| AxisForces { x_c: e.x_c, x_s: e.x_s, y_c: e.y_c, y_s: e.y_s };
                let s = single(&e);
                let got = id.actuate(&in_single, AxisForces { x_c: s.x_c, x_s: s.x_s, y_c: s.y_c, y_s: s.y_s }, &now);
                let pushed = id.actuate(&values, f(&e), &at);
                near(
                    &Envelope::new(got.x_c, got.x_s, got.y_c, got.y_s),
                    &Envelope::new(pushed.x_c, pushed.x_s, pushed.y_c, pushed.y_s),
                    id.description().id,
                );
            }
            for at in moments() {
                for rate in [3.0, -0.5, 0.0] {
                    let now = at.map(|v| v as f32);
                    let got = id.input_rate(&in_single, rate as f32, &now);
                    let expected = id.input_rate(&values, rate, &at);
                    assert!((f64::from(got) - expected).abs() < 2e-6 * (1.0 + expected.abs()), "{id}: {got}");
                }
            }
        }
    }
}

/// What is no number in one channel is none in what comes out of it, whatever undoes it.
#[test]
fn no_number_stays_none() {
    let at = moments()[0];
    for &id in EffectId::ALL.iter().filter(|id| id.description().stage == Stage::Readout) {
        for values in values(id) {
            for channel in 0..4 {
                for none in [f64::NAN, f64::INFINITY] {
                    let mut v = [0.6, 0.1, -0.7, 0.2];
                    v[channel] = none;
                    let e = Envelope::new(v[0], v[1], v[2], v[3]);
                    for z in [id.unread(&values, e, &at), id.read(&values, e, &at)] {
                        let out = [z.x_c, z.x_s, z.y_c, z.y_s];
                        assert!(!out[channel].is_finite() || id == EffectId::HarmonicN, "{id} {values:?}: {z:?}");
                        assert!(!z.pendulum().e.is_finite(), "{id} {values:?}: {z:?}");
                    }
                }
            }
        }
    }
}
