"""
Where to touch next
===================

Each touch of a calibration is made where it tells most about this skin.
"""

import smoskin as smo
from smoskin.plots import draw_skin, draw_touches

design = smo.load_design("planar")
rig = smo.VirtualRig(design, seed=5)
skin = smo.calibrate(smo.load_response_table("planar"), rig, count=8, design=design)
print(f"expected error: {1e3 * skin.errors[0]:.1f} mm before, {1e3 * skin.errors[-1]:.2f} mm after")
assert skin.errors[-1] < skin.errors[0] / 5
draw_touches(draw_skin(design), [label.contact for label in skin.labels])
