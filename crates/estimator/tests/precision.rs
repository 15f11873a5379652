//! What runs in single precision does what it does in double precision, but for the rounding: whatever comes in, from
//! whatever state.

use cvg_estimator::beat::phase_ahead;
use cvg_estimator::direction::{major_axis, major_axis_of};
use cvg_estimator::{
    AngleState, Beat, Compensation, Demodulator, LockState, Oscillator, PatternAngle, Period, PhaseLock, Phasor,
    Precession, PrecessionState, Window,
};
use cvg_model::effects::{EffectId, Moment};
use cvg_model::{Envelope, Float, Orbit};

/// Numbers that single precision has, the same in every run.
struct Draws(u64);

impl Draws {
    fn share(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.share()
    }

    /// Once in so many.
    fn once_in(&mut self, n: f32) -> bool {
        self.share() * n < 1.0
    }

    /// A line, nearly, of any direction and phase.
    fn line(&mut self) -> [f32; 4] {
        let (q, theta, delta) = (self.between(-0.1, 0.1), self.between(-3.2, 3.2), self.between(-0.3, 0.3));
        let e = Orbit { a: self.between(0.5, 1.5), q, theta, delta }.envelope();
        [e.x_c, e.x_s, e.y_c, e.y_s]
    }
}

fn envelope<T: Float>(v: [f32; 4]) -> Envelope<T> {
    let [x_c, x_s, y_c, y_s] = v.map(|v| T::from_f64(f64::from(v)));
    Envelope::new(x_c, x_s, y_c, y_s)
}

/// Equal up to `rounding`, or no number both.
#[track_caller]
fn near(single: f32, double: f64, rounding: f64, of: &dyn core::fmt::Debug) {
    let off = (f64::from(single) - double).abs();
    assert!(off <= rounding || single.is_nan() && double.is_nan(), "{single} and {double}: {of:?}");
}

#[track_caller]
fn alike(single: &Envelope<f32>, double: &Envelope<f64>, rounding: f64, of: &dyn core::fmt::Debug) {
    near(single.x_c, double.x_c, rounding, of);
    near(single.x_s, double.x_s, rounding, of);
    near(single.y_c, double.y_c, rounding, of);
    near(single.y_s, double.y_s, rounding, of);
}

#[test]
fn the_phase_lock() {
    fn lock<T: Float>() -> PhaseLock<T> {
        let t = T::from_f64;
        PhaseLock::new(t(60.0), t(0.75), t(1.0 / 2048.0), t(600.0)).expect("valid")
    }
    let (single, double) = (lock::<f32>(), lock::<f64>());
    let mut draws = Draws(0x9E37_79B9_7F4A_7C15);
    for _ in 0..20_000 {
        let held = if draws.once_in(9.0) { f32::NAN } else { draws.between(-900.0, 900.0) };
        let scale = if draws.once_in(9.0) { f32::NAN } else { 1.0 };
        let e = draws.line().map(|v| v * scale);
        let (mut s_32, mut s_64) = (LockState { detuning_rad_s: held }, LockState { detuning_rad_s: f64::from(held) });
        let (p_32, p_64) = (envelope::<f32>(e).pendulum(), envelope::<f64>(e).pendulum());
        let (c_32, c_64) = (single.step(&mut s_32, &p_32), double.step(&mut s_64, &p_64));
        near(c_32.rad_s, c_64.rad_s, 1e-3, &(held, e));
        near(s_32.detuning_rad_s, s_64.detuning_rad_s, 1e-3, &(held, e));
        assert_eq!(c_32.status, c_64.status, "{held} {e:?}");
    }
}

#[test]
fn the_oscillator_over_many_windows() {
    let (single, double) =
        (Oscillator::<f32>::new(15_200.0, 1e-5, 2400.0), Oscillator::<f64>::new(15_200.0, 1e-5, 2400.0));
    let (single, double) = (single.expect("valid"), double.expect("valid"));
    let mut draws = Draws(0xD1B5_4A32_D192_ED03);
    for _ in 0..5000 {
        let (length, angle) = (draws.between(0.8, 1.2), draws.between(-3.2, 3.2));
        let (sin, cos) = angle.sin_cos();
        let correction = draws.between(-3000.0, 3000.0);
        let p_32 = Phasor { cos: length * cos, sin: length * sin, ..single.start() };
        let p_64 = Phasor { cos: f64::from(p_32.cos), sin: f64::from(p_32.sin), ..double.start() };
        let (mut t_32, mut t_64) = (single.tune(&p_32, correction), double.tune(&p_64, f64::from(correction)));
        for _ in 0..50 {
            t_32.advance();
            t_64.advance();
        }
        // a step is right to 6e-8, fifty steps to some 3e-6
        near(t_32.cos, t_64.cos, 2e-5, &(length, angle, correction));
        near(t_32.sin, t_64.sin, 2e-5, &(length, angle, correction));
    }
}

