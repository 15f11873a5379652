//! Recordings on disk: CSV and Parquet say the same, what is written reads back, and sample data reads without a loss.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cvg_recording::{Campaign, Channel, Naming, Place, Recording, Tally, UnknownColumn};
use proptest::prelude::*;
use tempfile::TempDir;

fn parse(text: impl AsRef<[u8]>) -> Recording {
    Recording::parse_csv(text.as_ref(), Path::new("a.csv")).unwrap()
}

/// All columns in their order, numbers as bits.
fn content(recording: &Recording) -> Vec<(String, Vec<String>)> {
    let cells = |name: &str| match Channel::of(name) {
        Some(channel) => {
            recording.channel(channel).unwrap().iter().map(|value| format!("{:x}", value.to_bits())).collect()
        }
        None => {
            let column = recording.unknown.iter().find(|column| column.name == name).unwrap();
            column.cells.iter().map(str::to_owned).collect()
        }
    };
    recording.column_names().map(|name| (name.to_owned(), cells(name))).collect()
}

fn written(recording: &Recording) -> String {
    let mut text = vec![];
    recording.write_csv(&mut text).unwrap();
    String::from_utf8(text).unwrap()
}

fn as_parquet(recording: &Recording) -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("rot.parquet");
    recording.write_parquet(fs::File::create(&path).unwrap()).unwrap();
    (folder, path)
}

#[test]
fn a_file_is_written_in_the_order_in_which_it_was_read() {
    let text = "yc_v,t_s,note,temp_c,xc_v\n0.1,0,\"a,\"\"b\"\"\",25,1\n-1e-7,0.5,,,1e300\n";
    assert_eq!(written(&parse(text)), text);
}

#[test]
fn a_recording_made_by_hand_is_written_in_the_usual_order() {
    let recording = Recording {
        t_s: vec![0.0, 0.1],
        yc_v: Some(vec![1.0, 2.0]),
        xc_v: Some(vec![3.0, 4.0]),
        ..Recording::default()
    };
    assert_eq!(written(&recording), "t_s,xc_v,yc_v\n0,3,1\n0.1,4,2\n");
}

#[test]
fn columns_of_unequal_length_are_not_written() {
    let recording = Recording { t_s: vec![0.0, 0.1], xc_v: Some(vec![1.0]), ..Recording::default() };
    let message = recording.write_csv(vec![]).unwrap_err().to_string();
    assert!(message.contains("column `xc_v` has 1 values, `t_s` has 2"), "{message}");
    assert!(recording.write_parquet(vec![]).is_err());
}

#[test]
fn parquet_and_csv_say_the_same() {
    let recording = parse("t_s,xc_v,note,yc_v,vas_v\n0,1,a,0.1,\n1,2,,0.2,-0.5\n");
    let (_folder, path) = as_parquet(&recording);
    let read = Recording::read(&path).unwrap();
    assert_eq!(content(&read), content(&recording));
    assert_eq!(read.dropped.missing_values, [(Channel::Vas, Tally { count: 1, first: Some(Place::Row(1)) })]);
}

#[test]
fn parquet_is_known_by_its_first_bytes_whatever_its_name() {
    let (folder, path) = as_parquet(&parse("t_s,xc_v,yc_v\n0,1,0\n"));
    let other = folder.path().join("rot.dat");
    fs::rename(path, &other).unwrap();
    assert_eq!(Recording::read(&other).unwrap().t_s, [0.0]);
}

#[test]
fn dirt_in_parquet_is_named_by_its_row() {
    let mut recording = parse("t_s,xc_v,yc_v\n0,1,0\n1,1,0\n2,1,0\n");
    recording.t_s = vec![0.0, 2.0, 1.0];
    let (_folder, path) = as_parquet(&recording);
    let message = Recording::read(&path).unwrap_err().to_string();
    assert!(message.contains("row 3: the time goes back from 2 s to 1 s"), "{message}");
    recording.t_s = vec![0.0, 0.0, 1.0];
    recording.yc_v = Some(vec![0.0, 0.0, f64::NAN]);
    let (_folder, path) = as_parquet(&recording);
    let dropped = Recording::read(&path).unwrap().dropped;
    assert_eq!(dropped.repeated_time, Tally { count: 1, first: Some(Place::Row(2)) });
    assert_eq!(dropped.empty_or_nan, Tally { count: 1, first: Some(Place::Row(3)) });
}

