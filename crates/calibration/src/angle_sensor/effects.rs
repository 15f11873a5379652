//! An identified sensor in the words of the library: its readout as library effects with intervals, its table, lines and
//! following of motion as what they are, and the hypothesis that undoes them.

use cvg_model::effects::{EffectId, MAX_PARAMETERS, harmonic_n};

use super::deviations::{Deviations, values};
use super::model::{Outcome, SensorModel};
use super::readout::{Kind, Readout};
use super::table_fit::Motion;
use crate::diagnostics::decomposition::{BLOCKS, STUDENT_19};
use crate::model::hypothesis::{ChannelClip, Hypothesis, Member, Origin};
use crate::numerics::angles::phase;
use crate::recording::Instrument;
use crate::report::named::{ACCELERATION_LAG, ANGLE_TABLE, DETECTION_CLIP};
use crate::report::{EffectReport, Estimate, ParameterReport};

/// How many values of the library a readout has.
pub(crate) const LIBRARY_VALUES: usize = 6;

/// Values of a readout in the parameters of the library.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LibraryReadout {
    /// offsets of x and y, in the unit of the channels
    pub(crate) offset: [f64; 2],
    /// G_Dy/G_Dx
    pub(crate) gain_ratio: f64,
    pub(crate) skew: f64,
    /// mean cubic and half the difference of x and y, per unit of the channels squared
    pub(crate) kappa: f64,
    pub(crate) kappa_difference: f64,
    /// amplitude of the vibration behind the readout, in the unit of the channels
    pub(crate) amplitude: f64,
}

impl From<&Readout> for LibraryReadout {
    /// A (1 − ¾κ) u + A κ u³ is a v (1 + ¾κ_L a² v²) with a = A (1 − ¾κ): the same in other words.
    fn from(r: &Readout) -> Self {
        let [kx, ky] = r.cubics();
        let (fundamental_x, fundamental_y) = (1.0 - 0.75 * kx, 1.0 - 0.75 * ky);
        let amplitude = r.amplitude * r.radius * fundamental_x;
        let gain = r.p[2].exp();
        let gain_ratio = gain * fundamental_y / fundamental_x;
        let cubic =
            |kappa: f64, gain: f64| 4.0 / 3.0 * kappa * gain * r.amplitude * r.radius.powi(3) / amplitude.powi(3);
        let [x, y] = [cubic(kx, 1.0), cubic(ky, gain) / gain_ratio];
        Self {
            offset: [r.centre[0] + r.amplitude * r.p[0], r.centre[1] + r.amplitude * r.p[1]],
            gain_ratio,
            skew: r.p[3] * gain / gain_ratio,
            kappa: 0.5 * (x + y),
            kappa_difference: 0.5 * (x - y),
            amplitude,
        }
    }
}

impl LibraryReadout {
    /// Offsets, gain ratio, skew, cubics.
    pub(crate) fn values(&self) -> [f64; LIBRARY_VALUES] {
        [self.offset[0], self.offset[1], self.gain_ratio, self.skew, self.kappa, self.kappa_difference]
    }
}

fn interval(value: f64, deviation: f64) -> Option<[f64; 2]> {
    deviation.is_finite().then_some([value - STUDENT_19 * deviation, value + STUDENT_19 * deviation])
}

fn parameter(name: &str, unit: &str, value: f64, deviation: f64) -> ParameterReport {
    ParameterReport { name: name.into(), unit: unit.into(), value, ci95: interval(value, deviation) }
}

fn effect(id: &str, origin: Origin, parameters: Vec<ParameterReport>, evidence: String) -> EffectReport {
    EffectReport {
        id: id.into(),
        origin,
        parameters,
        heldout_rms_deg: None,
        evidence,
        confounded_with: Vec::new(),
        separated_by: None,
    }
}

/// An identified sensor with the deviations of what was fitted.
pub(crate) struct Described<'a> {
    pub(crate) model: &'a SensorModel,
    pub(crate) deviations: &'a Deviations,
}

