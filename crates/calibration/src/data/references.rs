//! Whether the two references of a run, the table's angle and the rate, tell of one rotation. The angle is what counts: a rate in
//! another unit, or with another sign, is said and passed over.

use crate::data::plausibility::Broken;
use crate::numerics::angles::wrapped;
use crate::numerics::statistics::median;
use crate::recording::Recording;

/// A table and a rate agree within this share.
const AGREE: f64 = 0.02;
/// and are one within this: a rate that is a command differs by it from what the table does.
const ONE_RATE: f64 = 1e-3;
/// So many steps of both tell whether they do.
const FEWEST_STEPS: usize = 16;
/// Beyond half a turn a step, steps that scatter by more than this, degrees, or differ by it, have nothing of each other: at random it is 90.
const AT_RANDOM_DEG: f64 = 45.0;
/// A factor between them is a unit's within this share.
const A_UNIT: f64 = 0.02;
const TURN_DEG: f64 = 360.0;

/// By which share the table's angle and the rate differ, where both were recorded and tell of the same rotation.
///
/// # Errors
/// Where they contradict each other.
pub(super) fn references(recording: &Recording, name: &str, warnings: &mut Vec<String>) -> Result<f64, Broken> {
    let (Some(table), Some(rate)) = (recording.table_deg.as_deref(), recording.rate_dps.as_deref()) else {
        return Ok(0.0);
    };
    let t = &recording.t_s;
    // steps of both where the table is not at rest: by the rate, and as much of it as is known of the table's, degrees
    let fastest = rate.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    let steps: Vec<[f64; 2]> = (1..t.len())
        .filter(|&i| rate[i - 1].abs().min(rate[i].abs()) > 0.1 * fastest && rate[i - 1] * rate[i] > 0.0)
        .map(|i| [0.5 * (rate[i - 1] + rate[i]) * (t[i] - t[i - 1]), wrapped(table[i] - table[i - 1], TURN_DEG)])
        .filter(|[by_rate, _]| by_rate.is_finite() && *by_rate != 0.0)
        .collect();
    let close = steps.iter().filter(|step| step.iter().all(|d| d.abs() < 90.0));
    let mut factors: Vec<f64> = close.map(|[by_rate, by_table]| by_table / by_rate).collect();
    if factors.len() < FEWEST_STEPS {
        return beyond_half_a_turn(&steps, name, warnings);
    }
    let factor = median(&mut factors);
    let mut off: Vec<f64> = factors.iter().map(|f| (f - factor).abs()).collect();
    // how sure the median is of itself: noise of a fast recording is larger than its steps
    let unsure = 3.0 * median(&mut off) / (factors.len() as f64).sqrt();
    let is = |wanted: f64| (factor / wanted - 1.0).abs() <= A_UNIT + unsure;
    if (factor - 1.0).abs() <= AGREE + unsure {
        return Ok(apart(factor - 1.0, unsure, name, warnings));
    }
    let unit = [
        (57.295_78, "rad/s"),
        (6.0, "revolutions per minute"),
        (360.0, "revolutions per second"),
        (1e-3, "mdeg/s"),
        (1.0 / 3600.0, "deg/h"),
    ];
    for (size, what) in unit {
        for sign in [1.0, -1.0] {
            if is(sign * size) {
                let also = if sign < 0.0 { " and counts the other way" } else { "" };
                warnings.push(format!(
                    "{name}: rate_dps is {factor:.4} of what table_deg says, as if in {what}{also}; table_deg is used"
                ));
                return Ok(0.0);
            }
        }
    }
    if is(-1.0) {
        warnings.push(the_other_way(name));
        return Ok(0.0);
    }
    Err(contradiction(format!("table_deg turns {factor:.4} times as fast as rate_dps says")))
}

/// Says by which share references differ that tell of one rotation, where that is more than their noise.
fn apart(by: f64, unsure: f64, name: &str, warnings: &mut Vec<String>) -> f64 {
    if by.abs() <= ONE_RATE + unsure {
        return 0.0;
    }
    warnings.push(format!(
        "{name}: table_deg turns {:.4} times as fast as rate_dps says; table_deg is used, and where no other run tells which \
         of the two is right, the angular gain's interval covers both",
        1.0 + by
    ));
    by.abs()
}

