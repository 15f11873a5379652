//! What no effect explains, as a law and as a proposal: what it follows, how it goes with rate and amplitude, in which
//! channels it shows, and an effect as text that reproduces it, ready to be named by a person.
//!
//! A proposal claims no cause. It has no name of the library, even where a formula of the library described it.

use cvg_model::effects::{EffectId, harmonic_n};

use crate::diagnostics::evaluate::{Evaluation, evaluate};
use crate::diagnostics::residual::{WHITENESS_LAGS, autocorrelation, inflation};
use crate::estimation::fit::Fit;
use crate::estimation::joint_fit::Dataset;
use crate::estimation::residuals::{Residual, Window};
use crate::facts::Follows;
use crate::model::hypothesis::{Member, Origin};
use crate::model::written::export::export;
use crate::model::written::{EffectText, Law, ParameterText};
use crate::numerics::statistics::line;
use crate::recording::Role;
use crate::report::channels::amplitudes;
use crate::report::laws::{Conditions, Scaling, waves, whole};
use crate::report::{ChannelReport, Unexplained};
use crate::selection::one_law::OneLaw;

/// A harmonic of a channel this many half intervals large shows.
const SHOWS: f64 = 2.0;
/// A part this large beside the whole tells the stage.
const TELLING: f64 = 0.2;
/// Times of settling that are tried, and the shortest, as a share of the longest run.
const SETTLING_TRIES: u32 = 40;
const SHORTEST_SETTLING: f64 = 0.01;
/// An angle settles that leaves this share of the mean square to the rest.
const SETTLES: f64 = 0.3;

/// What the fitted runs say, for laws.
struct FittedRuns<'a> {
    dataset: &'a Dataset,
    fit: &'a Fit,
    on_fit: &'a Evaluation,
    channels: &'a [ChannelReport],
    conditions: Vec<Conditions>,
    /// of what a sample is worth
    cost: f64,
}

/// A proposal for everything that is corrected without a cause, and for what is `left` and was not corrected; where one law explains
/// much of that by itself, it is proposed in the place of what it explains.
pub(crate) fn proposals(
    dataset: &Dataset,
    fit: &Fit,
    on_fit: &Evaluation,
    channels: &[ChannelReport],
    (left, law): (&[Unexplained], Option<&OneLaw>),
) -> Vec<EffectText> {
    let members = &fit.hypothesis.members;
    let empirical = |m: &&Member| m.origin == Origin::Empirical;
    if left.is_empty() && law.is_none() && !members.iter().any(|m| empirical(&m)) {
        return Vec::new();
    }
    let cost = inflation(&autocorrelation(on_fit, WHITENESS_LAGS), on_fit.errors().count());
    let runs = FittedRuns { dataset, fit, on_fit, channels, conditions: conditions(dataset, fit), cost };
    let is_explained = |at: usize| law.is_some_and(|law| law.explained.contains(&at));
    let mut texts: Vec<EffectText> = law.map(|law| law.text.clone()).into_iter().collect();
    let mut harmonics: Vec<f64> = Vec::new();
    for (at, m) in members.iter().enumerate().filter(|(at, m)| empirical(m) && !is_explained(*at)) {
        if m.id != EffectId::HarmonicN {
            texts.extend(runs.other(at, m));
        } else if !harmonics.contains(&m.values[0]) {
            harmonics.push(m.values[0]);
            texts.push(runs.corrected_harmonic(m.values[0]));
        }
    }
    if texts.is_empty() {
        texts.extend(left.iter().find_map(|u| runs.left(u)));
    }
    let mut out: Vec<EffectText> = Vec::new();
    for mut text in texts {
        // one that was fed back keeps its name
        let taken = |id: &str| out.iter().any(|p| p.id == id) || members.iter().any(|m| m.id.description().id == id);
        let name = (1..).map(|number| format!("proposal-{number}")).find(|id| !taken(id));
        text.id = name.unwrap_or_default();
        if text.is_sound() {
            out.push(text);
        }
    }
    out
}

