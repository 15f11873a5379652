"""The page "Python" as a script: python notebook.py"""

# %% A campaign to work on: the device of tests, simulated. Your own data is a path, a frame or arrays.
import pathlib
import tempfile

import numpy as np
import pandas as pd

import cvg

SCENARIO = """
device = "unit-07"
angular_gain = 0.78
tau_s = 22.0
noise_v = 2e-5
seed = 7
effects = [
  { id = "anisodamping", anisodamping = 4.7e-3, theta_tau = 27.0 },
  { id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 },
]
run = [
  { kind = "rotation", file = "rot+500.csv", rate_dps = 500.0, duration_s = 10.0, settle_s = 1.0 },
  { kind = "rotation", file = "rot-300.csv", rate_dps = -300.0, duration_s = 10.0, settle_s = 1.0 },
]
"""
folder = pathlib.Path(tempfile.mkdtemp())
cvg.simulate(SCENARIO).write(folder)

# %% What is in a file, and what is wrong with it
facts = cvg.inspect(folder / "rot+500.csv")[0]
print(facts["rows"], "rows,", facts["interval_s"], "s apart,", facts["warnings"] or "nothing is wrong")

# %% From files, as the command does
report = cvg.identify(folder / "campaign.toml")
print(report)

# %% From a frame: columns by their names, or by a mapping as in `--map`
frame = pd.read_csv(folder / "rot+500.csv").rename(columns={"t_s": "Time"})
frame["Time"] *= 1000.0
single = cvg.identify(frame, map={"t_s": "Time*0.001"}, settle=1.0, name="rot+500")
print(single.status, single.detection_gain_ratio["value"])

# %% Runs that differ in kind, each with the words of a campaign file
forth, back = (pd.read_csv(folder / name) for name in ("rot+500.csv", "rot-300.csv"))
runs = [cvg.Run(forth, "forth", settle_s=1.0), cvg.Run(back, "back", settle_s=1.0)]
both = cvg.identify(runs, campaign={"device": "unit-07"})

# %% The facts of report.json are attributes; in a notebook `report` alone shows the page
print(report.heldout["raw"]["rms_deg"], "->", report.heldout["discovered"]["rms_deg"], "deg")
print(report.to_frame()[["name", "value", "low", "high"]])

# %% What is left, over time: Arrow for pyarrow and polars, arrays for numpy
left = report.residuals().to_dict()
print("left:", np.sqrt(np.mean(left["error_deg"] ** 2)), "deg rms")

# %% The calibration, and a recording with the errors taken out
calibration = report.calibration
assert calibration is not None
calibration.save(folder / "calibration.toml")
clean = cvg.Calibration.read(folder / "calibration.toml").compensate(forth)
print(clean.head())

# %% An error says where
try:
    cvg.identify({"t_s": [0.0, 0.1, 0.05], "rate_dps": [9.0, 9.0, 9.0], "theta_deg": [0.0, 1.0, 2.0]}, name="bench")
except cvg.InputError as error:
    print(error.file, error.row, error)

# %% The electronics as firmware runs them, over arrays of samples
electronics = cvg.Instrument(carrier_hz=15200.0, sample_hz=100_000.0)
t_s = np.arange(10_000) / 100_000.0
dac_x, dac_y, angle_deg = electronics.step(0.1 * np.cos(2.0 * np.pi * 15200.0 * t_s), np.zeros_like(t_s))
print(electronics.mode, electronics.fault)
