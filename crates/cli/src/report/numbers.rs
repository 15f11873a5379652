//! Numbers as a person says them: as sharp as they are known, in the unit that the bench counts in.

use cvg_calibration::report::named::BESIDE_THE_LIBRARY;
use cvg_calibration::report::{EffectReport, Estimate, ParameterReport};
use cvg_model::effects::{EffectId, Stage};

/// An angle error below this is none, deg: no recording of an angle has as many digits, and no figure shows less.
pub(crate) const LEAST_DEG: f64 = 1e-6;
/// In the place of a number that the recordings do not carry.
pub(crate) const NOT_IDENTIFIABLE: &str = "not identifiable from this campaign";
/// An error that changed by less than this share is as it was: two digits of a factor show no less.
const AS_IT_WAS: f64 = 0.005;
/// Sizes that are written without an exponent.
const PLAIN: std::ops::Range<f64> = 1e-3..1e7;

/// A value with some six significant digits.
pub(crate) fn significant(value: f64) -> String {
    let size = value.abs();
    if value == value.trunc() && size < 1e6 {
        format!("{value}")
    } else if (1e-2..1e4).contains(&size) {
        format!("{value:.6}")
    } else {
        format!("{value:.5e}")
    }
}

/// An angle with three significant digits, in the unit of its size.
pub(crate) fn degrees(value: f64) -> String {
    if !value.is_finite() {
        return "—".into();
    }
    let size = value.abs();
    if size < 0.5 * LEAST_DEG {
        return "below 0.000001°".into();
    }
    let digits = if size >= 10.0 {
        1
    } else if size >= 1.0 {
        2
    } else if size >= 0.1 {
        3
    } else if size >= 0.01 {
        4
    } else if size >= 0.001 {
        5
    } else {
        6
    };
    format!("{value:.digits$}°")
}

/// How a value is written of which the half width of its interval keeps two digits.
#[derive(Clone, Copy)]
struct Sharpness {
    /// digits after the point
    digits: usize,
    /// power of ten in front of it
    exponent: i32,
}

impl Sharpness {
    fn of(value: f64, half_width: f64) -> Option<Self> {
        let size = value.abs().max(half_width);
        if !(size.is_finite() && half_width > 0.0) {
            return None;
        }
        #[allow(clippy::cast_possible_truncation, reason = "of the order of hundreds")]
        let order = |v: f64| v.log10().floor() as i32;
        let exponent = if PLAIN.contains(&size) { 0 } else { order(size) };
        let digits = usize::try_from((1 - order(half_width) + exponent).clamp(0, 12)).unwrap_or_default();
        Some(Self { digits, exponent })
    }

    fn mantissa(self, value: f64) -> String {
        let shown = format!("{:.*}", self.digits, value / 10f64.powi(self.exponent));
        // nothing has no sign
        match shown.strip_prefix('-') {
            Some(nothing) if nothing.bytes().all(|b| b == b'0' || b == b'.') => nothing.to_owned(),
            _ => shown,
        }
    }

    fn power(self) -> String {
        if self.exponent == 0 { String::new() } else { format!("e{}", self.exponent) }
    }
}

/// The sides of an interval differ by more than this share of its half width where it is shown by its ends.
const UNEVEN: f64 = 0.2;

/// A value as sharp as it is known, with the half width of its interval, or with its ends where the value is not in the middle.
pub(crate) fn measured(value: f64, ci95: Option<[f64; 2]>) -> String {
    if let Some(ends) = ci95.filter(|[low, high]| ((high - value) - (value - low)).abs() > UNEVEN * 0.5 * (high - low))
    {
        let [value, low, high] = interval(value, ends);
        return format!("{value} ({low} … {high})");
    }
    let half_width = ci95.map_or(0.0, |c| 0.5 * (c[1] - c[0]));
    match Sharpness::of(value, half_width) {
        Some(s) if s.exponent == 0 => format!("{} ± {}", s.mantissa(value), s.mantissa(half_width)),
        Some(s) => format!("({} ± {}){}", s.mantissa(value), s.mantissa(half_width), s.power()),
        None => significant(value),
    }
}

/// An estimate in the same way.
pub(crate) fn estimated(e: &Estimate) -> String {
    measured(e.value, Some(e.ci95))
}

/// A value and the ends of its interval, as sharp as they are known.
pub(crate) fn interval(value: f64, ci95: [f64; 2]) -> [String; 3] {
    let all = [value, ci95[0], ci95[1]];
    match Sharpness::of(value, 0.5 * (ci95[1] - ci95[0])) {
        Some(s) => all.map(|v| s.mantissa(v) + &s.power()),
        None => all.map(significant),
    }
}

/// A value and the half width of its interval, as sharp as that is.
pub(crate) fn with_half_width(value: f64, half_width: f64) -> [String; 2] {
    let both = [value, half_width];
    Sharpness::of(value, half_width).map_or(both.map(significant), |s| both.map(|v| s.mantissa(v) + &s.power()))
}

