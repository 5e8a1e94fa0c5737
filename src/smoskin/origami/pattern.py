"""Crease patterns of any program, and the rules that their vertices break.

Decides which frame of a FOLD document is judged, the flat one, and the rules: those without which
no neighbourhood of a vertex folds flat. Hides frames that inherit.
"""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats, Ints, assign, freeze
from smoskin.errors import DesignError
from smoskin.outputs import read_text

_LARGEST: Final = 1 << 26
"""Bytes of a document that is read, at most."""
_EXACT: Final = 1e-4
"""Angle, rad, by which rounded coordinates may break a rule."""
_FLAT: Final = 1e-9
"""Height over its extent with which a frame counts as flat."""
_UNITS: Final = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 25.4e-3}
"""Metres in FOLD's units."""
_FOLDS: Final = {"M": "mountain", "V": "valley"}
_LETTERS: Final = frozenset("BMVFUCJ")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CreasePattern:
    """A flat sheet of V vertices and E edges.

    It raises a `DesignError` if an edge has other ends than two of the vertices, or is assigned to
    nothing that FOLD knows.
    """

    vertices: Floats
    """(V, 2), in the document's unit."""
    edges: Ints
    """(E, 2): vertices at both ends."""
    assignments: tuple[str, ...]
    """FOLD's letters: `M` mountain, `V` valley, `B` border, `C` cut; others do not fold, or nobody
    knows how (`U`)."""

    def __post_init__(self) -> None:
        freeze(self, vertices=(None, 2))
        edges = np.array(self.edges, dtype=np.int64).reshape(-1, 2)
        last = len(self.vertices) - 1
        if len(edges) and not (edges.min() >= 0 and edges.max() <= last):
            raise DesignError(f"edges must have vertices 0 to {last} as ends; got {edges.max()}")
        if (edges[:, 0] == edges[:, 1]).any():
            raise DesignError("edges must have two ends; got one that begins where it ends")
        if len(self.assignments) != len(edges) or not _LETTERS.issuperset(self.assignments):
            raise DesignError(
                f"assignments must be one of {', '.join(sorted(_LETTERS))} for each of "
                f"{len(edges)} edges; got {len(self.assignments)}: "
                f"{', '.join(sorted(set(self.assignments)))}"
            )
        assign(self, edges=edges)


class BrokenRule(NamedTuple):
    """What keeps a vertex from folding flat."""

    vertex: int
    rule: str
    """Rule, by the name that it has among folders."""
    finding: str
    """What is the case instead."""


def broken_rules(pattern: CreasePattern) -> tuple[BrokenRule, ...]:
    """The rules that inner vertices break, vertex by vertex.

    Notes
    -----
    Around a vertex with n creases and sectors a_1 ... a_n between them, flat folding needs: an even
    n; sectors that alternately add up to pi (Kawasaki, Justin); two mountains more than valleys or
    two fewer (Maekawa, Justin); and a sector smaller than both beside it lies between a mountain
    and a valley (big-little-big). Creases that nobody has assigned keep the last two from being
    judged; vertices on borders and cuts fold as they like.

    Examples
    --------
    >>> cross = [[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]]
    >>> spokes = [[0, 1], [0, 2], [0, 3], [0, 4]]
    >>> pattern = CreasePattern(vertices=cross, edges=spokes, assignments=tuple("MVMV"))
    >>> [(one.vertex, one.rule, one.finding) for one in broken_rules(pattern) if one.vertex == 0]
    [(0, 'Maekawa', '2 mountains and 2 valleys, which are not two apart')]
    """
    around: list[list[tuple[float, str]]] = [[] for _ in pattern.vertices]
    open_ended: set[int] = set()
    ways = pattern.vertices[pattern.edges[:, 1]] - pattern.vertices[pattern.edges[:, 0]]
    angles = np.arctan2(ways[:, 1], ways[:, 0])
    for (p, q), letter, angle in zip(
        pattern.edges.tolist(), pattern.assignments, angles.tolist(), strict=True
    ):
        if letter in "BC":
            open_ended |= {p, q}
        elif letter in "MVU":
            around[p].append((angle % math.tau, letter))
            around[q].append(((angle + math.pi) % math.tau, letter))
    return tuple(
        BrokenRule(vertex, rule, finding)
        for vertex, creases in enumerate(around)
        if creases and vertex not in open_ended
        for rule, finding in _broken(sorted(creases))
    )


