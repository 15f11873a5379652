//! What would pass for a proof if the exact engine let it: facts that rest on themselves, slopes that are lost, paths
//! that are dropped. Each is refused, beside its neighbour that is right and is proved.

use cvg_model::{Float, Real};
use cvg_prover::{Exact, Proof, Proved, Refusal, prove};

type Claim = fn(&mut Proof) -> Result<(), Refusal>;

fn proved(claim: Claim) -> Proved {
    prove(claim).expect("it holds")
}

fn refused(claim: Claim) -> Refusal {
    prove(claim).expect_err("it does not hold")
}

// Debts.

/// With inv = x/x² both m = inv² + 1 > 0 and m x² = 1 + x² are identities, so that x² would be positive for every x, and
/// pay the division by x² from which m comes.
#[test]
fn a_fact_does_not_pay_the_division_that_it_comes_from() {
    let refusal = refused(|proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        let inv = x / (x * x);
        let m = inv * inv + one;
        proof.positive("m", m, one, one, &[(one, inv)])?;
        proof.positive("x²", x * x, m, one, &[(one, x)])?;
        proof.equal("x/x² is 1/x", x * inv, one)
    });
    assert_eq!(refusal, Refusal::Division("x^2".into()));
}

/// The second division's quotient would pay the first, and the first one's the second.
#[test]
fn two_divisions_do_not_pay_each_other() {
    let refusal = refused(|proof| {
        let (x, y, one) = (Exact::real("x"), Exact::real("y"), Exact::one());
        let (a, b) = (x / (x * x), y / (y * y));
        let m = (a * b) * (a * b) + one;
        proof.positive("m", m, one, one, &[(one, a * b)])?;
        proof.positive("x²y²", x * y * x * y, m, one, &[(one, x * y)])?;
        proof.equal("x²y²/x²y²", x * y * x * y / (x * y * x * y), one)
    });
    assert_eq!(refusal, Refusal::Division("x^2".into()));
}

/// A comparison whose sides were divided by x does not show that x is not zero.
#[test]
fn a_comparison_of_quotients_does_not_pay_for_them() {
    let refusal = refused(|proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        // 1/x² > 0 is so wherever it is at all
        let inverse = one / (x * x);
        if inverse > Exact::zero() && inverse * x * x * x * x > Exact::zero() {
            return proof.equal("x²/x² = 1", x * x * inverse, one);
        }
        proof.not_negative_by_path("1/x² ≤ 0", -inverse)
    });
    assert!(matches!(refusal, Refusal::Division(_)), "{refusal}");
}

#[test]
fn a_fact_about_the_divisor_itself_pays_before_and_after_the_division() {
    let before: Claim = |proof| {
        let (x, y, one) = (Exact::real("x"), Exact::real("y"), Exact::one());
        let divisor = x * x - x * y + y * y + one;
        let half = Exact::half();
        let squares = [(half, x), (half, y), (half, x - y)];
        proof.positive("divisor", divisor, one, one, &squares)?;
        proof.equal("1", divisor * (one / divisor), one)
    };
    let after: Claim = |proof| {
        let (x, y, one) = (Exact::real("x"), Exact::real("y"), Exact::one());
        let divisor = x * x - x * y + y * y + one;
        let (inverse, half) = (one / divisor, Exact::half());
        proof.equal("1", divisor * inverse, one)?;
        proof.positive("divisor", divisor, one, one, &[(half, x), (half, y), (half, x - y)])
    };
    proved(before);
    proved(after);
}

#[test]
fn a_comparison_of_the_divisor_pays_on_its_path_only() {
    let with_zero: Claim = |proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        if x != Exact::zero() {
            return proof.equal("x/x", x / x, one);
        }
        proof.equal("x is 0", x * (one / x), one)
    };
    assert_eq!(refused(with_zero), Refusal::Division("x".into()));
    let without: Claim = |proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        if x != Exact::zero() {
            return proof.equal("x/x", x / x, one);
        }
        proof.not_negative_by_path("x is 0", x)
    };
    assert_eq!(proved(without).covered, 2);
}

