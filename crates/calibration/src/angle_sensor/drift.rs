//! How fast the angle of each run goes off its reference, beside what the sensor does: a mounting that creeps, a reference whose turn is
//! no turn of the sensor's by a few permille. Nobody's calibration has it, and a held-out run is judged about its own line; a table
//! that is fitted about a constant would be fitted to the drift, and where that is large nothing would be found at all.
//!
//! $$e_i = c_r + d_r t_i + \\sum_n (a_n \\cos nφ_i + b_n \\sin nφ_i) + λ\\dot φ_i + β\\operatorname{sign}\\dot φ_i$$
//!
//! r is the run; the drifts d_r are what is left of e regressed on what is left of t, both beside all else (Frisch and Waugh 1933).

use super::deviations::{jackknife, without_block};
use super::ellipse;
use super::identify::thinned;
use super::samples::SensorRun;
use super::selection::VARYING_RATE;
use super::sensor::Sensor;
use super::table_fit::Sample;
use crate::diagnostics::decomposition::BLOCKS;
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{root_mean_square, span};

/// Deviations of the jackknife from which on a drift is no chance: by Student's t of 19 degrees of freedom 1 in 2,000.
const NO_CHANCE: f64 = 4.2;
/// A drift that leaves more than this share of the run's rms without it does not stand in the way of what else is there.
const SMALLER: f64 = 0.7;
/// Turns that a run has to go, there and back as well: less does not tell a position from a time.
const FEWEST_TURNS: f64 = 1.5;
/// Harmonics of the turn, and of the sensor's period where it has several a turn, beside which it is told.
const OF_THE_TURN: u32 = 12;
const OF_THE_PERIOD: u32 = 4;
/// Rows for each unknown.
const ROWS_PER_UNKNOWN: usize = 4;
/// The share of the time, in its mean square, that nothing beside it makes as well.
const OF_ITS_OWN: f64 = 0.1;

/// What the angle of a run does against its reference.
#[derive(Debug, Clone)]
struct Drift {
    /// number of the run in the campaign
    run: usize,
    /// rad/s
    rate: f64,
    /// the middle of the run, where its reference stays as it is; a clock may begin in 1970
    middle_s: f64,
}

/// The drifts of the runs of a sensor of this angular gain.
#[derive(Debug, Clone, Default)]
pub(super) struct Drifts {
    gain: f64,
    told: Vec<Drift>,
    said: Vec<String>,
}

impl Drifts {
    /// Those of the runs of a sensor whose gain is known, where they are no chance and what is there most of.
    pub(super) fn told(runs: &[SensorRun], stated: Option<f64>, period: f64) -> Self {
        let known = Sensor::new(stated, period, runs).ok().filter(|sensor| !sensor.free_gain);
        let measured = || runs.iter().all(|run| !run.commanded);
        known.filter(|_| measured()).and_then(|sensor| Self::of(&sensor, &thinned(runs))).unwrap_or_default()
    }

    fn of(sensor: &Sensor, runs: &[SensorRun]) -> Option<Self> {
        let rows = Rows::of(sensor, runs)?;
        let slopes = rows.slopes()?;
        let without: Vec<Vec<f64>> =
            (0..BLOCKS).map(|block| Rows::of(sensor, &without_block(runs, block))?.slopes()).collect::<Option<_>>()?;
        let mut drifts = Self { gain: sensor.gain, ..Self::default() };
        for (column, &at) in rows.drifting.iter().enumerate() {
            let slope = slopes[column];
            let deviation = jackknife(&without.iter().map(|s| s[column]).collect::<Vec<_>>());
            let [before, after] = rows.left_of(at, &slopes);
            if slope.abs() > NO_CHANCE * deviation && after < SMALLER * before {
                let run = &runs[at];
                let middle_s = 0.5 * (run.t_s[0] + run.t_s[run.len() - 1]);
                drifts.told.push(Drift { run: run.number, rate: slope, middle_s });
                drifts.said.push(format!(
                    "{}: the angle drifts by {:.3e} deg/s, {:.3e}° in all, against the reference; it is taken out of what is fitted, as the line of a held-out run \
                     is, and is not in the calibration",
                    run.name,
                    slope.to_degrees(),
                    (slope * span(&run.t_s)).to_degrees()
                ));
            }
        }
        Some(drifts)
    }

    /// The run with a reference that drifts as its angle does.
    pub(super) fn undone(&self, run: &SensorRun) -> SensorRun {
        let Some(drift) = self.told.iter().find(|drift| drift.run == run.number) else { return run.clone() };
        let drifted = |(a, t): (&f64, &f64)| a + drift.rate / self.gain * (t - drift.middle_s);
        let reference_rad = run.reference_rad.iter().zip(&run.t_s).map(drifted).collect();
        SensorRun { reference_rad, ..run.clone() }
    }

    /// What has to be said of them.
    pub(super) fn said(self) -> Vec<String> {
        self.said
    }
}

/// The rows of all runs, for a regression.
struct Rows {
    /// the run that a row is of
    run: Vec<usize>,
    error: Vec<f64>,
    time: Vec<f64>,
    /// what the error may be besides
    besides: Vec<Vec<f64>>,
    /// the runs whose drift can be told
    drifting: Vec<usize>,
}

