//! Which effects a residual proposes: those of the library that fit the instrument and its campaign, where they are told
//! by a search at the harmonics, orders and lines that stand out.

use cvg_model::effects::{EffectId, Role as ParameterRole, Search, Stage, Values, harmonic_n};

use crate::diagnostics::evaluate::Evaluation;
use crate::diagnostics::residual::{
    Along, drift_power, longest, resolved_harmonics, strongest_harmonics, strongest_line,
};
use crate::estimation::joint_fit::Dataset;
use crate::estimation::residuals::Residual;
use crate::facts::Follows;
use crate::model::hypothesis::Hypothesis;
use crate::numerics::statistics::line;
use crate::recording::Instrument;

/// Harmonics of the pattern and of the table that are looked at.
const PATTERN_HARMONICS: u32 = 24;
const TABLE_HARMONICS: u32 = 64;
/// Strongest harmonics that become candidates.
const PROPOSALS: usize = 3;

/// The lowest power of the amplitude at which a readout bends the angle.
const LOWEST_POWER: i8 = 2;

/// A way to extend a hypothesis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Candidate {
    pub(crate) id: EffectId,
    /// starting values
    pub(crate) values: Values<f64>,
    /// refine this member instead of adding one
    pub(crate) refine: Option<usize>,
    /// how many alternatives the search behind it went through
    pub(crate) tried: f64,
}

/// A higher power of the amplitude is the lowest one where there is one amplitude.
fn is_of_a_higher_power(id: EffectId) -> bool {
    id.description().scaling.amplitude > LOWEST_POWER
}

/// The effects of the library that are this one where all runs are at one amplitude.
pub(crate) fn alike_at_one_amplitude(id: EffectId) -> impl Iterator<Item = EffectId> {
    let own = id.description();
    let is_lowest = own.scaling.amplitude == LOWEST_POWER
        && own.stage == Stage::Readout
        && own.onsets.is_empty()
        && !own.empirical
        && !id.by_temperature();
    let all = EffectId::ALL.iter().copied().filter(move |_| is_lowest);
    all.filter(move |other| is_of_a_higher_power(*other) && other.description().stage == own.stage)
}

/// Every way to extend a hypothesis on this dataset.
pub(crate) fn candidates(
    dataset: &Dataset,
    hypothesis: &Hypothesis,
    residual: &Evaluation,
    dense: &Evaluation,
) -> Vec<Candidate> {
    let sensor = dataset.instrument == Instrument::Sensor;
    let loops = dataset.tracks.iter().any(|t| t.track.records_the_loops());
    let mut out = Vec::new();
    for &id in EffectId::ALL.iter().chain(&dataset.written) {
        let d = id.description();
        let unseen = (d.stage == Stage::Actuation || id.seen_by_loops()) && !loops;
        let unmeasured = id.by_temperature() && !dataset.temperature_varies();
        let unresolved = is_of_a_higher_power(id) && dataset.alike().amplitude;
        // the angle hardly shows drives that clip: the quadrature balance tells them
        let told_elsewhere = id.limits_drives() && id.in_library();
        // a force that nobody knows within a step of the drives does what a spring does, and drives that are late or askew
        let hidden = dataset.quantisation.is_some() && matches!(d.stage, Stage::Mechanics | Stage::Actuation);
        if d.declared || unseen || told_elsewhere || hidden || unmeasured || unresolved || (sensor && !d.in_sensors) {
            continue;
        }
        if d.scaling.rate > 0 && !dataset.rate_varies() {
            // a constant per rate hides in the bias of each run
            continue;
        }
        let searched = d.parameters.iter().enumerate().find_map(|(p, parameter)| match parameter.role {
            ParameterRole::Searched(over) | ParameterRole::Located(over) => Some((p, over)),
            _ => None,
        });
        let chosen = d.parameters.iter().position(|p| matches!(p.role, ParameterRole::Chosen(_)));
        let plain = Candidate { id, values: id.neutral(), refine: None, tried: 1.0 };
        if let Some((p, over)) = searched {
            let taken = |values: &Values<f64>| {
                let same = |q: usize, m: &Values<f64>| (m[q] - values[q]).abs() < 1e-3 * values[q].abs().max(1e-3);
                hypothesis
                    .members
                    .iter()
                    .any(|m| m.id == id && same(p, &m.values) && chosen.is_none_or(|c| same(c, &m.values)))
            };
            let (found, tried) = proposals(dataset, hypothesis, residual, dense, over);
            let proposed = found.into_iter().map(|(value, choice)| {
                let mut values = id.neutral();
                values[p] = value;
                if let Some(c) = chosen {
                    values[c] = choice;
                }
                values
            });
            out.extend(proposed.filter(|v| !taken(v)).take(PROPOSALS).map(|values| Candidate {
                values,
                tried,
                ..plain.clone()
            }));
            continue;
        }
        match hypothesis.position(id) {
            None if d.onsets.is_empty() => out.push(plain),
            None => {
                let amplitude = largest_component(dataset);
                for onset in d.onsets {
                    let mut values = id.neutral();
                    values[0] = onset / amplitude;
                    out.push(Candidate { values, tried: d.onsets.len() as f64, ..plain.clone() });
                }
            }
            Some(member)
                if !hypothesis.members[member].refined
                    && d.parameters.iter().any(|p| p.role == ParameterRole::Refined) =>
            {
                out.push(Candidate { refine: Some(member), ..plain });
            }
            Some(_) => {}
        }
    }
    out
}

