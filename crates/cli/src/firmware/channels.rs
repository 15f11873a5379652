//! The correction of two channels: a C header, or a table of the angle alone at the calibrated amplitude.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use cvg_calibration::calibration::Calibration;
use cvg_calibration::{ChannelClip, Hypothesis, Member};
use cvg_model::Envelope;
use cvg_model::effects::{EffectId, Inverse, Moment, Values};

use super::{Form, angle_table, closed, float, is_left_out, periods, preamble, rows};
use crate::Failure;

/// Halvings of the search for a radius.
const HALVINGS: usize = 80;
/// A radius is looked for up to so many calibrated amplitudes.
const FURTHEST: f64 = 8.0;

/// The correction as text.
pub(super) fn text(
    calibration: &Calibration,
    left_out: &[String],
    form: Form,
    points: usize,
) -> Result<String, Failure> {
    let steps = steps(&calibration.hypothesis)?;
    match form {
        Form::Csv => lookup(calibration, points),
        Form::C => Ok(header(calibration, &steps, left_out, points)),
        Form::Rust => Err(Failure::input(
            "of two channels there is a C header (.h) and a table (.csv); in Rust the readout is \
             `cvg_estimator::Compensation`, and what the table adds the table's",
        )),
    }
}

/// What becomes of an effect.
#[derive(Debug, PartialEq)]
enum Kind {
    Affine,
    /// ¾κ of x and of y
    Cubic([f64; 2]),
    LeftOut,
    Refused,
}

fn kind(m: &Member) -> Kind {
    let id = m.id;
    match id.inverse(&m.values) {
        Inverse::Affine => Kind::Affine,
        Inverse::Cubic(cubic) => Kind::Cubic(cubic.coefficients()),
        Inverse::Unread if is_left_out(m) => Kind::LeftOut,
        Inverse::Unread => Kind::Refused,
    }
}

/// One step from readings to the vibration or the field behind them.
enum Step {
    /// x' = a x + b y + c, y' = d x + e y + f
    Affine([f64; 6]),
    /// ¾κ of x and of y
    Cubic([f64; 2]),
}

/// The readout's effects undone, last first; what is linear one after the other is one matrix.
fn steps(h: &Hypothesis) -> Result<Vec<Step>, Failure> {
    let mut out: Vec<Step> = Vec::new();
    for m in h.members.iter().rev() {
        match kind(m) {
            Kind::LeftOut => {}
            Kind::Refused => {
                let id = m.id.description().id;
                return Err(Failure::input(format!(
                    "{id}: has no form in this header; wanted offset, gain, skew and cubic"
                )));
            }
            Kind::Cubic(coefficients) => out.push(Step::Cubic(coefficients)),
            Kind::Affine => {
                let next = matrix(m.id, &m.values);
                match out.last_mut() {
                    Some(Step::Affine(before)) => *before = after(next, *before),
                    _ => out.push(Step::Affine(next)),
                }
            }
        }
    }
    Ok(out)
}

/// What an affine effect does, from where it takes three points.
fn matrix(id: EffectId, values: &Values<f64>) -> [f64; 6] {
    let at = |x: f64, y: f64| {
        let z = id.unread(values, Envelope::new(x, 0.0, y, 0.0), &Moment::default());
        [z.x_c, z.y_c]
    };
    let (o, x, y) = (at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0));
    [x[0] - o[0], y[0] - o[0], o[0], x[1] - o[1], y[1] - o[1], o[1]]
}

/// One affine map after another.
fn after(n: [f64; 6], b: [f64; 6]) -> [f64; 6] {
    [
        n[0] * b[0] + n[1] * b[3],
        n[0] * b[1] + n[1] * b[4],
        n[0] * b[2] + n[1] * b[5] + n[2],
        n[3] * b[0] + n[4] * b[3],
        n[3] * b[1] + n[4] * b[4],
        n[3] * b[2] + n[4] * b[5] + n[5],
    ]
}

fn header(calibration: &Calibration, steps: &[Step], left_out: &[String], points: usize) -> String {
    let h = &calibration.hypothesis;
    let mut s = String::new();
    let mut line = |text: &str| {
        let _ = writeln!(s, "{text}");
    };
    let mut how = vec![
        String::new(),
        "    float angle_deg = cvg_compensate(x, y);".into(),
        String::new(),
        "x and y are the readings of the two channels in the unit in which they were calibrated; the angle is the sensor's own,".into(),
        format!("{}. Nothing is kept between calls.", periods(calibration)),
    ];
    if let Some([low, high]) = calibration.provenance.amplitude_v {
        how.push(format!("Calibrated at amplitudes from {low:.6} to {high:.6}; beyond them it is extrapolated."));
    }
    let head = preamble(calibration, "C99; needs atan2f and fmodf.", &how, left_out, "two readings do");
    line(&format!("/* {}", head[0]));
    head[1..].iter().for_each(|text| line(format!(" * {text}").trim_end()));
    line(" */\n#ifndef CVG_CORRECTION_H\n#define CVG_CORRECTION_H\n#include <math.h>\n");
    if steps.iter().any(|step| matches!(step, Step::Cubic(_))) {
        line(ROOT);
    }
    let table = angle_table(h, points);
    if let Some((table, worst)) = &table {
        line(&format!(
            "/* Degrees to add, at {} even angles of a period; straight lines between them are within {worst:.1e} degrees. */",
            table.len()
        ));
        line(&format!("static const float cvg_table[{}] = {{", table.len() + 1));
        rows(&closed(table), float).iter().for_each(|row| line(row));
        line("};\n");
    }
    line("static inline float cvg_compensate(float x, float y)\n{");
    body(&mut line, h, steps, table.as_ref().map(|(t, _)| t.len()));
    line("}\n\n#endif");
    s
}

