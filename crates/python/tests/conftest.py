"""What the tests share: the command, and recordings of a simulated device."""

from __future__ import annotations

import os
import pathlib
import subprocess

import pytest

import cvg

SCENARIO = """
device = "unit-07"
carrier_hz = 15200.0
tau_s = 22.0
angular_gain = 0.78
angular_gain_stated = 0.8
amplitude_v = 1.0
noise_v = 2e-5
control_hz = 2000.0
sample_hz = 100.0
seed = 7

effects = [
  { id = "anisodamping", anisodamping = 4.7e-3, theta_tau = 27.0 },
  { id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 },
]

[[run]]
kind = "rotation"
file = "rot+500.csv"
rate_dps = 500.0
duration_s = 10.0
settle_s = 1.0

[[run]]
kind = "rotation"
file = "rot-300.csv"
rate_dps = -300.0
duration_s = 10.0
settle_s = 1.0

[[run]]
kind = "ringdown"
file = "ring.csv"
angle_deg = 20.0
energy_off_s = 1.0
duration_s = 5.0
"""


def command() -> str:
    said = os.environ.get("CVG_COMMAND")
    if said is None:
        pytest.skip("CVG_COMMAND does not say where the command `cvg` is")
    return said


@pytest.fixture(scope="session")
def cli():
    """The command, with its standard output; `cli.said` has all that it said."""

    def said(*arguments: object, stdin: bytes | None = None, status: int = 0) -> subprocess.CompletedProcess[bytes]:
        done = subprocess.run([command(), *map(str, arguments)], input=stdin, capture_output=True, check=False)
        assert done.returncode == status, done.stderr.decode()
        return done

    def run(*arguments: object, stdin: bytes | None = None, status: int = 0) -> str:
        return said(*arguments, stdin=stdin, status=status).stdout.decode()

    run.said = said
    return run


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """A campaign on disk: two rotations and a ring-down."""
    path = tmp_path_factory.mktemp("campaign")
    cvg.simulate(SCENARIO).write(path)
    return path
