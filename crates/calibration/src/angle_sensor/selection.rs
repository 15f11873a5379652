//! Which model of an angle sensor: readout, table, motion and lines, chosen by blocked cross-validation within the data to
//! fit. The held-out runs are not seen here.

use std::collections::BTreeMap;

use cvg_model::effects::EffectId;
use rayon::prelude::*;

use super::carried::{OBSERVATIONS_PER_UNKNOWN, carries, stations, stations_carry};
use super::circle;
use super::cross_validation::{
    Candidate, Folds, Losses, Tolerance, best_by_angle, choose, cross_validate, finer, losses_of_radius,
};
use super::gap::Gap;
use super::lines::{cover_a_turn, is_harmonic_of_table, strongest_and_its_aliases};
use super::rails::Rails;
use super::readout::{Competing, Kind, Readout, unknowns_of_texts};
use super::readout_fit::{ReadoutFit, Weighting, fit};
use super::samples::{Reading, SensorRun};
use super::sensor::Sensor;
use super::table_fit::{Motion, Sample, Shape, TableFit};
use crate::model::angle_table::Form;
use crate::numerics::statistics::median;

/// Lengths of the table that are offered: nested, so that the order of trial has no say.
pub(crate) const ORDERS: [usize; 14] = [0, 1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32];
/// Lengths with which readouts are compared, and with which the following of motion is settled.
const COARSE_ORDERS: [usize; 2] = [0, 4];
const MOTION_ORDERS: [usize; 2] = [4, 12];
/// Lengths offered anew beside an isolated line go up to this.
const ORDER_BESIDE_LINES: usize = 12;
/// … or so many, where what is predicted is off by less than this share of what the largest model within the former leaves: a deviation
/// card of ten headings tells two harmonics where they are most of what there is.
const FEWEST_PER_UNKNOWN: usize = 2;
const FAR_BETTER: f64 = 1.0 / 3.0;
/// … and across gaps by less than this share of the sensor as it is: half of what noise with a memory is, no table of it predicts.
const BETTER_ACROSS_GAPS: f64 = 0.5;
/// Rows beyond which selection looks at every so many only.
const ENOUGH_ROWS: usize = 1500;
/// Kinds of readout that are offered every length of the table.
const FINALISTS: usize = 3;
/// Isolated lines at most.
const MOST_LINES: usize = 6;
/// A rate whose standard deviation is below this share of its largest is constant, and lag with it.
pub(crate) const VARYING_RATE: f64 = 0.02;
/// Speeds that differ by less than this share are one: engineering choice.
const ONE_SPEED: f64 = 0.1;
/// Rows in a row whose rate is a difference over a turn: the one at which it turns back and those beside it.
const ROWS_OF_A_TURN: usize = 3;
/// Parts of a period in which a motion is compared, and the share of its variance, between passes through the same part, from which on
/// it is told from the position.
const DIRECTIONS_OF_MOTION: usize = 72;
const LEAST_OF_ITS_OWN: f64 = 1e-2;
/// … where this share of the rows at least stand where others do in another pass: a turn ends where it began.
const MET_AGAIN: f64 = 0.2;
/// Autocorrelation of an acceleration from one row to the next, from which on it goes on: engineering choice. White noise of the reference has
/// -0.5.
const GOES_ON: f64 = 0.5;

/// A readout as it is fitted: what the library has of it, how angle and radius count, and which effects as text are there.
pub(crate) type Front = (Kind, Weighting, Vec<EffectId>);
/// A model: a readout, where there are channels, and a table.
pub(crate) type Model = (Option<Front>, Shape);

/// What was chosen.
#[derive(Debug, Clone)]
pub(crate) struct Selected {
    pub(crate) model: Model,
    pub(crate) losses: Losses,
    /// the readout that is chosen where there is no table, and its losses
    pub(crate) readout_alone: Option<(Front, Losses)>,
    /// those of the sensor as it is
    pub(crate) raw: Option<Losses>,
    /// what goes with the rate is told from what goes with the position
    pub(crate) tells_motion: bool,
}

