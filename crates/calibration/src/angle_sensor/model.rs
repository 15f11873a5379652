//! The identified sensor: what was selected, fitted to all rows, with the checks that decide whether it is an answer.

use super::autoregression;
use super::circle;
use super::commanded;
use super::cross_validation::Losses;
use super::deviations::Deviations;
use super::lines::alias_elsewhere;
use super::rails::Rails;
use super::readout::{Competing, Kind, Readout};
use super::readout_fit::{Weighting, starts};
use super::samples::SensorRun;
use super::selection::{Front, Selected, Selection, fit_from};
use super::sensor::Sensor;
use super::table_fit::{Motion, Shape, TableFit, by_run};
use crate::diagnostics::decomposition::STUDENT_19;
use crate::error::Refusal;
use crate::model::hypothesis::Origin;

/// Rows of the last fit; more would not narrow what still means something.
const ENOUGH_ROWS: usize = 100_000;
/// An angle that follows its reference is off by less than this share of what an angle at random is, a period over √12:
/// engineering choice.
const FOLLOWING: f64 = 0.5;

/// Whether there is an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// errors were found, and undoing them predicts rows that were not fitted
    Answered,
    /// … which a memory of the noise explains as well, in the rows that were fitted
    Doubted,
    /// nothing was found that does
    Neutral,
}

/// An identified sensor.
#[derive(Debug, Clone)]
pub(crate) struct SensorModel {
    pub(crate) sensor: Sensor,
    pub(crate) outcome: Outcome,
    /// the readout, where there are channels, and how it was weighted
    pub(crate) readout: Option<(Readout, Weighting)>,
    pub(crate) table: TableFit,
    /// cross-validated rms of what was selected and of the sensor as it is, rad; of the radius where the reference is
    /// commanded
    pub(crate) predicted: f64,
    pub(crate) predicted_raw: Option<f64>,
    /// the reference was commanded and not believed: the readout is known from the radius alone, and a table is the sensor's or the drive's
    pub(crate) by_radius: bool,
    /// what goes with the motion is told from what goes with the position, for positions were met again at another
    pub(crate) tells_motion: bool,
}

impl SensorModel {
    /// Identifies a sensor from the runs to fit, with effects as text that compete, for positions of the reference that are `asked` for.
    ///
    /// # Errors
    /// Where nothing is left that can be inverted.
    pub(crate) fn identify(
        stated_gain: Option<f64>,
        period: f64,
        runs: &[SensorRun],
        competing: Competing<'_>,
        asked: &[f64],
    ) -> Result<Self, Refusal> {
        let sensor = Sensor::new(stated_gain, period, runs)?;
        if runs.iter().all(|r| r.commanded && r.channels().is_some()) {
            return commanded::identify(sensor, runs, asked);
        }
        let believed: Vec<SensorRun> = runs.iter().filter(|r| !r.commanded).cloned().collect();
        let runs = if believed.is_empty() { runs } else { &believed };
        let sensor = Sensor::new(stated_gain, period, runs)?;
        Self::chosen(sensor, runs, competing, asked)
    }

    /// Chooses and fits a model of a sensor whose gain is known.
    pub(super) fn chosen(
        sensor: Sensor,
        runs: &[SensorRun],
        competing: Competing<'_>,
        asked: &[f64],
    ) -> Result<Self, Refusal> {
        let rails = Rails::of(runs.iter().filter_map(SensorRun::channels).flatten());
        let starts = starts(runs, sensor.gain);
        let mut selection = Selection::new(&sensor, runs, rails, &starts, competing, asked);
        let selected = selection.select();
        let refusal = || {
            Refusal::no_answer(
                "campaign",
                "no model of the sensor can be identified from its rows",
                "more stations, or a longer recording",
            )
        };
        let rows: usize = runs.iter().map(SensorRun::len).sum();
        let stride = (rows / ENOUGH_ROWS).max(1);
        let thinned: Vec<SensorRun> = runs.iter().map(|r| r.thinned(stride)).collect();
        let models: Vec<Self> =
            selected.iter().filter_map(|s| Self::fitted(sensor, &selection, s, &thinned, rails, &starts)).collect();
        let of = |outcome| models.iter().find(|m| m.outcome == outcome);
        of(Outcome::Answered).or(of(Outcome::Doubted)).or(models.first()).cloned().ok_or_else(refusal)
    }

    /// Takes out of how the angle follows motion what is no further from nothing than its interval. What is left then may be the
    /// sensor as it is.
    pub(crate) fn without_motion_by_chance(&mut self, deviations: &mut Deviations) {
        let motion = self.table.shape.motion;
        let is_shown = |at: usize| self.table.side[at].abs() > STUDENT_19 * deviations.side[at];
        let shown: Vec<bool> = (0..motion.size()).map(is_shown).collect();
        match (motion, shown.as_slice()) {
            (Motion::RateAndAcceleration, [true, false]) => {
                self.table.side.remove(1);
                deviations.side.remove(1);
                self.table.shape.motion = Motion::Rate;
            }
            (Motion::RateAndAcceleration, [false, true]) => self.table.side[0] = 0.0,
            (_, shown) if !shown.is_empty() && !shown.contains(&true) => {
                self.table.side.drain(..motion.size());
                deviations.side.drain(..motion.size());
                self.table.shape.motion = Motion::None;
                if self.table.shape.size() == 0 && self.front().is_none_or(|front| front.kind == Kind::Plain) {
                    self.outcome = Outcome::Neutral;
                }
            }
            _ => {}
        }
    }