impl Rows {
    fn of(sensor: &Sensor, runs: &[SensorRun]) -> Option<Self> {
        let start = ellipse::algebraic(runs);
        let samples = sensor.samples(runs, start.as_ref());
        let turns = |run: &SensorRun| run.path_rad() / std::f64::consts::TAU;
        let drifting: Vec<usize> = (0..runs.len()).filter(|at| turns(&runs[*at]) > FEWEST_TURNS).collect();
        let rates: Vec<f64> = samples.iter().map(|s| s.rate).collect();
        let varies = span(&rates) > VARYING_RATE * rates.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
        let poles = sensor.cycles_per_turn();
        let of_the_period = (1..=OF_THE_PERIOD).map(|n| f64::from(n) * poles).filter(|n| *n > f64::from(OF_THE_TURN));
        let harmonics: Vec<f64> = (1..=OF_THE_TURN).map(f64::from).chain(of_the_period).collect();
        let unknowns = 2 * runs.len() + 2 * harmonics.len() + 2;
        if drifting.is_empty() || samples.len() < ROWS_PER_UNKNOWN * unknowns {
            return None;
        }
        let besides = |s: &Sample| {
            let mut row = vec![0.0; runs.len()];
            row[s.run] = 1.0;
            row.extend(harmonics.iter().flat_map(|n| <[f64; 2]>::from((n * s.reference).sin_cos())));
            // a lag, and play: what changes its sign half-way goes with the time
            row.extend(
                varies.then_some([s.rate, if s.rate == 0.0 { 0.0 } else { s.rate.signum() }]).into_iter().flatten(),
            );
            row
        };
        Some(Self {
            run: samples.iter().map(|s| s.run).collect(),
            error: samples.iter().map(|s| s.error).collect(),
            time: runs.iter().flat_map(|run| run.t_s.iter().copied()).collect(),
            besides: samples.iter().map(besides).collect(),
            drifting,
        })
    }

    /// What of a column nothing else makes.
    fn own(&self, column: &[f64]) -> Vec<f64> {
        let unknowns = self.besides.first().map_or(0, Vec::len);
        let mut equations = NormalEquations::new(unknowns);
        self.besides.iter().zip(column).for_each(|(row, value)| equations.add(row, *value));
        let x = equations.solve();
        let made = |row: &Vec<f64>| row.iter().zip(&x).map(|(a, b)| a * b).sum::<f64>();
        self.besides.iter().zip(column).map(|(row, value)| value - made(row)).collect()
    }

    /// The time of a run about its middle, and nothing in the others.
    fn time_of(&self, run: usize) -> Vec<f64> {
        let own: Vec<f64> = self.time.iter().zip(&self.run).filter(|(_, r)| **r == run).map(|(t, _)| *t).collect();
        let middle = own.iter().sum::<f64>() / own.len().max(1) as f64;
        self.time.iter().zip(&self.run).map(|(t, r)| if *r == run { t - middle } else { 0.0 }).collect()
    }

    /// The drifts, in the order of `drifting`; `None` where the rest makes one of them as well.
    fn slopes(&self) -> Option<Vec<f64>> {
        let error = self.own(&self.error);
        let mut own = Vec::with_capacity(self.drifting.len());
        for run in &self.drifting {
            let time = self.time_of(*run);
            let of_its_own = self.own(&time);
            if root_mean_square(&of_its_own).powi(2) < OF_ITS_OWN * root_mean_square(&time).powi(2) {
                return None;
            }
            own.push(of_its_own);
        }
        let mut equations = NormalEquations::new(own.len());
        for (i, value) in error.iter().enumerate() {
            equations.add(&own.iter().map(|column| column[i]).collect::<Vec<_>>(), *value);
        }
        Some(equations.solve())
    }

    /// What is left of a run, rms: with all as it is, and without the drifts.
    fn left_of(&self, run: usize, slopes: &[f64]) -> [f64; 2] {
        let mut straight = self.error.clone();
        for (of, slope) in self.drifting.iter().zip(slopes) {
            straight.iter_mut().zip(self.time_of(*of)).for_each(|(e, t)| *e -= slope * t);
        }
        [&self.error, &straight].map(|error| {
            let left = self.own(error);
            root_mean_square(
                &left.iter().zip(&self.run).filter(|(_, r)| **r == run).map(|(l, _)| *l).collect::<Vec<_>>(),
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle_sensor::samples::Reading;
    use crate::numerics::statistics::remembered;
    use crate::recording::Role;

    /// Three turns on which the angle goes off by 0.2 %, by a clock that begins then.
    fn worm(begins_s: f64) -> SensorRun {
        let t_s: Vec<f64> = (0..900).map(|i| begins_s + f64::from(i)).collect();
        let reference_rad: Vec<f64> = (0..900).map(|i| 0.021 * f64::from(i)).collect();
        let noise = remembered(0.0, t_s.len(), 7);
        let theta = reference_rad.iter().zip(&noise).map(|(a, e)| 1.002 * a + 1e-3 * a.cos() + 2e-4 * e).collect();
        SensorRun {
            name: "worm.csv".into(),
            number: 3,
            role: Role::Fit,
            commanded: false,
            rate_rad_s: vec![0.021; t_s.len()],
            acceleration_rad_s2: vec![0.0; t_s.len()],
            t_s,
            reference_rad,
            temp_c: None,
            recorded: None,
            reading: Reading::Angle(theta),
        }
    }

    #[test]
    fn a_reference_drifts_about_the_middle_of_its_run_whenever_its_clock_began() {
        for begins_s in [0.0, 1.7e9] {
            let run = worm(begins_s);
            let drifts = Drifts::told(std::slice::from_ref(&run), Some(1.0), std::f64::consts::TAU);
            assert!(drifts.told.len() == 1 && (drifts.told[0].rate / 4.2e-5 - 1.0).abs() < 0.02, "{drifts:?}");
            let moved = drifts.undone(&run).reference_rad;
            let by = moved.iter().zip(&run.reference_rad).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!((by / (4.2e-5 * 449.5) - 1.0).abs() < 0.02, "from {begins_s} s: {by} rad");
        }
    }
}
