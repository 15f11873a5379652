//! Two channels that go round a circle span about the same: of channels in different units, or of which one is not connected, one spans
//! a thousand times as much as the other, and no angle is left in them.

use crate::error::Refusal;
use crate::facts::LARGEST_RATIO_OF_A_SENSOR;
use crate::numerics::statistics::{inner_range, span};
use crate::recording::{Campaign, Recording, RunKind};

/// The factors between units that are confused, and how far off them a ratio may be.
const FACTORS: [f64; 2] = [1e3, 1e6];
const NEAR: f64 = 3.0;

/// Refuses a rotation of a turn and more in which one channel spans more than any gain makes it.
///
/// # Errors
/// [`Refusal`] with the run, the ratio and the factor that would help.
pub(crate) fn require_one_unit(campaign: &Campaign) -> Result<(), Refusal> {
    let turned = campaign.runs.iter().filter(|r| r.kind == RunKind::Rotation && goes_round(&r.recording));
    for run in turned {
        let (Some(x), Some(y)) = (&run.recording.xc_v, &run.recording.yc_v) else { continue };
        let ratio = ratio(x, y);
        if (LARGEST_RATIO_OF_A_SENSOR.recip()..=LARGEST_RATIO_OF_A_SENSOR).contains(&ratio) {
            continue;
        }
        let (wide, narrow, times) = if ratio > 1.0 { ("yc_v", "xc_v", ratio) } else { ("xc_v", "yc_v", ratio.recip()) };
        let factor = FACTORS.into_iter().find(|factor| (factor / NEAR..factor * NEAR).contains(&times));
        let wanted = factor.map_or_else(
            || format!("both channels in one unit, and {narrow} connected"),
            |factor| format!("both channels in one unit, as --map '{wide}={wide}/{factor:.0}', or {narrow} connected"),
        );
        let what = format!("{wide} spans {times:.0} times as much as {narrow}: no angle is left in them");
        return Err(Refusal::no_answer(&run.file.display().to_string(), what, &wanted));
    }
    Ok(())
}

/// A run that turns once and more, by what it is recorded against; one that is recorded against nothing has to.
fn goes_round(recording: &Recording) -> bool {
    let turned_deg = match (&recording.table_deg, &recording.rate_dps) {
        (Some(table_deg), _) => span(table_deg),
        (None, Some(rate_dps)) => {
            let mean = rate_dps.iter().sum::<f64>() / rate_dps.len().max(1) as f64;
            mean.abs() * span(&recording.t_s)
        }
        (None, None) => return true,
    };
    turned_deg > 350.0
}

/// How much Y spans over X, without the outermost rows of each; one where a channel stands still, which is said elsewhere.
fn ratio(x: &[f64], y: &[f64]) -> f64 {
    let spans = [x, y].map(|v| inner_range(v).map_or(0.0, |[low, high]| high - low));
    if spans.contains(&0.0) { 1.0 } else { spans[1] / spans[0] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millivolts_beside_volts_are_named_and_gains_are_none() {
        let theta = |i: i32| 0.01 * f64::from(i);
        let x: Vec<f64> = (0..2000).map(|i| theta(i).cos() + 5.0).collect();
        let y: Vec<f64> = (0..2000).map(|i| 1000.0 * theta(i).sin()).collect();
        assert!((ratio(&x, &y) / 1000.0 - 1.0).abs() < 0.01);
        assert!((ratio(&y, &x) * 1000.0 - 1.0).abs() < 0.01);
        let still = vec![0.0; 2000];
        assert!((ratio(&x, &still) - 1.0).abs() < f64::EPSILON);
    }
}
