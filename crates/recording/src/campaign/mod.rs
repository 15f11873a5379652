//! A campaign: the runs that were made with one instrument, each with its recording.
//!
//! Opens a campaign file with all its recordings, or a single recording as a campaign of one run. Columns that a kind of
//! run needs are asked for; whether they show what the campaign says they show is the identification's to find out.

mod manifest;

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::Recording;
use super::error::ReadError;
use super::naming::Naming;
use super::{raw, text};
use manifest::{Entry, Manifest, Position};

/// What kind of instrument was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Instrument {
    /// A whole-angle gyroscope: loops, mechanics, ring-downs.
    #[default]
    Gyroscope,
    /// A two-channel angle sensor: a readout and nothing else.
    Sensor,
}

impl Instrument {
    /// The word for it in campaigns, reports and calibrations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gyroscope => "gyroscope",
            Self::Sensor => "sensor",
        }
    }
}

/// What the reference of a campaign is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// The angle or the rate was measured.
    Measured,
    /// It is what was asked for: the table may have done something else.
    Commanded,
    /// There is none: columns that look like one are not to be used.
    Absent,
}

/// What was done in a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RunKind {
    /// The instrument was turned.
    Rotation,
    /// The pattern was held while the energy loop was switched off.
    Ringdown {
        /// Angle at which the rate loop holds the pattern, deg.
        angle_deg: f64,
        /// Time at which the energy loop is switched off, s, on the time axis of the recording; positive.
        energy_off_s: f64,
    },
    /// A rate gyroscope was turned about an axis across its input axis.
    CrossAxis,
    /// The instrument stood still.
    Static,
    /// The resonator rang freely, without any loop.
    Decay,
    /// In its loops, its pattern turned by its own forces, or by a rotation that nobody recorded.
    Virtual,
}

impl RunKind {
    /// Its name in a campaign file.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Rotation => "rotation",
            Self::Ringdown { .. } => "ringdown",
            Self::CrossAxis => "cross-axis",
            Self::Static => "static",
            Self::Decay => "decay",
            Self::Virtual => "virtual",
        }
    }
}

/// What a run is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Role {
    /// Parameters are fitted to it.
    #[default]
    Fit,
    /// The result is tested on it, and nothing is fitted to it.
    Holdout,
}

/// One run of a campaign.
#[derive(Debug, Clone)]
pub struct Run {
    /// What was done.
    pub kind: RunKind,
    /// The recording's file as the campaign names it; [`Recording::source`] is where it was found.
    pub file: PathBuf,
    /// Time at the start of the run that is not used, s; zero or more.
    pub settle_s: f64,
    /// What it is used for.
    pub role: Role,
    /// Relative set amplitude, positive.
    pub amplitude: Option<f64>,
    /// What was recorded.
    pub recording: Recording,
}

impl Run {
    /// The rows that are left after settling: from [`Run::settle_s`] after the first time stamp on.
    ///
    /// # Errors
    /// [`ReadError::NothingSettled`] where no row is left.
    pub fn settled(&self) -> Result<Range<usize>, ReadError> {
        let t_s = &self.recording.t_s;
        let first_s = t_s.first().copied().unwrap_or(0.0);
        let start = t_s.partition_point(|&t_s| t_s - first_s < self.settle_s);
        if start < t_s.len() {
            return Ok(start..t_s.len());
        }
        let duration_s = t_s.last().copied().unwrap_or(0.0) - first_s;
        let path = self.recording.source.clone();
        Err(ReadError::NothingSettled { path, settle_s: self.settle_s, duration_s })
    }
}

/// What a campaign says of a recording that has just been read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Said<'a> {
    /// Its file as the campaign names it.
    pub file: &'a Path,
    /// What was done.
    pub kind: RunKind,
    /// Frequency of the carrier, Hz, where it is stated.
    pub carrier_hz: Option<f64>,
}

