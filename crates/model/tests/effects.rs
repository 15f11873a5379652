//! Each effect by its definition, at one vibration with in-phase and quadrature parts in both channels, and undone.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use approx::assert_abs_diff_eq;
use cvg_model::effects::harmonic_n::factor;
use cvg_model::effects::{Description, EffectId, Inverse, Moment, Role, Search, Stage, Values};
use cvg_model::{AxisForces, Envelope, Orbit};

const VIBRATION: Envelope<f64> = Envelope { x_c: 0.6, x_s: -0.2, y_c: 0.5, y_s: 0.3 };

fn now() -> Moment<f64> {
    let drive = AxisForces { x_c: 0.3, x_s: -0.2, y_c: 0.1, y_s: 0.4 };
    Moment { t_s: 2.5, table_rad: 0.7, precession_rad_s: -0.4, warmer_k: 5.0, drive }
}

#[track_caller]
fn assert_near(got: Envelope<f64>, expected: Envelope<f64>) {
    let error = (got - expected).pendulum().e.sqrt();
    assert!(error < 1e-14, "{got:?} and not {expected:?}");
}

/// The readout is as defined, and undone to within `left`.
#[track_caller]
fn reads(id: EffectId, values: Values<f64>, expected: Envelope<f64>, left: f64) {
    let read = id.read(&values, VIBRATION, &now());
    assert_near(read, expected);
    let back = id.unread(&values, read, &now());
    assert!((back - VIBRATION).pendulum().e.sqrt() <= left, "{id}: {back:?}");
}

/// What follows a recording's clock or its thermometer says so, and nothing else does: the electronics refuse what says so.
#[test]
fn what_follows_the_time_or_the_temperature_says_so() {
    for &id in EffectId::ALL {
        let mut values = id.neutral::<f64>();
        for (v, p) in values.iter_mut().zip(id.description().parameters) {
            *v += 3.0 * p.scale;
        }
        let follows = |other: Moment<f64>| {
            id.read(&values, VIBRATION, &now()) != id.read(&values, VIBRATION, &other)
                || id.input_rate(&values, 0.5, &now()) != id.input_rate(&values, 0.5, &other)
                || id.mechanics(&values, &VIBRATION, &now()) != id.mechanics(&values, &VIBRATION, &other)
                || id.actuate(&values, now().drive, &now()) != id.actuate(&values, now().drive, &other)
        };
        assert_eq!(id.in_time(), follows(Moment { t_s: 4.0, ..now() }), "{id}");
        assert_eq!(id.by_temperature(), follows(Moment { warmer_k: -3.0, ..now() }), "{id}");
    }
}

/// Another scalar's moment is the same moment.
#[test]
fn a_moment_is_mapped_number_by_number() {
    let mapped = now().map(|v| 2.0 * v);
    let drive = AxisForces { x_c: 0.6, x_s: -0.4, y_c: 0.2, y_s: 0.8 };
    assert_eq!(mapped, Moment { t_s: 5.0, table_rad: 1.4, precession_rad_s: -0.8, warmer_k: 10.0, drive });
}

#[test]
fn drives_act_on_both_phases_alike() {
    let f = AxisForces { x_c: 0.5, x_s: -2.0, y_c: 3.0, y_s: 0.25 };
    // gains of 2 and ½
    let uneven = EffectId::ActuationGainMismatch.actuate(&[4.0, 0.0, 0.0, 0.0], f, &now());
    assert_eq!(uneven, AxisForces { x_c: 1.0, x_s: -4.0, y_c: 1.5, y_s: 0.125 });
    let skewed = EffectId::ActuationSkew.actuate(&[0.5, 0.0, 0.0, 0.0], f, &now());
    assert_eq!(skewed, AxisForces { x_c: 0.5, x_s: -2.0, y_c: 3.25, y_s: -0.75 });
    // a quarter of a turn: F_s + iF_c becomes −F_c + iF_s
    let late = EffectId::ActuationPhase.actuate(&[core::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0], f, &now());
    for (got, expected) in [(late.x_c, -2.0), (late.x_s, -0.5), (late.y_c, 0.25), (late.y_s, -3.0)] {
        assert!((got - expected).abs() < 1e-15, "{late:?}");
    }
    assert_eq!(EffectId::DetectionSkew.actuate(&[0.5, 0.0, 0.0, 0.0], f, &now()), f, "a readout makes no forces");
}

