"""The skin that a tessellated sheet belongs to, where one can be sensed on.

Decides which surfaces give a design, planes, cylinders and cones, and where magnets go on other
numbers of cells.
"""

from dataclasses import replace

import numpy as np

from smoskin.design.skin import Limb, MiuraCell, Provenance, SkinDesign
from smoskin.errors import DesignError
from smoskin.feasibility import check_design
from smoskin.origami.cell import size
from smoskin.origami.surface.analytic import Cone, Cylinder, Plane
from smoskin.origami.surface.surface import Surface
from smoskin.origami.tessellation.tessellate import Tessellation

_LEVEL = 2e-5
"""m: height over the surface that glue evens out under columns of one height."""


def skin_on(
    surface: Surface, name: str, design: SkinDesign, cell: MiuraCell, made: Tessellation
) -> tuple[SkinDesign | None, str]:
    """The design of a sheet on a surface of this name, or None and why there is none."""
    if not made.holds:
        return None, "geometry alone: the sheet fails a gate"
    if not isinstance(surface, Plane | Cylinder | Cone):
        return None, (
            "geometry alone: skins are sensed on planes, cylinders and cones; film and circuit are "
            "flat and cannot lie on a surface that is bent two ways"
        )
    if np.abs(made.lifts).max() > _LEVEL:
        return None, "geometry alone: columns of a skin that is sensed on are all equal"
    cells = (made.sheet.loaded.shape[0], made.sheet.loaded.shape[1])
    why = Provenance(origin="assumed", reason=f"a sheet on {name}")
    shares = [ours / theirs for ours, theirs in zip(cells, design.cells, strict=True)]
    changed = {"cells", "cell.panel_a", "cell.panel_b"}
    if cells != design.cells:
        changed |= {f"magnets.{k}.corner" for k in range(len(design.magnets))}
    limb = _limb(surface, cells[0] * float(size(cell).length))
    radii = ("skin_radius", "far_radius") if isinstance(surface, Cone) else ("skin_radius",)
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
            | ({f"limb.{radius}": why for radius in radii} if limb else {}),
        )
        check_design(skin)
    except DesignError as error:
        return None, f"geometry alone: {error}"
    return skin, ""


def _limb(surface: Plane | Cylinder | Cone, length: float) -> Limb | None:
    """The limb under a skin of this length along x, m, in the middle of a surface."""
    if isinstance(surface, Plane):
        return None
    if isinstance(surface, Cylinder):
        return Limb(skin_radius=surface.radius)
    wider = (surface.last - surface.first) / np.hypot(surface.last - surface.first, surface.height)
    middle = (surface.first + surface.last) / 2
    near, far = (float(middle + side * wider * length / 2) for side in (-1, 1))
    return Limb(skin_radius=near, far_radius=far)
