//! The whole CSV reader: cutting the text elsewhere changes nothing, and no text makes it panic.

use std::path::Path;

use proptest::prelude::*;

use super::*;

fn table(text: &[u8], sizes: Sizes) -> Result<String, String> {
    let table = read_table(text, Some(text.len() as u64), Naming::NONE, Path::new("a.csv"), sizes);
    // NaN is not equal to itself: the columns are compared as they print.
    table
        .map(|table| format!("{:?}", (table.numbers, table.unknown, table.rows, table.places, table.truncated)))
        .map_err(|error| error.to_string())
}

fn dirty_text() -> impl Strategy<Value = String> {
    let cell = prop_oneof![
        6 => "-?[0-9]{1,3}(\\.[0-9]{0,9})?",
        1 => Just(String::new()),
        1 => Just("nan".to_owned()),
        1 => Just(" 1.5e-3 ".to_owned()),
    ];
    let line = prop_oneof![
        8 => proptest::collection::vec(cell, 4).prop_map(|cells| cells.join(",")),
        1 => Just(String::new()),
        1 => Just("1,2,3,\"a,\n\"\"b\"".to_owned()),
    ];
    (proptest::collection::vec(line, 0..30), any::<bool>(), "(1,2)?").prop_map(|(lines, is_crlf, end)| {
        let line_end = if is_crlf { "\r\n" } else { "\n" };
        format!("t_s,xc_v,yc_v,note{line_end}{}{line_end}{end}", lines.join(line_end))
    })
}

proptest! {
    #[test]
    fn blocks_and_pieces_of_any_size_give_the_same_table(
        text in dirty_text(), block in 1_usize..200, piece in 1_usize..50, records in 1_usize..5
    ) {
        prop_assert_eq!(table(text.as_bytes(), Sizes { block, piece, records }), table(text.as_bytes(), SIZES));
    }

    #[test]
    fn no_bytes_make_it_panic(text in proptest::collection::vec(any::<u8>(), 0..200), block in 1_usize..50) {
        let _ = table(&text, Sizes { block, piece: 7, records: 2 });
        let head = b"t_s;xc_v;yc_v\n";
        let _ = table(&[head, &text[..]].concat(), Sizes { block, piece: 7, records: 2 });
    }

    #[test]
    fn no_text_of_the_letters_that_matter_makes_it_panic(text in "[0-9.,;\"\r\n\t eE+-]{0,200}", block in 1_usize..50) {
        let _ = table(&[b"t_s,xc_v,yc_v\n", text.as_bytes()].concat(), Sizes { block, piece: 7, records: 2 });
        let _ = table(&[b"t_s\txc_v\tyc_v\tnote\n", text.as_bytes()].concat(), Sizes { block, piece: 7, records: 2 });
    }
}
