//! The rounding engine: its enclosures hold, its error bounds hold, and it refutes what is false.

use cvg_model::Real;
use cvg_prover::{Failure, Format, Formula, Interval, Rounded, bound_rounding};
use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::ToPrimitive;

/// Numbers that are spread evenly, the same in every run.
fn spread(n: u32, lo: f64, hi: f64) -> f64 {
    lo + (hi - lo) * (f64::from(n) * 0.618_033_988_749_894_8).fract()
}

#[test]
fn the_enclosure_of_sine_and_cosine_is_narrow_and_holds_what_is_known() {
    let known = [
        (0.0, 0.0, 1.0),
        (1.0, 0.841_470_984_807_896_5, 0.540_302_305_868_139_8),
        (-2.0, -0.909_297_426_825_681_7, -0.416_146_836_547_142_4),
        (10.0, -0.544_021_110_889_369_8, -0.839_071_529_076_452_4),
    ];
    for (angle, sin, cos) in known {
        let (s, c) = Interval::point(angle).sin_cos();
        for (enclosed, value) in [(s, sin), (c, cos)] {
            assert!(enclosed.lo - 1e-16 <= value && value <= enclosed.hi + 1e-16, "{angle}: {enclosed:?}");
            assert!(enclosed.width() < 1e-14, "{angle}: {enclosed:?}");
        }
    }
    // sin² + cos² = 1 in every enclosure
    for n in 0..10_000 {
        let (s, c) = Interval::point(spread(n, -50.0, 50.0)).sin_cos();
        assert!((s.squared() + c.squared()).contains(1.0));
    }
}

#[test]
fn the_enclosure_over_an_interval_holds_every_angle_of_it() {
    for n in 0..20_000 {
        let lo = spread(n, -15.0, 15.0);
        let wide = Interval::new(lo, lo + spread(3 * n + 1, 0.0, 7.0));
        let (s, c) = wide.sin_cos();
        for part in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let (sin, cos) = (wide.lo + part * wide.width()).clamp(wide.lo, wide.hi).sin_cos();
            assert!(s.lo <= sin + 1e-15 && sin <= s.hi + 1e-15, "{wide:?}");
            assert!(c.lo <= cos + 1e-15 && cos <= c.hi + 1e-15, "{wide:?}");
        }
    }
}

#[test]
fn the_enclosure_of_the_arctangent_points_where_the_point_is() {
    for n in 0..20_000 {
        let (x, y) = (spread(n, -3.0, 3.0), spread(7 * n + 3, -3.0, 3.0));
        let (angle, cut) = Interval::point(y).atan2(Interval::point(x));
        assert!(!cut && angle.width() < 2e-14, "{x} {y}: {angle:?}");
        assert!(angle.contains(y.atan2(x)), "{x} {y}: {angle:?}");
        let (s, c) = angle.sin_cos();
        let cross = Interval::point(x) * s - Interval::point(y) * c;
        assert!(cross.contains(0.0));
    }
    let beyond = Interval::new(-0.1, 0.1).atan2(Interval::new(-2.0, -1.0));
    assert!(beyond.1 && beyond.0.contains(3.0) && beyond.0.contains(-3.0));
}

/// Some arithmetic that uses every operation.
fn everything<T: Real>(a: T, b: T, c: T) -> [T; 5] {
    let (sin, cos) = (a * b).sin_cos();
    let root = (a * a + b * b + T::ratio(1, 3)).sqrt();
    [
        sin / root - cos,
        (b - c) * root,
        (sin * c).atan2(cos + root),
        T::half() * (a + T::two() * c),
        -root / (c - T::ratio(9, 1)),
    ]
}

