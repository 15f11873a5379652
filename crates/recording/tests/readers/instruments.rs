//! What instruments write around their numbers: dates in the place of seconds, rows of units, and lines about themselves.

use std::path::Path;

use cvg_recording::{Naming, ReadError, Recording};

fn read(text: &str, entries: &[&str]) -> Result<Recording, ReadError> {
    let mut naming = Naming::default();
    entries.iter().for_each(|e| naming.add(e).unwrap());
    Recording::read_from(text.as_bytes(), &naming, Path::new("bench.csv"))
}

fn refusal(text: &str, entries: &[&str]) -> String {
    read(text, entries).expect_err("it is refused").to_string()
}

fn assert_warns(recording: &Recording, of: &str) {
    assert!(recording.warnings.iter().any(|warning| warning.contains(of)), "{of:?} in {:?}", recording.warnings);
}

#[test]
fn dates_are_times_counted_from_the_first() {
    let text = "When;xc_v;yc_v\n2026-03-01T12:00:00.000000001+01:00;1,5;0\n2026-03-01T11:00:00.250000001Z;0,5;1\n";
    let recording = read(text, &["t_s=When"]).unwrap();
    assert_eq!(recording.t_s, [0.0, 0.25]);
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.5, 0.5][..]), "the point in a date is no decimal mark");
    assert_warns(&recording, "`t_s` is counted from the first");
    let quoted = "t_s,xc_v,yc_v\n\"2026-03-01 12:00:00,5\",1,0\n2026-03-01 12:00:01.5,0,1\n";
    assert_eq!(read(quoted, &[]).unwrap().t_s, [0.0, 1.0]);
}

#[test]
fn dates_that_cannot_be_counted_are_refused_with_their_line() {
    let row = |second: &str| format!("t_s,xc_v,yc_v\n2026-03-01T12:00:01Z,1,0\n{second},0,1\n");
    assert!(refusal(&row("2026-03-01T12:00:00Z"), &[]).contains("line 3: the time goes back from 0 s to -1 s"));
    for other in ["2026-03-01T12:00:02", "2.5", "2026-02-30T12:00:00Z"] {
        let said = refusal(&row(other), &[]);
        assert!(said.contains("line 3, column 1 (`t_s`)") && said.contains("a date with a time of day"), "{said}");
    }
    let said = refusal("t_s,xc_v,yc_v\n01/03/2026 12:00:01,1,0\n", &[]);
    assert!(said.contains("not a number of seconds, a date such as 2026-03-01T12:00:00.25Z or 01.03.2026"), "{said}");
    let said = refusal(&row("2026-03-01T12:00:02Z").replace("t_s", "Time"), &["t_s=Time*0.001"]);
    assert!(said.contains("the mapping without a factor"), "{said}");
}

#[test]
fn a_date_that_is_missing_drops_its_row() {
    let text = "t_s,xc_v,yc_v\n,9,9\n2026-03-01T12:00:01Z,1,0\n,2,2\n2026-03-01T12:00:02Z,0,1\n";
    let recording = read(text, &[]).unwrap();
    assert_eq!((recording.t_s.as_slice(), recording.dropped.empty_or_nan.count), (&[0.0, 1.0][..], 2));
}

#[test]
fn a_row_of_units_is_a_conversion_that_is_said() {
    for units in ["ms,rad/s,mV,mV", "[ms],[rad/s],[mV],[mV]", "# ms, rad/s, mV, mV"] {
        let recording = read(&format!("t_s,rate_dps,xc_v,yc_v\n{units}\n0,1,1000,0\n10,1,0,1000\n"), &[]).unwrap();
        assert_eq!(recording.t_s, [0.0, 0.01], "{units}");
        assert_eq!(recording.rate_dps.as_deref(), Some(&[180.0 / std::f64::consts::PI; 2][..]), "{units}");
        assert_eq!(recording.yc_v.as_deref(), Some(&[0.0, 1.0][..]), "{units}");
        assert_warns(&recording, "`rate_dps` is in rad/s and taken to deg/s");
        assert_warns(&recording, "`t_s` is in ms and taken to s");
    }
}

#[test]
fn temperatures_in_kelvin_or_fahrenheit_become_celsius() {
    let of = |head: &str, rows: &str| {
        let recording = read(&format!("{head}{rows}"), &[]).unwrap();
        (recording.temp_c.unwrap(), recording.warnings)
    };
    let (head, in_f) = ("t_s,rate_dps,xc_v,yc_v,temp_c\n", "0,1,1,0,77\n1,1,0,1,68\n");
    let near = |found: &[f64], wanted: [f64; 2]| found.iter().zip(wanted).all(|(f, w)| (f - w).abs() < 1e-9);
    let (stated, said) = of(&format!("{head}s,deg/s,V,V,°F\n"), in_f);
    assert!(near(&stated, [25.0, 20.0]) && said.len() == 1, "{stated:?} {said:?}");
    // no electronics work at 298 °C
    let (absolute, said) = of(head, "0,1,1,0,298.15\n1,1,0,1,293.15\n");
    assert!(near(&absolute, [25.0, 20.0]) && said[0].contains("taken for K"), "{absolute:?} {said:?}");
    // some do at 77, and at 225
    for rows in [in_f, "0,1,1,0,225\n1,1,0,1,298\n"] {
        assert!(of(head, rows).0[0] > 70.0 && of(head, rows).1.is_empty(), "{rows}");
    }
}

