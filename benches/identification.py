#!/usr/bin/env python3
"""Time to identify the paper's device: scipy beside cvg.

    pip install numpy scipy
    python benches/identification.py [--rounds 5] [--no-library]

Simulates the paper's campaign (crates/simulator/scenarios/paper.toml), and the same device without the cubic readout, into
the system's temporary folder, and fits both with numpy and `scipy.optimize.least_squares`. The residual is cvg's: detection
gains and cubic readout undone sample by sample; the pattern angle less -k times the input angle and less the integral of
what anisodamping, anisoelasticity and the recorded commands let it precess, Equation 9 at the measured angle included; one
bias per run. Ten unknowns, all at once, from neutral values and k = 0.8, with scipy's own differences for the Jacobian.

What helps scipy is given to it: all runs in one array, so that each operation of numpy is long; biases eliminated, so that
no column of the Jacobian is spent on them; the trapezium where cvg integrates to fourth order; the cubic effect named
beforehand; no robust weights, no priors, no spikes, no ring-downs. Reading is not in its time, nor starting Python. Both
its default method "trf" and MINPACK's "lm" are timed.

Of cvg, `process` is all of `cvg identify CAMPAIGN --json`: start, reading, ring-downs, three rounds of fits, the search for
undeclared effects, held-out errors, report. `library` is the declared model alone (three rounds of fits with ring-downs,
held-out errors, report), `fits` is that part of it which scipy is timed for: the fits, all rounds. Both are from `cargo bench
-p cvg-calibration --bench identify`; they name no cubic effect, so they stand beside scipy where there is none.

The two must agree on the detection gain ratio within 5e-5, or nothing is timed. Times are medians; both sides are divided
by the same number of residuals of the fit.
"""

import argparse
import csv
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

# the algebra is small: threads of it only wait for each other
for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(threads, "1")

import numpy as np
from scipy.optimize import least_squares

ROOT = Path(__file__).resolve().parent.parent
AGREEMENT = 5e-5
# k, g, kappa, anisodamping (c, s), anisoelasticity (c, s), force scale, G_Ax/G_Ay, control latency
NEUTRAL = np.array([0.8, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
FIXED_POINT_STEPS = 5


def build():
    """`cvg`, compiled for release."""
    subprocess.run(["cargo", "build", "--release", "--quiet", "-p", "cvg"], cwd=ROOT, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return str(target / "release" / "cvg")


def simulate(cvg, folder, cubic):
    """The paper's campaign, with or without the effect that it does not declare."""
    scenario = (ROOT / "crates/simulator/scenarios/paper.toml").read_text(encoding="utf-8")
    if not cubic:
        scenario = "\n".join(line for line in scenario.split("\n") if "detection-cubic" not in line)
    (folder / "scenario.toml").write_text(scenario, encoding="utf-8")
    command = [cvg, "simulate", str(folder / "scenario.toml"), "--out", str(folder)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return folder / "campaign.toml"


class Runs:
    """The runs to fit, one after the other in one array per column."""

    def __init__(self, campaign):
        manifest = tomllib.loads(campaign.read_text(encoding="utf-8"))
        self.rows = 0
        parts, self.first = [], []
        for run in manifest["run"]:
            with open(campaign.parent / run["file"], newline="", encoding="ascii") as file:
                lines = csv.reader(file)
                names = next(lines)
                table = dict(zip(names, np.array(list(lines), dtype=float).T))
            self.rows += len(table["t_s"])
            if run["kind"] != "rotation" or run["use"] != "fit":
                continue
            t = table["t_s"]
            rate = np.radians(table["rate_dps"])
            table["input"] = np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t))))
            table["rate"] = rate
            for v in ("vas", "vqc"):
                table[v + "_change"] = np.gradient(table[v + "_v"], t)
            settled = t >= t[0] + run["settle_s"]
            table = {name: column[settled] for name, column in table.items()}
            table["half_step"] = np.concatenate(([0.0], 0.5 * np.diff(table["t_s"])))
            table["weight"] = np.full(len(table["t_s"]), run["amplitude"])
            self.first.append(sum(len(p["t_s"]) for p in parts))
            parts.append(table)
        column = lambda name: np.concatenate([p[name] for p in parts])
        self.xc, self.xs, self.yc, self.ys = (column(n) for n in ("xc_v", "xs_v", "yc_v", "ys_v"))
        self.input, self.rate, self.half_step = column("input"), column("rate"), column("half_step")
        self.v = [column(n) for n in ("vas_v", "vqc_v", "vas_change", "vqc_change")]
        self.weight = column("weight")
        self.samples = len(self.input)
        self.lengths = np.diff(self.first + [self.samples])
        # the orientation at which the electronics apply their forces: from the readout, the same for all unknowns
        self.seen = direction(self.xc, self.xs, self.yc, self.ys)


