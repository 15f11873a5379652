//! Campaign files: what they say is read, and what they cannot mean is refused with its line.

use std::fs;
use std::path::{Path, PathBuf};

use cvg_recording::{Campaign, Instrument, Naming, Reference, Role, RunKind};
use tempfile::TempDir;

const ROTATION: &str = "t_s,rate_dps,xc_v,yc_v\n0,500,1,0\n0.5,500,0.9,0.1\n1,500,0.8,0.2\n1.5,500,0.7,0.3\n";
const RINGDOWN: &str = "t_s,xc_v,yc_v,vas_v\n0,1,0,-0.1\n1,1,0,-0.1\n2,0.9,0,0\n";
const RUN: &str = "[[run]]\nkind = \"rotation\"\nfile = \"rot.csv\"\n";

/// A folder with a rotation, a ring-down and this campaign file.
fn campaign(text: &str) -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("rot.csv"), ROTATION).unwrap();
    fs::write(folder.path().join("ring.csv"), RINGDOWN).unwrap();
    let path = folder.path().join("campaign.toml");
    fs::write(&path, text).unwrap();
    (folder, path)
}

fn refusal(text: &str) -> String {
    let (_folder, path) = campaign(text);
    Campaign::open(&path).expect_err("the campaign is refused").to_string()
}

fn assert_refused(text: &str, parts: &[&str]) {
    let message = refusal(text);
    for part in parts {
        assert!(message.contains(part), "{part:?} in {message:?}");
    }
}

fn headed(runs: &str) -> String {
    format!("[campaign]\ndevice = \"dfp-7\"\n{runs}")
}

#[test]
fn a_whole_campaign_is_read_as_it_is_written() {
    let (folder, path) = campaign(
        "[campaign]\ndevice = \"dfp-7\"\ninstrument = \"gyroscope\"\ncarrier_hz = 15_200.0\nangular_gain = 0.78\n\
         period_deg = 180\n\n[[run]]\nkind = \"rotation\"\nfile = \"rot.csv\"\nsettle_s = 1.0\nuse = \"holdout\"\n\
         amplitude = 0.6\n\n[[run]]\nkind = \"rotation\"\nfile = \"rot.csv\"\n\n\
         [[run]]\nkind = \"ringdown\"\nfile = \"ring.csv\"\nangle_deg = 90\nenergy_off_s = 1.5\n",
    );
    let campaign = Campaign::open(&path).unwrap();
    assert_eq!((campaign.device.as_str(), campaign.instrument), ("dfp-7", Instrument::Gyroscope));
    let numbers = [campaign.carrier_hz, campaign.angular_gain, campaign.period_deg];
    assert_eq!(numbers, [Some(15_200.0), Some(0.78), Some(180.0)]);
    let [holdout, fit, ringdown] = &campaign.runs[..] else { panic!("three runs") };
    assert_eq!((holdout.kind, holdout.role, holdout.amplitude), (RunKind::Rotation, Role::Holdout, Some(0.6)));
    assert_eq!((fit.role, fit.settle_s, fit.amplitude), (Role::Fit, 0.0, None));
    assert_eq!(ringdown.kind, RunKind::Ringdown { angle_deg: 90.0, energy_off_s: 1.5 });
    assert_eq!(ringdown.recording.source, folder.path().join("ring.csv"));
    assert_eq!(ringdown.file, Path::new("ring.csv"));
    assert!(campaign.warnings[0].contains("`rot.csv` is named by more than one run"), "{:?}", campaign.warnings);
}

#[test]
fn a_campaign_written_and_read_again_says_the_same() {
    let (folder, path) = campaign(&headed(&format!(
        "instrument = \"gyroscope\"\nangular_gain = -1\n{RUN}settle_s = 0.5\namplitude = 0.25\n\
         [[run]]\nkind = \"ringdown\"\nfile = \"ring.csv\"\nangle_deg = -45.5\nenergy_off_s = 1\nuse = \"holdout\"\n"
    )));
    let first = Campaign::open(&path).unwrap();
    let again_path = folder.path().join("again.toml");
    fs::write(&again_path, first.to_toml()).unwrap();
    let again = Campaign::open(&again_path).unwrap();
    assert_eq!(again.to_toml(), first.to_toml());
    assert_eq!(
        (again.angular_gain, again.runs[0].amplitude, again.runs[1].role),
        (Some(-1.0), Some(0.25), Role::Holdout)
    );
}