impl Described<'_> {
    /// k, in the sign that the campaign states, or else of Equation 1: positive against the reference.
    pub(crate) fn angular_gain(&self, sense: Option<f64>) -> Estimate {
        let (gain, deviation) = self.signed_gain();
        let sign = if sense.unwrap_or(-gain).is_sign_negative() { -1.0 } else { 1.0 };
        let value = sign * gain.abs();
        Estimate { value, ci95: [value - STUDENT_19 * deviation, value + STUDENT_19 * deviation] }
    }

    /// The gain of θ over the reference, and its deviation: none where it is exact.
    pub(super) fn signed_gain(&self) -> (f64, f64) {
        let shape = &self.model.table.shape;
        let at = shape.motion.size();
        if !shape.free_gain {
            return (self.model.sensor.gain, 0.0);
        }
        (self.model.sensor.gain + self.model.table.side[at], self.deviations.side[at])
    }

    /// G_Dy/G_Dx, where offset, gain and skew were fitted.
    pub(crate) fn gain_ratio(&self) -> Option<Estimate> {
        let (readout, _) = self.model.readout.as_ref().filter(|(r, _)| r.kind >= Kind::Affine)?;
        let value = LibraryReadout::from(readout).gain_ratio;
        let ci95 = interval(value, self.deviations.readout[2])?;
        Some(Estimate { value, ci95 })
    }

    /// Every effect that the data supports.
    pub(crate) fn effects(&self) -> Vec<EffectReport> {
        if self.model.outcome == Outcome::Neutral {
            return Vec::new();
        }
        let mut out = self.readout_effects();
        out.extend(self.motion_effects());
        out.extend(self.table_effect());
        out.extend(self.line_effects());
        out
    }

    /// What is undone, where there are no [effects](Self::effects) that it could be said of.
    pub(super) fn said_without_effects(&self) -> Option<String> {
        let readout = self.model.front().filter(|_| self.effects().is_empty())?;
        undone_without_a_name(readout, &self.deviations.readout).filter(|_| self.model.outcome != Outcome::Neutral)
    }

    fn evidence(&self) -> String {
        let of = if self.model.by_radius { "of the radius" } else { "of the angle" };
        let degrees =
            |v: f64| if self.model.by_radius { format!("{v:.4}") } else { format!("{:.4}°", v.to_degrees()) };
        let before = self.model.predicted_raw.map_or(String::new(), |raw| format!(", {} as recorded", degrees(raw)));
        format!(
            "blocked cross-validation within the fitted rows leaves {} {of} with all that was found{before}; interval by \
             jackknife over {BLOCKS} blocks",
            degrees(self.model.predicted)
        )
    }

    fn readout_effects(&self) -> Vec<EffectReport> {
        let Some((readout, _)) = &self.model.readout else { return Vec::new() };
        readout_effects(readout, &self.deviations.readout, &self.evidence())
    }

    fn motion_effects(&self) -> Vec<EffectReport> {
        let (side, d) = (&self.model.table.side, &self.deviations.side);
        let gain = self.model.sensor.gain;
        let lag = || {
            let p = vec![parameter("latency", "s", -side[0] / gain, d[0] / gain.abs())];
            let signature = EffectId::AngleLatency.description().signature;
            let evidence = format!("{signature}; {}", self.evidence());
            effect(library_id(EffectId::AngleLatency), self.model.origin_of_motion(), p, evidence)
        };
        match self.model.table.shape.motion {
            Motion::None => Vec::new(),
            Motion::Direction => {
                let p = vec![
                    parameter("n", "1", 0.0, f64::NAN),
                    parameter("amplitude", "rad", side[0] * gain.signum(), d[0]),
                    parameter("scaling", "1", harmonic_n::scaling::DIRECTION, f64::NAN),
                ];
                let evidence = format!("a constant that changes sign with the direction; {}", self.evidence());
                vec![effect(library_id(EffectId::HarmonicN), Origin::Empirical, p, evidence)]
            }
            Motion::Rate => vec![lag()],
            Motion::RateAndAcceleration => {
                let p = vec![parameter("acceleration_lag", "s^2", -side[1] / gain, d[1] / gain.abs())];
                let evidence = format!("angle ∝ acceleration, as of a type-II tracking loop; {}", self.evidence());
                let late = (side[0] != 0.0).then(lag);
                late.into_iter().chain([effect(ACCELERATION_LAG.id, Origin::Empirical, p, evidence)]).collect()
            }
        }
    }

    fn table_effect(&self) -> Option<EffectReport> {
        let table = &self.model.table.table;
        let parameters: Vec<ParameterReport> = (0..table.cos.len())
            .flat_map(|i| {
                [
                    parameter(&format!("cos_{}", i + 1), "rad", table.cos[i], self.deviations.cos[i]),
                    parameter(&format!("sin_{}", i + 1), "rad", table.sin[i], self.deviations.sin[i]),
                ]
            })
            .collect();
        let form = match table.form {
            crate::model::angle_table::Form::Own => "written in the sensor's own angle",
            crate::model::angle_table::Form::Forward => "written in the true angle and inverted",
        };
        let (repeats, tested) = if self.model.by_radius {
            (
                "repeats against the command, of the sensor or of the drive",
                format!("interval by jackknife over {BLOCKS} blocks"),
            )
        } else {
            ("repeats with position and no effect of the library explains it", self.evidence())
        };
        let evidence = format!("{repeats}: a Fourier series of {} harmonics, {form}; {tested}", table.cos.len());
        (!parameters.is_empty()).then(|| effect(ANGLE_TABLE.id, Origin::Empirical, parameters, evidence))
    }

    fn line_effects(&self) -> Vec<EffectReport> {
        let shape = &self.model.table.shape;
        let first = shape.side() - 2 * shape.lines.len();
        let (side, d) = (&self.model.table.side, &self.deviations.side);
        let line = |(i, n): (usize, &u32)| {
            let (c, s) = (side[first + 2 * i], side[first + 2 * i + 1]);
            let (dc, ds) = (d[first + 2 * i], d[first + 2 * i + 1]);
            let size = c.hypot(s).max(f64::MIN_POSITIVE);
            // what stations at one phase see of a line is the least that it can be, and where it peaks they do not tell
            let at_one_phase = self.model.table.at_one_phase[i];
            let of_phase = if at_one_phase { f64::NAN } else { (s * dc).hypot(c * ds) / (size * size) };
            let p = vec![
                parameter("n", "1", f64::from(*n), f64::NAN),
                parameter("amplitude", "rad", size, (c * dc).hypot(s * ds) / size),
                parameter("phase", "deg", phase(c, -s).to_degrees(), of_phase.to_degrees()),
            ];
            let told = if at_one_phase { ", of which the stations tell one phase" } else { "" };
            let evidence = format!("{n} per turn of the reference, beyond the table{told}; {}", self.evidence());
            effect(library_id(EffectId::TableHarmonic), Origin::Empirical, p, evidence)
        };
        shape.lines.iter().enumerate().map(line).collect()
    }

    /// What a compensation undoes: readout, following of motion, table. Lines belong to the reference and not to the
    /// sensor, and are left out, as is a table against a command, which may be the drive's.
    pub(crate) fn hypothesis(&self, sense: Option<f64>) -> Hypothesis {
        let m = self.model;
        let gain = self.angular_gain(sense).value;
        let mut h = Hypothesis::ideal(Instrument::Sensor, m.sensor.period, gain);
        // Equation 1 counts against the input
        h.follows_input = gain * self.signed_gain().0 > 0.0;
        if m.outcome == Outcome::Neutral {
            return h;
        }
        let mut admit = |id: EffectId, origin: Origin, values: [f64; 4]| {
            let at = h.members.partition_point(|m| m.id <= id);
            h.members.insert(at, Member { id, values, origin, refined: true });
        };
        for (id, origin, values) in m.front().map(readout_members).unwrap_or_default() {
            admit(id, origin, values);
        }
        let side = &m.table.side;
        match m.table.shape.motion {
            Motion::None => {}
            Motion::Direction => {
                let amplitude = side[0] * m.sensor.gain.signum();
                admit(EffectId::HarmonicN, Origin::Empirical, [0.0, amplitude, 0.0, harmonic_n::scaling::DIRECTION]);
            }
            Motion::RateAndAcceleration if side[0] == 0.0 => {}
            Motion::Rate | Motion::RateAndAcceleration => {
                admit(EffectId::AngleLatency, m.origin_of_motion(), [-side[0] / m.sensor.gain, 0.0, 0.0, 0.0]);
            }
        }
        h.angle_table = (!m.by_radius && !m.table.table.cos.is_empty()).then(|| m.table.table.clone());
        h.clip = m.front().and_then(clip);
        h
    }
}

