"""
Made skins differ
=================

The same press on five skins drawn from the workshop's tolerances.
"""

import numpy as np
from matplotlib import pyplot as plt

import smoskin as smo

design = smo.load_design("planar")
press = [smo.Contact(position=(0.06, 0.08), force=(0.0, 0.0, -0.5))]
skins = [smo.Twin(design, seed=seed, manufactured=True) for seed in range(5)]
change = np.array([skin.read(press).field - skin.read().field for skin in skins])
scatter = change.std(axis=0).max() / np.abs(change).max()
print(f"skins differ by up to {100 * scatter:.0f} % of the largest signal")
assert 0.005 < scatter < 0.5
plt.boxplot(1e6 * change.reshape(5, -1))
plt.gca().set(xlabel="signal: x, y, z of each chip", ylabel="change of field (µT)")
