//! Identification and inspection.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use cvg_calibration::recording::{Campaign, Cells, Recording, Values};
use cvg_calibration::{Answer, Identification};
use cvg_cli::Failure;
use cvg_cli::service::{self, Answered, Columns, Limits, Settings, Unanswered};
use pyo3::prelude::*;

use crate::arrow::Table;
use crate::calibration::Calibration;
use crate::columns::{columns, naming};
use crate::errors::{failed, unanswered};
use crate::work::aside;

/// A parameter: name, unit, value, ends of its 95 % interval.
type Parameter = (String, String, f64, Option<f64>, Option<f64>);

/// A limit: place, value where it is told, least, most, whether it passes, and the command's line.
type Verdict = (String, Option<f64>, Option<f64>, Option<f64>, bool, String);

/// An answer.
#[pyclass(frozen, module = "cvg._cvg")]
#[derive(Debug)]
pub(crate) struct Report {
    answered: Arc<Answered>,
    parameters: Vec<Parameter>,
    verdicts: Vec<Verdict>,
}

impl Report {
    fn identified(&self) -> Option<&Identification> {
        match self.answered.answer() {
            Answer::Identified(identified) => Some(identified),
            Answer::Surveyed(_) => None,
        }
    }
}

#[pymethods]
impl Report {
    fn to_json(&self) -> &str {
        self.answered.json()
    }

    fn html(&self, py: Python<'_>) -> PyResult<String> {
        let answered = Arc::clone(&self.answered);
        aside(py, None, move |_| answered.page())?.map_err(|e| failed(py, &e))
    }

    fn summary(&self) -> String {
        self.answered.summary()
    }

    fn parameters(&self) -> Vec<Parameter> {
        self.parameters.clone()
    }

    fn verdicts(&self) -> Vec<Verdict> {
        self.verdicts.clone()
    }

    fn calibration(&self) -> Option<Calibration> {
        self.answered.calibration().cloned().map(Calibration::new)
    }

    /// What is left of the angle over time, run by run.
    fn residuals(&self) -> PyResult<Table> {
        let (mut run, mut t_s, mut error_deg) = (Cells::default(), Vec::new(), Vec::new());
        let curves =
            self.identified().and_then(|i| i.plots.as_ref()).map(|p| p.residuals.as_slice()).unwrap_or_default();
        for curve in curves {
            curve.t_s.iter().for_each(|_| run.push(self.answered.run(&curve.name)));
            t_s.extend_from_slice(&curve.t_s);
            error_deg.extend_from_slice(&curve.error_deg);
        }
        let numbers = |name: &str, values| (name.to_owned(), Values::Numbers(values));
        Table::of(vec![("run".to_owned(), Values::Texts(run)), numbers("t_s", t_s), numbers("error_deg", error_deg)])
    }

    /// The held-out angle error over the pattern angle, at every stage.
    fn bias(&self) -> PyResult<Table> {
        let mut run = Cells::default();
        let mut columns: [(&str, Vec<f64>); 4] =
            ["pattern_deg", "raw_deg", "declared_deg", "discovered_deg"].map(|name| (name, Vec::new()));
        for curve in self.identified().map(|i| i.figures.bias.as_slice()).unwrap_or_default() {
            curve.pattern_deg.iter().for_each(|_| run.push(self.answered.run(&curve.name)));
            let of = [&curve.pattern_deg, &curve.raw_deg, &curve.declared_deg, &curve.discovered_deg];
            for ((_, column), values) in columns.iter_mut().zip(of) {
                column.extend_from_slice(values);
                column.resize(run.len(), f64::NAN);
            }
        }
        let mut all = vec![("run".to_owned(), Values::Texts(run))];
        all.extend(columns.map(|(name, values)| (name.to_owned(), Values::Numbers(values))));
        Table::of(all)
    }
}

/// What is asked for beside the recordings.
struct Asked {
    effects: Vec<PathBuf>,
    limits_file: Option<PathBuf>,
    limits_text: Option<String>,
}

impl Asked {
    fn limits(&self) -> Result<Option<Limits>, Failure> {
        match (&self.limits_file, &self.limits_text) {
            (Some(file), _) => service::limits_of_file(file).map(Some),
            (None, Some(text)) => service::limits_of_text(text).map(Some),
            (None, None) => Ok(None),
        }
    }
}

