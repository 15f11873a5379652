//! Random campaigns for a blind trial: a device, its mechanics and noise, the rates, and none, one or two undeclared
//! effects of the library, each at a size that is told by what it leaves beside the declared model.

use std::f64::consts::{PI, TAU};

use cvg_model::Envelope;
use cvg_model::effects::EffectId;
use cvg_simulator::scenario::{EffectSetting, Purpose, Run, Temperature};
use cvg_simulator::{Settings, SimulatedRun};
use nalgebra::{Matrix3, Vector3};

use crate::bench::{Draws, effect, plain_paper, polar, scenario};
use crate::domain::wrapped;

/// What is drawn. A latency without the table's angle is not: the recorded channels cannot show it.
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
/// What the electronics add that a split, a thermometer or another amplitude tells: drawn first on [`ELECTRONICS`].
const OF_ELECTRONICS: [EffectId; 5] = [
    EffectId::DetectionPhase,
    EffectId::DriveFeedthrough,
    EffectId::Temperature,
    EffectId::DetectionQuintic,
    EffectId::ActuationPhase,
];
/// What the drives can't put out, on [`DRIVEN`].
const OF_DRIVES: [EffectId; 1] = [EffectId::DriveSaturation];
/// How many effects a campaign gets: none in one of six, two in two of six.
const COUNTS: [usize; 6] = [0, 1, 1, 1, 2, 2];
/// rms of the drawn signature over the noise floor of the held-out angle.
const SIGNATURE: [f64; 2] = [2.0, 50.0];
/// The largest skew of a drive that is drawn, whatever its signature is.
const LARGEST_ACTUATION_SKEW: f64 = 0.3;

/// Drives are asked for so many per cent more than their level at most: beyond 4/π of it no command gets what is asked for.
const LARGEST_OVERDRIVE: f64 = 25.0;

/// What campaigns are drawn from.
#[derive(Debug, Clone, Copy)]
pub struct Bench {
    /// split of the frequencies, Hz
    split_hz: [f64; 2],
    /// the first effect is one of these; the others are any of those that every bench has
    first: &'static [EffectId],
}

/// A balanced device: the effects that any campaign tells.
pub const BALANCED: Bench = Bench { split_hz: [0.0, 0.05], first: &[] };
/// A device with a split that makes the commands go with the angle, at temperatures that differ from run to run.
pub const ELECTRONICS: Bench = Bench { split_hz: [0.05, 0.4], first: &OF_ELECTRONICS };

/// A device like that whose drives can't put out what it asks for.
pub const DRIVEN: Bench = Bench { split_hz: [0.05, 0.4], first: &OF_DRIVES };

/// Shape of an undeclared effect: everything but its size.
struct Shape {
    id: EffectId,
    direction_deg: f64,
    sign: f64,
    table_harmonic: f64,
    frequency_hz: f64,
    /// of what may saturate, the readout or a drive
    largest_v: f64,
    /// shares of the four factors of a feed-through
    shares: [f64; 4],
}

impl Shape {
    /// The effect at a size: of its parameter, of its pair of parameters, or by how much the readout is overdriven.
    fn sized(&self, size: f64) -> EffectSetting {
        let (sin, cos) = self.direction_deg.to_radians().sin_cos();
        match self.id {
            EffectId::DetectionOffset | EffectId::SpringCubic => effect(self.id, &[size * cos, size * sin]),
            EffectId::TableHarmonic => effect(self.id, &[self.table_harmonic, size * cos, size * sin]),
            EffectId::TimePeriodic => effect(self.id, &[self.frequency_hz, size * cos, size * sin]),
            EffectId::DriveFeedthrough => effect(self.id, &self.shares.map(|share| size * share)),
            EffectId::DetectionSaturation | EffectId::DriveSaturation => {
                effect(self.id, &[(1.0 + size) / self.largest_v])
            }
            _ => effect(self.id, &[self.sign * size]),
        }
    }
}

/// An undeclared effect of a campaign.
#[derive(Debug, Clone, Copy)]
pub struct Drawn {
    /// the effect at its size
    pub effect: EffectSetting,
    /// rms over the noise floor: of the whole signature, and of what the declared model cannot take up
    pub signature: [f64; 2],
}

impl Drawn {
    /// The size that counts: what the effect leaves beside the declared model; the drive's skew, which the declared
    /// model takes up whole in the angle, as such; of drives that clip, which the angle hardly shows, by how many per cent the
    /// largest command is over the level.
    pub fn size(&self) -> f64 {
        self.signature[judged_by(self.effect.id)]
    }

