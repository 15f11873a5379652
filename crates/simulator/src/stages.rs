//! A scenario's effects, sorted into the stages where they act and asked, once, how they behave there.
//!
//! Linear mechanics and linear drives go into the exact propagation; what follows the table's angle belongs to the
//! table. Both are found by trying the effect, not by its name, so that a new effect of the library needs no line here.

use cvg_model::effects::{EffectId, Moment, Stage, Values};
use cvg_model::resonator::envelope::{detuning, precession};
use cvg_model::{AxisForces, Envelope};

/// An effect with the values of its parameters.
pub type Setting = (EffectId, Values<f64>);

/// Effects by stage, each list in the order of [`EffectId::ALL`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stages {
    /// on the rate of the table itself
    pub table: Vec<Setting>,
    /// on the rate that reaches the instrument, after the table's
    pub input: Vec<Setting>,
    /// mechanics that are linear in the envelope, and the same at every moment
    pub linear: Vec<Setting>,
    /// mechanics that are not either
    pub nonlinear: Vec<Setting>,
    /// an isotropic nonlinear spring
    pub spring: Option<Spring>,
    /// on the forces, in proportion to the commands, and the same at every moment
    pub actuation: Vec<Setting>,
    /// on the forces before these, and not either
    pub limiting: Vec<Setting>,
    /// on the readout
    pub readout: Vec<Setting>,
}

/// An isotropic nonlinear spring, averaged over the carrier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// c of θ̇ += cQ, rad/s/V²
    pub precession: f64,
    /// of ω += this times E, rad/s/V²
    pub frequency: f64,
}

impl Spring {
    /// The envelope's rate of change by it, V/s.
    #[inline]
    pub fn envelope_rate(&self, e: &Envelope<f64>) -> Envelope<f64> {
        let p = e.pendulum();
        precession(self.precession * p.q, e) + detuning(self.frequency * p.e, e)
    }
}

impl Stages {
    /// Sorts `effects`, given in any order.
    pub fn new(effects: &[Setting]) -> Self {
        let mut stages = Self::default();
        // what was written down as text acts before or after what the library has
        let written =
            |first: bool| effects.iter().filter(move |(id, _)| !id.in_library() && id.acts_on_angle() == first);
        let drives_are_constant =
            effects.iter().all(|(id, _)| id.description().stage != Stage::Actuation || is_constant(*id));
        let library = EffectId::ALL.iter().flat_map(|id| effects.iter().filter(move |(e, _)| e == id));
        for setting in written(true).chain(library).chain(written(false)) {
            let (id, values) = setting;
            let list = match id.description().stage {
                Stage::Input if follows_table(*id, values) => &mut stages.table,
                Stage::Input => &mut stages.input,
                Stage::Mechanics if is_constant(*id) && is_linear(|e| id.mechanics(values, e, &Moment::origin())) => {
                    &mut stages.linear
                }
                Stage::Mechanics => &mut stages.nonlinear,
                // what comes behind a drive that changes is put behind it
                Stage::Actuation if id.limits_drives() || !drives_are_constant => &mut stages.limiting,
                Stage::Actuation => &mut stages.actuation,
                Stage::Readout => &mut stages.readout,
            };
            list.push(*setting);
        }
        stages
    }

    /// The table's own rate and the rate that reaches the instrument, rad/s, when `rate_rad_s` is commanded.
    #[inline]
    pub fn rates(&self, rate_rad_s: f64, at: &Moment<f64>) -> (f64, f64) {
        let through = |list: &[Setting], rate| list.iter().fold(rate, |r, (id, v)| id.input_rate(v, r, at));
        let table = through(&self.table, rate_rad_s);
        (table, through(&self.input, table))
    }

    /// Whether the rate that reaches the instrument is always the commanded one.
    pub fn rate_is_nominal(&self) -> bool {
        self.table.is_empty() && self.input.is_empty()
    }

    /// What the drives put out of the commands `f`, as far as they can.
    #[inline]
    pub fn limited(&self, f: AxisForces<f64>, at: &Moment<f64>) -> AxisForces<f64> {
        self.limiting.iter().fold(f, |f, (id, v)| id.actuate(v, f, at))
    }

    /// The forces that the drives make of what they put out, `f`: linear.
    #[inline]
    pub fn actuate(&self, f: AxisForces<f64>) -> AxisForces<f64> {
        self.actuation.iter().fold(f, |f, (id, v)| id.actuate(v, f, &Moment::origin()))
    }

    /// The readout of the vibration `e`.
    #[inline]
    pub fn read(&self, e: Envelope<f64>, at: &Moment<f64>) -> Envelope<f64> {
        self.readout.iter().fold(e, |e, (id, v)| id.read(v, e, at))
    }
}

/// An effect of the mechanics or of the drives that is the same at every moment.
fn is_constant(id: EffectId) -> bool {
    !id.by_temperature()
}

/// The rate depends on the table's angle: the effect is the table's own motion, and its angle reference sees it.
fn follows_table(id: EffectId, values: &Values<f64>) -> bool {
    let rate = |table_rad| id.input_rate(values, 1.0, &Moment { table_rad, ..Moment::default() });
    (1..16).any(|i| rate(0.4 * f64::from(i)) != rate(0.0))
}

/// f is linear: it is the matrix of its values on the four unit envelopes, tried on envelopes of different shapes.
pub(crate) fn is_linear(f: impl Fn(&Envelope<f64>) -> Envelope<f64>) -> bool {
    let columns = unit_envelopes().map(|e| f(&e));
    let trials = [[0.7, -0.1, 0.4, 0.2], [-2.0, 0.3, 1.1, 0.0], [0.01, 0.0, -0.03, 0.02]];
    trials.iter().all(|t| {
        let sum = columns.iter().zip(t).fold(Envelope::zero(), |sum, (c, k)| sum + *c * *k);
        let [x_c, x_s, y_c, y_s] = *t;
        let off = f(&Envelope::new(x_c, x_s, y_c, y_s)) - sum;
        let size = |e: &Envelope<f64>| e.pendulum().e.sqrt();
        size(&off) <= 1e-12 * columns.iter().map(size).sum::<f64>()
    })
}

/// The four unit envelopes, in the order x_c, x_s, y_c, y_s.
pub(crate) fn unit_envelopes() -> [Envelope<f64>; 4] {
    [
        Envelope::new(1.0, 0.0, 0.0, 0.0),
        Envelope::new(0.0, 1.0, 0.0, 0.0),
        Envelope::new(0.0, 0.0, 1.0, 0.0),
        Envelope::new(0.0, 0.0, 0.0, 1.0),
    ]
}
