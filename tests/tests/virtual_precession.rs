//! Recordings of virtual precession at rest and of rotation that nobody recorded: what a bench learns from them, against what
//! the same device learns in operation.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use cvg_calibration::recording::{Campaign, Recording, Role, Run, RunKind};
use cvg_calibration::report::Status;
use cvg_calibration::report::survey::Survey;
use cvg_calibration::{Answer, Options, Refusal, Surveyed, answer, compensate, identify};
use cvg_calibrator::{Parameter, Settings};
use cvg_simulator::scenario as simulated;
use cvg_simulator::scenario::Scenario;
use cvg_tests::envelope_loop::lives::{Life, all, lived, steps};
use cvg_tests::envelope_loop::{Device, Loop, Moment};

/// What is done to a device while it is recorded.
#[derive(Clone, Copy)]
enum Bench {
    /// precessed to and fro for four minutes
    Rest,
    /// the same, turned by hand for ten seconds of it
    Hand,
}

/// Seconds between two reversals of the precession.
const REVERSAL_S: f64 = 9.0;
const LENGTH_S: f64 = 240.0;

/// A recording of a device that nothing compensates, a row every `every` control steps.
fn recorded(device: &Device, seed: u64, bench: Bench, every: usize) -> Recording {
    let mut run = Loop::<f64>::new(device, seed, &Settings::default());
    let mut columns: [Vec<f64>; 8] = Default::default();
    for i in 0..steps(LENGTH_S) {
        let t = run.t;
        let speed: f64 = if ((t / (4.0 * REVERSAL_S)) as u64).is_multiple_of(2) { 40.0 } else { 20.0 };
        let virtual_dps = if ((t / REVERSAL_S) as u64).is_multiple_of(2) { speed } else { -speed };
        run.asked_rad_s = virtual_dps.to_radians();
        let turned = matches!(bench, Bench::Hand) && (100.0..110.0).contains(&t);
        // by hand: never the same rate
        let rate = if turned { 1.0 + 0.3 * (3.0 * t).sin() } else { 5e-5 };
        run.step(Moment { rate_rad_s: rate, ..Moment::default() }, false);
        if i % every == 0 {
            let r = run.row;
            let e = r.readout;
            let row = [t, e.x_c, e.x_s, e.y_c, e.y_s, r.energy_v, r.quadrature_v, virtual_dps];
            columns.iter_mut().zip(row).for_each(|(c, v)| c.push(v));
        }
    }
    let [t_s, xc, xs, yc, ys, vas, vqc, virtual_dps] = columns;
    Recording {
        source: "bench.csv".into(),
        in_memory: true,
        t_s,
        xc_v: Some(xc),
        xs_v: Some(xs),
        yc_v: Some(yc),
        ys_v: Some(ys),
        vas_v: Some(vas),
        vqc_v: Some(vqc),
        virtual_dps: Some(virtual_dps),
        ..Recording::default()
    }
}

fn campaign(recording: Recording) -> Campaign {
    let run = Run {
        kind: RunKind::Virtual,
        file: "bench.csv".into(),
        settle_s: 2.0,
        role: Role::Fit,
        amplitude: None,
        recording,
    };
    Campaign {
        device: "bench".into(),
        drive_per_s_v: Some(1.0),
        control_hz: Some(2000.0),
        runs: vec![run],
        ..Campaign::default()
    }
}

fn told(campaign: Campaign) -> Result<Surveyed, Refusal> {
    match answer(campaign, &Options::default())? {
        Answer::Surveyed(surveyed) => Ok(*surveyed),
        Answer::Identified(_) => panic!("there is no reference"),
    }
}

/// A parameter of an effect, and its standard deviation.
fn parameter(r: &Survey, name: &str) -> Option<(f64, f64)> {
    let all = r.effects.iter().flat_map(|e| &e.parameters).chain(&r.virtual_precession.as_ref()?.parameters);
    let p = all.into_iter().find(|p| p.name == name)?;
    Some((p.value, p.ci95.map_or(f64::NAN, |c| (c[1] - c[0]) / 3.92)))
}

