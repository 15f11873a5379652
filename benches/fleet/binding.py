"""What the module takes beside the identification, from a frame of pandas to its report.

    python benches/fleet/binding.py --rounds 15

The module `cvg` and pandas have to be installed. Two recordings of one device, 14,000 rows together; what is not between the words
"identifying" and "reporting" is taken for the binding: columns out of the frame, their admission, and the report as text and numbers.
"""

from __future__ import annotations

import argparse
import statistics
import time

import pandas

import cvg
from dask_workers import SCENARIO


def measured(frames: list[pandas.DataFrame]) -> tuple[float, float]:
    """Seconds of the identification, and of everything else."""
    said: dict[str, float] = {}
    began = time.perf_counter()
    report = cvg.identify(frames, settle=0.5, progress=lambda what: said.setdefault(what, time.perf_counter()))
    report.to_json()
    ended = time.perf_counter()
    identification = said["reporting"] - said["identifying"]
    return identification, ended - began - identification


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=15)
    rounds = parser.parse_args().rounds
    simulated = cvg.simulate(SCENARIO.format(number=1, seconds=70.0, rate=100.0))
    frames = [pandas.DataFrame(table.to_dict()) for _, table in simulated.recordings]
    measured(frames)
    turns = [measured(frames) for _ in range(rounds)]
    identification, beside = (statistics.median(column) for column in zip(*turns))
    shares = sorted(other / own for own, other in turns)
    print(
        f"{sum(map(len, frames))} rows, {rounds} rounds: identification {1e3 * identification:.0f} ms, beside it {1e3 * beside:.1f} ms:"
        f" {statistics.median(shares):.2%} ({shares[0]:.2%} to {shares[-1]:.2%})"
    )


if __name__ == "__main__":
    main()
