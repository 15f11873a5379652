//! A sensor of which nobody recorded what it was turned by: its two channels draw a closed curve, and a vibration or a field
//! of constant size behind them would draw a circle. What bends the circle is told by the radius; what turns it within
//! itself is not.

use std::f64::consts::TAU;

use super::agreement::of_one_sensor;
use super::cross_validation::{Candidate, Folds, Tolerance, choose, losses_of_radius};
use super::curve::{Curve, mean_radius, undone};
use super::deviations::{jackknife, other_noise, without_block};
use super::effects::{LibraryReadout, clip, readout_effects, readout_members, undone_without_a_name};
use super::ellipse;
use super::rails::Rails;
use super::readout::{Kind, Readout};
use super::readout_fit::{Weighting, fit};
use super::samples::{SensorRun, apart};
use super::spikes::without_spikes;
use crate::data::channel_ranges::require_one_unit;
use crate::diagnostics::decomposition::{BLOCKS, STUDENT_19};
use crate::error::Refusal;
use crate::model::hypothesis::{Hypothesis, Member};
use crate::numerics::angles::{unwrapped, wrapped};
use crate::numerics::statistics::{line, median, robust_deviation, span};
use crate::recording::{Campaign, Instrument, Reference, Role, Run};
use crate::report::calibration::{Calibration, Provenance};
use crate::report::survey::{Constancy, Radius};
use crate::report::{EffectReport, Estimate, Status, Tool, provenance};

/// Rows beyond which the jackknife looks at every so many.
const ENOUGH_ROWS: usize = 3000;
/// Rows below which a curve tells nothing, fitted and held out.
const FEWEST_ROWS: usize = 24;
const FEWEST_HELD_ROWS: usize = 4;
/// A part of the turn this long without a row leaves an ellipse to be guessed, deg.
const LARGEST_GAP_DEG: f64 = 180.0;
/// … and this long, the radius of the rows that stand there alone says nothing of an ellipse; then stretches are held out, so many a run.
const LARGEST_GAP_BEFORE_A_QUARTER_DEG: f64 = 60.0;
const STRETCHES: usize = 24;
/// … and this long, a cubic.
const LARGEST_GAP_OF_A_CUBIC_DEG: f64 = 60.0;
/// What the best curve may leave of the radius, rms: engineering choice.
const LARGEST_LEFT: f64 = 0.25;

/// Parts of a run whose amplitudes are compared, and by how much they differ at least where it is said.
const PARTS: usize = 8;
const LEAST_CHANGE: f64 = 5e-3;

/// Directions in which the rows of a turn stand, and rows that make one.
const DIRECTIONS: usize = 72;
const FEWEST_IN_A_DIRECTION: usize = 3;
/// What is left of the radius stands out of its noise by this factor, is this share of the radius at least, and is most of what there was
/// above this share of it. Engineering choices.
const STANDS_OUT: f64 = 3.0;
const LEAST_LEFT: f64 = 2e-3;
const LEAVES_MOST: f64 = 0.5;

/// What two channels told without a reference.
#[derive(Debug, Clone)]
pub(crate) struct Told {
    pub(crate) status: Status,
    pub(crate) reason: Option<String>,
    pub(crate) detection_gain_ratio: Option<Estimate>,
    pub(crate) effects: Vec<EffectReport>,
    pub(crate) radius: Radius,
    pub(crate) calibration: Calibration,
    pub(crate) warnings: Vec<String>,
    /// points as recorded and with what was found undone, both over the mean radius
    pub(crate) curve: Curve,
}

/// A sensor with two channels and no reference in any run, or none that is to be used.
pub(crate) fn serves(campaign: &Campaign) -> bool {
    let has_reference = campaign.runs.iter().any(|r| r.recording.table_deg.is_some() || r.recording.rate_dps.is_some());
    campaign.instrument == Instrument::Sensor && (campaign.reference == Some(Reference::Absent) || !has_reference)
}

