//! Whether the count of half turns is still the pattern's.

use cvg_estimator::Movement;

use crate::Continuity;
use crate::continuity::Sight;

fn any_movement() -> Movement {
    match kani::any::<u8>() % 3 {
        0 => Movement::Steady,
        1 => Movement::Jumped,
        _ => Movement::Unknown,
    }
}

fn lost_half_turns_stay_lost(forgiven: bool) {
    let before = Continuity { unseen: kani::any(), counting: kani::any(), lost: kani::any() };
    let sight = Sight {
        valid: kani::any(),
        clear: kani::any(),
        movement: any_movement(),
        interrupted: kani::any(),
        in_operation: kani::any(),
        in_fault: kani::any(),
    };
    let (most_unseen, in_phase) = (kani::any(), kani::any());
    let mut after = before;
    after.see(sight, most_unseen, || in_phase);
    kani::cover!(after.lost && !before.lost, "lost now");
    kani::cover!(after.unseen == u32::MAX, "unseen for ever");
    kani::cover!(!after.lost && before.counting, "not lost");
    assert!(after.lost || !before.lost || forgiven);
    assert!(after.counting || !before.counting);
    let missed = sight.movement == Movement::Jumped || sight.interrupted || sight.in_fault || !in_phase;
    if before.counting && (missed || after.unseen > most_unseen) {
        kani::cover!(!before.lost && after.unseen > most_unseen, "missed for too long");
        assert!(after.lost != forgiven);
    }
}

//= specs/dsp.md#half-turns
//# Half turns that may be lost MUST be said to be until it is acknowledged.
/// What [`Continuity::see`] takes for lost stays lost; once the count means something, each jump, interruption and fault, each
/// phase that was far off and too many windows unseen in a row make it so; nothing overflows: from any state, for any window.
#[kani::proof]
#[kani::solver(minisat)]
pub fn proof_lost_half_turns_stay_lost() {
    lost_half_turns_stay_lost(false);
}

/// It is claimed to be forgiven.
#[kani::proof]
#[kani::solver(minisat)]
#[kani::should_panic]
pub fn twin_lost_half_turns_stay_lost() {
    lost_half_turns_stay_lost(true);
}
