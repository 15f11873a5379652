//! Blocked cross-validation within the data to fit: what predicts rows that it has not seen. Blocks are contiguous, so
//! that neighbours of a row do not betray it (Burman, Chow and Nolan 1994; Roberts et al. 2017), and the simplest model
//! within a standard error of the best, or half of one, is taken, the errors paired over blocks (Breiman et al. 1984).

use super::gap::{Gap, place};
use super::readout::Readout;
use super::samples::SensorRun;
use super::table_fit::{Sample, Shape, TableFit};
use crate::numerics::statistics::median;

/// Folds of blocks; blocks of all rows of a run where they are interleaved, and of a run that repeats its period.
const FOLDS: usize = 5;
const INTERLEAVED_BLOCKS: usize = 60;
const CONTIGUOUS_BLOCKS: usize = 20;
/// Periods that each run has to cover for whole runs to be left out, and one run for contiguous fifths.
const PERIODS_OF_RUNS: f64 = 0.9;
const PERIODS_OF_ONE: f64 = 1.75;
/// The part of the period without a row of which it matters that something is asked for there is no wider than this share of it: a sensor
/// that turns through half a turn only is not asked for the other half. Engineering choice.
const WIDEST_GAP: f64 = 0.4;
/// The share of what is asked for that lies in such a part, and how far from its edges, as a share of the period. Engineering choices.
const ASKED: f64 = 0.1;
const EDGE: f64 = 0.02;
/// What is asked for stands between stations where it is further from them than this share of the period, and nearer than that: rows of a
/// sensor that turns are nearer to one another, and beyond is a part without rows. It is much further from what is fitted than what is
/// left out is from this factor on. Engineering choices.
const LEAST_DISTANCE: f64 = 1.0 / 2048.0;
const LARGEST_DISTANCE: f64 = 0.25 * Gap::LEAST;
const MUCH_FURTHER: f64 = 2.0;
/// Numbers of sectors that are tried, and by which factor what is left out may be further from the rest than what is asked for: a few dozen
/// stations of which every other is asked for cannot be left out so near, and without one of them a table is another. Of many stations,
/// nearer to one another than twice this share of the period, sectors are four times as wide as what is asked for is far: two of them at
/// least, for what the last bit makes of one may go on at the next. Engineering choices.
const SECTORS: [usize; 8] = [8, 12, 20, 32, 50, 80, 128, 200];
const ABOUT_AS_FAR: f64 = 1.5;
const OF_MANY_STATIONS: f64 = 1.0 / 256.0;
const FEWEST_SECTORS: f64 = 20.0;
const MOST_SECTORS: f64 = 512.0;
/// Whole runs are left out from this many on.
const FEWEST_RUNS: usize = 3;
/// Standard errors that one more line has to gain.
const BETTER: f64 = 1.0;
/// Standard errors by which a line has to be better than one that looks like it on these stations: a wrong one adds its own
/// error to stations that were not seen, where none leaves the line's only (2.3 % by chance).
const NO_ALIAS: f64 = 2.0;

/// A mean square of the angle that is larger by no more than this factor is larger by a hair, 2.5 % of the rms; one of the radius
/// below this share, 55 % of the rms, is far smaller: engineering choices.
const A_HAIR: f64 = 1.05;
const FAR_ROUNDER: f64 = 0.3;

/// Standard errors that a simpler model may be worse by than the best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Tolerance {
    /// half of the usual one, an engineering choice for interleaved blocks: those of a few dozen stations are single rows,
    /// their standard error is wide, and a whole one leaves more error than is needed; and for readouts without a table
    Half,
    /// one (Breiman et al. 1984)
    One,
}

impl Tolerance {
    fn standard_errors(self) -> f64 {
        match self {
            Self::Half => 0.5,
            Self::One => 1.0,
        }
    }
}

/// Rows that are left out together.
#[derive(Debug, Clone)]
struct Fold {
    /// of all rows, all runs one after the other: the block that a row is judged in, where it is left out
    block: Vec<Option<usize>>,
    /// how much a row counts
    weight: f64,
    /// what is left out is judged about its own mean, as a held-out run is
    about_mean: bool,
}

/// What is left out in turn.
#[derive(Debug, Clone)]
pub(crate) struct Folds {
    left_out: Vec<Fold>,
    /// blocks in all
    blocks: usize,
}

