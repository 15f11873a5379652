//! One number from the converters to the angle: its links proved for all reals where they are geometry, and the sum held
//! against the instrument before converters at their worst.

use core::f64::consts::{FRAC_PI_2, TAU};

use cvg_instrument::{Instrument, Settings};
use cvg_model::detection::{angle_error, angle_error_bound};
use cvg_model::effects::EffectId;
use cvg_model::{Envelope, Float, Orbit, Real};
use cvg_prover::{Exact, Proof, Refusal};
use cvg_tests::proof::{TOO_TIGHT, WRONG, holds, rejects};
use proptest::prelude::*;

#[path = "certified_angle/certified.rs"]
mod certified;

use certified::Chain;

/// An envelope and what is added to it, each any.
fn any_two() -> (Envelope<Exact>, Envelope<Exact>) {
    let of = |name: &str| {
        let [a, b, c, d] = ["x_c", "x_s", "y_c", "y_s"].map(|part| Exact::real(&format!("{name} {part}")));
        Envelope::new(a, b, c, d)
    };
    (of("u"), of("d"))
}

/// |X Y′ − Y X′|² of the phasors X = x_c − i x_s.
fn area_2(u: &Envelope<Exact>, v: &Envelope<Exact>) -> Exact {
    let along = u.x_c * v.y_c - u.x_s * v.y_s - u.y_c * v.x_c + u.y_s * v.x_s;
    let across = u.x_c * v.y_s + u.x_s * v.y_c - u.y_c * v.x_s - u.y_s * v.x_c;
    along * along + across * across
}

/// E E′ − (R R′ + S S′ + Q Q′) = 2 |X Y′ − Y X′|²: twice E E′ sin² of half the angle between the points.
fn points_of_the_sphere_are_as_far_apart_as_phasors(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (u, d) = any_two();
    let v = u + d;
    let (p, q) = (u.pendulum(), v.pendulum());
    let apart = p.e * q.e - (p.r * q.r + p.s * q.s + p.q * q.q);
    proof.equal("E E′ less the product of the points", apart, Exact::two() * planted * area_2(&u, &v))
}

//= specs/electronics.md#envelope-error
//= type=test
//# The sine of half the angle between the points of two envelopes on the sphere of Equation 2 MUST NOT exceed the length of their difference over the length of either.
#[test]
fn identity_points_of_the_sphere_are_as_far_apart_as_phasors() {
    holds(points_of_the_sphere_are_as_far_apart_as_phasors);
}

#[test]
fn identity_points_of_the_sphere_are_as_far_apart_as_phasors_twin() {
    rejects(WRONG, points_of_the_sphere_are_as_far_apart_as_phasors);
}

/// |X Y′ − Y X′|² ≤ E D, where D is E of the difference; by Lagrange the rest is |X̄ dX + Ȳ dY|².
fn the_area_is_within_the_lengths(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (u, d) = any_two();
    let product = u.pendulum().e * d.pendulum().e;
    let along = u.x_c * d.x_c + u.x_s * d.x_s + u.y_c * d.y_c + u.y_s * d.y_s;
    let across = u.x_c * d.x_s - u.x_s * d.x_c + u.y_c * d.y_s - u.y_s * d.y_c;
    let one = Exact::one();
    proof.not_negative("E D − area²", planted * product - area_2(&u, &(u + d)), one, &[(one, along), (one, across)])
}

//= specs/electronics.md#envelope-error
//= type=test
//# The sine of half the angle between the points of two envelopes on the sphere of Equation 2 MUST NOT exceed the length of their difference over the length of either.
#[test]
fn identity_the_area_is_within_the_lengths() {
    holds(the_area_is_within_the_lengths);
}

#[test]
fn identity_the_area_is_within_the_lengths_twin() {
    rejects(TOO_TIGHT, the_area_is_within_the_lengths);
}

/// What is left of the ratio g is r: by the group g over that of the compensation. For g > 1 and r in [1, g] the tangent of
/// what is left is not above that of the error, at every angle in the half where they are positive; and not below zero.
fn less_than_all_is_better_than_nothing(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (left, undone, theta) = (Exact::positive("r − 1"), Exact::positive("g − r"), Exact::acute("θ"));
    let one = Exact::one();
    let (r, g) = (one + left, one + left + planted * undone);
    let ((x, y), (x_left, y_left)) = (angle_error(g, theta).ray(), angle_error(r, theta).ray());
    proof.positive_by_factors("of one sign", y_left)?;
    proof.positive_by_factors("the larger tangent is that before", y * x_left - y_left * x)
}

