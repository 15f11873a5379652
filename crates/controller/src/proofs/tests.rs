//! That what the constructors accept is what the proofs assume: a configuration that is accepted and not assumed would be one
//! of which nothing is proved.

use cvg_model::Float;

use super::pi::assumed;
use crate::Pi;

fn controllers_are_assumed<T: Float>() {
    // next to nothing, the least and the largest numbers of both precisions, and none
    let values = [0.0, 5e-324, 1e-45, 1e-38, 1e-3, 1.0, 1e3, 1.8e38, 3.4e38, 1e308, f64::INFINITY, f64::NAN, -1.0];
    let values = values.map(T::from_f64);
    let mut accepted = 0;
    for gain in values {
        for time in values {
            for period in values {
                for limit in values {
                    let Ok(built) = Pi::new(gain, time, period, limit) else { continue };
                    assert!(assumed(&built), "{:?}", [gain, time, period, limit].map(T::to_f64));
                    accepted += 1;
                }
            }
        }
    }
    assert!(accepted > 50, "{accepted}");
}

#[test]
fn the_proofs_are_about_every_controller_that_is_accepted() {
    controllers_are_assumed::<f32>();
    controllers_are_assumed::<f64>();
}