impl Folds {
    /// Whole runs where three or more cover the period; fifths in time where one run repeats it; else interleaved blocks, and, where a
    /// part of the period has no row and the model is asked for the angle there, at a reference of `asked`, fifths of the way: each counts
    /// as much as is asked for where rows are, and where they are not. Where stations leave it much nearer to what is fitted than what is
    /// asked for is, whole stations are left out in the place of all these.
    pub(crate) fn of(runs: &[SensorRun], asked: &[f64], cycles_per_rad: f64) -> Self {
        let far = share_asked_in_the_gap(runs, asked, cycles_per_rad);
        let in_time = Self::in_time(runs, cycles_per_rad);
        let usual = in_time.unwrap_or_else(|| {
            let of_the_way = || Self::of_the_way(runs).about_means();
            match far {
                0.0 => Self::interleaved(runs),
                1.0 => of_the_way(),
                far => Self::interleaved(runs).weighing(1.0 - far).and(of_the_way().weighing(far)),
            }
        });
        let sectors = if far > 0.0 { None } else { usual.sectors_as_far(runs, asked, cycles_per_rad) };
        sectors.unwrap_or(usual)
    }

    /// Whole runs, or fifths in time of one.
    fn in_time(runs: &[SensorRun], cycles_per_rad: f64) -> Option<Self> {
        let periods = runs.iter().map(|r| r.travel_rad() * cycles_per_rad / std::f64::consts::TAU);
        let least = periods.fold(f64::INFINITY, f64::min);
        if runs.len() >= FEWEST_RUNS && least > PERIODS_OF_RUNS {
            return Some(Self::leaving(runs, true, |number, _, _| (number, 0), |_| 1));
        }
        let part = |i: usize, parts: usize, rows: usize| i * parts / rows;
        (runs.len() == 1 && least > PERIODS_OF_ONE).then(|| {
            Self::leaving(
                runs,
                true,
                |_, i, rows| (part(i, FOLDS, rows), part(i, CONTIGUOUS_BLOCKS, rows)),
                |_| CONTIGUOUS_BLOCKS,
            )
        })
    }

