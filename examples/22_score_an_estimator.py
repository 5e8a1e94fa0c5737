"""
Score an estimator
==================

How good a table is on a made skin that it never saw, after fifteen touches.
"""

import smoskin as smo
from smoskin.plots import draw_map

table = smo.load_response_table("planar")
sheet = smo.score(table, skins=[41], touches=15, places=(7, 9), world="plain")
(case,) = (case for case in sheet.cases if case.map is not None)
errors = 1e3 * case.map.location
print(f"{errors.mean():.2f} mm in the mean on a made skin, plain world")
assert errors.mean() < 1.0
draw_map(smo.load_design("planar"), errors, label="error (mm)")
