//! What a hypothesis says of one sample: the vibration behind the readout, how it must move, and the slopes of both.

use cvg_estimator::direction::{Direction, major_axis};
use cvg_model::effects::{EffectId, MAX_PARAMETERS, Moment, Stage, Values};
use cvg_model::{ActuationGains, AxisForces, ControlOutputs, Envelope, Real};

use crate::model::hypothesis::{Hypothesis, Member, Unknown};
use crate::model::jet::Jet;
use crate::model::unknowns::{Lanes, Unknowns};
use crate::recording::Instrument;

/// The controllers' outputs around one sample, V and V/s.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Commands {
    pub(crate) now: ControlOutputs<f64>,
    pub(crate) change_per_s: ControlOutputs<f64>,
    /// what is put out across the pattern besides, in quadrature with it
    pub(crate) across: f64,
    /// how fast the pattern turned that they were computed from, rad/s
    pub(crate) turn_rad_s: f64,
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
    /// where no commands were recorded: what the loops turn the pattern by, rad, for a unit of ln a and of the quadrature
    /// that they make
    pub(crate) steering: [f64; 2],
    /// slopes of the four and of the steering by ln a against the unknowns, in their order
    pub(crate) slopes: Vec<[f64; 5]>,
    /// what each link of the readout gave, with slopes
    undone: Vec<Envelope<Jet<LINK>>>,
}

/// Index of the quantities of [`Vibration`] in its slopes.
pub(crate) mod quantity {
    pub(crate) const THETA: usize = 0;
    pub(crate) const LN_AMPLITUDE: usize = 1;
    pub(crate) const THETA_RATE: usize = 2;
    pub(crate) const GROWTH: usize = 3;
    pub(crate) const STEERING: usize = 4;
}

/// Effects that act in one stage, one after the other, with their values.
type Chain<T> = Vec<(EffectId, Values<T>)>;

/// Components of an envelope.
const COMPONENTS: usize = 4;
/// What the envelope behind a link of the readout is differentiated against: the one before it, then the parameters.
const LINK: usize = COMPONENTS + MAX_PARAMETERS;

/// An effect of the readout that is undone, and where the slopes of its parameters belong.
struct Link {
    id: EffectId,
    values: Values<Jet<LINK>>,
    columns: [Option<usize>; MAX_PARAMETERS],
}

/// A hypothesis made ready to be asked about many samples: its members sorted by stage, their values with the slopes
/// that are asked for.
pub(crate) struct Predictor<'h> {
    pub(crate) hypothesis: &'h Hypothesis,
    unknowns: &'h Unknowns,
    /// last effect first; empty where none of its parameters is an unknown
    readout: Vec<Link>,
    /// as they are, and without slopes of their own for vibrations that have them
    mechanics: Chain<f64>,
    mechanics_of_jets: Chain<Jet<COMPONENTS>>,
    /// columns of mechanics unknowns, and the effect with a one in that place: mechanics are linear
    units: Vec<(usize, EffectId, Values<f64>)>,
    actuation: Drive<f64>,
    /// for each group of lanes
    actuation_of_jets: Vec<Drive<Jet>>,
    /// the same of unit scale: what a loop does that nobody recorded
    loops: Vec<Drive<Jet>>,
    /// for each group of lanes
    input: Vec<Chain<Jet>>,
}

/// What makes forces of commands.
struct Drive<T> {
    force_scale: T,
    control_latency_s: T,
    effects: Chain<T>,
}