def _broken(creases: list[tuple[float, str]]) -> list[tuple[str, str]]:
    """Rules that a vertex with these creases, by their directions, breaks."""
    count, letters = len(creases), [letter for _, letter in creases]
    if count % 2:
        return [("even degree", f"{count} creases meet, an odd number")]
    turns = np.array([angle for angle, _ in creases])
    sectors = np.diff(turns, append=turns[0] + math.tau)
    broken = []
    alternate = float(sectors[::2].sum())
    if abs(alternate - math.pi) > _EXACT:
        finding = f"alternate sectors add up to {math.degrees(alternate):.2f} degrees, not 180"
        broken.append(("Kawasaki", finding))
    if "U" in letters:
        return broken
    ridges = letters.count("M")
    if abs(2 * ridges - count) != 2:
        finding = f"{ridges} mountains and {count - ridges} valleys, which are not two apart"
        broken.append(("Maekawa", finding))
    beside = np.minimum(np.roll(sectors, 1), np.roll(sectors, -1))
    for k in np.flatnonzero(sectors < beside - _EXACT).tolist():
        if letters[k] == letters[(k + 1) % count]:
            finding = (
                f"a sector of {math.degrees(sectors[k]):.2f} degrees, smaller than those beside "
                f"it, lies between two {_FOLDS[letters[k]]}s"
            )
            broken.append(("big-little-big", finding))
    return broken


@typed
def read_pattern(path: Path | str) -> CreasePattern:
    """The first flat frame of a FOLD document.

    Raises
    ------
    DesignError
        If it cannot be read, is no FOLD document, or no frame of it is flat.
    """
    with _errors_naming(path):
        for frame in _frames(path):
            pattern = _flat(frame)
            if pattern is not None:
                return pattern
    raise DesignError(f"{path}: must have a flat frame, with edges; got folded forms alone")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoldedForms:
    """A sheet of V vertices in S states, with its faces."""

    frames: Floats
    """(S, V, 3), m: states from flat to folded, in the document's order."""
    faces: tuple[tuple[int, ...], ...]
    """Vertices round each face."""


@typed
def read_forms(path: Path | str) -> FoldedForms:
    """The states of a FOLD document's sheet; flat ones come first, the document's own form last.

    Coordinates are millimetres unless the document says another unit.

    Raises
    ------
    DesignError
        If it cannot be read, is no FOLD document, has no faces, or its frames differ in vertices.
    """
    with _errors_naming(path):
        frames = _frames(path)
        faces = next((frame["faces_vertices"] for frame in frames if "faces_vertices" in frame), ())
        polygons = tuple(tuple(int(vertex) for vertex in face) for face in faces)
        unit = _UNITS.get(frames[0].get("frame_unit", "mm"), _UNITS["mm"])
        states = [unit * _places(frame["vertices_coords"]) for frame in frames]
        if not polygons or min(map(len, polygons)) < 3:
            raise DesignError("faces_vertices must name three vertices or more of every face")
        if {len(state) for state in states} != {len(states[0])}:
            raise DesignError("frames must have the same vertices; got other numbers of them")
        last = max(map(max, polygons))
        if last >= len(states[0]) or min(map(min, polygons)) < 0:
            raise DesignError(f"faces must have vertices 0 to {len(states[0]) - 1}; got {last}")
        # A document's own form comes first in it, and its frames lead there.
        return FoldedForms(frames=np.array([*states[1:], states[0]]), faces=polygons)


def _frames(path: Path | str) -> list[dict[str, Any]]:
    """Frames of a FOLD document that have vertices of their own, with what they inherit."""
    document = json.loads(read_text(path, _LARGEST, DesignError))
    frames = [document, *document.get("file_frames", ())]
    places = [k for k, frame in enumerate(frames) if "vertices_coords" in frame]
    if not places:
        raise DesignError("must be a FOLD document; got no vertices_coords")
    return [_inherited(frames, k) for k in places]


@contextmanager
def _errors_naming(path: Path | str) -> Iterator[None]:
    """Whatever is wrong with a document is one sentence, with its name."""
    try:
        yield
    except DesignError as error:
        message = str(error)
        raise DesignError(
            message if message.startswith(f"{path}") else f"{path}: {message}"
        ) from error
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise DesignError(f"{path}: must be a FOLD document; got {error!r}") from error


def _places(coordinates: Any) -> Floats:
    """Vertices (V, 3) of two or three coordinates each."""
    places = np.array(coordinates, dtype=float)
    if places.ndim != 2 or places.shape[1] not in (2, 3) or not np.isfinite(places).all():
        raise DesignError("vertices_coords must be rows of two or three finite numbers")
    return np.pad(places, ((0, 0), (0, 3 - places.shape[1])))


def _inherited(frames: list[dict[str, Any]], number: int) -> dict[str, Any]:
    """A frame with what it takes from its parents, the first of which is the document."""
    frame = frames[number]
    parent = int(frame.get("frame_parent", 0))
    if number == 0 or not frame.get("frame_inherit") or not 0 <= parent < number:
        return frame
    return _inherited(frames, parent) | frame


def _flat(frame: dict[str, Any]) -> CreasePattern | None:
    """The pattern of a frame; None if it is not flat or has no edges."""
    places = _places(frame["vertices_coords"])
    depth = np.ptp(places[:, 2:], axis=0)
    if (depth > _FLAT * np.ptp(places)).any() or not frame.get("edges_vertices"):
        return None
    edges = frame["edges_vertices"]
    letters = frame.get("edges_assignment", ["U"] * len(edges))
    return CreasePattern(
        vertices=places[:, :2], edges=np.array(edges), assignments=tuple(map(str, letters))
    )
