//! Noise whose power falls as one over the frequency: gains that wander, a table whose rate wanders.
//!
//! A sum of Ornstein–Uhlenbeck processes with memories an octave apart and equal variances. Memories spread evenly over
//! the logarithm, with a variance B² per factor e, have the one-sided density
//!
//! $$S(f) = \int \frac{4 B^2 \tau}{1 + (2\pi f\tau)^2}\,\mathrm d\ln\tau = \frac{B^2}{f},$$
//!
//! which octaves with a variance of B² ln 2 each follow between 1/(2π · the longest) and 1/(2π · the shortest) memory.

use crate::noise::Noise;

/// The shortest memory, s, and how many octaves there are: up to 164 s.
const SHORTEST_S: f64 = 0.02;
const OCTAVES: usize = 14;
/// How long a value is held, s.
const HELD_S: f64 = 0.01;

/// A quantity that wanders about zero.
#[derive(Clone, Debug)]
pub struct Flicker {
    noise: Noise,
    /// what is kept of each process from one value to the next, and the deviation of what is new
    kept: [[f64; 2]; OCTAVES],
    processes: [f64; OCTAVES],
    value: f64,
    /// control samples for which a value is held, and how many of them are left
    held: u64,
    left: u64,
}

impl Flicker {
    /// A quantity of one-sided density `coefficient`²/f, in control samples of `period_s`; `None` where it is 0.
    pub fn new(coefficient: f64, mut noise: Noise, period_s: f64) -> Option<Self> {
        if coefficient <= 0.0 {
            return None;
        }
        let held = crate::closed_loop::samples(HELD_S, period_s).max(1);
        #[allow(clippy::cast_precision_loss, reason = "a few samples")]
        let step_s = held as f64 * period_s;
        let deviation = coefficient * core::f64::consts::LN_2.sqrt();
        let mut memory_s = 0.5 * SHORTEST_S;
        let kept = core::array::from_fn(|_| {
            memory_s *= 2.0;
            let keep = (-step_s / memory_s).exp();
            [keep, deviation * (1.0 - keep * keep).sqrt()]
        });
        let processes: [f64; OCTAVES] = core::array::from_fn(|_| noise.normal(deviation));
        Some(Self { noise, kept, value: processes.iter().sum(), processes, held, left: held })
    }

    /// The value of this control sample.
    pub fn step(&mut self) -> f64 {
        if self.left == 0 {
            self.left = self.held;
            for (p, [keep, new]) in self.processes.iter_mut().zip(self.kept) {
                *p = keep * *p + self.noise.normal(new);
            }
            self.value = self.processes.iter().sum();
        }
        self.left -= 1;
        self.value
    }
}

/// What of a run wanders.
#[derive(Clone, Debug, Default)]
pub struct Wander {
    /// the gains of the readout, relative
    pub gains: Option<[Flicker; 2]>,
    /// the rate of the table, relative
    pub table: Option<Flicker>,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::Flicker;
    use crate::noise::Noise;

    /// Power of differences over a lag, for a density B²/f: ∫ 4 sin²(πfT) B²/f df from 1/τ_longest up, which grows by
    /// 2 B² ln 2 for each doubling of the lag.
    #[test]
    fn differences_over_twice_the_time_grow_by_what_one_over_f_says() {
        let b: f64 = 3e-3;
        let mut flicker = Flicker::new(b, Noise::new(7, 0), 0.01).unwrap();
        let values: Vec<f64> = (0..2_000_000).map(|_| flicker.step()).collect();
        let structure = |lag: usize| {
            let squares = values.iter().zip(&values[lag..]).map(|(a, b)| (a - b).powi(2));
            squares.sum::<f64>() / (values.len() - lag) as f64
        };
        for lag in [20, 40, 80, 160] {
            let grown = (structure(2 * lag) - structure(lag)) / (2.0 * b * b * core::f64::consts::LN_2);
            assert!((grown - 1.0).abs() < 0.12, "lag {lag}: {grown}");
        }
    }

    #[test]
    fn a_value_is_held_for_ten_milliseconds() {
        let mut flicker = Flicker::new(1.0, Noise::new(1, 0), 0.0005).unwrap();
        let values: Vec<f64> = (0..40).map(|_| flicker.step()).collect();
        assert!(values[..20].iter().all(|v| *v == values[0]) && values[20] != values[0]);
        assert!(Flicker::new(0.0, Noise::new(1, 0), 0.0005).is_none());
    }
}
