//! How strong each kind of coloured noise is: the most likely strengths, told from the unknowns of the instrument.
//!
//! The likelihood is the restricted one (Patterson and Thompson 1971): that of what the residuals say once the unknowns
//! are taken out, so that unknowns which follow the noise do not make it look smaller. No overall scale is fitted: the
//! white part is measured from neighbouring samples, and a scale would take a walk's place.

use rayon::prelude::*;

use crate::estimation::coloured_noise::{ColouredNoise, Filter, Observation, Surroundings};
use crate::estimation::normal::Normal;
use crate::numerics::simplex::least;

/// Where the search for each kind begins: what a good instrument on a good table shows (0.4°/√h; 1e-4 of a rate and
/// 2e-4 of a gain over a run).
const USUAL: ColouredNoise = ColouredNoise { walk: 1.5e-8, table: 2e-9, gains: 1.5e-8 };
/// Below these there is none: a walk of 1e-9 rad in a second, and relative wanderings of 1e-7 and 3e-7, are beyond
/// what any converter shows.
const LEAST: [f64; KINDS] = [1e-18, 1e-14, 1e-13];
/// The walk, the table and the gains.
const KINDS: usize = 3;
/// Steps in ln of a search.
const STEP: f64 = 2.0;
/// Shares of a usual strength at which a kind is tried: a search that begins far too strong ends in a neighbour's valley.
const STARTING_SHARES: [f64; 5] = [1e-4, 1e-3, 0.01, 0.1, 1.0];
/// A search ends where ln likelihood (× 2) and strengths (ln) change by less, and a kind that brings less is not there: a tenth
/// of what tells strengths apart.
const NEAR: f64 = 0.1;

/// Samples of one segment, averaged and thinned to as many as tell how strong its noise is.
pub(crate) struct Sampled {
    pub(crate) surroundings: Surroundings,
    n: usize,
    /// per sample: time since the one before, slope of the gains, precession, sine and cosine, columns
    values: Vec<f64>,
    // the block that is being averaged
    averaged: usize,
    thinned: usize,
    block: Vec<f64>,
    in_block: usize,
    blocks: usize,
    waited_s: f64,
}

/// Values of a sample before its columns.
const AHEAD: usize = 5;

impl Sampled {
    /// No samples yet; `averaged` of them are going to be one, and one of `thinned` such is kept.
    pub(crate) fn new(n: usize, surroundings: Surroundings, averaged: usize, thinned: usize) -> Self {
        let white = surroundings.white / (averaged as f64).sqrt();
        Self {
            surroundings: Surroundings { white, ..surroundings },
            n,
            values: Vec::new(),
            averaged,
            thinned,
            block: vec![0.0; AHEAD + n + 1],
            in_block: 0,
            blocks: 0,
            waited_s: 0.0,
        }
    }

    /// Takes the next sample in.
    pub(crate) fn take(&mut self, o: &Observation<'_>) {
        self.waited_s += o.interval_s;
        let ahead = [0.0, o.gain_slope, o.precession_rad_s, o.twice[0], o.twice[1]];
        for (sum, v) in self.block.iter_mut().zip(ahead.iter().chain(o.columns)) {
            *sum += v / self.averaged as f64;
        }
        self.in_block += 1;
        if self.in_block == self.averaged {
            if self.blocks.is_multiple_of(self.thinned) {
                self.block[0] = self.waited_s;
                self.waited_s = 0.0;
                self.values.extend_from_slice(&self.block);
            }
            self.blocks += 1;
            self.in_block = 0;
            self.block.fill(0.0);
        }
    }

    /// How many are kept.
    pub(crate) fn len(&self) -> usize {
        self.values.len() / (AHEAD + self.n + 1)
    }

    fn whitened(&self, noise: &ColouredNoise) -> crate::estimation::coloured_noise::Whitened {
        let mut filter = Filter::new(self.n, noise, self.surroundings);
        for v in self.values.chunks_exact(AHEAD + self.n + 1) {
            filter.take(&Observation {
                interval_s: v[0],
                gain_slope: v[1],
                precession_rad_s: v[2],
                twice: [v[3], v[4]],
                columns: &v[AHEAD..],
            });
        }
        filter.finish().0
    }
}

/// −2 ln of the restricted likelihood of a strength of noise, but for a constant; `normal` holds what was believed of the
/// unknowns before.
fn misfit(segments: &[Sampled], noise: &ColouredNoise, believed: &Normal) -> f64 {
    let mut normal = believed.clone();
    let parts: Vec<_> = segments.par_iter().map(|s| s.whitened(noise)).collect();
    for p in &parts {
        normal.add(p, 1.0);
    }
    normal.restricted_misfit().map_or(f64::INFINITY, |m| m + parts.iter().map(|p| p.ln_variance).sum::<f64>())
}

