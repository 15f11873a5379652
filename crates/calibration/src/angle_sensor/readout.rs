//! The readout of two channels, in the order of the electronics: plates (cubic), axes (skew), amplifier (gain), offset,
//! converter (rails). All parameters but the centre are relative to the amplitude, so that volts, millivolts and counts
//! give the same answer.
//!
//! $$x_d = o_x + A\\,c_x(\cos θ), \quad y_d = o_y + A g\\,(c_y(\sin θ) + s\\,c_x(\cos θ)), \quad
//! c(u) = u\\,(1 + κ(u^2 - \tfrac34))$$
//!
//! The −¾ keeps the fundamental of c: κ does not change what g and A mean. Effects as text are what the signal meets last, and
//! are in the unit of the channels.

use cvg_model::Envelope;
use cvg_model::effects::{EffectId, MAX_PARAMETERS, Moment, Role, Values};

use super::rails::Rails;
use crate::facts::LARGEST_RATIO_OF_A_SENSOR;

/// Which of the parameters are there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Kind {
    /// the channels are taken as they are
    Plain,
    /// offsets
    Offset,
    /// offsets, gain and skew
    Affine,
    /// and a cubic, common to both channels
    Cubic,
    /// and a cubic for each channel
    CubicPerChannel,
}

/// Unknowns of a readout: offsets x, y, ln of the gain ratio, skew, cubics of x and y.
pub(crate) const UNKNOWNS: usize = 6;

impl Kind {
    /// The kinds with something to fit.
    pub(crate) const FITTED: [Self; 4] = [Self::Offset, Self::Affine, Self::Cubic, Self::CubicPerChannel];

    /// Indices of the parameters that are adjusted.
    pub(crate) fn free(self) -> &'static [usize] {
        match self {
            Self::Plain => &[],
            Self::Offset => &[0, 1],
            Self::Affine => &[0, 1, 2, 3],
            Self::Cubic => &[0, 1, 2, 3, 4],
            Self::CubicPerChannel => &[0, 1, 2, 3, 4, 5],
        }
    }
}

/// Readouts that compete.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Competing<'a> {
    /// the largest kind of readout
    pub(crate) largest: Kind,
    /// effects as text
    pub(crate) texts: &'a [EffectId],
}

impl<'a> Competing<'a> {
    /// All of the library, and these effects as text.
    pub(crate) fn with(texts: &'a [EffectId]) -> Self {
        Self { largest: Kind::CubicPerChannel, texts }
    }
}

/// Something of a readout that a fit adjusts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unknown {
    /// one of [`UNKNOWNS`]
    Own(usize),
    /// of an effect as text, a parameter
    Text(usize, usize),
}

/// Largest skew and cubic that leave a readout with an inverse: beyond, c(u) turns back within the circle.
const LARGEST_SKEW: f64 = 5.0;
const LARGEST_CUBIC: f64 = 0.4;
/// Newton steps of the inverse of c.
const NEWTON_STEPS: usize = 5;

/// A readout of two channels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Readout {
    pub(crate) kind: Kind,
    /// what offsets are counted from, in the unit of the channels
    pub(crate) centre: [f64; 2],
    /// amplitude of x, in the unit of the channels
    pub(crate) amplitude: f64,
    /// the converters' rails
    pub(crate) rails: Rails,
    /// mean radius of the points behind the readings: near 1, by how the parameters moved since `amplitude` was taken
    pub(crate) radius: f64,
    /// o_x, o_y in amplitudes, ln g, s, κ_x, κ_y
    pub(crate) p: [f64; UNKNOWNS],
    /// effects as text with their values, in the order in which the signal meets them
    pub(crate) texts: Vec<(EffectId, Values<f64>)>,
}

impl Readout {
    /// The channels as they are.
    pub(crate) fn plain() -> Self {
        Self {
            kind: Kind::Plain,
            centre: [0.0; 2],
            amplitude: 1.0,
            rails: Rails::none(),
            radius: 1.0,
            p: [0.0; UNKNOWNS],
            texts: Vec::new(),
        }
    }

