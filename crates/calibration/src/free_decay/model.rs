//! A resonator that rings freely, as it is believed to be: which terms its equations have, and what a run then shows.

use cvg_model::effects::{EffectId, Moment};
use nalgebra::Matrix4;

use super::runs::DecayRun;
use super::stokes::{self, Mechanics, State};

/// Something that a decay tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Term {
    /// 1/τ, 1/s
    Damping,
    /// Δ(1/τ) along the model's axis and at 45° to it, 1/s
    DampingAlong,
    /// see [`Term::DampingAlong`]
    DampingAcross,
    /// Δω along the model's axis and at 45° to it, rad/s
    SplitAlong,
    /// see [`Term::SplitAlong`]
    SplitAcross,
    /// k, where the input rate is known
    AngularGain,
    /// θ̇, rad/s, where it is not
    Precession,
    /// c, rad/s/V²
    Spring,
    /// γ, 1/s/V²
    DampingGrowth,
    /// G_Dy/G_Dx − 1
    GainRatio,
    /// s
    Skew,
    /// φ_y − φ_x between the channels, rad: of one that is sampled later than the other
    Phase,
    /// κ of X(1 + ¾κ|X|²), Y likewise, 1/V²
    ReadoutCubic,
    /// what the demodulator adds to x_c, V
    OffsetXc,
    /// to x_s
    OffsetXs,
    /// to y_c
    OffsetYc,
    /// to y_s
    OffsetYs,
    /// p cos φ of θ̇ = p sin(4θ + φ), rad/s
    SpringFourCos,
    /// p sin φ of it
    SpringFourSin,
}

/// What a demodulator adds to its outputs.
pub(crate) const OFFSETS: [Term; 4] = [Term::OffsetXc, Term::OffsetXs, Term::OffsetYc, Term::OffsetYs];

impl Term {
    /// Whether it is of the readout: what the channels make of the orbit, and nothing of its motion.
    pub(crate) fn is_readout(self) -> bool {
        matches!(self, Self::GainRatio | Self::Skew | Self::Phase | Self::ReadoutCubic) || OFFSETS.contains(&self)
    }

    /// The terms that come and go with it, which one cause makes: itself first.
    pub(crate) fn cause(self) -> &'static [Self] {
        match self {
            Self::Damping => &[Self::Damping],
            Self::DampingAlong => &[Self::DampingAlong],
            Self::DampingAcross => &[Self::DampingAcross],
            Self::SplitAlong => &[Self::SplitAlong],
            Self::SplitAcross => &[Self::SplitAcross],
            Self::AngularGain => &[Self::AngularGain],
            Self::Precession => &[Self::Precession],
            Self::Spring => &[Self::Spring],
            Self::DampingGrowth => &[Self::DampingGrowth],
            Self::GainRatio => &[Self::GainRatio],
            Self::Skew => &[Self::Skew],
            Self::Phase => &[Self::Phase],
            Self::ReadoutCubic => &[Self::ReadoutCubic],
            Self::OffsetXc | Self::OffsetXs | Self::OffsetYc | Self::OffsetYs => &OFFSETS,
            Self::SpringFourCos | Self::SpringFourSin => &[Self::SpringFourCos, Self::SpringFourSin],
        }
    }
}

/// Terms with their values; terms that are not there are 0.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Model {
    pub(crate) terms: Vec<Term>,
    pub(crate) values: Vec<f64>,
    /// the axis that anisotropies are resolved along, rad
    pub(crate) axis_rad: f64,
}

/// (R, S, Q) at the first instant of a run, V².
pub(crate) type Start = [f64; 3];

impl Model {
    pub(crate) fn new(terms: Vec<Term>, axis_rad: f64) -> Self {
        Self { values: vec![0.0; terms.len()], terms, axis_rad }
    }

    /// The same with a cause more, whose terms are absent yet; at the end.
    pub(crate) fn with(&self, cause: Term) -> Self {
        let mut more = self.clone();
        more.terms.extend(cause.cause());
        more.values.resize(more.terms.len(), 0.0);
        more
    }

