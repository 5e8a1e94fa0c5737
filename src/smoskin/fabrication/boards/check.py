"""Own check of a layout: copper, holes, edges, what stands on the board, and what is magnetic.

Decides whether a board may leave this package, also where KiCad is not installed. All copper is
taken as straight segments of a radius; a land is its four edges and its middle line.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from smoskin.arrays import Floats, Ints
from smoskin.fabrication.boards import parts
from smoskin.fabrication.boards.layout import Layout
from smoskin.fabrication.boards.parts import Pad
from smoskin.fabrication.boards.rules import house_of

MAGNETIC_DISTANCE: Final = 10.0
"""mm: from the middle of a chip to anything magnetic."""
FOOT_MARGIN: Final = 0.2
"""mm: from a foot's edge to a land or via."""
_BESIDE: Final = 4.5
"""mm: farthest middle of a chip's own capacitor."""
_ROUNDING: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Copper:
    """All copper of one face as segments."""

    ends: Floats
    """(K, 2, 2), mm."""
    radii: Floats
    """(K,), mm."""
    nets: tuple[str, ...]
    names: tuple[str, ...]
    """What a segment belongs to, in words."""
    keys: tuple[str, ...]
    """Which item a segment is a part of, the same on both faces."""


def layout_faults(layout: Layout) -> tuple[str, ...]:
    """Broken rules of a layout, each in a sentence with its measure and limit."""
    faces = {face: _copper(layout, face) for face in ("F", "B")}
    return (
        *_outside(layout, faces),
        *_on_keep_outs(layout),
        *_magnetic(layout),
        *(fault for copper in faces.values() for fault in _too_close(layout, copper)),
        *_holes_too_close(layout),
        *_apart(layout, faces),
        *_flexible(layout),
    )


def pads_of(layout: Layout) -> Iterator[tuple[str, str, Pad, tuple[str, ...]]]:
    """Every pad on the board: its component's reference, net, place and faces."""
    for placed in layout.placed:
        component = placed.component
        for pad in placed.on_board(component.part.pads):
            net = component.nets.get(pad.number, "")
            yield component.reference, net, pad, layout.faces_of(placed, pad)


def _corners(pad: Pad) -> Floats:
    x, y = pad.width / 2, pad.height / 2
    middle = pad.x, pad.y
    return np.asarray(middle + np.array([[-x, -y], [x, -y], [x, y], [-x, y]]))


def _copper(layout: Layout, face: str) -> _Copper:
    """Copper of one face."""
    house = house_of(layout)
    rows: list[tuple[list[list[float]], float, str, str, str]] = []
    for k, track in enumerate(layout.tracks):
        if track.face == face:
            line = [[*track.start], [*track.end]]
            rows.append((line, track.width / 2, track.net, f"a line of {track.net}", f"track {k}"))
    for k, via in enumerate(layout.vias):
        place = [[via.x, via.y]] * 2
        rows.append((place, house.via / 2, via.net, f"a via of {via.net}", f"via {k}"))
    for k, (reference, net, pad, on) in enumerate(pads_of(layout)):
        if face not in on:
            continue
        owner = net or f"unconnected {k}", f"pad {pad.number} of {reference}", f"pad {k}"
        if pad.hole:
            rows.append(([[pad.x, pad.y]] * 2, pad.width / 2, *owner))
            continue
        corners = _corners(pad).tolist()
        rows += [([corners[j - 1], corners[j]], 0.0, *owner) for j in range(4)]
        long = max(pad.width - pad.height, 0.0) / 2, max(pad.height - pad.width, 0.0) / 2
        middle = [[pad.x - long[0], pad.y - long[1]], [pad.x + long[0], pad.y + long[1]]]
        rows.append((middle, min(pad.width, pad.height) / 2, *owner))
    return _Copper(
        ends=np.array([row[0] for row in rows]).reshape(-1, 2, 2),
        radii=np.array([row[1] for row in rows]),
        nets=tuple(row[2] for row in rows),
        names=tuple(row[3] for row in rows),
        keys=tuple(row[4] for row in rows),
    )


def _to_segment(points: Floats, ends: Floats) -> Floats:
    """Distance of points (..., 2) from segments (..., 2, 2)."""
    start, along = ends[..., 0, :], ends[..., 1, :] - ends[..., 0, :]
    length = np.maximum((along**2).sum(axis=-1), 1e-18)
    share = np.clip((((points - start) * along).sum(axis=-1)) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - start - share[..., None] * along, axis=-1))


