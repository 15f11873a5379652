//! Whether the samples are close enough to tell how the angle goes with the input.
//!
//! Of an angle with period P only its steps modulo P are seen. Where the input steps by δ from sample to sample, the angular
//! gains k and k + n P/δ make the same steps, θ_{i+1} − θ_i = ± k δ mod P. Runs at other rates, and samples at uneven times,
//! have other aliases: what all of them agree on is told. What they do not tell is told by what the campaign states, or by
//! nothing.

use crate::numerics::angles::wrapped;
use crate::numerics::statistics::median;

/// Largest angular gain that a resonator can have: no mode is carried along by more than all of the rotation.
pub(crate) const LARGEST_GAIN: f64 = 1.05;
/// A stated gain is taken to be right to this share of itself.
const STATED_TO: f64 = 0.2;
/// Share of the period over which the plausible gains may spread from sample to sample.
const RESOLVED: f64 = 0.9;
/// Steps that tell the gain; more add nothing.
const ENOUGH: usize = 2000;
/// Gains are tried so closely that the fastest step changes by this share of the period.
const GRID: f64 = 0.05;
/// Most gains that are tried: closer aliases are told apart by nothing that a campaign states.
const MOST_TRIED: f64 = 20_000.0;
/// A gain is as plausible as the best one where its steps scatter by less than this times as much.
const AS_PLAUSIBLE: f64 = 3.0;
/// Runs agree on a gain within this share of the distance of the nearest aliases, and within this much.
const ALIKE_SHARE: f64 = 0.2;
const ALIKE: f64 = 0.05;
/// Share of the runs that have to agree: one that is broken has no veto.
const QUORUM: f64 = 0.9;
/// Fastest that a table turns, rad/s, where nothing tells whole turns from sample to sample: 1000 deg/s.
const FASTEST_TABLE: f64 = 1000.0 * std::f64::consts::PI / 180.0;
/// Turns more or less from sample to sample that are tried.
const MOST_TURNS: f64 = 8.0;
/// Gains of runs whose table may have turned further agree within this.
const AGREES: f64 = 5e-3;
/// A median scatter beyond this share of the period is that of angles that have nothing to do with the input.
const UNRELATED: f64 = 0.2;

/// Steps of one run between neighbouring samples, rad: of the input, and of the angle, each modulo its period.
#[derive(Debug, Clone, Default)]
pub(crate) struct Steps {
    /// name of the run, for messages
    pub(crate) name: String,
    pub(crate) input: Vec<f64>,
    pub(crate) angle: Vec<f64>,
    /// whole turns of the input from sample to sample would not show
    pub(crate) whole_turns_are_open: bool,
    /// median time between samples, s
    pub(crate) interval_s: f64,
}

/// Which angular gains are plausible at all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Plausible {
    /// those of a resonator, by either sign
    Resonator,
    /// ± 1: an encoder
    Encoder,
    /// near this one, which the campaign states
    Stated(f64),
}

impl Plausible {
    fn holds(self, k: f64) -> bool {
        match self {
            Self::Resonator => k.abs() <= LARGEST_GAIN,
            Self::Encoder => (k.abs() - 1.0).abs() <= LARGEST_GAIN - 1.0,
            Self::Stated(stated) => (k - stated).abs() <= STATED_TO * stated.abs(),
        }
    }

    /// Lower and upper end.
    fn ends(self) -> [f64; 2] {
        match self {
            Self::Resonator | Self::Encoder => [-LARGEST_GAIN, LARGEST_GAIN],
            Self::Stated(stated) => {
                let reach = STATED_TO * stated.abs();
                [stated - reach, stated + reach]
            }
        }
    }
}

/// What the samples tell of the angular gain.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Sampling {
    /// they are close: neighbours tell
    Close,
    /// they are far apart, and yet only this gain is plausible
    Resolved(f64),
    /// several gains are as plausible
    Ambiguous(Ambiguity),
}