impl<'h> Predictor<'h> {
    /// Makes `hypothesis` ready for slopes against `unknowns`.
    pub(crate) fn new(hypothesis: &'h Hypothesis, unknowns: &'h Unknowns) -> Self {
        let jets = |stage: Stage, lanes: &Lanes| -> Chain<Jet> {
            hypothesis.acting(stage).map(|(i, m)| (m.id, lanes.values(i, m))).collect()
        };
        let plain = |stage| -> Chain<f64> { hypothesis.acting(stage).map(|(_, m)| (m.id, m.values)).collect() };
        let mechanics = plain(Stage::Mechanics);
        let of_column = |&column: &usize| match unknowns.all[column] {
            Unknown::Effect(member, p) => {
                let mut unit = [0.0; MAX_PARAMETERS];
                unit[p] = 1.0;
                Some((column, hypothesis.members[member].id, unit))
            }
            _ => None,
        };
        let drive = |lanes: &Lanes, force_scale| Drive {
            force_scale,
            control_latency_s: lanes.jet(hypothesis.control_latency_s, lanes.control_latency),
            effects: jets(Stage::Actuation, lanes),
        };
        let link = |(member, m): (usize, &Member)| Link {
            id: m.id,
            values: std::array::from_fn(|p| Jet::unknown(m.values[p], COMPONENTS + p)),
            columns: unknowns.columns_of(member),
        };
        let readout = hypothesis.acting(Stage::Readout).rev().filter(|_| unknowns.of_the_readout);
        let forcing = unknowns.forcing.iter();
        Self {
            hypothesis,
            unknowns,
            readout: readout.map(link).collect(),
            mechanics_of_jets: mechanics.iter().map(|(id, values)| (*id, values.map(Jet::constant))).collect(),
            mechanics,
            units: unknowns.mechanics.iter().filter_map(of_column).collect(),
            actuation: Drive {
                force_scale: hypothesis.force_scale,
                control_latency_s: hypothesis.control_latency_s,
                effects: plain(Stage::Actuation),
            },
            actuation_of_jets: forcing
                .clone()
                .map(|lanes| drive(lanes, lanes.jet(hypothesis.force_scale, lanes.force_scale)))
                .collect(),
            loops: forcing.map(|lanes| drive(lanes, Jet::constant(1.0))).collect(),
            input: unknowns.input.iter().map(|lanes| jets(Stage::Input, lanes)).collect(),
        }
    }

    /// One sample: the readout `seen`, the commands given then; without them the precession by the loops is inferred from what
    /// they hold, and growth is that without forces.
    pub(crate) fn predict(
        &self,
        seen: Envelope<f64>,
        commands: Option<Commands>,
        at: &Moment<f64>,
        out: &mut Vibration,
    ) {
        use quantity::{GROWTH, THETA_RATE};
        let (hypothesis, unknowns) = (self.hypothesis, self.unknowns);
        let recorded = commands.is_some();
        out.slopes.clear();
        out.slopes.resize(unknowns.all.len(), [0.0; 5]);
        let drives =
            unknowns.forcing.iter().zip(&self.actuation_of_jets).filter(|(lanes, _)| !lanes.columns.is_empty());
        let commands = commands.filter(|_| hypothesis.force_scale != 0.0 || drives.clone().next().is_some());
        let driven = commands.map(|v| (v, major_axis(&seen, &seen.pendulum())));
        let forced = driven.as_ref().map(|(v, axis)| self.actuation.rate(v, axis, at, |x| x));
        let mechanical = hypothesis.instrument == Instrument::Gyroscope;
        let z = self.undo_readout(seen, at, out);
        self.add_readout(&z, forced.as_ref(), at, out);
        out.theta = hypothesis.bearing(&z);
        out.envelope = z;
        out.ln_amplitude = 0.5 * z.pendulum().e.ln();
        (out.theta_rate, out.growth, out.steering) = (0.0, 0.0, [0.0; 2]);
        if !mechanical {
            return;
        }
        let gradient = Gradient::of(&z);
        self.add_mechanics(&z, &gradient, at, out);
        if !recorded {
            self.steer(&seen, &gradient, at, out);
        }
        if let Some(rate) = forced {
            let (turn, grow) = gradient.along(&rate);
            out.theta_rate += turn;
            out.growth += grow;
        }
        if let Some((v, axis)) = driven {
            for (lanes, drive) in drives {
                let rate = drive.rate(&v, &axis, at, Jet::constant);
                for (lane, &i) in lanes.columns.iter().enumerate() {
                    let (turn, grow) = gradient.along(&part(&rate, |j| j.slope[lane]));
                    out.slopes[i][THETA_RATE] += turn;
                    out.slopes[i][GROWTH] += grow;
                }
            }
        }
    }

