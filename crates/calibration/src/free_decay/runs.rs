//! Decays made ready: means of (E, R, S, Q) over short stretches, with the rate of the input and the phase, as far as the
//! vibration stands clear of its noise.

use std::ops::Range;

use cvg_model::Envelope;

use super::stokes::{self, State};
use crate::carrier::phased;
use crate::data::table::turned;
use crate::error::Refusal;
use crate::numerics::statistics::{line, median, white_noise};
use crate::recording::{Role, Run};

/// Stretches that a run is divided into at most.
const MOST_STRETCHES: usize = 1500;
/// An energy that grows by this factor, while it should fall, is none of a decay: gains that differ by a tenth make 1.2 of it.
const GROWS: f64 = 1.5;
/// Stretches that a run needs.
const FEWEST_STRETCHES: usize = 24;
/// A vibration below this many times its noise is left out: what unequal noises of the channels add to R and S is then
/// below a hundredth of the vibration.
const CLEAR_OF_NOISE: f64 = 10.0;
/// A vibration that falls below that, for no more than this part of a run, and has so many times the energy of the limit again,
/// goes on; engineering choice.
const LONGEST_SILENCE: usize = 20;
const COMES_BACK: f64 = 4.0;
/// Stretches on each side that an envelope is smoothed over, the first that it changes by less than this share of itself over:
/// then the parabola errs by some hundredths. Engineering choices.
const SMOOTHED_HALVES: [usize; 5] = [48, 24, 12, 6, 3];
const SMOOTHED_CHANGE: f64 = 0.5;
/// A gap of so many usual steps ends a run.
const LONGEST_GAP: f64 = 20.0;
/// A rate that varies by less than this share of itself is constant.
const CONSTANT_RATE: f64 = 1e-3;
/// A table that leaves a line by more than this many times its own noise does not turn evenly; engineering choice.
const EVEN_TABLE: f64 = 2.0;
/// Share of its largest value to which a column is written, at nine digits.
const WRITTEN_TO: f64 = 1e-8;

/// A decay.
#[derive(Debug, Clone)]
pub(crate) struct DecayRun {
    /// its place in the campaign
    pub(crate) number: usize,
    pub(crate) name: String,
    /// nothing is fitted to it
    pub(crate) held: bool,
    /// middle of each stretch, s
    pub(crate) t_s: Vec<f64>,
    /// mean (E, R, S, Q) of each stretch, V²
    pub(crate) seen: Vec<State>,
    /// mean envelope of each stretch as it was recorded, with its phase, less what of its noise its neighbours do not share
    pub(crate) means: Vec<Envelope<f64>>,
    /// the envelopes are another demodulator's: this program's own leaves the rest point out
    pub(crate) may_be_offset: bool,
    /// length of a stretch, s, as the mean of that much
    pub(crate) span_s: f64,
    /// input rate at the middle of each stretch, rad/s; 0 where it is not known
    pub(crate) rate_rad_s: Vec<f64>,
    /// mean input rate from the middle of the stretch before to that of each, rad/s
    pub(crate) step_rate_rad_s: Vec<f64>,
    /// the rate was recorded or stated
    pub(crate) rate_is_known: bool,
    /// envelope at the middle of each stretch, and how fast its phase ran there, rad/s
    pub(crate) envelopes: Vec<(Envelope<f64>, f64)>,
    /// rows that were left out at the end, in the noise
    pub(crate) in_noise: usize,
    pub(crate) rows: usize,
}

impl DecayRun {
    pub(crate) fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Some of its stretches.
    pub(crate) fn part(&self, of: Range<usize>) -> Self {
        Self {
            name: self.name.clone(),
            t_s: self.t_s[of.clone()].to_vec(),
            seen: self.seen[of.clone()].to_vec(),
            means: self.means[of.clone()].to_vec(),
            rate_rad_s: self.rate_rad_s[of.clone()].to_vec(),
            step_rate_rad_s: self.step_rate_rad_s[of.clone()].to_vec(),
            envelopes: self.envelopes[of].to_vec(),
            ..*self
        }
    }

    pub(crate) fn duration_s(&self) -> f64 {
        self.t_s.last().copied().unwrap_or(0.0) - self.t_s.first().copied().unwrap_or(0.0)
    }

