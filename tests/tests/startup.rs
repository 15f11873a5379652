//! From rest to whole-angle mode without help, over the spread of devices that a production line has.

use cvg_tests::bench::{all, trials};
use cvg_tests::carrier::{Ending, random_start};

/// Time that a device has, s.
const TIME_S: f64 = 12.0;

fn summary(endings: &[Ending]) -> (usize, usize, f64) {
    let mut times: Vec<f64> =
        endings.iter().filter_map(|e| if let Ending::WholeAngle(t) = e { Some(*t) } else { None }).collect();
    times.sort_by(f64::total_cmp);
    let faults = endings.iter().filter(|e| matches!(e, Ending::Fault(_))).count();
    (times.len(), faults, times.get(times.len() / 2).copied().unwrap_or(f64::NAN))
}

//= specs/dsp.md#start
//= type=test
//# An instrument at rest MUST reach whole-angle mode or end in a fault with a name.
/// `CVG_TRIALS=1000 cargo test --release -p cvg-tests --test startup -- --nocapture` is the full count.
#[test]
fn devices_start_from_rest_or_end_in_a_named_fault() {
    let count = trials(60);
    let endings = all(count, |seed| random_start::<f32>(seed, TIME_S));
    for (seed, ending) in endings.iter().enumerate().filter(|(_, e)| !matches!(e, Ending::WholeAngle(_))) {
        println!("device {seed}: {ending:?}");
    }
    let (started, faults, median_s) = summary(&endings);
    println!(
        "{started} of {count} devices started, half of them within {median_s:.2} s, {faults} ended in a named fault"
    );
    assert_eq!(started + faults, endings.len(), "some ended in neither");
    assert!(started as f64 >= 0.99 * count as f64, "{started} of {count}");
}

#[test]
fn both_precisions_start_alike() {
    for seed in 0..4 {
        let (single, double) = (random_start::<f32>(seed, TIME_S), random_start::<f64>(seed, TIME_S));
        match (single, double) {
            (Ending::WholeAngle(a), Ending::WholeAngle(b)) => assert!((a - b).abs() < 0.05, "{seed}: {a} and {b} s"),
            other => assert!(matches!(other, (Ending::Fault(_), Ending::Fault(_))), "{seed}: {other:?}"),
        }
    }
}