    /// The vibration behind the readout, with what each link gave on the way.
    fn undo_readout(&self, seen: Envelope<f64>, at: &Moment<f64>, out: &mut Vibration) -> Envelope<f64> {
        out.undone.clear();
        if self.readout.is_empty() {
            return self.hypothesis.unread(seen, at);
        }
        let moment = at.map(Jet::constant);
        self.readout.iter().fold(seen, |e, link| {
            let undone = link.id.unread(&link.values, by_component(&e), &moment);
            out.undone.push(undone);
            part(&undone, |j| j.value)
        })
    }

    /// Slopes against the readout's parameters by the chain rule: how bearing, ln of the amplitude and the rate of the pattern
    /// change with the vibration `z`, then with what stood before each link, from the last one undone to the first.
    fn add_readout(&self, z: &Envelope<f64>, forced: Option<&Envelope<f64>>, at: &Moment<f64>, out: &mut Vibration) {
        use quantity::{LN_AMPLITUDE, THETA, THETA_RATE};
        if self.readout.is_empty() {
            return;
        }
        let jets: Envelope<Jet<COMPONENTS>> = by_component(z);
        let mut gradients = [[0.0; COMPONENTS]; 3];
        gradients[THETA] = self.hypothesis.bearing(&jets).slope;
        let Envelope { x_c, x_s, y_c, y_s } = *z * (1.0 / z.pendulum().e);
        gradients[LN_AMPLITUDE] = [x_c, x_s, y_c, y_s];
        if self.hypothesis.instrument == Instrument::Gyroscope {
            gradients[THETA_RATE] = jets.precession(&self.rate_of(&jets, forced, at)).slope;
        }
        for (link, undone) in self.readout.iter().zip(&out.undone).rev() {
            // d(quantity) against every lane of this link
            let along = gradients.map(|[x_c, x_s, y_c, y_s]| {
                let mut sums = [0.0; LINK];
                for (component, gradient) in
                    [(&undone.x_c, x_c), (&undone.x_s, x_s), (&undone.y_c, y_c), (&undone.y_s, y_s)]
                {
                    for (sum, slope) in sums.iter_mut().zip(&component.slope) {
                        *sum += gradient * slope;
                    }
                }
                sums
            });
            for (lane, column) in (COMPONENTS..).zip(&link.columns) {
                let Some(column) = *column else { continue };
                for (slope, along) in out.slopes[column].iter_mut().zip(&along) {
                    *slope = along[lane];
                }
            }
            gradients = along.map(|[x_c, x_s, y_c, y_s, ..]| [x_c, x_s, y_c, y_s]);
        }
    }

    /// What damping and mechanics do to the vibration, and a unit of each of their unknowns.
    fn add_mechanics(&self, z: &Envelope<f64>, gradient: &Gradient, at: &Moment<f64>, out: &mut Vibration) {
        use quantity::{GROWTH, THETA_RATE};
        for (id, values) in &self.mechanics {
            let (turn, grow) = gradient.along(&id.mechanics(values, z, at));
            out.theta_rate += turn;
            out.growth += grow;
        }
        for (i, id, unit) in &self.units {
            let (turn, grow) = gradient.along(&id.mechanics(unit, z, at));
            out.slopes[*i][THETA_RATE] = turn;
            out.slopes[*i][GROWTH] = grow;
        }
        if let Some(i) = self.unknowns.damping {
            out.slopes[i][GROWTH] = -1.0;
        }
        out.growth -= self.hypothesis.damping_per_s;
    }