#[test]
fn linear_readouts_are_their_matrices_and_offsets() {
    let Envelope { x_c, x_s, y_c, y_s } = VIBRATION;
    let gain = |g: f64| Envelope::new(x_c, x_s, g * y_c, g * y_s);
    reads(EffectId::DetectionGainMismatch, [1.25, 0.0, 0.0, 0.0], gain(1.25), 1e-15);
    // 1 + 0.1 · 2.5 s
    reads(EffectId::GainDrift, [0.1, 0.0, 0.0, 0.0], gain(1.25), 1e-15);
    // 1 + 0.05/K · 5 K
    reads(EffectId::Temperature, [0.05, 0.0, 0.0, 0.0], gain(1.25), 1e-15);
    let skewed = Envelope::new(x_c, x_s, y_c + 0.5 * x_c, y_s + 0.5 * x_s);
    reads(EffectId::DetectionSkew, [0.5, 0.0, 0.0, 0.0], skewed, 1e-15);
    // 0.1/K · 5 K
    reads(EffectId::SkewTemperature, [0.1, 0.0, 0.0, 0.0], skewed, 1e-15);
    let offset = Envelope::new(x_c + 0.1, x_s, y_c - 0.3, y_s);
    reads(EffectId::DetectionOffset, [0.1, -0.3, 0.0, 0.0], offset, 1e-15);
}

#[test]
fn a_cubic_readout_grows_with_the_square_of_each_channel() {
    let Envelope { x_c, x_s, y_c, y_s } = VIBRATION;
    // κ ± δκ, |X|² = 0.4 and |Y|² = 0.34
    let (x, y) = (1.0 + 0.75 * 0.25 * 0.4, 1.0 + 0.75 * 0.15 * 0.34);
    let cubed = Envelope::new(x * x_c, x * x_s, y * y_c, y * y_s);
    reads(EffectId::DetectionCubic, [0.2, 0.05, 0.0, 0.0], cubed, 1e-9);
    // a readout that bends the other way, at its limit of a tenth
    let back = |kappa: f64, a: f64| {
        let e = Envelope::new(a, 0.0, 0.0, a);
        let v = [kappa, 0.0, 0.0, 0.0];
        (EffectId::DetectionCubic.unread(&v, EffectId::DetectionCubic.read(&v, e, &now()), &now()) - e)
            .pendulum()
            .e
            .sqrt()
    };
    assert!(back(-0.1, 1.0) < 1e-12 && back(0.12, 1.0) < 1e-13 && back(-0.02, 2.0) < 1e-12);
    // strong ones take more than one step and are still found
    assert!(back(1.0, 1.0) < 2e-4, "{}", back(1.0, 1.0));
    // where no vibration gives the readout the answer is finite
    let beyond = EffectId::DetectionCubic.unread(&[-1e3, 0.0, 0.0, 0.0], VIBRATION, &now());
    assert!(beyond.pendulum().e.is_finite());
    // past the turning point, here with ¾κm² = −0.3, Newton's first step stays: (1 − 0.9 + 0.3)/(1 − 0.9)
    let past = EffectId::DetectionCubic.unread(&[-0.4, 0.0, 0.0, 0.0], Envelope::new(1.0, 0.0, 0.0, 0.0), &now());
    assert_near(past, Envelope::new(4.0, 0.0, 0.0, 0.0));
    // and where even that would divide by zero, at −1/3, the readout stays
    let along_x = Envelope::new(1.0, 0.0, 0.0, 0.0);
    assert_eq!(EffectId::DetectionCubic.unread(&[-4.0 / 9.0, 0.0, 0.0, 0.0], along_x, &now()), along_x);
}