#[test]
fn a_single_recording_is_a_campaign_of_one_rotation() {
    let (folder, _) = campaign("");
    let campaign = Campaign::open(&folder.path().join("rot.csv")).unwrap();
    assert_eq!((campaign.device.as_str(), campaign.runs.len()), ("rot", 1));
    assert_eq!((campaign.runs[0].kind, campaign.runs[0].role), (RunKind::Rotation, Role::Fit));
    let message = Campaign::open(&folder.path().join("ring.csv")).unwrap_err().to_string();
    assert!(message.contains("a rotation needs"), "{message}");
}

#[test]
fn settling_leaves_the_rows_from_its_time_on() {
    let (_folder, path) = campaign(&headed(&format!("{RUN}settle_s = 1\n")));
    assert_eq!(Campaign::open(&path).unwrap().runs[0].settled().unwrap(), 2..4);
    assert_refused(
        &headed(&format!("{RUN}settle_s = 2\n")),
        &["rot.csv", "nothing is left after 2 s of settling, the recording lasts 1.5 s"],
    );
}

#[test]
fn a_file_that_is_not_there_is_named_with_the_line_that_names_it() {
    let text = headed("[[run]]\nkind = \"rotation\"\nfile = \"lost.csv\"\n");
    assert_refused(&text, &["campaign.toml: line 5, column 8", "`lost.csv` of this run is not there"]);
    let text = headed("[[run]]\nkind = \"rotation\"\nfile = \".\"\n");
    assert_refused(&text, &["line 5, column 8", "is a directory"]);
}

#[test]
fn unknown_keys_are_refused_with_the_known_ones() {
    let text = headed(&format!("{RUN}settle = 1\n"));
    assert_refused(&text, &["line 6, column 1", "the key `settle` has no meaning in a rotation run", "`settle_s`"]);
    assert_refused(&headed(&format!("carrier = 1\n{RUN}")), &["line 3", "`carrier`", "`carrier_hz`"]);
    assert_refused(&format!("{}[extra]\n", headed(RUN)), &["line 6", "`extra`", "one of `campaign`, `columns`, `run`"]);
    assert_refused(&headed(&format!("{RUN}angle_deg = 1\n")), &["`angle_deg` has no meaning in a rotation run"]);
}

#[test]
fn values_out_of_range_are_refused_with_what_would_be_right() {
    for (line, wanted) in [
        ("settle_s = -1", "0 or more seconds"),
        ("settle_s = \"1\"", "0 or more seconds"),
        ("settle_s = nan", "0 or more seconds"),
        ("amplitude = 0", "a positive relative amplitude"),
        ("use = \"test\"", "\"fit\" or \"holdout\""),
    ] {
        assert_refused(&headed(&format!("{RUN}{line}\n")), &["line 6", line.split(' ').next().unwrap(), wanted]);
    }
    for (line, wanted) in [
        ("period_deg = 90", "180 or 360"),
        ("carrier_hz = -1.0", "a positive number of Hz"),
        ("angular_gain = 0.0", "a number other than 0"),
        ("instrument = \"gyro\"", "\"gyroscope\" or \"sensor\""),
    ] {
        assert_refused(&headed(&format!("{line}\n{RUN}")), &["line 3", wanted]);
    }
}

#[test]
fn a_kind_that_is_misspelt_or_missing_is_refused() {
    let text = headed("[[run]]\nkind = \"rotaton\"\nfile = \"rot.csv\"\n");
    assert_refused(&text, &["line 4, column 8", "`kind` is \"rotaton\"", "\"rotation\" or \"ringdown\" or \"static\""]);
    assert_refused(&headed("[[run]]\nfile = \"rot.csv\"\n"), &["line 3", "this run has no `kind`"]);
    assert_refused(&headed("[[run]]\nkind = \"rotation\"\n"), &["line 3", "this run has no `file`"]);
}

#[test]
fn a_ring_down_needs_its_angle_and_its_time() {
    let ringdown = "[[run]]\nkind = \"ringdown\"\nfile = \"ring.csv\"\n";
    assert_refused(&headed(&format!("{RUN}{ringdown}energy_off_s = 1\n")), &["line 6", "no `angle_deg`"]);
    assert_refused(&headed(&format!("{RUN}{ringdown}angle_deg = 1\n")), &["line 6", "no `energy_off_s`"]);
    let text = headed(&format!("{RUN}{ringdown}angle_deg = 1\nenergy_off_s = 0\n"));
    assert_refused(&text, &["line 10", "`energy_off_s` is 0", "positive"]);
    let text = headed(&format!("{RUN}{ringdown}angle_deg = 1\nenergy_off_s = 1\n")).replace("ring.csv", "rot.csv");
    assert_refused(&text, &["rot.csv", "a ring-down needs"]);
}

