//! What a report says of a run before anything is fitted: its file, its rows, and what was dropped of them.

use crate::recording::{Dropped, Run, RunKind};
use crate::report::RunReport;
use crate::report::way::way;

/// The run as it was read, not yet used.
pub(crate) fn run_report(run: &Run) -> RunReport {
    let d = &run.recording.dropped;
    RunReport {
        file: run.file.display().to_string(),
        kind: run.kind.name().into(),
        r#use: match run.kind {
            RunKind::Static => "at rest".into(),
            RunKind::CrossAxis => "misalignment".into(),
            _ => "fit".into(),
        },
        rows: run.recording.reference_hz.map_or(run.recording.len(), |_| rows_read(d)),
        dropped: dropped(d),
        rate_dps: None,
        way: way(run).map(str::to_owned),
        spikes: 0,
        tau_s: None,
        angular_gain: None,
        bias_dps: None,
        rms_deg: None,
        temp_c: run.recording.temp_c.as_deref().and_then(mean_finite),
        detection_gain_ratio: None,
        agrees: None,
    }
}

/// Says how many samples, or what else is counted, were set aside as spikes; nothing where none was.
pub(crate) fn set_aside(count: usize, one: &str) -> Option<String> {
    match count {
        0 => None,
        1 => Some(format!("1 {one} was set aside as a spike")),
        _ => Some(format!("{count} {one}{} were set aside as spikes", if one.ends_with("ch") { "es" } else { "s" })),
    }
}

/// Mean of what is finite.
fn mean_finite(values: &[f64]) -> Option<f64> {
    let (sum, count) = values.iter().filter(|v| v.is_finite()).fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    (count > 0).then(|| sum / count as f64)
}

/// Rows that a recording had before it was demodulated.
fn rows_read(d: &Dropped) -> usize {
    usize::try_from(d.rows_kept).unwrap_or(usize::MAX)
}

/// Why rows of a file are not in its recording.
fn dropped(d: &Dropped) -> Vec<String> {
    [
        (d.empty_or_nan, "empty or not a number"),
        (d.repeated_time, "repeated time stamp"),
        (d.truncated_last_line, "cut-off last line"),
    ]
    .into_iter()
    .filter(|(tally, _)| !tally.is_zero())
    .map(|(tally, reason)| {
        let first = tally.first.map(|p| format!(", first at {p}")).unwrap_or_default();
        format!("{} × {reason}{first}", tally.count)
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::set_aside;

    #[test]
    fn one_is_no_many() {
        assert_eq!(set_aside(0, "sample"), None);
        assert_eq!(set_aside(1, "stretch").as_deref(), Some("1 stretch was set aside as a spike"));
        assert_eq!(set_aside(2, "stretch").as_deref(), Some("2 stretches were set aside as spikes"));
        assert_eq!(set_aside(3, "sample").as_deref(), Some("3 samples were set aside as spikes"));
    }
}