/// Answers what `open` opens, beside the interpreter.
fn answered(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    asked: Asked,
    open: impl FnOnce() -> Result<Campaign, Failure> + Send + 'static,
) -> PyResult<Report> {
    let done = aside(py, progress, move |say| -> Result<_, Unanswered> {
        say("reading");
        let limits = asked.limits()?;
        let effects = service::written_effects(&asked.effects)?;
        let campaign = open()?;
        say("identifying");
        let answered = service::answer(campaign, effects, say)?;
        say("reporting");
        let parameters = answered.parameters()?;
        let verdicts = limits.map_or(Ok(Vec::new()), |limits| answered.judged(&limits))?;
        Ok((answered, parameters, verdicts))
    })?;
    let (answered, parameters, verdicts) = done.map_err(|why| unanswered(py, why))?;
    let flat = |p: service::Parameter| (p.name, p.unit, p.value, p.ci95.map(|e| e[0]), p.ci95.map(|e| e[1]));
    let parameters = parameters.into_iter().map(flat).collect();
    let told = |v: service::Verdict| {
        let line = v.line(answered.device());
        (v.path, v.value, v.min, v.max, v.passes, line)
    };
    let verdicts = verdicts.into_iter().map(told).collect();
    Ok(Report { answered: Arc::new(answered), parameters, verdicts })
}

/// Identifies a campaign or recordings on disk.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "the options of the command")]
pub(crate) fn identify_files(
    py: Python<'_>,
    files: Vec<PathBuf>,
    holdout: Vec<PathBuf>,
    map: Vec<String>,
    settle: Option<f64>,
    sensor: bool,
    device: Option<String>,
    effects: Vec<PathBuf>,
    limits_file: Option<PathBuf>,
    limits_text: Option<String>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Report> {
    let settings = Settings { naming: naming(py, &map)?, settle_s: settle, sensor, device };
    let asked = Asked { effects, limits_file, limits_text };
    answered(py, progress.as_ref(), asked, move || service::campaign_of_files(&files, &holdout, &settings))
}

/// Identifies recordings in memory: names and what has columns, with the text of a campaign where one says what they are.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "the options of the command")]
pub(crate) fn identify_runs(
    py: Python<'_>,
    runs: Vec<(String, Bound<'_, PyAny>)>,
    held_out: usize,
    text: Option<String>,
    map: Vec<String>,
    settle: Option<f64>,
    sensor: bool,
    device: Option<String>,
    effects: Vec<PathBuf>,
    limits_file: Option<PathBuf>,
    limits_text: Option<String>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Report> {
    let settings = Settings { naming: naming(py, &map)?, settle_s: settle, sensor, device };
    let asked = Asked { effects, limits_file, limits_text };
    let runs = taken(runs)?;
    answered(py, progress.as_ref(), asked, move || match text {
        Some(text) => service::campaign_of_text(&text, runs.into_iter().collect::<BTreeMap<_, _>>(), &settings),
        None => service::campaign_of_columns(runs, held_out, &settings),
    })
}

fn taken(runs: Vec<(String, Bound<'_, PyAny>)>) -> PyResult<Vec<(String, Columns)>> {
    runs.into_iter().map(|(name, data)| Ok((name, columns(&data)?))).collect()
}

/// What is in recordings on disk, as JSON.
#[pyfunction]
pub(crate) fn inspect_files(py: Python<'_>, files: Vec<PathBuf>, map: Vec<String>) -> PyResult<String> {
    let naming = naming(py, &map)?;
    let text = aside(py, None, move |_| service::inspected(&service::recordings_of_files(&files, &naming)?))?;
    text.map_err(|e| failed(py, &e))
}

/// What is in recordings in memory, as JSON.
#[pyfunction]
pub(crate) fn inspect_runs(
    py: Python<'_>,
    runs: Vec<(String, Bound<'_, PyAny>)>,
    map: Vec<String>,
) -> PyResult<String> {
    let naming = naming(py, &map)?;
    let runs = taken(runs)?;
    let text = aside(py, None, move |_| {
        let read = runs.into_iter().map(|(name, columns)| service::recording(columns, &naming, &name));
        service::inspected(&read.collect::<Result<Vec<Recording>, _>>()?)
    })?;
    text.map_err(|e| failed(py, &e))
}

/// The library of effects, as JSON.
#[pyfunction]
pub(crate) fn effects(py: Python<'_>) -> PyResult<String> {
    service::effects().map_err(|e| failed(py, &e))
}

/// What devices say together, as JSON.
#[pyfunction]
pub(crate) fn population(py: Python<'_>, devices: Vec<(String, Option<String>, Option<String>)>) -> PyResult<String> {
    service::population(devices).map_err(|e| failed(py, &e))
}
