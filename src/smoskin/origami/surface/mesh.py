"""Triangle meshes as files hold them, checked, and the STL files of what is made.

Decides which meshes are surfaces at all: finite, with one orientation, no edge with over two
triangles, and few enough. Where a sheet lies on one, `smoskin.origami.surface.chart` looks closer.
"""

import struct
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np

from smoskin.arguments import typed
from smoskin.arrays import Floats, Ints, assign, freeze
from smoskin.errors import ArgumentError, require
from smoskin.outputs import read_input

LARGEST: Final = 200_000
"""Triangles of a mesh."""
_FORMATS: Final = ("stl", "obj", "ply")
_BYTES: Final = 128 * 2**20
"""Largest file that is read."""
_SAME: Final = 1e-7
"""Distance over the mesh's extent at which vertices are one."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """An oriented triangle mesh, open or closed.

    It raises an `ArgumentError` for more than `LARGEST` triangles, indices out of range, values
    that are not finite, edges with over two triangles, and triangles turned against each other.
    """

    vertices: Floats
    """(V, 3), m."""
    triangles: Ints
    """(T, 3): vertices of each, counter-clockwise seen from outside."""

    def __post_init__(self) -> None:
        freeze(self, vertices=(None, 3))
        triangles = np.asarray(self.triangles, dtype=np.int64)
        if len(triangles) > LARGEST:
            raise ArgumentError(
                f"a mesh must have at most {LARGEST:,} triangles; got {len(triangles):,}: cut out "
                "the part that the skin covers, or decimate it (MeshLab, Blender)"
            )
        if triangles.ndim != 2 or triangles.shape[1:] != (3,) or not len(triangles):
            raise ArgumentError(f"triangles must have shape (T, 3); got {triangles.shape}")
        if triangles.min() < 0 or triangles.max() >= len(self.vertices):
            raise ArgumentError("triangles must name vertices of the mesh")
        if not np.isfinite(self.vertices).all():
            raise ArgumentError("vertices must be finite")
        assign(self, triangles=triangles)
        self._check_edges()

    def _check_edges(self) -> None:
        """Refuse edges that no surface has."""
        directed = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        edges, counts = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
        if (counts > 2).any():
            raise ArgumentError(
                f"{int((counts > 2).sum())} edges of the mesh have over two triangles, one near "
                f"{self._place(edges[counts > 2][0])}; it must be one surface without inner walls"
            )
        each, counts = np.unique(directed, axis=0, return_counts=True)
        if (counts > 1).any():
            raise ArgumentError(
                f"triangles of the mesh are turned against their neighbours near "
                f"{self._place(each[counts > 1][0])}; make its normals point outside everywhere"
            )

    @cached_property
    def edges(self) -> Ints:
        """(E, 2): every edge once in each of both directions."""
        directed = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        return np.asarray(np.unique(np.concatenate([directed, directed[:, ::-1]]), axis=0))

    @cached_property
    def rim(self) -> Ints:
        """(B, 2): edges with a triangle on one side alone."""
        directed = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        edges, counts = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
        return np.asarray(edges[counts == 1])

    @cached_property
    def normals(self) -> Floats:
        """(V, 3): unit normals at the vertices, by the areas round them."""
        p, q, r = (self.vertices[self.triangles[:, k]] for k in range(3))
        areas = np.cross(q - p, r - p)
        sums = np.zeros_like(self.vertices)
        for k in range(3):
            np.add.at(sums, self.triangles[:, k], areas)
        return np.asarray(sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-300))

    def _place(self, edge: Ints) -> str:
        """Middle of an edge, for messages."""
        return place_text(self.vertices[edge].mean(axis=0))


def place_text(place: Floats) -> str:
    """A place in millimetres, for messages."""
    return f"({', '.join(f'{1e3 * x:.1f}' for x in place)}) mm"


@typed
def read_mesh(path: str | PathLike[str]) -> Mesh:
    """The mesh of an STL, OBJ or PLY file in millimetres.

    Vertices at one place become one, as STL files repeat them; triangles without area go.

    Raises
    ------
    ArgumentError
        If the format is another or `Mesh` refuses it.
    FileError
        If the file cannot be read.
    MissingExtraError
        If trimesh, the extra ``mesh``, is not installed.
    """
    vertices, triangles = read_triangles(path)
    if len(triangles) <= LARGEST and np.isfinite(vertices).all():
        vertices, triangles = _merged(vertices, triangles)
    return Mesh(vertices, triangles)


def read_triangles(path: str | PathLike[str]) -> tuple[Floats, Ints]:
    """Vertices (V, 3), m, and triangles (T, 3) of such a file as they are, of any bodies.

    Errors are those of `read_mesh`, but for `Mesh`'s own.
    """
    require("reading meshes", "mesh", "trimesh")
    import trimesh

    kind = Path(path).suffix[1:].lower()
    if kind not in _FORMATS:
        raise ArgumentError(f"a mesh must end with .{', .'.join(_FORMATS)}; got {Path(path).name}")
    content = read_input(path, _BYTES)
    try:
        read = trimesh.load_mesh(BytesIO(content), file_type=kind, process=False)
        vertices, triangles = np.asarray(read.vertices, float), np.asarray(read.faces, np.int64)
    except Exception as error:  # readers of foreign files raise whatever comes to them
        raise ArgumentError(f"{path} cannot be read as a mesh: {error}") from error
    if not len(triangles):
        raise ArgumentError(f"{path} must hold triangles; got none")
    return 1e-3 * vertices, triangles


def halved(facets: Ints) -> Ints:
    """Two triangles for each quadrilateral (F, 4)."""
    return np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])


def format_stl(vertices: Floats, triangles: Ints, title: str) -> bytes:
    """A binary STL file, mm, of vertices (V, 3), m, and triangles (T, 3)."""
    corners = (1e3 * vertices)[triangles].astype("<f4")
    sides = corners[:, 1:] - corners[:, :1]
    normals = np.cross(sides[:, 0], sides[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = (normals / np.where(lengths > 0, lengths, 1.0)).astype("<f4")
    rows = np.zeros(len(triangles), dtype=[("f", "<f4", 12), ("end", "<u2")])
    rows["f"] = np.concatenate([normals, corners.reshape(-1, 9)], axis=1)
    head = title.encode()[:80].ljust(80)
    return head + struct.pack("<I", len(rows)) + rows.tobytes()


def _merged(vertices: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Vertices at one place as one, and triangles that still have three."""
    extent = float(np.ptp(vertices, axis=0).max()) or 1.0
    grid = np.round((vertices - vertices.min(axis=0)) / (_SAME * extent)).astype(np.int64)
    _, first, which = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    triangles = which.ravel()[triangles]
    sound = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    return vertices[first], triangles[sound]
