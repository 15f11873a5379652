//! What is in force.

use cvg_model::Float;
use kani::Arbitrary;

use crate::complex::{Complex, Matrix};
use crate::correction::{Correction, FARTHEST};
use crate::parameters::{N, Parameter};
use crate::{Calibrator, Settings};

// Given up: the same of what `Correction::of` itself returns, one number free (106 s: its inverse of a matrix). That it asks for
// the checks below is tested for each number: calibrator/src/tests/mechanics.rs.

/// A correction of any numbers, as nobody makes one, and whether what makes one lets it into force.
fn any_correction<T: Float + Arbitrary>() -> (Correction<T>, bool) {
    let perfect = Correction::none(T::zero());
    let detection = [perfect.y_of_y.re, perfect.y_of_y.im, perfect.y_of_x.re, perfect.y_of_x.im];
    let mut numbers = [T::zero(); N + 12];
    let given = perfect.known.into_iter().chain(detection).chain(perfect.drives.numbers());
    // all of them, or one: of numbers that are drawn by chance all are hardly ever those of a device
    let (all, one): (bool, u8) = (kani::any(), kani::any());
    for ((k, slot), value) in numbers.iter_mut().enumerate().zip(given) {
        *slot = if all || k == usize::from(one) { kani::any() } else { value };
    }
    let mut next = numbers.into_iter();
    let mut number = || next.next().unwrap_or(T::zero());
    let (mut c, mut drives) = (perfect, [T::zero(); 8]);
    c.known.fill_with(&mut number);
    c.y_of_y = Complex::new(number(), number());
    c.y_of_x = Complex::new(number(), number());
    drives.fill_with(&mut number);
    c.drives = Matrix::from_numbers(&drives);
    let is_of_a_device = c.values_are_of_a_device() && c.electronics_are_of_a_device();
    (c, is_of_a_device)
}

fn every_number_in_force_is_of_a_device<T: Float + Arbitrary>(share: f64) {
    let (c, is_of_a_device) = any_correction::<T>();
    kani::cover!(!is_of_a_device, "refused");
    if is_of_a_device {
        kani::cover!(c.drives.yx.im < T::zero(), "a phase below none");
        let within = |v: T, reach: f64| v.magnitude() <= T::from_f64(reach * share);
        let near = |z: Complex<T>, re: T, reach: f64| within(z.re - re, reach) && within(z.im, reach);
        let (zero, one) = (T::zero(), T::one());
        let of_a_device = |(v, p): (&T, &Parameter)| v.magnitude() <= p.expected::<T>() * T::from_f64(FARTHEST * share);
        assert!(c.known.iter().zip(&Parameter::ALL).all(of_a_device));
        assert!(near(c.y_of_y, one, 0.36) && near(c.y_of_x, zero, 0.12));
        assert!(near(c.drives.xx, one, 0.5) && near(c.drives.yy, one, 0.5));
        assert!(near(c.drives.xy, zero, 0.2) && near(c.drives.yx, zero, 0.2));
    }
}

//= specs/self-calibration.md#bounded
//# Every value in force MUST be finite and one that a device can have for every input.
/// What both ways into force ask, [`Correction::of`] and [`Move::advance`](crate::correction::Move::advance), is that each of all
/// 31 numbers lies within what a device can have: whatever their bits, all of them at once.
#[kani::proof]
#[kani::unwind(40)]
#[kani::solver(minisat)]
pub fn proof_every_number_in_force_is_of_a_device_f32() {
    every_number_in_force_is_of_a_device::<f32>(1.0);
}

/// Half of that is claimed.
#[kani::proof]
#[kani::unwind(40)]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_every_number_in_force_is_of_a_device_f32() {
    every_number_in_force_is_of_a_device::<f32>(0.5);
}

fn the_precession_is_bounded<T: Float + Arbitrary>(share: f64) {
    // precondition: a configuration that `new` accepts
    let Ok(calibrator) = Calibrator::<T>::new(&Settings::default()) else {
        kani::assume(false);
        unreachable!()
    };
    let asked = calibrator.profile(kani::any(), kani::any(), kani::any(), kani::any());
    kani::cover!(asked < T::zero(), "to");
    kani::cover!(asked > T::zero(), "and fro");
    assert!(asked.magnitude() <= T::from_f64(Settings::default().precession_rad_s * share));
}

//= specs/self-calibration.md#bounded
//# Every value in force MUST be finite and one that a device can have for every input.
/// The precession that [`Calibrator::profile`] asks for is within what the settings allow, whatever the stage and the time.
#[kani::proof]
pub fn proof_the_precession_is_bounded_f32() {
    the_precession_is_bounded::<f32>(1.0);
}

/// Half of that is claimed.
#[kani::proof]
#[kani::should_panic]
pub fn twin_the_precession_is_bounded_f32() {
    the_precession_is_bounded::<f32>(0.5);
}
