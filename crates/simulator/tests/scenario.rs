//! Scenario files and the campaigns made of them.

mod support;

use approx::assert_abs_diff_eq;
use cvg_estimator::Period;
use cvg_simulator::scenario::{PAPER, Purpose, Run, SENSOR};
use cvg_simulator::{Scenario, SimulatedRun};
use support::{angles, column, envelopes, fit, only_run};

fn refusal(text: &str) -> String {
    Scenario::parse(text).map(|_| ()).expect_err("has to be refused").to_string()
}

fn minimal(keys: &str, run: &str) -> String {
    format!(
        "device = \"t\"\nangular_gain = 0.78\n{keys}\n[[run]]\nkind = \"rotation\"\nfile = \"a.csv\"\n\
         rate_dps = 100.0\nduration_s = 1.0\n{run}\n"
    )
}

fn by_file<'a>(runs: &'a [SimulatedRun], file: &str) -> &'a SimulatedRun {
    runs.iter().find(|r| r.run.file() == file).expect("the run is there")
}

#[test]
fn the_papers_scenario_has_the_runs_that_its_method_needs() {
    let scenario = Scenario::paper();
    let runs = &scenario.settings().runs;
    let described: Vec<_> = runs
        .iter()
        .map(|run| match run {
            Run::Rotation { rate_dps, amplitude, purpose, .. } => (*rate_dps, *amplitude, *purpose == Purpose::Fit),
            Run::Ringdown { angle_deg, .. } => (*angle_deg, 0.0, true),
            Run::Virtual { .. } | Run::Decay { .. } => unreachable!("the paper has a table"),
        })
        .collect();
    assert_eq!(
        described,
        [
            (500.0, 1.0, true),
            (-500.0, 1.0, true),
            (200.0, 1.0, true),
            (60.0, 1.0, true),
            (500.0, 0.6, true),
            (350.0, 1.0, false),
            (-500.0, 1.0, false),
            (0.0, 0.0, true),
            (90.0, 0.0, true),
        ]
    );
}

#[test]
fn one_seed_gives_one_set_of_bytes_and_another_seed_another() {
    let paper = Scenario::paper();
    let files = |scenario: &Scenario| scenario.simulate().runs.iter().map(SimulatedRun::csv).collect::<Vec<_>>();
    assert_eq!(files(&paper), files(&paper));
    let other = Scenario::parse(&PAPER.replace("seed = 1", "seed = 2")).expect("valid");
    for (a, b) in files(&paper).iter().zip(files(&other)) {
        assert_ne!(*a, b);
    }
}

#[test]
fn a_run_does_not_depend_on_the_runs_before_it() {
    let paper = Scenario::paper();
    let mut settings = paper.settings().clone();
    settings.runs.truncate(2);
    let fewer = Scenario::new(settings).expect("valid");
    assert_eq!(paper.simulate().runs[1], fewer.simulate().runs[1]);
}

#[test]
fn a_campaign_is_written_as_a_folder_that_says_what_is_in_it() {
    let dir = tempfile::tempdir().expect("a folder");
    let target = dir.path().join("deep/er");
    let simulated = Scenario::paper().simulate();
    simulated.write(&target).expect("written");
    simulated.write(&target).expect("written over");
    let campaign: toml::Table =
        std::fs::read_to_string(target.join("campaign.toml")).expect("there").parse().expect("TOML");
    let runs = campaign["run"].as_array().expect("runs");
    assert_eq!(campaign["campaign"]["device"].as_str(), Some("dfp-paper"));
    assert_eq!(campaign["campaign"]["angular_gain"].as_float(), Some(0.8));
    assert_eq!(runs.len(), 9);
    for run in runs {
        let text = std::fs::read_to_string(target.join(run["file"].as_str().expect("a name"))).expect("there");
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("t_s,rate_dps,xc_v,xs_v,yc_v,ys_v,vas_v,vqc_v"));
        for line in lines {
            assert_eq!(line.split(',').filter(|cell| cell.parse::<f64>().is_ok()).count(), 8);
        }
    }
    let truth: toml::Table = std::fs::read_to_string(target.join("truth.toml")).expect("there").parse().expect("TOML");
    assert_eq!(truth["detection_gain_ratio"].as_float(), Some(1.0132));
    assert_eq!(truth["actuation_gain_ratio"].as_float(), Some(1.0113));
    assert_eq!(truth["undeclared"].as_array().map(Vec::len), Some(1));
}

