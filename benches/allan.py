"""The Allan deviation of `cvg identify` beside that of allantools on the same samples.

    python3 -m venv /tmp/allan && /tmp/allan/bin/pip install allantools
    cargo build --release && /tmp/allan/bin/python benches/allan.py target/release/cvg

Prints the largest relative difference over all averaging times; exits with 1 where it exceeds 1e-9.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import allantools
import numpy

ROWS, INTERVAL_S = 20_000, 0.05


def angle(seed: int) -> numpy.ndarray:
    """Angle of a gyroscope at rest, deg: white noise, a random walk, and a rate that wanders."""
    draw = numpy.random.default_rng(seed)
    rate = 1e-4 * draw.standard_normal(ROWS).cumsum()
    return 90.0 + 1e-3 * draw.standard_normal(ROWS) + (1e-3 * draw.standard_normal(ROWS) + rate * INTERVAL_S).cumsum()


def reported(program: str, theta: numpy.ndarray) -> list[dict]:
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder)
        rows = (f"{i * INTERVAL_S!r},{float(value)!r}" for i, value in enumerate(theta))
        path.joinpath("rest.csv").write_text("t_s,theta_deg\n" + "\n".join(rows) + "\n")
        path.joinpath("campaign.toml").write_text(
            '[campaign]\ndevice = "still"\n\n[[run]]\nkind = "static"\nfile = "rest.csv"\n'
        )
        arguments = [program, "identify", path / "campaign.toml", "--json"]
        return json.loads(subprocess.run(arguments, check=True, capture_output=True).stdout)["allan"]["points"]


def main() -> int:
    worst = 0.0
    for seed in range(3):
        theta = angle(seed)
        points = reported(sys.argv[1], theta)
        taus = [p["tau_s"] for p in points]
        there, deviation, _, _ = allantools.oadev(theta, rate=1 / INTERVAL_S, data_type="phase", taus=taus)
        assert numpy.allclose(there, taus, rtol=1e-12), "the averaging times are the same"
        ours = numpy.array([p["deviation_dph"] for p in points]) / 3600.0
        worst = max(worst, float(numpy.max(numpy.abs(ours / deviation - 1.0))))
        print(f"seed {seed}: {len(points)} averaging times, largest relative difference so far {worst:.1e}")
    return int(worst > 1e-9)


sys.exit(main())
