//! What real CSV files have in them that they should not: each kind is handled and counted, or refused with its place.

use std::path::Path;

use cvg_recording::{Channel, Place, ReadError, Recording, Tally};

const HEADER: &str = "t_s,rate_dps,xc_v,yc_v,vas_v";

fn parse(text: impl AsRef<[u8]>) -> Result<Recording, ReadError> {
    Recording::parse_csv(text.as_ref(), Path::new("bench/rot.csv"))
}

/// Reads rows below the usual header, which is line 1.
fn rows(rows: &str) -> Result<Recording, ReadError> {
    parse(format!("{HEADER}\n{rows}"))
}

fn refusal(text: impl AsRef<[u8]>) -> String {
    let message = parse(text).expect_err("the text is refused").to_string();
    assert!(message.starts_with("bench/rot.csv: "), "{message}");
    message
}

fn once(line: u64) -> Tally {
    Tally { count: 1, first: Some(Place::Line(line)) }
}

fn assert_warns(recording: &Recording, of: &str) {
    assert!(recording.warnings.iter().any(|warning| warning.contains(of)), "{of:?} in {:?}", recording.warnings);
}

#[test]
fn a_clean_file_is_read_without_a_word() {
    let recording = rows("0,500,1,0.1,-0.1\n0.01,500,0.9,0.2,-0.2\n").unwrap();
    assert_eq!(recording.t_s, [0.0, 0.01]);
    assert_eq!(recording.yc_v.as_deref(), Some(&[0.1, 0.2][..]));
    assert_eq!(recording.theta_deg, None);
    assert!(recording.warnings.is_empty(), "{:?}", recording.warnings);
    assert_eq!((recording.dropped.rows_read, recording.dropped.rows_kept), (2, 2));
}

#[test]
fn rows_without_time_reference_or_angle_are_dropped_and_counted() {
    let recording =
        rows("0,500,1,0,0\n1,500,,0,0\n2,500,NaN,0,0\n3,inf,1,0,0\n,500,1,0,0\n5,500,1,n/a,0\n6,500,1,0,0\n").unwrap();
    assert_eq!(recording.t_s, [0.0, 6.0]);
    assert_eq!(recording.dropped.empty_or_nan, Tally { count: 5, first: Some(Place::Line(3)) });
    assert_eq!((recording.dropped.rows_read, recording.dropped.rows_kept), (7, 2));
    assert_warns(
        &recording,
        "rot.csv: 5 of 7 rows dropped: the time, the reference or the angle is empty or not finite, first line 3",
    );
}

#[test]
fn a_missing_controller_output_is_nan_and_counted() {
    let recording = rows("0,500,1,0,\n1,500,1,0,nan\n2,500,1,0,-0.1\n").unwrap();
    let vas_v = recording.vas_v.as_deref().unwrap();
    assert!(vas_v[0].is_nan() && vas_v[1].is_nan() && vas_v[2] == -0.1);
    assert_eq!(recording.dropped.missing_values, [(Channel::Vas, Tally { count: 2, first: Some(Place::Line(2)) })]);
    assert_eq!(recording.dropped.rows_dropped(), 0);
    assert_warns(&recording, "`vas_v` is empty or not finite in 2 rows");
}

#[test]
fn a_column_without_any_number_is_absent_and_said_to_be() {
    let recording = rows("0,500,1,0,\n1,500,1,0,\n").unwrap();
    assert_eq!(recording.vas_v, None);
    assert_warns(&recording, "column `vas_v` has no number in any row");
    let recording = rows("0,500,1,0,\n0,500,1,0,-0.1\n").unwrap();
    assert_eq!((recording.vas_v, recording.dropped.repeated_time), (None, once(3)));
    let text = "t_s,xc_v,yc_v\n0,1,\n1,2,\n";
    assert!(
        refusal(text).contains("none of the 2 rows can be used: `yc_v` without a single number"),
        "{}",
        refusal(text)
    );
}