def direction(xc, xs, yc, ys):
    """Equation 4, over the full turn: the in-phase vibration is positive along the major axis."""
    half = 0.5 * np.arctan2(2 * (xc * yc + xs * ys), xc * xc + xs * xs - yc * yc - ys * ys)
    return np.where(xc * np.cos(half) + yc * np.sin(half) < 0.0, half + np.pi, half)


def uncubed(kappa, c, s):
    """The vibration X behind the readout X(1 + 3/4 kappa |X|^2)."""
    size = 0.75 * kappa * (c * c + s * s)
    u = 1.0
    for _ in range(FIXED_POINT_STEPS):
        u = 1.0 / (1.0 + size * u * u)
    return c * u, s * u


def residual(p, runs):
    """Angle observed less predicted, rad, per unit of amplitude; one bias per run eliminated."""
    k, g, kappa, dc, ds, wc, ws, scale, ratio, latency = p
    xc, xs = uncubed(kappa, runs.xc, runs.xs)
    yc, ys = uncubed(kappa, runs.yc / g, runs.ys / g)
    # Equation 9 with what was commanded `latency` ago; F = f_c - i f_s moves X = x_c - i x_s at F/i
    v_as, v_qc = runs.v[0] - latency * runs.v[2], runs.v[1] - latency * runs.v[3]
    applied = runs.seen + latency * k * runs.rate
    sin, cos = np.sin(applied), np.cos(applied)
    gx, gy = scale * np.sqrt(ratio), scale / np.sqrt(ratio)
    # rates of the envelope: forces, anisodamping, anisoelasticity (multiplication by -i takes (c, s) to (-s, c))
    dxc = -gx * v_as * cos - 0.5 * (dc * xc + ds * yc) - 0.5 * (wc * xs + ws * ys)
    dxs = -gx * v_qc * sin - 0.5 * (dc * xs + ds * ys) + 0.5 * (wc * xc + ws * yc)
    dyc = -gy * v_as * sin - 0.5 * (ds * xc - dc * yc) - 0.5 * (ws * xs - wc * ys)
    dys = gy * v_qc * cos - 0.5 * (ds * xs - dc * ys) + 0.5 * (ws * xc - wc * yc)
    # theta' = (R S' - S R') / 2(R^2 + S^2)
    r = xc * xc + xs * xs - yc * yc - ys * ys
    s = 2 * (xc * yc + xs * ys)
    dr = 2 * (xc * dxc + xs * dxs - yc * dyc - ys * dys)
    ds_ = 2 * (dxc * yc + xc * dyc + dxs * ys + xs * dys)
    precession = 0.5 * (r * ds_ - s * dr) / (r * r + s * s)
    drift = np.empty_like(precession)
    drift[0] = 0.0
    np.cumsum(runs.half_step[1:] * (precession[1:] + precession[:-1]), out=drift[1:])
    # the angle less -k times the input angle turns little, and is made continuous without knowing the bias
    rest = np.arctan2(s, r) + 2 * k * runs.input
    off = 0.5 * np.unwrap(rest) - drift
    mean = np.add.reduceat(off, runs.first) / runs.lengths
    return runs.weight * (off - np.repeat(mean, runs.lengths))


