//! Whether the drives put out whole steps of a converter, and of how many volts: from what neither loop can hide.
//!
//! The energy balance, ȧ/a = −1/τ − G f_as/a, and the quadrature balance, q̇/a = G f_qc/a + …, have the forces themselves in them. Drives
//! that round each axis' command put out a sawtooth beside it, of a size that the step says and of one phase for every command: no
//! other law of the amplitude has it. A search over the step asks how much of both balances its forces explain, beside one gain and
//! what goes with the second and the fourth harmonic of the pattern in each run, which readout, damping and split make.
//!
//! It needs no model of the instrument, and refuses to look at the angle: the fit takes the forces from here.

use cvg_model::effects::EffectId;
use rayon::prelude::*;

use crate::data::quantised_drives::balances::{Balance, Pair};
use crate::data::track::Track;
use crate::facts::{EffectReport, Estimate, ParameterReport};
use crate::model::hypothesis::Origin;
use crate::recording::Role;

mod balances;
mod within_a_step;

/// Pairs of neighbouring samples in which a step is looked for, those that tell the gain of the drives, and the fewest that tell a step.
const LOOKED_AT: usize = 1500;
const TELL_THE_GAIN: usize = 6000;
const FEWEST: usize = 300;
/// Fewest pairs of a run that is looked at: more than what is taken out of it.
const FEWEST_OF_A_RUN: usize = 40;
/// So many of the largest commands may be spikes.
const SPIKES: usize = 10;
/// Steps that are tried: from this share of the largest command, down to the one that this many fill it. Finer ones leave the angle alone.
const LARGEST_STEP: f64 = 2.0;
const FINEST: f64 = 200.0;
/// From one step that is tried to the next the largest command moves by this share of a step.
const SEARCHED: f64 = 0.15;
/// Harmonics of the pattern that the search takes out of both balances, as readouts that are not linear make them, and those beside which the
/// step is refined.
const SEARCHED_BESIDE: [f64; 2] = [2.0, 4.0];
const REFINED_BESIDE: [f64; 1] = [2.0];
/// Steps that are tried in between, around the best, and how often that is halved.
const BETWEEN: usize = 80;
const REFINED: usize = 24;
/// Beside harmonics of the pattern rounded forces have to act with this share of the drives' gain: where samples are too far apart, or loops hold
/// commands at edges, they explain less, and of another step than the drives' (engineering choice).
const LEAST_SHOWN: f64 = 0.45;
/// How well the outermost edge is told, as a share of a step: commands that loops hold at edges moved it by up to a tenth (engineering choice).
const EDGES: f64 = 0.05;
/// What a step has to gain in 2 ln likelihood after its price, and the share of the mean square that it may leave: forces that are not
/// rounded gain up to 20 before it (engineering choice).
const LEAST_GAIN: f64 = 40.0;
const LARGEST_SHARE: f64 = 0.98;

/// Drives that put out whole steps.
#[derive(Debug, Clone)]
pub(crate) struct Quantisation {
    /// V
    pub(crate) step: Estimate,
    /// gain of the drives, 1/s per V of command over amplitude, as the quadrature balance has it; none where the step is no more than likely: rounded
    /// forces explain something, and less than they would have to
    pub(crate) force_gain: Option<Estimate>,
    /// the largest command of an axis, V
    largest: f64,
    /// in 2 ln likelihood after its price
    gain: f64,
    /// of the mean square of both balances, what is left
    share: f64,
}

/// Both balances of a campaign, each by how much of it the commands leave.
struct Balances<'a> {
    all: [Vec<Balance<'a>>; 2],
    weights: [f64; 2],
    rows: f64,
}

impl<'a> Balances<'a> {
    /// The balances of all runs beside these harmonics of the pattern.
    fn new(runs: &'a [Vec<Pair>], harmonics: &[f64]) -> Self {
        let all = [0, 1].map(|witness| runs.iter().map(|run| Balance::new(run, witness, harmonics)).collect());
        let rows = runs.iter().map(Vec::len).sum::<usize>() as f64;
        let mut balances = Self { all, weights: [0.0; 2], rows: 2.0 * rows };
        balances.weights =
            [[1.0, 0.0], [0.0, 1.0]].map(|alone| rows / balances.left_by(None, alone).max(f64::MIN_POSITIVE));
        balances
    }

