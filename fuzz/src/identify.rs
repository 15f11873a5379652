//! Any bytes as a small campaign whose columns are what a few numbers make of them, with any floats written over some rows:
//! identified or refused, never a panic, an end; what leaves in an answer is finite, and its calibration is read again.

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::{Campaign, Instrument, Recording, Role, Run, RunKind};
use cvg_calibration::report::{Estimate, Report};
use cvg_calibration::{Options, identify};

/// Runs of a campaign and rows of a run at most: more take longer and show no more.
const MOST_RUNS: u8 = 3;
const MOST_ROWS: usize = 512;

/// Bytes taken one after the other; none left are zeros.
struct Source<'a>(&'a [u8]);

impl Source<'_> {
    fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        first
    }

    fn one_of<const N: usize>(&mut self, values: [f64; N]) -> f64 {
        values[usize::from(self.byte()) % N]
    }

    /// Any float; what is no number is nothing, as no reader lets it through.
    fn float(&mut self) -> f64 {
        let value = f64::from_le_bytes(std::array::from_fn(|_| self.byte()));
        if value.is_finite() { value } else { 0.0 }
    }
}

pub fn run(bytes: &[u8]) {
    let mut source = Source(bytes);
    let campaign = campaign(&mut source);
    let Ok(identified) = identify(campaign, &Options::default()) else { return };
    finite(&identified.report);
    let written = identified.calibration.to_text();
    let again = Calibration::from_text(&written, "again").unwrap_or_else(|e| panic!("{e}: {written}"));
    assert_eq!(again.to_text(), written);
}

/// Every number of an answer is one.
fn finite(report: &Report) {
    let is_finite = |e: &Estimate| e.value.is_finite() && e.ci95.iter().all(|v| v.is_finite());
    let gains = [Some(report.angular_gain), report.detection_gain_ratio, report.actuation_gain_ratio];
    assert!(gains.iter().flatten().all(is_finite), "{gains:?}");
    let parameters = report.effects.iter().flat_map(|e| &e.parameters);
    for p in parameters {
        assert!(p.value.is_finite() && p.ci95.is_none_or(|ci| ci.iter().all(|v| v.is_finite())), "{p:?}");
    }
    let heldout = &report.heldout;
    assert!([heldout.declared.rms_deg, heldout.discovered.rms_deg].iter().all(|v| v.is_finite()), "{heldout:?}");
}

fn campaign(source: &mut Source<'_>) -> Campaign {
    let (runs, kind) = (1 + source.byte() % MOST_RUNS, source.byte());
    let mut campaign = Campaign { device: "bytes".into(), ..Campaign::default() };
    if kind & 1 != 0 {
        campaign.instrument = Instrument::Sensor;
    }
    if kind & 2 != 0 {
        campaign.period_deg = Some(if kind & 4 != 0 { 180.0 } else { 360.0 });
    }
    if kind & 8 != 0 {
        campaign.angular_gain = Some(source.float());
    }
    campaign.runs = (0..runs).map(|number| one_run(source, number)).collect();
    campaign
}

fn one_run(source: &mut Source<'_>, number: u8) -> Run {
    let what = source.byte();
    let mut recording = columns(source, number);
    let rows = recording.len();
    for _ in 0..what >> 5 {
        patch(source, &mut recording);
    }
    let kind = match what & 3 {
        3 if number > 0 && recording.xc_v.is_some() && recording.vas_v.is_some() => {
            RunKind::Ringdown { angle_deg: 0.0, energy_off_s: recording.t_s[rows / 2] }
        }
        _ => RunKind::Rotation,
    };
    let role = if what & 4 != 0 && number > 0 { Role::Holdout } else { Role::Fit };
    Run { kind, file: recording.source.clone(), settle_s: 0.0, role, amplitude: None, recording }
}

/// A pattern that turns evenly, in columns that are there or not.
fn columns(source: &mut Source<'_>, number: u8) -> Recording {
    let (there, rows) = (source.byte(), 2 + 2 * usize::from(source.byte()));
    let step_s = source.one_of([0.01, 0.01, 0.5, 1e-12, 1e9]);
    let rate_dps = source.one_of([500.0, -300.0, 50.0, 0.0, 1e-300, 1e300]);
    let amplitude = source.one_of([1.0, 1.0, 0.0, 1e-300, 1e150, 1e300]);
    let offset = source.one_of([0.0, 0.0, 1e-3, 1.0, 1e6, 1e300]);
    let (gain, ratio) = (f64::from(source.byte()) / 160.0, 1.0 + f64::from(source.byte()) / 1024.0);
    let noise = source.one_of([1e-5, 0.0, 1e-3, 1.0]);
    let mut seed = u64::from(source.byte()) + 1;
    let mut draw = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        noise * ((seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5)
    };
    let t_s: Vec<f64> = (0..rows.min(MOST_ROWS)).map(|i| i as f64 * step_s).collect();
    let column = |value: &mut dyn FnMut(f64) -> f64| -> Vec<f64> {
        let number = |t: &f64| Some(value(*t)).filter(|v| v.is_finite()).unwrap_or(0.0);
        t_s.iter().map(number).collect()
    };
    let theta = |t: f64| -gain * rate_dps.to_radians() * t;
    let has = |bit: u8| there & (1 << bit) != 0;
    let x = column(&mut |t| offset + amplitude * (theta(t).cos() + draw()));
    let y = column(&mut |t| offset + amplitude * ratio * (theta(t).sin() + draw()));
    let small = |v: &[f64]| v.iter().map(|v| 1e-3 * v).collect::<Vec<f64>>();
    let mut recording = Recording { source: format!("{number}.csv").into(), ..Recording::default() };
    recording.rate_dps = (!has(0)).then(|| vec![rate_dps; t_s.len()]);
    recording.table_deg = (has(0) || has(1)).then(|| column(&mut |t| rate_dps * t));
    recording.theta_deg = has(2).then(|| column(&mut |t| theta(t).to_degrees()));
    recording.vas_v = has(4).then(|| column(&mut |_| 0.01 * amplitude));
    recording.vqc_v = has(5).then(|| column(&mut |t| 1e-3 * t.sin()));
    recording.temp_c = has(6).then(|| column(&mut |t| 20.0 + t));
    if !has(2) {
        (recording.xs_v, recording.ys_v) = if has(3) { (Some(small(&y)), Some(small(&x))) } else { (None, None) };
        (recording.xc_v, recording.yc_v) = (Some(x), Some(y));
    }
    recording.t_s = t_s;
    recording
}

/// One float over some rows of a column.
fn patch(source: &mut Source<'_>, recording: &mut Recording) {
    let rows = recording.len();
    let (which, at, length) =
        (source.byte(), 2 * usize::from(source.byte()) % rows, 1 + usize::from(source.byte() % 64));
    let value = source.float();
    let column = match which % 8 {
        0 => &mut recording.rate_dps,
        1 => &mut recording.table_deg,
        2 => &mut recording.xc_v,
        3 => &mut recording.yc_v,
        4 => &mut recording.theta_deg,
        5 => &mut recording.vas_v,
        6 => &mut recording.xs_v,
        _ => &mut recording.vqc_v,
    };
    if let Some(column) = column {
        column[at..(at + length).min(rows)].fill(value);
    }
}
