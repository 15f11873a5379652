//! What is told of an instrument and its state beside what a step says.

use cvg_instrument::{Fault, Instrument, Mode, Settings};

#[test]
fn an_envelope_is_as_old_as_the_middle_of_its_window() {
    for (window, samples) in [(8, 3.5), (50, 24.5), (51, 25.0)] {
        let settings = Settings { window, ..Settings::default() };
        let single = Instrument::<f32>::new(&settings).expect("inside its domain");
        let double = Instrument::<f64>::new(&settings).expect("inside its domain");
        assert_eq!((single.group_delay_samples(), double.group_delay_samples()), (samples, samples));
        let readout_delay_s = 3e-6;
        let late = Settings { readout_delay_s, ..settings };
        assert_eq!(settings.group_delay_s(), samples / settings.sample_hz);
        assert_eq!(late.group_delay_s(), samples / settings.sample_hz + readout_delay_s);
    }
}

#[test]
fn the_last_fault_is_told_after_the_instrument_came_back_from_it() {
    let mut state = Instrument::<f32>::new(&Settings::default()).expect("inside its domain").start();
    assert_eq!(state.last_fault(), None);
    state.supervisor.fault = Some(Fault::NoLock);
    for mode in [Mode::Fault, Mode::Listen, Mode::WholeAngle] {
        state.supervisor.mode = mode;
        assert_eq!(state.last_fault(), Some(Fault::NoLock));
    }
}
