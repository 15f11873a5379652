//! Which bytes an answer rests on: the checksums of the files that were read.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::numerics::statistics::median;
use crate::recording::{Campaign, Instrument, Recording, RunKind};
use crate::report::{EffectReport, Input};

/// Bytes that are read at once.
const PIECE: usize = 1 << 16;

/// Rows that a median amplitude is taken of.
const ENOUGH_ROWS: usize = 10_000;

/// A file and what the campaign calls it.
#[derive(Debug, Clone)]
pub(crate) struct Named {
    path: PathBuf,
    name: String,
}

/// The files of a campaign, each once, in the order in which the campaign names them.
pub(crate) fn files(campaign: &Campaign) -> Vec<Named> {
    let mut files: Vec<&Path> = Vec::new();
    for file in std::iter::once(campaign.source.as_path())
        .chain(campaign.runs.iter().map(|run| run.recording.source.as_path()))
        .filter(|file| !file.as_os_str().is_empty())
    {
        if !files.contains(&file) {
            files.push(file);
        }
    }
    let in_memory = |file: &Path| campaign.runs.iter().any(|r| r.recording.in_memory && r.recording.source == file);
    // a file that happens to have the name of what was never one is not what was read
    let path = |file: &Path| if in_memory(file) { PathBuf::new() } else { file.to_owned() };
    files.into_iter().map(|file| Named { path: path(file), name: name(file, campaign) }).collect()
}

/// The checksums of files.
pub(crate) fn sums(files: &[Named]) -> Vec<Input> {
    files.iter().map(|f| Input { file: f.name.clone(), crc32: crc32(&f.path) }).collect()
}

/// Smallest and largest amplitude of the readout in the runs that turn, as the medians of runs.
pub(crate) fn amplitudes(campaign: &Campaign) -> Option<[f64; 2]> {
    let turning = campaign.runs.iter().filter(|r| r.kind == RunKind::Rotation);
    let medians: Vec<f64> = turning.filter_map(|r| amplitude(&r.recording)).collect();
    let (low, high) = medians.iter().fold((f64::INFINITY, 0.0f64), |(l, h), &m| (l.min(m), h.max(m)));
    (high > 0.0).then_some([low, high])
}

/// Median amplitude of a readout, √(x_c² + x_s² + y_c² + y_s²), in its unit.
pub(crate) fn amplitude(recording: &Recording) -> Option<f64> {
    let (x, y) = (recording.xc_v.as_ref()?, recording.yc_v.as_ref()?);
    let part = |v: &Option<Vec<f64>>, i: usize| v.as_ref().map_or(0.0, |v| v[i]);
    let stride = (x.len() / ENOUGH_ROWS).max(1);
    let rows = (0..x.len()).step_by(stride);
    let of = |i: usize| x[i].hypot(y[i]).hypot(part(&recording.xs_v, i).hypot(part(&recording.ys_v, i)));
    Some(median(&mut rows.map(of).collect::<Vec<_>>()))
}

/// A readout of whole numbers up to this and more is of a converter's counts.
const COUNTS: f64 = 64.0;

/// The unit of a sensor's channels, where it is not of volts: what its files state, or counts, where every reading is a whole
/// number.
pub(crate) fn readout_unit(campaign: &Campaign) -> Option<String> {
    if campaign.instrument != Instrument::Sensor {
        return None;
    }
    let stated = campaign.runs.first()?.recording.readout_unit.clone();
    stated.or_else(|| {
        let channels = || campaign.runs.iter().flat_map(|r| [&r.recording.xc_v, &r.recording.yc_v]).flatten().flatten();
        let largest = channels().fold(0.0f64, |l, v| l.max(v.abs()));
        (largest >= COUNTS && channels().all(|v| v.fract() == 0.0)).then(|| "counts".to_owned())
    })
}

/// Says the parameters of effects in the unit of the channels.
pub(crate) fn in_unit(effects: &mut [EffectReport], unit: Option<&str>) {
    let Some(unit) = unit else { return };
    for p in effects.iter_mut().flat_map(|e| &mut e.parameters) {
        p.unit = p.unit.replace('V', unit);
    }
}

/// A file as the campaign names it, so that a report does not depend on where the campaign lies.
fn name(file: &Path, campaign: &Campaign) -> String {
    let run = campaign.runs.iter().find(|run| run.recording.source == file);
    let named = run.map_or_else(|| file.file_name().map_or(file, Path::new), |run| run.file.as_path());
    named.display().to_string()
}

/// CRC-32 of a regular file's bytes; `None` of what is not there a second time, as standard input.
fn crc32(file: &Path) -> Option<String> {
    if !file.metadata().ok()?.is_file() {
        return None;
    }
    let mut bytes = File::open(file).ok()?;
    let (mut sum, mut piece) = (crc32fast::Hasher::new(), vec![0; PIECE]);
    loop {
        match bytes.read(&mut piece).ok()? {
            0 => return Some(format!("{:08x}", sum.finalize())),
            n => sum.update(&piece[..n]),
        }
    }
}