/// Evaluates at a point of the box; by how much of the bound the machine errs, at most.
fn observed<F: Format>(n: u32) -> f64 {
    let inputs = [0, 1, 2].map(|k| F::from_f64(spread(3 * n + k, -4.0, 4.0)));
    let [a, b, c] = inputs.map(|v| Rounded::<F>::input(Interval::point(v.to_f64())));
    let enclosed = everything(a, b, c);
    let machine = everything(inputs[0], inputs[1], inputs[2]);
    enclosed.iter().zip(machine).fold(0.0, |most, (enclosed, machine)| {
        let value = machine.to_f64();
        let gap = (enclosed.real.lo - value).max(value - enclosed.real.hi).max(0.0);
        assert!(gap <= enclosed.error, "{value:e} is {gap:e} off {enclosed:?}");
        most.max(gap / enclosed.error)
    })
}

#[test]
fn the_machine_never_errs_by_more_than_the_bound_and_sometimes_by_half_of_it() {
    let most32 = (0..20_000).map(observed::<f32>).fold(0.0, f64::max);
    let most64 = (0..20_000).map(observed::<f64>).fold(0.0, f64::max);
    println!("largest share of the bound: f32 {most32:.3}, f64 {most64:.3}");
    assert!(most32 > 0.3, "{most32}: a bound that is never approached hides what it bounds");
}

/// One operation, or few, on numbers of any size.
fn few<T: Real>(which: u32, a: T, b: T) -> T {
    match which % 7 {
        0 => a * b,
        1 => a / b,
        2 => (a * a + b * b).sqrt(),
        3 => a * a - b * b,
        4 => T::half() * a * T::half() * b,
        5 => a.sqrt() * b,
        _ => (a + b) / (a - b),
    }
}

/// From subnormal numbers to the largest there are: a bound that is given holds there too.
#[test]
fn the_machine_never_errs_by_more_than_the_bound_at_the_ends_of_its_range() {
    let mut state = 12_345_u64;
    let mut any = || loop {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let value = f32::from_bits((state >> 32) as u32);
        if value.is_finite() {
            return value;
        }
    };
    let mut given = 0;
    for which in 0..200_000 {
        let (a, b) = (any(), any());
        let [x, y] = [a, b].map(|v| Rounded::<f32>::input(Interval::point(f64::from(v))));
        let (enclosed, machine) = (few(which, x, y), f64::from(few(which, a, b)));
        if enclosed.error.is_finite() {
            given += 1;
            let gap = (enclosed.real.lo - machine).max(machine - enclosed.real.hi).max(0.0);
            assert!(gap <= enclosed.error, "{which}: {a:e} {b:e} give {machine:e}, {enclosed:?}");
        }
    }
    assert!(given > 50_000, "{given} bounds");
}

/// 2⁻²⁰⁰: fixed-point numbers that are far finer than either scalar.
const BITS: usize = 200;

/// A number as a multiple of 2⁻²⁰⁰, exactly.
fn fixed(value: f64) -> BigInt {
    let ratio = BigRational::from_float(value).expect("a finite number");
    (ratio.numer() << BITS) / ratio.denom()
}

/// (sin, cos) by their series in fixed point, to some 2⁻¹⁸⁰ for |x| below 16.
fn fine_sin_cos(x: &BigInt) -> [BigInt; 2] {
    let mut sums = [BigInt::ZERO, BigInt::ZERO];
    let mut term = BigInt::from(1) << BITS;
    for n in 0..160_u32 {
        let sum = &mut sums[usize::from(n % 2 == 0)];
        *sum += if n % 4 < 2 { term.clone() } else { -term.clone() };
        term = ((term * x) >> BITS) / (n + 1);
    }
    sums
}

/// Difference over the spacing of the scalar at `value`, units in the last place.
fn ulps<F: Format>(difference: &BigInt, value: f64) -> f64 {
    let difference = difference.to_f64().expect("a number") * (-(BITS as f64)).exp2();
    difference.abs() / (value.abs().log2().floor().exp2() * 2.0 * F::UNIT)
}

