"""
Creep and its undoing
=====================

Rubber goes on sinking under a held press; the estimator undoes it, so the force stays.
"""

import numpy as np
from matplotlib import pyplot as plt

from smoskin.mechanics.viscoelasticity import creep, elastomer_prony
from smoskin.sensing.signals.signals import Settling

prony = elastomer_prony("Ecoflex 00-30")
time = np.linspace(0.0, 5.0, 200)
elastic = np.where(time > 0.5, 1.0, 0.0)
crept = creep(prony, time, elastic)
settling = Settling(prony)
undone = [float(settling.step(0.0 if k == 0 else time[1], u)) for k, u in enumerate(crept)]
print(f"sinks on by {100 * (crept[-1] / crept[21] - 1):.1f} %, undone to {undone[-1]:.6f}")
assert np.abs(np.array(undone) - elastic).max() < 1e-6
plt.plot(time, crept, label="as it creeps")
plt.plot(time, undone, label="undone")
plt.gca().set(xlabel="time (s)", ylabel="motion over the settled one")
plt.legend()