/// √x would make x its own square's square, and so positive.
#[test]
fn a_root_does_not_show_that_what_is_under_it_is_positive() {
    let refusal = refused(|proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        let root = x.sqrt();
        proof.not_negative("x ≥ 0 for every x", x, one, &[(one, root)])
    });
    assert!(matches!(refusal, Refusal::Root(_) | Refusal::Refuted { .. }), "{refusal}");
}

// Derivatives.

#[test]
fn derivatives_follow_the_quotient_rule() {
    proved(|proof| {
        let (x, a) = (Exact::real("x"), Exact::positive("a"));
        let f = x * x * x / (x * x + a);
        let slope = (x * x * x * x + Exact::ratio(3, 1) * a * x * x) / ((x * x + a) * (x * x + a));
        proof.equal("slope", f.derivative(x), slope)
    });
}

#[test]
fn the_derivative_of_a_root_is_not_lost() {
    proved(|proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        let root = (x * x + one).sqrt();
        proof.equal("d/dx √(x² + 1)", root.derivative(x), x / root)?;
        // and through a quotient and a root of a root
        let deep = (root + one).sqrt();
        let slope = x / (Exact::ratio(4, 1) * deep * root);
        proof.equal("d/dx √(√(x² + 1) + 1)", Exact::half() * deep.derivative(x), slope)
    });
    let refusal = refused(|proof| {
        let (x, one) = (Exact::positive("x"), Exact::one());
        proof.equal("d/dx √(x² + 1) = 0", (x * x + one).sqrt().derivative(x), Exact::zero())
    });
    assert!(matches!(refusal, Refusal::Refuted { .. }), "{refusal}");
}

#[test]
fn the_derivative_of_an_arctangent_is_not_lost() {
    proved(|proof| {
        let (x, y) = (Exact::positive("x"), Exact::real("y"));
        let angle = y.atan2(x);
        proof.equal("by y", angle.derivative(y), x / (x * x + y * y))?;
        proof.equal("by x", angle.derivative(x), -y / (x * x + y * y))?;
        // what does not depend on it has none
        proof.equal("by another", angle.derivative(Exact::real("z")), Exact::zero())
    });
    let refusal = refused(|proof| {
        let (x, y) = (Exact::positive("x"), Exact::positive("y"));
        proof.equal("d/dy atan2(y, x) = 0", y.atan2(x).derivative(y), Exact::zero())
    });
    assert!(matches!(refusal, Refusal::Refuted { .. }), "{refusal}");
}

#[test]
fn the_derivatives_of_sine_and_cosine_are_each_other() {
    proved(|proof| {
        let (a, b) = (Exact::angle("a"), Exact::angle("b"));
        let ((sin, cos), turned) = (a.sin_cos(), (Exact::two() * a - b).sin_cos());
        proof.equal("d/da sin a", sin.derivative(a), cos)?;
        proof.equal("d/da cos a", cos.derivative(a), -sin)?;
        proof.equal("d/da sin(2a − b)", turned.0.derivative(a), Exact::two() * turned.1)?;
        proof.equal("d/db sin(2a − b)", turned.0.derivative(b), -turned.1)?;
        proof.equal("d/da a", (Exact::two() * a).derivative(a), Exact::two())
    });
    let refusal = refused(|proof| {
        let a = Exact::angle("a");
        proof.equal("d/da sin a = 0", a.sin_cos().0.derivative(a), Exact::zero())
    });
    assert!(matches!(refusal, Refusal::Refuted { .. }), "{refusal}");
}

/// At the origin an arctangent has no slope, and a root of 0 none either.
#[test]
fn a_derivative_owes_that_there_is_one() {
    let refusal = refused(|proof| {
        let (x, y) = (Exact::real("x"), Exact::real("y"));
        let slope = y.atan2(x).derivative(y);
        proof.equal("slope", slope, slope)
    });
    assert!(matches!(refusal, Refusal::Division(_)), "{refusal}");
    let refusal = refused(|proof| {
        let x = Exact::real("x");
        let slope = (x * x).sqrt().derivative(x);
        proof.equal("slope", slope, slope)
    });
    assert!(matches!(refusal, Refusal::Division(_)), "{refusal}");
}