#[test]
fn a_campaign_without_a_rotation_to_fit_is_refused() {
    assert_refused("[campaign]\ndevice = \"a\"\n", &["there is no `[[run]]`"]);
    let ringdown = "[[run]]\nkind = \"ringdown\"\nfile = \"ring.csv\"\nangle_deg = 0\nenergy_off_s = 1\n";
    assert_refused(&headed(ringdown), &["no run is a rotation"]);
    assert_refused(&headed(&format!("{RUN}use = \"holdout\"\n")), &["every rotation run has `use = \"holdout\"`"]);
}

#[test]
fn a_sensor_has_no_ring_down() {
    let ringdown = "[[run]]\nkind = \"ringdown\"\nfile = \"ring.csv\"\nangle_deg = 0\nenergy_off_s = 1\n";
    let text = headed(&format!("instrument = \"sensor\"\n{RUN}{ringdown}"));
    assert_refused(&text, &["line 7", "a sensor has nothing that rings down"]);
}

#[test]
fn text_that_is_not_toml_is_refused_with_its_line() {
    assert_refused("[campaign]\ndevice = dfp-7\n", &["campaign.toml: line 2", "wanted valid TOML"]);
    assert_refused("", &["there is no `[campaign]`"]);
    assert_refused("campaign = 1\n", &["line 1", "`campaign` is not a table"]);
    assert_refused(&headed("[run]\nkind = \"rotation\"\n"), &["line 3", "`[[run]]`"]);
}

#[test]
fn a_device_without_a_name_takes_that_of_its_folder_and_says_so() {
    let (folder, path) = campaign(&format!("[campaign]\n{RUN}"));
    let campaign = Campaign::open(&path).unwrap();
    assert_eq!(campaign.device, folder.path().file_name().unwrap().to_string_lossy());
    assert!(campaign.warnings[0].contains("`device` is not given"), "{:?}", campaign.warnings);
}

#[test]
fn a_campaign_file_that_is_not_there_or_a_folder_is_refused() {
    let (folder, _) = campaign("");
    let message = Campaign::open(&folder.path().join("no.toml")).unwrap_err().to_string();
    assert!(message.ends_with("no.toml: there is no such file"), "{message}");
    let message = Campaign::open(folder.path()).unwrap_err().to_string();
    assert!(message.contains("is a directory; wanted a recording"), "{message}");
}

#[test]
fn a_constant_rate_stands_in_for_the_column_that_a_file_lacks() {
    let (folder, path) = campaign(&headed(&format!("{RUN}rate_dps = -0.00289\n")));
    fs::write(folder.path().join("rot.csv"), "t_s,theta_deg\n0,1\n1,2\n2,3\n").unwrap();
    let run = &Campaign::open(&path).unwrap().runs[0];
    assert_eq!(run.recording.rate_dps.as_deref(), Some(&[-0.00289; 3][..]));
}

#[test]
fn a_constant_rate_beside_a_column_is_not_used_and_said_so() {
    let (_folder, path) = campaign(&headed(&format!("{RUN}rate_dps = 1\n")));
    let campaign = Campaign::open(&path).unwrap();
    assert_eq!(campaign.runs[0].recording.rate_dps.as_ref().unwrap()[0], 500.0);
    assert!(campaign.warnings.iter().any(|w| w.contains("rot.csv: has rate_dps itself")), "{:?}", campaign.warnings);
}

#[test]
fn a_sensor_needs_no_reference_and_a_gyroscope_does() {
    let channels = "t_s,xc_v,yc_v\n0,1,0\n1,0,1\n2,-1,0\n";
    for (head, opens) in [("instrument = \"sensor\"\n", true), ("reference = \"none\"\n", true), ("", false)] {
        let (folder, path) = campaign(&headed(&format!("{head}{RUN}")));
        fs::write(folder.path().join("rot.csv"), channels).unwrap();
        assert_eq!(Campaign::open(&path).is_ok(), opens, "{head}");
    }
    let (folder, path) = campaign(&headed(&format!("instrument = \"sensor\"\n{RUN}")));
    fs::write(folder.path().join("rot.csv"), "t_s,theta_deg\n0,1\n1,2\n").unwrap();
    assert!(Campaign::open(&path).unwrap_err().to_string().contains("`rate_dps`, `table_deg`"));
}