/// The data of a selection, with readouts fitted without each fold kept.
pub(crate) struct Selection<'a> {
    sensor: &'a Sensor,
    runs: Vec<SensorRun>,
    folds: Folds,
    rails: Rails,
    starts: Vec<Readout>,
    competing: Competing<'a>,
    /// directions of the sensor's period that rows stand in
    stations: usize,
    /// a part of the period has no row
    lacks_a_part: bool,
    accelerates_smoothly: bool,
    /// what each readout makes of the rows when it is fitted without each fold
    without: BTreeMap<Option<Front>, Option<WithoutFolds>>,
}

/// A readout that was fitted without each fold.
struct WithoutFolds {
    /// all rows, by fold; one entry for all where nothing is fitted
    samples: Vec<Vec<Sample>>,
    /// how well it predicts the radius; `None` where there are no channels
    of_radius: Option<Losses>,
}

impl<'a> Selection<'a> {
    pub(crate) fn new(
        sensor: &'a Sensor,
        fit_runs: &[SensorRun],
        rails: Rails,
        starts: &[Readout],
        competing: Competing<'a>,
        asked: &[f64],
    ) -> Self {
        let rows: usize = fit_runs.iter().map(SensorRun::len).sum();
        let stride = (rows / ENOUGH_ROWS).max(1);
        let runs: Vec<SensorRun> =
            fit_runs.iter().map(|r| if stride > 1 { r.thinned(stride) } else { r.clone() }).collect();
        let folds = Folds::of(&runs, asked, sensor.gain.abs() * sensor.cycles);
        let starts = starts.to_vec();
        let stations = stations(sensor, &runs);
        let angles = runs.iter().flat_map(|r| r.reference_rad.iter().copied());
        let lacks_a_part = !Gap::all(angles, sensor.gain.abs() * sensor.cycles).is_empty();
        Self {
            sensor,
            runs,
            folds,
            rails,
            starts,
            competing,
            stations,
            lacks_a_part,
            accelerates_smoothly: accelerate_smoothly(fit_runs),
            without: BTreeMap::new(),
        }
    }

    /// Chooses a model, and after it a simpler one where that is as good within a wider tolerance; none where there is not
    /// even one to compare.
    pub(crate) fn select(&mut self) -> Vec<Selected> {
        let mut pool = Vec::new();
        let plain = self.channels().then_some(PLAIN);
        let fronts = if self.channels() { self.readouts(&mut pool) } else { vec![None] };
        let Some(first) = fronts.first() else { return Vec::new() };
        let constant = Shape::constant(self.sensor.free_gain);
        // an angle that does not turn is nothing to be better than
        let raw = if self.raw_turns() { self.losses_of(&plain, &constant) } else { None };
        let motions = self.motions(first);
        pool.extend(self.offer(&fronts, &self.shapes(&ORDERS, &motions, &[])));
        self.without_barely_carried(&mut pool);
        let of_the_library: Vec<_> = pool.iter().filter(|c| c.texts == 0).cloned().collect();
        // an effect as text that is not chosen has no say in what is
        let best = |t: &Tolerance| choose(&pool, *t).filter(|c| c.texts > 0).or(choose(&of_the_library, *t)).cloned();
        let mut chosen: Vec<_> = self.folds.tolerances().iter().filter_map(best).collect();
        if let Some(only) = chosen.first().filter(|c| chosen.len() == 1 && c.texts == 0 && c.model.1 == constant) {
            let readouts: Vec<_> = of_the_library.iter().filter(|c| c.model.1 == constant).cloned().collect();
            chosen.splice(0..0, finer(&readouts, only));
        }
        chosen.dedup_by(|simpler, first| simpler.model == first.model);
        let readout_alone = |among: &[Candidate<Model>]| {
            let without_table: Vec<_> = among.iter().filter(|c| c.model.1 == constant).cloned().collect();
            choose(&without_table, Tolerance::One).and_then(|c| Some((c.model.0.clone()?, c.losses.clone())))
        };
        let tells_motion = self.is_told_from_position(|s| s.rate);
        let with_lines = |c: Candidate<Model>| {
            let readout_alone = readout_alone(if c.texts > 0 { &pool } else { &of_the_library });
            let short = short_beside(&c, &pool).map(|short| self.with_lines(short));
            let long = self.with_lines(c);
            let Candidate { model, losses, .. } =
                short.filter(|short| short.losses.rms() <= long.losses.rms()).unwrap_or(long);
            Selected { readout_alone, raw: raw.clone(), model, losses, tells_motion }
        };
        chosen.into_iter().map(with_lines).collect()
    }

