//! The bench: random devices, campaigns written to a folder and identified from it, and what was set beside what was
//! answered.
//!
//! Whoever identifies here sees a folder with campaign.toml and the recordings; the truth is not in it.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use cvg_calibration::recording::Campaign;
use cvg_calibration::report::Estimate;
use cvg_calibration::{Identification, Options, Origin, Refusal};
use cvg_model::effects::{EffectId, Values};
use cvg_simulator::noise::Noise;
use cvg_simulator::scenario::{EffectSetting, Run};
use cvg_simulator::{Scenario, Settings};

/// How many trials a random test makes: `CVG_TRIALS`, or `default`.
///
/// # Panics
/// Where the variable is not a positive number.
pub fn trials(default: u64) -> u64 {
    match std::env::var("CVG_TRIALS") {
        Ok(text) => text.parse().ok().filter(|n| *n > 0).unwrap_or_else(|| panic!("CVG_TRIALS={text} is no number")),
        Err(_) => default,
    }
}

/// The folder that an environment variable names; without it the test says that it was skipped.
pub fn folder(variable: &str) -> Option<PathBuf> {
    let named = std::env::var_os(variable).map(PathBuf::from);
    if named.is_none() {
        println!("skipped: {variable} is not set");
    }
    named
}

/// `trial` of every number below `count`, in order, on all processors.
pub fn all<T: Send>(count: u64, trial: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let mut done: Vec<(u64, T)> = std::thread::scope(|scope| {
        let work = || {
            let mut mine = Vec::new();
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed) as u64;
                if number >= count {
                    return mine;
                }
                mine.push((number, trial(number)));
            }
        };
        let handles: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        handles.into_iter().flat_map(|h| h.join().unwrap_or_else(|e| std::panic::resume_unwind(e))).collect()
    });
    done.sort_by_key(|(number, _)| *number);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Seeded draws.
#[derive(Debug)]
pub struct Draws {
    /// what the first draws are, as shares, the next one last
    script: Vec<f64>,
    noise: Noise,
}

impl Draws {
    /// The draws of a seed: a stream that no simulated run uses.
    pub fn new(seed: u64) -> Self {
        Self { script: Vec::new(), noise: Noise::new(seed, u64::MAX) }
    }

    /// Draws of which each of the first is what two bytes say; then those of a seed.
    pub fn scripted(bytes: &[u8], seed: u64) -> Self {
        let shares = bytes.chunks_exact(2).map(|b| f64::from(u16::from_le_bytes([b[0], b[1]])) / 65536.0);
        Self { script: shares.rev().collect(), ..Self::new(seed) }
    }

    /// Evenly between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        let drawn = |noise: &mut Noise| noise.angle_rad() / core::f64::consts::TAU + 0.5;
        let share = self.script.pop().unwrap_or_else(|| drawn(&mut self.noise));
        low + share * (high - low)
    }

    /// Between two positive numbers, each factor as likely as any other.
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// An angle of the whole circle, deg.
    pub fn angle_deg(&mut self) -> f64 {
        self.between(-180.0, 180.0)
    }

    /// A number below `count`.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small positive number")]
    pub fn below(&mut self, count: usize) -> usize {
        (self.between(0.0, count as f64) as usize).min(count - 1)
    }
}

/// The effect `id` with its parameters in their order.
///
/// # Panics
/// Where they are outside the library's bounds.
pub fn effect(id: EffectId, parameters: &[f64]) -> EffectSetting {
    let mut values: Values<f64> = id.neutral();
    values[..parameters.len()].copy_from_slice(parameters);
    EffectSetting::new(id, values).unwrap_or_else(|e| panic!("{e}"))
}

/// The effect `id` at a size and a direction, deg, of a pair whose angle is divided by `division`.
pub fn polar(id: EffectId, size: f64, angle_deg: f64, division: f64) -> EffectSetting {
    let (sin, cos) = (division * angle_deg.to_radians()).sin_cos();
    effect(id, &[size * cos, size * sin])
}

