"""
Folded sheets on surfaces
=========================

The paper shows one curved skin. Sheets of 6 x 6 reference cells on six surfaces, each cut from one
flat pattern, and what of a small press folds the pressed cell there: where creases alone cannot
fold, a press finds a stiffer sheet.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from paper.shared.setting import CELLS, Setting
from paper.shared.style import BLUE, INK, ORANGE, Plate, canvas, lay_out, styled
from smoskin.design.skin import SkinDesign
from smoskin.mechanics.sheet.foldability import fold_shares
from smoskin.mechanics.sheet.lattice import springs_of
from smoskin.origami.surface.analytic import Bump, Cone, Cylinder, Plane, Saddle, Sphere
from smoskin.origami.surface.surface import Surface
from smoskin.origami.tessellation.tessellate import Tessellation, tessellate

SURFACES: Final[Mapping[str, Surface]] = {
    "plane": Plane(),
    "cylinder, 80 mm": Cylinder(0.08),
    "cone, 60 to 80 mm": Cone(0.06, 0.08, 0.15),
    "sphere, 200 mm": Sphere(0.2),
    "saddle, 150 mm": Saddle(0.15),
    "bump, 10 mm high": Bump(0.01, 0.05),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attached:
    """A sheet on a surface."""

    made: Tessellation
    share: float
    """Share of a small press that folds its cell, the mean of all cells."""


def attached(design: SkinDesign, surface: Surface, cells: tuple[int, int] = CELLS) -> Attached:
    """The sheet of a design's cells on a surface, and how it folds there."""
    made = tessellate(
        surface,
        design.cell,
        cells,
        plate=design.panels.thickness / 2,
        column=design.columns.height,
        refold=False,
    )
    share = fold_shares(made.sheet, made.normals, springs_of(design)).mean()
    return Attached(made=made, share=float(share))


# %%
# Drawn


def plate(setting: Setting) -> Plate:
    """Sheets on all surfaces, blue where creases alone let them fold."""
    return draw({name: attached(setting.design, each) for name, each in SURFACES.items()})


def draw(sheets: Mapping[str, Attached]) -> Plate:
    """The sheets in space, and what of a press folds."""
    with styled():
        figure = canvas(7.2, 4.6)
        for k, (name, each) in enumerate(sheets.items()):
            axis: Any = figure.add_subplot(2, 3, k + 1, projection="3d")
            made = each.made
            colour = BLUE if made.folds else ORANGE
            panels = 1e3 * made.sheet.vertices[made.sheet.facets]
            axis.add_collection3d(
                Poly3DCollection(
                    panels, facecolors=colour, edgecolors=INK, linewidths=0.2, shade=True
                )
            )
            low, high = panels.min(axis=(0, 1)), panels.max(axis=(0, 1))
            half = float((high - low).max()) / 2
            for letter, middle in zip("xyz", (low + high) / 2, strict=True):
                axis.set(**{f"{letter}lim": (middle - half, middle + half)})
            axis.set_axis_off()
            stiff = "" if made.folds else ", locked"
            gates = "" if made.holds else ", fails a gate"
            axis.set_title(f"{name}: {100 * each.share:.0f} %{stiff}{gates}")
        lay_out(figure)
    shares = [each.share for each in sheets.values()]
    bent_once = [each.share for each in sheets.values() if each.made.folds]
    locked = [each.share for each in sheets.values() if not each.made.folds]
    spread = f"{100 * np.min(bent_once):.0f} to {100 * np.max(bent_once):.0f} %"
    return Plate(
        name="curved_sheets",
        title="Folded sheets on surfaces",
        caption=f"Not in the paper: {len(shares)} sheets of 6 x 6 reference cells, each from one "
        "flat pattern, bottom vertices on the surface, and the share of a small press that folds "
        f"the pressed cell, with columns along the normals and no frame. Blue: creases alone let "
        f"the sheet fold, {spread}. Orange: panels would have to bend, as on surfaces bent two "
        f"ways, {', '.join(f'{100 * share:.0f}' for share in locked)} %; columns of their own "
        "heights let such sheets fold too (`smoskin tessellate --own-columns`).",
        figure=figure,
    )


if __name__ == "__main__":
    plate(Setting()).show()
