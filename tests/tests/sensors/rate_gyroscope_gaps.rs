//! Rate gyroscopes whose recordings have gaps.

use cvg_calibration::recording::{Campaign, Instrument, Recording, Role};
use cvg_calibration::report::Status;
use cvg_calibration::{Options, identify};
use cvg_tests::angle_sensor::{Noise, find, held_out, run, sensor};

/// Blocks of one recording that are held out leave gaps in both parts, in which the table turns on and the bias goes on to be summed: the drift
/// of 8° over 4 s was a jump that "nothing turned by" and was taken out (0.38° where 0.004° is noise, and 2.8° where the gap was held out), and
/// a table that had turned by 280° had gone 80° back.
#[test]
fn what_a_bias_and_a_table_make_of_a_gap_is_no_jump() {
    // gaps of 2.1 s and 4.1 s after every 4 s and 2 s
    let parts: [fn(usize) -> bool; 2] = [|i| i % 120 < 80, |i| i % 120 >= 80];
    for (bias_dps, turns_deg, seed) in [(2.0, 30.0, 1), (0.5, 30.0, 2), (0.2, 250.0, 3), (0.2, 3000.0, 4)] {
        let mut noise = Noise::new(seed);
        let t_s: Vec<f64> = (0..4800).map(|i| 0.05 * f64::from(i)).collect();
        let table: Vec<f64> =
            t_s.iter().map(|t| turns_deg * (0.3 * t).sin() + 0.2 * turns_deg * (0.11 * t).cos()).collect();
        let read = |(t, a): (&f64, &f64)| 1.003 * a + bias_dps * t + 0.005 * noise.sample();
        let theta: Vec<f64> = t_s.iter().zip(&table).map(read).collect();
        let part = |keeps: fn(usize) -> bool, name: &str, role| {
            let of = |v: &[f64]| (0..v.len()).filter(|i| keeps(*i)).map(|i| v[i]).collect::<Vec<f64>>();
            let (table_deg, theta_deg) = (Some(of(&table)), Some(of(&theta)));
            run(name, role, Recording { t_s: of(&t_s), table_deg, theta_deg, ..Recording::default() })
        };
        let runs = vec![part(parts[0], "fit.csv", Role::Fit), part(parts[1], "held.csv", Role::Holdout)];
        let campaign = Campaign { instrument: Instrument::Gyroscope, angular_gain: None, ..sensor(runs) };
        let i = identify(campaign, &Options::default()).unwrap();
        assert_eq!(i.report.status, Status::Answered, "{bias_dps} {turns_deg}: {:?}", i.report.reason);
        let left = held_out(&i);
        assert!(left < 0.008, "{bias_dps} {turns_deg}: {left}°, {:?}", i.report.warnings);
        assert!(!i.report.warnings.iter().any(|w| w.contains("jumps by")), "{:?}", i.report.warnings);
        assert!(find(&i, "angle-latency").is_none(), "{bias_dps} {turns_deg}");
    }
}