#[test]
fn what_is_written_is_what_was_simulated_to_nine_digits() {
    let simulated = Scenario::paper().simulate();
    let run = &simulated.runs[0];
    for (row, line) in run.csv().lines().skip(1).enumerate() {
        for (cell, column) in line.split(',').zip(&run.columns) {
            let value: f64 = cell.parse().expect("a number");
            assert_abs_diff_eq!(value, column.values[row], epsilon = 1e-8);
        }
    }
}

#[test]
fn a_row_holds_the_readout_and_the_commands_computed_from_it() {
    // Equation 3 between neighbouring rows, recorded at every control sample
    let run = only_run(&minimal("control_hz = 1000.0\nsample_hz = 1000.0\nnoise_v = 1e-4", ""));
    let q: Vec<f64> = envelopes(&run).iter().map(|e| e.pendulum().q).collect();
    let (v, omega, damping) = (column(&run, "vqc_v"), core::f64::consts::TAU, 0.7);
    for i in 1..q.len() {
        let proportional = damping * omega * (q[i] - q[i - 1]);
        let integral = 0.5 * omega * omega * 1e-3 * q[i];
        assert_abs_diff_eq!(v[i] - v[i - 1], -(proportional + integral), epsilon = 1e-12);
    }
}

#[test]
fn compensation_in_the_loop_takes_the_errors_out_of_the_true_motion() {
    let effects = r#"{ id = "detection-gain-mismatch", detection_gain_ratio = 1.05 },
                     { id = "actuation-gain-mismatch", actuation_gain_ratio = 1.04 }"#;
    let keys = format!("theta_deg = true\nwarm_up_s = 2.0\neffects = [{effects}]\ncompensation = [{effects}]");
    let run = only_run(&minimal(&keys, ""));
    for v_as in column(&run, "vas_v") {
        assert_abs_diff_eq!(*v_as, -0.5 * (1.04_f64.sqrt() + 1.0 / 1.04_f64.sqrt()) / 22.0, epsilon = 2e-3);
    }
    // the readout is recorded as it came, the instrument's own angle is compensated
    let energies: Vec<f64> = envelopes(&run).iter().map(|e| e.pendulum().e).collect();
    assert!(energies.iter().any(|e| *e > 1.05));
    let t = column(&run, "t_s");
    let own: Vec<f64> = column(&run, "theta_deg").iter().map(|d| (2.0 * d).to_radians().cos()).collect();
    let doubled: Vec<f64> = t.iter().map(|t| -2.0 * 0.78 * 100_f64.to_radians() * t).collect();
    let ideal = fit(&own, &[], &doubled, &[1.0]).1[0];
    assert_abs_diff_eq!(ideal.amplitude(), 1.0, epsilon = 1e-4);
}

#[test]
fn force_noise_makes_the_angle_walk() {
    let spread = |keys: &str| {
        let run = only_run(&minimal(keys, ""));
        let theta = angles(&run, Period::Pattern);
        let t = column(&run, "t_s");
        theta.iter().zip(t).map(|(a, t)| (a - theta[0] + 0.78 * 100_f64.to_radians() * t).abs()).fold(0.0, f64::max)
    };
    // held for a period, the energy command lags by half of it: a precession of ½kΩT/τ, and nothing else
    assert!(spread("") < 0.6 * 0.78 * 100_f64.to_radians() * 5e-4 / 22.0);
    assert!(spread("force_noise_v = 0.1") > 5e-4);
}

#[test]
fn the_sensors_scenario_turns_there_and_back_and_reads_without_loops() {
    let simulated = Scenario::parse(SENSOR).expect("valid").simulate();
    let turns = by_file(&simulated.runs, "turns.csv");
    let names: Vec<_> = turns.columns.iter().map(|c| c.name).collect();
    assert_eq!(names, ["t_s", "rate_dps", "table_deg", "xc_v", "yc_v"]);
    let table = column(turns, "table_deg");
    assert_abs_diff_eq!(table[table.len() / 2], 360.0, epsilon = 1e-6);
    assert_abs_diff_eq!(*table.last().expect("rows"), 0.06, epsilon = 1e-6);
    // 25 pole pairs turn with the table: once the ellipse is made a circle, 25 turns of the table's one
    let campaign: toml::Table = simulated.campaign_toml().parse().expect("TOML");
    assert_eq!(campaign["campaign"]["instrument"].as_str(), Some("sensor"));
    assert_eq!(campaign["campaign"]["period_deg"].as_float(), Some(360.0));
}

