//! In which unit an angle looks to be that is not in degrees: by the turn that its values fill where they wrap, and by how far
//! it goes beside another, which a whole number of periods a turn makes one of few numbers.

use super::samples::{Reading, SensorRun};
use super::sensor::magnitude;
use crate::error::Refusal;
use crate::numerics::angles::unwrapped;
use crate::numerics::statistics::{line, median, span};
use crate::recording::Run;

/// A unit of an angle and what one is in degrees.
pub(super) type Unit = (&'static str, f64);

/// Converters whose counts are whole turns.
pub(super) const COUNTS: [Unit; 15] = [
    ("counts of 10 bits", 360.0 / 1_024.0),
    ("counts of 11 bits", 360.0 / 2_048.0),
    ("counts of 12 bits", 360.0 / 4_096.0),
    ("counts of 13 bits", 360.0 / 8_192.0),
    ("counts of 14 bits", 360.0 / 16_384.0),
    ("counts of 15 bits", 360.0 / 32_768.0),
    ("counts of 16 bits", 360.0 / 65_536.0),
    ("counts of 17 bits", 360.0 / 131_072.0),
    ("counts of 18 bits", 360.0 / 262_144.0),
    ("counts of 19 bits", 360.0 / 524_288.0),
    ("counts of 20 bits", 360.0 / 1_048_576.0),
    ("counts of 21 bits", 360.0 / 2_097_152.0),
    ("counts of 22 bits", 360.0 / 4_194_304.0),
    ("counts of 23 bits", 360.0 / 8_388_608.0),
    ("counts of 24 bits", 360.0 / 16_777_216.0),
];

/// Units that are taken for degrees.
pub(super) const UNITS: [Unit; 10] = [
    ("turns", 360.0),
    ("rad", 57.295_779_513),
    ("gon", 0.9),
    ("tenths of a degree", 0.1),
    ("mrad", 0.057_295_779_513),
    // after those with a smaller turn, which theirs fills as well
    ("mils of 6400 a turn", 0.05625),
    ("arc minutes", 1.0 / 60.0),
    ("hundredths of a degree", 0.01),
    ("mdeg", 1e-3),
    ("arc seconds", 1.0 / 3600.0),
];
/// Units of which a turn is a whole number of degrees.
const SMALLER: [Unit; 3] = [("arc minutes", 1.0 / 60.0), ("mdeg", 1e-3), ("arc seconds", 1.0 / 3600.0)];
/// A gain is one of a unit within this share, and of so many periods a turn at most: of more, any number is near a whole one.
const SAME_UNIT: f64 = 1e-3;
const MOST_PERIODS: f64 = 64.0;
/// Values of an angle fill a turn that they span this share of; they wrap where a step is this share of that, and steps are
/// small where most are within a tenth.
const FILLED: f64 = 0.9;
const WRAPS: f64 = 0.5;
const SMALL: f64 = 0.1;
const TURN_DEG: f64 = 360.0;

/// Which of the two columns is in another unit, and the periods a turn that it then makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    column: &'static str,
    unit: Unit,
    periods: f64,
}

impl Found {
    /// The next step in words.
    pub(super) fn said(&self) -> String {
        let Self { column, unit: (name, degrees), periods } = self;
        let whose = if *column == ANGLE { "the angle" } else { "the reference" };
        let s = if *periods == 1.0 { "" } else { "s" };
        format!(
            "it looks as if {whose} were in {name} (\"…{}\" in [columns], or by --map), with {periods:.0} period{s} a turn",
            factor(*degrees)
        )
    }
}

/// What takes a unit to degrees, as a mapping has it: seven digits, or a divisor, whole or six digits after the point.
fn factor(degrees: f64) -> String {
    let parts = degrees.recip().round();
    if (degrees * parts - 1.0).abs() < 1e-9 {
        return format!("/{parts:.0}");
    }
    if COUNTS.iter().any(|unit| unit.1 == degrees) {
        return format!("/{:.6}", degrees.recip());
    }
    let seven: f64 = format!("{degrees:.6e}").parse().unwrap_or(degrees);
    format!("*{seven}")
}

const ANGLE: &str = "theta_deg";
const REFERENCE: &str = "table_deg";

/// The unit, of these, in which a reference makes a whole number of periods a turn of this gain; of several the one with the
/// fewest. The angle is asked as well where `angle` says that there is one.
pub(super) fn by_gain(gain: f64, units: &[Unit], angle: bool) -> Option<Found> {
    let whole = |column, unit: Unit, periods: f64| {
        let nearest = periods.round();
        ((1.0..=MOST_PERIODS).contains(&nearest) && (periods / nearest - 1.0).abs() < SAME_UNIT).then_some(Found {
            column,
            unit,
            periods: nearest,
        })
    };
    let of_reference = units.iter().filter_map(|u| whole(REFERENCE, *u, gain / u.1));
    let of_angle = units.iter().filter(|_| angle).filter_map(|u| whole(ANGLE, *u, gain * u.1));
    of_reference.chain(of_angle).min_by(|a, b| a.periods.total_cmp(&b.periods))
}

