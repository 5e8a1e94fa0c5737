"""Learn a made skin from thirty touches, and say where it is touched, with how sure that is."""

import numpy as np

import smoskin as smo
from smoskin.commands.calibrate import calibrate
from smoskin.commands.table import Effort, make_table
from smoskin.twin.rig import VirtualRig

design = smo.load_design("planar")
# A small table, for speed; `smo.load_response_table("planar")` is a good one.
small = Effort(presses=4000, pairs=400, skins=16, draws=3, presses_a_skin=300)
table = make_table(design, small)

found = calibrate(table, VirtualRig(design, seed=7), count=30)
print(f"a located touch is expected to be off by {found.errors[-1] * 1e3:.2f} mm")

# The same skin on another rig, without errors of its stage, for an exact truth.
skin = smo.Twin(design, seed=7, manufactured=True)
exact = VirtualRig(skin, np.random.default_rng(1), stage=0.0, gauge=0.0)
estimator = smo.BayesEstimator(design, found.table)
touch = smo.Contact(position=(0.052, 0.097), force=(0.1, -0.05, -0.5))
held = exact.press(touch)
start, end = held.rest
estimator.zero([one for one in held.readings if start <= one.time <= end])
estimate = [estimator.step(one) for one in held.readings][-1]
(contact,) = estimate.contacts
off = np.hypot(*(contact.position - touch.position))
said = np.sqrt(np.trace(estimate.covariance[0, :2, :2]))
print(f"found {off * 1e3:.2f} mm off, said to be good to {said * 1e3:.2f} mm")
print(f"force {contact.force.round(3)} N")
assert estimate.status is smo.Status.CONTACT
assert off < 2.5e-3
assert np.abs(contact.force - touch.force).max() < 0.02