    pub(crate) fn mean_rate(&self) -> f64 {
        self.rate_rad_s.iter().sum::<f64>() / self.len().max(1) as f64
    }

    /// Root mean square of the input rate, rad/s: of a table that swings, the mean is nothing.
    pub(crate) fn usual_rate(&self) -> f64 {
        (self.rate_rad_s.iter().map(|r| r * r).sum::<f64>() / self.len().max(1) as f64).sqrt()
    }

    /// What the input has turned since the first stretch, rad.
    pub(crate) fn turned_rad(&self) -> Vec<f64> {
        let mut sum = 0.0;
        let steps = (0..self.len()).map(|i| {
            sum += if i > 0 { self.step_rate_rad_s[i] * (self.t_s[i] - self.t_s[i - 1]) } else { 0.0 };
            sum
        });
        steps.collect()
    }

    /// Makes a run ready.
    ///
    /// # Errors
    /// A run that is too short, or has no vibration.
    pub(crate) fn new(number: usize, run: &Run) -> Result<Self, Refusal> {
        let name = run.file.display().to_string();
        let rows = whole(&run.recording.t_s, run.settled()?);
        let r = &run.recording;
        let column = |values: &Option<Vec<f64>>| values.as_deref().map(|v| v[rows.clone()].to_vec());
        let (Some(xc), Some(xs), Some(yc), Some(ys)) =
            (column(&r.xc_v), column(&r.xs_v), column(&r.yc_v), column(&r.ys_v))
        else {
            return Err(Refusal::new(
                &name,
                "a free decay without all four of its channels",
                "xc_v, xs_v, yc_v and ys_v",
            ));
        };
        let t_s = &r.t_s[rows.clone()];
        let z: Vec<Envelope<f64>> = (0..t_s.len()).map(|i| Envelope::new(xc[i], xs[i], yc[i], ys[i])).collect();
        let (input, rate_is_known) = input(run, rows.clone());
        let (clear, silent) = clear_of_noise(&z);
        let each = clear.div_ceil(MOST_STRETCHES).max(1);
        let stretches = stretches(&silent[..clear], each);
        let count = stretches.len();
        if count < FEWEST_STRETCHES {
            let problem = format!("only {clear} rows of a vibration that stands clear of its noise");
            return Err(Refusal::no_answer(&name, problem, "a longer decay, or one that begins with more amplitude"));
        }
        if grows(&z[..clear]) {
            let problem = "the amplitude grows: this is no free decay, or its rows stand from last to first";
            return Err(Refusal::no_answer(&name, problem, "a resonator that rings without loops or forces"));
        }
        let mut steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
        let step = median(&mut steps);
        let stretch = |i: usize| stretches[i].clone();
        let mean = |of: &[f64], i: usize| of[stretch(i)].iter().sum::<f64>() / each as f64;
        let middles: Vec<f64> = (0..count).map(|i| mean(t_s, i)).collect();
        let (rate_rad_s, step_rate_rad_s) = input.of_stretches(&middles, mean);
        let seen = (0..count).map(|i| z[stretch(i)].iter().map(stokes::of).sum::<State>() / each as f64).collect();
        Ok(Self {
            number,
            name,
            held: run.role == Role::Holdout,
            t_s: middles,
            seen,
            means: smoothed(&(0..count).map(|i| middle_of(&z[stretch(i)])).collect::<Vec<_>>()),
            may_be_offset: r.reference_hz.is_none(),
            // of n instants, not of all between them
            span_s: step * ((each * each - 1) as f64).sqrt(),
            rate_rad_s,
            step_rate_rad_s,
            rate_is_known,
            envelopes: (0..count).map(|i| at_rest(&t_s[stretch(i)], &z[stretch(i)])).collect(),
            in_noise: z.len() - clear,
            rows: z.len(),
        })
    }
}

fn middle_of(z: &[Envelope<f64>]) -> Envelope<f64> {
    z.iter().fold(Envelope::zero(), |sum, e| sum + *e) * (1.0 / z.len().max(1) as f64)
}

