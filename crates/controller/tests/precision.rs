//! What runs in single precision does what it does in double precision, but for the rounding: whatever comes in, from
//! whatever state.

use cvg_controller::{ActuationCompensation, Allocation, Heading, OrbitCommands, Pi, PiState, RateLoop};
use cvg_model::effects::EffectId;
use cvg_model::{Envelope, Float};

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

    /// Mostly a number of this size, sometimes far beyond it, or none.
    fn any(&mut self, size: f32) -> f32 {
        let v = self.between(-size, size);
        match (32.0 * self.share()) as u32 {
            0 => f32::NAN,
            1 => f32::INFINITY * v.signum(),
            2 | 3 => 50.0 * v,
            4 => 0.0,
            _ => v,
        }
    }
}

/// Equal up to `rounding`, and no number where the other is none.
#[track_caller]
fn near(single: f32, double: f64, rounding: f64, of: &dyn core::fmt::Debug) {
    let off = (f64::from(single) - double).abs();
    assert!(off <= rounding || f64::from(single).to_bits() == double.to_bits(), "{single} and {double}: {of:?}");
}

fn state<T: Float>(integral: f32) -> PiState<T> {
    PiState { integral: T::from_f64(f64::from(integral)) }
}

#[test]
fn the_loops_of_energy_and_quadrature() {
    fn loops<T: Float>() -> Pi<T> {
        let t = T::from_f64;
        Pi::new(t(7.75), t(0.25), t(1.0 / 2048.0), t(10.0)).expect("valid")
    }
    let (single, double) = (loops::<f32>(), loops::<f64>());
    let mut draws = Draws(0x9E37_79B9_7F4A_7C15);
    for _ in 0..20_000 {
        let (error, integral) = (draws.any(2.0), draws.any(1.0));
        let (mut e_32, mut e_64) = (state(integral), state(integral));
        let (mut q_32, mut q_64) = (e_32, e_64);
        let energy = (single.energy(&mut e_32, error, 0.0), double.energy(&mut e_64, f64::from(error), 0.0));
        let quadrature = (single.quadrature(&mut q_32, error), double.quadrature(&mut q_64, f64::from(error)));
        for ((c_32, c_64), (s_32, s_64)) in [(energy, (e_32, e_64)), (quadrature, (q_32, q_64))] {
            // commands of up to 10 V, rounded a few times
            near(c_32.volts, c_64.volts, 1e-5, &(error, integral));
            assert_eq!(c_32.status, c_64.status, "{error} {integral}");
            near(s_32.integral, s_64.integral, 1e-6, &(error, integral));
        }
    }
}

#[test]
fn the_loop_that_holds_the_pattern() {
    fn held<T: Float>(heading: f32) -> (RateLoop<T>, Heading<T>) {
        let t = T::from_f64;
        let rate = RateLoop::tuned(t(12.0), t(0.75), t(1.5), t(3.0), t(1.0 / 2048.0), t(5.0)).expect("valid");
        (rate, Heading::new(t(f64::from(heading))).expect("finite"))
    }
    let mut draws = Draws(0xD1B5_4A32_D192_ED03);
    for _ in 0..20_000 {
        let (heading, integral) = (draws.between(-3.0, 3.0), draws.any(0.1));
        let [x_c, x_s, y_c, y_s] = [1.0, 0.1, 1.0, 0.1].map(|size| draws.any(size));
        let p_32 = Envelope::new(x_c, x_s, y_c, y_s).pendulum();
        let p_64 = Envelope::new(f64::from(x_c), f64::from(x_s), f64::from(y_c), f64::from(y_s)).pendulum();
        let ((rate_32, to_32), (rate_64, to_64)) = (held::<f32>(heading), held::<f64>(heading));
        let (mut s_32, mut s_64) = (state(integral), state(integral));
        let (c_32, c_64) = (rate_32.step(&mut s_32, &p_32, &to_32), rate_64.step(&mut s_64, &p_64, &to_64));
        let of = (heading, integral, p_64);
        // up to 16 V per unit of the error, which is rounded as a heading of 3 rad is
        near(c_32.volts, c_64.volts, 3e-4, &of);
        near(s_32.integral, s_64.integral, 1e-6, &of);
        assert_eq!(c_32.status, c_64.status, "{of:?}");
    }
}

#[test]
fn the_way_to_the_drives() {
    fn drives<T: Float>(phase: f64) -> Allocation<T> {
        let effects = [
            (EffectId::ActuationGainMismatch, 1.25),
            (EffectId::ActuationSkew, 0.25),
            (EffectId::ActuationPhase, phase),
        ]
        .map(|(id, value)| (id, [value, 0.0, 0.0, 0.0].map(T::from_f64)));
        let compensation = ActuationCompensation::new(&effects).expect("valid");
        Allocation::new(Some(compensation), T::from_f64(5.0)).expect("valid")
    }
    let (single, double, straight) = (drives::<f32>(-0.2), drives::<f64>(-0.2), drives::<f32>(0.0));
    let mut draws = Draws(0x2545_F491_4F6C_DD1D);
    for _ in 0..20_000 {
        let [v_as, v_qs, v_qc, v_ac] = [2.0; 4].map(|size| draws.any(size));
        let (sin, cos) = draws.between(-3.2, 3.2).sin_cos();
        let c_32 = OrbitCommands { v_as, v_qs, v_qc, v_ac };
        let [a, b, c, d] = [v_as, v_qs, v_qc, v_ac].map(f64::from);
        let c_64 = OrbitCommands { v_as: a, v_qs: b, v_qc: c, v_ac: d };
        let (d_32, d_64) = (single.step(&c_32, cos, sin), double.step(&c_64, f64::from(cos), f64::from(sin)));
        let volts = [
            (d_32.volts.x_c, d_64.volts.x_c),
            (d_32.volts.x_s, d_64.volts.x_s),
            (d_32.volts.y_c, d_64.volts.y_c),
            (d_32.volts.y_s, d_64.volts.y_s),
        ];
        for (v_32, v_64) in volts {
            near(v_32, v_64, 1e-5, &(c_32, cos, sin));
        }
        assert_eq!(d_32.status, d_64.status, "{c_32:?} {cos} {sin}");
        // the way of two commands alone is that of all, where it is one and drives have no phase
        let both = cvg_model::ControlOutputs { v_as, v_qc };
        let axes = straight.axes_within(&both, cos, sin);
        let all = straight.step_within(&OrbitCommands { v_qs: 0.0, v_ac: 0.0, ..c_32 }, cos, sin);
        assert_eq!(axes.is_some(), all.is_some(), "{both:?} {cos} {sin}");
    }
}
