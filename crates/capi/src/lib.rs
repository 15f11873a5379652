//! The instrument and the [calibrator] for C, in single precision: `include/cvg.h` and a static library.
//!
//! The caller owns the memory: an instrument and a state are structures of fixed size without meaning outside, filled by
//! [`cvg_init`]. Nothing is allocated, nothing is kept between calls. A step takes what the converters read and gives what
//! they are to put out, whatever the bits of its input.
//!
//! This is the only crate for firmware with unsafe code: what it trusts the caller for stands at each function. A null
//! pointer is no undefined behaviour: it is refused, or answered with nothing.
#![cfg_attr(not(feature = "std"), no_std)]

pub mod calibrator;

use core::ffi::{CStr, c_char};
use core::mem::{align_of, size_of};

use cvg_instrument::{MOST_COMPENSATED, RequestedMode};
use cvg_model::effects::{EffectId, Values};

type Single = cvg_instrument::Instrument<f32>;
type SingleState = cvg_instrument::State<f32>;

/// Natural frequency ω_n/2π, Hz, and damping ratio of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Tuning {
    /// ω_n/2π, Hz
    pub bandwidth_hz: f64,
    /// ζ
    pub damping: f64,
}

/// An identified effect that is to be undone: its identifier in the library, as "detection-gain-mismatch", and its values.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Effect {
    /// identifier
    pub id: *const c_char,
    /// its parameters in the order of the library; 0 where it has fewer than four
    pub values: [f64; 4],
}

/// What an instrument is told of its device, its converters and its loops. Begin with cvg_settings_default.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Settings {
    /// nominal frequency of the resonator, Hz
    pub carrier_hz: f64,
    /// half the width of the band in which the resonator is searched, relative to the carrier
    pub band: f64,
    /// rate of the converters, Hz
    pub sample_hz: f64,
    /// samples from one control step to the next
    pub window: u16,
    /// the analogue-to-digital converters' range is ±this, V
    pub adc_full_scale_v: f64,
    /// no command of a digital-to-analogue converter is beyond ±this, V
    pub dac_limit_v: f64,
    /// from the vibration to the sample that shows it, s
    pub readout_delay_s: f64,
    /// from a sample to the output that is computed from it, s
    pub drive_delay_s: f64,
    /// set amplitude, V
    pub amplitude_v: f64,
    /// the envelope's rate per volt of drive, both at the converters, 1/s per V
    pub drive_per_s_v: f64,
    /// energy loop
    pub energy: Tuning,
    /// quadrature loop
    pub quadrature: Tuning,
    /// phase-locked loop
    pub phase: Tuning,
    /// rate loop
    pub rate: Tuning,
    /// the angle at which the pattern is held, rad
    pub hold_rad: f64,
    /// the fastest precession that is no jump, rad/s
    pub fastest_rad_s: f64,
    /// amplitude above which something vibrates, V
    pub detection_threshold_v: f64,
    /// time of the first sweep, s
    pub sweep_s: f64,
    /// readout effects that are undone: so many, up to CVG_MOST_COMPENSATED
    pub readout: *const Effect,
    /// how many
    pub readout_count: usize,
    /// actuation effects that are undone
    pub actuation: *const Effect,
    /// how many
    pub actuation_count: usize,
}

/// The most effects that are undone, of the readout and of the actuation each.
pub const CVG_MOST_COMPENSATED: usize = 4;

/// An instrument: immutable after cvg_init. Its content has no meaning outside.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct InstrumentMemory {
    content: [u64; 80],
}

/// What an instrument remembers from sample to sample. Its content has no meaning outside and must not be written.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct StateMemory {
    content: [u64; 48],
}

const _: () = assert!(
    size_of::<Single>() <= size_of::<InstrumentMemory>() && align_of::<Single>() <= align_of::<InstrumentMemory>()
);
const _: () = assert!(
    size_of::<SingleState>() <= size_of::<StateMemory>() && align_of::<SingleState>() <= align_of::<StateMemory>()
);
const _: () = assert!(CVG_MOST_COMPENSATED == MOST_COMPENSATED);

/// Why settings were refused: texts that are not ended by a zero, with their lengths; all zero where nothing was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Refusal {
    /// which parameter
    pub parameter: *const c_char,
    /// length of its name
    pub parameter_length: usize,
    /// what it has to be
    pub expected: *const c_char,
    /// length of that
    pub expected_length: usize,
}

/// What the instrument is doing: cvg_output.mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(non_camel_case_types, missing_docs, reason = "the names of C; each is the mode of its name in the library")]
pub enum cvg_mode {
    CVG_LISTEN,
    CVG_SWEEP,
    CVG_LOCK,
    CVG_SPIN_UP,
    CVG_WHOLE_ANGLE,
    CVG_HOLD,
    CVG_RING_DOWN,
    CVG_COAST,
    CVG_FAULT,
}

