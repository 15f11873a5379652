//! The instrument for hours and days: frequency and clock off and drifting, rates that change, and something wrong with
//! converters, samples or supply every few seconds. What it says is compared with where the pattern is.

use core::f64::consts::TAU;
use std::collections::BTreeSet;

use cvg_instrument::{Fault, Mode, RequestedMode, Settings, Status};
use cvg_simulator::carrier::{CarrierLoop, CarrierPlant};

use crate::bench::Draws;
use crate::carrier::{SAMPLE_HZ, device, samples};

/// What is wrong for a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// samples are neither taken nor given
    Dropped,
    /// a converter, or both, stays at the end of its range
    Rail,
    /// a converter, or both, repeats its last value
    Frozen,
    /// one sample of fifty is anything
    Spikes,
    /// a converter, or both, gives no numbers
    NoNumber,
    /// the electronics start anew
    BrownOut,
    /// one sample is inverted, the other channel's anything
    Glitch,
    /// rest is requested
    Off,
}

/// All of them.
pub const WRONGS: [Wrong; 8] = [
    Wrong::Dropped,
    Wrong::Rail,
    Wrong::Frozen,
    Wrong::Spikes,
    Wrong::NoNumber,
    Wrong::BrownOut,
    Wrong::Glitch,
    Wrong::Off,
];

/// What came of one kind.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// how often it happened
    pub events: u64,
    /// and the instrument was back in whole-angle mode for two seconds
    pub back: u64,
    /// half turns were lost
    pub slips: u64,
    /// and the status did not say that they may be
    pub silent: u64,
    /// it was said that they may be
    pub said: u64,
    /// not back within [`PATIENCE_S`]
    pub stuck: u64,
    /// the longest way back after it was over, s
    pub longest_s: f64,
    /// the largest error of the angle after the way back, half turns aside, deg
    pub worst_deg: f64,
    /// the faults that were named
    pub named: BTreeSet<String>,
}

/// Longest rest and longest start, s.
pub const PATIENCE_S: f64 = 60.0;

/// How fast things change: the frequency goes up and down once in `drift_s`, the rate is another every `rate_s`.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// s
    pub drift_s: f64,
    /// s
    pub rate_s: f64,
    /// the longest time that something is wrong, s
    pub wrong_s: f64,
}

/// As on a table.
pub const REAL: Pace = Pace { drift_s: 900.0, rate_s: 30.0, wrong_s: 2.0 };
/// Hours in a minute.
pub const LAPSE: Pace = Pace { drift_s: 40.0, rate_s: 5.0, wrong_s: 0.5 };

/// Something wrong, now.
#[derive(Clone, Copy, Debug)]
struct Event {
    wrong: Wrong,
    ends: u64,
    /// X, Y or both
    channels: [bool; 2],
    frozen: [f32; 2],
}

/// A soak: the loop, the truth and the tallies.
#[derive(Debug)]
pub struct Soak {
    carrier: CarrierLoop<f32>,
    pace: Pace,
    draws: Draws,
    clock: f64,
    sample: u64,
    rate_rad_s: f64,
    /// the pattern's unwrapped angle, deg, and what the instrument's is beyond it
    truth_deg: f64,
    beyond_deg: Option<f64>,
    event: Option<Event>,
    /// what happened last and when it was over, while the way back is watched
    pending: Option<(Wrong, u64)>,
    last: Wrong,
    next: u64,
    well_since: u64,
    seen: [f32; 2],
    bits: u64,
    /// one for each of [`WRONGS`]
    pub tallies: [Tally; 8],
    /// commands that were no number or beyond the limit
    pub unbounded: u64,
    /// the largest error of the angle while nothing was wrong, deg
    pub quiet_worst_deg: f64,
}

impl Soak {
    /// A device of `seed` at rest: clock ± 500 ppm, resonance ± 2 % and drifting.
    ///
    /// # Panics
    /// Never: the settings are in their domain.
    pub fn new(seed: u64, pace: Pace) -> Self {
        let mut draws = Draws::new(seed);
        let mut device = device();
        device.seed = seed;
        let carrier = CarrierLoop::new(&device, &Settings::default()).unwrap_or_else(|e| panic!("{e}"));
        Self {
            carrier,
            pace,
            clock: 1.0 + draws.between(-5e-4, 5e-4),
            draws,
            sample: 0,
            rate_rad_s: 0.0,
            truth_deg: 0.0,
            beyond_deg: None,
            event: None,
            pending: None,
            last: Wrong::Off,
            next: samples(5.0),
            well_since: 0,
            seen: [0.0; 2],
            bits: seed | 1,
            tallies: Default::default(),
            unbounded: 0,
            quiet_worst_deg: 0.0,
        }
    }

