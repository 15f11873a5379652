//! The instrument for days: `cargo bench -p cvg-tests --bench soak -- [HOURS] [SEED]`, by default a month of the first device.

use cvg_tests::soak::{REAL, Soak};

fn main() {
    let numbers: Vec<f64> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let hours = numbers.first().copied().unwrap_or(720.0);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small number")]
    let seed = numbers.get(1).copied().unwrap_or(1.0) as u64;
    let mut soak = Soak::new(seed, REAL);
    let whole = hours.floor();
    for hour in 0..=whole as u64 {
        soak.run(3600.0 * if hour as f64 == whole { hours - whole } else { 1.0 });
    }
    println!(
        "{hours} hours of device {seed}, otherwise off by {:.4} deg at most\n{}",
        soak.quiet_worst_deg,
        soak.table()
    );
    assert!(soak.is_well(), "see above");
}
