//! The demodulator: carriers with an offset made here by sine and cosine, and what it has to say of them.

use approx::assert_abs_diff_eq;
use cvg_estimator::{Demodulator, Measurement, Phasor, Status, Window};
use cvg_model::Envelope;

const FULL_SCALE_V: f64 = 2.0;

fn demodulator(samples: u16) -> Demodulator<f64> {
    Demodulator::new(samples, FULL_SCALE_V).expect("valid")
}

fn at(phase: f64, step: f64) -> Phasor<f64> {
    Phasor { cos: phase.cos(), sin: phase.sin(), step_cos: step.cos(), step_sin: step.sin() }
}

fn carrier(c: f64, s: f64, phase: f64) -> f64 {
    c * phase.cos() + s * phase.sin()
}

/// A window of the carrier of `e` with offsets, from `phase` on.
fn measured(samples: u16, e: &Envelope<f64>, offsets: [f64; 2], phase: f64, step: f64) -> Measurement<f64> {
    let d = demodulator(samples);
    let mut window = Window::begin(&at(phase, step));
    for k in 0..samples {
        let phase = phase + step * f64::from(k);
        let (x, y) = (carrier(e.x_c, e.x_s, phase) + offsets[0], carrier(e.y_c, e.y_s, phase) + offsets[1]);
        assert_eq!(d.accumulate(&mut window, x, y, &at(phase, step)), k + 1 == samples);
    }
    assert_eq!(window.count, u32::from(samples));
    d.finish(&window, &at(phase + step * f64::from(samples), step))
}

#[test]
fn a_carrier_is_its_envelope_whatever_the_window_the_phase_and_the_offset() {
    let envelopes =
        [Envelope::new(0.8, 0.0, 0.0, 0.0), Envelope::new(0.3, -0.6, 0.5, 0.2), Envelope::new(-0.4, 0.1, 0.7, -0.9)];
    for samples in [8, 9, 13, 50, 101] {
        for step in [0.955, 0.7, 1.4, 2.0] {
            for phase in [0.0, 0.6, 1.9, -2.3] {
                for e in &envelopes {
                    for offsets in [[0.0, 0.0], [0.3, -0.2]] {
                        let m = measured(samples, e, offsets, phase, step);
                        assert_eq!(m.status, Status::Valid);
                        let error = (m.envelope - *e).pendulum().e.sqrt();
                        assert!(error < 1e-12, "{samples} samples of {step} rad from {phase}: {:?}", m.envelope);
                    }
                }
            }
        }
    }
}

#[test]
fn the_fingerprint_is_the_sums_and_the_last_samples() {
    let (phase, step) = (0.4, 0.955);
    let sums = (0..8).map(|k| phase + step * f64::from(k)).fold((0.0, 0.0), |sums, phase| {
        (sums.0 + carrier(0.3, -0.6, phase) + 0.1, sums.1 + carrier(0.5, 0.2, phase) - 0.2)
    });
    let m = measured(8, &Envelope::new(0.3, -0.6, 0.5, 0.2), [0.1, -0.2], phase, step);
    let last = phase + 7.0 * step;
    let expected = [sums.0, sums.1, carrier(0.3, -0.6, last) + 0.1, carrier(0.5, 0.2, last) - 0.2];
    for (got, expected) in m.fingerprint.iter().zip(expected) {
        assert_abs_diff_eq!(*got, expected, epsilon = 1e-14);
    }
    assert_eq!((m.invalid, m.clipped), (0, 0));
}

#[test]
fn the_last_samples_are_those_of_the_full_window_only() {
    let (d, p) = (demodulator(8), at(0.0, 0.7));
    let mut window = Window::begin(&p);
    for _ in 0..7 {
        assert!(!d.accumulate(&mut window, 0.5, 0.25, &p));
        assert_eq!(window.last, (0.0, 0.0));
    }
    assert!(d.accumulate(&mut window, 0.75, 0.125, &p));
    assert_eq!(window.last, (0.75, 0.125));
}

#[test]
fn a_window_begins_empty_at_the_phase_of_its_first_sample() {
    let p = at(0.9, 0.7);
    let empty = Window {
        mixed: Envelope::zero(),
        x: 0.0,
        y: 0.0,
        start: (p.cos, p.sin),
        last: (0.0, 0.0),
        count: 0,
        invalid: 0,
        clipped: 0,
    };
    assert_eq!(Window::begin(&p), empty);
}

#[test]
fn an_envelope_is_half_a_window_older_than_its_last_sample() {
    assert_eq!((demodulator(50).samples(), demodulator(50).group_delay_samples()), (50, 24.5));
    // an even change of the amplitude, measured in the middle of 50 samples
    let (d, step) = (demodulator(50), 0.955);
    let mut window = Window::begin(&at(0.3, step));
    for k in 0..50 {
        let phase = 0.3 + step * f64::from(k);
        let amplitude = 1.0 + 1e-6 * f64::from(k);
        d.accumulate(&mut window, amplitude * phase.cos(), 0.0, &at(phase, step));
    }
    let m = d.finish(&window, &at(0.3 + 50.0 * step, step));
    assert_abs_diff_eq!(m.envelope.x_c, 1.0 + 1e-6 * 24.5, epsilon = 1e-6);
}

