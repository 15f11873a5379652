//! What is put out where a command stands at the edge of a step: either of two steps, and anything between in the mean, as the loop
//! needs it. The commands do not tell it; the amplitude and the quadrature do, which had to follow.
//!
//! What is left of a balance after the rounded forces is shared between the axes by how open the force of each is: a filter's gain, from the
//! variance of a force within a step, how near its command is to an edge beside the noise of the commands, and the noise of the balance.
//! What goes with the second and the fourth harmonic of the pattern, and with its rate, is the readout's and the mechanics'.

use crate::data::quantised_drives::balances::{Balance, Pair, commanded, longest_interval_s};
use crate::data::track::Track;
use crate::facts::Estimate;
use crate::numerics::linear::NormalEquations;
use crate::numerics::rounding::mean_rounded;
use crate::numerics::statistics::white_noise;

/// Samples of a run that tell its noise.
const LOOKED_AT: usize = 20_000;
/// Edges are no sharper than this share of a step, and no command is better known than this share.
const SHARPEST: f64 = 3e-3;
const LEAST_OPEN: f64 = 5e-3;
/// A command that moves by this share of a step between two samples does not stand at an edge.
const MOVES_ON: f64 = 0.25;
/// The quadrature balance among both.
const QUADRATURE: usize = 1;
/// Rounds in which the gain settles.
const ROUNDS: usize = 12;
/// A gain that moves by less than this share with what is told within a step is the drives', and known to this share at best: it was seen to be
/// off by 1 to 4 % (engineering choices).
const SAME_GAIN: f64 = 0.1;
const KNOWN_TO: f64 = 0.05;
/// Harmonics of the pattern that say nothing of the forces.
const BESIDE: [f64; 2] = [2.0, 4.0];
/// What says nothing of the forces: the ellipse, the damping, and both harmonics with and without the rate.
const COLUMNS: usize = 10;

/// Noise of the commands, V, and of what is seen of both balances, 1/s.
#[derive(Clone, Copy)]
struct Noise {
    commands: [f64; 2],
    rates: [f64; 2],
}

impl Noise {
    fn of(track: &Track) -> Self {
        let rows = track.t_s.len().min(LOOKED_AT);
        let series = |of: &dyn Fn(usize) -> f64| white_noise(&(0..rows).map(of).collect::<Vec<_>>());
        let command = |i: usize| track.commands(i, 1).map_or([0.0; 2], |v| [v.now.v_as, v.now.v_qc]);
        let seen = |i: usize| {
            let p = track.envelope(i).pendulum();
            [0.5 * p.e.ln(), 0.5 * p.q / p.e]
        };
        let interval_s = (track.t_s[rows - 1] - track.t_s[0]) / rows.max(2) as f64;
        Self {
            commands: [0, 1].map(|w| series(&|i| command(i)[w])),
            rates: [0, 1].map(|w| 2f64.sqrt() * series(&|i| seen(i)[w]) / interval_s),
        }
    }
}

/// How far a force may be from its rounded command, as a variance, V².
fn open([from, to]: [f64; 2], step: f64, noise: f64) -> f64 {
    let (low, high) = (from.min(to) / step - 0.5, from.max(to) / step - 0.5);
    // edges lie at whole numbers
    let is_crossed = high.floor() >= low.ceil();
    let away = if is_crossed { 0.0 } else { (low - low.floor()).min(high.ceil() - high) };
    let sharp = (noise / step).max(SHARPEST);
    let stands = (-0.5 * (away / sharp).powi(2) - 0.5 * ((high - low) / MOVES_ON).powi(2)).exp();
    step * step * (0.25 * stands + LEAST_OPEN * LEAST_OPEN)
}

/// What the forces of X and Y are more than rounded, V, where so much of a balance is left.
fn more(pair: &Pair, witness: usize, left: f64, gain: f64, step: f64, noise: &Noise) -> [f64; 2] {
    let pulls = pair.pulls[witness].map(|pull| gain * pull);
    let open = pair.chords[witness].map(|chord| open(chord, step, noise.commands[witness]));
    let variance = pulls[0] * pulls[0] * open[0] + pulls[1] * pulls[1] * open[1] + noise.rates[witness].powi(2);
    // what pulls nothing shows in no balance
    if variance <= f64::MIN_POSITIVE || pulls == [0.0; 2] {
        return [0.0; 2];
    }
    [0, 1].map(|axis| (open[axis] * pulls[axis] * left / variance).clamp(-step, step))
}

