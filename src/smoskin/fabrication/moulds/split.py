"""Parts larger than a printer's bed, cut into pieces that are pinned together again."""

from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.errors import DesignError
from smoskin.fabrication.moulds.solids import Part, disc, prism

_PIN: Final = 1.1e-3
"""m: radius of the holes for pins of 2 mm across a joint."""
_DEEP: Final = 8e-3
"""m: depth of such a hole on either side."""
_WITHIN: Final = 0.9
"""Least share of such a hole that lies in the part."""
_STEP: Final = 0.5e-3
"""m: between places where a cut is tried."""


def split(
    part: Part, bed: tuple[float, float, float], features: Floats | None = None
) -> list[Part]:
    """A part in pieces that a bed holds, cut as far as can be from features (K, 2), m.

    Pieces thick enough get holes for two pins of 2 mm across each joint along x and y.

    Raises
    ------
    DesignError
        If the part is higher than the printer.
    """
    size = part.size
    if size[2] > bed[2]:
        raise DesignError(
            f"{part.name} must be at most {1e3 * bed[2]:.0f} mm high, what the printer makes; got "
            f"{1e3 * size[2]:.1f} mm"
        )
    flat, held = np.sort(size[:2]), np.sort(bed[:2])
    if (flat <= held + 1e-9).all():
        return [part]
    low = np.array(part.solid.bounding_box())[:3]
    solid: Any = part.solid
    cuts = []
    for axis in (0, 1):
        keep = None if features is None else features[:, axis]
        cuts.append(_cuts(low[axis], low[axis] + size[axis], bed[axis], keep))
    for axis in (0, 1):
        solid = _pinned(solid, cuts, axis)
    pieces = _sliced(solid, cuts[0], 0)
    pieces = [piece for strip in pieces for piece in _sliced(strip, cuts[1], 1)]
    pieces = [piece for piece in pieces if not piece.is_empty()]
    return [
        replace(
            part,
            name=f"{part.name}_piece_{k + 1}",
            title=f"{part.title}; piece {k + 1} of {len(pieces)}",
            solid=piece,
        )
        for k, piece in enumerate(pieces)
    ]


def _cuts(start: float, end: float, bed: float, keep: Floats | None) -> list[float]:
    """Places of the cuts along one axis, m."""
    count = int(np.ceil((end - start) / bed))
    cuts: list[float] = []
    for k in range(1, count):
        even = start + k * (end - start) / count
        first = (cuts[-1] if cuts else start) + bed
        left = end - (count - k) * bed
        tried = np.arange(max(left, even - bed / 4), min(first, even + bed / 4) + _STEP / 2, _STEP)
        if keep is None or not len(tried):
            cuts.append(even)
            continue
        apart = np.abs(tried[:, None] - keep).min(axis=1)
        best = apart.max()
        good = tried[apart > best - 1e-6]
        cuts.append(float(good[np.abs(good - even).argmin()]))
    return cuts


def _pinned(solid: Any, cuts: list[list[float]], axis: int) -> Any:
    """Holes of pins across the cuts of one axis."""
    box = np.array(solid.bounding_box()).reshape(2, 3)
    if box[1, 2] - box[0, 2] < 4 * _PIN:
        return solid
    other = 1 - axis
    ends = [box[0, other], *cuts[other], box[1, other]]
    middle = min((box[0, 2] + box[1, 2]) / 2, box[0, 2] + 1.5e-3 + _PIN)
    holes = []
    for cut in cuts[axis]:
        for first, last in pairwise(ends):
            for share in (0.2, 0.8):
                pin = prism(disc((0.0, 0.0), _PIN), -_DEEP, _DEEP)
                pin = pin.rotate((0.0, 90.0, 0.0) if axis == 0 else (90.0, 0.0, 0.0))
                place = [0.0, 0.0, float(middle)]
                place[axis], place[other] = float(cut), float(first + share * (last - first))
                holes.append(pin.translate(tuple(place)))
    for pin in holes:
        if (solid ^ pin).volume() > _WITHIN * pin.volume():  # a rolled part has nothing there
            solid = solid - pin
    return solid


def _sliced(solid: Any, cuts: list[float], axis: int) -> list[Any]:
    """Pieces between planes across one axis."""
    normal = [0.0, 0.0, 0.0]
    normal[axis] = 1.0
    pieces, rest = [], solid
    for cut in cuts:
        upper, lower = rest.split_by_plane(tuple(normal), cut)
        pieces.append(lower)
        rest = upper
    return [*pieces, rest]
