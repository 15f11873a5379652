//! What a recording at the carrier takes: its columns as numbers of eight bytes, and no copy of them. A test that measures its own
//! process stands alone in it.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fmt::Write as _;
use std::fs;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use cvg_calibration::recording::{Campaign, limit_memory};
use cvg_cli::service::{self, Settings};
use tempfile::TempDir;

const SAMPLE_HZ: f64 = 200_000.0;
const ROWS: u32 = 4_000_000;
/// t_s, x_v and y_v, 8 bytes each.
const BYTES_A_ROW: u64 = 24;
/// What the program takes beside: its code, the spectrum in which the carrier is found, the envelopes and what is identified of them.
const BESIDE: u64 = 40_000_000;

/// A line of this process's status, bytes.
fn status(line: &str) -> u64 {
    let text = fs::read_to_string("/proc/self/status").unwrap();
    let value = text.lines().find_map(|l| l.strip_prefix(line)).unwrap();
    value.trim_start_matches(':').trim().trim_end_matches(" kB").parse::<u64>().unwrap() * 1024
}

/// Most memory that this process has had since `from`.
fn most(from: &str) -> u64 {
    let peak = status("VmHWM");
    println!("{from}: {} MB", peak / 1_000_000);
    peak
}

/// Two rotations of 20 s at 200 kS/s as raw numbers, x_v and y_v.
fn campaign(folder: &Path) -> PathBuf {
    let mut text = "[campaign]\ndevice = \"scope\"\ncarrier_hz = 15213.7\n".to_owned();
    for rate_dps in [500.0_f64, -500.0] {
        let name = format!("rot{rate_dps:+}.f32");
        let mut file = BufWriter::new(fs::File::create(folder.join(&name)).unwrap());
        let mut seed = 1_u32;
        let mut noise = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            2e-4 * (f64::from(seed) / f64::from(u32::MAX) - 0.5)
        };
        for row in 0..ROWS {
            let t_s = f64::from(row) / SAMPLE_HZ;
            let theta = 0.3 - 0.78 * rate_dps.to_radians() * t_s;
            let carrier = (std::f64::consts::TAU * 15_213.7 * t_s).cos();
            for volts in [theta.cos() * carrier + noise(), 1.0132 * theta.sin() * carrier + noise()] {
                #[allow(clippy::cast_possible_truncation, reason = "what the file holds")]
                file.write_all(&(volts as f32).to_le_bytes()).unwrap();
            }
        }
        file.flush().unwrap();
        let _ = write!(
            text,
            "[[run]]\nkind = \"rotation\"\nfile = \"{name}\"\nrate_dps = {rate_dps:?}\n\
             raw = {{ number = \"f32\", sample_hz = {SAMPLE_HZ:?}, columns = [\"x_v\", \"y_v\"] }}\n"
        );
    }
    let path = folder.join("campaign.toml");
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_campaign_at_the_carrier_takes_no_more_than_one_of_its_recordings_and_is_refused_before() {
    let folder = TempDir::new().unwrap();
    let path = campaign(folder.path());
    let files = std::slice::from_ref(&path);
    let one = BYTES_A_ROW * u64::from(ROWS);
    let before = most("before");

    limit_memory(one - 1);
    let refused = service::campaign_of_files(files, &[], &Settings::default()).unwrap_err().to_string();
    assert!(refused.contains("96 MB of memory, 95 MB are allowed"), "{refused}");
    assert!(most("refused") < before + 4_000_000);

    limit_memory(one);
    let campaign = service::campaign_of_files(files, &[], &Settings::default()).unwrap();
    let answered = service::answer(campaign, Vec::new(), &|_| {}).unwrap();
    assert!(answered.json().contains("\"detection_gain_ratio\": {\n    \"value\": 1.0132"), "{}", answered.json());
    assert!(most("identified") < before + one + BESIDE);

    // what is not demodulated has both, and a column more that the rate is put in
    assert!(Campaign::open(&path).unwrap_err().to_string().contains("the recording with its rate would take"));
    limit_memory(BYTES_A_ROW / 3 * 4 * u64::from(ROWS));
    assert_eq!(Campaign::open(&path).unwrap().runs.len(), 2);
    assert!(most("opened as it is") > before + 2 * one);
}
