//! Campaigns with known truth.

use std::path::PathBuf;

use cvg_calibration::recording::Values;
use cvg_cli::Failure;
use cvg_cli::service;
use cvg_simulator::Simulated;
use pyo3::prelude::*;

use crate::arrow::Table;
use crate::errors::failed;
use crate::work::aside;

/// A simulated campaign.
#[pyclass(frozen, module = "cvg")]
#[derive(Debug)]
pub(crate) struct Simulation {
    simulated: Simulated,
}

#[pymethods]
impl Simulation {
    /// Names and columns of the recordings.
    #[getter]
    fn recordings(&self) -> PyResult<Vec<(String, Table)>> {
        let column = |c: &cvg_simulator::Column| (c.name.to_owned(), Values::Numbers(c.values.clone()));
        let runs = self.simulated.runs.iter();
        runs.map(|r| Ok((r.run.file().to_owned(), Table::of(r.columns.iter().map(column).collect())?))).collect()
    }

    /// campaign.toml: what was done in each of them.
    #[getter]
    fn campaign_toml(&self) -> String {
        self.simulated.campaign_toml()
    }

    /// truth.toml: what the bench was set to.
    #[getter]
    fn truth_toml(&self) -> String {
        self.simulated.truth_toml()
    }

    /// Writes what `cvg simulate` writes.
    fn write(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        py.detach(|| self.simulated.write(folder)).map_err(|e| failed(py, &Failure::input(e)))
    }
}

/// Simulates the text of a scenario.
#[pyfunction]
pub(crate) fn simulate(py: Python<'_>, text: String, name: String) -> PyResult<Simulation> {
    let simulated = aside(py, None, move |_| service::simulate(&text, &name))?;
    simulated.map(|simulated| Simulation { simulated }).map_err(|e| failed(py, &e))
}
