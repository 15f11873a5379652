//! Records the loop on the host in `f32`, from rest into whole-angle mode and through a few faults: what the converters
//! read, and what the instrument answers, as the words that a Cortex-M is to reproduce.
//!
//! `cvg-firmware-host FOLDER` writes one file for each recording: the number of samples, then five words a sample.

#[path = "../../src/scenario.rs"]
mod scenario;

use cvg_instrument::{Instrument, Mode};
use cvg_simulator::carrier::{CarrierDevice, CarrierLoop};

/// Samples a recording, at 100 kHz.
const SAMPLES: usize = 160_000;

fn device(recording: usize) -> CarrierDevice {
    let mut d = CarrierDevice::default();
    d.resonator.anisodamping = cvg_model::resonator::Anisotropy::new(4.7e-3, 27_f64.to_radians());
    d.resonator.anisoelasticity = cvg_model::resonator::Anisotropy::new(0.25, 55_f64.to_radians());
    if recording > 0 {
        d.readout_gain = [1.0, scenario::READOUT[0].1[0]];
        d.gap = 1.0 / scenario::READOUT[1].1[0].sqrt();
        d.drive_per_s_v = [scenario::ACTUATION[0].1[0], 1.0];
    }
    d
}

/// What happens to the readings at a sample.
fn disturbed(sample: usize, [x, y]: [f32; 2]) -> [f32; 2] {
    match sample {
        130_017 => [f32::NAN, y],
        135_000..=135_400 => [x, f32::INFINITY],
        145_000..=145_050 => [3.0 * x, 3.0 * y],
        _ => [x, y],
    }
}

fn record(recording: usize) -> Result<Vec<u32>, Box<dyn std::error::Error>> {
    let settings = scenario::settings(recording);
    let mut plant = CarrierLoop::<f32>::new(&device(recording), &settings)?;
    plant.plant.set_rate(300_f64.to_radians());
    // the same electronics once more, of which the answers are taken before the converters round them
    let instrument = Instrument::<f32>::new(&settings)?;
    let mut state = instrument.start();
    let mut words = vec![u32::try_from(SAMPLES)?];
    let mut running = 0;
    for sample in 0..SAMPLES {
        let mut read = [0.0; 2];
        plant.step_through(|v| {
            read = disturbed(sample, v);
            read
        });
        let (x, y, status) = instrument.step(&mut state, read[0], read[1]);
        words.extend([read[0], read[1], x, y].map(f32::to_bits));
        words.push(scenario::word(&status));
        running += usize::from(status.mode == Mode::WholeAngle);
    }
    if state.supervisor.mode != Mode::WholeAngle || running < SAMPLES / 4 {
        return Err(format!("{} samples in whole-angle mode, at the end {:?}", running, state.supervisor.mode).into());
    }
    println!("{}: {SAMPLES} samples, {running} of them in whole-angle mode", scenario::RECORDINGS[recording]);
    Ok(words)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1).ok_or("a folder is needed")?;
    for (k, name) in scenario::RECORDINGS.iter().enumerate() {
        let bytes: Vec<u8> = record(k)?.iter().flat_map(|w| w.to_le_bytes()).collect();
        std::fs::write(std::path::Path::new(&folder).join(format!("{name}.bin")), bytes)?;
    }
    Ok(())
}