/// What the channels tell of themselves.
///
/// # Errors
/// [`Refusal`] where they draw no closed curve.
pub(crate) fn identify(campaign: Campaign) -> Result<Told, Refusal> {
    require_one_unit(&campaign)?;
    let device = campaign.device.clone();
    let provenance = provenance_of(&campaign);
    let period = campaign.period_deg.unwrap_or(360.0).to_radians();
    let stated = campaign.pole_pairs.or(campaign.angular_gain).unwrap_or(1.0);
    let runs = campaign.runs.into_iter().enumerate().map(|(i, r)| SensorRun::without_reference(r, i));
    let mut warnings = Vec::new();
    let runs = without_spikes(runs.collect::<Result<_, _>>()?, std::f64::consts::TAU, &mut warnings);
    let (fitted, held) = parts(&of_one_sensor(runs, &mut warnings)?, &mut warnings)?;
    let count = |runs: &[SensorRun]| runs.iter().map(SensorRun::len).sum::<usize>();
    if count(&fitted) < FEWEST_ROWS || count(&held) < FEWEST_HELD_ROWS {
        return Err(refuse("too few rows to fit a curve and to test it".into(), "a longer recording"));
    }
    let thinned: Vec<SensorRun> = fitted.iter().map(|r| r.thinned((count(&fitted) / ENOUGH_ROWS).max(1))).collect();
    let rails = Rails::of(fitted.iter().filter_map(SensorRun::channels).flatten());
    let (readout, predicted, predicted_raw) = choose_readout(&thinned, rails)?;
    let centre = ellipse::algebraic(&fitted).filter(|_| readout.kind == Kind::Plain);
    let largest_gap_deg = largest_gap(centre.as_ref().unwrap_or(&readout), &fitted).to_degrees();
    if largest_gap_deg > LARGEST_GAP_DEG {
        let what = format!("the channels cover {:.0}° of a turn only", 360.0 - largest_gap_deg);
        return Err(refuse(what, "rows all around the turn, or a reference: table_deg or rate_dps"));
    }
    let left = Left::of(&readout, &fitted);
    let by_noise = deviations(&readout, &thinned);
    let by_what_is_left = left.in_the_values(LibraryReadout::from(&readout).amplitude);
    let deviations: [f64; 6] = std::array::from_fn(|i| by_noise[i].hypot(by_what_is_left[i] / STUDENT_19));
    let plain = Readout { rails, ..Readout::plain() };
    let (before, after) = (constancy(&plain, &held), constancy(&readout, &held));
    let raw_turns = turns(&readout);
    let explains_little = raw_turns && left.goes_with_the_direction() && after.rms > LEAVES_MOST * before.rms;
    let neutral = readout.kind == Kind::Plain || (raw_turns && after.rms >= before.rms) || explains_little;
    warnings.extend(left.said());
    let as_recorded =
        predicted_raw.map_or("as recorded the angle does not turn".into(), |rms| format!("{rms:.2e} as recorded"));
    let evidence = format!(
        "blocked cross-validation within the fitted rows leaves {predicted:.2e} of the radius with all that was found, \
         {as_recorded}; interval by jackknife over {BLOCKS} blocks"
    );
    let values = LibraryReadout::from(&readout).values();
    let half = STUDENT_19 * deviations[2];
    let told = !neutral && readout.kind >= Kind::Affine && half.is_finite();
    let mut hypothesis = Hypothesis::ideal(Instrument::Sensor, period, stated);
    if !neutral {
        let member = |(id, origin, values)| Member { id, values, origin, refined: true };
        hypothesis.members = readout_members(&readout).into_iter().map(member).collect();
        hypothesis.members.sort_by_key(|m| m.id);
        hypothesis.clip = clip(&readout);
    }
    let mut effects = if neutral { Vec::new() } else { readout_effects(&readout, &deviations, &evidence) };
    if !neutral && effects.is_empty() {
        warnings.extend(undone_without_a_name(&readout, &deviations));
    }
    provenance::in_unit(&mut effects, provenance.readout_unit.as_deref());
    let calibration = Calibration { device, hypothesis, provenance };
    warnings.extend(fitted.iter().filter_map(|run| amplitude_that_changes(&readout, run)));
    warnings.extend(unseen(raw_turns, &readout));
    calibration_stands(&calibration)?;
    Ok(Told {
        status: if neutral { Status::Neutral } else { Status::Answered },
        reason: neutral.then(|| match left.said().filter(|_| explains_little) {
            Some(said) => format!("what was found explains little of the radius: {said}"),
            None => "nothing that was found makes the radius of held-out rows more constant".to_owned(),
        }),
        detection_gain_ratio: told.then(|| Estimate { value: values[2], ci95: [values[2] - half, values[2] + half] }),
        effects,
        radius: Radius {
            before,
            after,
            correction_rms_deg: raw_turns.then(|| correction(&readout, &held).to_degrees()),
            largest_gap_deg,
        },
        calibration,
        warnings,
        curve: Curve::new(&readout, &held),
    })
}