#[test]
fn a_broken_parquet_file_is_refused() {
    let (_folder, path) = as_parquet(&parse("t_s,xc_v,yc_v\n0,1,0\n"));
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
    let message = Recording::read(&path).unwrap_err().to_string();
    assert!(message.contains("is not a Parquet file that can be read here"), "{message}");
    fs::write(&path, "t_s,xc_v,yc_v\n0,1,0\n").unwrap();
    let message = Recording::read(&path).unwrap_err().to_string();
    assert!(message.contains("is named .parquet and does not begin with PAR1"), "{message}");
}

#[test]
fn files_that_are_not_there_and_folders_are_refused() {
    let folder = TempDir::new().unwrap();
    let message = Recording::read(&folder.path().join("no.csv")).unwrap_err().to_string();
    assert!(message.ends_with("no.csv: there is no such file"), "{message}");
    let message = Recording::read(folder.path()).unwrap_err().to_string();
    assert!(message.contains("is a directory"), "{message}");
}

/// All campaigns below the folder that a variable names.
fn campaigns(variable: &str) -> Vec<PathBuf> {
    let Some(folder) = std::env::var_os(variable) else {
        println!("skipped: {variable} is not set");
        return vec![];
    };
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path().join("campaign.toml"));
    entries.filter(|path| path.is_file()).collect()
}

#[test]
fn sample_campaigns_are_read_without_a_loss() {
    for path in campaigns("CVG_CAMPAIGNS").into_iter().chain(campaigns("CVG_MEASURED")) {
        let campaign = Campaign::open(&path).unwrap();
        for run in &campaign.runs {
            assert_eq!(run.recording.dropped.rows_dropped(), 0, "{}", run.recording.source.display());
            assert!(run.recording.len() >= 1000, "{}", run.recording.source.display());
        }
    }
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![any::<f64>().prop_filter("finite", |value| value.is_finite()), -10.0..10.0, Just(-0.0)]
}

prop_compose! {
    fn any_recording()(rows in 1_usize..40)(
        steps in proptest::collection::vec(1e-6..10.0, rows),
        xc_v in proptest::collection::vec(any_number(), rows),
        yc_v in proptest::collection::vec(any_number(), rows),
        vas_v in proptest::option::of(proptest::collection::vec(any_number(), rows)),
        cells in proptest::collection::vec("[a-z,;\"\n\r #%é\t]{0,5}", rows),
        name in "[#%a-z,;\" é]{1,5}".prop_filter("a name of its own", |name| Channel::of(name).is_none() && name.trim() == name),
        is_first in any::<bool>(),
    ) -> Recording {
        let t_s = steps.iter().scan(0.0, |t_s, step| { *t_s += step; Some(*t_s) }).collect();
        let columns = if is_first { vec![name.clone()] } else { vec![] };
        let unknown = vec![UnknownColumn { name, cells: cells.iter().collect() }];
        Recording { t_s, xc_v: Some(xc_v), yc_v: Some(yc_v), vas_v, unknown, columns, ..Recording::default() }
    }
}

proptest! {
    #[test]
    fn what_is_written_as_csv_reads_back_bit_for_bit(recording in any_recording()) {
        let text = written(&recording);
        let read = Recording::parse_csv(text.as_bytes(), Path::new("a.csv")).unwrap();
        prop_assert_eq!(content(&read), content(&recording));
        prop_assert_eq!(written(&read), text);
    }

    #[test]
    fn what_is_written_as_parquet_reads_back_bit_for_bit(recording in any_recording()) {
        let (_folder, path) = as_parquet(&recording);
        prop_assert_eq!(content(&Recording::read(&path).unwrap()), content(&recording));
    }

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = Recording::parse_csv(&bytes, Path::new("a.csv"));
    }

    #[test]
    fn no_bytes_in_the_place_of_others_make_the_parquet_reader_panic(at in 4_usize..400, byte in any::<u8>()) {
        let (_folder, path) = as_parquet(&parse("t_s,xc_v,yc_v,note\n0,1,0,a\n1,1,0,b\n"));
        let mut bytes = fs::read(&path).unwrap();
        let at = at.min(bytes.len() - 1);
        bytes[at] = byte;
        fs::write(&path, bytes).unwrap();
        let _ = Recording::read(&path);
    }
}

