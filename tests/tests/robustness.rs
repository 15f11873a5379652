//! A blind trial: one effect of the library, or none, in a random device on a random campaign. The identification sees
//! the campaign's files and nothing else.
//!
//! `CVG_TRIALS` says how many; the full run is
//! `CVG_TRIALS=200 cargo test --release -p cvg-tests --test robustness -- --nocapture`. Effects that the recorded
//! channels cannot show are not drawn: a latency without the table's angle.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use cvg_calibration::{Identification, Origin};
use cvg_model::Envelope;
use cvg_model::effects::{EffectId, Shown, Values};
use cvg_simulator::scenario::{EffectSetting, Purpose, Run};
use cvg_simulator::{Settings, SimulatedRun};
use cvg_tests::bench::{Draws, all, effect, found, holds, identify, over_floor, plain_paper, polar, scenario, trials};
use cvg_tests::domain::wrapped;
use nalgebra::{Matrix3, Vector3};

/// Trials without `CVG_TRIALS`.
const TRIALS: u64 = 20;
/// What is drawn; as many blanks as make one draw in six.
const DRAWN: [EffectId; 10] = [
    EffectId::DetectionSkew,
    EffectId::DetectionOffset,
    EffectId::DetectionCubic,
    EffectId::DetectionSaturation,
    EffectId::GainDrift,
    EffectId::ScaleDrift,
    EffectId::SpringCubic,
    EffectId::ActuationSkew,
    EffectId::TableHarmonic,
    EffectId::TimePeriodic,
];
const BLANKS: usize = 2;
/// rms of the drawn signature over the noise floor of the held-out angle.
const SIGNATURE: [f64; 2] = [2.0, 50.0];
/// The largest skew of a drive that is drawn, whatever its signature is.
const LARGEST_ACTUATION_SKEW: f64 = 0.3;
/// False discoveries allowed among all blanks.
const FALSE_DISCOVERIES: usize = 1;

/// Shape of an undeclared effect: everything but its size.
struct Shape {
    id: EffectId,
    direction_deg: f64,
    sign: f64,
    table_harmonic: f64,
    frequency_hz: f64,
    largest_readout_v: f64,
}

impl Shape {
    /// The effect at a size: of its parameter, of its pair of parameters, or by how much the readout is overdriven.
    fn sized(&self, size: f64) -> EffectSetting {
        let (sin, cos) = self.direction_deg.to_radians().sin_cos();
        match self.id {
            EffectId::DetectionOffset | EffectId::SpringCubic => effect(self.id, &[size * cos, size * sin]),
            EffectId::TableHarmonic => effect(self.id, &[self.table_harmonic, size * cos, size * sin]),
            EffectId::TimePeriodic => effect(self.id, &[self.frequency_hz, size * cos, size * sin]),
            EffectId::DetectionSaturation => effect(self.id, &[(1.0 + size) / self.largest_readout_v]),
            _ => effect(self.id, &[self.sign * size]),
        }
    }
}

/// A trial as it was set up.
struct Setup {
    settings: Settings,
    drawn: Option<EffectSetting>,
    /// rms over the noise floor: of the whole signature, and of what the declared model cannot take up
    signature: [f64; 2],
}

fn setup(seed: u64) -> Setup {
    let mut draw = Draws::new(seed);
    let mut settings = plain_paper();
    let detection = draw.between(0.97, 1.03);
    settings.seed = seed;
    settings.angular_gain = draw.between(0.6, 0.95);
    settings.angular_gain_stated = Some(settings.angular_gain * draw.between(0.97, 1.03));
    settings.tau_s = draw.scale(10.0, 40.0);
    settings.noise_v = draw.scale(1e-5, 1e-4);
    settings.effects = vec![
        polar(EffectId::Anisodamping, draw.between(0.0, 0.008), draw.angle_deg(), 2.0),
        polar(EffectId::Anisoelasticity, TAU * draw.between(0.0, 0.05), draw.angle_deg(), 2.0),
        effect(EffectId::ActuationGainMismatch, &[draw.between(0.97, 1.03)]),
        effect(EffectId::DetectionGainMismatch, &[detection]),
    ];
    let (fast, medium, slow) = (draw.between(300.0, 600.0), draw.between(120.0, 250.0), draw.between(40.0, 90.0));
    let (check, low) = (draw.between(200.0, 500.0), draw.between(0.4, 0.8));
    for run in &mut settings.runs {
        if let Run::Rotation { file, rate_dps, amplitude, .. } = run {
            *rate_dps = match file.as_str() {
                "rot+500.csv" | "rot+500-low.csv" => fast,
                "rot-500.csv" | "rot-500-check.csv" => -fast,
                "rot+200.csv" => medium,
                "rot+60.csv" => slow,
                "rot+350-check.csv" => check,
                other => panic!("{other} is not a run of the paper's scenario"),
            };
            if *amplitude < 1.0 {
                *amplitude = low;
            }
        }
    }
    let which = draw.below(DRAWN.len() + BLANKS);
    let ratio = draw.scale(SIGNATURE[0], SIGNATURE[1]);
    let shape = DRAWN.get(which).map(|&id| Shape {
        id,
        direction_deg: draw.angle_deg(),
        sign: if draw.below(2) == 0 { 1.0 } else { -1.0 },
        table_harmonic: 1.0 + draw.below(4) as f64,
        frequency_hz: draw.scale(0.3, 30.0),
        largest_readout_v: settings.amplitude_v * detection.max(1.0),
    });
    let Some(shape) = shape else { return Setup { settings, drawn: None, signature: [0.0; 2] } };
    let drawn = of_signature(&settings, &shape, ratio);
    let signature = signature(&settings, &recorded(&settings, None), drawn);
    settings.effects.push(drawn);
    Setup { settings, drawn: Some(drawn), signature }
}

