#!/usr/bin/env python3
"""The closed loop's control step compiled by numba, beside the Rust one.

    pip install numba numpy scipy
    python benches/step.py            # runs `cargo bench -p cvg-simulator --bench step` too

Both do the same work in a step: pendulum variables (Equation 2), the energy and the quadrature PI with their limits
(Equation 3), the phase-locked loop, the forces projected on the pattern (Equation 9), the envelope propagated exactly
under held forces (a 4x4 and a 4x4 matrix), the reference's phase step. No noise, no readout effects. Two variants:

    arctan2  as one writes it: theta = arctan2(S, R)/2, made continuous by the in-phase vibration, then sin and cos
    algebra  the Rust crate's way: the direction of the major axis by half-angle algebra, no angle, and the series of
             the small phase step

The numbers at the end must agree with the Rust loop's physics: amplitude, v_as, and each other.
"""

import json
import math
import pathlib
import subprocess
import sys
import time

import numpy as np
from numba import njit
from scipy.linalg import expm

T = 5e-4
TAU, K, RATE = 22.0, 0.78, math.radians(500.0)
LIMIT = 10.0
STEPS = 2_000_000


def matrices():
    """[A B; 0 0] of the envelope (x_c, x_s, y_c, y_s) and its exponential."""
    j = np.array([[0.0, 1.0], [-1.0, 0.0]])  # multiplication by i on (c, s): (x_s, -x_c)
    one, zero = np.eye(2), np.zeros((2, 2))
    d = 4.7e-3 * np.array([math.cos(2 * math.radians(27)), math.sin(2 * math.radians(27))])
    w = 0.25132741 * np.array([math.cos(2 * math.radians(55)), math.sin(2 * math.radians(55))])
    a = np.block([[zero, one], [-one, zero]]) * (K * RATE) - np.eye(4) / TAU
    a -= 0.5 * np.block([[d[0] * one, d[1] * one], [d[1] * one, -d[0] * one]])
    a -= 0.5 * np.block([[w[0] * j, w[1] * j], [w[1] * j, -w[0] * j]])
    push = np.array([[0.0, -1.0], [1.0, 0.0]])  # forces (f_c, f_s) move (c, s) at (-f_s, f_c)/2w
    g = math.sqrt(1.0113)
    b = np.block([[g * push, zero], [zero, push / g]])
    exact = expm(np.block([[a, b], [np.zeros((4, 8))]]) * T)
    return np.ascontiguousarray(exact[:4, :4]), np.ascontiguousarray(exact[:4, 4:])


@njit(fastmath=False)
def bounded(v, limit):
    return min(max(v, -limit), limit)


@njit(fastmath=False)
def pi(state, i, gain, tau, e):
    """K[e + 1/(2 tau) integral], limited, without wind-up."""
    integral = state[i] + T * e
    v = gain * (e + integral / (2.0 * tau))
    if abs(v) <= LIMIT:
        state[i] = integral
        return v
    return bounded(v, LIMIT)


@njit(fastmath=False)
def electronics(z, state, tuning, algebra):
    xc, xs, yc, ys = z[0], z[1], z[2], z[3]
    x2, y2 = xc * xc + xs * xs, yc * yc + ys * ys
    e, r = x2 + y2, x2 - y2
    q = 2.0 * (xc * ys - yc * xs)
    s = 2.0 * (xc * yc + ys * xs)
    el = 2.0 * (xc * xs + yc * ys)
    if algebra:
        rho = math.sqrt(r * r + s * s)
        c, n = (s, rho - r) if r < 0.0 else (rho + r, s)
        scale = 1.0 / math.sqrt(2.0 * rho * (rho + abs(r)))
        if c * xc + n * yc < 0.0:
            scale = -scale
        c, n = c * scale, n * scale
    else:
        theta = 0.5 * math.atan2(s, r)
        c, n = math.cos(theta), math.sin(theta)
        if c * xc + n * yc < 0.0:
            c, n = -c, -n
    v_as = pi(state, 0, tuning[0], tuning[1], e - 1.0)
    v_qc = -pi(state, 1, tuning[0], tuning[1], q)
    error = -0.5 * el / e
    state[2] = bounded(state[2] + tuning[3] * error, 600.0)
    correction = bounded(tuning[2] * error + state[2], 600.0)
    return v_as, v_qc, c, n, correction


