//! Sensors of which blocks of rows were held out: they turn on there, further than their angle tells.

use cvg_calibration::recording::{Campaign, Recording, Role};
use cvg_tests::angle_sensor::{Noise, find, held_out, identified, run, sensor};

/// A robot that turns on the spot by 27° a row, with every third block of its rows held out: it turns further than half a turn there.
#[test]
fn an_angle_is_followed_through_blocks_that_were_held_out() {
    for block in [7, 10, 16] {
        for stated in [Some(1.0), None] {
            let mut noise = Noise::new(block);
            let error = |a: f64| 5.0 * a.to_radians().sin() + 4.0 * (2.0 * a.to_radians()).cos();
            let mut of = |held: bool, role| {
                let rows: Vec<f64> =
                    (0..21 * block).filter(|row| (row / block % 3 == 2) == held).map(|row| row as f64).collect();
                let angles: Vec<f64> = rows.iter().map(|row| 27.3 * row).collect();
                let read = |a: &f64| (a + error(*a) + 0.5 * noise.sample()).rem_euclid(360.0);
                let recording = Recording {
                    t_s: rows.iter().map(|row| 0.5 * row).collect(),
                    theta_deg: Some(angles.iter().map(read).collect()),
                    table_deg: Some(angles),
                    ..Recording::default()
                };
                run("blocks.csv", role, recording)
            };
            let runs = vec![of(false, Role::Fit), of(true, Role::Holdout)];
            let i = identified(Campaign { angular_gain: stated, ..sensor(runs) });
            assert!((i.report.angular_gain.value.abs() - 1.0).abs() < 0.02, "{block}: {:?}", i.report.angular_gain);
            assert!(find(&i, "angle-table").is_some() && held_out(&i) < 1.0, "{block}: {}°", held_out(&i));
        }
    }
}