/// The gain of the drives, 1/s per V of command over amplitude, by the quadrature balance of all runs at once: what holds a split is the larger
/// part of the forces there, and known but for a share of it. None where what is told within a step contradicts that.
pub(super) fn gain(runs: &[(Vec<Pair>, &Track)], step: f64) -> Option<Estimate> {
    let all: Vec<Pair> = runs.iter().flat_map(|(run, _)| run.iter().copied()).collect();
    let whole = Balance::new(&all, QUADRATURE, &BESIDE[..1]);
    let of_a_run = |(run, track): &(Vec<Pair>, &Track)| {
        let balance = Balance::new(run, QUADRATURE, &BESIDE);
        let (seen, rounded) = (balance.change.clone(), balance.pushed(Some(step)));
        (Noise::of(track), seen, rounded)
    };
    let each: Vec<_> = runs.iter().map(of_a_run).collect();
    let rounded = whole.pushed(Some(step));
    let by_commands = rounded.dot(&whole.change) / rounded.norm_squared();
    let mut gain = by_commands;
    for _ in 0..ROUNDS {
        let told = runs.iter().zip(&each).flat_map(|((run, _), (noise, seen, rounded))| {
            let left = seen - rounded * gain;
            let pushed = |(pair, left): (&Pair, &f64)| {
                let [x, y] = more(pair, QUADRATURE, *left, gain, step, noise);
                pair.pulls[QUADRATURE][0] * x + pair.pulls[QUADRATURE][1] * y
            };
            run.iter().zip(&left).map(pushed).collect::<Vec<_>>()
        });
        let pushed = &rounded + whole.beside(told);
        gain = pushed.dot(&whole.change) / pushed.norm_squared();
    }
    let is_one = gain > 0.0 && (gain / by_commands - 1.0).abs() < SAME_GAIN;
    is_one.then(|| Estimate::new(gain, (KNOWN_TO * gain).hypot(gain - by_commands)))
}

/// What says nothing of the forces.
fn goes_without_saying(pair: &Pair) -> [f64; COLUMNS] {
    let ((s2, c2), (s4, c4)) = ((BESIDE[0] * pair.theta).sin_cos(), (BESIDE[1] * pair.theta).sin_cos());
    let rate = pair.turn_rad_s;
    [pair.ellipticity, 1.0, s2, c2, s4, c4, rate * s2, rate * c2, rate * s4, rate * c4]
}

