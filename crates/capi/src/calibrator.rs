//! The calibrator for C: what a control step of one's own loops calls.

use core::mem::{align_of, size_of};

use cvg_calibrator::record::{BYTES, Refused};
use cvg_calibrator::{Calibrator, Commands, Health, Parameter, State};
use cvg_model::{AxisForces, Envelope, Pendulum};

use crate::{Refusal, refused};

type Single = Calibrator<f32>;
type SingleState = State<f32>;

/// What a calibrator is told of its instrument. Begin with cvg_calibrator_settings_default.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct CalibratorSettings {
    /// control period, s
    pub control_s: f64,
    /// set amplitude, V
    pub amplitude_v: f64,
    /// rate of the envelope that a volt of command makes, V/s
    pub drive_per_s: f64,
    /// 1/tau as designed, 1/s
    pub damping_per_s: f64,
    /// control steps to a cycle of the filter: at least 80, and 10 to 100 ms
    pub steps: u16,
    /// fastest precession that may be commanded at rest, rad/s
    pub precession_rad_s: f64,
    /// precession that may be commanded, to and fro, while the instrument turns, rad/s
    pub dither_rad_s: f64,
}

/// A calibrator: immutable after cvg_calibrator_init. Its content has no meaning outside.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CalibratorMemory {
    content: [u64; 8],
}

/// What a calibrator has learned. Its content has no meaning outside and must not be written.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct LearnedMemory {
    content: [u64; 256],
}

const _: () = assert!(
    size_of::<Single>() <= size_of::<CalibratorMemory>() && align_of::<Single>() <= align_of::<CalibratorMemory>()
);
const _: () = assert!(
    size_of::<SingleState>() <= size_of::<LearnedMemory>() && align_of::<SingleState>() <= align_of::<LearnedMemory>()
);

/// Bytes of what cvg_calibrator_save writes.
pub const CVG_RECORD_BYTES: usize = 308;
const _: () = assert!(CVG_RECORD_BYTES == BYTES);

/// Both channels, in phase and in quadrature: an envelope, V, or forces, V.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Four {
    /// X in phase
    pub x_c: f32,
    /// X in quadrature
    pub x_s: f32,
    /// Y in phase
    pub y_c: f32,
    /// Y in quadrature
    pub y_s: f32,
}

/// What a control step measured behind cvg_calibrator_readout, and what it commands before cvg_calibrator_drives.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Control {
    /// E, V²
    pub energy: f32,
    /// Q, V²
    pub quadrature: f32,
    /// R, V²
    pub r: f32,
    /// S, V²
    pub s: f32,
    /// L, V²
    pub l: f32,
    /// cosine of the pattern's angle, its sign continuous
    pub cos: f32,
    /// sine likewise
    pub sin: f32,
    /// energy loop's command, V
    pub v_as: f32,
    /// rate loop's command, V
    pub v_qs: f32,
    /// quadrature loop's command, V
    pub v_qc: f32,
    /// start-up, a fault, a command or a reading at its limit: nothing is learned from this step
    pub disturbed: bool,
}

/// What to add to the commands of the loops.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[repr(C)]
pub struct Added {
    /// to v_qs, V: the virtual precession
    pub v_qs: f32,
    /// to v_qc, V: holds the split
    pub v_qc: f32,
    /// to the oscillator's frequency, rad/s
    pub detuning_rad_s: f32,
}

/// What is known.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[repr(C)]
pub struct Known {
    /// the coarse stages are over
    pub learned: bool,
    /// ratio and skew of the detection have been told
    pub detection_known: bool,
    /// rotation tells the detection as it is now
    pub detection_followed: bool,
    /// standard deviation of the bias that ratio and skew may still make, rad
    pub bias_rad: f32,
    /// commits that were taken back
    pub taken_back: u16,
    /// ratio of the detection less one, and its standard deviation
    pub ratio: f32,
    /// standard deviation of it
    pub ratio_sigma: f32,
    /// skew of the detection
    pub skew: f32,
    /// standard deviation of it
    pub skew_sigma: f32,
}

/// What became of a record: the answer of cvg_calibrator_restore.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(non_camel_case_types, missing_docs, reason = "the names of C; each is the refusal of its name in the library")]
pub enum cvg_record {
    CVG_RECORD_RESTORED,
    CVG_RECORD_DAMAGED,
    CVG_RECORD_OF_ANOTHER_VERSION,
    CVG_RECORD_IMPLAUSIBLE,
    CVG_RECORD_NULL,
}