#[test]
fn a_clipped_carrier_is_scaled_by_its_describing_function() {
    let gain = |drive: f64, x: bool| {
        let e = if x { Envelope::new(0.0, drive, 0.1, 0.0) } else { Envelope::new(0.0, 0.1, 0.6 * drive, 0.8 * drive) };
        let read = EffectId::DetectionSaturation.read(&[1.0, 0.0, 0.0, 0.0], e, &now());
        let back = EffectId::DetectionSaturation.unread(&[1.0, 0.0, 0.0, 0.0], read, &now());
        assert!((back - e).pendulum().e.sqrt() < if drive > 5.0 { 1e-7 } else { 1e-9 }, "{drive}: {back:?}");
        let (p, through) = (read, |c: f64, s: f64| c.hypot(s) / drive);
        if x { through(p.x_c, p.x_s) } else { through(p.y_c, p.y_s) }
    };
    for x in [true, false] {
        for drive in [0.2, 0.99, 1.0] {
            assert_abs_diff_eq!(gain(drive, x), 1.0, epsilon = 1e-15);
        }
        for drive in [1.01, 1.2, 1.5, 2.0, 3.0, 6.0] {
            let r = 1.0 / drive;
            assert_abs_diff_eq!(gain(drive, x), 2.0 / PI * (r.asin() + r * (1.0 - r * r).sqrt()), epsilon = 1e-14);
        }
    }
    // each drive by its own level, as each channel
    let f = AxisForces { x_c: 3.0, x_s: 4.0, y_c: 0.3, y_s: -0.4 };
    let clipped = EffectId::DriveSaturation.actuate(&[0.4, 0.0, 0.0, 0.0], f, &now());
    let r: f64 = 1.0 / (0.4 * 5.0);
    let by = 2.0 / PI * (r.asin() + r * (1.0 - r * r).sqrt());
    assert_abs_diff_eq!(clipped.x_c, 3.0 * by, epsilon = 1e-14);
    assert_abs_diff_eq!(clipped.x_s, 4.0 * by, epsilon = 1e-14);
    assert_eq!((clipped.y_c, clipped.y_s), (0.3, -0.4));
    let clipped = EffectId::DriveSaturation.actuate(
        &[0.4, 0.0, 0.0, 0.0],
        AxisForces { x_c: 0.3, x_s: -0.4, y_c: -4.0, y_s: 3.0 },
        &now(),
    );
    assert_eq!((clipped.x_c, clipped.x_s), (0.3, -0.4));
    assert_abs_diff_eq!(clipped.y_c, -4.0 * by, epsilon = 1e-14);
    assert_abs_diff_eq!(clipped.y_s, 3.0 * by, epsilon = 1e-14);
    // beyond 4/π of the clip level there is no vibration: the largest drive that is considered, of ten
    let most = EffectId::DetectionSaturation.unread(&[1.0, 0.0, 0.0, 0.0], Envelope::new(2.0, 0.0, 0.0, 1.0), &now());
    assert_eq!(most, Envelope::new(10.0, 0.0, 0.0, 1.0));
}

#[test]
fn a_drive_of_few_steps_puts_out_whole_ones_in_either_phase() {
    let put_out =
        |step: f64, f: AxisForces<f64>| EffectId::DriveQuantisation.actuate(&[step, 0.0, 0.0, 0.0], f, &now());
    let f = put_out(0.2, AxisForces { x_c: 0.29, x_s: -0.31, y_c: 0.09, y_s: -7.12 });
    assert_abs_diff_eq!(f.x_c, 0.2, epsilon = 1e-15);
    assert_abs_diff_eq!(f.x_s, -0.4, epsilon = 1e-15);
    assert_abs_diff_eq!(f.y_c, 0.0, epsilon = 1e-15);
    assert_abs_diff_eq!(f.y_s, -7.2, epsilon = 1e-13);
    // finer than any converter, or none: nothing is rounded, and what is no number stays none
    let f = AxisForces { x_c: 1.0, x_s: -2.0, y_c: 3e300, y_s: f64::NAN };
    for step in [0.0, -0.1, 1e-6, f64::NAN] {
        let out = put_out(step, f);
        assert_eq!((out.x_c, out.x_s, out.y_c), (1.0, -2.0, 3e300), "{step}");
        assert!(out.y_s.is_nan(), "{step}");
    }
    // 65 536 steps are rounded to a millionth of one
    let f = put_out(1.0, AxisForces { x_c: 65_535.3, x_s: -65_535.3, y_c: 65_536.3, y_s: 0.0 });
    assert_abs_diff_eq!(f.x_c, 65_535.0, epsilon = 1e-6);
    assert_abs_diff_eq!(f.x_s, -65_535.0, epsilon = 1e-6);
    assert_eq!(f.y_c, 65_536.3);
}

