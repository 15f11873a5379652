//! The electronics as firmware runs them, over arrays of samples.

use cvg_instrument::{Instrument as Electronics, Settings, State};
use numpy::{AllowTypeChange, PyArray1, PyArrayLike1};
use pyo3::prelude::*;

use crate::errors::bad;

type Samples<'py> = Bound<'py, PyArray1<f64>>;
/// What numpy makes an array of one dimension of.
type Given<'py> = PyArrayLike1<'py, f64, AllowTypeChange>;

/// The electronics of a whole-angle gyroscope: converter values in, converter values out, in f64.
#[pyclass(module = "cvg")]
#[derive(Debug, Clone)]
pub(crate) struct Instrument {
    electronics: Electronics<f64>,
    state: State<f64>,
}

#[pymethods]
impl Instrument {
    #[new]
    #[pyo3(signature = (*, carrier_hz = None, sample_hz = None, window = None, amplitude_v = None, drive_per_s_v = None,
                        readout_delay_s = None, drive_delay_s = None))]
    #[allow(clippy::too_many_arguments, reason = "settings by name")]
    fn new(
        py: Python<'_>,
        carrier_hz: Option<f64>,
        sample_hz: Option<f64>,
        window: Option<i64>,
        amplitude_v: Option<f64>,
        drive_per_s_v: Option<f64>,
        readout_delay_s: Option<f64>,
        drive_delay_s: Option<f64>,
    ) -> PyResult<Self> {
        let usual = Settings::default();
        let window = window.map_or(Ok(usual.window), u16::try_from);
        let window = window.map_err(|_| bad(py, format!("window: wanted a number of samples up to {}", u16::MAX)))?;
        let settings = Settings {
            carrier_hz: carrier_hz.unwrap_or(usual.carrier_hz),
            sample_hz: sample_hz.unwrap_or(usual.sample_hz),
            window,
            amplitude_v: amplitude_v.unwrap_or(usual.amplitude_v),
            drive_per_s_v: drive_per_s_v.unwrap_or(usual.drive_per_s_v),
            readout_delay_s: readout_delay_s.unwrap_or(usual.readout_delay_s),
            drive_delay_s: drive_delay_s.unwrap_or(usual.drive_delay_s),
            ..usual
        };
        let electronics = Electronics::new(&settings).map_err(|e| bad(py, e))?;
        Ok(Self { electronics, state: electronics.start() })
    }

    /// Samples one after the other, V: what the converters put out, V, and the pattern angle, deg, after each.
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        adc_x: Given<'py>,
        adc_y: Given<'py>,
    ) -> PyResult<(Samples<'py>, Samples<'py>, Samples<'py>)> {
        let (x, y) = (adc_x.as_array().to_vec(), adc_y.as_array().to_vec());
        if x.len() != y.len() {
            return Err(bad(py, format!("adc_x has {} samples, adc_y {}; wanted as many", x.len(), y.len())));
        }
        let (electronics, state) = (&self.electronics, &mut self.state);
        let (dac_x, dac_y, angle_deg) = py.detach(|| {
            let (mut dac_x, mut dac_y, mut angle_deg) = (Vec::new(), Vec::new(), Vec::new());
            for (x, y) in x.into_iter().zip(y) {
                let (out_x, out_y, _) = electronics.step(state, x, y);
                dac_x.push(out_x);
                dac_y.push(out_y);
                angle_deg.push(state.angle_deg());
            }
            (dac_x, dac_y, angle_deg)
        });
        Ok((PyArray1::from_vec(py, dac_x), PyArray1::from_vec(py, dac_y), PyArray1::from_vec(py, angle_deg)))
    }

    /// One that goes on from the same state.
    fn __copy__(&self) -> Self {
        self.clone()
    }

    fn __deepcopy__(&self, memo: Bound<'_, PyAny>) -> Self {
        drop(memo);
        self.clone()
    }

    /// What it is doing.
    #[getter]
    fn mode(&self) -> String {
        format!("{:?}", self.state.status.mode)
    }

    /// The fault that it is in.
    #[getter]
    fn fault(&self) -> Option<String> {
        self.state.status.fault.map(|fault| format!("{fault:?}"))
    }
}
