//! Columns in memory: the same recording as from a file with the same numbers, and the same refusals.

use std::path::Path;

use cvg_recording::{Campaign, Channel, Naming, Place, ReadError, Recording, RunKind, Values};

const TEXT: &str = "t_s,rate_dps,theta_deg,note\n0,10,0.5,a\n0.1,10,,b\n0.2,10,2.5,c\n0.3,10,3.5,d\n";

fn columns() -> Vec<(String, Values)> {
    let numbers = |name: &str, values: &[f64]| (name.to_owned(), Values::Numbers(values.to_vec()));
    vec![
        numbers("t_s", &[0.0, 0.1, 0.2, 0.3]),
        numbers("rate_dps", &[10.0; 4]),
        numbers("theta_deg", &[0.5, f64::INFINITY, 2.5, 3.5]),
        ("note".to_owned(), Values::Texts(["a", "b", "c", "d"].into_iter().collect())),
    ]
}

fn made(columns: Vec<(String, Values)>, naming: &Naming) -> Result<Recording, ReadError> {
    Recording::of_columns(columns, naming, Path::new("frame"))
}

#[test]
fn columns_in_memory_are_admitted_as_those_of_a_file() {
    let (memory, file) =
        (made(columns(), Naming::NONE).unwrap(), Recording::parse_csv(TEXT.as_bytes(), Path::new("frame")).unwrap());
    for channel in Channel::ALL {
        assert_eq!(memory.channel(channel), file.channel(channel), "{channel}");
    }
    assert_eq!((&memory.unknown, &memory.columns), (&file.unknown, &file.columns));
    assert_eq!(memory.dropped.empty_or_nan.first, Some(Place::Row(2)));
    assert_eq!(file.dropped.empty_or_nan.first, Some(Place::Line(3)));
    assert!(memory.in_memory && !file.in_memory);
}

#[test]
fn a_mapping_names_and_scales_columns_in_memory() {
    let mut naming = Naming::default();
    naming.add("t_s=ms*0.001").unwrap();
    let mut own = columns();
    own[0] = ("ms".to_owned(), Values::Numbers(vec![0.0, 100.0, 200.0, 300.0]));
    assert_eq!(made(own, &naming).unwrap().t_s, [0.0, 0.2, 300.0 * 0.001]);
}

#[test]
fn columns_that_cannot_be_a_recording_are_refused_with_their_place() {
    let mut short = columns();
    short[1].1 = Values::Numbers(vec![1.0]);
    assert!(made(short, Naming::NONE).unwrap_err().to_string().contains("`rate_dps` has 1 values"));
    let mut text = columns();
    text[2].1 = texts(["1", "2", "three", "4"]);
    let error = made(text, Naming::NONE).unwrap_err();
    assert_eq!((error.place(), error.column(), error.path()), (Some(Place::Row(3)), Some(3), Path::new("frame")));
    assert!(error.to_string().contains("\"three\" is not a number"), "{error}");
    let mut lists = columns();
    lists[2].1 = lists_of(4);
    let error = made(lists, Naming::NONE).unwrap_err().to_string();
    assert!(error.contains("`theta_deg` is of the type LIST") && error.contains("wanted numbers"), "{error}");
    let without = columns().into_iter().take(2).collect();
    assert!(matches!(made(without, Naming::NONE), Err(ReadError::MissingColumns { .. })));
    assert!(made(Vec::new(), Naming::NONE).is_err());
}

fn texts(cells: [&str; 4]) -> Values {
    Values::Texts(cells.into_iter().collect())
}

fn lists_of(rows: usize) -> Values {
    Values::Unreadable { rows, why: "is of the type LIST".to_owned() }
}

#[test]
fn the_texts_of_a_channel_are_read_as_in_csv() {
    let mut own = columns();
    own[0].1 = texts(["0", "0.1", "2e-1", " 0.3 "]);
    own[2].1 = texts(["0.5", "NA", "2.5", "3.5"]);
    let (own, numbers) = (made(own, Naming::NONE).unwrap(), made(columns(), Naming::NONE).unwrap());
    assert_eq!((&own.t_s, &own.theta_deg, &own.warnings), (&numbers.t_s, &numbers.theta_deg, &numbers.warnings));
}

