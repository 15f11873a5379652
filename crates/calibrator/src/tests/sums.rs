//! A cycle's sums against the vibration that was summed.

use std::vec::Vec;

use cvg_model::Pendulum;

use super::*;
use crate::parameters::Parameter as P;
use crate::regressors::known_rates;
use crate::window::{Push, Sample, Sums};

const STEPS: usize = 80;
const STEP_S: f64 = 5e-4;

fn push(along: f64, aside: f64, quadrature: f64, across: f64) -> Push<f64> {
    Push { along, aside, quadrature, across }
}

/// A control step at `theta`, of this energy and quadrature over the set energy.
struct Step {
    theta: f64,
    e: f64,
    q: f64,
    push: Push<f64>,
}

fn pair(theta: f64) -> (f64, f64) {
    (theta.cos(), theta.sin())
}

fn summed(before: f64, steps: &[Step], known: &Vector<f64>) -> Sums<f64> {
    let mut sums = Sums::after(pair(before));
    let mut last = before;
    for step in steps {
        let p = Pendulum { e: step.e, q: step.q, r: 0.0, s: 0.0, l: 0.0 };
        sums.add(&p, pair(step.theta), pair(last), &step.push, known);
        last = step.theta;
    }
    sums
}

fn closed(sums: &Sums<f64>) -> Sample<f64> {
    let mut sample = sums.close(STEP_S).expect("a whole cycle");
    sums.direct(&mut sample);
    sample
}

/// A pattern that turns at `rate` a step from `theta`, of changing energy and quadrature.
fn cycle(theta: f64, rate: f64, e: f64, q: f64, push: Push<f64>) -> Vec<Step> {
    let at = |k: usize| k as f64;
    (0..STEPS)
        .map(|k| Step { theta: theta + rate * at(k), e: e + 1e-4 * at(k % 7), q: q + 1e-4 * at(k % 5), push })
        .collect()
}

#[test]
fn a_cycle_has_the_mean_amplitude_angle_and_ellipticity_of_its_steps() {
    for theta in [-3.0, -1.7, -0.4, 0.0, 0.3, 1.5, 2.9] {
        for rate in [0.0, 2e-3, -3e-3] {
            for (e, q) in [(1.0, 0.0), (1.35, 0.2), (0.7, -0.15)] {
                let steps = cycle(theta, rate, e, q, push(0.0, 0.0, 0.0, 0.0));
                let s = closed(&summed(theta - rate, &steps, &[0.0; N]));
                let mean = |of: fn(&Step) -> f64| steps.iter().map(of).sum::<f64>() / STEPS as f64;
                let (energy, angle) = (mean(|s| s.e), mean(|s| s.theta));
                let q = mean(|s| s.q) / energy;
                near(s.y[0], 0.5 * energy.ln(), 1e-8);
                let (sin, cos) = angle.sin_cos();
                near(s.sin, sin, 1e-11);
                near(s.cos, cos, 1e-11);
                // from the step before the first, and from the last
                near(s.y[1], angle - theta + rate, 1e-11);
                near(s.before_next, angle - steps[STEPS - 1].theta, 1e-11);
                // ½ arcsin Q/E, to the fifth power
                near(s.y[2], 0.5 * q.asin(), 0.05 * q.abs().powi(5) + 1e-15);
                near(s.r, 0.5 * q / (1.0 - q * q).sqrt(), 1e-15);
                near(s.per_amplitude, 1.0 / energy.sqrt(), 1e-15);
                near(s.cos_2, (2.0 * angle).cos(), 1e-11);
                near(s.sin_2, (2.0 * angle).sin(), 1e-11);
            }
        }
    }
}

#[test]
fn what_is_known_to_act_shows_by_how_far_into_the_cycle_it_acts() {
    let mut known = [0.0; N];
    (known[P::Damping as usize], known[P::SplitSin as usize]) = (0.05, 1.3);
    (known[P::AnisodampingCos as usize], known[P::Rate as usize]) = (0.02, 0.01);
    let pushed = push(0.3, -0.2, 0.1, 0.05);
    // a pattern at rest: the same rates in every step
    let theta: f64 = 0.7;
    let steps: Vec<_> = (0..STEPS).map(|_| Step { theta, e: 1.0, q: 0.02, push: pushed }).collect();
    let s = closed(&summed(theta, &steps, &known));
    let rates = known_rates(&pushed, 0.01, ((2.0 * theta).cos(), (2.0 * theta).sin()), &known);
    let cycle_s = STEPS as f64 * STEP_S;
    for (c, rate) in rates.into_iter().enumerate() {
        // the k-th step acts in k of N later means of this cycle, and the rest in the next
        let late = rate * STEP_S * (STEPS as f64 + 1.0) / 2.0;
        near(s.late[c], late, 1e-15);
        near(s.early[c], rate * cycle_s - late, 1e-15);
    }
    for (got, expected) in [(s.push.along, 0.3), (s.push.aside, -0.2), (s.push.quadrature, 0.1), (s.push.across, 0.05)]
    {
        near(got, expected, 1e-15);
    }
    // what acts in the last step alone acts nearly all in the next cycle
    let last: Vec<_> = (0..STEPS)
        .map(|k| Step { theta, e: 1.0, q: 0.0, push: if k + 1 == STEPS { pushed } else { push(0.0, 0.0, 0.0, 0.0) } })
        .collect();
    let s = closed(&summed(theta, &last, &[0.0; N]));
    near(s.late[0], 0.3 * STEP_S, 1e-15);
    near(s.early[0], 0.0, 1e-18);
}