fn truths(d: &Device) -> Vec<(&'static str, f64)> {
    vec![
        ("detection_gain_ratio", d.ratio),
        ("skew", d.skew),
        ("phase_difference", d.phase.1 - d.phase.0),
        ("actuation_gain_ratio", d.force.0 / d.force.1),
        ("actuation_skew", d.force_skew),
        ("anisodamping", d.anisodamping.0),
        ("anisoelasticity", d.split.0),
        ("kappa", d.cubic),
        ("offset_x", d.offset.0),
        ("offset_y", d.offset.1),
        ("damping_per_s", 1.0 / d.tau_s),
    ]
}

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// In operation and on the bench, each with what it says of itself.
fn in_operation(device: &Device, seed: u64) -> [(f64, f64); 3] {
    let run = lived::<f64>(device, seed, Life::RestThenHand, 360.0);
    let of = |p: Parameter| run.state.estimate(p).map(|e| (e.value, e.sigma)).unwrap();
    [of(Parameter::DetectionRatio), of(Parameter::DetectionSkew), of(Parameter::DetectionPhase)]
}

#[test]
fn a_bench_tells_what_an_instrument_in_operation_tells() {
    for seed in [701, 703] {
        let device = Device::random(seed);
        let survey = told(campaign(recorded(&device, seed, Bench::Hand, 1))).unwrap().report;
        let detection = survey.virtual_precession.as_ref().unwrap();
        assert!(detection.detection_known && survey.reason.is_none(), "{seed}: {detection:?}");
        let (ratio, skew) = (parameter(&survey, "detection_gain_ratio").unwrap(), parameter(&survey, "skew").unwrap());
        let phase = parameter(&survey, "phase_difference").unwrap();
        // the library's skew stands before the gain, the calibrator's behind it
        let bench = [(ratio.0 - 1.0, ratio.1), (skew.0 * ratio.0, skew.1), phase];
        for ((name, bench), flies) in ["ratio", "skew", "phase"].iter().zip(bench).zip(in_operation(&device, seed)) {
            let apart = (bench.0 - flies.0) / bench.1.hypot(flies.1);
            assert!(apart.abs() < 3.0, "{seed} {name}: {bench:?} {flies:?}");
        }
        // and both tell the device
        assert!(
            (ratio.0 - device.ratio).abs() < 1e-4 && (skew.0 - device.skew).abs() < 1e-4,
            "{seed}: {ratio:?} {skew:?}"
        );
        let drives = survey.actuation_gain_ratio.unwrap().value - device.force.0 / device.force.1;
        assert!(drives.abs() < 1e-4, "{seed}: {drives}");
    }
}

#[test]
fn a_device_that_only_rested_is_told_the_product_and_nothing_of_its_parts() {
    let device = Device { split: (0.0, 0.0), ..Device::random(702) };
    let surveyed = told(campaign(recorded(&device, 702, Bench::Rest, 1))).unwrap();
    let r = &surveyed.report;
    assert_eq!(r.status, Status::Neutral);
    assert!(r.reason.as_ref().unwrap().contains("only the product of detection and actuation"), "{:?}", r.reason);
    assert!(surveyed.calibration.is_none());
    assert!(r.detection_gain_ratio.is_none() && r.actuation_gain_ratio.is_none());
    let claimed =
        ["detection-gain-mismatch", "detection-skew", "detection-phase", "actuation-gain-mismatch", "actuation-skew"];
    assert!(!r.effects.iter().any(|e| claimed.contains(&e.id.as_str())), "{:?}", r.effects);
    let told = &r.virtual_precession.as_ref().unwrap().not_identifiable;
    assert!(told.iter().any(|n| n.separated_by.contains("turning by hand")), "{told:?}");
    let product = parameter(r, "product_ratio").unwrap().0;
    let truth = device.ratio * device.force.1 / device.force.0;
    assert!((product - truth).abs() < 1e-3, "{product} {truth}");
}

#[test]
fn what_is_damaged_is_refused() {
    let device = Device { noise: 1e-5, ..Device::random(704) };
    let sound = recorded(&device, 704, Bench::Hand, 1);
    let scaled =
        |column: &Option<Vec<f64>>, by: f64| column.as_ref().map(|v| v.iter().map(|x| x * by).collect::<Vec<f64>>());
    let mut named = vec![];
    named.push((
        "precession the other way",
        Recording { virtual_dps: scaled(&sound.virtual_dps, -1.0), ..sound.clone() },
    ));
    named.push(("energy command the other way", Recording { vas_v: scaled(&sound.vas_v, -1.0), ..sound.clone() }));
    named.push((
        "commands in millivolts",
        Recording { vas_v: scaled(&sound.vas_v, 1e3), vqc_v: scaled(&sound.vqc_v, 1e3), ..sound.clone() },
    ));
    named.push((
        "channels exchanged",
        Recording {
            xc_v: sound.yc_v.clone(),
            xs_v: sound.ys_v.clone(),
            yc_v: sound.xc_v.clone(),
            ys_v: sound.xs_v.clone(),
            ..sound.clone()
        },
    ));
    named.push((
        "nothing but noise",
        Recording { xc_v: scaled(&sound.xc_v, 0.0), yc_v: scaled(&sound.yc_v, 0.0), ..sound.clone() },
    ));
    for (what, damaged) in named {
        let refusal = told(campaign(damaged));
        assert!(refusal.is_err(), "{what}: {:?}", refusal.map(|s| s.report.virtual_precession));
    }
}

