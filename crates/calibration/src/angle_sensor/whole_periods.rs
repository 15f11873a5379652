//! How many periods a turn a sensor has where its rows stand in no order, so that no row can be followed from the one before: stations
//! that are set at random, to tell a drift from an error of the angle.

use super::samples::SensorRun;
use super::sensor::Sensor;
use crate::numerics::statistics::median;
use crate::recording::Run;

/// As many periods a turn are tried; of more the stations would have to stand closer than a degree to tell them from fewer.
const MOST_PERIODS: u32 = 64;
/// The rows follow one number so much better than any other: an error of 10° rms leaves a sixtieth of what an angle at random does.
const BETTER: f64 = 10.0;
/// A number is taken though others fit as well, as they do at evenly spaced stations, where the least of these is so many times as much.
const FAR_MORE: f64 = 10.0;
/// Rows of a run: of so many at random, a mean resultant of 0.9 at one of 128 signed numbers is met in 128 · exp(−20 · 0.9²) = 1e-5 of cases.
const FEWEST_ROWS: usize = 20;

/// The whole number of periods a turn that the rows follow, whatever their order; none where they can be followed from row to row,
/// or follow several.
pub(super) fn in_any_order(runs: &[Run], period: f64) -> Option<f64> {
    let runs: Vec<SensorRun> = runs.iter().filter_map(|run| SensorRun::new(run.clone(), 0, None).ok()).collect();
    if runs.is_empty() || runs.iter().any(|run| run.len() < FEWEST_ROWS || !is_scattered(run)) {
        return None;
    }
    let sensor = Sensor::of_gain(1.0, period);
    let either = |n: u32| {
        let n = f64::from(n);
        sensor.misfit(&runs, n).min(sensor.misfit(&runs, -n))
    };
    let misfits: Vec<f64> = (1..=MOST_PERIODS).map(either).collect();
    let least = misfits.iter().copied().fold(f64::INFINITY, f64::min);
    let middle = median(&mut misfits.clone());
    let mut fit = (1..=MOST_PERIODS).zip(&misfits).filter(|(_, m)| **m < BETTER * least).map(|(n, _)| f64::from(n));
    let (fewest, next) = (fit.next()?, fit.next());
    (BETTER * least < middle && next.is_none_or(|next| next >= FAR_MORE * fewest)).then_some(fewest)
}

/// Whether rows stand an eighth of a turn and more from those beside them, now one way and now the other: a turn that is read too
/// seldom goes one way only, and its aliases look alike.
fn is_scattered(run: &SensorRun) -> bool {
    let steps: Vec<f64> = run.reference_rad.windows(2).map(|w| w[1] - w[0]).collect();
    let forward = steps.iter().filter(|step| **step > 0.0).count();
    let back = steps.iter().filter(|step| **step < 0.0).count();
    let is_mixed = 4 * forward.min(back) > forward + back;
    is_mixed && median(&mut steps.iter().map(|step| step.abs()).collect::<Vec<_>>()) > std::f64::consts::FRAC_PI_4
}

#[cfg(test)]
mod tests {
    use super::in_any_order;
    use crate::recording::{Recording, Role, Run, RunKind};

    /// Stations 5° apart over so many turns, in an order of which each row says nothing of the next.
    fn stations(periods: f64, turns: u32, in_order: bool) -> Run {
        let mut order: Vec<u32> = (0..72).collect();
        order.sort_by_key(|i| if in_order { *i } else { (37 * i * i + 11 * i) % 101 });
        let angles: Vec<f64> = order.into_iter().map(|i| f64::from(5 * turns * i)).collect();
        let theta = angles.iter().map(|a| (periods * a + 3.0 * a.to_radians().sin()).rem_euclid(360.0)).collect();
        let recording = Recording {
            t_s: (0..72).map(f64::from).collect(),
            table_deg: Some(angles),
            theta_deg: Some(theta),
            ..Recording::default()
        };
        Run {
            kind: RunKind::Rotation,
            file: "stations.csv".into(),
            settle_s: 0.0,
            role: Role::Fit,
            amplitude: None,
            recording,
        }
    }

    #[test]
    fn stations_in_any_order_tell_the_periods_that_they_follow() {
        let of = |run: Run| in_any_order(&[run], std::f64::consts::TAU);
        for periods in [1.0, -1.0, 4.0, -7.0] {
            assert_eq!(of(stations(periods, 1, false)), Some(periods.abs()), "{periods}");
        }
        assert_eq!(of(stations(1.0, 1, true)), None, "followed from row to row");
        assert_eq!(of(stations(0.5, 1, false)), None, "no whole number");
        // 8 and 64 a turn are alike at stations 5° apart, and so are 1 and 23 at those 15° apart
        assert_eq!(of(stations(8.0, 1, false)), None, "several do");
        assert_eq!(of(stations(-1.0, 3, false)), Some(1.0), "hardly anything has 23");
    }
}
