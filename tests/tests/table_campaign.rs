//! A rate table's campaign of devices with every fault of their electronics at once, without ring-downs, from a loop of its own:
//! what is named, what is left, and how much of the bias the same device leaves when it calibrates itself.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use cvg_calibration::recording::{Campaign, Recording, Role, Run, RunKind};
use cvg_calibration::report::Report;
use cvg_calibration::{Options, Refusal, identify};
use cvg_calibrator::Settings;
use cvg_tests::envelope_loop::lives::{Life, lived, steps};
use cvg_tests::envelope_loop::{Device, Loop, Moment, bias_deg};

/// Rates of the table, deg/s, each in both senses.
const RATES_DPS: [f64; 4] = [500.0, 250.0, 100.0, 40.0];
const LENGTH_S: f64 = 22.0;
const SETTLE_S: f64 = 2.0;
/// Control steps to a row: 100 rows a second.
const EVERY: usize = 20;

/// A rotation at `rate_dps` of a device that nothing compensates.
fn rotation(device: &Device, seed: u64, rate_dps: f64, seconds: f64, role: Role) -> Run {
    let mut run = Loop::<f64>::new(device, seed, &Settings::default());
    let rate_rad_s = rate_dps.to_radians();
    let mut columns: [Vec<f64>; 9] = Default::default();
    for i in 0..steps(seconds) {
        let t = run.t;
        run.step(Moment { rate_rad_s, ..Moment::default() }, false);
        if i % EVERY == 0 {
            let (e, r) = (run.row.readout, run.row);
            let row = [t, e.x_c, e.x_s, e.y_c, e.y_s, r.energy_v, r.quadrature_v, rate_dps, rate_dps * t];
            columns.iter_mut().zip(row).for_each(|(c, v)| c.push(v));
        }
    }
    let [t_s, xc, xs, yc, ys, vas, vqc, rate, table] = columns;
    let file = format!("{rate_dps:+}-{seed}.csv");
    let recording = Recording {
        source: file.clone().into(),
        in_memory: true,
        t_s,
        xc_v: Some(xc),
        xs_v: Some(xs),
        yc_v: Some(yc),
        ys_v: Some(ys),
        vas_v: Some(vas),
        vqc_v: Some(vqc),
        rate_dps: Some(rate),
        table_deg: Some(table),
        ..Recording::default()
    };
    Run { kind: RunKind::Rotation, file: file.into(), settle_s: SETTLE_S, role, amplitude: None, recording }
}

fn identified(device: &Device, seed: u64) -> Result<Report, Refusal> {
    let both = RATES_DPS.iter().flat_map(|r| [*r, -*r]);
    let mut runs: Vec<Run> =
        both.zip(1..).map(|(rate, n)| rotation(device, seed * 100 + n, rate, LENGTH_S, Role::Fit)).collect();
    runs.push(rotation(device, seed * 100, 500.0, 8.0, Role::Holdout));
    let campaign = Campaign { device: "table".into(), drive_per_s_v: Some(1.0), runs, ..Campaign::default() };
    identify(campaign, &Options::default()).map(|i| i.report)
}

/// A parameter and its deviation.
fn parameter(report: &Report, name: &str) -> Option<(f64, f64)> {
    let p = report.effects.iter().flat_map(|e| &e.parameters).find(|p| p.name == name)?;
    Some((p.value, p.ci95.map_or(f64::NAN, |c| (c[1] - c[0]) / 3.92)))
}

/// Errors of the detection's ratio and skew and of the drives' phase, in deviations.
fn off(device: &Device, report: &Report) -> [f64; 3] {
    let common = device.force_phase - 0.5 * (device.phase.0 + device.phase.1);
    [("detection_gain_ratio", device.ratio), ("skew", device.skew), ("actuation_phase", common)]
        .map(|(name, truth)| parameter(report, name).map_or(f64::NAN, |(value, sigma)| (value - truth) / sigma))
}

#[test]
fn seven_faults_at_once_are_told_without_ring_downs() {
    for seed in [60_000, 60_005] {
        let device = Device::random(seed);
        let report = identified(&device, seed).unwrap();
        let (left, floor) = (report.heldout.discovered.rms_deg, report.heldout.noise_floor_deg);
        assert!(left < 1.3 * floor, "{seed}: {left} of {floor}");
        let off = off(&device, &report);
        assert!(off.iter().all(|z| z.abs() < 4.0), "{seed}: {off:?}");
        assert!(report.steps.iter().all(|s| s.gain.is_none_or(|gain| gain > 0.0)), "{seed}: {:?}", report.steps);
    }
}

/// `CVG_TRIALS` devices from `CVG_FIRST` on: what a table leaves at 500 deg/s, and what the same device leaves that was turned by
/// hand, and that was turned at random.
#[test]
fn table_of_both() {
    let number = |name: &str| std::env::var(name).ok().and_then(|v| v.parse::<u64>().ok());
    let Some(count) = number("CVG_TRIALS") else { return println!("skipped: CVG_TRIALS is not set") };
    let first = number("CVG_FIRST").unwrap_or(0);
    for seed in first..first + count {
        let device = Device::random(seed);
        let [hand, turning] = [Life::RestThenHand, Life::Turning].map(|life| {
            let run = lived::<f32>(&device, seed, life, 600.0);
            1e3 * bias_deg(&device, &run.state, true, 500.0, 6.0)
        });
        let alone = format!("by hand {hand:.3} turning {turning:.3} mdeg");
        match identified(&device, seed) {
            Ok(report) => {
                let h = &report.heldout;
                let (left, floor) = (1e3 * h.discovered.rms_deg, 1e3 * h.noise_floor_deg);
                println!("{seed}: table {left:.3} of {floor:.3} mdeg, off {:.1?}; {alone}", off(&device, &report));
            }
            Err(refusal) => println!("{seed}: table {refusal}; {alone}"),
        }
    }
}
