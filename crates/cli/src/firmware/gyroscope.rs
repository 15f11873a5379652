//! Of a whole-angle gyroscope: the effects that its electronics undo, as the settings of `cvg.h` and of `cvg-instrument` take them.

use std::fmt::Write as _;

use cvg_calibration::Member;
use cvg_calibration::calibration::Calibration;
use cvg_model::effects::{EffectId, Stage};

use super::{Form, one_line};
use crate::Failure;

/// What electronics undo of one stage: what the readings and commands of the moment tell, of the library that they are built with.
fn undone(calibration: &Calibration, stage: Stage) -> Vec<&Member> {
    let members = calibration.hypothesis.members.iter().filter(|m| m.id.description().stage == stage);
    let of_the_library = |m: &&Member| EffectId::from_id(m.id.description().id) == Some(m.id);
    members.filter(of_the_library).filter(|m| !(m.id.in_time() || m.id.by_temperature())).collect()
}

/// The effects of a calibration that are not in its settings: those of the mechanics, of the table, of the time or the temperature.
pub(super) fn left_out(calibration: &Calibration) -> Vec<&Member> {
    let both = [Stage::Readout, Stage::Actuation].map(|stage| undone(calibration, stage));
    calibration.hypothesis.members.iter().filter(|m| !both.iter().flatten().any(|u| u.id == m.id)).collect()
}

/// The settings, in C or in Rust.
///
/// # Errors
/// Where a table is asked for.
pub(super) fn text(calibration: &Calibration, left_out: &[String], form: Form) -> Result<String, Failure> {
    let [readout, actuation] = [Stage::Readout, Stage::Actuation].map(|stage| undone(calibration, stage));
    let mut lines = vec![format!(
        "What the electronics of {} undo, written by cvg {}.",
        one_line(&calibration.device),
        env!("CARGO_PKG_VERSION")
    )];
    if !left_out.is_empty() {
        lines.push(format!("Not in it, since no sample alone tells it: {}.", left_out.join(", ")));
    }
    if let Some([low, high]) = calibration.provenance.amplitude_v {
        lines.push(format!("Calibrated at amplitudes from {low:.6} to {high:.6} V; beyond them it is extrapolated."));
    }
    for i in &calibration.provenance.inputs {
        lines.push(format!("From {}, CRC-32 {}.", one_line(&i.file), i.crc32.as_deref().unwrap_or("unknown")));
    }
    match form {
        Form::C => Ok(header(&lines, &readout, &actuation)),
        Form::Rust => Ok(module(&lines, &readout, &actuation)),
        Form::Csv => Err(Failure::input(
            "a table is of an angle sensor's own angle; wanted a name that ends in .h or .rs".to_owned(),
        )),
    }
}

/// The values of an effect, and zeros where it has fewer.
fn values(m: &Member) -> String {
    m.values.iter().map(|v| format!("{v:e}")).collect::<Vec<_>>().join(", ")
}

fn header(lines: &[String], readout: &[&Member], actuation: &[&Member]) -> String {
    let mut s = format!(
        "/*\n * {}\n */\n#ifndef CVG_DEVICE_H\n#define CVG_DEVICE_H\n\n#include \"cvg.h\"\n\n",
        lines.join("\n * ")
    );
    let mut taken = String::new();
    for (name, members) in [("readout", readout), ("actuation", actuation)] {
        if members.is_empty() {
            let _ = writeln!(taken, "    settings->{name} = 0;\n    settings->{name}_count = 0;");
            continue;
        }
        let _ = writeln!(s, "static const cvg_effect cvg_device_{name}[] = {{");
        for m in members {
            let _ = writeln!(s, "    {{\"{}\", {{{}}}}},", m.id.description().id, values(m));
        }
        let _ = writeln!(s, "}};\n");
        let count = format!("sizeof cvg_device_{name} / sizeof cvg_device_{name}[0]");
        let _ = writeln!(taken, "    settings->{name} = cvg_device_{name};\n    settings->{name}_count = {count};");
    }
    let _ = write!(
        s,
        "/* Has an instrument undo what was identified: after cvg_settings_default, before cvg_init, which refuses more than\n * \
         CVG_MOST_COMPENSATED of either. */\nstatic inline void cvg_device_undo(cvg_settings *settings) {{\n{taken}}}\n\n#endif\n"
    );
    s
}

fn module(lines: &[String], readout: &[&Member], actuation: &[&Member]) -> String {
    let mut s = format!("//! {}\n\nuse cvg_model::effects::{{EffectId, Values}};\n", lines.join("\n//! "));
    for (name, what, members) in [("READOUT", "readout", readout), ("ACTUATION", "actuation", actuation)] {
        let _ = writeln!(s, "\n/// Effects of the {what}: `Settings::{what}`.");
        let _ = writeln!(s, "pub const {name}: [(EffectId, Values<f64>); {}] = [", members.len());
        for m in members {
            let _ = writeln!(s, "    (EffectId::{:?}, [{}]),", m.id, values(m));
        }
        s.push_str("];\n");
    }
    s
}
