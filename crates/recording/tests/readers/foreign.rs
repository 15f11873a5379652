//! Recordings as other people's instruments write them: names of their own, remarks among the rows, MATLAB and HDF5.

use std::io::Write as _;
use std::path::Path;

use cvg_recording::{Campaign, Naming, ReadError, Recording};

fn naming(entries: &[&str]) -> Naming {
    let mut naming = Naming::default();
    entries.iter().for_each(|e| naming.add(e).unwrap());
    naming
}

fn read(text: &str, entries: &[&str]) -> Result<Recording, ReadError> {
    Recording::read_from(text.as_bytes(), &naming(entries), Path::new("-"))
}

const LOCK_IN: &str = "% LabTool 3.1\n% demod 0 and 1\nTime (ms);Ch1;Ch2;Table;Note\n0;1,0;0,0;0;a\n% range changed\n\
                       10;0,9;0,1;5;b\n20;0,8;0,2;10;c\n";

#[test]
fn a_lock_ins_export_is_read_with_its_names_mapped() {
    let entries = ["t_s=time (ms)*0.001", "xc_v=Ch1", "yc_v=Ch2", "table_deg=Table"];
    let recording = read(LOCK_IN, &entries).unwrap();
    assert_eq!(recording.t_s, [0.0, 0.01, 0.02]);
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.0, 0.9, 0.8][..]));
    assert_eq!(recording.table_deg.as_deref(), Some(&[0.0, 5.0, 10.0][..]));
    assert_eq!(recording.dropped.blank_lines.count, 1, "the remark among the rows");
    assert_eq!(recording.unknown[0].name, "Note");
    assert!(recording.require_rotation().is_ok());
}

/// A folder with a campaign of this `[columns]` table and the export of a lock-in.
fn lock_in_campaign(columns: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("[campaign]\ndevice = \"d\"\n{columns}\n[[run]]\nkind = \"rotation\"\nfile = \"a.csv\"\n");
    std::fs::write(folder.path().join("campaign.toml"), text).unwrap();
    std::fs::write(folder.path().join("a.csv"), LOCK_IN).unwrap();
    folder
}

#[test]
fn a_campaign_says_once_what_its_columns_are_called() {
    let folder =
        lock_in_campaign("[columns]\nt_s = \"Time (ms)*0.001\"\nxc_v = \"Ch1\"\nyc_v = \"Ch2\"\ntable_deg = \"Table\"");
    let path = folder.path().join("campaign.toml");
    let campaign = Campaign::open(&path).unwrap();
    assert_eq!(campaign.runs[0].recording.t_s, [0.0, 0.01, 0.02]);
    // what the caller says stands over what the file says
    let swapped = Campaign::open_named(&path, &naming(&["xc_v=Ch2", "yc_v=Ch1"])).unwrap();
    assert_eq!(swapped.runs[0].recording.xc_v.as_deref(), Some(&[0.0, 0.1, 0.2][..]));
    assert!(Campaign::columns(&path).unwrap() != Naming::default());
}

#[test]
fn columns_that_cannot_be_meant_are_refused_with_their_place() {
    for (columns, parts) in [
        ("[columns]\nangle = \"Ch1\"", ["line 4, column 1", "`angle` is no channel"]),
        ("[columns]\nxc_v = 1", ["line 4, column 8", "is not a string"]),
        ("[columns]\nxc_v = \"Ch1\"\nyc_v = \"ch1\"", ["line 5", "mapped twice"]),
    ] {
        let folder = lock_in_campaign(columns);
        let said = Campaign::open(&folder.path().join("campaign.toml")).unwrap_err().to_string();
        assert!(parts.iter().all(|part| said.contains(part)), "{columns}: {said}");
    }
}

#[test]
fn a_remark_does_not_move_the_lines_that_errors_name() {
    let text = "t_s,theta_deg\n0,1\n# pause\n0.1,x\n";
    assert!(read(text, &[]).unwrap_err().to_string().contains("line 4, column 2"));
}

#[test]
fn remarks_are_seen_among_quoted_rows_too() {
    let text = "t_s,theta_deg,note\n0,1,\"a,b\"\n# pause\n0.1,2,c\n";
    assert_eq!(read(text, &[]).unwrap().t_s, [0.0, 0.1]);
}

#[test]
fn a_row_of_text_is_no_remark() {
    let text = "note,t_s,theta_deg\n#1,0,1\n#2,0.1,2\n";
    assert_eq!(read(text, &[]).unwrap().t_s, [0.0, 0.1]);
}

#[test]
fn a_mapped_column_that_is_not_there_is_named_with_those_that_are() {
    let error = read(LOCK_IN, &["t_s=Time (ms)", "xc_v=Ch1", "yc_v=Ch2", "temp_c=Ch9"]).unwrap_err().to_string();
    assert!(error.contains("`temp_c` is mapped to a column `Ch9`") && error.contains("`Note`"), "{error}");
}

