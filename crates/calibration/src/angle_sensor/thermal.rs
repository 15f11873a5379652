//! How a sensor's two channels go with the temperature: slopes of the offsets and of the gain ratio. What is fitted afterwards is
//! fitted to the channels as they would have been at one temperature.
//!
//! $$x_d = x + o_{x,T} τ, \\quad y_d = o_y + (y - o_y)(1 + s τ) + o_{y,T} τ, \\quad τ = T - T_0$$
//!
//! x, y are the channels at T₀. Where the temperature changes within the runs, the slopes are regressed on angle and radius of all rows,
//! beside what does not go with the temperature: harmonics of either, constants of the runs, lag, a common amplitude and a zero of
//! the angle that do. Where each run has one of its own, the slopes are those of straight lines through what the runs tell by themselves.

use cvg_model::effects::EffectId;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::deviations::{Deviations, jackknife, without_block};
use super::effects::LibraryReadout;
use super::rails::Rails;
use super::readout::{Kind, Readout};
use super::readout_fit::{Weighting, fit, starts};
use super::samples::{Reading, SensorRun};
use super::selection::fit_from;
use super::sensor::Sensor;
use crate::diagnostics::decomposition::{BLOCKS, STUDENT_19};
use crate::diagnostics::temperature::{LEAST_SPAN_K, slopes};
use crate::model::hypothesis::{Member, Origin};
use crate::model::written::EffectText;
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{correlation, span};
use crate::report::named::OFFSET_TEMPERATURE;
use crate::report::{EffectReport, Estimate, ParameterReport};

/// A slope that lies within what chance makes of one in 2,000 campaigns is none.
const BY_CHANCE: f64 = 5e-4;
/// Runs go through the temperatures where the widest span of one is this share of that of all: engineering choice.
const WITHIN: f64 = 0.5;
/// Periods that a run has to turn through, there and back as well: one swing does not tell a position from a temperature.
const FEWEST_PERIODS: f64 = 2.0;
/// Rounds of the regression, which is linear but for what a round moves.
const ROUNDS: usize = 4;
/// Harmonics that do not go with the temperature.
const HARMONICS: usize = 4;
/// A temperature that goes with the time so closely is not told from it.
const WITH_TIME: f64 = 0.9;
/// A change of a channel, in amplitudes, that shows what it does.
const NUDGE: f64 = 1e-6;

/// Offsets of x and of y per kelvin and the gain ratio per kelvin, relative to itself.
type Slopes = [f64; 3];

/// An effect as text, because the library has none: offsets that follow the temperature.
const OFFSETS: &str = r#"
id = "offset-temperature"
summary = "offsets that follow the temperature"
stage = "readout"
[[parameter]]
name = "offset_x_per_k"
unit = "V/K"
neutral = 0.0
scale = 1e-4
[[parameter]]
name = "offset_y_per_k"
unit = "V/K"
neutral = 0.0
scale = 1e-4
[map]
"x'" = "x + offset_x_per_k * warmer"
"y'" = "y + offset_y_per_k * warmer"
"#;

/// What goes with the temperature.
#[derive(Debug, Clone)]
pub(super) struct Thermal {
    reference_c: f64,
    /// the offset of y, about which the gain goes with the temperature
    centre_y: f64,
    slopes: Slopes,
    half_widths: Slopes,
    evidence: String,
    /// the temperature went with the time in every run
    with_time: bool,
}

/// What the temperatures of a campaign say.
pub(super) enum Told {
    Nothing,
    Slopes(Thermal),
    /// why a dependence that may be there is not told
    Open(String),
}

impl Thermal {
    /// The slopes of runs to fit, where they are more than a chance.
    pub(super) fn told(runs: &[SensorRun], stated: Option<f64>, period: f64, reference_c: Option<f64>) -> Told {
        let temperatures: Option<Vec<&Vec<f64>>> = runs.iter().map(|r| r.temp_c.as_ref()).collect();
        let Some(temperatures) = temperatures.filter(|_| runs.iter().all(|r| r.channels().is_some())) else {
            return Told::Nothing;
        };
        let all: Vec<f64> = temperatures.iter().flat_map(|t| t.iter().copied()).collect();
        if !all.iter().all(|t| t.is_finite()) || span(&all) < LEAST_SPAN_K || runs.iter().all(|r| r.commanded) {
            return Told::Nothing;
        }
        let reference_c = reference_c.unwrap_or(all.iter().sum::<f64>() / all.len() as f64);
        let Ok(sensor) = Sensor::new(stated, period, runs) else { return Told::Nothing };
        let widest = temperatures.iter().map(|t| span(t)).fold(0.0, f64::max);
        let turns =
            runs.iter().all(|r| r.path_rad() * sensor.cycles_per_turn() > FEWEST_PERIODS * std::f64::consts::TAU);
        let Some(bench) = Bench::new(&sensor, runs, reference_c).filter(|_| turns) else { return Told::Nothing };
        if widest >= LEAST_SPAN_K.max(WITHIN * span(&all)) {
            bench.within().map_or(Told::Nothing, Told::Slopes)
        } else if runs.len() > 2 {
            bench.between().map_or(Told::Nothing, Told::Slopes)
        } else {
            Told::Open(format!(
                "the temperatures of two runs differ by {:.1} K: what is different between them may go with the temperature or with \
                 anything else; runs at three temperatures tell",
                span(&all)
            ))
        }
    }

