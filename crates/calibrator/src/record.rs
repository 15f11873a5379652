//! What was learned, as bytes: for the next start. Versioned and checked; what is damaged is refused as a whole.

use cvg_model::Float;

use crate::Calibrator;
use crate::complex::{Complex, Matrix};
use crate::correction::Correction;
use crate::parameters::{DETECTION, N, OTHERS};
use crate::state::State;
use crate::ud::Ud;

/// Numbers in a record: values, detection, drives, factors of what is known of the detection.
const NUMBERS: usize = N + 4 + 8 + DETECTION + 3;
/// Bytes of a record: mark, version, uses of the split's symmetry, whether the forces' scale is known; the numbers; CRC.
pub const BYTES: usize = 8 + 8 * NUMBERS + 4;
const MARK: [u8; 4] = *b"CVGS";
const VERSION: u8 = 1;

/// Why a record was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// not a record, or not as it was written
    Damaged,
    /// of another version
    Version,
    /// whole, but no instrument is like that
    Implausible,
}

impl core::fmt::Display for Refused {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Damaged => "the record is damaged",
            Self::Version => "the record is of another version",
            Self::Implausible => "the record describes no instrument",
        })
    }
}

impl core::error::Error for Refused {}

impl<T: Float> Calibrator<T> {
    /// What was learned so far.
    pub fn save(&self, state: &State<T>) -> [u8; BYTES] {
        let mut bytes = [0_u8; BYTES];
        let uses = state.schedule.uses_of_symmetry.to_le_bytes();
        let scaled = u8::from(state.schedule.angle_used >= self.cycles(10));
        let head = MARK.into_iter().chain([VERSION, scaled]).chain(uses);
        let numbers = numbers(state).into_iter().flat_map(|v| v.to_f64().to_le_bytes());
        for (slot, byte) in bytes.iter_mut().zip(head.chain(numbers)) {
            *slot = byte;
        }
        let crc = crc32(bytes.get(..BYTES - 4).unwrap_or(&[])).to_le_bytes();
        for (slot, byte) in bytes.iter_mut().skip(BYTES - 4).zip(crc) {
            *slot = byte;
        }
        bytes
    }

    //= specs/self-calibration.md#restored
    //# A record MUST be restored to what was saved or refused.
    /// A start from what was saved. The mechanics are taken for a tenth as certain as of a new device: they were warm or
    /// cold then.
    ///
    /// # Errors
    /// A record that is damaged, of another version, or of no instrument.
    pub fn restore(&self, bytes: &[u8; BYTES]) -> Result<State<T>, Refused> {
        let (body, tail) = bytes.split_at(BYTES - 4);
        if tail != crc32(body).to_le_bytes() {
            return Err(Refused::Damaged);
        }
        let [m0, m1, m2, m3, version, scaled, low, high, ..] = *bytes;
        if [m0, m1, m2, m3] != MARK {
            return Err(Refused::Damaged);
        }
        if version != VERSION {
            return Err(Refused::Version);
        }
        let mut read = [T::zero(); NUMBERS];
        for (slot, chunk) in read.iter_mut().zip(body.get(8..).unwrap_or(&[]).chunks_exact(8)) {
            let mut word = [0_u8; 8];
            for (to, from) in word.iter_mut().zip(chunk) {
                *to = *from;
            }
            *slot = T::from_f64(f64::from_le_bytes(word));
        }
        let mut state = self.start();
        let mut at = read.into_iter();
        let mut next = || at.next().unwrap_or(T::zero());
        let mut known = [T::zero(); N];
        known.fill_with(&mut next);
        let (y_of_y, y_of_x) = (Complex::new(next(), next()), Complex::new(next(), next()));
        let mut drives = [T::zero(); 8];
        drives.fill_with(&mut next);
        let correction =
            Correction::of(known, y_of_y, y_of_x, Matrix::from_numbers(&drives)).ok_or(Refused::Implausible)?;
        let mut factors = [T::zero(); DETECTION + 3];
        factors.fill_with(&mut next);
        let ud = Ud::with_last(T::from_f64(0.01), &factors).ok_or(Refused::Implausible)?;
        state.correction = correction;
        state.filter.ud = ud;
        state.schedule.stage = 3;
        state.schedule.cold = false;
        state.schedule.uses_of_symmetry = u16::from_le_bytes([low, high]);
        state.schedule.angle_used = if scaled == 1 { self.cycles(10) } else { 0 };
        Ok(state)
    }
}

fn numbers<T: Float>(state: &State<T>) -> [T; NUMBERS] {
    let c = &state.correction;
    let ud = &state.filter.ud;
    let (phase, ratio, skew) = (OTHERS, OTHERS + 1, OTHERS + 2);
    let detection = [c.y_of_y.re, c.y_of_y.im, c.y_of_x.re, c.y_of_x.im];
    let factors = [ud.d(phase), ud.d(ratio), ud.d(skew), ud.u(phase, ratio), ud.u(phase, skew), ud.u(ratio, skew)];
    let mut all = [T::zero(); NUMBERS];
    let values = c.known.into_iter().chain(detection).chain(c.drives.numbers()).chain(factors);
    for (slot, value) in all.iter_mut().zip(values) {
        *slot = value;
    }
    all
}

/// CRC-32 as of Ethernet and zip, bit by bit: a record is written seldom.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), step))
}

#[cfg(test)]
mod tests {
    use super::crc32;

    #[test]
    fn the_checksum_is_the_usual_one() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }
}
