//! The mechanics term by term: what a unit of each coordinate is pulled by, and how an envelope moves.

use cvg_model::Envelope;
use cvg_model::resonator::carrier::{Motion, Rotation};
use cvg_model::resonator::envelope::precession;
use cvg_model::resonator::{Anisotropy, Resonator};

#[test]
fn a_turning_base_weakens_the_springs_and_couples_the_axes() {
    let resonator = Resonator {
        omega_rad_s: 8.0,
        angular_gain: 0.75,
        centrifugal_gain: 0.5,
        damping_per_s: 0.25,
        anisodamping: Anisotropy { cos2: 0.5, sin2: 0.25 },
        anisoelasticity: Anisotropy { cos2: 0.125, sin2: 0.0625 },
    };
    let rest = Motion { x: 0.0, y: 0.0, x_dot: 0.0, y_dot: 0.0 };
    let turning = Rotation { rate_rad_s: 2.0, acceleration_rad_s2: 4.0 };
    let pulled = |m: &Motion<f64>| {
        let a = resonator.acceleration(m, &turning, 0.0, 0.0);
        (a.x_dot, a.y_dot)
    };
    // 8² − ½·2² = 62 along each axis, kΩ̇ = 3 across, and ωΔω = (1, ½)
    assert_eq!(pulled(&Motion { x: 1.0, ..rest }), (-62.0 + 1.0, -3.0 + 0.5));
    assert_eq!(pulled(&Motion { y: 1.0, ..rest }), (3.0 + 0.5, -62.0 - 1.0));
    // 2kΩ = 3 across, 2/τ = ½ along the velocity, and Δ(1/τ) = (½, ¼)
    assert_eq!(pulled(&Motion { x_dot: 1.0, ..rest }), (-0.5 - 0.5, -3.0 - 0.25));
    assert_eq!(pulled(&Motion { y_dot: 1.0, ..rest }), (3.0 - 0.25, -0.5 + 0.5));
    // the forces add to it, and the velocities are the rates of the coordinates
    let a = resonator.acceleration(&Motion { x_dot: 0.5, y_dot: 0.25, ..rest }, &turning, 10.0, 20.0);
    assert_eq!((a.x, a.y), (0.5, 0.25));
    assert_eq!((a.x_dot, a.y_dot), (10.0 - 0.5 + 0.6875, 20.0 - 1.625));
}

#[test]
fn a_mode_ahead_of_the_reference_gains_phase_and_its_pattern_stays() {
    let none = Anisotropy { cos2: 0.0, sin2: 0.0 };
    let resonator = Resonator {
        omega_rad_s: 8.0,
        angular_gain: 0.75,
        centrifugal_gain: 0.5,
        damping_per_s: 0.0,
        anisodamping: none,
        anisoelasticity: none,
    };
    // X = 1 and Y = −2i: half a radian per second turns them to i/2 and 1
    let e = Envelope::new(1.0, 0.0, 0.0, 2.0);
    assert_eq!(resonator.envelope_rate(&e, 0.0, 0.5), Envelope::new(0.0, -0.5, 1.0, 0.0));
    // and Ω = 4 rad/s precesses at −kΩ = −3 rad/s
    assert_eq!(e.precession(&resonator.envelope_rate(&e, 4.0, 0.0)), -3.0);
    assert_eq!(e.precession(&precession(0.3, &e)), 0.3);
}