/// Each value by the parabola through its neighbours, as many as the envelope changes little over: what multiplies an offset must
/// not have the noise that the offset is looked for in.
fn smoothed(z: &[Envelope<f64>]) -> Vec<Envelope<f64>> {
    let size = |e: &Envelope<f64>| stokes::of(e)[0].sqrt();
    let changes_little = |half: usize| {
        let mut changes: Vec<f64> =
            z.iter().zip(z.iter().skip(half)).map(|(a, b)| size(&(*b - *a)) / size(a).max(f64::MIN_POSITIVE)).collect();
        2 * half < z.len() && median(&mut changes) < SMOOTHED_CHANGE
    };
    let Some(half) = SMOOTHED_HALVES.into_iter().find(|half| changes_little(*half)) else { return z.to_vec() };
    let place = |at: usize, middle: usize| (at as f64 - middle as f64) / half as f64;
    let power = |n: i32| (0..=2 * half).map(|i| place(i, half).powi(n)).sum::<f64>();
    let (s0, s2, s4) = (power(0), power(2), power(4));
    (0..z.len())
        .map(|i| {
            let middle = i.clamp(half, z.len() - 1 - half);
            let at = place(i, middle);
            let weight = |u: f64| {
                let (even, curved) = (s4 - u * u * s2, u * u * s0 - s2);
                (even + at * at * curved) / (s0 * s4 - s2 * s2) + at * u / s2
            };
            let near = middle - half..=middle + half;
            near.fold(Envelope::zero(), |sum, j| sum + z[j] * weight(place(j, middle)))
        })
        .collect()
}

/// Whether the energy of the last fifth exceeds that of the first by more than unequal gains make of a pattern that turns.
fn grows(z: &[Envelope<f64>]) -> bool {
    let fifth = z.len() / 5;
    let energy = |part: &[Envelope<f64>]| part.iter().map(|e| stokes::of(e)[0]).sum::<f64>();
    energy(&z[z.len() - fifth..]) > GROWS * energy(&z[..fifth])
}

/// Stretches of so many rows, none of them silent, none across what is.
fn stretches(silent: &[bool], each: usize) -> Vec<Range<usize>> {
    let mut out = Vec::with_capacity(silent.len() / each);
    let mut first = 0;
    for (i, is_silent) in silent.iter().enumerate() {
        if *is_silent {
            first = i + 1;
        } else if i + 1 - first == each {
            out.push(first..i + 1);
            first = i + 1;
        }
    }
    out
}

/// The rows between two long gaps, where there are most.
fn whole(t_s: &[f64], rows: Range<usize>) -> Range<usize> {
    let t = &t_s[rows.clone()];
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let longest = LONGEST_GAP * median(&mut steps);
    let ends = (1..t.len()).filter(|&i| t[i] - t[i - 1] > longest).chain([t.len()]);
    let (mut from, mut most) = (0, 0..0);
    for end in ends {
        if end - from > most.len() {
            most = from..end;
        }
        from = end;
    }
    rows.start + most.start..rows.start + most.end
}

/// The rotation of the input, as it was recorded.
enum Input {
    /// even, rad/s
    Even(f64),
    /// the angle that it has turned to at each row, rad
    Turned(Vec<f64>),
}

impl Input {
    /// The rate at each of the stretches whose `middles` these are, s, and the mean rate from the one before to it, rad/s;
    /// `mean` takes the mean of a column over a stretch.
    fn of_stretches(&self, middles: &[f64], mean: impl Fn(&[f64], usize) -> f64) -> (Vec<f64>, Vec<f64>) {
        let count = middles.len();
        let angles: Vec<f64> = match self {
            Self::Even(rate) => return (vec![*rate; count], vec![*rate; count]),
            Self::Turned(angles) => (0..count).map(|i| mean(angles, i)).collect(),
        };
        let between = |i: usize, j: usize| (angles[j] - angles[i]) / (middles[j] - middles[i]).max(f64::MIN_POSITIVE);
        let last = count.saturating_sub(1);
        let at = (0..count).map(|i| between(i.saturating_sub(1), (i + 1).min(last))).collect();
        let steps = (0..count).map(|i| between(i.max(1) - 1, i.max(1).min(last))).collect();
        (at, steps)
    }
}

