"""What a second worker process is worth: simulated devices through Dask with one and with two.

    python benches/fleet/dask_workers.py --devices 200 --seconds 4 --turns 3

The module `cvg` and `dask[distributed]` have to be installed. Each turn measures one worker and two, in alternation, so that
what else the machine does falls on both; said is the median of the turns' ratios and the processor's time a device.
"""

from __future__ import annotations

import argparse
import statistics
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


def measured(workers: int, files: list[str]) -> tuple[float, float, list[str]]:
    """Seconds for all, processor's seconds a device, and the reports."""
    with (
        LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address=None, env={"RAYON_NUM_THREADS": "1"}
        ) as cluster,
        Client(cluster) as client,
    ):
        # what is done once is not what is measured
        client.run(timed, files[0])
        began = time.perf_counter()
        rows = client.gather(client.map(timed, files, pure=False))
        return time.perf_counter() - began, statistics.fmean(row[0] for row in rows), [row[1] for row in rows]


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
        ratios = []
        for _ in range(said.turns):
            one, of_one, first = measured(1, files)
            two, of_two, second = measured(2, files)
            if first != second:
                sys.exit("two workers give other bytes than one")
            ratios.append(one / two)
            print(f"one {one:.1f} s ({1e3 * of_one:.1f} ms of the processor a device), two {two:.1f} s ({1e3 * of_two:.1f} ms)")
        ratio = statistics.median(ratios)
        rows = 2 * int(said.seconds * said.rate)
        print(f"{said.devices} devices of {rows} rows: two workers answer {ratio:.2f} times as many as one, {ratio / 2:.2f} of twice")


if __name__ == "__main__":
    main()
