"""
A neighbouring skin
===================

What the Earth's field and the magnets of a skin beside this one add at its chips.
"""

import numpy as np
from matplotlib import pyplot as plt

import smoskin as smo
from smoskin.twin.surroundings import Neighbour, Surroundings

design = smo.load_design("planar")
gaps = np.linspace(5e-3, 60e-3, 12)
rest = smo.Twin(design, seed=None).read().field
added = []
for gap in gaps:
    beside = Neighbour(place=(0.12 + gap, 0.0, 0.0), turn=(0.0, 0.0, 0.0))
    skin = smo.Twin(design, seed=None, surroundings=Surroundings(neighbours=(beside,)))
    added.append(np.abs(skin.read().field - rest).max())
print(f"{1e6 * added[0]:.2f} uT at 5 mm, {1e6 * added[-1]:.2f} uT at 60 mm")
assert np.all(np.diff(added) < 0)
plt.semilogy(1e3 * gaps, 1e6 * np.array(added))
plt.gca().set(xlabel="gap to the neighbour (mm)", ylabel="largest field added (µT)")
