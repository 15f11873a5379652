//! No confident lie: small random campaigns with known values, damaged at random. An answer whose 99.9 % interval misses by
//! more than its width is a lie.

use std::collections::BTreeMap;

use cvg_tests::bench::{all, trials};
use cvg_tests::broken::lies::{Outcome, of_number};

/// Share of the campaigns that may be answered with a lie.
const LIES: f64 = 1e-3;

/// The same, said at once where it is a lie: ten thousand campaigns take their time.
fn told(number: u64) -> Outcome {
    let outcome = of_number(number);
    if outcome.is_lie {
        println!("a lie: {}", outcome.what);
    }
    outcome
}

/// The number that a variable of the environment is set to.
fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().and_then(|n| n.parse().ok())
}

/// More campaigns: `CVG_TRIALS=10000`, others: `CVG_FIRST=10000`; `CVG_TRIAL=17` shows one. `CVG_DAMAGE=hum` does this to all
/// that are damaged.
#[test]
fn damaged_campaigns_are_not_lied_about() {
    if let Some(number) = number("CVG_TRIAL") {
        println!("{}", of_number(number).what);
        return;
    }
    let first = number("CVG_FIRST").unwrap_or(0);
    let outcomes = all(trials(120), |n| told(first + n));
    let mut table: BTreeMap<&str, [usize; 3]> = BTreeMap::new();
    for o in &outcomes {
        let row = table.entry(o.damage).or_default();
        *row = [row[0] + 1, row[1] + usize::from(o.is_answered), row[2] + usize::from(o.is_lie)];
    }
    for (damage, [all, answered, lies]) in &table {
        println!("{damage}: {all} campaigns, {answered} answered, {lies} lies");
    }
    let lies: Vec<&Outcome> = outcomes.iter().filter(|o| o.is_lie).collect();
    let answers = outcomes.iter().filter(|o| o.is_answered).count();
    let silent = lies.iter().filter(|o| o.is_silent).count();
    println!(
        "{} campaigns, {answers} answered, {} lies, {silent} without a word of the damage",
        outcomes.len(),
        lies.len()
    );
    for o in outcomes.iter().filter(|o| !o.is_answered && o.damage == "nothing") {
        println!("refused though sound: {}", o.what);
    }
    assert_eq!(silent, 0, "lies without a word of the damage");
    assert!(lies.len() as f64 <= LIES * outcomes.len() as f64, "{} lies", lies.len());
    assert!(answers as f64 > 0.3 * outcomes.len() as f64, "{answers} answers");
}

/// Campaigns that were lied about once, each by a mechanism that was changed since.
#[test]
fn what_was_lied_about_once_is_right_now_or_no_answer() {
    const ONCE: &[u64] =
        &[2_000_043, 2_000_619, 6_001_049, 6_002_243, 6_006_326, 6_007_175, 6_008_274, 7_000_014, 8_000_313];
    if std::env::var_os("CVG_DAMAGE").is_some() {
        // the same numbers are other campaigns then
        return;
    }
    for number in ONCE {
        let outcome = of_number(*number);
        assert!(!outcome.is_lie, "{}", outcome.what);
    }
}
