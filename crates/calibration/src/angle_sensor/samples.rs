//! The runs of an angle sensor made ready: what the reference did, what the channels read, and which rows serve for what.
//! Immutable once built: selection and estimation look at it through lists of rows.

use super::rails::without_rails_of_their_own;
use crate::data::table::{integrated, turned};
use crate::data::track::held;
use crate::error::Refusal;
use crate::numerics::statistics::span;
use crate::recording::{Campaign, Reference, Role, Run};

/// What one run recorded of the instrument.
#[derive(Debug, Clone)]
pub(crate) enum Reading {
    /// the instrument's own angle, rad
    Angle(Vec<f64>),
    /// two channels that read the cosine and the sine, in any unit
    Channels(Vec<[f64; 2]>),
}

/// A run, or the part of one that serves one purpose.
#[derive(Debug, Clone)]
pub(crate) struct SensorRun {
    /// name of the run, for messages
    pub(crate) name: String,
    /// index in the campaign
    pub(crate) number: usize,
    /// what it is used for
    pub(crate) role: Role,
    /// the reference is what was asked for and not what was measured
    pub(crate) commanded: bool,
    /// time, s
    pub(crate) t_s: Vec<f64>,
    /// reference angle, unwrapped, rad
    pub(crate) reference_rad: Vec<f64>,
    /// its rate, rad/s
    pub(crate) rate_rad_s: Vec<f64>,
    /// its acceleration, rad/s²
    pub(crate) acceleration_rad_s2: Vec<f64>,
    /// what the instrument read
    pub(crate) reading: Reading,
    /// its temperature, °C, where it was recorded
    pub(crate) temp_c: Option<Vec<f64>>,
    /// the channels as recorded, where `reading` has been taken to another temperature
    pub(crate) recorded: Option<Vec<[f64; 2]>>,
}

/// Share of a run, in time, that is fitted where no run is held out.
const FITTED_SHARE: f64 = 0.75;
/// Rows below which a run tells nothing.
const FEWEST_ROWS: usize = 8;

impl SensorRun {
    pub(crate) fn new(run: Run, number: usize, stated: Option<Reference>) -> Result<Self, Refusal> {
        let settled = run.settled()?;
        let name = run.file.display().to_string();
        let r = run.recording;
        let t_s = r.t_s[settled.clone()].to_vec();
        let (reference_rad, measured) = match (&r.table_deg, &r.rate_dps) {
            (Some(table), _) => (turned(&table[settled.clone()], &r.t_s[settled.clone()]), true),
            (None, Some(rate)) => {
                let rate = &rate[settled.clone()];
                (integrated(&t_s, rate), rate.iter().any(|w| *w != rate[0]))
            }
            (None, None) => return Err(Refusal::new(&name, "there is no reference", "rate_dps or table_deg")),
        };
        let reading = match (&r.xc_v, &r.yc_v, &r.theta_deg) {
            (Some(x), Some(y), _) => Reading::Channels(settled.clone().map(|i| [x[i], y[i]]).collect()),
            (_, _, Some(theta)) => Reading::Angle(settled.clone().map(|i| theta[i].to_radians()).collect()),
            _ => return Err(Refusal::new(&name, "there is neither xc_v and yc_v nor theta_deg", "one of the two")),
        };
        let rate_rad_s = gradient(&reference_rad, &t_s);
        let acceleration_rad_s2 = bend(&reference_rad, &t_s);
        let commanded = stated.map_or(!measured, |s| s == Reference::Commanded);
        Ok(Self {
            name,
            number,
            role: run.role,
            commanded,
            t_s,
            reference_rad,
            rate_rad_s,
            acceleration_rad_s2,
            reading,
            temp_c: r.temp_c.filter(|t| t.iter().any(|v| v.is_finite())).map(|temp| held(temp)[settled].to_vec()),
            recorded: None,
        })
    }