/// Ratios were 7 to 54 half widths off, and nothing was said: the command is taken for exact.
#[test]
fn a_command_of_another_size_than_is_stated_is_said_and_widens() {
    for seed in [704, 705] {
        let device = Device { noise: 1e-5, ..Device::random(seed) };
        let sound = recorded(&device, seed, Bench::Hand, 1);
        let of = |by: f64| {
            let virtual_dps = sound.virtual_dps.as_ref().map(|v| v.iter().map(|v| v * by).collect());
            told(campaign(Recording { virtual_dps, ..sound.clone() })).unwrap().report
        };
        let said = |r: &Survey| r.warnings.iter().any(|w| w.contains("a command is of another size"));
        assert!(!said(&of(1.0)), "{seed}");
        let off = of(0.95);
        assert!(said(&off), "{seed}: {:?}", off.warnings);
        let truths = [device.ratio, device.force.0 / device.force.1];
        for (told, truth) in [off.detection_gain_ratio, off.actuation_gain_ratio].into_iter().zip(truths) {
            let told = told.unwrap();
            assert!((told.value - truth).abs() < 3.0 * told.half_width(), "{seed}: {told:?} {truth}");
        }
    }
}

#[test]
fn a_gap_and_lost_cells_cost_their_rows_and_no_more() {
    let device = Device::random(705);
    let mut damaged = recorded(&device, 705, Bench::Hand, 1);
    let cut = |v: &mut Vec<f64>| drop(v.drain(100_000..130_000));
    cut(&mut damaged.t_s);
    for column in [&mut damaged.xc_v, &mut damaged.xs_v, &mut damaged.yc_v, &mut damaged.ys_v, &mut damaged.vas_v] {
        cut(column.as_mut().unwrap());
    }
    cut(damaged.vqc_v.as_mut().unwrap());
    cut(damaged.virtual_dps.as_mut().unwrap());
    damaged.vas_v.as_mut().unwrap()[40_000..40_010].fill(f64::NAN);
    let survey = told(campaign(damaged)).unwrap().report;
    let ratio = survey.detection_gain_ratio.unwrap().value;
    assert!((ratio - device.ratio).abs() < 2e-4, "{ratio} {}", device.ratio);
}

/// One row of a hundred lost, and time stamps that jitter by a fifth of an interval: the loops never noticed, and neither does the answer.
#[test]
fn rows_that_are_lost_here_and_there_and_a_clock_that_jitters_are_no_disturbance() {
    let device = Device::random(705);
    let whole = recorded(&device, 705, Bench::Hand, 1);
    let interval = whole.t_s[1] - whole.t_s[0];
    let mut jittering = whole.clone();
    jittering.t_s.iter_mut().enumerate().for_each(|(i, t)| *t += interval * 0.2 * (i as f64 * 1.7).sin());
    let mut lossy = whole;
    let kept: Vec<usize> = (0..lossy.t_s.len()).filter(|i| i * 7919 % 100 != 0).collect();
    let thin = |v: &mut Vec<f64>| *v = kept.iter().map(|&i| v[i]).collect();
    thin(&mut lossy.t_s);
    let columns = [&mut lossy.xc_v, &mut lossy.xs_v, &mut lossy.yc_v, &mut lossy.ys_v, &mut lossy.vas_v];
    for column in columns.into_iter().chain([&mut lossy.vqc_v, &mut lossy.virtual_dps]) {
        thin(column.as_mut().unwrap());
    }
    for damaged in [jittering, lossy] {
        let ratio = told(campaign(damaged)).unwrap().report.detection_gain_ratio.unwrap();
        assert!((ratio.value - device.ratio).abs() < 1.5 * ratio.half_width(), "{ratio:?} {}", device.ratio);
        assert!(ratio.half_width() < 5e-4, "{ratio:?}");
    }
}