    /// A run as its channels would read at the temperature that parameters refer to.
    pub(super) fn undone(&self, run: &SensorRun) -> SensorRun {
        let (Some(channels), Some(temp_c)) = (run.channels(), &run.temp_c) else { return run.clone() };
        let undo = |(z, t): (&[f64; 2], &f64)| self.at_reference(*z, t - self.reference_c);
        let reading = Reading::Channels(channels.iter().zip(temp_c).map(undo).collect());
        let recorded = run.recorded.clone().or_else(|| Some(channels.to_vec()));
        SensorRun { reading, recorded, ..run.clone() }
    }

    fn at_reference(&self, [x, y]: [f64; 2], warmer_k: f64) -> [f64; 2] {
        let [of_x, of_y, gain] = self.slopes;
        [x - of_x * warmer_k, (y - self.centre_y - of_y * warmer_k) / (1.0 + gain * warmer_k) + self.centre_y]
    }

    pub(super) fn reference_c(&self) -> f64 {
        self.reference_c
    }

    /// Adds to the deviations of offsets and gain ratio what the slopes leave open between the temperatures of the runs and that which
    /// parameters refer to.
    pub(super) fn widen(&self, deviations: &mut Deviations, gain_ratio: f64, runs: &[SensorRun]) {
        let temperatures = || runs.iter().flat_map(|r| r.temp_c.iter().flatten());
        let warmer = temperatures().sum::<f64>() / temperatures().count().max(1) as f64 - self.reference_c;
        let [x, y, gain] = self.half_widths.map(|half| half / STUDENT_19 * warmer);
        for (own, open) in deviations.readout.iter_mut().zip([x, y, gain * gain_ratio]) {
            *own = own.hypot(open);
        }
    }

    /// What has to be said of it.
    pub(super) fn said(&self) -> Option<String> {
        self.with_time.then(|| {
            "the temperature went with the time in every run: what is undone as following the temperature may be a drift; a run that \
             warms and cools tells them apart"
                .into()
        })
    }

    fn is_told(&self, at: usize) -> bool {
        self.slopes[at] != 0.0
    }

    /// The effects, in the words of the report.
    pub(super) fn effects(&self) -> Vec<EffectReport> {
        let parameter = |at: usize, name: &str, unit: &str| {
            let (value, half) = (self.slopes[at], self.half_widths[at]);
            ParameterReport { name: name.into(), unit: unit.into(), value, ci95: Some([value - half, value + half]) }
        };
        let effect = |id: &str, parameters: Vec<ParameterReport>| EffectReport {
            id: id.into(),
            origin: Origin::Discovered,
            parameters,
            heldout_rms_deg: None,
            evidence: self.evidence.clone(),
            confounded_with: Vec::new(),
            separated_by: None,
        };
        let gain = self.is_told(2).then(|| effect("temperature", vec![parameter(2, "gain_per_k", "1/K")]));
        let offsets = (self.is_told(0) || self.is_told(1)).then(|| {
            let each = [(0, "offset_x_per_k"), (1, "offset_y_per_k")].into_iter().filter(|(at, _)| self.is_told(*at));
            effect(OFFSET_TEMPERATURE.id, each.map(|(at, name)| parameter(at, name, "V/K")).collect())
        });
        gain.into_iter().chain(offsets).collect()
    }

    /// The effects, as members of a hypothesis.
    pub(super) fn members(&self) -> Vec<Member> {
        let member = |id, values| Member { id, values, origin: Origin::Discovered, refined: true };
        let offsets =
            || EffectText::parse(OFFSETS, OFFSET_TEMPERATURE.id).and_then(|text| text.effect(OFFSET_TEMPERATURE.id));
        let gain = self.is_told(2).then(|| member(EffectId::Temperature, [self.slopes[2], 0.0, 0.0, 0.0]));
        let offsets = (self.is_told(0) || self.is_told(1)).then(offsets).and_then(Result::ok);
        gain.into_iter().chain(offsets.map(|id| member(id, [self.slopes[0], self.slopes[1], 0.0, 0.0]))).collect()
    }
}