#[test]
fn readouts_of_the_angle_turn_the_vibration() {
    let turned = |angle: f64| VIBRATION.turned(angle.sin(), angle.cos());
    // θ(t − t_d) of a pattern that precesses at −0.4 rad/s
    reads(EffectId::AngleLatency, [0.25, 0.0, 0.0, 0.0], turned(0.1), 1e-15);
    let phase = TAU * 0.37 * 2.5;
    let disturbed = 0.2 * phase.cos() - 0.1 * phase.sin();
    reads(EffectId::TimePeriodic, [0.37, 0.2, 0.1, 0.0], turned(disturbed), 1e-15);
    let theta = 0.5_f64.atan2(0.6);
    for (scaling, size) in [(0.0, 1.0), (1.0, -1.0), (2.0, -0.4), (3.0, -2.5)] {
        let error = size * (0.01 * (3.0 * theta).cos() - 0.02 * (3.0 * theta).sin());
        reads(EffectId::HarmonicN, [3.0, 0.01, 0.02, scaling], turned(error), 1e-14);
    }
    // Newton's iteration ends at rounding where n A f is up to 0.3, and stays finite where it folds
    for n in [1.0, 2.0, 5.0, 60.0] {
        for k in 0..64 {
            let values = [n, 0.18 / n, -0.24 / n, 0.0];
            let e = VIBRATION.turned((TAU * f64::from(k) / 64.0).sin(), (TAU * f64::from(k) / 64.0).cos());
            assert_near(EffectId::HarmonicN.unread(&values, EffectId::HarmonicN.read(&values, e, &now()), &now()), e);
        }
    }
    let folded = EffectId::HarmonicN.unread(&[720.0, 0.5, 0.5, 0.0], VIBRATION, &now());
    assert_abs_diff_eq!(folded.pendulum().e, VIBRATION.pendulum().e, epsilon = 1e-14);
    // where the angle stands still under the harmonic there is no step: 1 − 2 · ½ = 0
    let along_x = Envelope::new(1.0, 0.0, 0.0, 0.0);
    assert_eq!(EffectId::HarmonicN.unread(&[2.0, 0.1, 0.5, 0.0], along_x, &now()), along_x);
}

#[test]
fn a_harmonic_scales_with_the_rate_as_it_is_told() {
    for (scaling, of_minus_two, of_four, at_rest) in
        [(0.0, 1.0, 1.0, 1.0), (1.0, -1.0, 1.0, 0.0), (2.0, -2.0, 4.0, 0.0), (3.0, -0.5, 0.25, 0.0)]
    {
        let got = [-2.0, 4.0, 0.0].map(|rate| factor(scaling, rate));
        assert_eq!(got, [of_minus_two, of_four, at_rest], "{scaling}");
    }
    // what lies between two of them is the nearer one, and halfway the next
    for (between, as_if) in [(0.49, 0.0), (0.5, 1.0), (1.49, 1.0), (1.5, 2.0), (2.49, 2.0), (2.5, 3.0)] {
        assert_eq!(factor(between, -2.0), factor(as_if, -2.0), "{between}");
    }
}

#[test]
fn the_input_rate_is_what_reaches_the_resonator() {
    // in both senses: a ripple and a scale go with the rate, a drift does not
    for table in [3.0, -3.0, 0.0] {
        let rate = |id: EffectId, values| id.input_rate(&values, table, &now());
        let ripple = 0.1 * 1.4_f64.cos() - 0.2 * 1.4_f64.sin();
        assert_abs_diff_eq!(
            rate(EffectId::TableHarmonic, [2.0, 0.1, 0.2, 0.0]),
            table * (1.0 + ripple),
            epsilon = 1e-15
        );
        assert_abs_diff_eq!(rate(EffectId::RateOffset, [0.05, 0.0, 0.0, 0.0]), table + 0.05, epsilon = 1e-15);
        assert_abs_diff_eq!(rate(EffectId::ScaleDrift, [0.02, 0.0, 0.0, 0.0]), 1.05 * table, epsilon = 1e-15);
        // 1 + 0.01/K · 5 K
        assert_abs_diff_eq!(rate(EffectId::ScaleTemperature, [0.01, 0.0, 0.0, 0.0]), 1.05 * table, epsilon = 1e-15);
        assert_eq!(rate(EffectId::DetectionSkew, [0.5, 0.0, 0.0, 0.0]), table, "a readout leaves it");
    }
}

#[test]
fn the_mechanics_move_the_envelope_as_averaged() {
    let Envelope { x_c, x_s, y_c, y_s } = VIBRATION;
    let (c, s) = (0.3, -0.4);
    let damped = Envelope::new(
        -0.5 * (c * x_c + s * y_c),
        -0.5 * (c * x_s + s * y_s),
        -0.5 * (s * x_c - c * y_c),
        -0.5 * (s * x_s - c * y_s),
    );
    assert_near(EffectId::Anisodamping.mechanics(&[c, s, 0.0, 0.0], &VIBRATION, &now()), damped);
    // i(x_c − i x_s) = x_s + i x_c: the same a quarter of a period ahead
    let sprung = Envelope::new(damped.x_s, -damped.x_c, damped.y_s, -damped.y_c);
    assert_near(EffectId::Anisoelasticity.mechanics(&[c, s, 0.0, 0.0], &VIBRATION, &now()), sprung);
    assert_eq!(EffectId::DetectionSkew.mechanics(&[c, 0.0, 0.0, 0.0], &VIBRATION, &now()), Envelope::zero());
}

