"""
A drag
======

Which way a finger drags, beside how hard it presses.
"""

import numpy as np

import smoskin as smo
from smoskin.plots import draw_skin, draw_touches

design = smo.load_design("planar")
twin, estimator = smo.ReducedTwin(design, seed=0), smo.ClosedFormEstimator(design)
axes, worst = draw_skin(design), 0.0
for k, angle in enumerate(np.linspace(0.0, 2 * np.pi, 8, endpoint=False)):
    drag = 0.3 * np.array([np.cos(angle), np.sin(angle)])
    touch = smo.Contact(position=(0.05, 0.0667), force=(*drag, -0.5))
    (contact,) = estimator.step(twin.read([touch], time=0.1 * k)).contacts
    worst = max(worst, np.abs(contact.force[:2] - drag).max())
    draw_touches(axes, [contact])
print(f"drags are right to {1e3 * worst:.1f} mN")
assert worst < 0.02