    /// The table that predicts fifths of the way of each run, left out as a whole, far better than the sensor as it is does: the one that
    /// was chosen, or the best. No memory of noise reaches so far.
    pub(crate) fn across_gaps(&self, (front, chosen): &Model) -> Option<(Shape, Losses)> {
        let folds = Folds::of_the_way(&self.runs);
        let samples = |readout: Option<&Readout>| self.sensor.samples(&self.runs, readout);
        let without: Vec<Vec<Sample>> = (0..folds.count())
            .map(|fold| match front {
                None => Some(samples(None)),
                Some((Kind::Plain, ..)) => Some(samples(Some(&Readout::plain()))),
                Some(front) => Some(samples(Some(&self.fit_readout(front, &folds.without(&self.runs, fold))?.readout))),
            })
            .collect::<Option<_>>()?;
        let raw = samples(front.as_ref().map(|_| Readout::plain()).as_ref());
        let (runs, cycles, constant) = (self.runs.len(), self.sensor.cycles, Shape::constant(self.sensor.free_gain));
        let raw = cross_validate(|_| Some(raw.as_slice()), &folds, &constant, runs, cycles)?.rms();
        let of =
            |shape: &Shape| cross_validate(|fold| without.get(fold).map(Vec::as_slice), &folds, shape, runs, cycles);
        if let Some(losses) = of(chosen).filter(|losses| losses.rms() < FAR_BETTER * raw) {
            return Some((chosen.clone(), losses));
        }
        let shapes = self.shapes(&ORDERS, &[chosen.motion], &[]);
        let carried = shapes.into_iter().filter(|shape| self.rows_carry(front, shape, OBSERVATIONS_PER_UNKNOWN));
        let all: Vec<_> = carried.filter_map(|shape| Some((of(&shape)?, shape))).collect();
        let best = all.into_iter().min_by(|a, b| a.0.rms().total_cmp(&b.0.rms()).then_with(|| a.1.cmp(&b.1)));
        best.filter(|(losses, shape)| shape.order > 0 && losses.rms() < BETTER_ACROSS_GAPS * raw)
            .map(|(losses, shape)| (shape, losses))
    }

    /// A model with the isolated lines that it leaves.
    fn with_lines(&mut self, mut chosen: Candidate<Model>) -> Candidate<Model> {
        for _ in 0..MOST_LINES {
            let Some(better) = self.with_a_line(&chosen) else { break };
            chosen = better;
        }
        self.with_its_next_harmonics(chosen)
    }

    pub(super) fn cycles_per_turn(&self) -> f64 {
        self.sensor.cycles_per_turn()
    }

    fn losses_of(&mut self, front: &Option<Front>, shape: &Shape) -> Option<Losses> {
        self.offer(std::slice::from_ref(front), std::slice::from_ref(shape)).pop().map(|c| c.losses)
    }

    fn channels(&self) -> bool {
        self.runs.iter().all(|r| matches!(r.reading, Reading::Channels(_)))
    }

