"""Thousands of devices through Dask with two worker processes, of which one is killed in the middle, against `cvg fleet`.

    python benches/fleet/killed_worker.py target/release/cvg --devices 2000 --seconds 70 --out target/killed

The module `cvg` and `dask[distributed]` have to be installed, and built from the sources that the command is built from. The devices
are those of `dask_workers.py`. Each has to be answered, with the bytes of the report that the command gives. Said is also what a device
costs of the processor's time, in the worker that lived on and in the command, and how long all took: beside other programs
the second wanders. The folder is kept: devices that are there are not simulated again, and the command goes on where it was.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

from dask.distributed import Client, LocalCluster, as_completed

import cvg
from cvg import fleet
from dask_workers import SCENARIO, timed


def simulated(folder: pathlib.Path, number: int, seconds: float, rate: float) -> str:
    own = folder / f"unit-{number:04}"
    if not (own / "campaign.toml").exists():
        cvg.simulate(SCENARIO.format(number=number, seconds=seconds, rate=rate)).write(own)
    return str(own / "campaign.toml")


def through_dask(files: list[str]) -> list[tuple[float, str]]:
    """Seconds of the processor and the report of each device, where a worker is killed when half of them are answered."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, env={"RAYON_NUM_THREADS": "1"}) as cluster,
        Client(cluster) as client,
    ):
        workers = client.run(os.getpid)
        futures = client.map(timed, files, pure=False)
        answered: dict[str, tuple[float, str]] = {}
        for future, row in as_completed(futures, with_results=True):
            answered[future.key] = row
            if len(answered) == len(files) // 2:
                os.kill(next(iter(workers.values())), signal.SIGKILL)
        if set(client.run(os.getpid).values()) == set(workers.values()):
            sys.exit("no worker was killed")
        return [answered[future.key] for future in futures]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("cvg")
    parser.add_argument("--devices", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=70.0)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    said = parser.parse_args()
    devices = said.out / "devices"
    with ThreadPoolExecutor(2) as pool:
        files = list(pool.map(lambda number: simulated(devices, number, said.seconds, said.rate), range(said.devices)))
    began = time.perf_counter()
    rows = through_dask(files)
    took = time.perf_counter() - began
    of_worker = sum(seconds for seconds, _ in rows) / len(rows)
    print(f"Dask: {len(rows)} devices answered in {took:.0f} s, {1e3 * of_worker:.0f} ms of the processor a device", flush=True)

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([said.cvg, "fleet", devices, "--out", said.out / "answers"], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    own = (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / len(rows)
    print(f"cvg fleet: {1e3 * own:.0f} ms of the processor a device, the population's report with it")
    other = [
        pathlib.Path(file).parent.name
        for file, (_, report) in zip(files, rows)
        if report != (said.out / "answers" / pathlib.Path(file).parent.name / "report.json").read_text(encoding="utf-8")
    ]
    if other:
        sys.exit(f"{len(other)} devices have other bytes than the command gives: {', '.join(other[:10])}")
    print(f"all {len(rows)} reports are those of the command, byte for byte")


if __name__ == "__main__":
    main()
