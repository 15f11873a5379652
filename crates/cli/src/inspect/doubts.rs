//! What a recording by itself gives to doubt: whether it is of the instrument that it is taken for, and whether its input can be
//! followed.

use cvg_calibration::looks_like;
use cvg_calibration::recording::{Campaign, Recording};

/// An angle that goes on by this much from row to row may be any other, deg: half a turn.
const UNFOLLOWED_DEG: f64 = 180.0;
/// A table is set to another angle, a turn away at most; what goes on by more is in another unit.
const A_TURN_DEG: f64 = 360.0;

/// Why two channels are taken for those of a sin/cos sensor, and what to say then; none where they are not.
pub(super) fn looks_like_a_sensor(recording: &Recording) -> Option<String> {
    let none = |v: &Option<Vec<f64>>| v.as_ref().is_none_or(|v| v.iter().all(|x| *x == 0.0 || x.is_nan()));
    let two = recording.xc_v.is_some() && recording.yc_v.is_some();
    if !two || ![&recording.xs_v, &recording.ys_v, &recording.vas_v, &recording.vqc_v].into_iter().all(none) {
        return None;
    }
    let campaign = Campaign::of_recordings(vec![recording.clone()]).ok();
    let turned = campaign.and_then(|campaign| looks_like(&campaign)).map(str::to_owned);
    turned.or_else(|| {
        let unit = recording.readout_unit.as_deref().filter(|_| recording.require_rotation().is_ok())?;
        Some(format!(
            "two channels in {unit}, without a quadrature part or outputs of controllers, look like a sin/cos sensor: --sensor, \
             or instrument = \"sensor\" in campaign.toml"
        ))
    })
}

/// An input that turns further from row to row than any angle can be followed.
pub(super) fn turns_too_far(recording: &Recording) -> Option<String> {
    let t_s = &recording.t_s;
    let (name, most, mut turned): (_, _, Vec<f64>) = if let Some(table) = &recording.table_deg {
        ("table_deg", A_TURN_DEG, table.windows(2).map(|a| (a[1] - a[0]).abs()).collect())
    } else {
        let rates = recording.rate_dps.as_ref()?;
        let turned = rates.iter().zip(t_s.windows(2)).map(|(rate, t)| (rate * (t[1] - t[0])).abs());
        ("rate_dps", UNFOLLOWED_DEG, turned.collect())
    };
    turned.retain(|turned| turned.is_finite());
    turned.sort_by(f64::total_cmp);
    let middle = turned.get(turned.len() / 2).copied().filter(|middle| *middle > most)?;
    Some(format!(
        "by `{name}` the input turns by {middle:.0}° from row to row, which no angle can be followed over: `t_s` or `{name}` is in \
         another unit, or the rows are too far apart"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A recording of two channels that go round `gain` times a turn of a table at 40 deg/s, sampled so many times a second.
    fn recording(gain: f64, hz: f64) -> Recording {
        let t_s: Vec<f64> = (0..3000).map(|row| f64::from(row) / hz).collect();
        let angle = |t: &f64| (40.0 * gain * t).to_radians();
        Recording {
            rate_dps: Some(vec![40.0; t_s.len()]),
            xc_v: Some(t_s.iter().map(|t| 900.0 * angle(t).cos() + 100.0).collect()),
            yc_v: Some(t_s.iter().map(|t| 930.0 * angle(t).sin() - 50.0).collect()),
            t_s,
            ..Recording::default()
        }
    }

    #[test]
    fn two_channels_that_go_round_with_the_table_or_are_counts_are_a_sensor() {
        let says = |recording: &Recording| looks_like_a_sensor(recording).is_some_and(|hint| hint.contains("--sensor"));
        assert!(says(&recording(-1.0, 100.0)));
        let mut pattern = recording(-0.78, 100.0);
        assert!(!says(&pattern));
        pattern.readout_unit = Some("counts".into());
        assert!(says(&pattern));
        pattern.vas_v = Some(vec![0.5; 3000]);
        assert!(!says(&pattern), "the output of a controller is a gyroscope's");
    }

    #[test]
    fn an_input_that_turns_by_thousands_of_degrees_a_row_is_said() {
        assert_eq!(turns_too_far(&recording(1.0, 100.0)), None);
        let said = turns_too_far(&recording(1.0, 0.01)).expect("4000 degrees from row to row");
        assert!(said.contains("4000°") && said.contains("rate_dps"), "{said}");
        let mut stations = recording(1.0, 0.01);
        stations.table_deg = Some((0..3000).map(|row| f64::from(row * 137 % 360)).collect());
        assert_eq!(turns_too_far(&stations), None);
        stations.table_deg = Some((0..3000).map(|row| f64::from(row) * 2500.0).collect());
        assert!(turns_too_far(&stations).is_some_and(|said| said.contains("2500°")));
    }
}