    /// Sectors of the period, of each of which all rows are left out, whatever pass they are of: so many that what is left out is about as
    /// far from what is fitted as what is asked for. `None` where these folds see to that, where no sectors do, and of a sensor that turns,
    /// whose rows stand everywhere.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    fn sectors_as_far(&self, runs: &[SensorRun], asked: &[f64], cycles_per_rad: f64) -> Option<Self> {
        let places: Vec<f64> = runs.iter().flat_map(|r| &r.reference_rad).map(|a| place(*a, cycles_per_rad)).collect();
        let asked: Vec<f64> = asked.iter().map(|a| place(*a, cycles_per_rad)).collect();
        let far = median(&mut distances(&asked, &places));
        if !(LEAST_DISTANCE..LARGEST_DISTANCE).contains(&far) || far <= MUCH_FURTHER * self.left_out_from_kept(&places)
        {
            return None;
        }
        if far < OF_MANY_STATIONS {
            return Some(Self::of_sectors(
                runs,
                (0.25 / far).clamp(FEWEST_SECTORS, MOST_SECTORS) as usize,
                cycles_per_rad,
            ));
        }
        let of = |count: usize| {
            let folds = Self::of_sectors(runs, count, cycles_per_rad);
            (folds.left_out_from_kept(&places) / far, folds)
        };
        let off = |(ratio, _): &(f64, Self)| ratio.ln().abs();
        let nearest = SECTORS.into_iter().map(of).min_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.filter(|(ratio, _)| *ratio < ABOUT_AS_FAR).map(|(_, folds)| folds)
    }

    /// How far what is left out is from what is kept, of rows at these places, in the median.
    fn left_out_from_kept(&self, places: &[f64]) -> f64 {
        let of_fold = |fold: usize| {
            let (out, kept): (Vec<_>, Vec<_>) = (0..places.len()).partition(|row| self.leaves_out(fold, *row));
            let [out, kept] = [out, kept].map(|rows| rows.iter().map(|row| places[*row]).collect::<Vec<f64>>());
            distances(&out, &kept)
        };
        median(&mut (0..self.count()).flat_map(of_fold).collect::<Vec<f64>>())
    }

    /// Every fifth of so many sectors of the period.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the number of sectors")]
    fn of_sectors(runs: &[SensorRun], count: usize, cycles_per_rad: f64) -> Self {
        // stations stand in the middle of a sector as a rule, and not on the edge of two
        let sector = |angle: f64| (place(angle, cycles_per_rad) * count as f64 + 0.5) as usize % count;
        Self::leaving(
            runs,
            false,
            |number, i, _| {
                let sector = sector(runs[number].reference_rad[i]);
                (sector % FOLDS, sector)
            },
            |_| count,
        )
    }

    /// Interleaved blocks of every run.
    pub(crate) fn interleaved(runs: &[SensorRun]) -> Self {
        let width = |rows: usize| (rows / INTERLEAVED_BLOCKS).max(1);
        Self::leaving(
            runs,
            false,
            |_, i, rows| (i / width(rows) % FOLDS, i / width(rows)),
            |rows| rows.div_ceil(width(rows)),
        )
    }

    /// Fifths of the way that every run turns: rests, however long, are places.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below CONTIGUOUS_BLOCKS")]
    pub(crate) fn of_the_way(runs: &[SensorRun]) -> Self {
        let gone: Vec<Vec<f64>> = runs
            .iter()
            .map(|run| {
                let way = run.path_rad().max(f64::MIN_POSITIVE);
                let steps = run.reference_rad.windows(2).map(|w| (w[1] - w[0]).abs());
                std::iter::once(0.0)
                    .chain(steps)
                    .scan(0.0, |gone, step| {
                        *gone += step;
                        Some(*gone / way)
                    })
                    .collect()
            })
            .collect();
        let part = |share: f64| ((CONTIGUOUS_BLOCKS as f64 * share) as usize).min(CONTIGUOUS_BLOCKS - 1);
        Self::leaving(
            runs,
            false,
            |number, i, _| (part(gone[number][i]) * FOLDS / CONTIGUOUS_BLOCKS, part(gone[number][i])),
            |_| CONTIGUOUS_BLOCKS,
        )
    }

    /// Folds of which each row belongs to one: `place` says to which, and to which block of its run's, by the run's number, the row's and
    /// how many rows it has; `blocks` how many blocks a run of so many rows has.
    fn leaving(
        runs: &[SensorRun],
        about_mean: bool,
        place: impl Fn(usize, usize, usize) -> (usize, usize),
        blocks: impl Fn(usize) -> usize,
    ) -> Self {
        let mut first = 0;
        let mut places = Vec::new();
        for (number, run) in runs.iter().enumerate() {
            let of_row = |i| {
                let (fold, block) = place(number, i, run.len());
                (fold, first + block)
            };
            places.extend((0..run.len()).map(of_row));
            first += blocks(run.len());
        }
        let count = places.iter().map(|(fold, _)| fold + 1).max().unwrap_or(0);
        let fold = |number| Fold {
            block: places.iter().map(|(fold, block)| (*fold == number).then_some(*block)).collect(),
            weight: 1.0,
            about_mean,
        };
        Self { left_out: (0..count).map(fold).collect(), blocks: first }
    }

    fn about_means(mut self) -> Self {
        self.left_out.iter_mut().for_each(|fold| fold.about_mean = true);
        self
    }

    fn weighing(mut self, weight: f64) -> Self {
        self.left_out.iter_mut().for_each(|fold| fold.weight *= weight);
        self
    }

    fn and(mut self, mut other: Self) -> Self {
        other.left_out.iter_mut().flat_map(|fold| &mut fold.block).flatten().for_each(|block| *block += self.blocks);
        self.left_out.extend(other.left_out);
        self.blocks += other.blocks;
        self
    }

    /// How often something is left out.
    pub(crate) fn count(&self) -> usize {
        self.left_out.len()
    }

    /// Whether a row, counted over all runs, is left out with a fold.
    pub(crate) fn leaves_out(&self, fold: usize, row: usize) -> bool {
        self.left_out[fold].block[row].is_some()
    }

    /// What a simpler model may be worse by: less where blocks are interleaved, and then as much as elsewhere if what is
    /// chosen so does not stand.
    pub(crate) fn tolerances(&self) -> &'static [Tolerance] {
        if self.left_out.iter().all(|fold| fold.about_mean) {
            &[Tolerance::One]
        } else {
            &[Tolerance::Half, Tolerance::One]
        }
    }

    /// The runs without the rows of a fold.
    pub(crate) fn without(&self, runs: &[SensorRun], fold: usize) -> Vec<SensorRun> {
        let mut first = 0;
        runs.iter()
            .map(|r| {
                let rows: Vec<usize> = (0..r.len()).filter(|i| !self.leaves_out(fold, first + i)).collect();
                first += r.len();
                r.subset(&rows)
            })
            .collect()
    }
}

