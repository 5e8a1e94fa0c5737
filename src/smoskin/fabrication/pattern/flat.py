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
from smoskin.origami.tessellation.hinges import fold_angles, frame_of
from smoskin.origami.tessellation.unfold import by_lengths, unfold

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
    """A sheet laid flat, seen from above; x and y start at the lowest vertices."""

    vertices: Floats
    """(V, 2), m: crossings of the creases."""
    facets: Ints
    """(F, 4): vertices of each panel, counter-clockwise."""
    upper: Floats
    """(F, 4), m: from each of a panel's edges to the crease beside it, on the upper face."""
    lower: Floats
    """(F, 4), m: the same on the lower face."""
    allowances: Floats
    """(F, 4), m: by how much less than the folded panel's the distance from each edge to its
    opposite one is here, as film bends beside that edge."""
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


def crease_folds(design: SkinDesign) -> Floats:
    """Fold of each crease from flat, (C,), rad, without its sign."""
    if design.limb is None:
        at_a, at_b = (float(np.pi - angle) for angle in dihedral_angles(design.cell))
        return np.where(geometry(design).sheet.along_a, at_a, at_b)
    sheet = geometry(design).sheet
    hinges = frame_of(sheet.vertices, sheet.facets, sheet.creases).creases
    return np.abs(fold_angles(sheet.vertices, hinges))


def fold_at_b(design: SkinDesign, *, ridge: bool) -> float:
    """Fold of the b-creases of the top rows, or of the bottom ones, from flat, rad."""
    sheet = geometry(design).sheet
    return float(crease_folds(design)[~sheet.along_a & (sheet.mountain == ridge)].mean())


def crease_gaps(design: SkinDesign, workshop: Workshop) -> tuple[Gaps, Gaps]:
    """Gaps at the a- and the b-creases, as wide as those that fold furthest need."""
    free, plate = design.creases.gap, workshop.plate(design)
    folds, along_a = crease_folds(design), geometry(design).sheet.along_a
    at_a, at_b = (
        Gaps(concave=max(free, needed_gap(plate, float(fold), workshop)), convex=free)
        for fold in (folds[along_a].max(), folds[~along_a].max())
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
    sheet = geometry(design).sheet
    even = float(workshop.bend == "even")
    bent = [even * bend_allowance(design.creases.gap, f) / 2 for f in crease_folds(design)]
    allowances = beside_panels(sheet.facets, sheet.creases, np.array(bent))
    lay = _in_strips if geometry(design).roll.rise == 0.0 else _by_lengths
    vertices = lay(design, allowances)
    index = np.arange((columns + 1) * (rows + 1)).reshape(columns + 1, rows + 1)
    rim = [index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]]
    insets = []
    for upper in (True, False):
        # A ridge opens above: the face towards which panels fold is the lower one.
        concave = sheet.mountain != upper
        a, b = (np.where(concave, gap.concave, gap.convex) / 2 for gap in (at_a, at_b))
        widths = np.where(sheet.along_a, a, b)
        insets.append(beside_panels(sheet.facets, sheet.creases, widths))
    return FlatSheet(
        vertices=vertices,
        facets=sheet.facets,
        upper=insets[0],
        lower=insets[1],
        allowances=allowances,
        creases=sheet.creases,
        mountain=sheet.mountain.astype(np.int64),
        rim=np.concatenate(rim),
        inner=index[1:-1, 1:-1].ravel(),
        hole=_HOLE * max(*at_a, *at_b) / 2,
        at_a=at_a,
        at_b=at_b,
    )


def beside_panels(facets: Ints, creases: Ints, values: Floats) -> Floats:
    """What creases (C, 2) have, (C,), at the edges of each facet, (F, 4); nothing at the rim."""
    by_crease = dict(zip(map(tuple, creases.tolist()), values.tolist(), strict=True))
    edges = np.sort(np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1), axis=-1)
    return np.array([[by_crease.get((p, q), 0.0) for p, q in four] for four in edges.tolist()])


