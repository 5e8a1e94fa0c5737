"""Surfaces by their names: closed forms with their lengths in mm, or files of meshes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from smoskin.arrays import Floats
from smoskin.design.skin import MiuraCell
from smoskin.errors import ArgumentError
from smoskin.origami.cell import size
from smoskin.origami.surface.analytic import Bump, Cone, Cylinder, Plane, Saddle, Sphere
from smoskin.origami.surface.chart import chart_of
from smoskin.origami.surface.mesh import read_mesh
from smoskin.origami.surface.surface import Surface

_KINDS: Final[dict[str, tuple[Any, str]]] = {
    "plane": (Plane, ""),
    "cylinder": (Cylinder, "R"),
    "cone": (Cone, "R1,R2,H"),
    "sphere": (Sphere, "R"),
    "saddle": (Saddle, "R"),
    "bump": (Bump, "HEIGHT,WIDTH"),
}
"""Surfaces in closed form and what their lengths, in mm, are."""
_MESHES: Final = (".stl", ".obj", ".ply")


def named_surface(
    text: str, cell: MiuraCell, cells: tuple[int, int], at: Sequence[float], along: Sequence[float]
) -> tuple[Surface, float]:
    """The surface of a text, and how rough a mesh is, m."""
    if Path(text).suffix.lower() in _MESHES:
        point, direction = 1e-3 * _vector("at", at), _vector("along", along)
        length, width, _ = (float(extent) for extent in size(cell))
        reach = ((cells[0] + 1) * length, (cells[1] + 1) * width)
        chart = chart_of(read_mesh(text), point, direction, reach, length)
        return chart, chart.roughness
    kind, _, numbers = text.partition(":")
    if kind not in _KINDS:
        forms = ", ".join(f"{name}:{what}" if what else name for name, (_, what) in _KINDS.items())
        raise ArgumentError(f"surface must be {forms} or a file {', '.join(_MESHES)}; got {text!r}")
    make, names = _KINDS[kind]
    parts = numbers.split(",") if numbers else []
    try:
        lengths = [1e-3 * float(number) for number in parts]
    except ValueError:
        lengths = []
    if len(lengths) != len(names.split(",")) * bool(names):
        raise ArgumentError(f"surface must be {kind}:{names} with lengths in mm; got {text!r}")
    return make(*lengths), 0.0


def _vector(name: str, values: Sequence[float]) -> Floats:
    """Three finite numbers."""
    given = np.array(values, dtype=np.float64)
    if given.shape != (3,) or not np.isfinite(given).all():
        raise ArgumentError(f"{name} must be three numbers; got {tuple(values)}")
    return given