    /// The same without a cause.
    pub(crate) fn without(&self, cause: Term) -> Self {
        let kept = || self.terms.iter().zip(&self.values).filter(|(t, _)| !cause.cause().contains(t));
        let (terms, values) = kept().map(|(t, v)| (*t, *v)).unzip();
        Self { terms, values, axis_rad: self.axis_rad }
    }

    /// The same with another cause in the place of one, absent yet; at the end, as one that is added.
    pub(crate) fn exchanged(&self, cause: Term, other: Term) -> Self {
        self.without(cause).with(other)
    }

    pub(crate) fn has(&self, term: Term) -> bool {
        self.terms.contains(&term)
    }

    pub(crate) fn value(&self, term: Term) -> f64 {
        self.terms.iter().position(|t| *t == term).map_or(0.0, |at| self.values[at])
    }

    /// An anisotropy resolved along the model's axis, resolved along X–Y.
    fn resolved(&self, along: Term, across: Term) -> [f64; 2] {
        let (sin, cos) = (2.0 * self.axis_rad).sin_cos();
        let (a, b) = (self.value(along), self.value(across));
        [a * cos - b * sin, a * sin + b * cos]
    }

    /// θ̇ of the input rotation, rad/s.
    pub(crate) fn precession(&self, rate_rad_s: f64) -> f64 {
        self.value(Term::Precession) - self.value(Term::AngularGain) * rate_rad_s
    }

    pub(crate) fn mechanics(&self, rate_rad_s: f64) -> Mechanics {
        Mechanics {
            damping_per_s: self.value(Term::Damping),
            anisodamping: self.resolved(Term::DampingAlong, Term::DampingAcross),
            anisoelasticity: self.resolved(Term::SplitAlong, Term::SplitAcross),
            precession_rad_s: self.precession(rate_rad_s),
            spring: self.value(Term::Spring),
            damping_growth: self.value(Term::DampingGrowth),
            spring_four: [self.value(Term::SpringFourCos), self.value(Term::SpringFourSin)],
        }
    }

    /// The vibration behind the readout of an envelope, of which so much of an offset is left.
    pub(crate) fn unread(&self, seen: &cvg_model::Envelope<f64>, of_offset: f64) -> cvg_model::Envelope<f64> {
        let [x_c, x_s, y_c, y_s] = OFFSETS.map(|t| self.value(t));
        let now = Moment::default();
        let alone = |value: f64| [value, 0.0, 0.0, 0.0];
        let e = *seen - cvg_model::Envelope::new(x_c, x_s, y_c, y_s) * of_offset;
        let e = EffectId::DetectionPhase.unread(&alone(self.value(Term::Phase)), e, &now);
        let e = EffectId::DetectionGainMismatch.unread(&alone(1.0 + self.value(Term::GainRatio)), e, &now);
        let e = EffectId::DetectionSkew.unread(&alone(self.value(Term::Skew)), e, &now);
        EffectId::DetectionCubic.unread(&alone(self.value(Term::ReadoutCubic)), e, &now)
    }

    /// What the channels make of the mean of a stretch.
    fn readout(&self, run: &DecayRun) -> impl Fn(usize, State) -> State {
        let linear = [Term::GainRatio, Term::Skew, Term::Phase].iter().any(|t| self.has(*t)).then(|| {
            stokes::readout(1.0 + self.value(Term::GainRatio), self.value(Term::Skew), self.value(Term::Phase))
        });
        let kappa = self.value(Term::ReadoutCubic);
        let [x_c, x_s, y_c, y_s] = OFFSETS.map(|t| self.value(t));
        let offset = cvg_model::Envelope::new(x_c, x_s, y_c, y_s);
        let is_offset = self.has(OFFSETS[0]);
        move |i, mean| {
            let bent = if kappa == 0.0 { mean } else { stokes::cubed(kappa, &mean) };
            let read = linear.map_or(bent, |m| m * bent);
            // U(Z + o) − U(Z), by what was seen of Z + o, whose phase U does not have
            if is_offset { read + stokes::of(&run.means[i]) - stokes::of(&(run.means[i] - offset)) } else { read }
        }
    }