#[test]
fn a_repeated_time_stamp_is_dropped_and_counted() {
    let recording = rows("0,500,1,0,0\n1,500,1,0,0\n1,500,2,0,0\n2,500,1,0,0\n").unwrap();
    assert_eq!(recording.t_s, [0.0, 1.0, 2.0]);
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.0, 1.0, 1.0][..]));
    assert_eq!(recording.dropped.repeated_time, once(4));
    assert_warns(&recording, "the time stamp is an earlier row's, first line 4");
}

#[test]
fn a_block_that_was_sent_twice_is_dropped_and_counted() {
    let recording = rows("0,500,1,0,0\n1,500,2,0,0\n2,500,3,0,0\n1,500,2,0,0\n2,500,3,0,0\n3,500,4,0,0\n").unwrap();
    assert_eq!(recording.t_s, [0.0, 1.0, 2.0, 3.0]);
    assert_eq!(recording.dropped.repeated_time, Tally { count: 2, first: Some(Place::Line(5)) });
}

#[test]
fn a_time_that_goes_back_is_refused_with_its_line() {
    let message = refusal(format!("{HEADER}\n0,500,1,0,0\n2,500,2,0,0\n1,500,3,0,0\n"));
    assert!(message.contains("line 4: the time goes back from 2 s to 1 s"), "{message}");
    let message = refusal(format!("{HEADER}\n0,500,1,0,0\n1,500,2,0,0\n0,500,9,0,0\n1,500,9,0,0\n"));
    assert!(message.contains("line 4: the time goes back from 1 s to 0 s"), "{message}");
}

#[test]
fn a_last_line_with_too_few_fields_is_dropped_as_cut_off() {
    for end in ["1,500,0.9", "1,500,0.9\n", "1,500,0.9\n\n\n", "1"] {
        let recording = rows(&format!("0,500,1,0,0\n{end}")).unwrap();
        assert_eq!(recording.t_s, [0.0], "{end:?}");
        assert_eq!(recording.dropped.truncated_last_line, once(3), "{end:?}");
        assert_eq!((recording.dropped.rows_read, recording.dropped.rows_kept), (2, 1), "{end:?}");
        assert_warns(&recording, "the last line is cut off, first line 3");
    }
}

#[test]
fn a_last_line_cut_off_in_its_last_number_is_dropped() {
    for end in ["1,500,0.9,0,", "1,500,0.9,0,-", "1,500,0.9,0,1.5e-"] {
        let recording = rows(&format!("0,500,1,0,0\n{end}")).unwrap();
        assert_eq!(recording.dropped.truncated_last_line, once(3), "{end:?}");
    }
}

#[test]
fn a_whole_last_line_without_a_line_end_is_kept_with_a_warning() {
    let recording = rows("0,500,1,0,0\n1,500,1,0,0").unwrap();
    assert_eq!(recording.t_s, [0.0, 1.0]);
    assert_warns(&recording, "line 3, the last, has no line end");
}

#[test]
fn nothing_but_a_cut_off_row_is_refused() {
    assert!(refusal(format!("{HEADER}\n0,500,1")).contains("none of the 1 rows can be used: 1 is cut off"));
}

#[test]
fn rows_with_another_number_of_fields_are_refused_with_their_line() {
    let message = refusal(format!("{HEADER}\n0,500,1,0,0\n1,500,1\n2,500,1,0,0\n"));
    assert!(message.contains("line 3 has 3 fields, the header has 5"), "{message}");
    let message = refusal(format!("{HEADER}\n0,500,1,0,0\n1,500,1,0,0,7\n"));
    assert!(message.contains("line 3 has 6 fields, the header has 5"), "{message}");
}

#[test]
fn a_byte_order_mark_is_passed_over() {
    let recording = parse(format!("\u{feff}{HEADER}\n0,500,1,0,0\n")).unwrap();
    assert_eq!(recording.t_s, [0.0]);
    assert!(recording.warnings.is_empty());
}

#[test]
fn line_ends_may_be_crlf() {
    let recording = parse(format!("{HEADER}\r\n0,500,1,0,-0.25\r\n1,500,1,0,0.5\r\n")).unwrap();
    assert_eq!(recording.vas_v.as_deref(), Some(&[-0.25, 0.5][..]));
    assert!(recording.warnings.is_empty(), "{:?}", recording.warnings);
}

