//! Whether the runs of two channels are of one sensor: what each draws by itself, held against what the others draw. No
//! reference is asked for.

use std::collections::BTreeSet;

use super::curve::{mean_radius, undone};
use super::ellipse;
use super::readout::Readout;
use super::reference_free::largest_gap;
use super::samples::SensorRun;
use crate::error::Refusal;
use crate::numerics::statistics::span;

/// Share of the runs that may be left out.
const MOST_LEFT_OUT: f64 = 1.0 / 3.0;
/// A part of the turn this long without a row leaves an ellipse to be guessed, rad.
const LARGEST_GAP: f64 = std::f64::consts::PI;
/// Directions in which a run has to stand: through five any ellipse goes, and a few more have to speak for it.
const FEWEST_DIRECTIONS: usize = 8;
/// Rows of a run that are looked at.
const ENOUGH_ROWS: usize = 1000;
/// With another run's ellipse undone the radius is off by less than this share, rms, which is an angle error of a degree …
const SAME_CURVE: f64 = 0.02;
/// … or by less than so many times what its own ellipse leaves.
const SAME_LEFT: f64 = 5.0;
/// A sensor that was mounted anew, or drifted, draws another ellipse. It is still believed to be one where the ellipse of
/// either run takes out at least half of what the other is off a circle by: engineering choice.
const LEFT_WHEN_MOUNTED_ANEW: f64 = 0.5;
/// A run on a circle stays on it to this share of what the ellipse of another bends it by: it was divided by its own amplitude.
/// The other's ellipse stands for something where it takes out half of what that run is off a circle by, as above.
const ON_A_CIRCLE: f64 = 0.1;
/// Amplitudes of one sensor in one unit are within this factor: a thousand is the next unit.
const SAME_AMPLITUDE: f64 = 30.0;
/// A channel stands still where it moves by less than this share of the other.
const STILL: f64 = 1e-6;

/// What a run draws by itself.
struct Own {
    run: SensorRun,
    readout: Readout,
    amplitude: f64,
    /// how far the radius is off with its own ellipse undone, and as recorded
    left: f64,
    as_recorded: f64,
}

/// How two runs go together.
enum Together {
    /// they draw one ellipse
    Alike,
    /// they do not, and the ellipse of either makes the other rounder
    MountedAnew,
    No,
}

impl Own {
    fn new(run: &SensorRun) -> Option<Self> {
        let run = run.thinned((run.len() / ENOUGH_ROWS).max(1));
        let readout = ellipse::algebraic(std::slice::from_ref(&run))?;
        if largest_gap(&readout, std::slice::from_ref(&run)) > LARGEST_GAP
            || directions(&readout, &run) < FEWEST_DIRECTIONS
        {
            return None;
        }
        let (left, amplitude) = (off(&readout, &run), readout.amplitude);
        let as_recorded = off(&Readout::plain(), &run);
        Some(Self { run, readout, amplitude, left, as_recorded })
    }

    /// How far the radius of either is off with the ellipse of the other undone.
    fn across(&self, other: &Self) -> f64 {
        off(&self.readout, &other.run).max(off(&other.readout, &self.run))
    }

    /// One ellipse draws both, as far as the ellipse of each is known: what a run in few directions asks for by itself may be any that
    /// goes through them, and that of another run is no worse. Each run is half as far off it as off the ellipse of the other.
    fn are_on_one_ellipse(&self, other: &Self) -> bool {
        let Some(both) = ellipse::algebraic(&[self.run.clone(), other.run.clone()]) else { return false };
        let same = |own: &Self| 0.5 * SAME_CURVE.max(SAME_LEFT * own.left);
        [self, other].iter().all(|own| off(&both, &own.run) <= same(own))
    }

    fn together(&self, other: &Self) -> Together {
        if self.times(other).ln().abs() > SAME_AMPLITUDE.ln() {
            return Together::No;
        }
        if self.is_on_a_circle_beside(other) || other.is_on_a_circle_beside(self) {
            return Together::No;
        }
        let near = self.across(other) <= SAME_CURVE.max(SAME_LEFT * self.left.max(other.left));
        if near || self.are_on_one_ellipse(other) {
            return Together::Alike;
        }
        let rounder = |a: &Self, b: &Self| off(&a.readout, &b.run) <= LEFT_WHEN_MOUNTED_ANEW * b.as_recorded;
        if rounder(self, other) && rounder(other, self) { Together::MountedAnew } else { Together::No }
    }

    /// It draws a circle where the other needs its ellipse.
    fn is_on_a_circle_beside(&self, other: &Self) -> bool {
        let stands = other.left <= LEFT_WHEN_MOUNTED_ANEW * other.as_recorded;
        stands && self.as_recorded < ON_A_CIRCLE * off(&other.readout, &self.run)
    }

    fn times(&self, other: &Self) -> f64 {
        self.amplitude / other.amplitude
    }

    fn agrees(&self, other: &Self) -> bool {
        !matches!(self.together(other), Together::No)
    }