    /// What the loops do where nobody recorded it: forces along the pattern as it is read, as large as hold amplitude and
    /// quadrature where they are seen to be, [v_as, v_qc] = M⁻¹ [ȧ/a − growth, Q̇ − widening] with growth and widening by
    /// the mechanics alone, and what these forces turn the pattern by. The parts with ȧ/a and Q̇ are left to whoever walks
    /// from sample to sample.
    fn steer(&self, seen: &Envelope<f64>, gradient: &Gradient, at: &Moment<f64>, out: &mut Vibration) {
        use quantity::{GROWTH, STEERING, THETA, THETA_RATE};
        let still = ControlOutputs { v_as: 0.0, v_qc: 0.0 };
        let axis = major_axis(seen, &seen.pendulum());
        let unit = |drive: &Drive<Jet>, now| {
            let held = Commands { now, change_per_s: still, across: 0.0, turn_rad_s: at.precession_rad_s };
            drive.rate(&held, &axis, at, Jet::constant)
        };
        let energies = self.loops.iter().map(|drive| unit(drive, ControlOutputs { v_as: 1.0, ..still }));
        let Some((first, energy)) = self.loops.first().zip(energies.clone().next()) else { return };
        let quadrature = part(&unit(first, ControlOutputs { v_qc: 1.0, ..still }), |j| j.value);
        let along = part(&energy, |j| j.value);
        let ((turn, grow), (turn_q, grow_q)) = (gradient.along(&along), gradient.along(&quadrature));
        let (widen, widen_q) = (gradient.widening(&along), gradient.widening(&quadrature));
        let determinant = grow * widen_q - grow_q * widen;
        let by_growth = (turn * widen_q - turn_q * widen) / determinant;
        let by_quadrature = (turn_q * grow - turn * grow_q) / determinant;
        out.steering = [by_growth, by_quadrature];
        for slope in &mut out.slopes {
            slope[STEERING] = -slope[THETA];
        }
        for (lanes, energy) in self.unknowns.forcing.iter().zip(energies) {
            for (lane, &i) in lanes.columns.iter().enumerate() {
                let (turned, grown) = gradient.along(&part(&energy, |j| j.slope[lane]));
                out.slopes[i][STEERING] = (turned - by_growth * grown) / grow;
            }
        }
        let widened: f64 =
            self.mechanics.iter().map(|(id, v)| gradient.widening(&id.mechanics(v, &out.envelope, at))).sum();
        out.theta_rate -= by_growth * out.growth + by_quadrature * widened;
        for slope in &mut out.slopes {
            slope[THETA_RATE] -= slope[STEERING] * out.growth + by_growth * slope[GROWTH];
        }
        for (i, id, unit) in &self.units {
            out.slopes[*i][THETA_RATE] -= by_quadrature * gradient.widening(&id.mechanics(unit, &out.envelope, at));
        }
    }

    /// How the mechanics and forces that do not depend on the readout move a vibration, per second.
    fn rate_of(
        &self,
        z: &Envelope<Jet<COMPONENTS>>,
        forced: Option<&Envelope<f64>>,
        at: &Moment<f64>,
    ) -> Envelope<Jet<COMPONENTS>> {
        let (start, at) = (forced.map_or_else(Envelope::zero, lifted), at.map(Jet::constant));
        self.mechanics_of_jets.iter().fold(start, |sum, (id, values)| sum + id.mechanics(values, z, &at))
    }

    /// By how much the rotation that reaches the resonator exceeds the nominal one, rad/s, with slopes against group `lanes` of
    /// the input parameters.
    pub(crate) fn excess_rate(&self, rate_rad_s: f64, at: &Moment<f64>, lanes: usize) -> Jet {
        let (at, nominal) = (at.map(Jet::constant), Jet::constant(rate_rad_s));
        self.input[lanes].iter().fold(nominal, |rate, (id, values)| id.input_rate(values, rate, &at)) - nominal
    }
}

