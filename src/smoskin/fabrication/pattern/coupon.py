"""What is cut beside the sheet: a coupon that measures kerf and creases, and rows on stock."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import shapely
from shapely import Polygon
from shapely.ops import linemerge

from smoskin.design.skin import SkinDesign
from smoskin.errors import DesignError
from smoskin.fabrication.drawing import Drawing, Label, Line
from smoskin.fabrication.pattern.flat import crease_gaps
from smoskin.fabrication.workshop import Workshop

BAR: Final = 0.1
"""m: length of the reference bar."""
_SLATS: Final = 10
"""Slats of the kerf comb; pushed together they are ten kerfs shorter."""
_SPACE: Final = 5e-3
"""m: between parts on stock."""


def coupon(design: SkinDesign, workshop: Workshop) -> Drawing:
    """A bar of 100 mm, a comb of ten slats, and a pair of tiles for each kind of gap.

    Bar and tiles are compensated for the kerf; the comb is not, so that it tells the kerf.
    """
    size = (0.12, 0.075)
    half = workshop.kerf / 2
    bar = shapely.box(0.01, 0.055, 0.01 + BAR, 0.065)
    lines = [Line("CUT", np.asarray(bar.buffer(half, join_style="mitre").exterior.coords)[:-1])]
    lines += [Line("PANEL", np.asarray(bar.exterior.coords)[:-1])]
    comb = 0.01 + 5e-3 * np.arange(_SLATS + 1)
    lines += [Line("CUT", np.array([[x, 0.035], [x, 0.05]]), False) for x in comb.tolist()]
    lines += [Line("CUT", np.array([[comb[0], y], [comb[-1], y]]), False) for y in (0.035, 0.05)]
    labels = [
        Label((0.012, 0.058), "100 mm", 3e-3),
        Label((0.065, 0.041), "kerf = (50 mm - length pushed together) / 10", 2e-3),
    ]
    at_a, at_b = crease_gaps(design, workshop)
    x = 0.01
    for name, gap in (
        ("a concave", at_a.concave),
        ("a convex", at_a.convex),
        ("b concave", at_b.concave),
        ("b convex", at_b.convex),
    ):
        bridge = shapely.box(x + 0.011, 0.0175, x + 0.013 + gap, 0.0175 + workshop.bridge)
        for tile in (
            shapely.box(x, 0.012, x + 0.012, 0.024),
            shapely.box(x + 0.012 + gap, 0.012, x + 0.024 + gap, 0.024),
        ):
            lines += _tile(tile, half, bridge)
        labels.append(Label((x, 0.007), f"{name} {1e3 * gap:.2f}", 2e-3))
        x += 0.0265
    corners = np.array([[0.0, 0.0], [size[0], 0.0], [size[0], size[1]], [0.0, size[1]]])
    return Drawing(
        name="coupon",
        title=f"{design.name} {design.content_hash[:12]}: cut this first: kerf, 100 mm, gaps",
        size=size,
        lines=(Line("CUT", corners), *lines),
        labels=tuple(labels),
    )


def _tile(tile: Polygon, half: float, bridge: Polygon) -> list[Line]:
    """A tile, finished and as it is cut, joined to its neighbour by a bridge."""
    path = tile.buffer(half, join_style="mitre").exterior.difference(bridge)
    return [
        Line("CUT", np.asarray(linemerge(path).coords), closed=False),
        Line("PANEL", np.asarray(tile.exterior.coords)[:-1]),
    ]


def rows_on_stock(drawings: Sequence[Drawing], workshop: Workshop, material: str) -> list[Drawing]:
    """Drawings of one material laid in rows on as many sheets of stock as they need.

    Raises
    ------
    DesignError
        If one is larger than the stock.
    """
    wide, high = workshop.stock
    sheets: list[list[Drawing]] = [[]]
    x = y = row = _SPACE
    for drawing in drawings:
        turned = not _fits(drawing.size, workshop.stock)
        width, height = drawing.size[::-1] if turned else drawing.size
        if not _fits((width, height), workshop.stock):
            needed = [side + 2 * _SPACE for side in drawing.size]
            raise DesignError(
                f"workshop.stock must hold the drawing {drawing.name!r} with {1e3 * _SPACE:g} mm "
                f"round it, {1e3 * needed[0]:.0f} x {1e3 * needed[1]:.0f} mm; got "
                f"{1e3 * wide:.0f} x {1e3 * high:.0f} mm: take fewer or smaller cells"
            )
        if x + width + _SPACE > wide:
            x, y = _SPACE, row
        if y + height + _SPACE > high:
            sheets.append([])
            x = y = row = _SPACE
        sheets[-1].append(drawing.moved((x, y), turned=turned))
        x, row = x + width + _SPACE, max(row, y + height + _SPACE)
    corners = np.array([[0.0, 0.0], [wide, 0.0], [wide, high], [0.0, high]])
    return [
        replace(
            parts[0],
            name=f"stock_{material}_{k + 1}",
            title=f"{material} stock {k + 1} of {len(sheets)}: "
            + ", ".join(part.name for part in parts),
            size=workshop.stock,
            lines=(Line("OUTLINE", corners), *(line for part in parts for line in part.lines)),
            circles=tuple(circle for part in parts for circle in part.circles),
            labels=tuple(label for part in parts for label in part.labels),
        )
        for k, parts in enumerate(sheets)
        if parts
    ]


def _fits(size: tuple[float, float], stock: tuple[float, float]) -> bool:
    """Whether a drawing lies on stock with space round it."""
    return all(part + 2 * _SPACE <= whole for part, whole in zip(size, stock, strict=True))
