//! What is commanded: where, in which phase and how much.

use core::f64::consts::PI;

use cvg_instrument::{Instrument, Mode, RequestedMode, Settings};
use cvg_model::effects::{EffectId, Values};
use cvg_model::{Envelope, Float};

use super::Bench;

/// The force over a window, as amplitudes along and across the pattern and in phase with it and in quadrature, V: at the
/// moments when the outputs act. The last is what is left beside the four.
fn force<T: Float>(bench: &mut Bench<T>) -> [f64; 4] {
    let s = bench.settings;
    // the middle of the output's hold
    let later = s.drive_delay_s + 0.5 / s.sample_hz;
    let mut sums = [0.0; 4];
    let count = 50 * u32::from(s.window);
    for _ in 0..count {
        let taken = bench.time_s();
        bench.sample_through(|v| v);
        let (sin, cos) = bench.theta(taken + later).sin_cos();
        let (quadrature, phase) = bench.phase(taken + later).sin_cos();
        let [x, y] = bench.out;
        let (along, across) = (x * cos + y * sin, y * cos - x * sin);
        for (sum, v) in sums.iter_mut().zip([along * phase, along * quadrature, across * phase, across * quadrature]) {
            *sum += 2.0 * v / f64::from(count);
        }
    }
    sums
}

fn energy_acts_along_the_pattern<T: Float>() {
    // in each quadrant, on an axis and exactly at 135 degrees
    for theta in [0.0, 0.4, PI / 4.0, 1.2, PI / 2.0, 2.0, 0.75 * PI, 2.8, -0.4, -PI / 4.0, -1.2, -2.8] {
        for rate in [0.0, 5.0, -5.0] {
            let mut bench = Bench::<T>::running(theta, rate);
            bench.state.energy = cvg_controller::PiState::default();
            bench.amplitude_v = 1.02;
            bench.windows(20);
            let before = bench.state.seen.v_as.to_f64();
            let [along_c, along_s, across_c, across_s] = force(&mut bench);
            let v_as = 0.5 * (before + bench.state.seen.v_as.to_f64());
            // too large: taken out, along the pattern and in quadrature
            assert!(v_as > 0.3, "{v_as}");
            assert!((along_s.abs() - v_as).abs() < 0.02 * v_as, "{theta} {rate}: {along_s} and {v_as} V");
            // 0.2 degrees of phase and of direction
            for left in [along_c, across_c, across_s] {
                assert!(left.abs() < 4e-3 * v_as, "{theta} {rate}: {along_c} {across_c} {across_s} of {v_as} V");
            }
        }
    }
}

fn what_is_commanded_is_what_acts<T: Float>() {
    for theta in [0.3, 1.9, -0.3, -1.9] {
        let mut bench = Bench::<T>::running(theta, 0.0);
        bench.windows(1);
        let set = bench.instrument;
        // a command of the quadrature loop: across, in phase
        bench.state.energy = cvg_controller::PiState::default();
        bench.state.quadrature.integral = T::ratio(1, 10);
        bench.windows(1);
        let [along_c, _, across_c, across_s] = force(&mut bench);
        let v_qc = bench.state.seen.v_qc.to_f64();
        assert!(v_qc.abs() > 0.05 && set == bench.instrument, "{v_qc}");
        // the electronics take the pattern for one that lies there, or half a turn on
        let direction = (bench.state.seen.compensated.x_c.to_f64() * theta.cos()).signum();
        assert!((direction * across_c - v_qc).abs() < 0.05 * v_qc.abs(), "{theta}: {across_c} and {v_qc}");
        assert!(along_c.abs() < 0.01 * v_qc.abs() && across_s.abs() < 0.01 * v_qc.abs(), "{along_c} {across_s}");
    }
}

/// Factors of the feed-through of X and Y.
const FED: &[(EffectId, Values<f64>)] = &[(EffectId::DriveFeedthrough, [0.03, -0.02, -0.01, 0.05])];

fn what_the_drives_feed_through_is_taken_out_of_the_readout<T: Float>() {
    // nominal, and so far beside it that the drives turn by 0.22 rad more in a delay of ten samples
    for (off_hz, drive_delay_s) in [(0.0, 5e-6), (340.0, 1e-4), (-340.0, 1e-4)] {
        for theta in [0.3, 1.9, -0.3, -1.9] {
            feed_through_is_taken_out::<T>(theta, off_hz, drive_delay_s);
        }
    }
}

