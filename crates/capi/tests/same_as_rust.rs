//! What C is given is what Rust is given: every setting, output, mode, fault and requested mode, field by field; and nothing where
//! C gives nothing.
#![allow(unsafe_code, reason = "the interface is C's")]

use std::ffi::CString;
use std::ptr::{null, null_mut};

use cvg::{
    Effect, InstrumentMemory, Output, Settings, StateMemory, Tuning, cvg_acknowledge_half_turns, cvg_angle_deg,
    cvg_init, cvg_last_control, cvg_request, cvg_settings_default, cvg_step,
};
use cvg_instrument::{Fault, Instrument, Mode, RequestedMode, State, Status};
use cvg_model::effects::EffectId;

type Rust = cvg_instrument::Settings<'static>;

const READOUT: &[(EffectId, [f64; 4])] =
    &[(EffectId::DetectionGainMismatch, [1.0132, 0.0, 0.0, 0.0]), (EffectId::DetectionOffset, [0.01, -0.02, 0.0, 0.0])];
const ACTUATION: &[(EffectId, [f64; 4])] = &[(EffectId::ActuationGainMismatch, [1.0113, 0.0, 0.0, 0.0])];

/// An instrument and its state as C has them.
struct Of {
    instrument: InstrumentMemory,
    state: StateMemory,
}

impl Of {
    /// What is built, or the parameter that is refused and what it has to be.
    fn settings(settings: &Settings) -> Result<Self, [String; 2]> {
        // SAFETY: both are arrays of integers
        let mut of = unsafe { Self { instrument: std::mem::zeroed(), state: std::mem::zeroed() } };
        // SAFETY: they are such structures
        let said = unsafe { cvg_init(&raw mut of.instrument, &raw mut of.state, settings) };
        if said.parameter_length == 0 {
            return Ok(of);
        }
        Err([(said.parameter, said.parameter_length), (said.expected, said.expected_length)].map(|(text, length)| {
            // SAFETY: a text of that length
            let text = unsafe { std::slice::from_raw_parts(text.cast::<u8>(), length) };
            String::from_utf8_lossy(text).into_owned()
        }))
    }

    fn step(&mut self, x: f32, y: f32) -> Output {
        // SAFETY: filled by `cvg_init`
        unsafe { cvg_step(&raw const self.instrument, &raw mut self.state, x, y) }
    }

    fn instrument(&self) -> &Instrument<f32> {
        // SAFETY: what `cvg_init` has written there
        unsafe { &*(&raw const self.instrument).cast::<Instrument<f32>>() }
    }

    fn state(&mut self) -> &mut State<f32> {
        // SAFETY: what `cvg_init` has written there
        unsafe { &mut *(&raw mut self.state).cast::<State<f32>>() }
    }
}

fn tuning(t: cvg_instrument::Tuning) -> Tuning {
    Tuning { bandwidth_hz: t.bandwidth_hz, damping: t.damping }
}

/// The same settings for C, without effects.
fn in_c(s: &Rust) -> Settings {
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
        readout: null(),
        readout_count: 0,
        actuation: null(),
        actuation_count: 0,
    }
}

/// Every setting other than by default, and other than every other.
fn uncommon() -> Rust {
    let tuning = |bandwidth_hz, damping| cvg_instrument::Tuning { bandwidth_hz, damping };
    Rust {
        carrier_hz: 14_100.0,
        band: 0.021,
        sample_hz: 98_000.0,
        window: 47,
        adc_full_scale_v: 2.4,
        dac_limit_v: 9.0,
        readout_delay_s: 2e-6,
        drive_delay_s: 7e-6,
        amplitude_v: 0.9,
        drive_per_s_v: 1.1,
        energy: tuning(2.2, 0.71),
        quadrature: tuning(5.3, 0.72),
        phase: tuning(19.0, 1.05),
        rate: tuning(2.4, 0.95),
        hold_rad: 0.2,
        fastest_rad_s: 33.0,
        detection_threshold_v: 0.03,
        sweep_s: 0.3,
        readout: READOUT,
        actuation: ACTUATION,
    }
}

/// `CVG_WHOLE_ANGLE` for `WholeAngle`.
fn alike(c: &dyn std::fmt::Debug, rust: &dyn std::fmt::Debug) -> bool {
    format!("{c:?}").trim_start_matches("CVG_").replace('_', "").to_lowercase() == format!("{rust:?}").to_lowercase()
}

