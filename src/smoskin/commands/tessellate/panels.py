"""How thick the panels of a sheet on a surface are.

Decides that a press must fold its cell nearly as it does on a plane, and from which plates panels
are made where those of the design are too stiff for that: a press on a limb bends the panels round
its cell, whose stiffness goes with the cube of their thickness.
"""

from dataclasses import dataclass, replace
from typing import Final

from smoskin.design.materials import PLATES
from smoskin.design.skin import Provenance, SkinDesign
from smoskin.mechanics.sheet.foldability import fold_shares
from smoskin.mechanics.sheet.lattice import springs_of
from smoskin.origami.tessellation.tessellate import Tessellation

LEAST_SHARE: Final = 0.85
"""Least share of a small press that folds its cell, over that on a plane with the same panels; of
one of a newton, by the whole model, up to 0.06 less is left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Panelled:
    """A design with the panels that were chosen for a sheet, and why."""

    design: SkinDesign
    fold_share: float
    """Mean share of a small press that folds the pressed cell."""
    planar_fold_share: float
    """The same of the planar sheet of the same cells, panels, creases and columns."""
    reason: str = ""

    @property
    def relative(self) -> float:
        """Share of a press that folds its cell, over the planar sheet's."""
        return self.fold_share / self.planar_fold_share


def thinner_plates(plate: float) -> tuple[float, ...]:
    """Plates that are sold and thinner than one of this thickness, m, thickest first."""
    return tuple(sold for sold in PLATES if sold < plate)


def panels_for(design: SkinDesign, made: Tessellation, planar: Tessellation) -> Panelled:
    """The thickest panels, of those that a sheet has room for, with which a press folds its cell.

    Where the sheet does not fold by its creases alone, or no plates let a press fold a cell as it
    should, the thickest that there is room for are kept.
    """
    panels, reason = _chosen(design, made, planar)
    chosen = panels.design
    if chosen != design:
        why = Provenance(origin="assumed", reason=reason)
        chosen = replace(chosen, provenance={**chosen.provenance, "panels.thickness": why})
    return replace(panels, design=chosen, reason=reason)


def _chosen(design: SkinDesign, made: Tessellation, planar: Tessellation) -> tuple[Panelled, str]:
    """Panels, and why these."""
    own, first = design.panels.thickness / 2, _with(design, made.plate, made, planar)
    why = f"plates of {_mm(made.plate)}, as in {design.name}"
    if made.plate < own:
        why = f"plates of {_mm(made.plate)}, as creases leave no room for {_mm(own)}"
    if not made.folds:
        return first, why
    folding = f"a press folds its cell by {first.relative:.3f} of what it does on a plane"
    if first.relative >= LEAST_SHARE:
        return first, f"{why}; {folding}"
    for plate in thinner_plates(made.plate):
        panels = _with(design, plate, made, planar)
        if panels.relative >= LEAST_SHARE:
            why = f"plates of {_mm(plate)}, as with {_mm(made.plate)} {folding}"
            return panels, f"{why}, with these by {panels.relative:.3f}"
    return first, f"{why}; {folding}, and with no plates that are sold by {LEAST_SHARE}"


def _with(design: SkinDesign, plate: float, made: Tessellation, planar: Tessellation) -> Panelled:
    """A design with plates of a thickness, m, and the shares of a press that fold with them."""
    if 2 * plate != design.panels.thickness:
        design = replace(design, panels=replace(design.panels, thickness=2 * plate))
    springs = springs_of(design)
    on, off = (
        float(fold_shares(sheet.sheet, sheet.normals, springs).mean()) for sheet in (made, planar)
    )
    return Panelled(design=design, fold_share=on, planar_fold_share=off)


def _mm(length: float) -> str:
    """A length in mm."""
    return f"{1e3 * length:g} mm"