    /// What the first `count` samples of a run show if it began so. Linear mechanics exactly, nonlinear ones in between
    /// (Strang), which is exact as far as they commute: to 2e-4 of themselves where either turns the orbit by 2° a sample.
    pub(crate) fn predict(&self, run: &DecayRun, start: &Start, count: usize) -> Vec<State> {
        let readout = self.readout(run);
        let mut step: Option<Step> = None;
        let mut u = pure(start);
        let mut out = Vec::with_capacity(count);
        for i in 0..count.min(run.len()) {
            let dt_s = if i == 0 { 0.0 } else { run.t_s[i] - run.t_s[i - 1] };
            let rate = run.step_rate_rad_s[i];
            let now = match step.take() {
                Some(s) if s.serves(dt_s, rate) || (i == 0) => s,
                _ => Step::new(self.mechanics(rate), rate, dt_s, run.span_s),
            };
            if i > 0 {
                let half = now.mechanics.nonlinear(&u, 0.5 * dt_s);
                u = now.mechanics.nonlinear(&(now.over * half), 0.5 * dt_s);
            }
            out.push(readout(i, now.mean * u));
            step = Some(now);
        }
        out
    }

    /// The envelopes (x_c, x_s, y_c, y_s) of the same, in the phase in which the mechanics alone leave it.
    pub(crate) fn envelopes(&self, run: &DecayRun, start: &Start) -> Vec<State> {
        let orbit = cvg_model::Pendulum { e: pure(start)[0], r: start[0], s: start[1], q: start[2], l: 0.0 };
        let size = orbit.e.max(f64::MIN_POSITIVE);
        let (minor, theta) = (orbit.q / size, orbit.angle());
        // a² + q² = E and 2aq = Q
        let a = (0.5 * size * (1.0 + (1.0 - minor * minor).max(0.0).sqrt())).sqrt();
        let e = cvg_model::Orbit { a, q: 0.5 * orbit.q / a, theta, delta: 0.0 }.envelope();
        let mut z = State::new(e.x_c, e.x_s, e.y_c, e.y_s);
        let mut out = Vec::with_capacity(run.len());
        for i in 0..run.len() {
            if i > 0 {
                let (dt_s, m) = (run.t_s[i] - run.t_s[i - 1], self.mechanics(run.step_rate_rad_s[i]));
                let half = turned(&m, &z, 0.5 * dt_s);
                z = turned(&m, &((m.envelope_generator() * dt_s).exp() * half), 0.5 * dt_s);
            }
            out.push(z);
        }
        out
    }
}

/// An envelope turned by what the nonlinear springs precess it.
fn turned(m: &Mechanics, z: &State, dt_s: f64) -> State {
    if !m.precesses() {
        return *z;
    }
    let e = cvg_model::Envelope::new(z[0], z[1], z[2], z[3]);
    let (sin, cos) = m.turned(&stokes::of(&e), dt_s).sin_cos();
    let e = e.turned(sin, cos);
    State::new(e.x_c, e.x_s, e.y_c, e.y_s)
}

/// (E, R, S, Q) of a vibration that is all in phase with itself: E² = R² + S² + Q².
fn pure(&[r, s, q]: &Start) -> State {
    State::new((r * r + s * s + q * q).sqrt(), r, s, q)
}

/// One step of the linear mechanics, kept as long as steps are alike.
struct Step {
    mechanics: Mechanics,
    over: Matrix4<f64>,
    mean: Matrix4<f64>,
    dt_s: f64,
    rate: f64,
}

/// Steps that differ by less than this share of themselves are one.
const ALIKE: f64 = 1e-7;

impl Step {
    fn new(mechanics: Mechanics, rate: f64, dt_s: f64, span_s: f64) -> Self {
        let generator = mechanics.generator();
        Self { over: (generator * dt_s).exp(), mean: stokes::mean(&generator, span_s), mechanics, dt_s, rate }
    }

    #[allow(clippy::float_cmp, reason = "the same rate, not one near it")]
    fn serves(&self, dt_s: f64, rate: f64) -> bool {
        self.rate == rate && (self.dt_s - dt_s).abs() <= ALIKE * dt_s
    }
}
