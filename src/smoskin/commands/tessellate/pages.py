"""Pages of a tessellated sheet: its report, and its way from flat to folded to attached.

Decides what a browser shows of a sheet: every gate, and where it is strained, short of room or off
its surface.
"""

import base64
from collections.abc import Sequence
from html import escape
from typing import Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.origami.surface.mesh import halved
from smoskin.origami.surface.surface import forms
from smoskin.origami.tessellation.hinges import fold_angles, frame_of, laid_onto
from smoskin.origami.tessellation.tessellate import Tessellation
from smoskin.space import Body, Shade, page

_STYLE: Final = (
    "body{font:16px/1.45 sans-serif;max-width:60em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #bbb;padding:.3em .6em;"
    "text-align:left}img{width:100%}.NO{background:#fbd5cf}"
)
_DOWN: Final = 4
"""Frames from over the surface down to it."""
_STRAIN: Final = 0.5
"""%: end of the scale of strain, the most that film and panels may be strained when they fold."""
_PAIRS: Final = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]])
"""Edges and diagonals of a panel."""


def report_page(
    title: str,
    verdict: str,
    tables: Sequence[tuple[str, Sequence[Sequence[str]]]],
    links: Sequence[str],
    picture: bytes,
    alt: str = "the sheet, folded and flat",
) -> bytes:
    """A report: what it comes to, tables with their titles and heads, files, and an SVG."""
    out = [
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">',
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{escape(title)}</h1><p>{escape(verdict)}</p>",
        f'<img alt="{escape(alt)}" src="data:image/svg+xml;base64,'
        f'{base64.b64encode(picture).decode()}">',
    ]
    for heading, rows in tables:
        out.append(f"<h2>{escape(heading)}</h2><table>")
        for k, row in enumerate(rows):
            cell = "td" if k else "th"
            mark = ' class="NO"' if row[-1] == "NO" else ""
            cells = "".join(f"<{cell}>{escape(text)}</{cell}>" for text in row)
            out.append(f"<tr{mark}>{cells}</tr>")
        out.append("</table>")
    files = ", ".join(f'<a href="{escape(name)}">{escape(name)}</a>' for name in links)
    return "\n".join([*out, f"<p>Files: {files}</p></body></html>\n"]).encode()


def fold_page(made: Tessellation, title: str) -> bytes:
    """The sheet on its surface with a slider from flat to folded to attached.

    Before it is attached it is shown over the surface. Panels may be coloured by their strain, by
    the gap that their creases need over the room there is, and by how far they are off the surface.
    """
    frames = _frames(made)
    facets = made.sheet.facets
    # Every panel has its own corners, so that it has one colour.
    corners = np.arange(facets.size).reshape(facets.shape)
    sheet = Body(
        name="sheet",
        colour="#9ecae1",
        frames=frames[:, facets].reshape(len(frames), -1, 3),
        triangles=halved(corners),
        shades=[
            Shade(name=name, unit=unit, top=top, values=np.repeat(values, 4, axis=1))
            for name, unit, top, values in (
                ("strain", "%", _STRAIN, 100 * _strains(made, frames)),
                ("gap of creases over its room", "", 1.0, _gaps(made, frames)),
                ("distance from the surface, attached", "mm", *_distances(made, len(frames))),
            )
        ],
    )
    return page([sheet, _ground(made)], title, "fold", start=1.0)


def _frames(made: Tessellation) -> Floats:
    """Vertices from flat to folded over the surface, and down to it, (S, V, 3), m."""
    aim = made.sheet.vertices
    if made.folding is None:
        return aim[None]
    up = made.normals.mean(axis=(0, 1))
    up = up / np.linalg.norm(up)
    raised = (np.ptp(aim @ up) + 0.1 * np.ptp(aim, axis=0).max()) * up
    way, onto = [], aim
    for step in made.folding.steps[::-1]:
        onto = laid_onto(step, onto)
        way.append(onto + raised)
    folded = way[0]
    down = [folded + (k + 1) / _DOWN * (aim - folded) for k in range(_DOWN)]
    return np.array([*way[::-1], *down])


def _strains(made: Tessellation, frames: Floats) -> Floats:
    """Largest strain of each panel's edges and diagonals against the flat pattern, (S, F)."""
    ends = made.sheet.facets[:, _PAIRS]

    def lengths(places: Floats) -> Floats:
        spans = places[..., ends[..., 0], :] - places[..., ends[..., 1], :]
        return np.asarray(np.linalg.norm(spans, axis=-1))

    return np.asarray(np.abs(lengths(frames) / lengths(made.pattern) - 1).max(axis=-1))


def _gaps(made: Tessellation, frames: Floats) -> Floats:
    """Gap that each panel's creases need over the room that the sheet's panels leave, (S, F)."""
    facets, creases = made.sheet.facets, made.sheet.creases
    hinges = frame_of(made.sheet.vertices, facets, creases).creases
    folds = np.array([fold_angles(places, hinges) for places in frames])
    room = next(gate.limit for gate in made.gates if gate.name == "crease_gap") * 1e-3
    needed = 2 * made.plate * np.tan(np.abs(folds) / 2) / room
    shares = np.zeros((len(frames), len(facets)))
    for k, (p, q) in enumerate(creases.tolist()):
        beside = np.flatnonzero((facets == p).any(axis=1) & (facets == q).any(axis=1))
        shares[:, beside] = np.maximum(shares[:, beside], needed[:, k, None])
    return shares


def _distances(made: Tessellation, count: int) -> tuple[float, Floats]:
    """Limit of a bottom vertex' distance, mm, and each panel's largest in all frames, (S, F)."""
    limit = next(gate.limit for gate in made.gates if gate.name == "distance_to_surface")
    off = np.zeros(len(made.layers))
    off[made.sheet.columns] = 1e3 * np.abs(made.lifts)
    return limit, np.tile(off[made.sheet.facets].max(axis=1), (count, 1))


def _ground(made: Tessellation) -> Body:
    """The surface under the sheet."""
    low, high = made.layers[:, :2].min(axis=0), made.layers[:, :2].max(axis=0)
    lines = [np.linspace(a, b, 61) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
    inside = made.surface.holds(grid)
    index = np.arange(inside.size).reshape(inside.shape)
    facets = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1)
    kept = facets.reshape(-1, 4)[inside.ravel()[facets.reshape(-1, 4)].all(axis=1)]
    used, numbers = np.unique(kept, return_inverse=True)
    places = forms(made.surface, grid.reshape(-1, 2)[used]).places
    return Body(
        name="surface",
        colour="#d8d2c4",
        frames=places[None],
        triangles=halved(numbers.reshape(kept.shape)),
    )
