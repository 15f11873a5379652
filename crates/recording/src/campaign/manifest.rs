//! The text of a campaign file into what it says: every key known, every value checked, every refusal with its line.
//!
//! No other file is opened here.

use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{Instrument, Reference, Role, RunKind};
use crate::Recording;
use crate::channel::Channel;
use crate::error::ReadError;
use crate::memory;
use crate::naming::Naming;
use crate::raw::{Number, Raw};

/// A place in the campaign file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Position {
    /// Line, from 1.
    pub(super) line: usize,
    /// Column, in characters, from 1.
    pub(super) column: usize,
}

/// A run as the campaign file has it.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub(super) kind: RunKind,
    pub(super) file: PathBuf,
    /// Where the file is named.
    pub(super) at: Position,
    /// How the numbers of a file stand in it that does not say so itself.
    pub(super) raw: Option<Raw>,
    pub(super) settle_s: f64,
    pub(super) role: Role,
    pub(super) amplitude: Option<f64>,
    /// Constant input rate of a file that has no column for it, deg/s.
    pub(super) rate_dps: Option<f64>,
}

/// What a campaign file says.
#[derive(Debug, Clone)]
pub(super) struct Manifest {
    pub(super) device: String,
    pub(super) instrument: Instrument,
    pub(super) carrier_hz: Option<f64>,
    pub(super) angular_gain: Option<f64>,
    pub(super) period_deg: Option<f64>,
    pub(super) reference: Option<Reference>,
    pub(super) pole_pairs: Option<f64>,
    pub(super) temperature_c: Option<f64>,
    pub(super) drive_per_s_v: Option<f64>,
    pub(super) control_hz: Option<f64>,
    /// What the recordings call their columns.
    pub(super) naming: Naming,
    pub(super) runs: Vec<Entry>,
    pub(super) warnings: Vec<String>,
}

/// The kinds of runs, before their settings are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Rotation,
    CrossAxis,
    Ringdown,
    Static,
    Decay,
    Virtual,
}

/// A refusal of a ring-down where there are no mechanics.
pub(super) fn ringdown_of_a_sensor(path: &Path, at: Position) -> ReadError {
    let what = "a sensor has nothing that rings down";
    refuse(path, at, what.to_owned(), "rotation runs only, or `instrument = \"gyroscope\"`".to_owned())
}

impl Entry {
    /// Gives a recording without a reference of its own the constant rate that the campaign file states; says so where it
    /// has one and keeps it.
    ///
    /// # Errors
    /// Where a column more is more than is allowed.
    pub(super) fn constant_rate(&self, recording: &mut Recording) -> Result<Option<String>, ReadError> {
        let Some(rate_dps) = self.rate_dps else { return Ok(None) };
        if recording.rate_dps.is_some() || recording.table_deg.is_some() {
            let own = if recording.table_deg.is_some() { "table_deg" } else { "rate_dps" };
            let file = self.file.display();
            let said = format!("{file}: has {own} itself; `rate_dps = {rate_dps}` of the campaign file is not used");
            return Ok(Some(said));
        }
        let columns = Channel::ALL.into_iter().filter(|channel| recording.channel(*channel).is_some()).count();
        memory::allow_columns(columns + 1, recording.len(), "the recording with its rate", &recording.source)?;
        recording.rate_dps = Some(vec![rate_dps; recording.len()]);
        Ok(None)
    }
}

/// A refusal of something at a place of the file.
pub(super) fn refuse(path: &Path, at: Position, what: String, wanted: String) -> ReadError {
    ReadError::Campaign { path: path.to_path_buf(), line: at.line, column: at.column, what, wanted }
}

const CAMPAIGN_KEYS: &[&str] = &[
    "device",
    "instrument",
    "carrier_hz",
    "angular_gain",
    "period_deg",
    "reference",
    "pole_pairs",
    "temperature_c",
    "drive_per_s_v",
    "control_hz",
];
const ROTATION_KEYS: &[&str] = &["kind", "file", "raw", "settle_s", "use", "amplitude", "rate_dps"];
const CROSS_AXIS_KEYS: &[&str] = &["kind", "file", "raw", "settle_s", "rate_dps"];
const STATIC_KEYS: &[&str] = &["kind", "file", "raw", "settle_s"];
const DECAY_KEYS: &[&str] = &["kind", "file", "raw", "settle_s", "use", "amplitude", "rate_dps"];
const VIRTUAL_KEYS: &[&str] = &["kind", "file", "raw", "settle_s", "use", "amplitude"];
const RINGDOWN_KEYS: &[&str] = &["kind", "file", "raw", "angle_deg", "energy_off_s", "settle_s", "use", "amplitude"];

/// No temperature is below, °C.
const ABSOLUTE_ZERO_C: f64 = -273.15;

