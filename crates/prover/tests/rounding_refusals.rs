//! What would pass for a bound if the rounding engine let it: turns that are lost, branches that the machine takes and
//! real numbers do not, bounds of nothing. Each is refused, beside its neighbour that is right and is shown.

use std::f64::consts::{PI, TAU};

use cvg_model::detection::measured_angle;
use cvg_model::{Float, Real};
use cvg_prover::{Bounded, Failure, Formula, Interval, Rounded, bound_rounding};

/// A formula of two inputs, with the turns after which its results repeat.
struct Of<F>(F, f64);

/// What the formulas below are made of: a function of any scalar.
trait Function {
    fn of<T: Real>(&self, x: T, y: T) -> Vec<T>;
}

impl<F: Function> Formula for Of<F> {
    fn outputs<T: Real>(&self, inputs: &[T]) -> Vec<T> {
        self.0.of(inputs[0], inputs[1])
    }

    fn period_turns(&self) -> f64 {
        self.1
    }
}

macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident: |$x:ident, $y:ident| $body:expr;)+) => {$(
        $(#[$doc])*
        struct $name;
        impl Function for $name {
            #[allow(unused_variables, reason = "some need one input")]
            fn of<T: Real>(&self, $x: T, $y: T) -> Vec<T> {
                $body
            }
        }
    )+};
}

/// Exactly 0 for real numbers, a rounding error of either sign for the machine.
fn nothing<T: Real>(x: T, y: T) -> T {
    ((x + y) - x) - y
}

functions! {
    /// ½ atan2 at the cut: a quarter turn, forward or back as the rounding falls.
    HalfAtTheCut: |x, y| vec![T::half() * nothing(x, y).atan2(-T::one())];
    /// Its sine: 1 or −1.
    SineOfHalf: |x, y| vec![(T::half() * nothing(x, y).atan2(-T::one())).sin_cos().0];
    /// Its root after a shift that keeps it positive for real numbers.
    RootOfShifted: |x, y| vec![(nothing(x, y).atan2(-T::one()) + T::ratio(4, 1)).sqrt()];
    /// Its square, by a product of two.
    SquareOfHalf: |x, y| { let a = T::half() * nothing(x, y).atan2(-T::one()); vec![a * (a + T::one())] };
    /// A quarter of it, over a half.
    QuotientOfHalf: |x, y| vec![nothing(x, y).atan2(-T::one()) / T::ratio(3, 1)];
    /// Which side of the cut it is on.
    SideOfTheCut: |x, y| vec![if nothing(x, y).atan2(-T::one()) > T::zero() { T::one() } else { -T::one() }];
    /// The arctangent of an arctangent.
    AngleOfAngle: |x, y| vec![nothing(x, y).atan2(-T::one()).atan2(T::one())];
    /// The sine of the whole angle, and of the angle beyond another: a turn changes neither.
    SineOfWhole: |x, y| { let a = nothing(x, y).atan2(-T::one()); vec![a.sin_cos().0, (x - a).sin_cos().1] };
    /// ½ atan2 of the inputs themselves.
    HalfAngle: |x, y| vec![T::half() * x.atan2(y)];
    /// 1 but where x² is as small as the machine's rounding.
    Threshold: |x, y| vec![if x * x <= T::epsilon() { T::zero() } else { T::one() }];
    /// The machine's spacing as a number.
    Spacing: |x, y| vec![x + T::epsilon() * T::ratio(1000, 1)];
    /// Equation 7, but 0 for the smallest angles.
    FlatNearZero: |x, y| vec![if y * y <= T::ratio(12, 1) * T::epsilon() { T::zero() } else { measured_angle(x, y) }];
    /// No result.
    Silent: |x, y| vec![];
    /// Results on a part of the box only.
    HalfSilent: |x, y| if x < y { vec![x] } else { vec![] };
}

fn positive() -> Vec<Vec<Interval>> {
    vec![vec![Interval::new(0.5, 1.0); 2]]
}

fn bound(f: impl Function, period: f64, boxes: &[Vec<Interval>], tolerance: f64) -> Result<Bounded, Failure> {
    bound_rounding::<f32>(&Of(f, period), boxes, tolerance, 1.0)
}

/// How far the machine is from `real` at most, over many inputs.
fn worst(f: &impl Function, real: f64) -> f64 {
    let inputs = |n: u16| [0.237_1, 0.391_7].map(|by| 0.5 + 0.5 * (f32::from(n) * by).fract());
    (0..2000_u16).map(inputs).fold(0.0, |most, [x, y]| most.max((f64::from(f.of(x, y)[0]) - real).abs()))
}

