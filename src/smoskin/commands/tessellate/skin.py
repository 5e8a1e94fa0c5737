"""The skin that a tessellated sheet belongs to, where one can be sensed on.

Decides which surfaces give a design, planes and cylinders, and where magnets go on other numbers
of cells.
"""

from dataclasses import replace

import numpy as np

from smoskin.design.skin import Limb, MiuraCell, Provenance, SkinDesign
from smoskin.errors import DesignError
from smoskin.feasibility import check_design
from smoskin.origami.surface.analytic import Cylinder, Plane
from smoskin.origami.surface.surface import Surface
from smoskin.origami.tessellation.tessellate import Tessellation

_EXACT = 1e-9
"""m: height over the surface up to which all columns are equal."""


def skin_on(
    surface: Surface, name: str, design: SkinDesign, cell: MiuraCell, made: Tessellation
) -> tuple[SkinDesign | None, str]:
    """The design of a sheet on a surface of this name, or None and why there is none."""
    if not isinstance(surface, Plane | Cylinder):
        return None, "geometry alone: skins are sensed on planes and cylinders"
    if np.abs(made.lifts).max() > _EXACT:
        return None, "geometry alone: columns of a skin that is sensed on are all equal"
    cells = (made.sheet.loaded.shape[0], made.sheet.loaded.shape[1])
    why = Provenance(origin="assumed", reason=f"a sheet on {name}")
    shares = [ours / theirs for ours, theirs in zip(cells, design.cells, strict=True)]
    changed = {"cells", "cell.panel_a", "cell.panel_b", "limb.skin_radius"}
    if cells != design.cells:
        changed |= {f"magnets.{k}.corner" for k in range(len(design.magnets))}
    limb = Limb(skin_radius=surface.radius) if isinstance(surface, Cylinder) else None
    try:
        skin = replace(
            design,
            name=f"{design.name} on {name}",
            cells=cells,
            cell=cell,
            limb=limb,
            magnets=tuple(
                replace(magnet, corner=(round(p * shares[0]), round(q * shares[1])))
                for magnet in design.magnets
                for p, q in [magnet.corner]
            ),
            provenance={
                path: why if path in changed else origin
                for path, origin in design.provenance.items()
            }
            | ({"limb.skin_radius": why} if limb else {}),
        )
        check_design(skin)
    except DesignError as error:
        return None, f"geometry alone: {error}"
    return skin, ""