#[test]
fn a_sample_at_the_end_of_the_range_is_counted_and_one_that_is_no_number_too() {
    let (d, p) = (demodulator(8), at(0.0, 0.7));
    let end = FULL_SCALE_V * (1.0 - 1e-4);
    for inside in [0.0, 1.9997, -1.9997] {
        assert!(d.takes(inside, 0.1) && d.takes(0.1, inside), "{inside}");
    }
    for out in [end, -end, 1.9999, 2.0, -2.0, 9.0, f64::NAN, f64::INFINITY] {
        assert!(!d.takes(out, 0.1) && !d.takes(0.1, out), "{out}");
    }
    // (what comes in, what is added, invalid, clipped)
    let cases = [
        (f64::NAN, 0.0, 1, 0),
        (f64::INFINITY, 0.0, 1, 0),
        (-9.0, -FULL_SCALE_V, 0, 1),
        (9.0, FULL_SCALE_V, 0, 1),
        (end, end, 0, 1),
        (-end, -end, 0, 1),
        // between where clipping begins and the end of the range: as it is
        (1.9999, 1.9999, 0, 1),
        (-1.9999, -1.9999, 0, 1),
        (-FULL_SCALE_V, -FULL_SCALE_V, 0, 1),
        (1.9997, 1.9997, 0, 0),
    ];
    for (v, taken, invalid, clipped) in cases {
        let mut x = Window::begin(&p);
        assert_eq!(d.admit(&mut x, v, 0.25), (taken, 0.25));
        assert_eq!((x.invalid, x.clipped), (invalid, clipped), "{v}");
        let mut both = Window::begin(&p);
        d.accumulate(&mut both, v, v, &p);
        assert_eq!((both.x, both.y), (taken, taken));
        assert_eq!((both.invalid, both.clipped), (2 * invalid, 2 * clipped), "{v}");
    }
}

/// A window of eight samples a quarter period apart, from phase 0 to phase 0: exact in floating point, and each
/// component is a quarter of its sum.
fn quarters(sums: [f64; 4]) -> Measurement<f64> {
    let p = Phasor { cos: 1.0, sin: 0.0, step_cos: 0.0, step_sin: 1.0 };
    let [x_c, x_s, y_c, y_s] = sums;
    let window = Window { mixed: Envelope::new(x_c, x_s, y_c, y_s), count: 8, clipped: 3, ..Window::begin(&p) };
    demodulator(8).finish(&window, &p)
}

#[test]
fn an_envelope_far_out_of_range_is_none() {
    let m = quarters([1.0, 2.0, 3.0, 4.0]);
    assert_eq!((m.envelope, m.status, m.clipped), (Envelope::new(0.25, 0.5, 0.75, 1.0), Status::Valid, 3));
    // magnitudes of 16 V in sum: eight times the range
    for pair in [[0, 1], [1, 2], [2, 3]] {
        for sign in [1.0, -1.0] {
            let sums = |second| {
                let mut sums = [0.0; 4];
                (sums[pair[0]], sums[pair[1]]) = (sign * 63.0, second);
                sums
            };
            assert_eq!(quarters(sums(0.5)).status, Status::Valid);
            assert_eq!(quarters(sums(-0.5)).status, Status::Valid);
            for second in [1.0, -1.0, 2.0, f64::NAN] {
                let m = quarters(sums(second));
                assert_eq!((m.envelope, m.status), (Envelope::zero(), Status::Invalid), "{pair:?} {second}");
            }
        }
    }
}

#[test]
fn a_window_with_a_sample_that_is_no_number_has_no_envelope() {
    let (d, p) = (demodulator(8), Phasor { cos: 1.0, sin: 0.0, step_cos: 0.0, step_sin: 1.0 });
    let mut window = Window::begin(&p);
    for k in 0..8 {
        d.accumulate(&mut window, if k == 3 { f64::NAN } else { 0.5 }, 0.25, &p);
    }
    let m = d.finish(&window, &p);
    assert_eq!((m.envelope, m.status, m.invalid, m.clipped), (Envelope::zero(), Status::Invalid, 1, 0));
    assert_eq!(m.fingerprint, [3.5, 2.0, 0.5, 0.25]);
}

#[test]
fn parameters_outside_their_domain_are_refused_by_name() {
    let new =
        |samples, full_scale_v| Demodulator::<f32>::new(samples, full_scale_v).map(|_| ()).map_err(|e| e.parameter);
    for (samples, expected) in [(7, Err("samples")), (8, Ok(())), (10_000, Ok(())), (10_001, Err("samples"))] {
        assert_eq!(new(samples, 1.0), expected, "{samples}");
    }
    for bad in [0.0, 1e-9, 1e9, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(new(8, bad), Err("full_scale_v"), "{bad}");
    }
    assert_eq!((new(8, 1.1e-9), new(8, 0.9e9)), (Ok(()), Ok(())));
}

#[test]
fn a_window_whose_count_is_beyond_its_end_is_full() {
    let (d, p) = (demodulator(8), Phasor { cos: 1.0, sin: 0.0, step_cos: 0.0, step_sin: 1.0 });
    for (count, full) in [(6, false), (7, true), (8, true), (9, true), (u32::MAX - 1, true), (u32::MAX, false)] {
        let mut window = Window { count, ..Window::begin(&p) };
        assert_eq!(d.accumulate(&mut window, 0.5, 0.25, &p), full, "{count}");
    }
}

#[test]
fn samples_that_are_none_or_clipped_are_counted_to_the_end_of_the_count_and_stay_there() {
    let (d, p) = (demodulator(8), Phasor { cos: 1.0, sin: 0.0, step_cos: 0.0, step_sin: 1.0 });
    let mut window = Window { invalid: u16::MAX - 1, clipped: u16::MAX - 1, ..Window::begin(&p) };
    for _ in 0..3 {
        d.admit(&mut window, f64::NAN, FULL_SCALE_V);
        assert_eq!((window.invalid, window.clipped), (u16::MAX, u16::MAX));
    }
}