#[test]
fn a_cubic_spring_precesses_at_four_times_the_angle() {
    for theta in [0.1, 0.4, 1.0, -0.7, FRAC_PI_2] {
        let e = Orbit { a: 0.8, q: 0.1, theta, delta: 0.2 }.envelope();
        let rate = EffectId::SpringCubic.mechanics(&[0.3, -0.2, 0.0, 0.0], &e, &now());
        let expected = 0.3 * (4.0 * theta).sin() - 0.2 * (4.0 * theta).cos();
        assert_abs_diff_eq!(e.precession(&rate), expected, epsilon = 1e-14);
        assert_abs_diff_eq!(e.pendulum_rate(&rate).e, 0.0, epsilon = 1e-15);
    }
    for no_orientation in [Envelope::zero(), Envelope::new(1.0, 0.0, 0.0, 1.0)] {
        assert_eq!(EffectId::SpringCubic.mechanics(&[0.3, -0.2, 0.0, 0.0], &no_orientation, &now()), Envelope::zero());
    }
}

#[test]
fn parameters_have_their_roles_and_neutral_values() {
    let roles = |id: EffectId| id.description().parameters.iter().map(|p| p.role).collect::<Vec<_>>();
    assert_eq!(roles(EffectId::DetectionCubic), [Role::Fitted, Role::Refined]);
    let table = Role::Searched(Search::TableOrder { explained_to: 8 });
    assert_eq!(roles(EffectId::TableHarmonic), [table, Role::Fitted, Role::Fitted]);
    assert_eq!(roles(EffectId::TimePeriodic), [Role::Located(Search::Frequency), Role::Fitted, Role::Fitted]);
    assert_eq!(roles(EffectId::HarmonicN)[0], Role::Searched(Search::PatternHarmonic));
    let offset = &EffectId::DetectionOffset.description().parameters[1];
    assert_eq!((offset.lower, offset.upper, offset.neutral), (-1e3, 1e3, 0.0));
    assert_eq!(EffectId::ActuationGainMismatch.neutral::<f64>(), [1.0, 0.0, 0.0, 0.0]);
    assert_eq!(EffectId::TableHarmonic.neutral::<f64>(), [0.1, 0.0, 0.0, 0.0]);
    for &id in EffectId::ALL {
        assert_eq!(EffectId::from_id(id.description().id), Some(id));
    }
    assert_eq!(EffectId::from_id("harmonic"), None);
}

#[test]
fn whole_low_orders_of_the_table_have_a_cause_and_what_is_empirical_has_none() {
    let explains = |id: EffectId, first: f64| id.description().explains(&[first, 0.0, 0.0, 0.0]);
    for (order, expected) in [
        (1.0, true),
        (8.0, true),
        (9.0, false),
        (8.0 + 1e-7, false),
        (2.5, false),
        (3.0 + 9e-7, true),
        (3.0 - 9e-7, true),
        (3.0 + 2e-6, false),
        (3.0 - 2e-6, false),
        (1e-6, false),
    ] {
        assert_eq!(explains(EffectId::TableHarmonic, order), expected, "{order}");
    }
    assert!(explains(EffectId::DetectionSkew, 0.5));
    assert!(!explains(EffectId::RateOffset, 0.5) && !explains(EffectId::HarmonicN, 4.0));
}

/// rms over the pattern angle of what an effect of the readout adds to it, at an amplitude and a precession rate.
fn shift(id: EffectId, amplitude: f64, precession_rad_s: f64) -> f64 {
    let description = id.description();
    let mut values: Values<f64> = id.neutral();
    for (value, p) in values.iter_mut().zip(description.parameters) {
        if p.role == Role::Fitted {
            *value += 0.1 * p.scale;
        }
    }
    let at = Moment { t_s: 3.0, table_rad: 0.4, precession_rad_s, warmer_k: 10.0, ..Moment::default() };
    let angles = (0..24).map(|i| (f64::from(i) + 0.5) * core::f64::consts::PI / 24.0);
    let squares = angles.map(|theta| {
        let (sin, cos) = theta.sin_cos();
        let seen = id.read(&values, Envelope::new(amplitude * cos, 0.0, amplitude * sin, 0.0), &at);
        let turned = seen.y_c.atan2(seen.x_c) - theta;
        turned * turned
    });
    (squares.sum::<f64>() / 24.0).sqrt()
}