def fit_with_scipy(runs, method):
    """Wall and processor time in s, and the fit."""
    start, processor = time.perf_counter(), time.process_time()
    result = least_squares(residual, NEUTRAL, args=(runs,), method=method, jac="2-point")
    return (time.perf_counter() - start, time.process_time() - processor), result


def run_cvg(cvg, campaign):
    """Wall and processor time of the process in s, and its report."""
    start = time.perf_counter()
    process = subprocess.Popen([cvg, "identify", str(campaign), "--json"], stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL, text=True)
    with process.stdout:
        said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit("cvg identify failed")
    return (time.perf_counter() - start, usage.ru_utime + usage.ru_stime), json.loads(said)


def library():
    """Seconds of the declared model alone through the library, whole and the fits in it, by criterion (medians)."""
    subprocess.run(["cargo", "bench", "-q", "-p", "cvg-calibration", "--bench", "identify", "--", "declared model|alone"],
                   cwd=ROOT, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    criterion = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "criterion" / "identify"
    times = {}
    for name, pattern in (("library", "*declared*"), ("fits", "*alone*")):
        estimates = next(criterion.glob(f"{pattern}/new/estimates.json"))
        times[name] = json.loads(estimates.read_text(encoding="utf-8"))["median"]["point_estimate"] * 1e-9
    return times


def compare(title, cvg, campaign, rounds, beside=None):
    """Prints times of scipy and cvg on one campaign, and their ratios."""
    runs = Runs(campaign)
    print(f"{title}: {runs.rows} rows, {runs.samples} residuals in the fit")
    times = {"trf": [], "lm": [], "process": []}
    for turn in range(rounds + 1):
        used, report = run_cvg(cvg, campaign)
        if turn:  # the first turn warms up, and checks
            times["process"].append(used)
        ours = report["detection_gain_ratio"]["value"]
        for method in ("trf", "lm"):
            used, fit = fit_with_scipy(runs, method)
            if turn:
                times[method].append(used)
                continue
            millidegrees = 1e3 * np.degrees(np.sqrt(np.mean(fit.fun**2)))
            print(f"  scipy {method:4} g = {fit.x[1]:.6f} (cvg {ours:.6f}), residual {millidegrees:.2f} mdeg rms, "
                  f"{fit.nfev} steps")
            if abs(fit.x[1] - ours) > AGREEMENT:
                sys.exit("scipy and cvg do not agree on the detection gain ratio")
    median = {name: [statistics.median(column) for column in zip(*values)] for name, values in times.items()}
    for name, seconds in (beside or {}).items():
        median[name] = [seconds, None]
    for name, (wall, processor) in median.items():
        who = f"scipy {name}" if name in ("trf", "lm") else f"cvg {name}"
        text = f"  {who:12} {1e6 * wall / runs.samples:8.2f} us per residual"
        text += "" if processor is None else f", processor {1e6 * processor / runs.samples:8.2f}"
        if name not in ("trf", "lm"):
            text += "   " + ", ".join(
                f"{median[m][0] / wall:.2f} times as fast as {m}"
                + ("" if processor is None else f" ({median[m][1] / processor:.2f} by processor time)")
                for m in ("trf", "lm"))
        print(text)
    print(f"  cvg's whole process: {median['process'][0]:.3f} s, processor {median['process'][1]:.3f} s")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--no-library", action="store_true", help="only the process, without the bench of the library")
    options = parser.parse_args()
    cvg = build()
    beside = None if options.no_library else library()
    for title, cubic in (("the paper's campaign", True), ("without the cubic readout", False)):
        with tempfile.TemporaryDirectory(prefix="cvg-identification-") as folder:
            campaign = simulate(cvg, Path(folder), cubic)
            compare(title, cvg, campaign, options.rounds, None if cubic else beside)


if __name__ == "__main__":
    main()
