"""
Two touches at once
===================

Three chips tell two touches apart that lie 40 mm or more from each other.
"""

import smoskin as smo
from smoskin.plots import BLUE, draw_skin, draw_touches

design = smo.load_design("planar")
twin = smo.Twin(design, seed=4, manufactured=True)
rig = smo.VirtualRig(twin)
table = smo.calibrate(smo.load_response_table("planar"), rig, count=15).table
estimator = smo.BayesEstimator(design, table)
estimator.zero([twin.read(time=0.01 * k) for k in range(20)])
both = [smo.Contact(position=place, force=(0, 0, -0.8)) for place in ((0.03, 0.04), (0.09, 0.12))]
estimator.step(twin.read(both[:1], time=1.0))
estimate = estimator.step(twin.read(both, time=1.01))
print(f"{len(estimate.contacts)} touches")
assert len(estimate.contacts) == 2
axes = draw_skin(design)
draw_touches(axes, both, colour=BLUE, label="true")
draw_touches(axes, estimate, label="estimated")
axes.legend()
