"""Printed numbers and statements that the model decides, section by section, as rows.

Measured results of the paper (accuracies, recovery times) are not among them. Its v_f are put
into a virtual bench, whose calibration must find them again.
"""

import math
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.optimize import brentq

from paper.maps import PoissonMap, StiffnessMap, signs_text
from paper.models.magnetisation import OERSTED, MagnetisationLoop
from paper.rows import Row, compared, stated
from smoskin.arrays import Floats
from smoskin.design.skin import Coefficients, SkinDesign
from smoskin.magnetics.temperature import temperature_factor
from smoskin.measurement import TouchTable
from smoskin.mechanics.reduced.stiffness import cell_layers
from smoskin.origami.geometry import geometry
from smoskin.records import Contact
from smoskin.sensing.closed_form.fitting import fit_calibration
from smoskin.sensing.closed_form.location import Zone, unit_press
from smoskin.twin.bench import MadeSkin, calibration_loads

TABLE_S1: Final = ("----", "--+-", "+-+-", "-+--", "--+-", "+++-", "-+-+", "-+++", "++++")
"""Signs of dS2x, dS2y, dS3x, dS3y of Z.1 to Z.9, as printed."""
PRINTED_V_F: Final = MappingProxyType({"x": (0.6, 0.75, 0.9), "y": (0.9, 1.0, 1.1)})
"""N, of the outer, mid and inner layer, as printed in Text S5."""
SWEEP_STEP: Final = 5e-3
"""m between the points of the SI's data collection: 25 x 33 of them on 120 x 160 mm."""
SWEEP_FORCES: Final = 10
"""0.1 to 1 N by 0.1 N."""


def poisson_rows(found: PoissonMap) -> list[Row]:
    """What Text S1 says of Figure S1."""

    def falls(values: Floats, axis: int, sign: int) -> bool:
        steps = sign * np.diff(values, axis=axis)
        return bool((steps[np.isfinite(steps)] < 0).all())

    both = (found.nu_13, found.nu_23)
    return [
        stated(
            "figure_s1.phi",
            "Text S1",
            "at one alpha nu_13 and nu_23 decrease as phi increases",
            f"so in all of {np.isfinite(found.nu_13).sum()} points",
            all(falls(nu, 1, 1) for nu in both),
            "S2 over 5 to 85 degrees",
        ),
        stated(
            "figure_s1.alpha",
            "Text S1",
            "at one phi both increase with alpha",
            f"so in all of {np.isfinite(found.nu_13).sum()} points",
            all(falls(nu, 0, -1) for nu in both),
            "S2 over 5 to 85 degrees",
        ),
    ]


def location_rows(design: SkinDesign) -> list[Row]:
    """The four displacements of a unit press on cell (1,1), and their ratios."""
    place = "Text S4, under S12"
    (u2x, u2y), (u3x, u3y) = unit_press(design)[0, 0].tolist()
    why = "from S7-S11; its label stands swapped in print (U2), the cell is inferred (U3)"
    return [
        compared("location.u3x", place, 0.6721, u3x, f"U_3x {why}"),
        compared("location.u2x", place, 0.7313, u2x, f"U_2x {why}"),
        compared("location.u3y", place, 0.9476, u3y, f"U_3y {why}"),
        compared("location.u2y", place, 0.8709, u2y, f"U_2y {why}"),
        compared(
            "location.ratio_x", place, 0.6721 / 0.7313, u3x / u2x, "U_3x/U_2x, labels as in U2"
        ),
        compared(
            "location.ratio_y", place, 0.9476 / 0.8709, u3y / u2y, "U_3y/U_2y, labels as in U2"
        ),
    ]


