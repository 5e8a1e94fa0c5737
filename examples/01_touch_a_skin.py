"""
Touch a skin
============

A virtual skin that was made with a workshop's scatter, read after fifteen touches that calibrated
it.
"""

import numpy as np

import smoskin as smo
from smoskin.plots import draw_skin, draw_touches

design = smo.load_design("planar")
rig = smo.VirtualRig(design, seed=3)
skin = smo.calibrate(smo.load_response_table("planar"), rig, count=15)
estimator = smo.BayesEstimator(design, skin.table)
held = rig.press(smo.Contact(position=(0.045, 0.080), force=(0.1, 0.0, -0.5)))  # m, N; -z presses
start, end = held.rest
estimator.zero([reading for reading in held.readings if start <= reading.time <= end])
estimate = [estimator.step(reading) for reading in held.readings][-1]
off = np.linalg.norm(estimate.contacts[0].position - held.contact.position)
print(f"located to {1e3 * off:.2f} mm, pressed with {estimate.contacts[0].normal_force:.3f} N")
assert off < 2e-3
draw_touches(draw_skin(design), estimate)