#[test]
fn semicolons_and_tabs_separate_too() {
    for separator in [";", "\t"] {
        let text = format!("{HEADER}\n0.5,500,1,0,0\n1,500,1,0,0\n").replace(',', separator);
        assert_eq!(parse(text).unwrap().t_s, [0.5, 1.0], "{separator:?}");
    }
}

#[test]
fn a_line_that_tells_the_separator_is_believed() {
    let recording = parse(format!("sep=|\n{HEADER}\n0,500,1,0,0\n").replace(',', "|")).unwrap();
    assert_eq!(recording.t_s, [0.0]);
}

#[test]
fn numbers_may_have_a_decimal_comma_where_semicolons_separate() {
    let recording = parse("t_s;xc_v;yc_v\n0;1;0\n0,01;-1,25e-3;-0,5\n").unwrap();
    assert_eq!(recording.t_s, [0.0, 0.01]);
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.0, -1.25e-3][..]));
}

#[test]
fn points_among_decimal_commas_are_refused() {
    let message = refusal("t_s;xc_v;yc_v\n0,1;1;0\n0,2;1.5;0\n");
    assert!(message.contains("line 3, column 2 (`xc_v`): \"1.5\" is not a number"), "{message}");
    assert!(message.contains("decimal comma"), "{message}");
}

#[test]
fn blanks_around_names_and_cells_do_not_matter() {
    let recording = parse(" T_S , Rate_DPS,XC_V ,yc_v\n 0 , 500,\t1 ,0 \n1,500,1,0\n").unwrap();
    assert_eq!(recording.column_names().collect::<Vec<_>>(), ["t_s", "rate_dps", "xc_v", "yc_v"]);
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.0, 1.0][..]));
}

#[test]
fn quoted_fields_are_read_as_rfc_4180_has_it() {
    let text = "\"t_s\",\"xc_v\",yc_v,note\n\"0\",1,0,\"a, \"\"b\"\"\nc\"\n\"1.5\",\" 2 \",0,\n";
    let recording = parse(text).unwrap();
    assert_eq!(recording.t_s, [0.0, 1.5]);
    assert_eq!(recording.xc_v.as_deref(), Some(&[1.0, 2.0][..]));
    assert_eq!(recording.unknown[0].cells.get(0), Some("a, \"b\"\nc"));
    assert!(refusal(format!("{text}x,1,0,\n")).contains("line 5, column 1 (`t_s`): \"x\" is not a number"));
}

#[test]
fn a_quote_that_is_not_closed_is_refused_with_its_line() {
    let message = refusal("t_s,xc_v,yc_v,note\n0,1,0,a\n1,1,0,\"b\n2,1,0,c\n3,1,0,d\n");
    assert!(message.contains("line 3: a quote is opened and never closed"), "{message}");
}

#[test]
fn comments_before_the_header_are_passed_over() {
    let recording =
        parse(format!("# made by a logger\n% on a bench, with commas\n\n{HEADER}\n0,500,1,0,0\n,,,,\n")).unwrap();
    assert_eq!(recording.t_s, [0.0]);
    assert_eq!(recording.dropped.empty_or_nan, once(6));
}

#[test]
fn a_header_that_was_written_as_a_comment_is_found() {
    let recording = parse("# a line more\n# t_s, xc_v, yc_v\n0,1,2\n1,1,x2").map_err(|error| error.to_string());
    assert!(recording.is_ok(), "{recording:?}");
    assert_eq!(recording.unwrap().yc_v.as_deref(), Some(&[2.0][..]));
}

#[test]
fn blank_lines_are_counted_and_do_not_shift_the_line_numbers() {
    let recording = rows("0,500,1,0,0\n\n  \n1,500,,0,0\n\n2,500,1,0,0\n").unwrap();
    assert_eq!(recording.dropped.blank_lines, Tally { count: 3, first: Some(Place::Line(3)) });
    assert_eq!(recording.dropped.empty_or_nan, once(5));
}

