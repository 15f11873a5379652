//! The report of a campaign without an angle error: a sensor whose reference nobody recorded, runs at rest alone. It has every
//! field of a report; those that need a reference hold null.

use serde::Serialize;

use crate::report::{
    Allan, EffectReport, Estimate, Input, ParameterReport, RunReport, SCHEMA, Status, Temperature, Tool, Unexplained,
};

/// What virtual precession at rest and rotation that nobody recorded tell of a gyroscope.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VirtualPrecession {
    /// time at rest with the angle in use, and time turning, s
    pub seconds: [f64; 2],
    /// ratio, skew and phase of the detection are told: rotation, or a split of two orientations, tells them from the drives
    pub detection_known: bool,
    /// standard deviation of the angle-dependent bias that ratio and skew may still make, deg
    pub bias_deg: f64,
    /// numbers beside those of effects; an interval is null where none could be shown to hold
    pub parameters: Vec<ParameterReport>,
    /// what these runs do not identify, and which run would
    pub not_identifiable: Vec<NotIdentifiable>,
    /// what is left of rows that nothing was fitted to
    pub heldout: Vec<Innovation>,
}

/// Something that a campaign does not identify.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct NotIdentifiable {
    /// what
    pub what: String,
    /// the run that would
    pub separated_by: String,
}

/// What of one channel was not predicted, a cycle's, on rows that nothing was fitted to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Innovation {
    /// amplitude, angle or ellipticity
    pub channel: String,
    /// root mean square, rad (of the amplitude: relative)
    pub rms_rad: f64,
    /// the part of it that is white
    pub noise_rad: f64,
    /// cycles
    pub cycles: usize,
}

/// How constant a radius is that a sensor holds, as shares of its mean, on rows that nothing was fitted to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Constancy {
    /// rms about the mean radius
    pub rms: f64,
    /// largest deviation from it
    pub peak: f64,
}

/// What two channels tell of themselves without a reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Radius {
    /// of the channels as recorded
    pub before: Constancy,
    /// with what was found undone
    pub after: Constancy,
    /// by how much the angle changes when what was found is undone, deg rms about its mean; null where the raw angle does not
    /// turn
    pub correction_rms_deg: Option<f64>,
    /// largest part of a turn that no row is in, deg
    pub largest_gap_deg: f64,
}

/// Held-out angle errors where there is nothing to count them against.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Unknown {
    raw: Option<()>,
    declared: Option<()>,
    discovered: Option<()>,
    noise_floor_deg: Option<()>,
}

/// A report without an angle error, with the fields of [`crate::report::Report`] and the radius.
#[derive(Debug, Clone, Serialize)]
pub struct Survey {
    /// [`SCHEMA`]
    pub schema: &'static str,
    /// what came of it
    pub status: Status,
    /// why it is not answered; null where it is
    pub reason: Option<String>,
    /// the program
    pub tool: Tool,
    /// the files that were read
    pub inputs: Vec<Input>,
    /// name of the instrument
    pub device: String,
    /// gyroscope or sensor
    pub instrument: &'static str,
    /// null: there is nothing that it could be told against
    pub angular_gain: Option<Estimate>,
    /// G_Dy/G_Dx
    pub detection_gain_ratio: Option<Estimate>,
    /// G_Ax/G_Ay; null where nothing tells it
    pub actuation_gain_ratio: Option<Estimate>,
    /// identified effects
    pub effects: Vec<EffectReport>,
    /// null throughout
    pub heldout: Unknown,
    /// how constant the radius is; null without two channels that turn
    pub radius: Option<Radius>,
    steps: [(); 0],
    residual: Option<()>,
    channels: [(); 0],
    /// what is left and has no explanation
    pub unexplained: Vec<Unexplained>,
    /// the campaign's runs
    pub runs: Vec<RunReport>,
    decomposition: [(); 0],
    proposals: [(); 0],
    scale_factor: Option<()>,
    repeatability_ppm: Option<()>,
    /// what virtual precession and unknown rotation told; null without such runs
    pub virtual_precession: Option<VirtualPrecession>,
    /// how far the angle wanders at rest; null without a run at rest
    pub allan: Option<Allan>,
    /// how bias and readout go with the temperature; null without two runs with one
    pub temperature: Option<Temperature>,
    /// what a reader must know
    pub warnings: Vec<String>,
}

impl Survey {
    /// A survey that found nothing yet.
    pub(crate) fn new(device: String, instrument: &'static str, inputs: Vec<Input>, runs: Vec<RunReport>) -> Self {
        Self {
            schema: SCHEMA,
            status: Status::Answered,
            reason: None,
            tool: Tool::default(),
            inputs,
            device,
            instrument,
            angular_gain: None,
            detection_gain_ratio: None,
            actuation_gain_ratio: None,
            effects: Vec::new(),
            heldout: Unknown::default(),
            radius: None,
            steps: [],
            residual: None,
            channels: [],
            unexplained: Vec::new(),
            runs,
            decomposition: [],
            proposals: [],
            scale_factor: None,
            repeatability_ppm: None,
            virtual_precession: None,
            allan: None,
            temperature: None,
            warnings: Vec::new(),
        }
    }
}
