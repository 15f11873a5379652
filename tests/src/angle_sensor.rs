//! Angle sensors with known errors.

use cvg_calibration::recording::{Campaign, Instrument, Recording, Role, Run, RunKind};
use cvg_calibration::report::EffectReport;
use cvg_calibration::{Identification, Options, identify};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Standard normal noise from a seed.
pub struct Noise(ChaCha8Rng);

impl Noise {
    /// From a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// One sample.
    pub fn sample(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// A rotation run.
#[must_use]
pub fn run(name: &str, role: Role, recording: Recording) -> Run {
    let file = name.into();
    Run { kind: RunKind::Rotation, file, settle_s: 0.0, role, amplitude: None, recording }
}

/// A campaign of a sensor bolted to its reference.
#[must_use]
pub fn sensor(runs: Vec<Run>) -> Campaign {
    Campaign {
        device: "sensor".into(),
        instrument: Instrument::Sensor,
        angular_gain: Some(1.0),
        period_deg: Some(360.0),
        runs,
        ..Campaign::default()
    }
}

/// What is identified from a campaign.
///
/// # Panics
/// Where it is refused.
#[must_use]
pub fn identified(campaign: Campaign) -> Identification {
    identify(campaign, &Options::default()).unwrap_or_else(|refusal| panic!("{refusal}"))
}

/// Held-out error with what was found undone, rms, deg.
#[must_use]
pub fn held_out(i: &Identification) -> f64 {
    i.report.heldout.discovered.rms_deg
}

/// An effect of the report.
#[must_use]
pub fn find<'a>(i: &'a Identification, id: &str) -> Option<&'a EffectReport> {
    i.report.effects.iter().find(|e| e.id == id)
}

/// The lines of the reference's turn that were found, per turn.
#[must_use]
pub fn lines(i: &Identification) -> Vec<f64> {
    i.report.effects.iter().filter(|e| e.id == "table-harmonic").map(|e| e.parameters[0].value).collect()
}

/// Two channels with offset, gain, skew and a cubic, in units of `unit` a volt.
#[must_use]
pub fn channels(angles_deg: &[f64], unit: f64, cubic: f64, noise_v: f64, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut noise = Noise::new(seed);
    let c = |u: f64| u + 0.75 * cubic * u * u * u;
    angles_deg
        .iter()
        .map(|a| {
            let (sin, cos) = a.to_radians().sin_cos();
            let (x, y) = (c(cos), c(sin));
            let (x, y) =
                (0.02 + x + noise_v * noise.sample(), -0.03 + 1.06 * (y + 0.01 * x) + noise_v * noise.sample());
            (unit * x, unit * y)
        })
        .unzip()
}

/// Two channels at angles, deg, a reading a second.
#[must_use]
pub fn read_at(angles: Vec<f64>, x: Vec<f64>, y: Vec<f64>, role: Role) -> Run {
    let recording = Recording {
        t_s: (0..angles.len()).map(|i| i as f64).collect(),
        table_deg: Some(angles),
        xc_v: Some(x),
        yc_v: Some(y),
        ..Recording::default()
    };
    run("stations.csv", role, recording)
}

/// An angle at stations, deg, a degree a second.
#[must_use]
pub fn angle_at(degrees: Vec<f64>, theta: impl FnMut(f64) -> f64, role: Role) -> Run {
    let recording = Recording {
        t_s: degrees.iter().map(|d| (d - degrees[0]).abs()).collect(),
        theta_deg: Some(degrees.iter().copied().map(theta).collect()),
        table_deg: Some(degrees),
        ..Recording::default()
    };
    run("stations.csv", role, recording)
}

/// An angle at stations, deg, a row a second.
#[must_use]
pub fn a_row_a_second(degrees: Vec<f64>, theta: impl FnMut(f64) -> f64, role: Role) -> Run {
    let recording = Recording {
        t_s: (0..degrees.len()).map(|i| i as f64).collect(),
        theta_deg: Some(degrees.iter().copied().map(theta).collect()),
        table_deg: Some(degrees),
        ..Recording::default()
    };
    run("stations.csv", role, recording)
}
