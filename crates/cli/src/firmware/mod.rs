//! `cvg firmware`: the correction of an angle sensor for a controller without the crates. Of two channels a C header with
//! `cvg_compensate(x, y)`, of an angle one with `cvg_compensate(theta)`, in C or in Rust; or a table of the angle alone. Of a whole-angle
//! gyroscope the effects that the settings of its electronics take.

mod angle;
mod channels;
mod gyroscope;

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::Instrument;
use cvg_calibration::{Hypothesis, Member};
use cvg_model::effects::{Inverse, Stage};

use crate::report::WHOLE_TURN_RAD;
use crate::{Failure, input, output};

/// Points of a period at which a table is checked, for each of its own.
const CHECKED: usize = 16;
/// Points of a table where nobody says how many.
const POINTS: usize = 256;

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// a header
    C,
    /// a module
    Rust,
    /// a table
    Csv,
}

impl Form {
    /// The form that the name of a file asks for.
    fn of(file: &Path) -> Result<Self, Failure> {
        let is = |name: &str| file.extension().is_some_and(|e| e.eq_ignore_ascii_case(name));
        match () {
            () if is("csv") => Ok(Self::Csv),
            () if is("rs") => Ok(Self::Rust),
            () if is("h") || is("hpp") => Ok(Self::C),
            () => Err(Failure::input(format!("--out {}: wanted a name that ends in .h, .rs or .csv", file.display()))),
        }
    }
}

/// Writes the header, the module where the name ends in `.rs`, or the table where it ends in `.csv`.
pub(crate) fn firmware(calibration_file: &Path, out: &Path, points: Option<usize>) -> Result<(), Failure> {
    let calibration_file = &input::calibration(calibration_file);
    let inputs: [PathBuf; 1] = [calibration_file.clone()];
    output::check_file(out, &inputs)?;
    let form = Form::of(out)?;
    if let Some(points) = points.filter(|points| !(8..=65_536).contains(points)) {
        return Err(Failure::input(format!("--points {points}: wanted 8 to 65536")));
    }
    let calibration = Calibration::read(calibration_file)?;
    let h = &calibration.hypothesis;
    if h.instrument != Instrument::Sensor && h.period_rad > WHOLE_TURN_RAD {
        return Err(Failure::input(format!("{}: {}", calibration_file.display(), of_a_rate_gyroscope(h))));
    }
    if h.instrument != Instrument::Sensor {
        if let Some(points) = points {
            let what = "is of a table, and the settings of a gyroscope's electronics have none";
            return Err(Failure::input(format!("--points {points}: {what}")));
        }
        let left_out: Vec<String> = gyroscope::left_out(&calibration).into_iter().map(with_values).collect();
        let text = gyroscope::text(&calibration, &left_out, form)?;
        if !left_out.is_empty() {
            output::tell(format_args!("not in it: {}, which no sample alone tells", left_out.join(", ")));
        }
        output::write(out, text.as_bytes(), &inputs)?;
        output::tell(format_args!("wrote {}", out.display()));
        return Ok(());
    }
    let left_out: Vec<String> = h.members.iter().filter(|m| is_left_out(m)).map(with_values).collect();
    let of_an_angle = is_of_an_angle(&calibration);
    if !left_out.is_empty() {
        output::tell(format_args!(
            "not in it: {}, which {} alone {} not tell: it follows the table, the clock, the rate or the temperature",
            left_out.join(", "),
            if of_an_angle { "the angle" } else { "two readings" },
            if of_an_angle { "does" } else { "do" },
        ));
    }
    let text = if of_an_angle {
        if h.angle_table.is_none() {
            output::tell(format_args!("nothing was found to be corrected: the angle is given as it is read"));
        }
        angle::text(&calibration, &left_out, form, points)
    } else {
        channels::text(&calibration, &left_out, form, points.unwrap_or(POINTS))?
    };
    output::write(out, text.as_bytes(), &inputs)?;
    output::tell(format_args!("wrote {}", out.display()));
    Ok(())
}

/// The calibration is of a sensor of which an angle was read, and no channels.
fn is_of_an_angle(calibration: &Calibration) -> bool {
    let h = &calibration.hypothesis;
    calibration.provenance.amplitude_v.is_none() && h.clip.is_none() && h.members.iter().all(is_left_out)
}

