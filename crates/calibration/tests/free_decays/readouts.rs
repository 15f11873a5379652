//! What a readout adds that is not in the paper, springs of the fourth harmonic, and rates that vary: named where decays tell
//! it, held by the intervals where they do not.

use cvg_calibration::recording::{Campaign, Recording};
use cvg_calibration::report::Report;
use cvg_calibration::{Options, Refusal, identify};
use cvg_model::resonator::Anisotropy;

use crate::ring::Ring;
use crate::{ANGLES, BOTH_WAYS, SPLIT, discovered, is_within, parameter, set_values};

/// Decays at these rates, each row of which is read so: the time, and (x_c, x_s, y_c, y_s).
fn read(
    ring: &Ring,
    rates_dps: &[f64],
    seed: u64,
    reading: impl Fn(f64, [f64; 4]) -> [f64; 4],
) -> Result<Report, Refusal> {
    let folder = tempfile::tempdir().unwrap();
    let path = ring.campaign_at(folder.path(), &ANGLES, rates_dps, seed);
    let mut campaign = Campaign::open(&path).unwrap();
    for run in &mut campaign.runs {
        let Recording { t_s, xc_v: Some(xc), xs_v: Some(xs), yc_v: Some(yc), ys_v: Some(ys), .. } = &mut run.recording
        else {
            panic!("four channels")
        };
        for (i, t) in t_s.iter().enumerate() {
            [xc[i], xs[i], yc[i], ys[i]] = reading(*t, [xc[i], xs[i], yc[i], ys[i]]);
        }
    }
    identify(campaign, &Options::default()).map(|i| i.report)
}

fn short() -> Ring {
    Ring { rows: 400, row_s: 0.1, noise_v: 3e-4, ..Ring::usual() }
}

fn assert_right(report: &Report, of: &str) {
    for (set, e) in set_values(report) {
        assert!((e.value - set).abs() < 1.5 * e.half_width(), "{of}: {set}: {e:?}");
    }
}

#[test]
fn offsets_of_a_demodulator_are_found_and_taken_out() {
    let offset = [1e-3, -5e-4, 3e-4, 8e-4];
    for (seed, ahead_rad_s) in [(1, 0.3), (2, 0.0)] {
        let ring = Ring { ahead_rad_s, ..short() };
        let add = |_, z: [f64; 4]| [0, 1, 2, 3].map(|k| z[k] + offset[k]);
        let report = read(&ring, &BOTH_WAYS, seed, add).unwrap();
        assert_eq!(discovered(&report), ["detection-offset"]);
        assert_right(&report, "offset");
        let names = ["offset_x", "offset_x_quadrature", "offset_y", "offset_y_quadrature"];
        for (name, set) in names.into_iter().zip(offset) {
            let e = parameter(&report, "detection-offset", name);
            assert!((e.value - set).abs() < 2.0 * e.half_width() && e.half_width() < 2e-4, "{name}: {e:?}");
        }
    }
}

#[test]
fn a_cubic_readout_is_told_from_damping_that_grows() {
    let kappa = 0.004;
    let bent = |_, [xc, xs, yc, ys]: [f64; 4]| {
        let gain = |c: f64, s: f64| 1.0 + 0.75 * kappa * (c * c + s * s);
        let (x, y) = (gain(xc, xs), gain(yc, ys));
        [x * xc, x * xs, y * yc, y * ys]
    };
    let report = read(&short(), &BOTH_WAYS, 1, bent).unwrap();
    assert_eq!(discovered(&report), ["detection-cubic"]);
    assert_right(&report, "cubic");
    let e = parameter(&report, "detection-cubic", "kappa");
    assert!((e.value - kappa).abs() < 2.0 * e.half_width() && e.half_width() < 0.2 * kappa, "{e:?}");
}

#[test]
fn a_spring_of_the_fourth_harmonic_is_found_and_named() {
    let ring = Ring { spring_four: [2e-3, -1e-3], ..short() };
    let report = read(&ring, &BOTH_WAYS, 1, |_, z| z).unwrap();
    assert_eq!(discovered(&report), ["spring-cubic"]);
    assert_right(&report, "spring");
    let p = parameter(&report, "spring-cubic", "p");
    assert!((p.value - 2e-3f64.hypot(1e-3)).abs() < 2.0 * p.half_width(), "{p:?}");
}

#[test]
fn at_one_rate_the_intervals_hold_unequal_gains_and_oblique_axes_that_are_not_seen() {
    // hardly a split, so that the one trace of a readout is hardly seen
    let mut ring = short();
    ring.resonator.anisoelasticity = Anisotropy::new(1e-3, -0.7);
    for (seed, ratio, skew) in [(1, 1.0132, 0.0), (2, 0.99, 0.006), (3, 1.0, -0.012)] {
        let reading = |_, [xc, xs, yc, ys]: [f64; 4]| [xc, xs, ratio * (yc + skew * xc), ratio * (ys + skew * xs)];
        let report = read(&ring, &[10.0], seed, reading).unwrap();
        let damping = parameter(&report, "anisodamping", "anisodamping");
        assert!(is_within(4.7e-3, &damping) && damping.half_width() > 2e-3, "{damping:?}");
        let said = |w: &String| w.contains("the intervals hold gains and axes that are 2.6 % off");
        assert!(report.warnings.iter().any(said), "{:?}", report.warnings);
    }
}

#[test]
fn a_frequency_that_follows_energy_does_so_by_the_energy_of_the_vibration() {
    let ring = Ring { spring: 0.01, frequency_per_energy: -0.03, gain_ratio: 1.03, ..short() };
    let report = read(&ring, &BOTH_WAYS, 3, |_, z| z).unwrap();
    let per_energy = parameter(&report, "spring-isotropic", "frequency_per_energy");
    assert!((per_energy.value + 0.03).abs() < 2.0 * per_energy.half_width(), "{per_energy:?}");
}

#[test]
fn a_rate_that_varies_turns_the_pattern_by_what_it_turns() {
    let folder = tempfile::tempdir().unwrap();
    let ring = Ring { speeds_up: true, ..short() };
    let path = ring.campaign_at(folder.path(), &ANGLES, &BOTH_WAYS, 1);
    let told = |as_table: bool| {
        let mut campaign = Campaign::open(&path).unwrap();
        for (at, run) in campaign.runs.iter_mut().enumerate() {
            let (r, end_s) = (&mut run.recording, ring.end_s());
            let of_t = |of: fn(f64, f64) -> f64| r.t_s.iter().map(|t| BOTH_WAYS[at % 2] * of(*t, end_s)).collect();
            let (rate, table) = (of_t(|t, end| t / end), of_t(|t, end| 0.5 * t * t / end));
            (r.rate_dps, r.table_deg) = if as_table { (None, Some(table)) } else { (Some(rate), None) };
        }
        identify(campaign, &Options::default()).unwrap().report
    };
    for report in [told(false), told(true)] {
        assert_right(&report, "speeds up");
        assert!(report.angular_gain.half_width() < 2e-3, "{:?}", report.angular_gain);
    }
}

#[test]
fn what_does_not_decay_is_refused() {
    let mut ring = Ring { noise_v: 1e-2, ..short() };
    ring.resonator = cvg_model::resonator::Resonator {
        damping_per_s: 0.0,
        anisodamping: Anisotropy::new(0.0, 0.0),
        anisoelasticity: Anisotropy::new(SPLIT, -0.7),
        ..ring.resonator
    };
    let refusal = read(&ring, &BOTH_WAYS, 1, |_, z| z).map(|r| r.decay).unwrap_err();
    assert!(refusal.to_string().contains("no decays that are seen"), "{refusal}");
}