def _distances(a: Floats, b: Floats) -> Floats:
    """Distances of segments (..., 2, 2) from others of a shape that fits; 0 where they cross."""
    near = np.minimum.reduce(
        [
            *(_to_segment(a[..., k, :], b) for k in range(2)),
            *(_to_segment(b[..., k, :], a) for k in range(2)),
        ]
    )

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        u, v = q - p, r - p
        return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    p, q, r, s = a[..., 0, :], a[..., 1, :], b[..., 0, :], b[..., 1, :]
    crossing = (side(p, q, r) * side(p, q, s) < 0) & (side(r, s, p) * side(r, s, q) < 0)
    return np.where(crossing, 0.0, near)


def _neighbours(copper: _Copper, reach: float) -> tuple[Ints, Ints, Floats]:
    """Pairs of segments of a face nearer than `reach`, mm, and the gaps between them, mm."""
    low = copper.ends.min(axis=1) - copper.radii[:, None]
    high = copper.ends.max(axis=1) + copper.radii[:, None]
    beside = (low[:, None] - high[None] < reach).all(axis=-1)
    first, second = np.nonzero(np.triu(beside & beside.T, k=1))
    gaps = _distances(copper.ends[first], copper.ends[second])
    gaps = gaps - copper.radii[first] - copper.radii[second]
    return first, second, gaps


def _too_close(layout: Layout, copper: _Copper) -> Iterator[str]:
    """Copper of two nets closer than the house allows, and lines thinner."""
    least = house_of(layout).clearance
    for track in layout.tracks:
        if track.width < house_of(layout).track - _ROUNDING:
            yield (
                f"a line of {track.net} must be {house_of(layout).track:g} mm wide; got "
                f"{track.width:.3f} mm"
            )
    for i, j, gap in zip(*_neighbours(copper, least), strict=True):
        if copper.nets[i] != copper.nets[j] and gap < least - _ROUNDING:
            yield (
                f"{copper.names[i]} must be {least:g} mm from {copper.names[j]}; got {gap:.3f} mm "
                f"at {_at(copper.ends[i])}"
            )


def _at(ends: Floats) -> str:
    x, y = ends.mean(axis=0)
    return f"({x:.1f}, {y:.1f}) mm"


def _outside(layout: Layout, faces: dict[str, _Copper]) -> Iterator[str]:
    """Copper off the board or too near its edge, and holes too near it."""
    least = house_of(layout).edge
    edges = np.stack([layout.outline, np.roll(layout.outline, -1, axis=0)], axis=1)
    for copper in faces.values():
        gaps = _distances(copper.ends[:, None], edges[None]).min(axis=1) - copper.radii
        inside = _inside(copper.ends[:, 0], edges)
        gaps = np.where(inside, gaps, -gaps - 2 * copper.radii)
        for k in np.nonzero(gaps < least - _ROUNDING)[0]:
            where = "" if inside[k] else ", off the board"
            yield (
                f"{copper.names[k]} must lie {least:g} mm inside the board's edge; got "
                f"{gaps[k]:.3f} mm{where}, at {_at(copper.ends[k])}"
            )


def _inside(points: Floats, edges: Floats) -> Floats:
    """Which points (K, 2) lie inside a polygon of edges (L, 2, 2)."""
    (x, y), (a, b) = points.T[:, :, None], (edges[:, 0].T, edges[:, 1].T)
    rise = np.where(b[1] == a[1], 1.0, b[1] - a[1])
    across = ((a[1] > y) != (b[1] > y)) & (x < (b[0] - a[0]) * (y - a[1]) / rise + a[0])
    return np.asarray(across.sum(axis=1) % 2 == 1)


def _on_keep_outs(layout: Layout) -> Iterator[str]:
    """Lands and vias on which something else stands."""
    radius, pads = house_of(layout).via / 2, list(pads_of(layout))
    for area in layout.keep_outs:
        middle = np.array([area.x, area.y])
        touching = [
            (f"pad {pad.number} of {reference}", _to_box(middle, pad))
            for reference, _, pad, faces in pads
            if area.face in faces
        ]
        if not area.vias:
            touching += [
                (f"a via of {via.net}", float(np.hypot(via.x - area.x, via.y - area.y)) - radius)
                for via in layout.vias
            ]
        for name, distance in touching:
            gap = distance - area.radius
            if gap < FOOT_MARGIN - _ROUNDING:
                yield (
                    f"{name} must be {FOOT_MARGIN:g} mm clear of {area.what} at "
                    f"({area.x:.1f}, {area.y:.1f}) mm; got {gap:.3f} mm"
                )


def _to_box(point: Floats, pad: Pad) -> float:
    """Distance of a point from a land, mm."""
    off = np.abs(point - (pad.x, pad.y)) - (pad.width / 2, pad.height / 2)
    return float(np.linalg.norm(np.maximum(off, 0.0)))


