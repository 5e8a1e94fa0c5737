"""
Stiffness of each cell
======================

How stiff the published model says that each cell is under a press (Figure S7).
"""

import smoskin as smo
from smoskin.mechanics.reduced.stiffness import relative_stiffness_map
from smoskin.plots import draw_map

design = smo.load_design("planar")
uniform = relative_stiffness_map(design.cell, design.cells, (1.0, 1.0))
print(f"without attenuation the corner is {uniform[0, 0] / uniform[2, 2]:.2f} times the centre")
assert abs(uniform[0, 0] - 1964.91) < 0.05
draw_map(design, uniform / uniform.max(), label="stiffness over the largest")
