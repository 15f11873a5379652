"""Time to read a large recording, here and with pandas.

    python benches/reading.py [--rows 3600000] [--rounds 5] [--file FILE]

Wants Python with numpy and pandas, and cargo. Writes a recording of 9 columns (an hour at 1 kHz by default, some 300 MB)
to a temporary folder unless it is there, builds the example `read_recording`, and times `pandas.read_csv` and the example
in turn, each in a process of its own, both on the file as the system has it cached. Times are of the reading alone, as
each side says; peak memory is of the whole process. Proves nothing about what is read: the tests do that.
"""

import argparse
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COLUMNS = "t_s,rate_dps,xc_v,xs_v,yc_v,ys_v,vas_v,vqc_v,temp_c"
READ_WITH_PANDAS = """
import sys, time
import pandas
start = time.perf_counter()
frame = pandas.read_csv(sys.argv[1])
print(f"{time.perf_counter() - start:.4f} s for {len(frame)} rows of {len(frame.columns)} columns")
"""


def write_recording(path, rows):
    """A turn at 500 deg/s with noise, written as a logger writes it: a fixed number of places in each column."""
    import numpy as np

    noise = np.random.default_rng(1)
    with open(path, "w", encoding="ascii") as file:
        file.write(COLUMNS + "\n")
        for start in range(0, rows, 100_000):
            t_s = np.arange(start, min(start + 100_000, rows)) * 1e-3
            theta = np.deg2rad(t_s * 390.0)
            small = lambda size: noise.normal(0.0, size, len(t_s))
            columns = [
                np.char.mod("%.4f", t_s),
                np.full(len(t_s), "500"),
                np.char.mod("%.7f", np.cos(theta)),
                np.char.mod("%.7f", small(1e-3)),
                np.char.mod("%.7f", np.sin(theta)),
                np.char.mod("%.7f", small(1e-3)),
                np.char.mod("%.6g", -0.05 + 0.01 * np.cos(theta) + small(1e-4)),
                np.char.mod("%.6g", small(1e-2)),
                np.char.mod("%.4f", 25.0 + small(1e-2)),
            ]
            file.write("\n".join(map(",".join, zip(*columns))) + "\n")


def run(command):
    """Seconds as the process says them, and its peak memory in MiB."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    with process.stdout:
        said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    found = re.match(r"([0-9.]+) s for ([0-9]+) rows", said)
    if status != 0 or not found:
        sys.exit(f"{command[0]} failed: {said!r}")
    return float(found[1]), usage.ru_maxrss / 1024, int(found[2])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=3_600_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--file", type=Path, help="a recording to read instead of one that is made")
    options = parser.parse_args()

    path = options.file or Path(tempfile.gettempdir()) / f"cvg-reading-{options.rows}.csv"
    if not path.exists():
        unfinished = path.with_suffix(".part")
        write_recording(unfinished, options.rows)
        unfinished.rename(path)
    build = ["cargo", "build", "--release", "--quiet", "-p", "cvg-recording", "--example", "read_recording"]
    subprocess.run(build, cwd=ROOT, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    commands = {
        "pandas": [sys.executable, "-c", READ_WITH_PANDAS, str(path)],
        "cvg": [str(target / "release" / "examples" / "read_recording"), str(path)],
    }
    print(f"{path}: {path.stat().st_size / 1e6:.0f} MB, {os.cpu_count()} cores")
    results = {name: [] for name in commands}
    for turn in range(options.rounds + 1):
        for name, command in commands.items():
            result = run(command)
            if turn > 0:  # the first turn fills the cache
                results[name].append(result)
    rows = {result[2] for runs in results.values() for result in runs}
    if len(rows) != 1:
        sys.exit(f"the readers do not agree on the number of rows: {sorted(rows)}")
    for name, runs in results.items():
        seconds = [result[0] for result in runs]
        memory = max(result[1] for result in runs)
        print(f"{name:7} median {statistics.median(seconds):.3f} s, least {min(seconds):.3f} s, peak {memory:.0f} MiB")
    ratio = statistics.median(r[0] for r in results["cvg"]) / statistics.median(r[0] for r in results["pandas"])
    print(f"ratio   {ratio:.2f} of the time of pandas")


if __name__ == "__main__":
    main()