    /// A run of two channels that nothing else is known of: its reference stands at zero.
    pub(crate) fn without_reference(run: Run, number: usize) -> Result<Self, Refusal> {
        let settled = run.settled()?;
        let name = run.file.display().to_string();
        let r = run.recording;
        let (Some(x), Some(y)) = (&r.xc_v, &r.yc_v) else {
            return Err(Refusal::new(
                &name,
                "an angle alone says nothing of its own errors",
                "xc_v and yc_v, or a reference: table_deg or rate_dps",
            ));
        };
        let still = vec![0.0; settled.len()];
        Ok(Self {
            name,
            number,
            role: run.role,
            commanded: false,
            t_s: r.t_s[settled.clone()].to_vec(),
            reference_rad: still.clone(),
            rate_rad_s: still.clone(),
            acceleration_rad_s2: still,
            reading: Reading::Channels(settled.map(|i| [x[i], y[i]]).collect()),
            temp_c: None,
            recorded: None,
        })
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.t_s.len()
    }

    /// The rows `kept` as a run of their own.
    pub(crate) fn subset(&self, kept: &[usize]) -> Self {
        let pick = |v: &[f64]| kept.iter().map(|&i| v[i]).collect();
        Self {
            name: self.name.clone(),
            t_s: pick(&self.t_s),
            reference_rad: pick(&self.reference_rad),
            rate_rad_s: pick(&self.rate_rad_s),
            acceleration_rad_s2: pick(&self.acceleration_rad_s2),
            reading: match &self.reading {
                Reading::Angle(theta) => Reading::Angle(pick(theta)),
                Reading::Channels(v) => Reading::Channels(kept.iter().map(|&i| v[i]).collect()),
            },
            temp_c: self.temp_c.as_deref().map(pick),
            recorded: self.recorded.as_ref().map(|v| kept.iter().map(|&i| v[i]).collect()),
            ..*self
        }
    }

    /// The run with its channels as recorded.
    pub(crate) fn as_recorded(&self) -> Self {
        let reading = self.recorded.clone().map_or_else(|| self.reading.clone(), Reading::Channels);
        Self { reading, recorded: None, ..self.clone() }
    }

    /// Every `stride`-th row.
    pub(crate) fn thinned(&self, stride: usize) -> Self {
        self.subset(&(0..self.len()).step_by(stride.max(1)).collect::<Vec<_>>())
    }

    /// How far the reference turns in all, rad.
    pub(crate) fn travel_rad(&self) -> f64 {
        span(&self.reference_rad)
    }

    /// How far it turns there and back, rad.
    pub(crate) fn path_rad(&self) -> f64 {
        self.reference_rad.windows(2).map(|w| (w[1] - w[0]).abs()).sum()
    }

    /// The channels, where it has them.
    pub(crate) fn channels(&self) -> Option<&[[f64; 2]]> {
        match &self.reading {
            Reading::Channels(v) => Some(v),
            Reading::Angle(_) => None,
        }
    }
}

/// Makes the rotation runs of a campaign ready. Says which rows are left out.
///
/// # Errors
/// Where a run has no reference.
pub(crate) fn prepare(campaign: Campaign, warnings: &mut Vec<String>) -> Result<Vec<SensorRun>, Refusal> {
    let stated = campaign.reference;
    let runs = campaign.runs.into_iter().enumerate().map(|(i, r)| SensorRun::new(r, i, stated));
    Ok(without_rails_of_their_own(&runs.collect::<Result<Vec<_>, _>>()?, warnings))
}

/// The runs to fit, and those held out. Where none is held out, the last quarter in time of each is.
///
/// # Errors
/// Where nothing to fit is left.
pub(crate) fn apart(runs: Vec<SensorRun>) -> Result<(Vec<SensorRun>, Vec<SensorRun>), Refusal> {
    let (fit, held): (Vec<_>, Vec<_>) = if runs.iter().any(|r| r.role == Role::Holdout) {
        runs.into_iter().partition(|r| r.role == Role::Fit)
    } else {
        runs.iter().map(last_quarter_apart).unzip()
    };
    let fit: Vec<_> = fit.into_iter().filter(|r| r.len() >= FEWEST_ROWS).collect();
    if fit.is_empty() {
        return Err(Refusal::no_answer(
            "campaign",
            format!("no run has {FEWEST_ROWS} rows to fit"),
            "more stations, twelve at least, or a longer recording",
        ));
    }
    Ok((fit, held.into_iter().filter(|r| r.len() > 1).collect()))
}

