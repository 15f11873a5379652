//! Lives on the host, in `f32`, what the calibrator is to live on the target: its checksum after every second.
//!
//! `calibrator FILE`

#[path = "../../../src/calibration.rs"]
mod calibration;

use calibration::{Life, Meter, PER_S, Part, SECONDS};
use cvg_calibrator::Settings;

struct Nothing;

impl Meter for Nothing {
    fn count<R>(&mut self, _: Part, f: impl FnOnce() -> R) -> R {
        f()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args_os().nth(1).ok_or("a file is needed")?;
    let settings = Settings::default();
    let mut life = Life::<f32>::new(&settings)?;
    let mut bytes = Vec::new();
    for _ in 0..SECONDS {
        for _ in 0..PER_S {
            assert!(life.slice(&settings) < u32::from(settings.steps));
            life.step(&mut Nothing);
        }
        bytes.extend(life.checksum.to_le_bytes());
    }
    let off = life.ratio() - 0.03;
    println!("calibrator: {SECONDS} s, the ratio within {:.1} ppm", off * 1e6);
    if off.abs() > 1e-3 {
        return Err("nothing was learned".into());
    }
    Ok(std::fs::write(file, bytes)?)
}