/// The effects of a readout beside its gain ratio, and where their values stand.
fn others(kind: Kind) -> impl Iterator<Item = (EffectId, &'static [usize])> {
    let cubics: &[usize] = if kind == Kind::Cubic { &[4] } else { &[4, 5] };
    let all: [(Kind, EffectId, &[usize]); 3] = [
        (Kind::Offset, EffectId::DetectionOffset, &[0, 1]),
        (Kind::Affine, EffectId::DetectionSkew, &[3]),
        (Kind::Cubic, EffectId::DetectionCubic, cubics),
    ];
    all.into_iter().filter(move |(from, ..)| kind >= *from).map(|(_, id, at)| (id, at))
}

/// Values of a readout that are undone and no further from nothing than their intervals, with the names of the library.
fn unnamed(readout: &Readout, d: &[f64]) -> Option<String> {
    let v = values(readout);
    let is_unnamed = |at: &[usize]| at.iter().all(|&i| v[i].abs() <= STUDENT_19 * d[i]);
    let named = |(id, at): (EffectId, &[usize])| {
        let each = at.iter().zip(id.description().parameters).map(|(&i, p)| format!(" {} {:.2e}", p.name, v[i]));
        each.collect::<String>()
    };
    let all: String = others(readout.kind).filter(|(_, at)| is_unnamed(at)).map(named).collect();
    (!all.is_empty()).then_some(all)
}

