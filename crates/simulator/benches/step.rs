//! One control step of the closed loop (plant, estimator, controllers, drives), without noise and readout effects.
//!
//! `benches/step.py` at the root of the repository times the same loop compiled by numba.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use cvg_simulator::{ClosedLoop, Scenario};

const STEPS: u64 = 10_000;

/// The paper's mechanics and drives at 500 deg/s.
const SCENARIO: &str = r#"
device = "bench"
angular_gain = 0.78
effects = [
  { id = "anisodamping", anisodamping = 4.7e-3, theta_tau = 27.0 },
  { id = "anisoelasticity", anisoelasticity = 0.25132741, theta_omega = 55.0 },
  { id = "actuation-gain-mismatch", actuation_gain_ratio = 1.0113 },
]
[[run]]
kind = "rotation"
file = "bench.csv"
rate_dps = 500.0
duration_s = 1.0
start_deg = 10.0
"#;

fn closed_loop(text: &str) -> ClosedLoop {
    Scenario::parse(text).ok().and_then(|s| s.closed_loop(0)).expect("the bench's scenario is a gyroscope's")
}

fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("closed loop");
    group.throughput(Throughput::Elements(STEPS));
    group.bench_function("10 000 steps", |bencher| {
        let mut closed = closed_loop(SCENARIO);
        bencher.iter(|| {
            for _ in 0..STEPS {
                closed.step();
            }
            black_box(*closed.seen())
        });
    });
    group.finish();
}

criterion_group!(benches, step);
criterion_main!(benches);
