//! Rows that a recording lost. The loops of the instrument never noticed: a row or two are drawn between their neighbours, and where more
//! are missing the recording begins anew.

use cvg_model::AxisForces;

use super::runs::Row;

/// Rows that are drawn between their neighbours stand for no longer than this, s: at 100 deg/s the pattern turns by half a degree
/// meanwhile, of which a straight line leaves 1e-5 rad. Engineering choice.
const BRIDGED_S: f64 = 5e-3;
/// By how much a row moves the clock that counts control steps, of the time that it is off: time stamps that jitter don't move it,
/// and a clock that is off by 100 ppm is followed.
const FOLLOWED: f64 = 0.05;

/// The control steps from one row to the next, by a clock that runs on at this interval. 0 stands for one that has stepped back.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped, and a conversion that saturates")]
fn steps(t_s: &[f64], interval_s: f64) -> Vec<usize> {
    let mut clock = t_s.first().copied().unwrap_or(0.0);
    t_s.iter()
        .skip(1)
        .map(|t| {
            let steps = ((t - clock) / interval_s).round().max(0.0);
            clock += steps * interval_s;
            clock += FOLLOWED * (t - clock);
            steps as usize
        })
        .collect()
}

/// The rows of these times with the few that are missing drawn between, and beside each what was commanded there. A row that does not
/// stand one control step after another follows none.
pub(super) fn bridged(t_s: &[f64], interval_s: f64, rows: Vec<(Row, f64)>) -> (Vec<Row>, Vec<f64>) {
    let steps = steps(t_s, interval_s);
    let mut out: Vec<(Row, f64)> = Vec::with_capacity(rows.len());
    for (i, (row, asked)) in rows.into_iter().enumerate() {
        let gone = if i > 0 { steps[i - 1] } else { 0 };
        let few = gone > 1 && gone as f64 * interval_s <= BRIDGED_S;
        if let Some((before, asked_before)) =
            out.last().copied().filter(|(before, _)| few && before.is_whole() && row.is_whole())
        {
            for n in 1..gone {
                let share = n as f64 / gone as f64;
                out.push((before.towards(&row, share), asked_before + share * (asked - asked_before)));
            }
            out.push((Row { follows: true, ..row }, asked));
        } else {
            out.push((Row { follows: gone == 1 && row.is_whole(), ..row }, asked));
        }
    }
    out.into_iter().unzip()
}

impl Row {
    /// All that was put out is known.
    fn is_whole(&self) -> bool {
        let f = &self.forces;
        [f.x_c, f.x_s, f.y_c, f.y_s].iter().all(|v| v.is_finite())
    }

    /// A row that is this share of the way to another, which follows.
    fn towards(&self, other: &Self, share: f64) -> Self {
        let [a, b] = [1.0 - share, share];
        let (f, g) = (&self.forces, &other.forces);
        Self {
            seen: self.seen * a + other.seen * b,
            forces: AxisForces {
                x_c: a * f.x_c + b * g.x_c,
                x_s: a * f.x_s + b * g.x_s,
                y_c: a * f.y_c + b * g.y_c,
                y_s: a * f.y_s + b * g.y_s,
            },
            follows: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use cvg_model::Envelope;

    use super::*;

    fn row(x: f64) -> (Row, f64) {
        let forces = AxisForces { x_c: x, x_s: 0.0, y_c: 0.0, y_s: 0.0 };
        (Row { seen: Envelope::new(x, 0.0, 0.0, 0.0), forces, follows: false }, x)
    }

    /// Rows whose value is their time in control steps.
    fn bridged_at(t_s: &[f64]) -> (Vec<f64>, Vec<bool>, Vec<f64>) {
        let (rows, asked) = bridged(t_s, 1e-3, t_s.iter().map(|t| row(1e3 * t)).collect());
        (rows.iter().map(|r| r.seen.x_c).collect(), rows.iter().map(|r| r.follows).collect(), asked)
    }

    fn close(a: &[f64], b: &[f64]) {
        assert_eq!(a.len(), b.len(), "{a:?}");
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?}");
    }

    #[test]
    fn a_few_lost_rows_are_drawn_between_their_neighbours() {
        let (seen, follows, asked) = bridged_at(&[0.0, 1e-3, 4e-3, 5e-3]);
        close(&seen, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        close(&asked, &seen);
        assert_eq!(follows, [false, true, true, true, true, true]);
    }

    #[test]
    fn after_a_gap_the_recording_begins_anew() {
        let (seen, follows, _) = bridged_at(&[0.0, 1e-3, 0.5, 0.501]);
        close(&seen, &[0.0, 1.0, 500.0, 501.0]);
        assert_eq!(follows, [false, true, false, true]);
    }

    #[test]
    fn a_command_that_was_not_recorded_is_not_drawn_across() {
        let mut rows: Vec<_> = [0.0, 1.0, 3.0].into_iter().map(row).collect();
        rows[2].0.forces.y_s = f64::NAN;
        let (rows, _) = bridged(&[0.0, 1e-3, 3e-3], 1e-3, rows);
        assert_eq!(rows.iter().map(|r| r.follows).collect::<Vec<_>>(), [false, true, false]);
    }

    #[test]
    fn time_stamps_that_jitter_are_no_gaps() {
        let t_s: Vec<f64> = (0..2000)
            .map(|i| 1e-3 * (f64::from(i) * 1.0001 + 0.25 * f64::from(i * 7919 % 100) / 50.0 - 0.25))
            .collect();
        let (seen, follows, _) = bridged_at(&t_s);
        assert_eq!(seen.len(), t_s.len());
        assert!(follows[1..].iter().all(|follows| *follows));
    }
}