#[test]
fn half_an_angle_at_the_cut_is_not_bounded() {
    assert!(worst(&HalfAtTheCut, PI / 2.0) > 3.0, "the machine is half a turn off");
    let result = bound(HalfAtTheCut, 0.0, &positive(), 2e-6);
    assert!(result.is_err(), "{result:?}");
    // a period that it does not have does not help
    assert!(bound(HalfAtTheCut, 1.0, &positive(), 2e-6).is_err());
    // as the angle of a pattern, which is the same after half a turn, it is right
    bound(HalfAtTheCut, 0.5, &positive(), 2e-6).expect("half a turn is none");
}

#[test]
fn what_is_made_of_an_angle_at_the_cut_is_not_bounded() {
    assert!(worst(&SineOfHalf, 1.0) > 1.9, "the machine has the wrong sign");
    let results = [
        bound(SineOfHalf, 0.0, &positive(), 2e-6),
        bound(SineOfHalf, 0.5, &positive(), 1.5),
        bound(RootOfShifted, 0.0, &positive(), 2e-6),
        bound(SquareOfHalf, 0.5, &positive(), 2e-6),
        bound(QuotientOfHalf, 0.0, &positive(), 2e-6),
        bound(QuotientOfHalf, 0.5, &positive(), 2e-6),
        bound(SideOfTheCut, 0.0, &positive(), 1.5),
        bound(AngleOfAngle, 0.0, &positive(), 2e-6),
    ];
    for (n, result) in results.iter().enumerate() {
        assert!(result.is_err(), "{n}: {result:?}");
    }
    bound(SineOfWhole, 0.0, &positive(), 4e-6).expect("a turn changes no sine");
}

/// An input of 0 may be the machine's −0, whose arctangent lies at the other end.
#[test]
fn an_input_of_zero_may_be_minus_zero() {
    let boxes = [vec![Interval::new(-1.0, 1.0), Interval::new(-1.0, -0.5)]];
    assert!(HalfAngle.of(-0.0_f32, -1.0)[0] < -1.5, "the machine's result");
    assert!(bound(HalfAngle, 0.0, &boxes, 2e-6).is_err());
    bound(HalfAngle, 0.5, &boxes, 2e-6).expect("up to half a turn");
}

#[test]
fn turns_are_kept_by_sums_signs_and_powers_of_two_and_settled_by_the_rest() {
    let angle = Rounded::<f64>::input(Interval::new(-1e-3, 1e-3)).atan2(Rounded::input(Interval::point(-1.0)));
    let (two, three, shift) = (Real::two(), Real::ratio(3, 1), Rounded::input(Interval::new(0.1, 0.2)));
    assert_eq!(angle.turns, 1.0);
    assert_eq!([(-angle).turns, (angle + shift).turns, (shift - angle).turns], [1.0; 3]);
    assert_eq!([(angle * two).turns, (angle / two).turns, (two * angle).turns], [2.0, 0.5, 2.0]);
    for settled in
        [angle * three, angle / three, angle * angle, shift / (angle + three + three), (angle + three + three).sqrt()]
    {
        assert_eq!(settled.turns, 0.0);
        assert!(settled.error > 0.1, "{settled:?}");
    }
    assert!((angle * three).error >= 3.0 * TAU);
    let both = angle + angle;
    assert!(both.turns == 1.0 && both.error >= TAU, "{both:?}");
}

#[test]
fn a_branch_on_the_machines_rounding_is_not_taken_for_that_of_real_numbers() {
    let near = [vec![Interval::new(2e-4, 1.0), Interval::point(0.0)]];
    assert_eq!(Threshold.of(2.5e-4_f32, 0.0), [0.0], "the machine's branch");
    assert!(bound(Threshold, 0.0, &near, 1e-6).is_err());
    let far = [vec![Interval::new(1e-3, 1.0), Interval::point(0.0)]];
    bound(Threshold, 0.0, &far, 1e-6).expect("both take the same branch");
    let result = bound(FlatNearZero, 1.0, &[vec![Interval::new(0.9, 1.1), Interval::new(-1e-3, 1e-3)]], 1e-6);
    assert!(matches!(result, Err(Failure::Refuted { .. })), "{result:?}");
    bound(FlatNearZero, 1.0, &[vec![Interval::new(0.9, 1.1), Interval::new(2e-3, 1.0)]], 1e-6).expect("beyond it");
}

#[test]
fn the_machines_spacing_counts_as_an_error() {
    let result = bound(Spacing, 0.0, &positive(), 1e-6);
    assert!(matches!(result, Err(Failure::Refuted { .. })), "{result:?}");
    bound(Spacing, 0.0, &positive(), 1.3e-4).expect("a thousand spacings, and their rounding");
}