/// What is undone where no effect of a readout is told from nothing.
pub(crate) fn undone_without_a_name(readout: &Readout, d: &[f64]) -> Option<String> {
    let values = unnamed(readout, d).filter(|_| readout.kind > Kind::Plain)?;
    Some(format!("what is undone is no further from nothing than its intervals, and no effect is named:{values}"))
}

/// A readout in the words of the library, with the deviations of its values.
pub(crate) fn readout_effects(readout: &Readout, d: &[f64], evidence: &str) -> Vec<EffectReport> {
    let v = values(readout);
    let significant = |i: usize, neutral: f64| (v[i] - neutral).abs() > STUDENT_19 * d[i];
    let mut out = Vec::new();
    let mut add = |id: EffectId, origin: Origin, at: &[usize]| {
        let library = id.description().parameters;
        let parameters = at.iter().zip(library).map(|(&i, p)| parameter(p.name, p.unit, v[i], d[i])).collect();
        out.push(effect(library_id(id), origin, parameters, format!("{}; {evidence}", id.description().signature)));
    };
    if readout.kind >= Kind::Affine {
        add(EffectId::DetectionGainMismatch, Origin::Declared, &[2]);
    }
    for (id, at) in others(readout.kind).filter(|(_, at)| at.iter().any(|i| significant(*i, 0.0))) {
        add(id, Origin::Discovered, at);
    }
    for (at, (id, _)) in readout.texts.iter().enumerate() {
        let first = LIBRARY_VALUES + at * MAX_PARAMETERS;
        let all: Vec<usize> = (first..first + id.description().parameters.len()).collect();
        add(*id, Origin::Discovered, &all);
    }
    if readout.rails.any() {
        let limits =
            readout.rails.limits.iter().flatten().zip(DETECTION_CLIP.parameters).filter(|(l, _)| l.is_finite());
        let rails = limits.map(|(l, (name, unit))| parameter(name, unit, *l, f64::NAN));
        let evidence = "the extreme value of the channel occurs far more often than the level beside it: a converter \
                        at its rail; the other channel and the radius stand in for it";
        out.push(effect(DETECTION_CLIP.id, Origin::Discovered, rails.collect(), evidence.into()));
    }
    if let Some((first, values)) = out.first_mut().zip(unnamed(readout, d)) {
        first.evidence.push_str("; undone with it, no further from nothing than their intervals:");
        first.evidence.push_str(&values);
    }
    out
}

/// A readout as members of a hypothesis.
pub(crate) fn readout_members(readout: &Readout) -> Vec<(EffectId, Origin, [f64; 4])> {
    let v = LibraryReadout::from(readout);
    let mut out = Vec::new();
    if readout.kind >= Kind::Offset {
        out.push((EffectId::DetectionOffset, Origin::Discovered, [v.offset[0], v.offset[1], 0.0, 0.0]));
    }
    if readout.kind >= Kind::Affine {
        out.push((EffectId::DetectionGainMismatch, Origin::Declared, [v.gain_ratio, 0.0, 0.0, 0.0]));
        out.push((EffectId::DetectionSkew, Origin::Discovered, [v.skew, 0.0, 0.0, 0.0]));
    }
    if readout.kind >= Kind::Cubic {
        out.push((EffectId::DetectionCubic, Origin::Discovered, [v.kappa, v.kappa_difference, 0.0, 0.0]));
    }
    out.extend(readout.texts.iter().map(|(id, values)| (*id, Origin::Discovered, *values)));
    out
}

/// The rails of a readout, where one was reached.
pub(crate) fn clip(readout: &Readout) -> Option<ChannelClip> {
    let amplitude_v = LibraryReadout::from(readout).amplitude;
    readout.rails.any().then_some(ChannelClip { rails_v: readout.rails.limits, amplitude_v })
}

fn library_id(id: EffectId) -> &'static str {
    id.description().id
}