fn assert_same(c: &Output, (x, y, status): (f32, f32, Status)) {
    assert_eq!((c.dac_x.to_bits(), c.dac_y.to_bits()), (x.to_bits(), y.to_bits()));
    assert!(alike(&c.mode, &status.mode), "{:?} for {:?}", c.mode, status.mode);
    match status.fault {
        Some(fault) => assert!(alike(&c.fault, &fault), "{:?} for {fault:?}", c.fault),
        None => assert!(alike(&c.fault, &"NoFault") || format!("{:?}", c.fault) == "CVG_NO_FAULT"),
    }
    let flags = (status.fresh, status.clipped, status.valid, status.half_turns_lost);
    assert_eq!((c.fresh, c.clipped, c.valid, c.half_turns_lost), flags);
}

/// Both, with effects, by the same settings.
fn both() -> (Of, Instrument<f32>, State<f32>) {
    let settings = uncommon();
    let names = ["detection-gain-mismatch", "detection-offset", "actuation-gain-mismatch"]
        .map(|name| CString::new(name).expect("no zero"));
    let of = |n: usize, (_, values): (EffectId, [f64; 4])| Effect { id: names[n].as_ptr(), values };
    let effects = [of(0, READOUT[0]), of(1, READOUT[1]), of(2, ACTUATION[0])];
    let c = Settings {
        readout: &raw const effects[0],
        readout_count: 2,
        actuation: &raw const effects[2],
        actuation_count: 1,
        ..in_c(&settings)
    };
    let instrument = Instrument::new(&settings).expect("inside its domain");
    let state = instrument.start();
    (Of::settings(&c).expect("inside its domain"), instrument, state)
}

/// A line that vibrates, a little beside the carrier, and turns.
fn sample(n: u32) -> (f32, f32) {
    let t = f64::from(n) / 98_000.0;
    let (phase, theta) = (std::f64::consts::TAU * 14_105.0 * t, 0.4 + 3.0 * t);
    ((0.9 * theta.cos() * phase.cos()) as f32, (0.9 * theta.sin() * phase.cos()) as f32)
}

#[test]
fn c_is_given_what_rust_is_given_through_a_start_and_faults() {
    let (mut of, instrument, mut state) = both();
    let mut seen = std::collections::BTreeSet::new();
    for n in 0..98_000_u32 {
        let (mut x, y) = sample(n);
        // no number for a while, then beyond the range, then nothing that changes
        match n / 4900 {
            8 => x = f32::NAN,
            12 => x = 3.0,
            _ => {}
        }
        let c = of.step(x, y);
        assert_same(&c, instrument.step(&mut state, x, y));
        seen.insert(format!("{:?}", c.mode));
        // SAFETY: filled by `cvg_init`
        assert_eq!(unsafe { cvg_angle_deg(&raw const of.state) }.to_bits(), state.angle_deg().to_bits());
        if c.fresh && n > 9800 {
            // SAFETY: filled by `cvg_init`
            let k = unsafe { cvg_last_control(&raw const of.state) };
            let (s, p) = (state.seen, state.seen.compensated.pendulum());
            let given =
                [k.x_c, k.x_s, k.y_c, k.y_s, k.energy, k.quadrature, k.v_as, k.v_qc, k.v_qs, k.correction_rad_s];
            let r = s.readout;
            let asked = [r.x_c, r.x_s, r.y_c, r.y_s, p.e, p.q, s.v_as, s.v_qc, s.v_qs, s.correction_rad_s];
            assert_eq!(given.map(f32::to_bits), asked.map(f32::to_bits));
        }
    }
    assert_eq!(*of.state(), state);
    assert!(seen.len() >= 4, "{seen:?}");
}