#[cfg(feature = "parquet")]
#[test]
fn time_stamps_in_parquet_are_times_counted_from_the_first() {
    use parquet::data_type::{DoubleType, Int64Type};
    use parquet::file::writer::SerializedFileWriter;
    let folder = TempDir::new().unwrap();
    for (unit, ticks) in [("MILLIS", 1e3), ("MICROS", 1e6), ("NANOS", 1e9)] {
        let schema = format!(
            "message m {{ required int64 t_s (TIMESTAMP({unit},true)); required double xc_v; required double yc_v; }}"
        );
        let schema = parquet::schema::parser::parse_message_type(&schema).unwrap();
        let path = folder.path().join(format!("{unit}.parquet"));
        let file = fs::File::create(&path).unwrap();
        let mut writer = SerializedFileWriter::new(file, schema.into(), Arc::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        // March 2026, a row every 20 ms: in nanoseconds more digits than a number has
        let first = 1_772_366_400i64 * ticks as i64 + 1;
        let stamps: Vec<i64> = (0..3).map(|i| first + i * (ticks as i64) / 50).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&stamps, None, None).unwrap();
        column.close().unwrap();
        for values in [[1.0, 0.0, -1.0], [0.0, 1.0, 0.0]] {
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<DoubleType>().write_batch(&values, None, None).unwrap();
            column.close().unwrap();
        }
        group.close().unwrap();
        writer.close().unwrap();
        let recording = Recording::read(&path).unwrap();
        let wanted = [0.0, 0.02, 0.04];
        assert!(recording.t_s.iter().zip(wanted).all(|(t, w)| (t - w).abs() < 1e-12), "{unit}: {:?}", recording.t_s);
        assert!(recording.warnings.iter().any(|w| w.contains("time stamps")), "{:?}", recording.warnings);
        let mut scaled = Naming::default();
        scaled.add("t_s=t_s*0.001").unwrap();
        assert!(Recording::read_named(&path, &scaled).unwrap_err().to_string().contains("has a factor"));
    }
}

/// Numbers of any size are written as every reader of tables takes them, and read back as they were; what is none is empty.
#[test]
fn numbers_are_written_as_other_readers_take_them() {
    let values =
        [0.0, -0.0, 1.0, -2.5, 1e-9, -3.25e-300, 1e5, 123_456_789.125, 1e16, -7e22, f64::MAX, 5e-324, f64::NAN];
    let t_s: Vec<f64> = (0..values.len()).map(|i| i as f64).collect();
    let columns = (Some(vec![1.0; values.len()]), Some(vec![0.0; values.len()]));
    let recording =
        Recording { t_s, xc_v: columns.0, yc_v: columns.1, temp_c: Some(values.to_vec()), ..Recording::default() };
    let mut text = vec![];
    recording.write_csv(&mut text).unwrap();
    let text = String::from_utf8(text).unwrap();
    let at = text.lines().next().unwrap().split(',').position(|name| name == "temp_c").unwrap();
    for (line, value) in text.lines().skip(1).zip(values) {
        let cell = line.split(',').nth(at).unwrap();
        if value.is_nan() {
            assert_eq!(cell, "");
            continue;
        }
        let is_plain = |c: char| c.is_ascii_digit() || matches!(c, '-' | '.' | 'e');
        assert!(cell.chars().all(is_plain) && cell.starts_with(|c: char| c == '-' || c.is_ascii_digit()), "{cell}");
        assert_eq!(cell.parse::<f64>().map(f64::to_bits), Ok(value.to_bits()), "{cell}");
    }
}

/// What pandas takes for a number is one here, in a row of plain numbers or not.
#[test]
fn numbers_are_read_as_other_readers_write_them() {
    let cells = [
        ("1e3", 1e3),
        ("+1", 1.0),
        (" 1 ", 1.0),
        ("1.", 1.0),
        (".5", 0.5),
        ("-0", -0.0),
        ("1E-05", 1e-5),
        ("\"2\"", 2.0),
    ];
    let rows: String = cells.iter().enumerate().map(|(i, (cell, _))| format!("{i},10,{cell}\n")).collect();
    let recording =
        Recording::parse_csv(format!("t_s,rate_dps,theta_deg\n{rows}").as_bytes(), Path::new("a.csv")).unwrap();
    assert_eq!(recording.theta_deg.unwrap(), cells.map(|(_, value)| value));
    // thousands are none: a comma separates columns, or is the decimal one
    let grouped = "t_s;rate_dps;theta_deg\n0;10;1,000.5\n";
    let said = Recording::parse_csv(grouped.as_bytes(), Path::new("a.csv")).unwrap_err().to_string();
    assert!(said.contains("line 2, column 3") && said.contains("1,000.5"), "{said}");
}
