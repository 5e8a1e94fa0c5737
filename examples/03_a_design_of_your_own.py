"""Change a design, see whether it can work, and what it costs in stiffness."""

from dataclasses import replace

import smoskin as smo
from smoskin.feasibility import check_design
from smoskin.mechanics.reduced.stiffness import stiffness_map

design = smo.load_design("planar")
softer = replace(design, name="softer", columns=replace(design.columns, radius=1.2e-3))
check_design(softer)  # raises DesignError with what would be valid
for skin in (design, softer):
    stiffness = stiffness_map(skin, skin.coefficients)
    print(f"{skin.name}: {stiffness.min():.0f} to {stiffness.max():.0f} N/m")
ratio = stiffness_map(softer, softer.coefficients) / stiffness_map(design, design.coefficients)
assert abs(ratio - (1.2 / 1.5) ** 2).max() < 1e-9  # as the columns' cross-section

try:
    check_design(replace(design, columns=replace(design.columns, radius=5.5e-3)))
except smo.SmoskinError as error:
    print(error)
