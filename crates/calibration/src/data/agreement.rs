//! Whether the runs of a campaign are of one instrument, and each is of one piece: an angular gain for every run and for
//! each half of it, compared.
//!
//! The angular gain of a device does not depend on the run. What may differ beside the noise of a run is its bias: a drift
//! of the pattern, which a gain takes for its own at a steady rate, and what slows a pattern that swings.

use crate::numerics::statistics::median;

/// Gains agree within this share of themselves,
const SHARE: f64 = 3e-3;
/// and within what a drift of the pattern by this much makes of them, rad/s: 0.17 deg/s.
const DRIFT_RAD_S: f64 = 3e-3;
/// and, before a split is fitted, within what the quadrature that was read makes of one of this size, rad/s: 1 Hz,
pub(crate) const LARGEST_SPLIT_RAD_S: f64 = 6.3;
/// and within so many times what is left of the angle over the input that was turned through,
const LEFT: f64 = 4.0;
/// where no more than this counts, as a share of the period: what is left beyond it is no error of a readout.
const LARGEST_LEFT: f64 = 0.03;
/// Share of the runs that may be left out.
const MOST_LEFT_OUT: f64 = 1.0 / 3.0;

/// What a run, or a part of it, tells of the angular gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gain {
    /// k
    pub(crate) value: f64,
    /// how far it may be off
    pub(crate) within: f64,
}

impl Gain {
    /// A gain from a line that leaves `left`, rad, of an angle of this period over an input that covers `range`, rad, at a
    /// mean speed, rad/s, where the pattern may precess by `drift` rad/s besides.
    pub(crate) fn new(value: f64, left: f64, period: f64, range: f64, [speed, drift]: [f64; 2]) -> Self {
        let by_readout = LEFT * left.min(LARGEST_LEFT * period) / range.max(f64::MIN_POSITIVE);
        let by_drift = (DRIFT_RAD_S + drift) / speed.max(f64::MIN_POSITIVE);
        Self { value, within: SHARE * value.abs() + by_drift + by_readout }
    }

    /// The gain where what the mechanics pull may have slowed the pattern by this share of it.
    pub(crate) fn slowed_by(self, share: f64) -> Self {
        Self { within: self.within + share * self.value.abs(), ..self }
    }

    pub(crate) fn agrees(&self, other: &Self) -> bool {
        (self.value - other.value).abs() <= self.within.hypot(other.within)
    }
}

/// What a run tells of the angular gain: all of it, and its parts in the order of time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RunGain {
    pub(crate) run: String,
    pub(crate) all: Gain,
    pub(crate) parts: Vec<Gain>,
}

impl RunGain {
    /// Two parts that contradict each other.
    fn contradiction(&self) -> Option<[Gain; 2]> {
        let pairs = self.parts.iter().enumerate().flat_map(|(i, a)| self.parts[i + 1..].iter().map(move |b| [*a, *b]));
        pairs
            .filter(|[a, b]| !a.agrees(b))
            .max_by(|x, y| (x[0].value - x[1].value).abs().total_cmp(&(y[0].value - y[1].value).abs()))
    }
}

/// What the runs say of each other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Verdict {
    /// these are to be left out, and why; mostly none
    Out(Vec<(usize, String)>),
    /// the campaign cannot tell which of its runs is right
    Open { run: String, problem: String },
}

/// Compares the runs of a campaign.
pub(crate) fn verdict(runs: &[RunGain]) -> Verdict {
    let middle = median(&mut runs.iter().map(|r| r.all.value).collect::<Vec<_>>());
    // of runs that agree with the median: a median of two is one of them
    let common = Gain { value: middle, within: 0.0 };
    let mut odd: Vec<(usize, String)> = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        if let Some([a, b]) = run.contradiction() {
            let what = format!("its angular gain is {:.5} in one part and {:.5} in another", a.value, b.value);
            odd.push((i, what));
        } else if !run.all.agrees(&common) {
            let what = format!("its angular gain is {:.5}, that of the other runs {middle:.5}", run.all.value);
            odd.push((i, what + cause(run.all.value / middle)));
        }
    }
    if odd.is_empty() || (odd.len() as f64) <= MOST_LEFT_OUT * runs.len() as f64 {
        return Verdict::Out(odd);
    }
    let (first, what) = &odd[0];
    let problem = if runs.len() == 1 || runs[*first].contradiction().is_some() {
        format!("{what}: the clock, the rate, or what turns is not the same throughout")
    } else {
        let each: Vec<String> = runs.iter().map(|r| format!("{} {:.5}", r.run, r.all.value)).take(6).collect();
        format!("the runs do not agree on the angular gain: {}", each.join(", "))
    };
    Verdict::Open { run: runs[*first].run.clone(), problem }
}

