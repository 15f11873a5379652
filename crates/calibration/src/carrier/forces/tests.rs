use std::f64::consts::TAU;

use cvg_model::{ActuationGains, ControlOutputs, Envelope, Orbit};

use super::*;
use crate::carrier::seen;
use crate::numerics::statistics::line;

const HZ: f64 = 100.0;
const STEP_S: f64 = 5e-4;
const DIRECTION: f64 = 0.6;

/// A vibration along a direction, by the equation of motion ẍ = −ω²x + f: the force is `pushes` times its velocity, and across the
/// direction `adds` times the displacement along it.
fn driven(pushes: f64, adds: f64) -> Recording {
    let (omega, [cos, sin]) = (TAU * HZ, [DIRECTION.cos(), DIRECTION.sin()]);
    let force = |[x, y, vx, vy]: [f64; 4]| {
        let along = x * cos + y * sin;
        [pushes * vx - adds * along * sin, pushes * vy + adds * along * cos]
    };
    let rate = |s: [f64; 4]| {
        let [fx, fy] = force(s);
        [s[2], s[3], fx - omega * omega * s[0], fy - omega * omega * s[1]]
    };
    let ahead = |s: [f64; 4], d: [f64; 4], h: f64| std::array::from_fn::<f64, 4, _>(|i| s[i] + h * d[i]);
    // 0.7 rad ahead of the reference
    let (sin_0, cos_0) = 0.7_f64.sin_cos();
    let mut state = [cos * cos_0, sin * cos_0, -omega * cos * sin_0, -omega * sin * sin_0];
    let mut columns: [Vec<f64>; 5] = Default::default();
    for row in 0..50_000 {
        let [fx, fy] = force(state);
        for (column, value) in columns.iter_mut().zip([f64::from(row) * STEP_S, state[0], state[1], fx, fy]) {
            column.push(value);
        }
        // Runge and Kutta, eight steps a row
        let h = STEP_S / 8.0;
        for _ in 0..8 {
            let a = rate(state);
            let b = rate(ahead(state, a, 0.5 * h));
            let c = rate(ahead(state, b, 0.5 * h));
            let d = rate(ahead(state, c, h));
            state = std::array::from_fn(|i| state[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
        }
    }
    let [t_s, x, y, fx, fy] = columns;
    Recording { t_s, x_v: Some(x), y_v: Some(y), fx_v: Some(fx), fy_v: Some(fy), ..Recording::default() }
}

fn demodulated(r: &Recording) -> Recording {
    seen(r, "run", Some(HZ), RunKind::Rotation).expect("a carrier").expect("at the carrier")
}

fn orbits(r: &Recording) -> Vec<Orbit<f64>> {
    let column = |c: &Option<Vec<f64>>, i: usize| c.as_ref().expect("a column")[i];
    let envelope = |i| Envelope::new(column(&r.xc_v, i), column(&r.xs_v, i), column(&r.yc_v, i), column(&r.ys_v, i));
    (0..r.len()).map(|i| envelope(i).orbit()).collect()
}

/// ȧ ∋ −f_as/2ω: what pushes a vibration is a negative v_as, of the size that its growth says.
#[test]
fn a_force_along_the_velocity_is_an_energy_command_that_brings_energy_in() {
    let r = demodulated(&driven(0.05, 0.0));
    let (v_as, orbits) = (r.vas_v.as_deref().expect("forces"), orbits(&r));
    let ln_a: Vec<f64> = orbits.iter().map(|o| o.a.ln()).collect();
    let grows = line(&r.t_s, &ln_a).0;
    assert!((grows - 0.025).abs() < 1e-5, "{grows}");
    for (v, o) in v_as.iter().zip(&orbits) {
        assert!((-v / (2.0 * TAU * HZ * o.a) - grows).abs() < 1e-3 * grows, "{v} at {o:?}");
    }
    assert!(r.vqc_v.iter().flatten().all(|v| v.abs() < 1e-6));
}

/// q̇ ∋ +f_qc/2ω: what adds quadrature is a positive v_qc, of the size that its growth says.
#[test]
fn a_force_across_the_pattern_with_the_displacement_is_a_quadrature_command() {
    let r = demodulated(&driven(0.0, 1.0));
    let (v_qc, orbits) = (r.vqc_v.as_deref().expect("forces"), orbits(&r));
    let q: Vec<f64> = orbits.iter().map(|o| o.q).collect();
    let grows = line(&r.t_s, &q).0;
    assert!(grows > 0.0 && v_qc.iter().all(|v| (v / (2.0 * TAU * HZ) - grows).abs() < 1e-3 * grows), "{grows}");
}

/// Windows of a pattern that turns while its phase runs, and of forces by Equation 9, late by a phase; `v_ac` is a phase force.
fn windows(late_rad: f64, v_ac: f64) -> Vec<(Window, ControlOutputs<f64>)> {
    let window = |i: u32| {
        let at = f64::from(i);
        let (theta, delta) = (0.3 - 0.02 * at, 0.05 * at);
        let v = ControlOutputs { v_as: -0.05 * (1.0 + 0.01 * (2.0 * theta).cos()), v_qc: 0.02 * (2.0 * theta).sin() };
        let f = ActuationGains { x: 1.0, y: 1.0 }.axis_forces(&v, theta);
        let f = Envelope::new(f.x_c + v_ac * theta.cos(), f.x_s, f.y_c + v_ac * theta.sin(), f.y_s);
        let window = Window {
            t_s: at,
            envelope: Orbit { a: 1.0, q: 1e-4, theta, delta }.envelope(),
            forces: Some(phased(&f, delta - late_rad)),
            rows: 0..1,
        };
        (window, v)
    };
    (0..600).map(window).collect()
}

/// What is said of forces, after it is found that the outputs are those that made them.
fn said(windows: &[(Window, ControlOutputs<f64>)], within: f64) -> Vec<String> {
    let seen: Vec<Window> = windows.iter().map(|(w, _)| w.clone()).collect();
    let mut out = Recording::default();
    let said = put_into(&mut out, &seen, "run", RunKind::Rotation);
    let (v_as, v_qc) = (out.vas_v.expect("forces"), out.vqc_v.expect("forces"));
    for (i, (_, v)) in windows.iter().enumerate() {
        assert!((v_as[i] - v.v_as).abs() < within && (v_qc[i] - v.v_qc).abs() < within, "{i}: {v:?}");
    }
    said
}

#[test]
fn the_outputs_are_those_that_made_the_forces_whenever_these_were_recorded() {
    assert_eq!(said(&windows(0.0, 0.0), 1e-12).len(), 1);
    for late_rad in [0.9, -0.9, 1.7, -1.7, 3.0] {
        let said = said(&windows(late_rad, 0.0), 1e-12);
        let way = if late_rad > 0.0 { "behind" } else { "ahead of" };
        let expected = format!("{:.1}° of the carrier {way} what keeps the vibration up", late_rad.abs().to_degrees());
        assert!(said.len() == 2 && said[1].contains(&expected), "{said:?}");
    }
}

#[test]
fn a_phase_force_is_named_and_not_taken_for_lateness() {
    for v_ac in [0.03, -0.03] {
        let said = said(&windows(0.0, v_ac), 1e-12);
        assert!(said.len() == 2 && said[1].contains("3.00e-2 V along the pattern in phase with it"), "{said:?}");
    }
}

#[test]
fn a_force_that_turns_the_pattern_is_named_but_in_a_ring_down() {
    let mut seen: Vec<Window> = windows(0.0, 0.0).into_iter().map(|(w, _)| w).collect();
    for w in &mut seen {
        let orbit = w.envelope.orbit();
        let (sin, cos) = orbit.theta.sin_cos();
        let turns = phased(&Envelope::new(0.0, -0.01 * sin, 0.0, 0.01 * cos), orbit.delta);
        w.forces = w.forces.map(|f| f + turns);
    }
    let said = |kind| put_into(&mut Recording::default(), &seen, "run", kind);
    let rotation = said(RunKind::Rotation);
    assert!(rotation.len() == 2 && rotation[1].contains("1.00e-2 V across the pattern"), "{rotation:?}");
    assert_eq!(said(RunKind::Ringdown { angle_deg: 0.0, energy_off_s: 1.0 }).len(), 1);
}

#[test]
fn outputs_that_are_recorded_stand_over_forces() {
    let mut r = driven(0.05, 0.0);
    r.vas_v = Some(vec![-3.0; r.len()]);
    let r = demodulated(&r);
    assert!(r.vas_v.iter().flatten().all(|v| *v == -3.0) && r.vqc_v.is_none());
    assert!(r.warnings.iter().any(|w| w.contains("fx_v and fy_v are not used: vas_v or vqc_v is recorded itself")));
}

#[test]
fn a_force_that_is_missing_is_missing_in_its_envelope() {
    let mut r = driven(0.05, 0.0);
    r.fy_v.iter_mut().for_each(|f| f[1000] = f64::NAN);
    let v_as = demodulated(&r).vas_v.expect("forces");
    assert_eq!(v_as.iter().filter(|v| v.is_nan()).count(), 1);
}

#[test]
fn forces_in_a_decay_are_named_where_there_are_any() {
    let said = |pushes: f64, scale: f64| {
        let mut r = driven(pushes, 0.0);
        [&mut r.fx_v, &mut r.fy_v].into_iter().flatten().flatten().for_each(|f| *f *= scale);
        seen(&r, "run", Some(HZ), RunKind::Decay).expect("a carrier").expect("at the carrier").warnings.join("\n")
    };
    assert!(said(-0.05, 1.0).contains("fx_v and fy_v hold"), "{}", said(-0.05, 1.0));
    assert!(!said(-0.05, 0.0).contains("fx_v"), "{}", said(-0.05, 0.0));
}
