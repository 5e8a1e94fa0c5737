"""The reduced model against the whole sheet: with which v_a it fits, and what it would need.

Decides which of the SI's assumptions are granted to the whole sheet, one after the other, and
how columns are varied. Fits are `paper.models.reduction`'s.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from paper.models.reduction import (
    Reduction,
    UnitPresses,
    fit_columns,
    fit_magnets,
    fit_stiffness,
    signs_agree,
    unit_presses,
)
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.lattice import Springs, build_lattice, springs_of
from smoskin.mechanics.sheet.touches import Covered, Grip, Sticking

if TYPE_CHECKING:
    from smoskin.arrays import Bools

AXIALLY_RIGID: Final = 1e4
"""Factor on the columns' axial stiffness at which they hardly sink any more."""
_RIGID_BENDING, _RIGID_MEMBRANE = 1e3, 10.0
"""Factors on the panels' stiffness at which cells fold, and hardly anything else."""
AXIAL_FACTORS: Final = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, AXIALLY_RIGID)
"""On the designed axial stiffness; shear as designed."""
COLUMN_SIZES: Final = (
    (1.5e-3, 10e-3), (1.5e-3, 2.5e-3), (3e-3, 2.5e-3), (4.5e-3, 2.5e-3), (4.5e-3, 1.25e-3),
)  # fmt: skip
"""m: radius and height of columns that a mould could make; at 4.5 mm neighbours nearly touch."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Variant:
    """The whole sheet with some of the SI's assumptions granted, and the model fitted to it."""

    name: str
    """What is granted."""
    presses: UnitPresses
    columns: Reduction
    """Fitted to the columns' motion, its scale too."""
    unscaled: Reduction
    """The same with the whole press folding the cell, as the SI has it."""
    magnets: Reduction
    """Fitted to the magnets' motion, its scale too."""
    stiffness: Reduction
    """v_a and v_s by the SI's own procedure."""
    agree: "Bools"
    """(N, M, 2, 2): signs of both magnets' motion along both axes are Table S1's."""

    @property
    def cells_agreeing(self) -> int:
        """Cells with all four signs of Table S1."""
        return int(self.agree.all(axis=(2, 3)).sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnSize:
    """What columns of one size would change."""

    radius: float
    """m."""
    height: float
    """m."""
    axial: float
    """N/m."""
    folding: float
    """Share of the sink that folds the pressed cell, mean over all cells."""
    stiffness: float
    """N/m, mean over all cells."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assumptions:
    """All variants, and how the share of folding hangs on the columns."""

    variants: tuple[Variant, ...]
    """As built first."""
    axial_factors: tuple[float, ...]
    """On the designed axial stiffness."""
    folding: tuple[float, ...]
    """Share of the sink that folds the pressed cell, with the frame."""
    folding_free: tuple[float, ...]
    """The same without the frame."""
    sizes: tuple[ColumnSize, ...]


def assumptions(design: SkinDesign) -> Assumptions:
    """Press the whole sheet in all its variants."""
    springs = springs_of(design)
    free = replace(springs, frame=0.0)
    hard = _axially(springs, AXIALLY_RIGID)
    rigid = replace(
        hard,
        panel_bending=_RIGID_BENDING * springs.panel_bending,
        panel_membrane=_RIGID_MEMBRANE * springs.panel_membrane,
    )
    cases: tuple[tuple[str, Springs, Grip], ...] = (
        ("as built, a finger sticks", springs, Sticking()),
        ("loaded vertex guided along z", springs, Covered()),
        ("guided, no frame", free, Covered()),
        ("guided, columns rigid along z", hard, Covered()),
        ("... and no frame", replace(hard, frame=0.0), Covered()),
        ("... and nearly rigid panels", replace(rigid, frame=0.0), Covered()),
    )
    return Assumptions(
        variants=tuple(_variant(name, _pressed(design, made, grip)) for name, made, grip in cases),
        axial_factors=AXIAL_FACTORS,
        folding=tuple(_folding(design, _axially(springs, k)) for k in AXIAL_FACTORS),
        folding_free=tuple(_folding(design, _axially(free, k)) for k in AXIAL_FACTORS),
        sizes=tuple(_column_size(design, radius, height) for radius, height in COLUMN_SIZES),
    )


def _axially(springs: Springs, factor: float) -> Springs:
    """Columns so many times as stiff along z."""
    return replace(springs, column_axial=factor * springs.column_axial)


def _pressed(design: SkinDesign, springs: Springs, grip: Grip) -> UnitPresses:
    from smoskin.mechanics.sheet.model import BarHinge

    return unit_presses(BarHinge(design, grip=grip, lattice=build_lattice(design, springs)))


def _folding(design: SkinDesign, springs: Springs) -> float:
    """Share of the sink that folds the pressed cell, mean over all cells."""
    return float(_pressed(design, springs, Covered()).folding.mean())


def _variant(name: str, presses: UnitPresses) -> Variant:
    return Variant(
        name=name,
        presses=presses,
        columns=fit_columns(presses),
        unscaled=fit_columns(presses, scale=1.0),
        magnets=fit_magnets(presses),
        stiffness=fit_stiffness(presses),
        agree=signs_agree(presses),
    )


def _column_size(design: SkinDesign, radius: float, height: float) -> ColumnSize:
    made = replace(design, columns=replace(design.columns, radius=radius, height=height))
    springs = springs_of(made)
    presses = _pressed(made, springs, Covered())
    return ColumnSize(
        radius=radius,
        height=height,
        axial=springs.column_axial,
        folding=float(presses.folding.mean()),
        stiffness=float(presses.stiffness.mean()),
    )
