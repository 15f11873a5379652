//! Whether rows and stations carry a model: how many observations there are for each of its unknowns.

use super::samples::SensorRun;
use super::sensor::Sensor;

/// Observations for each unknown, an engineering choice. A row observes the angle, and of two channels the radius too: 27
/// stations allow a table of four harmonics, and eight a readout's offset, gain and skew.
pub(super) const OBSERVATIONS_PER_UNKNOWN: usize = 3;
/// Stations for each coefficient of a table and its constant, an engineering choice: a few more than would be met exactly. 12 stations
/// allow four harmonics of the six that they resolve.
const STATIONS_PER_UNKNOWN: f64 = 1.3;
/// And of a readout and a table together: the table lives in the angle, and the readout in both. 27 stations allow offset,
/// gain and skew beside four harmonics.
const OBSERVATIONS_BESIDE_A_READOUT: usize = 4;

/// Parts of a period that are directions of their own: far more than the harmonics of any table ask for, and fewer than rows of a turning
/// sensor fill.
const DIRECTIONS: usize = 1024;

/// Directions of the period in which rows stand: of a sensor that turns as many as there are rows or parts, at stations as many as these
/// are, however often each is recorded.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below DIRECTIONS")]
pub(super) fn stations(sensor: &Sensor, runs: &[SensorRun]) -> usize {
    let mut met = vec![false; DIRECTIONS];
    for a in runs.iter().flat_map(|r| &r.reference_rad) {
        // a station is in the middle of a part as a rule, and not on the edge of two
        let part = (sensor.gain * sensor.cycles * a / std::f64::consts::TAU).rem_euclid(1.0) * DIRECTIONS as f64 + 0.5;
        met[part as usize % DIRECTIONS] = true;
    }
    met.into_iter().filter(|met| *met).count()
}

/// Whether stations carry a table: a harmonic at or beyond half of them is zero at each, or one of the others, and rows that repeat a
/// station say nothing more of it.
pub(super) fn stations_carry(stations: usize, order: usize) -> bool {
    order == 0 || (2 * order + 1) as f64 * STATIONS_PER_UNKNOWN <= stations as f64
}

/// Whether so many rows observe enough for the unknowns of a readout and of a table, beside the constants of the angle.
pub(super) fn carries(rows: usize, of_readout: usize, of_table: usize, constants: usize, per_unknown: usize) -> bool {
    let in_angle = |each: usize| (of_table + constants) * each <= rows;
    let in_both = |each: usize| (of_readout + of_table + constants) * each <= 2 * rows;
    match (of_readout, of_table) {
        (0, _) => in_angle(per_unknown),
        (_, 0) => in_both(OBSERVATIONS_PER_UNKNOWN),
        _ => in_angle(OBSERVATIONS_PER_UNKNOWN) && in_both(OBSERVATIONS_BESIDE_A_READOUT),
    }
}

#[cfg(test)]
mod tests {
    use super::super::readout::Kind;
    use super::*;

    #[test]
    fn rows_carry_as_many_unknowns_as_they_observe() {
        let least = |of_readout, of_table| (0..).find(|rows| carries(*rows, of_readout, of_table, 1, 3));
        let affine = Kind::Affine.free().len();
        assert_eq!([least(0, 8), least(affine, 0), least(affine, 8)], [Some(27), Some(8), Some(27)]);
    }
}