    /// Every readout with every weighting, without a table and beside one; the best few kinds remain, each with the weighting that
    /// predicts the angle best, and one that leaves far less of the radius. Those with effects as text are chosen
    /// among themselves, so that they take no other's place.
    fn readouts(&mut self, pool: &mut Vec<Candidate<Model>>) -> Vec<Option<Front>> {
        let coarse = self.shapes(&COARSE_ORDERS, &[Motion::None], &[]);
        let mut fronts = if self.raw_turns() { vec![Some(PLAIN)] } else { Vec::new() };
        if !self.starts.is_empty() {
            fronts.extend(self.fitted_fronts().into_iter().map(Some));
        }
        let first = self.offer(&fronts, &coarse);
        type Sort = Option<(Kind, Vec<EffectId>)>;
        let mut kinds: BTreeMap<Sort, Vec<Candidate<Model>>> = BTreeMap::new();
        for c in &first {
            let key = c.model.0.as_ref().map(|(kind, _, texts)| (*kind, texts.clone()));
            kinds.entry(key).or_default().push(c.clone());
        }
        let least = |c: &[Candidate<Model>]| {
            let by_angle = |a: &&Candidate<Model>, b: &&Candidate<Model>| {
                a.losses.rms().total_cmp(&b.losses.rms()).then_with(|| a.model.cmp(&b.model))
            };
            c.iter().min_by(by_angle).map(|c| (c.losses.rms(), c.model.0.clone()))
        };
        let mut ranked: Vec<_> =
            kinds.into_values().filter_map(|c| Some((least(&c)?, best_by_angle(&c)?.model.0.clone()))).collect();
        ranked.sort_by(|((a, a_front), _), ((b, b_front), _)| a.total_cmp(b).then_with(|| a_front.cmp(b_front)));
        let (plain, texts): (Vec<_>, Vec<_>) =
            ranked.into_iter().partition(|((_, front), _)| texts_of(front).is_empty());
        let finalists = plain.into_iter().take(FINALISTS).chain(texts.into_iter().take(FINALISTS));
        let mut finalists: Vec<_> = finalists.flat_map(|((_, front), chosen)| [front, chosen]).collect();
        finalists.dedup();
        pool.extend(first.into_iter().filter(|c| !finalists.contains(&c.model.0)));
        finalists
    }

    /// The raw angle may turn: the origin may lie within what the channels draw. Beside a free gain one that does not ends at a gain of
    /// nothing, and its error goes up with the reference, more smoothly than any noise.
    pub(super) fn raw_turns(&self) -> bool {
        self.starts.is_empty() || self.starts.iter().any(Readout::is_about_the_origin)
    }

    /// Readouts with something to fit, that what they are weighted by tells. Effects as text stand beside gain and skew at
    /// least, each by itself and all together.
    fn fitted_fronts(&self) -> Vec<Front> {
        let Competing { largest, texts } = self.competing;
        let kinds = Kind::FITTED.iter().filter(|k| **k <= largest).flat_map(|k| Weighting::ALL.map(|w| (*k, w)));
        let told: Vec<_> = kinds.filter(|(kind, weighting)| kind.is_told_by(*weighting)).collect();
        // the radius alone does not tell what turns the vibration
        let beside_texts = |(kind, weighting): &&(Kind, Weighting)| {
            matches!(kind, Kind::Affine | Kind::Cubic) && *weighting != Weighting::Radius
        };
        let mut sets: Vec<Vec<EffectId>> = texts.iter().map(|t| vec![*t]).collect();
        if texts.len() > 1 {
            sets.push(texts.to_vec());
        }
        let with = |texts: Vec<EffectId>| {
            let told: Vec<_> = told.iter().filter(beside_texts).copied().collect();
            told.into_iter().map(move |(kind, weighting)| (kind, weighting, texts.clone()))
        };
        let without = told.iter().map(|(kind, weighting)| (*kind, *weighting, Vec::new()));
        without.chain(sets.into_iter().flat_map(with)).collect()
    }

