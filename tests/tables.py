"""Press tables that theory gives, for tests of what is done with measured ones."""

import numpy as np

from smoskin.mechanics.reduced.stiffness import stiffness_map
from smoskin.sensing.closed_form.location import unit_press
from smoskin.sensing.closed_form.press_table import PressTable, uniform_drag


def ideal_table(design, factor=1.0):
    """The table of an ideal sheet; factors (N, M, S, 3) make it another sheet's."""
    press = np.zeros((*design.cells, len(design.halls), 3))
    upper = [design.magnet(site.magnet).mount == "sheet" for site in design.halls]
    stiffness = stiffness_map(design, design.coefficients)[..., None, None]
    press[:, :, upper, :2] = -unit_press(design) / stiffness
    return PressTable(press=press * factor, drag=uniform_drag(design))
