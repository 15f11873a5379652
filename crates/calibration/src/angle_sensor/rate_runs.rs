//! Which runs of a rate gyroscope can be believed, each by itself and beside the others, and where in a run its angle and its
//! reference part by what neither bias, scale factor nor lag makes.

use std::ops::Range;

use super::samples::{Reading, SensorRun};
use crate::error::Refusal;
use crate::numerics::angles::unwrapped_beside;
use crate::numerics::linear::NormalEquations;
use crate::numerics::statistics::{line, median, robust_deviation, span};
use crate::recording::Role;
use crate::report::gate::unit;

/// Share of the runs that may be left out.
const MOST_LEFT_OUT: f64 = 1.0 / 3.0;
/// Scale factors of one gyroscope are within this share of each other, and within so many deviations of what one run tells of it:
/// other axes that turn with it and a random walk go into a run that turns little.
const SHARE: f64 = 0.05;
const DEVIATIONS: f64 = 3.0;
/// One of so many others is odd where its scale factor is off by so many times what these differ by, and by this share. Engineering choices.
const FEWEST_ALIKE: usize = 3;
const FAR_APART: f64 = 10.0;
const LEAST_APART: f64 = 3e-3;
/// Runs whose mean temperatures differ by less are at one, K.
const ALIKE_K: f64 = 5.0;
/// A run whose reference moves by less than this share of what that of another does, with and without its own even rate, is at rest:
/// references wander by a hundredth of what a hand or a table turns. Engineering choice.
const AT_REST: f64 = 0.02;
/// Parts of a run that tell a scale factor each.
const PARTS: usize = 5;
/// Rates are one value within this share of the fastest; a range ends where so many rows stand there …
const SAME_RATE: f64 = 1e-6;
const ROWS_AT_THE_END: usize = 5;
/// … while the reference goes on by this share of it.
const GOES_ON: f64 = 0.01;
/// Share of the variance of the reference beside a line in time from which on a run tells its scale factor.
const TOLD_FROM_A_LINE: f64 = 1e-3;
/// A parting stands out of the noise of the rate by so many deviations, is this share of all that is left, takes at most this
/// share of the run, and is this large at least, rad.
const STANDS_OUT: f64 = 10.0;
const MOST_OF_IT: f64 = 0.5;
const LONGEST_SHARE: f64 = 0.125;
const LEAST: f64 = 1e-3;
/// Rows before and behind one that its middle is taken with.
const BESIDE: usize = 5;

/// The runs that can be believed, of a gyroscope of this nominal scale factor and an angle of this period, rad; those that cannot are left out by name.
///
/// # Errors
/// Where too few are left, or the runs contradict each other.
pub(super) fn believed(
    runs: Vec<SensorRun>,
    scale: f64,
    period: f64,
    warnings: &mut Vec<String>,
) -> Result<Vec<SensorRun>, Refusal> {
    if let Some(run) = runs.iter().find(|run| steps(run).is_some_and(|mut steps| median(&mut steps) > 0.5 * period)) {
        return Err(Refusal::no_answer(
            &run.name,
            "theta_deg turns by more than half a period from row to row",
            "t_s in seconds and the rate in deg/s: it looks as if in ms (t_s = \"…*0.001\" in [columns], or by --map), or in mdeg/s \
             (theta_deg = \"integral(…/1000)\"); or rows closer together",
        ));
    }
    let rests = at_rest(&runs.iter().collect::<Vec<_>>());
    let of = |(run, rests): (&SensorRun, &bool)| gain(run, period).filter(|_| !rests);
    let gains: Vec<Option<[f64; 2]>> = runs.iter().zip(&rests).map(of).collect();
    let is_told = |[_, deviation]: &&[f64; 2]| DEVIATIONS * deviation < 0.5 * scale.abs();
    let mut told: Vec<f64> = gains.iter().flatten().filter(is_told).map(|[gain, _]| *gain).collect();
    let (common, whose) = match told.len() {
        0 => (scale, "that of a rate gyroscope"),
        _ => (median(&mut told), "that of the other runs"),
    };
    require_a_scale_factor(common, scale)?;
    let why = |(run, gain): (&SensorRun, &Option<[f64; 2]>)| {
        end_of_range(run, period).or_else(|| {
            let is_odd = |[gain, deviation]: &[f64; 2]| {
                (gain - common).abs() > (SHARE * common.abs()).max(DEVIATIONS * deviation)
            };
            let [gain, _] = gain.filter(is_odd)?;
            let is_reversed = (gain + common).abs() < SHARE * common.abs();
            let reversed = if is_reversed { ": with the sign of either turned they agree" } else { "" };
            Some(format!(
                "its angle turns {gain:.4} times as far as the reference, {whose} {common:.4} times{reversed}"
            ))
        })
    };
    let apart = |at: usize| {
        reversed_at_one_rate(&runs[at], rests[at], common, period).or_else(|| odd_among_alike(&runs, &gains, at))
    };
    let why: Vec<Option<String>> =
        runs.iter().zip(&gains).map(why).enumerate().map(|(at, why)| why.or_else(|| apart(at))).collect();
    let odd = why.iter().flatten().count();
    if odd as f64 > MOST_LEFT_OUT * runs.len() as f64
        && let Some((run, why)) = runs.iter().zip(&why).find_map(|(run, why)| Some((run, why.as_ref()?)))
    {
        let wanted = "runs of one gyroscope within its range, each with its own reference";
        return Err(Refusal::no_answer(&run.name, why.clone(), wanted));
    }
    warnings.extend(
        runs.iter().zip(&why).filter_map(|(run, why)| Some(format!("{}: left out: {}", run.name, why.as_ref()?))),
    );
    Ok(runs.into_iter().zip(why).filter(|(_, why)| why.is_none()).map(|(run, _)| run).collect())
}

