"""
Texts S5 to S11: counts and constants
=====================================

Numbers that the Supporting Information prints in its text and that the model decides. The printed
v_f are put into a virtual bench, whose calibration must find them again. Measured results of the
paper (accuracies, recovery times) are not among them.
"""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.optimize import brentq

from paper.models.magnetisation import OERSTED, MagnetisationLoop
from paper.shared.rows import Row, compared
from paper.shared.setting import Setting
from paper.shared.style import show_rows
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.magnetics.temperature import temperature_factor
from smoskin.measurement import TouchTable
from smoskin.mechanics.reduced.stiffness import cell_layers
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from smoskin.sensing.closed_form.fitting import fit_calibration
from smoskin.twin.bench import calibration_loads
from smoskin.twin.reduced import ReducedTwin

PRINTED_V_F: Final = MappingProxyType({"x": (0.6, 0.75, 0.9), "y": (0.9, 1.0, 1.1)})
"""N, of the outer, mid and inner layer, as printed in Text S5."""
SWEEP_STEP: Final = 5e-3
"""m between the points of the SI's data collection: 25 x 33 of them on 120 x 160 mm."""
SWEEP_FORCES: Final = 10
"""Forces at each point, 0.1 to 1 N by 0.1 N."""


def calibration_rows(design: SkinDesign) -> list[Row]:
    """Counts of Text S5, and its v_f put into a bench and found again."""
    layers = int(cell_layers(design.cells).max()) + 1
    result = _calibrated_again(design)
    why = "layers of cells from the rim inwards"
    rows = [
        compared("calibration.layers", "Text S5", 3, layers, why),
        compared("calibration.v_f", "Text S5", 6, 2 * layers, "v_f: layers times X and Y"),
    ]
    for axis, values in (("x", result.folding_correction_x), ("y", result.folding_correction_y)):
        for layer, pair in enumerate(zip(PRINTED_V_F[axis], values, strict=True), start=1):
            why = (
                f"N, v_f in {axis.upper()}, layer {layer} from the rim: of a virtual skin that "
                "has it, found again by the paper's procedure (gauge and stage alone, without "
                "noise) from another guess"
            )
            rows.append(compared(f"calibration.v_f_{axis}_{layer}", "Text S5", *pair, why))
    return rows


def _calibrated_again(design: SkinDesign) -> Coefficients:
    """Coefficients that the bench finds of a skin with the printed v_f, from another guess."""
    given = replace(
        design.coefficients,
        folding_correction_x=PRINTED_V_F["x"],
        folding_correction_y=PRINTED_V_F["y"],
    )
    twin = ReducedTwin(replace(design, coefficients=given), seed=None)
    loads = [[] if load is None else [load] for load in calibration_loads(design)]
    touches = TouchTable(
        position=np.array([load[0].position if load else (np.nan,) * 2 for load in loads]),
        force=np.array([load[0].force if load else (0.0,) * 3 for load in loads]),
        depth=[twin.depths(load).sum() for load in loads],
        field=np.zeros((len(loads), 0, 3)),
    )
    guess = replace(
        given,
        attenuation=(0.3, 0.3),
        stiffness_variation=1.2,
        folding_correction_x=(0.8, 0.8, 0.8),
        folding_correction_y=(0.8, 0.8, 0.8),
    )
    guessed = replace(design, coefficients=guess)
    fit = fit_calibration(guessed, touches, date="1970-01-01", data_sha256="0" * 64)
    return fit.calibration.coefficients


def material_rows() -> list[Row]:
    """Numbers of Texts S6 and S11."""
    emu, cubic_mm = 1e-3, 1e-9  # A m², m³
    loop = MagnetisationLoop()
    crossing = brentq(lambda field: float(loop.descending(field)), -2 * loop.coercivity, 0.0)
    remanence = float(loop.descending(0.0)) * cubic_mm / emu
    why = "m_0 = M_r x 10^6 A/m: 1 emu is 1e-3 A m², so 0.804 emu/mm³ is 8.04e5 A/m"
    at_zero = "emu/mm³, of the loop at H = 0; the loop is drawn through it"
    at_zero_m = "Oe, where the loop crosses M = 0; the loop is drawn through it"
    taken_in = "loss of field per 10 degC; the model takes this number in"
    loss = 1 - float(temperature_factor(35.0))
    return [
        compared("material.m_0", "Text S6", 0.804 * 1e6, 0.804 * emu / cubic_mm, why),
        compared("material.remanence", "Text S6", 0.804, remanence, at_zero),
        compared("material.coercivity", "Text S6", -5227.78, crossing / OERSTED, at_zero_m),
        compared("material.temperature", "Text S11", 0.05, loss, taken_in),
    ]


def touch_rows(design: SkinDesign) -> list[Row]:
    """Counts of Text S8 on several touches at once."""
    columns, rows = (round(end / SWEEP_STEP) + 1 for end in geometry(design).extent.tolist())
    points = columns * rows
    unknowns = Contact(position=(0.0, 0.0), force=(0.0, 0.0, -1.0)).position.size + 1
    pairs = "825 x 825: ordered pairs, also of a point with itself; without order "
    pairs += f"{math.comb(points, 2)} different ones"
    every = points**2 * SWEEP_FORCES**2
    counts = (
        ("known", 9, 3 * len(design.halls), "three components a chip"),
        ("unknown_one", 3, unknowns, "x, y and F of one touch"),
        ("unknown_two", 6, 2 * unknowns, "x, y and F of two touches"),
        ("columns", 25, columns, "points 5 mm apart over the skin's 120 mm"),
        ("rows", 33, rows, "points 5 mm apart over the skin's 160 mm"),
        ("points", 825, points, "25 x 33"),
        ("pairs", 680625, points**2, pairs),
        ("combinations", 68062500, every, "pairs times ten forces each, 0.1 to 1 N"),
    )
    return [
        compared(f"touch.{name}", "Text S8", printed, value, why)
        for name, printed, value, why in counts
    ]


def rows(setting: Setting) -> list[Row]:
    """All of them."""
    design = setting.design
    return [*calibration_rows(design), *material_rows(), *touch_rows(design)]


if __name__ == "__main__":
    show_rows(rows(Setting()))
