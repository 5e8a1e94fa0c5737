"""
How well at best
================

The Cramer-Rao bound: no estimator locates a touch better than the chips' noise lets it.
"""

import smoskin as smo
from smoskin.plots import draw_map
from smoskin.sensing.response.bound import bound_map, figures
from smoskin.sensing.signals.signals import signal_noise

design = smo.load_design("planar")
table = smo.load_response_table("planar")
bound = bound_map(table, signal_noise(design), force=0.5, places=(25, 33))
print(f"{1e3 * figures(bound.location).mean:.2f} mm in the mean, for 0.5 N with any drag")
assert 0.2e-3 < figures(bound.location).mean < 0.8e-3
draw_map(design, 1e3 * bound.location, label="bound (mm)", limits=(0.0, 2.0))
