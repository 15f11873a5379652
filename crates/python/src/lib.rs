//! `cvg._cvg`: what `cvg` for Python does in Rust.
//!
//! Every answer is that of `cvg_cli::service`, which the command `cvg` is made of too. The module keeps the interpreter free
//! while it works, and gives errors the file, line and column that they speak of.
#![allow(unsafe_code, reason = "Arrow's C interface hands out pointers; all of it is in `arrow`")]
#![allow(clippy::needless_pass_by_value, reason = "the interpreter hands over what it made of the arguments")]

mod answer;
mod arrow;
mod calibration;
mod columns;
mod errors;
mod instrument;
mod simulate;
mod work;

use pyo3::prelude::*;

#[pymodule]
mod _cvg {
    use super::*;

    #[pymodule_export]
    use super::answer::{Report, effects, identify_files, identify_runs, inspect_files, inspect_runs, population};
    #[pymodule_export]
    use super::arrow::Table;
    #[pymodule_export]
    use super::calibration::Calibration;
    #[pymodule_export]
    use super::instrument::Instrument;
    #[pymodule_export]
    use super::simulate::{Simulation, simulate};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
