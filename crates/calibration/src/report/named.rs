//! How reports name the numbers of effects, and the effects that reports have beside the library's. Where values come from is
//! elsewhere.

use cvg_model::effects::{Description, EffectId, Shown};

/// An effect that reports have and the library has not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beside {
    /// identifier in reports
    pub id: &'static str,
    /// one line for people
    pub title: &'static str,
    /// where it acts
    pub stage: &'static str,
    /// which reports have it
    pub of: &'static str,
    /// names of its parameters and their units; `#` stands for a number from 1 on
    pub parameters: &'static [(&'static str, &'static str)],
}

/// A Fourier series of the angle.
pub const ANGLE_TABLE: Beside = Beside {
    id: "angle-table",
    title: "what repeats with the angle and no effect explains, as a Fourier series",
    stage: "readout",
    of: "angle sensors",
    parameters: &[("cos_#", "rad"), ("sin_#", "rad")],
};
/// A converter at its rail.
pub const DETECTION_CLIP: Beside = Beside {
    id: "detection-clip",
    title: "a converter at its rail, and where that is",
    stage: "readout",
    of: "angle sensors",
    parameters: &[("x_low", "V"), ("x_high", "V"), ("y_low", "V"), ("y_high", "V")],
};
/// Offsets that go with the temperature.
pub const OFFSET_TEMPERATURE: Beside = Beside {
    id: "offset-temperature",
    title: "offsets of the two channels that follow the temperature",
    stage: "readout",
    of: "angle sensors",
    parameters: &[("offset_x_per_k", "V/K"), ("offset_y_per_k", "V/K")],
};
/// An angle that is late in proportion to the acceleration.
pub const ACCELERATION_LAG: Beside = Beside {
    id: "acceleration-lag",
    title: "an error in proportion to the acceleration, as of a tracking loop; told of the data, and not undone",
    stage: "readout",
    of: "angle sensors",
    parameters: &[("acceleration_lag", "s^2")],
};
/// A bias that goes with the temperature.
pub const RATE_OFFSET_TEMPERATURE: Beside = Beside {
    id: "rate-offset-temperature",
    title: "a bias that follows the temperature",
    stage: "input",
    of: "rate gyroscopes",
    parameters: &[("rate_offset_per_k", "rad/s/K")],
};
/// A spring that hardens alike in all directions.
pub const SPRING_ISOTROPIC: Beside = Beside {
    id: "spring-isotropic",
    title: "a spring that hardens alike in all directions: precession by quadrature, and a frequency that goes with the energy",
    stage: "mechanics",
    of: "free decays",
    parameters: &[("c", "rad/s/V^2"), ("frequency_per_energy", "rad/s/V^2")],
};
/// Damping that grows with the energy.
pub const DAMPING_NONLINEAR: Beside = Beside {
    id: "damping-nonlinear",
    title: "damping that grows with the energy",
    stage: "mechanics",
    of: "free decays",
    parameters: &[("gamma", "1/s/V^2")],
};

/// All of them.
pub const BESIDE_THE_LIBRARY: [Beside; 7] = [
    ANGLE_TABLE,
    DETECTION_CLIP,
    OFFSET_TEMPERATURE,
    ACCELERATION_LAG,
    RATE_OFFSET_TEMPERATURE,
    SPRING_ISOTROPIC,
    DAMPING_NONLINEAR,
];

/// Names that reports have for numbers of effects of the library beside those by which the library shows them, and their units.
const FURTHER: [(EffectId, &[(&str, &str)]); 3] = [
    // of a decay near one angle, the component that shows there
    (EffectId::Anisoelasticity, &[("anisoelasticity_across", "rad/s")]),
    // of decays
    (EffectId::DetectionOffset, &[("offset_x_quadrature", "V"), ("offset_y_quadrature", "V")]),
    // of sensors, whose angle has the line and not the rate of a table
    (EffectId::TableHarmonic, &[("amplitude", "rad")]),
];

/// The names of an effect's parameters as the library shows them, with their units: a pair as a magnitude and an angle.
#[must_use]
pub fn shown(d: &Description) -> Vec<(&'static str, &'static str)> {
    let named = d.shown.iter().flat_map(|shown| match *shown {
        Shown::Plain(at) => vec![(d.parameters[at].name, d.parameters[at].unit)],
        Shown::Polar { magnitude, unit, angle, .. } => vec![(magnitude, unit), (angle, "deg")],
    });
    named.collect()
}

/// All names that reports have for the numbers of an effect, with their units.
#[must_use]
pub fn of_effect(d: &Description) -> Vec<(&'static str, &'static str)> {
    let further =
        FURTHER.iter().filter(|(id, _)| id.description().id == d.id).flat_map(|(_, names)| names.iter().copied());
    shown(d).into_iter().chain(further).collect()
}
