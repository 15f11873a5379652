//! Which ways the input of a rotation turned.

use crate::numerics::angles::wrapped;
use crate::recording::{Run, RunKind};

/// Parts of a run whose turns are counted one by one: a table that trembles turns neither way.
const PARTS: usize = 64;
/// Of a run that turned both ways, the smaller share of what it turned.
const LEAST_SHARE: f64 = 0.05;

/// positive, negative or both; none of other runs than rotations, or where no input was recorded.
pub(crate) fn way(run: &Run) -> Option<&'static str> {
    if run.kind != RunKind::Rotation {
        return None;
    }
    let turned = turned_deg(run);
    let turned = turned.get(run.settled().ok()?.start..)?;
    let parts = turned.chunks(turned.len().div_ceil(PARTS).max(1)).map(|part| part.iter().sum::<f64>());
    let (forth, back) =
        parts.fold((0.0, 0.0), |(forth, back), part: f64| (forth + part.max(0.0), back - part.min(0.0)));
    let all = forth + back;
    (all > 0.0).then_some(match (forth / all, back / all) {
        (_, back) if back < LEAST_SHARE => "positive",
        (forth, _) if forth < LEAST_SHARE => "negative",
        _ => "both",
    })
}

/// What the input turned from row to row, deg: that of the table, by the shorter way round, else the rate over the time.
fn turned_deg(run: &Run) -> Vec<f64> {
    let r = &run.recording;
    if let Some(table) = &r.table_deg {
        let mut last = f64::NAN;
        let by = |angle: &f64| {
            let turned = wrapped(angle - last, 360.0);
            last = if angle.is_finite() { *angle } else { last };
            if turned.is_finite() { turned } else { 0.0 }
        };
        return table.iter().map(by).collect();
    }
    let rates = r.rate_dps.iter().flatten().zip(r.t_s.windows(2));
    rates.map(|(rate, t)| rate * (t[1] - t[0])).map(|turned| if turned.is_finite() { turned } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::way;
    use crate::recording::{Recording, Role, Run, RunKind};

    fn turned(rates: &[f64], as_table: bool, tremble: f64, kind: RunKind) -> Option<&'static str> {
        let rows: Vec<f64> = rates.iter().flat_map(|rate| std::iter::repeat_n(*rate, 500)).collect();
        let mut angle = 0.0;
        let table = rows.iter().enumerate().map(|(row, rate)| {
            angle += 0.01 * rate;
            (angle + if row % 2 == 0 { tremble } else { -tremble }).rem_euclid(360.0)
        });
        let mut recording = Recording {
            t_s: (0..rows.len()).map(|row| 0.01 * row as f64).collect(),
            table_deg: as_table.then(|| table.collect()),
            ..Recording::default()
        };
        recording.rate_dps = (!as_table).then_some(rows);
        let (file, role) = ("run.csv".into(), Role::Fit);
        way(&Run { kind, file, settle_s: 0.0, role, amplitude: None, recording })
    }

    #[test]
    fn a_run_that_turned_back_turned_both_ways_whatever_its_mean_is() {
        for as_table in [false, true] {
            let rotation = |rates: &[f64], tremble| turned(rates, as_table, tremble, RunKind::Rotation);
            assert_eq!(rotation(&[60.0, -60.0, 90.0, -30.0], 0.0), Some("both"));
            assert_eq!(rotation(&[60.0, 30.0], 1.0), Some("positive"));
            assert_eq!(rotation(&[-60.0, -200.0], 1.0), Some("negative"));
            assert_eq!(rotation(&[0.0], 0.0), None);
            assert_eq!(turned(&[60.0], as_table, 0.0, RunKind::Static), None);
        }
    }
}
