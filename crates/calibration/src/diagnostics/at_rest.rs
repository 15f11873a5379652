//! What runs at rest tell: how far the angle wanders, over which time, and how fast it drifts.

use std::f64::consts::PI;

use cvg_model::Envelope;
use rayon::prelude::*;

use crate::diagnostics::allan::{self, FLICKER, Point};
use crate::diagnostics::angle_random_walk::{Unread, angle_random_walk};
use crate::error::Refusal;
use crate::facts::{Allan, AllanPoint, Estimate};
use crate::numerics::angles::wrapped;
use crate::numerics::statistics::{line, median, robust_deviation};
use crate::recording::{Campaign, Instrument, Run, RunKind};

/// A time step longer than this many usual ones is a gap.
const GAP: f64 = 1.5;
/// Intervals of runs that may be taken together differ by no more than this share.
const SAME_INTERVAL: f64 = 1e-3;
/// Angles below which a run tells nothing.
const FEWEST: usize = 64;
/// Steps of the angle, over so many samples, that exceed their robust deviation by this factor and are faster than a bias ever
/// changes by are motion and no noise.
const MOVES: f64 = 20.0;
const FASTEST_DPS: f64 = 0.5;
const OVER: [usize; 2] = [1, 8];
/// An angle mostly repeats the row before where this share of its steps is nothing.
const MOSTLY: f64 = 0.5;
/// So many rows of one value are a recording that stood still, where no more than this share of the others repeat.
const STANDS_STILL: usize = 30;
const SELDOM: f64 = 0.05;
/// Share of a run's rows that may be motion.
const MOST_MOVING: f64 = 0.1;
/// Mean rates at consecutive intervals that go together so closely are no noise; looked at for intervals of up to so many
/// seconds, with so many of them.
const GOES_ON: f64 = 0.5;
const LOOKED_AT_S: f64 = 4.0;
const FEWEST_INTERVALS: usize = 64;
const DEVIATIONS: f64 = 4.0;
/// A rate that goes on and changes by so much, deg/s, is not told from a bias that does.
const SLOWEST_DPS: f64 = 0.05;
/// Octaves beyond the longest interval at which a rate goes on: what the filter of the noise makes of it is over from the
/// first on (a first-order one has τσ² at 0.8 of its end there), and a run of so many of the last tells it within this factor.
const BEYOND: [usize; 2] = [3, 5];
const FEWEST_LENGTHS: usize = 4;
const ALIKE: f64 = 3.0;
/// No bias is as large as this, deg/s.
const LARGEST_DPS: f64 = 20.0;

/// A run at rest as stretches without a gap.
struct AtRest {
    name: String,
    interval_s: f64,
    /// angle, unwrapped, deg
    stretches: Vec<Vec<f64>>,
    /// mean rate, deg/s
    rate_dps: f64,
    length_s: f64,
}

/// Takes the runs at rest out of a campaign.
pub(crate) fn take(campaign: &mut Campaign) -> Vec<Run> {
    let (at_rest, others) = std::mem::take(&mut campaign.runs).into_iter().partition(|r| r.kind == RunKind::Static);
    campaign.runs = others;
    at_rest
}

