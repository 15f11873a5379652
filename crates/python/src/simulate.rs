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
    scenario: String,
    name: String,
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

    /// Pickled as its scenario: the same one gives the same bytes.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (&str, &str))> {
        Ok((py.import("cvg._travel")?.getattr("simulation")?, (&self.scenario, &self.name)))
    }

    // what never changes is its own copy
    fn __copy__(this: Py<Self>) -> Py<Self> {
        this
    }

    fn __deepcopy__(this: Py<Self>, memo: Bound<'_, PyAny>) -> Py<Self> {
        drop(memo);
        this
    }

    /// Writes what `cvg simulate` writes.
    fn write(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        py.detach(|| self.simulated.write(folder)).map_err(|e| failed(py, &Failure::input(e)))
    }
}

/// Simulates the text of a scenario.
#[pyfunction]
pub(crate) fn simulate(py: Python<'_>, text: String, name: String) -> PyResult<Simulation> {
    let done = aside(py, None, move |_| service::simulate(&text, &name).map(|simulated| (simulated, text, name)))?;
    done.map(|(simulated, scenario, name)| Simulation { simulated, scenario, name }).map_err(|e| failed(py, &e))
}