/// In what each fitted segment was recorded.
fn conditions(dataset: &Dataset, fit: &Fit) -> Vec<Conditions> {
    let warmer = dataset.tracks.iter().flat_map(|p| {
        let fitted = p.track.segments.iter().filter(|s| s.role == Role::Fit);
        fitted.map(|s| s.range.clone().map(|i| p.track.warmer_k(i)).sum::<f64>() / s.range.len().max(1) as f64)
    });
    let of = |(amplitude, warmer_k)| Conditions { amplitude, warmer_k };
    amplitudes(dataset, fit).into_iter().zip(warmer).map(of).collect()
}

/// A part of a harmonic that goes with the rate in one way: that of `scaling`, and its size.
struct Part {
    scaling: f64,
    size_rad: f64,
}

impl FittedRuns<'_> {
    /// What is left without the members that `taken` chooses.
    fn without(&self, taken: impl Fn(usize, &Member) -> bool) -> Evaluation {
        let mut without = self.fit.hypothesis.clone();
        let kept = self.fit.hypothesis.members.iter().enumerate().filter(|(at, m)| !taken(*at, m));
        without.members = kept.map(|(_, m)| *m).collect();
        evaluate(&self.dataset.tracks, &without, &self.fit.starts, Role::Fit, Window::Whole, Some(self.on_fit))
    }

    fn scaling(&self, e: &Evaluation, of: Follows, n: f64, directions: bool) -> Scaling {
        Scaling::of(&waves(e, of, n, self.cost, &self.conditions), directions)
    }

    /// Channels in which a harmonic shows under the declared model.
    fn channels(&self, of: Follows, n: f64) -> Vec<String> {
        let shows = |c: &&ChannelReport| {
            let harmonic = c.harmonics.iter().find(|h| h.of == of && f64::from(h.n) == n);
            c.channel == "angle" || harmonic.is_some_and(|h| h.amplitude > SHOWS * h.ci95)
        };
        let declared = self.channels.iter().filter(|c| c.stage == "declared");
        declared.filter(shows).map(|c| c.channel.clone()).collect()
    }

    /// All parts of one harmonic of the pattern that is corrected: constant, with the direction, with the rate or against it.
    fn corrected_harmonic(&self, n: f64) -> EffectText {
        let is_part = |m: &Member| m.origin == Origin::Empirical && m.id == EffectId::HarmonicN && m.values[0] == n;
        let members = self.fit.hypothesis.members.iter().filter(|m| is_part(m)).take(2);
        let parts: Vec<Part> =
            members.map(|m| Part { scaling: m.values[3], size_rad: m.values[1].hypot(m.values[2]) }).collect();
        let directions = parts.iter().any(|p| p.scaling == harmonic_n::scaling::DIRECTION);
        let scaling = self.scaling(&self.without(|_, m| is_part(m)), Follows::Pattern, n, directions);
        let text = self.harmonic(n, &parts, &scaling);
        // as what corrects it
        EffectText { first: text.stage == "readout", ..text }
    }

    /// What was seen and not corrected.
    fn left(&self, u: &Unexplained) -> Option<EffectText> {
        use harmonic_n::scaling::{CONSTANT, DIRECTION, INVERSE_RATE, RATE};
        match (u.class.as_str(), u.n) {
            ("pattern-harmonic", Some(n)) => {
                let n = f64::from(n);
                let scaling = self.scaling(self.on_fit, Follows::Pattern, n, false);
                let kind = match scaling.rate.and_then(whole) {
                    Some(1) => RATE,
                    Some(-1) => INVERSE_RATE,
                    _ if scaling.turns_with_direction == Some(true) => DIRECTION,
                    _ => CONSTANT,
                };
                let mean = self.mean(|precession| harmonic_n::factor(kind, precession).abs());
                let size_rad = u.rms_deg.to_radians() * std::f64::consts::SQRT_2 / mean;
                Some(self.harmonic(n, &[Part { scaling: kind, size_rad }], &scaling))
            }
            ("table-harmonic", Some(n)) => {
                let scaling = self.scaling(self.on_fit, Follows::Table, f64::from(n), false);
                let size = u.rms_deg.to_radians() * std::f64::consts::SQRT_2 * f64::from(n);
                Some(self.table_order(f64::from(n), size, &scaling, u.rms_deg * std::f64::consts::SQRT_2))
            }
            ("drift", _) => self.settling(),
            _ => None,
        }
    }

    /// A drift that settles with the clock of every recording: exp(−t/τ), with the τ that takes most out.
    fn settling(&self) -> Option<EffectText> {
        let span = |s: &Residual| s.t_s.last().zip(s.t_s.first()).map_or(0.0, |(b, a)| b - a);
        let longest = self.on_fit.segments.iter().map(span).fold(0.0, f64::max);
        let tries =
            (0..SETTLING_TRIES).map(|i| longest * SHORTEST_SETTLING.powf(f64::from(i) / f64::from(SETTLING_TRIES - 1)));
        let fits = tries.map(|tau| {
            let (mut along, mut size) = (0.0, 0.0);
            for (s, kept) in self.on_fit.segments.iter().zip(&self.on_fit.kept) {
                let of = |i: usize| (-s.t_s[i] / tau).exp();
                let wanted: Vec<usize> = (0..s.angle.len()).filter(|&i| kept[i]).collect();
                let (x, y): (Vec<f64>, Vec<f64>) = wanted.iter().map(|&i| (s.turned[i], of(i))).unzip();
                let (slope, intercept) = line(&x, &y);
                for &i in &wanted {
                    let shape = of(i) - slope * s.turned[i] - intercept;
                    along += shape * s.angle[i];
                    size += shape * shape;
                }
            }
            (tau, along / size, along * along / size)
        });
        let best = fits.filter(|f| f.2.is_finite()).max_by(|a, b| a.2.total_cmp(&b.2));
        let all: f64 = self.on_fit.errors().map(|e| e * e).sum();
        let (tau, size, _) = best.filter(|(.., power)| *power > SETTLES * all)?;
        let law = Law {
            follows: "time".into(),
            size_deg: size.abs().to_degrees(),
            channels: vec!["angle".into()],
            stage: "readout".into(),
            meaning: format!(
                "it settles with about {tau:.2} s from the start of every recording: warming up, or loops that settle; a longer \
                 settle_s leaves it out"
            ),
            ..Law::default()
        };
        let parameter = vec![fitted("c", "rad", size.abs().max(1e-12))];
        let map = ("theta'", format!("theta + c * exp(-t / {tau:.6})"));
        Some(text("an angle that settles, without a known cause".into(), "readout", parameter, [map], law))
    }

    fn harmonic(&self, n: f64, parts: &[Part], scaling: &Scaling) -> EffectText {
        let power = scaling.amplitude.and_then(whole).filter(|p| *p != 0);
        let along = if n == 1.0 { "theta".to_owned() } else { format!("{n} * theta") };
        let (mut parameter, mut terms) = (Vec::new(), Vec::new());
        let mut size_rad: f64 = 0.0;
        for (number, part) in parts.iter().enumerate() {
            let factor = RateLaw::of(part.scaling);
            let mean = self.mean(|precession| harmonic_n::factor(part.scaling, precession).abs());
            size_rad = size_rad.hypot(part.size_rad * mean);
            let suffix = if number == 0 { String::new() } else { (number + 1).to_string() };
            let scale = (part.size_rad / self.usual_amplitude().powi(power.unwrap_or(0))).max(1e-12);
            let unit = power.map_or_else(|| factor.unit.to_owned(), |p| format!("{}/V^{p}", factor.unit));
            let names = ["c", "s"].map(|name| format!("{name}{suffix}"));
            let wave = if n == 0.0 {
                parameter.push(fitted(&names[0], &unit, scale));
                names[0].clone()
            } else {
                parameter.extend(names.iter().map(|name| fitted(name, &unit, scale)));
                format!("({} * cos({along}) - {} * sin({along}))", names[0], names[1])
            };
            terms.push(factor.times(&wave));
        }
        let amplitude = power.map_or_else(String::new, |p| format!("sqrt(E)^{p} * "));
        let sum = terms.join(" + ");
        let sum = match (amplitude.is_empty(), parts.len()) {
            (true, _) => sum,
            (false, 1) => format!("{amplitude}{sum}"),
            (false, _) => format!("{amplitude}({sum})"),
        };
        let kinds: Vec<f64> = parts.iter().map(|p| p.scaling).collect();
        let shown = |p: &Part| p.size_rad * self.mean(|precession| harmonic_n::factor(p.scaling, precession).abs());
        let telling = |p: &&Part| shown(p) > TELLING * size_rad;
        let telling: Vec<f64> = parts.iter().filter(telling).map(|p| p.scaling).collect();
        let (stage, meaning) = meaning(&telling, power);
        let (stage_of_text, map) = if kinds == [harmonic_n::scaling::INVERSE_RATE] && n > 0.0 {
            // an angle A cos(nθ)/Ω is the integral of a precession −nA sin nθ
            for p in &mut parameter {
                (p.scale, p.unit) = (n * p.scale, p.unit.replace("rad^2/s", "rad/s"));
            }
            ("mechanics", ("theta_rate", format!("{amplitude}(c * cos({along}) + s * sin({along}))")))
        } else {
            ("readout", ("theta'", format!("theta + {sum}")))
        };
        let law = Law {
            follows: if n == 0.0 { "direction".into() } else { "pattern".into() },
            n: (n > 0.0).then_some(n),
            size_deg: size_rad.to_degrees(),
            channels: self.channels(Follows::Pattern, n),
            stage: stage.into(),
            meaning: meaning.into(),
            ..Law::default()
        };
        let summary = if n == 0.0 {
            "a step of the angle between the directions, without a known cause".to_owned()
        } else {
            format!("harmonic {n} of the pattern angle, without a known cause")
        };
        text(summary, stage_of_text, parameter, [map], if n > 0.0 { scaling.told(law) } else { law })
    }

    /// An order of the table, with a ripple of the rate of `size`.
    fn table_order(&self, n: f64, size: f64, scaling: &Scaling, size_deg: f64) -> EffectText {
        let law = Law {
            follows: "table".into(),
            n: Some(n),
            channels: self.channels(Follows::Table, n),
            stage: "input".into(),
            meaning: "it follows the table, not the pattern: poles, teeth, a bearing or the table's own encoder".into(),
            size_deg,
            ..Law::default()
        };
        let parameter = vec![fitted("c", "1", size.max(1e-12)), fitted("s", "1", size.max(1e-12))];
        let map = format!("rate * (1 + c * cos({n} * table) - s * sin({n} * table))");
        let summary = format!("order {n} of the table, without a known cause");
        text(summary, "input", parameter, [("rate'", map)], scaling.told(law))
    }

    /// What another formula described.
    fn other(&self, at: usize, m: &Member) -> Option<EffectText> {
        let bare = self.without(|number, _| number == at);
        let removed = (bare.mean_square() - self.on_fit.mean_square()).max(0.0).sqrt();
        let law = Law {
            size_deg: (removed * std::f64::consts::SQRT_2).to_degrees(),
            channels: vec!["angle".into()],
            ..Law::default()
        };
        let [first, c, s, _] = m.values;
        let scale = c.hypot(s).max(1e-12);
        Some(match m.id {
            EffectId::TableHarmonic => {
                self.table_order(first, scale, &self.scaling(&bare, Follows::Table, first, false), law.size_deg)
            }
            EffectId::TimePeriodic => {
                let law = Law {
                    follows: "time".into(),
                    frequency_hz: Some(first),
                    stage: "readout".into(),
                    meaning: "it keeps its frequency whatever turns: mains, a fan, another resonance".into(),
                    ..law
                };
                let parameter = vec![fitted("c", "rad", scale), fitted("s", "rad", scale)];
                let map = format!("theta + c * cos(2 * pi * {first} * t) - s * sin(2 * pi * {first} * t)");
                text(
                    format!("a line at {first} Hz, without a known cause"),
                    "readout",
                    parameter,
                    [("theta'", map)],
                    law,
                )
            }
            EffectId::RateOffset => {
                let law = Law {
                    follows: "time".into(),
                    stage: "input".into(),
                    meaning: "the angle goes with time in either direction: a rotation that was not recorded, an offset of the \
                              recorded rate, or a drift of the pattern"
                        .into(),
                    ..law
                };
                let parameter = vec![fitted("offset", "rad/s", first.abs().max(1e-12))];
                let summary = "a rotation beside the recorded one, without a known cause".to_owned();
                text(summary, "input", parameter, [("rate'", "rate + offset".to_owned())], law)
            }
            // a formula of the library that describes and does not explain
            id => {
                let mut text = export(id).ok()?;
                let stage = text.stage.clone();
                text.summary = "without a known cause".into();
                for (p, value) in text.parameter.iter_mut().zip(m.values).filter(|(p, _)| p.held) {
                    p.neutral = value;
                }
                let meaning = "a formula describes it that does not explain it: see unexplained in the report".into();
                text.law = Some(Law { follows: "other".into(), stage, meaning, ..law });
                text
            }
        })
    }

    /// Mean over the fitted samples of a function of the precession rate.
    fn mean(&self, of: impl Fn(f64) -> f64) -> f64 {
        let rates = self.on_fit.segments.iter().flat_map(|s| &s.precession);
        let (n, sum) = rates.fold((0.0, 0.0), |(n, sum), rate| (n + 1.0, sum + of(*rate)));
        if n > 0.0 { sum / n } else { 1.0 }
    }

    fn usual_amplitude(&self) -> f64 {
        let sum: f64 = self.conditions.iter().map(|c| c.amplitude.ln()).sum();
        (sum / self.conditions.len().max(1) as f64).exp()
    }
}

