//! An hour in time-lapse: everything drifts, something is wrong every half second. A month at its own pace is a bench:
//! `cargo bench -p cvg-tests --bench soak -- HOURS SEED`.

use cvg_tests::bench::{all, trials};
use cvg_tests::soak::{LAPSE, Soak};

/// What a device goes through, s: six make the hour.
const LASTS_S: f64 = 600.0;

//= specs/dsp.md#half-turns
//= type=test
//# Half turns that may be lost MUST be said to be until it is acknowledged.
/// Six devices for ten minutes each. `CVG_TRIALS=1000 cargo test --release -p cvg-tests --test soak -- --nocapture` is longer.
#[test]
fn whatever_happens_the_instrument_is_back_and_half_turns_are_not_lost_in_silence() {
    let soaked = all(trials(6), |seed| {
        let mut soak = Soak::new(seed, LAPSE);
        soak.run(LASTS_S);
        soak
    });
    for (seed, soak) in soaked.iter().enumerate() {
        println!("device {seed}, otherwise off by {:.3} deg at most\n{}", soak.quiet_worst_deg, soak.table());
        assert!(soak.is_well(), "device {seed}");
        assert!(soak.quiet_worst_deg < 0.2, "device {seed}: {} deg", soak.quiet_worst_deg);
    }
    let events: u64 = soaked.iter().flat_map(|s| s.tallies.iter().map(|t| t.events)).sum();
    assert!(events as usize > 60 * soaked.len(), "{events} events");
}