#[test]
fn an_effect_scales_with_rate_and_amplitude_as_its_definition_does() {
    for &id in EffectId::ALL {
        let Description { stage, scaling, onsets, .. } = id.description();
        match stage {
            // what it adds is that of the commands
            Stage::Readout if id.on_commands() => {}
            // it turns no line: the quadrature that answers it does, with a split, as the mechanics turn it
            Stage::Readout if id == EffectId::DetectionPhase => assert_eq!(scaling.rate, -1, "{id}"),
            // what moves the pattern has the longer to do so the slower it turns
            Stage::Mechanics | Stage::Actuation => assert_eq!(scaling.rate, -1, "{id}"),
            Stage::Readout if onsets.is_empty() => {
                let one = shift(id, 0.8, 2.0);
                let exponent = |other: f64| (other / one).log2();
                let (amplitude, rate) = (exponent(shift(id, 1.6, 2.0)), exponent(shift(id, 0.8, 4.0)));
                assert!((amplitude - f64::from(scaling.amplitude)).abs() < 0.02, "{id}: a^{amplitude}");
                assert!((rate - f64::from(scaling.rate)).abs() < 0.02, "{id}: rate^{rate}");
            }
            // the table turns with the input, and an onset has a corner
            Stage::Input | Stage::Readout => assert_eq!(scaling.rate, 0, "{id}"),
        }
    }
}

#[test]
fn weak_and_strong_cubics_are_undone_to_rounding_in_every_channel() {
    // k u³ + u = 1 at a readout of 1 V, from a weak to a strong k = ¾κ, and in one channel or both
    for k in [0.0, 1e-9, 1e-6, 5e-5, 1.2e-4, 1.23e-4, 1e-3, 0.01, 0.1] {
        for k in [k, -k] {
            let values = [k / 0.75, 0.0, 0.0, 0.0];
            let alone = Envelope::new(1.0, 0.0, 0.0, 0.0);
            for e in [alone, Envelope::new(0.0, 0.0, 0.0, 1.0), Envelope::new(0.6, 0.8, 0.8, -0.6)] {
                let z = EffectId::DetectionCubic.unread(&values, e, &now());
                for (c, s, seen) in [(z.x_c, z.x_s, e.x_c.hypot(e.x_s)), (z.y_c, z.y_s, e.y_c.hypot(e.y_s))] {
                    let u = c.hypot(s);
                    assert_abs_diff_eq!(u * (1.0 + k * u * u), seen, epsilon = 4e-16);
                }
            }
            // κ + δκ and κ − δκ
            let split =
                EffectId::DetectionCubic.unread(&[0.0, k / 0.75, 0.0, 0.0], Envelope::new(1.0, 0.0, 1.0, 0.0), &now());
            for (u, k) in [(split.x_c, k), (split.y_c, -k)] {
                assert_abs_diff_eq!(u * (1.0 + k * u * u), 1.0, epsilon = 4e-16);
            }
        }
    }
}

#[test]
fn channels_of_unequal_cubics_are_undone_each_by_its_own() {
    let both = Envelope::new(1.0, 0.0, 1.0, 0.0);
    for (k_x, k_y) in [(0.1, 0.0), (0.0, -0.1), (0.1, -0.1), (-0.02, 0.2), (0.2, -0.02), (0.1, 1e-6), (1e-6, 0.1)] {
        let values = [0.5 * (k_x + k_y) / 0.75, 0.5 * (k_x - k_y) / 0.75, 0.0, 0.0];
        let z = EffectId::DetectionCubic.unread(&values, both, &now());
        for (u, k) in [(z.x_c, k_x), (z.y_c, k_y)] {
            // Halley's steps from Newton's leave 1e-12 at a fifth
            assert_abs_diff_eq!(u * (1.0 + k * u * u), 1.0, epsilon = 1e-11);
        }
    }
}

