"""The flat sheet as it is cut: where creases lie, how wide their gaps are, and what panels remain.

Decides the gap on either face of the film, and by how much less than the pitch of ideal creases the
pattern has where film bends evenly across its gap.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.workshop import Workshop
from smoskin.origami.cell import dihedral_angles
from smoskin.origami.geometry import geometry

LEAST_PANEL: Final = 2e-3
"""m: width of a panel that can be handled and bonded."""
_HOLE: Final = 1.5
"""Diameter of a vertex's hole over the widest gap."""


class Gaps(NamedTuple):
    """Gap between panels at a kind of crease, m."""

    concave: float
    """On the face towards which panels fold."""
    convex: float
    """On the other face: the free length of the film, by which the crease is as soft as it is."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlatSheet:
    """A sheet laid flat, seen from above; y starts at the lowest vertex, x at the left ones."""

    vertices: Floats
    """(V, 2), m: crossings of the creases."""
    facets: Ints
    """(F, 4): vertices of each panel, counter-clockwise."""
    upper: Floats
    """(F, 4), m: from each of a panel's edges to the crease beside it, on the upper face."""
    lower: Floats
    """(F, 4), m: the same on the lower face."""
    creases: Ints
    """(C, 2)"""
    mountain: Ints
    """(C,): 1 for a ridge seen from above."""
    rim: Ints
    """Vertices round the rim, counter-clockwise."""
    inner: Ints
    """Vertices inside the rim, where holes are."""
    hole: float
    """m: radius of the vertices' holes."""
    at_a: Gaps
    at_b: Gaps

    @property
    def extent(self) -> Floats:
        """(2,), m: largest x and y."""
        return np.asarray(self.vertices.max(axis=0))


def needed_gap(plate: float, fold: float, workshop: Workshop) -> float:
    """Narrowest gap on the concave face at which panels fold by `fold`, rad, from flat, m.

    Notes
    -----
    Source: two plates of thickness t that turn about a line in the film's middle touch at
    2 t tan(fold / 2). A film that bends evenly over the length L needs 2 L tan(fold / 2) / fold - L
    less. On top come the workshop's clearance and its kerf, so that panels whose outlines were
    compensated for the kerf twice still fold.

    Examples
    --------
    >>> from math import pi
    >>> round(1e3 * needed_gap(0.65e-3, pi / 2, Workshop()), 2)
    1.55
    """
    return 2 * plate * float(np.tan(fold / 2)) + workshop.kerf + workshop.crease_clearance


def bend_allowance(gap: float, fold: float) -> float:
    """Length by which panels come further apart when the film between them bends evenly, m.

    Notes
    -----
    Source: an arc of length g turned by psi; its end tangents meet g tan(psi / 2) / psi from either
    end. Zero for a film that bends in one line.

    Examples
    --------
    >>> from math import radians
    >>> round(1e3 * bend_allowance(1.2e-3, radians(80.8)), 3)
    0.248
    """
    return gap * float(2 * np.tan(fold / 2) / fold - 1)


def crease_gaps(design: SkinDesign, workshop: Workshop) -> tuple[Gaps, Gaps]:
    """Gaps at the a- and the b-creases."""
    free, plate = design.creases.gap, workshop.plate(design)
    folds = [float(np.pi - angle) for angle in dihedral_angles(design.cell)]
    at_a, at_b = (
        Gaps(concave=max(free, needed_gap(plate, fold, workshop)), convex=free) for fold in folds
    )
    return at_a, at_b


