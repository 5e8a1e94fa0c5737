"""
Field of a magnet
=================

The exact field of a four-sector magnet below its middle, and the law that ends at the chip.
"""

import numpy as np
from matplotlib import pyplot as plt

import smoskin as smo
from smoskin.magnetics.sector import field, field_and_gradient

magnet = smo.load_design("planar").magnet("M2")
height = np.linspace(3e-3, 12e-3, 50)
points = np.stack([0 * height, 0 * height, -(magnet.height / 2 + height)], axis=-1)
_, gradient = field_and_gradient(magnet, points)
print(f"{1e3 * field(magnet, points)[0, 2]:.0f} mT at 3 mm")
assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-9  # div B = 0
plt.semilogy(1e3 * height, 1e3 * np.abs(field(magnet, points)[:, 2]))
plt.gca().set(xlabel="gap (mm)", ylabel="|Bz| (mT)")