#[test]
fn inverses_have_the_form_that_is_told_of_them() {
    let values = [1.5, 0.25, 0.0, 0.0];
    for &id in EffectId::ALL {
        let form = match id.inverse(&values) {
            Inverse::Unread => "unread",
            Inverse::Affine => "affine",
            Inverse::Cubic(cubic) => {
                let z = id.unread(&values, VIBRATION, &now());
                assert_eq!(cubic.undo(VIBRATION), z);
                "cubic"
            }
        };
        let expected = match id {
            EffectId::DetectionSkew | EffectId::DetectionGainMismatch | EffectId::DetectionOffset => "affine",
            EffectId::DetectionCubic => "cubic",
            _ => "unread",
        };
        assert_eq!(form, expected, "{id}");
    }
}

#[test]
fn readout_effects_stand_in_the_order_in_which_a_signal_meets_them() {
    // an effect that comes in stands anywhere until it is listed here; none of those that are listed may go
    let at = |stage, listed: &[&str]| -> Vec<&str> {
        let all = EffectId::ALL.iter().map(|id| id.description());
        all.filter(|d| d.stage == stage && listed.contains(&d.id)).map(|d| d.id).collect()
    };
    // converters, amplifiers, then axes
    let drives = [
        "drive-quantisation",
        "drive-saturation",
        "actuation-gain-mismatch",
        "actuation-gain-temperature",
        "actuation-skew",
        "actuation-skew-temperature",
        "actuation-phase",
    ];
    assert_eq!(at(Stage::Actuation, &drives), drives);
    // what is added to the angle of the vibration, then plates, axes, amplifier, and the converter
    let angle = ["harmonic-n", "time-periodic", "angle-latency"];
    let channels = [
        "detection-cubic",
        "cubic-temperature",
        "detection-quintic",
        "detection-skew",
        "skew-temperature",
        "detection-gain-mismatch",
        "gain-drift",
        "temperature",
        "detection-phase",
        "drive-feedthrough",
        "detection-offset",
        "detection-offset-temperature",
        "detection-saturation",
    ];
    let listed = [&angle[..], &channels].concat();
    assert_eq!(at(Stage::Readout, &listed), listed);
    for &id in EffectId::ALL {
        assert_eq!(id.acts_on_angle(), angle.contains(&id.description().id), "{id}");
    }
}

#[test]
fn channels_of_unequal_lag_turn_their_phasors_apart_by_it() {
    let phase: f64 = 0.3;
    // X e^{iφ/2} and Y e^{−iφ/2} with X = x_c − i x_s
    let turned = |c: f64, s: f64, by: f64| (c * by.cos() + s * by.sin(), s * by.cos() - c * by.sin());
    let (x_c, x_s) = turned(VIBRATION.x_c, VIBRATION.x_s, 0.5 * phase);
    let (y_c, y_s) = turned(VIBRATION.y_c, VIBRATION.y_s, -0.5 * phase);
    reads(EffectId::DetectionPhase, [phase, 0.0, 0.0, 0.0], Envelope::new(x_c, x_s, y_c, y_s), 1e-15);
}

#[test]
fn a_quintic_readout_is_the_first_harmonic_of_the_fifth_power() {
    // of x + κ₅x⁵ at the size m, over a period
    let (kappa, n) = (0.05, 64);
    let first = |m: f64| {
        let value = |i: u32| m * (TAU * f64::from(i) / f64::from(n)).cos();
        let sum: f64 = (0..n).map(|i| (value(i) + kappa * value(i).powi(5)) * value(i) / m).sum();
        2.0 * sum / f64::from(n)
    };
    let e = VIBRATION;
    let [x, y] = [e.x_c.hypot(e.x_s), e.y_c.hypot(e.y_s)].map(|m| first(m) / m);
    let expected = Envelope::new(x * e.x_c, x * e.x_s, y * e.y_c, y * e.y_s);
    reads(EffectId::DetectionQuintic, [kappa, 0.0, 0.0, 0.0], expected, 1e-12);
}

#[test]
fn a_quintic_readout_is_undone_to_rounding() {
    for k in [0.08, -0.08, 0.02, -1e-3] {
        let values = [k / 0.625, 0.0, 0.0, 0.0];
        for m in [1.0, 0.7] {
            let read = EffectId::DetectionQuintic.read(&values, Envelope::new(m, 0.0, 0.0, -m), &now());
            let z = EffectId::DetectionQuintic.unread(&values, read, &now());
            // k of the readout, which the inverse sees, is up to half as large again
            assert!((z.x_c - m).abs() < 4e-16 && (z.y_s + m).abs() < 4e-16, "{k} {m}: {z:?}");
        }
    }
}