impl<T: Real> Drive<T> {
    /// What the commands make of the envelope, per second: Equation 9 with the commands and the orientation of
    /// `control_latency_s` ago (outputs are held for a control period), through the actuation effects, which are of volts.
    #[inline]
    fn rate(
        &self,
        commands: &Commands,
        seen: &Direction<f64>,
        at: &Moment<f64>,
        lift: impl Fn(f64) -> T,
    ) -> Envelope<T> {
        let latency = self.control_latency_s;
        let (sin_late, cos_late) = (latency * lift(commands.turn_rad_s)).sin_cos();
        let (cos, sin) = (lift(seen.cos), lift(seen.sin));
        let held = |now: f64, change: f64| lift(now) - latency * lift(change);
        let (now, change) = (&commands.now, &commands.change_per_s);
        let v = ControlOutputs { v_as: held(now.v_as, change.v_as), v_qc: held(now.v_qc, change.v_qc) };
        let equal = ActuationGains { x: T::one(), y: T::one() };
        let (cos, sin) = (cos * cos_late + sin * sin_late, sin * cos_late - cos * sin_late);
        let along = equal.axis_forces_along(&v, cos, sin);
        let across = lift(commands.across);
        let volts = AxisForces { x_s: along.x_s - across * sin, y_s: along.y_s + across * cos, ..along };
        let at = at.map(&lift);
        let forces = self.effects.iter().fold(volts, |f, (id, values)| id.actuate(values, f, &at));
        forces.envelope_rate(T::one()) * self.force_scale
    }
}

/// One number of each component.
#[inline]
fn part<const N: usize>(e: &Envelope<Jet<N>>, of: impl Fn(Jet<N>) -> f64) -> Envelope<f64> {
    Envelope::new(of(e.x_c), of(e.x_s), of(e.y_c), of(e.y_s))
}

/// An envelope of which each component is an unknown of its own, in the first lanes.
#[inline]
fn by_component<const N: usize>(e: &Envelope<f64>) -> Envelope<Jet<N>> {
    let [x_c, x_s, y_c, y_s] = [e.x_c, e.x_s, e.y_c, e.y_s];
    Envelope::new(Jet::unknown(x_c, 0), Jet::unknown(x_s, 1), Jet::unknown(y_c, 2), Jet::unknown(y_s, 3))
}

/// An envelope that does not depend on the unknowns.
#[inline]
fn lifted<const N: usize>(e: &Envelope<f64>) -> Envelope<Jet<N>> {
    Envelope::new(Jet::constant(e.x_c), Jet::constant(e.x_s), Jet::constant(e.y_c), Jet::constant(e.y_s))
}

/// How the pattern angle and ln of the amplitude change with the envelope: linear in its rate of change.
struct Gradient {
    theta: Envelope<f64>,
    growth: Envelope<f64>,
    quadrature: Envelope<f64>,
}

fn dot(g: &Envelope<f64>, d: &Envelope<f64>) -> f64 {
    g.x_c * d.x_c + g.x_s * d.x_s + g.y_c * d.y_c + g.y_s * d.y_s
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
        let quadrature = Envelope::new(z.y_s, -z.y_c, -z.x_s, z.x_c) * 2.0;
        Self { theta, growth: *z * (1.0 / p.e), quadrature }
    }

    /// (θ̇, ȧ/a) at the envelope's rate `d`.
    fn along(&self, d: &Envelope<f64>) -> (f64, f64) {
        (dot(&self.theta, d), dot(&self.growth, d))
    }

    /// Q̇ at the envelope's rate `d`.
    fn widening(&self, d: &Envelope<f64>) -> f64 {
        dot(&self.quadrature, d)
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
            steering: [0.0; 2],
            slopes: Vec::new(),
            undone: Vec::new(),
        }
    }
}
