//! The instrument is its parts, joined: the same step, written here without short ways, from parts that are made here of
//! the settings, leaves the same state to the last bit, whatever happens to the vibration and to the converters.

mod parts;
mod script;

use cvg_instrument::{Instrument, Mode, RequestedMode, Settings, State, Tuning};
use cvg_model::Float;
use cvg_model::effects::{EffectId, Values};
use proptest::prelude::*;

use parts::Parts;
use script::{Event, Vibration, event};

const UNEVEN: &[(EffectId, Values<f64>)] = &[
    (EffectId::DetectionCubic, [0.05, 0.01, 0.0, 0.0]),
    (EffectId::DetectionGainMismatch, [1.0132, 0.0, 0.0, 0.0]),
    (EffectId::DetectionOffset, [0.01, -0.02, 0.0, 0.0]),
];
const LATE: &[(EffectId, Values<f64>)] = &[
    (EffectId::AngleLatency, [2e-3, 0.0, 0.0, 0.0]),
    (EffectId::DetectionSkew, [0.03, 0.0, 0.0, 0.0]),
    // with the inverse of the rate
    (EffectId::HarmonicN, [2.0, 1e-10, 0.0, 3.0]),
];
const CLIPPED: &[(EffectId, Values<f64>)] = &[(EffectId::DetectionSaturation, [0.9, 0.0, 0.0, 0.0])];
const FED: &[(EffectId, Values<f64>)] = &[
    (EffectId::DetectionGainMismatch, [0.991, 0.0, 0.0, 0.0]),
    (EffectId::DriveFeedthrough, [0.03, -0.02, -0.01, 0.05]),
];
const DRIVES: &[(EffectId, Values<f64>)] = &[
    (EffectId::ActuationGainMismatch, [1.0113, 0.0, 0.0, 0.0]),
    (EffectId::ActuationSkew, [0.02, 0.0, 0.0, 0.0]),
    (EffectId::ActuationPhase, [0.03, 0.0, 0.0, 0.0]),
];

const SETTINGS: usize = 5;

/// Settings of which no two that belong to different parts are the same number.
fn settings(which: usize) -> Settings<'static> {
    let tuning = |bandwidth_hz, damping| Tuning { bandwidth_hz, damping };
    let other = Settings {
        carrier_hz: 14_321.0,
        band: 0.019,
        sample_hz: 96_000.0,
        window: 37,
        adc_full_scale_v: 1.9,
        dac_limit_v: 0.9,
        readout_delay_s: 7e-6,
        drive_delay_s: 13e-6,
        amplitude_v: 0.75,
        drive_per_s_v: 1.7,
        energy: tuning(3.0, 0.8),
        quadrature: tuning(6.0, 0.6),
        phase: tuning(25.0, 0.9),
        rate: tuning(2.5, 1.1),
        hold_rad: 0.35,
        fastest_rad_s: 41.0,
        detection_threshold_v: 0.03,
        sweep_s: 0.05,
        readout: &[],
        actuation: &[],
    };
    match which {
        // drives are compensated without the readout, with it, and not
        0 => Settings { sweep_s: 0.05, actuation: DRIVES, ..Settings::default() },
        1 => Settings { readout: UNEVEN, actuation: DRIVES, ..other },
        2 => Settings { readout: LATE, ..other },
        // a delay of so many samples that a detuning turns the drives far
        3 => Settings { readout: FED, drive_delay_s: 83e-6, dac_limit_v: 4.0, ..other },
        _ => Settings { readout: CLIPPED, window: 24, hold_rad: -0.2, ..Settings::default() },
    }
}

/// So little that its inverse is no number.
fn least<T: Float>() -> T {
    T::from_f64(if T::epsilon().to_f64() > 1e-10 { 1e-43 } else { 1e-321 })
}

/// The bits, but for the sign of zero.
fn words<T: Float>(state: &State<T>) -> String {
    format!("{state:?}").replace("-0.0,", "0.0,").replace("-0.0 ", "0.0 ").replace("-0.0)", "0.0)")
}

/// Both through a script; the modes that were passed.
fn compare<T: Float>(which: usize, script: &[Event]) -> Vec<Mode> {
    let settings = settings(which);
    let instrument = Instrument::<T>::new(&settings).expect("inside its domain");
    let parts = Parts::<T>::of(&settings);
    let (mut state, mut joined) = (instrument.start(), instrument.start());
    let mut vibration = Vibration::new(&settings);
    let mut modes = Vec::new();
    for event in script {
        for s in [&mut state, &mut joined] {
            match event {
                Event::RequestedMode(requested) => s.request(*requested),
                Event::Acknowledge => s.acknowledge_half_turns(),
                Event::Stalled => s.precession.sin_2_per_window = least(),
                _ => {}
            }
        }
        vibration.happens(event);
        for _ in 0..event.windows() * u32::from(settings.window) {
            let [x, y] = vibration.sample().map(T::from_f64);
            let said = instrument.step(&mut state, x, y);
            let expected = parts.step(&mut joined, x, y);
            assert!(said == expected, "{event:?} of {script:?}\n{said:?}\n{expected:?}");
            if said.2.fresh {
                let same = state == joined || words(&state) == words(&joined);
                assert!(same, "{event:?} of {script:?}\n{state:?}\n{joined:?}");
                if modes.last() != Some(&said.2.mode) {
                    modes.push(said.2.mode);
                }
            }
        }
    }
    modes
}

