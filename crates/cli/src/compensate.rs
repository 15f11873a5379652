//! `cvg compensate`: recordings with the identified errors taken out.

use std::path::{Path, PathBuf};

use cvg_calibration::calibration::Calibration;
use cvg_calibration::recording::Naming;

use crate::{Failure, input, output};

/// Compensates recordings: one into a file, several into a folder.
pub(crate) fn compensate(
    calibration_file: &Path,
    recordings: &[PathBuf],
    out: &Path,
    device: Option<&str>,
    naming: &Naming,
) -> Result<(), Failure> {
    let files = input::files(recordings)?;
    let is_toml = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    if let Some(last) =
        files.iter().find(|file| is_toml(file) && !is_toml(calibration_file) && !calibration_file.is_dir())
    {
        let what = "stands in the place of the calibration, which comes first";
        return Err(Failure::input(format!(
            "{}: {what}: cvg compensate {} {}",
            calibration_file.display(),
            last.display(),
            calibration_file.display()
        )));
    }
    let calibration_file = &input::calibration(calibration_file);
    let mut inputs = vec![calibration_file.to_owned()];
    inputs.extend(files.iter().cloned());
    let targets = targets(&files, out)?;
    for target in &targets {
        output::check_file(target, &inputs)?;
        if !is_table(target) {
            let what = format!("--out {}: wanted a name that ends in .csv or .parquet", target.display());
            return Err(Failure::input(what));
        }
    }
    let calibration = Calibration::read(calibration_file)?;
    if let Some(campaign) = files.iter().find(|file| is_toml(file)) {
        let what = "is a campaign; wanted its recordings, one after the other, with what its [columns] say by --map";
        return Err(Failure::input(format!("{}: {what}", campaign.display())));
    }
    if let Some(device) = device.filter(|d| *d != calibration.device) {
        return Err(Failure::input(format!(
            "--device {device}: {} is the calibration of {}",
            calibration_file.display(),
            calibration.device
        )));
    }
    let left_out: Vec<String> = cvg_calibration::left_out(&calibration).iter().map(ToString::to_string).collect();
    if !left_out.is_empty() {
        output::tell(format_args!(
            "not undone: {}, which belongs to the table or to the hours of the calibrated recordings",
            left_out.join(", ")
        ));
    }
    for (file, target) in files.iter().zip(&targets) {
        one(&calibration, file, target, &inputs, naming)?;
    }
    Ok(())
}

/// A name of what is written here.
fn is_table(file: &Path) -> bool {
    file.extension().is_some_and(|e| ["csv", "parquet"].iter().any(|name| e.eq_ignore_ascii_case(name)))
}

/// Where each recording goes.
fn targets(files: &[PathBuf], out: &Path) -> Result<Vec<PathBuf>, Failure> {
    if let [_] = files {
        return Ok(vec![out.to_owned()]);
    }
    if is_table(out) && !out.is_dir() {
        let what = format!("{}: {} recordings do not go into one file; wanted a folder", out.display(), files.len());
        return Err(Failure::input(what));
    }
    let named: Vec<PathBuf> = files
        .iter()
        .map(|file| {
            let name = file.file_name().filter(|_| file.as_os_str() != "-");
            let name = name.ok_or_else(|| Failure::input(format!("{}: has no name to keep", file.display())))?;
            let name = Path::new(name);
            let packed = name.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
            let name = Path::new(name.file_stem().filter(|_| packed).unwrap_or(name.as_os_str()));
            let tabular = name.extension().is_some_and(|e| e.eq_ignore_ascii_case("parquet"));
            Ok(out.join(if tabular { name.to_owned() } else { name.with_extension("csv") }))
        })
        .collect::<Result<_, Failure>>()?;
    match (1..named.len()).find(|&i| named[..i].contains(&named[i])) {
        Some(twice) => Err(Failure::input(format!("{}: two recordings would go there", named[twice].display()))),
        None => Ok(named),
    }
}

fn one(calibration: &Calibration, file: &Path, out: &Path, inputs: &[PathBuf], naming: &Naming) -> Result<(), Failure> {
    let recording = input::recording(file, naming)?;
    for w in &recording.warnings {
        output::tell(format_args!("warning: {w}"));
    }
    if let Some(outside) = cvg_calibration::outside(calibration, &recording) {
        output::tell(format_args!("warning: {}: {outside}", file.display()));
    }
    let compensated = cvg_calibration::compensate(calibration, &recording)?;
    for w in compensated.warnings.iter().skip(recording.warnings.len()) {
        output::tell(format_args!("warning: {w}"));
    }
    let mut bytes = Vec::new();
    if out.extension().is_some_and(|e| e.eq_ignore_ascii_case("parquet")) {
        compensated.write_parquet(&mut bytes)
    } else {
        compensated.write_csv(&mut bytes)
    }
    .map_err(|e| Failure::input(format!("{}: {e}", out.display())))?;
    output::write(out, &bytes, inputs)?;
    output::tell(format_args!("wrote {}", out.display()));
    Ok(())
}
