//! … of the interface to C.

use super::{Fault, fault};

const CALIBRATOR_SAME_AS_RUST: (&str, &str) = ("cvg-capi", "calibrator_same_as_rust");
const SAME_AS_RUST: (&str, &str) = ("cvg-capi", "same_as_rust");

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "energy and quadrature of the default are exchanged in C",
        "capi/src/lib.rs",
        "energy: tuning(s.energy),\n        quadrature: tuning(s.quadrature),\n        phase: tuning(s.phase),\n        rate: tuning(s.rate),\n        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: core",
        "energy: tuning(s.quadrature),\n        quadrature: tuning(s.energy),\n        phase: tuning(s.phase),\n        rate: tuning(s.rate),\n        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: core",
        SAME_AS_RUST,
    ),
    fault(
        "the range of the converters is their limit in C",
        "capi/src/lib.rs",
        "        window: s.window,\n        adc_full_scale_v: s.adc_full_scale_v,\n        dac_limit_v: s.dac_limit_v,\n        readout_delay_s: s.readout_delay_s,\n        drive_delay_s: s.drive_delay_s,\n        amplitude_v: s.amplitude_v,\n        drive_per_s_v: s.drive_per_s_v,\n        energy: tuning(s.energy),\n        quadrature: tuning(s.quadrature),\n        phase: tuning(s.phase),\n        rate: tuning(s.rate),\n        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout",
        "        window: s.window,\n        adc_full_scale_v: s.dac_limit_v,\n        dac_limit_v: s.adc_full_scale_v,\n        readout_delay_s: s.readout_delay_s,\n        drive_delay_s: s.drive_delay_s,\n        amplitude_v: s.amplitude_v,\n        drive_per_s_v: s.drive_per_s_v,\n        energy: tuning(s.energy),\n        quadrature: tuning(s.quadrature),\n        phase: tuning(s.phase),\n        rate: tuning(s.rate),\n        hold_rad: s.hold_rad,\n        fastest_rad_s: s.fastest_rad_s,\n        detection_threshold_v: s.detection_threshold_v,\n        sweep_s: s.sweep_s,\n        readout: readout",
        SAME_AS_RUST,
    ),
    fault(
        "the commands in C are exchanged",
        "capi/src/lib.rs",
        "v_as: seen.v_as,\n        v_qc: seen.v_qc,",
        "v_as: seen.v_qc,\n        v_qc: seen.v_as,",
        SAME_AS_RUST,
    ),
    fault(
        "a dead channel is a stuck one in C",
        "capi/src/lib.rs",
        "Fault::DeadChannel => cvg_fault::CVG_DEAD_CHANNEL",
        "Fault::DeadChannel => cvg_fault::CVG_STUCK_CHANNEL",
        SAME_AS_RUST,
    ),
    fault(
        "an instrument of the drives' effects has those of the readout in C",
        "capi/src/lib.rs",
        "unsafe { effects(s.actuation, s.actuation_count) }?",
        "unsafe { effects(s.actuation, s.readout_count) }?",
        SAME_AS_RUST,
    ),
    fault(
        "what is valid is told of the window before in C",
        "capi/src/lib.rs",
        "let (dac_x, dac_y, status) = instrument.step(state, adc_x, adc_y);",
        "let before = state.status;\n    let (dac_x, dac_y, mut status) = instrument.step(state, adc_x, adc_y);\n    status.valid = before.valid;",
        SAME_AS_RUST,
    ),
    fault(
        "a record of another version is an implausible one in C",
        "capi/src/calibrator.rs",
        "Err(Refused::Version) => cvg_record::CVG_RECORD_OF_ANOTHER_VERSION",
        "Err(Refused::Version) => cvg_record::CVG_RECORD_IMPLAUSIBLE",
        CALIBRATOR_SAME_AS_RUST,
    ),
    fault(
        "a calibrator's damping is its drive in C",
        "capi/src/calibrator.rs",
        "        drive_per_s: s.drive_per_s,\n        damping_per_s: s.damping_per_s,\n        steps: s.steps,\n        precession_rad_s: s.precession_rad_s,\n        dither_rad_s: s.dither_rad_s,\n    });",
        "        drive_per_s: s.drive_per_s,\n        damping_per_s: s.drive_per_s,\n        steps: s.steps,\n        precession_rad_s: s.precession_rad_s,\n        dither_rad_s: s.dither_rad_s,\n    });",
        CALIBRATOR_SAME_AS_RUST,
    ),
    fault(
        "what is not rotation in C is of a disturbed control",
        "capi/src/calibrator.rs",
        "    let (Some((c, s)), Some(control)) = given else { return 0.0 };\n",
        "    let (Some((c, s)), Some(control)) = given else { return 0.0 };\n    if control.disturbed {\n        return 0.0;\n    }\n",
        CALIBRATOR_SAME_AS_RUST,
    ),
    fault(
        "a step of the learning in C has the direction of the one before",
        "capi/src/calibrator.rs",
        "        (k.cos, k.sin),\n",
        "        (k.cos, -k.sin),\n",
        CALIBRATOR_SAME_AS_RUST,
    ),
    fault(
        "a calibrator of no memory is told as one in C",
        "capi/src/calibrator.rs",
        "    if calibrator.is_null() || learned.is_null() {",
        "    if calibrator.is_null() {",
        CALIBRATOR_SAME_AS_RUST,
    ),
    fault(
        "an instrument's answer is at its limit in X alone in C",
        "capi/src/lib.rs",
        "        dac_x,\n        dac_y,\n        mode: mode(status.mode),",
        "        dac_x,\n        dac_y: dac_x,\n        mode: mode(status.mode),",
        SAME_AS_RUST,
    ),
];