/// Times that no script is long enough for are in what the parts are made of.
fn is_made_of_its_parts<T: Float>() {
    for which in 0..SETTINGS {
        let settings = settings(which);
        let instrument = format!("{:?}", Instrument::<T>::new(&settings).expect("inside its domain"));
        for part in Parts::<T>::of(&settings).shown() {
            assert!(instrument.contains(&part), "{part} is not in {instrument}");
        }
    }
}

#[test]
fn every_part_is_made_of_the_settings() {
    is_made_of_its_parts::<f32>();
    is_made_of_its_parts::<f64>();
}

fn all_settings<T: Float>(script: &[Event]) -> Vec<Vec<Mode>> {
    (0..SETTINGS).map(|which| compare::<T>(which, script)).collect()
}

/// In operation, for so many windows more.
fn running(more: u32) -> Vec<Event> {
    vec![Event::Well(120), Event::Well(more)]
}

fn in_both_precisions(script: &[Event], passes: &[Mode]) {
    for modes in [all_settings::<f32>(script), all_settings::<f64>(script)] {
        // elsewhere windows are too short, or the vibration too much another one, for all that a script is for
        for which in [0, 2] {
            for mode in passes {
                assert!(modes[which].contains(mode), "{which}: {mode:?} is not among {:?}", modes[which]);
            }
        }
    }
}

#[test]
fn a_start_from_a_vibration_that_is_heard() {
    in_both_precisions(&running(300), &[Mode::Lock, Mode::SpinUp, Mode::WholeAngle]);
}

#[test]
fn a_start_from_silence_sweeps_and_ends_in_a_fault() {
    in_both_precisions(&[Event::Silent(2400)], &[Mode::Sweep, Mode::Listen, Mode::Fault]);
}

/// After a sweep that drives both, one that carries nothing is dead, whichever it is.
#[test]
fn a_channel_that_is_dead_from_the_start() {
    for channel in [0, 1] {
        let script = [Event::Silent(300), Event::Constant(channel, 0.0, 2400)];
        in_both_precisions(&script, &[Mode::Sweep, Mode::Listen, Mode::Fault]);
    }
}

#[test]
fn a_vibration_beside_the_band_is_followed_as_far_as_the_band_goes() {
    for detuned_hz in [430.0, -430.0, 700.0, -700.0] {
        let script = [Event::Detuned(detuned_hz), Event::Well(300)];
        all_settings::<f32>(&script);
        all_settings::<f64>(&script);
    }
}

#[test]
fn a_pattern_that_turns_in_both_senses() {
    for rate in [9.0, -9.0] {
        let mut script = running(10);
        script.extend([Event::Rate(rate), Event::Well(800)]);
        in_both_precisions(&script, &[Mode::WholeAngle]);
    }
}

#[test]
fn every_request_from_every_other() {
    let requests = [RequestedMode::WholeAngle, RequestedMode::Hold, RequestedMode::RingDown, RequestedMode::Off];
    for from in requests {
        let mut script = running(5);
        for to in requests {
            script.extend([Event::RequestedMode(from), Event::Well(130), Event::RequestedMode(to), Event::Well(130)]);
        }
        in_both_precisions(&script, &[Mode::WholeAngle, Mode::Hold, Mode::RingDown]);
    }
}

#[test]
fn whatever_is_wrong_with_a_converter() {
    for hold in [false, true] {
        for what in script::wrongs() {
            let mut script = running(20);
            script.extend([
                Event::RequestedMode(if hold { RequestedMode::Hold } else { RequestedMode::WholeAngle }),
                Event::Well(30),
            ]);
            script.extend([what, Event::Well(60), Event::Acknowledge, Event::Well(40)]);
            all_settings::<f32>(&script);
            all_settings::<f64>(&script);
        }
    }
}

#[test]
fn a_precession_so_slow_that_its_inverse_is_no_number() {
    // where sin 2θ is positive the inverse stays where it is, where it is negative it ends beyond all numbers
    for by in [0.0, -0.7] {
        let mut script = running(20);
        script.extend([Event::Jump(by), Event::Well(30)]);
        script.extend([Event::Stalled, Event::Well(1), Event::Stalled, Event::Well(40)]);
        in_both_precisions(&script, &[Mode::WholeAngle]);
    }
}

#[test]
fn a_fault_and_the_way_back() {
    let mut script = running(20);
    script.extend([Event::Amplitude(1.9), Event::Well(900), Event::Amplitude(1.0), Event::Well(1900)]);
    in_both_precisions(&script, &[Mode::Fault, Mode::WholeAngle]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]
    #[test]
    fn whatever_happens_in_whatever_order(which in 0..SETTINGS, events in prop::collection::vec(event(), 1..24)) {
        let script: Vec<Event> = running(20).into_iter().chain(events).collect();
        compare::<f32>(which, &script);
        compare::<f64>(which, &script);
    }
}
