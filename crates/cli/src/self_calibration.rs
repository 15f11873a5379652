//! `cvg demo --self-calibration`: the paper's device learns its own electronics in operation, without a table.

use std::fmt::Write as _;
use std::path::Path;

use cvg_calibrator::{Parameter, Settings};
use cvg_simulator::learning::angle_bias_rad;
use cvg_simulator::{ClosedLoop, Learner, Scenario};

use crate::figure::{BLUE, Series, VERMILLION, plot};
use crate::{Failure, output};

/// Seconds of the life, and between two rows of its table.
const LIFE_S: u32 = 600;
const ROW_S: u32 = 10;
/// Rate at which the bias is measured, deg/s, and for how long, s.
const MEASURED_DPS: f64 = 500.0;
const MEASURED_S: f64 = 4.0;
/// Rate of the earth, deg/s.
const EARTH_DPS: f64 = 15.0 / 3600.0;

/// A row of the table.
struct Row {
    second: u32,
    doing: &'static str,
    bias_deg: f64,
    ratio: f64,
    sigma: f64,
    known: bool,
}

/// Runs the demonstration into `out`.
pub(crate) fn demo(out: &Path) -> Result<(), Failure> {
    output::check_folder(out)?;
    output::tell(format_args!("ten minutes of the paper's device that calibrates itself"));
    let scenario = Scenario::paper();
    let s = scenario.settings();
    let settings = Settings {
        control_s: 1.0 / s.control_hz,
        amplitude_v: s.amplitude_v,
        drive_per_s: s.drive_per_s_v,
        // as designed: a tenth off
        damping_per_s: 1.1 / s.tau_s,
        ..Settings::default()
    };
    let learner = Learner::new(&settings).map_err(Failure::input)?;
    let closed = scenario.closed_loop(0).ok_or_else(|| Failure::input("the paper's device is a gyroscope"))?;
    let (before, rows) = live(closed.with(learner), settings.control_s);
    let set = output::Set::begin(out, &[])?;
    set.add("self-calibration.csv", table(&rows).as_bytes())?;
    set.add("self-calibration.svg", figure(before, &rows)?.as_bytes())?;
    set.commit()?;
    output::answer(&said(before, &rows))?;
    output::tell(format_args!("wrote {}", out.join("self-calibration.svg").display()));
    Ok(())
}

/// What the device goes through at a second: what it is, and the rate, deg/s.
fn moment(second: u32) -> (&'static str, f64) {
    match second {
        300..305 => ("turned by hand", 60.0),
        305..310 => ("turned by hand", -40.0),
        0..400 => ("at rest", EARTH_DPS),
        _ => {
            // another rate every three seconds, up to 300 deg/s either way
            let n = f64::from(second / 3);
            ("turning", 300.0 * (2.399_963 * n).sin())
        }
    }
}

/// The bias before, deg, and the table.
fn live(mut closed: ClosedLoop, control_s: f64) -> (f64, Vec<Row>) {
    let bias =
        |closed: &ClosedLoop| angle_bias_rad(closed, MEASURED_DPS.to_radians(), MEASURED_S, control_s).to_degrees();
    let before = bias(&closed);
    let mut rows = Vec::new();
    let mut rate = f64::NAN;
    for second in 0..LIFE_S {
        let (doing, dps) = moment(second);
        if dps != rate {
            rate = dps;
            closed.turn_at(dps.to_radians());
        }
        for _ in 0..(1.0 / control_s).round() as u32 {
            closed.step();
        }
        if (second + 1) % ROW_S == 0
            && let Some(learner) = closed.learner()
        {
            let believed = learner.state().estimate(Parameter::DetectionRatio);
            let (ratio, sigma) = believed.map_or((f64::NAN, f64::NAN), |e| (e.value, e.sigma));
            let known = learner.calibrator().status(learner.state()).detection_known;
            rows.push(Row { second: second + 1, doing, bias_deg: bias(&closed), ratio, sigma, known });
        }
    }
    (before, rows)
}

fn table(rows: &[Row]) -> String {
    let mut text = "t_s,doing,bias_deg,detection_ratio,sigma,known\n".to_owned();
    for r in rows {
        // writing to a string does not fail
        let _ = writeln!(
            text,
            "{},{},{:.6},{:.6},{:.6},{}",
            r.second,
            r.doing,
            r.bias_deg,
            1.0 + r.ratio,
            r.sigma,
            r.known
        );
    }
    text
}

/// The error over time, as a logarithm: it falls by a thousand.
fn figure(before: f64, rows: &[Row]) -> Result<String, Failure> {
    let mut points = vec![(0.0, before.log10())];
    points.extend(rows.iter().map(|r| (f64::from(r.second), r.bias_deg.log10())));
    let raw = vec![(0.0, before.log10()), (f64::from(LIFE_S), before.log10())];
    plot(
        "time, s",
        "log10 of the bias at 500 deg/s, deg",
        &[
            Series { name: "uncompensated", colour: VERMILLION, points: raw, joined: true },
            Series { name: "as learned by then", colour: BLUE, points, joined: true },
        ],
    )
}

fn said(before: f64, rows: &[Row]) -> String {
    let mut s = format!("\n  {:<10}{:<18}{:<22}detection ratio\n", "until, s", "", "bias at 500 deg/s");
    let _ = writeln!(s, "  {:<10}{:<18}{:<22}", 0, "uncompensated", format!("{:.2} mdeg", before * 1e3));
    for r in rows.iter().filter(|r| matches!(r.second, 20 | 60 | 300 | 310 | 320 | 400 | 420 | 500 | LIFE_S)) {
        let ratio = if r.known { format!("{:.5} ± {:.5}", 1.0 + r.ratio, 1.96 * r.sigma) } else { "not known".into() };
        let _ = writeln!(s, "  {:<10}{:<18}{:<22}{ratio}", r.second, r.doing, format!("{:.2} mdeg", r.bias_deg * 1e3));
    }
    if let Some(last) = rows.last() {
        let _ = writeln!(s, "  the bias is {:.0} times smaller; no table, no recording", before / last.bias_deg);
    }
    s
}
