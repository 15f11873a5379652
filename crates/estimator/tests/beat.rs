//! The beat: the angle of the sum of X_k X̄_{k−1} + Y_k Ȳ_{k−1}, in complex numbers written out here.

use approx::assert_abs_diff_eq;
use cvg_estimator::Beat;
use cvg_estimator::beat::phase_ahead;
use cvg_model::{Envelope, Orbit};

/// X = x_c − i x_s and Y likewise.
fn phasors(e: &Envelope<f64>) -> [(f64, f64); 2] {
    [(e.x_c, -e.x_s), (e.y_c, -e.y_s)]
}

/// a·b̄
fn times_conjugate((a, b): (f64, f64), (c, d): (f64, f64)) -> (f64, f64) {
    (a * c + b * d, b * c - a * d)
}

fn beat_of(windows: &[Envelope<f64>]) -> Beat<f64> {
    let mut beat = Beat::default();
    for e in windows {
        beat.add(e);
    }
    beat
}

#[test]
fn it_is_the_angle_of_the_sum_over_both_channels() {
    let all = [
        Envelope::new(1.3, -0.4, 0.7, 0.2),
        Envelope::new(0.9, 0.5, -0.3, 0.8),
        Envelope::new(-0.2, 1.1, 0.6, -0.5),
        Envelope::new(0.4, 0.3, 1.7, 0.9),
        Envelope::new(-1.2, -0.8, 0.1, 1.4),
    ];
    for from in 0..3 {
        for to in from + 2..=all.len() {
            let windows = &all[from..to];
            let sum = windows.windows(2).fold((0.0, 0.0), |sum, pair| {
                let [x_0, y_0] = phasors(&pair[0]);
                let [x_1, y_1] = phasors(&pair[1]);
                let (x, y) = (times_conjugate(x_1, x_0), times_conjugate(y_1, y_0));
                (sum.0 + x.0 + y.0, sum.1 + x.1 + y.1)
            });
            let beat = beat_of(windows);
            assert_abs_diff_eq!(beat.radians_per_window(), sum.1.atan2(sum.0), epsilon = 1e-14);
            let [x2, y2] = [0, 1].map(|channel| {
                windows.iter().map(|e| phasors(e)[channel]).map(|(re, im)| re * re + im * im).sum::<f64>()
            });
            assert_abs_diff_eq!(beat.powers().0, x2, epsilon = 1e-14);
            assert_abs_diff_eq!(beat.powers().1, y2, epsilon = 1e-14);
            assert_eq!(beat.windows() as usize, windows.len());
        }
    }
}

#[test]
fn a_vibration_ahead_of_the_reference_turns_by_its_detuning() {
    for per_window in [-3.0, -1.0, -1e-3, 0.0, 0.2, 1.7, 3.1] {
        for (a, q) in [(1.0, 0.0), (0.6, 0.3), (0.8, -0.8)] {
            let windows: Vec<_> =
                (0..9).map(|k| Orbit { a, q, theta: 0.7, delta: 0.4 + per_window * f64::from(k) }.envelope()).collect();
            assert_abs_diff_eq!(beat_of(&windows).radians_per_window(), per_window, epsilon = 1e-12);
        }
    }
}

#[test]
fn nothing_is_known_from_less_than_two_windows_or_from_no_number() {
    let e = Envelope::new(0.3, 0.9, -0.4, 0.2);
    assert_eq!(beat_of(&[]).radians_per_window(), 0.0);
    assert_eq!(beat_of(&[e]).radians_per_window(), 0.0);
    assert_eq!((beat_of(&[]).windows(), beat_of(&[e]).windows()), (0, 1));
    assert_eq!(beat_of(&[e, Envelope::new(f64::NAN, 0.0, 0.0, 0.0)]).radians_per_window(), 0.0);
}

#[test]
fn the_phase_ahead_is_that_of_the_orbit_in_every_quadrant() {
    for theta in [0.0, 0.7, 1.5, 2.4, -0.6] {
        for (a, q) in [(1.0, 0.0), (0.6, 0.3), (0.8, -0.5)] {
            for delta in [-1.5, -0.9, -0.2, 0.0, 0.4, 1.1, 1.57_f64] {
                let (cos, sin) = phase_ahead(&Orbit { a, q, theta, delta }.envelope());
                assert_abs_diff_eq!(cos, delta.cos(), epsilon = 1e-14);
                assert_abs_diff_eq!(sin, delta.sin(), epsilon = 1e-14);
            }
        }
    }
}

#[test]
fn the_phase_of_nothing_or_of_no_number_is_none() {
    let nan = f64::NAN;
    assert_eq!(phase_ahead(&Envelope::<f64>::zero()), (1.0, 0.0));
    for e in
        [[nan, 0.1, 0.2, 0.3], [0.1, nan, 0.2, 0.3], [0.1, 0.2, nan, 0.3], [0.1, 0.2, 0.3, nan], [1e200, 0.0, 0.0, 0.0]]
    {
        let [x_c, x_s, y_c, y_s] = e;
        assert_eq!(phase_ahead(&Envelope::new(x_c, x_s, y_c, y_s)), (1.0, 0.0), "{e:?}");
    }
}