/// The runs with what the slopes are estimated beside.
struct Bench<'a> {
    sensor: &'a Sensor,
    runs: Vec<SensorRun>,
    readout: Readout,
    reference_c: f64,
}

impl<'a> Bench<'a> {
    fn new(sensor: &'a Sensor, runs: &[SensorRun], reference_c: f64) -> Option<Self> {
        let runs = super::identify::thinned(runs);
        let rails = Rails::of(runs.iter().filter_map(SensorRun::channels).flatten());
        let front = (Kind::Affine, Weighting::VarianceComponents, Vec::new());
        let readout = fit_from(&starts(&runs, sensor.gain), rails, &front, &runs, sensor.gain)?.readout;
        Some(Self { sensor, runs, readout, reference_c })
    }

    fn thermal(&self, slopes: Slopes) -> Thermal {
        let centre_y = LibraryReadout::from(&self.readout).offset[1];
        let correlated = |r: &SensorRun| correlation(&r.t_s, r.temp_c.as_deref().unwrap_or_default()).abs() > WITH_TIME;
        Thermal {
            reference_c: self.reference_c,
            centre_y,
            slopes,
            half_widths: [0.0; 3],
            evidence: String::new(),
            with_time: self.runs.iter().all(correlated),
        }
    }

    /// Slopes of the rows, each with an interval by the jackknife over blocks.
    fn within(mut self) -> Option<Thermal> {
        let mut found = self.thermal([0.0; 3]);
        let mut free = [true; 3];
        loop {
            for _ in 0..ROUNDS {
                let at_reference: Vec<SensorRun> = self.runs.iter().map(|r| found.undone(r)).collect();
                let gain = self.sensor.gain;
                self.readout =
                    fit(Kind::Affine, Weighting::VarianceComponents, &at_reference, gain, &self.readout)?.readout;
                let step = self.step(&at_reference, free)?;
                let slopes = std::array::from_fn(|i| found.slopes[i] + step[i]);
                found = self.thermal(slopes);
            }
            let at_reference: Vec<SensorRun> = self.runs.iter().map(|r| found.undone(r)).collect();
            let steps: Vec<Slopes> =
                (0..BLOCKS).filter_map(|block| self.step(&without_block(&at_reference, block), free)).collect();
            let deviation = |i: usize| jackknife(&steps.iter().map(|s| s[i]).collect::<Vec<_>>());
            let deviations: Slopes = std::array::from_fn(deviation);
            let limit = beyond_chance(BLOCKS - 1)?;
            let kept: [bool; 3] = std::array::from_fn(|i| free[i] && found.slopes[i].abs() > limit * deviations[i]);
            if kept == free {
                let evidence = "regressed on angle and radius of all rows, beside what does not go with the temperature; interval by jackknife";
                found.half_widths = deviations.map(|d| STUDENT_19 * d);
                found.evidence = format!("{evidence} over {BLOCKS} blocks");
                return kept.contains(&true).then_some(found);
            }
            free = kept;
            found.slopes = std::array::from_fn(|i| if free[i] { found.slopes[i] } else { 0.0 });
        }
    }