/// How the input turned over some rows, and whether it is known.
fn input(run: &Run, rows: Range<usize>) -> (Input, bool) {
    let r = &run.recording;
    let t_s = &r.t_s[rows.clone()];
    if let Some(table) = &r.table_deg {
        let angles = turned(&table[rows], t_s);
        let (rate, begin) = line(t_s, &angles);
        let left: Vec<f64> = t_s.iter().zip(&angles).map(|(t, a)| a - begin - rate * t).collect();
        let rms = (left.iter().map(|v| v * v).sum::<f64>() / left.len().max(1) as f64).sqrt();
        // a line rests the noise of the table, as long as there is nothing else beside it
        let is_even = rms <= EVEN_TABLE * white_noise(&left) || rms <= rounding(&angles);
        return (if is_even { Input::Even(rate) } else { Input::Turned(angles) }, true);
    }
    if let Some(rate) = &r.rate_dps {
        let of = &rate[rows];
        let mean = of.iter().sum::<f64>() / of.len().max(1) as f64;
        let furthest = of.iter().fold(0.0, |m: f64, v| m.max((v - mean).abs()));
        if furthest <= CONSTANT_RATE * mean.abs() {
            return (Input::Even(mean.to_radians()), true);
        }
        let mut angles = vec![0.0; of.len()];
        for i in 1..of.len() {
            angles[i] = angles[i - 1] + (0.5 * (of[i] + of[i - 1])).to_radians() * (t_s[i] - t_s[i - 1]);
        }
        return (Input::Turned(angles), true);
    }
    (Input::Even(0.0), false)
}

/// What the arithmetic alone leaves of a line through these angles, rad.
fn rounding(angles: &[f64]) -> f64 {
    WRITTEN_TO * angles.iter().fold(1.0, |m: f64, a| m.max(a.abs()))
}

/// Rows up to which the amplitude stands clear of the noise of its channels, and which rows are silent before: a channel that
/// fails for a moment and comes back is no end of a decay.
fn clear_of_noise(z: &[Envelope<f64>]) -> (usize, Vec<bool>) {
    let states: Vec<State> = z.iter().map(stokes::of).collect();
    // in V along three directions; what changes from row to row looks like noise, and the quietest is the best witness
    let rings = || states.iter().filter(|u| u[0] > 0.0);
    let along = |k: usize| white_noise(&rings().map(|u| 0.5 * u[k] / u[0].sqrt()).collect::<Vec<_>>());
    let noise = along(1).min(along(2)).min(along(3));
    let limit = (CLEAR_OF_NOISE * noise).powi(2);
    let each = (z.len() / 200).max(1);
    let chunks: Vec<f64> = states.chunks(each).map(|c| c.iter().map(|u| u[0]).sum::<f64>() / c.len() as f64).collect();
    let mut silent = vec![false; z.len()];
    let mut at = 0;
    while let Some(down) = (at..chunks.len()).find(|&i| chunks[i] <= limit) {
        let back = (down..chunks.len()).find(|&i| chunks[i] > limit).unwrap_or(chunks.len());
        // at the end of a decay the amplitude wavers about the limit
        let is_back = chunks[back..].iter().any(|e| *e > COMES_BACK * limit);
        if !is_back || back - down > chunks.len() / LONGEST_SILENCE {
            return (down * each, silent);
        }
        // the vibration is in part of the chunks next to it
        silent[down.saturating_sub(1) * each..((back + 1) * each).min(z.len())].fill(true);
        at = back;
    }
    (z.len(), silent)
}

/// The mean envelope of a stretch as it is at its middle, its phase brought to rest, and the phase's rate, rad/s.
fn at_rest(t_s: &[f64], z: &[Envelope<f64>]) -> (Envelope<f64>, f64) {
    let middle = t_s.iter().sum::<f64>() / t_s.len().max(1) as f64;
    let (mut cos, mut sin) = (0.0, 0.0);
    for w in z.windows(2) {
        let (c, s) = overlap(&w[0], &w[1]);
        (cos, sin) = (cos + c, sin + s);
    }
    let dt = (t_s[t_s.len() - 1] - t_s[0]) / (t_s.len().max(2) - 1) as f64;
    let rate = if dt > 0.0 { sin.atan2(cos) / dt } else { 0.0 };
    let sum = t_s.iter().zip(z).fold(Envelope::zero(), |sum, (t, e)| sum + phased(e, -rate * (t - middle)));
    (sum * (1.0 / t_s.len().max(1) as f64), rate)
}