#[test]
fn two_columns_of_one_name_are_refused() {
    let message = refusal("t_s,xc_v,yc_v,XC_V\n0,1,0,1\n");
    assert!(message.contains("columns 2 and 4 are both named `xc_v`"), "{message}");
    let message = refusal("t_s,xc_v,yc_v,a,a\n0,1,0,1,1\n");
    assert!(message.contains("columns 4 and 5 are both named `a`"), "{message}");
}

#[test]
fn unknown_columns_are_kept_and_named_in_one_warning() {
    let recording = parse("t_s,h2_v,xc_v,yc_v,state\n0,2.50,1,0, ok \n1,2.75,1,0,\n").unwrap();
    let texts: Vec<Vec<&str>> = recording.unknown.iter().map(|column| column.cells.iter().collect()).collect();
    assert_eq!(texts, [["2.50", "2.75"], ["ok", ""]]);
    assert_eq!(recording.warnings, ["rot.csv: unknown columns, kept and not used: `h2_v`, `state`"]);
}

#[test]
fn text_where_a_number_belongs_is_refused_with_line_column_and_text() {
    let message = refusal(format!("{HEADER}\n0,500,1,0,0\n1,500,1,BROKEN,0\n2,500,1,0,0\n"));
    assert!(message.contains("line 3, column 4 (`yc_v`): \"BROKEN\" is not a number"), "{message}");
    let message = refusal(format!("{HEADER}\n0,500,1.2.3,0,0\n"));
    assert!(message.contains("line 2, column 3 (`xc_v`): \"1.2.3\""), "{message}");
}

#[test]
fn text_that_is_not_utf_8_is_refused_where_it_stands() {
    let message = refusal(b"t_s,xc_v,yc_v,temp_\xb0C\n0,1,0,25\n");
    assert!(message.contains("line 1: the header is not UTF-8 from byte 20 of the line on"), "{message}");
    let message = refusal(b"t_s,xc_v,yc_v,note\n0,1,0,\xb0\n");
    assert!(message.contains("line 2, column 4 (`note`)") && message.contains("not text in UTF-8"), "{message}");
}

#[test]
fn a_file_without_time_or_angle_is_refused_with_what_is_there() {
    let message = refusal("time,xc_v,ys_v\n0,1,0\n");
    assert!(
        message.contains("needs `t_s` and one of (`xc_v` with `yc_v`, `theta_deg`, `x_v` with `y_v`)"),
        "{message}"
    );
    assert!(message.contains("there are `time`, `xc_v`, `ys_v`"), "{message}");
}

#[test]
fn a_rotation_needs_a_reference_and_a_ring_down_its_controller_output() {
    let recording = parse("t_s,xc_v,yc_v\n0,1,0\n").unwrap();
    let message = recording.require_rotation().unwrap_err().to_string();
    assert!(message.contains("a rotation needs `t_s`, one of (`rate_dps`, `table_deg`)"), "{message}");
    let message = recording.require_ringdown().unwrap_err().to_string();
    assert!(message.contains("a ring-down needs `t_s`, `xc_v`, `yc_v` and `vas_v`"), "{message}");
    assert!(parse("t_s,theta_deg,table_deg\n0,1,0\n").unwrap().require_rotation().is_ok());
}

#[test]
fn one_quadrature_without_the_other_is_warned_of() {
    assert_warns(&parse("t_s,xc_v,xs_v,yc_v\n0,1,0,0\n").unwrap(), "column `xs_v` is there without `ys_v`");
}

#[test]
fn empty_files_and_headers_alone_are_refused() {
    for text in ["", "\n\n", "# nothing\n", "\u{feff}"] {
        assert!(refusal(text).contains("is empty; wanted a header line and rows"), "{text:?}");
    }
    for text in ["t_s,xc_v,yc_v", "t_s,xc_v,yc_v\n", "t_s,xc_v,yc_v\n\n"] {
        assert!(refusal(text).contains("line 1 is the header and no rows follow it"), "{text:?}");
    }
}

#[test]
fn numbers_without_a_header_are_refused() {
    assert!(refusal("0,500,1,0\n1,500,1,0\n").contains("line 1: the first line holds numbers; wanted a header line"));
}