    /// Offset, gain ratio and skew.
    pub(crate) fn affine(centre: [f64; 2], amplitude: f64, gain: f64, skew: f64) -> Self {
        Self { kind: Kind::Affine, centre, amplitude, p: [0.0, 0.0, gain.ln(), skew, 0.0, 0.0], ..Self::plain() }
    }

    /// The readout begun as another kind: parameters that the kind lacks are neutral.
    pub(crate) fn of_kind(&self, kind: Kind) -> Self {
        if kind == Kind::Plain {
            return Self { rails: self.rails, ..Self::plain() };
        }
        let free = kind.free();
        let p = std::array::from_fn(|i| if free.contains(&i) { self.p[i] } else { 0.0 });
        Self { kind, p, ..self.clone() }
    }

    /// The same with effects as text: absent yet, but for those without a slope there, which begin at their onset of this
    /// number.
    pub(crate) fn with_texts(&self, texts: &[EffectId], onset: usize) -> Self {
        let begun = |id: &EffectId| {
            let (mut values, onsets) = (id.neutral(), id.description().onsets);
            if let Some(share) = onsets.get(onset).or(onsets.last()) {
                values[0] = share / self.amplitude;
            }
            (*id, values)
        };
        Self { texts: texts.iter().map(begun).collect(), ..self.clone() }
    }

    /// What a fit adjusts of it.
    pub(crate) fn free(&self) -> Vec<Unknown> {
        let own = self.kind.free().iter().map(|i| Unknown::Own(*i));
        own.chain(unknowns_of(self.texts.iter().map(|t| &t.0))).collect()
    }

    /// The value of an unknown: of an effect as text in the scale of its parameter, from neutral on.
    pub(crate) fn value(&self, unknown: Unknown) -> f64 {
        match unknown {
            Unknown::Own(i) => self.p[i],
            Unknown::Text(at, i) => {
                let (id, values) = &self.texts[at];
                let of = &id.description().parameters[i];
                (values[i] - of.neutral) / of.scale
            }
        }
    }

    /// Sets an unknown, within the bounds of its parameter where it has some.
    pub(crate) fn set(&mut self, unknown: Unknown, value: f64) {
        match unknown {
            Unknown::Own(i) => self.p[i] = value,
            Unknown::Text(at, i) => {
                let (id, values) = &mut self.texts[at];
                let of = &id.description().parameters[i];
                values[i] = (of.neutral + of.scale * value).clamp(of.lower, of.upper);
            }
        }
    }

    /// What the paper's model has of it: the gain ratio, and the centre only where there is no angle without it.
    pub(crate) fn declared(&self, raw_turns: bool) -> Self {
        let mut out = Self { p: [0.0; UNKNOWNS], texts: Vec::new(), ..self.clone() };
        out.p[2] = self.p[2];
        if raw_turns {
            out.centre = [0.0; 2];
        } else {
            (out.p[0], out.p[1]) = (self.p[0], self.p[1]);
        }
        out
    }

    /// κ of either channel.
    pub(crate) fn cubics(&self) -> [f64; 2] {
        [self.p[4], if self.kind == Kind::CubicPerChannel { self.p[5] } else { self.p[4] }]
    }

    /// The point on the unit circle behind a reading, rails not regarded.
    #[inline]
    pub(crate) fn undo(&self, z: [f64; 2]) -> [f64; 2] {
        self.undo_own(self.without_texts(z))
    }

    /// The point on the unit circle behind what the effects as text acted on.
    #[inline]
    pub(crate) fn undo_own(&self, z: [f64; 2]) -> [f64; 2] {
        let p = &self.p;
        let x = (z[0] - self.centre[0]) / self.amplitude - p[0];
        let y = ((z[1] - self.centre[1]) / self.amplitude - p[1]) / p[2].exp() - p[3] * x;
        let [kx, ky] = self.cubics();
        [without_cubic(x, kx), without_cubic(y, ky)]
    }

    /// The origin lies within what the channels draw.
    pub(crate) fn is_about_the_origin(&self) -> bool {
        let [x, y] = self.undo([0.0, 0.0]);
        x.hypot(y) < self.radius
    }