def outlines(sheet: FlatSheet, insets: Floats) -> Floats:
    """Corners of the panels within their gaps, (F, 4, 2), m, before vertices are holed."""
    return within_edges(sheet.vertices[sheet.facets], insets)


def within_edges(corners: Floats, insets: Floats) -> Floats:
    """Corners of quadrilaterals (F, 4, 2) whose edges move inward, (F, 4), m."""
    sides = np.roll(corners, -1, axis=1) - corners
    sides /= np.linalg.norm(sides, axis=2, keepdims=True)
    inward = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    reach = (inward * corners).sum(axis=2) + insets
    # A corner lies on its own edge's line and on the one before.
    lines = np.stack([np.roll(inward, 1, axis=1), inward], axis=2)
    reaches = np.stack([np.roll(reach, 1, axis=1), reach], axis=2)
    return np.asarray(np.linalg.solve(lines, reaches[..., None])[..., 0])


def sides_of(facets: Ints, panels: Floats) -> tuple[Ints, Floats]:
    """Pairs of vertices (6 F, 2) of panels (F, 4, 2), m: sides and diagonals, and their lengths."""
    ends = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]])
    spans = panels[:, ends[:, 0]] - panels[:, ends[:, 1]]
    return facets[:, ends].reshape(-1, 2), np.linalg.norm(spans, axis=2).ravel()


def _by_lengths(design: SkinDesign, allowances: Floats) -> Floats:
    """Crossings of the creases, (V, 2), m, on a cone: nearest to the panels less their allowances.

    No two panels along a generator are alike, so that less their allowances they no longer tile:
    round a forearm that grows by 20 mm on 120, corners are off by 0.010 mm.
    """
    skin = geometry(design)
    facets = skin.sheet.facets
    whole, _ = unfold(skin.sheet.vertices, facets, skin.developed[:, :2])
    places = by_lengths(whole, *sides_of(facets, within_edges(whole[facets], allowances)))
    return np.asarray(places - places.min(axis=0))


def _in_strips(design: SkinDesign, allowances: Floats) -> Floats:
    """Crossings of the creases, (V, 2), m, of the folded panels less their allowances.

    Panels hang together in straight strips: a-creases above each other lie on one line, as vertices
    fold flat, and panels beside each other are mirror images.
    """
    skin = geometry(design)
    corners = skin.sheet.vertices[skin.sheet.facets]
    right = corners[:, 1] - corners[:, 0]
    up = corners[:, 3] - corners[:, 0]
    along = up / np.linalg.norm(up, axis=1, keepdims=True)
    across = right - (right * along).sum(axis=1, keepdims=True) * along
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    arms = corners - corners[:, :1]
    flat = np.stack([np.einsum("fkd,fd->fk", arms, axis) for axis in (across, along)], axis=-1)
    columns, rows = 2 * design.cells[0], 2 * design.cells[1]
    panels = within_edges(flat, allowances).reshape(columns, rows, 4, 2)
    steps_x = panels[:, 0, 1, 0] - panels[:, 0, 0, 0]
    left = panels[:, :, 3, 1] - panels[:, :, 0, 1]
    last = panels[-1:, :, 2, 1] - panels[-1:, :, 1, 1]
    steps_y = np.concatenate([left, last])
    zigzag = np.concatenate([[0.0], np.cumsum(panels[:, 0, 1, 1] - panels[:, 0, 0, 1])])
    x = np.concatenate([[0.0], np.cumsum(steps_x)])
    start = np.zeros((columns + 1, 1))
    y = np.concatenate([start, np.cumsum(steps_y, axis=1)], axis=1) + zigzag[:, None]
    places = np.stack([np.broadcast_to(x[:, None], y.shape), y - y.min()], axis=-1)
    return np.asarray(places.reshape(-1, 2))


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