@njit(fastmath=False)
def run(z, phi, gamma, state, tuning, steps, algebra):
    v_as = 0.0
    for _ in range(steps):
        v_as, v_qc, c, n, correction = electronics(z, state, tuning, algebra)
        f0 = bounded(-v_qc * n, LIMIT)
        f1 = bounded(v_as * c, LIMIT)
        f2 = bounded(v_qc * c, LIMIT)
        f3 = bounded(v_as * n, LIMIT)
        x0, x1, x2, x3 = z[0], z[1], z[2], z[3]
        y0 = phi[0, 0] * x0 + phi[0, 1] * x1 + phi[0, 2] * x2 + phi[0, 3] * x3
        y1 = phi[1, 0] * x0 + phi[1, 1] * x1 + phi[1, 2] * x2 + phi[1, 3] * x3
        y2 = phi[2, 0] * x0 + phi[2, 1] * x1 + phi[2, 2] * x2 + phi[2, 3] * x3
        y3 = phi[3, 0] * x0 + phi[3, 1] * x1 + phi[3, 2] * x2 + phi[3, 3] * x3
        y0 += gamma[0, 0] * f0 + gamma[0, 1] * f1 + gamma[0, 2] * f2 + gamma[0, 3] * f3
        y1 += gamma[1, 0] * f0 + gamma[1, 1] * f1 + gamma[1, 2] * f2 + gamma[1, 3] * f3
        y2 += gamma[2, 0] * f0 + gamma[2, 1] * f1 + gamma[2, 2] * f2 + gamma[2, 3] * f3
        y3 += gamma[3, 0] * f0 + gamma[3, 1] * f1 + gamma[3, 2] * f2 + gamma[3, 3] * f3
        psi = correction * T
        if algebra and abs(psi) < 7e-3:
            p2 = psi * psi
            sin = psi - psi * p2 * (1.0 / 6.0 - p2 * (1.0 / 120.0))
            cos = 1.0 - p2 * (0.5 - p2 * (1.0 / 24.0))
        else:
            cos, sin = math.cos(psi), math.sin(psi)
        z[0], z[1] = y0 * cos - y1 * sin, y1 * cos + y0 * sin
        z[2], z[3] = y2 * cos - y3 * sin, y3 * cos + y2 * sin
    return v_as


def measure(algebra):
    """Nanoseconds per step (median of nine) and the loop's end."""
    phi, gamma = matrices()
    omega, zeta, lock = 2 * math.pi, 0.7, 2 * math.pi * 5.0
    tuning = np.array([zeta * omega, zeta / omega, 2 * lock, lock * lock * T])
    start = math.radians(10.0)
    times = []
    for attempt in range(10):
        z = np.array([math.cos(start), 0.0, math.sin(start), 0.0])
        state = np.array([-(1.0 / TAU) * 2.0 * tuning[1] / tuning[0], 0.0, 0.0])
        begin = time.perf_counter()
        v_as = run(z, phi, gamma, state, tuning, STEPS, algebra)
        if attempt:  # the first call compiles
            times.append(time.perf_counter() - begin)
    return 1e9 * float(np.median(times)) / STEPS, z, v_as


def rust():
    """Nanoseconds per step of the Rust loop, by criterion (median)."""
    root = pathlib.Path(__file__).resolve().parent.parent
    subprocess.run(["cargo", "bench", "-q", "-p", "cvg-simulator", "--bench", "step"], cwd=root, check=True,
                   stdout=subprocess.DEVNULL)
    target = json.loads(subprocess.run(["cargo", "metadata", "--format-version", "1", "--no-deps"], cwd=root, check=True,
                                       capture_output=True).stdout)["target_directory"]
    estimates = next(pathlib.Path(target, "criterion").glob("closed*loop/*/new/estimates.json"))
    return json.loads(estimates.read_text())["median"]["point_estimate"] / 10_000


def main():
    results = {name: measure(name == "algebra") for name in ("arctan2", "algebra")}
    for name, (ns, z, v_as) in results.items():
        print(f"numba, {name:8} {ns:7.1f} ns/step   energy {np.sum(z * z):.6f}   v_as {v_as:.6f}")
    if np.max(np.abs(results["arctan2"][1] - results["algebra"][1])) > 1e-6:
        sys.exit("the two variants do not agree")
    ns = rust()
    print(f"Rust             {ns:7.1f} ns/step   "
          + "   ".join(f"{results[n][0] / ns:.2f} times numba {n}" for n in results))


if __name__ == "__main__":
    main()
