"""Files of a tessellated sheet, as text: FOLD documents, a mesh, a drawing, and its validity.

Decides units (millimetres and degrees), the order of edges, and which frames a document carries;
simulators read no frames, so that what they need lies at the top.
"""

import json
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.origami.sheet import Sheet
from smoskin.origami.tessellation.hinges import laid_onto
from smoskin.origami.tessellation.tessellate import Tessellation

_COLOURS: Final = {"M": "#ff0000", "V": "#0000ff", "B": "#000000"}
"""Strokes by assignment that the browser's origami simulator reads."""
_DIGITS: Final = 12
"""Decimals of coordinates in mm."""


def folded_form(made: Tessellation, title: str) -> str:
    """The FOLD document of the attached sheet, with frames from flat to folded where known."""
    edges, names, angles = _edges(made.sheet, made.angles)
    steps = made.folding.steps if made.folding is not None else np.empty((0, 0, 3))
    frames = [
        {
            "frame_title": f"step {k} of {len(steps) - 1}",
            "frame_classes": ["creasePattern" if k == 0 else "foldedForm"],
            "frame_parent": 0,
            "frame_inherit": True,
            "vertices_coords": _millimetres(step),
            "edges_foldAngle": _eased(angles, k / (len(steps) - 1)),
        }
        for k, step in enumerate(steps)
    ]
    document = _head(title, "foldedForm") | {
        "vertices_coords": _millimetres(made.sheet.vertices),
        "edges_vertices": edges,
        "edges_assignment": names,
        "edges_foldAngle": angles,
        "faces_vertices": made.sheet.facets.tolist(),
    }
    return json.dumps(document | ({"file_frames": frames} if frames else {}))


def crease_pattern(made: Tessellation, title: str) -> str:
    """The FOLD document of the flat pattern, with the angles that it folds to."""
    edges, names, angles = _edges(made.sheet, made.angles)
    flat = np.pad(made.pattern, ((0, 0), (0, 1)))
    document = _head(title, "creasePattern") | {
        "vertices_coords": _millimetres(flat),
        "edges_vertices": edges,
        "edges_assignment": names,
        "edges_foldAngle": angles,
        "faces_vertices": made.sheet.facets.tolist(),
    }
    return json.dumps(document)


def validity(made: Tessellation, **more: Any) -> str:
    """The gates with values and limits, how the sheet folds, and advice."""
    folding = made.folding
    document: dict[str, Any] = {
        "holds": made.holds,
        "gates": [gate.as_json() for gate in made.gates],
        "folds": made.folds,
        "flat_foldable": made.flat_foldable,
        "lowest_singular_values": list(made.rigidity),
        "columns_longer_mm": np.round(1e3 * made.lifts, 6).tolist(),
        "refolding_strain": None if folding is None else folding.strain,
        "refolding_twist_deg": None if folding is None else float(np.degrees(folding.twist)),
        "refolding_error_mm": None if folding is None else 1e3 * refolding_error(made),
        "advice": made.advice,
    }
    return json.dumps(document | more, indent=1)


def refolding_error(made: Tessellation) -> float:
    """Root mean square by which the refolded pattern misses the sheet, m, moved on to it."""
    assert made.folding is not None
    off = laid_onto(made.folding.steps[-1], made.sheet.vertices) - made.sheet.vertices
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def mesh_text(made: Tessellation, title: str) -> str:
    """The folded sheet as an OBJ file of quadrilaterals, mm."""
    lines = [f"# {title}, millimetres"]
    lines += ["v " + " ".join(repr(x) for x in row) for row in _millimetres(made.sheet.vertices)]
    lines += ["f " + " ".join(str(k + 1) for k in row) for row in made.sheet.facets.tolist()]
    return "\n".join(lines) + "\n"


def drawing(made: Tessellation, title: str) -> str:
    """The flat pattern as an SVG drawing, mm: ridges red, valleys blue, the border black.

    The opacity of a crease is its angle over 180 degrees; y points up.
    """
    edges, names, angles = _edges(made.sheet, made.angles)
    flat = 1e3 * made.pattern * [1.0, -1.0]
    low, high = flat.min(axis=0) - 5, flat.max(axis=0) + 5
    size = high - low
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:.3f}mm" height="{size[1]:.3f}mm" '
        f'viewBox="{low[0]:.3f} {low[1]:.3f} {size[0]:.3f} {size[1]:.3f}">',
        f"<title>{title}</title>",
    ]
    for (p, q), name, angle in zip(edges, names, angles, strict=True):
        opacity = 1.0 if name == "B" else abs(angle or 0.0) / 180
        ends = " ".join(
            f'{axis}{k + 1}="{flat[v, c]:.6f}"'
            for k, v in enumerate((p, q))
            for c, axis in enumerate("xy")
        )
        lines.append(
            f'<line {ends} stroke="{_COLOURS[name]}" stroke-width="0.2" opacity="{opacity:.4f}"/>'
        )
    return "\n".join([*lines, "</svg>"]) + "\n"


def _head(title: str, kind: str) -> dict[str, Any]:
    """Beginning of a FOLD document."""
    return {
        "file_spec": 1.2,
        "file_creator": "smoskin",
        "file_title": title,
        "file_classes": ["singleModel"],
        "frame_title": title,
        "frame_classes": [kind],
        "frame_attributes": ["3D"] if kind == "foldedForm" else ["2D"],
        "frame_unit": "mm",
    }


def _edges(sheet: Sheet, folds: Floats) -> tuple[list[list[int]], list[str], list[float | None]]:
    """Every edge of a sheet, its assignment, and its angle, deg; a border has none."""
    sides = np.concatenate([sheet.facets[:, [k, (k + 1) % 4]] for k in range(4)])
    edges = np.unique(np.sort(sides, axis=1), axis=0).tolist()
    creases = {
        (min(pair), max(pair)): (bool(ridge), float(np.degrees(angle)))
        for pair, ridge, angle in zip(sheet.creases.tolist(), sheet.mountain, folds, strict=True)
    }
    names, angles = [], []
    for p, q in edges:
        ridge, angle = creases.get((p, q), (None, None))
        names.append("B" if ridge is None else "M" if ridge else "V")
        angles.append(angle)
    return edges, names, angles


def _eased(angles: Sequence[float | None], share: float) -> list[float | None]:
    """Angles on the way, deg: tangents of their halves grow together."""
    return [
        None
        if angle is None
        else float(np.degrees(2 * np.arctan(share * np.tan(np.radians(angle) / 2))))
        for angle in angles
    ]


def _millimetres(places: Floats) -> list[list[float]]:
    """Places in mm."""
    return np.round(1e3 * places, _DIGITS).tolist()  # type: ignore[no-any-return]