#[test]
fn dates_in_the_place_of_times_are_counted_from_the_first() {
    let mut own = columns();
    own[0].1 = texts([
        "2026-03-01 12:00:00",
        "2026-03-01T12:00:00.1",
        "2026-03-01T12:00:00.2",
        "2026-03-01 12:00:00.300000000",
    ]);
    let read = made(own.clone(), Naming::NONE).unwrap();
    assert_eq!(read.t_s, [0.0, 0.2, 3e8 * 1e-9], "the row without an angle is dropped");
    assert!(read.warnings.iter().any(|w| w.contains("dates")), "{:?}", read.warnings);
    // a unit in the name is none of dates, and a factor cannot be meant
    own[0].0 = "Time (ms)".to_owned();
    let mut naming = Naming::default();
    naming.add("t_s=Time (ms)").unwrap();
    assert_eq!(made(own.clone(), &naming).unwrap().t_s, [0.0, 0.2, 3e8 * 1e-9]);
    let mut scaled = Naming::default();
    scaled.add("t_s=Time (ms)*0.001").unwrap();
    assert!(made(own.clone(), &scaled).unwrap_err().to_string().contains("factor"));
    own[0] = ("t_s".to_owned(), texts(["2026-03-01 12:00:00", "0.1", "0.2", "0.3"]));
    assert_eq!(made(own, Naming::NONE).unwrap_err().place(), Some(Place::Row(2)));
}

#[test]
fn what_cannot_be_read_and_is_no_channel_is_left_out_and_said() {
    let mut own = columns();
    own.insert(0, ("peaks".to_owned(), lists_of(4)));
    let read = made(own, Naming::NONE).unwrap();
    let plain = made(columns(), Naming::NONE).unwrap();
    assert_eq!((&read.t_s, &read.unknown), (&plain.t_s, &plain.unknown));
    assert!(
        read.warnings.contains(&"frame: column `peaks` is of the type LIST and is left out".to_owned()),
        "{:?}",
        read.warnings
    );
}

#[test]
fn the_text_of_a_campaign_takes_recordings_from_anywhere() {
    let text = "[campaign]\ndevice = \"unit\"\n[[run]]\nkind = \"rotation\"\nfile = \"first\"\n";
    let opened = |text: &str| {
        Campaign::of_text(text, Path::new("campaign"), Naming::NONE, None, |file, naming| {
            assert_eq!(file, Path::new("first"));
            Recording::of_columns(columns(), naming, file)
        })
    };
    let campaign = opened(text).unwrap();
    assert_eq!((campaign.device.as_str(), campaign.runs[0].kind), ("unit", RunKind::Rotation));
    let error = opened(&text.replace("rotation", "waltz")).unwrap_err();
    assert_eq!((error.place(), error.column()), (Some(Place::Line(4)), Some(8)), "{error}");
}

#[test]
fn a_factor_a_unit_or_an_integral_is_of_the_column_that_is_mapped_and_of_no_other() {
    for text in ["t_s=ms*0.001", "t_s=Time (ms)", "theta_deg=integral(Ch3)", "rate_dps=Rate*60"] {
        let mut naming = Naming::default();
        naming.add(text).unwrap();
        let (read, plain) = (made(columns(), &naming).unwrap(), made(columns(), Naming::NONE).unwrap());
        assert_eq!((&read.t_s, &read.rate_dps), (&plain.t_s, &plain.rate_dps), "{text}");
        assert_eq!(read.theta_deg, plain.theta_deg, "{text}");
        let said = |of: &str| read.warnings.iter().any(|warning| warning.contains(of));
        assert!(said("there is no column `") && said("is taken as it is"), "{text}: {:?}", read.warnings);
        // and in a file of text
        let mut csv = Vec::new();
        plain.write_csv(&mut csv).unwrap();
        let read = Recording::read_from(csv.as_slice(), &naming, Path::new("file")).unwrap();
        assert_eq!((read.t_s, read.theta_deg), (plain.t_s, plain.theta_deg), "{text}");
    }
    // its own name is a column that is there
    let mut naming = Naming::default();
    naming.add("t_s=T_s*0.001").unwrap();
    assert_eq!(made(columns(), &naming).unwrap().t_s[2], 0.001 * made(columns(), Naming::NONE).unwrap().t_s[2]);
}
