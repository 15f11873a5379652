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