#[test]
fn the_instrument_is_that_of_every_setting_and_of_as_many_effects_as_there_is_room_for() {
    let (of, instrument, _) = both();
    assert_eq!(*of.instrument(), instrument);
    // four of each, with as many values as an effect has, in their order
    let readout = [
        (EffectId::DetectionGainMismatch, [1.0132, 0.0, 0.0, 0.0]),
        (EffectId::DetectionOffset, [0.01, -0.02, 0.0, 0.0]),
        (EffectId::DriveFeedthrough, [0.001, -0.002, 0.003, -0.004]),
        (EffectId::HarmonicN, [4.0, 2e-3, -1e-3, 2.0]),
    ];
    let actuation = [
        (EffectId::ActuationGainMismatch, [1.0113, 0.0, 0.0, 0.0]),
        (EffectId::ActuationSkew, [0.02, 0.0, 0.0, 0.0]),
        (EffectId::ActuationGainMismatch, [0.98, 0.0, 0.0, 0.0]),
        (EffectId::ActuationSkew, [-0.01, 0.0, 0.0, 0.0]),
    ];
    let named = |effects: [(EffectId, [f64; 4]); 4]| {
        effects.map(|(id, values)| (CString::new(id.description().id).expect("no zero"), values))
    };
    let (read, actuated) = (named(readout), named(actuation));
    let of_names = |named: &[(CString, [f64; 4]); 4]| {
        [0, 1, 2, 3].map(|n: usize| Effect { id: named[n].0.as_ptr(), values: named[n].1 })
    };
    let (c_readout, c_actuation) = (of_names(&read), of_names(&actuated));
    let base = Rust::default();
    let settings = Settings {
        readout: c_readout.as_ptr(),
        readout_count: 4,
        actuation: c_actuation.as_ptr(),
        actuation_count: 4,
        ..in_c(&base)
    };
    let of = Of::settings(&settings).expect("inside its domain");
    let rust = cvg_instrument::Settings { readout: &readout, actuation: &actuation, ..base };
    assert_eq!(*of.instrument(), Instrument::new(&rust).expect("inside its domain"));
}

#[test]
fn what_was_seen_is_told_field_by_field() {
    let mut of = both().0;
    let seen = cvg_instrument::Seen {
        readout: cvg_model::Envelope::new(0.1, 0.2, 0.3, 0.4),
        compensated: cvg_model::Envelope::new(0.5, 0.7, 1.1, 1.3),
        v_as: 2.0,
        v_qc: 3.0,
        v_qs: 4.0,
        correction_rad_s: 5.0,
    };
    of.state().seen = seen;
    of.state().precession.half_turns = 3;
    // SAFETY: filled by `cvg_init`
    let (told, angle_deg) = unsafe { (cvg_last_control(&raw const of.state), cvg_angle_deg(&raw const of.state)) };
    let p = seen.compensated.pendulum();
    let asked = cvg::Seen {
        x_c: 0.1,
        x_s: 0.2,
        y_c: 0.3,
        y_s: 0.4,
        energy: p.e,
        quadrature: p.q,
        v_as: 2.0,
        v_qc: 3.0,
        v_qs: 4.0,
        correction_rad_s: 5.0,
    };
    assert_eq!(told, asked);
    assert_eq!(angle_deg, of.state().angle_deg());
    assert!(angle_deg > 360.0, "with its half turns: {angle_deg}");
}

#[test]
fn every_mode_and_every_fault_has_its_name() {
    let modes = [
        Mode::Listen,
        Mode::Sweep,
        Mode::Lock,
        Mode::SpinUp,
        Mode::WholeAngle,
        Mode::Hold,
        Mode::RingDown,
        Mode::Coast,
        Mode::Fault,
    ];
    let faults = [
        Fault::InvalidSamples,
        Fault::StuckChannel,
        Fault::Saturated,
        Fault::DeadChannel,
        Fault::NoResonance,
        Fault::NoLock,
        Fault::NoSpinUp,
        Fault::AmplitudeHigh,
        Fault::AmplitudeLow,
        Fault::QuadratureHigh,
    ];
    let (mut of, instrument, mut state) = both();
    for mode in modes {
        for fault in faults.map(Some).into_iter().chain([None]) {
            for state in [of.state(), &mut state] {
                (state.status.mode, state.status.fault) = (mode, fault);
                state.window.count = 0;
                (state.status.clipped, state.status.valid) = (mode == Mode::Hold, mode == Mode::Lock);
                state.status.half_turns_lost = mode == Mode::Sweep;
            }
            assert_same(&of.step(0.1, 0.2), instrument.step(&mut state, 0.1, 0.2));
        }
    }
}

#[test]
fn requests_are_those_of_their_number_and_others_are_refused() {
    let (mut of, ..) = both();
    for (n, requested) in [
        (3, RequestedMode::Off),
        (1, RequestedMode::Hold),
        (2, RequestedMode::RingDown),
        (0, RequestedMode::WholeAngle),
    ] {
        // SAFETY: filled by `cvg_init`
        assert!(unsafe { cvg_request(&raw mut of.state, n) });
        assert_eq!(of.state().supervisor.requested, requested);
    }
    of.state().supervisor.requested = RequestedMode::Hold;
    for n in 4..=u8::MAX {
        // SAFETY: filled by `cvg_init`
        assert!(!unsafe { cvg_request(&raw mut of.state, n) }, "{n}");
    }
    assert_eq!(of.state().supervisor.requested, RequestedMode::Hold);
    (of.state().continuity.lost, of.state().status.half_turns_lost) = (true, true);
    // SAFETY: filled by `cvg_init`
    unsafe { cvg_acknowledge_half_turns(&raw mut of.state) };
    assert!(!of.state().continuity.lost && !of.state().status.half_turns_lost);
}