/// The share of what is asked for that lies in the one part of the period without a row, as where the last quarter of a turn is held
/// out; 0 where there is no such part or next to nothing is asked for there.
fn share_asked_in_the_gap(runs: &[SensorRun], asked: &[f64], cycles_per_rad: f64) -> f64 {
    let angles = runs.iter().flat_map(|r| r.reference_rad.iter().copied());
    let gaps = Gap::all(angles, cycles_per_rad);
    // where there are two, rows stand on either side of each
    let [gap] = gaps.as_slice() else { return 0.0 };
    if gap.width >= WIDEST_GAP {
        return 0.0;
    }
    // rows that are held out among those that are fitted stand at its very edge at most
    let within = asked.iter().filter(|a| gap.holds(**a, cycles_per_rad, EDGE)).count();
    let share = within as f64 / asked.len().max(1) as f64;
    if share >= ASKED { share } else { 0.0 }
}

/// How far each of these places in the period is from the nearest of others.
fn distances(these: &[f64], others: &[f64]) -> Vec<f64> {
    let mut others = others.to_vec();
    others.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (others.first().copied(), others.last().copied()) else { return Vec::new() };
    let nearest = |at: &f64| {
        let next = others.partition_point(|other| other < at);
        let after = others.get(next).copied().unwrap_or(1.0 + first) - at;
        let before = at - if next > 0 { others[next - 1] } else { last - 1.0 };
        after.min(before)
    };
    these.iter().map(nearest).collect()
}

/// Squared errors of left-out rows, by block.
#[derive(Debug, Clone)]
pub(crate) struct Losses {
    sum: Vec<f64>,
    /// by their weights
    rows: f64,
}

impl Losses {
    /// Root of the mean square.
    pub(crate) fn rms(&self) -> f64 {
        (self.total() / self.rows.max(f64::MIN_POSITIVE)).sqrt()
    }

    fn total(&self) -> f64 {
        self.sum.iter().sum()
    }

    /// Mean and standard error of the difference to another's, summed over blocks.
    fn excess_over(&self, other: &Self) -> (f64, f64) {
        let d: Vec<f64> = self.sum.iter().zip(&other.sum).map(|(a, b)| a - b).collect();
        let n = d.len() as f64;
        let total: f64 = d.iter().sum();
        let variance = d.iter().map(|x| (x - total / n).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        (total, (n * variance).sqrt())
    }

    /// No worse than `other` by more than is tolerated.
    fn is_as_good_as(&self, other: &Self, tolerance: Tolerance) -> bool {
        let (excess, error) = self.excess_over(other);
        excess <= tolerance.standard_errors() * error
    }

    /// Better than `other` by more than the standard errors asked for.
    pub(crate) fn is_better_than(&self, other: &Self) -> bool {
        self.is_better_by(BETTER, other)
    }

    /// So much better than the losses with one of its aliases in its place that it is no accident.
    pub(crate) fn is_distinct_from(&self, alias: &Self) -> bool {
        self.is_better_by(NO_ALIAS, alias)
    }

    fn is_better_by(&self, standard_errors: f64, other: &Self) -> bool {
        let (excess, error) = other.excess_over(self);
        excess > standard_errors * error
    }
}

/// Cross-validates a shape; `samples_without` gives all rows with a readout that was fitted without a fold.
pub(crate) fn cross_validate<'a>(
    samples_without: impl Fn(usize) -> Option<&'a [Sample]>,
    folds: &Folds,
    shape: &Shape,
    runs: usize,
    cycles: f64,
) -> Option<Losses> {
    let mut losses = Losses { sum: vec![0.0; folds.blocks], rows: 0.0 };
    for (number, left_out) in folds.left_out.iter().enumerate() {
        let samples = samples_without(number)?;
        let train: Vec<Sample> =
            samples.iter().zip(&left_out.block).filter(|(_, out)| out.is_none()).map(|(s, _)| *s).collect();
        let fitted = TableFit::new(shape, &train, runs, cycles)?;
        let judged = samples.iter().zip(&left_out.block);
        let test: Vec<(f64, usize, usize)> =
            judged.filter_map(|(s, block)| Some((fitted.left(s), s.run, (*block)?))).collect();
        let mut mean = vec![(0.0, 0usize); runs];
        for (left, run, _) in &test {
            mean[*run].0 += left;
            mean[*run].1 += 1;
        }
        for (left, run, block) in test {
            let constant = match fitted.constants[run] {
                Some(c) if !left_out.about_mean => c,
                _ => mean[run].0 / mean[run].1 as f64,
            };
            losses.sum[block] += left_out.weight * (left - constant).powi(2);
            losses.rows += left_out.weight;
        }
    }
    losses.sum.iter().all(|v| v.is_finite()).then_some(losses)
}