#[test]
fn forces_are_held_while_the_pattern_turns_on() {
    let pushed = push(0.3, -0.2, 0.1, 0.05);
    for rate in [0.01, -0.02] {
        let steps: Vec<_> =
            (0..STEPS).map(|k| Step { theta: 0.4 + rate * k as f64, e: 1.0, q: 0.0, push: pushed }).collect();
        let s = closed(&summed(0.4 - rate, &steps, &[0.0; N]));
        // half a step behind the pattern, to first order
        let lag = 0.5 * f64::sin(rate);
        for (got, expected) in [
            (s.push.along, 0.3 + lag * -0.2),
            (s.push.aside, -0.2 - lag * 0.3),
            (s.push.quadrature, 0.1 - lag * 0.05),
            (s.push.across, 0.05 + lag * 0.1),
        ] {
            near(got, expected, 1e-14);
        }
        // and the mechanics are those of the middle of the step
        let mut known = [0.0; N];
        known[P::AnisodampingSin as usize] = 1.0;
        let s = closed(&summed(0.4 - rate, &steps, &known));
        let none = closed(&summed(0.4 - rate, &steps, &[0.0; N]));
        let middle: f64 = steps.iter().map(|s| (2.0 * (s.theta + 0.5 * rate)).cos()).sum::<f64>() * STEP_S;
        near(s.early[1] + s.late[1] - none.early[1] - none.late[1], -middle, 1e-3 * rate.abs() * 0.04 + 1e-5);
        let first_order: f64 =
            steps.iter().map(|s| (2.0 * s.theta).cos() - f64::sin(rate) * (2.0 * s.theta).sin()).sum::<f64>() * STEP_S;
        near(s.early[1] + s.late[1] - none.early[1] - none.late[1], -first_order, 1e-14);
    }
}

#[test]
fn a_vibration_of_another_amplitude_is_pushed_more_or_less() {
    for e in [0.7, 0.9, 1.0, 1.2, 1.38] {
        let steps: Vec<_> =
            (0..STEPS).map(|_| Step { theta: 0.4, e, q: 0.0, push: push(0.3, 0.2, 0.1, 0.0) }).collect();
        let s = closed(&summed(0.4, &steps, &[0.0; N]));
        near(s.push.aside, 0.2 / f64::sqrt(e), 1e-14);
        // what is known in each step takes 1/a to the third order
        let h: f64 = 0.5 * (e - 1.0);
        near(s.early[1] + s.late[1], 0.2 * (1.0 - h + 1.5 * h * h) * 0.04, 1e-15);
        near(1.0 - h + 1.5 * h * h, 1.0 / f64::sqrt(e), 4.0 * h.abs().powi(3));
    }
}

#[test]
fn a_cycle_that_is_not_whole_or_not_of_a_vibration_at_work_is_none() {
    let steps = |e: f64, q: f64| -> Vec<_> {
        (0..STEPS).map(|_| Step { theta: 0.4, e, q, push: push(0.0, 0.0, 0.0, 0.0) }).collect()
    };
    let closes = |e: f64, q: f64| summed(0.4, &steps(e, q), &[0.0; N]).close(STEP_S).is_some();
    assert!(closes(1.0, 0.0) && closes(1.399, 0.0) && closes(0.601, 0.0) && closes(1.0, 0.299) && closes(1.0, -0.299));
    assert!(!closes(1.401, 0.0) && !closes(0.599, 0.0) && !closes(1.0, 0.301) && !closes(1.0, -0.301));
    assert!(closes(1.3, 0.38), "the quadrature is that of the energy there is");
    for none in [f64::NAN, f64::INFINITY] {
        assert!(!closes(none, 0.0) && !closes(1.0, none));
    }
    let mut spoilt = summed(0.4, &steps(1.0, 0.0), &[0.0; N]);
    spoilt.spoil();
    assert!(spoilt.close(STEP_S).is_none());
    assert!(Sums::<f64>::after((1.0, 0.0)).close(STEP_S).is_none(), "no step at all");
    let mut pushed = steps(1.0, 0.0);
    pushed[17].push.aside = f64::NAN;
    assert!(summed(0.4, &pushed, &[0.0; N]).close(STEP_S).is_none());
}
