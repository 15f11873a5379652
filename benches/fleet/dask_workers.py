"""What a second worker process is worth: simulated devices through Dask with one and with two, and through plain processes.

    python benches/fleet/dask_workers.py --devices 200 --seconds 4 --turns 3

The module `cvg` and `dask[distributed]` have to be installed. Each turn measures one process and two, plain and as workers, in
alternation, so that what else the machine does falls on all. Plain processes share nothing and wait for nothing: what two of them
answer in the time of one is what the machine can do, and what Dask takes off is seen against it. Said are the medians of the turns'
ratios and their spread. Where other programs have the processors as well, these wander; the processor's time a device does not: what a
worker takes when it is alone and when it is not, and what client and scheduler take beside. Two processors that do nothing else
answer at most so many times as many as one.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time

from dask.distributed import Client, LocalCluster

import cvg
from cvg import fleet

SCENARIO = """
device = "unit-{number:04}"
angular_gain = 0.78
noise_v = 2e-5
tau_s = 10.0
seed = {number}
sample_hz = {rate}
effects = [ {{ id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 }} ]
run = [
  {{ kind = "rotation", file = "forth.csv", rate_dps = 500.0, duration_s = {seconds}, settle_s = 0.5 }},
  {{ kind = "rotation", file = "back.csv", rate_dps = -300.0, duration_s = {seconds}, settle_s = 0.5 }},
]
"""


def timed(file: str) -> tuple[float, str]:
    began = time.process_time()
    row = fleet.identify_device(file)
    return time.process_time() - began, row["report"][0].as_py()


#: a process that is ready, is told to begin, and answers the devices that it was given
PLAIN = """
import sys
from cvg import fleet
files = sys.argv[1:]
fleet.identify_device(files[0])
print("ready", flush=True)
sys.stdin.readline()
for file in files:
    fleet.identify_device(file)["report"][0].as_py()
"""


def plain(processes: int, files: list[str]) -> float:
    """Seconds for all by processes that know nothing of each other."""
    said = {**os.environ, "RAYON_NUM_THREADS": "1"}
    begun = [
        subprocess.Popen(
            [sys.executable, "-c", PLAIN, *files[at::processes]], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=said
        )
        for at in range(processes)
    ]
    for process in begun:
        process.stdout.readline()
    began = time.perf_counter()
    for process in begun:
        process.stdin.close()
    if any(process.wait() for process in begun):
        sys.exit("a plain process failed")
    return time.perf_counter() - began


def measured(workers: int, files: list[str]) -> tuple[float, float, float, list[str]]:
    """Seconds for all, processor's seconds a device of the workers and of this process, and the reports."""
    with (
        LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address=None, env={"RAYON_NUM_THREADS": "1"}
        ) as cluster,
        Client(cluster) as client,
    ):
        # what is done once is not what is measured
        client.run(timed, files[0])
        began, own = time.perf_counter(), time.process_time()
        rows = client.gather(client.map(timed, files, pure=False))
        spent, beside = time.perf_counter() - began, (time.process_time() - own) / len(files)
        return spent, statistics.fmean(row[0] for row in rows), beside, [row[1] for row in rows]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--devices", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--turns", type=int, default=3)
    said = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for number in range(said.devices):
            scenario = SCENARIO.format(number=number, seconds=said.seconds, rate=said.rate)
            cvg.simulate(scenario).write(f"{folder}/{number}")
            files.append(f"{folder}/{number}/campaign.toml")
        ratios, plain_ratios, limits = [], [], []
        for _ in range(said.turns):
            one, of_one, _, first = measured(1, files)
            two, of_two, beside, second = measured(2, files)
            if first != second:
                sys.exit("two workers give other bytes than one")
            alone, together = plain(1, files), plain(2, files)
            ratios.append(one / two)
            plain_ratios.append(alone / together)
            limits.append(2 * of_one / (of_two + beside))
            print(
                f"Dask: one {one:.1f} s ({1e3 * of_one:.1f} ms of the processor a device), two {two:.1f} s"
                f" ({1e3 * of_two:.1f} ms, {1e3 * beside:.1f} ms beside); plain: one {alone:.1f} s, two {together:.1f} s",
                flush=True,
            )
        rows = 2 * int(said.seconds * said.rate)
        print(f"{said.devices} devices of {rows} rows, medians of {said.turns} turns:")
        for name, values in (
            ("two workers of Dask", ratios),
            ("two plain processes", plain_ratios),
            ("by the processor's time two workers", limits),
        ):
            middle = statistics.median(values)
            print(f"{name} answer {middle:.2f} times as many as one ({min(values):.2f} to {max(values):.2f}), {middle / 2:.2f} of twice")


if __name__ == "__main__":
    main()