/// Z₁†Z₂, real and imaginary: its angle is how much further the phase of the second is. X = x_c − i x_s.
pub(crate) fn overlap(one: &Envelope<f64>, other: &Envelope<f64>) -> (f64, f64) {
    let cos = one.x_c * other.x_c + one.x_s * other.x_s + one.y_c * other.y_c + one.y_s * other.y_s;
    let sin = one.x_s * other.x_c - one.x_c * other.x_s + one.y_s * other.y_c - one.y_c * other.y_s;
    (cos, sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_overlap_is_the_phase_between_two_envelopes() {
        let e = Envelope::new(0.8, 0.1, -0.3, 0.2);
        for phase in [-2.0, 0.3, 1.4] {
            let (cos, sin) = overlap(&e, &phased(&e, phase));
            assert!((sin.atan2(cos) - phase).abs() < 1e-12);
        }
    }

    #[test]
    fn a_decay_from_last_to_first_is_none() {
        let z: Vec<Envelope<f64>> = (0..100)
            .map(|i| Envelope::zero() + Envelope::new(1.0, 0.0, 0.5, 0.0) * (-0.01 * f64::from(i)).exp())
            .collect();
        assert!(!grows(&z) && grows(&z.iter().rev().copied().collect::<Vec<_>>()));
    }

    #[test]
    fn a_gap_ends_a_decay() {
        let mut t: Vec<f64> = (0..100).map(f64::from).collect();
        t[60..].iter_mut().for_each(|t| *t += 50.0);
        assert_eq!(whole(&t, 5..100), 5..60);
        assert_eq!(whole(&t, 30..100), 60..100);
    }

    #[test]
    fn a_smoothed_envelope_has_its_phase_and_little_of_its_noise() {
        let ring =
            |i: u32| phased(&Envelope::new(1.0, 0.1, 0.5, 0.0), 0.008 * f64::from(i)) * (-0.004 * f64::from(i)).exp();
        let noise = crate::numerics::statistics::remembered(0.0, 2000, 5);
        let noisy = |i: u32| {
            let n = |k: usize| 1e-2 * noise[4 * i as usize + k];
            ring(i) + Envelope::new(n(0), n(1), n(2), n(3))
        };
        let smooth = smoothed(&(0..500).map(noisy).collect::<Vec<_>>());
        let off = |i: u32| stokes::of(&(smooth[i as usize] - ring(i)))[0].sqrt();
        assert!((0..500).map(|i| off(i).powi(2)).sum::<f64>() < 0.1 * 500.0 * 4e-4);
        let exact = smoothed(&(0..500).map(ring).collect::<Vec<_>>());
        assert!((0..500u32).all(|i| stokes::of(&(exact[i as usize] - ring(i)))[0].sqrt() < 0.02));
    }

    #[test]
    fn a_moment_of_silence_is_left_out_and_ends_no_decay() {
        let ring = |i: u32| Envelope::new(1.0, 0.0, 0.5, 0.0) * (-0.004 * f64::from(i)).exp();
        let noise = crate::numerics::statistics::remembered(0.0, 4000, 5);
        let mut z: Vec<Envelope<f64>> = (0..1000u32)
            .map(|i| {
                let n = |k: usize| 1e-3 * noise[4 * i as usize + k];
                Envelope::new(n(0), n(1), n(2), n(3)) + ring(i)
            })
            .collect();
        z[300..320].fill(Envelope::zero());
        let (clear, silent) = clear_of_noise(&z);
        assert_eq!(clear, 1000);
        assert!(silent[300..320].iter().all(|s| *s) && silent.iter().filter(|s| **s).count() < 40);
        let parts = stretches(&silent, 4);
        assert!(parts.iter().all(|p| p.len() == 4 && !silent[p.clone()].contains(&true)) && parts.len() > 235);
        z[300..].fill(Envelope::zero());
        assert_eq!(clear_of_noise(&z).0, 300);
    }

    #[test]
    fn an_input_that_speeds_up_turns_by_what_its_table_says() {
        let t: Vec<f64> = (0..=200).map(|i| 0.1 * f64::from(i)).collect();
        // ½ · 0.02 t², which the rate at the end of each step would make larger
        let angles = t.iter().map(|t| 0.01 * t * t).collect();
        let (at, steps) = Input::Turned(angles).of_stretches(&t, |of, i| of[i]);
        let sum: f64 = (1..t.len()).map(|i| steps[i] * 0.1).sum();
        assert!((sum - 4.0).abs() < 1e-9 && (at[100] - 0.2).abs() < 1e-9, "{sum} {}", at[100]);
    }
}