#[test]
fn units_that_are_ours_change_nothing_and_rows_keep_their_lines() {
    let text = "t_s,table_deg,xc_v,yc_v,note\ns,deg,V,V,-\n0,0,1,0,a\n1,10,x,1,b\n";
    let said = refusal(text, &[]);
    assert!(said.contains("line 4, column 3 (`xc_v`): \"x\" is not a number"), "{said}");
    let recording = read(&text.replace('x', "0").replace("0c_v", "xc_v"), &[]).unwrap();
    assert_eq!(recording.table_deg.as_deref(), Some(&[0.0, 10.0][..]));
    assert_eq!(recording.unknown[0].cells.iter().collect::<Vec<_>>(), ["a", "b"]);
    assert_eq!(recording.warnings, ["bench.csv: unknown columns, kept and not used: `note`"]);
}

#[test]
fn a_unit_that_is_not_known_is_refused_with_the_next_step() {
    let text = "Clock,Pos,xc_v,yc_v\nticks,deg,V,V\n0,0,1,0\n10,1,0,1\n";
    let said = refusal(text, &["t_s=Clock", "table_deg=Pos"]);
    assert!(said.contains("`t_s` is in \"ticks\"; wanted s") && said.contains("--map 't_s=Clock*FACTOR'"), "{said}");
    let recording = read(text, &["t_s=Clock*0.001", "table_deg=Pos"]).unwrap();
    assert_eq!(recording.t_s, [0.0, 0.01]);
    assert_warns(&recording, "`t_s` is said to be in ticks; the factor 0.001 of the mapping is taken");
}

#[test]
fn a_factor_stands_over_the_unit_it_agrees_with() {
    let recording = read("Clock,xc_v,yc_v\nms,V,V\n0,1,0\n10,0,1\n", &["t_s=Clock/1000"]).unwrap();
    assert_eq!(recording.t_s, [0.0, 0.01]);
    assert!(recording.warnings.is_empty(), "{:?}", recording.warnings);
}

#[test]
fn channels_in_counts_or_in_a_field_are_kept_in_it_together() {
    let recording = read("t_s,xc_v,yc_v\ns,counts,counts\n0,100,0\n1,0,100\n", &[]).unwrap();
    assert_eq!(recording.xc_v.as_deref(), Some(&[100.0, 0.0][..]));
    assert_warns(&recording, "`xc_v`, `yc_v` are in counts and kept in it");
    assert_eq!(recording.readout_unit.as_deref(), Some("counts"));
    let said = refusal("t_s,xc_v,yc_v\ns,uT,mT\n0,100,0\n1,0,100\n", &[]);
    assert!(said.contains("`xc_v` is in \"uT\"; wanted V"), "{said}");
}

#[test]
fn currents_of_photodiodes_are_no_missing_values() {
    let recording = read("t_s,xc_v,yc_v\ns,nA,nA\n0,100,0\n1,0,100\n", &[]).unwrap();
    assert_eq!(recording.readout_unit.as_deref(), Some("nA"));
    assert_warns(&recording, "`xc_v`, `yc_v` are in nA and kept in it");
}

#[test]
fn what_stands_in_brackets_and_is_no_unit_that_is_known_is_said_or_kept() {
    let maps = ["t_s=Time (ticks)", "xc_v=PD1 [nA]", "yc_v=PD2 [nA]"];
    let recording = read("Time (ticks),PD1 [nA],PD2 [nA]\n0,100,0\n1,0,100\n", &maps).unwrap();
    assert_eq!(recording.readout_unit.as_deref(), Some("nA"));
    assert_warns(&recording, "`t_s`: ticks is no unit that is known; it is taken for s");
    let maps = ["xc_v=a (cts)", "yc_v=b (cts)"];
    let recording = read("t_s,a (cts),b (cts)\n0,100,0\n1,0,100\n", &maps).unwrap();
    assert_eq!(recording.readout_unit.as_deref(), Some("counts"));
    // names and no units
    let maps = ["xc_v=U (A)", "yc_v=U (B)"];
    let recording = read("t_s,U (A),U (B)\n0,100,0\n1,0,100\n", &maps).unwrap();
    assert_eq!((recording.readout_unit, recording.warnings.len()), (None, 0));
}

