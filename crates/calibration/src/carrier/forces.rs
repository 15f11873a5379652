//! Forces at the carrier: what the drives do along the pattern and across it, as outputs of the controllers.
//!
//! Equation 9 the other way: the forces of a window are turned by the phase of its orbit, then by the direction of its pattern. Half a
//! period later both ends of the orbit have changed places, and v_as and v_qc are the same. Signs are those of Equation 3: v_as > 0
//! takes energy out, v_qc > 0 adds quadrature.
//!
//! A force that is recorded early or late, as the codes of a converter are, has a phase of its own. Over a run, the forces along a
//! pattern that lasts push it; the phase in which they do is then told from theirs.

use std::f64::consts::PI;

use cvg_model::{AxisForces, OrbitForces};

use super::windows::{Window, phased};
use crate::numerics::angles::wrapped;
use crate::recording::{Recording, RunKind};

/// Standard errors beyond which a force is no accident.
const NO_ACCIDENT: f64 = 5.0;
/// A force that no loop of the model commands is worth a word from this share of what pushes on, and a phase from this angle, rad.
const WORTH_A_WORD: f64 = 0.02;
const PHASE_WORTH_A_WORD: f64 = 0.03;
/// Forces across the pattern have a phase where their variance in it is so many times that a quarter of a period later.
const HAS_A_PHASE: f64 = 10.0;

/// Puts the outputs that made the forces of a driven vibration into its recording, and says what else the forces hold. An output is not
/// a number where a force is missing.
pub(super) fn put_into(out: &mut Recording, seen: &[Window], name: &str, kind: RunKind) -> Vec<String> {
    let late = late_rad(&along_orbits(seen, 0.0));
    let forces = along_orbits(seen, late);
    if forces.iter().all(|f| f.a_s.is_nan()) {
        return vec![format!("{name}: fx_v or fy_v has a gap in every envelope: neither is used")];
    }
    let of = |part: fn(&OrbitForces<f64>) -> f64| Some(forces.iter().map(part).collect());
    (out.vas_v, out.vqc_v) = (of(|f| f.a_s), of(|f| f.q_c));
    let mut said = vec![format!("{name}: vas_v and vqc_v are what fx_v and fy_v push along the pattern and across it")];
    if late.abs() > PHASE_WORTH_A_WORD {
        let way = if late > 0.0 { "behind" } else { "ahead of" };
        said.push(format!(
            "{name}: fx_v and fy_v are {:.1}° of the carrier {way} what keeps the vibration up, and are taken for forces that were \
             recorded at another time",
            late.abs().to_degrees()
        ));
    }
    let pushes = rms(&forces, |f| f.a_s);
    // the loop that holds the pattern of a ring-down turns it
    let turns = if matches!(kind, RunKind::Ringdown { .. }) { 0.0 } else { rms(&forces, |f| f.q_s) };
    let others = [
        (rms(&forces, |f| f.a_c), "along the pattern in phase with it, which shifts its frequency"),
        (turns, "across the pattern in the phase that turns it"),
    ];
    let others = others.into_iter().filter(|(volts, _)| *volts > WORTH_A_WORD * pushes);
    said.extend(others.map(|(volts, what)| {
        format!("{name}: fx_v and fy_v hold {volts:.2e} V {what}: neither v_as nor v_qc, and not used")
    }));
    said
}

/// What is to be said of the forces of a vibration that is left to itself: nothing where there are none.
pub(super) fn of_a_decay(seen: &[Window], name: &str) -> Option<String> {
    let forces = along_orbits(seen, 0.0);
    let parts: [fn(&OrbitForces<f64>) -> f64; 4] = [|f| f.a_s, |f| f.a_c, |f| f.q_s, |f| f.q_c];
    let volts = parts.map(|part| rms(&forces, part)).iter().fold(0.0, |all: f64, part| all.hypot(*part));
    (volts > 0.0).then(|| {
        format!(
            "{name}: fx_v and fy_v hold {volts:.2e} V that goes with the vibration: it does not decay freely, or they pick it up"
        )
    })
}

/// The forces of windows along the axes of their orbits, put ahead by a phase, rad.
fn along_orbits(seen: &[Window], ahead_rad: f64) -> Vec<OrbitForces<f64>> {
    let missing = OrbitForces { a_s: f64::NAN, q_s: f64::NAN, a_c: f64::NAN, q_c: f64::NAN };
    let along = |w: &Window| {
        let orbit = w.envelope.orbit();
        let f = phased(&w.forces?, ahead_rad - orbit.delta);
        Some(AxisForces { x_c: f.x_c, x_s: f.x_s, y_c: f.y_c, y_s: f.y_s }.along_orbit(orbit.theta))
    };
    seen.iter().map(|w| along(w).unwrap_or(missing)).collect()
}

/// How far forces are recorded behind what they do along an orbit that lasts, rad: their mean pushes, which no phase force does. Where
/// what acts across the pattern has a phase, and not the same, a phase force is beside what pushes, and the forces are on time.
fn late_rad(forces: &[OrbitForces<f64>]) -> f64 {
    type Part = fn(&OrbitForces<f64>) -> f64;
    let whole = || forces.iter().filter(|f| f.a_s.is_finite());
    let n = whole().count().max(1) as f64;
    let mean = |part: Part| whole().map(part).sum::<f64>() / n;
    let covariance = |one: Part, other: Part| {
        let (m, k) = (mean(one), mean(other));
        whole().map(|f| (one(f) - m) * (other(f) - k)).sum::<f64>() / n
    };
    let (a_c, a_s): (Part, Part) = (|f| f.a_c, |f| f.a_s);
    let (in_phase, pushing) = (mean(a_c), -mean(a_s));
    let error = ((covariance(a_c, a_c) + covariance(a_s, a_s)) / n).sqrt();
    if in_phase.hypot(pushing) <= NO_ACCIDENT * error {
        return 0.0;
    }
    let late = in_phase.atan2(pushing);
    let (q_c, q_s): (Part, Part) = (|f| f.q_c, |f| f.q_s);
    let (cc, ss, cs) = (covariance(q_c, q_c), covariance(q_s, q_s), covariance(q_c, q_s));
    let (middle, half) = (0.5 * (cc + ss), (0.5 * (cc - ss)).hypot(cs));
    if middle + half < HAS_A_PHASE * (middle - half) {
        return late;
    }
    let across = 0.5 * (2.0 * cs).atan2(cc - ss);
    // of the opposite sign, or not
    let on_time = if pushing < 0.0 { PI } else { 0.0 };
    let from = |phase: f64| wrapped(across - phase, PI).abs();
    if from(on_time) < from(late) { on_time } else { late }
}

/// Root of the mean square of a part of the forces, V, without its noise, which a window does not share with the next; zero where it
/// may be an accident.
fn rms(forces: &[OrbitForces<f64>], part: fn(&OrbitForces<f64>) -> f64) -> f64 {
    let (mut shared, mut all, mut n) = (0.0, 0.0, 0.0);
    for pair in forces.windows(2) {
        let (one, other) = (part(&pair[0]), part(&pair[1]));
        if one.is_finite() && other.is_finite() {
            (shared, all, n) = (shared + one * other, all + one * one, n + 1.0);
        }
    }
    if shared > NO_ACCIDENT * all / f64::sqrt(n) { f64::sqrt(shared / n) } else { 0.0 }
}

#[cfg(test)]
mod tests;