/// The size at which a shape leaves `ratio` times the noise floor beside the declared model; the drive's skew, which
/// the declared model takes up whole in the angle, at which its signature as such is that large.
fn of_signature(settings: &Settings, shape: &Shape, ratio: f64) -> EffectSetting {
    let plain = recorded(settings, None);
    let which = usize::from(shape.id != EffectId::ActuationSkew);
    let seen = |size: f64| signature(settings, &plain, shape.sized(size))[which];
    if shape.id == EffectId::DetectionSaturation {
        let (mut low, mut high) = (1e-6_f64, 1.0_f64);
        for _ in 0..20 {
            let middle = (low * high).sqrt();
            if seen(middle) < ratio { low = middle } else { high = middle }
        }
        return shape.sized(low);
    }
    let mut size = 1e-5;
    for _ in 0..3 {
        size *= ratio / seen(size);
        if shape.id == EffectId::ActuationSkew {
            size = size.min(LARGEST_ACTUATION_SKEW);
        }
    }
    shape.sized(size)
}

/// A noiseless rotation run: its purpose, and time, pattern angle and precession per deg/s of its settled rows.
struct Recorded {
    held_out: bool,
    rate_dps: f64,
    t_s: Vec<f64>,
    theta_rad: Vec<f64>,
}

fn recorded(settings: &Settings, extra: Option<EffectSetting>) -> Vec<Recorded> {
    let mut settings = Settings { noise_v: 0.0, ..settings.clone() };
    settings.effects.extend(extra);
    // the runs keep their places: a run's start angle goes by its number
    scenario(settings).simulate().runs.iter().filter_map(rotation).collect()
}

fn rotation(simulated: &SimulatedRun) -> Option<Recorded> {
    let Run::Rotation { rate_dps, settle_s, purpose, .. } = &simulated.run else { return None };
    let column = |name| simulated.column(name).unwrap();
    let [t, xc, xs, yc, ys] = ["t_s", "xc_v", "xs_v", "yc_v", "ys_v"].map(column);
    let rows: Vec<usize> = (0..t.len()).filter(|&i| t[i] >= *settle_s).collect();
    Some(Recorded {
        held_out: *purpose == Purpose::Holdout,
        rate_dps: *rate_dps,
        t_s: rows.iter().map(|&i| t[i]).collect(),
        theta_rad: rows.iter().map(|&i| Envelope::new(xc[i], xs[i], yc[i], ys[i]).pendulum().angle()).collect(),
    })
}

/// What an effect adds to the angle of the held-out runs, rms over the noise floor: less each run's best line, and
/// less the second harmonics that a detection gain mismatch and anisodamping make of all runs together.
fn signature(settings: &Settings, plain: &[Recorded], extra: EffectSetting) -> [f64; 2] {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    let mut held_out: Vec<(f64, Vector3<f64>)> = Vec::new();
    for (with, without) in recorded(settings, Some(extra)).iter().zip(plain) {
        let change = with.theta_rad.iter().zip(&without.theta_rad).map(|(a, b)| wrapped(a - b, PI));
        let change = straightened(&without.t_s, &unwrapped(change));
        let taken_up =
            [|sin: f64, _: f64, _: f64| sin, |sin, _, slow| sin * slow, |_, cos, slow| cos * slow].map(|f| {
                let values = without.theta_rad.iter().map(|theta| {
                    let (sin, cos) = (2.0 * theta).sin_cos();
                    f(sin, cos, 100.0 / without.rate_dps)
                });
                straightened(&without.t_s, &values.collect::<Vec<_>>())
            });
        for (i, change) in change.into_iter().enumerate() {
            let row = Vector3::new(taken_up[0][i], taken_up[1][i], taken_up[2][i]);
            normal += row * row.transpose();
            right += row * change;
            if without.held_out {
                held_out.push((change, row));
            }
        }
    }
    let coefficients = normal.try_inverse().unwrap() * right;
    let floor = settings.noise_v / settings.amplitude_v;
    let n = held_out.len() as f64;
    let whole = (held_out.iter().map(|(change, _)| change * change).sum::<f64>() / n).sqrt();
    let left = held_out.iter().map(|(change, row)| (change - row.dot(&coefficients)).powi(2)).sum::<f64>() / n;
    [whole / floor, left.sqrt() / floor]
}

fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut last = 0.0;
    let follow = |angle: f64| {
        last += wrapped(angle - last, PI);
        last
    };
    angles.map(follow).collect()
}

/// `y` less its best line over `x`.
fn straightened(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let (sxy, sxx) =
        x.iter().zip(y).fold((0.0, 0.0), |(sxy, sxx), (x, y)| (sxy + (x - mx) * (y - my), sxx + (x - mx) * (x - mx)));
    x.iter().zip(y).map(|(x, y)| y - my - sxy / sxx * (x - mx)).collect()
}

/// How a trial came out.
struct Outcome {
    seed: u64,
    setup: Setup,
    answer: String,
    named: bool,
    /// discovered beyond what was drawn, a second time included
    false_claims: usize,
    over_floor: f64,
    /// parameters of a rightly named effect whose interval holds the truth, and all with an interval
    parameters: [usize; 2],
    /// the same for detection ratio, actuation ratio and angular gain
    gains: [[usize; 2]; 3],
    details: String,
}

fn outcome(seed: u64) -> Outcome {
    let setup = setup(seed);
    let drawn = setup.drawn.map(|d| d.id.description().id);
    let mut outcome = Outcome {
        seed,
        answer: String::new(),
        named: false,
        false_claims: 0,
        over_floor: f64::NAN,
        parameters: [0; 2],
        gains: [[0; 2]; 3],
        details: String::new(),
        setup,
    };
    let identified = match identify(outcome.setup.settings.clone()) {
        Ok(identified) => identified,
        Err(refusal) => {
            outcome.answer = "refused".into();
            outcome.details = refusal.to_string();
            return outcome;
        }
    };
    let discovered = found(&identified, Origin::Discovered);
    let empirical = found(&identified, Origin::Empirical);
    outcome.named = empirical.is_empty() && discovered.iter().copied().eq(drawn);
    let right = usize::from(drawn.is_some_and(|drawn| discovered.contains(&drawn)));
    outcome.false_claims = discovered.len() - right;
    let labels = discovered.iter().map(|id| (*id).to_owned()).chain(empirical.iter().map(|id| format!("({id})")));
    outcome.answer = labels.collect::<Vec<_>>().join(" + ");
    if outcome.answer.is_empty() {
        outcome.answer = "nothing".into();
    }
    outcome.over_floor = over_floor(&identified);
    if let Some(drawn) = outcome.setup.drawn.filter(|_| outcome.named) {
        outcome.parameters = parameters_held(&identified, drawn.id, &drawn.values);
    }
    outcome.gains = gains_held(&identified, &outcome.setup.settings);
    outcome.details = details(&identified);
    outcome
}

/// Of the parameters of `id` that are reported with an interval: those whose interval holds the truth, and all.
fn parameters_held(identified: &Identification, id: EffectId, truth: &Values<f64>) -> [usize; 2] {
    let description = id.description();
    let reported = &identified.report.effects.iter().find(|e| e.id == description.id).unwrap().parameters;
    let mut count = [0; 2];
    let mut compare = |name: &str, truth: f64, period: Option<f64>| {
        let interval = reported.iter().find(|p| p.name == name).and_then(|p| p.ci95.map(|ci| (p.value, ci)));
        if let Some((value, [low, high])) = interval {
            let near = period.map_or(truth, |period| value + wrapped(truth - value, period));
            count[1] += 1;
            count[0] += usize::from(low <= near && near <= high);
        }
    };
    for shown in description.shown {
        match *shown {
            Shown::Plain(p) => compare(description.parameters[p].name, truth[p], None),
            Shown::Polar { cos, sin, magnitude, angle, division, .. } => {
                compare(magnitude, truth[cos].hypot(truth[sin]), None);
                compare(angle, truth[sin].atan2(truth[cos]).to_degrees() / division, Some(360.0 / division));
            }
        }
    }
    count
}

fn gains_held(identified: &Identification, settings: &Settings) -> [[usize; 2]; 3] {
    let set = |id| settings.effects.iter().find(|e| e.id == id).unwrap().values[0];
    let r = &identified.report;
    [
        (r.detection_gain_ratio, set(EffectId::DetectionGainMismatch)),
        (r.actuation_gain_ratio, set(EffectId::ActuationGainMismatch)),
        (Some(r.angular_gain), settings.angular_gain),
    ]
    .map(|(estimate, truth)| match estimate {
        Some(estimate) => [usize::from(holds(&estimate, truth)), 1],
        None => [0; 2],
    })
}

