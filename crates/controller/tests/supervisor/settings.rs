//! What a supervisor is built from, and what is refused.

use super::*;

#[test]
fn settings_that_are_no_positive_numbers_are_refused_by_name() {
    type Change = fn(&mut SupervisorSettings, f64);
    let fields: [(&str, Change); 4] = [
        ("window_s", |s, v| s.window_s = v),
        ("amplitude_v", |s, v| s.amplitude_v = v),
        ("detection_threshold_v", |s, v| s.detection_threshold_v = v),
        ("band_rad_s", |s, v| s.band_rad_s = v),
    ];
    for (name, change) in fields {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut s = settings();
            change(&mut s, bad);
            assert_eq!(Supervisor::<f64>::new(&s).map_err(|e| e.parameter), Err(name), "{bad}");
        }
    }
}

#[test]
fn what_is_heard_has_to_lie_below_a_third_of_the_set_amplitude() {
    let new = |detection_threshold_v| {
        Supervisor::<f64>::new(&SupervisorSettings { amplitude_v: 3.0, detection_threshold_v, ..settings() })
            .map_err(|e| e.parameter)
    };
    assert!(new(0.999).is_ok());
    assert_eq!(new(1.0), Err("detection_threshold_v"));
    assert_eq!(new(1.001), Err("detection_threshold_v"));
}

#[test]
fn a_time_is_a_window_at_least_and_fewer_than_two_to_the_31() {
    type Change = fn(&mut SupervisorSettings, f64);
    let fields: [(&str, Change); 8] = [
        ("sweep_s", |s, v| s.sweep_s = v),
        ("listen_s", |s, v| s.listen_s = v),
        ("lock_s", |s, v| s.lock_s = v),
        ("spin_up_s", |s, v| s.spin_up_s = v),
        ("coast_s", |s, v| s.coast_s = v),
        ("fault_debounce_s", |s, v| s.fault_debounce_s = v),
        ("rest_s", |s, v| s.rest_s = v),
        ("fault_memory_s", |s, v| s.fault_memory_s = v),
    ];
    let most = f64::from(1_u32 << 31) * WINDOW_S;
    for (name, change) in fields {
        let new = |time_s: f64| {
            let mut s = settings();
            change(&mut s, time_s);
            Supervisor::<f64>::new(&s).map(|_| ()).map_err(|e| e.parameter)
        };
        // what has to see twenty windows in a row takes twenty-two
        let least = if ["lock_s", "spin_up_s"].contains(&name) { 22.0 * WINDOW_S } else { WINDOW_S };
        assert_eq!(new(least), Ok(()), "{name}");
        assert_eq!(new(most - WINDOW_S), Ok(()), "{name}");
        for bad in [least - 0.01 * WINDOW_S, most, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(new(bad), Err(name), "{bad}");
        }
    }
}