/// The Allan deviation of runs at rest, each run's rate with its interval, and what has to be said of them.
///
/// # Errors
/// Where a run is too short, or has no angle.
pub(crate) fn allan(
    runs: &[Run],
    instrument: Instrument,
    period_deg: Option<f64>,
) -> Result<(Allan, Vec<Estimate>, Vec<String>), Refusal> {
    let period = period_deg.unwrap_or(if instrument == Instrument::Sensor { 360.0 } else { 180.0 });
    let mut rests: Vec<AtRest> = runs.par_iter().map(|r| AtRest::new(r, period)).collect::<Result<_, _>>()?;
    let mut warnings = Vec::new();
    let mut drifts = false;
    for rest in &mut rests {
        let drift = rest.drift()?;
        drifts |= drift.is_some();
        warnings.extend(drift);
        warnings.extend(rest.without_rows_that_stand_still());
        warnings.extend(rest.without_motion()?);
    }
    let digit =
        rests.iter().filter_map(AtRest::digit).fold(None, |most: Option<f64>, d| Some(most.map_or(d, |m| m.max(d))));
    let Some(longest) = rests.iter().max_by(|a, b| a.length_s.total_cmp(&b.length_s)) else {
        return Err(Refusal::no_answer("campaign", "there is no run at rest", "a run with kind = \"static\""));
    };
    let mut stretches = Vec::new();
    for r in &rests {
        if (r.interval_s / longest.interval_s - 1.0).abs() < SAME_INTERVAL {
            stretches.extend(r.stretches.iter().cloned());
        } else {
            warnings.push(format!(
                "{}: sampled every {:.6} s and {} every {:.6} s; the Allan deviation is of the latter",
                r.name, r.interval_s, longest.name, longest.interval_s
            ));
        }
    }
    let interval_s = longest.interval_s;
    let points = allan::overlapping(&stretches, interval_s, &allan::multiples(&stretches));
    let walk = if drifts || digit.is_some() { Err(Unread::NoModel) } else { angle_random_walk(&stretches, interval_s) };
    let (bottom, at_the_end) = bottom(&points).ok_or_else(|| {
        Refusal::no_answer(&longest.name, "the angle at rest does not change at all", "an angle with all its digits")
    })?;
    if at_the_end {
        warnings.push(format!(
            "the Allan deviation still falls at {:.0} s, the longest time that the runs tell: bias_instability_dph is what \
             it is at most; a longer run would tell",
            bottom.tau_s
        ));
    }
    if let Some(digit) = digit {
        warnings.push(format!(
            "the angle at rest goes in steps of {digit:.2e}° and mostly repeats the row before: its noise is below its last digit, \
             so that angle_random_walk_deg_sqrt_h is null, and bias_instability_dph is what it is at most; wanted: more digits"
        ));
    } else if let Some(why) = walk.err().filter(|_| !drifts) {
        warnings.push(format!("angle_random_walk_deg_sqrt_h is null: {}", unread(why)));
    }
    let hour = 3600.0;
    let dph = |v: f64| v * hour;
    let allan = Allan {
        angle_random_walk_deg_sqrt_h: walk.ok().map(|read| Estimate {
            value: read.value.value * hour.sqrt(),
            ci95: read.value.ci95.map(|end| end * hour.sqrt()),
        }),
        angle_random_walk_tau_s: walk.ok().map(|read| read.from_s),
        bias_instability_dph: Estimate {
            value: dph(bottom.deviation / FLICKER),
            ci95: bottom.ci95.map(|v| dph(v / FLICKER)),
        },
        bias_instability_tau_s: bottom.tau_s,
        interval_s,
        points: points
            .iter()
            .map(|p| AllanPoint { tau_s: p.tau_s, deviation_dph: dph(p.deviation), ci95: p.ci95.map(dph) })
            .collect(),
    };
    let wander = points.last().map_or(0.0, |p| p.deviation);
    let rates = rests.iter().map(|r| Estimate::new(r.rate_dps, wander)).collect();
    Ok((allan, rates, warnings))
}

/// Why there is no angle random walk, in words.
fn unread(why: Unread) -> &'static str {
    match why {
        Unread::NoneOfIt => {
            "no stretch of the Allan deviation falls as 1/√τ by more than it is uncertain, as where a filter remembers for much of the run: \
             a longer one tells; or as of a rate in the place of theta_deg: of one the angle is theta_deg = \"integral(COLUMN)\" in [columns]"
        }
        Unread::NoModel => {
            "from no averaging time on is the Allan deviation one of white noise, flicker and a random walk of the rate, or too \
             little of it is; a longer run would tell, of a filtered rate one of several hundred times what the filter remembers"
        }
    }
}

/// The lowest point, and whether the deviation still falls there.
fn bottom(points: &[Point]) -> Option<(Point, bool)> {
    let at = (0..points.len()).min_by(|&a, &b| points[a].deviation.total_cmp(&points[b].deviation))?;
    (points[at].deviation > 0.0).then_some((points[at], at + 1 == points.len()))
}