/// Says no to a scale factor that is not the nominal one in any unit that was meant.
///
/// # Errors
/// Where it is less than half or more than twice that.
pub(super) fn require_a_scale_factor(gain: f64, scale: f64) -> Result<(), Refusal> {
    if (0.5..2.0).contains(&(gain / scale).abs()) {
        return Ok(());
    }
    Err(Refusal::no_answer(
        "campaign",
        format!("the angle turns {gain:.4} times as far as the reference, and the scale factor should be near {scale}"),
        unit(gain, Some(scale))
            .unwrap_or("rates in deg/s, angles in deg and times in s: of ms or mdeg/s a thousand are one"),
    ))
}

/// A run at one rate, which does not tell a scale factor from a bias, that turns as far as the others, and the other way.
fn reversed_at_one_rate(run: &SensorRun, rests: bool, common: f64, period: f64) -> Option<String> {
    if rests || gain(run, period).is_some() {
        return None;
    }
    let theta = followed(run, period)?;
    let gone = |v: &[f64]| Some(v.last()? - v.first()?);
    let times = gone(&theta)? / gone(&run.reference_rad)?;
    ((times + common).abs() < SHARE * common.abs()).then(|| {
        format!(
            "its angle turns {times:.4} times as far as the reference, the others {common:.4} times: its rate or its reference has lost its sign"
        )
    })
}

/// A fitted run whose scale factor is another than those of the others, which agree far better, at rates and temperatures that are among
/// theirs: of another gyroscope, or of another range of it.
fn odd_among_alike(runs: &[SensorRun], gains: &[Option<[f64; 2]>], at: usize) -> Option<String> {
    let is_fitted = |run: &SensorRun| run.role == Role::Fit;
    let [gain, deviation] = gains[at].filter(|_| is_fitted(&runs[at]))?;
    let others: Vec<usize> =
        (0..runs.len()).filter(|i| *i != at && gains[*i].is_some() && is_fitted(&runs[*i])).collect();
    if others.len() < FEWEST_ALIKE {
        return None;
    }
    let told: Vec<[f64; 2]> = others.iter().filter_map(|i| gains[*i]).collect();
    let usual = median(&mut told.iter().map(|[gain, _]| *gain).collect::<Vec<_>>());
    let apart = told.iter().map(|[gain, deviation]| (gain - usual).abs().max(*deviation)).fold(deviation, f64::max);
    let off = (gain - usual).abs();
    let among = |of: &dyn Fn(&SensorRun) -> f64, margin: f64| {
        let (low, high) = others
            .iter()
            .map(|i| of(&runs[*i]))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        (low - margin..=high + margin).contains(&of(&runs[at]))
    };
    let fastest = |run: &SensorRun| run.rate_rad_s.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    let warm = |run: &SensorRun| run.temp_c.as_ref().map_or(0.0, |t| t.iter().sum::<f64>() / t.len().max(1) as f64);
    let is_alike = among(&fastest, 0.1 * fastest(&runs[at])) && among(&warm, ALIKE_K);
    (is_alike && off > FAR_APART * apart && off > LEAST_APART * usual.abs()).then(|| {
        format!("its scale factor is {gain:.4}, and those of the others are {usual:.4} within {apart:.4}: of another gyroscope, or range")
    })
}

