//! The fit of a window, for all reals: it is least squares, and its normal matrix is no smaller than the certified angle says.

use cvg_estimator::{Demodulator, Phasor, Window};
use cvg_model::Real;
use cvg_prover::{Exact, Proof, Refusal};
use cvg_tests::proof::{TOO_TIGHT, WRONG, holds, holds_outside, rejects};

const SAMPLES: u16 = 8;

/// Steps of the carrier with rational cosine and sine, among them one near the 54.7° of the default settings.
const STEPS: [(i32, i32, i32); 3] = [(3, 4, 5), (5, 12, 13), (-8, 15, 17)];

/// What the demodulator makes of a window of any samples of X at any phase leaves residuals that are orthogonal to the cosine,
/// to the sine and to a constant: which is what the least squares of all three are.
fn the_fit_of_a_window_is_least_squares(
    proof: &mut Proof,
    planted: Exact,
    step: (i32, i32, i32),
) -> Result<(), Refusal> {
    let (zero, all) = (Exact::zero(), Exact::ratio(i32::from(SAMPLES), 1));
    let (c, s, h) = step;
    let (sin, cos) = Exact::angle("φ").sin_cos();
    let mut phasor = Phasor { cos, sin, step_cos: Exact::ratio(c, h), step_sin: Exact::ratio(s, h) };
    let demodulator = Demodulator::<Exact>::new(SAMPLES, 2.5).expect("inside its domain");
    let mut window = Window::begin(&phasor);
    let names = ["x0", "x1", "x2", "x3", "x4", "x5", "x6", "x7"];
    let mut samples = Vec::new();
    for name in names {
        let x = Exact::real(name);
        samples.push((x, phasor.cos, phasor.sin));
        demodulator.add(&mut window, x, zero, &phasor);
        phasor.advance();
    }
    let Some(fitted) = demodulator.envelope(&window, &phasor) else {
        // an envelope beyond eight times the range is none
        proof.outside(BEYOND);
        return Ok(());
    };
    let x_c = planted * fitted.x_c;
    let offset = samples.iter().fold(zero, |sum, (x, c, s)| sum + *x - x_c * *c - fitted.x_s * *s) / all;
    let residual = |(x, c, s): &(Exact, Exact, Exact)| *x - x_c * *c - fitted.x_s * *s - offset;
    let along = |of: &dyn Fn(&(Exact, Exact, Exact)) -> Exact| {
        samples.iter().fold(zero, |sum, sample| sum + residual(sample) * of(sample))
    };
    proof.equal("nothing is left along the cosine", along(&|(_, c, _)| *c), zero)?;
    proof.equal("nor along the sine", along(&|(_, _, s)| *s), zero)
}

const BEYOND: &str = "an envelope beyond eight times the range of the converter";

//= specs/dsp.md#carrier-rejection
//= type=test
//# A stationary carrier MUST be demodulated to its envelope whatever the number of samples in a window and whatever the offset of the converter.
#[test]
fn identity_the_fit_of_a_window_is_least_squares() {
    for step in STEPS {
        holds_outside(&[BEYOND], |proof, planted| the_fit_of_a_window_is_least_squares(proof, planted, step));
    }
}

#[test]
fn identity_the_fit_of_a_window_is_least_squares_twin() {
    for step in STEPS {
        rejects(WRONG, |proof, planted| the_fit_of_a_window_is_least_squares(proof, planted, step));
    }
}

/// A complex number.
type Complex = (Exact, Exact);

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn length_2(a: Complex) -> Exact {
    a.0 * a.0 + a.1 * a.1
}

/// With z on the unit circle and S the sum of its first N powers, S(z − 1) = z^N − 1 goes on to N + 1; and |S|² sin²(w/2) ≤ 1,
/// w being the angle of z: the square of z^N − 1 is at most 4, and that of z − 1 is 4 sin²(w/2).
fn sums_of_a_turning_phasor_are_bounded(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (one, four) = (Exact::one(), Exact::ratio(4, 1));
    let half = Exact::angle("w/2").sin_cos();
    let z = times((half.1, half.0), (half.1, half.0));
    let (sin, cos) = Exact::angle("N w").sin_cos();
    let power = (cos, sin);
    let minus_one = |a: Complex| (a.0 - one, a.1);
    // one power more, of any sum
    let sum = (Exact::real("Re S"), Exact::real("Im S"));
    let so_far = times(sum, minus_one(z));
    let more = times((sum.0 + power.0, sum.1 + power.1), minus_one(z));
    let next = times(power, z);
    proof.equal("the real part of one power more", more.0 - so_far.0, planted * (next.0 - power.0))?;
    proof.equal("and the imaginary part", more.1 - so_far.1, planted * (next.1 - power.1))?;
    proof.equal("|z − 1|²", length_2(minus_one(z)), four * half.0 * half.0)?;
    let shortfall = planted * four - length_2(minus_one(power));
    proof.not_negative("4 − |z^N − 1|²", shortfall, one, &[(one, power.0 + one), (one, power.1)])
}