    /// How the angle follows motion is settled once.
    fn motions(&mut self, front: &Option<Front>) -> Vec<Motion> {
        let rates: Vec<f64> = self.runs.iter().flat_map(|r| r.rate_rad_s.iter().copied()).collect();
        let fastest = rates.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
        let mean = rates.iter().sum::<f64>() / rates.len() as f64;
        let deviation = (rates.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / rates.len() as f64).sqrt();
        if deviation <= VARYING_RATE * fastest {
            return vec![Motion::None];
        }
        let mut all = vec![Motion::None];
        // one way only, a constant that changes sign with the direction is a constant
        let both =
            rates.iter().any(|r| *r > VARYING_RATE * fastest) && rates.iter().any(|r| *r < -VARYING_RATE * fastest);
        if both {
            all.push(Motion::Direction);
        }
        // at one speed a lag is a constant that changes sign with the direction, and rows at which it turns back do not tell the two
        if both && self.turns_at_one_speed(&rates) {
            return self.motion_among(front, &all);
        }
        if !self.is_told_from_position(|s| s.rate) {
            return self.motion_beyond_position(front, &all);
        }
        all.push(Motion::Rate);
        if self.is_told_from_position(|s| s.acceleration) && self.accelerates_smoothly {
            all.push(Motion::RateAndAcceleration);
        }
        self.motion_among(front, &all)
    }

    /// A rate that is a function of the position, as in one pass: what a table of any length explains as well is the table's.
    fn motion_beyond_position(&mut self, front: &Option<Front>, others: &[Motion]) -> Vec<Motion> {
        let mut best = |motions: &[Motion]| {
            let all = self.offer(std::slice::from_ref(front), &self.shapes(&ORDERS, motions, &[]));
            best_by_angle(&all).map(|c| c.losses.clone())
        };
        match (best(others), best(&[Motion::Rate])) {
            (Some(without), Some(with)) if with.is_better_than(&without) => vec![Motion::None, Motion::Rate],
            _ => self.motion_among(front, others),
        }
    }

    /// Whether the speed is one but for the rows at which it turns back, whose rates are differences over the turn.
    fn turns_at_one_speed(&self, rates: &[f64]) -> bool {
        let usual = median(&mut rates.iter().map(|r| r.abs()).collect::<Vec<_>>());
        let is_another = |rate: &f64| (rate.abs() / usual - 1.0).abs() > ONE_SPEED;
        rates
            .chunk_by(|a, b| is_another(a) == is_another(b))
            .all(|part| part.len() <= ROWS_OF_A_TURN || !is_another(&part[0]))
    }

    fn motion_among(&mut self, front: &Option<Front>, all: &[Motion]) -> Vec<Motion> {
        if all.len() == 1 {
            return all.to_vec();
        }
        let trial = self.offer(std::slice::from_ref(front), &self.shapes(&MOTION_ORDERS, all, &[]));
        match choose(&trial, Tolerance::One).map(|c| c.model.1.motion) {
            None | Some(Motion::None) => vec![Motion::None],
            Some(motion) => vec![Motion::None, motion],
        }
    }

    /// Whether a motion is more than a function of the position: where a position is met again, it is another. In one pass, and in a
    /// harmonic swing within a turn, it is not, and what follows it a table explains as well.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below DIRECTIONS_OF_MOTION")]
    fn is_told_from_position(&self, motion: impl Fn(&Sample) -> f64) -> bool {
        let samples = self.sensor.samples(&self.runs, None);
        let place = |s: &Sample| {
            let periods = self.sensor.cycles * self.sensor.gain * s.reference / std::f64::consts::TAU;
            (periods.rem_euclid(1.0) * DIRECTIONS_OF_MOTION as f64) as usize % DIRECTIONS_OF_MOTION
        };
        // of every pass through a part of the period how many rows it has, and the sum of their motion
        let mut passes: Vec<Vec<[f64; 2]>> = vec![Vec::new(); DIRECTIONS_OF_MOTION];
        for pass in samples.chunk_by(|a, b| a.run == b.run && place(a) == place(b)) {
            passes[place(&pass[0])].push([pass.len() as f64, pass.iter().map(&motion).sum()]);
        }
        let about_mean = |passes: &[[f64; 2]]| {
            let [rows, sum] = passes.iter().fold([0.0; 2], |[n, s], [rows, sum]| [n + rows, s + sum]);
            passes.iter().map(|[n, s]| n * (s / n - sum / rows).powi(2)).sum::<f64>()
        };
        let rows: Vec<[f64; 2]> = samples.iter().map(|s| [1.0, motion(s)]).collect();
        let again = passes.iter().filter(|passes| passes.len() > 1).flatten().map(|[rows, _]| rows).sum::<f64>();
        again > MET_AGAIN * rows.len() as f64
            && passes.iter().map(|passes| about_mean(passes)).sum::<f64>() > LEAST_OF_ITS_OWN * about_mean(&rows)
    }

