//! What must hold of bytes that come from outside, a function for each kind. libFuzzer calls them with what it invents
//! (`fuzz_targets/`), an ordinary test with the seeds and what a few changes make of them (`tests/tests/bytes.rs`).

mod calibration;
mod campaign;
mod container;
mod csv;
mod effect;
mod identify;
mod lie;
mod scenario;
mod step;

/// Takes any bytes; panics where something does not hold.
pub type Target = fn(&[u8]);

/// Every target, by the name of its folder of seeds.
pub const TARGETS: &[(&str, Target)] = &[
    ("calibration", calibration::run),
    ("campaign", campaign::run),
    ("container", container::run),
    ("csv", csv::run),
    ("effect", effect::run),
    ("identify", identify::run),
    ("lie", lie::run),
    ("scenario", scenario::run),
    ("step", step::run),
];

/// The target of that name.
///
/// # Panics
/// Where there is none.
pub fn target(name: &str) -> Target {
    TARGETS.iter().find(|(other, _)| *other == name).map(|(_, run)| *run).expect("a target of that name")
}
