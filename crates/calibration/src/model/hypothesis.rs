//! A hypothesis: the instrument as it is believed to be, with a value for everything that a fit may adjust.
//!
//! Its members are effects of the library and nothing else. Undoing the readout effects gives the vibration; the
//! input, mechanics and actuation effects say how that vibration must move. [`crate::model::prediction`] says both of one
//! sample, with slopes; [`crate::estimation::propagation`] strings samples together.

use cvg_estimator::direction::major_axis;
use cvg_model::effects::{EffectId, Moment, Role, Search, Shown, Stage, Values};
use cvg_model::{Envelope, Real};
use serde::{Deserialize, Serialize};

use crate::model::angle_table::AngleTable;
use crate::recording::Instrument;

/// How an effect came into a hypothesis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// part of the paper's model
    Declared,
    /// taken from the library because the residual asked for it
    Discovered,
    /// no effect of the library explains it
    Empirical,
}

/// An effect with its values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Member {
    /// the effect
    pub id: EffectId,
    /// values of its parameters
    pub values: Values<f64>,
    /// how it came in
    pub origin: Origin,
    /// its refined parameters are adjusted too
    pub refined: bool,
}

/// The instrument as it is believed to be.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// with mechanics and loops, or a two-channel sensor
    pub instrument: Instrument,
    /// period of its angle, rad: π for a pattern, 2π for a full turn
    pub period_rad: f64,
    /// angular gain k of Equation 1, θ = −kα + θ_b
    pub angular_gain: f64,
    /// a sensor whose campaign counts the other way, θ = +kα + θ_b
    pub follows_input: bool,
    /// mean force scale √(G_Ax G_Ay)/2ω, V of the readout per s and V of command
    pub force_scale: f64,
    /// age of the forces that act, s: half a control period, and what the electronics add
    pub control_latency_s: f64,
    /// 1/τ, 1/s
    pub damping_per_s: f64,
    /// effects, in the library's order; one with a searched parameter may be there more than once
    pub members: Vec<Member>,
    /// an angle sensor's table of what repeats with position and no effect explains
    pub angle_table: Option<AngleTable>,
    /// channels cut off by their converters, after all readout effects
    pub clip: Option<ChannelClip>,
    /// the temperature that parameters refer to, °C, where one was recorded
    pub reference_c: Option<f64>,
    /// a rate gyroscope's bias, rad/s
    pub rate_bias_rad_s: f64,
    /// how much more it is for every kelvin beyond `reference_c`, rad/s/K
    pub rate_bias_per_k_rad_s: f64,
}

/// Channels of a sensor that are cut off at the rails of their converters. A channel at a rail says "at least"; the other
/// one and the amplitude, which a sensor holds, tell it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ChannelClip {
    /// lower and upper rail of x and of y, V; infinite where none is reached
    pub rails_v: [[f64; 2]; 2],
    /// amplitude of the vibration behind the readout, V
    pub amplitude_v: f64,
}

impl ChannelClip {
    /// The vibration `z` that was undone from the readout `e`, with a channel at its rail put right.
    fn restored(&self, e: &Envelope<f64>, z: Envelope<f64>) -> Envelope<f64> {
        let reached = |v: f64, [low, high]: [f64; 2]| v <= low || v >= high;
        let other = |v: f64| (self.amplitude_v.powi(2) - v * v).max(0.0).sqrt();
        match [reached(e.x_c, self.rails_v[0]), reached(e.y_c, self.rails_v[1])] {
            [true, false] => Envelope { x_c: z.x_c.signum() * other(z.y_c).max(z.x_c.abs()), ..z },
            [false, true] => Envelope { y_c: z.y_c.signum() * other(z.x_c).max(z.y_c.abs()), ..z },
            _ => z,
        }
    }
}

/// Something a fit adjusts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unknown {
    /// k
    AngularGain,
    /// mean force scale
    ForceScale,
    /// control latency
    ControlLatency,
    /// 1/τ
    Damping,
    /// a parameter of a member: index of the member, index of the parameter
    Effect(usize, usize),
}

impl Hypothesis {
    /// An ideal instrument.
    pub fn ideal(instrument: Instrument, period_rad: f64, angular_gain: f64) -> Self {
        Self {
            instrument,
            period_rad,
            angular_gain,
            follows_input: false,
            force_scale: 0.0,
            control_latency_s: 0.0,
            damping_per_s: 0.0,
            members: Vec::new(),
            angle_table: None,
            clip: None,
            reference_c: None,
            rate_bias_rad_s: 0.0,
            rate_bias_per_k_rad_s: 0.0,
        }
    }

    /// Adds an effect at its neutral values and gives its index.
    pub fn admit(&mut self, id: EffectId, origin: Origin) -> usize {
        let at = self.members.partition_point(|m| m.id <= id);
        self.members.insert(at, Member { id, values: id.neutral(), origin, refined: false });
        at
    }

    /// By how much the output is stamped late, s.
    pub(crate) fn latency_s(&self) -> f64 {
        self.member(EffectId::AngleLatency).map_or(0.0, |m| m.values[0])
    }

    /// The first member that is `id`.
    pub fn member(&self, id: EffectId) -> Option<&Member> {
        self.members.iter().find(|m| m.id == id)
    }

    /// Index of the first member that is `id`.
    pub fn position(&self, id: EffectId) -> Option<usize> {
        self.members.iter().position(|m| m.id == id)
    }

