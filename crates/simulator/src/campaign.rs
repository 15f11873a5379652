//! Simulated recordings in memory, and the folder they are written to: campaign.toml, a file for each run (CSV, Parquet or raw
//! numbers, as its name ends), truth.toml.
//!
//! A row is one control sample as the electronics saw it: the readout with its noise and the commands computed from
//! it, which are applied from that sample on. `rate_dps` is the commanded rate, `table_deg` the table's true angle.
//!
//! It refuses to touch files that are not its own: it creates the folder, overwrites its own names, deletes nothing.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::{fs, io};

use cvg_model::effects::EffectId;
use serde::Serialize;

use crate::carrier::displacement;
use crate::closed_loop::ClosedLoop;
use crate::scenario::{EffectSetting, Instrument, Profile, Purpose, Reference, Run, Scenario, Settings};

/// What free decays find of an isotropic nonlinear spring goes by this name.
const SPRING_ISOTROPIC: &str = "spring-isotropic";

/// One column of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// name with unit, as in the file
    pub name: &'static str,
    /// one value per row
    pub values: Vec<f64>,
}

/// One recording.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedRun {
    /// the run as the scenario says it
    pub run: Run,
    /// columns of equal length; the first is `t_s`
    pub columns: Vec<Column>,
}

/// All recordings of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Simulated {
    /// the scenario's settings
    pub settings: Settings,
    /// its runs, in order
    pub runs: Vec<SimulatedRun>,
}

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct WriteError {
    /// which file or folder
    pub path: PathBuf,
    /// why not
    pub source: io::Error,
}

impl SimulatedRun {
    /// The values of a column, if the recording has it.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.name == name).map(|c| c.values.as_slice())
    }

    /// Writes the recording into the folder `dir`, as the name of its file says.
    fn write(&self, dir: &Path) -> Result<(), WriteError> {
        let path = dir.join(self.run.file());
        let written = match Kind::of(&self.run) {
            #[cfg(feature = "parquet")]
            Kind::Parquet => self.parquet(&path),
            Kind::Raw => self.raw(&path),
            Kind::Csv => fs::write(&path, self.csv()),
        };
        written.map_err(|source| WriteError { path, source })
    }

    #[cfg(feature = "parquet")]
    fn parquet(&self, path: &Path) -> io::Result<()> {
        let columns: Vec<(&str, &[f64])> = self.columns.iter().map(|c| (c.name, c.values.as_slice())).collect();
        cvg_recording::write_parquet_numbers(&columns, io::BufWriter::new(fs::File::create(path)?))
    }

    /// All columns but the time, row by row, as little-endian floating point of 32 bits.
    fn raw(&self, path: &Path) -> io::Result<()> {
        let mut file = io::BufWriter::new(fs::File::create(path)?);
        let columns: Vec<&[f64]> =
            self.columns.iter().filter(|c| c.name != "t_s").map(|c| c.values.as_slice()).collect();
        for row in 0..columns.iter().map(|values| values.len()).min().unwrap_or(0) {
            for values in &columns {
                #[allow(clippy::cast_possible_truncation, reason = "what the file holds")]
                let value = values.get(row).map_or(f32::NAN, |v| *v as f32);
                file.write_all(&value.to_le_bytes())?;
            }
        }
        file.flush()
    }

    /// The recording as CSV: nine significant digits of the column's largest value.
    pub fn csv(&self) -> String {
        let decimals: Vec<usize> = self.columns.iter().map(decimals).collect();
        let names: Vec<&str> = self.columns.iter().map(|c| c.name).collect();
        let mut text = names.join(",");
        text.push('\n');
        let rows = self.columns.iter().map(|c| c.values.len()).min().unwrap_or(0);
        for row in 0..rows {
            for (i, (column, decimals)) in self.columns.iter().zip(&decimals).enumerate() {
                let value = column.values.get(row).copied().unwrap_or(f64::NAN);
                let separator = if i == 0 { "" } else { "," };
                // writing to a string does not fail
                let _ = if matches!(column.name, "rate_dps" | "virtual_dps") {
                    write!(text, "{separator}{value}")
                } else {
                    write!(text, "{separator}{value:.decimals$}")
                };
            }
            text.push('\n');
        }
        text
    }
}

/// The format of a run's file, as its name says.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Csv,
    #[cfg(feature = "parquet")]
    Parquet,
    Raw,
}

impl Kind {
    fn of(run: &Run) -> Self {
        match run.file().rsplit_once('.') {
            #[cfg(feature = "parquet")]
            Some((_, "parquet")) => Self::Parquet,
            Some((_, "f32")) => Self::Raw,
            _ => Self::Csv,
        }
    }
}