//= specs/electronics.md#certified-angle
//= type=test
//# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
#[test]
fn identity_sums_of_a_turning_phasor_are_bounded() {
    holds(sums_of_a_turning_phasor_are_bounded);
}

#[test]
fn identity_sums_of_a_turning_phasor_are_bounded_twin() {
    rejects(WRONG, sums_of_a_turning_phasor_are_bounded);
}

/// What one sample adds to the normal matrix along u is half of |u|², and half of what the doubled phase adds; of any sum D of doubled
/// phases u takes at most |u|² |D|, and of the sum M of the phases at most |u|² |M|²: so that along u the matrix, the offset
/// eliminated, is at least |u|² (N/2 − |D|/2 − |M|²/N).
fn the_normal_matrix_is_bounded_from_below(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let (one, two) = (Exact::one(), Exact::two());
    let (u, v) = (Exact::real("u"), Exact::real("v"));
    let (sin, cos) = Exact::angle("φ").sin_cos();
    let doubled = times((cos, sin), (cos, sin));
    let share = (u * u - v * v) * doubled.0 + two * u * v * doubled.1;
    proof.equal("one sample, twice", two * (u * cos + v * sin).squared(), planted * (u * u + v * v) + share)?;
    let of = |name: &str| (Exact::real(&format!("Re {name}")), Exact::real(&format!("Im {name}")));
    let (d, m) = (of("D"), of("M"));
    let taken = (u * u - v * v) * d.0 + two * u * v * d.1;
    let across = (u * u - v * v) * d.1 - two * u * v * d.0;
    let most = planted * (u * u + v * v).squared() * length_2(d);
    proof.not_negative("(|u|² |D|)² less what is taken", most - taken.squared(), one, &[(one, across)])?;
    let (along, across) = (u * m.0 + v * m.1, u * m.1 - v * m.0);
    let most = planted * (u * u + v * v) * length_2(m);
    proof.not_negative("|u|² |M|² less what is taken", most - along.squared(), one, &[(one, across)])
}

//= specs/electronics.md#certified-angle
//= type=test
//# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
#[test]
fn identity_the_normal_matrix_is_bounded_from_below() {
    holds(the_normal_matrix_is_bounded_from_below);
}

#[test]
fn identity_the_normal_matrix_is_bounded_from_below_twin() {
    rejects(TOO_TIGHT, the_normal_matrix_is_bounded_from_below);
}

/// With e what the samples are off by and d what the fit makes of it, Σ(a·d − e)² is Σe² less what the normal matrix is along d, if that
/// matrix makes Σae of d, as the fit does; a square is not negative, so that the matrix along d is at most Σe². One sample more, of
/// any sums.
fn a_fit_takes_no_more_than_the_samples_have(proof: &mut Proof, planted: Exact) -> Result<(), Refusal> {
    let two = Exact::two();
    let (c, s, e) = (Exact::real("c"), Exact::real("s"), Exact::real("e"));
    let (d_c, d_s) = (Exact::real("d_c"), Exact::real("d_s"));
    let fitted = c * d_c + s * d_s;
    let left = (fitted - e).squared();
    // what one sample adds to d·Gd, to d·Σae and to Σe²
    let (matrix, right, square) = (fitted * fitted, planted * fitted * e, e * e);
    proof.equal("one sample", left, matrix - two * right + square)?;
    // over all samples G d = Σae
    let (g, q) = (Exact::real("d·Gd"), Exact::real("Σe²"));
    proof.equal("all samples", g - two * g + q, q - planted * g)
}

//= specs/electronics.md#certified-angle
//= type=test
//# The angle of the instrument MUST be that of the envelope at the converters within the certified bound.
#[test]
fn identity_a_fit_takes_no_more_than_the_samples_have() {
    holds(a_fit_takes_no_more_than_the_samples_have);
}

#[test]
fn identity_a_fit_takes_no_more_than_the_samples_have_twin() {
    rejects(WRONG, a_fit_takes_no_more_than_the_samples_have);
}