    fn fitted(
        sensor: Sensor,
        selection: &Selection<'_>,
        selected: &Selected,
        runs: &[SensorRun],
        rails: Rails,
        starts: &[Readout],
    ) -> Option<Self> {
        let (front, shape) = &selected.model;
        let with = |front: &Front| match front {
            (Kind::Plain, weighting, _) => Some((Readout { rails, ..Readout::plain() }, *weighting)),
            _ => Some((fit_from(starts, rails, front, runs, sensor.gain)?.readout, front.1)),
        };
        let mut readout = front.as_ref().map_or(Some(None), |f| with(f).map(Some))?;
        let mut samples = sensor.samples(runs, readout.as_ref().map(|r| &r.0));
        let raw_errors = by_run(&sensor.samples(runs, None), runs.len(), |s| s.error);
        let mut table = TableFit::new(shape, &samples, runs.len(), sensor.cycles)?;
        let mut predicted = selected.losses.rms();
        let left = by_run(&samples, runs.len(), |s| table.left(s));
        let unknowns = readout.as_ref().map_or(0, |r| r.0.free().len()) + shape.size();
        let raw_turns = selection.raw_turns();
        let mut stands = !raw_turns || autoregression::gain(&raw_errors, &left, unknowns) > 0.0;
        if !stands && let Some((shape, losses)) = selection.across_gaps(&selected.model) {
            // where rows are dense and the sensor rests, memory follows any error; this is predicted where no memory reaches
            table = TableFit::new(&shape, &samples, runs.len(), sensor.cycles)?;
            (predicted, stands) = (losses.rms(), true);
        }
        let readout_alone = selected.readout_alone.as_ref().filter(|(front, _)| front.0 != Kind::Plain);
        let outcome = if stands || readout_alone.is_some() { Outcome::Answered } else { Outcome::Doubted };
        if !stands && let Some((alone, losses)) = readout_alone {
            // what the memory of the noise explains as well is no table; a readout shows in the radius, too
            let (found, weighting) = with(alone)?;
            let raw = Readout { rails, ..Readout::plain() };
            let ln_radius =
                |readout: &Readout| -> Vec<_> { runs.iter().map(|r| circle::ln_radius(r, readout)).collect() };
            samples = sensor.samples(runs, Some(&found));
            let errors = by_run(&samples, runs.len(), |s| s.error);
            let of_angle = autoregression::gain(&raw_errors, &errors, found.free().len());
            stands = of_angle + autoregression::gain(&ln_radius(&raw), &ln_radius(&found), 0) > 0.0;
            table = TableFit::new(&Shape::constant(sensor.free_gain), &samples, runs.len(), sensor.cycles)?;
            (readout, predicted) = (Some((found, weighting)), losses.rms());
        }
        let predicted_raw = selected.raw.as_ref().map(Losses::rms);
        let follows = predicted < FOLLOWING * sensor.period / 12f64.sqrt();
        let helps =
            follows && predicted_raw.is_none_or(|raw| predicted < raw) && (stands || outcome == Outcome::Doubted);
        let model = Self {
            sensor,
            outcome,
            readout,
            table,
            predicted,
            predicted_raw,
            by_radius: false,
            tells_motion: selected.tells_motion,
        };
        Some(if helps { model } else { model.neutral(runs) })
    }

    /// The sensor as it is.
    fn neutral(self, runs: &[SensorRun]) -> Self {
        let shape = Shape::constant(self.sensor.free_gain);
        let samples = self.sensor.samples(runs, None);
        let table = TableFit::new(&shape, &samples, runs.len(), self.sensor.cycles).unwrap_or(self.table);
        let readout = self.readout.map(|(_, w)| (Readout::plain(), w));
        Self { outcome: Outcome::Neutral, readout, table, ..self }
    }

    /// How a lag came in: where positions are not met again at another rate, it describes what goes with either.
    pub(crate) fn origin_of_motion(&self) -> Origin {
        if self.tells_motion { Origin::Discovered } else { Origin::Empirical }
    }

    /// The readout alone.
    pub(crate) fn front(&self) -> Option<&Readout> {
        self.readout.as_ref().map(|r| &r.0)
    }

    /// The model where the angle of `asked` is asked for, without the lines of the reference's turn that stations at even distances do
    /// not tell from another there, each with that other.
    pub(crate) fn where_asked(&self, fitted: &[SensorRun], asked: &[SensorRun]) -> (Self, Vec<[u32; 2]>) {
        let (fitted, asked) = (positions(fitted), positions(asked));
        let mut there = self.clone();
        let mut others = Vec::new();
        for (at, &n) in self.table.shape.lines.iter().enumerate() {
            if let Some(other) = alias_elsewhere(n, &fitted, &asked) {
                there.table.without_line(at);
                others.push([n, other]);
            }
        }
        (there, others)
    }

    /// Error of a run with what was found undone, followed through its period, about its median.
    pub(crate) fn left(&self, run: &SensorRun) -> Vec<f64> {
        let samples = self.sensor.samples(std::slice::from_ref(run), self.front());
        samples.iter().map(|s| self.table.left(s)).collect()
    }
}

/// Where the reference stands in the rows of all runs, rad.
pub(crate) fn positions(runs: &[SensorRun]) -> Vec<f64> {
    runs.iter().flat_map(|r| r.reference_rad.iter().copied()).collect()
}