def zone_rows(zones: tuple[Zone, ...]) -> list[Row]:
    """Table S1, row by row."""
    rows = []
    for zone, printed in zip(zones, TABLE_S1, strict=True):
        row = stated(
            f"table_s1.z{zone.number}",
            "Table S1",
            " ".join(printed),
            " ".join(signs_text(zone)),
            signs_text(zone) == printed,
            "cells " + ", ".join(f"({n + 1},{m + 1})" for m in zone.rows for n in zone.columns),
        )
        if printed in TABLE_S1[: zone.number - 1] and row.verdict == "unresolved":
            row = replace(
                row, verdict="corrected", why=f"{row.why}: printed like an earlier zone's (E7)"
            )
        rows.append(row)
    return [
        *rows,
        compared(
            "table_s1.zones", "Text S4", 9, len({signs_text(zone) for zone in zones}),
            "different rows of signs",
        ),
    ]  # fmt: skip


def sheet_rows(design: SkinDesign) -> list[Row]:
    """Counts of Figure S6 and of the energy sums."""
    sheet, (n, m) = geometry(design).sheet, design.cells
    at_vertex = int((sheet.creases == sheet.loaded[0, 0]).any(axis=1).sum())
    counted = 6 * n * m - int((sheet.multiplicity == 2).sum())
    counted -= 3 * int((sheet.multiplicity == 4).sum())
    return [
        compared("figure_s6.creases", "S16", 4, at_vertex, "creases at one top vertex"),
        compared(
            "figure_s6.columns", "S22", 6, sheet.multiplicity.sum() / (n * m),
            "columns of a cell, shared ones counted for each",
        ),
        stated(
            "figure_s6.each_once",
            "S23",
            "6 N M, less those counted twice, less 3 times those counted four times",
            f"{counted}, each of {sheet.columns.size} columns once",
            counted == sheet.columns.size,
            "column multiplicity of the sheet",
        ),
    ]  # fmt: skip