#[test]
fn other_kinds_of_file_are_refused_by_their_name() {
    assert!(refusal(b"PK\x03\x04").contains("spreadsheet"));
    assert!(refusal("{\n  \"schema\": \"cvg.report/2\"\n}\n").contains("is JSON and no recording"));
    for page in ["<!DOCTYPE html>\n<html></html>\n", "\n<HTML>\n", "<?xml version=\"1.0\"?>\n<a/>\n"] {
        assert!(refusal(page).contains("is HTML or XML and no recording"), "{page}");
    }
    assert!(refusal("t_s,xc_v,yc_v\r0,1,0\r").contains("carriage returns"));
}

/// What lies beyond an instrument's range is a number that is not there, wherever it stands, and is counted.
#[test]
fn an_overload_is_a_missing_number_and_is_counted() {
    let recording =
        rows("0,500,1,0.1,0\n1,500,OVL,0.1,0\n2,500,-OL,0.1,0\n3,500,1,0.1,Overflow\n4,500,1,0.1,+OVLD\n").unwrap();
    assert_eq!(recording.t_s, [0.0, 3.0, 4.0]);
    assert_eq!(recording.dropped.empty_or_nan, Tally { count: 2, first: Some(Place::Line(3)) });
    assert_eq!(recording.dropped.missing_values[0].1, Tally { count: 2, first: Some(Place::Line(5)) });
    assert_warns(&recording, "2 of 5 rows dropped");
    assert_warns(&recording, "`vas_v` is empty or not finite in 2 rows");
}

#[test]
fn text_in_utf_16_is_read() {
    let text = "\u{feff}Zeit °\tt_s\trate_dps\ttheta_deg\r\nx\t0\t10\t0\r\nx\t0,1\t10\t1\r\n";
    for bytes in
        [u16::to_le_bytes, u16::to_be_bytes].map(|order| text.encode_utf16().flat_map(order).collect::<Vec<u8>>())
    {
        let recording = parse(&bytes).unwrap();
        assert_eq!((recording.t_s, recording.theta_deg), (vec![0.0, 0.1], Some(vec![0.0, 1.0])));
    }
}

#[test]
fn bars_separate_columns() {
    let recording = parse("t_s | rate_dps | theta_deg\n0|10|0\n0.1|10|1\n").unwrap();
    assert_eq!((recording.t_s, recording.theta_deg), (vec![0.0, 0.1], Some(vec![0.0, 1.0])));
    let message = refusal("time|turns|A|B\n0|0|1|0\n0.1|0|1|0\n");
    assert!(message.contains("there are `time`, `turns`, `A`, `B`"), "{message}");
}

#[test]
fn dates_may_begin_with_the_day_and_times_may_have_none() {
    let dated = "t_s;rate_dps;theta_deg\n01.03.2026 12:00:00,000;10;0,5\n01.03.2026 12:00:00,010;10;1,5\n";
    let recording = parse(dated).unwrap();
    assert_eq!((&recording.t_s[..], recording.theta_deg.as_deref()), (&[0.0, 0.01][..], Some(&[0.5, 1.5][..])));
    assert_warns(&recording, "times are written as dates");
    let recording = parse("t_s,rate_dps,theta_deg\n23:59:59.990,10,0\n00:00:00.010,10,1\n00:00:01.010,10,2\n").unwrap();
    for (found, expected) in recording.t_s.iter().zip([0.0, 0.02, 1.02]) {
        assert!((found - expected).abs() < 1e-9, "{:?}", recording.t_s);
    }
    assert_warns(
        &recording,
        "times are written as times of day: `t_s` is counted from the first, in s, past one midnight",
    );
    let message = refusal("t_s,rate_dps,theta_deg\n12:00:01,10,0\n12:00:00,10,1\n");
    assert!(message.contains("the time goes back"), "{message}");
    // which of the numbers is the month, nothing says
    let message = refusal("t_s,rate_dps,theta_deg\n01/03/2026 12:00:00,10,0\n");
    assert!(message.contains("such as 2026-03-01T12:00:00.25Z or 01.03.2026 12:00:00"), "{message}");
}
