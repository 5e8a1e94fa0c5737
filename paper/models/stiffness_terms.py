"""The parts of the press stiffness side by side: creases, columns and panels.

The SI adds all three (S25), then keeps the columns alone. This module lets that be judged for a
design, and gives the normalised maps of Figure S7.
"""

from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

import numpy as np

from paper.models.finite_press import column_response
from paper.models.fold_energies import (
    CreaseCount,
    FoldFrom,
    panel_stiffness_map,
    relative_crease_stiffness_map,
)
from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell, SkinDesign
from smoskin.mechanics.plate import crease_stiffness
from smoskin.mechanics.reduced.attenuation import profiles
from smoskin.mechanics.reduced.stiffness import relative_stiffness_map

PanelEnergy = Literal["neglected", "bending", "bending_and_stretching"]
"""What of the panels' energy is counted."""

FIGURE_S7_ATTENUATIONS: Final = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
"""v_aX = v_aY of the panels (a) to (i)."""


class StiffnessTerms(NamedTuple):
    """Parts of K_z of a press on each cell, (N, M) each, N/m; without v_s."""

    creases: Floats
    """K_C."""
    columns: Floats
    """K_B."""
    panels: Floats
    """K_p."""

    @property
    def total(self) -> Floats:
        """K_z = K_C + K_B + K_p."""
        return np.asarray(self.creases + self.columns + self.panels)


def normalised_stiffness_maps(
    cell: MiuraCell,
    cells: tuple[int, int],
    attenuations: Sequence[float] = FIGURE_S7_ATTENUATIONS,
) -> Floats:
    """Stiffness over its largest value on the sheet, a map an attenuation, shape (K, N, M).

    Parameters
    ----------
    cell : MiuraCell
    cells : tuple of int
        (N, M).
    attenuations : sequence of float, length K
        v_aX = v_aY.

    Notes
    -----
    Source: SI Figure S7. The SI does not say what it normalises by; here each map's largest
    value is 1.
    """
    maps = np.stack([relative_stiffness_map(cell, cells, (v, v)) for v in attenuations])
    return np.asarray(maps / maps.max(axis=(1, 2), keepdims=True))


def sliding_stiffness_map(
    cell: MiuraCell, cells: tuple[int, int], attenuation: tuple[float, float]
) -> Floats:
    """K_B / k_bc where what presses lets the sheet slide, shape (N, M).

    It slides until its columns are as little strained as can be, which takes the mean out of
    their motion; `relative_stiffness_map` holds the loaded vertex in the plane, as the SI does.
    """
    parts = profiles(cell, cells, attenuation, -1.0)
    columns = parts.x.shape[1] * parts.y.shape[1]
    mean_x = parts.x.mean(axis=1)[:, None]
    mean_y = parts.zigzag.mean(axis=1)[:, None] + parts.y.mean(axis=1)
    held = relative_stiffness_map(cell, cells, attenuation)
    return np.asarray(held - columns * (mean_x**2 + mean_y**2))


def stiffness_terms(
    design: SkinDesign,
    attenuation: tuple[float, float],
    *,
    fold_from: FoldFrom = "length",
    crease_count: CreaseCount = "each_once",
    panel_energy: PanelEnergy = "neglected",
) -> StiffnessTerms:
    """What creases, columns and panels each hold against a press on each cell.

    Parameters
    ----------
    design : SkinDesign
    attenuation : tuple of float
        (v_aX, v_aY).
    fold_from : {"length", "width", "mean"}
        Which of a cell's two sizes gives its fold.
    crease_count : {"each_once", "printed"}
        Every crease once, or S16 and S19 to the letter.
    panel_energy : {"neglected", "bending", "bending_and_stretching"}
        What of the panels' energy to count.

    Notes
    -----
    Source: SI Eq. (S25).
    Valid for small presses.
    """
    cell, cells = design.cell, design.cells
    creases = relative_crease_stiffness_map(
        cell, cells, attenuation, fold_from=fold_from, count=crease_count
    )
    columns = column_response(
        design, attenuation, 0.0, kinematics="first_order", fold_from=fold_from
    )
    panels = np.zeros(cells)
    if panel_energy != "neglected":
        terms = panel_stiffness_map(cell, design.panels, cells, attenuation, fold_from=fold_from)
        panels = terms.bending if panel_energy == "bending" else terms.bending + terms.stretching
    return StiffnessTerms(
        creases=crease_stiffness(design.creases) * creases,
        columns=columns.stiffness,
        panels=panels,
    )
