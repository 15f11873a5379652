//! What undoes the errors of an instrument.

use std::path::PathBuf;

use cvg_calibration::calibration;
use cvg_calibration::recording::Values;
use cvg_cli::service;
use pyo3::prelude::*;

use crate::arrow::Table;
use crate::columns::{columns, naming};
use crate::errors::failed;
use crate::work::aside;

/// A calibration, as calibration.toml holds it.
#[pyclass(frozen, module = "cvg._cvg")]
#[derive(Debug)]
pub(crate) struct Calibration {
    calibration: calibration::Calibration,
}

impl Calibration {
    pub(crate) fn new(calibration: calibration::Calibration) -> Self {
        Self { calibration }
    }
}

#[pymethods]
impl Calibration {
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = aside(py, None, move |_| calibration::Calibration::read(&path))?;
        read.map(Self::new).map_err(|e| failed(py, &e.into()))
    }

    #[staticmethod]
    fn from_text(py: Python<'_>, text: &str) -> PyResult<Self> {
        calibration::Calibration::from_text(text, "calibration").map(Self::new).map_err(|e| failed(py, &e.into()))
    }

    #[getter]
    fn device(&self) -> &str {
        &self.calibration.device
    }

    /// calibration.toml
    fn to_text(&self) -> String {
        self.calibration.to_text()
    }

    /// Effects that are not undone in another recording.
    #[getter]
    fn left_out(&self) -> Vec<String> {
        cvg_calibration::left_out(&self.calibration).iter().map(ToString::to_string).collect()
    }

    /// A recording with the errors taken out, and warnings.
    fn compensate(
        &self,
        py: Python<'_>,
        data: &Bound<'_, PyAny>,
        name: String,
        map: Vec<String>,
    ) -> PyResult<(Table, Vec<String>)> {
        let (columns, naming, calibration) = (columns(data)?, naming(py, &map)?, self.calibration.clone());
        let is_number = |(_, values): &&(String, Values)| matches!(values, Values::Numbers(_));
        let numbers: Vec<String> = columns.iter().filter(is_number).map(|(name, _)| name.trim().to_owned()).collect();
        let done = aside(py, None, move |_| {
            let recording = service::recording(columns, &naming, &name)?;
            let mut warnings = recording.warnings.clone();
            warnings.extend(cvg_calibration::outside(&calibration, &recording).map(|o| format!("{name}: {o}")));
            cvg_calibration::compensate(&calibration, &recording).map(|out| (out, warnings)).map_err(Into::into)
        })?;
        let (compensated, warnings) = done.map_err(|e: cvg_cli::Failure| failed(py, &e))?;
        Ok((Table::recording(&compensated, &numbers)?, warnings))
    }
}
