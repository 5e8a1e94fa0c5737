"""Numbers that the paper does not print but that two independent programs agree on, as rows."""

import math
from typing import Final

from paper.models.fold_energies import relative_crease_stiffness_map
from paper.rows import Row, compared
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.mechanics.reduced.stiffness import relative_stiffness_map

PLACE: Final = "not printed; two programs"

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


def golden_rows(design: SkinDesign) -> list[Row]:
    """All of them."""
    rows = []
    for v, expected in COLUMN_STIFFNESS:
        stiffness = relative_stiffness_map(design.cell, design.cells, (v, v))
        rows += [
            compared(
                f"golden.columns_{v:g}_{k + 1}{k + 1}", PLACE, value, float(stiffness[k, k]),
                f"K_B/k_bc of cell ({k + 1},{k + 1}) at v_a = {v:g} (S22-S24)",
            )
            for k, value in enumerate(expected)
        ]  # fmt: skip
    rows += [
        compared(
            f"golden.rigid_{count}x{count}", PLACE, value, rigid_stiffness(count),
            "N/m, K_B + K_C at v_a = 1 of a sheet free to slide, 10 mm panels, alpha 60°, phi 45°, "
            "against a bar-and-hinge model with nearly rigid panels",
        )
        for count, value in RIGID_STIFFNESS
    ]  # fmt: skip
    return rows


def rigid_stiffness(count: int) -> float:
    """Stiffness of a press on a rigidly folding sheet of count x count cells, N/m."""
    cell = MiuraCell(
        panel_a=0.01, panel_b=0.01, sector_angle=math.radians(60), fold_angle=math.radians(45)
    )
    cells, rigid = (count, count), (1.0, 1.0)
    columns = COLUMN * relative_stiffness_map(cell, cells, rigid, grip="slips")
    creases = CREASE * relative_crease_stiffness_map(cell, cells, rigid)
    return float((columns + creases)[0, 0])