/// What the identification says of how it came to its answer.
fn details(identified: &Identification) -> String {
    let steps = identified.steps.iter().map(|s| {
        let rivals: Vec<String> = s.rivals.iter().map(|(id, gain)| format!("{id} {gain:.0}")).collect();
        format!("{:?} {} by {:.0} (rivals: {})", s.origin, s.id, s.gain, rivals.join(", "))
    });
    let left = identified
        .report
        .unexplained
        .iter()
        .map(|u| format!("unexplained {} n={:?} f={:?} {:.5}°", u.class, u.n, u.frequency_hz, u.rms_deg));
    let h = &identified.report.heldout;
    let sizes = format!(
        "declared {:.5}° discovered {:.5}° floor {:.5}°",
        h.declared.rms_deg, h.discovered.rms_deg, h.noise_floor_deg
    );
    steps.chain(left).chain([sizes]).collect::<Vec<_>>().join("; ")
}

/// Parameters of the drawn effect, to be read.
fn values(drawn: &EffectSetting) -> String {
    drawn.parameters().map(|(p, v)| format!("{}={v:.4e}", p.name)).collect::<Vec<_>>().join(" ")
}

/// Which effect was drawn and what was answered, how often, and how many of the answers were right.
fn print_confusion(outcomes: &[Outcome]) {
    let mut table: BTreeMap<&str, (usize, BTreeMap<&str, usize>)> = BTreeMap::new();
    for o in outcomes {
        let drawn = o.setup.drawn.map_or("nothing", |d| d.id.description().id);
        let row = table.entry(drawn).or_default();
        row.0 += usize::from(o.named);
        *row.1.entry(&o.answer).or_default() += 1;
    }
    println!("\n{:<22}{:>5}{:>7}   answers", "drawn", "n", "right");
    for (drawn, (right, answers)) in table {
        let n: usize = answers.values().sum();
        let list: Vec<String> = answers.iter().map(|(answer, count)| format!("{answer}: {count}")).collect();
        println!("{drawn:<22}{n:>5}{right:>7}   {}", list.join(", "));
    }
}

fn print_misses(outcomes: &[Outcome]) {
    println!("\nnot named rightly, or left more than 1.3 times the floor:");
    for o in outcomes.iter().filter(|o| !o.named || o.over_floor > 1.3) {
        let drawn = o.setup.drawn.map_or("nothing".into(), |d| format!("{} {}", d.id, values(&d)));
        println!(
            "seed {}: {drawn}; signature {:.1}, {:.1} beside the declared model, × floor ({:.1e} V) → {}; {:.3} × floor\n    {}",
            o.seed,
            o.setup.signature[0],
            o.setup.signature[1],
            o.setup.settings.noise_v,
            o.answer,
            o.over_floor,
            o.details
        );
    }
}

#[test]
fn a_hidden_effect_is_named_and_none_is_named_where_none_is() {
    let count = trials(TRIALS);
    let outcomes = all(count, outcome);
    print_confusion(&outcomes);
    print_misses(&outcomes);

    let mut ratios: Vec<f64> = outcomes.iter().map(|o| o.over_floor).collect();
    ratios.sort_by(f64::total_cmp);
    let at = |share: f64| ratios[((ratios.len() - 1) as f64 * share).round() as usize];
    let sum = |f: &dyn Fn(&Outcome) -> [usize; 2]| {
        outcomes.iter().map(f).fold([0; 2], |[held, all], [h, a]| [held + h, all + a])
    };
    println!("\nheld-out over floor: median {:.3}, 90 % {:.3}, largest {:.3}", at(0.5), at(0.9), at(1.0));
    println!("intervals that hold the truth: parameters of named effects {:?},", sum(&|o| o.parameters));
    println!(
        "    detection ratio {:?}, actuation ratio {:?}, angular gain {:?}",
        sum(&|o| o.gains[0]),
        sum(&|o| o.gains[1]),
        sum(&|o| o.gains[2])
    );
    let named = outcomes.iter().filter(|o| o.named).count();
    let claims: usize = outcomes.iter().map(|o| o.false_claims).sum();
    let blanks: Vec<&Outcome> = outcomes.iter().filter(|o| o.setup.drawn.is_none()).collect();
    let on_blanks = blanks.iter().filter(|o| o.false_claims > 0).count();
    println!(
        "{count} trials: {named} answered rightly; false discoveries: {claims} in all, on {on_blanks} of {} blanks",
        blanks.len()
    );
    assert!(on_blanks <= FALSE_DISCOVERIES, "{on_blanks} of {} blanks", blanks.len());
}