/// The command line's way: simulated into files, read, identified, and another recording compensated with the outcome.
#[test]
fn a_simulated_bench_without_a_table_calibrates_for_the_table() {
    let mut settings = Scenario::paper().settings().clone();
    let turning = settings.runs.iter().find(|r| matches!(r, simulated::Run::Rotation { .. })).unwrap().clone();
    settings.sample_hz = 1000.0;
    settings.runs = vec![simulated::Run::Virtual {
        file: "bench.csv".into(),
        virtual_dps: 40.0,
        reversal_s: 9.0,
        duration_s: 150.0,
        turned: vec![[60.0, 60.0], [65.0, -40.0], [70.0, 0.0]],
        amplitude: 1.0,
        purpose: simulated::Purpose::Fit,
        settle_s: 2.0,
    }];
    let dir = tempfile::tempdir().unwrap();
    let scenario = Scenario::new(settings.clone()).unwrap();
    scenario.simulate().write(dir.path()).unwrap();
    let opened = Campaign::open(&dir.path().join("campaign.toml")).unwrap();
    assert_eq!((opened.drive_per_s_v, opened.control_hz), (Some(settings.drive_per_s_v), Some(settings.control_hz)));
    assert!(opened.runs[0].recording.rate_dps.is_none(), "nobody records what turned it");
    let surveyed = told(opened).unwrap();
    let ratio = surveyed.report.detection_gain_ratio.unwrap();
    assert!((ratio.value - 1.0132).abs() < 1e-3, "{ratio:?} {:?}", surveyed.report.virtual_precession);
    // a recording on a table, of the same device
    settings.sample_hz = 100.0;
    settings.runs = vec![turning];
    let table = tempfile::tempdir().unwrap();
    Scenario::new(settings).unwrap().simulate().write(table.path()).unwrap();
    let campaign = Campaign::open(&table.path().join("campaign.toml")).unwrap();
    let calibration = surveyed.calibration.unwrap();
    let raw = &campaign.runs[0].recording;
    let clean = compensate(&calibration, raw).unwrap();
    let rms = |r: &Recording| {
        let alone = Run { recording: r.clone(), ..campaign.runs[0].clone() };
        let of = Campaign { runs: vec![alone], ..campaign.clone() };
        let options = Options { discover: false, ..Options::default() };
        identify(of, &options).unwrap().report.heldout.raw.unwrap().rms_deg
    };
    let (before, after) = (rms(raw), rms(&clean));
    assert!(after < before / 20.0, "{before} {after}");
}

/// `CVG_TRIALS` devices, from `CVG_FIRST` on, a row every `CVG_EVERY` control steps: errors, and how often intervals hold.
#[test]
fn table_of_benches() {
    let Ok(count) = std::env::var("CVG_BENCHES") else { return println!("skipped: CVG_BENCHES is not set") };
    let (first, every) = (number("CVG_FIRST", 40_000), number("CVG_EVERY", 1) as usize);
    let count: u64 = count.parse().unwrap();
    let each = all(count, |n| {
        let device = Device::random(first + n);
        let outcome = told(campaign(recorded(&device, first + n, Bench::Hand, every)));
        (device, outcome.map(|s| s.report))
    });
    let answered: Vec<_> = each.iter().filter_map(|(d, r)| Some((d, r.as_ref().ok()?))).collect();
    for (n, why) in each.iter().enumerate().filter_map(|(n, (_, r))| Some((n, r.as_ref().err()?))) {
        println!("{}: {why}", first + n as u64);
    }
    println!("{} of {count} answered", answered.len());
    for (at, (name, _)) in truths(&Device::random(0)).iter().enumerate() {
        let told = answered.iter().filter_map(|(d, r)| {
            let (value, sigma) = parameter(r, name)?;
            Some((value - truths(d)[at].1, sigma))
        });
        let told: Vec<(f64, f64)> = told.collect();
        let mut errors: Vec<f64> = told.iter().map(|t| t.0.abs()).collect();
        errors.sort_by(f64::total_cmp);
        let held = told.iter().filter(|t| t.0.abs() < 1.96 * t.1).count();
        let at = |p: f64| errors.get(((errors.len().max(1) - 1) as f64 * p) as usize).copied().unwrap_or(f64::NAN);
        println!(
            "{name}: {} told, error {:.1e} median, {:.1e} at 95 %, intervals hold {held}",
            told.len(),
            at(0.5),
            at(0.95)
        );
    }
}