    /// Runs for `time_s`.
    pub fn run(&mut self, time_s: f64) {
        let end = self.sample + samples(time_s);
        while self.sample < end {
            if self.sample.is_multiple_of(1000) {
                self.drift();
            }
            if self.event.is_none() && self.pending.is_none() && self.sample >= self.next {
                self.begin();
            }
            let status = self.step();
            if self.sample.is_multiple_of(10) {
                self.follow();
            }
            if let Some(status) = status.filter(|s| s.fresh) {
                self.judge(&status);
            }
            self.sample += 1;
        }
    }

    /// SplitMix's poor relation: bits for spikes.
    fn any(&mut self) -> u64 {
        self.bits ^= self.bits << 13;
        self.bits ^= self.bits >> 7;
        self.bits ^= self.bits << 17;
        self.bits
    }

    /// The resonance and the rate move on.
    fn drift(&mut self) {
        let t = self.sample as f64 / SAMPLE_HZ;
        if self.sample.is_multiple_of(samples(self.pace.rate_s)) {
            self.rate_rad_s = self.draws.between(-300.0, 300.0).to_radians();
        }
        let device = device();
        let mut resonator = device.resonator;
        resonator.omega_rad_s *= self.clock * (1.0 + 0.02 * (TAU * t / self.pace.drift_s).sin());
        let mut plant = CarrierPlant::new(&resonator, device.drive_per_s_v, 1.0 / SAMPLE_HZ, device.drive_delay_s);
        plant.set_vibration(&self.carrier.plant.vibration());
        plant.set_rate(self.rate_rad_s);
        self.carrier.plant = plant;
    }

    fn begin(&mut self) {
        let wrong = WRONGS[self.draws.below(WRONGS.len())];
        let lasts = match wrong {
            Wrong::BrownOut | Wrong::Glitch => 1,
            _ => samples(self.draws.scale(1e-4, self.pace.wrong_s)).max(1),
        };
        let channels = [[true, false], [false, true], [true, true]][self.draws.below(3)];
        let ends = self.sample + lasts;
        self.event = Some(Event { wrong, ends, channels, frozen: self.seen });
        (self.pending, self.last) = (Some((wrong, ends)), wrong);
        self.tallies[wrong as usize].events += 1;
        match wrong {
            Wrong::BrownOut => {
                self.carrier.state = self.carrier.instrument().start();
                self.beyond_deg = None;
            }
            Wrong::Off => self.carrier.state.request(RequestedMode::Off),
            _ => {}
        }
    }

    /// One sample through what is wrong.
    fn step(&mut self) -> Option<Status> {
        if let Some(event) = self.event.filter(|e| self.sample >= e.ends) {
            if event.wrong == Wrong::Off {
                self.carrier.state.request(RequestedMode::WholeAngle);
            }
            self.event = None;
        }
        let event = self.event;
        if event.is_some_and(|e| e.wrong == Wrong::Dropped) {
            self.carrier.step_without_electronics();
            return None;
        }
        let bits = if event.is_some() { self.any() } else { 0 };
        let mut seen = [0.0; 2];
        let status = self.carrier.step_through(|v| {
            seen = event.map_or(v, |e| e.bent(v, bits));
            seen
        });
        self.seen = seen;
        let limit = Settings::default().dac_limit_v;
        let [x, y] = self.carrier.output_v();
        self.unbounded += u64::from(!(x.abs() <= limit && y.abs() <= limit));
        Some(status)
    }

    /// The pattern's angle, unwrapped.
    fn follow(&mut self) {
        let p = self.carrier.plant.vibration().pendulum();
        let turned = 0.5 * p.s.atan2(p.r).to_degrees() - self.truth_deg;
        self.truth_deg += turned - 180.0 * (turned / 180.0).round();
    }

