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
fn the_calibrator_is_that_of_every_setting() {
    let (c, _, rust, _) = both();
    // SAFETY: what the library has written there
    assert_eq!(unsafe { *(&raw const c).cast::<Calibrator<f32>>() }, rust);
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
    assert_eq!(known, asked(&rust, &state));
    assert!(known.ratio_sigma > 0.0 && known.skew_sigma > 0.0 && known.ratio_sigma != known.skew_sigma);
    assert_eq!(saved(&c, &l), rust.save(&state));
}

/// What is known, as Rust has it.
fn asked(rust: &Calibrator<f32>, state: &State<f32>) -> Known {
    let status = rust.status(state);
    let of = |p| state.estimate(p).map_or((0.0, 0.0), |e| (e.value, e.sigma));
    let ((ratio, ratio_sigma), (skew, skew_sigma)) = (of(Parameter::DetectionRatio), of(Parameter::DetectionSkew));
    Known {
        learned: status.learned,
        detection_known: status.detection_known,
        detection_followed: status.detection_followed,
        bias_rad: status.bias_rad,
        taken_back: status.taken_back,
        ratio,
        ratio_sigma,
        skew,
        skew_sigma,
    }
}

/// A record whose detection is known to this standard deviation, in expected units, of this version, and its checksum.
fn record_of(record: &[u8; CVG_RECORD_BYTES], sigma: f64, version: u8) -> [u8; CVG_RECORD_BYTES] {
    let mut changed = *record;
    changed[4] = version;
    // before the checksum stand three variances and three factors
    let factors = CVG_RECORD_BYTES - 4 - 6 * 8;
    for k in 0..3 {
        changed[factors + 8 * k..factors + 8 * k + 8].copy_from_slice(&(sigma * sigma).to_le_bytes());
    }
    let (body, tail) = changed.split_at_mut(CVG_RECORD_BYTES - 4);
    let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    let crc = !body.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step));
    tail.copy_from_slice(&crc.to_le_bytes());
    changed
}

#[test]
fn what_is_known_is_told_flag_by_flag() {
    let (c, mut l, rust, state) = both();
    // SAFETY: filled by the library
    let known = |l: &LearnedMemory| unsafe { cvg_calibrator_known(&raw const c, l) };
    assert_eq!(known(&l), asked(&rust, &state));
    assert!(!known(&l).detection_known);
    // a detection that was known when it was saved: known, and not followed by anything that turns
    let record = record_of(&saved(&c, &l), 0.01, saved(&c, &l)[4]);
    // SAFETY: filled by the library, and as many bytes as it reads
    assert_eq!(
        unsafe { cvg_calibrator_restore(&raw const c, &raw mut l, record.as_ptr()) },
        cvg_record::CVG_RECORD_RESTORED
    );
    let mut state = rust.restore(&record).expect("what was saved");
    assert_eq!(known(&l), asked(&rust, &state));
    assert!(known(&l).detection_known && !known(&l).detection_followed);
    // commands that grow and shrink by three, of no instrument: what was committed of them is taken back
    let taken_back = (0..200_000).find(|n| {
        let mut k = control(*n);
        let grown = if n / 1000 % 2 == 1 && *n > 60_000 { 3.0 } else { 1.0 };
        (k.v_qc, k.v_qs, k.quadrature) = (grown * k.v_qc, grown * k.v_qs, grown * k.quadrature);
        k.disturbed = false;
        let p = Pendulum { e: k.energy, q: k.quadrature, r: k.r, s: k.s, l: k.l };
        let commands = Commands { energy_v: k.v_as, precession_v: k.v_qs, quadrature_v: k.v_qc };
        rust.step(&mut state, &p, (k.cos, k.sin), &commands, Health::Operating);
        rust.status(&state).taken_back > 0
    });
    assert!(taken_back.is_some(), "{:?}", rust.status(&state));
    *learned(&mut l) = state;
    assert_eq!(known(&l), asked(&rust, &state));
    assert!(known(&l).taken_back > 0 && known(&l).learned);
}

fn saved(c: &CalibratorMemory, l: &LearnedMemory) -> [u8; CVG_RECORD_BYTES] {
    let mut record = [0; CVG_RECORD_BYTES];
    // SAFETY: filled by the library, and as many bytes as it writes
    assert!(unsafe { cvg_calibrator_save(c, l, record.as_mut_ptr()) });
    record
}

#[test]
fn records_are_restored_or_refused_by_their_fault() {
    let (c, mut l, rust, _) = both();
    let record = saved(&c, &l);
    let known = record_of(&record, 0.01, record[4]);
    *learned(&mut l) = rust.restore(&known).expect("what was saved");
    let mut damaged = record;
    damaged[CVG_RECORD_BYTES / 2] ^= 1;
    let refusals = [
        (damaged, cvg_record::CVG_RECORD_DAMAGED),
        (record_of(&record, 0.01, record[4] + 1), cvg_record::CVG_RECORD_OF_ANOTHER_VERSION),
        (record_of(&record, f64::NAN, record[4]), cvg_record::CVG_RECORD_IMPLAUSIBLE),
    ];
    let before = *learned(&mut l);
    for (refused, why) in refusals {
        // SAFETY: filled by the library, and as many bytes as it reads
        assert_eq!(unsafe { cvg_calibrator_restore(&raw const c, &raw mut l, refused.as_ptr()) }, why);
        assert!(*learned(&mut l) == before, "{why:?} has changed what was learned");
    }
    // SAFETY: the same
    assert_eq!(
        unsafe { cvg_calibrator_restore(&raw const c, &raw mut l, record.as_ptr()) },
        cvg_record::CVG_RECORD_RESTORED
    );
    assert!(*learned(&mut l) == rust.restore(&record).expect("what was saved"));
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