/// The converter whose counts fill a turn, of values that are whole numbers.
fn counts(values: &[f64]) -> Option<Unit> {
    let whole = values.iter().all(|v| (v - v.round()).abs() < 1e-6 && *v > -0.5);
    let largest = values.iter().fold(0.0, |m: f64, v| m.max(v.round()));
    let of = COUNTS.into_iter().find(|(_, degrees)| largest < TURN_DEG / degrees)?;
    (whole && span(values) > FILLED * TURN_DEG / of.1).then_some(of)
}

/// The unit of which the values of an angle fill a turn over and over; none of one in degrees.
fn by_turn(values: &[f64]) -> Option<Unit> {
    let size = span(values);
    let mut steps: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let wraps = steps.iter().any(|s| *s > WRAPS * size) && median(&mut steps) < SMALL * size;
    let fills = |turn: f64| size <= turn && size > FILLED * turn;
    let named = || UNITS.into_iter().find(|(_, degrees)| fills(TURN_DEG / degrees));
    (wraps && !fills(TURN_DEG)).then(|| counts(values).or_else(named))?
}

/// The unit of which a reference that hardly turns fills a turn over and over.
pub(super) fn of_the_reference(run: &SensorRun) -> Option<String> {
    let values: Vec<f64> = run.reference_rad.iter().map(|a| a.to_degrees()).collect();
    by_turn(&values).map(|unit| Found { column: REFERENCE, unit, periods: 1.0 }.said())
}

/// Refuses columns whose values are none of an angle in degrees: they wrap at another turn, or go round from row to row.
///
/// # Errors
/// With the unit that would make degrees of them, where there is one.
pub(super) fn require_degrees(run: &Run, period: f64) -> Result<(), Refusal> {
    let Ok(settled) = run.settled() else { return Ok(()) };
    let name = run.file.display().to_string();
    let of = |column: &Option<Vec<f64>>| column.as_ref().map(|v| v[settled.clone()].to_vec());
    let (table, theta) = (of(&run.recording.table_deg), of(&run.recording.theta_deg));
    for (column, values) in [(REFERENCE, &table), (ANGLE, &theta)] {
        // a turn below one in degrees may be a part of one
        let larger = values.as_ref().and_then(|v| by_turn(v)).filter(|(_, degrees)| *degrees < 1.0);
        if let Some((unit, degrees)) = larger {
            return Err(Refusal::no_answer(
                &name,
                format!("{column} wraps at a turn of {unit}"),
                format!("degrees: {column} = \"…{}\" in [columns], or by --map", factor(degrees)),
            ));
        }
    }
    let round = |v: &Vec<f64>| {
        let steps: Vec<f64> = v.windows(2).map(|w| w[1] - w[0]).collect();
        let back = steps.iter().filter(|step| **step < 0.0).count();
        // stations in any order go to and fro
        let is_followed = 4 * back.min(steps.len() - back) < steps.len();
        is_followed && median(&mut steps.iter().map(|step| step.abs()).collect::<Vec<_>>()) > 0.5 * TURN_DEG
    };
    let Some(column) = [(REFERENCE, &table), (ANGLE, &theta)].into_iter().find(|(_, v)| v.as_ref().is_some_and(round))
    else {
        return Ok(());
    };
    let followed = |v: &Option<Vec<f64>>, at: &str| -> Option<Vec<f64>> {
        let radians = v.as_ref()?.iter().map(|d| d.to_radians());
        Some(if at == column.0 { radians.collect() } else { unwrapped(radians, period) })
    };
    let gain = match (followed(&table, REFERENCE), followed(&theta, ANGLE)) {
        (Some(table), Some(theta)) => line(&table, &theta).0.abs(),
        (Some(table), None) => SensorRun::new(run.clone(), 0, None)
            .map_or(0.0, |r| magnitude(&[SensorRun { reference_rad: table, ..r }], period)),
        _ => 0.0,
    };
    let unit = by_gain(gain, &UNITS, theta.is_some()).filter(|found| found.column == column.0);
    Err(Refusal::no_answer(
        &name,
        format!("{} turns by more than half a turn from row to row", column.0),
        unit.map_or_else(
            || "angles in degrees, and rows closer together".into(),
            |found| format!("degrees: {}", found.said()),
        ),
    ))
}

