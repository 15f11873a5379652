//! What C learns is what Rust learns: settings, steps, corrections and records, number by number; and nothing where C gives
//! nothing.
#![allow(unsafe_code, reason = "the interface is C's")]

use std::ptr::{null, null_mut};

use cvg::calibrator::{
    Added, CVG_RECORD_BYTES, CalibratorMemory, CalibratorSettings, Control, Four, Known, LearnedMemory,
    cvg_calibrator_drives, cvg_calibrator_forward, cvg_calibrator_init, cvg_calibrator_known,
    cvg_calibrator_not_rotation, cvg_calibrator_readout, cvg_calibrator_restore, cvg_calibrator_save,
    cvg_calibrator_settings_default, cvg_calibrator_split_changed, cvg_calibrator_step, cvg_record,
};
use cvg_calibrator::{Calibrator, Commands, Health, Parameter, Settings, State};
use cvg_model::{AxisForces, Envelope, Pendulum};

fn settings() -> Settings {
    Settings {
        control_s: 6e-4,
        amplitude_v: 0.9,
        drive_per_s: 1.2,
        damping_per_s: 0.06,
        steps: 90,
        precession_rad_s: 0.25,
        dither_rad_s: 0.03,
    }
}

fn in_c(s: &Settings) -> CalibratorSettings {
    CalibratorSettings {
        control_s: s.control_s,
        amplitude_v: s.amplitude_v,
        drive_per_s: s.drive_per_s,
        damping_per_s: s.damping_per_s,
        steps: s.steps,
        precession_rad_s: s.precession_rad_s,
        dither_rad_s: s.dither_rad_s,
    }
}

fn both() -> (CalibratorMemory, LearnedMemory, Calibrator<f32>, State<f32>) {
    // SAFETY: arrays of integers, filled by the call
    let (calibrator, learned) = unsafe {
        let (mut c, mut l) = (std::mem::zeroed(), std::mem::zeroed());
        assert_eq!(cvg_calibrator_init(&raw mut c, &raw mut l, &in_c(&settings())).parameter_length, 0);
        (c, l)
    };
    let rust = Calibrator::new(&settings()).expect("inside its domain");
    let state = rust.start();
    (calibrator, learned, rust, state)
}

fn learned(l: &mut LearnedMemory) -> &mut State<f32> {
    // SAFETY: what the library has written there
    unsafe { &mut *(&raw mut *l).cast::<State<f32>>() }
}

/// A step of a pattern that turns, each number other than every other.
fn control(n: u32) -> Control {
    let theta = 0.002 * n as f32;
    let ((s, r), (sin, cos)) = ((2.0 * theta).sin_cos(), theta.sin_cos());
    let wave = (0.013 * n as f32).sin();
    Control {
        energy: 0.81 + 0.002 * wave,
        quadrature: 0.003 * wave,
        r: 0.81 * r,
        s: 0.81 * s,
        l: 0.001,
        cos,
        sin,
        v_as: -0.05 + 0.01 * wave,
        v_qs: 0.02 * s,
        v_qc: 0.03 * r,
        disturbed: n % 1000 < 3,
    }
}

#[test]
fn c_learns_what_rust_learns() {
    let (c, mut l, rust, _) = both();
    // something is known of everything
    let mut values = [0.0; _];
    for (n, value) in values.iter_mut().enumerate() {
        *value = 1e-3 + 1e-4 * n as f32;
    }
    let mut state = rust.start_from(&values).expect("a device");
    *learned(&mut l) = state;
    let bits = |v: Four| [v.x_c, v.x_s, v.y_c, v.y_s].map(f32::to_bits);
    for n in 0..30_000 {
        let k = control(n);
        let p = Pendulum { e: k.energy, q: k.quadrature, r: k.r, s: k.s, l: k.l };
        let commands = Commands { energy_v: k.v_as, precession_v: k.v_qs, quadrature_v: k.v_qc };
        let health = if k.disturbed { Health::Disturbed } else { Health::Operating };
        rust.step(&mut state, &p, (k.cos, k.sin), &commands, health);
        // SAFETY: filled by the library
        unsafe { cvg_calibrator_step(&raw const c, &raw mut l, &raw const k) };
        if n == 20_000 {
            rust.split_changed(&mut state);
            // SAFETY: the same
            unsafe { cvg_calibrator_split_changed(&raw const c, &raw mut l) };
        }
        if n % 100 != 0 {
            continue;
        }
        assert!(*learned(&mut l) == state, "another state after {n} steps");
        let (four, e) = (Four { x_c: 0.7, x_s: 0.1, y_c: -0.4, y_s: 0.2 }, Envelope::new(0.7, 0.1, -0.4, 0.2));
        // SAFETY: the same
        let (readout, drives, forward, not_rotation) = unsafe {
            (
                cvg_calibrator_readout(&raw const c, &raw const l, four),
                cvg_calibrator_drives(&raw const c, &raw const l, four),
                cvg_calibrator_forward(&raw const c, &raw const l, k.cos, k.sin, 0.8),
                cvg_calibrator_not_rotation(&raw const c, &raw const l, &raw const k),
            )
        };
        let r = rust.readout(&state, &e);
        assert_eq!(bits(readout), [r.x_c, r.x_s, r.y_c, r.y_s].map(f32::to_bits));
        let f = rust.drives(&state, &AxisForces { x_c: 0.7, x_s: 0.1, y_c: -0.4, y_s: 0.2 });
        assert_eq!(bits(drives), [f.x_c, f.x_s, f.y_c, f.y_s].map(f32::to_bits));
        let f = rust.forward(&state, k.cos, k.sin, 0.8);
        let asked = Added { v_qs: f.precession_v, v_qc: f.quadrature_v, detuning_rad_s: f.detuning_rad_s };
        assert_eq!(forward, asked);
        assert!(asked.v_qs != asked.v_qc && asked.v_qc != asked.detuning_rad_s, "{asked:?}");
        assert_eq!(not_rotation.to_bits(), rust.not_rotation(&state, &p, (k.cos, k.sin), &commands).to_bits());
    }
    // SAFETY: the same
    let known = unsafe { cvg_calibrator_known(&raw const c, &raw const l) };
    let status = rust.status(&state);
    let of = |p| state.estimate(p).map_or((0.0, 0.0), |e| (e.value, e.sigma));
    let ((ratio, ratio_sigma), (skew, skew_sigma)) = (of(Parameter::DetectionRatio), of(Parameter::DetectionSkew));
    let asked = Known {
        learned: status.learned,
        detection_known: status.detection_known,
        detection_followed: status.detection_followed,
        bias_rad: status.bias_rad,
        taken_back: status.taken_back,
        ratio,
        ratio_sigma,
        skew,
        skew_sigma,
    };
    assert_eq!(known, asked);
    assert!(known.ratio_sigma > 0.0 && known.skew_sigma > 0.0 && known.ratio_sigma != known.skew_sigma);
    assert_eq!(saved(&c, &l), rust.save(&state));
}