#[test]
fn the_envelope_of_a_window() {
    let (single, double) = (Demodulator::<f32>::new(37, 2.5), Demodulator::<f64>::new(37, 2.5));
    let (single, double) = (single.expect("valid"), double.expect("valid"));
    let (nco_32, nco_64) =
        (Oscillator::<f32>::new(15_200.0, 1e-5, 2400.0), Oscillator::<f64>::new(15_200.0, 1e-5, 2400.0));
    let (nco_32, nco_64) = (nco_32.expect("valid"), nco_64.expect("valid"));
    let mut draws = Draws(0x2545_F491_4F6C_DD1D);
    for _ in 0..5000 {
        let (sin, cos) = draws.between(-3.2, 3.2).sin_cos();
        let mut p_32 = nco_32.start().turned(cos, sin);
        let mut p_64 = nco_64.start().turned(f64::from(cos), f64::from(sin));
        let (mut w_32, mut w_64) = (Window::begin(&p_32), Window::begin(&p_64));
        let (offset_x, offset_y) = (draws.between(-0.3, 0.3), draws.between(-0.3, 0.3));
        for _ in 0..37 {
            let rare = |draws: &mut Draws, v: f32| match (1000.0 * draws.share()) as u32 {
                0 => 2.6,
                1 => -2.6,
                2 => f32::NAN,
                3 => -2.499_9,
                _ => v,
            };
            let (x, y) = (draws.between(-1.5, 1.5) + offset_x, draws.between(-1.5, 1.5) + offset_y);
            let (x, y) = (rare(&mut draws, x), rare(&mut draws, y));
            single.accumulate(&mut w_32, x, y, &p_32);
            double.accumulate(&mut w_64, f64::from(x), f64::from(y), &p_64);
            p_32.advance();
            p_64.advance();
        }
        let (m_32, m_64) = (single.finish(&w_32, &p_32), double.finish(&w_64, &p_64));
        let of = (m_64.clipped, m_64.invalid);
        assert_eq!((m_32.status, m_32.clipped, m_32.invalid), (m_64.status, of.0, of.1));
        alike(&m_32.envelope, &m_64.envelope, 2e-5, &of);
    }
}

#[test]
fn how_the_pattern_moves() {
    fn tracker<T: Float>() -> Precession<T> {
        Precession::new(5e-4, 8e-3, 35.0, 0.1, 6e-4, 4e-3).expect("valid")
    }
    let (single, double) = (tracker::<f32>(), tracker::<f64>());
    let mut draws = Draws(0xA076_1D64_78BD_642F);
    let (mut s_32, mut s_64) = (PrecessionState::<f32>::default(), PrecessionState::<f64>::default());
    for sin_2 in [0.0, -0.0] {
        // the cut's own points are on its positive side, whatever their zero's sign
        assert_eq!(PrecessionState { cos_2: -1.0_f32, sin_2, ..s_32 }.angle().1, core::f32::consts::FRAC_PI_2);
        assert_eq!(PrecessionState { cos_2: -1.0_f64, sin_2: f64::from(sin_2), ..s_64 }.degrees(), 90.0);
    }
    let (mut theta, mut rate) = (0.3_f32, 0.01_f32);
    for _ in 0..40_000 {
        if draws.once_in(60.0) {
            rate = draws.between(-0.1, 0.1);
        }
        theta += if draws.once_in(80.0) { draws.between(-1.5, 1.5) } else { rate };
        let a = if draws.once_in(50.0) { 1e-3 } else { 1.0 };
        let e = Orbit { a, q: 0.0, theta, delta: 0.02 }.envelope();
        let e = [e.x_c, e.x_s, e.y_c, e.y_s];
        let (p_32, p_64) = (envelope::<f32>(e).pendulum(), envelope::<f64>(e).pendulum());
        let moved = (single.step(&mut s_32, &p_32), double.step(&mut s_64, &p_64));
        assert_eq!(moved.0, moved.1, "{theta} {rate}");
        assert_eq!(s_32.half_turns, s_64.half_turns, "{theta} {rate}");
        near(s_32.sin_2, s_64.sin_2, 1e-5, &theta);
        near(single.rate_rad_s(&s_32), double.rate_rad_s(&s_64), 1e-2, &theta);
        // the two ends of the half turn are one direction
        let off = (s_32.degrees() - s_64.degrees()).abs();
        assert!(off < 1e-3 || (off - 180.0).abs() < 1e-3 && s_64.sin_2.abs() < 1e-5, "{theta}: {off}");
        let (d_32, d_64) = (major_axis_of(&envelope(e), s_32.cos_2, s_32.sin_2), {
            let e = envelope::<f64>(e);
            major_axis_of(&e, s_64.cos_2, s_64.sin_2)
        });
        let (a_32, a_64) = (single.ahead(&s_32, &d_32), double.ahead(&s_64, &d_64));
        assert_eq!(d_32.status, d_64.status, "{theta}");
        near(a_32.cos, a_64.cos, 1e-5, &theta);
        near(a_32.sin, a_64.sin, 1e-5, &theta);
        let (m_32, m_64) = (major_axis(&envelope(e), &p_32), major_axis(&envelope(e), &p_64));
        assert_eq!(m_32.status, m_64.status, "{theta}");
        near(m_32.cos, m_64.cos, 1e-5, &theta);
        near(m_32.sin, m_64.sin, 1e-5, &theta);
    }
}