#[test]
fn a_unit_in_the_brackets_of_a_mapped_name_is_a_conversion_too() {
    let text = "Time (ms),Pos [rad],A (left),B\n0,0,1,0\n10,1,0,1\n";
    let recording = read(text, &["t_s=Time (ms)", "table_deg=Pos [rad]", "xc_v=A (left)", "yc_v=B"]).unwrap();
    assert_eq!(recording.t_s, [0.0, 0.01]);
    assert_eq!(recording.table_deg.as_deref(), Some(&[0.0, 180.0 / std::f64::consts::PI][..]));
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.0, 0.0][..]));
    assert_warns(&recording, "`table_deg` is in rad and taken to deg");
    let kept = read(text, &["t_s=Time (ms)*1", "table_deg=Pos [rad]", "xc_v=A (left)", "yc_v=B"]).unwrap();
    assert_eq!(kept.t_s, [0.0, 10.0], "a factor of 1 keeps it");
}

#[test]
fn a_row_of_words_without_one_number_is_no_row_of_units_where_a_number_stands_in_it() {
    let said = refusal("t_s,xc_v,yc_v\n0,OVER,OVER\n1,1,0\n", &[]);
    assert!(said.contains("line 2, column 2 (`xc_v`): \"OVER\" is not a number"), "{said}");
}

const LABVIEW: &str = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tOne\n\
    Date\t2026/03/01\nTime\t12:00:00,5\n***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t3\t3\t\n\
    Y_Unit_Label\tMillivolts\tMillivolts\t\nX_Dimension\tTime\tTime\t\nX0\t0,0E+0\t0,0E+0\t\nDelta_X\t0,100000\t0,100000\t\n\
    ***End_of_Header***\t\t\t\nX_Value\tSin\tCos\tComment\n0,000000\t1000,0\t0,0\tstart\n0,100000\t500,0\t600,0\n0,200000\t0,0\t1000,0\n";

#[test]
fn a_labview_file_is_read_below_what_it_says_of_itself() {
    for text in [LABVIEW.to_owned(), LABVIEW.replace('\n', "\r\n")] {
        let recording = read(&text, &["t_s=X_Value", "xc_v=Sin", "yc_v=Cos"]).unwrap();
        assert_eq!(recording.t_s, [0.0, 0.1, 0.2]);
        assert_eq!(recording.xc_v.as_deref(), Some(&[1.0, 0.5, 0.0][..]));
        assert_warns(&recording, "lines 1 to 16, above the header, are passed over");
        assert_warns(&recording, "`xc_v`, `yc_v` are in Millivolts and taken to V");
        assert_eq!(recording.unknown[0].cells.iter().collect::<Vec<_>>(), ["start", "", ""]);
    }
}

#[test]
fn the_times_that_labview_leaves_out_are_counted() {
    let blank =
        |row: &str| row.replacen("0,000000", "", 1).replacen("\n0,100000", "\n", 1).replacen("\n0,200000", "\n", 1);
    let (above, rows) = LABVIEW
        .replace("X_Columns\tOne", "X_Columns\tNo")
        .split_once("X_Value")
        .map(|(a, b)| (a.to_owned(), b.to_owned()))
        .unwrap();
    let text = above.clone() + "X_Value" + &blank(&rows);
    let names = ["t_s=X_Value", "xc_v=Sin", "yc_v=Cos"];
    let recording = read(&text, &names).unwrap();
    assert_eq!((recording.t_s.len(), recording.t_s[0], recording.t_s[2]), (3, 0.0, 0.2));
    assert_warns(&recording, "X_Columns is No: `t_s` is counted from 0 in steps of 0.1");
    let said = refusal(&text.replace("Delta_X\t0,100000\t0,100000", "Delta_X\t0,1\t0,2"), &names);
    assert!(said.contains("differ from column to column") && said.contains("X_Columns One"), "{said}");
    let said = refusal(&text.replace("Delta_X\t0,100000\t0,100000\t\n", ""), &names);
    assert!(said.contains("there is no X0 with a Delta_X"), "{said}");
}