    /// Its identifier.
    pub fn id(&self) -> &'static str {
        self.effect.id.description().id
    }
}

fn judged_by(id: EffectId) -> usize {
    usize::from(id != EffectId::ActuationSkew)
}

/// A campaign as it was drawn.
#[derive(Debug, Clone)]
pub struct Setup {
    /// what is simulated
    pub settings: Settings,
    /// what is in it that nobody declared
    pub drawn: Vec<Drawn>,
}

/// The campaign of a seed on a bench.
///
/// # Panics
/// Where the paper's scenario has other runs than those that are drawn here.
pub fn setup(bench: &Bench, seed: u64) -> Setup {
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
        polar(
            EffectId::Anisoelasticity,
            TAU * draw.between(bench.split_hz[0], bench.split_hz[1]),
            draw.angle_deg(),
            2.0,
        ),
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
    if bench.first.contains(&EffectId::Temperature) {
        let [start_c, drift_k_per_s, step_k] =
            [(15.0, 35.0), (-0.02, 0.02), (-4.0, 4.0)].map(|(a, b)| draw.between(a, b));
        settings.temperature = Some(Temperature { start_c, drift_k_per_s, step_k, reference_c: 25.0 });
    }
    let mut ids: Vec<EffectId> = DRAWN.to_vec();
    let mut first = bench.first.to_vec();
    let mut drawn = Vec::new();
    for _ in 0..COUNTS[draw.below(COUNTS.len())] {
        let ratio = draw.scale(SIGNATURE[0], SIGNATURE[1]);
        let from = if first.is_empty() { &mut ids } else { &mut first };
        let id = from.swap_remove(draw.below(from.len()));
        let shape = Shape {
            id,
            direction_deg: draw.angle_deg(),
            sign: if draw.below(2) == 0 { 1.0 } else { -1.0 },
            table_harmonic: 1.0 + draw.below(4) as f64,
            frequency_hz: draw.scale(0.3, 30.0),
            largest_v: if id == EffectId::DriveSaturation {
                largest_drive(&settings)
            } else {
                settings.amplitude_v * detection.max(1.0)
            },
            shares: if bench.first.is_empty() { [0.0; 4] } else { std::array::from_fn(|_| draw.between(-1.0, 1.0)) },
        };
        first.clear();
        let (effect, signature) = if id == EffectId::DriveSaturation {
            let over = ratio.min(LARGEST_OVERDRIVE);
            (shape.sized(0.01 * over), [over; 2])
        } else {
            let effect = of_signature(&settings, &shape, ratio);
            (effect, signature(&settings, &recorded(&settings, None), effect))
        };
        drawn.push(Drawn { effect, signature });
        settings.effects.push(effect);
    }
    Setup { settings, drawn }
}

/// The size at which a shape leaves `ratio` times the noise floor beside the declared model; the drive's skew, which
/// the declared model takes up whole in the angle, at which its signature as such is that large.
fn of_signature(settings: &Settings, shape: &Shape, ratio: f64) -> EffectSetting {
    let plain = recorded(settings, None);
    let which = judged_by(shape.id);
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

/// The largest voltage that any drive is commanded to in a rotation of a device that gets it.
pub fn largest_drive(settings: &Settings) -> f64 {
    let settings = Settings { noise_v: 0.0, ..settings.clone() };
    let runs = scenario(settings).simulate().runs;
    let of = |simulated: &SimulatedRun| {
        let Run::Rotation { settle_s, .. } = &simulated.run else { return 0.0 };
        let column = |name| simulated.column(name).expect("a column of a rotation run");
        let [t, xc, xs, yc, ys] = ["t_s", "xc_v", "xs_v", "yc_v", "ys_v"].map(column);
        let [v_as, v_qc] = ["vas_v", "vqc_v"].map(column);
        let rows = (0..t.len()).filter(|&i| t[i] >= *settle_s).map(|i| {
            let (sin, cos) = Envelope::new(xc[i], xs[i], yc[i], ys[i]).pendulum().angle().sin_cos();
            let (x, y) = ((v_as[i] * cos).hypot(v_qc[i] * sin), (v_as[i] * sin).hypot(v_qc[i] * cos));
            x.max(y)
        });
        rows.fold(0.0, f64::max)
    };
    runs.iter().map(of).fold(0.0, f64::max)
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
    let column = |name| simulated.column(name).expect("a column of a rotation run");
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
    let coefficients = normal.try_inverse().expect("runs at several rates") * right;
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