/// By how much an error became less.
pub(crate) fn times(before: f64, after: f64) -> String {
    let factor = before / after;
    if !factor.is_finite() {
        "no factor".into()
    } else if (factor - 1.0).abs() < AS_IT_WAS {
        "as it was".into()
    } else if factor < 1.05 {
        format!("{factor:.2} times less")
    } else if factor >= 10.0 {
        format!("{factor:.0} times less")
    } else {
        format!("{factor:.1} times less")
    }
}

/// A parameter of an effect as it is shown: angles in degrees, and rates in deg/s where they add to the recorded one.
pub(crate) struct Shown<'a> {
    pub(crate) name: &'a str,
    pub(crate) value: f64,
    pub(crate) ci95: Option<[f64; 2]>,
    pub(crate) unit: &'a str,
}

impl<'a> Shown<'a> {
    pub(crate) fn of(e: &EffectReport, p: &'a ParameterReport) -> Self {
        let beside = BESIDE_THE_LIBRARY.iter().any(|b| b.id == e.id && b.stage == "input");
        let of_the_input = beside || EffectId::from_id(&e.id).is_some_and(|id| id.description().stage == Stage::Input);
        let (factor, unit) = match p.unit.as_str() {
            "rad" => (1f64.to_degrees(), "deg"),
            "rad/s" if of_the_input => (1f64.to_degrees(), "deg/s"),
            "rad/s/K" if of_the_input => (1f64.to_degrees(), "deg/s/K"),
            unit => (1.0, unit),
        };
        Self { name: &p.name, value: factor * p.value, ci95: p.ci95.map(|c| c.map(|v| factor * v)), unit }
    }

    /// `name = value ± half width unit`
    pub(crate) fn in_words(&self) -> String {
        let unit = if self.unit == "1" { "" } else { self.unit };
        format!("{} = {} {unit}", self.name, measured(self.value, self.ci95)).trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_keep_three_significant_digits() {
        assert_eq!(degrees(29.63), "29.6°");
        assert_eq!(degrees(0.26789), "0.268°");
        assert_eq!(degrees(0.0011), "0.00110°");
        assert_eq!([degrees(f64::NAN), degrees(0.0), degrees(1e-6)], ["—", "below 0.000001°", "0.000001°"]);
    }

    #[test]
    fn a_value_is_as_sharp_as_it_is_known() {
        let of = |value: f64, half: f64| measured(value, Some([value - half, value + half]));
        assert_eq!(of(1.013_196_3, 3.9e-6), "1.0131963 ± 0.0000039");
        assert_eq!(of(27.019_08, 0.036_6), "27.019 ± 0.037");
        assert_eq!(of(180.0, 80.0), "180 ± 80");
        assert_eq!(of(2_127.998_439, 0.34), "2128.00 ± 0.34");
        // less than it is known to
        assert_eq!(of(-0.288_654, 5.6), "-0.3 ± 5.6");
        assert_eq!(of(2.618_21e-4, 1.2e-6), "(2.618 ± 0.012)e-4");
        assert_eq!(of(8.629e6, 240.0), "8629000 ± 240");
        assert_eq!(of(3.21e9, 4.1e7), "(3.210 ± 0.041)e9");
        assert_eq!([measured(3.0, None), of(3.0, 0.0), of(3.0, f64::INFINITY)], ["3", "3", "3"]);
        assert_eq!(interval(27.019_08, [26.982_494, 27.055_666]), ["27.019", "26.982", "27.056"]);
        assert_eq!(with_half_width(-103.2468, 0.3964), ["-103.25", "0.40"]);
        assert_eq!(interval(2.5e-6, [2.4e-6, 2.6e-6]), ["2.50e-6", "2.40e-6", "2.60e-6"]);
    }

    #[test]
    fn factors_are_as_sharp_as_they_are_known() {
        assert_eq!(times(0.27, 0.0011), "245 times less");
        assert_eq!(times(0.3, 0.1), "3.0 times less");
        assert_eq!(times(0.3, 0.0), "no factor");
        assert_eq!(
            [times(0.3, 0.29), times(0.3, 0.3), times(0.3, 0.299)],
            ["1.03 times less", "as it was", "as it was"]
        );
    }

    #[test]
    fn a_bias_is_in_degrees_a_second_and_a_split_is_not() {
        let of = |id: &str, unit: &str| {
            let p = ParameterReport { name: "p".into(), unit: unit.into(), value: 0.01, ci95: Some([0.009, 0.011]) };
            let e = EffectReport {
                id: id.into(),
                origin: cvg_calibration::Origin::Discovered,
                parameters: Vec::new(),
                heldout_rms_deg: None,
                evidence: String::new(),
                confounded_with: Vec::new(),
                separated_by: None,
            };
            Shown::of(&e, &p).in_words()
        };
        assert_eq!(of("rate-offset", "rad/s"), "p = 0.573 ± 0.057 deg/s");
        assert_eq!(of("rate-offset-temperature", "rad/s/K"), "p = 0.573 ± 0.057 deg/s/K");
        assert_eq!(of("anisoelasticity", "rad/s"), "p = 0.0100 ± 0.0010 rad/s");
        assert_eq!(of("angle-harmonic", "rad"), "p = 0.573 ± 0.057 deg");
        assert_eq!(of("detection-skew", "1"), "p = 0.0100 ± 0.0010");
    }
}