/// The fault it is in: cvg_output.fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(non_camel_case_types, missing_docs, reason = "the names of C; each is the fault of its name in the library")]
pub enum cvg_fault {
    CVG_NO_FAULT,
    CVG_INVALID_SAMPLES,
    CVG_STUCK_CHANNEL,
    CVG_SATURATED,
    CVG_DEAD_CHANNEL,
    CVG_NO_RESONANCE,
    CVG_NO_LOCK,
    CVG_NO_SPIN_UP,
    CVG_AMPLITUDE_HIGH,
    CVG_AMPLITUDE_LOW,
    CVG_QUADRATURE_HIGH,
}

/// What is wanted: an argument of cvg_request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(non_camel_case_types, missing_docs, reason = "the names of C; each is the mode of its name in the library")]
pub enum cvg_requested_mode {
    CVG_REQUEST_WHOLE_ANGLE,
    CVG_REQUEST_HOLD,
    CVG_REQUEST_RING_DOWN,
    CVG_REQUEST_OFF,
}

/// What a step answers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Output {
    /// X's next output, V: finite and within ±dac_limit_v
    pub dac_x: f32,
    /// Y's next output, V: likewise
    pub dac_y: f32,
    /// what the instrument is doing
    pub mode: cvg_mode,
    /// the fault it is in
    pub fault: cvg_fault,
    /// a control step was made with this sample: cvg_last_control is new
    pub fresh: bool,
    /// a sample of the last window was at the end of the converter's range
    pub clipped: bool,
    /// the last window had an envelope
    pub valid: bool,
    /// half turns may be lost: the angle is right up to a multiple of 180 degrees; until cvg_acknowledge_half_turns
    pub half_turns_lost: bool,
}

/// What was measured and commanded in the last control step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[repr(C)]
pub struct Seen {
    /// in-phase X of the readout, V
    pub x_c: f32,
    /// quadrature-phase X, V
    pub x_s: f32,
    /// in-phase Y, V
    pub y_c: f32,
    /// quadrature-phase Y, V
    pub y_s: f32,
    /// energy, with the readout effects undone, V²
    pub energy: f32,
    /// quadrature, likewise, V²
    pub quadrature: f32,
    /// energy loop's command, V
    pub v_as: f32,
    /// quadrature loop's command, V
    pub v_qc: f32,
    /// rate loop's command, V
    pub v_qs: f32,
    /// correction of the oscillator's frequency, rad/s
    pub correction_rad_s: f32,
}

const NOTHING: Output = Output {
    dac_x: 0.0,
    dac_y: 0.0,
    mode: cvg_mode::CVG_FAULT,
    fault: cvg_fault::CVG_INVALID_SAMPLES,
    fresh: false,
    clipped: false,
    valid: false,
    half_turns_lost: true,
};

/// Settings for a device at 15.2 kHz with converters at 100 kHz, without compensation.
#[unsafe(no_mangle)]
pub extern "C" fn cvg_settings_default() -> Settings {
    let s = cvg_instrument::Settings::default();
    let tuning = |t: cvg_instrument::Tuning| Tuning { bandwidth_hz: t.bandwidth_hz, damping: t.damping };
    Settings {
        carrier_hz: s.carrier_hz,
        band: s.band,
        sample_hz: s.sample_hz,
        window: s.window,
        adc_full_scale_v: s.adc_full_scale_v,
        dac_limit_v: s.dac_limit_v,
        readout_delay_s: s.readout_delay_s,
        drive_delay_s: s.drive_delay_s,
        amplitude_v: s.amplitude_v,
        drive_per_s_v: s.drive_per_s_v,
        energy: tuning(s.energy),
        quadrature: tuning(s.quadrature),
        phase: tuning(s.phase),
        rate: tuning(s.rate),
        hold_rad: s.hold_rad,
        fastest_rad_s: s.fastest_rad_s,
        detection_threshold_v: s.detection_threshold_v,
        sweep_s: s.sweep_s,
        readout: core::ptr::null(),
        readout_count: 0,
        actuation: core::ptr::null(),
        actuation_count: 0,
    }
}

impl Refusal {
    pub(crate) fn nothing() -> Self {
        let none = core::ptr::null();
        Self { parameter: none, parameter_length: 0, expected: none, expected_length: 0 }
    }
}