def flat_sheet(design: SkinDesign, workshop: Workshop) -> FlatSheet:
    """The flat sheet of a design that folds to it.

    Raises
    ------
    DesignError
        If gaps leave no panels between them.

    Examples
    --------
    >>> from smoskin.design.document import read_design
    >>> sheet = flat_sheet(read_design("planar"), Workshop())
    >>> (1e3 * sheet.extent).round(1), [round(1e3 * gap, 2) for gap in sheet.at_b]
    (array([134.2, 191.6]), [1.38, 1.2])
    """
    at_a, at_b = crease_gaps(design, workshop)
    _check_panels(design, at_a, at_b)
    columns, rows = 2 * design.cells[0], 2 * design.cells[1]
    vertices = _vertices(design, workshop)
    sheet = geometry(design).sheet
    index = np.arange((columns + 1) * (rows + 1)).reshape(columns + 1, rows + 1)
    rim = [index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]]
    insets = []
    for upper in (True, False):
        # A ridge opens above: the face towards which panels fold is the lower one.
        concave = sheet.mountain != upper
        a, b = (np.where(concave, gap.concave, gap.convex) / 2 for gap in (at_a, at_b))
        half = dict(
            zip(map(tuple, sheet.creases.tolist()), np.where(sheet.along_a, a, b), strict=True)
        )
        sides = [[(f[k], f[(k + 1) % 4]) for k in range(4)] for f in sheet.facets.tolist()]
        insets.append([[half.get((min(s), max(s)), 0.0) for s in four] for four in sides])
    return FlatSheet(
        vertices=vertices,
        facets=sheet.facets,
        upper=np.array(insets[0]),
        lower=np.array(insets[1]),
        creases=sheet.creases,
        mountain=sheet.mountain.astype(np.int64),
        rim=np.concatenate(rim),
        inner=index[1:-1, 1:-1].ravel(),
        hole=_HOLE * max(*at_a, *at_b) / 2,
        at_a=at_a,
        at_b=at_b,
    )


def outlines(sheet: FlatSheet, insets: Floats) -> Floats:
    """Corners of the panels within their gaps, (F, 4, 2), m, before vertices are holed."""
    corners = sheet.vertices[sheet.facets]
    sides = np.roll(corners, -1, axis=1) - corners
    sides /= np.linalg.norm(sides, axis=2, keepdims=True)
    inward = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    reach = (inward * corners).sum(axis=2) + insets
    # A corner lies on its own edge's line and on the one before.
    lines = np.stack([np.roll(inward, 1, axis=1), inward], axis=2)
    reaches = np.stack([np.roll(reach, 1, axis=1), reach], axis=2)
    return np.asarray(np.linalg.solve(lines, reaches[..., None])[..., 0])


def _vertices(design: SkinDesign, workshop: Workshop) -> Floats:
    """Crossings of the creases, (V, 2), m."""
    cell, free = design.cell, design.creases.gap
    folds = [float(np.pi - angle) for angle in dihedral_angles(cell)]
    even = float(workshop.bend == "even")
    by_a, by_b = (even * bend_allowance(free, fold) for fold in folds)
    steps_x = np.full(2 * design.cells[0], cell.panel_b * np.sin(cell.sector_angle) - by_a)
    steps_y = np.full(2 * design.cells[1], cell.panel_a - by_b / np.sin(cell.sector_angle))
    # At the rim there is no crease on the outer side.
    steps_x[[0, -1]] += by_a / 2
    steps_y[[0, -1]] += by_b / (2 * np.sin(cell.sector_angle))
    x, y = (np.concatenate([[0.0], np.cumsum(steps)]) for steps in (steps_x, steps_y))
    down = np.where(np.arange(len(steps_x)) % 2 == 0, -1.0, 1.0)
    zigzag = np.concatenate([[0.0], np.cumsum(down * steps_x / np.tan(cell.sector_angle))])
    zigzag -= zigzag.min()
    places = np.stack([np.broadcast_to(x[:, None], (len(x), len(y))), zigzag[:, None] + y], axis=-1)
    return places.reshape(-1, 2)


def _check_panels(design: SkinDesign, at_a: Gaps, at_b: Gaps) -> None:
    """Refuse gaps that leave no panel."""
    cell = design.cell
    heights = {
        "a": (cell.panel_b * np.sin(cell.sector_angle), max(at_a)),
        "b": (cell.panel_a * np.sin(cell.sector_angle), max(at_b)),
    }
    for name, (height, gap) in heights.items():
        if height - gap < LEAST_PANEL:
            raise DesignError(
                f"gaps of the {name}-creases must leave panels at least {1e3 * LEAST_PANEL:g} mm "
                f"wide; got a gap of {1e3 * gap:.2f} mm in panels {1e3 * float(height):.2f} mm wide"
            )