/// What the drives put out more than is commanded, of X and Y in quadrature with the pattern and in phase with it, V, in the mean from each
/// sample of a track to the next.
pub(super) fn put_out(track: &Track, step: f64, gain: f64) -> Vec<[[f64; 2]; 2]> {
    let longest_s = longest_interval_s(track);
    let pairs = || (0..track.t_s.len().saturating_sub(1)).map(|i| Pair::new(track, i, longest_s));
    let rounded = |chord: [f64; 2]| mean_rounded(chord, step);
    let left = |pair: &Pair| [0, 1].map(|w| pair.rates[w] - gain * pair.pushed(w, rounded));
    let mut equations = [0, 1].map(|_| NormalEquations::new(COLUMNS));
    for pair in pairs().flatten() {
        let row = goes_without_saying(&pair);
        equations.iter_mut().zip(left(&pair)).for_each(|(e, left)| e.add(&row, left));
    }
    let [energy, quadrature] = equations.map(|e| e.solve());
    let noise = Noise::of(track);
    let added = |pair: Pair| {
        let row = goes_without_saying(&pair);
        let beside = |found: &[f64]| row.iter().zip(found).map(|(a, x)| a * x).sum::<f64>();
        let left = left(&pair);
        let left = [left[0] - beside(&energy), left[1] - beside(&quadrature)];
        [0, 1].map(|w| {
            let more = more(&pair, w, left[w], gain, step, &noise);
            [0, 1].map(|axis| {
                let chord = pair.chords[w][axis];
                rounded(chord) - commanded(chord) + more[axis]
            })
        })
    };
    pairs().map(|pair| pair.map_or([[0.0; 2]; 2], added)).collect()
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test fails by panicking")]
mod tests {
    use super::{Noise, more, open, put_out};
    use crate::data::quantised_drives::balances::Pair;
    use crate::data::track::Track;
    use crate::recording::{Recording, Role, Run, RunKind};

    /// A pattern that turns at 5 rad/s for ten half turns while −0.2 V replace its damping, and drives with steps of 0.15 V.
    #[test]
    fn a_command_that_sweeps_across_steps_is_rounded_in_the_mean() {
        let (rate, step) = (5.0, 0.15);
        let t_s: Vec<f64> = (0..630).map(|i| 0.01 * f64::from(i)).collect();
        let of = |f: fn(f64) -> f64| Some(t_s.iter().map(|t| f(rate * t)).collect::<Vec<_>>());
        let recording = Recording {
            xc_v: of(f64::cos),
            xs_v: of(|_| 0.0),
            yc_v: of(f64::sin),
            ys_v: of(|_| 0.0),
            rate_dps: Some(vec![rate.to_degrees(); t_s.len()]),
            vas_v: of(|_| -0.2),
            vqc_v: of(|_| 0.0),
            t_s: t_s.clone(),
            ..Recording::default()
        };
        let kind = RunKind::Rotation;
        let run = Run { kind, file: "spin.csv".into(), settle_s: 0.0, role: Role::Fit, amplitude: None, recording };
        let track = Track::whole(run, std::f64::consts::PI).expect("a track");
        // drives without a gain: the balances have no say
        let added = put_out(&track, step, 0.0);
        for (added, t) in added.iter().zip(&t_s) {
            let on_the_way = (0..1000).map(|part| rate * (t + 0.01 * (f64::from(part) + 0.5) / 1000.0));
            let more = on_the_way.fold([0.0; 2], |[x, y], theta| {
                let more = |v: f64| ((v / step).round() * step - v) / 1000.0;
                [x + more(-0.2 * theta.cos()), y + more(-0.2 * theta.sin())]
            });
            for (added, more) in added[0].iter().zip(more) {
                assert!((added - more).abs() < 2e-3, "at {t} s {added} and not {more}");
            }
        }
    }

    #[test]
    fn a_command_at_an_edge_is_open_by_half_a_step_and_one_between_edges_or_on_its_way_is_not() {
        let deviation = |chord| open(chord, 0.2, 1e-3).sqrt();
        assert!((deviation([0.1, 0.1]) - 0.1).abs() < 1e-4);
        assert!((deviation([-0.0995, -0.1005]) - 0.1).abs() < 1e-4);
        for chord in [[0.0, 0.0], [0.2, 0.21], [0.095, 0.095], [0.0, 0.2]] {
            assert!(deviation(chord) < 0.02, "{chord:?}");
        }
    }

    #[test]
    fn what_is_left_of_a_balance_goes_to_the_axis_whose_force_is_open() {
        let pair = Pair {
            chords: [[[0.1, 0.1], [0.02, 0.02]], [[0.0; 2]; 2]],
            pulls: [[-0.6, -0.8], [-0.8, 0.6]],
            rates: [0.0; 2],
            theta: 0.0,
            turn_rad_s: 0.0,
            ellipticity: 0.0,
        };
        let noise = Noise { commands: [1e-3; 2], rates: [1e-5; 2] };
        // 0.05 V more of X at a gain of 0.1
        let [x, y] = more(&pair, 0, -0.1 * 0.6 * 0.05, 0.1, 0.2, &noise);
        assert!((x - 0.05).abs() < 1e-3 && y.abs() < 1e-3, "{x} and {y}");
        // and no more than a step, whatever is left
        assert_eq!(more(&pair, 0, -1.0, 0.1, 0.2, &noise)[0].to_bits(), 0.2_f64.to_bits());
    }
}
