"""
Load any file
=============

Whatever file a calibration or a training wrote, `load_estimator` makes the estimator that reads
it.
"""

import tempfile
from pathlib import Path

import smoskin as smo
from smoskin.plots import draw_skin, draw_touches

design = smo.load_design("planar")
rig = smo.VirtualRig(design, seed=4)
path = Path(tempfile.mkdtemp()) / "skin.table"
smo.calibrate(smo.load_response_table("planar"), rig, count=10).save(path)
estimator = smo.load_estimator(path, design)
held = rig.press(smo.Contact(position=(0.08, 0.12), force=(0.0, 0.0, -0.6)))
start, end = held.rest
estimator.zero([reading for reading in held.readings if start <= reading.time <= end])
estimate = [estimator.step(reading) for reading in held.readings][-1]
print(type(estimator).__name__, 1e3 * estimate.contacts[0].position, "mm")
assert abs(estimate.contacts[0].position - (0.08, 0.12)).max() < 2e-3
draw_touches(draw_skin(design), estimate)