#[test]
fn defaults_are_those_of_rust() {
    assert_eq!(cvg_settings_default(), in_c(&Rust::default()));
}

#[test]
fn nothing_is_answered_with_nothing() {
    let settings = in_c(&Rust::default());
    let mut of = Of::settings(&settings).expect("inside its domain");
    let (before, instrument) = (*of.state(), *of.instrument());
    // SAFETY: null is admitted everywhere
    unsafe {
        for out in [
            cvg_step(null(), &raw mut of.state, 0.5, 0.5),
            cvg_step(&raw const of.instrument, null_mut(), 0.5, 0.5),
            cvg_step(null(), null_mut(), 0.5, 0.5),
        ] {
            assert_eq!((out.dac_x, out.dac_y, out.valid, out.fresh), (0.0, 0.0, false, false));
            // of an instrument that is not there nobody knows the half turns
            assert_eq!((out.clipped, out.half_turns_lost), (false, true));
            assert!(alike(&out.mode, &Mode::Fault) && alike(&out.fault, &Fault::InvalidSamples));
        }
        assert!(!cvg_request(null_mut(), 0));
        cvg_acknowledge_half_turns(null_mut());
        assert_eq!(cvg_angle_deg(null()), 0.0);
        assert_eq!(cvg_last_control(null()), cvg::Seen::default());
        assert!(cvg_init(&raw mut of.instrument, &raw mut of.state, null()).parameter_length > 0);
        assert!(cvg_init(null_mut(), &raw mut of.state, &raw const settings).parameter_length > 0);
        assert!(cvg_init(&raw mut of.instrument, null_mut(), &raw const settings).parameter_length > 0);
    }
    assert_eq!(*of.state(), before, "what was refused has changed the state");
    let refused = Settings { window: 0, ..settings };
    // SAFETY: they are such structures
    assert!(unsafe { cvg_init(&raw mut of.instrument, &raw mut of.state, &raw const refused) }.parameter_length > 0);
    assert_eq!((*of.state(), *of.instrument()), (before, instrument), "what was refused has changed something");
}

#[test]
fn what_rust_refuses_c_is_refused_with_its_name() {
    let of = |change: fn(&mut Rust)| {
        let mut settings = Rust::default();
        change(&mut settings);
        let rust = Instrument::<f32>::new(&settings).expect_err("outside its domain");
        assert_eq!(Of::settings(&in_c(&settings)).err(), Some([rust.parameter, rust.expected].map(str::to_owned)));
    };
    of(|s| s.dac_limit_v = f64::NAN);
    of(|s| s.window = 0);
    of(|s| s.amplitude_v = 1e9);
    // what acts through a sum alone is told apart by its name
    of(|s| s.readout_delay_s = -1e-6);
    of(|s| s.drive_delay_s = -1e-6);
    // a name is the whole of it
    let names = ["no-such-effect", "detection-skew-and-more", "detection-ske", ""];
    let [name, others @ ..] = names.map(|name| CString::new(name).expect("no zero"));
    for name in [&name].into_iter().chain(&others) {
        let effect = Effect { id: name.as_ptr(), values: [0.0; 4] };
        let settings = Settings { readout: &raw const effect, readout_count: 1, ..in_c(&Rust::default()) };
        let refused = ["effects", "effects of the library"].map(str::to_owned);
        assert_eq!(Of::settings(&settings).err(), Some(refused), "{name:?}");
    }
    let effect = Effect { id: name.as_ptr(), values: [0.0; 4] };
    let settings = Settings { readout: &raw const effect, readout_count: 5, ..in_c(&Rust::default()) };
    Of::settings(&settings).map(|_| ()).expect_err("more than there is room for");
    let nameless = Effect { id: null(), values: [0.0; 4] };
    let settings = Settings { readout: &raw const nameless, readout_count: 1, ..in_c(&Rust::default()) };
    let refused = ["effects", "named"].map(str::to_owned);
    assert_eq!(Of::settings(&settings).err(), Some(refused), "an effect has a name");
    // none where nothing is pointed to, whatever is counted, and where nothing is counted
    for (readout, readout_count) in [(null(), 2), (&raw const nameless, 0)] {
        let of = Of::settings(&Settings { readout, readout_count, ..in_c(&Rust::default()) }).expect("no effects");
        assert_eq!(*of.instrument(), Instrument::new(&Rust::default()).expect("inside its domain"));
    }
}