fn feed_through_is_taken_out<T: Float>(theta: f64, off_hz: f64, drive_delay_s: f64) {
    let settings = Settings { drive_delay_s, ..Settings::default() };
    let mut bench = Bench::<T>::with(settings);
    bench.settings.carrier_hz += off_hz;
    bench.start(theta, 0.0);
    bench.instrument = Instrument::new(&Settings { readout: FED, ..settings }).expect("inside its domain");
    bench.state.energy = cvg_controller::PiState::default();
    bench.state.quadrature.integral = T::ratio(1, 10);
    bench.amplitude_v = 1.02;
    bench.windows(1);
    // what acts while the next window is read, in Equation 9's frame
    let commands = bench.state.seen;
    let (v_as, v_qc) = (commands.v_as.to_f64(), commands.v_qc.to_f64());
    assert!(v_as > 0.05 && v_qc.abs() > 0.05, "{v_as} {v_qc}");
    bench.windows(1);
    let seen = bench.state.seen;
    // the electronics take the pattern for one that lies there, or half a turn on
    let direction = (seen.compensated.x_c.to_f64() * theta.cos()).signum();
    let (sin, cos) = (direction * theta.sin(), direction * theta.cos());
    let [f_xc, f_xs, f_yc, f_ys] = [-v_qc * sin, v_as * cos, v_qc * cos, v_as * sin];
    let [x_re, x_im, y_re, y_im] = FED[0].1;
    let fed = Envelope::new(
        x_re * f_xc + x_im * f_xs,
        x_re * f_xs - x_im * f_xc,
        y_re * f_yc + y_im * f_ys,
        y_re * f_ys - y_im * f_yc,
    );
    let (r, c) = (seen.readout, seen.compensated);
    let taken = [(r.x_c, c.x_c), (r.x_s, c.x_s), (r.y_c, c.y_c), (r.y_s, c.y_s)].map(|(r, c)| (r - c).to_f64());
    for (taken, fed) in taken.into_iter().zip([fed.x_c, fed.x_s, fed.y_c, fed.y_s]) {
        assert!((taken - fed).abs() < 1e-4, "{theta}: {taken} of {fed}");
    }
}

fn a_hold_integrates<T: Float>() {
    for (theta, sense) in [(0.01, 1.0), (-0.01, -1.0)] {
        let mut bench = Bench::<T>::with(Settings::default());
        bench.state.request(RequestedMode::Hold);
        bench.start(theta, 0.0);
        assert_eq!(bench.status.mode, Mode::Hold);
        let first = bench.state.seen.v_qs.to_f64();
        bench.windows(200);
        let second = bench.state.seen.v_qs.to_f64();
        bench.windows(200);
        let third = bench.state.seen.v_qs.to_f64();
        assert!(first * sense > 0.0, "{first}");
        // K/2τ·ε a second, 0.1 s apart
        let (more, again) = (second - first, third - second);
        assert!(more * sense > 0.0 && (again / more - 1.0).abs() < 0.05, "{first} {second} {third}");
    }
}

fn a_detuning_is_found<T: Float>() {
    for off_hz in [40.0, -40.0] {
        let mut settings = Settings::default();
        settings.carrier_hz += off_hz;
        let mut bench = Bench::<T>::with(Settings::default());
        bench.settings = settings;
        bench.start(0.4, 0.0);
        bench.windows(400);
        let found = bench.state.seen.correction_rad_s.to_f64() / (2.0 * PI);
        assert!((found - off_hz).abs() < 0.05, "{found} Hz");
        let kept = bench.state.lock.detuning_rad_s.to_f64() / (2.0 * PI);
        assert!((kept - off_hz).abs() < 0.05, "{kept} Hz");
        let [along_c, along_s, ..] = {
            bench.state.energy = cvg_controller::PiState::default();
            bench.amplitude_v = 1.02;
            bench.windows(20);
            force(&mut bench)
        };
        // the phase of the drive knows the detuning
        assert!(along_c.abs() < 4e-3 * along_s.abs(), "{along_c} {along_s}");
    }
}

in_both_precisions! {
    the_energy_loop_acts_along_the_pattern_and_in_quadrature energy_acts_along_the_pattern;
    the_quadrature_loop_acts_across_the_pattern_and_in_phase what_is_commanded_is_what_acts;
    a_pattern_beside_its_heading_is_pushed_more_and_more a_hold_integrates;
    a_resonance_beside_its_nominal_frequency_is_found a_detuning_is_found;
    the_drives_are_taken_out_of_the_readout what_the_drives_feed_through_is_taken_out_of_the_readout;
}

#[test]
fn outputs_have_their_limit_on_each_channel() {
    for theta in [0.0, PI / 2.0] {
        for (x_s, y_s, expected) in [(1e9, -1e9, [10.0; 2]), (0.0, 1e9, [0.0, 10.0]), (-1e9, 0.0, [10.0, 0.0])] {
            let mut bench = Bench::<f32>::running(theta, 0.0);
            // the middle of a window, so that no control step takes it back
            bench.state.drive = cvg_model::AxisForces { x_c: 0.0, x_s, y_c: 0.0, y_s };
            let mut most = [0.0_f64; 2];
            for _ in 0..40 {
                bench.sample_through(|v| v);
                most = [0, 1].map(|k| most[k].max(bench.out[k].abs()));
            }
            assert_eq!(most, expected);
        }
    }
}