#[test]
fn a_perfect_sensor_reads_its_table() {
    let text = minimal("instrument = \"sensor\"\nnoise_v = 0.0", "reference = \"table\"")
        .replace("angular_gain = 0.78", "angular_gain = -3.0");
    let run = only_run(&text);
    let theta = angles(&run, Period::FullTurn);
    for (angle, table) in theta.iter().zip(column(&run, "table_deg")) {
        assert_abs_diff_eq!((angle - theta[0]).to_degrees(), 3.0 * table, epsilon = 1e-6);
    }
}

#[test]
fn the_loop_locks_to_a_detuned_reference() {
    let run = only_run(&minimal("detuning_hz = 2.0\nwarm_up_s = 2.0", ""));
    for e in envelopes(&run) {
        assert!(e.pendulum().l.abs() < 1e-6);
    }
}

#[test]
fn what_makes_no_sense_is_refused_with_the_key_and_what_would_be_right() {
    for (text, wanted) in [
        (minimal("tau = 3.0", ""), "unknown field `tau`"),
        (minimal("", "speed = 3"), "unknown field `speed`"),
        (minimal("tau_s = -1.0", ""), "tau_s: -1 has to be finite and positive"),
        (minimal("noise_v = nan", ""), "noise_v: NaN has to be finite and not negative"),
        (minimal("sample_hz = 300.0", ""), "sample_hz: 300 does not divide control_hz = 2000"),
        (minimal("effects = [{ id = \"gain\" }]", ""), "no effect is called \"gain\""),
        (minimal("effects = [{ id = \"detection-skew\", s = 1.0 }]", ""), "detection-skew has no parameter \"s\""),
        (minimal("effects = [{ id = \"detection-skew\", skew = 9.0 }]", ""), "skew = 9 is outside [-2, 2]"),
        (minimal("effects = [{ id = \"detection-skew\", skew = \"a\" }]", ""), "skew has to be a number"),
        (minimal("effects = [{ id = \"harmonic-n\", amplitude = 0.1 }]", ""), "harmonic-n needs n"),
        (minimal("effects = [{ id = \"spring-cubic\", phase = 0.1 }]", ""), "phase is given without p"),
        (minimal("compensation = [{ id = \"anisodamping\" }]", ""), "the electronics cannot undo it"),
        (
            minimal("instrument = \"sensor\"\neffects = [{ id = \"anisodamping\" }]", ""),
            "a sensor cannot have anisodamping",
        ),
        (minimal("loops = { energy = { bandwidth_hz = 500.0, damping = 1.0 } }", ""), "loops.energy: bandwidth_rad_s"),
        (minimal("", "").replace("a.csv", "../a.csv"), "is not a plain name"),
        (minimal("", "").replace("duration_s = 1.0", "duration_s = 0.0"), "run \"a.csv\": duration_s: 0 has to be"),
        ("device = \"t\"\nangular_gain = 0.0\nrun = []\n".to_owned(), "angular_gain: is 0"),
        ("device = \"t\"\nangular_gain = 1.2e33\nrun = []\n".to_owned(), "is no angular gain"),
        ("device = \"t\"\nangular_gain = 0.7\nrun = []\n".to_owned(), "at least one [[run]]"),
        (minimal("", "").replace("rate_dps = ", "rate_dps = 1e40 # "), "is no rate: the largest is 1000000"),
    ] {
        let error = refusal(&text);
        assert!(error.contains(wanted), "{error}\n  does not say: {wanted}");
    }
}

const DECAY: &str = r#"device = "ring"
angular_gain = 0.78
carrier_hz = 15200.0
[[run]]
kind = "decay"
file = "envelope.csv"
start_deg = 30.0
quadrature = 0.1
rate_dps = 10.0
duration_s = 2.0
[[run]]
kind = "decay"
file = "carrier.parquet"
start_deg = 30.0
quadrature = 0.1
rate_dps = 10.0
duration_s = 0.02
carrier_sample_hz = 100000.0
"#;

#[test]
fn a_decay_is_the_resonator_alone() {
    let simulated = Scenario::parse(DECAY).expect("valid").simulate();
    let ring = by_file(&simulated.runs, "envelope.csv");
    let names: Vec<_> = ring.columns.iter().map(|c| c.name).collect();
    assert_eq!(names, ["t_s", "rate_dps", "xc_v", "xs_v", "yc_v", "ys_v"]);
    for (t, e) in column(ring, "t_s").iter().zip(envelopes(ring)) {
        let p = e.pendulum();
        let energy = (1.0 + 0.01) * (-2.0 * t / 22.0).exp();
        assert_abs_diff_eq!(p.e, energy, epsilon = 1e-12);
        assert_abs_diff_eq!(p.q, 0.2 / 1.01 * energy, epsilon = 1e-12);
        assert_abs_diff_eq!(p.angle().to_degrees(), 30.0 - 0.78 * 10.0 * t, epsilon = 1e-9);
    }
}