//= specs/equation-07.md#compensation
//= type=test
//# A ratio that a compensation leaves between one and that of the readout MUST NOT enlarge the error at any angle, and one between its inverse and itself MUST NOT enlarge the bound.
#[test]
fn identity_less_than_all_is_better_than_nothing() {
    holds(less_than_all_is_better_than_nothing);
}

#[test]
fn identity_less_than_all_is_better_than_nothing_twin() {
    rejects(&[(-1, 1)], less_than_all_is_better_than_nothing);
}

/// (g−1)²(r+1)² − (r−1)²(g+1)² = 4 (g − r)(g r − 1), not negative for 1/g ≤ r ≤ g: the squared sines of the two bounds.
fn up_to_the_inverse_the_bound_is_not_enlarged(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (one, undone) = (Exact::one(), Exact::positive("g − r"));
    // r above the inverse of g: g r = 1 + more
    let (r, more) = (Exact::positive("r"), Exact::positive("g r − 1"));
    let g = r + undone;
    let (bound, left) = (angle_error_bound(g).ray(), angle_error_bound(r).ray());
    // sin² of each is y² over (ratio + 1)²
    let difference = bound.1 * bound.1 * (r + one) * (r + one) - left.1 * left.1 * (g + one) * (g + one);
    let expected = Exact::ratio(4, 1) * planted * undone * (g * r - one);
    proof.positive_by_factors("4 (g − r)(g r − 1)", Exact::ratio(4, 1) * undone * more)?;
    proof.equal("the bounds", difference, expected)
}

//= specs/equation-07.md#compensation
//= type=test
//# A ratio that a compensation leaves between one and that of the readout MUST NOT enlarge the error at any angle, and one between its inverse and itself MUST NOT enlarge the bound.
#[test]
fn identity_up_to_the_inverse_the_bound_is_not_enlarged() {
    holds(up_to_the_inverse_the_bound_is_not_enlarged);
}

#[test]
fn identity_up_to_the_inverse_the_bound_is_not_enlarged_twin() {
    rejects(WRONG, up_to_the_inverse_the_bound_is_not_enlarged);
}

/// What a converter does with a voltage.
#[derive(Clone, Copy, Debug)]
enum Converter {
    /// takes the nearest code
    Rounds,
    /// is off by half a step, in the direction that turns the angle most
    AtItsWorst(f64),
}

/// Windows in a row.
const WINDOWS: u16 = 3;

/// The angle that the instrument shows after each of the first windows, off by how much at most, and the bound, degrees. Which of the
/// half turns it begins in does not matter; it has to stay there, also where the pattern lies on the cut.
fn off_by<T: Float>(
    s: &Settings<'_>,
    chain: &Chain,
    orbit: Orbit<f64>,
    offset: [f64; 2],
    converter: Converter,
) -> [f64; 2] {
    let instrument = Instrument::<T>::new(s).expect("inside its domain");
    let mut state = instrument.start();
    let step = 2.0 * s.adc_full_scale_v / 2.0_f64.powi(chain.bits.cast_signed());
    let e = orbit.envelope();
    let (mut most, mut half_turns) = (0.0_f64, None);
    for k in 0..WINDOWS * s.window {
        let (sin, cos) = (chain.step_rad * f64::from(k)).sin_cos();
        let gain = chain.undone * chain.left;
        let read = [e.x_c * cos + e.x_s * sin + offset[0], gain * (e.y_c * cos + e.y_s * sin) + offset[1]];
        // against each other: the direction across the orbit
        let across = [-orbit.theta.sin(), orbit.theta.cos()];
        let coded = [0, 1].map(|c| match converter {
            Converter::Rounds => (read[c] / step).round() * step,
            Converter::AtItsWorst(sense) => {
                let worst = (cos * orbit.delta.cos() - sin * orbit.delta.sin()) * across[c] * sense;
                read[c] + 0.5 * step * worst.signum()
            }
        });
        let (_, _, status) = instrument.step(&mut state, T::from_f64(coded[0]), T::from_f64(coded[1]));
        if status.fresh {
            let turned = state.angle_deg() - orbit.theta.to_degrees();
            let begun = *half_turns.get_or_insert(180.0 * (turned / 180.0).round());
            most = most.max((turned - begun).abs());
        }
    }
    [most, chain.degrees()]
}