/// The same where the table turns by up to a turn and more from row to row, so that its angle tells its steps but for whole
/// turns: they are those of the rate, those of its opposite, or neither.
fn beyond_half_a_turn(steps: &[[f64; 2]], name: &str, warnings: &mut Vec<String>) -> Result<f64, Broken> {
    if steps.len() < FEWEST_STEPS {
        return Ok(0.0);
    }
    let usual = median(&mut steps.iter().map(|[r, _]| r.abs()).collect::<Vec<_>>());
    let forward = median(&mut steps.iter().map(|[r, _]| *r).collect::<Vec<_>>()).signum();
    let off = |sign: f64| {
        let mut off: Vec<f64> = steps.iter().map(|[r, t]| wrapped(t - sign * r, TURN_DEG)).collect();
        let middle = median(&mut off);
        let mut scatter: Vec<f64> = off.iter().map(|d| (d - middle).abs()).collect();
        let scatter = median(&mut scatter);
        let unsure = 3.0 * scatter / (steps.len() as f64).sqrt();
        let agree = middle.abs() <= (AGREE * usual + unsure).min(AT_RANDOM_DEG) && scatter < AT_RANDOM_DEG;
        (middle, unsure, agree)
    };
    let (ahead, unsure, agree) = off(1.0);
    if agree {
        return Ok(apart(forward * ahead / usual, unsure / usual, name, warnings));
    }
    let (_, _, agree) = off(-1.0);
    if agree {
        warnings.push(the_other_way(name));
        return Ok(0.0);
    }
    Err(contradiction(format!(
        "from row to row table_deg turns {ahead:.2}° further than rate_dps says, or whole turns more"
    )))
}

fn the_other_way(name: &str) -> String {
    format!("{name}: rate_dps counts the other way than table_deg, which is used")
}

fn contradiction(problem: String) -> Broken {
    Broken { problem, wanted: "references that agree, or only the one that is right (the other column renamed)".into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::plausibility::tests::recorded;
    use crate::data::plausibility::{Findings, mend};

    #[test]
    fn references_of_a_slow_recording_are_compared_but_for_whole_turns() {
        let every_half_second = |factor: f64| {
            let t_s: Vec<f64> = (0..400).map(|i| 0.5 * f64::from(i)).collect();
            let table = t_s.iter().map(|t| (250.0 * t * factor).rem_euclid(360.0)).collect();
            Recording { rate_dps: Some(vec![250.0; 400]), table_deg: Some(table), t_s, ..recorded() }
        };
        let of = |factor: f64| references(&every_half_second(factor), "slow.csv", &mut Vec::new());
        assert_eq!((of(1.0), of(-1.0)), (Ok(0.0), Ok(0.0)));
        assert!(of(1.01).is_ok_and(|apart| (apart - 0.01).abs() < 1e-9));
        for factor in [0.7, 1.04, 1.229, 1.5] {
            assert!(of(factor).is_err_and(|b| b.problem.contains("from row to row")), "{factor}");
        }
    }

    #[test]
    fn steps_of_many_turns_that_have_nothing_of_each_other_do_not_agree() {
        // a table that swings, with times in ms for s
        let t_s: Vec<f64> = (0..800).map(|i| 10.0 * f64::from(i)).collect();
        for size in [180.0, 274.0, 390.0] {
            let rate: Vec<f64> = (0..800).map(|i| size * (0.004 * f64::from(i)).cos() + 1.0).collect();
            let mut angle = 0.0;
            let table = rate.iter().map(|r| {
                angle += 0.01 * r;
                f64::rem_euclid(angle, 360.0)
            });
            let recording = Recording {
                table_deg: Some(table.collect()),
                rate_dps: Some(rate.clone()),
                t_s: t_s.clone(),
                ..recorded()
            };
            assert!(references(&recording, "ms.csv", &mut Vec::new()).is_err(), "{size}");
        }
    }

    #[test]
    fn references_that_disagree_serve_for_nothing_and_a_unit_is_named() {
        let with_table = |factor: f64| {
            let mut recording = recorded();
            let table = recording.t_s.iter().map(|t| (500.0 * t * factor).rem_euclid(360.0));
            recording.table_deg = Some(table.collect());
            recording
        };
        assert_eq!(mend(&mut with_table(1.0)), Findings::default());
        let findings = mend(&mut with_table(0.991));
        assert!((findings.references_apart - 9e-3).abs() < 1e-9, "{findings:?}");
        assert!(findings.warnings[0].contains("turns 0.9910 times as fast"), "{findings:?}");
        let broken = mend(&mut with_table(0.5)).broken;
        assert!(broken.is_some_and(|b| b.problem.contains("0.5000 times")));
        let mut radians = with_table(1.0);
        radians.rate_dps = Some(vec![500f64.to_radians(); 2000]);
        let findings = mend(&mut radians);
        assert!(findings.broken.is_none() && findings.warnings[0].contains("rad/s"), "{findings:?}");
    }
}
