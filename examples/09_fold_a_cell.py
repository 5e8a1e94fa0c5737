"""
Fold a cell
===========

Length, width and height of a Miura cell from nearly folded to flat (Eq. S1).
"""

import numpy as np
from matplotlib import pyplot as plt

import smoskin as smo
from smoskin.origami.cell import fold_angle, size

cell = smo.load_design("planar").cell
phi = np.linspace(0.2, cell.sector_angle, 60)
print(f"the reference cell stands {1e3 * size(cell).height:.3f} mm high")
assert np.isclose(fold_angle(cell, height=size(cell).height), cell.fold_angle)
for name, extent in size(cell, phi)._asdict().items():
    plt.plot(np.degrees(phi), 1e3 * extent, label=name)
plt.gca().set(xlabel="fold angle (deg)", ylabel="mm")
plt.legend()