fn angle(run: &SensorRun) -> Option<&[f64]> {
    if let Reading::Angle(theta) = &run.reading { Some(theta) } else { None }
}

/// The angle, followed through its period.
fn followed(run: &SensorRun, period: f64) -> Option<Vec<f64>> {
    Some(unwrapped_beside(angle(run)?, &run.reference_rad, period))
}

fn steps(run: &SensorRun) -> Option<Vec<f64>> {
    Some(angle(run)?.windows(2).map(|w| (w[1] - w[0]).abs()).collect()).filter(|steps: &Vec<f64>| !steps.is_empty())
}

/// Which runs rest beside the others. Such a run tells no scale factor: what moves there is the noise of the reference, of which the angle
/// has nothing.
pub(super) fn at_rest(runs: &[&SensorRun]) -> Vec<bool> {
    let moved: Vec<[f64; 2]> = runs.iter().map(|run| moved(run)).collect();
    let farthest = [0, 1].map(|i| moved.iter().map(|m| m[i]).fold(0.0, f64::max));
    moved.iter().map(|moved| (0..2).all(|i| moved[i] < AT_REST.powi(2) * farthest[i])).collect()
}

/// Mean squares of the reference of a run, rad²: about its mean, and beside an even rate.
fn moved(run: &SensorRun) -> [f64; 2] {
    let (slope, intercept) = line(&run.t_s, &run.reference_rad);
    let count = run.len().max(1) as f64;
    let mean = run.reference_rad.iter().sum::<f64>() / count;
    let beside = run.t_s.iter().zip(&run.reference_rad).map(|(t, a)| a - slope * t - intercept);
    [run.reference_rad.iter().map(|a| (a - mean).powi(2)).sum::<f64>(), beside.map(|e| e * e).sum::<f64>()]
        .map(|sum| sum / count)
}

/// Scale factor of one run beside a bias of its own, and its standard deviation by how those of its parts scatter; none where
/// scale factor and bias are not told apart.
fn gain(run: &SensorRun, period: f64) -> Option<[f64; 2]> {
    let theta = &followed(run, period)?;
    let of = |rows: Range<usize>| -> Option<[f64; 2]> {
        let (reference, t_s, theta) = (&run.reference_rad[rows.clone()], &run.t_s[rows.clone()], &theta[rows]);
        let middle = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let middles = [middle(reference), middle(t_s), middle(theta)];
        let mut equations = NormalEquations::new(2);
        let mut moments = [0.0; 3];
        for ((a, t), theta) in reference.iter().zip(t_s).zip(theta) {
            let (a, t) = (a - middles[0], t - middles[1]);
            equations.add(&[a, t], theta - middles[2]);
            moments = [moments[0] + a * a, moments[1] + a * t, moments[2] + t * t];
        }
        let beside_a_line = 1.0 - moments[1].powi(2) / (moments[0] * moments[2]).max(f64::MIN_POSITIVE);
        let told = moments[0] > 0.0 && beside_a_line > TOLD_FROM_A_LINE;
        told.then(|| [equations.solve()[0], moments[0] * beside_a_line])
    };
    let [gain, _] = of(0..run.len()).filter(|[gain, _]| *gain != 0.0)?;
    let part = |number: usize| number * run.len() / PARTS..(number + 1) * run.len() / PARTS;
    let (mut information, mut scatter) = (f64::MIN_POSITIVE, 0.0);
    for [own, weight] in (0..PARTS).map(part).filter(|rows| rows.len() > 2).filter_map(of) {
        information += weight;
        scatter += (weight * (own - gain)).powi(2);
    }
    Some([gain, scatter.sqrt() / information])
}

