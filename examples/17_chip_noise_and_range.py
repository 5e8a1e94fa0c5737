"""
Noise and range of a chip
=========================

What gain and resolution of the MLX90393 mean: the step, the noise and the range.
"""

from dataclasses import replace

import numpy as np
from matplotlib import pyplot as plt

import smoskin as smo
from smoskin.magnetics.mlx90393 import full_scale, noise, sensitivity

setting = smo.load_design("planar").hall_setting
scales = []
for gain in range(8):
    chosen = replace(setting, gain_selection=gain)
    scales.append(full_scale(chosen)[2])
    plt.loglog(1e3 * scales[-1], 1e6 * noise(chosen)[2], "o", label=f"GAIN_SEL {gain}")
print(f"steps of {1e6 * sensitivity(setting)[0]:.3f} uT in x")
assert np.all(np.diff(scales) < 0)  # less gain selected, more range
plt.gca().set(xlabel="full scale in z (mT)", ylabel="noise (µT)")
plt.legend(fontsize=6)