    /// What has to be said of a run that draws another ellipse and is believed.
    fn mounted_anew(&self, other: &Self) -> Option<String> {
        matches!(self.together(other), Together::MountedAnew).then(|| {
            format!(
                "{}: its channels do not quite draw what those of {} do, as of a sensor that was mounted anew or drifted: the \
                 radius is off by {:.2} % as recorded, by {:.2} % with the ellipse of the other undone, and by {:.2} % with \
                 its own; one calibration for both leaves the difference",
                self.run.name,
                other.run.name,
                100.0 * self.as_recorded,
                100.0 * off(&other.readout, &self.run),
                100.0 * self.left
            )
        })
    }

    /// Why it does not agree with another.
    fn against(&self, other: &Self) -> String {
        let times = self.times(other);
        if times.ln().abs() > SAME_AMPLITUDE.ln() {
            return format!(
                "its amplitude is {:.4e}, that of {} is {:.4e}: one of them is in another unit",
                self.amplitude, other.run.name, other.amplitude
            );
        }
        for (circle, ellipse) in [(self, other), (other, self)] {
            if circle.is_on_a_circle_beside(ellipse) {
                return format!(
                    "the channels of {} lie on a circle to {:.1e} of its radius as recorded, those of {} draw an ellipse: those on the \
                     circle were divided by their own amplitude, or are of another sensor",
                    circle.run.name, circle.as_recorded, ellipse.run.name
                );
            }
        }
        format!(
            "its channels do not draw what those of {} do: with the ellipse of the other undone the radius is off by {:.2} %, \
             with its own by {:.2} %",
            other.run.name,
            100.0 * self.across(other),
            100.0 * self.left
        )
    }
}

/// Directions in which a run stands with a readout undone, told to a hundredth of a turn: stations that are read again and again are as
/// many as they are.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from -50 to 50")]
fn directions(readout: &Readout, run: &SensorRun) -> usize {
    let part = |[x, y]: [f64; 2]| (100.0 * y.atan2(x) / std::f64::consts::TAU).round() as i32;
    undone(readout, std::slice::from_ref(run)).map(part).collect::<BTreeSet<_>>().len()
}

/// rms of the radius about its mean, as a share of it, with a readout undone.
fn off(readout: &Readout, run: &SensorRun) -> f64 {
    let run = std::slice::from_ref(run);
    let mean = mean_radius(readout, run);
    let (n, square) =
        undone(readout, run).fold((0.0, 0.0), |(n, s), [x, y]| (n + 1.0, s + (x.hypot(y) / mean - 1.0).powi(2)));
    (square / f64::max(n, 1.0)).sqrt()
}

/// The runs that are of one sensor; those that are not are left out by name.
///
/// # Errors
/// Where too few agree to say which are right, or a channel stands still in all.
pub(super) fn of_one_sensor(runs: Vec<SensorRun>, warnings: &mut Vec<String>) -> Result<Vec<SensorRun>, Refusal> {
    let owns: Vec<Option<Own>> = runs.iter().map(Own::new).collect();
    let told: Vec<&Own> = owns.iter().flatten().collect();
    let friends = |own: &Own| told.iter().filter(|other| own.agrees(other)).count();
    let usual = told.iter().rev().max_by_key(|own| friends(own));
    let why = |(run, own): (&SensorRun, &Option<Own>)| match (own, usual) {
        _ if still(run).is_some() => still(run),
        (Some(own), Some(usual)) if !own.agrees(usual) => Some(own.against(usual)),
        _ => None,
    };
    let why: Vec<Option<String>> = runs.iter().zip(&owns).map(why).collect();
    let odd: Vec<usize> = (0..runs.len()).filter(|&i| why[i].is_some()).collect();
    if let Some(&first) = odd.first().filter(|_| odd.len() as f64 > MOST_LEFT_OUT * runs.len() as f64) {
        let wanted = if still(&runs[first]).is_some() {
            "two channels that read a cosine and a sine"
        } else {
            "runs of one sensor in one unit, each channel in its place; or each sensor as a campaign of its own"
        };
        return Err(Refusal::no_answer(&runs[first].name, why[first].clone().unwrap_or_default(), wanted));
    }
    let said =
        runs.iter().zip(&why).filter_map(|(run, why)| Some(format!("{}: left out: {}", run.name, why.as_ref()?)));
    warnings.extend(said);
    warnings.extend(usual.iter().flat_map(|usual| told.iter().filter_map(|own| own.mounted_anew(usual))));
    Ok(runs.into_iter().zip(why).filter(|(_, why)| why.is_none()).map(|(run, _)| run).collect())
}

/// A channel that stands still while the other moves.
fn still(run: &SensorRun) -> Option<String> {
    let (x, y): (Vec<f64>, Vec<f64>) = run.channels()?.iter().map(|z| (z[0], z[1])).unzip();
    let spans = [span(&x), span(&y)];
    let stands = |own: usize| spans[own] <= STILL * spans[1 - own];
    let (name, at) = match (stands(0), stands(1)) {
        (true, false) => ("xc_v", x.first()?),
        (false, true) => ("yc_v", y.first()?),
        _ => return None,
    };
    Some(format!("{name} stands still, at {at}, while the other channel moves"))
}
