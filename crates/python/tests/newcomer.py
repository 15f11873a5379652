"""What a newcomer does behind `pip install ./crates/python pandas`: a frame in, a report and a compensated frame out."""

import pandas

import cvg

SCENARIO = """
device = "first"
angular_gain = 0.78
noise_v = 2e-5
tau_s = 10.0
seed = 1
effects = [ { id = "detection-gain-mismatch", detection_gain_ratio = 1.0132 } ]
run = [ { kind = "rotation", file = "rot.csv", rate_dps = 500.0, duration_s = 10.0, settle_s = 0.5 } ]
"""

[(_, table)] = cvg.simulate(SCENARIO).recordings
frame = pandas.DataFrame(table.to_dict())
report = cvg.identify(frame, settle=0.5)
print(report)
clean = report.calibration.compensate(frame)
assert report.status == "answered" and abs(report.detection_gain_ratio["value"] - 1.0132) < 5e-3
assert report.heldout["declared"]["rms_deg"] < 0.1 * report.heldout["raw"]["rms_deg"]
assert len(clean) == len(frame) and "theta_deg" in clean
