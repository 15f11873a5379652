//! Isolated harmonics of the reference's turn beyond the table: steps of a motor, teeth, poles. The strongest ordinate of
//! the periodogram is taken where its false-alarm probability over all that were tried is small: ordinates of noise are
//! exponential, and their median is ln 2 times their mean. Where stations meet a line at one phase only, its ordinate has
//! one degree of freedom instead of two.

use statrs::function::erf::erfc;

use super::table_fit::{Sample, TableFit, only_phase};
use crate::numerics::statistics::{median, span};

/// False-alarm probability over all lines tried.
const FALSE_ALARM: f64 = 0.01;
/// Highest line that is looked for: among many rows, and where there are few, so that ordinates times rows stay in bounds.
const HIGHEST_OF_MANY: usize = 128;
const HIGHEST: usize = 512;
const ORDINATES_TIMES_ROWS: usize = 2_000_000;
/// Fewest lines to tell noise from.
const FEWEST: usize = 8;
/// The first harmonics of the sensor's period are left to the table, even where it was chosen shorter.
const OF_EVERY_TABLE: usize = 4;
/// Of less than a whole turn, so much must be covered, and so many periods of a line: fewer are a drift as well.
const WHOLE_TURN: f64 = 350.0 / 360.0 * std::f64::consts::TAU;
const LEAST_SPAN: f64 = std::f64::consts::TAU / 3.0;
const FEWEST_PERIODS: f64 = 6.0;
/// Lines that are nearer than this, per turn, are one.
const ONE_LINE: f64 = 0.25;
/// The strongest line may be the alias of one that has this share of its power, and this coherence with it on the stations.
const ALIAS: f64 = 0.4;
/// Lines of at least this coherence are one on the stations, and below the other they are two: engineering choices.
const SAME: f64 = 0.9;
const ANOTHER: f64 = 0.75;
/// Multiples of the stations' number about which aliases of a line lie.
const MULTIPLES: u32 = 3;
/// Lines that are tried in its place, itself among them.
const MOST_ALIASES: usize = 4;
/// A usual distance of stations is at most so many times their spacing.
const MOST_PARTS: u32 = 4;
/// Share of the spacing by which a station may be off the grid: engineering choice.
const OFF_THE_GRID: f64 = 0.05;
/// A line slower than the sensor's period, as the eccentricity of many pole pairs makes, has to come round again: within one
/// turn it is no more than a drift.
const TURNS_OF_A_SLOW_LINE: f64 = 1.75;
/// A line of so many times as many per turn is no rival of one that is seen: engineering choice.
const FAR_MORE: u32 = 64;

/// The strongest line of what a table leaves, if it is no accident, and after it those of which it may be the alias because
/// stations stand at uneven distances. Lines go up to that which the spacing of stations resolves, and that one is included:
/// left out, its aliases would stand in for it.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small positive counts, saturating")]
pub(crate) fn strongest_and_its_aliases(samples: &[Sample], fitted: &TableFit, cycles_per_turn: f64) -> Vec<u32> {
    let reference: Vec<f64> = samples.iter().map(|s| s.reference).collect();
    let (covered, whole) = (span(&reference), cover_a_turn(samples));
    if covered < LEAST_SPAN {
        return Vec::new();
    }
    let left: Vec<f64> = samples.iter().map(|s| fitted.left(s) - fitted.constants[s.run].unwrap_or(0.0)).collect();
    let resolved = std::f64::consts::PI / spacing(&reference).max(1e-12) + 0.01;
    let repeats = covered > TURNS_OF_A_SLOW_LINE * std::f64::consts::TAU;
    let slowest = if whole { 0.0 } else { FEWEST_PERIODS * std::f64::consts::TAU / covered };
    let highest = highest(reference.len());
    let tried: Vec<u32> = (1..=highest.min(resolved as u32))
        .filter(|n| !fitted.shape.lines.contains(n) && f64::from(*n) > slowest)
        .filter(|n| repeats || f64::from(*n) > cycles_per_turn)
        .filter(|n| !belongs_to_table(*n, fitted.shape.order, cycles_per_turn))
        .collect();
    if tried.len() < FEWEST {
        return Vec::new();
    }
    let powers: Vec<f64> = tried.iter().map(|n| power(f64::from(*n), &reference, &left)).collect();
    let mean = median(&mut powers.clone()) / std::f64::consts::LN_2;
    let mut ranked: Vec<(u32, f64)> = tried.iter().copied().zip(powers).collect();
    ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
    // a comb of stations spreads what is left over a few ordinates: it also has to stand out of the sum of squares
    let rest = left.iter().map(|e| e * e).sum::<f64>() - 2.0 * ranked[0].1 / left.len() as f64;
    let ratio = ranked[0].1 / mean.max(rest.max(0.0));
    let one_phase = only_phase(f64::from(ranked[0].0), samples).is_some();
    let alone = if one_phase { erfc((0.5 * ratio).sqrt()) } else { (-ratio).exp() };
    let by_chance = -(-alone).ln_1p() * tried.len() as f64;
    if -(-by_chance).exp_m1() >= FALSE_ALARM {
        return Vec::new();
    }
    let first = ranked[0];
    // stations of several runs at unlike places tell some of what each by itself does not resolve
    let beyond = folded(first.0, &reference).filter(|n| f64::from(*n) > resolved && *n <= highest);
    let beyond = beyond.filter(|n| coherence(first.0, *n, &reference) < SAME);
    ranked.extend(beyond.map(|n| (n, power(f64::from(n), &reference, &left))));
    let aliases = ranked.into_iter().filter(|a| a.1 > ALIAS * first.1 && coherence(first.0, a.0, &reference) > ALIAS);
    aliases.take(MOST_ALIASES).map(|(n, _)| n).collect()
}