/// Says that the rate stands at one value while the reference turns faster, where it does.
fn end_of_range(run: &SensorRun, period: f64) -> Option<String> {
    let theta = followed(run, period)?;
    let rates: Vec<f64> = theta
        .windows(2)
        .zip(run.t_s.windows(2))
        .map(|(a, t)| (a[1] - a[0]) / (t[1] - t[0]).max(f64::MIN_POSITIVE))
        .collect();
    let reference = |i: usize| {
        (run.reference_rad[i + 1] - run.reference_rad[i]) / (run.t_s[i + 1] - run.t_s[i]).max(f64::MIN_POSITIVE)
    };
    let fastest = rates.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
    for sign in [1.0, -1.0] {
        let end = rates.iter().map(|r| sign * r).fold(0.0, f64::max);
        let there: Vec<usize> = (0..rates.len()).filter(|&i| end - sign * rates[i] < SAME_RATE * fastest).collect();
        if there.len() < ROWS_AT_THE_END {
            continue;
        }
        let beside: Vec<f64> = there.iter().map(|&i| reference(i).abs()).collect();
        if span(&beside) > GOES_ON * end {
            return Some(format!(
                "its rate stands at {:.4} deg/s in {} rows while the reference goes on: its range ends there",
                (sign * end).to_degrees(),
                there.len()
            ));
        }
    }
    None
}

/// Says that a response is more than late, by the low-pass of first order that responds alike, s; negative where it overshoots.
pub(super) fn of_the_response(time_constant_s: f64) -> String {
    let corner_hz = 1.0 / (std::f64::consts::TAU * time_constant_s.abs());
    let like = if time_constant_s > 0.0 { "is cut off as by" } else { "overshoots, by as much as is cut off by" };
    format!(
        "most of what is left goes with the acceleration of the reference: the output is not only late, it {like} a low-pass of first \
         order at {corner_hz:.3} Hz; the lag is undone and that is not: it shows on ramps of the rate and nowhere else"
    )
}

