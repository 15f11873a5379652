//! For firmware engineers: the whole electronics as one call a sample, in `f32`, as an interrupt would make it.
//!
//! `cargo run -p cvg-examples --bin converter_loop`

use cvg_instrument::{ConfigError, Instrument, Settings};

fn main() -> Result<(), ConfigError> {
    let settings = Settings { carrier_hz: 15_200.0, sample_hz: 100_000.0, ..Settings::default() };
    let instrument = Instrument::<f32>::new(&settings)?;
    let mut state = instrument.start();
    let mut most = 0.0f32;
    for sample in 0..100_000u32 {
        // in the place of a converter: a resonator that rings along X
        let phase = 0.152 * f64::from(sample) * std::f64::consts::TAU;
        #[allow(clippy::cast_possible_truncation, reason = "what a converter reads is f32")]
        let adc_x = (0.5 * phase.cos()) as f32;
        let (dac_x, dac_y, status) = instrument.step(&mut state, adc_x, 0.0);
        most = most.max(dac_x.abs()).max(dac_y.abs());
        if status.fault.is_some() {
            break;
        }
    }
    println!("{:?}, {:.3} deg, at most {most:.3} V", state.status.mode, state.angle_deg());
    Ok(())
}
