"""
A warm skin
===========

Warm magnets are weaker and warm rubber stiffer; the chips' own temperatures undo both.
"""

import numpy as np
from matplotlib import pyplot as plt

import smoskin as smo

design = smo.load_design("planar")
twin = smo.Twin(design, seed=None)
estimator = smo.BayesEstimator(design, smo.load_response_table("planar"))
touch = smo.Contact(position=(0.05, 0.07), force=(0.0, 0.0, -0.5))
degrees, forces = np.linspace(15.0, 35.0, 9), []
for k, warm in enumerate(degrees):
    estimator.zero([twin.read(time=0.0, temperature=warm)])
    estimate = estimator.step(twin.read([touch], time=1.0 + k, temperature=warm))
    forces.append(estimate.contacts[0].normal_force)
print(f"0.5 N is read as {min(forces):.3f} to {max(forces):.3f} N")
assert max(forces) / min(forces) < 1.05
plt.plot(degrees, forces, "o-")
plt.gca().set(xlabel="temperature (°C)", ylabel="force read (N)", ylim=(0.0, 0.7))
