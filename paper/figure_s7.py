"""
Figure S7: stiffness over the sheet
===================================

The stiffness of a press on each cell, columns alone (S22-S24), over the stiffest cell's, for nine
attenuations; and numbers of such stiffnesses that two independent programs agree on.
"""

import math
from typing import Final

import numpy as np
from matplotlib.colors import Normalize

from paper.models.fold_energies import relative_crease_stiffness_map
from paper.models.stiffness_terms import FIGURE_S7_ATTENUATIONS, sliding_stiffness_map
from paper.shared.rows import Row, compared, stated
from paper.shared.setting import Setting
from paper.shared.style import Plate, canvas, colour_bar, draw_map, lay_out, styled
from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.mechanics.reduced.stiffness import relative_stiffness_map

COLUMN_STIFFNESS: Final = (
    (1.0, (1964.91, 1188.26, 826.57)),
    (0.8, (838.72, 599.46, 489.07)),
    (0.5, (255.55, 223.29, 214.43)),
    (0.3, (124.70, 119.77, 121.06)),
    (0.2, (89.23, 88.62, 90.53)),
)
"""v_a, and K_B / k_bc of cells (1,1), (2,2), (3,3)."""
RIGID_STIFFNESS: Final = ((3, 18.808e3), (6, 184.41e3))
"""Cells along each edge, and N/m of a bar-and-hinge sheet with nearly rigid panels."""
CREASE: Final = 2.5e9 * 50e-6**3 / (12 * 1e-3)
"""N per rad of that sheet: 50 um of polyimide over a gap of 1 mm, 0.026 in two digits."""
COLUMN: Final = 63.0
"""N/m of each of its columns."""


def stiffness_maps(design: SkinDesign) -> Floats:
    """K_B / k_bc of each cell for the nine attenuations, (9, N, M)."""
    maps = [
        relative_stiffness_map(design.cell, design.cells, (v, v)) for v in FIGURE_S7_ATTENUATIONS
    ]
    return np.stack(maps)


# %%
# Printed beside computed


def stiffness_rows(maps: Floats) -> list[Row]:
    """What the SI says of Figure S7."""
    place, why = "Stiffness distributions, Figure S7", "S22-S24, columns alone"
    n, m = maps.shape[1:]
    ratio = maps[:, 0, 0] / maps[:, (n - 1) // 2, (m - 1) // 2]
    shrinking = np.diff(np.abs(ratio - 1))[ratio[1:] > 1]
    listed = [f"{v:g}: {item:.3f}" for v, item in zip(FIGURE_S7_ATTENUATIONS, ratio, strict=True)]
    over = "cell (1,1) over (3,3)"
    return [
        stated(
            "figure_s7.edge",
            place,
            "at v_a = 1 the edge is obviously stiffer than the centre",
            f"{over} {ratio[0]:.3f}",
            bool(ratio[0] > 1.5),
            why,
        ),
        stated(
            "figure_s7.shrinks",
            place,
            "with lower v_a the difference shrinks",
            f"{over} by v_a: {', '.join(listed)}",
            bool((shrinking < 0).all()),
            why,
        ),
        stated(
            "figure_s7.reverses",
            place,
            "with v_a lower still the centre is the stiffer",
            f"{over} {ratio[-1]:.3f} at v_a = {FIGURE_S7_ATTENUATIONS[-1]:g}",
            bool(ratio[-1] < 1),
            f"{why}; true of cell (1,1), which the SI measures, not of the far "
            "corner (1,6) nor of the outer layer's mean (E26)",
        ),
    ]


def golden_rows(design: SkinDesign) -> list[Row]:
    """Stiffnesses that are not printed but that another program gives too."""
    place, rows = "not printed; two programs", []
    for v, expected in COLUMN_STIFFNESS:
        stiffness = relative_stiffness_map(design.cell, design.cells, (v, v))
        for k, value in enumerate(expected, start=1):
            name, why = f"golden.columns_{v:g}_{k}{k}", f"K_B/k_bc of cell ({k},{k}) at v_a = {v:g}"
            computed = float(stiffness[k - 1, k - 1])
            rows.append(compared(name, place, value, computed, f"{why} (S22-S24)"))
    why = "N/m, K_B + K_C at v_a = 1 of a sheet free to slide, 10 mm panels, alpha 60°, phi 45°, "
    why += "against a bar-and-hinge model with nearly rigid panels"
    return rows + [
        compared(f"golden.rigid_{count}x{count}", place, value, rigid_stiffness(count), why)
        for count, value in RIGID_STIFFNESS
    ]


def rigid_stiffness(count: int) -> float:
    """Stiffness of a press on a rigidly folding sheet of count x count cells, N/m."""
    cell = MiuraCell(
        panel_a=0.01, panel_b=0.01, sector_angle=math.radians(60), fold_angle=math.radians(45)
    )
    cells, rigid = (count, count), (1.0, 1.0)
    columns = COLUMN * sliding_stiffness_map(cell, cells, rigid)
    creases = CREASE * relative_crease_stiffness_map(cell, cells, rigid)
    return float((columns + creases)[0, 0])


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Figures S7a to S7i: normalised stiffness of every cell for nine attenuations."""
    maps = stiffness_maps(setting.design)
    normalised = maps / maps.max(axis=(1, 2), keepdims=True)
    norm = Normalize(float(np.floor(10 * normalised.min()) / 10), 1)
    with styled():
        figure = canvas(7.2, 7.6)
        axes = figure.subplots(3, 3, sharex=True, sharey=True)
        rest = zip("abcdefghi", FIGURE_S7_ATTENUATIONS, normalised, strict=True)
        for axis, (letter, v, values) in zip(axes.flat, rest, strict=True):
            texts = [[f"{value:.2f}" for value in line] for line in values]
            shown = draw_map(axis, values, norm, texts=texts, size=5.5)
            axis.set_title(f"({letter}) $v_{{a,X}} = v_{{a,Y}}$ = {v:.1f}")
            axis.label_outer()
        colour_bar(figure, shown, axes, "stiffness over the stiffest cell's (no unit)", shrink=0.6)
        lay_out(figure)
    return Plate(
        name="figure_s7",
        title="Figures S7a to S7i",
        caption="Figures S7a to S7i, computed here: stiffness of a press on each cell, columns "
        "alone (S22-S24), over the stiffest cell's, for attenuations from 1 to 0.2. Rigid sheets "
        "are far stiffer at the corners; with lower attenuation the difference shrinks, until the "
        "centre is stiffer than cell (1,1), though not than the far corner (1,6): the zigzag "
        "leaves no mirror along y (E26).",
        figure=figure,
        rows=(*stiffness_rows(maps), *golden_rows(setting.design)),
    )


if __name__ == "__main__":
    plate(Setting()).show()