    /// Squares of what the forces do, the products with what happened, and the squares of that.
    fn sums(&self, step: Option<f64>, weights: [f64; 2]) -> [f64; 3] {
        let (mut squares, mut products, mut changes) = (0.0, 0.0, 0.0);
        for (balances, weight) in self.all.iter().zip(weights).filter(|(_, weight)| *weight > 0.0) {
            for balance in balances {
                let pushed = balance.pushed(step);
                squares += weight * pushed.norm_squared();
                products += weight * pushed.dot(&balance.change);
                changes += weight * balance.change.norm_squared();
            }
        }
        [squares, products, changes]
    }

    /// What the forces leave of the balances with the gain that leaves least; a gain below zero is none.
    fn left_by(&self, step: Option<f64>, weights: [f64; 2]) -> f64 {
        let [squares, products, changes] = self.sums(step, weights);
        if products > 0.0 { changes - products * products / squares } else { changes }
    }

    /// The gain with which rounded forces leave least.
    fn gain(&self, step: f64) -> f64 {
        let [squares, products, _] = self.sums(Some(step), self.weights);
        products / squares
    }

    fn left(&self, step: Option<f64>) -> f64 {
        self.left_by(step, self.weights)
    }

    /// The step between two that leaves least, V, and how far the noise may move it.
    fn refined(&self, [low, high]: [f64; 2]) -> (f64, f64) {
        let at = |i: usize| low + (high - low) * i as f64 / BETWEEN as f64;
        let (best, mut least) = least_of((0..=BETWEEN).map(|i| (at(i), self.left(Some(at(i))))));
        let (mut step, mut reach) = (best, (high - low) / BETWEEN as f64);
        for _ in 0..REFINED {
            reach *= 0.5;
            for other in [step - reach, step + reach] {
                let left = self.left(Some(other));
                if left < least {
                    (step, least) = (other, left);
                }
            }
        }
        let more = least * (1.0 + 1.0 / self.rows);
        let farthest = |away: f64| {
            let (mut near, mut far) = (0.0, away);
            for _ in 0..REFINED {
                let middle = 0.5 * (near + far);
                if self.left(Some(step + middle)) < more { near = middle } else { far = middle }
            }
            far.abs()
        };
        (step, farthest(high - low).max(farthest(low - high)))
    }
}

/// Of values and what they leave, the one that leaves least.
fn least_of(all: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default()
}

/// So many pairs of all runs, each with the track that it is of.
fn pairs<'a>(tracks: impl Iterator<Item = &'a Track> + Clone, count: usize) -> Vec<(Vec<Pair>, &'a Track)> {
    let rows: usize = tracks.clone().map(|track| track.samples(Role::Fit)).sum();
    let stride = rows.div_ceil(count).max(1);
    let all = tracks.map(|track| (Pair::fitted(track, stride), track));
    all.filter(|(run, _)| run.len() > FEWEST_OF_A_RUN).collect()
}