fn chain(s: &Settings<'_>, bits: u32, epsilon: f64, amplitude_v: f64) -> Chain {
    Chain {
        full_scale_v: s.adc_full_scale_v,
        bits,
        samples: u32::from(s.window),
        step_rad: TAU * s.carrier_hz / s.sample_hz,
        epsilon,
        amplitude_v,
        offset_v: 0.05,
        roundness: 0.05,
        undone: 1.0,
        left: 1.0,
    }
}

proptest! {
    #![proptest_config(cvg_tests::config())]
    //= specs/electronics.md#certified-angle
    //= type=test
    //# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
    #[test]
    fn prop_the_angle_is_within_its_certified_bound(
        bits in 8_u32..22, share in 0.1..0.8_f64, theta in -FRAC_PI_2..FRAC_PI_2, q in -0.05..0.05_f64, delta in -3.0..3.0_f64,
        offset in prop::array::uniform2(-0.05..0.05_f64), window in 16_u16..=90,
        worst in prop::option::of(prop::sample::select(vec![1.0, -1.0])),
        undone in prop::option::of(0.9..1.1_f64), left in prop::option::of(0.99..1.01_f64),
    ) {
        let readout = [(EffectId::DetectionGainMismatch, [undone.unwrap_or(1.0), 0.0, 0.0, 0.0])];
        let readout = if undone.is_some() { &readout[..] } else { &[] };
        let s = Settings { window, band: 0.004, readout, ..Settings::default() };
        let (undone, left) = (undone.unwrap_or(1.0), left.unwrap_or(1.0));
        let chain = |epsilon, amplitude_v| Chain { undone, left, ..chain(&s, bits, epsilon, amplitude_v) };
        let amplitude_v = share * s.adc_full_scale_v;
        let orbit = Orbit { a: amplitude_v, q: q * amplitude_v, theta, delta };
        let converter = worst.map_or(Converter::Rounds, Converter::AtItsWorst);
        let [off, bound] = off_by::<f32>(&s, &chain(f64::from(f32::EPSILON), amplitude_v), orbit, offset, converter);
        prop_assert!(off <= bound, "f32: {off:e} degrees, {bound:e} certified");
        let [off, bound] = off_by::<f64>(&s, &chain(f64::EPSILON, amplitude_v), orbit, offset, converter);
        prop_assert!(off <= bound, "f64: {off:e} degrees, {bound:e} certified");
    }
}

//= specs/electronics.md#certified-angle
//= type=test
//# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
#[test]
fn the_bound_is_no_more_than_twice_what_a_converter_at_its_worst_makes() {
    let s = Settings::default();
    for bits in [10, 12, 16] {
        let chain = Chain { roundness: 0.0, offset_v: 0.0, ..chain(&s, bits, f64::EPSILON, 1.0) };
        let worst = (0..64)
            .map(|k| {
                let theta = -FRAC_PI_2 + f64::from(k) * FRAC_PI_2 / 32.0;
                let orbit = Orbit { a: 1.0, q: 0.0, theta, delta: 0.3 };
                let [off, bound] = off_by::<f64>(&s, &chain, orbit, [0.0; 2], Converter::AtItsWorst(1.0));
                assert!(off <= bound, "{off:e} of {bound:e} degrees");
                off / bound
            })
            .fold(0.0, f64::max);
        assert!(worst > 0.5, "{bits} bits: at most {worst} of the bound");
    }
}

/// The page has the table that is computed here.
#[test]
fn the_page_of_the_certified_angle_has_the_table_that_is_computed() {
    let s = Settings::default();
    let mut table = String::from("| bits | scalar | 1 V | 0.3 V | 0.1 V |\n| --- | --- | --- | --- | --- |\n");
    for bits in [12, 14, 16, 18, 24] {
        for (scalar, epsilon) in [("f32", f64::from(f32::EPSILON)), ("f64", f64::EPSILON)] {
            let at = |a: f64| format!("{:.1e}", Chain { offset_v: 0.05, ..chain(&s, bits, epsilon, a) }.degrees());
            table.push_str(&format!("| {bits} | {scalar} | {} | {} | {} |\n", at(1.0), at(0.3), at(0.1)));
        }
    }
    for (name, degrees) in chain(&s, 16, f64::from(f32::EPSILON), 1.0).links() {
        println!("{name}: {degrees:.2e} degrees");
    }
    println!("{table}");
    let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/certified-angle.md");
    let page = std::fs::read_to_string(page).expect("the page").replace("\r\n", "\n");
    assert!(page.contains(&table), "the page does not have\n{table}");
}
