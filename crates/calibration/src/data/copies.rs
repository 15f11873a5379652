//! What is there twice: one channel in the other's place, or one recording as two runs.

use std::ops::Range;

use crate::data::plausibility::{
    Broken, Column, Findings, HELD_ALONE, JUMP, MOST_LOST, leave_out as leave_out_rows, places, repeats,
};
use crate::recording::{Campaign, Channel, Recording, Role, Run};

/// Rows in which X and Y are the same but for a sign, to the last bit, while they change. Where a vibration passes 45° they
/// meet, and one grows as the other falls.
#[allow(clippy::float_cmp, reason = "the same to the last bit is the point")]
pub(crate) fn copied_rows(x: &[f64], y: &[f64]) -> Vec<Range<usize>> {
    let Some(column) = Column::new(x, None) else { return Vec::new() };
    let mut same = repeats(x.len().min(y.len()), |i| x[i].abs() == y[i].abs());
    same.retain(|r| r.len() >= HELD_ALONE && column.moved(r.start, r.end - 1) > JUMP);
    same
}

/// What is wrong with a recording of so many rows, of which these are copied.
pub(crate) fn said(copied: &[Range<usize>], t_s: &[f64]) -> String {
    let lost: usize = copied.iter().map(Range::len).sum();
    format!("X and Y are the same to the last digit in {lost} of {} rows: {}", t_s.len(), places(t_s, copied))
}

/// Leaves out rows in which one channel stands in the other's place, and says so.
pub(super) fn leave_out(recording: &mut Recording, name: &str, findings: &mut Findings) {
    let (Some(x), Some(y)) = (recording.xc_v.as_deref(), recording.yc_v.as_deref()) else { return };
    let copied = copied_rows(x, y);
    let lost: usize = copied.iter().map(Range::len).sum();
    if lost == 0 {
        return;
    }
    let what = said(&copied, &recording.t_s);
    if lost as f64 > MOST_LOST * recording.len() as f64 {
        findings.broken = Some(Broken { problem: what, wanted: "xc_v and yc_v of two channels".into() });
        return;
    }
    findings.warnings.push(format!("{name}: {what}: one stands in the other's place; these rows are left out"));
    let mut out = vec![false; recording.len()];
    copied.into_iter().for_each(|r| out[r].fill(true));
    leave_out_rows(recording, &out);
}

/// Takes out of a campaign the runs that were recorded as another was, to the last bit, and says so: what is there twice
/// counts once, and nothing is held out of what it was fitted to. The same readings with another reference are no copy, and
/// one of the two is wrong.
pub(crate) fn without_copies(campaign: &mut Campaign, warnings: &mut Vec<String>) -> Vec<Run> {
    let mut kept: Vec<Run> = Vec::with_capacity(campaign.runs.len());
    let mut copies = Vec::new();
    for run in std::mem::take(&mut campaign.runs) {
        let Some(original) = kept.iter_mut().find(|other| is_copy(other, &run)) else {
            kept.push(run);
            continue;
        };
        // what is fitted is kept, whichever comes first
        let replaces = original.role == Role::Holdout && run.role == Role::Fit;
        let copy = if replaces { std::mem::replace(original, run) } else { run };
        let names = [&copy, &*original].map(|r| r.file.display().to_string());
        warnings.push(format!("{}: left out: it is the same recording as {}", names[0], names[1]));
        copies.push(copy);
    }
    campaign.runs = kept;
    copies
}

/// Whether two runs have the same values in every channel.
fn is_copy(one: &Run, other: &Run) -> bool {
    let alike = |c: Channel| match (one.recording.channel(c), other.recording.channel(c)) {
        (Some(a), Some(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits()),
        (a, b) => a.is_none() && b.is_none(),
    };
    one.kind == other.kind && Channel::ALL.into_iter().all(alike)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::plausibility::mend;
    use crate::data::plausibility::tests::recorded;
    use crate::recording::RunKind;

    #[test]
    fn rows_with_one_channel_in_the_other_s_place_are_named_and_left_out() {
        for sign in [1.0, -1.0] {
            let mut recording = recorded();
            let x: Vec<f64> = recording.xc_v.iter().flatten().map(|v| sign * v).collect();
            recording.yc_v.iter_mut().for_each(|y| y[700..740].copy_from_slice(&x[700..740]));
            let findings = mend(&mut recording);
            assert!(findings.broken.is_none() && recording.len() == 1960, "{findings:?}");
            let said = "X and Y are the same to the last digit in 40 of 2000 rows: rows 701 to 740 ";
            assert!(findings.warnings[0].contains(said), "{findings:?}");
        }
        let mut recording = recorded();
        recording.yc_v = recording.xc_v.clone();
        assert!(mend(&mut recording).broken.is_some_and(|b| b.problem.contains("1999 of 2000 rows")));
    }

    /// Both are the same for a while where the pattern passes 45°.
    #[test]
    fn channels_that_meet_in_a_step_of_a_coarse_converter_are_no_copies() {
        let theta = |i: usize| 0.3 - 0.78 * (5.0 * 0.01 * i as f64).to_radians();
        let counted = |v: f64| (v * 50.0).round() / 50.0;
        let x: Vec<f64> = (0..2000).map(|i| counted(theta(i).cos())).collect();
        let y: Vec<f64> = (0..2000).map(|i| counted(theta(i).sin())).collect();
        assert_eq!(copied_rows(&x, &y), []);
    }

    #[test]
    fn a_recording_that_is_there_twice_counts_once_and_is_not_held_out_of_itself() {
        let run = |file: &str, role: Role, recording: Recording| Run {
            kind: RunKind::Rotation,
            file: file.into(),
            settle_s: 0.0,
            role,
            amplitude: None,
            recording,
        };
        let mut other = recorded();
        other.xc_v.iter_mut().flatten().take(1).for_each(|v| *v += 1e-9);
        let runs = vec![
            run("held.csv", Role::Holdout, recorded()),
            run("a.csv", Role::Fit, recorded()),
            run("b.csv", Role::Fit, other),
        ];
        let mut campaign = Campaign { runs, ..Campaign::default() };
        let mut warnings = Vec::new();
        let copies = without_copies(&mut campaign, &mut warnings);
        let names = |runs: &[Run]| runs.iter().map(|r| r.file.display().to_string()).collect::<Vec<_>>();
        assert_eq!(
            (names(&campaign.runs), names(&copies)),
            (vec!["a.csv".into(), "b.csv".into()], vec!["held.csv".into()])
        );
        assert_eq!(warnings, ["held.csv: left out: it is the same recording as a.csv"]);
    }
}