/// Cross-validates a readout by the ln of its radius, about its mean over the rows that were fitted.
pub(crate) fn losses_of_radius(
    readout_without: impl Fn(usize) -> Option<Readout>,
    folds: &Folds,
    runs: &[SensorRun],
) -> Option<Losses> {
    let readings: Vec<[f64; 2]> = runs.iter().filter_map(SensorRun::channels).flatten().copied().collect();
    let mut losses = Losses { sum: vec![0.0; folds.blocks], rows: 0.0 };
    for (number, left_out) in folds.left_out.iter().enumerate() {
        let readout = readout_without(number)?;
        let judged = readings.iter().zip(&left_out.block).filter_map(|(z, block)| Some((z, (*block)?)));
        for (z, block) in judged.filter(|(z, _)| !readout.rails.clips(**z)) {
            let [x, y] = readout.undo(*z);
            losses.sum[block] += left_out.weight * (x.hypot(y) / readout.radius + f64::MIN_POSITIVE).ln().powi(2);
            losses.rows += left_out.weight;
        }
    }
    losses.sum.iter().all(|v| v.is_finite()).then_some(losses)
}

/// A model that was cross-validated.
#[derive(Debug, Clone)]
pub(crate) struct Candidate<M> {
    /// unknowns
    pub(crate) size: usize,
    /// of these, unknowns of effects as text
    pub(crate) texts: usize,
    pub(crate) model: M,
    pub(crate) losses: Losses,
    /// of the radius, where its readout says something of it
    pub(crate) of_radius: Option<Losses>,
}

/// The simplest candidate that is as good as the best. A readout is also seen in the radius: of candidates that predict the
/// angle alike, those remain that predict the radius as well as the best of them. One that leaves far less of the radius may be a hair worse
/// in the angle: else an eccentric shaft would be taken for an offset. Ties of size go to the library rather than to
/// an effect as text, then to the smaller loss, and ties of that to the order of the models: the order in which they were tried has
/// no say.
pub(crate) fn choose<M: Ord>(candidates: &[Candidate<M>], tolerance: Tolerance) -> Option<&Candidate<M>> {
    let best = best_by_angle(candidates)?;
    let by_angle: Vec<_> = candidates.iter().filter(|c| c.losses.is_as_good_as(&best.losses, tolerance)).collect();
    let radii = by_angle.iter().filter_map(|c| c.of_radius.as_ref());
    let roundest = radii.min_by(|a, b| a.total().total_cmp(&b.total()));
    by_angle
        .iter()
        .copied()
        .filter(|c| c.of_radius.as_ref().zip(roundest).is_none_or(|(r, best)| r.is_as_good_as(best, tolerance)))
        .min_by(|a, b| a.size.cmp(&b.size).then(a.texts.cmp(&b.texts)).then_with(|| by_loss(a, b)))
}

/// Of readouts alone, where the `simpler` one has no table, the simplest within half a standard error, where it predicts better: fifths of
/// a few periods have a wide standard error, and a readout, unlike a table, has no room for what is not there.
pub(crate) fn finer<M: Ord + Clone>(readouts: &[Candidate<M>], simpler: &Candidate<M>) -> Option<Candidate<M>> {
    let finer = choose(readouts, Tolerance::Half).cloned();
    finer.filter(|finer| finer.size >= simpler.size && finer.losses.total() < simpler.losses.total())
}

/// The candidate that predicts the angle best; one that leaves far less of the radius may be a hair worse.
pub(crate) fn best_by_angle<M: Ord>(candidates: &[Candidate<M>]) -> Option<&Candidate<M>> {
    let least = candidates.iter().min_by(|a, b| by_loss(a, b))?;
    let rounder = |c: &&Candidate<M>| {
        let radii = c.of_radius.as_ref().zip(least.of_radius.as_ref());
        radii.is_some_and(|(own, other)| own.total() < FAR_ROUNDER * other.total())
            && c.losses.total() <= A_HAIR * least.losses.total()
    };
    candidates.iter().filter(rounder).min_by(|a, b| by_loss(a, b)).or(Some(least))
}