pub(crate) fn refused(parameter: &'static str, expected: &'static str) -> Refusal {
    Refusal {
        parameter: parameter.as_ptr().cast(),
        parameter_length: parameter.len(),
        expected: expected.as_ptr().cast(),
        expected_length: expected.len(),
    }
}

fn refusal(e: cvg_instrument::ConfigError) -> Refusal {
    refused(e.parameter, e.expected)
}

type Effects = [(EffectId, Values<f64>); MOST_COMPENSATED];

/// The effects as the library names them, and how many.
///
/// # Safety
/// `effects` points to `count` effects whose identifiers end with a zero, or either is null or 0.
unsafe fn effects(effects: *const Effect, count: usize) -> Result<(Effects, usize), cvg_instrument::ConfigError> {
    let refused = |expected| cvg_instrument::ConfigError { parameter: "effects", expected };
    let mut found = [(EffectId::DetectionGainMismatch, [0.0; 4]); MOST_COMPENSATED];
    if effects.is_null() || count == 0 {
        return Ok((found, 0));
    }
    if count > MOST_COMPENSATED {
        return Err(refused("no more than CVG_MOST_COMPENSATED"));
    }
    for (k, place) in found.iter_mut().take(count).enumerate() {
        // SAFETY: k < count, and the caller's promise
        let effect = unsafe { &*effects.add(k) };
        if effect.id.is_null() {
            return Err(refused("named"));
        }
        // SAFETY: the caller's promise
        let name = unsafe { CStr::from_ptr(effect.id) }.to_bytes();
        let id = EffectId::ALL.iter().find(|id| id.description().id.as_bytes() == name);
        *place = (*id.ok_or(refused("effects of the library"))?, effect.values);
    }
    Ok((found, count))
}

/// Fills `instrument` and `state` by `settings`; says what was refused, and leaves both as they were then.
///
/// # Safety
/// The pointers are null or point to such structures; the effects and their names are as they say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_init(
    instrument: *mut InstrumentMemory,
    state: *mut StateMemory,
    settings: *const Settings,
) -> Refusal {
    // SAFETY: the caller's promise
    let built = unsafe { built(settings) };
    match built {
        Err(e) => refusal(e),
        Ok(_) if instrument.is_null() || state.is_null() => {
            refusal(cvg_instrument::ConfigError { parameter: "instrument and state", expected: "not null" })
        }
        Ok(made) => {
            // SAFETY: not null, large enough and aligned (asserted above), and the caller's promise
            unsafe {
                state.cast::<SingleState>().write(made.start());
                instrument.cast::<Single>().write(made);
            }
            Refusal::nothing()
        }
    }
}

/// # Safety
/// That of [`cvg_init`].
unsafe fn built(settings: *const Settings) -> Result<Single, cvg_instrument::ConfigError> {
    if settings.is_null() {
        return Err(cvg_instrument::ConfigError { parameter: "settings", expected: "not null" });
    }
    // SAFETY: not null, and the caller's promise
    let s = unsafe { &*settings };
    // SAFETY: the caller's promise
    let (readout, read) = unsafe { effects(s.readout, s.readout_count) }?;
    // SAFETY: the caller's promise
    let (actuation, actuated) = unsafe { effects(s.actuation, s.actuation_count) }?;
    let tuning = |t: Tuning| cvg_instrument::Tuning { bandwidth_hz: t.bandwidth_hz, damping: t.damping };
    Single::new(&cvg_instrument::Settings {
        carrier_hz: s.carrier_hz,
        band: s.band,
        sample_hz: s.sample_hz,
        window: s.window,
        adc_full_scale_v: s.adc_full_scale_v,
        dac_limit_v: s.dac_limit_v,
        readout_delay_s: s.readout_delay_s,
        drive_delay_s: s.drive_delay_s,
        amplitude_v: s.amplitude_v,
        drive_per_s_v: s.drive_per_s_v,
        energy: tuning(s.energy),
        quadrature: tuning(s.quadrature),
        phase: tuning(s.phase),
        rate: tuning(s.rate),
        hold_rad: s.hold_rad,
        fastest_rad_s: s.fastest_rad_s,
        detection_threshold_v: s.detection_threshold_v,
        sweep_s: s.sweep_s,
        readout: readout.get(..read).unwrap_or_default(),
        actuation: actuation.get(..actuated).unwrap_or_default(),
    })
}

