#!/usr/bin/env python3
"""The loop at the carrier by scipy's solve_ivp, beside the Rust one in the same run.

    pip install numpy scipy
    python benches/carrier.py            # builds and runs benches/carrier too, which compares with C

The scenario is that of benches/carrier: whole-angle mode at 500 deg/s, 100 kHz converters, a control step every 50 samples.
Lynch's equations are integrated by DOP853 with rtol 1e-8 from control step to control step under drives whose amplitudes
are held; the readout at the 50 sampling instants is fitted by least squares, and the loops of Equation 3 and the
phase-locked loop close in Python. In the end the energy and the precession rate have to be those that the loops hold.
"""

import math
import pathlib
import re
import subprocess
import sys
import time

import numpy as np
from scipy.integrate import solve_ivp

HERE = pathlib.Path(__file__).resolve().parent
SAMPLE_S, N = 1e-5, 50
W = N * SAMPLE_S
OMEGA, K, K2, RATE, TAU = 2 * math.pi * 15200.0, 0.78, 0.6, math.radians(500.0), 22.0
ANISODAMPING, THETA_TAU = 4.7e-3, math.radians(27)
SPLIT, THETA_OMEGA = 2 * math.pi * 0.04, math.radians(55)
GAINS, KAPPA = np.array([1.0, 1.0132]), 0.004
WINDOWS = int(sys.argv[1]) if len(sys.argv) > 1 else 400


def motion(t, z, phase, omega, f):
    x, y, vx, vy = z
    c2t, s2t = math.cos(2 * THETA_TAU), math.sin(2 * THETA_TAU)
    c2w, s2w = math.cos(2 * THETA_OMEGA), math.sin(2 * THETA_OMEGA)
    c, s = math.cos(phase + omega * t), math.sin(phase + omega * t)
    stiff = OMEGA**2 - K2 * RATE**2
    fx, fy = 2 * OMEGA * (f[0] * c + f[1] * s), 2 * OMEGA * (f[2] * c + f[3] * s)
    ax = fx + 2 * K * RATE * vy - 2 / TAU * vx - ANISODAMPING * (vx * c2t + vy * s2t)
    ay = fy - 2 * K * RATE * vx - 2 / TAU * vy - ANISODAMPING * (vx * s2t - vy * c2t)
    ax += -stiff * x + OMEGA * SPLIT * (x * c2w + y * s2w)
    ay += -stiff * y + OMEGA * SPLIT * (x * s2w - y * c2w)
    return vx, vy, ax, ay


def main():
    theta = math.radians(10)
    z = np.array([math.cos(theta), math.sin(theta), 0.0, 0.0])
    wn_e, wn_q, wn_p = 2 * math.pi * 2.0, 2 * math.pi * 5.0, 2 * math.pi * 20.0
    phase, omega, detuning = 0.0, OMEGA, 0.0
    f, i_e, i_q, last, turned = np.zeros(4), 0.0, 0.0, None, 0.0
    begin = time.process_time()
    for _ in range(WINDOWS):
        at = np.arange(N) * SAMPLE_S
        run = solve_ivp(motion, (0.0, W), z, "DOP853", t_eval=np.append(at, W), rtol=1e-8, atol=1e-10, args=(phase, omega, f))
        x = run.y[:2, :N]
        read = GAINS[:, None] * x / (1 - KAPPA * x**2)
        base = np.column_stack([np.cos(phase + omega * at), np.sin(phase + omega * at), np.ones(N)])
        (xc, yc), (xs, ys) = np.linalg.lstsq(base, read.T, rcond=None)[0][:2]
        z = run.y[:, N]
        phase = math.remainder(phase + omega * W, 2 * math.pi)
        e, q = xc * xc + xs * xs + yc * yc + ys * ys, 2 * (xc * ys - yc * xs)
        r, s, l = xc * xc + xs * xs - yc * yc - ys * ys, 2 * (xc * yc + xs * ys), 2 * (xc * xs + yc * ys)
        i_e, i_q = i_e + W * (e - 1), i_q + W * q
        v_as = 0.7 * wn_e * (e - 1 + i_e * wn_e / 1.4)
        v_qc = -0.7 * wn_q * (q + i_q * wn_q / 1.4)
        error = -0.5 * l / e
        detuning += wn_p**2 * W * error
        omega = OMEGA + 2 * wn_p * error + detuning
        d = 0.5 * math.atan2(s, r)
        if last is not None:
            turned += math.remainder(d - last, math.pi)
        last = d
        d += -K * RATE * W
        if math.cos(d) * xc + math.sin(d) * yc < 0:
            d += math.pi
        f = np.array([-v_qc * math.sin(d), v_as * math.cos(d), v_qc * math.cos(d), v_as * math.sin(d)])
    took = time.process_time() - begin
    rate = turned / ((WINDOWS - 1) * W)
    assert abs(e - 1) < 0.05 and abs(q) < 0.02, (e, q)
    assert abs(rate / (-K * RATE) - 1) < 0.02, (rate, -K * RATE)
    per_second = took / (WINDOWS * W)
    print(f"scipy: {WINDOWS} control steps in {took:.2f} s, {per_second:.1f} s per simulated second; E = {e:.4f}")

    manifest = str(HERE / "carrier/Cargo.toml")
    text = subprocess.run(["cargo", "run", "-q", "--release", "--locked", "--manifest-path", manifest], check=True,
                          capture_output=True, text=True).stdout
    print(text, end="")
    rust_ns = float(re.search(r"Rust ([0-9.]+) ns a sample at their fastest", text)[1])
    ratio = per_second / (rust_ns * 1e-9 / SAMPLE_S)
    print(f"Rust is {ratio:,.0f} times as fast as scipy")
    if "--gate" in sys.argv:
        assert ratio >= 3000


if __name__ == "__main__":
    main()