    /// Everything a fit may adjust about the effects: their fitted parameters, and the refined ones where asked for.
    pub fn effect_unknowns(&self) -> Vec<Unknown> {
        let adjusted = |m: &Member, role: Role| match role {
            Role::Fitted | Role::Located(_) => true,
            Role::Refined => m.refined,
            Role::Searched(_) | Role::Chosen(_) => false,
        };
        // a constant has no sine
        let does_nothing = |m: &Member, p: usize| {
            let d = m.id.description();
            let order = d.parameters.iter().position(|q| matches!(q.role, Role::Searched(Search::PatternHarmonic)));
            order.is_some_and(|n| m.values[n] == 0.0)
                && d.shown.iter().any(|shown| matches!(shown, Shown::Polar { sin, .. } if *sin == p))
        };
        self.members
            .iter()
            .enumerate()
            .flat_map(|(i, m)| m.id.description().parameters.iter().enumerate().map(move |(p, d)| (i, m, p, d.role)))
            .filter(|(_, m, p, role)| adjusted(m, *role) && !does_nothing(m, *p))
            .map(|(i, _, p, _)| Unknown::Effect(i, p))
            .collect()
    }

    /// The value of an unknown.
    pub fn get(&self, unknown: Unknown) -> f64 {
        match unknown {
            Unknown::AngularGain => self.angular_gain,
            Unknown::ForceScale => self.force_scale,
            Unknown::ControlLatency => self.control_latency_s,
            Unknown::Damping => self.damping_per_s,
            Unknown::Effect(i, p) => self.members[i].values[p],
        }
    }

    /// Sets an unknown, within the bounds of its parameter.
    pub fn set(&mut self, unknown: Unknown, value: f64) {
        match unknown {
            Unknown::AngularGain => self.angular_gain = value,
            // a drive that pushes the wrong way would not have settled
            Unknown::ForceScale => self.force_scale = value.max(0.0),
            Unknown::ControlLatency => self.control_latency_s = value,
            Unknown::Damping => self.damping_per_s = value,
            Unknown::Effect(i, p) => {
                let member = &mut self.members[i];
                let bounds = &member.id.description().parameters[p];
                member.values[p] = value.clamp(bounds.lower, bounds.upper);
            }
        }
    }

    /// −1 as in Equation 1, +1 where the angle is counted with the input.
    pub fn sense(&self) -> f64 {
        if self.follows_input { 1.0 } else { -1.0 }
    }

    /// Precession rate at the input rate, rad/s.
    pub fn precession(&self, rate_rad_s: f64) -> f64 {
        self.sense() * self.angular_gain * rate_rad_s
    }

    /// Bearing of an envelope within the period, rad.
    pub(crate) fn bearing<T: Real>(&self, e: &Envelope<T>) -> T {
        if self.period_rad > 4.0 { e.y_c.atan2(e.x_c) } else { e.pendulum().angle() }
    }

    /// The members that act in a stage, with their indices.
    pub(crate) fn acting(&self, stage: Stage) -> impl DoubleEndedIterator<Item = (usize, &Member)> {
        self.members.iter().enumerate().filter(move |(_, m)| m.id.description().stage == stage)
    }

    /// A readout effect is made of the drives' commands.
    pub(crate) fn reads_commands(&self) -> bool {
        self.acting(Stage::Readout).any(|(_, m)| m.id.on_commands())
    }

    /// The vibration behind a readout: the members' readout effects undone, last first. A table stands between those of the
    /// channels and those of the angle: it repeats with the angle that was read, and that may be late.
    pub fn unread(&self, e: Envelope<f64>, at: &Moment<f64>) -> Envelope<f64> {
        let undo = |z: Envelope<f64>, of_angle: bool| {
            let members = self.acting(Stage::Readout).rev().filter(move |(_, m)| m.id.acts_on_angle() == of_angle);
            members.fold(z, |z, (_, m)| m.id.unread(&m.values, z, at))
        };
        let channels = undo(e, false);
        let z = self.clip.map_or(channels, |clip| clip.restored(&e, channels));
        undo(self.angle_table.as_ref().map_or(z, |table| self.without(table, z)), true)
    }

    /// A vibration turned back by what a table adds to its angle.
    fn without(&self, table: &AngleTable, z: Envelope<f64>) -> Envelope<f64> {
        let theta = self.bearing(&z);
        let (sin, cos) = (table.undo(theta, std::f64::consts::TAU / self.period_rad) - theta).sin_cos();
        z.turned(sin, cos)
    }

    /// The fastest that an input effect changes, cycles of the table angle per turn; 0 without one.
    pub(crate) fn input_harmonic(&self) -> f64 {
        self.acting(Stage::Input)
            .map(|(_, m)| {
                m.id.description()
                    .parameters
                    .iter()
                    .position(|p| matches!(p.role, Role::Searched(_)))
                    .map_or(1.0, |i| m.values[i])
            })
            .fold(0.0, f64::max)
    }
}

/// The direction in which the electronics take the pattern to lie, rad over the full turn: Equation 4 with the sign of
/// the in-phase vibration, so that forces are applied with the right phase.
pub(crate) fn direction(e: &Envelope<f64>) -> f64 {
    major_axis(e, &e.pendulum()).angle()
}
