//! What makes a proof of compiled code lie, each with a claim that shows that it does not here, and the claim's twin.
//!
//! They are proved with the others, by the same commands, before anything is believed.

#![allow(missing_docs, reason = "the names are the claims")]

use core::hint::black_box;

/// Values that have to come from the module's data segment.
static SQUARES: [u32; 8] = [0, 1, 4, 9, 16, 25, 36, 49];

fn constants_are_loaded(claimed: impl Fn(usize) -> u32) {
    let i: usize = kani::any_where(|i| *i < SQUARES.len());
    kani::cover!(i == 7, "the last constant");
    assert!(black_box(&SQUARES)[i] == claimed(i));
}

/// Constants are what the source says, not zero.
#[kani::proof]
pub fn proof_guard_constants_are_loaded() {
    constants_are_loaded(|i| (i * i) as u32);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_constants_are_loaded() {
    constants_are_loaded(|_| 0);
}

fn floats_keep_their_bits_in_memory(flipped: u32) {
    let i: usize = kani::any_where(|i| *i < 4);
    let bits: u32 = kani::any();
    let other: f32 = kani::any();
    let mut words = [other; 4];
    black_box(&mut words)[i] = f32::from_bits(bits);
    kani::cover!(f32::from_bits(bits).is_nan(), "not a number");
    kani::cover!(bits == 1, "the smallest number");
    assert!(words[i].to_bits() == bits ^ flipped);
    let narrow = black_box(&words)[i].to_bits().to_le_bytes();
    assert!(u32::from_le_bytes(narrow) == bits);
    let double: f64 = kani::any();
    assert!(f64::from_bits(*black_box(&double.to_bits())).to_bits() == double.to_bits());
}

/// A float that is stored, loaded and taken apart has the bits it had, whichever they are.
#[kani::proof]
pub fn proof_guard_floats_keep_their_bits_in_memory() {
    floats_keep_their_bits_in_memory(0);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_floats_keep_their_bits_in_memory() {
    floats_keep_their_bits_in_memory(1);
}

fn bytes_keep_their_value(added: u8) {
    let i: usize = kani::any_where(|i| *i < 4);
    let byte: u8 = kani::any();
    let mut bytes = [7_u8; 4];
    black_box(&mut bytes)[i] = byte;
    kani::cover!(byte == 200 && i == 3, "a large byte at the end");
    let half: u16 = kani::any();
    let mut halves = [9_u16; 4];
    black_box(&mut halves)[i] = half;
    assert!(black_box(&bytes)[i] == byte.wrapping_add(added));
    assert!(black_box(&bytes)[3 - i] == 7 && black_box(&halves)[i] == half && black_box(&halves)[3 - i] == 9);
}

/// Bytes and half words are stored where and as they were, and their neighbours stay.
#[kani::proof]
pub fn proof_guard_bytes_keep_their_value() {
    bytes_keep_their_value(0);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_bytes_keep_their_value() {
    bytes_keep_their_value(1);
}

fn copies_are_whole(last: usize) {
    let mut from = [0_u64; 16];
    let value = kani::any();
    from[15] = value;
    kani::cover!(value == 3, "a value");
    let to = *black_box(&from);
    assert!(black_box(&to)[last] == value);
}

/// A large copy is whole.
#[kani::proof]
#[kani::unwind(200)]
pub fn proof_guard_copies_are_whole() {
    copies_are_whole(15);
}

#[kani::proof]
#[kani::should_panic]
#[kani::unwind(200)]
pub fn twin_guard_copies_are_whole() {
    copies_are_whole(14);
}

fn panics_are_seen(most: u32) {
    let i: u32 = kani::any_where(|i| *i < 9);
    kani::cover!(i == 8, "the largest");
    // out of bounds for 8, if it can be 8
    let i = if i > most { most } else { i };
    assert!(black_box(&SQUARES)[i as usize] < 50);
}

/// An index beyond the end panics, and a panic is seen.
#[kani::proof]
pub fn proof_guard_panics_are_seen() {
    panics_are_seen(7);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_panics_are_seen() {
    panics_are_seen(8);
}

fn overflow_is_seen(most: u32) {
    let a: u32 = kani::any_where(|a| *a <= most);
    kani::cover!(a == most, "the largest");
    let _ = black_box(black_box(a) + 1);
}

/// An overflow panics as in a debug build.
#[kani::proof]
pub fn proof_guard_overflow_is_seen() {
    overflow_is_seen(u32::MAX - 1);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_overflow_is_seen() {
    overflow_is_seen(u32::MAX);
}

fn arithmetic_is_ieee(half_ulp: f32) {
    // 2^24 + 1 is a tie: it goes to the even neighbour
    let x: f32 = kani::any_where(|x| *x == 16_777_216.0);
    kani::cover!(x > 0.0, "a number");
    assert!(x + 1.0 == x && x + (1.0 + half_ulp) == x + 2.0);
    let tiny: f32 = kani::any_where(|x: &f32| x.to_bits() == 1);
    assert!(tiny > 0.0 && tiny / 2.0 == 0.0 && tiny * 2.0 != tiny);
}

/// Arithmetic rounds to nearest, ties to even, and keeps subnormal numbers.
#[kani::proof]
pub fn proof_guard_arithmetic_is_ieee() {
    arithmetic_is_ieee(f32::EPSILON);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_arithmetic_is_ieee() {
    arithmetic_is_ieee(0.0);
}

fn loops_are_counted() {
    let n: u32 = kani::any_where(|n| *n <= 8);
    kani::cover!(n == 8, "all rounds");
    let mut i = 0;
    while i < n {
        i += black_box(1);
    }
    assert!(i == n);
}

/// A loop that is unwound far enough is proved.
#[kani::proof]
#[kani::unwind(10)]
pub fn proof_guard_loops_are_counted() {
    loops_are_counted();
}

/// The same loop cut short: what is refuted is not the claim but that all rounds were looked at.
#[kani::proof]
#[kani::should_panic]
#[kani::unwind(5)]
pub fn twin_guard_loops_are_counted() {
    loops_are_counted();
}

fn conversions_saturate(beyond: i32) {
    let x: f32 = kani::any();
    let whole = black_box(x) as i32;
    kani::cover!(x > 1e10, "beyond what an integer holds");
    assert!(x == x || whole == 0);
    assert!(!(x > 3e9) || whole == beyond);
    assert!(!(x < -3e9) || whole == i32::MIN);
}

/// What a float is as an integer ends at the integer's ends, and is nothing for no number.
#[kani::proof]
pub fn proof_guard_conversions_saturate() {
    conversions_saturate(i32::MAX);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_conversions_saturate() {
    conversions_saturate(i32::MAX - 1);
}

fn no_number_keeps_its_sign(sign: u32) {
    let bits: u32 = kani::any();
    let x = f32::from_bits(bits);
    kani::cover!(x != x, "no number");
    assert!((-black_box(x)).to_bits() == bits ^ sign);
    assert!(black_box(x).abs().to_bits() == bits & 0x7fff_ffff);
}

/// A sign that is turned round or taken away is one bit, of any bits.
#[kani::proof]
pub fn proof_guard_no_number_keeps_its_sign() {
    no_number_keeps_its_sign(0x8000_0000);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_no_number_keeps_its_sign() {
    no_number_keeps_its_sign(0);
}

fn quotients_overflow(least: i64) {
    let b: i64 = kani::any_where(|b| *b != 0);
    let a: i64 = kani::any_where(|a| *a >= least);
    kani::cover!(b == -1 && a == least, "the least by minus one");
    let _ = black_box(black_box(a) / black_box(b));
}

/// A quotient that no integer holds panics, and only that one.
#[kani::proof]
pub fn proof_guard_quotients_overflow() {
    quotients_overflow(i64::MIN + 1);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_quotients_overflow() {
    quotients_overflow(i64::MIN);
}

fn ends_of_the_range_are_kept(least: f32) {
    let small: f32 = kani::any_where(|x| *x == f32::MIN_POSITIVE);
    kani::cover!(small > 0.0, "the smallest normal number");
    assert!(black_box(small) / 2.0 > least && (black_box(small) / 2.0) * 2.0 == small);
    let large: f32 = kani::any_where(|x| *x == f32::MAX);
    let none = black_box(large) * 2.0 - black_box(large) * 2.0;
    assert!(black_box(large) * 2.0 == f32::INFINITY && none != none);
}

/// Quotients become subnormal and products infinite, and the difference of infinities is no number.
#[kani::proof]
pub fn proof_guard_ends_of_the_range_are_kept() {
    ends_of_the_range_are_kept(0.0);
}

#[kani::proof]
#[kani::should_panic]
pub fn twin_guard_ends_of_the_range_are_kept() {
    ends_of_the_range_are_kept(1.0);
}

fn a_stack_holds<const BYTES: usize>() {
    let value: u8 = kani::any();
    kani::cover!(value == 3, "a value");
    let mut all = [0_u8; BYTES];
    black_box(&mut all)[BYTES - 1] = value;
    assert!(black_box(&all)[BYTES - 1] == value);
}

/// What fits the stack is held there.
#[kani::proof]
#[kani::unwind(400)]
pub fn proof_guard_a_stack_ends() {
    a_stack_holds::<64>();
}

/// What does not fit is refuted: a stack that runs over writes into nothing else.
#[kani::proof]
#[kani::should_panic]
#[kani::unwind(400)]
pub fn twin_guard_a_stack_ends() {
    a_stack_holds::<6000>();
}

fn copies_of_any_length_are_whole(added: u8) {
    let from: [u8; 4] = kani::any();
    let mut to = [0_u8; 4];
    let n: usize = kani::any_where(|n| *n >= 1 && *n <= 4);
    kani::cover!(n == 3, "an odd length");
    kani::cover!(n == 4, "all of it");
    let (source, place) = (black_box(&from), black_box(&mut to));
    for (place, source) in place.iter_mut().zip(source).take(black_box(n)) {
        *place = *source;
    }
    let copied = black_box(&to);
    for k in 0..4 {
        assert!(copied[k] == if k < n { from[k].wrapping_add(added) } else { 0 });
    }
}

/// A copy whose length nobody knows beforehand is whole and ends where it has to.
#[kani::proof]
#[kani::unwind(40)]
pub fn proof_guard_copies_of_any_length_are_whole() {
    copies_of_any_length_are_whole(0);
}

#[kani::proof]
#[kani::should_panic]
#[kani::unwind(40)]
pub fn twin_guard_copies_of_any_length_are_whole() {
    copies_of_any_length_are_whole(1);
}
