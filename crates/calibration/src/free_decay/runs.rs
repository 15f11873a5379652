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
/// A gap of so many usual steps ends a run.
const LONGEST_GAP: f64 = 20.0;
/// A rate that varies by less than this share of itself is constant.
const CONSTANT_RATE: f64 = 1e-3;

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
    /// length of a stretch, s, as the mean of that much
    pub(crate) span_s: f64,
    /// input rate, rad/s; 0 where it is not known
    pub(crate) rate_rad_s: Vec<f64>,
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
            rate_rad_s: self.rate_rad_s[of.clone()].to_vec(),
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
        let (rates, rate_is_known) = rates(run, rows.clone());
        let clear = clear_of_noise(&z);
        let each = clear.div_ceil(MOST_STRETCHES).max(1);
        let count = clear / each;
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
        let stretch = |i: usize| i * each..(i + 1) * each;
        let mean = |of: &[f64], i: usize| of[stretch(i)].iter().sum::<f64>() / each as f64;
        let seen = (0..count).map(|i| z[stretch(i)].iter().map(stokes::of).sum::<State>() / each as f64).collect();
        Ok(Self {
            number,
            name,
            held: run.role == Role::Holdout,
            t_s: (0..count).map(|i| mean(t_s, i)).collect(),
            seen,
            // of n instants, not of all between them
            span_s: step * ((each * each - 1) as f64).sqrt(),
            rate_rad_s: (0..count).map(|i| mean(&rates, i)).collect(),
            rate_is_known,
            envelopes: (0..count).map(|i| at_rest(&t_s[stretch(i)], &z[stretch(i)])).collect(),
            in_noise: z.len() - clear,
            rows: z.len(),
        })
    }
}

/// Whether the energy of the last fifth exceeds that of the first by more than unequal gains make of a pattern that turns.
fn grows(z: &[Envelope<f64>]) -> bool {
    let fifth = z.len() / 5;
    let energy = |part: &[Envelope<f64>]| part.iter().map(|e| stokes::of(e)[0]).sum::<f64>();
    energy(&z[z.len() - fifth..]) > GROWS * energy(&z[..fifth])
}

/// The rows up to the first long gap.
fn whole(t_s: &[f64], rows: Range<usize>) -> Range<usize> {
    let t = &t_s[rows.clone()];
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let longest = LONGEST_GAP * median(&mut steps);
    let end = t.windows(2).position(|w| w[1] - w[0] > longest).map_or(rows.end, |at| rows.start + at + 1);
    rows.start..end
}

/// Input rate at each row, rad/s, and whether it is known.
fn rates(run: &Run, rows: Range<usize>) -> (Vec<f64>, bool) {
    let r = &run.recording;
    let constant = |dps: f64, known: bool| (vec![dps.to_radians(); rows.len()], known);
    if let Some(table) = &r.table_deg {
        let turned: Vec<f64> = turned(&table[rows.clone()]).iter().map(|a| a.to_degrees()).collect();
        return constant(line(&r.t_s[rows.clone()], &turned).0, true);
    }
    if let Some(rate) = &r.rate_dps {
        let of = &rate[rows.clone()];
        let mean = of.iter().sum::<f64>() / of.len().max(1) as f64;
        let furthest = of.iter().fold(0.0, |m: f64, v| m.max((v - mean).abs()));
        if furthest <= CONSTANT_RATE * mean.abs() {
            return constant(mean, true);
        }
        return (of.iter().map(|v| v.to_radians()).collect(), true);
    }
    constant(0.0, false)
}

/// Rows up to which the amplitude stands clear of the noise of its channels.
fn clear_of_noise(z: &[Envelope<f64>]) -> usize {
    let states: Vec<State> = z.iter().map(stokes::of).collect();
    // in V along three directions; what changes from row to row looks like noise, and the quietest is the best witness
    let along = |k: usize| white_noise(&states.iter().map(|u| 0.5 * u[k] / u[0].sqrt()).collect::<Vec<_>>());
    let noise = along(1).min(along(2)).min(along(3));
    let limit = (CLEAR_OF_NOISE * noise).powi(2);
    let each = (z.len() / 200).max(1);
    let below = states.chunks(each).position(|c| c.iter().map(|u| u[0]).sum::<f64>() <= limit * c.len() as f64);
    below.map_or(z.len(), |at| at * each)
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
    }
}
