//! What each run tells by itself once everything else is known: its angular gain, its bias, its error.

use crate::data::agreement::Gain;
use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::residual::{WHITENESS_LAGS, autocorrelation, inflation};
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::Dataset;
use crate::estimation::residuals::{Residual, Window, residuals};
use crate::numerics::statistics::{median, white_noise};
use crate::recording::Role;
use crate::report::{Estimate, RunReport};

/// A slope and its standard deviation, from sums over segments that have a level each.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Slope {
    xx: f64,
    xy: f64,
    yy: f64,
    count: f64,
    range: f64,
}

impl Slope {
    pub(crate) fn add(&mut self, x: &[f64], y: &[f64], kept: &[bool]) {
        let kept = || x.iter().zip(y).zip(kept).filter(|(_, k)| **k).map(|(p, _)| p);
        let n = kept().count() as f64;
        if n < 3.0 {
            return;
        }
        let (mx, my) = kept().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (x, y) in kept() {
            (self.xx, self.xy, self.yy) =
                (self.xx + (x - mx).powi(2), self.xy + (x - mx) * (y - my), self.yy + (y - my).powi(2));
            (low, high) = (low.min(*x), high.max(*x));
        }
        self.count += n;
        self.range = self.range.max(high - low);
    }

    /// Value, standard deviation where the error's memory multiplies variances by `memory`, and rms of what is left.
    pub(crate) fn told(&self, memory: f64) -> Option<[f64; 3]> {
        let value = self.xy / self.xx;
        let left = (self.yy - value * self.xy).max(0.0) / (self.count - 2.0).max(1.0);
        let told = [value, (memory * left / self.xx).sqrt(), left.sqrt()];
        told.iter().all(|v| v.is_finite()).then_some(told)
    }
}

/// What is left of a run, rms, beyond that of the usual one, and beyond its own white noise, from which on it is odd; and runs that
/// tell what is usual. Engineering choices.
const FAR_MORE: f64 = 5.0;
const FEWEST_RUNS: usize = 3;

/// What is left of a run, and how much of it is white, rad.
struct Left {
    run: usize,
    rms: f64,
    white: f64,
}

impl Left {
    /// The runs of which far more is left than of the usual one, and what is left of that.
    fn odd(all: &[Self]) -> impl Iterator<Item = (&Self, f64)> {
        let usual = median(&mut all.iter().map(|left| left.rms).collect::<Vec<_>>());
        let is_odd = move |left: &&Self| left.rms > FAR_MORE * usual.max(left.white);
        all.iter().filter(move |_| all.len() >= FEWEST_RUNS).filter(is_odd).map(move |left| (left, usual))
    }
}

/// Fills in what every run that was fitted or held out tells by itself; says which of them do not agree with the rest.
pub(crate) fn tell_apart(
    runs: &mut [RunReport],
    dataset: &Dataset,
    fit: &Fit,
    (on_fit, held_out): (&Evaluation, &Evaluation),
) -> Vec<String> {
    let memory = inflation(&autocorrelation(on_fit, WHITENESS_LAGS), on_fit.errors().count());
    let left: [Vec<Vec<Residual>>; 2] = [Role::Fit, Role::Holdout]
        .map(|role| residuals(&dataset.tracks, &fit.hypothesis, &fit.starts, role, Window::Whole));
    let (mut warnings, mut seen) = (Vec::new(), Vec::new());
    for (at, (run, track)) in dataset.screen.of(runs).into_iter().zip(&dataset.tracks).enumerate() {
        let fitted = !left[0][at].is_empty();
        let (residuals, evaluation) = if fitted { (&left[0][at], on_fit) } else { (&left[1][at], held_out) };
        let kept: Vec<&Vec<bool>> =
            evaluation.segments.iter().zip(&evaluation.kept).filter(|(s, _)| s.track == at).map(|(_, k)| k).collect();
        let (mut of_input, mut of_time) = (Slope::default(), Slope::default());
        for (r, kept) in residuals.iter().zip(&kept) {
            of_input.add(&r.turned, &r.angle, kept);
            of_time.add(&r.t_s, &r.angle, kept);
        }
        run.spikes = [on_fit, held_out]
            .iter()
            .flat_map(|e| e.segments.iter().zip(&e.kept))
            .filter(|(s, _)| s.track == at)
            .map(|(_, k)| k.iter().filter(|k| !**k).count())
            .sum();
        let (Some([slope, deviation, rms]), Some([drift, drift_deviation, _])) =
            (of_input.told(memory), of_time.told(memory))
        else {
            continue;
        };
        let k = fit.hypothesis.angular_gain;
        let own = k + fit.hypothesis.sense() * slope;
        run.angular_gain = Some(Estimate::new(own, deviation));
        run.bias_dps = Some(Estimate::new(drift.to_degrees(), drift_deviation.to_degrees()));
        run.rms_deg = Some(rms.to_degrees());
        let gain = Gain::new(own, rms, fit.hypothesis.period_rad, of_input.range, [track.track.mean_speed(), 0.0]);
        let white = residuals.iter().map(|r| white_noise(&r.angle)).fold(0.0, f64::max);
        seen.push(Left { run: at, rms, white });
        let agrees = gain.agrees(&Gain { value: k, within: 0.0 });
        run.agrees = Some(agrees);
        if !agrees {
            warnings.push(format!("{}: its angular gain is {own:.5}, that of all runs {k:.5}", track.track.file));
        }
    }
    let mut kept = dataset.screen.of(runs);
    for (odd, usual) in Left::odd(&seen) {
        kept[odd.run].agrees = Some(false);
        warnings.push(format!(
            "{}: {:.4}° rms are left of it, and {:.4}° of the usual run: of another device, or something acted in it that acts in no other",
            dataset.tracks[odd.run].track.file,
            odd.rms.to_degrees(),
            usual.to_degrees()
        ));
    }
    for run in dataset.screen.left_out_of(runs) {
        run.agrees = Some(false);
        run.r#use = "left out".into();
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::Left;

    #[test]
    fn a_run_of_which_far_more_is_left_than_of_the_usual_one_is_odd_unless_it_is_its_noise() {
        let odd = |rms: &[f64], white: f64| -> Vec<usize> {
            let all: Vec<Left> = rms.iter().enumerate().map(|(run, &rms)| Left { run, rms, white }).collect();
            Left::odd(&all).map(|(left, _)| left.run).collect()
        };
        assert_eq!(odd(&[1e-5, 1.1e-5, 1e-3, 0.9e-5], 1e-5), [2]);
        assert!(odd(&[1e-5, 1.1e-5, 4e-5, 0.9e-5], 1e-5).is_empty());
        // a small amplitude has that much noise, and of two runs neither is the usual one
        assert!(odd(&[1e-5, 1.1e-5, 1e-3, 0.9e-5], 5e-4).is_empty());
        assert!(odd(&[1e-5, 1e-3], 1e-5).is_empty());
    }
}