/// How the numbers of a raw file stand in it, for the campaign, which alone says so.
#[derive(Serialize)]
struct Raw {
    columns: Vec<&'static str>,
    number: &'static str,
    sample_hz: f64,
}

impl Raw {
    fn of(run: &Run) -> Option<Self> {
        let sample_hz = run.carrier_sample_hz().filter(|_| Kind::of(run) == Kind::Raw)?;
        let columns = displacement::names(run).into_iter().filter(|name| *name != "t_s").collect();
        Some(Self { columns, number: "f32", sample_hz })
    }
}

/// Decimals that a column is written with.
fn decimals(column: &Column) -> usize {
    let largest = column.values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    match column.name {
        // as few as hold every time stamp exactly, at least four
        "t_s" => {
            let exact = |d: &i32| {
                column.values.iter().take(64).all(|t| {
                    let scaled = t * 10_f64.powi(*d);
                    (scaled - scaled.round()).abs() < 1e-6
                })
            };
            (4..9).find(exact).map_or(9, |d| usize::try_from(d).unwrap_or(9))
        }
        "table_deg" | "theta_deg" => 7,
        _ if largest > 0.0 && largest.is_finite() => {
            #[allow(clippy::cast_possible_truncation, reason = "the logarithm of a finite number is small")]
            let magnitude = largest.log10().floor() as i32;
            usize::try_from((8 - magnitude).clamp(0, 20)).unwrap_or(0)
        }
        _ => 0,
    }
}

impl Scenario {
    /// Simulates every run.
    pub fn simulate(&self) -> Simulated {
        Simulated::new(self)
    }

    /// Simulates the runs one after the other, each written before the next, as [`Simulated::write`] writes them: displacements
    /// of a minute are millions.
    ///
    /// # Errors
    /// The first file or folder that cannot be written.
    pub fn write(&self, dir: impl AsRef<Path>) -> Result<(), WriteError> {
        let dir = dir.as_ref();
        create(dir)?;
        for (index, run) in self.settings().runs.iter().enumerate() {
            simulated(self, index, run).write(dir)?;
        }
        Simulated { settings: self.settings().clone(), runs: Vec::new() }.write_texts(dir)
    }
}

fn create(dir: &Path) -> Result<(), WriteError> {
    fs::create_dir_all(dir).map_err(|source| WriteError { path: dir.to_owned(), source })
}

fn simulated(scenario: &Scenario, index: usize, run: &Run) -> SimulatedRun {
    SimulatedRun { run: run.clone(), columns: record(scenario, index, run) }
}

impl Simulated {
    /// Simulates every run of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let runs = scenario.settings().runs.iter().enumerate();
        Self {
            runs: runs.map(|(index, run)| simulated(scenario, index, run)).collect(),
            settings: scenario.settings().clone(),
        }
    }

    /// Writes campaign.toml, the recordings and truth.toml into the folder `dir`, which is created if need be.
    ///
    /// # Errors
    /// The first file or folder that cannot be written.
    pub fn write(&self, dir: impl AsRef<Path>) -> Result<(), WriteError> {
        let dir = dir.as_ref();
        create(dir)?;
        self.runs.iter().try_for_each(|run| run.write(dir))?;
        self.write_texts(dir)
    }

    fn write_texts(&self, dir: &Path) -> Result<(), WriteError> {
        for (name, text) in [("campaign.toml", self.campaign_toml()), ("truth.toml", self.truth_toml())] {
            let path = dir.join(name);
            fs::write(&path, text).map_err(|source| WriteError { path, source })?;
        }
        Ok(())
    }

    /// The campaign's description.
    pub fn campaign_toml(&self) -> String {
        let s = &self.settings;
        let bench = s.runs.iter().any(|r| matches!(r, Run::Virtual { .. }));
        let campaign = Campaign {
            device: &s.device,
            instrument: s.instrument,
            carrier_hz: s.carrier_hz,
            angular_gain: s.angular_gain_stated,
            period_deg: (s.instrument == Instrument::Sensor).then_some(360.0),
            temperature_c: s.temperature.map(|t| t.reference_c),
            drive_per_s_v: bench.then_some(s.drive_per_s_v),
            control_hz: bench.then_some(s.control_hz),
        };
        let runs = s.runs.iter().map(CampaignRun::of).collect();
        serialised(&CampaignFile { campaign, run: runs })
    }

    /// What the bench was set to: what an identification should find.
    pub fn truth_toml(&self) -> String {
        let s = &self.settings;
        let mut truth = toml::Table::new();
        let sensor = s.instrument == Instrument::Sensor;
        for &id in EffectId::ALL {
            let description = id.description();
            if description.declared && (description.in_sensors || !sensor) {
                let neutral = EffectSetting { id, values: id.neutral() };
                let set = s.effects.iter().find(|e| e.id == id).unwrap_or(&neutral);
                for (parameter, value) in set.parameters() {
                    truth.insert(parameter.name.to_owned(), value.into());
                }
            }
        }
        truth.insert("angular_gain".to_owned(), s.angular_gain.into());
        if !sensor {
            truth.insert("tau_s".to_owned(), s.tau_s.into());
        }
        let undeclared = s.effects.iter().filter(|e| !e.id.description().declared);
        let mut ids: Vec<toml::Value> = undeclared.map(|e| e.id.description().id.into()).collect();
        let mut effects: Vec<toml::Value> = s.effects.iter().map(|e| toml::Table::from(*e).into()).collect();
        if let Some(spring) = &s.spring_isotropic {
            ids.push(SPRING_ISOTROPIC.into());
            let mut table = toml::Table::new();
            table.insert("id".to_owned(), SPRING_ISOTROPIC.into());
            table.insert("c".to_owned(), spring.c.into());
            table.insert("frequency_per_energy".to_owned(), spring.frequency_per_energy().into());
            effects.push(table.into());
        }
        truth.insert("undeclared".to_owned(), ids.into());
        truth.insert("effect".to_owned(), effects.into());
        format!("# what the bench was set to\n{}", serialised(&truth))
    }
}

