//! For firmware engineers: what was identified, applied sample by sample in `f32`, as the electronics would.
//!
//! `cargo run -p cvg-examples --bin firmware_engineer`. What [`Electronics`] uses is `no_std`, does not allocate and cannot
//! panic; around it stands a recording in place of the instrument. What the readout bends is undone here; anisodamping
//! precesses the pattern itself, and stays in an angle that is measured well.

use std::error::Error;

use cvg_calibration::recording::{Campaign, Role};
use cvg_calibration::{Options, identify};
use cvg_controller::{ActuationCompensation, Allocation, OrbitCommands};
use cvg_estimator::Compensation;
use cvg_estimator::direction::major_axis;
use cvg_model::Envelope;
use cvg_model::effects::{EffectId, Moment, Stage, Values};
use cvg_simulator::Scenario;

/// Built once at start, then never changed.
struct Electronics {
    readout: Compensation<f32, 4>,
    drives: Allocation<f32>,
}

impl Electronics {
    /// From the effects of a `calibration.toml`.
    fn new(effects: &[(EffectId, Values<f32>)]) -> Result<Self, Box<dyn Error>> {
        let of = |stage: Stage| effects.iter().filter(move |(id, _)| id.description().stage == stage).copied();
        let (readout, actuation): (Vec<_>, Vec<_>) = (of(Stage::Readout).collect(), of(Stage::Actuation).collect());
        Ok(Self {
            readout: Compensation::new(&readout)?,
            drives: Allocation::new(Some(ActuationCompensation::new(&actuation)?), 10.0)?,
        })
    }

    /// One control sample: the envelope of the demodulator in, pattern angle in rad and drive voltages out.
    fn step(&self, measured: Envelope<f32>, v_as: f32, v_qc: f32, at: &Moment<f32>) -> (f32, [f32; 4]) {
        let vibration = self.readout.apply(measured, at);
        let pendulum = vibration.pendulum();
        let direction = major_axis(&vibration, &pendulum);
        let commands = OrbitCommands { v_as, v_qc, v_qs: 0.0, v_ac: 0.0 };
        let volts = self.drives.step(&commands, direction.cos, direction.sin).volts;
        (pendulum.angle(), [volts.x_c, volts.x_s, volts.y_c, volts.y_s])
    }
}

/// Peak of an angle less its best line over time, deg; the angle has a period of 180°.
fn peak_deg(t_s: &[f64], angle_rad: &[f64]) -> f64 {
    let mut turned = vec![0.0; angle_rad.len()];
    for i in 1..angle_rad.len() {
        let step = (angle_rad[i] - angle_rad[i - 1]).to_degrees();
        turned[i] = turned[i - 1] + step - 180.0 * (step / 180.0).round();
    }
    let n = t_s.len() as f64;
    let [mean_t, mean_a] = [t_s, &turned].map(|v| v.iter().sum::<f64>() / n);
    let (mut tt, mut ta) = (0.0, 0.0);
    for (t, a) in t_s.iter().zip(&turned) {
        tt += (t - mean_t).powi(2);
        ta += (t - mean_t) * (a - mean_a);
    }
    t_s.iter().zip(&turned).fold(0.0, |peak, (t, a)| (a - mean_a - ta / tt * (t - mean_t)).abs().max(peak))
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    Scenario::paper().simulate().write(folder.path())?;
    let path = folder.path().join("campaign.toml");
    let calibration = identify(Campaign::open(&path)?, &Options::default())?.calibration;

    #[allow(clippy::cast_possible_truncation, reason = "the electronics calculate in f32")]
    let effects: Vec<_> = calibration.hypothesis.members.iter().map(|m| (m.id, m.values.map(|v| v as f32))).collect();
    let (raw, compensated) = (Electronics::new(&[])?, Electronics::new(&effects)?);

    for run in Campaign::open(&path)?.runs.iter().filter(|run| run.role == Role::Holdout) {
        let r = &run.recording;
        let column = |v: &Option<Vec<f64>>| v.clone().unwrap_or_else(|| vec![0.0; r.len()]);
        let [xc, xs, yc, ys, vas, vqc] = [&r.xc_v, &r.xs_v, &r.yc_v, &r.ys_v, &r.vas_v, &r.vqc_v].map(column);
        let rows = run.settled()?;
        #[allow(clippy::cast_possible_truncation, reason = "what the electronics get is f32")]
        let angles = |electronics: &Electronics| -> Vec<f64> {
            let step = |i: usize| {
                let e = Envelope::new(xc[i] as f32, xs[i] as f32, yc[i] as f32, ys[i] as f32);
                let at = Moment { t_s: r.t_s[i] as f32, ..Moment::default() };
                f64::from(electronics.step(e, vas[i] as f32, vqc[i] as f32, &at).0)
            };
            rows.clone().map(step).collect()
        };
        let [before, after] = [&raw, &compensated].map(|e| peak_deg(&r.t_s[rows.clone()], &angles(e)));
        println!("{}: angle error, peak {before:.4}° → {after:.4}° in f32", run.file.display());
    }
    Ok(())
}