/// Understands a campaign file.
pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<Manifest, ReadError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => {
            let read = String::from_utf8_lossy(&bytes[..error.valid_up_to()]);
            let end = read.len();
            return Err(Text { text: &read, path }.refuse(end..end, "the text is not UTF-8", "TOML in UTF-8"));
        }
    };
    let text = Text { text, path };
    let document = DeTable::parse(text.text)
        .map_err(|error| text.refuse(error.span().unwrap_or(0..0), error.message().to_owned(), "valid TOML"))?;
    text.manifest(document.get_ref())
}

/// The text of the file, to tell places in it.
struct Text<'a> {
    text: &'a str,
    path: &'a Path,
}

type Value<'a> = Spanned<DeValue<'a>>;

impl Text<'_> {
    fn position(&self, span: &Range<usize>) -> Position {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        Position { line: before.matches('\n').count() + 1, column: before[line_start..].chars().count() + 1 }
    }

    fn refuse(&self, span: Range<usize>, what: impl Into<String>, wanted: impl Into<String>) -> ReadError {
        refuse(self.path, self.position(&span), what.into(), wanted.into())
    }

    fn manifest(&self, document: &DeTable<'_>) -> Result<Manifest, ReadError> {
        self.refuse_unknown(document, &["campaign", "columns", "run"], "at the top of a campaign file")?;
        let Some(campaign) = get(document, "campaign") else {
            return Err(self.refuse(0..0, "there is no `[campaign]`", "a table `[campaign]` with the key `device`"));
        };
        let head = campaign.get_ref().as_table().ok_or_else(|| {
            self.refuse(campaign.span(), "`campaign` is not a table", "a table `[campaign]` with the key `device`")
        })?;
        self.refuse_unknown(head, CAMPAIGN_KEYS, "in `[campaign]`")?;
        let mut warnings = vec![];
        let device = if let Some(value) = get(head, "device") {
            self.string(value, "device")?.to_owned()
        } else {
            let name = self.path.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
            let name = name.unwrap_or_else(|| "unnamed".to_owned());
            let file = self.path.display();
            warnings.push(format!("{file}: `device` is not given; `{name}` is taken, the name of the folder"));
            name
        };
        let instruments = [("gyroscope", Instrument::Gyroscope), ("sensor", Instrument::Sensor)];
        let instrument = self.choice(head, "instrument", &instruments)?.unwrap_or_default();
        let carrier_hz = self.number(head, "carrier_hz", "a positive number of Hz", |value| value > 0.0)?;
        let angular_gain = self.number(head, "angular_gain", "a number other than 0", |value| value != 0.0)?;
        let period_deg = self.number(head, "period_deg", "180 or 360", |value| value == 180.0 || value == 360.0)?;
        let references =
            [("measured", Reference::Measured), ("commanded", Reference::Commanded), ("none", Reference::Absent)];
        let reference = self.choice(head, "reference", &references)?;
        let is_count = |value: f64| value >= 1.0 && value.fract() == 0.0;
        let pole_pairs = self.number(head, "pole_pairs", "a whole number from 1 on", is_count)?;
        let temperature_c =
            self.number(head, "temperature_c", "a temperature in °C", |value| value > ABSOLUTE_ZERO_C)?;
        let drive_per_s_v =
            self.number(head, "drive_per_s_v", "a positive number of V/s per V", |value| value > 0.0)?;
        let control_hz = self.number(head, "control_hz", "a positive number of Hz", |value| value > 0.0)?;
        let naming = self.columns(document)?;
        let runs = self.runs(document, instrument)?;
        Ok(Manifest {
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
            naming,
            runs,
            warnings,
        })
    }

    /// `[columns]`: a channel on the left, what the recordings call it on the right.
    fn columns(&self, document: &DeTable<'_>) -> Result<Naming, ReadError> {
        const WANTED: &str = "a channel and the name of its column, as in `theta_deg = \"Ch3\"`";
        let mut naming = Naming::default();
        let Some(columns) = get(document, "columns") else { return Ok(naming) };
        let Some(table) = columns.get_ref().as_table() else {
            return Err(self.refuse(columns.span(), "`columns` is not a table", WANTED));
        };
        for (channel, column) in table {
            let name = self.string(column, channel.get_ref())?;
            naming
                .add(&format!("{}={name}", channel.get_ref()))
                .map_err(|what| self.refuse(channel.span(), what, WANTED))?;
        }
        Ok(naming)
    }

    fn runs(&self, document: &DeTable<'_>, instrument: Instrument) -> Result<Vec<Entry>, ReadError> {
        const WANTED: &str = "at least one `[[run]]` with `kind = \"rotation\"` and a `file`";
        let Some(runs) = get(document, "run") else {
            return Err(self.refuse(0..0, "there is no `[[run]]`", WANTED));
        };
        let Some(list) = runs.get_ref().as_array() else {
            return Err(self.refuse(runs.span(), "`run` is not a list of tables", "each run as a table `[[run]]`"));
        };
        let mut entries = vec![];
        for run in list {
            let Some(table) = run.get_ref().as_table() else {
                return Err(self.refuse(run.span(), "a run is not a table", "each run as a table `[[run]]`"));
            };
            entries.push(self.run(table, run.span(), instrument)?);
        }
        let is_rotation = |entry: &Entry| entry.kind == RunKind::Rotation;
        if !entries.is_empty() && entries.iter().all(|entry| entry.kind == RunKind::Static) {
            return Ok(entries);
        }
        let is_decay = |entry: &Entry| entry.kind == RunKind::Decay;
        let is_virtual = |entry: &Entry| entry.kind == RunKind::Virtual;
        if let Some(entry) = entries.iter().find(|entry| is_virtual(entry))
            && !entries.iter().all(is_virtual)
        {
            let what = "a run of virtual precession beside runs of another kind".to_owned();
            let wanted = "a campaign of its own: it needs no reference, and is not identified against one".to_owned();
            return Err(refuse(self.path, entry.at, what, wanted));
        }
        if !entries.iter().any(|entry| is_rotation(entry) || is_decay(entry) || is_virtual(entry)) {
            return Err(self.refuse(runs.span(), "no run is a rotation", WANTED));
        }
        for kind in [RunKind::Rotation, RunKind::Decay, RunKind::Virtual] {
            let mut alike = entries.iter().filter(|entry| entry.kind == kind).peekable();
            if alike.peek().is_some() && alike.all(|entry| entry.role == Role::Holdout) {
                let kind = kind.name();
                let what = format!("every {kind} run has `use = \"holdout\"`, so that nothing is left to fit");
                return Err(self.refuse(runs.span(), what, format!("a {kind} run with `use = \"fit\"`, the default")));
            }
        }
        Ok(entries)
    }

    fn run(&self, table: &DeTable<'_>, span: Range<usize>, instrument: Instrument) -> Result<Entry, ReadError> {
        let kinds = [
            ("rotation", Kind::Rotation),
            ("ringdown", Kind::Ringdown),
            ("static", Kind::Static),
            ("decay", Kind::Decay),
            ("virtual", Kind::Virtual),
            ("cross-axis", Kind::CrossAxis),
        ];
        let Some(kind) = self.choice(table, "kind", &kinds)? else {
            let wanted = "`kind = \"rotation\"`, \"ringdown\", \"static\", \"decay\", \"virtual\" or \"cross-axis\"";
            return Err(self.refuse(span, "this run has no `kind`", wanted));
        };
        if matches!(kind, Kind::Ringdown | Kind::Decay | Kind::Virtual) && instrument == Instrument::Sensor {
            return Err(ringdown_of_a_sensor(self.path, self.position(&span)));
        }
        let (keys, place) = match kind {
            Kind::Rotation => (ROTATION_KEYS, "in a rotation run"),
            Kind::CrossAxis => (CROSS_AXIS_KEYS, "in a run across the input axis"),
            Kind::Ringdown => (RINGDOWN_KEYS, "in a ring-down"),
            Kind::Static => (STATIC_KEYS, "in a run at rest"),
            Kind::Decay => (DECAY_KEYS, "in a free decay"),
            Kind::Virtual => (VIRTUAL_KEYS, "in a run of virtual precession"),
        };
        self.refuse_unknown(table, keys, place)?;
        let Some(file) = get(table, "file") else {
            return Err(self.refuse(span, "this run has no `file`", "the path of a recording, relative to this file"));
        };
        let name = self.string(file, "file")?;
        if name.is_empty() {
            return Err(self.refuse(file.span(), "`file` is empty", "the path of a recording, relative to this file"));
        }
        let required = |key: &str, wanted: &str, is_right: fn(f64) -> bool| {
            let missing =
                || self.refuse(span.clone(), format!("this ring-down has no `{key}`"), format!("`{key}`, {wanted}"));
            self.number(table, key, wanted, is_right)?.ok_or_else(missing)
        };
        let kind = match kind {
            Kind::Rotation => RunKind::Rotation,
            Kind::CrossAxis => RunKind::CrossAxis,
            Kind::Static => RunKind::Static,
            Kind::Decay => RunKind::Decay,
            Kind::Virtual => RunKind::Virtual,
            Kind::Ringdown => RunKind::Ringdown {
                angle_deg: required("angle_deg", "the angle in degrees at which the pattern is held", |_| true)?,
                energy_off_s: required(
                    "energy_off_s",
                    "the positive time in s at which the energy loop goes off",
                    |value| value > 0.0,
                )?,
            },
        };
        Ok(Entry {
            kind,
            file: PathBuf::from(name),
            at: self.position(&file.span()),
            raw: get(table, "raw").map(|value| self.raw(value)).transpose()?,
            settle_s: self.number(table, "settle_s", "0 or more seconds", |value| value >= 0.0)?.unwrap_or(0.0),
            role: self.choice(table, "use", &[("fit", Role::Fit), ("holdout", Role::Holdout)])?.unwrap_or_default(),
            amplitude: self.number(table, "amplitude", "a positive relative amplitude", |value| value > 0.0)?,
            rate_dps: self.number(table, "rate_dps", "a constant rate in deg/s", |_| true)?,
        })
    }

    /// `raw`: how the numbers of a run's file stand in it.
    fn raw(&self, value: &Value<'_>) -> Result<Raw, ReadError> {
        const WANTED: &str = "as in `raw = { columns = [\"x_v\", \"y_v\"], number = \"f32\", sample_hz = 200000.0 }`";
        let Some(table) = value.get_ref().as_table() else {
            return Err(self.refuse(value.span(), "`raw` is not a table", WANTED));
        };
        self.refuse_unknown(table, &["columns", "number", "sample_hz"], "in `raw`")?;
        let missing = |key: &str| self.refuse(value.span(), format!("`raw` has no `{key}`"), WANTED);
        let columns = get(table, "columns").ok_or_else(|| missing("columns"))?;
        let Some(list) = columns.get_ref().as_array().filter(|list| !list.is_empty()) else {
            return Err(self.refuse(columns.span(), "`columns` is not a list of names", WANTED));
        };
        Ok(Raw {
            columns: list
                .iter()
                .map(|name| self.string(name, "columns").map(str::to_owned))
                .collect::<Result<_, _>>()?,
            number: self.choice(table, "number", &Number::NAMES)?.ok_or_else(|| missing("number"))?,
            sample_hz: self
                .number(table, "sample_hz", "a positive number of rows a second", |value| value > 0.0)?
                .ok_or_else(|| missing("sample_hz"))?,
        })
    }

    /// Refuses the first key that has no meaning.
    fn refuse_unknown(&self, table: &DeTable<'_>, known: &[&str], place: &str) -> Result<(), ReadError> {
        let unknown =
            table.keys().filter(|key| !known.contains(&key.get_ref().as_ref())).min_by_key(|key| key.span().start);
        let Some(key) = unknown else {
            return Ok(());
        };
        let names: Vec<String> = known.iter().map(|key| format!("`{key}`")).collect();
        let what = format!("the key `{}` has no meaning {place}", key.get_ref());
        Err(self.refuse(key.span(), what, format!("one of {}", names.join(", "))))
    }

    fn string<'v>(&self, value: &'v Value<'_>, key: &str) -> Result<&'v str, ReadError> {
        let wrong = || self.refuse(value.span(), format!("`{key}` is not a string"), "text in quotes");
        value.get_ref().as_str().ok_or_else(wrong)
    }

    fn choice<T: Copy>(&self, table: &DeTable<'_>, key: &str, choices: &[(&str, T)]) -> Result<Option<T>, ReadError> {
        let Some(value) = get(table, key) else {
            return Ok(None);
        };
        let word = self.string(value, key)?;
        if let Some(&(_, choice)) = choices.iter().find(|(name, _)| *name == word) {
            return Ok(Some(choice));
        }
        let names: Vec<String> = choices.iter().map(|(name, _)| format!("\"{name}\"")).collect();
        Err(self.refuse(value.span(), format!("`{key}` is {word:?}"), names.join(" or ")))
    }

    fn number(
        &self,
        table: &DeTable<'_>,
        key: &str,
        wanted: &str,
        is_right: fn(f64) -> bool,
    ) -> Result<Option<f64>, ReadError> {
        let Some(value) = get(table, key) else {
            return Ok(None);
        };
        let number = match value.get_ref() {
            DeValue::Float(float) => float.as_str().replace('_', "").parse::<f64>().ok(),
            DeValue::Integer(integer) => {
                i64::from_str_radix(&integer.as_str().replace('_', ""), integer.radix()).ok().map(|value| value as f64)
            }
            _ => None,
        };
        let written = self.text.get(value.span()).unwrap_or_default();
        match number.filter(|number| number.is_finite() && is_right(*number)) {
            Some(number) => Ok(Some(number)),
            None => Err(self.refuse(value.span(), format!("`{key}` is {written}"), wanted)),
        }
    }
}

fn get<'t, 'a>(table: &'t DeTable<'a>, key: &str) -> Option<&'t Value<'a>> {
    table.iter().find(|(name, _)| name.get_ref().as_ref() == key).map(|(_, value)| value)
}
