//! Clipping of a channel at the rail of its converter: the extreme value occurs far more often than the level beside it.

use super::samples::SensorRun;
use crate::data::rail::rails;

/// The rails of both channels, in their unit; infinite where none is reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rails {
    /// lower and upper rail of x and of y
    pub(crate) limits: [[f64; 2]; 2],
}

impl Rails {
    /// No rail is reached.
    pub(crate) fn none() -> Self {
        Self { limits: [[f64::NEG_INFINITY, f64::INFINITY]; 2] }
    }

    /// The rails that the readings of all runs show.
    pub(crate) fn of<'a>(readings: impl Iterator<Item = &'a [f64; 2]>) -> Self {
        let readings: Vec<[f64; 2]> = readings.copied().collect();
        Self { limits: std::array::from_fn(|channel| rails(readings.iter().map(|z| [z[channel], z[1 - channel]]))) }
    }

    /// Which channels are at a rail.
    #[inline]
    pub(crate) fn reached(&self, z: [f64; 2]) -> [bool; 2] {
        std::array::from_fn(|i| z[i] <= self.limits[i][0] || z[i] >= self.limits[i][1])
    }

    /// Any channel is at a rail.
    #[inline]
    pub(crate) fn clips(&self, z: [f64; 2]) -> bool {
        self.reached(z).contains(&true)
    }

    /// A rail was found.
    pub(crate) fn any(&self) -> bool {
        self.limits.iter().flatten().any(|l| l.is_finite())
    }
}

/// Takes the rows at a rail out of runs that reach one which others go beyond: that converter had another range, and what is
/// common to all runs does not know of it. Says of which.
pub(crate) fn without_rails_of_their_own(runs: &[SensorRun], warnings: &mut Vec<String>) -> Vec<SensorRun> {
    let readings = || runs.iter().filter_map(SensorRun::channels).flatten();
    let ends: [[f64; 2]; 2] = std::array::from_fn(|channel| {
        readings().map(|z| z[channel]).fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)])
    });
    runs.iter()
        .map(|run| {
            let mut own = Rails::of(run.channels().into_iter().flatten());
            for (limits, ends) in own.limits.iter_mut().zip(ends) {
                let is_all_runs = limits.iter().zip(ends).all(|(rail, end)| !rail.is_finite() || *rail == end);
                if is_all_runs {
                    *limits = Rails::none().limits[0];
                }
            }
            let Some(readings) = run.channels().filter(|_| own.any()) else { return run.clone() };
            let kept: Vec<usize> = (0..run.len()).filter(|i| !own.clips(readings[*i])).collect();
            warnings.push(format!(
                "{}: {} rows stand at a rail that other runs go beyond, and are left out: a channel is clipped",
                run.name,
                run.len() - kept.len()
            ));
            run.subset(&kept)
        })
        .filter(|run| run.len() > 1)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::samples::Reading;
    use super::*;

    fn circle(limit: f64) -> Vec<[f64; 2]> {
        (0..2000)
            .map(|i| f64::from(i) * 0.031_7)
            .map(|t| [(600.0 * t.cos()).round().min(limit), (500.0 * t.sin()).round()])
            .collect()
    }

    #[test]
    fn a_channel_cut_at_its_rail_is_seen_and_a_whole_one_is_not() {
        assert_eq!(
            Rails::of(circle(511.0).iter()).limits,
            [[f64::NEG_INFINITY, 511.0], [f64::NEG_INFINITY, f64::INFINITY]]
        );
        assert!(!Rails::of(circle(1e9).iter()).any());
    }

    #[test]
    fn a_rail_that_other_runs_go_beyond_costs_its_run_the_rows_at_it() {
        let run = |name: &str, limit: f64| {
            let readings = circle(limit);
            let t_s: Vec<f64> = (0..readings.len()).map(|i| 0.01 * i as f64).collect();
            SensorRun {
                name: name.into(),
                number: 0,
                role: crate::recording::Role::Fit,
                commanded: false,
                reference_rad: t_s.clone(),
                rate_rad_s: t_s.clone(),
                acceleration_rad_s2: t_s.clone(),
                t_s,
                temp_c: None,
                recorded: None,
                reading: Reading::Channels(readings),
            }
        };
        let kept = |limits: [f64; 2]| {
            let mut warnings = Vec::new();
            let runs = [run("a.csv", limits[0]), run("b.csv", limits[1])];
            let left = without_rails_of_their_own(&runs, &mut warnings);
            (left.iter().map(SensorRun::len).collect::<Vec<_>>(), warnings)
        };
        let (left, warnings) = kept([511.0, 1e9]);
        let at_rail = circle(511.0).iter().filter(|z| z[0] >= 511.0).count();
        assert_eq!(left, [2000 - at_rail, 2000]);
        assert!(warnings.len() == 1 && warnings[0].starts_with("a.csv: "), "{warnings:?}");
        // one converter for all: what its rail does is modelled
        assert_eq!(kept([511.0, 511.0]), (vec![2000; 2], vec![]));
    }

    #[test]
    fn a_sine_in_a_few_coarse_steps_has_no_rail() {
        let coarse: Vec<[f64; 2]> = (0..4000)
            .map(|i| f64::from(i) * 0.017)
            .map(|t| [(20.0 * t.cos()).round(), (20.0 * t.sin()).round()])
            .collect();
        assert!(!Rails::of(coarse.iter()).any());
    }
}