/// Which bytes the answer rests on, and what has to be known of them to use it.
fn provenance_of(campaign: &Campaign) -> Provenance {
    Provenance {
        tool: Some(Tool::default()),
        inputs: provenance::sums(&provenance::files(campaign)),
        amplitude_v: provenance::amplitudes(campaign),
        readout_unit: provenance::readout_unit(campaign),
        covered_deg: None,
        radius_left: None,
        gain_unknown: campaign.pole_pairs.or(campaign.angular_gain).is_none(),
    }
}

/// What is left of the radius, as shares of it.
struct Left {
    /// that goes with the direction, rms
    with_direction: f64,
    /// that does not, rms
    beside: f64,
}

impl Left {
    /// Of rows in so many directions, those of which there are a few.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below DIRECTIONS")]
    fn of(readout: &Readout, runs: &[SensorRun]) -> Self {
        let mut directions: Vec<Vec<f64>> = vec![Vec::new(); DIRECTIONS];
        for [x, y] in undone(readout, runs) {
            let place = (y.atan2(x) / TAU).rem_euclid(1.0) * DIRECTIONS as f64;
            directions[place as usize % DIRECTIONS].push(x.hypot(y));
        }
        directions.retain(|radii| radii.len() >= FEWEST_IN_A_DIRECTION);
        let all: Vec<f64> = directions.iter().flatten().copied().collect();
        let mean = |radii: &[f64]| radii.iter().sum::<f64>() / radii.len().max(1) as f64;
        let usual = mean(&all);
        let (mut between, mut within) = (0.0, 0.0);
        for radii in &directions {
            let middle = mean(radii);
            between += radii.len() as f64 * (middle - usual).powi(2);
            within += radii.iter().map(|r| (r - middle).powi(2)).sum::<f64>();
        }
        let [rows, kinds] = [all.len(), directions.len()].map(|n| n as f64);
        let beside = within / (rows - kinds).max(1.0);
        // the means scatter by the noise as well
        let with_direction = ((between - kinds * beside) / rows.max(1.0)).max(0.0);
        let share = |square: f64| square.sqrt() / usual.max(f64::MIN_POSITIVE);
        Self { with_direction: share(with_direction), beside: share(beside) }
    }

    /// An error that no readout of the library undoes stands out of the noise.
    fn goes_with_the_direction(&self) -> bool {
        self.with_direction > LEAST_LEFT && self.with_direction > STANDS_OUT * self.beside
    }

    /// What an error of the radius of this size is in the values of a readout of this amplitude, twice its rms: it may be one of theirs as
    /// well as none of them.
    fn in_the_values(&self, amplitude: f64) -> [f64; 6] {
        let share = if self.goes_with_the_direction() { 2.0 * self.with_direction } else { 0.0 };
        let cubic = share / (amplitude * amplitude);
        [share * amplitude, share * amplitude, share, share, cubic, cubic]
    }

    fn said(&self) -> Option<String> {
        self.goes_with_the_direction().then(|| {
            format!(
                "{:.2} % of the radius are left that go with the direction, and {:.2} % of noise: tops that an amplifier cuts, a field that is no \
                 sine, or a third error that two channels alone do not tell; intervals allow for as much; look at the channels over the angle, or \
                 record a reference",
                100.0 * self.with_direction,
                100.0 * self.beside
            )
        })
    }
}

/// Turns of the direction of a run's two channels over those of its reference, about the centre of what they draw; none
/// where there are no channels, no reference, or no closed curve.
pub(crate) fn full_turn_gain(run: &Run) -> Option<f64> {
    let run = SensorRun::new(run.clone(), 0, None).ok()?;
    let channels = run.channels()?;
    let one = std::slice::from_ref(&run);
    let centre = ellipse::algebraic(one)?;
    if run.travel_rad() < TAU || largest_gap(&centre, one) > LARGEST_GAP_DEG.to_radians() {
        return None;
    }
    let followed = unwrapped(channels.iter().map(|z| centre.angle(*z)), TAU);
    Some(line(&run.reference_rad, &followed).0)
}

/// The gain of Y over X by the ellipse of each run, beside a temperature.
pub(crate) fn own_ratios(campaign: &Campaign) -> Vec<Option<f64>> {
    let own = |(number, run): (usize, &Run)| {
        let run = run.recording.temp_c.as_ref().map(|_| run.clone())?;
        ellipse::gain_ratio(&SensorRun::without_reference(run, number).ok()?)
    };
    campaign.runs.iter().enumerate().map(own).collect()
}

fn refuse(what: String, wanted: &str) -> Refusal {
    Refusal::no_answer("campaign", what, wanted)
}