impl AtRest {
    fn new(run: &Run, period_deg: f64) -> Result<Self, Refusal> {
        let settled = run.settled()?;
        let r = &run.recording;
        let name = run.file.display().to_string();
        let t_s = &r.t_s[settled.clone()];
        if t_s.len() < FEWEST {
            return Err(Refusal::no_answer(
                &name,
                format!("{} rows at rest are too few for an Allan deviation", t_s.len()),
                format!("{FEWEST} or more, better hours of them"),
            ));
        }
        let wrapped_deg: Vec<f64> = match (&r.theta_deg, &r.xc_v, &r.yc_v) {
            (Some(theta), ..) if r.theta_is_integral => summed(t_s, &theta[settled]),
            (Some(theta), ..) => theta[settled].to_vec(),
            (None, Some(x), Some(y)) => {
                let part = |v: &Option<Vec<f64>>, i: usize| v.as_ref().map_or(0.0, |v| v[i]);
                settled
                    .map(|i| {
                        let e = Envelope::new(x[i], part(&r.xs_v, i), y[i], part(&r.ys_v, i));
                        bearing(&e, period_deg).to_degrees()
                    })
                    .collect()
            }
            _ => return Err(Refusal::new(&name, "there is neither xc_v and yc_v nor theta_deg", "one of the two")),
        };
        let steps = || t_s.windows(2).map(|w| w[1] - w[0]);
        let interval_s = median(&mut steps().collect::<Vec<_>>());
        let mut stretches: Vec<Vec<f64>> = vec![vec![wrapped_deg[0]]];
        let mut last = wrapped_deg[0];
        let mut followed = vec![last];
        for (step, next) in steps().zip(&wrapped_deg[1..]) {
            last += wrapped(next - last, period_deg);
            followed.push(last);
            match stretches.last_mut() {
                Some(stretch) if step <= GAP * interval_s => stretch.push(last),
                _ => stretches.push(vec![last]),
            }
        }
        let length_s = t_s[t_s.len() - 1] - t_s[0];
        Ok(Self { name, interval_s, stretches, rate_dps: line(t_s, &followed).0, length_s })
    }

    /// Says that the rate goes on and changes throughout, where it does: that is no noise.
    ///
    /// # Errors
    /// Where it is faster than a bias ever changes by, or is.
    fn drift(&self) -> Result<Option<String>, Refusal> {
        let wanted = "a run at rest, or kind = \"rotation\" with what turned it";
        if self.rate_dps.abs() > LARGEST_DPS {
            return Err(Refusal::no_answer(
                &self.name,
                format!("its angle turns at {:.1} deg/s", self.rate_dps),
                wanted,
            ));
        }
        let rates: Vec<(usize, f64)> = std::iter::successors(Some(1usize), |m| Some(2 * m))
            .take_while(|m| *m == 1 || *m as f64 * self.interval_s <= LOOKED_AT_S)
            .filter_map(|m| Some((m, self.rate_that_goes_on(m)?)))
            .collect();
        let longest = rates.iter().map(|(m, _)| *m).max();
        let fastest = rates.iter().map(|(_, rate)| *rate).max_by(f64::total_cmp).filter(|rate| *rate > SLOWEST_DPS);
        let Some(rate) = fastest.filter(|_| !longest.is_some_and(|m| self.forgets_its_rate(m))) else {
            return Ok(None);
        };
        let what = format!("the instrument moves throughout: its rate goes on and changes by {rate:.2} deg/s rms");
        if rate > FASTEST_DPS {
            return Err(Refusal::no_answer(&self.name, what, wanted));
        }
        Ok(Some(format!(
            "{}: {what}; that is motion or drift and no noise, and angle_random_walk_deg_sqrt_h is null",
            self.name
        )))
    }

