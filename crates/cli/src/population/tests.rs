//! Populations that are drawn, of which it is known which device is odd.

use std::path::PathBuf;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution as _, StandardNormal, StudentT};
use serde_json::{Value, json};

use super::course::{Change, by_serial_number, change};
use super::*;

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

/// Four quantities of a device, each with a standard error of its own.
struct Drawn {
    values: [Measured; 4],
    effects: Vec<Value>,
    steps: Vec<Value>,
}

impl Drawn {
    fn with(&mut self, id: &str, gain: f64, rivals: &Value) {
        self.effects.push(json!({"id": id, "origin": "discovered", "parameters": []}));
        self.steps.push(json!({"effect": id, "gain": gain, "rivals": rivals}));
    }

    fn device(&self, number: usize) -> Device {
        let estimate =
            |m: Measured| json!({"value": m.value, "ci95": [m.value - 1.96 * m.error, m.value + 1.96 * m.error]});
        let [a, b, c, d] = self.values.map(estimate);
        let report = json!({
            "device": format!("unit-{number}"), "status": "answered", "angular_gain": a, "detection_gain_ratio": b,
            "actuation_gain_ratio": c, "runs": [{"file": "rest.csv", "tau_s": d}], "effects": self.effects,
            "steps": self.steps,
        });
        Device::new(format!("unit-{number}"), PathBuf::new(), report, None)
    }
}

/// A fleet whose quantities scatter by a normal distribution, by heavy tails, one-sidedly, and by nothing but their errors,
/// which differ a hundredfold.
fn fleet(count: usize, seed: u64) -> Vec<Drawn> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let heavy = StudentT::new(3.0).expect("a distribution");
    let drawn = |_| {
        let scatter = [normal(&mut random), heavy.sample(&mut random), (0.3 * normal(&mut random)).exp(), 0.0];
        let value = |scatter: f64| {
            let error = 0.1 * normal(&mut random).clamp(-2.0, 2.0).exp();
            Measured { value: 5.0 + scatter + error * normal(&mut random), error }
        };
        Drawn { values: scatter.map(value), effects: Vec::new(), steps: Vec::new() }
    };
    (0..count).map(drawn).collect()
}

fn population(fleet: &[Drawn]) -> Population {
    Population::of(&fleet.iter().enumerate().map(|(number, drawn)| drawn.device(number)).collect::<Vec<_>>())
}

fn named(population: &Population) -> Vec<usize> {
    (0..population.odd.len()).filter(|at| !population.odd[*at].is_empty()).collect()
}

#[test]
fn fleets_in_which_no_device_is_odd_have_hardly_one_named_whatever_their_tails() {
    for (count, fleets, most) in [(12, 60, 6), (100, 30, 4), (2000, 4, 4)] {
        let named: usize = (0..fleets).map(|seed| named(&population(&fleet(count, seed))).len()).sum();
        assert!(named <= most, "{named} of {count} × {fleets} devices are named");
    }
}

#[test]
fn one_odd_device_in_a_hundred_is_found_and_hides_no_other() {
    let mut all = fleet(2000, 17);
    let odd: Vec<usize> = (0..20).map(|number| 37 + 97 * number).collect();
    for at in &odd {
        // as far as the normal distribution is wide, seven times
        let own = &mut all[*at].values[0];
        own.value += 7.5 * own.error.hypot(1.0);
    }
    let found = named(&population(&all));
    let right = found.iter().filter(|at| odd.contains(at)).count();
    assert!(right >= 19, "{right} of 20");
    assert!(found.len() - right <= 2, "{found:?}");
}

#[test]
fn devices_far_out_are_found_where_some_are_made_less_evenly_than_others() {
    let mut random = ChaCha8Rng::seed_from_u64(21);
    let mut all = fleet(2000, 21);
    for (at, drawn) in all.iter_mut().enumerate() {
        // one in twenty scatters three times as far: tails that a few thousand devices do not tell from a power's
        let width = if at % 20 == 3 { 3.0 } else { 1.0 };
        drawn.values.iter_mut().for_each(|m| *m = Measured { value: 5.0 + width * normal(&mut random), error: 0.05 });
    }
    let odd = [275, 999, 1615];
    odd.iter().for_each(|at| all[*at].values[1].value += 30.0);
    [100, 1200, 1900].iter().for_each(|at| all[*at].values[2].value -= 30.0);
    let found = named(&population(&all));
    assert!(odd.iter().all(|at| found.contains(at)), "{found:?}");
    assert!(found.len() <= 7, "{found:?}");
}