fn element(kind: u32, bytes: &[u8]) -> Vec<u8> {
    let mut out = [kind.to_le_bytes(), u32::try_from(bytes.len()).unwrap().to_le_bytes()].concat();
    out.extend_from_slice(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A struct of a MATLAB 5 file: names of eight letters at most, with as many entries of arrays as are given.
fn structure(name: &str, names: &[&str], arrays: &[Vec<u8>]) -> Vec<u8> {
    let flags = [2u32.to_le_bytes(), 0u32.to_le_bytes()].concat();
    let size = [1u32.to_le_bytes(), u32::try_from(arrays.len() / names.len()).unwrap().to_le_bytes()].concat();
    let names: Vec<u8> = names.iter().flat_map(|name| format!("{name:\0<9}").into_bytes()).collect();
    // the width of a name is a small element: four bytes within the tag
    let width = [(4u32 << 16 | 5).to_le_bytes(), 9u32.to_le_bytes()].concat();
    let parts = [
        element(6, &flags),
        element(5, &size),
        element(1, name.as_bytes()),
        width,
        element(1, &names),
        arrays.concat(),
    ];
    element(14, &parts.concat())
}

/// One array of a MATLAB 5 file: real doubles, column by column.
fn matrix(name: &str, size: [u32; 2], values: &[f64]) -> Vec<u8> {
    let flags = [6u32.to_le_bytes(), 0u32.to_le_bytes()].concat();
    let size = size.map(u32::to_le_bytes).concat();
    let values: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    element(14, &[element(6, &flags), element(5, &size), element(1, name.as_bytes()), element(9, &values)].concat())
}

fn mat_5(arrays: &[Vec<u8>]) -> Vec<u8> {
    let mut file = format!("{:124}", "MATLAB 5.0 MAT-file, by a test").into_bytes();
    file.extend_from_slice(&[0x00, 0x01, b'I', b'M']);
    file.extend(arrays.concat());
    file
}

#[test]
fn a_matlab_file_is_read_by_its_arrays() {
    let bytes = mat_5(&[
        matrix("t_s", [3, 1], &[0.0, 0.1, 0.2]),
        matrix("rate_dps", [1, 3], &[5.0, 5.0, 5.0]),
        matrix("iq", [3, 2], &[1.0, 0.9, 0.8, 0.0, 0.1, 0.2]),
        matrix("fs", [1, 1], &[10.0]),
    ]);
    let mapped = naming(&["xc_v=iq(:,1)", "yc_v=iq(:,2)"]);
    let recording = Recording::read_from(bytes.as_slice(), &mapped, Path::new("a.mat")).unwrap();
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.0, 0.9, 0.8][..]));
    assert_eq!(recording.yc_v.as_deref(), Some(&[0.0, 0.1, 0.2][..]));
    assert!(recording.require_rotation().is_ok());
    assert!(recording.warnings.iter().any(|w| w.contains("`fs` has 1 values, the time 3")), "{:?}", recording.warnings);

    let mut file = tempfile::Builder::new().suffix(".mat").tempfile().unwrap();
    file.write_all(&bytes).unwrap();
    assert_eq!(Recording::read_named(file.path(), &mapped).unwrap().t_s, recording.t_s);
}

#[test]
fn the_fields_of_a_matlab_struct_are_columns() {
    let column = |values: &[f64]| matrix("", [3, 1], values);
    let run = structure(
        "run1",
        &["t_s", "iq", "temp_c"],
        &[column(&[0.0, 0.1, 0.2]), matrix("", [3, 2], &[1.0, 0.9, 0.8, 0.0, 0.1, 0.2]), column(&[25.0, 25.5, 26.0])],
    );
    let meta = structure("meta", &["temp_c", "rate"], &[matrix("", [1, 1], &[25.0]), matrix("", [1, 1], &[5.0])]);
    let bytes = mat_5(&[meta, run, matrix("table_deg", [3, 1], &[0.0, 1.0, 2.0])]);
    let mapped = naming(&["xc_v=iq(:,1)", "yc_v=iq(:,2)", "temp_c=run1.temp_c"]);
    let recording = Recording::read_from(bytes.as_slice(), &mapped, Path::new("a.mat")).unwrap();
    assert_eq!(recording.yc_v.as_deref(), Some(&[0.0, 0.1, 0.2][..]));
    assert_eq!(recording.temp_c.as_deref(), Some(&[25.0, 25.5, 26.0][..]));
    assert_eq!(recording.table_deg.as_deref(), Some(&[0.0, 1.0, 2.0][..]));
    assert!(
        recording.warnings.iter().any(|w| w.contains("`rate` has 1 values, the time 3")),
        "{:?}",
        recording.warnings
    );
}

#[test]
fn a_struct_of_several_entries_is_left_alone() {
    let column = || matrix("", [3, 1], &[0.0, 0.1, 0.2]);
    let bytes = mat_5(&[structure("runs", &["t_s", "theta_deg"], &[column(), column(), column(), column()])]);
    let said = Recording::read_from(bytes.as_slice(), Naming::NONE, Path::new("a.mat")).unwrap_err().to_string();
    assert!(said.contains("there are no columns"), "{said}");
}

