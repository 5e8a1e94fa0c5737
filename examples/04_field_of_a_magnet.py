"""The exact field of a four-sector magnet, its gradient, and the corrected ideal inverse."""

import numpy as np

import smoskin as smo
from smoskin.magnetics.centripetal import displacement, fit_correction, usable_range
from smoskin.magnetics.sector import field, field_and_gradient

magnet = smo.load_design("planar").magnet("M2")
gap = 5e-3
below = np.array([0.0, 0.0, -(magnet.height / 2 + gap)])

b, gradient = field_and_gradient(magnet, below)
print(f"at rest {b * 1e3} mT, div B = {np.trace(gradient):.1e} T/m")

correction = fit_correction(magnet, gap, 0.5e-3)
radius = usable_range(magnet, gap, correction, 1e-6)
print(f"the closed inverse is true to a micrometre within {radius * 1e3:.2f} mm")
moved = np.array([0.2e-3, -0.1e-3, 0.0])
assert np.abs(displacement(correction, field(magnet, below - moved)) - moved).max() < 1e-6
