//! Any bytes as an effect file: read or refused, never a panic; what is read comes back as it is written, and what is
//! admitted answers whatever it is asked.

use cvg_calibration::EffectText;
use cvg_model::effects::Moment;
use cvg_model::{AxisForces, Envelope};

const NUMBERS: [f64; 6] = [0.7, 0.0, -1e300, f64::MIN_POSITIVE, f64::INFINITY, f64::NAN];

pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(read) = EffectText::parse(text, "fuzz.toml") else { return };
    let again = EffectText::parse(&read.to_text(), "again.toml").expect("what was written is read");
    assert_eq!(again.to_text(), read.to_text());
    let Ok(effect) = read.effect("fuzz.toml") else { return };
    for (i, a) in NUMBERS.into_iter().enumerate() {
        let b = NUMBERS[(i + 1) % NUMBERS.len()];
        let (p, e) = ([b, a, 1.0, 0.0], Envelope::new(a, b, 0.5, -a));
        let at = Moment {
            t_s: a,
            table_rad: b,
            precession_rad_s: a,
            warmer_k: b,
            drive: AxisForces { x_c: b, x_s: a, y_c: a, y_s: b },
        };
        let forces = effect.actuate(&p, AxisForces { x_c: a, x_s: b, y_c: a, y_s: b }, &at);
        std::hint::black_box((
            effect.read(&p, e, &at),
            effect.unread(&p, e, &at),
            effect.mechanics(&p, &e, &at),
            forces,
        ));
        std::hint::black_box(effect.input_rate(&p, a, &at));
    }
}
