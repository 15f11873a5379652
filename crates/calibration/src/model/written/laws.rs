//! Laws that no effect of the library has, as effects as text: each is tried where what was found has no cause, and proposed
//! where it explains as much by itself.

use std::sync::LazyLock;

use cvg_model::effects::EffectId;

use super::{EffectText, Law, ParameterText};

/// Powers of its own amplitude with which the gain of a channel may change; those of the library are 2 and 4 (engineering choice, as are
/// the others here).
const GAIN_POWERS: [u32; 4] = [1, 3, 6, 8];
const POWERS_OF_THE_LIBRARY: [u32; 2] = [2, 4];
/// Powers of an amplitude with which a channel may be read in the other; a skew is 0.
const CROSSTALK_POWERS: [u32; 2] = [1, 2];
const POWER_OF_A_SKEW: u32 = 0;
/// Beyond any value, in whatever unit the channels are.
const UNBOUNDED: f64 = 1e60;
/// Harmonics of the pattern that may go with the square of the rate.
const HARMONICS: [u32; 2] = [2, 4];
/// How far a power reaches where no other was tried beyond it.
const HALFWAY: f64 = 0.5;

/// In what laws are alike that differ in their power of the amplitude alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    /// X(1 + k|X|ᵖ) of both channels
    Gain,
    /// a channel reads nothing below a level
    DeadZone,
    /// X + c|Y|ᵖY, Y + s|X|ᵖX
    CrosstalkOfAChannel,
    /// X + c Eᵖᐟ² Y, Y + s Eᵖᐟ² X
    CrosstalkOfAll,
    /// X + c Re(XȲ), Y + s Re(XȲ)
    Product,
    /// a harmonic of the pattern that goes with the square of the rate
    RateSquared,
    /// a precession with a kink at the axes
    Kinked,
}

/// A law without a name.
#[derive(Debug)]
pub(crate) struct Nameless {
    pub(crate) effect: EffectId,
    pub(crate) shape: Shape,
    /// of the amplitude
    pub(crate) power: Option<u32>,
    text: EffectText,
}

/// All of them.
pub(crate) static NAMELESS: LazyLock<Vec<Nameless>> = LazyLock::new(|| {
    let gains = GAIN_POWERS.into_iter().map(gain);
    let crosstalk = CROSSTALK_POWERS.into_iter().flat_map(|p| [crosstalk_of_a_channel(p), crosstalk_of_all(p)]);
    let squares = HARMONICS.into_iter().flat_map(|n| [rate_squared(n, false), rate_squared(n, true)]);
    let all = gains.chain([dead_zone(), product()]).chain(crosstalk).chain(squares).chain([kinked()]);
    // a text that is wrong is no effect; a test holds that each is one
    all.filter_map(|(shape, power, text)| {
        let effect = text.effect("a law without a name").ok()?;
        Some(Nameless { effect, shape, power, text })
    })
    .collect()
});

impl Nameless {
    /// Its text as a proposal: values that were fitted as scales, and the powers of the amplitude that it is nearer to than any
    /// that was `told_apart` from it.
    pub(crate) fn proposed(&self, values: &[f64], size_deg: f64, told_apart: impl Fn(u32) -> bool) -> EffectText {
        let mut text = self.text.clone();
        for (parameter, value) in text.parameter.iter_mut().zip(values) {
            parameter.scale = value.abs().max(1e-12);
            parameter.lower = parameter.lower.filter(|lower| *lower == 0.0);
            parameter.upper = None;
        }
        if let Some(law) = &mut text.law {
            law.size_deg = size_deg;
            law.amplitude = self.power.map(|power| self.interval(power, told_apart));
        }
        text
    }

    /// Halfway to the next power that was told apart, on either side.
    fn interval(&self, power: u32, told_apart: impl Fn(u32) -> bool) -> [f64; 2] {
        let (tried, known): (&[u32], &[u32]) = match self.shape {
            Shape::Gain => (&GAIN_POWERS, &POWERS_OF_THE_LIBRARY),
            Shape::CrosstalkOfAChannel | Shape::CrosstalkOfAll => (&CROSSTALK_POWERS, &[POWER_OF_A_SKEW]),
            Shape::DeadZone | Shape::Product | Shape::RateSquared | Shape::Kinked => (&[], &[]),
        };
        let apart = |p: &u32| known.contains(p) || told_apart(*p);
        let all = || tried.iter().chain(known).copied().filter(|p| *p != power && apart(p));
        let halfway = |other: Option<u32>, beyond: f64| {
            let power = f64::from(power);
            other.map_or(power + beyond, |other| 0.5 * (power + f64::from(other)))
        };
        [halfway(all().filter(|p| *p < power).max(), -HALFWAY), halfway(all().filter(|p| *p > power).min(), HALFWAY)]
    }
}

type Written = (Shape, Option<u32>, EffectText);

fn gain(p: u32) -> Written {
    let map = [("x'", format!("x * (1 + k * abs(x)^{p})")), ("y'", format!("y * (1 + k * abs(y)^{p})"))];
    let meaning = format!("the gain of either channel goes with power {p} of what it reads: a nonlinear readout");
    let law = law("pattern", Some(4), "readout", meaning);
    (Shape::Gain, Some(p), text(&format!("gain-to-the-{p}"), "readout", &[("k", &format!("1/V^{p}"))], map, law))
}