/// Gains between which the samples cannot tell.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ambiguity {
    /// run with the largest steps
    pub(crate) run: String,
    /// plausible gains; empty where no gain makes the steps of that run
    pub(crate) gains: Vec<f64>,
    /// step of its input from sample to sample, deg
    pub(crate) step_deg: f64,
    /// longest time between samples that would do at its rate, s
    pub(crate) interval_s: f64,
    /// that it has, s
    pub(crate) has_s: f64,
    /// the step, deg, that the table would make instead, where whole turns are open
    pub(crate) or_deg: Option<f64>,
}

impl Steps {
    fn typical(&self) -> f64 {
        median(&mut self.input.iter().map(|d| d.abs()).collect::<Vec<_>>())
    }

    /// All but the largest twentieth of the steps are below this.
    fn largest(&self) -> f64 {
        let mut sizes: Vec<f64> = self.input.iter().map(|d| d.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get((sizes.len() * 19) / 20).copied().unwrap_or(0.0)
    }

    /// Whether plausible gains differ by less than a period from sample to sample.
    fn are_close(&self, period: f64, plausible: Plausible) -> bool {
        let [low, high] = plausible.ends();
        let reach = low.abs().max(high.abs()).max(high - low);
        self.largest() * reach.max(2.0 * LARGEST_GAIN) < RESOLVED * period
    }

    /// Median of what a gain leaves of the steps of the angle.
    fn scatter(&self, sense: f64, period: f64, k: f64, buffer: &mut Vec<f64>) -> f64 {
        buffer.clear();
        buffer.extend(self.input.iter().zip(&self.angle).map(|(d, a)| wrapped(a - sense * k * d, period).abs()));
        median(buffer)
    }

    /// Gains that make the steps about as well as the best does, and how far apart they are.
    fn gains(&self, sense: f64, period: f64, plausible: Plausible) -> Option<Vec<f64>> {
        let [low, high] = plausible.ends();
        let step = GRID * period / self.largest();
        let tried = ((high - low) / step).ceil();
        if tried > MOST_TRIED {
            return None;
        }
        let mut buffer = Vec::with_capacity(self.input.len());
        let mut k = low - step;
        let mut scatter: [f64; 2] = [f64::INFINITY; 2];
        let mut found: Vec<(f64, f64)> = Vec::new();
        while k <= high + 2.0 * step {
            let here = self.scatter(sense, period, k, &mut buffer);
            if scatter[1] < scatter[0] && scatter[1] <= here && scatter[1] < UNRELATED * period {
                let polished = self.polished(sense, period, k - step, &mut buffer);
                let left = self.scatter(sense, period, polished, &mut buffer);
                if found.iter().all(|(other, _)| (other - polished).abs() > 0.5 * step) {
                    found.push((polished, left));
                }
            }
            scatter = [scatter[1], here];
            k += step;
        }
        let best = found.iter().map(|f| f.1).fold(f64::INFINITY, f64::min);
        found.retain(|(k, left)| *left <= AS_PLAUSIBLE * best && plausible.holds(*k));
        Some(found.into_iter().map(|f| f.0).collect())
    }

    /// The gain next to `k` that leaves least of the steps, but for what is far off.
    fn polished(&self, sense: f64, period: f64, mut k: f64, buffer: &mut Vec<f64>) -> f64 {
        for _ in 0..4 {
            let limit = 4.0 * self.scatter(sense, period, k, buffer) + f64::MIN_POSITIVE;
            let (mut weight, mut sum) = (0.0, 0.0);
            for (d, a) in self.input.iter().zip(&self.angle) {
                let rest = wrapped(a - sense * k * d, period);
                if rest.abs() <= limit {
                    weight += d * d;
                    sum += sense * d * rest;
                }
            }
            k += if weight > 0.0 { sum / weight } else { 0.0 };
        }
        k
    }
}

/// What the samples of all runs tell of the angular gain: `sense` · k · input is the angle, which has `period`, rad.
/// `followed` is the gain of a run whose samples are close.
pub(crate) fn sampling(
    runs: &[Steps],
    followed: impl Fn(usize) -> Option<f64>,
    (sense, period): (f64, f64),
    plausible: Plausible,
) -> Sampling {
    let far: Vec<bool> = runs.iter().map(|r| !r.are_close(period, plausible)).collect();
    let Some(widest) =
        (0..runs.len()).filter(|&i| far[i]).max_by(|&a, &b| runs[a].typical().total_cmp(&runs[b].typical()))
    else {
        return Sampling::Close;
    };
    let told: Vec<Option<Vec<f64>>> = runs
        .iter()
        .enumerate()
        .map(|(i, run)| if far[i] { run.gains(sense, period, plausible) } else { followed(i).map(|k| vec![k]) })
        .collect();
    let alike = (ALIKE_SHARE * period / runs[widest].typical()).min(ALIKE);
    let votes = |k: f64| told.iter().flatten().filter(|gains| gains.iter().any(|g| (g - k).abs() <= alike)).count();
    let needed = QUORUM * told.len() as f64;
    let mut gains: Vec<f64> = Vec::new();
    for k in told.iter().flatten().flatten() {
        if votes(*k) as f64 >= needed && gains.iter().all(|g| (g - k).abs() > alike) {
            gains.push(*k);
        }
    }
    if let ([k], true) = (gains.as_slice(), told.iter().all(Option::is_some)) {
        return Sampling::Resolved(*k);
    }
    gains.sort_by(|a, b| b.total_cmp(a));
    let run = &runs[widest];
    let speed = run.typical() / run.interval_s.max(f64::MIN_POSITIVE);
    Sampling::Ambiguous(Ambiguity {
        run: run.name.clone(),
        gains,
        step_deg: run.typical().to_degrees(),
        interval_s: RESOLVED * period / (2.0 * LARGEST_GAIN * speed),
        has_s: run.interval_s,
        or_deg: None,
    })
}

/// Another gain than the one that is told, where the table of a run may have turned by whole turns more or less from sample
/// to sample: one that agrees with all that the runs show. `told` is the gain of each run as it stands.
pub(crate) fn other_turns(
    runs: &[Steps],
    told: impl Fn(usize) -> Option<f64>,
    (sense, period): (f64, f64),
    plausible: Plausible,
) -> Option<Ambiguity> {
    // what each run tells: as it stands, and with so many turns more a sample
    let as_it_stands: Vec<f64> = (0..runs.len()).map(|i| told(i).unwrap_or(f64::NAN)).collect();
    let others: Vec<Vec<(f64, f64)>> =
        runs.iter().zip(&as_it_stands).map(|(run, k)| run.with_other_turns(sense, period, plausible, *k)).collect();
    let needed = QUORUM * runs.len() as f64;
    let agrees = |i: usize, k: f64| {
        (as_it_stands[i] - k).abs() <= AGREES || others[i].iter().any(|(other, _)| (other - k).abs() <= AGREES)
    };
    // Equation 1: a pattern stays behind, unless the campaign says otherwise
    let may_be = |k: f64| matches!(plausible, Plausible::Stated(_)) || k > 0.0;
    let is_another =
        |k: f64| as_it_stands.iter().filter(|told| (*told - k).abs() <= AGREES).count() as f64 <= 0.5 * needed;
    let borne_out = |k: f64| (0..runs.len()).filter(|i| agrees(*i, k)).count() as f64 >= needed;
    (0..runs.len()).find_map(|at| {
        let run = &runs[at];
        let step = median(&mut run.input.clone());
        let mut open: Vec<(f64, f64)> = others[at].clone();
        open.retain(|(k, _)| may_be(*k) && is_another(*k) && borne_out(*k));
        open.sort_by(|a, b| (step + a.1).abs().total_cmp(&(step + b.1).abs()));
        let turns = open.first()?.1;
        Some(Ambiguity {
            run: run.name.clone(),
            gains: std::iter::once(as_it_stands[at]).chain(open.iter().map(|(k, _)| *k)).collect(),
            step_deg: step.to_degrees(),
            interval_s: 0.5 * std::f64::consts::TAU / FASTEST_TABLE,
            has_s: run.interval_s,
            or_deg: Some((step + turns).to_degrees()),
        })
    })
}

impl Steps {
    /// Gains that explain the angle as well as `k` does, if the input turned by whole turns more or less from sample to
    /// sample, each with what it turned more, rad.
    fn with_other_turns(&self, sense: f64, period: f64, plausible: Plausible, k: f64) -> Vec<(f64, f64)> {
        if !self.whole_turns_are_open {
            return Vec::new();
        }
        let mut buffer = Vec::with_capacity(self.input.len());
        let limit = AS_PLAUSIBLE * self.scatter(sense, period, k, &mut buffer) + f64::EPSILON * period;
        let most = (FASTEST_TABLE * self.interval_s / std::f64::consts::TAU).ceil();
        #[allow(clippy::cast_possible_truncation, reason = "a few turns")]
        let most = most.min(MOST_TURNS) as i32;
        let mut out = Vec::new();
        for n in (-most..=most).filter(|n| *n != 0) {
            let turns = f64::from(n) * std::f64::consts::TAU;
            let other = Self { input: self.input.iter().map(|d| d + turns).collect(), ..self.clone() };
            if other.typical() > FASTEST_TABLE * self.interval_s {
                continue;
            }
            for k in other.gains(sense, period, plausible).unwrap_or_default() {
                if other.scatter(sense, period, k, &mut buffer) <= limit {
                    out.push((k, turns));
                }
            }
        }
        out
    }
}

impl Ambiguity {
    /// What is wrong.
    pub(crate) fn problem(&self) -> String {
        if let Some(or) = self.or_deg {
            return format!(
                "table_deg tells by how much the table turns from sample to sample but for whole turns, by {:.1}° or by \
                 {or:.1}°, so that angular gains of {} explain the angle equally well",
                self.step_deg,
                self.few()
            );
        }
        let turn = format!("the input turns by {:.1}° from sample to sample", self.step_deg);
        if self.gains.is_empty() {
            return format!("{turn}, and no angular gain that is plausible makes the steps of the angle");
        }
        format!("{turn}, so that angular gains of {} explain the angle equally well", self.few())
    }