/// Settings for loops at 2 kHz and an amplitude of 1 V.
#[unsafe(no_mangle)]
pub extern "C" fn cvg_calibrator_settings_default() -> CalibratorSettings {
    let s = cvg_calibrator::Settings::default();
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

/// Fills `calibrator` and `learned` by `settings`, nothing learned; says what was refused, and leaves both as they were then.
///
/// # Safety
/// The pointers are null or point to such structures.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_init(
    calibrator: *mut CalibratorMemory,
    learned: *mut LearnedMemory,
    settings: *const CalibratorSettings,
) -> Refusal {
    // SAFETY: the caller's promise
    let Some(s) = (unsafe { settings.as_ref() }) else { return refused("settings", "not null") };
    if calibrator.is_null() || learned.is_null() {
        return refused("calibrator and learned", "not null");
    }
    let made = Single::new(&cvg_calibrator::Settings {
        control_s: s.control_s,
        amplitude_v: s.amplitude_v,
        drive_per_s: s.drive_per_s,
        damping_per_s: s.damping_per_s,
        steps: s.steps,
        precession_rad_s: s.precession_rad_s,
        dither_rad_s: s.dither_rad_s,
    });
    match made {
        Err(e) => refused(e.parameter, e.expected),
        Ok(made) => {
            // SAFETY: not null, large enough and aligned (asserted above), and the caller's promise
            unsafe {
                learned.cast::<SingleState>().write(made.start());
                calibrator.cast::<Single>().write(made);
            }
            Refusal::nothing()
        }
    }
}

/// # Safety
/// The pointers are null, or were filled by cvg_calibrator_init and not written since but by the functions here.
unsafe fn both<'a>(
    calibrator: *const CalibratorMemory,
    learned: *const LearnedMemory,
) -> Option<(&'a Single, &'a SingleState)> {
    // SAFETY: the caller's promise
    unsafe { calibrator.cast::<Single>().as_ref().zip(learned.cast::<SingleState>().as_ref()) }
}

/// The readout undone, as far as it is known; the readout itself without a calibrator.
///
/// # Safety
/// The pointers are null, or were filled by cvg_calibrator_init and not written since but by the functions here.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_readout(
    calibrator: *const CalibratorMemory,
    learned: *const LearnedMemory,
    envelope: Four,
) -> Four {
    // SAFETY: the caller's promise
    let Some((c, s)) = (unsafe { both(calibrator, learned) }) else { return envelope };
    let e = c.readout(s, &Envelope::new(envelope.x_c, envelope.x_s, envelope.y_c, envelope.y_s));
    Four { x_c: e.x_c, x_s: e.x_s, y_c: e.y_c, y_s: e.y_s }
}

/// What to add to the commands of the loops, for a pattern along (cos, sin) of this amplitude, V; zeros without a calibrator.
///
/// # Safety
/// That of cvg_calibrator_readout.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_forward(
    calibrator: *const CalibratorMemory,
    learned: *const LearnedMemory,
    cos: f32,
    sin: f32,
    amplitude_v: f32,
) -> Added {
    // SAFETY: the caller's promise
    let Some((c, s)) = (unsafe { both(calibrator, learned) }) else { return Added::default() };
    let f = c.forward(s, cos, sin, amplitude_v);
    Added { v_qs: f.precession_v, v_qc: f.quadrature_v, detuning_rad_s: f.detuning_rad_s }
}

/// The drives undone: what to command for these forces, V; the forces themselves without a calibrator.
///
/// # Safety
/// That of cvg_calibrator_readout.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_drives(
    calibrator: *const CalibratorMemory,
    learned: *const LearnedMemory,
    forces: Four,
) -> Four {
    // SAFETY: the caller's promise
    let Some((c, s)) = (unsafe { both(calibrator, learned) }) else { return forces };
    let wanted = AxisForces { x_c: forces.x_c, x_s: forces.x_s, y_c: forces.y_c, y_s: forces.y_s };
    let f = c.drives(s, &wanted);
    Four { x_c: f.x_c, x_s: f.x_s, y_c: f.y_c, y_s: f.y_s }
}