#[test]
fn times_that_labview_writes_beside_each_column_are_taken_once() {
    let (above, _) = LABVIEW.split_once("X_Value").unwrap();
    let above = above
        .replace("X_Columns\tOne", "X_Columns\tMulti")
        .replace("Y_Unit_Label\tMillivolts\tMillivolts\t", "Y_Unit_Label\tMillivolts\t\tMillivolts\t\t")
        .replace("X0\t0,0E+0\t0,0E+0", "X0\t0,0E+0\t\t0,0E+0\t")
        .replace("Delta_X\t0,100000\t0,100000", "Delta_X\t0,100000\t\t0,100000\t");
    let rows = "X_Value\tSin\tX_Value\tCos\tComment\n0,0\t1000,0\t0,0\t0,0\n0,1\t500,0\t0,1\t600,0\n";
    let names = ["t_s=X_Value", "xc_v=Sin", "yc_v=Cos"];
    let recording = read(&(above.clone() + rows), &names).unwrap();
    assert_eq!((recording.t_s.clone(), recording.yc_v.clone()), (vec![0.0, 0.1], Some(vec![0.0, 0.6])));
    let other = above.replace("X0\t0,0E+0\t\t0,0E+0", "X0\t0,0E+0\t\t5,0E-2");
    assert!(refusal(&(other + rows), &names).contains("differ from column to column"));
}

#[test]
fn lines_of_text_above_the_header_are_passed_over_and_said() {
    let text = "Bench 3, operator X\nSample rate;100 Hz\n\nt_s;xc_v;yc_v\n0;1,5;0\n1;0;x\n";
    let said = refusal(text, &[]);
    assert!(said.contains("line 6, column 3 (`yc_v`): \"x\""), "{said}");
    let recording = read(&text.replace('x', "1").replace("1c_v", "xc_v"), &[]).unwrap();
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.5, 0.0][..]));
    assert_warns(&recording, "lines 1 to 3, above the header, are passed over");
}

#[test]
fn a_file_without_our_names_is_refused_with_the_names_above_its_numbers() {
    for text in ["Bench 3\nRun;5\n\nClock;A;B\nms;V;V\n0;1,5;0\n10;0;1\n", "Clock;A;B\n0;1;0\n", LABVIEW] {
        let said = refusal(text, &[]);
        let names = if text == LABVIEW { "`X_Value`, `Sin`, `Cos`" } else { "`Clock`, `A`, `B`" };
        assert!(said.contains(&format!("there are {names}")), "{said}");
    }
}

#[test]
fn columns_between_blanks_are_refused_with_the_next_step() {
    let said = refusal("t_us mag_x mag_y\n0 -132 -1728\n5000 -112 -1736\n", &[]);
    assert!(said.contains("line 1: the columns are separated by blanks; wanted `,`, `;`, `|` or tabs"), "{said}");
}

#[test]
fn a_rate_mapped_to_an_angle_is_integrated_over_the_rows_that_are_kept() {
    let text = "Time (ms),Gyro (rad/s),Pos\n0,0,0\n500,1,1\n700,,1\n1000,1,2\n";
    let entries = ["t_s=Time (ms)", "theta_deg=integral(Gyro (rad/s))", "table_deg=Pos"];
    let recording = read(text, &entries).unwrap();
    let turned = recording.theta_deg.as_deref().unwrap();
    let wanted = [0.0, 0.25, 0.75].map(f64::to_degrees);
    assert!(turned.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12) && turned.len() == 3, "{turned:?}");
    assert_warns(&recording, "`theta_deg` is the integral of `Gyro (rad/s)` over time, from 0 on");
    let negated = read(text, &[entries[0], "theta_deg=integral(Gyro (rad/s))*-1", entries[2]]).unwrap();
    assert_eq!(negated.theta_deg.unwrap()[1], -0.25, "a factor is the user's own, in deg/s a unit");
}

/// Without its unit 450 °C would be read as 450 K, a time of years as milliseconds since 1970, and counts as volts.
#[test]
fn what_was_stated_in_a_unit_and_looks_like_another_is_written_with_its_unit() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("hot.parquet");
    for text in [
        "t_s,table_deg,xc_v,yc_v,note,temp_c\ns,deg,V,V,-,K\n0,0,1,0,a,723.1\n1,1,1,0,b,724\n",
        "t_s,theta_deg,table_deg\nh,deg,deg\n1e9,0,0\n2e9,1,1\n",
        "t_s,xc_v,yc_v,temp_c\ns,counts,counts,K\n0,100,0,723.1\n1,0,100,724\n",
        "t_s,xc_v,yc_v\ns,\"a, b\",\"a, b\"\n0,100,0\n1,0,100\n",
    ] {
        let read = |text: &[u8]| Recording::parse_csv(text, Path::new("hot.csv")).unwrap();
        let written = |recording: &Recording| {
            let mut text = vec![];
            recording.write_csv(&mut text).unwrap();
            text
        };
        let first = read(text.as_bytes());
        first.write_parquet(std::fs::File::create(&path).unwrap()).unwrap();
        for again in [read(&written(&first)), Recording::read(&path).unwrap()] {
            assert_eq!((again.temp_c.as_ref(), &again.t_s), (first.temp_c.as_ref(), &first.t_s));
            assert_eq!((again.xc_v.as_ref(), &again.readout_unit), (first.xc_v.as_ref(), &first.readout_unit));
            assert_eq!(written(&again), written(&first));
        }
    }
}