/// How far `libm` is from the real value at most: (sine and cosine, arctangent), units in the last place.
fn library_error<F: Format>(cases: u32) -> (f64, f64) {
    (0..cases).fold((0.0, 0.0), |(waves, angles), n| {
        let (a, b) = (F::from_f64(spread(n, -13.0, 13.0)), F::from_f64(spread(5 * n + 2, -13.0, 13.0)));
        let (sin, cos) = a.sin_cos();
        let [real_sin, real_cos] = fine_sin_cos(&fixed(a.to_f64()));
        let sin = ulps::<F>(&(fixed(sin.to_f64()) - real_sin), sin.to_f64());
        let cos = ulps::<F>(&(fixed(cos.to_f64()) - real_cos), cos.to_f64());
        // the arctangent is off by the cross product of the point with its direction, over the distance
        let angle = a.atan2(b).to_f64();
        let [s, c] = fine_sin_cos(&fixed(angle));
        let distance = a.to_f64().hypot(b.to_f64());
        let cross = (fixed(b.to_f64()) * s - fixed(a.to_f64()) * c) >> BITS;
        let angle = ulps::<F>(&cross, angle) / distance;
        (f64::max(waves, sin).max(cos), f64::max(angles, angle))
    })
}

/// The assumption about `libm` is held to its own code, at points.
#[test]
fn libm_is_within_its_assumed_units_in_the_last_place() {
    let (single, double) = (library_error::<f32>(20_000), library_error::<f64>(20_000));
    println!("sine and cosine, arctangent: f32 {single:.3?} ulp, f64 {double:.3?} ulp");
    assert!(single.0 <= <f32 as Format>::SIN_COS_ULPS && single.1 <= <f32 as Format>::ATAN2_ULPS, "{single:?}");
    assert!(double.0 <= <f64 as Format>::SIN_COS_ULPS && double.1 <= <f64 as Format>::ATAN2_ULPS, "{double:?}");
    // a reference that is off would show here: correct rounding alone is half a unit
    assert!(single.0 >= 0.49 && double.0 >= 0.49, "{single:?} {double:?}");
}

/// (1 − cos 2x)/2 by the double angle, which is sin² x.
struct HalfVersine;

impl Formula for HalfVersine {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        let (_, cos) = (T::two() * x[0]).sin_cos();
        vec![T::half() * (T::one() - cos)]
    }
}

#[test]
fn a_bound_that_holds_is_shown_and_one_that_does_not_is_refuted() {
    let boxes = [vec![Interval::new(-3.0, 3.0)]];
    let shown = bound_rounding::<f32>(&HalfVersine, &boxes, 3e-7, 1.0).expect("three roundings");
    assert!(shown.share > 0.1 && shown.share <= 1.0, "{shown:?}");
    let tight = bound_rounding::<f32>(&HalfVersine, &boxes, 1e-9, 1.0);
    assert!(matches!(tight, Err(Failure::Refuted { .. })), "{tight:?}");
    let planted = bound_rounding::<f64>(&HalfVersine, &boxes, 1e-12, 1.01);
    assert!(matches!(planted, Err(Failure::Refuted { .. })), "{planted:?}");
}

/// 1/x, on a box that holds 0.
struct Reciprocal;

impl Formula for Reciprocal {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![T::one() / x[0]]
    }
}

#[test]
fn a_pole_is_never_bounded() {
    let result = bound_rounding::<f64>(&Reciprocal, &[vec![Interval::new(-1.0, 3.0)]], 1e3, 1.0);
    assert!(matches!(result, Err(Failure::Undecided { .. })), "{result:?}");
}

/// Parts where rounding decides: the machine may take the other branch.
struct Jump;

impl Formula for Jump {
    fn outputs<T: Real>(&self, x: &[T]) -> Vec<T> {
        vec![if x[0] * x[0] < x[1] { T::zero() } else { T::one() }]
    }
}

#[test]
fn a_comparison_that_rounding_can_turn_is_never_bounded() {
    let unit = Interval::new(0.5, 1.0);
    let result = bound_rounding::<f32>(&Jump, &[vec![unit, unit]], 0.5, 1.0);
    assert!(result.is_err(), "{result:?}");
}