fn parts(control: &Control) -> (Pendulum<f32>, (f32, f32), Commands<f32>) {
    let k = control;
    (
        Pendulum { e: k.energy, q: k.quadrature, r: k.r, s: k.s, l: k.l },
        (k.cos, k.sin),
        Commands { energy_v: k.v_as, precession_v: k.v_qs, quadrature_v: k.v_qc },
    )
}

/// One control step of the learning.
///
/// # Safety
/// That of cvg_calibrator_readout; `control` is null or points to such a structure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_step(
    calibrator: *const CalibratorMemory,
    learned: *mut LearnedMemory,
    control: *const Control,
) {
    // SAFETY: the caller's promise
    let given =
        unsafe { (calibrator.cast::<Single>().as_ref(), learned.cast::<SingleState>().as_mut(), control.as_ref()) };
    let (Some(c), Some(s), Some(control)) = given else { return };
    let (p, direction, commands) = parts(control);
    let health = if control.disturbed { Health::Disturbed } else { Health::Operating };
    c.step(s, &p, direction, &commands, health);
}

/// The rate of the pattern that is not rotation, rad/s, as far as it is known; 0 without a calibrator.
///
/// # Safety
/// That of cvg_calibrator_step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_not_rotation(
    calibrator: *const CalibratorMemory,
    learned: *const LearnedMemory,
    control: *const Control,
) -> f32 {
    // SAFETY: the caller's promise
    let given = unsafe { (both(calibrator, learned), control.as_ref()) };
    let (Some((c, s)), Some(control)) = given else { return 0.0 };
    let (p, direction, commands) = parts(control);
    c.not_rotation(s, &p, direction, &commands)
}

/// A tuning electrode has changed the split.
///
/// # Safety
/// That of cvg_calibrator_readout.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_split_changed(
    calibrator: *const CalibratorMemory,
    learned: *mut LearnedMemory,
) {
    // SAFETY: the caller's promise
    let given = unsafe { (calibrator.cast::<Single>().as_ref(), learned.cast::<SingleState>().as_mut()) };
    if let (Some(c), Some(s)) = given {
        c.split_changed(s);
    }
}

/// What is known; nothing without a calibrator.
///
/// # Safety
/// That of cvg_calibrator_readout.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_known(
    calibrator: *const CalibratorMemory,
    learned: *const LearnedMemory,
) -> Known {
    // SAFETY: the caller's promise
    let Some((c, s)) = (unsafe { both(calibrator, learned) }) else { return Known::default() };
    let status = c.status(s);
    let estimate = |p| s.estimate(p).map_or((0.0, 0.0), |e| (e.value, e.sigma));
    let ((ratio, ratio_sigma), (skew, skew_sigma)) =
        (estimate(Parameter::DetectionRatio), estimate(Parameter::DetectionSkew));
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

/// Writes what was learned to `record`, CVG_RECORD_BYTES of it; false without a calibrator.
///
/// # Safety
/// That of cvg_calibrator_readout; `record` is null or points to CVG_RECORD_BYTES.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_save(
    calibrator: *const CalibratorMemory,
    learned: *const LearnedMemory,
    record: *mut u8,
) -> bool {
    // SAFETY: the caller's promise
    let given = unsafe { (both(calibrator, learned), record.cast::<[u8; BYTES]>().as_mut()) };
    let (Some((c, s)), Some(record)) = given else { return false };
    *record = c.save(s);
    true
}

/// Starts `learned` anew from a record; one that is refused leaves it as it was.
///
/// # Safety
/// That of cvg_calibrator_save.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_calibrator_restore(
    calibrator: *const CalibratorMemory,
    learned: *mut LearnedMemory,
    record: *const u8,
) -> cvg_record {
    // SAFETY: the caller's promise
    let given = unsafe {
        (
            calibrator.cast::<Single>().as_ref(),
            learned.cast::<SingleState>().as_mut(),
            record.cast::<[u8; BYTES]>().as_ref(),
        )
    };
    let (Some(c), Some(s), Some(record)) = given else { return cvg_record::CVG_RECORD_NULL };
    match c.restore(record) {
        Ok(restored) => {
            *s = restored;
            cvg_record::CVG_RECORD_RESTORED
        }
        Err(Refused::Damaged) => cvg_record::CVG_RECORD_DAMAGED,
        Err(Refused::Version) => cvg_record::CVG_RECORD_OF_ANOTHER_VERSION,
        Err(Refused::Implausible) => cvg_record::CVG_RECORD_IMPLAUSIBLE,
    }
}