#[test]
#[should_panic(expected = "refused: a derivative by 2·x")]
fn a_derivative_by_a_multiple_is_refused() {
    let ended = prove(|proof| {
        let x = Exact::real("x");
        proof.equal("slope", (x * x).derivative(Exact::two() * x), Exact::two() * x)
    });
    drop(ended);
}

#[test]
#[should_panic(expected = "refused: a derivative by √")]
fn a_derivative_by_what_depends_on_others_is_refused() {
    let ended = prove(|proof| {
        let x = Exact::positive("x");
        proof.equal("slope", x.derivative(x.sqrt()), Exact::zero())
    });
    drop(ended);
}

#[test]
#[should_panic(expected = "two values may be equal that were compared")]
fn a_derivative_on_a_path_without_an_inside_is_refused() {
    let ended = prove(|proof| {
        let x = Exact::real("x");
        // x², with another slope where x is 0
        let value = if x == Exact::zero() { x } else { x * x };
        proof.equal("slope", value.derivative(x), value.derivative(x))
    });
    drop(ended);
}

/// The claim of `slope` at `value`, of which this path says that it is the function.
fn slope_on_its_path(value: Exact, by: Exact, proof: &mut Proof) -> Result<(), Refusal> {
    proof.may_be_empty("nobody looked");
    proof.equal("slope", value.derivative(by), value.derivative(by))
}

#[test]
#[should_panic(expected = "two values may be equal that were compared")]
fn a_derivative_where_three_values_are_each_no_less_than_the_next_is_refused() {
    // y, written as x where the two and z are equal: no comparison finds two of them equal
    let ended = prove(|proof| {
        let [x, y, z] = ["x", "y", "z"].map(Exact::real);
        let value = if x <= y && y <= z && z <= x { x } else { y };
        slope_on_its_path(value, x, proof)
    });
    drop(ended);
}

#[test]
#[should_panic(expected = "two values may be equal that were compared")]
fn a_derivative_where_a_square_is_not_above_zero_is_refused() {
    let ended = prove(|proof| {
        let [x, y] = ["x", "y"].map(Exact::real);
        let value = if (x - y) * (x - y) <= Exact::zero() { x } else { y };
        slope_on_its_path(value, x, proof)
    });
    drop(ended);
}

#[test]
#[should_panic(expected = "two values may be equal that were compared")]
fn a_derivative_at_a_corner_is_refused() {
    let ended = prove(|proof| {
        let x = Exact::real("x");
        slope_on_its_path(if x < Exact::zero() { -x } else { x }, x, proof)
    });
    drop(ended);
}

#[test]
fn a_derivative_between_strict_bounds_is_one() {
    proved(|proof| {
        let x = Exact::real("x");
        if x > Exact::zero() {
            proof.equal("slope", (x * x).derivative(x), Exact::two() * x)
        } else {
            proof.outside("not above zero");
            Ok(())
        }
    });
}

// Paths.

#[test]
fn a_proof_without_a_claim_is_refused() {
    assert!(matches!(refused(|_| Ok(())), Refusal::Silent(_)));
}

#[test]
fn a_path_that_returns_before_its_claim_is_refused() {
    let refusal = refused(|proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        if x < one {
            return Ok(());
        }
        proof.not_negative_by_path("x ≥ 1 for every real x", x - one)
    });
    assert_eq!(refusal, Refusal::Silent("the path - 1 + x < 0".into()));
}

/// A claim from before the comparison does not speak for what comes after it.
#[test]
fn a_path_that_claims_nothing_after_its_last_comparison_is_refused() {
    let refusal = refused(|proof| {
        let limit = Exact::positive("limit");
        for name in ["x", "y", "z"] {
            let x = Exact::real(name);
            proof.equal("square", x * x, x.squared())?;
            if x > limit {
                return Ok(());
            }
            proof.not_negative_by_path("within", limit - x)?;
        }
        Ok(())
    });
    assert!(matches!(&refusal, Refusal::Silent(path) if path.contains("> 0")), "{refusal}");
}

