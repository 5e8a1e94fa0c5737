"""
Run a source
============

A source gives readings, the loop hands each to the estimator; here the twin at its own pace.
"""

import itertools

import smoskin as smo
from smoskin.plots import draw_readings

design = smo.load_design("planar")
estimator = smo.ClosedFormEstimator(design)
readings = []
with smo.open_source("twin://planar?rate=100&speed=max") as source:
    readings = list(itertools.islice(source, 100))
estimates = [estimator.step(reading) for reading in readings]
print(f"{len(estimates)} estimates, the last: {estimates[-1].status.value}")
assert {estimate.status for estimate in estimates} == {smo.Status.NO_CONTACT}
draw_readings(readings)
