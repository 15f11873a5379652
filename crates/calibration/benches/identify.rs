//! Identification of the paper's campaign through the library: recordings in memory, no reading, no rendering.
//!
//! `benches/identification.py` at the root of the repository sets these times beside those of scipy. The campaigns are
//! written by `cvg simulate`, so that this crate knows nothing of the simulator: with the cubic readout that the
//! declared model lacks, and without it.

use std::cell::Cell;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use cvg_calibration::recording::Campaign;
use cvg_calibration::{Options, identify};

const SCENARIO: &str = include_str!("../../simulator/scenarios/paper.toml");

/// Writes the campaign of a scenario into `folder`.
fn simulate(scenario: &str, folder: &Path) -> PathBuf {
    let file = folder.join("scenario.toml");
    std::fs::write(&file, scenario).expect("the temporary folder can be written to");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .args(["run", "--release", "--quiet", "--package", "cvg", "--", "simulate"])
        .args([file.as_os_str(), "--out".as_ref(), folder.as_os_str()])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status()
        .expect("cargo runs");
    assert!(status.success(), "cvg simulate failed");
    folder.join("campaign.toml")
}

fn open(campaign: &Path) -> Campaign {
    Campaign::open(campaign).expect("a simulated campaign can be read")
}

/// From the first residual to the last step of the declared model's fits: all rounds, with the noise, the spikes and the
/// drive's gains measured in between. What is before it reads and starts, what comes after it reports.
fn fits(campaign: Campaign) -> Duration {
    let (from, to) = (Cell::new(None), Cell::new(None));
    let progress = |step: &str| match step {
        "fitting the declared model" => from.set(Some(Instant::now())),
        "measuring the held-out error" => to.set(Some(Instant::now())),
        _ => {}
    };
    let options = Options { discover: false, progress: &progress, ..Options::default() };
    black_box(identify(campaign, &options).expect("the paper's campaign has an answer"));
    let (from, to): (Option<Instant>, Option<Instant>) = (from.get(), to.get());
    to.expect("the fits end") - from.expect("the fits begin")
}

fn identification(criterion: &mut Criterion) {
    let plain: String = SCENARIO.lines().filter(|l| !l.contains("detection-cubic")).flat_map(|l| [l, "\n"]).collect();
    let mut group = criterion.benchmark_group("identify");
    group.sample_size(20);
    for (name, scenario, discover) in [
        ("cubic, discovery", SCENARIO, true),
        ("nothing to discover, discovery", &plain, true),
        ("nothing to discover, declared model", &plain, false),
    ] {
        let folder = tempfile::tempdir().expect("the system has a folder for temporary files");
        let campaign = simulate(scenario, folder.path());
        let samples: usize = open(&campaign).runs.iter().map(|r| r.recording.len()).sum();
        group.throughput(Throughput::Elements(samples as u64));
        group.bench_function(name, |bencher| {
            let options = Options { discover, ..Options::default() };
            bencher.iter_batched(
                || open(&campaign),
                |campaign| black_box(identify(campaign, &options).expect("the paper's campaign has an answer")),
                BatchSize::LargeInput,
            );
        });
    }
    let folder = tempfile::tempdir().expect("the system has a folder for temporary files");
    let campaign = simulate(&plain, folder.path());
    group.bench_function("nothing to discover, the fits alone", |bencher| {
        bencher.iter_custom(|times| (0..times).map(|_| fits(open(&campaign))).sum());
    });
    group.finish();
}

criterion_group!(benches, identification);
criterion_main!(benches);