    pub(super) fn shapes(&self, orders: &[usize], motions: &[Motion], lines: &[u32]) -> Vec<Shape> {
        let mut out = Vec::new();
        for &order in orders {
            for form in [Form::Own, Form::Forward].into_iter().take(if order == 0 { 1 } else { 2 }) {
                for &motion in motions {
                    out.push(Shape { form, order, motion, lines: lines.to_vec(), free_gain: self.sensor.free_gain });
                }
            }
        }
        out
    }

    /// Cross-validates every readout with every shape that the rows can carry.
    pub(super) fn offer(&mut self, fronts: &[Option<Front>], shapes: &[Shape]) -> Vec<Candidate<Model>> {
        let missing: Vec<_> = fronts.iter().filter(|f| !self.without.contains_key(f)).cloned().collect();
        let fitted: Vec<_> = missing.into_par_iter().map(|f| (f.clone(), self.fit_without_each_fold(&f))).collect();
        self.without.extend(fitted);
        let pairs: Vec<(&Option<Front>, &Shape)> =
            fronts.iter().flat_map(|f| shapes.iter().map(move |s| (f, s))).collect();
        pairs
            .into_par_iter()
            .filter_map(|(front, shape)| {
                let of_texts = unknowns_of_texts(texts_of(front));
                let size = of_readout(front) + shape.size();
                let on_stations = self.is_held(front) || stations_carry(self.stations, shape.order);
                if !on_stations || !self.rows_carry(front, shape, FEWEST_PER_UNKNOWN) {
                    return None;
                }
                let WithoutFolds { samples, of_radius } = self.without.get(front)?.as_ref()?;
                // without a readout to fit all folds have the same samples
                let without = |fold: usize| samples.get(fold.min(samples.len() - 1)).map(Vec::as_slice);
                let losses = cross_validate(without, &self.folds, shape, self.runs.len(), self.sensor.cycles)?;
                let (model, texts) = ((front.clone(), shape.clone()), of_texts);
                Some(Candidate { size, texts, model, losses, of_radius: of_radius.clone() })
            })
            .collect()
    }

    /// The coefficients of an angle's table are held to what they usually are, as where a part of the period has no row: then rows need
    /// not carry each of them.
    fn is_held(&self, front: &Option<Front>) -> bool {
        self.lacks_a_part && front.is_none()
    }

    fn rows_carry(&self, front: &Option<Front>, shape: &Shape, per_unknown: usize) -> bool {
        let rows: usize = self.runs.iter().map(SensorRun::len).sum();
        let constant = Shape::constant(self.sensor.free_gain).size();
        if self.is_held(front) {
            return shape.size() + self.runs.len() <= rows;
        }
        carries(rows, of_readout(front), shape.size() - constant, self.runs.len() + constant, per_unknown)
    }

    /// Without the models that more than a third of the rows go into, unless they are far better than all others.
    fn without_barely_carried(&self, pool: &mut Vec<Candidate<Model>>) {
        let is_carried = |c: &Candidate<Model>| self.rows_carry(&c.model.0, &c.model.1, OBSERVATIONS_PER_UNKNOWN);
        let least = pool.iter().filter(|c| is_carried(c)).map(|c| c.losses.rms()).fold(f64::INFINITY, f64::min);
        pool.retain(|c| is_carried(c) || c.losses.rms() < FAR_BETTER * least);
    }