/// How a part goes with the precession rate: its unit, and the expression of its factor.
struct RateLaw {
    unit: &'static str,
    factor: Option<&'static str>,
}

impl RateLaw {
    fn of(scaling: f64) -> Self {
        use harmonic_n::scaling::{DIRECTION, INVERSE_RATE, RATE};
        if scaling == DIRECTION {
            Self { unit: "rad", factor: Some("if_positive(precession, 1, if_positive(-precession, -1, 0))") }
        } else if scaling == RATE {
            Self { unit: "s", factor: Some("precession") }
        } else if scaling == INVERSE_RATE {
            Self { unit: "rad^2/s", factor: Some("if_positive(abs(precession), 1 / precession, 0)") }
        } else {
            Self { unit: "rad", factor: None }
        }
    }

    fn times(&self, wave: &str) -> String {
        self.factor.map_or_else(|| wave.to_owned(), |factor| format!("{factor} * {wave}"))
    }
}

/// The stage that a harmonic's way with the rate means, and why.
fn meaning(kinds: &[f64], power: Option<i32>) -> (&'static str, &'static str) {
    use harmonic_n::scaling::{DIRECTION, INVERSE_RATE, RATE};
    if kinds.contains(&INVERSE_RATE) {
        ("mechanics", "its size goes against the rate: something precesses the pattern")
    } else if kinds.contains(&RATE) {
        ("readout", "its size goes with the rate: a delay, or a filter")
    } else if kinds.contains(&DIRECTION) {
        ("readout", "it turns with the direction: backlash, hysteresis, or a delay")
    } else if power.is_some() {
        ("readout", "it is the same at every rate and goes with the amplitude: a nonlinear readout")
    } else {
        ("readout", "it is the same at every rate: the readout, or what is added to the angle")
    }
}

fn fitted(name: &str, unit: &str, scale: f64) -> ParameterText {
    ParameterText { name: name.into(), unit: unit.into(), neutral: 0.0, scale, lower: None, upper: None, held: false }
}

fn text<const N: usize>(
    summary: String,
    stage: &str,
    parameter: Vec<ParameterText>,
    map: [(&str, String); N],
    law: Law,
) -> EffectText {
    EffectText {
        id: String::new(),
        summary,
        stage: stage.into(),
        first: false,
        onsets: Vec::new(),
        parameter,
        map: map.into_iter().map(|(key, value)| (key.to_owned(), value)).collect(),
        law: Some(law),
    }
}
