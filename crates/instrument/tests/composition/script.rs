//! What happens: to the vibration, between it and the converters, and by whoever uses the instrument.

use core::f64::consts::TAU;

use cvg_instrument::{RequestedMode, Settings};
use proptest::prelude::*;

/// Something that happens, and for how many windows it lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Event {
    Well(u32),
    Silent(u32),
    /// a value on a channel instead of the vibration
    Constant(usize, f64, u32),
    /// one sample of it
    Once(usize, f64),
    RequestedMode(RequestedMode),
    Acknowledge,
    /// the precession that is known is all but none
    Stalled,
    /// from now on, in set amplitudes
    Amplitude(f64),
    /// from now on, rad/s
    Rate(f64),
    /// the pattern jumps, rad
    Jump(f64),
    /// the phase jumps, rad
    Phase(f64),
    /// semi-minor over semi-major axis, from now on
    Round(f64),
    /// the resonance, Hz beside the nominal one, from now on
    Detuned(f64),
}

impl Event {
    pub(super) fn windows(&self) -> u32 {
        match *self {
            Self::Well(n) | Self::Silent(n) | Self::Constant(_, _, n) => n,
            Self::RequestedMode(_) | Self::Acknowledge | Self::Stalled => 0,
            Self::Once(..) => 1,
            _ => 3,
        }
    }
}

/// All that may be wrong with a converter.
pub(super) fn wrongs() -> Vec<Event> {
    let mut all = Vec::new();
    for channel in [0, 1] {
        for v in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e9, -1e9, 0.0] {
            all.push(Event::Once(channel, v));
        }
        for v in [f64::NAN, 1e9, -1e9, 0.0, 0.1, -0.3] {
            all.extend([Event::Constant(channel, v, 3), Event::Constant(channel, v, 30)]);
        }
    }
    all
}

/// Anything.
pub(super) fn event() -> impl Strategy<Value = Event> {
    let value = prop::sample::select(vec![f64::NAN, f64::INFINITY, 1e9, -1e9, 2.4, 0.0, 0.05, -0.4]);
    let requested = prop::sample::select(vec![
        RequestedMode::WholeAngle,
        RequestedMode::Hold,
        RequestedMode::RingDown,
        RequestedMode::Off,
    ]);
    prop_oneof![
        6 => (1_u32..120).prop_map(Event::Well),
        1 => (1_u32..60).prop_map(Event::Silent),
        2 => (0_usize..2, value.clone(), 1_u32..40).prop_map(|(c, v, n)| Event::Constant(c, v, n)),
        2 => (0_usize..2, value).prop_map(|(c, v)| Event::Once(c, v)),
        2 => requested.prop_map(Event::RequestedMode),
        1 => Just(Event::Acknowledge),
        1 => Just(Event::Stalled),
        2 => prop::sample::select(vec![0.001, 0.4, 0.5, 0.9, 1.0, 1.0, 1.1, 1.4, 1.6]).prop_map(Event::Amplitude),
        2 => (-40.0..40.0).prop_map(Event::Rate),
        1 => (-1.6..1.6).prop_map(Event::Jump),
        1 => (-1.6..1.6).prop_map(Event::Phase),
        1 => prop::sample::select(vec![0.0, 0.0, 0.02, -0.02, 0.2, -0.2, 0.6, -0.6]).prop_map(Event::Round),
        1 => (-60.0..60.0).prop_map(Event::Detuned),
    ]
}

/// A vibration that is written down, whatever the drives do.
pub(super) struct Vibration {
    carrier_hz: f64,
    sample_hz: f64,
    set_v: f64,
    amplitude: f64,
    round: f64,
    theta: f64,
    rate_rad_s: f64,
    phase: f64,
    detuned_hz: f64,
    instead: [Option<f64>; 2],
    once: [Option<f64>; 2],
}

impl Vibration {
    pub(super) fn new(settings: &Settings<'_>) -> Self {
        Self {
            carrier_hz: settings.carrier_hz,
            sample_hz: settings.sample_hz,
            set_v: settings.amplitude_v,
            amplitude: 1.0,
            round: 0.0,
            theta: 0.35,
            rate_rad_s: 0.0,
            phase: 0.3,
            detuned_hz: 3.0,
            instead: [None; 2],
            once: [None; 2],
        }
    }

    pub(super) fn happens(&mut self, event: &Event) {
        self.instead = [None; 2];
        match *event {
            Event::Silent(_) => self.instead = [Some(0.0); 2],
            Event::Constant(channel, v, _) => self.instead[channel] = Some(v),
            Event::Once(channel, v) => self.once[channel] = Some(v),
            Event::Amplitude(a) => self.amplitude = a,
            Event::Rate(rate) => self.rate_rad_s = rate,
            Event::Jump(by) => self.theta += by,
            Event::Phase(by) => self.phase += by,
            Event::Round(q) => self.round = q,
            Event::Detuned(hz) => self.detuned_hz = hz,
            Event::Well(_) | Event::RequestedMode(_) | Event::Acknowledge | Event::Stalled => {}
        }
    }

    /// What the converters read now; time goes on by a sample.
    pub(super) fn sample(&mut self) -> [f64; 2] {
        let (sin, cos) = self.theta.sin_cos();
        let (carrier_sin, carrier_cos) = self.phase.sin_cos();
        let (major, minor) = (carrier_cos, -self.round * carrier_sin);
        let a = self.set_v * self.amplitude;
        let read = [a * (major * cos - minor * sin), a * (major * sin + minor * cos)];
        self.theta += self.rate_rad_s / self.sample_hz;
        self.phase += TAU * (self.carrier_hz + self.detuned_hz) / self.sample_hz;
        [0, 1].map(|k| self.once[k].take().or(self.instead[k]).unwrap_or(read[k]))
    }
}
