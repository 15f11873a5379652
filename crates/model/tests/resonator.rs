//! The equation of motion term by term: what a unit of each coordinate is pulled by.

use cvg_model::resonator::carrier::{Motion, Rotation};
use cvg_model::resonator::{Anisotropy, Resonator};

#[test]
fn a_turning_base_weakens_the_springs_and_couples_the_axes() {
    let none = Anisotropy { cos2: 0.0, sin2: 0.0 };
    let resonator = Resonator {
        omega_rad_s: 8.0,
        angular_gain: 0.75,
        centrifugal_gain: 0.5,
        damping_per_s: 0.25,
        anisodamping: none,
        anisoelasticity: none,
    };
    let rest = Motion { x: 0.0, y: 0.0, x_dot: 0.0, y_dot: 0.0 };
    let turning = Rotation { rate_rad_s: 2.0, acceleration_rad_s2: 4.0 };
    let pulled = |m: &Motion<f64>| {
        let a = resonator.acceleration(m, &turning, 0.0, 0.0);
        (a.x_dot, a.y_dot)
    };
    // 8² − ½·2² = 62 along each axis, and kΩ̇ = 3 across
    assert_eq!(pulled(&Motion { x: 1.0, ..rest }), (-62.0, -3.0));
    assert_eq!(pulled(&Motion { y: 1.0, ..rest }), (3.0, -62.0));
    // 2kΩ = 3 across and 2/τ = ½ along the velocity
    assert_eq!(pulled(&Motion { x_dot: 1.0, ..rest }), (-0.5, -3.0));
    assert_eq!(pulled(&Motion { y_dot: 1.0, ..rest }), (3.0, -0.5));
}
