//! The correction of an angle: the series that was found, evaluated, or a table of it joined by straight lines; in C or in Rust.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use cvg_calibration::calibration::Calibration;
use cvg_calibration::{AngleTable, Form as Written, Hypothesis};

use super::{Form, POINTS, angle_table, closed, float, periods, preamble, rows};

/// Angles of a period at which the steps of an inverse are counted; and what a step less may be off by, rad: a tenth of what an
/// angle of 360° has in single precision.
const LOOKED_AT: usize = 720;
const SETTLED: f64 = 5e-8;
/// Steps at most: as many as `AngleTable::undo` takes.
const MOST_STEPS: usize = 8;

/// The correction as text.
pub(super) fn text(calibration: &Calibration, left_out: &[String], form: Form, points: Option<usize>) -> String {
    let h = &calibration.hypothesis;
    if form == Form::Csv {
        return csv(h, points.unwrap_or(POINTS));
    }
    let body = match (&h.angle_table, points) {
        (None, _) => Body::AsRead,
        (Some(table), None) => Body::Series { table, steps: steps(table, h) },
        (Some(_), Some(points)) => {
            angle_table(h, points).map_or(Body::AsRead, |(table, off)| Body::Table { table, off })
        }
    };
    let sin_cos = matches!(body, Body::Series { .. });
    let call = match (form, sin_cos) {
        (Form::Rust, true) => "    let angle_deg = cvg_compensate(theta_deg, f32::sin_cos);",
        (Form::Rust, false) => "    let angle_deg = cvg_compensate(theta_deg);",
        _ => "    float angle_deg = cvg_compensate(theta_deg);",
    };
    let mut how = vec![
        String::new(),
        call.to_owned(),
        String::new(),
        format!(
            "theta_deg is the angle that the sensor gives, in degrees and of any turn; the answer is {}. Nothing is kept between calls.",
            periods(calibration)
        ),
    ];
    if form == Form::Rust && sin_cos {
        how.push("Without the standard library sine and cosine are `libm::sincosf`, or the controller's own.".into());
    }
    how.push(match &body {
        Body::AsRead => "Nothing was found to be corrected.".into(),
        Body::Series { table, .. } => format!(
            "A Fourier series of {} harmonics, in the {} angle.",
            table.cos.len(),
            if table.form == Written::Own { "sensor's own" } else { "true" }
        ),
        Body::Table { table, off } => format!(
            "Degrees to add at {} even angles of a period; straight lines between them are within {off:.1e} degrees.",
            table.len()
        ),
    });
    let needs = match (form, sin_cos) {
        (Form::Rust, _) => "Rust, with or without its standard library.",
        (_, true) => "C99; needs fmodf, sinf and cosf.",
        (_, false) => "C99; needs fmodf.",
    };
    let head = preamble(calibration, needs, &how, left_out, "the angle alone does");
    if form == Form::Rust { rust(&head, &body, h) } else { c(&head, &body, h) }
}

/// What the correction is made of.
enum Body<'a> {
    AsRead,
    Series {
        table: &'a AngleTable,
        /// Newton steps of the inverse; 0 of a series in the sensor's own angle
        steps: usize,
    },
    Table {
        table: Vec<f64>,
        off: f64,
    },
}

/// So many steps the inverse of a series takes at any angle.
fn steps(table: &AngleTable, h: &Hypothesis) -> usize {
    if table.form == Written::Own {
        return 0;
    }
    let cycles = TAU / h.period_rad;
    let off = |steps: usize, theta: f64| {
        let mut angle = theta - table.at(theta, cycles).0;
        for _ in 0..steps {
            let (value, slope) = table.at(angle, cycles);
            angle -= (angle + value - theta) / (1.0 + slope);
        }
        (angle - table.undo(theta, cycles)).abs()
    };
    let settled =
        |steps: &usize| (0..LOOKED_AT).all(|i| off(*steps, i as f64 * h.period_rad / LOOKED_AT as f64) < SETTLED);
    (1..MOST_STEPS).find(settled).unwrap_or(MOST_STEPS)
}

fn degrees(values: &[f64]) -> Vec<f64> {
    values.iter().map(|v| v.to_degrees()).collect()
}