#[test]
fn a_twentieth_of_odd_devices_do_not_mask_one_another() {
    let mut all = fleet(400, 3);
    let odd: Vec<usize> = (0..20).map(|number| 7 + 19 * number).collect();
    odd.iter().for_each(|at| all[*at].values[0].value += 12.0);
    let found = named(&population(&all));
    let right = odd.iter().filter(|at| found.contains(at)).count();
    assert!(right >= 19 && found.len() - right <= 2, "{found:?}");
}

#[test]
fn a_value_that_its_own_error_explains_is_not_odd_and_moves_no_centre() {
    let mut all = fleet(100, 5);
    let mut random = ChaCha8Rng::seed_from_u64(9);
    for drawn in all.iter_mut().take(30) {
        drawn.values[3] = Measured { value: 5.0 + 40.0 * normal(&mut random), error: 40.0 };
    }
    let population = population(&all);
    assert_eq!(named(&population), [0_usize; 0]);
    let line = &population.lines["rest.csv.tau_s"];
    let spread = line.spread.as_ref().expect("a spread");
    assert!((spread.centre - 5.0).abs() < 0.1, "{}", spread.centre);
    assert!(spread.between < 0.05, "their errors are all that they differ by: {}", spread.between);
}

#[test]
fn a_third_of_the_fleet_that_is_apart_is_a_group_and_no_oddity() {
    let mut all = fleet(300, 8);
    all.iter_mut().step_by(3).for_each(|drawn| drawn.values[0].value += 40.0);
    let population = population(&all);
    assert_eq!(named(&population), [0_usize; 0]);
    assert_eq!(population.lines["angular_gain"].group, 100);
}

#[test]
fn an_effect_of_the_board_is_shared_and_one_that_few_have_is_odd() {
    let mut all = fleet(200, 11);
    all.iter_mut().for_each(|drawn| drawn.with("detection-skew", 900.0, &json!([])));
    all[40].with("detection-cubic", 200.0, &json!([]));
    // of two hundred devices one has this much by chance
    all[90].with("time-periodic", 6.0, &json!([]));
    // the board's, under the name of one that is hardly told from it; and one that it was told from
    for (at, beaten) in [(120, 2.0), (130, 900.0)] {
        all[at].effects.clear();
        all[at].steps.clear();
        all[at].with("detection-phase", 300.0, &json!([{"id": "detection-skew", "beaten_by": beaten}]));
    }
    let population = population(&all);
    assert!(population.effects["detection-skew"].is_shared);
    assert!(!population.effects["detection-cubic"].is_shared);
    assert_eq!(named(&population), [40, 130]);
    let of = |at: usize| population.odd[at].iter().map(Oddity::name).collect::<Vec<_>>();
    assert_eq!(of(40), ["detection-cubic"]);
    assert_eq!(of(130), ["detection-phase", "without detection-skew"]);
}

#[test]
fn a_second_effect_of_a_kind_is_one_that_the_others_lack() {
    let mut all = fleet(50, 12);
    all.iter_mut().for_each(|drawn| drawn.with("time-periodic", 900.0, &json!([])));
    all[7].with("time-periodic", 200.0, &json!([]));
    let population = population(&all);
    assert_eq!(named(&population), [7]);
    assert_eq!(population.odd[7][0].name(), "time-periodic (2)");
}

#[test]
fn what_goes_on_along_the_serial_numbers_is_told_from_what_begins_at_one() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let noise: Vec<f64> = (0..60).map(|_| normal(&mut random)).collect();
    assert_eq!(change(&noise, 10), None);
    let drifting: Vec<f64> = noise.iter().enumerate().map(|(at, v)| v + 0.1 * at as f64).collect();
    let Some(Change::Trend { change: by, .. }) = change(&drifting, 10) else { panic!("no trend") };
    assert!((by - 6.0).abs() < 1.5, "{by}");
    let stepping: Vec<f64> = noise.iter().enumerate().map(|(at, v)| v + if at < 40 { 0.0 } else { 4.0 }).collect();
    let Some(Change::Step { from, before, after, .. }) = change(&stepping, 10) else { panic!("no step") };
    assert!((38..=42).contains(&from) && (after - before - 4.0).abs() < 1.0, "{from} {before} {after}");
    // what is far out is no trend
    let mut spikes = noise;
    spikes[58] = 1e6;
    spikes[59] = 1e6;
    assert_eq!(change(&spikes, 10), None);
}