fn dead_zone() -> Written {
    // what the describing function of saturation leaves
    let of = |channel: &str| {
        let ratio = format!("(d / abs({channel}))");
        let side = format!("sqrt(1 - {ratio}^2)");
        let gain = format!("1 - 2 / pi * (atan2({ratio}, {side}) + {ratio} * {side})");
        format!("if_positive(abs({channel}) - d, {gain}, 0) * {channel}")
    };
    let map = [("x'", of("x")), ("y'", of("y"))];
    let meaning = "a channel reads nothing below a level: a comparator, a crossover, a gap".to_owned();
    let law = law("pattern", Some(4), "readout", meaning);
    let mut text = text("dead-zone", "readout", &[("d", "V")], map, law);
    text.parameter.iter_mut().for_each(|p| p.lower = Some(0.0));
    (Shape::DeadZone, None, text)
}

fn crosstalk_of_a_channel(p: u32) -> Written {
    let map = [("x'", format!("x + c * abs(y)^{p} * y")), ("y'", format!("y + s * abs(x)^{p} * x"))];
    crosstalk(Shape::CrosstalkOfAChannel, p, &format!("crosstalk-to-the-{p}"), "the other one", map)
}

fn crosstalk_of_all(p: u32) -> Written {
    let map = [("x'", format!("x + c * sqrt(E)^{p} * y")), ("y'", format!("y + s * sqrt(E)^{p} * x"))];
    crosstalk(Shape::CrosstalkOfAll, p, &format!("skew-to-the-{p}"), "the vibration", map)
}

fn crosstalk(shape: Shape, p: u32, id: &str, of: &str, map: [(&str, String); 2]) -> Written {
    let meaning =
        format!("a channel is read in the other, by power {p} of the amplitude of {of}: a nonlinear coupling");
    let unit = format!("1/V^{p}");
    (
        shape,
        Some(p),
        text(id, "readout", &[("c", &unit), ("s", &unit)], map, law("pattern", Some(2), "readout", meaning)),
    )
}

fn product() -> Written {
    let map = [("x'", "x + c * re(x * conj(y))".to_owned()), ("y'", "y + s * re(x * conj(y))".to_owned())];
    let meaning = "a channel reads the product of both: a mixer, or a common supply".to_owned();
    let law = law("pattern", Some(3), "readout", meaning);
    (Shape::Product, Some(1), text("product", "readout", &[("c", "1/V"), ("s", "1/V")], map, law))
}

fn rate_squared(n: u32, turns: bool) -> Written {
    let (square, id) =
        if turns { ("precession * abs(precession)", "turning") } else { ("precession^2", "with-the-rate-squared") };
    let map = [("theta'", format!("theta + {square} * (c * cos({n} * theta) - s * sin({n} * theta))"))];
    let meaning = "its size goes with the square of the rate: a force of inertia, or two lags".to_owned();
    let law = Law {
        rate: Some(around(2.0)),
        turns_with_direction: Some(turns),
        ..law("pattern", Some(n), "readout", meaning)
    };
    let unit = "s^2/rad";
    (Shape::RateSquared, None, text(&format!("harmonic-{n}-{id}"), "readout", &[("c", unit), ("s", unit)], map, law))
}

fn kinked() -> Written {
    let map = [("theta_rate", "c * abs(cos(theta)) + s * abs(sin(theta))".to_owned())];
    let meaning =
        "the pattern precesses by what has a kink at the axes: a spring that is not the same both ways".to_owned();
    let law = Law { rate: Some(around(-1.0)), ..law("pattern", None, "mechanics", meaning) };
    (Shape::Kinked, None, text("kinked-spring", "mechanics", &[("c", "rad/s"), ("s", "rad/s")], map, law))
}

fn around(power: f64) -> [f64; 2] {
    [power - HALFWAY, power + HALFWAY]
}

fn law(follows: &str, n: Option<u32>, stage: &str, meaning: String) -> Law {
    let channels = vec!["angle".into()];
    Law { follows: follows.into(), n: n.map(f64::from), stage: stage.into(), meaning, channels, ..Law::default() }
}

fn text<const N: usize>(
    id: &str,
    stage: &str,
    parameters: &[(&str, &str)],
    map: [(&str, String); N],
    law: Law,
) -> EffectText {
    let parameter = |(name, unit): &(&str, &str)| ParameterText {
        name: (*name).into(),
        unit: (*unit).into(),
        neutral: 0.0,
        scale: 1e-3,
        lower: Some(-UNBOUNDED),
        upper: Some(UNBOUNDED),
        held: false,
    };
    EffectText {
        id: id.into(),
        summary: "without a known cause".into(),
        stage: stage.into(),
        first: false,
        onsets: Vec::new(),
        parameter: parameters.iter().map(parameter).collect(),
        map: map.into_iter().map(|(key, value)| (key.to_owned(), value)).collect(),
        law: Some(law),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_is_an_effect_with_no_name_of_the_library() {
        let written = GAIN_POWERS.len() + 2 + 2 * CROSSTALK_POWERS.len() + 2 * HARMONICS.len() + 1;
        assert_eq!(NAMELESS.len(), written);
    }

    #[test]
    fn a_power_reaches_halfway_to_those_that_were_told_apart_from_it() {
        let interval = |shape: Shape, power: u32, told_apart: fn(u32) -> bool| {
            let law = NAMELESS.iter().find(|l| l.shape == shape && l.power == Some(power));
            law.map(|law| law.interval(power, told_apart))
        };
        assert_eq!(interval(Shape::Gain, 3, |_| true), Some([2.5, 3.5]));
        assert_eq!(interval(Shape::Gain, 6, |_| true), Some([5.0, 7.0]));
        assert_eq!(interval(Shape::Gain, 6, |p| p != 8), Some([5.0, 6.5]));
        assert_eq!(interval(Shape::CrosstalkOfAll, 1, |_| true), Some([0.5, 1.5]));
    }
}