/// Says where in a run the angle and its reference part by most of what is `left`, where that is a short part of it; or that
/// they do all along, by more than noise of the rate makes.
pub(super) fn parting(run: &SensorRun, left: &[f64]) -> Option<String> {
    let (n, t_s) = (left.len(), &run.t_s);
    let steps: Vec<f64> = left.windows(2).map(|w| w[1] - w[0]).collect();
    // what stays: rows in which the rate steps are off by themselves
    let stays: Vec<f64> =
        (0..n).map(|i| median(&mut left[i.saturating_sub(BESIDE)..(i + BESIDE + 1).min(n)].to_vec())).collect();
    let all = span(&stays);
    let usual = robust_deviation(steps.iter().copied());
    if all < LEAST || usual <= 0.0 {
        return None;
    }
    let longest = LONGEST_SHARE * n as f64;
    let widths = std::iter::successors(Some(1usize), |w| Some(2 * w)).take_while(|w| *w as f64 <= longest);
    let stays = &stays;
    let widest = |w: usize| (0..n - w).map(move |i| (i, w, stays[i + w] - stays[i]));
    let stands_out = |&(_, w, by): &(usize, usize, f64)| by.abs() / (usual * (w as f64).sqrt());
    let most = |p: &(usize, usize, f64)| p.2.abs() > MOST_OF_IT * all && stands_out(p) > STANDS_OUT;
    let found = widths.flat_map(widest).filter(most).max_by(|a, b| stands_out(a).total_cmp(&stands_out(b)));
    if let Some((at, over, by)) = found {
        return Some(format!(
            "{}: from {:.2} s to {:.2} s the angle and its reference part by {:.3}°, which is most of what is left and neither bias, \
             scale factor nor lag: a coupling that slipped, values that stood still, rows that are missing, or a range that ended",
            run.name,
            t_s[at],
            t_s[at + over],
            by.to_degrees()
        ));
    }
    (all > STANDS_OUT * usual * (n as f64).sqrt()).then(|| {
        format!(
            "{}: the angle and its reference part by {:.3}° in the course of the run, which neither bias, scale factor nor lag makes \
             and noise of the rate does not: a bias or a scale factor that changes, with the temperature for one",
            run.name,
            all.to_degrees()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A minute at 100 Hz of a gyroscope with this scale factor, whose rate ends at `range`, rad/s, turned there and back.
    fn run(name: &str, gain: f64, range: f64) -> SensorRun {
        let t_s: Vec<f64> = (0..6000).map(|i| 0.01 * f64::from(i)).collect();
        let rate = |t: f64| 1.5 * (0.7 * t).sin();
        let sum = |f: &dyn Fn(f64) -> f64| {
            t_s.iter()
                .scan(0.0, |angle, t| {
                    *angle += 0.01 * f(*t);
                    Some(*angle)
                })
                .collect::<Vec<f64>>()
        };
        SensorRun {
            name: name.into(),
            number: 0,
            role: Role::Fit,
            commanded: false,
            reference_rad: sum(&rate),
            rate_rad_s: t_s.iter().map(|t| rate(*t)).collect(),
            acceleration_rad_s2: vec![0.0; t_s.len()],
            temp_c: None,
            recorded: None,
            reading: Reading::Angle(sum(&|t| (gain * rate(t) + 0.006).clamp(-range, range))),
            t_s,
        }
    }

    fn told(runs: &[SensorRun]) -> Result<Vec<String>, Refusal> {
        let mut warnings = Vec::new();
        believed(runs.to_vec(), 1.0, std::f64::consts::TAU, &mut warnings).map(|_| warnings)
    }

    #[test]
    fn a_run_that_turns_the_other_way_is_named_and_of_two_neither_is_right() {
        let runs = [run("a", 1.02, 9.0), run("b", 1.02, 9.0), run("c", -1.02, 9.0)];
        let warnings = told(&runs).expect("two that agree");
        assert!(
            warnings.len() == 1 && warnings[0].starts_with("c: left out: its angle turns -1.0200 times"),
            "{warnings:?}"
        );
        assert!(told(&runs[1..]).is_err() && told(&runs[..2]).expect("alike").is_empty());
    }

    #[test]
    fn one_of_four_with_another_scale_factor_or_without_its_sign_at_one_rate_is_named() {
        let mut runs: Vec<SensorRun> = (0..3).map(|i| run("a", 1.02 + 1e-5 * f64::from(i), 9.0)).collect();
        runs.push(run("odd", 0.998, 9.0));
        let warnings = told(&runs).expect("three that agree");
        assert!(
            warnings.len() == 1 && warnings[0].starts_with("odd: left out: its scale factor is 0.9980"),
            "{warnings:?}"
        );
        // three that differ as much tell nothing of a fourth
        runs[1] = run("a", 1.01, 9.0);
        assert!(told(&runs).expect("apart").is_empty());
        let mut even = run("even", -1.02, 9.0);
        even.reference_rad = even.t_s.iter().map(|t| 0.5 * t).collect();
        even.rate_rad_s.fill(0.5);
        even.reading = Reading::Angle(even.t_s.iter().map(|t| -0.51 * t).collect());
        runs[3] = even;
        let warnings = told(&runs).expect("three of one sign");
        assert!(warnings.len() == 1 && warnings[0].contains("has lost its sign"), "{warnings:?}");
    }

    #[test]
    fn a_range_that_ends_is_no_scale_factor() {
        let refusal = told(&[run("a", 1.02, 1.3)]).expect_err("a rate that stands");
        assert!(refusal.to_string().contains("its rate stands at 74.48"), "{refusal}");
        assert!(told(&[run("a", 1.02, 9.0)]).expect("its whole range").is_empty());
    }

    #[test]
    fn a_rate_in_another_unit_is_named() {
        assert!(
            told(&[run("a", 5.88, 99.0)])
                .expect_err("six times")
                .to_string()
                .contains("as if in revolutions per minute")
        );
    }

    #[test]
    fn milliseconds_taken_for_seconds_are_named() {
        let mut run = run("a", 1.0, 9.0);
        let Reading::Angle(theta) = &mut run.reading else { unreachable!() };
        theta.iter_mut().for_each(|v| *v *= 1e3);
        assert!(told(&[run]).expect_err("turns of its own").to_string().contains("as if in ms"));
    }

    #[test]
    fn where_a_run_parts_from_its_reference_is_told_and_a_walk_does_not() {
        let run = run("a", 1.0, 9.0);
        let noise = |i: usize| ((i as f64 * 12.9898).sin() * 43_758.545_3).fract();
        let walk: Vec<f64> = (0..run.len())
            .scan(0.0, |sum, i| {
                *sum += 1e-4 * noise(i);
                Some(*sum)
            })
            .collect();
        assert_eq!(parting(&run, &walk), None);
        let slipped: Vec<f64> =
            walk.iter().enumerate().map(|(i, w)| w + 0.05 * ((i as f64 - 3000.0) / 30.0).clamp(0.0, 1.0)).collect();
        let said = parting(&run, &slipped).expect("thirty rows");
        let drifts: Vec<f64> = walk.iter().enumerate().map(|(i, w)| w + 1e-8 * (i as f64).powi(2)).collect();
        let slowly = parting(&run, &drifts).expect("a rate that changes");
        assert!(slowly.contains("in the course of the run"), "{slowly}");
        assert!(said.starts_with("a: from 30.00 s to 30.32 s") || said.starts_with("a: from 29.9"), "{said}");
    }
}