    /// A reading before the effects as text acted on it; not a number where one of them has no inverse.
    #[inline]
    pub(crate) fn without_texts(&self, z: [f64; 2]) -> [f64; 2] {
        if self.texts.is_empty() {
            return z;
        }
        let e = Envelope::new(z[0], 0.0, z[1], 0.0);
        let undone = self.texts.iter().rev().fold(e, |e, (id, values)| id.unread(values, e, &Moment::default()));
        [undone.x_c, undone.y_c]
    }

    /// ln of the radius behind a reading.
    pub(crate) fn ln_radius(&self, z: [f64; 2]) -> f64 {
        let [x, y] = self.undo(z);
        0.5 * (x * x + y * y + 1e-18).ln()
    }

    /// The angle behind a reading, rad. A channel at its rail says only "at least": the other one and the radius tell.
    pub(crate) fn angle(&self, z: [f64; 2]) -> f64 {
        let [mut x, mut y] = self.undo(z);
        match self.rails.reached(z) {
            [true, false] => x = x.signum() * (self.radius.powi(2) - y * y).max(0.0).sqrt().max(x.abs()),
            [false, true] => y = y.signum() * (self.radius.powi(2) - x * x).max(0.0).sqrt().max(y.abs()),
            _ => {}
        }
        y.atan2(x)
    }

    /// The parameters leave an ellipse with an angle and a cubic with an inverse.
    pub(crate) fn is_sound(&self) -> bool {
        self.p.iter().chain(self.texts.iter().flat_map(|t| &t.1)).all(|v| v.is_finite())
            && self.p[2].abs() < LARGEST_RATIO_OF_A_SENSOR.ln()
            && self.p[3].abs() < LARGEST_SKEW
            && self.cubics().iter().all(|k| k.abs() < LARGEST_CUBIC)
    }
}

/// What a fit adjusts of effects as text.
fn unknowns_of<'a>(texts: impl Iterator<Item = &'a EffectId>) -> impl Iterator<Item = Unknown> {
    let is_fitted = |id: &EffectId, i: usize| {
        id.description().parameters.get(i).is_some_and(|p| !matches!(p.role, Role::Chosen(_)))
    };
    texts.enumerate().flat_map(move |(at, id)| {
        (0..MAX_PARAMETERS).filter(move |i| is_fitted(id, *i)).map(move |i| Unknown::Text(at, i))
    })
}

/// How many unknowns effects as text have.
pub(crate) fn unknowns_of_texts(texts: &[EffectId]) -> usize {
    unknowns_of(texts.iter()).count()
}

/// The root x of v = x (1 + κ(x² − ¾)) by Newton's iteration; beyond the circle the slope is taken as on it.
#[inline]
fn without_cubic(v: f64, kappa: f64) -> f64 {
    if kappa == 0.0 {
        return v;
    }
    let mut x = v;
    for _ in 0..NEWTON_STEPS {
        let square = (x * x).min(4.0);
        let slope = (1.0 + kappa * (3.0 * square - 0.75)).max(0.2);
        x -= (x * (1.0 + kappa * (square - 0.75)) - v) / slope;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_readout_is_undone_in_the_order_of_the_electronics() {
        let mut readout = Readout::affine([300.0, -70.0], 500.0, 1.1, 0.04).of_kind(Kind::CubicPerChannel);
        (readout.p[0], readout.p[4], readout.p[5]) = (0.02, 0.05, -0.03);
        let c = |u: f64, k: f64| u * (1.0 + k * (u * u - 0.75));
        for i in 0..64 {
            let theta = f64::from(i) * 0.1;
            let (x, y) = (c(theta.cos(), 0.05), c(theta.sin(), -0.03));
            let z = [300.0 + 500.0 * (0.02 + x), -70.0 + 500.0 * 1.1 * (y + 0.04 * x)];
            let off = crate::numerics::angles::wrapped(readout.angle(z) - theta, std::f64::consts::TAU);
            assert!(off.abs() < 1e-9, "{theta}: {off}");
        }
    }
}