/// The root u of k u³ + u = 1.
const ROOT: &str = "\
static inline float cvg_root(float k)
{
    float u = (1.0f + 2.0f * k) / (1.0f + 3.0f * k);
    for (int i = 0; i < 2; i++) {
        const float slope = 3.0f * k * u * u + 1.0f, rest = k * u * u * u + u - 1.0f;
        u -= rest * slope / (slope * slope - 3.0f * k * u * rest);
    }
    return u;
}
";

fn body(line: &mut dyn FnMut(&str), h: &Hypothesis, steps: &[Step], points: Option<usize>) {
    if let Some(clip) = h.clip {
        for (name, _) in ["x", "y"].iter().zip(clip.rails_v).filter(|(_, rails)| rails.iter().any(|v| v.is_finite())) {
            line(&format!("    const float {name}_read = {name};"));
        }
    }
    for step in steps {
        match step {
            Step::Affine([a, b, c, d, e, f]) => {
                let [a, b, c, d, e, f] = [a, b, c, d, e, f].map(|v| float(*v));
                line(&format!("    {{\n        const float u = {a} * x + {b} * y + {c};"));
                line(&format!("        y = {d} * x + {e} * y + {f};\n        x = u;\n    }}"));
            }
            Step::Cubic([k_x, k_y]) => {
                line(&format!(
                    "    x *= cvg_root({} * x * x);\n    y *= cvg_root({} * y * y);",
                    float(*k_x),
                    float(*k_y)
                ));
            }
        }
    }
    if let Some(clip) = h.clip {
        rails(line, &clip);
    }
    let period = float(h.period_rad.to_degrees());
    line("    float angle = 57.2957795f * atan2f(y, x);");
    line(&format!("    angle = fmodf(angle + 360.0f, {period});"));
    if let Some(points) = points {
        line(&format!(
            "    {{\n        const float at = angle * {};",
            float(points as f64 / h.period_rad.to_degrees())
        ));
        line(&format!("        const int i = at >= 0.0f && at < {points}.0f ? (int)at : {};", points - 1));
        line("        angle += cvg_table[i] + (at - (float)i) * (cvg_table[i + 1] - cvg_table[i]);\n    }");
        line(&format!("    angle = fmodf(angle + {period}, {period});"));
    }
    line("    return angle;");
}

/// A channel at its rail is told by the other.
fn rails(line: &mut dyn FnMut(&str), clip: &ChannelClip) {
    let reached = |name: &str, [low, high]: [f64; 2]| {
        let sides = [(low, "<="), (high, ">=")].into_iter().filter(|(v, _)| v.is_finite());
        let told: Vec<String> = sides.map(|(v, sign)| format!("{name} {sign} {}", float(v))).collect();
        if told.is_empty() { "0".to_owned() } else { told.join(" || ") }
    };
    let square = float(clip.amplitude_v.powi(2));
    line(&format!(
        "    const int x_out = {}, y_out = {};",
        reached("x_read", clip.rails_v[0]),
        reached("y_read", clip.rails_v[1])
    ));
    for (own, other) in [("x", "y"), ("y", "x")] {
        line(&format!("    if ({own}_out && !{other}_out) {{"));
        line(&format!(
            "        const float rest = {square} - {other} * {other}, root = rest > 0.0f ? sqrtf(rest) : 0.0f;"
        ));
        line(&format!("        {own} = copysignf(fmaxf(root, fabsf({own})), {own});\n    }}"));
    }
}

/// A table of the angle alone: what is read as atan2(y, x), and what is to be added, at the calibrated amplitude.
fn lookup(calibration: &Calibration, points: usize) -> Result<String, Failure> {
    let h = &calibration.hypothesis;
    let Some([low, high]) = calibration.provenance.amplitude_v else {
        return Err(Failure::input(
            "the calibration says no amplitude: a table of the angle holds at one; wanted a .h file",
        ));
    };
    let middle = (low * high).sqrt();
    let mut fixed = h.clone();
    fixed.members.retain(|m| kind(m) != Kind::LeftOut);
    let unread = |r: f64, theta: f64| {
        let z = fixed.unread(Envelope::new(r * theta.cos(), 0.0, r * theta.sin(), 0.0), &Moment::default());
        (z.x_c.hypot(z.y_c), z.y_c.atan2(z.x_c))
    };
    // the reading, along one direction, of a vibration of this amplitude
    let reading = |amplitude: f64, theta: f64| halved(0.0, FURTHEST * middle, |r| unread(r, theta).0 < amplitude);
    if unread(0.0, 0.0).0 >= middle {
        return Err(Failure::input(
            "the offsets exceed the amplitude, so that atan2(y, x) does not turn: wanted a .h file, which takes both readings",
        ));
    }
    let directions = || (0..points).map(|i| i as f64 * TAU / points as f64);
    let amplitude = halved(0.0, FURTHEST * middle, |a| {
        let mut readings: Vec<f64> = directions().map(|theta| reading(a, theta)).collect();
        readings.sort_by(f64::total_cmp);
        readings[points / 2] < middle
    });
    let mut s = format!(
        "# atan2(y, x) and what is to be added to it, deg, at the calibrated amplitude {middle:.6}\nangle_deg,add_deg\n"
    );
    for theta in directions() {
        let (_, angle) = unread(reading(amplitude, theta), theta);
        let add = (angle - theta + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
        let _ = writeln!(s, "{},{:.6}", theta.to_degrees(), add.to_degrees());
    }
    Ok(s)
}

/// Where `below` turns false.
fn halved(mut low: f64, mut high: f64, below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}