fn serialised(value: &impl Serialize) -> String {
    // strings, numbers and tables only: TOML can hold all of it
    toml::to_string(value).unwrap_or_else(|e| unreachable!("plain tables serialise: {e}"))
}

#[derive(Serialize)]
struct CampaignFile<'a> {
    campaign: Campaign<'a>,
    run: Vec<CampaignRun<'a>>,
}

#[derive(Serialize)]
struct Campaign<'a> {
    device: &'a str,
    instrument: Instrument,
    #[serde(skip_serializing_if = "Option::is_none")]
    carrier_hz: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    angular_gain: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    period_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    temperature_c: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    drive_per_s_v: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    control_hz: Option<f64>,
}

#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum CampaignRun<'a> {
    Rotation {
        file: &'a str,
        settle_s: f64,
        #[serde(rename = "use")]
        purpose: Purpose,
        amplitude: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        rate_dps: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        raw: Option<Raw>,
    },
    Decay {
        file: &'a str,
        #[serde(rename = "use")]
        purpose: Purpose,
        amplitude: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        rate_dps: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        raw: Option<Raw>,
    },
    Ringdown {
        file: &'a str,
        angle_deg: f64,
        energy_off_s: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        raw: Option<Raw>,
    },
    Virtual {
        file: &'a str,
        settle_s: f64,
        #[serde(rename = "use")]
        purpose: Purpose,
    },
}

impl<'a> CampaignRun<'a> {
    fn of(run: &'a Run) -> Self {
        match run {
            Run::Rotation { file, settle_s, purpose, amplitude, rate_dps, profile, carrier_sample_hz, .. } => {
                // a column where it changes, and beside envelopes
                let constant = carrier_sample_hz.is_some() && *profile == Profile::Constant;
                let rate_dps = constant.then_some(*rate_dps);
                let raw = Raw::of(run);
                Self::Rotation { file, settle_s: *settle_s, purpose: *purpose, amplitude: *amplitude, rate_dps, raw }
            }
            Run::Decay { file, purpose, amplitude, rate_dps, carrier_sample_hz, .. } => Self::Decay {
                file,
                purpose: *purpose,
                amplitude: *amplitude,
                rate_dps: carrier_sample_hz.map(|_| *rate_dps),
                raw: Raw::of(run),
            },
            Run::Ringdown { file, angle_deg, energy_off_s, .. } => {
                Self::Ringdown { file, angle_deg: *angle_deg, energy_off_s: *energy_off_s, raw: Raw::of(run) }
            }
            Run::Virtual { file, settle_s, purpose, .. } => {
                Self::Virtual { file, settle_s: *settle_s, purpose: *purpose }
            }
        }
    }
}

