"""
Zero and drift
==============

The zero is taken while nothing touches, and follows slow drift from then on.
"""

import numpy as np
from matplotlib import pyplot as plt

import smoskin as smo

design = smo.load_design("planar")
twin, estimator = smo.ReducedTwin(design, seed=0), smo.ClosedFormEstimator(design)


def read(time: float) -> smo.Reading:
    """A reading in the Earth's field, with a drift of a microtesla a second."""
    field = twin.read(time=time).field + [20e-6, -10e-6, 45e-6] + 1e-6 * time
    return smo.Reading(time=time, field=field)


estimator.zero([read(0.01 * k) for k in range(50)])
drift = []
for time in np.arange(1.0, 101.0, 0.05):
    assert estimator.step(read(time)).status is smo.Status.NO_CONTACT
    drift.append(np.abs(estimator.drift).max())
print(f"followed {1e6 * drift[-1]:.0f} uT of drift")
assert abs(drift[-1] - 100e-6) < 30e-6
plt.plot(np.arange(1.0, 101.0, 0.05), 1e6 * np.array(drift))
plt.gca().set(xlabel="time (s)", ylabel="zero has moved (µT)")