/// One sample: what the converters read, V; answers what they are to put out next, and a status.
///
/// Without an instrument or a state it answers zero volts and a fault.
///
/// # Safety
/// The pointers are null, or were filled by cvg_init and not written since but by the functions here.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_step(
    instrument: *const InstrumentMemory,
    state: *mut StateMemory,
    adc_x: f32,
    adc_y: f32,
) -> Output {
    // SAFETY: the caller's promise
    let (instrument, state) = unsafe { (instrument.cast::<Single>().as_ref(), state.cast::<SingleState>().as_mut()) };
    let (Some(instrument), Some(state)) = (instrument, state) else { return NOTHING };
    let (dac_x, dac_y, status) = instrument.step(state, adc_x, adc_y);
    Output {
        dac_x,
        dac_y,
        mode: mode(status.mode),
        fault: status.fault.map_or(cvg_fault::CVG_NO_FAULT, fault),
        fresh: status.fresh,
        clipped: status.clipped,
        valid: status.valid,
        half_turns_lost: status.half_turns_lost,
    }
}

fn mode(mode: cvg_instrument::Mode) -> cvg_mode {
    use cvg_instrument::Mode;
    match mode {
        Mode::Listen => cvg_mode::CVG_LISTEN,
        Mode::Sweep => cvg_mode::CVG_SWEEP,
        Mode::Lock => cvg_mode::CVG_LOCK,
        Mode::SpinUp => cvg_mode::CVG_SPIN_UP,
        Mode::WholeAngle => cvg_mode::CVG_WHOLE_ANGLE,
        Mode::Hold => cvg_mode::CVG_HOLD,
        Mode::RingDown => cvg_mode::CVG_RING_DOWN,
        Mode::Coast => cvg_mode::CVG_COAST,
        Mode::Fault => cvg_mode::CVG_FAULT,
    }
}

fn fault(fault: cvg_instrument::Fault) -> cvg_fault {
    use cvg_instrument::Fault;
    match fault {
        Fault::InvalidSamples => cvg_fault::CVG_INVALID_SAMPLES,
        Fault::StuckChannel => cvg_fault::CVG_STUCK_CHANNEL,
        Fault::Saturated => cvg_fault::CVG_SATURATED,
        Fault::DeadChannel => cvg_fault::CVG_DEAD_CHANNEL,
        Fault::NoResonance => cvg_fault::CVG_NO_RESONANCE,
        Fault::NoLock => cvg_fault::CVG_NO_LOCK,
        Fault::NoSpinUp => cvg_fault::CVG_NO_SPIN_UP,
        Fault::AmplitudeHigh => cvg_fault::CVG_AMPLITUDE_HIGH,
        Fault::AmplitudeLow => cvg_fault::CVG_AMPLITUDE_LOW,
        Fault::QuadratureHigh => cvg_fault::CVG_QUADRATURE_HIGH,
    }
}

/// What is wanted from the next control step on, of enum cvg_requested_mode; false where there is no such mode.
///
/// # Safety
/// That of cvg_step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_request(state: *mut StateMemory, requested: u8) -> bool {
    // SAFETY: the caller's promise
    let Some(state) = (unsafe { state.cast::<SingleState>().as_mut() }) else { return false };
    let requests = [RequestedMode::WholeAngle, RequestedMode::Hold, RequestedMode::RingDown, RequestedMode::Off];
    let Some(requested) = requests.get(usize::from(requested)) else { return false };
    state.request(*requested);
    true
}

/// Takes back that half turns may be lost: whoever reads the angle has set it right, or does not need it.
///
/// # Safety
/// That of cvg_step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_acknowledge_half_turns(state: *mut StateMemory) {
    // SAFETY: the caller's promise
    if let Some(state) = unsafe { state.cast::<SingleState>().as_mut() } {
        state.acknowledge_half_turns();
    }
}

/// The unwrapped pattern angle at the middle of the last window, degrees; 0 without a state.
///
/// # Safety
/// That of cvg_step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_angle_deg(state: *const StateMemory) -> f64 {
    // SAFETY: the caller's promise
    unsafe { state.cast::<SingleState>().as_ref() }.map_or(0.0, SingleState::angle_deg)
}

/// What was measured and commanded in the last control step; zeros without a state.
///
/// # Safety
/// That of cvg_step.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn cvg_last_control(state: *const StateMemory) -> Seen {
    // SAFETY: the caller's promise
    let Some(state) = (unsafe { state.cast::<SingleState>().as_ref() }) else { return Seen::default() };
    let (seen, p) = (&state.seen, state.seen.compensated.pendulum());
    Seen {
        x_c: seen.readout.x_c,
        x_s: seen.readout.x_s,
        y_c: seen.readout.y_c,
        y_s: seen.readout.y_s,
        energy: p.e,
        quadrature: p.q,
        v_as: seen.v_as,
        v_qc: seen.v_qc,
        v_qs: seen.v_qs,
        correction_rad_s: seen.correction_rad_s,
    }
}

#[cfg(not(feature = "std"))]
#[panic_handler]
fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