    fn fit_without_each_fold(&self, front: &Option<Front>) -> Option<WithoutFolds> {
        let Some(front) = front else {
            return Some(WithoutFolds { samples: vec![self.sensor.samples(&self.runs, None)], of_radius: None });
        };
        let (kind, weighting, _) = *front;
        let whole = match kind {
            Kind::Plain => Readout { rails: self.rails, ..Readout::plain() },
            _ => self.fit_readout(front, &self.runs)?.readout,
        };
        if !circle::shows(&whole, &self.runs) {
            return None;
        }
        let readouts: Vec<Readout> = (0..self.folds.count())
            .map(|fold| {
                let kept = self.folds.without(&self.runs, fold);
                fit(kind, weighting, &kept, self.sensor.gain, &whole).map(|f| f.readout)
            })
            .collect::<Option<_>>()?;
        let samples = match kind {
            Kind::Plain => vec![self.sensor.samples(&self.runs, Some(&Readout::plain()))],
            _ => readouts.iter().map(|r| self.sensor.samples(&self.runs, Some(r))).collect(),
        };
        let of_radius = losses_of_radius(|fold| readouts.get(fold).cloned(), &self.folds, &self.runs);
        Some(WithoutFolds { samples, of_radius })
    }

    fn fit_readout(&self, front: &Front, runs: &[SensorRun]) -> Option<ReadoutFit> {
        fit_from(&self.starts, self.rails, front, runs, self.sensor.gain)
    }

    /// The best model with one isolated line more, if it is better by more than a standard error, also than with a line that
    /// looks like it on these stations.
    fn with_a_line(&mut self, chosen: &Candidate<Model>) -> Option<Candidate<Model>> {
        let (front, shape) = &chosen.model;
        let readout = front.as_ref().and_then(|front| self.fit_readout(front, &self.runs));
        let samples = self.sensor.samples(&self.runs, readout.as_ref().map(|f| &f.readout));
        let table = TableFit::new(shape, &samples, self.runs.len(), self.sensor.cycles)?;
        let mut orders: Vec<usize> =
            ORDERS.into_iter().filter(|n| *n <= shape.order.max(ORDER_BESIDE_LINES)).chain([shape.order]).collect();
        orders.sort_unstable();
        orders.dedup();
        let cycles = self.cycles_per_turn();
        let lines = strongest_and_its_aliases(&samples, &table, cycles);
        let mut with: Vec<Candidate<Model>> = lines
            .into_iter()
            .filter_map(|line| {
                let lines: Vec<u32> = shape.lines.iter().copied().chain([line]).collect();
                // a table that holds the line as one of its own harmonics does not tell the two
                let beside = |order: &usize| *order == shape.order || !is_harmonic_of_table(line, *order, cycles);
                let orders: Vec<usize> = orders.iter().copied().filter(beside).collect();
                let all = self.offer(std::slice::from_ref(front), &self.shapes(&orders, &[shape.motion], &lines));
                choose(&all, Tolerance::One).cloned()
            })
            .collect();
        with.sort_by(|a, b| a.losses.rms().total_cmp(&b.losses.rms()));
        let (best, aliases) = with.split_first()?;
        let distinct = |c: &Candidate<Model>| best.losses.is_distinct_from(&c.losses);
        // over a part of a turn a line stands in for a harmonic more of the table
        let helps = if cover_a_turn(&samples) && !self.lacks_a_part {
            Losses::is_better_than
        } else {
            Losses::is_distinct_from
        };
        (helps(&best.losses, &chosen.losses) && aliases.iter().all(distinct)).then(|| best.clone())
    }
}

/// Whether an acceleration goes on from row to row: between stations, each held as long as it is, it does not.
fn accelerate_smoothly(runs: &[SensorRun]) -> bool {
    let pairs = runs.iter().flat_map(|r| r.acceleration_rad_s2.windows(2));
    let (product, square) =
        pairs.fold((0.0, 0.0), |(product, square), a| (product + a[0] * a[1], square + a[0] * a[0]));
    product > GOES_ON * square
}