fn c(head: &[String], body: &Body<'_>, h: &Hypothesis) -> String {
    let period = float(h.period_rad.to_degrees());
    let mut s = String::new();
    let mut line = |text: &str| {
        let _ = writeln!(s, "{text}");
    };
    line(&format!("/* {}", head[0]));
    head[1..].iter().for_each(|text| line(format!(" * {text}").trim_end()));
    line(" */\n#ifndef CVG_CORRECTION_H\n#define CVG_CORRECTION_H\n#include <math.h>\n");
    let mut array = |name: &str, values: &[f64]| {
        line(&format!("static const float {name}[{}] = {{", values.len()));
        rows(values, float).iter().for_each(|row| line(row));
        line("};\n");
    };
    match body {
        Body::AsRead => {}
        Body::Series { table, .. } => {
            array("cvg_cos", &degrees(&table.cos));
            array("cvg_sin", &degrees(&table.sin));
            line("/* Degrees by which the sensor is off, and their slope. */");
            line("static inline float cvg_error(float angle, float *slope)\n{");
            line(&format!(
                "    const float x = {} * angle, c1 = cosf(x), s1 = sinf(x);",
                float(TAU / h.period_rad.to_degrees())
            ));
            line("    float c = 1.0f, s = 0.0f, value = 0.0f, sum = 0.0f;");
            line(&format!("    for (int n = 0; n < {}; n++) {{", table.cos.len()));
            line("        const float turned = s * c1 + c * s1;\n        c = c * c1 - s * s1;\n        s = turned;");
            line("        value += cvg_cos[n] * c + cvg_sin[n] * s;");
            line("        sum += (float)(n + 1) * (cvg_sin[n] * c - cvg_cos[n] * s);\n    }");
            line(&format!("    *slope = {} * sum;", float(TAU / h.period_rad.to_degrees())));
            line("    return value;\n}\n");
        }
        Body::Table { table, .. } => array("cvg_table", &closed(table)),
    }
    line("static inline float cvg_compensate(float theta_deg)\n{");
    line(&format!("    const float theta = fmodf(fmodf(theta_deg, {period}) + {period}, {period});"));
    match body {
        Body::AsRead => line("    return theta;\n}\n\n#endif"),
        Body::Series { steps, .. } => {
            line("    float slope, angle = theta - cvg_error(theta, &slope);");
            if *steps > 0 {
                line(&format!("    for (int i = 0; i < {steps}; i++) {{"));
                line("        const float value = cvg_error(angle, &slope);");
                line("        angle -= (angle + value - theta) / (1.0f + slope);\n    }");
            }
        }
        Body::Table { table, .. } => {
            let n = table.len();
            line(&format!("    const float at = theta * {};", float(n as f64 / h.period_rad.to_degrees())));
            line(&format!("    const int i = at < {n}.0f ? (int)at : {};", n - 1));
            line("    const float angle = theta + cvg_table[i] + (at - (float)i) * (cvg_table[i + 1] - cvg_table[i]);");
        }
    }
    if !matches!(body, Body::AsRead) {
        line(&format!("    return fmodf(angle + {period}, {period});\n}}\n\n#endif"));
    }
    s
}

/// A number as Rust reads it in single precision.
fn number(value: f64) -> String {
    format!("{value:.9e}")
}

fn rust(head: &[String], body: &Body<'_>, h: &Hypothesis) -> String {
    let mut s = String::new();
    let mut line = |text: &str| {
        let _ = writeln!(s, "{text}");
    };
    head.iter().for_each(|text| line(format!("//! {text}").trim_end()));
    line("#![allow(clippy::all, clippy::pedantic)]\n");
    line(&format!("const PERIOD_DEG: f32 = {};\n", number(h.period_rad.to_degrees())));
    let mut array = |name: &str, values: &[f64]| {
        line(&format!("const {name}: [f32; {}] = [", values.len()));
        rows(values, number).iter().for_each(|row| line(row));
        line("];\n");
    };
    let argument = match body {
        Body::AsRead => "",
        Body::Series { table, .. } => {
            array("COS_DEG", &degrees(&table.cos));
            array("SIN_DEG", &degrees(&table.sin));
            line("/// Degrees by which the sensor is off, and their slope.");
            line("fn error(angle: f32, sin_cos: &impl Fn(f32) -> (f32, f32)) -> (f32, f32) {");
            line("    const RAD: f32 = 6.283_185_5 / PERIOD_DEG;\n    let (s1, c1) = sin_cos(RAD * angle);");
            line("    let (mut s, mut c, mut value, mut slope, mut n) = (0.0, 1.0, 0.0, 0.0, 0.0);");
            line("    for (of_cos, of_sin) in COS_DEG.iter().zip(&SIN_DEG) {");
            line("        (s, c) = (s * c1 + c * s1, c * c1 - s * s1);\n        n += 1.0;");
            line("        value += of_cos * c + of_sin * s;\n        slope += n * (of_sin * c - of_cos * s);\n    }");
            line("    (value, RAD * slope)\n}\n");
            ", sin_cos: impl Fn(f32) -> (f32, f32)"
        }
        Body::Table { table, .. } => {
            array("ADD_DEG", &closed(table));
            ""
        }
    };
    line("/// The corrected angle, in degrees.\n#[must_use]");
    line(&format!("pub fn cvg_compensate(theta_deg: f32{argument}) -> f32 {{"));
    line("    let theta = (theta_deg % PERIOD_DEG + PERIOD_DEG) % PERIOD_DEG;");
    match body {
        Body::AsRead => line("    theta\n}"),
        Body::Series { steps, .. } => {
            let mutable = if *steps > 0 { "mut " } else { "" };
            line(&format!("    let {mutable}angle = theta - error(theta, &sin_cos).0;"));
            if *steps > 0 {
                line(&format!("    for _ in 0..{steps} {{"));
                line("        let (value, slope) = error(angle, &sin_cos);");
                line("        angle -= (angle + value - theta) / (1.0 + slope);\n    }");
            }
        }
        Body::Table { table, .. } => {
            line(&format!("    let at = theta * ({}.0 / PERIOD_DEG);", table.len()));
            line(&format!("    let i = (at as usize).min({});", table.len() - 1));
            line("    let angle = theta + ADD_DEG[i] + (at - i as f32) * (ADD_DEG[i + 1] - ADD_DEG[i]);");
        }
    }
    if !matches!(body, Body::AsRead) {
        line("    (angle + PERIOD_DEG) % PERIOD_DEG\n}");
    }
    s
}

/// A table of the angle that the sensor gives, and what is to be added to it.
fn csv(h: &Hypothesis, points: usize) -> String {
    let (table, off) = angle_table(h, points).unwrap_or((vec![0.0; points], 0.0));
    let mut s = format!(
        "# the angle that the sensor gives and what is to be added to it, deg; straight lines between the rows are within {off:.1e} deg\n\
         angle_deg,add_deg\n"
    );
    for (i, add) in table.iter().enumerate() {
        let _ = writeln!(s, "{},{add:.6}", i as f64 * h.period_rad.to_degrees() / points as f64);
    }
    s
}
