//! How strong each kind of coloured noise is: the most likely strengths, told from the unknowns of the instrument.
//!
//! The likelihood is the restricted one (Patterson and Thompson 1971): that of what the residuals say once the unknowns
//! are taken out, so that unknowns which follow the noise do not make it look smaller. No overall scale is fitted: the
//! white part is measured from neighbouring samples, and a scale would take a walk's place.

use rayon::prelude::*;

use crate::estimation::coloured_noise::{ColouredNoise, Filter, Observation, Surroundings};
use crate::estimation::normal::Normal;
use crate::estimation::simplex::least;

/// Where the search for each kind begins: what a good instrument on a good table shows (0.4°/√h; 1e-4 of a rate and
/// 2e-4 of a gain over a run).
const USUAL: ColouredNoise = ColouredNoise { walk: 1.5e-8, table: 2e-9, gains: 1.5e-8 };
/// Below these there is none: a walk of 1e-9 rad in a second, and relative wanderings of 1e-7 and 3e-7, are beyond
/// what any converter shows.
const LEAST: ColouredNoise = ColouredNoise { walk: 1e-18, table: 1e-14, gains: 1e-13 };
/// How far above the least, in ln, a strength counts, so that the search ends on either side of it.
const CLEAR: f64 = 0.5;
/// How much a search pulls back from below the least, per square of ln: it is flat there.
const PULL: f64 = 1e-3;
/// Steps in ln of a search, of a kind that is there and of one that is not yet.
const STEP: f64 = 2.0;
const FIRST_STEP: f64 = 6.0;
/// Shares of a usual strength at which a search may begin: one that begins far too strong ends in a neighbour's valley.
const STARTING_SHARES: [f64; 3] = [0.01, 0.1, 1.0];
/// A search ends where ln likelihood (× 2) and strengths (ln) change by less: a tenth of what tells strengths apart.
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
        normal.add(p);
    }
    normal.restricted_misfit().map_or(f64::INFINITY, |m| m + parts.iter().map(|p| p.ln_variance).sum::<f64>())
}

/// The most likely strengths of noise in all segments together.
pub(crate) fn strengths(segments: &[Sampled], believed: &Normal) -> ColouredNoise {
    let [floor, usual] = [LEAST, USUAL].map(|n| [n.walk, n.table, n.gains].map(f64::ln));
    let strength = |x: &[f64; 3]| {
        let [walk, table, gains] = std::array::from_fn(|i| if x[i] > floor[i] + CLEAR { x[i].exp() } else { 0.0 });
        ColouredNoise { walk, table, gains }
    };
    let of = |x: &[f64; 3]| {
        let below: f64 = x.iter().zip(floor).map(|(x, floor)| (x - floor).min(0.0).powi(2)).sum();
        misfit(segments, &strength(x), believed) + PULL * below
    };
    let mut begin = (floor, of(&floor));
    for (i, share) in (0..3).flat_map(|i| STARTING_SHARES.map(|share| (i, share))) {
        let mut x = floor;
        x[i] = usual[i] + share.ln();
        let m = of(&x);
        if m < begin.1 {
            begin = (x, m);
        }
    }
    let steps = std::array::from_fn(|i| if begin.0[i] > floor[i] { STEP } else { FIRST_STEP });
    strength(&least(begin.0, steps, NEAR, &of).0)
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
