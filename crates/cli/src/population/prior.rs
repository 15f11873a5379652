//! What the fleet says of a device beforehand, and what comes of both (empirical Bayes).
//!
//! It is asked for, states itself, and changes no report and no calibration. Each quantity is taken by itself: a fleet says
//! nothing of how the errors of one campaign go together. A device that is odd in anything, or whose value is far from the
//! others', keeps what its own campaign says: the fleet is no witness against it.

use std::collections::BTreeMap;

use super::spread::{Measured, Spread};
use super::{Device, Population};

/// What is said of it wherever it is.
pub(crate) const STATEMENT: &str = "a prior from the fleet: each device's values with what the others say beforehand; every \
    report.json and calibration.toml is without it";
/// Devices from which on a fleet says something beforehand.
const FEWEST: usize = 20;
/// A value that fewer than one in so many devices would have is not pulled to the others.
const ONE_IN: f64 = 100.0;
/// Half of a 95 % interval, in standard deviations.
const HALF: f64 = 1.96;
/// A quantity that this share of the devices has is expected of the rest.
const EXPECTED: f64 = 0.9;

/// A quantity of a device with and without what the fleet says.
pub(crate) struct Posterior {
    pub(crate) device: usize,
    pub(crate) quantity: String,
    /// what the campaign says alone; none where it does not tell
    pub(crate) own: Option<Measured>,
    /// what the fleet says: centre, and how far a device may be off it
    pub(crate) fleet: Measured,
    /// both together; the device's own where the fleet is not asked
    pub(crate) both: Option<Measured>,
    /// share of the device's own campaign in it
    pub(crate) of_own: f64,
    /// why the fleet is not asked
    pub(crate) not_applied: Option<&'static str>,
}

impl Posterior {
    /// Ends of the 95 % interval.
    pub(crate) fn ends(m: Measured) -> [f64; 2] {
        [m.value - HALF * m.error, m.value + HALF * m.error]
    }
}

/// What the fleet adds to every device with an answer.
pub(crate) fn posteriors(population: &Population, devices: &[Device]) -> Vec<Posterior> {
    let mut out = Vec::new();
    for (name, line) in &population.lines {
        let is_measured = line.values.iter().any(|(_, m)| m.error > 0.0);
        let Some(spread) = line.spread.as_ref().filter(|_| is_measured && line.values.len() >= FEWEST) else {
            continue;
        };
        // those of effects are missing where there is no effect
        let expected = !name.contains('.') && line.values.len() as f64 >= EXPECTED * population.answered as f64;
        let values: BTreeMap<usize, Measured> = line.values.iter().copied().collect();
        for at in (0..devices.len()).filter(|at| devices[*at].has_answer()) {
            let own = values.get(&at).copied();
            if own.is_none() && !expected {
                continue;
            }
            let is_odd = !population.odd[at].is_empty();
            let (fleet, both, of_own, not_applied) = posterior(spread, own, is_odd, line.group > 0);
            out.push(Posterior { device: at, quantity: name.clone(), own, fleet, both, of_own, not_applied });
        }
    }
    out
}

type Both = (Measured, Option<Measured>, f64, Option<&'static str>);

/// The posterior of two normal distributions, or why there is none: mean weighted by the inverse variances, whose sum is the
/// inverse variance of it.
fn posterior(spread: &Spread, own: Option<Measured>, is_odd: bool, is_split: bool) -> Both {
    let fleet = Measured { value: spread.centre, error: spread.between_at_most.hypot(spread.centre_error) };
    let far = own.is_some_and(|m| spread.chance(m) * ONE_IN < 1.0);
    let why = match (is_odd, is_split, far) {
        (true, _, _) => Some("the device is odd"),
        (_, true, _) => Some("the fleet has groups"),
        (_, _, true) => Some("far from the others"),
        _ => None,
    };
    match (own, why) {
        (own, Some(why)) => (fleet, own, 1.0, Some(why)),
        (None, None) => (fleet, Some(fleet), 0.0, None),
        (Some(own), None) => {
            let (of_fleet, of_own) = (fleet.error.powi(-2), own.error.powi(-2));
            let share = if of_own.is_infinite() { 1.0 } else { of_own / (of_own + of_fleet) };
            let value = share * own.value + (1.0 - share) * fleet.value;
            (fleet, Some(Measured { value, error: share.sqrt() * own.error }), share, None)
        }
    }
}
