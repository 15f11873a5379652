//! A hypothesis: the instrument as it is believed to be, with a value for everything that a fit may adjust.
//!
//! Its members are effects of the library and nothing else. Undoing the readout effects gives the vibration; the
//! input, mechanics and actuation effects say how that vibration must move. This file evaluates both at one sample,
//! with slopes; [`crate::pass`] strings samples together.

use cvg_estimator::direction::{Direction, major_axis};
use cvg_model::effects::{EffectId, MAX_PARAMETERS, Moment, Role, Stage, Values};
use cvg_model::{ActuationGains, AxisForces, ControlOutputs, Envelope, Real};
use serde::{Deserialize, Serialize};

use crate::jet::{Jet, LANES};
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

/// The controllers' outputs around one sample, V and V/s.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Commands {
    pub(crate) now: ControlOutputs<f64>,
    pub(crate) change_per_s: ControlOutputs<f64>,
}

/// The vibration at one sample, as a hypothesis sees it, with slopes.
#[derive(Debug, Clone)]
pub(crate) struct Vibration {
    /// bearing of the pattern within its period, rad, and ln of the amplitude
    pub(crate) theta: f64,
    pub(crate) ln_amplitude: f64,
    /// the vibration itself
    pub(crate) envelope: Envelope<f64>,
    /// how fast the hypothesis lets it turn and grow besides −kΩ, rad/s and 1/s
    pub(crate) theta_rate: f64,
    pub(crate) growth: f64,
    /// slopes of the four against the unknowns, in their order
    pub(crate) slopes: Vec<[f64; 4]>,
}

