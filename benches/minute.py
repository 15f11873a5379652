#!/usr/bin/env python3
"""Time and memory to identify a minute at the carrier: 12 million rows, 60 s at 200 kS/s.

    python benches/minute.py [--rounds 3]

Builds `cvg`, simulates a decay and a rotation of 60 s into the system's temporary folder unless they are there, as Parquet, as raw
little-endian numbers and, by h5py from these, as HDF5, and runs `cvg identify` on each in a process of its own, on the file as the
system has it cached. It fails where one takes half of the recording's duration, more than 1 GiB, or does not find the instrument.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
DURATION_S, SAMPLE_HZ = 60.0, 200_000.0
ENOUGH_SHARE, ENOUGH_GIB = 0.5, 1.0
DEVICE = """device = "minute"
angular_gain = 0.78
carrier_hz = 15213.7
noise_v = {noise}
effects = [
  {{ id = "anisodamping", anisodamping = 4.7e-3, theta_tau = 23.0 }},
  {{ id = "anisoelasticity", anisoelasticity = 0.25, theta_omega = -40.0 }},
]

[[run]]
{run}
file = "run.{kind}"
duration_s = {duration}
carrier_sample_hz = {sample}
"""
RUNS = {
    "decay": ('kind = "decay"\nstart_deg = 10.0\nrate_dps = 10.0', 1e-3),
    "rotation": ('kind = "rotation"\nrate_dps = 500.0', 1e-4),
}


def campaign(cvg, name, kind):
    """The folder of a campaign, simulated unless it is there."""
    folder = Path(tempfile.gettempdir()) / f"cvg-minute-{name}-{kind}"
    if not (folder / "campaign.toml").exists():
        run, noise = RUNS[name]
        scenario = folder.with_suffix(".toml")
        scenario.write_text(DEVICE.format(run=run, noise=noise, kind=kind, duration=DURATION_S, sample=SAMPLE_HZ))
        subprocess.run([cvg, "simulate", str(scenario), "--out", str(folder)], check=True, stderr=subprocess.DEVNULL)
    return folder


def as_hdf5(cvg, name):
    """The same recording as the raw one, with its times, as HDF5."""
    raw, folder = campaign(cvg, name, "f32"), Path(tempfile.gettempdir()) / f"cvg-minute-{name}-h5"
    if not (folder / "campaign.toml").exists():
        folder.mkdir(exist_ok=True)
        text, _, raw_text = (raw / "campaign.toml").read_text().partition("[run.raw]")
        names = json.loads(re.search(r"columns = (\[.*\])", raw_text)[1])
        columns = np.fromfile(raw / "run.f32", dtype="<f4").reshape(-1, len(names))
        with h5py.File(folder / "run.h5", "w") as file:
            file.create_dataset("t_s", data=np.arange(len(columns)) / SAMPLE_HZ)
            for channel, column in zip(names, columns.T):
                file.create_dataset(channel, data=column)
        (folder / "campaign.toml").write_text(text.replace("run.f32", "run.h5"))
    return folder


def run(command):
    """What a process says, its wall time in s and its peak memory in GiB."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    with process.stdout:
        said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if status != 0:
        sys.exit(f"{command} failed: {said!r}")
    return json.loads(said), wall, usage.ru_maxrss / 2**20


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "--quiet", "-p", "cvg"], cwd=ROOT, check=True)
    cvg = str(Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "cvg")
    failed = False
    for name in RUNS:
        for kind in ["parquet", "f32", "h5"]:
            folder = as_hdf5(cvg, name) if kind == "h5" else campaign(cvg, name, kind)
            rounds = [run([cvg, "identify", str(folder / "campaign.toml"), "--json"]) for _ in range(options.rounds)]
            gain = rounds[0][0]["angular_gain"]
            share = statistics.median(wall for _, wall, _ in rounds) / DURATION_S
            memory = max(memory for _, _, memory in rounds)
            numbers = (folder / f"run.{kind}").stat().st_size
            print(f"{name:8} {kind:7} {numbers / 1e6:5.0f} MB: {share:.3f} of its duration, {memory:.2f} GiB, k = {gain['value']:.6f}")
            found = abs(gain["value"] - 0.78) < 1e-3
            failed |= share > ENOUGH_SHARE or memory > ENOUGH_GIB or not found
    sys.exit("it takes too long, too much, or does not find the instrument" if failed else 0)


if __name__ == "__main__":
    main()
