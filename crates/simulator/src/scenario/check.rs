//! Whether settings make sense: every number in its domain, every run a recording that can be made.
//!
//! The first problem is reported with the key it belongs to. Nothing is corrected.

use cvg_model::effects::Stage;

use super::{EffectSetting, Instrument, Run, ScenarioError, Settings, Tuning};

/// The longest recording, rows.
const MOST_ROWS: f64 = 2e7;

/// Magnitudes of an angular gain, as a campaign may state it: that of a gyroscope, or the periods a turn of an encoder.
const POSSIBLE_GAIN: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// No rate table and no spindle turns faster, deg/s: ten times 17,000 turns a minute.
const LARGEST_RATE_DPS: f64 = 1e6;
/// A gain that wanders further would change its sign.
const LARGEST_WANDER: f64 = 0.03;

/// The longest run, control samples.
const MOST_SAMPLES: f64 = 1e9;

pub(super) fn settings(s: &Settings) -> Result<(), ScenarioError> {
    if s.device.is_empty() {
        return Err(ScenarioError::invalid("device", "has to have a name"));
    }
    for (field, value) in [
        ("tau_s", s.tau_s),
        ("amplitude_v", s.amplitude_v),
        ("drive_per_s_v", s.drive_per_s_v),
        ("limit_v", s.limit_v),
        ("control_hz", s.control_hz),
        ("sample_hz", s.sample_hz),
        ("carrier_hz", s.carrier_hz.unwrap_or(1.0)),
    ] {
        positive(field, value)?;
    }
    for (field, value) in [
        ("noise_v", s.noise_v),
        ("force_noise_v", s.force_noise_v),
        ("gain_flicker", s.gain_flicker),
        ("table_wander", s.table_wander),
        ("warm_up_s", s.warm_up_s),
    ] {
        not_negative(field, value)?;
    }
    for (field, value) in [("gain_flicker", s.gain_flicker), ("table_wander", s.table_wander)] {
        if value >= LARGEST_WANDER {
            return Err(ScenarioError::invalid(field, format!("{value} has to be below {LARGEST_WANDER}")));
        }
        if value > 0.0 && s.instrument == Instrument::Sensor {
            return Err(ScenarioError::invalid(field, "is of a gyroscope; a sensor has white noise only"));
        }
    }
    finite("detuning_hz", s.detuning_hz)?;
    for (field, value) in
        [("angular_gain", s.angular_gain), ("angular_gain_stated", s.angular_gain_stated.unwrap_or(s.angular_gain))]
    {
        finite(field, value)?;
        if value == 0.0 {
            return Err(ScenarioError::invalid(field, "is 0: the angle would not follow the input"));
        }
        if !POSSIBLE_GAIN.contains(&value.abs()) {
            return Err(ScenarioError::invalid(
                field,
                format!("{value} is no angular gain: its magnitude lies between 0.001 and 1000"),
            ));
        }
    }
    if let Some(t) = &s.temperature {
        finite("temperature.start_c", t.start_c)?;
        finite("temperature.drift_k_per_s", t.drift_k_per_s)?;
        finite("temperature.step_k", t.step_k)?;
        finite("temperature.reference_c", t.reference_c)?;
    }
    let per_row = s.control_hz / s.sample_hz;
    if (per_row - per_row.round()).abs() > 1e-9 * per_row || per_row < 0.5 {
        return Err(ScenarioError::invalid(
            "sample_hz",
            format!("{} does not divide control_hz = {}", s.sample_hz, s.control_hz),
        ));
    }
    let loops = &s.loops;
    for (name, tuning) in
        [("energy", loops.energy), ("quadrature", loops.quadrature), ("phase", loops.phase), ("rate", loops.rate)]
    {
        self::tuning(name, &tuning)?;
    }
    if let Some(spring) = &s.spring_isotropic {
        finite("spring_isotropic.c", spring.c)?;
        finite("spring_isotropic.frequency_per_energy", spring.frequency_per_energy())?;
        if s.instrument == Instrument::Sensor {
            return Err(ScenarioError::invalid("spring_isotropic", "a sensor has no spring"));
        }
    }
    effects(s)?;
    runs(s)
}

fn tuning(name: &str, t: &Tuning) -> Result<(), ScenarioError> {
    positive(&format!("loops.{name}.bandwidth_hz"), t.bandwidth_hz)?;
    positive(&format!("loops.{name}.damping"), t.damping)
}

fn effects(s: &Settings) -> Result<(), ScenarioError> {
    let all = s.effects.iter().map(|e| ("effects", e)).chain(s.compensation.iter().map(|e| ("compensation", e)));
    for (field, setting) in all {
        EffectSetting::new(setting.id, setting.values).map_err(|e| ScenarioError::invalid(field, e))?;
        let description = setting.id.description();
        if s.instrument == Instrument::Sensor && !description.in_sensors {
            return Err(ScenarioError::invalid(field, format!("a sensor cannot have {}", setting.id)));
        }
        if setting.id.by_temperature() && s.temperature.is_none() {
            return Err(ScenarioError::invalid(field, format!("{} needs a [temperature]", setting.id)));
        }
        if field == "compensation" && !matches!(description.stage, Stage::Readout | Stage::Actuation) {
            return Err(ScenarioError::invalid(
                field,
                format!("{} acts neither on the readout nor on the forces; the electronics cannot undo it", setting.id),
            ));
        }
    }
    if s.instrument == Instrument::Sensor && !s.compensation.is_empty() {
        return Err(ScenarioError::invalid("compensation", "a sensor has no electronics that compensate"));
    }
    Ok(())
}