/// The paper's device and runs with nothing undeclared in them.
pub fn plain_paper() -> Settings {
    let mut settings = Scenario::paper().settings().clone();
    settings.effects.retain(|e| e.id.description().declared);
    settings
}

/// Noise that remembers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coloured {
    /// forces that walk the angle: 0.13 to 1.3 deg/√h, as √(force noise²/control rate)
    Walk,
    /// readout gains with 1/f noise: 0.02 to 0.2 permille
    Gains,
    /// a table whose rate has 1/f noise: 0.01 to 0.1 permille
    Table,
    /// each of them
    All,
}

impl Coloured {
    /// All kinds in turn.
    pub fn of(number: u64) -> Self {
        [Self::Walk, Self::Gains, Self::Table, Self::All][(number % 4) as usize]
    }

    /// Adds noise of this kind.
    pub fn add(self, settings: &mut Settings, draw: &mut Draws) {
        if matches!(self, Self::Walk | Self::All) {
            settings.force_noise_v = draw.scale(1.7e-3, 1.7e-2);
        }
        if matches!(self, Self::Gains | Self::All) {
            settings.gain_flicker = draw.scale(2e-5, 2e-4);
        }
        if matches!(self, Self::Table | Self::All) {
            settings.table_wander = draw.scale(1e-5, 1e-4);
        }
    }
}

/// The scenario of these settings.
///
/// # Panics
/// Where they make no sense.
pub fn scenario(settings: Settings) -> Scenario {
    Scenario::new(settings).unwrap_or_else(|e| panic!("{e}"))
}

/// Simulates, writes campaign.toml and the recordings into a folder, and identifies from there.
///
/// # Errors
/// Where the identification refuses the campaign.
///
/// # Panics
/// Where the folder cannot be written or read again.
pub fn identify(settings: Settings) -> Result<Identification, Refusal> {
    identify_without(settings, &[])
}

/// [`identify`], of recordings that lack columns; without the commands there are no ring-downs either.
///
/// # Errors
/// Where the identification refuses the campaign.
///
/// # Panics
/// Where the folder cannot be written or read again.
pub fn identify_without(mut settings: Settings, columns: &[&str]) -> Result<Identification, Refusal> {
    if columns.contains(&"vas_v") {
        settings.runs.retain(|r| matches!(r, Run::Rotation { .. }));
    }
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    let mut simulated = scenario(settings).simulate();
    for run in &mut simulated.runs {
        run.columns.retain(|c| !columns.contains(&c.name));
    }
    simulated.write(folder.path()).unwrap_or_else(|e| panic!("{e}"));
    std::fs::remove_file(folder.path().join("truth.toml")).unwrap_or_else(|e| panic!("{e}"));
    identify_folder(folder.path())
}

/// Identifies the campaign.toml of a folder.
///
/// # Errors
/// Where the campaign cannot be read, or the identification refuses it.
pub fn identify_folder(folder: &Path) -> Result<Identification, Refusal> {
    let campaign = Campaign::open(&folder.join("campaign.toml"))?;
    cvg_calibration::identify(campaign, &Options::default())
}

/// Identifiers of the effects that came in by `origin`, sorted.
pub fn found(identified: &Identification, origin: Origin) -> Vec<&str> {
    let effects = identified.report.effects.iter().filter(|e| e.origin == origin);
    let mut ids: Vec<&str> = effects.map(|e| e.id.as_str()).collect();
    ids.sort_unstable();
    ids
}

/// Held-out rms after all, over the noise floor.
pub fn over_floor(identified: &Identification) -> f64 {
    let h = &identified.report.heldout;
    h.discovered.rms_deg / h.noise_floor_deg
}

/// Whether a 95 % interval holds the truth.
pub fn holds(estimate: &Estimate, truth: f64) -> bool {
    estimate.ci95[0] <= truth && truth <= estimate.ci95[1]
}

/// Estimate less truth, in standard deviations.
pub fn deviations(estimate: &Estimate, truth: f64) -> f64 {
    (estimate.value - truth) / (estimate.half_width() / 1.96)
}