fn hdf5() -> Vec<u8> {
    let mut file = hdf5_pure::FileBuilder::new();
    file.create_dataset("t_s").with_f64_data(&[0.0, 0.1, 0.2]);
    file.create_dataset("theta").with_f32_data(&[0.0, 10.0, 20.0]);
    file.create_dataset("rate_dps").with_i32_data(&[100, 100, 100]);
    file.finish().unwrap()
}

#[test]
fn an_hdf5_file_is_read_by_its_datasets() {
    let recording = Recording::read_from(hdf5().as_slice(), &naming(&["theta_deg=theta"]), Path::new("a.h5")).unwrap();
    assert_eq!(recording.theta_deg.as_deref(), Some(&[0.0, 10.0, 20.0][..]));
    assert_eq!(recording.rate_dps.as_deref(), Some(&[100.0; 3][..]));
    assert!(recording.require_rotation().is_ok());
}

#[test]
fn times_of_an_hdf5_file_may_be_dates() {
    let mut file = hdf5_pure::FileBuilder::new();
    let texts = ["2026-03-01T12:00:00", "2026-03-01T12:00:00.1", "2026-03-01T12:00:00.2"];
    file.create_dataset("when").with_vlen_strings(&texts);
    file.create_dataset("theta").with_f64_data(&[0.0, 10.0, 20.0]);
    file.create_dataset("rate_dps").with_f64_data(&[100.0; 3]);
    file.create_dataset("operator").with_vlen_strings(&["A", "B", "C"]);
    let bytes = file.finish().unwrap();
    let names = naming(&["t_s=when", "theta_deg=theta"]);
    let recording = Recording::read_from(bytes.as_slice(), &names, Path::new("a.h5")).unwrap();
    assert_eq!(recording.t_s, [0.0, 0.1, 0.2]);
    assert!(recording.warnings.iter().any(|w| w.contains("times are written as dates")), "{:?}", recording.warnings);
    let with_a_factor = naming(&["t_s=when/1000", "theta_deg=theta"]);
    let said = Recording::read_from(bytes.as_slice(), &with_a_factor, Path::new("a.h5")).unwrap_err().to_string();
    assert!(said.contains("`when` is of dates") && said.contains("factor"), "{said}");
    // what could be the time is named where none is mapped
    let said = Recording::read_from(bytes.as_slice(), Naming::NONE, Path::new("a.h5")).unwrap_err().to_string();
    assert!(said.contains("`when`"), "{said}");
}

#[test]
fn times_counted_since_1970_are_taken_to_seconds() {
    for (parts, unit) in [(1.0, ""), (1e3, "ms"), (1e6, "us"), (1e9, "ns")] {
        let text = (0..3).fold("t_s,rate_dps,theta_deg\n".to_owned(), |text, row| {
            format!("{text}{:.0},100,{}\n", parts * (1.777_888_8e9 + f64::from(row)), 8 * row)
        });
        let recording = Recording::parse_csv(text.as_bytes(), Path::new("a.csv")).unwrap();
        assert!((recording.t_s[2] - recording.t_s[0] - 2.0).abs() < 1e-6, "{unit}: {:?}", recording.t_s);
        let said = format!("`t_s` counts {unit} since 1970");
        assert_eq!(recording.warnings.iter().any(|w| w.contains(&said)), !unit.is_empty(), "{:?}", recording.warnings);
    }
}

#[test]
fn damaged_containers_are_refused_with_their_name() {
    let times = || matrix("t_s", [3, 1], &[0.0, 0.1, 0.2]);
    for bytes in [hdf5(), mat_5(&[times()]), mat_5(&[structure("s", &["t_s", "x"], &[times(), times()])])] {
        for cut in (16..bytes.len()).step_by(7) {
            let read = Recording::read_from(&bytes[..cut], Naming::NONE, Path::new("cut.bin"));
            assert!(read.is_err_and(|e| e.to_string().starts_with("cut.bin: ")), "cut at {cut}");
        }
    }
}

#[test]
fn recordings_of_one_folder_are_a_campaign_named_after_it() {
    let recording = |name: &str| {
        let text = "t_s,rate_dps,theta_deg\n0,100,0\n0.1,100,8\n";
        Recording::parse_csv(text.as_bytes(), &Path::new("dfp-7").join(name)).unwrap()
    };
    let campaign = Campaign::of_recordings(vec![recording("a.csv"), recording("b.csv")]).unwrap();
    assert_eq!((campaign.device.as_str(), campaign.runs.len()), ("dfp-7", 2));
    for file in ["a.csv", "a.csv.gz", "a.gz"] {
        assert_eq!(Campaign::of_recordings(vec![recording(file)]).unwrap().device, "a", "{file}");
    }
}