#[test]
fn displacements_are_the_vibration_itself() {
    let simulated = Scenario::parse(DECAY).expect("valid").simulate();
    let ring = by_file(&simulated.runs, "carrier.parquet");
    let names: Vec<_> = ring.columns.iter().map(|c| c.name).collect();
    assert_eq!(names, ["t_s", "x_v", "y_v"]);
    let (t, x, y) = (column(ring, "t_s"), column(ring, "x_v"), column(ring, "y_v"));
    assert_eq!(t.len(), 2000);
    // a step of the converters, and what the Coriolis force does to the frequency, is left
    for i in 0..t.len() {
        let start = cvg_model::Orbit { a: 1.0, q: 0.1, theta: (30.0 - 7.8 * t[i]).to_radians(), delta: 0.0 }.envelope();
        let (sin, cos) = (core::f64::consts::TAU * 15_200.0 * t[i]).sin_cos();
        let shrunk = (-t[i] / 22.0).exp();
        assert_abs_diff_eq!(x[i], shrunk * (start.x_c * cos + start.x_s * sin), epsilon = 3e-5);
        assert_abs_diff_eq!(y[i], shrunk * (start.y_c * cos + start.y_s * sin), epsilon = 3e-5);
    }
    // the rate stands in the campaign, where it is no column
    let campaign: toml::Table = simulated.campaign_toml().parse().expect("TOML");
    let rates =
        campaign["run"].as_array().expect("runs").iter().map(|r| r.get("rate_dps").and_then(toml::Value::as_float));
    assert_eq!(rates.collect::<Vec<_>>(), [None, Some(10.0)]);
}

#[test]
fn a_rotation_at_the_carrier_begins_when_its_electronics_have_settled() {
    let text = minimal("carrier_hz = 15200.0", "profile = \"there-and-back\"\ncarrier_sample_hz = 50000.0");
    let run = only_run(&text.replace("duration_s = 1.0", "duration_s = 0.1"));
    let names: Vec<_> = run.columns.iter().map(|c| c.name).collect();
    assert_eq!(names, ["t_s", "rate_dps", "x_v", "y_v", "fx_v", "fy_v"]);
    let (x, y) = (column(&run, "x_v"), column(&run, "y_v"));
    let mean_square = x.iter().zip(y).map(|(x, y)| x * x + y * y).sum::<f64>() / x.len() as f64;
    assert_abs_diff_eq!(mean_square, 0.5, epsilon = 1e-3);
    assert_eq!(column(&run, "rate_dps")[2499..2501], [100.0, -100.0]);
    // an output that is held for a sample has sin(ωT/2)/(ωT/2) of the carrier in it
    let half = core::f64::consts::PI * 15_200.0 / 50_000.0;
    let forces = column(&run, "fx_v").iter().zip(column(&run, "fy_v"));
    let mean_square = forces.map(|(x, y)| x * x + y * y).sum::<f64>() / x.len() as f64;
    assert_abs_diff_eq!((2.0 * mean_square).sqrt(), 1.0 / 22.0 * half / half.sin(), epsilon = 1e-3);
}

#[test]
fn what_is_written_run_by_run_is_what_is_written_at_once() {
    let dir = tempfile::tempdir().expect("a folder");
    let scenario = Scenario::parse(DECAY).expect("valid");
    scenario.write(dir.path().join("one")).expect("written");
    scenario.simulate().write(dir.path().join("all")).expect("written");
    for file in ["campaign.toml", "truth.toml", "envelope.csv", "carrier.parquet"] {
        let [one, all] = ["one", "all"].map(|of| std::fs::read(dir.path().join(of).join(file)).expect("there"));
        assert_eq!(one, all, "{file}");
    }
}