#[test]
fn the_beat_and_the_phase() {
    let mut draws = Draws(0xE703_7ED1_A0B4_28DB);
    for _ in 0..2000 {
        let (mut b_32, mut b_64) = (Beat::<f32>::default(), Beat::<f64>::default());
        for _ in 0..8 {
            let e = draws.line();
            b_32.add(&envelope(e));
            b_64.add(&envelope(e));
        }
        near(b_32.powers().0, b_64.powers().0, 1e-4, &b_64);
        near(b_32.powers().1, b_64.powers().1, 1e-4, &b_64);
        let sum = b_64.powers().0 + b_64.powers().1;
        let (along, across) = (b_64.radians_per_window().cos(), b_64.radians_per_window().sin());
        let turned = f64::from(b_32.radians_per_window());
        assert!((turned.cos() - along).abs() + (turned.sin() - across).abs() < 1e-3 * sum, "{b_64:?}");
        let e: [f32; 4] = core::array::from_fn(|_| draws.between(-1.0, 1.0));
        let ((cos_32, sin_32), (cos_64, sin_64)) = (phase_ahead(&envelope::<f32>(e)), phase_ahead(&envelope::<f64>(e)));
        // half a turn apart at the end of the half turn they are the same phase
        let product = f64::from(cos_32) * cos_64 + f64::from(sin_32) * sin_64;
        assert!(product > 0.999 || cos_64.abs() < 1e-3 && product < -0.999, "{e:?}");
    }
}

#[test]
fn what_the_readout_undoes() {
    let effects = [
        (EffectId::DetectionCubic, [0.02, 0.01, 0.0, 0.0]),
        (EffectId::DetectionGainMismatch, [1.25, 0.0, 0.0, 0.0]),
        (EffectId::DetectionSkew, [0.25, 0.0, 0.0, 0.0]),
        (EffectId::DetectionOffset, [0.03, -0.05, 0.0, 0.0]),
    ];
    let single = Compensation::<f32, 4>::new(&effects.map(|(id, v)| (id, v.map(|v: f64| v as f32)))).expect("valid");
    let double = Compensation::<f64, 4>::new(&effects).expect("valid");
    let mut draws = Draws(0x8EBC_6AF0_9C88_C6E3);
    for _ in 0..5000 {
        let e = draws.line();
        let z = (single.apply(envelope(e), &Moment::default()), double.apply(envelope(e), &Moment::default()));
        alike(&z.0, &z.1, 1e-5, &e);
    }
}

#[test]
fn the_angle_of_any_envelope_from_any_state() {
    let mut draws = Draws(0x5895_0F3A_1B2C_44D7);
    for period in [Period::Pattern, Period::FullTurn] {
        let (single, double) = (PatternAngle::<f32>::new(period, 1e-3), PatternAngle::<f64>::new(period, 1e-3));
        let (single, double) = (single.expect("valid"), double.expect("valid"));
        for _ in 0..10_000 {
            let within = if draws.once_in(9.0) { f32::NAN } else { draws.between(-3.5, 3.5) };
            let scale = if draws.once_in(9.0) { 0.0 } else { 1.0 };
            let e = draws.line().map(|v| v * scale);
            let mut s_32 = AngleState { periods: 5, within_rad: within };
            let mut s_64 = AngleState { periods: 5, within_rad: f64::from(within) };
            let (r_32, r_64) = (single.step(&mut s_32, &envelope(e)), double.step(&mut s_64, &envelope(e)));
            assert_eq!((r_32.periods, r_32.status), (r_64.periods, r_64.status), "{within} {e:?}");
            near(r_32.within_rad, r_64.within_rad, 1e-5, &(within, e));
        }
    }
}
