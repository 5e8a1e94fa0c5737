"""Which of many solids run into each other."""

from itertools import combinations

import numpy as np

TOUCH = 1e-13
"""m3 that rounding may make two parts share."""


def overlaps(parts):
    """Pairs of parts that share more than rounding, by names, with the volume, m3."""
    boxes = np.array([part.solid.bounding_box() for part in parts])
    volumes = {}
    for i, j in combinations(range(len(parts)), 2):
        if (boxes[i, :3] < boxes[j, 3:]).all() and (boxes[j, :3] < boxes[i, 3:]).all():
            shared = (parts[i].solid ^ parts[j].solid).volume()
            if shared > TOUCH:
                volumes[parts[i].name, parts[j].name] = shared
    return volumes