#[test]
fn a_chart_has_its_limits_from_neighbours_so_that_a_drift_leaves_them() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let noise: Vec<f64> = (0..500).map(|_| normal(&mut random)).collect();
    let chart = Chart::of(&noise).expect("a chart");
    assert!((chart.upper - 3.0).abs() < 0.5 && (chart.lower + 3.0).abs() < 0.5, "{chart:?}");
    assert!(chart.outside <= 5 && chart.longest_run < 20, "{chart:?}");
    let drifting: Vec<f64> = noise.iter().enumerate().map(|(at, v)| v + 0.02 * at as f64).collect();
    let chart = Chart::of(&drifting).expect("a chart");
    assert!(chart.outside > 50 && chart.longest_run > 50, "{chart:?}");
    assert_eq!(Chart::of(&[1.0; 20]), None);
}

#[test]
fn serial_numbers_count_as_numbers() {
    let mut names = ["unit-10", "unit-9", "unit-009", "A2", "unit", "unit-11b"];
    names.sort_by(|a, b| by_serial_number(a, b));
    assert_eq!(names, ["A2", "unit", "unit-009", "unit-9", "unit-10", "unit-11b"]);
}

/// A fleet whose gains scatter by `between`, of which `each` campaign tells its own with this error; with what is so.
fn gains(count: usize, between: f64, error: f64, seed: u64) -> (Vec<Drawn>, Vec<f64>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut all = fleet(count, seed);
    let so: Vec<f64> = (0..count).map(|_| 5.0 + between * normal(&mut random)).collect();
    for (drawn, so) in all.iter_mut().zip(&so) {
        drawn.values[0] = Measured { value: so + error * normal(&mut random), error };
    }
    (all, so)
}

fn posteriors(fleet: &[Drawn], quantity: &str) -> Vec<prior::Posterior> {
    let devices: Vec<Device> = fleet.iter().enumerate().map(|(number, drawn)| drawn.device(number)).collect();
    let mut all = prior::posteriors(&Population::of(&devices), &devices);
    all.retain(|p| p.quantity == quantity);
    all
}

#[test]
fn a_prior_tightens_what_a_campaign_hardly_tells_and_its_intervals_hold() {
    for (between, error, narrower) in [(1.0, 3.0, 0.75), (1.0, 1.0, 0.9), (1.0, 0.05, 1.01), (0.0, 1.0, 0.75)] {
        let (mut holds, mut widths, mut count) = (0, 0.0, 0);
        for seed in 0..10 {
            let (all, so) = gains(60, between, error, seed);
            for p in posteriors(&all, "angular_gain") {
                let both = p.both.expect("a value");
                let [low, high] = prior::Posterior::ends(both);
                holds += usize::from((low..=high).contains(&so[p.device]));
                widths += both.error / error;
                count += 1;
            }
        }
        let (share, width) = (f64::from(holds as u32) / f64::from(count), widths / f64::from(count));
        assert!(share > 0.93, "{between} {error}: {share} of the intervals hold");
        assert!(width < narrower, "{between} {error}: {width} times as wide");
    }
}

#[test]
fn a_prior_makes_no_odd_device_look_ordinary() {
    let (mut all, _) = gains(200, 0.1, 0.3, 4);
    // odd in the very gain; odd in another quantity; and far out, but not far enough to be named
    all[50].values[0].value = 5.0 + 12.0 * 0.3;
    all[60].values[1].value = 5.0 + 1e4;
    all[70].values[0].value = 5.0 + 3.3 * 0.1_f64.hypot(0.3);
    let found = posteriors(&all, "angular_gain");
    for (at, why) in [(50, "the device is odd"), (60, "the device is odd"), (70, "far from the others")] {
        assert_eq!(found[at].both, found[at].own, "its own value, as it was");
        assert_eq!(found[at].not_applied, Some(why));
    }
    assert!(found[50].both.expect("a value").value > 8.0);
    assert!(found[80].not_applied.is_none() && found[80].of_own < 0.5);
}

#[test]
fn what_a_campaign_does_not_tell_is_the_fleets_alone_and_a_small_or_split_fleet_says_nothing() {
    let (mut all, so) = gains(100, 1.0, 0.1, 6);
    all[9].values[0].value = f64::NAN;
    let found = posteriors(&all, "angular_gain");
    assert!(found[9].own.is_none() && found[9].of_own == 0.0);
    let [low, high] = prior::Posterior::ends(found[9].both.expect("a value"));
    assert!(low < so[9] && so[9] < high && high - low > 3.0, "{low} {high}");
    assert!(posteriors(&all[..19], "angular_gain").is_empty());
    all.iter_mut().step_by(4).for_each(|drawn| drawn.values[0].value += 50.0);
    let split = posteriors(&all, "angular_gain");
    assert!(split.iter().filter(|p| p.own.is_some()).all(|p| p.both == p.own && p.not_applied.is_some()));
}
