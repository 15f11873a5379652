#!/usr/bin/env python3
"""Time and memory to identify a long recording, beside the time in which pandas merely reads it.

    pip install numpy pandas
    python benches/files.py [--rows 900000 1800000 3600000] [--rounds 5]

Writes recordings of 9 columns at 1 kHz (an hour is 3.6 million rows, some 300 MB) to the system's temporary folder unless
they are there, builds `cvg`, and runs `cvg identify FILE --json` and `pandas.read_csv(FILE)` in turn, each in a process of
its own, on the file as the system has it cached. Wall and processor time and peak memory are of the whole process; for pandas
the wall time of `read_csv` alone is printed too, and it is this that cvg's whole process is compared with.

The instrument behind the recording turns at 500 deg/s with k = 0.78 and detection gains of 1.0132: the loop holds the energy
that it measures, so that the true one moves and the energy command works, recorded as it was given; misaligned by the
readout, it turns the pattern. cvg must find k and the gain ratio and leave no more than the noise, or nothing is printed.
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COLUMNS = "t_s,rate_dps,xc_v,xs_v,yc_v,ys_v,vas_v,vqc_v,temp_c"
RATE_HZ = 1000
GAIN, RATIO, TAU_S, RATE_DPS, NOISE_V = 0.78, 1.0132, 22.0, 500.0, 2e-5
TURN_RAD_S = math.radians(RATE_DPS)
READ_WITH_PANDAS = """
import json, sys, time
import pandas
start = time.perf_counter()
frame = pandas.read_csv(sys.argv[1])
print(json.dumps({"seconds": time.perf_counter() - start, "rows": len(frame)}))
"""


def readout_error(theta):
    """tan of the readout's angle error (Equation 7), and d(ln a)/d(theta) at a held measured energy (Equation 6)."""
    import numpy as np

    sin, cos = np.sin(2 * theta), np.cos(2 * theta)
    tangent = (RATIO - 1) * sin / ((RATIO + 1) - (RATIO - 1) * cos)
    return tangent, -0.5 * (RATIO**2 - 1) * sin / (np.cos(theta) ** 2 + (RATIO * np.sin(theta)) ** 2)


def theta_rate(theta):
    """d(theta)/dt = -k Omega + (1/tau + a'/a) tan(theta_error): the energy command is applied at the measured angle."""
    tangent, growth = readout_error(theta)
    return (-GAIN * TURN_RAD_S + tangent / TAU_S) / (1 - growth * tangent)


def pattern_angle(t_s):
    """theta(t): its inverse t(theta), which is a line and a periodic function, is integrated as a Fourier series."""
    import numpy as np

    grid = np.arange(64) * np.pi / 64
    series = np.fft.rfft(1 / theta_rate(grid)) / 64
    slope = series[0].real
    theta = t_s / slope
    for _ in range(3):
        wave = sum((series[n] / (2j * n) * (np.exp(2j * n * theta) - 1)).real * 2 for n in (1, 2, 3))
        theta = (t_s - wave) / slope
    return theta


def write_recording(path, rows):
    """The recording, written as a logger writes it: a fixed number of places in each column."""
    import numpy as np

    noise = np.random.default_rng(1)
    with open(path, "w", encoding="ascii") as file:
        file.write(COLUMNS + "\n")
        for start in range(0, rows, 100_000):
            t_s = np.arange(start, min(start + 100_000, rows)) / RATE_HZ
            small = lambda size: noise.normal(0.0, size, len(t_s))
            theta = pattern_angle(t_s)
            x, y = np.cos(theta), RATIO * np.sin(theta)
            a = 1 / np.hypot(x, y)
            tangent, growth = readout_error(theta)
            v_as = -a * (1 / TAU_S + growth * theta_rate(theta)) * np.hypot(1, tangent)
            columns = [
                np.char.mod("%.4f", t_s),
                np.full(len(t_s), f"{RATE_DPS:g}"),
                np.char.mod("%.7f", a * x + small(NOISE_V)),
                np.char.mod("%.7f", small(NOISE_V)),
                np.char.mod("%.7f", a * y + small(NOISE_V)),
                np.char.mod("%.7f", small(NOISE_V)),
                np.char.mod("%.6g", v_as),
                np.char.mod("%.6g", small(1e-4)),
                np.char.mod("%.4f", 25.0 + small(1e-2)),
            ]
            file.write("\n".join(map(",".join, zip(*columns))) + "\n")


def run(command):
    """What a process says, its wall and processor time in s, its peak memory in MiB."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    with process.stdout:
        said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if status != 0:
        sys.exit(f"{command[0]} failed: {said!r}")
    return json.loads(said), wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def checked(report):
    off = (report["detection_gain_ratio"]["value"] - RATIO, report["angular_gain"]["value"] - GAIN)
    rest = report["heldout"]["discovered"]["rms_deg"] / report["heldout"]["noise_floor_deg"]
    if max(map(abs, off)) > 5e-5 or rest > 2:
        sys.exit(f"cvg did not find the instrument: off by {off}, and {rest:.1f} times the noise is left")


def compare(cvg, path, rounds):
    """Medians of cvg (wall, processor, memory) and pandas (the same, and its reading alone)."""
    ours, theirs = [], []
    for turn in range(rounds + 1):
        read, *pandas_used = run([sys.executable, "-c", READ_WITH_PANDAS, str(path)])
        report, *cvg_used = run([cvg, "identify", str(path), "--json"])
        checked(report)
        if turn:  # the first turn fills the cache
            ours.append(cvg_used)
            theirs.append([*pandas_used, read["seconds"]])
    medians = lambda all: [statistics.median(column) for column in zip(*all)]
    return medians(ours), medians(theirs)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, nargs="+", default=[900_000, 1_800_000, 3_600_000])
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "--quiet", "-p", "cvg"], cwd=ROOT, check=True)
    cvg = str(Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "cvg")
    print(f"{os.cpu_count()} cores; medians of {options.rounds} rounds; s and MiB\n")
    print("     rows     MB | cvg identify: wall  processor  peak | pandas: wall  processor  peak  reading alone |"
          " cvg/pandas reading: wall   of processor  of memory")
    walls = []
    for rows in options.rows:
        path = Path(tempfile.gettempdir()) / f"cvg-files-{rows}.csv"
        if not path.exists():
            unfinished = path.with_suffix(".part")
            write_recording(unfinished, rows)
            unfinished.rename(path)
        ours, theirs = compare(cvg, path, options.rounds)
        walls.append((rows, ours))
        print(f"{rows:9} {path.stat().st_size / 1e6:6.0f} | {ours[0]:18.3f} {ours[1]:10.3f} {ours[2]:5.0f} |"
              f" {theirs[0]:12.3f} {theirs[1]:10.3f} {theirs[2]:5.0f} {theirs[3]:14.3f} |"
              f" {ours[0] / theirs[3]:24.2f} {ours[1] / theirs[1]:14.2f} {ours[2] / theirs[2]:10.2f}", flush=True)
    print()
    for (rows, before), (more, after) in zip(walls, walls[1:]):
        print(f"{more / rows:.2f} times the rows: {after[0] / before[0]:.2f} times the wall time, "
              f"{after[1] / before[1]:.2f} times the processor time, {after[2] / before[2]:.2f} times the memory")


if __name__ == "__main__":
    main()