    /// One step of the slopes that are free, by angle and radius of channels that are near the reference's temperature.
    fn step(&self, runs: &[SensorRun], free: [bool; 3]) -> Option<Slopes> {
        let samples = self.sensor.samples(runs, Some(&self.readout));
        let constants = runs.len();
        let nuisances = constants + 2 * HARMONICS + 5;
        let columns = 3 + 2 * nuisances;
        let centre_y = LibraryReadout::from(&self.readout).offset[1];
        let mut rows: Vec<(Vec<f64>, f64, bool)> = Vec::with_capacity(2 * samples.len());
        let readings = runs.iter().flat_map(|r| r.channels().into_iter().flatten().zip(r.temp_c.iter().flatten()));
        for (sample, (z, temp_c)) in samples.iter().zip(readings) {
            if self.readout.rails.clips(*z) {
                continue;
            }
            let warmer = temp_c - self.reference_c;
            let shows = self.shown_by(*z);
            let mut row = vec![0.0; nuisances];
            row[sample.run] = 1.0;
            for n in 0..HARMONICS {
                let (sin, cos) = ((n + 1) as f64 * sample.theta).sin_cos();
                (row[constants + 2 * n], row[constants + 2 * n + 1]) = (cos, sin);
            }
            let (sin, cos) = sample.reference.sin_cos();
            let side = [sample.rate, warmer, if self.sensor.free_gain { sample.reference } else { 0.0 }, sin, cos];
            row[constants + 2 * HARMONICS..].copy_from_slice(&side);
            let by_slope = |by: [f64; 2]| [by[0], by[1], by[1] * (z[1] - centre_y)];
            for (of_radius, by) in shows.into_iter().enumerate() {
                let mut whole = vec![0.0; columns];
                for (i, value) in by_slope(by).into_iter().enumerate().filter(|(i, _)| free[*i]) {
                    whole[i] = warmer * value;
                }
                let from = 3 + of_radius * nuisances;
                whole[from..from + nuisances].copy_from_slice(&row);
                let value = if of_radius == 1 { self.readout.ln_radius(*z) } else { sample.error };
                rows.push((whole, value, of_radius == 1));
            }
        }
        let solve = |weights: [f64; 2]| {
            let mut equations = NormalEquations::new(columns);
            for (row, value, of_radius) in &rows {
                let weight = weights[usize::from(*of_radius)];
                let weighted: Vec<f64> = row.iter().map(|v| weight * v).collect();
                equations.add(&weighted, weight * value);
            }
            equations.solve()
        };
        // angle and radius count by their own scatter
        let equal = solve([1.0; 2]);
        let scatter = [false, true].map(|radius| {
            let of = rows.iter().filter(|r| r.2 == radius);
            let square = of
                .map(|(row, v, _)| (v - row.iter().zip(&equal).map(|(a, b)| a * b).sum::<f64>()).powi(2))
                .sum::<f64>();
            square.sqrt().max(f64::MIN_POSITIVE)
        });
        let x = solve(scatter.map(|s| scatter[0].min(scatter[1]) / s));
        x[..3].iter().all(|v| v.is_finite()).then(|| [x[0], x[1], x[2]])
    }

    /// What a unit more of x and of y does to the angle, and to the logarithm of the radius.
    fn shown_by(&self, z: [f64; 2]) -> [[f64; 2]; 2] {
        let nudge = NUDGE * self.readout.amplitude;
        let at = |by: [f64; 2]| {
            let [x, y] = self.readout.undo([z[0] + by[0], z[1] + by[1]]);
            (y.atan2(x), 0.5 * (x * x + y * y + 1e-18).ln())
        };
        let here = at([0.0; 2]);
        let each = [at([nudge, 0.0]), at([0.0, nudge])];
        let turned = each.map(|e| crate::numerics::angles::wrapped(e.0 - here.0, std::f64::consts::TAU) / nudge);
        [turned, each.map(|e| (e.1 - here.1) / nudge)]
    }

    /// Slopes of straight lines through what each run tells by itself.
    fn between(self) -> Option<Thermal> {
        let own = |run: &SensorRun| {
            let one = std::slice::from_ref(run);
            let readout =
                fit(Kind::Affine, Weighting::VarianceComponents, one, self.sensor.gain, &self.readout)?.readout;
            let LibraryReadout { offset, gain_ratio, .. } = LibraryReadout::from(&readout);
            let temp_c = run.temp_c.as_ref()?;
            let mean = temp_c.iter().sum::<f64>() / temp_c.len() as f64;
            Some((vec![1.0, mean - self.reference_c], [offset[0], offset[1], gain_ratio]))
        };
        let told: Vec<_> = self.runs.iter().map(own).collect::<Option<_>>()?;
        let lines: Vec<Vec<Estimate>> = (0..3)
            .map(|i| slopes(&told.iter().map(|(row, values)| (row.clone(), values[i])).collect::<Vec<_>>()))
            .collect::<Option<_>>()?;
        let spare = told.len() - 2;
        let wider = beyond_chance(spare)? / StudentsT::new(0.0, 1.0, spare as f64).ok()?.inverse_cdf(0.975);
        let at_reference = lines[2][0].value;
        let lines: [Estimate; 3] = std::array::from_fn(|i| {
            let scale = if i == 2 { at_reference } else { 1.0 };
            let Estimate { value, ci95 } = lines[i][1];
            Estimate { value: value / scale, ci95: ci95.map(|v| v / scale) }
        });
        let is_told = |e: &Estimate| e.value.abs() > wider * e.half_width();
        let kept = lines.map(|e| if is_told(&e) { e.value } else { 0.0 });
        let mut found = self.thermal(kept);
        found.half_widths = lines.map(|e| e.half_width());
        found.evidence = format!(
            "a straight line through what {} runs tell by themselves at their temperatures; interval by how they scatter about it",
            told.len()
        );
        found.with_time = false;
        kept.iter().any(|v| *v != 0.0).then_some(found)
    }
}

/// Standard deviations beyond which a value of so many degrees of freedom is no chance.
fn beyond_chance(freedom: usize) -> Option<f64> {
    Some(StudentsT::new(0.0, 1.0, freedom as f64).ok()?.inverse_cdf(1.0 - 0.5 * BY_CHANCE))
}
