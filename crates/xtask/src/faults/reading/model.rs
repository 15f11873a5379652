//! … of the model.

use super::{Fault, fault};

const LIB: (&str, &str) = ("cvg-model", "--lib");
const EFFECTS: (&str, &str) = ("cvg-model", "effects");
const EQUATIONS: (&str, &str) = ("cvg-model", "equations");
const RESONATOR: (&str, &str) = ("cvg-model", "resonator");

pub(super) const FAULTS: &[Fault] = &[
    fault(
        "an orbit that is turned back keeps its angle",
        "model/src/pendulum.rs",
        "let theta = if turn_back { opposite(theta) } else { theta };",
        "let theta = theta;",
        EQUATIONS,
    ),
    fault(
        "a precession is that of the double angle",
        "model/src/pendulum.rs",
        "T::half() * (p.r * d.s - p.s * d.r) / (p.r * p.r + p.s * p.s)",
        "(p.r * d.s - p.s * d.r) / (p.r * p.r + p.s * p.s)",
        EFFECTS,
    ),
    fault(
        "a value is bounded by a negative limit",
        "model/src/scalar.rs",
        "    } else if limit >= T::zero() && value < -limit {",
        "    } else if value < -limit {",
        LIB,
    ),
    fault(
        "an effect is found by how its name ends",
        "model/src/effects/mod.rs",
        "find(|e| e.description().id == id)",
        "find(|e| e.description().id.ends_with(id))",
        EFFECTS,
    ),
    fault(
        "a cubic acts on the angle itself",
        "model/src/effects/mod.rs",
        "&& self < Self::DetectionCubic",
        "&& self <= Self::DetectionCubic",
        EFFECTS,
    ),
    fault(
        "a table's order explains however high it is",
        "model/src/effects/mod.rs",
        "*v <= f64::from(explained_to) && ",
        "",
        EFFECTS,
    ),
    fault(
        "the clipping of Y's drive is that of X",
        "model/src/effects/drive_saturation.rs",
        "let y = clipped_gain(inverse_level * f.y_c.norm(f.y_s));",
        "let y = clipped_gain(inverse_level * f.x_c.norm(f.x_s));",
        EFFECTS,
    ),
    fault(
        "what is in inverse proportion to the rate has its sign",
        "model/src/effects/harmonic_n.rs",
        "        one / precession_rad_s\n",
        "        direction / precession_rad_s\n",
        EFFECTS,
    ),
    fault(
        "a law between rate and its inverse is the rate",
        "model/src/effects/harmonic_n.rs",
        "T::ratio(2 * steps + 1, 2)",
        "T::ratio(2 * steps + 2, 2)",
        EFFECTS,
    ),
    fault(
        "an anisotropy lies along twice its axis",
        "model/src/resonator/mod.rs",
        "(T::two() * axis_rad).sin_cos()",
        "axis_rad.sin_cos()",
        EQUATIONS,
    ),
    fault(
        "the difference of two cubics is on one channel",
        "model/src/effects/detection_cubic.rs",
        "y: three_quarters * (kappa - difference) }",
        "y: three_quarters * kappa }",
        EFFECTS,
    ),
    fault(
        "a latency turns an envelope that is at rest",
        "model/src/effects/angle_latency.rs",
        "        let (sin, cos) = (latency * at.precession_rad_s).sin_cos();\n        e.turned(sin, cos)\n",
        "        let (sin, cos) = (latency * at.precession_rad_s.squared().sqrt()).sin_cos();\n        e.turned(sin, cos)\n",
        EFFECTS,
    ),
    fault(
        "a map of a moment leaves its temperature",
        "model/src/effects/moment.rs",
        "warmer_k: f(self.warmer_k),",
        "warmer_k: f(self.t_s),",
        EFFECTS,
    ),
    fault(
        "a large cubic is undone as a small one",
        "model/src/effects/detection_cubic.rs",
        "if k_2 * k_2 <= T::epsilon() {",
        "if k_2 * k_2 * k_2 <= T::epsilon() {",
        EFFECTS,
    ),
    fault(
        "a drift in time is taken for one without",
        "model/src/effects/gain_drift.rs",
        "const IN_TIME: bool = true;",
        "const IN_TIME: bool = false;",
        EFFECTS,
    ),
    fault(
        "a drift of the angular gain has no clock",
        "model/src/effects/scale_drift.rs",
        "const IN_TIME: bool = true;",
        "const IN_TIME: bool = false;",
        EFFECTS,
    ),
    fault(
        "what follows the temperature has no thermometer",
        "model/src/effects/over_temperature.rs",
        "const BY_TEMPERATURE: bool = true;",
        "const BY_TEMPERATURE: bool = false;",
        EFFECTS,
    ),
    fault(
        "what is fed through does not depend on the commands",
        "model/src/effects/drive_feedthrough.rs",
        "const ON_COMMANDS: bool = true;",
        "const ON_COMMANDS: bool = false;",
        EFFECTS,
    ),
    fault(
        "loops do not see an unequal phase",
        "model/src/effects/detection_phase.rs",
        "const SEEN_BY_LOOPS: bool = true;",
        "const SEEN_BY_LOOPS: bool = false;",
        EFFECTS,
    ),
    fault(
        "a nonlinear spring turns with the other phase",
        "model/src/effects/spring_cubic.rs",
        "cos * T::two() * p.r * p.s + sin * (r2 - s2)",
        "cos * T::two() * p.r * p.s - sin * (r2 - s2)",
        EFFECTS,
    ),
    fault(
        "a detuned envelope turns back",
        "model/src/resonator/envelope.rs",
        "e.quarter_ahead() * ahead_rad_s",
        "e.quarter_ahead() * (-ahead_rad_s)",
        RESONATOR,
    ),
    fault(
        "a quintic is undone in three steps",
        "model/src/effects/detection_quintic.rs",
        "const NEWTON_STEPS: usize = 6;",
        "const NEWTON_STEPS: usize = 3;",
        EFFECTS,
    ),
    fault(
        "the neutral value of every parameter is zero",
        "model/src/effects/mod.rs",
        "*v = T::from_f64(p.neutral);",
        "*v = T::from_f64(0.0 * p.neutral);",
        EFFECTS,
    ),
];