/// The short table beside which the lines are looked for as well, where a long one was chosen: on stations that are left out
/// in a pattern the overtones of a long table stand in for a line, and elsewhere for nothing.
fn short_beside(chosen: &Candidate<Model>, pool: &[Candidate<Model>]) -> Option<Candidate<Model>> {
    let (front, shape) = &chosen.model;
    let is_short = |c: &&Candidate<Model>| {
        let (other, short) = &c.model;
        other == front && short.motion == shape.motion && short.order <= ORDER_BESIDE_LINES
    };
    let short: Vec<_> = pool.iter().filter(is_short).cloned().collect();
    (shape.order > ORDER_BESIDE_LINES).then(|| choose(&short, Tolerance::Half).cloned()).flatten()
}

/// The channels as they are.
const PLAIN: Front = (Kind::Plain, Weighting::Equal, Vec::new());

/// Unknowns of a readout.
fn of_readout(front: &Option<Front>) -> usize {
    front.as_ref().map_or(0, |(kind, _, texts)| kind.free().len() + unknowns_of_texts(texts))
}

/// The effects as text of a readout.
fn texts_of(front: &Option<Front>) -> &[EffectId] {
    front.as_ref().map_or(&[], |(_, _, texts)| texts)
}

/// The best of the fits from every start.
pub(crate) fn fit_from(
    starts: &[Readout],
    rails: Rails,
    (kind, weighting, texts): &Front,
    runs: &[SensorRun],
    gain: f64,
) -> Option<ReadoutFit> {
    let onsets = texts.iter().map(|t| t.description().onsets.len()).max().unwrap_or(0).max(1);
    let begun = starts.iter().flat_map(|s| (0..onsets).map(move |onset| s.with_texts(texts, onset)));
    let fits = begun.filter_map(|s| fit(*kind, *weighting, runs, gain, &Readout { rails, ..s }));
    fits.min_by(|a, b| a.cost.total_cmp(&b.cost))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::statistics::remembered;

    /// One turn in four moves between rests, in even rows of an angle that is off by these degrees.
    fn moved_between_rests(error_deg: impl Fn(usize, f64) -> f64) -> SensorRun {
        let place = |i: usize| 1.55 * ((i / 200) as f64 + (i % 200).saturating_sub(140) as f64 / 60.0);
        let reference_rad: Vec<f64> = (0..800).map(place).collect();
        let theta = reference_rad.iter().enumerate().map(|(i, a)| a + error_deg(i, *a).to_radians());
        SensorRun {
            name: "moved.csv".into(),
            number: 0,
            role: crate::recording::Role::Fit,
            commanded: false,
            t_s: (0..800).map(f64::from).collect(),
            rate_rad_s: vec![0.02; 800],
            acceleration_rad_s2: vec![0.0; 800],
            temp_c: None,
            recorded: None,
            reading: Reading::Angle(theta.collect()),
            reference_rad,
        }
    }

    #[test]
    fn a_smooth_error_is_predicted_across_gaps_and_a_walk_is_not() {
        let across = |run: SensorRun| {
            let runs = [run];
            let sensor = Sensor { gain: 1.0, free_gain: false, period: std::f64::consts::TAU, cycles: 1.0 };
            let selection = Selection::new(&sensor, &runs, Rails::none(), &[], Competing::with(&[]), &[]);
            let long = Shape { form: Form::Own, order: 16, ..Shape::constant(false) };
            selection.across_gaps(&(None, long)).map(|(shape, _)| shape.order)
        };
        let smooth = |_, a: f64| 9.0 * a.sin() + 5.0 * (2.0 * a).cos();
        assert!(across(moved_between_rests(smooth)).is_some_and(|order| order >= 2));
        for seed in 0..8 {
            let walk: Vec<f64> = remembered(0.0, 800, 1 + 7919 * seed)
                .into_iter()
                .scan(0.0, |sum, u| {
                    *sum += 0.3 * u;
                    Some(*sum)
                })
                .collect();
            assert_eq!(across(moved_between_rests(|i, _| walk[i])), None, "seed {seed}");
        }
    }
}