/// Index of the four quantities of [`Vibration`] in its slopes.
pub(crate) mod quantity {
    pub(crate) const THETA: usize = 0;
    pub(crate) const LN_AMPLITUDE: usize = 1;
    pub(crate) const THETA_RATE: usize = 2;
    pub(crate) const GROWTH: usize = 3;
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
        }
    }

    /// Adds an effect at its neutral values and gives its index.
    pub fn admit(&mut self, id: EffectId, origin: Origin) -> usize {
        let at = self.members.partition_point(|m| m.id <= id);
        self.members.insert(at, Member { id, values: id.neutral(), origin, refined: false });
        at
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
        self.members
            .iter()
            .enumerate()
            .flat_map(|(i, m)| m.id.description().parameters.iter().enumerate().map(move |(p, d)| (i, m, p, d.role)))
            .filter(|(_, m, _, role)| adjusted(m, *role))
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

    /// The vibration behind a readout: the members' readout effects undone, last first.
    pub fn unread(&self, e: Envelope<f64>, at: &Moment<f64>) -> Envelope<f64> {
        self.members
            .iter()
            .rev()
            .filter(|m| m.id.description().stage == Stage::Readout)
            .fold(e, |e, m| m.id.unread(&m.values, e, at))
    }

    /// [`Hypothesis::unread`] with slopes against the unknowns of `lanes`.
    fn unread_jets(&self, e: Envelope<f64>, at: &Moment<f64>, lanes: &Lanes) -> Envelope<Jet> {
        let at = constant_moment(at);
        let constant = Jet::constant;
        let e = Envelope::new(constant(e.x_c), constant(e.x_s), constant(e.y_c), constant(e.y_s));
        self.members
            .iter()
            .enumerate()
            .rev()
            .filter(|(_, m)| m.id.description().stage == Stage::Readout)
            .fold(e, |e, (i, m)| m.id.unread(&lanes.values(i, m), e, &at))
    }

    /// What the commands make of the envelope, per second: Equation 9 with the commands and the orientation of
    /// `control_latency_s` ago (outputs are held for a control period), through the members' actuation effects. With slopes against `lanes`.
    fn forcing(&self, v: &Commands, seen: &Direction<f64>, precession_rad_s: f64, lanes: &Lanes) -> Envelope<Jet> {
        let scale = lanes.jet(self.force_scale, lanes.force_scale);
        let latency = lanes.jet(self.control_latency_s, lanes.control_latency);
        let (sin_late, cos_late) = (latency * Jet::constant(precession_rad_s)).sin_cos();
        let (cos, sin) = (Jet::constant(seen.cos), Jet::constant(seen.sin));
        let held = |now: f64, change: f64| Jet::constant(now) - latency * Jet::constant(change);
        let v =
            ControlOutputs { v_as: held(v.now.v_as, v.change_per_s.v_as), v_qc: held(v.now.v_qc, v.change_per_s.v_qc) };
        let equal = ActuationGains { x: scale, y: scale };
        self.members
            .iter()
            .enumerate()
            .filter(|(_, m)| m.id.description().stage == Stage::Actuation)
            .fold(
                equal.axis_forces_along(&v, cos * cos_late + sin * sin_late, sin * cos_late - cos * sin_late),
                |f: AxisForces<Jet>, (i, m)| m.id.actuate(&lanes.values(i, m), f),
            )
            .envelope_rate(Jet::one())
    }

    /// Evaluates one sample: the readout `seen`, the commands given then, slopes against `unknowns`.
    pub(crate) fn evaluate(
        &self,
        seen: Envelope<f64>,
        commands: Option<Commands>,
        at: &Moment<f64>,
        unknowns: &Unknowns,
        out: &mut Vibration,
    ) {
        use quantity::{GROWTH, LN_AMPLITUDE, THETA, THETA_RATE};
        out.slopes.clear();
        out.slopes.resize(unknowns.all.len(), [0.0; 4]);
        let forced = commands
            .filter(|_| self.force_scale != 0.0 || !unknowns.forcing.columns.is_empty())
            .map(|v| self.forcing(&v, &major_axis(&seen, &seen.pendulum()), at.precession_rad_s, &unknowns.forcing));
        let mechanical = self.instrument == Instrument::Gyroscope;
        let mut z = Envelope::zero();
        if unknowns.readout.is_empty() {
            z = self.unread(seen, at);
            out.theta = self.bearing(&z);
        }
        for lanes in &unknowns.readout {
            let jets = self.unread_jets(seen, at, lanes);
            let theta = self.bearing(&jets);
            let energy = jets.pendulum().e;
            let theta_rate = mechanical.then(|| jets.precession(&self.rate_of(&jets, forced.as_ref())));
            for (lane, &i) in lanes.columns.iter().enumerate() {
                out.slopes[i][THETA] = theta.slope[lane];
                out.slopes[i][LN_AMPLITUDE] = 0.5 * energy.slope[lane] / energy.value;
                out.slopes[i][THETA_RATE] = theta_rate.map_or(0.0, |r| r.slope[lane]);
            }
            z = Envelope::new(jets.x_c.value, jets.x_s.value, jets.y_c.value, jets.y_s.value);
            out.theta = theta.value;
        }
        let gradient = Gradient::of(&z);
        out.envelope = z;
        out.ln_amplitude = 0.5 * z.pendulum().e.ln();
        (out.theta_rate, out.growth) = (0.0, 0.0);
        if !mechanical {
            return;
        }
        for m in self.members.iter().filter(|m| m.id.description().stage == Stage::Mechanics) {
            let (turn, grow) = gradient.along(&m.id.mechanics(&m.values, &z));
            out.theta_rate += turn;
            out.growth += grow;
        }
        for &i in &unknowns.mechanics {
            if let Unknown::Effect(member, p) = unknowns.all[i] {
                let mut unit = [0.0; MAX_PARAMETERS];
                unit[p] = 1.0;
                let (turn, grow) = gradient.along(&self.members[member].id.mechanics(&unit, &z));
                out.slopes[i][THETA_RATE] = turn;
                out.slopes[i][GROWTH] = grow;
            }
        }
        if let Some(i) = unknowns.damping {
            out.slopes[i][GROWTH] = -1.0;
        }
        out.growth -= self.damping_per_s;
        let lanes = &unknowns.forcing;
        if let Some(rate) = forced {
            let part = |lane: Option<usize>| {
                let of = |j: Jet| lane.map_or(j.value, |l| j.slope[l]);
                Envelope::new(of(rate.x_c), of(rate.x_s), of(rate.y_c), of(rate.y_s))
            };
            let (turn, grow) = gradient.along(&part(None));
            out.theta_rate += turn;
            out.growth += grow;
            for (lane, &i) in lanes.columns.iter().enumerate() {
                let (turn, grow) = gradient.along(&part(Some(lane)));
                out.slopes[i][THETA_RATE] += turn;
                out.slopes[i][GROWTH] += grow;
            }
        }
    }

    /// How the mechanics and forces that do not depend on the readout move a vibration, per second.
    fn rate_of(&self, z: &Envelope<Jet>, forced: Option<&Envelope<Jet>>) -> Envelope<Jet> {
        let still = |j: Jet| Jet::constant(j.value);
        let start = forced
            .map_or_else(Envelope::zero, |f| Envelope::new(still(f.x_c), still(f.x_s), still(f.y_c), still(f.y_s)));
        self.members
            .iter()
            .filter(|m| m.id.description().stage == Stage::Mechanics)
            .fold(start, |sum, m| sum + m.id.mechanics(&m.values.map(Jet::constant), z))
    }

    /// By how much the rotation that reaches the resonator exceeds the nominal one, rad/s, with slopes against
    /// `lanes`.
    pub(crate) fn excess_rate(&self, rate_rad_s: f64, at: &Moment<f64>, lanes: &Lanes) -> Jet {
        let at = constant_moment(at);
        let nominal = Jet::constant(rate_rad_s);
        self.members
            .iter()
            .enumerate()
            .filter(|(_, m)| m.id.description().stage == Stage::Input)
            .fold(nominal, |rate, (i, m)| m.id.input_rate(&lanes.values(i, m), rate, &at))
            - nominal
    }

    /// The fastest that an input effect changes, cycles of the table angle per turn; 0 without one.
    pub(crate) fn input_harmonic(&self) -> f64 {
        self.members
            .iter()
            .filter(|m| m.id.description().stage == Stage::Input)
            .map(|m| {
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

fn constant_moment(at: &Moment<f64>) -> Moment<Jet> {
    Moment {
        t_s: Jet::constant(at.t_s),
        table_rad: Jet::constant(at.table_rad),
        precession_rad_s: Jet::constant(at.precession_rad_s),
    }
}

/// How the pattern angle and ln of the amplitude change with the envelope: linear in its rate of change.
struct Gradient {
    theta: Envelope<f64>,
    growth: Envelope<f64>,
}

impl Gradient {
    fn of(z: &Envelope<f64>) -> Self {
        let p = z.pendulum();
        let k = 1.0 / (p.r * p.r + p.s * p.s);
        // θ̇ = ½(RṠ − SṘ)/(R² + S²), written out in the components of the envelope's rate
        let theta = Envelope::new(
            k * (p.r * z.y_c - p.s * z.x_c),
            k * (p.r * z.y_s - p.s * z.x_s),
            k * (p.r * z.x_c + p.s * z.y_c),
            k * (p.r * z.x_s + p.s * z.y_s),
        );
        Self { theta, growth: *z * (1.0 / p.e) }
    }

    /// (θ̇, ȧ/a) at the envelope's rate `d`.
    fn along(&self, d: &Envelope<f64>) -> (f64, f64) {
        let dot = |g: &Envelope<f64>| g.x_c * d.x_c + g.x_s * d.x_s + g.y_c * d.y_c + g.y_s * d.y_s;
        (dot(&self.theta), dot(&self.growth))
    }
}

/// Up to [`LANES`] unknowns that are differentiated against together.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lanes {
    /// the column of each lane among all unknowns
    pub(crate) columns: Vec<usize>,
    /// lanes of each member's parameters
    of_members: Vec<[Option<usize>; MAX_PARAMETERS]>,
    force_scale: Option<usize>,
    control_latency: Option<usize>,
}

impl Lanes {
    fn new(columns: &[usize], all: &[Unknown], members: usize) -> Self {
        let mut lanes =
            Self { columns: columns.to_vec(), of_members: vec![[None; MAX_PARAMETERS]; members], ..Self::default() };
        for (lane, &column) in columns.iter().enumerate() {
            match all[column] {
                Unknown::Effect(i, p) => lanes.of_members[i][p] = Some(lane),
                Unknown::ForceScale => lanes.force_scale = Some(lane),
                Unknown::ControlLatency => lanes.control_latency = Some(lane),
                Unknown::AngularGain | Unknown::Damping => {}
            }
        }
        lanes
    }

    #[inline]
    fn jet(&self, value: f64, lane: Option<usize>) -> Jet {
        lane.map_or_else(|| Jet::constant(value), |l| Jet::unknown(value, l))
    }

    /// A member's values, those with a lane as unknowns.
    #[inline]
    fn values(&self, index: usize, member: &Member) -> Values<Jet> {
        let lanes = &self.of_members[index];
        std::array::from_fn(|p| self.jet(member.values[p], lanes[p]))
    }
}

/// The unknowns of a fit, sorted by what they act on.
#[derive(Debug, Clone)]
pub(crate) struct Unknowns {
    /// all, in the order of columns
    pub(crate) all: Vec<Unknown>,
    /// readout parameters, in groups of lanes
    pub(crate) readout: Vec<Lanes>,
    /// columns of mechanics parameters
    pub(crate) mechanics: Vec<usize>,
    /// force scale, control latency and actuation parameters
    pub(crate) forcing: Lanes,
    /// input parameters
    pub(crate) input: Lanes,
    /// column of k
    pub(crate) angular_gain: Option<usize>,
    /// column of 1/τ
    pub(crate) damping: Option<usize>,
}

impl Unknowns {
    pub(crate) fn new(hypothesis: &Hypothesis, all: Vec<Unknown>) -> Self {
        let at = |stage: Stage| -> Vec<usize> {
            (0..all.len())
                .filter(|&column| match all[column] {
                    Unknown::Effect(i, _) => hypothesis.members[i].id.description().stage == stage,
                    Unknown::ForceScale | Unknown::ControlLatency => stage == Stage::Actuation,
                    Unknown::AngularGain | Unknown::Damping => false,
                })
                .collect()
        };
        let members = hypothesis.members.len();
        let single = |columns: &[usize]| Lanes::new(&columns[..columns.len().min(LANES)], &all, members);
        Self {
            readout: at(Stage::Readout).chunks(LANES).map(|c| Lanes::new(c, &all, members)).collect(),
            mechanics: at(Stage::Mechanics),
            forcing: single(&at(Stage::Actuation)),
            input: single(&at(Stage::Input)),
            angular_gain: all.iter().position(|u| *u == Unknown::AngularGain),
            damping: all.iter().position(|u| *u == Unknown::Damping),
            all,
        }
    }
}

impl Vibration {
    pub(crate) fn new() -> Self {
        Self {
            theta: 0.0,
            ln_amplitude: 0.0,
            envelope: Envelope::new(0.0, 0.0, 0.0, 0.0),
            theta_rate: 0.0,
            growth: 0.0,
            slopes: Vec::new(),
        }
    }
}