#[test]
fn raw_numbers_are_said_by_the_campaign() {
    let scenario = Scenario::parse(&DECAY.replace("carrier.parquet", "carrier.f32")).expect("valid");
    let dir = tempfile::tempdir().expect("a folder");
    scenario.write(dir.path()).expect("written");
    let campaign: toml::Table =
        std::fs::read_to_string(dir.path().join("campaign.toml")).expect("there").parse().expect("TOML");
    let raw = &campaign["run"][1]["raw"];
    assert_eq!(raw["columns"].as_array().map(Vec::len), Some(2));
    assert_eq!((raw["number"].as_str(), raw["sample_hz"].as_float()), (Some("f32"), Some(100_000.0)));
    assert!(campaign["run"][0].get("raw").is_none());
    let bytes = std::fs::read(dir.path().join("carrier.f32")).expect("there");
    let simulated = scenario.simulate();
    let run = by_file(&simulated.runs, "carrier.f32");
    assert_eq!(bytes.len(), 2000 * 2 * 4);
    for (row, pair) in bytes.chunks_exact(8).enumerate() {
        let [x, y] = [&pair[..4], &pair[4..]].map(|b| f32::from_le_bytes(b.try_into().expect("four")));
        assert_eq!([x, y], [column(run, "x_v")[row] as f32, column(run, "y_v")[row] as f32]);
    }
}

#[test]
fn the_truth_has_the_spring() {
    let text = DECAY.replace("carrier_hz", "spring_isotropic = { c = 0.01 }\ncarrier_hz");
    let truth: toml::Table = Scenario::parse(&text).expect("valid").simulate().truth_toml().parse().expect("TOML");
    assert_eq!(truth["undeclared"].as_array().expect("a list")[0].as_str(), Some("spring-isotropic"));
    assert_eq!(truth["effect"].as_array().expect("a list")[0]["frequency_per_energy"].as_float(), Some(-0.03));
}

#[test]
fn what_is_not_built_at_the_carrier_is_refused() {
    for (from, to, wanted) in [
        ("carrier_hz = 15200.0", "", "carrier_sample_hz: the scenario has no carrier_hz"),
        (
            "angular_gain = 0.78",
            "angular_gain = 0.78\ngain_flicker = 1e-4",
            "gain_flicker: is not built at the carrier",
        ),
        (
            "angular_gain = 0.78",
            "angular_gain = 0.78\neffects = [{ id = \"detection-skew\", skew = 0.1 }]",
            "the effect detection-skew is not built at the carrier",
        ),
        ("100000.0", "99999.0", "carrier_sample_hz: 99999 is no multiple of control_hz = 2000"),
        ("100000.0", "nan", "carrier_sample_hz: NaN has to be finite and positive"),
        ("100000.0", "2e10", "duration_s: is too long for one recording"),
        ("angular_gain = 0.78", "angular_gain = 0.78\namplitude_v = 9.0", "amplitude_v"),
        ("quadrature = 0.1", "quadrature = 1.5", "quadrature: 1.5 is outside [-1, 1]"),
        ("start_deg = 30.0", "start_deg = inf", "start_deg: inf is not a finite number"),
        ("angular_gain = 0.78", "angular_gain = 0.78\nspring_isotropic = { c = nan }", "spring_isotropic.c: NaN"),
        ("angular_gain = 0.78", "angular_gain = 1.0\ninstrument = \"sensor\"", "a sensor has nothing that rings"),
        ("carrier.parquet", "carrier.hdf5", "ends in .csv or .parquet"),
        ("envelope.csv", "envelope.f32", "or at the carrier in .f32"),
    ] {
        let error = refusal(&DECAY.replace(from, to));
        assert!(error.contains(wanted), "{error}\n  does not say: {wanted}");
    }
    let fast = minimal("carrier_hz = 15200.0", "carrier_sample_hz = 3000000.0");
    assert!(refusal(&fast).contains("carrier_sample_hz: 3000000 is more than the 2000000 of the fastest electronics"));
    let rotation = |keys: &str, run: &str| refusal(&minimal(&format!("carrier_hz = 15200.0\n{keys}"), run));
    let at_carrier = "carrier_sample_hz = 50000.0";
    for (keys, run, wanted) in [
        ("", "start_deg = 3.0", "start_deg: is up to the electronics"),
        ("", "reference = \"table\"", "reference: is \"rate\" at the carrier"),
        ("drive_per_s_v = 1e-6", "", "a.csv: the device did not start"),
    ] {
        let error = rotation(keys, &format!("{run}\n{at_carrier}"));
        assert!(error.contains(wanted), "{error}\n  does not say: {wanted}");
    }
}

#[test]
fn settings_survive_being_written_and_read() {
    let paper = Scenario::paper();
    let text = toml::to_string(paper.settings()).expect("serialises");
    assert_eq!(Scenario::parse(&text).expect("valid").settings(), paper.settings());
}