fn by_loss<M: Ord>(a: &Candidate<M>, b: &Candidate<M>) -> std::cmp::Ordering {
    a.losses.total().total_cmp(&b.losses.total()).then(a.size.cmp(&b.size)).then_with(|| a.model.cmp(&b.model))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::super::samples::Reading;
    use super::*;
    use crate::recording::Role;

    fn candidate(size: usize, model: &'static str, sum: [f64; 4]) -> Candidate<&'static str> {
        Candidate { size, texts: 0, model, losses: Losses { sum: sum.to_vec(), rows: 4.0 }, of_radius: None }
    }

    #[test]
    fn the_order_in_which_candidates_are_tried_has_no_say() {
        let mut candidates = vec![
            candidate(0, "nothing", [9.0, 8.0, 9.5, 8.5]),
            candidate(2, "offset", [1.1, 1.0, 1.2, 0.9]),
            candidate(2, "lag", [1.1, 1.0, 1.2, 0.9]),
            candidate(4, "affine", [1.0, 1.1, 1.0, 1.0]),
            candidate(12, "table", [0.9, 1.0, 1.1, 1.0]),
        ];
        for turn in 0..candidates.len() {
            candidates.rotate_left(1);
            if turn % 2 == 0 {
                candidates.reverse();
            }
            // as good as the best within a standard error, the simplest, and of two alike the first by name
            assert_eq!(choose(&candidates, Tolerance::One).map(|c| c.model), Some("lag"));
        }
    }

    /// Two of three twelfths of a turn are fitted, or one of two twentieths, or two of three ninths, and the rest is asked for.
    #[test]
    fn what_is_left_out_of_blocks_is_about_as_far_from_the_rest_as_what_is_asked_for() {
        const ROWS: usize = 1800;
        for (parts, of) in [(12, 3), (20, 2), (9, 3)] {
            let (held, fitted): (Vec<usize>, Vec<usize>) = (0..ROWS).partition(|row| row * parts / ROWS % of == 1);
            let angles = |rows: &[usize]| rows.iter().map(|row| TAU * *row as f64 / ROWS as f64).collect::<Vec<f64>>();
            let still = vec![0.0; fitted.len()];
            let run = SensorRun {
                name: "blocks.csv".into(),
                number: 0,
                role: Role::Fit,
                commanded: false,
                t_s: fitted.iter().map(|row| *row as f64).collect(),
                reference_rad: angles(&fitted),
                rate_rad_s: still.clone(),
                acceleration_rad_s2: still,
                reading: Reading::Angle(angles(&fitted)),
                temp_c: None,
                recorded: None,
            };
            let asked = angles(&held);
            let places = |angles: &[f64]| angles.iter().map(|a| place(*a, 1.0)).collect::<Vec<f64>>();
            let far = median(&mut distances(&places(&asked), &places(&run.reference_rad)));
            let left_out =
                Folds::of(std::slice::from_ref(&run), &asked, 1.0).left_out_from_kept(&places(&run.reference_rad));
            assert!((0.8..ABOUT_AS_FAR).contains(&(left_out / far)), "{parts}: {left_out} beside {far}");
        }
    }

    #[test]
    fn of_models_that_predict_the_angle_alike_the_one_that_makes_the_radius_round_is_chosen() {
        let mut candidates = [
            candidate(8, "table", [1.0, 1.1, 1.05, 1.0]),
            candidate(2, "offset", [1.0, 1.1, 1.06, 0.99]),
            candidate(4, "affine", [1.0, 1.1, 1.04, 1.0]),
            candidate(5, "cubic", [1.0, 1.1, 1.04, 1.0]),
        ];
        for (c, radius) in candidates.iter_mut().zip([9.0, 4.0, 1.1, 1.1]) {
            c.of_radius = Some(Losses { sum: vec![radius, radius * 1.1, radius * 0.9, radius], rows: 4.0 });
        }
        assert_eq!(choose(&candidates, Tolerance::One).map(|c| c.model), Some("affine"));
    }

    #[test]
    fn a_model_is_not_simplified_beyond_one_standard_error() {
        let better = [candidate(0, "nothing", [1.2, 1.3, 1.25, 1.22]), candidate(2, "offset", [1.0, 1.1, 1.04, 1.03])];
        assert_eq!(choose(&better, Tolerance::One).map(|c| c.model), Some("offset"));
    }
}