    /// rms of the mean rates over intervals of so many samples, about their mean, deg/s, where each goes with the next.
    fn rate_that_goes_on(&self, samples: usize) -> Option<f64> {
        let over_s = samples as f64 * self.interval_s;
        let rates: Vec<Vec<f64>> = self
            .stretches
            .iter()
            .map(|s| s.iter().step_by(samples).collect::<Vec<_>>().windows(2).map(|w| (w[1] - w[0]) / over_s).collect())
            .collect();
        let n = rates.iter().map(Vec::len).sum::<usize>();
        if n < FEWEST_INTERVALS {
            return None;
        }
        // few that move are left out by themselves
        let middle = median(&mut rates.iter().flatten().copied().collect::<Vec<_>>());
        let usual = robust_deviation(rates.iter().flatten().map(|r| r - middle));
        let kept = |r: f64| (r - middle).clamp(-DEVIATIONS * usual, DEVIATIONS * usual);
        let square = rates.iter().flatten().map(|r| kept(*r).powi(2)).sum::<f64>() / n as f64;
        let pairs = || rates.iter().flat_map(|r| r.windows(2));
        let product = pairs().map(|w| kept(w[0]) * kept(w[1])).sum::<f64>() / pairs().count().max(1) as f64;
        (product > GOES_ON * square).then(|| square.sqrt())
    }

    /// The angle wanders as of white noise at averaging times well beyond this many samples, over which the rate still goes on:
    /// that is noise that was filtered. What sways returns, and there τσ²(τ) falls with τ; what drifts goes on, and it grows.
    fn forgets_its_rate(&self, samples: usize) -> bool {
        let octaves: Vec<usize> = (0..=BEYOND[1]).map(|octave| samples << octave).collect();
        let wander: Vec<f64> = allan::overlapping(&self.stretches, self.interval_s, &octaves)
            .iter()
            .map(|point| point.tau_s * point.deviation.powi(2))
            .collect();
        let longest = self.stretches.iter().map(Vec::len).max().unwrap_or(0);
        if wander.len() < octaves.len() || longest < FEWEST_LENGTHS * octaves[BEYOND[1]] {
            return false;
        }
        let (below, beyond) = wander.split_at(BEYOND[0]);
        let least = beyond.iter().copied().fold(f64::INFINITY, f64::min);
        let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        most(beyond) < ALIKE * least && most(below) < ALIKE * least
    }

    /// The step of an angle that mostly repeats the row before; none where it does not.
    fn digit(&self) -> Option<f64> {
        let steps = || self.stretches.iter().flat_map(|s| s.windows(2).map(|w| (w[1] - w[0]).abs()));
        let (count, zeros) = steps().fold((0.0, 0.0), |(n, z), d| (n + 1.0, z + f64::from(u8::from(d == 0.0))));
        let largest = steps().fold(0.0, f64::max);
        let least = steps().filter(|d| *d > 1e-9 * largest).fold(largest, f64::min);
        (zeros > MOSTLY * count && least > 0.0).then_some(least)
    }

    /// Leaves out rows that repeat one value for long while the others do not, each as a gap; says so.
    fn without_rows_that_stand_still(&mut self) -> Option<String> {
        let rows: usize = self.stretches.iter().map(Vec::len).sum();
        let parts = || self.stretches.iter().flat_map(|s| s.chunk_by(|a, b| a == b));
        let still: usize = parts().map(<[f64]>::len).filter(|n| *n >= STANDS_STILL).sum();
        let repeat: usize = parts().map(<[f64]>::len).filter(|n| (2..STANDS_STILL).contains(n)).sum();
        if still == 0 || 2 * still > rows || repeat as f64 > SELDOM * (rows - still) as f64 {
            return None;
        }
        let mut kept: Vec<Vec<f64>> = Vec::new();
        for stretch in &self.stretches {
            kept.push(Vec::new());
            for part in stretch.chunk_by(|a, b| a == b) {
                match kept.last_mut() {
                    Some(last) if part.len() < STANDS_STILL => last.extend(part),
                    _ => kept.push(Vec::new()),
                }
            }
        }
        kept.retain(|stretch| !stretch.is_empty());
        self.stretches = kept;
        Some(format!(
            "{}: {still} of {rows} rows at rest repeat one value for {STANDS_STILL} rows or longer, and the others do not: the \
             recording stood still; they are left out, and no difference reaches across",
            self.name
        ))
    }

