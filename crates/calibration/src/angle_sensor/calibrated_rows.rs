//! What a calibration says of the rows that it was made of: where they stood, and how round they were.

use cvg_model::Envelope;
use cvg_model::effects::Moment;

use super::gap::Gap;
use super::samples::{Reading, SensorRun};
use crate::model::hypothesis::Hypothesis;
use crate::numerics::statistics::median;
use crate::report::belonging::with_the_angle;

/// Where in the sensor's period rows stood that a table was made of, from and to, deg of its own angle; `None` where that is all of it.
pub(super) fn covered_deg(hypothesis: &Hypothesis, fitted: &[SensorRun]) -> Option<[f64; 2]> {
    hypothesis.angle_table.as_ref()?;
    let read = |x, y| hypothesis.bearing(&hypothesis.unread(Envelope::new(x, 0.0, y, 0.0), &Moment::default()));
    let angles = fitted.iter().flat_map(|run| match &run.reading {
        Reading::Angle(theta) => theta.clone(),
        Reading::Channels(channels) => channels.iter().map(|[x, y]| read(*x, *y)).collect(),
    });
    let covered = Gap::all(angles, std::f64::consts::TAU / hypothesis.period_rad).first()?.covered();
    Some(covered.map(|share| (share * hypothesis.period_rad).to_degrees()))
}

/// How much of the radius of the fitted rows goes with their angle with the readout undone, as a share of it.
pub(super) fn radius_left(hypothesis: &Hypothesis, fitted: &[SensorRun]) -> Option<f64> {
    let of_run = |run: &SensorRun| -> Option<Vec<[f64; 2]>> {
        let undone = run.channels()?.iter().map(|[x, y]| {
            let z = hypothesis.unread(Envelope::new(*x, 0.0, *y, 0.0), &Moment::default());
            [hypothesis.bearing(&z), z.x_c.hypot(z.y_c)]
        });
        let undone: Vec<[f64; 2]> = undone.collect();
        let usual = median(&mut undone.iter().map(|[_, radius]| *radius).collect::<Vec<_>>());
        Some(undone.into_iter().map(|[angle, radius]| [angle, radius / usual]).collect())
    };
    let left = with_the_angle(&fitted.iter().map(of_run).collect::<Option<Vec<_>>>()?.concat());
    Some(left).filter(|left| left.is_finite())
}