#[test]
fn a_bound_of_nothing_is_refused() {
    let nothing = |result| matches!(result, Err(Failure::Nothing { .. }));
    assert!(nothing(bound(Silent, 0.0, &positive(), 1.0)));
    assert!(nothing(bound(Spacing, 0.0, &[], 1.0)));
    assert!(bound(HalfSilent, 0.0, &positive(), 1.0).is_err());
}

/// A result that is no number is not near anything.
#[test]
fn no_number_is_not_within_a_tolerance() {
    functions! {
        /// √ of what may be a little below 0
        RootOfNothing: |x, y| vec![nothing(x, y).sqrt()];
    }
    assert!(bound(RootOfNothing, 0.0, &positive(), 1.0).is_err());
    assert!(<f32 as Float>::is_finite(RootOfNothing.of(0.5, 0.5)[0]));
}

/// x y, the machine's x being off by up to a thousandth.
struct OffProduct([f64; 2]);

impl Formula for OffProduct {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![x[0] * x[1]]
    }

    fn input_errors(&self) -> &[f64] {
        &self.0
    }
}

#[test]
fn what_an_input_is_off_by_is_in_the_bound_and_refutes_a_tighter_one() {
    let bound = |errors, tolerance| bound_rounding::<f32>(&OffProduct(errors), &positive(), tolerance, 1.0);
    bound([1e-3, 0.0], 1.001e-3).expect("of a factor of up to 1");
    bound([0.0; 2], 1e-7).expect("its own rounding");
    for tighter in [0.9e-3, 1e-4] {
        // somewhere the other factor is 1, and in the middle of the box three quarters
        let result = bound([1e-3, 0.0], tighter);
        assert!(result.is_err(), "{result:?}");
    }
    assert!(matches!(bound([1e-3, 0.0], 1e-4), Err(Failure::Refuted { .. })));
}

#[test]
fn a_constant_of_the_configuration_is_rounded() {
    let tenth = <Rounded<f32> as Float>::from_f64(0.1);
    assert!(tenth.real.contains(0.1) && tenth.real.lo < 0.1 && tenth.real.hi > 0.1, "f64 has rounded it: {tenth:?}");
    let off = (f64::from(0.1_f32) - 0.1).abs();
    assert!(tenth.error >= off && tenth.error < 1.1 * off, "{tenth:?}");
    let whole = <Rounded<f32> as Float>::from_f64(50.0);
    assert_eq!((whole.real, whole.error), (Interval::point(50.0), 0.0));
    let beyond = <Rounded<f32> as Float>::from_f64(16_777_217.0);
    assert!(beyond.error >= 1.0, "f32 has no such number: {beyond:?}");
}

#[test]
fn a_magnitude_keeps_the_error_and_settles_turns() {
    let off = Rounded::<f64>::input_within(Interval::new(-2.0, 1.0), 1e-3);
    let size = off.magnitude();
    assert_eq!((size.real, size.error), (Interval::new(0.0, 2.0), 1e-3));
    let angle = Rounded::<f64>::input(Interval::new(-1e-3, 1e-3)).atan2(Rounded::input(Interval::point(-1.0)));
    assert!(angle.magnitude().error > TAU, "{:?}", angle.magnitude());
}

/// A formula that asks whether its result is finite, and whether it is within a limit.
struct Guarded(f64);

impl Formula for Guarded {
    fn outputs<T: Float>(&self, x: &[T]) -> Vec<T> {
        let quotient = x[0] / (x[1] - T::from_f64(self.0));
        vec![if quotient.is_finite() && quotient.within(T::from_f64(100.0)) { quotient } else { T::zero() }]
    }
}

#[test]
fn where_the_machine_may_have_no_number_it_is_not_taken_for_finite() {
    bound_rounding::<f32>(&Guarded(0.25), &positive(), 1e-5, 1.0).expect("a divisor far from 0");
    let result = bound_rounding::<f32>(&Guarded(0.75), &positive(), 1.0, 1.0);
    assert!(result.is_err(), "{result:?}");
}

#[test]
#[should_panic(expected = "refused")]
fn a_whole_part_is_refused() {
    let _ = Float::floor(Rounded::<f64>::input(Interval::new(0.5, 1.5)));
}

#[test]
#[should_panic(expected = "refused")]
fn a_number_of_a_box_is_refused() {
    let _ = Rounded::<f64>::input(Interval::new(0.5, 1.5)).to_f64();
}