fn runs(s: &Settings) -> Result<(), ScenarioError> {
    if s.runs.is_empty() {
        return Err(ScenarioError::invalid("run", "a scenario needs at least one [[run]]"));
    }
    for (index, run) in s.runs.iter().enumerate() {
        let file = run.file();
        let field = |key: &str| format!("run {file:?}: {key}");
        file_name(file, run.carrier_sample_hz().is_some())
            .map_err(|e| ScenarioError::invalid(format!("run {}: file", index + 1), e))?;
        if s.runs.iter().take(index).any(|r| r.file().eq_ignore_ascii_case(file)) {
            return Err(ScenarioError::invalid(field("file"), "another run has the same file"));
        }
        positive(&field("duration_s"), run.duration_s())?;
        positive(&field("amplitude"), run.amplitude())?;
        positive(&field("carrier_sample_hz"), run.carrier_sample_hz().unwrap_or(1.0))?;
        let rows_hz = run.carrier_sample_hz().unwrap_or(s.sample_hz);
        if run.duration_s() * rows_hz > MOST_ROWS || (run.duration_s() + s.warm_up_s) * s.control_hz > MOST_SAMPLES {
            return Err(ScenarioError::invalid(field("duration_s"), "is too long for one recording"));
        }
        if run.duration_s() * rows_hz < 1.0 {
            return Err(ScenarioError::invalid(field("duration_s"), "is shorter than one row"));
        }
        match run {
            Run::Rotation { rate_dps, settle_s, start_deg, .. } => {
                possible_rate(&field("rate_dps"), *rate_dps)?;
                not_negative(&field("settle_s"), *settle_s)?;
                finite(&field("start_deg"), start_deg.unwrap_or(0.0))?;
            }
            Run::Ringdown { angle_deg, energy_off_s, duration_s, .. } => {
                if s.instrument == Instrument::Sensor {
                    return Err(ScenarioError::invalid(field("kind"), "a sensor has no ring-down"));
                }
                finite(&field("angle_deg"), *angle_deg)?;
                not_negative(&field("energy_off_s"), *energy_off_s)?;
                if energy_off_s >= duration_s {
                    return Err(ScenarioError::invalid(field("energy_off_s"), "has to be before the end of the run"));
                }
            }
            Run::Decay { start_deg, quadrature, rate_dps, .. } => {
                if s.instrument == Instrument::Sensor {
                    return Err(ScenarioError::invalid(field("kind"), "a sensor has nothing that rings"));
                }
                finite(&field("start_deg"), *start_deg)?;
                possible_rate(&field("rate_dps"), *rate_dps)?;
                if !(-1.0..=1.0).contains(quadrature) {
                    return Err(ScenarioError::invalid(
                        field("quadrature"),
                        format!("{quadrature} is outside [-1, 1]: the minor axis is no longer than the major one"),
                    ));
                }
            }
            Run::Virtual { virtual_dps, reversal_s, turned, settle_s, .. } => {
                if s.instrument == Instrument::Sensor {
                    return Err(ScenarioError::invalid(field("kind"), "a sensor has nothing that precesses"));
                }
                not_negative(&field("virtual_dps"), *virtual_dps)?;
                possible_rate(&field("virtual_dps"), *virtual_dps)?;
                positive(&field("reversal_s"), *reversal_s)?;
                not_negative(&field("settle_s"), *settle_s)?;
                for [from_s, rate_dps] in turned {
                    not_negative(&field("turned"), *from_s)?;
                    possible_rate(&field("turned"), *rate_dps)?;
                }
                if !turned.is_sorted_by(|a, b| a[0] < b[0]) {
                    return Err(ScenarioError::invalid(field("turned"), "has to be in the order of time"));
                }
            }
        }
    }
    Ok(())
}

/// A plain name in the campaign's own folder.
fn file_name(name: &str, is_at_carrier: bool) -> Result<(), String> {
    let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || "+-_.".contains(c));
    let ends = name.ends_with(".csv") || cfg!(feature = "parquet") && name.ends_with(".parquet");
    // raw numbers have no time, which those of the converters do not need
    let is_raw = is_at_carrier && name.ends_with(".f32");
    if name.is_empty() || !plain || name.starts_with('.') || !(ends || is_raw) {
        return Err(format!(
            "{name:?} is not a plain name of letters, digits and + - _ . that ends in .csv{}, or at the carrier in .f32",
            if cfg!(feature = "parquet") { " or .parquet" } else { "" }
        ));
    }
    Ok(())
}

fn finite(field: &str, value: f64) -> Result<(), ScenarioError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(ScenarioError::invalid(field, format!("{value} is not a finite number")))
    }
}

fn possible_rate(field: &str, value: f64) -> Result<(), ScenarioError> {
    finite(field, value)?;
    if value.abs() > LARGEST_RATE_DPS {
        return Err(ScenarioError::invalid(
            field,
            format!("{value} deg/s is no rate: the largest is {LARGEST_RATE_DPS}"),
        ));
    }
    Ok(())
}

fn positive(field: &str, value: f64) -> Result<(), ScenarioError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(ScenarioError::invalid(field, format!("{value} has to be finite and positive")))
    }
}

fn not_negative(field: &str, value: f64) -> Result<(), ScenarioError> {
    if value >= 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(ScenarioError::invalid(field, format!("{value} has to be finite and not negative")))
    }
}
