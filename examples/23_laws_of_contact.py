"""
Laws of contact
===============

How the vertices share a touch between them is a law that anyone can replace; here is how far
eight of them place the load from where the finger is.
"""

import numpy as np
from matplotlib import pyplot as plt

import smoskin as smo
from smoskin.mechanics.sheet.contact import Bilinear, ScaleContact, shares_by
from smoskin.mechanics.sheet.touches import Touches
from smoskin.origami.geometry import geometry
from smoskin.twin.world.strangers import STRANGERS

design = smo.load_design("planar")
x = np.linspace(0.0, 0.05, 201)
place = np.stack([x, np.full_like(x, geometry(design).tops[0, 2, 1])], axis=-1)[:, None]
touches = Touches(position=place, force=np.broadcast_to([0.0, 0.0, -0.5], (len(x), 1, 3)))
laws = {"bilinear": Bilinear(), "elastomer cover": ScaleContact(), **STRANGERS}
farthest = {}
for name, law in laws.items():
    shares = shares_by(law, design, touches)[:, 0]
    off = np.einsum("bnm,nm->b", shares, geometry(design).tops[..., 0]) - x
    farthest[name] = 1e3 * np.abs(off).max()
    plt.plot(1e3 * x, 1e3 * off, label=name)
print(f"{farthest['no-lever']:.1f} mm at the rim without a lever, {farthest['bilinear']:.1f} with")
assert farthest["bilinear"] < 0.1 < 9.0 < farthest["no-lever"]
plt.gca().set(xlabel="where the touch is (mm)", ylabel="load's middle off it (mm)")
plt.legend(fontsize="small")