/// Whether samples cover a turn of the reference.
pub(crate) fn cover_a_turn(samples: &[Sample]) -> bool {
    span(&samples.iter().map(|s| s.reference).collect::<Vec<_>>()) > WHOLE_TURN
}

/// Coherence of two lines on the stations: 1 where one is the alias of the other, near 0 where both are resolved.
fn coherence(a: u32, b: u32, reference: &[f64]) -> f64 {
    beats(a, b, reference).into_iter().map(|[c, s]| c.hypot(s)).fold(0.0, f64::max)
}

/// Means of the cosine and the sine of the difference and of the sum of two lines over stations.
fn beats(a: u32, b: u32, reference: &[f64]) -> [[f64; 2]; 2] {
    let (a, b) = (f64::from(a), f64::from(b));
    [a - b, a + b].map(|n| projections(n, reference, &vec![1.0; reference.len()]).map(|v| v / reference.len() as f64))
}

/// Lines that fold over to one of `n` per turn on stations at even distances.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive counts, saturating")]
fn folded(n: u32, reference: &[f64]) -> impl Iterator<Item = u32> {
    let stations = std::f64::consts::TAU / spacing(reference).max(1e-12);
    let about = (1..=MULTIPLES).map(move |multiple| f64::from(multiple) * stations);
    let all = about.flat_map(move |of| [of - f64::from(n), of + f64::from(n)]).map(|m| m.abs().round() as u32);
    all.filter(move |m| *m > 0 && *m != n)
}

/// A line that looks like one of `n` per turn on the stations that were fitted, and is another where the angle is asked for: stations at
/// even distances do not tell the two, and what is fitted of the one says nothing of the other's stations. One of far more per turn is
/// none: a shaft off its middle is far likelier than a gear of as many teeth as there are stations, less one.
pub(crate) fn alias_elsewhere(n: u32, fitted: &[f64], asked: &[f64]) -> Option<u32> {
    folded(n, fitted).filter(|m| *m < FAR_MORE * n).find(|m| {
        let [here, there] = [fitted, asked].map(|reference| beats(n, *m, reference));
        let over_both = |k: usize| (here[k][0] + there[k][0]).hypot(here[k][1] + there[k][1]) / 2.0;
        (0..2).any(|k| here[k][0].hypot(here[k][1]) > SAME && over_both(k) < ANOTHER)
    })
}

/// Highest line that is looked for among so many rows.
#[allow(clippy::cast_possible_truncation, reason = "at most HIGHEST")]
fn highest(rows: usize) -> u32 {
    (ORDINATES_TIMES_ROWS / rows.max(1)).clamp(HIGHEST_OF_MANY, HIGHEST) as u32
}

/// The step of which all distances between neighbouring stations are multiples, in whatever order these were recorded. Where stations
/// were left out, the lower quartile of their distances is still the spacing, or, where they were left out in a pattern, a few times as
/// much.
fn spacing(reference: &[f64]) -> f64 {
    let mut places = reference.to_vec();
    places.sort_by(f64::total_cmp);
    let mut steps: Vec<f64> = places.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
    // what is far nearer than most of the way is made in is one station, met again
    let again = OFF_THE_GRID * half_of_the_way(&mut steps);
    steps.retain(|s| *s > again);
    let usual = steps.get(steps.len() / 4).copied().unwrap_or(0.0);
    let divides = |parts: &f64| {
        let unit = usual / parts;
        steps.iter().all(|s| (s / unit - (s / unit).round()).abs() < OFF_THE_GRID)
    };
    (1..=MOST_PARTS).map(f64::from).find(divides).map_or(usual, |parts| usual / parts)
}

/// Sorts distances; half of the way is made in those that are no longer than this one. 0 of none.
fn half_of_the_way(steps: &mut [f64]) -> f64 {
    steps.sort_by(f64::total_cmp);
    let half = 0.5 * steps.iter().sum::<f64>();
    let mut gone = 0.0;
    let reached = |s: &&f64| {
        gone += **s;
        gone >= half
    };
    steps.iter().find(reached).copied().unwrap_or(0.0)
}

/// Whether a line is a harmonic of the sensor's period that a table of so many harmonics holds, or could.
fn belongs_to_table(n: u32, order: usize, cycles_per_turn: f64) -> bool {
    is_harmonic_of_table(n, order.max(OF_EVERY_TABLE), cycles_per_turn)
}