    /// Leaves out rows in which the instrument moves, each as a gap; says so.
    ///
    /// # Errors
    /// Where it moves too often to be at rest.
    fn without_motion(&mut self) -> Result<Option<String>, Refusal> {
        let moving: Vec<Vec<bool>> = self.stretches.iter().map(|s| moving(s, self.interval_s)).collect();
        let count = moving.iter().flatten().filter(|m| **m).count();
        if count == 0 {
            return Ok(None);
        }
        let rows: usize = self.stretches.iter().map(Vec::len).sum();
        let before: usize = moving.iter().take_while(|m| !m.contains(&true)).map(Vec::len).sum();
        let within = moving.iter().find_map(|m| m.iter().position(|m| *m)).unwrap_or(0);
        let from_s = (before + within) as f64 * self.interval_s;
        let what =
            format!("the instrument moves in {count} of {rows} rows at rest, first {from_s:.1} s after its begin");
        if count as f64 > MOST_MOVING * rows as f64 {
            return Err(Refusal::no_answer(
                &self.name,
                what,
                "a run at rest, or kind = \"rotation\" with what turned it",
            ));
        }
        let split = self.stretches.iter().zip(&moving).flat_map(|(angles, moving)| {
            let rows: Vec<(f64, bool)> = angles.iter().copied().zip(moving.iter().copied()).collect();
            let still = rows.chunk_by(|a, b| a.1 == b.1).filter(|part| !part[0].1);
            still.map(|part| part.iter().map(|(angle, _)| *angle).collect()).collect::<Vec<Vec<f64>>>()
        });
        self.stretches = split.collect();
        if let Some(longest) = self.stretches.iter().max_by_key(|s| s.len()) {
            let t_s: Vec<f64> = (0..longest.len()).map(|i| i as f64 * self.interval_s).collect();
            self.rate_dps = line(&t_s, longest).0;
        }
        Ok(Some(format!("{}: {what}; they are left out, and no difference reaches across", self.name)))
    }
}

/// The rows of a stretch in which the angle moves by far more than it does as a rule, about its mean rate.
fn moving(angles: &[f64], interval_s: f64) -> Vec<bool> {
    let mut out = vec![false; angles.len()];
    for over in OVER.into_iter().filter(|over| angles.len() > FEWEST * over) {
        let mut steps: Vec<f64> = angles.windows(over + 1).map(|w| w[over] - w[0]).collect();
        let usual = median(&mut steps.clone());
        steps.iter_mut().for_each(|d| *d -= usual);
        let bias = FASTEST_DPS * over as f64 * interval_s;
        // an angle in digits steps by one or two of them
        let largest = steps.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        let digit = steps.iter().map(|d| d.abs()).filter(|d| *d > 1e-9 * largest).fold(largest, f64::min);
        let limit = (MOVES * robust_deviation(steps.iter().copied())).max(bias).max(3.0 * digit);
        for (at, _) in steps.iter().enumerate().filter(|(_, d)| d.abs() > limit) {
            out[at..=at + over].fill(true);
        }
    }
    out
}

/// The angle that recorded rates sum up to, θᵢ = θᵢ₋₁ + Ωᵢ Δtᵢ, from their integral by the trapezoidal rule: that takes the mean
/// of neighbours, and half of white noise out of them. What alternates from row to row and is lost in the means is none.
fn summed(t_s: &[f64], integral: &[f64]) -> Vec<f64> {
    let mut rates = vec![0.0];
    for (angle, t) in integral.windows(2).zip(t_s.windows(2)) {
        let mean = (angle[1] - angle[0]) / (t[1] - t[0]);
        rates.push(2.0 * mean - rates[rates.len() - 1]);
    }
    let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let alternates = rates.iter().enumerate().map(|(i, r)| sign(i) * r).sum::<f64>() / rates.len() as f64;
    let mut angle = integral.first().copied().unwrap_or(0.0);
    let mut out = vec![angle];
    for (i, t) in t_s.windows(2).enumerate() {
        angle += (rates[i + 1] - alternates * sign(i + 1)) * (t[1] - t[0]);
        out.push(angle);
    }
    out
}

/// The angle of an envelope: of the pattern, or of the vector where it goes round once a turn.
fn bearing(e: &Envelope<f64>, period_deg: f64) -> f64 {
    if period_deg.to_radians() > 1.5 * PI { e.y_c.atan2(e.x_c) } else { e.pendulum().angle() }
}