fn last_quarter_apart(run: &SensorRun) -> (SensorRun, SensorRun) {
    let (first, last) = (run.t_s[0], run.t_s[run.len() - 1]);
    let cut = run.t_s.partition_point(|t| *t < first + FITTED_SHARE * (last - first));
    let rows: Vec<usize> = (0..run.len()).collect();
    (run.subset(&rows[..cut]), SensorRun { role: Role::Holdout, ..run.subset(&rows[cut..]) })
}

/// Derivative over uneven steps: second order inside, first order at the ends.
fn gradient(y: &[f64], t: &[f64]) -> Vec<f64> {
    let n = y.len();
    let slope = |i: usize, j: usize| (y[j] - y[i]) / (t[j] - t[i]).max(f64::MIN_POSITIVE);
    (0..n)
        .map(|i| match i {
            _ if n < 2 => 0.0,
            0 => slope(0, 1),
            _ if i == n - 1 => slope(n - 2, n - 1),
            _ => {
                let (before, after) = (t[i] - t[i - 1], t[i + 1] - t[i]);
                (slope(i - 1, i) * after + slope(i, i + 1) * before) / (before + after).max(f64::MIN_POSITIVE)
            }
        })
        .collect()
}

/// Rows of a bend on either side of the one that it is told for.
const BESIDE: usize = 2;

/// Second derivative over uneven steps, exact for a parabola, from the two rows before and the two after each: its own would bring its own
/// noise along, and that is in the error of the angle too. At the ends it is that of the nearest row of which they are no part either; of
/// few rows nothing.
fn bend(y: &[f64], t: &[f64]) -> Vec<f64> {
    let n = y.len();
    let (inner, last) = (BESIDE + BESIDE + 1, n.saturating_sub(1));
    if n <= 2 * inner {
        return vec![0.0; n];
    }
    // slope of a chord, which is that of the parabola in its middle
    let chord = |i: usize, j: usize| ((y[j] - y[i]) / (t[j] - t[i]).max(f64::MIN_POSITIVE), 0.5 * (t[i] + t[j]));
    let at = |i: usize| {
        let ((before, from), (after, to)) = (chord(i - 2, i - 1), chord(i + 1, i + 2));
        (after - before) / (to - from).max(f64::MIN_POSITIVE)
    };
    (0..n)
        .map(|i| match i {
            _ if i < BESIDE => at(i + BESIDE + 1),
            _ if i + BESIDE > last => at(i - BESIDE - 1),
            _ => at(i),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bend_of_a_parabola_over_uneven_steps_is_told_without_the_row_itself() {
        let t: Vec<f64> = (0..15).map(|i| f64::from(i) + 0.3 * f64::from(i % 3)).collect();
        let mut y: Vec<f64> = t.iter().map(|t| 3.0 * t * t - t).collect();
        assert!(bend(&y, &t).iter().all(|b| (b - 6.0).abs() < 1e-9), "{:?}", bend(&y, &t));
        for row in 0..t.len() {
            let sound = y[row];
            y[row] += 1.0;
            assert!((bend(&y, &t)[row] - 6.0).abs() < 1e-9, "{row}");
            y[row] = sound;
        }
        assert_eq!(bend(&y[..10], &t[..10]), vec![0.0; 10]);
    }

    #[test]
    fn the_gradient_of_a_parabola_over_uneven_steps_is_its_slope() {
        let t = [0.0, 0.1, 0.35, 0.5, 0.9];
        let y: Vec<f64> = t.iter().map(|t| 3.0 * t * t).collect();
        for (i, slope) in gradient(&y, &t).iter().enumerate().take(4).skip(1) {
            assert!((slope - 6.0 * t[i]).abs() < 1e-12, "{slope}");
        }
    }
}