    /// The first of the gains.
    fn few(&self) -> String {
        let few: Vec<String> = self.gains.iter().take(6).map(|k| format!("{k:.4}")).collect();
        let more = if self.gains.len() > few.len() { ", …" } else { "" };
        few.join(", ") + more
    }

    /// What would do.
    pub(crate) fn wanted(&self) -> String {
        if self.or_deg.is_some() {
            return format!(
                "rate_dps, or a table_deg that counts turns, or samples at least every {:.2} s, or runs at other rates, or \
                 angular_gain in the campaign to within {:.0} %",
                self.interval_s,
                100.0 * STATED_TO
            );
        }
        let slower = (self.interval_s / self.has_s).min(1.0);
        let clock = if self.interval_s < self.has_s && 1e-3 * self.has_s < self.interval_s && self.has_s >= 0.5 {
            "; or t_s in seconds, if these are milliseconds (t_s = \"…*0.001\" in [columns], --map)"
        } else {
            ""
        };
        format!(
            "samples at least every {:.3} s at this rate, or a run at most {:.0} % as fast, or angular_gain in the \
             campaign to within {:.0} %{clock}",
            self.interval_s,
            (100.0 * slower).floor().max(1.0),
            100.0 * STATED_TO
        )
    }
}

/// Picks [`ENOUGH`] places evenly among `count`.
pub(crate) fn spread_over(count: usize) -> impl Iterator<Item = usize> {
    let step = (count / ENOUGH).max(1);
    (0..count).step_by(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A gyroscope with k = 0.78 at a rate in deg/s, sampled at these times.
    fn steps(rate_dps: f64, times: &[f64]) -> Steps {
        let input: Vec<f64> = times.windows(2).map(|w| (rate_dps * (w[1] - w[0])).to_radians()).collect();
        // the readout's error, a quarter of a degree at twice the angle
        let theta = |t: f64| {
            let ideal = -0.78 * (rate_dps * t).to_radians();
            ideal + 0.0045 * (2.0 * ideal).sin()
        };
        let angle = times.windows(2).map(|w| theta(w[1]) - theta(w[0])).collect();
        Steps { name: "run".into(), input, angle, interval_s: times[1] - times[0], whole_turns_are_open: false }
    }

    fn evenly(hz: f64) -> Vec<f64> {
        (0..1200).map(|i| f64::from(i) / hz).collect()
    }

    fn told(runs: &[Steps], plausible: Plausible) -> Sampling {
        sampling(runs, |_| Some(0.78), (-1.0, PI), plausible)
    }

    #[test]
    fn samples_five_degrees_apart_are_close() {
        assert_eq!(told(&[steps(500.0, &evenly(100.0))], Plausible::Resonator), Sampling::Close);
    }

    #[test]
    fn two_samples_a_second_at_500_dps_leave_the_gain_open() {
        let Sampling::Ambiguous(a) = told(&[steps(500.0, &evenly(2.0))], Plausible::Resonator) else { panic!() };
        assert_eq!(a.gains.len(), 3, "{a:?}");
        for (gain, alias) in a.gains.iter().zip([0.78, 0.06, -0.66]) {
            assert!((gain - alias).abs() < 1e-3, "{a:?}");
        }
        // 500 dps · 0.154 s · 2.1 is nine tenths of 180°
        assert!((a.interval_s - 0.1543).abs() < 1e-3, "{a:?}");
        assert!(a.problem().contains("250.0°") && a.wanted().contains("0.154 s"), "{} {}", a.problem(), a.wanted());
    }

    #[test]
    fn a_stated_gain_settles_it() {
        let runs = [steps(500.0, &evenly(2.0))];
        let Sampling::Resolved(k) = told(&runs, Plausible::Stated(0.8)) else { panic!() };
        assert!((k - 0.78).abs() < 1e-3);
        let Sampling::Ambiguous(a) = told(&runs, Plausible::Stated(0.4)) else { panic!() };
        assert!(a.gains.is_empty());
    }

    #[test]
    fn a_second_rate_and_uneven_times_settle_it() {
        let two = [steps(500.0, &evenly(2.0)), steps(-370.0, &evenly(2.0))];
        let uneven: Vec<f64> = (0..1200).map(|i| 0.5 * f64::from(i) + 0.1 * (f64::from(i) * 1.7).sin()).collect();
        for runs in [two.to_vec(), vec![steps(500.0, &uneven)]] {
            let Sampling::Resolved(k) = told(&runs, Plausible::Resonator) else { panic!() };
            assert!((k - 0.78).abs() < 1e-3, "{k}");
        }
    }

    /// The same by the angle of its table within a turn.
    fn within_a_turn(rate_dps: f64, hz: f64) -> Steps {
        let run = steps(rate_dps, &evenly(hz));
        let input = run.input.iter().map(|d| wrapped(*d, 2.0 * PI)).collect();
        Steps { input, whole_turns_are_open: true, ..run }
    }

    #[test]
    fn a_table_that_may_turn_further_from_sample_to_sample_leaves_the_gain_open() {
        let other = |runs: &[Steps], k: &[f64]| other_turns(runs, |i| Some(k[i]), (-1.0, PI), Plausible::Resonator);
        // 242.5° look like −117.5°, and 0.78 · 242.5° like 0.0783 · 117.5°
        let fast = within_a_turn(485.0, 2.0);
        let shown = (180.0 - 0.78 * 242.5) / 117.5;
        let told = other(std::slice::from_ref(&fast), &[shown]).expect("open");
        assert!(told.gains.iter().any(|k| (k - 0.78).abs() < 1e-3), "{told:?}");
        assert!(
            told.problem().contains("by -117.5° or by 242.5°, so that") && told.wanted().contains("0.18 s"),
            "{told:?}"
        );
        // ten samples a second: no table turns by a turn more
        assert_eq!(other(&[within_a_turn(485.0, 10.0)], &[0.78]), None);
        // other rates, of which no other turns agree
        assert_eq!(
            other(&[within_a_turn(60.0, 2.0), within_a_turn(-83.0, 2.0), within_a_turn(131.0, 2.0)], &[0.78; 3]),
            None
        );
    }

    #[test]
    fn an_encoder_counts_one_or_minus_one() {
        let mut run = steps(500.0, &evenly(2.0));
        run.angle = run.input.iter().map(|d| -d).collect();
        let Sampling::Resolved(k) = sampling(&[run], |_| None, (-1.0, 2.0 * PI), Plausible::Encoder) else { panic!() };
        assert!((k - 1.0).abs() < 1e-9);
    }
}