def _magnetic(layout: Layout) -> Iterator[str]:
    """Magnetic parts beside a chip, and capacitors that are not beside theirs."""
    chips = {p.component.reference: p for p in layout.placed if p.component.part is parts.MLX90393}
    for placed in layout.placed:
        part, reference = placed.component.part, placed.component.reference
        if (owner := placed.component.serves) in chips:
            away = np.hypot(placed.x - chips[owner].x, placed.y - chips[owner].y)
            if away > _BESIDE:
                yield f"{reference} must stand within {_BESIDE:g} mm of {owner}; got {away:.1f} mm"
        if not part.magnetic:
            continue
        for pad in placed.on_board(part.pads):
            for name, chip in chips.items():
                away = _to_box(np.array([chip.x, chip.y]), pad)
                if away < MAGNETIC_DISTANCE:
                    yield (
                        f"{reference} ({part.magnetic}) must be {MAGNETIC_DISTANCE:g} mm from "
                        f"{name}; got {away:.1f} mm"
                    )


def _holes_too_close(layout: Layout) -> Iterator[str]:
    """Drilled holes too near each other, and copper too near one of another net."""
    house = house_of(layout)
    holes = [
        (via.x, via.y, house.drill, f"the hole of a via of {via.net}", via.net)
        for via in layout.vias
    ]
    holes += [
        (pad.x, pad.y, pad.hole, f"the hole of pad {pad.number} of {reference}", net)
        for reference, net, pad, _ in pads_of(layout)
        if pad.hole
    ]
    holes += [(x, y, diameter, "the screw's hole", "no net") for x, y, diameter in layout.holes]
    places = np.array([hole[:2] for hole in holes]).reshape(-1, 2)
    sizes = np.array([hole[2] for hole in holes])
    gaps = np.linalg.norm(places[:, None] - places[None], axis=-1)
    gaps -= (sizes[:, None] + sizes[None]) / 2
    close = np.triu(gaps < house.hole_to_hole - _ROUNDING, k=1)
    for i, j in zip(*np.nonzero(close), strict=True):
        yield (
            f"{holes[i][3]} must be {house.hole_to_hole:g} mm from {holes[j][3]}; got "
            f"{gaps[i, j]:.3f} mm at ({places[i, 0]:.1f}, {places[i, 1]:.1f}) mm"
        )
    for face in ("F", "B"):
        copper = _copper(layout, face)
        for x, y, diameter, name, net in holes:
            gap = _to_segment(np.array([x, y]), copper.ends) - copper.radii - diameter / 2
            for k in np.nonzero(gap < house.hole_to_copper - _ROUNDING)[0]:
                # Round the hole of a pad without a net lies its own copper.
                if copper.nets[k] != net and (net or gap[k] > -diameter):
                    yield (
                        f"{copper.names[k]} must be {house.hole_to_copper:g} mm from {name} at "
                        f"({x:.1f}, {y:.1f}) mm; got {gap[k]:.3f} mm"
                    )


def _apart(layout: Layout, faces: dict[str, _Copper]) -> Iterator[str]:
    """Nets whose copper is not in one piece."""
    parent: dict[str, str] = {}

    def root(key: str) -> str:
        while parent.setdefault(key, key) != key:
            key = parent[key]
        return key

    nets: dict[str, str] = {}
    for copper in faces.values():
        nets |= dict(zip(copper.keys, copper.nets, strict=True))
        for i, j, gap in zip(*_neighbours(copper, _ROUNDING), strict=True):
            if gap < _ROUNDING and copper.nets[i] == copper.nets[j]:
                parent[root(copper.keys[i])] = root(copper.keys[j])
    for net in layout.circuit.nets:
        many = len({root(key) for key, other in nets.items() if other == net})
        if many != 1:
            yield f"{net} must be in one piece; got {many}"


def _flexible(layout: Layout) -> Iterator[str]:
    """Parts off the stiffeners of a flexible circuit, and anything but lines where it bends."""
    if not layout.flexible:
        return
    bare = {p.component.reference for p in layout.placed if not p.component.part.mounted}
    for reference, _, pad, faces in pads_of(layout):
        stiff = reference in bare or any(
            s.face not in faces and s.left <= pad.x <= s.right and s.low <= pad.y <= s.high
            for s in layout.stiffeners
        )
        if not stiff:
            yield f"pad {pad.number} of {reference} must lie over a stiffener; it lies over none"
    spots = [(f"a via of {via.net}", via.x, via.y) for via in layout.vias]
    spots += [(f"pad {pad.number} of {name}", pad.x, pad.y) for name, _, pad, _ in pads_of(layout)]
    for left, low, right, high in layout.bends:
        for name, x, y in spots:
            if left <= x <= right and low <= y <= high:
                yield f"{name} lies where the circuit bends, at ({x:.1f}, {y:.1f}) mm"