#[test]
fn an_instrument_known_from_elsewhere_stands_over_the_file() {
    let (_folder, path) = campaign(&headed(RUN));
    let opened = Campaign::open_as(&path, &Naming::default(), Some(Instrument::Sensor)).unwrap();
    assert_eq!(opened.instrument, Instrument::Sensor);
    let ringdown = "[[run]]\nkind = \"ringdown\"\nfile = \"ring.csv\"\nangle_deg = 0\nenergy_off_s = 1\n";
    let (_folder, path) = campaign(&headed(&format!("{RUN}{ringdown}")));
    let refused = Campaign::open_as(&path, &Naming::default(), Some(Instrument::Sensor)).unwrap_err().to_string();
    assert!(refused.contains("a sensor has nothing that rings down"), "{refused}");
}

#[test]
fn runs_at_rest_stand_alone_or_beside_others() {
    let rest = "[[run]]\nkind = \"static\"\nfile = \"rot.csv\"\n";
    let (_folder, path) = campaign(&headed(rest));
    let opened = Campaign::open(&path).unwrap();
    assert_eq!(opened.runs[0].kind, RunKind::Static);
    assert!(opened.to_toml().contains("kind = \"static\""));
    assert_refused(&headed(&format!("{rest}amplitude = 1\n")), &["`amplitude` has no meaning in a run at rest"]);
}

#[test]
fn reference_and_temperature_are_read_and_written_again() {
    let (_folder, path) = campaign(&headed(&format!("reference = \"commanded\"\ntemperature_c = 25\n{RUN}")));
    let opened = Campaign::open(&path).unwrap();
    assert_eq!((opened.reference, opened.temperature_c), (Some(Reference::Commanded), Some(25.0)));
    assert!(opened.to_toml().contains("temperature_c = 25.0") && opened.to_toml().contains("\"commanded\""));
    assert_refused(&headed(&format!("temperature_c = -300\n{RUN}")), &["`temperature_c` is -300"]);
    assert_refused(&headed(&format!("reference = \"lost\"\n{RUN}")), &["\"measured\" or \"commanded\" or \"none\""]);
}

#[test]
fn a_decay_needs_its_envelopes_or_the_carrier_and_keeps_the_rate_it_is_given() {
    let folder = tempfile::tempdir().expect("a folder of the test's own");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("it is written");
    write("film.csv", "t_s,x_v,y_v\n0,1,2\n1,2,3\n");
    write("half.csv", "t_s,xc_v,yc_v\n0,1,2\n1,2,3\n");
    let campaign = |file: &str| {
        format!("[campaign]\ndevice = \"d\"\n[[run]]\nkind = \"decay\"\nfile = \"{file}\"\nrate_dps = 0.003\n")
    };
    write("film.toml", &campaign("film.csv"));
    let opened = Campaign::open(&folder.path().join("film.toml")).expect("a decay at the carrier");
    assert_eq!(
        (opened.runs[0].kind, opened.runs[0].recording.rate_dps.clone()),
        (RunKind::Decay, Some(vec![0.003; 2]))
    );
    assert!(opened.to_toml().contains("kind = \"decay\""));
    write("half.toml", &campaign("half.csv"));
    let refused = Campaign::open(&folder.path().join("half.toml")).expect_err("no quadrature").to_string();
    assert!(refused.contains("a free decay needs"), "{refused}");
}

/// A decay of raw numbers beside a campaign that says what they are.
fn raw(bytes: &[u8], says: &str) -> Result<Campaign, String> {
    let folder = tempfile::tempdir().expect("a folder of the test's own");
    std::fs::write(folder.path().join("scope.bin"), bytes).expect("it is written");
    let text = headed(&format!("{says}\n"));
    let path = folder.path().join("campaign.toml");
    std::fs::write(&path, text).expect("it is written");
    Campaign::open(&path).map_err(|e| e.to_string())
}

const RAW: &str = "[[run]]\nkind = \"decay\"\nfile = \"scope.bin\"\nraw = { columns = [\"x_v\", \"y_v\"], number = \"f32\", \
                   sample_hz = 200000.0 }";

