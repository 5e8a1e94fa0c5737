"""
Which cells look alike
======================

Signs of two magnets' motions part the cells into zones; ratios tell the rest (Table S1).
"""

import numpy as np

import smoskin as smo
from smoskin.plots import draw_map
from smoskin.sensing.closed_form.location import unit_press

design = smo.load_design("planar")
signs = np.sign(unit_press(design)).reshape(-1, 4)
parts, zone = np.unique(signs, axis=0, return_inverse=True)
print(f"{len(parts)} zones of equal signs")
assert len(parts) == 9
assert (np.bincount(zone) == 4).all()
draw_map(design, 1 + zone.reshape(design.cells), label="zone of equal signs")