/// A ratio of gains has a cause within this share: engineering choice.
const CAUSED: f64 = 0.02;

/// What a run may have in common with one whose angular gain is this many times that of the others.
fn cause(ratio: f64) -> &'static str {
    const CAUSES: [(f64, &str); 6] = [
        (-1.0, ": the rate or the table has lost its sign, or X and Y are exchanged"),
        (57.295_78, ": its rate looks as if in rad/s, or its table in rad"),
        (1.0 / 57.295_78, ": its angle looks as if in rad"),
        (6.0, ": its rate looks as if in revolutions per minute"),
        (1e-3, ": its times look as if in ms, or its rate in mdeg/s"),
        (1e3, ": its rate looks as if in thousands of deg/s"),
    ];
    CAUSES.iter().find(|(of, _)| (ratio / of - 1.0).abs() < CAUSED).map_or("", |(_, what)| what)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_gain(run: &str, k: f64) -> RunGain {
        let gain = |value| Gain::new(value, 0.004, std::f64::consts::PI, 170.0, [8.7, 0.0]);
        RunGain { run: run.into(), all: gain(k), parts: vec![gain(k), gain(k)] }
    }

    #[test]
    fn one_run_of_sixty_is_left_out_by_name() {
        let mut runs: Vec<RunGain> =
            (0..60).map(|i| run_gain(&format!("{i}.csv"), 0.78 + 1e-5 * f64::from(i))).collect();
        runs[17].all.value = 0.75;
        let Verdict::Out(out) = verdict(&runs) else { panic!() };
        assert!(matches!(out.as_slice(), [(17, why)] if why.contains("0.75000")), "{out:?}");
    }

    #[test]
    fn a_run_without_its_sign_or_in_another_unit_is_told_so() {
        for (gain, what) in
            [(-0.78, "lost its sign"), (44.69, "rad/s"), (0.75, "0.75000, that of the other runs 0.78000")]
        {
            let runs: Vec<RunGain> = [0.78, 0.78, gain, 0.78].iter().map(|k| run_gain("a.csv", *k)).collect();
            let Verdict::Out(out) = verdict(&runs) else { panic!() };
            assert!(matches!(out.as_slice(), [(2, why)] if why.contains(what)), "{out:?}");
        }
    }

    #[test]
    fn of_two_runs_neither_is_right() {
        let Verdict::Open { problem, .. } = verdict(&[run_gain("a.csv", 0.78), run_gain("b.csv", 0.70)]) else {
            panic!()
        };
        assert!(problem.contains("a.csv 0.78000, b.csv 0.70000"), "{problem}");
    }

    #[test]
    fn a_run_that_changes_halfway_is_odd() {
        let mut run = run_gain("a.csv", 0.78);
        run.parts[1].value = 0.74;
        assert!(matches!(verdict(std::slice::from_ref(&run)), Verdict::Open { .. }));
        let Verdict::Out(out) = verdict(&[run_gain("b.csv", 0.78), run, run_gain("c.csv", 0.78)]) else { panic!() };
        assert_eq!(out.len(), 1);
    }

    #[test]
    fn a_bias_at_a_slow_rate_is_no_disagreement() {
        let slow = Gain::new(0.785, 0.004, std::f64::consts::PI, 170.0, [0.35, 0.0]);
        assert!(slow.agrees(&Gain::new(0.78, 0.004, std::f64::consts::PI, 170.0, [8.7, 0.0])));
    }
}