#[test]
fn raw_numbers_are_read_as_the_campaign_says() {
    let values: [[f64; 2]; 3] = [[0.5, -1.25], [2.0, 3.0], [-0.75, 8.0]];
    let bytes = |of: fn(f64) -> Vec<u8>| values.iter().flatten().flat_map(|v| of(*v)).collect::<Vec<u8>>();
    #[allow(clippy::cast_possible_truncation, reason = "small numbers")]
    for (number, bytes, share) in [
        ("f32", bytes(|v| (v as f32).to_le_bytes().to_vec()), 1.0),
        ("f64", bytes(|v| v.to_le_bytes().to_vec()), 1.0),
        ("i16", bytes(|v| ((4.0 * v) as i16).to_le_bytes().to_vec()), 4.0),
        ("i32", bytes(|v| ((4.0 * v) as i32).to_le_bytes().to_vec()), 4.0),
    ] {
        let opened = raw(&bytes, &RAW.replace("f32", number)).expect("it is read");
        let recording = &opened.runs[0].recording;
        assert_eq!(recording.t_s, [0.0, 5e-6, 1e-5]);
        let column = |at: usize| Some(values.iter().map(|row| share * row[at]).collect::<Vec<f64>>());
        assert_eq!((&recording.x_v, &recording.y_v), (&column(0), &column(1)), "{number}");
        assert!(recording.warnings.is_empty(), "{:?}", recording.warnings);
    }
}

#[test]
fn counts_become_volts_by_the_factor_of_the_mapping_and_other_columns_are_left_out() {
    let bytes: Vec<u8> = [10_i16, 999, -20, 30, 999, 40].iter().flat_map(|v| v.to_le_bytes()).collect();
    let says = RAW.replace("[\"x_v\", \"y_v\"]", "[\"CH1\", \"trigger\", \"CH2\"]").replace("f32", "i16");
    let opened =
        raw(&bytes, &format!("{says}\n[columns]\nx_v = \"CH1*0.001\"\ny_v = \"CH2*0.002\"")).expect("it is read");
    let recording = &opened.runs[0].recording;
    assert_eq!(recording.x_v, Some(vec![10.0 * 0.001, 30.0 * 0.001]));
    assert_eq!(recording.y_v, Some(vec![-20.0 * 0.002, 40.0 * 0.002]));
    assert!(recording.warnings.iter().any(|w| w.contains("`trigger` is no channel")), "{:?}", recording.warnings);
}

#[test]
fn a_raw_row_that_is_cut_off_or_holds_no_number_is_dropped_and_counted() {
    let mut bytes: Vec<u8> = [1.0_f32, 2.0, f32::NAN, 3.0, 4.0, 5.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0; 5]);
    let recording = raw(&bytes, RAW).expect("it is read").runs.remove(0).recording;
    assert_eq!(recording.t_s, [0.0, 1e-5]);
    assert_eq!(recording.dropped.truncated_last_line.count, 1);
    assert_eq!(recording.dropped.rows_read, 4);
}

#[test]
fn raw_numbers_that_are_not_said_fully_are_refused() {
    for (from, to, wanted) in [
        ("number = \"f32\", ", "", "`raw` has no `number`"),
        ("sample_hz = 200000.0", "sample_hz = 0", "`sample_hz` is 0"),
        (", sample_hz = 200000.0", "", "`raw` has no `sample_hz`"),
        ("\"f32\"", "\"f16\"", "\"i16\" or \"i32\" or \"f32\" or \"f64\""),
        ("[\"x_v\", \"y_v\"]", "[]", "`columns` is not a list of names"),
        ("[\"x_v\", \"y_v\"]", "[\"x_v\", 3]", "`columns` is not a string"),
        ("[\"x_v\", \"y_v\"]", "[\"x_v\", \"z\"]", "needs `t_s` and one of"),
        ("sample_hz", "rate_hz", "the key `rate_hz` has no meaning in `raw`"),
        ("scope.bin", "lost.bin", "the file `lost.bin` of this run is not there"),
    ] {
        let refused = raw(&[0; 64], &RAW.replace(from, to)).expect_err(wanted);
        assert!(refused.contains(wanted), "{refused}\n  does not say: {wanted}");
    }
    assert!(raw(&[], RAW).is_err());
}