#[test]
fn a_channel_reads_its_drive_by_a_complex_factor() {
    // x_c − i x_s and f_c − i f_s
    let of = |re: f64, im: f64, [c, s]: [f64; 2]| [re * c + im * s, re * s - im * c];
    let f = now().drive;
    let ([x_c, x_s], [y_c, y_s]) = (of(0.3, -0.2, [f.x_c, f.x_s]), of(0.05, 0.4, [f.y_c, f.y_s]));
    let read = VIBRATION + Envelope::new(x_c, x_s, y_c, y_s);
    reads(EffectId::DriveFeedthrough, [0.3, -0.2, 0.05, 0.4], read, 1e-15);
    // an energy command through a real factor is a lag: in phase with what it takes energy from, nothing
    let energy = Moment { drive: AxisForces { x_s: 1.0, ..AxisForces::default() }, ..now() };
    let lagged = EffectId::DriveFeedthrough.read(&[0.3, 0.0, 0.0, 0.0], VIBRATION, &energy) - VIBRATION;
    assert_near(lagged, Envelope::new(0.0, 0.3, 0.0, 0.0));
}

/// Beside the effect at its values for the temperature that parameters refer to, what follows it is the effect at those of the moment: a sum,
/// or, of gain ratios, a product.
#[test]
fn what_follows_the_temperature_is_the_effect_with_slopes_in_the_place_of_its_parameters() {
    use EffectId as E;
    let pairs = [
        (E::DetectionGainMismatch, E::Temperature, 1.02),
        (E::DetectionSkew, E::SkewTemperature, 0.02),
        (E::DetectionCubic, E::CubicTemperature, 0.0),
        (E::DetectionOffset, E::DetectionOffsetTemperature, 0.02),
        (E::Anisodamping, E::AnisodampingTemperature, 0.02),
        (E::Anisoelasticity, E::AnisoelasticityTemperature, 0.02),
        (E::ActuationGainMismatch, E::ActuationGainTemperature, 1.02),
        (E::ActuationSkew, E::ActuationSkewTemperature, 0.02),
    ];
    for (id, followed, constant) in pairs {
        let (at, slope) = (now(), 1e-3);
        let change = slope * at.warmer_k;
        let whole = if constant > 1.0 { constant * (1.0 + change) } else { constant + change };
        let one = |v: f64| [v, 0.0, 0.0, 0.0];
        let (whole, constant, slope) = (one(whole), one(constant), one(slope));
        assert_near(followed.read(&slope, id.read(&constant, VIBRATION, &at), &at), id.read(&whole, VIBRATION, &at));
        let moved = id.mechanics(&constant, &VIBRATION, &at) + followed.mechanics(&slope, &VIBRATION, &at);
        assert_near(moved, id.mechanics(&whole, &VIBRATION, &at));
        let (pushed, expected) =
            (followed.actuate(&slope, id.actuate(&constant, at.drive, &at), &at), id.actuate(&whole, at.drive, &at));
        let as_envelope = |f: AxisForces<f64>| Envelope::new(f.x_c, f.x_s, f.y_c, f.y_s);
        assert_near(as_envelope(pushed), as_envelope(expected));
    }
}

#[test]
fn what_is_made_of_commands_says_so() {
    let made: Vec<_> = EffectId::ALL.iter().filter(|id| id.on_commands()).collect();
    assert_eq!(made, [&EffectId::DriveFeedthrough]);
    for &id in EffectId::ALL.iter().filter(|id| !id.on_commands()) {
        let values = id.description().parameters.iter().map(|p| p.neutral + p.scale);
        let mut all: Values<f64> = id.neutral();
        all.iter_mut().zip(values).for_each(|(v, value)| *v = value);
        let still = Moment { drive: AxisForces::default(), ..now() };
        assert_eq!(id.read(&all, VIBRATION, &now()), id.read(&all, VIBRATION, &still), "{id}");
    }
}

/// What a loop nulls in its own channel shows in what it commands, and nowhere else.
#[test]
fn a_lag_between_the_channels_and_a_split_that_changes_alone_are_seen_by_the_loops_alone() {
    let seen: Vec<_> = EffectId::ALL.iter().filter(|id| id.seen_by_loops()).collect();
    let split = EffectId::AnisoelasticityTemperature;
    assert_eq!(seen, [&split, &EffectId::DetectionPhase, &EffectId::DriveFeedthrough]);
}