    /// A window: the angle against the truth, and whether the instrument is back.
    fn judge(&mut self, status: &Status) {
        if status.mode != Mode::WholeAngle {
            self.well_since = self.sample;
        }
        if let (Some((wrong, _)), Some(fault)) = (self.pending, status.fault) {
            self.tallies[wrong as usize].named.insert(format!("{fault:?}"));
        }
        let since = self.pending.map_or(0, |(_, ends)| ends.max(self.well_since));
        if self.event.is_none() && self.sample > self.well_since.max(since) + samples(0.5) {
            self.compare(status);
        }
        let Some((wrong, ends)) = self.pending else { return };
        let tally = &mut self.tallies[wrong as usize];
        if self.event.is_none() && self.sample > ends.max(self.well_since) + samples(2.0) {
            tally.back += 1;
            tally.longest_s = tally.longest_s.max((self.well_since.max(ends) - ends) as f64 / SAMPLE_HZ);
            tally.said += u64::from(status.half_turns_lost);
            self.carrier.state.acknowledge_half_turns();
            self.pending = None;
            self.next = self.sample + samples(self.draws.between(0.1, 3.0));
        } else if self.sample > ends + samples(PATIENCE_S) {
            println!(
                "not back from {wrong:?} at {} s: {:?}",
                self.sample as f64 / SAMPLE_HZ,
                self.carrier.state.supervisor
            );
            tally.stuck += 1;
            self.pending = None;
            self.next = self.sample + samples(5.0);
        }
    }

    /// The angle's error; half turns that were lost since the last time.
    fn compare(&mut self, status: &Status) {
        let off = self.carrier.state.angle_deg() - self.truth_deg;
        let beyond = *self.beyond_deg.get_or_insert(180.0 * (off / 180.0).round());
        let slipped = 180.0 * ((off - beyond) / 180.0).round();
        let error = (off - beyond - slipped).abs();
        match self.pending {
            None => self.quiet_worst_deg = self.quiet_worst_deg.max(error),
            Some((wrong, _)) => {
                let tally = &mut self.tallies[wrong as usize];
                tally.worst_deg = tally.worst_deg.max(error);
            }
        }
        if slipped != 0.0 {
            self.beyond_deg = Some(beyond + slipped);
            let wrong = self.pending.map_or(self.last, |(wrong, _)| wrong);
            let tally = &mut self.tallies[wrong as usize];
            tally.slips += 1;
            if !status.half_turns_lost {
                tally.silent += 1;
                println!("{wrong:?}: {slipped} deg lost in silence at {} s", self.sample as f64 / SAMPLE_HZ);
            }
        }
    }

    /// The tallies as a table.
    pub fn table(&self) -> String {
        let mut rows = String::from(
            "| | events | back | half turns lost | of these unsaid | said | longest way back, s | worst, deg | named |\n",
        );
        rows += "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
        for (wrong, t) in WRONGS.iter().zip(&self.tallies) {
            let named: Vec<_> = t.named.iter().map(String::as_str).collect();
            rows += &format!(
                "| {wrong:?} | {} | {} | {} | {} | {} | {:.2} | {:.3} | {} |\n",
                t.events,
                t.back,
                t.slips,
                t.silent,
                t.said,
                t.longest_s,
                t.worst_deg,
                named.join(", ")
            );
        }
        rows
    }

    /// Whether all is as it should be: every event but the last is over, nothing was lost in silence or without bounds, and
    /// a rail that was named was named a rail, or what it leaves.
    pub fn is_well(&self) -> bool {
        let events: u64 = self.tallies.iter().map(|t| t.events).sum();
        let back: u64 = self.tallies.iter().map(|t| t.back).sum();
        let rail = &self.tallies[Wrong::Rail as usize].named;
        self.unbounded == 0
            && back + 1 >= events
            && self.tallies.iter().all(|t| t.silent == 0 && t.stuck == 0)
            && !rail.contains(&format!("{:?}", Fault::StuckChannel))
    }
}

impl Event {
    /// What the electronics are given instead of `v`.
    fn bent(&self, v: [f32; 2], bits: u64) -> [f32; 2] {
        let anything = |shift: u64| {
            let word = u16::try_from((bits >> shift) & 0xffff).unwrap_or(0);
            (f32::from(word) / 32_768.0 - 1.0) * 2.5
        };
        let each = |k: usize| match self.wrong {
            Wrong::Rail => [2.5, -2.5][k],
            Wrong::Frozen => self.frozen[k],
            Wrong::Spikes if bits.is_multiple_of(50) => anything(20 + 20 * k as u64),
            Wrong::NoNumber => [f32::NAN, f32::INFINITY][k],
            Wrong::Glitch => [-v[0], anything(8)][k],
            _ => v[k],
        };
        [0, 1].map(|k| if self.channels[k] || self.wrong == Wrong::Glitch { each(k) } else { v[k] })
    }
}