/// The rows to fit and those held out: the last quarter where nothing else is stated, and stretches all around where that stands alone.
fn parts(runs: &[SensorRun], warnings: &mut Vec<String>) -> Result<(Vec<SensorRun>, Vec<SensorRun>), Refusal> {
    let (fitted, held) = apart(runs.to_vec())?;
    if runs.iter().any(|run| run.role == Role::Holdout) || !one_turn_only(runs, &fitted) {
        return Ok((fitted, held));
    }
    warnings.push(
        "the channels go round once, and the last quarter of the rows is where no other rows are: every fourth of 24 stretches is \
         held out instead; a recording that goes round twice is judged on its last quarter"
            .into(),
    );
    Ok(stretches_apart(runs))
}

/// Whether the last quarter of the rows stands where the rows before it do not, in a turn that all of them go round.
fn one_turn_only(runs: &[SensorRun], fitted: &[SensorRun]) -> bool {
    let [all, fitted] =
        [runs, fitted].map(|rows| ellipse::algebraic(runs).map_or(TAU, |centre| largest_gap(&centre, rows)));
    let widest = LARGEST_GAP_BEFORE_A_QUARTER_DEG.to_radians();
    all < widest && fitted > widest
}

/// Every fourth of [`STRETCHES`] of each run, and the rest.
fn stretches_apart(runs: &[SensorRun]) -> (Vec<SensorRun>, Vec<SensorRun>) {
    let part = |run: &SensorRun, is_held: bool| {
        let of = |i: &usize| (i * STRETCHES / run.len() % 4 == 3) == is_held;
        run.subset(&(0..run.len()).filter(of).collect::<Vec<_>>())
    };
    let held = |run: &SensorRun| SensorRun { role: Role::Holdout, ..part(run, true) };
    (runs.iter().map(|run| part(run, false)).collect(), runs.iter().map(held).collect())
}

/// What nobody can see without a reference, in words.
fn unseen(raw_turns: bool, readout: &Readout) -> Vec<String> {
    let mut out = vec![
        "there is no reference: what turns both channels alike is not seen (an eccentric disc or magnet, a lag, the angular \
         gain, the sense, an error of the angle that repeats with position), so angular_gain and every held-out angle error \
         are null, and a correction is known to make the radius constant and no more"
            .to_owned(),
    ];
    if readout.kind >= Kind::Affine {
        out.push(
            "without a reference unequal gains and unequal cubics of the two channels look alike: the gain ratio is that of \
             channels with one cubic"
                .to_owned(),
        );
    }
    if !raw_turns {
        out.push("the readout's offsets exceed its amplitude, so that the raw angle does not turn".to_owned());
    }
    out
}

/// The simplest readout that predicts the radius of rows it was not fitted to as well as the best does; with the rms that
/// it leaves, and that of the channels as they are, where they go round the origin.
fn choose_readout(runs: &[SensorRun], rails: Rails) -> Result<(Readout, f64, Option<f64>), Refusal> {
    let no_ellipse = || refuse("the channels draw no ellipse".into(), "two channels that read a cosine and a sine");
    let start = Readout { rails, ..ellipse::algebraic(runs).ok_or_else(no_ellipse)? };
    let folds = Folds::interleaved(runs);
    let fitted = |kind: Kind, runs: &[SensorRun]| {
        if kind == Kind::Plain {
            let plain = Readout { rails, ..Readout::plain() };
            return Some(Readout { radius: mean_radius(&plain, runs), ..plain });
        }
        fit(kind, Weighting::Radius, runs, 1.0, &start).map(|f| f.readout)
    };
    let gap = largest_gap(&start, runs).to_degrees();
    // about an origin far outside of the curve any radius is constant
    let may_be = |kind: &Kind| match kind {
        Kind::Plain => start.is_about_the_origin(),
        kind => *kind < Kind::Cubic || gap < LARGEST_GAP_OF_A_CUBIC_DEG,
    };
    let kinds = [Kind::Plain, Kind::Offset, Kind::Affine, Kind::Cubic];
    let candidates: Vec<Candidate<Kind>> = kinds
        .into_iter()
        .filter(may_be)
        .filter_map(|kind| {
            let losses = losses_of_radius(|fold| fitted(kind, &folds.without(runs, fold)), &folds, runs)?;
            Some(Candidate { size: kind.free().len(), texts: 0, model: kind, losses, of_radius: None })
        })
        .collect();
    let chosen = choose(&candidates, Tolerance::One).ok_or_else(no_ellipse)?;
    if chosen.losses.rms() > LARGEST_LEFT {
        return Err(refuse(
            format!("the best ellipse leaves {:.2} of the radius", chosen.losses.rms()),
            "two channels that read a cosine and a sine",
        ));
    }
    let raw = candidates.iter().find(|c| c.model == Kind::Plain).map(|c| c.losses.rms());
    Ok((fitted(chosen.model, runs).ok_or_else(no_ellipse)?, chosen.losses.rms(), raw))
}

