//! Plain decimal numbers, fast: eight digits at a time, and exactly rounded or not at all.
//!
//! A number with up to 2⁵³ in its digits and up to 22 places behind the mark is one exact integer over one exact power
//! of ten, so that a single division rounds it as the exact algorithm would (Clinger 1990, "How to read floating point
//! numbers accurately"). Everything else (exponents, more digits, words) is left to `cell.rs`.

const TEN_TO: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];
const INTEGER_TEN_TO: [u64; 9] = [1, 10, 100, 1_000, 10_000, 100_000, 1_000_000, 10_000_000, 100_000_000];

/// The number that starts at `at`, and the index of the byte after it; `None` where it is not plain.
#[inline(always)]
pub(super) fn plain_number(text: &[u8], at: usize, mark: u8) -> Option<(f64, usize)> {
    let negative = *text.get(at)? == b'-';
    let start = at + usize::from(negative);
    let mut next = start;
    let mut integer = 0_u64;
    loop {
        let digit = text.get(next)?.wrapping_sub(b'0');
        if digit > 9 {
            break;
        }
        integer = integer.wrapping_mul(10).wrapping_add(u64::from(digit));
        next += 1;
    }
    let whole_places = next - start;
    if whole_places == 0 || whole_places > 10 {
        return None;
    }
    let mut places = 0;
    if *text.get(next)? == mark {
        let (digits, count) = leading_digits(eight(text, next + 1)?);
        integer = integer * INTEGER_TEN_TO[count] + digits;
        places = count;
        if count == 8 {
            let (digits, count) = leading_digits(eight(text, next + 9)?);
            if whole_places + count > 10 || count > 7 {
                return None;
            }
            integer = integer * INTEGER_TEN_TO[count] + digits;
            places += count;
        }
        next += 1 + places;
    }
    if integer > 1 << 53 {
        return None;
    }
    if integer == 0 {
        return Some((if negative { -0.0 } else { 0.0 }, next));
    }
    // Signed integers become floats in one instruction, unsigned ones in many.
    let sign = -i64::from(negative);
    let signed = (integer.cast_signed() ^ sign) - sign;
    Some((signed as f64 / TEN_TO[places], next))
}

#[inline(always)]
fn eight(text: &[u8], at: usize) -> Option<u64> {
    let bytes = text.get(at..at + 8)?;
    Some(u64::from_le_bytes(bytes.try_into().ok()?))
}

/// The value of the digits that eight bytes begin with, and how many there are.
#[inline(always)]
fn leading_digits(bytes: u64) -> (u64, usize) {
    let values = bytes ^ 0x3030_3030_3030_3030;
    // The high bit of each byte that is not 0 to 9. A carry can only spoil bytes behind one that is not a digit.
    let others = (values.wrapping_add(0x7676_7676_7676_7676) | values) & 0x8080_8080_8080_8080;
    let count = (others.trailing_zeros() / 8) as usize;
    // The digits to the far end, zeros before them; in two steps because there may be none.
    let missing = 8 - count as u32;
    let aligned = (values << (4 * missing)) << (4 * missing);
    let pairs = aligned.wrapping_mul(10).wrapping_add(aligned >> 8) & 0x00ff_00ff_00ff_00ff;
    let quads = pairs.wrapping_mul(100).wrapping_add(pairs >> 16) & 0x0000_ffff_0000_ffff;
    let all = quads.wrapping_mul(10_000).wrapping_add(quads >> 32) & 0xffff_ffff;
    (all, count)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn plain(text: &str) -> Option<(f64, usize)> {
        let padded = format!("{text},\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0");
        plain_number(padded.as_bytes(), 0, b'.')
    }

    #[test]
    fn plain_numbers_are_read_to_their_end() {
        for text in
            ["0", "-0", "7", "-500", "0.1", "-0.0016828", "1234.5678", "3.", "0.123456789012345", "9007199254740992"]
        {
            let read = plain(text);
            if text.len() <= 10 || text.contains('.') {
                let (value, end) = read.expect(text);
                assert_eq!((value.to_bits(), end), (text.parse::<f64>().unwrap().to_bits(), text.len()), "{text}");
            } else {
                assert_eq!(read, None, "{text}");
            }
        }
    }

    #[test]
    fn what_is_not_plain_is_left_to_the_exact_reader() {
        for text in ["", "-", "+1", ".5", "nan", "0.1234567890123456", " 1", "-.5"] {
            assert_eq!(plain(text), None, "{text:?}");
        }
    }

    proptest! {
        #[test]
        fn the_fast_way_agrees_with_the_standard_library_bit_for_bit(text in r"-?[0-9]{1,12}(\.[0-9]{0,17})?") {
            if let Some((value, end)) = plain(&text) {
                prop_assert_eq!(end, text.len());
                prop_assert_eq!(value.to_bits(), text.parse::<f64>().unwrap().to_bits());
            }
        }

        #[test]
        fn any_eight_bytes_give_the_digits_they_begin_with(bytes in proptest::array::uniform8(any::<u8>())) {
            let digits: String = bytes.iter().take_while(|byte| byte.is_ascii_digit()).map(|&byte| char::from(byte)).collect();
            let (value, count) = leading_digits(u64::from_le_bytes(bytes));
            prop_assert_eq!(count, digits.len());
            prop_assert_eq!(value, digits.parse().unwrap_or(0));
        }
    }
}
