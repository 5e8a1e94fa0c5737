"""
Press the whole sheet
=====================

A press on the whole folded sheet: bars, hinges and columns, solved for equilibrium.
"""

import smoskin as smo
from smoskin.plots import draw_map

design = smo.load_design("planar")
twin = smo.Twin(design, seed=None)
press = smo.Contact(position=(0.01, 0.0133), force=(0.0, 0.0, -0.5))
tops = (slice(1, None, 2), slice(1, None, 2))  # vertices (2n + 1, 2m + 1) are loaded
sunk = (twin.sheet_vertices() - twin.sheet_vertices([press]))[:, 2].reshape(13, 13)[tops]
print(f"the pressed vertex sinks by {1e6 * sunk[0, 0]:.0f} um")
assert sunk.max() == sunk[0, 0]
draw_map(design, 1e6 * sunk, label="sunk (µm)")