/// Deviations of a readout's values in the words of the library, by the jackknife.
fn deviations(readout: &Readout, runs: &[SensorRun]) -> [f64; 6] {
    if readout.kind == Kind::Plain {
        return [0.0; 6];
    }
    let refit = |block| fit(readout.kind, Weighting::Radius, &without_block(runs, block), 1.0, readout);
    let fits: Vec<[f64; 6]> =
        (0..BLOCKS).filter_map(refit).map(|f| LibraryReadout::from(&f.readout).values()).collect();
    let other = other_noise(readout, runs);
    std::array::from_fn(|i| jackknife(&fits.iter().map(|f| f[i]).collect::<Vec<_>>()).hypot(other[i] / STUDENT_19))
}

fn constancy(readout: &Readout, runs: &[SensorRun]) -> Constancy {
    let mean = mean_radius(readout, runs);
    let (n, square, peak) = undone(readout, runs).fold((0.0, 0.0, 0.0f64), |(n, square, peak), [x, y]| {
        let off = x.hypot(y) / mean - 1.0;
        (n + 1.0, square + off * off, peak.max(off.abs()))
    });
    Constancy { rms: (square / f64::max(n, 1.0)).sqrt(), peak }
}

/// Says that the amplitude changes in the course of a run by more than the rest of what is left, where it does: no readout
/// makes that, and what was found is of the mean.
fn amplitude_that_changes(readout: &Readout, run: &SensorRun) -> Option<String> {
    let radii: Vec<f64> = undone(readout, std::slice::from_ref(run)).map(|[x, y]| x.hypot(y)).collect();
    if radii.len() < PARTS * FEWEST_ROWS {
        return None;
    }
    let parts = radii.chunks(radii.len().div_ceil(PARTS));
    let middles: Vec<f64> = parts.clone().map(|part| median(&mut part.to_vec())).collect();
    let mut within: Vec<f64> =
        parts.zip(&middles).map(|(part, middle)| robust_deviation(part.iter().map(|r| r - middle))).collect();
    let change = span(&middles) / median(&mut middles.clone());
    let rest = median(&mut within) / median(&mut middles.clone());
    (change > LEAST_CHANGE.max(rest)).then(|| {
        format!(
            "{}: the amplitude changes by {:.1} % in the course of the run, which no readout makes: its gap, its light or its \
             supply does; what was found is of the mean, and its intervals are as wide as that makes them",
            run.name,
            100.0 * change
        )
    })
}

/// The largest part of the turn that no row is in, rad.
pub(super) fn largest_gap(readout: &Readout, runs: &[SensorRun]) -> f64 {
    let mut angles: Vec<f64> = undone(readout, runs).map(|[x, y]| y.atan2(x)).collect();
    angles.sort_by(f64::total_cmp);
    let ends = angles.first().zip(angles.last()).map_or(TAU, |(first, last)| first + TAU - last);
    angles.windows(2).map(|w| w[1] - w[0]).fold(ends, f64::max)
}

/// The origin lies within the curve, so that the angle of the raw channels goes round.
fn turns(readout: &Readout) -> bool {
    let [x, y] = readout.undo([0.0, 0.0]);
    readout.kind == Kind::Plain || x.hypot(y) < readout.radius
}

/// rms of the angle behind the readout less the raw one, about its mean, rad.
fn correction(readout: &Readout, runs: &[SensorRun]) -> f64 {
    let rows = runs.iter().filter_map(SensorRun::channels).flatten();
    let moved: Vec<f64> = rows.map(|z| wrapped(readout.angle(*z) - z[1].atan2(z[0]), TAU)).collect();
    let n = moved.len().max(1) as f64;
    let (sine, cosine) = moved.iter().fold((0.0, 0.0), |(s, c), d| (s + d.sin(), c + d.cos()));
    let middle = f64::atan2(sine, cosine);
    (moved.iter().map(|d| wrapped(d - middle, TAU).powi(2)).sum::<f64>() / n).sqrt()
}

/// Whether a calibration could be read again.
fn calibration_stands(calibration: &Calibration) -> Result<(), Refusal> {
    Calibration::from_text(&calibration.to_text(), "the calibration")
        .map(|_| ())
        .map_err(|why| refuse(format!("what was found is no calibration: {why}"), "other runs"))
}
