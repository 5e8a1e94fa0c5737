"""What the figures draw, as arrays: Poisson's ratios and stiffness maps."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from paper.models.stiffness_terms import FIGURE_S7_ATTENUATIONS, normalised_stiffness_maps
from smoskin.arrays import Floats
from smoskin.design.skin import Magnet, MiuraCell, SkinDesign
from smoskin.errors import ArgumentError
from smoskin.mechanics.reduced.stiffness import relative_stiffness_map
from smoskin.origami.cell import poisson_ratios
from smoskin.sensing.closed_form.location import Zone

CELLS: Final = (6, 6)
"""The cells of the SI's skin: nine zones of two by two (Figure S5)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoissonMap:
    """Out-of-plane Poisson's ratios of a cell (Figure S1); NaN where it cannot fold."""

    sector_angle: Floats
    """(A,), rad."""
    fold_angle: Floats
    """(P,), rad."""
    nu_13: Floats
    """(A, P)."""
    nu_23: Floats
    """(A, P)."""
    reference: tuple[float, float]
    """alpha and phi of the design, rad."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StiffnessMap:
    """Stiffness of a press on each cell over the stiffest cell's (one part of Figure S7)."""

    attenuation: float
    """v_aX = v_aY."""
    relative: Floats
    """(N, M): K_B / k_bc."""

    normalised: Floats
    """(N, M): the same over its largest value."""


def poisson_map(design: SkinDesign, steps: int = 121) -> PoissonMap:
    """Both ratios over all angles at which a cell can fold."""
    angles = np.radians(np.linspace(5.0, 85.0, steps))
    nu_13 = np.full((steps, steps), np.nan)
    nu_23 = nu_13.copy()
    for row, alpha in enumerate(angles):
        cell = MiuraCell(panel_a=0.01, panel_b=0.01, sector_angle=alpha, fold_angle=alpha / 2)
        foldable = angles < alpha
        ratios = poisson_ratios(cell, angles[foldable])
        nu_13[row, foldable], nu_23[row, foldable] = ratios.nu_13, ratios.nu_23
    return PoissonMap(
        sector_angle=angles,
        fold_angle=angles,
        nu_13=nu_13,
        nu_23=nu_23,
        reference=(design.cell.sector_angle, design.cell.fold_angle),
    )


def sheet_magnets(design: SkinDesign) -> tuple[Magnet, Magnet]:
    """Magnets 2 and 3 of the SI: those of the sheet, in the order of their chips.

    Raises
    ------
    ArgumentError
        If the design is not of the SI's layout.
    """
    watched = [design.magnet(site.magnet) for site in design.halls]
    upper = [magnet for magnet in watched if magnet.mount == "sheet"]
    if len(upper) != 2 or design.cells != CELLS:
        raise ArgumentError(
            "design must have 6 x 6 cells and two magnets on the sheet, as the paper's skin; got "
            f"{design.cells[0]} x {design.cells[1]} cells and {len(upper)} magnets"
        )
    return upper[0], upper[1]


def signs_text(zone: Zone) -> str:
    """Signs of dS2x, dS2y, dS3x, dS3y such as ``"--+-"``, as Table S1 prints them."""
    return "".join("+" if sign > 0 else "-" for sign in zone.signs)


def stiffness_maps(design: SkinDesign) -> tuple[StiffnessMap, ...]:
    """The nine maps of Figure S7, columns only."""
    normalised = normalised_stiffness_maps(design.cell, design.cells)
    return tuple(
        StiffnessMap(
            attenuation=v,
            relative=relative_stiffness_map(design.cell, design.cells, (v, v)),
            normalised=part,
        )
        for v, part in zip(FIGURE_S7_ATTENUATIONS, normalised, strict=True)
    )