/// Values that a searched parameter could take with what goes with each of them, strongest first, and how many were
/// looked at.
fn proposals(
    dataset: &Dataset,
    hypothesis: &Hypothesis,
    residual: &Evaluation,
    dense: &Evaluation,
    over: Search,
) -> (Vec<(f64, f64)>, f64) {
    match over {
        Search::PatternHarmonic => {
            let most = resolved_harmonics(residual, Follows::Pattern, PATTERN_HARMONICS);
            let scalings = scalings(dataset);
            let mut found: Vec<(f64, f64, f64)> = Vec::new();
            for &scaling in &scalings {
                let size = |precession: f64| harmonic_n::factor(scaling, precession);
                let lines = strongest_harmonics(residual, Follows::Pattern, most, size);
                found.extend(lines.into_iter().take(PROPOSALS).map(|(n, power)| (power, f64::from(n), scaling)));
            }
            found.sort_by(|a, b| b.0.total_cmp(&a.0));
            // a second harmonic against the rate is anisodamping, which is declared
            let anisodamping = (2.0, harmonic_n::scaling::INVERSE_RATE);
            let mut found: Vec<(f64, f64)> =
                found.into_iter().map(|(_, n, scaling)| (n, scaling)).filter(|f| *f != anisodamping).collect();
            if dataset.rate_varies() && scalings.contains(&harmonic_n::scaling::DIRECTION) {
                // a step between the directions is not seen in the angle's harmonics
                found.insert(0, (0.0, harmonic_n::scaling::DIRECTION));
            }
            (found, f64::from(most.max(1)) * scalings.len() as f64)
        }
        Search::TableOrder { .. } => {
            let most = resolved_harmonics(residual, Follows::Table, TABLE_HARMONICS);
            let lines = strongest_harmonics(residual, Follows::Table, most, |_| 1.0);
            let mut found: Vec<(f64, f64)> = lines.iter().take(2).map(|(n, _)| (f64::from(*n), 0.0)).collect();
            // At one rate a broken order of the table is a line in time.
            let strongest = lines.first().map_or(0.0, |l| l.1);
            let line =
                dataset.speeds_differ().then(|| strongest_line(residual, Along::Table, 2.0 * strongest)).flatten();
            let resolved = BROKEN_ORDER.max(1.0 / longest(residual, Along::Table).max(1.0));
            let of_the_pattern = |order: f64| {
                READOUT_HARMONICS.iter().any(|n| (order - n * hypothesis.angular_gain.abs()).abs() < resolved)
            };
            let broken = line.filter(|(order, _)| {
                let is_broken = (order - order.round()).abs() > BROKEN_ORDER && !of_the_pattern(*order);
                is_broken && *order > 0.5 && *order < f64::from(most)
            });
            found.splice(0..0, broken.map(|(order, _)| (order, 0.0)));
            (found, f64::from(most.max(1)))
        }
        Search::Frequency => {
            let samples: usize = dense.segments.iter().map(|s| s.samples).max().unwrap_or(1);
            // At one rate a line in time is also one in angle: nothing tells which, and a gyroscope has causes for both.
            let told = dataset.speeds_differ() || dataset.instrument == Instrument::Sensor;
            let least = LINE_OVER_DRIFT * drift_power(dense);
            let found = told.then(|| strongest_line(dense, Along::Time, least)).flatten();
            let found = found.filter(|(hz, _)| !turns_at(dense, *hz));
            (found.map(|f| (f.0, 0.0)).into_iter().collect(), samples as f64)
        }
    }
}

/// An order of the table this far from a whole one is broken, unless the pattern turns as often: what repeats with that is the
/// gyroscope's own.
const BROKEN_ORDER: f64 = 0.02;
/// Harmonics of the pattern that a readout and its drives make.
const READOUT_HARMONICS: [f64; 4] = [2.0, 4.0, 6.0, 8.0];
/// A line in time takes this many times more out of the residual than a slow drift of every run could.
const LINE_OVER_DRIFT: f64 = 1.5;

/// Share of what the reference turns by beside a steady rate that makes a frequency one of its own: engineering choice.
const OWN_FREQUENCY: f64 = 0.2;

/// Every run is turned to and fro at this frequency: what goes with it is what follows the input, and no line in time.
fn turns_at(evaluation: &Evaluation, hz: f64) -> bool {
    let is_its_own = |s: &Residual| {
        let (slope, intercept) = line(&s.t_s, &s.table);
        let swing = || s.t_s.iter().zip(&s.table).map(|(t, a)| (t, a - intercept - slope * t));
        let [sin, cos, square] = swing().fold([0.0; 3], |[sin, cos, square], (t, a)| {
            let (s, c) = (std::f64::consts::TAU * hz * t).sin_cos();
            [sin + a * s, cos + a * c, square + a * a]
        });
        2.0 * (sin * sin + cos * cos) > OWN_FREQUENCY * s.t_s.len() as f64 * square
    };
    evaluation.segments.iter().all(is_its_own)
}

/// How a harmonic may scale, as far as the fitted runs can tell.
fn scalings(dataset: &Dataset) -> Vec<f64> {
    use harmonic_n::scaling::{CONSTANT, DIRECTION, INVERSE_RATE, RATE};
    let mut all = vec![CONSTANT];
    if dataset.both_directions() {
        all.push(DIRECTION);
    }
    if dataset.speeds_differ() {
        all.extend([RATE, INVERSE_RATE]);
    }
    all
}

/// The largest in-phase readout of any channel, V, spikes aside.
fn largest_component(dataset: &Dataset) -> f64 {
    let mut sizes: Vec<f64> = dataset
        .tracks
        .iter()
        .flat_map(|t| {
            let stride = (t.track.t_s.len() / 2000).max(1);
            (0..t.track.t_s.len()).step_by(stride).map(|i| {
                let e = t.track.envelope(i);
                e.x_c.abs().max(e.y_c.abs())
            })
        })
        .collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() * 99 / 100).copied().unwrap_or(1.0).max(1e-12)
}