fn saved(c: &CalibratorMemory, l: &LearnedMemory) -> [u8; CVG_RECORD_BYTES] {
    let mut record = [0; CVG_RECORD_BYTES];
    // SAFETY: filled by the library, and as many bytes as it writes
    assert!(unsafe { cvg_calibrator_save(c, l, record.as_mut_ptr()) });
    record
}

#[test]
fn records_are_restored_or_refused_by_their_fault() {
    let (c, mut l, ..) = both();
    let record = saved(&c, &l);
    // SAFETY: filled by the library, and as many bytes as it reads
    let mut restore =
        |record: &[u8; CVG_RECORD_BYTES]| unsafe { cvg_calibrator_restore(&raw const c, &raw mut l, record.as_ptr()) };
    assert_eq!(restore(&record), cvg_record::CVG_RECORD_RESTORED);
    let mut damaged = record;
    damaged[CVG_RECORD_BYTES / 2] ^= 1;
    assert_eq!(restore(&damaged), cvg_record::CVG_RECORD_DAMAGED);
    // SAFETY: null is admitted
    assert_eq!(
        unsafe { cvg_calibrator_restore(&raw const c, null_mut(), record.as_ptr()) },
        cvg_record::CVG_RECORD_NULL
    );
}

#[test]
fn defaults_are_those_of_rust_and_nothing_is_answered_with_nothing() {
    assert_eq!(cvg_calibrator_settings_default(), in_c(&Settings::default()));
    let (mut c, mut l, ..) = both();
    let before = saved(&c, &l);
    let four = Four { x_c: 0.7, x_s: 0.1, y_c: -0.4, y_s: 0.2 };
    let (k, s) = (control(1), in_c(&settings()));
    // SAFETY: null is admitted everywhere
    unsafe {
        assert_eq!(cvg_calibrator_readout(null(), &raw const l, four), four);
        assert_eq!(cvg_calibrator_drives(&raw const c, null(), four), four);
        assert_eq!(cvg_calibrator_forward(null(), null(), 1.0, 0.0, 1.0), Added::default());
        assert_eq!(cvg_calibrator_known(&raw const c, null()), Known::default());
        assert_eq!(cvg_calibrator_not_rotation(&raw const c, &raw const l, null()), 0.0);
        cvg_calibrator_step(null(), &raw mut l, &raw const k);
        cvg_calibrator_step(&raw const c, null_mut(), &raw const k);
        cvg_calibrator_split_changed(null(), &raw mut l);
        assert!(!cvg_calibrator_save(&raw const c, &raw const l, null_mut()));
        assert!(cvg_calibrator_init(&raw mut c, &raw mut l, null()).parameter_length > 0);
        assert!(cvg_calibrator_init(null_mut(), &raw mut l, &raw const s).parameter_length > 0);
        assert!(cvg_calibrator_init(&raw mut c, null_mut(), &raw const s).parameter_length > 0);
        let refused = CalibratorSettings { control_s: f64::NAN, ..s };
        assert!(cvg_calibrator_init(&raw mut c, &raw mut l, &raw const refused).parameter_length > 0);
    }
    assert_eq!(saved(&c, &l), before, "what was refused has changed what was learned");
}
