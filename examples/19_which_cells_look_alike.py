"""
Which cells look alike
======================

Signs of two magnets' motions part the cells into zones; ratios tell the rest (Table S1).
"""

import numpy as np

import smoskin as smo
from smoskin.plots import draw_map
from smoskin.sensing.closed_form.location import unit_press, zones

design = smo.load_design("planar")
parts = zones(unit_press(design))
zone = np.full(design.cells, np.nan)
for part in parts:
    zone[np.ix_(part.columns, part.rows)] = part.number
print(f"{len(parts)} zones of equal signs")
assert len(parts) == 9
assert np.isfinite(zone).all()
draw_map(design, zone, label="zone of Table S1")