/// The runs made with one instrument.
#[derive(Debug, Clone, Default)]
pub struct Campaign {
    /// The campaign file, or the recording where there is no campaign file.
    pub source: PathBuf,
    /// Name of the instrument.
    pub device: String,
    /// Its kind.
    pub instrument: Instrument,
    /// Frequency of the carrier, Hz; positive.
    pub carrier_hz: Option<f64>,
    /// Start value of the angular gain, not zero; negative for an angle that counts the other way.
    pub angular_gain: Option<f64>,
    /// Period of the angle from I/Q, deg: 180 for a pattern angle, 360 for a full-turn sensor.
    pub period_deg: Option<f64>,
    /// Whether the reference was measured or only asked for, where the campaign says so.
    pub reference: Option<Reference>,
    /// Periods of the sensor's angle per turn of its reference, where the campaign says so.
    pub pole_pairs: Option<f64>,
    /// Temperature that parameters refer to, °C, where the campaign says so.
    pub temperature_c: Option<f64>,
    /// What a volt of command makes of the envelope as designed, V/s, where the campaign says so; positive.
    pub drive_per_s_v: Option<f64>,
    /// Control steps a second, Hz, where the campaign says so: forces are held that long. Positive.
    pub control_hz: Option<f64>,
    /// The runs, in the order of the file.
    pub runs: Vec<Run>,
    /// What a reader of the result should know of the campaign file; the recordings have their own warnings.
    pub warnings: Vec<String>,
}

