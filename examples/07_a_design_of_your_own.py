"""
A design of your own
====================

Thinner columns make a softer skin; what cannot work is refused with the reason.
"""

from dataclasses import replace

import smoskin as smo
from smoskin.feasibility import check_design
from smoskin.mechanics.reduced.stiffness import stiffness_map
from smoskin.plots import draw_map

design = smo.load_design("planar")
softer = replace(design, name="softer", columns=replace(design.columns, radius=2.5e-3))
check_design(softer)  # raises DesignError with what would be valid
ratio = stiffness_map(softer, softer.coefficients) / stiffness_map(design, design.coefficients)
print(f"the softer skin has {ratio.mean():.2f} of the stiffness")
assert abs(ratio - (2.5 / 3.5) ** 2).max() < 1e-9  # as the columns' cross-section
draw_map(softer, 1e-3 * stiffness_map(softer, softer.coefficients), label="stiffness (N/mm)")