#[test]
fn what_is_left_out_is_told() {
    let found = proved(|proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        if x < one {
            proof.outside("x is below 1");
            return Ok(());
        }
        proof.not_negative_by_path("x ≥ 1", x - one)
    });
    assert_eq!(found.outside.into_iter().collect::<Vec<_>>(), ["x is below 1"]);
    assert_eq!((found.paths, found.by_claim["x ≥ 1"]), (2, 1));
}

#[test]
fn nothing_is_assumed_on_one_path_alone() {
    let refusal = refused(|proof| {
        let (x, y) = (Exact::real("x"), Exact::real("y"));
        if x < y {
            proof.assume_positive(x - y)?;
            return proof.positive_by_factors("x > y although x < y", x - y);
        }
        proof.not_negative_by_path("x ≥ y", x - y)
    });
    assert_eq!(refusal, Refusal::Late("x - y".into()));
}

/// No point lies on the one path, which the engine is not shown; on the other one there are points.
#[test]
fn a_path_without_a_point_needs_to_be_shown_impossible() {
    let refusal = refused(|proof| {
        let (x, y) = (Exact::real("x"), Exact::real("y"));
        if x * x + y * y < x * y {
            return proof.equal("nothing", x * y, y * x);
        }
        proof.not_negative_by_path("x² + y² − xy", x * x + y * y - x * y)
    });
    assert!(matches!(&refusal, Refusal::Vacuous(path) if path.contains("< 0")), "{refusal}");
    let found = proved(|proof| {
        let (x, y, one, half) = (Exact::real("x"), Exact::real("y"), Exact::one(), Exact::half());
        let form = x * x + y * y - x * y;
        let below = form < Exact::zero();
        proof.not_negative("the form", form, one, &[(half, x), (half, y), (half, x - y)])?;
        assert!(below || form >= Exact::zero(), "no third path");
        Ok(())
    });
    assert_eq!((found.paths, found.covered), (2, 1));
}

/// Where two values are equal there is a point too: x² = 2 is one.
#[test]
fn a_path_on_which_two_values_are_equal_is_tried_at_points() {
    let found = proved(|proof| {
        let x = Exact::positive("x");
        if x * x == Exact::two() {
            return proof.not_negative_by_path("x² ≥ 2", x * x - Exact::two());
        }
        proof.equal("x", x * x / x, x)
    });
    assert_eq!((found.paths, found.covered), (2, 2));
    let refusal = refused(|proof| {
        let x = Exact::positive("x");
        if x * x == Exact::two() {
            return proof.equal("x is 1", x, Exact::one());
        }
        proof.equal("x", x * x / x, x)
    });
    assert!(matches!(&refusal, Refusal::Refuted { at, .. } if at == "x = 1.414214"), "{refusal}");
}

/// π is the same in every run, an indeterminate is not.
#[test]
fn the_half_turn_is_no_angle_of_its_own() {
    proved(|proof| {
        let (sin, cos) = Exact::PI.sin_cos();
        proof.equal("sin π", sin, Exact::zero())?;
        proof.equal("cos π", cos, -Exact::one())
    });
}

/// What may be empty is told too, and is no leave to claim nothing.
#[test]
fn a_path_that_may_be_empty_still_has_to_show_its_claim() {
    let below_nothing = |claims: fn(&mut Proof, Exact) -> Result<(), Refusal>| {
        prove(move |proof| {
            let (x, y) = (Exact::real("x"), Exact::real("y"));
            let form = x * x + y * y - x * y;
            proof.may_be_empty("a form that is never negative");
            if form < Exact::zero() { claims(proof, form) } else { proof.not_negative_by_path("the form", form) }
        })
    };
    let found = below_nothing(|proof, form| proof.positive_by_factors("−form", -form)).expect("it holds");
    assert_eq!((found.paths, found.covered, found.unvisited.values().sum()), (2, 1, 1));
    let silent = below_nothing(|_, _| Ok(())).expect_err("nothing is claimed");
    assert!(matches!(silent, Refusal::Silent(_)), "{silent}");
    let false_there = below_nothing(|proof, form| proof.positive_by_factors("form", form)).expect_err("not shown");
    assert!(matches!(false_there, Refusal::Unproved { .. }), "{false_there}");
}
