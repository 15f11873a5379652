//! The report of an identification that was refused: every field of a report, and nothing in them but why.

use serde::Serialize;

use crate::error::Refusal;
use crate::recording::{Campaign, Instrument};
use crate::report::provenance::{self, Named};
use crate::report::recorded::run_report;
use crate::report::{EffectReport, Estimate, Input, RunReport, SCHEMA, Status, Tool};

/// What is known of a campaign before it is identified.
#[derive(Debug, Clone)]
pub struct About {
    device: String,
    instrument: Instrument,
    files: Vec<Named>,
    runs: Vec<RunReport>,
}

/// A report without an answer, with the fields of [`crate::report::Report`].
#[derive(Debug, Clone, Serialize)]
pub struct Refused {
    schema: &'static str,
    status: Status,
    reason: String,
    tool: Tool,
    inputs: Vec<Input>,
    device: String,
    instrument: &'static str,
    angular_gain: Option<Estimate>,
    detection_gain_ratio: Option<Estimate>,
    actuation_gain_ratio: Option<Estimate>,
    effects: [EffectReport; 0],
    heldout: Option<()>,
    steps: [(); 0],
    residual: Option<()>,
    channels: [(); 0],
    unexplained: [(); 0],
    runs: Vec<RunReport>,
    decomposition: [(); 0],
    proposals: [(); 0],
    scale_factor: Option<()>,
    repeatability_ppm: Option<()>,
    allan: Option<()>,
    temperature: Option<()>,
    warnings: [String; 0],
}

impl About {
    /// What is known of this campaign.
    #[must_use]
    pub fn campaign(campaign: &Campaign) -> Self {
        Self {
            device: campaign.device.clone(),
            instrument: campaign.instrument,
            files: provenance::files(campaign),
            runs: campaign.runs.iter().map(run_report).collect(),
        }
    }

    /// The report of its refusal.
    #[must_use]
    pub fn refused(self, why: &Refusal) -> Refused {
        Refused {
            schema: SCHEMA,
            status: Status::Refused,
            reason: why.to_string(),
            tool: Tool::default(),
            inputs: provenance::sums(&self.files),
            device: self.device,
            instrument: self.instrument.name(),
            angular_gain: None,
            detection_gain_ratio: None,
            actuation_gain_ratio: None,
            effects: [],
            heldout: None,
            steps: [],
            residual: None,
            channels: [],
            unexplained: [],
            runs: self.runs,
            decomposition: [],
            proposals: [],
            scale_factor: None,
            repeatability_ppm: None,
            allan: None,
            temperature: None,
            warnings: [],
        }
    }
}