/// What an angle of a sensor looks like that does not follow its reference, and whose values fill a turn in another unit than
/// degrees, or go beside the reference as those of one.
pub(super) fn of_the_angle(run: &SensorRun) -> Option<String> {
    let Reading::Angle(theta) = &run.reading else { return None };
    let values: Vec<f64> = theta.iter().map(|v| v.to_degrees()).collect();
    let like = |unit: &str, by: String| {
        format!("theta_deg in deg: it looks as if in {unit} (theta_deg = \"…{by}\" in [columns], or by --map)")
    };
    let size = span(&values);
    let fills = |turn: f64| size <= turn && size > FILLED * turn;
    let (slope, start) = line(&run.reference_rad, theta);
    let left = theta.iter().zip(&run.reference_rad).map(|(t, a)| t - slope * a - start);
    let follows = span(&left.collect::<Vec<_>>()) < SMALL * span(theta);
    let beside = by_gain(slope.abs(), &UNITS, true).filter(|found| follows && found.column == ANGLE);
    let unit = by_turn(&values).or(beside.map(|found| found.unit));
    let unit = unit.or_else(|| fills(std::f64::consts::TAU).then_some(UNITS[1])).or_else(|| counts(&values));
    unit.map(|(unit, degrees)| like(unit, factor(degrees)))
}

/// What a whole number of periods a turn looks like besides, of an angle that goes on beyond its turn instead of wrapping: one in
/// a smaller unit.
pub(super) fn or_smaller(gain: f64, runs: &[SensorRun]) -> Option<String> {
    let followed =
        |run: &SensorRun| matches!(&run.reading, Reading::Angle(theta) if span(theta) > 2.0 * TURN_DEG.to_radians());
    let found = by_gain(gain, &SMALLER, true).filter(|found| found.column == ANGLE && runs.iter().all(followed))?;
    Some(format!(
        "{gain:.0} periods a turn, by an angle that never wraps; or {}: pole_pairs in campaign.toml states which",
        found.said()
    ))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;

    fn said(gain: f64, angle: bool) -> Option<(&'static str, &'static str, f64)> {
        by_gain(gain, &UNITS, angle).map(|f| (f.column, f.unit.0, f.periods))
    }

    #[test]
    fn a_unit_is_named_by_the_ratio_that_is_found() {
        assert_eq!(said(360.0, false), Some((REFERENCE, "turns", 1.0)));
        assert_eq!(said(12.0 * 57.295_78, false), Some((REFERENCE, "rad", 12.0)));
        assert_eq!(said(0.9, false), Some((REFERENCE, "gon", 1.0)));
        assert_eq!(said(1.0 / 60.0, true), Some((REFERENCE, "arc minutes", 1.0)));
        // 24 periods in arc minutes and 10 in mdeg are more
        assert_eq!(said(0.4, false), Some((REFERENCE, "tenths of a degree", 4.0)));
        assert_eq!(said(0.01, false), Some((REFERENCE, "hundredths of a degree", 1.0)));
        assert_eq!(said(1.0 / 360.0, true), Some((ANGLE, "turns", 1.0)));
        assert_eq!(said(1.0 / 0.9, true), Some((ANGLE, "gon", 1.0)));
        assert_eq!(said(1.0 / 0.9, false), None);
        // near a whole number of some unit as any number is
        assert_eq!(said(39.736_3, false), None);
    }

    #[test]
    fn a_factor_is_one_that_a_mapping_takes() {
        assert_eq!([360.0, 57.295_779_513, 0.9, 1.0 / 3600.0].map(factor), ["*360", "*57.29578", "*0.9", "/3600"]);
    }

    #[test]
    fn values_that_wrap_tell_the_turn_that_they_fill() {
        let wrapped = |turn: f64| (0..500).map(|i| (0.013 * turn * f64::from(i)) % turn).collect::<Vec<f64>>();
        assert_eq!(by_turn(&wrapped(360.0)), None);
        for (turn, unit) in [(1.0, "turns"), (std::f64::consts::TAU, "rad"), (400.0, "gon"), (21_600.0, "arc minutes")]
        {
            assert_eq!(by_turn(&wrapped(turn)).map(|u| u.0), Some(unit));
        }
        // a converter's, of which the last digit may be missing in a short recording
        for (bits, unit) in [(12, "counts of 12 bits"), (20, "counts of 20 bits"), (17, "counts of 17 bits")] {
            let turn = 2.0_f64.powi(bits);
            let counted: Vec<f64> = wrapped(turn).iter().map(|v| v.floor()).collect();
            let found = by_turn(&counted).expect("a unit");
            assert_eq!(found.0, unit);
            assert!(factor(found.1).starts_with('/'), "{}", factor(found.1));
        }
        // there and back, or one station after the other
        assert_eq!(by_turn(&(0..500).map(|i| 400.0 * (0.01 * f64::from(i)).sin().abs()).collect::<Vec<_>>()), None);
        assert_eq!(by_turn(&[0.0, 380.0, 0.0, 380.0]), None);
    }
}