impl Campaign {
    /// Opens a campaign file (`.toml`) with all its recordings, or any other file as a recording of one rotation.
    ///
    /// # Errors
    /// [`ReadError`]: the campaign file says something it cannot mean, or a recording is not there, is refused, lacks
    /// columns that its kind of run needs, or has no row left after settling.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::open_named(path, Naming::NONE)
    }

    /// [`Campaign::open`] for recordings whose columns have names of their own.
    ///
    /// # Errors
    /// As [`Campaign::open`], and where a mapped column is not there.
    pub fn open_named(path: &Path, naming: &Naming) -> Result<Self, ReadError> {
        Self::open_as(path, naming, None)
    }

    /// [`Campaign::open_named`] of an instrument that is known from elsewhere; it stands over what the file says.
    ///
    /// # Errors
    /// As [`Campaign::open_named`], and where a sensor has a ring-down.
    pub fn open_as(path: &Path, naming: &Naming, instrument: Option<Instrument>) -> Result<Self, ReadError> {
        Self::open_made(path, naming, instrument, |recording, _| recording)
    }

    /// [`Campaign::open_as`] with something else made of each recording before the next is read, and before a constant rate is put
    /// beside it: what is held at once is then one recording as it was read, and what was made of the others.
    ///
    /// # Errors
    /// As [`Campaign::open_as`].
    pub fn open_made(
        path: &Path,
        naming: &Naming,
        instrument: Option<Instrument>,
        mut made: impl FnMut(Recording, Said<'_>) -> Recording,
    ) -> Result<Self, ReadError> {
        let is_manifest = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
        if is_manifest {
            return Self::open_manifest(path, naming, instrument, made);
        }
        let recording = Recording::read_named(path, naming)?;
        let file = path.file_name().map_or(path, Path::new);
        let recording = made(recording, Said { file, kind: RunKind::Rotation, carrier_hz: None });
        Self::of_recordings_as(vec![recording], instrument.unwrap_or_default())
    }

    /// A campaign of rotation runs that has no campaign file: all are fitted to, none is given a time to settle. It is
    /// named after its recording, or after the folder that several lie in.
    ///
    /// # Errors
    /// [`ReadError::MissingColumns`] where a recording is none of a rotation.
    pub fn of_recordings(recordings: Vec<Recording>) -> Result<Self, ReadError> {
        Self::of_recordings_as(recordings, Instrument::default())
    }

    /// [`Campaign::of_recordings`] of this instrument. A sensor's need no reference: its two channels tell their own errors.
    ///
    /// # Errors
    /// As [`Campaign::of_recordings`].
    pub fn of_recordings_as(recordings: Vec<Recording>, instrument: Instrument) -> Result<Self, ReadError> {
        let sources: Vec<PathBuf> = recordings.iter().map(|r| r.source.clone()).collect();
        let name = match sources.as_slice() {
            [one] => stem(one).map(OsStr::to_owned),
            [first, ..] => std::path::absolute(first).ok().and_then(|p| Some(p.parent()?.file_name()?.to_owned())),
            [] => None,
        };
        let device = name.map_or_else(|| "recordings".to_owned(), |name| name.to_string_lossy().into_owned());
        let runs = recordings.into_iter().map(|r| Self::rotation(r, instrument)).collect::<Result<_, _>>()?;
        Ok(Self { source: sources.into_iter().next().unwrap_or_default(), device, instrument, runs, ..Self::default() })
    }

    /// What a campaign file says its recordings call their columns.
    ///
    /// # Errors
    /// [`ReadError`]: the campaign file cannot be read, or says something it cannot mean.
    pub fn columns(path: &Path) -> Result<Naming, ReadError> {
        Ok(Self::manifest(path)?.naming)
    }

    fn rotation(recording: Recording, instrument: Instrument) -> Result<Run, ReadError> {
        let path = recording.source.clone();
        recording.require_turn(instrument, None)?;
        Ok(Run {
            kind: RunKind::Rotation,
            file: path.file_name().map(PathBuf::from).unwrap_or_default(),
            settle_s: 0.0,
            role: Role::Fit,
            amplitude: None,
            recording,
        })
    }

    fn manifest(path: &Path) -> Result<Manifest, ReadError> {
        let io = |error| ReadError::io(path, error);
        if std::fs::metadata(path).map_err(io)?.is_dir() {
            return Err(ReadError::Directory { path: path.to_path_buf() });
        }
        manifest::parse(&text::bytes_of(path).map_err(io)?, path)
    }

    fn open_manifest(
        path: &Path,
        naming: &Naming,
        instrument: Option<Instrument>,
        mut made: impl FnMut(Recording, Said<'_>) -> Recording,
    ) -> Result<Self, ReadError> {
        let manifest = Self::manifest(path)?;
        let carrier_hz = manifest.carrier_hz;
        let read = |entry: &Entry, file: &Path, naming: &Naming| {
            let recording = match &entry.raw {
                Some(raw) => raw::read(file, raw, naming)?,
                None => Recording::read_named(file, naming)?,
            };
            Ok(made(recording, Said { file: &entry.file, kind: entry.kind, carrier_hz }))
        };
        Self::assembled(manifest, path, naming, instrument, read)
    }

    /// The campaign of a campaign file's text, its recordings given by `read`, which is asked for each by the path that the
    /// text names it by, joined to the folder of `path`; `path` is what errors call the text, and need not be a file.
    ///
    /// # Errors
    /// As [`Campaign::open_as`], and what `read` refuses.
    pub fn of_text(
        text: &str,
        path: &Path,
        naming: &Naming,
        instrument: Option<Instrument>,
        mut read: impl FnMut(&Path, &Naming) -> Result<Recording, ReadError>,
    ) -> Result<Self, ReadError> {
        // what is given is no file that could be raw
        let read = |_: &Entry, file: &Path, naming: &Naming| read(file, naming);
        Self::assembled(manifest::parse(text.as_bytes(), path)?, path, naming, instrument, read)
    }

    fn assembled(
        manifest: Manifest,
        path: &Path,
        naming: &Naming,
        instrument: Option<Instrument>,
        mut read: impl FnMut(&Entry, &Path, &Naming) -> Result<Recording, ReadError>,
    ) -> Result<Self, ReadError> {
        let instrument = instrument.unwrap_or(manifest.instrument);
        let naming = &naming.over(&manifest.naming);
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut runs: Vec<Run> = vec![];
        let mut warnings = manifest.warnings.clone();
        for entry in &manifest.runs {
            let file = folder.join(&entry.file);
            let mut recording =
                read(entry, &file, naming).map_err(|error| explain(error, path, &entry.file, entry.at))?;
            warnings.extend(entry.constant_rate(&mut recording)?);
            match entry.kind {
                RunKind::Rotation => recording.require_turn(instrument, manifest.reference)?,
                RunKind::CrossAxis => recording.require_rotation()?,
                RunKind::Ringdown { .. } | RunKind::Virtual if instrument == Instrument::Sensor => {
                    return Err(manifest::ringdown_of_a_sensor(path, entry.at));
                }
                RunKind::Ringdown { .. } => recording.require_ringdown()?,
                // every recording has an angle
                RunKind::Static => {}
                RunKind::Decay => recording.require_decay()?,
                RunKind::Virtual => recording.require_virtual()?,
            }
            if runs.iter().any(|other| other.recording.source == file) {
                warnings.push(format!(
                    "{}: line {}: `{}` is named by more than one run",
                    path.display(),
                    entry.at.line,
                    entry.file.display()
                ));
            }
            let run = Run {
                kind: entry.kind,
                file: entry.file.clone(),
                settle_s: entry.settle_s,
                role: entry.role,
                amplitude: entry.amplitude,
                recording,
            };
            run.settled()?;
            runs.push(run);
        }
        let Manifest { device, carrier_hz, angular_gain, period_deg, reference, pole_pairs, temperature_c, .. } =
            manifest;
        let (drive_per_s_v, control_hz) = (manifest.drive_per_s_v, manifest.control_hz);
        Ok(Self {
            source: path.to_path_buf(),
            device,
            instrument,
            carrier_hz,
            angular_gain,
            period_deg,
            reference,
            pole_pairs,
            temperature_c,
            drive_per_s_v,
            control_hz,
            runs,
            warnings,
        })
    }

    /// All warnings: the campaign's, then those of each recording.
    pub fn all_warnings(&self) -> impl Iterator<Item = &str> {
        let recordings = self.runs.iter().flat_map(|run| &run.recording.warnings);
        self.warnings.iter().chain(recordings).map(String::as_str)
    }

    /// The campaign file that says this, with the runs' files as [`Run::file`] names them. It goes with the recordings as they
    /// are written: what a campaign file says of their columns or of a constant rate is in these.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut text = format!("[campaign]\ndevice = {}\n", quoted(&self.device));
        if self.instrument == Instrument::Sensor {
            text.push_str("instrument = \"sensor\"\n");
        }
        push_number(&mut text, "carrier_hz", self.carrier_hz);
        push_number(&mut text, "angular_gain", self.angular_gain);
        push_number(&mut text, "period_deg", self.period_deg);
        push_number(&mut text, "pole_pairs", self.pole_pairs);
        push_number(&mut text, "temperature_c", self.temperature_c);
        push_number(&mut text, "drive_per_s_v", self.drive_per_s_v);
        push_number(&mut text, "control_hz", self.control_hz);
        if let Some(reference) = self.reference {
            let word = match reference {
                Reference::Measured => "measured",
                Reference::Commanded => "commanded",
                Reference::Absent => "none",
            };
            let _ = writeln!(text, "reference = \"{word}\"");
        }
        for run in &self.runs {
            let kind = run.kind.name();
            let file = quoted(&run.file.to_string_lossy());
            // Writing to a string does not fail.
            let _ = write!(text, "\n[[run]]\nkind = \"{kind}\"\nfile = {file}\n");
            if let RunKind::Ringdown { angle_deg, energy_off_s } = run.kind {
                push_number(&mut text, "angle_deg", Some(angle_deg));
                push_number(&mut text, "energy_off_s", Some(energy_off_s));
            }
            push_number(&mut text, "settle_s", Some(run.settle_s).filter(|&settle_s| settle_s > 0.0));
            if run.role == Role::Holdout {
                text.push_str("use = \"holdout\"\n");
            }
            push_number(&mut text, "amplitude", run.amplitude);
        }
        text
    }
}

/// The name of a file without what says how it is written: `encoder` of `encoder.csv` and of `encoder.csv.gz`.
#[must_use]
pub fn stem(path: &Path) -> Option<&OsStr> {
    let stem = path.file_stem()?;
    let is_packed = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    Path::new(stem).file_stem().filter(|_| is_packed).or(Some(stem))
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

fn push_number(text: &mut String, key: &str, value: Option<f64>) {
    if let Some(value) = value {
        let _ = writeln!(text, "{key} = {}", toml::Value::from(value));
    }
}

/// An error of a run's file that is not there says where the campaign names it; others speak for themselves.
fn explain(error: ReadError, path: &Path, file: &Path, at: Position) -> ReadError {
    let (found, looked_for) = match &error {
        ReadError::NotFound { path } => ("is not there", path.clone()),
        ReadError::Directory { path } => ("is a directory", path.clone()),
        _ => return error,
    };
    manifest::refuse(
        path,
        at,
        format!("the file `{}` of this run {found} (looked for {})", file.display(), looked_for.display()),
        "a recording, with its path relative to this file".to_owned(),
    )
}