/// The columns of one run.
fn record(scenario: &Scenario, index: usize, run: &Run) -> Vec<Column> {
    if let Some(sample_hz) = run.carrier_sample_hz() {
        return displacement::record(scenario, index, run, sample_hz);
    }
    let (count, every) = (scenario.control_samples(run), scenario.control_samples_per_row());
    let mut rows = Rows::default();
    if let Some(mut closed) = scenario.closed_loop(index) {
        let mut bench = Bench::of(run, scenario.settings().control_hz);
        for k in 0..count {
            let table_rad = closed.table_rad();
            let virtual_dps = bench.as_mut().map_or(0.0, |b| b.turn(&mut closed, k));
            closed.step();
            if k % every == 0 {
                rows.virtual_dps.push(virtual_dps);
                let seen = closed.seen();
                let z = &seen.readout;
                rows.t_s.push(seen.t_s);
                rows.rate_dps.push(closed.rate_rad_s().to_degrees());
                rows.table_deg.push(table_rad.to_degrees());
                rows.theta_deg.push(seen.compensated.pendulum().angle().to_degrees());
                for (column, value) in rows.channels.iter_mut().zip([z.x_c, z.x_s, z.y_c, z.y_s, seen.v_as, seen.v_qc])
                {
                    column.push(value);
                }
            }
        }
    } else if let Some((sensor, mut noise)) = scenario.sensor(index) {
        for reading in sensor.readings(count, every, &mut noise) {
            let z = &reading.readout;
            rows.t_s.push(reading.t_s);
            rows.rate_dps.push(reading.rate_rad_s.to_degrees());
            rows.table_deg.push(reading.table_rad.to_degrees());
            rows.theta_deg.push(z.y_c.atan2(z.x_c).to_degrees());
            for (column, value) in rows.channels.iter_mut().zip([z.x_c, 0.0, z.y_c]) {
                column.push(value);
            }
        }
    }
    rows.columns(scenario.settings(), index, run)
}

/// What is done to an instrument without a table.
struct Bench<'a> {
    virtual_dps: f64,
    reversal_s: f64,
    turned: &'a [[f64; 2]],
    control_hz: f64,
}

impl<'a> Bench<'a> {
    fn of(run: &'a Run, control_hz: f64) -> Option<Self> {
        let Run::Virtual { virtual_dps, reversal_s, turned, .. } = run else { return None };
        Some(Self { virtual_dps: *virtual_dps, reversal_s: *reversal_s, turned, control_hz })
    }

    /// Turns the pattern, and the instrument, at control sample `k`; gives the precession that is commanded, deg/s.
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "samples of a run"
    )]
    fn turn(&mut self, closed: &mut ClosedLoop, k: u64) -> f64 {
        let t = k as f64 / self.control_hz;
        if let [[from_s, rate_dps], later @ ..] = self.turned
            && t >= *from_s
        {
            closed.turn_at(rate_dps.to_radians());
            self.turned = later;
        }
        let leg = (t / self.reversal_s) as u64;
        let speed = if (leg / 2).is_multiple_of(2) { self.virtual_dps } else { 0.5 * self.virtual_dps };
        let virtual_dps = if leg.is_multiple_of(2) { speed } else { -speed };
        closed.precess_at(virtual_dps.to_radians());
        virtual_dps
    }
}

/// A recording while it grows.
#[derive(Default)]
struct Rows {
    t_s: Vec<f64>,
    rate_dps: Vec<f64>,
    table_deg: Vec<f64>,
    theta_deg: Vec<f64>,
    /// xc, xs, yc, ys, vas, vqc
    channels: [Vec<f64>; 6],
    virtual_dps: Vec<f64>,
}

impl Rows {
    fn columns(self, s: &Settings, index: usize, run: &Run) -> Vec<Column> {
        let reference = match run {
            Run::Rotation { reference, .. } => *reference,
            Run::Ringdown { .. } | Run::Decay { .. } | Run::Virtual { .. } => Reference::Rate,
        };
        // nobody records what turns an instrument without a table
        let bench = matches!(run, Run::Virtual { .. });
        let sensor = s.instrument == Instrument::Sensor;
        let is_driven = !sensor && !matches!(run, Run::Decay { .. });
        let temperature =
            s.temperature.map(|t| self.t_s.iter().map(|time| t.start_of(index) + t.drift_k_per_s * time).collect());
        let commanded = self.rate_dps.iter().map(|rate| (rate * 1e9).round() / 1e9).collect();
        let [x_c, x_s, y_c, y_s, v_as, v_qc] = self.channels;
        let candidates = [
            ("t_s", true, self.t_s),
            ("rate_dps", reference != Reference::Table && !bench, commanded),
            ("table_deg", reference != Reference::Rate && !bench, self.table_deg),
            ("xc_v", true, x_c),
            ("xs_v", !sensor, x_s),
            ("yc_v", true, y_c),
            ("ys_v", !sensor, y_s),
            ("vas_v", is_driven, v_as),
            ("vqc_v", is_driven, v_qc),
            ("virtual_dps", bench, self.virtual_dps),
            ("theta_deg", s.theta_deg, self.theta_deg),
            ("temp_c", temperature.is_some(), temperature.unwrap_or_default()),
        ];
        candidates
            .into_iter()
            .filter(|(_, wanted, _)| *wanted)
            .map(|(name, _, values)| Column { name, values })
            .collect()
    }
}
