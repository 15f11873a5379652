//! The exact engine refuses what it must: false claims with a point, divisions and roots that nobody paid for,
//! certificates that do not add up, proofs about nothing.

use cvg_model::{Float, Real};
use cvg_prover::{Exact, Proof, Refusal, prove};

type Claim = fn(&mut Proof) -> Result<(), Refusal>;

fn proved(claim: Claim) {
    prove(claim).expect("it holds");
}

fn refused(claim: Claim) -> Refusal {
    prove(claim).expect_err("it does not hold")
}

#[test]
fn the_addition_theorems_hold() {
    proved(|proof| {
        let (a, b) = (Exact::angle("a"), Exact::angle("b"));
        let ((sa, ca), (sb, cb)) = (a.sin_cos(), b.sin_cos());
        let (sin, cos) = (a - Exact::two() * b).sin_cos();
        let (s2, c2) = (Exact::two() * sb * cb, cb * cb - sb * sb);
        proof.equal("sin(a − 2b)", sin, sa * c2 - ca * s2)?;
        proof.equal("cos(a − 2b)", cos, ca * c2 + sa * s2)?;
        let (sin, cos) = (a + Exact::quarter_turn()).sin_cos();
        proof.equal("sin(a + 90°)", sin, ca)?;
        proof.equal("cos(a + 90°)", cos, -sa)?;
        proof.equal("sin²", (Exact::PI - a).sin_cos().0, sa)
    });
}

#[test]
fn a_false_equality_is_refuted_at_a_point() {
    let refusal = refused(|proof| {
        let x = Exact::real("x");
        proof.equal("x² = x", x * x, x)
    });
    assert!(
        matches!(&refusal, Refusal::Refuted { claim, at } if claim == "x² = x" && at.starts_with("x = ")),
        "{refusal}"
    );
}

#[test]
fn an_equality_that_holds_on_the_circle_only_is_refuted_off_it() {
    proved(|proof| {
        let (sin, cos) = Exact::angle("a").sin_cos();
        proof.equal("1", sin * sin + cos * cos, Exact::one())
    });
    refused(|proof| {
        let (sin, cos) = (Exact::real("s"), Exact::real("c"));
        proof.equal("1", sin * sin + cos * cos, Exact::one())
    });
}

#[test]
fn a_division_by_what_may_be_zero_is_refused() {
    let claim: Claim = |proof| {
        let x = Exact::real("x");
        proof.equal("x/x = 1", x / x, Exact::one())
    };
    assert_eq!(refused(claim), Refusal::Division("x".into()));
    proved(|proof| {
        let x = Exact::nonzero("x");
        proof.equal("x/x = 1", x / x, Exact::one())
    });
}

#[test]
fn a_root_of_what_may_be_negative_is_refused() {
    let claim: Claim = |proof| {
        let x = Exact::real("x");
        proof.equal("(√x)² = x", x.sqrt().squared(), x)
    };
    assert_eq!(refused(claim), Refusal::Root("x".into()));
    proved(|proof| {
        let x = Exact::positive("x");
        proof.equal("(√x)² = x", x.sqrt().squared(), x)?;
        proof.equal("√x² = x", (x * x).sqrt(), x)
    });
    // √x² = |x|, which is not x where x may be negative
    refused(|proof| {
        let x = Exact::nonzero("x");
        proof.equal("√x² = x", (x * x).sqrt(), x)
    });
}

#[test]
fn a_certificate_that_does_not_add_up_proves_nothing() {
    let refusal = refused(|proof| {
        let x = Exact::real("x");
        // x² + 1 > 0 is true, but not for this reason
        proof.positive("x² + 1", x * x + Exact::one(), Exact::one(), Exact::one(), &[(Exact::two(), x)])
    });
    assert!(matches!(refusal, Refusal::Unproved { .. }), "{refusal}");
}

#[test]
fn a_certificate_with_a_weight_of_unknown_sign_proves_nothing() {
    let refusal = refused(|proof| {
        let (x, w) = (Exact::real("x"), Exact::real("w"));
        proof.not_negative("w x²", w * x * x, Exact::one(), &[(w, x)])
    });
    assert!(matches!(refusal, Refusal::Refuted { .. }), "{refusal}");
}

#[test]
fn a_claim_of_sign_that_fails_somewhere_is_refuted() {
    let refusal = refused(|proof| proof.positive_by_factors("x > 0", Exact::nonzero("x")));
    assert!(matches!(refusal, Refusal::Refuted { .. }), "{refusal}");
}

#[test]
fn a_proof_about_nothing_is_refused() {
    let refusal = refused(|proof| {
        let x = Exact::positive("x");
        proof.assume_positive(-x)?;
        proof.positive_by_factors("x < 0", -x)
    });
    assert!(matches!(refusal, Refusal::Vacuous(_)), "{refusal}");
}

#[test]
fn every_order_of_a_comparison_is_walked() {
    let claim: Claim = |proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        let size = if x < one { one - x } else { x - one };
        proof.equal("|x − 1|²", size * size, (x - one) * (x - one))
    };
    assert_eq!(prove(claim).expect("it holds").paths, 2);
    // wrong on one of them only
    let refusal = refused(|proof| {
        let (x, one) = (Exact::real("x"), Exact::one());
        let size = if x > one { one - x } else { x - one };
        proof.equal("1 − x", size, x - one)
    });
    assert!(matches!(refusal, Refusal::Refuted { .. }), "{refusal}");
}

#[test]
fn a_comparison_is_remembered_on_its_path() {
    let claim: Claim = |proof| {
        let (x, y) = (Exact::real("x"), Exact::real("y"));
        let before = x < y;
        let same = Exact::two() * y > Exact::two() * x;
        assert_eq!(before, same, "2y > 2x is x < y");
        if before { proof.positive_by_factors("y − x", y - x) } else { proof.not_negative_by_path("x − y", x - y) }
    };
    assert_eq!(prove(claim).expect("it holds").paths, 2);
}

#[test]
fn an_arctangent_is_its_point() {
    proved(|proof| {
        let (x, y) = (Exact::positive("x"), Exact::real("y"));
        let angle = y.atan2(x);
        proof.positive("x² + y²", x * x + y * y, Exact::one(), x * x, &[(Exact::one(), y)])?;
        let (sin, cos) = angle.sin_cos();
        proof.equal("tangent", sin / cos, y / x)?;
        let (sin, cos) = (Exact::two() * angle).sin_cos();
        proof.equal("twice", sin * (x * x - y * y), cos * Exact::two() * x * y)
    });
}

#[test]
fn an_angle_is_not_its_opposite() {
    // the cross product of a and a + 180° is zero: the dot product tells them apart
    let refusal = refused(|proof| {
        let a = Exact::angle("a");
        proof.same_angle("a = a + 180°", a, a + Exact::PI, Exact::one(), Exact::one(), &[])
    });
    assert!(matches!(refusal, Refusal::Refuted { .. }), "{refusal}");
}

#[test]
#[should_panic(expected = "not a whole multiple")]
fn a_sine_of_half_an_angle_is_refused() {
    let ended = prove(|proof| {
        let (sin, _) = (Exact::half() * Exact::angle("a")).sin_cos();
        proof.equal("sin", sin, sin)
    });
    drop(ended);
}
