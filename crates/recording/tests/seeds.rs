//! What the readers' fuzz targets hold of any bytes holds of their seeds. Beside `tests/tests/bytes.rs`, which changes the seeds
//! of all targets, so that the readers' lines that seeds reach can be counted without a crate above them (`.ci/readers`).
//! `CVG_SEEDS` names another folder than `fuzz/seeds`, as a corpus is.
#![cfg(all(feature = "hdf5", feature = "matlab", feature = "parquet"))]
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

#[allow(unreachable_pub, reason = "a module of a library elsewhere")]
#[path = "../../../fuzz/src/campaign.rs"]
mod campaign;
#[allow(unreachable_pub, reason = "a module of a library elsewhere")]
#[path = "../../../fuzz/src/container.rs"]
mod container;
#[allow(unreachable_pub, reason = "a module of a library elsewhere")]
#[path = "../../../fuzz/src/csv.rs"]
mod csv;

fn holds_on_its_seeds(name: &str, run: fn(&[u8])) {
    let ours = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds");
    let seeds = std::env::var_os("CVG_SEEDS").map_or(ours, PathBuf::from);
    let mut count = 0;
    for entry in std::fs::read_dir(seeds.join(name)).unwrap() {
        run(&std::fs::read(entry.unwrap().path()).unwrap());
        count += 1;
    }
    assert!(count > 0, "{name} has no seeds");
}

#[test]
fn campaigns_hold_on_their_seeds() {
    holds_on_its_seeds("campaign", campaign::run);
}

#[test]
fn containers_hold_on_their_seeds() {
    holds_on_its_seeds("container", container::run);
}

#[test]
fn texts_hold_on_their_seeds() {
    holds_on_its_seeds("csv", csv::run);
}