/// The most likely strengths of noise in all segments together. Kinds come in one at a time, the likeliest first, and all that are
/// there are searched together each time: a kind that is not there costs the filter nothing.
pub(crate) fn strengths(segments: &[Sampled], believed: &Normal) -> ColouredNoise {
    let of = |x: &[Option<f64>; KINDS]| misfit(segments, &noise(x), believed);
    let mut best = ([None; KINDS], of(&[None; KINDS]));
    while let Some(first) = likeliest_addition(&best, &of) {
        let there: Vec<usize> = (0..KINDS).filter(|&kind| first[kind].is_some()).collect();
        let with = |x: &[f64]| {
            let mut all = [None; KINDS];
            there.iter().zip(x).for_each(|(&kind, x)| all[kind] = Some(*x));
            all
        };
        let begin: Vec<f64> = first.iter().copied().flatten().collect();
        let (x, misfit) = least(&begin, STEP, NEAR, &|x| of(&with(x)));
        best = (with(&x), misfit);
    }
    noise(&best.0)
}

/// Strengths from their logarithms; what is not there, or too little to be, is 0.
fn noise(ln: &[Option<f64>; KINDS]) -> ColouredNoise {
    let [walk, table, gains] =
        std::array::from_fn(|kind| ln[kind].map(f64::exp).filter(|s| *s > LEAST[kind]).unwrap_or(0.0));
    ColouredNoise { walk, table, gains }
}

/// The strengths at hand with the one kind more that brings most, where any brings enough.
fn likeliest_addition(
    (present, misfit): &([Option<f64>; KINDS], f64),
    of: &dyn Fn(&[Option<f64>; KINDS]) -> f64,
) -> Option<[Option<f64>; KINDS]> {
    let usual = [USUAL.walk, USUAL.table, USUAL.gains];
    let absent = (0..KINDS).filter(|&kind| present[kind].is_none());
    let tries = absent.flat_map(|kind| STARTING_SHARES.map(|share| (kind, share))).map(|(kind, share)| {
        let mut x = *present;
        x[kind] = Some((usual[kind] * share).ln());
        (of(&x), x)
    });
    tries.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(m, _)| *m < misfit - NEAR).map(|(_, x)| x)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::{Sampled, strengths};
    use crate::estimation::coloured_noise::{GAIN_MEMORY_S, Observation, Surroundings};
    use crate::estimation::normal::Normal;
    use crate::model::hypothesis::Hypothesis;
    use crate::recording::Instrument;

    /// Evenly distributed deviates of variance 1, from a linear congruence (Knuth's MMIX).
    struct Deviates(u64);

    impl Deviates {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 11) as f64 / (1u64 << 53) as f64 - 0.5) * 12f64.sqrt()
        }
    }

    const WHITE_RAD: f64 = 2e-5;
    const INTERVAL_S: f64 = 0.02;

    /// Four runs of an angle at two rates, with white noise, a random walk and a wandering gain of one memory: at one rate what
    /// the table does could stand in for a walk.
    fn runs(walk: f64, gain: f64) -> Vec<Sampled> {
        let mut d = Deviates(11);
        (0..4)
            .map(|run| {
                let mut s = Sampled::new(0, Surroundings { white: WHITE_RAD, drift: None }, 1, 1);
                let (mut angle, mut ratio) = (0.0, 0.0);
                for i in 0..1500 {
                    angle += (walk * INTERVAL_S).sqrt() * d.next();
                    ratio = 0.99 * ratio + gain * (1.0 - 0.99f64 * 0.99).sqrt() * d.next();
                    let slope = 0.5 * (0.11 * f64::from(i)).sin();
                    s.take(&Observation {
                        interval_s: if i == 0 { 0.0 } else { INTERVAL_S },
                        gain_slope: slope,
                        precession_rad_s: if run % 2 == 0 { 2.75 } else { 0.275 },
                        twice: [0.0; 2],
                        columns: &[angle + slope * ratio + WHITE_RAD * d.next()],
                    });
                }
                s
            })
            .collect()
    }

    fn found(walk: f64, gain: f64) -> crate::estimation::coloured_noise::ColouredNoise {
        let nothing =
            Normal::of_beliefs(&[], &Hypothesis::ideal(Instrument::Gyroscope, std::f64::consts::PI, 0.8), &[]);
        strengths(&runs(walk, gain), &nothing)
    }

    #[test]
    fn white_noise_alone_is_not_taken_for_anything_that_matters() {
        let noise = found(0.0, 0.0);
        // over a run of 30 s: less than the white noise of one sample
        assert!(noise.walk * 30.0 < WHITE_RAD * WHITE_RAD, "{noise:?}");
        assert!(noise.gains < WHITE_RAD * WHITE_RAD, "{noise:?}");
    }

    #[test]
    fn a_random_walk_is_found_at_its_intensity() {
        let walk = 1e-9;
        let noise = found(walk, 0.0);
        assert!(noise.walk > walk / 1.3 && noise.walk < 1.3 * walk, "{noise:?}");
    }

    #[test]
    fn a_gain_that_wanders_is_not_taken_for_a_walk() {
        let noise = found(0.0, 3e-4);
        // all processes share what one has here
        let all = GAIN_MEMORY_S.len() as f64 * noise.gains;
        assert!(all > 3e-9 && all < 3e-7, "{noise:?}");
        assert!(noise.walk < 1e-11, "{noise:?}");
    }
}