/// Why there is no header of a rate gyroscope, and what there is.
fn of_a_rate_gyroscope(h: &Hypothesis) -> String {
    let of_the_temperature = h.reference_c.filter(|_| h.rate_bias_per_k_rad_s != 0.0).map_or_else(String::new, |at| {
        format!(" and {:.9} deg/s more for every kelvin beyond {at:.3} °C", h.rate_bias_per_k_rad_s.to_degrees())
    });
    format!(
        "the calibration of a rate gyroscope is two numbers: take its bias, {:.9} deg/s{of_the_temperature}, from each rate, and \
         divide by its scale factor, {:.9}",
        h.rate_bias_rad_s.to_degrees(),
        h.angular_gain.abs()
    )
}

/// An effect that what is read at one moment does not tell.
fn is_left_out(m: &Member) -> bool {
    let id = m.id;
    matches!(id.inverse(&m.values), Inverse::Unread)
        && (id.description().stage != Stage::Readout || id.acts_on_angle() || id.in_time() || id.by_temperature())
}

/// The range of the angle, and how many periods it has.
fn periods(calibration: &Calibration) -> String {
    let h = &calibration.hypothesis;
    let range = format!("from 0 up to {:.0} degrees", h.period_rad.to_degrees());
    if calibration.provenance.gain_unknown {
        return range;
    }
    let count = h.angular_gain.abs();
    format!("{range}, {count} {} a turn of the reference", if count == 1.0 { "period" } else { "periods" })
}

/// An effect by its name, with its values.
fn with_values(m: &Member) -> String {
    let parameters = m.id.description().parameters.iter().zip(m.values);
    let values: Vec<String> = parameters.map(|(p, v)| format!("{} {v:.6} {}", p.name, p.unit)).collect();
    format!("{} ({})", m.id.description().id, values.join(", "))
}

/// What stands above a correction: whose it is, how it is called, what is not in it and what it was made from.
fn preamble(calibration: &Calibration, needs: &str, how: &[String], left_out: &[String], told_by: &str) -> Vec<String> {
    let mut lines = vec![format!(
        "Correction of the sensor {}, written by cvg {}. {needs}",
        one_line(&calibration.device),
        env!("CARGO_PKG_VERSION")
    )];
    lines.extend_from_slice(how);
    if !left_out.is_empty() {
        lines.push(format!("Not in it, since {told_by} not tell it: {}.", left_out.join(", ")));
    }
    if let Some(c) = calibration.hypothesis.reference_c.filter(|_| !left_out.is_empty()) {
        lines.push(format!("What goes with the temperature is as at {c} degrees Celsius."));
    }
    for i in &calibration.provenance.inputs {
        lines.push(format!("From {}, CRC-32 {}.", one_line(&i.file), i.crc32.as_deref().unwrap_or("unknown")));
    }
    lines
}

/// A word out of a file that ends no comment, of C or of Rust.
fn one_line(text: &str) -> String {
    output::plain(text).replace("*/", "* /").replace(['\n', '\r'], " ")
}

/// A number as C reads it in single precision, with all the digits that has.
fn float(value: f64) -> String {
    format!("{value:.9e}f")
}

/// What the table adds to an angle, deg, at even angles of a period, and how far straight lines between them are off.
fn angle_table(h: &Hypothesis, points: usize) -> Option<(Vec<f64>, f64)> {
    let table = h.angle_table.as_ref()?;
    let (cycles, step) = (TAU / h.period_rad, h.period_rad / points as f64);
    let add = |theta: f64| (table.undo(theta, cycles) - theta).to_degrees();
    let values: Vec<f64> = (0..points).map(|i| add(i as f64 * step)).collect();
    let off = |i: usize| {
        let (at, part) = (i / CHECKED, (i % CHECKED) as f64 / CHECKED as f64);
        let (low, high) = (values[at], values[(at + 1) % points]);
        (low + part * (high - low) - add((at as f64 + part) * step)).abs()
    };
    let worst = (0..CHECKED * points).map(off).fold(0.0, f64::max);
    Some((values, worst))
}

/// Numbers of an array, six a line; the separator of the language stands behind each.
fn rows(values: &[f64], number: impl Fn(f64) -> String) -> Vec<String> {
    let line = |row: &[f64]| format!("    {},", row.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", "));
    values.chunks(6).map(line).collect()
}

/// The values of a period and the first of the next.
fn closed(table: &[f64]) -> Vec<f64> {
    table.iter().chain(table.first()).copied().collect()
}