/// Whether a line is a harmonic of the sensor's period that a table of so many harmonics holds.
pub(crate) fn is_harmonic_of_table(n: u32, order: usize, cycles_per_turn: f64) -> bool {
    let harmonic = (f64::from(n) / cycles_per_turn).round();
    let apart = (f64::from(n) - harmonic * cycles_per_turn).abs();
    harmonic >= 1.0 && apart < ONE_LINE && harmonic <= order as f64
}

fn power(n: f64, reference: &[f64], left: &[f64]) -> f64 {
    projections(n, reference, left).into_iter().map(|v| v * v).sum()
}

/// Sums of what is left times the cosine and the sine of a line.
fn projections(n: f64, reference: &[f64], left: &[f64]) -> [f64; 2] {
    reference.iter().zip(left).fold([0.0; 2], |[c, s], (a, e)| {
        let (sin, cos) = (n * a).sin_cos();
        [c + e * cos, s + e * sin]
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::table_fit::{Motion, Shape};
    use super::*;
    use crate::model::angle_table::Form;
    use crate::numerics::statistics::remembered;

    /// Stations 5° apart of which every third is left out, and a line of 36 per turn, which is half their number.
    #[test]
    fn a_line_at_the_spacing_of_stations_is_found_and_not_its_alias_where_some_are_left_out() {
        let noise = remembered(0.0, 72, 7);
        let stations = (0..72).filter(|i| i % 3 != 1);
        let samples: Vec<Sample> = stations
            .map(|i| {
                let reference = (5.0 * f64::from(i)).to_radians();
                let error = 3e-3 * (36.0 * reference).cos() + 2e-4 * noise[i as usize];
                Sample { theta: reference + error, error, reference, rate: 1.0, acceleration: 0.0, run: 0 }
            })
            .collect();
        let shape = Shape { form: Form::Own, order: 0, motion: Motion::None, lines: vec![], free_gain: false };
        let fitted = TableFit::new(&shape, &samples, 1, 1.0).unwrap();
        assert_eq!(strongest_and_its_aliases(&samples, &fitted, 1.0)[0], 36);
    }

    /// Stations at even distances of a turn, met in this order; a line of so many per turn beside noise.
    fn of_stations(order: &[u32], count: u32, line: f64, jitter: f64) -> Vec<Sample> {
        let [noise, off] = [3, 5].map(|seed| remembered(0.0, order.len(), seed));
        let sample = |(i, station): (usize, &u32)| {
            let reference = std::f64::consts::TAU * (f64::from(*station) + jitter * off[i]) / f64::from(count);
            let error = 3e-3 * (line * reference + 0.4).cos() + 5e-4 * noise[i];
            Sample { theta: reference + error, error, reference, rate: 1.0, acceleration: 0.0, run: 0 }
        };
        order.iter().enumerate().map(sample).collect()
    }

    fn found(samples: &[Sample]) -> Vec<u32> {
        let shape = Shape { form: Form::Own, order: 0, motion: Motion::None, lines: vec![], free_gain: false };
        strongest_and_its_aliases(samples, &TableFit::new(&shape, samples, 1, 1.0).unwrap(), 1.0)
    }

    #[test]
    fn a_line_of_many_per_turn_is_none_of_its_overtones_or_differences() {
        let in_order: Vec<u32> = (0..1024).collect();
        for line in [101, 252, 378] {
            assert_eq!(found(&of_stations(&in_order, 1024, f64::from(line), 0.0)), [line]);
        }
    }

    #[test]
    fn stations_are_resolved_in_whatever_order_they_were_met() {
        let shuffled: Vec<u32> = (0..300).map(|i| (i * 97) % 300).collect();
        let there_and_back: Vec<u32> = (0..300).chain((0..300).rev()).collect();
        for (order, jitter) in [(&shuffled, 0.0), (&there_and_back, 0.0), (&there_and_back, 0.01)] {
            assert_eq!(found(&of_stations(order, 300, 50.0, jitter))[0], 50);
        }
    }

    #[test]
    fn a_line_is_another_elsewhere_where_even_stations_do_not_tell_it_from_its_alias() {
        let stations = |from: f64| -> Vec<f64> { (0..72).map(|i| (from + 5.0 * f64::from(i)).to_radians()).collect() };
        // 22 and 50 per turn are one on 72 stations, and each other's opposite half a step further
        assert_eq!(alias_elsewhere(22, &stations(0.0), &stations(2.5)), Some(50));
        assert_eq!(alias_elsewhere(50, &stations(0.0), &stations(2.5)), Some(22));
        // 71 per turn
        assert_eq!(alias_elsewhere(1, &stations(0.0), &stations(2.5)), None);
        assert_eq!(alias_elsewhere(22, &stations(0.0), &stations(0.0)), None);
        // a full step of the motor further it is the same again
        assert_eq!(alias_elsewhere(22, &stations(0.0), &stations(25.0)), None);
        // a reference that turns meets every position
        let turning: Vec<f64> = (0..5000).map(|i| 0.0123 * f64::from(i)).collect();
        assert_eq!(alias_elsewhere(22, &turning, &stations(2.5)), None);
    }
}