def stiffness_rows(maps: tuple[StiffnessMap, ...]) -> list[Row]:
    """What the SI says of Figure S7."""
    place = "Stiffness distributions, Figure S7"
    corner = np.array([one.relative[0, 0] for one in maps])
    n, m = maps[0].relative.shape
    centre = np.array([one.relative[(n - 1) // 2, (m - 1) // 2] for one in maps])
    ratio = corner / centre
    shrinking = np.diff(np.abs(ratio - 1))[ratio[1:] > 1]
    listed = ", ".join(f"{one.attenuation:g}: {r:.3f}" for one, r in zip(maps, ratio, strict=True))
    return [
        stated(
            "figure_s7.edge",
            place,
            "at v_a = 1 the edge is obviously stiffer than the centre",
            f"cell (1,1) over (3,3) {ratio[0]:.3f}",
            bool(ratio[0] > 1.5),
            "S22-S24, columns alone",
        ),
        stated(
            "figure_s7.shrinks",
            place,
            "with lower v_a the difference shrinks",
            f"cell (1,1) over (3,3) by v_a: {listed}",
            bool((shrinking < 0).all()),
            "S22-S24, columns alone",
        ),
        stated(
            "figure_s7.reverses",
            place,
            "with v_a lower still the centre is the stiffer",
            f"cell (1,1) over (3,3) {ratio[-1]:.3f} at v_a = {maps[-1].attenuation:g}",
            bool(ratio[-1] < 1),
            "S22-S24, columns alone; true of cell (1,1), which the SI measures, not of the far "
            "corner (1,6) nor of the outer layer's mean (E26)",
        ),
    ]


def calibration_rows(design: SkinDesign) -> list[Row]:
    """Counts of Text S5, and its v_f put into a bench and found again."""
    layers = int(cell_layers(design.cells).max()) + 1
    found = _calibrated_again(design)
    rows = [
        compared(
            "calibration.layers", "Text S5", 3, layers, "layers of cells from the rim inwards"
        ),
        compared("calibration.v_f", "Text S5", 6, 2 * layers, "v_f: layers times X and Y"),
    ]
    for axis, values in (("x", found.folding_correction_x), ("y", found.folding_correction_y)):
        rows += [
            compared(
                f"calibration.v_f_{axis}_{layer + 1}", "Text S5", printed, value,
                f"N, v_f in {axis.upper()}, layer {layer + 1} from the rim: of a virtual skin that "
                "has it, found again by the paper's procedure (gauge and stage alone, without "
                "noise) from another guess",
            )
            for layer, (printed, value) in enumerate(zip(PRINTED_V_F[axis], values, strict=True))
        ]  # fmt: skip
    return rows


def _calibrated_again(design: SkinDesign) -> Coefficients:
    """Coefficients that the bench finds of a skin with the printed v_f, from another guess."""
    chips = np.zeros((len(design.halls), 3))
    given = replace(
        design.coefficients,
        folding_correction_x=PRINTED_V_F["x"],
        folding_correction_y=PRINTED_V_F["y"],
    )
    skin = MadeSkin(replace(design, coefficients=given), chip_rotation=chips, chip_offset=chips)
    loads = calibration_loads(design)
    touches = TouchTable(
        cell=[(-1, -1) if load.cell is None else load.cell for load in loads],
        force=[load.force for load in loads],
        depth=skin.depths(loads),
        field=np.zeros((len(loads), 0, 3)),
        temperature=np.full(len(loads), 25.0),
    )
    guess = replace(
        given,
        attenuation=(0.3, 0.3),
        stiffness_variation=1.2,
        folding_correction_x=(0.8, 0.8, 0.8),
        folding_correction_y=(0.8, 0.8, 0.8),
    )
    fit = fit_calibration(
        replace(design, coefficients=guess), touches, date="1970-01-01", data_sha256="0" * 64
    )
    return fit.calibration.coefficients


def material_rows() -> list[Row]:
    """Numbers of Texts S6 and S11."""
    emu, cubic_mm = 1e-3, 1e-9  # A m², m³
    loop = MagnetisationLoop()
    crossing = brentq(lambda field: float(loop.descending(field)), -2 * loop.coercivity, 0.0)
    return [
        compared(
            "material.m_0", "Text S6", 0.804 * 1e6, 0.804 * emu / cubic_mm,
            "m_0 = M_r x 10^6 A/m: 1 emu is 1e-3 A m², so 0.804 emu/mm³ is 8.04e5 A/m",
        ),
        compared(
            "material.remanence", "Text S6", 0.804,
            float(loop.descending(0.0)) * cubic_mm / emu,
            "emu/mm³, of the loop at H = 0; the loop is drawn through it",
        ),
        compared(
            "material.coercivity", "Text S6", -5227.78, crossing / OERSTED,
            "Oe, where the loop crosses M = 0; the loop is drawn through it",
        ),
        compared(
            "material.temperature", "Text S11", 0.05, 1 - float(temperature_factor(35.0)),
            "loss of field per 10 degC; the model takes this number in",
        ),
    ]  # fmt: skip


def touch_rows(design: SkinDesign) -> list[Row]:
    """Counts of Text S8 on several touches at once."""
    place = "Text S8"
    columns, rows = (round(end / SWEEP_STEP) + 1 for end in geometry(design).extent.tolist())
    points = columns * rows
    one = Contact(position=(0.0, 0.0), force=(0.0, 0.0, -1.0))
    unknowns = one.position.size + 1
    return [
        compared("touch.known", place, 9, 3 * len(design.halls), "three components a chip"),
        compared("touch.unknown_one", place, 3, unknowns, "x, y and F of one touch"),
        compared("touch.unknown_two", place, 6, 2 * unknowns, "x, y and F of two touches"),
        compared(
            "touch.columns", place, 25, columns, "points 5 mm apart over the skin's 120 mm"
        ),
        compared("touch.rows", place, 33, rows, "points 5 mm apart over the skin's 160 mm"),
        compared("touch.points", place, 825, points, "25 x 33"),
        compared(
            "touch.pairs", place, 680625, points**2,
            "825 x 825: ordered pairs, also of a point with itself; without order "
            f"{math.comb(points, 2)} different ones",
        ),
        compared(
            "touch.combinations", place, 68062500, points**2 * SWEEP_FORCES**2,
            "pairs times ten forces each, 0.1 to 1 N",
        ),
    ]  # fmt: skip