/// Whether the drives of these runs put out whole steps.
pub(crate) fn quantisation<'a>(tracks: impl Iterator<Item = &'a Track> + Clone) -> Option<Quantisation> {
    if !tracks.clone().all(Track::records_the_loops) {
        return None;
    }
    let runs: Vec<Vec<Pair>> = pairs(tracks.clone(), LOOKED_AT).into_iter().map(|(run, _)| run).collect();
    let mut commands: Vec<f64> = runs.iter().flatten().map(Pair::largest).filter(|v| v.is_finite()).collect();
    if commands.len() < FEWEST {
        return None;
    }
    commands.sort_by(f64::total_cmp);
    let largest = commands[commands.len() - 1 - SPIKES];
    if largest <= 0.0 {
        return None;
    }
    let wide = Balances::new(&runs, &SEARCHED_BESIDE);
    let next = |step: &f64| Some(step * (1.0 - SEARCHED * (step / largest).min(1.0)));
    let tried = std::iter::successors(Some(LARGEST_STEP * largest), next);
    let tried: Vec<f64> = tried.take_while(|step| *step > largest / FINEST).collect();
    let left: Vec<f64> = tried.par_iter().map(|step| wide.left(Some(*step))).collect();
    let (found, least) = least_of(tried.iter().copied().zip(left));
    let (before, price) = (wide.left(None), 2.0 * (tried.len() as f64).ln());
    let gain = wide.rows * (before / least).ln() - price;
    if !(gain > LEAST_GAIN && least < LARGEST_SHARE * before) {
        return None;
    }
    let around = SEARCHED * found * (found / largest).min(1.0);
    let around = [found - around, found + around];
    let ((step, deviation), (other, _)) = (Balances::new(&runs, &REFINED_BESIDE).refined(around), wide.refined(around));
    // what is taken out of the balances has a share of what steps do to them, and what is put out at an edge moves it
    let by_edges = EDGES * step * (step / largest).min(1.0);
    let told = Estimate::new(step, deviation.hypot(step - other).hypot(by_edges));
    let force_gain = within_a_step::gain(&pairs(tracks, TELL_THE_GAIN), step);
    let force_gain = force_gain.filter(|gain| wide.gain(other) > LEAST_SHOWN * gain.value);
    Some(Quantisation { step: told, force_gain, largest, gain, share: least / before })
}

impl Quantisation {
    /// Has a track count with what the drives put out.
    pub(crate) fn apply(&self, track: &mut Track) {
        if let Some(gain) = self.force_gain {
            let added = within_a_step::put_out(track, self.step.value, gain.value);
            track.put_out(&added);
        }
    }

    /// What is reported of it, where it is told.
    pub(crate) fn report(&self) -> Option<EffectReport> {
        let d = EffectId::DriveQuantisation.description();
        self.force_gain.map(|_| EffectReport {
            id: d.id.into(),
            origin: Origin::Discovered,
            parameters: vec![ParameterReport {
                name: d.parameters[0].name.into(),
                unit: d.parameters[0].unit.into(),
                value: self.step.value,
                ci95: Some(self.step.ci95),
            }],
            heldout_rms_deg: None,
            evidence: format!(
                "{}; told by the energy and the quadrature balance, of which rounded forces leave {:.1} % of the mean square, a gain of \
                 {:.0} in 2 ln likelihood after its price; the largest command of an axis is {:.1} steps. The fit takes the mean of what \
                 is put out for the commands, and nothing is undone",
                d.signature,
                100.0 * self.share,
                self.gain,
                self.largest / self.step.value
            ),
            confounded_with: Vec::new(),
            separated_by: None,
        })
    }

    /// How far a force may be from the one that is taken for it, as a standard deviation, V: a loop that holds its command at the edge of
    /// a step lets the drive put out either, and anything between in the mean.
    pub(crate) fn unknown_force(&self) -> f64 {
        self.step.value / 12f64.sqrt()
    }

    /// What has to be said of it.
    pub(crate) fn said(&self) -> String {
        if self.force_gain.is_none() {
            return format!(
                "the drives put out other forces than they are commanded, as a converter of few bits makes them, with steps of {:.2} V or a multiple: \
                 the recording does not tell what; what is open so widens the intervals of the drives and of the anisodamping, and no \
                 spring and no lag of the drives is claimed; rows that are closer together would tell more",
                self.step.value
            );
        }
        format!(
            "the drives put out whole steps of {:.4} V: the fit counts with the mean of what they put out between two rows, as the commands and what \
             amplitude and quadrature do tell it; what is open within a step widens the intervals of the drives and of the anisodamping, and no \
             spring and no lag of the drives is claimed; no calibration undoes it, a finer converter would, or a dither of a step",
            self.step.value
        )
    }
}
